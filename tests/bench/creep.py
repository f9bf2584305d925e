"""A creep table: 3,240 steady states of rolling at 35 x 35 nodes, in one contact; CONTACT beside it."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from validation.rolling import STEADY, Ellipse

from . import contact, driver, problems
from .report import Table, seconds
from .square_window import clock

SPACINGS, SIDE = 15, 35  # in both half-axes; nodes across the window
COUNTS = (12, 27, 10)  # creepages along x and y, spins
LARGEST = (3.0, 4.0, 4.0)  # creepages over mu p0/G, spin over mu p0/(G c): all nodes slip
ELLIPSES = (1.0, 0.4, 2.5)
RATIO, MU = 0.25, 0.3
LOG = 0.134  # s a case: CONTACT's own log of a table of 3,221 cases at 35 x 35, 433 s on a host of 2016


def measure(program: contact.Program | None, *, quick: bool) -> list[Table]:
    """Return work and time of the cases of a table, and of the whole command."""
    table = Table(
        f"A creep table: {math.prod(COUNTS):,} steady states at {SIDE} × {SIDE} nodes, one thread",
        ["what", "tolerance", "applications a case", "largest", "time a case [s]", "in all [s]", "goal"],
        remarks=[
            "Creepages along x from 0 to 3 µp₀/G, along y to ±4, spins from 0 to 4 µp₀/(Gc), denser near 0; "
            "each case starts from its neighbor. Set-up and pressure are part of the time in all. "
            f"The log of CONTACT of 3,221 such cases at {SIDE} × {SIDE} elements has {LOG} s a case."
        ],
    )
    cases = np.array(list(neighbors()))[:: 10 if quick else 1]
    for ratio in ELLIPSES[: 1 if quick else None]:
        for tolerance in (problems.TOLERANCE, problems.LOOSE)[: 2 if ratio == 1.0 else 1]:
            start = clock()
            ellipse = Ellipse(ratio, SPACINGS, RATIO, MU)
            _, work, _ = ellipse.contact.creep_loads(
                ellipse.state, "force", ellipse.load, MU * cases, STEADY, tolerance
            )
            spent = clock() - start
            if len(work) < len(cases):
                raise RuntimeError(f"no solution of case {len(work) + 1}")
            about = f"core, a/b = {ratio:g}", f"{tolerance:g}", f"{work.mean():.1f}", f"{work.max():.0f}"
            table.add(*about, seconds(spent / len(cases)), seconds(spent), "≤ 60 applications, 5 ms")
            print(f"  {table.rows[-1]}", flush=True)
    if not quick:
        with tempfile.TemporaryDirectory() as folder:
            words = [*driver.program(), "study", str(driver.ROOT / "cases" / "study_rolling.toml")]
            _, spent = driver.process(words, folder)
        what = "hexcontact study study_rolling.toml, files and 50 further cases included"
        table.add(what, "1e-08", "", "", seconds(spent / math.prod(COUNTS)), seconds(spent), "")
        print(f"  {table.rows[-1]}", flush=True)
    if program is not None:
        add_contact(table, program, cases)
    return [table]


def neighbors() -> Iterator[tuple[float, float, float]]:
    """Yield creepages and spin of all cases, each beside the one before, for mu p0/G = c = 1."""
    along, across, spins = (
        _graded(low, high, count)
        for low, high, count in zip((0.0, -LARGEST[1], 0.0), LARGEST, COUNTS, strict=True)
    )
    forward = True
    for k, spin in enumerate(spins):
        for y in across[:: (-1) ** k]:
            for x in along if forward else along[::-1]:
                yield float(x), float(y), float(spin)
            forward = not forward


def _graded(low: float, high: float, count: int) -> NDArray[np.float64]:
    """Return values of a range that are denser near 0."""
    width = high / math.sinh(2.0)
    values: NDArray[np.float64] = width * np.sinh(np.linspace(math.asinh(low / width), 2.0, count))
    return values


def add_contact(table: Table, program: contact.Program, cases: NDArray[np.float64]) -> None:
    """Add the time of CONTACT for cases of a circle: that of all in a process less that of one."""
    for tolerance in (problems.TOLERANCE, problems.LOOSE):
        spent = program.run(deck_of(cases, tolerance))[0] - program.run(deck_of(cases[:1], tolerance))[0]
        each = spent / (len(cases) - 1)
        row = (
            "CONTACT, a/b = 1",
            f"{tolerance:g}",
            "",
            "",
            seconds(each),
            seconds(each * math.prod(COUNTS)),
            "",
        )
        table.add(*row)
        print(f"  {table.rows[-1]}", flush=True)


def deck_of(cases: NDArray[np.float64], tolerance: float) -> str:
    """Return the input of CONTACT for steady states of a circle, each from the case before."""
    modulus, radius, a = contact.SHEAR_MODULUS, contact.RADIUS, contact.LENGTH
    compliance = (1 - RATIO) / modulus
    load, unit = 4 / 3 * a**3 / (radius * compliance), 2 * a / (math.pi * radius * compliance) / modulus
    spacing = a / SPACINGS
    lines = [" 3  MODULE"]
    for number, (x, y, spin) in enumerate(MU * unit * cases):
        new, last = number == 0, number == len(cases) - 1
        lines += [
            " 203100  P-B-T-N-F-S",
            f" 0{2 * new}{2 * new}0{2 * new}0  L-D-C-M-Z-E",
            f" 000{int(not new)}0{2 * last}0{int(last)}  X-H-G-I-A-O-W-R",
            f" 999 100 50 1 {tolerance:g}  MAXGS MAXIN MAXNR MAXOUT EPS",
            f" {load:.15g} {x:.15g} {y:.15g} {spin / a:.15g}  FN CKSI CETA CPHI",
            f" {MU} {MU}  FSTAT FKIN",
        ]
        if new:
            corner, width = -spacing * SIDE / 2, f"{spacing:.15g} {spacing:.15g}"
            lines += [
                f" 0 {spacing:.15g} 1  CHI DQ VELOC",
                f" {RATIO} {RATIO} {modulus:.15g} {modulus:.15g}  POISS GG",
                " 1  IPOTCN",
                f" {SIDE} {SIDE} {corner:.15g} {corner:.15g} {width}  MX MY XL YL DX DY",
                " 1 1  IBASE IPLAN",
                f" {0.5 / radius} 0 {0.5 / radius} 0 0 0  B",
            ]
    return "\n".join([*lines, " 0  MODULE", ""])
