"""Files of measured values: text, netCDF, arrays of numpy, and the formats of SurfaceTopography."""

from __future__ import annotations

import functools
import importlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import netcdf_library
from ..arrays import Array
from ..errors import DeckError
from ..files import reading, text_of
from ..text import counted, listed, shown
from .series import MISSING_CELLS, split_header

MOST_POINTS = 1_000_000
"""Points of a map, which is text in the deck of a result."""

_TEXT = (".csv", ".txt", ".dat", ".xyz")
NETCDF = (".nc", ".nc4", ".cdf")
_HEIGHTS = ("z", "h", "height", "heights")  # headers of a column of heights, in small letters
_EXPECTED = "heights as text: a matrix, or columns x, y and z with headers"
_MOST_SENTENCES = 5
_SAME = 1e-7  # distance of equal coordinates of columns, as a share of their range
_EVEN = 0.01  # steps of coordinates may differ by this share, since they are rounded
_FEW = 0.5  # points with a coordinate over the median, from which it counts
_STRAY = 0.1  # of the steps between coordinates that count: those beside another one may differ by it
_SPLIT = 0.1  # smallest over largest step between straight lines
_FULL = 0.7  # points of a file over those of its grid, some of which may be missing
_MOST_EMPTY = 4  # points of the rectangular grid of columns for each line of the file


class MapFile(NamedTuple):
    """Measured values as a file holds them, NaN in holes."""

    values: Array  # (n_x, n_y); of a matrix in its rows and columns; of a profile (n_y,)
    x: Array | None  # (n_x,); None if the file has no coordinates
    y: Array | None
    units: str = ""  # of x and y; empty if the file does not say them
    value_units: str = ""


def read_map(path: Path, variable: str | None = None, profile: bool = False) -> MapFile:
    """Read a map, or a profile of heights over y, in the units of the file."""
    try:
        status = path.stat()
    except FileNotFoundError:
        raise DeckError(f"there is no file {path}") from None
    except (OSError, ValueError) as error:
        raise DeckError(f"{path} cannot be read ({error})") from None
    return _read(path, variable, profile, (status.st_mtime_ns, status.st_size))


@functools.lru_cache(4)
def _read(path: Path, variable: str | None, profile: bool, version: tuple[int, int]) -> MapFile:
    suffix = path.suffix.lower()
    if suffix in _TEXT:
        found = _of_text(path, variable, profile)
    elif suffix in NETCDF:
        found = _of_netcdf(path, variable, profile)
    elif suffix == ".npy":
        found = _of_numpy(path)
    else:
        found = _by_surface_topography(path, variable)
    if variable and suffix in (*_TEXT, ".npy") and found.x is None and not profile:
        raise DeckError(f"{path} has no variables; expected nothing as variable")
    if found.values.ndim != 2 - profile:
        kind = "a profile: columns y and z" if profile else "a map over x and y"
        raise DeckError(f"{path}: expected {kind}, not values of {found.values.ndim} dimensions")
    if min(found.values.shape) < 2:
        raise DeckError(f"{path}: expected at least two points along each axis")
    if found.x is None and not profile and (edge := _edge_of_coordinates(found.values)):
        raise DeckError(
            f"{path}: {edge} evenly, as coordinates and numbers of columns do, and no other ones; expected a "
            "matrix without them, or columns x, y and z with headers"
        )
    if np.isinf(found.values).any():
        raise DeckError(f"{path}: expected finite heights, and NaN or nothing in holes; one is infinite")
    for name, points in (("x", found.x), ("y", found.y)):
        if points is None:
            continue
        if not np.isfinite(points).all():
            raise DeckError(f"{path}: expected finite coordinates {name}")
        if len(np.unique(points)) < len(points):
            raise DeckError(f"{path}: expected each {name} once; some occur twice")
    return found


def _refuse_many(path: Path, count: int) -> None:
    if count > MOST_POINTS:
        raise DeckError(
            f"{path}: expected a map of at most {MOST_POINTS:,} points, not {count:,}; choose a part of it, "
            "or a coarser one"
        )


# --- text ---------------------------------------------------------------------------------------------------


