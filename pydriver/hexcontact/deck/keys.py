"""The deck: the input format as pydantic models, which are the settings that a solver reads.

A `Deck` holds the values of the file in SI, with every table checked on its own. `hexcontact.problem` checks
the tables together (load history, size of the window, limits of this version).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field, TypeAdapter, ValidationError, field_validator

from ..text import listed
from ..variables import BULK_STRESS, CREEPAGES, FIELDS, LOADS, ROLLED
from . import measured, rough  # noqa: F401 (their shapes)
from .below import Fatigue, Stress
from .faults import Mistake
from .interface import Friction, Interface
from .kinds import (
    MOST_SLENDER,
    FileName,
    Flag,
    OrShare,
    Quantity,
    Schema,
    Several,
    Share,
    Spacing,
    Text,
    Whole,
    Word,
    WordOr,
)
from .separation import Separation
from .series import COLUMNS, CONTROLS, MEANS, MOST_STEPS, Series
from .surfaces import Flat, Point, Surface, SurfaceKind
from .table_base import Conflicts, Table, extended, meaning, not_both, problems_of, refused
from .units import ANGLE, LENGTH, NUMBER, PRESSURE, SPIN, Dimension

ALGORITHMS = ("frictionless", "static", "incremental")
METHODS = ("auto", "direct", "fft")
ITERATIONS = ("newton", "dissertation")
FINENESS = ("spacing", "nodes_across", "nodes_in_radius")
_ONE_OF = listed(FINENESS, "and")
BOUNDARIES = ("free", "periodic")
LATTICES = ("equilateral", "rectangular")
AUTO_SPACINGS = 20.0  # in the contact radius, where the spacing is "auto"

YoungModulus = Annotated[float, Quantity(PRESSURE, above=0)]
PoissonRatio = Annotated[float, Quantity(NUMBER, above=-1, at_most=0.5)]


class Coating(Table):
    """A layer on a body, bonded to the layer or body below."""

    thickness: Annotated[float, Quantity(LENGTH, above=0)] = meaning(..., "thickness t", '"3 um"')
    young_modulus: YoungModulus = meaning(..., "Young's modulus E")
    poisson_ratio: PoissonRatio = meaning(..., "Poisson's ratio ν; below 0.5 in one of several coatings")


class Body(Table):
    """One of the two bodies: elastic, or rigid."""

    schema_if_whole: ClassVar[Schema] = {
        "if": {"properties": {"rigid": {"const": True}}, "required": ["rigid"]},
        "then": {"not": {"anyOf": [{"required": ["young_modulus"]}, {"required": ["poisson_ratio"]}]}},
        "else": {"required": ["young_modulus", "poisson_ratio"]},
    }

    young_modulus: YoungModulus | None = meaning(None, "Young's modulus E; required unless rigid")
    poisson_ratio: PoissonRatio | None = meaning(None, "Poisson's ratio ν; required unless rigid")
    rigid: Annotated[bool, Flag()] = meaning(False, "a body that does not deform")
    surface: Annotated[Surface, SurfaceKind()] | None = meaning(
        None, "the shape of its surface; flat if absent"
    )
    coating: list[Coating] = Field(
        default_factory=list,
        description="layers, outermost first",
        examples=['[{ thickness = "3 um", young_modulus = "450 GPa", poisson_ratio = 0.25 }]'],
    )

    @property
    def compliance(self) -> float:
        """(1 - ν²)/E (1/Pa) below the coatings, of a rigid body that of its outermost coating or 0."""
        of = self if self.young_modulus is not None or not self.coating else self.coating[0]
        if of.young_modulus is None or of.poisson_ratio is None:
            return 0.0
        return (1.0 - of.poisson_ratio**2) / of.young_modulus

    @field_validator("surface")
    @classmethod
    def _curved(cls, surface: Surface | None) -> Surface | None:
        """Return None for a flat surface."""
        return None if surface and surface.flat else surface

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require moduli of an elastic body, and refuse those of a rigid one."""
        moduli = {"young_modulus": 'a pressure such as "210 GPa"', "poisson_ratio": "a number such as 0.3"}
        if data.get("rigid") is True:
            yield from refused(data, moduli, "expected nothing, since the body is rigid")
            return
        for key, words in moduli.items():
            if key not in data:
                yield key, f"missing; expected {words}, or rigid = true"


