"""The first step of bodies that never touched: one solution, whatever the window that it is looked for in.

Random pairs, coefficients of friction, gaps and loads (first_steps.py), solved on two windows; the direct
method solves some of them, too. A step that is halved follows another path and ends elsewhere: none may be.
"""

import numpy as np
import pytest
from first_steps import LOAD, Start, difference, faults_of, paraboloid, random_start

from hexcontact.core.contact import ElasticPair
from hexcontact.core.friction import FrictionalContact
from hexcontact.core.lattice import Lattice


@pytest.mark.parametrize("block", range(10))
def test_the_window_is_of_no_matter(block: int) -> None:
    for seed in range(15 * block, 15 * block + 15):
        start, wide = random_start(seed)
        small, large = start.solve(1.5), start.solve(max(wide, 1.5))
        assert small[0].converged and large[0].converged, (seed, small, large)
        assert not small[0].touches_rim, seed
        assert difference(small, large) < 1e-7, seed
        if seed % 3 == 0 and start.nodes < 6:
            direct = start.solve(1.5, "direct")
            assert direct[0].converged, seed
            assert difference(small, direct) < 1e-7, seed


@pytest.mark.parametrize("center", [(0.0, 0.0), (0.3, 0.2)], ids=["on a node", "beside it"])
def test_stick_area_and_energy_of_wide_windows(center: tuple[float, float]) -> None:
    # a material with Poisson's ratio 0.1 on a rigid one; halves of the step would let nearly all of it stick
    beta, gamma = 0.4 / 0.9, 0.1 / 0.9
    force = ["force"] * 4
    start = Start(12, beta, gamma, 1.0, paraboloid(12, 66, center), force, [LOAD, 0.0, 0.0, 0.0])
    expected = start.solve(1.3, "direct")[0]
    stuck = np.count_nonzero(expected.zone == 1)
    assert stuck / np.count_nonzero(expected.zone) == pytest.approx(0.556, abs=0.011)
    for radii in (1.3, 3.0, 4.5):
        state, _ = start.solve(radii, max_cuts=6)
        assert state.converged and state.cuts == 0, radii
        assert np.count_nonzero(state.zone == 1) == stuck, radii
        assert state.dissipated_energy == pytest.approx(expected.dissipated_energy, rel=1e-8), radii


# 12345 is any; the others fail by sweeps, which tell from slip which of one to three nodes stick
@pytest.mark.parametrize("seed", [12345, 51014, 52445, 52706, 57081, 58686, 60596, 61250])
def test_contacts_of_a_few_nodes(seed: int) -> None:
    assert faults_of(seed, few=True) == []


def test_alternating_zones() -> None:
    # weak coupling: without cuts of the classification parameter staggered sweeps alternate between two sets
    assert faults_of(2502) == []


def test_a_sphere_beside_a_node_with_a_free_twist() -> None:
    # rigid, R = 10 mm, on E = 1 GPa with Poisson's ratio 0: beta = -1/2; first of ten steps of a cubic ramp
    spacing, half, pair = 5e-6, 45, ElasticPair(1 / (np.pi * 1e9), -0.5 / (np.pi * 1e9), 0.0)
    states = []
    for method, wide in (("fft", half), ("fft", 6), ("direct", 6)):
        lattice = Lattice(spacing, -wide, -wide, 2 * wide + 1, 2 * wide + 1)
        gap = ((lattice.x - 0.7e-6) ** 2 + (lattice.y - 2.05e-6) ** 2) / (2 * 10e-3)
        contact = FrictionalContact(lattice, pair, gap, friction_coefficient=1.0, method=method, threads=1)
        state = contact.advance(contact.virgin(), ["force"] * 4, [0.13333e-3, 0, 0, 0], max_cuts=0)
        assert state.converged, (method, wide)
        states.append((state, wide))
    for each in states:
        assert difference(each, states[2]) < 1e-7
