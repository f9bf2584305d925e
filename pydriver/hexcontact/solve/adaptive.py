"""Load steps that are chosen on the way, ``steps = "auto"``: what one may change is bounded, and measured.

Each load step is solved as a whole and in two halves, on two paths that never meet. The halves are recorded.
What they change decides whether the step is taken, and how large the next one is; see
`hexcontact.step_error`.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..problem.loads import LEAST, LoadStep
from . import nonconvergence
from .step_error import STICK_SAFETY, Change, Memory, change, shear_free

if TYPE_CHECKING:
    from ..core.friction import ContactState
    from ..problem.problem import Problem
    from ..result.result import Step
    from .frictional import FrictionWindow

_ATTEMPTS = 6  # at one load step
_GROWTH = 2.0  # from one load step to the next, at most
_SHRINKAGE = 0.1  # from one attempt to the next, at most
_FEWER = 0.25  # from an attempt that did not converge to the next
_AIM = 0.8  # share of what is allowed that a step is to change
_BUDGET = 0.5  # share of the tolerance by which one step may add to the change of the tractions
_OWN = 0.25  # share of a change of the stick area from which it is that of the step itself
_HELPED = 0.8  # a smaller step that leaves more of the excess than this was of no use


class _Rim(Exception):
    """The contact reached the rim of the window."""

    def __init__(self, solution: ContactState) -> None:
        super().__init__()
        self.solution = solution


@dataclass(frozen=True)
class Chooser:
    """Chooses load steps. All that it knows goes into the record of a step.

    Attributes
    ----------
    size : float
        Part of the segment that the next load step tries to take.
    first : float
        Part that the first load step of the present segment took.
    stick, traction : float
        Changes at the end of the last load step.
    memory : Memory
        Those of all steps, fading.
    """

    size: float = 1.0
    first: float = 0.5
    stick: float = 0.0
    traction: float = 0.0
    memory: Memory = field(default_factory=Memory)

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Chooser:
        """Read it from the record of a step."""
        return cls(**{**record, "memory": Memory(**record["memory"])})

    def beginning(self) -> Chooser:
        """Return it at the beginning of a segment."""
        return dataclasses.replace(self, size=_GROWTH * self.first)

    def excess(self, found: Change, tolerance: float) -> tuple[float, float]:
        """Return what a step changes relative to what is allowed: stick area, tractions.

        Smaller steps cannot help against the rings of the lattice, nor against tractions that differ from
        before.
        """
        allowed = max(tolerance, found.lattice, STICK_SAFETY * self.traction)
        return STICK_SAFETY * abs(found.stick) / allowed, found.added / (_BUDGET * tolerance)

    def accepts(self, found: Change, tolerance: float) -> bool:
        """Tell whether a step changes no more than is allowed."""
        stick, traction = self.excess(found, tolerance)
        inherited = abs(found.stick - self.stick) <= _OWN * abs(found.stick)
        return traction <= 1.0 and (stick <= 1.0 or inherited)

    def factor(self, found: Change, tolerance: float) -> float:
        """Return by how much larger a step would have changed just what is aimed at."""
        stick, traction = self.excess(found, tolerance)
        return min(_AIM / max(stick, 1e-9), _AIM / math.sqrt(max(traction, 1e-9)))

    def after(self, found: Change, size: float, tolerance: float, rejected: int, limited: bool) -> Chooser:
        """Return it after a step that was taken."""
        factor = self.factor(found, tolerance)
        if limited:
            factor = _GROWTH
        elif self.excess(found, tolerance)[0] > 1.0:  # inherited
            factor = max(1.0, factor)
        elif rejected:
            factor = min(1.0, factor)
        return dataclasses.replace(
            self,
            size=size * min(_GROWTH, max(0.3, factor)),
            stick=found.stick,
            traction=found.traction,
            memory=self.memory.after(found),
        )


def _end_of_step(fraction: float, size: float) -> float:
    """Return the fraction at which a step of a given size ends; the last two are equally large."""
    left = 1.0 - fraction
    parts = max(1, math.ceil(left / size - 1e-9))
    return 1.0 if parts == 1 else fraction + (left / parts if parts == 2 else size)


@dataclass
class _Attempt:
    """A load step that was tried."""

    end: float
    whole: ContactState
    halves: ContactState
    change: Change


class AdaptivePath:
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
        self.case, self.window = case, window
        self.position, self.fraction = 0, 0.0
        self._number = len(before)
        self._before: ContactState | None = None  # the path in halves, where a load step begins
        self._work: dict[str, Any] = {}
        self._chooser = Chooser()
        self._whole: ContactState | None = None  # the path in whole steps; None where both are one
        if before:
            control = before[-1].control
            self.position, self.fraction = int(control["position"]), float(control["fraction"])
            self._area = float(control["area"])
            self._chooser = Chooser.from_record(control["chooser"])
            if before[-1].companion:
                self._whole = _companion_state(before[-1])
        else:
            self._area = window.largest_contact_area()

    def numbered(self, target: LoadStep) -> LoadStep:
        """Return a load step under the number that it has among those that are recorded."""
        return dataclasses.replace(target, index=self._number)

    def given(self, step: Step) -> Step:
        """Return a load step whose size was given, with its place in the history."""
        self._chooser = dataclasses.replace(self._chooser, stick=0.0, traction=0.0, memory=Memory())
        self._whole = None
        return self._placed(step, 1.0)

    def steps(
        self, state: ContactState | None, target: LoadStep, begun: Mapping[str, float]
    ) -> Iterator[tuple[Step, ContactState]]:
        """Solve the rest of an adaptive segment.

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
        assert target.ramp is not None
        if self.fraction == 0.0:
            self._chooser = self._chooser.beginning()
        place = self.position
        while self.position == place:
            started = time.perf_counter()
            begins = self.fraction == 0.0
            size = min(self._chooser.size, target.ramp.largest)
            taken, rejected, limited, work = self._taken(state, target, begun, size)
            size = taken.end - self.fraction
            self._chooser = self._chooser.after(
                taken.change, size, self.case.solver.step_tolerance, rejected, limited
            )
            if begins:
                self._chooser = dataclasses.replace(self._chooser, first=size)
            reached = dataclasses.replace(taken.halves, **work)
            part = dataclasses.replace(self.numbered(target.until(taken.end)), ramp=target.ramp)
            step = self.window.step(part, reached, self._before, started)
            self._area = max(self._area, float(step.history["contact_area_fit"]))
            history = {
                **step.history,
                **self._measured(step, taken.change),
                "rejected_steps": rejected,
                "step_limited": int(limited),
                "segment_fraction": taken.end,
            }
            self._whole = None if taken.whole is taken.halves else taken.whole
            state = reached
            yield self._placed(dataclasses.replace(step, history=history), taken.end), state

    def _measured(self, step: Step, found: Change) -> dict[str, float]:
        """Return what the halves changed, and the bound that follows."""
        bound = self._chooser.memory.bound(found) * self._area
        return {
            "stick_area_step_error": min(bound, float(step.history["contact_area_fit"])),
            "stick_area_step_change": found.stick * self._area,
            "traction_step_change": found.traction,
        }

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
            "chooser": asdict(self._chooser),
        }
        companion = _companion_fields(self._whole) if self._whole is not None else {}
        if self._whole is not None:
            control["companion"] = _numbers(self._whole)
        return dataclasses.replace(step, companion=companion, control=control, load_fraction=control["done"])

    # --- attempts -----------------------------------------------------------------------------------------

    def _taken(
        self, state: ContactState | None, target: LoadStep, begun: Mapping[str, float], size: float
    ) -> tuple[_Attempt, int, bool, dict[str, Any]]:
        """Try load steps until one is accepted, or smaller ones are of no more use.

        Returns
        -------
        attempt : _Attempt
            The step that is taken.
        rejected : int
            How many were tried in vain.
        limited : bool
            Smaller ones were of no more use.
        work : dict
            Iterations and operator applications of all of them.
        """
        tolerance = self.case.solver.step_tolerance
        self._before, self._work = state, {"sweeps": 0, "operator_applications": 0.0}
        rejected, last = 0, math.inf
        last_size = math.inf
        while True:
            end = _end_of_step(self.fraction, size)
            tried = end - self.fraction
            least = tried <= LEAST * (1 + 1e-9) or rejected + 1 >= _ATTEMPTS
            attempt = self._tried(target, begun, end, give_up=tried <= LEAST * (1 + 1e-9))
            if attempt is None:
                size = max(LEAST, _FEWER * tried)
                rejected += 1
                last = math.inf
                continue
            if self._chooser.accepts(attempt.change, tolerance):
                return attempt, rejected, False, self._work
            excess = max(self._chooser.excess(attempt.change, tolerance))
            if least or (excess > _HELPED * last and tried < 0.6 * last_size):
                return attempt, rejected, True, self._work
            last, last_size = excess, tried
            rejected += 1
            factor = self._chooser.factor(attempt.change, tolerance)
            size = max(LEAST, tried * min(0.6, max(_SHRINKAGE, factor)))

    def _tried(
        self, target: LoadStep, begun: Mapping[str, float], end: float, give_up: bool
    ) -> _Attempt | None:
        """Solve a load step as a whole and in halves, on a larger window if need be; None: not converged."""
        while True:
            try:
                return self._solved(target, begun, end, give_up)
            except _Rim as rim:
                smaller = self.window.lattice
                self.window = self.window.grown(rim.solution, self.numbered(target))
                self._before = self.window.carried(self._before, smaller)
                self._whole = self.window.carried(self._whole, smaller)

    def _solved(
        self, target: LoadStep, begun: Mapping[str, float], end: float, give_up: bool
    ) -> _Attempt | None:
        start = self._before
        apart = start if self._whole is None else self._whole
        whole = self._advanced(apart, target, begun, end, give_up)
        if whole is None:
            return None
        if self._whole is None and shear_free(start, whole):  # no history, so that no halves are needed
            return _Attempt(end, whole, whole, Change())
        middle = 0.5 * (self.fraction + end)
        half = self._advanced(start, target, begun, middle, give_up)
        halves = None if half is None else self._advanced(half, target, begun, end, give_up)
        if half is None or halves is None:
            return None
        touching = halves.zone > 0
        halves = dataclasses.replace(
            halves,
            slip_increment_x=np.where(touching, half.slip_increment_x + halves.slip_increment_x, 0.0),
            slip_increment_y=np.where(touching, half.slip_increment_y + halves.slip_increment_y, 0.0),
            cuts=half.cuts + halves.cuts,
        )
        before = None if start is None or apart is None else (apart, start)
        found = change(self.window, whole, half, halves, before, self._area)
        return _Attempt(end, whole, halves, found)

    def _advanced(
        self,
        state: ContactState | None,
        target: LoadStep,
        begun: Mapping[str, float],
        fraction: float,
        give_up: bool,
    ) -> ContactState | None:
        part = self.numbered(target.until(fraction))
        values = part.values(begun)
        solution = self.window.advance(state, part, values)
        self._work["sweeps"] += solution.sweeps
        self._work["operator_applications"] += solution.operator_applications
        if self.window.outgrown(solution):
            raise _Rim(solution)
        if solution.converged:
            return solution
        if give_up:
            raise nonconvergence.error(self.case, self.window.lattice, solution, part, values)
        return None


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
