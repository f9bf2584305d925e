"""Fields over the plane: pressure, shear traction and slip of one load step, or of several side by side."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from ..result.view import StepView, as_list, dataset_of, scaled, title_of
from .style import EXACT, STYLE, new_figure, set_title

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.collections import TriMesh
    from matplotlib.figure import FigureBase

    from ..result.result import Result
    from ..result.view import Results

Array = NDArray[np.float64]
Limits = tuple[float, float, float, float]

DRAWN_NODES = 60_000  # nodes beyond which a field is drawn from every second, third, ... node
_ARROWS, FEWER_ARROWS = 13, 9  # about so many across the contact, in a large and a small picture
_WITH_ARROWS = 9  # maps in a picture up to which their arrows can be seen
_WIDTH = 7.2  # inches of a picture with several panels


# --- parts of a picture ---------------------------------------------------------------------------


def triangles(view: StepView, values: Array) -> tuple[Triangulation, Array] | None:
    """Return the triangles of the lattice where there is pressure, and the values at their corners.

    Parameters
    ----------
    view : StepView
        The step.
    values : ndarray, shape (n_row, n_col)
        A field.
    """
    stride = int(np.ceil(np.sqrt((1 + int(view.contact.sum())) / DRAWN_NODES)))
    x, y, contact, shown = (f[::stride, ::stride] for f in (view.x, view.y, view.contact, values))
    n_row, n_col = x.shape
    number = np.arange(x.size).reshape(n_row, n_col)
    first, right = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    above, across = number[1:, :-1].ravel(), number[1:, 1:].ravel()
    corners = np.concatenate([np.stack([first, right, above], 1), np.stack([right, across, above], 1)])
    corners = corners[contact.ravel()[corners].any(axis=1)]
    if not corners.size:
        return None
    used, renumbered = np.unique(corners, return_inverse=True)
    triangulation = Triangulation(x.ravel()[used], y.ravel()[used], renumbered.reshape(corners.shape))
    return triangulation, shown.ravel()[used]


def set_plane(axes: Axes, limits: Limits, factor: float, unit: str) -> None:
    """Show the part of the plane between x_min, x_max, y_min, y_max (m)."""
    x_min, x_max, y_min, y_max = (factor * limit for limit in limits)
    axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal")
    axes.set(xlabel=f"x ({unit})", ylabel=f"y ({unit})")


def outline(
    axes: Axes, ellipse: Any, center: tuple[float, float], factor: float, ratio: float = 1.0, **style: Any
) -> Line2D:
    """Draw the ellipse with the attributes semi_major, semi_minor and angle, reduced by a ratio."""
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    along, across = ratio * ellipse.semi_major * np.cos(turn), ratio * ellipse.semi_minor * np.sin(turn)
    cosine, sine = np.cos(ellipse.angle), np.sin(ellipse.angle)
    x, y = center[0] + along * cosine - across * sine, center[1] + along * sine + across * cosine
    [line] = axes.plot(x * factor, y * factor, **{"color": EXACT, "linestyle": "--", "zorder": 4, **style})
    return line


def draw_arrows(
    axes: Axes, view: StepView, vector: tuple[Array, Array], factor: float, color: str, many: int = _ARROWS
) -> None:
    """Draw a vector field at some of the nodes in contact; the longest arrow just reaches the next one."""
    size = np.hypot(*vector)
    if not size.max() > 0.0:
        return
    width = max(np.ptp(view.x[view.contact]), np.ptp(view.y[view.contact]))
    stride = max(1, round(float(width) / view.spacing / many))
    at = np.zeros_like(view.contact)
    row, col = np.indices(at.shape)
    middle = np.unravel_index(np.argmin(np.hypot(view.x - view.center[0], view.y - view.center[1])), at.shape)
    at[((row - middle[0]) % stride == 0) & ((col - middle[1]) % stride == 0)] = True
    at &= view.contact & (size > 0.02 * size.max())
    longest = float(size[at].max()) if at.any() else 1.0
    axes.quiver(
        view.x[at] * factor,
        view.y[at] * factor,
        vector[0][at],
        vector[1][at],
        angles="xy",
        scale_units="xy",
        scale=longest / (0.95 * stride * view.spacing * factor),
        pivot="mid",
        width=0.0045,
        color=color,
        edgecolor="white" if color == "black" else "black",
        linewidth=0.3,
        zorder=5,
    )


def step_label(view: StepView) -> str:
    """Name a step among others of the same result: its number and how far the shear has come."""
    bound = view.friction * float(view.data["normal_load"])
    load = view.tangential_load
    if not 0.0 < bound < np.inf or abs(load) < 1e-6 * bound:
        return f"step {view.number}"
    return f"step {view.number}, $Q/\\mu P$ = {load / bound:.2f}".replace("-", "−")


def union(views: Sequence[StepView], margin: float = 1.25) -> Limits:
    """Return limits of a picture that shows the contact of all steps: x_min, x_max, y_min, y_max (m)."""
    limits = np.array([view.window(margin) for view in views])
    x_min, _, y_min, _ = limits.min(axis=0)
    _, x_max, _, y_max = limits.max(axis=0)
    return float(x_min), float(x_max), float(y_min), float(y_max)


def widened(limits: Limits, aspect: float = 0.6) -> Limits:
    """Return limits that are not slender, so that there is room for a color bar beside the map."""
    x_min, x_max, y_min, y_max = limits
    more_x = max(0.5 * (aspect * (y_max - y_min) - (x_max - x_min)), 0.0)
    more_y = max(0.5 * (aspect * (x_max - x_min) - (y_max - y_min)), 0.0)
    return x_min - more_x, x_max + more_x, y_min - more_y, y_max + more_y


def views_of(results: Results, steps: int | Sequence[int]) -> tuple[list[StepView], list[str], str]:
    """Look at steps of one or several results: the views, a label for each, and the title of the picture."""
    several = as_list(results)
    chosen = [steps] if isinstance(steps, int) else list(steps)
    views = [StepView.of(result, step) for result in several for step in chosen]
    titles = [title_of(dataset_of(result)) for result in several]
    if len(set(titles)) < len(titles) and all(getattr(result, "path", "") for result in several):
        titles = [Path(cast("Result", result).path).stem for result in several]
    if len(several) == 1:
        return views, [step_label(view) for view in views], views[0].title if len(views) == 1 else titles[0]
    labels = [
        "\n".join([*textwrap.wrap(title, 38), *([step_label(view)] if len(chosen) > 1 else [])])
        for view, title in zip(views, np.repeat(titles, len(chosen)).tolist(), strict=True)
    ]
    return views, labels, ""


def map_panels(count: int, limits: Limits, lines: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure with so many maps of a part of the plane; titles of so many lines fit above each."""
    x_min, x_max, y_min, y_max = limits
    aspect = (y_max - y_min) / (x_max - x_min)
    if count == 1:
        figure = new_figure(4.6, float(np.clip(3.4 * aspect, 1.6, 5.5)) + 0.9)
        return figure, [figure.add_subplot()]
    columns = min(count, 4 if count > 6 or count == 4 else 3 if aspect < 2.0 else 4)
    rows = -(-count // columns)
    cell = _WIDTH / max(columns, 2)
    height = rows * (float(np.clip((cell - 0.2) * aspect, 0.6, 3.5)) + 0.17 * lines + 0.24) + 0.95
    figure = Figure(figsize=(cell * columns + 0.6, height), layout="compressed")
    cast(Any, figure.get_layout_engine()).set(h_pad=0.1)  # between a title and the panel above
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[count:]:
        axes.set_visible(False)
    return figure, list(panels.flat[:count])


def outer_labels(panels: Sequence[Axes]) -> None:
    """Leave labels of the axes only where no panel follows below, or stands left."""
    if len(panels) == 1:
        return
    grid = cast(Any, panels[0].get_subplotspec()).get_gridspec()
    for number, axes in enumerate(panels):
        if number + grid.ncols < len(panels):
            axes.set_xlabel("")
        else:
            axes.tick_params(labelbottom=True)
        if number % grid.ncols:
            axes.set_ylabel("")


# --- which fields there are -----------------------------------------------------------------------


@dataclass(frozen=True)
class _Field:
    """A field that has a map: its label, unit, and the components of the vector whose length it is."""

    label: str
    unit: str
    vector: tuple[str, str] | None = None

    def values(self, view: StepView, name: str) -> Array:
        if self.vector is None:
            return view.pressure if name == "pressure" else view.field(name)
        return np.asarray(np.hypot(*(view.field(part) for part in self.vector)))


_FIELDS = {
    "pressure": _Field("pressure $p$", "Pa"),
    "traction": _Field("shear traction $|q|$", "Pa", ("traction_x", "traction_y")),
    "traction_x": _Field("shear traction $q_x$", "Pa"),
    "traction_y": _Field("shear traction $q_y$", "Pa"),
    "slip_increment": _Field("slip in the step", "m", ("slip_increment_x", "slip_increment_y")),
    "accumulated_slip": _Field("accumulated slip", "m"),
}


def draw_field(
    figure: FigureBase,
    panels: Sequence[Axes],
    views: Sequence[StepView],
    name: str,
    limits: Limits,
    arrows: bool = True,
) -> None:
    """Draw a field of several steps into panels with one color scale.

    Parameters
    ----------
    figure : Figure
        Where the panels are.
    panels : sequence of Axes
        One for each step.
    views : sequence of StepView
        The steps.
    name : str
        Name of the field; "traction" and "slip_increment" are the lengths of the vectors.
    limits : tuple of float
        x_min, x_max, y_min, y_max (m) of what is shown.
    arrows : bool
        Whether a vector is drawn as arrows, too.
    """
    field = _FIELDS[name]
    values = [field.values(view, name) for view in views]
    largest = max(float(np.abs(v).max()) for v in values)
    signed = min(float(v.min()) for v in values) < -0.01 * largest
    to_length, length = scaled(max(np.abs(limits[:2]).max(), views[0].spacing), "m")
    factor, unit = scaled(largest, field.unit)
    shades: TriMesh | None = None
    for axes, view, field_values in zip(panels, views, values, strict=True):
        drawn = triangles(view, field_values)
        if drawn is None:
            axes.text(0.5, 0.5, "no contact", transform=axes.transAxes, ha="center", va="center")
        else:
            mesh, at_corners = drawn
            mesh = Triangulation(mesh.x * to_length, mesh.y * to_length, mesh.triangles)
            shades = axes.tripcolor(
                mesh,
                at_corners * factor,
                shading="gouraud",
                rasterized=True,
                cmap="PuOr_r" if signed else "viridis",
            )
            shades.set_clim(-largest * factor if signed else 0.0, (largest or 1.0) * factor)
        if arrows and field.vector is not None:
            vector = view.field(field.vector[0]), view.field(field.vector[1])
            draw_arrows(axes, view, vector, to_length, "white", _ARROWS if len(panels) == 1 else FEWER_ARROWS)
        if view.hertz is not None:
            outline(axes, view.hertz, view.center, to_length, label="Hertz contact area", lw=1.0)
        set_plane(axes, limits, to_length, length)
    if shades is not None:
        if len(panels) == 1:  # as high as the axes
            bar = figure.colorbar(shades, cax=panels[0].inset_axes((1.03, 0.0, 0.045, 1.0)))
        else:
            bar = figure.colorbar(shades, ax=list(panels), aspect=30, pad=0.02)
        bar.set_label(f"{field.label} ({unit})")
        cast(Any, bar.outline).set_linewidth(0.5)


def field_map(
    name: str,
    result: Result | xarray.Dataset,
    steps: int | Sequence[int] = -1,
    with_arrows: bool | None = None,
) -> Figure:
    """Draw a field over the plane, linear on the triangles of the lattice as in the solution.

    Parameters
    ----------
    name : str
        "pressure", "traction", "traction_x", "traction_y", "slip_increment" or "accumulated_slip".
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    steps : int or sequence of int
        Numbers of the load steps, from 1; -1 is the last one.
    with_arrows : bool, optional
        Whether a vector is drawn as arrows, too; by default unless there are too many maps to see them.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the field of that step was not kept, or there is none without friction.
    """
    with matplotlib.rc_context(STYLE):
        views, labels, title = views_of(result, steps)
        limits = widened(union(views)) if len(views) == 1 else union(views)
        figure, panels = map_panels(len(views), limits)
        arrows = len(views) <= _WITH_ARROWS if with_arrows is None else with_arrows
        draw_field(figure, panels, views, name, limits, arrows)
        if len(views) == 1:
            if views[0].hertz is not None:
                panels[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.1)
        else:
            for axes, label in zip(panels, labels, strict=True):
                axes.set_title(label)
            outer_labels(panels)
        set_title(figure, title)
        return figure