def _of_text(path: Path, variable: str | None, profile: bool) -> MapFile:
    """Read a matrix, or columns below a line of headers, which may begin with #."""
    lines = [(n, line) for n, line in enumerate(text_of(path, _EXPECTED).splitlines(), 1) if line.strip()]
    rows = [(n, line) for n, line in lines if line.lstrip()[0] not in "#%"]
    if not rows:
        raise DeckError(f"{path}: is empty; expected {_EXPECTED}")
    separator = next((mark for mark in "\t;," if mark in rows[-1][1]), None)
    cells = [[cell.strip().strip('"') for cell in line.split(separator)] for _, line in rows]
    numbers = [n for n, _ in rows]
    if separator and not any(row[-1] for row in cells):  # each line ends with a separator
        cells = [row[:-1] for row in cells]
    headers: list[str] = []
    if not all(_is_number(cell) or _has_comma(cell) for cell in cells[0]):
        headers = cells.pop(0)
        del numbers[0]
    elif above := [line for n, line in lines if n < rows[0][0]]:
        named = [cell.strip() for cell in above[-1].lstrip(" \t#%").split(separator)]
        if len(named) == len(cells[0]) > 1 and not all(map(_is_number, named)):
            headers = named
    count = len(headers) or len(cells[0])
    wrong = [(n, len(row)) for n, row in zip(numbers, cells, strict=True) if len(row) != count]
    if wrong or not cells:
        faults = [f"{path}, line {n}: expected {counted(count, 'cell')}, not {found}" for n, found in wrong]
        raise DeckError("\n".join(faults[:_MOST_SENTENCES]) or f"{path}: expected rows below the headers")
    _refuse_many(path, len(cells) * (1 if headers else count))
    values = _numbers(path, cells, numbers)
    if profile:
        if not headers and count != 2:
            raise DeckError(f"{path}: expected two columns, y and z, not {count}; or headers")
        names = headers or ["y", "z"]
        (y, units), (z, value_units) = _column(path, names, ("y", "x")), _column(path, names, (), variable)
        order = np.argsort(values[:, y], kind="stable")
        return MapFile(values[order, z], None, values[order, y], units, value_units)
    if not headers:
        if count == 3:
            raise DeckError(
                f"{path}: three columns without headers are a matrix, or columns of coordinates; "
                "expected a first line x, y, z, or a matrix of another size"
            )
        return MapFile(values, None, None)
    (x, units), (y, others) = (_column(path, headers, (name,)) for name in "xy")
    z, value_units = _column(path, headers, (), variable)
    if others != units:
        raise DeckError(f"{path}: expected x and y in one unit, not {shown(units)} and {shown(others)}")
    gridded = _gridded(path, values[:, x], values[:, y], values[:, z], numbers)
    return MapFile(*gridded, units, value_units)


def _edge_of_coordinates(rows: Array) -> str:
    """Return which edge of a matrix looks like coordinates: it rises evenly, its neighbors do not."""

    def alone(matrix: Array) -> bool:
        steps = np.diff(matrix[:2, 1:], axis=1)
        if steps.shape[1] < 3:
            return False
        means = np.abs(steps.mean(axis=1))
        first, second = np.ptp(steps, axis=1) <= _EVEN * means
        return bool(first and means[0] > 0.0 and not second)

    if alone(rows) and alone(rows.T):
        return "the first row and the first column rise"
    counted = np.diff(rows[0])
    return (
        "the first row rises" if alone(rows) and (counted == 1.0).all() and rows[0, 0] in (0.0, 1.0) else ""
    )


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return cell.lower() in MISSING_CELLS
    return True


def _has_comma(cell: str) -> bool:
    return bool(re.fullmatch(r"[+-]?\d+,\d+", cell))


def _numbers(path: Path, cells: Sequence[Sequence[str]], lines: Sequence[int]) -> Array:
    """Return the cells as numbers, NaN of those without a value."""
    try:
        return np.array(cells).astype(float)
    except ValueError:
        pass
    for line, row in zip(lines, cells, strict=True):
        for place, cell in enumerate(row, 1):
            if not _is_number(cell):
                hint = "; a number has a decimal point" * _has_comma(cell)
                raise DeckError(
                    f"{path}, line {line}, cell {place}: expected a number, not {shown(cell)}{hint}"
                )
    known = [["nan" if cell.lower() in MISSING_CELLS else cell for cell in row] for row in cells]
    return np.array(known).astype(float)


