"""The frame of every sub-command: the command line, shared options, errors, JSON, standard streams."""

from __future__ import annotations

import contextlib
import enum
import errno
import functools
import io
import json
import math
import os
import re
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, ParamSpec, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from .. import launcher
from .._version import __version__
from ..errors import (
    LACKING,
    ConvergenceError,
    DeckError,
    HexcontactError,
    KernelFolderWarning,
    PathWarning,
    ResourceError,
)
from ..text import listed, visible

if TYPE_CHECKING:
    from ..errors import Fault
    from ..problem.problem import Problem
    from ..result.result import Result


_OTHER_FILES = (".png", ".pdf", ".svg", ".csv", ".html", ".json", ".vtk", ".vtu")


def argument(metavar: str, help: str) -> Any:
    """Declare an argument of a command; the command itself tests whether it can read a file."""
    return typer.Argument(metavar=metavar, help=_plain(help), show_default=False, readable=False)


def option(names: str, help: str, metavar: str | None = None) -> Any:
    """Declare an option by its names, with blanks between; it has a value unless its argument is a bool."""
    return typer.Option(*names.split(), metavar=metavar, help=_plain(help), readable=False)


def _plain(help: str) -> str:
    return help.replace("[", r"\[")  # typer reads markup in it


OPTIONS = {
    "deck": argument("DECK", "The deck, a TOML file."),
    "file": argument("FILE", "The result, a netCDF file."),
    "settings": option(
        "--set", "Replace a key of the deck, as grid.spacing='0.05 mm'. Repeatable.", "KEY=VALUE"
    ),
    "source": option(
        "--source", "Tractions to the edges between the nodes (default if known), or as solved at nodes."
    ),
    "plot": option("--plot", "Draw the result beside the output (.png)."),
    "quiet": option("--quiet -q", "Print nothing but errors."),
    "as_json": option("--json", "Print one JSON object for programs, errors too; docs/running.md."),
    "log_file": option("--log-file", "Append a line for each load step, with time and work.", "LOG"),
    "log_level": option("--log-level", "Least level of the log; without LOG it goes to standard error."),
}
"""Arguments and options of several commands, by the names of their parameters."""

Source = enum.StrEnum("Source", ["edges", "nodes"])
"""Where pressure and shear traction come from."""

LogLevel = enum.StrEnum("LogLevel", ["debug", "info", "warning", "error"])
"""Levels of a log."""


