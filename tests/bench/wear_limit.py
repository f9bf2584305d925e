"""Limiting shape of a sphere that wears in partial slip, against its closed form (docs/theory/wear.md, V5).

The limit on the lattice is the gap beyond a rigid disc of the nodes that were not worn: what separates it
from the closed form is the lattice, what separates the run from it is the jumps.

OMP_NUM_THREADS=1 python tests/bench/wear_limit.py [NODES] [TOLERANCE] [CYCLES]
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from hexcontact import Case, ElasticPair, NormalContact

MODULUS, RADIUS, CONTACT, MU = 1e11, 1e-2, 1e-4, 0.5
APPROACH, STICK = CONTACT**2 / RADIUS, 0.6 * CONTACT


def limiting_depth(r: Any, stick: float = STICK) -> Any:
    """Return the depth beyond the disc that sticks at which nothing is carried any more."""
    angle, root = np.arcsin(stick / r), np.sqrt(r**2 - stick**2)
    gap = (r**2 * angle - stick * root) / np.pi / RADIUS + APPROACH * (1.0 - 2.0 * angle / np.pi)
    return np.maximum(gap - r**2 / (2.0 * RADIUS), 0.0)


def limit_on_lattice(lattice: Any, gap: Any, disc: Any) -> tuple[Any, float]:
    """Return the depth beyond a disc of nodes that carries all, and the radius of a punch as stiff as it."""
    pair = ElasticPair.from_materials(MODULUS, 0.0, MODULUS, 0.0)
    worn = NormalContact(lattice, pair, gap, disc, rim_warning=False).solve(approach=APPROACH)
    punch = NormalContact(lattice, pair, 0.0 * gap, disc, rim_warning=False).solve(approach=APPROACH)
    # a flat punch of radius c carries 2 E* c d
    return np.where(disc, 0.0, np.maximum(-worn.gap, 0.0)), punch.normal_load / (MODULUS * APPROACH)


def main() -> None:
    """Print the errors of load, of the pressure on the disc and of the depth beyond it."""
    words = (*sys.argv[1:], *("12", "0.1", "3e7")[len(sys.argv) - 1 :])
    nodes, tolerance, cycles = (float(word) for word in words)
    body = {"young_modulus": MODULUS, "poisson_ratio": 0.0}
    shift = MU * (APPROACH - STICK**2 / RADIUS)
    path = [{"shift_x": x, "steps": n} for x, n in ((shift, 2), (-shift, 4), (0.0, 2))]
    result = Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": RADIUS}},
        body_2=body,
        nodes_in_radius=nodes,
        friction_coefficient=MU,
        loads=[{"approach": APPROACH, "shift_x": 0.0}, {"label": "fretting", "path": path}],
        wear={"coefficient_1": 1e-14, "cycle": "fretting", "cycles": int(cycles), "tolerance": tolerance},
    ).run()  # fmt: skip
    data = result.dataset
    last, spacing = data.isel(step=-1), CONTACT / nodes
    pressure, depth = last["pressure"].values, last["worn_depth"].values
    r = np.hypot(last["x"], last["y"]).values
    inside = r < STICK - 1.5 * spacing
    root = np.sqrt(STICK**2 - r[inside] ** 2)
    exact = MODULUS / 2 / np.pi * ((APPROACH - STICK**2 / RADIUS) / root + 2 / RADIUS * root)
    limit = MODULUS * (APPROACH * STICK - STICK**3 / (3 * RADIUS))
    print(f"{(data['wear_cycles'] >= 0).sum().item()} cycles solved")
    print(f"load {float(last['normal_load']) / limit - 1:+.2%}")
    print(f"pressure on the disc {(pressure[inside] / exact - 1).mean():+.2%} in the mean")
    disc = (depth == 0.0) & (r < STICK + 2.0 * spacing)
    on_lattice, radius = limit_on_lattice(result.lattice, last["initial_gap"].values, disc)
    print(f"{disc.sum()} nodes are not worn, like a disc of {radius / STICK:.4f} c")
    largest = limiting_depth(np.linspace(1.001 * STICK, CONTACT)).max()
    for away in (0.5, 1.0, 2.0, 4.0):
        ring = (r > STICK + away * spacing) & (r < 1.2 * CONTACT)
        if not ring.any():
            continue
        exact, same = limiting_depth(r[ring]), limiting_depth(r[ring], radius)
        pairs = ((depth[ring], exact), (depth[ring], same), (depth[ring], on_lattice[ring]))
        whole, by_capacity, jumps = (abs(one - other).max() / largest for one, other in pairs)
        carried = pressure[ring].max() / pressure.max()
        print(
            f"beyond c + {away:g} spacings: depth {whole:.2%}, by the radius of that disc {by_capacity:.2%}, "
            f"by the lattice {jumps:.3%}, pressure {carried:.2%}"
        )


if __name__ == "__main__":
    main()
