"""Hertz's solution for a result, from its quadratic gap, and the conditions under which it holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..arrays import Array, Dataset
from ..core.measures import half_axes
from ..deck.read import recorded
from ..deck.surfaces import Roller
from ..errors import DeckError
from ..variables import BULK_STRESS, INTERFACE, VARIABLES
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
class Pressed:
    """A contact without friction that has a closed solution at every load."""

    name: str  # name of the solution
    center: tuple[float, float]  # m
    contact: Callable[[float], Any]  # the contact under a load (N) above 0, axisymmetric or elliptic
    energy: float  # its elastic energy over load times approach; 0: unknown
    lowest: float = 0.0  # gap at the center, m; not 0 for heights that are not shifted to first touch
    rim: bool = False  # whether it ends at a sharp rim

    def pressure(self, load: float, x: Array, y: Array) -> Array:
        """Return the pressure (Pa) under a load (N) at points (m)."""
        contact, x, y = self.contact(load), x - self.center[0], y - self.center[1]
        at = (x, y) if isinstance(contact, EllipticContact) else (np.hypot(x, y),)
        return np.asarray(contact.pressure(*at))


def quadratic(dataset: Dataset) -> Pressed | None:
    """Return Hertz's solution for the gap of a result; None if it is no quadratic form, or a line contact."""
    try:
        deck = str(dataset.attrs.get("deck", ""))
        known, moves = quadratic_of_deck(deck, dataset.attrs), is_moving(deck)
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
    return _hertz(dataset.attrs, hessian, (float(x.mean() + lowest[0]), float(y.mean() + lowest[1])), height)


def quadratic_of_deck(deck: str, attributes: Mapping[Any, Any]) -> Pressed | None:
    """Return Hertz's solution for the surfaces of a deck; None if they are unknown, or as of `quadratic`."""
    separation = recorded(deck).separation
    if separation is None or separation.moves or separation.quadratic is None:
        return None
    hessian, center = separation.quadratic
    return _hertz(attributes, hessian, center, float(separation(*center)))


def _hertz(
    attributes: Mapping[Any, Any], hessian: Array, center: tuple[float, float], lowest: float = 0.0
) -> Pressed | None:
    """Return Hertz's solution if the gap and the law of contact lead to an ellipse."""
    modulus = attribute_of(attributes, "effective_modulus")
    if is_compliant(attributes):
        return None
    try:
        hertz_ellipse(modulus, hessian, normal_load=1.0)
    except DeckError:  # a line contact, or an unknown modulus
        return None
    return Pressed("Hertz", center, lambda p: hertz_ellipse(modulus, hessian, normal_load=p), 0.4, lowest)


def roller_on_flat(deck: str, attributes: Mapping[Any, Any], load: float) -> Pressed | None:
    """Return the contact of the roller of a deck on a flat under a load (N); None without one.

    It is Hertz's if a crown ends the contact before the length, else plane contact, whose pressure is known.
    """
    surface, modulus = recorded(deck).only_surface, attribute_of(attributes, "effective_modulus")
    if not isinstance(surface, Roller) or math.isnan(modulus) or is_compliant(attributes):
        return None
    center = float(surface.offset[0]), float(surface.offset[1])
    if surface.crown_radius:
        along = np.array([math.cos(surface.angle), math.sin(surface.angle)])
        across = np.array([-along[1], along[0]])
        hessian = np.outer(along, along) / surface.crown_radius + np.outer(across, across) / surface.radius
        hertz = _hertz(attributes, hessian, center)
        if hertz and hertz.contact(load).semi_major < surface.reach:
            return hertz

    def plane(load: float) -> SimpleNamespace:
        return SimpleNamespace(max_pressure=surface.plane_contact(modulus, load)[1])

    return Pressed("Hertz, plane contact", center, plane, 0.0)


def against_hertz(
    deck: str, attributes: Mapping[str, Any], history: Mapping[str, Any]
) -> list[tuple[str, float, float, str]]:
    """Compare a load step with Hertz: quantity, Hertz, computed, unit; empty if his assumptions fail.

    Beside a roller on a flat stands the pressure of plane contact alone, unless a crown ends the contact.
    """
    load = float(history["normal_load"])
    if not load > 0.0 or is_worn(history) or not pressure_is_frictionless(attributes):
        return []
    pressed = quadratic_of_deck(deck, attributes) or roller_on_flat(deck, attributes, load)
    if pressed is None:
        return []
    hertz = pressed.contact(load)
    known = {"max_pressure": hertz.max_pressure}
    if isinstance(hertz, EllipticContact):
        if "mean_gap" not in history:  # else the approach is that of mean planes in a window that repeats
            known["approach"] = hertz.approach + pressed.lowest
        if half_axes(history):
            known |= {f"contact_semi_{name}": getattr(hertz, f"semi_{name}") for name in ("major", "minor")}
        else:
            known |= dict.fromkeys(("contact_radius_fit", "contact_radius"), hertz.radius)
    return [
        (name, exact, float(history[name]), VARIABLES[name].unit)
        for name, exact in known.items()
        if not math.isnan(history.get(name, math.nan))
    ]
