"""Frictionless contacts over an ellipse: Hertz's solution for surfaces that are quadratic forms. SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Unpack

import numpy as np
import scipy  # its parts are loaded when they are first used: a fifth of a second
from numpy.typing import ArrayLike, NDArray

from ..arrays import reals
from .frictionless import Given, driven_by, require_positive

Array = NDArray[np.float64]


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
        x, y = reals(x, "x"), reals(y, "y")
        along = x * np.cos(self.angle) + y * np.sin(self.angle)
        across = y * np.cos(self.angle) - x * np.sin(self.angle)
        return along / self.semi_major, across / self.semi_minor

    def pressure(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Contact pressure (Pa) at the points (x, y) (m, broadcast); 0 outside the contact."""
        along, across = self.local(x, y)
        inside = 1.0 - along**2 - across**2
        return np.asarray(self.max_pressure * np.sqrt(np.maximum(inside, 0.0)))


def hertz_ellipse(effective_modulus: float, hessian: ArrayLike, **given: Unpack[Given]) -> EllipticContact:
    """Solve Hertz's contact with the separation h = (x, y) H (x, y)^T / 2.

    The complete elliptic integrals (parameter m = e^2 = 1 - b^2/a^2) enter in Carlson's symmetric form,
    K = R_F(0, 1-m, 1), (K-E)/m = R_D(0, 1-m, 1)/3, (E-(1-m)K)/m = (1-m) R_D(0, 1, 1-m)/3, which keeps all
    digits for nearly circular and for very slender ellipses.

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
        raise ValueError("hessian is not a symmetric 2x2 tensor")
    name, value = driven_by(given, with_radius=False)
    (small, large), axes = np.linalg.eigh(tensor)
    if small <= 1e-12 * large:
        raise ValueError(
            "the gap does not close into an ellipse: hessian is not positive definite (line contact)"
        )

    def axis_ratio_error(log_ratio: float) -> float:
        m1 = np.exp(2.0 * log_ratio)  # (b/a)^2
        ratio = scipy.special.elliprd(0, m1, 1) / scipy.special.elliprd(0, 1, m1)
        return float(np.log(ratio) - np.log(small / large))

    m1, k, d = 1.0, np.pi / 2, 0.75 * np.pi  # a circle, with which scipy need not be loaded
    if small < large * (1 - 1e-15):  # (A/B) lies between (b/a)^2 and b/a
        lowest = np.log(small / large) - 1e-9
        m1 = min(np.exp(scipy.optimize.brentq(axis_ratio_error, lowest, 1e-9, xtol=1e-15)), 1.0) ** 2
        k, d = scipy.special.elliprf(0, m1, 1), scipy.special.elliprd(0, m1, 1)
    if name == "normal_load":
        a = (value * d / (np.pi * effective_modulus * small)) ** (1.0 / 3.0)  # A = small/2
    else:
        a = np.sqrt(2.0 * value * d / (3.0 * k * small))
    load = np.pi * effective_modulus * small * a**3 / d
    delta = 1.5 * load * k / (np.pi * effective_modulus * a)
    # Axes that differ by rounding alone have no direction.
    angle = np.arctan2(axes[1, 0], axes[0, 0]) if m1 < 1.0 - 1e-9 else 0.0
    angle = np.pi / 2 - (np.pi / 2 - angle) % np.pi  # an axis has no sense: (-pi/2, pi/2]
    b = a * np.sqrt(m1)
    peak = 1.5 * load / (np.pi * a * b)
    return EllipticContact(effective_modulus, *map(float, (a, b, angle, delta, load, peak)))


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
    across_1 = np.array([0.0, 1.0])
    across_2 = np.array([-np.sin(angle), np.cos(angle)])
    hessian = np.outer(across_1, across_1) / radius_1 + np.outer(across_2, across_2) / radius_2
    return hertz_ellipse(effective_modulus, hessian, **given)
