"""Results as tables for the terminal and as objects for programs, compared with Hertz."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from ..core.measures import half_axes
from ..errors import DeckError
from ..result import history_words as words
from ..text import Row, Table, percent, quantity
from ..variables import VARIABLES, label_of, spelled

if TYPE_CHECKING:
    from rich.console import Console

    from ..result.history_words import Extent
    from ..result.result import Result

History = Mapping[str, Any]

_LAST = "Last load step"
_TRIALS = ("", "first lattice", "last but one", "last", "largest error")
_MOST_ROWS = 24  # steps shown of a long history
_PIPE = 130  # characters of a line where there is no terminal


def console() -> Console:
    """Return the console on standard output: with colors on a terminal or by FORCE_COLOR, else wide."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else _PIPE
    return Console(highlight=False, markup=False, emoji=False, width=width)


# --- the load steps of a run or a file ------------------------------------------------------------


class Summary(NamedTuple):
    """Present the load steps of a run or a file as tables and as objects."""

    title: str
    histories: Sequence[History]
    parameters: Mapping[str, Any]  # of the case, or attributes of the result
    deck: str  # without it there is no comparison with Hertz
    result: Result | None = None  # if it was read from a file
    extent: Extent | None = None

    @classmethod
    def of_result(cls, result: Result) -> Summary:
        """Summarize a file."""
        histories, attributes = histories_of(result), result.dataset.attrs
        extent = words.extent_of(result.step(-1))
        return cls(result.case_title, histories, attributes, result.deck, result, extent)

    @property
    def remarks(self) -> list[str]:
        """Sentences about doubtful steps."""
        found = words.remarks(self.histories, self.parameters)
        from ..deck.read import recorded

        try:
            recorded(self.deck).tables("body")
        except DeckError as error:  # of a later version, or of an earlier one that allowed more
            found.append(f"not compared with Hertz: {str(error).splitlines()[0]}")
        return found

    @property
    def hertz(self) -> list[tuple[str, float, float, str]]:
        """The last step compared with Hertz, see `against_hertz`."""
        from ..analytic.hertz_gap import against_hertz  # `check` needs no closed solution

        try:
            return against_hertz(self.deck, self.parameters, self.histories[-1])
        except DeckError:  # see `remarks`
            return []

    def print(self, whole_file: bool = False) -> None:
        """Print the history, the last step, its comparison with Hertz, lattices; origin of a file."""
        shown, named = console(), ""
        if whole_file and self.result is not None:
            shown.print(Table(("", ""), file_rows(self.result), self.title))
        elif self.title:
            named = f" of {self.title!r}"
        if whole_file or len(self.histories) > 1:
            shown.print(history_table(self.histories, shown))
        for title, table in self.tables(_MOST_ROWS).items():
            if table.rows:
                shown.print(table._replace(title=title + named * (title == _LAST)))
        before = () if whole_file else ("warnings", "notes")  # printed before the run
        printed = [line for name in before for line in str(self.parameters.get(name, "")).splitlines()]
        for remark in self.remarks:
            if remark not in printed:
                shown.print(f"note: {remark}", soft_wrap=True)

    def tables(self, most: int) -> dict[str, Table]:
        """Return the tables that terminal and page share, by title; `most` rows of energies."""
        last = self.histories[-1]
        return {
            "Dissipated energy": words.energy_table(self.histories, most),
            _LAST: Table(("", ""), words.step_rows(last, self.extent)),
            "Against Hertz": Table(("", "Hertz", "computed", "difference"), hertz_rows(self.hertz, last)),
            "Accuracy": Table(_TRIALS, [] if self.result is None else trial_rows(self.result)),
        }

    def steps(self) -> list[dict[str, Any]]:
        """Return the histories, each with the number of its step."""
        return [{"step": number, **history} for number, history in enumerate(self.histories, start=1)]

    def as_run(self) -> dict[str, Any]:
        """Return a complete run as the object that ``run --json`` prints."""
        worst = [residual for history in self.histories for residual in words.residuals(history).values()]
        return {
            "title": self.title,
            "complete": True,
            "load_steps": len(self.histories),
            "seconds": math.fsum(history["seconds"] for history in self.histories),
            "operator_applications": math.fsum(h["operator_applications"] for h in self.histories),
            "largest_residual": max(worst, default=math.nan),
            "hertz": {name: {"exact": exact, "computed": value} for name, exact, value, _ in self.hertz},
            **self.parts(),
            "steps": self.steps(),
        }

    def parts(self) -> dict[str, Any]:
        """Return segments and cycles of the history, with the energy that friction dissipated in each."""
        return {"segments": words.segments(self.histories), "cycles": words.cycles(self.histories)}


def file_content(result: Result) -> dict[str, Any]:
    """Return a result as the object that ``info --json`` prints: attributes, size, fields, history."""
    summary, sizes = Summary.of_result(result), result.dataset.sizes
    return {
        "file": result.path,
        **result.dataset.attrs,
        "complete": result.complete,
        "rows": sizes["row"],
        "columns": sizes["col"],
        "fields": fields_of(result),
        "warnings": summary.remarks,
        **summary.parts(),
        "steps": summary.steps(),
    }


def histories_of(result: Result) -> list[dict[str, Any]]:
    """Return the histories of the load steps of a result."""
    return [{str(name): value for name, value in row.items()} for row in result.history.to_dict("records")]


