"""Lattices of a refinement: each finer by the square root of two.

Shifted copies of a lattice have its spacing and origins moved by fractions of it, for estimates of errors
(docs/theory/error_bars.md, (A2)).
"""

from __future__ import annotations

from typing import NamedTuple

from .problem import LEAST_LEVELS, Problem

# Origins of the shifted copies, in spacings along both basis vectors: multiples of (1/g, 1/g^2) with
# g^3 = g + 1, which no row or symmetry of the lattice maps to each other.
SHIFTS = ((0.7549, 0.5698), (0.5098, 0.1397), (0.2647, 0.7095), (0.0195, 0.2794))


class Trial(NamedTuple):
    """A lattice of a refinement."""

    level: int  # how often it was refined
    copy: int = 0  # 0: the lattice itself, else the number of its shifted copy

    def case(self, case: Problem) -> Problem:
        """Return the case on this lattice."""
        return case.refined(self.level, SHIFTS[self.copy - 1] if self.copy else (0.0, 0.0))

    @property
    def name(self) -> str:
        """Name: "lattice 3", "lattice 1, shifted (2 of 4)"."""
        shifted = f", shifted ({self.copy} of {len(SHIFTS)})" if self.copy else ""
        return f"lattice {self.level + 1}{shifted}"


def coarser(case: Problem, level: int = 0) -> list[Problem]:
    """Return a case on the lattice of twice the spacing of a level, and on its shifted copies."""
    return [Trial(level - 2, copy).case(case) for copy in range(1 + len(SHIFTS))]


def least_and_most(case: Problem) -> tuple[list[Problem], list[Problem]]:
    """Return a case on all lattices of the shortest refinement, and of the longest within max_nodes.

    The last one is the finest.
    """
    assert case.accuracy is not None
    coarse, levels = Trial(0).case(case), [Trial(level).case(case) for level in range(LEAST_LEVELS)]
    least = [coarse] * len(SHIFTS) + levels
    while (finer := Trial(len(levels)).case(case)).lattice.size <= case.accuracy.max_nodes:
        levels.append(finer)
    return least, [*(levels[: 1 - LEAST_LEVELS] * len(SHIFTS)), *levels]
