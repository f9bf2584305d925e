"""What is shown while a study runs: a bar on a terminal, a line for each case elsewhere."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import IO

from ..study.study import Outcome, PlannedCase, Study, StudyWatcher
from ..text import quantity, visible


class StudyLines(StudyWatcher):
    """One line by case, for logs and pipes."""

    def __init__(self, stream: IO[str]) -> None:
        self.stream = stream
        self.count = self.total = 0

    @contextlib.contextmanager
    def watching(self, study: Study, missing: int) -> Iterator[None]:
        """Print the title and the number of cases first."""
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
        with contextlib.suppress(OSError):  # the stream is closed; the study goes on
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
