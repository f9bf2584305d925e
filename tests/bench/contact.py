"""CONTACT (Vollebregt, Kalker) on the same load histories side by side.

The environment variable CONTACT_PROGRAM names its executable; without it this comparison is left out.
"""

from __future__ import annotations

import math
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from . import driver, memory, problems, speed, worker
from .report import Table, seconds

LENGTH, RADIUS, SHEAR_MODULUS = 1.0, 50.0, 200.0
"""Contact radius and relative radius of curvature in mm, MPa: the size of CONTACT's own examples."""

WINDOWS = speed.HISTORIES
LONG_ENOUGH = 3.0
"""Seconds of a process whose start is not worth a repetition."""

TOLERANCES = (problems.TOLERANCE, problems.LOOSE)


def measure(program: Program, *, quick: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return the times of load histories, small contacts and processes of both codes, in turns."""
    histories = Table(
        "CONTACT over ours: load histories, half of the window in contact, one thread, set-up included",
        [
            *("history", "window", "CONTACT [s]", "ours [s]", "times faster", "goal"),
            *("CONTACT at 10⁻⁵ [s]", "ours [s]", "times faster", "goal", "stick, CONTACT", "ours"),
        ],
        remarks=[
            "CONTACT: difference in time between a process with several repetitions of a history and a "
            "process with one, without output; ours: the best set-up and the best solution in a process. The "
            "tolerance of CONTACT bounds the change of the tractions in an iteration, ours all residuals. "
            "Stick: its share of the contact after the last step.",
            f"CONTACT: {program.version}.",
        ],
    )
    others = Table(
        "CONTACT over ours: one load step at once from nothing, and whole processes",
        ["what", "CONTACT [s]", "ours [s]", "times faster", "goal"],
    )
    for name, windows in WINDOWS.items():
        for side in [n for n in sizes or windows if n in windows][: 1 if quick else None]:
            add_history(histories, program, name, side, turns=1 if quick else 3)
    if not sizes:
        add_small(others, program, turns=1 if quick else 3)
        for side in (64,) if quick else (64, 128, 256):
            add_process(others, program, side, turns=1 if quick else 5)
    return [histories, others]


def add_history(table: Table, program: Program, name: str, side: int, turns: int) -> None:
    """Add the times of a load history at two tolerances."""
    problem = problems.LOADED[name]
    row = [problem.title.removesuffix(", mean"), f"{side}²"]
    zones: list[str] = []
    for tolerance in TOLERANCES:
        theirs = min(program.history(name, side, tolerance) for _ in range(turns))
        task = speed.task_of(name, side, 1, 3 if side < 256 else 1) | {"setups": 3}
        loose = tolerance == problems.LOOSE
        ours = worker.best([worker.run(task | {"loose": loose}) for _ in range(turns)], "setup", "solve")
        if "failed" in ours:
            table.add(*row, ours["failed"])
            return
        total = ours["setup"] + ours["solve"]
        row += [seconds(theirs), seconds(total), f"{theirs / total:.1f}", "≥ 8" if loose else "≥ 10"]
        zones = [f"{program.stick_share:.3f}", f"{ours['stick']:.3f}"]
    table.add(*row, *zones)
    print(f"  {table.rows[-1]}", flush=True)


def add_small(table: Table, program: Program, turns: int) -> None:
    """Add the load step of a small contact, pressed and sheared at once."""
    side = driver.SIDE
    theirs = min(program.history("AT_ONCE", side, problems.TOLERANCE, repeats=40) for _ in range(turns))
    found = worker.best(
        [worker.run({"problem": "small", "repeats": 30}, script=Path(driver.__file__)) for _ in range(turns)],
        "core",
        "case",
    )
    for title, ours in (("core, set-up included", found["core"]), ("Case.run", found["case"])):
        ratio = theirs / ours
        table.add(
            f"{side} × {side}, Q = µP/2 at once: {title}", seconds(theirs), seconds(ours), f"{ratio:.1f}", ""
        )
        print(f"  {table.rows[-1]}", flush=True)


def add_process(table: Table, program: Program, side: int, turns: int) -> None:
    """Add the whole process of two load steps, files of all nodes included."""
    words = [*driver.program(), "run", f"{side}.toml", "--overwrite"]
    with tempfile.TemporaryDirectory() as folder:
        deck = memory.deck("friction, alike", side, share=memory.HALF, steps=1)
        Path(folder, f"{side}.toml").write_text(deck)
        times = [
            (
                program.run(deck_of("HC", side, problems.TOLERANCE, 1, output=True))[0],
                driver.process(words, folder)[0],
            )
            for _ in range(turns)
        ]
    theirs, ours = (min(column) for column in zip(*times, strict=True))
    goal = "≥ 1" if side == 64 else ""
    table.add(
        f"process with files, HC, {side}²", seconds(theirs), seconds(ours), f"{theirs / ours:.2f}", goal
    )
    print(f"  {table.rows[-1]}", flush=True)


@dataclass
class Program:
    """The executable of CONTACT, its version, and the share of stick after the last history."""

    path: Path
    version: str = "unknown version"
    stick_share: float = math.nan

    @classmethod
    def given(cls) -> Program | None:
        """Return the program of CONTACT_PROGRAM after a trial run; None without the variable."""
        word = os.environ.get("CONTACT_PROGRAM")
        if not word:
            return None
        program = cls(Path(word).absolute())
        try:
            program.run(deck_of("HC", 16, problems.LOOSE, 1))
        except OSError as error:
            reason = error.strerror
        except RuntimeError as error:
            reason = str(error)
        else:
            return program
        raise ValueError(f"CONTACT_PROGRAM: {word}: {reason}; expected the executable of CONTACT")

    def history(self, name: str, side: int, tolerance: float, repeats: int | None = None) -> float:
        """Return the seconds that a load history takes, without the start of the process."""
        single = deck_of(name, side, tolerance, 1)
        once, found = self.run(single)
        _, contact, stick, _ = found[-1]
        self.stick_share = stick / contact
        if once > LONG_ENOUGH:
            return once
        # what is subtracted must not be a disturbed time: the result would be too small
        once = min(once, *(self.run(single)[0] for _ in range(3)))
        repeats = repeats or min(20, math.ceil(1.0 / once))
        return (self.run(deck_of(name, side, tolerance, 1 + repeats))[0] - once) / repeats

    def run(self, deck: str) -> tuple[float, list[tuple[int, ...]]]:
        """Return the seconds of a process, and the zones of the cases that print results."""
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "deck.inp").write_text(deck)
            start = time.perf_counter()
            done = subprocess.run(
                [str(self.path), "2", "deck"],
                cwd=folder,
                env=worker.environment(1),
                capture_output=True,
                text=True,
                check=False,
            )
            spent = time.perf_counter() - start
            file = Path(folder, "deck.out")
            output = file.read_text(encoding="latin-1") if file.exists() else ""
        found = zones(output)
        if "The CONTACT program ended" not in done.stdout or "ERROR" in output or not found:
            raise RuntimeError((done.stdout.strip().splitlines() or ["no output"])[-1])
        self.version = (re.findall(r"\|  Version: (.*?) +\|", output) or [self.version])[0]
        return spent, found


def zones(output: str) -> list[tuple[int, ...]]:
    """Return the numbers of elements: all, in contact, in stick, in slip, of each case."""
    rows = re.findall(r"NPOT +NCON +NADH +NSLIP.*\n +(\d+) +(\d+) +(\d+) +(\d+)", output)
    return [tuple(int(word) for word in row) for row in rows]


def materials(material: problems.Material) -> tuple[float, tuple[float, float]]:
    """Return Poisson's ratio and both shear moduli that have Dundurs' constant beta and gamma."""
    ratio = material.gamma / (1 + material.gamma)
    difference = material.beta * 2 * (1 - ratio) / (1 - 2 * ratio)
    return ratio, (SHEAR_MODULUS, SHEAR_MODULUS * (1 - difference) / (1 + difference))


AT_ONCE = problems.Problem("Q = 0.5 µP at once", problems.ALIKE, ((1, 0.5),), 1, 35)


def deck_of(name: str, side: int, tolerance: float, repeats: int, *, output: bool = False) -> str:
    """Return the input of CONTACT for a load history from nothing, several times.

    Pressed without shear, bodies keep their tangential position; sheared, Q_x is given. The
    last case prints global results; with `output` a file holds the fields of all elements.
    """
    problem = AT_ONCE if name == "AT_ONCE" else problems.LOADED[name]
    ratio, moduli = materials(problem.material)
    compliance = sum((1 - ratio) / (2 * modulus) for modulus in moduli)
    load = 4 / 3 * LENGTH**3 / (RADIUS * compliance)
    spacing = 2.7 * LENGTH / (side - 1) * math.sqrt(math.sqrt(3) / 2)  # as many elements in contact as nodes
    alike, mu = moduli[0] == moduli[1], problem.material.friction
    lines = [" 3  MODULE"]
    for repeat in range(repeats):
        sheared = False
        for step, (press, shear) in enumerate(problem.steps):
            new, last = step == 0, repeat == repeats - 1 and step == len(problem.steps) - 1
            sheared = sheared or shear != 0
            results, fields = 2 * last, 2 * (last and output)
            lines += [
                f" {2 * new}011{int(sheared)}0  P-B-T-N-F-S",
                f" 0{2 * new}{2 * new}0{2 * new}0  L-D-C-M-Z-E",
                f" 000{int(not new)}{fields}{results}0{int(last)}  X-H-G-I-A-O-W-R",
                f" 999 100 50 {1 if alike else 100} {tolerance:g}  MAXGS MAXIN MAXNR MAXOUT EPS",
                f" {press * load:.15g} {-shear:.15g} 0 0  FN FX CETA CPHI",
                f" {mu} {mu}  FSTAT FKIN",
            ]
            if new:
                corner = -spacing * side / 2
                width = f"{spacing:.15g} {spacing:.15g}"
                lines += [
                    f" {ratio:.15g} {ratio:.15g} {moduli[0]:.15g} {moduli[1]:.15g}  POISS GG",
                    " 1  IPOTCN",
                    f" {side} {side} {corner:.15g} {corner:.15g} {width}  MX MY XL YL DX DY",
                    " 1 1  IBASE IPLAN",
                    f" {0.5 / RADIUS} 0 {0.5 / RADIUS} 0 0 0  B",
                ]
    return "\n".join([*lines, " 0  MODULE", ""])
