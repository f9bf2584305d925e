"""Runs hexcontact on the problems of the comparison and on timed problems; prints one line of JSON."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from bench import problems
from bench.square_window import (
    Array,
    HertzContact,
    best_of,
    clock,
    main,
    relative_difference,
    rough_window,
    shear_errors,
)
from hexcontact.core import kernel_cache
from hexcontact.core.contact import ElasticPair, NormalContact, NormalSolution
from hexcontact.core.edges import ContactEdges
from hexcontact.core.friction import ContactState, FrictionalContact, FrictionLaw
from hexcontact.core.lattice import Lattice


def rhombic_window(
    side: int, fraction: float, shift: Sequence[float] = (0.0, 0.0)
) -> tuple[Lattice, HertzContact]:
    """Return side x side lattice nodes with a fraction of them in contact, contact radius 1.

    `shift` moves the nodes, in parts of the spacing along x and y.
    """
    spacing = float(np.sqrt(np.pi / (fraction * side**2 * np.sqrt(3) / 2)))
    origin = spacing * shift[0], spacing * shift[1]
    lattice = Lattice(spacing, -(side // 2), -(side // 2), side, side, origin=origin)
    # K1(0) of the pyramid: 3 sqrt(3)/2 ln 3 spacings
    own = 1.5 * np.sqrt(3) * np.log(3) * spacing / np.pi
    return lattice, HertzContact(lattice.x, lattice.y, 1.0, lattice.cell_area, float(own))


def to_edges(
    lattice: Lattice, solution: NormalSolution, shear: Sequence[Array] = (), mu: float = 0.0
) -> Array:
    """Return p, q_x and q_y at the nodes, to the edges."""
    everywhere = np.ones(lattice.shape, dtype=bool)
    zones = solution.zone > 0, everywhere
    edges = ContactEdges(solution.pressure, solution.gap, *zones, lattice.basis, lattice.start)
    law = FrictionLaw(mu) if shear else None
    return edges.field(np.stack(shear) if shear else None, solution.zone == 1, law).at_nodes()


def hertz(
    side: int,
    fraction: float,
    tolerance: float,
    repeats: int,
    threads: int = 1,
    shift: Sequence[float] = (0.0, 0.0),
) -> dict[str, Any]:
    """Frictionless, from nothing each time."""
    lattice, contact = rhombic_window(side, fraction, shift)
    pair = ElasticPair(1 / np.pi, 0.0, 0.0)
    gap = contact.gap
    setup, problem = best_of(repeats, lambda: NormalContact(lattice, pair, gap, threads=threads))
    solve, solution = best_of(repeats, lambda: problem.solve(normal_load=contact.load, tolerance=tolerance))
    if not solution.converged:
        raise RuntimeError(f"not converged, R_n = {solution.residual_normal:.1e}")
    correct, shown = best_of(repeats, lambda: to_edges(lattice, solution))
    errors = contact.errors(solution.pressure, solution.gap, solution.approach)
    return {
        "setup": setup,
        "solve": solve,
        "iterations": solution.sweeps,
        "products": 3 * solution.operator_applications,
        "correct": correct,
        "l2_to_edges": relative_difference(shown[0], contact.pressure),
        "l2_nodes": errors["l2_pressure"],
        **errors,
    }


def cattaneo_mindlin(
    side: int,
    fraction: float,
    tolerance: float,
    repeats: int,
    mu: float,
    share: float,
    poisson_ratio: float,
    shift: Sequence[float] = (0.0, 0.0),
) -> dict[str, Any]:
    """Press, then shear, both by force; alike bodies of that Poisson's ratio."""
    lattice, contact = rhombic_window(side, fraction, shift)
    pair = ElasticPair(1 / np.pi, 0.0, poisson_ratio / (1 - poisson_ratio) / np.pi)
    setup, problem = best_of(
        1, lambda: FrictionalContact(lattice, pair, contact.gap, friction_coefficient=mu, threads=1)
    )
    load = contact.load
    press, pressed = best_of(
        repeats,
        lambda: problem.advance(problem.virgin(), problems.FORCE, (load, 0, 0, 0), tolerance=tolerance),
    )
    target = (load, share * mu * load, 0.0, 0.0)
    shear, sheared = best_of(
        repeats, lambda: problem.advance(pressed, problems.FORCE, target, tolerance=tolerance)
    )
    if not sheared.converged:
        raise RuntimeError(f"not converged, R_t = {sheared.residual_tangential:.1e}")
    tractions = sheared.traction_x, sheared.traction_y
    correct, shown = best_of(repeats, lambda: to_edges(lattice, sheared, tractions, mu))
    errors, better = (
        shear_errors(contact, sheared.zone == 1, q, mu, share) for q in (tractions[0], shown[1])
    )
    return {
        "setup": setup,
        "press": press,
        "shear": shear,
        "iterations": sheared.sweeps,
        "residual": sheared.residual_tangential,
        "correct": correct,
        "l2_to_edges": better["l2_traction"],
        "l2_nodes": errors["l2_traction"],
        **errors,
    }


