"""Contacts with friction that have a closed solution (or one integral) to check the solver against.

Compliances of the pair of bodies: S = sum (2-nu_i)/G_i = 4 pi (lambda_1 + lambda_5/2) for a shear force,
S_t = sum 1/G_i = 2 pi (lambda_1 + lambda_5) for a torque.  beta is Dundurs' constant.  SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import reals
from ..core.analytic import at_points, flat

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MindlinContact:
    """Spheres pressed by P, then sheared: Cattaneo-Mindlin, and Mindlin-Deresiewicz on unloading.

    Exact for beta = 0 and gamma = 0; for gamma > 0 the slip directions are not exactly parallel and the
    compliance is off by about 0.1 %.

    Parameters
    ----------
    friction_coefficient : float
        mu > 0.
    normal_load : float
        P, N.
    contact_radius : float
        a, m.
    compliance : float
        S, 1/Pa.
    """

    friction_coefficient: float
    normal_load: float
    contact_radius: float
    compliance: float

    @property
    def sliding_load(self) -> float:
        """Tangential load mu P at which the spheres slide, N."""
        return float(flat.mindlin_sliding(astuple(self))[0])

    @property
    def sliding_shift(self) -> float:
        """Rigid shift at which the spheres start to slide, Delta_s = 3 mu P S/(16 a), m."""
        return float(flat.mindlin_sliding(astuple(self))[1])

    def _bounded(self, load: ArrayLike) -> Array:
        """Return loads (N), none of which exceeds the sliding load."""
        loads = reals(load, "load")
        if np.any(np.abs(loads / self.sliding_load) > 1.0):
            raise ValueError("the tangential load is larger than mu P")
        return loads

    def stick_radius(self, load: ArrayLike) -> Array:
        """Radius of the stick circle under the first loading to Q (N): c = a (1 - Q/mu P)^(1/3)."""
        return at_points(flat.mindlin_stick_radius, astuple(self), [self._bounded(load)])

    def shift(self, load: ArrayLike) -> Array:
        """Rigid shift (m) under the first loading to Q (N): Delta_s [1 - (1 - Q/mu P)^(2/3)]."""
        return at_points(flat.mindlin_shift, astuple(self), [self._bounded(load)])

    def load(self, shift: ArrayLike) -> Array:
        """Tangential load (N) under a first prescribed shift (m): mu P [1 - (1 - Delta/Delta_s)^(3/2)]."""
        return at_points(flat.mindlin_load, astuple(self), [reals(shift, "shift")])

    def traction(self, r: ArrayLike, load: float) -> Array:
        """Shear traction (Pa) at distance r (m) from the axis under the first loading to Q (N)."""
        return at_points(flat.mindlin_traction, astuple(self), [reals(r, "r")], float(self._bounded(load)))

    def shift_unloading(self, load: ArrayLike, peak: float) -> Array:
        """Rigid shift (m) at Q (N) on the way back from the load ``peak`` = Q* > 0 towards -Q*, P constant.

        The way from -Q* back up is the point reflection: -shift_unloading(-Q, peak).
        """
        top = float(self._bounded(peak))
        return at_points(flat.mindlin_shift_unloading, astuple(self), [self._bounded(load)], top)

    def traction_unloading(self, r: ArrayLike, load: float, peak: float) -> Array:
        """Shear traction (Pa) at Q (N) on the way back from ``peak`` = Q* > 0: slip reversed at the rim."""
        loads = float(self._bounded(load)), float(self._bounded(peak))
        return at_points(flat.mindlin_traction_unloading, astuple(self), [reals(r, "r")], *loads)

    def energy_per_cycle(self, peak: float) -> float:
        """Energy (J) dissipated in one cycle between +Q* and -Q* at constant P (Q* = ``peak``, N)."""
        return float(flat.mindlin_energy(astuple(self), float(self._bounded(peak))))


@dataclass(frozen=True)
class LubkinTorsion:
    """Spheres pressed by P, then twisted about their common normal (Lubkin).

    Parameters
    ----------
    friction_coefficient : float
        mu > 0.
    normal_load : float
        P, N.
    contact_radius : float
        a, m.
    compliance : float
        S_t, 1/Pa.
    """

    friction_coefficient: float
    normal_load: float
    contact_radius: float
    compliance: float

    @property
    def sliding_torque(self) -> float:
        """Torque of full slip, 3 pi mu P a/16, N m."""
        return float(flat.lubkin_sliding_torque(astuple(self)))

    def twist(self, stick_radius: float) -> float:
        """Twist (rad) at which the stick radius is c (m): (S_t mu p0/2) [K - E](k), k^2 = 1 - c^2/a^2."""
        return float(flat.lubkin_twist(astuple(self), stick_radius))

    def torque(self, stick_radius: float) -> float:
        """Torque (N m) at which the stick radius is c (m)."""
        return float(flat.lubkin_torque(astuple(self), stick_radius))

    def stick_radius(self, torque: float) -> float:
        """Stick radius (m) under a first torque (N m) below the sliding torque."""
        if not 0.0 <= torque < self.sliding_torque:
            raise ValueError("the torque is not between 0 and the sliding torque 3 pi mu P a/16")
        return float(flat.lubkin_stick_radius(astuple(self), torque))


def no_slip_constants(beta: float) -> tuple[float, float]:
    """Constants of indentation without slip (Mossakovskii, Spence).

    kappa = artanh(beta)/beta and chi = 1/2 / integral_0^1 t cos[(artanh(beta)/pi) ln((1-t)/(1+t))] dt.
    A flat punch has P = 2 kappa E* a delta; a sphere, pressed incrementally, delta = chi a^2/R and
    P = 4/3 kappa chi E* a^3/R.

    Parameters
    ----------
    beta : float
        Dundurs' constant, ``|beta| <= 1/2``.

    Returns
    -------
    tuple of float
        (kappa, chi); both 1 for beta = 0.
    """
    if abs(beta) > 0.5:
        raise ValueError(f"beta is {beta!r}; expected a number in [-1/2, 1/2]")
    kappa, chi = flat.no_slip(beta)
    return float(kappa), float(chi)


def goodman_stick_ratio(beta: float, friction_coefficient: float) -> float:
    """Stick ratio c/a of monotone indentation where shear does not move the pressure (Goodman, Spence).

    Solves ``(a/2c) ln[(a+c)/(a-c)] = (mu/|beta|) K'(c/a)`` with ``K'(k) = K(sqrt(1-k^2))``.

    Parameters
    ----------
    beta : float
        Dundurs' constant, not 0.
    friction_coefficient : float
        mu > 0.

    Returns
    -------
    float
        c/a in (0, 1).
    """
    return _stick_ratio(flat.goodman, beta, friction_coefficient)


# ------------------------------------------------------------------------------ plane problems


@dataclass(frozen=True)
class PlaneCattaneo:
    """Cylinders of alike materials pressed by P', then sheared across their axes by Q' (Cattaneo, Mindlin).

    Plane strain; exact whatever Poisson's ratio is. The middle of a contact much longer than wide.

    Parameters
    ----------
    friction_coefficient : float
        mu > 0.
    normal_load : float
        P', N/m.
    half_width : float
        Half the width of the contact b, m.
    """

    friction_coefficient: float
    normal_load: float
    half_width: float

    def stick_half_width(self, load: float) -> float:
        """Half the width (m) of the stick strip under Q' (N/m): c = b sqrt(1 - Q'/mu P')."""
        if abs(load) / (self.friction_coefficient * self.normal_load) > 1.0:
            raise ValueError("the tangential load is larger than mu P'")
        return float(flat.plane_stick_half_width(astuple(self), load))

    def traction(self, x: ArrayLike, load: float) -> Array:
        """Shear traction (Pa) at distance x (m) from the middle under a first loading to Q' (N/m)."""
        self.stick_half_width(load)  # refuses too large a load
        return at_points(flat.plane_traction, astuple(self), [reals(x, "x")], load)


