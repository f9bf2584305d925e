"""Measures counts, times and memory, compares with other codes, and writes the tables of docs.

    python tests/bench/run.py                      all that depends on the machine (a quarter of an hour)
    python tests/bench/run.py --long               everything
    python tests/bench/run.py --quick              small windows only (minutes); pages stay
    python tests/bench/run.py --only counts,peers
    python tests/bench/run.py --only solves --sizes 256,512         these windows; pages stay
    python tests/bench/run.py --only wear,below --cpu-time          processor time, on a busy machine
    python tests/bench/run.py --write-bounds       bounds of tests/python/test_operator_counts.py

Load histories are compared with CONTACT if CONTACT_PROGRAM names its executable (some minutes more).

Each section replaces what stands between the comments <!-- begin SECTION --> and <!-- end SECTION -->, most
of them of docs/measurements.md: its tables, and below them when and with what they were measured. All else
stays.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from collections.abc import Callable
from datetime import date
from functools import partial
from pathlib import Path

if __name__ == "__main__":  # one thread, also for libraries that look only once
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

from bench import (
    accuracy,
    below,
    contact,
    counts,
    creep,
    driver,
    lapack,
    laws,
    layers,
    machine,
    memory,
    peers,
    profiling,
    report,
    rough,
    speed,
    stick_edge,
    wear,
    wear_limit,
)

ROOT = Path(__file__).parents[2]
BY_NAME = ("stick_edge", "wear_limit", "laws", "layers", "lapack_iterations")
"""By name or with --long only: counts and errors that no goal is about."""

Section = Callable[[], list[report.Table]]


def sections(options: argparse.Namespace) -> dict[str, Section]:
    """Return what measures each section, in the order of the pages."""
    program = options.build.absolute() / "tests" / "bench" / "bench_operator"
    quick, long, sizes = ({name: getattr(options, name)} for name in ("quick", "long", "sizes"))
    return {
        "counts": partial(counts.measure, **quick, **long, sizes=options.meshes),
        "operator": partial(speed.operator, program, **quick, **sizes),
        "solves": partial(speed.solves, program, **quick, **sizes),
        "histories": partial(speed.histories, **quick, **sizes),
        "setups": partial(speed.setups, **quick, **sizes),
        "memory": partial(memory.measure, **quick, **long, **sizes),
        "rough": partial(rough.measure, **quick, **long, **sizes),
        "small": partial(driver.small, **quick),
        "sessions": partial(driver.sessions, **quick),
        "command": partial(driver.command, **quick),
        "below": partial(below.measure, **quick),
        "wear": partial(wear.measure, **quick),
        "creep": partial(creep.measure, options.contact, **quick),
        "direct": partial(speed.direct, **quick),
        "accuracy": partial(accuracy.measure, **quick, **sizes),
        "stick_edge": partial(stick_edge.measure, **quick),
        "wear_limit": partial(wear_limit.measure, **quick, **long),
        "laws": partial(laws.measure, **quick),
        "layers": partial(layers.measure, **quick, **long),
        "peers": partial(peers.measure, options.peers, **quick, **sizes, names=options.codes),
        "rough_peers": partial(peers.measure_rough, options.peers, **quick, **sizes, names=options.codes),
        "contact": partial(contact.measure, options.contact, **quick, **sizes),
        "lapack_methods": partial(lapack.methods_table, **quick, **long),
        "lapack_steps": partial(lapack.steps_table, **quick),
        "lapack_threads": partial(lapack.threads_table, **quick),
        "lapack_iterations": partial(lapack.iterations_table, **quick),
        "profile": partial(profiling.measure, **quick),
    }


def main() -> int:
    """Run the sections that are asked for."""
    options = parse()
    if options.write_bounds:
        counts.write_bounds()
        return 0
    try:
        options.contact = contact.Program.given()
    except ValueError as reason:
        print(reason, file=sys.stderr)
        return 2
    measures = sections(options)
    unknown = set(options.only or ()) - set(measures)
    if unknown:
        print(f"--only {','.join(sorted(unknown))}: expected some of {', '.join(measures)}", file=sys.stderr)
        return 2

    # what was measured in a hurry does not get into the pages
    hurried = options.quick or options.sizes or options.meshes or options.codes
    today = date.today().isoformat()
    header = machine.describe("1, unless stated otherwise", today)
    stamp = f"{today}, {machine.hexcontact_version()}, {machine.processor()}"
    if options.cpu_time:
        os.environ["BENCH_CLOCK"] = "cpu"
        stamp += ", processor time"
    print(header.text(), "\n")
    if not (hurried or options.only):
        report.write("machine", [header], "")
    for section in options.only or [name for name in measures if options.long or name not in BY_NAME]:
        if section == "contact" and options.contact is None:
            print("contact: left out; set CONTACT_PROGRAM to the executable of CONTACT\n")
            continue
        start, before = time.perf_counter(), processor_time()
        print(f"{section} ...", flush=True)
        tables = measures[section]()
        print("", *(table.text() + "\n" for table in tables), sep="\n")
        spent = f"{time.perf_counter() - start:.0f} s, {processor_time() - before:.0f} s of the processor"
        print(f"({section}: {spent})", flush=True)
        if not hurried:
            page = report.write(section, tables, stamp)
            print(f"written: {page.relative_to(ROOT)}")
        print()
    return 0


def processor_time() -> float:
    """Return the processor time of this process and of those that it has run, seconds."""
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in spent)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", type=words, metavar="SECTIONS", help="names of sections, with commas")
    parser.add_argument("--sizes", type=numbers, help="nodes on a side of the windows that are timed")
    parser.add_argument("--meshes", type=numbers, help="spacings in the contact radius for the counts")
    parser.add_argument("--codes", type=words, help="other codes: " + ",".join(p.name for p in peers.PEERS))
    parser.add_argument("--quick", action="store_true", help="small windows only; pages stay")
    parser.add_argument(
        "--cpu-time",
        action="store_true",
        help="processor time instead of wall time, for a busy machine",
    )
    parser.add_argument(
        "--long",
        action="store_true",
        help="everything: also counts and errors of other pages, the finest meshes, larger windows",
    )
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
