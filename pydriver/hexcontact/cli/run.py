"""Commands that solve: run and resume."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..solve.interruption import signal_pipe
from .guard import Content, command, complain
from .options import AsJson, DeckFile, Level, LogFile, Plot, Quiet, Settings, case_of, setting, target_of


@command("hexcontact run cases/hertz_spheres.toml --plot")
def run(
    context: typer.Context,
    deck: DeckFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File to write; default: the deck's output.file, or DECK.nc here."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an output that is there.")] = False,
    plot: Plot = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    log_file: LogFile = None,
    log_level: Level = None,
    settings: Settings = None,
) -> Content:
    """Solve a deck; each load step is safe on the disk before the next begins."""
    from ..result.store import Store
    from ..solve import log
    from ..solve.run import metadata_of
    from .messages import Messages, overview, solved

    messages = Messages("run", quiet, as_json, log_file, log_level)
    with messages.logging(deck, *([output] if output else [])):
        case = case_of(deck, settings)
        target = target_of(case, deck, output)
        log.refuse_same(log_file, [target])
        pipe = context.with_resource(signal_pipe())  # up to the end: a complete output stays, whatever comes
        with Store(target, metadata_of(case), overwrite) as store:
            histories = solved(case, store, pipe, deck.stem, messages)
        picture = overview(store.path) if plot else None
    return messages.conclude(case, histories, target, picture)


@command("hexcontact resume fretting.nc")
def resume(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The output of the run.", show_default=False)],
    plot: Plot = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    log_file: LogFile = None,
    log_level: Level = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change how the further steps are solved, as solver.tolerance=1e-7. Repeatable.",
        ),
    ] = None,
) -> Content:
    """Go on with a run that was interrupted or killed, met a full disk or did not converge.

    The result is to the bit that of a run in one go, on the same machine with as many threads.
    """
    from ..solve import restart
    from .messages import Messages, overview, solved

    messages = Messages("resume", quiet, as_json, log_file, log_level)
    overrides = dict(map(setting, settings or ()))
    pipe = context.with_resource(signal_pipe())
    with messages.logging(file), restart.reopened(file, overrides=overrides) as again:
        if again is not None:
            if again.warning:
                complain(f"warning: {again.warning}")
            histories = solved(again.case, again.store, pipe, file.stem, messages, again.before)
    path = again.store.path if again is not None else file
    picture = overview(path) if plot else None
    if again is None:
        return messages.was_finished(file, picture)
    return messages.conclude(again.case, histories, path, picture, [again.warning] * bool(again.warning))
