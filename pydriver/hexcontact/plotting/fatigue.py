"""Fatigue parameters of the tables [[fatigue]] of a deck: a map of the surface, and a section below it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from ..arrays import Array
from ..deck.below import Fatigue
from ..errors import NotInResult
from ..interior.tables import at_hand, tables_of
from ..result.result import Result
from ..result.view import StepView, title_of
from ..text import scaled
from .maps import mesh_of
from .plane import Part
from .registry import figure
from .style import EDGED, handles_of, legend_under, mark_largest, new_figure, set_title
from .zones import draw_zone_bars

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

_LEVELS = 12
_MARGIN = 1.5  # width of the map over that of the contact
_ENDLESS = 1e9  # cycles beyond which life is shown as endless


@figure("fatigue", "fatigue parameter and life on the surface and below it", needs="[[fatigue]]")
def fatigue(result: Result | xarray.Dataset, step: int | None = None) -> Figure:
    """Draw the first fatigue parameter of the deck and the life, at the surface and in a section below it.

    Parameters
    ----------
    step : int, optional
        Number of the load step whose contact and stick area are outlined; by default the last of the cycle.
    """
    result = result if isinstance(result, Result) else Result(result)
    tables = {name: table for name, table in tables_of(result.deck).items() if isinstance(table, Fatigue)}
    surface = next((name for name, table in tables.items() if table.where.get("depths") == (0.0,)), None)
    section = next((name for name, table in tables.items() if table.plane), None)
    shown = [name for name in (surface, section) if name]
    if not shown:
        raise NotInResult("the deck has no table [[fatigue]] of the surface or a plane")
    by_name = dict(at_hand(result, [], shown))
    first = next((name for name in tables[shown[0]].parameters if name != "life"), "life")
    first = "ruiz_f2" if first == "ruiz" else first
    drawn = [(table, _first_of(by_name[table], first)) for table in shown]
    if first != "life":
        drawn = [(table, field) for table, field in drawn if field.name != "life"]
        drawn += [(table, by_name[table]["life"]) for table in shown if "life" in by_name[table]]
    alike = [field for _, field in drawn if field.name == first]
    lowest, highest = min(map(np.nanmin, alike)), max(map(np.nanmax, alike))
    cycle = by_name[shown[0]].attrs["steps"]
    view = StepView.of(result, int(cycle[-1]) if step is None else step)

    columns = len(drawn) if len(drawn) < 4 else 2
    rows = -(-len(drawn) // columns)
    canvas = new_figure(3.6 * columns + 0.2, 3.9 * rows + 0.3)
    panels = canvas.subplots(rows, columns, squeeze=False).ravel()
    for axes, (table, field) in zip(panels, drawn, strict=True):
        factor, label = _scale(field)
        values = np.squeeze(field.values) * factor
        levels: Any = _LEVELS
        scale: dict[str, Any] = {"ticks": MaxNLocator(6)}
        if field.name == "life":
            values = np.log10(np.clip(values, 1.0, _ENDLESS))
            scale["format"] = FuncFormatter(lambda power, _: f"$10^{{{power:g}}}$")
        elif field.name == first:  # common to panels of the same parameter
            levels = MaxNLocator(_LEVELS).tick_values(lowest * factor, highest * factor)
        draw = _draw_surface if table == surface else _draw_section
        colored = draw(axes, view, field, values, levels)
        axes.set_title(f"{'surface' if table == surface else 'section'} of body {tables[table].body}")
        canvas.colorbar(colored, ax=axes, label=label, location="bottom", shrink=0.9, **scale)
    legend_under(canvas, handles_of(*panels))
    set_title(canvas, title_of(result.dataset))
    return canvas


def _first_of(found: xarray.Dataset, name: str) -> xarray.DataArray:
    """Return a parameter of a table, the first other one if it has not got it."""
    others = (other for other, field in found.data_vars.items() if field.attrs["units"] != "rad")
    return found[name if name in found else min(others, key=lambda other: other == "life")]


def _scale(field: xarray.DataArray) -> tuple[float, str]:
    """Return the factor of a parameter and the label of its color scale."""
    units, named = str(field.attrs["units"]), str(field.attrs["long_name"])
    if field.name == "life":
        return 1.0, "cycles to a crack, up to $10^9$"
    largest = float(abs(field).max())
    factor, unit = scaled(largest, units) if units in ("Pa", "m") else (1.0, units.replace("1", ""))
    return factor, f"{named} ({unit})" if unit else named


def _map_of(field: xarray.DataArray) -> str:
    """Return the colors of a parameter: what is worst is bright."""
    return "viridis_r" if field.name == "life" else "viridis"


def _mark(axes: Axes, x: Array, y: Array, field: xarray.DataArray, values: Array) -> None:
    """Mark the largest value of a parameter, or the least life."""
    if field.name == "life":
        mark_largest(axes, x, y, -values, "least life")
    else:
        mark_largest(axes, x, y, values)


def _draw_surface(axes: Axes, view: StepView, field: xarray.DataArray, values: Array, levels: Any) -> Any:
    """Draw a map of the surface with the outlines of contact and stick area."""
    part = Part.around([view], _MARGIN)
    x, y = field["x"].values * part.factor, field["y"].values * part.factor
    drawn = axes.contourf(x, y, values, levels, cmap=_map_of(field))
    part.show(axes)
    meshes = [("contact area", "white", mesh_of(view, view.pressure, True))]
    if view.friction != 0.0 and view.has("zone"):
        meshes.append(("stick area", "red", view.stick_mesh()))
    for name, color, mesh in meshes:
        look: dict[str, Any] = {"color": color, "lw": 1.2, "path_effects": EDGED}
        for polygon in mesh.outlines():
            axes.plot(*(polygon * part.factor).T, label=f"{name} in step {view.number}", **look)
    _mark(axes, x, y, field, values)
    return drawn


def _draw_section(axes: Axes, view: StepView, field: xarray.DataArray, values: Array, levels: Any) -> Any:
    """Draw a section, with contact and stick as bars above the surface."""
    x, y = field["x"].values, field["y"].values
    along = x if np.ptp(y) == 0.0 else y if np.ptp(x) == 0.0 else np.hypot(x - x[0, 0], y - y[0, 0])
    factor, unit = scaled(float(abs(along).max()), "m")
    along, depth = along * factor, field["depth"].values * factor
    drawn = axes.contourf(along, depth, values, levels, cmap=_map_of(field))
    draw_zone_bars(axes, view, (x[0], y[0]), along[0], depth.min() - 0.03 * np.ptp(depth))
    _mark(axes, along, depth, field, values)
    axes.set_ylim(depth.max(), depth.min() - 0.06 * np.ptp(depth))
    word = "x" if np.ptp(y) == 0.0 else "y" if np.ptp(x) == 0.0 else "distance"
    axes.set(xlabel=f"{word} ({unit})", ylabel=f"depth ({unit})", aspect="equal")
    return drawn
