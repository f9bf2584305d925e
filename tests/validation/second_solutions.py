"""Search for second solutions of a load step with much friction between unlike bodies.

python tests/validation/second_solutions.py [STARTS [SPACINGS]]    a table (a minute)

By default 40 starts, four spacings in the contact radius.

One load applied at once to undeformed bodies, from many random starts (tractions anywhere in the cone, on
random nodes, any rigid motions), by both methods. Solutions that differ by more than 1e-5 of the largest
pressure count as different; only those whose residuals are below 1e-9 count at all.
"""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hexcontact.core.contact import ElasticPair
from hexcontact.core.friction import ContactState, FrictionalContact
from hexcontact.core.lattice import Lattice

Array = NDArray[np.float64]

REACH = 1.75  # of the window, over the contact radius of a sphere with E* = R = 1, P = 4/3, a = 1
LOAD = 4 / 3
APART, TOLERANCE = 1e-5, 1e-9
METHODS: tuple[Literal["fft", "direct"], ...] = ("fft", "direct")


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes
    ----------
    solutions : list of ContactState
        The different solutions.
    converged, starts : int
        Starts that led to one, and all of them.
    sweeps : set of int
        How many sweeps it took.
    """

    solutions: list[ContactState]
    converged: int
    starts: int
    sweeps: set[int]


def search(
    beta: float, friction: float, share: float, starts: int = 40, surface: str = "sphere", spacings: int = 4
) -> Found:
    """Solve one load from many starts.

    Parameters
    ----------
    beta, friction, share : float
        Dundurs' constant, coefficient of friction, Q/mu P.
    starts : int
        Random starts by each method.
    surface : str
        "sphere", or "bumps" for a rough one.
    spacings : int
        Lattice spacings in the radius.
    """
    random = np.random.default_rng(7)
    spacing, half = 1 / spacings, round(REACH * spacings)
    lattice = Lattice(spacing, -half, -half, 2 * half + 1, 2 * half + 1)
    lambda_1 = 1 / np.pi
    pair = ElasticPair(lambda_1, beta * lambda_1, max(0.0, min(0.4, 1 - 2 * abs(beta))) * lambda_1)
    gap = (lattice.x**2 + lattice.y**2) / 2
    if surface == "bumps":
        gap = gap + 0.2 * random.random(gap.shape)
    inside = np.hypot(lattice.x, lattice.y) < (half - 0.5) * spacing * np.sqrt(0.75)
    target = [LOAD, share * min(friction, 1.0) * LOAD, 0.0, 0.0]
    control = ["force", "force", "force", "displacement"]
    solutions: list[ContactState] = []
    converged, sweeps = 0, set()
    for method in METHODS:
        contact = FrictionalContact(
            lattice, pair, gap, inside, friction_coefficient=friction, method=method, rim_warning=False
        )
        for _ in range(starts):
            start = _start(contact.virgin(), inside, friction, random)
            state = contact.advance(start, control, target, static=True, tolerance=TOLERANCE, max_cuts=0)
            if not state.converged:
                continue
            converged += 1
            sweeps.add(state.sweeps)
            if all(difference(state, known) > APART for known in solutions):
                solutions.append(state)
    return Found(solutions, converged, starts * len(METHODS), sweeps)


def _start(
    virgin: ContactState, inside: NDArray[np.bool_], friction: float, random: np.random.Generator
) -> ContactState:
    """Return a state with random tractions in the cone at random nodes, and random motions."""
    shape = inside.shape
    touching = inside & (random.random(shape) < random.uniform(0.1, 1.0))
    pressure = np.where(touching, random.random(shape), 0.0)
    size = friction * pressure * np.where(random.random(shape) < random.random(), 1.0, random.random(shape))
    angle = random.uniform(0, 2 * np.pi) + random.choice([0.1, 1.0, 6.3]) * random.random(shape)
    stick = size < friction * pressure
    return dataclasses.replace(
        virgin,
        pressure=pressure,
        traction_x=size * np.cos(angle),
        traction_y=size * np.sin(angle),
        gap=np.where(touching, 0.0, virgin.gap),
        zone=np.where(touching, np.where(stick, 1, 2), 0).astype(np.int8),
        approach=float(random.uniform(0.2, 2.0)),
        shift_x=float(random.normal()),
        shift_y=float(random.normal()),
        normal_load=LOAD,
    )


def difference(one: ContactState, other: ContactState) -> float:
    """Return the largest difference of pressure and tractions, over the largest pressure."""
    return max(
        float(np.abs(getattr(one, name) - getattr(other, name)).max()) / float(one.pressure.max())
        for name in ("pressure", "traction_x", "traction_y")
    )


def main(starts: int = 40, spacings: int = 4) -> None:
    """Print what is found over friction, mismatch, load and surface."""
    print("surface  beta   mu   mu|beta|  Q/muP  converged  solutions")
    for surface in ("sphere", "bumps"):
        for beta in (0.19, 0.3, 0.5):
            for friction in (0.3, 1.0, 3.0, 10.0):
                for share in (0.0, 0.5):
                    found = search(beta, friction, share, starts, surface, spacings)
                    print(
                        f"{surface:7s} {beta:5g} {friction:5g} {beta * friction:8.3g} {share:6g} "
                        f"{found.converged:5d}/{found.starts} {len(found.solutions):9d}",
                        flush=True,
                    )


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))
    main(*map(int, sys.argv[1:]))
