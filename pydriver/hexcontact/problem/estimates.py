"""Rough estimates of the work of a case before a run."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

from .problem import Problem
from .refinement import coarser, least_and_most

# Operator applications of a load step to 1e-8, measured on meshes of 20 to 60 spacings in the radius.
# Without friction they are of the pressure alone, a third of an application each.
_FRICTIONLESS, _SIMILAR, _DISSIMILAR = 8 / 3, 12.0, 27.0
_INTERPOLATED = 4.0  # times as many in steps in which nodes enter the contact
_ADAPTIVE, _ADAPTIVE_SIMILAR = 30, 6  # solutions in a segment of adaptive steps, within a factor of 3

# Seconds per application and node of the window on one core of about 2020, all other work included.
_SECONDS_FRICTIONLESS, _SECONDS = 2e-7, 1.3e-7
_SECONDS_LEAST = 5e-3  # of a step

# Operator applications of a load step in a cycle that wears, which starts from the cycle before, by coupling;
# cycles that jumps of "auto" solve, within a factor of 3, over the tolerance to -1/2.
_WORN, _WORN_COUPLED = 4.0, 16.0
_JUMPS = 2.0


def operator_applications(case: Problem) -> float | None:
    """Estimate the operator applications of all load steps; None for the direct method."""
    if case.method_for(case.lattice) == "direct":
        return None
    if not case.frictional:
        return _FRICTIONLESS * len(case.load_steps)
    each = _DISSIMILAR if case.coupled else _SIMILAR
    entering = 0
    if case.solver.algorithm == "incremental" and case.solver.entry == "interpolated":
        loads = [0.0, *(step.z.value for step in case.load_steps)]
        entering = sum(after > before for before, after in pairwise(loads))
    share = entering / len(case.load_steps)
    worn = _WORN_COUPLED if case.coupled else _WORN
    return each * (1.0 + (_INTERPOLATED - 1.0) * share) * _solutions(case) + worn * _worn_steps(case)


def cycles(case: Problem) -> int:
    """Return the number of cycles that are solved to wear the surfaces; a guess where jumps are chosen."""
    wear = case.deck.wear
    if wear is None:
        return 0
    if isinstance(wear.jump, str):
        return min(math.ceil(_JUMPS * wear.tolerance**-0.5), wear.cycles) + 1
    return math.ceil(wear.cycles / wear.jump) + 1


def _worn_steps(case: Problem) -> int:
    """Return the number of load steps in these cycles, with the ones onto the worn gap."""
    return cycles(case) * (1 + len(case.cycle))


def _solutions(case: Problem) -> int:
    """Return the number of solutions of a case; a guess for segments with chosen steps."""
    adaptive = sum(step.ramp is not None for step in case.load_steps) if case.adaptive else 0
    each = _ADAPTIVE if case.coupled else _ADAPTIVE_SIMILAR
    return len(case.load_steps) - adaptive + each * adaptive


def seconds(case: Problem) -> float | None:
    """Estimate the time of a run on one core (s); None for the direct method."""
    applications = operator_applications(case)
    if applications is None:
        return None
    each = (_SECONDS if case.frictional else _SECONDS_FRICTIONLESS) * case.lattice.size
    return applications * each + _SECONDS_LEAST * (_solutions(case) + _worn_steps(case))


def work(case: Problem) -> str:
    """Return the estimate in words: "about 1,800 operator applications, about 4 s on one core"."""
    runs = [*least_and_most(case)] if case.accuracy else [[case]]
    smaller = [coarser(cases[-1]) if case.estimates_tables else [] for cases in runs]
    applications = [
        _total([*map(operator_applications, cases), *(_on_finer(one, cases[-1]) for one in more)])
        for cases, more in zip(runs, smaller, strict=True)
    ]
    times = [_total(map(seconds, [*cases, *more])) for cases, more in zip(runs, smaller, strict=True)]
    if None in applications or None in times:
        return "LAPACK on the nodes in contact, not estimated"
    count = " to ".join(f"{_rounded(number):,}" for number in applications if number)
    durations = " to ".join(dict.fromkeys(_duration(time) for time in times if time))
    guess = "; load steps are chosen on the way, so a third or three times as much may be needed"
    wear = case.deck.wear
    chosen = f"; {cycles(case)} cycles are guessed, since jumps are chosen on the way" if wear else ""
    unworn = (
        "; unlike bodies repeat the unworn cycle until it closes, 3 to some 40 times"
        if wear and case.coupled
        else ""
    )
    guess = guess * case.adaptive + chosen * (wear is not None and isinstance(wear.jump, str))
    return f"about {count} operator applications, about {durations} on one core{guess}{unworn}"


def _on_finer(case: Problem, finer: Problem) -> float | None:
    """Return the work of a case in operator applications on a finer lattice."""
    applications = operator_applications(case)
    return None if applications is None else applications * case.lattice.size / finer.lattice.size


def _total(parts: Iterable[float | None]) -> float | None:
    """Return the sum, or None if a part is unknown."""
    known = list(parts)
    return None if None in known else sum(part for part in known if part is not None)


def _rounded(number: float) -> int:
    """Round to two digits."""
    return round(float(f"{number:.2g}"))


def _duration(time: float) -> str:
    if time < 1:
        return "a second or less"
    for size, name in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if time >= 2 * size:
            return f"{_rounded(time / size)} {name}"
    return f"{_rounded(time)} s"
