"""Compares LAPACK with FFTs, its threads, and its iteration with that of the dissertation.

Each row is measured in a process of its own.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from bench import problems, worker
from bench.problems import Material
from bench.report import Table
from bench.square_window import best_of, clock
from bench.square_window import main as answer
from hexcontact.core import kernel_cache
from hexcontact.core.contact import Method
from hexcontact.core.friction import ContactState, FrictionalContact
from hexcontact.core.lattice import Lattice

SPACINGS = 18.7 / 51
"""Spacings in the contact radius, over the side: Table 9.2, half of the window is in contact."""

MATERIALS = {
    "alike": problems.ALIKE,
    "unlike": problems.DISSIMILAR,
    "alike, ν = 0": Material(0.0, 0.0, 0.5),
    "N30": problems.FRICTIONAL["N30"].material,
    "N50": problems.FRICTIONAL["N50"].material,
}
HISTORIES = {
    "pressed in 10 steps": [(k / 10, 0.0) for k in range(1, 11)],
    "pressed in 5, sheared in 5": [(min(k, 5) / 5, 0.18 * max(k - 5, 0)) for k in range(1, 11)],
    "pressed in 1, sheared in 9": [(1.0, k / 10) for k in range(10)],
    "pressed in 1, back and forth in 9": [(1.0, q / 10) for q in (0, 3, 6, 3, 0, -3, -6, -3, 0, 3)],
}
SIDES = (7, 9, 11, 13, 15, 21, 31, 51, 81, 121)
Steps = Sequence[tuple[float, float]]


def window(side: int, spacings: float) -> Lattice:
    """Return a window about the center with contact radius 1."""
    return Lattice(1 / spacings, -(side // 2), -(side // 2), side, side)


def advance(
    contact: FrictionalContact, state: ContactState, step: tuple[float, float], mu: float, **how: Any
) -> ContactState:
    """Return the state after a step to shares of the normal load and of mu P."""
    press, shear = (part * problems.LOAD for part in (step[0], step[0] * step[1]))
    target = (press, shear * mu, 0.0, 0.0)
    return contact.advance(state, problems.FORCE, target, tolerance=problems.TOLERANCE, **how)


def history(side: int, spacings: float, material: str, steps: Steps, method: Method, repeats: int) -> Any:
    """Return the time of load steps without their set-up, linear solutions, and some numbers of the end."""
    given = MATERIALS[material]
    contact = problems.frictional_contact(given, window(side, spacings), method=method)

    def run() -> tuple[int, float, ContactState]:
        state, sweeps, products = contact.virgin(), 0, 0.0
        for step in steps:
            state = advance(contact, state, (step[0], step[1]), given.friction)
            if not state.converged:
                raise RuntimeError(f"not converged: {state.stopped}")
            sweeps += state.sweeps
            products += state.operator_applications
        return sweeps, products, state

    time, (sweeps, products, state) = best_of(repeats, run)
    peak = float(state.pressure.max())
    return {
        "seconds": time,
        "sweeps": sweeps,
        "products": products,
        "contact": int((state.zone > 0).sum()),
        "traction": [round(x / peak, 12) for x in state.traction_x[side // 2].tolist()],
    }


def frictionless(side: int, spacings: float, method: Method, repeats: int) -> Any:
    """Return the time of a solution without friction, with and without set-up."""

    def everything() -> Any:
        contact = problems.hertz_contact(window(side, spacings), method=method)
        start = clock()
        solution = contact.solve(normal_load=problems.LOAD, tolerance=problems.TOLERANCE)
        return clock() - start, solution.converged

    whole, (solved, converged) = best_of(repeats, everything)
    if not converged:
        raise RuntimeError("not converged")
    return {"seconds": whole, "solve": solved}


def measured(task: dict[str, Any], threads: int = 1) -> dict[str, Any]:
    """Return the answer of a task in a process of its own."""
    found = worker.run(task, script=Path(__file__), threads=threads)
    if "failed" in found:
        raise RuntimeError(f"{task}: {found['failed']}")
    return found


def steps_table(*, quick: bool) -> list[Table]:
    """Return the times of ten steps on the finest mesh of Table 9.2."""
    table = Table(
        "Ten load steps with friction, 51 × 51 nodes, 1,285 of them in contact, one thread: seconds",
        [
            "materials",
            "history",
            "LAPACK",
            "linear solutions",
            "products with the operator",
            "FFT",
            "products",
            "LAPACK over FFT",
        ],
        remarks=["Goal: LAPACK within 1 s."],
    )
    for material in ("alike",) if quick else ("alike", "unlike"):
        for name, steps in HISTORIES.items():
            task = {"problem": "history", "side": 51, "spacings": 18.7, "material": material, "steps": steps}
            direct, fft = (measured(task | {"method": m, "repeats": 3}) for m in ("direct", "fft"))
            a, b = direct["seconds"], fft["seconds"]
            work = [f"{found['products']:.0f}" for found in (direct, fft)]
            solutions = str(direct["sweeps"])
            table.add(material, name, f"{a:.2f}", solutions, work[0], f"{b:.3f}", work[1], f"{a / b:.1f}")
            print(f"  {table.rows[-1]}", flush=True)
    return [table]


def methods_table(*, quick: bool, long: bool) -> list[Table]:
    """Return times of both methods over the size of the window."""
    table = Table(
        "Milliseconds a load step, one thread: LAPACK / FFT (their ratio); half of the window in contact",
        [
            "window",
            "in contact",
            "without friction, with set-up",
            "without friction",
            "alike, pressed and sheared",
            "unlike",
        ],
    )
    steps = [(0.5, 0.0), (1.0, 0.0), (1.0, 0.2), (1.0, 0.4), (1.0, 0.2)]
    for side in SIDES[:6] if quick else SIDES if long else SIDES[:-1]:
        repeats = 20 if side < 40 else 3 if side < 100 else 1
        cells = []
        task: dict[str, Any] = {"side": side, "spacings": side * SPACINGS, "repeats": repeats}
        pair = [measured(task | {"problem": "frictionless", "method": m}) for m in ("direct", "fft")]
        for key in ("seconds", "solve"):
            cells.append([1e3 * found[key] for found in pair])
        for material in ("alike", "unlike"):
            more = {"problem": "history", "material": material, "steps": steps}
            pair = [measured(task | more | {"method": m}) for m in ("direct", "fft")]
            cells.append([1e3 * found["seconds"] / len(steps) for found in pair])
        shown = [f"{a:.3g} / {b:.3g} ({a / b:.2g})" for a, b in cells]
        table.add(f"{side} × {side}", str(pair[0]["contact"]), *shown)
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


def threads_table(*, quick: bool) -> list[Table]:
    """Return times by the clock on one thread and on two, and how far the results differ."""
    table = Table(
        "LAPACK on threads, unlike materials, five load steps: seconds",
        ["window", "1 thread", "2 threads", "ratio", "difference of the tractions, of p_max"],
    )
    steps = [(0.5, 0.0), (1.0, 0.0), (1.0, 0.2), (1.0, 0.4), (1.0, 0.2)]
    for side in (31,) if quick else (51, 81):
        task = {"problem": "history", "side": side, "spacings": side * SPACINGS, "material": "unlike"}
        task |= {"steps": steps, "method": "direct", "repeats": 3}
        found = {n: [measured(task, threads=n) for _ in range(2)] for n in (1, 2)}
        one, two = (min(run["seconds"] for run in runs) for runs in found.values())
        same = all(runs[0]["traction"] == runs[1]["traction"] for runs in found.values())
        apart = max(
            abs(a - b) for a, b in zip(*(runs[0]["traction"] for runs in found.values()), strict=True)
        )
        words = f"{apart:.0e}" + ("" if same else "; runs with the same threads differ")
        table.add(f"{side} × {side}", f"{one:.2f}", f"{two:.2f}", f"{one / two:.2f}", words)
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


CASES: dict[str, tuple[str, Steps]] = {
    "ν = 0, pressed, Q = µP/2": ("alike, ν = 0", [(1.0, 0.0), (1.0, 0.5)]),
    "alike, pressed, Q = µP/2": ("alike", [(1.0, 0.0), (1.0, 0.5)]),
    "alike, the same in 5 steps": ("alike", [(1.0, k / 10) for k in range(6)]),
    "alike, Q = 0.6 µP, back to 0.3 µP": ("alike", [(1.0, 0.0), (1.0, 0.6), (1.0, 0.3)]),
    "β = −0.19, µ = 0.1, pressed at once": ("unlike", [(1.0, 0.0)]),
    "the same, in 10 steps": ("unlike", [(k / 10, 0.0) for k in range(1, 11)]),
    "β = −0.19, pressed, Q = 0.1 and 0.2 µP": ("unlike", [(1.0, 0.0), (1.0, 0.1), (1.0, 0.2)]),
    "β = 0.3, µ = 0.6, pressed at once": ("N30", [(1.0, 0.0)]),
    "β = 0.5, µ = 0.6, pressed at once": ("N50", [(1.0, 0.0)]),
}


def iterations(material: str, steps: Steps, side: int) -> Any:
    """Return work and end of a history by both iterations, which go on after a failure."""
    given = MATERIALS[material]
    found = []
    for iteration in ("newton", "dissertation"):
        lattice = window(side, side * SPACINGS)
        contact = FrictionalContact(
            lattice,
            given.pair,
            problems.parabola(lattice),
            friction_coefficient=given.friction,
            method="direct",
            iteration=iteration,  # type: ignore[arg-type]
            threads=1,
        )
        state, sweeps, start, worst = contact.virgin(), 0, clock(), [0.0, 0.0]
        missed: list[int] = []
        for number, step in enumerate(steps, 1):
            state = advance(contact, state, (step[0], step[1]), given.friction, max_cuts=0)
            sweeps += state.sweeps
            worst = [max(worst[0], state.residual_normal), max(worst[1], state.residual_tangential)]
            missed += [] if state.converged else [number]
        found.append((state, sweeps, clock() - start, worst, missed))
    (ours, *_), (theirs, *_) = found
    peak = float(ours.pressure.max())
    return {
        "sweeps": [row[1] for row in found],
        "seconds": [row[2] for row in found],
        "residuals": found[1][3],
        "missed": found[1][4],
        "pressure": float(abs(ours.pressure - theirs.pressure).max()) / peak,
        "traction": float(
            max(
                abs(ours.traction_x - theirs.traction_x).max(), abs(ours.traction_y - theirs.traction_y).max()
            )
        )
        / (given.friction * peak),
        "stick": [int((row[0].zone == 1).sum()) for row in found],
        "contact": [int((row[0].zone > 0).sum()) for row in found],
    }


def iterations_table(*, quick: bool) -> list[Table]:
    """Return both iterations of the direct method side by side."""
    side = 31
    table = Table(
        f"Newton's iteration / that of the dissertation, {side} × {side} nodes, tolerance 10⁻⁸",
        [
            "problem",
            "linear solutions",
            "time",
            "nodes in stick",
            "steps beyond the tolerance",
            "largest R_n, R_t",
            "difference of p, of p_max",
            "of q, of µp_max",
        ],
    )
    for title, (material, steps) in list(CASES.items())[: 2 if quick else None]:
        found = measured({"problem": "iterations", "material": material, "steps": steps, "side": side})
        table.add(
            title,
            "{} / {}".format(*found["sweeps"]),
            f"1 / {found['seconds'][1] / found['seconds'][0]:.1f}",
            "{} / {}".format(*found["stick"]),
            f"{len(found['missed'])} of {len(steps)}",
            "{:.0e}, {:.0e}".format(*found["residuals"]),
            f"{found['pressure']:.1e}",
            f"{found['traction']:.1e}",
        )
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


if __name__ == "__main__":
    kernel_cache.configure(memory=0)
    answer({"history": history, "frictionless": frictionless, "iterations": iterations})
