"""Where the keys of a deck are written: line and column of each, which tomllib does not tell.

tomllib has read the text before, so the scanner need not judge it: it skips values and comments, and notes
where each key of tables, inline tables and arrays begins.
"""

from __future__ import annotations

import bisect
import re
from collections.abc import Iterator
from typing import NamedTuple


class Place(NamedTuple):
    """A place in a text; both count from 1."""

    line: int
    column: int


Path = tuple[str, ...]
"""Path of a key; entries of arrays count from 1, as users know them: ("load", "2", "steps")."""


def places(text: str) -> dict[Path, Place]:
    """Return where each key, table and array entry of a deck is written first."""
    scanner = _Scanner(text)
    scanner.scan()
    return scanner.found


def place_of(found: dict[Path, Place], path: Path) -> tuple[int, Place | None]:
    """Return how many parts of a path are written, and where the last of them is."""
    for length in range(len(path), 0, -1):
        if place := found.get(path[:length]):
            return length, place
    return 0, None


_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_BARE = re.compile(r"[^\s\[\]{}=,.#\"']+")
_PLAIN = re.compile(r"[^\[\]{},#\n\"']+")
_STRINGS = tuple(
    re.compile(pattern, re.DOTALL)
    for pattern in (
        r'"""(?:[^\\]|\\.)*?"{3,5}',
        r"'''.*?'{3,5}",
        r'"(?:[^"\\\n]|\\.)*"',
        r"'[^'\n]*'",
    )
)


class _Scanner:
    """One pass over a text; every method reads on from `self.at`."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.found: dict[Path, Place] = {}
        self.entries: dict[Path, int] = {}  # of arrays of tables
        self.starts = [0, *(match.end() for match in re.finditer("\n", text))]

    def scan(self) -> None:
        table: Path = ()
        while self.skip(_BLANK) and self.at < len(self.text):
            before = self.at
            if self.text[self.at] == "[":
                table = self.header()
            else:
                self.entry(table)
            if self.at == before:  # not TOML after all
                return

    def skip(self, pattern: re.Pattern[str]) -> bool:
        """Move behind what matches here."""
        match = pattern.match(self.text, self.at)
        self.at = match.end() if match else self.at
        return match is not None

    def take(self, words: str) -> bool:
        if not self.text.startswith(words, self.at):
            return False
        self.at += len(words)
        return True

    def note(self, path: Path, at: int) -> None:
        line = bisect.bisect_right(self.starts, at)
        self.found.setdefault(path, Place(line, at - self.starts[line - 1] + 1))

    def header(self) -> Path:
        """Read [table] or [[array]]."""
        start, array = self.at, self.text.startswith("[[", self.at)
        self.at += 2 if array else 1
        parts = list(self.key())
        path: Path = ()
        for number, (part, _) in enumerate(parts, start=1):
            path += (part,)
            if array and number == len(parts):
                self.note(path, start)
                self.entries[path] = self.entries.get(path, 0) + 1
            if path in self.entries:
                path += (str(self.entries[path]),)
            self.note(path, start)
        self.skip(re.compile(r"[ \t]*\]{1,2}"))
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

    def entry(self, table: Path) -> None:
        """Read key = value."""
        path = table
        for part, start in self.key():
            path += (part,)
            self.note(path, start)
        self.skip(_SPACE)
        if self.take("="):
            self.value(path)

    def value(self, path: Path) -> None:
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
