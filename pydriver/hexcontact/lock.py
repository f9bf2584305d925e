"""Keeps two runs from writing one file."""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import socket
import time
from pathlib import Path
from typing import Any

from .errors import DeckError

_CLOCKS = 2.0  # s, between which the clocks of the system and of its processes may differ


class Lock:
    """Keeps two runs from writing one output.

    The lock is held through the operating system, which lets go of it when the process dies.
    File systems differ in whether another machine notices, so the file names process and host:
    a lock left by another host counts as held.

    Parameters
    ----------
    path : Path
        Lock file.
    output : Path
        What is being protected, for the message.

    Raises
    ------
    DeckError
        If another run holds it.
    """

    def __init__(self, path: Path, output: Path) -> None:
        self.path = path
        while True:
            self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                held = False
            except BlockingIOError:
                held = True
            except OSError:  # a file system without locks: only the process number is left to go by
                held = _is_running(self._holder())
            if held or _same_file(path, self._descriptor):
                break
            os.close(self._descriptor)  # the one who held it deleted the file in between
        holder = self._holder()
        if held or holder.get("host", socket.gethostname()) != socket.gethostname():
            os.close(self._descriptor)
            since = f" since {holder['since']}" if "since" in holder else ""
            advice = f"if that run is over, delete {path}"
            if holder.get("process") == os.getpid() and held:
                advice = "it belongs to this program, which may close the session or wait for the run"
            raise DeckError(
                f"{output} is being written by another run, process {holder.get('process', '?')} "
                f"on {holder.get('host', '?')}{since}; {advice}"
            )
        text = {
            "process": os.getpid(),
            "host": socket.gethostname(),
            "since": time.strftime("%F %T"),
            "time": time.time(),
        }
        try:
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, json.dumps(text).encode(), 0)
        except BaseException:  # a full disk
            self.release()
            raise

    def _holder(self) -> dict[str, Any]:
        with contextlib.suppress(ValueError):
            holder = json.loads(os.pread(self._descriptor, 1000, 0))
            if isinstance(holder, dict):
                return holder
        return {}

    def release(self) -> None:
        """Let go of the lock."""
        self.path.unlink(missing_ok=True)
        os.close(self._descriptor)


def _is_running(holder: dict[str, Any]) -> bool:
    """Tell whether a process of this machine holds the lock, not one that got its number since."""
    import psutil

    if holder.get("host") != socket.gethostname():
        return False
    try:
        began = psutil.Process(int(holder.get("process", -1))).create_time()
    except (psutil.NoSuchProcess, ValueError):
        return False
    except psutil.Error:
        return True
    return bool(began < float(holder.get("time", math.inf)) + _CLOCKS)


def _same_file(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.stat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False
