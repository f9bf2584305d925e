"""The gap before loading: of two surfaces, or as Python gives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import reals
from ..core.contact import shaped
from ..core.lattice import Lattice
from ..deck.surfaces import Separation
from ..deck.units import LENGTH, UnitError, to_si
from ..errors import DeckError
from ..text import listed
from ..variables import LARGEST

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
GivenGap = Callable[[Array, Array], ArrayLike] | Array
"""A function of x and y, or values over the nodes of a window."""


def given_gap(gap: Any, lattice: Lattice | None) -> GivenGap | None:
    """Return a gap as a function of x and y, or as an array over the nodes of the lattice.

    Raises
    ------
    DeckError
        If it does not say where its values are.
    """
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
        gap = gap.copy(data=_in_meters(gap))
    reals(gap, "gap")  # what is no array needs another sentence
    if lattice is None:
        raise DeckError(
            "gap: an array needs lattice=..., at whose nodes it is given; heights on a rectangular grid "
            "are given as an xarray.DataArray with the coordinates x and y (m)"
        )
    return shaped(gap, lattice, "gap").copy()


@dataclass(frozen=True)
class Gap:
    """The gap before loading, wherever it comes from.

    Attributes
    ----------
    source : Separation, callable or ndarray
        Two surfaces; a function of x and y; or values over the nodes of a window.
    """

    source: GivenGap

    @property
    def at_nodes(self) -> bool:
        """Whether it is known at the nodes of one window only."""
        return isinstance(self.source, np.ndarray)

    @property
    def given(self) -> bool:
        """Whether Python gives it, and no deck says it."""
        return not isinstance(self.source, Separation)

    @property
    def first_touch(self) -> tuple[float, float] | None:
        """Point (m) where the bodies touch first; None if it is not known."""
        known = isinstance(self.source, Separation | HeightMap)
        return self.source.first_touch[:2] if known else None  # type: ignore[union-attr]

    def at(self, x: Array, y: Array) -> Array:
        """Return the gap (m) at points of the plane."""
        assert not isinstance(self.source, np.ndarray)
        gap = reals(self.source(x, y), "gap")
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
        return gap

    def ends_within(self, distance: float, x: Array, y: Array) -> bool:
        """Tell whether one of some points is that near to the end of a height map."""
        return isinstance(self.source, HeightMap) and self.source.ends_within(distance, x, y)

    def __eq__(self, other: object) -> bool:
        """Whether two gaps are the same; two functions are if they are one object."""
        if not isinstance(other, Gap):
            return NotImplemented
        if self.at_nodes and other.at_nodes:
            return np.array_equal(self.source, other.source)  # type: ignore[arg-type]
        return self.source is other.source or not (self.given or other.given)


class HeightMap:
    """A gap that was measured at the points of a rectangular grid: their cubic spline, inf beyond them.

    Parameters
    ----------
    x, y : ndarray
        Coordinates (m) of the columns and rows of the grid, in any order.
    gap : ndarray, (x, y)
        Values (m) at its points.
    """

    def __init__(self, x: Array, y: Array, gap: Array) -> None:
        if not (np.isfinite(gap).all() and all(_are_distinct(along) for along in (x, y))):
            raise DeckError("gap: expected numbers at all points of a rectangular grid, without holes")
        order = np.argsort(x), np.argsort(y)
        self.x, self.y, self.gap = x[order[0]], y[order[1]], gap[np.ix_(*order)]

    @classmethod
    def of(cls, gap: xarray.DataArray) -> Self:
        """Return the height map of an array with the coordinates x and y, each along a dimension."""
        x, y = gap.coords["x"], gap.coords["y"]
        if sorted(map(str, gap.dims)) != sorted(map(str, x.dims + y.dims)):
            named = listed([str(name) for name in gap.dims], "and")
            raise DeckError(f"gap: expected the dimensions of x and y, not {named}")
        return cls(_in_meters(x), _in_meters(y), _in_meters(gap.transpose(*x.dims, *y.dims)))

    @property
    def first_touch(self) -> tuple[float, float]:
        """Point (m) of the grid where the gap is smallest."""
        row, col = np.unravel_index(self.gap.argmin(), self.gap.shape)
        return float(self.x[row]), float(self.y[col])

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import RectBivariateSpline

        kx, ky = (min(3, len(along) - 1) for along in (self.x, self.y))
        return RectBivariateSpline(self.x, self.y, self.gap, kx=kx, ky=ky)

    def ends_within(self, distance: float, x: Array, y: Array) -> bool:
        """Tell whether one of some points is that near to the end of what was measured."""
        inside = [along[0] + distance <= at for along, at in ((self.x, x), (self.y, y))]
        inside += [at <= along[-1] - distance for along, at in ((self.x, x), (self.y, y))]
        return not np.all(inside)

    def __call__(self, x: Array, y: Array) -> Array:
        """Return the gap (m) at points of the plane."""
        inside = (self.x[0] <= x) & (x <= self.x[-1]) & (self.y[0] <= y) & (y <= self.y[-1])
        return np.where(inside, self._spline.ev(x, y), np.inf)


def _are_distinct(along: Array) -> bool:
    return bool(len(along) > 1 and np.isfinite(along).all() and (np.diff(np.sort(along)) > 0.0).all())


def _in_meters(values: xarray.DataArray) -> Array:
    """Return lengths in m, whatever the attribute `units` says; without it they are in m."""
    units = str(values.attrs.get("units", "m"))
    try:
        return reals(values, "gap") * to_si(f"1 {units}", LENGTH)
    except UnitError:
        raise DeckError(f"gap: {values.name or 'values'} in {units}: expected lengths") from None
