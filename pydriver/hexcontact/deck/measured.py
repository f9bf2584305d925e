"""Measured surfaces of decks: a map of heights over x and y, and a profile that is extruded.

Both are read from a file when the deck is read. In the deck of a result their points stand in place of the
file, in m, so that it needs no other file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PrivateAttr, model_validator

from ..arrays import Array
from ..errors import DeckError
from ..text import counted, quantity
from .faults import MISSING
from .height_map import HeightMap, Placed, along_axes, place, rotated
from .kinds import OR_NONE, FileName, Flag, Kind, Quantity, Read, Schema, Several, Text, Word, refuse
from .map_file import NETCDF, MapFile, read_map
from .surfaces import Angle, OptionalLength, Point, Surface, shape
from .table_base import Conflicts, meaning, not_both, refuse_key, refused
from .units import LENGTH, NUMBER, UnitError, readable, to_si

_OF_FILES = ("variable", "units", "height_units")  # keys that go with a file alone
_POINTS = ("x", "y", "heights")
_LONG = 1e6  # half the length (m) of an extruded profile
_EVEN = 1e-6  # of distances between points that repeat, and of their period
_UNEVEN = 0.02  # difference of steps between points that is more than rounding
_ROUNDED = 1e-9  # of heights, over their range
_BEYOND = 12  # points on each side of a period that its interpolation sees
_SQUARE, _SLENDER = 1.02, 1.1  # ratios of sides of cells that are squares, and that are not


class LengthUnit(Text):
    """A unit of length."""

    expected = 'a unit of length such as "um"'

    def _parse(self, value: object) -> str:
        text = super()._parse(value).strip()
        try:
            to_si(f"1 {text}", LENGTH)
        except UnitError as error:
            refuse(f"expected {self.expected}; {error}")
        return str(text)


class Numbers(Kind):
    """An array of numbers, or of arrays of them, in m; NaN in holes."""

    def __init__(self, depth: int = 1) -> None:
        self.depth = depth
        self.expected = "numbers (m)" if depth == 1 else "arrays of numbers (m), over y for each x"
        numbers: Schema = {"type": "array", "items": {"type": "number"}}
        self.schema = numbers if depth == 1 else {"anyOf": [numbers, {"type": "array", "items": numbers}]}

    def _parse(self, value: object) -> Any:
        try:
            found = np.asarray(value, float)
        except (TypeError, ValueError):
            found = np.zeros(())
        if not 1 <= found.ndim <= self.depth:
            refuse(f"expected {self.expected}")
        return found.tolist()


HeightFile = Annotated[Read[Path | None, str | Path | None], FileName(), OR_NONE]
TwoLengths = Annotated[
    Read[tuple[float, float] | None, Sequence[float | str] | None],
    Several(Quantity(LENGTH, above=0), "lengths", '["1 mm", "1 mm"]', count=2),
    OR_NONE,
]
Line = Annotated[Read[list[Any] | None, ArrayLike | None], Numbers(), OR_NONE]
Grid = Annotated[Read[list[Any] | None, ArrayLike | None], Numbers(2), OR_NONE]


class Points(NamedTuple):
    """Points of a rectangular grid (m), and the measured heights (m) at them, NaN in holes."""

    x: Array  # (n_x,)
    y: Array  # (n_y,)
    z: Array  # (n_x, n_y)
    about: str = ""  # the file, and how it was read


class Measured(Surface):
    """A surface that was measured at points; heights count from the lowest point, where it touches a flat."""

    file: HeightFile = meaning(None, "file of the heights, relative to the deck", '"heights.csv"')
    variable: Annotated[str, Text()] | None = meaning(
        None, "which variable, column or channel of the file; needed if it has several", '"height"'
    )
    units: Annotated[str, LengthUnit()] | None = meaning(
        None, "unit of x and y; needed unless the file says it", '"um"'
    )
    height_units: Annotated[str, LengthUnit()] | None = meaning(
        None, "unit of the heights; needed unless the file says it", '"nm"'
    )
    upwards: Annotated[bool, Flag()] = meaning(
        ..., "true: heights of the surface, which rise out of its body; false: a gap", "true"
    )
    level: Annotated[str | bool, Word((False, "mean", "plane"))] = meaning(
        False, "subtracts the mean, or the plane of least squares", '"plane"'
    )
    holes: Annotated[str, Word(("refuse", "open", "fill"))] = meaning(
        "refuse",
        "points without a height: open: nothing can touch there; fill: each has the mean of its neighbors",
    )
    interpolation: Annotated[str, Word(("cubic", "linear"))] = meaning(
        "cubic",
        "cubic: a spline, near steps monotone between the points; linear: bilinear between four points",
    )
    taper: OptionalLength = meaning(
        None, "width of the margins over which a window that repeats closes the step of its sides", '"10 um"'
    )
    of_points: ClassVar[bool] = True
    extruded: ClassVar[bool] = False
    _file_key: ClassVar[str] = "file"
    _period: tuple[float, float] | None = PrivateAttr(None)
    _closing: str = PrivateAttr("")  # how it repeats
    _doubt: str = PrivateAttr("")  # expected value of an extent that may be swapped
    _placing: ClassVar[tuple[str, ...]] = ()  # further keys that go with a file alone

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require a file or points, without the keys of the other one."""
        yield from not_both(data, "extent", "spacing")
        own = [key for key in _POINTS if key in cls.known_keys()]
        if data.get("file"):
            yield from refused(data, own, "expected a file or points, not both")
            return
        if "heights" not in data:
            yield "file", 'missing; expected the name of a file such as "heights.csv"'
            return
        for key in own:
            if key not in data:
                yield key, "missing; expected numbers (m)"
        sentence = "expected nothing beside points, which are in m"
        yield from refused(data, (*_OF_FILES, *cls._placing), sentence)

    @model_validator(mode="after")
    def _whole(self) -> Self:
        """Read the file, and report its faults."""
        try:
            self.field  # noqa: B018 (read here, cached)
        except DeckError as error:
            if self.file is None:
                refuse_key("heights", MISSING, str(error).removeprefix("heights: "))
            name = str(self.file)
            lines = [line.removeprefix(name).lstrip(":, ") for line in str(error).splitlines()]
            refuse_key(self._file_key, name, "; ".join(lines))
        return self

    # --- points ---------------------------------------------------------------------------------------------

    @cached_property
    def points(self) -> Points:
        """Points and heights (m), as measured."""
        raise NotImplementedError

    def _scale(self, key: str, said: str) -> float:
        """Return a unit in m, given by the file or by the key, and by both as the same."""
        given = getattr(self, key)
        if not (given or said):
            refuse_key(key, MISSING, f'missing; expected the unit, such as "um": {self.file} does not say it')
        try:
            scale = to_si(f"1 {said or given}", LENGTH)
        except UnitError:
            refuse_key(
                self._file_key, str(self.file), f'expected lengths in the file, not values in "{said}"'
            )
        if given and to_si(f"1 {given}", LENGTH) != scale:
            refuse_key(key, given, f'expected nothing, or "{said}" as in the file')
        return scale

    def _read(self, profile: bool) -> tuple[MapFile, Array, float]:
        """Return the file, its values and the unit of its coordinates (m)."""
        assert self.file is not None
        found = read_map(self.file, self.variable, profile)
        # a matrix has the distances of the deck, with their unit
        scale = 1.0 if found.y is None else self._scale("units", found.units)
        return found, found.values * self._scale("height_units", found.value_units), scale

    @property
    def holes_found(self) -> int:
        """Number of points without a height."""
        return int(np.isnan(self.points.z[: 1 if self.extruded else None]).sum())

    @cached_property
    def plane(self) -> tuple[float, float, float]:
        """Mean (m) that is subtracted, at the middle of the points, and slopes along x and y."""
        x, y, z, _ = self.points
        if self.level is False:
            return 0.0, 0.0, 0.0
        there = np.isfinite(z)
        if self.level == "mean":
            return float(z[there].mean()), 0.0, 0.0
        u, v = np.meshgrid(_centered(x), _centered(y), indexing="ij")
        width, height = (float(np.ptp(at)) or 1.0 for at in (x, y))
        terms = np.stack([np.ones(there.sum()), u[there] / width, v[there] / height], axis=1)
        mean, along, across = np.linalg.lstsq(terms, z[there], rcond=None)[0].tolist()
        return mean, along / width, across / height

    @cached_property
    def field(self) -> HeightMap:
        """Heights towards the other body (m), 0 at the lowest point, over the coordinates of the map."""
        x, y, z, _ = self.points
        if not (np.isfinite(x).all() and np.isfinite(y).all()) or np.isinf(z).any():
            raise DeckError("expected finite numbers, and NaN in holes of the heights only")
        if not np.isfinite(z).any():
            raise DeckError("expected heights; no point has one")
        if self.holes == "refuse" and (count := self.holes_found):
            row, col = np.argwhere(np.isnan(z))[-1]
            u, v = (float(at) + more for at, more in zip((x[row], y[col]), self._moved_by, strict=True))
            at = [f"{name} = {quantity(c, 'm')}" for name, c in zip(self._axes, (u, v), strict=True)]
            where = ", ".join(at[self.extruded :])
            sentence = (
                f"{counted(count, 'point has', 'points have')} no height, "
                f"{'one of them ' * (count > 1)}at {where}; expected "
            )
            refuse_key("holes", MISSING, f'{sentence}"fill", or "open" if nothing can touch there')
        mean, along, across = self.plane
        height = z - mean - along * _centered(x)[:, None] - across * _centered(y)
        if self.upwards:
            height = -height
        if self.holes == "fill":
            height = _filled(height)
        if self._period:
            x, y, height = self._repeated(x, y, height)
        height = np.where(np.isnan(height), np.inf, height) - np.nanmin(height)
        return HeightMap(x, y, height, "heights", 3 if self.interpolation == "cubic" else 1)

    # --- the surface ----------------------------------------------------------------------------------------

    @property
    def direction(self) -> float:
        """Angle (rad) of the first axis of its points from x."""
        return float(getattr(self, "angle", 0.0))

    @property
    def _axes(self) -> str:
        """Names of the axes of its points."""
        return "st" if self.direction else "xy"

    @property
    def _origin(self) -> tuple[float, float]:
        return float(self.offset[0]), float(self.offset[1])

    @property
    def _moved_by(self) -> tuple[float, float]:
        """Offset (m) along the axes of its points."""
        return along_axes(self._origin, self.direction)

    @property
    def _heights(self) -> str:
        """Describe the heights but for the place of the lowest point."""
        z, holes, (mean, *slopes) = self.points.z, self.holes_found, self.plane
        rise = quantity(float(np.nanmax(z) - np.nanmin(z)), "m")
        words = f"{'heights' if self.upwards else 'gap'}, range {rise}; "
        if self.level is False:
            words += "not levelled; "
        else:
            along, across = (round(slope, 9) + 0.0 for slope in slopes)  # without noise, and without -0
            names = self._axes
            sloped = f" and slopes of {along:.3g} along {names[0]}, {across:.3g} along {names[1]}"
            sloped *= self.level == "plane"
            words += f"levelled: mean of {quantity(mean, 'm', 3)}{sloped} subtracted; "
        neighbors = "mean of its" if holes == 1 else "means of their"
        done = {"fill": f"filled with the {neighbors} neighbors", "open": "open: nothing touches there"}
        words += f"{counted(holes, 'hole')} {done[self.holes]}" if holes else "no holes"
        if self.taper and self._period:
            words += f"; tapered over {quantity(self.taper, 'm')} at its ends"
        return words + self._closing

    def placed(self, name: str) -> Placed:
        """Return the map at its place in the plane; `name` stands for it in messages."""
        turned = f"expected upwards = {str(not self.upwards).lower()}"
        return Placed(name, self.field, self._origin, self.direction, turned, self.extruded)

    def points_near(self, point: tuple[float, float]) -> tuple[Array, Array]:
        """Return points of the plane (m), one of which is where another body of some center touches first."""
        x, y = np.meshgrid(*self._in_period(self.field.x, self.field.y), indexing="ij")
        return x.ravel() + self._origin[0], y.ravel() + self._origin[1]

    def repeating(self, sides: tuple[float, float] | None) -> Measured:
        """Return the surface over a window that repeats with two sides (m) along x and y; None: others."""
        if sides is None:
            raise DeckError(
                f"{self} repeats along x and y only; expected a window whose sides lie along them"
            )
        other = self.model_copy()
        other.__dict__.pop("field", None)
        other._period = sides
        return other

    def _height(self, x: Array, y: Array) -> Array:
        x, y = np.broadcast_arrays(x, y)
        return np.asarray(self.field(*self._in_period(*rotated(x, y, -self.direction))))

    def _in_period(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Return coordinates of the map; those of the measured period if it repeats."""
        if not self._period:
            return x, y
        lows = self.points.x.min(), self.points.y.min()
        at, up = (
            low + np.mod(one - low, side) for one, low, side in zip((x, y), lows, self._period, strict=True)
        )
        return at, up

    def _repeated(self, x: Array, y: Array, height: Array) -> tuple[Array, Array, Array]:
        """Return heights over a period and some points beyond it; DeckError if its sides do not fit."""
        assert self._period is not None
        self._closing = ""
        order = np.argsort(x), np.argsort(y)
        axes, height = [x[order[0]], y[order[1]]], height[np.ix_(*order)]
        for axis, side in enumerate(self._period):
            if axis == 0 and self.extruded:
                continue
            axes[axis], height, how = _closed(axes[axis], height, axis, side, self.taper, self._axes[axis])
            self._closing += f"; repeats after {quantity(side, 'm')} in {self._axes[axis]}, {how}"
        return axes[0], axes[1], height

    def written(self, defaults: bool = True) -> dict[str, Any]:
        """Return the keys, with the points in place of a file."""
        keys = super().written(defaults) | {"upwards": self.upwards}
        left_out = ("file", *_OF_FILES, *self._placing, *_POINTS)
        x, y, z, _ = self.points
        places = {"y": y, "heights": z[0]} if self.extruded else {"x": x, "y": y, "heights": z}
        written = {key: value for key, value in keys.items() if key not in left_out}
        return written | {key: at.tolist() for key, at in places.items()}

    def __eq__(self, other: object) -> bool:
        """Test whether two surfaces have the same heights at the same points, whether from a file or not."""
        if not isinstance(other, Measured):
            return NotImplemented
        keys = [{key: v for key, v in one.written().items() if key not in _POINTS} for one in (self, other)]
        both = zip(self.points[:3], other.points[:3], strict=True)
        return keys[0] == keys[1] and all(np.array_equal(*pair, equal_nan=True) for pair in both)

    __hash__ = None  # type: ignore[assignment]

    # --- in words -------------------------------------------------------------------------------------------

    def notes(self, name: str) -> Iterator[str]:
        """Yield notes on the surface under its name: filled holes, an extent that may be swapped."""
        if self.holes == "fill" and (count := self.holes_found):
            yield counted(count, f"hole of {name} is", f"holes of {name} are") + " filled, not measured"
        if self._doubt:
            yield f"the extent of {name} may be swapped: expected {self._doubt}"

    def __str__(self) -> str:
        """Name the shape and its file."""
        return f"{self.shape} of {self.file.name}" if self.file else self.shape


@shape("map")
class Map(Measured):
    """Measured heights over x and y."""

    extent: TwoLengths = meaning(
        None, "distances of the first and the last point (n - 1 spacings) in x and y; for files without them"
    )
    spacing: TwoLengths = meaning(
        None, "distances of neighboring points in x and y, instead of the extent", '["2 um", "2 um"]'
    )
    center: Point | None = meaning(
        None, "where the middle of the points lies; if absent as the file says, else at 0, 0"
    )
    first_row: Annotated[str, Word(("top", "bottom"))] = meaning(
        "top", "of a file without coordinates: whether its first row has the largest y, or the smallest"
    )
    x: Line = meaning(None, "places along x instead of a file, as in results", "[0.0, 1e-6]")
    y: Line = meaning(None, "places along y", "[0.0, 1e-6]")
    heights: Grid = meaning(None, "heights there, an array over y for each x", "[[0.0, 1e-9], [2e-9, 0.0]]")
    formula: ClassVar[str] = "h = z_max − z of heights, h = g − g_min of a gap, interpolated"
    _placing: ClassVar[tuple[str, ...]] = ("extent", "spacing", "center", "first_row")

    @cached_property
    def points(self) -> Points:
        """Points and heights (m), as measured."""
        if self.file is None:
            x, y, z = (np.asarray(getattr(self, key), float) for key in _POINTS)
            if z.shape != (len(x), len(y)):
                raise DeckError(f"expected {len(x)} arrays of {len(y)} numbers, over y for each x")
            return Points(x, y, z, "points in the deck, in m")
        found, z, scale = self._read(profile=False)
        if found.x is None or found.y is None:
            x, y, z, how = self._of_matrix(z)
        else:
            for key in ("extent", "spacing", "first_row"):
                if key in self.model_fields_set:
                    refuse_key(key, MISSING, f"expected nothing, since {self.file} has coordinates x and y")
            x, y, how = found.x * scale, found.y * scale, "coordinates x and y of the file"
        if self.center is not None:
            x, y = (at - (at.min() + at.max()) / 2 + c for at, c in zip((x, y), self.center, strict=True))
        units = f"heights in {found.value_units or self.height_units}"
        if of_file := found.units or self.units:
            units = f"x and y in {of_file}, {units}"
        return Points(x, y, z, f"{Path(self.file).name}, {units}; {how}")

    def _of_matrix(self, rows: Array) -> tuple[Array, Array, Array, str]:
        """Return the points of a matrix: columns along x, the first row at the top or at the bottom."""
        (n_y, n_x), name = rows.shape, Path(self.file or "").name
        if self.spacing:
            steps = self.spacing
        elif self.extent is None:
            refuse_key(
                "extent", MISSING, f"missing; expected extent or spacing: {self.file} has no coordinates"
            )
        else:
            steps = self.extent[0] / (n_x - 1), self.extent[1] / (n_y - 1)
            swapped = self.extent[1] / (n_x - 1), self.extent[0] / (n_y - 1)
            slender, if_swapped = (max(cell) / min(cell) for cell in (steps, swapped))
            if slender > _SLENDER and if_swapped < slender / _SLENDER:
                self._doubt = (
                    f"the length in x first: the {n_y} rows and {n_x} columns of {name} have points "
                    f"{readable(steps[0])} apart in x and {readable(steps[1])} in y, and with the two "
                    f"swapped {readable(swapped[0])} and {readable(swapped[1])}"
                )
            if self._doubt and if_swapped < _SQUARE:
                refuse_key("extent", MISSING, f"expected {self._doubt}; or give spacing")
        x, y = (step * (np.arange(n) - (n - 1) / 2) for step, n in zip(steps, (n_x, n_y), strict=True))
        z = (rows[::-1] if self.first_row == "top" else rows).T
        return x, y, z, f"columns along x, first row at the {self.first_row}"

    def rows(self, apart: Callable[[float], float]) -> Iterator[str]:
        """Yield lines about the map, beside the distance of nodes along a direction."""
        (x, y, _, about), ends = self.points, []
        of_points, uneven = zip(
            *(_steps(at, name) for name, at in zip("xy", (x, y), strict=True)), strict=True
        )
        for name, at, step, origin in zip("xy", (x, y), of_points, self._moved_by, strict=True):
            low, high = at.min() + origin, at.max() + origin
            cells = quantity(high - low + step, "m")
            ends.append(
                f"{name} from {quantity(low, 'm')} to {quantity(high, 'm')} ({quantity(high - low, 'm')}, "
                f"with the cells of its ends {cells})"
            )
        yield about
        yield f"{len(x)} x {len(y)} points; {'; '.join(ends)}"
        of_nodes = apart(0.0), apart(math.pi / 2)
        steps = " by ".join(dict.fromkeys(quantity(step, "m", 3) for step in of_points))
        shares = [f"{step / node:.3g}" for step, node in zip(of_points, of_nodes, strict=True)]
        ratios = " by ".join(dict.fromkeys(shares))
        of_lattice = f"{ratios} spacings of the lattice"
        yield f"points {steps} apart{''.join(uneven)}, {of_lattice}; x to the right, y to the top"
        u, v = (a + b for a, b in zip(self._in_period(*self.field.first_touch), self._moved_by, strict=True))
        tilted = " before the tilt" * any(self.tilt)
        yield f"{self._heights}; nearest to the other body{tilted} at {place(u, v)}"
        yield self.field.interpolated


class CoefficientMap(Map):
    """Numbers over x and y, read as a map of heights is: bilinear between the points, without holes."""

    upwards: Annotated[bool, Flag()] = meaning(False, "not of use")
    _file_key: ClassVar[str] = "map"

    def _read(self, profile: bool) -> tuple[MapFile, Array, float]:
        """Return the file, its values and the unit of its coordinates (m)."""
        file = Path(self.file or "")
        found = read_map(file, self.variable, profile)
        try:
            values = found.values * (to_si(f"1 {found.value_units}", NUMBER) if found.value_units else 1.0)
        except UnitError:
            refuse_key(
                self._file_key, str(self.file), f'expected numbers, not values in "{found.value_units}"'
            )
        # coordinates of netCDF are in m, or in the unit that they name
        meters = found.x is not None and file.suffix.lower() in NETCDF
        units = found.units or ("m" if meters and not self.units else "")
        return found, values, self._scale("units", units)

    @classmethod
    def json_keys(cls) -> dict[str, Schema]:
        """Return the schemas of its keys."""
        core = cls.__pydantic_core_schema__
        keys: dict[str, Schema] = cls.model_json_schema()["properties"] if core else {}
        return keys

    @cached_property
    def field(self) -> HeightMap:
        """The numbers over the coordinates of the map."""
        return HeightMap(*self.points[:3], "heights", 1, whole=True)


@shape("profile")
class Profile(Measured):
    """Measured heights over y, the same all along x."""

    angle: Angle = meaning(0.0, "angle of the direction along which it is extruded, from x towards y")
    center: Annotated[float, Quantity(LENGTH)] | None = meaning(
        None, "y of the middle of the points; as in the file if absent"
    )
    y: Line = meaning(None, "places along y instead of a file, as in results", "[0.0, 1e-6]")
    heights: Line = meaning(None, "heights there", "[0.0, 1e-9]")
    extruded: ClassVar[bool] = True
    formula: ClassVar[str] = "h as of a map, of t across the direction of extrusion"
    _placing: ClassVar[tuple[str, ...]] = ("center",)

    @cached_property
    def points(self) -> Points:
        """Points and heights (m) at two places far apart in x."""
        about = "points in the deck, in m"
        if self.file is None:
            y, z = np.asarray(self.y, float), np.asarray(self.heights, float)
            if y.shape != z.shape:
                raise DeckError(f"expected {len(y)} numbers, one for each y")
        else:
            found, z, scale = self._read(profile=True)
            assert found.y is not None
            y = found.y * scale
            units = f"y in {found.units or self.units}, heights in {found.value_units or self.height_units}"
            about = f"{Path(self.file).name}, {units}"
            if self.center is not None:
                y = y - (y.min() + y.max()) / 2 + self.center
        return Points(np.array([-_LONG, _LONG]), y, np.stack([z, z]), about)

    def points_near(self, point: tuple[float, float]) -> tuple[Array, Array]:
        """Return points of the plane (m), one of which is where another body of some center touches first."""
        a, b = math.cos(self.angle), math.sin(self.angle)
        (u, v), y = self._origin, self.field.y
        along = a * (point[0] - u) + b * (point[1] - v)
        return u + a * along - b * y, v + b * along + a * y

    def repeating(self, sides: tuple[float, float] | None) -> Measured:
        """Return the surface over a window that repeats with two sides (m) along x and y; None: others."""
        turns = self.angle / (math.pi / 2)
        if sides is not None and abs(turns - round(turns)) > _EVEN:
            raise DeckError(
                f"{self} repeats with a window along x or y only; expected an angle of 0 or 90 deg"
            )
        return super().repeating(sides and (sides[::-1] if round(turns) % 2 else sides))

    def rows(self, apart: Callable[[float], float]) -> Iterator[str]:
        """Yield lines about the profile, beside the distance of nodes along a direction."""
        (_, y, _, about), (_, moved) = self.points, self._moved_by
        across = self._axes[1]
        step, uneven = _steps(y, across)
        turned = ", t across it" * bool(self.angle)
        yield f"{about}; extruded along {math.degrees(self.angle):.6g} deg from x{turned}"
        spacings = step / apart(self.angle + math.pi / 2)
        yield (
            f"{len(y)} points, {across} from {quantity(y.min() + moved, 'm')} to "
            f"{quantity(y.max() + moved, 'm')}, "
            f"{quantity(step, 'm', 3)} apart{uneven}, {counted(f'{spacings:.3g}', 'spacing')} of the lattice"
        )
        lowest = quantity(float(self._in_period(*self.field.first_touch)[1]) + moved, "m")
        yield f"{self._heights}; nearest to the other body at {across} = {lowest}"
        yield self.field.interpolated


# --- heights ------------------------------------------------------------------------------------------------


def _steps(at: Array, name: str) -> tuple[float, str]:
    """Return the median distance (m) of points along an axis, and the range of uneven ones in words."""
    steps = np.diff(np.sort(at))
    least, most = steps.min(), steps.max()
    words = f"; {quantity(least, 'm', 3)} to {quantity(most, 'm', 3)} in {name}"
    return float(np.median(steps)), words if most - least > _UNEVEN * most else ""


def _centered(at: Array) -> Array:
    """Return coordinates from the middle of their range."""
    return np.asarray(at - (at.min() + at.max()) / 2)


def _filled(heights: Array) -> Array:
    """Return heights of which each without a value has the mean of its neighbors."""
    hole = np.isnan(heights).ravel()
    if not hole.any():
        return heights
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    at = np.arange(heights.size).reshape(heights.shape)
    pairs = [np.stack([a.ravel(), b.ravel()]) for a, b in ((at[1:], at[:-1]), (at[:, 1:], at[:, :-1]))]
    one, other = np.concatenate([*pairs, *(pair[::-1] for pair in pairs)], axis=1)
    here = hole[one]
    number = np.cumsum(hole) - 1
    shape = int(hole.sum()), heights.size
    beside: Any = sparse.csr_matrix((np.ones(here.sum()), (number[one[here]], other[here])), shape=shape)
    count = sparse.diags(np.asarray(beside.sum(axis=1)).ravel())
    found = heights.ravel().copy()
    found[hole] = spsolve((count - beside[:, hole]).tocsc(), beside[:, ~hole] @ found[~hole])
    return found.reshape(heights.shape)


def _closed(
    at: Array, height: Array, axis: int, side: float, taper: float | None, name: str
) -> tuple[Array, Array, str]:
    """Return heights along an axis that repeats, with points beyond both ends, and how the ends meet.

    DeckError if it does not repeat.
    """
    n = len(at)
    step = float(np.ptp(at)) / (n - 1)
    if np.ptp(np.diff(at)) > _EVEN * step:
        raise DeckError(f"a map that repeats has even distances; those in {name} are not")
    whole, shared = (abs(count * step - side) <= _EVEN * side for count in (n, n - 1))
    if not (whole or shared):
        raise DeckError(
            f"the window repeats every {readable(side)} in {name}; expected {readable(n * step)}, as the {n} "
            f"points of the map, or {readable((n - 1) * step)} if the first and the last are the same point"
        )
    heights = np.moveaxis(height, axis, 0)
    seam = heights[-1] - heights[0]
    if taper is not None:
        if taper > float(np.ptp(at)) / 2:
            raise DeckError(f"taper: expected at most half of the map in {name}")
        first, last = (
            np.where(beside < taper, np.cos(0.5 * math.pi * beside / taper) ** 2, 0.0)[:, None]
            for beside in (at - at[0], at[-1] - at)
        )
        heights = heights + (first - last) * seam / 2
        seam = 0.0 * seam
    largest, beside = (
        float(np.fmax.reduce(np.abs(steps), axis=None, initial=0.0))
        for steps in (seam, np.diff(heights, axis=0))
    )
    if largest > 1.001 * beside + _ROUNDED * float(np.nanmax(heights) - np.nanmin(heights)):
        raise DeckError(
            f"the map does not repeat: between its opposite ends in {name} it steps by {readable(largest)}, "
            f"between neighboring points by {readable(beside)} at most; level it, or give taper, the width "
            "over which the step is closed"
        )
    how = f"as its {n} points"
    if not whole:
        heights = heights[:-1]
        how = "its first and last points the same"
        if largest > _ROUNDED * float(np.nanmax(heights) - np.nanmin(heights)):
            how += f" (heights differ by up to {quantity(largest, 'm', 2)}; those of the first count)"
    padded = np.pad(heights, [(_BEYOND, _BEYOND), (0, 0)], mode="wrap")
    return at[0] + step * (np.arange(len(padded)) - _BEYOND), np.moveaxis(padded, 0, axis), how
