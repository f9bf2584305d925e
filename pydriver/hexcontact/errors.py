"""The exceptions a caller may want to catch, and the exit code each one means."""

from __future__ import annotations


class HexcontactError(Exception):
    """Base of every error this package raises on purpose."""

    exit_code = 1


class DeckError(HexcontactError, ValueError):
    """The input is wrong: a deck key, an argument, a file that cannot be read or written."""

    exit_code = 2


class ConvergenceError(HexcontactError, RuntimeError):
    """A load step did not meet its tolerance; the last good step is kept."""

    exit_code = 3


class ResourceError(HexcontactError, MemoryError):
    """The machine cannot hold the case (memory, threads, a library's limit)."""

    exit_code = 4


class StopRun(Exception):
    """Raised by a callback (`on_step`) to end a run after the step at hand; the message says why.

    It does not leave `hexcontact.Case.run`: the run returns what is finished.
    """
