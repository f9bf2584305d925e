"""Commands that solve: run, resume."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ..errors import DeckError
from ..solve.interruption import signal_pipe
from . import frame

if TYPE_CHECKING:
    from .solving import Messages


@frame.command("hexcontact run cases/hertz_spheres.toml --plot")
def run(
    deck: frame.DeckFile,
    output: Annotated[
        Path | None, frame.output_to("File to write; default: the deck's output.file, or DECK.nc here.")
    ] = None,
    overwrite: Annotated[bool, frame.flag("overwrite", "Replace an existing output.")] = False,
    again: Annotated[
        bool, frame.flag("resume", "Resume an interrupted run of this deck; keep a finished result.")
    ] = False,
    plot: frame.Plot = False,
    quiet: frame.Quiet = False,
    as_json: frame.AsJson = False,
    log_file: frame.LogFile = None,
    log_level: frame.Level = None,
    settings: frame.Settings = None,
) -> frame.Content:
    """Solve a deck; each load step is written to the disk before the next begins."""
    from ..core import ranks
    from ..result.store import Store
    from ..solve import events
    from ..solve.run import metadata_of, was_begun
    from .solving import Messages, overview, picture_beside, solved

    if again and overwrite:
        raise DeckError("--resume: expected no --overwrite with it")
    messages = Messages("run", quiet, as_json, log_file, log_level)
    with ranks.together() as first:
        if not first:
            raise SystemExit  # the first one prints
        with messages.logging(deck, *([output] if output else [])):
            case = frame.case_of(deck, settings)
            target = frame.target_of(case, deck, output)
            events.refuse_as_log(log_file, [target])
            if plot:  # refuses before the run
                picture_beside(target)
            if again and was_begun(target, case):
                return _resumed(target, plot, messages, case=case)
            with signal_pipe() as pipe, Store(target, metadata_of(case), overwrite) as store:
                extent = solved(case, store, pipe, deck.stem, messages)
            picture = overview(target) if plot else None
        return messages.conclude(case, store, extent, target, picture)


@frame.command("hexcontact resume fretting.nc")
def resume(
    file: Annotated[Path, frame.argument("FILE", "The output of the run.")],
    plot: frame.Plot = False,
    quiet: frame.Quiet = False,
    as_json: frame.AsJson = False,
    log_file: frame.LogFile = None,
    log_level: frame.Level = None,
    settings: Annotated[
        list[str] | None,
        frame.settings_option("Change the solver for the further steps, as solver.tolerance=1e-7"),
    ] = None,
) -> frame.Content:
    """Resume a run that was interrupted or killed, ran out of disk or did not converge.

    The result is bit-identical to that of a run in one go, on the same machine with as many threads.
    """
    from ..core import ranks
    from .solving import Messages

    messages = Messages("resume", quiet, as_json, log_file, log_level)
    with ranks.together() as first:
        if not first:
            raise SystemExit  # the first one prints
        with messages.logging(file):
            return _resumed(file, plot, messages, overrides=dict(map(frame.setting, settings or ())))


def _resumed(file: Path, plot: bool, messages: Messages, **changes: Any) -> frame.Content:
    """Resume the run of an output, with the case or the overrides of `reopened`."""
    from ..solve.run import output_of, reopened
    from .solving import overview, picture_beside, solved, with_tables

    with signal_pipe() as pipe, reopened(file, **changes) as again:
        if again is not None:
            if plot:
                picture_beside(again.store.path)
            if again.warning:
                frame.print_error(f"warning: {again.warning}")
            extent = solved(again.case, again.store, pipe, file.stem, messages, again.before)
        else:
            with_tables(output_of(file), pipe, messages)
    path = again.store.path if again is not None else file
    path = path if file.is_absolute() else Path(os.path.relpath(path))
    picture = overview(path) if plot else None
    if again is None:
        return messages.was_finished(file, picture)
    notes = [again.warning] * bool(again.warning)
    return messages.conclude(again.case, again.store, extent, path, picture, notes)
