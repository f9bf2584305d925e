"""The command that runs many cases: ``hexcontact study``, here or as a Slurm job array."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import DeckError
from ..solve.interruption import Interrupted, in_background, signal_pipe
from .guard import Content, Failure, command, complain, say
from .options import AsJson, Level, LogFile, Quiet

if TYPE_CHECKING:
    from ..study.study import Outcome, PlannedCase, Study
    from .messages import Messages

FAILED = 3  # exit code of a study of which some cases failed
_MOST_NAMED = 20  # failures listed at the end


@command("hexcontact study cases/study_friction.toml --jobs 4")
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
    from ..study.progress import study_reporter
    from ..study.study import Study
    from .messages import Messages

    if sum([slurm, case is not None, collect, dask is not None, jobs is not None]) > 1:
        raise DeckError("expected only one of --jobs, --dask, --slurm, --case and --collect")
    if slurm and as_json:
        raise DeckError("--json: expected no --slurm, which prints a script")
    messages = Messages("study", quiet, as_json, log_file, log_level)
    planned = Study.from_toml(file, output, check=case is None and not collect)
    if slurm:
        print(slurm_script(planned, file, retry) or "# no case is missing")
        return None
    with messages.logging(file, planned.output):
        if case is not None:
            outcome = _run_case(planned, case, retry, messages, context)
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
            shown = study_reporter(messages.silent)
            _run_missing(planned, context, jobs=jobs, dask=dask, retry=retry, listener=shown)
    state = _State.of(planned)
    state.report(quiet or as_json)
    if as_json:
        return {"exit_code": state.exit_code, **state.content()}
    if state.exit_code:
        raise typer.Exit(state.exit_code)
    return None


@dataclass(frozen=True)
class _State:
    """How far a study is: finished cases, those that failed, and the number of those that were not run."""

    study: Study
    done: int
    failures: Sequence[tuple[PlannedCase, Outcome]]
    missing: int

    @classmethod
    def of(cls, study: Study) -> _State:
        """Look at the files of the cases."""
        done, failures = sum(study.folder.done(case) for case in study.cases), study.failures()
        return cls(study, done, failures, len(study) - done - len(failures))

    @property
    def exit_code(self) -> int:
        """Exit code of the command."""
        return FAILED if self.done < len(self.study) else 0

    def report(self, quiet: bool) -> None:
        """Say what is there, what failed and why."""
        study = self.study
        number = study.folder.number
        if not quiet:
            files = f"their files in {study.folder.folder}/"
            say(f"written: {study.output}, {self.done} of {len(study)} cases ({files})")
        for case, outcome in self.failures[:_MOST_NAMED]:
            complain(f"case {number(case)} ({case}) failed: {outcome.message.splitlines()[0]}")
        if len(self.failures) > _MOST_NAMED:
            complain(f"... and {len(self.failures) - _MOST_NAMED} more; all are in {study.output}")
        if self.missing:
            complain(f"{self.missing} of {len(study)} cases have not been run")
        if any(outcome.lasting for _, outcome in self.failures):
            complain("--retry runs cases again that failed by themselves")

    def content(self) -> dict[str, Any]:
        """Return the same for programs."""
        study = self.study
        return {
            "title": study.title,
            "output": study.output,
            "folder": study.folder.folder,
            "cases": len(study),
            "done": self.done,
            "missing": self.missing,
            "failed": [
                {
                    "case": study.folder.number(case),
                    "parameters": case.settings,
                    "exit_code": outcome.exit_code,
                    "message": outcome.message,
                }
                for case, outcome in self.failures
            ],
        }


def _run_case(study: Study, number: int, retry: bool, messages: Messages, context: typer.Context) -> Outcome:
    """Run one case for a job array; signals end the process unless it is done, and finished steps stay."""
    from ..solve.progress import reporter

    outcomes: list[Outcome] = []
    shown = reporter(messages.silent)
    try:
        in_background(
            lambda: outcomes.append(study.run_case(number, retry, shown)),
            context.with_resource(signal_pipe()),
            lambda _: not (outcomes or study.has(number)),
        )
    except Interrupted as signaled:
        kept = f"the finished load steps of case {number} are kept; the same command goes on after them"
        messages.interrupted(signaled, kept)
    return outcomes[0]


def _run_missing(study: Study, context: typer.Context, **options: Any) -> None:
    """Run the missing cases in a second thread; a signal cancels them unless the study is complete."""
    cancel, over, complete = (threading.Event() for _ in range(3))
    kind, settings = study.backend(options["jobs"], options["dask"])
    kind.load(settings)

    def work() -> None:
        try:
            if study.run(cancel=cancel, **options) is not None:
                complete.set()
        finally:
            over.set()

    def ends(_: Interrupted) -> bool:
        cancel.set()
        over.wait()
        return not complete.is_set()

    try:
        in_background(work, context.with_resource(signal_pipe()), ends)
    except Interrupted as signaled:
        kept = f"{_State.of(study).done} of {len(study)} cases are finished and kept"
        message = f"interrupted; {kept} in {study.folder.folder}/; the same command runs the rest"
        raise Failure(message, signaled.exit_code) from None


def slurm_script(study: Study, path: Path, retry: bool) -> str:
    """Return a job array that runs the missing cases; empty if there are none."""
    from ..study.backend import BACKENDS

    numbers = sorted(study.folder.number(case) for case in study.missing(retry))
    array = BACKENDS["slurm"](study.file.slurm, len(study))
    return array.script(numbers, path, study.output, retry) if numbers else ""
