"""A table [[stress]] or [[fatigue]] of which only the file is at hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ..arrays import Array
from ..text import scaled, worded
from .below import LEVELS, colored_values, draw_tables, map_of, mark_worst, section_of
from .registry import figure
from .style import new_figure, set_title

if TYPE_CHECKING:
    import xarray

_COLUMNS = 3  # maps beside each other


@figure("table", "the file of one table of stresses or fatigue", needs="a table")
def table(table: xarray.Dataset) -> Figure:
    """Draw a table of a deck: curves along a line or at points, maps of a plane or of a depth.

    Parameters
    ----------
    table : xarray.Dataset
        The dataset of a file of stresses or fatigue parameters.

    Returns
    -------
    matplotlib.figure.Figure
    """
    title, _, name = str(table.attrs["title"]).rpartition(": ")
    if {"distance", "point"} & table.sizes.keys():
        return draw_tables([(name, table)], title)
    fields = [_worst(field) for field in table.data_vars.values() if field.attrs["units"] != "rad"]
    columns = min(_COLUMNS, len(fields))
    rows = -(-len(fields) // columns)
    places = [_places(field) for field in fields]
    height = max(float(np.ptp(along) / np.ptp(across)) for across, along, _ in places)
    canvas = new_figure(3.6 * columns + 0.2, (2.9 * height + 1.5) * rows + 0.4)
    panels = canvas.subplots(rows, columns, squeeze=False).ravel()
    for axes, field, (across, along, words) in zip(panels, fields, places, strict=False):
        values, _, scale = colored_values(field)
        drawn = axes.contourf(across, along, values, LEVELS, cmap=map_of(field))
        mark_worst(axes, across, along, field, values)
        axes.set(**words, aspect="equal", title=_place(field))
        if words["ylabel"].startswith("depth"):
            axes.invert_yaxis()
        canvas.colorbar(drawn, ax=axes, location="bottom", shrink=0.9, **scale)
    for axes in panels[len(fields) :]:
        axes.set_visible(False)
    set_title(canvas, f"{title}: {name}, body {table.attrs['body']}")
    return canvas


def _worst(field: xarray.DataArray) -> xarray.DataArray:
    """Return a field at the step and depth of the value that counts."""
    word = "least" if field.name == "life" else "largest"
    for name in ("step", "depth"):
        if name in field.sizes:
            values = np.where(np.isfinite(field), field, np.nan)
            axes = tuple(k for k, dimension in enumerate(field.dims) if dimension != name)
            ends = np.nanmin(values, axis=axes) if word == "least" else np.nanmax(values, axis=axes)
            field = field.isel({name: int(np.nanargmin(ends) if word == "least" else np.nanargmax(ends))})
    return field


def _places(field: xarray.DataArray) -> tuple[Array, Array, dict[str, str]]:
    """Return the coordinates of a map in a unit, with the labels of the axes."""
    if np.ptp(field["depth"].values) > 0.0:
        return section_of(field)
    x, y = field["x"].values, field["y"].values
    factor, unit = scaled(float(max(abs(x).max(), abs(y).max())), "m")
    return x * factor, y * factor, {"xlabel": f"x ({unit})", "ylabel": f"y ({unit})"}


def _place(field: xarray.DataArray) -> str:
    """Name step and depth of a map."""
    words = [f"step {int(field['step'])}"] if "step" in field.coords else []
    if not np.ptp(field["depth"].values):
        words.append(f"depth {worded(float(np.ravel(field['depth'])[0]), 'm')}")
    return ", ".join(words)
