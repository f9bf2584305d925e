"""The window of lattice nodes of a case, by its deck or an estimate of the contact, with its faults.

The core searches for the contact under the largest load of the history on coarse lattices without friction
(fortran/path/contact_search.f90). All bounds are in lattice coordinates (lengths along the two basis
vectors), since the window is a parallelogram.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, Mask
from ..core import flat
from ..core.contact import UNILATERAL, ElasticPair, Interface, rough_pressure
from ..core.friction import ACCEPTED, PENDING
from ..core.lattice import Lattice, Pattern
from ..deck.faults import Mistake
from ..deck.height_map import BEYOND_MAP, Placed, along_axes, place
from ..deck.keys import Grid
from ..deck.kinds import MOST_SLENDER
from ..deck.units import readable
from ..errors import DeckError
from .plane_field import PlaneField

Found = Iterator[tuple[tuple[str | int, ...], str]]
"""Key and sentence of each mistake in a deck."""
GapFunction = Callable[[Array, Array], Array]
"""Initial gap (m) at arrays of points; inf where nothing can touch."""

GOOD_SPACINGS = 20  # in the half-width of the contact, for messages
_RIGHT = 1e-6  # rounding of a right angle
_FULL = 0.8  # share of its ellipse from which a contact is neither a ring nor spots
ROUND = 0.95  # ratio of the semi-axes from which a contact has no direction
MARGIN = 2  # nodes of the window between the estimated contact and the rim
MOST_NODES_PER_SIDE = 100_000
# Search for contact outside of a window.
_TRIED = 121  # points along a side of a grid
_GRIDS = 7  # about a window; their widths double
_LOWEST = 200  # points about which lower ones are looked for
_HALVINGS = 3  # of their distances
_ROUNDED = 1e-9  # of places, in spacings
_LOADS = 24  # along a side of a window, in place of the pressure
_OVERLAP = 0.99  # share of the penetration that counts, since displacements are those of the pressure alone
# Decimal logarithms of the stiffness of an interface over that of the bodies.
SOFTEST, STIFFEST = -30.0, 12.0
DEEPEST = 12.0  # ... of the penetration under a normal load over the size of the contact


class NoContactFound(Exception):
    """Raised without a bounded contact; the message is the reason, without a key."""


class Estimate(NamedTuple):
    """Rough place and size of the contact."""

    radius: float  # radius (m) of the disc as large as the contact area
    half_width: float  # smaller semi-axis (m) of the ellipse with the second moments of the contact area
    # smallest and largest lattice coordinates (m along the first and second basis vector, from the origin) of
    # nodes in contact, (2,)
    lower: Array
    upper: Array
    cell: float  # coarse spacing (m); the edge of the contact is within one cell of the bounds
    size: Array  # extent (m) of the contact in x and in y, (2,)
    max_pressure: float  # largest pressure (Pa); infinite where it rises to an end of a surface
    slope: float = 0.0  # largest slope of the gap within the contact
    # those of the surfaces of body 1 and body 2; empty if only their gap is known
    body_slopes: tuple[float, ...] = ()
    half_length: float = 0.0  # larger semi-axis (m) of that ellipse
    angle: float = 0.0  # its direction from x (rad)
    breadth: float = math.inf  # of a ring or of spots: twice the area over the length of the edge (m)

    def along(self, direction: float) -> float:
        """Return the semi-axis (m) of the ellipse nearer to a direction (rad)."""
        return self.half_length if abs(math.cos(self.angle - direction)) > math.sqrt(0.5) else self.half_width

    def spacings(self, lattice: Lattice) -> float:
        """Return the spacings in the semi-axis of the ellipse that has the fewest."""
        if lattice.cell_ratio == 1.0 or abs(lattice.cell_angle - math.pi / 2) > _RIGHT:
            return self.half_width / lattice.spacing
        first = self.along(lattice.direction)
        across = self.half_length * self.half_width / first
        return min(first, across / lattice.cell_ratio) / lattice.spacing

    def fitted(self, pattern: Pattern, direction: float | None) -> Pattern:
        """Return a lattice whose rectangular cells are as slender as the contact."""
        if direction is None:
            # its first axis is the one nearer to x; a round contact has no direction
            turned = math.degrees((self.angle + math.pi / 4) % (math.pi / 2) - math.pi / 4)
            direction = (
                0.0 if self.half_width > ROUND * self.half_length else math.radians(round(2 * turned) / 2)
            )
        across = self.half_length * self.half_width / self.along(direction)
        ratio = min(max(across / self.along(direction), 1.0 / MOST_SLENDER), MOST_SLENDER)
        return pattern._replace(cell_ratio=ratio, direction=direction)

    @property
    def bounds(self) -> Array:
        """Smallest and largest lattice coordinates (m), in columns, of the possible contact."""
        return np.stack([self.lower - self.cell, self.upper + self.cell], axis=1)

    def joined(self, other: Estimate) -> Estimate:
        """Return an estimate that covers both: the larger radius, the union of the bounds."""
        larger = self if self.radius >= other.radius else other
        return larger._replace(
            lower=np.minimum(self.lower - self.cell, other.lower - other.cell) + larger.cell,
            upper=np.maximum(self.upper + self.cell, other.upper + other.cell) - larger.cell,
            size=np.maximum(self.size, other.size),
        )


# --- lattice coordinates ------------------------------------------------------------------------------------


def covering(window: Lattice, spacing: float, pattern: Pattern) -> Lattice:
    """Return the smallest window of another lattice about all nodes of a window."""
    moved = np.array(pattern.coordinates(*window.origin))
    first = np.array([window.col_first, window.row_first])
    last = first + np.array([window.n_col, window.n_row]) - 1
    slack = 1e-9 * spacing  # nodes that both have in common stay the rim, whatever the rounding
    lower, upper = (window.spacing * index + moved for index in (first, last))
    return pattern.enclosing(lower + slack, upper - slack, spacing)


# --- the estimate -------------------------------------------------------------------------------------------


def estimate_contact(
    pair: ElasticPair,
    gap: GapFunction,
    center: tuple[float, float],
    pattern: Pattern,
    interface: Interface = UNILATERAL,
    heights: Sequence[GapFunction] = (),
    share: Callable[[Mask, Lattice], Array] | None = None,
    **drive: float,
) -> Estimate:
    """Estimate the contact under a normal load (N) or at an approach (m)."""
    half = starting_half_size(pair, gap, center, **drive)
    search = flat.begin_search(half, pattern.coordinates(*center), pattern.cell_ratio)
    while search.verdict == PENDING:
        size = map(int, (search.row_first, search.col_first, search.n_row, search.n_col))
        lattice = pattern.window(search.spacing, *size)
        x, y = lattice.x, lattice.y
        height = np.asarray(gap(x, y), float)
        pressure = rough_pressure(lattice, pair, height, interface, **drive)
        search = flat.judge_pressure(search, lattice, pressure)
    if search.verdict != ACCEPTED:
        raise NoContactFound("the contact has no end, or nothing touches")
    surfaces = [height, *(surface(x, y) for surface in heights)]
    slope, *body_slopes = (_steepest(each, lattice, pressure > 0) for each in surfaces)
    inside = np.isfinite(height)
    ends = share(inside, lattice) if share else inside.astype(float)
    unbounded = interface == UNILATERAL and flat.is_unbounded(ends, pressure)
    xx, yy, xy = search.moment_xx, search.moment_yy, search.moment_xy
    # the principal second moments, with the inertia of a cell itself
    mean, apart, cell = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy), lattice.cell_area / 12
    half_width, half_length = (2 * math.sqrt(max(mean + sign * apart + cell, 0.0)) for sign in (-1, 1))
    radius = math.sqrt(lattice.cell_area * search.n_contact / math.pi)
    is_full = radius**2 > _FULL * half_length * half_width
    return Estimate(
        radius=radius,
        half_width=half_width,
        lower=np.array([search.lower_1, search.lower_2]),
        upper=np.array([search.upper_1, search.upper_2]),
        cell=lattice.spacing,
        size=np.array([search.size_x, search.size_y]),
        max_pressure=math.inf if unbounded else search.max_pressure,
        slope=slope,
        body_slopes=tuple(body_slopes),
        half_length=half_length,
        angle=0.5 * math.atan2(2 * xy, xx - yy),
        breadth=math.inf if is_full else search.breadth,
    )


def starting_half_size(
    pair: ElasticPair,
    gap: GapFunction,
    center: tuple[float, float],
    normal_load: float | None = None,
    approach: float = 0.0,
) -> float:
    """Guess the contact radius: there the gap reaches the approach, or 2 E* a h(a) the load."""
    radii = 10.0 ** np.linspace(-12, 4, 161)
    angles = 0.1 + np.linspace(0, 2 * math.pi, 16, endpoint=False)
    x = center[0] + radii[:, None] * np.cos(angles)
    y = center[1] + radii[:, None] * np.sin(angles)
    with np.errstate(all="ignore"):
        height = np.asarray(gap(x, y), float)
        height = np.where(np.isfinite(height), height, np.inf)
        # the median over the directions, some of which may lie outside of a punch or along a groove
        # (not by numpy.median, which imports numpy.ma); at the end of a surface the lowest direction
        middle = slice(angles.size // 2 - 1, angles.size // 2 + 1)
        sides = np.sort(height, axis=1)
        for profile in (sides[:, middle].mean(axis=1), sides[:, 0]):
            rise = profile - height.min()
            if normal_load is not None:
                inside = 2 * pair.effective_modulus * radii * rise < normal_load
            else:
                inside = rise < approach
            if inside.any():
                break
    if inside[-1]:
        raise NoContactFound("the contact has no end")
    if not (inside.any() or np.isfinite(height[0]).any()):
        raise NoContactFound("nothing can touch at the center, where no height is finite")
    return float(radii[np.flatnonzero(inside)[-1] + 1] if inside.any() else radii[0])


def _steepest(height: Array, lattice: Lattice, contact: Mask) -> float:
    """Return the largest slope of a surface within the contact."""
    heights = np.where(contact, height, np.nan)
    across = lattice.spacing * lattice.cell_ratio
    return max(
        float(np.nanmax(np.abs(np.diff(heights, axis=axis)), initial=0.0)) / side
        for axis, side in ((0, across), (1, lattice.spacing))
    )


# --- the interface ------------------------------------------------------------------------------------------


def check_interface(
    interface: Interface,
    pair: ElasticPair,
    size: float,
    full: bool,
    normal_load: float | None = None,
    approach: float = 0.0,
) -> tuple[list[float], list[tuple[tuple[str, str], str]]]:
    """Compare the stiffness of an interface with that of the bodies, E*/size.

    That of the interface is dp/dψ at the pressure P/size^2, or at a penetration as large as the approach.
    """
    coefficient, exponent, springs = interface
    bodies, power, least = math.log10(pair.effective_modulus / size), 1.0, SOFTEST
    if normal_load is None:
        normal = math.log10(coefficient) + (exponent - 1.0) * math.log10(approach)
    else:
        pressure, power = math.log10(normal_load) - 2.0 * math.log10(size), exponent
        normal = math.log10(coefficient) / exponent + (1.0 - 1.0 / exponent) * pressure
        least = max(SOFTEST, math.log10(exponent / size) + pressure - bodies - DEEPEST)
    found = [("coefficient", coefficient, normal + math.log10(exponent) - bodies, least, power)]
    if springs:
        found.append(("tangential_stiffness", springs, math.log10(springs) - bodies, SOFTEST, 1.0))
    problems = []
    for key, given, ratio, low, power in found:
        bound = min(max(ratio, low), STIFFEST if full else math.inf)
        if ratio != bound:
            needed = math.log10(given) + (bound - ratio) * power
            limit = f"least 1e{math.ceil(needed)}" if ratio < bound else f"most 1e{math.floor(needed)}"
            sentence = (
                f"expected at {limit}: the interface has 1e{ratio:.0f} times the stiffness of the bodies"
            )
            problems.append((("interface", key), sentence))
    return [ratio for _, _, ratio, _, _ in found], problems


# --- the window ---------------------------------------------------------------------------------------------


def is_fixed(grid: Grid) -> bool:
    """Test whether the deck gives the size of the window, which then does not grow."""
    return grid.window is not None or grid.extent != "auto"


def pattern_of(grid: Grid) -> Pattern:
    """Return the lattice of a deck but for its spacing."""
    return Pattern(grid.origin, grid.ratio, grid.angle, grid.direction or 0.0)


def repeating(grid: Grid) -> tuple[Lattice, list[Mistake]]:
    """Return the window of a deck that repeats, about the center, and its faults."""
    pattern, center = pattern_of(grid), grid.center or (0.0, 0.0)
    if isinstance(grid.extent, str):
        assert grid.length is not None
        assert grid.window is not None  # checked, one of the two is given
        spacing, (n_row, n_col) = grid.length, grid.window
        key, value = "window", grid.window
    else:
        n_col, n_row = (
            grid.nodes_across or max(round(length / (size * (grid.length or 1.0))), 1)
            for length, size in zip(grid.extent, (1.0, grid.ratio), strict=True)
        )
        # the period is exact, and the cells follow from it
        spacing = grid.extent[0] / n_col
        pattern = pattern._replace(cell_ratio=grid.extent[1] / n_row / spacing)
        key = "nodes_across" if grid.nodes_across else "spacing"
        value = getattr(grid, key)
    problems = []
    if n_col % 4:
        fitting = max(4 * round(n_col / 4), 4)
        sentence = (
            f"expected a multiple of four columns in a window that repeats, such as {fitting}, not {n_col}"
        )
        if key == "spacing":
            sentence += f': a spacing of "{readable(spacing * n_col / fitting)}"'
        problems.append(Mistake(("grid", key), value, sentence))
    if max(n_row, n_col) > MOST_NODES_PER_SIDE:
        sentence = f"expected at most {MOST_NODES_PER_SIDE} nodes along a side, not {max(n_row, n_col)}"
        problems.append(Mistake(("grid", key), value, sentence))
    return replace(pattern.centered(spacing, center, (n_row, n_col)), periodic=True), problems


def sides(lattice: Lattice) -> tuple[float, float] | None:
    """Return the sides (m) of a window along x and y; None if they lie in other directions."""
    first, second = lattice.basis * [[lattice.n_col], [lattice.n_row]]
    straight = max(abs(first[1]), abs(second[0])) < _RIGHT * min(abs(first[0]), abs(second[1]))
    return (abs(float(first[0])), abs(float(second[1]))) if straight else None


def seam_fault(gap: Array) -> str:
    """Return the fault of a gap (m) with a step between opposite sides of its period; empty without one.

    A step is a larger change than those between neighboring columns, or rows.
    """
    if not np.isfinite(gap).all():
        return "the gap of a window that repeats has nodes that cannot touch; expected heights everywhere"
    for axis, name in ((1, "columns"), (0, "rows")):
        steps = np.abs(np.diff(gap, axis=axis))
        first, last = np.take(gap, [0], axis=axis), np.take(gap, [-1], axis=axis)
        seam, most = float(np.abs(first - last).max()), float(steps.max(initial=0.0))
        if seam > 1.001 * most + 1e-9 * float(np.ptp(gap)):
            return (
                f"the gap does not repeat with the window: between its opposite ends it steps by "
                f"{readable(seam)}, between neighboring {name} by {readable(most)} at most"
            )
    return ""


def window(grid: Grid, center: tuple[float, float], estimate: Estimate) -> Lattice:
    """Return the window of a deck, given an estimate of the contact.

    ``extent = "auto"`` is the smallest parallelogram about the estimated contact (its bounds plus the coarse
    cell with the edge) with a margin of two nodes.
    """
    lower, upper = estimate.bounds.T
    pattern = pattern_of(grid)
    spacing = grid.length or (estimate.radius / grid.in_radius if grid.in_radius else None)
    if grid.fits:
        assert grid.in_radius is not None
        pattern = estimate.fitted(pattern, grid.direction)
        spacing = estimate.spacings(pattern.window(1.0, 0, 0, 1, 1)) / grid.in_radius
    if spacing is not None:
        if grid.window is not None:
            return pattern.centered(spacing, center, grid.window)
        if isinstance(grid.extent, tuple):
            return Lattice.covering(spacing, center, grid.extent[0], grid.extent[1], *pattern)
        return pattern.enclosing(lower, upper, spacing, MARGIN)

    nodes = grid.nodes_across or 0  # one of the three is always given
    shape = (nodes, nodes)
    if isinstance(grid.extent, tuple):
        corners = np.stack(pattern.coordinates(*_rectangle(center, grid.extent)))
        lower, upper = corners.min(axis=1), corners.max(axis=1)
        margin = 0
    else:
        center_coordinates = (lower + upper) / 2
        center = tuple(grid.origin + center_coordinates @ pattern.window(1.0, 0, 0, 1, 1).basis)
        margin = MARGIN if nodes >= 11 else 1
    # half a spacing may be lost if the middle is no node; the first attempt is without
    for intervals in (nodes - 1 - 2 * margin, nodes - 2 - 2 * margin):
        lattice = pattern.centered(float(np.max(upper - lower)) / intervals, center, shape)
        if not _outside(lattice, lower, upper):
            break
    return lattice


def _beyond_maps(grid: Grid, lattice: Lattice, maps: Sequence[Placed]) -> Found:
    """Yield the faults of a given window that reaches beyond maps of heights."""
    if isinstance(grid.extent, tuple):
        key, center = "extent", grid.center
        middle = lattice.origin + np.array([np.mean(lattice.cols), np.mean(lattice.rows)]) @ lattice.basis
        x, y = _rectangle(center or tuple(middle), grid.extent)
    else:
        key, (col, row) = "window", np.meshgrid(lattice.cols[[0, -1]], lattice.rows[[0, -1]])
        x, y = (lattice.origin + np.stack([col.ravel(), row.ravel()], axis=1) @ lattice.basis).T
    for one in maps:
        at, own = np.stack(one.own(x, y)), (one.map.x, one.map.y)
        beyond = [axis for axis in one.axes if one.is_beyond(axis, at[axis])]
        if not beyond:
            continue
        moved, names = along_axes(one.offset, one.angle), "st" if one.angle else "xy"
        theirs, ours = (
            " and ".join(
                f"{names[i]} from {readable(low + moved[i])} to {readable(high + moved[i])}"
                for i, low, high in ((i, ends[i].min(), ends[i].max()) for i in beyond)
            )
            for ends in (at, own)
        )
        sizes, of_map = np.ptp(at, axis=1), [float(np.ptp(points)) for points in own]
        swapped = not one.extruded and sizes[0] <= of_map[1] and sizes[1] <= of_map[0]
        sentence = (
            f"the window is larger than the map of {one.name}: {theirs}, the map {ours} only; expected "
        )
        sentence += "a smaller one, or heights of a larger part" + "; are x and y swapped?" * bool(swapped)
        yield ("grid", key), sentence


def _rectangle(center: tuple[float, float], extent: tuple[float, float]) -> tuple[Array, Array]:
    """Return the corners (m) of a rectangle."""
    x = center[0] + extent[0] / 2 * np.array([-1, 1, -1, 1])
    y = center[1] + extent[1] / 2 * np.array([-1, -1, 1, 1])
    return x, y


def _outside(lattice: Lattice, lower: Array, upper: Array) -> bool:
    """Test whether bounds in lattice coordinates reach out of a window."""
    slack = 1e-9
    first = np.array([lattice.col_first, lattice.row_first])
    last = first + np.array([lattice.n_col, lattice.n_row]) - 1
    return bool(
        np.any(lower / lattice.spacing < first - slack) or np.any(upper / lattice.spacing > last + slack)
    )


def check(grid: Grid, lattice: Lattice, estimate: Estimate, maps: Sequence[Placed]) -> Found:
    """Yield the faults of a window, and of maps of heights that end within it or within the contact."""
    given = (
        "spacing" if grid.spacing is not None else "nodes_across" if grid.nodes_across else "nodes_in_radius"
    )
    size = "window" if grid.window is not None else "extent" if grid.extent != "auto" else given
    if max(lattice.shape) > MOST_NODES_PER_SIDE:
        least = readable(lattice.spacing * max(lattice.shape) / MOST_NODES_PER_SIDE * 1.01)
        sentence = f"expected at most {MOST_NODES_PER_SIDE} nodes along a side, not {max(lattice.shape)}: "
        sentence += f"a spacing of {least} or more"
        yield ("grid", given), sentence
    if estimate.spacings(lattice) < 1.0:
        sentence = f"the spacing of {readable(lattice.spacing)} is larger than the contact: "
        fitting = readable(estimate.half_width / GOOD_SPACINGS)
        sentence += f"expected a spacing well below its half-width of about {readable(estimate.half_width)}, "
        sentence += f'such as "{fitting}"'
        yield ("grid", given), sentence
    if is_fixed(grid) and _outside(lattice, estimate.lower, estimate.upper):
        if size == "extent":
            length_x, length_y = (readable(1.1 * float(length)) for length in estimate.size)
            needed = f'["{length_x}", "{length_y}"]'
        else:
            about = lattice.pattern.enclosing(estimate.lower, estimate.upper, lattice.spacing, MARGIN)
            needed = f"[{about.n_row}, {about.n_col}] nodes"
        sentence = (
            f"the window is smaller than the contact, or beside it: expected at least {needed} about it"
        )
        yield ("grid", size), sentence
    if is_fixed(grid):
        yield from _beyond_maps(grid, lattice, maps)
    if not maps or math.isfinite(estimate.max_pressure):
        return
    middle = lattice.origin + estimate.bounds.mean(axis=1) / lattice.spacing @ lattice.basis
    x, y = _rectangle(tuple(middle), tuple(estimate.size))
    for one in maps:
        if one.is_near_end(estimate.cell, x, y):
            yield tuple(one.name.split(".")), f"the estimated contact {BEYOND_MAP}"


# --- contact that a window misses ---------------------------------------------------------------------------


class Surroundings(NamedTuple):
    """Points outside of a window, and the smallest gap within it."""

    points: Array  # x, y and the gap (m) in rows
    lowest: float  # gap (m)


def surroundings(gap: PlaneField, lattice: Lattice) -> Surroundings:
    """Return points where other contacts may lie: of grids, and of lower places between their points."""
    size = np.array([lattice.n_col, lattice.n_row])
    first = np.array([lattice.col_first, lattice.row_first])
    middle = lattice.origin + (first + (size - 1) / 2) @ lattice.basis
    half = np.maximum(size - 1, 1)[:, None] / 2 * lattice.basis
    sides = np.linspace(-1.0, 1.0, _TRIED)
    square = np.stack(np.meshgrid(sides, sides), axis=-1)
    grids = [middle + square @ (half * 2.0**level) for level in range(_GRIDS)]
    grids += [one.offset + one.detail * square for one in gap.shapes if one.detail]
    grids += [one.lowest_points(_TRIED, middle) for one in gap.maps]
    found, valleys, cells = [np.empty((3, 0))], [np.empty((3, 0))], [np.empty((0, 2, 2))]
    for grid in grids:
        try:
            points = np.stack([*np.moveaxis(grid, -1, 0), gap.at(grid[..., 0], grid[..., 1])])
        except (DeckError, ValueError):  # it is known near the window only
            continue
        found.append(points.reshape(3, -1))
        valleys.append(points[:, 1:-1, 1:-1][:, _is_valley(points[2])])
        cell = (grid[-1, 0] - grid[0, 0]) / (len(grid) - 1), (grid[0, -1] - grid[0, 0]) / (grid.shape[1] - 1)
        cells.append(np.broadcast_to(np.stack(cell), (valleys[-1].shape[1], 2, 2)))
    low = np.concatenate(valleys, axis=1)
    if low.size:
        chosen = np.argsort(low[2])[:_LOWEST]
        found.append(_lower(gap, low[:, chosen], np.concatenate(cells)[chosen]))
    points = np.concatenate(found, axis=1)
    along = np.stack(lattice.pattern.coordinates(*points[:2]), axis=1) / lattice.spacing
    inside = ((along > first - _ROUNDED) & (along < first + size - 1 + _ROUNDED)).all(axis=1)
    return Surroundings(points[:, ~inside], float(points[2, inside].min(initial=math.inf)))


def _is_valley(gap: Array) -> Mask:
    """Return which inner points of a grid no neighbor is lower than; of equal ones along a row, the first."""
    rows, cols = (count - 2 for count in gap.shape)
    inner = gap[1:-1, 1:-1]
    around = [gap[i : i + rows, j : j + cols] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    return np.isfinite(inner) & (inner <= np.minimum.reduce(around)) & (inner < around[3])


def _lower(gap: PlaneField, points: Array, cells: Array) -> Array:
    """Return lower points near those of grids whose cells have two sides (n, 2, 2) [m]."""
    sides = np.linspace(-1.0, 1.0, 5)
    square = np.stack(np.meshgrid(sides, sides), axis=-1).reshape(-1, 2)
    for _ in range(_HALVINGS):
        near = points[:2].T[:, None] + square @ cells
        height = gap.at(near[..., 0], near[..., 1])
        least = np.arange(len(near)), height.argmin(axis=1)
        points, cells = np.stack([*near[least].T, height[least]]), cells / 2
    return points


def missed_contact(around: Surroundings, step: Any, moduli: tuple[float, float], reach: float) -> str:
    """Return the fault of bodies that also touch outside of the window of a load step; empty without one.

    Within the reach (m) of a load the first of the moduli E* (Pa) holds, beyond it the second. The bodies
    overlap where the gap is below the approach less the displacement by the pressure
    (fortran/path/beyond_window.f90).
    """
    approach = around.lowest + _OVERLAP * (float(step.approach) - around.lowest)
    near = around.points[:, around.points[2] < approach].T
    if not near.size or around.lowest == math.inf:
        return ""
    window = step.lattice
    # loads are about as far apart across and along a slender window
    slender = math.sqrt(window.n_col / (window.n_row * window.cell_ratio))
    counts = [
        max(min(round(_LOADS * ratio), n), 1)
        for ratio, n in ((slender, window.n_col), (1.0 / slender, window.n_row))
    ]
    loads = sum(
        flat.point_loads(rows, band, rows.row_first - window.row_first, window.n_row, *counts)
        for rows, band in step.bands("pressure")
    )
    most = flat.overlap_beyond(near, loads, approach, moduli, reach)
    if not most:
        return ""
    x, y, _ = near[most - 1]
    there = place(float(x), float(y))
    return (
        f"the bodies also touch outside of the window, near {there}; expected lengths that hold all of the "
        "contact, and center in its middle"
    )
