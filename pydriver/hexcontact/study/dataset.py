"""Files of a study: one for each case in its folder, and one dataset of all over its parameters.

The hash of its merged deck identifies a case, and its number never changes, so that a study can be edited:
its cases are found again, new cases get new numbers, files of other cases are not touched.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import operator
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import netcdf_library
from .._version import __version__
from ..arrays import DataFrame, Dataset
from ..errors import ConvergenceError, DeckError, ResourceError
from ..files import Lock, reading, replacing, require_ordinary, require_utf8, text_of
from ..netcdf_library import attributes
from ..result.netcdf import check_seal, missing_stresses, stress_files
from ..result.view import last_steps, parameters_of
from ..text import Table, counted, quantity, visible
from ..variables import CONVENTIONS, SUMMARY, VARIABLES
from .backend import Outcome, holds
from .plan import Axis, Plan, PlannedCase, StudyFile

INDEX = "index.json"
STUDY_VERSION = 1
ABOUT = {
    "Conventions": CONVENTIONS,
    "source": f"hexcontact {__version__}",
    "hexcontact_version": __version__,
    "study_version": STUDY_VERSION,
}
"""Attributes of every result of a study."""
_FINAL = (DeckError.exit_code, ConvergenceError.exit_code)  # the same deck fails in the same way again


class StudyFolder:
    """Keep the files of a study in the folder named as its netCDF file, without the ending."""

    def __init__(self, output: Path) -> None:
        if output.suffix != ".nc":
            raise DeckError(f"output {output}: expected a netCDF file, such as {output.with_suffix('.nc')}")
        require_ordinary(output, "a netCDF file")
        if not output.parent.is_dir():
            raise DeckError(f"cannot write {output}: the folder {output.parent} does not exist")
        self.output = output
        self.folder = output.with_suffix("")
        if self.folder.exists() and not self.folder.is_dir():
            raise DeckError(f"{self.folder} is a file; the study needs a folder of this name for its cases")
        there = os.listdir(self.folder) if self.folder.is_dir() else []
        if there and not {INDEX, "lock"} & set(there):
            raise DeckError(
                f"the folder {self.folder} holds other things than cases of a study; choose another output"
            )
        self._entries = self._read() if (self.folder / INDEX).exists() else {}  # number and values by hash
        self._written = len(self._entries)

    def _read(self) -> dict[str, Any]:
        path = self.folder / INDEX
        content = text_of(path, "the index of a study")
        try:
            entries: dict[str, Any] = json.loads(content)["cases"]
            numbers = [operator.index(entry["number"]) for entry in entries.values()]
            if len(set(numbers)) < len(numbers) or any(not 1 <= n <= 10**9 for n in numbers):
                raise ValueError("its numbers are not those of cases")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise DeckError(f"{path} is damaged ({error}); move the folder {self.folder} away") from None
        return entries

    def lock(self) -> Lock:
        """Lock the folder against other runs of the study, up to `Lock.release`."""
        self.folder.mkdir(exist_ok=True)
        return Lock(self.folder / "lock", self.folder)

    def enter(self, plan: Plan) -> None:
        """Assign numbers to the cases and write the index, if any case is new."""
        self.assign(plan)
        if len(self._entries) > self._written:
            self.folder.mkdir(exist_ok=True)
            self._write(INDEX, {"index_version": 1, "cases": self._entries})
            self._written = len(self._entries)

    def assign(self, plan: Plan) -> None:
        """Assign numbers to new cases without writing the index."""
        number = max((entry["number"] for entry in self._entries.values()), default=0)
        for case in plan.cases:
            if case.hash not in self._entries:
                number += 1
                self._entries[case.hash] = {"number": number, "parameters": dict(case.settings)}

    def _write(self, name: str, content: Any) -> None:
        text = json.dumps(content, indent=1, ensure_ascii=False, default=str)
        with writing(self.folder / name) as path:
            path.write_text(text, encoding="utf-8")

    def number(self, case: PlannedCase) -> int:
        """Return the number of a case, from 1."""
        return int(self._entries[case.hash]["number"])

    def path(self, case: PlannedCase) -> Path:
        """Return the file of a case."""
        return self.folder / f"{self.number(case):04d}.nc"

    def done(self, case: PlannedCase) -> bool:
        """Return whether the file of a case is complete and holds this case, with its tables beside it."""
        path = self.path(case)
        return holds(path, case.hash) and not (stress_files(case.deck, path) and missing_stresses(path))

    def failure(self, case: PlannedCase) -> Outcome | None:
        """Return the failure in the note of a case; None without one."""
        with contextlib.suppress(DeckError, ValueError, TypeError, AttributeError, RecursionError):
            note = json.loads(text_of(self.path(case).with_suffix(".json"), "a note"))
            outcome = Outcome(**{"hexcontact_version": "", **note})
            whole = type(outcome.exit_code), type(outcome.message), type(outcome.lasting)
            if outcome.hash == case.hash and whole == (int, str, bool) and outcome.message.strip():
                return outcome
        return None

    def _is_final(self, case: PlannedCase) -> bool:
        """Return whether a case would fail again: for its own reasons, in this version of the program."""
        failure = self.failure(case)
        if failure is None or not failure.lasting:
            return False
        return failure.exit_code in _FINAL and failure.hexcontact_version == __version__

    def missing(self, cases: Iterable[PlannedCase], retry: bool = False) -> list[PlannedCase]:
        """Return the cases to run; with `retry` also those that would fail again."""
        wanted = {case.hash: case for case in cases if not case.fault}.values()
        return [case for case in wanted if not self.done(case) and (retry or not self._is_final(case))]

    def note(self, case: PlannedCase, outcome: Outcome) -> None:
        """Record the outcome of a case, and remove files of its attempts."""
        path = self.path(case)
        if outcome.exit_code:
            self._write(f"{path.stem}.json", dataclasses.asdict(outcome))
            return
        path.with_suffix(".json").unlink(missing_ok=True)
        for left in self.folder.glob(f"{path.stem}.{'[0-9a-f]' * 8}.nc*"):
            if left.suffix == ".d":
                shutil.rmtree(left, ignore_errors=True)
            elif left.suffix == ".nc":
                left.unlink(missing_ok=True)


DONE, FAILED, MISSING, INVALID = range(4)
STATES = {DONE: "done", FAILED: "failed", MISSING: "missing", INVALID: "invalid"}
FLAGS = {"flag_values": np.array(list(STATES), "i1"), "flag_meanings": " ".join(STATES.values())}
"""CF attributes of the states."""


def histories(path: Path) -> dict[str, np.ndarray[Any, Any]]:
    """Return the history of a finished case: the values of each quantity by load step, by its name."""
    with reading(path):
        check_seal(path)
    with reading(path), netcdf_library.opened(path) as file:
        file.set_auto_mask(False)
        return {
            name: np.asarray(column[...], dtype=float)
            for name, column in file.variables.items()
            if name in VARIABLES and column.dimensions == ("step",) and name != "step"
        }


def collect(plan: Plan, folder: StudyFolder, file: StudyFile) -> Dataset:
    """Combine the finished cases in one dataset: the last load step of each, or all along ``step``.

    Values of other cases are NaN, for the reason in ``status``, ``exit_code`` and ``message``.
    """
    import xarray

    total = len(plan.cases)
    found = [histories(folder.path(case)) if folder.done(case) else {} for case in plan.cases]
    dims, shape = tuple(plan.dims), tuple(plan.dims.values())

    longest = max((len(next(iter(history.values()))) for history in found if history), default=0)
    present = {name for history in found for name in history}
    columns: dict[str, Any] = {}
    over, sizes = (("step",), (longest,)) if file.steps == "all" else ((), ())
    for name in (name for name in VARIABLES if name in present):
        values = np.full((total, *(sizes or (1,))), np.nan)
        for row, history in enumerate(found):
            kept = history.get(name, ())[0 if sizes else -1 :]
            values[row, : len(kept)] = kept
        about = {key: value for key, value in VARIABLES[name].attributes.items() if key[:4] != "flag"}
        columns[name] = ((*dims, *over), values.reshape(*shape, *sizes), about)

    def by_case(values: Any, dtype: Any, long_name: str, **more: Any) -> Any:
        return dims, np.array(list(values), dtype=dtype).reshape(shape), {"long_name": long_name, **more}

    outcomes = [state_of(folder, case) for case in plan.cases]
    status, codes, messages = zip(*outcomes, strict=True)
    numbers = map(folder.number, plan.cases)
    columns["status"] = by_case(status, "i1", "state of the case", **FLAGS)
    columns["exit_code"] = by_case(codes, "i2", "exit code of the case, 0 if it has not failed", units="1")
    columns["message"] = by_case(messages, str, "why the case failed")
    columns["case_number"] = by_case(numbers, "i4", "number of the file of the case", units="1")

    coordinates: dict[str, Any] = {}
    for axis in plan.axes:
        along = tuple(slice(None) if dim in axis.dims else 0 for dim in dims)
        places = np.arange(total).reshape(shape)[along]
        coordinates[axis.name] = _coordinate(axis, places, [case.settings for case in plan.cases])
    for dim in set(dims) - set(coordinates):
        of = "case in the study" if dim == "case" else "values in the group"
        about = {"long_name": f"number of the {of}, the first is 1", "units": "1"}
        coordinates[dim] = (dim, np.arange(1, plan.dims[dim] + 1, dtype="i4"), about)
    if over:
        coordinates["step"] = (over, np.arange(1, longest + 1, dtype="i4"), VARIABLES["step"].attributes)
    return xarray.Dataset(columns, coordinates, {**ABOUT, "combine": file.combine})


def state_of(folder: StudyFolder, case: PlannedCase) -> tuple[int, int, str]:
    """Return status, exit code and message of a case."""
    if folder.done(case):
        return DONE, 0, ""
    if case.fault:
        return INVALID, DeckError.exit_code, case.fault
    failure = folder.failure(case)
    return (FAILED, failure.exit_code, failure.message) if failure else (MISSING, 0, "")


def _coordinate(axis: Axis, places: Any, settings: Sequence[Mapping[str, Any]]) -> Any:
    """Return a parameter along its dimensions; NaN where a formula has no value."""
    entries = [axis.coordinate(settings[place].get(axis.key, np.nan)) for place in places.flat]
    attributes = {"long_name": axis.long_name or axis.key, "deck_key": ", ".join(axis.keys)}
    if all(isinstance(value, float) for value in entries):
        numbers = np.array(entries, dtype=float).reshape(places.shape)
        return axis.dims, numbers, {**attributes, "units": axis.units or "1"}
    return axis.dims, np.array([str(value) for value in entries]).reshape(places.shape), attributes


def refuse_foreign(path: Path) -> None:
    """Raise a DeckError if a file exists that is not the result of a study."""
    if path.exists():
        require_ordinary(path, "the result of a study")
        if "study_version" not in attributes(path):
            raise DeckError(f"{path} exists and is not the result of a study; choose another output")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[Path]:
    """Yield the temporary name of a file as `replacing`; ResourceError if it cannot be written."""
    try:
        with replacing(path) as temporary:
            yield temporary
    except (OSError, RuntimeError) as error:
        raise ResourceError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from error


def write(dataset: Dataset, path: Path, title: str, file: StudyFile) -> None:
    """Write the result of a study; an older one is replaced as a whole.

    Its title and file are attributes of the group ``study``: xarray does not combine datasets whose own
    attributes differ.
    """
    refuse_foreign(path)
    study = json.dumps(file.model_dump(mode="json", exclude_defaults=True), default=str)
    # Characters, not netCDF strings: HDF5 crashes on those when a file is opened more than once.
    texts = [name for name, variable in dataset.variables.items() if variable.dtype.kind in "UO"]
    import xarray

    about = xarray.Dataset(attrs={"title": title, "study": study})
    with writing(path) as temporary:
        netcdf_library.write(dataset, temporary, encoding={name: {"dtype": "S1"} for name in texts})
        netcdf_library.write(about, temporary, mode="a", group="study")


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


def read_study(path: Path) -> Dataset:
    """Read the result of a study, with its title among the attributes."""
    with reading(path), netcdf_library.opened_by_xarray(path) as found:
        found.load()
    with reading(path), netcdf_library.opened_by_xarray(path, group="study") as about:
        return found.assign_attrs(title=about.attrs.get("title", ""))


def table_of(study: Dataset) -> DataFrame:
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


def with_units(study: Dataset) -> dict[str, str]:
    """Return the headers of the columns of a table."""
    units = {str(name): str(values.attrs.get("units", "1")) for name, values in study.variables.items()}
    return {name: f"{name} [{unit}]" for name, unit in units.items() if unit not in ("1", "")}


def lines_of(study: Dataset) -> str:
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
        f"study of {counted(len(table), 'case')}{f' ({sizes})' if sizes else ''}: {counts}"
        + ("; the last load step of each" if "step" in study.dims else ""),
        str(Table(("case", *columns[1:]), rows)),
    ]
    if len(table) > _MOST_ROWS:
        lines.append(
            f"... and {counted(len(table) - _MOST_ROWS, 'more case')}; hexcontact export --csv writes all"
        )
    lines.append(str(study.attrs["source"]))
    return "\n".join(visible(line) for text in lines for line in text.split("\n"))


def _cell(value: Any, unit: str) -> str:
    if isinstance(value, str):
        return value
    return quantity(float(value), unit) if unit else f"{value:g}"


def content_of(study: Dataset, path: Path) -> dict[str, Any]:
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
