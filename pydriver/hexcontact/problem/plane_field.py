"""Gap and friction over the plane: a function, a map, or values over the nodes of a window."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from .. import netcdf_library
from ..arrays import Array, DataArray, Mask, has_entries, reals
from ..core import memory
from ..core.contact import shaped
from ..core.friction import FrictionLaw
from ..core.lattice import Lattice
from ..deck.interface import Friction, Interface, NodalCoefficient, TwoCoefficients
from ..deck.surfaces import Separation
from ..deck.units import LENGTH, NUMBER, Dimension, UnitError, to_si
from ..errors import DeckError
from ..files import reading
from ..text import listed, quantity
from ..variables import LARGEST

# Departure of a spline from the range of two neighbouring heights, over the largest difference nearby: 0.2
# beside a step, 0.17 beside the kink of a flat, at most 0.01 for waves of six points and more. The part that
# curvature explains is left out: 1/4 of the second differences (a parabola has 1/6, by control points).
_STEP, _CURVED = 0.1, 0.25
_ECHO = 4  # points beyond which the ringing of a cubic spline, 0.27 times as high with each, is left
_BESIDE_HOLE = 2  # points from a hole that no contact may come to


class HeightMap:
    """A gap that was measured at the points of a rectangular grid, inf beyond them and in cells beside holes.

    Between the points it is their cubic spline. Near steps, where that would ring, it is a bicubic with
    monotone slopes (Fritsch, Butland, SIAM J. Sci. Stat. Comput. 5, 1984, 300) in the range of the
    four heights around. Columns x and rows y (m) have any order; the values at (x, y) are NaN in a hole, inf
    where nothing can touch. A spline of degree 1 has no holes.
    """

    def __init__(self, x: Array, y: Array, gap: Array, name: str = "gap", degree: int = 3) -> None:
        order = np.argsort(x), np.argsort(y)
        self.x, self.y, self.gap = x[order[0]], y[order[1]], gap[np.ix_(*order)]
        there = np.isfinite(self.gap)
        ascending = [len(at) > 1 and np.isfinite(at).all() and np.diff(at).all() for at in (self.x, self.y)]
        if not all(ascending) or (degree == 1 and not there.all()):
            raise DeckError(f"{name}: expected numbers at all points of a rectangular grid, without holes")
        if not there.any() or np.isneginf(self.gap).any():
            raise DeckError(f"{name}: expected heights, NaN in holes, and inf where nothing can touch")
        # the map ends where its points do
        rows, cols = (_span(np.asarray(there.any(axis=axis))) for axis in (1, 0))
        self.x, self.y, self.gap, there = self.x[rows], self.y[cols], self.gap[rows, cols], there[rows, cols]
        self._degree, self._there = degree, there
        self._filled = self.gap if there.all() else self.gap[_nearest(there)]
        row, col = np.unravel_index(np.nanargmin(self.gap), self.gap.shape)
        self.first_touch = float(self.x[row]), float(self.y[col])  # point (m) where the gap is smallest
        # median distances (m) of its points along x and y
        self.distances = float(np.median(np.diff(self.x))), float(np.median(np.diff(self.y)))

    @classmethod
    def of(cls, gap: DataArray, rule: Rule) -> Self:
        """Return the map of an array with the coordinates x and y, each along a dimension."""
        name = rule.key
        x, y = gap.coords["x"], gap.coords["y"]
        if sorted(map(str, gap.dims)) != sorted(map(str, x.dims + y.dims)):
            named = listed([str(name) for name in gap.dims], "and")
            raise DeckError(f"{name}: expected the dimensions of x and y, not {named}")
        values = in_si(gap.transpose(*x.dims, *y.dims), name, rule.dimension)
        return cls(in_si(x, name), in_si(y, name), values, name, rule.degree)

    @property
    def holes(self) -> tuple[Array, Array]:
        """Coordinates (m) x and y of the points without a height."""
        row, col = np.nonzero(np.isnan(self.gap))
        return self.x[row], self.y[col]

    # --- interpolation --------------------------------------------------------------------------------------

    def __call__(self, x: Array, y: Array) -> Array:
        """Return the gap (m) at points of the plane."""
        # a node at the end of the map belongs to it, whatever the rounding of its coordinates
        (low, high), (left, right) = (
            (points[0] - slack, points[-1] + slack)
            for points, slack in zip((self.x, self.y), 1e-9 * np.array(self.distances), strict=True)
        )
        inside = (low <= x) & (x <= high) & (left <= y) & (y <= right)
        found = np.where(inside, self._spline.ev(x, y), np.inf)
        if self._smooth is not None:
            share = np.clip(self._smooth.ev(x, y), 0.0, 1.0)
            near = inside & (share < 1.0 - 1e-9)
            inner = np.asarray(x)[near], np.asarray(y)[near]
            monotone = np.clip(self._bicubic(np.stack(inner, axis=-1)), *self._range(*inner))
            found[near] = share[near] * found[near] + (1.0 - share[near]) * monotone
        if not self._there.all():
            found[inside & (self._through(~self._there).ev(x, y) > 1e-9)] = np.inf
        return found

    def _through(self, values: Array, degree: int = 1) -> Any:
        """Return the spline through values at the points."""
        from scipy.interpolate import RectBivariateSpline

        kx, ky = (min(degree, len(along) - 1) for along in (self.x, self.y))
        return RectBivariateSpline(self.x, self.y, values.astype(float), kx=kx, ky=ky)

    @cached_property
    def _spline(self) -> Any:
        return self._through(self._filled, self._degree)

    @cached_property
    def near_steps(self) -> Mask:
        """Points beside steps, at which the spline leaves the range of the heights, and in holes."""
        found = ~self._there
        if self._degree > 1:
            x, y, heights = self.x, self.y, self._filled
            if len(x) > 2:  # two points have a line between them
                found |= _beside_steps(x, heights, self._spline(x, y, dx=1))
            if len(y) > 2:
                found |= _beside_steps(y, heights.T, self._spline(x, y, dy=1).T).T
        return found

    @cached_property
    def _smooth(self) -> Any:
        """Share of the spline, linear between the points; None without steps and holes."""
        if not self.near_steps.any():
            return None
        from scipy.ndimage import binary_dilation

        return self._through(np.asarray(~binary_dilation(self.near_steps, iterations=_ECHO)))

    @cached_property
    def _bicubic(self) -> Any:
        from scipy.interpolate import CubicHermiteSpline, NdPPoly, PchipInterpolator

        x, y, values = self.x, self.y, self._filled
        of_x, of_y = (PchipInterpolator(at, values, axis=k)(at, 1) for k, at in enumerate((x, y)))
        twist = PchipInterpolator(y, of_x, axis=1)(y, 1)
        along_x, across = (CubicHermiteSpline(x, *pair).c for pair in ((values, of_x), (of_y, twist)))
        coefficients: Any = CubicHermiteSpline(y, along_x, across, axis=2).c
        return NdPPoly(coefficients.transpose(2, 0, 3, 1), (x, y))

    def _range(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the smallest and the largest of the four heights around points of the map."""
        row, col = (
            np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(along) - 2)
            for along, at in ((self.x, x), (self.y, y))
        )
        around = [self._filled[row + i, col + j] for i in (0, 1) for j in (0, 1)]
        return np.minimum.reduce(around), np.maximum.reduce(around)

    @cached_property
    def overshoot(self) -> float:
        """Largest departure (m) from the range of the four heights around, in the middles of cells."""
        x, y = (along[:-1] + np.diff(along) / 2 for along in (self.x, self.y))
        around = [self._filled[i : i - 1 or None, j : j - 1 or None] for i in (0, 1) for j in (0, 1)]
        found = np.array(self._spline(x, y))
        if self._smooth is not None:
            row, col = np.nonzero(self._smooth(x, y) < 1.0 - 1e-9)
            found[row, col] = self(x[row], y[col])
        beyond = np.maximum(found - np.maximum.reduce(around), np.minimum.reduce(around) - found)
        largest = float(beyond[np.isfinite(beyond)].max(initial=0.0))
        return largest if largest > 1e-12 * np.ptp(self._filled) else 0.0  # rounding

    # --- contacts that the data do not bound ----------------------------------------------------------------

    @property
    def touch_fault(self) -> str:
        """Sentence about a lowest point at the end of the map; empty if it lies inside."""
        low, high = (_is_at_end(values) for values in (self.gap, -np.where(self._there, self.gap, -np.inf)))
        if not low:
            return ""
        if not high:
            return (
                "the heights point the other way: the lowest point of the map lies at its end, the highest "
                "inside; expected the gap, such as heights.max() - heights of heights out of the body"
            )
        return (
            f"the lowest point of the map lies at its end, at {_place(*self.first_touch)}, so that the data "
            "do not bound the contact; expected heights of a larger part, or center where the contact lies"
        )

    def fault_near(self, distance: float, x: Array, y: Array) -> str:
        """Return the fault of a contact at some points: near a hole, or within a distance (m) of the end."""
        inside = [along[0] + distance <= at for along, at in ((self.x, x), (self.y, y))]
        inside += [at <= along[-1] - distance for along, at in ((self.x, x), (self.y, y))]
        if not np.all(inside):
            return (
                "reaches the end of the height map; expected heights of a larger part, or a function that "
                "says what lies beyond"
            )
        if not (holes := np.isnan(self.gap)).any():
            return ""
        at = tuple(
            np.rint(np.interp(p, c, np.arange(len(c)))).astype(int) for p, c in ((x, self.x), (y, self.y))
        )
        hole = [index[at] for index in _nearest(holes)]
        apart = np.maximum(*(abs(of - to) for of, to in zip(at, hole, strict=True)))
        if not apart.size or apart.min() > _BESIDE_HOLE:
            return ""
        row, col = (index[apart.argmin()] for index in hole)
        return (
            f"comes within {_BESIDE_HOLE} points of a hole of the height map, at "
            f"{_place(self.x[row], self.y[col])}; fill it, as by gap.interpolate_na, or set it to inf if "
            "nothing can touch there"
        )

    def __str__(self) -> str:
        """Describe the map and its interpolation."""
        apart = " by ".join(dict.fromkeys(quantity(distance, "m", 3) for distance in self.distances))
        missing = int(np.count_nonzero(~self._there))
        rule = "cubic spline" if self._degree > 1 else "bilinear"
        if special := int(np.count_nonzero(self.near_steps)):
            rule += f", kept in the range of the heights near {special} points at steps and holes"
        return (
            f"map of {len(self.x)} x {len(self.y)} points, {apart} apart"
            f"{f', {missing} without a height' if missing else ''}; {rule}; "
            f"largest overshoot {quantity(self.overshoot, 'm', 2)}"
        )


