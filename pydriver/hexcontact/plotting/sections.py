"""Sections: pressure, shear traction and worn depth along a line, with closed solutions where they apply."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D

from ..analytic.compare import PartialSlip
from ..arrays import Array, Dataset
from ..core.lattice import section_ends
from ..errors import DeckError, NotInResult
from ..result.result import Result
from ..result.step import Line
from ..result.view import StepView, dataset_of, title_of
from ..text import scaled, worded
from . import style
from .maps import closed_solutions, views_of
from .registry import figure

Point = tuple[float, float]

_APART = 130  # nodes along a line that are distinguishable
_SIDES = {(False, True): r"$\mu p$", (True, False): r"$-\mu p$", (True, True): r"$\pm\mu p$"}
_COMPARED = 10  # steps up to which closed solutions are drawn
_JOINED: dict[str, Any] = {"ls": "-", "lw": 1.1}  # curves of several steps
_THIN: dict[str, Any] = {"color": "black", "ls": (0, (4, 3)), "lw": 0.7}  # closed solutions with them
_FINER = 8  # points along a spacing where values are joined, since tractions are curved at edges


def line_of(views: Iterable[StepView], angle: float, through: Point | None = None) -> Line:
    """Return the line across the contacts of some steps of one result, see `section_ends`.

    Without any contact it crosses the whole window.
    """
    lattice, loaded = None, np.zeros(())
    for view in views:
        lattice, loaded = view.lattice, np.maximum(loaded, view.pressure)
    assert lattice is not None
    pressure = loaded if loaded.any() else np.ones(loaded.shape)
    return Line(*section_ends(lattice, pressure, angle, through))


@dataclass(frozen=True)
class Cut:
    """Hold the line of a section, and the places along it at which values are drawn.

    These are the nodes if enough lie on the line, but not too many, and of one step; else its crossings with
    lattice lines, between which fields are linear away from edges, and points between them.
    """

    line: Line
    angle: float  # its direction from x, rad
    place: Array  # distances (m) from its start
    at_nodes: bool  # whether the places are nodes, drawn as circles
    through: Point | None  # a given point, or one of a window that repeats, m

    @classmethod
    def of(cls, views: Sequence[StepView], angle: float, through: Point | None = None) -> Cut:
        """Return the cut through the contacts of some steps of one result, see `line_of`."""
        line, lattice = line_of(views, angle, through), views[0].lattice
        corners = line.corners(lattice)
        index = (np.stack(line.points(corners), axis=-1) - views[0].start) @ np.linalg.inv(lattice.basis)
        if through and not ((index > -1.0) & (index < lattice.shape[::-1])).all(axis=1).any():
            raise DeckError(f"expected a line that crosses the window; it goes through {through} m")
        if lattice.periodic and not through:  # no contact is the middle one
            x, y = (
                np.round(at / lattice.spacing, 6) * lattice.spacing for at in line.points(np.array(line.zero))
            )
            through = float(x) + 0.0, float(y) + 0.0
        nodes = corners[(abs(index - np.round(index)) < 1e-6).all(axis=1)]
        on_nodes = nodes.size > 0.4 * (corners.size - 2)  # at multiples of 30 degrees
        at_nodes = on_nodes and nodes.size < _APART and len(views) == 1
        between = np.arange(0.0, line.length, lattice.spacing / _FINER)
        return cls(line, angle, nodes if at_nodes else np.union1d(corners, between), at_nodes, through)

    def values(self, view: StepView, field: str | Array = "pressure") -> Array:
        """Return a field, see `StepView.at`, at `place`."""
        return view.at(*self.line.points(self.place), field)

    def hertz(self, view: StepView, place: Array) -> Array:
        """Return the pressure of Hertz (Pa) at distances from the start (m)."""
        assert view.hertz is not None
        x, y = self.line.points(place)
        return view.hertz.pressure(x - view.center[0], y - view.center[1])

    @property
    def fine(self) -> Array:
        """Distances from the start at which a closed solution is drawn."""
        return np.linspace(0.0, self.line.length, 1001)

    @property
    def axis(self) -> str:
        """The coordinate along the line, "x" or "y"; empty along an oblique line."""
        return {0.0: "x", 90.0: "y"}.get(round(float(np.degrees(self.angle)), 9), "")

    @property
    def lengths(self) -> tuple[float, str]:
        """Factor and unit of lengths."""
        return scaled(float(max(abs(v) for v in self._shown(np.array([0.0, self.line.length])))), "m")

    def _shown(self, place: Array) -> Array:
        """Return coordinates of the axis (m) at distances from the start: x along x, y along y."""
        start = {"x": self.line.start[0], "y": self.line.start[1]}.get(self.axis, -self.line.zero)
        return start + place

    def along(self, place: Array) -> Array:
        """Return coordinates of the axis in its unit at distances from the start (m)."""
        return self._shown(place) * self.lengths[0]

    def show(self, axes: Axes) -> None:
        """Set label and limits of the axis."""
        low, high = self.along(np.array([-0.02, 1.02]) * self.line.length)
        axes.set(xlim=(low, high), xlabel=self._label(self.lengths[1]))

    def _label(self, unit: str) -> str:
        if self.axis:
            other, place = ("y", self.line.start[1]) if self.axis == "x" else ("x", self.line.start[0])
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

    def tractions(self, view: StepView) -> tuple[Array, Array]:
        """Return the shear traction along and across the line."""
        for axis in "xy":
            view.field(f"traction_{axis}")  # an error if it was not kept
        parts = (self.values(view, f"traction_{axis}") for axis in "xy")
        return self.components(*parts)

    def exact_tractions(self, exact: PartialSlip) -> tuple[Array, Array]:
        """Return the tractions of a closed solution along and across the line, at the distances `fine`."""
        return self.components(*exact.traction(*self.line.points(self.fine)))

    def names(self) -> tuple[str, str]:
        """Return the names of these components."""
        along_axes = {"x": ("$q_x$", "$q_y$"), "y": ("$q_y$", "$-q_x$")}
        return along_axes.get(self.axis, ("$q$ along the line", "$q$ across the line"))

    def look(self) -> dict[str, Any]:
        """Return the style of values: circles at nodes if they are distinguishable."""
        if not self.at_nodes:
            return {"ls": "-"}
        size = 3.5 if self.place.size < 80 else 2.5
        return {"marker": "o", "ms": size, "mfc": "none", "mew": 0.9, "ls": ""}

    def beside(self, color: str) -> dict[str, Any]:
        """Return the style of a closed solution: a line under circles, dashes over a line."""
        dash, order = ("-", 2) if self.at_nodes else ("--", 5)
        return {"color": color, "ls": dash, "zorder": order}


# --- pressure -------------------------------------------------------------------------------------


def draw_pressures(axes: Axes, views: Sequence[StepView], cut: Cut, always: bool = False) -> None:
    """Draw the pressure of some steps along a line, with Hertz where it holds, or always."""
    pressures = [cut.values(view) for view in views]
    largest = max(float(p.max()) for p in pressures)
    to_stress, stress = scaled(largest, "Pa")
    place, fine = cut.along(cut.place), cut.along(cut.fine)
    single = len(views) == 1
    look = cut.look() if single else _JOINED
    for view, p, color in zip(
        views, pressures, [style.COMPUTED] if single else style.shades(len(views)), strict=True
    ):
        axes.plot(place, p * to_stress, color=color, label="computed", zorder=3, **look)
        if len(views) <= _COMPARED and (view.hertz_holds or (always and view.hertz is not None)):
            line = cut.beside(style.EXACT) if single else {**_THIN, "zorder": 5}
            name = "Hertz" if view.hertz_holds else "Hertz (no friction)"
            axes.plot(fine, cut.hertz(view, cut.fine) * to_stress, label=name, **line)
    note = "\nunbounded at an end" * any(view.is_unbounded for view in views)
    axes.set(ylabel=f"pressure $p$ ({stress}){note}", ylim=(0.0, 1.08 * largest * to_stress or 1.0))
    cut.show(axes)


def draw_section(canvas: FigureBase, view: StepView, angle: float, through: Point | None = None) -> None:
    """Draw the pressure along a line, and below it the difference from Hertz for quadratic gaps."""
    cut, hertz = Cut.of([view], angle, through), view.hertz
    if hertz is None:
        draw_pressures(canvas.add_subplot(), [view], cut)
        return
    axes, bottom = canvas.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    draw_pressures(axes, [view], cut, always=True)
    axes.label_outer()
    axes.legend(loc="lower center")
    bottom.axhline(0.0, color=style.GUIDE, lw=0.7)
    edges = view.tractions.source == "edges"
    color = style.THIRD if edges else style.COMPUTED
    curves = [
        (cut.values(view, view.pressure), color, "as solved", {"marker": "s", "mfc": "none", "ms": 3.5})
    ]
    if edges:
        curves.append((cut.values(view), style.COMPUTED, "to the edge", {"marker": "o", "ms": 2.5}))
    for p, color, label, dots in curves:
        difference = 100 * (p - cut.hertz(view, cut.place)) / hertz.max_pressure
        look: dict[str, Any] = dots if cut.at_nodes else {}
        bottom.plot(cut.along(cut.place), difference, lw=0.7, color=color, label=label, **look)
    if edges:
        bottom.legend(fontsize=8, ncols=2, handlelength=1.2)
    bottom.set_ylabel(f"{'error' if view.hertz_holds else 'difference'}\n(% of $p_0$)")
    cut.show(bottom)


@figure("section", "pressure along a line, and its difference from Hertz")
def section(
    result: Result | Dataset,
    step: int = -1,
    angle: float = 0.0,
    through: Point | None = None,
    ax: Axes | None = None,
    source: str | None = None,
) -> Figure:
    """Draw the pressure along a line through the contact, with Hertz if the initial gap is quadratic.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Axes for the pressure, without its difference from Hertz; by default those of a new figure.
    """
    view = StepView(result, step, source)
    if ax is not None:
        draw_pressures(ax, [view], Cut.of([view], angle, through), always=True)
        ax.legend(loc="lower center")
        return style.drawing(ax, 0.0, 0.0)[0]
    canvas = style.new_figure(4.6, 4.2)
    draw_section(canvas, view, angle, through)
    return style.set_title(canvas, view.title)


# --- shear traction -------------------------------------------------------------------------------


@figure("tractions", "pressure and shear traction along a line, at some steps", needs="friction")
def tractions(
    result: Result | Dataset,
    steps: int | Sequence[int] = -1,
    angle: float = 0.0,
    through: Point | None = None,
    ax: Axes | None = None,
    source: str | None = None,
) -> Figure:
    """Draw pressure and shear traction along a line, of one load step or of several.

    Closed solutions are drawn where they apply: Hertz, Cattaneo-Mindlin, Mindlin-Deresiewicz.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Axes for the shear traction of one load step; by default those of a new figure, with the pressure
        above.
    """
    views, labels, title = views_of(result, steps, source)
    exact = closed_solutions(result, views)
    cut = Cut.of(views, angle, through)
    if ax is not None:
        if len(views) > 1:
            raise DeckError(f"ax holds the tractions of one load step, not of {len(views)}")
        draw_shear(ax, views[0], exact[0], cut)
        return style.drawing(ax, 0.0, 0.0)[0]
    if len(views) > 1:
        return _family(views, labels, exact, cut, title)
    canvas = style.new_figure(4.8, 5.0)
    upper, lower = canvas.subplots(2, 1, sharex=True, height_ratios=(2, 3))
    draw_pressures(upper, views, cut)
    draw_shear(lower, views[0], exact[0], cut)
    upper.label_outer()
    upper.legend(loc="lower center")
    return style.set_title(canvas, title)


def draw_shear(axes: Axes, view: StepView, exact: PartialSlip | None, cut: Cut) -> None:
    """Draw the shear traction of a step along a line: components, size, and the bound mu p."""
    along, across = cut.tractions(view)
    size = np.hypot(along, across)
    bound = np.zeros(cut.fine.shape)
    if np.isfinite(view.friction):
        bound = view.friction * view.at(*cut.line.points(cut.fine))
    largest = max(float(bound.max()), float(size.max()))
    to_stress, stress = scaled(largest, "Pa")
    place = cut.along(cut.place)
    low, high = (max(float((sign * np.stack([along, across])).max()), 0.0) for sign in (-1.0, 1.0))
    with_size = np.abs(across).max() > 0.02 * largest
    if with_size:
        high = float(size.max())
        axes.plot(place, size * to_stress, color="black", lw=0.9, ls=":", label="$|q|$", zorder=2)
    # The bound is drawn on the sides on which the traction lies.
    used = [sign for sign, reach in ((1.0, high), (-1.0, low)) if reach > 0.05 * largest] or [1.0]
    if bound.any():
        name = _SIDES[-1.0 in used, 1.0 in used]
        for sign in used:
            edge = sign * bound * to_stress
            axes.fill_between(cut.along(cut.fine), edge, color="0.92", lw=0, zorder=0)
            label = name if sign == used[0] else None
            axes.plot(cut.along(cut.fine), edge, color=style.GUIDE, lw=0.8, label=label, zorder=1)
    axes.axhline(0.0, color=style.GUIDE, lw=0.5, zorder=1)
    for values, color, name in zip((along, across), (style.COMPUTED, style.THIRD), cut.names(), strict=True):
        axes.plot(place, values * to_stress, color=color, label=name, zorder=4, **cut.look())
    if exact is not None:
        for values, label in zip(cut.exact_tractions(exact), (exact.name, None), strict=True):
            axes.plot(cut.along(cut.fine), values * to_stress, label=label, **cut.beside(style.EXACT))
    below, above = (largest if sign in used else reach for sign, reach in ((-1.0, low), (1.0, high)))
    room = 0.1 * (largest or 1.0 / to_stress)
    axes.set_ylim(-(below + room) * to_stress, (above + room) * to_stress)
    axes.set_ylabel(f"shear traction ({stress})")
    cut.show(axes)
    style.legend_below(axes, ncols=3, columnspacing=1.2)


def _family(
    views: Sequence[StepView],
    labels: Sequence[str],
    exact: Sequence[PartialSlip | None],
    cut: Cut,
    title: str,
) -> Figure:
    """Draw pressure and shear tractions of several steps, a panel each; closed solutions thin and dashed."""
    tractions = np.array([cut.tractions(view) for view in views])  # step, component, place
    peaks = np.abs(tractions).max(axis=(0, 2))
    shown = [k for k in (0, 1) if peaks[k] > 0.005 * peaks.max()] or [0]
    canvas = style.new_figure(6.6, 2.4 + 2.3 * len(shown))
    panels = list(canvas.subplots(1 + len(shown), 1, sharex=True, squeeze=False)[:, 0])
    colors, mu = style.shades(len(views)), views[-1].friction
    draw_pressures(panels[0], views, cut)
    to_stress, stress = scaled(float(peaks.max()), "Pa")
    place = cut.along(cut.place)
    sides: set[float] = set()
    limit = mu * cut.values(views[-1]) if np.isfinite(mu) else np.zeros(place.size)
    for axes, k in zip(panels[1:], shown, strict=True):
        axes.axhline(0.0, color=style.GUIDE, lw=0.5, zorder=1)
        for q, solution, color in zip(tractions[:, k], exact, colors, strict=True):
            axes.plot(place, q * to_stress, color=color, zorder=3, **_JOINED)
            if solution is not None and len(views) <= _COMPARED:
                closed = cut.exact_tractions(solution)[k] * to_stress
                axes.plot(cut.along(cut.fine), closed, zorder=5, **_THIN)
        for sign in (1.0, -1.0):  # on the sides where the traction lies
            if (sign * tractions[:, k]).max() > 0.05 * limit.max() > 0.0:
                axes.plot(place, sign * limit * to_stress, color=style.GUIDE, lw=0.9, ls=":", zorder=1)
                sides.add(sign)
        axes.set_ylabel(f"{cut.names()[k]} ({stress})")
        cut.show(axes)
    for axes in panels:
        axes.label_outer()
    style.color_scale(canvas, panels, labels, colors)
    named = ["Hertz"] if any(view.hertz_holds for view in views) else []
    named += sorted({solution.name for solution in exact if solution is not None})
    handles = [Line2D([], [], color=colors[0], label="computed", **_JOINED)]
    if sides:
        name = rf"{_SIDES[-1.0 in sides, 1.0 in sides]} in step {views[-1].number}"
        handles.append(Line2D([], [], color=style.GUIDE, ls=":", lw=0.9, label=name))
    if named and len(views) <= _COMPARED:
        handles.append(Line2D([], [], label=", ".join(named), **_THIN))
    style.legend_under(canvas, handles)
    return style.set_title(canvas, title)


_CURVES = 7


@figure("wear", "pressure and worn depth along a line, by cycles of wear", needs="wear")
def wear(result: Result | Dataset, angle: float = 0.0, through: Point | None = None) -> Figure:
    """Draw pressure and worn depth in a section of the contact, for several cycles of wear."""
    dataset = dataset_of(result)
    if "wear_cycles" not in dataset or "worn_depth" not in dataset:
        raise NotInResult("the surfaces do not wear; a deck with [wear] is needed")
    kept = np.isfinite(dataset["worn_depth"].values).any(axis=(1, 2))
    steps = np.flatnonzero((dataset["wear_cycles"].values >= 0.0) & kept)
    if not steps.size:
        raise NotInResult("no fields of cycles that wear the surfaces were kept")
    deepest = dataset["max_worn_depth"].values[steps]
    wanted = np.linspace(0.0, deepest[-1], min(_CURVES, steps.size))
    places = np.unique(np.abs(deepest[:, None] - wanted).argmin(axis=0))
    views = [StepView(result, int(dataset["step"].values[step])) for step in steps[places]]
    cut = Cut.of(views, angle, through)

    canvas = style.new_figure(5.6, 5.0)
    above, below = canvas.subplots(2, 1, sharex=True)
    colors = style.shades(len(views))
    depths = [cut.values(view, view.data["worn_depth"].values) for view in views]
    pressures = [cut.values(view) for view in views]
    to_stress, stress = scaled(float(max(values.max() for values in pressures)), "Pa")
    to_depth, depth = scaled(float(max(values.max() for values in depths)), "m")
    for color, pressure, worn in zip(colors, pressures, depths, strict=True):
        above.plot(cut.along(cut.place), pressure * to_stress, color=color)
        below.plot(cut.along(cut.place), worn * to_depth, color=color)
    above.set(ylabel=f"pressure ({stress})", ylim=(0.0, None))
    below.set(ylabel=f"worn depth ({depth})")
    cut.show(below)
    below.invert_yaxis()
    labels = [f"{float(view.data['wear_cycles']):,.0f}".replace(",", "\u2009") for view in views]
    style.color_scale(canvas, [above, below], labels, colors)
    canvas.axes[-1].set_title("cycles", fontsize=9)
    return style.set_title(canvas, title_of(dataset))
