"""The problems whose work is counted, for the benchmarks and for the test of the counts.

All are parabolic contacts with effective modulus 1, relative radius 1 and contact radius 1 (without
friction), on a window of 2.7 contact radii, half of which is in contact. Work is counted in
applications of the full operator, six transforms each, everything included: preconditioner, coarse
lattices, checks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hexcontact.core.contact import ElasticPair, Method, NormalContact
from hexcontact.core.friction import ContactState, FrictionalContact
from hexcontact.core.lattice import Lattice

TOLERANCE = 1e-8
LOAD = 4 / 3
"""Normal load at contact radius 1."""

FORCE = ("force", "force", "force", "displacement")


@dataclass(frozen=True)
class Material:
    """Dundurs' constant, additional tangential compliance, coefficient of friction."""

    beta: float
    gamma: float
    friction: float

    @property
    def pair(self) -> ElasticPair:
        """Compliances for effective modulus 1."""
        return ElasticPair(1 / np.pi, self.beta / np.pi, self.gamma / np.pi)


ALIKE = Material(0.0, 0.49, 0.5)
DISSIMILAR = Material(-0.189, 0.47, 0.1)


@dataclass(frozen=True)
class Problem:
    """Load steps, and which of them are counted.

    Attributes
    ----------
    steps
        Normal load as a share of `LOAD` and tangential load as a share of mu P, of each step.
    counted
        The last so many steps are counted, the earlier ones lead there.
    goal
        Operator applications a step that are aimed at, on any mesh.
    tolerance
        Of all residuals.
    """

    title: str
    material: Material
    steps: tuple[tuple[float, float], ...]
    counted: int
    goal: float
    tolerance: float = TOLERANCE


def _path() -> tuple[tuple[float, float], ...]:
    """Five steps of normal load, eight of shear, six back."""
    press = [(k / 5, 0.0) for k in range(1, 6)]
    shear = [(1.0, k / 10) for k in (*range(1, 9), *range(7, 1, -1))]
    return (*press, *shear)


def _history() -> tuple[tuple[float, float], ...]:
    """Section 13.2.2: ten steps of normal load, thirty of shear up to 0.9524 mu P."""
    return (*((k / 10, 0.0) for k in range(1, 11)), *((1.0, 0.9524 * k / 30) for k in range(1, 31)))


FRICTIONAL = {
    "HC": Problem("Hertz, then Q = 0.5 µP at once", ALIKE, ((1, 0), (1, 0.5)), 1, 35),
    "WARM": Problem("Q from 0.45 to 0.50 µP", ALIKE, ((1, 0), (1, 0.45), (1, 0.5)), 1, 35),
    "REV": Problem("Q from 0.6 back to 0.4 µP", ALIKE, ((1, 0), (1, 0.6), (1, 0.4)), 1, 35),
    "PATH": Problem("path of 19 steps, β = 0, µ = 0.5, mean", ALIKE, _path(), 19, 35),
    "DS": Problem(
        "β = −0.19, µ = 0.1, Q from 0.30 to 0.35 µP", DISSIMILAR, ((1, 0), (1, 0.3), (1, 0.35)), 1, 60
    ),
    "N19": Problem("normal load at once, β = −0.19, µ = 0.1", DISSIMILAR, ((1, 0),), 1, 60),
    "PATH19": Problem("path of 19 steps, β = −0.19, µ = 0.1, mean", DISSIMILAR, _path(), 19, 60),
    "HIST": Problem("history of section 13.2.2, 40 steps, mean", DISSIMILAR, _history(), 40, 60),
    "N30": Problem("normal load at once, β = 0.3, µ = 0.6", Material(0.3, 0.4, 0.6), ((1, 0),), 1, 75),
    "N50": Problem("normal load at once, β = 0.5, µ = 0.6", Material(0.5, 0.0, 0.6), ((1, 0),), 1, 75),
}


def _loop() -> tuple[tuple[float, float], ...]:
    """One step of normal load, and 24 of shear to 0.6 mu P, to -0.6 mu P, and back to none."""
    return ((1.0, 0.0), *((1.0, k / 10) for k in (*range(1, 7), *range(5, -7, -1), *range(-5, 1))))