def goodman_stick_ratio_plane(beta: float, friction_coefficient: float) -> float:
    """Stick ratio c/b of cylinders pressed monotonically where shear does not move the pressure.

    Solves ``|beta| K(k) = mu K'(k)``, k = c/b (Spence). It follows from a flat punch,
    ``p = P'/(pi sqrt(b^2-x^2))``, of which all self-similar contacts are made: a bounded traction in the
    stick strip needs
    ``integral_-c^c [|beta| p(x) - (mu/pi) integral_{c<|t|<b} sgn(t) p(t)/(t-x) dt]/sqrt(c^2-x^2) dx = 0``.

    Parameters
    ----------
    beta : float
        Dundurs' constant, not 0.
    friction_coefficient : float
        mu > 0.

    Returns
    -------
    float
        c/b in (0, 1).
    """
    return _stick_ratio(flat.goodman_plane, beta, friction_coefficient)


def _stick_ratio(
    procedure: Callable[[float, float], float], beta: float, friction_coefficient: float
) -> float:
    if beta == 0.0 or not friction_coefficient > 0.0:
        raise ValueError("beta must not be 0 and the friction coefficient must be positive")
    ratio = float(procedure(beta, friction_coefficient))
    if math.isnan(ratio):
        raise ValueError("the stick ratio for this beta and friction coefficient is too close to 0 or 1")
    return ratio
