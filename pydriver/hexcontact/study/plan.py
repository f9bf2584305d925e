"""From a study file to its cases: values in SI, combined, each built as a `Case` before anything runs."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..case import Case
from ..deck.faults import Source
from ..deck.kinds import Kind, Quantity, Whole, WordOr
from ..deck.model import Table, kind_of
from ..deck.read import assemble
from ..deck.tables import Deck
from ..deck.toml import with_overrides
from ..deck.units import NUMBER
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
    bounds : (float, float) or None
        The ends of a range in SI.
    scale : str
        How values lie in a range: linear or log.
    """

    key: str
    name: str
    units: str
    long_name: str
    kind: Kind | None
    values: tuple[Any, ...]
    bounds: tuple[float, float] | None = None
    scale: str = "linear"

    def at(self, part: float) -> Any:
        """Return the value at a fraction of the way, as a deck would say it."""
        if self.bounds is None:
            return self.values[int(part * len(self.values))]
        low, high = self.bounds
        if part in (0.0, 1.0):
            value = self.bounds[int(part)]
        elif self.scale == "log":
            value = low * (high / low) ** part
        else:
            value = low + (high - low) * part
        assert self.kind is not None
        return round(value) if isinstance(self.kind, Whole) else self.kind.written(value)

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
    mark = f"{study}: parameter "
    about = replace(source, overrides=keys, of_override=mark)
    for key in keys:
        if key == "output" or key.startswith("output.file"):
            raise DeckError(f"{study}: parameter {key}: a study names the files of its cases itself")
    first = {entry.key: next(iter(entry.values or entry.range or ())) for entry in file.parameter}
    try:
        deck = Deck.parse(with_overrides(base, first), about)
    except DeckError as error:
        raise DeckError(_with_case(str(error), mark, 1, first), error.faults) from None
    axes = tuple(_axis(entry, deck, file.combine, study) for entry in file.parameter)
    _refuse_namesakes(axes, study)
    settings = _settings(file, axes, study)
    cases, sentences = [], []
    for position, values in enumerate(settings):
        try:
            merged = with_overrides(base, values)
            if check:
                Case._made(assemble(merged, source=about))
            cases.append(PlannedCase(position, values, as_toml(merged)))
        except DeckError as error:
            sentences.append(_with_case(str(error), mark, position + 1, values))
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


def _with_case(error: str, mark: str, number: int, settings: Mapping[str, Any]) -> str:
    """Say with which parameters a deck is wrong where the key itself is none of them."""
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
    *parents, last = key.split(".")
    for part in parents:
        if isinstance(here, list | tuple):
            here = here[int(part) - 1]
        else:
            here = getattr(here, next(n for n, f in type(here).model_fields.items() if part in (n, f.alias)))
    return type(here).known_keys()[last] if isinstance(here, Table) else None


def _axis(entry: Parameter, deck: Table, combine: str, study: str) -> Axis:
    info = _field(deck, entry.key)
    kind = kind_of(info) if info else None
    values = entry.values or ()
    if isinstance(kind, WordOr) and isinstance(kind.kind, Quantity | Whole) and kind.word not in values:
        kind = kind.kind  # a number like any other
    units = {Quantity: getattr(kind, "dimension", NUMBER).unit or "1", Whole: "1"}.get(type(kind), "")
    long_name = (info.description or "").partition(";")[0] if info else ""
    axis = Axis(entry.key, entry.label, units, long_name, kind, values)
    if entry.range is None:
        return axis
    axis = replace(axis, bounds=_bounds(axis, entry, study), scale=entry.scale)
    parts = np.linspace(0.0, 1.0, 0 if combine == "lhs" else entry.count or 0).tolist()
    return replace(axis, values=tuple(map(axis.at, parts)))


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


def _settings(file: StudyFile, axes: Sequence[Axis], study: str) -> list[dict[str, Any]]:
    """Return the parameters of each case."""
    keys = [axis.key for axis in axes]
    if file.combine == "lhs":
        return _latin_hypercube(file, axes)
    count = math.prod(len(axis.values) for axis in axes)
    if file.combine == "grid":
        if count > MOST_CASES:
            raise DeckError(f"{study}: {count} cases; expected at most {MOST_CASES}")
        return [dict(zip(keys, row, strict=True)) for row in itertools.product(*(a.values for a in axes))]
    return [dict(zip(keys, row, strict=True)) for row in zip(*(a.values for a in axes), strict=True)]


def _latin_hypercube(file: StudyFile, axes: Sequence[Axis]) -> list[dict[str, Any]]:
    from scipy.stats import qmc

    # `seed` is called `rng` in later versions of scipy, which still know it.
    sampler = qmc.LatinHypercube(len(axes), seed=np.random.default_rng(file.seed))
    rows = sampler.random(file.samples or 1).tolist()
    return [{axis.key: axis.at(part) for axis, part in zip(axes, row, strict=True)} for row in rows]


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
        entries = [axis.coordinate(value) for value in axis.values]
        if twins := [value for value in entries if entries.count(value) > 1]:
            raise DeckError(f"{study}: parameter {axis.key}: has the value {shown(twins[0])} twice")
