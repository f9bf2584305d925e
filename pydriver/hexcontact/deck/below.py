"""The tables [[stress]] and [[fatigue]] of a deck: quantities at and below the surface, and their regions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

from ..text import did_you_mean, listed
from ..variables import STRESSES
from .kinds import Flag, Quantity, Schema, Several, Text, Whole, Word, WordOr
from .table_base import Conflicts, Table, meaning
from .units import LENGTH, NUMBER, PRESSURE


def _degenerate(points: Sequence[Sequence[float]]) -> str:
    """Return the fault of the ends of a line, or of three corners of a parallelogram."""
    one, two = ([b - a for a, b in zip(points[0], point, strict=True)] for point in (points[1], points[-1]))
    if len(points) == 2:
        return "" if any(one) else "expected two different points"
    on_a_line = all(one[i - 1] * two[i] == one[i] * two[i - 1] for i in range(3))
    return "expected three points that are not on one line" * on_a_line


_ABOVE = "expected a point of the body: a depth of at least 0, whichever body it is"
_POINT = Several(
    *(Quantity(LENGTH), "lengths x, y and depth", '["0 mm", "0 mm", "20 um"]', 3),
    fault_of=lambda point: _ABOVE * (point[2] < 0.0),
)
_SIDE = Several(
    *(Quantity(LENGTH), "lengths", "[-1e-3, 1e-3]", 2),
    fault_of=lambda side: "expected the smaller coordinate first" * (side[0] >= side[1]),
)
_ENDS = '[["0 mm", "0 mm", "0 um"], ["0 mm", "0 mm", "2 mm"]]'
_CORNERS = "[[-1e-3, 0, 0], [1e-3, 0, 0], [-1e-3, 0, 1e-3]]"
_Points = Annotated[tuple[Any, ...], Several(_POINT, "points", '[["0 mm", "0 mm", "20 um"]]')]
_Line = Annotated[tuple[Any, ...], Several(_POINT, "points", _ENDS, 2, _degenerate)]
_Plane = Annotated[tuple[Any, ...], Several(_POINT, "points", _CORNERS, 3, _degenerate)]
_DEPTHS = Several(Quantity(LENGTH, at_least=0), "depths", '["10 um", "20 um", "50 um"]')
_BOX = Several(_SIDE, "pairs of lengths", '[["-1 mm", "1 mm"], ["-1 mm", "1 mm"]]', 2)
_Count = Annotated[tuple[int, ...], Several(Whole(2, 100_000), "whole numbers", "[81, 41]")]

SOURCES = ("edges", "nodes")
"""Tractions for the stress: corrected at the edges, or those of the nodes."""
REGIONS = ("points", "line", "plane", "depths")


class Below(Table):
    """Quantities of a body, computed from the finished result, and their region."""

    default_region: ClassVar[dict[str, Any]] = {}

    name: Annotated[str, Text()] = meaning(
        "", "name of the file beside the output; stress_1, fatigue_1, ... if absent", '"section"'
    )
    body: Annotated[int, Whole(1, 2)] = meaning(1, "body they are in", "2")
    points: _Points | None = meaning(None, "single points: x, y, depth below the surface")
    line: _Line | None = meaning(None, "the ends of a line")
    plane: _Plane | None = meaning(
        None, "a corner of a parallelogram of any orientation, and the two corners next to it"
    )
    depths: Annotated[tuple[float, ...], _DEPTHS] | None = meaning(
        None, "depths of planes below the nodes of the window: a box"
    )
    box: Annotated[tuple[Any, ...], _BOX] | None = meaning(
        None, "with `depths`: smallest and largest x, and y, that the nodes cover; the window if absent"
    )
    count: _Count | None = meaning(
        None, "points on the line, [101] if absent, or along the sides of the plane, [81, 81]"
    )

    estimate_error: Annotated[bool, Flag()] = meaning(
        False,
        "solve lattices of twice the spacing, too, and give largest values an estimated error; "
        "always with [accuracy]",
        "true",
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require one region, and only the keys that belong to it."""
        given = [key for key in REGIONS if key in data] or [*cls.default_region]
        if len(given) != 1:
            yield given[1] if given else "", f"expected one of {', '.join(REGIONS)}"
        elif "box" in data and given != ["depths"]:
            yield "box", "needs depths beside it"
        elif "count" in data:
            sides = {"line": 1, "plane": 2}.get(given[0], 0)
            if isinstance(data["count"], list | tuple) and len(data["count"]) != sides:
                words = {0: "nothing", 1: "one number", 2: "two numbers"}[sides]
                yield "count", f"expected {words} with {given[0]}"

    @property
    def where(self) -> dict[str, Any]:
        """The region as arguments of `hexcontact.interior.fields`."""
        keys = (*REGIONS, "box", "count")
        found = {key: getattr(self, key) for key in keys if getattr(self, key) is not None}
        return found if set(found) & set(REGIONS) else self.default_region | found


