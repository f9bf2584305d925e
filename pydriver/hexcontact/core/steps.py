"""Paths in the core (fortran/path): load steps that it chooses, and cycles that wear the surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..arrays import Array
from ..variables import WORN
from . import flat
from .contact import ElasticPair
from .flat import AdaptiveSteps as AdaptiveSteps
from .flat import WearProgress as WearProgress
from .flat import WearSettings as WearSettings
from .flat import begin_step as begin_step
from .flat import forget_changes as forget_changes
from .flat import new_steps as new_steps
from .friction import ContactState, FrictionalContact
from .handles import Handle
from .lattice import Lattice

REJECTED, ACCEPTED, LIMITED, FAILED, OUTGROWN, PENDING = range(6)
"""Verdicts on an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones do
not help; the smallest one did not converge; the contact reached the rim of its window; it is not solved to
its end."""

AHEAD = "ahead"
"""Energy of a cycle by which the second of two jumps wears (J/m2), among the fields of a cycle."""

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

    def advance(self, contact: FrictionalContact) -> WearProgress:
        """Solve the next load step of a cycle."""
        progress: WearProgress = contact.called(flat.advance_wear, self)
        return progress

    def carry(self, contact: FrictionalContact, smaller: Lattice) -> None:
        """Go on with a contact on a larger window."""
        flat.carry_wear(contact, self, smaller.first, smaller.extent)

    def reached(self, contact: FrictionalContact) -> ContactState:
        """Return the end of the last cycle, or the solution that failed or reached the rim of the window."""
        return contact.solution(flat.state_of_wear(self))

    def fields(self, contact: FrictionalContact) -> dict[str, Array]:
        """Return the fields of the last cycle, with the energy of a second jump, `AHEAD`, 0 without one."""
        depth, change, energy, path, ahead = flat.fields_of_wear(self, *contact.own.extent)
        return dict(zip((*WORN, AHEAD), (depth, change, energy, 0.25 * path, ahead), strict=True))

    def restore(
        self, state: ContactState, fields: Mapping[str, Array], cycles: float, until: float, spent: float
    ) -> None:
        """Go on from a solved cycle: its fields as of `fields`, numbers as of `WearProgress`."""
        depth, change, energy, amplitude = (np.asarray(fields[name]) for name in WORN)
        ahead = fields.get(AHEAD)
        values = [depth, change, energy, 4.0 * amplitude, 0.0 * depth if ahead is None else ahead]
        flat.restore_wear(self, state, values, cycles, until, spent, ahead is not None)

    def restore_end(
        self, place: int, contact: FrictionalContact, cycles: float, motions: Array, tractions: Array
    ) -> None:
        """Set the last solution of a load step, from 1 on; see `end`."""
        flat.restore_wear_end(self, place, cycles, motions, tractions.reshape(2, 3, -1))

    def end(self, place: int, contact: FrictionalContact) -> tuple[float, Array, Array]:
        """Return the last solution of a load step: cycle (negative: none), motions, tractions."""
        cycles, motions, tractions = flat.wear_end(self, place, contact.own.size)
        return cycles, motions, np.asarray(tractions).reshape(2, 3, *contact.own.shape)
