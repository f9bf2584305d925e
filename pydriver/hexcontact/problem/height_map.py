"""Values measured at the points of a rectangular grid, and their interpolation."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..arrays import Array, reals
from ..deck.units import LENGTH, Dimension, UnitError, to_si
from ..errors import DeckError
from ..text import listed

if TYPE_CHECKING:
    import xarray


class HeightMap:
    """A gap that was measured at the points of a rectangular grid: their cubic spline, inf beyond them.

    Parameters
    ----------
    x, y : ndarray
        Coordinates (m) of the columns and rows of the grid, in any order.
    gap : ndarray, (x, y)
        Values (m) at its points, or those of another quantity.
    name : str
        Its name in messages.
    degree : int
        Degree of the spline.
    """

    def __init__(self, x: Array, y: Array, gap: Array, name: str = "gap", degree: int = 3) -> None:
        if not (np.isfinite(gap).all() and all(_are_distinct(along) for along in (x, y))):
            raise DeckError(f"{name}: expected numbers at all points of a rectangular grid, without holes")
        self._degree = degree
        order = np.argsort(x), np.argsort(y)
        self.x, self.y, self.gap = x[order[0]], y[order[1]], gap[np.ix_(*order)]

    @classmethod
    def of(
        cls, gap: xarray.DataArray, name: str = "gap", dimension: Dimension = LENGTH, degree: int = 3
    ) -> Self:
        """Return the map of an array with the coordinates x and y, each along a dimension."""
        x, y = gap.coords["x"], gap.coords["y"]
        if sorted(map(str, gap.dims)) != sorted(map(str, x.dims + y.dims)):
            named = listed([str(name) for name in gap.dims], "and")
            raise DeckError(f"{name}: expected the dimensions of x and y, not {named}")
        values = in_si(gap.transpose(*x.dims, *y.dims), name, dimension)
        return cls(in_si(x, name), in_si(y, name), values, name, degree)

    @property
    def first_touch(self) -> tuple[float, float]:
        """Point (m) of the grid where the gap is smallest."""
        row, col = np.unravel_index(self.gap.argmin(), self.gap.shape)
        return float(self.x[row]), float(self.y[col])

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import RectBivariateSpline

        kx, ky = (min(self._degree, len(along) - 1) for along in (self.x, self.y))
        return RectBivariateSpline(self.x, self.y, self.gap, kx=kx, ky=ky)

    def ends_within(self, distance: float, x: Array, y: Array) -> bool:
        """Test whether one of some points is within a distance (m) of the end of the map."""
        inside = [along[0] + distance <= at for along, at in ((self.x, x), (self.y, y))]
        inside += [at <= along[-1] - distance for along, at in ((self.x, x), (self.y, y))]
        return not np.all(inside)

    def __call__(self, x: Array, y: Array) -> Array:
        """Return the gap (m) at points of the plane."""
        inside = (self.x[0] <= x) & (x <= self.x[-1]) & (self.y[0] <= y) & (y <= self.y[-1])
        return np.where(inside, self._spline.ev(x, y), np.inf)


def _are_distinct(along: Array) -> bool:
    return bool(len(along) > 1 and np.isfinite(along).all() and (np.diff(np.sort(along)) > 0.0).all())


def in_si(values: xarray.DataArray, name: str = "gap", dimension: Dimension = LENGTH) -> Array:
    """Return values in SI, converted from the attribute `units`; without it they are in SI."""
    units = str(values.attrs.get("units", dimension.unit))
    try:
        return reals(values, name) * (1.0 if units in ("", "1") else to_si(f"1 {units}", dimension))
    except UnitError:
        expected = "lengths" if dimension is LENGTH else dimension.name
        raise DeckError(f"{name}: {values.name or 'values'} in {units}: expected {expected}") from None