def _beside_steps(along: Array, heights: Array, slopes: Array) -> Mask:
    """Return which points of lines bound an interval where a spline overshoots more than by curvature."""
    from scipy.ndimage import maximum_filter1d

    size = np.diff(along)[:, None]
    rise = np.diff(heights, axis=0)
    bend = np.diff(rise / size, axis=0)
    bend = np.concatenate([bend[:1], bend, bend[-1:]]) if len(bend) else np.zeros_like(heights)
    ends = np.stack([heights[:-1], heights[1:]])
    inner = ends + np.stack([slopes[:-1], -slopes[1:]]) * size / 3.0  # control points of Bezier
    bends = np.stack([bend[:-1], bend[1:]]) * size * _CURVED
    below = ends.min(axis=0) - inner.min(axis=0) - np.maximum(bends.min(axis=0), 0.0)
    above = inner.max(axis=0) - ends.max(axis=0) + np.minimum(bends.max(axis=0), 0.0)
    local = np.maximum(maximum_filter1d(abs(rise), 5, axis=0), 1e-6 * np.ptp(heights))
    steep = np.maximum(below, above) > _STEP * local
    found = np.zeros(heights.shape, bool)
    found[:-1] |= steep
    found[1:] |= steep
    return found


def _nearest(chosen: Mask) -> tuple[Any, ...]:
    """Return the indices of the chosen point that is nearest to each point of a grid."""
    from scipy.ndimage import distance_transform_edt

    return tuple(distance_transform_edt(~chosen, return_distances=False, return_indices=True))


