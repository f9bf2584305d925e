"""Contact that a window misses: bodies that would overlap outside of it under the pressure within."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, Mask
from ..core import flat
from ..core.lattice import Lattice
from ..deck.height_map import place
from ..errors import DeckError
from .plane_field import PlaneField

_TRIED = 121  # points along a side of a grid
_GRIDS = 7  # about a window; their widths double
_LOWEST = 200  # points about which lower ones are looked for
_HALVINGS = 3  # of their distances
_ROUNDED = 1e-9  # of places, in spacings
_LOADS = 24  # along a side of a window, in place of the pressure
_OVERLAP = 0.99  # share of the penetration that counts, since displacements are those of the pressure alone


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
