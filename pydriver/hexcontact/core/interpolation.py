"""Fields between the nodes of a lattice, as the core finds them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .contact import raise_for

_api = _core.hc_f2py_measures

Array = NDArray[np.float64]
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


def nearest_nodes(
    shape: tuple[int, int], basis: Array, start: Point, x: ArrayLike, y: ArrayLike
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """Return row and column of the node next to each point, and whether the window of this shape has it.

    Without such a node they are those of one at the rim. The other arguments are those of `linear`.
    """
    col, row, inside, code, message = _api.nodes_next_to(
        basis.T, start, shape[::-1], np.ravel(x), np.ravel(y)
    )
    raise_for(code, message)
    row, col, inside = (found.reshape(np.shape(x)) for found in (row, col, inside))
    return row.astype(np.intp), col.astype(np.intp), inside != 0


def pressure_between(
    pressure: Array, squares: Array, basis: Array, start: Point, x: ArrayLike, y: ArrayLike
) -> Array:
    """Return the pressure (Pa) at some points: the root of its squares, itself where those are NaN."""
    return _at_points(_api.pressure_between_nodes, basis, start, (pressure.T, squares.T), x, y)


def _at_points(
    core: Any, basis: Array, start: Point, fields: tuple[Any, Any], x: ArrayLike, y: ArrayLike
) -> Array:
    found, code, message = core(np.asarray(basis).T, start, *fields, np.ravel(x), np.ravel(y))
    raise_for(code, message)
    return np.asarray(found.reshape(np.shape(x)))
