"""The command that runs the cases of a study: ``hexcontact study``."""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import launcher
from ..errors import DeckError
from ..solve.interruption import Interrupted, in_background, signal_pipe
from ..text import Table, counted
from . import frame

if TYPE_CHECKING:
    from ..study.plan import CheckLevel
    from ..study.study import Outcome, Study
    from .solving import Messages

_SOME_FAILED = 3  # exit code of a study with failed or missing cases
_MOST_NAMED = 20  # failures listed at the end


@frame.command(
    "hexcontact study cases/study_friction.toml --jobs 4",
    file=frame.argument("STUDY", "The study, a TOML file."),
    output=frame.option(
        "--output -o", "Result; default: the study's output, or STUDY.nc here. Cases go beside it."
    ),
    jobs=frame.option("--jobs -j", "Cases at a time on this machine; default: the cores."),
    dask=frame.option("--dask", "Run on a Dask cluster, as tcp://host:8786.", "ADDRESS"),
    slurm=frame.option("--slurm", "Run nothing; print a job array for sbatch."),
    case=frame.option("--case", "Run only these cases, as a task does: 3, or 1,4-6.", "N,..."),
    collect=frame.option("--collect", "Run nothing; combine the finished cases."),
    plan=frame.option("--plan --dry-run", "Run nothing; print all cases and their states."),
    skip_invalid=frame.option("--skip-invalid", "Leave out invalid cases, and name each."),
    retry=frame.option("--retry", "Repeat cases that failed."),
)
def study(
    file: Path,
    output: Path | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    slurm: bool = False,
    case: str | None = None,
    collect: bool = False,
    plan: bool = False,
    skip_invalid: bool = False,
    retry: bool = False,
    quiet: bool = False,
    as_json: bool = False,
    log_file: Path | None = None,
    log_level: frame.LogLevel | None = None,
) -> frame.Content:
    """Run the missing cases of a study, a deck with several values of keys; exit code 3 if any failed."""
    from ..deck.toml import read_toml
    from ..study.study import Study, study_reporter
    from .solving import Messages

    options = {"--jobs": jobs, "--dask": dask, "--slurm": slurm, "--case": case, "--collect": collect}
    options["--plan"] = plan
    given = [name for name, value in options.items() if value is not None and value is not False]
    if len(given) > 1:
        raise DeckError("expected only one of --jobs, --dask, --slurm, --case, --collect and --plan")
    if slurm and as_json:
        raise DeckError("--json: expected no --slurm, which prints a script")
    if plan:
        launcher.leave_to_first()
    elif case is None:
        launcher.refuse_copies("study does not use MPI", "and set OMP_NUM_THREADS to use more cores")
    messages = Messages("study", quiet, as_json, log_file, log_level)
    if "creep_table" in read_toml(file, "a study")[0]:
        given += ["--skip-invalid"] * skip_invalid + ["--retry"] * retry
        if given:
            raise DeckError(f"{given[0]}: expected no such option with a creep table, which is one case")
        return _creep_table(file, output, messages)
    unchecked = case is not None or (collect and not skip_invalid)
    check: CheckLevel = "nothing" if unchecked else "decks" if plan else "windows"
    planned = Study.from_toml(file, output, check, skip_invalid)
    for wrong in planned.invalid:
        number = planned.folder.number(wrong)
        frame.print_error(f"case {number} ({wrong}) is invalid and left out: {wrong.fault.splitlines()[0]}")
    if plan:
        return _plan(planned, as_json)
    if slurm:
        print(slurm_script(planned, file, retry))
        return None
    with messages.logging(file, planned.output):
        if case is not None:
            numbers = frame.steps_of(case, [""] * len(planned), "case")
            outcomes = _run_cases(planned, numbers, retry, messages)
            failed = [outcome for outcome in outcomes if outcome.exit_code]
            if failed:
                more = f"\n{len(failed)} of {len(numbers)} cases failed" if len(numbers) > 1 else ""
                raise frame.Failure(failed[0].message + more, failed[0].exit_code)
            done = [
                {"case": n, "output": planned.folder.folder / f"{n:04d}.nc", "seconds": outcome.seconds}
                for n, outcome in zip(numbers, outcomes, strict=True)
            ]
            return done[0] if len(done) == 1 else {"cases": done}
        if collect:
            planned.collect()
        else:
            listener = study_reporter(messages.silent)
            _run_missing(planned, jobs=jobs, dask=dask, retry=retry, listener=listener)
    state = _State(planned)
    state.report(quiet or as_json)
    if as_json:
        return {"exit_code": state.exit_code, **state.content()}
    if state.exit_code:
        raise SystemExit(state.exit_code)
    return None


def _creep_table(file: Path, output: Path | None, messages: Messages) -> frame.Content:
    """Compute a creep table; a signal ends the process, and nothing is written."""
    from ..solve.events import Lines
    from ..study.creep import CreepStudy

    table = CreepStudy.from_toml(file, output)
    found: list[Any] = []
    with messages.logging(file, table.output, table.table):
        try:
            with signal_pipe() as pipe:
                listener = None if messages.silent else Lines(sys.stderr)
                in_background(lambda: found.append(table.run(listener)), pipe)
        except Interrupted as signaled:
            messages.interrupted(signaled, "nothing is written")
    errors = found[0].attrs["interpolation_error"]
    if messages.as_json:
        content = {"title": table.title, "output": table.output, "table": table.table, "exit_code": 0}
        return content | {"cases": found[0]["status"].size, "interpolation_error": errors}
    if not messages.quiet:
        frame.print_output(f"written: {table.output}, {table.table}")
    return None


