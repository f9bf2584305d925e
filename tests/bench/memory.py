"""Measures the peak memory of whole runs against what ``hexcontact check`` says before.

    python tests/bench/memory.py                       the usual problems (minutes)
    python tests/bench/memory.py --sizes 64,256        windows of these sides
    python tests/bench/memory.py --deck FILE.toml      a deck

Each run is a process of its own. The terms of the estimate stand in Fortran beside what is allocated
(``*_memory``) and in pydriver/hexcontact/window.py; this says which of them to look at again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))

from bench import worker
from bench.report import Table

HALF = 0.857
"""Width of the contact over that of a window of which it is the half."""
IDLE = 16
"""Nodes along a side of a window that takes no memory beside the program's."""
RADIUS = 10e-3  # of the sphere, m
MODULUS = 1.82e9  # Pa; of two alike bodies E* = 1 GPa
COMMAND = """
import sys
sys.path.insert(0, {tests!r})
from bench.square_window import peak_memory
from hexcontact.cli.app import main
if sys.argv[1] == "run":  # an interim output at once, as in a run that lasts
    import hexcontact.result.store
    hexcontact.result.store.PUBLISH_INTERVAL = 0.0
try:
    main()
finally:
    print("peak", peak_memory(), file=sys.stderr)
"""
PROBLEMS = {
    "frictionless": "",
    "friction, alike": "[friction]\ncoefficient = 0.3\n",
    "friction, unlike": "[friction]\ncoefficient = 0.3\n",
    "wear": "[friction]\ncoefficient = 0.3\n"
    '[wear]\ncoefficient_1 = 1e-14\ncycle = "cycle"\ncycles = 30\njump = 10\n',
}
LARGEST_DIRECT = 128  # nodes along a side
GOALS = {
    "frictionless": "≤ 80",
    "friction, alike": "≤ 300",
    "friction, unlike": "≤ 400",
}  # bytes a window node


class Memory(NamedTuple):
    """Peak of a run and what was estimated, bytes."""

    peak: int
    estimate: int

    @property
    def error(self) -> float:
        """Estimate over peak, less one."""
        return self.estimate / self.peak - 1.0


def deck(problem: str, side: int, *, share: float = 0.8, steps: int = 2, more: str = "") -> str:
    """Return a deck: a sphere on a window of `side` nodes along each direction.

    Parameters
    ----------
    problem : str
        One of `PROBLEMS`.
    side : int
        Rows and columns of the window.
    share : float
        Width of the contact over that of the window.
    steps : int
        Load steps of each segment.
    more : str
        Further tables.
    """
    spacing = 1e-3 / side
    radius = share * 0.5 * 3**0.5 * side / 2 * spacing
    unlike = problem.endswith("unlike")
    stiffness = (MODULUS / 0.91 if unlike else MODULUS / 1.82) * 4 / 3 / RADIUS
    load = stiffness * radius**3
    second = "rigid = true" if unlike else f"young_modulus = {MODULUS}\npoisson_ratio = 0.3"
    shear = f"[[load]]\ntangential_load_x = {0.15 * load}\nsteps = {steps}\n" if PROBLEMS[problem] else ""
    if problem == "wear":
        path = [f"{{ tangential_load_x = {q * load}, steps = {steps} }}" for q in (0.15, -0.15, 0.0)]
        shear = f'[[load]]\nlabel = "cycle"\npath = [{", ".join(path)}]\n'
    return (
        f'title = "{problem}, {side}"\n'
        f"[body.1]\nyoung_modulus = {MODULUS}\npoisson_ratio = 0.3\n"
        f'surface = {{ shape = "sphere", radius = {RADIUS} }}\n[body.2]\n{second}\n'
        f"[grid]\nspacing = {spacing}\nwindow = [{side}, {side}]\n{PROBLEMS[problem]}{more}"
        f"[[load]]\nnormal_load = {load}\nsteps = {steps}\n{shear}"
    )


