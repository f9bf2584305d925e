"""Limiting shape of a sphere that wears in partial slip: its closed form is (V7) of docs/theory/wear.md.

The limit on the lattice is the gap beyond a rigid disc of the nodes that were not worn: what separates it
from the closed form is the lattice, what separates the run from it is the jumps.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hexcontact import Case, ElasticPair, NormalContact

from .report import Table

MODULUS, RADIUS, CONTACT, MU = 1e11, 1e-2, 1e-4, 0.5
APPROACH, STICK = CONTACT**2 / RADIUS, 0.6 * CONTACT
AWAY = (0.5, 1.0, 2.0, 4.0)
# places of a node from the apex, in spacings along x and y: on it, half an edge away, anywhere
PLACES = (
    (0.0, 0.0),
    (0.5, 0.0),
    (0.5, 0.289),
    (0.25, 0.144),
    (0.13, 0.31),
    (0.37, 0.07),
    (0.21, 0.43),
    (0.42, 0.36),
)


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


def measure(*, quick: bool, long: bool) -> list[Table]:
    """Return the range of the errors over places of the lattice, by spacings in the radius and tolerance."""
    table = Table(
        "Limiting shape after 3·10⁷ cycles: errors against the closed form",
        [
            *("spacings in a, `tolerance`", "cycles solved", "load", "pressure, mean over the disc"),
            *(f"depth beyond c + {away:g}" for away in AWAY),
            *("of it by jumps", "stiff as a disc of, over c"),
        ],
    )
    tasks = [(12, 0.1), (24, 0.1)] + [(24, 0.01), (48, 0.1)] * long
    for nodes, tolerance in tasks[: 1 if quick else None]:
        found = [errors(nodes, tolerance, place) for place in PLACES[: 1 if quick else None]]
        table.add(f"{nodes}, {tolerance:g}", *map(_range, FORMATS, zip(*found, strict=True)))
        print(f"  {table.rows[-1]}", flush=True)
    return [table]


FORMATS = ("d", "+.2%", "+.2%", *(".1%" for _ in AWAY), ".2%", ".4f")


def _range(form: str, values: Any) -> str:
    """Return the least and the largest of some values."""
    least, most = (format(bound(values), form) for bound in (min, max))
    return least if least == most else f"{least} to {most}"


def errors(nodes: int, tolerance: float, place: tuple[float, float]) -> list[float]:
    """Return the cycles solved, errors of load, pressure and depth, that by jumps, and the radius over c."""
    body = {"young_modulus": MODULUS, "poisson_ratio": 0.0}
    shift = MU * (APPROACH - STICK**2 / RADIUS)
    path = [{"shift_x": x, "steps": n} for x, n in ((shift, 2), (-shift, 4), (0.0, 2))]
    result = Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": RADIUS}},
        body_2=body,
        spacing=CONTACT / nodes,
        origin=[each * CONTACT / nodes for each in place],
        friction_coefficient=MU,
        loads=[{"approach": APPROACH, "shift_x": 0.0}, {"label": "fretting", "path": path}],
        wear={"coefficient_1": 1e-14, "cycle": "fretting", "cycles": 30_000_000, "tolerance": tolerance},
    ).run()  # fmt: skip
    data = result.dataset
    last, spacing = data.isel(step=-1), CONTACT / nodes
    pressure, depth = last["pressure"].values, last["worn_depth"].values
    r = np.hypot(last["x"], last["y"]).values
    inside = r < STICK - 1.5 * spacing
    root = np.sqrt(STICK**2 - r[inside] ** 2)
    exact = MODULUS / 2 / np.pi * ((APPROACH - STICK**2 / RADIUS) / root + 2 / RADIUS * root)
    limit = MODULUS * (APPROACH * STICK - STICK**3 / (3 * RADIUS))
    disc = (depth == 0.0) & (r < STICK + 2.0 * spacing)
    on_lattice, radius = limit_on_lattice(result.lattice, last["initial_gap"].values, disc)
    largest = limiting_depth(np.linspace(1.001 * STICK, CONTACT)).max()
    depths = []
    for away in AWAY:
        ring = (r > STICK + away * spacing) & (r < 1.2 * CONTACT)
        depths.append(abs(depth[ring] - limiting_depth(r[ring])).max() / largest)
    beyond = (r > STICK + 0.5 * spacing) & (r < 1.2 * CONTACT)
    return [
        (data["wear_cycles"] >= 0).sum().item(),
        float(last["normal_load"]) / limit - 1,
        (pressure[inside] / exact - 1).mean(),
        *depths,
        abs(depth - on_lattice)[beyond].max() / largest,
        radius / STICK,
    ]
