"""Where the time of a typical run goes, by sampling with Linux's perf."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from . import worker
from .report import Table

SHORTEST = 0.01
"""Share below which routines are added up."""

TASKS = (
    ("N19, 512²", {"problem": "friction", "name": "N19", "side": 512, "threads": 1, "repeats": 3}),
    ("Hertz, 1024²", {"problem": "normal", "side": 1024, "threads": 1, "repeats": 3}),
)


def measure(*, quick: bool) -> list[Table]:
    """Return a table by routine for each of the typical runs."""
    return [profile(title, task) for title, task in TASKS[: 1 if quick else 2]]


def profile(title: str, task: dict[str, object]) -> Table:
    """Return where the time of a run goes."""
    table = Table(f"Profile of {title}: one thread, three solves and one set-up", ["where", "share of time"])
    if not shutil.which("perf"):
        table.remarks.append("Not measured: perf is not installed.")
        return table
    with tempfile.TemporaryDirectory() as folder:
        data = str(Path(folder) / "perf.data")
        record = ["perf", "record", "-q", "-e", "cpu-clock", "-F", "997", "-o", data]
        record += ["--", sys.executable, str(worker.OURS), json.dumps(task)]
        done = subprocess.run(record, capture_output=True, text=True, check=False, env=worker.environment(1))
        if done.returncode:
            table.remarks.append(f"Not measured: {(done.stderr.strip().splitlines() or ['perf fails'])[-1]}")
            return table
        report = [
            "perf",
            "report",
            "-i",
            data,
            "--stdio",
            "--no-children",
            "-t",
            ";",
            "-F",
            "sample,dso,sym",
        ]
        lines = subprocess.run(report, capture_output=True, text=True, check=False).stdout.splitlines()
    samples: dict[str, int] = defaultdict(int)
    for line in lines:
        words = [word.strip() for word in line.split(";")]
        if len(words) >= 3 and words[0].isdigit():
            samples[place(words[1], words[2])] += int(words[0])
    shares = {name: number / sum(samples.values()) for name, number in samples.items()}
    small = sum(share for share in shares.values() if share < SHORTEST)
    for name, share in sorted(shares.items(), key=lambda item: -item[1]):
        if share >= SHORTEST:
            table.add(name, f"{share:.1%}")
    table.add(f"all others, each below {SHORTEST:.0%}", f"{small:.1%}")
    transforms = shares.get("FFTW", 0.0)
    if transforms:
        gain = 1 / transforms
        table.remarks.append(
            f"If all but the transforms cost nothing, this would be {gain:.1f} times faster."
        )
    print(f"  {title}: {transforms:.0%} of the samples in FFTW", flush=True)
    return table


def place(library: str, symbol: str) -> str:
    """Return what a sample is called in the table."""
    if library.startswith("libfftw3"):
        return "FFTW"
    if "kernel" in library:
        return "operating system (pages of memory, mostly)"
    if "openblas" in library.lower() or "lapack" in library:
        return "BLAS and LAPACK"
    name = re.sub(r"^\[.\]\s*", "", symbol).split()[0]
    found = re.match(r"__hc_(\w+?)_MOD_(\w+)", name)
    if found:
        return f"{found[1]}: {found[2]}"
    if re.search(r"mem(move|cpy|set)", name):
        return "copying and filling memory (libc)"
    if library.startswith(("libpython", "python", "_multiarray", "ld-linux")):
        return "Python and numpy"
    return library
