"""Checks of rolling bodies: linear theory, a table of nonlinear loads, and the middle of a roller."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

from hexcontact.core.contact import ElasticPair, FlexibilityOperator
from hexcontact.core.friction import FrictionalContact, Rolling
from hexcontact.core.lattice import Lattice

from .reference import Comparison, Known

REFERENCES = Path(__file__).parents[1] / "reference"
STEADY = Rolling(0.0, steady=True)
F, D = "force", "displacement"
SPACINGS = (24, 48)  # in both half-axes of two lattices; errors are of first order
NAMES = ("C11", "C22", "C23", "C33")


def _read(name: str) -> list[dict[str, str]]:
    lines = [line for line in (REFERENCES / name).read_text().splitlines() if line[0] != "#"]
    return list(csv.DictReader(lines))


def rows(kind: str) -> list[dict[str, str]]:
    """Return the rows of one kind of an independent calculation."""
    return [row for row in _read("rolling.csv") if row["case"].startswith(kind)]


def printed() -> list[dict[str, str]]:
    """Return the rows of the printed table of Kalker."""
    return _read("kalker.csv")


class Ellipse:
    """A contact ellipse with half-axes a along the rolling direction and b, ab = 1, under p0 = G = 1."""

    def __init__(self, ratio: float, spacings: int, poisson_ratio: float, friction: float) -> None:
        along, across = math.sqrt(ratio), math.sqrt(1.0 / ratio)
        side = 2 * spacings + 5
        lattice = Lattice(
            *(along / spacings, -spacings - 2, -spacings - 2, side, side),
            *((0.3 * along / spacings, 0.2 * across / spacings), across / along, math.pi / 2),
        )
        square = (lattice.x / along) ** 2 + (lattice.y / across) ** 2
        pressure = np.sqrt(np.maximum(1.0 - square, 0.0))
        pair = ElasticPair((1.0 - poisson_ratio) / math.pi, 0.0, poisson_ratio / math.pi)
        closing = FlexibilityOperator(lattice, pair).apply(pressure)[0]
        self.contact = FrictionalContact(
            *(lattice, pair, 2.0 * closing.max() - closing, pressure > 0.0),
            friction_coefficient=friction,
            rim_warning=False,
            threads=1,
        )
        self.load = float(pressure.sum() * lattice.cell_area)
        self.radius = math.sqrt(float((pressure > 0.0).sum()) * lattice.cell_area / math.pi)
        self.state = self.contact.virgin()

    def loads(self, creepages: list[tuple[float, float, float]]) -> np.ndarray:
        """Return the loads along x and y and the torque of creepages."""
        loads, work, self.state = self.contact.creep_loads(self.state, F, self.load, creepages, STEADY)
        assert len(work) == len(creepages)
        return loads


def coefficients(
    ratio: float, poisson_ratio: float, spacings: tuple[int, int] = SPACINGS
) -> dict[str, float]:
    """Return the coefficients of Kalker, extrapolated from two lattices."""
    found = []
    for count in spacings:
        ellipse = Ellipse(ratio, count, poisson_ratio, math.inf)
        c = ellipse.radius
        along, across, spun = ellipse.loads([(-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)])
        by_spin = 0.5 * (spun[1] - across[2])  # C23 = -C32, but for the lattice
        found.append([along[0] / c**2, across[1] / c**2, by_spin / c**3, spun[2] / c**4])
    return dict(zip(NAMES, (2.0 * np.array(found[1]) - found[0]).tolist(), strict=True))


def strip(
    spacings: int, length: float, friction: float, beta: float = 0.0, behind: float = 1.0
) -> tuple[FrictionalContact, Lattice, float]:
    """Return a roller with p0 = a = E* = 1, cells 1:32, and its normal load.

    The first node in contact is `behind` spacings behind the front; 1: there are nodes at both edges.
    """
    ratio, h = 32, 1.0 / spacings
    rows, cols = round(length / 2 / (h * ratio)), round(1.15 * spacings)
    origin = (h / 2 if beta else (1.0 - behind) * h, 0.0)
    lattice = Lattice(h, -rows - 2, -cols, 2 * rows + 5, 2 * cols + 1, origin, ratio, math.pi / 2)
    inside = np.abs(lattice.y) <= length / 2
    pressed = np.where(inside, np.sqrt(np.maximum(1.0 - lattice.x**2, 0.0)), 0.0)
    pair = ElasticPair(1 / math.pi, beta / math.pi, 0.3 / 0.7 / math.pi)
    closing = FlexibilityOperator(lattice, pair).apply(pressed)[0]
    if beta:  # the pressure is found: a parabola whose ends do not press more than its middle
        middle = np.argmin(np.abs(lattice.x[0]))
        gap = lattice.x**2 + closing.max() - closing[:, [middle]]
        touching = inside
    else:
        gap, touching = closing.max() + 1.0 - closing, pressed > 0.0
    contact = FrictionalContact(
        lattice, pair, gap, touching, friction_coefficient=friction, rim_warning=False
    )
    return contact, lattice, float(pressed.sum() * lattice.cell_area)


def in_the_middle(lattice: Lattice, state: Any) -> float:
    """Return Q/P of the row in the middle."""
    row = int(np.argmin(np.abs(lattice.y[:, 0])))
    return float(state.traction_x[row].sum() / state.pressure[row].sum())


def linear() -> Comparison:
    """Coefficients of the linear theory against an independent calculation and the printed table."""
    found = Comparison()
    own = {(float(r["nu"]), float(r["a/b"]), r["quantity"]): r for r in rows("linear")}
    for row in printed():
        poisson_ratio, ratio = float(row["nu"]), float(row["a/b"])
        for name, value in coefficients(ratio, poisson_ratio).items():
            case = f"a/b = {ratio:.3g}, nu = {poisson_ratio:g}"
            found.add(case, name, "-", value, row=Known(reference=float(row[name])), relative=0.02)
            if known := own.get((poisson_ratio, ratio, name)):
                reference, error = Known(reference=float(known["own"])), float(known["uncertainty"])
                found.add(f"{case}, calculated", name, "-", value, row=reference, absolute=2 * error)
    return found


def nonlinear() -> Comparison:
    """Loads of a circle, nu = 0.25, against an independent calculation."""
    found, names = Comparison(), ("Fx", "Fy", "Mz")
    creepages = dict.fromkeys((r["xi"], r["eta"], r["phi"]) for r in rows("nonlinear"))
    for creepage in creepages:
        loads = []
        for spacings in SPACINGS:
            circle = Ellipse(1.0, spacings, 0.25, 1.0)
            loads.append(circle.loads([tuple(map(float, creepage))])[0] / circle.load)
        limit = dict(zip(names, 2.0 * np.array(loads[1]) - loads[0], strict=True))
        for row in rows("nonlinear"):
            if (row["xi"], row["eta"], row["phi"]) == creepage:
                known, error = Known(reference=float(row["own"])), float(row["uncertainty"])
                case = "xi, eta, phi = " + ", ".join(creepage)
                found.add(
                    case, row["quantity"], "-", float(limit[row["quantity"]]), row=known, absolute=error
                )
    return found


def carter() -> Comparison:
    """Middle of a roller, 50 spacings in the half-width, against Carter's plane solution."""
    found = Comparison()
    contact, lattice, load = strip(50, 40.0, 1.0)
    state = contact.virgin()
    for row in rows("Carter"):
        creepage = float(row["xi"])
        state = contact.advance(state, [F, D, D, D], [load, creepage, 0, 0], rolling=STEADY)
        exact = 1.0 - (1.0 - abs(creepage) / 2) ** 2
        case = f"xi = {creepage:g} mu p0/E*"
        found.add(case, "Q/mu P", "-", in_the_middle(lattice, state), analytic=exact, relative=3e-3)
    return found
