"""Hertz's solution for a result: its gap as a quadratic form, and the conditions under which it holds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Dataset
from ..core.measures import half_axes
from ..deck.read import recorded
from ..deck.surfaces import Roller
from ..errors import DeckError
from ..variables import BULK_STRESS, INTERFACE
from .frictionless import EllipticContact, hertz_ellipse

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


def is_strained(dataset: Dataset) -> bool:
    """Test whether there is a bulk stress, for which closed solutions of shear do not hold."""
    return any(bool(np.any(dataset[name])) for name in BULK_STRESS if name in dataset)


def is_worn(history: Mapping[Any, Any]) -> bool:
    """Test whether wear has changed the surfaces by the last load step, so that no closed solution holds."""
    worn = history.get("max_worn_depth")
    return worn is not None and bool(np.ravel(worn)[-1] > 0.0)


def is_moving(deck: str) -> bool:
    """Test whether surfaces move with their rolling bodies, so that the gap is not the initial one."""
    separation = recorded(deck).separation
    return separation is not None and separation.moves


def pressure_is_frictionless(attributes: Mapping[Any, Any]) -> bool:
    """Test whether the pressure of a result is that of a contact without friction."""
    return (
        friction_of(attributes) == 0.0
        or abs(attribute_of(attributes, "dundurs_beta")) <= SIMILAR
        or attributes.get("coupling") == "goodman"
    )


@dataclass(frozen=True)
class QuadraticGap:
    """An initial gap that is a quadratic form: sphere, cylinder, paraboloid."""

    modulus: float  # E*, Pa
    hessian: Array  # its second derivatives, 1/m, (2, 2)
    center: tuple[float, float]  # point of its minimum, m
    lowest: float  # the gap there, m; not 0 for heights that are not shifted to first touch

    @classmethod
    def of(cls, dataset: Dataset) -> QuadraticGap | None:
        """Return the gap of a result; None if Hertz does not hold: another law or shape, a line contact."""
        try:
            deck = str(dataset.attrs.get("deck", ""))
            known, moves = cls.of_deck(deck, dataset.attrs), is_moving(deck)
        except DeckError:  # a surface of a later version
            known, moves = None, False
        if known or moves or "initial_gap" not in dataset:
            return known
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
            lowest = -np.linalg.solve(hessian, coefficients[1:3] / size)
        except np.linalg.LinAlgError:
            return None
        height = float(coefficients[0] + 0.5 * lowest @ coefficients[1:3] / size)
        center = (float(x.mean() + lowest[0]), float(y.mean() + lowest[1]))
        return cls.of_hessian(dataset.attrs, hessian, center, height)

    @classmethod
    def of_deck(cls, deck: str, attributes: Mapping[Any, Any]) -> QuadraticGap | None:
        """Return the gap of the surfaces of a deck; None if they are unknown, or as of `of`."""
        separation = recorded(deck).separation
        if separation is None or separation.moves or separation.quadratic is None:
            return None
        hessian, center = separation.quadratic
        return cls.of_hessian(attributes, hessian, center, float(separation(*center)))

    @classmethod
    def of_hessian(
        cls, attributes: Mapping[Any, Any], hessian: Array, center: tuple[float, float], lowest: float
    ) -> QuadraticGap | None:
        """Return the gap if it and the law of contact lead to an ellipse."""
        modulus = attribute_of(attributes, "effective_modulus")
        try:
            hertz_ellipse(modulus, hessian, normal_load=1.0)
        except DeckError:  # a line contact, or an unknown modulus
            return None
        return None if is_compliant(attributes) else cls(modulus, hessian, center, lowest)

    def contact(self, load: float) -> EllipticContact:
        """Return Hertz's solution under a load (N) above 0."""
        return hertz_ellipse(self.modulus, self.hessian, normal_load=load)

    def approach(self, load: float) -> float:
        """Return the approach (m) from the height zero of the surfaces under a load (N)."""
        return self.contact(load).approach + self.lowest


def crowned(deck: str, attributes: Mapping[Any, Any], load: float) -> QuadraticGap | None:
    """Return the gap of a crowned roller whose contact under a load (N) ends before its length; else None."""
    surface = recorded(deck).only_surface
    if not isinstance(surface, Roller) or not surface.crown_radius:
        return None
    along = np.array([math.cos(surface.angle), math.sin(surface.angle)])
    across = np.array([-along[1], along[0]])
    hessian = np.outer(along, along) / surface.crown_radius + np.outer(across, across) / surface.radius
    gap = QuadraticGap.of_hessian(
        attributes, hessian, (float(surface.offset[0]), float(surface.offset[1])), 0.0
    )
    return gap if gap and gap.contact(load).semi_major < surface.reach else None


def plane_contact(deck: str, attributes: Mapping[Any, Any], load: float) -> tuple[float, float] | None:
    """Return half-width (m) and pressure (Pa) of plane contact of the roller of a deck; None without one."""
    surface, modulus = recorded(deck).only_surface, attribute_of(attributes, "effective_modulus")
    if not isinstance(surface, Roller) or math.isnan(modulus) or is_compliant(attributes):
        return None
    return surface.plane_contact(modulus, load)


def against_hertz(
    deck: str, attributes: Mapping[str, Any], history: Mapping[str, Any]
) -> list[tuple[str, float, float, str]]:
    """Compare a load step with Hertz: quantity, Hertz, computed, unit; empty if his assumptions fail.

    Beside a roller on a flat stands the pressure of plane contact alone, unless a crown ends the contact.
    """
    load = float(history["normal_load"])
    if not load > 0.0 or is_worn(history) or not pressure_is_frictionless(attributes):
        return []
    gap = QuadraticGap.of_deck(deck, attributes) or crowned(deck, attributes, load)
    if gap is None:
        plane = plane_contact(deck, attributes, load)
        return [("max_pressure", plane[1], float(history["max_pressure"]), "Pa")] if plane else []
    hertz = gap.contact(load)
    known = {"max_pressure": (hertz.max_pressure, "Pa"), "approach": (gap.approach(load), "m")}
    if half_axes(history):
        known |= {f"contact_semi_{n}": (getattr(hertz, f"semi_{n}"), "m") for n in ("major", "minor")}
    else:
        known |= {"contact_radius_fit": (hertz.radius, "m"), "contact_radius": (hertz.radius, "m")}
    return [
        (name, exact, float(history[name]), unit)
        for name, (exact, unit) in known.items()
        if not math.isnan(history.get(name, math.nan))
    ]
