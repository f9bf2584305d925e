"""A checked deck as text, every key with its value."""

from __future__ import annotations

from .tables import Deck


def written(deck: Deck) -> str:
    """Write a deck with every key that has a value, defaults included; numbers are in SI.

    Reading the text again gives an equal deck. Keys that cannot stand beside others (`ramp` beside `values`,
    all but the label beside a `path`) are left out where they have no say.
    """
    import tomli_w

    return tomli_w.dumps(deck.written())
