"""Edges of contact and stick areas between the nodes, from how tractions vanish there.

At the edge of a contact the pressure vanishes like the square root of the distance, and beyond it the gap
opens like its power 3/2; at the edge of a stick area the reserve of friction, mu p - |q|, vanishes like the
pressure. So p^2, gap^(2/3) and (mu p - |q|)^2, each divided by its slope, are distances from the edge. The
edge runs where they change sign: a polygon through the triangles of the lattice, for zones of any shape.

Lattice arrays have shape (n_row, n_col). Distances are in spacings, positive inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .estimators import boundary

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]

_STEPS = np.array([(0, 1), (1, 0), (1, -1), (0, -1), (-1, 0), (-1, 1)])  # to the neighbors, (row, col)
_TO = np.stack([_STEPS[:, 1] + 0.5 * _STEPS[:, 0], np.sqrt(0.75) * _STEPS[:, 0]], axis=1)  # in the plane
_FAR = 3  # steps over which nodes next to the edge get their slope from nodes that have one
_LEAST = 1e-9  # distance of a node inside
_HALF_WAY = 0.5  # distance of a node where there is no slope: the zone is too small or too narrow

# Next to an edge the solution on the lattice has a layer of its own: nodes at _DISTANCE have squares (of the
# pressure, of the reserve of friction) as if they were at _SQUARE. Measured on the contacts of Hertz and of
# Cattaneo and Mindlin with 14 to 60 spacings in the radius at random places on the lattice: it is the same
# for both and for all directions of the edge, up to a scatter of 0.03.
_DISTANCE = np.array([-0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.5, 2.0])
_SQUARE = np.array(
    [0.0, 0.006, 0.021, 0.046, 0.076, 0.118, 0.216, 0.464, 0.740, 0.985, 1.164, 1.334, 1.513, 2.0]
)
_INWARD = 0.04  # how far inside the true edge pressure and gap without that correction see it, in the mean


@dataclass(frozen=True)
class Edge:
    """An area of the plane whose edge runs between the nodes.

    Parameters
    ----------
    area : float
        Its area, m^2.
    segments : ndarray, shape (n, 2, 2)
        Pieces of the edge, each from a point to a point (m), in no order; none where the zone ends at nodes
        that can never touch.
    """

    area: float
    segments: Array

    @property
    def radius(self) -> float:
        """Radius (m) of the disc with the same area."""
        return float(np.sqrt(self.area / np.pi))

    @property
    def length(self) -> float:
        """Length of the edge, m."""
        return float(np.hypot(*(self.segments[:, 1] - self.segments[:, 0]).T).sum())


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
        self._basis, self._start = basis, np.asarray(start)
        self._contact, self._candidate = contact, candidate
        band = self._band = _Band(contact)
        inside = band.take(contact)
        opened = band.take(candidate) & ~inside
        self._pressure = pressure
        within = _distances(band, inside, band.take(pressure) ** 2) + _INWARD
        gap_there = np.where(opened, band.take(gap), 0.0)
        beyond = _distances(band, opened, np.cbrt(gap_there**2)) - _INWARD
        self._distance = np.where(inside, np.maximum(within, _LEAST), -np.maximum(beyond, 0.0))

    def contact(self) -> Edge:
        """Return the contact area."""
        return self._edge(self._contact, self._band, self._distance)

    def squares(self) -> Array:
        """Return squares of the pressure (Pa^2) that are good to interpolate linearly, shape (n_row, n_col).

        At nodes in contact the layer of the lattice next to the edge is taken off; beyond the edge the
        squares go on below zero. They are NaN away from the edge, and where nothing is known about it.
        """
        band = self._band
        inside = band.take(self._contact)
        square = band.take(self._pressure) ** 2
        away, slope, inward = _layered_distances(band, inside, square)
        # under the rim of a punch the pressure rises towards the edge
        outside = ~band.around(inside)
        rises = np.where((outside @ _TO * inward).sum(axis=1) > 0.0, 1.0, 0.0)
        rises = band.spread(np.where(inside & outside.any(axis=1), rises, np.nan))
        slope = np.where(rises < 0.5, slope, np.nan)
        within = np.where(away < _SQUARE[-1], slope * away, square)
        beyond = np.where(band.take(self._candidate), slope * self._distance, np.nan)
        squares = np.full(self._contact.shape, np.nan)
        band.put(np.where(inside, np.where(np.isnan(slope), np.nan, within), beyond), squares)
        return squares

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
        band = _Band(stick)
        inside = band.take(stick)
        contact = band.take(self._contact)
        square = np.where(inside, band.take(reserve), 0.0) ** 2
        within, _, inward = _layered_distances(band, inside, square)
        # Slip tells little about the distance, since its power depends on how far the edge moved in the step;
        # so nodes outside get theirs from those inside.
        seen = band.around(within) - np.einsum("nkc,kc->nk", band.around(inward), _TO)
        beyond = _mean(np.where(band.around(inside), seen, np.nan))
        distance = np.where(inside, np.maximum(within, _LEAST), np.minimum(beyond, 0.0))
        distance = np.where(np.isnan(distance), np.where(inside, _HALF_WAY, -_HALF_WAY), distance)
        # where the stick area reaches the edge of the contact, that is its edge
        slipping = contact & ~inside
        distance[~slipping & ~(inside & band.around(slipping).any(axis=1))] = np.inf
        of_contact = np.append(self._distance, np.inf)[self._band.place(band.nodes)]
        return self._edge(stick, band, np.minimum(distance, of_contact))

    def _edge(self, zone: Mask, band: _Band, distance: Array) -> Edge:
        """Cut the triangles at the edge of a zone where the distance, linear between the nodes, is zero."""
        count = np.pad(zone, 1).astype(np.int8)
        n_col = count.shape[1]
        sides = count[:-1, 1:] + count[1:, :-1]
        whole, cut = 0, []
        for corner, third in ((count[:-1, :-1], 0), (count[1:, 1:], n_col + 1)):
            inside = corner + sides
            whole += int(np.count_nonzero(inside == 3))
            row, col = np.nonzero((inside == 1) | (inside == 2))
            first = row * n_col + col
            cut.append(np.stack([first + third, first + 1, first + n_col], axis=1))
        row, col = np.divmod(np.concatenate(cut), n_col)
        at = band.place((row + _Band.MARGIN - 1) * band.n_col + col + _Band.MARGIN - 1)
        points = self._start + np.stack([col - 1.0, row - 1.0], axis=-1) @ self._basis
        signed = distance[at]
        inside = signed > 0.0
        touchable = band.take(self._candidate)[at].all(axis=1)
        # the corner that is on its own side goes first
        alone = np.where(inside.sum(axis=1) == 1, inside.argmax(axis=1), (~inside).argmax(axis=1))
        order = (alone[:, None] + np.arange(3)) % 3
        signed, points = np.take_along_axis(signed, order, 1), np.take_along_axis(points, order[..., None], 1)
        way = signed[:, :1] / (signed[:, :1] - signed[:, 1:])
        tip = way.prod(axis=1)
        share = np.where(signed[:, 0] > 0.0, tip, 1.0 - tip)
        share = np.where(touchable, share, inside.mean(axis=1))
        (a, b), (c, d) = self._basis.tolist()
        ends = points[:, :1] + way[:, :, None] * (points[:, 1:] - points[:, :1])
        return Edge(0.5 * (a * d - b * c) * (whole + float(share.sum())), ends[touchable])


class _Band:
    """The nodes about the edge of a zone, numbered across the window with a margin."""

    MARGIN = _FAR + 2

    def __init__(self, zone: Mask) -> None:
        self.n_col = zone.shape[1] + 2 * self.MARGIN
        steps: Index = _STEPS @ np.array([self.n_col, 1])
        row, col = np.nonzero(boundary(zone))
        self.nodes: Index = (row + self.MARGIN) * self.n_col + col + self.MARGIN
        for _ in range(_FAR + 1):
            self.nodes = np.unique(np.concatenate([self.nodes, (self.nodes[:, None] + steps).ravel()]))
        self._beside = self.place(self.nodes[:, None] + steps)
        row, col = np.divmod(self.nodes, self.n_col)
        row, col = row - self.MARGIN, col - self.MARGIN
        self._known = (row >= 0) & (row < zone.shape[0]) & (col >= 0) & (col < zone.shape[1])
        self._at = row[self._known], col[self._known]

    def place(self, nodes: Index) -> Index:
        """Return where nodes are in the band; its length for nodes that are not in it."""
        if not self.nodes.size:
            return np.zeros(nodes.shape, dtype=np.int64)
        found = np.minimum(np.searchsorted(self.nodes, nodes), self.nodes.size - 1)
        return np.where(self.nodes[found] == nodes, found, self.nodes.size)

    def take(self, field: NDArray[Any]) -> NDArray[Any]:
        """Return a field at the nodes of the band; 0 outside the window."""
        values = np.zeros(self.nodes.size, dtype=field.dtype)
        values[self._known] = field[self._at]
        return values

    def put(self, values: Array, field: Array) -> None:
        """Set a field at the nodes of the band."""
        field[self._at] = values[self._known]

    def around(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values at the six neighbors, shape (n, 6, ...); NaN or False outside the band."""
        beyond = False if values.dtype == bool else np.nan
        nothing = np.full_like(values, beyond, shape=(1, *values.shape[1:]))
        return np.asarray(np.concatenate([values, nothing])[self._beside])

    def spread(self, values: Array) -> Array:
        """Fill in what is NaN with the mean of the neighbors, from the nearest nodes on."""
        for _ in range(_FAR):
            values = np.where(np.isnan(values), _mean(self.around(values)), values)
        return values


