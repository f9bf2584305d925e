"""The frame of every sub-command: registration, messages, exit codes, standard streams."""

from __future__ import annotations

import contextlib
import errno
import functools
import io
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec

from ..errors import LACKING, DeckError, HexcontactError, KernelFolderWarning, PathWarning, ResourceError
from ..text import visible
from . import json_output

if TYPE_CHECKING:
    from ..errors import Fault

P = ParamSpec("P")
# of the loader, of threads and of the netCDF library
_NO_MEMORY = ("failed to map segment", "can't start new thread", "Memory allocation (malloc) failure")
_NO_FILE = f": Error {errno.EMFILE}"  # of the loader
Content = Mapping[str, Any] | None
"""The object that a command prints with ``--json``; None without it."""


class Failure(HexcontactError):
    """A failure with a given exit code: that of a case of a study, or of a signal."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class Report(NamedTuple):
    """The message of an error, its exit code, and details for ``--json``."""

    message: str
    exit_code: int
    faults: Sequence[Fault] = ()
    details: Mapping[str, Any] | None = None

    def print_json(self, name: str) -> None:
        """Print the object of a command that failed."""
        json_output.write(name, json_output.error(*self))


def guarded(command: Callable[P, Content]) -> Callable[P, None]:
    """Turn exceptions into a sentence and an exit code; HEXCONTACT_DEBUG=1 shows tracebacks instead.

    With ``--json`` the command returns its content, and an object is printed in any case.
    """

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> None:
        name = command.__name__ if kwargs.get("as_json") else ""
        try:
            content = command(*args, **kwargs)
            if name:
                json_output.write(name, content or {})
        except (Exception, KeyboardInterrupt) as error:
            report = None if os.environ.get("HEXCONTACT_DEBUG") else _report_of(error)
            if report is not None:
                print_error(report.message)
            if name:
                unforeseen = Report(f"{type(error).__name__}: {error}", HexcontactError.exit_code)
                (report or unforeseen).print_json(name)
            if report is None:
                raise
            raise SystemExit(report.exit_code) from None
        if content and content.get("exit_code"):
            raise SystemExit(content["exit_code"])

    return wrapped


def _report_of(error: BaseException) -> Report | None:
    """Return the report of an error; None if it is a mistake of the program."""
    if isinstance(error, KeyboardInterrupt):
        return Report("interrupted", 130)
    if isinstance(error, HexcontactError):
        message, faults = (
            "\n".join([str(error), *getattr(error, "__notes__", ())]),
            getattr(error, "faults", ()),
        )
        return Report(message, error.exit_code, faults, getattr(error, "details", None))
    if isinstance(error, UnicodeEncodeError):  # bytes of a name or an argument that are no text
        return Report(f"{error.object[:100]}: expected UTF-8 text", DeckError.exit_code)
    if isinstance(error, MemoryError) or any(sign in str(error) for sign in _NO_MEMORY):
        return Report("the machine has not enough memory for this", ResourceError.exit_code)
    if isinstance(error, ImportError) and _NO_FILE in str(error):
        return Report(f"{error.path or error.name}: {os.strerror(errno.EMFILE)}", ResourceError.exit_code)
    if isinstance(error, OSError) and error.strerror:
        named = f"{error.filename}: " if error.filename else ""
        kind = ResourceError if error.errno in LACKING else DeckError
        return Report(named + error.strerror, kind.exit_code)
    if isinstance(error, RuntimeError | OSError) and "NetCDF" in str(error):
        return Report(f"the result file is damaged ({error})", DeckError.exit_code)
    return None


# --- standard streams ---------------------------------------------------------------------------------------


class _Outlet(io.FileIO):
    """Standard output or error; after a write has failed, further text is dropped."""

    lost: OSError | None = None

    def write(self, content: Any) -> int:
        """Write bytes, or drop them."""
        if self.lost is None:
            try:
                return super().write(content)
            except OSError as error:
                self.lost = error
        return memoryview(content).nbytes


class _Unpadded(io.TextIOWrapper):
    """Text of a pipe or file, without the blanks at the ends of lines that help texts are padded with."""

    def write(self, text: str) -> int:
        """Write text."""
        super().write(re.sub(r"(?<! ) ++(?=\n)", "", text))
        return len(text)


@contextlib.contextmanager
def standard_streams() -> Iterator[None]:
    """Let a command end normally although its standard streams are closed, full or no longer read.

    If the command succeeded but its output is lost, exit with the code of lacking resources, unless the
    reader has closed the pipe.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # otherwise the next files would get the numbers of closed streams, and the output of libraries
    os.close(descriptor)
    output, error = _Outlet(1, "w", closefd=False), _Outlet(2, "w", closefd=False)
    for name, outlet in (("stdout", output), ("stderr", error)):
        plain = getattr(sys, name)
        setattr(
            sys,
            name,
            (io.TextIOWrapper if outlet.isatty() else _Unpadded)(
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
            print_error(f"cannot write to standard output: {output.lost.strerror}")
            raise SystemExit(ResourceError.exit_code) from None
        raise


def print_error(message: str) -> None:
    """Print a message on standard error, each line marked; files of this folder without its name."""
    for line in json_output.seen_from_here(message).splitlines() or [""]:
        print(f"hexcontact: {visible(line)}", file=sys.stderr)


def print_output(message: str) -> None:
    """Print a message on standard output."""
    print(visible(message))


def warn_plainly() -> None:
    """Print warnings for users like other messages from now on."""
    shown = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *more: Any, **options: Any) -> None:
        if issubclass(category, KernelFolderWarning | PathWarning):
            print_error(f"warning: {message}")
        else:
            shown(message, category, *more, **options)

    warnings.showwarning = show


# --- the sub-commands ---------------------------------------------------------------------------------------


class Command(NamedTuple):
    """Hold a sub-command and its help."""

    function: Callable[..., None]  # guarded
    example: str
    short_help: str | None = None  # None: the first sentence of the help
    help: Callable[[], str] | None = None  # None: the docstring of the function


COMMANDS: dict[str, Command] = {}
"""The sub-commands of the modules that are imported."""


def command(example: str, **options: Any) -> Callable[[Callable[P, Content]], Callable[P, None]]:
    """Register a function as the sub-command of its name, guarded, with its options as arguments."""

    def register(function: Callable[P, Content]) -> Callable[P, None]:
        COMMANDS[function.__name__] = Command(guarded(function), example, **options)
        return COMMANDS[function.__name__].function

    return register
