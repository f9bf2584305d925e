"""Paths through load steps that are given, or chosen during the solution, ``steps = "auto"``.

A chosen load step is solved as a whole and in two halves, on two independent paths; the halves are recorded.
The difference decides whether the step is accepted, and the size of the next one; see
`hexcontact.core.steps`.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.friction import ContactState
from ..core.steps import (
    FAILED,
    LIMITED,
    NO_CHANGE,
    REJECTED,
    Attempt,
    Change,
    StepControl,
    change_by_halving,
    is_shear_free,
)
from ..problem.loads import LoadStep
from ..problem.problem import Problem
from ..result.step import Step
from .window import FrictionWindow


class _Rim(Exception):
    """Raised if the contact reaches the rim of the window."""

    def __init__(self, solution: ContactState) -> None:
        super().__init__()
        self.solution = solution


class _Solved(NamedTuple):
    """A load step that was solved as a whole and in halves."""

    whole: ContactState
    halves: ContactState
    change: Change


class GivenPath:
    """A path through given load steps, on a window that grows with the contact."""

    def __init__(self, case: Problem, window: Any, before: Sequence[Step]) -> None:
        self.case, self.window = case, window
        self.position = len(before)

    def steps(self, state: Any, target: LoadStep, begun: Mapping[str, float]) -> Iterator[tuple[Step, Any]]:
        """Solve a load step; yield it with the state at its end.

        `begun` has the loads and motions at the beginning of its segment. If the contact reaches the rim, the
        step is solved again on a larger window.
        """
        started = time.perf_counter()
        state, reached = self._reached(state, target, target.values(begun))
        step = self.window.step(target, reached, state, started)
        del state  # its memory goes before the step is written
        yield step, reached

    def _reached(
        self, state: Any, target: LoadStep, values: tuple[float, ...], **how: Any
    ) -> tuple[Any, Any]:
        """Return the states at the beginning and at the end of a load step, on the window at its end."""
        while self.window.outgrown(reached := self.window.advance(state, target, values, **how)):
            smaller, self.window = self.window.lattice, self.window.grown(reached, target)
            state = self.window.carried(state, smaller)
            how.pop("guess", None)  # of the smaller window
        if not reached.converged:
            from . import nonconvergence

            raise nonconvergence.error(self.case, self.window.lattice, reached, target, values)
        return state, reached

    def after(self, state: Any) -> Iterator[Step]:
        """Solve further steps after the load history; here none."""
        yield from ()


class AdaptivePath(GivenPath):
    """The two paths through a load history, with the choice of its load steps."""

    def __init__(self, case: Problem, window: FrictionWindow, before: Sequence[Step]) -> None:
        super().__init__(case, window, ())
        self.fraction = 0.0
        self._number = len(before)
        self._before: ContactState | None = None  # the path in halves, at the beginning of a load step
        self._work: dict[str, Any] = {}
        self._failed: Any = None  # solution, part and loads that did not converge
        self._size = StepControl()
        self._whole: ContactState | None = None  # the path in whole steps; None: the same as in halves
        if before:
            control = before[-1].control
            self.position, self.fraction = int(control["position"]), float(control["fraction"])
            self._area = float(control["area"])
            self._size = StepControl.from_record(control["chooser"])
            if before[-1].companion:
                state: dict[str, Any] = {**before[-1].companion, **control["companion"]}
                self._whole = ContactState(**state)
        else:
            self._area = window.largest_contact_area()

    def _numbered(self, target: LoadStep) -> LoadStep:
        """Return a load step with its number among the recorded ones."""
        return dataclasses.replace(target, index=self._number)

    def _given(self, step: Step) -> Step:
        """Return a load step of given size, with its place in the history."""
        self._size.forget()
        self._whole = None
        return self._placed(step, 1.0)

    def steps(
        self, state: ContactState | None, target: LoadStep, begun: Mapping[str, float]
    ) -> Iterator[tuple[Step, ContactState]]:
        """Solve the rest of an adaptive segment, or a given load step; yield each step and its end."""
        if target.ramp is None:
            for step, reached in super().steps(state, self._numbered(target), begun):
                yield self._given(step), reached
            return
        place, tolerance = self.position, self.case.solver.step_tolerance
        while self.position == place:
            started = time.perf_counter()
            attempt, taken, verdict = self._taken(state, target, begun)
            found = taken.change
            bound, traction_bound = self._size.accept(attempt, found, tolerance, verdict)
            reached = taken.halves.recounted(**self._work)
            part = dataclasses.replace(self._numbered(target.until(attempt.end)), ramp=target.ramp)
            step = self.window.step(part, reached, self._before, started)
            contact = float(step.history["contact_area_fit"])
            self._area = max(self._area, contact)
            history = {
                **step.history,
                "stick_area_step_error": min(bound * self._area, contact),
                "stick_area_step_change": found.stick * self._area,
                "traction_step_error": traction_bound,
                "traction_step_change": found.traction,
                "rejected_steps": attempt.rejected,
                "step_limited": int(verdict == LIMITED),
                "segment_fraction": attempt.end,
            }
            self._whole = None if taken.whole is taken.halves else taken.whole
            state = reached
            yield self._placed(dataclasses.replace(step, history=history), attempt.end), state

    def _placed(self, step: Step, fraction: float) -> Step:
        """Return a load step with the restart data of the next one."""
        self._number += 1
        count = len(self.case.load_steps)
        done = (self.position + fraction) / count
        whole = int(fraction >= 1.0)
        self.position, self.fraction = self.position + whole, 0.0 if whole else fraction
        control: dict[str, Any] = {
            "position": self.position,
            "fraction": self.fraction,
            "load_steps": count,
            "done": 1.0 if self.position == count else done,
            "area": self._area,
            "chooser": self._size.record,
        }
        companion: dict[str, Any] = {}
        if self._whole is not None:
            state = vars(self._whole)
            companion = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
            control["companion"] = {name: state[name] for name in state if name not in companion}
        return dataclasses.replace(step, companion=companion, control=control, load_fraction=control["done"])

    # --- attempts -----------------------------------------------------------------------------------------

    def _taken(
        self, state: ContactState | None, target: LoadStep, begun: Mapping[str, float]
    ) -> tuple[Attempt, _Solved, int]:
        """Try load steps until one is accepted, or smaller ones do not help; return it with its verdict."""
        assert target.ramp is not None
        tolerance = self.case.solver.step_tolerance
        self._before, self._work = state, {"sweeps": 0, "operator_applications": 0.0}
        attempt = self._size.first_attempt(self.fraction, target.ramp.largest)
        while True:
            solved = self._tried(target, begun, attempt.end)
            verdict = self._size.judge(attempt, None if solved is None else solved.change, tolerance)
            if verdict == FAILED:
                from . import nonconvergence

                raise nonconvergence.error(self.case, self.window.lattice, *self._failed)
            if solved is not None and verdict != REJECTED:
                return attempt, solved, verdict

    def _tried(self, target: LoadStep, begun: Mapping[str, float], end: float) -> _Solved | None:
        """Solve a load step as a whole and in halves on a growing window; None without convergence."""
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
            return _Solved(whole, whole, NO_CHANGE)  # no history, so that no halves are needed
        half = self._advanced(start, target, begun, 0.5 * (self.fraction + end))
        halves = None if half is None else self._advanced(half, target, begun, end)
        if half is None or halves is None:
            return None
        halves = self.window.joined(half, halves)
        window = self.window
        found = change_by_halving(
            window.lattice, window.candidate, window.friction, (whole, half, halves, apart, start), self._area
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