def measured(text: str, threads: int = 1) -> Memory:
    """Run a deck and return what it took at most, and what was said before."""
    environment = worker.environment(threads)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "deck.toml").write_text(text)
        program = COMMAND.format(tests=str(Path(__file__).parents[1]))
        words = [sys.executable, "-W", "ignore", "-c", program]
        told, done = (
            subprocess.run([*words, *more], cwd=folder, env=environment, capture_output=True, text=True)
            for more in (["check", "deck.toml", "--json"], ["run", "deck.toml", "-q"])
        )
    if told.returncode or done.returncode:
        raise RuntimeError(told.stderr + done.stderr)
    return Memory(int(done.stderr.split()[-1]), int(json.loads(told.stdout)["memory"]))


def measure(*, quick: bool, long: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return the table of peaks, estimates and bytes a node."""
    table = Table(
        "Peak memory of a whole run, one thread, against what `hexcontact check` says before",
        [
            *("run", "peak [MB]", "`check` [MB]", "off", "goal"),
            *("without program [MB]", "bytes a window node", "goal"),
        ],
        remarks=[
            "Pressed in one load step, with friction sheared in another; half of the window is in contact. "
            f"*Without program*: less the peak of the same run on {IDLE}² nodes. "
            + ("" if long else "`--long` measures larger windows, too.")
        ],
    )
    tasks = [
        (problem, side, "fft") for side in sizes or ((256,) if quick else (256, 1024)) for problem in PROBLEMS
    ]
    tasks = [task for task in tasks if task[0] != "wear" or task[1] <= 256]
    tasks += [("friction, alike", 121, "direct")]
    if not (sizes or quick):
        tasks.append(("frictionless", 2048, "fft"))
    if long:
        tasks += [
            ("friction, alike", 2048, "fft"),
            ("friction, unlike", 2048, "fft"),
            ("frictionless", 4096, "fft"),
        ]
    for problem, side, method in tasks:
        found, idle = (
            measured(deck(problem, n, share=HALF, steps=1, more=f'[solver]\nmethod = "{method}"\n'))
            for n in (side, IDLE)
        )
        own = found.peak - idle.peak
        table.add(
            f"{problem}, {side}²{', LAPACK' if method == 'direct' else ''}",
            *(f"{found.peak / 1e6:.0f}", f"{found.estimate / 1e6:.0f}", f"{found.error:+.1%}", "≥ −5 %"),
            *(
                f"{own / 1e6:.0f}",
                f"{own / side**2:.0f}" if method == "fft" else "",
                "≤ 230 MB" if method == "direct" else GOALS.get(problem, ""),
            ),
        )
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sizes", default="64,256,512,1024", help="nodes along a side of the window")
    parser.add_argument("--share", type=float, default=0.8, help="width of the contact over the window's")
    parser.add_argument("--steps", type=int, default=2, help="load steps of each segment")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--deck", type=Path, help="this deck instead")
    options = parser.parse_args()
    sizes = [int(side) for side in options.sizes.split(",")]
    tasks = {
        (problem, side, method): deck(
            problem,
            side,
            share=options.share,
            steps=options.steps,
            more=f'[solver]\nmethod = "{method}"\n',
        )
        for method in ("fft", "direct")
        for side in sizes
        for problem in PROBLEMS
        if method == "fft" or side <= LARGEST_DIRECT
    }
    if options.deck:
        tasks = {(str(options.deck), 0, ""): options.deck.read_text()}
    print("| problem | side | method | peak [MB] | estimate [MB] | off |\n|---|---|---|---|---|---|")
    for (problem, side, method), text in tasks.items():
        memory = measured(text, options.threads)
        sizes_found = f"{memory.peak / 1e6:.1f} | {memory.estimate / 1e6:.1f} | {100 * memory.error:+.1f} %"
        print(f"| {problem} | {side} | {method} | {sizes_found} |", flush=True)


if __name__ == "__main__":
    main()
