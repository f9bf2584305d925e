"""A page that shows a result: one HTML file that needs nothing else, neither a network nor this program.

Its tables are made here, what it draws in `hexcontact.plotting.report_data`; how it looks and moves is in
data/report.html, which draws from numbers and small pictures in the file itself.
"""

from __future__ import annotations

import datetime
import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2

from .._version import __version__
from ..errors import DeckError
from ..files import replacing
from ..plotting.report_data import drawn_data, kept_steps
from ..problem.overview import case_rows
from ..result.history import RESIDUALS, load_or_motion, worth_showing
from ..text import quantity, visible
from ..variables import label_of
from . import tables

if TYPE_CHECKING:
    from ..problem.problem import Problem
    from ..result.result import Result

History = Mapping[str, Any]
Table = tuple[Sequence[str], Sequence[Sequence[str]]]  # headers and rows

_DATA = resources.files("hexcontact").joinpath("data")


def write_report(result: Result, target: Path) -> Path:
    """Write the page of a result.

    Parameters
    ----------
    result : Result
        The result, of a finished run or not.
    target : Path
        File to write, ``.html``; replaced as a whole if it is there.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    DeckError
        If the name is not that of a page.
    """
    if target.suffix.lower() not in (".html", ".htm"):
        raise DeckError(f"--output {target}: expected a page, such as {target.with_suffix('.html')}")
    with replacing(target) as temporary:
        temporary.write_text(report(result), encoding="utf-8")
    return target


def report(result: Result) -> str:
    """Return the page of a result as text.

    Parameters
    ----------
    result : Result
        The result, of a finished run or not.
    """
    summary = tables.Summary.of_result(result)
    histories = summary.steps()
    numbers = kept_steps(result)
    data = drawn_data(result, histories, numbers)
    title = result.case_title or Path(result.path).stem or "hexcontact result"
    environment = jinja2.Environment(
        # PackageLoader does not find the folder of an editable installation
        loader=jinja2.FunctionLoader(lambda name: _DATA.joinpath(name).read_text(encoding="utf-8")),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=lambda value: visible(value) if type(value) is str else value,  # not of macros
        trim_blocks=True,
    )
    return environment.get_template("report.html").render(
        title=title,
        notes=[_unfinished(result), *summary.remarks],
        kept=_kept(len(numbers), len(histories)),
        inputs=_inputs(result, summary.case),
        loads=_loads(histories),
        deck=result.deck,
        hertz=(tables.HERTZ_HEADERS, tables.hertz_rows(summary.hertz, histories[-1])),
        accuracy=(tables.TRIAL_HEADERS, tables.trial_rows(result)),
        residuals=_residuals(histories),
        provenance=_provenance(result, histories),
        data=json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    )


# --- words ----------------------------------------------------------------------------------------


def _unfinished(result: Result) -> str:
    if result.shortfall or result.complete:
        return result.shortfall
    planned = int(result.dataset.attrs.get("planned_steps", 0))
    reason = str(result.dataset.attrs.get("stopped", ""))
    of = f" of {planned}" if planned else ""
    return f"Unfinished run: {len(result)}{of} load steps. {reason}".strip()


def _kept(shown: int, steps: int) -> str:
    if shown == steps:
        return ""
    if shown == 0:
        return "The fields of this run were not kept (output.fields), so that there are no maps."
    return (
        f"Maps of {shown} of {steps} load steps: those kept in the result, evenly chosen if there are many."
    )


def _inputs(result: Result, case: Problem | None) -> list[tuple[str, ...]]:
    attributes, sizes = result.dataset.attrs, result.dataset.sizes
    left_out = {"window", "memory", "load steps"}
    rows: list[tuple[str, ...]] = []
    if case is not None and case.accuracy:
        left_out |= {"spacing", "accuracy", "work"}  # those of the first lattice, and guesses
        rows = [("spacing", quantity(float(attributes["lattice_spacing"]), "m"))]
    if case is not None:
        rows = [row for row in case_rows(case) if row[0] not in left_out] + rows
    elif "effective_modulus" in attributes:
        rows = [
            (
                "pair",
                f"E* = {quantity(float(attributes['effective_modulus']), 'Pa')}, "
                f"beta = {float(attributes['dundurs_beta']):.4g}, "
                f"gamma = {float(attributes['tangential_compliance_ratio']):.4g}",
            ),
            ("algorithm", tables.algorithm(attributes)),
            ("spacing", quantity(float(attributes["lattice_spacing"]), "m")),
        ]
    window = f"{sizes['row']} x {sizes['col']} nodes at the end"
    planned = int(attributes["planned_steps"])
    return [
        *rows,
        ("window", window),
        ("load steps", f"{len(result)}" + (f" of {planned}" if planned else "")),
    ]


def _provenance(result: Result, histories: Sequence[History]) -> list[tuple[str, ...]]:
    attributes, deck = result.dataset.attrs, result.deck
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    return [
        ("file", result.path or "not written"),
        ("computed by", str(attributes["source"])),
        ("machine", str(attributes.get("machine", "not recorded"))),
        ("run started", str(attributes["created"])),
        ("time in the solver", quantity(sum(float(h["seconds"]) for h in histories), "s", 3)),
        ("run", str(attributes["run"])),
        ("deck, SHA-256", hashlib.sha256(deck.encode()).hexdigest() if deck else "made in Python, no deck"),
        ("layout of the file", str(attributes["schema_version"])),
        ("page written by", f"hexcontact {__version__}, {now}"),
    ]


def _loads(histories: Sequence[History]) -> Table:
    """Return the load history: where each segment ends."""
    ends = {int(history.get("segment", 1)): history for history in histories}
    names = worth_showing(histories)
    rows, before = [], 0
    for segment, history in ends.items():
        steps = f"{before + 1} to {history['step']}" if history["step"] > before + 1 else str(history["step"])
        rows.append(
            (str(segment), str(history.get("label", "")), steps, *(load_or_motion(n, history) for n in names))
        )
        before = history["step"]
    symbols = [label_of(name) for name in names]
    return ("segment", "label", "steps", *symbols), rows


def _residuals(histories: Sequence[History]) -> Table:
    signs = [sign for sign, name in RESIDUALS.items() if name in histories[0]]
    rows = [
        (
            str(h["step"]),
            str(h.get("label", "")),
            *(f"{float(h[RESIDUALS[sign]]):.1e}" for sign in signs),
            str(h["sweeps"]),
            str(h.get("cuts", 0)),
            f"{float(h['operator_applications']):.3g}",
            quantity(float(h["seconds"]), "s", 3),
        )
        for h in histories
    ]
    headers = ("step", "label", *signs, "iterations", "halved", "operator applications", "time")
    return headers, rows
