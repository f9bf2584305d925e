"""Seconds over the bare transforms, threads, set-ups, load histories, the direct method."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from . import lapack, problems, worker
from .report import Table, seconds

SIZES = (256, 512, 1024, 2048)
LARGEST_WITH_FRICTION = 1024
PROBLEMS = {"HERTZ": "Hertz", "HC": "HC (press, shear)", "N19": "N19"}
TURNS = 3
LONG_ENOUGH = 8.0
"""Seconds of solves after which one is not run again."""


def bare_transforms(program: Path, side: int) -> dict[str, float]:
    """Return milliseconds of a product and of its transforms alone, each for one and for three components."""
    done = subprocess.run(
        [str(program), str(side)],
        capture_output=True,
        text=True,
        check=True,
        env=worker.environment(1),
    )
    names = ("scalar", "scalar_bare", "scalar_blocked", "full", "full_bare", "full_blocked")
    return dict(zip(names, (1e3 * float(word) for word in done.stdout.split()[1:]), strict=True))


def operator(program: Path, *, quick: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return the table of one application of the operator over its bare transforms."""
    table = Table(
        "One application of the operator, one thread: milliseconds, and over the transforms alone",
        ["window", "scalar product", "÷ bare", "÷ blocked", "3×3 product", "÷ bare", "÷ blocked"],
    )
    if not program.exists():
        table.remarks.append(f"Not measured: {program} has not been built.")
        return [table]
    for side in sizes or (SIZES[:2] if quick else SIZES):
        t = bare_transforms(program, side)
        table.add(
            f"{side}²",
            *(
                f"{x:.2f}"
                for x in (t["scalar"], t["scalar"] / t["scalar_bare"], t["scalar"] / t["scalar_blocked"])
            ),
            *(f"{x:.2f}" for x in (t["full"], t["full"] / t["full_bare"], t["full"] / t["full_blocked"])),
        )
        print(f"  {table.rows[-1]}", flush=True)
    table.remarks.append(
        "Bare: the pruned transforms as FFTW plans them for the whole array; blocked: in blocks of columns "
        "that fit the cache. Both are without copies, padding and multiplications."
    )
    return [table]


def task_of(name: str, side: int, threads: int, repeats: int) -> dict[str, Any]:
    """Return what the worker is told."""
    task: dict[str, Any] = {"side": side, "threads": threads, "repeats": repeats}
    return task | ({"problem": "normal"} if name == "HERTZ" else {"problem": "friction", "name": name})


