"""The cases of a study: values of the parameters, combined, and a checked deck for each case."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from ..deck.faults import Source
from ..deck.keys import Deck
from ..deck.read import assemble
from ..deck.toml import with_overrides
from ..deck.write import as_toml
from ..errors import DeckError, Fault
from ..problem.checks import checked
from ..problem.problem import Problem
from ..text import shown
from .axes import Axis, axis_of, dimensions, evaluated, refuse_namesakes, refuse_twins, wrong
from .job import MOST_CASES, hash_of
from .study_file import StudyFile

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
            raise wrong(study, key, "a study names the files of its cases itself")
        if keys.count(key) > 1:
            raise wrong(study, key, "expected each key only once")
    names = {key: entry.name for entry in file.parameter if entry.name for key in entry.key}
    deck = _first_deck(file, base, about, mark, tolerant, names)
    given = [axis_of(entry, deck, file.combine, study) for entry in file.parameter]
    refuse_namesakes(given, [entry.group for entry in file.parameter], study)
    axes, dims = dimensions(file, given, deck, study)
    if (count := math.prod(map(len, dims.values()))) > MOST_CASES:
        raise DeckError(f"{study}: {count} cases; expected at most {MOST_CASES}")
    cases: list[PlannedCase] = []
    lines: dict[str, str] = {}  # about wrong cases, by their messages
    for position, choices in enumerate(itertools.product(*dims.values())):
        values = {key: value for choice in choices for key, value in choice.items()}
        merged, faults = {}, []
        try:
            merged = _merged(base, values, mark)
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
            faults = _shared_by_segments(error)
            of_case = _lines(faults, keys, PlannedCase(position, values, "", names=names))
            lines |= {message: line for message, line in of_case.items() if message not in lines}
        messages = "\n".join(fault.message for fault in faults)
        cases.append(PlannedCase(position, values, as_toml(merged), messages, names))
    invalid = sum(bool(case.fault) for case in cases)
    if invalid and not (tolerant and invalid < len(cases)):
        more = f"... and {len(lines) - _MOST_LINES} more"
        shown_lines = [*lines.values()][:_MOST_LINES] + [more] * (len(lines) > _MOST_LINES)
        raise DeckError("\n".join(shown_lines))
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
            return Deck.parse(_merged(base, values, mark), about)
        except DeckError as found:
            lines = _lines(_shared_by_segments(found), given, PlannedCase(place, values, "", names=names))
            error = error or DeckError("\n".join(lines.values()), found.faults)
    assert error is not None
    raise error


def _output(base: Mapping[str, Any]) -> dict[str, Any]:
    output = base.get("output")
    if not isinstance(output, Mapping):
        return {} if output is None else {"output": output}
    others = {key: value for key, value in output.items() if key != "file"}
    return {"output": others} if others else {}


def _merged(base: Mapping[str, Any], values: Mapping[str, Any], mark: str) -> dict[str, Any]:
    """Return a deck with the values of parameters; an error names the parameter."""
    try:
        return with_overrides(base, values)
    except DeckError as error:
        message = f"{mark}{error}"
        raise DeckError(message, [Fault(message, next(iter(values)))]) from None


def _shared_by_segments(error: DeckError) -> list[Fault]:
    """Return the faults of an error, one for those that several load segments share."""
    found: dict[tuple[str, str], list[Fault]] = {}
    for fault in error.faults or [Fault(str(error))]:
        name = fault.key
        if name.startswith("load."):
            name = next(part for part in reversed(name.split(".")) if not part.isdecimal())
        found.setdefault((name, fault.sentence or fault.message), []).append(fault)
    likewise = " (likewise in {} more segments)"
    return [
        first._replace(message=first.message + likewise.format(len(more)) * bool(more))
        for first, *more in found.values()
    ]


def _lines(faults: Sequence[Fault], keys: Iterable[str], case: PlannedCase) -> dict[str, str]:
    """Return a line for each fault by its message; parameters of the case are named if it is of none."""
    found = {}
    for fault in faults:
        of_parameter = any(fault.key == key or fault.key.startswith(f"{key}.") for key in keys)
        about = "" if of_parameter else f" (in case {case.position + 1}: {case})"
        found[fault.message] = fault.message + about
    return found