def setting(text: str) -> tuple[str, Any]:
    """Return key and value of KEY=VALUE; a value that is not TOML is text, so that units need no quotes."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise DeckError(f"--set {text}: expected KEY=VALUE, such as load.1.normal_load='20 N'")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except ValueError:  # TOMLDecodeError, or an integer of too many digits
        return key.strip(), value.strip()


def steps_of(text: str, labels: Sequence[str], option: str = "step") -> list[int]:
    """Return numbers of load steps from "20", "10,20,30", "109-135", "all", or a label.

    A label selects the last step of its segments; cycles have empty labels.
    """
    words = [text.strip()] if text.strip() in labels else [word.strip() for word in text.split(",")]
    numbers: list[int] = []
    for word in words:
        if word and word in labels:
            ends = zip(labels, [*labels[1:], ""], strict=True)
            numbers += [k for k, (own, after) in enumerate(ends, start=1) if own == word != after]
        elif found := re.fullmatch(r"(\d{1,9}) *- *(\d{1,9})", word):
            numbers += range(int(found[1]), min(int(found[2]), max(int(found[1]), len(labels) + 1)) + 1)
        elif word == "all":
            numbers += range(1, len(labels) + 1)
        elif re.fullmatch(r"-?\d{1,9}", word):
            numbers.append(int(word))
    if len(numbers) < len(words):
        known = [f'"{label}"' for label in dict.fromkeys(labels) if label]
        one = "load step" if option == "step" else option
        expected = [f"a number of a {one}", "several as 10,20,30 or 10-30", "all"]
        expected += [f"a label ({listed(known, 'or')})"] if known else []
        raise DeckError(f"--{option} {text}: expected {listed(expected, 'or')}")
    return numbers


def labels_of(result: Result) -> list[str]:
    """Return the label of each load step."""
    return [str(label) for label in result["label"].values] if "label" in result else [""] * len(result)


def beside(file: Path, ending: str) -> Path:
    """Return the name of a file beside a result, which may be the current folder (a journal)."""
    there = file if file.name not in ("", "..") else file.resolve()
    return there.parent / f"{there.stem}{ending}"


def opened(file: Path) -> tuple[str, Path, Any]:
    """Return the kind of a file, "study", "table" or "result", its path, and the data of the first two."""
    from ..interior.files import read_table
    from ..study.dataset import read_study, study_of

    if (path := study_of(file)) is not None:
        return "study", path, read_study(path)
    table = read_table(file)
    return "result" if table is None else "table", file, table


def case_of(deck: Path, settings: list[str] | None) -> Problem:
    """Return the case of a deck with the keys that ``--set`` replaces."""
    from ..problem.problem import Problem

    return Problem.from_toml(deck, overrides=dict(map(setting, settings or ())))


def target_of(case: Problem, deck: Path, output: Path | None = None) -> Path:
    """Return the file that a run writes: that of the option or the deck, else one named after the deck."""
    target = output or case.output.file or Path(f"{deck.stem}.nc")
    if target.suffix in _OTHER_FILES:
        raise DeckError(f"output {target}: expected a netCDF file, such as {target.with_suffix('.nc')}")
    if not target.parent.is_dir():
        there = target.parent.exists()
        fault = f"{target.parent} is not a folder" if there else f"the folder {target.parent} does not exist"
        raise DeckError(f"cannot write {target}: {fault}")
    return target


P = ParamSpec("P")
# of the loader, of threads and of the netCDF library
_NO_MEMORY = ("failed to map segment", "can't start new thread", "Memory allocation (malloc) failure")
_NO_FILE = f": Error {errno.EMFILE}"  # of the loader
_KINDS = {
    DeckError.exit_code: "input",
    ConvergenceError.exit_code: "convergence",
    ResourceError.exit_code: "resources",
}
_SIGNAL = 128  # plus the number of a signal
Content = Mapping[str, Any] | None
"""The object that a command prints with ``--json``; None without it."""

_EXAMPLE = "hexcontact new sphere, then hexcontact run sphere.toml --plot"


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

    def content(self) -> dict[str, Any]:
        """Return the object of a failure, with the faults of a deck and further entries."""
        found = {
            "kind": "interrupted" if self.exit_code > _SIGNAL else _KINDS.get(self.exit_code, "other"),
            "message": seen_from_here(self.message),
            "exit_code": self.exit_code,
            "faults": [
                {name: part or None for name, part in fault._asdict().items() if name != "sentence"}
                for fault in self.faults
            ],
            **(self.details or {}),
        }
        return {"exit_code": self.exit_code, "error": found}


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
                write_json(name, content or {})
        except (Exception, KeyboardInterrupt) as error:
            report = None if os.environ.get("HEXCONTACT_DEBUG") else _report_of(error)
            if report is not None:
                print_error(report.message)
            if name:
                unforeseen = Report(f"{type(error).__name__}: {error}", HexcontactError.exit_code)
                write_json(name, (report or unforeseen).content())
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
        message = "\n".join([str(error), *getattr(error, "__notes__", ())])
        faults, details = getattr(error, "faults", ()), getattr(error, "details", None)
        return Report(message, error.exit_code, faults, details)
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


# --- standard streams ---------------------------------------------------------------------------------


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
    for line in seen_from_here(message).splitlines() or [""]:
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


# --- JSON ---------------------------------------------------------------------------------------------


def write_json(command: str, content: Mapping[str, Any]) -> None:
    """Print the object of a command: its name, its exit code and its content, see docs/running.md."""
    whole = {"hexcontact": __version__, "command": command, "exit_code": 0, **content}
    print(visible(json.dumps(jsonable(whole), ensure_ascii=False, allow_nan=False)), flush=True)


def jsonable(value: Any) -> Any:
    """Return a value for JSON: null for NaN; text for infinity, paths and objects of other types."""
    if isinstance(value, Mapping):
        return {str(key): jsonable(entry) for key, entry in value.items()}
    if isinstance(value, str | bool | int | None):
        return value
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # of numpy
        return jsonable(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None if math.isnan(value) else str(value)
    if isinstance(value, Sequence):
        return [jsonable(entry) for entry in value]
    return str(value)


def seen_from_here(message: str) -> str:
    """Return a message with the files of the current folder named without it."""
    with contextlib.suppress(OSError):  # the folder was deleted
        return message.replace(os.path.join(os.getcwd(), ""), "")
    return message


# --- the command line ---------------------------------------------------------------------------------


# commands that a launcher may start as several processes, or that refuse them
_FOR_PROCESSES = "run", "resume", "study"


class _Commands(TyperGroup):
    """The sub-commands; with ``--json`` wrong options and arguments give an object, too."""

    def main(self, args: Sequence[str] | None = None, *more: Any, **options: Any) -> Any:
        """Run the command that the arguments name."""
        given = sys.argv[1:] if args is None else list(args)
        name = next((word for word in given if word in self.commands), "")
        if name not in _FOR_PROCESSES:
            launcher.leave_to_first()
            if (started := launcher.copies()).total > 1:
                about = f"{started.launcher} started {started.total} processes; only the first one works"
                print(f"hexcontact: {about}", file=sys.stderr)
        try:
            return super().main(args, *more, **options)
        except SystemExit as ending:
            usage = getattr(ending.__context__, "format_message", None)  # printed by typer before
            if "--json" in given and usage is not None:
                write_json(name, Report(usage(), DeckError.exit_code).content())
            raise


app = typer.Typer(
    name="hexcontact",
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
"""The command, with the sub-commands of the modules that are imported."""


def command(
    example: str, *, short_help: str | None = None, cls: type[TyperCommand] | None = None, **declared: Any
) -> Callable[[Callable[P, Content]], Callable[P, None]]:
    """Register a function, guarded, as the sub-command of its name.

    Each parameter is an argument or an option, as `declared` by its name, or by `OPTIONS`.
    """

    def register(function: Callable[P, Content]) -> Callable[P, None]:
        for name, kind in get_type_hints(function).items():
            if name != "return":
                function.__annotations__[name] = Annotated[kind, declared.get(name) or OPTIONS[name]]
        add = app.command(cls=cls, short_help=short_help, epilog=f"Example: {example}")
        return add(guarded(function))

    return register


def _print_version(wanted: bool) -> None:
    """Print the version; with --verbose also compiler, libraries, threads, and the versions of packages."""
    if not wanted:
        return
    print(f"hexcontact {__version__}")
    if "--verbose" in sys.argv:
        import platform
        from importlib import metadata

        from ..core import flat, memory

        print("core", *flat.BUILT.split("; "), f"threads: {memory.threads()}", flat.LIBRARY, sep="\n  ")
        packages = ("numpy", "scipy", "netCDF4", "xarray", "pandas", "pydantic", "matplotlib")
        versions = (f"{name} {metadata.version(name)}" for name in packages)
        print(f"Python {platform.python_version()}", *versions, sep="\n  ")
    raise typer.Exit()


@app.callback(epilog=f"Example: {_EXAMPLE}")
def _hexcontact(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="With --version: compiler, FFT, BLAS, threads, packages, too.")
    ] = False,
) -> None:
    """Elastic contact in 3-D from a deck in TOML: pressure, shear traction, stick and slip, approach, shift.

    Exit codes: 0 done, 2 wrong input, 3 no convergence or accuracy, 4 memory or disk; 130, 138, 143 stopped.
    """
