"""Measures of a load history by the core: half-axes, turns, cycles, directions, expected errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array, Mask
from . import flat

NO_VALUE = 0.65  # the largest expected error of a lattice: the quantity may be wrong altogether
ROUND = 0.97  # ratio of the half-axes of a contact from which it counts as a circle


def half_axes(history: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the half-axes (m) of the contact of a load step; None if it is a circle, or they are unknown."""
    major, minor = (float(history.get(f"contact_semi_{axis}", math.nan)) for axis in ("major", "minor"))
    return (major, minor) if minor < ROUND * major else None


def limits_of_error(
    spacings: Array, values: Array, rough: Mask | None = None, unresolved: Mask | None = None
) -> Array:
    """Estimate the error of values on the first, finest lattice: docs/theory/error_bars.md, (A1) to (A3).

    The values of a lattice are a row. `rough` quantities depend on a few nodes at the edge of a zone, so that
    an order of 1/2 is possible; `unresolved` ones on a slip zone narrower than the lattice resolves, so that
    still slower orders are.
    """
    none = np.zeros(values.shape[1], dtype=bool)
    masks = (none if mask is None else mask for mask in (rough, unresolved))
    return np.asarray(flat.limits_of_error(spacings, values.T, *masks))


def expected_entry_error(
    before: Array, after: Array, stick: float, load_ratio: float | None, goal: float
) -> tuple[float, float, float]:
    """Estimate the error of the shear tractions by nodes that enter a growing contact, (X3)-(X5).

    Its steps go from contact radii `before` to `after`; `stick` is mu/abs(beta), 0 if the materials are
    alike; `load_ratio` is Q/mu P of a tangential load that grows, too. Return the error as a share of all
    shear tractions, the number of steps as they count, and that for the goal.
    """
    ratio, most = -1.0 if load_ratio is None else load_ratio, np.finfo(float).max
    entry, steps, needed = flat.expected_entry_errors(before, after, min(stick, most), ratio, goal)
    return entry, steps, needed


def turning_points(values: Array) -> list[int]:
    """Return the indices in a history at which a quantity turns back, with its first and last extreme."""
    return [int(place) for place in np.flatnonzero(flat.turns_of_history(values))]


def cycles(motion: Array, load: Array) -> list[tuple[int, int, float]]:
    """Return the closed cycles of a load over its motion: docs/theory/load_path.md, (L3).

    Each has the indices of its first and last step in the history, and the area of its loop (J).
    """
    count, places, areas = flat.cycles_of_history(motion, load)
    steps = (places[:count] - 1).tolist()
    return [(first, last, float(area)) for (first, last), area in zip(steps, areas, strict=False)]


def line_of(load: Array, least: float, aside: float) -> tuple[float, float] | None:
    """Return the direction of the line on which tangential loads lie."""
    size = np.hypot(*load)
    largest = load[:, int(np.argmax(size))]
    if not size.max() > least:
        return None
    x, y = largest / size.max() * np.sign(largest[int(np.argmax(np.abs(largest)))])
    return (float(x), float(y)) if np.abs(x * load[1] - y * load[0]).max() <= aside else None
