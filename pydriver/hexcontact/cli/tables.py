"""What came out of a run or stands in a file, beside Hertz: as tables for the terminal, and for programs."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import HexcontactError
from ..result.history import (
    error_of,
    fitted,
    is_frictional,
    load_or_motion,
    remarks,
    residuals,
    step_rows,
    stick_share,
    worth_showing,
)
from ..text import PREFIXES, percent, quantity, rich_table
from ..variables import VARIABLES, label_of, spelled

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

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


# --- the load steps of a run or a file ------------------------------------------------------------


@dataclass(frozen=True)
class Summary:
    """The load steps of a run or a file, to be shown as tables or handed to programs.

    Attributes
    ----------
    title : str
        Title of the case.
    histories : sequence of mapping
        History of each load step.
    parameters : mapping
        How they were solved: parameters of the case, or attributes of the result.
    case : Problem or None
        The case, if it is known; without it there is nothing about Hertz.
    result : Result or None
        The result, if it was read from a file.
    """

    title: str
    histories: Sequence[History]
    parameters: Mapping[str, Any]
    case: Problem | None
    result: Result | None = None

    @classmethod
    def of_run(cls, case: Problem, histories: Sequence[History], refined: Result | None) -> Summary:
        """Summarize a run; of a refined lattice the finest one, with errors, is in its file."""
        from ..problem.overview import parameters_of

        found = histories_of(refined) if refined is not None else histories
        return cls(case.title, found, parameters_of(case), case, refined)

    @classmethod
    def of_result(cls, result: Result) -> Summary:
        """Summarize a file."""
        return cls(
            result.case_title, histories_of(result), result.dataset.attrs, case_of(result.deck), result
        )

    @property
    def remarks(self) -> list[str]:
        """Sentences about steps that need one."""
        return remarks(self.histories, self.parameters)

    @property
    def hertz(self) -> list[tuple[str, float, float, str]]:
        """The last step beside Hertz, see `against_hertz`."""
        return against_hertz(self.case, self.histories[-1]) if self.case is not None else []

    def print(self, whole_file: bool = False) -> None:
        """Print the history, the last step, how it compares with Hertz, lattices and errors.

        Parameters
        ----------
        whole_file : bool
            Also where the result comes from.
        """
        shown, last, named = console(), self.histories[-1], ""
        if whole_file and self.result is not None:
            shown.print(pairs(self.title, file_rows(self.result)))
        elif self.title:
            named = f" of {self.title!r}"
        if whole_file or len(self.histories) > 1:
            shown.print(history_table(self.histories, shown))
        shown.print(pairs(f"Last load step{named}", step_rows(last)))
        if rows := hertz_rows(self.hertz, last):
            shown.print(rich_table("Against Hertz", HERTZ_HEADERS, rows))
        if self.result is not None and (rows := trial_rows(self.result)):
            shown.print(rich_table("Accuracy", TRIAL_HEADERS, rows))
        for remark in self.remarks:
            shown.print(f"note: {remark}", soft_wrap=True)

    def steps(self) -> list[dict[str, Any]]:
        """Return the histories for programs, each with its number."""
        return [{"step": number, **history} for number, history in enumerate(self.histories, start=1)]

    def as_run(self) -> dict[str, Any]:
        """Return for programs what came out of a run that is complete."""
        worst = [residual for history in self.histories for residual in residuals(history).values()]
        return {
            "title": self.title,
            "complete": True,
            "load_steps": len(self.histories),
            "seconds": math.fsum(history["seconds"] for history in self.histories),
            "operator_applications": math.fsum(h["operator_applications"] for h in self.histories),
            "largest_residual": max(worst, default=math.nan),
            "hertz": {name: {"exact": exact, "computed": value} for name, exact, value, _ in self.hertz},
            "steps": self.steps(),
        }


def file_content(result: Result) -> dict[str, Any]:
    """Return for programs what a result holds: its attributes, size and fields, and its history."""
    summary, sizes = Summary.of_result(result), result.dataset.sizes
    return {
        "file": result.path,
        **result.dataset.attrs,
        "complete": result.complete,
        "rows": sizes["row"],
        "columns": sizes["col"],
        "fields": fields_of(result),
        "warnings": summary.remarks,
        "steps": summary.steps(),
    }


def histories_of(result: Result) -> list[dict[str, Any]]:
    """Return the histories of the load steps of a result."""
    return [{str(name): value for name, value in row.items()} for row in result.history.to_dict("records")]


def fields_of(result: Result) -> list[str]:
    """Return the names of the fields that a result holds at each step."""
    return [str(name) for name, values in result.dataset.data_vars.items() if values.ndim == 3]


def case_of(deck: str) -> Problem | None:
    """Return the case of a deck that stands in a result, if it tells all of it."""
    from ..problem.problem import Problem

    try:
        return Problem.from_text(deck) if deck else None
    except HexcontactError:  # a deck with parts that were made in Python
        return None


# --- the history ----------------------------------------------------------------------------------


def history_table(histories: Sequence[History], console: Console) -> Table:
    """Return a table of the load steps; of a long history only some steps, the last among them.

    The residual is the largest of a step. What a narrow console has no room for is left out, estimated errors
    as the last.
    """
    stride = max(1, math.ceil(len(histories) / _MOST_ROWS))
    chosen = [k for k in range(len(histories)) if (len(histories) - 1 - k) % stride == 0]
    for with_errors in (True, False):
        columns = _columns(histories, with_errors)
        for spare in ("", "time", "label", "residual"):
            columns.pop(spare, None)
            rows = [(f"{k + 1}", *(entry(histories[k]) for entry in columns.values())) for k in chosen]
            shown = rich_table("History", ("step", *columns), rows, tight=True)
            if console.measure(shown, options=console.options.update_width(1000)).maximum <= console.width:
                return shown
    return shown


def _columns(histories: Sequence[History], with_errors: bool) -> dict[str, Callable[[History], str]]:
    """Return the columns of a table of load steps by their header, with estimated errors if there is room."""

    def column(entry: Callable[[History], str], name: str) -> Callable[[History], str]:
        return lambda history: entry(history) + (error_of(name, history) if with_errors else "")

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


def hertz_rows(compared: Sequence[tuple[str, float, float, str]], history: History) -> list[Row]:
    """Return what `against_hertz` found as rows: quantity, Hertz, computed, difference."""
    named = {
        "contact_radius_fit": "contact radius (to the edge)",
        "contact_radius": "contact radius (area of the nodes)",
    }
    rows: list[Row] = []
    for name, exact, value, unit in compared:
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
        values_shown = (_value(float(values[k]), VARIABLES[name].units) for k in shown)
        rows.append((spelled(name.removesuffix("_fit")), *values_shown, percent(relative[name])))
    return [*rows, ("target", "", "", "", percent(float(data.attrs["accuracy_target"])))]


# --- a file ---------------------------------------------------------------------------------------


def file_rows(result: Result) -> list[Row]:
    """Return where a result comes from and how large it is."""
    attributes, sizes = result.dataset.attrs, result.dataset.sizes
    planned = int(attributes["planned_steps"])
    plan = f"{planned} were planned" if planned else "their number was open"
    state = "complete" if result.complete else f"unfinished, {plan}"
    return [
        ("file", result.path),
        ("written by", f"{attributes['source']}, run started {attributes['created']}"),
        ("load steps", f"{len(result)} ({state})"),
        *([("stopped", str(attributes["stopped"]))] if "stopped" in attributes else []),
        ("window", f"{sizes['row']} x {sizes['col']} nodes"),
        ("spacing", quantity(float(attributes["lattice_spacing"]), "m")),
        ("algorithm", algorithm(attributes)),
        *([("accuracy", _reached(attributes))] if "accuracy_reached" in attributes else []),
        ("fields", ", ".join(fields_of(result))),
    ]


def _reached(attributes: Mapping[str, Any]) -> str:
    """Say whether the target of the accuracy is reached."""
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
