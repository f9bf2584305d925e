"""Checks: dissimilar spheres pressed with friction (section 9.2, Table 9.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hexcontact.analytic import friction as closed
from hexcontact.deck.surfaces import Sphere

from .reference import Comparison, reference
from .runs import (
    ALUMINUM,
    BALL,
    RIGID,
    STIFF,
    Run,
    State,
    dissimilar_pair,
    hertz_of,
    press,
    run,
)

LOAD = {40: 10.0, 80: 31.5}  # N; the two loads of Table 9.3, one on each mesh (a/l_e)


@dataclass(frozen=True)
class Ratios:
    """A state over the frictionless contact of the same load."""

    peak: float
    radius: float
    approach: float
    stick: float
    two_nodes: float
    traction: float

    @classmethod
    def of(cls, state: State, load: float, mu: float) -> Ratios:
        """Work them out for the spheres of section 9.2."""
        hertz = hertz_of(dissimilar_pair(), load)
        return cls(
            peak=state.peak / hertz.max_pressure,
            # with much friction the pressure does not vanish like a square root at the edge
            radius=(state.edge_radius if mu < 0.5 else state.area_radius) / hertz.contact_radius,
            approach=state["approach"] / hertz.approach,
            stick=state.stick_radius / state.area_radius,
            two_nodes=state.two_nodes,
            traction=float(state.traction.max()) / hertz.max_pressure,
        )


def _pressed(mesh: int, load: float, mu: float, steps: int, coupling: str = "full") -> Run:
    """Press the spheres of section 9.2; one step: the static solution."""
    spacing = hertz_of(dissimilar_pair(), load).contact_radius / mesh
    return run(
        {**STIFF, "surface": BALL},
        ALUMINUM,
        spacing=spacing,
        friction_coefficient=mu,
        algorithm="static" if steps == 1 else "incremental",
        coupling=coupling,
        loads=[press(load, steps)],
        every=steps,
    )


# Load steps by mesh and coefficient of friction.
PATHS: dict[tuple[int, float], tuple[int, ...]] = {
    (40, 0.1): (1, 10, 20, 40, 80),
    (40, 0.6): (1, 10, 20, 40, 80),
    (80, 0.1): (1, 10, 20, 40),
    (80, 0.6): (1, 10, 20, 40),
}


def table_9_3(paths: Mapping[tuple[int, float], Sequence[int]] | None = None) -> Comparison:
    """Press dissimilar spheres by static and incremental solutions; discrete, converged, printed values."""
    found = Comparison()
    _without_friction(found)
    for (mesh, mu), all_steps in (paths or PATHS).items():
        load, solved = LOAD[mesh], {}
        for steps in all_steps:
            made = _pressed(mesh, load, mu, steps)
            ratios = solved[steps] = Ratios.of(made[-1], load, mu)
            _against_discrete(found, f"{load:g} N, a/l_e = {mesh}, μ = {mu:g}", mesh, mu, steps, ratios)
            found.add(f"{load:g} N, a/l_e = {mesh}, μ = {mu:g}", f"time, N = {steps}", "s", made.seconds)
        if 1 in solved:
            _against_single_step(found, load, mu, solved[1])
        if len(solved) > 2:
            _against_limit(found, load, mu, solved)
    found.notes += [
        "Sphere of 1 mm: 432 GPa on 72 GPa, both ν = 0.32. Steps: P_k = P (k/N)³; one step is the static "
        "solution.",
        "The limit of many steps is approached like 1/N: ½ of the steps and all of them are extrapolated, "
        "2 f(N) - f(N/2). The lattice adds up to 0.04 l_e to a (see convergence), 0.15 l_e to c.",
        "a is that of p² at the edge for μ = 0.1 and that of the area for μ = 0.6.",
        "μ = 0.6: the slip annulus of the limit, 1e-4 a, is far below any mesh; c/a is judged by the "
        "discrete rows only.",
    ]
    return found


def _without_friction(found: Comparison) -> None:
    from .normal import solve

    for mesh, load in LOAD.items():
        hertz = hertz_of(dissimilar_pair(), load)
        s = solve({**STIFF, "surface": BALL}, ALUMINUM, spacing=hertz.contact_radius / mesh, normal_load=load)
        where, case = f"{load:g} N, a/l_e = {mesh}, μ = 0", f"9.2 P={load:g} N mu=0"
        row = reference(case, "p_max")
        found.add(where, "p_max", "MPa", s.peak, row=row, judge="analytic", relative=1e-4)
        row = reference(case, "a")
        found.add(
            where,
            "a from p² at the edge",
            "um",
            s.edge_radius,
            row=row,
            judge="analytic",
            relative=0.04 / mesh,
        )


def _against_discrete(
    found: Comparison, where: str, mesh: int, mu: float, steps: int, ratios: Ratios
) -> None:
    """Compare with the same lattice and the same steps: unique, so that all printed digits count."""
    case = f"9.2 discrete a/le={mesh} mu={mu:g} steps={steps} (P_k = P (k/N)^3)"
    for quantity, value in (
        ("p_max/p_Hertz", ratios.peak),
        ("c_A/a_A", ratios.stick),
        ("delta/delta_Hertz", ratios.approach),
        ("max|q|/p_Hertz", ratios.traction),
    ):
        row = reference(case, quantity)
        name = quantity.replace("delta/delta", "δ/δ")
        allowed = ratios.two_nodes if quantity == "c_A/a_A" else row.uncertainty
        found.add(where, f"{name}, N = {steps}", "-", value, row=row, absolute=allowed)


def _against_single_step(found: Comparison, load: float, mu: float, ratios: Ratios) -> None:
    where, case = f"{load:g} N, μ = {mu:g}, static", f"9.2 P={load:g} N mu={mu:g} single step"
    for quantity, value in (
        ("p_max/p_Hertz", ratios.peak),
        ("a/a_Hertz", ratios.radius),
        ("delta/delta_Hertz", ratios.approach),
    ):
        row = reference(case, quantity)
        name = quantity.replace("delta/delta", "δ/δ")
        found.add(where, name, "-", value, row=row, absolute=row.uncertainty)
    row = reference(f"9.2 mu={mu:g} single step", "c/a")
    found.add(where, "c/a", "-", ratios.stick, row=row, absolute=row.uncertainty)


def _against_limit(found: Comparison, load: float, mu: float, solved: Mapping[int, Ratios]) -> None:
    """Judge what many load steps tend to."""
    many = max(solved)
    fine, half = solved[many], solved[many // 2]
    hertz = hertz_of(dissimilar_pair(), load)
    where, case = f"{load:g} N, μ = {mu:g}, N -> ∞", f"9.2 P={load:g} N mu={mu:g} incremental limit"
    mesh = next(mesh for mesh, its_load in LOAD.items() if its_load == load)

    def limit(name: str) -> float:
        return 2.0 * float(getattr(fine, name)) - float(getattr(half, name))

    peak, approach = limit("peak"), limit("approach")
    radius = limit("radius") if mu < 0.5 else fine.radius  # an area has steps
    for quantity, unit, value, scale, extra in (
        ("p_max/p_Hertz", "-", peak, 1.0, 2e-4),
        ("p_max", "MPa", peak, hertz.max_pressure, 2e-4),
        ("a/a_Hertz", "-", radius, 1.0, 0.04 / mesh),
        ("a", "um", radius, hertz.contact_radius, 0.04 / mesh),
        ("delta/delta_Hertz", "-", approach, 1.0, 5e-5),
    ):
        row = reference(case, quantity)
        allowed = row.uncertainty + extra * scale
        name = quantity.replace("delta/delta", "δ/δ")
        found.add(where, name, unit, value * scale, row=row, judge="reference", absolute=allowed)
    row = reference(f"9.2 mu={mu:g} incremental limit", "c/a")
    if mu == 0.1:
        found.add(where, "c/a", "-", limit("stick"), row=row, absolute=row.uncertainty + 0.15 / mesh)
    else:
        found.add(where, "c/a", "-", limit("stick"), row=row)


def goodman(meshes: Sequence[int] = (40, 80), steps: int = 40) -> Comparison:
    """Press the spheres of section 9.2 while shear does not move the pressure, against Spence's formula."""
    found = Comparison()
    row = reference("9.2 mu=0.1 incremental limit, p uncoupled from q (Goodman)", "c/a")
    exact = closed.goodman_stick_ratio(dissimilar_pair().beta, 0.1)
    for mesh in meshes:
        load = LOAD[mesh]
        hertz, where = hertz_of(dissimilar_pair(), load), f"sphere, a/l_e = {mesh}, N -> ∞"
        half, fine = (_pressed(mesh, load, 0.1, count, "goodman")[-1] for count in (steps // 2, steps))
        ratio = 2.0 * fine.stick_radius / fine.area_radius - half.stick_radius / half.area_radius
        found.add(where, "c/a", "-", ratio, row=row, analytic=exact, absolute=row.uncertainty + 0.15 / mesh)
        # the pressure is Hertz's
        found.add(
            where, "p_max/p_Hertz", "-", fine.peak / hertz.max_pressure, analytic=1.0, relative=0.1 / mesh**2
        )
    found.notes += [
        'Section 9.2, μ = 0.1, solver.coupling = "goodman". The formula: '
        "(a/2c) ln[(a+c)/(a-c)] = (μ/β) K'(c/a).",
        f"{steps // 2} and {steps} load steps extrapolated to many; the lattice adds up to 0.15 l_e/a to "
        "c/a.",
    ]
    return found


def rigid_plane(step_counts: Sequence[int] = (10, 64)) -> Comparison:
    """Press an elastic sphere with nu = 0 on a rigid plane: beta = 1/2, the strongest coupling."""
    found = Comparison()
    ball = {"young_modulus": 1.0, "poisson_ratio": 0.0, "surface": Sphere(radius=1.0)}
    # a few times the last digit of the reference table; in c/a some nodes
    allowed = {"c/a (area)": 1e-3, "p_max/p_Hertz": 2e-4, "delta/delta_Hertz": 2e-5}
    for steps in step_counts:
        load = 4.0 / 3.0  # a = 1
        made = run(
            ball,
            RIGID,
            spacing=1.0 / 40,
            friction_coefficient=0.2986,
            loads=[press(load, steps)],
            every=steps,
        )
        hertz, last = hertz_of(made.pair, load, 1.0), made[-1]
        where = f"{steps} steps, a/l_e = 40"
        case = f"nu=0 on rigid, mu=0.2986, sphere, {steps} steps, cubic ramp, a/le=40"
        values = {
            "c/a (area)": last.stick_radius / last.area_radius,
            "p_max/p_Hertz": last.peak / hertz.max_pressure,
            "delta/delta_Hertz": last["approach"] / hertz.approach,
        }
        for quantity, value in values.items():
            if steps == 64 or quantity == "c/a (area)":
                row = reference(case, quantity)
                found.add(
                    where,
                    quantity.replace("delta/delta", "δ/δ"),
                    "-",
                    value,
                    row=row,
                    absolute=allowed[quantity],
                )
        found.add(where, "time", "s", made.seconds)
    found.notes.append("ν = 0 against rigid: β = ½. μ = 0.2986, P_k = P (k/N)³.")
    return found
