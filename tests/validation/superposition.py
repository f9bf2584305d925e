"""Checks of chapter 10: sheared surfaces of other forms against superposed contacts without friction.

Where beta = 0 and Poisson's ratios are 0 the kernels of pressure and shear traction are the same. Under P,
then Q, the traction is q = mu (p(P) - p(P*)), P* = P - Q/mu, and the shift mu (delta(P) - delta(P*)): with
these g* >= 0 of the contact under P* is the slip over mu, which opposes q, and 0 in its contact, which sticks
(Jaeger, Ciavarella). That holds for any gap, and for the discrete problem as well.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq

from hexcontact import analytic
from hexcontact.analytic.friction import SuperposedContact
from hexcontact.deck.surfaces import Cone, Power, Punch, RoundedPunch, Surface

from .normal import solve
from .reference import Comparison
from .runs import STICK, Array, State, bodies, run

MU, PART = 0.3, 0.5  # Q = PART mu P
BUMPS = np.array([[-0.9, 0.1], [0.8, -0.2]])  # of the own surface
AXISYMMETRIC: dict[str, tuple[Surface, Any]] = {
    "cone": (Cone(slope=1.0), partial(analytic.cone, 1.0, 1.0)),
    "power r⁴": (Power(coefficient=1.0, exponent=4.0), partial(analytic.power_law, 1.0, 1.0, 4)),
    "rounded punch": (
        RoundedPunch(flat_radius=0.6, edge_radius=1.0),
        partial(analytic.rounded_punch, 1.0, 0.6, 1.0),
    ),
    "flat punch": (Punch(radius=1.0), partial(analytic.flat_punch, 1.0, 1.0)),
}


def two_bumps(x: Array, y: Array) -> Array:
    """Return the gap (m) between a flat and two unequal bumps, the second one higher by 0.03."""
    first, second = (0.5 * ((x - x0) ** 2 + 1.5 * (y - y0) ** 2) for x0, y0 in BUMPS)
    return np.minimum(first + 0.03, second)


def superposition(mesh: int = 40) -> Comparison:
    """Shear each surface; compare with its contacts without friction on the same lattice, and closed ones."""
    found = Comparison()
    for name, (surface, closed) in AXISYMMETRIC.items():
        load = 1.0 if name == "flat punch" else closed(contact_radius=1.0).normal_load
        given = dict(zip(("body_1", "body_2"), bodies(0.0, 0.0, surface), strict=True))
        state = _compared(found, name, given, load, 1.0 / (mesh + 0.25), 1.0)
        _closed(found, name, state, SuperposedContact(MU, load, 0.0, partial(_under, closed)))
    plain = {"young_modulus": 2.0, "poisson_ratio": 0.0}
    own = {"body_1": plain, "body_2": plain, "gap": two_bumps}
    _compared(found, "two bumps, from Python", own, 0.15, 1.0 / mesh, 2.0)
    _two_pads(found)
    found.notes += [
        f"E* = 1, alike bodies with ν = 0, μ = {MU:g}, Q = {PART:g} μP in four steps, a/l_e = {mesh}.25, "
        "a = 1 (that of the flat punch is given; the two bumps are unequal and not round).",
        "p*, δ*: frictionless contact on the same lattice under P - Q/μ. Below them the closed solutions.",
    ]
    return found


def _under(closed: Any, load: float) -> analytic.AxisymmetricContact:
    contact: analytic.AxisymmetricContact = closed(normal_load=load)
    return contact


def _compared(
    found: Comparison, name: str, given: dict[str, Any], load: float, spacing: float, reach: float
) -> State:
    """Compare with the frictionless solutions under P and P*; return the sheared state."""
    window = {"spacing": spacing, "center": (0.0, 0.0), "extent": (2.6 * reach, 2.6 * reach)}
    shear = PART * MU * load
    loads = [{"normal_load": load}, {"tangential_load_x": shear, "steps": 4}]
    state = run(
        given["body_1"], given["body_2"], **_gap(given), **window, friction_coefficient=MU, loads=loads
    )[-1]
    whole, part = (
        solve(given["body_1"], given["body_2"], **_gap(given), **window, method="fft", normal_load=p)
        for p in (load, load - shear / MU)
    )
    scale = MU * whole.peak
    apart = np.abs(state.traction_x - MU * (whole.pressure - part.pressure)).max() / scale
    found.add(name, "max |q - μ(p - p*)|/(μ p_max)", "-", float(apart), analytic=0.0, absolute=1e-8)
    across = float(np.abs(state.traction_y).max()) / scale
    found.add(name, "max |q_y|/(μ p_max)", "-", across, analytic=0.0, absolute=1e-8)
    shift = MU * (whole.approach - part.approach)
    found.add(name, "Δ over μ(δ - δ*)", "-", state["shift_x"] / shift, analytic=1.0, relative=1e-9)
    if name != "flat punch":  # all of which sticks: p* is in proportion to p
        other = int(np.count_nonzero((state.zone == STICK) != part.contact))
        found.add(
            name, "nodes that stick but for p* > 0, or not", "-", float(other), analytic=0.0, absolute=0.5
        )
    return state


def _two_pads(found: Comparison) -> None:
    """Press two spherical pads of one body; their loads against Hertz's contacts that lift each other.

    delta - h_i = (9 P_i^2/(16 E*^2 R))^(1/3) + P_j/(pi E* d), d the distance: the next term is (a/d)^2 of
    the last one.
    """
    radius, apart, load = 1.0, 2.0, 0.06
    shorter, plain = (0.0, 0.02), {"young_modulus": 2.0, "poisson_ratio": 0.0}

    def gap(x: Array, y: Array) -> Array:
        one, two = ((x - side * apart / 2) ** 2 + y**2 for side in (-1, 1))
        return np.minimum(one / (2 * radius) + shorter[0], two / (2 * radius) + shorter[1])

    window = {"spacing": 0.015, "center": (0.0, 0.0), "extent": (3.2, 1.2)}
    state = solve(plain, plain, gap=gap, **window, method="fft", normal_load=load)
    cell = math.sqrt(0.75) * state.spacing**2

    def excess(share: float) -> float:
        one, two = share * load, (1 - share) * load
        hertz = [(9 * p**2 / (16 * radius)) ** (1 / 3) for p in (one, two)]
        return hertz[0] + two / (math.pi * apart) - hertz[1] - one / (math.pi * apart) - shorter[1]

    first = load * float(brentq(excess, 0.5, 1.0))
    for name, side, exact in (("longer", state.x < 0, first), ("shorter", state.x > 0, load - first)):
        force = float(state.pressure[side].sum()) * cell
        found.add("two pads", f"load of the {name} one", "N", force, analytic=exact, relative=5e-4)


def _gap(given: dict[str, Any]) -> dict[str, Any]:
    return {"gap": given["gap"]} if "gap" in given else {}


def _closed(found: Comparison, name: str, state: State, exact: SuperposedContact) -> None:
    """Compare with the closed solution: shift, stick radius, traction away from center and edges."""
    shear = PART * exact.sliding_load
    found.add(name, "Δ", "-", state["shift_x"], analytic=exact.shift(shear), relative=5e-3)
    r, c = np.hypot(state.x, state.y), exact.stick_radius(shear)
    if name != "flat punch":
        found.add(name, "c/a", "-", state.stick_radius, analytic=c, absolute=0.5 * state.spacing)
    part = (r > 0.2) & (r < 0.8) & (np.abs(r - c) > 2.0 * state.spacing)
    error = float(np.abs(state.traction_x - exact.traction(r, shear))[part].max()) / (
        exact.sliding_load / math.pi
    )
    found.add(name, "max error of q π a²/(μP), 0.2 < r/a < 0.8", "-", error, analytic=0.0, absolute=5e-3)
