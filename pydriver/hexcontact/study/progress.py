"""Progress of a study: a bar on a terminal, a line for each case elsewhere."""

from __future__ import annotations

import logging
import sys
from typing import Any

from ..solve.events import Listener
from ..solve.progress import Bar, Lines


class StudyLines(Lines):
    """One line for each case, for logs and pipes."""

    _count = 0

    def begun(self, title: str, steps: int) -> None:
        """Record the number of cases to run."""
        self.steps = steps

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Print a line on the study, then one for each case with its number in the sequence."""
        if event != "study":
            self._count += 1
            text = f"{self._count:>{len(str(self.steps))}}/{self.steps}  {text}"
        super().said(event, text)


class StudyBar(Bar):
    """A progress bar over the cases, with the latest case below it."""

    def begun(self, title: str, steps: int) -> None:
        """Show the bar, also if no case is missing."""
        super().begun(title, max(steps, 1))

    def _columns(self) -> list[Any]:
        return super()._columns()[1:]

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: Any) -> None:
        """Start the bar at the finished cases, then advance it case by case."""
        if event == "study":
            cases = values["cases"]
            self._bar.reset(self._task, total=cases, completed=cases - values["missing"])
        else:
            super().said(event, text)
            self._bar.update(self._task, advance=1)


def study_reporter(quiet: bool = False) -> Listener:
    """Return the listener for standard error: a bar, lines, or none if `quiet`."""
    if quiet:
        return Listener()
    return StudyBar() if sys.stderr.isatty() else StudyLines(sys.stderr)
