"""The cases of a study: its file, the parameters that vary, their values, a checked deck for each."""

from __future__ import annotations

import contextlib
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field
from pydantic_core import PydanticCustomError

from ..deck.faults import Source, deck_error
from ..deck.interface import FrictionKind, NodalCoefficient, TwoCoefficients
from ..deck.json_schema import schema_of
from ..deck.keys import Deck
from ..deck.kinds import (
    Formula,
    Kind,
    OrShare,
    Quantity,
    Schema,
    Several,
    Share,
    Text,
    Whole,
    Word,
    WordOr,
    refuse,
)
from ..deck.read import Assembled, assemble
from ..deck.table_base import Table, extended, kind_of, meaning
from ..deck.toml import as_toml, read_toml, with_overrides
from ..deck.units import NUMBER, SPIN, UnitError, to_si
from ..errors import DeckError, Fault
from ..problem.checks import checked
from ..problem.problem import Problem
from ..text import counted, shown
from ..variables import VARIABLES
from . import backends  # noqa: F401 (each registers its key)
from .backend import KEYS, MOST_CASES, hash_of


class Anything(Kind):
    """A value of any kind, which is checked with the deck."""

    expected = "a value of that key"


class VariableName(Text):
    """A name that a netCDF file can have for a variable."""

    expected = "a name of letters, digits and _"

    def _parse(self, value: object) -> str:
        name = super()._parse(value)
        return name if re.fullmatch(r"\w(?:[\w .+-]*[\w.+-])?", name) else refuse(f"expected {self.expected}")


_KEY = {"type": "string", "minLength": 1}


class Keys(Kind):
    """One dotted key of a deck, or several that share one value."""

    expected = 'a dotted key of the deck, or an array of them, such as "load.1.normal_load"'
    schema: ClassVar[Schema] = {"anyOf": [_KEY, {"type": "array", "items": _KEY, "minItems": 1}]}  # type: ignore[misc]

    def _parse(self, value: object) -> tuple[str, ...]:
        keys = tuple(value) if isinstance(value, list | tuple) else (value,)
        whole = keys and all(isinstance(key, str) and key.strip() for key in keys)
        return keys if whole else refuse(f"expected {self.expected}")

    def written(self, value: tuple[str, ...]) -> str | list[str]:
        """Return one key as text, several as a list."""
        return value[0] if len(value) == 1 else list(value)


class Expression(Text):
    """A formula over parameters and keys of the deck."""

    def _parse(self, value: object) -> str:
        text = super()._parse(value)
        try:
            return text if Formula(text) else ""
        except ValueError as error:
            refuse(f"expected {error}")


_pair = partial(Several, count=2)


