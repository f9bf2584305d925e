"""Tables of the deck in a result, which another version may have written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .._version import __version__
from .faults import Source, deck_error
from .interface import FROM_PYTHON
from .tables import Deck
from .toml import parse_toml

_NAME = "deck of the result"


class Recorded(NamedTuple):
    """Tables of the deck of a result, by the attributes of `Deck`; none without a deck.

    Attributes
    ----------
    tables : dict
        The tables.
    gap_given : bool
        Whether the gap was given in Python, in the place of surfaces.
    """

    tables: dict[str, Any]
    gap_given: bool = False


def recorded(text: str, *names: str) -> Recorded:
    """Return the named tables of the deck of a result."""
    if not text:
        return Recorded({})
    data = parse_toml(text, _NAME)
    given = "surface" in given_in_python(data)
    if given:
        del data["body"]["1"]["surface"]
    tables, mistakes = Deck.checked(data)
    if wrong := [mistake for mistake in mistakes if mistake.key and mistake.key[0] in names]:
        error = deck_error(wrong, Source(_NAME, text))
        error.add_note(f"this is hexcontact {__version__}; open the result with the version that wrote it")
        raise error
    return Recorded({name: tables[name] for name in names if name in tables}, given)


def given_in_python(deck: Mapping[str, Any]) -> set[str]:
    """Return the parts of a deck that were given in Python: "surface" for the gap, "friction"."""
    places = {"surface": ("body", "1", "surface", "shape"), "friction": ("friction", "coefficient")}
    return {part for part, keys in places.items() if _value(deck, keys) == FROM_PYTHON}


def _value(deck: Any, keys: Sequence[str]) -> Any:
    for key in keys:
        deck = deck.get(key) if isinstance(deck, Mapping) else None
    return deck
