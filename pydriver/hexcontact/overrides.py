"""One key of a deck set to another value, by the dotted path that messages use."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .deck import with_overrides


def apply(deck: Mapping[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Return a copy of a deck with one key replaced.

    Parameters
    ----------
    deck : mapping
        The deck as dictionaries.
    path : str
        Dotted key; entries of arrays count from 1, as everywhere: ``"load.1.normal_load"``.
    value : object
        What the deck would say there: a number in SI, text with a unit, a word, an array, a table.

    Raises
    ------
    DeckError
        If the path runs through something that is no table, or an entry that is not there.
    """
    return with_overrides(deck, {path: value})
