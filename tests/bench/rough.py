"""Work, time and memory of rough contact without friction in windows that repeat."""

from __future__ import annotations

from collections.abc import Sequence

from . import worker
from .report import Table, seconds

SIZES = (512, 1024, 2048)
LARGEST = 4096
TOLERANCE = 1e-6


def measure(*, quick: bool, long: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Return the table of windows."""
    table = Table(
        "A rough surface pressed without friction to 1e-6 in a window that repeats, one thread",
        [
            *("window", "iterations", "pairs of transforms", "goal", "set-up", "solve", "a pair by numpy"),
            *("bytes a node", "goal", "R_n", "A/A0"),
        ],
        remarks=[
            "H = 0.8, wavelengths of 16 to a quarter of the nodes, mean pressure 0.05 E* times the slope. "
            "A pair of transforms is one of the window in double precision, there and back; those in single "
            "precision count half. Bytes: of the whole process, with the surface as numpy makes it. "
            + ("" if long else f"`--long` measures {LARGEST}², too.")
        ],
    )
    sides = sizes or ((256, 512) if quick else (*SIZES, LARGEST) if long else SIZES)
    for side in sides:
        task = {"problem": "rough", "side": side, "tolerance": TOLERANCE, "repeats": 1}
        answer = worker.run(task, timeout=1800)
        if "failed" in answer:
            table.add(f"{side}²", answer["failed"])
            continue
        table.add(
            f"{side}²",
            str(answer["iterations"]),
            *(f"{answer['pairs']:.1f}", "≤ 25"),
            *(seconds(answer[name]) for name in ("setup", "solve", "pair")),
            *(f"{answer['peak_memory'] / side**2:.0f}", "≤ 150"),
            *(f"{answer['residual']:.0e}", f"{answer['contact_fraction']:.4f}"),
        )
        print(f"  {table.rows[-1]}", flush=True)
    return [table]
