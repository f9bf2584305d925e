"""What is going to be run: rows of a table, and parameters that a result and the log keep."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..deck.kinds import Quantity
from ..text import percent, quantity
from .estimates import work
from .refinement import least_and_most

if TYPE_CHECKING:
    from ..core.lattice import Lattice
    from ..deck.surfaces import Surface
    from ..deck.tables import Body
    from .problem import Problem

Row = tuple[str, ...]


def parameters_of(case: Problem) -> dict[str, Any]:
    """Return what describes a case and how it is solved, and the machine that does it."""
    return {
        "effective_modulus": case.pair.effective_modulus,
        "dundurs_beta": case.pair.beta,
        "tangential_compliance_ratio": case.pair.gamma,
        "friction_coefficient": case.friction_coefficient,
        "algorithm": case.solver.algorithm,
        "coupling": case.solver.coupling,
        "entry": case.solver.entry,
        "tolerance": case.solver.tolerance,
        **({"step_tolerance": case.solver.step_tolerance} if case.adaptive else {}),
        **({"accuracy_target": case.accuracy.target} if case.accuracy else {}),
        "machine": _machine(),
    }


def _machine() -> str:
    """Say what the program runs on: "node7, Linux x86_64, 16 processors"."""
    count = os.cpu_count() or 1
    return (
        f"{platform.node()}, {platform.system()} {platform.machine()}, {count} processor{'s' * (count > 1)}"
    )


def case_rows(case: Problem, memory: Callable[[Problem, Lattice], int] | None = None) -> list[Row]:
    """Return what would be run.

    Parameters
    ----------
    case : Problem
        The problem.
    memory : callable, optional
        Estimates the memory (bytes) that a run on a window takes; without it the table does not name it.
    """
    lattice = case.lattice
    span = [lattice.n_col - 1, lattice.n_row - 1] @ abs(lattice.basis)  # the window may be too large to fill
    return [
        *((f"body {number}", _body(body)) for number, body in ((1, case.body_1), (2, case.body_2))),
        (
            "pair",
            f"E* = {quantity(case.pair.effective_modulus, 'Pa')}, beta = {case.pair.beta:.4g}, "
            f"gamma = {case.pair.gamma:.4g}",
        ),
        ("friction", _friction(case)),
        ("spacing", quantity(lattice.spacing, "m")),
        (
            "window",
            f"{lattice.n_row} x {lattice.n_col} nodes ({lattice.size:,}), {quantity(span[0], 'm')} x "
            f"{quantity(span[1], 'm')}, {'fixed' if case.window_fixed else 'grows with the contact'}",
        ),
        *([("accuracy", _accuracy(case))] if case.accuracy else []),
        ("load steps", _history(case)),
        ("largest load", _largest(case)),
        ("method", f"{case.method_for(lattice)}, tolerance {case.solver.tolerance:g}"),
        *([("memory", _memory(case, memory))] if memory else []),
        ("work", work(case)),
    ]  # fmt: skip


def _memory(case: Problem, memory: Callable[[Problem, Lattice], int]) -> str:
    last = [cases[-1] for cases in least_and_most(case)] if case.accuracy else [case]
    return " to ".join(quantity(memory(one, one.lattice), "B", 3) for one in last)


def _accuracy(case: Problem) -> str:
    """Say what is to be reached, and between which lattices the refinement will end."""
    assert case.accuracy is not None
    last = [cases[-1].lattice for cases in least_and_most(case)]
    spacings = [quantity(lattice.spacing, "m") for lattice in last]
    return (
        f"target {percent(case.accuracy.target)}: spacing and window are of the first lattice, the last "
        f"has {' to '.join(spacings)} ({' to '.join(f'{lattice.size:,}' for lattice in last)} nodes)"
    )


def _friction(case: Problem) -> str:
    if not case.frictional:
        return "none"
    mu = case.friction_coefficient
    law = "no slip (coefficient inf)" if math.isinf(mu) else f"coefficient {mu:g}"
    goodman = ", shear does not move the pressure" * (case.solver.coupling == "goodman")
    interpolated = case.solver.algorithm == "incremental" and case.solver.entry == "interpolated"
    entry = ", entry interpolated" * interpolated
    return f"{law}, {case.solver.algorithm}{entry}{goodman}"


def _history(case: Problem) -> str:
    segments = case.load_steps[-1].segment + 1
    if case.adaptive:
        chosen = sum(step.ramp is not None for step in case.load_steps)
        given = len(case.load_steps) - chosen
        where = f"{chosen} segment{'s' * (chosen > 1)}"
        fixed = f", and {given} that {'are' if given > 1 else 'is'} given" * (given > 0)
        return f"chosen on the way in {where} (step_tolerance {case.solver.step_tolerance:g}){fixed}"
    return f"{len(case.load_steps)}" + (f" in {segments} segments" if segments > 1 else "")


def _largest(case: Problem) -> str:
    """Return the largest load along each direction, as far as the deck tells."""
    largest = {}
    for direction in ("z", "x", "y"):
        targets = [getattr(step, direction) for step in case.load_steps]
        largest[direction] = max((abs(t.value) for t in targets if t.control == "force"), default=0.0)
    normal = quantity(largest["z"], "N") if largest["z"] else "follows from the approach"
    along = [f"{quantity(largest[axis], 'N')} along {axis}" for axis in ("x", "y") if largest[axis]]
    return ", ".join([normal, *along])


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
