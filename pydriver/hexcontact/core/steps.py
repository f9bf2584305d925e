"""Size of adaptive load steps, and wear, by the core (fortran/path: step_control, step_error, wear_jumps)."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..arrays import Array, Mask
from . import flat
from .contact import ElasticPair, Interface, checked_interface
from .flat import AdaptiveSteps as AdaptiveSteps
from .flat import Change as Change
from .flat import begin_step as begin_step
from .flat import change_by_jump as change_by_jump
from .flat import forget_changes as forget_changes
from .flat import new_steps as new_steps
from .flat import wear_left as wear_left
from .flat import worn as worn
from .friction import ContactState, FrictionLaw
from .lattice import Lattice

REJECTED, ACCEPTED, LIMITED, FAILED, OUTGROWN = range(5)
"""Verdicts on an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones do
not help; the smallest one did not converge; the contact reached the rim of its window."""

LEAST = 1e-3
"""Smallest adaptive load step, as a part of its segment."""

_NO_CHANGE = Change(0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)


def expected_end(
    last: Array, ahead: float, before: Array | None = None, pressure: Array | None = None
) -> tuple[Array, Array]:
    """Expect the end of a load step of the next cycle of wear, to start it from.

    `last` has the tractions when the load step was solved last, and their rates by cycle, in single
    precision; `before` and `pressure` are the pressures expected and solved at the end of the load step
    before. Return the tractions, and the pressure without the correction by the load step before.
    """
    shape = last.shape[2:]
    follows = before is not None and pressure is not None
    expected: Array = np.zeros(shape, np.float32) if before is None else before.copy()
    known = np.zeros(shape) if pressure is None else pressure
    tractions = flat.expected_end(_flattened(last), ahead, follows, known.ravel(), expected.reshape(-1))
    return np.asarray(tractions).reshape(3, *shape), expected


def remember_end(state: ContactState, passed: float, last: Array) -> None:
    """Put the tractions of a state, and their change a cycle since `passed` cycles, in place of `last`."""
    tractions = (field.ravel() for field in (state.pressure, state.traction_x, state.traction_y))
    flat.remembered_end(*tractions, passed, _flattened(last))


def _flattened(fields: Array) -> Array:
    """Return fields with one axis of nodes, in the same memory."""
    return fields.reshape(*fields.shape[:-2], -1)


def energy_of_jump(
    lattice: Lattice,
    pair: ElasticPair,
    interface: Interface,
    candidate: Mask,
    friction: FrictionLaw,
    coefficient: float,
    cycle: tuple[Array, Array],
    state: ContactState,
    by_load: bool,
    cycles: float,
    tolerance: float,
) -> Array:
    """Return the energy of a cycle (J/m2) by which a jump wears: docs/theory/wear.md, (V4).

    `cycle` has dissipated energy by area (J/m2) and path of slip (m) of the cycle before the jump, `state` is
    its end.
    """
    worn_by = candidate, friction, coefficient, *cycle, state, by_load, cycles, tolerance
    return np.asarray(flat.energy_of_jump(lattice, pair, checked_interface(interface), *worn_by))


Attempt = SimpleNamespace
"""An attempt at a load step: the numbers of `flat.Attempt`, such as its `end`."""


_CHOOSER = ("size", "first", "stick", "traction")
_MEMORY = {"stick": "past_stick", "traction": "past_traction", "spent": "spent", "turned": "turned"}


def record_of(steps: Any) -> dict[str, Any]:
    """Return the control of load steps in the record of a step."""
    memory = {name: getattr(steps, number) for name, number in _MEMORY.items()}
    return {**{name: getattr(steps, name) for name in _CHOOSER}, "memory": memory}


def restored(steps: Any, record: Mapping[str, Any]) -> Any:
    """Return the control of load steps from the record of a step."""
    memory = {number: record["memory"][name] for name, number in _MEMORY.items()}
    return steps._replace(**{name: record[name] for name in _CHOOSER}, **memory)


class StepControl:
    """Control of load steps: the size of the next one, and the changes by the last ones."""

    def __init__(self, least: float = LEAST) -> None:
        self._now = flat.StepControl(1.0, 0.5, *[0.0] * 6, least)

    @classmethod
    def from_record(cls, record: Mapping[str, Any], least: float = LEAST) -> StepControl:
        """Return the control from the record of a step."""
        control = cls(least)
        control._now = restored(control._now, record)
        return control

    @property
    def record(self) -> dict[str, Any]:
        """The control in the record of a step."""
        return record_of(self._now)

    def begin_with(self, size: float) -> None:
        """Set the first size of a segment, as a part of it."""
        self._now = self._now._replace(first=0.5 * size)  # the core doubles that of the segment before

    def first_attempt(self, fraction: float, largest: float) -> Attempt:
        """Return the first attempt at a load step that begins at a fraction of its segment."""
        self._now, attempt = flat.first_attempt(self._now, fraction, largest)
        return Attempt(**attempt._asdict())

    def judge(self, attempt: Attempt, change: Change | None, tolerance: float) -> int:
        """Return the verdict on an attempt (None: it did not converge); a rejected one becomes the next."""
        known = change is not None
        found, verdict = flat.decide_attempt(self._now, attempt, known, change or _NO_CHANGE, tolerance)
        vars(attempt).update(found._asdict())
        return int(verdict)

    def accept(self, attempt: Attempt, change: Change, tolerance: float, verdict: int) -> tuple[float, float]:
        """Accept an attempt; return bounds on the errors of stick area and tractions, both as shares."""
        self._now, stick, traction = flat.accept_attempt(self._now, attempt, change, tolerance, verdict)
        return stick, traction
