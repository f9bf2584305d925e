"""Other codes, each in an environment of its own, on the same problems side by side."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import accuracy, worker
from .report import Table, seconds, signed

HERE = Path(__file__).parent
TOLERANCE = 1e-8
FRACTION = 0.5
"""Share of the window in contact: the window is 2.7 contact radii wide."""
SHEARED_FRACTION = 0.2
LONGEST = 30.0
"""Seconds; what would take longer is left out, and said."""

ENOUGH = 10.0
"""Seconds after which a code is not run again."""

SIZES = (256, 512, 1024, 2048)
ROUGH_SIZES = (256, 512, 1024)
ROUGH_TOLERANCE = 1e-6
SHEARED_SIZES = (64, 128, 256, 512)
TURNS = 3
GROWTH = 6.0
"""What a window of twice as many nodes a side costs at least."""


@dataclass(frozen=True)
class Peer:
    """A code and how it is installed: one list of packages after the other."""

    name: str
    script: str
    requirements: tuple[tuple[str, ...], ...]
    prefix: str = ""
    """Folder below site-packages where CMake looks for headers."""


PEERS = (
    # Eigen's headers from a package: its own build would fetch them from a git server
    Peer(
        "aspher",
        "peer_aspher.py",
        (("cmeel-eigen==3.4.1",), ("aspher==0.1.3.post1",)),
        prefix="cmeel.prefix",
    ),
    # asks for a numpy that no Python after 3.9 has; runs with this one
    Peer(
        "slippy",
        "peer_slippy.py",
        (
            ("--no-deps", "slippy==0.5.2"),
            (
                *("numpy==1.23.5", "scipy<1.12", "numba<0.58", "matplotlib<3.8", "contourpy<1.2"),
                *("scikit-image<0.22", "pyfftw", "tinydb", "sympy"),
            ),
        ),
    ),
    Peer("tamaas", "peer_tamaas.py", (("tamaas==2.9.0",),)),
    Peer("ContactMechanics", "peer_contactmechanics.py", (("ContactMechanics==1.8.3",),)),
)


class Missing(Exception):
    """A code that could not be installed."""


def interpreter(peer: Peer, folder: Path) -> str:
    """Return the Python of a code's environment, which is set up the first time."""
    home = folder.absolute() / peer.name
    python = home / "bin" / "python"
    stamp = home / "installed.txt"
    wanted = repr(peer.requirements)
    if stamp.exists() and stamp.read_text() == wanted:
        return str(python)
    print(f"  installing {peer.name} into {home}", flush=True)
    call([sys.executable, "-m", "venv", "--clear", str(home)])
    env = dict(os.environ)
    env.pop("PYTHONPATH", None)
    if peer.prefix:
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        env["CMAKE_PREFIX_PATH"] = str(home / "lib" / version / "site-packages" / peer.prefix)
    for packages in peer.requirements:
        call([str(python), "-m", "pip", "install", "--quiet", *packages], env)
    stamp.write_text(wanted)
    return str(python)


