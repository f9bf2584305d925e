"""Load histories as time series: the table `series` of a [[load]], and reading it from CSV or netCDF files.

Each row of a file is the end of a load step. A case contains the numbers and not the name of the file, so
that its result can be run again when the file is deleted or changed.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic_core import PydanticCustomError

from .. import netcdf_library
from ..errors import DeckError
from ..files import is_defect, require_ordinary, text_of
from ..text import counted, did_you_mean, folded, listed, shown
from ..variables import LOADS
from .kinds import Kind, Quantity, Several, Text, refuse
from .table_base import Conflicts, Table, extended, meaning, refused
from .units import ANGLE, FORCE, LENGTH, PRESSURE, TORQUE, spelled


class Driven(NamedTuple):
    """A load or motion with its own key in decks and files of series."""

    kind: Quantity  # kind of its values
    meaning: str  # of the key in [[load]]
    noun: str
    header: str  # example of the header of a column
    example: str = ""  # example of a value, if that of its dimension does not suit
    mean_of: str = ""  # of a mean over a window that repeats: the load or motion that it is
    values: str = ""  # example of an array, if 1 and 2 in the unit of the header do not suit


def _each(axes: Sequence[str], key: str, kind: Quantity, *words: str) -> dict[str, Driven]:
    """Return a row for each axis, whose name stands for {} in key and words."""
    return {key.format(axis): Driven(kind, *(word.format(axis) for word in words)) for axis in axes}


_LENGTH, _PRESSURE = Quantity(LENGTH), Quantity(PRESSURE)
_AREA = "over the area of a window that repeats"
COLUMNS: dict[str, Driven] = {
    "normal_load": Driven(Quantity(FORCE, at_least=0), "normal load P", "normal load", "P [N]"),
    **_each(
        *("xy", "tangential_load_{}", Quantity(FORCE), "tangential load on body 1 along {}"),
        *("tangential load along {}", "Q{} [N]", FORCE.example),
    ),
    "torque": Driven(
        Quantity(TORQUE), "moment about z through x = y = 0; frees the twist", "torque", "M [N mm]"
    ),
    "approach": Driven(
        _LENGTH, "approach of the bodies, instead of normal_load", "approach", "depth [um]", '"1 um"'
    ),
    **_each(
        *("xy", "shift_{}", _LENGTH, "tangential motion of body 2, instead of tangential_load_{}"),
        *("shift along {}", "u{} [um]", '"1 um"'),
    ),
    **_each(
        *(("xx", "yy", "xy"), "bulk_stress_{}", _PRESSURE),
        "bulk stress {} of the body that [bulk] names, tension positive",
        *("bulk stress {}", "S{} [MPa]", '"80 MPa"', "", '["0 MPa", "80 MPa"]'),
    ),
    "twist": Driven(
        *(Quantity(ANGLE), "rotation about z, instead of torque", "twist", "angle [deg]"),
        values='["0 deg", "1 deg"]',
    ),
    "mean_pressure": Driven(
        *(Quantity(PRESSURE, at_least=0), f"normal load {_AREA}, instead of normal_load"),
        *("mean pressure", "p [MPa]", "", "normal_load"),
    ),
    "mean_gap": Driven(
        *(Quantity(LENGTH, above=0), "mean of the gap over a window that repeats, instead of normal_load"),
        *("mean gap", "gap [um]", '"0.2 um"', "approach"),
    ),
    **_each(
        *("xy", "mean_traction_{}", _PRESSURE, f"tangential load along {{}} {_AREA}"),
        *("mean traction along {}", "q{} [MPa]", '"20 MPa"', "tangential_load_{}"),
    ),
}
"""The loads and motions by key."""
MEANS = {name: load.mean_of for name, load in COLUMNS.items() if load.mean_of}
"""The loads of a window that repeats, and the load or motion that each of them is."""
CONTROLS = [(*pair, *(mean for mean, load in MEANS.items() if load in pair)) for pair in LOADS.values()]
"""The keys of each motion, of which a segment or row has one."""

_IGNORED = ("time", "step")  # columns of files that are no deck keys
_MOST_SENTENCES = 10
_LONGEST_LABEL = 1000  # characters
_EXPECTED = "a CSV or netCDF file of loads"
MISSING_CELLS = ("", "nan", "na", "n/a", "null", "none", "-", "--")  # cells without a value, in small letters
_SEPARATORS = ("\t", ";", ",")
_THOUSANDS = r"[+-]?\d{1,3}(?:[ ']\d{3})+(?:\.\d*)?"
_NUMBER = r"[+-]?\.?\d"  # its beginning
_FORTRAN_EXPONENT = r"(?<=[\d.])[dD](?=[+-]?\d+$)"
_BETWEEN_BLANKS = r"[^\s\[(]+(?:\s*(?:\[[^\[\]]*\]|\([^()]*\)))?"  # a header with its unit

MOST_STEPS = 100_000
"""Load steps of a history, and rows of a series."""


# --- the table ------------------------------------------------------------------------------------


class OrEmpty(Kind):
    """A value, or "" in rows without it."""

    def __init__(self, kind: Kind) -> None:
        self.kind, self.expected = kind, kind.expected
        self.schema = {"anyOf": [{"const": ""}, kind.schema]}

    def _parse(self, value: object) -> Any:
        return None if value is None or value == "" else self.kind.parse(value)

    def written(self, value: Any) -> Any:
        """Return the value, or ""."""
        return "" if value is None else self.kind.written(value)


_Header = Annotated[str, Text()] | None
_Headers: Any = extended(
    Table,
    {
        name: (_Header, meaning(None, f"header of the column of {name}", f'"{load.header}"'))
        for name, load in COLUMNS.items()
    },
)


class Columns(_Headers):
    """Headers of the columns of a file by key."""

    label: _Header = meaning(None, "header of the column of labels", '"phase"')


class _File(Table):
    file: Annotated[str, Text()] | None = meaning(
        None, "CSV or netCDF (`.nc`) file of the rows, relative to the deck", '"history.csv"'
    )
    columns: Columns | None = meaning(
        None, "header of the column for each key, where it is not the key itself", '{ normal_load = "P [N]" }'
    )


def split_header(header: str) -> tuple[str, str]:
    """Return a header without its unit, and the unit."""
    name = header.strip()
    opening = {"]": "[", ")": "("}.get(name[-1:], "")
    before, bracket, unit = name[:-1].rpartition(opening) if opening else ("", "", "")
    return (before.strip(), unit.strip()) if bracket and name[-1] not in unit else (name, "")


def _rows(name: str, load: Driven) -> tuple[Any, Any]:
    unit = split_header(load.header)[1]
    example = load.values or f'["1 {unit}", "2 {unit}"]'
    kind = Several(OrEmpty(load.kind), f"values, each {load.kind.expected} or empty text", example)
    others = ", instead of a file; so are the other arrays" * (name == "normal_load")
    return Annotated[tuple[float | None, ...], kind] | None, meaning(None, f"{load.noun} of each row{others}")


_Rows: Any = extended(_File, {name: _rows(name, load) for name, load in COLUMNS.items()})


class Series(_Rows):
    """A series of loads and motions, row by row: in a file, or as arrays."""

    label: Annotated[tuple[str, ...], Several(Text(), "texts", '["up", "down"]')] | None = meaning(
        None, "label of each row; rows in turn with the same are one segment of the result"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require arrays of one length, one control of each motion in a row, and a file without arrays."""
        data = {key: value for key, value in data.items() if value is not None}  # None comes from Python
        arrays = {key: data[key] for key in (*COLUMNS, "label") if isinstance(data.get(key), list | tuple)}
        if "file" in data:
            yield from refused(data, (*COLUMNS, "label"), "expected in the file, not beside it")
            return
        if "columns" in data:
            yield "columns", "needs a file"
        if not any(key in data for key in COLUMNS):
            yield "", "expected a file, or arrays such as normal_load = [10, 20, 30]"
        for key, array in arrays.items():
            if len(array) != (count := len(next(iter(arrays.values())))):
                entries = counted(count, "entry", "entries")
                yield key, f"expected {entries}, as many as {next(iter(arrays))} has, not {len(array)}"
                return
        for row, force, displacement in driven_twice(arrays):
            yield displacement, f"expected {force} or {displacement} in each row, not both (entry {row + 1})"

    @property
    def _arrays(self) -> dict[str, Any]:
        return {key: array for key in (*COLUMNS, "label") if (array := getattr(self, key)) is not None}

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(next(iter(self._arrays.values())))

    @property
    def missing(self) -> dict[str, int]:
        """Number of rows without a value of each load or motion that other rows have."""
        arrays, counts = self._arrays, {}
        arrays.pop("label", None)
        for key in arrays:
            others = next((names for names in CONTROLS if key in names), (key,))
            columns = [arrays[name] for name in others if name in arrays]
            counts[key] = sum(all(entry is None for entry in row) for row in zip(*columns, strict=True))
        return {key: count for key, count in counts.items() if count}

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the values of each row, in SI, and its label."""
        arrays = self._arrays
        for row in zip(*arrays.values(), strict=True):
            yield {key: value for key, value in zip(arrays, row, strict=True) if value is not None}


def driven_twice(arrays: Mapping[str, Any]) -> Iterator[tuple[int, str, str]]:
    """Yield the first row with two controls of a motion, and their keys, for each motion."""
    for names in CONTROLS:
        known = [name for name in names if name in arrays]
        for row, entries in enumerate(zip(*(arrays[name] for name in known), strict=False)):
            given = [name for name, entry in zip(known, entries, strict=True) if entry not in ("", None)]
            if given[1:]:
                yield row, given[0], given[1]
                break


# --- files ----------------------------------------------------------------------------------------


class _Column(NamedTuple):
    """A column of a file: header without unit, unit (may be empty), and cells."""

    header: str
    unit: str
    cells: list[Any]


def read_series(path: Path, columns: Mapping[str, Any] | None = None) -> dict[str, list[Any]]:
    """Return a series of loads from a file."""
    netcdf = path.suffix in (".nc", ".nc4", ".cdf")
    found, lines = (_netcdf_columns if netcdf else _text_columns)(path)
    chosen = _chosen(path, found, columns)
    where = "entry" if netcdf else "line"
    series: dict[str, list[Any]] = {}
    problems: list[str] = []
    for key, column in chosen.items():
        series[key] = []
        try:  # once instead of in each row
            if key != "label" and column.unit:
                COLUMNS[key].kind.parse(f"1 {column.unit}")
        except PydanticCustomError as error:
            problems.append(f"{path}, column {shown(column.header)}: {error.message()}")
            continue
        for line, cell in zip(lines, column.cells, strict=True):
            try:
                series[key].append(str(cell) if key == "label" else _value(key, cell, column.unit))
            except PydanticCustomError as error:
                series[key].append("")
                place = f"{path}, {where} {line}, column {shown(column.header)}"
                noise = _noise(column.cells, cell) if key == "normal_load" else ""
                problems.append(f"{place} = {shown(cell)}: {error.message()}{noise}")
    for row, force, displacement in driven_twice(series):
        place = f"{path}, {where} {lines[row]}"
        problems.append(f"{place}: expected {force} or {displacement}, not both; choose one with columns")
    if problems:
        more = len(problems) - _MOST_SENTENCES
        raise DeckError("\n".join(problems[:_MOST_SENTENCES] + [f"{path}: and {more} more"] * (more > 0)))
    return series


def _noise(cells: Sequence[Any], cell: Any) -> str:
    """Return the remedy for a small normal load below 0."""
    numbers = [number for number in map(_number, map(str, cells)) if number is not None]
    number, largest = _number(str(cell)), max(numbers, default=0.0)
    if number is None or not 0.0 < -number < 0.01 * largest:
        return ""
    return f"; this is noise, {-number / largest:.2g} of the largest one: write 0"


def _value(key: str, cell: Any, unit: str) -> Any:
    if isinstance(cell, str):
        if cell.lower() in MISSING_CELLS:
            return ""
        text = cell = spelled(cell)
        if re.fullmatch(_THOUSANDS, text):
            refuse("expected a number without separators of thousands")
        if re.fullmatch(r"[+-]?[\d.]+,\d+", text):
            refuse("expected a decimal point, not a comma")
        if (number := _number(text)) is not None:
            cell = re.sub(_FORTRAN_EXPONENT, "e", text) if unit else number
        elif unit and _number([*text.split(), ""][0]) is not None:
            refuse(f"expected a number without a unit, since the header has the unit [{unit}]")
        else:
            unit = ""  # it has its own
    return COLUMNS[key].kind.written(COLUMNS[key].kind.parse(f"{cell} {unit}" if unit else cell))


def _number(text: str) -> float | None:
    try:
        return float(re.sub(_FORTRAN_EXPONENT, "e", text))
    except ValueError:
        return None


def _chosen(path: Path, found: list[_Column], columns: Mapping[str, Any] | None) -> dict[str, _Column]:
    """Return the column of each key."""
    keys, problems = (*COLUMNS, "label"), []
    chosen: dict[str, _Column] = {}
    meant = {folded(key): key for key in keys}
    headers = [column.header for column in found]
    for twin in dict.fromkeys(header for header in headers if headers.count(header) > 1 and header):
        problems.append(f"{path}: expected each column once; {shown(twin)} is there more than once")
    if columns is None:
        for column in found:
            if key := meant.get(folded(column.header)):
                if key in chosen and column.header not in headers[: headers.index(column.header)]:
                    both = f"{shown(chosen[key].header)} and {shown(column.header)}"
                    problems.append(f"{path}: expected each column once; {both} are {key}")
                chosen[key] = column
            elif folded(column.header) not in _IGNORED:
                others = (
                    f"; known are {listed(keys, 'and')}; to leave columns out, name the others with columns"
                )
                hint = did_you_mean(column.header, keys) or others
                problems.append(f"{path}: unknown column {shown(column.header)}{hint}")
    else:
        for key, header in columns.items():
            name, unit = split_header(str(header))
            if name not in headers:
                there = [*map(shown, headers[:_MOST_SENTENCES])]
                there += ["others"] * (len(headers) > _MOST_SENTENCES)
                hint = did_you_mean(name, headers) or f"; there are {listed(there, 'and')}"
                problems.append(f"{path}: has no column {shown(name)} for {key}{hint}")
                continue
            column = found[headers.index(name)]
            if unit and column.unit and unit != column.unit:
                units = f"in {column.unit}, not in {unit} as in columns"
                problems.append(f"{path}: column {shown(name)} is {units}")
            chosen[key] = _Column(column.header, unit or column.unit, column.cells)
    if not problems and not any(key in COLUMNS for key in chosen):
        problems.append(f"{path}: expected a column of loads or motions, such as normal_load [N]")
    if not problems and not found[0].cells:
        problems.append(f"{path}: expected at least one row below the headers")
    if problems:
        raise DeckError("\n".join(problems))
    return chosen


def _text_columns(path: Path) -> tuple[list[_Column], list[int]]:
    """Return columns and line numbers of a text file without empty lines and lines that begin with #.

    The line of headers may begin with # itself, as numpy.savetxt writes it, and follow a line sep=; of Excel.
    """
    lines = [(n, line) for n, line in enumerate(text_of(path, _EXPECTED).splitlines(), 1) if line.strip()]
    separator = ""
    if lines and (given := lines[0][1].strip().lower()).startswith("sep=") and len(given) == len("sep=;"):
        separator = given[-1]
        del lines[0]
    remarks = [(number, line.lstrip()[1:]) for number, line in lines if line.lstrip().startswith("#")]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    if lines and (above := [remark for remark in remarks if remark[0] < lines[0][0]]):
        split = _cells(lines[0][1], separator or _separator(*(line for _, line in lines[:3])))
        if all(_number(cell) is not None or cell.lower() in MISSING_CELLS for cell in split):
            lines.insert(0, above[-1])
    if not lines:
        raise DeckError(f"{path}: is empty; expected a line of headers such as normal_load [N], and rows")
    _refuse_many(path, len(lines) - 1)
    separator = separator or _separator(*(line for _, line in lines[:3]))
    try:
        headers, *rows = (_cells(line, separator) for _, line in lines)
    except csv.Error as error:
        raise DeckError(f"{path}: cannot be read ({error}); expected {_EXPECTED}") from None
    if separator == " ":
        headers = re.findall(_BETWEEN_BLANKS, lines[0][1])
    while len(headers) > 1 and not headers[-1] and not any(any(row[len(headers) - 1 :]) for row in rows):
        headers.pop()
    rows = [row if any(row[len(headers) :]) else row[: len(headers)] for row in rows]  # trailing separators
    expected = f"expected {counted(len(headers), 'cell')}, as many as headers in line {lines[0][0]}"
    problems = [
        f"{path}, line {number}: {expected}, not {len(row)}"
        for (number, _), row in zip(lines[1:], rows, strict=True)
        if len(row) != len(headers)
    ]
    if problems:
        raise DeckError("\n".join(problems[:_MOST_SENTENCES]))
    names, numbers = [split_header(header) for header in headers], [number for number, _ in lines[1:]]
    if len(rows) > 1 and not any(unit for _, unit in names) and _are_units(*rows[:2]):
        names = [(name, unit.strip("[]() -")) for (name, _), unit in zip(names, rows[0], strict=True)]
        del rows[0], numbers[0]
    columns = [_Column(*name, [row[place] for row in rows]) for place, name in enumerate(names)]
    return columns, numbers


def _separator(header: str, *rows: str) -> str:
    """Return the separator of cells; blanks if no other is there, and all lines have as many words."""
    for mark in _SEPARATORS:
        if mark in header:
            return mark
    count = len(re.findall(_BETWEEN_BLANKS, header))
    words = [row.split() for row in rows]
    as_many = count > 1 and all(len(row) == count for row in words)
    return " " if as_many and any(_number(word) is not None for row in words for word in row) else ","


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line."""
    if separator == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _are_units(row: list[str], below: list[str]) -> bool:
    """Return whether a row holds words above numbers, such as the units below headers."""
    words = [(cell, number) for cell, number in zip(row, below, strict=True) if cell not in ("", "-")]
    return bool(words) and all(
        cell.lower() not in MISSING_CELLS and not re.match(_NUMBER, cell) and _number(number) is not None
        for cell, number in words
    )


