"""Size of adaptive load steps, as the core decides it (fortran/path: step_control, step_error)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _core
from .contact import raise_for
from .friction import ContactState
from .lattice import Lattice

_api = _core.hc_f2py_steps

REJECTED, ACCEPTED, LIMITED, FAILED = range(4)
"""What becomes of an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones
are of no use; it did not converge, and is the smallest there is."""

_FIELDS = ("pressure", "gap", "traction_x", "traction_y")


class Change(NamedTuple):
    """What the halves of a load step change.

    Attributes
    ----------
    stick : float
        Change of the stick area, as a share of the largest contact area.
    traction : float
        Change of the shear tractions, as a share of what friction can carry.
    added : float
        The part of `traction` that this load step added.
    lattice : float
        How far entering rings of nodes may move the stick area, whatever the steps; a share, too.
    gain : float
        How much the stick area changes with the tractions, both as shares, during the second half.
    """

    stick: float = 0.0
    traction: float = 0.0
    added: float = 0.0
    lattice: float = 0.0
    gain: float = 1.0


def change_by_halving(
    lattice: Lattice,
    candidate: NDArray[np.bool_],
    friction_coefficient: float,
    states: Sequence[ContactState | None],
    area: float,
) -> Change:
    """Compare the two solutions at the end of a load step.

    Parameters
    ----------
    lattice : Lattice
        The window of all states.
    candidate : ndarray of bool, (n_row, n_col)
        Nodes that can touch.
    friction_coefficient : float
        Coefficient of friction; ``inf``: no slip.
    states : sequence of ContactState or None
        The end of the path in whole steps, the middle and the end of that in halves, and both paths at the
        beginning of the step (None before the first load).
    area : float
        Largest contact area of the history (m2).
    """
    fields = np.zeros((len(states), len(_FIELDS), *lattice.shape))
    zones = np.zeros((len(states), *lattice.shape), dtype=np.int32)
    for number, state in enumerate(states):
        if state is not None:
            for field, name in zip(fields[number], _FIELDS, strict=True):
                field[:] = getattr(state, name)
            zones[number] = state.zone
    change, code, message = _api.change_by_halving(
        lattice.basis.T,
        candidate.T,
        min(friction_coefficient, np.finfo(float).max),
        fields.T,
        zones.T,
        area,
    )
    raise_for(code, message)
    return Change(*change.tolist())


def is_shear_free(state: ContactState | None) -> bool:
    """Tell whether a state has no shear tractions: a path of such states has no history."""
    if state is None:
        return True
    return bool(_api.is_shear_free(state.pressure.T, state.traction_x.T, state.traction_y.T))


class Attempt:
    """One attempt at a load step, in parts of its segment."""

    def __init__(self, numbers: NDArray[np.float64]) -> None:
        self.numbers = numbers

    @property
    def begin(self) -> float:
        """Where it begins."""
        return float(self.numbers[0])

    @property
    def end(self) -> float:
        """Where it ends."""
        return float(self.numbers[1])

    @property
    def rejected(self) -> int:
        """Attempts before it."""
        return int(self.numbers[2])


class StepControl:
    """What decides about load steps: the size of the next one, and how much the last ones changed."""

    def __init__(self) -> None:
        self._numbers = np.array([1.0, 0.5, 0.0, 0.0, 0.0, 0.0])

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> StepControl:
        """Read it from the record of a step."""
        control, past = cls(), record["memory"]
        names = ("size", "first", "stick", "traction")
        control._numbers[:] = [*(record[name] for name in names), past["stick"], past["traction"]]
        return control

    @property
    def record(self) -> dict[str, Any]:
        """Return what the record of a step holds."""
        size, first, stick, traction, *past = self._numbers.tolist()
        memory = {"stick": past[0], "traction": past[1]}
        return {"size": size, "first": first, "stick": stick, "traction": traction, "memory": memory}

    def forget(self) -> None:
        """Forget the changes so far, as after a load step whose size was given."""
        self._numbers[2:] = 0.0

    def first_attempt(self, fraction: float, largest: float) -> Attempt:
        """Return the first attempt at a load step that begins at a fraction of its segment."""
        return Attempt(_api.first_attempt(self._numbers, fraction, largest))

    def judge(self, attempt: Attempt, change: Change | None, tolerance: float) -> int:
        """Return what becomes of an attempt (None: it did not converge); a rejected one becomes the next."""
        known = change is not None
        return int(_api.judge_attempt(self._numbers, attempt.numbers, known, change or Change(), tolerance))

    def accept(self, attempt: Attempt, change: Change, tolerance: float, verdict: int) -> float:
        """Take an attempt over; return the bound on the error of the stick area over the largest contact."""
        return float(_api.accept_attempt(self._numbers, attempt.numbers, change, tolerance, verdict))