LOADED = {
    "HC": FRICTIONAL["HC"],
    "CM875": Problem("Hertz, then Q = 0.875 µP at once", ALIKE, ((1, 0), (1, 0.875)), 1, 35),
    "LOOP": Problem("fretting loop of 25 steps, µ = 0.5", ALIKE, _loop(), 25, 35),
    "PRESS10": Problem(
        "normal load in 10 steps, β = −0.19, µ = 0.1",
        DISSIMILAR,
        tuple((k / 10, 0.0) for k in range(1, 11)),
        10,
        60,
    ),
    "HIST": FRICTIONAL["HIST"],
}
"""Histories that are timed at two tolerances."""

LOOSE = 1e-5
BOUNDED = (
    FRICTIONAL
    | LOADED
    | {f"{name}, 1e-5": replace(problem, tolerance=LOOSE) for name, problem in LOADED.items()}
)
"""All whose counts are bounded."""

HERTZ_TITLE = "Hertz, without friction, cold (scalar products)"
HERTZ_GOAL = 12
"""Scalar products of two transforms, a third of an application of the full operator."""


@dataclass(frozen=True)
class Count:
    """Work and sweeps of the counted steps."""

    applications: list[float] = field(default_factory=list)
    sweeps: list[int] = field(default_factory=list)

    @property
    def mean(self) -> float:
        """Operator applications a step."""
        return float(np.mean(self.applications))


def window(spacings_in_radius: int) -> Lattice:
    """Return the window of 2.7 contact radii, a node at its center."""
    half = int(1.35 * spacings_in_radius)
    return Lattice(1 / spacings_in_radius, -half, -half, 2 * half + 1, 2 * half + 1)


def parabola(lattice: Lattice) -> np.ndarray:
    """Return the initial gap."""
    return (lattice.x**2 + lattice.y**2) / 2


def frictional_contact(
    material: Material, lattice: Lattice, *, threads: int = 1, method: Method = "fft"
) -> FrictionalContact:
    """Return the contact problem of a material."""
    return FrictionalContact(
        lattice,
        material.pair,
        parabola(lattice),
        friction_coefficient=material.friction,
        threads=threads,
        method=method,
    )


def run_steps(
    contact: FrictionalContact, problem: Problem, observe: Callable[[ContactState], None] | None = None
) -> Count:
    """Run the steps of a problem from the start; a step that does not converge is an error."""
    count = Count()
    state = contact.virgin()
    first = len(problem.steps) - problem.counted
    for number, (press, shear) in enumerate(problem.steps):
        load = press * LOAD
        target = (load, shear * problem.material.friction * load, 0.0, 0.0)
        state = contact.advance(state, FORCE, target, tolerance=problem.tolerance)
        if not state.converged:
            raise RuntimeError(f"{problem.title}: step {number + 1} has not converged")
        if number >= first:
            count.applications.append(state.operator_applications)
            count.sweeps.append(state.sweeps)
            if observe:
                observe(state)
    return count


def count_frictional(name: str, spacings_in_radius: int) -> Count:
    """Return the work of a problem with friction."""
    problem = BOUNDED[name]
    return run_steps(frictional_contact(problem.material, window(spacings_in_radius)), problem)


def hertz_contact(lattice: Lattice, *, threads: int = 1, method: Method = "fft") -> NormalContact:
    """Return the frictionless problem."""
    return NormalContact(lattice, ALIKE.pair, parabola(lattice), threads=threads, method=method)


def count_hertz(spacings_in_radius: int) -> float:
    """Return the scalar products of a frictionless solution from nothing."""
    solution = hertz_contact(window(spacings_in_radius)).solve(normal_load=LOAD, tolerance=TOLERANCE)
    if not solution.converged:
        raise RuntimeError("Hertz has not converged")
    return 3 * solution.operator_applications


def count(name: str, spacings_in_radius: int) -> float:
    """Return the work of any problem: operator applications a step, or scalar products of "HERTZ"."""
    if name == "HERTZ":
        return count_hertz(spacings_in_radius)
    return count_frictional(name, spacings_in_radius).mean
