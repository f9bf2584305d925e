"""Decks as text: starter decks, given tables, and checked decks with every key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .keys import Deck
from .table_base import Table

STARTERS = (
    *("sphere", "fretting", "paraboloid", "crossed_cylinders"),
    *("punch", "rounded_punch", "cone", "power"),
)
"""Names of the starter decks, ``templates/NAME.toml``."""


def starter(name: str) -> str:
    """Return the text of a starter deck, see ``hexcontact new NAME``."""
    from importlib import resources

    return (resources.files(__package__) / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def plain(value: Any) -> Any:
    """Return values of Python as a deck can hold them: without numpy, None and `Table`."""
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
    """Return the text of a deck with the given tables."""
    import tomli_w

    return tomli_w.dumps(plain(data))


def load_as_toml(entry: Mapping[str, Any]) -> str:
    """Return the text of an entry of [[load]], which can follow that of other tables and entries."""
    import tomli_w

    long = {"label": "-" * 100}  # beside it no entry is written as an array in a line
    return "\n" + tomli_w.dumps({"load": [entry, long]}).removesuffix(
        f'\n[[load]]\nlabel = "{long["label"]}"\n'
    )


def written(deck: Deck) -> str:
    """Return the text of a deck with every key that has a value, defaults included, in SI.

    Parsing the text gives an equal deck. Keys that others exclude (`ramp` beside `values`, all but the label
    beside a `path`) are left out.
    """
    return as_toml(deck.written())
