"""One clear sentence for each thing wrong with a deck: where, the key, its value, what was expected."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from ..errors import DeckError, Fault
from ..text import dotted, shown
from .location import Place, place_of, places

MISSING: Any = object()
"""The value of a problem with a key that is not there, or not worth repeating."""


class Mistake(NamedTuple):
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
    included : tuple of (str, str)
        Names and texts of the files that the deck includes, the one that counts most first.
    of_override : str
        What stands before the keys of overrides.
    """

    name: str = ""
    text: str = ""
    overrides: frozenset[str] = field(default_factory=frozenset)
    included: tuple[tuple[str, str], ...] = ()
    of_override: str = "override: "

    def found(self, key: str) -> tuple[str, Place | None]:
        """Return the file that a dotted key stands in, and where in it; no file for overrides and cases."""
        if self._overridden(key) or not self.name:
            return "", None
        return self._place(key)

    def locate(self, key: str) -> str:
        """Return "file:line:column: ", "override: " or "" for a dotted key."""
        if self._overridden(key):
            return self.of_override
        if not self.name:
            return ""
        name, place = self._place(key)
        return f"{name}:{place.line}:{place.column}: " if place else f"{self.name}: "

    def order(self, key: str) -> tuple[int, int, int]:
        """Return what sorts keys as they are read: by file, line and column."""
        if not self.name or self._overridden(key):
            return -1, 0, 0
        name, place = self._place(key)
        return ([entry for entry, _ in self._places].index(name), *place) if place else (-1, 0, 0)

    def _overridden(self, key: str) -> bool:
        return any(key == name or key.startswith(f"{name}.") for name in self.overrides)

    def _place(self, key: str) -> tuple[str, Place | None]:
        written = [(name, place_of(found, tuple(key.split(".")))) for name, found in self._places]
        name, (_, place) = max(written, key=lambda entry: entry[1][0])  # of equals the first
        return name, place

    @cached_property
    def _places(self) -> list[tuple[str, dict[tuple[str, ...], Place]]]:
        return [(name, places(text)) for name, text in ((self.name, self.text), *self.included)]


NOWHERE = Source()
"""The source of what was made in Python."""


def deck_error(problems: Iterable[Mistake], source: Source) -> DeckError:
    """Put all problems into one exception, a line for each."""
    faults = []
    for problem in sorted(problems, key=lambda problem: source.order(dotted(problem.key))):
        key = dotted(problem.key)
        value = "" if problem.value is MISSING else shown(problem.value)
        message = f"{source.locate(key)}{key}{value and ' = '}{value}: {problem.sentence}"
        file, place = source.found(key)
        faults.append(Fault(message, key, value, file, *(place or (None, None))))
    faults = list(dict.fromkeys(faults))
    return DeckError("\n".join(dict.fromkeys(fault.message for fault in faults)), faults)
