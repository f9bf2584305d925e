"""Running of a case to its result."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..arrays import Dataset
from ..errors import AccuracyWarning, HexcontactError, warn
from ..problem.preview import coarser, parameters_of
from ..problem.problem import Problem
from ..result.history_words import limited_steps
from ..result.layout import Metadata, assemble
from ..result.netcdf import missing_stresses, require_free
from ..result.step import Step
from ..result.store import Store, open_result
from ..text import quantity, visible
from .events import Callback, Listener, Listeners, Log, Stopped, reporter
from .memory_needed import require_memory
from .steps import steps

if TYPE_CHECKING:
    from ..result.result import Result


def metadata_of(case: Problem) -> Metadata:
    """Return the metadata of the result of `case`."""
    return Metadata(
        title=case.title,
        deck=case.deck_text,
        deck_file=visible(str(case.deck_file or "")),
        fields=tuple(case.output.fields),
        every=case.output.every,
        planned_steps=case.planned_steps,
        parameters=parameters_of(case),
    )


def listeners(
    case: Problem, progress: Listener | bool | None = None, on_step: Callable[[Step], object] | None = None
) -> Listener:
    """Return the listeners of a run: log, display of progress, callback; arguments as `run`."""
    shown = [progress] if isinstance(progress, Listener) else [reporter()] if progress else []
    callbacks = [Callback(on_step, refines=case.accuracy is not None)] if on_step else []
    return Listeners(Log(), *shown, *callbacks)


def run(
    case: Problem,
    output: str | Path | None = None,
    overwrite: bool = False,
    on_step: Callable[[Step], object] | None = None,
    progress: Listener | bool | None = None,
) -> Result:
    """Solve a case, with an output into a file; arguments and exceptions as of `hexcontact.Case.run`.

    `on_step` is called after a step was written; with a target accuracy, with those of every lattice. With an
    output a run that it ends can be resumed.
    """
    listener = listeners(case, progress, on_step)
    if output is None:
        with listener.following(case.title, case.planned_steps):
            result = _in_memory(case, listener)
            return checked(result) if case.accuracy or case.adaptive else result
    with Store(output, metadata_of(case), overwrite) as store:
        run_into(case, store, listener)
    return checked(open_result(store.path))


def checked(result: Result) -> Result:
    """Warn if a result misses an accuracy that its case asks for."""
    sentences = [result.shortfall]
    if "step_limited" in result.dataset:
        histories = [{"step_limited": limited} for limited in result.dataset["step_limited"]]
        sentences.append(limited_steps(histories, float(result.dataset.attrs.get("step_tolerance", 0.0))))
    for sentence in filter(None, sentences):
        warn(sentence, AccuracyWarning)
    return result


def _in_memory(case: Problem, listener: Listener) -> Result:
    """Solve a case; if a callback ends the run, the result has the finished steps of the present lattice."""
    from ..result.result import Result

    about, trials, stopped = metadata_of(case), None, ""
    finished: list[Step] = []
    try:
        if case.accuracy is not None:
            from . import lattices

            refinement = lattices.refine(case, lattices.InMemory(finished, listener))
            about, trials = refinement.metadata(about), refinement.trials
            finished = [refinement.with_errors(step) for step in finished]
        else:
            for step in steps(case, in_memory=True, listener=listener):
                finished.append(dataclasses.replace(step, companion={}))
                listener.step(step)
    except Stopped as reason:
        stopped = str(reason)
    return Result(partial(assemble, about, finished, not stopped, trials, stopped))


def run_into(case: Problem, store: Store, listener: Listener, before: Sequence[Step] = ()) -> None:
    """Solve a case into a store with its tables; arguments as of `solve_into`."""
    with listener.following(case.title, case.planned_steps):
        solve_into(case, store, listener, before)
        if store.finished and (case.deck.stress or case.deck.fatigue):
            write_stresses(store.path, case, listener)


def solve_into(case: Problem, store: Store, listener: Listener, before: Sequence[Step] = ()) -> None:
    """Solve a case into a store, up to the finished output, without the tables [[stress]] and [[fatigue]].

    `before` are the steps in the store, as of `steps`. Finished lattices of a refinement in it are not solved
    again.
    """
    try:
        if case.accuracy is not None:
            from . import lattices

            solver = lattices.OnDisk(store, listener)
            solver.finish(lattices.refine(case, solver))
        else:
            _record_steps(case, store, listener, before)
            store.finish()
    except Stopped as reason:
        listener.said("stopped", level=logging.WARNING, reason=str(reason))
        store.close(str(reason))
    else:
        listener.said("written", file=store.path)


def _record_steps(case: Problem, store: Store, listener: Listener, before: Sequence[Step]) -> None:
    """Record all load steps, and pass them on; the store records an exception of a callback.

    Apart from `solve_into`, so that the last one is freed before the output.
    """
    for step in steps(case, before=before, listener=listener):
        store.append(step)
        store.publish()
        try:
            listener.step(step)
        except Stopped:
            raise
        except Exception as error:
            store.close(f"on_step raised {type(error).__name__} after step {step.number}: {error}")
            if not isinstance(error, HexcontactError):  # to which the store adds it
                error.add_note(store.kept)
            raise
        del step  # its memory goes before the next one is solved


def write_stresses(output: Path, case: Problem | None = None, listener: Listener | None = None) -> list[Path]:
    """Write the missing tables [[stress]] and [[fatigue]] of the deck of a result; return the files.

    The case, by default that of the deck, is solved on coarser lattices where a table asks for errors.
    """
    if not (missing := missing_stresses(output)):
        return []
    listener = listener or Log()
    from ..interior.files import tables_of, write_netcdf
    from ..interior.stress import with_errors
    from ..result.export import kept_steps
    from ..result.result import at_hand

    result = open_result(output)
    try:
        refined = "trial_level" in result.dataset
        wanted = [name for name, t in tables_of(result.deck).items() if refined or t.estimate_error]
        asked = [name for name in missing if name in wanted]
        others = list(_on_coarser(result, case, asked, listener)) if asked else []
        for name, found in at_hand(result, kept_steps(result), [*missing], anew=True):
            if name in wanted:
                with_errors(found, result.lattice.spacing, [(h, tables[name]) for h, tables in others])
            require_free([missing[name]], overwrite=True)
            listener.said("written", file=write_netcdf(found, missing[name]))
    finally:
        result.close()
    return [*missing.values()]


def _on_coarser(
    result: Result, case: Problem | None, names: list[str], listener: Listener
) -> Iterator[tuple[float, dict[str, Dataset]]]:
    """Solve the case of a result on coarser lattices; yield the spacing and some tables of each."""
    from ..result.export import kept_steps
    from ..result.result import Result, at_hand

    case = case or Problem.from_text(result.deck, f"deck of {result.path}")
    level = int(result.dataset["trial_level"].max()) if "trial_level" in result.dataset else 0
    for other in coarser(case, level):
        text = f"estimated errors of tables: spacing {quantity(other.lattice.spacing, 'm')}"
        listener.said("errors of tables", text, spacing=other.lattice.spacing, origin=other.lattice.origin)
        require_memory(other, other.lattice, len(other.load_steps))
        finished = list(steps(other, in_memory=True, listener=Listener()))
        found = Result(partial(assemble, metadata_of(other), finished, True, None, ""))
        yield other.lattice.spacing, dict(at_hand(found, kept_steps(found), names, anew=True))


# --- a resumed run ------------------------------------------------------------------------------------------
