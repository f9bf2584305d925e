"""From a study file to its cases: values in SI, combined, each built as a `Case` before anything runs."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..case import Case
from ..deck.faults import Source
from ..deck.kinds import Kind, Quantity, Whole, WordOr
from ..deck.model import Table, kind_of
from ..deck.tables import Deck
from ..deck.toml import with_overrides
from ..deck.units import ANGLE
from ..deck.write import as_toml
from ..errors import DeckError
from ..text import shown
from .job import MOST_CASES
from .tables import Parameter, StudyFile

_MOST_TOLD = 20  # sentences about wrong cases


@dataclass(frozen=True)
class Axis:
    """A parameter with what the deck says about its key.

    Attributes
    ----------
    key : str
        Dotted key of the deck.
    name : str
        What the result calls it.
    units : str
        SI unit; empty for what is no quantity.
    long_name : str
        What it is, in words.
    kind : Kind or None
        How the deck reads a value.
    values : tuple
        The values as a deck would say them; empty for a range in a Latin hypercube.
    """

    key: str
    name: str
    units: str
    long_name: str
    kind: Kind | None
    values: tuple[Any, ...]

    def coordinate(self, value: Any) -> float | str:
        """Return what the result says for a value: a number in SI, or the text of what is no number."""
        if isinstance(self.kind, Quantity | Whole):
            return float(self.kind.parse(value))
        if isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
        return value if isinstance(value, str) else shown(value)


@dataclass(frozen=True)
class PlannedCase:
    """A case of a study.

    Attributes
    ----------
    position : int
        Position in the study, from 0.
    settings : mapping of str to object
        Its parameters by key, as the deck would say them.
    deck : str
        Its merged deck.
    """

    position: int
    settings: Mapping[str, Any]
    deck: str

    @property
    def hash(self) -> str:
        """Name of the case: that of its deck."""
        return hash_of(self.deck)

    def __str__(self) -> str:
        return described(self.settings)


@dataclass(frozen=True)
class Plan:
    """All cases of a study: their parameters and decks."""

    axes: tuple[Axis, ...]
    cases: tuple[PlannedCase, ...]


@dataclass(frozen=True)
class _StudySource(Source):
    """Points at the study for what it set, at the deck for the rest."""

    study: str = ""

    def locate(self, key: str) -> str:
        """Return "study.toml: parameter " or the place in the deck."""
        place = super().locate(key)
        return f"{self.study}: parameter " if place == "override: " else place


def hash_of(deck: str) -> str:
    """Return the name of a case: a hash of the text of its deck."""
    return hashlib.sha256(deck.encode()).hexdigest()[:20]


def described(settings: Mapping[str, Any]) -> str:
    """Write the parameters of a case on one line."""
    return ", ".join(f"{key} = {shown(value)}" for key, value in settings.items())


def plan(file: StudyFile, base: Mapping[str, Any], source: Source, study: str, check: bool = True) -> Plan:
    """Make and check all cases of a study.

    Parameters
    ----------
    file : StudyFile
        The study.
    base : mapping
        Its base deck; where the deck wants its result is of no account.
    source : Source
        Where the base deck came from, for messages.
    study : str
        What messages call the study.
    check : bool
        Build every case, so that whatever is wrong shows; otherwise only their decks are made.

    Raises
    ------
    DeckError
        With a sentence for each thing that is wrong, naming the parameter.
    """
    base = {key: value for key, value in base.items() if key != "output"} | _output(base)
    keys = frozenset(parameter.key for parameter in file.parameter)
    about = _StudySource(source.name, source.text, keys, source.included, study)
    for key in keys:
        if key == "output" or key.startswith("output.file"):
            raise DeckError(f"{study}: parameter {key}: a study names the files of its cases itself")
    first = {entry.key: next(iter(entry.values or entry.range or ())) for entry in file.parameter}
    try:
        deck = Deck.parse(with_overrides(base, first), about)
    except DeckError as error:
        raise DeckError(_with_case(str(error), about, 1, first), error.faults) from None
    axes = tuple(_axis(entry, deck, file.combine, study) for entry in file.parameter)
    _refuse_namesakes(axes, study)
    settings = _settings(file, axes, study)
    cases, sentences = [], []
    for position, values in enumerate(settings):
        try:
            merged = with_overrides(base, values)
            if check:
                Case._made(merged, None, about)
            cases.append(PlannedCase(position, values, as_toml(merged)))
        except DeckError as error:
            sentences.append(_with_case(str(error), about, position + 1, values))
    if sentences:
        lines = _each_once("\n".join(sentences).splitlines())
        if (more := len(lines) - _MOST_TOLD) > 0:
            lines = [*lines[:_MOST_TOLD], f"... and {more} more"]
        raise DeckError("\n".join(lines))
    if file.combine == "grid":
        _refuse_twins(axes, study)
    return Plan(axes, tuple(cases))


def _output(base: Mapping[str, Any]) -> dict[str, Any]:
    output = base.get("output")
    if not isinstance(output, Mapping):
        return {} if output is None else {"output": output}
    kept = {key: value for key, value in output.items() if key != "file"}
    return {"output": kept} if kept else {}


def _with_case(error: str, source: _StudySource, number: int, settings: Mapping[str, Any]) -> str:
    """Say with which parameters a deck is wrong where the key itself is none of them."""
    mark = f"{source.study}: parameter "
    named = f" (in case {number}: {described(settings)})"
    keys = tuple(settings)
    lines = []
    for line in error.splitlines():
        if line.startswith(mark):
            lines.append(line)
        elif line.startswith(keys):  # from merging the key into the deck
            lines.append(mark + line)
        else:
            lines.append(line + named)
    return "\n".join(lines)


def _each_once(lines: Sequence[str]) -> list[str]:
    """Keep one line of those that differ only in the case they name."""
    kept: dict[str, str] = {}
    for line in lines:
        kept.setdefault(line.partition(" (in case ")[0], line)
    return list(kept.values())


# --- values -------------------------------------------------------------------------------------------------


def _field(deck: Table, key: str) -> Any:
    """Find the field of a checked deck that a dotted key means; None for an entry of an array."""
    here: Any = deck
    parts = key.split(".")
    for part in parts[:-1]:
        if isinstance(here, list | tuple):
            here = here[int(part) - 1]
        else:
            names = {info.alias or name: name for name, info in type(here).model_fields.items()}
            here = getattr(here, names[part])
    return type(here).known_keys()[parts[-1]] if isinstance(here, Table) else None


def _axis(entry: Parameter, deck: Table, combine: str, study: str) -> Axis:
    info = _field(deck, entry.key)
    kind = kind_of(info) if info else None
    values = entry.values or ()
    if isinstance(kind, WordOr) and isinstance(kind.kind, Quantity | Whole) and kind.word not in values:
        kind = kind.kind  # a number like any other
    units = ""
    if isinstance(kind, Quantity | Whole):
        units = (kind.dimension.unit or "1") if isinstance(kind, Quantity) else "1"
    axis = Axis(
        entry.key,
        entry.label,
        units,
        (info.description or "").partition(";")[0] if info else "",
        kind,
        values,
    )
    if entry.range is None:
        return axis
    bounds = _bounds(axis, entry, study)
    if combine == "lhs":
        return axis
    count = entry.count or 0
    spread = [_between(axis, bounds, entry.scale, part) for part in np.linspace(0.0, 1.0, count)]
    return Axis(axis.key, axis.name, units, axis.long_name, kind, tuple(spread))


def _bounds(axis: Axis, entry: Parameter, study: str) -> tuple[float, float]:
    """Return the ends of a range in SI."""
    assert entry.range is not None
    where = f"{study}: parameter {axis.key}"
    if not isinstance(axis.kind, Quantity | Whole):
        raise DeckError(f"{where}: a range needs a key that is a number; expected values instead")
    ends = []
    for value in entry.range:
        try:
            ends.append(float(axis.kind.parse(value)))
        except ValueError as error:
            message = error.message() if hasattr(error, "message") else str(error)
            raise DeckError(f"{where} = {shown(value)}: {message}") from None
    low, high = ends
    if not (math.isfinite(low) and math.isfinite(high)) or low == high:
        raise DeckError(f"{where} = {shown(entry.range)}: expected two different, finite bounds")
    if entry.scale == "log" and not (low > 0 and high > 0):
        raise DeckError(f"{where} = {shown(entry.range)}: a logarithmic scale needs bounds above 0")
    return low, high


def _between(axis: Axis, bounds: tuple[float, float], scale: str, part: float) -> Any:
    """Return the value at a fraction of a range, as a deck would say it."""
    low, high = bounds
    if part in (0.0, 1.0):
        value = bounds[int(part)]
    elif scale == "log":
        value = low * (high / low) ** float(part)
    else:
        value = low + (high - low) * float(part)
    if isinstance(axis.kind, Whole):
        return round(value)
    if isinstance(axis.kind, Quantity) and axis.kind.dimension is ANGLE:
        return f"{value!r} rad"
    return value


def _settings(file: StudyFile, axes: Sequence[Axis], study: str) -> list[dict[str, Any]]:
    """Return the parameters of each case."""
    keys = [axis.key for axis in axes]
    if file.combine == "lhs":
        return _latin_hypercube(file, axes, study)
    count = math.prod(len(axis.values) for axis in axes)
    if file.combine == "grid":
        if count > MOST_CASES:
            raise DeckError(f"{study}: {count} cases; expected at most {MOST_CASES}")
        return [dict(zip(keys, row, strict=True)) for row in itertools.product(*(a.values for a in axes))]
    return [dict(zip(keys, row, strict=True)) for row in zip(*(a.values for a in axes), strict=True)]


def _latin_hypercube(file: StudyFile, axes: Sequence[Axis], study: str) -> list[dict[str, Any]]:
    from scipy.stats import qmc

    # `seed` is called `rng` in later versions of scipy, which still know it.
    sampler = qmc.LatinHypercube(len(axes), seed=np.random.default_rng(file.seed))
    cases: list[dict[str, Any]] = []
    for row in sampler.random(file.samples or 1):
        values = {}
        for axis, entry, part in zip(axes, file.parameter, row, strict=True):
            if entry.range is None:
                values[axis.key] = axis.values[int(part * len(axis.values))]
            else:
                values[axis.key] = _between(axis, _bounds(axis, entry, study), entry.scale, float(part))
        cases.append(values)
    return cases


_TAKEN = ("case", "step", "status", "exit_code", "message", "case_number", "case_seconds")


def _refuse_namesakes(axes: Sequence[Axis], study: str) -> None:
    from ..variables import VARIABLES

    names = [axis.name for axis in axes]
    for axis in axes:
        if axis.name in VARIABLES or axis.name in _TAKEN or names.count(axis.name) > 1:
            raise DeckError(
                f"{study}: parameter {axis.key}: the name {axis.name} is taken; choose another with name"
            )


def _refuse_twins(axes: Sequence[Axis], study: str) -> None:
    """Refuse a dimension of the result that has a coordinate twice."""
    for axis in axes:
        told = [axis.coordinate(value) for value in axis.values]
        if twins := [value for value in told if told.count(value) > 1]:
            raise DeckError(f"{study}: parameter {axis.key}: has the value {shown(twins[0])} twice")
