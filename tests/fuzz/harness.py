"""Runs commands in this process and judges how they end: a clean result or a sentence, nothing else."""

import contextlib
import hashlib
import io
import json
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

CLEAN = {0, 2, 3, 4}  # exit codes of the documentation: done, input, no convergence, resources
LONGEST = 60.0  # s of processor time, of which a command that hangs takes more
_OBEYED = re.compile("[\0-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e]")
_MARKED = re.compile(r"hexcontact: |step +\d+/|.*: \d+ load steps?(, after step \d+)?$")


class Hang(BaseException):
    """A command took too long."""


class Ending(NamedTuple):
    """How a command has ended."""

    exit_code: int
    out: str
    error: str


@contextlib.contextmanager
def time_limit() -> Iterator[None]:
    """Raise `Hang` after more than `LONGEST`."""
    seconds = LONGEST

    def ring(number: int, frame: Any) -> None:
        raise Hang(f"more than {seconds} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def ending(command: Callable[..., Any], **options: Any) -> Ending:
    """Run a command as the command line would, but for reading the arguments."""
    out, error, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error), time_limit():
        try:
            command(**options)
        except SystemExit as exit_:
            code = int(exit_.code or 0)
    return Ending(code, out.getvalue(), error.getvalue())


def told(end: Ending) -> dict[str, Any]:
    """Return the object that a command has printed."""
    found: dict[str, Any] = json.loads(end.out)
    return found


def complaints(end: Ending, as_json: bool = True) -> list[str]:
    """Return what is wrong with the way in which a command has ended."""
    found = []
    if end.exit_code not in CLEAN:
        found.append(f"exit code {end.exit_code}")
    if bool(end.exit_code) != any(line.startswith("hexcontact: ") for line in end.error.splitlines()):
        found.append("an error without a sentence, or a sentence without an error")
    if "Traceback" in end.error:
        found.append("traceback")
    found += [f"obeyed by a terminal: {word!r}" for word in _OBEYED.findall(end.out + end.error)]
    found += [f"not marked as ours: {line!r}" for line in end.error.splitlines() if not _MARKED.match(line)]
    if as_json:
        try:
            told = json.loads(end.out, parse_constant=lambda word: found.append(f"{word} in JSON"))
            if told["exit_code"] != end.exit_code or ("error" in told) != bool(end.exit_code):
                found.append("the object does not say how the command has ended")
        except (ValueError, KeyError, TypeError) as error:
            found.append(f"standard output is not JSON: {error!r}")
    return found


def contents(folder: Path, *passed_over: str) -> dict[str, str]:
    """Return what is in a folder, by name: the hash of every file."""
    return {
        str(path.relative_to(folder)): _hash(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in passed_over
    }


_known: dict[tuple[Path, int, int, int], str] = {}


def _hash(path: Path) -> str:
    """Return the hash of a file, as found before if its last change is older than what clocks tell apart."""
    state = path.stat()
    key = path, state.st_ino, state.st_ctime_ns, state.st_size
    if key in _known:
        return _known[key]
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if time.time() > state.st_ctime + 1.0:
        _known[key] = found
    return found
