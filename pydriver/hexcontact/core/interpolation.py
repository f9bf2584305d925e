"""Fields between the nodes of a lattice, by the core."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array
from . import _core
from .calls import called
from .lattice import Lattice

_api, _flat = _core.hc_f2py_measures, _core.hc_f2py_lattice

Point = tuple[float, float]


def linear(
    values: Array, basis: Array, start: Point, x: ArrayLike, y: ArrayLike, outside: float = 0.0
) -> Array:
    """Interpolate values at the nodes of a lattice linearly on its triangles.

    Parameters
    ----------
    values : ndarray, shape (n_row, n_col)
        Values at the nodes.
    basis : ndarray, shape (2, 2)
        Basis vectors of the lattice as rows, m.
    start : tuple of float
        Position of node [0, 0], m.
    x, y : array_like
        Points, m.
    outside : float
        Value at nodes outside the window.

    Returns
    -------
    ndarray
        Values at the points, in their shape.
    """
    return _at_points(_api.field_between_nodes, basis, start, (np.asarray(values).T, outside), x, y)


def nearest(
    values: NDArray[Any], basis: Array, start: Point, x: ArrayLike, y: ArrayLike, outside: float
) -> Array:
    """Return the values at the nodes next to points; parameters as of `linear`."""
    points = np.ravel(x), np.ravel(y)
    col, row, inside = called(_api.nodes_next_to, basis.T, start, values.shape[::-1], *points)
    return np.where(inside, values[row, col], outside).astype(float).reshape(np.shape(x))


def section_ends(
    lattice: Lattice, pressure: Array, angle: float, through: Point | None
) -> tuple[Point, Point, float]:
    """Return the ends of a line across a contact, and the distance of its zero from the first one (m)."""
    where = lattice.basis.T, lattice.first, lattice.origin, pressure.T
    point = (0.0, 0.0) if through is None else through
    ends, zero = called(_flat.section_of_pressure, *where, angle, through is not None, point)
    (x0, x1), (y0, y1) = ends.tolist()
    return (x0, y0), (x1, y1), zero


def crossings(lattice: Lattice, start: Point, end: Point) -> Array:
    """Return where a line crosses edges of triangles, as distances from its start (m), with its ends."""
    most = 8 + int(4.0 * math.dist(start, end) / lattice.spacing)  # rows are sqrt(3)/2 spacings apart
    distance, count = called(_flat.crossings_of_line, lattice.basis.T, lattice.origin, start, end, most)
    return np.asarray(distance[:count])


def _at_points(
    core: Any, basis: Array, start: Point, fields: tuple[Any, Any], x: ArrayLike, y: ArrayLike
) -> Array:
    found = called(core, np.asarray(basis).T, start, *fields, np.ravel(x), np.ravel(y))
    return np.asarray(found.reshape(np.shape(x)))
