"""Cache of the spectra of influence kernels: in memory, and optionally in a folder.

The set-up of a problem evaluates its influence kernels and transforms them. The spectra depend on the number
of rows and columns and, with friction, on the ratios ``beta`` and ``gamma`` of the materials; not on spacing,
moduli, shapes, loads or the coefficient of friction. So similar problems share them. Results are
bit-identical with computed and cached spectra.

Four environment variables set the cache; `configure` does the same from Python.

- ``HEXCONTACT_KERNEL_MEMORY``: bytes in memory at most, such as ``1 GB``; 256 MB if not set, 0 for none.
- ``HEXCONTACT_KERNEL_FOLDER``: a folder for spectra, which other processes may use; none if not set.
- ``HEXCONTACT_KERNEL_FOLDER_SIZE``: bytes in it at most; 2 GB if not set.
- ``HEXCONTACT_KERNEL_FOLDER_SHARED``: ``yes`` for a folder, and files in it, that other users can write.
  Otherwise a folder of another user, or one that others can write to, is not used.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import logging
import os
import platform
import re
import time
import uuid
from pathlib import Path
from typing import NamedTuple

from ..errors import DeckError, KernelFolderWarning, warn
from . import flat, ranks

MEMORY, FOLDER, FOLDER_SIZE, SHARED = (
    f"HEXCONTACT_KERNEL_{word}" for word in ("MEMORY", "FOLDER", "FOLDER_SIZE", "FOLDER_SHARED")
)
_DEFAULTS = {MEMORY: "256 MB", FOLDER_SIZE: "2 GB"}
_UNITS = {"": 1, "B": 1} | {
    f"{prefix}{unit}": base**power
    for power, prefix in enumerate(("k", "M", "G", "T"), start=1)
    for unit, base in (("B", 1000), ("iB", 1024))
}
_FILE = r"[a-z-]+-\d+x\d+-[0-9A-F]{16}\.kernels(\.[0-9a-f]+-\d+\.part)?"
_DAY = 86400.0
_LOGGER = logging.getLogger("hexcontact")
_FOREIGN = f"it belongs to another user ({SHARED}=yes if that one is trusted)"
_OPEN = f"other users may write to it (chmod go-w, or {SHARED}=yes if all of them are trusted)"


class Statistics(NamedTuple):
    """Bytes of the spectra in memory, with those in use, and how many were found there, read, and made."""

    memory: int
    found: int
    read: int
    made: int


class _Settings:
    """Settings of this process: those of the environment, then those of `configure`."""

    bound: int | None = None  # bytes in memory; None: not set yet
    folder: Path | None = None
    folder_size = 0
    shared = False  # the folder, with other users
    process = 0  # that opened the folder: a fork needs its own names


_settings = _Settings()


def configure(
    *,
    memory: int | float | str | None = None,
    folder: str | os.PathLike[str] | bool | None = None,
    folder_size: int | float | str | None = None,
    folder_shared: bool | None = None,
) -> None:
    """Set the cache of this process; settings that are not given do not change.

    Processes that it starts, such as those of a study, use the environment. A value that is no number of
    bytes is a `DeckError`; a folder that cannot be used is a `KernelFolderWarning`, and spectra stay in
    memory.

    Parameters
    ----------
    memory : number or str, optional
        Bytes of spectra in memory at most, such as ``"1 GB"``; 0: none. The least recently used are dropped.
    folder : path or False, optional
        Folder for spectra, which other processes may use; created if missing. False: none.
    folder_size : number or str, optional
        Bytes in the folder at most. If a process begins with more, the oldest are deleted.
    folder_shared : bool, optional
        Accept a folder, and files in it, that other users can write.

    Examples
    --------
    >>> from hexcontact import kernel_cache
    >>> kernel_cache.configure(memory="1 GB")
    >>> kernel_cache.statistics().memory <= 1e9
    True
    """
    bound = None if memory is None else _bytes(memory, "memory")
    size = None if folder_size is None else _bytes(folder_size, "folder_size")
    take_settings()
    if bound is not None:
        _settings.bound = bound
        flat.limit_kernels(bound)
    if size is not None:
        _settings.folder_size = size
    if folder is not None and not isinstance(folder, bool):
        _settings.folder = Path(folder).expanduser().absolute()
    elif folder is not None:
        _settings.folder = None
    if folder_shared is not None:
        _settings.shared = folder_shared
    if (folder, size, folder_shared) != (None, None, None):
        _open_folder()


def bound() -> int:
    """Return the largest number of bytes of spectra in memory."""
    take_settings()
    return _settings.bound or 0


def clear() -> None:
    """Drop the cached spectra in memory; those in use remain with their problems."""
    take_settings()
    flat.limit_kernels(0)
    flat.limit_kernels(_settings.bound)


def statistics() -> Statistics:
    """Return content and use of the cache of this process."""
    return Statistics(*flat.kernel_statistics())


def limit_growth(spare: int) -> None:
    """Limit the growth of the cache to `spare` bytes until the next call, or shrink it; its bound remains."""
    take_settings()
    flat.limit_kernels(max(0, min(_settings.bound or 0, flat.kernel_statistics()[0] + spare)))


def take_settings() -> None:
    """Read the settings from the environment, once; a forked process gets its own names."""
    if _settings.bound is None:
        given = {name: os.environ.get(name, "").strip() for name in (MEMORY, FOLDER, FOLDER_SIZE, SHARED)}
        memory, size = (_bytes(given[name] or _DEFAULTS[name], name) for name in (MEMORY, FOLDER_SIZE))
        _settings.bound, _settings.folder_size = memory, size
        if given[SHARED].lower() not in ("", "no", "yes"):
            raise DeckError(f"{SHARED} = {given[SHARED]!r}: expected yes or no")
        _settings.shared = given[SHARED].lower() == "yes"
        flat.limit_kernels(memory)
        if given[FOLDER]:
            _settings.folder = Path(given[FOLDER]).expanduser().absolute()
            _open_folder()
    elif _settings.folder is not None and _settings.process != os.getpid():
        _open_folder()


def warn_of_faults() -> None:
    """Warn of faults of the folder since the last call."""
    if _settings.folder is None:
        return
    for line in flat.kernel_message().splitlines():
        _warn(line)


def _warn(message: str) -> None:
    """Warn once on a machine, whose ranks have the same folder."""
    if ranks.rank and ranks.on_node == ranks.count:
        return
    _LOGGER.warning("kernels warning=%s", json.dumps(message, ensure_ascii=False))
    warn(message, KernelFolderWarning)


def _bytes(value: float | str, name: str) -> int:
    """Return a number of bytes."""
    match = re.fullmatch(r"\s*(\d++(?:\.\d*+)?(?:[eE]\d++)?)\s*+(\w*+)\s*", str(value))
    factor = _UNITS.get(match[2]) if match else None
    if match is None or factor is None or float(match[1]) * factor >= 2**62:
        raise DeckError(f"{name} = {value!r}: expected a number of bytes such as 512 MB")
    return int(float(match[1]) * factor)


# --- the folder ---------------------------------------------------------------------------------------------


def _open_folder() -> None:
    """Pass the folder to the core, with its free bytes."""
    _settings.process = os.getpid()
    folder, room = _settings.folder, 0
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o777 if _settings.shared else 0o755)
            state = folder.stat()
            fault = (
                _FOREIGN if state.st_uid not in (0, os.geteuid()) else _OPEN if state.st_mode & 0o022 else ""
            )
            if fault and not _settings.shared:
                raise PermissionError(errno.EPERM, fault, str(folder))
            room = max(0, _settings.folder_size - _pruned(folder, _settings.folder_size))
        except OSError as error:
            _settings.folder = folder = None
            _warn(f"no kernels are kept in {error.filename}: {error.strerror}")
    # for the core, blanks at the end are no part of a name
    name = b"" if folder is None else os.fsencode(folder) + b"/"
    flat.use_kernel_folder(name, _maker(), uuid.uuid4().hex[:12], room, _settings.shared)


def _pruned(folder: Path, bound: int) -> int:
    """Delete the oldest spectra of a folder down to three quarters of its bound; return the bytes."""
    files = []
    for path in filter(lambda path: re.fullmatch(_FILE, path.name), folder.iterdir()):
        with contextlib.suppress(OSError):  # another process has renamed or removed it
            state = path.stat()
            if path.suffix == ".part" and time.time() - state.st_mtime > _DAY:
                path.unlink()  # of a process that was killed
            else:
                files.append((state.st_mtime, state.st_size, path))
    total = sum(size for _, size, _ in files)
    if total > bound:
        for _, size, path in sorted(files):
            if total <= 0.75 * bound:
                break
            with contextlib.suppress(OSError):
                path.unlink()
                total -= size
    return total


def _maker() -> str:
    """Identify what decides the bits of a spectrum: program, processor, libraries for mathematics."""
    from .._version import __version__

    core = Path(flat.LIBRARY).stat()
    parts = [__version__, f"core {core.st_size} {core.st_mtime_ns}", platform.machine()]
    with contextlib.suppress(OSError):
        processor = re.findall(
            r"^(?:model name|flags|Features)\s*:.*$", Path("/proc/cpuinfo").read_text(), re.M
        )
        parts += sorted(set(processor))
        # of the system, by these names; those of packages have others
        mapped = re.findall(
            r"(?<!\S)/\S*/lib(?:m|fftw3f?|gfortran)\.so\S*", Path("/proc/self/maps").read_text()
        )
        parts += [f"{path} {Path(path).stat().st_size}" for path in sorted(set(mapped))]
    return f"hexcontact {__version__} {hashlib.sha256(os.fsencode('; '.join(parts))).hexdigest()}"
