"""Error of the stress below the edge of the stick area, against a lattice three times as fine."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexcontact import Case
from hexcontact.interior import fields
from hexcontact.interior.stress import SOURCES

from .report import Table

BODY = {"young_modulus": 210e9, "poisson_ratio": 0.3}
LOAD, SHEAR, MU, RADIUS, NODES = 1000.0, 180.0, 0.3, 0.02, 30


def solved(nodes: int) -> Any:
    """Return the end of a sphere pressed and sheared, with so many spacings in its radius."""
    last: list = []
    Case(
        body_1={**BODY, "surface": {"shape": "sphere", "radius": RADIUS}},
        body_2=BODY,
        nodes_in_radius=nodes,
        friction_coefficient=MU,
        tolerance=1e-9,
        loads=[{"normal_load": LOAD}, {"tangential_load_x": SHEAR}],
    ).run(on_step=last.append)
    return last[-1]


def measure(*, quick: bool) -> list[Table]:
    """Return the largest error below 24 points of the edge over the largest pressure, by depth."""
    nodes, depths = NODES // 2 if quick else NODES, (0, 1, 2, 4)
    table = Table(
        f"Stress below the edge of the stick area: errors in 10⁻⁴ of p_max, {nodes} spacings in a",
        [
            "source",
            "on the surface",
            *(f"{k} spacings deep" if k > 1 else "1 spacing deep" for k in depths[1:]),
        ],
        remarks=[
            f"Similar bodies, Q = 0.6 µP; six components, 24 points; against {3 * nodes} spacings in a."
        ],
    )
    coarse, fine = solved(nodes), solved(3 * nodes)
    modulus = BODY["young_modulus"] / (2 * (1 - BODY["poisson_ratio"] ** 2))
    radius = (0.75 * LOAD * RADIUS / modulus * (1 - SHEAR / (MU * LOAD))) ** (1 / 3)
    angles, h = np.linspace(-3, 3, 24), coarse.lattice.spacing
    points = np.array([[(radius * np.cos(t), radius * np.sin(t), k * h) for t in angles] for k in depths])
    tensor = [f"stress_{ab}" for ab in fields.COMPONENTS]
    exact, largest = fine.stress_at(points, *tensor).to_array(), float(fine.fields["pressure"].max())
    for source in SOURCES:
        found = coarse.stress_at(points, *tensor, source=source).to_array()
        errors = abs(found - exact).max(["variable", "point_1"]).values / largest
        table.add(
            f"`{source}`",
            *(f"{1e4 * error:.2g}" if error < 1e-2 else f"{1e4 * error:.0f}" for error in errors),
        )
    return [table]
