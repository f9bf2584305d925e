"""Stick, slip and separation: zone maps, outlines of zones, bars along sections, nodes in contact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.tri import Triangulation

from ..analytic.compare import PartialSlip
from ..arrays import Array, Dataset, Mask
from ..core import flat
from ..core.edges import ZoneMesh
from ..core.measures import ROUND
from ..errors import NotInResult
from ..result.html import SLIP, STICK
from ..result.netcdf import triangles
from ..result.result import Result
from ..result.view import Results, StepView
from ..text import worded
from . import style
from .maps import FEWER_ARROWS, Part, closed_solutions, map_panels, mesh_of, views_of
from .registry import figure


def draw_zones(axes: Axes, view: StepView, exact: PartialSlip | None, part: Part) -> None:
    """Fill the stick and the slip zone of a step; outline contact area (Hertz) and exact stick area."""

    def fill(mesh: ZoneMesh, **look: Any) -> None:
        if polygons := mesh.outlines():
            paths = (Path(polygon * part.factor, closed=True) for polygon in polygons)
            axes.add_patch(PathPatch(Path.make_compound_path(*paths), **look))

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
        handles.append(Line2D([], [], color=style.EXACT, ls="--", lw=1.2, label=label))
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
    style.legend_under(canvas, zone_legend(views, exact), ax)
    return style.set_title(canvas, title, ax)


@figure("outlines", "outlines of contact and stick area, of steps or files", needs="friction")
def outlines(results: Results, steps: int | Sequence[int] = -1, ax: Axes | None = None) -> Figure:
    """Draw the outlines of contact and stick area of several load steps or results in one map."""
    views, labels, title = views_of(results, steps)
    part = Part.around(views, 1.15)
    height = float(np.clip(3.9 * part.aspect, 2.0, 6.0)) + 0.8
    canvas, axes = style.drawing(ax, 6.4, height, equal=True)
    colors = style.shades(len(views))
    for view, label, color in zip(views, labels, colors, strict=True):
        for polygon in mesh_of(view, view.pressure, True).outlines():
            axes.plot(*(polygon * part.factor).T, color=style.GUIDE, lw=0.6, zorder=1)
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
    axes.plot([], [], color=style.GUIDE, lw=0.6, label="contact area")
    if exact:
        names = " or ".join(sorted({solution.name for solution in exact}))
        axes.plot([], [], label=f"stick area,\n{names}", **thin)
    part.show(axes)
    beside: dict[str, Any] = {"title": "stick area", "alignment": "left", "handlelength": 1.6}
    if ax is None:
        canvas.legend(loc="outside right center", **beside)
    else:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), **beside)
    return style.set_title(canvas, title, ax)


_FULL = 0.7  # share of its ellipse that a zone fills
_APART = 80  # spacings across the picture up to which nodes are distinguishable


@figure("boundary", "nodes in contact (and stick), fitted circle or ellipse")
def contact_boundary(result: Result | Dataset, step: int = -1, ax: Axes | None = None) -> Figure:
    """Draw the nodes in contact on the lattice, the circle (9.1)-(9.2) or ellipse fitted to them, and Hertz.

    With friction, sticking nodes have their own color and fitted ellipse (Figure 9.4). Nodes too close to be
    distinguished are drawn as cells; nothing is fitted to several spots.
    """
    view = StepView(result, step)
    if not view.contact.any():
        raise NotInResult("no node is in contact")
    part = Part.around([view], 1.2)
    width, height = part.size()
    canvas, axes = style.drawing(ax, max(width, 4.6), height + 0.6, equal=True)
    x_min, x_max, y_min, y_max = part.limits
    around = np.pad(view.contact, 1, mode="wrap" if view.lattice.periodic else "constant")
    x, y, rim = view.x * part.factor, view.y * part.factor, flat.boundary(around)[1:-1, 1:-1]
    wide = np.array([1.0, part.stretch] if part.is_wide else [part.stretch, 1.0])  # as in the picture
    across = part.width * wide[0] / np.linalg.norm(view.basis * wide, axis=1).min()
    pitch = 70.0 * (6.4 if part.is_wide else min(3.4, 6.0 / part.aspect)) / across  # points between nodes
    if across < _APART:
        shown = (view.x > x_min) & (view.x < x_max) & (view.y > y_min) & (view.y < y_max)
        corners = triangles(*shown.shape)
        mesh = Triangulation(x.ravel(), y.ravel(), corners[shown.ravel()[corners].any(axis=1)])
        links = np.stack([mesh.x, mesh.y], axis=1)[mesh.edges]
        axes.add_collection(LineCollection(cast(Any, links), colors="0.85", linewidths=0.4, zorder=0))
    cell = 0.5 * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) @ view.basis
    dot: dict[str, Any] = {"marker": "o", "mew": 0, "ls": "", "rasterized": across > _APART}
    stick = view.contact & view.stick if view.friction else None
    if stick is None:
        groups = [(view.contact & ~rim, style.IN_CONTACT, "in contact")]
    else:
        groups = [(stick, STICK, "stick"), (view.contact & ~stick, SLIP, "slip")]
    for nodes, color, label in groups:
        if across < _APART:
            axes.plot(x[nodes], y[nodes], ms=0.45 * pitch, mfc=color, label=label, **dot)
            continue
        cells = np.stack([view.x[nodes], view.y[nodes]], axis=1)[:, None] + cell
        look: dict[str, Any] = {"color": color, "lw": 0, "antialiased": False, "rasterized": True}
        axes.add_collection(PolyCollection(cast(Any, cells * part.factor), label=label, **look))
    if stick is not None:
        dot |= {"mfc": "none", "mew": 0.8}  # boundary nodes as rings
    axes.plot(x[rim], y[rim], ms=max(0.45 * pitch, 1.0), color="black", label="boundary node", **dot)
    one = _is_spot(view, view.contact)
    if view.has("gap"):
        edge = view.edges().edge()
        pieces = LineCollection(cast(Any, edge.segments * part.factor), colors="black", linewidths=0.9)
        axes_of = edge.semi_major, edge.semi_minor
        size = rf"$\sqrt{{A/\pi}}$ = {worded(edge.radius, 'm')}"
        if axes_of[1] < ROUND * axes_of[0]:
            size = " by ".join(worded(axis, "m") for axis in axes_of)
        pieces.set_label(f"edge, {size}" if one else "edge")
        axes.add_collection(pieces)
    if one:
        fitted, words = _fitted(view, view.contact, "a", view.center)
        color = style.COMPUTED if stick is None else "black"
        part.outline(axes, fitted, (fitted.x, fitted.y), label=f"fitted {words}", linestyle="-", color=color)
    if view.hertz is not None:
        a, b = view.hertz.semi_major, view.hertz.semi_minor
        exact = f"a = {worded(a, 'm')}" if b > 0.999 * a else f"{worded(a, 'm')} by {worded(b, 'm')}"
        part.outline(axes, view.hertz, view.center, label=f"Hertz, {exact}")
    if stick is not None and np.count_nonzero(stick) > 2 and _is_spot(view, stick):
        fitted, words = _fitted(view, stick, "c")
        part.outline(
            axes, fitted, (fitted.x, fitted.y), label=f"stick: {words}", linestyle="-", color=style.THIRD
        )
    part.show(axes)
    legend = style.legend_under(canvas, style.handles_of(axes), ax, size=8)
    for handle in legend.legend_handles[: len(groups) + 1]:
        if isinstance(handle, Line2D):
            handle.set_markersize(4.0)
    return style.set_title(canvas, view.title, ax)


def _is_spot(view: StepView, zone: Mask) -> bool:
    """Test whether a zone fills most of the ellipse with its moments; none is fitted to several spots."""
    moments = flat.moment_ellipse(view.x, view.y, zone)
    ellipse = np.pi * moments.semi_major * moments.semi_minor
    return not view.lattice.periodic and view.lattice.cell_area * np.count_nonzero(zone) > _FULL * ellipse


def _fitted(
    view: StepView, zone: Mask, letter: str, center: tuple[float, float] | None = None
) -> tuple[flat.Ellipse, str]:
    """Return the circle of the boundary nodes of a zone, or the ellipse of its moments, and its label."""
    moments = flat.moment_ellipse(view.x, view.y, zone)
    if moments.semi_minor > ROUND * moments.semi_major:
        center = center or (moments.x, moments.y)
        radius = flat.boundary_circle(view.x, view.y, zone, view.spacing, center).radius
        return flat.Ellipse(radius, radius, 0.0, *center), f"circle, {letter} = {worded(radius, 'm')}"
    return moments, f"ellipse, {worded(moments.semi_major, 'm')} by {worded(moments.semi_minor, 'm')}"
