"""Stick, slip and separation: zone maps, and outlines of the zones over each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from ..analytic.shear import ClosedForms, PartialSlip
from ..result.view import StepView, as_list, dataset_of
from .plane import FEWER_ARROWS, Part, map_panels, views_of
from .registry import figure
from .style import EXACT, GUIDE, SLIP, STICK, set_title, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..result.view import Results

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Steps (row, col) to the neighbors of a node, counterclockwise.
_NEIGHBORS = np.array([(0, 1), (1, 0), (1, -1), (0, -1), (-1, 0), (-1, 1)])
# The corner of a node's cell before each of them: the middle of a triangle, as (1 for an upper one,
# row, col).
_CORNERS = ((1, -1, 0), (0, 0, 0), (1, 0, -1), (0, 0, -1), (1, -1, -1), (0, -1, 0))


def cell_outline(zone: Mask, basis: Array, start: tuple[float, float]) -> list[Array]:
    """Return the outline of the cells of a zone: closed polygons, counterclockwise around the zone.

    The cell of a node is the hexagon between the middles of the triangles around it. At each corner three
    cells meet, so an outline never crosses itself.

    Parameters
    ----------
    zone : ndarray of bool, shape (n_row, n_col)
        Nodes of the zone.
    basis : ndarray, shape (2, 2)
        Basis vectors of the lattice as rows.
    start : tuple of float
        Position of node [0, 0].

    Returns
    -------
    list of ndarray, shape (n, 2)
        Corners of each polygon, the last being the first.
    """
    padded = np.pad(zone, 1)
    n_col = padded.shape[1]
    begins: list[NDArray[np.int64]] = []
    ends: list[NDArray[np.int64]] = []
    for number, step in enumerate(_NEIGHBORS):
        nodes = np.argwhere(padded & ~np.roll(padded, -step, axis=(0, 1)))
        for ids, (up, j, i) in ((begins, _CORNERS[number]), (ends, _CORNERS[(number + 1) % 6])):
            ids.append(((nodes[:, 0] + j) * n_col + nodes[:, 1] + i) * 2 + up)
    after = dict(zip(np.concatenate(begins).tolist(), np.concatenate(ends).tolist(), strict=True))
    polygons = []
    while after:
        first, corner_id = after.popitem()
        polygon = [first, corner_id]
        while corner_id != first:
            corner_id = after.pop(corner_id)
            polygon.append(corner_id)
        triangle, upper = np.divmod(polygon, 2)
        index = np.stack([triangle % n_col, triangle // n_col], axis=1) - 1 + (1.0 + upper[:, None]) / 3.0
        polygons.append(np.asarray(start) + index @ basis)
    return polygons


def _outline_of(view: StepView, zone: Mask) -> list[Array]:
    return cell_outline(zone, view.basis, view.start)


def draw_zones(axes: Axes, view: StepView, exact: PartialSlip | None, part: Part) -> None:
    """Fill the stick and the slip zone of a step; outline Hertz's contact area and the exact stick area."""

    def fill(zone: Mask, **style: Any) -> None:
        if polygons := _outline_of(view, zone):
            path = Path.make_compound_path(
                *(Path(polygon * part.factor, closed=True) for polygon in polygons)
            )
            axes.add_patch(PathPatch(path, **style))

    fill(view.contact, facecolor=SLIP, edgecolor="none")
    fill(view.stick & view.contact, facecolor=STICK, edgecolor="none")
    if view.hertz is None:
        fill(view.contact, facecolor="none", edgecolor="black", linewidth=0.6)
    else:
        part.outline(axes, view.hertz, view.center, color="black", lw=0.9)
    if exact is not None:
        part.outline(axes, exact.ellipse, exact.center, exact.stick_ratio, lw=1.2)


