"""What the command line says and returns in the end, above all when something goes wrong."""

from __future__ import annotations

import contextlib
import errno
import functools
import io
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec

import typer
from typer.core import TyperGroup

from ..errors import LACKING, DeckError, HexcontactError, KernelFolderWarning, PathWarning, ResourceError
from ..text import visible

if TYPE_CHECKING:
    from ..errors import Fault

P = ParamSpec("P")
# of the system, of threads and of the netCDF library
_NO_MEMORY = ("failed to map segment", "can't start new thread", "Memory allocation (malloc) failure")
Content = Mapping[str, Any] | None
"""What a command has to say to a program; None if it was not asked by ``--json``."""


class Failure(HexcontactError):
    """A failure whose exit code is known from elsewhere: of a case of a study, of a signal."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class _Told(NamedTuple):
    """What is said of an error."""

    message: str
    exit_code: int
    faults: Sequence[Fault] = ()
    details: Mapping[str, Any] | None = None


def guarded(command: Callable[P, Content]) -> Callable[P, None]:
    """Turn what goes wrong into a sentence and an exit code; HEXCONTACT_DEBUG=1 shows tracebacks instead.

    With ``--json`` the command returns what it has to say instead of printing it, and an object is printed
    whatever happens.
    """

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> None:
        name = command.__name__ if kwargs.get("as_json") else ""
        try:
            content = command(*args, **kwargs)
            if name:
                _print_json(name, content or {})
        except typer.Exit:
            raise
        except (Exception, KeyboardInterrupt) as error:
            told = None if os.environ.get("HEXCONTACT_DEBUG") else _told(error)
            if told is None:
                if name:
                    _print_error(name, _Told(f"{type(error).__name__}: {error}", HexcontactError.exit_code))
                raise
            complain(told.message)
            if name:
                _print_error(name, told)
            raise typer.Exit(told.exit_code) from None
        if content and content.get("exit_code"):
            raise typer.Exit(content["exit_code"])

    return wrapped


def _told(error: BaseException) -> _Told | None:
    """Return what is said of an error; None of one that nobody foresaw."""
    if isinstance(error, KeyboardInterrupt):
        return _Told("interrupted", 130)
    if isinstance(error, HexcontactError):
        message = "\n".join([str(error), *getattr(error, "__notes__", ())])
        return _Told(message, error.exit_code, getattr(error, "faults", ()), getattr(error, "details", None))
    if isinstance(error, UnicodeEncodeError):
        return _Told(f"{error.object[:100]}: expected UTF-8 text", DeckError.exit_code)
    if isinstance(error, MemoryError) or any(sign in str(error) for sign in _NO_MEMORY):
        return _Told("the machine has not enough memory for this", ResourceError.exit_code)
    if isinstance(error, OSError) and error.strerror:
        named = f"{error.filename}: " if error.filename else ""
        kind = ResourceError if error.errno in LACKING else DeckError
        return _Told(named + error.strerror, kind.exit_code)
    if isinstance(error, UnicodeEncodeError):  # bytes of a name or an argument that are no text
        return _Told(f"{error.object}: expected text in UTF-8", DeckError.exit_code)
    if isinstance(error, RuntimeError | OSError) and "NetCDF" in str(error):
        return _Told(f"the result file is damaged ({error})", DeckError.exit_code)
    return None


# --- standard streams ---------------------------------------------------------------------------------------


class _Outlet(io.FileIO):
    """Standard output or error; once it cannot be written any more, what is printed goes nowhere."""

    lost: OSError | None = None

    def write(self, content: Any) -> int:
        """Write bytes, or drop them."""
        if self.lost is None:
            try:
                return super().write(content)
            except OSError as error:
                self.lost = error
        return memoryview(content).nbytes


@contextlib.contextmanager
def standard_streams() -> Iterator[None]:
    """Let a command end as it would, though its standard streams are closed, full or not read any more.

    Raises
    ------
    SystemExit
        With the code of lacking resources if all went well but what was printed is lost; who closes a pipe
        has read enough.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # else the next files got the numbers of the closed ones, and what libraries print
    os.close(descriptor)
    output, error = _Outlet(1, "w", closefd=False), _Outlet(2, "w", closefd=False)
    for name, outlet in (("stdout", output), ("stderr", error)):
        plain = getattr(sys, name)
        setattr(
            sys,
            name,
            io.TextIOWrapper(
                io.BufferedWriter(outlet),
                encoding=plain.encoding if plain else "utf-8",
                errors="replace",  # a terminal without µ gets a question mark, not a traceback
                line_buffering=name == "stderr" or outlet.isatty(),
            ),
        )
    try:
        yield
    except SystemExit as ending:
        sys.stdout.flush()
        if output.lost and output.lost.errno != errno.EPIPE and not ending.code:
            complain(f"cannot write to standard output: {output.lost.strerror}")
            raise SystemExit(ResourceError.exit_code) from None
        raise


def complain(message: str) -> None:
    """Print a message on standard error, each line marked as ours."""
    for line in message.splitlines() or [""]:
        print(f"hexcontact: {visible(line)}", file=sys.stderr)


def say(message: str) -> None:
    """Print a message on standard output."""
    print(visible(message))


def warn_plainly() -> None:
    """From now on print warnings that are meant for users like other messages."""
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *more: Any, **options: Any) -> None:
        if issubclass(category, KernelFolderWarning | PathWarning):
            complain(f"warning: {message}")
        else:
            shown(message, category, *more, **options)

    warnings.showwarning = show


def _print_json(name: str, content: Mapping[str, Any]) -> None:
    from . import json_output

    json_output.write(name, content)


def _print_error(name: str, told: _Told) -> None:
    from . import json_output

    json_output.write(name, json_output.error(*told))


class Commands(TyperGroup):
    """The sub-commands; wrong options and arguments are told to programs, too."""

    def main(self, args: Sequence[str] | None = None, *more: Any, **options: Any) -> Any:
        """Run the command that the arguments name."""
        given = sys.argv[1:] if args is None else list(args)
        try:
            return super().main(args, *more, **options)
        except SystemExit as ending:
            usage = getattr(ending.__context__, "format_message", None)  # what typer has shown before
            if "--json" in given and usage is not None:
                name = next((word for word in given if word in self.commands), "")
                _print_error(name, _Told(usage(), DeckError.exit_code))
            raise
