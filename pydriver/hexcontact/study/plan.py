"""The cases of a study: values of the parameters, combined, and a checked deck for each case."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from ..deck.faults import Source
from ..deck.read import assemble
from ..deck.tables import Deck
from ..deck.toml import with_overrides
from ..deck.write import as_toml
from ..errors import DeckError
from ..problem.checks import checked
from ..problem.problem import Problem
from ..text import shown
from .axes import Axis, axis_of, dimensions, evaluated, refuse_namesakes, refuse_twins
from .job import MOST_CASES, hash_of
from .tables import StudyFile

CheckLevel = Literal["windows", "decks", "nothing"]
"""What is checked when cases are planned."""

_MOST_LINES = 20  # of a message about wrong cases


@dataclass(frozen=True)
class PlannedCase:
    """A case of a study.

    Attributes
    ----------
    position : int
        Position in the study, from 0.
    settings : mapping of str to object
        Its parameters by key, as in the deck.
    deck : str
        Its merged deck.
    fault : str
        Message about a wrong deck; empty if it can be run.
    names : mapping of str to str
        Names of its parameters in the study, by key.
    """

    position: int
    settings: Mapping[str, Any]
    deck: str
    fault: str = ""
    names: Mapping[str, str] = field(default_factory=dict)

    @property
    def hash(self) -> str:
        """Name of the case: the hash of its deck."""
        return hash_of(self.deck)

    def __str__(self) -> str:
        return described(self.settings, self.names)


@dataclass(frozen=True)
class Plan:
    """All cases of a study, their parameters, and the number of cases along each dimension."""

    axes: tuple[Axis, ...]
    cases: tuple[PlannedCase, ...]
    dims: Mapping[str, int]


def described(settings: Mapping[str, Any], names: Mapping[str, str]) -> str:
    """Write the parameters of a case on one line, by the names of those keys that have one."""
    named = {names.get(key, key): value for key, value in settings.items()}
    return ", ".join(f"{name} = {in_short(value)}" for name, value in named.items())


def in_short(value: object) -> str:
    """Write a value of a parameter, without the rounding errors of a range or an expression."""
    return shown(float(f"{value:.10g}") if isinstance(value, float) else value)


def plan(
    file: StudyFile,
    base: Mapping[str, Any],
    source: Source,
    study: str,
    check: CheckLevel,
    skip_invalid: bool,
) -> Plan:
    """Build and check all cases of a study; raise a DeckError with a sentence for each fault.

    Of `base` the output file is ignored. Check "windows" finds the window of every case by a coarse solution,
    "decks" tests decks and loads, "nothing" builds the decks alone. With `skip_invalid` wrong cases are
    marked, unless all are wrong.
    """
    tolerant = skip_invalid or check == "nothing"
    base = {key: value for key, value in base.items() if key != "output"} | _output(base)
    keys = [key for parameter in file.parameter for key in parameter.key]
    mark = f"{study}: parameter "
    about = replace(source, overrides=frozenset(keys), of_override=mark)
    for key in keys:
        if key == "output" or key.startswith("output.file"):
            raise DeckError(f"{mark}{key}: a study names the files of its cases itself")
        if keys.count(key) > 1:
            raise DeckError(f"{mark}{key}: expected each key only once")
    names = {key: entry.name for entry in file.parameter if entry.name for key in entry.key}
    deck = _first_deck(file, base, about, mark, tolerant, names)
    given = [axis_of(entry, deck, file.combine, study) for entry in file.parameter]
    refuse_namesakes(given, [entry.group for entry in file.parameter], study)
    axes, dims = dimensions(file, given, deck, study)
    if (count := math.prod(map(len, dims.values()))) > MOST_CASES:
        raise DeckError(f"{study}: {count} cases; expected at most {MOST_CASES}")
    cases = []
    for position, choices in enumerate(itertools.product(*dims.values())):
        values = {key: value for choice in choices for key, value in choice.items()}
        merged, fault = with_overrides(base, values), ""
        try:
            for axis in axes:
                if axis.formula is not None:
                    found = dict.fromkeys(axis.keys, evaluated(axis, axes, deck, merged, study))
                    values |= found
                    merged = with_overrides(merged, found)
            if check == "windows":
                Problem._made(assemble(merged, source=about))
            elif check == "decks":
                checked(assemble(merged, source=about), False)
        except DeckError as error:
            fault = _message_of(error)
        cases.append(PlannedCase(position, values, as_toml(merged), fault, names))
    wrong = [case for case in cases if case.fault]
    if wrong and not (tolerant and len(wrong) < len(cases)):
        lines = _each_once([
            line
            for case in wrong
            for line in _with_case(case.fault, mark, case.position + 1, case.settings, names).splitlines()
        ])  # fmt: skip
        if (more := len(lines) - _MOST_LINES) > 0:
            lines = [*lines[:_MOST_LINES], f"... and {more} more"]
        raise DeckError("\n".join(lines))
    refuse_twins(axes, study)
    return Plan(axes, tuple(cases), {name: len(choices) for name, choices in dims.items()})


def _first_deck(
    file: StudyFile,
    base: Mapping[str, Any],
    about: Source,
    mark: str,
    tolerant: bool,
    names: Mapping[str, str],
) -> Deck:
    """Return the checked deck of the first values, or of the first valid ones, in which keys are found."""
    given = {key: entry.values or entry.range or () for entry in file.parameter for key in entry.key}
    error: DeckError | None = None
    for place in range(max(map(len, given.values())) if tolerant else 1):
        values = {key: entries[min(place, len(entries) - 1)] for key, entries in given.items() if entries}
        try:
            return Deck.parse(with_overrides(base, values), about)
        except DeckError as found:
            message = _with_case(_message_of(found), mark, place + 1, values, names)
            error = error or DeckError(message, found.faults)
    assert error is not None
    raise error


def _output(base: Mapping[str, Any]) -> dict[str, Any]:
    output = base.get("output")
    if not isinstance(output, Mapping):
        return {} if output is None else {"output": output}
    others = {key: value for key, value in output.items() if key != "file"}
    return {"output": others} if others else {}


def _with_case(
    error: str, mark: str, number: int, settings: Mapping[str, Any], names: Mapping[str, str]
) -> str:
    """Return a message with the parameters of the case, on lines whose key is none of them."""
    named = f" (in case {number}: {described(settings, names)})"
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
    """Return one line of those that differ only in the case they name."""
    first: dict[str, str] = {}
    for line in lines:
        first.setdefault(line.partition(" (in case ")[0], line)
    return list(first.values())


def _message_of(error: DeckError) -> str:
    """Return the message of an error, with one line for a fault that several load segments share."""
    found: dict[tuple[str, str], list[str]] = {}
    for fault in error.faults:
        name = fault.key
        if name.startswith("load."):
            name = next(part for part in reversed(name.split(".")) if not part.isdecimal())
        sentence = fault.message.rpartition(f"{fault.key}{fault.value and ' = '}{fault.value}: ")[2]
        found.setdefault((name, sentence), []).append(fault.message)
    lines = [
        first + f" (likewise in {len(more)} more segments)" * bool(more) for first, *more in found.values()
    ]
    return "\n".join(lines) or str(error)
