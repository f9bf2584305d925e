"""Contacts with friction as the checks need them: solved, and read step by step."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexcontact import analytic
from hexcontact.case import Case
from hexcontact.core import flat
from hexcontact.core.contact import ElasticPair
from hexcontact.deck.surfaces import Sphere, Surface
from hexcontact.result.result import Result

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FIELDS = ("pressure", "traction_x", "traction_y", "zone")
STICK = 1  # zone of a sticking node
DIGITS = 1e-6  # the reference table has seven
TOLERANCE = 1e-9  # of the solver, so that it does not blur them


@dataclass(frozen=True)
class State:
    """The end of a load step; SI."""

    x: Array
    y: Array
    pressure: Array
    traction_x: Array
    traction_y: Array
    zone: NDArray[np.int8]
    spacing: float
    history: Mapping[str, float]

    def __getitem__(self, name: str) -> float:
        """Return a quantity of the history."""
        return self.history[name]

    @property
    def contact(self) -> Mask:
        """Nodes in contact."""
        return np.asarray(self.zone > 0)

    @property
    def stick(self) -> Mask:
        """Nodes that stick."""
        return np.asarray(self.zone == STICK)

    @property
    def peak(self) -> float:
        """p_max."""
        return float(self.pressure.max())

    @functools.cached_property
    def traction(self) -> Array:
        """Length of the shear traction |q|."""
        return np.asarray(np.hypot(self.traction_x, self.traction_y))

    @property
    def area_radius(self) -> float:
        """a_A."""
        return flat.area_radius(self.contact, math.sqrt(0.75) * self.spacing**2)

    @property
    def stick_radius(self) -> float:
        """c_A."""
        return flat.area_radius(self.stick, math.sqrt(0.75) * self.spacing**2)

    @property
    def edge_radius(self) -> float:
        """A from p^2 at the edge, about x = y = 0."""
        cell = np.sqrt(0.75) * self.spacing**2
        return flat.edge_radius(self.x, self.y, self.pressure, self.spacing, cell)

    @property
    def stick_fraction(self) -> float:
        """Share of the stick area in the contact area."""
        return float(np.count_nonzero(self.stick) / np.count_nonzero(self.contact))

    @property
    def two_nodes(self) -> float:
        """Change of c_A/a_A by two more sticking nodes: some are between stick and slip to all digits."""
        return self.stick_radius / self.area_radius / max(int(np.count_nonzero(self.stick)), 1)

    def stick_axes(self, friction_coefficient: float) -> tuple[float, float]:
        """Semi-axes (m) of the stick zone along x and y, to a fraction of the spacing.

        (mu p - |q|)^2 is linear in x^2 and y^2 inside the edge of the zone, as p^2 is at the edge of the
        contact; the line is fitted to the same rings of nodes as in `flat.edge_radius`.
        """
        reserve = friction_coefficient * self.pressure - self.traction
        around, r = self.stick_radius, np.hypot(self.x, self.y)
        band = self.stick & (r >= around - 6.0 * self.spacing) & (r <= around - self.spacing)
        x2, y2 = (self.x[band] / around) ** 2, (self.y[band] / around) ** 2
        forms = np.stack([np.ones_like(x2), x2, y2], axis=1)
        start, along_x, along_y = np.linalg.lstsq(forms, (reserve[band] / self.peak) ** 2, rcond=None)[0]
        return around * math.sqrt(-start / along_x), around * math.sqrt(-start / along_y)

    def radial(self) -> Array:
        """Radial part of the shear traction on body 1."""
        r = np.hypot(self.x, self.y)
        along = self.traction_x * self.x + self.traction_y * self.y
        return np.asarray(np.divide(along, r, out=np.zeros_like(r), where=r > 0.0))


class Run:
    """A solved history.

    Parameters
    ----------
    result : Result
        What the solver returned.
    pair : ElasticPair
        Compliances of the bodies.
    seconds : float
        Wall time, preparing the case included.
    """

    def __init__(self, result: Result, pair: ElasticPair, seconds: float) -> None:
        self.result = result
        self.pair = pair
        self.seconds = seconds

    def __len__(self) -> int:
        """Return the number of load steps."""
        return len(self.result)

    def __getitem__(self, number: int) -> State:
        """Return a step: the first is 1, the last -1."""
        step = self.result.step(number)
        return State(
            x=step["x"].values,
            y=step["y"].values,
            pressure=step["pressure"].values,
            traction_x=step["traction_x"].values,
            traction_y=step["traction_y"].values,
            zone=step["zone"].values,
            spacing=self.result.lattice.spacing,
            history={
                str(name): float(value)
                for name, value in step.data_vars.items()
                if value.ndim == 0 and value.dtype.kind in "fi"
            },
        )


def run(body_1: Mapping[str, Any], body_2: Mapping[str, Any], **arguments: Any) -> Run:
    """Solve a history with friction; arguments as of `hexcontact.Case`, incremental by default."""
    started = time.perf_counter()
    settings = {"algorithm": "incremental", "tolerance": TOLERANCE, "method": "fft", "fields": FIELDS}
    case = Case(body_1=body_1, body_2=body_2, **{**settings, **arguments})
    result = case.run()
    return Run(result, case.pair, time.perf_counter() - started)


# ------------------------------------------------------------------------------- bodies and loads

STIFF: dict[str, Any] = {"young_modulus": 432e9, "poisson_ratio": 0.32}  # section 9.2
ALUMINUM: dict[str, Any] = {"young_modulus": 72e9, "poisson_ratio": 0.32}
BALL = Sphere(radius=1e-3)
RIGID: dict[str, Any] = {"rigid": True}


def hertz_of(pair: ElasticPair, normal_load: float, radius: float = 1e-3) -> analytic.AxisymmetricContact:
    """Return the frictionless contact of a sphere."""
    return analytic.hertz_sphere(pair.effective_modulus, radius, normal_load=normal_load)


def dissimilar_pair() -> ElasticPair:
    """Return the pair of section 9.2."""
    return ElasticPair.from_materials(432e9, 0.32, 72e9, 0.32)


def bodies(beta: float, gamma: float, surface: Surface) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return two elastic bodies with E* = 1 Pa; `surface` is body 1's.

    Both have the Poisson's ratio gamma/(1 + gamma); their moduli make Dundurs' constant beta, which is
    bounded by 2 |beta| < 1 - gamma.
    """
    nu = gamma / (1.0 + gamma)
    modulus, part = 2.0 * (1.0 - nu**2), 2.0 * beta / (1.0 - gamma)
    first, second = (
        {"young_modulus": modulus / (1.0 + sign * part), "poisson_ratio": nu} for sign in (1.0, -1.0)
    )
    return {**first, "surface": surface}, second


def shear_compliance(pair: ElasticPair) -> float:
    """Return S = sum (2 - nu)/G (1/Pa), the compliance of a shear force."""
    return 4.0 * math.pi * (pair.lambda_1 + 0.5 * pair.lambda_5)


def twist_compliance(pair: ElasticPair) -> float:
    """Return S_t = sum 1/G (1/Pa), the compliance of a torque."""
    return 2.0 * math.pi * (pair.lambda_1 + pair.lambda_5)


def press(normal_load: float, steps: int, ramp: str = "cubic") -> dict[str, Any]:
    """Return a load segment that presses."""
    return {"normal_load": normal_load, "steps": steps, "ramp": ramp}


def each(key: str, values: Sequence[float]) -> list[dict[str, Any]]:
    """Return one load segment of one step for each value of a load or motion."""
    return [{key: float(value)} for value in values]
