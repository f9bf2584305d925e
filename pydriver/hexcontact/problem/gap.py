"""The gap before loading: of two surfaces, or given in Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, Mask, reals
from ..core.contact import shaped
from ..core.lattice import Lattice
from ..deck.surfaces import Separation
from ..deck.units import LENGTH, Dimension, UnitError, to_si
from ..errors import DeckError
from ..text import listed
from ..variables import LARGEST

if TYPE_CHECKING:
    import xarray

GivenGap = Callable[[Array, Array], ArrayLike] | Array
"""A function of x and y, or values over the nodes of a window."""


def given_gap(gap: Any, lattice: Lattice | None) -> GivenGap | None:
    """Return a gap as a function of x and y, or as an array over the nodes of the lattice.

    Raises
    ------
    DeckError
        If the places of its values are unknown.
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
        gap = gap.copy(data=_in_si(gap))
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
            gap = reals(self.source(x, y), "gap")
        except (TypeError, ValueError) as error:
            if isinstance(error, DeckError) or not _takes_numbers(self.source, x, y):
                raise
            raise DeckError(
                "gap: expected a function of two arrays, x and y (m); this one takes numbers only: use "
                "functions of numpy, or numpy.vectorize(gap)"
            ) from error
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

    def ends_within(self, lattice: Lattice, chosen: Mask) -> bool:
        """Test whether a height map ends within a spacing of one of some nodes of a window."""
        source = self.source
        if not isinstance(source, HeightMap):
            return False
        return source.ends_within(lattice.spacing, lattice.x[chosen], lattice.y[chosen])

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
        values = _in_si(gap.transpose(*x.dims, *y.dims), name, dimension)
        return cls(_in_si(x, name), _in_si(y, name), values, name, degree)

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


def _in_si(values: xarray.DataArray, name: str = "gap", dimension: Dimension = LENGTH) -> Array:
    """Return values in SI, converted from the attribute `units`; without it they are in SI."""
    units = str(values.attrs.get("units", dimension.unit))
    try:
        return reals(values, name) * (1.0 if units in ("", "1") else to_si(f"1 {units}", dimension))
    except UnitError:
        expected = "lengths" if dimension is LENGTH else dimension.name
        raise DeckError(f"{name}: {values.name or 'values'} in {units}: expected {expected}") from None
