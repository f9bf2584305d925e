"""Write the pages of keys and variables in docs/, and the table of limits, from the models and tables.

Run it after a change of the deck format or of `VARIABLES`: ``python docs/deck_tables.py``.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from hexcontact.deck import keys as deck_keys
from hexcontact.deck import series, surfaces
from hexcontact.deck.kinds import Flag, Kind, PowerCoefficient, Quantity, Several, Text, Whole, Word, WordOr
from hexcontact.deck.table_base import Table, expectation, kind_of, parts_of
from hexcontact.problem import plausibility
from hexcontact.study import backend
from hexcontact.study.plan import CreepAxes, Parameter, StudyFile
from hexcontact.text import shown
from hexcontact.variables import ESTIMATED, VARIABLES, Variable

DOCS = Path(__file__).parent
_OF_ALL = "offset", "tilt", "moves"  # keys of every shape
TABLES: dict[str, type[Table]] = {  # by their headings in keys.md
    "Top level": deck_keys.Deck,
    "[body.1] and [body.2]": deck_keys.Body,
    "[[body.1.coating]] and [[body.2.coating]]": deck_keys.Coating,
    "[interface]": deck_keys.Interface,
    "[friction]": deck_keys.Friction,
    "[bulk]": deck_keys.Bulk,
    "[grid]": deck_keys.Grid,
    "[solver]": deck_keys.Solver,
    "[accuracy]": deck_keys.Accuracy,
    "[[load]]": deck_keys.Load,
    "Series": series.Series,
    "Columns of a series": series.Columns,
    "[wear]": deck_keys.Wear,
    "[output]": deck_keys.Output,
    "[[stress]]": deck_keys.Stress,
    "[[fatigue]]": deck_keys.Fatigue,
    "Study files": StudyFile,
    "[[parameter]] of a study": Parameter,
    "[creep_table] of a study": CreepAxes,
    **{
        f"[{word}] of a study": part
        for word, (annotation, _) in backend.KEYS.items()
        for part in parts_of(annotation)
        if issubclass(part, Table)
    },
}


HEADER = ("key", "expected", "unit", "default", "example", "meaning")


def row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def default_of(info: Any) -> str:
    if info.is_required():
        return "required"
    if info.default in (None, "", (), {}) or info.default_factory is not None:
        return ""
    kind = kind_of(info)
    default = kind.written(info.default) if isinstance(kind, Quantity) else info.default
    return f"`{shown(default)}`" if info.default != 0.0 or info.default is False else "0"


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
            if key not in _OF_ALL:
                lines.append(row([*first, *cells_of(key, info)]))
                first = ["", ""]
        if first[0]:
            lines.append(row([*first, *[""] * len(HEADER)]))
    lines += [row(["all", "", *cells_of(key, surfaces.Flat.model_fields[key])]) for key in _OF_ALL]
    return "\n".join(lines) + "\n"


def limits() -> str:
    """The limits that `check` and `run` warn of, as CSV."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("expected", "limit", "reason"))
    for limit in plausibility.LIMITS:
        bound = f"at most {limit.most:g}" if limit.most < math.inf else f"at least {limit.least:g}"
        table.writerow((f"`{limit.quantity}`", bound, limit.reason))
    return text.getvalue()


def variables(belongs: Callable[[str, Variable], bool]) -> str:
    lines = [row(("name", "unit", "meaning")), "|---|---|---|"]
    for name, variable in VARIABLES.items():
        if belongs(name, variable) and name not in OF_EACH:
            lines.append(row((f"`{name}`", variable.units or "–", variable.long_name)))
    return "\n".join(lines) + "\n"


COORDINATES = ("step", "row", "col", "x", "y")
OF_EACH = {word.format(name) for name in ESTIMATED for word in ("{}_error", "trial_{}")}
VARIABLES_OF: dict[str, Callable[[str, Variable], bool]] = {  # by the headings of variables.md
    "Coordinates": lambda name, _: name in COORDINATES,
    "Fields": lambda name, v: len(v.dims) > 1 and name not in COORDINATES,
    "History": lambda name, v: v.dims == ("step",) and name not in COORDINATES,
    "Lattices of estimated errors": lambda _, v: v.dims == ("trial",),
}


def page(title: str, words: str, tables: dict[str, str]) -> str:
    parts = [f"# {title}", f"Made by `python docs/deck_tables.py`; do not edit. {words}"]
    parts += [f"## {heading}\n\n{table.rstrip()}" for heading, table in tables.items()]
    return "\n\n".join(parts) + "\n"


def keys_page() -> str:
    tables = {}
    for heading, table in TABLES.items():
        tables[heading] = keys_of(table)
        if table is deck_keys.Body:
            tables["Surfaces"] = shapes()
    words = "[The deck](deck.md) and [studies](studies.md) explain their rules."
    return page("Keys of decks and studies", words, tables)


def variables_page() -> str:
    tables = {heading: variables(belongs) for heading, belongs in VARIABLES_OF.items()}
    return page("Variables of a result", "[The result file](netcdf.md) explains them.", tables)


PAGES = {"keys.md": keys_page, "variables.md": variables_page, "theory/limits.csv": limits}

if __name__ == "__main__":
    for name, written in PAGES.items():
        (DOCS / name).write_text(written(), encoding="utf-8")
