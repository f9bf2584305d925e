"""Resuming of unfinished runs from their journals."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._version import __version__
from ..deck.read import recorded
from ..errors import DeckError, HexcontactError, PlausibilityWarning, warn
from ..problem import plausibility
from ..problem.problem import Problem
from ..result.journal import Journal, TrialFolder, journal_of
from ..result.layout import Metadata, now
from ..result.netcdf import read_output
from ..result.step import Step
from ..result.store import Store, open_result
from ..text import counted
from .events import Listener
from .run import checked, listeners, metadata_of, run_into, write_stresses
from .steps import check_step, lacks_ends

if TYPE_CHECKING:
    from ..result.result import Result


_PHYSICS = ("algorithm", "coupling", "entry")  # keys of [solver] that belong to the problem
_NOT_PHYSICS = ("title", "solver", "output", "stress")  # tables of a deck that do not


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
        run_into(restart.case, restart.store, listener, restart.before)
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
