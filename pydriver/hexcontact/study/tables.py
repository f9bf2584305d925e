"""The study file: which deck, which of its keys vary, how they are combined. Checked as decks are."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from ..deck.kinds import Kind, Several, Text, Whole, Word, refuse
from ..deck.model import Table, extended, meaning
from . import backends  # noqa: F401 (each registers its key)
from .backend import KEYS
from .job import MOST_CASES


@dataclass(frozen=True)
class Anything(Kind):
    """A value that only the deck can judge."""

    def _expected(self) -> str:
        return "a value of that key"

    def _parse(self, value: object) -> object:
        return value


@dataclass(frozen=True)
class VariableName(Text):
    """A name that a netCDF file can have for a variable."""

    def _expected(self) -> str:
        return "a name of letters, digits and _"

    def _parse(self, value: object) -> str:
        name = super()._parse(value)
        return name if re.fullmatch(r"\w(?:[\w .+-]*[\w.+-])?", name) else refuse(f"expected {self.expected}")


class Parameter(Table):
    """An entry of [[parameter]]: a key of the deck and the values it takes."""

    key: Annotated[str, Text()] = meaning(..., "dotted key of the deck, such as load.1.normal_load")
    name: Annotated[str, VariableName()] | None = meaning(
        None, "what the result calls it; the key with _ for . if absent", '"load"'
    )
    values: Annotated[tuple[Any, ...], Several(Anything(), "values", '["1 N", "2 N"]')] | None = meaning(
        None, "the values"
    )
    range: Annotated[tuple[Any, ...], Several(Anything(), "bounds", '["1 N", "5 N"]', count=2)] | None = (
        meaning(None, "first and last value, instead of `values`")
    )
    count: Annotated[int, Whole(2, MOST_CASES)] | None = meaning(
        None, "number of values in `range` (grid, zip)"
    )
    scale: Annotated[str, Word(("linear", "log"))] = meaning(
        "linear", "log: values in `range` in equal ratios"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Values or a range, never both."""
        if data.get("key") == "":
            yield "key", "expected a dotted key of the deck, such as load.1.normal_load"
        if data.get("values") is None and data.get("range") is None:
            yield "values", "missing; expected values or range"
        if "values" in data:
            for key in ("range", "count", "scale"):
                if key in data:
                    yield key, f"expected values or {key}, not both"

    @property
    def label(self) -> str:
        """What the result calls the parameter."""
        return self.name or self.key.replace(".", "_")


class _Study(Table):
    """All of a study file but where its cases are run."""

    title: Annotated[str, Text()] = meaning("", "a line about the study")
    deck: Annotated[str, Text()] = meaning(..., "the base deck; a relative name starts at the study file")
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
        None, "netCDF file of the result; the name of the study file with .nc if absent"
    )
    parameter: list[Parameter] = Field(min_length=1)

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Each way to combine has its own keys."""
        combine = data.get("combine", "grid")
        if combine == "lhs" and "samples" not in data:
            yield "samples", "missing; a Latin hypercube needs the number of its cases"
        if combine != "lhs":
            for key in ("samples", "seed"):
                if key in data:
                    yield key, 'belongs to combine = "lhs"'
        listed = data.get("parameter")
        entries = (
            [entry for entry in listed if isinstance(entry, Mapping)] if isinstance(listed, list) else []
        )
        for number, entry in enumerate(entries, start=1):
            if combine == "lhs" and "count" in entry:
                yield f"parameter.{number}.count", "a Latin hypercube takes the number of its cases, samples"
            if combine != "lhs" and "range" in entry and "count" not in entry:
                yield f"parameter.{number}.count", "missing; expected the number of values in range"
            if any(entry.get("key") == other.get("key") for other in entries[: number - 1]):
                yield f"parameter.{number}.key", "expected each key only once"
        if combine == "zip":
            lengths = [
                entry.get("count", 0) if "range" in entry else _length(entry.get("values"))
                for entry in entries
            ]
            if len(set(lengths)) > 1:
                yield (
                    "parameter",
                    f"zip needs as many values of each; they have {', '.join(map(str, lengths))}",
                )


_Extended: Any = extended(_Study, KEYS)


class StudyFile(_Extended):
    """A whole study file."""


def _length(values: object) -> int:
    return len(values) if isinstance(values, list | tuple) else 0
