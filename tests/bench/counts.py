"""Operator applications by problem and mesh, and the bounds of the test that looks after them."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path

from . import problems
from .report import Table

BOUNDS = Path(__file__).parent / "bounds.json"
MARGIN = 1.3
"""A processor with other roundings may need an iteration more."""

MESHES = (20, 40, 80, 160, 320)
SLOW_FROM = {"PATH": 320, "PATH19": 320, "HIST": 160}
"""Meshes that take minutes, measured with --long."""

BOUNDED = (
    {name: (20, 40, 80) for name in ("HERTZ", *problems.FRICTIONAL)}
    | {name: (20,) for name in problems.BOUNDED if name not in problems.FRICTIONAL}
    | {"PATH": (20, 40), "PATH19": (20,), "HIST": (20,)}
)
"""Meshes of the regression test, which must be quick."""


def measure(*, quick: bool, long: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return the table of all problems on all meshes, goals beside it."""
    meshes = sizes or (MESHES[:3] if quick else MESHES)
    table = Table(
        "Operator applications a load step, by spacings in the contact radius",
        ["problem", *map(str, meshes), "goal", "finest ÷ coarsest", "goal"],
        remarks=["Goals: of every mesh, and of the growth with the mesh."],
    )
    titles = {"HERTZ": problems.HERTZ_TITLE} | {k: p.title for k, p in problems.FRICTIONAL.items()}
    goals = {"HERTZ": float(problems.HERTZ_GOAL)} | {k: p.goal for k, p in problems.FRICTIONAL.items()}
    for name, title in titles.items():
        cells: list[str] = []
        found: list[float] = []
        start = time.perf_counter()
        for mesh in meshes:
            slow = SLOW_FROM.get(name, math.inf)
            if (mesh >= slow and not long) or (quick and mesh >= slow / 4):
                cells.append("")
                continue
            try:
                found.append(problems.count(name, mesh))
                cells.append(f"{found[-1]:.1f}")
            except RuntimeError as failure:
                print(f"  {failure}")
                cells.append("failed")
        print(f"  {name}: {', '.join(cells)} ({time.perf_counter() - start:.0f} s)", flush=True)
        table.add(f"{name}: {title}", *cells, f"≤ {goals[name]:.0f}", f"{found[-1] / found[0]:.2f}", "≤ 1.1")
    if any("" in row for row in table.rows):
        table.remarks.append("Empty: takes minutes, measured by `--long`.")
    return [table]


def bounds() -> dict[str, dict[str, float]]:
    """Return the largest counts that the test allows, by problem and mesh."""
    kept: dict[str, dict[str, float]] = json.loads(BOUNDS.read_text())
    return kept


def write_bounds() -> None:
    """Measure the problems of the test and allow a little more."""
    measured = {
        name: {str(mesh): math.ceil(MARGIN * problems.count(name, mesh)) for mesh in meshes}
        for name, meshes in BOUNDED.items()
    }
    rows = ",\n".join(f'  "{name}": {json.dumps(row)}' for name, row in measured.items())
    BOUNDS.write_text(f"{{\n{rows}\n}}\n")
    print(BOUNDS.read_text())
