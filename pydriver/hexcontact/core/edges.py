"""Edges of contact and stick areas between the nodes, by the core.

The distance of a node from the edge follows from the decay of tractions: fortran/measures/contact_edges.f90.
Lattice arrays have shape (n_row, n_col).
"""

from __future__ import annotations

from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, Mask
from . import _core, memory
from .calls import called
from .contact import ElasticPair
from .estimators import Ellipse

_api = _core.hc_f2py_edges

_UNLIMITED, _LIMITED = 5, 13  # arrays of a traction field
_GIVEN = 12  # arrays that it is made from, with copies and zones
_LARGE = 250_000  # nodes from which their memory is checked
_MARGIN = 6  # nodes about a contact from which its edge follows, at most, and one more

_Part = tuple[slice, slice]
Source = Literal["edges", "nodes"]
Limits = tuple[Array | float, Array | float]
_Zone = tuple[Array, NDArray[np.int32], bool]  # fields and zones of the core; whether it is the stick area


def tractions_memory(
    n_row: int, n_col: int, contact: int, sheared: bool, unlike: bool, threads: int = 0
) -> int:
    """Return the memory (bytes) of `ContactEdges.tractions`, besides what it is given and returns."""
    return int(_api.memory_of_edges(n_col, n_row, contact, sheared, unlike, threads))


class Edge(NamedTuple):
    """An area of the plane whose edge runs between the nodes."""

    area: float
    radius: float
    length: float
    segments: Array
    ellipse: Ellipse


class ZoneMesh(NamedTuple):
    """Triangles that fill an area of the plane up to its edge between the nodes, and a field there."""

    x: Array
    y: Array
    values: Array
    triangles: NDArray[np.intp]

    def outlines(self) -> list[Array]:
        """Return closed polygons of shape (n, 2), m, counterclockwise around the area."""
        if not self.triangles.size:
            return []
        corners, number, count = _core.hc_f2py_lattice.outline_of_zone(self.triangles.T + 1, self.x.size)
        points = np.stack([self.x, self.y], axis=1)[corners[:count] - 1]
        polygons = np.split(points, np.flatnonzero(np.diff(number[:count])) + 1)
        return [np.append(polygon, polygon[:1], axis=0) for polygon in polygons]


class TractionField:
    """Pressure and shear traction of a contact over the plane.

    They vanish like square roots at the edge of the contact, and the reserve of friction does at the edge of
    the stick area, both between the nodes; elsewhere they are linear.

    Parameters
    ----------
    parts : ndarray
        The field as the core holds it.
    basis : ndarray, shape (2, 2)
        Basis vectors of the lattice as columns, m.
    start : tuple of float
        Position of its first node, m.
    source : str
        See below.
    whole : tuple, optional
        Shape of the window, and rows and columns of the field in it, if it is a part.

    Attributes
    ----------
    source : str
        ``"edges"``, or ``"nodes"``: the values of the solution at the nodes, joined linearly.
    sheared : bool
        Whether the shear traction goes to the edges, too; else it is that of the nodes.
    """

    def __init__(
        self,
        parts: Array,
        basis: Array,
        start: tuple[float, float],
        source: Source = "edges",
        whole: tuple[tuple[int, ...], _Part] | None = None,
    ) -> None:
        self._parts, self._basis, self._start, self._whole = parts, basis, start, whole
        self.source, self.sheared = source, parts.shape[-1] == _LIMITED

    @classmethod
    def of_nodes(cls, tractions: Array, basis: Array, start: tuple[float, float]) -> Self:
        """Return the field of p, q_x and q_y at the nodes, joined linearly; see `ContactEdges`."""
        parts = np.stack([*tractions, tractions[0], np.full_like(tractions[0], np.nan)])
        return cls(parts.T, basis.T, start, "nodes")

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return p, q_x and q_y (Pa) at points (m), shape (3, ...); 0 outside the window."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        where = self._basis, self._start, self._parts
        found = called(_api.tractions_at_points, *where, x.ravel(), y.ravel())
        return np.asarray(found).reshape(3, *x.shape) + 0.0  # no sign on zero

    def at_nodes(self) -> Array:
        """Return p, q_x and q_y (Pa) at the nodes, shape (3, n_row, n_col)."""
        found = np.asarray(_api.tractions_at_nodes(self._parts).T)
        if self._whole is None:
            return found
        shape, part = self._whole
        whole = np.zeros((3, *shape))
        whole[:, *part] = found
        return whole


