"""Work of the solvers, counted in operator applications, and of the driver, in calls.

The bounds are three tenths above what was measured, since rounding differs between processors;
`python tests/bench/run.py --write-bounds` measures again.
"""

import cProfile
import pstats
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from bench import counts, problems

from hexcontact import Case
from hexcontact.core import flat, memory
from hexcontact.core.friction import MOTION
from hexcontact.surfaces import Sphere

BOUNDS = counts.bounds()


def test_every_problem_has_bounds_on_its_meshes() -> None:
    wanted = {name: {str(mesh) for mesh in meshes} for name, meshes in counts.BOUNDED.items()}
    assert {name: set(row) for name, row in BOUNDS.items()} == wanted


@pytest.mark.parametrize(
    ("name", "mesh", "bound"),
    [(name, int(mesh), bound) for name, row in BOUNDS.items() for mesh, bound in row.items()],
)
def test_work_stays_below_its_bound(name: str, mesh: int, bound: float) -> None:
    assert problems.count(name, mesh) <= bound


@pytest.mark.parametrize("name", ["HC", "DS", "N30"])
def test_loose_tolerance_records_the_displacements_of_its_tractions(name: str) -> None:
    """Compare with a product: 0.05 of the tolerance (`cut_share`) may be cut off; a node moves l_e p/E*."""
    problem, lattice, tolerance = problems.FRICTIONAL[name], problems.window(20), 1e-4
    contact = problems.frictional_contact(problem.material, lattice)
    state = contact.virgin()
    for press, shear in problem.steps:
        load = press * problems.LOAD
        target = (load, shear * problem.material.friction * load, 0.0, 0.0)
        state = contact.advance(state, problems.FORCE, target, tolerance=tolerance)
    motion = [getattr(state, name) for name in MOTION]
    tractions = state.pressure, state.traction_x, state.traction_y
    moved = flat.relative_displacement(contact, tractions, motion)
    moved[0] += problems.parabola(lattice)
    recorded = state.gap, state.relative_displacement_x, state.relative_displacement_y
    node = 1.5 * lattice.spacing * state.pressure.max()
    assert np.abs(moved - recorded).max() < 0.05 * tolerance * node


def small(steps: int = 1) -> Case:
    """Return a sphere pressed in one load step, then sheared in some."""
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    return Case(
        body_1={**steel, "surface": Sphere(radius=10e-3)},
        body_2=steel,
        nodes_across=11,
        friction_coefficient=0.3,
        loads=[{"normal_load": 100.0}, {"tangential_load_x": "0.5 mu P", "steps": steps}],
    )


def calls(run: Callable[[], Any]) -> int:
    """Return how many calls of functions something makes."""
    with cProfile.Profile() as profile:
        run()
    return int(pstats.Stats(profile).total_calls)


def test_a_load_step_costs_few_calls() -> None:
    """Measured: 870 calls a step beside the core, 9,500 a run; a step that asks the whole table has 1,250."""
    short, long = small(1), small(21)
    short.run()
    assert calls(long.run) - calls(short.run) <= 20 * 1000


def test_a_step_of_a_session_costs_as_much_late_as_early() -> None:
    """The deck of the loads so far is made when a result is wanted, not in every step."""
    session = small().start()
    next(session)
    found = [calls(lambda q=q: session.advance(tangential_load_x=q)) for q in 20 * (5.0, -5.0, 3.0)]
    assert max(found[-6:]) <= 1.02 * max(found[6:12])
    deck = session.result().dataset.attrs["deck"]
    assert deck.count("tangential_load_x") == len(found)


def test_a_window_asks_once_for_the_memory_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    there = memory.available
    monkeypatch.setattr(memory, "available", lambda: asked.append(1) or there())
    small().run()
    assert len(asked) == 1
