"""How much memory this process may still take."""

from __future__ import annotations

import contextlib
import ctypes
import mmap
import os
import threading
from collections.abc import Iterator
from pathlib import Path

from ..errors import ResourceError

GB = 1e9
# Bytes of address space: of the netCDF library when it is loaded, and for what it holds of fifty variables
# while it writes them; of the second thread of a run, for its stack and 64 MiB of malloc.
_LOADING, WRITING, _THREAD = 30_000_000, 64_000_000, 80_000_000


def available(cgroups: Path = Path("/sys/fs/cgroup"), process: Path = Path("/proc/self/cgroup")) -> int:
    """Return the memory in bytes that can be taken before the machine, or a limit on this process, says no.

    Parameters
    ----------
    cgroups : Path
        Where the control groups are mounted (batch systems and containers limit memory by them).
    process : Path
        File that says which groups this process belongs to.
    """
    import psutil

    machine = int(psutil.virtual_memory().available)
    return min([machine, *_left_in_limits(), *_left_in_groups(cgroups, process)])


def resident() -> int:
    """Return the memory in bytes that this process takes now, with the interpreter and all libraries."""
    import psutil

    return int(psutil.Process().memory_info().rss)


def threads() -> int:
    """Return how many threads the core uses on large windows."""
    wanted = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    if wanted.isdecimal() and int(wanted):
        return int(wanted)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def require(needed: int, what: str, advice: str) -> None:
    """Refuse what does not fit into memory.

    Parameters
    ----------
    needed : int
        Memory in bytes.
    what : str
        What needs it, with its size: ``"a window of 2048 x 2048 nodes"``.
    advice : str
        What the user can do about it.

    Raises
    ------
    ResourceError
        If less than that is available.
    """
    from . import kernel_cache

    there = available()
    kernel_cache.limit_growth(
        there - needed
    )  # what is kept for other cases must not be in the way of this one
    if needed > there:
        there = available()
    if needed > there:
        raise ResourceError(
            f"{what} needs {needed / GB:.3g} GB of memory and {there / GB:.3g} GB are available; {advice}"
        )


def give_back() -> None:
    """Let the system have the memory that solving has freed; the C library may keep most of it otherwise."""
    with contextlib.suppress(AttributeError, OSError):  # glibc alone has this
        ctypes.CDLL(None).malloc_trim(0)


def claim(needed: int) -> None:
    """Raise OSError unless so many bytes can be had at once; libraries that find no memory would crash."""
    mmap.mmap(-1, needed, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS).close()


def _left_in_limits() -> Iterator[int]:
    """Yield what limits leave of the address space of this process (``ulimit -v``) and its data (``-d``)."""
    import resource

    allowed = {name: resource.getrlimit(getattr(resource, name))[0] for name in ("RLIMIT_AS", "RLIMIT_DATA")}
    if set(allowed.values()) == {resource.RLIM_INFINITY}:
        return
    import psutil

    try:
        claim(_LOADING + WRITING)
    except OSError:
        yield 0
        return
    import netCDF4  # noqa: F401  # which a run needs in the end

    spare = WRITING + _THREAD * (threading.active_count() == 1)
    taken = psutil.Process().memory_info()
    used = {"RLIMIT_AS": taken.vms, "RLIMIT_DATA": getattr(taken, "data", 0)}
    for name, limit in allowed.items():
        if limit != resource.RLIM_INFINITY:
            yield max(0, limit - used[name] - spare)


def _left_in_groups(cgroups: Path, process: Path) -> Iterator[int]:
    """Yield what each control group (version 1 or 2) that limits this process leaves."""
    try:
        lines = process.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if controllers == "":
            root, limit, usage, cache = cgroups, "memory.max", "memory.current", "inactive_file"
        elif "memory" in controllers.split(","):
            root, limit, usage = cgroups / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"
            cache = "total_inactive_file"
        else:
            continue
        # A container may see its own group as the root: groups that are not there are passed over.
        own = root / group.lstrip("/")
        for folder in (own, *own.parents):
            if (left := _left_in_group(folder, limit, usage, cache)) is not None:
                yield left
            if folder == root:
                break


def _left_in_group(folder: Path, limit: str, usage: str, cache: str) -> int | None:
    """Return limit less usage; the file cache that the kernel would give back does not count as used."""
    try:
        allowed = int((folder / limit).read_text())  # "max" is no limit
        used = int((folder / usage).read_text())
        statistics = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return max(0, allowed - used + int(statistics.get(cache, 0)))
    except (OSError, ValueError):
        return None
