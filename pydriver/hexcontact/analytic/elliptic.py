"""Frictionless contacts over an ellipse: Hertz's solution for surfaces that are quadratic forms. SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, reals
from ..core import flat
from ..errors import DeckError
from .frictionless import Given, driven_by, require_positive


@dataclass(frozen=True)
class EllipticContact:
    """Hertz contact over an ellipse; returned by `hertz_ellipse` and `crossed_cylinders`.

    Parameters
    ----------
    effective_modulus : float
        E*, Pa.
    semi_major, semi_minor : float
        Semi-axes a >= b, m.
    angle : float
        Direction of the major axis from x, rad, in (-pi/2, pi/2].
    approach, normal_load, max_pressure : float
        delta (m), P (N), p0 (Pa).
    """

    effective_modulus: float
    semi_major: float
    semi_minor: float
    angle: float
    approach: float
    normal_load: float
    max_pressure: float

    @property
    def radius(self) -> float:
        """Radius of the disc as large as the contact, m."""
        return math.sqrt(self.semi_major * self.semi_minor)

    def local(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Return points (m) relative to the ellipse: coordinates along its axes, as shares of them."""
        found: tuple[Array, Array] = flat.ellipse_local(self, reals(x, "x"), reals(y, "y"))
        return found

    def pressure(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the contact pressure (Pa) at points (x, y) (m, broadcast); 0 outside the contact."""
        return np.asarray(flat.ellipse_pressure(self, reals(x, "x"), reals(y, "y")))


def hertz_ellipse(effective_modulus: float, hessian: ArrayLike, **given: Unpack[Given]) -> EllipticContact:
    """Solve Hertz's contact with the separation h = (x, y) H (x, y)^T / 2.

    Parameters
    ----------
    effective_modulus : float
        E*, Pa.
    hessian : array_like
        H, the symmetric 2x2 tensor of second derivatives of h (1/m), positive definite.
    **given
        `Given`: exactly one of ``normal_load``, ``approach``.

    Returns
    -------
    EllipticContact
    """
    require_positive(effective_modulus=effective_modulus)
    tensor = reals(hessian, "hessian")
    if tensor.shape != (2, 2) or not np.allclose(
        tensor, tensor.T, rtol=0.0, atol=1e-12 * np.abs(tensor).max()
    ):
        raise DeckError("hessian is not a symmetric 2x2 tensor")
    name, value = driven_by(given, with_radius=False)
    found = flat.hertz(effective_modulus, tensor, name == "normal_load", value)
    return EllipticContact(**found._asdict())


def crossed_cylinders(
    effective_modulus: float, radius_1: float, radius_2: float, angle: float, **given: Unpack[Given]
) -> EllipticContact:
    """Solve the contact of two cylinders, the first with its axis along x, the second turned by ``angle``.

    Parameters
    ----------
    effective_modulus : float
        E*, Pa.
    radius_1, radius_2 : float
        Radii, m.
    angle : float
        From the axis of cylinder 1 (the x axis) to that of cylinder 2, rad; not a multiple of pi.
    **given
        `Given`: exactly one of ``normal_load``, ``approach``.

    Returns
    -------
    EllipticContact
        Its ``angle`` is that of the major axis from the axis of cylinder 1.
    """
    require_positive(radius_1=radius_1, radius_2=radius_2)
    return hertz_ellipse(effective_modulus, flat.cylinders_hessian(radius_1, radius_2, angle), **given)