class Bodies(Table):
    """The two bodies: body 1 fills z > 0, body 2 fills z < 0."""

    body_1: Body = Field(alias="1")
    body_2: Body = Field(alias="2")

    @functools.cached_property
    def separation(self) -> Separation:
        """Initial gap between the two surfaces."""
        one, two = self.body_1, self.body_2
        modulus = 1.0 / (one.compliance + two.compliance)
        surfaces = one.surface or Flat(), two.surface or Flat()
        return Separation(surfaces[0].beside(modulus), surfaces[1].beside(modulus))

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require at least one elastic body, or a coating."""
        bodies = [one for key in "12" if isinstance(one := data.get(key), Mapping)]
        bare = [one for one in bodies if one.get("rigid") is True and not one.get("coating")]
        if len(bare) == 2:
            yield "2", "expected one elastic body at least; both are rigid, without a coating"


BULK_STATES = ("plane stress", "plane strain x", "plane strain y")


class Bulk(Table):
    """The body that carries a bulk stress, given by `bulk_stress_xx` and so on of [[load]]."""

    body: Annotated[int, Whole(1, 2)] = meaning(..., "1 or 2", "1")
    state: Annotated[str, Word(BULK_STATES)] = meaning(
        "plane stress",
        "plane stress: sides are free, and components that are not given are zero; plane strain x, y: no "
        "strain along x, y, and the stress along it is ν times the other one",
    )

    @property
    def components(self) -> tuple[str, ...]:
        """Keys of [[load]] for its stress, without the direction of no strain."""
        axis = self.state.removeprefix("plane strain ")
        return tuple(name for name in BULK_STRESS if not name.endswith(2 * axis))


class Grid(Table):
    """The lattice and the window of it in which contact is looked for."""

    schema_if_whole: ClassVar[Schema] = {"oneOf": [{"required": [name]} for name in FINENESS]}

    lattice: Annotated[str, Word(LATTICES)] | None = meaning(
        None,
        "rectangular: cells with a right angle, as slender as the estimated contact with `nodes_in_radius`; "
        "equilateral if absent, unless `cell_angle` is given",
    )
    spacing: Annotated[float | tuple[float, float] | str, Spacing()] | None = meaning(
        None,
        "distance l_e between neighboring nodes, or the distances along both basis vectors; auto: 20 in the "
        "estimated contact radius",
        '"5 um"',
    )
    nodes_across: Annotated[int, Whole(5, 100_000)] | None = meaning(
        None, "nodes per side of the window, instead of the spacing", "41"
    )
    nodes_in_radius: Annotated[float, Quantity(NUMBER, at_least=1, at_most=100_000)] | None = meaning(
        None, "spacings in the estimated contact radius √(area/π), instead of the spacing", "40"
    )
    extent: Annotated[
        str | tuple[float, float],
        WordOr("auto", Several(Quantity(LENGTH, above=0), "lengths", '["2 mm", "2 mm"]', count=2)),
    ] = meaning("auto", "size of the rectangle about `center` that the window covers; auto: from the contact")
    window: (
        Annotated[tuple[int, int], Several(Whole(1, 100_000), "whole numbers", "[41, 41]", count=2)] | None
    ) = meaning(None, "nodes of the window about `center`, [n_row, n_col], instead of `extent`")
    center: Point | None = meaning(None, "middle of the window; where the bodies touch first if absent")
    origin: Point = meaning((0.0, 0.0), "a point of the plane that is a node")
    cell_ratio: Annotated[float, Quantity(NUMBER, at_least=1.0 / MOST_SLENDER, at_most=MOST_SLENDER)] = (
        meaning(1.0, "distance of nodes along the second basis vector of the lattice over the spacing", "0.5")
    )
    cell_angle: Annotated[float, Quantity(ANGLE, at_least=0.5, at_most=2.5)] | None = meaning(
        None,
        "angle of the second basis vector from the first; if absent 60 deg, the equilateral lattice, and "
        "90 deg where the window repeats",
        '"90 deg"',
    )
    boundary: Annotated[str, Word(BOUNDARIES)] = meaning(
        "free",
        "free: nothing acts beyond the window; periodic: the window repeats along both basis vectors, and "
        "`extent` has the lengths of the period",
    )

    direction: Annotated[float, Quantity(ANGLE, at_least=-math.pi, at_most=math.pi)] | None = meaning(
        None,
        "angle of the first basis vector from x; if absent that of the estimated contact on a rectangular "
        "lattice with `nodes_in_radius`, else 0",
        '"30 deg"',
    )

    def written(self, defaults: bool = True) -> dict[str, Any]:
        """Return the keys without the ratio of cells that follow from others."""
        keys = super().written(defaults)
        follows = self.lattice is not None or isinstance(self.spacing, tuple)
        return {key: value for key, value in keys.items() if key != "cell_ratio" or not follows}

    @functools.cached_property
    def length(self) -> float | None:
        """Spacing (m) along the first basis vector, if it is given."""
        spacing = self.spacing[0] if isinstance(self.spacing, tuple) else self.spacing
        return None if isinstance(spacing, str) else spacing

    @functools.cached_property
    def in_radius(self) -> float | None:
        """Spacings in the contact radius, if they are given."""
        return AUTO_SPACINGS if self.spacing == "auto" else self.nodes_in_radius

    @functools.cached_property
    def ratio(self) -> float:
        """Spacing along the second basis vector over that along the first."""
        return self.spacing[1] / self.spacing[0] if isinstance(self.spacing, tuple) else self.cell_ratio

    @functools.cached_property
    def fits(self) -> bool:
        """Whether the cells follow from the shape of the contact."""
        return self.lattice == "rectangular" and self.in_radius is not None

    @functools.cached_property
    def periodic(self) -> bool:
        """Whether the window repeats."""
        return self.boundary == "periodic"

    @functools.cached_property
    def angle(self) -> float:
        """Angle of the second basis vector (rad)."""
        right = self.lattice == "rectangular" or (self.periodic and self.lattice is None)
        return self.cell_angle or (math.pi / 2 if right else math.pi / 3)

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require one key for the spacing, and at most one for the size."""
        fineness = [key for key in FINENESS if key in data]
        if not fineness:
            yield "spacing", f"missing; expected one of {_ONE_OF}"
        for key in fineness[1:]:
            yield key, f"expected only one of {_ONE_OF}; {fineness[0]} is given too"
        if "window" in data and data.get("extent", "auto") != "auto":
            yield "window", "expected window or extent, not both"
        if "window" in data and "nodes_across" in data:
            yield "window", "expected window or nodes_across, not both"
        if data.get("lattice"):
            yield from refused(data, ("cell_angle", "cell_ratio"), "expected lattice or cells, not both")
        two = isinstance(data.get("spacing"), list | tuple)
        if two and "cell_ratio" in data:
            yield "cell_ratio", "expected two spacings or cell_ratio, not both"
        usual = "rectangular" if data.get("boundary") == "periodic" else "equilateral"
        if two and data.get("lattice", usual) == "equilateral" and "cell_angle" not in data:
            yield "spacing", 'expected one length on an equilateral lattice; or lattice = "rectangular"'
        if data.get("boundary") == "periodic":
            if data.get("spacing") == "auto":
                yield "spacing", "expected a length, since the window repeats"
            if "nodes_in_radius" in data:
                yield "nodes_in_radius", "expected spacing or nodes_across, since the window repeats"
            if data.get("extent", "auto") == "auto" and "window" not in data:
                yield "extent", 'expected the lengths of the period, such as ["1 mm", "1 mm"]'


