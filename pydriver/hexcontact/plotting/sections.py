"""Sections: pressure and shear traction along a line, beside the closed solutions that apply."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..analytic.shear import ClosedForms, PartialSlip
from ..result.view import StepView, dataset_of, scaled, title_of, worded
from .plane import step_label
from .registry import figure
from .style import COMPUTED, EXACT, GUIDE, THIRD, legend_below, new_figure, set_title, shades

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

    from ..result.result import Result

Array = NDArray[np.float64]
Point = tuple[float, float]

_APART = 100  # nodes along a line that can be told apart
_FINER = 8  # points between nodes where the line misses them


@dataclass(frozen=True)
class Cut:
    """A line across the contact.

    Attributes
    ----------
    start : tuple of float
        A point of the line, m.
    angle : float
        Its direction from x, rad.
    place : ndarray
        Distance of the points that are drawn from `start`, m.
    at_nodes : bool
        Whether the points are nodes.
    through : tuple of float, optional
        The point that was asked for, if it was.
    """

    start: Point
    angle: float
    place: Array
    at_nodes: bool
    through: Point | None

    @classmethod
    def of(cls, views: Sequence[StepView], angle: float, through: Point | None) -> Cut:
        """Cut the contacts of some steps of one result through a point; by default their center.

        At multiples of 30 degrees through a node, as the one nearest to the center, the points are nodes.
        """
        view = views[0]
        nearest = through or view.center
        node = int(np.argmin(np.hypot(view.x - nearest[0], view.y - nearest[1])))
        start = through or (float(view.x.flat[node]), float(view.y.flat[node]))
        on_node = np.hypot(view.x.flat[node] - start[0], view.y.flat[node] - start[1]) < 1e-6 * view.spacing
        row, between_rows = (bool(on_node and abs(f(3.0 * angle)) < 1e-9) for f in (np.sin, np.cos))
        at_nodes = row or between_rows
        apart = view.spacing if row else np.sqrt(3.0) * view.spacing  # nodes on the line
        step = apart if at_nodes else view.spacing / _FINER
        reach = max(
            float(np.hypot(x - start[0], y - start[1]))
            for one in views
            for x in one.window(1.3)[:2]
            for y in one.window(1.3)[2:]
        )
        count = int(np.ceil(reach / step))
        place = np.asarray(np.arange(-count, count + 1) * step)
        cut = cls(start, angle, place, at_nodes, through)
        loaded = np.any([one.at(*cut.points) > 0.0 for one in views], axis=0)
        inside = np.flatnonzero(loaded)
        if inside.size:
            margin = 3 if at_nodes else 2 * _FINER
            place = place[max(inside[0] - margin, 0) : inside[-1] + margin + 1]
        return cls(start, angle, place, at_nodes, through)

    @property
    def points(self) -> tuple[Array, Array]:
        """Coordinates of the points."""
        return self.along(self.place)

    def along(self, place: Array) -> tuple[Array, Array]:
        """Return the coordinates of points at some distances from the start."""
        return self.start[0] + place * np.cos(self.angle), self.start[1] + place * np.sin(self.angle)

    @property
    def fine(self) -> Array:
        """Distances at which a closed solution is drawn."""
        return np.linspace(self.place[0], self.place[-1], 1001)

    @property
    def axis(self) -> str:
        """The coordinate along the line, "x" or "y"; empty along an oblique line."""
        return {0.0: "x", 90.0: "y"}.get(round(float(np.degrees(self.angle)), 9), "")

    @property
    def origin(self) -> float:
        """What is added to the distance to get what is on the axis: x itself along x, y along y."""
        return {"x": self.start[0], "y": self.start[1], "": 0.0}[self.axis]

    def label(self, unit: str) -> str:
        """Return the label of the axis."""
        if self.axis:
            other, place = ("y", self.start[1]) if self.axis == "x" else ("x", self.start[0])
            return f"{self.axis} ({unit})" + (f" at {other} = {worded(place, 'm')}" if self.through else "")
        point = "the center"
        if self.through:
            factor, length = scaled(max(map(abs, self.through)), "m")
            point = f"({self.through[0] * factor:.3g}, {self.through[1] * factor:.3g}) {length}"
        return f"distance from {point} along {np.degrees(self.angle):g}° ({unit})"

    def components(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the components of a vector along and across the line (to its left)."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        return x * cosine + y * sine, y * cosine - x * sine

    def names(self) -> tuple[str, str]:
        """Return the names of these components."""
        along_axes = {"x": ("$q_x$", "$q_y$"), "y": ("$q_y$", "$-q_x$")}
        return along_axes.get(self.axis, ("$q$ along the line", "$q$ across the line"))

    def look(self) -> dict[str, Any]:
        """Return how values are drawn: nodes as circles if they can be told apart."""
        if not self.at_nodes or self.place.size >= _APART:
            return {"ls": "-"}
        return {
            "marker": "o",
            "ms": 3.5 if self.place.size < 60 else 2.5,
            "mfc": "none",
            "mew": 0.9,
            "ls": "",
        }

    def beside(self, color: str, family: bool = False) -> dict[str, Any]:
        """Return how a closed solution is drawn: under circles in a color, over a line dashed."""
        if "marker" in self.look():
            return {"color": color, "ls": "-", "lw": 0.9 if family else 1.3, "zorder": 2}
        return {"color": "black" if family else color, "ls": "--", "lw": 0.7 if family else 1.3, "zorder": 5}


def hertz_on(view: StepView, cut: Cut, place: Array) -> Array:
    """Pressure of Hertz along a line (Pa)."""
    if view.hertz is None:
        raise ValueError("there is no Hertz solution for this gap")
    x, y = cut.along(place)
    return view.hertz.pressure(x - view.center[0], y - view.center[1])


def _pressure_range(axes: Axes, cut: Cut, spacing: float, to_length: float) -> None:
    place, rim = (cut.origin + cut.place) * to_length, 0.5 * spacing * to_length
    axes.set_xlim(place[0] - rim, place[-1] + rim)


def draw_section(canvas: FigureBase, view: StepView, angle: float, through: Point | None = None) -> None:
    """Draw the pressure along a line, and below it the difference from Hertz where there is a solution."""
    if view.hertz is None:
        axes = bottom = canvas.add_subplot()
    else:
        axes, bottom = canvas.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    to_length, length = scaled(max(np.abs(view.window()[:2]).max(), view.spacing), "m")
    to_stress, stress = scaled(float(view.pressure.max()), "Pa")
    cut = Cut.of([view], angle, through)
    p, place = view.at(*cut.points), (cut.origin + cut.place) * to_length
    look = cut.look()
    few = "marker" in look
    axes.plot(place, p * to_stress, color=COMPUTED, label="computed", zorder=3, **look)
    if view.hertz is not None:
        name = "Hertz" if view.hertz_holds else "Hertz (no friction)"
        exact = hertz_on(view, cut, cut.fine) * to_stress
        axes.plot((cut.origin + cut.fine) * to_length, exact, label=name, **cut.beside(EXACT))
        apart = 100 * (p - hertz_on(view, cut, cut.place)) / view.hertz.max_pressure
        bottom.axhline(0.0, color=GUIDE, lw=0.7)
        bottom.plot(place, apart, "o-" if few else "-", ms=2.5, lw=0.7, color=COMPUTED, label="as solved")
        if view.pressure_field is not None:
            to_edge = view.pressure_field(*cut.points) - hertz_on(view, cut, cut.place)
            style: dict[str, Any] = {"color": THIRD, "marker": "s" if few else "", "mfc": "none", "ms": 3.5}
            apart = 100 * to_edge / view.hertz.max_pressure
            bottom.plot(place, apart, lw=0.7, label="to the edge", **style)
            bottom.legend(fontsize=8, ncols=2, loc="lower center", handlelength=1.2)
        bottom.set_ylabel(f"{'error' if view.hertz_holds else 'difference'}\n(% of $p_0$)")
        axes.tick_params(labelbottom=False)
        axes.legend(loc="lower center")
    axes.set_ylabel(f"pressure $p$ ({stress})")
    axes.set_ylim(0.0, 1.08 * to_stress * max(float(p.max()), np.finfo(float).tiny))
    _pressure_range(axes, cut, view.spacing, to_length)
    bottom.set_xlabel(cut.label(length))


@figure("section", "pressure along a line, and its difference from Hertz")
def section(
    result: Result | xarray.Dataset, step: int = -1, angle: float = 0.0, through: Point | None = None
) -> Figure:
    """Draw the pressure along a line through the contact; beside Hertz if the initial gap is quadratic.

    Parameters
    ----------
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    step : int
        Number of the load step, from 1; -1 is the last one.
    angle : float
        Direction of the line from x, rad; at multiples of 30 degrees its points are nodes.
    through : tuple of float, optional
        A point (m) that the line passes through; by default the node nearest to the center.

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
    view = StepView.of(result, step)
    canvas = new_figure(4.6, 4.2)
    draw_section(canvas, view, angle, through)
    set_title(canvas, view.title)
    return canvas


