"""A path through the load history, and then through cycles that wear the surfaces: ``[wear]``.

Of many equal cycles one is solved on the worn gap, and its end is recorded as a load step. The dissipated
energy of the cycle, by its Archard wear and the number of cycles in the jump, gives the wear up to the next
solved cycle; see docs/theory/wear.md.
"""

from __future__ import annotations

import dataclasses
import logging
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array
from ..core.friction import MOTION, ContactState
from ..core.lattice import Lattice
from ..core.steps import (
    FAILED,
    LIMITED,
    REJECTED,
    Change,
    StepControl,
    change_by_jump,
    energy_of_jump,
    expected_end,
    remember_end,
    wear_left,
    worn,
)
from ..errors import ConvergenceError, DeckError, PathWarning
from ..problem.loads import LoadStep
from ..problem.problem import Problem
from ..result.history_words import unclosed_cycle
from ..result.step import Step
from ..variables import LOADS, RESIDUALS, WORN
from .adaptive import GivenPath
from .window import FrictionWindow, state_of

LABEL = "wear"  # of the cycles that wear, which are no part of the load history
MOST_UNWORN = 50  # cycles on unworn surfaces, until they close
_SUMMED = ("sweeps", "cuts", "operator_applications")  # of the load steps of a cycle
_SAFETY = 2.0  # errors of the depth are at most 1.7 times its change by jumps of half the size, as measured
_LEAST = 1e-12  # smallest jump, as a share of all cycles


@dataclass(frozen=True)
class _Cycle:
    """A solved cycle, and the jump to it.

    `state` is its end, with the slip and dissipation of all cycles before it; `energy` (J/m2), `path` (m) and
    `spent` (J) are of the cycle alone. `change` (m) is the sum of the changes of the depth by jumps of half
    the size. Between two jumps, `until` is the end of the second jump and `ahead` its wear energy.
    """

    lattice: Lattice
    state: ContactState
    worn: Array
    energy: Array
    path: Array
    spent: float
    change: Array
    cycles: float = 0.0
    until: float = 0.0
    ahead: Array | None = None
    about: dict[str, float] = dataclasses.field(default_factory=dict)

    def on(self, window: FrictionWindow) -> _Cycle:
        """Return the cycle on a window that may have grown since."""
        if self.lattice == window.lattice:
            return self
        fields: dict[str, Any] = {
            name: self.lattice.embed(getattr(self, name), window.lattice, 0.0)
            for name in ("worn", "energy", "path", "change", "ahead")
            if getattr(self, name) is not None
        }
        fields["state"] = window.carried(self.state, self.lattice)
        return dataclasses.replace(self, lattice=window.lattice, **fields)


class _Ends:
    """Last solution of each load step of the cycle and its rate per cycle, used as initial guess.

    Single precision is enough for an initial guess. The first load step is the one onto the worn gap.
    """

    def __init__(self, lattice: Lattice, count: int) -> None:
        self.lattice = lattice
        # tractions and their rates per cycle; motions and their rates; cycles at that time, none yet
        self.fields = np.zeros((count, 2, 3, *lattice.shape), dtype=np.float32)
        self.numbers = np.zeros((count, 2, len(MOTION)))
        self.cycles = np.full(count, -1.0)
        self.before: tuple[Array, Array] | None = None  # pressure and motions expected of the last load step

    def guess(self, step: int, cycles: float, state: ContactState) -> tuple[Array, Array] | None:
        """Return the initial guess (tractions, motions) of a load step from `state`; None at first.

        Pressure and motions are those of `state` plus the change between the two extrapolations, so an error
        common to both extrapolations cancels. The shear traction, which turns round in a cycle, is
        extrapolated.
        """
        before, self.before = self.before, None
        if self.cycles[step] < 0.0:
            return None
        ahead, last = cycles - self.cycles[step], self.fields[step]
        motions = self.numbers[step, 0] + ahead * self.numbers[step, 1]
        if before is None or not step:
            tractions, pressure = expected_end(last, ahead)
            self.before = pressure, motions
            return tractions, motions
        tractions, pressure = expected_end(last, ahead, before[0], state.pressure)
        self.before = pressure, motions
        return tractions, _motions(state) + (motions - before[1])

    def found(self, step: int, cycles: float, state: ContactState) -> None:
        """Store the end of a load step, and its rate per cycle."""
        passed = cycles - self.cycles[step] if self.cycles[step] >= 0.0 else 0.0
        remember_end(state, passed, self.fields[step])
        known, motions = self.numbers[step], _motions(state)
        known[1] = (motions - known[0]) / passed if passed else 0.0
        known[0] = motions
        self.cycles[step] = cycles

    @classmethod
    def from_record(cls, step: Step, count: int) -> _Ends:
        """Read them from the record of a step; without them the next cycle starts as the first one."""
        ends = cls(step.lattice, count)
        if step.companion:
            ends.cycles, ends.numbers = (
                np.array(step.control[f"end_{name}"]) for name in ("cycles", "numbers")
            )
            for place in np.flatnonzero(ends.cycles >= 0.0):
                ends.fields[place] = step.companion[f"end_{place}"]
        return ends


