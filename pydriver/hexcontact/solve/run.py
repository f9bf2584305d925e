"""Running of a case to its result, from the first load step or from the journal of an unfinished run."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._version import __version__
from ..arrays import Dataset
from ..deck.read import recorded
from ..errors import AccuracyWarning, DeckError, HexcontactError, PlausibilityWarning, warn
from ..problem import plausibility
from ..problem.preview import coarser, parameters_of
from ..problem.problem import Problem
from ..result.history_words import limited_steps
from ..result.journal import Journal, TrialFolder, journal_of
from ..result.layout import Metadata, assemble, now
from ..result.netcdf import missing_stresses, read_output, require_free
from ..result.step import Step
from ..result.store import Store, open_result
from ..text import counted, quantity, visible
from .events import Callback, Listener, Listeners, Log, Stopped, reporter
from .memory_needed import require_memory
from .steps import check_step, lacks_ends, steps

if TYPE_CHECKING:
    from ..result.result import Result


_PHYSICS = ("algorithm", "coupling", "entry")  # keys of [solver] that belong to the problem
_NOT_PHYSICS = ("title", "solver", "output", "stress")  # tables of a deck that do not


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
        _run_into(case, store, listener)
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


def _run_into(case: Problem, store: Store, listener: Listener, before: Sequence[Step] = ()) -> None:
    """Solve a case into a store with its tables; arguments as of `solve_into`."""
    with listener.following(case.title, case.planned_steps):
        solve_into(case, store, listener, before)
        if store.finished:
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
    missing = missing_stresses(output) if case is None or case.deck.stress or case.deck.fatigue else None
    if not missing:
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


@dataclass
class Restart:
    """A run that is resumed: with all solved steps, the last one with its fields, and its warning."""

    case: Problem
    store: Store
    before: list[Step]
    warning: str = ""  # reason why the result may differ from that of an uninterrupted run


def resume(
    path: str | os.PathLike[str],
    *,
    case: Problem | None = None,
    overrides: Mapping[str, Any] | None = None,
    on_step: Callable[[Step], object] | None = None,
    progress: Listener | bool | None = None,
) -> Result:
    """Resume a run that was interrupted, was killed, met a full disk or did not converge.

    The result, also of a finished run, is bit-identical to that of a run in one go, on the same machine with
    as many threads. DeckError if there is no unfinished run, another run is writing it, or the case is not
    that of the run; other errors as of `hexcontact.Case.run`.

    Parameters
    ----------
    path : path
        The output of the run; its finished steps are in the journal beside it.
    case : Problem, optional
        The problem, if the deck does not contain all of it, such as a gap given in Python.
    overrides : mapping, optional
        New values for keys of the solver, as ``{"solver.tolerance": 1e-7}``, for the remaining steps.
    on_step : callable, optional
        Called with each further `Step`.
    progress : Listener or bool, optional
        Follows the run; True: a bar on a terminal, lines otherwise.

    Examples
    --------
    >>> result = hexcontact.resume("fretting.nc")  # doctest: +SKIP
    """
    with reopened(path, case, overrides) as restart:
        if restart is None:
            if (output := output_of(Path(path))).is_file():  # its tables may be missing
                write_stresses(output, case)
            return checked(open_result(path))
        if restart.warning:
            warn(restart.warning, UserWarning)
        for sentence in plausibility.warnings(restart.case):
            warn(sentence, PlausibilityWarning)
        listener = listeners(restart.case, progress, on_step)
        _run_into(restart.case, restart.store, listener, restart.before)
    return checked(open_result(restart.store.path))


def was_begun(path: Path, case: Problem) -> bool:
    """Return whether a run left finished steps or a result; DeckError if they are of another case."""
    if not (path.exists() or Journal(journal_of(path)) or TrialFolder(journal_of(path))):
        return False
    with contextlib.closing(open_result(path)) as found:
        _require_same(path, found.deck, case)
    return True


@contextlib.contextmanager
def reopened(
    path: str | os.PathLike[str], case: Problem | None = None, overrides: Mapping[str, Any] | None = None
) -> Iterator[Restart | None]:
    """Open a run to resume it, and close it at the end; None if it is finished; arguments as of `resume`."""
    store, last = _found(output_of(Path(path)))
    refines = store is not None and bool(TrialFolder(store.folder))
    if store is None or (last is None and not refines):
        if store is not None:
            store.close()
        yield None
        return
    try:
        case = _case(store.metadata, case, overrides or {}, store.path)
        _check(case, store, last)
        about = _continued(store, case)
        store.go_on(about)
    except BaseException:
        store.close()  # the recorded reason of the end does not change
        raise
    with store:
        before = [] if last is None else [*store.heads[:-1], last]
        older = (
            f"the run was started by hexcontact {store.metadata.version} and is resumed by {__version__}; "
            "the result may differ from what either of them gives alone"
        )
        doubts = [older] * (store.metadata.version != __version__)
        if last is not None and lacks_ends(last):
            doubts.append(
                f"the restart data of step {last.number} are missing, since only the last two steps of a run "
                "keep them; the further cycles of wear are solved to the same tolerances after a new pair of "
                "jumps, but differ from those of an uninterrupted run"
            )
        yield Restart(case, store, before, "; ".join(doubts))


def physics(deck: str) -> dict[str, Any]:
    """Return the tables of a deck that belong to the problem, without those of solution and output."""
    tables = tomllib.loads(deck)
    solver = {key: value for key, value in tables.get("solver", {}).items() if key in _PHYSICS}
    return {**{key: value for key, value in tables.items() if key not in _NOT_PHYSICS}, "solver": solver}


def _require_same(path: Path, deck: str, case: Problem) -> None:
    """Refuse a case whose deck states another problem than that of a result."""
    if not deck or physics(deck) != physics(case.deck_text):
        raise DeckError(f"the case is not the one that {path} is the result of: their decks differ")


def output_of(path: Path) -> Path:
    """Return the output of a run, by its own path or that of its journal."""
    if path.is_dir() and path.name.endswith(".d"):
        output = path.with_name(path.name.removesuffix(".d"))
        return output if journal_of(output) == path else path
    return path


def _found(path: Path) -> tuple[Store | None, Step | None]:
    """Open the journal of an output; no store if the run is finished."""
    for _ in range(2):  # again if a run that just finished deleted its journal
        with contextlib.suppress(FileNotFoundError):
            return Store.reopened(path)
        with contextlib.suppress(FileNotFoundError):
            output = read_output(path)
            output.close()
            if output.complete:
                return None, None
            planned = output.dataset.attrs["planned_steps"] or "an open number of"
            raise DeckError(
                f"{path} has {len(output)} of {planned} load steps, but its journal "
                f"{journal_of(path)} is not there, which has the restart data; run it again with --overwrite "
                "(overwrite=True in Python)"
            )
    raise DeckError(f"there is neither a file {path} nor a journal {journal_of(path)} of a run")


def _case(metadata: Metadata, case: Problem | None, overrides: Mapping[str, Any], path: Path) -> Problem:
    """Return the case of the run."""
    for key in overrides:
        table, _, name = key.partition(".")
        if table != "solver" or name.partition(".")[0] in ("", *_PHYSICS):
            raise DeckError(
                f"{key}: a resumed run may only change how it is solved, such as solver.tolerance"
            )
    if case is not None:
        if overrides:
            raise DeckError("expected a case or overrides, not both")
        _require_same(path, metadata.deck, case)
        return case
    if not metadata.deck:
        raise DeckError(f"the journal of {path} holds no deck")
    if "surface" in recorded(metadata.deck, f"deck of {path}").given:
        raise DeckError(
            f"the gap of {path} was given in Python; resume there: "
            f"hexcontact.resume({str(path)!r}, case=case)"
        )
    try:
        again = Problem.from_text(metadata.deck, metadata.deck_file or f"deck of {path}", overrides)
    except HexcontactError as error:
        if metadata.version != __version__:
            error.add_note(f"the run was started by hexcontact {metadata.version}, this is {__version__}")
        raise
    again.deck_file = Path(metadata.deck_file) if metadata.deck_file else None
    return again


def _check(case: Problem, store: Store, last: Step | None) -> None:
    """Refuse another case than that of the steps, as after changes in files that its deck names."""
    found = (
        f"{counted(len(store.heads), 'finished step')} of {store.path}" if last else f"steps of {store.path}"
    )
    planned = store.metadata.planned_steps
    if last is not None:
        planned = int(last.control.get("load_steps", planned))
    if len(case.load_steps) != planned:
        raise DeckError(
            f"the deck now has {counted(len(case.load_steps), 'load step')}; the {found} are of {planned}"
        )
    if last is not None:
        check_step(case, last, found)


def _continued(store: Store, case: Problem) -> Metadata:
    """Return the metadata of a resumed run, with a line about it."""
    old, new = store.metadata, metadata_of(case)
    changed = [
        f"{name} = {value:g} instead of {old.parameters[name]:g}"
        for name, value in new.parameters.items()
        if name in ("tolerance", "step_tolerance") and value != old.parameters.get(name)
    ]
    done = f"step {len(store.heads)}"
    if trials := TrialFolder(store.folder):
        done = counted(len(trials.solutions), "lattice")
    line = f"{now()} resumed after {done} by hexcontact {__version__}"
    return dataclasses.replace(
        old, deck=new.deck, parameters=new.parameters, resumed=(*old.resumed, ", ".join([line, *changed]))
    )