def _span(chosen: Mask) -> slice:
    at = np.flatnonzero(chosen)
    return slice(at[0], at[-1] + 1)


def _is_at_end(values: Array) -> bool:
    """Return whether the least of some values, which may be missing, is on the rim of their grid alone."""
    inner = values[1:-1, 1:-1]
    return not np.isfinite(inner).any() or bool(np.nanmin(values) < np.nanmin(inner))


def _place(x: float, y: float) -> str:
    return f"x = {x:.4g} m, y = {y:.4g} m"


def in_si(values: DataArray, name: str = "gap", dimension: Dimension = LENGTH) -> Array:
    """Return values in SI, converted from the attribute `units`; without it they are in SI."""
    units = str(values.attrs.get("units", dimension.unit))
    try:
        return reals(values, name) * (1.0 if units in ("", "1") else to_si(f"1 {units}", dimension))
    except UnitError:
        expected = "lengths" if dimension is LENGTH else dimension.name
        raise DeckError(f"{name}: {values.name or 'values'} in {units}: expected {expected}") from None


FieldSource = Callable[[Array, Array], ArrayLike] | Array
"""A function of x and y, such as `Separation` or `HeightMap`, or values over the nodes of a window."""


class Rule(NamedTuple):
    """The admitted values of a quantity at nodes, and their interpolation."""

    key: str  # in messages
    values: str  # in words
    expected: str
    dimension: Dimension
    degree: int  # of the spline between the points of a map: 3, or 1 without overshoot
    least: float
    most: float
    constant: bool  # a function may return one number


