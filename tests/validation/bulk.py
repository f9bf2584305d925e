"""Checks: contacts under bulk stress, in two dimensions (Nowell and Hills) and in three, once and in cycles.

Bulk stress shifts the stick strip of Cattaneo and Mindlin by e (Nowell and Hills), and the stick disc of a
sphere with nu = 0 likewise, (C10). Where e grows no faster than the strip or disc shrinks, those of a load in
proportion lie inside one another, and cycles superpose them as in Mindlin and Deresiewicz.
"""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .plane import LONG, _hertz, _middle, _resultant
from .reference import Comparison
from .runs import FIELDS, Array, Run, State, bodies, run
from .tangential import BALL, UNIT_LOAD

MU = 0.3
PEAK = 2.0 / math.pi  # p_0 of the sphere with E* = R = a = 1


@dataclass(frozen=True)
class MidPlane:
    """The mid-plane of a long contact: y (m), p, q_y (Pa) and stick of its nodes, and its loads (N/m)."""

    y: Array
    pressure: Array
    traction: Array
    stick: Array
    normal: float
    shear: float

    @property
    def half_width(self) -> float:
        """Half the width (m) of Hertz's pressure with this load and this peak."""
        return 2.0 * self.normal / (math.pi * float(self.pressure.max()))

    @property
    def share(self) -> float:
        """Q'/(mu P')."""
        return self.shear / (MU * self.normal)

    def strip(self, sign: float = 1.0, scale: float = 1.0, start: Array | float = 0.0) -> tuple[float, float]:
        """Return center and half-width (m) of the stick strip, to a fraction of the spacing.

        (scale mu p - sign (q - start))^2 is a parabola inside it, with zeros at its ends.
        """
        reserve = scale * MU * self.pressure - sign * (self.traction - start)
        start_, slope, bend = np.polynomial.polynomial.polyfit(
            self.y[self.stick], (reserve[self.stick] / self.pressure.max()) ** 2, 2
        )
        center = -0.5 * slope / bend
        return center, math.sqrt(center**2 - start_ / bend)

    def ends(self, count: int = 5) -> tuple[float, float]:
        """Return the ends (m) of a strip between slip of both signs, q = mu p below it and -mu p above."""
        found = []
        for sign, nodes in ((1.0, slice(None, count)), (-1.0, slice(-count, None))):
            y = self.y[self.stick][nodes]
            reserve = (MU * self.pressure - sign * self.traction)[self.stick][nodes]
            slope, start = np.polyfit(y, (reserve / self.pressure.max()) ** 2, 1)
            found.append(float(-start / slope))
        return found[0], found[1]


def mid_plane(state: State) -> MidPlane:
    """Return the nodes of the mid-plane in order, and the loads that they carry."""
    nodes = np.flatnonzero(_middle(state))
    nodes = nodes[np.argsort(state.y.flat[nodes])]
    y, p, q = (field.flat[nodes] for field in (state.y, state.pressure, state.traction_y))
    return MidPlane(y, p, q, state.stick.flat[nodes], _resultant(p, state), _resultant(q, state))


def _long(nu: float, across: int, loads: Sequence[dict[str, object]]) -> Run:
    """Solve a contact 18 times as long as wide of similar bodies, body 1 under bulk stress across it."""
    return run(
        *bodies(0.0, nu / (1.0 - nu), LONG),
        spacing=_hertz().semi_minor / across,
        friction_coefficient=MU,
        bulk={"body": 1, "state": "plane strain x"},
        loads=[{"normal_load": 1.0}, *loads],
    )


