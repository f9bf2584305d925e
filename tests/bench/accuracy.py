"""Errors at equal nodes, and cost at equal error, against square cells with uniform tractions."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from typing import Any

from . import square_cells, worker
from .report import Table, seconds

FRACTIONS = {"hertz": 0.5, "cattaneo_mindlin": 0.2}
"""Share of the window in contact."""
SIZES = (64, 128, 256, 512)
SHIFTS = ((0.0, 0.0), (0.31, 0.17), (0.62, 0.44), (0.13, 0.71), (0.83, 0.29), (0.47, 0.88))
"""Places of the contact between the nodes, in spacings."""
SHARE = 0.5
"""Tangential load over that of full sliding."""
_TIMES = {"hertz": ("setup", "solve", "correct"), "cattaneo_mindlin": ("setup", "press", "shear", "correct")}
_NAMES = {"hertz": "p", "cattaneo_mindlin": "q"}


def ours(problem: str, side: int, repeats: int = 1, shift: Sequence[float] = (0.0, 0.0)) -> dict[str, Any]:
    """Return the answer of hexcontact to a problem, nu = 0, with the time of all of it as `total`."""
    task: dict[str, Any] = {"problem": problem, "side": side, "fraction": FRACTIONS[problem]}
    if problem == "cattaneo_mindlin":
        task |= {"mu": 0.3, "share": SHARE, "poisson_ratio": 0.0}
    answer = worker.run(task | {"tolerance": 1e-8, "repeats": repeats, "shift": list(shift)})
    if "failed" in answer:
        raise RuntimeError(str(answer["failed"]))
    return answer | {"total": sum(answer[name] for name in _TIMES[problem])}


def errors(problem: str, side: int) -> tuple[float, float]:
    """Return the errors at the nodes, as solved and to the edges, means over places of the contact."""
    answers = [ours(problem, side, shift=shift) for shift in SHIFTS]
    solved, shown = ([answer[name] for answer in answers] for name in ("l2_nodes", "l2_to_edges"))
    return sum(solved) / len(SHIFTS), sum(shown) / len(SHIFTS)


def least_side(problem: str, side: int, error: float) -> int:
    """Return the smallest of some windows on which tractions to the edges have at most an error."""
    sides = [2 * round(k / 32 * side / 2) for k in range(6, 33)]
    return sides[bisect.bisect_left(sides[:-1], True, key=lambda least: errors(problem, least)[1] <= error)]


def measure(quick: bool, sizes: Sequence[int] | None = None) -> list[Table]:
    """Measure both tables."""
    equal_nodes = Table(
        "L2 errors at equal nodes",
        [
            *("window and field", "square cells", "nodes, as solved", "÷ square cells"),
            *("nodes, to the edges", "÷ square cells", "goal"),
        ],
    )
    equal_error = Table(
        "Cost at the error of square cells, one thread",
        [
            *("window of square cells and field", "error", "ours, same window [s]"),
            *("ours, same error", "[s]", "times faster"),
        ],
    )
    for side in sizes or (SIZES[:2] if quick else SIZES):
        for problem, name in _NAMES.items():
            fraction = FRACTIONS[problem]
            found = [square_cells.errors(side, fraction, SHARE, shift)[name == "q"] for shift in SHIFTS]
            squares = sum(found) / len(SHIFTS)
            solved, shown = errors(problem, side)
            equal_nodes.add(
                *(f"{side}², {name}", f"{squares:.1e}", f"{solved:.1e}", f"{solved / squares:.2f}"),
                *(f"{shown:.1e}", f"{shown / squares:.2f}", "≤ 0.5"),
            )
            print(f"  {equal_nodes.rows[-1]}", flush=True)
            least = least_side(problem, side, squares)
            full, small = (ours(problem, n, repeats=5)["total"] for n in (side, least))
            equal_error.add(
                *(f"{side}², {name}", f"{squares:.1e}", seconds(full)),
                *(f"{least}²", seconds(small), f"{full / small:.1f}"),
            )
            print(f"  {equal_error.rows[-1]}", flush=True)
    equal_nodes.remarks.append(
        "p: Hertz, half of the window in contact; q: Cattaneo and Mindlin, ν = 0, Q = µP/2, a fifth in "
        f"contact; means over {len(SHIFTS)} places of the contact between the nodes."
    )
    equal_error.remarks.append("Times are set-up, solution and correction at the edges, the best of five.")
    return [equal_nodes, equal_error]
