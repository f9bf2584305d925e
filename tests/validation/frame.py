"""Checks against known solutions: rows that are judged, tables in a terminal, the runner."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from rich import box
from rich.table import Table
from rich.text import Text

from hexcontact.cli.printed import console
from hexcontact.errors import DeckError

UNITS = dict.fromkeys(("-", "s", "N", "m", "Pa", "rad", "nodes"), 1.0)
UNITS |= {"mm": 1e-3, "um": 1e-6, "MPa": 1e6, "GPa": 1e9, "deg": math.pi / 180.0}
"""SI values of the units of tables."""


@dataclass(frozen=True)
class Row:
    """A compared quantity in SI; absent values are NaN; without a tolerance it is reported, not judged."""

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
        """Difference from the value of the judge, relative unless ``absolute``; NaN without one."""
        against = {"reference": self.reference, "analytic": self.analytic}[self.judge]
        if self.absolute:
            return self.computed - against
        return math.nan if against == 0.0 else self.computed / against - 1.0

    @property
    def passed(self) -> bool | None:
        """Whether the difference is within the tolerance; None if the row is not judged."""
        if math.isnan(self.tolerance):
            return None
        return bool(abs(self.difference) <= self.tolerance)  # NaN fails


@dataclass
class Comparison:
    """The rows of a check, and sentences below its table."""

    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether no row fails."""
        return all(row.passed is not False for row in self.rows)


@dataclass(frozen=True)
class Check:
    """A named check, with title, text and the function that makes its comparison."""

    name: str
    title: str
    text: str
    run: Callable[[], Comparison]


# --- tables ---------------------------------------------------------------------------------------

_VALUES = ("published", "reference", "analytic", "computed")
HEADERS = ("case", "quantity", *_VALUES, "difference", "tolerance", "")


def cells_of(row: Row) -> list[str]:
    """Return the cells of a row in the order of `HEADERS`."""
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

    more = 0  # digits without which a row that passes looks as if it failed
    while (
        row.passed
        and more < 2
        and abs(float(f"{row.difference:.{1 + more}e}")) > float(f"{row.tolerance:.{more}e}")
    ):
        more += 1
    forms = ("+.0f", ".0f") if unit == "nodes" else (f"+.{1 + more}e", f".{more}e")
    return [
        row.case,
        row.quantity + (f" ({unit})" if unit else ""),
        *(number(getattr(row, name)) for name in _VALUES),
        deviation(row.difference, forms[0]),
        deviation(row.tolerance, forms[1]),
        {True: "ok", False: "FAIL", None: ""}[row.passed],
    ]


def judge_column(row: Row) -> int:
    """Return the column of the value that judges a row; -1 if it is not judged."""
    return HEADERS.index(row.judge) if row.passed is not None else -1


def show(check: Check, comparison: Comparison) -> None:
    """Print a check as a table for terminals."""
    screen = console()
    screen.width = max(screen.width, 150)  # a narrow terminal wraps lines, it does not lose digits
    shown = Table(
        title=Text(check.title, style="bold"), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
    )
    for position, header in enumerate(HEADERS):
        shown.add_column(header, justify="right" if 2 <= position < 8 else "left", no_wrap=True)
    style = {True: "green", False: "bold red", None: ""}
    before = ""
    for row in comparison.rows:
        cells, judge = cells_of(row), judge_column(row)
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


def main(
    names: Sequence[str] = (),
    *,
    checks: Mapping[str, Check],
    output: Callable[[Check, Comparison], None] = show,
    listing: bool = False,
) -> int:
    """Run checks, all if none is named, and print their comparisons; return 1 if one fails, else 0."""
    chosen = _chosen(names, checks)
    if listing:
        width = max(len(check.name) for check in chosen)
        for check in chosen:
            print(f"{check.name:<{width}}  {check.title}")
        return 0
    failed = []
    for check in chosen:
        comparison = check.run()
        output(check, comparison)
        if not comparison.passed:
            failed.append(check.name)
    if failed:
        print(f"hexcontact: verify failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _chosen(names: Sequence[str], known: Mapping[str, Check]) -> list[Check]:
    """Return the checks of some names, all checks without names."""
    if unknown := [name for name in names if name not in known]:
        raise DeckError(f"verify has no check {unknown[0]!r}; expected one of {', '.join(known)}")
    return [known[name] for name in names] if names else list(known.values())
