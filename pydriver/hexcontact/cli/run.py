"""Commands that solve: run, resume."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import DeckError
from ..solve.interruption import signal_pipe
from . import frame

if TYPE_CHECKING:
    from .solving import Messages


@frame.command(
    "hexcontact run cases/hertz_spheres.toml --plot",
    output=frame.option("--output -o", "File to write; default: the deck's output.file, or DECK.nc here."),
    overwrite=frame.option("--overwrite", "Replace an existing output."),
    again=frame.option("--resume", "Resume an interrupted run of this deck; keep a finished result."),
)
def run(
    deck: Path,
    output: Path | None = None,
    overwrite: bool = False,
    again: bool = False,
    plot: bool = False,
    quiet: bool = False,
    as_json: bool = False,
    log_file: Path | None = None,
    log_level: frame.LogLevel | None = None,
    settings: list[str] | None = None,
) -> frame.Content:
    """Solve a deck; each load step is written to the disk before the next begins."""
    from ..result.store import Store
    from ..solve import events
    from ..solve.restart import was_begun
    from ..solve.run import metadata_of
    from .solving import Messages, overview, picture_beside, solved

    if again and overwrite:
        raise DeckError("--resume: expected no --overwrite with it")
    messages = Messages("run", quiet, as_json, log_file, log_level)
    with messages.of_all_ranks(deck, *([output] if output else [])):
        case = frame.case_of(deck, settings)
        target = frame.target_of(case, deck, output)
        events.refuse_as_log(log_file, [target])
        if plot:  # refuses before the run
            picture_beside(target)
        if again and was_begun(target, case):
            return _resumed(target, plot, messages, case=case)
        with signal_pipe() as pipe, Store(target, metadata_of(case), overwrite) as store:
            extent = solved(case, store, pipe, deck.stem, messages)
        return messages.conclude(case, store, extent, target, overview(target) if plot else None)


@frame.command(
    "hexcontact resume fretting.nc",
    file=frame.argument("FILE", "The output of the run."),
    settings=frame.option(
        "--set",
        "Change the solver for the further steps, as solver.tolerance=1e-7. Repeatable.",
        "KEY=VALUE",
    ),
)
def resume(
    file: Path,
    plot: bool = False,
    quiet: bool = False,
    as_json: bool = False,
    log_file: Path | None = None,
    log_level: frame.LogLevel | None = None,
    settings: list[str] | None = None,
) -> frame.Content:
    """Resume a run that was interrupted or killed, ran out of disk or did not converge.

    The result is bit-identical to that of a run in one go, on the same machine with as many threads.
    """
    from .solving import Messages

    messages = Messages("resume", quiet, as_json, log_file, log_level)
    with messages.of_all_ranks(file):
        return _resumed(file, plot, messages, overrides=dict(map(frame.setting, settings or ())))


def _resumed(file: Path, plot: bool, messages: Messages, **changes: Any) -> frame.Content:
    """Resume the run of an output, with the case or the overrides of `reopened`."""
    from ..solve.restart import output_of, reopened
    from .solving import overview, picture_beside, solved, with_tables

    with signal_pipe() as pipe, reopened(file, **changes) as again:
        if again is None:
            with_tables(output_of(file), pipe, messages)
        else:
            if plot:
                picture_beside(again.store.path)
            if again.warning:
                frame.print_error(f"warning: {again.warning}")
            extent = solved(again.case, again.store, pipe, file.stem, messages, again.before)
    path = again.store.path if again is not None else file
    path = path if file.is_absolute() else Path(os.path.relpath(path))
    picture = overview(path) if plot else None
    if again is None:
        return messages.was_finished(file, picture)
    return messages.conclude(again.case, again.store, extent, path, picture, again.warning)
