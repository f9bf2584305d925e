"""Fields between the nodes of a lattice, by the core."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array
from . import flat
from .lattice import Lattice, Nodes

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
    nodes = Nodes(np.asarray(basis), start, np.shape(values))
    return np.asarray(flat.field_between_nodes(nodes, values, outside, x, y))


def nearest(
    values: NDArray[Any], basis: Array, start: Point, x: ArrayLike, y: ArrayLike, outside: float
) -> Array:
    """Return the values at the nodes next to points; parameters as of `linear`."""
    col, row, inside = flat.nodes_next_to(Nodes(basis, start, values.shape), x, y)
    return np.where(inside, values[row, col], outside).astype(float)


def section_ends(
    lattice: Lattice, pressure: Array, angle: float, through: Point | None
) -> tuple[Point, Point, float]:
    """Return the ends of a line across a contact, and the distance of its zero from the first one (m)."""
    point = (0.0, 0.0) if through is None else through
    ends, zero = flat.section_of_pressure(lattice, pressure, angle, through is not None, point)
    (x0, y0), (x1, y1) = ends.tolist()
    return (x0, y0), (x1, y1), zero


def crossings(lattice: Lattice, start: Point, end: Point) -> Array:
    """Return where a line crosses edges of triangles, as distances from its start (m), with its ends."""
    lines = np.linalg.norm(np.linalg.inv(lattice.basis), axis=0)  # columns and rows per length across them
    most = 8 + int(2.0 * math.dist(start, end) * lines.sum())
    distance, count = flat.crossings_of_line(lattice, start, end, most)
    return np.asarray(distance[:count])
