"""Tables for the terminal: what is going to be run, what came out, and how it compares with Hertz."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..errors import HexcontactError
from ..result.history import (
    error_of,
    fitted,
    is_frictional,
    load_or_motion,
    residuals,
    stick_share,
    worth_showing,
)
from ..text import PREFIXES, percent, quantity, rich_table
from ..variables import VARIABLES, label_of, spelled

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from ..case import Case
    from ..problem.problem import Problem
    from ..result.result import Result

History = Mapping[str, Any]
Row = tuple[str, ...]

_MOST_ROWS = 24  # steps shown of a long history


def console() -> Console:
    """Return the console on standard output: colors on a terminal, plain wide text elsewhere."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else 130
    return Console(highlight=False, markup=False, emoji=False, width=width)


def pairs(title: str, rows: Iterable[Row]) -> Table:
    """Return a table of names and what belongs to them."""
    return rich_table(title, ("", ""), rows)


# --- after the run --------------------------------------------------------------------------------


def history_table(histories: Sequence[History], console: Console) -> Table:
    """Return a table of the load steps; of a long history only some steps, the last among them.

    The residual is the largest of a step. What a narrow console has no room for is left out, estimated errors
    as the last.
    """
    stride = max(1, math.ceil(len(histories) / _MOST_ROWS))
    chosen = [k for k in range(len(histories)) if (len(histories) - 1 - k) % stride == 0]
    for told in (_and_error, _alone):
        columns = _columns(histories, told)
        for spare in ("", "time", "label", "residual"):
            columns.pop(spare, None)
            rows = [(f"{k + 1}", *(entry(histories[k]) for entry in columns.values())) for k in chosen]
            shown = rich_table("History", ("step", *columns), rows, tight=True)
            if console.measure(shown, options=console.options.update_width(1000)).maximum <= console.width:
                return shown
    return shown


_Told = Callable[[str, str, History], str]


def _alone(text: str, name: str, history: History) -> str:
    return text


def _and_error(text: str, name: str, history: History) -> str:
    return text + error_of(name, history)


def _columns(histories: Sequence[History], told: _Told) -> dict[str, Callable[[History], str]]:
    """Return what a table of load steps shows, by its header."""

    def column(entry: Callable[[History], str], name: str) -> Callable[[History], str]:
        return lambda history: told(entry(history), name, history)

    columns: dict[str, Callable[[History], str]] = {"label": lambda h: str(h.get("label", ""))}
    for name in worth_showing(histories):
        columns[label_of(name)] = column(functools.partial(load_or_motion, name), name)
    if is_frictional(histories[-1]):
        columns["stick"] = column(stick_share, "stick_area")
    else:
        columns["p_max"] = column(lambda h: quantity(h["max_pressure"], "Pa"), "max_pressure")
        columns["radius"] = column(lambda h: quantity(fitted("contact_radius", h), "m"), "contact_radius")
    columns["residual"] = lambda h: f"{max(residuals(h).values(), default=math.nan):.1e}"
    columns["time"] = lambda h: quantity(h["seconds"], "s", 3)
    return columns


# --- against Hertz --------------------------------------------------------------------------------


def against_hertz(case: Problem, history: History) -> list[tuple[str, float, float, str]]:
    """Compare a load step with Hertz's solution.

    Parameters
    ----------
    case : Problem
        The case.
    history : mapping
        History of one of its steps.

    Returns
    -------
    list of (str, float, float, str)
        Quantity as in histories, Hertz, computed, unit; empty where Hertz does not apply: with friction, with
        surfaces that are not quadratic or touch along a line, without load.
    """
    load = float(history["normal_load"])
    surfaces = [body.surface for body in (case.body_1, case.body_2) if body.surface is not None]
    curvatures = [curvature for surface in surfaces if (curvature := surface.curvature) is not None]
    quadratic = len(curvatures) == len(surfaces)
    if case.frictional or load <= 0 or not quadratic:
        return []
    import numpy as np

    from ..analytic import hertz_ellipse

    try:
        hessian = np.sum([np.zeros((2, 2)), *curvatures], axis=0)
        hertz = hertz_ellipse(case.pair.effective_modulus, hessian, normal_load=load)
    except ValueError:  # contact along a line or all over, or a gap given in Python
        return []
    radius = math.sqrt(hertz.semi_major * hertz.semi_minor)
    known = {
        "max_pressure": (hertz.max_pressure, "Pa"),
        "approach": (hertz.approach, "m"),
        "contact_radius_fit": (radius, "m"),
        "contact_radius": (radius, "m"),
    }
    return [
        (name, exact, float(history[name]), unit)
        for name, (exact, unit) in known.items()
        if not math.isnan(history.get(name, math.nan))
    ]


