"""Decks from their sources: included files, keys set on the command line, series of loads, results.

The assembled deck is complete: a result that contains its text can be run again without the other files.
"""

from __future__ import annotations

import copy
import functools
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from .._version import __version__
from ..errors import DeckError
from ..files import LARGEST_TEXT
from ..text import listed, visible
from .faults import MISSING, NOWHERE, Mistake, Source, deck_error
from .interface import FROM_PYTHON
from .keys import Deck
from .separation import Separation
from .series import Series, read_series
from .surfaces import Surface
from .toml import parse_toml, read_toml, refuse_deep, with_overrides

MOST_INCLUDED = 100  # files; one that several others include counts each time
MOST_SERIES = 1000  # files of series


class Assembled(NamedTuple):
    """A deck assembled from its sources."""

    data: dict[str, Any]  # the tables, without `include` and without files of series
    text: str | None  # text of the whole deck, or None if it has several sources
    source: Source  # places of the keys
    problems: list[Mistake]  # mistakes in series, which stay as they were

    @property
    def remark(self) -> str:
        """A comment with the sources of the deck."""
        files = [name for name, _ in ((self.source.name, ""), *self.source.included) if name]
        remark = f"# Put together from {listed(files, 'and')}" if files else ""
        if remark and self.source.overrides:
            remark += f", with {listed(sorted(self.source.overrides), 'and')} set"
        return visible(" ".join(remark.split())) + ".\n" if remark else ""


def assemble(
    data: Mapping[str, Any],
    text: str | None = None,
    source: Source = NOWHERE,
    folder: Path = Path(),
    overrides: Mapping[str, Any] | None = None,
) -> Assembled:
    """Return a deck with its included decks merged, single keys replaced, and series of loads read."""
    if not ("include" in data or overrides or any(True for _ in _named_files(data))):
        return Assembled(dict(data), text, replace(source, data=data), [])
    name = Path(source.name) if source.name else None
    merged, included = _merged(data, source, folder, (name.resolve(),) if name else (), [])
    if overrides:
        if "include" in overrides:
            raise DeckError("include: cannot be replaced; expected in the deck")
        refuse_deep(overrides, "")
        merged = with_overrides(merged, overrides)
        refuse_deep(merged, source.name)
    merged = copy.deepcopy(merged)
    source = replace(source, overrides=frozenset(overrides or ()), included=tuple(included), data=merged)
    for table, key, number in _named_files(merged):
        if number is None:  # read when the case is built, from any folder
            table[key] = str((folder / table[key]).absolute())
    return Assembled(merged, None, source, list(_read_series(merged, folder)))