def _mean(values: Array) -> Array:
    """Mean over the neighbors (axis 1) that have a value; NaN if none has."""
    known = ~np.isnan(values)
    total, count = np.where(known, values, 0.0).sum(axis=1), known.sum(axis=1)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def _distances(band: _Band, zone: Mask, values: Array) -> Array:
    """Distances of the nodes of a zone from its edge, where some values vanish in proportion to them."""
    whole = zone & band.around(zone).all(axis=1)
    slope = np.where(whole, np.hypot(*(band.around(values) @ _TO / 3.0).T), np.nan)
    away = _quotient(values, band.spread(slope))
    return np.where(np.isnan(away), _HALF_WAY, away)


def _layered_distances(band: _Band, zone: Mask, square: Array) -> tuple[Array, Array, Array]:
    """Distances from the edge from one side only, slope at the edge, direction inwards; NaN if unknown.

    The layer at the edge is taken off first, with the slope further inside. The slope at the edge itself then
    follows from those of the parabola that the squares are along the normal n: k^2 = S'^2 - 2 S S".
    """
    whole = zone & band.around(zone).all(axis=1)
    slope = band.spread(np.where(whole, np.hypot(*(band.around(square) @ _TO / 3.0).T), np.nan))
    away = _calibrated(_quotient(square, slope))
    smooth = np.where(away < _SQUARE[-1], slope * away, square)
    around = band.around(smooth)
    gradient = around @ _TO / 3.0
    steepness = np.hypot(*gradient.T)
    inward = gradient / np.where(steepness > 0.0, steepness, np.nan)[:, None]
    # second derivative along n from those along the three lines of nodes: n = cos, sin of an angle
    along = around[:, :3] + around[:, 3:] - 2.0 * smooth[:, None]
    turn = 2.0 * ((inward @ _TO[:3].T) ** 2) - 1.0  # cos 2(angle to the line)
    bend = (along * (1.0 + 2.0 * turn)).sum(axis=1) / 3.0
    at_edge = np.sqrt(np.maximum(steepness**2 - 2.0 * smooth * bend, (0.5 * steepness) ** 2))
    known = np.where(whole[:, None], np.column_stack([at_edge, inward]), np.nan)
    slope, inward = np.split(band.spread(known), [1], axis=1)
    inward = inward / np.hypot(*inward.T)[:, None]
    return _calibrated(_quotient(square, slope[:, 0])), slope[:, 0], inward


def _calibrated(square: Array) -> Array:
    """Distance of a node from the edge at which the solution on the lattice has a square (in slopes)."""
    return np.where(square < _SQUARE[-1], np.interp(square, _SQUARE, _DISTANCE), square)


def _quotient(values: Array, slope: Array) -> Array:
    return np.divide(values, slope, out=np.full_like(values, np.nan), where=slope > 0.0)
