"""Write the rows of checks into docs/validation.csv, and the worst row of each into docs/validation.md."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path

from validation.frame import HEADERS, Check, Comparison, Row, cells_of

PAGE = Path(__file__).parents[2] / "docs/validation.md"
COLUMNS = ("check", *HEADERS[:-1], "against", "result")

PREAMBLE = """# Validation

Made by `make verify`; do not edit.

`make verify` compares {judged:,} numbers with independent values; {ok:,} are within their tolerances.
The table has the row of each check that is closest to its tolerance, [validation.csv](validation.csv) has all
rows. `make verify CHECKS=fretting` prints the rows of one check and updates both files.

| source | meaning |
|---|---|
| published | printed in the dissertation ([row by row](dissertation.md)); reported only |
| reference | exact discrete solution, or a converged solution, of an independent program |
| analytic | closed-form solution |

Deviation and tolerance are relative, or have a unit.

|check|subject|worst row|source|deviation|allowed|
|---|---|---|---|---:|---:|
"""


def cells(check: Check, row: Row) -> dict[str, str]:
    """Return a row of the file: the cells that a terminal shows, and the source that judges the row."""
    *shown, result = cells_of(row)
    source = row.judge if row.passed is not None else ""
    return dict(zip(COLUMNS, [check.name, *shown, source, result], strict=True))


def read(file: Path) -> dict[str, list[dict[str, str]]]:
    """Return the rows of a file by check."""
    rows: dict[str, list[dict[str, str]]] = {}
    if file.exists():
        with file.open(newline="", encoding="utf-8") as stream:
            for row in csv.DictReader(stream):
                rows.setdefault(row["check"], []).append(row)
    return rows


def share(row: Mapping[str, str]) -> float:
    """Return the deviation of a judged row over its tolerance."""
    deviation, allowed = (abs(float((row[key] or "nan").split()[0])) for key in ("difference", "tolerance"))
    if math.isnan(deviation):
        return math.inf
    return deviation / allowed if allowed else math.inf * deviation if deviation else 0.0


def line(check: Check, rows: list[dict[str, str]]) -> str:
    """Return the line of the page for a check."""
    worst = max((row for row in rows if row["against"]), key=share)
    about = ", ".join(part for part in (worst["case"], worst["quantity"]) if part)
    subject = check.title.partition(" (")[0]
    shown = (f"`{check.name}`", subject, about, worst["against"], worst["difference"], worst["tolerance"])
    return "|" + "|".join(cell.replace("|", "\\|") for cell in shown) + "|\n"


def write(check: Check, comparison: Comparison, checks: Mapping[str, Check], page: Path = PAGE) -> None:
    """Replace the rows of a check in the file beside the page, and the page; times are not kept."""
    file = page.with_suffix(".csv")
    known = read(file) | {check.name: [cells(check, row) for row in comparison.rows if row.unit != "s"]}
    found = {name: known[name] for name in checks if name in known}
    rows = [row for each in found.values() for row in each]
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    results = [row["result"] for row in rows if row["against"]]
    text = PREAMBLE.format(judged=len(results), ok=results.count("ok"))
    page.write_text(
        text + "".join(line(checks[name], each) for name, each in found.items()), encoding="utf-8"
    )
