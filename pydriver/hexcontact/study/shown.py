"""The result of a study as a table: a row for each case, in a terminal, as CSV, as an object."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import netcdf_library
from ..errors import DeckError
from ..files import reading, require_utf8
from ..result.view import last_steps
from ..text import quantity, text_table, visible
from ..variables import SUMMARY
from .collect import DONE, STATES
from .folder import INDEX

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]
    import xarray

_MOST_ROWS = 100  # in a terminal
_STATE = ("status", "exit_code", "message")


def study_of(path: Path) -> Path | None:
    """Return the result of a study by its file or the folder of its cases; None for other files."""
    if path.is_dir():
        if not (path / INDEX).is_file():
            return None
        folder = path.resolve() if path.name in ("", "..") else path
        found = study_of(folder.with_name(f"{folder.name}.nc"))
        if found is None:
            raise DeckError(f"{path} holds the cases of a study; hexcontact study STUDY.toml combines them")
        return found
    require_utf8(path, "a netCDF file")
    return path if "study_version" in netcdf_library.attributes(path) else None


def read_study(path: Path) -> xarray.Dataset:
    """Read the result of a study, with its title among the attributes."""
    with reading(path), netcdf_library.opened_by_xarray(path) as found:
        found.load()
    with reading(path), netcdf_library.opened_by_xarray(path, group="study") as about:
        return found.assign_attrs(title=about.attrs.get("title", ""))


def parameters_of(study: xarray.Dataset) -> list[str]:
    """Return the names of the parameters of a study."""
    return [str(name) for name, values in study.coords.items() if "deck_key" in values.attrs]


def table_of(study: xarray.Dataset) -> pandas.DataFrame:
    """Return a row for each case, or for each load step of each case."""
    words = np.vectorize(STATES.get, otypes=[object])(study["status"].values)
    study = study.assign(status=(study["status"].dims, words))
    numbers = ["case_number", *parameters_of(study), *(["step"] if "step" in study.dims else [])]
    rest = [str(name) for name in study.data_vars if name not in (*numbers, *_STATE)]
    table = study.to_dataframe().reset_index()
    if "step" in study.dims:  # shorter cases end with NaN
        done = table["status"] == STATES[DONE]
        table = table[np.where(done, table[rest].notna().any(axis=1), table["step"] == 1)]
    return table[[*numbers, *rest, *_STATE]]


def with_units(study: xarray.Dataset) -> dict[str, str]:
    """Return the headers of the columns of a table."""
    units = {str(name): str(values.attrs.get("units", "1")) for name, values in study.variables.items()}
    return {name: f"{name} [{unit}]" for name, unit in units.items() if unit not in ("1", "")}


def lines_of(study: xarray.Dataset) -> str:
    """Return title, size and table of a study for a terminal."""
    table, names = table_of(last_steps(study)), parameters_of(study)
    whole = (table["status"] == STATES[DONE]).all()
    columns = ["case_number", *names, *(name for name in ("approach", *SUMMARY) if name in table)]
    columns += [] if whole else ["status"]
    units = {name: str(study[name].attrs.get("units", "1")).removesuffix("1") for name in columns}
    rows = [
        tuple(_cell(row[name], units[name]) for name in columns)
        for row in table.head(_MOST_ROWS).to_dict("records")
    ]
    sizes = " x ".join(f"{size} {name}" for name, size in study.sizes.items() if name in names)
    states = table["status"].value_counts(sort=False)
    counts = ", ".join(f"{count} {state}" for state, count in states.items())
    lines = [
        *([study.attrs["title"]] if study.attrs["title"] else []),
        f"study of {len(table)} cases{f' ({sizes})' if sizes else ''}: {counts}"
        + ("; the last load step of each" if "step" in study.dims else ""),
        text_table(("case", *columns[1:]), rows),
    ]
    if len(table) > _MOST_ROWS:
        lines.append(f"... and {len(table) - _MOST_ROWS} more cases; hexcontact export --csv writes all")
    return visible_lines([*lines, str(study.attrs["source"])])


def visible_lines(lines: Sequence[str]) -> str:
    """Return lines without control characters."""
    return "\n".join(visible(line) for text in lines for line in text.split("\n"))


def _cell(value: Any, unit: str) -> str:
    if isinstance(value, str):
        return value
    return quantity(float(value), unit) if unit else f"{value:g}"


def content_of(study: xarray.Dataset, path: Path) -> dict[str, Any]:
    """Return a study as the object that ``info --json`` prints."""
    parameters = {
        name: {key: study[name].attrs.get(key, "") for key in ("deck_key", "units")}
        for name in parameters_of(study)
    }
    about = {str(name): value for name, value in study.attrs.items()}
    return {
        "file": path,
        **about,
        "parameters": parameters,
        "sizes": {str(name): size for name, size in study.sizes.items()},
        "cases": table_of(study).to_dict("records"),
    }
