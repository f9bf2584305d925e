"""A path through the load history, and then through cycles that wear the surfaces: ``[wear]``.

The core solves the cycles and chooses the jumps between them (fortran/path/wear_path.f90). The end of each
solved cycle is recorded here as a load step; see docs/theory/wear.md.
"""

from __future__ import annotations

import dataclasses
import logging
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..core import steps as core
from ..core.friction import CONTROLS, ContactState
from ..core.shared import joined
from ..errors import DeckError, PathWarning
from ..problem.loads import LoadStep
from ..problem.problem import Problem
from ..result.history_words import unclosed_cycle
from ..result.step import Step
from ..variables import WORN
from .adaptive import GivenPath
from .window import FrictionWindow

LABEL = "wear"  # of the cycles that wear, which are no part of the load history
MOST_UNWORN = 50  # cycles on unworn surfaces, until they close
_END = "end_"  # begins the name of tractions at the end of a load step in a record


class WearPath(GivenPath):
    """A path through given load steps, and cycles that wear the surfaces."""

    window: FrictionWindow

    def __init__(self, case: Problem, window: FrictionWindow, before: Sequence[Step]) -> None:
        super().__init__(case, window, before)
        assert case.deck.wear is not None
        self._wear, self._number = case.deck.wear, len(before)
        self._last = before[-1] if self._number > len(case.load_steps) else None
        self._targets: list[LoadStep] = [case.load_steps[-1], *case.cycle]
        numbers: dict[str, Any] = dict.fromkeys(core.WearSettings._fields, 0)
        numbers |= {"coefficient": self._wear.coefficient, "cycles": self._wear.cycles}
        numbers |= {"jump": 0 if isinstance(self._wear.jump, str) else self._wear.jump}
        numbers |= {"tolerance": self._wear.tolerance, "residual": case.solver.tolerance}
        numbers |= {"cycle_tolerance": self._wear.cycle_tolerance(case.solver.tolerance)}
        numbers |= {"most_unworn": MOST_UNWORN, "grows": not case.full_contact}
        numbers |= {"interpolated": case.solver.entry == "interpolated", "size": 1.0, "first": 0.5}
        self._settings = core.WearSettings(**numbers)

    def steps(self, target: LoadStep, begun: Mapping[str, float]) -> Iterator[tuple[Step, Any]]:
        """Solve a load step before the first cycle that wears."""
        for step, reached in super().steps(target, begun):
            self._number += 1
            control = self._control([-1.0] * len(self._targets), np.zeros((len(self._targets), 2, 7)))
            yield dataclasses.replace(step, control=control, load_fraction=0.0), reached

    def after(self) -> Iterator[Step]:
        """Solve the cycles that wear the surfaces, from the end of the load history or of the last cycle."""
        started, done = time.perf_counter(), 0.0 if self._last is None else self._last.history["wear_cycles"]
        cycles, self._last = self._begun(self.state), None
        while done < self._wear.cycles:
            now = self._solved(cycles)
            spent, self.state = self._spent(), cycles.reached(self.window.contact)
            yield self._recorded(cycles, now, spent, started)
            started, done = time.perf_counter(), now.cycles

    def _begun(self, state: ContactState) -> core.CyclesOfWear:
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
        cycles = self.window.cycles(settings, steps, state)
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

    def _solved(self, cycles: core.CyclesOfWear) -> core.WearProgress:
        """Solve a cycle load step by load step, on a window that grows with the contact."""
        while True:
            try:
                now = cycles.advance(self.window.contact)
            except DeckError as error:
                raise DeckError(f'wear.cycle = "{self._wear.cycle}": {error}') from None
            if now.verdict == core.PENDING:
                continue
            if now.verdict not in (core.FAILED, core.OUTGROWN):
                break
            target = dataclasses.replace(self._targets[now.place - 1], index=self._number)
            reached = cycles.reached(self.window.contact)
            if now.verdict == core.FAILED:
                values = now.driven_z, now.driven_x, now.driven_y, now.driven_twist
                raise self.window.failure(reached, target, values)
            smaller, self.window = self.window.lattice, self.window.grown(reached, target)
            cycles.carry(self.window.contact, smaller)
        found = {"unworn_cycles": now.unworn, "unworn_cycle_change": now.left}
        if now.cycles == 0.0 and now.left > self._wear.tolerance:
            words = unclosed_cycle(found, self._wear.tolerance)
            self.window.listener.said("unclosed", level=logging.WARNING, warning=words)
            warnings.warn(words, PathWarning, stacklevel=2)
        return now

    def _recorded(
        self,
        cycles: core.CyclesOfWear,
        now: core.WearProgress,
        spent: float,
        started: float,
    ) -> Step:
        """Return a cycle as a load step, with the restart data of the next; `spent`: energy before it."""
        fields = cycles.fields(self.window.contact)
        self.window.remember_wear(fields)
        last = self._targets[0]
        target = dataclasses.replace(last, index=self._number, segment=last.segment + 1, label=LABEL)
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
        self._number += 1
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
        self, cycles: Sequence[float], motions: np.ndarray, now: core.WearProgress | None = None
    ) -> dict[str, Any]:
        """Return the control data of a record."""
        count, done = len(self.case.load_steps), now.cycles / self._wear.cycles if now else 0.0
        return {
            "end_cycles": list(cycles),
            "end_numbers": motions.tolist(),
            "position": min(self._number, count),
            "fraction": done,
            "load_steps": count,
            "done": done,
            "chooser": core.record_of(now or self._settings),
            "until": now.until if now else 0.0,
        }


def without_ends(step: Step) -> Step:
    """Return a step without restart data."""
    control = {name: value for name, value in step.control.items() if name != "end_cycles"}
    return dataclasses.replace(step, companion={}, control=control)


def lacks_ends(step: Step) -> bool:
    """Test whether a record has lost its restart data, which the last two of a run keep."""
    return max(step.control.get("end_cycles", [-1.0])) >= 0.0 and not step.companion