def _column(
    path: Path, headers: Sequence[str], names: Sequence[str], variable: str | None = None
) -> tuple[int, str]:
    """Return the place and the unit of a column, of the heights without names."""
    split = [split_header(name) for name in headers]
    wanted = names or ([variable.lower()] if variable else _HEIGHTS)
    found = [place for place, (name, _) in enumerate(split) if name.lower() in wanted]
    if len(found) != 1:
        expected = listed([shown(name) for name in wanted], "or")
        known = listed([shown(name) for name, _ in split[:_MOST_SENTENCES]], "and")
        raise DeckError(f"{path}: expected one column {expected} among its headers {known}")
    return found[0], split[found[0]][1]


def _gridded(path: Path, x: Array, y: Array, z: Array, lines: Sequence[int]) -> tuple[Array, Array, Array]:
    """Return heights over the rectangular grid of their points, NaN where none is, and the coordinates."""
    bad = ~(np.isfinite(x) & np.isfinite(y))
    if bad.any():
        raise DeckError(f"{path}, line {lines[int(np.argmax(bad))]}: expected finite coordinates x and y")
    (across, col), (up, row) = _distinct(x), _distinct(y)
    for name, at, place in (("x", across, col), ("y", up, row)):
        stray = _stray(at, place)
        if stray is not None:
            value, beside = f"{at[stray]:.6g}", f"{at[stray - 1] if stray else at[1]:.6g}"
            line = lines[int(np.argmax(place == stray))]
            raise DeckError(
                f"{path}, line {line}: expected points of a rectangular grid: few have {name} = {value}, "
                f"beside {beside}"
            )
    size = len(across) * len(up)
    for name, at in (("x", across), ("y", up)):
        steps = np.diff(at)
        if len(z) < _FULL * size and len(steps) > 1 and steps.min() < _SPLIT * steps.max():
            raise DeckError(
                f"{path}: expected points of a rectangular grid: {len(z)} of them have {len(at)} different "
                f"{name}, some nearly the same; round them, or interpolate to even distances"
            )
    if size > _MOST_EMPTY * len(z):
        raise DeckError(
            f"{path}: expected points of a rectangular grid: {len(z)} of them have {len(across)} different "
            f"x and {len(up)} different y"
        )
    _refuse_many(path, size)
    index = col * len(up) + row
    _, first, times = np.unique(index, return_index=True, return_counts=True)
    if (times > 1).any():
        twice = lines[int(first[times > 1].min())]
        raise DeckError(f"{path}: expected each point once; that of line {twice} occurs again")
    values = np.full(size, np.nan)
    values[index] = z
    return values.reshape(len(across), len(up)), across, up


