"""The nodes of a contact on their lattice, with fitted circles or ellipses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.tri import Triangulation

from ..arrays import Mask
from ..core import estimators
from ..errors import NotInResult
from ..result.history import ROUND
from ..result.mesh import triangles
from ..result.raster import SLIP, STICK
from ..result.result import Result
from ..result.view import StepView
from ..text import worded
from .plane import Part
from .registry import figure
from .style import COMPUTED, IN_CONTACT, THIRD, drawing, handles_of, legend_under, set_title

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_APART = 80  # spacings across the picture up to which nodes are distinguishable


@figure("boundary", "nodes in contact (and stick), fitted circle or ellipse")
def contact_boundary(result: Result | xarray.Dataset, step: int = -1, ax: Axes | None = None) -> Figure:
    """Draw the nodes in contact on the lattice, the circle (9.1)-(9.2) or ellipse fitted to them, and Hertz.

    With friction, sticking nodes have their own color and fitted ellipse (Figure 9.4).
    """
    view = StepView.of(result, step)
    if not view.contact.any():
        raise NotInResult("no node is in contact")
    part = Part.around([view], 1.2)
    width, height = part.size()
    canvas, axes = drawing(ax, max(width, 4.6), height + 0.6, equal=True)
    x_min, x_max, y_min, y_max = part.limits
    x, y, rim = view.x * part.factor, view.y * part.factor, estimators.boundary(view.contact)
    across = part.width / view.spacing
    pitch = 70.0 * (6.4 if part.is_wide else min(3.4, 6.0 / part.aspect)) / across  # points between nodes
    if across < _APART:
        shown = (view.x > x_min) & (view.x < x_max) & (view.y > y_min) & (view.y < y_max)
        corners = triangles(*shown.shape)
        mesh = Triangulation(x.ravel(), y.ravel(), corners[shown.ravel()[corners].any(axis=1)])
        links = np.stack([mesh.x, mesh.y], axis=1)[mesh.edges]
        axes.add_collection(LineCollection(cast(Any, links), colors="0.85", linewidths=0.4, zorder=0))
    inside_size = 0.45 * pitch if across < _APART else 2.0 * pitch  # too many: an area
    dot: dict[str, Any] = {"marker": "o", "mew": 0, "ls": "", "rasterized": across > _APART}
    stick = view.contact & view.stick if view.friction else None
    if stick is None:
        groups = [(view.contact & ~rim, IN_CONTACT, "in contact")]
    else:
        groups = [(stick, STICK, "stick"), (view.contact & ~stick, SLIP, "slip")]
    for nodes, color, label in groups:
        axes.plot(x[nodes], y[nodes], ms=inside_size, mfc=color, label=label, **dot)
    if stick is not None:
        dot |= {"mfc": "none", "mew": 0.8}  # boundary nodes as rings
    axes.plot(x[rim], y[rim], ms=max(0.45 * pitch, 1.0), color="black", label="boundary node", **dot)
    if view.has("gap"):
        edge = view.edges().contact()
        pieces = LineCollection(cast(Any, edge.segments * part.factor), colors="black", linewidths=0.9)
        axes_of = edge.ellipse.semi_major, edge.ellipse.semi_minor
        size = rf"$\sqrt{{A/\pi}}$ = {worded(edge.radius, 'm')}"
        if axes_of[1] < ROUND * axes_of[0]:
            size = " by ".join(worded(axis, "m") for axis in axes_of)
        pieces.set_label(f"edge, {size}")
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
    legend = legend_under(canvas, handles_of(axes), ax, size=8)
    for handle in legend.legend_handles[: len(groups) + 1]:
        cast(Line2D, handle).set_markersize(4.0)
    set_title(canvas, view.title, ax)
    return canvas


def _fitted(
    view: StepView, zone: Mask, letter: str, center: tuple[float, float] | None = None
) -> tuple[estimators.Ellipse, str]:
    """Return the circle of the boundary nodes of a zone, or the ellipse of its moments, and its label."""
    moments = estimators.moment_ellipse(view.x, view.y, zone)
    if moments.semi_minor > ROUND * moments.semi_major:
        center = center or moments.center
        radius = estimators.boundary_circle(view.x, view.y, zone, view.spacing, center).radius
        return estimators.Ellipse(radius, radius, 0.0, center), f"circle, {letter} = {worded(radius, 'm')}"
    return moments, f"ellipse, {worded(moments.semi_major, 'm')} by {worded(moments.semi_minor, 'm')}"
