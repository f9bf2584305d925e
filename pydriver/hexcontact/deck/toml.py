"""TOML texts of decks: read as dictionaries, changed by single keys, written."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DeckError, Fault
from ..files import text_of
from .keys import Deck
from .table_base import Table
from .units import DIGITS

_LONGEST_NUMBER = 9  # digits of an entry
DEEPEST = 50  # levels of tables and arrays; no key needs more than six

# Text in quotes or a comment; a number with a comma; brackets; a number with a unit without quotes.
_QUOTED = r"""\"[^\"]*\"|'[^']*'|\#.*"""
_COMMA = r"=\s*([+-]?\d+),(\d+)\s*$"
_BRACKET = r"(?<!\w)(\w+)\[\d*\]"
_ARRAYS = ("load", "stress", "fatigue", "parameter")  # tables of which a file may have several
_TWICE = r"Cannot declare \('(\w+)',\) twice"
_AGAIN = "Cannot overwrite a value"
_WITH_UNIT = rf"(?<![\w.])[+-]?{DIGITS}\s*(?:[^\W\d_]+[\w/^*·]*|[%°])"


def read_toml(path: str | Path, kind: str = "a deck") -> tuple[dict[str, Any], str]:
    """Return the tables of a deck file without checking them."""
    text = text_of(path, f"{kind} (a TOML file)")
    return parse_toml(text, str(path)), text


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Return the tables of a TOML text; `name` is its name in messages."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        message = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        place = re.search(r" \(at line (\d+), column (\d+)\)$", message)
        if place is None:
            raise DeckError(f"{name}: is not TOML: {message}") from None
        line = text.split("\n")[int(place[1]) - 1]
        unquoted = re.sub(_QUOTED, "", line)
        hint = ""
        if bare := re.search(_WITH_UNIT, unquoted):
            hint = f'; a value with a unit stands in quotes: "{bare[0].strip()}"'
        elif comma := re.search(_COMMA, unquoted):
            hint = f"; a number has a decimal point: {comma[1]}.{comma[2]}"
        elif (twice := re.match(_TWICE, message)) and twice[1] in _ARRAYS:
            hint = f"; of several tables each begins with two brackets: [[{twice[1]}]]"
        elif message.startswith(_AGAIN) and "=" in line:
            hint = f"; {line.partition('=')[0].strip()} stands there a second time"
        sentence = f"{name}:{place[1]}:{place[2]}: is not TOML: {message[: place.start()]}{hint}"
        raise DeckError(sentence, [Fault(sentence, "", "", name, int(place[1]), int(place[2]))]) from None
    refuse_deep(tables, name)
    return tables


def refuse_deep(data: Mapping[str, Any], name: str) -> None:
    """Refuse deeply nested tables, since copying or showing them may exhaust the stack."""
    level: list[Any] = [data]
    for _ in range(DEEPEST):
        entries = [e for table in level for e in (table.values() if isinstance(table, Mapping) else table)]
        level = list({id(e): e for e in entries if isinstance(e, Mapping | list | tuple)}.values())
        if not level:
            return
    raise DeckError(f"{name and name + ': '}nested too deeply; expected at most {DEEPEST} levels")


def with_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a deck with single keys replaced."""
    result = copy.deepcopy(dict(data))
    for dotted_key, value in overrides.items():
        if "[" in dotted_key and (bracket := re.search(_BRACKET, dotted_key)):
            given = f"{bracket[1]}.1{dotted_key[bracket.end() :]}"
            raise DeckError(f"{dotted_key}: expected the number of an entry between points, from 1: {given}")
        *parents, last = dotted_key.split(".")
        here: Any = result
        for part in parents:
            here = here.setdefault(part, {}) if isinstance(here, dict) else _entry(here, part, dotted_key)
        if isinstance(here, dict):
            if value is None:
                here.pop(last, None)
            else:
                here[last] = value
        else:
            _entry(here, last, dotted_key)
            here[int(last) - 1] = value
    return result


def _entry(array: Any, number: str, key: str) -> Any:
    """Return the entry of an array in a dotted key."""
    if not isinstance(array, list):
        raise DeckError(f"{key}: expected a key of a table, but {number} would be inside a plain value")
    if not number.isdecimal() or len(number) > _LONGEST_NUMBER or not 1 <= int(number) <= len(array):
        example = key.replace(f".{number}", f".1.{number}", 1)
        hint = "" if number.lstrip("-").isdecimal() else f" (entries of arrays count from 1: {example})"
        raise DeckError(f"{key}: expected an entry from 1 to {len(array)}, not {number[:60]}{hint}")
    return array[int(number) - 1]


STARTERS = (
    *("sphere", "fretting", "paraboloid", "crossed_cylinders"),
    *("punch", "rounded_punch", "cone", "power"),
)
"""Names of the starter decks, ``templates/NAME.toml``."""


def starter(name: str) -> str:
    """Return the text of a starter deck, see ``hexcontact new NAME``."""
    from importlib import resources

    return (resources.files(__package__) / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def plain(value: Any) -> Any:
    """Return values of Python as a deck can hold them: without numpy, None and `Table`."""
    if isinstance(value, Table):
        return value.written(defaults=False)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items() if entry is not None}
    if isinstance(value, list | tuple):
        return ["" if entry is None else plain(entry) for entry in value]
    return value


def as_toml(data: Mapping[str, Any]) -> str:
    """Return the text of a deck with the given tables."""
    import tomli_w

    return tomli_w.dumps(plain(data))


def load_as_toml(entry: Mapping[str, Any]) -> str:
    """Return the text of an entry of [[load]], which can follow that of other tables and entries."""
    import tomli_w

    long = {"label": "-" * 100}  # beside it no entry is written as an array in a line
    return "\n" + tomli_w.dumps({"load": [entry, long]}).removesuffix(
        f'\n[[load]]\nlabel = "{long["label"]}"\n'
    )


def written(deck: Deck) -> str:
    """Return the text of a deck with every key that has a value, defaults included, in SI.

    Parsing the text gives an equal deck. Keys that others exclude (`ramp` beside `values`, all but the label
    beside a `path`) are left out.
    """
    return as_toml(deck.written())
