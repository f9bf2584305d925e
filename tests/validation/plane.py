"""Checks: the middle of a long contact against plane solutions (Figure 13.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexcontact import analytic
from hexcontact.analytic.friction import PlaneCattaneo, goodman_stick_ratio_plane
from hexcontact.deck.surfaces import Paraboloid

from .reference import Comparison
from .runs import Array, Mask, State, bodies, press, run

# A barrel along x, so that the contact is 18 times as long as it is wide.
LONG = Paraboloid(radius_x=100.0, radius_y=1.0)
LOAD = 1.0
LONGER = Paraboloid(radius_x=24000.0, radius_y=1.0)
"""390 times: pressing shears less than on a plane by the part 2|y|/(πa) of the pressure beyond its ends."""


def _middle(state: State) -> Mask:
    """Nodes of the mid-plane, one in each row; in every second row x = l_e/2."""
    return np.asarray(np.abs(state.x - 0.25 * state.spacing) < 0.5 * state.spacing)


def _hertz(load: float = LOAD, barrel: Paraboloid = LONG) -> analytic.EllipticContact:
    return analytic.hertz_ellipse(1.0, barrel.curvature, normal_load=load)


def _resultant(values: Array, state: State) -> float:
    """Integrate over the mid-plane; its nodes are l_e sqrt(3)/2 apart."""
    return float(values.sum() * math.sqrt(0.75) * state.spacing)


def cattaneo(
    poisson_ratios: Sequence[float] = (0.0, 0.33),
    parts: Sequence[float] = (0.25, 0.5, 0.75),
    across: int = 240,
    along: int = 96,
) -> Comparison:
    """Shear a long contact of alike bodies across its axis; the mid-plane against plane Cattaneo-Mindlin."""
    found = Comparison()
    mu, hertz = 0.3, _hertz()
    grid = {"lattice": "rectangular", "spacing": (hertz.semi_major / along, hertz.semi_minor / across)}
    for nu in poisson_ratios:
        loads = [{"normal_load": LOAD}, *({"tangential_load_y": f * mu * LOAD} for f in parts)]
        made = run(*bodies(0.0, nu / (1.0 - nu), LONG), **grid, friction_coefficient=mu, loads=loads)
        for number, part in enumerate(parts, start=2):
            state = made[number]
            middle = np.abs(state.x) < 0.5 * state.spacing
            y, p, q = state.y[middle], state.pressure[middle], state.traction_y[middle]
            normal, shear = (float(values.sum()) * grid["spacing"][1] for values in (p, q))
            peak = hertz.max_pressure
            exact = PlaneCattaneo(mu, normal, 2.0 * normal / (math.pi * peak))
            where = f"ν = {nu:g}, Q/μP = {part:g}"
            # q = mu (p(P) - p(P - Q/mu)) (Jaeger, Ciavarella), and P' goes with P^(2/3)
            exact_part = 1.0 - (1.0 - part) ** (2.0 / 3.0)
            value = shear / (mu * normal)
            found.add(where, "Q'/μP' in the mid-plane", "-", value, analytic=exact_part, absolute=1e-3)
            half = _half_width(y, state.stick[middle])
            value, true = half / exact.half_width, exact.stick_half_width(shear) / exact.half_width
            found.add(where, "c/b", "-", value, analytic=true, absolute=0.7 / across)
            errors = (q - exact.traction(y, shear)) / (mu * peak)
            rms, largest = float(np.sqrt(np.mean(errors**2))), float(np.abs(errors).max())
            found.add(where, "rms error of q_y/(μ p_0)", "-", rms, analytic=0.0, absolute=3e-3)
            found.add(where, "max error of q_y/(μ p_0)", "-", largest, analytic=0.0, absolute=0.02)
        found.add(f"ν = {nu:g}", "time", "s", made.seconds)
    found.notes.append(
        "Paraboloid with radii 100 m along x and 1 m across, E* = 1 Pa, P = 1 N, μ = 0.3, sheared along y; "
        f"rectangular cells, {along} and {across} in the half-axes. Plane solution: with the mid-plane's own "
        "loads P' and Q' on a length."
    )
    return found


def _half_width(y: Array, inside: Mask) -> float:
    """Return half the width that the nodes of a zone in the mid-plane stand for."""
    rows = np.unique(np.round(y[inside], 12)) if inside.any() else np.zeros(0)
    step = np.diff(np.unique(np.round(y, 12)))[0]
    return 0.5 * float(rows.size * step)


def dissimilar(
    cases: Sequence[tuple[float, float]] = ((-0.189, 0.2), (-0.3, 0.2)),
    across: int = 100,
    along: int = 400,
    steps: int = 24,
) -> Comparison:
    """Press a long contact of dissimilar bodies, then shear it; stick in the mid-plane."""
    found = Comparison()
    parts = (0.001, 0.3, 0.6)  # of mu P
    hertz = _hertz(LOAD, LONGER)
    for beta, mu in cases:
        shear = [{"tangential_load_y": part * mu * LOAD} for part in parts]
        made = run(
            *bodies(beta, 0.25, LONGER),
            lattice="rectangular",
            spacing=(hertz.semi_major / along, hertz.semi_minor / across),
            friction_coefficient=mu,
            coupling="goodman",
            loads=[press(LOAD, steps), *shear],
        )
        where, pressed = f"β = {beta:g}, μ = {mu:g}", made[steps]
        middle = np.abs(pressed.x) < 0.5 * pressed.spacing
        half = _half_width(pressed.y[middle], pressed.contact[middle])
        ratio = _half_width(pressed.y[middle], pressed.stick[middle]) / half
        exact = goodman_stick_ratio_plane(beta, mu)
        row = 1.0 / across  # distance of the rows of nodes over b
        allowed = 1.4 * row
        found.add(where, "pressed: c/b", "-", ratio, analytic=exact, absolute=2 * row)
        states = [made[number] for number in range(steps + 1, len(made) + 1)]
        shares = [
            float(state.traction_y[middle].sum() / (mu * state.pressure[middle]).sum()) for state in states
        ]
        strips = sheared_strips(beta, mu, shares)
        for part, state, strip in zip(parts, states, strips, strict=True):
            stick = state.y[middle & state.stick] / half
            low, high = float(stick.min()) - 0.5 * row, float(stick.max()) + 0.5 * row
            exact_q = np.interp(state.y[middle] / hertz.semi_minor, strip.y, strip.traction, 0.0, 0.0)
            scale = mu * float(state.pressure[middle].max())
            error = float(np.sqrt(np.mean((state.traction_y[middle] / scale - exact_q) ** 2)))
            found.add(
                where, f"Q = {part:g} μP: rms error of q_y/(μ p_0)", "-", error, analytic=0.0, absolute=4.5e-3
            )
            for name, value, true in zip(("y_min", "y_max"), (low, high), strip.stick, strict=True):
                found.add(where, f"Q = {part:g} μP: {name}/b", "-", value, analytic=true, absolute=allowed)
        found.add(where, f"time, {len(made)} steps", "s", made.seconds)
    found.notes.append(
        f"goodman; {steps} steps P_k = P (k/N)³, then Q along y on body 1, the stiffer one. Plane solution "
        "under pressure: |β| K(c/b) = μ K'(c/b). A first small Q stops the slip on the side to which the "
        "traction points. Half a row is added to the outermost nodes. With Q: the plane problem itself, in "
        "400 strips and 100 steps (within 0.06 % rms of 1600 and 400), with the shares Q'/μP' of the "
        f"mid-plane. The contact is 390 times as long as it is wide, {along} and {across} spacings in its "
        "half-axes. The lattice limits the rms error: p itself differs by 0.18 % from Hertz's (0.44 % with "
        "40 spacings across). One 184 times as long as wide adds up to 0.07 %, 18 times as long 2 %."
    )
    return found


@dataclass(frozen=True)
class Strip:
    """A state of the plane problem: places over b, q/(mu p0), ends of the stick strip over b."""

    y: Array
    traction: Array
    stick: tuple[float, float]


def sheared_strips(
    beta: float, mu: float, shares: Sequence[float], count: int = 400, steps: int = 100
) -> list[Strip]:
    """Solve the plane problem of Figure 13.3 with Hertz's pressure: pressed, then sheared to shares of mu P'.

    Strips of constant traction; the long axis is integrated out of the kernels of a point force, so that
    s = -2 int ln|y - eta| q - pi beta int sgn(y - eta) p - D, in units of lambda_1 (Goodman's coupling).
    """
    step = 2.0 / count
    y = (np.arange(count) + 0.5) * step - 1.0
    apart = y[:, None] - y[None, :]
    ends = apart[..., None] + 0.5 * step * np.array([1.0, -1.0])
    kernel = -2.0 * np.diff((ends * (np.log(np.abs(ends)) - 1.0))[..., ::-1], axis=-1)[..., 0]
    spread = math.pi * beta * step * np.sign(apart)
    pressure, traction = np.zeros(count), np.zeros(count)
    states = []
    halves = np.linspace(1.0, 0.05, steps)[::-1]  # the first step alone is not self-similar
    for half, share in [*((float(w), 0.0) for w in halves), *((1.0, share) for share in shares)]:
        before = kernel @ traction - spread @ pressure
        pressure = np.sqrt(np.maximum(half**2 - y**2, 0.0))
        bound = mu * pressure
        traction, stick = _slipped(kernel, spread @ pressure + before, bound, share * float(bound.sum()))
        if half == 1.0:
            inside = y[stick & (bound > 0.0)]
            states.append(Strip(y, traction / mu, (inside.min() - 0.5 * step, inside.max() + 0.5 * step)))
    return states[1:]


def _slipped(kernel: Array, moved: Array, bound: Array, load: float) -> tuple[Array, Mask]:
    """Return traction and stick of a step: ds = kernel q - moved - D, q is q - r ds cut to the bounds."""
    count, side = bound.size, np.zeros(bound.size)
    for _ in range(200):
        stick = (side == 0.0) & (bound > 0.0)
        traction = side * bound
        free = np.flatnonzero(stick)
        system = np.zeros((free.size + 1, free.size + 1))
        system[:-1, :-1], system[:-1, -1], system[-1, :-1] = kernel[np.ix_(free, free)], -1.0, 1.0
        right = np.append((moved - kernel @ traction)[free], load - traction.sum())
        solved = np.linalg.solve(system, right)
        traction[free] = solved[:-1]
        slip = kernel @ traction - moved - solved[-1]
        trial = traction - slip / kernel[0, 0]
        new = np.where(np.abs(trial) > bound, np.sign(trial), 0.0) * (bound > 0.0)
        if (new == side).all():
            return traction, stick
        side = new
    raise RuntimeError(f"the plane problem of {count} strips does not converge")
