"""Work of a load history under laws of the interface over that under one coefficient and no layer.

A sphere on a rigid plane, E = R = 1, 20 spacings in the contact radius, is pressed in three load steps and
sheared to half of mu P in four. The softness s of a layer is its compression under
Hertz's largest pressure over Hertz's approach.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from statistics import mean
from typing import Any

import numpy as np

from hexcontact import Case

from .report import Table

LOAD, MU = 1e-3, 0.3
SOFTNESS = (0.01, 0.1, 1.0)
OWN_LIMIT = 0.1  # softness of the layers with a limit of their own
RATIOS, ANGLES = (1.25, 2.0, 4.0), (0, 20, 45, 70)
STEPS = ({"normal_load": LOAD, "steps": 3}, {"tangential_load_x": 0.5 * MU * LOAD, "steps": 4})


@dataclass(frozen=True)
class Sphere:
    """A sphere of E = R = 1 on a rigid plane, without a layer."""

    poisson_ratio: float

    @property
    def modulus(self) -> float:
        """Effective modulus."""
        return 1 / (1 - self.poisson_ratio**2)

    @property
    def largest_pressure(self) -> float:
        """Hertz's largest pressure."""
        return float(np.cbrt(6 * LOAD * self.modulus**2 / np.pi**3))

    @property
    def approach(self) -> float:
        """Hertz's approach; the contact radius is its square root."""
        return float(np.cbrt(9 * LOAD**2 / (16 * self.modulus**2)))

    def layer(self, exponent: float, softness: float, own_limit: bool = False) -> Mapping[str, Any]:
        """Return the table of a layer, with a limit of friction of its own that grows one power faster."""
        compression = softness * self.approach
        table = {"exponent": exponent, "coefficient": self.largest_pressure / compression**exponent}
        if own_limit:
            table["friction_exponent"] = exponent + 1
            table["friction_coefficient"] = MU * self.largest_pressure / compression ** (exponent + 1)
        return table

    def work(self, **law: Any) -> float:
        """Return the operator applications of all load steps."""
        if "interface" not in law or "friction_coefficient" not in law["interface"]:
            law = {"friction_coefficient": MU, **law}
        sphere = {
            "young_modulus": 1.0,
            "poisson_ratio": self.poisson_ratio,
            "surface": {"shape": "sphere", "radius": 1.0},
        }
        case = Case(
            body_1=sphere, body_2={"rigid": True}, nodes_in_radius=20, loads=STEPS, method="fft", **law
        )
        return float(case.run().dataset.operator_applications.sum())


@cache
def unchanged(sphere: Sphere) -> float:
    """Return the work under one coefficient and no layer."""
    return sphere.work()


def by_direction(sphere: Sphere, ratio: float) -> float:
    """Return the mean work of a friction that depends on the direction, over several of its axes."""
    across = MU / ratio**0.5
    axes = [{"along": ratio * across, "across": across, "angle": f"{angle} deg"} for angle in ANGLES]
    return mean(sphere.work(friction_coefficient=mu) for mu in axes)


Laws = Mapping[str, list[Callable[[Sphere], float]]]
LAWS: Laws = {
    "µ + µ/6 tanh(4x/a)": [
        lambda sphere: sphere.work(friction_coefficient=f"0.3 + 0.05*tanh(4*x/{sphere.approach**0.5})")
    ],
    "bound of the shear traction, 0.7 µ p₀": [
        lambda sphere: sphere.work(shear_limit=0.7 * MU * sphere.largest_pressure)
    ],
    **{
        f"layer, m = {m}, s = {', '.join(f'{s:g}' for s in SOFTNESS)}": [
            lambda sphere, m=m, s=s: sphere.work(interface=sphere.layer(m, s)) for s in SOFTNESS
        ]
        for m in (1, 2)
    },
    f"layer with its own limit, m_t = m + 1, m = 1, 2, s = {OWN_LIMIT:g}": [
        lambda sphere, m=m: sphere.work(interface=sphere.layer(m, OWN_LIMIT, own_limit=True)) for m in (1, 2)
    ],
    f"µ₁/µ₂ = {', '.join(f'{ratio:g}' for ratio in RATIOS)}, mean of four directions": [
        lambda sphere, ratio=ratio: by_direction(sphere, ratio) for ratio in RATIOS
    ],
}


def measure(*, quick: bool) -> list[Table]:
    """Return the ratios of the work, by law and sphere."""
    spheres = {"ν = 0.5, no coupling": Sphere(0.5), "ν = 0.3, β = 0.29": Sphere(0.3)}
    table = Table(
        "Operator applications of a load history, over those with one coefficient and no layer",
        ["law", *spheres],
        remarks=[
            "A sphere on a rigid plane, µ = 0.3, 20 spacings in the contact radius a, pressed in three "
            "load steps and sheared to 0.5 µP in four; √(µ₁µ₂) = 0.3, the load at "
            f"{', '.join(map(str, ANGLES))}° to the first axis."
        ],
    )
    for law, cases in LAWS.items():
        ratios = [
            ", ".join(f"{work(sphere) / unchanged(sphere):.2f}" for work in cases[: 1 if quick else None])
            for sphere in spheres.values()
        ]
        table.add(law, *ratios)
        print(f"  {table.rows[-1]}", flush=True)
    return [table]
