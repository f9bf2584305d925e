"""The command that tests an installation: ``hexcontact verify`` compares quick contacts with known solutions.

Decks, quantities, references, tolerances and sources are in ``data/self_test.toml``; the long comparisons
with published, analytic and converged solutions are in tests/validation of the repository.
"""

from __future__ import annotations

import functools
import importlib.resources
import math
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import DeckError, PlausibilityWarning
from ..text import Table, counted, quantity
from ..variables import VARIABLES
from .frame import Content, argument, command, option, print_error

Check = Mapping[str, Any]
"""An entry of the self-test: name, title, note, deck, values."""

_WIDE = 150  # a narrow terminal wraps lines, it does not lose digits


@command(
    "hexcontact verify",
    names=argument("[NAME]...", "Which comparisons; default: all."),
    listing=option("--list", "List the comparisons."),
)
def verify(names: list[str] | None = None, listing: bool = False, as_json: bool = False) -> Content:
    """Test the installation: solve a few contacts and compare them with known solutions.

    Exit code 1 if a comparison fails.
    """
    known = self_test()
    if unknown := [name for name in names or [] if name not in known]:
        raise DeckError(f"verify has no check {unknown[0]!r}; expected one of {', '.join(known)}")
    chosen = [known[name] for name in names or known]
    if listing:
        width = max(len(check["name"]) for check in chosen)
        if not as_json:
            print("\n".join(f"{check['name']:<{width}}  {check['title']}" for check in chosen))
        return {"checks": [{"name": check["name"], "title": check["title"]} for check in chosen]}
    found = []
    for check in chosen:
        rows = compared(check)
        if not as_json:
            _print(check, rows)
        passed = all(row["passed"] for row in rows)
        about = {"name": check["name"], "title": check["title"], "passed": passed}
        found.append({**about, "rows": rows, "notes": [check["note"]]})
    failed = [entry["name"] for entry in found if not entry["passed"]]
    if failed and not as_json:
        print_error(f"verify failed: {', '.join(failed)}")
    return {"exit_code": int(bool(failed)), "passed": not failed, "checks": found}


@functools.cache
def self_test() -> dict[str, Check]:
    """Return the checks of an installation by name, from data/self_test.toml."""
    text = importlib.resources.files("hexcontact").joinpath("data/self_test.toml").read_text(encoding="utf-8")
    return {check["name"]: check for check in tomllib.loads(text)["check"]}


def compared(check: Check) -> list[dict[str, Any]]:
    """Run the deck of a check and compare the history of its result with the known values, in SI."""
    from ..case import Case

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)  # of numbers without units
        history = Case.from_text(check["deck"]).run().dataset
    rows = []
    for value in check["values"]:
        step, name, over = history.isel(step=value["step"] - 1), value["quantity"], value.get("over")
        computed = float(step[name]) / (float(step[over]) if over else 1.0)
        difference = computed / value["value"] - 1.0
        rows.append(
            {
                "case": f"step {value['step']}",
                "quantity": f"{name}/{over}" if over else name,
                "computed": computed,
                **dict.fromkeys(("published", "reference", "analytic"), math.nan),
                value["source"]: value["value"],
                "judge": value["source"],
                "difference": difference,
                "tolerance": value["relative"],
                "absolute": False,
                "passed": abs(difference) <= value["relative"],  # NaN fails
            }
        )
    return rows


def _print(check: Check, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print a check as a table."""
    from .printed import console

    def number(row: Mapping[str, Any], of: str) -> str:
        units = VARIABLES[row["quantity"]].units if row["quantity"] in VARIABLES else ""
        return quantity(row[of], units, 7)

    headers = ("", "", "", "known", "computed", "difference", "tolerance", "")
    cells = [
        (
            *(row["case"], row["quantity"], row["judge"]),
            *(number(row, row["judge"]), number(row, "computed")),
            *(f"{row['difference']:+.1e}", f"{row['tolerance']:.1e}"),
            "ok" if row["passed"] else "FAIL",
        )
        for row in rows
    ]
    screen = console()
    screen.width = max(screen.width, _WIDE)
    screen.print(Table(headers, cells, check["title"]))
    screen.print(check["note"], soft_wrap=True)
    passed = sum(row["passed"] for row in rows)
    screen.print(f"{check['name']}: {passed} of {counted(len(rows), 'comparison')} passed\n", soft_wrap=True)
