"""One sentence for each fault of a deck: place, key, value, and the expected value."""

from __future__ import annotations

import bisect
import re
from collections.abc import Iterable, Mapping
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
    sentence: str  # expected value; [[]] stands for the header of the key


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
    data: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)  # the tables as written

    def written(self, problem: Mistake) -> object:
        """Return the value of a mistake, a number in SI as it is written, with its unit."""
        found: Any = self.data
        for part in problem.key:
            try:
                found = found[part]
            except (LookupError, TypeError):
                return problem.value
        kinds = {float: str, tuple: list}  # as read: as written
        return found if isinstance(found, kinds.get(type(problem.value), ())) else problem.value

    def found(self, key: str) -> tuple[str, Place | None]:
        """Return the file of a dotted key and the place in it; no file for overrides and cases of Python."""
        if self._overridden(key) or not self.name:
            return "", None
        path = tuple(key.split("."))
        for length in range(len(path), 0, -1):  # a missing key has the place of its table
            for name, found in self._places:
                if place := found.get(path[:length]):
                    return name, place
        return self.name, None

    def locate(self, key: str) -> str:
        """Return "file:line:column: ", "override: " or "" for a dotted key."""
        if self._overridden(key):
            return self.of_override
        name, place = self.found(key)
        return f"{name}:{place.line}:{place.column}: " if place else name and f"{name}: "

    def _overridden(self, key: str) -> bool:
        return any(key == name or key.startswith(f"{name}.") for name in self.overrides)

    @cached_property
    def _places(self) -> list[tuple[str, dict[KeyPath, Place]]]:
        return [(name, places(text)) for name, text in ((self.name, self.text), *self.included)]


NOWHERE = Source()
"""The source of cases made in Python."""


def deck_error(problems: Iterable[Mistake], source: Source) -> DeckError:
    """Return one exception for all mistakes, a line for each."""
    faults: dict[Fault, tuple[int, int, int]] = {}  # with file, line and column, by which they are sorted
    files = [source.name, *(name for name, _ in source.included)]
    for problem in problems:
        key = dotted(problem.key)
        value = "" if problem.value is MISSING else shown(source.written(problem))
        lead = f"{source.locate(key)}{key}{value and ' = '}{value}"
        sentence = problem.sentence.replace("[[]]", f"[[{key}]]")
        message = f"{lead}: {sentence}" if lead else sentence
        file, place = source.found(key)
        line, column = place or (None, None)
        fault = Fault(message, key, value, file, line, column, sentence)
        faults[fault] = (files.index(file), *place) if place else (-1, 0, 0)
    ordered = sorted(faults, key=lambda fault: faults[fault])
    return DeckError("\n".join(dict.fromkeys(fault.message for fault in ordered)), ordered)


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

_TOKENS = "|".join(  # compiled when a fault is located
    [
        r'"""(?:[^\\]|\\.)*?"{3,5}',
        r"'''.*?'{3,5}",
        r'"(?:[^"\\\n]|\\.)*"',
        r"'[^'\n]*'",
        r"[\n\[\]{}=,.]",
        r"#[^\n]*",
        r"[^\s\[\]{}=,.#\"']+",
    ]
)


def places(text: str) -> dict[KeyPath, Place]:
    """Return the first place of each key, table and array entry of a deck."""
    starts = [0, *(line.end() for line in re.finditer("\n", text))]
    found: dict[KeyPath, Place] = {}
    counts: dict[KeyPath, int] = {}  # entries of arrays of tables so far
    around: list[tuple[KeyPath, int]] = []  # open arrays with the number of the entry, inline tables with 0
    table: KeyPath = ()
    path: KeyPath = ()  # of the key that was read last
    parts: list[tuple[str, int]] = []  # of a key or header, and where they begin
    state = "key"  # or header, value, after a value

    def note(path: KeyPath, at: int) -> None:
        line = bisect.bisect_right(starts, at)
        found.setdefault(path, Place(line, at - starts[line - 1] + 1))

    for token in re.finditer(_TOKENS, text, re.DOTALL):
        mark, at = token[0], token.start()
        if mark[0] == "#" or (mark == "\n" and around):
            continue
        if mark == "\n":
            parts, state = [], "key"
        elif state == "key" and mark == "[":
            state, opened = "header", at
        elif state == "header" and mark == "]":
            array, table, state = text.startswith("[[", opened), (), "after"
            for number, (part, _) in enumerate(parts, start=1):
                table += (part,)
                if array and number == len(parts):
                    note(table, opened)
                    counts[table] = counts.get(table, 0) + 1
                if table in counts:
                    table += (str(counts[table]),)
                note(table, opened)
        elif state == "key" and mark == "=":
            path = around[-1][0] if around else table
            for part, start in parts:
                path += (part,)
                note(path, start)
            parts, state = [], "value"
        elif state in ("key", "header") and mark not in "[.,}":
            parts.append((mark[1:-1] if mark[0] in "\"'" else mark, at))
        elif mark in "]}" and around:
            path, _ = around.pop()
            state = "after"
        elif state == "value":
            if around and around[-1][1]:
                path = (*around[-1][0], str(around[-1][1]))
                note(path, at)
            if mark in "[{":
                around.append((path, int(mark == "[")))
            state = {"[": "value", "{": "key"}.get(mark, "after")
        elif state == "after" and mark == "," and around:
            outer, number = around.pop()
            around.append((outer, number and number + 1))
            state = "value" if number else "key"
    return found