class Solver(Table):
    """How the contact problem is solved."""

    algorithm: Annotated[str, Word(ALGORITHMS)] | None = meaning(
        None, "incremental where there is friction, else frictionless"
    )
    method: Annotated[str, Word(METHODS)] = meaning(
        "auto",
        "direct: LAPACK on the matrix of the contact; fft: matrix-free; "
        "auto: fft, but direct on a small window without friction",
    )
    iteration: Annotated[str, Word(ITERATIONS)] = meaning(
        "newton",
        'of method = "direct" with friction; dissertation: as it is written there, which mostly '
        "misses the tolerance (for comparison)",
    )
    tolerance: Annotated[float, Quantity(NUMBER, at_least=1e-14, at_most=0.1)] = meaning(
        1e-8, "bound on every residual at the end of every load step", "1e-10"
    )
    coupling: Annotated[str, Word(("full", "goodman"))] = meaning(
        "full", "goodman: shear does not move the pressure (for comparison)"
    )
    entry: Annotated[str, Word(("implicit", "interpolated"))] = meaning(
        "implicit",
        "incremental, nodes that come into contact: implicit: their slip counts from the beginning of "
        "the load step; interpolated: from the moment their gap closed",
    )
    step_tolerance: Annotated[float, Quantity(NUMBER, at_least=1e-4, at_most=0.5)] = meaning(
        0.01,
        'incremental, steps = "auto": largest change by halving a load step, in the stick area as a share '
        "of the largest contact area and in the shear tractions as a share of what friction can carry; "
        "and share of the dissipated energy that a load that turns leaves uncertain",
        "0.02",
    )


