"""Hertz and Cattaneo-Mindlin contact on a window of n x n nodes, and how well an answer solves them.

Imported by the runner of every code with that code's own Python: numpy only, no hexcontact. Units:
effective modulus 1, relative radius of curvature 1, side of the window 1; nodes in the middle of
square cells.
"""

from __future__ import annotations

import json
import os
import re
import resource
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

Array = Any


def clock() -> float:
    """Return seconds: processor time is less disturbed on a busy machine, and holds for one thread only."""
    return time.process_time() if os.environ.get("BENCH_CLOCK") == "cpu" else time.perf_counter()


@dataclass(frozen=True)
class HertzContact:
    """A parabolic contact, effective modulus 1, relative radius 1, contact radius `a`, on given nodes."""

    x: Array
    y: Array
    a: float
    cell_area: float
    self_compliance: float
    """Displacement of a node under its own pressure 1."""

    @property
    def gap(self) -> Array:
        return (self.x**2 + self.y**2) / 2

    @property
    def load(self) -> float:
        return 4 / 3 * self.a**3

    @property
    def pressure(self) -> Array:
        return hemisphere(self.x, self.y, self.a)

    def errors(self, pressure: Array, gap: Array, approach: float) -> dict[str, float]:
        """Differences from Hertz, and the residual of the discrete problem: R_n of the theory page."""
        exact = self.pressure
        largest = pressure.max()
        unbalanced = pressure - np.maximum(0.0, pressure - gap / self.self_compliance)
        return {
            "max_pressure": float(largest / exact.max() - 1),
            "approach": float(approach / self.a**2 - 1),
            "l2_pressure": relative_difference(pressure, exact),
            "residual": float(np.abs(unbalanced).max() / largest),
            "load": float(pressure.sum() * self.cell_area / self.load - 1),
            "contact_fraction": float(np.mean(pressure > 0)),
        }


def hemisphere(x: Array, y: Array, radius: float) -> Array:
    """Pressure of Hertz's contact of that radius."""
    return 2 / np.pi * np.sqrt(np.clip(radius**2 - x**2 - y**2, 0, None))


def relative_difference(values: Array, exact: Array) -> float:
    """Difference of two fields in the L2 norm."""
    return float(np.linalg.norm(values - exact) / np.linalg.norm(exact))


def square_window(n: int, fraction: float, shift: Sequence[float] = (0.0, 0.0)) -> HertzContact:
    """Return the problem on n x n square cells of a window of side 1, a `fraction` of it in contact.

    `shift` moves the cells, in parts of one along x and y.
    """
    h = 1.0 / n
    middle = (np.arange(n) + 0.5) * h - 0.5
    x, y = np.meshgrid(middle + shift[0] * h, middle + shift[1] * h, indexing="ij")
    # uniform pressure 1 on a square, at its center (Love)
    own = 4 * np.log(1 + np.sqrt(2)) * h / np.pi
    return HertzContact(x, y, float(np.sqrt(fraction / np.pi)), h * h, float(own))


@dataclass(frozen=True)
class RoughWindow:
    """One period, of side 1, of a rough surface on a flat; effective modulus 1."""

    gap: Array
    mean_pressure: float

    def errors(self, pressure: Array, gap: Array) -> dict[str, float]:
        """Residual of the discrete problem, and numbers to compare codes with."""
        # uniform pressure 1 on a square, at its center (Love); the same scale for all codes
        own = 4 * np.log(1 + np.sqrt(2)) / len(self.gap) / np.pi
        unbalanced = pressure - np.maximum(0.0, pressure - gap / own)
        return {
            "residual": float(np.abs(unbalanced).max() / pressure.max()),
            "contact_fraction": float(np.mean(pressure > 0)),
            "mean_gap": float(gap.mean() / np.std(self.gap)),
            "mean_pressure": float(pressure.mean() / self.mean_pressure - 1),
        }


def rough_window(n: int, seed: int = 1) -> RoughWindow:
    """Return a self-affine surface, H = 0.8, waves of 16 to n/4 spacings, under 0.05 E* times its slope."""
    number = np.hypot(*np.meshgrid(np.fft.fftfreq(n, 1 / n), np.fft.rfftfreq(n, 1 / n), indexing="ij"))
    share = np.where((number >= 4) & (number <= n / 16), np.maximum(number, 1.0) ** -1.8, 0.0)
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((n, n))) * share
    twice = np.where((np.arange(n // 2 + 1) % (n // 2)) == 0, 1.0, 2.0)
    slope = float(np.sqrt(np.sum(twice * (2 * np.pi * number) ** 2 * np.abs(noise) ** 2)) / n**2)
    heights = np.fft.irfft2(noise, s=(n, n)) * (0.1 / slope)
    return RoughWindow(heights - heights.min(), 0.05 * 0.1)


def shear_errors(
    contact: HertzContact, stick: Array, traction_x: Array, mu: float, share: float
) -> dict[str, float]:
    """Differences from Cattaneo and Mindlin for Q = share * mu * P.

    Their solution lets slip go along x alone, which is exact for nu = 0: for nu = 0.33 some tenths of
    a percent of the L2 difference are theirs.
    """
    c = contact.a * (1 - share) ** (1 / 3)
    exact = mu * (contact.pressure - hemisphere(contact.x, contact.y, c))
    found = np.sqrt(np.count_nonzero(stick) * contact.cell_area / np.pi)
    return {
        "stick_radius": float(found / c - 1),
        "l2_traction": relative_difference(traction_x, exact),
        "shear_load": float(traction_x.sum() * contact.cell_area / (share * mu * contact.load) - 1),
    }


def best_of(repeats: int, run: Callable[[], Any]) -> tuple[float, Any]:
    """Return the shortest time of several runs, and the last answer."""
    best, answer = float("inf"), None
    for _ in range(repeats):
        start = clock()
        answer = run()
        best = min(best, clock() - start)
    return best, answer


def peak_memory() -> int:
    """Most memory that the process had so far, in bytes."""
    status = Path("/proc/self/status")
    if status.exists():
        # unlike ru_maxrss it does not start from the memory of the process that started this one
        found = re.search(r"VmHWM:\s*(\d+) kB", status.read_text())
        if found:
            return 1024 * int(found[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main(solvers: dict[str, Callable[..., dict[str, Any]]]) -> None:
    """Read the problem, a JSON object, from the command line and print the answer as one line of JSON."""
    task = json.loads(sys.argv[1])
    try:
        answer = solvers[task.pop("problem")](**task)
    except Exception as failure:  # a code that fails is a result, too
        answer = {"failed": f"{type(failure).__name__}: {failure}"}
    answer["peak_memory"] = peak_memory()
    print(json.dumps(answer))