class Stress(Below):
    """Stresses and displacements of a body below the surface, computed from the finished result."""

    schema_of_all: ClassVar[Schema] = {"oneOf": [{"required": [name]} for name in REGIONS]}

    components: Annotated[
        tuple[str, ...], Several(Word(tuple(STRESSES)), "names", '["von_mises_stress", "stress_xx"]')
    ] = meaning((), "components to compute; by default the six stresses and the von Mises stress")
    source: Annotated[str, Word(SOURCES)] | None = meaning(
        None,
        "tractions it is computed from: edges, corrected at the edges of contact and stick; nodes, as they "
        "are at the nodes; edges if absent, where gap and zone are kept and the contact has a sharp edge",
        '"nodes"',
    )
    steps: (
        Annotated[str | tuple[int, ...], WordOr("all", Several(Whole(1), "whole numbers", "[3, 8]"))] | None
    ) = meaning(None, "numbers of load steps, or all whose fields are kept; the last one if absent")


# --- fatigue ------------------------------------------------------------------------------------------------

_NUMBER = Quantity(NUMBER, at_least=0)
_EXPONENT = Quantity(NUMBER, at_least=-10, at_most=-1e-3)
_STRESS = Quantity(PRESSURE, above=0)

NEEDS: dict[str, tuple[str, ...]] = {
    "smith_watson_topper": (),
    "life": ("strength", "strength_exponent", "ductility", "ductility_exponent"),
    "findley": ("findley_slope",),
    "fatemi_socie": ("fatemi_socie_slope", "yield_stress"),
    "crossland": ("crossland_slope",),
    "dang_van": ("dang_van_slope",),
    "ruiz": (),
}
"""Fatigue parameters, and the constants that each needs besides the moduli of the body."""


class Criteria(Table):
    """Fatigue parameters and their constants."""

    parameters: Annotated[tuple[str, ...], Several(Word(tuple(NEEDS)), "names", '["findley", "life"]')] = (
        meaning(..., "fatigue parameters; life: the cycles that the one of Smith, Watson and Topper allows")
    )
    findley_slope: Annotated[float, _NUMBER] | None = meaning(None, "k of Findley", "0.3")
    fatemi_socie_slope: Annotated[float, _NUMBER] | None = meaning(None, "k of Fatemi and Socie", "1.0")
    yield_stress: Annotated[float, _STRESS] | None = meaning(None, "yield stress of Fatemi and Socie")
    crossland_slope: Annotated[float, _NUMBER] | None = meaning(None, "α of Crossland", "0.3")
    dang_van_slope: Annotated[float, _NUMBER] | None = meaning(None, "α of Dang Van", "0.3")
    strength: Annotated[float, _STRESS] | None = meaning(None, "σ_f' of the life", '"1015 MPa"')
    strength_exponent: Annotated[float, _EXPONENT] | None = meaning(None, "b of the life", "-0.11")
    ductility: Annotated[float, _NUMBER] | None = meaning(None, "ε_f' of the life", "0.21")
    ductility_exponent: Annotated[float, _EXPONENT] | None = meaning(None, "c of the life", "-0.52")

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require the constants of the parameters."""
        wanted = data.get("parameters")
        for name in wanted if isinstance(wanted, list | tuple) else ():
            for key in NEEDS.get(name, ()) if isinstance(name, str) else ():
                if data.get(key) is None:
                    expected = cls.known_keys()[key].description
                    yield key, f"missing; expected {expected}, since parameters names {name}"
        yield from super().conflicts(data)


class Fatigue(Criteria, Below):
    """Fatigue parameters of a body over a closed cycle, computed from the finished result."""

    schema_of_all: ClassVar[Schema] = {"oneOf": [{"required": ["segment"]}, {"required": ["steps"]}]}
    default_region: ClassVar[dict[str, Any]] = {"depths": (0.0,)}

    segment: Annotated[tuple[str, ...], Several(Text(), "labels", '["pull", "push"]')] | None = meaning(
        None, "labels of the segments that make the cycle, one after the other; the last one counts"
    )
    steps: Annotated[tuple[int, ...], Several(Whole(1), "whole numbers", "[14, 15, 16]")] | None = meaning(
        None, "numbers of the load steps of the cycle, instead of `segment`"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Require the segments or the load steps of the cycle."""
        yield from super().conflicts(data)
        if ("segment" in data) == ("steps" in data):
            yield "segment", "expected either segment or steps, which define the cycle"