def _unlike_fractions(values: Sequence[float]) -> str:
    """Return the fault of numbers that do not rise to 1."""
    rise = values[-1] == 1.0 and all(a < b for a, b in pairwise(values))
    return "" if rise else f"expected {_FRACTIONS.expected}"


_FRACTIONS = Several(
    *(Quantity(NUMBER, above=0, at_most=1), "fractions", "[0.1, 0.4, 1]"),
    fault_of=_unlike_fractions,
    unique=True,
    words="fractions of the segment, rising to 1,",
)
_SHARED = ("tangential_load_x", "tangential_load_y", "mean_traction_x", "mean_traction_y")
_KINDS: dict[str, Any] = {
    name: OrShare(load.kind) if name in _SHARED else load.kind for name, load in COLUMNS.items()
}
_Driven: Any = extended(
    Table,
    {
        name: (Annotated[float | Share, _KINDS[name]] | None, meaning(None, load.meaning, load.example))
        for name, load in COLUMNS.items()
    },
)


_ROLLING = ("rolling", *CREEPAGES)


def _rolling_conflicts(data: Mapping[str, Any]) -> Conflicts:
    """Refuse creepages beside their loads and without rolling, and keys that mean nothing beside rolling."""
    if "rolling" not in data:
        needed = 'needs rolling beside it: "steady", or a distance'
        yield from refused(data, ("rolling_direction", *CREEPAGES), needed)
        return
    for force, motion in ROLLED.values():
        if motion in CREEPAGES:
            yield from not_both(data, force, motion)
    ramp = ("ramp",) * (data.get("ramp") != "linear")
    unrolled = "shift_x", "shift_y", "twist", *ramp, *BULK_STRESS, *MEANS
    sentence = "expected nothing beside rolling, which takes creepages, spin or loads"
    yield from refused(data, unrolled, sentence)
    if data["rolling"] != "steady":
        sentence = "expected nothing beside a rolled distance, which takes a step for each spacing"
        yield from refused(data, ("steps", "values"), sentence)
    elif data.get("steps") == "auto":
        yield "steps", "expected a number beside rolling"


