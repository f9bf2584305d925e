"""Fatigue quantities of stress histories: critical planes, invariants, fretting parameters, life.

A history has the shape (..., times, 6): xx, yy, zz, xy, yz, xz, tension positive, one closed cycle. Results
have the shape of the points, the axes before the last two. docs/fatigue.md has definitions and sources.
Numbers are in SI; a history that is empty or not finite, or a number out of its range, is a `DeckError`.

Examples
--------
Tension and pressure of 200 MPa in turn, for Smith, Watson & Topper: sigma^2/E on the plane across

>>> import numpy as np
>>> from hexcontact import fatigue
>>> history = np.zeros((3, 6))
>>> history[:, 0] = [0.0, 200e6, -200e6]
>>> plane = fatigue.smith_watson_topper(history, young_modulus=200e9, poisson_ratio=0.3)
>>> f"{plane.value:.4g} Pa, {abs(plane.normal[0]):.3f}"
'2e+05 Pa, 1.000'
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, reals
from .core import flat
from .core.calls import checked, number, numbers, positive
from .errors import DeckError

__all__ = [
    "CriticalPlane",
    "Ruiz",
    "crossland",
    "dang_van",
    "fatemi_socie",
    "findley",
    "life",
    "ruiz",
    "smith_watson_topper",
]


_RATIO: Any = ("a number above -1 and at most 0.5", lambda found: -1.0 < found <= 0.5)


class CriticalPlane(NamedTuple):
    """The largest value of a parameter over all planes, and the plane."""

    value: Array
    """Parameter, shape of the points."""
    normal: Array
    """Unit normal of the plane, shape (..., 3), its z not negative."""


class Ruiz(NamedTuple):
    """Fretting parameters of Ruiz, both of one node."""

    f1: Array
    """largest shear traction times the slip amplitude [Pa m]."""
    f2: Array
    """F1 times the largest tension along the slip [Pa^2 m]."""
    slip_amplitude: Array
    """Half the range of slip along its main direction [m]."""


def smith_watson_topper(stress: ArrayLike, young_modulus: float, poisson_ratio: float) -> CriticalPlane:
    """Return the largest sigma_n,max times half the range of normal strain [Pa]; moduli are E and nu."""
    moduli = positive(young_modulus, "young_modulus"), number(poisson_ratio, "poisson_ratio", *_RATIO)
    return CriticalPlane(*flat.smith_watson_topper(_history(stress, 6), *moduli))


def findley(stress: ArrayLike, slope: float) -> CriticalPlane:
    """Return the largest tau_a + slope sigma_n,max [Pa].

    The slope is the influence of the normal stress, 0.2 to 0.4 for ductile metals.
    """
    return CriticalPlane(*flat.findley(_history(stress, 6), *checked(slope=slope)))


def fatemi_socie(stress: ArrayLike, slope: float, shear_modulus: float, yield_stress: float) -> CriticalPlane:
    """Return the largest (tau_a/G)(1 + slope sigma_n,max/sigma_y).

    The slope is the influence of the normal stress; G and sigma_y are the shear modulus and the yield stress.
    """
    moduli = checked(shear_modulus=shear_modulus, yield_stress=yield_stress)
    return CriticalPlane(*flat.fatemi_socie(_history(stress, 6), *checked(slope=slope), *moduli))


def crossland(stress: ArrayLike, slope: float) -> Array:
    """Return sqrt(J2,a) + slope sigma_h,max [Pa].

    The slope is the influence of the hydrostatic stress: (t - b/sqrt(3))/(b/3) from the limits of torsion t
    and bending b.
    """
    return np.asarray(flat.crossland(_history(stress, 6), *checked(slope=slope)))


def dang_van(stress: ArrayLike, slope: float) -> Array:
    """Return the largest tau(t) + slope sigma_h(t) [Pa].

    The slope is the influence of the hydrostatic stress: 3 (t/b - 1/2) from the limits of torsion t and
    bending b.
    """
    return np.asarray(flat.dang_van(_history(stress, 6), *checked(slope=slope)))


def ruiz(traction: ArrayLike, slip: ArrayLike, stress: ArrayLike) -> Ruiz:
    """Return the fretting parameters of Ruiz, by the stress at the surface.

    Shear traction and slip along x and y have the shape (..., times, 2).
    """
    q, s, history = _history(traction, 2), _history(slip, 2), _history(stress, 6)
    if not q.shape[:-1] == s.shape[:-1] == history.shape[:-1]:
        raise DeckError("traction, slip, stress: expected the same points and times")
    return Ruiz(*flat.ruiz(q, s, history))


def life(
    value: ArrayLike, young_modulus: float, strength: float, b: float, ductility: float, c: float
) -> Array:
    """Return the life in cycles at a value of the parameter of Smith, Watson & Topper.

    Moduli are E and sigma_f'; b and c, below zero, are the exponents of strength and ductility, eps_f' is the
    ductility. Cycles are inf beyond 1e30, 0 below one half, NaN for NaN.
    """
    names = {"young_modulus": young_modulus, "strength": strength, "b": b, "ductility": ductility, "c": c}
    return np.asarray(flat.life(reals(value, "value"), **numbers(names)))


def _history(history: ArrayLike, components: int) -> Array:
    """Return a history of vectors or tensors."""
    array = reals(history, "stress" if components == 6 else "traction, slip")
    if array.ndim < 2 or array.shape[-1] != components or not array.size:
        raise DeckError(
            f"a history of shape {array.shape}: expected (..., times, {components}), a time or more"
        )
    return array
