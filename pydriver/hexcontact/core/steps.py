"""Size of adaptive load steps, by the core (fortran/path: step_control, step_error)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, Mask
from . import _core
from .calls import called
from .contact import ElasticPair, Interface, checked_interface
from .friction import ContactState, FrictionLaw
from .lattice import Lattice

_api = _core.hc_f2py_steps
_wear = _core.hc_f2py_wear

REJECTED, ACCEPTED, LIMITED, FAILED = range(4)
"""Verdicts on an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones do
not help; the smallest one did not converge."""

LEAST = 1e-3
"""Smallest adaptive load step, as a part of its segment."""

_FIELDS = (
    "pressure",
    "gap",
    "traction_x",
    "traction_y",
    "relative_displacement_x",
    "relative_displacement_y",
)
_TRACTIONS = ("pressure", "traction_x", "traction_y")


class Change(NamedTuple):
    """Changes by halving a load step."""

    stick: float = 0.0
    traction: float = 0.0
    added: float = 0.0
    lattice: float = 0.0
    gain: float = 1.0
    spent: float = 0.0
    turned: float = 0.0


def change_by_halving(
    lattice: Lattice,
    candidate: Mask,
    friction: FrictionLaw,
    states: Sequence[ContactState | None],
    area: float,
) -> Change:
    """Compare the two solutions at the end of a load step."""
    fields = np.zeros((len(states), len(_FIELDS), *lattice.shape))
    zones = np.zeros((len(states), *lattice.shape), dtype=np.int32)
    for number, state in enumerate(states):
        if state is not None:
            for field, name in zip(fields[number], _FIELDS, strict=True):
                field[:] = getattr(state, name)
            zones[number] = state.zone
    change = called(
        _api.change_by_halving,
        lattice.basis.T,
        candidate.T,
        *friction.as_arguments(),
        fields.T,
        zones.T,
        area,
    )
    return Change(*change.tolist())


def is_shear_free(state: ContactState | None) -> bool:
    """Test whether a state has no shear tractions: a path of such states has no history."""
    if state is None:
        return True
    return bool(_api.is_shear_free(state.pressure.T, state.traction_x.T, state.traction_y.T))


def worn(
    lattice: Lattice, friction: FrictionLaw, coefficient: float, energy: Array, cycles: float, depth: Array
) -> tuple[Array, float, float]:
    """Wear the surfaces by cycles that are all alike: docs/theory/wear.md, (V3)."""
    mu = np.broadcast_to(friction.coefficient, lattice.shape)
    found = _wear.wear_of_cycles(energy.T, coefficient, mu.T, cycles, lattice.cell_area, depth.T)
    return np.ascontiguousarray(found[0].T), float(found[1]), float(found[2])


def wear_left(
    friction: FrictionLaw, energies: Sequence[Array], before: ContactState, after: ContactState
) -> float:
    """Bound the change of the wear of a cycle by further repetitions: docs/theory/wear.md, (V9)."""
    mu = np.broadcast_to(friction.coefficient, after.pressure.shape)
    tractions = np.array([[state.traction_x, state.traction_y] for state in (before, after)])
    return float(_wear.wear_left_open(np.array(energies).T, tractions.T, after.pressure.T, mu.T))


def expected_end(
    last: Array, ahead: float, before: Array | None = None, pressure: Array | None = None
) -> tuple[Array, Array]:
    """Expect the end of a load step of the next cycle of wear, to start it from."""
    shape = last.shape[2:]
    follows = before is not None and pressure is not None
    expected: Array = np.zeros(shape, np.float32) if before is None else before.copy()
    known = np.zeros(shape) if pressure is None else pressure
    columns, values = _columns(last), expected.reshape(-1)
    tractions = _wear.expected_end(columns, ahead, follows, known.ravel(), values)
    return np.asarray(tractions.T.reshape(3, *shape)), expected


def remember_end(state: ContactState, passed: float, last: Array) -> None:
    """Put the tractions of a state, and their change a cycle since `passed` cycles, in place of `last`."""
    tractions = (getattr(state, name).ravel() for name in _TRACTIONS)
    _wear.remembered_end(*tractions, passed, _columns(last))


def _columns(fields: Array) -> Array:
    """Return fields as Fortran has them, in the same memory."""
    return fields.reshape(*fields.shape[:-2], -1).T


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
    """Return the energy of a cycle (J/m2) by which a jump wears: docs/theory/wear.md, (V4)."""
    mu = np.broadcast_to(friction.coefficient, lattice.shape)
    fields = *cycle, state.pressure, np.where(candidate, state.gap, 0.0)
    ahead = called(
        _wear.energy_of_jump,
        *(lattice.basis.T, pair.as_array(), checked_interface(interface)),
        *(field.T for field in fields),
        *(candidate.T, mu.T, by_load, coefficient, cycles, tolerance),
    )
    return np.ascontiguousarray(ahead.T)


def change_by_jump(
    lattice: Lattice,
    pair: ElasticPair,
    friction: FrictionLaw,
    coefficient: float,
    energies: tuple[Array, Array, Array],
    path: Array,
    cycles: float,
    max_pressure: float,
) -> tuple[Change, Array, Array]:
    """Compare two jumps with one of both: docs/theory/wear.md, (V5) and (V6)."""
    mu = np.broadcast_to(friction.coefficient, lattice.shape)
    change, slower, second = called(
        _wear.change_by_jump,
        *(lattice.basis.T, pair.as_array(), np.array(energies).T, path.T, coefficient, mu.T),
        *(cycles, max_pressure),
    )
    return Change(*change.tolist()), np.ascontiguousarray(slower.T), np.ascontiguousarray(second.T)


class Attempt:
    """One attempt at a load step, in parts of its segment."""

    def __init__(self, numbers: Array) -> None:
        self.numbers = numbers

    @property
    def end(self) -> float:
        """Fraction of the segment at its end."""
        return float(self.numbers[1])

    @property
    def rejected(self) -> int:
        """Number of attempts before it."""
        return int(self.numbers[2])


class StepControl:
    """Control of load steps: the size of the next one, and the changes by the last ones."""

    def __init__(self, least: float = LEAST) -> None:
        self._numbers = np.array([1.0, 0.5, *[0.0] * 6])
        self._least = least

    @classmethod
    def from_record(cls, record: Mapping[str, Any], least: float = LEAST) -> StepControl:
        """Return the control from the record of a step."""
        control, past = cls(least), record["memory"]
        names, energies = ("size", "first", "stick", "traction"), (past[name] for name in ("spent", "turned"))
        control._numbers[:] = [*(record[name] for name in names), past["stick"], past["traction"], *energies]
        return control

    @property
    def record(self) -> dict[str, Any]:
        """The control in the record of a step."""
        size, first, stick, traction, *past = self._numbers.tolist()
        memory = dict(zip(("stick", "traction", "spent", "turned"), past, strict=True))
        return {"size": size, "first": first, "stick": stick, "traction": traction, "memory": memory}

    def begin_with(self, size: float) -> None:
        """Set the first size of a segment, as a part of it."""
        self._numbers[1] = 0.5 * size  # the core doubles that of the segment before

    def forget(self) -> None:
        """Reset the changes, as after a load step of given size."""
        self._numbers[2:] = 0.0

    def first_attempt(self, fraction: float, largest: float) -> Attempt:
        """Return the first attempt at a load step that begins at a fraction of its segment."""
        return Attempt(_api.first_attempt(self._numbers, self._least, fraction, largest))

    def judge(self, attempt: Attempt, change: Change | None, tolerance: float) -> int:
        """Return the verdict on an attempt (None: it did not converge); a rejected one becomes the next."""
        known = change is not None
        given = attempt.numbers, known, change or Change(), tolerance
        return int(_api.decide_attempt(self._numbers, self._least, *given))

    def accept(self, attempt: Attempt, change: Change, tolerance: float, verdict: int) -> tuple[float, float]:
        """Accept an attempt; return bounds on the errors of stick area and tractions, both as shares."""
        given = attempt.numbers, change, tolerance, verdict
        bounds = _api.accept_attempt(self._numbers, self._least, *given)
        return float(bounds[0]), float(bounds[1])
