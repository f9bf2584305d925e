"""Arguments of a case built in Python, as the tables of a deck, which is what everything else understands."""

from __future__ import annotations

from typing import Any

from ..core.lattice import Lattice
from ..deck import tables
from ..deck.model import Argument
from ..deck.series import DRIVEN
from ..deck.surfaces import Surface
from ..deck.write import plain


class Body(Argument, tables.Body):
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

    def __init__(
        self,
        young_modulus: float | str | None = None,
        poisson_ratio: float | None = None,
        rigid: bool = False,
        surface: Surface | None = None,
    ) -> None:
        keys = {
            "young_modulus": young_modulus,
            "poisson_ratio": poisson_ratio,
            "rigid": rigid,
            "surface": surface,
        }
        super().__init__(**plain(keys))


def with_radians(value: Any, key: str = "") -> Any:
    """Give bare angles of loads their unit: in Python, unlike in a deck, all numbers are SI.

    NaN is a row of a series that names nothing.
    """
    if isinstance(value, dict):
        return {name: with_radians(entry, name) for name, entry in value.items()}
    if isinstance(value, list):
        return [with_radians("" if key in DRIVEN and entry != entry else entry, key) for entry in value]
    bare = key == "twist" and isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value!r} rad" if bare else value


def middle_of(lattice: Lattice) -> list[float]:
    """Return the point (m) about which a deck finds the same window again."""
    middle = [lattice.cols[lattice.n_col // 2], lattice.rows[lattice.n_row // 2]]
    center: list[float] = (lattice.origin + middle @ lattice.basis).tolist()
    return center