_OR_OPEN = "or inf where nothing can touch"
_LEAST = -np.finfo(float).max
GAP = Rule("gap", "heights", f"numbers, {_OR_OPEN}", LENGTH, 3, _LEAST, np.inf, constant=False)
_AT_LEAST_0 = "finite numbers of at least 0"
COEFFICIENT = Rule(
    "friction.coefficient", "coefficients", _AT_LEAST_0, NUMBER, 1, 0.0, -_LEAST, constant=True
)


def given_field(values: Any, rule: Rule, lattice: Lattice | None) -> FieldSource:
    """Return a quantity given in Python as a function, a map, or an array over the nodes of the lattice."""
    if callable(values):
        return values
    name = rule.key.replace(".", "_")
    if hasattr(values, "iloc") or hasattr(values, "data_vars"):
        raise DeckError(f"{name}: expected an xarray.DataArray or an array, not a {type(values).__name__}")
    if coordinates := getattr(values, "coords", {}):
        if "x" not in coordinates or "y" not in coordinates:
            named = listed([str(coordinate) for coordinate in coordinates], "and")
            raise DeckError(f"{name}: expected coordinates x and y (m), not {named}")
        if coordinates["x"].ndim == coordinates["y"].ndim == 1:
            return HeightMap.of(values, rule)
        values = values.copy(data=in_si(values, name, rule.dimension))
    reals(values, name)  # other values need another sentence
    if lattice is None:
        raise DeckError(
            f"{name}: an array needs lattice=..., at whose nodes it is given; {rule.values} on a rectangular "
            "grid are given as an xarray.DataArray with the coordinates x and y (m)"
        )
    return shaped(values, lattice, name).copy()


class PlaneField:
    """A quantity over the plane, and the rule of its values.

    `at_nodes`: it is an array over the nodes of one window; `given`: in Python, not as two surfaces; `map`:
    the map, if it is one; `heights`: those (m) of both surfaces, none if only their sum is known.
    """

    def __init__(self, source: FieldSource, rule: Rule) -> None:
        self.source, self.rule = source, rule
        self.at_nodes, self.given = isinstance(source, np.ndarray), not isinstance(source, Separation)
        self.map = source if isinstance(source, HeightMap) else None
        self.heights: tuple[Callable[[Array, Array], Array], ...] = ()
        if isinstance(source, Separation):
            self.heights = source.surface_1.height, source.surface_2.height

    @property
    def first_touch(self) -> tuple[float, float] | None:
        """Point (m) where the bodies touch first; None if it is unknown."""
        known = isinstance(self.source, Separation | HeightMap)
        return self.source.first_touch[:2] if known else None  # type: ignore[union-attr]

    def at(self, x: Array, y: Array) -> Array:
        """Return the values at points of the plane."""
        assert callable(self.source)
        key = self.rule.key
        try:
            found = self.source(x, y)
        except DeckError:
            raise
        except (TypeError, ValueError) as error:
            if not _takes_numbers(self.source, x, y):
                raise
            raise DeckError(
                f"{key}: expected a function of two arrays, x and y (m); this one takes numbers only: use "
                f"functions of numpy, or numpy.vectorize({key.rpartition('.')[2]})"
            ) from error
        values = reals(found, key)
        if self.rule.constant and not values.shape:
            values = np.full(np.shape(x), float(values))
        if values.shape != np.shape(x):
            raise DeckError(
                f"{key}: expected an array of the shape of x, {np.shape(x)}, one number for each node, "
                f"not one of {values.shape}"
            )
        self._refuse(values, np.isnan(values), x, y)
        return values

    def over(self, lattice: Lattice) -> Array:
        """Return the values at the nodes of a window."""
        source, key = self.source, self.rule.key
        values = source if isinstance(source, np.ndarray) else self.at(lattice.x, lattice.y)
        if values.shape != lattice.shape:
            raise DeckError(
                f"{key}: expected an array of shape {lattice.shape} (n_row, n_col), not {values.shape}"
            )
        bad = ~((values >= self.rule.least) & (values <= self.rule.most))
        self._refuse(values, bad, lattice.x, lattice.y)
        if self.rule is GAP and (abs(values[np.isfinite(values)]) > LARGEST).any():
            raise DeckError(f"{key}: expected lengths of at most {LARGEST:g} m, {_OR_OPEN}")
        ours = self.at_nodes or self.map or not self.given
        return values if ours else values.copy()  # a function may keep, and change, its result

    def _refuse(self, values: Array, bad: Mask, x: Array, y: Array) -> None:
        """Refuse values at the first of some points."""
        if not bad.any():
            return
        value, where = values[bad][0], f"x = {x[bad][0]:.4g} m, y = {y[bad][0]:.4g} m"
        if self.map and np.isinf(value):
            raise DeckError(f"{self.rule.key}: the map does not cover the window: it has no value at {where}")
        shown = "NaN" if np.isnan(value) else f"{value:g}"
        raise DeckError(f"{self.rule.key}: expected {self.rule.expected}; it is {shown} at {where}")

    def fault_near(self, lattice: Lattice, chosen: Mask) -> str:
        """Return why a contact at nodes of a window is doubtful: near the end of a map, or a hole."""
        return self.map.fault_near(lattice.spacing, lattice.x[chosen], lattice.y[chosen]) if self.map else ""

    def __eq__(self, other: object) -> bool:
        """Test whether two fields are the same; functions are if they are one object."""
        if not isinstance(other, PlaneField):
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


