"""Measures of a state by the core: nodal residuals, areas, energy; cycles of a load history."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Mask
from ..variables import VARIABLES
from . import flat
from .contact import ElasticPair, Interface, NormalSolution
from .flat import bulk_strain as bulk_strain
from .friction import ContactState, FrictionLaw
from .lattice import Lattice


def nodal_residuals(
    lattice: Lattice,
    pair: ElasticPair,
    friction: FrictionLaw,
    interface: Interface,
    solution: NormalSolution,
    *,
    tangential: bool,
) -> Array:
    """Return the residuals at the nodes, R_n or, tangential, R_t: docs/theory/residuals.md."""
    if tangential:
        # a copy: the slip may be that of several parts of the step
        return np.asarray(flat.tangential_residual(lattice, pair, interface, friction, solution.copied()))
    return np.asarray(flat.normal_residual(lattice, pair, interface, solution.pressure, solution.gap))


def measures(
    lattice: Lattice, friction: FrictionLaw, initial_gap: Array, candidate: Mask, solution: NormalSolution
) -> dict[str, float]:
    """Return the measures of a state in the load history, by the names of `hexcontact.variables`."""
    given = initial_gap, candidate, solution
    if isinstance(solution, ContactState):
        found: dict[str, float] = flat.measure_friction(lattice, friction, *given)._asdict()
        return found
    found = flat.measure_pressure(lattice, *given)._asdict()
    return {name: value for name, value in found.items() if not VARIABLES[name].frictional}


def turning_points(values: Array) -> list[int]:
    """Return the indices in a history at which a quantity turns back, with its first and last extreme."""
    return [int(place) for place in np.flatnonzero(flat.turns_of_history(values))]


def cycles(motion: Array, load: Array) -> list[tuple[int, int, float]]:
    """Return the closed cycles of a load over its motion: docs/theory/load_path.md, (L3).

    Each has the indices of its first and last step in the history, and the area of its loop (J).
    """
    count, places, areas = flat.cycles_of_history(motion, load)
    steps = (places[:count] - 1).tolist()
    return [(first, last, float(area)) for (first, last), area in zip(steps, areas, strict=False)]


def line_of(load: Array, least: float, aside: float) -> tuple[float, float] | None:
    """Return the direction of the line on which tangential loads lie."""
    size = np.hypot(*load)
    largest = load[:, int(np.argmax(size))]
    if not size.max() > least:
        return None
    x, y = largest / size.max() * np.sign(largest[int(np.argmax(np.abs(largest)))])
    return (float(x), float(y)) if np.abs(x * load[1] - y * load[0]).max() <= aside else None
