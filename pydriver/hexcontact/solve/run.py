"""Runs a case: load step by load step, the window growing with the contact."""

from __future__ import annotations

import dataclasses
import os
import platform
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..deck.series import LOADS
from ..errors import AccuracyWarning, HexcontactError, PathWarning, StopRun
from ..result.history import unasked_path
from ..result.result import Metadata, Result, Step, assemble
from ..text import visible
from . import log, nonconvergence
from .frictionless import kind_of
from .progress import Reporter, reporter

if TYPE_CHECKING:
    from ..core.lattice import Lattice
    from ..problem.loads import LoadStep
    from ..problem.problem import Problem
    from ..result.store import Store
    from .adaptive import AdaptivePath


def metadata_of(case: Problem) -> Metadata:
    """Return what the result of `case` says about where it comes from."""
    return Metadata(
        title=case.title,
        deck=case.deck_text,
        deck_file=visible(str(case.deck_file or "")),
        fields=tuple(case.output.fields),
        every=case.output.every,
        planned_steps=case.planned_steps,
        parameters=parameters_of(case),
    )


def parameters_of(case: Problem) -> dict[str, Any]:
    """Return what describes a case and how it is solved, and the machine that does it."""
    return {
        "effective_modulus": case.pair.effective_modulus,
        "dundurs_beta": case.pair.beta,
        "tangential_compliance_ratio": case.pair.gamma,
        "friction_coefficient": case.friction_coefficient,
        "algorithm": case.solver.algorithm,
        "coupling": case.solver.coupling,
        "entry": case.solver.entry,
        "tolerance": case.solver.tolerance,
        **({"step_tolerance": case.solver.step_tolerance} if case.adaptive else {}),
        **({"accuracy_target": case.accuracy.target} if case.accuracy else {}),
        "machine": _machine(),
    }


def _machine() -> str:
    """Say what the program runs on: "node7, Linux x86_64, 16 processors"."""
    count = os.cpu_count() or 1
    return (
        f"{platform.node()}, {platform.system()} {platform.machine()}, {count} processor{'s' * (count > 1)}"
    )


def run(
    case: Problem,
    output: str | Path | None = None,
    overwrite: bool = False,
    on_step: Callable[[Step], object] | None = None,
    progress: Reporter | bool | None = None,
) -> Result:
    """Solve a case.

    Parameters
    ----------
    case : Problem
        The checked problem.
    output : path, optional
        netCDF file to write; each step is on the disk before the next begins. Without it the
        result is in memory only, whatever the deck says.
    overwrite : bool
        Replace an output that is there already.
    on_step : callable, optional
        Called with each finished `Step`, after it was written; of every lattice, if the case has an accuracy
        to reach. If it returns something true, or raises `hexcontact.StopRun`, the run ends there; any other
        exception ends it, too, and is passed on.
    progress : Reporter or bool, optional
        Who is told about each step; True: a bar on a terminal, lines otherwise.

    Returns
    -------
    Result
        What is finished: all load steps, or those up to where `on_step` ended the run. With an output, the
        finished steps are kept as after a signal then, and `hexcontact.resume` goes on.

    Warns
    -----
    AccuracyWarning
        If the lattice could not be refined until the accuracy of the case was reached.
    PathWarning
        If a static load step, or one that begins without contact, had to be solved in parts.

    Raises
    ------
    DeckError
        If the output cannot be written, or the contact outgrows a fixed window.
    ConvergenceError
        If a load step misses its tolerance; with an output, the steps before it are kept.
    ResourceError
        If there is not enough memory or disk.
    """
    shown = progress if isinstance(progress, Reporter) else reporter(quiet=not progress)
    if output is None:
        if case.accuracy is not None:
            from . import lattices as refinement

            with shown.watching(case.title, case.planned_steps):
                return checked(refinement.in_memory(case, shown, on_step))
        finished: list[Step] = []
        stopped = ""
        with log.ending(), shown.watching(case.title, case.planned_steps):
            for step in steps(case, kept_in_memory=True):
                finished.append(dataclasses.replace(step, companion={}))
                log.finished(step, case.planned_steps)
                shown.finished(step)
                if stopped := stops(on_step, step):
                    break
        dataset = assemble(metadata_of(case), finished, complete=not stopped)
        return Result(dataset.assign_attrs(stopped=stopped) if stopped else dataset)

    from ..result.store import Store, open_result

    with (
        Store(output, metadata_of(case), overwrite) as store,
        shown.watching(case.title, case.planned_steps),
    ):
        record(case, store, shown, on_step)
    return checked(open_result(store.path))


def checked(result: Result) -> Result:
    """Warn if a result is less accurate than it was to be."""
    if result.shortfall:
        warnings.warn(result.shortfall, AccuracyWarning, stacklevel=3)
    return result


def record(
    case: Problem,
    store: Store,
    shown: Reporter,
    on_step: Callable[[Step], object] | None = None,
    before: Sequence[Step] = (),
) -> None:
    """Solve a case into a store, up to the finished output.

    Parameters
    ----------
    case : Problem
        The checked problem.
    store : Store
        Where the steps go.
    shown : Reporter
        Who is told about each step.
    on_step : callable, optional
        Called with each finished `Step`, when it is safe; may end the run, as in `run`.
    before : sequence of Step
        The steps that the store has already, as for `steps`.

    Raises
    ------
    DeckError, ConvergenceError, ResourceError
        As `run`.
    """
    if case.accuracy is not None:
        from . import trials as trial_store

        with log.ending():
            trial_store.record(case, store, shown, on_step)
        return
    with log.ending():
        for step in steps(case, before=before):
            store.append(step)
            log.finished(step, case.planned_steps)
            shown.finished(step)
            try:
                stopped = stops(on_step, step)
            except Exception as error:
                store.close(f"on_step raised {type(error).__name__} after step {step.number}: {error}")
                if not isinstance(error, HexcontactError):  # to which the store adds it
                    error.add_note(store.kept)
                raise
            if stopped:
                log.logger.warning(log.words("stopped", reason=stopped))
                store.close(stopped)
                return
        store.finish()
    log.logger.info(log.words("written", file=store.path))


