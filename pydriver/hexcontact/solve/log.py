"""The log of runs: a line for the beginning, each load step, the end, through the logger ``hexcontact``.

It goes nowhere by itself: ``logging.getLogger("hexcontact")`` in Python, ``--log-file`` and
``--log-level`` on the command line. A line is words ``name=value``; values are in SI, text stands in quotes.
"""

from __future__ import annotations

import contextlib
import json
import logging
import re
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ..errors import DeckError, HexcontactError
from ..result.history import worth_showing
from ..text import visible
from ..variables import RESIDUALS, label_of
from .events import Listener

if TYPE_CHECKING:
    from ..core.lattice import Lattice
    from ..result.step import Step

logger = logging.getLogger("hexcontact")
logger.addHandler(logging.NullHandler())  # else warnings went to standard error by default

LEVELS = ("debug", "info", "warning", "error")


def words(event: str, **values: Any) -> str:
    """Write what happened and its values on one line: ``words("step", P=2.0)`` is ``"step P=2"``."""
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
    """Writes what happens into the log."""

    _planned = 0

    def begun(self, title: str, steps: int) -> None:
        """Keep the number of load steps for the lines to come."""
        self._planned = steps

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Write which lattice is next."""
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
        values |= _zones(step)
        values |= {sign: _rounded(history[name]) for sign, name in RESIDUALS.items() if name in history}
        values["iterations"] = history["sweeps"]
        values["halvings"] = history.get("cuts", 0)
        values["applications"] = _rounded(history["operator_applications"])
        values["seconds"] = _rounded(history["seconds"])
        self.said(f"step={step.number}" + (f"/{self._planned}" if self._planned else ""), **values)

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Write what happened and its values."""
        logger.log(level, words(event, **values))

    def ended(self, error: BaseException | None) -> None:
        """Write why the run ends before its time, once."""
        if isinstance(error, HexcontactError) and not error.logged:
            self.said("stopped", level=logging.ERROR, reason=str(error))
            error.logged = True


def _rounded(value: float | int | str) -> float:
    return float(f"{float(value):.3g}")


def _zones(step: Step) -> dict[str, int]:
    """Count the nodes in contact, and with friction those that stick and those that slip."""
    zone = step.fields["zone"]
    contact, stick = int((zone > 0).sum()), int((zone == 1).sum())
    if "stick_area" not in step.history:
        return {"contact": contact}
    return {"contact": contact, "stick": stick, "slip": contact - stick}


# --- where it goes ----------------------------------------------------------------------------------------


class _Lines(logging.Formatter):
    """Time (UTC), level and message, on one line whatever the message holds."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s.%(msecs)03dZ %(levelname)-7s %(message)s", "%Y-%m-%dT%H:%M:%S")
        self.converter = time.gmtime

    def format(self, record: logging.LogRecord) -> str:
        return visible("; ".join(super().format(record).splitlines()))


class _File(logging.FileHandler):
    """Appends to a file; says once that it can no longer be written, and lets the run go on."""

    failed = False

    def handleError(self, record: logging.LogRecord) -> None:
        if not self.failed:
            self.failed = True
            reason = getattr(sys.exc_info()[1], "strerror", None) or sys.exc_info()[1]
            with contextlib.suppress(OSError):
                print(f"hexcontact: warning: cannot write {self.baseFilename}: {reason}", file=sys.stderr)

    def close(self) -> None:
        with contextlib.suppress(OSError):  # what could not be written before
            super().close()


class _Stream(logging.StreamHandler[IO[str]]):
    """Writes to standard error as long as somebody reads it."""

    def handleError(self, record: logging.LogRecord) -> None:
        pass


@contextlib.contextmanager
def kept(file: Path | None, level: str | None, spare: Sequence[Path] = ()) -> Iterator[None]:
    """Write the log to a file, else, if a level is given, to standard error; errors on the way out, too.

    Parameters
    ----------
    file : Path or None
        The file; what it holds stays.
    level : str or None
        One of `LEVELS`; "info" if a file but no level is given.
    spare : sequence of Path
        Files that the log must not go into: decks, results.

    Raises
    ------
    DeckError
        If the file cannot be written, or must not be.
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
    """Refuse a log in one of the files of a command."""
    if file is None:
        return
    for other in spare:
        if file == other or (file.exists() and other.exists() and file.samefile(other)):
            raise DeckError(f"--log-file {file}: expected a file of its own, not {other} of this command")


def _may_be_a_log(file: Path) -> bool:
    """Tell whether a file is empty or begins with a time."""
    with file.open("rb") as there:
        return re.match(rb"\d{4}-\d\d-\d\dT|$", there.read(20)) is not None


def _opened(file: Path, spare: Sequence[Path]) -> _File:
    refuse_same(file, spare)
    try:
        if file.is_file() and not _may_be_a_log(file):
            expected = "expected a new file, or a log to append to"
            raise DeckError(f"--log-file {file}: is there and no log; {expected}")
        return _File(file, encoding="utf-8", errors="backslashreplace")
    except DeckError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DeckError(f"--log-file {file}: cannot be written: {reason}") from None
