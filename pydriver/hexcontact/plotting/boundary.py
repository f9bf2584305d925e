"""The nodes of a contact on their lattice, with what is fitted to them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..core import estimators
from ..core.edges import ContactEdges, Edge
from ..result.view import StepView, worded
from .maps import mesh_of
from .plane import Part
from .registry import figure
from .style import COMPUTED, IN_CONTACT, SLIP, STICK, THIRD, set_title

if TYPE_CHECKING:
    import xarray

    from ..result.result import Result

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_APART = 80  # spacings over the width of the picture up to which nodes can be told apart


@figure("boundary", "nodes in contact (and stick) with fitted circle or ellipse")
def contact_boundary(result: Result | xarray.Dataset, step: int = -1) -> Figure:
    """Draw the nodes in contact on the lattice, the circle (9.1)-(9.2) or ellipse fitted to them, and Hertz.

    With friction sticking nodes have a color of their own, and an ellipse fitted to them (Figure 9.4).

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
    view = StepView.of(result, step)
    if not view.contact.any():
        raise ValueError("no node is in contact")
    part = Part.around([view], 1.2)
    canvas = Figure((4.6, float(np.clip(3.75 * part.aspect, 1.5, 5.0)) + 1.15), layout="compressed")
    axes = canvas.add_subplot()
    x_min, x_max, y_min, y_max = part.limits
    x, y, rim = view.x * part.factor, view.y * part.factor, estimators.boundary(view.contact)
    across = part.width / view.spacing
    pitch = 240.0 / across  # points between nodes
    if across < _APART:
        shown = (view.x > x_min) & (view.x < x_max) & (view.y > y_min) & (view.y < y_max)
        if (found := mesh_of(view, view.pressure, shown)) is not None:
            mesh, _ = found
            edges = np.stack([mesh.x, mesh.y], axis=1)[mesh.edges] * part.factor
            axes.add_collection(LineCollection(cast(Any, edges), colors="0.85", linewidths=0.4, zorder=0))
    inside_size = 0.45 * pitch if across < _APART else 2.0 * pitch  # too many to tell apart: an area
    dot: dict[str, Any] = {"marker": "o", "mew": 0, "ls": "", "rasterized": across > _APART}
    stick = view.contact & view.stick if view.friction else None
    if stick is None:
        groups = [(view.contact & ~rim, IN_CONTACT, "in contact")]
    else:
        groups = [(stick, STICK, "stick"), (view.contact & ~stick, SLIP, "slip")]
    for nodes, color, label in groups:
        axes.plot(x[nodes], y[nodes], ms=inside_size, mfc=color, label=label, **dot)
    if stick is not None:
        dot |= {"mfc": "none", "mew": 0.8}  # a ring around a boundary node
    axes.plot(x[rim], y[rim], ms=max(0.45 * pitch, 1.0), color="black", label="boundary node", **dot)
    if (edge := _edge_of(view)) is not None:
        pieces = LineCollection(cast(Any, edge.segments * part.factor), colors="black", linewidths=0.9)
        pieces.set_label(rf"edge, $\sqrt{{A/\pi}}$ = {worded(edge.radius, 'm')}")
        axes.add_collection(pieces)
    fitted, words = _fitted(view, view.contact, "a", view.center)
    color = COMPUTED if stick is None else "black"
    part.outline(axes, fitted, fitted.center, label=f"fitted {words}", linestyle="-", color=color)
    if view.hertz is not None:
        a, b = view.hertz.semi_major, view.hertz.semi_minor
        exact = f"a = {worded(a, 'm')}" if b > 0.999 * a else f"{worded(a, 'm')} by {worded(b, 'm')}"
        part.outline(axes, view.hertz, view.center, label=f"Hertz, {exact}")
    if stick is not None and np.count_nonzero(stick) > 2:
        fitted, words = _fitted(view, stick, "c")
        part.outline(axes, fitted, fitted.center, label=f"stick: {words}", linestyle="-", color=THIRD)
    part.show(axes)
    legend = canvas.legend(loc="outside lower center", ncols=2, handlelength=1.6)
    for handle in legend.legend_handles[: len(groups) + 1]:
        cast(Line2D, handle).set_markersize(4.0)
    set_title(canvas, view.title)
    return canvas


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
