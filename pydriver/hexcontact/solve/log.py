"""The log of runs: a line for the beginning, each load step, the end, through the logger ``hexcontact``.

It has no destination by default: ``logging.getLogger("hexcontact")`` sets one in Python, ``--log-file`` and
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
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

from ..core.lattice import Lattice
from ..errors import DeckError, HexcontactError
from ..result.history_words import worth_showing
from ..result.step import Step
from ..text import visible
from ..variables import RESIDUALS, label_of
from .events import Listener

logger = logging.getLogger("hexcontact")
logger.addHandler(logging.NullHandler())  # without it warnings go to standard error


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
def kept(file: Path | None, level: str | None, spare: Sequence[Path] = ()) -> Iterator[None]:
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


def refuse_same(file: Path | None, spare: Sequence[Path]) -> None:
    """Refuse one of the files of a command as log."""
    if file is None:
        return
    for other in spare:
        if file == other or (file.exists() and other.exists() and file.samefile(other)):
            raise DeckError(f"--log-file {file}: expected a file of its own, not {other} of this command")


def _opened(file: Path, spare: Sequence[Path]) -> _File:
    refuse_same(file, spare)
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