# --- shear traction -------------------------------------------------------------------------------


@figure("tractions", "pressure and shear traction along a line, at some steps", needs="friction")
def tractions(
    result: Result | xarray.Dataset,
    steps: int | Sequence[int] = -1,
    angle: float = 0.0,
    through: Point | None = None,
) -> Figure:
    """Draw pressure and shear traction along a line, of one load step or a family of them.

    Closed solutions stand beside where they apply: Hertz, Cattaneo-Mindlin, Mindlin-Deresiewicz.

    Parameters
    ----------
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    steps : int or sequence of int
        Numbers of the load steps, from 1; -1 is the last one.
    angle : float
        Direction of the line from x, rad; at multiples of 30 degrees its points are nodes.
    through : tuple of float, optional
        A point (m) that the line passes through; by default the node nearest to the center.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the contact is frictionless, or the tractions of that step were not kept.
    """
    chosen = [steps] if isinstance(steps, int) else list(steps)
    views = [StepView.of(result, step) for step in chosen]
    closed = ClosedForms(dataset_of(result))
    exact = [closed.partial_slip(view.number) for view in views]
    cut = Cut.of(views, angle, through)
    if len(views) == 1:
        canvas = new_figure(4.8, 5.0)
        upper, lower = canvas.subplots(2, 1, sharex=True, height_ratios=(2, 3))
        draw_pressures(upper, views, cut)
        draw_shear(lower, views[0], exact[0], cut)
        upper.set_xlabel("")
        upper.tick_params(labelbottom=False)
        upper.legend(loc="lower center")
        set_title(canvas, views[0].title)
    else:
        canvas = _family(views, exact, cut, title_of(dataset_of(result)))
    return canvas


