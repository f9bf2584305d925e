"""One clear sentence for each thing wrong with a deck: where, the key, its value, what was expected."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from .errors import DeckError

MISSING: Any = object()
"""The value of a problem with a key that is not there, or not worth repeating."""


class Problem(NamedTuple):
    """One thing that is wrong with a deck.

    Attributes
    ----------
    key : tuple
        Path of the key; entries of arrays count from 0 here and from 1 in what the user reads.
    value : object
        What the deck says there, or `MISSING`.
    sentence : str
        What was expected.
    """

    key: tuple[str | int, ...]
    value: object
    sentence: str


@dataclass(frozen=True)
class Source:
    """Where a deck came from, to point at its lines.

    Attributes
    ----------
    name : str
        File name; empty for a case that was built in Python.
    text : str
        The deck as written.
    overrides : frozenset of str
        Dotted keys whose values did not come from the text.
    """

    name: str = ""
    text: str = ""
    overrides: frozenset[str] = field(default_factory=frozenset)

    def locate(self, key: str) -> str:
        """Return "file:line: ", "override: " or "" for a dotted key."""
        if any(key == name or key.startswith(f"{name}.") for name in self.overrides):
            return "override: "
        if not self.name:
            return ""
        line = line_of(self.text, key)
        return f"{self.name}:{line}: " if line else f"{self.name}: "


def deck_error(problems: Iterable[Problem], source: Source) -> DeckError:
    """Put all problems into one exception, a line for each."""
    lines = []
    for problem in problems:
        key = dotted(problem.key)
        value = "" if problem.value is MISSING else f" = {shown(problem.value)}"
        lines.append(f"{source.locate(key)}{key}{value}: {problem.sentence}")
    return DeckError("\n".join(dict.fromkeys(lines)))


def dotted(key: Sequence[str | int]) -> str:
    """Write the path of a key as users know it: "load.2.steps" is the second entry of [[load]]."""
    return ".".join(str(part + 1) if isinstance(part, int) else part for part in key)


def shown(value: object, width: int = 60, depth: int = 5) -> str:
    """Write a value the way a deck would, shortened if it is long or deep."""
    if isinstance(value, str | bool):
        text = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, Mapping | list | tuple) and depth == 0:
        text = "..."
    elif isinstance(value, Mapping):
        text = (
            "{" + ", ".join(f"{key} = {shown(entry, width, depth - 1)}" for key, entry in value.items()) + "}"
        )
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(shown(entry, width, depth - 1) for entry in value[:width]) + "]"
    elif isinstance(value, int):
        text = hex(value) if value.bit_length() > 200 else str(value)
    elif hasattr(value, "__float__"):
        text = repr(float(value))
    else:
        text = str(value)
    return text if len(text) <= width else text[: width - 3] + "..."


def listed(entries: Sequence[str], conjunction: str) -> str:
    """Join entries as a sentence would: "a, b or c"."""
    return entries[0] if len(entries) == 1 else f"{', '.join(entries[:-1])} {conjunction} {entries[-1]}"


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" with the nearest known word, or nothing."""
    near = difflib.get_close_matches(str(word)[:100], list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""


_HEADER = re.compile(r"""\s*(\[\[?)\s*([A-Za-z0-9_."' -]+?)\s*\]""")
_KEY = re.compile(r"""\s*([A-Za-z0-9_."' -]+?)\s*=""")


def line_of(text: str, key: str) -> int | None:
    """Find the line of a deck on which a key, or else the table around it, is written.

    It scans for headers and keys instead of parsing TOML again; keys inside inline tables are found by the
    line on which that table starts.
    """
    best: tuple[int, int] | None = None  # length of the matching part of the key, line
    table, in_text = "", ""
    counts: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if in_text:
            in_text = "" if in_text in line else in_text
            continue
        if header := _HEADER.match(line):
            table = _plain(header[2])
            if header[1] == "[[":
                counts[table] = counts.get(table, 0) + 1
                table = f"{table}.{counts[table]}"
            here = table
        elif entry := _KEY.match(line):
            here = f"{table}.{_plain(entry[1])}".lstrip(".")
        else:
            continue
        if (key == here or key.startswith(f"{here}.")) and (best is None or len(here) > best[0]):
            best = len(here), number
        for quotes in ('"""', "'''"):
            if line.count(quotes) == 1:
                in_text = quotes
    return best[1] if best else None


def _plain(key: str) -> str:
    """Strip the quotes and blanks that TOML allows around the parts of a dotted key."""
    return ".".join(part.strip().strip("\"'") for part in key.split("."))
