"""Where the quantities of a table are largest, and life is least."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.estimators import limits_of_error
from ..text import percent, quantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray

_LEAST = ("life",)  # quantities whose least value counts
_ALIKE = 1e-6  # share of a value within which others count as equal: the first of them is named
_SHALLOW = 2.0  # depth in spacings down to which a value depends on the few nodes next to an edge


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


def with_errors(
    found: xarray.Dataset, spacing: float, others: Sequence[tuple[float, xarray.Dataset]]
) -> None:
    """Give each quantity largest_error, life least_factor, by spacing and table of other lattices."""
    spacings = np.array([spacing, *(other for other, _ in others)]) / spacing
    for name, field in found.data_vars.items():
        word = "least" if name in _LEAST else "largest"
        if word not in field.attrs:
            continue
        values = np.array(
            [one[name].attrs.get(word, np.nan) for one in (found, *(other for _, other in others))]
        )
        rough = np.array([field.attrs[f"{word}_at"][2] < _SHALLOW * spacing])
        values = np.log(values) if name in _LEAST else values
        error = float(limits_of_error(spacings, values[:, None], rough)[0])
        field.attrs |= {"least_factor": float(np.exp(error))} if name in _LEAST else {"largest_error": error}


def _error_of(field: xarray.DataArray) -> str:
    """Return the estimated error of the value that counts in words; empty if the file has none."""
    attributes = field.attrs
    error = float(attributes.get("least_factor", attributes.get("largest_error", 0.0)))
    if not np.isfinite(error):
        return " with an unknown error"
    if "least_factor" in attributes:
        return f" within a factor of {error:.2g}"
    if not error:
        return ""
    share = error / max(abs(float(attributes["largest"])), np.finfo(float).tiny)
    return f" ± {percent(share) if share <= 1.0 else _worded(error, field)}"


def _worded(value: float, field: xarray.DataArray) -> str:
    units = str(field.attrs.get("units", "")).removesuffix("1")
    return quantity(value, units) if " " not in units else f"{quantity(value)} {units}"


def place_of(field: xarray.DataArray) -> str:
    """Return the value that counts and its place in words; empty if the file has none."""
    word = "least" if field.name in _LEAST else "largest"
    if (at := field.attrs.get(f"{word}_at")) is None:
        return ""
    text = _worded(float(field.attrs[word]), field) + _error_of(field)
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