def stops(on_step: Callable[[Step], object] | None, step: Step, more: bool = False) -> str:
    """Tell a callback of a finished step; return why the run ends here, nothing if it goes on.

    The last step of a run ends it anyway, unless `more` lattices follow.
    """
    if on_step is None:
        return ""
    try:
        wish = on_step(step)
        if not wish:
            return ""
        reason = wish if isinstance(wish, str) else ""
    except StopRun as wanted:
        reason = str(wanted)
    if step.load_fraction >= 1.0 and not more:
        return ""
    return f"stopped by on_step after step {step.number}" + (f": {reason}" if reason else "")


def steps(
    case: Problem,
    kept_in_memory: bool = False,
    before: Sequence[Step] = (),
    targets: Iterable[LoadStep] | None = None,
) -> Iterator[Step]:
    """Solve a case step by step.

    Parameters
    ----------
    case : Problem
        The checked problem.
    kept_in_memory : bool
        The caller keeps all steps, so there has to be memory for them.
    before : sequence of Step
        The first steps if they are solved already: the heads of them, the last one with all its fields. What
        follows is to the bit what it would have been in one go.
    targets : iterable of LoadStep, optional
        What comes after them instead of the rest of the case; each is asked for when the one before is
        solved.

    Yields
    ------
    Step
        Each load step when it is finished.

    Raises
    ------
    DeckError
        If the contact outgrows a fixed window.
    ConvergenceError
        If a load step misses its tolerance, or the bodies slide on each other without end.
    ResourceError
        If there is not enough memory.
    """
    lattice = before[-1].lattice if before else case.lattice
    log.begun(case, lattice, len(before))
    started = time.perf_counter()
    done = len(before)
    for step in _solved(case, lattice, kept_in_memory, before, targets):
        case.check_contact(step.number, step.lattice, step.fields["zone"] > 0)
        yield step
        done = step.number
    log.logger.info(log.words("finished", steps=done, seconds=time.perf_counter() - started))


def _solved(
    case: Problem,
    lattice: Lattice,
    kept_in_memory: bool,
    before: Sequence[Step],
    targets: Iterable[LoadStep] | None,
) -> Iterator[Step]:
    """Solve step by step, from a window on; see `steps`."""
    window: Any = kind_of(case)(case, lattice, len(case.load_steps) if kept_in_memory else 0)
    state: Any = window.restored(before[-1]) if before else None
    adaptive = _adaptive(case, window, before) if targets is None else None
    segment, begun, reached_by_now = -1, _standing({}), _standing({})
    for step in before:
        if step.history["segment"] != segment + 1:
            segment, begun = int(step.history["segment"]) - 1, reached_by_now
        reached_by_now = _standing(step.history)
    if targets is None:
        targets = case.load_steps[adaptive.position if adaptive else len(before) :]
    for target in targets:
        started = time.perf_counter()
        if target.segment != segment:
            segment, begun = target.segment, reached_by_now
        if adaptive and target.ramp is not None:
            for step, reached in adaptive.steps(state, target, begun):
                _warn_of_path(case, step, state)
                yield step
                state, reached_by_now = reached, _standing(step.history)
            window = adaptive.window
            continue
        if adaptive:
            target = adaptive.numbered(target)
        values = target.values(begun)
        # a step that reached the rim is solved again on a larger window, from where it began
        while window.outgrown(reached := window.advance(state, target, values)):
            smaller, window = window.lattice, window.grown(reached, target)
            log.grown(target.index + 1, smaller, window.lattice)
            state = window.carried(state, smaller)
        if not reached.converged:
            raise nonconvergence.error(case, window.lattice, reached, target, values)
        step = window.step(target, reached, state, started)
        if adaptive:
            adaptive.window, step = window, adaptive.given(step)
        _warn_of_path(case, step, state)
        yield step
        state, reached_by_now = reached, _standing(step.history)


def _warn_of_path(case: Problem, step: Step, before: Any) -> None:
    """Warn of a load step that was halved where nothing prescribes the path of its parts."""
    static = case.solver.algorithm == "static"
    if step.history.get("cuts") and (static or before is None or not (before.pressure > 0).any()):
        in_parts = float(step.history["residual_tangential"]) > case.solver.tolerance
        words = unasked_path([step.number], in_parts)
        log.logger.warning(log.words("halved", step=step.number, warning=words))
        warnings.warn(words, PathWarning, stacklevel=2)


def _adaptive(case: Problem, window: Any, before: Sequence[Step]) -> AdaptivePath | None:
    """Return what chooses load steps, if there are some to choose."""
    if not case.adaptive:
        return None
    from .adaptive import AdaptivePath

    return AdaptivePath(case, window, before)


def _standing(history: Mapping[str, Any]) -> dict[str, float]:
    """Return the loads and motions at the end of a step by the keys of the deck; none are zero."""
    return {name: float(history.get(name, 0.0)) for pair in LOADS.values() for name in pair}
