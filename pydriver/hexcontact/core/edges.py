"""Edges of contact and stick areas between the nodes, from how tractions vanish there.

At the edge of a contact the pressure vanishes like the square root of the distance, and beyond it the gap
opens like its power 3/2; at the edge of a stick area the reserve of friction, mu p - |q|, vanishes like the
pressure. So p^2, gap^(2/3) and (mu p - |q|)^2, each divided by its slope, are distances from the edge. The
edge runs where they change sign: a polygon through the triangles of the lattice, for zones of any shape.

Lattice arrays have shape (n_row, n_col). Distances are in spacings, positive inside.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .estimators import boundary

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]

# steps (row, col) to the neighbors of a node, counterclockwise
NEIGHBORS = np.array([(0, 1), (1, 0), (1, -1), (0, -1), (-1, 0), (-1, 1)])
_TO = NEIGHBORS[:, ::-1] @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])  # in the plane
_FAR = 3  # steps over which nodes next to the edge get their slope from nodes that have one
_LEAST = 1e-9  # distance of a node inside
_HALF_WAY = 0.5  # distance of a node where there is no slope: the zone is too small, or not sharply bounded
_LEAST_SLOPE = 0.5  # at the edge, squared, of that further inside: for (distance^m)^2 it is 1/m - 1

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
        away, slope, inward_x, inward_y = _layered_distances(band, inside, square)
        # under the rim of a punch the pressure rises towards the edge
        to_inside_x, to_inside_y = band.gradient(inside.astype(float))
        rises = np.where(to_inside_x * inward_x + to_inside_y * inward_y < 0.0, 1.0, 0.0)
        rises = band.spread(np.where(inside & band.next_to(~inside), rises, np.nan))
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
        within, _, inward_x, inward_y = _layered_distances(band, inside, square)
        # Slip tells little about the distance, since its power depends on how far the edge moved in the step;
        # so nodes outside get theirs from those inside.
        seen = (
            np.where(near, away - (to_x * x + to_y * y), np.nan)
            for near, away, x, y, (to_x, to_y) in zip(
                *map(band.neighbors, (inside, within, inward_x, inward_y)), _TO, strict=True
            )
        )
        distance = np.where(inside, np.maximum(within, _LEAST), np.minimum(band.mean(seen), 0.0))
        distance = np.where(np.isnan(distance), np.where(inside, _HALF_WAY, -_HALF_WAY), distance)
        # where the stick area reaches the edge of the contact, that is its edge
        slipping = contact & ~inside
        distance[~slipping & ~(inside & band.next_to(slipping))] = np.inf
        of_contact = band.values_of(self._band, self._distance, np.inf)
        return self._edge(stick, band, np.minimum(distance, of_contact))

    def _edge(self, zone: Mask, band: _Band, distance: Array) -> Edge:
        """Cut the triangles at the edge of a zone where the distance, linear between the nodes, is zero."""
        count = np.pad(zone, 1).astype(np.int8)
        sides = count[:-1, 1:] + count[1:, :-1]
        covered, segments = 0.0, []
        for corner, third in ((count[:-1, :-1], 0), (count[1:, 1:], 1)):  # lower and upper triangles
            inside = corner + sides
            row, col = np.nonzero((inside == 1) | (inside == 2))
            corners = np.array([[third, 0, 1], [third, 1, 0]])[:, None] - 1  # less the padding
            share, ends = self._cut(row[:, None] + corners[0], col[:, None] + corners[1], band, distance)
            covered += int(np.count_nonzero(inside == 3)) + float(share.sum())
            segments.append(ends)
        (a, b), (c, d) = self._basis.tolist()
        return Edge(0.5 * (a * d - b * c) * covered, np.concatenate(segments))

    def _cut(self, row: Index, col: Index, band: _Band, distance: Array) -> tuple[Array, Array]:
        """Return what share of triangles is inside, and the pieces of the edge; nodes of shape (n, 3)."""
        at = band.place(row, col)
        signed = distance[at]
        inside = signed > 0.0
        touchable = band.take(self._candidate)[at].all(axis=1)
        # the corner that is on its own side goes first
        alone = np.where(inside.sum(axis=1) == 1, inside.argmax(axis=1), (~inside).argmax(axis=1))
        order = (alone[:, None] + np.arange(3)) % 3
        signed = np.take_along_axis(signed, order, 1)
        row, col = np.take_along_axis(row, order, 1), np.take_along_axis(col, order, 1)
        way = signed[:, :1] / (signed[:, :1] - signed[:, 1:])
        tip = way.prod(axis=1)
        share = np.where(signed[:, 0] > 0.0, tip, 1.0 - tip)
        share = np.where(touchable, share, inside.mean(axis=1))
        way, row, col = way[touchable], row[touchable], col[touchable]
        steps = (values[:, :1] + way * (values[:, 1:] - values[:, :1]) for values in (col, row))
        return share, self._start + np.stack(list(steps), axis=-1) @ self._basis


class _Band:
    """The nodes about the edge of a zone, in one list, and which of them are neighbors.

    Nodes have numbers, counted over the window with a margin.
    """

    MARGIN = _FAR + 2

    def __init__(self, zone: Mask) -> None:
        near = np.pad(boundary(zone), self.MARGIN)
        self.n_col = near.shape[1]
        steps: Index = NEIGHBORS @ np.array([self.n_col, 1])
        near = near.ravel()
        for _ in range(_FAR + 1):
            near = np.logical_or.reduce([near, *(np.roll(near, step) for step in steps)])
        nodes = np.flatnonzero(near)
        self._nodes, self.size = nodes, nodes.size
        self._places = np.full(near.size, self.size, dtype=np.int32)
        self._places[nodes] = np.arange(self.size)
        self._beside = [self._places[nodes + step] for step in steps]
        row, col = np.divmod(nodes, self.n_col)
        row, col = row - self.MARGIN, col - self.MARGIN
        self._known = (row >= 0) & (row < zone.shape[0]) & (col >= 0) & (col < zone.shape[1])
        self._at = row[self._known], col[self._known]

    def place(self, row: Index, col: Index) -> NDArray[np.int32]:
        """Return where nodes of the window are in the band; its size for nodes that are not in it."""
        return np.asarray(self._places[(row + self.MARGIN) * self.n_col + col + self.MARGIN])

    def values_of(self, other: _Band, values: Array, default: float) -> Array:
        """Return what stands at the nodes of another band of the same window."""
        return np.asarray(np.append(values, default)[other._places[self._nodes]])

    def take(self, field: NDArray[Any]) -> NDArray[Any]:
        """Return a field at the nodes of the band; 0 outside the window."""
        values = np.zeros(self.size, dtype=field.dtype)
        values[self._known] = field[self._at]
        return values

    def put(self, values: Array, field: Array) -> None:
        """Set a field at the nodes of the band."""
        field[self._at] = values[self._known]

    def neighbors(self, values: NDArray[Any]) -> Iterator[NDArray[Any]]:
        """Yield the values at the first to sixth neighbor of each node; NaN or False outside the band."""
        longer = np.append(values, False if values.dtype == bool else np.nan)
        return (longer[beside] for beside in self._beside)

    def surrounded(self, zone: Mask) -> Mask:
        """Nodes of a zone whose neighbors are in it, too."""
        return np.logical_and.reduce([zone, *self.neighbors(zone)])

    def next_to(self, zone: Mask) -> Mask:
        """Nodes that have a neighbor in a zone."""
        return np.logical_or.reduce(list(self.neighbors(zone)))

    def gradient(self, values: Array) -> tuple[Array, Array]:
        """Return the gradient along x and y, per spacing."""
        x, y = np.zeros(self.size), np.zeros(self.size)
        for value, (to_x, to_y) in zip(self.neighbors(values), _TO / 3.0, strict=True):
            x += to_x * value
            y += to_y * value
        return x, y

    def mean(self, values: Iterable[Array]) -> Array:
        """Mean of those of the six values, one from each neighbor, that are not NaN; NaN if there is none."""
        total, count = np.zeros(self.size), np.zeros(self.size, dtype=np.int8)
        for value in values:
            known = ~np.isnan(value)
            total[known] += value[known]
            count += known
        return np.divide(total, count, out=np.full(self.size, np.nan), where=count > 0)

    def spread(self, values: Array) -> Array:
        """Fill in what is NaN with the mean of the neighbors, from the nearest nodes on."""
        for _ in range(_FAR):
            values = np.where(np.isnan(values), self.mean(self.neighbors(values)), values)
        return values


def _distances(band: _Band, zone: Mask, values: Array) -> Array:
    """Distances of the nodes of a zone from its edge, where some values vanish in proportion to them."""
    slope = np.where(band.surrounded(zone), np.hypot(*band.gradient(values)), np.nan)
    away = _quotient(values, band.spread(slope))
    return np.where(np.isnan(away), _HALF_WAY, away)


def _layered_distances(band: _Band, zone: Mask, square: Array) -> tuple[Array, Array, Array, Array]:
    """Distances from the edge from one side only, slope there, direction inwards (x, y); NaN if unknown.

    The layer at the edge is taken off first, with the slope further inside. The slope at the edge itself then
    follows from those of the parabola that the squares S are along the normal n: k^4 = S'^2 - 2 S S". Where
    this is little or negative they vanish with a higher power than the first.
    """
    whole = band.surrounded(zone)
    slope = band.spread(np.where(whole, np.hypot(*band.gradient(square)), np.nan))
    away = _calibrated(_quotient(square, slope))
    smooth = np.where(away < _SQUARE[-1], slope * away, square)
    x, y = band.gradient(smooth)
    steepness = np.where(whole, np.hypot(x, y), np.nan)
    x, y = _quotient(x, steepness), _quotient(y, steepness)
    # second derivative along n from those along the three lines of nodes at angles t to n
    bend = np.zeros(band.size)
    for value, (to_x, to_y) in zip(band.neighbors(smooth), _TO, strict=True):
        bend += (value - smooth) * (4.0 * (to_x * x + to_y * y) ** 2 - 1.0) / 3.0  # 1 + 2 cos 2t
    at_edge = steepness**2 - 2.0 * smooth * bend
    flat = band.spread(np.where(whole, at_edge < _LEAST_SLOPE * steepness**2, np.nan)) > 0.5
    at_edge = np.sqrt(np.maximum(at_edge, _LEAST_SLOPE * steepness**2))
    slope, x, y = (band.spread(values) for values in (at_edge, x, y))
    slope, length = np.where(flat, np.nan, slope), np.hypot(x, y)
    return _calibrated(_quotient(square, slope)), slope, _quotient(x, length), _quotient(y, length)


def _calibrated(square: Array) -> Array:
    """Distance of a node from the edge at which the solution on the lattice has a square (in slopes)."""
    return np.where(square < _SQUARE[-1], np.interp(square, _SQUARE, _DISTANCE), square)


def _quotient(values: Array, slope: Array) -> Array:
    """Divide by a slope; NaN where there is none but by rounding."""
    return np.divide(values, slope, out=np.full_like(values, np.nan), where=slope > 1e-9 * np.abs(values))