def _stray(at: Array, place: Array) -> int | None:
    """Return a coordinate that few points have, nearer to others or further from them than those; or None."""
    count = np.bincount(place)
    few = count < _FEW * np.median(count)
    steps, all_steps = np.diff(at[~few]), np.diff(at)
    if not steps.size:
        return None
    apart = np.minimum(np.append(all_steps, np.inf), np.insert(all_steps, 0, np.inf))
    # steps may grow and shrink to an end as they do within
    growth = max((steps[1:] / steps[:-1]).max(initial=1.0), (steps[:-1] / steps[1:]).max(initial=1.0))
    number, last = np.arange(len(at)), len(all_steps) - 1
    lower = all_steps[np.minimum(number + 1, last)]
    inward = np.where(number < len(at) // 2, lower, all_steps[np.maximum(number - 2, 0)])
    least, most = np.minimum(inward / growth, steps.min()), np.maximum(inward * growth, steps.max())
    regular = (apart > (1.0 - _STRAY) * least) & (apart < (1.0 + _STRAY) * most)
    found = np.flatnonzero(few & ~regular).tolist()
    return found[0] if found else None


def _distinct(values: Array) -> tuple[Array, Array]:
    """Return the different coordinates, apart by more than rounding, and the place of each value in them."""
    order = np.argsort(values, kind="stable")
    sorted_ = values[order]
    new = np.concatenate([[True], np.diff(sorted_) > _SAME * np.ptp(values)])
    place = np.empty(len(values), int)
    place[order] = np.cumsum(new) - 1
    return sorted_[new], place


# --- other formats ------------------------------------------------------------------------------------------


def _of_netcdf(path: Path, variable: str | None, profile: bool) -> MapFile:
    """Read a variable with the coordinates x and y: that of a name, or the only one."""
    if profile:
        raise DeckError(f"{path}: expected a profile as text, columns y and z")
    with reading(path, "a map in netCDF"), netcdf_library.opened_by_xarray(path) as dataset:
        known = {str(name): v for name, v in dataset.data_vars.items() if {"x", "y"} <= set(v.coords)}
        if variable is not None and variable not in known:
            named = listed([shown(name) for name in known], "and") or "none"
            raise DeckError(
                f"expected a variable with the coordinates x and y in {path}, not {shown(variable)}; "
                f"there is {named}"
            )
        maps = [v for name, v in known.items() if variable in (None, name)]
        if len(maps) != 1:
            more = "; choose one with variable" if maps else ""
            raise DeckError(
                f"expected one variable with the coordinates x and y in {path}, not {len(maps)}{more}"
            )
        _refuse_many(path, maps[0].size)
        found = maps[0].load()
    x, y = found.coords["x"], found.coords["y"]
    if x.ndim != 1 or y.ndim != 1 or set(found.dims) != {*x.dims, *y.dims}:
        raise DeckError(f"{path}: expected coordinates x and y along a dimension each")
    units, others, of_values = (
        str(one.attrs.get("units", one.attrs.get("unit", ""))) for one in (x, y, found)
    )
    if units != others:
        raise DeckError(f"{path}: expected x and y in one unit, not {shown(units)} and {shown(others)}")
    values = found.transpose(*x.dims, *y.dims).to_numpy().astype(float)
    return MapFile(values, x.to_numpy().astype(float), y.to_numpy().astype(float), units, of_values)


def _of_numpy(path: Path) -> MapFile:
    with reading(path, "an array of numpy"):
        mapped = np.load(path, mmap_mode="r", allow_pickle=False)
        if not (isinstance(mapped, np.ndarray) and mapped.dtype.kind in "iuf"):
            raise DeckError(f"{path}: expected an array of real numbers")
        _refuse_many(path, mapped.size)
        return MapFile(np.array(mapped, float), None, None)


def _by_surface_topography(path: Path, channel: str | None) -> MapFile:
    """Read a file of a microscope or profiler."""
    try:
        library: Any = importlib.import_module("SurfaceTopography")
    except ImportError:
        known = listed([*_TEXT, *NETCDF, ".npy"], "and")
        raise DeckError(
            f"{path}: this format is read by the package SurfaceTopography: pip install SurfaceTopography; "
            f"without it expected {known}"
        ) from None
    try:
        opened = library.open_topography(str(path))
    except Exception as error:  # each reader has its own
        kind = type(error).__name__
        raise DeckError(f"{path}: SurfaceTopography cannot read it ({kind})") from None
    with reading(path, "a file of heights"), opened as reader:
        names = [str(one.name) for one in reader.channels]
        if channel is None and len(names) > 1:
            raise DeckError(f"{path}: expected a variable, one of {listed(list(map(shown, names)), 'and')}")
        if channel is not None and channel not in names:
            known = listed(list(map(shown, names)), "and")
            raise DeckError(f"{path}: expected one of its channels {known} as variable, not {shown(channel)}")
        about = reader.channels[names.index(channel) if channel else 0]
        _refuse_many(path, int(np.prod(about.nb_grid_pts)))
        sizes: Any = {} if about.physical_sizes is not None else {"physical_sizes": about.nb_grid_pts}
        found = about.topography(**sizes)
        values: Array = np.ma.filled(np.ma.asarray(found.heights(), float), np.nan)
        unit = str(found.unit or "")
        if not found.is_uniform:
            raise DeckError(f"{path}: expected points with an even distance")
        if sizes:  # a matrix whose distances the deck gives
            return MapFile(values.T, None, None, unit, unit)
        x, *y = (size / n * np.arange(n) for size, n in zip(found.physical_sizes, values.shape, strict=True))
        return MapFile(values, x, y[0], unit, unit) if y else MapFile(values, None, x, unit, unit)
