"""The reference table, and comparisons with it: published, discrete, converged, analytic values.

The table is described in tests/reference/README.md.
"""

from __future__ import annotations

import csv
import functools
import math
from dataclasses import dataclass
from pathlib import Path

from . import frame
from .frame import UNITS, Row


@dataclass(frozen=True)
class Known:
    """What is known about a quantity, in SI; nan where there is no such value."""

    published: float = math.nan
    reference: float = math.nan
    uncertainty: float = math.nan
    analytic: float = math.nan


class Comparison(frame.Comparison):
    """The rows of a check, added one by one."""

    def add(
        self,
        case: str,
        quantity: str,
        unit: str,
        computed: float,
        *,
        row: Known | None = None,
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
        row : Known, optional
            What is known about it.
        analytic : float
            The analytic value, SI, instead of that of `row`.
        judge : str
            "reference" or "analytic": what the difference is taken from; by default the reference, if any.
        relative, absolute : float
            Bound on the difference, relative or in SI; without one the row is reported, not judged.
        """
        known = row or Known()
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
