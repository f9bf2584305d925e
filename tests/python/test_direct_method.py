"""The direct method with friction: its start from a coarse lattice, and the iteration of the dissertation."""

from typing import Any

import numpy as np
import pytest
from bench import problems
from bench.lapack import window
from bench.problems import FORCE, LOAD, Material

from hexcontact import Case, ConvergenceError, DeckError
from hexcontact.core.contact import Iteration, Method
from hexcontact.core.friction import ContactState, FrictionalContact
from hexcontact.surfaces import Sphere

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
SHEARED = [{"normal_load": 100.0}, {"tangential_load_x": "0.5 mu P"}]


def contact(
    material: Material, side: int, iteration: Iteration = "newton", method: Method = "direct"
) -> FrictionalContact:
    """Return a sphere on a window of which half is in contact."""
    lattice = window(side, 18.7 / 51 * side)
    gap, mu = problems.parabola(lattice), material.friction
    how: dict[str, Any] = {"method": method, "iteration": iteration}
    return FrictionalContact(lattice, material.pair, gap, friction_coefficient=mu, **how)


def pressed_and_sheared(solver: FrictionalContact, mu: float) -> list[ContactState]:
    """Return the states after pressing and after shearing by half of what friction carries."""
    states = [solver.virgin()]
    for share in (0.0, 0.5):
        target = (LOAD, share * mu * LOAD, 0.0, 0.0)
        states.append(solver.advance(states[-1], FORCE, target, max_cuts=0))
    return states[1:]


@pytest.mark.parametrize("material", [problems.ALIKE, problems.DISSIMILAR])
def test_a_start_from_the_coarse_lattice_saves_solutions(material: Material) -> None:
    """41 x 41 nodes, 816 in contact: up to 5 linear solutions; 5 to 12 without the start."""
    direct = pressed_and_sheared(contact(material, 41), material.friction)
    fft = pressed_and_sheared(contact(material, 41, method="fft"), material.friction)
    for one, other in zip(direct, fft, strict=True):
        assert one.converged
        assert one.sweeps <= 8
        for name in ("pressure", "traction_x", "traction_y"):
            apart = np.abs(getattr(one, name) - getattr(other, name)).max()
            assert apart < 1e-7 * other.pressure.max(), name  # 10 tolerances


def test_the_iteration_of_the_dissertation_is_right_where_slip_is_parallel() -> None:
    """Alike bodies with Poisson's ratio 0 and a load along x: the last direction is the right one."""
    material = Material(0.0, 0.0, 0.5)
    names = ("newton", "dissertation")
    ours, theirs = (pressed_and_sheared(contact(material, 21, name), 0.5) for name in names)
    assert [state.converged for state in theirs] == [True, True]
    apart = np.abs(ours[-1].traction_x - theirs[-1].traction_x).max()
    assert apart < 1e-7 * 0.5 * ours[-1].pressure.max()  # 10 tolerances


def test_the_iteration_of_the_dissertation_says_that_it_stands_elsewhere() -> None:
    """With another Poisson's ratio directions stay those of the first slip: R_t is some percent."""
    material = problems.ALIKE
    pressed, sheared = pressed_and_sheared(contact(material, 21, "dissertation"), material.friction)
    assert pressed.converged
    assert not sheared.converged
    assert sheared.residual_normal < 1e-12
    assert 1e-3 < sheared.residual_tangential < 0.2
    # nodes that have left the area of a first step do not return
    alone = contact(problems.DISSIMILAR, 31, "dissertation")
    pressed = alone.advance(alone.virgin(), FORCE, (LOAD, 0.0, 0.0, 0.0), max_cuts=0)
    assert not pressed.converged
    assert 1e-3 < pressed.residual_normal < 0.5


def test_a_deck_names_the_iteration() -> None:
    bodies: dict[str, Any] = {
        "body_1": {**STEEL, "surface": Sphere(radius=10e-3)},
        "body_2": STEEL,
        "nodes_in_radius": 5,
    }
    case = Case(**bodies, friction_coefficient=0.3, loads=SHEARED, method="direct", iteration="dissertation")
    with pytest.raises(ConvergenceError, match=r'to try: solver.iteration = "newton"'):
        case.run()
    assert case.changed({"solver.tolerance": 0.1}).run().dataset.attrs["iteration"] == "dissertation"
    with pytest.raises(DeckError, match=r'solver.method = "auto": expected "direct", since solver.iteration'):
        case.changed({"solver.method": "auto"})
    with pytest.raises(DeckError, match=r"solver.iteration.*expected \"newton\" without friction"):
        Case(**bodies, normal_load=100.0, method="direct", iteration="dissertation")
    with pytest.raises(DeckError, match='needs method = "direct", not "fft"'):
        contact(problems.ALIKE, 7, "dissertation", "fft")
