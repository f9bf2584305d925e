"""The error of a load step that did not converge: the worst condition, its node and size, and advice.

The residuals are those of docs/theory/residuals.md, node by node.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core import flat
from ..core.friction import LEAST, FrictionLaw
from ..core.lattice import Lattice
from ..errors import ConvergenceError
from ..problem.loads import LoadStep
from ..problem.problem import Problem
from ..text import counted, listed, quantity
from ..variables import RESIDUALS

_NEAR_SLIDING = 0.99  # share of mu P from which a tangential load may need full slip
_SLIDING = 1.0 - 1e-6  # ... from which it does
_TWISTED = 1.2  # moment over the largest under the pressure of a failed attempt, from which all slips
_ROUNDING = 1e-11  # tolerance below which rounding errors may decide
_SAME = 1e-3  # relative difference of residuals of one state
_LOST = "the last attempt lost all contact"
_INFINITE = 1e100  # value of the core for an error relative to zero


class Worst(NamedTuple):
    """The largest residual and its node, if it has one (row and column of the lattice)."""

    residual: str
    value: float
    row: int | None = None
    column: int | None = None
    x: float = math.nan
    y: float = math.nan
    what: str = ""


def error(
    case: Problem, lattice: Lattice, solution: Any, target: LoadStep, values: tuple[float, ...]
) -> ConvergenceError:
    """Return the error of a step that did not converge, or of gross sliding."""
    residuals = _residuals(case, solution, target)
    worst = _worst(case, lattice, solution, residuals, values)
    cuts = getattr(solution, "cuts", 0)
    details = {
        "step": target.index + 1,
        "label": target.label,
        "iterations": solution.sweeps,
        "halvings": cuts,
        "tolerance": case.solver.tolerance,
        "stopped": solution.stopped,
        "residuals": residuals,
        "worst": worst._asdict(),
    }
    segment = f" ({target.label})" if target.label else ""
    planned = f" of {case.planned_steps}" if case.planned_steps else ""
    step = f"step {target.index + 1}{planned}{segment}"
    shown = listed([f"{sign} = {_number(value)}" for sign, value in residuals.items()], "and")
    tried = f" and halving the step {counted(cuts, 'time')}" if cuts else ""
    after = f"after {counted(solution.sweeps, 'iteration')}{tried} the residuals are {shown}"
    doubtful, excess, expected = _sliding(case, lattice, solution, target, values)
    if excess:
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
    if _holds_a_shift(case, lattice, solution, target):
        lines.append(
            "no traction of a complete contact without slip takes up a shift of the mean planes: expected "
            "mean_traction_x or mean_traction_y in its place, or a finite friction.coefficient"
        )
    else:
        lines.append(f"to try: {'; or '.join(_advice(case, worst, doubtful, target.ramp is not None))}")
    return ConvergenceError("\n".join(lines), details)


def _residuals(case: Problem, solution: Any, target: LoadStep) -> dict[str, float]:
    """Return the residuals with a bound, by the symbol of the theory."""
    z, x, y, twist = (motion.control == "force" for motion in target.targets)
    bounded = {"R_n": True, "R_t": True, "R_P": z, "R_Q": x or y, "R_M": twist}
    if not case.frictional:
        bounded = {"R_n": True, "R_P": z}
    return {sign: float(getattr(solution, RESIDUALS[sign])) for sign, shown in bounded.items() if shown}


def _holds_a_shift(case: Problem, lattice: Lattice, solution: Any, target: LoadStep) -> bool:
    """Return whether a window that repeats is to be shifted, touches everywhere, and cannot slip."""
    shifted = any(motion.control != "force" for motion in (target.x, target.y))
    stuck = case.frictional and math.isinf(case.friction_coefficient) and lattice.periodic and shifted
    return stuck and bool((solution.pressure > 0.0).all())


def _number(value: float) -> str:
    return f"{value:.2e}" if value < _INFINITE else "inf"


def _sliding(
    case: Problem, lattice: Lattice, solution: Any, target: LoadStep, values: tuple[float, ...]
) -> tuple[bool, str, str]:
    """Return whether friction may not carry the load, and if it cannot, a sentence and the expected value."""
    if not case.frictional:
        return False, "", ""
    z, x, y, twist = (motion.control == "force" for motion in target.targets)
    shear, torque = math.hypot(x * values[1], y * values[2]), abs(twist * values[3])
    bound = case.friction_coefficient * values[0] if z else math.nan
    moment, largest = _moments(case, lattice, solution, target, values)
    seen = bool(getattr(solution, "sliding", False)) or (twist and abs(moment) > _TWISTED * largest > 0.0)
    doubtful = bool(torque or (shear and not shear <= _NEAR_SLIDING * bound))
    if not (seen or (shear and shear >= _SLIDING * bound)):
        return doubtful and not math.isinf(case.friction_coefficient), "", ""
    of_load = values[3] - moment
    if twist and abs(of_load) > abs(values[3]) and abs(moment) > 0.5 * largest and not shear >= bound:
        place = [quantity(at, "m") for at in _center(lattice, solution)]
        return (
            True,
            f"friction cannot carry the moment of {quantity(moment, 'N m')} about the contact at "
            f"x = {place[0]}, y = {place[1]} (at most {quantity(largest, 'N m')}), since the tangential load "
            "acts at x = y = 0",
            f"expected twist = 0 in place of the torque, a torque of {quantity(of_load, 'N m')}, or surfaces "
            "that touch at x = y = 0",
        )
    loads = [f"tangential load of {quantity(shear, 'N')}"] if shear else []
    loads += [f"torque of {quantity(torque, 'N m')}"] if torque else []
    known = f" (friction.coefficient x normal_load = {quantity(bound, 'N')})"
    known = known if shear and math.isfinite(bound) else ""
    motions = ", ".join(
        motion for _, motion in [*target.drives.values()][1 : 3 if lattice.periodic else None]
    )
    expected = f"expected a smaller load, or a prescribed motion in its place ({motions})"
    return True, f"friction cannot carry the {listed(loads, 'and the')}{known}", expected


def _center(lattice: Lattice, solution: Any) -> tuple[float, float]:
    """Return the centroid of the pressure; the origin without any."""
    if not solution.pressure.any():
        return 0.0, 0.0
    x, y = (float(np.average(place, weights=solution.pressure)) for place in (lattice.x, lattice.y))
    return x, y


def _moments(
    case: Problem, lattice: Lattice, solution: Any, target: LoadStep, values: tuple[float, ...]
) -> tuple[float, float]:
    """Return the moment (N m) of the loads about the contact, and the largest that friction carries."""
    x, y = _center(lattice, solution)
    loads = zip(values[1:3], (target.x, target.y), strict=True)
    load_x, load_y = (value * (motion.control == "force") for value, motion in loads)
    arm = np.hypot(lattice.x - x, lattice.y - y)
    mu = case.friction_coefficient  # NaN of another law: unknown
    largest = mu * lattice.cell_area * float(np.sum(solution.pressure * arm))
    return values[3] - (x * load_y - y * load_x), largest


def _advice(case: Problem, worst: Worst, doubtful: bool, adaptive: bool) -> list[str]:
    """Return advice, the likeliest first."""
    mu, advice = case.friction_coefficient, []
    if case.solver.iteration == "dissertation":
        return ['solver.iteration = "newton"; or a larger solver.tolerance']
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


# --- the node ---------------------------------------------------------------------------------------------


def _worst(
    case: Problem,
    lattice: Lattice,
    solution: Any,
    residuals: dict[str, float],
    values: tuple[float, ...],
) -> Worst:
    """Return the largest residual and its node."""
    sign = max(residuals, key=lambda name: residuals[name])
    value = residuals[sign]
    if not (solution.pressure > 0).any():
        return Worst(sign, value, what=_LOST)
    if sign not in ("R_n", "R_t"):
        return Worst(sign, value, what=_missed(sign, solution, values))
    law = case.friction_law(lattice)
    given = lattice, case.solved_pair, case.interface
    if sign == "R_n":
        field = flat.normal_residual(*given, solution.pressure, solution.gap)
    else:  # a copy: the slip may be that of several parts of the step
        field = flat.tangential_residual(*given, law, solution.copied())
    row, col = (int(k) for k in np.unravel_index(int(np.argmax(field)), field.shape))
    if not math.isclose(field[row, col], value, rel_tol=_SAME):  # of another state
        return Worst(sign, value)
    x, y = float(lattice.x[row, col]), float(lattice.y[row, col])
    fault = (_normal_fault if sign == "R_n" else _tangential_fault)(law, solution, row, col)
    number = int(lattice.rows[row]), int(lattice.cols[col])
    place = f"row {number[0]}, column {number[1]}, x = {quantity(x, 'm')}, y = {quantity(y, 'm')}"
    return Worst(sign, value, *number, x, y, f"at the node in {place} {fault}")


def _missed(sign: str, solution: Any, values: tuple[float, ...]) -> str:
    """Return a sentence on the load that is not met."""
    if sign == "R_P":
        return _instead("normal load", solution.normal_load, values[0], "N")
    if sign == "R_M":
        return _instead("torque", getattr(solution, "torque", math.nan), values[3], "N m")
    carried = [float(getattr(solution, f"tangential_load_{axis}", math.nan)) for axis in "xy"]
    off = [abs(have - want) for have, want in zip(carried, values[1:3], strict=True)]
    axis = int(np.argmax(off))
    return _instead(f"tangential load along {'xy'[axis]}", carried[axis], values[1 + axis], "N")


def _instead(name: str, carried: float, expected: float, unit: str) -> str:
    return (
        f"the {name} that the tractions carry is {quantity(carried, unit)} instead of "
        f"{quantity(expected, unit)}, off by {quantity(abs(carried - expected), unit, 2)}"
    )


def _normal_fault(law: FrictionLaw, solution: Any, row: int, col: int) -> str:
    pressure, gap = float(solution.pressure[row, col]), float(solution.gap[row, col])
    if pressure < 0:
        return f"there is a tension of {quantity(-pressure, 'Pa')}"
    if gap < 0:
        return f"the surfaces penetrate by {quantity(-gap, 'm')}"
    return f"there is a pressure of {quantity(pressure, 'Pa')} across a gap of {quantity(gap, 'm')}"


def _tangential_fault(law: FrictionLaw, solution: Any, row: int, col: int) -> str:
    along = solution.traction_x, solution.traction_y
    traction = math.hypot(*(component[row, col] for component in along))
    slip = math.hypot(solution.slip_increment_x[row, col], solution.slip_increment_y[row, col])
    bound = float(law.bounds(solution.pressure, *along)[row, col])
    if math.isinf(bound):
        return f"the surfaces slip by {quantity(slip, 'm')}, which friction.coefficient = inf forbids"
    held = f"a shear traction of {quantity(traction, 'Pa')} where friction holds {quantity(bound, 'Pa')}"
    return f"there is {held}, with a slip of {quantity(slip, 'm')}"