def hertz_rows(case: Problem, history: History) -> list[Row]:
    """Return the rows of `against_hertz`: quantity, Hertz, computed, difference."""
    named = {
        "contact_radius_fit": "contact radius (to the edge)",
        "contact_radius": "contact radius (area of the nodes)",
    }
    rows: list[Row] = []
    for name, exact, value, unit in against_hertz(case, history):
        off, error = f"{100 * (value / exact - 1):+.3f} %", float(history.get(f"{name}_error", math.nan))
        if not math.isnan(error):
            off += f" (± {percent(error / value)} estimated)"
        rows.append((named.get(name, spelled(name)), quantity(exact, unit, 6), quantity(value, unit, 6), off))
    return rows


HERTZ_HEADERS = ("", "Hertz", "computed", "difference")


# --- accuracy -------------------------------------------------------------------------------------


def _value(value: float, unit: str) -> str:
    """Write a number to five digits; prefixes of squares are squared, too."""
    if unit != "m2" or value <= 0.0:
        return quantity(value, unit, 5)
    power = 3 * math.floor((math.log10(value) + 1) / 6)  # from 0.1 of a unit on
    return f"{value / 10.0 ** (2 * power):#.5g} ".replace(". ", " ") + f"{PREFIXES[power]}m²"


TRIAL_HEADERS = ("", "first lattice", "last but one", "last", "largest error")


def trial_rows(result: Result) -> list[Row]:
    """Return what decides about the accuracy of a result that was refined, at the last load step.

    Parameters
    ----------
    result : Result
        The result.

    Returns
    -------
    list of rows
        Quantity, on three of the lattices, largest error of all load steps in its largest value; empty if
        the lattice was not refined.
    """
    from ..solve.accuracy import JUDGED, relative_errors

    data = result.dataset
    if "trial_spacing" not in data:
        return []
    own = data.isel(trial=data["trial_copy"].values == 0)
    shown = [0, -2, -1]
    names = [name for name in JUDGED if name in data]
    histories = result.history.to_dict("records")
    errors = [{name: history[f"{name}_error"] for name in names} for history in histories]
    relative = relative_errors(histories, errors)
    rows = [
        ("spacing", *(quantity(float(own["trial_spacing"][k]), "m") for k in shown), ""),
        ("nodes", *(f"{int(own['trial_nodes'][k]):,}" for k in shown), ""),
    ]
    for name in names:
        values = own[f"trial_{name}"].isel(step=-1)
        told = (_value(float(values[k]), VARIABLES[name].units) for k in shown)
        rows.append((spelled(name.removesuffix("_fit")), *told, percent(relative[name])))
    return [*rows, ("target", "", "", "", percent(float(data.attrs["accuracy_target"])))]


# --- a file ---------------------------------------------------------------------------------------


def file_rows(result: Result) -> list[Row]:
    """Return where a result comes from and how large it is."""
    attributes, sizes = result.dataset.attrs, result.dataset.sizes
    planned = int(attributes["planned_steps"])
    plan = f"{planned} were planned" if planned else "their number was open"
    state = "complete" if result.complete else f"unfinished, {plan}"
    fields = [str(n) for n, v in result.dataset.data_vars.items() if v.dims == ("step", "row", "col")]
    return [
        ("file", result.path),
        ("written by", f"{attributes['source']}, run started {attributes['created']}"),
        ("load steps", f"{len(result)} ({state})"),
        *([("stopped", str(attributes["stopped"]))] if "stopped" in attributes else []),
        ("window", f"{sizes['row']} x {sizes['col']} nodes"),
        ("spacing", quantity(float(attributes["lattice_spacing"]), "m")),
        ("algorithm", algorithm(attributes)),
        *([("accuracy", _reached(attributes))] if "accuracy_reached" in attributes else []),
        ("fields", ", ".join(fields)),
    ]


def _reached(attributes: Mapping[str, Any]) -> str:
    """Say whether the accuracy that was asked for is reached."""
    if "accuracy_shortfall" in attributes:
        return str(attributes["accuracy_shortfall"])
    error, target = (percent(float(attributes[f"accuracy_{name}"])) for name in ("estimate", "target"))
    return f"target {target} reached: estimated error {error}"


def algorithm(attributes: Mapping[str, Any]) -> str:
    """Say from the attributes of a result how it was computed."""
    words = str(attributes.get("algorithm", "unknown"))
    if words in ("static", "incremental"):
        words += f", friction coefficient {float(attributes['friction_coefficient']):g}"
    if words.startswith("incremental"):
        words += ", entry interpolated" * (attributes.get("entry") == "interpolated")
    return words + ", coupling goodman" * (attributes.get("coupling") == "goodman")


def case_of(result: Result) -> Case | None:
    """Return the case a result came from, if its deck tells."""
    from ..case import Case

    try:
        return Case.from_text(result.deck) if result.deck else None
    except HexcontactError:  # a deck with parts that were made in Python
        return None