def call(command: list[str], env: dict[str, str] | None = None) -> None:
    """Run a command; its last line of complaint is the reason of a failure."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=env, timeout=900)
    except subprocess.TimeoutExpired:
        raise Missing("installation not finished after 15 minutes") from None
    if done.returncode:
        complaints = [line for line in done.stderr.splitlines() if "error" in line.lower()]
        raise Missing((complaints or done.stderr.strip().splitlines() or ["no reason given"])[-1])


@dataclass
class Entry:
    """A code, at one tolerance, in the comparison."""

    label: str
    python: str
    script: Path
    tolerance: float = TOLERANCE
    last: tuple[int, float] | None = None
    """Window and seconds that were measured last."""

    def expected(self, side: int) -> float:
        """Seconds that the window will take at least."""
        if self.last is None:
            return 0.0
        return self.last[1] * GROWTH ** math.log2(max(side / self.last[0], 1.0))

    def answer(self, task: dict[str, Any]) -> dict[str, Any]:
        """Return the answer of the code to a task."""
        return worker.run(
            task | {"tolerance": self.tolerance}, script=self.script, python=self.python, timeout=8 * LONGEST
        )


def entries(folder: Path, names: Sequence[str] | None) -> tuple[list[Entry], list[str]]:
    """Return the codes that are there, ours first, and why others are not."""
    there = [Entry("hexcontact", sys.executable, worker.OURS)]
    absent = []
    for peer in PEERS:
        if names and peer.name not in names:
            continue
        try:
            there.append(Entry(peer.name, interpreter(peer, folder), HERE / peer.script))
        except Missing as reason:
            absent.append(f"{peer.name} is not there: {reason}")
            print("  " + absent[-1])
    return there, absent


def measure(
    folder: Path, *, quick: bool, sizes: Sequence[int] | None = None, names: Sequence[str] | None = None
) -> list[Table]:
    """Return the tables of both comparisons."""
    codes, absent = entries(folder, names)
    largest = 512 if quick else 2048
    tables = [*hertz(codes, [n for n in sizes or SIZES if n <= largest])]
    if any(code.label == "aspher" for code in codes):
        sheared = (64,) if quick else SHEARED_SIZES
        pair = [code for code in codes if code.label in ("hexcontact", "aspher")]
        tables.append(cattaneo_mindlin(pair, sheared))
    tables[0].remarks += absent
    return tables


def measure_rough(
    folder: Path, *, quick: bool, sizes: Sequence[int] | None = None, names: Sequence[str] | None = None
) -> list[Table]:
    """Return the table of a rough surface in a window that repeats."""
    codes, absent = entries(folder, names)
    table = rough(codes, [n for n in sizes or ROUGH_SIZES if n <= (512 if quick else 1024)])
    table.remarks += absent
    return [table]


def hertz(codes: list[Entry], sizes: Sequence[int]) -> list[Table]:
    """Frictionless contact: times and errors of all codes; how many times faster ours is."""
    table = Table(
        f"Hertz, one thread, {FRACTION:.0%} of the window in contact: seconds, and errors against Hertz",
        [
            *("window and code", "set-up", "solve", "total", "solve ÷ ours", "total ÷ ours"),
            *("iterations", "R_n", "p_max", "approach", "L2 of p", "to the edges"),
        ],
    )
    summary = Table(
        "The fastest other code over ours at the same nominal tolerance",
        ["window", "fastest other", "total", "solve", "goal", "total, same error of p", "ours then"],
    )
    # the same problem at about the accuracy of the other
    tight = [Entry("aspher, 1e-10", c.python, c.script, 1e-10) for c in codes if c.label == "aspher"]
    loose = [Entry("hexcontact, 1e-6", c.python, c.script, 1e-6) for c in codes if c.label == "hexcontact"]
    lines = [*codes, *tight, *loose]
    for side in sizes:
        answers = side_by_side(table, lines, side, {"problem": "hertz", "side": side, "fraction": FRACTION})
        ours = answers["hexcontact"]
        for label, answer in answers.items():
            if "failed" in answer:
                table.add(f"{side}² {label}", answer["failed"])
                continue
            total, our_total = (a["setup"] + a["solve"] for a in (answer, ours))
            table.add(
                f"{side}² {label}",
                *(seconds(t) for t in (answer["setup"], answer["solve"], total)),
                f"{answer['solve'] / ours['solve']:.2f}",
                f"{total / our_total:.2f}",
                str(answer.get("iterations", "")),
                f"{answer['residual']:.0e}",
                *(signed(answer[name]) for name in ("max_pressure", "approach")),
                f"{answer['l2_pressure']:.1e}",
                f"{answer['l2_to_edges']:.1e}" if "l2_to_edges" in answer else "",
            )
        others = {
            code.label: answers[code.label]
            for code in codes[1:]
            if "failed" not in answers.get(code.label, {"failed": ""})
        }
        if others:
            fastest = min(others, key=lambda name: others[name]["setup"] + others[name]["solve"])
            best = others[fastest]
            summary.add(
                f"{side}²",
                fastest,
                f"{(best['setup'] + best['solve']) / (ours['setup'] + ours['solve']):.2f}",
                f"{best['solve'] / ours['solve']:.2f}",
                "≥ 4",
                *at_its_error(side, best),
            )
    return [summary, table]


def rough(codes: list[Entry], sizes: Sequence[int]) -> Table:
    """A rough surface in a window that repeats: times, residuals, and area and mean gap of all codes."""
    table = Table(
        "A rough surface in a window that repeats, without friction, one thread: seconds",
        [
            *("window and code", "set-up", "solve", "solve ÷ ours", "total ÷ ours", "iterations"),
            *("R_n", "A/A0", "mean gap/rms height"),
        ],
        remarks=[
            "Self-affine, H = 0.8, wavelengths of 16 to a quarter of the nodes, mean pressure 0.05 E* h'."
        ],
    )
    lines = [Entry(code.label, code.python, code.script, ROUGH_TOLERANCE) for code in codes]
    for side in sizes:
        answers = side_by_side(table, lines, side, {"problem": "rough", "side": side})
        ours = answers["hexcontact"]
        for label, answer in answers.items():
            if "failed" in answer:
                table.add(f"{side}² {label}", answer["failed"])
                continue
            total, our_total = (a["setup"] + a["solve"] for a in (answer, ours))
            table.add(
                f"{side}² {label}",
                *(seconds(answer[name]) for name in ("setup", "solve")),
                *(f"{answer['solve'] / ours['solve']:.2f}", f"{total / our_total:.2f}"),
                str(answer.get("iterations", "")),
                *(
                    f"{answer['residual']:.0e}",
                    f"{answer['contact_fraction']:.4f}",
                    f"{answer['mean_gap']:.4f}",
                ),
            )
    return table


def at_its_error(side: int, other: dict[str, Any]) -> tuple[str, str]:
    """Return the time of another code over that of our window with its error of p, and that window."""
    least = accuracy.least_side("hertz", side, other["l2_pressure"])
    ours = accuracy.ours("hertz", least, repeats=5)["total"]
    return f"{(other['setup'] + other['solve']) / ours:.1f}", f"{least}²"


def side_by_side(
    table: Table, lines: list[Entry], side: int, task: dict[str, Any]
) -> dict[str, dict[str, Any]]:
    """Run all codes in turns, short runs several times; the shortest times count."""
    answers: dict[str, list[dict[str, Any]]] = {}
    for turn in range(TURNS):
        for line in lines:
            if turn == 0 and line.expected(side) > LONGEST:
                remark = left_out(line, side)
                table.remarks.append(remark)
                print("  " + remark)
                continue
            before = taken(answers[line.label][0]) if line.label in answers else math.inf
            if turn and turn * before > ENOUGH:
                continue
            repeats = min(5, math.ceil(0.5 / before)) if turn else 1
            answer = line.answer(task | {"repeats": repeats})
            answers.setdefault(line.label, []).append(answer)
            print(f"  {side}² {line.label}: {short(answer)}", flush=True)
            if "failed" not in answer:
                line.last = (side, taken(answer))
    return {label: worker.best(got, "setup", "solve") for label, got in answers.items()}


def left_out(code: Entry, side: int) -> str:
    """Return why a code is not run on a window."""
    return f"{code.label} at {side}²: left out, since more than {code.expected(side):.0f} s are expected."


def taken(answer: dict[str, Any]) -> float:
    """Seconds of an answer; a failure is not tried again."""
    return float("inf") if "failed" in answer else float(answer["setup"] + answer["solve"])


def short(answer: dict[str, Any]) -> str:
    """Return what is printed while the comparison runs."""
    if "failed" in answer:
        return f"failed: {answer['failed']}"
    return f"set-up {answer['setup']:.3g} s, solve {answer['solve']:.3g} s, R_n {answer['residual']:.0e}"


def cattaneo_mindlin(codes: list[Entry], sizes: Sequence[int]) -> Table:
    """Shear of alike spheres, nu = 0.33, by force: ours, and the only other code that does it."""
    table = Table(
        "Cattaneo-Mindlin, ν = 0.33, Q = µP/2 by force, one thread: seconds, and errors",
        [
            *("window and code", "set-up", "press", "shear", "press + shear ÷ ours", "iterations"),
            *("residual", "stick radius", "L2 of q", "to the edges"),
        ],
    )
    task = {"problem": "cattaneo_mindlin", "mu": 0.3, "share": 0.5, "poisson_ratio": 0.33}
    for side in sizes:
        ours: dict[str, Any] = {}
        for code in codes:
            mine = code.label == "hexcontact"
            if not mine and code.expected(side) > LONGEST:
                table.remarks.append(left_out(code, side))
                continue
            again = task | {"side": side, "fraction": SHEARED_FRACTION, "repeats": 3 if mine else 1}
            answer = worker.best(
                [code.answer(again) for _ in range(3 if mine else 1)], "setup", "press", "shear"
            )
            if mine:
                ours = answer
            if "failed" in answer:
                table.add(f"{side}² {code.label}", answer["failed"])
                continue
            both, our_both = (a["press"] + a["shear"] for a in (answer, ours))
            code.last = (side, both)
            table.add(
                f"{side}² {code.label}",
                *(seconds(answer[name]) for name in ("setup", "press", "shear")),
                f"{both / our_both:.3g}",
                str(answer["iterations"]),
                f"{answer['residual']:.0e}",
                signed(answer["stick_radius"]),
                f"{answer['l2_traction']:.1e}",
                f"{answer['l2_to_edges']:.1e}" if "l2_to_edges" in answer else "",
            )
            print(f"  {table.rows[-1]}", flush=True)
    table.remarks.append("Goal: 100 times faster.")
    return table
