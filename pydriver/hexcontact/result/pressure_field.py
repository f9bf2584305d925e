"""The pressure between the nodes: linear inside, like a square root at the edge of the contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.edges import ContactEdges
from ..core.interpolation import pressure_between

Array = NDArray[np.float64]


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
        return pressure_between(self._pressure, self._squares, self._basis, self._start, x, y)
