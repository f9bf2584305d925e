"""What a user sees while a case runs: a bar on a terminal, plain lines in a log, or nothing."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterator
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .result import Step

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


def quantity(value: float, unit: str = "", digits: int = 4) -> str:
    """Write a number as an engineer would: ``quantity(8.543e8, "Pa")`` is ``"854.3 MPa"``.

    Parameters
    ----------
    value : float
        The number, in SI.
    unit : str
        A unit that takes a prefix; without one, or where no prefix fits, the number is written plainly.
    digits : int
        Significant digits.
    """
    if math.isnan(value):
        return "-"
    if value == 0 or math.isinf(value):
        return f"{value:g} {unit}".rstrip()
    rounded = float(f"{value:.{digits - 1}e}")
    power = 3 * math.floor(math.log10(abs(rounded)) / 3)
    if not unit or power not in _PREFIXES:
        return f"{rounded:.{digits}g} {unit}".rstrip()
    scaled = f"{rounded / 10.0**power:#.{digits}g}".rstrip(".")
    return f"{scaled} {_PREFIXES[power]}{unit}"


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
            Number of load steps.
        """
        yield

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

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Print the title first."""
        self.steps = steps
        self._print(f"{title or 'case'}: {steps} load step{'s' * (steps != 1)}")
        yield

    def finished(self, step: Step) -> None:
        """Print the line of a step."""
        width = len(str(self.steps))
        self._print(f"step {step.number:>{width}}/{self.steps}  {describe(step.history)}")

    def _print(self, line: str) -> None:
        with contextlib.suppress(OSError):  # nobody listens any more; the run goes on
            print(line, file=self.stream, flush=True)


class Bar(Reporter):
    """A progress bar with the latest step beside it."""

    @contextlib.contextmanager
    def watching(self, title: str, steps: int) -> Iterator[None]:
        """Show the bar; it vanishes at the end."""
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn
        from rich.progress import TimeElapsedColumn as Elapsed

        columns = [
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            Elapsed(),
        ]
        latest = TextColumn("{task.fields[latest]}", style="dim")
        with Progress(*columns, latest, console=Console(stderr=True), transient=True) as self._bar:
            self._task = self._bar.add_task(title, total=steps, latest="")
            yield

    def finished(self, step: Step) -> None:
        """Move the bar on by one step."""
        self._bar.update(self._task, advance=1, latest=describe(step.history, short=True))


def reporter(quiet: bool = False, stream: IO[str] | None = None) -> Reporter:
    """Return what suits `stream` (default: standard error): bar, lines, or silence if `quiet`."""
    stream = stream or sys.stderr
    if quiet:
        return Reporter()
    return Bar() if stream is sys.stderr and stream.isatty() else Lines(stream)


def describe(history: Any, short: bool = False) -> str:
    """Return a line of text about a step from its history."""
    parts = [
        str(history.get("label", "")),
        f"P {quantity(history['normal_load'], 'N')}",
        f"approach {quantity(history['approach'], 'm')}",
        f"p_max {quantity(history['max_pressure'], 'Pa')}",
    ]
    if not short:
        parts += [
            f"radius {quantity(history['contact_radius'], 'm')}",
            f"R_n {history['residual_normal']:.1e}",
            f"R_P {history['residual_force']:.1e}",
            quantity(history["seconds"], "s", 3),
        ]
    return "  ".join(part for part in parts if part)