def _plan(study: Study, as_json: bool) -> frame.Content:
    """Print the cases of a study with their parameters and states; nothing is solved or written."""
    from ..study.plan import in_short

    states = study.states()
    cases = list(zip(map(study.folder.number, study.cases), study.cases, states, strict=True))
    if as_json:
        content = [{"case": n, "parameters": case.settings, "state": state} for n, case, state in cases]
        return {"title": study.title, "output": study.output, "cases": content}
    headers = ("case", *(axis.name for axis in study.plan.axes), "state")
    rows = [
        (str(number), *(in_short(case.settings.get(axis.key, "-")) for axis in study.plan.axes), state)
        for number, case, state in cases
    ]
    print(Table(headers, rows))
    counts = [f"{states.count(state)} {state}" for state in dict.fromkeys(states)]
    frame.print_output(f"{study.title}: {counted(len(study), 'case')}, {', '.join(counts)}")
    return None


class _State:
    """State of a study from the files of its cases, with the exit code of the command."""

    def __init__(self, study: Study) -> None:
        self.study, self.failures = study, study.failures()
        self.done = sum(study.folder.done(case) for case in study.cases)
        self.missing = len(study) - self.done - len(self.failures) - len(study.invalid)
        self.exit_code = _SOME_FAILED if self.failures or self.missing else 0

    def report(self, quiet: bool) -> None:
        """Print the number of finished cases, and why cases failed."""
        study = self.study
        number = study.folder.number
        if not quiet:
            files = f"their files in {study.folder.folder}/"
            frame.print_output(
                f"written: {study.output}, {self.done} of {counted(len(study), 'case')} ({files})"
            )
        for case, outcome in self.failures[:_MOST_NAMED]:
            frame.print_error(f"case {number(case)} ({case}) failed: {outcome.message.splitlines()[0]}")
        if len(self.failures) > _MOST_NAMED:
            frame.print_error(f"... and {len(self.failures) - _MOST_NAMED} more; all are in {study.output}")
        if self.missing:
            frame.print_error(
                f"{self.missing} of {counted(len(study), 'case has', 'cases have')} not been run"
            )
        if any(outcome.lasting for _, outcome in self.failures):
            frame.print_error("--retry runs cases again that failed by themselves")

    def content(self) -> dict[str, Any]:
        """Return the state as the object that ``study --json`` prints."""
        study = self.study
        return {
            "title": study.title,
            "output": study.output,
            "folder": study.folder.folder,
            "cases": len(study),
            "done": self.done,
            "missing": self.missing,
            "invalid": [{"parameters": case.settings, "message": case.fault} for case in study.invalid],
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


def _run_cases(study: Study, numbers: Sequence[int], retry: bool, messages: Messages) -> list[Outcome]:
    """Run cases for a job array; signals end the process unless all are done; finished steps stay."""
    from ..solve.events import reporter

    outcomes: list[Outcome] = []
    listener = reporter(messages.silent)
    try:
        with signal_pipe() as pipe:
            in_background(
                lambda: outcomes.extend(study.run_case(number, retry, listener) for number in numbers),
                pipe,
                lambda _: not (len(outcomes) == len(numbers) or all(map(study.has, numbers))),
            )
    except Interrupted as signaled:
        number = numbers[len(outcomes)]
        saved = f"the finished load steps of case {number} are recorded; the same command resumes after them"
        messages.interrupted(signaled, saved)
    return outcomes


def _run_missing(study: Study, **options: Any) -> None:
    """Run the missing cases in a second thread; a signal cancels them unless the study is complete."""
    cancel, over, complete = (threading.Event() for _ in range(3))
    kind, settings = study.backend(options["jobs"], options["dask"])
    kind.load(settings)

    def work() -> None:
        try:
            study.run(cancel=cancel, **options)
            if not _State(study).missing:
                complete.set()
        finally:
            over.set()

    def ends(_: Interrupted) -> bool:
        cancel.set()
        over.wait()
        return not complete.is_set()

    try:
        with signal_pipe() as pipe:
            in_background(work, pipe, ends)
    except Interrupted as signaled:
        saved = f"{_State(study).done} of {counted(len(study), 'case is', 'cases are')} finished and recorded"
        message = f"interrupted; {saved} in {study.folder.folder}/; the same command runs the rest"
        raise frame.Failure(message, signaled.exit_code) from None


def slurm_script(study: Study, path: Path, retry: bool) -> str:
    """Return the script of a job array that runs the missing cases, of an empty job if there are none."""
    from ..study.backend import BACKENDS

    numbers = sorted(study.folder.number(case) for case in study.missing(retry))
    array = BACKENDS["slurm"](study.file.slurm, len(study))
    return array.script(numbers, path, study.output, retry)
