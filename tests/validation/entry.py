"""Checks: nodes that come into contact, and how many load steps they need."""

from __future__ import annotations

from collections.abc import Sequence

from hexcontact.analytic import friction as closed
from hexcontact.deck.surfaces import Sphere

from .dissimilar import LOAD
from .reference import Comparison, reference
from .runs import (
    ALUMINUM,
    BALL,
    STIFF,
    Run,
    bodies,
    dissimilar_pair,
    hertz_of,
    press,
    run,
    shear_compliance,
)

KINDS = ("implicit", "interpolated")
LOADED = 4.0 / 3.0  # a_Hertz = 1


def entry(mesh: int = 20, fine_mesh: int = 80, step_counts: Sequence[int] = (5, 10, 20)) -> Comparison:
    """Few load steps against exact solutions, with both values of solver.entry."""
    found = Comparison()
    for kind in KINDS:
        for steps in step_counts:
            _oblique(found, mesh, kind, steps)
    for kind in KINDS:
        for steps in step_counts:
            _no_slip(found, mesh, kind, steps)
    _stick_radius(found, fine_mesh)
    found.notes += [
        "Oblique load: alike spheres, ν = 0.33, μ = 0.3, Q = 0.15 P all the way: no slip, Δ = 3SQ/16a for "
        "ν = 0 (0.1 % for ν = 0.33), and the lattice adds 0.05 %. P_k = P (k/N)³.",
        "μ = 1: hardly anything slips. Spence's δ/δ_Hertz without slip, |β| = 0.19; the lattice adds 1e-4.",
        'entry = "implicit" is not judged: it is of the first order in the load step.',
        "Stick radius: what a load step calls stick does not slip during the step and belongs to its middle, "
        "whatever solver.entry is; so c is divided by the mean of a before and after the step.",
    ]
    return found


def _oblique(found: Comparison, mesh: int, kind: str, steps: int) -> None:
    made = _oblique_run(mesh, kind, steps)
    last = made[-1]
    where = f"oblique load, a/l_e = {mesh}, {kind}"
    exact = 3.0 * shear_compliance(made.pair) * 0.15 * LOADED / 16.0
    shift = abs(last["shift_x"])
    if kind == "interpolated":
        found.add(where, f"Δ, N = {steps}", "-", shift, analytic=exact, relative=2e-3)
        found.add(
            where,
            f"stick area / contact area, N = {steps}",
            "-",
            last.stick_fraction,
            analytic=1.0,
            absolute=0.01,
        )
    else:
        found.add(where, f"Δ, N = {steps}", "-", shift)
        found.add(where, f"stick area / contact area, N = {steps}", "-", last.stick_fraction)


def _oblique_run(mesh: int, kind: str, steps: int) -> Run:
    load = [(k / steps) ** 3 for k in range(1, steps + 1)]
    return run(
        *bodies(0.0, 0.33 / 0.67, Sphere(radius=1.0)),
        spacing=1.0 / mesh,
        friction_coefficient=0.3,
        entry=kind,
        loads=[{"normal_load": LOADED, "tangential_load_x": 0.15 * LOADED, "values": load}],
        every=steps,
    )


def _no_slip(found: Comparison, mesh: int, kind: str, steps: int) -> None:
    kappa, chi = closed.no_slip_constants(0.19)
    made = run(
        *bodies(0.19, 0.3, Sphere(radius=1.0)),
        spacing=1.0 / mesh,
        friction_coefficient=1.0,
        entry=kind,
        loads=[press(LOADED, steps)],
        every=steps,
    )
    value = made[-1]["approach"] / hertz_of(made.pair, LOADED, 1.0).approach
    where, name = f"μ = 1, β = 0.19, a/l_e = {mesh}, {kind}", f"δ/δ_Hertz, N = {steps}"
    if kind == "interpolated":
        exact = chi * (kappa * chi) ** (-2.0 / 3.0)
        found.add(where, name, "-", value, analytic=exact, absolute=2e-4)
    else:
        found.add(where, name, "-", value)


def _stick_radius(found: Comparison, mesh: int) -> None:
    """Ten equal steps of the spheres of section 9.2, against the limit of many."""
    load, steps = LOAD[80], 10
    made = run(
        {**STIFF, "surface": BALL},
        ALUMINUM,
        spacing=hertz_of(dissimilar_pair(), load).contact_radius / mesh,
        friction_coefficient=0.1,
        loads=[press(load, steps, "linear")],
    )
    before, last = made[-2], made[-1]
    where = f"section 9.2, μ = 0.1, ten equal steps, a/l_e = {mesh}"
    found.add(where, "c/a", "-", last.stick_radius / last.area_radius)
    row = reference("9.2 mu=0.1 incremental limit", "c/a")
    middle = 0.5 * (before.area_radius + last.area_radius)
    found.add(
        where, "c/a, a of the middle of the step", "-", last.stick_radius / middle, row=row, relative=3e-3
    )