Stage = tuple[int, str, Mapping[str, float]]
"""Number and label of the segment of a load step, and the loads at its end."""

_CLOSED = 0.01  # largest difference of the ends of a cycle, as a share of the range of a load
_NOISE = 1e-4  # of the largest value of a load in the history


def cycle_of(stages: Sequence[Stage], labels: Sequence[str]) -> tuple[int, int]:
    """Return the indices of the first and last load step of the last closed cycle of some segments."""
    known = list(dict.fromkeys(label for _, label, _ in stages if label))
    for label in labels:
        if label not in known:
            names = listed([f'"{name}"' for name in known], "and") or "none with a label"
            hint = did_you_mean(label, known) or f"; there are {names}"
            raise ValueError(f'no segment has the label "{label}"{hint}')
    ends = [k for k in range(len(stages)) if k + 1 == len(stages) or stages[k + 1][0] != stages[k][0]]
    last = max(place for place, end in enumerate(ends) if stages[end][1] == labels[-1])
    named, seen, why = listed([f'"{label}"' for label in labels], "and"), set(), ""
    for place in range(last, -1, -1):
        label = stages[ends[place]][1]
        if label not in labels:
            break
        seen.add(label)
        first = ends[place - 1] + 1 if place else 0
        if seen >= set(labels):
            fault = _fault(stages, first, ends[last])
            if not fault:
                return first, ends[last]
            why = why or fault
    raise ValueError(f"{named}: {why or 'the segments do not follow each other'}; expected a closed cycle")


def steps_fault(stages: Sequence[Stage], numbers: Sequence[int]) -> str:
    """Return why load steps, counted from 1, are no closed cycle; empty if they are, or some are left out."""
    first, last = numbers[0] - 1, numbers[-1] - 1
    if [*numbers] != [*range(first + 1, last + 2)] or last >= len(stages):
        return ""
    fault = _fault(stages, first, last)  # from the state before them, or from the first one
    return f"{fault}; expected a closed cycle" if fault and _fault(stages, first + 1, last) else ""


def _fault(stages: Sequence[Stage], first: int, last: int) -> str:
    """Return why load steps are no closed cycle; empty if they are one, or the loads are not known."""
    end = stages[last][2]
    start, moves = (stages[first - 1][2] if first else dict.fromkeys(end, 0.0)), False
    for name in (name for name in start if name in end):
        noise = _NOISE * max(abs(loads.get(name, 0.0)) for _, _, loads in stages)
        values = [start[name], *(loads[name] for _, _, loads in stages[first : last + 1] if name in loads)]
        extent = max(values) - min(values)
        moves |= extent > noise
        if abs(end[name] - start[name]) > max(_CLOSED * extent, noise):
            return f"{name} is {start[name]:.4g} at the begin and {end[name]:.4g} at the end"
    return "" if moves or start.keys() != end.keys() else "no load changes in them"
