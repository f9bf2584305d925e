"""The window of lattice nodes that a case needs: as the deck says, else from an estimate of the contact.

The estimate solves the frictionless problem, for the largest load of the history, on a coarse lattice that is
first enlarged until the contact lies inside and then refined until the contact is some sixteen nodes across
where it is narrowest. That works for any shape; nothing here assumes Hertz. All bounds are kept in lattice
coordinates (lengths along the two basis vectors), because the window is a rhombus and the smallest rhombus
about a contact is found there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import reals
from ..core.contact import ElasticPair, NormalContact
from ..core.lattice import Lattice
from ..deck.faults import MISSING, Mistake
from ..deck.tables import Grid
from ..deck.units import readable

Array = NDArray[np.float64]
GapFunction = Callable[[Array, Array], Array]
"""Initial gap (m) at arrays of points; inf where nothing can touch."""

START_NODES = 32
NARROW_NODES = 8  # coarse spacings in the smaller half-width of the contact: good to a few per cent
MOST_COARSE_NODES = 40_000
MOST_TRIALS = 24  # coarse solutions; a contact that is a line has no end and would go on for ever
MOST_ENLARGEMENTS = 12
MARGIN = 2  # nodes of the window between the estimated contact and the rim
GROWTH = 0.25
MOST_NODES_PER_SIDE = 100_000


class NoContactFound(Exception):
    """The estimate found no bounded contact; the message says why, without a key."""


@dataclass(frozen=True)
class Estimate:
    """Where the contact is, roughly.

    Attributes
    ----------
    radius : float
        Radius (m) of the disc as large as the contact area.
    half_width : float
        Smaller semi-axis (m) of the ellipse with the second moments of the contact area.
    lower, upper : ndarray, (2,)
        Smallest and largest lattice coordinates (m along the first and second basis vector, from the origin)
        of nodes that are in contact.
    cell : float
        Coarse spacing (m); the edge of the contact lies within one cell of the bounds.
    size : ndarray, (2,)
        Extent (m) of the contact in x and in y.
    """

    radius: float
    half_width: float
    lower: Array
    upper: Array
    cell: float
    size: Array

    @property
    def bounds(self) -> Array:
        """Smallest and largest lattice coordinates (m), in columns, of what may be in contact."""
        return np.stack([self.lower - self.cell, self.upper + self.cell], axis=1)

    def joined(self, other: Estimate) -> Estimate:
        """Return an estimate that covers both: the larger radius, the union of the bounds."""
        larger = self if self.radius >= other.radius else other
        return Estimate(
            larger.radius,
            larger.half_width,
            np.minimum(self.lower - self.cell, other.lower - other.cell) + larger.cell,
            np.maximum(self.upper + self.cell, other.upper + other.cell) - larger.cell,
            larger.cell,
            np.maximum(self.size, other.size),
        )


# --- lattice coordinates ------------------------------------------------------------------------------------


def lattice_coordinates(
    x: Array | float, y: Array | float, origin: tuple[float, float]
) -> tuple[Array, Array]:
    """Return the coordinates (m) of points along the two basis vectors of the lattice, from its origin."""
    basis = Lattice(1.0, 0, 0, 1, 1).basis
    inverse = np.linalg.inv(basis)
    dx, dy = np.asarray(x, float) - origin[0], np.asarray(y, float) - origin[1]
    return dx * inverse[0, 0] + dy * inverse[1, 0], dx * inverse[0, 1] + dy * inverse[1, 1]


def centered(
    spacing: float, center: tuple[float, float], shape: tuple[int, int], origin: tuple[float, float]
) -> Lattice:
    """Return the window of `shape` (n_row, n_col) about the node nearest to `center`.

    An odd count puts that node in the middle; of an even count, one node more lies on the negative side.
    """
    along, across = lattice_coordinates(*center, origin)
    col, row = round(float(along) / spacing), round(float(across) / spacing)
    return Lattice(spacing, row - shape[0] // 2, col - shape[1] // 2, *shape, origin=origin)


def enclosing(
    lower: Array, upper: Array, spacing: float, margin: int, origin: tuple[float, float]
) -> Lattice:
    """Return the smallest window about all nodes between two lattice coordinates, and `margin` nodes more."""
    first = [math.floor(value / spacing) - margin for value in lower]
    last = [math.ceil(value / spacing) + margin for value in upper]
    return Lattice(spacing, first[1], first[0], last[1] - first[1] + 1, last[0] - first[0] + 1, origin=origin)


def covering(window: Lattice, spacing: float, origin: tuple[float, float]) -> Lattice:
    """Return the smallest window of another lattice about all nodes of a window."""
    moved = np.array(lattice_coordinates(*window.origin, origin))
    first = np.array([window.col_first, window.row_first])
    last = first + np.array([window.n_col, window.n_row]) - 1
    slack = 1e-9 * spacing  # nodes that both have in common stay the rim, whatever the rounding
    lower, upper = (window.spacing * index + moved for index in (first, last))
    return enclosing(lower + slack, upper - slack, spacing, 0, origin)


def rim_sides(contact: NDArray[np.bool_]) -> tuple[bool, bool, bool, bool]:
    """Tell where a contact reaches the rim of its window: first row, last row, first column, last column."""
    return (
        bool(contact[0].any()),
        bool(contact[-1].any()),
        bool(contact[:, 0].any()),
        bool(contact[:, -1].any()),
    )


def grown(lattice: Lattice, sides: tuple[bool, bool, bool, bool] = (True, True, True, True)) -> Lattice:
    """Return a larger window with the same nodes: a quarter more (four at least) on each given side."""
    rows = max(4, math.ceil(GROWTH * lattice.n_row))
    cols = max(4, math.ceil(GROWTH * lattice.n_col))
    return lattice.grown(*(n * side for n, side in zip((rows, rows, cols, cols), sides, strict=True)))


# --- the estimate -------------------------------------------------------------------------------------------


def estimate_contact(
    pair: ElasticPair,
    gap: GapFunction,
    center: tuple[float, float],
    origin: tuple[float, float],
    **drive: float,
) -> Estimate:
    """Find the contact roughly, under a normal load (N) or at an approach (m).

    Parameters
    ----------
    pair : ElasticPair
        The materials.
    gap : callable
        Initial gap over the plane.
    center, origin : (float, float)
        A point near the contact, and a lattice node.
    **drive : float
        `normal_load` or `approach`, above zero.

    Raises
    ------
    NoContactFound
        If nothing touches, or if the contact has no end.
    """
    half = _starting_half_size(pair, gap, center, **drive)
    lattice = centered(2.5 * half / START_NODES, center, (START_NODES + 1, START_NODES + 1), origin)
    enclosed, enlargements = False, 0
    for _ in range(MOST_TRIALS):
        contact = _solve(pair, gap, lattice, **drive)
        if contact is None or not contact.any():
            # Under load control there is always contact; at an approach the nodes may have missed it.
            lattice = centered(lattice.spacing / 4, center, lattice.shape, origin)
            continue
        if any(sides := rim_sides(contact)):
            if enclosed:
                lattice = grown(lattice, sides)
            elif (enlargements := enlargements + 1) > MOST_ENLARGEMENTS:
                break
            else:
                lattice = centered(2 * lattice.spacing, center, lattice.shape, origin)
            continue
        enclosed = True
        estimate = _measure(lattice, contact)
        if estimate.half_width >= NARROW_NODES * lattice.spacing:
            return estimate
        factor = min(max(math.ceil(NARROW_NODES * lattice.spacing / estimate.half_width), 2), 8)
        cell = lattice.spacing
        finer = enclosing(estimate.lower - cell, estimate.upper + cell, cell / factor, 1, origin)
        if finer.n_row * finer.n_col > MOST_COARSE_NODES:
            return estimate
        lattice = finer
    raise NoContactFound("the contact has no end, or nothing touches")


def _starting_half_size(
    pair: ElasticPair,
    gap: GapFunction,
    center: tuple[float, float],
    normal_load: float | None = None,
    approach: float = 0.0,
) -> float:
    """Guess the contact radius: where the gap reaches the approach, or 2 E* a h(a) carries the load."""
    radii = 10.0 ** np.linspace(-12, 4, 161)
    angles = 0.1 + np.linspace(0, 2 * math.pi, 16, endpoint=False)
    x = center[0] + radii[:, None] * np.cos(angles)
    y = center[1] + radii[:, None] * np.sin(angles)
    with np.errstate(all="ignore"):
        height = reals(gap(x, y), "gap")
        height = np.where(np.isfinite(height), height, np.inf)
        # The median over the directions: some of them may lie outside of a punch or along a groove.
        profile = np.median(height, axis=1) - height.min()
        if normal_load is not None:
            inside = 2 * pair.effective_modulus * radii * profile < normal_load
        else:
            inside = profile < approach
    if inside[-1]:
        raise NoContactFound("the contact has no end")
    if not (inside.any() or np.isfinite(height[0]).any()):
        raise NoContactFound("nothing can touch at the center")
    return float(radii[np.flatnonzero(inside)[-1] + 1] if inside.any() else radii[0])


def _solve(pair: ElasticPair, gap: GapFunction, lattice: Lattice, **drive: Any) -> NDArray[np.bool_] | None:
    """Return the nodes in contact of a rough frictionless solution, or None if no node can touch."""
    height = np.asarray(gap(lattice.x, lattice.y), float)
    candidate = np.isfinite(height)
    if not candidate.any():
        return None
    height = np.where(candidate, height, 0.0)
    contact = NormalContact(lattice, pair, height, candidate, threads=1)
    return np.asarray(contact.solve(**drive, tolerance=1e-4).pressure > 0)


def _measure(lattice: Lattice, contact: NDArray[np.bool_]) -> Estimate:
    rows, cols = np.nonzero(contact)
    x, y = lattice.x[contact], lattice.y[contact]
    area = lattice.cell_area * len(rows)
    moments = np.cov(np.stack([x, y]), bias=True) + np.eye(2) * lattice.cell_area / 12  # a cell's own inertia
    half_width = 2 * math.sqrt(max(float(np.linalg.eigvalsh(moments)[0]), 0.0))
    indices = np.array([cols + lattice.col_first, rows + lattice.row_first]) * lattice.spacing
    return Estimate(
        radius=math.sqrt(area / math.pi),
        half_width=half_width,
        lower=indices.min(axis=1),
        upper=indices.max(axis=1),
        cell=lattice.spacing,
        size=np.array([np.ptp(x), np.ptp(y)]) + lattice.spacing,
    )


# --- the window ---------------------------------------------------------------------------------------------


def is_fixed(grid: Grid) -> bool:
    """Tell whether the deck gives the size of the window, so that it must not grow."""
    return grid.window is not None or grid.extent != "auto"


def window(grid: Grid, center: tuple[float, float], estimate: Estimate) -> Lattice:
    """Return the window that a deck asks for, given an estimate of the contact.

    ``extent = "auto"`` gives the smallest rhombus about the estimated contact (its bounds plus one coarse
    cell, since the edge lies somewhere in it) with a margin of two nodes.
    """
    lower, upper = estimate.bounds.T
    spacing = grid.spacing or (estimate.radius / grid.nodes_in_radius if grid.nodes_in_radius else None)
    if spacing is not None:
        if grid.window is not None:
            return centered(spacing, center, grid.window, grid.origin)
        if isinstance(grid.extent, tuple):
            return Lattice.covering(spacing, center, *grid.extent, origin=grid.origin)
        return enclosing(lower, upper, spacing, MARGIN, grid.origin)

    nodes = grid.nodes_across or 0  # one of the three is always given
    shape = (nodes, nodes)
    if isinstance(grid.extent, tuple):
        lower, upper = _corners(center, grid.extent, grid.origin)
        margin = 0
    else:
        center_coordinates = (lower + upper) / 2
        center = tuple(grid.origin + center_coordinates @ Lattice(1.0, 0, 0, 1, 1).basis)
        margin = MARGIN if nodes >= 11 else 1
    # Half a spacing may be lost where the middle is no node; try without first.
    for intervals in (nodes - 1 - 2 * margin, nodes - 2 - 2 * margin):
        lattice = centered(float(np.max(upper - lower)) / intervals, center, shape, grid.origin)
        if not _outside(lattice, lower, upper):
            break
    return lattice


def _corners(
    center: tuple[float, float], extent: tuple[float, float], origin: tuple[float, float]
) -> tuple[Array, Array]:
    """Return the bounds of a rectangle in lattice coordinates."""
    x = center[0] + extent[0] / 2 * np.array([-1, 1, -1, 1])
    y = center[1] + extent[1] / 2 * np.array([-1, -1, 1, 1])
    coordinates = np.stack(lattice_coordinates(x, y, origin))
    return coordinates.min(axis=1), coordinates.max(axis=1)


def _outside(lattice: Lattice, lower: Array, upper: Array) -> bool:
    """Tell whether bounds in lattice coordinates reach out of a window."""
    slack = 1e-9
    first = np.array([lattice.col_first, lattice.row_first])
    last = first + np.array([lattice.n_col, lattice.n_row]) - 1
    return bool(
        np.any(lower / lattice.spacing < first - slack) or np.any(upper / lattice.spacing > last + slack)
    )


def check(grid: Grid, lattice: Lattice, estimate: Estimate) -> list[Mistake]:
    """Return what is wrong with a window: too coarse or too small for the contact, or beyond all bounds."""
    problems = []
    given = "spacing" if grid.spacing else "nodes_across" if grid.nodes_across else "nodes_in_radius"
    size = "window" if grid.window is not None else "extent" if grid.extent != "auto" else given
    if max(lattice.shape) > MOST_NODES_PER_SIDE:
        sentence = f"expected at most {MOST_NODES_PER_SIDE} nodes along a side, not {max(lattice.shape)}"
        problems.append(Mistake(("grid", given), getattr(grid, given), sentence))
    if lattice.spacing > estimate.half_width:
        sentence = f"the spacing of {readable(lattice.spacing)} is larger than the contact: "
        sentence += f"expected a spacing well below its half-width of about {readable(estimate.half_width)}"
        problems.append(Mistake(("grid", given), getattr(grid, given), sentence))
    if is_fixed(grid) and _outside(lattice, estimate.lower, estimate.upper):
        if size == "extent":
            length_x, length_y = (readable(1.1 * float(length)) for length in estimate.size)
            needed = f'["{length_x}", "{length_y}"]'
        else:
            needed_window = enclosing(estimate.lower, estimate.upper, lattice.spacing, MARGIN, grid.origin)
            needed = f"[{needed_window.n_row}, {needed_window.n_col}] nodes"
        sentence = (
            f"the window is smaller than the contact, or beside it: expected at least {needed} about it"
        )
        problems.append(Mistake(("grid", size), getattr(grid, size, MISSING), sentence))
    return problems
