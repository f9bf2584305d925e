"""Faults of results without a seal: missing parts, wrong kinds, impossible numbers."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.lattice import Lattice
from ..deck.keys import BULK_STATES
from ..variables import (
    INTERFACE,
    LARGEST,
    NOT_KEPT,
    RESIDUALS,
    SHEAR_LIMIT,
    TRACTIONS,
    VARIABLES,
    names_where,
)
from .layout import COORDINATES, history_of, lattice_of

if TYPE_CHECKING:
    import netCDF4
    import xarray

_CLOSE = 1e-6  # spacings by which a node may be off its place; relative difference of sums
_ROUNDED = 1 + 1e-5  # for tolerances in the story of a run
_CHANGED = r"(?<!step_)tolerance = (\S+) instead of ([^\s,]+)"

_ALWAYS = names_where(lambda v: v.required == "always")
_WITH_FRICTION = names_where(lambda v: bool(v.required))
_NOISE = 1e-3  # of energies beside the normal load times the contact radius
_NO_STEP = "{} holds numbers that no load step has"


Fits = Callable[[Any], bool]  # test of a value


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


_PARAMETERS: dict[str, Fits] = {  # of the case: all of them or, in tests, none
    "effective_modulus": _is_positive,
    "dundurs_beta": _is_number,
    "tangential_compliance_ratio": _is_number,
    "friction_coefficient": lambda value: np.ndim(value) == 0 and not float(value) < 0,  # NaN: another law
    "algorithm": _one_of("frictionless", "static", "incremental"),
    "coupling": _one_of("full", "goodman"),
    "tolerance": _is_positive,
}
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
_LATER = {
    "lattice_cell_ratio": _is_positive,
    "lattice_cell_angle": lambda value: _is_number(value) and 0 < value < math.pi,
    INTERFACE[0]: _is_positive,
    INTERFACE[2]: lambda value: _is_number(value) and 0 <= value < math.inf,  # 0: no springs
    INTERFACE[1]: lambda value: _is_number(value) and 1 <= value < math.inf,
    **dict.fromkeys((SHEAR_LIMIT, "cycle_tolerance", "wear_tolerance"), _is_positive),
    "entry": _one_of("implicit", "interpolated"),
    "bulk_state": _one_of(*BULK_STATES),
    **dict.fromkeys(("friction_law", "machine", "stopped"), _is_text),
}


def fault_of_result(dataset: xarray.Dataset) -> str:
    """Return a fault of the dataset of a result file, whose fields may be unread; empty if there is none."""
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
    return _fault_of_coordinates(dataset) or _fault_of_histories(dataset) or _fault_of_fields(dataset)


def fault_of_dimensions(columns: Mapping[str, netCDF4.Variable]) -> str:
    """Return a fault of the dimensions of the variables of a file; empty if there is none."""
    for name in COORDINATES:
        if name not in columns or 0 in columns[name].shape:
            return f"it has no usable {name} coordinate"
    for name, column in columns.items():
        known, dimensions = VARIABLES.get(name), column.dimensions
        if known is None:
            fits = len(set(dimensions)) == len(dimensions)
        else:
            characters = known.dtype == "str" and len(dimensions) == len(known.dims) + 1
            fits = dimensions[: len(dimensions) - characters] == known.dims
        if not fits:
            return f"{name} is over {', '.join(dimensions) or 'nothing'}"
    return ""


def _fault_of_attributes(attributes: Mapping[str, Any]) -> str:
    needed = _ATTRIBUTES | (_PARAMETERS if _PARAMETERS.keys() & attributes.keys() else {})
    for name, fits in (needed | {name: fits for name, fits in _LATER.items() if name in attributes}).items():
        if name not in attributes:
            return f"it has no attribute {name}"
        if not fits(attributes[name]):
            return f"its attribute {name} is not what it should be"
    return ""


def _fault_of_coordinates(dataset: xarray.Dataset) -> str:
    """Return a fault of steps, rows and columns, which count one by one."""
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
    lattice = lattice_of(dataset)
    window = lattice.size * lattice.cell_area
    return _fault_of_numbers(history, dataset.attrs, str(dataset.attrs["history"]), window)


def _fault_of_numbers(
    history: Mapping[str, Any], parameters: Mapping[Any, Any], story: str, window: float
) -> str:
    """Return a fault of values by step; a resumed run may have several tolerances."""
    given = [parameters.get("tolerance", 1.0), parameters.get("cycle_tolerance", 0.0)]
    tolerances = [*given, *map(float, chain(*re.findall(_CHANGED, story)))]
    cut = np.greater(history.get("cuts", 0), 0) | np.isfinite(history.get("segment_fraction", math.nan))
    for name, values in history.items():
        low, high = _bounds(name, history, window)
        if name in RESIDUALS.values():
            high = max(tolerances) * _ROUNDED
            if name == RESIDUALS["R_t"]:  # parts of a step are solved from one to the next
                values = np.where(cut, np.minimum(values, high), values)
        if (np.less(values, low) | np.greater(values, high)).any():
            return _NO_STEP.format(name)
    return ""


def _bounds(name: str, history: Mapping[str, Any], window: float) -> tuple[Any, Any]:
    """Return the smallest and the largest possible value by step."""
    known = VARIABLES[name]
    if known.dtype != "f8":
        return max(NOT_KEPT, known.least), max(known.flags, default=LARGEST)
    low: Any = known.least
    high: Any = known.most
    beside, power = known.scale
    if low > -LARGEST and beside:
        scale = np.abs(history.get(beside, 0.0)) * history.get("contact_radius", 0.0) ** power
        low = np.where(np.greater(scale, 0.0), low - _NOISE * scale, -LARGEST)
    if isinstance(high, str):
        high = np.multiply({**history, "window": window}.get(high, LARGEST), 1 + _CLOSE)
    return low, high


def _fault_of_fields(dataset: xarray.Dataset) -> str:
    """Return a fault of the deck, or of the fields, which are read step by step; empty if there is none."""
    try:
        tomllib.loads(str(dataset.attrs["deck"]))
    except tomllib.TOMLDecodeError as error:
        return f"its deck is no TOML: {error}"
    lattice = lattice_of(dataset)
    numbers, every = dataset["step"].values, int(dataset.attrs["output_every"])
    for place, number in enumerate(numbers):
        step = dataset.isel(step=place)
        fields = {str(name): v.values for name, v in step.data_vars.items() if v.dims == ("row", "col")}
        history = {str(name): v.item() for name, v in step.data_vars.items() if not v.dims}
        kept = number % every == 0 or number == numbers[-1]
        fault = _fault_of_values(fields, history, lattice.cell_area, kept)
        if fault := fault or (_fault_of_loads(fields, history, lattice) if kept else ""):
            return f"{fault} in step {number}"
    return ""


def _fault_of_loads(fields: Mapping[str, NDArray[Any]], history: Mapping[str, Any], lattice: Lattice) -> str:
    """Return a load that is not the resultant of the tractions at the nodes; empty if there is none."""
    p, q_x, q_y = (fields.get(name) for name in TRACTIONS)
    parts = {} if p is None else {"normal_load": p}
    if q_x is not None and q_y is not None:
        parts |= {"tangential_load_x": q_x, "tangential_load_y": q_y}
        parts["torque"] = np.array([lattice.x * q_y, -lattice.y * q_x])
    for name, values in parts.items():
        size = abs(values).sum() * lattice.cell_area
        if name in history and abs(values.sum() * lattice.cell_area - history[name]) > _CLOSE * size:
            return f"{name} is not the resultant of the tractions"
    return ""


def _fault_of_values(
    fields: Mapping[str, NDArray[Any]], history: Mapping[str, Any], cell_area: float, kept: bool = True
) -> str:
    """Return a fault of nodal values, which have bounds and fit the history."""
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
            if known.padding != 0:  # which may have no value out of contact
                wrong &= contact is not None and contact
            wrong |= values < known.least
        if wrong.any():
            return f"{name} holds numbers that no node has"
    if pressure is not None and kept and "max_pressure" in history:
        peak = pressure.max()
        if not math.isclose(peak, history["max_pressure"], rel_tol=_CLOSE):
            return "pressure does not fit to max_pressure"
    if zone is not None and kept and "contact_area" in history:
        cells = history["contact_area"] / cell_area
        if abs(np.count_nonzero(zone > 0) - cells) > _CLOSE * (1 + cells):
            return "zone does not fit to contact_area"
    return ""
