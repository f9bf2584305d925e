"""What the command line says and returns when something goes wrong."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from typing import NoReturn, ParamSpec, TypeVar

import typer

from .errors import DeckError, HexcontactError, ResourceError

P = ParamSpec("P")
R = TypeVar("R")


def fail(message: str, code: int) -> NoReturn:
    """Print a message on standard error, each line marked as ours, and exit."""
    for line in message.splitlines() or [""]:
        print(f"hexcontact: {line}", file=sys.stderr)
    raise typer.Exit(code)


def guarded(command: Callable[P, R]) -> Callable[P, R]:
    """Turn what goes wrong into a sentence and an exit code; HEXCONTACT_DEBUG=1 shows tracebacks instead."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return command(*args, **kwargs)
        except BrokenPipeError:
            raise
        except KeyboardInterrupt:
            fail("interrupted", 130)
        except Exception as error:
            if os.environ.get("HEXCONTACT_DEBUG"):
                raise
            if isinstance(error, HexcontactError):
                fail("\n".join([str(error), *getattr(error, "__notes__", ())]), error.exit_code)
            if isinstance(error, MemoryError):
                fail("the machine has not enough memory for this", ResourceError.exit_code)
            if isinstance(error, OSError) and error.strerror:
                named = f"{error.filename}: " if error.filename else ""
                fail(named + error.strerror, DeckError.exit_code)
            if isinstance(error, RuntimeError | OSError) and "NetCDF" in str(error):
                fail(f"the result file is damaged ({error})", DeckError.exit_code)
            raise

    return wrapped
