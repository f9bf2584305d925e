"""The lattice of nodes: positions, windows, transfer between windows, fields between the nodes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, Mask
from ..errors import DeckError
from ..text import quantity
from . import flat
from .calls import checked


class Nodes(NamedTuple):
    """Nodes from the first one: basis vectors, one a row, position of the first [m], rows and columns."""

    basis: Array
    start: tuple[float, float]
    shape: tuple[int, ...]
    periodic: bool = False  # the window repeats


class Pattern(NamedTuple):
    """A lattice but for its spacing: position of node (0, 0) [m], and its cells, as `Lattice` has them."""

    origin: tuple[float, float] = (0.0, 0.0)
    cell_ratio: float = 1.0
    cell_angle: float = math.pi / 3
    direction: float = 0.0

    def window(self, spacing: float, row_first: int, col_first: int, n_row: int, n_col: int) -> Lattice:
        """Return a window of it."""
        return Lattice(spacing, row_first, col_first, n_row, n_col, *self)

    def centered(self, spacing: float, center: tuple[float, float], shape: tuple[int, int]) -> Lattice:
        """Return the window of `shape` (n_row, n_col) about the node nearest to `center`.

        An odd count puts that node in the middle; of an even count, one node more lies on the negative side.
        """
        along, across = self.coordinates(*center)
        col, row = round(float(along) / spacing), round(float(across) / spacing)
        return self.window(spacing, row - shape[0] // 2, col - shape[1] // 2, *shape)

    def enclosing(self, lower: Array, upper: Array, spacing: float, margin: int = 0) -> Lattice:
        """Return the smallest window about all nodes between two coordinates, and `margin` nodes more."""
        first = [math.floor(value / spacing) - margin for value in lower]
        last = [math.ceil(value / spacing) + margin for value in upper]
        return self.window(spacing, first[1], first[0], last[1] - first[1] + 1, last[0] - first[0] + 1)

    def coordinates(self, x: Array | float, y: Array | float) -> tuple[Array, Array]:
        """Return the coordinates (m) of points along the two basis vectors, from node (0, 0)."""
        inverse = np.linalg.inv(self.window(1.0, 0, 0, 1, 1).basis)
        dx, dy = np.asarray(x, float) - self.origin[0], np.asarray(y, float) - self.origin[1]
        return dx * inverse[0, 0] + dy * inverse[1, 0], dx * inverse[0, 1] + dy * inverse[1, 1]


@dataclass(frozen=True)
class Lattice:
    """A window of a lattice, which is equilateral unless its cells are given.

    Node (row j, col i), with absolute integer indices, lies at ``origin + i*basis[0] + j*basis[1]``;
    fields over the window are arrays of shape ``(n_row, n_col)``.

    Parameters
    ----------
    spacing
        Distance of neighboring nodes along x, the length of the first basis vector [m].
    row_first, col_first
        Smallest row and column index.
    n_row, n_col
        Number of rows and columns.
    origin
        Position of node (0, 0) [m].
    cell_ratio
        Length of the second basis vector over that of the first.
    cell_angle
        Angle of the second basis vector from the first [rad].
    direction
        Angle of the first basis vector from x [rad].
    periodic
        Whether the window repeats along columns and rows.
    """

    spacing: float
    row_first: int
    col_first: int
    n_row: int
    n_col: int
    origin: tuple[float, float] = (0.0, 0.0)
    cell_ratio: float = 1.0
    cell_angle: float = math.pi / 3
    direction: float = 0.0
    periodic: bool = False

    def __post_init__(self) -> None:
        checked(**{name: value for name, value in vars(self).items() if name != "periodic"})
        if self.n_row < 1 or self.n_col < 1:
            raise DeckError(
                f"window = [{self.n_row}, {self.n_col}]: expected at least one row and one column"
            )

    @classmethod
    def covering(
        cls,
        spacing: float,
        center: tuple[float, float],
        length_x: float,
        length_y: float,
        origin: tuple[float, float] = (0.0, 0.0),
        cell_ratio: float = 1.0,
        cell_angle: float = math.pi / 3,
        direction: float = 0.0,
    ) -> Lattice:
        """Return the smallest window whose parallelogram covers a rectangle of a center and sides [m]."""
        pattern = Pattern(origin, cell_ratio, cell_angle, direction)
        half_x, half_y = 0.5 * length_x, 0.5 * length_y
        x, y = np.array([-half_x, half_x, -half_x, half_x]), np.array([-half_y, -half_y, half_y, half_y])
        corners = np.stack(pattern.coordinates(x + center[0], y + center[1]))
        slack = 1e-9 * spacing  # a row or column on the side belongs to the rectangle, whatever the rounding
        return pattern.enclosing(corners.min(axis=1) + slack, corners.max(axis=1) - slack, spacing)

    @property
    def pattern(self) -> Pattern:
        """The lattice but for spacing and window."""
        return Pattern(self.origin, self.cell_ratio, self.cell_angle, self.direction)

    def apart(self, angle: float) -> float:
        """Return the distance (m) of nodes along a direction (rad from x), as between the sides of a cell."""
        turned = angle - self.direction
        return self.spacing * math.hypot(math.cos(turned), self.cell_ratio * math.sin(turned))

    @property
    def cells(self) -> str:
        """The spacing in words, with the cells of a lattice that is not equilateral."""
        spacing, across = (quantity(self.spacing * ratio, "m") for ratio in (1.0, self.cell_ratio))
        if self.pattern[1:] == Pattern()[1:]:
            return spacing
        turned = f", first axis at {math.degrees(self.direction):.4g} deg" if self.direction else ""
        return f"{spacing} by {across}, at {math.degrees(self.cell_angle):.4g} deg{turned}"

    @cached_property
    def basis(self) -> Array:
        """Basis vectors, one a row [m]."""
        basis: Array = flat.lattice_basis(self.spacing, self.cell_ratio, self.cell_angle, self.direction)
        return basis

    @cached_property
    def cell_area(self) -> float:
        """Area of a lattice cell, the volume of a pyramid of height one [m^2]."""
        (a, b), (c, d) = self.basis.tolist()
        return float(a * d - b * c)

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Shape of a field over the window."""
        return (self.n_row, self.n_col)

    @cached_property
    def first(self) -> list[int]:
        """Smallest column and row index, as the core takes them."""
        return [self.col_first, self.row_first]

    @cached_property
    def extent(self) -> list[int]:
        """Number of columns and of rows, as the core counts them."""
        return [self.n_col, self.n_row]

    @cached_property
    def size(self) -> int:
        """Number of nodes."""
        return self.n_row * self.n_col

    @property
    def rows(self) -> NDArray[np.int64]:
        """Absolute row indices."""
        return np.arange(self.row_first, self.row_first + self.n_row)

    @property
    def cols(self) -> NDArray[np.int64]:
        """Absolute column indices."""
        return np.arange(self.col_first, self.col_first + self.n_col)

    @property
    def x(self) -> Array:
        """Coordinate of each node along x [m]."""
        return self._coordinate(0)

    @property
    def y(self) -> Array:
        """Coordinate of each node along y [m]."""
        return self._coordinate(1)

    @property
    def start(self) -> tuple[float, float]:
        """Position of the first node of the window [m]."""
        alone = replace(self, n_row=1, n_col=1)
        return alone.x.item(), alone.y.item()

    @property
    def outline(self) -> Array:
        """Closed outline of the window (m): corners in rows; of one that repeats, around its cells."""
        more = 0.5 * self.periodic
        col, row = ((at[0] - more, at[-1] + more) for at in (self.cols, self.rows))
        corners = [(col[i], row[j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]
        return np.asarray(self.origin + np.array(corners) @ self.basis)

    def _coordinate(self, axis: int) -> Array:
        along = self.cols * self.basis[0, axis]
        across = self.rows * self.basis[1, axis]
        return self.origin[axis] + across[:, None] + along[None, :]

    def grown(self, contact: Mask) -> Lattice:
        """Return a window with a quarter more nodes, four at least, on each side that a contact reaches."""
        low, extent = (each.tolist() for each in flat.grown_window(self, contact))
        row, col = self.row_first + low[1], self.col_first + low[0]
        return replace(self, row_first=row, col_first=col, n_row=extent[1], n_col=extent[0])

    def joined(self, *others: Lattice) -> Lattice:
        """Return the smallest window about this one and others of the same lattice."""
        first = np.array([(one.row_first, one.col_first, *one.shape) for one in (self, *others)])
        row, col = first[:, :2].min(axis=0).tolist()
        row_end, col_end = (first[:, :2] + first[:, 2:]).max(axis=0).tolist()
        return replace(self, row_first=row, col_first=col, n_row=row_end - row, n_col=col_end - col)

    def embed(self, field: NDArray[np.generic], other: Lattice, fill: float = 0.0) -> NDArray[np.generic]:
        """Return a field of this window on another one of the same lattice, whose other nodes are filled."""
        result = np.full(other.shape, fill, dtype=field.dtype)
        row, col = self.row_first - other.row_first, self.col_first - other.col_first
        top, left = max(row, 0), max(col, 0)
        bottom, right = min(row + self.n_row, other.n_row), min(col + self.n_col, other.n_col)
        if bottom > top and right > left:
            result[top:bottom, left:right] = field[top - row : bottom - row, left - col : right - col]
        return result


Point = tuple[float, float]


def linear(nodes: Lattice | Nodes, values: Array, x: ArrayLike, y: ArrayLike, outside: float = 0.0) -> Array:
    """Interpolate values at the nodes of a lattice linearly on its triangles.

    `outside` is the value at nodes outside the window. The result has the shape of the points x, y (m).
    """
    return np.asarray(flat.field_between_nodes(nodes, values, outside, x, y))


def nearest(
    nodes: Lattice | Nodes, values: NDArray[Any], x: ArrayLike, y: ArrayLike, outside: float
) -> Array:
    """Return the values at the nodes next to points; parameters as of `linear`."""
    col, row, inside = flat.nodes_next_to(nodes, x, y)
    return np.where(inside, values[row, col], outside).astype(float)


def section_ends(
    lattice: Lattice, pressure: Array, angle: float, through: Point | None
) -> tuple[Point, Point, float]:
    """Return the ends of a line across a contact at an angle (rad) from x, with a margin on both sides.

    The third value is the distance (m) of its zero from the first end: at the point `through`, by default at
    the node next to the center of pressure, or of a lattice that repeats the one with the largest pressure.
    """
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
