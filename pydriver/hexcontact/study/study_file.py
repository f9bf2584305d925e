"""The study file: base deck, keys that vary, their combination; checked like a deck."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from ..deck.formula import Formula
from ..deck.json_schema import schema_of
from ..deck.kinds import Kind, Schema, Several, Text, Whole, Word, refuse
from ..deck.table_base import Table, extended, meaning
from . import backends  # noqa: F401 (each registers its key)
from .backend import KEYS
from .job import MOST_CASES


@dataclass(frozen=True)
class Anything(Kind):
    """A value of any kind, which is checked with the deck."""

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


@dataclass(frozen=True)
class Keys(Kind):
    """One dotted key of a deck, or several that share one value."""

    def _expected(self) -> str:
        return 'a dotted key of the deck, or an array of them, such as "load.1.normal_load"'

    def _parse(self, value: object) -> tuple[str, ...]:
        keys = tuple(value) if isinstance(value, list | tuple) else (value,)
        whole = keys and all(isinstance(key, str) and key.strip() for key in keys)
        return keys if whole else refuse(f"expected {self.expected}")

    def _schema(self) -> Schema:
        text = {"type": "string", "minLength": 1}
        return {"anyOf": [text, {"type": "array", "items": text, "minItems": 1}]}

    def written(self, value: tuple[str, ...]) -> str | list[str]:
        """Return one key as text, several as a list."""
        return value[0] if len(value) == 1 else list(value)


@dataclass(frozen=True)
class Expression(Text):
    """A formula over parameters and keys of the deck."""

    def _parse(self, value: object) -> str:
        text = super()._parse(value)
        try:
            return text if Formula(text) else ""
        except ValueError as error:
            refuse(f"expected {error}")


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
    range: Annotated[tuple[Any, ...], Several(Anything(), "bounds", '["1 N", "5 N"]', count=2)] | None = (
        meaning(None, "first and last value, instead of `values`")
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
    parameter: list[Parameter] = Field(min_length=1)

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Require the keys of the combination, and refuse those of others."""
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


def study_schema() -> Schema:
    """Return the JSON schema of study files."""
    required = [key for key, info in StudyFile.known_keys().items() if info.is_required()]
    return schema_of(StudyFile, "hexcontact study", "Many cases of one deck") | {"required": required}


def _length(values: object) -> int:
    return len(values) if isinstance(values, list | tuple) else 0
