"""What Python adds: processes of the command, load steps of small contacts, sessions of many load steps."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from bench import memory, problems, worker
from bench.report import Table
from bench.square_window import best_of, clock, peak_memory
from bench.square_window import main as answer

ROOT = Path(__file__).parents[2]
IMPORTS = "import numpy, pydantic, typer, netCDF4"
SIDE, STEPS = 31, 20
MU = 0.5


def command(*, quick: bool) -> list[Table]:
    """Return the times of processes: the command, and bare imports beside it."""
    table = Table(
        "Whole processes, one thread: best times in seconds",
        ["process", "by the clock", "of the processor", "goal"],
        remarks=[
            "The decks with friction press a sphere, then shear it to Q = µP/2, two load steps; "
            "half of the window is in contact."
        ],
    )
    python = [sys.executable, "-c"]
    sizes = (64,) if quick else (64, 128, 256)
    rows: list[tuple[str, list[str], str]] = [
        ("python -c pass", [*python, "pass"], ""),
        (f"python -c '{IMPORTS}'", [*python, IMPORTS], ""),
        ("hexcontact --help", [*program(), "--help"], "< 0.3"),
        ("hexcontact check, friction, 64²", [*program(), "check", "64.toml"], ""),
    ]
    for side in sizes:
        rows.append(
            (
                f"hexcontact run, friction, {side}²",
                [*program(), "run", f"{side}.toml", "--overwrite"],
                "≤ 0.2" if side == 64 else "",
            )
        )
    for name, goal in (("hertz_spheres", "< 1.5"), ("hertz_table_9_2", "")):
        words = [*program(), "run", str(ROOT / "cases" / f"{name}.toml"), "--overwrite"]
        rows.append((f"hexcontact run {name}.toml", words, goal))
    with tempfile.TemporaryDirectory() as folder:
        for side in sizes:
            Path(folder, f"{side}.toml").write_text(
                memory.deck("friction, alike", side, share=memory.HALF, steps=1)
            )
        for title, words, goal in rows:
            spent = [process(words, folder) for _ in range(3 if quick else 7)]
            wall, processor = (f"{min(times):.3f}" for times in zip(*spent, strict=True))
            table.add(title, "" if os.environ.get("BENCH_CLOCK") == "cpu" else wall, processor, goal)
            print(f"  {table.rows[-1]}", flush=True)
    return [table]


def program() -> list[str]:
    """Return the words that call the command."""
    installed = Path(sys.executable).with_name("hexcontact")
    return [str(installed)] if installed.exists() else [sys.executable, "-m", "hexcontact"]


def process(words: list[str], folder: str) -> tuple[float, float]:
    """Return the time of a process by the clock, and that of the processor."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, cwd=folder, check=True, capture_output=True, env=worker.environment(1))
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def small(*, quick: bool) -> list[Table]:
    """Return the times of load steps so short that what is around them counts."""
    table = Table(
        f"Small contacts: {SIDE} × {SIDE} nodes, half of them in contact, one thread: milliseconds",
        ["what", "best", "goal"],
        remarks=[
            "One load step: normal load and Q = µP/2 at once, from nothing, ν = 0.3. Core: without decks, "
            "units and histories. Set-ups take kernels from the cache of the process. A further step: the "
            f"mean of {STEPS} steps from Q = 0 to µP/2, a whole run less one of the first step alone. The "
            "data set of a result, which is made when it is first used, is not counted."
        ],
    )
    runs = [
        worker.run({"problem": "small", "repeats": 30}, script=Path(__file__))
        for _ in range(1 if quick else 3)
    ]
    found = worker.best(runs, "advance", "core", "case", "core_steps", "case_steps")
    if "failed" in found:
        table.add("all", found["failed"])
        return [table]
    found["core_step"], found["case_step"] = (
        (found[f"{name}_steps"] - found[f"{name}_first"]) / STEPS for name in ("core", "case")
    )
    for title, value, goal in (
        ("core, one load step", found["advance"], "≤ 1"),
        ("core, set-up and load step", found["core"], ""),
        ("Case.run, one load step", found["case"], "≤ 2"),
        ("core, a further load step", found["core_step"], ""),
        ("Case.run, a further load step", found["case_step"], ""),
        (
            "Case.run, a further load step, less that of the core",
            found["case_step"] - found["core_step"],
            "< 1",
        ),
    ):
        table.add(title, f"{1e3 * value:.2f}", goal)
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


