"""Files: reading those that users name, or one sentence; writing them as a whole, or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from .errors import LACKING, DeckError, HexcontactError, ResourceError

LARGEST_TEXT = 1 << 25  # bytes; 100,000 load steps of six loads each fit


def text_of(path: str | Path, expected: str) -> str:
    """Read a text file in UTF-8.

    Parameters
    ----------
    path : str or Path
        The file.
    expected : str
        What it should have been, for messages: "a deck (a TOML file)".

    Raises
    ------
    DeckError
        If there is no such file, it is a folder or a device, too large, or not UTF-8.
    """
    fault = ""
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
    except (OSError, ValueError) as error:
        fault = f"cannot be read ({getattr(error, 'strerror', None) or error})"
    raise DeckError(f"{path}: {fault}; expected {expected}")


def beginning(path: Path, size: int) -> bytes:
    """Read the first bytes of a file; none of what cannot be read, and of devices and pipes."""
    with contextlib.suppress(OSError), open(path, "rb", opener=_opened) as file:
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            return file.read(size) or b""
    return b""


def _opened(name: str, flags: int) -> int:
    """Open a file; a pipe that nobody writes to would block."""
    return os.open(name, flags | os.O_NONBLOCK)


def require_ordinary(path: str | os.PathLike[str], expected: str) -> None:
    """Refuse what a library that opens a file by its name would read for ever, or has no name for.

    Raises
    ------
    DeckError
        If it is a device or a pipe, or its name is not UTF-8; missing files and folders are left to the
        library.
    """
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
    """Turn what goes wrong on reading a damaged or foreign file, or a device, into one sentence."""
    require_ordinary(path, kind)
    try:
        yield
    except (HexcontactError, FileNotFoundError, MemoryError):
        raise
    except PermissionError as error:
        raise DeckError(f"{path} cannot be read: {error.strerror}") from error
    except Exception as error:  # damage takes any form: every library below has its own exceptions
        if isinstance(error, OSError) and error.errno in LACKING:
            raise ResourceError(f"{path} cannot be read: {error.strerror}") from error
        raise DeckError(
            f"{path} is damaged or not {kind} ({str(error).strip() or type(error).__name__})"
        ) from error


# --- writing ------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def replacing(target: Path, temporary: Path | None = None) -> Iterator[Path]:
    """Give the name under which a file is written, which then takes the place of `target` as a whole.

    When this ends, the file is on the disk; after an error nothing is left of it, and `target` is as it was.

    Parameters
    ----------
    target : Path
        The file to replace, which need not be there.
    temporary : Path, optional
        The name, in the same file system; by default one beside it that other processes do not use.
    """
    temporary = temporary or target.with_name(f"{target.name}.{os.getpid()}.tmp")
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


def make_anew(path: Path) -> None:
    """Make an empty file; what had its name is gone: a link would be followed to another file."""
    path.unlink(missing_ok=True)
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666))


def flush(path: Path) -> None:
    """See to it that a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if not (path.is_dir() and error.errno in (errno.EINVAL, errno.ENOTSUP)):  # not every system can
            raise
    finally:
        os.close(descriptor)
