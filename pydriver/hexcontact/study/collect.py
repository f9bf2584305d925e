"""The result of a study: one data set over its parameters, from the histories of its cases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import DeckError, ResourceError
from ..files import reading, replacing, require_ordinary
from ..result.netcdf import check_seal
from ..variables import CONVENTIONS, VARIABLES
from .folder import StudyFolder
from .plan import Axis, Plan, PlannedCase

if TYPE_CHECKING:
    import xarray

DONE, FAILED, MISSING = 0, 1, 2
_STATUS = {DONE: "done", FAILED: "failed", MISSING: "missing"}
STUDY_VERSION = 1


def histories(path: Path) -> dict[str, np.ndarray[Any, Any]]:
    """Read the history of a finished case: numbers by step, by the name of the quantity."""
    import netCDF4

    with reading(path):
        check_seal(path)
    with reading(path), netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        return {
            name: np.asarray(column[...], dtype=float)
            for name, column in file.variables.items()
            if name in VARIABLES and column.dimensions == ("step",) and name != "step"
        }


def collect(
    plan: Plan, folder: StudyFolder, combine: str, steps: str, attributes: dict[str, Any]
) -> xarray.Dataset:
    """Put the finished cases together.

    Parameters
    ----------
    plan : Plan
        The study.
    folder : StudyFolder
        Where its cases are.
    combine : str
        grid: a dimension by parameter; otherwise the dimension ``case``.
    steps : str
        last: what the last load step leaves; all: the whole history, with the dimension ``step``.
    attributes : dict
        Attributes of the data set.

    Returns
    -------
    xarray.Dataset
        NaN where a case is not done; ``status``, ``exit_code`` and ``message`` say why.
    """
    import xarray

    total = len(plan.cases)
    found = [histories(folder.path(case)) if folder.done(case) else {} for case in plan.cases]
    grid = combine == "grid"
    shape = tuple(len(axis.values) for axis in plan.axes) if grid else (total,)
    dims = tuple(axis.name for axis in plan.axes) if grid else ("case",)

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
        kept = {key: value for key, value in VARIABLES[name].attributes.items() if not key.startswith("flag")}
        if steps == "all":
            columns[name] = ((*dims, "step"), values.reshape(*shape, longest), kept)
        else:
            columns[name] = (dims, last.reshape(shape), kept)

    def by_case(values: Any, dtype: Any, long_name: str, **more: Any) -> Any:
        return dims, np.array(list(values), dtype=dtype).reshape(shape), {"long_name": long_name, **more}

    outcomes = [_outcome(folder, case, bool(h)) for case, h in zip(plan.cases, found, strict=True)]
    status, codes, messages = zip(*outcomes, strict=True)
    flags = {"flag_values": np.array(list(_STATUS), "i1"), "flag_meanings": " ".join(_STATUS.values())}
    numbers = map(folder.number, plan.cases)
    columns["status"] = by_case(status, "i1", "what became of the case", **flags)
    columns["exit_code"] = by_case(codes, "i2", "exit code of the case, 0 if it has not failed", units="1")
    columns["message"] = by_case(messages, str, "why the case failed")
    columns["case_number"] = by_case(numbers, "i4", f"number of the file in {folder.folder.name}/", units="1")

    coordinates: dict[str, Any] = {}
    for axis in plan.axes:
        said = axis.values if grid else [case.settings[axis.key] for case in plan.cases]
        coordinates[axis.name] = _coordinate(axis, axis.name if grid else "case", said)
    if not grid:
        about = {"long_name": "number of the case in the study, the first is 1", "units": "1"}
        coordinates["case"] = ("case", np.arange(1, total + 1, dtype="i4"), about)
    if steps == "all":
        step = VARIABLES["step"]
        coordinates["step"] = ("step", np.arange(1, longest + 1, dtype="i4"), step.attributes)
    return xarray.Dataset(columns, coordinates, {"Conventions": CONVENTIONS, **attributes})


def _outcome(folder: StudyFolder, case: PlannedCase, done: bool) -> tuple[int, int, str]:
    """Return what became of a case: its status, exit code and message."""
    if done:
        return DONE, 0, ""
    failure = folder.failure(case)
    return (FAILED, failure.exit_code, failure.message) if failure else (MISSING, 0, "")


def _coordinate(axis: Axis, dim: str, values: Sequence[Any]) -> Any:
    entries = [axis.coordinate(value) for value in values]
    attributes = {"long_name": axis.long_name or axis.key, "deck_key": axis.key}
    if all(isinstance(value, float) for value in entries):
        return dim, np.array(entries, dtype=float), {**attributes, "units": axis.units or "1"}
    return dim, np.array([str(value) for value in entries]), attributes


def is_study(path: Path) -> bool:
    """Tell whether a file is the result of a study."""
    import netCDF4

    require_ordinary(path, "the result of a study")
    try:
        with netCDF4.Dataset(path) as file:
            return "study_version" in file.ncattrs()
    except OSError:
        return False


def refuse_foreign(path: Path) -> None:
    """Raise a DeckError if something else than the result of a study is in the way of one."""
    if path.exists() and not is_study(path):
        raise DeckError(f"{path} is there and not the result of a study; choose another output")


def write(dataset: xarray.Dataset, path: Path) -> None:
    """Write the result of a study; an older one is replaced as a whole.

    Raises
    ------
    DeckError
        If something else is in the way.
    ResourceError
        If it cannot be written.
    """
    refuse_foreign(path)
    # Characters, not netCDF strings: HDF5 crashes on those when a file is opened more than once.
    texts = [name for name, variable in dataset.variables.items() if variable.dtype.kind in "UO"]
    try:
        with replacing(path) as temporary:
            dataset.to_netcdf(temporary, engine="netcdf4", encoding={name: {"dtype": "S1"} for name in texts})
    except (OSError, RuntimeError) as error:
        raise ResourceError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from error
