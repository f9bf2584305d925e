"""Checks of a case that need several tables of its deck."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..deck.below import Fatigue, Stage, cycle_of, steps_fault
from ..deck.faults import MISSING, Mistake, deck_error
from ..deck.interface import Friction, Interface, TwoCoefficients, coulomb
from ..deck.keys import Deck, Output, Solver
from ..deck.read import Assembled
from ..deck.surfaces import Separation, principal_curvatures
from ..errors import DeckError
from ..text import did_you_mean, listed, shown
from ..variables import BULK_STRESS, FIELDS, FRICTIONLESS_FIELDS, LOADS, WORN
from .loads import MOTIONS, LoadStep, cycle_entries, load_steps

_LONGEST_NAME = 60  # bytes of the name of a table of stresses, which is part of the name of a file


def checked(given: Assembled, gap_given: bool) -> tuple[Deck, Solver, Sequence[LoadStep]]:
    """Check a deck, table by table and as a whole."""
    found = list(given.problems)
    tables, of_tables = Deck.checked(given.data)
    blamed = {problem.key for problem in found}
    found += [problem for problem in of_tables if problem.key not in blamed]
    for problem in given.problems:
        tables.pop(str(problem.key[0]), None)
    if any(len(problem.key) == 1 and problem.key[0] not in Deck.known_keys() for problem in of_tables):
        tables.pop("friction", None)  # which may have the unknown key
    solver: Any = tables.get("solver")
    steps: tuple[LoadStep, ...] = ()
    if {"friction", "interface", "solver", "bulk"} <= tables.keys():
        friction, layer = tables["friction"], tables["interface"]
        given_mu = coulomb(friction, layer)
        if friction and layer and layer.friction_coefficient is not None:
            sentence = "expected nothing, since [friction] has a coefficient; or no [friction]"
            found.append(Mistake(("interface", "friction_coefficient"), layer.friction_coefficient, sentence))
        algorithm, against = _algorithm(given_mu, solver)
        solver = solver.model_copy(update={"algorithm": algorithm})
        found += against
        found += _iteration_problems(solver, friction, layer)
        if "load" in tables:
            mu = None if algorithm == "frictionless" else 0.0 if given_mu is None else given_mu
            steps, against = load_steps(tables["load"], mu, tables.get("bulk"))
            found += against
        if {"output", "wear"} <= tables.keys():
            found += _field_problems(tables["output"], algorithm, tables["wear"] is not None)
    if steps and tables.get("wear"):
        found += _wear_problems(tables, solver)
    if {"stress", "fatigue", "body", "output"} <= tables.keys():
        found += _problems_below(tables, steps)
    if "body" in tables:
        bodies = tables["body"]
        if (bulk := tables.get("bulk")) and (bodies.body_1, bodies.body_2)[bulk.body - 1].rigid:
            sentence = f"expected an elastic body; body {bulk.body} is rigid"
            found.append(Mistake(("bulk", "body"), bulk.body, sentence))
        if not gap_given and bodies.separation.flat and tables.get("interface"):
            found += _full_contact_problems(tables, steps)
        elif not gap_given:
            found += _touching_problems(bodies.separation)
        elif bodies.body_1.surface or bodies.body_2.surface:
            sentence = "expected either a gap or surfaces of the bodies, not both"
            found.append(Mistake(("gap",), MISSING, sentence))
    if found:
        raise deck_error(found, given.source)
    return Deck.model_construct(**tables), solver, steps


def _algorithm(mu: float | None, solver: Solver) -> tuple[str, list[Mistake]]:
    """Return the algorithm of a deck, and its conflicts with friction."""
    algorithm = solver.algorithm or ("incremental" if mu else "frictionless")
    problems = []
    if algorithm == "frictionless" and mu:
        sentence = 'expected 0, since solver.algorithm = "frictionless"'
        problems.append(Mistake(("friction", "coefficient"), mu, sentence))
    if algorithm != "frictionless" and mu is None:
        sentence = (
            f'missing; expected a number of at least 0 (or inf), since solver.algorithm = "{algorithm}"'
        )
        problems.append(Mistake(("friction", "coefficient"), MISSING, sentence))
    return algorithm, problems


def _iteration_problems(solver: Solver, friction: Friction | None, layer: Interface | None) -> list[Mistake]:
    """Return what the iteration of the dissertation cannot do: it is for comparison only."""
    if solver.iteration == "newton":
        return []
    needed = 'since solver.iteration = "dissertation"'
    if solver.method != "direct":
        return [Mistake(("solver", "method"), solver.method, f'expected "direct", {needed}')]
    if solver.algorithm == "frictionless":
        return [Mistake(("solver", "iteration"), solver.iteration, 'expected "newton" without friction')]
    if layer:
        return [Mistake(("interface",), MISSING, f"expected nothing, {needed}")]
    if friction and isinstance(friction.coefficient, TwoCoefficients):
        return [Mistake(("friction", "coefficient"), MISSING, f"expected one coefficient, {needed}")]
    return []


def _wear_problems(tables: dict[str, Any], solver: Solver) -> list[Mistake]:
    """Return faults of wear: nodes that cannot slip, a history with another end, unknown steps."""
    wear, friction = tables["wear"], tables.get("friction")
    cycle, found = cycle_entries(tables["load"], wear.cycle), []
    mu = coulomb(friction, tables.get("interface"))
    if mu is None or mu in (0.0, math.inf):
        words = "without slip" if mu else "without friction"
        sentence = f"nothing wears {words}; expected a finite friction.coefficient above 0"
        return [Mistake(("wear",), MISSING, sentence)]
    needed = "beside [wear], whose law needs a shear traction of mu p where nodes slip"
    if friction is None:
        sentence = f"expected nothing {needed}"
        found.append(Mistake(("interface", "friction_coefficient"), MISSING, sentence))
    elif friction.shear_limit is not None:
        sentence = f"expected nothing {needed}"
        found.append(Mistake(("friction", "shear_limit"), friction.shear_limit, sentence))
    elif isinstance(friction.coefficient, TwoCoefficients):
        sentence = f"expected one coefficient {needed}"
        found.append(Mistake(("friction", "coefficient"), MISSING, sentence))
    if solver.algorithm != "incremental":
        found.append(Mistake(("solver", "algorithm"), solver.algorithm, "expected incremental with [wear]"))
    if tables.get("accuracy"):
        sentence = "expected nothing beside [wear]: jumps differ from lattice to lattice"
        found.append(Mistake(("accuracy",), MISSING, sentence))
    for place, load in enumerate(tables["load"]):
        if "auto" in (load.steps, *(segment.steps for segment in load.path or ())):
            sentence = "expected a number of steps with [wear]: all cycles need the same load steps"
            found.append(Mistake(("load", place, "steps"), "auto", sentence))
        if load.repeat and load in cycle:
            sentence = "expected no repeat of the segments of wear.cycle, which wear.cycles repeats"
            found.append(Mistake(("load", place, "repeat"), load.repeat, sentence))
    if not cycle:
        labels = [load.label for load in tables["load"] if load.label]
        known = f"; the last one has {shown(labels[-1]) if tables['load'][-1].label else 'no label'}"
        hint = "" if wear.cycle in labels else did_you_mean(wear.cycle, labels)
        sentence = f"expected the label of the last entries of [[load]]{hint or known}"
        found.append(Mistake(("wear", "cycle"), wear.cycle, sentence))
    elif len(cycle) == len(tables["load"]):
        sentence = "expected an entry of [[load]] before the cycle, which presses the bodies"
        found.append(Mistake(("wear", "cycle"), wear.cycle, sentence))
    return found


def _field_problems(output: Output, algorithm: str, wears: bool) -> list[Mistake]:
    """Return fields that a run without friction, or without wear, does not have."""
    known = FRICTIONLESS_FIELDS if algorithm == "frictionless" else FIELDS
    missing = [name for name in output.fields or () if name not in known]
    if not missing:
        if wears or not (missing := [name for name in output.fields or () if name in WORN]):
            return []
        sentence = f"a run without [wear] has no {', '.join(missing)}"
        return [Mistake(("output", "fields"), output.fields, sentence)]
    sentence = f"a frictionless run has no {', '.join(missing)}; it has {', '.join(known)}"
    return [Mistake(("output", "fields"), output.fields, sentence)]


def _problems_below(tables: dict[str, Any], steps: Sequence[LoadStep]) -> list[Mistake]:
    """Return faults of stresses: of a rigid body, without the fields of the surface, of equal names."""
    found, names = [], set()
    last = 0 if any(step.ramp is not None for step in steps) else len(steps)
    stages = [stage_of(step) for step in steps] if tables["fatigue"] else []
    output, bodies = tables["output"], tables["body"]
    frictional = coulomb(tables.get("friction"), tables.get("interface")) is not None
    known = FIELDS if frictional else FRICTIONLESS_FIELDS
    needed = [name for name in known if name == "pressure" or name.startswith("traction")]
    kinds = ("stress", "fatigue")
    below = [(kind, place, table) for kind in kinds for place, table in enumerate(tables[kind])]
    for kind, place, table in below:
        if (bodies.body_1, bodies.body_2)[table.body - 1].rigid:
            sentence = f"body {table.body} is rigid: there is no stress to compute in it"
            found.append(Mistake((kind, place, "body"), table.body, sentence))
        name = table.name or f"{kind}_{place + 1}"
        plain = name.replace("_", "").replace("-", "").isalnum() and len(name.encode()) <= _LONGEST_NAME
        if name in names or not plain:
            sentence = "expected a name of a few letters, digits, - and _ that no other such table has"
            found.append(Mistake((kind, place, "name"), table.name, sentence))
        names.add(name)
        if table.estimate_error and (not last or tables["wear"]):
            sentence = (
                'expected false beside [wear] and steps = "auto", whose steps differ from lattice to lattice'
            )
            found.append(Mistake((kind, place, "estimate_error"), True, sentence))
        wanted = table.steps if isinstance(table.steps, tuple) else ()
        if last and (lost := [n for n in wanted if n > last or (n % output.every and n != last)]):
            sentence = (
                f"there are no fields of step {lost[0]}: {last} load steps, output.every = {output.every}"
            )
            found.append(Mistake((kind, place, "steps"), table.steps, sentence))
        if kind == "fatigue":
            found += _fatigue_problems(table, place, stages, output.every, frictional, numbered=last > 0)
            ruiz = "ruiz" in table.parameters
            needed += [name for name in known if ruiz and name.startswith("slip_increment")]
    if below and output.fields and (lost := [n for n in needed if n not in output.fields]):
        words = listed(list(dict.fromkeys(lost)), "and")
        sentence = f"expected {words} among the fields, which the stresses are computed from"
        found.append(Mistake(("output", "fields"), output.fields, sentence))
    return found


def _fatigue_problems(
    table: Fatigue, place: int, stages: Sequence[Stage], every: int, frictional: bool, *, numbered: bool
) -> list[Mistake]:
    """Return segments or steps that make no closed cycle, as far as loads tell, and Ruiz off the surface."""
    found = []
    elsewhere = table.depths not in (None, (0.0,)) or table.points or table.line or table.plane
    if "ruiz" in table.parameters and (elsewhere or not frictional):
        sentence = "ruiz: expected a contact with friction, and the nodes of the surface"
        found.append(Mistake(("fatigue", place, "parameters"), table.parameters, sentence))
    fault = f"expected steps, since output.every = {every} leaves steps of the cycle out" if every > 1 else ""
    if table.segment and stages and not fault:
        try:
            cycle_of(stages, table.segment)
        except ValueError as error:
            fault = str(error)
    if table.segment and fault:
        found.append(Mistake(("fatigue", place, "segment"), table.segment, fault))
    if table.steps and numbered and (fault := steps_fault(stages, table.steps)):
        found.append(Mistake(("fatigue", place, "steps"), table.steps, fault))
    return found


def stage_of(step: LoadStep) -> Stage:
    """Return segment, label and known loads of a load step."""
    targets = zip(MOTIONS, step.targets, strict=True)
    known = {LOADS[m][t.control == "displacement"]: t.value for m, t in targets if not t.from_start}
    return step.segment, step.label, known | dict(zip(BULK_STRESS, step.bulk, strict=True))


def _touching_problems(gap: Separation) -> list[Mistake]:
    """Return surfaces that do not touch, or touch along a line or everywhere, without end."""
    try:
        gap.first_touch  # noqa: B018 (computed here, cached)
    except DeckError as error:
        return [Mistake(("body", "2", "surface"), MISSING, str(error))]
    one, two = gap.surface_1.curvature, gap.surface_2.curvature
    if one is None or two is None:
        return []
    smaller, larger, _ = principal_curvatures(one + two)
    if smaller > 1e-12 * larger:
        return []
    sentence = (
        "the two surfaces touch along a line, so the contact has no end; expected a shape that bounds it: "
        "a paraboloid with a large radius along the line, as in cases/long_cylinder.toml, or a formula with "
        "ends, such as a profile that rises there"
    )
    if smaller < -1e-12 * abs(larger):
        sentence = (
            "the gap falls away from the point of contact, so the two surfaces do not touch there; expected "
            "each hollow flatter than the body in it"
        )
    elif larger == 0:
        sentence = (
            "the two surfaces touch everywhere, so the contact has no end and one unknown, its mean "
            'pressure; expected a shape that bounds it, or [interface] with law = "power"; a periodic '
            "boundary, the way with no layer, is not available yet"
        )
    return [Mistake(("body", "2" if gap.surface_1.shape == "flat" else "1", "surface"), MISSING, sentence)]


def _full_contact_problems(tables: Mapping[str, Any], steps: tuple[LoadStep, ...]) -> list[Mistake]:
    """Return what differs between the nodes of two flats on an interface, whose area the window is."""
    found, grid, friction = [], tables.get("grid"), tables.get("friction")
    whole = "flat on flat has one unknown"
    if grid is not None and (grid.spacing is None or grid.window is None):
        sentence = f"{whole}: expected spacing and window, whose nodes are the area that shares the loads"
        found.append(Mistake(("grid",), MISSING, sentence))
    if any(step.twist.value or step.twist.control == "force" for step in steps):
        found.append(Mistake(("load",), MISSING, f"{whole}: expected no torque and no twist"))
    by_force = any(t.value for step in steps for t in (step.x, step.y) if t.control == "force")
    if by_force and not tables["interface"].tangential_stiffness:
        sentence = f"missing; {whole}: without springs nothing says how its nodes share the tangential load"
        found.append(Mistake(("interface", "tangential_stiffness"), MISSING, sentence))
    if friction and not isinstance(friction.coefficient, float | int):
        found.append(Mistake(("friction", "coefficient"), MISSING, f"{whole}: expected a number"))
    for name in ("bulk", "stress", "accuracy"):
        if tables.get(name):
            found.append(Mistake((name,), MISSING, f"{whole}: expected no table of this name with it"))
    return found
