"""Stick, slip and separation: zone maps, outlines, and the nodes themselves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, cast

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from ..analytic.shear import ClosedForms, PartialSlip
from ..core import estimators
from ..core.edges import ContactEdges, Edge
from ..result.view import StepView, as_list, dataset_of, scaled, worded
from .maps import FEWER_ARROWS, draw_arrows, map_panels, outer_labels, outline, set_plane, union, views_of
from .style import COMPUTED, EXACT, GUIDE, SLIP, STICK, STYLE, THIRD, set_title, shades

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from ..result.result import Result
    from ..result.view import Results

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Neighbors of a node counterclockwise, as steps in (row, col), and the corner of its cell before each: the
# middle of a triangle of the lattice, as (1 for an upper triangle, row, col).
_SIDES = (
    ((0, 1), (1, -1, 0)),
    ((1, 0), (0, 0, 0)),
    ((1, -1), (1, 0, -1)),
    ((0, -1), (0, 0, -1)),
    ((-1, 0), (1, -1, -1)),
    ((-1, 1), (0, -1, 0)),
)


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
    for number, ((row, col), corner) in enumerate(_SIDES):
        side = padded & ~np.roll(padded, (-row, -col), axis=(0, 1))
        nodes = np.argwhere(side)
        following = _SIDES[(number + 1) % 6][1]
        for corners, (up, j, i) in ((begins, corner), (ends, following)):
            corners.append(((nodes[:, 0] + j) * n_col + nodes[:, 1] + i) * 2 + up)
    after = dict(zip(np.concatenate(begins).tolist(), np.concatenate(ends).tolist(), strict=True))
    polygons = []
    while after:
        first, corner_id = after.popitem()
        ids_of_loop = [first, corner_id]
        while corner_id != first:
            corner_id = after.pop(corner_id)
            ids_of_loop.append(corner_id)
        ids = np.array(ids_of_loop)
        triangle, upper = ids // 2, ids % 2
        index = np.stack([triangle % n_col, triangle // n_col], axis=1) - 1 + (1.0 + upper[:, None]) / 3.0
        polygons.append(np.asarray(start) + index @ basis)
    return polygons


def _outline_of(view: StepView, zone: Mask) -> list[Array]:
    return cell_outline(zone, view.basis, (float(view.x[0, 0]), float(view.y[0, 0])))


def _fill(axes: Axes, view: StepView, zone: Mask, factor: float, **style: Any) -> None:
    """Fill the cells of a zone."""
    polygons = _outline_of(view, zone)
    if polygons:
        path = Path.make_compound_path(*(Path(polygon * factor, closed=True) for polygon in polygons))
        axes.add_patch(PathPatch(path, **style))


def draw_zones(axes: Axes, view: StepView, factor: float) -> None:
    """Fill the stick and the slip zone of a step; `factor` turns meters into the unit of the axes."""
    stick = view.stick
    _fill(axes, view, view.contact, factor, facecolor=SLIP, edgecolor="none")
    _fill(axes, view, stick & view.contact, factor, facecolor=STICK, edgecolor="none")
    if view.hertz is None:
        _fill(axes, view, view.contact, factor, facecolor="none", edgecolor="black", linewidth=0.6)


def _draw_exact(axes: Axes, view: StepView, exact: PartialSlip | None, factor: float) -> None:
    """Draw the contact area of Hertz, and the stick area of the closed solution."""
    if view.hertz is not None:
        outline(axes, view.hertz, view.center, factor, color="black", linestyle="--", lw=0.9)
    if exact is not None:
        outline(
            axes, exact.ellipse, exact.center, factor, exact.stick_ratio, color=EXACT, linestyle="--", lw=1.2
        )


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
    with matplotlib.rc_context(STYLE):
        views, labels, title = views_of(results, steps)
        for view in views:
            view.stick  # noqa: B018 - says at once what cannot be drawn
        limits = union(views)
        to_length, length = scaled(max(np.abs(limits[:2]).max(), views[0].spacing), "m")
        exact = _exact(results, views)
        figure, panels = map_panels(len(views), limits, 1 + max(label.count("\n") for label in labels))
        for axes, view, label, solution in zip(panels, views, labels, exact, strict=True):
            draw_zones(axes, view, to_length)
            _draw_exact(axes, view, solution, to_length)
            if arrows != "none":
                name = "traction" if arrows == "traction" else "slip_increment"
                vector = view.field(f"{name}_x"), view.field(f"{name}_y")
                draw_arrows(axes, view, vector, to_length, "black", FEWER_ARROWS)
            set_plane(axes, limits, to_length, length)
            if len(views) > 1:
                axes.set_title(label)
        outer_labels(panels)
        figure.legend(
            handles=zone_legend(views, exact), loc="outside lower center", ncols=4, handlelength=1.6
        )
        set_title(figure, title)
        return figure


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
    with matplotlib.rc_context(STYLE):
        views, labels, title = views_of(results, steps)
        limits = union(views, 1.15)
        to_length, length = scaled(max(np.abs(limits[:2]).max(), views[0].spacing), "m")
        x_min, x_max, y_min, y_max = limits
        figure = Figure(
            (6.4, float(np.clip(3.9 * (y_max - y_min) / (x_max - x_min), 2.0, 6.0)) + 0.8),
            layout="compressed",
        )
        axes = figure.add_subplot()
        for view, label, color in zip(views, labels, shades(len(views)), strict=True):
            for polygon in _outline_of(view, view.contact):
                axes.plot(*(polygon * to_length).T, color=GUIDE, lw=0.6, zorder=1)
            name: str | None = label
            for polygon in _outline_of(view, view.stick & view.contact):
                axes.plot(*(polygon * to_length).T, color=color, label=name)
                name = None
            if name is not None:
                axes.plot([], [], color=color, label=f"{label} (no stick)")
        exact = [solution for solution in _exact(results, views) if solution is not None]
        for solution in exact:
            thin: dict[str, Any] = {"color": "black", "lw": 0.7, "linestyle": ":"}
            outline(axes, solution.ellipse, solution.center, to_length, solution.stick_ratio, **thin)
        axes.plot([], [], color=GUIDE, lw=0.6, label="contact area")
        if exact:
            names = " or ".join(sorted({solution.name for solution in exact}))
            axes.plot([], [], color="black", lw=0.7, ls=":", label=f"stick area,\n{names}")
        set_plane(axes, limits, to_length, length)
        figure.legend(loc="outside right center", title="stick area", alignment="left", handlelength=1.6)
        set_title(figure, title)
        return figure


# --- nodes on the lattice -------------------------------------------------------------------------


def contact_boundary(result: Result | xarray.Dataset, step: int = -1) -> Figure:
    """Draw the nodes in contact on the lattice, the circle (9.1)-(9.2) or ellipse fitted to them, and Hertz.

    With friction the sticking nodes are told apart, and an ellipse is fitted to them, too (Figure 9.4).

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
        If the pressure of that step was not kept, or nothing is in contact.
    """
    with matplotlib.rc_context(STYLE):
        view = StepView.of(result, step)
        if not view.contact.any():
            raise ValueError("no node is in contact")
        limits = view.window(1.2)
        aspect = (limits[3] - limits[2]) / (limits[1] - limits[0])
        figure = Figure((4.6, float(np.clip(3.75 * aspect, 1.5, 5.0)) + 1.15), layout="compressed")
        axes = figure.add_subplot()
        to_length, length = scaled(float(np.abs(limits[:2]).max()), "m")
        x_min, x_max, y_min, y_max = (to_length * limit for limit in limits)
        x, y, rim = view.x * to_length, view.y * to_length, estimators.boundary(view.contact)
        shown = (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max)
        across = (limits[1] - limits[0]) / view.spacing  # spacings over the width of the picture
        pitch = 240.0 / across  # points between nodes
        if across < 80:
            axes.add_collection(_lattice_lines(x, y, shown))
        inner = view.contact & ~rim
        dot: dict[str, Any] = {"marker": "o", "mew": 0, "ls": "", "rasterized": across > 80}
        inside_size = 0.45 * pitch if across < 80 else 2.0 * pitch  # too many to tell apart: an area
        stick = view.contact & view.stick if view.friction else None
        if stick is None:
            groups = [(inner, "#56B4E9", "in contact")]
        else:
            groups = [(stick, STICK, "stick"), (view.contact & ~stick, SLIP, "slip")]
            dot = {**dot, "mfc": "none", "mew": 0.8}  # a ring around a boundary node
        for nodes, color, label in groups:
            axes.plot(x[nodes], y[nodes], ms=inside_size, **{**dot, "mfc": color, "mew": 0}, label=label)
        axes.plot(x[rim], y[rim], ms=max(0.45 * pitch, 1.0), color="black", label="boundary node", **dot)
        if (edge := _edge_of(view)) is not None:
            pieces = LineCollection(cast(Any, edge.segments * to_length), colors="black", linewidths=0.9)
            pieces.set_label(f"edge, $\\sqrt{{A/\\pi}}$ = {worded(edge.radius, 'm')}")
            axes.add_collection(pieces)
        fitted, words = _fitted(view, view.contact, "a", view.center)
        plain: dict[str, Any] = {"linestyle": "-", "color": COMPUTED if stick is None else "black"}
        outline(axes, fitted, fitted.center, to_length, label=f"fitted {words}", **plain)
        if view.hertz is not None:
            a, b = view.hertz.semi_major, view.hertz.semi_minor
            exact = f"a = {worded(a, 'm')}" if b > 0.999 * a else f"{worded(a, 'm')} by {worded(b, 'm')}"
            outline(axes, view.hertz, view.center, to_length, label=f"Hertz, {exact}")
        if stick is not None and np.count_nonzero(stick) > 2:
            fitted, words = _fitted(view, stick, "c")
            plain["color"] = THIRD
            outline(axes, fitted, fitted.center, to_length, label=f"stick: {words}", **plain)
        set_plane(axes, limits, to_length, length)
        legend = figure.legend(loc="outside lower center", ncols=2, handlelength=1.6)
        for handle in legend.legend_handles[: len(groups) + 1]:
            cast(Line2D, handle).set_markersize(4.0)
        set_title(figure, view.title)
        return figure


def _edge_of(view: StepView) -> Edge | None:
    """Return the edge of the contact between the nodes, None if the gap was not kept."""
    try:
        gap = view.field("gap")
    except ValueError:
        return None
    return ContactEdges(view.pressure, gap, view.contact, np.isfinite(gap), view.basis, view.start).contact()


def _fitted(
    view: StepView, zone: Mask, letter: str, center: tuple[float, float] | None = None
) -> tuple[estimators.Ellipse, str]:
    """Fit a circle to the boundary nodes of a zone, or an ellipse to its second moments; word it."""
    moments = estimators.moment_ellipse(view.x, view.y, zone)
    if moments.semi_minor > 0.97 * moments.semi_major:
        center = center or moments.center
        radius = estimators.boundary_circle(view.x, view.y, zone, view.spacing, center).radius
        return estimators.Ellipse(radius, radius, 0.0, center), f"circle, {letter} = {worded(radius, 'm')}"
    return moments, f"ellipse, {worded(moments.semi_major, 'm')} by {worded(moments.semi_minor, 'm')}"


def _lattice_lines(x: Array, y: Array, shown: Mask) -> LineCollection:
    """Edges of the lattice's triangles between nodes of the picture."""
    segments = []
    for here, there in (
        ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
        ((slice(None, -1), slice(None)), (slice(1, None), slice(None))),
        ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))),
    ):
        both = shown[here] | shown[there]
        segments.append(
            np.stack([np.stack([x[end][both], y[end][both]], axis=-1) for end in (here, there)], axis=1)
        )
    return LineCollection(cast(Any, np.concatenate(segments)), colors="0.85", linewidths=0.4, zorder=0)
