"""Measure the processor time of the Python tests; list in tests/check.txt what `make check` leaves out.

    python tests/quick.py                          all tests (a quarter of an hour)
    python tests/quick.py tests/python/test_x.py   those of a file; times of the others are kept
    python tests/quick.py --write                  write the list; a file whose times are unknown is slow

A test is slow if it takes more than `SECONDS`, with all its parameters `TOGETHER`. Times are those of a
process and of what it starts, so that other programs hardly matter; they are kept in build/times.json.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections import Counter
from collections.abc import Generator
from pathlib import Path

import pytest

SECONDS, TOGETHER = 0.2, 0.4
ROOT = Path(__file__).parents[1]
TIMES, LIST = ROOT / "build/times.json", ROOT / "tests/check.txt"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Note the time of a test, its fixtures included."""
    before = spent()
    try:
        return (yield)
    finally:
        with open(os.environ["TIMES"], "a") as file:
            file.write(json.dumps([item.nodeid, spent() - before]) + "\n")


def spent() -> float:
    """Return the processor time of this process and of those that it has waited for."""
    uses = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(use.ru_utime + use.ru_stime for use in uses)


def measure(words: list[str]) -> dict[str, float]:
    """Run tests in one process; return the times of all that are known."""
    known = json.loads(TIMES.read_text()) if TIMES.exists() else {}
    lines = TIMES.with_suffix(".lines")
    TIMES.parent.mkdir(exist_ok=True)
    lines.write_text("")
    environment = os.environ | {
        "TIMES": str(lines),
        "PYTHONPATH": str(ROOT / "tests"),
        "OPENBLAS_NUM_THREADS": "1",
    }
    subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "quick", "-q", *words], cwd=ROOT, env=environment, check=False
    )
    known |= dict(map(json.loads, lines.read_text().splitlines()))
    TIMES.write_text(json.dumps(known, indent=0))
    return known


def slow(times: dict[str, float]) -> list[str]:
    """Return the tests that are slow, their parameters left out."""
    together: Counter[str] = Counter()
    longest: Counter[str] = Counter()
    for name, seconds in times.items():
        test = name.partition("[")[0]
        together[test] += seconds
        longest[test] = max(longest[test], seconds)
    return sorted(test for test in together if together[test] > TOGETHER or longest[test] > SECONDS)


def main() -> None:
    """Run what the command line asks for."""
    words = sys.argv[1:]
    times = json.loads(TIMES.read_text()) if words == ["--write"] else measure(words)
    left_out = slow(times)
    quick = sum(seconds for name, seconds in times.items() if name.partition("[")[0] not in left_out)
    print(f"{len(times)} tests: {sum(times.values()):.0f} s; without {len(left_out)} slow ones {quick:.0f} s")
    if words == ["--write"]:
        files = {path.relative_to(ROOT).as_posix() for path in (ROOT / "tests/python").glob("test_*.py")}
        unknown = sorted(files - {name.partition("::")[0] for name in times})
        lines = ["tests/python", *(f"--deselect={test}" for test in sorted([*unknown, *left_out]))]
        LIST.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