def _merged(
    data: Mapping[str, Any], source: Source, folder: Path, chain: tuple[Path, ...], sizes: list[int]
) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Return a deck merged with the decks that it includes, and these files in the order of precedence.

    `sizes` collects the lengths of all files read.
    """
    own = {key: value for key, value in data.items() if key != "include"}
    if "include" not in data:
        return own, []
    names = data["include"]
    prefix = source.locate("include")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise DeckError(f'{prefix}include: expected an array of file names such as ["materials.toml"]')
    beneath: dict[str, Any] = {}
    files: list[tuple[str, str]] = []
    for name in names:
        path = folder / name
        if len(sizes) == MOST_INCLUDED or sum(sizes) > LARGEST_TEXT:
            most = f"{MOST_INCLUDED} files and {LARGEST_TEXT >> 20} MB in all"
            raise DeckError(f"{prefix}include: expected at most {most}, counting a file each time")
        try:
            tables, text = read_toml(path)
        except DeckError as error:
            raise DeckError(f"{prefix}include: {error}") from None
        if path.resolve() in chain:
            turns = " -> ".join(link.name for link in (*chain[chain.index(path.resolve()) :], path))
            raise DeckError(f"{prefix}include: {path} includes itself ({turns})")
        sizes.append(len(text))
        below = Source(str(path), text)
        inner, further = _merged(tables, below, path.parent, (*chain, path.resolve()), sizes)
        for table, key, _ in _named_files(inner):  # relative to the file that names them
            table[key] = os.path.relpath(path.parent / table[key], folder)
        beneath = _over(inner, beneath)
        files = [(str(path), text), *further, *files]
    return _over(own, beneath), files


def _over(upper: Mapping[str, Any], lower: Mapping[str, Any]) -> dict[str, Any]:
    """Return one deck over another: tables are merged, other values replaced."""
    result = dict(lower)
    for key, value in upper.items():
        below = result.get(key)
        both = isinstance(value, Mapping) and isinstance(below, Mapping)
        # a surface of another shape has other keys
        whole = both and value.get("shape", below.get("shape")) != below.get("shape")  # type: ignore[union-attr]
        result[key] = _over(value, below) if both and not whole else value  # type: ignore[arg-type]
    return result


def _named_files(data: Mapping[str, Any]) -> Iterator[tuple[Any, str, int | None]]:
    """Yield the tables that name files, their keys, and the indices of their entries of [[load]], if any."""
    loads = data.get("load")
    for number, load in enumerate(loads if isinstance(loads, list) else ()):
        if isinstance(_value(load, "series", "file"), str):
            yield load["series"], "file", number
    maps = [(_value(data, "friction", "coefficient"), "map")]
    for body in "12":
        shapes = _value(data, "body", body, "surface")
        maps += ((one, "file") for one in (shapes if isinstance(shapes, list) else [shapes]))
    for table, key in maps:
        if isinstance(name := _value(table, key), str) and name:
            yield table, key, None


def _value(table: Any, *keys: str) -> Any:
    """Return the value below some keys; None if there is none."""
    for key in keys:
        table = table.get(key) if isinstance(table, dict) else None
    return table


def _read_series(data: Mapping[str, Any], folder: Path) -> Iterator[Mistake]:
    """Replace the names of files by their rows, and yield the mistakes in them."""
    found = [(number, table) for table, _, number in _named_files(data) if number is not None]
    if len(found) > MOST_SERIES:
        raise DeckError(f"load: expected at most {MOST_SERIES} files of series")
    for number, series in found:
        try:
            table = Series.model_validate(series)
        except ValidationError:
            continue  # the check of the tables reports it
        columns = table.columns and table.columns.written()
        try:
            data["load"][number]["series"] = read_series(folder / table.file, columns)
        except DeckError as error:
            key = ("load", number, "series", "file")
            for sentence in str(error).splitlines():
                yield Mistake(key, MISSING, sentence)


class RecordedDeck:
    """The tables of the deck of a result, `data` as they are written; none without a text.

    `given` are the parts that were given in Python: "surface" for the gap, "friction".
    """

    def __init__(self, text: str, name: str) -> None:
        self._source = Source(name, text)
        self.data = parse_toml(text, name) if text else {}
        places = {"surface": ("body", "1", "surface", "shape"), "friction": ("friction", "coefficient")}
        self.given = frozenset(part for part in places if _value(self.data, *places[part]) == FROM_PYTHON)

    @functools.cached_property
    def _checked(self) -> tuple[dict[str, Any], list[Mistake]]:
        data = self.data
        if "surface" in self.given:
            one = {key: value for key, value in data["body"]["1"].items() if key != "surface"}
            data = {**data, "body": {**data["body"], "1": one}}
        return Deck.checked(data) if data else ({}, [])

    def tables(self, *names: str) -> dict[str, Any]:
        """Return the named tables; refuse a key or a value in them that this version does not have."""
        found, mistakes = self._checked
        if wrong := [mistake for mistake in mistakes if mistake.key and mistake.key[0] in names]:
            error = deck_error(wrong, self._source)
            error.add_note(
                f"this is hexcontact {__version__}; open the result with the version that wrote it"
            )
            raise error
        return {name: found[name] for name in names if name in found}

    @property
    def separation(self) -> Separation | None:
        """The gap of the two surfaces; None if it was given in Python, or without a deck."""
        bodies = None if "surface" in self.given else self.tables("body").get("body")
        return bodies.separation if bodies else None

    @property
    def only_surface(self) -> Surface | None:
        """The surface of a body on a flat one; None if there is none, or both have one."""
        return self.separation.only_curved if self.separation else None


@functools.lru_cache(4)
def recorded(text: str, name: str = "deck of the result") -> RecordedDeck:
    """Return the deck of a result by its text; `name` stands for it in messages."""
    return RecordedDeck(text, name)
