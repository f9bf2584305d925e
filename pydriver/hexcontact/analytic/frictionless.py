"""Closed solutions of frictionless contacts: axisymmetric ones, and that of Hertz over an ellipse.

Two elastic half-spaces touch with an undeformed separation ``h``; the materials enter through the effective
modulus E* only, 1/E* = (1-nu_1^2)/E_1 + (1-nu_2^2)/E_2.  All quantities are SI (or any consistent set).

The axisymmetric solutions come from one theorem (Galin, Sneddon): with
``delta(t) = t * integral_0^t h'(r)/sqrt(t^2-r^2) dr`` the approach that makes the contact radius t,

    P = 2 E* integral_0^a (delta(a) - delta(t)) dt,     p(r) = E*/pi integral_r^a delta'(t)/sqrt(t^2-r^2) dt.

Contacts with friction are in :mod:`hexcontact.analytic.friction`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, reals
from ..core import flat
from ..core.calls import positive
from ..errors import DeckError

Profile = Callable[[Array], Array]


class Given(TypedDict, total=False):
    """One of the normal load (N), the approach (m), the contact radius (m)."""

    normal_load: float
    approach: float
    contact_radius: float


_GIVEN = ("normal_load", "approach", "contact_radius")  # in the order of the core
_POWER_LAW, _ROUNDED_PUNCH = range(2)  # bodies of the core


@dataclass(frozen=True)
class AxisymmetricContact:
    """A contact over the circle r <= a.

    E* (Pa), contact radius a (m), approach delta (m), normal load P (N), and the largest contact pressure
    (Pa): ``inf`` for a cone (center) and a flat punch (edge).
    """

    effective_modulus: float
    contact_radius: float
    approach: float
    normal_load: float
    max_pressure: float
    _pressure: Profile = field(repr=False, compare=False)

    def pressure(self, r: ArrayLike) -> Array:
        """Return the contact pressure (Pa) at distances (m) from the axis; 0 outside the contact."""
        radius: Array = np.abs(reals(r, "r"))
        inside = radius <= self.contact_radius
        p = np.zeros(radius.shape)
        p[inside] = self._pressure(radius[inside])
        return p


def require_positive(**values: float) -> None:
    """Refuse values, given by their names, that are not positive numbers."""
    for name, value in values.items():
        positive(value, name)


def driven_by(given: Given, with_radius: bool = True) -> tuple[str, float]:
    """Return name and value of the given quantity."""
    names = _GIVEN[: 3 if with_radius else 2]
    if len(given) != 1 or not set(given) <= set(names):
        raise TypeError(f"give exactly one of {', '.join(names)}; got {', '.join(given) or 'none'}")
    [(name, value)] = given.items()
    return name, positive(value, name)


# ----------------------------------------------------------------------------------- power laws


def power_law(
    effective_modulus: float, coefficient: float, exponent: float, **given: Unpack[Given]
) -> AxisymmetricContact:
    """Solve the contact with the separation h = C r^n.

    With c_n = sqrt(pi) Gamma(n/2+1)/Gamma(n/2+1/2): delta = c_n C a^n, P = 2 E* n/(n+1) delta a and
    p(r) = (E*/pi) n c_n C a^(n-2) sigma 2F1(1, 1-n/2; 3/2; sigma^2/a^2), sigma^2 = a^2 - r^2.

    Parameters
    ----------
    effective_modulus : float
        E*, Pa.
    coefficient : float
        C > 0, m^(1-n).
    exponent : float
        n >= 1.
    **given
        `Given`: exactly one of ``normal_load``, ``approach``, ``contact_radius``.
    """
    require_positive(effective_modulus=effective_modulus, coefficient=coefficient)
    n = float(exponent)
    if not (np.isfinite(n) and n >= 1.0):
        raise DeckError(f"exponent is {exponent!r}; expected a number of at least 1")
    name, value = driven_by(given)
    return _contact(_POWER_LAW, (effective_modulus, coefficient, n), name, value)


def _contact(kind: int, body: tuple[float, ...], name: str, value: float) -> AxisymmetricContact:
    """Solve the contact with a body of the Fortran library."""
    indenter = kind, body
    radius, approach, load, peak = flat.contact_of_body(indenter, _GIVEN.index(name), value)
    return AxisymmetricContact(
        *(body[0], radius, approach, load, peak), lambda r: flat.pressure_of_body(indenter, r, radius)
    )


def hertz_sphere(effective_modulus: float, radius: float, **given: Unpack[Given]) -> AxisymmetricContact:
    """Solve Hertz's contact of spheres, h = r^2/(2R): a^3 = 3PR/(4E*), p0 = 3P/(2 pi a^2), delta = a^2/R.

    The radius is R (m), 1/R = 1/R_1 + 1/R_2; other arguments as of `power_law`.
    """
    require_positive(radius=radius)
    return power_law(effective_modulus, 0.5 / radius, 2.0, **given)


def cone(effective_modulus: float, slope: float, **given: Unpack[Given]) -> AxisymmetricContact:
    """Solve the contact with a cone, h = m r: delta = pi m a/2, P = pi E* m a^2/2, p = (E* m/2) arcosh(a/r).

    The slope is m, the tangent of the angle between the cone's side and the plane; others as of `power_law`.
    """
    return power_law(effective_modulus, slope, 1.0, **given)


# ----------------------------------------------------------------------------------- punches


def flat_punch(effective_modulus: float, radius: float, **given: Unpack[Given]) -> AxisymmetricContact:
    """Solve the contact of a flat circular punch: P = 2 E* a delta, p = P/(2 pi a sqrt(a^2-r^2)).

    The radius is a (m); others as of `power_law`, without ``contact_radius``.
    """
    require_positive(effective_modulus=effective_modulus, radius=radius)
    name, value = driven_by(given, with_radius=False)
    body = effective_modulus, radius
    stiffness = float(flat.flat_punch_stiffness(*body))
    load = value if name == "normal_load" else stiffness * value
    return AxisymmetricContact(
        *body, load / stiffness, load, np.inf, lambda r: flat.flat_punch_pressure(*body, r, load)
    )


def rounded_punch(
    effective_modulus: float, flat_radius: float, edge_radius: float, **given: Unpack[Given]
) -> AxisymmetricContact:
    """Solve the contact of a flat punch with a parabolic edge: h = (r-b)^2/(2R) outside r = b, 0 inside.

    delta(t) = (t/R) [sqrt(t^2-b^2) - b arccos(b/t)] for t > b. The flat radius is b (m), the edge radius R
    (m); other arguments as of `power_law`.
    """
    require_positive(effective_modulus=effective_modulus, flat_radius=flat_radius, edge_radius=edge_radius)
    name, value = driven_by(given)
    if name == "contact_radius" and value <= flat_radius:
        raise DeckError(f"contact_radius is {value!r}; expected more than the flat radius {flat_radius!r}")
    body = effective_modulus, flat_radius, edge_radius
    return _contact(_ROUNDED_PUNCH, body, name, value)


def axisymmetric(
    effective_modulus: float,
    slope: Profile,
    curvature: Profile,
    *,
    scale: float = 1.0,
    **given: Unpack[Given],
) -> AxisymmetricContact:
    """Solve the contact of any smooth convex axisymmetric profile h(r), by Gauss quadrature.

    Slope and curvature are h'(r) and h''(r) as functions of an array of radii, smooth on [0, contact radius];
    the scale (m) is a first guess of the contact radius, where they are defined. Others as of `power_law`.
    """
    from scipy import optimize

    require_positive(effective_modulus=effective_modulus, scale=scale)
    name, value = driven_by(given)
    theta, weight = _gauss(64)
    sine, weight = np.sin(np.pi / 2 * theta), np.pi / 2 * weight  # r = t sin(theta)
    node, share = _gauss(200)

    def delta(t: float) -> float:
        return float(np.sum(weight * t * slope(t * sine)))

    def rate(t: Array) -> Array:
        r = t[..., None] * sine
        return np.asarray(np.sum(weight * (slope(r) + r * curvature(r)), axis=-1))

    def load(a: float) -> float:  # by parts: P = 2 E* int t delta'(t) dt
        return float(2.0 * effective_modulus * a**2 * np.sum(share * node * rate(a * node)))

    def pressure(r: Array) -> Array:
        s = np.sqrt(np.maximum(a**2 - r**2, 0.0))[..., None]  # t^2 = r^2 + s^2
        t = np.hypot(r[..., None], s * node)
        integrand = np.divide(rate(t), t, out=np.zeros_like(t), where=t > 0.0)
        return np.asarray(effective_modulus / np.pi * np.sum(s * share * integrand, axis=-1))

    a = value
    if name != "contact_radius":
        target = load if name == "normal_load" else delta
        upper = scale
        while target(upper) < value:
            upper *= 2.0
        a = optimize.brentq(lambda t: target(t) - value, 0.0, upper, xtol=1e-15 * upper, rtol=1e-15)
    r = np.linspace(0.0, a, 401)
    found = pressure(r)
    at = int(np.argmax(found))
    peak = float(found[at])
    if at > 0:
        bounds = r[at - 1], r[min(at + 1, 400)]
        peak = -optimize.minimize_scalar(
            lambda s: -float(pressure(np.array(s))),
            bounds=bounds,
            method="bounded",
            options={"xatol": 1e-8 * a},
        ).fun
    return AxisymmetricContact(effective_modulus, a, delta(a), load(a), peak, pressure)


def _gauss(n: int) -> tuple[Array, Array]:
    """Return nodes and weights of the n-point Gauss-Legendre rule on [0, 1]."""
    from scipy.special import roots_legendre

    node, weight = roots_legendre(n)
    return 0.5 * (node + 1.0), 0.5 * weight


@dataclass(frozen=True)
class EllipticContact:
    """Hertz contact over an ellipse; returned by `hertz_ellipse` and `crossed_cylinders`.

    E* (Pa), semi-axes a >= b (m), direction of the major axis from x (rad) in (-pi/2, pi/2], approach delta
    (m), normal load P (N), largest pressure p0 (Pa).
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

    The Hessian is H (1/m), symmetric, positive definite, of shape (2, 2); others as of `flat_punch`.
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

    The radii are in m; the angle (rad), from the axis of cylinder 1 to that of cylinder 2, is no multiple of
    pi, and that of the result is from the axis of cylinder 1. Others as of `flat_punch`.
    """
    require_positive(radius_1=radius_1, radius_2=radius_2)
    return hertz_ellipse(effective_modulus, flat.cylinders_hessian(radius_1, radius_2, angle), **given)
