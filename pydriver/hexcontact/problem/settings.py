"""What a case is made of: bodies, and how it is solved and kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..deck.surfaces import Surface


@dataclass(frozen=True)
class Body:
    """One of the two bodies.

    Attributes
    ----------
    young_modulus : float or None
        Young's modulus (Pa); None for a rigid body.
    poisson_ratio : float or None
        Poisson's ratio; None for a rigid body.
    rigid : bool
        Whether the body is rigid.
    surface : Surface or None
        Shape of its surface; None for a flat one, or if the gap of the case is given as a whole.
    """

    young_modulus: float | None = None
    poisson_ratio: float | None = None
    rigid: bool = False
    surface: Surface | None = None


@dataclass(frozen=True)
class SolverSettings:
    """How a case is solved; see [solver] in the deck reference."""

    algorithm: str = "frictionless"
    method: str = "auto"
    tolerance: float = 1e-8
    coupling: str = "full"
    entry: str = "implicit"
    step_tolerance: float = 0.01


@dataclass(frozen=True)
class AccuracySettings:
    """How far the lattice is refined; see [accuracy] in the deck reference."""

    target: float
    max_nodes: int


@dataclass(frozen=True)
class OutputSettings:
    """What is kept of a run; see [output] in the deck reference.

    No fields: all that the algorithm yields, except for the displacements of the bodies.
    """

    file: Path | None = None
    fields: tuple[str, ...] = ()
    every: int = 1
