"""Numbers of each load step, or each case of a study: histories, loops of load and motion, compliance."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import Any, Literal, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from ..analytic.compare import ClosedForms, is_circular
from ..analytic.friction import MindlinContact
from ..analytic.hertz_gap import quadratic
from ..arrays import Array, Dataset
from ..core.measures import cycles as cycles_of
from ..core.measures import line_of
from ..errors import DeckError, NotInResult
from ..result.history_words import LOADS_AND_MOTIONS, worth_showing
from ..result.layout import lattice_of
from ..result.result import Result
from ..result.view import Results, as_list, dataset_of, last_steps, parameters_of, title_of
from ..text import quantity, scaled, worded
from ..variables import CREEPAGES, PANELS, ROLLED, SUMMARY, VARIABLES, label_of, names_where, spelled
from . import style
from .registry import SEVERAL_RUNS, figure

_REPEATED = (("mean_pressure",), ("mean_gap",), ("contact_area",), ("max_pressure",))
FRICTIONLESS = (("normal_load",), ("approach",), ("contact_radius",), ("max_pressure",))
_UNSEEN = 1e-6  # share of mu P below which a creep force is not drawn
_JUMP = 1e-3  # of another creepage over the range of a curve, where it ends
_MANY = 60  # steps beyond which curves have no markers
_BOUNDS = dict.fromkeys(("stick_area", "stick_area_fit"), "stick_area_step_error")  # in place of _error
_CONSTANT = 1e-6  # spread over value of a quantity that does not change


def _known(dataset: Dataset) -> list[str]:
    histories = dataset.data_vars.items()
    return [str(name) for name, one in histories if one.dims == ("step",) and one.dtype.kind in "fi"]


def values_of(dataset: Dataset, name: str) -> Array:
    """Return the history of a quantity."""
    return np.asarray(dataset[name].values, dtype=float)


def vectors_of(dataset: Dataset, name: str) -> Array:
    """Return the history of a vector, its components in rows."""
    return np.stack([values_of(dataset, f"{name}_{axis}") for axis in "xy"])


def _scaled(dataset: Dataset, names: Sequence[str]) -> tuple[float, str]:
    """Return factor and unit for an axis of one unit; areas are shares of a window that repeats."""
    if dataset.attrs.get("lattice_periodic") and dataset[names[0]].attrs.get("units") == "m2":
        lattice = lattice_of(dataset)
        return 100.0 / (lattice.cell_area * lattice.size), "% of the window"
    largest = style.largest(*(values_of(dataset, name) for name in names))
    return scaled(largest, str(dataset[names[0]].attrs.get("units", "")))


def panels_of(histories: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """Return the quantities of each panel with the labels of their curves, by the title of the panel.

    Loads and motions below the noise, and quantities that stay 0, are left out. Areas extend to the edge
    between the nodes, where the histories have them.
    """
    noise = {*LOADS_AND_MOTIONS} - {*worth_showing(histories)}
    panels: dict[str, dict[str, str]] = {}
    for title, names in PANELS.items():
        known = tuple(name for name in names if name in histories[0])
        shown = [name for name in fitted(histories[0], known) if name not in noise]
        several = len(names) > 1
        curves = {
            name: (VARIABLES[name].symbol or _apart(name.removesuffix("_fit"), names)) if several else ""
            for name in shown
            if peak(name, histories) > 0.0
        }
        if curves:
            panels[title] = curves
    return panels


def peak(name: str, histories: Sequence[Mapping[str, Any]]) -> float:
    """Return the largest magnitude of a quantity."""
    return style.largest([float(history[name]) for history in histories])


def fitted(known: Container[Any], names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of areas or radii up to the edge between the nodes, where all are known."""
    fits = tuple(f"{name}_fit" for name in names)
    return fits if all(name in known for name in fits) else names


def _chosen(dataset: Dataset) -> list[tuple[str, ...]]:
    """Return the quantities that a history shows by default, in panels."""
    known = _known(dataset)
    if "stick_area" not in known:
        chosen = _REPEATED if "mean_gap" in known else FRICTIONLESS
        return [fitted(known, names) for names in chosen if names[0] in known]
    histories = dataset[known].reset_coords(drop=True).to_dataframe().to_dict("records")
    return [tuple(curves) for curves in panels_of(histories).values()]


