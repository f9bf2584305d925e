"""Overview of a case before a run: rows of a table, and parameters for the result and the log."""

from __future__ import annotations

import functools
import math
import os
import platform
from collections.abc import Callable, Sequence
from typing import Any

from ..core.lattice import Lattice
from ..deck.interface import FROM_PYTHON, NodalCoefficient, TwoCoefficients
from ..deck.keys import Body, Bulk
from ..deck.kinds import Quantity
from ..deck.surfaces import Surface
from ..text import Row, percent, quantity
from ..variables import BULK_STRESS, INTERFACE, LOADS, SHEAR_LIMIT
from . import plausibility
from .estimates import work
from .loads import LoadStep
from .problem import Problem
from .refinement import least_and_most


def parameters_of(case: Problem) -> dict[str, Any]:
    """Return the parameters of a case, its solver and the machine."""
    return {
        "effective_modulus": case.pair.effective_modulus,
        "dundurs_beta": case.pair.beta,
        "tangential_compliance_ratio": case.pair.gamma,
        "friction_coefficient": case.friction_coefficient,
        **({"friction_law": law_in_words(case)} if math.isnan(case.friction_coefficient) else {}),
        **({SHEAR_LIMIT: law.shear_limit} if (law := case.deck.friction) and law.shear_limit else {}),
        **(dict(zip(INTERFACE, case.interface, strict=True)) if case.deck.interface else {}),
        "algorithm": case.solver.algorithm,
        "coupling": case.solver.coupling,
        "entry": case.solver.entry,
        **({"iteration": case.solver.iteration} if case.solver.iteration != "newton" else {}),
        "tolerance": case.solver.tolerance,
        **({"bulk_state": case.deck.bulk.state} if case.deck.bulk else {}),
        **({"step_tolerance": case.solver.step_tolerance} if case.adaptive else {}),
        **(
            {
                "cycle_tolerance": wear.cycle_tolerance(case.solver.tolerance),
                "wear_tolerance": wear.tolerance,
            }
            if (wear := case.deck.wear)
            else {}
        ),
        **({"accuracy_target": case.accuracy.target} if case.accuracy else {}),
        **({"warnings": "\n".join(doubts)} if (doubts := plausibility.warnings(case)) else {}),
        **({"notes": note} if (note := plausibility.unjudged(case)) else {}),
        "machine": machine(),
    }


@functools.cache
def machine() -> str:
    """Describe the machine: "node7, Linux x86_64, 16 processors"."""
    count = os.cpu_count() or 1
    return (
        f"{platform.node()}, {platform.system()} {platform.machine()}, {count} processor{'s' * (count > 1)}"
    )


def case_rows(case: Problem, memory: Callable[[Problem, Lattice], int] | None = None) -> list[Row]:
    """Return the rows of an overview of a case."""
    lattice = case.lattice
    span = [lattice.n_col - 1, lattice.n_row - 1] @ abs(
        lattice.basis
    )  # without the coordinates, for which the window may be too large
    return [
        *((f"body {number}", _body(body)) for number, body in ((1, case.body_1), (2, case.body_2))),
        *([("gap", str(case.height_map))] if case.height_map else []),
        (
            "pair",
            f"E* = {quantity(case.pair.effective_modulus, 'Pa')}, beta = {case.pair.beta:.4g}, "
            f"gamma = {case.pair.gamma:.4g}",
        ),
        *([("interface", _interface(case))] if case.deck.interface else []),
        ("friction", _friction(case)),
        *([("contact", contact)] if (contact := plausibility.row(case)) else []),
        *([("contact", "full, one unknown: p = P/A over all nodes")] if case.full_contact else []),
        ("spacing", quantity(lattice.spacing, "m")),
        (
            "window",
            f"{lattice.n_row} x {lattice.n_col} nodes ({lattice.size:,}), {quantity(span[0], 'm')} x "
            f"{quantity(span[1], 'm')}, {'fixed' if case.window_fixed else 'grows with the contact'}",
        ),
        *([("accuracy", _accuracy(case))] if case.accuracy else []),
        *([("bulk stress", _bulk(case.deck.bulk, case.load_steps))] if case.deck.bulk else []),
        ("load steps", _history(case)),
        ("largest load", _largest(case)),
        ("method", f"{_method(case, lattice)}, tolerance {case.solver.tolerance:g}"),
        *([("memory", _memory(case, memory))] if memory else []),
        ("work", work(case)),
    ]  # fmt: skip


def _memory(case: Problem, memory: Callable[[Problem, Lattice], int]) -> str:
    last = [cases[-1] for cases in least_and_most(case)] if case.accuracy else [case]
    return " to ".join(quantity(memory(one, one.lattice), "B", 3) for one in last)


def _accuracy(case: Problem) -> str:
    """Describe the target, and the range of the last lattice of the refinement."""
    assert case.accuracy is not None
    last = [cases[-1].lattice for cases in least_and_most(case)]
    spacings = [quantity(lattice.spacing, "m") for lattice in last]
    return (
        f"target {percent(case.accuracy.target)}: spacing and window are of the first lattice, the last "
        f"has {' to '.join(spacings)} ({' to '.join(f'{lattice.size:,}' for lattice in last)} nodes)"
    )