def sphere(side: int, loads: list[dict[str, Any]]) -> Any:
    """Return a case: a sphere of radius 10 mm, half of the window in contact under 100 N."""
    from hexcontact import Case

    modulus, radius, load = 210e9, 10e-3, 100.0
    body = {"young_modulus": modulus, "poisson_ratio": 0.3}
    contact = (0.75 * load * radius * 2 * (1 - 0.3**2) / modulus) ** (1 / 3)
    return Case(
        body_1={**body, "surface": {"shape": "sphere", "radius": radius}},
        body_2=body,
        spacing=2 * contact / (memory.HALF * 3**0.5 / 2 * side),
        window=(side, side),
        friction_coefficient=MU,
        loads=loads,
    )


def solve_small(repeats: int) -> dict[str, Any]:
    """Time of one load step, and of runs with one and with more, by the core and by `Case.run`."""
    from hexcontact.core.friction import FrictionalContact
    from hexcontact.core.lattice import Lattice

    lattice = Lattice(2.7 / (SIDE - 1), -(SIDE // 2), -(SIDE // 2), SIDE, SIDE)
    pair = problems.ALIKE.pair
    gap, shear = problems.parabola(lattice), [k / STEPS / 2 for k in range(STEPS + 1)]

    def core(shares: list[float]) -> Any:
        contact = FrictionalContact(lattice, pair, gap, friction_coefficient=MU, threads=1)
        return steps(contact, shares)

    def steps(contact: Any, shares: list[float]) -> Any:
        state = contact.virgin()
        for share in shares:
            target = (problems.LOAD, share * MU * problems.LOAD, 0.0, 0.0)
            state = contact.advance(state, problems.FORCE, target, tolerance=problems.TOLERANCE)
        return contact

    at_once = sphere(SIDE, [{"normal_load": 100.0, "tangential_load_x": "0.5 mu P"}])
    pressed = {"normal_load": 100.0, "tangential_load_x": 0.0}
    first = sphere(SIDE, [pressed])
    longer = sphere(SIDE, [pressed, {"tangential_load_x": "0.5 mu P", "steps": STEPS}])
    runs: dict[str, Callable[[], Any]] = {
        "core": lambda: core([0.5]),
        "core_first": lambda: core(shear[:1]),
        "core_steps": lambda: core(shear),
        "case": at_once.run,
        "case_first": first.run,
        "case_steps": longer.run,
    }
    found = {
        name: best_of(max(1, repeats // (10 if "steps" in name else 1)), run)[0] for name, run in runs.items()
    }
    ready = core([0.5])
    return found | {"advance": best_of(repeats, lambda: steps(ready, [0.5]))[0]}


def sessions(*, quick: bool) -> list[Table]:
    """Return the times of load steps early and late in a session of many."""
    marks = (50, 150, 300) if quick else (100, 1000, 10_000)
    table = Table(
        f"A session of {marks[-1]:,} load steps, 13 × 13 nodes, one thread: milliseconds a load step",
        [
            *("results", *(f"about step {mark:,}" for mark in marks), "last ÷ first", "goal"),
            *("result, file closed [s]", "growth of memory [kB a step]"),
        ],
        remarks=["Means of 60 load steps by `Session.advance`: a small tangential load goes back and forth."],
    )
    for title, file in (("in memory", False), ("in a file", True)):
        task = {"problem": "sessions", "marks": marks, "file": file}
        found = worker.run(task, script=Path(__file__), timeout=1800)
        if "failed" in found:
            table.add(title, found["failed"])
            continue
        times = found["times"]
        table.add(
            title,
            *(f"{1e3 * t:.2f}" for t in times),
            *(f"{times[-1] / times[0]:.2f}", "≤ 1.1", f"{found['end']:.2f}", f"{found['memory'] / 1e3:.1f}"),
        )
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


def solve_session(marks: list[int], file: bool) -> dict[str, Any]:
    """Time of a load step about each of some numbers of steps, and of the end."""
    case = sphere(13, [{"normal_load": 100.0}])
    with tempfile.TemporaryDirectory() as folder:
        session = case.start(Path(folder, "session.nc") if file else None)
        next(session)
        spent, memory_then = [], 0
        for k in range(marks[-1] + 30):
            start = clock()
            session.advance(tangential_load_x=(5.0, -5.0, 3.0)[k % 3])
            spent.append(clock() - start)
            if k == marks[0]:
                memory_then = peak_memory()
        grown = peak_memory() - memory_then
        start = clock()
        _ = session.result().dataset
        session.close()
        end = clock() - start
    means = [sum(spent[mark - 30 : mark + 30]) / 60 for mark in marks]
    return {"times": means, "end": end, "memory": grown / (len(spent) - marks[0])}


if __name__ == "__main__":
    answer({"small": solve_small, "sessions": solve_session})
