"""The pressure between the nodes: linear inside, like a square root at the edge of the contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.edges import ContactEdges

Array = NDArray[np.float64]


def linear(values: Array, basis: Array, start: tuple[float, float], x: ArrayLike, y: ArrayLike) -> Array:
    """Interpolate values at the nodes of a lattice linearly on its triangles; 0 outside the window.

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

    Returns
    -------
    ndarray
        Values at the points, in their shape.
    """
    points = np.stack([np.ravel(x), np.ravel(y)], axis=1) - start
    col, row = np.linalg.solve(np.asarray(basis).T, points.T)
    col, row = np.round(col, 9), np.round(row, 9)  # a node is a node
    i, j = np.floor(col).astype(int), np.floor(row).astype(int)
    u, v = col - i, row - j
    padded = np.pad(values, 1)
    n_row, n_col = padded.shape
    lower = u + v <= 1
    total = np.zeros(u.shape)
    for dj, di, weight in (
        (0, 0, np.maximum(1 - u - v, 0.0)),
        (0, 1, np.where(lower, u, 1 - v)),
        (1, 0, np.where(lower, v, 1 - u)),
        (1, 1, np.maximum(u + v - 1, 0.0)),
    ):
        value = padded[np.clip(j + dj + 1, 0, n_row - 1), np.clip(i + di + 1, 0, n_col - 1)]
        total += np.where(weight > 0.0, weight * value, 0.0)
    return total.reshape(np.shape(x))


class PressureField:
    """The pressure of a solution at any point.

    Near the edge of the contact its square is interpolated, which is linear in the distance; elsewhere, and
    where the contact ends at nodes that can never touch, the pressure itself is.

    Parameters
    ----------
    pressure, gap : ndarray, shape (n_row, n_col)
        Contact pressure (Pa) and gap (m) at the nodes; the gap is NaN where nothing can touch.
    basis : ndarray, shape (2, 2)
        Basis vectors of the lattice as rows, m.
    start : tuple of float
        Position of node [0, 0], m.
    """

    def __init__(self, pressure: Array, gap: Array, basis: Array, start: tuple[float, float]) -> None:
        self._pressure, self._basis, self._start = pressure, basis, start
        self._squares = ContactEdges(pressure, gap, pressure > 0.0, np.isfinite(gap), basis, start).squares()

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the pressure (Pa) at some points (m), in their shape; 0 outside the window."""
        plain = linear(self._pressure, self._basis, self._start, x, y)
        square = linear(self._squares, self._basis, self._start, x, y)
        return np.where(np.isnan(square), plain, np.sqrt(np.maximum(square, 0.0)))
