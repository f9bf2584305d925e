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


def nearest(
    values: NDArray[Any], basis: Array, start: Point, x: ArrayLike, y: ArrayLike, outside: float
) -> Array:
    """Return the values at the nodes next to some points; parameters as of `linear`."""
    col, row, inside, code, message = _api.nodes_next_to(
        basis.T, start, values.shape[::-1], np.ravel(x), np.ravel(y)
    )
    raise_for(code, message)
    return np.where(inside, values[row, col], outside).astype(float).reshape(np.shape(x))


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
