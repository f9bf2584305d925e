"""Checks: dissimilar spheres pressed, then sheared (section 13.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hexcontact.analytic.friction import MindlinContact
from hexcontact.deck.surfaces import Sphere

from .reference import Comparison, reference
from .runs import (
    ALUMINUM,
    BALL,
    DIGITS,
    STIFF,
    Run,
    State,
    bodies,
    dissimilar_pair,
    hertz_of,
    press,
    run,
    shear_compliance,
)

LOAD, FRICTION = 31.5, 0.1
STEPS = (10, 11, 12, 15, 20, 25, 30, 35, 40)  # of the history: 10 to press, 30 of 0.1 N to shear
HERTZ_RADIUS = 70.0416e-6  # the reference table divides by this


def _history(mesh: int, coupling: str = "full", refined: bool = False) -> Run:
    """Press in ten steps and shear by 3 N in thirty, or the finer path up to step 35 of it."""
    loads = [{"normal_load": LOAD, "steps": 10}, {"tangential_load_x": 3.0, "steps": 30}]
    if refined:
        loads = [press(LOAD, 60), {"tangential_load_x": 2.5, "steps": 125}]
    return run(
        {**STIFF, "surface": BALL},
        ALUMINUM,
        spacing=hertz_of(dissimilar_pair(), LOAD).contact_radius / mesh,
        friction_coefficient=FRICTION,
        coupling=coupling,
        loads=loads,
        every=5 if refined else 1,
    )


def _name(step: int) -> str:
    return f"13.2 step {step} Q/muP={0.1 * (step - 10) / (FRICTION * LOAD):.4f}"


def _mindlin() -> MindlinContact:
    pair = dissimilar_pair()
    return MindlinContact(FRICTION, LOAD, hertz_of(pair, LOAD).contact_radius, shear_compliance(pair))


def _stick_row(state: State) -> tuple[float, float]:
    """Extent (m) of the stick zone in the row y = 0."""
    x = state.x[state.stick & (np.abs(state.y) < 1e-6 * state.spacing)]
    return (float(x.min()), float(x.max())) if x.size else (float("nan"), float("nan"))


def _quantities(state: State) -> Iterator[tuple[str, str, float]]:
    """Yield name in the reference table, unit, value."""
    yield "p_max", "MPa", state.peak
    yield "a_fit", "um", state.edge_radius
    yield "delta", "um", state["approach"]
    yield "stick area fraction", "-", state["stick_area"] / state["contact_area"]
    lowest, highest = _stick_row(state)
    yield "stick x_min/a_H", "-", lowest / HERTZ_RADIUS
    yield "stick x_max/a_H", "-", highest / HERTZ_RADIUS
    yield "stick |y|_max/a_H", "-", float(np.abs(state.y[state.stick]).max()) / HERTZ_RADIUS
    yield "stick centroid x/a_H", "-", state["stick_center_x"] / HERTZ_RADIUS
    yield "Delta_x", "um", state["shift_x"]
    yield "pressure centroid x/a_H", "-", state["pressure_center_x"] / HERTZ_RADIUS


SHOWN = {
    "a_fit": "a from p² at the edge",
    "delta": "δ",
    "stick area fraction": "stick area/contact area",
    "stick x_min/a_H": "stick x_min/a_H at y = 0",
    "stick x_max/a_H": "stick x_max/a_H at y = 0",
    "Delta_x": "Δ_x",
}


def fretting(meshes: Sequence[int] = (20, 80)) -> Comparison:
    """Follow the 40 steps of section 13.2.2; a coarse mesh is judged by what it can resolve."""
    found = Comparison()
    for mesh in meshes:
        made = _history(mesh)
        for step in STEPS:
            _against_table(found, made[step], mesh, step)
        found.add(f"a/l_e = {mesh}", "time, 40 steps", "s", made.seconds)
        count = made.result.dataset["operator_applications"].values
        found.add(f"a/l_e = {mesh}", "operator applications a step, mean", "-", float(count.mean()))
        found.add(f"a/l_e = {mesh}", "operator applications a step, most", "-", float(count.max()))
    found.notes += [
        "Sphere of 1 mm, 432 GPa on 72 GPa, both ν = 0.32, μ = 0.1: 10 equal steps to 31.5 N, then 30 steps "
        "of 0.1 N along x. Q > 0 acts on the sphere, body 1. a_H = 70.0416 µm. The published values of step "
        "10 are those of Table 13.5 (21 x 21 nodes).",
        "Δ/Δ_Mindlin: Mindlin's solution with Hertz's radius, β = 0.",
        "a/l_e = 20: the largest pressure scatters with the rings of nodes that enter during a step; areas "
        "and extents count whole nodes.",
    ]
    return found


# What depends on no single node: at a/l_e = 80 all printed digits count.
EXACT = ("p_max", "a_fit", "delta", "Delta_x")
# What a/l_e = 20 can hold: in p_max a ring of nodes that enters late, in the stick area a ring of nodes.
COARSE = {"p_max": 5e6, "delta": 1e-9, "stick area fraction": 0.01, "Delta_x": 2e-10}


def _against_table(found: Comparison, state: State, mesh: int, step: int) -> None:
    where = f"a/l_e = {mesh}, step {step}"
    for name, unit, value in _quantities(state):
        if name == "Delta_x" and step == 10:
            continue  # no shift yet
        if mesh < 80 and name not in COARSE:
            continue
        row = reference(_name(step), name)
        if mesh < 80:
            bound = COARSE[name] + row.uncertainty
        else:
            bound = DIGITS * abs(row.reference) if name in EXACT else row.uncertainty
        found.add(where, SHOWN.get(name, name), unit, value, row=row, absolute=bound)
    if 10 < step < 40 and mesh >= 80:
        row = reference(_name(step), "Delta/Delta_Mindlin")
        value = state["shift_x"] / float(_mindlin().shift(state["tangential_load_x"]))
        found.add(where, "Δ/Δ_Mindlin", "-", value, row=row, relative=DIGITS)


def refined_path() -> Comparison:
    """Take the same loads in finer steps: what the continuous path tends to."""
    found = Comparison()
    made = _history(40, refined=True)
    for step in STEPS[:-1]:
        state = made[60 + 5 * (step - 10)]
        case = f"13.2 refined path (60 normal steps, dQ=0.02 N), a/le=40, at Q of step {step}"
        values = {name: (unit, value) for name, unit, value in _quantities(state)}
        for name in ("p_max", "stick area fraction", "stick centroid x/a_H", "Delta_x", "delta"):
            if name == "Delta_x" and step == 10:
                continue
            unit, value = values[name]
            row = reference(case, name)
            where = f"Q of step {step}"
            bound = DIGITS * abs(row.reference) if name in EXACT else row.uncertainty
            found.add(where, SHOWN.get(name, name), unit, value, row=row, absolute=bound)
    found.add("a/l_e = 40", f"time, {len(made)} steps", "s", made.seconds)
    found.notes.append("a/l_e = 40; P_k = P (k/60)³, then steps of 0.02 N.")
    return found


def stick_outlines(mesh: int = 40, steps: Sequence[int] = (10, 11, 15, 20, 30, 35)) -> Comparison:
    """Stick zones of the fully coupled and of Goodman's problem side by side (Figure 13.5)."""
    found = Comparison()
    full, goodman = _history(mesh), _history(mesh, "goodman")
    hertz = hertz_of(dissimilar_pair(), LOAD)
    for step in steps:
        for name, made in (("coupled", full), ("goodman", goodman)):
            values = {key: value for key, _, value in _quantities(made[step])}
            where = f"{name}, step {step}"
            for key in (
                "stick area fraction",
                "stick x_min/a_H",
                "stick x_max/a_H",
                "stick |y|_max/a_H",
            ):
                if name == "goodman":
                    found.add(where, SHOWN.get(key, key), "-", values[key])
                else:
                    row = reference(_name(step), key)
                    allowed = row.uncertainty + (0.006 if "area" in key else 1.0 / mesh)
                    found.add(where, SHOWN.get(key, key), "-", values[key], row=row, absolute=allowed)
        state = goodman[step]
        where = f"goodman, step {step}"
        value = state.peak / hertz.max_pressure
        found.add(where, "p_max/p_Hertz", "-", value, analytic=1.0, relative=1e-4)
        found.add(where, "δ/δ_Hertz", "-", state["approach"] / hertz.approach, analytic=1.0, relative=1e-4)
    found.notes.append(
        f"a/l_e = {mesh}. goodman: shear does not move the pressure, which stays Hertz's; reported beside "
        "the coupled solution, which is judged by the values of a/l_e = 80, within a spacing."
    )
    return found


