"""Files that users name: reading with one sentence for a fault, atomic writing, locks."""

from __future__ import annotations

import codecs
import contextlib
import errno
import fcntl
import glob
import json
import math
import os
import stat
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from ._version import __version__
from .errors import LACKING, DeckError, HexcontactError, ResourceError
from .launcher import copies

_T = TypeVar("_T")

LARGEST_TEXT = 1 << 25  # bytes; 100,000 load steps of six loads each fit
MADE_BY = f"made by hexcontact {__version__}"  # in pictures and pages
_HDF5 = b"\x89HDF\r\n\x1a\n"  # how files of HDF5 begin, and netCDF-4 is one
_MARK = MADE_BY.removesuffix(__version__).encode()
_QUIET = 5.0  # seconds without a write, after which a temporary file is abandoned
_ENDS = 1 << 16  # bytes at the beginning and at the end of a file, in one of which the mark is


def text_of(path: str | Path, expected: str) -> str:
    """Read a text file in UTF-8."""
    fault = ""
    if "\0" in str(path):
        raise DeckError(f"{path}: cannot be read (embedded null byte); expected {expected}")
    try:
        with open(path, "rb", opener=_opened) as file:
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                content = file.read(LARGEST_TEXT + 1) or b""  # None: a file of the kernel has no more yet
                if len(content) <= LARGEST_TEXT:
                    return content.decode("utf-8-sig")
                fault = f"is larger than {LARGEST_TEXT >> 20} MB"
            else:
                fault = "is not a regular file"
    except FileNotFoundError:
        fault = "no such file"
    except IsADirectoryError:
        fault = "is a folder"
    except UnicodeDecodeError as error:
        fault = f"is not UTF-8 text (byte {error.start})"
        if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            fault = "is UTF-16 text; save it as UTF-8"
        elif content.startswith(_HDF5):
            fault = "is a netCDF file, such as a result; hexcontact info shows it"
    except OSError as error:
        fault = f"cannot be read ({error.strerror or error})"
        if error.errno in LACKING:
            raise ResourceError(f"{path}: {fault}") from None
    raise DeckError(f"{path}: {fault}; expected {expected}")


def beginning(path: Path, size: int) -> bytes:
    """Return the first bytes of a file; none if it cannot be read, or is a device or a pipe."""
    with contextlib.suppress(OSError), open(path, "rb", opener=_opened) as file:
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            return file.read(size) or b""
    return b""


def _opened(name: str, flags: int) -> int:
    """Open a file without waiting for the writer of a pipe."""
    return os.open(name, flags | os.O_NONBLOCK)


def require_ordinary(path: str | os.PathLike[str], expected: str) -> None:
    """Refuse a file that a library, which opens it by its name, would read for ever or cannot name."""
    require_utf8(path, expected)
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):
        raise DeckError(f"{path}: is not a regular file; expected {expected}")


def require_utf8(path: str | os.PathLike[str], expected: str) -> None:
    """Refuse a file whose whole name is not UTF-8, which netCDF cannot open."""
    try:
        os.path.abspath(path).encode()
    except UnicodeEncodeError:
        raise DeckError(f"{os.path.abspath(path)}: is no name in UTF-8; expected {expected}") from None


@contextlib.contextmanager
def reading(path: Path, kind: str = "a netCDF file") -> Iterator[None]:
    """Raise one sentence for an exception by a damaged or foreign file, or a device.

    Below the package damage takes any form. An error raised by the package itself is a defect of it, unless a
    value is missing or wrong.
    """
    require_ordinary(path, kind)
    try:
        yield
    except (HexcontactError, FileNotFoundError, MemoryError):
        raise
    except PermissionError as error:
        raise DeckError(f"{path} cannot be read: {error.strerror}") from error
    except Exception as error:
        if is_defect(error):
            raise
        if isinstance(error, OSError) and error.errno in LACKING:
            raise ResourceError(f"{path} cannot be read: {error.strerror}") from error
        fault = f"is damaged or not {kind} ({str(error).strip() or type(error).__name__})"
        if path.suffix == ".toml":
            fault = f"is a TOML file; expected {kind}, which hexcontact run or study writes"
        raise DeckError(f"{path} {fault}") from error


def is_defect(error: Exception) -> bool:
    """Test whether the package itself tripped while it read a file, and not over a missing or wrong value."""
    if isinstance(error, OSError | ValueError | KeyError):
        return False
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    return bool(frames) and str(frames[-1].f_globals.get("__name__")).partition(".")[0] == __package__


