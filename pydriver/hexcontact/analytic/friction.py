"""Closed solutions (or one integral) of contacts with friction.

Compliances of the pair of bodies: S = sum (2-nu_i)/G_i = 4 pi (lambda_1 + lambda_5/2) for a shear force,
S_t = sum 1/G_i = 2 pi (lambda_1 + lambda_5) for a torque.  beta is Dundurs' constant.  SI units.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, reals
from ..core import flat
from ..errors import DeckError
from .frictionless import AxisymmetricContact


@dataclass(frozen=True)
class MindlinContact:
    """Spheres pressed by P, then sheared: Cattaneo-Mindlin, and Mindlin-Deresiewicz on unloading.

    Exact for beta = 0 and gamma = 0; for gamma > 0 the slip directions are not exactly parallel and the
    compliance is off by about 0.1 %. Coefficient of friction mu > 0, normal load P (N), contact radius a (m),
    compliance S (1/Pa).
    """

    friction_coefficient: float
    normal_load: float
    contact_radius: float
    compliance: float

    @property
    def sliding_load(self) -> float:
        """Tangential load mu P at which the spheres slide, N."""
        return float(flat.mindlin_sliding(self)[0])

    @property
    def sliding_shift(self) -> float:
        """Rigid shift at which the spheres begin to slide, Delta_s = 3 mu P S/(16 a), m."""
        return float(flat.mindlin_sliding(self)[1])

    def _bounded(self, load: ArrayLike) -> Array:
        """Return loads (N) up to the sliding load; ValueError for others."""
        loads = reals(load, "load")
        if np.any(np.abs(loads / self.sliding_load) > 1.0):
            raise DeckError("the tangential load is larger than mu P")
        return loads

    def stick_radius(self, load: ArrayLike) -> Array:
        """Return the stick radius (m) under the first loading to Q (N): c = a (1 - Q/mu P)^(1/3)."""
        return np.asarray(flat.mindlin_stick_radius(self, self._bounded(load)))

    def shift(self, load: ArrayLike) -> Array:
        """Return the rigid shift (m) under the first loading to Q (N): Delta_s [1 - (1 - Q/mu P)^(2/3)]."""
        return np.asarray(flat.mindlin_shift(self, self._bounded(load)))

    def load(self, shift: ArrayLike) -> Array:
        """Return the tangential load (N) under a first shift (m): mu P [1 - (1 - Delta/Delta_s)^(3/2)]."""
        return np.asarray(flat.mindlin_load(self, reals(shift, "shift")))

    def traction(self, r: ArrayLike, load: float) -> Array:
        """Shear traction (Pa) at distance r (m) from the axis under the first loading to Q (N)."""
        return np.asarray(flat.mindlin_traction(self, reals(r, "r"), float(self._bounded(load))))

    def shift_unloading(self, load: ArrayLike, peak: float) -> Array:
        """Return the rigid shift (m) at Q (N) on the way back from ``peak`` = Q* > 0 towards -Q*, P constant.

        The way from -Q* back up is the point reflection: -shift_unloading(-Q, peak).
        """
        top = float(self._bounded(peak))
        return np.asarray(flat.mindlin_shift_unloading(self, self._bounded(load), top))

    def traction_unloading(self, r: ArrayLike, load: float, peak: float) -> Array:
        """Return the shear traction (Pa) at Q (N) on the way back from ``peak`` = Q* > 0."""
        loads = float(self._bounded(load)), float(self._bounded(peak))
        return np.asarray(flat.mindlin_traction_unloading(self, reals(r, "r"), *loads))

    def energy_per_cycle(self, peak: float) -> float:
        """Return the energy (J) of one cycle between +Q* and -Q* at constant P (Q* = ``peak``, N)."""
        return float(flat.mindlin_energy(self, float(self._bounded(peak))))


@dataclass(frozen=True)
class SuperposedContact:
    """Similar bodies pressed by P, then sheared: superposed contacts without friction (Jaeger, Ciavarella).

    With p(P), delta(P) and a(P) of the contact without friction and P* = P - Q/mu, the shear traction is
    q = mu (p(P) - p(P*)), the stick zone is the contact under P*, and the shift is (1 + gamma/2) mu
    (delta(P) - delta(P*)). Exact for beta = 0 and gamma = 0 and any surfaces; for gamma > 0 as exact as
    Mindlin's. Coefficient of friction mu > 0, normal load P (N), ratio gamma, and a function that returns the
    contact without friction under a load (N) above 0.
    """

    friction_coefficient: float
    normal_load: float
    tangential_compliance_ratio: float
    pressed: Callable[[float], AxisymmetricContact]

    @property
    def sliding_load(self) -> float:
        """Tangential load mu P at which the bodies slide, N."""
        return self.friction_coefficient * self.normal_load

    def _stuck(self, load: float) -> AxisymmetricContact | None:
        """Return the contact under P*, the stick zone of a first loading to Q (N); None where all slides."""
        left = self.normal_load - abs(load) / self.friction_coefficient
        if left < -1e-9 * self.normal_load:
            raise DeckError("the tangential load is larger than mu P")
        return self.pressed(left) if left > 1e-9 * self.normal_load else None

    def stick_radius(self, load: float) -> float:
        """Return the radius (m) of the stick circle under the first loading to Q (N)."""
        stuck = self._stuck(load)
        return stuck.contact_radius if stuck else 0.0

    def shift(self, load: float) -> float:
        """Return the rigid shift (m) under the first loading to Q (N)."""
        stuck = self._stuck(load)
        moved = self.pressed(self.normal_load).approach - (stuck.approach if stuck else 0.0)
        factor = self.friction_coefficient * (1.0 + 0.5 * self.tangential_compliance_ratio)
        return math.copysign(factor * moved, load)

    def traction(self, r: ArrayLike, load: float) -> Array:
        """Shear traction (Pa) at distance r (m) from the axis under the first loading to Q (N).

        nan where both pressures are infinite.
        """
        stuck = self._stuck(load)
        pressure = self.pressed(self.normal_load).pressure(r)
        with np.errstate(invalid="ignore"):
            difference = pressure - (stuck.pressure(r) if stuck else 0.0)
        return math.copysign(self.friction_coefficient, load) * difference


@dataclass(frozen=True)
class LubkinTorsion:
    """Spheres pressed by P, then twisted about their common normal (Lubkin).

    Coefficient of friction mu > 0, normal load P (N), contact radius a (m), compliance S_t (1/Pa).
    """

    friction_coefficient: float
    normal_load: float
    contact_radius: float
    compliance: float

    @property
    def sliding_torque(self) -> float:
        """Torque of full slip, 3 pi mu P a/16, N m."""
        return float(flat.lubkin_sliding_torque(self))

    def twist(self, stick_radius: float) -> float:
        """Return the twist (rad) at a stick radius c (m): (S_t mu p0/2) [K - E](k), k^2 = 1 - c^2/a^2."""
        return float(flat.lubkin_twist(self, stick_radius))

    def torque(self, stick_radius: float) -> float:
        """Return the torque (N m) at which the stick radius is c (m)."""
        return float(flat.lubkin_torque(self, stick_radius))

    def stick_radius(self, torque: float) -> float:
        """Return the stick radius (m) under a first torque (N m) below the sliding torque."""
        if not 0.0 <= torque < self.sliding_torque:
            raise DeckError("the torque is not between 0 and the sliding torque 3 pi mu P a/16")
        return float(flat.lubkin_stick_radius(self, torque))


def no_slip_constants(beta: float) -> tuple[float, float]:
    """Return the constants kappa, chi of indentation without slip (Mossakovskii, Spence), 1 for beta = 0.

    kappa = artanh(beta)/beta and chi = 1/2 / integral_0^1 t cos[(artanh(beta)/pi) ln((1-t)/(1+t))] dt for
    Dundurs' constant ``|beta| <= 1/2``. A flat punch has P = 2 kappa E* a delta; a sphere, pressed
    incrementally, delta = chi a^2/R and P = 4/3 kappa chi E* a^3/R.
    """
    if abs(beta) > 0.5:
        raise DeckError(f"beta is {beta!r}; expected a number in [-1/2, 1/2]")
    kappa, chi = flat.no_slip(beta)
    return float(kappa), float(chi)


def goodman_stick_ratio(beta: float, friction_coefficient: float) -> float:
    """Return the stick ratio c/a of monotone indentation in Goodman's approximation (Spence).

    Solves ``(a/2c) ln[(a+c)/(a-c)] = (mu/|beta|) K'(c/a)`` with ``K'(k) = K(sqrt(1-k^2))``, for Dundurs'
    constant beta, not 0, and mu > 0.
    """
    return _stick_ratio(flat.goodman, beta, friction_coefficient)


# ------------------------------------------------------------------------------ plane problems


@dataclass(frozen=True)
class PlaneCattaneo:
    """Cylinders of alike materials pressed by P', then sheared across their axes by Q' (Cattaneo, Mindlin).

    Plane strain; exact for any Poisson's ratio. The middle of a contact much longer than wide. Coefficient of
    friction mu > 0, normal load P' (N/m), half the width of the contact b (m).
    """

    friction_coefficient: float
    normal_load: float
    half_width: float

    def stick_half_width(self, load: float) -> float:
        """Return half the width (m) of the stick strip under Q' (N/m): c = b sqrt(1 - Q'/mu P')."""
        if abs(load) / (self.friction_coefficient * self.normal_load) > 1.0:
            raise DeckError("the tangential load is larger than mu P'")
        return float(flat.plane_stick_half_width(self, load))

    def traction(self, x: ArrayLike, load: float) -> Array:
        """Return the shear traction (Pa) at x (m) from the middle under a first loading to Q' (N/m)."""
        self.stick_half_width(load)  # refuses a load above mu P'
        return np.asarray(flat.plane_traction(self, reals(x, "x"), load))


def goodman_stick_ratio_plane(beta: float, friction_coefficient: float) -> float:
    """Return the stick ratio c/b of cylinders pressed monotonically in Goodman's approximation.

    Solves ``|beta| K(k) = mu K'(k)``, k = c/b (Spence); arguments as of `goodman_stick_ratio`. It follows
    from a flat punch, ``p = P'/(pi sqrt(b^2-x^2))``, of which all self-similar contacts are made: a bounded
    traction in the stick strip needs ``integral_-c^c [|beta| p(x) - (mu/pi) integral_{c<|t|<b} sgn(t)
    p(t)/(t-x) dt]/sqrt(c^2-x^2) dx = 0``.
    """
    return _stick_ratio(flat.goodman_plane, beta, friction_coefficient)


def _stick_ratio(
    procedure: Callable[[float, float], float], beta: float, friction_coefficient: float
) -> float:
    if beta == 0.0 or not friction_coefficient > 0.0:
        raise DeckError("beta must not be 0 and the friction coefficient must be positive")
    ratio = float(procedure(beta, friction_coefficient))
    if math.isnan(ratio):
        raise DeckError("the stick ratio for this beta and friction coefficient is too close to 0 or 1")
    return ratio
