"""Displacement and stress below the surface, as the core finds them.

Fields of tractions have shape (step, 3, n_row, n_col): pressure, and traction on body 1 along x and y, Pa.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..core import _core
from ..core.calls import called
from ..core.lattice import Lattice
from ..errors import DeckError

_api = _core.hc_f2py_interior

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
"""Components of the stress in the order of the core."""


def at_points(
    lattice: Lattice, tractions: Array, body: int, poisson_ratio: float, points: ArrayLike, threads: int = 0
) -> tuple[Array, Array]:
    """Return G u (step, n, 3) and the stress (step, n, 6; xx, yy, zz, xy, yz, xz) of a body in load steps.

    The influence of each node on each point is worked out once for all steps.
    """
    x, y, depth = np.asarray(points, dtype=float).reshape(-1, 3).T
    if not x.size:
        return np.empty((len(tractions), 0, 3)), np.empty((len(tractions), 0, 6))
    displacement, stress = called(
        _api.interior_at_points,
        lattice.basis.T,
        lattice.start,
        tractions.T,
        body,
        poisson_ratio,
        x,
        y,
        depth,
        threads,
    )
    return displacement.T, stress.T


def on_planes(
    lattice: Lattice,
    tractions: Array,
    body: int,
    poisson_ratio: float,
    depths: ArrayLike,
    threads: int = 0,
    components: int = 6,
) -> Array:
    """Return a field at the nodes of planes parallel to the surface, (step, depth, component, n_row, n_col).

    Parameters as of `at_points`; `depths` are those of the planes below the surface of the body, m. Six
    `components` are those of the stress (Pa), three those of the displacement times the shear modulus (Pa m).
    """
    field = called(
        _api.interior_on_planes,
        components,
        lattice.basis.T,
        lattice.start,
        tractions.T,
        body,
        poisson_ratio,
        np.ravel(depths),
        threads,
    )
    return np.asarray(field.T)


def planes_memory(lattice: Lattice, threads: int = 0) -> int:
    """Return the memory in bytes that `on_planes` takes besides its result."""
    return int(_api.memory_of_planes(lattice.n_col, lattice.n_row, threads))


def invariants(stress: ArrayLike) -> Array:
    """Return the three principal stresses (largest first), von Mises and Tresca of stresses (..., 6)."""
    values = np.asarray(stress, dtype=float)
    if values.shape[-1:] != (6,):
        raise DeckError(
            f"stress: an array of shape {values.shape}, expected (..., 6): {', '.join(COMPONENTS)}"
        )
    flat = values.reshape(-1, 6)
    scalars = _api.invariants_of_stress(flat.T).T if len(flat) else np.empty((0, 5))
    return np.asarray(scalars).reshape(*values.shape[:-1], 5)