def rough(side: int, tolerance: float, repeats: int, threads: int = 1) -> dict[str, Any]:
    """A rough surface in a window that repeats, from nothing each time."""
    contact = rough_window(side)
    lattice = Lattice(1.0 / side, 0, 0, side, side, cell_angle=np.pi / 2, periodic=True)
    pair = ElasticPair(1 / np.pi, 0.0, 0.0)
    setup, problem = best_of(repeats, lambda: NormalContact(lattice, pair, contact.gap, threads=threads))
    solve, solution = best_of(
        repeats, lambda: problem.solve(normal_load=contact.mean_pressure, tolerance=tolerance)
    )
    if not solution.converged:
        raise RuntimeError(f"not converged, R_n = {solution.residual_normal:.1e}")
    return {
        "setup": setup,
        "solve": solve,
        "iterations": solution.sweeps,
        "pairs": 3 * solution.operator_applications,
        "pair": transforms(side),
        "own_residual": solution.residual_normal,
        **contact.errors(solution.pressure, solution.gap),
    }


def transforms(side: int) -> float:
    """Return the seconds of a pair of real transforms in double precision by numpy, on one thread."""
    field = np.random.default_rng(0).standard_normal((side, side))
    return best_of(3, lambda: np.fft.irfft2(np.fft.rfft2(field), s=field.shape))[0]


def friction(
    name: str, side: int, threads: int, repeats: int, loose: bool = False, setups: int = 1
) -> dict[str, Any]:
    """All steps of a counted problem on a window of side x side nodes."""
    problem = problems.BOUNDED[f"{name}, 1e-5" if loose else name]
    lattice = Lattice(2.7 / (side - 1), -(side // 2), -(side // 2), side, side)
    setup, contact = best_of(
        setups, lambda: problems.frictional_contact(problem.material, lattice, threads=threads)
    )
    everything = replace(problem, counted=len(problem.steps))
    shares: list[float] = []

    def observe(state: ContactState) -> None:
        shares.append(float(np.count_nonzero(state.zone == 1) / np.count_nonzero(state.zone)))

    solve, count = best_of(repeats, lambda: problems.run_steps(contact, everything, observe))
    return {
        "setup": setup,
        "solve": solve,
        "steps": len(problem.steps),
        "applications": sum(count.applications),
        "stick": shares[-1],
    }


def normal(side: int, threads: int, repeats: int) -> dict[str, Any]:
    """The frictionless problem on a window of side x side nodes."""
    lattice = Lattice(2.7 / (side - 1), -(side // 2), -(side // 2), side, side)
    setup, contact = best_of(1, lambda: problems.hertz_contact(lattice, threads=threads))
    solve, solution = best_of(
        repeats, lambda: contact.solve(normal_load=problems.LOAD, tolerance=problems.TOLERANCE)
    )
    return {
        "setup": setup,
        "solve": solve,
        "steps": 1,
        "applications": solution.operator_applications,
    }


def setups(name: str, side: int, memory: str, folder: str, repeats: int) -> dict[str, Any]:
    """The first set-up in this process, and the best of those that come after it."""
    lattice = Lattice(2.7 / (side - 1), -(side // 2), -(side // 2), side, side)

    def set_up() -> Any:
        if name == "HERTZ":
            return problems.hertz_contact(lattice)
        return problems.frictional_contact(problems.FRICTIONAL[name].material, lattice)

    def from_the_start() -> Any:
        kernel_cache.configure(memory=memory, folder=folder or False)
        return set_up()

    # a problem that is still there shares its spectra
    first, _ = best_of(1, from_the_start)
    again, _ = best_of(repeats, set_up)
    return {"first": first, "again": again}


def direct(side: int, spacings_in_radius: float, repeats: int) -> dict[str, Any]:
    """Explicit matrices and LAPACK, with and without friction, matrix and factorizations included."""
    lattice = Lattice(1 / spacings_in_radius, -(side // 2), -(side // 2), side, side)

    def frictionless() -> Any:
        contact = problems.hertz_contact(lattice, method="direct")
        return contact.solve(normal_load=problems.LOAD, tolerance=problems.TOLERANCE)

    answer: dict[str, Any] = {"frictionless": best_of(repeats, frictionless)[0]}
    for name in ("N19", "HC"):
        problem = problems.FRICTIONAL[name]
        start = clock()
        contact = problems.frictional_contact(problem.material, lattice, method="direct")
        problems.run_steps(contact, problem)
        answer[name] = clock() - start
    return answer


if __name__ == "__main__":
    # each code works everything out each time
    kernel_cache.configure(memory=0)
    main(
        {
            "hertz": hertz,
            "cattaneo_mindlin": cattaneo_mindlin,
            "rough": rough,
            "friction": friction,
            "normal": normal,
            "direct": direct,
            "setups": setups,
        }
    )
