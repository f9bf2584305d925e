"""Where the quantities of a table are largest, and life is least."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..text import quantity

if TYPE_CHECKING:
    import xarray

_LEAST = ("life",)  # quantities whose least value counts
_ALIKE = 1e-6  # share of a value within which others count as equal: the first of them is named


def with_places(found: xarray.Dataset) -> xarray.Dataset:
    """Give each quantity the attributes largest, largest_at and largest_step, life least and so on."""
    for name, field in found.data_vars.items():
        values = np.where(np.isfinite(field.values), field.values, np.nan)
        if field.attrs.get("units") == "rad" or np.isnan(values).all():
            continue
        word, end = ("least", np.nanmin(values)) if name in _LEAST else ("largest", np.nanmax(values))
        first = np.flatnonzero(abs(values - end) <= _ALIKE * abs(end))[0]
        at = field.isel(dict(zip(field.dims, np.unravel_index(first, values.shape), strict=True)))
        field.attrs[word] = float(end)
        field.attrs[f"{word}_at"] = [float(at[axis]) for axis in ("x", "y", "depth")]
        if "step" in at.coords:
            field.attrs[f"{word}_step"] = int(at["step"])
    return found


def place_of(field: xarray.DataArray) -> str:
    """Return the value that counts and its place in words; empty if the file has none."""
    word = "least" if field.name in _LEAST else "largest"
    if (at := field.attrs.get(f"{word}_at")) is None:
        return ""
    units = str(field.attrs.get("units", "")).removesuffix("1")
    value = float(field.attrs[word])
    text = quantity(value, units) if " " not in units else f"{quantity(value)} {units}"
    x, y, depth = (quantity(float(place), "m") for place in at)
    step = field.attrs.get(f"{word}_step")
    return f"{word} {text} at x = {x}, y = {y}, depth {depth}" + (f", step {step}" if step else "")


def extremes_of(found: xarray.Dataset) -> dict[str, dict[str, Any]]:
    """Return the range of each quantity, and the place of the value that counts, for other programs."""
    return {
        str(name): {
            "units": field.attrs.get("units", ""),
            "range": [float(np.nanmin(field)), float(np.nanmax(field))],
            **{key: value for key, value in field.attrs.items() if key.startswith(("least", "largest"))},
        }
        for name, field in found.data_vars.items()
        if field.attrs.get("units") != "rad"
    }
