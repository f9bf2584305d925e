"""Pictures of a result.

Every function takes a `Result` (or its dataset) and returns a `matplotlib.figure.Figure` that needs no window
system; ``figure.savefig("name.pdf")`` writes it. `FIGURES` lists them by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, cast

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from . import estimators
from .step_view import StepView, dataset_of, scaled, worded

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

    from .result import Result

Array = NDArray[np.float64]

COMPUTED, EXACT, GUIDE = "#0072B2", "#D55E00", "0.55"  # blue and vermilion of the Okabe-Ito palette
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "figure.titlesize": 10,
    "axes.grid": False,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "image.cmap": "viridis",
    "savefig.dpi": 200,
}

_DRAWN_NODES = 60_000  # nodes beyond which a field is drawn from every second, third, ... node


# ----------------------------------------------------------------------------------- one load step


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def _triangles(view: StepView) -> tuple[Triangulation, Array] | None:
    """Triangulation of the lattice where there is pressure, and the pressure at its corners."""
    stride = int(np.ceil(np.sqrt((1 + int(view.contact.sum())) / _DRAWN_NODES)))
    x, y, p = (field[::stride, ::stride] for field in (view.x, view.y, view.pressure))
    n_row, n_col = p.shape
    number = np.arange(p.size).reshape(n_row, n_col)
    first, right = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    above, across = number[1:, :-1].ravel(), number[1:, 1:].ravel()
    corners = np.concatenate([np.stack([first, right, above], 1), np.stack([right, across, above], 1)])
    corners = corners[(p.ravel()[corners] > 0.0).any(axis=1)]
    if not corners.size:
        return None
    used, renumbered = np.unique(corners, return_inverse=True)
    triangulation = Triangulation(x.ravel()[used], y.ravel()[used], renumbered.reshape(corners.shape))
    return triangulation, p.ravel()[used]


def _draw_field(figure: FigureBase, view: StepView) -> None:
    """Draw the pressure over the plane, and the outline of a Hertz solution."""
    axes = figure.add_subplot()
    to_length, length = scaled(max(np.abs(view.window()[:2]).max(), view.spacing), "m")
    to_stress, stress = scaled(float(view.pressure.max()), "Pa")
    drawn = _triangles(view)
    if drawn is not None:
        mesh, values = drawn
        mesh = Triangulation(mesh.x * to_length, mesh.y * to_length, mesh.triangles)
        shades = axes.tripcolor(mesh, values * to_stress, shading="gouraud", rasterized=True)
        shades.set_clim(0.0, None)
        bar = figure.colorbar(shades, cax=axes.inset_axes((1.03, 0.0, 0.045, 1.0)))  # as high as the axes
        bar.set_label(f"pressure p ({stress})")
        bar.outline.set_linewidth(0.5)
    if view.hertz is not None:
        _outline(axes, view.hertz, view.center, to_length, label="Hertz contact area")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)
    if not view.pressure.any():
        axes.text(0.5, 0.5, "no contact", transform=axes.transAxes, ha="center", va="center")
    _set_plane(axes, view.window(), to_length, length)


def _set_plane(axes: Axes, limits: tuple[float, float, float, float], factor: float, unit: str) -> None:
    """Show the part of the plane between x_min, x_max, y_min, y_max (m)."""
    x_min, x_max, y_min, y_max = (factor * limit for limit in limits)
    axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal")
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})")


def _outline(axes: Axes, ellipse: Any, center: tuple[float, float], factor: float, **style: Any) -> Line2D:
    """Draw the ellipse with the attributes semi_major, semi_minor and angle."""
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    along, across = ellipse.semi_major * np.cos(turn), ellipse.semi_minor * np.sin(turn)
    cosine, sine = np.cos(ellipse.angle), np.sin(ellipse.angle)
    x, y = center[0] + along * cosine - across * sine, center[1] + along * sine + across * cosine
    [line] = axes.plot(x * factor, y * factor, **{"color": EXACT, "linestyle": "--", "zorder": 4, **style})
    return line


def _draw_section(figure: FigureBase, view: StepView, angle: float) -> None:
    """Draw the pressure along a line, and the error below it where there is a Hertz solution."""
    if view.hertz is None:
        axes = bottom = figure.add_subplot()
    else:
        axes, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    to_length, length = scaled(max(np.abs(view.window()[:2]).max(), view.spacing), "m")
    to_stress, stress = scaled(float(view.pressure.max()), "Pa")
    at = int(np.argmin(np.hypot(view.x - view.center[0], view.y - view.center[1])))
    x0, y0 = view.x.flat[at], view.y.flat[at]  # the node nearest to the center
    x_min, x_max, y_min, y_max = view.window(1.3)
    reach = int(np.ceil(0.5 * np.hypot(x_max - x_min, y_max - y_min) / view.spacing))
    s = np.arange(-reach, reach + 1) * view.spacing
    p = view.at(x0 + s * np.cos(angle), y0 + s * np.sin(angle))
    inside = np.flatnonzero(p > 0.0)
    if inside.size:
        first, last = max(inside[0] - 3, 0), min(inside[-1] + 4, p.size)
        s, p = s[first:last], p[first:last]
    start = x0 if angle == 0.0 else 0.0  # along x the place on the line is x itself
    place = (start + s) * to_length
    few = s.size < 100  # nodes one can tell apart
    look: dict[str, Any] = {
        "marker": "o",
        "ms": 3.5 if s.size < 60 else 2.5,
        "mfc": "none",
        "mew": 0.9,
        "ls": "",
    }
    look = look if few else {"ls": "-"}
    axes.plot(place, p * to_stress, color=COMPUTED, label="computed", zorder=3 if few else 1, **look)
    if view.hertz is not None:
        fine = np.linspace(s[0], s[-1], 1001)
        exact = view.hertz.pressure(*_points(view, x0, y0, fine, angle))
        line = "-" if few else "--"
        axes.plot((start + fine) * to_length, exact * to_stress, line, color=EXACT, label="Hertz", zorder=2)
        at_nodes = view.hertz.pressure(*_points(view, x0, y0, s, angle))
        error = 100 * (p - at_nodes) / view.hertz.max_pressure
        bottom.axhline(0.0, color=GUIDE, lw=0.7)
        bottom.plot(place, error, "o-" if few else "-", ms=2.5, lw=0.7, color=COMPUTED)
        bottom.set_ylabel("error (% of $p_0$)")
        axes.tick_params(labelbottom=False)
    rim = 0.5 * view.spacing * to_length
    axes.set(ylabel=f"pressure p ({stress})", xlim=(place[0] - rim, place[-1] + rim))
    axes.set_ylim(0.0, 1.08 * to_stress * max(float(p.max()), np.finfo(float).tiny))
    if view.hertz is not None:
        axes.legend(loc="lower center")
    direction = "x" if angle == 0.0 else f"distance from the center along {np.degrees(angle):g}°"
    bottom.set_xlabel(f"{direction} ({length})")


def _points(
    view: StepView, x0: float, y0: float, s: NDArray[np.floating], angle: float
) -> tuple[Array, Array]:
    """Points of the line, from the center of the Hertz ellipse."""
    return x0 - view.center[0] + s * np.cos(angle), y0 - view.center[1] + s * np.sin(angle)


# ----------------------------------------------------------------------------------- figures


def pressure_field(result: Result | xarray.Dataset, step: int = -1) -> Figure:
    """Draw the contact pressure over the plane, linear on the triangles of the lattice as in the solution.

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
        If the pressure of that step was not kept.
    """
    with matplotlib.rc_context(STYLE):
        view = StepView.of(result, step)
        figure = _figure(4.6, 4.0)
        _draw_field(figure, view)
        figure.suptitle(view.title)
        return figure


def section(result: Result | xarray.Dataset, step: int = -1, angle: float = 0.0) -> Figure:
    """Draw the pressure along a line through the center; beside Hertz if the initial gap is quadratic.

    Parameters
    ----------
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    step : int
        Number of the load step, from 1; -1 is the last one.
    angle : float
        Direction of the line from x, rad; at multiples of 60 degrees its points are nodes.

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
    with matplotlib.rc_context(STYLE):
        view = StepView.of(result, step)
        figure = _figure(4.6, 4.2)
        _draw_section(figure, view, angle)
        figure.suptitle(view.title)
        return figure


