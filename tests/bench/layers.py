"""Work of a step on a compliant layer over that of the same step without one.

A layer p = c psi^m is as soft as its compression under Hertz's largest pressure says, here over Hertz's
approach. Spheres with E* = R = 1 under P = 4/3, each on a window of 1.35 of its own contact radii; spacings
count in Hertz's radius. Steps with several loads count the last one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from hexcontact.core.contact import UNILATERAL, Interface, NormalContact
from hexcontact.core.friction import FrictionalContact
from hexcontact.core.lattice import Lattice

from .problems import ALIKE, DISSIMILAR, LOAD, TOLERANCE, Material, parabola
from .report import Table

EXPONENTS = (1.0, 1.5, 2.0, 3.0)
SOFTNESS = (0.001, 0.003, 0.01, 0.03, 0.1, 1.0)
WINDOW = 1.35


@dataclass(frozen=True)
class Steps:
    """Load steps: normal load over `LOAD` and tangential load over mu P; by_approach: their approaches."""

    title: str
    material: Material | None
    loads: tuple[tuple[float, float], ...]
    by_approach: bool = False


STEPS = {
    "cold-load": Steps("no friction, load", None, ((1, 0),)),
    "cold-approach": Steps("no friction, approach", None, ((1, 0),), by_approach=True),
    "friction-load": Steps("µ = 0.5, load", ALIKE, ((1, 0),)),
    "friction-warm-load": Steps("µ = 0.5, load from 0.8 to 0.9 P", ALIKE, ((0.8, 0), (0.9, 0))),
    "friction-warm-approach": Steps(
        "µ = 0.5, approach of 0.8 to that of 0.9 P", ALIKE, ((0.8, 0), (0.9, 0)), by_approach=True
    ),
    "friction-shear": Steps("µ = 0.5, Q from 0.45 to 0.50 µP", ALIKE, ((1, 0), (1, 0.45), (1, 0.5))),
    "coupled-load": Steps("β = −0.19, µ = 0.1, load", DISSIMILAR, ((1, 0),)),
    "coupled-warm-load": Steps(
        "β = −0.19, µ = 0.1, load from 0.8 to 0.9 P", DISSIMILAR, ((0.8, 0), (0.9, 0))
    ),
}


def lattice(spacings: int, radius: float) -> Lattice:
    """Return a window of 1.35 contact radii, a node at its center."""
    half = int(np.ceil(WINDOW * radius * spacings))
    return Lattice(1 / spacings, -half, -half, 2 * half + 1, 2 * half + 1)


@cache
def size(layer: Interface, share: float) -> tuple[float, float]:
    """Return contact radius and approach under a share of the load, on a coarse lattice."""
    window = lattice(16, 2.6)
    contact = NormalContact(window, ALIKE.pair, parabola(window), threads=1, interface=layer)
    found = contact.solve(normal_load=share * LOAD, tolerance=1e-6)
    area = np.count_nonzero(found.pressure) * np.sqrt(3) / 2 / 16**2
    return float(np.sqrt(area / np.pi)), found.approach


@cache
def work(steps: Steps, spacings: int, layer: Interface) -> float:
    """Return the operator applications of the last load step; nan if it does not converge."""
    window = lattice(spacings, size(layer, 1.0)[0])
    gap = parabola(window)
    values = [size(layer, share)[1] if steps.by_approach else share * LOAD for share, _ in steps.loads]
    if steps.material is None:
        contact = NormalContact(window, ALIKE.pair, gap, threads=1, interface=layer)
        (value,) = values
        target = {"approach" if steps.by_approach else "normal_load": value}
        found = contact.solve(tolerance=TOLERANCE, **target)
        return found.operator_applications if found.converged else float("nan")
    mu = steps.material.friction
    sheared = FrictionalContact(
        window, steps.material.pair, gap, friction_coefficient=mu, threads=1, interface=layer
    )
    control = ["displacement" if steps.by_approach else "force", "force", "force", "displacement"]
    state = sheared.virgin()
    for value, (share, shear) in zip(values, steps.loads, strict=True):
        state = sheared.advance(
            state, control, [value, shear * mu * share * LOAD, 0.0, 0.0], tolerance=TOLERANCE, max_cuts=0
        )
        if not state.converged:
            return float("nan")
    return state.operator_applications


def measure(*, quick: bool, long: bool) -> list[Table]:
    """Return the largest ratios over the softness of the layer, by step, mesh and exponent."""
    table = Table(
        "Operator applications of a load step on a layer, over those without one: largest ratios",
        ["step, spacings in the radius", *(f"m = {m:g}" for m in EXPONENTS), "goal"],
        remarks=[
            "R_n ≤ 10⁻⁸; compressions of the layer under Hertz's largest pressure of "
            f"{', '.join(f'{s:g}' for s in SOFTNESS)} of Hertz's approach."
        ],
    )
    for steps in STEPS.values():
        fine = (160,) if long or steps.material is None else ()
        for mesh in (20,) if quick else (40, 80, *fine):
            base = work(steps, mesh, UNILATERAL)
            ratios = [
                max(work(steps, mesh, (2 / np.pi / s**m, m, 0.0)) / base for s in SOFTNESS) for m in EXPONENTS
            ]
            table.add(f"{steps.title}, {mesh}", *(f"{ratio:.2f}" for ratio in ratios), "≤ 1.2")
            print(f"  {table.rows[-1]}", flush=True)
    return [table]