def draw_pressures(axes: Axes, views: Sequence[StepView], cut: Cut) -> None:
    """Draw the pressure of some steps along a line, and Hertz where the pressure is his."""
    to_length, length = scaled(max(np.abs(views[0].window()[:2]).max(), views[0].spacing), "m")
    largest = max(float(view.pressure.max()) for view in views)
    to_stress, stress = scaled(largest, "Pa")
    place, fine = (cut.origin + cut.place) * to_length, (cut.origin + cut.fine) * to_length
    for view, color in zip(views, [COMPUTED] if len(views) == 1 else shades(len(views)), strict=True):
        p = view.at(*cut.points) * to_stress
        axes.plot(place, p, color=color, label="computed", zorder=3, **cut.look())
        if view.hertz_holds:
            line = cut.beside(EXACT) if len(views) == 1 else cut.beside(color, family=True)
            axes.plot(fine, hertz_on(view, cut, cut.fine) * to_stress, label="Hertz", **line)
    axes.set(ylabel=f"pressure $p$ ({stress})", xlabel=cut.label(length))
    axes.set_ylim(0.0, 1.08 * largest * to_stress or 1.0)
    _pressure_range(axes, cut, views[0].spacing, to_length)


def draw_shear(axes: Axes, view: StepView, exact: PartialSlip | None, cut: Cut) -> None:
    """Draw the shear traction of a step along a line: components, size, and what friction carries."""
    q_x, q_y = view.field("traction_x"), view.field("traction_y")
    along, across = cut.components(view.at(*cut.points, q_x), view.at(*cut.points, q_y))
    bound = view.friction * view.at(*cut.points) if np.isfinite(view.friction) else np.zeros(cut.place.size)
    largest = max(float(np.abs(bound).max()), float(np.hypot(along, across).max()))
    to_length, length = scaled(max(np.abs(view.window()[:2]).max(), view.spacing), "m")
    to_stress, stress = scaled(largest, "Pa")
    place, fine = (cut.origin + cut.place) * to_length, (cut.origin + cut.fine) * to_length
    size = np.hypot(along, across)
    low, high = (max(float((sign * np.stack([along, across])).max()), 0.0) for sign in (-1.0, 1.0))
    with_size = np.abs(across).max() > 0.02 * largest
    if with_size:
        high = float(size.max())
    # what friction carries is drawn on the sides that the traction uses, there whole
    used = [sign for sign, reach in ((1.0, high), (-1.0, low)) if reach > 0.05 * largest] or [1.0]
    if bound.any():
        name = r"$\pm\mu p$" if len(used) == 2 else r"$\mu p$" if used == [1.0] else r"$-\mu p$"
        for sign in used:
            edge = sign * bound * to_stress
            axes.fill_between(place, edge, color="0.92", lw=0, zorder=0)
            axes.plot(place, edge, color=GUIDE, lw=0.8, label=name if sign == used[0] else None, zorder=1)
    axes.axhline(0.0, color=GUIDE, lw=0.5, zorder=1)
    if with_size:
        axes.plot(place, size * to_stress, color="black", lw=0.9, ls=":", label="$|q|$", zorder=2)
    for values, color, name in zip((along, across), (COMPUTED, THIRD), cut.names(), strict=True):
        axes.plot(place, values * to_stress, color=color, label=name, zorder=4, **cut.look())
    if exact is not None:
        for values, label in zip(
            cut.components(*exact.traction(*cut.along(cut.fine))), (exact.name, None), strict=True
        ):
            axes.plot(fine, values * to_stress, label=label, **cut.beside(EXACT))
    axes.set(ylabel=f"shear traction ({stress})", xlabel=cut.label(length))
    below, above = (largest if sign in used else reach for sign, reach in ((-1.0, low), (1.0, high)))
    room = 0.1 * (largest or 1.0 / to_stress)
    axes.set_ylim(-(below + room) * to_stress, (above + room) * to_stress)
    _pressure_range(axes, cut, view.spacing, to_length)
    legend_below(axes, ncols=3, columnspacing=1.2)


