"""Overview of a load step: maps, a section, the history."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from matplotlib.figure import Figure

from ..analytic.compare import ClosedForms
from ..arrays import Dataset
from ..result.result import Result
from ..result.view import StepView, dataset_of
from .history import draw_history, fitted
from .maps import Part, draw_field
from .registry import figure
from .sections import Cut, draw_section, draw_shear
from .style import legend_above, legend_below, new_figure, set_title
from .zones import draw_zones, zone_legend


@figure("overview", "pressure and a section; with friction shear, zones", first=True)
def overview(result: Result | Dataset, step: int = -1, source: str | None = None) -> Figure:
    """Draw maps, a section and the history of a load step.

    Without friction: the pressure over the plane and along x, and along y if the contact is long and not
    that of Hertz; with friction also the shear traction, the zones and the history.
    """
    view = StepView(result, step, source)
    with_friction = view.friction != 0.0 and {"traction_x", "traction_y", "zone"} <= set(view.data)
    canvas = _frictional(dataset_of(result), view) if with_friction else _frictionless(view)
    set_title(canvas, view.title)
    return canvas


def _frictionless(view: StepView) -> Figure:
    part = Part.around([view])
    if part.is_wide:
        canvas = new_figure(7.2, 6.0 * part.aspect + 5.0)
        left, right = cast(Any, canvas.subfigures(2, 1, height_ratios=(6.0 * part.aspect + 1.2, 3.8)))
    else:
        canvas = new_figure(8.6, float(np.clip(3.7 * part.aspect, 3.7, 6.5)))
        left, right = cast(Any, canvas.subfigures(1, 2, width_ratios=(1.15, 1)))
    axes = left.add_subplot()
    part.show(axes)
    draw_field(left, [axes], [view], "pressure", part)
    if view.hertz is not None:
        legend_above(axes)
    if view.hertz is None and (part.is_wide or part.is_tall):
        sides = right.subfigures(*((1, 2) if part.is_wide else (2, 1)))
        for side, angle in zip(sides, (0.0, 0.5 * np.pi), strict=True):
            draw_section(side, view, angle)
    else:
        draw_section(right, view, 0.0)
    return canvas


def _frictional(dataset: Dataset, view: StepView) -> Figure:
    """Draw maps of pressure, shear traction and zones; below them a section and the history."""
    part = Part.around([view])
    exact = ClosedForms(dataset).partial_slip(view.number)
    maps = 3 * (8.0 * part.aspect + 0.6) if part.is_wide else float(np.clip(2.4 * part.aspect, 3.2, 6.0))
    canvas = new_figure(9.6, maps + 3.0)
    upper, lower = cast(Any, canvas.subfigures(2, 1, height_ratios=(maps, 3.0)))
    panels = upper.subplots(*((3, 1) if part.is_wide else (1, 3)))
    for axes in panels:
        part.show(axes)
    draw_field(upper, panels[:1], [view], "pressure", part)
    draw_field(upper, panels[1:2], [view], "traction", part)
    draw_zones(panels[2], view, exact, part)
    legend_below(panels[2], handles=zone_legend([view], [exact]), ncols=2, handlelength=1.4, fontsize=8)
    several = dataset.sizes["step"] > 1
    below = lower.subplots(1, 3 if several else 1)
    draw_shear(below[0] if several else below, view, exact, Cut.of([view], 0.0, None))
    if several:
        draw_history(below[1], dataset, fitted(dataset, ("contact_area", "stick_area")))
        bounded = bool(np.isfinite(dataset["max_pressure"]).all())  # not at the end of a roller
        draw_history(below[2], dataset, ("max_pressure" if bounded else "approach",))
        for axes in below[1:]:
            axes.axvline(view.number, color="0.8", lw=3.0, zorder=0)
    return canvas