class Parameter(Table):
    """An entry of [[parameter]]: a key of the deck, or several, and its values."""

    key: Annotated[tuple[str, ...], Keys()] = meaning(
        ..., "dotted key of the deck, such as load.1.normal_load; several keys have the same value"
    )
    name: Annotated[str, VariableName()] | None = meaning(
        None, "name in the result; the key with _ for . if absent", '"load"'
    )
    values: Annotated[tuple[Any, ...], Several(Anything(), "values", '["1 N", "2 N"]')] | None = meaning(
        None, "the values"
    )
    range: Annotated[tuple[Any, ...], _pair(Anything(), "bounds", '["1 N", "5 N"]')] | None = meaning(
        None, "first and last value, instead of `values`"
    )
    count: Annotated[int, Whole(2, MOST_CASES)] | None = meaning(
        None, "number of values in `range` (grid, zip)"
    )
    scale: Annotated[str, Word(("linear", "log"))] = meaning(
        "linear", "log: values in `range` in equal ratios"
    )
    expression: Annotated[str, Expression()] | None = meaning(
        None,
        "formula in SI over parameters and keys of the deck, instead of `values`",
        '"0.8 * friction.coefficient * load.1.normal_load"',
    )
    group: Annotated[str, VariableName()] | None = meaning(
        None, "parameters of one group vary side by side, as one dimension of this name (grid)", '"material"'
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Require one of values, range and expression."""
        sources = {"values": (), "range": ("count", "scale"), "expression": ()}
        given = [key for key in sources if data.get(key) is not None]
        if not given:
            yield "values", "missing; expected values, range or expression"
            return
        foreign = [key for key in sources if key != given[0]]
        if given[0] != "range":
            foreign += sources["range"]
        for key in foreign + ["group"] * (given[0] == "expression"):
            if key in data:
                yield key, f"expected {given[0]} or {key}, not both"

    @property
    def label(self) -> str:
        """Name of the parameter in the result."""
        return self.name or self.key[0].replace(".", "_")


def _both_signs(values: Sequence[float]) -> str:
    return "" if values[0] < 0.0 < values[1] else "expected a number below 0 and one above it"


def _from_zero(values: Sequence[float]) -> str:
    fits = values[0] == 0.0 < values[1] or values[0] < 0.0 < values[1]
    return "" if fits else "expected 0, or a number below it, and a number above it"


_CREEPAGE_X = _pair(Quantity(NUMBER), "numbers", "[0, 0.01]", fault_of=_from_zero)
_CREEPAGE_Y = _pair(Quantity(NUMBER), "numbers", "[-0.01, 0.01]", fault_of=_both_signs)
_SPIN = _pair(Quantity(SPIN), "spins", '["0 rad/m", "40 rad/m"]', fault_of=_from_zero)
_FEWEST = 4  # values along an axis of a creep table: as many as a cubic needs


class CreepAxes(Table):
    """Ranges of a creep table, and numbers of its cases; an empty table takes all from the contact."""

    creepage_x: Annotated[tuple[float, ...], _CREEPAGE_X] | None = meaning(
        None, "range of `creepage_x`; from 0: the table is mirrored; to full slip if absent"
    )
    creepage_y: Annotated[tuple[float, ...], _CREEPAGE_Y] | None = meaning(
        None, "range of `creepage_y` at the pole of the table; to full slip if absent"
    )
    spin: Annotated[tuple[float, ...], _SPIN] | None = meaning(None, "range of `spin`, likewise")
    counts: Annotated[
        tuple[int, ...], Several(Whole(_FEWEST, MOST_CASES), "whole numbers", "[12, 27, 10]", count=3)
    ] = meaning((12, 27, 10), "numbers of creepages x and y and of spins, denser near 0")
    held_out: Annotated[int, Whole(1, MOST_CASES)] = meaning(
        50, "random cases that are solved to measure the error of interpolation"
    )


class _Study(Table):
    """A study file without the keys of backends."""

    title: Annotated[str, Text()] = meaning("", "a line about the study", '"Energy of a cycle"')
    deck: Annotated[str, Text()] = meaning(
        ..., "the base deck; a relative name starts at the study file", '"fretting.toml"'
    )
    combine: Annotated[str, Word(("grid", "zip", "lhs"))] = meaning(
        "grid",
        "grid: every value with every other; zip: first with first, second with second; lhs: Latin hypercube",
    )
    samples: Annotated[int, Whole(1, MOST_CASES)] | None = meaning(None, "number of cases (lhs)")
    seed: Annotated[int, Whole(0)] = meaning(0, "seed of the Latin hypercube")
    steps: Annotated[str, Word(("last", "all"))] = meaning(
        "last", "load steps whose history the result holds"
    )
    output: Annotated[str, Text()] | None = meaning(
        None, "netCDF file of the result; the name of the study file with .nc if absent", '"study.nc"'
    )
    parameter: list[Parameter] = Field([], min_length=1)
    creep_table: CreepAxes | None = None

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Require the keys of the combination, and refuse those of others."""
        if "creep_table" in data:
            for key in data.keys() - {"title", "deck", "output", "creep_table"}:
                yield key, "expected only title, deck and output beside creep_table"
            return
        if "parameter" not in data:
            yield "parameter", "missing; expected an array of tables of keys, or a table creep_table"
        combine = data.get("combine", "grid")
        if combine == "lhs" and "samples" not in data:
            yield "samples", "missing; a Latin hypercube needs the number of its cases"
        if combine != "lhs":
            for key in ("samples", "seed"):
                if key in data:
                    yield key, 'belongs to combine = "lhs"'
        given = data.get("parameter")
        entries = [entry for entry in given if isinstance(entry, Mapping)] if isinstance(given, list) else []
        for number, entry in enumerate(entries, start=1):
            if combine == "lhs" and "count" in entry:
                yield f"parameter.{number}.count", "a Latin hypercube takes the number of its cases, samples"
            if combine != "lhs" and "range" in entry and "count" not in entry:
                yield f"parameter.{number}.count", "missing; expected the number of values in range"
            if combine != "grid" and "group" in entry:
                yield f"parameter.{number}.group", 'belongs to combine = "grid"'
        varied = [entry for entry in entries if "expression" not in entry]
        if entries and not varied:
            yield "parameter", "expected values or a range of one parameter at least"
        if combine != "lhs":
            groups: dict[Any, list[int]] = {}
            for position, entry in enumerate(varied):
                together = "zip" if combine == "zip" else entry.get("group", position)
                count = entry.get("count", 0) if "range" in entry else _length(entry.get("values"))
                groups.setdefault(together, []).append(count)
            for name, lengths in groups.items():
                if len(set(lengths)) > 1:
                    numbers = ", ".join(map(str, lengths))
                    yield "parameter", f"{name} needs as many values of each; they have {numbers}"


_Extended: Any = extended(_Study, KEYS)


class StudyFile(_Extended):
    """A whole study file."""

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a study file; DeckError with a sentence for each fault."""
        data, text = read_toml(path, "a study")
        if "body" in data and "parameter" not in data:
            raise DeckError(f"{path} is a deck and no study; hexcontact run {path} solves it")
        return cls.parse(data, Source(str(path), text))

    @property
    def names(self) -> dict[str, str]:
        """Names of parameters by their keys; keys without one are missing."""
        return {key: entry.name for entry in self.parameter if entry.name for key in entry.key}


def study_schema() -> Schema:
    """Return the JSON schema of study files."""
    required = [key for key, info in StudyFile.known_keys().items() if info.is_required()]
    cases = [{"required": [key]} for key in ("parameter", "creep_table")]
    schema = schema_of(StudyFile, "hexcontact study", "Many cases of one deck")
    return schema | {"required": required, "oneOf": cases}


def _length(values: object) -> int:
    return len(values) if isinstance(values, list | tuple) else 0


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
    inputs: Mapping[str, str] = field(default_factory=dict)  # keys of the names in the formula

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
        for value in values:
            with contextlib.suppress(PydanticCustomError):
                if isinstance(kind.parse(value), Share | NodalCoefficient | TwoCoefficients):
                    return kind
        return kind.kind
    if isinstance(kind, WordOr) and isinstance(kind.kind, Quantity | Whole) and kind.word not in values:
        return kind.kind
    return kind


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
    if entry.values is not None:
        return axis
    if not isinstance(kind, Quantity | Whole):
        source = "an expression" if entry.expression is not None else "a range"
        raise wrong(study, axis.key, f"{source} needs a key that is a number; expected values instead")
    if entry.expression is not None:
        return replace(axis, formula=Formula(entry.expression))
    ends = []
    for value in entry.range or ():
        try:
            ends.append(float(kind.parse(value)))
        except PydanticCustomError as error:
            raise wrong(study, axis.key, error.message(), shown(value)) from None
    low, high = ends
    if not (math.isfinite(low) and math.isfinite(high)) or low == high:
        raise wrong(study, axis.key, "expected two different, finite bounds", shown(entry.range))
    if entry.scale == "log" and not (low > 0 and high > 0):
        raise wrong(study, axis.key, "a logarithmic scale needs bounds above 0", shown(entry.range))
    axis = replace(axis, bounds=(low, high), scale=entry.scale)
    parts = np.linspace(0.0, 1.0, 0 if combine == "lhs" else entry.count or 0).tolist()
    return replace(axis, values=tuple(map(axis.at, parts)))


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
            inputs: dict[str, str] = {}
            for name in axis.formula.names:
                source, problem = next((one for one in axes if name in (one.name, *one.keys)), None), ""
                inputs[name] = name if source is None or name in source.keys else source.key
                if source is None and not _is_number(deck, name):
                    problem = f"{name} is neither a parameter nor a number of the deck"
                elif source is not None and source.name not in placed:
                    problem = f"{name} has an expression itself; expected one above this parameter"
                if problem:
                    raise wrong(study, axis.key, f"expression: {problem}")
                used |= set(placed[source.name].dims if source else ())
            dims_of = tuple(dim for dim in together if dim in used)
            placed[axis.name] = replace(axis, dims=dims_of, inputs=inputs)
    dims = {}
    for dim, group in together.items():
        rows: Iterable[Sequence[Any]] = zip(*(axis.values for axis in group), strict=True)
        if file.combine == "lhs":
            from scipy.stats import qmc

            # Later versions of scipy name it `rng` and still accept `seed`.
            sampler = qmc.LatinHypercube(len(group), seed=np.random.default_rng(file.seed))
            parts = sampler.random(file.samples or 1).tolist()
            rows = [[axis.at(part) for axis, part in zip(group, row, strict=True)] for row in parts]
        dims[dim] = [
            {key: value for axis, value in zip(group, row, strict=True) for key in axis.keys} for row in rows
        ]
    return tuple(placed[axis.name] for axis in axes), dims


def _is_number(deck: Table, key: str) -> bool:
    with contextlib.suppress(StopIteration, LookupError, ValueError, AttributeError):
        info, value = _field(deck, key)
        return value is not None and isinstance(_kind(info, (value,)), Quantity | Whole)
    return False


def evaluated(axis: Axis, deck: Table, merged: Mapping[str, Any], study: str) -> Any:
    """Return the value of a formula in a case, as its deck holds it."""
    assert axis.formula is not None
    numbers = {}
    for name, key in axis.inputs.items():
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


_TAKEN = ("case", "step", "status", "exit_code", "message", "case_number", "case_seconds")  # in the result


def _refuse_namesakes(axes: Sequence[Axis], groups: Sequence[str | None], study: str) -> None:
    """Refuse names that the result uses for other quantities."""
    names = [axis.name for axis in axes]
    for axis, group in zip(axes, groups, strict=True):
        taken = [name for name in (axis.name, group) if name in VARIABLES or name in _TAKEN]
        taken += [axis.name] * (names.count(axis.name) > 1) + [str(group)] * (group in names)
        if taken:
            raise wrong(study, axis.key, f"the name {taken[0]} is taken; choose another with name")


CheckLevel = Literal["windows", "decks", "nothing"]
"""What is checked when cases are planned."""

_MOST_LINES = 20  # of a message about wrong cases


@dataclass(frozen=True)
class PlannedCase:
    """A case of a study."""

    position: int  # in the study, from 0
    settings: Mapping[str, Any]  # its parameters by key, as in the deck
    deck: str  # its merged deck
    fault: str = ""  # message about a wrong deck; empty if it can be run
    names: Mapping[str, str] = field(default_factory=dict)  # of its parameters in the study, by key

    @property
    def hash(self) -> str:
        """Name of the case: the hash of its deck."""
        return hash_of(self.deck)

    def __str__(self) -> str:
        named = {self.names.get(key, key): value for key, value in self.settings.items()}
        return ", ".join(f"{name} = {in_short(value)}" for name, value in named.items())


@dataclass(frozen=True)
class Plan:
    """All cases of a study, their parameters, and the number of cases along each dimension."""

    axes: tuple[Axis, ...]
    cases: tuple[PlannedCase, ...]
    dims: Mapping[str, int]


def in_short(value: object) -> str:
    """Write a value of a parameter, without the rounding errors of a range or an expression."""
    return shown(float(f"{value:.10g}") if isinstance(value, float) else value)


def base_of(deck: str | Path | Mapping[str, Any]) -> Assembled:
    """Return a base deck that contains included decks and rows of series, as its cases do."""
    base, text = (deck, "") if isinstance(deck, Mapping) else read_toml(deck)
    name = "" if isinstance(deck, Mapping) else str(deck)
    whole = assemble(base, text, Source(name, text), Path(name).parent)
    if whole.problems:
        raise deck_error(whole.problems, whole.source)
    return whole


def plan(file: StudyFile, whole: Assembled, study: str, check: CheckLevel, skip_invalid: bool) -> Plan:
    """Build and check all cases of a study; raise a DeckError with a sentence for each fault.

    The output file of the deck is ignored. Check "windows" finds the window of every case by a coarse
    solution, "decks" tests decks and loads, "nothing" builds the decks alone. With `skip_invalid` wrong
    cases are marked, unless all are wrong.
    """
    tolerant = skip_invalid or check == "nothing"
    base, source = dict(whole.data), whole.source
    output = base.pop("output", None)
    if isinstance(output, Mapping):
        output = {key: value for key, value in output.items() if key != "file"}
    if output not in (None, {}):
        base["output"] = output
    keys = [key for parameter in file.parameter for key in parameter.key]
    about = replace(source, overrides=frozenset(keys), of_override=f"{study}: parameter ")
    for key in keys:
        if key == "output" or key.startswith("output.file"):
            raise wrong(study, key, "a study names the files of its cases itself")
        if keys.count(key) > 1:
            raise wrong(study, key, "expected each key only once")
    names = file.names
    deck = _first_deck(file, base, about, tolerant)
    given = [axis_of(entry, deck, file.combine, study) for entry in file.parameter]
    _refuse_namesakes(given, [entry.group for entry in file.parameter], study)
    axes, dims = dimensions(file, given, deck, study)
    if (count := math.prod(map(len, dims.values()))) > MOST_CASES:
        raise DeckError(f"{study}: {count} cases; expected at most {MOST_CASES}")
    cases: list[PlannedCase] = []
    lines: dict[str, str] = {}  # about wrong cases, by their messages
    for position, choices in enumerate(itertools.product(*dims.values())):
        values = {key: value for choice in choices for key, value in choice.items()}
        merged: dict[str, Any] = {}
        faults: dict[str, str] = {}
        try:
            merged = _merged(base, values, about)
            for axis in axes:
                if axis.formula is not None:
                    found = dict.fromkeys(axis.keys, evaluated(axis, deck, merged, study))
                    values |= found
                    merged = with_overrides(merged, found)
            if check == "windows":
                Problem._made(assemble(merged, source=about))
            elif check == "decks":
                checked(assemble(merged, source=about), None, None)
        except DeckError as error:
            faults = _lines(error, keys, PlannedCase(position, values, "", names=names))
            lines |= {message: line for message, line in faults.items() if message not in lines}
        cases.append(PlannedCase(position, values, as_toml(merged), "\n".join(faults), names))
    invalid = sum(bool(case.fault) for case in cases)
    if invalid and not (tolerant and invalid < len(cases)):
        more = f"... and {len(lines) - _MOST_LINES} more"
        shown_lines = [*lines.values()][:_MOST_LINES] + [more] * (len(lines) > _MOST_LINES)
        raise DeckError("\n".join(shown_lines))
    for axis in axes:
        entries = [axis.coordinate(value) for value in axis.values if axis.dims == (axis.name,)]
        if twins := [value for value in entries if entries.count(value) > 1]:
            raise wrong(study, axis.key, f"has the value {shown(twins[0])} twice")
    return Plan(axes, tuple(cases), {name: len(choices) for name, choices in dims.items()})


def _first_deck(file: StudyFile, base: Mapping[str, Any], about: Source, tolerant: bool) -> Deck:
    """Return the checked deck of the first values, or of the first valid ones, in which keys are found."""
    given = {key: entry.values or entry.range or () for entry in file.parameter for key in entry.key}
    error: DeckError | None = None
    for place in range(max(map(len, given.values())) if tolerant else 1):
        values = {key: entries[min(place, len(entries) - 1)] for key, entries in given.items() if entries}
        try:
            return Deck.parse(_merged(base, values, about), about)
        except DeckError as found:
            case = PlannedCase(place, values, "", names=file.names)
            error = error or DeckError("\n".join(_lines(found, given, case).values()), found.faults)
    assert error is not None
    raise error


def _merged(base: Mapping[str, Any], values: Mapping[str, Any], about: Source) -> dict[str, Any]:
    """Return a deck with the values of parameters; an error names the parameter."""
    try:
        return with_overrides(base, values)
    except DeckError as error:
        message = f"{about.of_override}{error}"
        raise DeckError(message, [Fault(message, next(iter(values)))]) from None


def _lines(error: DeckError, keys: Iterable[str], case: PlannedCase) -> dict[str, str]:
    """Return a line for each fault by its message, one for those that several load segments share.

    Parameters of the case are named if the fault is of none.
    """
    found: dict[tuple[str, str], list[Fault]] = {}
    for fault in error.faults or [Fault(str(error))]:
        name = fault.key
        if name.startswith("load."):
            name = next(part for part in reversed(name.split(".")) if not part.isdecimal())
        found.setdefault((name, fault.sentence or fault.message), []).append(fault)
    lines = {}
    for first, *more in found.values():
        message = first.message + f" (likewise in {counted(len(more), 'more segment')})" * bool(more)
        of_parameter = any(first.key == key or first.key.startswith(f"{key}.") for key in keys)
        lines[message] = message + ("" if of_parameter else f" (in case {case.position + 1}: {case})")
    return lines
