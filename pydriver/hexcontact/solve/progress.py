"""What a user sees while a case runs: a bar on a terminal, plain lines in a log, or nothing."""

from __future__ import annotations

import contextlib
import logging
import sys
from typing import IO, TYPE_CHECKING, Any

from ..result.history import describe
from ..text import quantity, visible
from .events import Listener

if TYPE_CHECKING:
    from ..core.lattice import Lattice
    from ..result.step import Step


def _on_lattice(name: str, lattice: Lattice) -> str:
    return f"{name}: spacing {quantity(lattice.spacing, 'm')}, {lattice.size:,} nodes"


class Lines(Listener):
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

    def begun(self, title: str, steps: int) -> None:
        """Print the title first."""
        self.steps = steps
        count = f"{steps} load step{'s' * (steps != 1)}" if steps else "adaptive load steps"
        self._print(f"{title or 'case'}: {count}")

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Print which lattice is next."""
        self._print(_on_lattice(name, lattice))
        self._shifted = shifted

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Print the sentence, if there is one."""
        if text:
            self._print(text)

    def step(self, step: Step) -> None:
        """Print the line of a step; those of shifted copies say nothing new."""
        if self._shifted:
            return
        width = len(str(self.steps))
        number = f"{step.number:>{width}}/{self.steps}"
        if not self.steps:
            number = f"{step.number:>3} ({step.done:4.0%})"
        self._print(f"step {number}  {describe(step.history)}")

    def _print(self, line: str) -> None:
        with contextlib.suppress(OSError):  # nobody reads any more; the run goes on
            print(visible(line), file=self.stream, flush=True)


class Bar(Listener):
    """A progress bar with the latest step below it."""

    def begun(self, title: str, steps: int) -> None:
        """Show the bar."""
        from rich.console import Console, Group
        from rich.live import Live
        from rich.progress import Progress
        from rich.text import Text

        self._counted = steps > 0  # else by the share of the load history
        self._bar = Progress(*self._columns())
        self._title = visible(title)
        self._task = self._bar.add_task(self._title, total=steps or 1.0)
        self._latest = Text(style="dim", no_wrap=True, overflow="ellipsis")
        self._live = Live(Group(self._bar, self._latest), console=Console(stderr=True), transient=True)
        self._live.start(refresh=True)

    def _columns(self) -> list[Any]:
        from rich import progress

        return [
            progress.SpinnerColumn(),
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(),
            progress.MofNCompleteColumn()
            if self._counted
            else progress.TextColumn("{task.percentage:.0f} %"),
            progress.TimeElapsedColumn(),
        ]

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Start the bar again, with the name of the lattice."""
        self._bar.update(self._task, completed=0, description=f"{self._title}, {name}")

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Show the sentence, if there is one, until the next step."""
        if text:
            self._latest.plain = f"  {visible(text)}"

    def step(self, step: Step) -> None:
        """Move the bar on by one step."""
        self._latest.plain = "  " + visible(describe(step.history, short=True))
        self._bar.update(self._task, completed=step.number if self._counted else step.done)

    def ended(self, error: BaseException | None) -> None:
        """Take the bar away."""
        self._live.stop()


def reporter(quiet: bool = False, stream: IO[str] | None = None) -> Listener:
    """Return what suits `stream` (default: standard error): bar, lines, or silence if `quiet`."""
    stream = stream or sys.stderr
    if quiet:
        return Listener()
    return Bar() if stream is sys.stderr and stream.isatty() else Lines(stream)