def zone_legend(views: Sequence[StepView], exact: Sequence[PartialSlip | None]) -> list[Any]:
    """Return what a legend of zone maps lists."""
    handles: list[Any] = [Patch(color=STICK, label="stick"), Patch(color=SLIP, label="slip")]
    if any(view.hertz is not None for view in views):
        handles.append(Line2D([], [], color="black", ls="--", lw=0.9, label="Hertz contact area"))
    named = sorted({solution.name for solution in exact if solution is not None})
    if named:
        handles.append(
            Line2D([], [], color=EXACT, ls="--", lw=1.2, label=f"stick area, {' or '.join(named)}")
        )
    return handles


def _exact(results: Results, views: Sequence[StepView]) -> list[PartialSlip | None]:
    """Return the closed solution of each view; views of one result follow each other."""
    several = as_list(results)
    each = len(views) // len(several)
    closed = [ClosedForms(dataset_of(one)) for one in several]
    return [closed[k // each].partial_slip(view.number) for k, view in enumerate(views)]


@figure("zones", "map of stick and slip, for some steps or files", needs="friction")
def zones(
    results: Results,
    steps: int | Sequence[int] = -1,
    arrows: Literal["none", "traction", "slip"] = "none",
) -> Figure:
    """Draw where the contact sticks, slips and is separated, one map for each load step.

    Parameters
    ----------
    results : Result or xarray.Dataset, or a sequence of them
        What runs returned, or `open_result` read.
    steps : int or sequence of int
        Numbers of the load steps, from 1; -1 is the last one.
    arrows : {"none", "traction", "slip"}
        Arrows of the shear traction on body 1, or of the slip of body 1 over body 2 in the step.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the contact is frictionless, or the zones of that step were not kept.
    """
    views, labels, title = views_of(results, steps)
    part = Part.around(views)
    exact = _exact(results, views)
    for view in views:
        view.stick  # noqa: B018 - says at once what cannot be drawn
    canvas, panels = map_panels(part, labels)
    for axes, view, solution in zip(panels, views, exact, strict=True):
        draw_zones(axes, view, solution, part)
        if arrows != "none":
            name = "traction" if arrows == "traction" else "slip_increment"
            vector = view.field(f"{name}_x"), view.field(f"{name}_y")
            part.arrows(axes, view, vector, "black", FEWER_ARROWS)
    canvas.legend(handles=zone_legend(views, exact), loc="outside lower center", ncols=4, handlelength=1.6)
    set_title(canvas, title)
    return canvas


@figure("outlines", "outlines of contact and stick area, for some steps or files", needs="friction")
def outlines(results: Results, steps: int | Sequence[int] = -1) -> Figure:
    """Draw the outlines of contact and stick area of several load steps, or results, over each other.

    Parameters
    ----------
    results : Result or xarray.Dataset, or a sequence of them
        What runs returned, or `open_result` read.
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
        If the contact is frictionless, or the zones of that step were not kept.
    """
    views, labels, title = views_of(results, steps)
    part = Part.around(views, 1.15)
    height = float(np.clip(3.9 * part.aspect, 2.0, 6.0)) + 0.8
    canvas = Figure((6.4, height), layout="compressed")
    axes = canvas.add_subplot()
    for view, label, color in zip(views, labels, shades(len(views)), strict=True):
        for polygon in _outline_of(view, view.contact):
            axes.plot(*(polygon * part.factor).T, color=GUIDE, lw=0.6, zorder=1)
        name: str | None = label
        for polygon in _outline_of(view, view.stick & view.contact):
            axes.plot(*(polygon * part.factor).T, color=color, label=name)
            name = None
        if name is not None:
            axes.plot([], [], color=color, label=f"{label} (no stick)")
    exact = [solution for solution in _exact(results, views) if solution is not None]
    thin: dict[str, Any] = {"color": "black", "lw": 0.7, "linestyle": ":"}
    for solution in exact:
        part.outline(axes, solution.ellipse, solution.center, solution.stick_ratio, **thin)
    axes.plot([], [], color=GUIDE, lw=0.6, label="contact area")
    if exact:
        names = " or ".join(sorted({solution.name for solution in exact}))
        axes.plot([], [], label=f"stick area,\n{names}", **thin)
    part.show(axes)
    canvas.legend(loc="outside right center", title="stick area", alignment="left", handlelength=1.6)
    set_title(canvas, title)
    return canvas
