"""The report of a result: one HTML page that needs neither a network nor this program.

This module makes its tables, `hexcontact.plotting.report_data` the data of its charts and maps; layout and
scripts are in the template data/report.html.
"""

from __future__ import annotations

import base64
import contextlib
import datetime
import hashlib
import io
import json
import re
from collections.abc import Iterator, Sequence
from importlib import resources
from itertools import groupby
from pathlib import Path

import jinja2
import numpy as np

from .._version import __version__
from ..deck.below import Fatigue, Stress
from ..deck.read import recorded
from ..errors import DeckError, HexcontactError, NotInResult
from ..files import MADE_BY, replacing, require_replaceable
from ..interior.files import readable_table, tables_of
from ..interior.stress import place_of
from ..plotting.report_data import drawn_data, mapped_steps
from ..problem.preview import case_rows
from ..problem.problem import Problem
from ..result.history_words import load_or_motion, worth_showing
from ..result.result import Result
from ..text import counted, quantity, visible
from ..variables import RESIDUALS, label_of
from . import printed

_MOST_PARTS = 200  # segments, and cycles, in the table of energies
_LINES = 12  # of a long array of numbers in a deck
_DATA = resources.files("hexcontact").joinpath("data")


def write_report(result: Result, target: Path) -> Path:
    """Write the page of a result, finished or not, in place of an earlier page."""
    if target.suffix.lower() not in (".html", ".htm"):
        raise DeckError(f"--output {target}: expected a page, such as {target.with_suffix('.html')}")
    require_replaceable(target)
    with replacing(target) as temporary:
        temporary.write_text(report(result), encoding="utf-8")
    return target


