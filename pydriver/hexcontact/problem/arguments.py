"""Arguments of a case built in Python, as the tables of a deck, which is what everything else understands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import reals
from ..core import contact as native
from ..deck.surfaces import Surface
from ..deck.units import LENGTH, UnitError, to_si
from ..errors import DeckError
from ..text import listed

if TYPE_CHECKING:
    import xarray

    from ..core.lattice import Lattice
    from .settings import Body

Array = NDArray[np.float64]


def given(**keys: Any) -> dict[str, Any]:
    """Keep the keys that were given, with plain values."""
    return {key: plain(value) for key, value in keys.items() if value is not None}


def plain(value: Any) -> Any:
    """Turn numpy numbers and arrays into what a deck can hold."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [plain(entry) for entry in value]
    return value


def gap_given(gap: Any, lattice: Lattice | None) -> Callable[[Array, Array], ArrayLike] | Array | None:
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
    return native.shaped(gap, lattice, "gap").copy()


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


def body_keys(body: Body | Mapping[str, Any]) -> Any:
    """Return a body as the keys of its table; whatever is neither is left to the deck to refuse."""
    if isinstance(body, Mapping):
        return given(**body)
    if not hasattr(body, "young_modulus"):
        return body
    keys = given(young_modulus=body.young_modulus, poisson_ratio=body.poisson_ratio, surface=body.surface)
    return {**keys, "rigid": True} if body.rigid else keys


def segments(loads: Any) -> Any:
    """Return the entries of [[load]]; whatever are none is left to the deck to refuse."""
    if isinstance(loads, Mapping):
        return [with_radians(loads)]
    return [with_radians(load) for load in loads] if isinstance(loads, list | tuple) else plain(loads)


def with_radians(load: Any) -> Any:
    """Give bare angles of a load their unit: in Python, unlike in a deck, all numbers are SI."""
    if not isinstance(load, Mapping):
        return load
    load = given(**load)
    if isinstance(load.get("twist"), int | float) and not isinstance(load["twist"], bool):
        load["twist"] = f"{load['twist']!r} rad"
    if isinstance(load.get("series"), Mapping):
        load["series"] = {key: _rows(key, rows) for key, rows in given(**load["series"]).items()}
    if isinstance(load.get("path"), list):
        load["path"] = [with_radians(segment) for segment in load["path"]]
    return load


def middle_of(lattice: Lattice) -> list[float]:
    """Return the point (m) about which a deck finds the same window again."""
    middle = [lattice.cols[lattice.n_col // 2], lattice.rows[lattice.n_row // 2]]
    center: list[float] = (lattice.origin + middle @ lattice.basis).tolist()
    return center


def _rows(key: str, rows: Any) -> Any:
    """Return an array of a series; NaN and None are rows that name nothing."""
    if not isinstance(rows, list):
        return rows
    filled = ["" if row is None or row != row else row for row in rows]
    return [f"{row!r} rad" if key == "twist" and isinstance(row, int | float) else row for row in filled]


def as_toml(data: Mapping[str, Any], gap_given: bool) -> str:
    """Write the deck of a case that did not come from a file as it stands."""
    import tomli_w

    def entry_of(value: Any) -> Any:
        if isinstance(value, Surface):
            keys = value.model_dump(exclude_defaults=True)
            if "angle" in keys:
                keys["angle"] = f"{keys['angle']!r} rad"
            return entry_of({"shape": value.shape, **keys})
        if isinstance(value, Mapping):
            return {str(key): entry_of(entry) for key, entry in value.items() if entry is not None}
        if isinstance(value, list | tuple):
            return ["" if entry is None else entry_of(entry) for entry in value]
        return plain(value)

    tables = entry_of(data)
    if gap_given:
        # Refused when read again, instead of solving something else.
        tables["body"]["1"]["surface"] = {"shape": "python"}
    return tomli_w.dumps(tables)
