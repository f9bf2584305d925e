"""Tables [[stress]] and [[fatigue]] along lines and at points, as curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from ..arrays import Array
from ..errors import NotInResult
from ..interior.tables import at_hand, tables_of
from ..result.export import kept_steps
from ..result.result import Result
from ..result.view import title_of
from ..text import scaled, visible, worded
from ..variables import spelled
from .registry import figure
from .style import GUIDE, color_scale, new_figure, set_title, shades

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

_COLUMNS = 3  # panels beside each other
_LEGEND = 10  # curves of a legend at most
_NAMES = {
    "von_mises_stress": "von Mises stress",
    "tresca_stress": "Tresca stress",
    "smith_watson_topper": "Smith-Watson-Topper",
    "life": "cycles to a crack",
    "findley": "Findley",
    "fatemi_socie": "Fatemi-Socie",
    "crossland": "Crossland",
    "dang_van": "Dang Van",
    "ruiz_f1": "Ruiz $F_1$",
    "ruiz_f2": "Ruiz $F_2$",
}
# the Okabe-Ito palette; curves beyond it are dashed
_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "black")


@figure("lines", "tables along a line, or at points by step", needs="[[stress]] or [[fatigue]]")
def lines(result: Result | xarray.Dataset) -> Figure:
    """Draw the tables [[stress]] and [[fatigue]] of the deck along lines, and at points over the steps."""
    result = result if isinstance(result, Result) else Result(result)
    names = [name for name, table in tables_of(result.deck).items() if table.line or table.points]
    if not names:
        raise NotInResult("the deck has no table [[stress]] or [[fatigue]] of a line or of points")
    shown = list(at_hand(result, kept_steps(result), names))
    panels = [_panels(found) for _, found in shown]
    rows = [-(-len(of_table) // _COLUMNS) for of_table in panels]
    columns = min(_COLUMNS, max(map(len, panels)))
    canvas = new_figure(3.7 * columns + 0.6, sum(2.5 * n + 0.35 for n in rows) + 0.4)
    heights = [2.5 * n + 0.35 for n in rows]
    parts = canvas.subfigures(len(shown), 1, squeeze=False, height_ratios=heights)[:, 0]
    for part, (name, found), of_table in zip(parts, shown, panels, strict=True):
        _draw_table(part, name, found, of_table, columns)
    set_title(canvas, title_of(result.dataset))
    return canvas


def _panels(found: xarray.Dataset) -> list[list[str]]:
    """Return the quantities of each panel: those of one unit share it, if each is a single curve."""
    names = [str(name) for name, field in found.data_vars.items() if field.attrs.get("units") != "rad"]
    if "distance" not in found.sizes or found.sizes.get("step") != 1:  # several steps or points; fatigue
        return [[name] for name in names]
    units = dict.fromkeys(str(found[name].attrs["units"]) for name in names)
    return [[name for name in names if found[name].attrs["units"] == unit] for unit in units]


def _draw_table(
    part: SubFigure, name: str, found: xarray.Dataset, panels: Sequence[Sequence[str]], columns: int
) -> None:
    """Draw the panels of a table, with its name and place above."""
    grid = part.subplots(-(-len(panels) // columns), columns, squeeze=False).ravel()
    on_line = "distance" in found.sizes
    steps: list[int] = found["step"].values.tolist() if "step" in found.coords else []
    points = np.stack([np.ravel(found[axis]) for axis in ("x", "y", "depth")], axis=1)
    labels, where = [""], ""
    if on_line:
        place, words, where = _along(found)
        labels = [f"step {number}" for number in steps] if len(steps) > 1 else labels
    elif steps:
        place, words = np.array(steps, dtype=float), "load step"
        labels = [", ".join(_length(place) for place in point) for point in points.tolist()]
    else:
        place, words = np.arange(1.0, len(points) + 1.0), "point"
    for axes, names in zip(grid, panels, strict=False):
        curves = np.concatenate([found[name].values.reshape(-1, len(points)) for name in names])
        _draw_curves(axes, place, curves.T if steps and not on_line else curves, found[names[0]], len(names))
        axes.set_xlabel(words)
        if not on_line:
            axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        if len(names) > 1:
            _legend_beside(axes, [_named(name).removesuffix(" stress") for name in names])
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    if len(labels) > _LEGEND:
        color_scale(part, grid[: len(panels)].tolist(), labels, shades(len(labels)))
    elif len(labels) > 1:
        _legend_beside(grid[len(panels) - 1], labels, None if on_line else "x, y, depth")
    at = f"step {steps[0]}" if len(steps) == 1 else ""
    about = (visible(name).replace("$", r"\$"), f"body {found.attrs['body']}", at, where)
    part.suptitle(", ".join(filter(None, about)), fontsize=9)


def _draw_curves(axes: Axes, place: Array, curves: Array, field: xarray.DataArray, quantities: int) -> None:
    """Draw curves of a quantity in its unit; life on a logarithmic scale."""
    finite = curves[np.isfinite(curves)]
    units = str(field.attrs["units"])
    largest = float(abs(finite).max()) if finite.size else 0.0
    factor, unit = scaled(largest, units) if " " not in units else (1.0, units)
    colors = _COLORS if len(curves) in (1, quantities) else shades(len(curves))
    look: dict[str, Any] = {"lw": 1.2}
    if "distance" not in field.dims:
        look |= {"marker": "o" if place.size <= 60 else "", "ms": 3.0}
        look |= {} if "step" in field.dims else {"marker": "o", "ls": ""}
    for number, values in enumerate(curves):
        shown = np.where(np.isfinite(values), values * factor, np.nan)  # endless life has no place
        dash = {"ls": "--"} if colors is _COLORS and number >= len(colors) else {}
        axes.plot(place, shown, color=colors[number % len(colors)], **look | dash)
    named = _named(str(field.name)) if quantities == 1 else {"Pa": "stress", "m": "displacement"}[units]
    if field.name == "life":
        axes.set_yscale("log")
    else:
        axes.axhline(0.0, color=GUIDE, lw=0.6, zorder=0)
    axes.set_ylabel(f"{named} ({unit})" if unit else named)
    axes.grid(color="0.9", lw=0.5)


def _legend_beside(axes: Axes, labels: Sequence[str], title: str | None = None) -> None:
    """Name the curves on the right of axes."""
    axes.legend(labels, title=title, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)


def _along(found: xarray.Dataset) -> tuple[Array, str, str]:
    """Return the places along a line, the words of their axis, and the coordinates that do not change."""
    axes = {name: found[name].values for name in ("x", "y", "depth")}
    moving = [name for name, values in axes.items() if np.ptp(values) > 0.0]
    name = moving[0] if len(moving) == 1 else "distance"
    values = found[name].values
    factor, unit = scaled(float(abs(values).max()), "m")
    fixed = [f"{axis} = {_length(axes[axis][0])}" for axis in axes if axis not in moving]
    return values * factor, f"{name} ({unit})", ", ".join(fixed)


def _length(value: float) -> str:
    return worded(value, "m").replace("-", "\u2212")


def _named(name: str) -> str:
    """Return a quantity as axes and legends name it."""
    *words, last = name.split("_")
    head = {"stress": r"\sigma", "displacement": "u", "principal_stress": r"\sigma"}.get("_".join(words))
    return f"${head}_{{{last}}}$" if head else _NAMES.get(name, spelled(name))