def solves(program: Path, *, quick: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return seconds over the bare transforms, and the gain by two threads."""
    ratio = Table(
        "A solve over (operator applications × transforms of one), one thread, in the same run",
        [
            "problem and window",
            "set-up [s]",
            "solve [s]",
            "applications",
            "bare [ms]",
            "ratio",
            "goal",
            "blocked [ms]",
            "ratio to blocked",
            "goal",
        ],
    )
    threads = Table(
        "Two threads on two cores",
        [
            "problem and window",
            "1 thread [s]",
            "2 threads [s]",
            "times faster",
            "goal",
            "two processes side by side",
            "set-up times faster",
        ],
        remarks=[
            "Two processes side by side, one thread each: their speed together over that of one alone, "
            "the upper bound for two threads on this machine at that time."
        ],
    )
    # processor time says nothing about threads
    parallel = os.environ.get("BENCH_CLOCK") != "cpu"
    for side in sizes or (SIZES[:2] if quick else SIZES):
        bare = [bare_transforms(program, side)] if program.exists() else []
        chosen = {k: v for k, v in PROBLEMS.items() if k == "HERTZ" or side <= LARGEST_WITH_FRICTION}
        for name, title in chosen.items():
            single, double, pair = timed(name, side, turns=1 if quick else TURNS, both=parallel)
            label = f"{title}, {side}²"
            if "failed" in single or "failed" in double:
                ratio.add(label, single.get("failed") or double["failed"])
                continue
            if program.exists():
                bare.append(bare_transforms(program, side))
            add_ratio(ratio, label, single, bare, scalar=name == "HERTZ")
            if parallel:
                threads.add(
                    label,
                    seconds(single["solve"]),
                    seconds(double["solve"]),
                    f"{single['solve'] / double['solve']:.2f}",
                    "≥ 1.7" if side >= 512 else "",
                    f"{2.0 * single['solve'] / pair:.2f}",
                    f"{single['setup'] / double['setup']:.2f}",
                )
            print(f"  {ratio.rows[-1]} {threads.rows[-1][2:4] if parallel else ''}", flush=True)
    return [ratio, threads] if parallel else [ratio]


def setups(*, quick: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return the times of a set-up: from nothing, with plans, with spectra from memory and from a folder."""
    table = Table(
        "Set-up, one thread: milliseconds",
        [
            "problem and window",
            "first in a process",
            "again, spectra made anew",
            "again, spectra in memory",
            "first, spectra written",
            "first, spectra from a folder",
            "MB of spectra",
        ],
    )
    for side in sizes or (SIZES[:2] if quick else SIZES):
        for name in ("HERTZ", "N19") if side <= LARGEST_WITH_FRICTION else ("HERTZ",):
            with tempfile.TemporaryDirectory() as folder:
                task = {"problem": "setups", "name": name, "side": side, "repeats": 3}
                ways = (
                    {"memory": "0", "folder": ""},
                    {"memory": "4 GB", "folder": ""},
                    {"memory": "4 GB", "folder": folder},  # written in the first turn, read in the others
                )
                turns = [[worker.run(task | way) for way in ways] for _ in range(2 if quick else 4)]
                size = sum(path.stat().st_size for path in Path(folder).iterdir())
            failed = next((answer["failed"] for turn in turns for answer in turn if "failed" in answer), None)
            label = f"{PROBLEMS[name]}, {side}²" if name == "HERTZ" else f"with friction, {side}²"
            if failed:
                table.add(label, failed)
                continue
            made, kept = (worker.best([turn[k] for turn in turns], "first", "again") for k in (0, 1))
            times = (
                min(made["first"], kept["first"]),
                made["again"],
                kept["again"],
                turns[0][2]["first"],
                min(turn[2]["first"] for turn in turns[1:]),
            )
            table.add(label, *(f"{1e3 * t:.1f}" for t in times), f"{size / 1e6:.1f}")
            print(f"  {table.rows[-1]}", flush=True)
    table.remarks.append(
        "The folder is on a local disk, and its files are in the memory of the operating system. "
        "The first set-up in a process contains the planning of FFTW. "
        "With friction: N19, beta and gamma of unlike materials."
    )
    return [table]


HISTORIES = {"HC": (64, 128, 256), "CM875": (128, 256), "LOOP": (128,), "PRESS10": (128, 256), "HIST": (64,)}
"""Windows of the load histories."""


def histories(*, quick: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return times of load histories at a tight tolerance and at a loose one, in turns."""
    table = Table(
        "Load histories with friction, one thread: all load steps, half of the window in contact",
        [
            *("history", "window", "set-up [s]", "applications", "solve [s]"),
            *("applications at 10⁻⁵", "solve [s]", "time 10⁻⁵ ÷ 10⁻⁸", "goal"),
        ],
    )
    for name, windows in HISTORIES.items():
        for side in [n for n in sizes or windows if n in windows][: 1 if quick else None]:
            task = task_of(name, side, 1, 3 if side < 256 else 1)
            turns = [
                [worker.run(task | {"loose": loose}) for loose in (False, True)]
                for _ in range(1 if quick else 3)
            ]
            tight, loose = (worker.best(list(runs), "setup", "solve") for runs in zip(*turns, strict=True))
            failed = tight.get("failed") or loose.get("failed")
            if failed:
                table.add(problems.LOADED[name].title, f"{side}²", failed)
                continue
            table.add(
                *(problems.LOADED[name].title.removesuffix(", mean"), f"{side}²", seconds(tight["setup"])),
                *(
                    cell
                    for found in (tight, loose)
                    for cell in (f"{found['applications']:.0f}", seconds(found["solve"]))
                ),
                *(f"{loose['solve'] / tight['solve']:.2f}", "≤ 0.5"),
            )
            print(f"  {table.rows[-1]}", flush=True)
    return [table]


def timed(name: str, side: int, *, turns: int, both: bool) -> tuple[dict[str, Any], dict[str, Any], float]:
    """Return the best of several runs on one thread, on two, and of two processes at a time, in turns."""
    repeats = 3 if side <= 512 else 1
    one: list[dict[str, Any]] = []
    two: list[dict[str, Any]] = []
    pairs: list[float] = []
    for turn in range(turns):
        if turn and turn * one[0].get("solve", 0.0) > LONG_ENOUGH:
            break
        one.append(worker.run(task_of(name, side, 1, repeats)))
        if both:
            # 0: as many as the environment says, but one for small lattices, which is what users get
            two.append(worker.run(task_of(name, side, 0, repeats), threads=2))
            pairs.append(side_by_side(task_of(name, side, 1, repeats)))
    pair = min(pairs, default=float("nan"))
    return worker.best(one, "setup", "solve"), worker.best(two or one, "setup", "solve"), pair


def side_by_side(task: dict[str, Any]) -> float:
    """Return the mean time of two processes that solve the same at the same time."""
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(worker.run, [task, task]))
    return sum(float(answer.get("solve", "nan")) for answer in answers) / len(answers)


def add_ratio(
    table: Table, label: str, answer: dict[str, Any], bare: list[dict[str, float]], *, scalar: bool
) -> None:
    """Add a solve and its ratio to the transforms alone."""
    times = [seconds(answer["setup"]), seconds(answer["solve"]), f"{answer['applications']:.1f}"]
    if not bare:
        table.add(label, *times, "not built")
        return
    # of one application of the full operator: transforms planned for the whole array, and in blocks
    kind, times_three = ("scalar", 3) if scalar else ("full", 1)
    shown: list[str] = []
    for way in ("bare", "blocked"):
        milliseconds = times_three * min(t[f"{kind}_{way}"] for t in bare)
        ratio = answer["solve"] / (answer["applications"] * milliseconds * 1e-3)
        shown += [f"{milliseconds:.2f}", f"{ratio:.2f}"]
    table.add(label, *times, *shown[:2], "≤ 1.3", *shown[2:], "≤ 3")


def direct(*, quick: bool) -> list[Table]:
    """Return the times of the direct method on the finest mesh of Table 9.2."""
    table = Table(
        "Direct method, 51 × 51 nodes, 18.7 spacings in the contact radius (Table 9.2), one thread",
        ["problem", "seconds", "goal", "18 minutes of the dissertation, times faster"],
    )
    # a = 0.7475813 mm, spacing 0.04 mm
    task = {"problem": "direct", "side": 51, "spacings_in_radius": 0.7475813 / 0.04}
    answers = [worker.run(task | {"repeats": 2}) for _ in range(1 if quick else 2)]
    answer = worker.best(answers, "frictionless", "N19", "HC")
    if "failed" in answer:
        table.add("all", answer["failed"])
        return [table]
    for name, title, goal in (
        ("frictionless", "frictionless", "< 2"),
        ("N19", "N19: β = −0.19, µ = 0.1, normal load at once", "< 20, better 5"),
        ("HC", "HC: alike bodies, µ = 0.5, normal load, then Q = µP/2", "< 20, better 5"),
    ):
        table.add(title, f"{answer[name]:.2f}", goal, f"{18 * 60 / answer[name]:.0f}")
        print(f"  {table.rows[-1]}", flush=True)
    name = "pressed in 1, sheared in 9"
    task = {
        "problem": "history",
        "side": 51,
        "spacings": 18.7,
        "material": "unlike",
        "steps": lapack.HISTORIES[name],
    }
    time = lapack.measured(task | {"method": "direct", "repeats": 1 if quick else 3})["seconds"]
    table.add(f"β = −0.19, µ = 0.1, {name}: ten load steps", f"{time:.2f}", "≤ 1", "")
    return [table]