class Segment(_Driven):
    """A segment of the load history: every load ramps from its current value to the one given here."""

    schema_of_all: ClassVar[Schema] = {
        "allOf": [
            {"not": {"required": list(pair)}} for pair in dict.fromkeys((*LOADS.values(), *ROLLED.values()))
        ]
    }

    steps: Annotated[int | str, WordOr("auto", Whole(1, MOST_STEPS))] | None = meaning(
        None,
        "number of load steps; auto: chosen by `solver.step_tolerance`; "
        "by default 1, or the number of `values`",
    )
    largest_step: Annotated[float, Quantity(NUMBER, above=0, at_most=1)] | None = meaning(
        None, 'largest part of the segment in one load step of steps = "auto"; 1 if absent', "0.1"
    )
    ramp: Annotated[str, Word(("linear", "cubic"))] = meaning(
        "linear", "cubic: the cube root of normal_load grows evenly, all else linearly"
    )
    values: Annotated[tuple[float, ...], _FRACTIONS] | None = meaning(
        None, "fraction of the segment done at the end of each step, instead of `ramp`"
    )
    label: Annotated[str, Text()] = meaning("", "name of the segment in the result", '"press"')
    rolling: Annotated[float | str, WordOr("steady", Quantity(LENGTH, above=0))] | None = meaning(
        None,
        "the bodies roll: steady state, or the distance that they roll from the state before",
        '"steady"',
    )
    rolling_direction: Annotated[float, Quantity(ANGLE, at_least=-math.pi, at_most=math.pi)] | None = meaning(
        None, "angle from x of the direction that the contact travels in, a row of the lattice; 0 if absent"
    )
    creepage_x: Annotated[float, Quantity(NUMBER)] | None = meaning(
        None, "velocity of body 1 less that of body 2 along x over the rolling velocity", "-0.001"
    )
    creepage_y: Annotated[float, Quantity(NUMBER)] | None = meaning(
        None, "the same along y; creepages and spin that are not named are 0, or those before", "0.001"
    )
    spin: Annotated[float, Quantity(SPIN)] | None = meaning(
        None, "angular velocity of body 1 less that of body 2 about z over the rolling velocity"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require one control of each motion, and one kind of ramp."""
        whole = "path" in data or "series" in data
        known = cls.known_keys()
        # an unknown key may be that of the load
        if not whole and not any(
            key in COLUMNS or key in _ROLLING or (key not in known and not cls.meant(key)) for key in data
        ):
            yield "", "expected at least one of normal_load, tangential_load_x, ... or approach, shift_x, ..."
        for names in CONTROLS:
            yield from not_both(data, *names)
        yield from _rolling_conflicts(data)
        if data.get("ramp") == "cubic" and not {"normal_load", "mean_pressure"} & data.keys():
            yield "ramp", "a cubic ramp needs normal_load in the same segment"
        if "values" in data and data.get("ramp", "linear") != "linear":
            yield "ramp", "expected ramp or values, not both"
        values, steps = data.get("values"), data.get("steps")
        if "largest_step" in data and steps != "auto":
            yield "largest_step", 'needs steps = "auto" beside it'
        if isinstance(values, list | tuple) and steps is not None and steps != len(values):
            yield "steps", f"expected {len(values)}, as many as there are values (or no steps at all)"

    def written(self, defaults: bool = True) -> dict[str, Any]:
        """Return the keys without a ramp beside values."""
        keys = super().written(defaults)
        return {key: value for key, value in keys.items() if key != "ramp" or "values" not in keys}


_BESIDE = {"path": ("label",), "series": ("label", "steps", "largest_step")}  # keys of segments beside them


class Load(Segment):
    """An entry of [[load]]: a segment, or a path or series of segments that may be repeated."""

    repeat: Annotated[int, Whole(1, MOST_STEPS)] | None = meaning(
        None, "how often `path` or `series` is run; 1 if absent"
    )
    path: list[Segment] | None = Field(
        None,
        min_length=1,
        description="segments to run in turn",
        examples=['[{ normal_load = "4 N" }, { normal_load = "9 N" }]'],
    )
    series: Series | None = meaning(
        None,
        "rows of a file or of arrays to run in turn, each reached in `steps` increments",
        '{ file = "history.csv" }',
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Refuse keys of a segment beside a path or a series."""
        yield from super().conflicts(data)
        if {"path", "series"} <= data.keys():
            yield from not_both(data, "path", "series")
        elif whole := next((key for key in _BESIDE if key in data), ""):
            inner = (key for key in Segment.known_keys() if key not in _BESIDE[whole])
            yield from refused(data, inner, f"expected in the {whole}, not beside it")
        elif "repeat" in data:
            yield "repeat", "needs a path of segments or a series to repeat"

    def written(self, defaults: bool = True) -> dict[str, Any]:
        """Return the keys without those that a path or a series excludes."""
        whole = "path" if self.path else "series" if self.series else ""
        excluded = Segment.known_keys().keys() - set(_BESIDE[whole]) if whole else ()
        return {key: value for key, value in super().written(defaults).items() if key not in excluded}


WEAR_COEFFICIENT = Dimension("a coefficient of wear", "m^2/N", '"1e-15 m^2/N"')
_SOLVED = 0.01  # residuals of a cycle over the tolerance of the depth: measured in docs/theory/wear.md
_WearCoefficient = Annotated[float, Quantity(WEAR_COEFFICIENT, at_least=0, at_most=1)]


class Wear(Table):
    """Wear by Archard's law: each solved cycle represents `jump` cycles."""

    coefficient_1: _WearCoefficient = meaning(0.0, "coefficient of wear of body 1: depth over p times slip")
    coefficient_2: _WearCoefficient = meaning(0.0, "coefficient of wear of body 2")
    cycle: Annotated[str, Text()] = meaning(
        ..., "label of the segments at the end of [[load]] that are one cycle", '"fretting"'
    )
    cycles: Annotated[int, Whole(1, 10**12)] = meaning(
        ..., "number of cycles that wear the surfaces", "10000"
    )
    jump: Annotated[int | str, WordOr("auto", Whole(1, 10**12))] = meaning(
        "auto", "number of cycles for each solved cycle; auto: chosen by `tolerance`", "50"
    )
    tolerance: Annotated[float, Quantity(NUMBER, at_least=1e-4, at_most=1)] = meaning(
        0.03,
        'jump = "auto": change of the worn depth by halving a jump, root mean square over the nodes that '
        "wear, as a share of the depth by which the largest pressure indents the surface at one node",
        "0.01",
    )

    @property
    def coefficient(self) -> float:
        """Coefficient of wear of both bodies together (m2/N)."""
        return self.coefficient_1 + self.coefficient_2

    def cycle_tolerance(self, tolerance: float) -> float:
        """Return the bound of the residuals in a cycle, where that of load steps is `tolerance`."""
        return max(tolerance, _SOLVED * self.tolerance)

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require a body that wears, and refuse a tolerance with a given jump."""
        if not any(data.get(f"coefficient_{number}") for number in (1, 2)):
            yield "coefficient_1", "expected a coefficient above 0 of one body at least"
        if "tolerance" in data and data.get("jump", "auto") != "auto":
            yield "tolerance", 'expected nothing, or jump = "auto"'


class Accuracy(Table):
    """The target of the accuracy; the grid is then that of the first, coarsest lattice."""

    target: Annotated[float, Quantity(NUMBER, at_least=1e-6, at_most=0.5)] = meaning(
        ...,
        "the lattice is refined until the estimated errors of max_pressure, contact_area_fit, "
        "stick_area_fit and approach are at most this share of the largest value of each",
        "0.01",
    )
    max_nodes: Annotated[int, Whole(100, 1_000_000_000)] = meaning(
        500_000, "nodes of the finest window at most", "100_000"
    )


class Output(Table):
    """The output file and its fields."""

    file: Annotated[Path, FileName()] | None = meaning(None, "netCDF file of the result", '"fretting.nc"')
    fields: Annotated[
        tuple[str, ...], Several(Word(FIELDS), "field names", '["pressure", "gap", "zone"]')
    ] = meaning((), "fields to keep; all but the displacements of the bodies if absent")
    every: Annotated[int, Whole(1)] = meaning(
        1, "keep the fields of every n-th step (the history always holds all steps)"
    )


class Deck(Table):
    """A whole deck."""

    title: Annotated[str, Text()] = meaning("", "a line about the case", '"Sphere on flat"')
    include: Annotated[tuple[str, ...], Several(Text(), "file names", '["materials.toml"]')] | None = meaning(
        None, "decks, or parts of decks, for the keys that are absent here"
    )
    body: Bodies
    interface: Interface | None = None
    friction: Friction | None = None
    bulk: Bulk | None = None
    grid: Grid
    solver: Solver = Field(default_factory=Solver)
    accuracy: Accuracy | None = None
    load: list[Load] = Field(min_length=1)
    wear: Wear | None = None
    output: Output = Field(default_factory=Output)
    stress: list[Stress] = Field(default_factory=list)
    fatigue: list[Fatigue] = Field(default_factory=list)

    @classmethod
    def checked(cls, data: Mapping[str, Any]) -> tuple[dict[str, Any], list[Mistake]]:
        """Return the valid tables of a deck and its mistakes."""
        tables: dict[str, Any] = {}
        info: Any
        for name, info in cls.model_fields.items():
            if name not in data and not info.is_required():
                # `get_default` of pydantic takes longer
                tables[name] = info.default if info.default_factory is None else info.default_factory()
            elif name in data:
                # Each table alone: pydantic need not build the models of tables that the deck does not have.
                with suppress(ValidationError):
                    tables[name] = _reader(name)(data[name])
        if tables.keys() == cls.model_fields.keys() >= data.keys():
            return tables, []
        try:
            cls.model_validate(data)
        except ValidationError as error:
            return tables, problems_of(error)
        return tables, []


@functools.cache
def _reader(name: str) -> Callable[[Any], Any]:
    """Return the function that checks one table of a deck."""
    info = Deck.model_fields[name]
    whole: Any = Annotated[info.annotation, info]
    return TypeAdapter(whole).validate_python
