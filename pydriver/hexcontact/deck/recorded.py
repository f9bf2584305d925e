"""The deck of a result, which another version may have written: the one reader of its tables."""

from __future__ import annotations

import functools
from typing import Any

from .._version import __version__
from .faults import Mistake, Source, deck_error
from .interface import FROM_PYTHON
from .keys import Deck
from .surfaces import Separation, Surface
from .toml import parse_toml


class RecordedDeck:
    """The tables of the deck of a result; none without a text.

    Attributes
    ----------
    data : dict
        The tables as they are written, unchecked.
    given : frozenset of str
        Parts that were given in Python: "surface" for the gap, "friction".
    """

    def __init__(self, text: str, name: str) -> None:
        self._source = Source(name, text)
        self.data = parse_toml(text, name) if text else {}
        places = {"surface": ("body", "1", "surface", "shape"), "friction": ("friction", "coefficient")}
        self.given = frozenset(part for part, keys in places.items() if self._value(keys) == FROM_PYTHON)

    def _value(self, keys: tuple[str, ...]) -> Any:
        value: Any = self.data
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return value

    @functools.cached_property
    def _checked(self) -> tuple[dict[str, Any], list[Mistake]]:
        data = self.data
        if "surface" in self.given:
            one = {key: value for key, value in data["body"]["1"].items() if key != "surface"}
            data = {**data, "body": {**data["body"], "1": one}}
        return Deck.checked(data) if data else ({}, [])

    def tables(self, *names: str) -> dict[str, Any]:
        """Return the named tables; refuse a key or a value in them that this version does not know."""
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
        bodies = None if "surface" in self.given else self.tables("body").get("body")
        curved = [body.surface for body in (bodies.body_1, bodies.body_2) if body.surface] if bodies else []
        return curved[0] if len(curved) == 1 else None


@functools.lru_cache(4)
def recorded(text: str, name: str = "deck of the result") -> RecordedDeck:
    """Return the deck of a result by its text; `name` stands for it in messages."""
    return RecordedDeck(text, name)
