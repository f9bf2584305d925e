"""Progress of a study: a bar on a terminal, a line for each case elsewhere."""

from __future__ import annotations

import logging
import sys
from typing import Any

from ..solve.events import Listener
from ..solve.progress import Bar, Lines


class StudyLines(Lines):
    """One line by case, for logs and pipes."""

    _count = 0

    def begun(self, title: str, steps: int) -> None:
        """Keep the number of cases to run."""
        self.steps = steps

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Print what there is to do, then each case with its place."""
        if event != "study":
            self._count += 1
            text = f"{self._count:>{len(str(self.steps))}}/{self.steps}  {text}"
        super().said(event, text)


class StudyBar(Bar):
    """A progress bar over the cases, the latest one below it."""

    def begun(self, title: str, steps: int) -> None:
        """Show the bar, which counts cases even if none is missing."""
        super().begun(title, max(steps, 1))

    def _columns(self) -> list[Any]:
        from rich import progress

        return [
            *super()._columns()[1:],
            progress.TextColumn("left:"),
            progress.TimeRemainingColumn(),
        ]

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: Any) -> None:
        """Begin with the cases that are done, then move the bar on by a case."""
        if event == "study":
            cases = values["cases"]
            self._bar.reset(self._task, total=cases, completed=cases - values["missing"])
        else:
            super().said(event, text)
            self._bar.update(self._task, advance=1)


def study_reporter(quiet: bool = False) -> Listener:
    """Return what suits standard error: bar, lines, or silence if `quiet`."""
    if quiet:
        return Listener()
    return StudyBar() if sys.stderr.isatty() else StudyLines(sys.stderr)
