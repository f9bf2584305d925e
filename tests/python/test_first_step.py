"""The first step of bodies that never touched: one solution, whatever the window that it is looked for in.

Random pairs, coefficients of friction, gaps and loads, solved on two windows; the direct method solves
some of them, too. A step that is halved follows another path and ends elsewhere, so none may be.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from hexcontact.core.contact import ElasticPair, Method
from hexcontact.core.friction import ContactState, FrictionalContact
from hexcontact.core.lattice import Lattice

Array = NDArray[np.float64]

E_STAR = 70e9
RADIUS = 1e-3
CONTACT_RADIUS = 50e-6
LOAD = 4 * E_STAR * CONTACT_RADIUS**3 / (3 * RADIUS)
APPROACH = CONTACT_RADIUS**2 / RADIUS
FULL_TWIST = 3 * np.pi / 16 * CONTACT_RADIUS  # torque of full slip over mu P, without coupling


@dataclass
class Start:
    """A first step: nodes in the contact radius, materials, gap at the nodes of a large window, loads."""

    nodes: float
    beta: float
    gamma: float
    mu: float
    gap: Array
    control: Sequence[str]
    value: Sequence[float]

    def solve(self, radii: float, method: Method = "fft", max_cuts: int = 0) -> tuple[ContactState, int]:
        """Return the state on a window of some contact radii, and the nodes from its middle to its side."""
        most = self.gap.shape[0] // 2
        half = min(int(np.ceil(radii * self.nodes / np.sqrt(0.75))) + 2, most)
        inner = slice(most - half, most + half + 1)
        lattice = Lattice(CONTACT_RADIUS / self.nodes, -half, -half, 2 * half + 1, 2 * half + 1)
        unit = 1 / (np.pi * E_STAR)
        contact = FrictionalContact(
            lattice,
            ElasticPair(unit, self.beta * unit, self.gamma * unit),
            self.gap[inner, inner],
            friction_coefficient=self.mu,
            method=method,
            threads=1,
        )
        return contact.advance(contact.virgin(), self.control, self.value, max_cuts=max_cuts), half


def paraboloid(nodes: float, half: int, center: Sequence[float] = (0.0, 0.0)) -> Array:
    spacing = CONTACT_RADIUS / nodes
    lattice = Lattice(spacing, -half, -half, 2 * half + 1, 2 * half + 1)
    return ((lattice.x - center[0] * spacing) ** 2 + (lattice.y - center[1] * spacing) ** 2) / (2 * RADIUS)


def random_start(seed: int) -> tuple[Start, float]:
    """A step with strong or weak coupling, and the radii of a wide window."""
    rng = np.random.default_rng(seed)
    nodes, beta = float(rng.choice([4, 5, 6])), rng.uniform(-0.72, 0.72)
    stiff = (1 - 2 * abs(beta)) / (2 - 2 * abs(beta))  # Poisson's ratio of the one body if the other is rigid
    least = stiff / (1 - stiff)
    gamma = least if rng.random() < 0.6 else rng.uniform(min(0.0, least), 0.5)
    mu = float(np.exp(rng.uniform(np.log(0.02), np.log(3.0))))
    gap = paraboloid(nodes, 60, rng.uniform(-0.5, 0.5, 2).tolist())
    kind = rng.choice(["smooth", "rough", "terraced"], p=[0.5, 0.25, 0.25])
    if kind == "rough":
        gap = gap + rng.uniform(0.005, 0.1) * APPROACH * rng.random(gap.shape)
    if kind == "terraced":
        height = APPROACH / rng.uniform(2, 8)
        gap = np.round(gap / height) * height
    free = rng.random() < 0.6
    size = float(np.exp(rng.uniform(np.log(0.02), 0.0))) if rng.random() < 0.3 else 1.0
    angle, shear, torque = rng.uniform(0, 2 * np.pi), 0.0, 0.0
    if rng.random() < 0.4:
        shear = rng.uniform(0, 0.5) * mu * size * LOAD
    if free and rng.random() < 0.4:
        torque = rng.uniform(-0.3, 0.3) * mu * size ** (4 / 3) * LOAD * FULL_TWIST
    twist = "force" if free else "displacement"
    loads = [shear * np.cos(angle), shear * np.sin(angle), torque]
    control, value = ["force", "force", "force", twist], [size * LOAD, *loads]
    if rng.random() < 0.2:
        control[0], value = (
            "displacement",
            [0.9 * size ** (2 / 3) * APPROACH, *(0.6 * load for load in loads)],
        )
    return Start(nodes, beta, gamma, mu, gap, control, value), float(
        np.exp(rng.uniform(np.log(1.6), np.log(8.0)))
    )


def tractions(state: ContactState, half: int, wanted: int) -> Array:
    """Return tractions over the largest pressure on the nodes of a smaller window; nothing acts on others."""
    fields = np.stack([state.pressure, state.traction_x, state.traction_y]) / state.pressure.max()
    inner = slice(half - wanted, half + wanted + 1)
    part = fields[:, inner, inner]
    assert np.abs(part).sum() == pytest.approx(np.abs(fields).sum(), rel=1e-12)
    return part


@pytest.mark.parametrize("block", range(10))
def test_the_window_is_of_no_matter(block: int) -> None:
    for seed in range(30 * block, 30 * block + 30):
        start, wide = random_start(seed)
        small, half = start.solve(1.5)
        large, more = start.solve(max(wide, 1.5))
        assert small.converged and large.converged, (seed, small, large)
        assert not small.touches_rim, seed
        expected = tractions(small, half, half)
        assert np.abs(tractions(large, more, half) - expected).max() < 1e-7, seed
        if seed % 3 == 0 and start.nodes < 6:
            direct = start.solve(1.5, "direct")[0]
            assert direct.converged, seed
            assert np.abs(tractions(direct, half, half) - expected).max() < 1e-7, seed


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


def test_a_sphere_beside_a_node_with_a_free_twist() -> None:
    # rigid, R = 10 mm, on E = 1 GPa with Poisson's ratio 0: beta = -1/2; first of ten steps of a cubic ramp
    spacing, half, pair = 5e-6, 45, ElasticPair(1 / (np.pi * 1e9), -0.5 / (np.pi * 1e9), 0.0)
    states = []
    for method, wide in (("fft", half), ("fft", 6), ("direct", 6)):
        lattice = Lattice(spacing, -wide, -wide, 2 * wide + 1, 2 * wide + 1)
        gap = ((lattice.x - 0.7e-6) ** 2 + (lattice.y - 2.05e-6) ** 2) / (2 * 10e-3)
        contact = FrictionalContact(lattice, pair, gap, friction_coefficient=1.0, method=method, threads=1)
        states.append(contact.advance(contact.virgin(), ["force"] * 4, [0.13333e-3, 0, 0, 0], max_cuts=0))
        assert states[-1].converged, (method, wide)
    for state, wide in zip(states, (half, 6, 6), strict=True):
        assert np.abs(tractions(state, wide, 6) - tractions(states[2], 6, 6)).max() < 1e-7
