"""Surfaces of a deck before it is run: measured maps and profiles, else the gap, with the window."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import Array
from ..deck.measured import Measured
from ..text import counted, scaled
from .maps import Part
from .registry import figure
from .style import EDGED, EXACT, legend_below, new_figure, set_title

_WIDTH, _HEIGHT = 4.8, 4.2  # inches of a panel
_ENDS = np.min, np.max
_POINTS = 201  # along a side of the gap, if no surface was measured


@figure("surface", "measured surfaces, or the gap, and the window, of a deck", needs="a deck")
def surface(case: Any) -> Figure:
    """Draw the measured surfaces of a case, each as it lies in the plane, or the gap if there are none.

    Parameters
    ----------
    case : hexcontact.Case
        A case.
    """
    both = enumerate(case.surfaces.surfaces, 1)
    maps = [(number, one) for number, part in both for one in part.measured]
    canvas = new_figure(_WIDTH * max(len(maps), 1), _HEIGHT)
    canvas.set_layout_engine("compressed")
    panels = canvas.subplots(1, max(len(maps), 1), squeeze=False)[0]
    for axes, (number, one) in zip(panels, maps, strict=False):
        axes.set_title(f"body {number}: {one}")
        (_line if one.extruded else _map)(axes, one, case)
    if not maps:
        _gap(panels[0], case)
    set_title(canvas, case.title)
    return canvas


def _map(axes: Axes, one: Measured, case: Any) -> None:
    """Draw the heights of a map where it is measured or repeats; points without one are gray, or marked."""
    found, touch = one.placed("").map, case.surfaces.first_touch[:2]
    (x, y), gap = (found.x + one.offset[0], found.y + one.offset[1]), found.gap  # type: ignore[operator]
    u, v, z, _ = one.points
    row, col = np.nonzero(np.isnan(z) & (one.holes == "fill"))
    filled = u[row] + one.offset[0], v[col] + one.offset[1]  # type: ignore[operator]
    if case.period:
        x, y = _sides(case)
        gap = one.height(*np.meshgrid(x, y, indexing="ij"))
        filled, touch = (
            tuple(at[0] + np.mod(p - at[0], np.ptp(at)) for p, at in zip(point, (x, y), strict=True))
            for point in (filled, touch)
        )
    shown = -gap if one.upwards else gap
    _colored(axes, x, y, shown, "height" if one.upwards else "gap", case, touch, filled)


def _sides(case: Any) -> tuple[Array, ...]:
    """Return points (m) along x and along y over the rectangle about the window."""
    return tuple(np.linspace(at.min(), at.max(), _POINTS) for at in case.lattice.outline.T)


def _gap(axes: Axes, case: Any) -> None:
    """Draw the gap over the rectangle about the window."""
    x, y = _sides(case)
    # of rough surfaces, that over the period of the window
    gap = case.plane_gap.at(*np.meshgrid(x, y, indexing="ij"))
    col, row = np.unravel_index(np.nanargmin(gap), gap.shape)
    _colored(axes, x, y, gap, "gap", case, (x[col], y[row]))


def _colored(
    axes: Axes,
    x: Array,
    y: Array,
    values: Array,
    words: str,
    case: Any,
    touch: Sequence[float],
    filled: tuple[Array, ...] = (),
) -> None:
    """Draw values over the plane, with the window, the point of first touch and filled holes."""
    shown = np.ma.masked_invalid(values)
    times, unit = scaled(float(shown.max() - shown.min()), "m")
    u, v = case.lattice.outline.T
    x_min, x_max, y_min, y_max = (float(end(np.append(a, b))) for a, b in ((x, u), (y, v)) for end in _ENDS)
    part = Part((x_min, x_max, y_min, y_max), *scaled(x_max - x_min, "m"))
    scale = part.factor
    part.show(axes)
    if part.is_tall:
        cast(Figure, axes.figure).set_figheight(part.size()[1])
    axes.set_facecolor("0.7")
    drawn = axes.pcolormesh(x * scale, y * scale, times * shown.T, shading="nearest", rasterized=True)
    part.bar(axes.figure, drawn, axes, f"{words} ({unit})", below=part.is_wide)
    axes.plot(u * scale, v * scale, color="w", path_effects=EDGED, label="window")
    axes.plot(touch[0] * scale, touch[1] * scale, "+", color=EXACT, ms=9, label="first touch")
    if filled and filled[0].size:
        holes: dict[str, Any] = {"mfc": "k", "mec": "w", "mew": 0.4, "ms": 3.5}
        holes["label"] = f"{counted(filled[0].size, 'hole')} filled"
        axes.plot(filled[0] * scale, filled[1] * scale, "o", **holes)
    legend_below(axes, ncols=3, fontsize=8)


def _line(axes: Axes, one: Measured, case: Any) -> None:
    """Draw a profile across its direction, with the width of the window."""
    placed = one.placed("")
    _, across = placed.own(*case.lattice.outline.T)
    y, gap = placed.map.y, placed.map.gap[0]
    if case.period:
        y = np.linspace(across.min(), across.max(), _POINTS)
        gap = one.height(*placed.in_plane(0.0 * y, y))
    height = -gap if one.upwards else gap
    scale, length = scaled(float(np.ptp(y)), "m")
    times, unit = scaled(float(np.ptp(height[np.isfinite(height)])), "m")
    axes.plot(scale * y, times * height)
    for end in (across.min(), across.max()):
        axes.axvline(scale * end, color=EXACT, lw=0.8, ls="--")
    words = "height" if one.upwards else "gap"
    angle = math.degrees(one.direction)
    axes.set(ylabel=f"{words} ({unit})", xlabel=f"across {angle:.3g}° from x ({length}); dashed: window")
