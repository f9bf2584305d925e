"""Compare computed with published, analytic and converged solutions: ``hexcontact verify``.

The checks themselves are listed in `hexcontact.verify_cases`. Published and converged values come from
``data/reference.csv``, a copy of tests/reference/benchmarks.csv.
"""

from __future__ import annotations

import csv
import functools
import importlib.resources
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from .errors import DeckError

# display unit -> SI; the units of reference.csv are among them
UNITS = {
    "-": 1.0,
    "s": 1.0,
    "N": 1.0,
    "m": 1.0,
    "mm": 1e-3,
    "um": 1e-6,
    "Pa": 1.0,
    "MPa": 1e6,
    "GPa": 1e9,
    "rad": 1.0,
    "deg": math.pi / 180.0,
}


@dataclass(frozen=True)
class Reference:
    """A row of the reference table in SI; nan where the table has nothing."""

    published: float
    reference: float
    uncertainty: float
    analytic: float


@functools.cache
def _table() -> dict[tuple[str, str], dict[str, str]]:
    text = importlib.resources.files("hexcontact").joinpath("data/reference.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return {(row["case"], row["quantity"]): row for row in rows}


def reference(case: str, quantity: str) -> Reference:
    """Look up a row of the reference table.

    Parameters
    ----------
    case, quantity : str
        The first two columns.

    Returns
    -------
    Reference

    Raises
    ------
    KeyError
        If there is no such row.
    """
    row = _table()[case, quantity]
    factor = UNITS[row["unit"]]

    def number(column: str) -> float:
        try:
            return float(row[column]) * factor
        except ValueError:  # empty, or two values such as 0.511/0.533
            return math.nan

    return Reference(*(number(column) for column in ("published", "reference", "uncertainty", "analytic")))


@dataclass(frozen=True)
class Row:
    """One compared quantity, SI; nan where there is no such value, tolerance nan: reported, not judged."""

    case: str
    quantity: str
    unit: str
    computed: float
    published: float = math.nan
    reference: float = math.nan
    analytic: float = math.nan
    judge: str = "reference"
    tolerance: float = math.nan
    absolute: bool = False

    @property
    def difference(self) -> float:
        """Difference from the judge, relative unless ``absolute``; nan without a judge."""
        against = {"reference": self.reference, "analytic": self.analytic}[self.judge]
        if self.absolute:
            return self.computed - against
        return math.nan if against == 0.0 else self.computed / against - 1.0

    @property
    def passed(self) -> bool | None:
        """Whether the difference is within the tolerance; None if the row is not judged."""
        if math.isnan(self.tolerance):
            return None
        return bool(abs(self.difference) <= self.tolerance)  # a nan fails


@dataclass
class Comparison:
    """The rows of one check, and sentences that belong under its table."""

    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(
        self,
        case: str,
        quantity: str,
        unit: str,
        computed: float,
        *,
        row: Reference | None = None,
        analytic: float = math.nan,
        judge: str = "",
        relative: float = math.nan,
        absolute: float = math.nan,
    ) -> None:
        """Add a row.

        Parameters
        ----------
        case, quantity : str
            What was computed.
        unit : str
            Unit to show it in, a key of `UNITS`.
        computed : float
            The value, SI.
        row : Reference, optional
            What the reference table says about it.
        analytic : float
            The analytic value, SI, instead of that of the reference table.
        judge : str
            "reference" or "analytic": what the difference is taken from; by default the reference, if any.
        relative, absolute : float
            Bound on the difference, relative or in SI; without one the row is reported, not judged.
        """
        known = row or Reference(math.nan, math.nan, math.nan, math.nan)
        by_reference = judge == "reference" or (not judge and not math.isnan(known.reference))
        self.rows.append(
            Row(
                case,
                quantity,
                unit,
                computed,
                published=known.published,
                reference=known.reference,
                analytic=known.analytic if math.isnan(analytic) else analytic,
                judge="reference" if by_reference else "analytic",
                tolerance=relative if math.isnan(absolute) else absolute,
                absolute=not math.isnan(absolute),
            )
        )

    @property
    def passed(self) -> bool:
        """Whether no row fails."""
        return all(row.passed is not False for row in self.rows)


@dataclass(frozen=True)
class Check:
    """A named check: what it shows, and how to make its comparison."""

    name: str
    title: str
    text: str
    run: Callable[[], Comparison]


# ----------------------------------------------------------------------------------- what is printed

HEADERS = (
    "case",
    "quantity",
    "published",
    "reference",
    "analytic",
    "computed",
    "difference",
    "tolerance",
    "",
)


def _cells(row: Row) -> list[str]:
    factor = UNITS[row.unit]
    unit = "" if row.unit == "-" else row.unit.replace("um", "µm")
    known = [value for value in (row.computed, row.reference, row.analytic) if not math.isnan(value)]
    power = any(0.0 < abs(value) < 1e-3 * factor for value in known)

    def number(value: float) -> str:
        if math.isnan(value):
            return ""
        digits = ".2g" if row.unit == "s" else ".6e" if power and value else ".7g"
        return f"{value / factor:{digits}}"

    def deviation(value: float, form: str) -> str:
        if math.isnan(value):
            return ""
        return f"{value / factor:{form}} {unit}".rstrip() if row.absolute else f"{value:{form}}"

    return [
        row.case,
        row.quantity + (f" ({unit})" if unit else ""),
        *map(number, (row.published, row.reference, row.analytic, row.computed)),
        deviation(row.difference, "+.1e"),
        deviation(row.tolerance, ".0e"),
        {True: "ok", False: "FAIL", None: ""}[row.passed],
    ]


def _judge_column(row: Row) -> int:
    """Return the position of the value that judges the row among its cells; -1 if it is not judged."""
    return HEADERS.index(row.judge) if row.passed is not None else -1


def markdown(check: Check, comparison: Comparison) -> str:
    """Return a check as a Markdown section; the value that judges a row is in bold.

    Parameters
    ----------
    check : Check
        The check.
    comparison : Comparison
        What it found.
    """
    lines = [f"## {check.title}", "", check.text, "", f"`hexcontact verify {check.name}`", ""]
    lines += ["| " + " | ".join(HEADERS) + " |", "|" + "---|" * 2 + "---:|" * (len(HEADERS) - 3) + "---|"]
    for row in comparison.rows:
        cells, judge = [cell.replace("|", "\\|") for cell in _cells(row)], _judge_column(row)
        if judge >= 0:
            cells[judge] = f"**{cells[judge]}**"
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", *(f"{note}  ".replace("|", "\\|") for note in comparison.notes)]
    return "\n".join(lines).rstrip() + "\n"


_PREAMBLE = """# Validation

Made by `hexcontact verify --table > docs/validation.md`; do not edit.

*published*: as printed in the dissertation. *reference*: the exact solution of the same discrete problem, or
a converged solution, from an independent program (`tests/reference/benchmarks.csv`). *analytic*: closed
solution. The value in bold judges the row; *difference* and *tolerance* are relative to it, or have its unit.
Rows without a tolerance are reported only. Seconds are those of the machine that made this table, one run
each, preparing the case included.
"""


def _print(check: Check, comparison: Comparison) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    screen = Console(highlight=False)
    screen.width = max(screen.width, 150)  # a narrow terminal wraps lines, it does not lose digits
    shown = Table(
        title=Text(check.title, style="bold"), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
    )
    for position, header in enumerate(HEADERS):
        shown.add_column(header, justify="right" if 2 <= position < 8 else "left", no_wrap=True)
    style = {True: "green", False: "bold red", None: ""}
    before = ""
    for row in comparison.rows:
        cells, judge = _cells(row), _judge_column(row)
        first, before = cells[0] if cells[0] != before else "", cells[0]
        texts = [
            Text(cell, style="bold" if at == judge else "") for at, cell in enumerate([first, *cells[1:-1]])
        ]
        shown.add_row(*texts, Text(cells[-1], style=style[row.passed]))
    screen.print(shown)
    for note in comparison.notes:
        screen.print(note, soft_wrap=True)
    judged = [row.passed for row in comparison.rows if row.passed is not None]
    screen.print(f"{check.name}: {sum(judged)} of {len(judged)} comparisons passed\n", soft_wrap=True)


def main(names: Sequence[str] = (), *, table: bool = False, listing: bool = False) -> int:
    """Run checks and print what they find.

    Parameters
    ----------
    names : sequence of str
        Names of the checks; all of them if empty.
    table : bool
        Print Markdown, as in docs/validation.md.
    listing : bool
        Only list the checks.

    Returns
    -------
    int
        Exit code: 0 if everything passed, 1 otherwise.

    Raises
    ------
    DeckError
        If there is no check of some name.
    """
    from .verify_cases import CHECKS

    if listing:
        width = max(map(len, CHECKS))
        for check in CHECKS.values():
            print(f"{check.name:<{width}}  {check.title}")
        return 0
    chosen = _chosen(names)
    if table:
        print(_PREAMBLE)
    failed = []
    for check in chosen:
        comparison = check.run()
        if table:
            print(markdown(check, comparison))
        else:
            _print(check, comparison)
        if not comparison.passed:
            failed.append(check.name)
    if failed:
        print(f"hexcontact: verify failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _chosen(names: Sequence[str]) -> list[Check]:
    """Return the checks of these names, all if there are none."""
    from .verify_cases import CHECKS

    if unknown := [name for name in names if name not in CHECKS]:
        raise DeckError(f"verify has no check {unknown[0]!r}; expected one of {', '.join(CHECKS)}")
    return [CHECKS[name] for name in names] if names else list(CHECKS.values())


def for_programs(names: Sequence[str] = (), *, listing: bool = False) -> dict[str, Any]:
    """Run checks and return what they find, with the exit code; arguments and errors as `main`."""
    from .json_output import of_comparison

    chosen = _chosen(names)
    if listing:
        return {"checks": [{"name": check.name, "title": check.title} for check in chosen]}
    found = [of_comparison(check, check.run()) for check in chosen]
    passed = all(check["passed"] for check in found)
    return {"exit_code": int(not passed), "passed": passed, "checks": found}
