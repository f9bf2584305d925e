"""Refuses results and records of journals whose parts are missing or of the wrong kind.

Whatever looks at a result relies on what is checked here: that quantities have their dimensions and numbers,
attributes their kind, and that what a run always writes is there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..variables import FIELDS, LARGEST, NOT_KEPT, RESIDUALS, VARIABLES, names_where
from .layout import Metadata, history_of, lattice_of

if TYPE_CHECKING:
    import xarray

    from .step import Step

_CLOSE = 1e-6  # spacings by which a node may be away from where it belongs; relative difference of sums
_ROUNDED = 1 + 1e-5  # of tolerances in the story of a run
_CHANGED = re.compile(r"(?<!step_)tolerance = (\S+) instead of ([^\s,]+)")

_ALWAYS = names_where(lambda v: v.required == "always")
_WITH_FRICTION = names_where(lambda v: bool(v.required))
_NO_STEP = "{} holds numbers that no load step has"


Fits = Callable[[Any], bool]  # whether a value is what it should be


def _is_number(value: Any) -> bool:
    return np.ndim(value) == 0 and np.asarray(value).dtype.kind in "iuf" and not math.isnan(float(value))


def _is_positive(value: Any) -> bool:
    return _is_number(value) and 0 < value < math.inf


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _one_of(*words: str) -> Fits:
    return lambda value: isinstance(value, str) and value in words


def _numbers(count: int) -> Fits:
    return lambda value: np.shape(value) == (count,) and bool(np.isfinite(value).all())


_PARAMETERS: dict[str, Fits] = {  # that describe the case: all of them or, in a test, none
    "effective_modulus": _is_positive,
    "dundurs_beta": _is_number,
    "tangential_compliance_ratio": _is_number,
    "friction_coefficient": lambda value: _is_number(value) and value >= 0,
    "algorithm": _one_of("frictionless", "static", "incremental"),
    "coupling": _one_of("full", "goodman"),
    "tolerance": _is_positive,
}
MATERIALS = tuple(name for name in _PARAMETERS if name != "tolerance")  # and laws
_ATTRIBUTES: dict[str, Fits] = {
    **dict.fromkeys(("title", "deck", "source", "history", "created", "run"), _is_text),
    **dict.fromkeys(("output_fields", "hexcontact_version"), _is_text),
    "output_every": _is_positive,
    "planned_steps": lambda value: _is_number(value) and 0 <= value < math.inf,  # 0: not known yet
    "complete": _is_number,
    "lattice_spacing": _is_positive,
    "lattice_basis": _numbers(4),
    "lattice_origin": _numbers(2),
}
_LATER = {"entry": _one_of("implicit", "interpolated"), "machine": _is_text, "stopped": _is_text}


def fault_of_result(dataset: xarray.Dataset) -> str:
    """Return what is wrong with a result that was read from a file; empty if nothing is.

    Parameters
    ----------
    dataset : xarray.Dataset
        As it was opened; fields need not be in memory.
    """
    attributes = {str(name): value for name, value in dataset.attrs.items()}
    if fault := _fault_of_attributes(attributes):
        return fault
    for name, known in VARIABLES.items():
        if name not in dataset.variables:
            continue
        found = dataset.variables[name]
        text = known.dtype == "str"
        if found.dtype.kind not in "OSU" if text else found.dtype != np.dtype(known.dtype):
            return f"{name} holds values of another kind ({found.dtype})"
    if "algorithm" in attributes:
        frictional = attributes["algorithm"] != "frictionless"
        missing = set(_WITH_FRICTION if frictional else _ALWAYS) - dataset.variables.keys()
        if missing:
            return f"it has no {min(missing, key=_WITH_FRICTION.index)}"
    return _fault_of_coordinates(dataset) or _fault_of_histories(dataset)


def fault_of_dimensions(name: str, dimensions: tuple[str, ...]) -> str:
    """Return what is wrong with the dimensions of a variable of a file; empty if nothing is."""
    known = VARIABLES.get(name)
    if known is None:
        fits = len(set(dimensions)) == len(dimensions)
    else:
        characters = known.dtype == "str" and len(dimensions) == len(known.dims) + 1
        fits = dimensions[: len(dimensions) - characters] == known.dims
    return "" if fits else f"{name} is over {', '.join(dimensions) or 'nothing'}"


def _fault_of_attributes(attributes: Mapping[str, Any]) -> str:
    needed = _ATTRIBUTES | (_PARAMETERS if _PARAMETERS.keys() & attributes.keys() else {})
    for name, fits in (needed | {name: fits for name, fits in _LATER.items() if name in attributes}).items():
        if name not in attributes:
            return f"it has no attribute {name}"
        if not fits(attributes[name]):
            return f"its attribute {name} is not what it should be"
    return ""


def _fault_of_coordinates(dataset: xarray.Dataset) -> str:
    """Return a fault of steps, rows and columns: they are numbered one by one."""
    if dataset["step"].values[0] != 1:
        return "its steps do not begin with 1"
    for name in ("step", "row", "col"):
        if (np.diff(dataset[name].values.astype(float)) != 1).any():
            return f"its coordinate {name} does not count one by one"
    lattice = lattice_of(dataset)
    for name, place in (("x", lattice.x), ("y", lattice.y)):
        if not (abs(dataset[name].values - place) < _CLOSE * lattice.spacing).all():
            return f"its coordinate {name} is not that of the lattice"
    return ""


def _fault_of_histories(dataset: xarray.Dataset) -> str:
    """Return a fault of the numbers by step; empty if there is none."""
    known = [name for name in history_of(dataset) if name in VARIABLES and VARIABLES[name].dtype != "str"]
    history = {name: dataset[name].values for name in known}
    for name in known:
        # without stick there is no center of it
        always = VARIABLES[name].required and not name.startswith("stick_center")
        if always and np.isnan(history[name]).any():
            return _NO_STEP.format(name)
    return _fault_of_numbers(history, dataset.attrs, str(dataset.attrs["history"]))


def _fault_of_numbers(history: Mapping[str, Any], parameters: Mapping[Any, Any], story: str) -> str:
    """Return a fault of values by step; a run that was resumed may have had several tolerances."""
    tolerances = [parameters.get("tolerance", 1.0), *map(float, chain(*_CHANGED.findall(story)))]
    cut = np.greater(history.get("cuts", 0), 0) | np.isfinite(history.get("segment_fraction", math.nan))
    for name, values in history.items():
        low, high = VARIABLES[name].least, LARGEST
        if VARIABLES[name].dtype != "f8":
            low, high = NOT_KEPT, max(VARIABLES[name].flags, default=LARGEST)
        elif name in RESIDUALS.values():
            high = max(tolerances) * _ROUNDED
            if name == RESIDUALS["R_t"]:  # parts of a step are solved from one to the next
                values = np.where(cut, np.minimum(values, high), values)
        if (np.less(values, low) | np.greater(values, high)).any():
            return _NO_STEP.format(name)
    return ""


def fault_of_fields(dataset: xarray.Dataset) -> str:
    """Return what is wrong with the fields of a result; empty if nothing is. Reads them, step by step."""
    numbers, every = dataset["step"].values, int(dataset.attrs["output_every"])
    for place, number in enumerate(numbers):
        step = dataset.isel(step=place)
        fields = {str(name): v.values for name, v in step.data_vars.items() if v.dims == ("row", "col")}
        history = {str(name): v.item() for name, v in step.data_vars.items() if not v.dims}
        kept = number % every == 0 or number == numbers[-1]
        if fault := _fault_of_values(fields, history, float(dataset.attrs["lattice_spacing"]), kept):
            return f"{fault} in step {number}"
    return ""


def _fault_of_values(
    fields: Mapping[str, NDArray[Any]], history: Mapping[str, Any], spacing: float, kept: bool = True
) -> str:
    """Return a fault of values at nodes: they are those of a load step, and fit to its history."""
    zone, pressure = fields.get("zone"), fields.get("pressure")
    contact = zone > 0 if zone is not None else pressure > 0 if pressure is not None else None
    for name, values in fields.items():
        known = VARIABLES[name]
        if not kept and known.is_field:
            wrong = ~np.isnan(values) if known.dtype == "f8" else values != NOT_KEPT
        elif name == "zone":
            wrong = (values < 0) | (values > max(known.flags))
        else:
            wrong = ~(abs(values) < LARGEST)
            if known.padding != 0:  # there may be no value out of contact
                wrong &= contact is not None and contact
            wrong |= values < known.least
        if wrong.any():
            return f"{name} holds numbers that no node has"
    if pressure is not None and kept and "max_pressure" in history:
        peak = pressure.max()
        if not math.isclose(peak, history["max_pressure"], rel_tol=_CLOSE):
            return "pressure does not fit to max_pressure"
    if zone is not None and kept and "contact_area" in history:
        cells = history["contact_area"] / (spacing**2 * math.sqrt(0.75))
        if abs(np.count_nonzero(zone > 0) - cells) > _CLOSE * (1 + cells):
            return "zone does not fit to contact_area"
    return ""


def fault_of_record(metadata: Metadata, step: Step) -> str:
    """Return what is wrong with a record of a journal that was read; empty if nothing is."""
    planned = metadata.planned_steps or (1 if step.control else 0)  # not known of adaptive steps
    counts = {"every": metadata.every, "planned_steps": planned, "index": step.index + 1}
    for name in ("title", "deck", "run", "created", "version", "deck_file"):
        if not isinstance(getattr(metadata, name), str):
            return f"its {name} is no text"
    for name, value in counts.items():
        if not isinstance(value, int) or value < 1:
            return f"its {name} is no count"
    if not all(isinstance(line, str) for line in metadata.resumed) or set(metadata.fields) - set(FIELDS):
        return "its metadata hold other things than text"
    if not isinstance(metadata.parameters, dict):
        return "its parameters are no table"
    known = _PARAMETERS | _LATER
    given = {name: value for name, value in metadata.parameters.items() if name in known}
    for name, value in given.items():
        if not known[name](value):
            return f"its {name} is not what it should be"
    if given and (missing := _PARAMETERS.keys() - given):
        return f"it has no {min(missing)}"
    history = {name: value for name, value in step.history.items() if not isinstance(value, str)}
    return (
        _fault_of_step(step)
        or _fault_of_numbers(history, metadata.parameters, metadata.story)
        or _fault_of_values(step.fields, history, step.lattice.spacing)
    )


def _fault_of_step(step: Step) -> str:
    for name, values in step.fields.items():
        if name not in FIELDS and name != "initial_gap":
            return f"{name} is no field"
        if values.shape != step.lattice.shape:
            return f"{name} has the shape {values.shape}, not {step.lattice.shape}"
        if values.dtype.kind not in "fiu":
            return f"{name} holds values of another kind ({values.dtype})"
    for name, value in step.history.items():
        if name not in VARIABLES or VARIABLES[name].dims != ("step",):
            return f"{name} is no quantity of a load step"
        if not isinstance(value, str if VARIABLES[name].dtype == "str" else int | float):
            return f"{name} is of another kind"
    return ""
