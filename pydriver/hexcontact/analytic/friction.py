"""Contacts with friction that have a closed solution (or one integral) to check the solver against.

Compliances of the pair of bodies: S = sum (2-nu_i)/G_i = 4 pi (lambda_1 + lambda_5/2) for a shear force,
S_t = sum 1/G_i = 2 pi (lambda_1 + lambda_5) for a torque.  beta is Dundurs' constant.  SI units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..arrays import reals

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
        return self.friction_coefficient * self.normal_load

    @property
    def sliding_shift(self) -> float:
        """Rigid shift at which the spheres start to slide, Delta_s = 3 mu P S/(16 a), m."""
        return 3.0 * self.sliding_load * self.compliance / (16.0 * self.contact_radius)

    def _fraction(self, load: ArrayLike) -> Array:
        f = reals(load, "load") / self.sliding_load
        if np.any(np.abs(f) > 1.0):
            raise ValueError("the tangential load is larger than mu P")
        return f

    def stick_radius(self, load: ArrayLike) -> Array:
        """Radius of the stick circle under the first loading to Q (N): c = a (1 - Q/mu P)^(1/3)."""
        return np.asarray(self.contact_radius * np.cbrt(1.0 - np.abs(self._fraction(load))))

    def shift(self, load: ArrayLike) -> Array:
        """Rigid shift (m) under the first loading to Q (N): Delta_s [1 - (1 - Q/mu P)^(2/3)]."""
        f = self._fraction(load)
        return np.asarray(self.sliding_shift * np.sign(f) * (1.0 - np.cbrt(1.0 - np.abs(f)) ** 2))

    def load(self, shift: ArrayLike) -> Array:
        """Tangential load (N) under a first prescribed shift (m): mu P [1 - (1 - Delta/Delta_s)^(3/2)]."""
        d = reals(shift, "shift") / self.sliding_shift
        return np.asarray(self.sliding_load * np.sign(d) * (1.0 - np.maximum(1.0 - np.abs(d), 0.0) ** 1.5))

    def traction(self, r: ArrayLike, load: float) -> Array:
        """Shear traction (Pa) at distance r (m) from the axis under the first loading to Q (N)."""
        f = float(self._fraction(load))
        return np.asarray(
            np.sign(f)
            * (
                self._sliding_traction(r, self.contact_radius)
                - self._sliding_traction(r, float(self.stick_radius(load)))
            )
        )

    def _sliding_traction(self, r: ArrayLike, radius: float) -> Array:
        """Semi-ellipsoid of the curvature of mu p over the circle of the given radius (Pa)."""
        a = self.contact_radius
        inside = np.maximum(radius**2 - reals(r, "r") ** 2, 0.0)
        return np.asarray(1.5 * self.sliding_load / (np.pi * a**3) * np.sqrt(inside))

    def shift_unloading(self, load: ArrayLike, peak: float) -> Array:
        """Rigid shift (m) at Q (N) on the way back from the load ``peak`` = Q* > 0 towards -Q*, P constant.

        The way from -Q* back up is the point reflection: -shift_unloading(-Q, peak).
        """
        f, top = self._fraction(load), float(self._fraction(peak))
        back = 2.0 * np.cbrt(1.0 - (top - f) / 2.0) ** 2 - np.cbrt(1.0 - top) ** 2 - 1.0
        return np.asarray(self.sliding_shift * back)

    def traction_unloading(self, r: ArrayLike, load: float, peak: float) -> Array:
        """Shear traction (Pa) at Q (N) on the way back from ``peak`` = Q* > 0: slip reversed at the rim."""
        half = 0.5 * (peak - load)
        return np.asarray(self.traction(r, peak) - 2.0 * self.traction(r, half))

    def energy_per_cycle(self, peak: float) -> float:
        """Energy (J) dissipated in one cycle between +Q* and -Q* at constant P (Q* = ``peak``, N)."""
        f = float(self._fraction(peak))
        loop = 1.0 - (1.0 - f) ** (5.0 / 3.0) - 5.0 / 6.0 * f * (1.0 + (1.0 - f) ** (2.0 / 3.0))
        return 4.8 * self.sliding_load * self.sliding_shift * loop


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
    def _peak(self) -> float:
        return 1.5 * self.friction_coefficient * self.normal_load / (np.pi * self.contact_radius**2)  # mu p0

    @property
    def sliding_torque(self) -> float:
        """Torque of full slip, 3 pi mu P a/16, N m."""
        return 3.0 * np.pi / 16.0 * self.friction_coefficient * self.normal_load * self.contact_radius

    def _twist_factor(self, radius: float) -> float:
        """K(k) - E(k) with k^2 = 1 - r^2/a^2, in Carlson's form (no cancellation, no overflow)."""
        m1 = (radius / self.contact_radius) ** 2
        return float((1.0 - m1) * scipy.special.elliprd(0.0, m1, 1.0) / 3.0)

    def twist(self, stick_radius: float) -> float:
        """Twist (rad) at which the stick radius is c (m): (S_t mu p0/2) [K - E](k), k^2 = 1 - c^2/a^2."""
        return 0.5 * self.compliance * self._peak * self._twist_factor(stick_radius)

    def torque(self, stick_radius: float) -> float:
        """Torque (N m) at which the stick radius is c (m)."""
        c = stick_radius
        slip = scipy.integrate.quad(
            lambda t: t**2 * self._twist_factor(t), c, self.contact_radius, epsabs=0.0
        )[0]
        stick = 4.0 * self.twist(c) * c**3 / (3.0 * np.pi * self.compliance)
        return float(4.0 * np.pi * (stick + 2.0 * self._peak / np.pi * slip))

    def stick_radius(self, torque: float) -> float:
        """Stick radius (m) under a first torque (N m) below the sliding torque."""
        if not 0.0 <= torque < self.sliding_torque:
            raise ValueError("the torque is not between 0 and the sliding torque 3 pi mu P a/16")
        a = self.contact_radius
        return float(scipy.optimize.brentq(lambda c: self.torque(c) - torque, 1e-12 * a, a, xtol=1e-12 * a))


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
    angle = np.arctanh(beta)
    kappa = angle / beta if beta else 1.0
    # t = tanh(s/2) turns the logarithm into -s: a decaying, smooth integrand
    integral = scipy.integrate.quad(
        lambda s: np.tanh(s / 2) * np.cos(angle * s / np.pi) / (2.0 * np.cosh(s / 2) ** 2),
        0.0,
        80.0,
        epsabs=1e-14,
        limit=200,
    )[0]
    return float(kappa), float(0.5 / integral)


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
    if beta == 0.0 or not friction_coefficient > 0.0:
        raise ValueError("beta must not be 0 and the friction coefficient must be positive")
    ratio = friction_coefficient / abs(beta)

    def residual(z: float) -> float:  # z = artanh(c/a) resolves c/a close to 1
        k = np.tanh(z)
        return float(z / k - ratio * scipy.special.ellipkm1(k * k))  # K'(k) = K(m = 1 - k^2)

    return float(np.tanh(scipy.optimize.brentq(residual, 1e-150, 40.0, xtol=1e-15)))


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
        share = abs(load) / (self.friction_coefficient * self.normal_load)
        if share > 1.0:
            raise ValueError("the tangential load is larger than mu P'")
        return float(self.half_width * np.sqrt(1.0 - share))

    def traction(self, x: ArrayLike, load: float) -> Array:
        """Shear traction (Pa) at distance x (m) from the middle under a first loading to Q' (N/m)."""
        b, c = self.half_width, self.stick_half_width(load)
        x2 = reals(x, "x") ** 2
        slope = 2.0 * self.friction_coefficient * self.normal_load / (np.pi * b**2)
        parts = [np.sqrt(np.maximum(half**2 - x2, 0.0)) for half in (b, c)]
        return np.asarray(np.sign(load) * slope * (parts[0] - parts[1]))


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
    if beta == 0.0 or not friction_coefficient > 0.0:
        raise ValueError("beta must not be 0 and the friction coefficient must be positive")
    ratio = friction_coefficient / abs(beta)

    def residual(z: float) -> float:  # m = k^2 = 1/(1 + exp(-z)) resolves both ends
        ellipk, expit = scipy.special.ellipk, scipy.special.expit
        return float(ellipk(expit(z)) - ratio * ellipk(expit(-z)))

    return float(np.sqrt(scipy.special.expit(scipy.optimize.brentq(residual, -700.0, 36.0, xtol=1e-14))))
