"""Checksums of whole files, at their end.

HDF5 files may be longer than what belongs to them. After it a result holds 48 bytes: a mark, and a SHA-256 of
the SHA-256 of each block of all that comes before. So damage is noticed before HDF5 reads it, wherever it is,
in indices of chunks too. What rewrites the file with HDF5 takes the seal away.
"""

from __future__ import annotations

import hashlib
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..errors import DeckError

_MARK = b"hexcontact sha-2"
_SIZE = len(_MARK) + 32
_BLOCK = 1 << 22  # bytes
_HDF5 = b"\x89HDF\r\n\x1a\n\x02\x08\x08"  # version of the head, then sizes of addresses and lengths
_END = slice(28, 36)  # in the head: the address where the file ends


def _digest(descriptor: int, size: int) -> bytes:
    """Return the digest of the first `size` bytes of a file."""

    def of_block(start: int) -> bytes:
        return hashlib.sha256(os.pread(descriptor, min(_BLOCK, size - start), start)).digest()

    with ThreadPoolExecutor(min(8, os.cpu_count() or 1)) as pool:  # which hashing lets run
        return hashlib.sha256(b"".join(pool.map(of_block, range(0, size, _BLOCK)))).digest()


def seal(path: Path) -> None:
    """Add the checksum to a file."""
    with path.open("r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.write(_MARK + _digest(file.fileno(), size))


def is_sealed(path: Path) -> bool:
    """Tell whether a file ends with a seal, be it broken."""
    with path.open("rb") as file:
        file.seek(-min(_SIZE, path.stat().st_size), os.SEEK_END)
        return file.read(len(_MARK)) == _MARK


def check_seal(path: Path) -> bool:
    """Tell whether a file is as it was written; False if it has no seal to tell by.

    Raises
    ------
    DeckError
        If it has changed since.
    """
    with path.open("rb") as file:
        head, size = file.read(_END.stop), file.seek(0, os.SEEK_END)
        file.seek(max(0, size - _SIZE))
        end = file.read(_SIZE)
        if end.startswith(_MARK):
            if _digest(file.fileno(), size - _SIZE) == end[len(_MARK) :]:
                return True
            raise DeckError(f"{path} is damaged: its bytes are not those that were written (SHA-256)")
    if head.startswith(_HDF5) and size > int.from_bytes(head[_END], "little"):
        raise DeckError(f"{path} is damaged: the checksum at its end cannot be read")
    return False
