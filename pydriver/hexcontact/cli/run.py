"""Commands that solve: run, resume, study, verify."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Annotated

import typer

from ..errors import DeckError
from ..solve.interruption import Interrupted, in_background, news
from .guard import Content, Failure, complain, guarded
from .options import AsJson, DeckFile, Level, LogFile, Plot, Quiet, Settings, setting


@guarded
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
    from ..solve.run import metadata_of
    from . import run_command as command

    listeners = command.Listeners("run", quiet, as_json, log_file, log_level)
    with listeners.logging(deck, *([output] if output else [])):
        case = command.case_of(deck, settings)
        target = command.target_of(case, deck, output)
        listeners.spare(target)
        heard = context.with_resource(news())  # up to the end: what is complete stays so, whatever comes
        with Store(target, metadata_of(case), overwrite) as store:
            histories = command.solved(case, store, heard, deck.stem, listeners)
        picture = command.overview(store.path) if plot else None
    return listeners.tell(case, histories, target, picture)


@guarded
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
    from . import run_command as command

    listeners = command.Listeners("resume", quiet, as_json, log_file, log_level)
    overrides = dict(map(setting, settings or ()))
    heard = context.with_resource(news())
    with listeners.logging(file), restart.reopened(file, overrides=overrides) as again:
        if again is not None:
            if again.warning:
                complain(f"warning: {again.warning}")
            histories = command.solved(again.case, again.store, heard, file.stem, listeners, again.before)
    if again is not None:
        path = again.store.path
        picture = command.overview(path) if plot else None
        return listeners.tell(again.case, histories, path, picture, [again.warning] * bool(again.warning))
    return command.was_finished(file, command.overview(file) if plot else None, listeners)


@guarded
def study(
    context: typer.Context,
    file: Annotated[
        Path, typer.Argument(metavar="STUDY", help="The study, a TOML file.", show_default=False)
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Result; default: the study's output, or STUDY.nc here. Cases go beside it.",
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", help="Cases at a time on this machine; default: the cores.")
    ] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Run on a Dask cluster, as tcp://host:8786.")
    ] = None,
    slurm: Annotated[bool, typer.Option("--slurm", help="Print a job array for sbatch instead.")] = False,
    case: Annotated[
        int | None, typer.Option(metavar="N", help="Run only case N (what a job array does).")
    ] = None,
    collect: Annotated[
        bool, typer.Option("--collect", help="Run nothing, put together what is there.")
    ] = False,
    retry: Annotated[bool, typer.Option("--retry", help="Run cases that failed again.")] = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    log_file: LogFile = None,
    log_level: Level = None,
) -> Content:
    """Run the missing ones of many cases that differ in keys of one deck; exit code 3 if some failed."""
    from ..study.study import Study
    from . import json_output
    from . import study as command
    from .run_command import Listeners

    if sum([slurm, case is not None, collect, dask is not None, jobs is not None]) > 1:
        raise DeckError("expected only one of --jobs, --dask, --slurm, --case and --collect")
    if slurm and as_json:
        raise DeckError("--json: expected no --slurm, which prints a script")
    listeners = Listeners("study", quiet, as_json, log_file, log_level)
    planned = Study.from_toml(file, output, check=case is None and not collect)
    if slurm:
        print(command.slurm_script(planned, file, retry) or "# no case is missing")
        return None
    with listeners.logging(file, planned.output):
        if case is not None:
            outcome = command.run_case(planned, case, retry, listeners, context.with_resource(news()))
            if outcome.exit_code:
                raise Failure(outcome.message, outcome.exit_code)
            return {
                "case": case,
                "output": planned.folder.folder / f"{case:04d}.nc",
                "seconds": outcome.seconds,
            }
        if collect:
            planned.collect()
        else:
            cancel = threading.Event()
            options = {
                "jobs": jobs,
                "dask": dask,
                "retry": retry,
                "watcher": command.watcher(listeners.silent),
            }
            work, ends = command.run_in_background(planned, cancel, options)
            try:
                in_background(work, context.with_resource(news()), ends)
            except Interrupted as signaled:
                message = f"interrupted; {command.interrupted(planned)}"
                raise Failure(message, signaled.exit_code) from None
    code = command.report(planned, quiet or as_json)
    if as_json:
        return {"exit_code": code, **json_output.of_study(planned)}
    if code:
        raise typer.Exit(code)
    return None


@guarded
def verify(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help="Which comparisons; default: all.", show_default=False),
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the comparisons.")] = False,
    as_json: AsJson = False,
) -> Content:
    """Test the installation: solve a few contacts and compare them with known solutions.

    Exit code 1 if a comparison fails.
    """
    from . import verify as comparisons

    if as_json:
        return comparisons.for_programs(names or [], listing=listing)
    raise typer.Exit(comparisons.main(names or [], listing=listing))
