"""Stick, slip and separation: zone maps, outlines of zones, and bars along sections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from ..analytic.shear import PartialSlip
from ..arrays import Array
from ..core.edges import ZoneMesh
from ..result.raster import SLIP, STICK
from ..result.view import Results, StepView
from .maps import mesh_of
from .plane import FEWER_ARROWS, Part, closed_solutions, map_panels, views_of
from .registry import figure
from .style import EXACT, GUIDE, drawing, legend_under, set_title, shades


def draw_zones(axes: Axes, view: StepView, exact: PartialSlip | None, part: Part) -> None:
    """Fill the stick and the slip zone of a step; outline contact area (Hertz) and exact stick area."""

    def fill(mesh: ZoneMesh, **style: Any) -> None:
        if polygons := mesh.outlines():
            paths = (Path(polygon * part.factor, closed=True) for polygon in polygons)
            axes.add_patch(PathPatch(Path.make_compound_path(*paths), **style))

    contact = mesh_of(view, view.pressure, True)
    fill(contact, facecolor=SLIP, edgecolor="none")
    fill(view.stick_mesh(), facecolor=STICK, edgecolor="none")
    if view.hertz is None:
        fill(contact, facecolor="none", edgecolor="black", linewidth=0.6)
    else:
        part.outline(axes, view.hertz, view.center, color="black", lw=0.9)
    if exact is not None:
        part.outline(axes, exact.ellipse, exact.center, exact.stick_ratio, lw=1.2)


def zone_legend(views: Sequence[StepView], exact: Sequence[PartialSlip | None]) -> list[Any]:
    """Return the handles of a legend of zone maps."""
    handles: list[Any] = [Patch(color=STICK, label="stick"), Patch(color=SLIP, label="slip")]
    if any(view.hertz is not None for view in views):
        handles.append(Line2D([], [], color="black", ls="--", lw=0.9, label="Hertz contact area"))
    named = sorted({solution.name for solution in exact if solution is not None})
    if named:
        label = f"stick area, {' or '.join(named)}"
        handles.append(Line2D([], [], color=EXACT, ls="--", lw=1.2, label=label))
    return handles


def draw_zone_bars(
    axes: Axes, view: StepView, points: tuple[Array, Array], along: Array, height: float
) -> None:
    """Draw contact, or slip and stick, along a section as bars at a height.

    `points` are x and y (m) of the section, `along` their coordinates on the horizontal axis.
    """
    zones = [("contact", view.touches(*points), SLIP)]
    if view.friction != 0.0 and view.has("zone"):
        zones = [("slip", zones[0][1], SLIP), ("stick", view.sticks(*points), STICK)]
    for name, inside, color in zones:
        if inside.any():
            bar = np.where(inside, height, np.nan)
            axes.plot(along, bar, color=color, lw=4.0, solid_capstyle="butt", label=name)


@figure("zones", "map of stick and slip, for some steps or files", needs="friction")
def zones(
    results: Results,
    steps: int | Sequence[int] = -1,
    arrows: Literal["none", "traction", "slip"] = "none",
    ax: Axes | None = None,
) -> Figure:
    """Draw the zones of stick, slip and separation, one map for each load step.

    Parameters
    ----------
    arrows : {"none", "traction", "slip"}
        Arrows of the shear traction on body 1, or of the slip of body 1 over body 2 in the step.
    """
    views, labels, title = views_of(results, steps)
    part = Part.around(views)
    exact = closed_solutions(results, views)
    for view in views:
        view.stick  # noqa: B018 - raises before anything is drawn
    canvas, panels = map_panels(part, labels, ax)
    for axes, view, solution in zip(panels, views, exact, strict=True):
        draw_zones(axes, view, solution, part)
        if arrows != "none":
            name = "traction" if arrows == "traction" else "slip_increment"
            vector = view.field(f"{name}_x"), view.field(f"{name}_y")
            part.arrows(axes, view, vector, "black", FEWER_ARROWS)
    legend_under(canvas, zone_legend(views, exact), ax)
    set_title(canvas, title, ax)
    return canvas


@figure("outlines", "outlines of contact and stick area, of steps or files", needs="friction")
def outlines(results: Results, steps: int | Sequence[int] = -1, ax: Axes | None = None) -> Figure:
    """Draw the outlines of contact and stick area of several load steps or results in one map."""
    views, labels, title = views_of(results, steps)
    part = Part.around(views, 1.15)
    height = float(np.clip(3.9 * part.aspect, 2.0, 6.0)) + 0.8
    canvas, axes = drawing(ax, 6.4, height, equal=True)
    colors = shades(len(views))
    for view, label, color in zip(views, labels, colors, strict=True):
        for polygon in mesh_of(view, view.pressure, True).outlines():
            axes.plot(*(polygon * part.factor).T, color=GUIDE, lw=0.6, zorder=1)
        name: str | None = label
        for polygon in view.stick_mesh().outlines():
            axes.plot(*(polygon * part.factor).T, color=color, label=name)
            name = None
        if name is not None:
            axes.plot([], [], color=color, label=f"{label} (no stick)")
    exact = [solution for solution in closed_solutions(results, views) if solution is not None]
    thin: dict[str, Any] = {"color": "black", "lw": 0.7, "linestyle": ":"}
    for solution in exact:
        part.outline(axes, solution.ellipse, solution.center, solution.stick_ratio, **thin)
    axes.plot([], [], color=GUIDE, lw=0.6, label="contact area")
    if exact:
        names = " or ".join(sorted({solution.name for solution in exact}))
        axes.plot([], [], label=f"stick area,\n{names}", **thin)
    part.show(axes)
    beside: dict[str, Any] = {"title": "stick area", "alignment": "left", "handlelength": 1.6}
    if ax is None:
        canvas.legend(loc="outside right center", **beside)
    else:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), **beside)
    set_title(canvas, title, ax)
    return canvas
