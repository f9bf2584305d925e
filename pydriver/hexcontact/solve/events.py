"""Listeners of a run: its log, lines or a bar on the terminal, the callback of a script.

The log has a line for the beginning, each load step and the end, through the logger ``hexcontact``. It has no
destination by default: ``logging.getLogger("hexcontact")`` sets one in Python, ``--log-file`` and
``--log-level`` on the command line. A line is words ``name=value``; values are in SI, text is in quotes.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

from ..core.lattice import Lattice
from ..errors import DeckError, HexcontactError, StopRun
from ..result.history_words import describe, worth_showing
from ..result.step import Step
from ..text import counted, cut, quantity, visible
from ..variables import RESIDUALS, label_of

logger = logging.getLogger("hexcontact")
logger.addHandler(logging.NullHandler())  # without it warnings go to standard error


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


# --- the log ------------------------------------------------------------------------------------------------


def words(event: str, **values: Any) -> str:
    """Write an event and its values on one line: ``words("step", P=2.0)`` is ``"step P=2"``."""
    return " ".join([event, *(f"{name}={_word(value)}" for name, value in values.items())])


def _word(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple):  # rows and columns
        return "x".join(map(str, value))
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    return str(value)


class Log(Listener):
    """Writes the events of a run to the log."""

    _planned = 0

    def begun(self, title: str, steps: int) -> None:
        """Store the number of load steps."""
        self._planned = steps

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Write the next lattice."""
        self.said("lattice", name=name, spacing=lattice.spacing, nodes=lattice.size)

    def step(self, step: Step) -> None:
        """Write loads and motions, zones, residuals and work of a load step."""
        if not logger.isEnabledFor(logging.INFO):
            return
        history = step.history
        values: dict[str, Any] = {"segment": history.get("segment", "-"), "label": history.get("label", "")}
        values["fraction"] = step.ramp_done
        shown = worth_showing([history])
        values |= {label_of(name).replace(" ", "_"): float(history[name]) for name in shown}
        values["p_max"] = float(history["max_pressure"])
        contact = stick = 0
        for _, zone in step.bands("zone"):
            contact, stick = contact + int((zone > 0).sum()), stick + int((zone == 1).sum())
        values["contact"] = contact
        if "stick_area" in history:
            values |= {"stick": stick, "slip": contact - stick}
        values |= {sign: _rounded(history[name]) for sign, name in RESIDUALS.items() if name in history}
        values["iterations"] = history["sweeps"]
        values["halvings"] = history.get("cuts", 0)
        values["applications"] = _rounded(history["operator_applications"])
        values["seconds"] = _rounded(history["seconds"])
        self.said(f"step={step.number}" + (f"/{self._planned}" if self._planned else ""), **values)

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Write an event and its values."""
        if logger.isEnabledFor(level):
            logger.log(level, words(event, **values))

    def ended(self, error: BaseException | None) -> None:
        """Write the error that ends the run, once."""
        if isinstance(error, HexcontactError) and not error.logged:
            self.said("stopped", level=logging.ERROR, reason=str(error))
            error.logged = True


def _rounded(value: float | int | str) -> float:
    return float(f"{float(value):.3g}")


# --- destinations -----------------------------------------------------------------------------------------


class _Lines(logging.Formatter):
    """Formats time (UTC), level and message on one line."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s.%(msecs)03dZ %(levelname)-7s %(message)s", "%Y-%m-%dT%H:%M:%S")
        self.converter = time.gmtime

    def format(self, record: logging.LogRecord) -> str:
        return visible("; ".join(super().format(record).splitlines()))


class _File(logging.FileHandler):
    """Appends to a file; a failure is reported once and does not end the run."""

    failed = False

    def handleError(self, record: logging.LogRecord) -> None:
        if not self.failed:
            self.failed = True
            reason = getattr(sys.exc_info()[1], "strerror", None) or sys.exc_info()[1]
            with contextlib.suppress(OSError):
                print(f"hexcontact: warning: cannot write {self.baseFilename}: {reason}", file=sys.stderr)

    def close(self) -> None:
        with contextlib.suppress(OSError):  # of an earlier failure
            super().close()


class _Stream(logging.StreamHandler[IO[str]]):
    """Writes to standard error, also if its reader has ended."""

    def handleError(self, record: logging.LogRecord) -> None:
        pass


@contextlib.contextmanager
def log_to(file: Path | None, level: str | None, spare: Sequence[Path] = ()) -> Iterator[None]:
    """Write the log to a file, else with a level to standard error; also an error that is raised.

    The log is appended; `spare` are decks and results, which the log must not change.
    """
    if file is None and level is None:
        yield
        return
    handler = _Stream(sys.stderr) if file is None else _opened(file, spare)
    handler.setFormatter(_Lines())
    before = logger.level, logger.propagate
    logger.setLevel((level or "info").upper())
    logger.propagate = False
    logger.addHandler(handler)
    try:
        with Log().following("", 0):
            yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before[0])
        logger.propagate = before[1]
        handler.close()


def refuse_as_log(file: Path | None, spare: Sequence[Path]) -> None:
    """Refuse one of the files of a command as log."""
    if file is None:
        return
    for other in spare:
        if file == other or (file.exists() and other.exists() and file.samefile(other)):
            raise DeckError(f"--log-file {file}: expected a file of its own, not {other} of this command")


def _opened(file: Path, spare: Sequence[Path]) -> _File:
    refuse_as_log(file, spare)
    try:
        if file.is_file():
            try:
                with file.open("rb") as there:
                    begins = there.read(20)
            except PermissionError as error:
                unknown = "cannot be read, so that it may be no log to append to"
                raise DeckError(f"--log-file {file}: {unknown}: {error.strerror}") from None
            if not re.match(rb"\d{4}-\d\d-\d\dT|$", begins):  # empty, or begins with a time
                expected = "expected a new file, or a log to append to"
                raise DeckError(f"--log-file {file}: exists and is no log; {expected}")
        if file.is_fifo():  # OSError without a reader, for which open would wait
            os.close(os.open(file, os.O_WRONLY | os.O_NONBLOCK))
        return _File(file, encoding="utf-8", errors="backslashreplace")
    except DeckError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DeckError(f"--log-file {file}: cannot be written: {reason}") from None
