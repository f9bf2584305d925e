"""Time whole solves of two builds side by side: with FFTW and pocketfft, or for other processors.

    python tests/bench/transforms.py FOLDER FOLDER

Each folder holds a package hexcontact (of `pip install --target`). Processes of one thread alternate; the
least processor time of all turns counts. Prints rows for docs/tuning.md.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

SPACINGS = 18.7 / 51
"""Spacings in the contact radius, over the side: half of the window is in contact."""
TASKS = [
    (31, "without friction"),
    (128, "without friction"),
    (512, "without friction"),
    (31, "10 steps with friction"),
    (128, "10 steps with friction"),
    (512, "10 steps with friction"),
]
TURNS = 7


def solve(side: int, kind: str) -> dict[str, Any]:
    """Return the processor time of a solution after set-up, and its pressures as shares of the largest."""
    sys.path.insert(1, str(Path(__file__).parents[1]))
    from bench import problems
    from hexcontact.core.lattice import Lattice

    window = Lattice(1 / (SPACINGS * side), -(side // 2), -(side // 2), side, side)
    least = float("inf")
    for _ in range(2 if side > 200 else 5):
        if kind == "without friction":
            hertz = problems.hertz_contact(window)
            start = time.process_time()
            pressure = hertz.solve(normal_load=problems.LOAD, tolerance=problems.TOLERANCE).pressure
        else:
            contact = problems.frictional_contact(problems.DISSIMILAR, window)
            start = time.process_time()
            state = contact.virgin()
            for step in range(1, 11):
                shear = 0.18 * max(step - 5, 0) * problems.DISSIMILAR.friction
                target = (min(step, 5) / 5 * problems.LOAD, shear * problems.LOAD, 0.0, 0.0)
                state = contact.advance(state, problems.FORCE, target, tolerance=problems.TOLERANCE)
            pressure = state.pressure
        least = min(least, time.process_time() - start)
    return {"seconds": least, "pressure": (pressure / pressure.max()).ravel().tolist()}


def main() -> None:
    """Alternate the folders, print a row for each task."""
    if len(sys.argv) == 4 and sys.argv[1] == "solve":
        print(json.dumps(solve(int(sys.argv[2]), sys.argv[3])))
        return
    for side, kind in TASKS:
        times: list[list[float]] = [[], []]
        found: list[list[float]] = [[], []]
        for _ in range(TURNS):
            for which, folder in enumerate(sys.argv[1:3]):
                words = [sys.executable, __file__, "solve", str(side), kind]
                environment = os.environ | {"PYTHONPATH": folder, "OMP_NUM_THREADS": "1"}
                answer = json.loads(
                    subprocess.run(words, env=environment, check=True, stdout=subprocess.PIPE).stdout
                )
                times[which].append(answer["seconds"])
                found[which] = answer["pressure"]
        first, second = (1e3 * min(turns) for turns in times)
        apart = max(abs(a - b) for a, b in zip(*found, strict=True))
        print(
            f"| {side} × {side} | {kind} | {float(f'{first:.3g}'):g} | {float(f'{second:.3g}'):g} "
            f"| {second / first:.2f} | {apart:.0e} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