def law_in_words(case: Problem) -> str:
    """Describe the law of friction of a case."""
    friction, layer = case.deck.friction, case.deck.interface
    if friction is None and layer and layer.friction_limit:
        exponent = layer.friction_exponent or layer.exponent
        return f"limit {layer.friction_coefficient:.6g} Pa/m^{exponent:g} ψ^{exponent:g} of the interface"
    mu: Any = friction.coefficient if friction else 0.0
    if isinstance(mu, NodalCoefficient):
        law = f"coefficient {mu}" if mu.in_deck != FROM_PYTHON else "coefficient by node"
        law += ", bilinear" * isinstance(mu.in_deck, dict)
    elif isinstance(mu, TwoCoefficients):
        law = f"coefficients {mu}"
    else:
        unbounded = mu == math.inf and math.isinf(case.friction_coefficient)
        law = "no slip (coefficient inf)" if unbounded else f"coefficient {mu:g}"
    if friction is None or friction.shear_limit is None:
        return law
    return f"{law}, shear traction of at most {quantity(friction.shear_limit, 'Pa')}"


def _method(case: Problem, lattice: Lattice) -> str:
    """Return the method, and whose iteration it is if not ours."""
    written = case.solver.iteration == "dissertation"
    return case.method_for(lattice) + ", iteration of the dissertation" * written


def _friction(case: Problem) -> str:
    if not case.frictional:
        return "none"
    law = law_in_words(case)
    goodman = ", shear does not move the pressure" * (case.solver.coupling == "goodman")
    interpolated = case.solver.algorithm == "incremental" and case.solver.entry == "interpolated"
    entry = ", entry interpolated" * interpolated
    return f"{law}, {case.solver.algorithm}{entry}{goodman}"


def _bulk(bulk: Bulk, steps: Sequence[LoadStep]) -> str:
    """Return the largest components of the bulk stress, and the body that carries it."""
    largest = [max(values, key=abs) for values in zip(*(step.bulk for step in steps), strict=True)]
    parts = [
        f"{quantity(value, 'Pa')} along {name[-2:]}"
        for name, value in zip(BULK_STRESS, largest, strict=True)
        if value
    ]
    return f"body {bulk.body}, {bulk.state}: {', '.join(parts) or 'none'}"


def _interface(case: Problem) -> str:
    coefficient, exponent, stiffness = case.interface
    springs = f", tangential springs of {stiffness:.6g} Pa/m" if stiffness else ""
    return (
        f"p = c ψ^m under penetration ψ, m = {exponent:g}, c = {coefficient:.6g} Pa/m^{exponent:g}{springs}"
    )


def _history(case: Problem) -> str:
    segments = case.load_steps[-1].segment + 1
    gaps = "".join(
        f"; {count} of {rows.count} rows of a series keep the {key.replace('_', ' ')} of the row before"
        for rows in (load.series for load in case.deck.load if load.series)
        for key, count in rows.missing.items()
    )
    if case.adaptive:
        chosen = sum(step.ramp is not None for step in case.load_steps)
        given = len(case.load_steps) - chosen
        where = f"{chosen} segment{'s' * (chosen > 1)}"
        fixed = f", and {given} that {'are' if given > 1 else 'is'} given" * (given > 0)
        return f"chosen on the way in {where} (step_tolerance {case.solver.step_tolerance:g}){fixed}{gaps}"
    wears = ""
    if wear := case.deck.wear:
        solved = 'a number that shows on the way (jump "auto")'
        if not isinstance(wear.jump, str):
            solved = f"{math.ceil(wear.cycles / wear.jump) + 1:,}"
        wears = f", then {solved} of {wear.cycles:,} cycles, with {1 + len(case.cycle)} each"
    return f"{len(case.load_steps)}" + (f" in {segments} segments" if segments > 1 else "") + wears + gaps


def _largest(case: Problem) -> str:
    """Describe the largest prescribed load along each direction."""
    largest = largest_loads(case)
    normal = quantity(largest["normal_load"], "N") if largest["normal_load"] else "follows from the approach"
    along = [
        f"{quantity(value, 'N')} along {axis}"
        for axis in "xy"
        if (value := largest[f"tangential_load_{axis}"])
    ]
    return ", ".join([normal, *along])


def largest_loads(case: Problem) -> dict[str, float]:
    """Return the largest prescribed normal and tangential loads (N), 0 without one."""
    largest = {}
    for direction in ("z", "x", "y"):
        targets = [getattr(step, direction) for step in case.load_steps]
        name = LOADS[direction][0]
        largest[name] = max((abs(t.value) for t in targets if t.control == "force"), default=0.0)
    return largest


def _body(body: Body) -> str:
    stiffness = "rigid"
    if not body.rigid:
        stiffness = f"E = {quantity(body.young_modulus or math.nan, 'Pa')}, nu = {body.poisson_ratio:g}"
    return f"{stiffness}; {_surface(body.surface)}"


def _surface(surface: Surface | None) -> str:
    if surface is None:
        return "flat"
    given = [surface.shape]
    for name, field in type(surface).model_fields.items():
        value = getattr(surface, name)
        if name == "shape" or value == field.default:
            continue
        unit = next((kind.dimension.unit for kind in field.metadata if isinstance(kind, Quantity)), "")
        if name == "offset":
            given.append(f"{name} ({', '.join(quantity(part, 'm') for part in value)})")
        elif unit == "rad":
            given.append(f"{name} {math.degrees(value):.6g} deg")
        else:
            given.append(f"{name} {quantity(value, unit) if isinstance(value, float) else value}")
    return ", ".join(given)
