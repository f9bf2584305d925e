"""The gap before loading: of two surfaces, or given in Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, Mask, reals
from ..core.contact import shaped
from ..core.lattice import Lattice
from ..deck.surfaces import Separation
from ..errors import DeckError
from ..text import listed
from ..variables import LARGEST
from .height_map import HeightMap, in_si

GivenGap = Callable[[Array, Array], ArrayLike] | Array
"""A function of x and y, or values over the nodes of a window."""


def given_gap(gap: Any, lattice: Lattice | None) -> GivenGap | None:
    """Return a gap as a function of x and y, or as an array over the nodes of the lattice."""
    if gap is None or callable(gap):
        return gap
    if hasattr(gap, "iloc") or hasattr(gap, "data_vars"):
        raise DeckError(f"gap: expected an xarray.DataArray or an array, not a {type(gap).__name__}")
    coordinates = getattr(gap, "coords", {})
    if coordinates:
        if "x" not in coordinates or "y" not in coordinates:
            named = listed([str(name) for name in coordinates], "and")
            raise DeckError(f"gap: expected coordinates x and y (m), not {named}")
        if coordinates["x"].ndim == coordinates["y"].ndim == 1:
            return HeightMap.of(gap)
        gap = gap.copy(data=in_si(gap))
    reals(gap, "gap")  # other values need another sentence
    if lattice is None:
        raise DeckError(
            "gap: an array needs lattice=..., at whose nodes it is given; heights on a rectangular grid "
            "are given as an xarray.DataArray with the coordinates x and y (m)"
        )
    return shaped(gap, lattice, "gap").copy()


@dataclass(frozen=True)
class Gap:
    """The gap before loading.

    Attributes
    ----------
    source : Separation, callable or ndarray
        Two surfaces; a function of x and y; or values over the nodes of a window.
    """

    source: GivenGap

    @property
    def at_nodes(self) -> bool:
        """Whether it is an array over the nodes of one window."""
        return isinstance(self.source, np.ndarray)

    @property
    def given(self) -> bool:
        """Whether it was given in Python."""
        return not isinstance(self.source, Separation)

    @property
    def heights(self) -> tuple[Callable[[Array, Array], Array], ...]:
        """Heights (m) of the surfaces of body 1 and body 2; empty if only their sum is known."""
        known = self.source
        return (known.surface_1.height, known.surface_2.height) if isinstance(known, Separation) else ()

    @property
    def first_touch(self) -> tuple[float, float] | None:
        """Point (m) where the bodies touch first; None if it is unknown."""
        known = isinstance(self.source, Separation | HeightMap)
        return self.source.first_touch[:2] if known else None  # type: ignore[union-attr]

    def at(self, x: Array, y: Array) -> Array:
        """Return the gap (m) at points of the plane."""
        assert not isinstance(self.source, np.ndarray)
        try:
            found = self.source(x, y)
        except DeckError:
            raise
        except (TypeError, ValueError) as error:
            if not _takes_numbers(self.source, x, y):
                raise
            raise DeckError(
                "gap: expected a function of two arrays, x and y (m); this one takes numbers only: use "
                "functions of numpy, or numpy.vectorize(gap)"
            ) from error
        gap = reals(found, "gap")
        if gap.shape != np.shape(x):
            raise DeckError(f"gap: expected an array of the shape of x, {np.shape(x)}, not {gap.shape}")
        if (bad := np.isnan(gap)).any():
            where = f"x = {x[bad][0]:.4g} m, y = {y[bad][0]:.4g} m"
            raise DeckError(f"gap: expected numbers, or inf where nothing can touch; it is NaN at {where}")
        return gap

    def over(self, lattice: Lattice) -> Array:
        """Return the gap (m) at the nodes of a window."""
        gap = self.source if isinstance(self.source, np.ndarray) else self.at(lattice.x, lattice.y)
        if gap.shape != lattice.shape:
            raise DeckError(
                f"gap: expected an array of shape {lattice.shape} (n_row, n_col), not {gap.shape}"
            )
        if np.isnan(gap).any() or np.isneginf(gap).any():
            raise DeckError("gap: expected numbers, or inf where nothing can touch, at every node")
        if (abs(gap[np.isfinite(gap)]) > LARGEST).any():
            raise DeckError(f"gap: expected lengths of at most {LARGEST:g} m, or inf where nothing can touch")
        ours = isinstance(self.source, np.ndarray | HeightMap | Separation)
        return gap if ours else gap.copy()  # a function may keep, and change, what it returns

    @property
    def height_map(self) -> HeightMap | None:
        """The map of heights, if it is one."""
        return self.source if isinstance(self.source, HeightMap) else None

    def fault_near(self, lattice: Lattice, chosen: Mask) -> str:
        """Return what a contact at some nodes of a window comes too near to: the end of a map, or a hole."""
        grid = self.height_map
        return grid.fault_near(lattice.spacing, lattice.x[chosen], lattice.y[chosen]) if grid else ""

    def __eq__(self, other: object) -> bool:
        """Test whether two gaps are the same; functions are if they are one object."""
        if not isinstance(other, Gap):
            return NotImplemented
        if self.at_nodes and other.at_nodes:
            return np.array_equal(self.source, other.source)  # type: ignore[arg-type]
        return self.source is other.source or not (self.given or other.given)


def _takes_numbers(source: Callable[[Any, Any], ArrayLike], x: Array, y: Array) -> bool:
    """Test whether a function that fails on arrays takes two numbers."""
    try:
        float(source(float(np.ravel(x)[0]), float(np.ravel(y)[0])))  # type: ignore[arg-type]
    except Exception:  # of a function of a user
        return False
    return True
