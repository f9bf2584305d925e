"""Displacement and stress below the surface, as the core finds them.

Fields of tractions have shape (step, 3, n_row, n_col): pressure, and traction on body 1 along x and y, Pa.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..core import flat
from ..core.lattice import Lattice
from ..errors import DeckError

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
    found: tuple[Array, Array] = flat.interior_at_points(
        lattice, tractions, body, poisson_ratio, x, y, depth, threads
    )
    return found


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
    where = lattice, tractions, body, poisson_ratio, np.ravel(depths)
    return np.asarray(flat.interior_on_planes(components, *where, threads))


def planes_memory(lattice: Lattice, threads: int = 0) -> int:
    """Return the memory in bytes that `on_planes` takes besides its result."""
    return int(flat.memory_of_planes(lattice.n_col, lattice.n_row, threads))


def invariants(stress: ArrayLike) -> Array:
    """Return the three principal stresses (largest first), von Mises and Tresca of stresses (..., 6)."""
    values = np.asarray(stress, dtype=float)
    if values.shape[-1:] != (6,):
        raise DeckError(
            f"stress: an array of shape {values.shape}, expected (..., 6): {', '.join(COMPONENTS)}"
        )
    return np.asarray(flat.invariants_of_stress(values))
