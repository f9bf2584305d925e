"""Starter decks: what ``hexcontact new NAME`` writes, templates/NAME.toml."""

from __future__ import annotations

from importlib import resources

_NAMES = ("sphere", "fretting", "paraboloid", "crossed_cylinders", "punch", "rounded_punch", "cone", "power")


def names() -> tuple[str, ...]:
    """Return the names of the starter decks."""
    return _NAMES


def text(name: str) -> str:
    """Return a starter deck, one of `names`."""
    return (resources.files(__package__) / "templates" / f"{name}.toml").read_text(encoding="utf-8")
