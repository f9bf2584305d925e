"""What a state says besides its fields, as the core finds it: nodal residuals, energy, extent of zones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import _core
from .contact import ElasticPair, NormalSolution, raise_for
from .friction import ContactState
from .lattice import Lattice

_api = _core.hc_f2py_measures

Array = NDArray[np.float64]


def nodal_residuals(
    lattice: Lattice,
    pair: ElasticPair,
    friction_coefficient: float,
    solution: NormalSolution | ContactState,
    *,
    tangential: bool,
) -> Array:
    """Return the residuals at the nodes, R_n or, tangential, R_t: docs/theory/residuals.md."""
    vectors = _vectors(solution, "traction", "slip_increment")
    residuals, code, message = _api.nodal_residuals(
        lattice.basis.T,
        pair.as_array(),
        min(friction_coefficient, np.finfo(float).max),
        tangential,
        solution.pressure.T,
        solution.gap.T,
        vectors,
    )
    raise_for(code, message)
    return np.asarray(residuals.T)


def elastic_energy(lattice: Lattice, initial_gap: Array, solution: NormalSolution | ContactState) -> float:
    """Return the energy (J) of a deformation; the initial gap (m) counts at nodes in contact only."""
    frictional = isinstance(solution, ContactState)
    motion = [solution.approach, 0.0, 0.0, 0.0]
    if isinstance(solution, ContactState):
        motion[1:] = solution.shift_x, solution.shift_y, solution.twist
    energy, code, message = _api.energy_of_state(
        lattice.basis.T,
        (lattice.x[0, 0], lattice.y[0, 0]),
        solution.pressure.T,
        solution.gap.T,
        initial_gap.T,
        solution.zone.T,
        motion,
        frictional,
        _vectors(solution, "traction", "relative_displacement"),
    )
    raise_for(code, message)
    return float(energy)


def zone_extent(lattice: Lattice, zone: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return center of area, smallest and largest x and y (m) of the nodes of a zone; NaN without nodes."""
    extent: tuple[Array, Array, Array] = _api.extent_of_zone(lattice.x.T, lattice.y.T, zone.T)
    return extent


def _vectors(solution: NormalSolution | ContactState, *names: str) -> Array:
    """Return vector fields as the core takes them; zeros without friction."""
    if not isinstance(solution, ContactState):
        return np.zeros((4, *solution.pressure.shape)).T
    return np.stack([getattr(solution, f"{name}_{axis}") for name in names for axis in "xy"]).T
