"""Paths through load steps that are given, or chosen on the way, ``steps = "auto"``.

What a chosen load step may change is bounded, and measured: it is solved as a whole and in two halves, on two
paths that never meet. The halves are recorded. What they change decides whether the step is taken, and how
large the next one is; see `hexcontact.core.steps`.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.steps import (
    FAILED,
    LIMITED,
    REJECTED,
    Attempt,
    Change,
    StepControl,
    change_by_halving,
    is_shear_free,
)
from ..problem.loads import LoadStep
from . import nonconvergence

if TYPE_CHECKING:
    from ..core.friction import ContactState
    from ..problem.problem import Problem
    from ..result.step import Step
    from .frictional import FrictionWindow


class _Rim(Exception):
    """The contact reached the rim of the window."""

    def __init__(self, solution: ContactState) -> None:
        super().__init__()
        self.solution = solution


@dataclass
class _Solved:
    """A load step that was solved as a whole and in halves."""

    whole: ContactState
    halves: ContactState
    change: Change


class GivenPath:
    """A path through load steps that are given.

    Parameters
    ----------
    case : Problem
        The problem.
    window : Window
        Window to start with.
    before : sequence of Step
        The steps that are solved already.

    Attributes
    ----------
    window : Window
        The present window.
    position : int
        Load step of the case that is at hand.
    """

    def __init__(self, case: Problem, window: Any, before: Sequence[Step]) -> None:
        self.case, self.window = case, window
        self.position = len(before)

    def steps(self, state: Any, target: LoadStep, begun: Mapping[str, float]) -> Iterator[tuple[Step, Any]]:
        """Solve a load step; one that reached the rim again on a larger window, from where it began.

        Parameters
        ----------
        state : state of the solver or None
            End of the last load step.
        target : LoadStep
            The load step.
        begun : mapping of str to float
            Loads and motions when its segment began.

        Yields
        ------
        step : Step
            The finished step.
        state : state of the solver
            Its end.
        """
        started, values = time.perf_counter(), target.values(begun)
        while self.window.outgrown(reached := self.window.advance(state, target, values)):
            smaller, self.window = self.window.lattice, self.window.grown(reached, target)
            state = self.window.carried(state, smaller)
        if not reached.converged:
            raise nonconvergence.error(self.case, self.window.lattice, reached, target, values)
        yield self.window.step(target, reached, state, started), reached


class AdaptivePath(GivenPath):
    """The two paths through a load history, and what chooses their load steps.

    Parameters
    ----------
    case : Problem
        The problem.
    window : FrictionWindow
        Window to start with.
    before : sequence of Step
        The steps that are solved already: heads, the last one with all its fields.

    Attributes
    ----------
    window : FrictionWindow
        The present window.
    position : int
        Load step of the case that is at hand.
    fraction : float
        How much of it is done.
    """

    def __init__(self, case: Problem, window: FrictionWindow, before: Sequence[Step]) -> None:
        super().__init__(case, window, ())
        self.fraction = 0.0
        self._number = len(before)
        self._before: ContactState | None = None  # the path in halves, where a load step begins
        self._work: dict[str, Any] = {}
        self._failed: Any = None  # solution, part and loads that did not converge
        self._size = StepControl()
        self._whole: ContactState | None = None  # the path in whole steps; None where both are one
        if before:
            control = before[-1].control
            self.position, self.fraction = int(control["position"]), float(control["fraction"])
            self._area = float(control["area"])
            self._size = StepControl.from_record(control["chooser"])
            if before[-1].companion:
                self._whole = _companion_state(before[-1])
        else:
            self._area = window.largest_contact_area()

    def _numbered(self, target: LoadStep) -> LoadStep:
        """Return a load step under the number that it has among those that are recorded."""
        return dataclasses.replace(target, index=self._number)

    def _given(self, step: Step) -> Step:
        """Return a load step whose size was given, with its place in the history."""
        self._size.forget()
        self._whole = None
        return self._placed(step, 1.0)

    def steps(
        self, state: ContactState | None, target: LoadStep, begun: Mapping[str, float]
    ) -> Iterator[tuple[Step, ContactState]]:
        """Solve the rest of an adaptive segment, or a load step whose size is given.

        Parameters
        ----------
        state : ContactState or None
            End of the last load step.
        target : LoadStep
            The segment.
        begun : mapping of str to float
            Loads and motions when it began.

        Yields
        ------
        step : Step
            Each load step when it is finished.
        state : ContactState
            Its end.
        """
        if target.ramp is None:
            for step, reached in super().steps(state, self._numbered(target), begun):
                yield self._given(step), reached
            return
        place, tolerance = self.position, self.case.solver.step_tolerance
        while self.position == place:
            started = time.perf_counter()
            attempt, taken, verdict = self._taken(state, target, begun)
            found = taken.change
            bound = self._size.accept(attempt, found, tolerance, verdict)
            reached = dataclasses.replace(taken.halves, **self._work)
            part = dataclasses.replace(self._numbered(target.until(attempt.end)), ramp=target.ramp)
            step = self.window.step(part, reached, self._before, started)
            contact = float(step.history["contact_area_fit"])
            self._area = max(self._area, contact)
            history = {
                **step.history,
                "stick_area_step_error": min(bound * self._area, contact),
                "stick_area_step_change": found.stick * self._area,
                "traction_step_change": found.traction,
                "rejected_steps": attempt.rejected,
                "step_limited": int(verdict == LIMITED),
                "segment_fraction": attempt.end,
            }
            self._whole = None if taken.whole is taken.halves else taken.whole
            state = reached
            yield self._placed(dataclasses.replace(step, history=history), attempt.end), state

    def _placed(self, step: Step, fraction: float) -> Step:
        """Return a load step with all that the next one needs to be chosen and solved."""
        self._number += 1
        count = len(self.case.load_steps)
        done = (self.position + fraction) / count
        self.position, self.fraction = (
            (self.position, fraction) if fraction < 1.0 else (self.position + 1, 0.0)
        )
        control: dict[str, Any] = {
            "position": self.position,
            "fraction": self.fraction,
            "load_steps": count,
            "done": 1.0 if self.position == count else done,
            "area": self._area,
            "chooser": self._size.record,
        }
        companion = _companion_fields(self._whole) if self._whole is not None else {}
        if self._whole is not None:
            control["companion"] = _numbers(self._whole)
        return dataclasses.replace(step, companion=companion, control=control, load_fraction=control["done"])

    # --- attempts -----------------------------------------------------------------------------------------

    def _taken(
        self, state: ContactState | None, target: LoadStep, begun: Mapping[str, float]
    ) -> tuple[Attempt, _Solved, int]:
        """Try load steps until one is accepted, or smaller ones are of no more use.

        Returns
        -------
        attempt : Attempt
            The step that is taken.
        solved : _Solved
            Its solution.
        verdict : int
            ACCEPTED or LIMITED.
        """
        assert target.ramp is not None
        tolerance = self.case.solver.step_tolerance
        self._before, self._work = state, {"sweeps": 0, "operator_applications": 0.0}
        attempt = self._size.first_attempt(self.fraction, target.ramp.largest)
        while True:
            solved = self._tried(target, begun, attempt.end)
            verdict = self._size.judge(attempt, None if solved is None else solved.change, tolerance)
            if verdict == FAILED:
                raise nonconvergence.error(self.case, self.window.lattice, *self._failed)
            if solved is not None and verdict != REJECTED:
                return attempt, solved, verdict

    def _tried(self, target: LoadStep, begun: Mapping[str, float], end: float) -> _Solved | None:
        """Solve a load step as a whole and in halves, on a larger window if need be; None: not converged."""
        while True:
            try:
                return self._solved(target, begun, end)
            except _Rim as rim:
                smaller = self.window.lattice
                self.window = self.window.grown(rim.solution, self._numbered(target))
                self._before = self.window.carried(self._before, smaller)
                self._whole = self.window.carried(self._whole, smaller)

    def _solved(self, target: LoadStep, begun: Mapping[str, float], end: float) -> _Solved | None:
        start = self._before
        apart = start if self._whole is None else self._whole
        whole = self._advanced(apart, target, begun, end)
        if whole is None:
            return None
        if self._whole is None and is_shear_free(start) and is_shear_free(whole):
            return _Solved(whole, whole, Change())  # no history, so that no halves are needed
        half = self._advanced(start, target, begun, 0.5 * (self.fraction + end))
        halves = None if half is None else self._advanced(half, target, begun, end)
        if half is None or halves is None:
            return None
        touching = halves.zone > 0
        halves = dataclasses.replace(
            halves,
            slip_increment_x=np.where(touching, half.slip_increment_x + halves.slip_increment_x, 0.0),
            slip_increment_y=np.where(touching, half.slip_increment_y + halves.slip_increment_y, 0.0),
            cuts=half.cuts + halves.cuts,
        )
        window, mu = self.window, self.case.friction_coefficient
        found = change_by_halving(
            window.lattice, window.candidate, mu, (whole, half, halves, apart, start), self._area
        )
        return _Solved(whole, halves, found)

    def _advanced(
        self, state: ContactState | None, target: LoadStep, begun: Mapping[str, float], fraction: float
    ) -> ContactState | None:
        part = self._numbered(target.until(fraction))
        values = part.values(begun)
        solution = self.window.advance(state, part, values)
        self._work["sweeps"] += solution.sweeps
        self._work["operator_applications"] += solution.operator_applications
        if self.window.outgrown(solution):
            raise _Rim(solution)
        if not solution.converged:
            self._failed = solution, part, values
        return solution if solution.converged else None


# --- the path in whole steps, in records --------------------------------------------------------------


def _companion_fields(state: ContactState) -> dict[str, np.ndarray]:
    values = {entry.name: getattr(state, entry.name) for entry in dataclasses.fields(state)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def _numbers(state: ContactState) -> dict[str, float | int | bool]:
    values = {entry.name: getattr(state, entry.name) for entry in dataclasses.fields(state)}
    return {name: value for name, value in values.items() if not isinstance(value, np.ndarray)}


def _companion_state(step: Step) -> ContactState:
    from ..core.friction import ContactState

    state: dict[str, Any] = {**step.companion, **step.control["companion"]}
    return ContactState(**state)