def contact_boundary(result: Result | xarray.Dataset, step: int = -1) -> Figure:
    """Draw the nodes in contact on the lattice, the circle (9.1)-(9.2) or ellipse fitted to them, and Hertz.

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
        figure = _figure(4.6, 4.9)
        axes = figure.add_subplot()
        limits = view.window(1.2)
        to_length, length = scaled(float(np.abs(limits[:2]).max()), "m")
        x_min, x_max, y_min, y_max = (to_length * limit for limit in limits)
        x, y, rim = view.x * to_length, view.y * to_length, estimators.boundary(view.contact)
        shown = (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max)
        across = (limits[1] - limits[0]) / view.spacing  # spacings over the width of the picture
        pitch = 240.0 / across  # points between nodes
        if across < 80:
            axes.add_collection(_lattice_lines(x, y, shown, view.basis))
        inner = view.contact & ~rim
        dot: dict[str, Any] = {"marker": "o", "mew": 0, "ls": "", "rasterized": across > 80}
        inside_size = 0.45 * pitch if across < 80 else 2.0 * pitch  # too many to tell apart: an area
        axes.plot(x[inner], y[inner], ms=inside_size, color="#56B4E9", label="in contact", **dot)
        axes.plot(x[rim], y[rim], ms=max(0.45 * pitch, 1.0), color="black", label="boundary node", **dot)
        moments = estimators.moment_ellipse(view.x, view.y, view.contact)
        if moments.semi_minor > 0.97 * moments.semi_major:
            fit = estimators.boundary_circle(view.x, view.y, view.contact, view.spacing, view.center)
            fitted: Any = estimators.Ellipse(fit.radius, fit.radius, 0.0, view.center)
            label = f"fitted circle, a = {worded(fit.radius, 'm')}"
        else:
            fitted = moments
            label = f"fitted ellipse, {worded(moments.semi_major, 'm')} by {worded(moments.semi_minor, 'm')}"
        _outline(axes, fitted, fitted.center, to_length, color=COMPUTED, linestyle="-", label=label)
        if view.hertz is not None:
            a, b = view.hertz.semi_major, view.hertz.semi_minor
            exact = f"a = {worded(a, 'm')}" if b > 0.999 * a else f"{worded(a, 'm')} by {worded(b, 'm')}"
            _outline(axes, view.hertz, view.center, to_length, label=f"Hertz, {exact}")
        _set_plane(axes, limits, to_length, length)
        legend = figure.legend(loc="outside lower center", ncols=2, handlelength=1.6)
        for handle in legend.legend_handles[:2]:
            cast(Line2D, handle).set_markersize(4.0)
        figure.suptitle(view.title)
        return figure


def _lattice_lines(x: Array, y: Array, shown: NDArray[np.bool_], basis: Array) -> LineCollection:
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


HISTORY = (
    "normal_load",
    "approach",
    "contact_radius",
    "max_pressure",
    "tangential_load_x",
    "shift_x",
    "stick_radius",
)


def history(result: Result | xarray.Dataset, quantities: Sequence[str] | None = None) -> Figure:
    """Draw quantities that have one value by step over the load steps.

    Parameters
    ----------
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    quantities : sequence of str, optional
        Names of the history variables; by default those of `HISTORY` that are there.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If a name is not a history variable of the result.
    """
    dataset = dataset_of(result)
    known = [
        str(n) for n in dataset.data_vars if dataset[n].dims == ("step",) and dataset[n].dtype.kind in "fi"
    ]
    names = list(quantities) if quantities is not None else [name for name in HISTORY if name in known]
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"no history of {', '.join(unknown)} in this result; there are {', '.join(known)}")
    with matplotlib.rc_context(STYLE):
        columns = 2 if len(names) > 1 else 1
        rows = -(-len(names) // columns)
        figure = _figure(3.4 * columns, 2.1 * rows + 0.3)
        panels = figure.subplots(rows, columns, sharex=True, squeeze=False)
        steps = dataset["step"].values
        marker = "o-" if steps.size <= 60 else "-"
        for name, axes in zip(names, panels.flat, strict=False):
            values = dataset[name].values.astype(float)
            finite = values[np.isfinite(values)]
            factor, unit = scaled(
                float(np.abs(finite).max()) if finite.size else 0.0, dataset[name].attrs.get("units", "")
            )
            axes.plot(steps, values * factor, marker, ms=3, color=COMPUTED)
            axes.set_ylabel(name.replace("_", " ") + (f" ({unit})" if unit else ""))
            axes.grid(color="0.9", lw=0.5)
            axes.xaxis.get_major_locator().set_params(integer=True)
        for axes in panels.flat[len(names) :]:
            axes.set_visible(False)
        for column in range(columns):
            lowest = [panels[row, column] for row in range(rows) if panels[row, column].get_visible()][-1]
            lowest.set_xlabel("load step")
            lowest.tick_params(labelbottom=True)
        figure.suptitle(str(dataset.attrs.get("title", "")))
        return figure


def overview(result: Result | xarray.Dataset, step: int = -1) -> Figure:
    """Draw the pressure field and a section side by side.

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
        If the pressure of that step was not kept.
    """
    with matplotlib.rc_context(STYLE):
        view = StepView.of(result, step)
        figure = _figure(8.6, 3.7)
        left, right = cast(Any, figure.subfigures(1, 2, width_ratios=(1.15, 1)))
        _draw_field(left, view)
        _draw_section(right, view, 0.0)
        figure.suptitle(view.title)
        return figure


FIGURES: dict[str, Callable[..., Figure]] = {
    "overview": overview,
    "pressure": pressure_field,
    "section": section,
    "boundary": contact_boundary,
    "history": history,
}
"""Pictures of a result by name; all but ``history`` take the number of a load step as second argument."""
