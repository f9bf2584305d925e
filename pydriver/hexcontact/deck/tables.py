"""The deck: the whole input format as pydantic models, and reading it from TOML.

A `Deck` is what the file says, in SI, with every table checked on its own. What needs the tables together
(the load history, the size of the window, what this version solves) is worked out by `hexcontact.case`.
"""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import Field, TypeAdapter, ValidationError

from ..errors import DeckError, Fault
from ..files import text_of
from ..variables import FIELDS
from .faults import Mistake
from .kinds import Flag, Quantity, Several, Table, Text, Whole, Word, WordOr, problems_of, refuse
from .series import LOADS, MOST_STEPS, QUANTITIES, Series
from .surfaces import Flat, Point, Surface, SurfaceKind
from .units import ANGLE, FORCE, LENGTH, NUMBER, PRESSURE, TORQUE

ALGORITHMS = ("frictionless", "static", "incremental")
METHODS = ("auto", "direct", "fft")

DEEPEST = 50  # levels of tables and arrays; no key needs more than six

YoungModulus = Annotated[float, Quantity(PRESSURE, above=0)]
PoissonRatio = Annotated[float, Quantity(NUMBER, above=-1, at_most=0.5)]
Length = Annotated[float, Quantity(LENGTH)]
PositiveLength = Annotated[float, Quantity(LENGTH, above=0)]
Force = Annotated[float, Quantity(FORCE)]
Count = Annotated[int, Whole(1)]