_NAME = COEFFICIENT.key
_MOST_POINTS = 1_000_000  # of a map, which is text in the deck of a result


def given_coefficient(coefficient: Any, lattice: Lattice | None) -> Any:
    """Return a coefficient from Python as in a deck: a number, a text, or a `NodalCoefficient`."""
    if isinstance(coefficient, str | dict) or not (callable(coefficient) or has_entries(coefficient)):
        return coefficient
    return NodalCoefficient(_of_few_points(given_field(coefficient, COEFFICIENT, lattice)))


class FrictionField:
    """Friction over the plane, by the tables [friction] and [interface] of a deck.

    `in_deck` is its value in a deck that needs no file: a map has its points and values.
    """

    def __init__(self, friction: Friction | None, interface: Interface | None = None) -> None:
        mu: Any = friction.coefficient if friction else 0.0
        numbers = friction.numbers if friction else {}
        if friction is None and interface and (limit := interface.friction_limit):
            mu, numbers["power"] = limit
        if isinstance(mu, TwoCoefficients):
            mean = math.sqrt(mu.along * mu.across)
            numbers |= {"ratio": mu.along / mu.across, "angle": mu.angle}
            # the longer half-axis ends at the limit, and the ellipse shrinks as a whole
            numbers["shear_limit"] = numbers.get("shear_limit", math.inf) * mean / max(mu.along, mu.across)
            mu = mean
        self._numbers, self._coefficient, self.in_deck = numbers, mu, mu
        self.varies = isinstance(mu, NodalCoefficient)
        if isinstance(mu, NodalCoefficient):
            source: Any = mu.source
            if isinstance(source, Path):
                source = _read_map(source)
            elif isinstance(source, tuple):
                x, y, values = source
                source = HeightMap(x, y, values, _NAME, COEFFICIENT.degree)
            self._coefficient = PlaneField(source, COEFFICIENT)
            self.in_deck = mu.in_deck
            if grid := self._coefficient.map:
                self.in_deck = {"x": grid.x.tolist(), "y": grid.y.tolist(), "values": grid.gap.tolist()}

    def over(self, lattice: Lattice) -> FrictionLaw:
        """Return the law at the nodes of a window."""
        mu = self._coefficient
        return FrictionLaw(mu.over(lattice) if isinstance(mu, PlaneField) else mu, **self._numbers)


def _read_map(path: Path) -> Any:
    """Read a map: the only variable of a netCDF file that has the coordinates x and y."""
    try:
        with reading(path, "a map in netCDF"), netcdf_library.opened_by_xarray(path) as dataset:
            maps = [v for v in dataset.data_vars.values() if {"x", "y"} <= set(v.coords)]
            if len(maps) != 1:
                raise DeckError(
                    f"expected one variable with the coordinates x and y in {path}, not {len(maps)}"
                )
            # the values, their spline, and copies of both
            memory.require(8 * 8 * maps[0].size, f"the map {path}", "choose a coarser one")
            return _of_few_points(HeightMap.of(maps[0].load(), COEFFICIENT))
    except FileNotFoundError:
        raise DeckError(f"{_NAME}: there is no file {path}") from None
    except DeckError as error:
        raise DeckError(f"{_NAME}: {str(error).removeprefix(f'{_NAME}: ')}") from None


def _of_few_points(source: Any) -> Any:
    """Return a field; refuse a map of more points than the deck of a result can hold."""
    if isinstance(source, HeightMap) and source.gap.size > _MOST_POINTS:
        raise DeckError(
            f"{_NAME}: expected a map of at most {_MOST_POINTS:,} points, not {source.gap.size:,}"
        )
    return source
