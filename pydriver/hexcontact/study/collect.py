"""The result of a study: one dataset over its parameters, from the histories of its cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import netcdf_library
from ..errors import DeckError, ResourceError
from ..files import reading, replacing, require_ordinary
from ..netcdf_library import attributes
from ..result.netcdf import check_seal
from ..variables import CONVENTIONS, VARIABLES
from .axes import Axis
from .folder import StudyFolder
from .plan import Plan, PlannedCase

if TYPE_CHECKING:
    import xarray

DONE, FAILED, MISSING, INVALID = range(4)
STATES = {DONE: "done", FAILED: "failed", MISSING: "missing", INVALID: "invalid"}
STUDY_VERSION = 1


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


def collect(plan: Plan, folder: StudyFolder, steps: str, attributes: dict[str, Any]) -> xarray.Dataset:
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
    for name in (name for name in VARIABLES if name in present):
        values = np.full((total, longest), np.nan)
        last = np.full(total, np.nan)
        for row, history in enumerate(found):
            if name in history:
                values[row, : len(history[name])] = history[name]
                last[row] = history[name][-1]
        about = {key: value for key, value in VARIABLES[name].attributes.items() if key[:4] != "flag"}
        if steps == "all":
            columns[name] = ((*dims, "step"), values.reshape(*shape, longest), about)
        else:
            columns[name] = (dims, last.reshape(shape), about)

    def by_case(values: Any, dtype: Any, long_name: str, **more: Any) -> Any:
        return dims, np.array(list(values), dtype=dtype).reshape(shape), {"long_name": long_name, **more}

    outcomes = [state_of(folder, case) for case in plan.cases]
    status, codes, messages = zip(*outcomes, strict=True)
    flags = {"flag_values": np.array(list(STATES), "i1"), "flag_meanings": " ".join(STATES.values())}
    numbers = map(folder.number, plan.cases)
    columns["status"] = by_case(status, "i1", "state of the case", **flags)
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
    if steps == "all":
        step = VARIABLES["step"]
        coordinates["step"] = ("step", np.arange(1, longest + 1, dtype="i4"), step.attributes)
    return xarray.Dataset(columns, coordinates, {"Conventions": CONVENTIONS, **attributes})


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


def is_study(path: Path) -> bool:
    """Return whether a file is the result of a study."""
    require_ordinary(path, "the result of a study")
    return "study_version" in attributes(path)


def refuse_foreign(path: Path) -> None:
    """Raise a DeckError if a file exists that is not the result of a study."""
    if path.exists() and not is_study(path):
        raise DeckError(f"{path} is there and not the result of a study; choose another output")


def write(dataset: xarray.Dataset, path: Path, about: dict[str, str]) -> None:
    """Write the result of a study; an older one is replaced as a whole.

    The texts `about` are attributes of the group ``study``: xarray does not combine datasets whose own
    attributes differ.
    """
    refuse_foreign(path)
    # Characters, not netCDF strings: HDF5 crashes on those when a file is opened more than once.
    texts = [name for name, variable in dataset.variables.items() if variable.dtype.kind in "UO"]
    import xarray

    try:
        with replacing(path) as temporary:
            netcdf_library.write(dataset, temporary, encoding={name: {"dtype": "S1"} for name in texts})
            netcdf_library.write(xarray.Dataset(attrs=about), temporary, mode="a", group="study")
    except (OSError, RuntimeError) as error:
        raise ResourceError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from error
