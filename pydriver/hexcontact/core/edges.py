"""Edges of contact and stick areas between the nodes, as the core finds them.

How tractions vanish there tells the distance of a node from the edge: see fortran/contact/contact_edges.f90.
Lattice arrays have shape (n_row, n_col).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import _core
from .contact import raise_for

_api = _core.hc_f2py_measures

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Edge:
    """An area of the plane whose edge runs between the nodes.

    Parameters
    ----------
    area : float
        Its area, m^2.
    radius : float
        Radius (m) of the disc with the same area.
    length : float
        Length of the edge, m.
    segments : ndarray, shape (n, 2, 2)
        Pieces of the edge, each from a point to a point (m), in no order; none where the zone ends at nodes
        that can never touch.
    """

    area: float
    radius: float
    length: float
    segments: Array


class ContactEdges:
    """The edges of a contact and of the stick area in it.

    Parameters
    ----------
    pressure : ndarray, shape (n_row, n_col)
        Contact pressure, Pa.
    gap : ndarray, shape (n_row, n_col)
        Gap, m; what stands at nodes that can never touch does not matter.
    contact : ndarray of bool, shape (n_row, n_col)
        Nodes in contact.
    candidate : ndarray of bool, shape (n_row, n_col)
        Nodes that can touch. Where a contact ends at others, as at the rim of a punch, its pressure does not
        vanish; there the cells of its nodes count.
    basis : ndarray, shape (2, 2)
        Basis vectors of the (equilateral) lattice as rows, m.
    start : tuple of float
        Position of node [0, 0], m.
    """

    def __init__(
        self,
        pressure: Array,
        gap: Array,
        contact: Mask,
        candidate: Mask,
        basis: Array,
        start: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self._basis, self._start = basis.T, start
        # converted once: the core takes zones as integers
        self._fields = pressure.T, gap.T, contact.T.astype(np.int32), candidate.T.astype(np.int32)

    def contact(self) -> Edge:
        """Return the contact area."""
        pressure, _, contact, _ = self._fields
        return self._edge(False, contact, pressure)

    def stick(self, stick: Mask, reserve: Array) -> Edge:
        """Return the part of the contact area that sticks.

        Parameters
        ----------
        stick : ndarray of bool, shape (n_row, n_col)
            Nodes that stick, all in contact.
        reserve : ndarray, shape (n_row, n_col)
            What friction could carry beyond the shear traction, mu p - |q| (Pa); only its values at
            these nodes matter.
        """
        return self._edge(True, stick.T.astype(np.int32), reserve.T)

    def squares(self) -> Array:
        """Return squares of the pressure (Pa^2) that are good to interpolate linearly, shape (n_row, n_col).

        At nodes in contact the layer of the lattice next to the edge is taken off; beyond the edge the
        squares go on below zero. They are NaN away from the edge, and where nothing is known about it.
        """
        squares, code, message = _api.pressure_squares(self._basis, *self._fields)
        raise_for(code, message)
        return np.asarray(squares.T)

    def _edge(self, of_stick: bool, zone: NDArray[np.int32], reserve: Array) -> Edge:
        numbers, segments, count, code, message = _api.edge_of_zone(
            self._basis,
            self._start,
            *self._fields,
            of_stick,
            zone,
            reserve,
            _api.count_cut_triangles(zone),
        )
        raise_for(code, message)
        area, radius, length = numbers.tolist()
        return Edge(area, radius, length, segments.T[:count])