def report(result: Result) -> str:
    """Return the page of a result, finished or not, as HTML."""
    summary = printed.Summary.of_result(result)
    histories, tables = summary.steps(), summary.tables(_MOST_PARTS)
    numbers = mapped_steps(result)
    data = drawn_data(result, histories, numbers)
    title = result.case_title or Path(result.path).stem or "hexcontact result"
    environment = jinja2.Environment(
        # PackageLoader does not find the folder of an editable installation.
        loader=jinja2.FunctionLoader(lambda name: _DATA.joinpath(name).read_text(encoding="utf-8")),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=lambda value: visible(value) if type(value) is str else value,  # not of macros
        trim_blocks=True,
    )
    return environment.get_template("report.html").render(
        title=title,
        made_by=MADE_BY,
        notes=[_unfinished(result), *summary.remarks],
        kept=_kept(len(numbers), len(histories)),
        inputs=_inputs(result, _problem_of(result.deck)),
        loads=_loads(histories),
        energies=tables["Dissipated energy"],
        below=_below(result),
        pictures=list(_pictures(result)) if numbers else [],
        deck=_shortened(result.deck),
        hertz=tables["Against Hertz"],
        accuracy=tables["Accuracy"],
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
    return f"Unfinished run: {counted(f'{len(result)}{of}', 'load step')}. {reason}".strip()


def _shortened(deck: str) -> str:
    """Return a deck with the first lines of long arrays of numbers only."""
    kept: list[str] = []
    for of_numbers, lines in groupby(deck.splitlines(), lambda line: not re.search('["=]', line)):
        run = list(lines)
        if of_numbers and (left_out := len(run) - _LINES) > _LINES:
            run[_LINES:] = [f"    ... ({left_out:,} lines more, in the result)"]
        kept += run
    return "\n".join(kept)


def _kept(shown: int, steps: int) -> str:
    if shown == steps:
        return ""
    if shown == 0:
        return "The fields of this run were not kept (output.fields), so that there are no maps."
    return f"Maps of {shown} of {steps} load steps: those in the result, evenly chosen if there are many."


def _problem_of(deck: str) -> Problem | None:
    """Return the problem of a result; None with parts from Python, or if its deck is not understood."""
    with contextlib.suppress(HexcontactError):
        if deck and not recorded(deck).given:
            return Problem.from_text(deck, "deck of the result")
    return None


def _inputs(result: Result, case: Problem | None) -> list[tuple[str, ...]]:
    attributes, sizes = result.dataset.attrs, result.dataset.sizes
    left_out = {"window", "memory", "load steps"}
    spacing = "spacing", quantity(float(attributes["lattice_spacing"]), "m")
    rows: list[tuple[str, ...]] = []
    if case is not None:
        refined = (
            {"spacing", "accuracy", "work"} if case.accuracy else set()
        )  # of the first lattice, estimates
        rows = [row for row in case_rows(case) if row[0] not in left_out | refined]
        rows += [spacing] if refined else []
    elif "effective_modulus" in attributes:
        modulus = quantity(float(attributes["effective_modulus"]), "Pa")
        beta, gamma = (float(attributes[n]) for n in ("dundurs_beta", "tangential_compliance_ratio"))
        pair = f"E* = {modulus}, beta = {beta:.4g}, gamma = {gamma:.4g}"
        rows = [("pair", pair), ("algorithm", printed.algorithm(attributes)), spacing]
    planned = int(attributes["planned_steps"])
    steps = f"{len(result)}" + (f" of {planned}" if planned else "")
    return [*rows, ("window", f"{sizes['row']} x {sizes['col']} nodes at the end"), ("load steps", steps)]


def _provenance(result: Result, histories: Sequence[printed.History]) -> list[tuple[str, ...]]:
    attributes, deck = result.dataset.attrs, result.deck
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    return [
        ("file", result.path or "not written"),
        ("computed by", str(attributes["source"])),
        ("machine", str(attributes.get("machine", "not recorded"))),
        ("run started", str(attributes["created"])),
        ("time in the solver", quantity(sum(float(h["seconds"]) for h in histories), "s", 3)),
        ("run", str(attributes["run"])),
        ("measured surfaces", str(attributes.get("measured_surfaces", "none"))),
        ("deck, SHA-256", hashlib.sha256(deck.encode()).hexdigest() if deck else "made in Python, no deck"),
        ("layout of the file", str(attributes["schema_version"])),
        ("page written by", f"hexcontact {__version__}, {now}"),
    ]


def _loads(histories: Sequence[printed.History]) -> printed.Table:
    """Return the loads at the end of each segment as a table."""
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


def _below(result: Result) -> printed.Table:
    """Return the tables [[stress]] and [[fatigue]] of the deck, with their files, as a table."""
    rows = []
    for name, table in tables_of(result.deck).items():
        chosen = table.parameters if isinstance(table, Fatigue) else table.components
        labels = table.segment if isinstance(table, Fatigue) else None
        steps = labels or ("last",) if table.steps is None else np.atleast_1d(table.steps)
        output = Path(result.path or "output")
        file = output.with_name(f"{output.stem}_{name}.nc")
        found = readable_table(file)
        fields = {} if found is None else found.data_vars
        places = [f"{key}: {place}" for key, field in fields.items() if (place := place_of(field))]
        shown = ", ".join(chosen) or "stress", str(table.body), ", ".join(map(str, steps))
        rows.append((file.name, *shown, "; ".join(places)))
    return ("file", "quantities", "body", "load steps", "largest values"), rows


def _pictures(result: Result) -> Iterator[tuple[str, str]]:
    """Yield title and data (PNG, base64) of a picture of each kind of table of `_below`."""
    from ..plotting.below import fatigue, stress

    kinds = {type(table) for table in tables_of(result.deck).values()}
    for kind, draw, title in (
        (Stress, stress, "Stress of von Mises below the contact"),
        (Fatigue, fatigue, "Fatigue parameter"),
    ):
        if kind in kinds:
            try:
                canvas, data = draw(result), io.BytesIO()
            except NotInResult:  # fields that were not kept, tables of points alone
                continue
            canvas.savefig(data, format="png", dpi=160)
            yield title, base64.b64encode(data.getvalue()).decode()


def _residuals(histories: Sequence[printed.History]) -> printed.Table:
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
