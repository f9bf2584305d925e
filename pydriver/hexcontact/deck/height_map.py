"""Heights measured on a rectangular grid: their interpolation, with steps, holes and ends of the data."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from ..arrays import Array, Mask, reals
from ..errors import DeckError
from ..text import counted, listed, quantity
from .units import LENGTH, Dimension, UnitError, to_si

if TYPE_CHECKING:
    import xarray


# Departure of a spline from the range of two neighbouring heights, over the largest difference nearby: 0.2
# beside a step, 0.17 beside the kink of a flat, at most 0.01 for waves of six points and more. The part that
# curvature explains is left out: 1/4 of the second differences (a parabola has 1/6, by control points).
_STEP, _CURVED = 0.1, 0.25
_ECHO = 4  # points beyond which the ringing of a cubic spline, 0.27 times as high with each, is left
_BESIDE_HOLE = 2  # points from a hole that no contact may come to
BEYOND_MAP = (
    "reaches the end of the height map; expected heights of a larger part, or a function that says what lies "
    "beyond"
)
_TURNED = "expected the gap, such as heights.max() - heights of heights out of the body"


class HeightMap:
    """A gap that was measured at the points of a rectangular grid, inf beyond them and in cells beside holes.

    Between the points it is their cubic spline. Near steps, where that would ring, it is a bicubic with
    monotone slopes (Fritsch, Butland, SIAM J. Sci. Stat. Comput. 5, 1984, 300) in the range of the
    four heights around. Columns x and rows y (m) have any order; the values at (x, y) are NaN in a hole, inf
    where nothing can touch. A `whole` map has no holes.
    """

    def __init__(
        self, x: Array, y: Array, gap: Array, name: str = "gap", degree: int = 3, whole: bool = False
    ) -> None:
        order = np.argsort(x), np.argsort(y)
        self.x, self.y, self.gap = x[order[0]], y[order[1]], gap[np.ix_(*order)]
        there = np.isfinite(self.gap)
        ascending = [len(at) > 1 and np.isfinite(at).all() and np.diff(at).all() for at in (self.x, self.y)]
        if not all(ascending) or (whole and not there.all()):
            raise DeckError(f"{name}: expected numbers at all points of a rectangular grid, without holes")
        if not there.any() or np.isneginf(self.gap).any():
            raise DeckError(f"{name}: expected heights, NaN in holes, and inf where nothing can touch")
        # the map ends where its points do
        rows, cols = (_span(np.asarray(there.any(axis=axis))) for axis in (1, 0))
        self.x, self.y, self.gap, there = self.x[rows], self.y[cols], self.gap[rows, cols], there[rows, cols]
        self._degree, self.there = degree, there
        self._filled = self.gap if there.all() else self.gap[_nearest(there)]
        row, col = np.unravel_index(np.nanargmin(self.gap), self.gap.shape)
        self.first_touch = float(self.x[row]), float(self.y[col])  # point (m) where the gap is smallest
        # median distances (m) of its points along x and y
        self.distances = float(np.median(np.diff(self.x))), float(np.median(np.diff(self.y)))

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
        return cls(in_si(x, name), in_si(y, name), values, name, degree, whole=degree == 1)

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
        if not self.there.all():
            found[inside & (self._through(~self.there).ev(x, y) > 1e-9)] = np.inf
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
        found = ~self.there
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
        if self._degree == 1 or not self.near_steps.any():
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

    def __str__(self) -> str:
        """Describe the map and its interpolation."""
        apart = " by ".join(dict.fromkeys(quantity(distance, "m", 3) for distance in self.distances))
        missing = int(np.count_nonzero(~self.there))
        return (
            f"map of {len(self.x)} x {len(self.y)} points, {apart} apart"
            f"{f', {missing} without a height' if missing else ''}; {self.interpolated}"
        )

    @property
    def interpolated(self) -> str:
        """Describe the interpolation."""
        rule = "cubic spline" if self._degree > 1 else "bilinear"
        if special := int(np.count_nonzero(self.near_steps)):
            rule += f", kept in the range of the heights near {counted(special, 'point')} at steps and holes"
        return f"{rule}; largest overshoot {quantity(self.overshoot, 'm', 2)}"


class Placed(NamedTuple):
    """A map at its place in the plane: its origin (m) and the angle (rad) of its first axis from x."""

    name: str  # in messages
    map: HeightMap
    offset: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    turned: str = _TURNED
    extruded: bool = False  # along the first axis

    def lowest_points(self, most: int, middle: Array) -> Array:
        """Return the lowest point of each of at most `most` blocks along an axis, in the plane (n, m, 2).

        Those of an extruded map lie beside `middle`.
        """
        x, y, gap = self.map.x, self.map.y, self.map.gap
        if self.extruded:
            x, gap = self.own(*middle)[0] + self.map.distances[1] * np.arange(-1, 2), gap[[0, 0, 0]]
        parts = [math.ceil(count / most) for count in gap.shape]
        beyond = [(0, -count % part) for count, part in zip(gap.shape, parts, strict=True)]
        blocks = np.pad(np.where(np.isnan(gap), np.inf, gap), beyond, constant_values=np.inf)
        rows, cols = (count // part for count, part in zip(blocks.shape, parts, strict=True))
        lowest = blocks.reshape(rows, parts[0], cols, parts[1]).swapaxes(1, 2).reshape(rows, cols, -1)
        row, col = np.divmod(lowest.argmin(axis=2), parts[1])
        row = np.minimum(row + parts[0] * np.arange(rows)[:, None], len(x) - 1)
        col = np.minimum(col + parts[1] * np.arange(cols), len(y) - 1)
        return np.stack(self.in_plane(x[row], y[col]), axis=-1)

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes along which it has an end."""
        return (1,) if self.extruded else (0, 1)

    def is_beyond(self, axis: int, at: Array) -> bool:
        """Test whether points in its own coordinates lie beyond its ends along an axis."""
        points, slack = (self.map.x, self.map.y)[axis], 1e-9 * self.map.distances[axis]
        return bool(at.min() < points[0] - slack or at.max() > points[-1] + slack)

    def own(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return points of the plane in coordinates of the map."""
        return rotated(x - self.offset[0], y - self.offset[1], -self.angle)

    def in_plane(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return points of the map in coordinates of the plane."""
        x, y = rotated(x, y, self.angle)
        return x + self.offset[0], y + self.offset[1]

    # --- contacts that the data do not bound ----------------------------------------------------------------

    @property
    def touch_fault(self) -> str:
        """Sentence about a lowest point at the end of the map; empty if it lies inside."""
        found = self.map
        low, high = (_is_at_end(values) for values in (found.gap, -np.where(found.there, found.gap, -np.inf)))
        if not low:
            return ""
        if not high:
            return (
                "the heights point the other way: the lowest point of the map lies at its end, the highest "
                f"inside; {self.turned}"
            )
        return (
            f"the lowest point of the map lies at its end, at {self._named(*found.first_touch)}, so that the "
            "data do not bound the contact; expected heights of a larger part, or center where the contact "
            "lies"
        )

    def is_near_end(self, distance: float, x: Array, y: Array) -> bool:
        """Test whether points of the plane lie within a distance (m) of the end of the map, or beyond it."""
        ends = zip(self.own(x, y), (self.map.x, self.map.y), strict=True)
        return any((np.minimum(at - along[0], along[-1] - at) < distance).any() for at, along in ends)

    def fault_near(self, distance: float, x: Array, y: Array) -> str:
        """Return the fault of a contact at some points: near a hole, or within a distance (m) of the end."""
        if self.is_near_end(distance, x, y):
            return BEYOND_MAP
        found = self.map
        if not (holes := np.isnan(found.gap)).any():
            return ""
        ends = zip(self.own(x, y), (found.x, found.y), strict=True)
        index = tuple(np.rint(np.interp(one, c, np.arange(len(c)))).astype(int) for one, c in ends)
        hole = [nearest[index] for nearest in _nearest(holes)]
        apart = np.maximum(*(abs(of - to) for of, to in zip(index, hole, strict=True)))
        if not apart.size or apart.min() > _BESIDE_HOLE:
            return ""
        row, col = (nearest[apart.argmin()] for nearest in hole)
        return (
            f"comes within {_BESIDE_HOLE} points of a hole of the height map, at "
            f"{self._named(found.x[row], found.y[col])}; fill it, as by gap.interpolate_na, or set it to inf "
            "if nothing can touch there"
        )

    def _named(self, x: float, y: float) -> str:
        """Return a point of the map in words, in coordinates of the plane."""
        return place(*(float(at) for at in self.in_plane(np.asarray(x), np.asarray(y))))


def rotated(x: Array, y: Array, angle: float) -> tuple[Array, Array]:
    """Return points that are turned about the origin by an angle (rad)."""
    if not angle:
        return x, y
    a, b = math.cos(angle), math.sin(angle)
    return a * x - b * y, b * x + a * y


def along_axes(offset: tuple[float, float], angle: float) -> tuple[float, float]:
    """Return an offset (m) along axes that are turned by an angle (rad)."""
    x, y = rotated(np.asarray(offset[0]), np.asarray(offset[1]), -angle)
    return float(x), float(y)


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


def place(x: float, y: float) -> str:
    """Return a point (m) in words."""
    return f"x = {quantity(x, 'm')}, y = {quantity(y, 'm')}"


def in_si(values: xarray.DataArray, name: str = "gap", dimension: Dimension = LENGTH) -> Array:
    """Return values in SI, converted from the attribute `units`; without it they are in SI."""
    units = str(values.attrs.get("units", dimension.unit))
    try:
        return reals(values, name) * (1.0 if units in ("", "1") else to_si(f"1 {units}", dimension))
    except UnitError:
        expected = "lengths" if dimension is LENGTH else dimension.name
        raise DeckError(f"{name}: {values.name or 'values'} in {units}: expected {expected}") from None