def _family(views: Sequence[StepView], exact: Sequence[PartialSlip | None], cut: Cut, title: str) -> Figure:
    """Draw pressure and both components of the shear traction of several steps, one panel each."""
    vectors = [(view.field("traction_x"), view.field("traction_y")) for view in views]
    parts = [
        cut.components(*(view.at(*cut.points, q) for q in vector))
        for view, vector in zip(views, vectors, strict=True)
    ]
    largest = max(float(np.abs(part).max()) for pair in parts for part in pair)
    shown = [k for k in (0, 1) if max(float(np.abs(pair[k]).max()) for pair in parts) > 0.005 * largest] or [
        0
    ]
    canvas = new_figure(6.6, 2.2 + 2.3 * len(shown))
    panels = canvas.subplots(1 + len(shown), 1, sharex=True, squeeze=False)[:, 0]
    draw_pressures(panels[0], views, cut)
    panels[0].set_title("\n".join(textwrap.wrap(title, 60)), fontsize=10)
    to_length, length = scaled(max(np.abs(views[0].window()[:2]).max(), views[0].spacing), "m")
    to_stress, stress = scaled(largest, "Pa")
    place, fine = (cut.origin + cut.place) * to_length, (cut.origin + cut.fine) * to_length
    bounded = bool(np.isfinite(views[-1].friction))
    limit = views[-1].friction * views[-1].at(*cut.points) if bounded else np.zeros(place.size)
    for axes, k in zip(panels[1:], shown, strict=True):
        axes.axhline(0.0, color=GUIDE, lw=0.5, zorder=1)
        signs = {float(np.sign(pair[k][np.argmax(np.abs(pair[k]))])) for pair in parts} - {0.0}
        for pair, solution, color in zip(parts, exact, shades(len(views)), strict=True):
            joined = {"ls": "-", "lw": 0.6} if solution is None else {}
            axes.plot(place, pair[k] * to_stress, color=color, zorder=3, **{**cut.look(), **joined})
            if solution is not None:
                closed = cut.components(*solution.traction(*cut.along(cut.fine)))[k]
                axes.plot(fine, closed * to_stress, **cut.beside(color, family=True))
        if bounded and np.abs(parts[-1][k]).max() > 0.1 * limit.max():
            for sign in signs:
                axes.plot(place, sign * limit * to_stress, color=GUIDE, lw=0.9, ls=":", zorder=1)
        axes.set_ylabel(f"{cut.names()[k]} ({stress})")
    for axes in panels[:-1]:
        axes.set_xlabel("")
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel(cut.label(length))
    handles = [
        Line2D([], [], color=color, label=step_label(view))
        for view, color in zip(views, shades(len(views)), strict=True)
    ]
    if bounded:
        handles.append(
            Line2D([], [], color=GUIDE, ls=":", lw=0.9, label=f"$\\mu p$ in step {views[-1].number}")
        )
    named = ["Hertz"] if any(view.hertz_holds for view in views) else []
    named += sorted({solution.name for solution in exact if solution is not None})
    if named:
        handles.append(Line2D([], [], color="black", label="computed", **cut.look()))
        handles.append(Line2D([], [], label=",\n".join(named), **cut.beside("black", family=True)))
    canvas.legend(handles=handles, loc="outside right upper", handlelength=1.6)
    return canvas
