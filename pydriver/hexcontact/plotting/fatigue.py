"""Fatigue parameters of the tables [[fatigue]] of a deck: a map of the surface, and a section below it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..arrays import Array
from ..deck.below import Fatigue
from ..errors import NotInResult
from ..interior.tables import of_cycle, tables_of
from ..result.result import Result
from ..result.view import StepView, dataset_of, title_of
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


@figure("fatigue", "fatigue parameter on the surface and below it", needs="[[fatigue]]")
def fatigue(result: Result | xarray.Dataset, step: int | None = None) -> Figure:
    """Draw the first fatigue parameter of the deck, at the surface and in a section below it.

    Parameters
    ----------
    result : Result or xarray.Dataset
        Output of `Case.run` or `open_result`.
    step : int, optional
        Number of the load step whose contact and stick area are outlined; by default the last of the cycle.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the deck has no table [[fatigue]] of the surface or a plane.
    """
    result = Result(dataset_of(result))
    tables = [table for table in tables_of(result.deck).values() if isinstance(table, Fatigue)]
    surface = next((table for table in tables if table.where.get("depths") == (0.0,)), None)
    section = next((table for table in tables if table.plane), None)
    shown = [table for table in (surface, section) if table]
    if not shown:
        raise NotInResult("the deck has no table [[fatigue]] of the surface or a plane")
    name = shown[0].parameters[0]
    name = "ruiz_f2" if name == "ruiz" else name
    fields = [of_cycle(result, table) for table in shown]
    view = StepView.of(result, int(fields[0].attrs["steps"][-1]) if step is None else step)

    canvas = new_figure(3.6 * len(shown) + 0.2, 4.2)
    panels = canvas.subplots(1, len(shown), squeeze=False)[0]
    drawn = [found[name if name in found else next(iter(found.data_vars))] for found in fields]
    ends = [(float(np.nanmin(field)), float(np.nanmax(field))) for field in drawn if field.name == name]
    for axes, table, field in zip(panels, shown, drawn, strict=True):
        factor, label = _scale(field)
        values = np.squeeze(field.values) * factor
        if field.name == "life":
            values = np.log10(np.clip(values, 1.0, _ENDLESS))
        levels: Any = _LEVELS  # common to panels of the same parameter
        if field.name == name != "life":
            low, high = np.transpose(ends) * factor
            levels = MaxNLocator(_LEVELS).tick_values(low.min(), high.max())
        draw = _draw_surface if table is surface else _draw_section
        colored = draw(axes, view, field, values, levels)
        axes.set_title(f"{'surface' if table is surface else 'section'} of body {table.body}")
        canvas.colorbar(colored, ax=axes, label=label, location="bottom", shrink=0.9, ticks=MaxNLocator(6))
    legend_under(canvas, handles_of(*panels))
    set_title(canvas, title_of(result.dataset))
    return canvas


def _scale(field: xarray.DataArray) -> tuple[float, str]:
    """Return the factor of a parameter and the label of its color scale."""
    units, named = str(field.attrs["units"]), str(field.attrs["long_name"])
    if field.name == "life":
        return 1.0, f"lg of the cycles to a crack, up to {_ENDLESS:g}"
    largest = float(abs(field).max())
    factor, unit = scaled(largest, units) if units in ("Pa", "m") else (1.0, units.replace("1", ""))
    return factor, f"{named} ({unit})" if unit else named


def _draw_surface(axes: Axes, view: StepView, field: xarray.DataArray, values: Array, levels: Any) -> Any:
    """Draw a map of the surface with the outlines of contact and stick area."""
    part = Part.around([view], _MARGIN)
    x, y = field["x"].values * part.factor, field["y"].values * part.factor
    drawn = axes.contourf(x, y, values, levels)
    part.show(axes)
    meshes = [("contact area", "white", mesh_of(view, view.pressure, True))]
    if view.friction != 0.0 and view.has("zone"):
        meshes.append(("stick area", "red", view.stick_mesh()))
    for name, color, mesh in meshes:
        look: dict[str, Any] = {"color": color, "lw": 1.2, "path_effects": EDGED}
        for polygon in mesh.outlines():
            axes.plot(*(polygon * part.factor).T, label=f"{name} in step {view.number}", **look)
    mark_largest(axes, x, y, values)
    return drawn


def _draw_section(axes: Axes, view: StepView, field: xarray.DataArray, values: Array, levels: Any) -> Any:
    """Draw a section, with contact and stick as bars above the surface."""
    x, y = field["x"].values, field["y"].values
    along = x if np.ptp(y) == 0.0 else y if np.ptp(x) == 0.0 else np.hypot(x - x[0, 0], y - y[0, 0])
    factor, unit = scaled(float(abs(along).max()), "m")
    along, depth = along * factor, field["depth"].values * factor
    drawn = axes.contourf(along, depth, values, levels)
    draw_zone_bars(axes, view, (x[0], y[0]), along[0], depth.min() - 0.03 * np.ptp(depth))
    mark_largest(axes, along, depth, values)
    axes.set_ylim(depth.max(), depth.min() - 0.06 * np.ptp(depth))
    word = "x" if np.ptp(y) == 0.0 else "y" if np.ptp(x) == 0.0 else "distance"
    axes.set(xlabel=f"{word} ({unit})", ylabel=f"depth ({unit})", aspect="equal")
    return drawn
