"""Estimates of the distance from the limit of vanishing spacing, by solutions on several lattices.

The lattice is refined by the square root of two from solution to solution. The difference of a solution and
the limit has two parts: a trend with the spacing, and a scatter, since the contact lies differently on every
lattice. The scatter is often the larger part. It is measured at the least cost on shifted copies of a coarser
lattice: of the same spacing, with another origin. The core fits both parts to the last solutions, for every
scalar of the history and every load step (fortran/path/discretization_error.f90).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.measures import limits_of_error, unresolved_slip_zones
from ..problem.loads import LoadStep
from ..result.journal import Solution
from ..variables import ESTIMATED, LOADS, VARIABLES

History = Mapping[str, Any]

LEVELS_FITTED = 4  # the finest ones, with their shifted copies

JUDGED = ("max_pressure", "contact_area_fit", "stick_area_fit", "approach")
"""Quantities that have the target."""

_ZONES = ("contact_area_fit", "stick_area_fit", "max_traction", "max_pressure")
"""Quantities of a load step that show the width of its slip zone."""


def finest(solutions: Sequence[Solution]) -> Solution:
    """Return the solution on the finest lattice, which is the result."""
    return max(solutions, key=lambda solution: (solution.level, -solution.copy))


def driven(target: LoadStep) -> set[str]:
    """Return the prescribed loads and motions of a load step, which have no error."""
    motions = zip(LOADS.values(), target.targets, strict=True)
    return {pair[motion.control == "displacement"] for pair, motion in motions}


def estimated_errors(solutions: Sequence[Solution], targets: Sequence[LoadStep]) -> list[dict[str, float]]:
    """Estimate the discretization error of every scalar of the finest solution, by load step.

    The error has the unit of its quantity: 0 if that is prescribed, NaN without a value on one of the
    lattices. Three levels and shifted copies are needed, else ValueError.
    """
    best = finest(solutions)
    used = [s for s in solutions if s.level > best.level - LEVELS_FITTED]
    used.sort(key=lambda solution: (-solution.level, solution.copy))
    names = [name for name in ESTIMATED if name in best.histories[0]]
    values = np.array([[[h[name] for name in names] for h in s.histories] for s in used], dtype=float)
    spacings = np.array([s.spacing for s in used]) / best.spacing
    rough = np.tile([VARIABLES[name].rough for name in names], len(targets))
    narrow: NDArray[np.bool_] = np.zeros(values.shape[1:], dtype=bool)
    if set(_ZONES) <= set(names):
        columns = (values[0][:, names.index(name)] for name in _ZONES)
        zones = unresolved_slip_zones(best.spacing, *columns)
        narrow = np.outer(zones, [VARIABLES[name].slip_zone for name in names])
    flat = values.reshape(len(used), -1)
    errors = limits_of_error(spacings, flat, rough, narrow.ravel()).reshape(values.shape[1:])
    found = []
    for target, row in zip(targets, errors, strict=True):
        prescribed = driven(target)
        found.append({
            name: 0.0 if name in prescribed else float(error) for name, error in zip(names, row, strict=True)
        })  # fmt: skip
    return found


def relative_errors(histories: Sequence[History], errors: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the largest error of each of the `JUDGED` quantities, over its largest value."""
    found = {}
    for name in JUDGED:
        if name in errors[0]:
            largest = max(abs(float(history[name])) for history in histories)
            error = float(np.max([step[name] for step in errors]))  # NaN if one is
            found[name] = error / largest if largest else math.inf if error else 0.0
    return found


def changes(coarse: Solution, fine: Solution, targets: Sequence[LoadStep]) -> dict[str, float]:
    """Return the relative differences of two solutions, lower bounds of `relative_errors`."""
    names = [name for name in JUDGED if name in fine.histories[0]]
    differences = [
        {name: 0.0 if name in driven(target) else abs(float(one[name]) - float(two[name])) for name in names}
        for target, one, two in zip(targets, coarse.histories, fine.histories, strict=True)
    ]
    return relative_errors(fine.histories, differences)


def worst(relative: Mapping[str, float]) -> tuple[str, float]:
    """Return the quantity with the largest error, and the error."""
    name = max(relative, key=lambda name: relative[name] if relative[name] == relative[name] else math.inf)
    return name, relative[name]
