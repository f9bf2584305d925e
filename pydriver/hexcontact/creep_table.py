"""Read a creep table of ``hexcontact study``: loads by creepages and spin, in the steady state of rolling.

This file needs nothing else and may be copied into another program; creep_table.h and creep_table.f90 beside
it in ``data`` do the same in C and Fortran.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import product
from pathlib import Path


class CreepTable:
    """Loads on body 1 by creepages and spin, interpolated by cubics with continuous slopes.

    Parameters
    ----------
    axes
        Values of creepage x and y at the pole, and of the spin [rad/m]; an axis that begins at 0 stands for
        both signs.
    pole
        Point of the contact whose creepages are those of the axes [m].
    limit
        mu P [N].
    loads
        Loads along x and y [N] and torque [N m], creepage x the fastest.
    """

    def __init__(
        self,
        axes: Sequence[Sequence[float]],
        pole: Sequence[float],
        limit: float,
        loads: Sequence[Sequence[float]],
    ) -> None:
        self.axes, self.pole, self.limit, self.loads = axes, pole, limit, loads

    @classmethod
    def read(cls, path: str | Path) -> CreepTable:
        """Return the table of a file.

        Parameters
        ----------
        path
            Text that ``hexcontact study`` writes.

        Returns
        -------
        CreepTable
            The table.
        """
        lines = Path(path).read_text(encoding="utf-8").splitlines()
        words = iter(" ".join(line for line in lines if line[:1] != "#").split())
        counts = [int(next(words)) for _ in range(3)]
        pole, limit = [float(next(words)) for _ in range(2)], float(next(words))
        axes = [[float(next(words)) for _ in range(count)] for count in counts]
        size = counts[0] * counts[1] * counts[2]
        return cls(axes, pole, limit, [[float(next(words)) for _ in range(3)] for _ in range(size)])

    def __call__(self, creepage_x: float, creepage_y: float, spin: float) -> tuple[float, float, float]:
        """Return the loads along x and y [N] and the torque [N m] on body 1.

        Beyond the table all three motions are reduced by one factor, which is right where all points slip.

        Parameters
        ----------
        creepage_x, creepage_y
            Velocity of body 1 less that of body 2, over that of rolling.
        spin
            The same of their angular velocities [rad/m].

        Returns
        -------
        tuple of float
            The loads and the torque.
        """
        at = [creepage_x - spin * self.pole[1], creepage_y + spin * self.pole[0], spin]
        sign_x = sign = 1.0
        if self.axes[2][0] == 0.0 and at[2] < 0.0:
            at, sign = [at[0], -at[1], -at[2]], -1.0
        if self.axes[0][0] == 0.0 and at[0] < 0.0:
            at[0], sign_x = -at[0], -1.0
        ends = [axis[-1] if value > 0.0 else axis[0] for axis, value in zip(self.axes, at, strict=True)]
        over = max(1.0, *(value / end for value, end in zip(at, ends, strict=True) if end != 0.0))
        x, y, z = (_weights(axis, value / over) for axis, value in zip(self.axes, at, strict=True))
        found = [0.0, 0.0, 0.0]
        for (k, c), (j, b), (i, a) in product(z, y, x):
            row = self.loads[(k * len(self.axes[1]) + j) * len(self.axes[0]) + i]
            found = [total + a * b * c * load for total, load in zip(found, row, strict=True)]
        return sign_x * found[0], sign * found[1], sign * found[2]


def _weights(axis: Sequence[float], at: float) -> list[tuple[int, float]]:
    """Return indices and weights of four values: Hermite's cubic, slopes of parabolas through three."""
    left = min(max(bisect_right(axis, at) - 1, 0), len(axis) - 2)
    first = min(max(left - 1, 0), len(axis) - 4)
    x, j = axis[first : first + 4], left - first
    h = x[j + 1] - x[j]
    t = (at - x[j]) / h
    weights = [0.0, 0.0, 0.0, 0.0]
    weights[j] = (1.0 + 2.0 * t) * (1.0 - t) ** 2
    weights[j + 1] = (3.0 - 2.0 * t) * t**2
    for k, slope in ((j, h * t * (1.0 - t) ** 2), (j + 1, h * t**2 * (t - 1.0))):
        middle = min(max(k, 1), 2)
        for m in range(middle - 1, middle + 2):
            p, q = (n for n in range(middle - 1, middle + 2) if n != m)
            weights[m] += slope * (2.0 * x[k] - x[p] - x[q]) / ((x[m] - x[p]) * (x[m] - x[q]))
    return [(first + m, weights[m]) for m in range(4)]
