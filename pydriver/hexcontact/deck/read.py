"""One deck out of several sources: files it includes, keys set on the command line, series of loads.

What comes out is whole: a result that keeps its text can be run again without any of the other files.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import DeckError
from ..files import LARGEST_TEXT
from ..text import listed, visible
from .faults import MISSING, NOWHERE, Mistake, Source
from .series import Series, read_series
from .toml import read_toml, refuse_deep, with_overrides

MOST_INCLUDED = 100  # files; one that several others include counts each time
MOST_SERIES = 1000  # files of series


@dataclass(frozen=True)
class Assembled:
    """A deck put together.

    Attributes
    ----------
    data : dict
        The tables, without `include` and without files of series.
    text : str or None
        The text that stands for all of it, or None if no single text does.
    source : Source
        Where the keys are written.
    problems : list of Mistake
        Series that could not be read; they are left as they were.
    """

    data: dict[str, Any]
    text: str | None
    source: Source
    problems: list[Mistake]

    @property
    def remark(self) -> str:
        """A comment that says what the deck was made of."""
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
    """Merge what a deck includes, replace single keys, and read its series of loads.

    Parameters
    ----------
    data : mapping
        The deck as dictionaries.
    text : str, optional
        The deck as text.
    source : Source
        Where it came from.
    folder : Path
        Where relative names of files begin: the folder of the deck.
    overrides : mapping, optional
        New values by dotted key, see `hexcontact.deck.with_overrides`.

    Raises
    ------
    DeckError
        If an included file is missing, is no TOML or includes itself, or a key cannot be replaced.
    """
    refuse_deep(data, source.name)
    if not ("include" in data or overrides or any(True for _ in _series_with_files(data))):
        return Assembled(dict(data), text, source, [])
    name = Path(source.name) if source.name else None
    merged, included = _merged(data, source, folder, (name.resolve(),) if name else (), [])
    if overrides:
        if "include" in overrides:
            raise DeckError("include: cannot be replaced; expected in the deck")
        refuse_deep(overrides, "")
        merged = with_overrides(merged, overrides)
        refuse_deep(merged, source.name)
    source = replace(source, overrides=frozenset(overrides or ()), included=tuple(included))
    merged = copy.deepcopy(merged)
    return Assembled(merged, None, source, list(_read_series(merged, folder)))


def _merged(
    data: Mapping[str, Any], source: Source, folder: Path, chain: tuple[Path, ...], sizes: list[int]
) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Return a deck with what it includes beneath it, and the files, the one that counts most first.

    `sizes` collects those of all files read.
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
        for series in _series_with_files(inner):  # relative to the file that names them
            series["file"] = os.path.relpath(path.parent / series["file"], folder)
        beneath = _over(inner, beneath)
        files = [(str(path), text), *further, *files]
    return _over(own, beneath), files


def _over(upper: Mapping[str, Any], lower: Mapping[str, Any]) -> dict[str, Any]:
    """Lay one deck over another: tables are merged, anything else is replaced."""
    result = dict(lower)
    for key, value in upper.items():
        below = result.get(key)
        both = isinstance(value, Mapping) and isinstance(below, Mapping)
        # a surface of another shape has other keys
        whole = both and value.get("shape", below.get("shape")) != below.get("shape")  # type: ignore[union-attr]
        result[key] = _over(value, below) if both and not whole else value  # type: ignore[arg-type]
    return result


def _series_with_files(data: Mapping[str, Any]) -> Iterator[Any]:
    loads = data.get("load")
    for load in loads if isinstance(loads, list) else ():
        series = load.get("series") if isinstance(load, Mapping) else None
        if isinstance(series, dict) and isinstance(series.get("file"), str):
            yield series


def _read_series(data: Mapping[str, Any], folder: Path) -> Iterator[Mistake]:
    """Put the rows in the place of the names of files, and yield what is wrong with them."""
    if sum(1 for _ in _series_with_files(data)) > MOST_SERIES:
        raise DeckError(f"load: expected at most {MOST_SERIES} files of series")
    for number, load in enumerate(data["load"] if isinstance(data.get("load"), list) else ()):
        series = next(_series_with_files({"load": [load]}), None)
        if series is None:
            continue
        try:
            asked = Series.model_validate(series)
        except ValidationError:
            continue  # what is wrong there is found when the tables are checked
        columns = asked.columns and asked.columns.written()
        try:
            load["series"] = read_series(folder / asked.file, columns)
        except DeckError as error:
            key = ("load", number, "series", "file")
            for sentence in str(error).splitlines():
                yield Mistake(key, MISSING, sentence)
