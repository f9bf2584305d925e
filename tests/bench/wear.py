"""Work of the cycles of wear: a sphere in partial slip, 40 load steps a cycle, 128 x 128 nodes.

OMP_NUM_THREADS=1 python tests/bench/wear.py [CYCLES] [JUMP]
"""

from __future__ import annotations

import sys
import time

import numpy as np

from hexcontact import Case

MODULUS, RADIUS, CONTACT, MU = 1e11, 1e-2, 1e-4, 0.5


def main() -> None:
    """Print the work of each cycle that was solved."""
    count, jump = (int(word) for word in (*sys.argv[1:], *("8", "1500")[len(sys.argv) - 1 :]))
    approach = CONTACT**2 / RADIUS
    shift = MU * 0.64 * approach  # of which the disc of 0.6 a sticks
    body = {"young_modulus": MODULUS, "poisson_ratio": 0.0}
    path = [{"shift_x": shift, "steps": 10}, {"shift_x": -shift, "steps": 20}, {"shift_x": 0.0, "steps": 10}]
    case = Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": RADIUS}},
        body_2=body,
        spacing=CONTACT / 48,
        window=(128, 128),
        friction_coefficient=MU,
        loads=[{"approach": approach, "shift_x": 0.0}, {"label": "cycle", "path": path}],
        wear={"coefficient_1": 1e-14, "cycle": "cycle", "cycles": jump * count, "jump": jump},
    )
    moments = [time.process_time()]
    data = case.run(on_step=lambda _: moments.append(time.process_time())).dataset
    cycles = data["wear_cycles"].values >= 0
    print("operator applications", data["operator_applications"].values[cycles].round(1))
    print("sweeps", data["sweeps"].values[cycles])
    print("processor time (s)", np.diff(moments)[cycles].round(2))


if __name__ == "__main__":
    main()