def two_signs(share: float, stress: float) -> tuple[float, float]:
    """Return the ends of the stick strip over a where slip has both signs, for Q'/mu P' and sigma/(mu p_0).

    q/(mu p_0) = sqrt(1 - x^2) below it and minus that above: the strain of the stick strip vanishes, and its
    traction is bounded and has the resultant Q' (two conditions on two ends, found by Newton's method).
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)
    angle, weight = 0.25 * math.pi * (nodes + 1.0), 0.25 * math.pi * weights

    def wrong(ends: Array) -> Array:
        low, high = ends
        conditions = np.zeros(2)
        for inner, outer, other in ((low, -1.0, high), (high, 1.0, low)):
            x = outer + (inner - outer) * np.sin(angle) ** 2
            # p dx/sqrt((x - b1)(x - b2)): the root at the inner end goes into the angle
            root = np.sqrt(abs(inner - outer) * abs(x - other))
            parts = weight * np.sqrt(1.0 - x**2) * 2.0 * abs(inner - outer) * np.sin(angle) / root
            conditions += [parts.sum(), (parts * x).sum()]
        whole = 0.25 * math.pi * stress
        return conditions - [whole, 0.5 * (low + high) * whole - 0.5 * math.pi * share]

    half = math.sqrt(1.0 - abs(share))
    ends = np.array([-0.5 * half, 0.9 * half])
    for _ in range(60):
        now, small = wrong(ends), 1e-7
        slopes = np.stack([(wrong(ends + small * unit) - now) / small for unit in np.eye(2)], axis=1)
        step = np.linalg.solve(slopes, -now)
        ends = np.clip(ends + step, -0.999, 0.999)
        if abs(step).max() < 1e-12:
            return float(ends[0]), float(ends[1])
    raise RuntimeError(f"no stick strip found for Q'/mu P' = {share:g} and sigma/(mu p_0) = {stress:g}")


ONE_SIGN = ((0.5, 0.2), (0.5, 0.4), (0.75, 0.8), (0.75, -0.8), (-0.75, 0.8))  # Q/mu P, sigma/(mu p_0)
TWO_SIGNS = ((0.0, 1.0), (0.0, 2.0), (0.5, 1.5), (0.75, 2.0))


def plane(
    poisson_ratios: Sequence[float] = (0.0, 0.3),
    across: int = 40,
    one_sign: Sequence[tuple[float, float]] = ONE_SIGN,
    two_sign: Sequence[tuple[float, float]] = TWO_SIGNS,
) -> Comparison:
    """Shear a long contact across its axis under bulk stress: Nowell and Hills in the mid-plane."""
    found = Comparison()
    peak = _hertz().max_pressure
    for nu in poisson_ratios:
        for part, stress in one_sign:
            load = {"tangential_load_y": f"{part} mu P", "bulk_stress_yy": stress * MU * peak}
            state = mid_plane(_long(nu, across, [load])[-1])
            b, sign = state.half_width, math.copysign(1.0, part)
            center, half = state.strip(sign)
            where = f"ν = {nu:g}, Q = {part:g} μP, σ = {stress:g} μp_0"
            exact = sign * 0.25 * stress * peak / float(state.pressure.max())
            found.add(where, "shift of the stick strip/b", "-", center / b, analytic=exact, relative=0.01)
            exact = math.sqrt(1.0 - abs(state.share))
            found.add(where, "c/b", "-", half / b, analytic=exact, relative=5e-3)
        for part, stress in two_sign:
            load = {"tangential_load_y": f"{part} mu P", "bulk_stress_yy": stress * MU * peak}
            state = mid_plane(_long(nu, across, [load])[-1])
            known = two_signs(state.share, stress * peak / float(state.pressure.max()))
            where = f"ν = {nu:g}, Q = {part:g} μP, σ = {stress:g} μp_0"
            for name, value, exact in zip(("y_min/b", "y_max/b"), state.ends(), known, strict=True):
                found.add(where, name, "-", value / state.half_width, analytic=exact, absolute=0.3 / across)
    found.notes.append(
        "Contact 18 times as long as wide, as in long-contact, "
        f"b/l_e = {across}; plane strain. Formulas with P', Q' and p_0 of the mid-plane itself: "
        "e = σb/(4μp_0) for slip of one sign; else two integral conditions (Q = 0: σ/μp_0 = (8/π)(K − E))."
    )
    return found


def cycle_in_plane(across: int = 40, steps: int = 4, nu: float = 0.3) -> Comparison:
    """Cycle Q and bulk stress in phase: after a turn twice the first loading to half the change."""
    found = Comparison()
    peak, stress = _hertz().max_pressure, 0.4
    ends = [
        {"tangential_load_y": f"{0.5 * f} mu P", "bulk_stress_yy": f * stress * MU * peak} for f in (1, -1, 1)
    ]
    counts = (steps // 2, steps, steps)
    made = _long(nu, across, [end | {"steps": count} for end, count in zip(ends, counts, strict=True)])
    first, back, again = np.cumsum([1 + steps // 2, steps, steps])
    top = mid_plane(made[first])
    for number, name, sign, start in (
        (first, "σ = +σ_0", 1.0, top),
        (first + steps // 2, "σ = 0 on the way back", -1.0, top),
        (back, "σ = -σ_0", -1.0, top),
        (back + steps // 2, "σ = 0 on the way forth", 1.0, mid_plane(made[back])),
        (again, "σ = +σ_0 again", 1.0, mid_plane(made[back])),
    ):
        state = mid_plane(made[number])
        turned = number != first
        center, half = state.strip(sign, 1.0 + turned, start.traction if turned else 0.0)
        share = abs(state.share - turned * start.share) / (1.0 + turned)
        begun = -sign * stress * turned
        part = abs(made[number]["bulk_stress_yy"] / (MU * peak) - begun) / (1.0 + turned)
        exact = 0.25 * part * peak / float(state.pressure.max())
        b = state.half_width
        found.add(name, "shift of the stick strip/b", "-", center / b, analytic=exact, relative=0.01)
        found.add(name, "c/b", "-", half / b, analytic=math.sqrt(1.0 - share), relative=5e-3)
    found.notes.append(
        f"As in bulk-plane with ν = {nu:g}, Q = ±0.5 μP, σ_0 = {stress:g} μp_0, {steps} load steps from turn "
        "to turn. After a turn the tractions change by those of a first loading to half the change with "
        "twice the friction; the strip is that of the nodes that have not slipped since."
    )
    return found


def _sphere(nu: float, mesh: int, loads: Sequence[dict[str, object]], state: str = "plane stress") -> Run:
    """Solve a sphere of radius 1 on a like body, E* = a = 1, with bulk stress in body 1."""
    return run(
        *bodies(0.0, nu / (1.0 - nu), BALL),
        spacing=1.0 / mesh,
        friction_coefficient=MU,
        bulk={"body": 1, "state": state},
        loads=[{"normal_load": UNIT_LOAD}, *loads],
        fields=(*FIELDS, "relative_displacement_x", "relative_displacement_y"),
    )


def _stress(nu: float, strain: float, plane_strain: bool = False) -> float:
    """Return the bulk stress xx that makes a strain xx given over mu p_0/E*; E = 2 (1 - nu^2) E*."""
    return strain * MU * PEAK * 2.0 * (1.0 if plane_strain else 1.0 - nu**2)


def exact_disc(share: float, strain: float) -> tuple[float, float, float]:
    """Return e/a, c/a and Delta E*/(mu p_0 a) of a first loading to Q/mu P and E* e_xx/(mu p_0), (C10)."""
    c, e = (1.0 - abs(share)) ** (1 / 3), math.copysign(2.0 * strain / math.pi, share * strain)
    return e, c, math.copysign(0.25 * math.pi * (2.0 * (1.0 - c**2) + e**2), share)


def disc(mesh: int = 40) -> Comparison:
    """Shift the stick disc of a sphere with nu = 0, driven by force and by displacement."""
    found = Comparison()
    for share, strain in ((0.5, 0.1), (0.5, 0.2), (0.5, -0.2), (-0.5, 0.2), (0.9, 0.7)):
        e, c, shift = exact_disc(share, strain)
        for key, value in (
            ("tangential_load_x", share * MU * UNIT_LOAD),
            ("shift_x", shift * MU * PEAK),
        ):
            made = _sphere(0.0, mesh, [{key: value, "bulk_stress_xx": _stress(0.0, strain)}])
            state = made[-1]
            where = f"Q = {share:g} μP, e_xx = {strain:g} μp_0/E*, {'Q' if 'load' in key else 'Δ'} given"
            x = state["stick_center_x"]
            found.add(where, "shift of the stick disc/a", "-", x, analytic=e, absolute=0.06 / mesh)
            radius = made.result.step(-1).stick_radius_fit.item()
            found.add(where, "radius of the stick disc/a", "-", radius, analytic=c, relative=5e-3)
            if key == "shift_x":
                value = state["tangential_load_x"] / (MU * UNIT_LOAD)
                found.add(where, "Q/μP", "-", value, analytic=share, relative=1e-3)
            else:
                value = state["shift_x"] / (MU * PEAK)
                found.add(where, "Δ_x E*/(μp_0 a)", "-", value, analytic=shift, relative=1e-3)
    return found


def rows() -> list[dict[str, str]]:
    """Return the rows of tests/reference/bulk.csv."""
    path = Path(__file__).parents[1] / "reference/bulk.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def spread_rows() -> Iterator[tuple[float, tuple[float, ...], dict[str, tuple[float, float]]]]:
    """Yield nu, (Q_x, Q_y, e_xx, e_yy), and value and uncertainty by quantity, of the 3d single-step rows."""
    by_load: dict[tuple[float, ...], dict[str, tuple[float, float]]] = {}
    for row in rows():
        if row["case"] == "3d single step":
            load = tuple(float(row[name]) for name in ("nu", "Qx", "Qy", "sigma_or_exx", "eyy"))
            by_load.setdefault(load, {})[row["quantity"]] = float(row["value"]), float(row["uncertainty"])
    for load, known in by_load.items():
        yield load[0], load[1:], known


def single_steps(mesh: int = 60, only: slice = slice(None)) -> Comparison:
    """Apply large bulk strains in one step, with slip of both signs, against values of another program."""
    found = Comparison()
    for nu, (q_x, q_y, e_xx, e_yy), known in list(spread_rows())[only]:
        held = nu != 0.0 and e_yy == 0.0
        loads = {
            "tangential_load_x": q_x * MU * UNIT_LOAD,
            "tangential_load_y": q_y * MU * UNIT_LOAD,
            "bulk_stress_xx": _stress(nu, e_xx, held),
        }
        state = _sphere(nu, mesh, [loads], "plane strain y" if held else "plane stress")[-1]
        where = f"ν = {nu:g}, Q = ({q_x:g}, {q_y:g}) μP, e = ({e_xx:g}, {e_yy:g}) μp_0/E*"
        stick = state.stick
        for name, shown, value in (
            ("Delta_x", "Δ_x E*/(μp_0 a)", state["shift_x"] / (MU * PEAK)),
            ("Delta_y", "Δ_y E*/(μp_0 a)", state["shift_y"] / (MU * PEAK)),
            ("stick_fraction", "stick area/contact area", state.stick_fraction),
            ("stick_centroid_x/a", "x of the stick centroid/a", float(state.x[stick].mean())),
        ):
            exact, spread = known[name]
            found.add(where, shown, "-", value, analytic=exact, absolute=spread)
    found.notes.append(
        "All at once on Hertz's pressure. The values are limits of lattices of 8 to 20 spacings in the "
        "radius, of a dense solver that shares no code with this one; the tolerance is their spread."
    )
    return found


def cycle_energy(share: float, strain: float) -> float:
    """Return the energy over (mu p_0)^2 a^3/E* that a cycle of Q and e_xx in phase dissipates, nu = 0, (C11).

    The work of Q on the shift less that of the moment of the tractions on the strain: 8 times the integral
    along the first loading (C10) less 4 times its end point. Without strain it is Mindlin and Deresiewicz'.
    """
    e, c, shift = exact_disc(share, strain)
    load = 2.0 * math.pi / 3.0 * share  # Q over mu p_0 a^2
    by_load = load * shift - load * 0.25 * math.pi * (2.0 * (1.0 - 0.6 / share * (1.0 - c**5)) + e**2 / 3.0)
    per_moment = -0.5 * math.pi * e**2 * 2.0 * math.pi / 3.0
    by_strain, end = per_moment * (0.5 - share / 3.0), per_moment * c**3
    return 8.0 * (by_load - by_strain) - 4.0 * (load * shift - end)


def works(made: Run, first: int, last: int) -> tuple[float, float, float]:
    """Return the work of the loads between two steps, what slip takes of it, and the dissipated energy.

    The first two, by mean tractions of each step, are the same over a closed cycle to the tolerance of the
    solver: elastic energy is a state. The third is by the tractions at the end of each step.
    """
    states = [made.result.step(number) for number in range(first, last + 1)]
    area = made.result.lattice.cell_area
    work = taken = 0.0
    for before, after in itertools.pairwise(states):
        for axis in "xy":
            q, s, load, shift = (
                [step[name + axis].values for step in (before, after)]
                for name in ("traction_", "relative_displacement_", "tangential_load_", "shift_")
            )
            strain = [step["bulk_strain_" + 2 * axis].values for step in (before, after)]
            moment = [
                np.nansum(step["traction_" + axis].values * step[axis].values) * area
                for step in (before, after)
            ]
            work += 0.5 * (load[0] + load[1]) * (shift[1] - shift[0])
            work -= 0.5 * (moment[0] + moment[1]) * (strain[1] - strain[0])
            taken -= 0.5 * np.nansum((q[0] + q[1]) * (s[1] - s[0])) * area
    lost = states[-1]["dissipated_energy"].item() - states[0]["dissipated_energy"].item()
    return float(work), float(taken), lost


def cyclic(share: float, strain: float, phase: float, steps: int, cycles: int = 2) -> list[dict[str, object]]:
    """Return loads of cosines: Q_x begins at its peak, the bulk stress lags behind by a phase (degrees)."""
    angles = np.arange(0, cycles * steps + 1) * 2.0 * math.pi / steps
    return [
        {
            "tangential_load_x": round(share * math.cos(angle), 15) * MU * UNIT_LOAD,
            "bulk_stress_xx": _stress(0.0, round(strain * math.cos(angle - math.radians(phase)), 15)),
        }
        for angle in angles
    ]


def cycles(mesh: int = 20, steps: int = 24, share: float = 0.5, strain: float = 0.2) -> Comparison:
    """Cycle a sphere with the bulk stress in phase, in quadrature and in counter-phase with Q."""
    found = Comparison()
    e, _, top = exact_disc(share, strain)
    unit = (MU * PEAK) ** 2
    for phase in (0.0, 90.0, 180.0):
        made = _sphere(0.0, mesh, cyclic(share, strain, phase, steps))
        where = f"phase {phase:g}°"
        end = len(made)
        work, taken, lost = works(made, end - steps, end)

        def add(quantity: str, value: float, exact: float = math.nan, bound: float = math.nan) -> None:
            found.add(where, quantity, "-", value, analytic=exact, absolute=bound)  # noqa: B023

        add("work of the loads/energy of slip in the second cycle", work / taken, 1.0, 1e-6)
        if phase == 90.0:
            add("energy per cycle E*/((μp_0)² a³)", lost / unit)
        else:
            energy = cycle_energy(share, strain)
            add("energy per cycle E*/((μp_0)² a³)", lost / unit, energy, 0.01 * energy)
            turned = 0.5 * (1.0 - np.cos(2.0 * math.pi * np.arange(1, steps // 2 + 1) / steps))
            back = [top - 2.0 * exact_disc(share * part, strain * part)[2] for part in turned]
            shifts = [made[2 + k]["shift_x"] / (MU * PEAK) for k in range(1, steps // 2 + 1)]
            worst = float(np.abs(np.subtract(shifts, back)).max())
            add("largest error of Δ_x E*/(μp_0 a) on the way back", worst, 0.0, 1e-3)
            x, moved = made[end]["stick_center_x"], e if phase == 0.0 else -e
            add("shift of the stick disc/a", x, moved, 0.1 / mesh)
        q = [made.result.step(number)["traction_x"].values for number in (end - steps // 2, end)]
        odd = float(np.abs(q[0] + q[1]).max()) / (MU * PEAK)
        add("half a cycle apart: largest |q_x + q_x'|/(μp_0)", odd, 0.0, 1e-4)
    return found
