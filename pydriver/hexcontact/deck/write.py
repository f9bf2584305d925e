"""A checked deck as text, every key with its value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

from .kinds import Quantity, Table
from .surfaces import Surface
from .tables import Deck, Load, Segment
from .units import ANGLE


def written(deck: Deck) -> str:
    """Write a deck with every key that has a value, defaults included; numbers are in SI.

    Reading the text again gives an equal deck. Keys that cannot stand beside others (`ramp` beside `values`,
    all but the label beside a `path`) are left out where they have no say.
    """
    import tomli_w

    return tomli_w.dumps(_table(deck))


def _table(table: Table) -> dict[str, Any]:
    fields = type(table).model_fields
    values = {info.alias or name: (getattr(table, name), info) for name, info in fields.items()}
    entries = {key: _entry(value, info) for key, (value, info) in values.items() if value is not None}
    if isinstance(table, Load) and (table.path or table.series):
        beside = {"label"} if table.path else {"label", "steps"}
        entries = {key: v for key, v in entries.items() if key in beside or key not in Segment.model_fields}
    elif isinstance(table, Segment) and table.values:
        del entries["ramp"]
    return entries


def _entry(value: Any, info: Any) -> Any:
    if isinstance(value, Surface):
        return {"shape": value.shape, **_table(value)}
    if isinstance(value, Table):
        return _table(value)
    if isinstance(value, list | tuple):
        return ["" if entry is None else _entry(entry, info) for entry in value]
    if isinstance(value, Mapping):
        return {str(key): _entry(entry, info) for key, entry in value.items()}
    # a bare angle is refused
    return f"{value!r} rad" if isinstance(value, float) and _is_angle(info) else value


def _is_angle(info: Any) -> bool:
    found = [*info.metadata]
    for part in get_args(info.annotation):
        found += getattr(part, "__metadata__", ())
    return "rad" in {_dimension(kind) for kind in found}


def _dimension(kind: Any) -> str:
    while hasattr(kind, "kind"):
        kind = kind.kind
    return kind.dimension.unit if isinstance(kind, Quantity) and kind.dimension is ANGLE else ""
