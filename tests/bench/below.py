"""Time and memory of stresses in a box and of critical planes over a cycle."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from bench import worker
from bench.report import Table
from bench.square_window import best_of, peak_memory
from bench.square_window import main as answer

NODES, PLANES, STEPS = 256, 64, 40


def measure(*, quick: bool) -> list[Table]:
    """Return the table."""
    nodes = NODES // 4 if quick else NODES
    table = Table(
        f"Stress and fatigue, {nodes} × {nodes} nodes, one thread",
        ["what", "time [s]", "goal", "peak memory grows by [MB]", "of which the result [MB]"],
        remarks=[
            f"Six components of the stress in {PLANES} planes below a sphere, pressed and sheared, kernels "
            "included. Fatigue parameters: the search of the critical plane over a cycle of "
            f"{STEPS} load steps, random histories at as many points as nodes."
        ],
    )
    found = worker.run({"problem": "below", "nodes": nodes}, script=Path(__file__), timeout=900)
    if "failed" in found:
        table.add("all", found["failed"])
        return [table]
    goals = {"six stresses": "≤ 5"}
    for title, (time, memory, result) in found["rows"].items():
        table.add(
            title,
            f"{time:.2f}",
            "" if quick else goals.get(title, ""),
            f"{memory / 1e6:.0f}",
            f"{result / 1e6:.0f}" if result else "",
        )
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


def solve(nodes: int) -> dict[str, Any]:
    """Time, growth of the peak of memory and size of the result of each."""
    from hexcontact import Case, fatigue

    body = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    case = Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": 0.02}},
        body_2=body,
        spacing=1e-5 * NODES / nodes,
        window=(nodes, nodes),
        friction_coefficient=0.3,
        loads=[{"normal_load": 500.0}, {"tangential_load_x": 90.0}],
    )
    result = case.run()
    spacing = result.lattice.spacing
    depths = [spacing * k for k in range(1, PLANES + 1)]
    names = [f"stress_{ab}" for ab in ("xx", "yy", "zz", "xy", "yz", "xz")]
    rows: dict[str, tuple[float, int, int]] = {}

    def timed(name: str, call: Callable[[], Any]) -> None:
        before = peak_memory()
        time, found = best_of(1, call)
        rows[name] = (time, peak_memory() - before, int(getattr(found, "nbytes", 0)))

    timed("six stresses", lambda: result.stress(*names, depths=depths))
    phase = 2 * np.pi * np.arange(STEPS) / STEPS
    random = np.random.default_rng(1).normal(size=(2, nodes * nodes, 1, 6))
    history = 1e8 * (random[0] * np.sin(phase)[:, None] + random[1] * np.cos(phase)[:, None])
    moduli = {"young_modulus": 72e9, "poisson_ratio": 0.33}
    timed("Smith, Watson and Topper", lambda: fatigue.smith_watson_topper(history, **moduli))
    timed("Findley", lambda: fatigue.findley(history, slope=0.3))
    return {"rows": rows}


if __name__ == "__main__":
    answer({"below": solve})
