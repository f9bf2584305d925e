"""Reading of files that users name, with one sentence for a fault, and atomic writing."""

from __future__ import annotations

import codecs
import contextlib
import errno
import glob
import os
import stat
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from ._version import __version__
from .errors import LACKING, DeckError, HexcontactError, ResourceError

_T = TypeVar("_T")

LARGEST_TEXT = 1 << 25  # bytes; 100,000 load steps of six loads each fit
MADE_BY = f"made by hexcontact {__version__}"  # in pictures and pages
_HDF5 = b"\x89HDF\r\n\x1a\n"  # how files of HDF5 begin, and netCDF-4 is one
_MARK = MADE_BY.removesuffix(__version__).encode()
_QUIET = 5.0  # seconds after which nobody writes to a temporary file any more
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


def require_kinds(values: Any, **kinds: type) -> None:
    """Raise ValueError unless a value is a table that has entries of these kinds."""
    if not isinstance(values, dict):
        raise ValueError("it holds no table")
    for name, kind in kinds.items():
        if not isinstance(values[name], kind):
            raise ValueError(f"its {name} is not what it should be")


def made(kind: Callable[..., _T], values: Any) -> _T:
    """Return an object of the entries of a table that was read; ValueError if they are not its own."""
    require_kinds(values)
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
    raise DeckError(f"{path} is there and was not made by hexcontact; delete it or choose another name")


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
