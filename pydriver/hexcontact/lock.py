"""Locks, which keep two runs from writing one file."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import math
import os
import stat
import time
from pathlib import Path
from typing import Any

from .errors import DeckError
from .files import is_process

_CLOCKS = 2.0  # s, between which the clocks of the system and of its processes may differ
_LEAST, _LONGEST = 500, 1000  # bytes of a lock, which ends with blanks
_TRIES = 1000  # to open a lock that its holder deletes at the same time


class Lock:
    """Keeps two runs from writing one output; DeckError if another run holds it, or the file is no lock.

    The operating system holds the lock, and releases it when the process dies.
    File systems differ in whether another machine notices, so the file names process and host:
    a lock left by another host counts as held. `output` is named in messages; `began` is when the run began
    that a resumed one continues (s since 1970), see `begun`.
    """

    def __init__(self, path: Path, output: Path, began: float | None = None) -> None:
        self.path = path
        for _ in range(_TRIES):
            self._descriptor = _opened(path)
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
        if held or holder.get("host", os.uname().nodename) != os.uname().nodename:
            os.close(self._descriptor)
            since = f" since {holder['since']}" if "since" in holder else ""
            advice = f"if that run is over, delete {path}"
            if holder.get("process") == os.getpid() and held:
                advice = "it belongs to this program, which may close the session or wait for the run"
            raise DeckError(
                f"{output} is being written by another run, process {holder.get('process', '?')} "
                f"on {holder.get('host', '?')}{since}; {advice}"
            )
        text: dict[str, Any] = {
            "process": os.getpid(),
            "host": os.uname().nodename,
            "since": time.strftime("%F %T"),
            "time": time.time(),
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
    with contextlib.suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)  # a pipe would block
        try:
            regular = stat.S_ISREG(os.fstat(descriptor).st_mode)
            return regular and holder_of(os.pread(descriptor, _LONGEST + 1, 0)) is not None
        finally:
            os.close(descriptor)
    return False


def _opened(path: Path) -> int:
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
