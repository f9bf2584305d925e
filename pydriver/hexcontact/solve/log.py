"""The log of runs: a line for the beginning, each load step, the end, through the logger ``hexcontact``.

Nobody hears it unless someone listens: ``logging.getLogger("hexcontact")`` in Python, ``--log-file`` and
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

if TYPE_CHECKING:
    from ..core.lattice import Lattice
    from ..problem.problem import Problem
    from ..result.result import Step

logger = logging.getLogger("hexcontact")
logger.addHandler(logging.NullHandler())  # else warnings went to standard error where nobody listens

LEVELS = ("debug", "info", "warning", "error")


def words(event: str, **values: Any) -> str:
    """Write what happened and its values on one line: ``words("step", P=2.0)`` is ``"step P=2"``."""
    return " ".join([event, *(f"{name}={_word(value)}" for name, value in values.items())])


def _word(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    return str(value)


# --- what is told -----------------------------------------------------------------------------------------


def begun(case: Problem, lattice: Lattice, done: int) -> None:
    """Tell of a run that begins, or goes on after so many steps."""
    from .._version import __version__
    from .run import parameters_of

    if not logger.isEnabledFor(logging.INFO):
        return
    known = parameters_of(case)
    told = {
        name: known[name] for name in ("algorithm", "friction_coefficient", "coupling", "entry", "tolerance")
    }
    logger.info(
        words(
            "resumed" if done else "begun",
            title=case.title,
            version=__version__,
            machine=known["machine"],
            steps=case.planned_steps or "auto",
            **({"done": done} if done else {}),
            window=_size(lattice),
            spacing=lattice.spacing,
            method=case.method_for(lattice),
            **told,
        )
    )


def grown(number: int, before: Lattice, after: Lattice) -> None:
    """Tell of a window that grows, since the contact of a step has reached its rim."""
    logger.info(words("window", step=number, before=_size(before), after=_size(after)))


def _size(lattice: Lattice) -> str:
    return f"{lattice.n_row}x{lattice.n_col}"


@contextlib.contextmanager
def ending() -> Iterator[None]:
    """Tell why a run ends before its time."""
    try:
        yield
    except HexcontactError as error:
        if not error.logged:
            logger.error(words("stopped", reason=str(error)))
        error.logged = True
        raise


def finished(step: Step, total: int | None) -> None:
    """Tell of a finished load step: loads and motions, zones, residuals, work; no total: not known yet."""
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
    logger.info(words(f"step={step.number}" + (f"/{total}" if total else ""), **values))


def _rounded(value: float | int | str) -> float:
    return float(f"{float(value):.3g}")


def _zones(step: Step) -> dict[str, int]:
    """Count the nodes in contact, and with friction those that stick and those that slip."""
    zone = step.fields["zone"]
    contact, stick = int((zone > 0).sum()), int((zone == 1).sum())
    if "stick_area" not in step.history:
        return {"contact": contact}
    return {"contact": contact, "stick": stick, "slip": contact - stick}


# --- who listens ------------------------------------------------------------------------------------------


class _Lines(logging.Formatter):
    """Time (UTC), level and message, on one line whatever the message holds."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s.%(msecs)03dZ %(levelname)-7s %(message)s", "%Y-%m-%dT%H:%M:%S")
        self.converter = time.gmtime

    def format(self, record: logging.LogRecord) -> str:
        return visible("; ".join(super().format(record).splitlines()))


class _File(logging.FileHandler):
    """Appends to a file; one that can no longer be written is told of once, and the run goes on."""

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
        with ending():
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
