"""Exceptions of the package, each with its exit code."""

from __future__ import annotations

import errno
import sys
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

LACKING = frozenset(  # errors of the system that are not due to the input
    {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE}
)


class Fault(NamedTuple):
    """A fault of the input, in parts.

    Attributes
    ----------
    message : str
        The whole sentence, with the place in front.
    key : str
        Dotted key of the deck; empty if the fault belongs to no key.
    value : str
        Value in the deck, shortened; empty if there is none.
    file : str
        File of the key; empty for an override, or a case that was built in Python.
    line, column : int or None
        Place in the file, from 1.
    sentence : str
        The message without place, key and value.
    """

    message: str
    key: str = ""
    value: str = ""
    file: str = ""
    line: int | None = None
    column: int | None = None
    sentence: str = ""


class HexcontactError(Exception):
    """Base of every error this package raises on purpose."""

    exit_code = 1
    logged = False  # whether it is in the log


class DeckError(HexcontactError, ValueError):
    """The input is wrong: a deck key, an argument, a file that cannot be read or written.

    ``faults`` are those of a deck; there are none for other input.
    """

    exit_code = 2

    def __init__(self, message: str, faults: Sequence[Fault] = ()) -> None:
        super().__init__(message)
        self.faults = tuple(faults)


class NotInResult(DeckError):
    """A result lacks the data: fields that were not kept, zones without friction."""


class NoSuchStep(DeckError, IndexError):
    """There is no load step of this number."""


class PlausibilityWarning(UserWarning):
    """A case exceeds a limit of the theory, of its lattice or of its load steps; nothing is refused."""


class KernelFolderWarning(UserWarning):
    """Spectra of kernels cannot be stored in a folder or read from it; results do not change."""


class AccuracyWarning(UserWarning):
    """An accuracy was not reached: that of [accuracy] on the finest lattice, or solver.step_tolerance."""

    exit_code = 3


class PathWarning(UserWarning):
    """A load step was solved in parts, along a path that the load history does not prescribe."""


class RimWarning(UserWarning):
    """Contact at the rim of the window: a larger window may have another solution."""


class ConvergenceError(HexcontactError, RuntimeError):
    """A load step did not meet its tolerance; the steps before it are recorded.

    ``details`` are the step, its residuals and where they are largest, by name; SI.
    """

    exit_code = 3

    def __init__(self, message: str, details: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.details = dict(details or {})


class ResourceError(HexcontactError, MemoryError):
    """The machine cannot hold the case (memory, threads, a library's limit)."""

    exit_code = 4


class StopRun(Exception):
    """Ends a run after the current step if a callback (`on_step`) raises it; the message is the reason.

    `hexcontact.Case.run` catches it and returns the finished steps.
    """


def warn(message: str, category: type[Warning]) -> None:
    """Raise a warning at the line outside the package whose call led here."""
    frame, level = sys._getframe(1), 2
    while frame.f_globals.get("__name__", "").partition(".")[0] == __package__ and frame.f_back is not None:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)
