"""Events of a run, their listeners, and the display of progress."""

from __future__ import annotations

import contextlib
import logging
import sys
from collections.abc import Callable, Iterator
from typing import IO, Any

from ..core.lattice import Lattice
from ..errors import StopRun
from ..result.history_words import describe
from ..result.step import Step
from ..text import counted, cut, quantity, visible


class Listener:
    """Follows a run; a listener overrides the events that it needs."""

    def begun(self, title: str, steps: int) -> None:
        """Note that a run of `steps` load steps begins; 0 if their number is open."""

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Note the start on another lattice; a `shifted` copy only serves to estimate errors."""

    def step(self, step: Step) -> None:
        """Note a finished load step, after it was recorded."""

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Note any other event: a sentence for the terminal (empty: for the log alone), values in SI."""

    def ended(self, error: BaseException | None) -> None:
        """Note the end of the run, by an error or without."""

    @contextlib.contextmanager
    def following(self, title: str, steps: int) -> Iterator[None]:
        """Follow a run from its beginning to its end; arguments as `begun`."""
        self.begun(title, steps)
        try:
            yield
        except BaseException as error:
            self.ended(error)
            raise
        self.ended(None)


def _passed(name: str) -> Callable[..., None]:
    def to_all(self: Listeners, *values: Any, **named: Any) -> None:
        for listener in self._all:
            getattr(listener, name)(*values, **named)

    return to_all


class Listeners(Listener):
    """Passes every event to several listeners, in their order."""

    def __init__(self, *listeners: Listener) -> None:
        self._all = listeners

    begun, lattice, step, said, ended = map(_passed, ("begun", "lattice", "step", "said", "ended"))


class Stopped(Exception):
    """Ends a run after a load step for a callback; the message is the reason."""


class Callback(Listener):
    """Calls a function of a script with each finished load step.

    If the function returns a true value, or raises `StopRun`, the run ends. `refines`: other lattices may
    follow the last load step.
    """

    def __init__(self, on_step: Callable[[Step], object], refines: bool = False) -> None:
        self._on_step, self._refines = on_step, refines

    def step(self, step: Step) -> None:
        """Raise `Stopped` if the function ends the run."""
        try:
            answer = self._on_step(step)
        except StopRun as wanted:
            answer = str(wanted) or True
        if answer and (self._refines or not step.load_fraction >= 1.0):
            reason = f": {answer}" if isinstance(answer, str) else ""
            raise Stopped(f"stopped by on_step after step {step.number}{reason}")


class Lines(Listener):
    """Prints a line for each step, to files and pipes."""

    def __init__(self, stream: IO[str]) -> None:
        self.stream = stream
        self.steps = 0
        self._shifted = self._over = False

    def begun(self, title: str, steps: int) -> None:
        """Print the title and the number of steps."""
        self.steps, self._over = steps, False
        count = counted(steps, "load step") if steps else "load steps chosen during the run"
        self._print(f"{title or 'case'}: {count}")

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Print the name of the next lattice."""
        self._print(f"{name}: spacing {quantity(lattice.spacing, 'm')}, {lattice.size:,} nodes")
        self._shifted = shifted

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Print the sentence of the event."""
        if text:
            self._print(text)

    def step(self, step: Step) -> None:
        """Print the line of a step, but not on shifted copies."""
        if self._shifted:
            return
        width = len(str(self.steps))
        number = f"{step.number:>{width}}/{self.steps}"
        if not self.steps:
            number = f"{step.number:>3} ({step.done:4.0%})"
        self._print(f"step {number}  {describe(step.history)}")

    def ended(self, error: BaseException | None) -> None:
        """Print nothing more: after a signal the solving thread may finish its step."""
        self._over = True

    def _print(self, line: str) -> None:
        if self._over:
            return
        with contextlib.suppress(OSError):  # the reader has closed; the run continues
            print(visible(line), file=self.stream, flush=True)


class Bar(Listener):
    """The title, a progress bar with the remaining time, and the latest step below it."""

    def begun(self, title: str, steps: int) -> None:
        """Show the bar."""
        from rich.console import Console, Group
        from rich.live import Live
        from rich.progress import Progress
        from rich.text import Text

        self._counted = steps > 0  # else progress is the share of the load history
        self._bar = Progress(*self._columns())
        self._title = visible(title)
        self._head, self._latest = Text(self._title), Text(style="dim", no_wrap=True)
        self._task = self._bar.add_task("", total=steps or 1.0)
        shown = Group(self._head, self._bar, self._latest)
        self._live = Live(shown, console=Console(stderr=True), transient=True)
        self._live.start(refresh=True)

    def _columns(self) -> list[Any]:
        from rich import progress

        return [
            progress.SpinnerColumn(),
            progress.BarColumn(),
            progress.MofNCompleteColumn()
            if self._counted
            else progress.TextColumn("{task.percentage:.0f} %"),
            progress.TimeElapsedColumn(),
            progress.TextColumn("left:"),
            progress.TimeRemainingColumn(),
        ]

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Start the bar again, with the name of the lattice."""
        self._head.plain = f"{self._title}, {name}"
        self._bar.reset(self._task)

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Show the sentence of the event until the next step; a warning stays above the bar."""
        if level >= logging.WARNING and text:
            self._live.console.print(visible(text), markup=False, highlight=False)
        elif text:
            self._show(text)

    def step(self, step: Step) -> None:
        """Move the bar on by one step."""
        self._show(describe(step.history, short=True))
        self._bar.update(self._task, completed=step.number if self._counted else step.done)

    def _show(self, text: str) -> None:
        self._latest.plain = "  " + cut(visible(text), self._live.console.width - 3)

    def ended(self, error: BaseException | None) -> None:
        """Remove the bar."""
        self._live.stop()


def reporter(quiet: bool = False) -> Listener:
    """Return the display on standard error: bar or lines, none if `quiet`."""
    return Listener() if quiet else Bar() if sys.stderr.isatty() else Lines(sys.stderr)