@figure("history", "loads, motions, areas, p_max by step or over a load")
def history(
    result: Result | Dataset,
    quantities: Sequence[str] | None = None,
    over: str = "step",
    ax: Axes | None = None,
) -> Figure:
    """Draw quantities that have one value by step over the load steps, or over a load.

    Parameters
    ----------
    quantities : sequence of str, optional
        Names of the history variables, one for each panel; by default those above the noise.
    over : str
        Quantity on the horizontal axis: "step", or a history variable such as "tangential_load_x".
    ax : matplotlib.axes.Axes, optional
        Axes to draw the quantities into, which then share a panel; by default those of a new figure.

    Raises
    ------
    ValueError
        If a name is not a history variable of the result.
    """
    dataset = dataset_of(result)
    panels = _chosen(dataset) if quantities is None else [(name,) for name in quantities]
    known = _known(dataset)
    wanted = [*(name for names in panels for name in names), *([over] if over != "step" else [])]
    if unknown := [name for name in wanted if name not in known]:
        raise DeckError(f"no history of {', '.join(unknown)} in this result; there are {', '.join(known)}")
    if not (panels := [names for names in panels if names != (over,)]):
        raise DeckError(f"quantities: expected some besides over = {over!r}")
    if ax is not None:
        if len({dataset[name].attrs.get("units") for name in wanted if name != over}) > 1:
            raise DeckError("ax holds quantities of one unit; expected some in quantities")
        draw_history(ax, dataset, [name for names in panels for name in names], over)
        return style.drawing(ax, 0.0, 0.0)[0]
    columns = 3 if len(panels) > 6 and len(panels) % 3 == 0 else min(len(panels), 2)
    rows = -(-len(panels) // columns)
    canvas = style.new_figure((3.4 if columns < 3 else 2.8) * columns, 2.1 * rows + 0.3)
    grid = canvas.subplots(rows, columns, sharex=True, squeeze=False)
    empty = grid.size - len(panels)  # at the end of the first row
    slots = [*grid[0, : columns - empty], *grid[1:].flat]
    for axes in grid[0, columns - empty :]:
        axes.set_visible(False)
    for names, axes in zip(panels, slots, strict=True):
        draw_history(axes, dataset, names, over)
    for axes in grid[:-1].flat:
        axes.set_xlabel("")
    return style.set_title(canvas, title_of(dataset))


def draw_history(axes: Axes, dataset: Dataset, names: Sequence[str], over: str = "step") -> None:
    """Draw quantities of one unit over the load steps, or over another quantity."""
    factor, unit = _scaled(dataset, names)
    place, label = dataset["step"].values, "load step"
    if over != "step":
        along, length = _scaled(dataset, [over])
        place, label = values_of(dataset, over) * along, style.titled(_spelled(over), length)
    zero = names_where(lambda v: not v.is_field and (v.title or v.summary) and v.before == 0.0)
    begun = {name.removesuffix("_fit") for name in (*names, over)} <= {"step", *zero}
    place = np.insert(place, 0, 0.0) if begun else place
    for number, name in enumerate(names):
        values = np.insert(values_of(dataset, name), 0, 0.0)[not begun :] * factor
        color, dash = style.PALETTE[number % len(style.PALETTE)], ("-", "--")[number % 2]
        mark = ("o", "s")[number % 2] if place.size <= _MANY else ""
        axes.plot(place, values, ls=dash, marker=mark, ms=3, color=color, label=name)
        if (bound := _BOUNDS.get(name, f"{name}_error")) in dataset:
            around = np.insert(values_of(dataset, bound), 0, 0.0)[not begun :] * factor
            low, high = np.maximum(values - around, VARIABLES[name].least * factor), values + around
            axes.fill_between(place, low, high, color=color, alpha=0.2, lw=0, label="_nolegend_")
    points = np.concatenate([np.asarray(line.get_xydata(), float) for line in axes.lines])
    drawn = points[np.isfinite(points).all(axis=1), 1]
    if drawn.size and np.ptp(drawn) < _CONSTANT * np.abs(drawn).max():  # rounding errors
        axes.set_ylim(*sorted((0.0, 1.2 * float(drawn[0]))))
    named = _spelled(names[0] if len(names) == 1 else _common(names))
    axes.set(xlabel=label, ylabel=style.titled(named, unit))
    if len(names) > 1:
        axes.legend([_apart(name, names) for name in names], handlelength=2.2)
    axes.grid(color="0.9", lw=0.5)
    if over == "step":
        cast(MaxNLocator, axes.xaxis.get_major_locator()).set_params(integer=True)
        if "segment" in dataset:
            for change in np.flatnonzero(np.diff(dataset["segment"].values)):
                axes.axvline(float(place[change + begun]), color=style.GUIDE, lw=0.7, ls=":", zorder=0)


def _spelled(name: str) -> str:
    return spelled(name.removesuffix("_fit"))


def _common(names: Sequence[str]) -> str:
    """Return the words that the names of several quantities share."""
    words = [name.split("_") for name in names]
    return "_".join(word for word in words[0] if all(word in other for other in words))


def _apart(name: str, names: Sequence[str]) -> str:
    """Return the words of a name that others do not share."""
    common = _common(names).split("_")
    return " ".join(word for word in name.split("_") if word not in common)


# --- load against motion --------------------------------------------------------------------------


@figure("loop", "tangential load against shift", needs="tangential load")
def loop(
    result: Result | Dataset, cycles: int | Sequence[int] | None = None, ax: Axes | None = None
) -> Figure:
    """Draw the tangential load against the shift; for similar spheres also the closed solution.

    Both are taken along the direction of the largest load.
    """
    dataset = _before_wear(dataset_of(result))
    if "shift_x" not in dataset or "tangential_load_x" not in dataset:
        raise NotInResult("a contact without friction has no tangential load")
    if CREEPAGES[0] in dataset:
        raise NotInResult("rolling bodies have creepages in place of shifts; expected creep")
    load, shift = vectors_of(dataset, "tangential_load"), vectors_of(dataset, "shift")
    direction = line_of(load, 1e-6 * style.largest(values_of(dataset, "normal_load")), np.inf)
    if direction is None:
        raise NotInResult("there is no tangential load in this result")
    index = {(1.0, 0.0): "_x", (0.0, 1.0): "_y"}.get((round(direction[0], 6), round(direction[1], 6)), "")
    beside = "" if index else f" along {np.degrees(np.arctan2(direction[1], direction[0])):.3g}°"
    canvas, axes = style.drawing(ax, 4.6, 3.8)
    to_force = _draw_loop(
        axes,
        (np.array(direction) @ shift, f"shift $\\Delta{index}$" + beside, "m"),
        (np.array(direction) @ load, f"tangential load $Q{index}$" + beside, "N"),
        ClosedForms(dataset).shear_loop(),
        "Cattaneo–Mindlin,\nMindlin–Deresiewicz",
        cycles,
    )
    bound = float(dataset.attrs.get("friction_coefficient", np.inf)) * values_of(dataset, "normal_load")[-1]
    low, high = axes.get_ylim()
    room = 0.04 * (high - low)
    for level in (-bound * to_force, bound * to_force):
        if 1.3 * low < level < 1.3 * high:
            axes.axhline(level, color=style.GUIDE, lw=0.8, ls=":", label=r"$\mu P$")
            low, high = min(low, level - room), max(high, level + room)
    axes.set_ylim(low, high)
    axes.legend(handles=style.handles_of(axes))
    return style.set_title(canvas, title_of(dataset), ax)


@figure("creep", "creep forces against creepage", needs="rolling")
def creep(result: Result | Dataset, ax: Axes | None = None) -> Figure:
    """Draw creep forces and torque of rolling bodies against the creepage, or spin, that changes most.

    Forces are relative to friction times normal load, the torque to that times the contact radius.
    """
    dataset = dataset_of(result)
    if CREEPAGES[0] not in dataset:
        raise NotInResult("the bodies do not roll in this result")
    dataset = dataset.isel(step=np.flatnonzero(np.isfinite(values_of(dataset, "rolled_distance"))))
    length = {"spin": values_of(dataset, "contact_radius").max()}
    spans = {name: float(np.ptp(values_of(dataset, name))) * length.get(name, 1.0) for name in CREEPAGES}
    over = max(spans, key=lambda name: spans[name])
    mu = float(dataset.attrs.get("friction_coefficient", np.nan))
    scale = (mu if np.isfinite(mu) and mu > 0.0 else 1.0) * values_of(dataset, "normal_load")
    canvas, axes = style.drawing(ax, 4.6, 3.6)
    factor, unit = _scaled(dataset, [over])
    # a curve ends where another creepage, or the spin, changes
    jumps = [
        np.abs(np.diff(values_of(dataset, name))) * length.get(name, 1.0) > _JUMP * spans[over]
        for name in CREEPAGES
        if name != over
    ]
    ends = np.flatnonzero(np.any(jumps, axis=0)) + 1
    looks = (
        (style.COMPUTED, "o", "tangential_load_x"),
        (style.EXACT, "s", "tangential_load_y"),
        (style.THIRD, "^", "torque"),
    )
    for color, mark, name in looks:
        arm = values_of(dataset, "contact_radius") if name == "torque" else 1.0
        values = values_of(dataset, name) / (scale * arm)
        if np.abs(values).max(initial=0.0) > _UNSEEN:
            label = label_of(name) + (" / radius" if name == "torque" else "")
            place = np.insert(values_of(dataset, over) * factor, ends, np.nan)
            axes.plot(place, np.insert(values, ends, np.nan), color=color, marker=mark, ms=3, label=label)
    style.zero_lines(axes)
    axes.set(xlabel=style.titled(spelled(over), unit), ylabel=r"load / $\mu P$")
    axes.legend(handles=style.handles_of(axes))
    axes.grid(color="0.9", lw=0.5)
    return style.set_title(canvas, title_of(dataset), ax)


@figure("torsion", "torque against twist", needs="torque")
def torsion(
    result: Result | Dataset, cycles: int | Sequence[int] | None = None, ax: Axes | None = None
) -> Figure:
    """Draw the torque against the twist; for similar spheres also the solution of Lubkin."""
    dataset = _before_wear(dataset_of(result))
    if "twist" not in dataset or not any("torque" in names for names in _chosen(dataset)):
        raise NotInResult("there is no torque in this result")
    canvas, axes = style.drawing(ax, 4.6, 3.8)
    _draw_loop(
        axes,
        (values_of(dataset, "twist"), r"twist $\vartheta$", "rad"),
        (values_of(dataset, "torque"), "torque $M_z$", "N m"),
        ClosedForms(dataset).torsion_loop(),
        "Lubkin",
        cycles,
    )
    axes.legend()
    return style.set_title(canvas, title_of(dataset), ax)


Axis = tuple[Array, str, str]  # values, name and unit of the quantity on an axis


def _before_wear(dataset: Dataset) -> Dataset:
    """Return the load history without the cycles of wear, of which only the end is recorded."""
    if "wear_cycles" not in dataset:
        return dataset
    return dataset.isel(step=np.isnan(dataset["wear_cycles"].values))


def _draw_loop(
    axes: Axes,
    motion: Axis,
    load: Axis,
    closed: tuple[Array, Array] | None,
    name: str,
    chosen: int | Sequence[int] | None,
) -> float:
    """Draw a load against its motion, or some cycles of it; return the factor that scales the load."""
    (x, x_name, x_unit), (y, y_name, y_unit) = motion, load
    (to_x, x_unit), (to_y, y_unit) = scaled(style.largest(x), x_unit), scaled(style.largest(y), y_unit)
    style.zero_lines(axes)
    size = 3.5 if x.size <= 2 * _MANY else 2.0
    look: dict[str, Any] = {"marker": "o", "ms": size, "mfc": "none", "mew": 0.9}
    found = cycles_of(x, y)
    numbers = [-1] * bool(found) if chosen is None else [chosen] if isinstance(chosen, int) else [*chosen]
    colors = [style.COMPUTED] if len(numbers) < 2 else style.shades(len(numbers))
    for number, color in zip(numbers, colors, strict=False):
        place = number if number < 0 else number - 1
        if number == 0 or not -len(found) <= place < len(found):
            raise DeckError(f"there is no cycle {number}; the history has {len(found)}")
        first, last, area = found[place]
        steps = slice(first, last + 1)
        label = f"cycle {place % len(found) + 1}:\nloop of {worded(area, 'J')}"
        axes.fill(x[steps] * to_x, y[steps] * to_y, color=color, alpha=0.12, lw=0, label=label, zorder=1)
        if chosen is not None:
            axes.plot(x[steps] * to_x, y[steps] * to_y, color=color, lw=0.7, zorder=3, **look)
    if chosen is None:
        line = {"ls": ""} if closed is not None else {"lw": 0.7}
        axes.plot(x * to_x, y * to_y, color=style.COMPUTED, label="computed", zorder=3, **look, **line)
    if closed is not None:
        axes.plot(closed[0] * to_x, closed[1] * to_y, color=style.EXACT, lw=1.1, label=name, zorder=2)
    axes.set(xlabel=f"{x_name} ({x_unit})", ylabel=f"{y_name} ({y_unit})")
    return to_y


def initial_compliance(dataset: Dataset) -> tuple[float, float]:
    """Return the shift of the first step with a tangential load over that of Mindlin, and its Q/(mu P).

    Spheres are pressed, then sheared at a constant normal load; another result is an error.
    """
    closed, gap = ClosedForms(dataset), quadratic(dataset)
    if gap is None or not 0.0 < closed.friction < np.inf:
        raise NotInResult("the tangential compliance is that of spheres with friction")
    normal = values_of(dataset, "normal_load")
    load, shift = vectors_of(dataset, "tangential_load"), vectors_of(dataset, "shift")
    step = int(
        np.argmax(np.hypot(*load) > 1e-6 * closed.friction * normal)
    )  # 0 also without a tangential load
    if step == 0 or abs(normal[step] - normal[step - 1]) > 1e-6 * normal[step]:
        raise NotInResult(
            "the tangential compliance needs a load step of shear alone after those of pressing"
        )
    hertz = gap.contact(float(normal[step]))
    if not is_circular(hertz):
        raise NotInResult("the tangential compliance is that of spheres with friction")
    compliance = 4.0 / closed.modulus * (1.0 + 0.5 * closed.gamma)
    mindlin = MindlinContact(closed.friction, float(normal[step]), hertz.semi_major, compliance)
    size = float(np.hypot(*load[:, step]))
    moved = float((shift[:, step] - shift[:, step - 1]) @ load[:, step]) / size
    if not size < mindlin.sliding_load:
        raise NotInResult("the first tangential load is as large as friction can carry")
    return moved / float(mindlin.shift(size)), size / mindlin.sliding_load


@figure("compliance", "initial tangential compliance of some files against beta", needs=SEVERAL_RUNS)
def compliance(results: Results, ax: Axes | None = None) -> Figure:
    """Draw the initial tangential compliance of spheres against Dundurs' beta, a point for each result.

    The spheres are pressed, then sheared.

    Raises
    ------
    ValueError
        If one of the results is another one.
    """
    series: dict[tuple[float, str], list[tuple[float, float]]] = {}
    shares = []
    for dataset in map(dataset_of, as_list(results)):
        ratio, share = initial_compliance(dataset)
        shares.append(share)
        key = float(dataset.attrs["friction_coefficient"]), str(dataset.attrs.get("coupling", "full"))
        series.setdefault(key, []).append((abs(float(dataset.attrs["dundurs_beta"])), ratio))
    if not shares:
        raise DeckError("expected one result at least")
    canvas, axes = style.drawing(ax, 4.6, 3.6)
    axes.axhline(1.0, color=style.GUIDE, lw=0.8, ls=":", label="Mindlin")
    colors = dict(
        zip(sorted({mu for mu, _ in series}), (style.COMPUTED, style.EXACT, style.THIRD), strict=False)
    )
    for (mu, coupling), points in sorted(series.items()):
        beta, ratio_of = np.array(sorted(points)).T
        full = coupling == "full"
        look: dict[str, Any] = {"marker": "o"} if full else {"marker": "s", "ls": "--", "mfc": "none"}
        label = f"$\\mu$ = {mu:g}" + ("" if full else f", {coupling.title()}")
        axes.plot(beta, ratio_of, color=colors.get(mu, "black"), ms=4, lw=0.9, label=label, **look)
    axes.set(xlabel=r"$|\beta|$", ylabel=r"initial compliance $\Delta/\Delta_\mathrm{Mindlin}$")
    axes.legend()
    low, high = min(shares), max(shares)
    at = f"{low:.3g}" if high - low < 1e-3 else f"{low:.3g} to {high:.3g}"
    return style.set_title(canvas, f"Spheres pressed, then sheared to $Q/\\mu P$ = {at}", ax)


# --- studies ------------------------------------------------------------------------------------------------

_LEGEND = 8  # curves, more of which get a scale of colors


def _varying(study: Dataset) -> list[str]:
    """Return the quantities of a summary, or of rolling, that differ between cases and are no parameter."""
    power = "creep_power" if "creep_power_error" in study else "slip_power"
    creep = (*(load for load, _ in ROLLED.values()), *CREEPAGES, power)
    known: tuple[str, ...] = ("approach", *SUMMARY)
    if "mean_gap" in study:  # of many spots there is no radius
        known = tuple("contact_area" if name == "contact_radius" else name for name in SUMMARY)
    parameters = [study[name] for name in parameters_of(study) if study[name].dtype.kind == "f"]

    def varies(name: str) -> bool:
        values = study[name].values[np.isfinite(study[name].values)]
        least = 1e-6 * style.largest(values)
        prescribed = any(bool(abs(study[name] - one).max() <= least) for one in parameters)
        return bool(values.size and np.ptp(values) > least and not prescribed)

    return [name for name in (creep if CREEPAGES[0] in study else known) if name in study and varies(name)]


@figure("study", "quantities of the cases over a parameter", needs="a study")
def study(study: Dataset, quantities: Sequence[str] | None = None, over: str = "") -> Figure:
    """Draw quantities of the last load step over a parameter of a study; cases not on a grid are points.

    Parameters
    ----------
    study : xarray.Dataset
        The result of a study.
    quantities : sequence of str, optional
        Names of quantities, one for each panel; by default those of a summary that vary.
    over : str
        Parameter on the horizontal axis; by default the one with the most values.

    Raises
    ------
    DeckError
        If there is no such name, or no case is done.
    """
    study = last_steps(study)
    numbers = [n for n in parameters_of(study) if study[n].dtype.kind in "fi" and study[n].ndim == 1]
    if not numbers or (over and over not in numbers):
        expected = f"expected {' or '.join(numbers)}" if numbers else "none of its parameters is a number"
        raise DeckError(f"over = {over!r}: {expected}")
    over = over or max(numbers, key=lambda name: study[name].size)
    names = _varying(study) if quantities is None else list(quantities)
    if unknown := [name for name in names if name not in study.data_vars]:
        raise DeckError(f"{unknown[0]} is no quantity of this study")
    if not names:
        raise DeckError("no quantity differs between its cases; are any done?")
    [along] = study[over].dims
    others = [dim for dim in study["status"].dims if dim != along]
    curves = study.stack(curve=others) if others else study.expand_dims("curve")
    labels = [_label(study, others, place) for place in curves["curve"].values] if others else [""]
    canvas, panels = style.new_panels(len(names), min(len(names), 2), 3.4, 2.1, 0.5)
    colors = style.shades(len(labels)) if others else [style.COMPUTED]
    (to_place, length), order = _scaled(curves, [over]), np.argsort(curves[over].values)
    look: dict[str, Any] = {"ls": "-" if along != "case" else "", "marker": "o", "ms": 3}
    for axes, name in zip(panels, names, strict=True):
        factor, unit = _scaled(curves, [name])
        for k, label in enumerate(labels):
            place, values = (curves[over].values * to_place), curves[name].isel(curve=k).values * factor
            axes.plot(place[order], values[order], label=label, color=colors[k], **look)
            if (bound := f"{name}_error") in curves:
                around = curves[bound].isel(curve=k).values * factor
                axes.errorbar(place, values, around, fmt="none", ecolor=colors[k], elinewidth=0.8, capsize=2)
        named = _spelled(name) if name in VARIABLES else name
        axes.set(xlabel=style.titled(over, length), ylabel=style.titled(named, unit))
        if _by_decades(place[order]):
            _set_log(axes, "x")
            if all(_by_decades(curves[name].isel(curve=k).values[order]) for k in range(len(labels))):
                _set_log(axes, "y")
        axes.grid(color="0.9", lw=0.5)
    if 1 < len(labels) <= _LEGEND:
        style.legend_under(canvas, style.handles_of(panels[0]))
    elif others:
        style.color_scale(canvas, panels, labels, colors)
    return style.set_title(canvas, str(study.attrs.get("title", "")))


def _set_log(axes: Axes, name: Literal["x", "y"]) -> None:
    """Set a logarithmic scale; over a few decades 1, 2 and 5 of each have labels."""
    axes.set(**{f"{name}scale": "log"})
    axis = axes.xaxis if name == "x" else axes.yaxis
    low, high = axis.get_data_interval()
    if high < 300.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def _by_decades(values: Array) -> bool:
    """Test whether values are over more than a decade, and spread far more evenly by their logarithms."""
    values = values[np.isfinite(values)]
    if values.size < 3 or not values.min() > 0.0 or values.max() < 10.0 * values.min():
        return False
    logs = np.log(values)
    uneven, uneven_logs = (np.std(np.diff(at)) / np.ptp(at) for at in (values, logs))
    return bool(uneven_logs < 0.5 * uneven)


def _label(study: Dataset, dims: Sequence[object], place: object) -> str:
    """Return the values of the other parameters of a curve."""
    values = place if isinstance(place, tuple) else (place,)
    words = []
    for dim, value in zip(dims, values, strict=True):
        unit = str(study[dim].attrs.get("units", "1")).removesuffix("1")
        text = value if isinstance(value, str) else quantity(float(value), unit) if unit else f"{value:g}"
        words.append(f"{dim} {text}")
    return ", ".join(words)
