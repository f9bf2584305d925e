"""What a user sees while a case runs: a bar on a terminal, plain lines in a log, or nothing."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import IO, TYPE_CHECKING

from ..result.history import describe
from ..text import visible

if TYPE_CHECKING:
    from ..result.step import Step


class Reporter:
    """Is told about the steps of a run; this one says nothing."""

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Be there for a run of so many steps.

        Parameters
        ----------
        title : str
            Title of the case.
        steps : int
            Number of load steps; 0 if it shows on the way.
        """
        yield

    def lattice(self, words: str, shifted: bool) -> None:
        """Hear that the load history begins again on another lattice.

        Parameters
        ----------
        words : str
            Which one, in words.
        shifted : bool
            Whether it is a shifted copy, which only serves to estimate errors.
        """

    def says(self, words: str) -> None:
        """Hear what is worth telling between load steps.

        Parameters
        ----------
        words : str
            What there is to tell.
        """

    def finished(self, step: Step) -> None:
        """Hear of a finished step.

        Parameters
        ----------
        step : Step
            The step; only its history is looked at.
        """


class Lines(Reporter):
    """One line by step, for logs and pipes.

    Parameters
    ----------
    stream : text file
        Where the lines go.
    """

    def __init__(self, stream: IO[str]) -> None:
        self.stream = stream
        self.steps = 0
        self._shifted = False

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Print the title first."""
        self.steps = steps
        count = f"{steps} load step{'s' * (steps != 1)}" if steps else "adaptive load steps"
        self._print(f"{title or 'case'}: {count}")
        yield

    def lattice(self, words: str, shifted: bool) -> None:
        """Print which lattice is next."""
        self._print(words)
        self._shifted = shifted

    def says(self, words: str) -> None:
        """Print it."""
        self._print(words)

    def finished(self, step: Step) -> None:
        """Print the line of a step; those of shifted copies tell nothing new."""
        if self._shifted:
            return
        width = len(str(self.steps))
        number = f"{step.number:>{width}}/{self.steps}"
        if not self.steps:
            number = f"{step.number:>3} ({step.done:4.0%})"
        self._print(f"step {number}  {describe(step.history)}")

    def _print(self, line: str) -> None:
        with contextlib.suppress(OSError):  # nobody listens any more; the run goes on
            print(visible(line), file=self.stream, flush=True)


class Bar(Reporter):
    """A progress bar with the latest step below it."""

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Show the bar; it vanishes at the end."""
        from rich.console import Console, Group
        from rich.live import Live
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            SpinnerColumn,
            TextColumn,
            TimeElapsedColumn,
        )
        from rich.text import Text

        self._counted = steps > 0  # else by the share of the load history
        count = MofNCompleteColumn() if self._counted else TextColumn("{task.percentage:.0f} %")
        columns = [SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(), count]
        self._bar = Progress(*columns, TimeElapsedColumn())
        self._title = visible(title)
        self._task = self._bar.add_task(self._title, total=steps or 1.0)
        self._latest = Text(style="dim", no_wrap=True, overflow="ellipsis")
        with Live(Group(self._bar, self._latest), console=Console(stderr=True), transient=True):
            yield

    def lattice(self, words: str, shifted: bool) -> None:
        """Start the bar again, with the name of the lattice."""
        self._bar.update(self._task, completed=0, description=f"{self._title}, {words.partition(':')[0]}")

    def says(self, words: str) -> None:
        """Show it until the next step."""
        self._latest.plain = f"  {visible(words)}"

    def finished(self, step: Step) -> None:
        """Move the bar on by one step."""
        self._latest.plain = "  " + visible(describe(step.history, short=True))
        self._bar.update(self._task, completed=step.number if self._counted else step.done)


def reporter(quiet: bool = False, stream: IO[str] | None = None) -> Reporter:
    """Return what suits `stream` (default: standard error): bar, lines, or silence if `quiet`."""
    stream = stream or sys.stderr
    if quiet:
        return Reporter()
    return Bar() if stream is sys.stderr and stream.isatty() else Lines(stream)
