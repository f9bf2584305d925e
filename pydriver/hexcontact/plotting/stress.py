"""Stress below the contact, in a section across it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..analytic.hertz_gap import is_compliant
from ..arrays import Array
from ..errors import NotInResult
from ..interior.stress import LOADED, below, bodies_of
from ..result.interpolate import tractions_of
from ..result.view import StepView, dataset_of, title_of
from ..text import scaled, worded
from ..variables import EDGES
from .registry import figure
from .report_data import kept_steps
from .sections import Cut, Point
from .style import COMPUTED, EXACT, GUIDE, drawing, legend_below, mark_largest, new_figure, set_title
from .zones import draw_zone_bars

if TYPE_CHECKING:
    import xarray

from ..result.result import Result

_DEPTH = 0.6  # of the section, in its widths
_POINTS = 121  # along the line; 60 below each other
_LEVELS = 12


@figure("stress", "von Mises stress below the contact, in a section")
def stress(
    result: Result | xarray.Dataset, step: int = -1, angle: float = 0.0, through: Point | None = None
) -> Figure:
    """Draw the equivalent stress of von Mises in a section below the contact."""
    view = StepView.of(result, step)
    cut = Cut.of([view], angle, through)
    along = np.linspace(0.0, cut.line.length, _POINTS)
    depth = np.linspace(0.0, _DEPTH * cut.line.length, _POINTS // 2)
    x, y = cut.line.points(along)
    points = np.stack(np.broadcast_arrays(x[None], y[None], depth[:, None]), axis=-1)
    found = _below(view, points, "von_mises_stress")
    values = found["von_mises_stress"].values

    canvas, axes = drawing(None, 5.6, 3.4, equal=True)
    to_stress, unit = scaled(float(values.max()), "Pa")
    length = cut.lengths[0]
    drawn = axes.contourf(cut.along(along), depth * length, values * to_stress, _LEVELS)
    canvas.colorbar(drawn, ax=axes, label=f"von Mises stress in body {found.attrs['body']} ({unit})")
    mark_largest(axes, *np.meshgrid(cut.along(along), depth * length), values)
    place = np.linspace(0.0, cut.line.length, 8 * _POINTS)
    draw_zone_bars(axes, view, cut.line.points(place), cut.along(place), -0.02 * depth[-1] * length)
    axes.legend(loc="lower right", labelcolor="white", handlelength=1.2)
    cut.show(axes)
    axes.set(ylabel=f"depth ({cut.lengths[1]})", aspect="equal", xlim=cut.along(along)[[0, -1]])
    axes.set_ylim(depth[-1] * length, -0.05 * depth[-1] * length)
    set_title(canvas, view.title)
    return canvas


@figure("trailing_edge", "stress at both ends of the contact, over the load history")
def trailing_edge(result: Result, depth: float = 0.0, angle: float = 0.0) -> Figure:
    """Draw the stress along a section at both ends of the contact over the load steps.

    Parameters
    ----------
    depth : float
        Depth of the points, m; by default they lie on the surface.
    angle : float
        Direction of the section from x, rad; its ends are those of the largest contact.

    Raises
    ------
    ValueError
        If pressures were not kept, or the result does not contain the moduli of the bodies.
    """
    views = [StepView.of(result, number) for number in kept_steps(result)]
    if not views:
        raise NotInResult("the pressure was not kept (output.fields)")
    largest = max(views, key=lambda view: int(view.contact.sum()))
    cut = Cut.of([largest], angle, None)
    place = np.linspace(0.0, cut.line.length, 16 * _POINTS)
    inside = place[largest.touches(*cut.line.points(place))]
    x, y = cut.line.points(inside[[0, -1]])
    points = np.stack([x, y, np.full(2, depth)], axis=-1)
    names = ("stress_xx", "stress_yy", "stress_xy")
    along = np.array([math.cos(angle) ** 2, math.sin(angle) ** 2, math.sin(2.0 * angle)])
    found = [_below(view, points, *names) for view in views]
    stress = np.array(
        [sum(c * one[name].values for c, name in zip(along, names, strict=True)) for one in found]
    )

    canvas = new_figure(5.2, 3.0)
    axes = canvas.add_subplot()
    to_stress, unit = scaled(float(abs(stress).max()), "Pa")
    numbers = [view.number for view in views]
    for end, (color, mark) in enumerate(((COMPUTED, "o"), (EXACT, "s"))):
        label = f"end at $x$ = {worded(float(x[end]), 'm')}".replace("-", "\u2212")
        axes.plot(numbers, stress[:, end] * to_stress, f"-{mark}", color=color, ms=3.0, label=label)
    axes.axhline(0.0, color=GUIDE, lw=0.7)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    symbol = r"$\sigma_{xx}$" if angle == 0.0 else r"$\sigma$ along the section"
    axes.set(xlabel="load step", ylabel=f"{symbol} in body {found[0].attrs['body']} ({unit})")
    legend_below(axes, ncols=2, fontsize=8)
    deep = f"{worded(depth, 'm')} deep" if depth else "at the surface"
    set_title(canvas, f"{title_of(dataset_of(result))}, {deep}")
    return canvas


def _below(view: StepView, points: Array, *names: str) -> xarray.Dataset:
    """Return stresses of a load step at points of body 1, or of body 2 if body 1 is rigid."""
    wanted = LOADED if is_compliant(view.data.attrs) else (*LOADED, *EDGES)
    fields = {name: view.data[name].values for name in wanted if view.has(name)}
    bodies = bodies_of(str(view.data.attrs.get("deck", "")))
    body = 2 if bodies and bodies[0].rigid else 1
    given = view.lattice, [fields], bodies, body, {"points": points}, names
    return below(
        *given, friction=view.friction, surface=lambda _: tractions_of(view.data, view.lattice, "edges")
    )
