"""The parameters of a study: the keys that vary, their values, and their dimensions in the result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from ..deck.formula import Formula
from ..deck.interface import FrictionKind, NodalCoefficient, TwoCoefficients
from ..deck.kinds import Kind, OrShare, Quantity, Share, Whole, WordOr
from ..deck.table_base import Table, kind_of
from ..deck.units import NUMBER, UnitError, to_si
from ..errors import DeckError, Fault
from ..text import shown
from .study_file import Parameter, StudyFile


@dataclass(frozen=True)
class Axis:
    """Hold a parameter of a study, with unit, description and kind of its deck keys."""

    keys: tuple[str, ...]  # dotted, of the deck, which share one value
    name: str  # in the result
    units: str  # SI; empty if it is no quantity
    long_name: str
    kind: Kind | None  # of the values in the deck
    values: tuple[Any, ...]  # as in a deck; empty for a range in a Latin hypercube
    bounds: tuple[float, float] | None = None  # ends of a range, SI
    scale: str = "linear"  # spacing of the values in a range: linear or log
    dims: tuple[str, ...] = ()  # of the result, along which it varies
    formula: Formula | None = None  # its value in each case

    @property
    def key(self) -> str:
        """The first of its keys, named in messages."""
        return self.keys[0]

    def in_deck(self, value: float) -> Any:
        """Return a number in SI as a deck holds it."""
        assert self.kind is not None
        return round(value) if isinstance(self.kind, Whole) else self.kind.written(value)

    def at(self, part: float) -> Any:
        """Return the value at a fraction of the range, or of the list of values, as a deck holds it."""
        if self.bounds is None:
            return self.values[int(part * len(self.values))]
        low, high = self.bounds
        if part in (0.0, 1.0):
            value = self.bounds[int(part)]
        elif self.scale == "log":
            value = low * (high / low) ** part
        else:
            value = low + (high - low) * part
        return self.in_deck(value)

    def coordinate(self, value: Any) -> float | str:
        """Return the coordinate of a value in the result: a number in SI, or text."""
        if isinstance(self.kind, Quantity | Whole):
            try:
                return to_si(value, getattr(self.kind, "dimension", NUMBER))
            except UnitError:  # of a case that is left out
                return math.nan
        if isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
        return value if isinstance(value, str) else shown(value)


def wrong(study: str, key: str, problem: str, value: str = "") -> DeckError:
    """Return the error of a parameter of a study, a fault of its key."""
    message = f"{study}: parameter {key}{value and ' = '}{value}: {problem}"
    return DeckError(message, [Fault(message, key, value, sentence=problem)])


def _field(deck: Table, key: str) -> tuple[Any, Any]:
    """Return the field of a key in a checked deck (None for an entry of an array), and its value."""
    here: Any = deck
    info = None
    for part in key.split("."):
        if isinstance(here, list | tuple):
            here, info = here[int(part) - 1], None
        else:
            name, info = next((n, f) for n, f in type(here).model_fields.items() if part in (n, f.alias))
            here = getattr(here, name)
    return info, here


def _kind(info: Any, values: Sequence[Any] = ()) -> Kind | None:
    """Return the kind of a field; that of its numbers where all values are numbers."""
    kind = kind_of(info) if info else None
    if isinstance(kind, OrShare | FrictionKind):
        more = Share | NodalCoefficient | TwoCoefficients
        return kind if any(isinstance(_read(kind, value), more) for value in values) else kind.kind
    if isinstance(kind, WordOr) and isinstance(kind.kind, Quantity | Whole) and kind.word not in values:
        return kind.kind
    return kind


def _read(kind: Kind, value: Any) -> Any:
    try:
        return kind.parse(value)
    except PydanticCustomError:
        return None


def _unit(kind: Kind | None) -> str:
    if isinstance(kind, Quantity):
        return kind.dimension.unit or "1"
    return "1" if isinstance(kind, Whole) else ""


def axis_of(entry: Parameter, deck: Table, combine: str, study: str) -> Axis:
    """Return a parameter with unit, description and kind of its deck keys."""
    info, _ = _field(deck, entry.key[0])
    values = entry.values or ()
    kind = _kind(info, values or entry.range or ())
    units = _unit(kind)
    for key in entry.key[1:]:
        if _unit(_kind(_field(deck, key)[0], values)) != units:
            raise wrong(study, key, f"expected a key with the unit of {entry.key[0]}")
    long_name = (info.description or "").partition(";")[0] if info else ""
    axis = Axis(entry.key, entry.label, units, long_name, kind, values)
    if entry.expression is not None:
        _require_number(axis, "an expression", study)
        return replace(axis, formula=Formula(entry.expression))
    if entry.range is None:
        return axis
    axis = replace(axis, bounds=_bounds(axis, entry, study), scale=entry.scale)
    parts = np.linspace(0.0, 1.0, 0 if combine == "lhs" else entry.count or 0).tolist()
    return replace(axis, values=tuple(map(axis.at, parts)))


def _require_number(axis: Axis, source: str, study: str) -> Kind:
    if isinstance(axis.kind, Quantity | Whole):
        return axis.kind
    raise wrong(study, axis.key, f"{source} needs a key that is a number; expected values instead")


def _bounds(axis: Axis, entry: Parameter, study: str) -> tuple[float, float]:
    """Return the ends of a range in SI."""
    assert entry.range is not None
    kind = _require_number(axis, "a range", study)
    ends = []
    for value in entry.range:
        try:
            ends.append(float(kind.parse(value)))
        except PydanticCustomError as error:
            raise wrong(study, axis.key, error.message(), shown(value)) from None
    low, high = ends
    if not (math.isfinite(low) and math.isfinite(high)) or low == high:
        raise wrong(study, axis.key, "expected two different, finite bounds", shown(entry.range))
    if entry.scale == "log" and not (low > 0 and high > 0):
        raise wrong(study, axis.key, "a logarithmic scale needs bounds above 0", shown(entry.range))
    return low, high


def dimensions(
    file: StudyFile, axes: Sequence[Axis], deck: Table, study: str
) -> tuple[tuple[Axis, ...], dict[str, list[dict[str, Any]]]]:
    """Return the parameters, each with its dimensions, and the settings along each dimension of the study."""
    together: dict[str, list[Axis]] = {}
    placed: dict[str, Axis] = {}  # by name
    for axis, entry in zip(axes, file.parameter, strict=True):
        if axis.formula is None:
            dim = "case" if file.combine != "grid" else entry.group or axis.name
            placed[axis.name] = replace(axis, dims=(dim,))
            together.setdefault(dim, []).append(axis)
    for axis in axes:
        if axis.formula is not None:
            used: set[str] = set()
            for name in axis.formula.names:
                (key, source), problem = _key_of(name, axes), ""
                if source is None and not _is_number(deck, key):
                    problem = f"{name} is neither a parameter nor a number of the deck"
                elif source is not None and source.name not in placed:
                    problem = f"{name} has an expression itself; expected one above this parameter"
                if problem:
                    raise wrong(study, axis.key, f"expression: {problem}")
                used |= set(placed[source.name].dims if source else ())
            placed[axis.name] = replace(axis, dims=tuple(dim for dim in together if dim in used))
    if file.combine == "lhs":
        return tuple(placed[axis.name] for axis in axes), {"case": _latin_hypercube(file, together["case"])}
    dims = {}
    for dim, group in together.items():
        rows = zip(*(axis.values for axis in group), strict=True)
        dims[dim] = [_settings(group, row) for row in rows]
    return tuple(placed[axis.name] for axis in axes), dims


def _settings(axes: Sequence[Axis], values: Sequence[Any]) -> dict[str, Any]:
    return {key: value for axis, value in zip(axes, values, strict=True) for key in axis.keys}


def _key_of(name: str, axes: Sequence[Axis]) -> tuple[str, Axis | None]:
    """Return the key of a name in a formula, and its parameter; None for a key of the deck alone."""
    axis = next((axis for axis in axes if name == axis.name or name in axis.keys), None)
    return (name if axis is None or name in axis.keys else axis.key), axis


def _is_number(deck: Table, key: str) -> bool:
    try:
        info, value = _field(deck, key)
    except (StopIteration, LookupError, ValueError, AttributeError):
        return False
    return value is not None and isinstance(_kind(info, (value,)), Quantity | Whole)


def evaluated(axis: Axis, axes: Sequence[Axis], deck: Table, merged: Mapping[str, Any], study: str) -> Any:
    """Return the value of a formula in a case, as its deck holds it."""
    assert axis.formula is not None
    numbers = {}
    for name in axis.formula.names:
        key, _ = _key_of(name, axes)
        info, default = _field(deck, key)
        value: Any = merged
        for part in key.split("."):
            value = value[int(part) - 1] if isinstance(value, list) else value.get(part, {})
        kind = _kind(info)
        try:
            numbers[name] = default if value == {} or kind is None else float(kind.parse(value))
        except PydanticCustomError as error:
            problem = f"expression: {key} = {shown(value)}: {error.message()}"
            raise wrong(study, axis.key, problem) from None
    try:
        found = axis.formula.value(numbers)
    except ValueError as error:
        raise wrong(study, axis.key, f"expression: {error}") from None
    return axis.in_deck(found)


def _latin_hypercube(file: StudyFile, axes: Sequence[Axis]) -> list[dict[str, Any]]:
    from scipy.stats import qmc

    # Later versions of scipy name it `rng` and still accept `seed`.
    sampler = qmc.LatinHypercube(len(axes), seed=np.random.default_rng(file.seed))
    rows = sampler.random(file.samples or 1).tolist()
    return [_settings(axes, [axis.at(part) for axis, part in zip(axes, row, strict=True)]) for row in rows]


_TAKEN = ("case", "step", "status", "exit_code", "message", "case_number", "case_seconds")


def refuse_namesakes(axes: Sequence[Axis], groups: Sequence[str | None], study: str) -> None:
    """Refuse names that the result uses for other quantities."""
    from ..variables import VARIABLES

    names = [axis.name for axis in axes]
    for axis, group in zip(axes, groups, strict=True):
        taken = [name for name in (axis.name, group) if name in VARIABLES or name in _TAKEN]
        taken += [axis.name] * (names.count(axis.name) > 1) + [str(group)] * (group in names)
        if taken:
            raise wrong(study, axis.key, f"the name {taken[0]} is taken; choose another with name")


def refuse_twins(axes: Sequence[Axis], study: str) -> None:
    """Refuse equal coordinates along a dimension of the result."""
    for axis in axes:
        if axis.dims != (axis.name,):
            continue
        entries = [axis.coordinate(value) for value in axis.values]
        if twins := [value for value in entries if entries.count(value) > 1]:
            raise wrong(study, axis.key, f"has the value {shown(twins[0])} twice")
