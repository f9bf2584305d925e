"""Says of a load step that did not converge which condition failed most, where, by how much, what to try.

The residuals are those of docs/theory/residuals.md, node by node.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.measures import nodal_residuals
from ..errors import ConvergenceError
from ..problem.loads import LEAST
from ..result.history import RESIDUALS
from ..text import listed, quantity

if TYPE_CHECKING:
    from ..core.contact import NormalSolution
    from ..core.friction import ContactState
    from ..core.lattice import Lattice
    from ..problem.loads import LoadStep
    from ..problem.problem import Problem

_NEAR_SLIDING = 0.99  # share of mu P from which full slip may carry a tangential load
_SLIDING = 1.0 - 1e-6  # ... from which it has to
_ROUNDING = 1e-11  # tolerance below which rounding errors may decide
_SAME = 1e-3  # relative difference of a residual from that of the solver that still means the same state
_LOST = "the last attempt lost all contact"
_INFINITE = 1e100  # the core says so for an error relative to nothing


class Worst(NamedTuple):
    """The residual that is largest, the node that it comes from if any (rows and columns of the lattice)."""

    residual: str
    value: float
    row: int | None = None
    column: int | None = None
    x: float = math.nan
    y: float = math.nan
    what: str = ""


def error(
    case: Problem,
    lattice: Lattice,
    solution: NormalSolution | ContactState,
    target: LoadStep,
    values: tuple[float, ...],
) -> ConvergenceError:
    """Make the error of a step that did not converge; gross sliding is called so.

    Parameters
    ----------
    case : Problem
        The case.
    lattice : Lattice
        The window.
    solution : NormalSolution or ContactState
        The attempt that failed.
    target : LoadStep
        The step.
    values : tuple of float
        What was prescribed for z, x, y and the twist.
    """
    residuals = _residuals(case, solution, target)
    worst = _worst(case, lattice, solution, residuals, values)
    details = {
        "step": target.index + 1,
        "label": target.label,
        "iterations": solution.sweeps,
        "halvings": getattr(solution, "cuts", 0),
        "tolerance": case.solver.tolerance,
        "stopped": solution.stopped,
        "residuals": residuals,
        "worst": worst._asdict(),
    }
    segment = f" ({target.label})" if target.label else ""
    planned = f" of {case.planned_steps}" if case.planned_steps else ""
    step = f"step {target.index + 1}{planned}{segment}"
    shown = listed([f"{sign} = {_number(value)}" for sign, value in residuals.items()], "and")
    after = f"after {listed(_tried(solution), 'and')} the residuals are {shown}"
    doubtful, excess = _sliding(case, solution, target, values)
    if excess:
        expected = "expected a smaller load, or a prescribed motion in its place (shift_x, shift_y, twist)"
        return ConvergenceError(f"{step}: gross sliding: {excess}; {after}; {expected}", details)
    lines = [f"{step} did not converge: {after}; solver.tolerance = {case.solver.tolerance:g} was expected"]
    if worst.what == _LOST:
        lines.append(_LOST)
    elif worst.what and worst.value > case.solver.tolerance:
        times = worst.value / case.solver.tolerance
        lines.append(f"worst is {worst.residual}, {_number(times)} times its bound: {worst.what}")
    if solution.stopped:
        lines.append(f"the last attempt ended since {solution.stopped}")
    if target.ramp is not None:
        lines.append(f"it is {LEAST:.1%} of its segment, the least of adaptive steps")
    lines.append(f"to try: {'; or '.join(_advice(case, worst, doubtful, target.ramp is not None))}")
    return ConvergenceError("\n".join(lines), details)


def _residuals(case: Problem, solution: NormalSolution | ContactState, target: LoadStep) -> dict[str, float]:
    """Return the residuals that have to be small, by the symbol of the theory."""
    z, x, y, twist = (motion.control == "force" for motion in target.targets)
    wanted = {"R_n": True, "R_t": True, "R_P": z, "R_Q": x or y, "R_M": twist}
    if not case.frictional:
        wanted = {"R_n": True, "R_P": z}
    return {sign: float(getattr(solution, RESIDUALS[sign])) for sign, shown in wanted.items() if shown}


def _number(value: float) -> str:
    return f"{value:.2e}" if value < _INFINITE else "inf"


def _tried(solution: NormalSolution | ContactState) -> list[str]:
    cuts = getattr(solution, "cuts", 0)
    halved = [f"halving the step {cuts} time{'s' * (cuts > 1)}"] if cuts else []
    return [f"{solution.sweeps} iterations", *halved]


def _sliding(
    case: Problem, solution: NormalSolution | ContactState, target: LoadStep, values: tuple[float, ...]
) -> tuple[bool, str]:
    """Return whether the load may be more than friction can carry; if it is, a sentence about that."""
    z, x, y, twist = (motion.control == "force" for motion in target.targets)
    shear, torque = math.hypot(x * values[1], y * values[2]), abs(twist * values[3])
    bound = case.friction_coefficient * values[0] if z else math.nan
    seen = bool(getattr(solution, "sliding", False))
    doubtful = bool(torque or shear > _NEAR_SLIDING * bound or (shear and not z))
    if not case.frictional or not (seen or (shear and shear >= _SLIDING * bound)):
        return doubtful and math.isfinite(case.friction_coefficient), ""
    wanted = [f"tangential load of {quantity(shear, 'N')}"] if shear else []
    wanted += [f"torque of {quantity(torque, 'N m')}"] if torque else []
    known = f" (friction.coefficient x normal_load = {quantity(bound, 'N')})" if z else ""
    return True, f"friction cannot carry the {listed(wanted, 'and the')}{known}"


def _advice(case: Problem, worst: Worst, doubtful: bool, adaptive: bool) -> list[str]:
    """Return what may help, the likeliest first."""
    mu, advice = case.friction_coefficient, []
    if case.frictional and math.isinf(mu) and worst.residual in ("R_n", "R_t"):
        advice.append(
            "a finite friction.coefficient of 2 to 5, which lets hardly any node slip: without slip a node "
            "at the edge may neither hold in contact nor outside of it"
        )
    if case.solver.tolerance < _ROUNDING:
        advice.append(f"solver.tolerance = 1e-10: below {_ROUNDING:g} rounding errors count")
    if doubtful:
        advice.append(
            "a prescribed motion in place of the load (shift_x, shift_y, twist), if friction cannot carry it"
        )
    if case.solver.algorithm == "incremental" and not adaptive:
        advice.append("more steps in this segment")
    if case.solver.tolerance >= _ROUNDING:
        advice.append("a larger solver.tolerance")
    return advice


# --- where ------------------------------------------------------------------------------------------------


def _worst(
    case: Problem,
    lattice: Lattice,
    solution: NormalSolution | ContactState,
    residuals: dict[str, float],
    values: tuple[float, ...],
) -> Worst:
    """Find the residual that is largest, and the node that it comes from."""
    sign = max(residuals, key=lambda name: residuals[name])
    value = residuals[sign]
    if not (solution.pressure > 0).any():
        return Worst(sign, value, what=_LOST)
    if sign not in ("R_n", "R_t"):
        return Worst(sign, value, what=_missed(sign, solution, values))
    mu = case.friction_coefficient if case.frictional else 0.0
    field = nodal_residuals(lattice, case.pair, mu, solution, tangential=sign == "R_t")
    row, col = (int(k) for k in np.unravel_index(int(np.argmax(field)), field.shape))
    if not math.isclose(field[row, col], value, rel_tol=_SAME):  # of another state than the one at hand
        return Worst(sign, value)
    x, y = float(lattice.x[row, col]), float(lattice.y[row, col])
    fault = (_normal_fault if sign == "R_n" else _tangential_fault)(case, solution, row, col)
    number = int(lattice.rows[row]), int(lattice.cols[col])
    place = f"row {number[0]}, column {number[1]}, x = {quantity(x, 'm')}, y = {quantity(y, 'm')}"
    return Worst(sign, value, *number, x, y, f"at the node in {place} {fault}")


def _missed(sign: str, solution: NormalSolution | ContactState, values: tuple[float, ...]) -> str:
    """Say which load is not met."""
    if sign == "R_P":
        return _instead("normal load", solution.normal_load, values[0], "N")
    if sign == "R_M":
        return _instead("torque", getattr(solution, "torque", math.nan), values[3], "N m")
    carried = [float(getattr(solution, f"tangential_load_{axis}", math.nan)) for axis in "xy"]
    off = [abs(have - want) for have, want in zip(carried, values[1:3], strict=True)]
    axis = int(np.argmax(off))
    return _instead(f"tangential load along {'xy'[axis]}", carried[axis], values[1 + axis], "N")


def _instead(name: str, carried: float, wanted: float, unit: str) -> str:
    return (
        f"the {name} that the tractions carry is {quantity(carried, unit)} instead of "
        f"{quantity(wanted, unit)}, off by {quantity(abs(carried - wanted), unit, 2)}"
    )


def _normal_fault(case: Problem, solution: NormalSolution | ContactState, row: int, col: int) -> str:
    pressure, gap = float(solution.pressure[row, col]), float(solution.gap[row, col])
    if pressure < 0:
        return f"there is a tension of {quantity(-pressure, 'Pa')}"
    if gap < 0:
        return f"the surfaces penetrate by {quantity(-gap, 'm')}"
    return f"there is a pressure of {quantity(pressure, 'Pa')} across a gap of {quantity(gap, 'm')}"


def _tangential_fault(case: Problem, solution: Any, row: int, col: int) -> str:
    traction = math.hypot(solution.traction_x[row, col], solution.traction_y[row, col])
    slip = math.hypot(solution.slip_increment_x[row, col], solution.slip_increment_y[row, col])
    if math.isinf(case.friction_coefficient):
        return f"the surfaces slip by {quantity(slip, 'm')}, which friction.coefficient = inf forbids"
    bound = case.friction_coefficient * float(solution.pressure[row, col])
    held = f"a shear traction of {quantity(traction, 'Pa')} where friction holds {quantity(bound, 'Pa')}"
    return f"there is {held}, with a slip of {quantity(slip, 'm')}"
