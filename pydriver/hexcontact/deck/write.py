"""Decks as text: as they were given, or checked, with every key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .model import Table
from .tables import Deck


def plain(value: Any) -> Any:
    """Return what a deck can hold of values from Python: without numpy, None and tables that were made."""
    if isinstance(value, Table):
        return value.written(defaults=False)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items() if entry is not None}
    if isinstance(value, list | tuple):
        return ["" if entry is None else plain(entry) for entry in value]
    return value


def as_toml(data: Mapping[str, Any]) -> str:
    """Write the tables of a deck as they were given."""
    import tomli_w

    return tomli_w.dumps(plain(data))


def written(deck: Deck) -> str:
    """Write a deck with every key that has a value, defaults included; numbers are in SI.

    Reading the text again gives an equal deck. Keys that cannot stand beside others (`ramp` beside `values`,
    all but the label beside a `path`) are left out where they have no say.
    """
    return as_toml(deck.written())
