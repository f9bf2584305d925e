"""Work of the cycles of wear: a sphere in partial slip, 40 load steps a cycle, 128 x 128 nodes."""

from __future__ import annotations

import numpy as np

from hexcontact import Case

from .report import Table
from .square_window import clock

MODULUS, RADIUS, CONTACT, MU = 1e11, 1e-2, 1e-4, 0.5


def measure(*, quick: bool) -> list[Table]:
    """Return the work of the first cycles and of later ones."""
    count, jump = (4 if quick else 12), 1500
    table = Table(
        f"A cycle of wear: 40 load steps, 128 × 128 nodes, 8,600 in contact, jumps of {jump:,}, one thread",
        ["cycles", "operator applications", "sweeps", "time [s]", "goal"],
        remarks=[
            "Means of the last row are of the last half of the cycles. The goal is a minute for 100 of them."
        ],
    )
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
    moments = [clock()]
    data = case.run(on_step=lambda _: moments.append(clock())).dataset
    cycles = data["wear_cycles"].values >= 0
    names = ("operator_applications", "sweeps")
    work = np.array([*(data[name].values for name in names), np.diff(moments)]).T
    rows = work[cycles]
    for title, row in (
        ("load history, each step from scratch to 10⁻⁸", work[~cycles][1:].sum(0)),
        ("first", rows[0]),
        ("second", rows[1]),
        ("later, mean", rows[len(rows) // 2 :].mean(0)),
    ):
        table.add(
            title, f"{row[0]:.0f}", f"{row[1]:.0f}", f"{row[2]:.2f}", "≤ 0.6" if "later" in title else ""
        )
    return [table]
