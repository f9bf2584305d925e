"""Load steps of a problem, solved in turn on windows that grow with the contact."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from .._version import __version__
from ..core import ranks
from ..core.lattice import Lattice
from ..errors import DeckError, PathWarning, warn
from ..problem import plausibility
from ..problem.loads import LoadStep
from ..problem.preview import machine
from ..problem.problem import Problem
from ..result.history_words import unasked_path
from ..result.step import Step
from ..variables import LOADS, ROLLED
from .adaptive import AdaptivePath, GivenPath
from .events import Listener
from .log import Log
from .window import window_over

_SAME = 1e-9  # relative difference of equal initial gaps


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
    if targets is None and case.deck.wear:
        from .wear import WearPath

        kind = WearPath
    elif targets is None and case.adaptive:
        kind = AdaptivePath
    path = kind(case, window_over(case, lattice, held, listener), before)
    targets = case.load_steps[path.position :] if targets is None else targets
    for step in _solved(path, before, targets):
        case.check_contact(step.number, partial(step.bands, "zone"))
        case.check_beyond(step)
        yield step
        if ranks.count > 1:
            ranks.obey_signals()
        done = step.number
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


def _solved(path: GivenPath, before: Sequence[Step], targets: Iterable[LoadStep]) -> Iterator[Step]:
    """Solve step by step; see `steps`."""
    path.state = path.window.restored(before[-1]) if before else None
    if before and isinstance(before, list) and ranks.count > 1:  # each rank has its rows of the last step
        before[-1] = before[-1].head
    segment, begun, reached_by_now = -1, _standing({}), _standing({})
    for step in before:
        if step.history["segment"] != segment + 1:
            segment, begun = int(step.history["segment"]) - 1, reached_by_now
        reached_by_now = _standing(step.history)
    for target in targets:
        if target.segment != segment:
            segment, begun = target.segment, reached_by_now
        touching = path.state is not None and path.state.normal_load > 0.0
        for step, reached in path.steps(target, begun):
            _warn_of_path(path.case, step, touching, path.window.listener)
            path.state, reached_by_now = reached.as_start(), _standing(step.history)
            touching = path.state is not None and path.state.normal_load > 0.0
            yield step
            del step, reached  # the next step has no use of them
    yield from path.after()


def _warn_of_path(case: Problem, step: Step, touching: bool, listener: Listener) -> None:
    """Warn of a load step that was halved where nothing prescribes the path of its parts."""
    static = case.solver.algorithm == "static"
    if step.history.get("cuts") and (static or not touching):
        in_parts = float(step.history["residual_tangential"]) > case.solver.tolerance
        words = unasked_path([step.number], in_parts)
        listener.said("halved", level=logging.WARNING, step=step.number, warning=words)
        warn(words, PathWarning)


def _standing(history: Mapping[str, Any]) -> dict[str, float]:
    """Return the loads and motions at the end of a step by the keys of the deck; 0 without an entry."""
    drives = (*LOADS.values(), *ROLLED.values())
    return {name: float(history.get(name, 0.0)) for pair in drives for name in pair}
