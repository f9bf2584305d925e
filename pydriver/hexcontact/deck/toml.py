"""TOML to tables of values, single keys replaced, before anything is checked."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import DeckError, Fault
from ..files import text_of

DEEPEST = 50  # levels of tables and arrays; no key needs more than six


def read_toml(path: str | Path) -> tuple[dict[str, Any], str]:
    """Read a deck file into dictionaries, without checking what it says.

    Parameters
    ----------
    path : str or Path
        A TOML file in UTF-8.

    Returns
    -------
    data : dict
        The tables.
    text : str
        The file as it is.

    Raises
    ------
    DeckError
        If there is no such file, it cannot be read, or it is not TOML.
    """
    text = text_of(path, "a deck (a TOML file)")
    return parse_toml(text, str(path)), text


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Parse TOML; `name` is what an error message calls it.

    Raises
    ------
    DeckError
        With the line and what is wrong there.
    """
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        message = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        place = re.search(r" \(at line (\d+), column (\d+)\)$", message)
        if place is None:
            raise DeckError(f"{name}: is not TOML: {message}") from None
        sentence = f"{name}:{place[1]}:{place[2]}: is not TOML: {message[: place.start()]}"
        raise DeckError(sentence, [Fault(sentence, "", "", name, int(place[1]), int(place[2]))]) from None
    refuse_deep(tables, name)
    return tables


def refuse_deep(data: Mapping[str, Any], name: str) -> None:
    """Refuse tables in tables in tables, which to copy or to show may need more stack than there is.

    Parameters
    ----------
    data : mapping
        The deck as dictionaries; may hold itself.
    name : str
        What an error message calls it; may be empty.

    Raises
    ------
    DeckError
        If there are more than `DEEPEST` levels.
    """
    level: list[Any] = [data]
    for _ in range(DEEPEST):
        entries = [e for table in level for e in (table.values() if isinstance(table, Mapping) else table)]
        level = list(
            {id(entry): entry for entry in entries if isinstance(entry, Mapping | list | tuple)}.values()
        )
        if not level:
            return
    raise DeckError(f"{name and name + ': '}nested too deeply; expected at most {DEEPEST} levels")


def with_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a deck with single keys replaced.

    Parameters
    ----------
    data : mapping
        The deck as dictionaries.
    overrides : mapping
        New values by dotted key; entries of arrays count from 1 ("load.2.steps"). None removes a key.

    Raises
    ------
    DeckError
        If a key runs through something that is no table, or an entry that is not there.
    """
    result = copy.deepcopy(dict(data))
    for dotted_key, value in overrides.items():
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
    """Return the entry of an array that a dotted key speaks of."""
    if not isinstance(array, list):
        raise DeckError(f"{key}: expected a key of a table, but {number} would be inside a plain value")
    if not number.isdecimal() or not 1 <= int(number) <= len(array):
        raise DeckError(f"{key}: expected an entry from 1 to {len(array)}, not {number}")
    return array[int(number) - 1]
