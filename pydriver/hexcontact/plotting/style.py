"""Colors, sizes and legends that all figures share."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from typing import Any, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.legend import Legend
from matplotlib.patheffects import Normal, Stroke
from matplotlib.transforms import ScaledTranslation

from ..arrays import Array

# the Okabe-Ito palette, for any color vision
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "black")
COMPUTED, EXACT, THIRD, _, _, IN_CONTACT, _ = PALETTE
GUIDE = "0.55"
EDGED = [Stroke(linewidth=2.4, foreground="black"), Normal()]
_NAMED = 10  # labels of a color scale
_PASSES = 8  # of the layout at most; three to five are usual
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "figure.titlesize": 10,
    "axes.grid": False,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "image.cmap": "viridis",
    "savefig.dpi": 200,
}


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure; width and height in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def panels_of(part: Figure | SubFigure, count: int, columns: int, **options: Any) -> list[Axes]:
    """Return panels in rows of some columns; those that the last row has left over are hidden."""
    panels = list(part.subplots(-(-count // columns), columns, squeeze=False, **options).flat)
    for axes in panels[count:]:
        axes.set_visible(False)
    return panels[:count]


def new_panels(count: int, columns: int, *size: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels: their width, their height, and the room for title and legend in inches."""
    width, height, room = size
    canvas = new_figure(width * columns, height * -(-count // columns) + room)
    return canvas, panels_of(canvas, count, columns)


def drawing(ax: Axes | None, width: float, height: float, equal: bool = False) -> tuple[Figure, Axes]:
    """Return the axes of the caller with their figure, or new ones of a size in inches.

    New axes may be for equal scales of x and y.
    """
    if ax is not None:
        # of a subfigure, the whole figure; get_figure(root=True) came with matplotlib 3.10
        return cast(Any, ax.figure).figure, ax
    figure = Figure(figsize=(width, height), layout="compressed" if equal else "constrained")
    return figure, figure.add_subplot()


def settle(figure: Figure) -> None:
    """Repeat the layout of a figure until its axes stay in place; labels may be beyond the edge before."""
    engine = figure.get_layout_engine()
    for _ in range(_PASSES if engine is not None else 0):
        before = [axes.get_position(original=True).bounds for axes in figure.axes]
        cast(Any, engine).execute(figure)
        after = [axes.get_position(original=True).bounds for axes in figure.axes]
        if np.allclose(before, after, rtol=0.0, atol=1e-3):
            break


def set_title(figure: Figure, title: str, ax: Axes | None = None) -> Figure:
    """Return a figure with its title, on as many lines as needed; axes of the caller have none."""
    if title and ax is None:
        width = int(13.0 * figure.get_size_inches()[0])  # characters, about
        loads = re.search(r" \(\$.*$", title)  # on one line, or each on one
        start, end = (title[: loads.start()], title[loads.start() :]) if loads else (title, "")
        start = re.sub(r"step (\d+)$", "step\u00a0\\1", start)
        end = end[:1] + re.sub(" " if len(end) <= width else "(?<!,) ", "\u00a0", end[1:])
        lines = textwrap.wrap(start + end, width, break_long_words=False, break_on_hyphens=False)
        figure.suptitle("\n".join(lines).replace("\u00a0", " "))
    return figure


def largest(*values: Any) -> float:
    """Return the largest finite magnitude of some values, 0 if there is none."""
    sizes = np.abs(np.concatenate([np.ravel(one) for one in values]))
    return float(sizes[np.isfinite(sizes)].max(initial=0.0))


def zero_lines(axes: Axes) -> None:
    """Draw thin lines through the origin."""
    axes.axhline(0.0, color=GUIDE, lw=0.5, zorder=0)
    axes.axvline(0.0, color=GUIDE, lw=0.5, zorder=0)


def titled(words: str, unit: str) -> str:
    """Return the label of an axis: a quantity and its unit, if it has one."""
    return f"{words} ({unit})" if unit else words


def legend_below(axes: Axes, **options: Any) -> None:
    """Draw a legend below the label of the x axis, for axes of any height."""
    lines = 1 + axes.get_xlabel().count("\n")
    down = ScaledTranslation(0.0, -0.26 - 0.16 * lines, axes.figure.dpi_scale_trans)
    below = {"bbox_to_anchor": (0.5, 0.0), "bbox_transform": axes.transAxes + down}
    axes.legend(loc="upper center", **below, **options)


def legend_under(figure: Figure, handles: Sequence[Any], ax: Axes | None = None, size: float = 9) -> Legend:
    """Draw a legend below a figure, or below axes of the caller, in as many columns as fit."""
    room = figure.bbox.width if ax is None else 1.1 * ax.get_window_extent().width
    for columns in range(min(4, len(handles)), 0, -1):
        options: dict[str, Any] = {"ncols": columns, "handlelength": 1.6, "fontsize": size}
        if ax is None:
            legend = figure.legend(handles=handles, loc="outside lower center", **options)
        else:
            legend_below(ax, handles=handles, **options)
            legend = cast(Legend, ax.get_legend())
        if legend.get_window_extent().width < 0.98 * room:
            break
        if columns > 1:
            legend.remove()
    return legend


def color_scale(
    figure: Figure | SubFigure, panels: Sequence[Axes], labels: Sequence[str], colors: Sequence[Any]
) -> None:
    """Draw a color scale beside panels with labels of the curves, of many curves only some."""
    count = len(labels)
    norm = BoundaryNorm(np.arange(count + 1) - 0.5, count)
    shown = np.unique(np.round(np.linspace(0, count - 1, min(count, _NAMED))).astype(int))
    scale = ScalarMappable(norm, ListedColormap(list(colors)))
    bar = figure.colorbar(scale, ax=list(panels), aspect=40, pad=0.02, ticks=shown)
    bar.set_ticklabels([labels[k] for k in shown])
    bar.minorticks_off()
    bar.ax.tick_params(length=0)
    cast(Any, bar.outline).set_linewidth(0.5)


def handles_of(*panels: Axes) -> list[Any]:
    """Return the handles of the legends of panels, one for each label."""
    found: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    return list(found.values())


def legend_above(axes: Axes) -> None:
    """Draw a legend directly above axes."""
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)


def shades(count: int) -> Sequence[Any]:
    """Return colors of a family of curves, from dark to light."""
    map_ = matplotlib.colormaps["viridis"]
    return [map_(0.88 * k / max(count - 1, 1)) for k in range(count)]


def mark_largest(axes: Axes, x: Array, y: Array, values: Array, label: str = "largest") -> None:
    """Mark the point of the largest value by a cross that is seen on every color."""
    place = np.unravel_index(np.nanargmax(values), values.shape)
    look: dict[str, Any] = {"color": "white", "path_effects": EDGED, "zorder": 5, "clip_on": False}
    axes.plot(x[place], y[place], "+", label=label, **look)
