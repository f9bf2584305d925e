"""What the times were measured on."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
from importlib import metadata
from pathlib import Path

from .report import Table


def describe(threads: str, date: str) -> Table:
    """Return machine, versions, threads and date."""
    table = Table("", ["", ""])
    table.rows = [
        ["processor", processor()],
        ["cores, memory", f"{os.cpu_count()}, {memory()}"],
        ["system", f"{platform.system()} {platform.machine()}"],
        ["hexcontact", hexcontact_version()],
        ["compiler", first_line(["gfortran", "--version"])],
        ["FFTW, BLAS", f"{pkg_config('fftw3')}, {blas()}"],
        ["Python, numpy", f"{platform.python_version()}, {metadata.version('numpy')}"],
        ["threads", threads],
        ["date", date],
    ]
    return table


def processor() -> str:
    """Return the model of the processor."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = re.findall(r"^model name\s*: (.+)$", cpuinfo.read_text(), re.MULTILINE)
        if models:
            return str(models[0])
    return platform.processor() or "unknown"


def memory() -> str:
    """Return the memory of the machine."""
    return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB"


def hexcontact_version() -> str:
    """Return the version, with the commit where there is one; pages that were written do not change it."""
    import hexcontact

    git = ["git", "-C", str(Path(__file__).parents[2])]
    commit = first_line([*git, "describe", "--always"])
    changed = first_line([*git, "status", "--porcelain", "--", "fortran", "pydriver", "tests/bench"])
    with_changes = "" if changed == "unknown" else " with changes"
    return hexcontact.__version__ + (f" ({commit}{with_changes})" if commit != "unknown" else "")


def blas() -> str:
    """Return the BLAS that meson takes."""
    version = pkg_config("openblas")
    return f"OpenBLAS {version}" if version != "unknown" else "LAPACK and BLAS of the system"


def pkg_config(package: str) -> str:
    """Return the version of a library."""
    return first_line(["pkg-config", "--modversion", package])


def first_line(command: list[str]) -> str:
    """Return the first line that a command prints."""
    if not shutil.which(command[0]):
        return "unknown"
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.splitlines()[0].strip() if done.returncode == 0 and done.stdout else "unknown"
