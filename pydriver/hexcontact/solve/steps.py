"""Paths of load steps on windows that grow with the contact: given ones, chosen ones, cycles of wear.

With ``steps = "auto"`` the core chooses load steps (fortran/path/adaptive_path.f90): each is solved as a
whole and in two halves, on two independent paths, of which the halves are recorded. The core also solves the
cycles that wear the surfaces, and chooses the jumps between them (fortran/path/wear_path.f90); the end of
each solved cycle is recorded as a load step: docs/theory/wear.md.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .._version import __version__
from ..core import flat, ranks
from ..core import friction as core
from ..core.friction import CONTROLS, ContactState
from ..core.lattice import Lattice
from ..core.shared import cycles_of, joined
from ..errors import DeckError, PathWarning, warn
from ..problem import plausibility
from ..problem.loads import LoadStep
from ..problem.preview import machine
from ..problem.problem import Problem
from ..result.history_words import unasked_path, unclosed_cycle
from ..result.step import Step
from ..variables import LOADS, ROLLED, WORN
from .events import Listener, Log
from .window import FrictionWindow, window_over

_SAME = 1e-9  # relative difference of equal initial gaps

LABEL = "wear"  # of the cycles that wear, which are no part of the load history
MOST_UNWORN = 50  # cycles on unworn surfaces, until they close
_END = "end_"  # begins the name of tractions at the end of a load step in a record

Attempt = tuple[int, Any, LoadStep, tuple[float, ...]]
"""Verdict on an attempt, its end (None if that is found later), the load step of the end and its values."""


class GivenPath:
    """A path through given load steps."""

    def __init__(self, case: Problem, window: Any, before: Sequence[Step]) -> None:
        self.case, self.window, self.number = case, window, len(before)
        self.position = self.number  # of the next load step in the history of the case
        # from which the next load step starts; the only reference to it
        self.state: Any = window.restored(before[-1]) if before else None
        # loads and motions at the beginning of the segment, and now
        self._segment, self._begun, self._now = -1, _standing({}), _standing({})
        for step in before:
            if step.history["segment"] != self._segment + 1:
                self._segment, self._begun = int(step.history["segment"]) - 1, self._now
            self._now = _standing(step.history)

    def run(self, targets: Iterable[LoadStep]) -> Iterator[Step]:
        """Solve load steps, given ones or segments of chosen ones."""
        said, static = self.window.listener.said, self.case.solver.algorithm == "static"
        for target in targets:
            if target.segment != self._segment:
                self._segment, self._begun = target.segment, self._now
            done = False
            while not done:
                touching = self.state is not None and self.state.normal_load > 0.0
                step, reached, done = self._step(target)
                self.number += 1
                if step.history.get("cuts") and (static or not touching):  # nothing prescribes its path
                    in_parts = float(step.history["residual_tangential"]) > self.case.solver.tolerance
                    words = unasked_path([step.number], in_parts)
                    said("halved", level=logging.WARNING, step=step.number, warning=words)
                    warn(words, PathWarning)
                self.state, self._now = reached.as_start(), _standing(step.history)
                yield step
                del step, reached  # the next step has no use of them

    def _step(self, target: LoadStep) -> tuple[Step, Any, bool]:
        """Solve a load step; return it, the state at its end, and whether its target is reached."""
        started = time.perf_counter()
        reached = self._reached(target)
        return self.window.step(target, reached, self._spent(), started), reached, True

    def _reached(self, target: LoadStep) -> Any:
        """Return the end of the first attempt that is taken; the window grows with the contact."""
        while True:
            verdict, reached, part, values = self._attempt(target)
            if verdict == core.FAILED:
                raise self.window.failure(reached, part, values)
            if verdict == core.OUTGROWN:
                smaller, self.window = self.window.lattice, self.window.grown(reached, part)
                self._carry(smaller)
            elif verdict in (core.ACCEPTED, core.LIMITED):
                return reached

    def _attempt(self, target: LoadStep) -> Attempt:
        """Solve a load step on the present window."""
        values = target.values(self._begun)
        reached = self.window.advance(self.state, target, values)
        outgrown = reached.touches_rim and not self.case.full_contact
        verdict = core.OUTGROWN if outgrown else core.ACCEPTED if reached.converged else core.FAILED
        return verdict, reached, target, values

    def _carry(self, smaller: Lattice) -> None:
        """Go on from a smaller window on the present one."""
        self.state = self.window.carried(self.state, smaller)

    def _spent(self) -> float:
        """Return the energy dissipated before a load step, and free the state at its beginning."""
        spent = 0.0 if self.state is None else self.state.dissipated_energy
        self.state = None
        return spent


class AdaptivePath(GivenPath):
    """The two paths through a load history, whose load steps the core chooses."""

    def __init__(self, case: Problem, window: FrictionWindow, before: Sequence[Step]) -> None:
        super().__init__(case, window, before)
        self.position = 0
        self._whole: ContactState | None = None  # the path in whole steps; None: the same as in halves
        control = before[-1].control if before else {}
        area = float(control["area"]) if before else window.largest_contact_area()
        self._steps = flat.new_steps(case.solver.step_tolerance, not case.full_contact, area)
        if before:
            self.position, fraction = int(control["position"]), float(control["fraction"])
            self._steps = core.restored(self._steps._replace(fraction=fraction), control["chooser"])
            if before[-1].companion:
                self._whole = window.contact.assembled(before[-1].companion, control["companion"])

    def _step(self, target: LoadStep) -> tuple[Step, ContactState, bool]:
        """Solve the next step of an adaptive segment, or a given load step."""
        if target.ramp is None:
            self._whole = None
            step, reached, _ = super()._step(dataclasses.replace(target, index=self.number))
            self._steps = flat.forget_changes(self._steps)._replace(fraction=1.0)
            return self._placed(step), reached, True
        started = time.perf_counter()
        self._steps = flat.begin_step(self._steps, target.ramp.largest)
        reached = self._reached(target)
        now = self._steps
        part = dataclasses.replace(target.until(now.end), index=self.number)
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
        return self._placed(dataclasses.replace(step, history=history)), reached, now.fraction >= 1.0

    def _attempt(self, target: LoadStep) -> Attempt:
        """Solve a load step as a whole and in halves."""
        if target.ramp is None:
            return super()._attempt(target)
        middle, end = 0.5 * (self._steps.start + self._steps.end), self._steps.end
        parts = [dataclasses.replace(target.until(part), index=self.number) for part in (middle, end)]
        values = [part.values(self._begun) for part in parts]
        self._steps, reached, whole = self.window.contact.attempt(
            self._steps,
            [motion.control for motion in target.targets],
            [[*given, *self.case.bulk(part.bulk)[1]] for part, given in zip(parts, values, strict=True)],
            self.window.contact.virgin() if self.state is None else self.state,
            self._whole,
            **self.window.how,
        )
        verdict = self._steps.verdict
        if verdict in (core.ACCEPTED, core.LIMITED):
            self._whole = whole
        at_end = self._steps.reached != middle
        return verdict, reached, parts[at_end], values[at_end]

    def _carry(self, smaller: Lattice) -> None:
        super()._carry(smaller)
        self._whole = self.window.carried(self._whole, smaller)

    def _placed(self, step: Step) -> Step:
        """Return a load step with the restart data of the next one."""
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


class WearPath(GivenPath):
    """A path through given load steps, and cycles that wear the surfaces."""

    window: FrictionWindow

    def __init__(self, case: Problem, window: FrictionWindow, before: Sequence[Step]) -> None:
        super().__init__(case, window, before)
        assert case.deck.wear is not None
        self._wear = case.deck.wear
        self._last = before[-1] if self.number > len(case.load_steps) else None
        self._cycles: Any = None  # of the core, after the load history
        self._targets: list[LoadStep] = [case.load_steps[-1], *case.cycle]
        numbers: dict[str, Any] = dict.fromkeys(flat.WearSettings._fields, 0)
        numbers |= {"coefficient": self._wear.coefficient, "cycles": self._wear.cycles}
        numbers |= {"jump": 0 if isinstance(self._wear.jump, str) else self._wear.jump}
        numbers |= {"tolerance": self._wear.tolerance, "residual": case.solver.tolerance}
        numbers |= {"cycle_tolerance": self._wear.cycle_tolerance(case.solver.tolerance)}
        numbers |= {"most_unworn": MOST_UNWORN, "grows": not case.full_contact}
        numbers |= {"interpolated": case.solver.entry == "interpolated", "size": 1.0, "first": 0.5}
        self._settings = flat.WearSettings(**numbers)

    def run(self, targets: Iterable[LoadStep]) -> Iterator[Step]:
        """Solve load steps, then the cycles that wear the surfaces, from the first one or the last record."""
        yield from super().run(targets)
        started, done = time.perf_counter(), 0.0 if self._last is None else self._last.history["wear_cycles"]
        self._cycles, self._last = self._restored(self.state), None
        while done < self._wear.cycles:
            self._reached(self._targets[0])
            now = self._progress
            if now.cycles == 0.0 and now.left > self._wear.tolerance:
                unclosed = {"unworn_cycles": now.unworn, "unworn_cycle_change": now.left}
                words = unclosed_cycle(unclosed, self._wear.tolerance)
                self.window.listener.said("unclosed", level=logging.WARNING, warning=words)
                warn(words, PathWarning)
            spent, self.state = self._spent(), self._cycles.reached(self.window.contact)
            yield self._recorded(spent, started)
            self.number += 1
            started, done = time.perf_counter(), now.cycles

    def _step(self, target: LoadStep) -> tuple[Step, Any, bool]:
        """Solve a load step before the first cycle that wears."""
        step, reached, done = super()._step(target)
        control = self._control([-1.0] * len(self._targets), np.zeros((len(self._targets), 2, 7)))
        return dataclasses.replace(step, control=control, load_fraction=0.0), reached, done

    def _restored(self, state: ContactState) -> core.CyclesOfWear:
        """Return the cycles from the end of the load history, or from the last record of a resumed run."""
        last, settings = self._last, self._settings
        if last is not None:
            known = {"unworn": last.history["unworn_cycles"], "left": last.history["unworn_cycle_change"]}
            settings = core.restored(settings._replace(**known), last.control["chooser"])
        steps = [
            (
                [CONTROLS[motion.control] for motion in target.targets],
                [*(motion.value for motion in target.targets), *self.case.bulk(target.bulk)[1]],
                [motion.from_start for motion in target.targets],
                target.segment,
            )
            for target in self._targets
        ]
        cycles = cycles_of(settings, self.case.pair, steps, state)
        if last is not None:
            fields = {name: np.array(last.fields[name]) for name in WORN}
            if core.AHEAD in last.companion:
                fields[core.AHEAD] = np.array(last.companion[core.AHEAD])
            done, spent = (float(last.history[name]) for name in ("wear_cycles", "cycle_dissipated_energy"))
            cycles.restore(state, fields, done, float(last.control["until"]), spent)
            for name, tractions in last.companion.items():
                if name.startswith(_END):
                    place = int(name.removeprefix(_END))
                    solved, motions = (last.control[f"end_{kind}"][place] for kind in ("cycles", "numbers"))
                    end = solved, np.array(motions), np.array(tractions)
                    cycles.restore_end(place + 1, self.window.contact, *end)
        return cycles

    def _attempt(self, target: LoadStep) -> Attempt:
        """Solve a load step of a cycle; the end of the cycle is found once it is recorded."""
        if self._cycles is None:
            return super()._attempt(target)
        try:
            self._progress = now = self._cycles.advance(self.window.contact)
        except DeckError as error:
            raise DeckError(f'wear.cycle = "{self._wear.cycle}": {error}') from None
        if now.verdict not in (core.FAILED, core.OUTGROWN):
            return now.verdict, None, target, ()
        part = dataclasses.replace(self._targets[now.place - 1], index=self.number)
        values = now.driven_z, now.driven_x, now.driven_y, now.driven_twist
        return now.verdict, self._cycles.reached(self.window.contact), part, values

    def _carry(self, smaller: Lattice) -> None:
        if self._cycles is None:
            super()._carry(smaller)
        else:
            self._cycles.carry(self.window.contact, smaller)

    def _recorded(self, spent: float, started: float) -> Step:
        """Return a cycle as a load step, with the restart data of the next; `spent`: energy before it."""
        cycles, now = self._cycles, self._progress
        fields = cycles.fields(self.window.contact)
        last = self._targets[0]
        target = dataclasses.replace(last, index=self.number, segment=last.segment + 1, label=LABEL)
        step = self.window.step(target, self.state, spent, started)
        history = {
            **step.history,
            "wear_cycles": now.cycles,
            "wear_volume": now.volume,
            "max_worn_depth": now.deepest,
            "worn_depth_step_error": now.depth_error,
            "unworn_cycles": now.unworn,
            "unworn_cycle_change": now.left,
            "cycle_dissipated_energy": now.cycle_spent,
        }
        if now.rejected >= 0:
            history |= {"rejected_steps": now.rejected, "step_limited": int(now.verdict == core.LIMITED)}
        ends = [cycles.end(place, self.window.contact) for place in range(1, len(self._targets) + 1)]
        beside = {f"{_END}{place}": end[2] for place, end in enumerate(ends) if end[0] >= 0.0}
        if now.until > now.cycles:
            beside[core.AHEAD] = fields[core.AHEAD]
        done = now.cycles / self._wear.cycles
        return dataclasses.replace(
            step,
            history=history,
            fields=joined(step.fields, fields, WORN),
            companion=beside,
            control=self._control([end[0] for end in ends], np.array([end[1] for end in ends]), now),
            load_fraction=done,
        )

    def _control(
        self, cycles: Sequence[float], motions: np.ndarray, now: flat.WearProgress | None = None
    ) -> dict[str, Any]:
        """Return the control data of a record."""
        count, done = len(self.case.load_steps), now.cycles / self._wear.cycles if now else 0.0
        return {
            "end_cycles": list(cycles),
            "end_numbers": motions.tolist(),
            "position": min(self.number + 1, count),
            "fraction": done,
            "load_steps": count,
            "done": done,
            "chooser": core.record_of(now or self._settings),
            "until": now.until if now else 0.0,
        }


def check_step(case: Problem, last: Step, found: str) -> None:
    """Refuse a finished step with another lattice or other surfaces than a case; `found` names it."""
    if (case.lattice.spacing, case.lattice.pattern) != (last.lattice.spacing, last.lattice.pattern):
        raise DeckError(f"the deck now leads to another lattice than that of the {found}")
    largest = max(np.abs(then[np.isfinite(then)]).max(initial=0.0) for _, then in last.bands("initial_gap"))
    for rows, then in last.bands("initial_gap"):
        gap, touching = case.initial_gap(rows)
        if (touching != np.isfinite(then)).any() or not np.allclose(
            gap[touching], then[touching], rtol=_SAME, atol=_SAME * largest
        ):
            raise DeckError(f"the surfaces are no longer those of the {found}")


def steps(
    case: Problem,
    in_memory: bool = False,
    before: Sequence[Step] = (),
    targets: Iterable[LoadStep] | None = None,
    listener: Listener | None = None,
) -> Iterator[Step]:
    """Solve a case step by step, and yield each load step when it is finished.

    `before` are the first steps, if they are solved: heads, the last one with all its fields; the others are
    bit-identical to those of an uninterrupted run. `targets` replace the remaining load steps of the case,
    and each is taken after the step before is solved. The listener follows all but the finished steps.
    `in_memory`: the fields of all steps stay in memory, which is checked for them. Exceptions as of
    `hexcontact.Case.run`.
    """
    listener = listener or Log()
    lattice = before[-1].lattice if before else case.lattice
    started, done = time.perf_counter(), len(before)
    _announce(case, lattice, done, listener)
    held = len(case.load_steps) if in_memory else 0
    kind: type[GivenPath] = GivenPath
    if targets is None:
        kind = WearPath if case.deck.wear else AdaptivePath if case.adaptive else GivenPath
    path = kind(case, window_over(case, lattice, held, listener), before)
    if before and isinstance(before, list) and ranks.count > 1:  # each rank has its rows of the last step
        before[-1] = before[-1].head
    for step in path.run(case.load_steps[path.position :] if targets is None else targets):
        case.check_contact(step)
        case.check_beyond(step)
        yield step
        if ranks.count > 1:
            ranks.obey_signals()
        done += 1
        del step
    listener.said("finished", steps=done, seconds=time.perf_counter() - started)


def _announce(case: Problem, lattice: Lattice, done: int, listener: Listener) -> None:
    """Report the start of the load history, or its continuation after `done` steps."""
    solver = case.solver
    values: dict[str, Any] = {"title": case.title, "version": __version__, "machine": machine()}
    values |= {"steps": case.planned_steps or "auto"} | ({"done": done} if done else {})
    values |= {"window": lattice.shape, "spacing": lattice.spacing, "method": case.method_for(lattice)}
    values |= {"algorithm": solver.algorithm, "friction_coefficient": case.friction_coefficient}
    values |= {"coupling": solver.coupling, "entry": solver.entry, "tolerance": solver.tolerance}
    listener.said("resumed" if done else "begun", **values)
    if case.full_contact:
        sentence = (
            f"full contact: flat on flat has one unknown, the mean pressure, at all {lattice.size} nodes; "
            "the half-spaces move as a whole, and what is solved is the layer"
        )
        listener.said("full contact", sentence, area=lattice.size * lattice.cell_area)
    for about, note in {} if case.trial else plausibility.notes(case).items():
        listener.said(about, f"note: {note}", note=note)
    for sentence in [] if case.trial else plausibility.warnings(case):
        listener.said("doubtful", f"warning: {sentence}", logging.WARNING, warning=sentence)


def _standing(history: Mapping[str, Any]) -> dict[str, float]:
    """Return the loads and motions at the end of a step by the keys of the deck; 0 without an entry."""
    drives = (*LOADS.values(), *ROLLED.values())
    return {name: float(history.get(name, 0.0)) for pair in drives for name in pair}


def without_ends(step: Step) -> Step:
    """Return a step without restart data."""
    control = {name: value for name, value in step.control.items() if name != "end_cycles"}
    return dataclasses.replace(step, companion={}, control=control)


def lacks_ends(step: Step) -> bool:
    """Test whether a record has lost its restart data, which the last two of a run keep."""
    return max(step.control.get("end_cycles", [-1.0])) >= 0.0 and not step.companion
