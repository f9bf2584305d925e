"""Fill the tables of keys, limits and variables in docs/ from the models and tables of the program.

Run it after a change of the deck format or of `VARIABLES`: ``python docs/deck_tables.py``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from hexcontact.deck import keys as deck_keys
from hexcontact.deck import series, surfaces
from hexcontact.deck.kinds import Flag, Kind, PowerCoefficient, Quantity, Several, Text, Whole, Word, WordOr
from hexcontact.deck.table_base import Table, expectation, kind_of
from hexcontact.problem import plausibility
from hexcontact.study.backends.dask import Dask
from hexcontact.study.plan import Parameter, StudyFile
from hexcontact.text import shown
from hexcontact.variables import ESTIMATED, VARIABLES, Variable

PAGE = Path(__file__).with_name("keys.md")
PAGES = (
    PAGE,
    PAGE.with_name("variables.md"),
    PAGE.with_name("theory") / "expected_errors.md",
)
TABLES: dict[str, type[Table]] = {
    "deck": deck_keys.Deck,
    "body": deck_keys.Body,
    "interface": deck_keys.Interface,
    "friction": deck_keys.Friction,
    "bulk": deck_keys.Bulk,
    "grid": deck_keys.Grid,
    "solver": deck_keys.Solver,
    "load": deck_keys.Load,
    "series": series.Series,
    "columns": series.Columns,
    "accuracy": deck_keys.Accuracy,
    "wear": deck_keys.Wear,
    "output": deck_keys.Output,
    "stress": deck_keys.Stress,
    "fatigue": deck_keys.Fatigue,
    "study": StudyFile,
    "parameter": Parameter,
    "dask": Dask,
}
BLOCK = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


HEADER = ("key", "expected", "unit", "default", "example", "meaning")


def row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def default_of(info: Any) -> str:
    if info.is_required():
        return "required"
    if info.default in (None, "", (), {}) or info.default_factory is not None:
        return ""
    return f"`{shown(info.default)}`" if info.default != 0.0 or info.default is False else "0"


def innermost(kind: Kind | None) -> Kind | None:
    while (inner := getattr(kind, "kind", None)) is not None:
        kind = inner
    return kind


def unit_of(info: Any) -> str:
    """The unit of a bare number."""
    kind = innermost(kind_of(info))
    if isinstance(kind, PowerCoefficient):
        return kind.unit
    if not isinstance(kind, Quantity):
        return ""
    return (kind.dimension.unit or "1") if kind.dimension.bare else "must be given"


def example_of(info: Any) -> str:
    """A value as a deck writes it."""
    if info.examples:
        return str(info.examples[0])
    kind = kind_of(info)
    if isinstance(kind, WordOr):
        kind = kind.kind
    if isinstance(kind, Several):
        return kind.example
    if isinstance(kind, Quantity):
        return kind.dimension.example
    if isinstance(kind, Word):
        return f'"{kind.words[-1]}"'
    if isinstance(kind, Whole):
        return "10"
    if isinstance(kind, Flag):
        return "true"
    if isinstance(kind, Text):
        return '"Q [N]"'
    assert kind is not None, "an example is missing"
    return kind.expected.partition("such as ")[2]


def cells_of(key: str, info: Any) -> list[str]:
    expected = re.split(r",? such as ", expectation(info))[0]
    return [f"`{key}`", expected, unit_of(info), default_of(info), f"`{example_of(info)}`", info.description]


def documented(table: type[Table]) -> dict[str, Any]:
    """The keys of a table that are no tables of their own, which have their own chapters."""
    return {key: info for key, info in table.known_keys().items() if info.description}


def keys_of(table: type[Table]) -> str:
    lines = [row(HEADER), "|" + "---|" * len(HEADER)]
    lines += [row(cells_of(key, info)) for key, info in documented(table).items()]
    return "\n".join(lines) + "\n"


def shapes() -> str:
    lines = [row(("shape", "height", *HEADER)), "|" + "---|" * (len(HEADER) + 2)]
    for name, shape in surfaces.SHAPES.items():
        first = [f"`{name}`", shape.formula]
        for key, info in documented(shape).items():
            if key != "offset":
                lines.append(row([*first, *cells_of(key, info)]))
                first = ["", ""]
        if first[0]:
            lines.append(row([*first, *[""] * len(HEADER)]))
    lines.append(row(["all", "", *cells_of("offset", surfaces.Flat.model_fields["offset"])]))
    return "\n".join(lines) + "\n"


def limits() -> str:
    lines = [row(("expected", "limit", "reason")), "|---|---|---|"]
    for limit in plausibility.LIMITS:
        bound = f"at most {limit.most:g}" if limit.most < math.inf else f"at least {limit.least:g}"
        lines.append(row((f"`{limit.quantity}`", bound, limit.reason)))
    return "\n".join(lines) + "\n"


def variables(belongs: Callable[[str, Variable], bool]) -> str:
    lines = [row(("name", "unit", "meaning")), "|---|---|---|"]
    for name, variable in VARIABLES.items():
        if belongs(name, variable) and name not in OF_EACH:
            lines.append(row((f"`{name}`", variable.units or "–", variable.long_name)))
    return "\n".join(lines) + "\n"


COORDINATES = ("step", "row", "col", "x", "y")
OF_EACH = {word.format(name) for name in ESTIMATED for word in ("{}_error", "trial_{}")}
OTHERS: dict[str, Callable[[], str]] = {
    "shapes": shapes,
    "limits": limits,
    "coordinates": lambda: variables(lambda name, _: name in COORDINATES),
    "fields": lambda: variables(lambda name, v: len(v.dims) > 1 and name not in COORDINATES),
    "history": lambda: variables(lambda name, v: v.dims == ("step",) and name not in COORDINATES),
    "trials": lambda: variables(lambda _, v: v.dims == ("trial",)),
}


def filled(text: str) -> str:
    """Return the page with its tables as the models have them now."""

    def fill(block: re.Match[str]) -> str:
        other = OTHERS.get(block[2])
        return block[1] + (other() if other else keys_of(TABLES[block[2]])) + block[3]

    return BLOCK.sub(fill, text)


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")