def _refuse_many(path: Path, rows: int) -> None:
    if rows > MOST_STEPS:
        raise DeckError(f"{path}: expected at most {MOST_STEPS} rows, not {rows}")


def _netcdf_columns(path: Path) -> tuple[list[_Column], list[int]]:
    """Return the variables along the dimension of the first load or motion, and their row numbers."""
    import netCDF4
    import numpy as np

    if not path.exists():
        raise DeckError(f"{path}: no such file; expected {_EXPECTED}")
    require_ordinary(path, _EXPECTED)
    try:
        with netcdf_library.opened(path) as file:
            lengths = {
                name: variable.shape[0]
                for name, variable in file.variables.items()
                if name not in file.dimensions
                and (
                    (variable.ndim == 1 and getattr(variable.dtype, "kind", "U") in "iufU")
                    or _is_text(variable)
                )
            }
            longest = max(lengths.values(), default=0)
            count = next((lengths[key] for key in COLUMNS if key in lengths), longest)
            _refuse_many(path, count)
            columns = []
            for name in (name for name, length in lengths.items() if length == count):
                variable = file.variables[name]
                values = variable[:]
                if _is_text(variable) and values.dtype == "S1":
                    values = netCDF4.chartostring(np.ma.filled(values, b""))
                if _is_text(variable) or variable.dtype is str:
                    cells = [str(value) for value in values]
                else:
                    numbers = np.ma.filled(values.astype(float), np.nan)
                    cells = ["" if np.isnan(number) else number for number in numbers.tolist()]
                unit = str(getattr(variable, "units", "")).strip()
                columns.append(_Column(name, "" if unit == "1" else unit, cells))
    except DeckError:
        raise
    except Exception as error:  # of any type if the file is damaged
        if is_defect(error):
            raise
        raise DeckError(f"{path}: cannot be read as netCDF ({error})") from None
    return columns, list(range(1, count + 1))


def _is_text(variable: Any) -> bool:
    """Return whether a variable holds texts as characters."""
    return bool(variable.dtype == "S1" and variable.ndim == 2 and variable.shape[1] <= _LONGEST_LABEL)
