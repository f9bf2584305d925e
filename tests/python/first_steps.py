"""Random first steps of bodies that never touched, and a scan over many of them.

python tests/python/first_steps.py                          300 steps (a minute)
python tests/python/first_steps.py --count 10000 --from 5   these, from the fifth on

Each step is solved without halving by FFTs on two windows, and by the direct method where FFTs find nothing
or the seed is a multiple of 10. Printed are the seeds of steps that FFTs do not solve although the direct
method does, and of those whose tractions depend on window or method; exit code 1 if there are any.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
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


def random_start(
    seed: int, half: int = 60, windows: tuple[float, float] = (1.6, 8.0), few: bool = False
) -> tuple[Start, float]:
    """A step with strong or weak coupling, and the radii of another window, drawn between two.

    With `few`, coupling and friction are strong, and only some nodes come into contact.
    """
    rng = np.random.default_rng(seed)
    nodes = float(rng.choice([1.3, 1.7, 2, 2.5, 3, 4] if few else [4, 5, 6]))
    beta = rng.choice([-1, 1]) * rng.uniform(0.35, 0.72) if few else rng.uniform(-0.72, 0.72)
    stiff = (1 - 2 * abs(beta)) / (2 - 2 * abs(beta))  # Poisson's ratio of the one body if the other is rigid
    least = stiff / (1 - stiff)
    gamma = least if rng.random() < 0.6 else rng.uniform(min(0.0, least), 0.5)
    mu = float(np.exp(rng.uniform(np.log(0.2 if few else 0.02), np.log(3.0))))
    gap = paraboloid(nodes, half, rng.uniform(-0.5, 0.5, 2).tolist())
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
    radii = float(np.exp(rng.uniform(*np.log(windows))))
    return Start(nodes, beta, gamma, mu, gap, control, value), radii


def difference(one: tuple[ContactState, int], other: tuple[ContactState, int]) -> float:
    """Return the largest difference of tractions on two windows over the largest pressure."""
    half = max(one[1], other[1])
    fields = []
    for state, side in (one, other):
        field = np.stack([state.pressure, state.traction_x, state.traction_y]) / state.pressure.max()
        rim = half - side  # nothing acts outside
        fields.append(np.pad(field, ((0, 0), (rim, rim), (rim, rim))))
    return float(np.abs(fields[0] - fields[1]).max())


SAME = 1e-7  # difference of tractions, over the largest pressure, of one solution


def faults_of(seed: int, few: bool = False) -> list[str]:
    """Return the faults of a step, solved on two windows and, where that tells something, directly."""
    start, radii = random_start(seed, 72, (1.2, 10.0), few)
    windows = [1.5, radii]
    found = [start.solve(width) for width in windows]
    solved = [each for each in found if each[0].converged and not each[0].touches_rim]
    failed = [width for width, (state, _) in zip(windows, found, strict=True) if not state.converged]
    if failed or seed % 10 == 0:
        direct = start.solve(1.5, "direct")
        if direct[0].converged and not direct[0].touches_rim:
            solved.append(direct)
        else:
            failed = []
    faults = [f"not solved on {width:.2f} radii, but by the direct method" for width in failed]
    apart = max((difference(*pair) for pair in itertools.combinations(solved, 2)), default=0.0)
    if apart > SAME:
        faults.append(f"tractions differ by {apart:.1e}")
    nodes = int((found[0][0].zone > 0).sum())
    about = f"beta {start.beta:.2f}, mu {start.mu:.2f}, {nodes} nodes in contact"
    return [f"seed {seed}: {fault} ({about})" for fault in faults]


def main() -> int:
    """Scan; exit code 1 if a step is at fault."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=300, help="how many steps (default: 300)")
    parser.add_argument("--from", dest="first", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--few", action="store_true", help="few nodes in contact, strong coupling")
    words = parser.parse_args()
    at_fault = 0
    for seed in range(words.first, words.first + words.count):
        for fault in (faults := faults_of(seed, words.few)):
            print(fault, flush=True)
        at_fault += bool(faults)
    print(f"{at_fault} of {words.count} first steps are at fault")
    return int(at_fault > 0)


if __name__ == "__main__":
    sys.exit(main())
