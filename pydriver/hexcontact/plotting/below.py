"""Stress and fatigue below the contact: sections, maps, curves along lines and over the load steps."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from ..arrays import Array, DataArray, Dataset
from ..deck.below import Fatigue
from ..errors import NotInResult
from ..interior.files import tables_of
from ..interior.stress import bodies_of
from ..result.export import kept_steps
from ..result.result import Result, as_result, at_hand
from ..result.view import StepView, dataset_of, mapped_steps, title_of
from ..text import scaled, visible, worded
from ..variables import spelled
from . import style
from .maps import Part, mesh_of
from .registry import figure
from .sections import Cut, Point
from .zones import draw_zone_bars

_DEPTH = 0.6  # of the section, in its widths
_POINTS = 121  # along the line; 60 below each other
LEVELS = 12
_LABEL = 40  # letters in a line below a map
_NOISE = 1e-6  # of the largest stress: below, a component is 0


@figure("stress", "von Mises stress below the contact, in a section")
def stress(
    result: Result | Dataset, step: int = -1, angle: float = 0.0, through: Point | None = None
) -> Figure:
    """Draw the equivalent stress of von Mises in a section below the contact."""
    view = StepView(result, step)
    cut = Cut.of([view], angle, through)
    along = np.linspace(0.0, cut.line.length, _POINTS)
    depth = np.linspace(0.0, _DEPTH * cut.line.length, _POINTS // 2)
    x, y = cut.line.points(along)
    points = np.stack(np.broadcast_arrays(x[None], y[None], depth[:, None]), axis=-1)
    found = _below(result, step, points, "von_mises_stress")
    values = found["von_mises_stress"].values

    canvas, axes = style.drawing(None, 5.6, 3.4, equal=True)
    to_stress, unit = scaled(float(values.max()), "Pa")
    length = cut.lengths[0]
    drawn = axes.contourf(cut.along(along), depth * length, values * to_stress, LEVELS)
    canvas.colorbar(drawn, ax=axes, label=f"von Mises stress in body {found.attrs['body']} ({unit})")
    style.mark_largest(axes, *np.meshgrid(cut.along(along), depth * length), values)
    place = np.linspace(0.0, cut.line.length, 8 * _POINTS)
    draw_zone_bars(axes, view, cut.line.points(place), cut.along(place), -0.02 * depth[-1] * length)
    axes.legend(loc="lower right", labelcolor="white", handlelength=1.2)
    cut.show(axes)
    axes.set(ylabel=f"depth ({cut.lengths[1]})", aspect="equal", xlim=cut.along(along)[[0, -1]])
    axes.set_ylim(depth[-1] * length, -0.05 * depth[-1] * length)
    return style.set_title(canvas, view.title)


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
    views = [StepView(result, number) for number in mapped_steps(result)]
    if not views:
        raise NotInResult("the pressure was not kept (output.fields)")
    largest = max(views, key=lambda view: int(view.contact.sum()))
    if not largest.contact.any():
        raise NotInResult("no node is in contact")
    cut = Cut.of([largest], angle, None)
    place = np.linspace(0.0, cut.line.length, 16 * _POINTS)
    inside = place[largest.touches(*cut.line.points(place))]
    x, y = cut.line.points(inside[[0, -1]])
    points = np.stack([x, y, np.full(2, depth)], axis=-1)
    names = ("stress_xx", "stress_yy", "stress_xy")
    along = np.array([math.cos(angle) ** 2, math.sin(angle) ** 2, math.sin(2.0 * angle)])
    found = [_below(result, view.number, points, *names) for view in views]
    stress = np.array(
        [sum(c * one[name].values for c, name in zip(along, names, strict=True)) for one in found]
    )

    canvas = style.new_figure(5.2, 3.0)
    axes = canvas.add_subplot()
    to_stress, unit = scaled(float(abs(stress).max()), "Pa")
    numbers = [view.number for view in views]
    for end, (color, mark) in enumerate(((style.COMPUTED, "o"), (style.EXACT, "s"))):
        label = f"end at $x$ = {worded(float(x[end]), 'm')}".replace("-", "\u2212")
        axes.plot(numbers, stress[:, end] * to_stress, f"-{mark}", color=color, ms=3.0, label=label)
    axes.axhline(0.0, color=style.GUIDE, lw=0.7)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    symbol = r"$\sigma_{xx}$" if angle == 0.0 else r"$\sigma$ along the section"
    axes.set(xlabel="load step", ylabel=f"{symbol} in body {found[0].attrs['body']} ({unit})")
    style.legend_below(axes, ncols=2, fontsize=8)
    deep = f"{worded(depth, 'm')} deep" if depth else "at the surface"
    return style.set_title(canvas, ", ".join(filter(None, (title_of(dataset_of(result)), deep))))


def _below(result: Result | Dataset, step: int, points: Array, *names: str) -> Dataset:
    """Return stresses of a load step at points of body 1, or of body 2 if body 1 is rigid."""
    result = as_result(result)
    bodies = bodies_of(result.deck)
    body = 2 if bodies and (bodies[0].rigid and not bodies[0].coating) else 1
    return result.stress(*names, step=step, body=body, points=points)


_MARGIN = 1.5  # width of the map over that of the contact
_ENDLESS = 1e9  # cycles beyond which life is shown as endless


@figure("fatigue", "fatigue parameter and life on the surface and below it", needs="[[fatigue]]")
def fatigue(result: Result | Dataset, step: int | None = None) -> Figure:
    """Draw the first fatigue parameter of the deck and the life, at the surface and in a section below it.

    Parameters
    ----------
    step : int, optional
        Number of the load step whose contact and stick area are outlined; by default the last of the cycle.
    """
    result = as_result(result)
    tables = {name: table for name, table in tables_of(result.deck).items() if isinstance(table, Fatigue)}
    surface = next((name for name, table in tables.items() if table.where.get("depths") == (0.0,)), None)
    section = next((name for name, table in tables.items() if table.plane), None)
    shown = [name for name in (surface, section) if name]
    if not shown:
        raise NotInResult("the deck has no table [[fatigue]] of the surface or a plane")
    by_name = dict(at_hand(result, [], shown))
    first = next((name for name in tables[shown[0]].parameters if name != "life"), "life")
    first = "ruiz_f2" if first == "ruiz" else first
    drawn = [(table, _first_of(by_name[table], first)) for table in shown]
    if first != "life":
        drawn = [(table, field) for table, field in drawn if field.name != "life"]
        drawn += [(table, by_name[table]["life"]) for table in shown if "life" in by_name[table]]
    alike = [field for _, field in drawn if field.name == first]
    lowest, highest = min(map(np.nanmin, alike)), max(map(np.nanmax, alike))
    cycle = by_name[shown[0]].attrs["steps"]
    view = StepView(result, int(cycle[-1]) if step is None else step)

    columns = len(drawn) if len(drawn) < 4 else 2
    canvas, panels = style.new_panels(len(drawn), columns, 3.6 + 0.2 / columns, 3.9, 0.3)
    for axes, (table, field) in zip(panels, drawn, strict=True):
        limits = (lowest, highest) if field.name == first != "life" else None  # of all its panels
        draw = _draw_surface if table == surface else _draw_section
        draw(axes, view, field, limits)
        axes.set_title(f"{'surface' if table == surface else 'section'} of body {tables[table].body}")
    style.legend_under(canvas, style.handles_of(*panels))
    return style.set_title(canvas, title_of(result.dataset))


def _first_of(found: Dataset, name: str) -> DataArray:
    """Return a parameter of a table, the first other one if it has not got it."""
    others = (other for other, field in found.data_vars.items() if field.attrs["units"] != "rad")
    return found[name if name in found else min(others, key=lambda other: other == "life")]


def _color(
    axes: Axes, x: Array, y: Array, field: DataArray, limits: tuple[Any, Any] | None = None
) -> Callable[[], None]:
    """Draw a parameter in colors with their scale; return a function that marks its worst value.

    Life is drawn as a power of ten. The worst value is bright.
    """
    factor, label = _scale(field)
    values, life = np.squeeze(field.values) * factor, field.name == "life"
    options: dict[str, Any] = {"label": label, "ticks": MaxNLocator(6)}
    if life:
        values = np.log10(np.clip(values, 1.0, _ENDLESS))
        options["format"] = FuncFormatter(lambda power, _: f"$10^{{{power:g}}}$")
    levels: Any = MaxNLocator(LEVELS).tick_values(*(factor * end for end in limits)) if limits else LEVELS
    drawn = axes.contourf(x, y, values, levels, cmap="viridis_r" if life else "viridis")
    axes.figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.9, **options)
    words = ("least life",) if life else ()
    return lambda: style.mark_largest(axes, x, y, -values if life else values, *words)


def _scale(field: DataArray) -> tuple[float, str]:
    """Return the factor of a parameter and the label of its color scale."""
    units, named = str(field.attrs["units"]), str(field.attrs["long_name"])
    if field.name == "life":
        return 1.0, "cycles to a crack, up to $10^9$"
    largest = float(abs(field).max())
    if units in ("", "1", "Pa", "m"):
        factor, unit = scaled(largest, units)
    else:
        power = 3 * math.floor(math.log10(largest) / 3) if largest > 0.0 else 0
        factor, unit = 10.0**-power, f"$10^{{{power}}}$ " * (power != 0) + units.replace("Pa2", "Pa²")
    return factor, style.titled(named, unit)


def _draw_surface(axes: Axes, view: StepView, field: DataArray, limits: Any) -> None:
    """Draw a map of the surface with the outlines of contact and stick area."""
    part = Part.around([view], _MARGIN)
    mark = _color(axes, field["x"].values * part.factor, field["y"].values * part.factor, field, limits)
    part.show(axes)
    meshes = [("contact area", "white", mesh_of(view, view.pressure, True))]
    if view.friction != 0.0 and view.has("zone"):
        meshes.append(("stick area", "red", view.stick_mesh()))
    for name, color, mesh in meshes:
        look: dict[str, Any] = {"color": color, "lw": 1.2, "path_effects": style.EDGED}
        for polygon in mesh.outlines():
            axes.plot(*(polygon * part.factor).T, label=f"{name} in step {view.number}", **look)
    mark()


def _draw_section(axes: Axes, view: StepView, field: DataArray, limits: Any) -> None:
    """Draw a section, with contact and stick as bars above the surface."""
    x, y = field["x"].values, field["y"].values
    along, depth, words = _places(field)
    mark = _color(axes, along, depth, field, limits)
    draw_zone_bars(axes, view, (x[0], y[0]), along[0], depth.min() - 0.03 * np.ptp(depth))
    mark()
    axes.set_ylim(depth.max(), depth.min() - 0.06 * np.ptp(depth))
    axes.set(**words, aspect="equal")


def _places(field: DataArray) -> tuple[Array, Array, dict[str, str]]:
    """Return the coordinates of a map or of a section in a unit, with the labels of the axes."""
    x, y, depth = (field[name].values for name in ("x", "y", "depth"))
    flat = not np.ptp(depth) > 0.0
    if flat or np.ptp(y) == 0.0:
        word, across = "x", x
    elif np.ptp(x) == 0.0:
        word, across = "y", y
    else:
        word, across = "distance", np.hypot(x - x[0, 0], y - y[0, 0])
    other, up = ("y", y) if flat else ("depth", depth)
    factor, unit = scaled(style.largest(across, *([y] if flat else [])), "m")
    return across * factor, up * factor, {"xlabel": f"{word} ({unit})", "ylabel": f"{other} ({unit})"}


_COLUMNS = 3  # panels, or maps, beside each other
_LEGEND = 10  # curves of a legend at most
_NAMES = {
    "von_mises_stress": "von Mises stress",
    "tresca_stress": "Tresca stress",
    "smith_watson_topper": "Smith-Watson-Topper",
    "life": "cycles to a crack",
    "findley": "Findley",
    "fatemi_socie": "Fatemi-Socie",
    "crossland": "Crossland",
    "dang_van": "Dang Van",
    "ruiz_f1": "Ruiz $F_1$",
    "ruiz_f2": "Ruiz $F_2$",
}


@figure("lines", "tables along a line, or at points by step", needs="[[stress]] or [[fatigue]]")
def lines(result: Result | Dataset) -> Figure:
    """Draw the tables [[stress]] and [[fatigue]] of the deck along lines, and at points over the steps."""
    result = as_result(result)
    names = [name for name, table in tables_of(result.deck).items() if table.line or table.points]
    if not names:
        raise NotInResult("the deck has no table [[stress]] or [[fatigue]] of a line or of points")
    return draw_tables(list(at_hand(result, kept_steps(result), names)), title_of(result.dataset))


def draw_tables(shown: Sequence[tuple[str, Dataset]], title: str) -> Figure:
    """Draw tables of a line or of points, below each other."""
    panels = [_panels(found) for _, found in shown]
    heights = [2.5 * -(-len(of_table) // _COLUMNS) + 0.35 for of_table in panels]
    columns = min(_COLUMNS, max(map(len, panels)))
    canvas = style.new_figure(3.7 * columns + 0.6, sum(heights) + 0.4)
    parts = canvas.subfigures(len(shown), 1, squeeze=False, height_ratios=heights)[:, 0]
    for part, (name, found), of_table in zip(parts, shown, panels, strict=True):
        _draw_table(part, name, found, of_table, columns)
    return style.set_title(canvas, title)


def _panels(found: Dataset) -> list[list[str]]:
    """Return the quantities of each panel: those of one unit share it, if each is a single curve."""
    names = [str(name) for name, field in found.data_vars.items() if field.attrs.get("units") != "rad"]
    if "distance" not in found.sizes or found.sizes.get("step") != 1:  # several steps or points; fatigue
        return [[name] for name in names]
    units = dict.fromkeys(str(found[name].attrs["units"]) for name in names)
    return [[name for name in names if found[name].attrs["units"] == unit] for unit in units]


def _draw_table(
    part: SubFigure, name: str, found: Dataset, panels: Sequence[Sequence[str]], columns: int
) -> None:
    """Draw the panels of a table, with its name and place above."""
    grid = style.panels_of(part, len(panels), columns)
    on_line = "distance" in found.sizes
    steps: list[int] = found["step"].values.tolist() if "step" in found.coords else []
    points = np.stack([np.ravel(found[axis]) for axis in ("x", "y", "depth")], axis=1)
    labels, where = [""], ""
    if on_line:
        place, words, where = _along(found)
        labels = [f"step {number}" for number in steps] if len(steps) > 1 else labels
    elif steps:
        place, words = np.array(steps, dtype=float), "load step"
        labels = [", ".join(_length(place) for place in point) for point in points.tolist()]
    else:
        place, words = np.arange(1.0, len(points) + 1.0), "point"
    for axes, names in zip(grid, panels, strict=True):
        curves = np.concatenate([found[name].values.reshape(-1, len(points)) for name in names])
        _draw_curves(axes, place, curves.T if steps and not on_line else curves, found[names[0]], len(names))
        axes.set_xlabel(words)
        if not on_line:
            axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        if len(names) > 1:
            _legend_beside(axes, [_named(name).removesuffix(" stress") for name in names])
    if len(labels) > _LEGEND:
        style.color_scale(part, grid, labels, style.shades(len(labels)))
    elif len(labels) > 1:
        _legend_beside(grid[-1], labels, None if on_line else "x, y, depth")
    at = f"step {steps[0]}" if len(steps) == 1 else ""
    about = (visible(name).replace("$", r"\$"), f"body {found.attrs['body']}", at, where)
    part.suptitle(", ".join(filter(None, about)), fontsize=9)


def _draw_curves(axes: Axes, place: Array, curves: Array, field: DataArray, quantities: int) -> None:
    """Draw curves of a quantity in its unit; life on a logarithmic scale."""
    units = str(field.attrs["units"])
    factor, unit = scaled(style.largest(curves), units) if " " not in units else (1.0, units)
    colors = style.PALETTE if len(curves) in (1, quantities) else style.shades(len(curves))
    look: dict[str, Any] = {"lw": 1.2}
    if "distance" not in field.dims:
        look |= {"marker": "o" if place.size <= 60 else "", "ms": 3.0}
        look |= {} if "step" in field.dims else {"marker": "o", "ls": ""}
    for number, values in enumerate(curves):
        shown = np.where(np.isfinite(values), values * factor, np.nan)  # endless life has no place
        dash = {"ls": "--"} if number >= len(colors) else {}  # beyond the palette
        axes.plot(place, shown, color=colors[number % len(colors)], **look | dash)
    named = _named(str(field.name)) if quantities == 1 else {"Pa": "stress", "m": "displacement"}[units]
    if field.name == "life":
        axes.set_yscale("log")
    else:
        axes.axhline(0.0, color=style.GUIDE, lw=0.6, zorder=0)
    axes.set_ylabel(style.titled(named, unit))
    axes.grid(color="0.9", lw=0.5)


def _legend_beside(axes: Axes, labels: Sequence[str], title: str | None = None) -> None:
    """Name the curves on the right of axes."""
    axes.legend(labels, title=title, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)


def _along(found: Dataset) -> tuple[Array, str, str]:
    """Return the places along a line, the words of their axis, and the coordinates that do not change."""
    axes = {name: found[name].values for name in ("x", "y", "depth")}
    moving = [name for name, values in axes.items() if np.ptp(values) > 0.0]
    name = moving[0] if len(moving) == 1 else "distance"
    values = found[name].values
    factor, unit = scaled(float(abs(values).max()), "m")
    fixed = [f"{axis} = {_length(axes[axis][0])}" for axis in axes if axis not in moving]
    return values * factor, f"{name} ({unit})", ", ".join(fixed)


def _length(value: float) -> str:
    return worded(value, "m").replace("-", "\u2212")


def _named(name: str) -> str:
    """Return a quantity as axes and legends name it."""
    *words, last = name.split("_")
    head = {"stress": r"\sigma", "displacement": "u", "principal_stress": r"\sigma"}.get("_".join(words))
    return f"${head}_{{{last}}}$" if head else _NAMES.get(name, spelled(name))


@figure("table", "the file of one table of stresses or fatigue", needs="a table")
def table(table: Dataset) -> Figure:
    """Draw a table of a deck: curves along a line or at points, maps of a plane or of a depth."""
    title, _, name = str(table.attrs["title"]).rpartition(": ")
    if {"distance", "point"} & table.sizes.keys():
        return draw_tables([(name, table)], title)
    fields = [_worst(field) for field in table.data_vars.values() if field.attrs["units"] != "rad"]
    largest = {field.name: float(abs(field).max()) for field in fields}
    for k, field in enumerate(fields):  # rounding of a component that is 0 is no picture
        alike = (largest[other.name] for other in fields if other.attrs["units"] == field.attrs["units"])
        if field.attrs["units"] == "Pa" and largest[field.name] < _NOISE * max(alike):
            fields[k] = field.copy(data=np.zeros(field.shape))
    places = [_places(field) for field in fields]
    height = max(float(np.ptp(along) / np.ptp(across)) for across, along, _ in places)
    columns = min(_COLUMNS, len(fields))
    canvas, panels = style.new_panels(len(fields), columns, 3.6 + 0.2 / columns, 2.9 * height + 1.5, 0.4)
    for axes, field, (across, along, words) in zip(panels, fields, places, strict=True):
        lines = field.assign_attrs(long_name=textwrap.fill(field.attrs["long_name"], _LABEL))
        mark = _color(axes, across, along, lines, None if field.any() else (0.0, 1.0))
        if field.any():
            mark()
        axes.set(**words, aspect="equal", title=_place(field))
        if words["ylabel"].startswith("depth"):
            axes.invert_yaxis()
    return style.set_title(canvas, f"{title}: {name}, body {table.attrs['body']}")


def _worst(field: DataArray) -> DataArray:
    """Return a field at the step and depth of the value that counts."""
    values = np.where(np.isfinite(field), field, np.nan)
    worst = np.nanargmin(values) if field.name == "life" else np.nanargmax(values)
    at = dict(zip(field.dims, np.unravel_index(worst, values.shape), strict=True))
    return field.isel({name: int(at[name]) for name in ("step", "depth") if name in at})


def _place(field: DataArray) -> str:
    """Name step and depth of a map."""
    words = [f"step {int(field['step'])}"] if "step" in field.coords else []
    if not np.ptp(field["depth"].values):
        words.append(f"depth {worded(float(np.ravel(field['depth'])[0]), 'm')}")
    return ", ".join(words)