def fields_of(result: Result) -> list[str]:
    """Return the names of the fields in a result."""
    return [str(name) for name, values in result.dataset.data_vars.items() if values.ndim == 3]


# --- the history ----------------------------------------------------------------------------------


def history_table(histories: Sequence[History], console: Console) -> Table:
    """Return a table of the load steps; of a long history only ends of segments, peaks and the last step.

    The residual is the largest of a step. On a narrow console columns are left out, estimated errors last.
    """
    several = len(histories) > _MOST_ROWS
    chosen = words.some_steps(histories, _MOST_ROWS) if several else range(len(histories))
    title = f"History, {len(chosen)} of {len(histories)} load steps" if several else "History"
    for with_errors in (True, False):
        columns = _columns(histories, with_errors)
        for spare in ("", "time", "label", "residual"):
            columns.pop(spare, None)
            rows = [(f"{k + 1}", *(entry(histories[k]) for entry in columns.values())) for k in chosen]
            shown = Table(("step", *columns), rows, title, tight=True)
            needed = console.measure(shown, options=console.options.update_width(1000))
            if needed.maximum <= console.width:
                return shown
    return shown


def _columns(histories: Sequence[History], with_errors: bool) -> dict[str, Callable[[History], str]]:
    """Return the columns of a table of load steps by their headers, with or without estimated errors."""
    write = words.with_error if with_errors else words.value_of
    columns: dict[str, Callable[[History], str]] = {"label": lambda h: str(h.get("label", ""))}
    columns |= {label_of(name): partial(write, name) for name in words.worth_showing(histories)}
    if words.is_frictional(histories[-1]):
        columns["stick"] = partial(words.stick_share, with_error=with_errors)
    else:
        columns["p_max"] = partial(write, "max_pressure")
        if any(words.repeats(history) for history in histories):
            columns["contact area"] = lambda h: words.contact_size(h)[1]
        elif any(half_axes(history) for history in histories):
            columns["half-axes"] = lambda h: words.contact_size(h)[1]
        else:
            columns["radius"] = partial(write, "contact_radius")
    columns["residual"] = lambda h: f"{max(words.residuals(h).values(), default=math.nan):.1e}"
    columns["time"] = lambda h: quantity(h["seconds"], "s", 3)
    return columns


# --- against Hertz --------------------------------------------------------------------------------


def hertz_rows(compared: Sequence[tuple[str, float, float, str]], history: History) -> list[Row]:
    """Return the output of `against_hertz` as rows: quantity, Hertz, computed, difference."""
    named = {
        "contact_radius_fit": "contact radius (to the edge)",
        "contact_radius": "contact radius (area of the nodes)",
        "contact_semi_major": "larger half-axis of the contact",
        "contact_semi_minor": "smaller half-axis of the contact",
    }
    if len(compared) == 1:  # beside a roller
        named["max_pressure"] = f"{spelled('max_pressure')} (plane contact, P/l)"
    rows: list[Row] = []
    for name, exact, value, unit in compared:
        off, error = f"{100 * (value / exact - 1):+.3f} %", float(history.get(f"{name}_error", math.nan))
        if math.isinf(value):
            off = "-"
        elif not math.isnan(error):
            off += f" (± {percent(error / value)} estimated)"
        rows.append((named.get(name, spelled(name)), quantity(exact, unit, 6), quantity(value, unit, 6), off))
    return rows


# --- accuracy -------------------------------------------------------------------------------------


def trial_rows(result: Result) -> list[Row]:
    """Return the quantities that decide about the accuracy of a refined result, at the last load step.

    A row has the values on three of the lattices, and the largest error of all steps over the largest value.
    """
    from ..solve.lattices import JUDGED, relative_errors

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
    for name in relative:
        values = own[f"trial_{name}"].isel(step=-1)
        values_shown = (quantity(float(values[k]), VARIABLES[name].units, 5) for k in shown)
        rows.append((spelled(name.removesuffix("_fit")), *values_shown, percent(relative[name])))
    return [*rows, ("target", "", "", "", percent(float(data.attrs["accuracy_target"])))]


# --- a file ---------------------------------------------------------------------------------------


def file_rows(result: Result) -> list[Row]:
    """Return origin, size and state of a result as rows."""
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
        ("spacing", result.lattice.cells),
        *([("surfaces", str(attributes["measured_surfaces"]))] if "measured_surfaces" in attributes else []),
        ("algorithm", algorithm(attributes)),
        *([("accuracy", _reached(attributes))] if "accuracy_reached" in attributes else []),
        ("fields", ", ".join(fields_of(result))),
    ]


def _reached(attributes: Mapping[str, Any]) -> str:
    """Return a sentence on the target of the accuracy."""
    if "accuracy_shortfall" in attributes:
        return str(attributes["accuracy_shortfall"])
    error, target = (percent(float(attributes[f"accuracy_{name}"])) for name in ("estimate", "target"))
    return f"target {target} reached: estimated error {error}"


def algorithm(attributes: Mapping[str, Any]) -> str:
    """Return the words for the algorithm and the friction law in the attributes of a result."""
    named = str(attributes.get("algorithm", "unknown"))
    if named in ("static", "incremental"):
        law = attributes.get("friction_law", f"coefficient {float(attributes['friction_coefficient']):g}")
        named += f", friction {law}"
    if named.startswith("incremental"):
        named += ", entry interpolated" * (attributes.get("entry") == "interpolated")
    return named + ", coupling goodman" * (attributes.get("coupling") == "goodman")
