"""The exceptions a caller may want to catch, and the exit code each one means."""

from __future__ import annotations

import errno
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

LACKING = frozenset(  # what the system says if it is not the input that is wrong
    {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE}
)


class Fault(NamedTuple):
    """One thing that is wrong with the input, in parts.

    Attributes
    ----------
    message : str
        The whole sentence, with the place in front.
    key : str
        Dotted key of the deck; empty where none is to blame.
    value : str
        What the deck says there, shortened; empty if nothing.
    file : str
        File that says it; empty for an override, or a case that was built in Python.
    line, column : int or None
        Where in the file, from 1.
    """

    message: str
    key: str = ""
    value: str = ""
    file: str = ""
    line: int | None = None
    column: int | None = None


class HexcontactError(Exception):
    """Base of every error this package raises on purpose."""

    exit_code = 1
    logged = False  # whether the log has it already


class DeckError(HexcontactError, ValueError):
    """The input is wrong: a deck key, an argument, a file that cannot be read or written.

    Attributes
    ----------
    faults : tuple of Fault
        Each thing that is wrong with a deck; empty for what is no deck.
    """

    exit_code = 2

    def __init__(self, message: str, faults: Sequence[Fault] = ()) -> None:
        super().__init__(message)
        self.faults = tuple(faults)


class KernelFolderWarning(UserWarning):
    """Spectra of kernels cannot be kept in a folder, or taken from it; nothing else comes of it."""


class AccuracyWarning(UserWarning):
    """The lattice could not be refined to the accuracy asked for; the finest result is kept."""

    exit_code = 3


class PathWarning(UserWarning):
    """A load step was solved in parts, along a path that the load history does not prescribe."""


class ConvergenceError(HexcontactError, RuntimeError):
    """A load step did not meet its tolerance; the last good step is kept.

    Attributes
    ----------
    details : mapping
        The step, its residuals and where they are largest, by name; SI.
    """

    exit_code = 3

    def __init__(self, message: str, details: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.details = dict(details or {})


class ResourceError(HexcontactError, MemoryError):
    """The machine cannot hold the case (memory, threads, a library's limit)."""

    exit_code = 4


class StopRun(Exception):
    """Raised by a callback (`on_step`) to end a run after the step at hand; the message says why.

    It does not leave `hexcontact.Case.run`: the run returns what is finished.
    """
