"""Time and memory of stresses in a box and of critical planes over a cycle, on 256 x 256 nodes.

OMP_NUM_THREADS=1 python tests/bench/below.py
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

import numpy as np

from hexcontact import Case, fatigue

NODES, PLANES, STEPS = 256, 64, 40


def timed(name: str, call: Callable[[], object]) -> None:
    """Print the processor time of a call, and by how much the peak of memory grows."""
    before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    call()
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(
        f"{name}: {time.process_time() - start:.1f} s of the processor, peak memory +{grown / 1024:.0f} MiB"
    )


def main() -> None:
    """Print both."""
    body = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    case = Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": 0.02}},
        body_2=body,
        spacing=1e-5,
        window=(NODES, NODES),
        friction_coefficient=0.3,
        loads=[{"normal_load": 500.0}, {"tangential_load_x": 90.0}],
    )
    result = case.run()
    spacing = result.lattice.spacing
    depths = [spacing * k for k in range(1, PLANES + 1)]
    names = [f"stress_{ab}" for ab in ("xx", "yy", "zz", "xy", "yz", "xz")]
    timed(f"six stresses, {PLANES} planes", lambda: result.stress(*names, depths=depths))
    phase = 2 * np.pi * np.arange(STEPS) / STEPS
    random = np.random.default_rng(1).normal(size=(2, NODES * NODES, 1, 6))
    history = random[0] * np.sin(phase)[:, None] + random[1] * np.cos(phase)[:, None]
    moduli = {"young_modulus": 72e9, "poisson_ratio": 0.33}
    history *= 1e8
    timed("Smith, Watson and Topper", lambda: fatigue.smith_watson_topper(history, **moduli))
    timed("Findley", lambda: fatigue.findley(history, slope=0.3))


if __name__ == "__main__":
    main()
