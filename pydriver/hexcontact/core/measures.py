"""Measures of a state and of a history by the core: areas, energy, sizes of zones, turns, expected errors.

Lattice arrays have shape (n_row, n_col); the neighbors of node (j, i) are (j, i+-1), (j+-1, i), (j+-1, i-+1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Array, Mask
from ..variables import VARIABLES
from . import flat
from .contact import Contact, NormalSolution
from .friction import ContactState

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


def measures(contact: Contact, solution: NormalSolution) -> dict[str, float]:
    """Return the measures of a state in the load history, by the names of `hexcontact.variables`."""
    frictional, periodic = isinstance(solution, ContactState), contact.lattice.periodic
    found = (flat.measure_friction if frictional else flat.measure_pressure)(contact, solution)
    known = {name: (value, VARIABLES[name]) for name, value in found._asdict().items()}
    return {
        name: value
        for name, (value, variable) in known.items()
        if (frictional or not variable.frictional)
        # a window that repeats has no edges, and no place of a zone
        and not (periodic and math.isnan(value) and not variable.required)
    }


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