def compliance(
    ratios: Sequence[float] = (0.0, 0.25, 0.5, 1.0, 1.8908, 3.0), mesh: int = 40, steps: int = 10
) -> Comparison:
    """Compliance of the first small shear after pressing, against beta (Figure 13.4, Munisamy)."""
    found = Comparison()
    for ratio in ratios:
        for coupling in ("full", "goodman"):
            where = f"|β|/μ = {ratio:g}, {coupling}"
            value = _first_compliance(ratio, FRICTION, mesh, steps, coupling)
            if ratio == 0.0:
                found.add(where, "Δ/Δ_Mindlin", "-", value, analytic=1.0, absolute=0.4 / mesh**2)
                continue
            found.add(where, "Δ/Δ_Mindlin", "-", value)
            if coupling == "full":
                other = _first_compliance(-ratio, FRICTION, mesh, steps, coupling)
                found.add(where, "with -β, over this", "-", other / value, analytic=1.0, absolute=DIGITS)
            else:
                other = _first_compliance(ratio, 1.2 * FRICTION, mesh, steps, coupling)
                found.add(where, "with 1.2 μ, over this", "-", other / value, analytic=1.0, absolute=DIGITS)
    found.notes.append(
        f"γ = 0.25 (ν = 0.2 for both bodies), μ = {FRICTION:g}: pressed in {steps} steps, then Q = 0.02 μP "
        f"in one step; a/l_e = {mesh}. To reverse β is to look from the other side: the compliance is the "
        "same. With goodman it depends on β/μ only."
    )
    return found


def _first_compliance(ratio: float, mu: float, mesh: int, steps: int, coupling: str) -> float:
    """Return the shift of the first small tangential load, over Mindlin's; beta = ratio mu, E* = 1, a = 1."""
    load, shear = 4.0 / 3.0, 0.02 * mu * 4.0 / 3.0
    made = run(
        *bodies(ratio * mu, 0.25, Sphere(radius=1.0)),
        spacing=1.0 / mesh,
        friction_coefficient=mu,
        coupling=coupling,
        loads=[press(load, steps), {"tangential_load_x": shear}],
        every=steps + 1,
    )
    exact = MindlinContact(mu, load, 1.0, shear_compliance(made.pair))
    return made[-1]["shift_x"] / float(exact.shift(shear))
