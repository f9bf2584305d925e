"""Arguments of a case built in Python, as the tables of a deck, which is what everything else understands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .surfaces import Surface

if TYPE_CHECKING:
    from .case_settings import Body
    from .lattice import Lattice


def given(**keys: Any) -> dict[str, Any]:
    """Keep the keys that were given, with plain values."""
    return {key: plain(value) for key, value in keys.items() if value is not None}


def plain(value: Any) -> Any:
    """Turn numpy numbers and arrays into what a deck can hold."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [plain(entry) for entry in value]
    return value


def body_keys(body: Body | Mapping[str, Any]) -> Any:
    """Return a body as the keys of its table; whatever is neither is left to the deck to refuse."""
    if isinstance(body, Mapping):
        return given(**body)
    if not hasattr(body, "young_modulus"):
        return body
    keys = given(young_modulus=body.young_modulus, poisson_ratio=body.poisson_ratio, surface=body.surface)
    return {**keys, "rigid": True} if body.rigid else keys


def segments(loads: Any) -> Any:
    """Return the entries of [[load]]; whatever are none is left to the deck to refuse."""
    if isinstance(loads, Mapping):
        return [with_radians(loads)]
    return [with_radians(load) for load in loads] if isinstance(loads, list | tuple) else plain(loads)


def with_radians(load: Any) -> Any:
    """Give bare angles of a load their unit: in Python, unlike in a deck, all numbers are SI."""
    if not isinstance(load, Mapping):
        return load
    load = given(**load)
    if isinstance(load.get("twist"), int | float) and not isinstance(load["twist"], bool):
        load["twist"] = f"{load['twist']!r} rad"
    if isinstance(load.get("series"), Mapping):
        load["series"] = {key: _rows(key, rows) for key, rows in given(**load["series"]).items()}
    if isinstance(load.get("path"), list):
        load["path"] = [with_radians(segment) for segment in load["path"]]
    return load


def middle_of(lattice: Lattice) -> list[float]:
    """Return the point (m) about which a deck finds the same window again."""
    middle = [lattice.cols[lattice.n_col // 2], lattice.rows[lattice.n_row // 2]]
    center: list[float] = (lattice.origin + middle @ lattice.basis).tolist()
    return center


def _rows(key: str, rows: Any) -> Any:
    """Return an array of a series; NaN and None are rows that name nothing."""
    if not isinstance(rows, list):
        return rows
    filled = ["" if row is None or row != row else row for row in rows]
    return [f"{row!r} rad" if key == "twist" and isinstance(row, int | float) else row for row in filled]


def as_toml(data: Mapping[str, Any], gap_given: bool) -> str:
    """Write the deck of a case that did not come from a file as it stands."""
    import tomli_w

    def entry_of(value: Any) -> Any:
        if isinstance(value, Surface):
            keys = value.model_dump(exclude_defaults=True)
            if "angle" in keys:
                keys["angle"] = f"{keys['angle']!r} rad"
            return entry_of({"shape": value.shape, **keys})
        if isinstance(value, Mapping):
            return {str(key): entry_of(entry) for key, entry in value.items() if entry is not None}
        if isinstance(value, list | tuple):
            return ["" if entry is None else entry_of(entry) for entry in value]
        return plain(value)

    tables = entry_of(data)
    if gap_given:
        # Refused when read again, instead of solving something else.
        tables["body"]["1"]["surface"] = {"shape": "python"}
    return tomli_w.dumps(tables)
