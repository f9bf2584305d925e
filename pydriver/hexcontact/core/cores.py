"""Cores and control groups of this process."""

from __future__ import annotations

import contextlib
import functools
import os
from pathlib import Path

CGROUPS, PROCESS = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def cores(cgroups: Path = CGROUPS, process: Path = PROCESS) -> int:
    """Return the number of cores that this process is bound to, within the quotas of its control groups."""
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(bound, _quota(cgroups, process))


def limit_threads() -> None:
    """Make OpenMP and BLAS, which know no quotas, start no more threads than a quota allows."""
    if _quota(CGROUPS, PROCESS) < (os.cpu_count() or 1):
        os.environ.setdefault("OMP_NUM_THREADS", str(cores()))


@functools.cache
def _quota(cgroups: Path, process: Path) -> int:
    """Return the processor time that the control groups of a process allow, in whole cores, at least one."""
    least = float(1 << 20)
    with contextlib.suppress(OSError):
        for controllers, folder in folders_of_groups(cgroups, read(process)):
            names = ["cpu.cfs_quota_us", "cpu.cfs_period_us"] if controllers else ["cpu.max"]
            with contextlib.suppress(OSError, ValueError):  # without the controller; "max" is no quota
                quota, period = (int(number) for name in names for number in read(folder / name).split())
                if quota > 0 < period:
                    least = min(least, quota / period)
    return max(1, int(least))


@functools.cache
def folders_of_groups(cgroups: Path, groups: bytes) -> list[tuple[list[str], Path]]:
    """Return the folders of the control groups of a process, with their controllers (version 2: none)."""
    found = []
    for line in os.fsdecode(groups).splitlines():
        _, names, group = line.split(":", 2)
        controllers = names.split(",") if names else []
        root = next((cgroups / name for name in ("memory", "cpu") if name in controllers), cgroups)
        if controllers and root == cgroups:
            continue
        # in a container, the own group may be the root and others missing
        own = root / group.lstrip("/")
        for folder in (own, *own.parents):
            found.append((controllers, folder))
            if folder == root:
                break
    return found


def read(path: str | Path) -> bytes:
    """Read a file of the kernel, without buffers and text, which take longer than the file."""
    with open(path, "rb", buffering=0) as file:
        return file.read()
