"""The study file: which deck, which of its keys vary, how they are combined. Checked as decks are."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from ..deck.kinds import Kind, Several, Text, Whole, Word, refuse
from ..deck.model import Table, refuse_key

MOST_CASES = 100_000


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


@dataclass(frozen=True)
class Settings(Kind):
    """A table whose keys belong to another program."""

    example: str

    def _expected(self) -> str:
        return f"a table such as {self.example}"

    def _parse(self, value: object) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            refuse(f"expected {self.expected}")
        return dict(value)


_BATCH_OPTION = re.compile(r"[a-z][a-z0-9_-]*")


def batch_text(value: str) -> str | None:
    """Return text as it stands in a line of options of sbatch, quoted where needed; None if it cannot."""
    if not value or not value.isprintable() or '"' in value or "\\" in value:
        return None
    return f'"{value}"' if re.search(r"[\s'#]", value) else value


@dataclass(frozen=True)
class BatchOptions(Settings):
    """Options of sbatch, which become lines of a script."""

    def _parse(self, value: object) -> dict[str, Any]:
        options = super()._parse(value)
        for key, entry in options.items():
            if not _BATCH_OPTION.fullmatch(str(key)) or key == "array":
                refuse_key(str(key), entry, "expected an option of sbatch other than array, such as time")
            if isinstance(entry, str) and batch_text(entry) is None:
                refuse_key(key, entry, 'expected text on one line, without " and \\')
            if not isinstance(entry, str | int | float | datetime.time):
                refuse_key(key, entry, "expected text, a number, or true or false")
        return options


class Parameter(Table):
    """An entry of [[parameter]]: a key of the deck and the values it takes."""

    key: Annotated[str, Text()] = Field(description="dotted key of the deck, such as load.1.normal_load")
    name: Annotated[str, VariableName()] | None = Field(
        None,
        description="what the result calls it; the key with _ for . if absent",
        examples=['"load"'],
    )
    values: Annotated[tuple[Any, ...], Several(Anything(), "values", '["1 N", "2 N"]')] | None = Field(
        None, description="the values"
    )
    range: Annotated[tuple[Any, ...], Several(Anything(), "bounds", '["1 N", "5 N"]', count=2)] | None = (
        Field(None, description="first and last value, instead of `values`")
    )
    count: Annotated[int, Whole(2, MOST_CASES)] | None = Field(
        None, description="number of values in `range` (grid, zip)"
    )
    scale: Annotated[str, Word(("linear", "log"))] = Field(
        "linear", description="log: values in `range` in equal ratios"
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


class Dask(Table):
    """Where a Dask cluster is, or how to start one."""

    address: Annotated[str, Text()] | None = Field(None, description="scheduler, such as tcp://host:8786")
    cluster: (
        Annotated[str, Word(("local", "slurm", "pbs", "sge", "lsf", "htcondor", "oar", "moab"))] | None
    ) = Field(None, description="start a cluster: local, or one of those of dask-jobqueue")
    workers: Annotated[int, Whole(1, MOST_CASES)] = Field(1, description="workers that `cluster` starts")
    options: Annotated[dict[str, Any], Settings("{ cores = 4 }")] = Field(
        default_factory=dict, description="arguments of the cluster, such as cores, memory, walltime"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Join a cluster or start one."""
        if ("address" in data) == ("cluster" in data):
            yield "address", "expected either address or cluster"


class StudyFile(Table):
    """A whole study file."""

    title: Annotated[str, Text()] = Field("", description="a line about the study")
    deck: Annotated[str, Text()] = Field(
        description="the base deck; a relative name starts at the study file"
    )
    combine: Annotated[str, Word(("grid", "zip", "lhs"))] = Field(
        "grid",
        description="grid: every value with every other; zip: first with first, second with second; "
        "lhs: Latin hypercube",
    )
    samples: Annotated[int, Whole(1, MOST_CASES)] | None = Field(None, description="number of cases (lhs)")
    seed: Annotated[int, Whole(0)] = Field(0, description="seed of the Latin hypercube")
    steps: Annotated[str, Word(("last", "all"))] = Field(
        "last", description="load steps whose history the result holds"
    )
    output: Annotated[str, Text()] | None = Field(
        None, description="netCDF file of the result; the name of the study file with .nc if absent"
    )
    parameter: list[Parameter] = Field(min_length=1)
    dask: Dask | None = None
    slurm: Annotated[dict[str, Any], BatchOptions('{ time = "1:00:00" }')] = Field(
        default_factory=dict, description="options of sbatch for --slurm, such as time and cpus-per-task"
    )

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


def _length(values: object) -> int:
    return len(values) if isinstance(values, list | tuple) else 0
