"""What `hexcontact study` shows and prints: progress, the list of failures, a Slurm job array."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ..errors import DeckError
from ..solve.interruption import Interrupted, in_background
from ..study.study import Outcome, PlannedCase, Study, StudyWatcher
from ..study.tables import batch_text
from ..text import quantity, visible
from .guard import complain, say

if TYPE_CHECKING:
    from .run_command import Listeners

FAILED = 3  # exit code of a study of which some cases failed
_MOST_TOLD = 20  # failures listed at the end


class StudyLines(StudyWatcher):
    """One line by case, for logs and pipes."""

    def __init__(self, stream: IO[str]) -> None:
        self.stream = stream
        self.count = self.total = 0

    @contextlib.contextmanager
    def watching(self, study: Study, missing: int) -> Iterator[None]:
        """Say first what there is to do."""
        self.total, self.study = missing, study
        self._print(f"{study.title}: {_of_study(study, missing)}")
        yield

    def finished(self, case: PlannedCase, outcome: Outcome) -> None:
        """Print the line of a case."""
        self.count += 1
        place = f"{self.count:>{len(str(self.total))}}/{self.total}"
        number = self.study.folder.number(case)
        self._print(f"{place}  case {number} ({case}): {_ending(outcome)}")

    def _print(self, line: str) -> None:
        with contextlib.suppress(OSError):  # nobody listens any more; the study goes on
            print(visible(line), file=self.stream, flush=True)


class StudyBar(StudyWatcher):
    """A progress bar over the cases, the latest one below it."""

    @contextlib.contextmanager
    def watching(self, study: Study, missing: int) -> Iterator[None]:
        """Show the bar; it vanishes at the end."""
        from rich.console import Console, Group
        from rich.live import Live
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.progress import TimeRemainingColumn as Remaining
        from rich.text import Text

        self.study = study
        columns = [TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn()]
        self._bar = Progress(*columns, TimeElapsedColumn(), TextColumn("left:"), Remaining())
        done = len(study) - missing
        self._task = self._bar.add_task(visible(study.title), total=len(study), completed=done)
        self._latest = Text(style="dim", no_wrap=True, overflow="ellipsis")
        with Live(Group(self._bar, self._latest), console=Console(stderr=True), transient=True):
            yield

    def finished(self, case: PlannedCase, outcome: Outcome) -> None:
        """Move the bar on by a case."""
        latest = f"  case {self.study.folder.number(case)} ({case}): {_ending(outcome)}"
        self._latest.plain = visible(latest)
        self._bar.update(self._task, advance=1)


def watcher(quiet: bool) -> StudyWatcher:
    """Return what suits standard error: bar, lines, or silence if `quiet`."""
    if quiet:
        return StudyWatcher()
    return StudyBar() if sys.stderr.isatty() else StudyLines(sys.stderr)


def _ending(outcome: Outcome) -> str:
    if not outcome.exit_code:
        return f"done in {quantity(outcome.seconds, 's', 3)}"
    return f"failed: {outcome.message.splitlines()[0]}"


def _of_study(study: Study, missing: int) -> str:
    cases = f"{len(study)} case{'s' * (len(study) != 1)}"
    return cases if missing == len(study) else f"{cases}, {missing} to run"


def report(study: Study, quiet: bool) -> int:
    """Say what is there, what failed and why; return the exit code."""
    done = sum(study.folder.done(case) for case in study.cases)
    failures = study.failures()
    if not quiet:
        say(f"written: {study.output}, {done} of {len(study)} cases (their files in {study.folder.folder}/)")
    if done == len(study):
        return 0
    for case, outcome in failures[:_MOST_TOLD]:
        words = outcome.message.splitlines()[0]
        complain(f"case {study.folder.number(case)} ({case}) failed: {words}")
    if len(failures) > _MOST_TOLD:
        complain(f"... and {len(failures) - _MOST_TOLD} more; all are in {study.output}")
    missing = len(study) - done - len(failures)
    if missing:
        complain(f"{missing} of {len(study)} cases have not been run")
    if any(outcome.lasting for _, outcome in failures):
        complain("--retry runs cases again that failed by themselves")
    return FAILED


def interrupted(study: Study) -> str:
    """Say what is kept of a study that was interrupted."""
    done = sum(study.folder.done(case) for case in study.cases)
    return (
        f"{done} of {len(study)} cases are finished and kept in {study.folder.folder}/; "
        "the same command runs the rest"
    )


def run_case(study: Study, number: int, retry: bool, listeners: Listeners, heard: tuple[int, int]) -> Outcome:
    """Run one case for a job array; signals end the process unless it is done, and what is finished stays."""
    from ..solve.progress import reporter

    outcomes: list[Outcome] = []
    shown = reporter(listeners.silent)
    try:
        in_background(
            lambda: outcomes.append(study.run_case(number, retry, shown)),
            heard,
            lambda _: not outcomes,
        )
    except Interrupted as signaled:
        listeners.leave(
            signaled,
            f"the finished load steps of case {number} are kept; the same command goes on after them",
        )
    return outcomes[0]


def run_in_background(
    study: Study, cancel: threading.Event, options: dict[str, Any]
) -> tuple[Callable[[], None], Callable[[Interrupted], bool]]:
    """Return what to do in a second thread, and what cancels it, unless the study is complete by then."""
    over, complete = threading.Event(), threading.Event()
    if (where := study.cluster(options.get("jobs"), options.get("dask"))) is not None:
        from ..study.dask import load

        load(where)

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

    return work, ends


def slurm_script(study: Study, path: Path, retry: bool) -> str:
    """Return a job array that runs the missing cases; empty if there are none.

    Parameters
    ----------
    study : Study
        The study.
    path : Path
        Its file.
    retry : bool
        Also cases that failed by themselves.
    """
    numbers = sorted(study.folder.number(case) for case in study.missing(retry))
    if not numbers:
        return ""
    files = [str(path.resolve()), os.path.abspath(study.output)]
    for name in files:
        if batch_text(name) is None:
            raise DeckError(f'{name}: a script needs a name on one line, without " and \\')
    options: dict[str, Any] = {
        "job-name": study.output.stem,
        "output": str(study.folder.folder).replace("%", "%%") + "/slurm-%A_%a.log",
        "signal": "B:USR1@60",  # a minute before a time limit, to the command that takes the shell's place
    }
    options |= {key.replace("_", "-"): value for key, value in study.file.slurm.items()}
    words = ["hexcontact", "study", files[0], "--output", files[1], *(["--retry"] if retry else [])]
    lines = [
        "#!/bin/sh",
        f"# {len(numbers)} of {len(study)} cases. Afterwards: {shlex.join(words)} --collect",
        f"#SBATCH --array={_ranges(numbers)}",
        *(
            f"#SBATCH --{key}" + ("" if value is True else f"={batch_text(str(value))}")
            for key, value in options.items()
            if value is not False
        ),
        "export OMP_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}",
        f"exec {shlex.join(words)} --case $SLURM_ARRAY_TASK_ID",
    ]
    return "\n".join(lines)


def _ranges(numbers: Sequence[int]) -> str:
    """Write numbers as Slurm does: 1-4,7."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1][1:] = [number]
        else:
            runs.append([number])
    return ",".join("-".join(map(str, run)) for run in runs)
