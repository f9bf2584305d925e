"""Checks: the middle of a long contact against plane solutions (Figure 13.3)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ellipe, ellipk

from hexcontact import analytic
from hexcontact.analytic.friction import PlaneCattaneo, goodman_stick_ratio_plane
from hexcontact.core.contact import ElasticPair
from hexcontact.core.friction import ContactState, FrictionalContact
from hexcontact.core.lattice import Lattice
from hexcontact.deck.surfaces import Paraboloid

from .reference import Comparison
from .runs import STICK, Array, Mask, State, bodies, run

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
    across: int = 160,
    along: int = 64,
    steps: int = 36,
) -> Comparison:
    """Press a long contact of dissimilar bodies, then shear it; stick in the mid-plane."""
    found = Comparison()
    parts = (0.001, 0.3, 0.6)  # of mu P
    hertz = _hertz(LOAD, LONGER)
    for beta, mu in cases:
        started = time.perf_counter()
        lattice, states = _sheared(beta, mu, (along, across), steps, parts)
        where, middle = f"β = {beta:g}, μ = {mu:g}", np.abs(lattice.x) < 0.5 * lattice.spacing
        made = [_mid_plane(state, middle, lattice.y[middle] / hertz.semi_minor, mu) for state in states]
        exact = goodman_stick_ratio_plane(beta, mu)
        found.add(where, "pressed: c/b", "-", made[0].stick_ends(*GROWN)[1], analytic=exact, relative=3e-3)
        shares = [float(strip.traction.sum() / strip.pressure.sum()) for strip in made[1:]]
        exact_strips = sheared_strips(beta, mu, shares)
        for part, strip, true in zip((0.0, *parts), made, exact_strips, strict=True):
            error = strip.traction - np.interp(strip.y, true.y, true.traction, 0.0, 0.0)
            name = f"Q = {part:g} μP" if part else "pressed"
            rms = float(np.sqrt(np.mean(error**2)))
            found.add(where, f"{name}: rms error of q_y/(μ p_0)", "-", rms, analytic=0.0, absolute=3e-3)
            if not part:
                continue
            shape = GROWN if part == parts[0] else DRIVEN_BACK
            ends = zip(strip.stick_ends(*shape), true.stick_ends(*shape), strict=True)
            for name_of_end, (end, true_end) in zip(("y_min", "y_max"), ends, strict=True):
                found.add(where, f"{name}: {name_of_end}/b", "-", end, analytic=true_end, absolute=3e-3)
        found.add(where, f"time, {steps + len(parts)} steps", "s", time.perf_counter() - started)
    found.notes.append(
        f"goodman; {steps} steps P_k = P (k/N)³, then Q along y on body 1, the stiffer one. Plane solution "
        "under pressure: |β| K(c/b) = μ K'(c/b). A first small Q stops the slip on the side to which the "
        "traction points. Ends of the stick strip, in both solutions: zeros of lines through the power 2/3 "
        "of μp - |q| over 0.1 b where it has grown, through its square over 0.03 b where a step drives it "
        "back. Nodes that stick lack half a step of growth, about 1 % of b. Tractions: the plane problem "
        "itself in 1200 strips (within 0.03 % rms of 2400), under pressure without load steps, with the "
        "shares Q'/μP' of the mid-plane; rms over the nodes in contact. The contact is 390 times as long as"
        f" it is wide, on the core's lattice with {along} and {across} spacings in its half-axes: the cells "
        "are more slender than those of decks. The nodes next to the edges of contact and stick limit the "
        "rms: p itself differs by 0.12 % from Hertz's. Plane lattices have up to 0.41 % with 100 spacings "
        "across and, with 200, 0.18 %, with many steps; 24 steps make 0.27 % of it. A contact 184 times as "
        "long as wide adds up to 0.2 %."
    )
    return found


def _sheared(
    beta: float, mu: float, counts: tuple[int, int], steps: int, parts: Sequence[float]
) -> tuple[Lattice, list[ContactState]]:
    """Press and shear on cells more slender than a deck admits; the states under the whole load."""
    hertz = _hertz(LOAD, LONGER)
    spacing, across = hertz.semi_major / counts[0], hertz.semi_minor / counts[1]
    lattice = Lattice.covering(
        spacing,
        (0.0, 0.0),
        2.16 * hertz.semi_major,
        2.16 * hertz.semi_minor,
        cell_ratio=across / spacing,
        cell_angle=0.5 * math.pi,
    )
    keys = ("young_modulus", "poisson_ratio")
    pair = ElasticPair.from_materials(*(body[key] for body in bodies(beta, 0.25, LONGER) for key in keys))
    curvature = LONGER.curvature
    gap = 0.5 * (curvature[0, 0] * lattice.x**2 + curvature[1, 1] * lattice.y**2)
    contact = FrictionalContact(lattice, pair, gap, friction_coefficient=mu, coupling="goodman")
    pressing = [(LOAD * (number / steps) ** 3, 0.0) for number in range(1, steps + 1)]
    state, states = contact.virgin(), []
    for normal, shear in [*pressing, *((LOAD, part * mu * LOAD) for part in parts)]:
        control = ("force", "force", "force", "displacement")
        state = contact.advance(state, control, (normal, 0.0, shear, 0.0), tolerance=1e-6)
        if normal == LOAD:
            states.append(state)
    return lattice, states


GROWN, DRIVEN_BACK = (2.0 / 3.0, 0.1), (2.0, 0.03)
"""Powers of the reserve of friction that are linear at an end of the stick strip; widths of the fits."""


@dataclass(frozen=True)
class Strip:
    """A state of the plane problem: places over b, p/p0, q/(mu p0), and what sticks."""

    y: Array
    pressure: Array
    traction: Array
    sticks: Mask

    def stick_ends(self, power: float, width: float) -> tuple[float, float]:
        """Return the ends of the stick strip over b, from lines through a power of the reserve beside them.

        Where a step drives an end back, the reserve mu p - |q| is like the root of the distance. A growing
        contact adds such roots, each with its own end: the sum is like the power 3/2, and belongs to the end
        of the last step. Nodes that stick belong to its middle.
        """
        reserve = np.maximum(self.pressure - np.abs(self.traction), 0.0) ** power
        ends = []
        for side in (-1.0, 1.0):
            y = side * self.y
            end = float(y[self.sticks].max())
            if end >= y.max():  # nothing slips at this edge of the contact
                ends.append(side)
                continue
            for _ in range(5):
                near = (y <= end) & (y > end - width)
                slope, level = np.polyfit(y[near], reserve[near], 1)
                end = -float(level / slope)
            ends.append(side * end)
        return ends[0], ends[1]


def _mid_plane(state: ContactState, middle: Mask, y: Array, mu: float) -> Strip:
    """Return the nodes in contact of the mid-plane."""
    pressure = state.pressure[middle]
    touches, peak = pressure > 0.0, pressure.max()
    fields = (y, pressure / peak, state.traction_y[middle] / (mu * peak), state.zone[middle] == STICK)
    return Strip(*(field[touches] for field in fields))


def sheared_strips(beta: float, mu: float, shares: Sequence[float], count: int = 1200) -> list[Strip]:
    """Solve the plane problem of Figure 13.3 with Hertz's pressure: pressed, then sheared to shares of mu P'.

    Strips of constant traction; the long axis is integrated out of the kernels of a point force, so that
    s = -2 int ln|y - eta| q - pi beta int sgn(y - eta) p - D, in units of lambda_1 (Goodman's coupling).
    """
    step = 2.0 / count
    y = (np.arange(count) + 0.5) * step - 1.0
    kernel = kernel_of(y)
    bound = mu * np.sqrt(1.0 - y**2)
    traction, stick = np.zeros(count), np.full(count, True)
    if beta:
        traction, stick = _pressed(beta, mu, y, kernel)
    states = []
    for share in (0.0, *shares):
        if states:
            traction, stick = _slipped(kernel, kernel @ traction, bound, share * float(bound.sum()))
        states.append(Strip(y, bound / mu, traction / mu, stick))
    return states


def kernel_of(y: Array) -> Array:
    """Return -2 int ln|y - eta| over each strip, at the middle of each, but for a constant."""
    apart, step = y[:, None] - y[None, :], y[1] - y[0]
    ends = apart[..., None] + 0.5 * step * np.array([1.0, -1.0])
    kernel: Array = -2.0 * np.diff((ends * (np.log(np.abs(ends)) - 1.0))[..., ::-1], axis=-1)[..., 0]
    return kernel


def _pressed(beta: float, mu: float, y: Array, kernel: Array) -> tuple[Array, Mask]:
    """Return traction and stick of unlike cylinders whose contact grew from nothing to b = 1.

    Contacts of all sizes are similar: q = b f(y/b), s = b^2 F(y/b). What sticks no longer moves, so F is
    C y|y| there. The traction is bounded at both ends of the stick strip if the integral of its equation
    over sqrt(c^2 - y^2) vanishes: C = pi/c [-+mu (K'(c) - E'(c)) - beta E(c)], minus for beta < 0.
    """
    c, way = goodman_stick_ratio_plane(beta, mu), math.copysign(1.0, beta)
    rest = 1.0 - c * c
    locked = math.pi / c * (way * mu * float(ellipk(rest) - ellipe(rest)) - beta * float(ellipe(c * c)))
    pressure, stick = np.sqrt(1.0 - y**2), np.abs(y) < c
    step = float(y[1] - y[0])
    coupled = math.pi * beta * step * (2.0 * np.cumsum(pressure) - pressure - pressure.sum())
    traction = np.where(stick, 0.0, way * np.sign(y) * mu * pressure)
    right = coupled + locked * y * np.abs(y) - kernel @ traction
    traction[stick] = np.linalg.solve(kernel[np.ix_(stick, stick)], right[stick])
    return traction, stick


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
