"""One sentence for each fault of a deck: place, key, value, and the expected value."""

from __future__ import annotations

import bisect
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from ..errors import DeckError, Fault
from ..text import dotted, shown

MISSING: Any = object()
"""The value of a mistake whose key is absent, or whose value is not shown."""


class Mistake(NamedTuple):
    """A mistake in a deck."""

    key: tuple[str | int, ...]  # path of the key; entries of arrays count from 0 here and from 1 in messages
    value: object  # value in the deck, or `MISSING`
    sentence: str  # expected value


@dataclass(frozen=True)
class Source:
    """The file and text of a deck, for the places in messages."""

    name: str = ""  # file name; empty for a case that was built in Python
    text: str = ""  # text of the deck
    # dotted keys whose values are not from the text
    overrides: frozenset[str] = field(default_factory=frozenset)
    # names and texts of the files that the deck includes, the one that counts most first
    included: tuple[tuple[str, str], ...] = ()
    of_override: str = "override: "  # prefix of the keys of overrides

    def found(self, key: str) -> tuple[str, Place | None]:
        """Return the file of a dotted key and the place in it; no file for overrides and cases of Python."""
        if self._overridden(key) or not self.name:
            return "", None
        written = [(name, place_of(found, tuple(key.split(".")))) for name, found in self._places]
        name, (_, place) = max(written, key=lambda entry: entry[1][0])  # of equals the first
        return name, place

    def locate(self, key: str) -> str:
        """Return "file:line:column: ", "override: " or "" for a dotted key."""
        if self._overridden(key):
            return self.of_override
        name, place = self.found(key)
        return f"{name}:{place.line}:{place.column}: " if place else name and f"{name}: "

    def order(self, key: str) -> tuple[int, int, int]:
        """Return the sort key of a dotted key: file, line and column."""
        name, place = self.found(key)
        return ([entry for entry, _ in self._places].index(name), *place) if place else (-1, 0, 0)

    def _overridden(self, key: str) -> bool:
        return any(key == name or key.startswith(f"{name}.") for name in self.overrides)

    @cached_property
    def _places(self) -> list[tuple[str, dict[KeyPath, Place]]]:
        return [(name, places(text)) for name, text in ((self.name, self.text), *self.included)]


NOWHERE = Source()
"""The source of cases made in Python."""


def deck_error(problems: Iterable[Mistake], source: Source) -> DeckError:
    """Return one exception for all mistakes, a line for each."""
    faults = []
    for problem in sorted(problems, key=lambda problem: source.order(dotted(problem.key))):
        key = dotted(problem.key)
        value = "" if problem.value is MISSING else shown(problem.value)
        message = f"{source.locate(key)}{key}{value and ' = '}{value}: {problem.sentence}"
        file, place = source.found(key)
        line, column = place or (None, None)
        faults.append(Fault(message, key, value, file, line, column, problem.sentence))
    faults = list(dict.fromkeys(faults))
    return DeckError("\n".join(dict.fromkeys(fault.message for fault in faults)), faults)


# --- line and column of each key, which tomllib does not return ---------------------------------------------
#
# tomllib has parsed the text before, so the scanner does not check it: it skips values and comments, and
# records where each key of tables, inline tables and arrays begins.


class Place(NamedTuple):
    """A place in a text; both count from 1."""

    line: int
    column: int


KeyPath = tuple[str, ...]
"""Path of a key; entries of arrays count from 1: ("load", "2", "steps")."""


def places(text: str) -> dict[KeyPath, Place]:
    """Return the first place of each key, table and array entry of a deck."""
    scanner = _Scanner(text)
    scanner.scan()
    return scanner.found


def place_of(found: dict[KeyPath, Place], path: KeyPath) -> tuple[int, Place | None]:
    """Return the number of parts of a path that are written, and the place of the last of them."""
    for length in range(len(path), 0, -1):
        if place := found.get(path[:length]):
            return length, place
    return 0, None


# compiled when a fault is located
_BLANK = r"(?:[ \t\r\n]|#[^\n]*)*"
_SPACE = r"[ \t]*"
_BARE = r"[^\s\[\]{}=,.#\"']+"
_PLAIN = r"[^\[\]{},#\n\"']+"
_STRINGS = (r'"""(?:[^\\]|\\.)*?"{3,5}', r"'''.*?'{3,5}", r'"(?:[^"\\\n]|\\.)*"', r"'[^'\n]*'")


class _Scanner:
    """A scanner of one pass over a text; every method reads on from `self.at`."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.found: dict[KeyPath, Place] = {}
        self.entries: dict[KeyPath, int] = {}  # of arrays of tables
        self.starts = [0, *(match.end() for match in re.finditer("\n", text))]

    def scan(self) -> None:
        table: KeyPath = ()
        while self.skip(_BLANK) and self.at < len(self.text):
            before = self.at
            if self.text[self.at] == "[":
                table = self.header()
            else:
                self.entry(table)
            if self.at == before:  # not TOML after all
                return

    def skip(self, pattern: str) -> bool:
        """Move behind a match at the current place; return whether there is one."""
        match = re.compile(pattern, re.DOTALL).match(self.text, self.at)
        self.at = match.end() if match else self.at
        return match is not None

    def take(self, words: str) -> bool:
        if not self.text.startswith(words, self.at):
            return False
        self.at += len(words)
        return True

    def note(self, path: KeyPath, at: int) -> None:
        line = bisect.bisect_right(self.starts, at)
        self.found.setdefault(path, Place(line, at - self.starts[line - 1] + 1))

    def header(self) -> KeyPath:
        """Read [table] or [[array]]."""
        start, array = self.at, self.text.startswith("[[", self.at)
        self.at += 2 if array else 1
        parts = list(self.key())
        path: KeyPath = ()
        for number, (part, _) in enumerate(parts, start=1):
            path += (part,)
            if array and number == len(parts):
                self.note(path, start)
                self.entries[path] = self.entries.get(path, 0) + 1
            if path in self.entries:
                path += (str(self.entries[path]),)
            self.note(path, start)
        self.skip(r"[ \t]*\]{1,2}")
        return path

    def key(self) -> Iterator[tuple[str, int]]:
        """Yield the parts of a dotted key, and where each begins."""
        while True:
            self.skip(_SPACE)
            start = self.at
            if not (self.string() or self.skip(_BARE)):
                return
            part = self.text[start : self.at]
            yield (part[1:-1] if part[0] in "\"'" else part), start
            self.skip(_SPACE)
            if not self.take("."):
                return

    def entry(self, table: KeyPath) -> None:
        """Read key = value."""
        path = table
        for part, start in self.key():
            path += (part,)
            self.note(path, start)
        self.skip(_SPACE)
        if self.take("="):
            self.value(path)

    def value(self, path: KeyPath) -> None:
        self.skip(_SPACE)
        if self.take("["):
            number = 1
            while self.skip(_BLANK) and self.at < len(self.text) and not self.take("]"):
                before, entry = self.at, (*path, str(number))
                self.note(entry, before)
                self.value(entry)
                self.skip(_BLANK)
                number += self.take(",")
                if self.at == before:
                    return
        elif self.take("{"):
            while self.skip(_BLANK) and self.at < len(self.text) and not self.take("}"):
                before = self.at
                self.entry(path)
                self.skip(_BLANK)
                self.take(",")
                if self.at == before:
                    return
        elif not self.string():
            self.skip(_PLAIN)

    def string(self) -> bool:
        return any(self.skip(pattern) for pattern in _STRINGS)