class Body(Table):
    """One of the two bodies: elastic, or rigid."""

    young_modulus: YoungModulus | None = Field(None, description="Young's modulus E; required unless rigid")
    poisson_ratio: PoissonRatio | None = Field(None, description="Poisson's ratio ν; required unless rigid")
    rigid: Annotated[bool, Flag()] = Field(False, description="a body that does not deform")
    surface: Annotated[Surface, SurfaceKind()] = Field(
        default_factory=Flat, description="the shape of its surface; flat if absent"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Moduli go with an elastic body and only with that."""
        for key, words in (
            ("young_modulus", 'a pressure such as "210 GPa"'),
            ("poisson_ratio", "a number such as 0.3"),
        ):
            if data.get("rigid") is True:
                if key in data:
                    yield key, "expected nothing, since the body is rigid"
            elif key not in data:
                yield key, f"missing; expected {words}, or rigid = true"


class Bodies(Table):
    """The two bodies: body 1 fills z > 0, body 2 fills z < 0."""

    body_1: Body = Field(alias="1")
    body_2: Body = Field(alias="2")

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """At least one of the two deforms."""
        if all(
            isinstance(body := data.get(key), Mapping) and body.get("rigid") is True for key in ("1", "2")
        ):
            yield "2", "expected one elastic body at least; both are rigid"


class Friction(Table):
    """Coulomb friction."""

    coefficient: Annotated[float, Quantity(NUMBER, at_least=0, infinite=True)] = Field(
        description="coefficient of friction μ; inf: no slip"
    )


class Grid(Table):
    """The lattice and the window of it in which contact is looked for."""

    spacing: PositiveLength | None = Field(
        None, description="distance l_e between neighboring nodes", examples=['"5 um"']
    )
    nodes_across: Annotated[int, Whole(5, 100_000)] | None = Field(
        None, description="nodes per side of the window, instead of the spacing", examples=["41"]
    )
    nodes_in_radius: Annotated[float, Quantity(NUMBER, at_least=1, at_most=100_000)] | None = Field(
        None,
        description="spacings in the estimated contact radius √(area/π), instead of the spacing",
        examples=["40"],
    )
    extent: Annotated[
        str | tuple[float, float],
        WordOr("auto", Several(Quantity(LENGTH, above=0), "lengths", '["2 mm", "2 mm"]', count=2)),
    ] = Field(
        "auto",
        description="size of the rectangle about `center` that the window covers; auto: from the contact",
    )
    window: (
        Annotated[tuple[int, int], Several(Whole(1, 100_000), "whole numbers", "[41, 41]", count=2)] | None
    ) = Field(None, description="nodes of the window about `center`, [n_row, n_col], instead of `extent`")
    center: Point | None = Field(
        None, description="middle of the window; where the bodies touch first if absent"
    )
    origin: Point = Field((0.0, 0.0), description="a point of the plane that is a node")

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """One way to give the spacing, at most one to give the size."""
        fineness = [key for key in ("spacing", "nodes_across", "nodes_in_radius") if key in data]
        if not fineness:
            yield "spacing", "missing; expected one of spacing, nodes_across and nodes_in_radius"
        for key in fineness[1:]:
            yield (
                key,
                f"expected only one of spacing, nodes_across and nodes_in_radius; {fineness[0]} is given too",
            )
        if "window" in data and data.get("extent", "auto") != "auto":
            yield "window", "expected window or extent, not both"
        if "window" in data and "nodes_across" in data:
            yield "window", "expected window or nodes_across, not both"


class Solver(Table):
    """How the contact problem is solved."""

    algorithm: Annotated[str, Word(ALGORITHMS)] | None = Field(
        None, description="incremental where there is friction, else frictionless"
    )
    method: Annotated[str, Word(METHODS)] = Field(
        "auto",
        description=(
            "direct: LAPACK on the matrix of the contact; fft: matrix-free; "
            "auto: fft, but direct on a small window without friction"
        ),
    )
    tolerance: Annotated[float, Quantity(NUMBER, at_least=1e-14, at_most=0.1)] = Field(
        1e-8, description="bound on every residual at the end of every load step", examples=["1e-10"]
    )
    coupling: Annotated[str, Word(("full", "goodman"))] = Field(
        "full", description="goodman: shear does not move the pressure (for comparison)"
    )
    entry: Annotated[str, Word(("implicit", "interpolated"))] = Field(
        "implicit",
        description=(
            "incremental, nodes that come into contact: implicit: their slip counts from the beginning of "
            "the load step; interpolated: from the moment their gap closed"
        ),
    )
    step_tolerance: Annotated[float, Quantity(NUMBER, at_least=1e-4, at_most=0.5)] = Field(
        0.01,
        description=(
            'incremental, steps = "auto": what halving a load step may change in the stick area, as a share '
            "of the largest contact area, and in the shear tractions, as a share of what friction can carry"
        ),
        examples=["0.02"],
    )


@dataclass(frozen=True)
class Fractions(Several):
    """Fractions of a segment, rising to 1."""

    def _expected(self) -> str:
        return f"fractions of the segment, rising to 1, such as {self.example}"

    def _parse(self, value: object) -> tuple[float, ...]:
        fractions = super()._parse(value)
        if fractions[-1] != 1.0 or any(b <= a for a, b in pairwise(fractions)):
            refuse(f"expected {self.expected}")
        return fractions


class Segment(Table):
    """A stretch of the load history: every load ramps from where it stands to the value given here."""

    normal_load: Annotated[float, QUANTITIES["normal_load"]] | None = Field(None, description="normal load P")
    tangential_load_x: Force | None = Field(None, description="tangential load on body 1 along x")
    tangential_load_y: Force | None = Field(None, description="tangential load on body 1 along y")
    torque: Annotated[float, Quantity(TORQUE)] | None = Field(
        None, description="moment about z through x = y = 0; frees the twist"
    )
    approach: Length | None = Field(
        None, description="approach of the bodies, instead of normal_load", examples=['"1 um"']
    )
    shift_x: Length | None = Field(
        None, description="tangential motion of body 2, instead of tangential_load_x", examples=['"1 um"']
    )
    shift_y: Length | None = Field(
        None, description="tangential motion of body 2, instead of tangential_load_y", examples=['"1 um"']
    )
    twist: Annotated[float, Quantity(ANGLE)] | None = Field(
        None, description="rotation about z, instead of torque"
    )
    steps: Annotated[int | str, WordOr("auto", Whole(1, MOST_STEPS))] | None = Field(
        None,
        description=(
            "number of load steps; auto: as many as `solver.step_tolerance` takes; "
            "if absent 1, or as many as there are `values`"
        ),
    )
    largest_step: Annotated[float, Quantity(NUMBER, above=0, at_most=1)] | None = Field(
        None,
        description='largest part of the segment in one load step of steps = "auto"; 1 if absent',
        examples=["0.1"],
    )
    ramp: Annotated[str, Word(("linear", "cubic"))] = Field(
        "linear", description="cubic: the cube root of normal_load grows evenly, all else linearly"
    )
    values: (
        Annotated[tuple[float, ...], Fractions(Quantity(NUMBER, above=0, at_most=1), "", "[0.1, 0.4, 1]")]
        | None
    ) = Field(None, description="fraction of the segment done at the end of each step, instead of `ramp`")
    label: Annotated[str, Text()] = Field(
        "", description="name of the segment in the result", examples=['"press"']
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Each motion has one control, each segment one kind of ramp."""
        pairs = LOADS.values()
        whole = "path" in data or "series" in data
        if not whole and not any(key in data for pair in pairs for key in pair):
            yield "", "expected at least one of normal_load, tangential_load_x, ... or approach, shift_x, ..."
        for force, displacement in pairs:
            if force in data and displacement in data:
                yield displacement, f"expected {force} or {displacement}, not both"
        if data.get("ramp") == "cubic" and "normal_load" not in data:
            yield "ramp", "a cubic ramp needs normal_load in the same segment"
        if "values" in data and data.get("ramp", "linear") != "linear":
            yield "ramp", "expected ramp or values, not both"
        values, steps = data.get("values"), data.get("steps")
        if "largest_step" in data and steps != "auto":
            yield "largest_step", 'needs steps = "auto" beside it'
        if isinstance(values, list | tuple) and steps is not None and steps != len(values):
            yield "steps", f"expected {len(values)}, as many as there are values (or no steps at all)"


class Load(Segment):
    """An entry of [[load]]: a segment, or a path of segments that is repeated."""

    repeat: Annotated[int, Whole(1, MOST_STEPS)] | None = Field(
        None, description="how often `path` or `series` is run; 1 if absent"
    )
    path: list[Segment] | None = Field(
        None,
        min_length=1,
        description="segments to run in turn",
        examples=['[{ normal_load = "4 N" }, { normal_load = "9 N" }]'],
    )
    series: Series | None = Field(
        None,
        description="rows of a file or of arrays to run in turn, each reached in `steps` increments",
        examples=['{ file = "history.csv" }'],
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Let a path or a series stand alone."""
        yield from super().conflicts(data)
        if "path" in data and "series" in data:
            yield "series", "expected path or series, not both"
        elif "path" in data:
            for key in Segment.known_keys():
                if key in data and key != "label":
                    yield key, "expected inside the path, not beside it"
        elif "series" in data:
            for key in Segment.known_keys():
                if key in data and key not in ("label", "steps", "largest_step"):
                    yield key, "expected in the series, not beside it"
        elif "repeat" in data:
            yield "repeat", "needs a path of segments or a series to repeat"


class Accuracy(Table):
    """How accurate the result is to be; the grid is that of the first, coarsest lattice then."""

    target: Annotated[float, Quantity(NUMBER, at_least=1e-6, at_most=0.5)] = Field(
        description=(
            "the lattice is refined until the estimated errors of max_pressure, contact_area_fit, "
            "stick_area_fit and approach are at most this share of the largest value of each"
        ),
        examples=["0.01"],
    )
    max_nodes: Annotated[int, Whole(100, 1_000_000_000)] = Field(
        500_000, description="nodes of the finest window at most", examples=["100_000"]
    )


class Output(Table):
    """What is written, and where."""

    file: Annotated[str, Text()] | None = Field(
        None, description="netCDF file of the result", examples=['"fretting.nc"']
    )
    fields: (
        Annotated[tuple[str, ...], Several(Word(FIELDS), "field names", '["pressure", "gap", "zone"]')] | None
    ) = Field(None, description="fields to keep; all but the displacements of the bodies if absent")
    every: Count = Field(
        1, description="keep the fields of every n-th step (the history always holds all steps)"
    )


class Deck(Table):
    """A whole deck."""

    title: Annotated[str, Text()] = Field(
        "", description="a line about the case", examples=['"Sphere on flat"']
    )
    include: Annotated[tuple[str, ...], Several(Text(), "file names", '["materials.toml"]')] | None = Field(
        None, description="decks, or parts of decks, whose keys hold where this one says nothing"
    )
    body: Bodies
    friction: Friction | None = None
    grid: Grid
    solver: Solver = Field(default_factory=Solver)
    accuracy: Accuracy | None = None
    load: list[Load] = Field(min_length=1)
    output: Output = Field(default_factory=Output)

    @classmethod
    def checked(cls, data: Mapping[str, Any]) -> tuple[dict[str, Any], list[Mistake]]:
        """Check a deck and return what is right with it, table by table, and what is wrong.

        Returns
        -------
        tables : dict
            The attributes of a deck that were read; those with mistakes, or required and absent, are missing.
        problems : list of Mistake
            Everything that is wrong with the tables one by one.
        """
        try:
            deck = cls.model_validate(data)
        except ValidationError as error:
            problems = problems_of(error)
        else:
            return {name: getattr(deck, name) for name in cls.model_fields}, []
        faulty = {problem.key[0] for problem in problems if problem.key}
        tables = {}
        for name, info in cls.model_fields.items():
            if name in data and name not in faulty:
                tables[name] = TypeAdapter(cast(Any, info.annotation)).validate_python(data[name])
            elif name not in faulty:
                tables[name] = info.get_default(call_default_factory=True)
        return tables, problems


def read_toml(path: str | Path) -> tuple[dict[str, Any], str]:
    """Read a deck file into dictionaries, without checking what it says.

    Parameters
    ----------
    path : str or Path
        A TOML file in UTF-8.

    Returns
    -------
    data : dict
        The tables.
    text : str
        The file as it is.

    Raises
    ------
    DeckError
        If there is no such file, it cannot be read, or it is not TOML.
    """
    text = text_of(path, "a deck (a TOML file)")
    return parse_toml(text, str(path)), text


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Parse TOML; `name` is what an error message calls it.

    Raises
    ------
    DeckError
        With the line and what is wrong there.
    """
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        message = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        place = re.search(r" \(at line (\d+), column (\d+)\)$", message)
        if place is None:
            raise DeckError(f"{name}: is not TOML: {message}") from None
        sentence = f"{name}:{place[1]}:{place[2]}: is not TOML: {message[: place.start()]}"
        raise DeckError(sentence, [Fault(sentence, "", "", name, int(place[1]), int(place[2]))]) from None
    refuse_deep(tables, name)
    return tables


def refuse_deep(data: Mapping[str, Any], name: str) -> None:
    """Refuse tables in tables in tables, which to copy or to show may need more stack than there is.

    Parameters
    ----------
    data : mapping
        The deck as dictionaries; may hold itself.
    name : str
        What an error message calls it; may be empty.

    Raises
    ------
    DeckError
        If there are more than `DEEPEST` levels.
    """
    level: list[Any] = [data]
    for _ in range(DEEPEST):
        entries = [e for table in level for e in (table.values() if isinstance(table, Mapping) else table)]
        level = list(
            {id(entry): entry for entry in entries if isinstance(entry, Mapping | list | tuple)}.values()
        )
        if not level:
            return
    raise DeckError(f"{name and name + ': '}nested too deeply; expected at most {DEEPEST} levels")


def with_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a deck with single keys replaced.

    Parameters
    ----------
    data : mapping
        The deck as dictionaries.
    overrides : mapping
        New values by dotted key; entries of arrays count from 1 ("load.2.steps"). None removes a key.

    Raises
    ------
    DeckError
        If a key runs through something that is no table, or an entry that is not there.
    """
    result = copy.deepcopy(dict(data))
    for dotted_key, value in overrides.items():
        *parents, last = dotted_key.split(".")
        here: Any = result
        for part in parents:
            here = here.setdefault(part, {}) if isinstance(here, dict) else _entry(here, part, dotted_key)
        if isinstance(here, dict):
            if value is None:
                here.pop(last, None)
            else:
                here[last] = value
        else:
            _entry(here, last, dotted_key)
            here[int(last) - 1] = value
    return result


def _entry(array: Any, number: str, key: str) -> Any:
    """Return the entry of an array that a dotted key speaks of."""
    if not isinstance(array, list):
        raise DeckError(f"{key}: expected a key of a table, but {number} would be inside a plain value")
    if not number.isdecimal() or not 1 <= int(number) <= len(array):
        raise DeckError(f"{key}: expected an entry from 1 to {len(array)}, not {number}")
    return array[int(number) - 1]
