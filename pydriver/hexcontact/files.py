"""Reading files that users name: ordinary ones of a bounded size, or one sentence."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from .errors import DeckError

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
        # a pipe that nobody writes to would block
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                content = file.read(LARGEST_TEXT + 1)
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