def require_table(values: Any) -> None:
    """Raise ValueError unless a value that was read is a table."""
    if not isinstance(values, dict):
        raise ValueError("it holds no table")


def made(kind: Callable[..., _T], values: Any) -> _T:
    """Return an object of the entries of a table that was read; ValueError if they are not its own."""
    require_table(values)
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(str(error)) from None


# --- writing ------------------------------------------------------------------------------------------------


def require_replaceable(path: Path, begins: str = "") -> None:
    """Refuse to replace a picture, page or table that hexcontact has not made; an empty file may be replaced.

    A file of hexcontact has its mark, or, if that is given, begins with some text.
    """
    if not path.is_file() or not path.stat().st_size:
        return
    with contextlib.suppress(OSError), path.open("rb") as file:
        head = file.read(_ENDS)
        file.seek(max(0, path.stat().st_size - _ENDS))
        if begins and head.startswith(begins.encode()):
            return
        if not begins and (_MARK in head or _MARK in file.read(_ENDS)):
            return
    raise DeckError(f"{path} exists and was not made by hexcontact; delete it or choose another name")


@contextlib.contextmanager
def replacing(target: Path, temporary: Path | None = None) -> Iterator[Path]:
    """Yield the temporary name of a file, which then replaces `target` as a whole.

    At the end the file is on the disk; after an error it is deleted and `target` is unchanged.
    """
    if os.path.lexists(target) and not (target.is_file() or target.is_symlink()):
        raise DeckError(f"{target} is not a regular file; choose another name")
    if not target.parent.is_dir():
        raise DeckError(f"cannot write {target}: the folder {target.parent} does not exist")
    temporary = temporary or temporary_of(target)
    make_anew(temporary)
    try:
        yield temporary
        flush(temporary)
        os.replace(temporary, target)
        flush(target.parent)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def temporary_of(target: Path) -> Path:
    """Return the name under which this process writes a file before it replaces `target`."""
    return target.with_name(f"{target.name}.{os.getpid()}.tmp")


def remove_stale(target: Path) -> None:
    """Delete temporary files of killed processes, under the names of `temporary_of`.

    A file that was written to a moment ago may be that of a process on another machine.
    """
    for path in target.parent.glob(f"{glob.escape(target.name)}.*.tmp"):
        number = path.name[len(target.name) + 1 : -len(".tmp")]
        if number.isascii() and number.isdigit() and not is_process(int(number)):
            with contextlib.suppress(OSError):
                if time.time() - path.lstat().st_mtime > _QUIET:
                    path.unlink()


def is_process(number: int) -> bool:
    """Test whether a process of this number runs on this machine."""
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # of another user
        pass
    return True


def make_anew(path: Path) -> None:
    """Create an empty file in the place of any other of its name, without following a link."""
    path.unlink(missing_ok=True)
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666))