class ContactEdges:
    """The edges of a contact and of the stick area in it."""

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
        self._fields, self._zones = (pressure, gap), (contact, candidate)

    def contact(self) -> Edge:
        """Return the contact area."""
        return self._edge(self._whole())

    def stick(self, stick: Mask, reserve: Array) -> Edge:
        """Return the part of the contact area that sticks."""
        return self._edge(self._zone(stick, reserve, True))

    def contact_mesh(self, field: Array, vanishes: bool) -> ZoneMesh:
        """Return a mesh of the contact area, with a field up to its edge."""
        return self._mesh(self._whole(), field, vanishes)

    def stick_mesh(self, stick: Mask, reserve: Array) -> ZoneMesh:
        """Return a mesh of the part of the contact area that sticks, see `stick`."""
        return self._mesh(self._zone(stick, reserve, True), reserve, False)

    def contact_distances(self) -> Array:
        """Return the distances of the nodes from the edge of the contact, in spacings, positive inside."""
        return self._distances(self._whole())

    def stick_distances(self, stick: Mask, reserve: Array) -> Array:
        """Return the distances of the nodes from the edge of the part that sticks, see `stick`."""
        return self._distances(self._zone(stick, reserve, True))

    def field(
        self, shear: Array | None = None, stick: Mask | None = None, limits: Limits | None = None
    ) -> TractionField:
        """Return pressure and shear traction between the nodes, to the edges."""
        part = self._around_contact()
        limited = not (shear is None or stick is None or limits is None)
        count = _LIMITED if limited else _UNLIMITED
        none = np.zeros(self._zones[0][part].shape)
        if none.size > _LARGE:
            needed = 8 * none.size * (_GIVEN + 2 * count)
            memory.require(needed, "the tractions to the edges", 'choose source = "nodes"')
        pressure, gap, touching, candidate = (given[part] for given in (*self._fields, *self._zones))
        along = (none, none) if shear is None else (component[part] for component in shear)
        zones = np.stack([touching, candidate, none if stick is None else stick[part]]).astype(np.int32)
        known = [
            none + (np.asarray(limit)[part] if np.ndim(limit) else limit) for limit in limits or (0.0, 0.0)
        ]
        parts = called(
            *(_api.field_of_tractions, self._basis, gap.T, zones.T, np.stack([pressure, *along]).T),
            *(np.minimum(known, np.finfo(float).max).T, limited, count),
        )
        x, y = self._start + self._basis @ [part[1].start, part[0].start]
        return TractionField(parts, self._basis, (float(x), float(y)), whole=(self._zones[0].shape, part))

    def _around_contact(self) -> _Part:
        """Return rows and columns of the contact and of the nodes about it, beyond which there is nothing."""
        places = [np.flatnonzero(self._zones[0].any(axis=axis)) for axis in (1, 0)]
        if not places[0].size:
            return slice(0, 1), slice(0, 1)
        rows, cols = (slice(max(k[0] - _MARGIN, 0), k[-1] + 1 + _MARGIN) for k in places)
        return rows, cols

    def tractions(self, shear: Array, stick: Mask, friction: Array, pair: ElasticPair) -> Array:
        """Return pressure and shear tractions corrected at the edges of the contact and of the stick area."""
        pressure, gap = self._fields
        _, zones, _ = self._zone(stick, gap, True)
        given = np.stack([pressure, *shear]).T
        lambdas = pair.as_array()
        return np.asarray(
            called(_api.tractions_to_edges, self._basis, lambdas, gap.T, zones, friction.T, given, 0).T
        )

    def stress(
        self,
        shear: Array,
        stick: Mask,
        friction: Array,
        corrected: Array,
        body: int,
        poisson_ratio: float,
        points: Array,
    ) -> tuple[Array, float]:
        """Return the stress (Pa) that hats of the corrected tractions miss next to the edges."""
        pressure, gap = self._fields
        _, zones, _ = self._zone(stick, gap, True)
        given = np.stack([pressure, *shear]).T
        fields = gap.T, zones, friction.T, given, corrected.T
        found, refused = called(
            _api.stress_to_edges, self._basis, self._start, *fields, body, poisson_ratio, points.T, 0
        )
        return np.asarray(found.T), float(refused)

    def _whole(self) -> _Zone:
        return self._zone(self._zones[0], self._fields[0], False)

    def _zone(self, nodes: Mask, reserve: Array, sticks: bool) -> _Zone:
        fields, zones = np.stack([*self._fields, reserve]), np.stack([*self._zones, nodes])
        return fields.T, zones.T.astype(np.int32), sticks

    def _edge(self, zone: _Zone) -> Edge:
        numbers, segments, count = called(
            _api.edge_of_zone,
            *(self._basis, self._start, *zone),
            _api.count_cut_triangles(zone[1][..., 2]),
        )
        area, radius, length, major, minor, angle, x, y = numbers.tolist()
        return Edge(area, radius, length, segments.T[:count], Ellipse(major, minor, angle, (x, y)))

    def _mesh(self, zone: _Zone, field: Array, vanishes: bool) -> ZoneMesh:
        inside = zone[1][..., 2]
        nodes, cut = int(inside.sum()), _api.count_cut_triangles(inside)
        room = nodes + 3 * cut, 2 * nodes + 3 * cut  # a cut triangle has at most three points and parts
        points, values, triangles, (n_point, n_triangle) = called(
            _api.mesh_of_zone, self._basis, self._start, *zone, field.T, vanishes, *room
        )
        x, y = points[:, :n_point]
        return ZoneMesh(x, y, values[:n_point], triangles.T[:n_triangle].astype(np.intp) - 1)

    def _distances(self, zone: _Zone) -> Array:
        return np.asarray(called(_api.distances_of_zone, self._basis, *zone).T)
