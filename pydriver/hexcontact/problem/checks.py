"""Checks of a case that need several tables of its deck."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from ..core.lattice import Lattice
from ..deck.below import Fatigue, Stage, cycle_of, steps_fault
from ..deck.faults import MISSING, Mistake, deck_error
from ..deck.interface import TwoCoefficients, coulomb
from ..deck.keys import Deck, Load, Segment, Solver
from ..deck.measured import Measured
from ..deck.read import Assembled
from ..deck.separation import Separation, principal_curvatures
from ..deck.series import MEANS, MOST_STEPS
from ..deck.surfaces import Roller
from ..errors import DeckError
from ..text import counted, did_you_mean, listed, quantity, shown
from ..variables import BULK_STRESS, FIELDS, FRICTIONLESS_FIELDS, MOVED_GAP, WORN
from . import window
from .loads import MOTIONS, LoadStep, Period, cycle_entries, load_steps
from .plane_field import GAP, FieldSource, PlaneField
from .window import Found

_ALL_TOUCH = 1 - 1e-9  # approach over mean gap, from which no pressure belongs to it
_THINNEST = 0.1  # layer over spacing, from which the sums of a periodic window end
_ALONG = 1e-8  # sine of an angle between directions that are one
_LONGEST_NAME = 60  # bytes of the name of a table of stresses, which is part of the name of a file


def mistakes(tables: Mapping[str, Any], found: Found) -> Iterator[Mistake]:
    """Yield mistakes with the values of their keys, unless these are absent or tables."""
    for key, sentence in found:
        value: Any = tables
        for part in key:
            value = value and value[part] if isinstance(part, int) else dict(value or {}).get(part)
        plain = isinstance(value, str | bool | int | float | tuple)
        yield Mistake(key, value if plain else MISSING, sentence)


def checked(
    given: Assembled, gap: FieldSource | None, lattice: Lattice | None
) -> tuple[Deck, Solver, Sequence[LoadStep], Repeating | None]:
    """Check a deck, table by table and as a whole; the last value is the window, if it repeats."""
    found = list(given.problems)
    tables, of_tables = Deck.checked(given.data)
    if of_tables:
        blamed = {problem.key for problem in found}
        found += [problem for problem in of_tables if problem.key not in blamed]
    for problem in given.problems:
        tables.pop(str(problem.key[0]), None)
    if any(len(problem.key) == 1 and problem.key[0] not in Deck.known_keys() for problem in of_tables):
        tables.pop("friction", None)  # which may have the unknown key
    solver: Any = tables.get("solver")
    steps: tuple[LoadStep, ...] = ()
    repeating = None
    if {"grid", "body"} <= tables.keys() and tables["grid"].periodic:
        repeating, against = _repeating(tables, gap, lattice)
        found += against
    period = repeating.period if repeating else _SOME_PERIOD
    law = {"friction", "interface", "solver", "bulk"} <= tables.keys()
    if law:
        mu = coulomb(tables["friction"], tables["interface"])
        algorithm = solver.algorithm or ("incremental" if mu else "frictionless")
        solver = solver.model_copy(update={"algorithm": algorithm})
        found += mistakes(tables, _law_problems(tables, mu, algorithm))
    if law and "load" in tables:
        rolled = [one.rolling_direction or 0.0 for _, one in _segments(tables["load"]) if one.rolling]
        if rolled and "grid" in tables and tables["grid"].direction is None:  # a row along the first one
            tables["grid"] = tables["grid"].model_copy(update={"direction": rolled[0]})
        known = None if algorithm == "frictionless" else mu or 0.0
        steps, against = load_steps(tables["load"], known, tables["bulk"], period)
        found += [fault for fault in against if repeating or fault.key[-1] not in MEANS]
    whole = law and {"load", "grid", "body", "wear", "accuracy", "stress", "fatigue"} <= tables.keys()
    grid = given.data.get("grid")
    periodic = isinstance(grid, Mapping) and grid.get("boundary") == "periodic"
    bounded = periodic and "grid" not in tables  # by the window, also with another fault
    checks: tuple[tuple[bool, Callable[..., Found], tuple[Any, ...]], ...] = (
        (whole, _period_problems, (steps, period)),
        (whole, _rolling_problems, (solver,)),
        (law and {"output", "wear"} <= tables.keys(), _field_problems, (solver,)),
        (bool(steps and tables.get("wear")), _wear_problems, (solver,)),
        ({"stress", "fatigue", "body", "output"} <= tables.keys(), _problems_below, (steps,)),
        ("body" in tables and not bounded, _body_problems, (steps, gap is not None)),
        ({"body", "load"} <= tables.keys(), _moving_problems, ()),
        ("body" in tables, _coating_problems, (repeating,)),
    )
    for holds, check, facts in checks:
        found += mistakes(tables | {"solver": solver}, check(tables, *facts)) if holds else ()
    if found:
        raise deck_error(found, given.source)
    return Deck.model_construct(**tables), solver, steps, repeating


_SOME_PERIOD = Period(1.0, math.inf)  # for means in a deck that is refused anyway


class Repeating(NamedTuple):
    """The window of a case that repeats, with the references of its loads, and the surfaces over it."""

    lattice: Lattice
    period: Period
    surfaces: Separation


def _repeating(
    tables: Mapping[str, Any], gap: FieldSource | None, lattice: Lattice | None
) -> tuple[Repeating | None, list[Mistake]]:
    """Return the window that repeats, and faults of it and of the gap over it."""
    for key, part in tables["body"].separation.keyed:
        if any(part.tilt):
            fault = "expected none in a window that repeats, which a tilted surface does not"
            return None, [Mistake((*key, "tilt"), part.tilt, fault)]
    if lattice is None:
        lattice, faults = window.repeating(tables["grid"])
        if faults:
            return None, faults
    try:
        surfaces = tables["body"].separation.repeating(window.sides(lattice))
        field = PlaneField(surfaces if gap is None else gap, GAP)
        heights = field.over(lattice)
        fault = window.seam_fault(heights)
        if fault and field.repeats(lattice, heights):
            fault = ""
    except DeckError as error:
        if gap is not None:
            raise
        fault = str(error)
    if fault:
        return None, [Mistake(("grid", "boundary"), "periodic", fault)]
    period = Period(lattice.size * lattice.cell_area, float(heights.mean()))
    return Repeating(lattice, period, surfaces), []


def _period_problems(tables: Mapping[str, Any], steps: Sequence[LoadStep], period: Period) -> Found:
    """Yield tables and loads that a periodic window refuses, and means in a free window."""
    if not tables["grid"].periodic:
        for place, load in enumerate(tables["load"]):
            for name in MEANS:
                parts = load, *(load.path or ()), *([load.series] if load.series else [])
                if any(getattr(part, name) is not None for part in parts):
                    yield ("load", place, name), 'expected a window that repeats: grid.boundary = "periodic"'
        return
    whole = "beside a window that repeats"
    turned = f"expected no torque and no twist {whole}: a rotation does not repeat"
    named = [
        (*key, name)
        for key, segment in _segments(tables["load"])
        for name in ("torque", "twist")
        if getattr(segment, name)
    ]
    if any(step.twist.value or step.twist.control == "force" for step in steps):
        named = named or [("load",)]
    yield from ((key, turned) for key in named)
    # a mean pressure moves no mean plane of a half-space
    bodies = tables["body"].body_1, tables["body"].body_2
    closes = not (tables["interface"] or all(body.rigid for body in bodies))
    for key, segment in _segments(tables["load"]) if closes else ():
        if segment.approach is not None and segment.approach >= _ALL_TOUCH * period.mean_height:
            height = quantity(period.mean_height, "m")
            sentence = f"expected mean_pressure, or less than {height}, at which all of the window touches"
            if not period.mean_height > 0.0:
                sentence = "expected mean_pressure: all of the window touches before loading"
            yield (*key, "approach"), sentence
    if tables.get("bulk"):
        yield ("bulk",), f"expected nothing {whole}: a strain of the plane does not repeat"
    if tables["solver"].method == "direct":
        yield ("solver", "method"), f'expected "fft" {whole}'
    if tables["accuracy"]:
        yield ("accuracy",), f"expected none {whole}: the period sets the window; choose the spacing"
    if tables["wear"]:
        for key, segment in _segments(tables["load"]):
            if segment.mean_gap is not None:
                yield (*key, "mean_gap"), "expected mean_pressure or approach beside [wear], which changes it"
    for place, table in enumerate(tables["stress"]):
        if table.source == "edges":
            yield ("stress", place, "source"), f'expected "nodes" {whole}: its contact has no known edge'


def _coating_problems(tables: Mapping[str, Any], repeating: Repeating | None) -> Found:
    """Yield tables that take bodies as half-spaces, and coatings that a periodic window refuses."""
    bodies = tables["body"].body_1, tables["body"].body_2
    if not (bodies[0].coating or bodies[1].coating):
        return
    for number, body in enumerate(bodies, 1):
        for place, layer in enumerate(body.coating if len(body.coating) > 1 else ()):
            if layer.poisson_ratio >= 0.5:
                key = "body", str(number), "coating", place, "poisson_ratio"
                yield key, "expected a number below 0.5 in one of several coatings"
    if tables.get("wear"):
        sentence = "expected nothing beside a coating: wear makes a layer thinner, which is not followed"
        yield ("wear",), sentence
    for place, cycle in enumerate(tables.get("fatigue") or ()):
        if bodies[cycle.body - 1].coating:
            sentence = f"body {cycle.body} has a coating: constants of fatigue are those of one material"
            yield ("fatigue", place, "body"), sentence
    bulk = tables.get("bulk")
    for place, table in enumerate(tables.get("stress") or ()):
        if bulk and bodies[bulk.body - 1].coating and table.body == bulk.body:
            sentence = f"body {table.body} has a coating and a bulk stress: that of layers is not computed"
            yield ("stress", place, "body"), sentence
    if repeating is None:
        return
    spacing = repeating.lattice.spacing * min(1.0, repeating.lattice.cell_ratio)
    for number, body in enumerate(bodies, 1):
        if any(layer.thickness < _THINNEST * spacing for layer in body.coating):
            sentence = f"expected layers of at least {_THINNEST:g} spacings in a window that repeats"
            yield ("body", str(number), "coating"), sentence
    if all(body.rigid for body in bodies) and tables["grid"].periodic:
        for place, load in enumerate(tables.get("load") or ()):
            if any(part.mean_gap is not None for part in (load, *(load.path or ()))):
                sentence = "expected mean_pressure or approach: on rigid bases a mean pressure moves planes"
                yield ("load", place, "mean_gap"), sentence


def _segments(loads: Sequence[Load]) -> Iterator[tuple[tuple[str | int, ...], Segment]]:
    """Yield the segments of the entries of [[load]] that stand in the deck, with their keys."""
    for place, load in enumerate(loads):
        if load.path is None:
            yield ("load", place), load
        for number, segment in enumerate(load.path or ()):
            yield ("load", place, "path", number), segment


def _rolling_problems(tables: Mapping[str, Any], solver: Solver) -> Found:
    """Yield tables and keys that rolling bodies refuse."""
    rolling = [(key, segment) for key, segment in _segments(tables["load"]) if segment.rolling is not None]
    if not rolling:
        return
    beside = "beside rolling"
    if tables["grid"].periodic:
        yield ("grid", "boundary"), f'expected "free" {beside}: the contact has a front and a rear'
    if solver.algorithm != "incremental":
        yield ("solver", "algorithm"), f'expected "incremental" with friction {beside}'
    if solver.entry != "implicit":
        yield ("solver", "entry"), f'expected "implicit" {beside}, whose steps are a spacing long'
    if solver.method == "direct" and any(segment.rolling == "steady" for _, segment in rolling):
        yield ("solver", "method"), 'expected "fft" beside steady rolling, whose equations are not symmetric'
    for name, reason in {
        "bulk": "a bulk strain does not travel with the contact",
        "wear": "its cycles are loads that return",
        "fatigue": "its cycles are loads that return",
        "accuracy": "",
        "interface": "",
    }.items():
        if tables.get(name):
            yield (name,), f"is not available {beside}" + (f": {reason}" if reason else " yet")
    for key, segment in rolling:
        if segment.torque is not None:
            angle = segment.rolling_direction or 0.0
            for axis, part in (("x", math.sin(angle)), ("y", math.cos(angle))):
                force = f"tangential_load_{axis}"
                if abs(part) > _ALONG and getattr(segment, force) is None:
                    yield (*key, "torque"), f"expected {force} beside it, and no creepage across"


def _moving_problems(tables: Mapping[str, Any]) -> Found:
    """Yield faults of surfaces that move with rolling bodies, and loads that do not let them pass."""
    bodies = tables["body"]
    if not bodies.separation.moves:
        return
    for number, body in (("1", bodies.body_1), ("2", bodies.body_2)):
        for one in body.surface.shapes if body.surface else ():
            if one.moves and math.isfinite(one.reach):
                sentence = f"expected no moves = true of a {one.shape}, which ends, so that bodies lose touch"
                yield ("body", number, "surface"), sentence
    ways = [(key, segment.rolling) for key, segment in _segments(tables["load"]) if segment.rolling]
    for key, way in ways:
        if way == "steady":
            sentence = "expected a distance: with a surface that moves = true there is no steady state"
            yield (*key, "rolling"), sentence
    if not ways:
        number = next(str(key[1]) for key, part in bodies.separation.keyed if part.moves)
        yield (
            ("body", number, "surface"),
            "expected no moves = true without rolling over a distance in [[load]]",
        )


def rolling_fault(loads: Sequence[Load], spacing: Callable[[float], float]) -> Mistake | None:
    """Return the fault of a direction that is no row of the lattice, of spacing 0, or of too long a way."""
    for key, segment in _segments(loads):
        if segment.rolling is None:
            continue
        length = spacing(segment.rolling_direction or 0.0)
        if not length:
            sentence = "expected the direction of a row of the lattice; or remove grid.direction"
            return Mistake((*key, "rolling_direction"), segment.rolling_direction or "0 deg", sentence)
        if isinstance(segment.rolling, float) and segment.rolling > MOST_STEPS * length:
            sentence = f"expected at most {MOST_STEPS} spacings of the lattice, each of them a load step"
            return Mistake((*key, "rolling"), segment.rolling, sentence)
    return None


def _law_problems(tables: Mapping[str, Any], mu: float | None, algorithm: str) -> Found:
    """Yield conflicts of the law of friction with the interface and the algorithm."""
    solver, friction, layer = tables["solver"], tables["friction"], tables["interface"]
    if friction and layer and layer.friction_coefficient is not None:
        sentence = "expected nothing, since [friction] has a coefficient; or no [friction]"
        yield ("interface", "friction_coefficient"), sentence
    needed = f'since solver.algorithm = "{algorithm}"'
    if algorithm == "frictionless" and mu:
        yield ("friction", "coefficient"), f"expected 0, {needed}"
    if algorithm != "frictionless" and mu is None:
        yield ("friction", "coefficient"), f"missing; expected a number of at least 0 (or inf), {needed}"
    if solver.iteration == "newton":
        return
    needed = 'since solver.iteration = "dissertation"'  # which is for comparison only
    if solver.method != "direct":
        yield ("solver", "method"), f'expected "direct", {needed}'
    elif algorithm == "frictionless":
        yield ("solver", "iteration"), 'expected "newton" without friction'
    elif layer:
        yield ("interface",), f"expected nothing, {needed}"
    elif friction and isinstance(friction.coefficient, TwoCoefficients):
        yield ("friction", "coefficient"), f"expected one coefficient, {needed}"


def _wear_problems(tables: Mapping[str, Any], solver: Solver) -> Found:
    """Yield faults of wear: nodes that cannot slip, a history with another end, unknown steps."""
    wear, friction, loads = tables["wear"], tables.get("friction"), tables["load"]
    cycle = cycle_entries(loads, wear.cycle)
    mu = coulomb(friction, tables.get("interface"))
    if mu is None or mu in (0.0, math.inf):
        words = "without slip" if mu else "without friction"
        yield ("wear",), f"nothing wears {words}; expected a finite friction.coefficient above 0"
        return
    needed = "beside [wear], whose law needs a shear traction of mu p where nodes slip"
    if friction is None:
        yield ("interface", "friction_coefficient"), f"expected nothing {needed}"
    elif friction.shear_limit is not None:
        yield ("friction", "shear_limit"), f"expected nothing {needed}"
    elif isinstance(friction.coefficient, TwoCoefficients):
        yield ("friction", "coefficient"), f"expected one coefficient {needed}"
    if solver.algorithm != "incremental":
        yield ("solver", "algorithm"), "expected incremental with [wear]"
    if tables.get("accuracy"):
        yield ("accuracy",), "expected nothing beside [wear]: jumps differ from lattice to lattice"
    for place, load in enumerate(loads):
        if "auto" in (load.steps, *(segment.steps for segment in load.path or ())):
            sentence = "expected a number of steps with [wear]: all cycles need the same load steps"
            yield ("load", place, "steps"), sentence
        if load.repeat and load in cycle:
            sentence = "expected no repeat of the segments of wear.cycle, which wear.cycles repeats"
            yield ("load", place, "repeat"), sentence
    if not cycle:
        labels = [load.label for load in loads if load.label]
        known = f"; the last one has {shown(labels[-1]) if loads[-1].label else 'no label'}"
        hint = "" if wear.cycle in labels else did_you_mean(wear.cycle, labels)
        yield ("wear", "cycle"), f"expected the label of the last entries of [[load]]{hint or known}"
    elif len(cycle) == len(loads):
        yield ("wear", "cycle"), "expected an entry of [[load]] before the cycle, which presses the bodies"


def _field_problems(tables: Mapping[str, Any], solver: Solver) -> Found:
    """Yield fields that a run without friction, or without wear, does not have."""
    fields = tables["output"].fields or ()
    known = FRICTIONLESS_FIELDS if solver.algorithm == "frictionless" else FIELDS
    if missing := [name for name in fields if name not in known]:
        sentence = f"a frictionless run has no {', '.join(missing)}; it has {', '.join(known)}"
        yield ("output", "fields"), sentence
    elif not tables["wear"] and (missing := [name for name in fields if name in WORN]):
        yield ("output", "fields"), f"a run without [wear] has no {', '.join(missing)}"
    elif MOVED_GAP in fields and "body" in tables and not tables["body"].separation.moves:
        yield ("output", "fields"), f"a run without surfaces that move has no {MOVED_GAP}"


def _problems_below(tables: Mapping[str, Any], steps: Sequence[LoadStep]) -> Found:
    """Yield faults of stresses: of a rigid body, without the fields of the surface, of equal names."""
    names: set[str] = set()
    open_ended = any(step.ramp is not None or (step.roll and not step.roll.steady) for step in steps)
    last = 0 if open_ended else len(steps)
    stages = [stage_of(step) for step in steps] if tables["fatigue"] else []
    output, bodies = tables["output"], tables["body"]
    frictional = coulomb(tables.get("friction"), tables.get("interface")) is not None
    known = FIELDS if frictional else FRICTIONLESS_FIELDS
    needed = [name for name in known if name == "pressure" or name.startswith("traction")]
    kinds = ("stress", "fatigue")
    below = [(kind, place, table) for kind in kinds for place, table in enumerate(tables[kind])]
    for kind, place, table in below:
        of = (bodies.body_1, bodies.body_2)[table.body - 1]
        if of.rigid and not of.coating:
            yield (kind, place, "body"), f"body {table.body} is rigid: there is no stress to compute in it"
        name = table.name or f"{kind}_{place + 1}"
        plain = name.replace("_", "").replace("-", "").isalnum() and len(name.encode()) <= _LONGEST_NAME
        if name in names or not plain:
            sentence = "expected a name of a few letters, digits, - and _ that no other such table has"
            yield (kind, place, "name"), sentence
        names.add(name)
        if table.estimate_error and (not last or tables["wear"]):
            sentence = (
                'expected false beside [wear] and steps = "auto", whose steps differ from lattice to lattice'
            )
            yield (kind, place, "estimate_error"), sentence
        wanted = table.steps if isinstance(table.steps, tuple) else ()
        if last and (lost := [n for n in wanted if n > last or (n % output.every and n != last)]):
            of = f"{counted(last, 'load step')}, output.every = {output.every}"
            sentence = f"there are no fields of step {lost[0]}: {of}"
            yield (kind, place, "steps"), sentence
        if kind == "fatigue":
            for key, sentence in _cycle_problems(table, stages, output.every, frictional, numbered=last > 0):
                yield (kind, place, key), sentence
            ruiz = "ruiz" in table.parameters
            needed += [name for name in known if ruiz and name.startswith("slip_increment")]
    if below and output.fields and (lost := [n for n in needed if n not in output.fields]):
        words = listed(list(dict.fromkeys(lost)), "and")
        yield ("output", "fields"), f"expected {words} among the fields, which the stresses are computed from"


def _cycle_problems(
    table: Fatigue, stages: Sequence[Stage], every: int, frictional: bool, *, numbered: bool
) -> Iterator[tuple[str, str]]:
    """Yield segments or steps without a closed cycle, if loads are known, and Ruiz below the surface."""
    elsewhere = table.depths not in (None, (0.0,)) or table.points or table.line or table.plane
    if "ruiz" in table.parameters and (elsewhere or not frictional):
        yield "parameters", "ruiz: expected a contact with friction, and the nodes of the surface"
    fault = f"expected steps, since output.every = {every} leaves steps of the cycle out" if every > 1 else ""
    if table.segment and stages and not fault:
        try:
            cycle_of(stages, table.segment)
        except ValueError as error:
            fault = str(error)
    if table.segment and fault:
        yield "segment", fault
    if table.steps and numbered and (fault := steps_fault(stages, table.steps)):
        yield "steps", fault


def stage_of(step: LoadStep) -> Stage:
    """Return segment, label and known loads of a load step."""
    targets = zip(MOTIONS, step.targets, strict=True)
    known = {step.drives[m][t.control == "displacement"]: t.value for m, t in targets if not t.from_start}
    return step.segment, step.label, known | dict(zip(BULK_STRESS, step.bulk, strict=True))


def _body_problems(tables: Mapping[str, Any], steps: tuple[LoadStep, ...], gap_given: bool) -> Found:
    """Yield faults of the surfaces, and a bulk stress of a rigid body."""
    bodies = tables["body"]
    if (bulk := tables.get("bulk")) and (bodies.body_1, bodies.body_2)[bulk.body - 1].rigid:
        yield ("bulk", "body"), f"expected an elastic body; body {bulk.body} is rigid"
    if (grid := tables.get("grid")) and grid.periodic:
        return
    gap = bodies.separation
    for key, part in gap.keyed:
        if isinstance(part, Measured) and part.taper:
            yield key, 'expected no taper but in a window that repeats, grid.boundary = "periodic"'
        if isinstance(part, Roller) and (fault := part.design_fault):
            yield (*key, "design_load"), fault
            return
    if not gap_given and gap.flat and tables.get("interface"):
        yield from _full_contact_problems(tables, steps)
    elif not gap_given:
        if grid and grid.spacing == "auto" and not any(part.one_spot for part in gap.shapes):
            yield ("grid", "spacing"), "expected a length: surfaces that touch in one ellipse alone give one"
        yield from _touching_problems(gap)
    elif bodies.body_1.surface or bodies.body_2.surface:
        yield ("gap",), "expected either a gap or surfaces of the bodies, not both"


def _touching_problems(gap: Separation) -> Found:
    """Yield surfaces that do not touch, or touch along a line or everywhere, without end."""
    try:
        gap.first_touch  # noqa: B018 (computed here, cached)
    except DeckError as error:
        yield ("body", "2", "surface"), str(error)
        return
    if gap.one_map and any(one.extruded for one in gap.placed):
        sentence = (
            "a profile and a flat touch along a line, so the contact has no end; expected a surface of the "
            'other body that bounds it, or a window that repeats, grid.boundary = "periodic"'
        )
        yield (*gap.placed[0].name.split("."),), sentence
    if gap.curvature is None:
        return
    smaller, larger, _ = principal_curvatures(gap.curvature)
    if smaller > 1e-12 * larger:
        return
    sentence = (
        "the two surfaces touch along a line, so the contact has no end; expected a shape that bounds it: "
        'shape = "roller", which has a length, or a paraboloid with a large radius along the line, as in '
        "cases/long_cylinder.toml"
    )
    if smaller < -1e-12 * abs(larger):
        sentence = (
            "the gap falls away from the point of contact, so the two surfaces do not touch there; expected "
            "each hollow flatter than the body in it"
        )
    elif larger == 0:
        sentence = (
            "the two surfaces touch everywhere, so the contact has no end and one unknown, its mean "
            'pressure; expected a shape that bounds it, [interface] with law = "power", or a window that '
            'repeats, grid.boundary = "periodic"'
        )
    yield ("body", "2" if gap.surface_1.shape == "flat" else "1", "surface"), sentence


def _full_contact_problems(tables: Mapping[str, Any], steps: tuple[LoadStep, ...]) -> Found:
    """Check that nothing varies over the window of a flat-on-flat contact."""
    grid, friction, whole = tables.get("grid"), tables.get("friction"), "flat on flat has one unknown"
    if grid is not None and (grid.length is None or grid.window is None):
        sentence = f"{whole}: expected spacing and window, whose nodes are the area that shares the loads"
        yield ("grid",), sentence
    if any(step.twist.value or step.twist.control == "force" for step in steps):
        yield ("load",), f"{whole}: expected no torque and no twist"
    by_force = any(t.value for step in steps for t in (step.x, step.y) if t.control == "force")
    if by_force and not tables["interface"].tangential_stiffness:
        sentence = f"missing; {whole}: without tangential springs the shear distribution is undetermined"
        yield ("interface", "tangential_stiffness"), sentence
    if friction and not isinstance(friction.coefficient, float | int):
        yield ("friction", "coefficient"), f"{whole}: expected a number"
    for name in ("bulk", "stress", "accuracy"):
        if tables.get(name):
            yield (name,), f"{whole}: expected no table of this name with it"
    for number, body in (("1", tables["body"].body_1), ("2", tables["body"].body_2)):
        if body.coating:
            yield ("body", number, "coating"), f"{whole}, that of the interface: expected no coating"
