"""Colors and sizes that all pictures share."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from ..result.raster import SLIP as SLIP
from ..result.raster import STICK as STICK

# the Okabe-Ito palette, which people with any color vision can tell apart
COMPUTED, EXACT, THIRD, GUIDE = "#0072B2", "#D55E00", "#009E73", "0.55"
IN_CONTACT = "#56B4E9"
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


def set_title(figure: Figure, title: str) -> None:
    """Put a title over a figure, on as many lines as it needs."""
    if title:
        width = int(13.0 * figure.get_size_inches()[0])  # characters, about
        loads = re.search(r" \(\$.*$", title)  # stay on one line
        start, end = (title[: loads.start()], title[loads.start() :]) if loads else (title, "")
        start = re.sub(r"step (\d+)$", "step\u00a0\\1", start)
        lines = textwrap.wrap(start + end.replace(" ", "\u00a0").replace("\u00a0", " ", 1), width)
        figure.suptitle("\n".join(lines).replace("\u00a0", " "))


def legend_below(axes: Axes, **options: Any) -> None:
    """Put a legend below the label of the x axis, however high the axes are."""
    down = ScaledTranslation(0.0, -0.42, axes.figure.dpi_scale_trans)
    below = {"bbox_to_anchor": (0.5, 0.0), "bbox_transform": axes.transAxes + down}
    axes.legend(loc="upper center", **below, **options)


def legend_above(axes: Axes) -> None:
    """Put a legend right above axes."""
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)


def shades(count: int) -> Sequence[Any]:
    """Colors of a family of curves, from dark to light."""
    map_ = matplotlib.colormaps["viridis"]
    return [map_(0.88 * k / max(count - 1, 1)) for k in range(count)]
