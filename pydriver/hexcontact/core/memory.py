"""Memory that is available to this process."""

from __future__ import annotations

import contextlib
import ctypes
import mmap
import os
import threading
from collections.abc import Iterator
from pathlib import Path

from ..errors import ResourceError
from .cores import CGROUPS, PROCESS, cores, folders_of_groups, read

GB = 1e9
# Bytes of address space: of the netCDF library, and of its buffers for fifty variables; of the second thread
# of a run, for its stack and 64 MiB of malloc.
_LOADING, WRITING, _THREAD = 30_000_000, 64_000_000, 80_000_000
_NO_LIMIT = 1 << 60  # bytes; version 1 of control groups says 2^63 less a page


def available(cgroups: Path = CGROUPS, process: Path = PROCESS) -> int:
    """Return the memory (bytes) that the machine and the limits of this process leave."""
    return min([_left_on_machine(), *_left_in_limits(), *_left_in_groups(cgroups, process)])


def resident() -> int:
    """Return the resident memory (bytes) of this process, with the interpreter and all libraries."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return int(read("/proc/self/statm").split()[1]) * mmap.PAGESIZE
    return _taken("rss")


def _taken(name: str) -> int:
    """Return a number of bytes of this process by psutil, else its largest resident memory so far."""
    import resource

    import psutil

    with contextlib.suppress(psutil.Error, OSError):  # without /proc
        return int(getattr(psutil.Process().memory_info(), name, 0))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def threads() -> int:
    """Return the number of threads of the core on large windows."""
    wanted = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    return int(wanted) if wanted.isdecimal() and int(wanted) else cores()


def require(needed: int, what: str, advice: str, there: int | None = None) -> None:
    """Raise an error if memory is short."""
    from .kernel_cache import limit_growth

    there = available() if there is None else there
    limit_growth(there - needed)  # spectra of other cases give way to this one
    if needed > there:
        there = available()
    if needed > there:
        raise ResourceError(
            f"{what} needs {needed / GB:.3g} GB of memory and {there / GB:.3g} GB are available; {advice}"
        )


def give_back() -> None:
    """Return the free memory of the C library to the system."""
    with contextlib.suppress(AttributeError, OSError):  # glibc alone has this
        ctypes.CDLL(None).malloc_trim(0)


def claim(needed: int) -> None:
    """Raise OSError unless a number of bytes is available at once; some libraries crash without."""
    mmap.mmap(-1, needed, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS).close()


def _left_on_machine() -> int:
    """Return the memory (bytes) that the machine has left, by Linux itself or else by psutil."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return int(read("/proc/meminfo").partition(b"MemAvailable:")[2].split(None, 1)[0]) * 1024
    import psutil

    with contextlib.suppress(psutil.Error, OSError):
        return int(psutil.virtual_memory().available)
    return os.sysconf("SC_PHYS_PAGES") * mmap.PAGESIZE  # without /proc, which has the memory in use


def _left_in_limits() -> Iterator[int]:
    """Yield the free bytes within the limits of address space (``ulimit -v``) and data (``-d``)."""
    import resource

    allowed = {name: resource.getrlimit(getattr(resource, name))[0] for name in ("RLIMIT_AS", "RLIMIT_DATA")}
    if set(allowed.values()) == {resource.RLIM_INFINITY}:
        return
    try:
        claim(_LOADING + WRITING)
    except OSError:
        yield 0
        return
    import netCDF4  # noqa: F401  # which every run needs

    spare = WRITING + _THREAD * (threading.active_count() == 1)
    used = {"RLIMIT_AS": "vms", "RLIMIT_DATA": "data"}
    for name, limit in allowed.items():
        if limit != resource.RLIM_INFINITY:
            yield max(0, limit - _taken(used[name]) - spare)


def _left_in_groups(cgroups: Path, process: Path) -> Iterator[int]:
    """Yield the free bytes of each control group (version 1 or 2) that limits this process."""
    with contextlib.suppress(OSError):
        for controllers, folder in folders_of_groups(cgroups, read(process)):
            limit, usage, cache = "memory.limit_in_bytes", "memory.usage_in_bytes", b"total_inactive_file"
            if not controllers:
                limit, usage, cache = "memory.max", "memory.current", b"inactive_file"
            with contextlib.suppress(OSError, ValueError):  # without the controller; "max" is no limit
                allowed = int(read(folder / limit))
                if allowed <= _NO_LIMIT:
                    used, known = int(read(folder / usage)), read(folder / "memory.stat").split()
                    # the kernel frees the file cache on demand
                    freed = int(dict(zip(known[::2], known[1::2], strict=False)).get(cache, 0))
                    yield max(0, allowed - used + freed)
