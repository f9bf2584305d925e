"""Paths through load steps that are given, or chosen during the solution, ``steps = "auto"``.

The core chooses load steps (fortran/path/adaptive_path.f90): each is solved as a whole and in two halves, on
two independent paths, of which the halves are recorded. The window grows and steps are recorded here.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..core import steps as core
from ..core.friction import ContactState
from ..problem.loads import LoadStep
from ..problem.problem import Problem
from ..result.step import Step
from .window import FrictionWindow


class GivenPath:
    """A path through given load steps, on a window that grows with the contact."""

    def __init__(self, case: Problem, window: Any, before: Sequence[Step]) -> None:
        self.case, self.window = case, window
        self.position = len(before)
        self.state: Any = None  # from which the next load step starts; the only reference to it

    def steps(self, target: LoadStep, begun: Mapping[str, float]) -> Iterator[tuple[Step, Any]]:
        """Solve a load step; yield it with the state at its end.

        `begun` has the loads and motions at the beginning of its segment. If the contact reaches the rim, the
        step is solved again on a larger window.
        """
        started, values = time.perf_counter(), target.values(begun)
        while (reached := self.window.advance(self.state, target, values)).touches_rim:
            if self.case.full_contact:
                break
            smaller, self.window = self.window.lattice, self.window.grown(reached, target)
            self.state = self.window.carried(self.state, smaller)
        if not reached.converged:
            raise self.window.failure(reached, target, values)
        yield self.window.step(target, reached, self._spent(), started), reached

    def _spent(self) -> float:
        """Return the energy dissipated before a load step, and free the state at its beginning."""
        spent = 0.0 if self.state is None else self.state.dissipated_energy
        self.state = None
        return spent

    def after(self) -> Iterator[Step]:
        """Solve further steps after the load history; here none."""
        yield from ()


class AdaptivePath(GivenPath):
    """The two paths through a load history, whose load steps the core chooses."""

    def __init__(self, case: Problem, window: FrictionWindow, before: Sequence[Step]) -> None:
        super().__init__(case, window, ())
        self._number = len(before)
        self._whole: ContactState | None = None  # the path in whole steps; None: the same as in halves
        control = before[-1].control if before else {}
        area = float(control["area"]) if before else window.largest_contact_area()
        self._steps = core.new_steps(case.solver.step_tolerance, not case.full_contact, area)
        if before:
            self.position, fraction = int(control["position"]), float(control["fraction"])
            self._steps = core.restored(self._steps._replace(fraction=fraction), control["chooser"])
            if before[-1].companion:
                self._whole = window.contact.assembled(before[-1].companion, control["companion"])

    def _numbered(self, target: LoadStep) -> LoadStep:
        """Return a load step with its number among the recorded ones."""
        return dataclasses.replace(target, index=self._number)

    def steps(self, target: LoadStep, begun: Mapping[str, float]) -> Iterator[tuple[Step, ContactState]]:
        """Solve the rest of an adaptive segment, or a given load step; yield each step and its end."""
        if target.ramp is None:
            for step, reached in super().steps(self._numbered(target), begun):
                self._steps, self._whole = core.forget_changes(self._steps)._replace(fraction=1.0), None
                yield self._placed(step), reached
            return
        place = self.position
        while self.position == place:
            started = time.perf_counter()
            reached = self._taken(target, begun)
            now = self._steps
            part = dataclasses.replace(self._numbered(target.until(now.end)), ramp=target.ramp)
            step = self.window.step(part, reached, self._spent(), started)
            history = {
                **step.history,
                "stick_area_step_error": now.stick_area_error,
                "stick_area_step_change": now.stick_change * now.area,
                "traction_step_error": now.traction_error,
                "traction_step_change": now.traction_change,
                "rejected_steps": now.rejected,
                "step_limited": int(now.verdict == core.LIMITED),
                "segment_fraction": now.end,
            }
            yield self._placed(dataclasses.replace(step, history=history)), reached
            del step, reached

    def _placed(self, step: Step) -> Step:
        """Return a load step with the restart data of the next one."""
        self._number += 1
        count, fraction = len(self.case.load_steps), self._steps.fraction
        done = (self.position + fraction) / count
        whole = int(fraction >= 1.0)
        self.position += whole
        control: dict[str, Any] = {
            "position": self.position,
            "fraction": 0.0 if whole else fraction,
            "load_steps": count,
            "done": 1.0 if self.position == count else done,
            "area": self._steps.area,
            "chooser": core.record_of(self._steps),
        }
        companion: Mapping[str, Any] = {}
        if self._whole is not None:
            companion, control["companion"] = self._whole.parts()
        return dataclasses.replace(step, companion=companion, control=control, load_fraction=control["done"])

    def _taken(self, target: LoadStep, begun: Mapping[str, float]) -> ContactState:
        """Attempt load steps on a growing window until one is taken; return the state at its end."""
        assert target.ramp is not None
        self._steps = core.begin_step(self._steps, target.ramp.largest)
        while True:
            middle = 0.5 * (self._steps.start + self._steps.end)
            parts = [self._numbered(target.until(part)) for part in (middle, self._steps.end)]
            driven = [(part, part.values(begun)) for part in parts]
            self._steps, reached, whole = self.window.contact.attempt(
                self._steps,
                [motion.control for motion in target.targets],
                [[*values, *self.case.bulk(part.bulk)[1]] for part, values in driven],
                self.window.contact.virgin() if self.state is None else self.state,
                self._whole,
                **self.window.how,
            )
            if self._steps.verdict == core.FAILED:
                raise self.window.failure(reached, *driven[self._steps.reached != middle])
            if self._steps.verdict == core.OUTGROWN:
                smaller = self.window.lattice
                self.window = self.window.grown(reached, self._numbered(target))
                self.state = self.window.carried(self.state, smaller)
                self._whole = self.window.carried(self._whole, smaller)
            elif self._steps.verdict != core.REJECTED:
                self._whole = whole
                return reached
