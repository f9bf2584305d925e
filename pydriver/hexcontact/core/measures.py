"""Measures of a state by the core: nodal residuals, areas, energy; cycles of a load history."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Mask
from ..variables import CORE, VARIABLES
from . import _core
from .calls import called
from .contact import ElasticPair, Interface, NormalSolution
from .friction import MOTION, ContactState, FrictionLaw
from .lattice import Lattice

_api = _core.hc_f2py_measures
# what measures need of a state with friction beside pressure and gap
_MEASURED = ("traction_x", "traction_y", "relative_displacement_x", "relative_displacement_y")


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
    vectors = _vectors(solution, "traction", "slip_increment")
    residuals = called(
        _api.nodal_residuals,
        lattice.basis.T,
        pair.as_array(),
        *friction.as_arguments(),
        interface,
        tangential,
        solution.pressure.T,
        solution.gap.T,
        vectors,
    )
    return np.asarray(residuals.T)


def bulk_strain(
    young_modulus: float, poisson_ratio: float, stress: tuple[float, float, float], plane_strain: int
) -> tuple[Array, Array]:
    """Return a bulk stress xx, yy, xy (Pa) and its strain: free sides (0), no strain along x (1), y (2)."""
    found: tuple[Array, Array] = _api.strain_of_bulk((young_modulus, poisson_ratio), plane_strain, stress)
    return found


def measures(
    lattice: Lattice, friction: FrictionLaw, initial_gap: Array, candidate: Mask, solution: NormalSolution
) -> dict[str, float]:
    """Return the measures of a state in the load history, by the names of `hexcontact.variables`."""
    frictional = isinstance(solution, ContactState)
    numbers = called(
        _api.measures_of_state,
        *(lattice.basis.T, lattice.first, lattice.origin, *friction.as_arguments(), frictional),
        *(solution.pressure.T, solution.gap.T, initial_gap.T, solution.zone.T, candidate.T),
        [getattr(solution, name, 0.0) for name in MOTION],
        # one by one: a stack of them would be a copy of half of the state
        *(getattr(solution, name, solution.pressure).T for name in _MEASURED),
    )
    found = dict(zip(CORE["measures"], numbers.tolist(), strict=True))
    return {name: value for name, value in found.items() if frictional or not VARIABLES[name].frictional}


def turning_points(values: Array) -> list[int]:
    """Return the indices in a history at which a quantity turns back, with its first and last extreme."""
    return [int(place) for place in np.flatnonzero(_api.turns_of_history(values))]


def cycles(motion: Array, load: Array) -> list[tuple[int, int, float]]:
    """Return the closed cycles of a load over its motion: docs/theory/load_path.md, (L3).

    Each has the indices of its first and last step in the history, and the area of its loop (J).
    """
    count, places, areas = _api.cycles_of_history(motion, load)
    steps = (places.T[:count] - 1).tolist()
    return [(first, last, float(area)) for (first, last), area in zip(steps, areas, strict=False)]


def _vectors(solution: NormalSolution, *names: str) -> Array:
    """Return vector fields as the core takes them; zeros without friction."""
    if not isinstance(solution, ContactState):
        return np.zeros((4, *solution.pressure.shape)).T
    return np.stack([getattr(solution, f"{name}_{axis}") for name in names for axis in "xy"]).T


def line_of(load: Array, least: float, aside: float) -> tuple[float, float] | None:
    """Return the direction of the line on which tangential loads lie."""
    size = np.hypot(*load)
    largest = load[:, int(np.argmax(size))]
    if not size.max() > least:
        return None
    x, y = largest / size.max() * np.sign(largest[int(np.argmax(np.abs(largest)))])
    return (float(x), float(y)) if np.abs(x * load[1] - y * load[0]).max() <= aside else None
