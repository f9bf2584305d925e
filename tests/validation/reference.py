"""The reference table: published, discrete, converged and analytic values; tests/reference/README.md."""

from __future__ import annotations

import csv
import functools
import math
from pathlib import Path

from hexcontact.cli.verify import UNITS, Known

TABLE = Path(__file__).parents[1] / "reference/benchmarks.csv"


@functools.cache
def _table() -> dict[tuple[str, str], dict[str, str]]:
    with TABLE.open(newline="", encoding="utf-8") as stream:
        return {(row["case"], row["quantity"]): row for row in csv.DictReader(stream)}


def reference(case: str, quantity: str) -> Known:
    """Look up a row of the reference table.

    Parameters
    ----------
    case, quantity : str
        The first two columns.

    Returns
    -------
    Known

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

    return Known(*(number(column) for column in ("published", "reference", "uncertainty", "analytic")))
