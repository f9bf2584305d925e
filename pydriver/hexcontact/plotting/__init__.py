"""Pictures of a result.

Every function takes a `Result` (or its dataset) and returns a `matplotlib.figure.Figure` that needs no window
system; ``figure.savefig("name.pdf")`` writes it. `FIGURES` lists them by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import matplotlib
from matplotlib.figure import Figure

from ..analytic.shear import ClosedForms
from ..result.view import StepView, dataset_of, scaled
from .compliance import compliance
from .history import draw_history, fitted, history, loop, torsion
from .maps import draw_field, field_map, outline, set_plane, widened
from .sections import Cut, draw_section, draw_shear, section, tractions
from .style import EXACT, STYLE, legend_below, new_figure, set_title
from .zones import contact_boundary, draw_zones, outlines, zone_legend, zones

if TYPE_CHECKING:
    import xarray

    from ..result.result import Result

__all__ = [
    "FIGURES",
    "compliance",
    "contact_boundary",
    "field_map",
    "history",
    "loop",
    "outlines",
    "overview",
    "pressure_field",
    "section",
    "torsion",
    "tractions",
    "zones",
]


def pressure_field(result: Result | xarray.Dataset, steps: int | Sequence[int] = -1) -> Figure:
    """Draw the contact pressure over the plane, linear on the triangles of the lattice as in the solution.

    Parameters
    ----------
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    steps : int or sequence of int
        Numbers of the load steps, from 1; -1 is the last one.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the pressure of that step was not kept.
    """
    return field_map("pressure", result, steps)


def overview(result: Result | xarray.Dataset, step: int = -1) -> Figure:
    """Draw what there is to see of a load step.

    Without friction that is the pressure over the plane and along x; with friction the shear traction, the
    zones and the history, too.

    Parameters
    ----------
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    step : int
        Number of the load step, from 1; -1 is the last one.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the pressure of that step was not kept.
    """
    with matplotlib.rc_context(STYLE):
        view = StepView.of(result, step)
        with_friction = view.friction > 0.0 and {"traction_x", "traction_y", "zone"} <= set(view.data)
        figure = _frictional(dataset_of(result), view) if with_friction else _frictionless(view)
        set_title(figure, view.title)
        return figure


def _frictionless(view: StepView) -> Figure:
    figure = new_figure(8.6, 3.7)
    left, right = cast(Any, figure.subfigures(1, 2, width_ratios=(1.15, 1)))
    axes = left.add_subplot()
    draw_field(left, [axes], [view], "pressure", view.window())
    if view.hertz is not None:
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)
    draw_section(right, view, 0.0)
    return figure


def _frictional(dataset: xarray.Dataset, view: StepView) -> Figure:
    """Draw maps of pressure, shear traction and zones; below them a section and the history."""
    limits = widened(view.window())
    to_length, length = scaled(max(abs(limits[0]), abs(limits[2]), view.spacing), "m")
    exact = ClosedForms(dataset).partial_slip(view.number)
    figure = new_figure(9.6, 6.2)
    upper, lower = cast(Any, figure.subfigures(2, 1, height_ratios=(1.05, 1)))
    panels = upper.subplots(1, 3)
    draw_field(upper, panels[:1], [view], "pressure", limits)
    draw_field(upper, panels[1:2], [view], "traction", limits)
    draw_zones(panels[2], view, to_length)
    if view.hertz is not None:
        outline(panels[2], view.hertz, view.center, to_length, color="black", lw=0.9)
    if exact is not None:
        outline(panels[2], exact.ellipse, exact.center, to_length, exact.stick_ratio, color=EXACT, lw=1.2)
    set_plane(panels[2], limits, to_length, length)
    legend_below(panels[2], handles=zone_legend([view], [exact]), ncols=2, handlelength=1.4, fontsize=8)
    several = dataset.sizes["step"] > 1
    below = lower.subplots(1, 3 if several else 1)
    draw_shear(below[0] if several else below, view, exact, Cut.of([view], 0.0, None))
    if several:
        draw_history(below[1], dataset, fitted(dataset, ("contact_area", "stick_area")))
        draw_history(below[2], dataset, ("max_pressure",))
        for axes in below[1:]:
            axes.axvline(view.number, color="0.8", lw=3.0, zorder=0)
    return figure


FIGURES: dict[str, Callable[..., Figure]] = {
    "overview": overview,
    "pressure": pressure_field,
    "section": section,
    "boundary": contact_boundary,
    "history": history,
    "tractions": tractions,
    "zones": zones,
    "outlines": outlines,
    **{
        name: partial(field_map, name)
        for name in ("traction", "traction_x", "traction_y", "slip_increment", "accumulated_slip")
    },
    "loop": loop,
    "torsion": torsion,
    "compliance": compliance,
}
"""Pictures of a result by name; their parameters say what can be chosen."""
