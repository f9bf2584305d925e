"""Measures counts, times and memory, compares with other codes, and writes docs/performance.md.

    python tests/bench/run.py                      everything (a quarter of an hour)
    python tests/bench/run.py --quick              small windows only (two minutes)
    python tests/bench/run.py --only counts,peers --sizes 256,512
    python tests/bench/run.py --only peers --cpu-time     on a machine that has other things to do
    python tests/bench/run.py --write-bounds       bounds of tests/python/test_operator_counts.py

Sections that are not measured keep what the last run found.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from datetime import date
from functools import partial
from pathlib import Path

# one thread, also for libraries that look only once
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

from bench import accuracy, counts, machine, peers, profiling, report, speed

ROOT = Path(__file__).parents[2]
STORE = ROOT / "build" / "bench" / "results.json"
QUICK_STORE = ROOT / "build" / "bench" / "quick.json"


def main() -> int:
    """Run the sections that are asked for."""
    options = parse()
    if options.write_bounds:
        counts.write_bounds()
        return 0
    quick = options.quick
    program = options.build.absolute() / "tests" / "bench" / "bench_operator"
    sizes = options.sizes
    measures: dict[str, Callable[[], list[report.Table]]] = {
        "counts": partial(counts.measure, quick=quick, long=options.long, sizes=options.meshes),
        "operator": partial(speed.operator, program, quick=quick, sizes=sizes),
        "solves": partial(speed.solves, program, quick=quick, sizes=sizes),
        "setups": partial(speed.setups, quick=quick, sizes=sizes),
        "accuracy": partial(accuracy.measure, quick=quick, sizes=sizes),
        "peers": partial(peers.measure, options.peers, quick=quick, sizes=sizes, names=options.codes),
        "command": partial(speed.command, quick=quick),
        "direct": partial(speed.direct, quick=quick),
        "profile": partial(profiling.measure, quick=quick),
    }
    unknown = set(options.only or ()) - set(measures)
    if unknown:
        print(f"--only {','.join(sorted(unknown))}: expected some of {', '.join(measures)}", file=sys.stderr)
        return 2

    # what was measured in a hurry does not get into the page
    partial_run = quick or sizes or options.meshes or options.codes or options.cpu_time
    if options.cpu_time:
        os.environ["BENCH_CLOCK"] = "cpu"
    store = QUICK_STORE if partial_run else STORE
    today = date.today().isoformat()
    threads = "1, unless stated otherwise" + (", processor time" if options.cpu_time else "")
    header = machine.describe(threads, today)
    print(header.text(), "\n")
    report.keep(store, "machine", [header], today)
    for section in options.only or measures:
        start = time.perf_counter()
        print(f"{section} ...", flush=True)
        tables = measures[section]()
        report.keep(store, section, tables, today)
        print("", *(table.text() + "\n" for table in tables), sep="\n")
        print(f"({section}: {time.perf_counter() - start:.0f} s)\n", flush=True)
    page = store.with_suffix(".md") if partial_run else report.PAGE
    missing = report.write_page(store, page)
    print(f"written: {page.relative_to(ROOT)}")
    if missing:
        print(f"not measured yet: {', '.join(missing)}")
    return 0


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only",
        type=words,
        help="sections: counts,operator,solves,setups,accuracy,peers,command,direct,profile",
    )
    parser.add_argument("--sizes", type=numbers, help="nodes on a side of the windows that are timed")
    parser.add_argument("--meshes", type=numbers, help="spacings in the contact radius for the counts")
    parser.add_argument("--codes", type=words, help="other codes: " + ",".join(p.name for p in peers.PEERS))
    parser.add_argument("--quick", action="store_true", help="small windows only; docs/performance.md stays")
    parser.add_argument(
        "--cpu-time",
        action="store_true",
        help="processor time instead of wall time, for a busy machine; docs/performance.md stays",
    )
    parser.add_argument("--long", action="store_true", help="load paths on the finest mesh, too")
    parser.add_argument(
        "--write-bounds", action="store_true", help="measure the bounds of the test of the counts"
    )
    parser.add_argument(
        "--build", type=Path, default=ROOT / "build/release", help="build folder with the Fortran benchmark"
    )
    parser.add_argument(
        "--peers", type=Path, default=ROOT / "build/peers", help="folder for the environments of other codes"
    )
    return parser.parse_args()


def words(text: str) -> list[str]:
    """Split a list at its commas."""
    return text.split(",")


def numbers(text: str) -> list[int]:
    """Split a list of numbers at its commas."""
    return [int(word) for word in text.split(",")]


if __name__ == "__main__":
    sys.exit(main())