class WearPath(GivenPath):
    """A path through given load steps, and cycles that wear the surfaces."""

    window: FrictionWindow

    def __init__(self, case: Problem, window: FrictionWindow, before: Sequence[Step]) -> None:
        super().__init__(case, window, before)
        assert case.deck.wear is not None
        self._wear, self._number = case.deck.wear, len(before)
        self._size, self._started = StepControl(_LEAST), time.perf_counter()
        self._ends = _Ends(window.lattice, 1 + len(case.cycle))
        self._tolerance = case.deck.wear.cycle_tolerance(case.solver.tolerance)
        self._last = before[-1] if self._number > len(case.load_steps) else None
        # number of unworn cycles, and the share by which their wear may still change
        self._unworn, self._left = 0, 0.0

    def steps(self, state: Any, target: LoadStep, begun: Mapping[str, float]) -> Iterator[tuple[Step, Any]]:
        """Solve a load step before the first cycle that wears."""
        for step, reached in super().steps(state, target, begun):
            self._number += 1
            yield self._placed(step, 0.0), reached

    def after(self, state: Any) -> Iterator[Step]:
        """Solve the cycles that wear the surfaces, from the end of the load history or of the last cycle."""
        self._started = time.perf_counter()
        if self._last is None:
            zero = np.zeros(self.window.lattice.shape)
            unworn = _Cycle(self.window.lattice, state, zero, zero, zero, 0.0, zero)
            cycle = self._closed(unworn)
            self._begin_size(cycle)
            yield self._recorded(cycle, state)
        else:
            cycle = self._restored(self._last)
        while cycle.cycles < self._wear.cycles:
            before = cycle
            cycle = self._next(before)
            yield self._recorded(cycle, before.on(self.window).state)

    # --- jumps --------------------------------------------------------------------------------------------

    def _next(self, cycle: _Cycle) -> _Cycle:
        """Return the next solved cycle: after a given jump, or after one that is small enough."""
        if cycle.ahead is not None:
            return self._solved(cycle, cycle.until, cycle.ahead)
        total = float(self._wear.cycles)
        if not isinstance(self._wear.jump, str):
            left = total - cycle.cycles
            if left <= self._wear.jump:
                return self._solved(cycle, total, self._ahead(cycle, left))
            until = cycle.cycles + min(2.0 * self._wear.jump, left)
            return self._halfway(cycle, until)[1]
        attempt = self._size.first_attempt(cycle.cycles / total, 1.0)
        while True:
            try:
                change, after = self._halfway(cycle, attempt.end * total)
            except ConvergenceError:
                if self._size.judge(attempt, None, self._wear.tolerance) == FAILED:
                    raise
                continue
            verdict = self._size.judge(attempt, change, self._wear.tolerance)
            if verdict != REJECTED:
                break
        self._size.accept(attempt, change, self._wear.tolerance, verdict)
        about = {"rejected_steps": attempt.rejected, "step_limited": int(verdict == LIMITED)}
        return dataclasses.replace(after, about=after.about | about)

    def _halfway(self, cycle: _Cycle, until: float) -> tuple[Change, _Cycle]:
        """Return the change by the size of the jumps, and the cycle between two jumps with the second one."""
        jump, cycle = 0.5 * (until - cycle.cycles), cycle.on(self.window)
        first, both = (self._ahead(cycle, times * jump) for times in (1.0, 2.0))
        after = self._solved(cycle, cycle.cycles + jump, first)
        one, two = (np.asarray(cycle.lattice.embed(each, after.lattice, 0.0)) for each in (first, both))
        energies = one, self._ahead(after, jump), two
        change, slower, second = self._change(cycle, energies, after.path, jump)
        return change, dataclasses.replace(after, change=after.change + slower, until=until, ahead=second)

    def _ahead(self, cycle: _Cycle, jump: float) -> Array:
        """Return the wear energy of a jump, with the pressure at its end."""
        cycle, window = cycle.on(self.window), self.window
        given = window.lattice, self.case.solved_pair, self.case.interface, window.candidate
        by_load = self.case.load_steps[-1].z.control == "force"
        worn_by = window.friction, self._wear.coefficient, (cycle.energy, cycle.path), cycle.state
        return energy_of_jump(*given, *worn_by, by_load, jump, self._tolerance)

    def _change(
        self, cycle: _Cycle, energies: tuple[Array, Array, Array], path: Array, jump: float
    ) -> tuple[Change, Array, Array]:
        """Compare two jumps with one of double length (Richardson)."""
        given = self.window.lattice, self.case.pair, self.window.friction, self._wear.coefficient
        return change_by_jump(*given, energies, path, jump, float(cycle.state.pressure.max()))

    def _begin_size(self, cycle: _Cycle) -> None:
        """Choose the first jump: each half wears as much as the largest pressure indents a node."""
        none = 0.0 * cycle.energy
        change, *_ = self._change(cycle, (none, cycle.energy, none), cycle.path, 1.0)
        self._size.begin_with(min(1.0, 1.0 / max(change.added * self._wear.cycles, 1e-300)))

    # --- cycles -------------------------------------------------------------------------------------------

    def _closed(self, start: _Cycle) -> _Cycle:
        """Return the unworn cycle, repeated until its wear is converged."""
        energies, tolerance = list[Array](), self._wear.tolerance
        # residuals are those of the load history: larger ones would decide whether it is closed
        usual, self._tolerance = self._tolerance, self.case.solver.tolerance
        for self._unworn in range(1, MOST_UNWORN + 1):
            cycle = self._solved(start, 0.0, np.zeros(start.lattice.shape))
            if not cycle.energy.any():
                label = self._wear.cycle
                raise DeckError(f'wear.cycle = "{label}": no node slips in this cycle, so that nothing wears')
            energies = [np.asarray(start.lattice.embed(each, cycle.lattice, 0.0)) for each in energies[-2:]]
            energies.append(cycle.energy)
            begun, window = start.on(self.window).state, self.window
            self._left = wear_left(window.friction, energies, begun, cycle.state)
            sums = {name: cycle.about[name] + start.about.get(name, 0) for name in _SUMMED}
            start = dataclasses.replace(cycle, about=cycle.about | sums)
            if self._left <= tolerance:
                break
        else:
            found = {"unworn_cycles": self._unworn, "unworn_cycle_change": self._left}
            words = unclosed_cycle(found, tolerance)
            self.window.listener.said("unclosed", level=logging.WARNING, warning=words)
            warnings.warn(words, PathWarning, stacklevel=2)
        self._tolerance = usual
        return start

    def _solved(self, cycle: _Cycle, until: float, worn_by: Array) -> _Cycle:
        """Wear the surfaces by an energy per cycle until `until` cycles, and solve the cycle there."""
        cycle, jump = cycle.on(self.window), until - cycle.cycles
        depth, *_ = self._worn(cycle, worn_by, jump)
        window = self.window
        window.wear(depth)
        slipped = cycle.state.accumulated_slip + jump * cycle.path
        density = cycle.state.dissipation_density + jump * worn_by
        spent = cycle.state.dissipated_energy + jump * window.lattice.cell_area * float(worn_by.sum())
        missed = cycle.state.dissipated_energy_path_error
        state = self._unspent(cycle.state)
        *_, last = self.case.load_steps
        # the loads at the end of the cycle on the new gap; this slip is no part of the cycle
        state = self._unspent(self._through(state, [last], until)[0])
        state, about = self._through(state, self.case.cycle, until, first=1)
        energy, path = state.dissipation_density, state.accumulated_slip
        spread = (window.lattice.embed(values, self.window.lattice, 0.0) for values in (slipped, density))
        sums: dict[str, Any] = dict(zip(("accumulated_slip", "dissipation_density"), spread, strict=True))
        return _Cycle(
            self.window.lattice,
            dataclasses.replace(
                state,
                **sums,
                dissipated_energy=spent,
                dissipated_energy_path_error=missed + jump * state.dissipated_energy_path_error,
            ),
            np.asarray(self.window.worn),
            energy,
            path,
            state.dissipated_energy,
            np.asarray(window.lattice.embed(cycle.change, self.window.lattice, 0.0)),
            until,
            about=about,
        )

    def _worn(self, cycle: _Cycle, energy: Array, jump: float) -> tuple[Array, float, float]:
        """Return depth, volume and largest depth after a jump with an energy per cycle."""
        window = self.window
        return worn(window.lattice, window.friction, self._wear.coefficient, energy, jump, cycle.worn)

    def _through(
        self, state: ContactState, targets: Sequence[LoadStep], cycles: float, first: int = 0
    ) -> tuple[ContactState, dict[str, float]]:
        """Return the end of some load steps, with their work and their largest residuals."""
        segment, begun, about = -1, {}, dict[str, float]()
        for place, target in enumerate(targets, first):
            if target.segment != segment:
                segment, begun = target.segment, _standing(state)
            numbered = dataclasses.replace(target, index=self._number)
            how = {"guess": self._ends.guess(place, cycles, state), "tolerance": self._tolerance}
            _, state = self._reached(state, numbered, target.values(begun), **how)
            if self._ends.lattice != self.window.lattice:
                self._ends = _Ends(self.window.lattice, 1 + len(self.case.cycle))
            self._ends.found(place, cycles, state)
            for name in _SUMMED:
                about[name] = about.get(name, 0) + getattr(state, name)
            for name in RESIDUALS.values():
                about[name] = max(about.get(name, 0.0), getattr(state, name))
        return state, about

    @staticmethod
    def _unspent(state: ContactState) -> ContactState:
        """Return a state with zero slip path and dissipated energy."""
        zero = np.zeros(state.pressure.shape)
        return dataclasses.replace(
            state,
            accumulated_slip=zero,
            dissipation_density=zero,
            dissipated_energy=0.0,
            dissipated_energy_path_error=0.0,
        )

    # --- records ------------------------------------------------------------------------------------------

    def _recorded(self, cycle: _Cycle, before: ContactState) -> Step:
        """Return a cycle as a load step."""
        *_, last = self.case.load_steps
        target = dataclasses.replace(last, index=self._number, segment=last.segment + 1, label=LABEL)
        step = self.window.step(target, cycle.state, before, time.perf_counter())
        _, volume, deepest = self._worn(cycle, cycle.energy, 0.0)
        history = {
            **step.history,
            **cycle.about,
            "wear_cycles": cycle.cycles,
            "wear_volume": volume,
            "max_worn_depth": deepest,
            "worn_depth_step_error": _SAFETY * float(abs(cycle.change).max()) + self._left * deepest,
            "unworn_cycles": self._unworn,
            "unworn_cycle_change": self._left,
            "seconds": time.perf_counter() - self._started,
            "cycle_dissipated_energy": cycle.spent,
        }
        fields = {
            **step.fields,
            "worn_depth_step_change": cycle.change,
            "cycle_dissipation_density": cycle.energy,
            "cycle_slip_amplitude": 0.25 * cycle.path,
        }
        self._number, self._started = self._number + 1, time.perf_counter()
        step = dataclasses.replace(step, history=history, fields=fields)
        return self._placed(step, cycle.cycles / self._wear.cycles, cycle)

    def _placed(self, step: Step, done: float, cycle: _Cycle | None = None) -> Step:
        """Return a load step with the restart data of the next cycle."""
        count = len(self.case.load_steps)
        known = np.flatnonzero(self._ends.cycles >= 0.0)
        beside = {f"end_{place}": self._ends.fields[place] for place in known}
        if cycle is not None and cycle.ahead is not None:
            beside["ahead"] = cycle.ahead
        control = {
            "end_cycles": self._ends.cycles.tolist(),
            "end_numbers": self._ends.numbers.tolist(),
            "position": min(self._number, count),
            "fraction": done,
            "load_steps": count,
            "done": done,
            "chooser": self._size.record,
            "until": 0.0 if cycle is None else cycle.until,
        }
        return dataclasses.replace(step, control=control, companion=beside, load_fraction=done)

    def _restored(self, step: Step) -> _Cycle:
        """Return the last cycle of a resumed run."""
        self._size = StepControl.from_record(step.control["chooser"], _LEAST)
        self._ends = _Ends.from_record(step, 1 + len(self.case.cycle))
        self._unworn = int(step.history["unworn_cycles"])
        self._left = float(step.history["unworn_cycle_change"])
        fields = {name: np.array(step.fields[name]) for name in WORN}
        return _Cycle(
            step.lattice,
            state_of(step),
            fields["worn_depth"],
            fields["cycle_dissipation_density"],
            4.0 * fields["cycle_slip_amplitude"],
            float(step.history["cycle_dissipated_energy"]),
            fields["worn_depth_step_change"],
            float(step.history["wear_cycles"]),
            float(step.control["until"]),
            np.array(step.companion["ahead"]) if "ahead" in step.companion else None,
        )


def without_ends(step: Step) -> Step:
    """Return a step without restart data."""
    control = {name: value for name, value in step.control.items() if name != "end_cycles"}
    return dataclasses.replace(step, companion={}, control=control)


def lacks_ends(step: Step) -> bool:
    """Test whether a record has lost its restart data, which the last two of a run keep."""
    return max(step.control.get("end_cycles", [-1.0])) >= 0.0 and not step.companion


def _motions(state: ContactState) -> Array:
    """Return the motions of a state."""
    return np.array([getattr(state, name) for name in MOTION])


def _standing(state: ContactState) -> dict[str, float]:
    """Return the loads and motions of a state by the keys of the deck."""
    return {name: float(getattr(state, name)) for pair in LOADS.values() for name in pair}
