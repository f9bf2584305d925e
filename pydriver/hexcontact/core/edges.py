"""Edges of contact and stick areas between the nodes, by the core.

The distance of a node from the edge follows from the decay of tractions: fortran/measures/contact_edges.f90.
Lattice arrays have shape (n_row, n_col).
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, Mask
from . import flat, memory
from .contact import ElasticPair
from .friction import FrictionLaw
from .lattice import Lattice, Nodes

_UNLIMITED, _LIMITED = 5, 11  # arrays of a traction field
_GIVEN = 12  # arrays that it is made from, with copies and zones
_LARGE = 250_000  # nodes from which their memory is checked
_MARGIN = 6  # nodes about a contact from which its edge follows, at most, and one more

_Part = tuple[slice, slice]
Source = Literal["edges", "nodes"]
_FRICTIONLESS = FrictionLaw(0.0)


class Edge(NamedTuple):
    """An area of the plane whose edge runs between the nodes, with the half-axes of its second moments."""

    area: float
    radius: float
    length: float
    semi_major: float
    semi_minor: float
    segments: Array


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
        corners, number, count = flat.outline_of_zone(self.triangles + 1, self.x.size)
        points = np.stack([self.x, self.y], axis=1)[corners[:count] - 1]
        polygons = np.split(points, np.flatnonzero(np.diff(number[:count])) + 1)
        return [np.append(polygon, polygon[:1], axis=0) for polygon in polygons]


class TractionField:
    """Pressure and shear traction of a contact over the plane.

    They vanish like square roots at the edge of the contact, and the reserve of friction does at the edge of
    the stick area, both between the nodes; elsewhere they are linear. `parts` is the field as the core holds
    it, on `nodes`; `whole` has the shape of the window, and rows and columns of the field in it, if it is a
    part.

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
        nodes: Lattice | Nodes,
        friction: FrictionLaw = _FRICTIONLESS,
        source: Source = "edges",
        whole: tuple[tuple[int, ...], _Part] | None = None,
    ) -> None:
        self._parts, self._nodes, self._friction, self._whole = parts, nodes, friction, whole
        self.source, self.sheared = source, len(parts) == _LIMITED

    @classmethod
    def of_nodes(cls, tractions: Array, nodes: Lattice | Nodes) -> Self:
        """Return the field of p, q_x and q_y at the nodes, joined linearly; see `ContactEdges`."""
        parts = np.stack([*tractions, tractions[0], np.full_like(tractions[0], np.nan)])
        return cls(parts, nodes, source="nodes")

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return p, q_x and q_y (Pa) at points (m), shape (3, ...); 0 outside a window that ends."""
        found = flat.tractions_at_points(self._nodes, self._parts, self._friction, x, y)
        return np.ascontiguousarray(np.moveaxis(found, -1, 0)) + 0.0  # no sign on zero

    def at_nodes(self) -> Array:
        """Return p, q_x and q_y (Pa) at the nodes, shape (3, n_row, n_col)."""
        found = np.asarray(flat.tractions_at_nodes(self._parts, self._friction))
        if self._whole is None:
            return found
        shape, part = self._whole
        whole = np.zeros((3, *shape))
        whole[:, *part] = found
        return whole


class ContactEdges:
    """The edges of a contact and of the stick area in it.

    Nodes are in contact, and can touch (`candidate`). Where a contact ends at nodes that cannot, as at the
    rim of a punch, its pressure does not vanish, and its edge is that of the cells of its nodes. Basis
    vectors of the lattice are rows, `start` is the position of node [0, 0].
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
        self.nodes = Nodes(basis, start, pressure.shape)
        self.pressure, self.gap, self.touching, self.candidate = pressure, gap, contact, candidate

    def edge(self, *stick: Any) -> Edge:
        """Return the contact area; or the part that sticks, by its nodes and the reserve mu p - |q| there."""
        zone = self._zone(*stick)
        edge, segments, count = flat.edge_of_zone(self, *zone, flat.count_cut_triangles(zone[0]))
        return Edge(**edge._asdict(), segments=segments[:count])

    def mesh(self, field: Array, vanishes: bool, *stick: Any) -> ZoneMesh:
        """Return a mesh of an area as of `edge`, with a field up to its edge, where tractions vanish."""
        zone = self._zone(*stick)
        nodes, cut = int(zone[0].sum()), flat.count_cut_triangles(zone[0])
        room = nodes + 3 * cut, 2 * nodes + 3 * cut  # a cut triangle has at most three points and parts
        points, values, triangles, (n_point, n_triangle) = flat.mesh_of_zone(
            self, *zone, field, vanishes, *room
        )
        x, y = points[:n_point].T
        return ZoneMesh(x, y, values[:n_point], triangles[:n_triangle].astype(np.intp) - 1)

    def distances(self, *stick: Any) -> Array:
        """Return the distances of the nodes from an edge as of `edge`, in spacings, positive inside."""
        return np.asarray(flat.distances_of_zone(self, *self._zone(*stick)))

    def _zone(self, *stick: Any) -> tuple[Mask, Array, bool]:
        """Return nodes, reserve of friction (pressure of a contact), and whether it is the stick area."""
        return (stick[0], stick[1], True) if stick else (self.touching, self.pressure, False)

    def field(
        self, shear: Array | None = None, stick: Mask | None = None, friction: FrictionLaw | None = None
    ) -> TractionField:
        """Return pressure and shear traction between the nodes, to the edges.

        Without a law of friction whose bound is the same in all directions, or without nodes that stick, the
        shear traction is linear between the nodes.
        """
        part = self._around_contact()
        limited = not (shear is None or stick is None or friction is None)
        count = _LIMITED if limited else _UNLIMITED
        none = np.zeros(self.touching[part].shape)
        if none.size > _LARGE:
            needed = 8 * none.size * (_GIVEN + 2 * count)
            memory.require(needed, "the tractions to the edges", 'choose source = "nodes"')
        x, y = self.nodes.start + self.nodes.basis.T @ [part[1].start, part[0].start]
        arrays = self.pressure[part], self.gap[part], self.touching[part], self.candidate[part]
        near = ContactEdges(*arrays, self.nodes.basis, (float(x), float(y)))
        along = (none, none) if shear is None else (component[part] for component in shear)
        law = (friction or _FRICTIONLESS).on(part)
        sticking = none != 0 if stick is None else stick[part]
        parts = flat.field_of_tractions(near, sticking, np.stack([arrays[0], *along]), law, count)
        return TractionField(parts, near.nodes, law, whole=(self.nodes.shape, part))

    def _around_contact(self) -> _Part:
        """Return rows and columns of the contact and of the nodes about it, beyond which there is nothing."""
        places = [np.flatnonzero(self.touching.any(axis=axis)) for axis in (1, 0)]
        if not places[0].size:
            return slice(0, 1), slice(0, 1)
        rows, cols = (slice(max(k[0] - _MARGIN, 0), k[-1] + 1 + _MARGIN) for k in places)
        return rows, cols

    def tractions(self, shear: Array, stick: Mask, friction: FrictionLaw, pair: ElasticPair) -> Array:
        """Return tractions (Pa) corrected at the edges of the contact and of the stick area.

        Without friction, or with an infinite coefficient, the shear traction does not change. Loads
        are those of the nodal tractions; nodes next to the edge but outside carry small values.
        """
        given = np.stack([self.pressure, *shear])
        return np.asarray(flat.tractions_to_edges(self, stick, friction, pair, given))

    def stress(
        self,
        shear: Array,
        stick: Mask,
        friction: FrictionLaw,
        corrected: Array,
        body: int,
        poisson_ratio: float,
        points: Array,
    ) -> tuple[Array, float]:
        """Return the stress (Pa) that hats of the corrected tractions miss next to the edges.

        `corrected` is the result of `tractions`; points are x, y and depth below the surface of the body (m).
        The share of the edge of the contact near them follows where the pressure does not vanish like a
        root, so that nothing is corrected.
        """
        given = stick, friction, np.stack([self.pressure, *shear]), corrected
        found: tuple[Array, float] = flat.stress_to_edges(self, *given, body, poisson_ratio, points)
        return found
