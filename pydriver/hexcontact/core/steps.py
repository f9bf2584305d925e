"""Paths in the core (fortran/path): load steps that it chooses, and cycles that wear the surfaces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..arrays import Array
from . import flat
from .contact import ElasticPair
from .flat import AdaptiveSteps as AdaptiveSteps
from .flat import WearProgress as WearProgress
from .flat import WearSettings as WearSettings
from .flat import begin_step as begin_step
from .flat import forget_changes as forget_changes
from .flat import new_steps as new_steps
from .friction import ContactState
from .handles import Handle
from .lattice import Lattice

REJECTED, ACCEPTED, LIMITED, FAILED, OUTGROWN, PENDING = range(6)
"""Verdicts on an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones do
not help; the smallest one did not converge; the contact reached the rim of its window; it is not solved to
its end."""

LEAST = 1e-3
"""Smallest adaptive load step, as a part of its segment."""

_CHOOSER = ("size", "first", "stick", "traction")
_MEMORY = {"stick": "past_stick", "traction": "past_traction", "spent": "spent", "turned": "turned"}


def record_of(steps: Any) -> dict[str, Any]:
    """Return the control of load steps, or of jumps, in the record of a step."""
    memory = {name: getattr(steps, number) for name, number in _MEMORY.items()}
    return {**{name: getattr(steps, name) for name in _CHOOSER}, "memory": memory}


def restored(steps: Any, record: Mapping[str, Any]) -> Any:
    """Return the control of load steps, or of jumps, from the record of a step."""
    memory = {number: record["memory"][name] for name, number in _MEMORY.items()}
    return steps._replace(**{name: record[name] for name in _CHOOSER}, **memory)


class CyclesOfWear(Handle):
    """Cycles that wear the surfaces, from the end of a load history: fortran/path/wear_path.f90.

    A load step has the numbers of controls, values with bulk strains, shares of the values at the beginning
    of its segment that add to them, and the number of the segment. The first one is that onto the worn gap.
    """

    def __init__(
        self,
        settings: WearSettings,
        pair: ElasticPair,
        steps: Sequence[tuple[Sequence[int], Sequence[float], Sequence[float], int]],
        state: ContactState,
    ) -> None:
        self._create(flat.create_wear, settings, pair, *map(list, zip(*steps, strict=True)), state)

    def restore(
        self, state: ContactState, fields: Sequence[Array], cycles: float, until: float, spent: float
    ) -> None:
        """Go on from a solved cycle: its fields in the order of the core, numbers as of `WearProgress`."""
        between = len(fields) == 5
        values = [*fields, 0.0 * fields[0]][:5]
        flat.restore_wear(self, state, values, cycles, until, spent, between)

    def ends(self, count: int, lattice: Lattice) -> Iterator[tuple[float, Array, Array]]:
        """Yield the last solution of each load step: cycle (negative: none), motions, tractions."""
        for place in range(1, count + 1):
            cycles, motions, tractions = flat.wear_end(self, place, lattice.size)
            yield cycles, motions, np.asarray(tractions).reshape(2, 3, *lattice.shape)
