"""The initial gap of a result as a quadratic form, under which Hertz's solution holds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import DeckError
from ..variables import BULK_STRESS, INTERFACE
from .elliptic import EllipticContact, hertz_ellipse

if TYPE_CHECKING:
    import xarray


SIMILAR = 1e-9  # |beta| of bodies whose pressure is that of the contact without friction


def attribute_of(attributes: Mapping[Any, Any], name: str, default: float = math.nan) -> float:
    """Return a number among the attributes of a result."""
    return float(attributes.get(name, default))


def friction_of(attributes: Mapping[Any, Any]) -> float:
    """Return the coefficient of friction of a result by its attributes; 0 for one without friction."""
    if attributes.get("algorithm", "frictionless") == "frictionless":
        return 0.0
    return attribute_of(attributes, "friction_coefficient", 0.0)


def is_compliant(attributes: Mapping[Any, Any]) -> bool:
    """Test whether the bodies of a result penetrate each other, so that no closed solution holds."""
    return INTERFACE[0] in attributes


def is_strained(dataset: xarray.Dataset) -> bool:
    """Test whether there is a bulk stress, for which closed solutions of shear do not hold."""
    return any(bool(np.any(dataset[name])) for name in BULK_STRESS if name in dataset)


def is_worn(dataset: xarray.Dataset) -> bool:
    """Test whether wear has changed the surfaces by the last load step, so that no closed solution holds."""
    worn = dataset.get("max_worn_depth")
    return worn is not None and bool(np.ravel(worn)[-1] > 0.0)


def pressure_is_frictionless(attributes: Mapping[Any, Any]) -> bool:
    """Test whether the pressure of a result is that of a contact without friction, see `recognise`."""
    return (
        friction_of(attributes) == 0.0
        or abs(attribute_of(attributes, "dundurs_beta")) <= SIMILAR
        or attributes.get("coupling") == "goodman"
    )


@dataclass(frozen=True)
class QuadraticGap:
    """An initial gap that is a quadratic form: sphere, cylinder, paraboloid.

    Attributes
    ----------
    modulus : float
        E*, Pa.
    hessian : ndarray, shape (2, 2)
        Its second derivatives, 1/m.
    center : tuple of float
        Point of its minimum, m.
    """

    modulus: float
    hessian: Array
    center: tuple[float, float]

    @classmethod
    def of(cls, dataset: xarray.Dataset) -> QuadraticGap | None:
        """Return the gap of a result; None if Hertz does not hold: another law or shape, a line contact."""
        modulus = dataset.attrs.get("effective_modulus")
        if modulus is None or "initial_gap" not in dataset or is_compliant(dataset.attrs):
            return None
        gap, x, y = (dataset[name].values.ravel() for name in ("initial_gap", "x", "y"))
        if gap.size < 12 or not np.isfinite(gap).all() or not np.ptp(gap) > 0.0:
            return None
        size = max(np.ptp(x), np.ptp(y))
        u, v = (x - x.mean()) / size, (y - y.mean()) / size
        forms = np.stack([np.ones_like(u), u, v, 0.5 * u**2, u * v, 0.5 * v**2], axis=1)
        coefficients = np.linalg.lstsq(forms, gap, rcond=None)[0]
        if np.abs(forms @ coefficients - gap).max() > 1e-9 * np.ptp(gap):
            return None
        hessian = np.array([[coefficients[3], coefficients[4]], [coefficients[4], coefficients[5]]]) / size**2
        try:
            hertz_ellipse(float(modulus), hessian, normal_load=1.0)
        except DeckError:  # a line contact
            return None
        lowest = -np.linalg.solve(hessian, coefficients[1:3] / size)
        return cls(float(modulus), hessian, (float(x.mean() + lowest[0]), float(y.mean() + lowest[1])))

    def contact(self, load: float) -> EllipticContact:
        """Return Hertz's solution under a load (N) above 0."""
        return hertz_ellipse(self.modulus, self.hessian, normal_load=load)