def flush(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if not (path.is_dir() and error.errno in (errno.EINVAL, errno.ENOTSUP)):  # not every system can
            raise
    finally:
        os.close(descriptor)


_CLOCKS = 2.0  # s, between which the clocks of the system and of its processes may differ
_LEAST, _LONGEST = 500, 1000  # bytes of a lock, which ends with blanks
_JOB = ("SLURM_CLUSTER_NAME", "SLURM_JOB_ID", "SLURM_RESTART_COUNT")
_TRIES = 1000  # to open a lock that its holder deletes at the same time


class Lock:
    """Keeps two runs from writing one output; DeckError if another run holds it, or the file is no lock.

    The operating system holds the lock, and releases it when the process dies.
    File systems differ in whether another machine notices, so the file names process and host:
    a lock left by another host counts as held, unless an earlier attempt of this job of Slurm left it.
    `output` is named in messages; `began` is when the run began that a resumed one continues (s since 1970),
    see `begun`.
    """

    def __init__(self, path: Path, output: Path, began: float | None = None) -> None:
        self.path = path
        for _ in range(_TRIES):
            self._descriptor = _lock_file(path)
            try:
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                held = False
            except BlockingIOError:
                held = True
            except OSError:  # a file system without locks: the process number decides
                held = _is_running(self._holder())
            if held or _same_file(path, self._descriptor):
                break
            os.close(self._descriptor)  # its holder has deleted the file since
        else:
            raise _no_lock(path)
        holder = self._holder()
        if holder is None:
            os.close(self._descriptor)
            raise _no_lock(path)
        here = holder.get("host", os.uname().nodename) == os.uname().nodename
        if held or not (here or _is_over(holder)):
            os.close(self._descriptor)
            since = f" since {holder['since']}" if "since" in holder else ""
            advice = f"if that run is over, delete {path}"
            if holder.get("process") == os.getpid() and held:
                advice = "it belongs to this program, which may close the session or wait for the run"
            elif held and (started := copies()).total > 1:
                advice += (
                    f"; {started.launcher} started {started.total} processes, and each solves alone: name an "
                    "output for each"
                )
            raise DeckError(
                f"{output} is being written by another run, process {holder.get('process', '?')} "
                f"on {holder.get('host', '?')}{since}; {advice}"
            )
        text: dict[str, Any] = {
            "process": os.getpid(),
            "host": os.uname().nodename,
            "since": time.strftime("%F %T"),
            "time": time.time(),
            "job": [*map(os.environ.get, _JOB)],
        }
        if began is not None and math.isfinite(began):
            text["began"] = began
        try:
            # one call, so that a process that dies here leaves the old text or the new one
            os.pwrite(self._descriptor, json.dumps(text).encode().ljust(_LEAST), 0)
            os.ftruncate(self._descriptor, _LEAST)
        except BaseException:  # a full disk
            self.release()
            raise

    def _holder(self) -> dict[str, Any] | None:
        """Return process and host of the lock, see `holder_of`."""
        return holder_of(os.pread(self._descriptor, _LONGEST + 1, 0))

    def release(self) -> None:
        """Release the lock and delete its file, but no other file in its place."""
        if _same_file(self.path, self._descriptor):
            self.path.unlink(missing_ok=True)
        os.close(self._descriptor)


def _is_over(holder: dict[str, Any]) -> bool:
    """Test whether an earlier attempt of this job wrote the lock: a job runs once at a time."""
    own = [*map(os.environ.get, _JOB)]
    with contextlib.suppress(LookupError, TypeError, ValueError):
        cluster, job, restarts = holder["job"]
        return bool(job) and [cluster, job] == own[:2] and int(restarts or 0) < int(own[2] or 0)
    return False


def holder_of(text: bytes) -> dict[str, Any] | None:
    """Return process and host in the text of a lock; nothing if it is blank or cut; None for other text."""
    if not text.strip(b"\0"):  # nothing yet; zeros after a power failure
        return {}
    with contextlib.suppress(ValueError, RecursionError):
        holder = json.loads(text)
        return holder if isinstance(holder, dict) and holder.keys() >= {"process", "host"} else None
    return {} if text.startswith(b'{"process": ') and len(text) <= _LONGEST else None


def begun(path: Path) -> float | None:
    """Return when the run that left a lock began (s since 1970), inf if it died at once; None without one."""
    if not names_a_run(path):
        return None
    holder = holder_of(path.read_bytes()) or {}
    began = holder.get("began", holder.get("time"))
    return float(began) if isinstance(began, int | float) else math.inf


def names_a_run(path: Path) -> bool:
    """Test whether a run has written this lock, or created it: it is blank for a moment."""
    there = path.is_file() and not path.is_symlink()
    return there and holder_of(beginning(path, _LONGEST + 1)) is not None


def _lock_file(path: Path) -> int:
    """Open or create a lock; DeckError for anything but a file of this one name."""
    try:
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        descriptor = os.open(path, flags, 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):  # a link, a folder, a socket
            raise _no_lock(path) from None
        raise
    there = os.fstat(descriptor)
    if not stat.S_ISREG(there.st_mode) or there.st_nlink > 1:
        os.close(descriptor)
        raise _no_lock(path)
    return descriptor


def _no_lock(path: Path) -> DeckError:
    return DeckError(f"{path} is not a lock of hexcontact; move it away")


def _is_running(holder: dict[str, Any] | None) -> bool:
    """Test whether the process that wrote the lock runs on this machine, not a later one of its number."""
    import psutil

    number = holder.get("process") if holder else None
    if not holder or holder.get("host") != os.uname().nodename or type(number) is not int or number < 1:
        return False
    if not is_process(number):
        return False
    try:
        began = psutil.Process(number).create_time()
    except (psutil.Error, OSError):  # as without /proc
        return True
    return bool(began < float(holder.get("time", math.inf)) + _CLOCKS)


def _same_file(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False
