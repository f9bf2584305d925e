"""Checks: the middle of a long contact against plane solutions (Figure 13.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hexcontact import analytic
from hexcontact.analytic.friction import PlaneCattaneo, goodman_stick_ratio_plane
from hexcontact.deck.surfaces import Paraboloid

from .reference import Comparison
from .runs import Array, Mask, State, bodies, press, run

# A barrel along x, so that the contact is 18 times as long as it is wide.
LONG = Paraboloid(radius_x=100.0, radius_y=1.0)
LOAD = 1.0


def _middle(state: State) -> Mask:
    """Nodes of the mid-plane, one in each row; in every second row x = l_e/2."""
    return np.asarray(np.abs(state.x - 0.25 * state.spacing) < 0.5 * state.spacing)


def _hertz(load: float = LOAD) -> analytic.EllipticContact:
    return analytic.hertz_ellipse(1.0, [[0.01, 0.0], [0.0, 1.0]], normal_load=load)


def _resultant(values: Array, state: State) -> float:
    """Integrate over the mid-plane; its nodes are l_e sqrt(3)/2 apart."""
    return float(values.sum() * math.sqrt(0.75) * state.spacing)


def cattaneo(
    poisson_ratios: Sequence[float] = (0.0, 0.33),
    parts: Sequence[float] = (0.25, 0.5, 0.75),
    across: int = 20,
) -> Comparison:
    """Shear a long contact of alike bodies across its axis; the mid-plane against plane Cattaneo-Mindlin."""
    found = Comparison()
    mu = 0.3
    for nu in poisson_ratios:
        loads = [{"normal_load": LOAD}, *({"tangential_load_y": f * mu * LOAD} for f in parts)]
        spacing = _hertz().semi_minor / across
        made = run(*bodies(0.0, nu / (1.0 - nu), LONG), spacing=spacing, friction_coefficient=mu, loads=loads)
        for number, part in enumerate(parts, start=2):
            state = made[number]
            middle = _middle(state)
            y, p, q = state.y[middle], state.pressure[middle], state.traction_y[middle]
            normal, shear = _resultant(p, state), _resultant(q, state)
            peak = _hertz().max_pressure
            exact = PlaneCattaneo(mu, normal, 2.0 * normal / (math.pi * peak))
            where = f"ν = {nu:g}, Q/μP = {part:g}"
            found.add(where, "Q'/μP' in the mid-plane", "-", shear / (mu * normal))
            half = _half_width(y, state.stick[middle])
            value, true = half / exact.half_width, exact.stick_half_width(shear) / exact.half_width
            found.add(where, "c/b", "-", value, analytic=true, absolute=0.7 / across)
            error = float(np.abs(q - exact.traction(y, shear)).max()) / (mu * peak)
            found.add(where, "max error of q_y/(μ p_0)", "-", error, analytic=0.0, absolute=0.05)
        found.add(f"ν = {nu:g}", "time", "s", made.seconds)
    found.notes.append(
        "Paraboloid with radii 100 m along x and 1 m across, E* = 1 Pa, P = 1 N, μ = 0.3, sheared along y; "
        f"b/l_e = {across}. Plane solution: with the mid-plane's own loads P' and Q' on a length."
    )
    return found


def _half_width(y: Array, inside: Mask) -> float:
    """Return half the width that the nodes of a zone in the mid-plane stand for."""
    rows = np.unique(np.round(y[inside], 12)) if inside.any() else np.zeros(0)
    step = np.diff(np.unique(np.round(y, 12)))[0]
    return 0.5 * float(rows.size * step)


def dissimilar(
    cases: Sequence[tuple[float, float]] = ((-0.189, 0.2), (-0.3, 0.2)), across: int = 20, steps: int = 20
) -> Comparison:
    """Press a long contact of dissimilar bodies, then shear it; stick in the mid-plane."""
    found = Comparison()
    parts = (0.001, 0.3, 0.6)  # of mu P
    for beta, mu in cases:
        shear = [{"tangential_load_y": part * mu * LOAD} for part in parts]
        made = run(
            *bodies(beta, 0.25, LONG),
            spacing=_hertz().semi_minor / across,
            friction_coefficient=mu,
            coupling="goodman",
            loads=[press(LOAD, steps), *shear],
        )
        where, pressed = f"β = {beta:g}, μ = {mu:g}", made[steps]
        middle = _middle(pressed)
        half = _half_width(pressed.y[middle], pressed.contact[middle])
        ratio = _half_width(pressed.y[middle], pressed.stick[middle]) / half
        exact = goodman_stick_ratio_plane(beta, mu)
        row = math.sqrt(0.75) / across  # distance of the rows of nodes over b
        allowed = 1.4 * row
        found.add(where, "pressed: c/b", "-", ratio, analytic=exact, absolute=allowed)
        for number, part in enumerate(parts, start=steps + 1):
            state = made[number]
            stick = state.y[middle & state.stick] / half
            low, high = float(stick.min()) - 0.5 * row, float(stick.max()) + 0.5 * row
            if number == steps + 1:  # slip behind stops, slip ahead goes on
                found.add(where, f"Q = {part:g} μP: y_min/b", "-", low, analytic=-exact, absolute=allowed)
                found.add(where, f"Q = {part:g} μP: y_max/b", "-", high, analytic=1.0, absolute=2 * allowed)
            else:
                found.add(where, f"Q = {part:g} μP: y_min/b", "-", low)
                found.add(where, f"Q = {part:g} μP: y_max/b", "-", high)
        found.add(where, f"time, {len(made)} steps", "s", made.seconds)
    found.notes.append(
        f"goodman; {steps} steps P_k = P (k/N)³, then Q along y on body 1, the stiffer one. Plane solution "
        "under pressure: |β| K(c/b) = μ K'(c/b). A first small Q stops the slip on the side to which the "
        "traction points, so that stick reaches from -c to the edge. Half a row is added to the outermost "
        "nodes."
    )
    return found
