"""One clear sentence for each thing wrong with a deck: where, the key, its value, what was expected."""

from __future__ import annotations

import difflib
import html
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from .deck_location import Place, place_of, places
from .errors import DeckError, Fault

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
    included : tuple of (str, str)
        Names and texts of the files that the deck includes, the one that counts most first.
    """

    name: str = ""
    text: str = ""
    overrides: frozenset[str] = field(default_factory=frozenset)
    included: tuple[tuple[str, str], ...] = ()

    def found(self, key: str) -> tuple[str, Place | None]:
        """Return the file that a dotted key stands in, and where in it; no file for overrides and cases."""
        if self._overridden(key) or not self.name:
            return "", None
        return self._place(key)

    def locate(self, key: str) -> str:
        """Return "file:line:column: ", "override: " or "" for a dotted key."""
        if self._overridden(key):
            return "override: "
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


def deck_error(problems: Iterable[Problem], source: Source) -> DeckError:
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
    elif hasattr(value, "__float__") and not getattr(value, "shape", ()):
        text = repr(float(value))
    else:
        text = str(value)
    return text if len(text) <= width else text[: width - 3] + "..."


# Control characters but tab and ends of lines, separators of lines, marks that change the direction of
# reading, halves of surrogate pairs, and what is no character: terminals obey them, XML forbids most.
_UNSEEN = re.compile(
    "[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
    "|\r(?!\n)"
)


def visible(text: str) -> str:
    r"""Write text of a user so that a terminal or a page only shows it: an escape character as ``\u001b``."""
    return _UNSEEN.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def escaped(text: str) -> str:
    """Write text of a user for HTML and XML."""
    return html.escape(visible(text))


def listed(entries: Sequence[str], conjunction: str) -> str:
    """Join entries as a sentence would: "a, b or c"."""
    return entries[0] if len(entries) == 1 else f"{', '.join(entries[:-1])} {conjunction} {entries[-1]}"


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" with the nearest known word, or nothing."""
    near = difflib.get_close_matches(str(word)[:100], list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""
