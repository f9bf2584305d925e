"""Preview of a problem before its run: its table, its parameters, its lattices, its work.

Shifted copies of a lattice have its spacing and origins moved by fractions of it, for estimates of errors
(docs/theory/error_bars.md, (A2)).
"""

from __future__ import annotations

import functools
import math
import os
import platform
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, get_args

from ..core.contact import CoatedPair
from ..core.lattice import Lattice
from ..deck.keys import Body, Bulk, Coating
from ..deck.kinds import Quantity
from ..deck.surfaces import Roller, Surface, SurfaceSum
from ..text import Row, counted, percent, quantity
from ..variables import BULK_STRESS, INTERFACE, LOADS, SHEAR_LIMIT
from . import plausibility
from .loads import LoadStep
from .problem import LEAST_LEVELS, Problem

# Origins of the shifted copies, in spacings along both basis vectors: multiples of (1/g, 1/g^2) with
# g^3 = g + 1, which no row or symmetry of the lattice maps to each other.
SHIFTS = ((0.7549, 0.5698), (0.5098, 0.1397), (0.2647, 0.7095), (0.0195, 0.2794))


class Trial(NamedTuple):
    """A lattice of a refinement."""

    level: int  # how often it was refined
    copy: int = 0  # 0: the lattice itself, else the number of its shifted copy

    def case(self, case: Problem) -> Problem:
        """Return the case on this lattice."""
        return case.refined(self.level, SHIFTS[self.copy - 1] if self.copy else (0.0, 0.0))

    @property
    def name(self) -> str:
        """Name: "lattice 3", "lattice 1, shifted (2 of 4)"."""
        shifted = f", shifted ({self.copy} of {len(SHIFTS)})" if self.copy else ""
        return f"lattice {self.level + 1}{shifted}"


def coarser(case: Problem, level: int = 0) -> list[Problem]:
    """Return a case on the lattice of twice the spacing of a level, and on its shifted copies."""
    return [Trial(level - 2, copy).case(case) for copy in range(1 + len(SHIFTS))]


def least_and_most(case: Problem) -> tuple[list[Problem], list[Problem]]:
    """Return a case on all lattices of the shortest refinement, and of the longest within max_nodes.

    The last one is the finest.
    """
    assert case.accuracy is not None
    coarse, levels = Trial(0).case(case), [Trial(level).case(case) for level in range(LEAST_LEVELS)]
    least = [coarse] * len(SHIFTS) + levels
    while (finer := Trial(len(levels)).case(case)).lattice.size <= case.accuracy.max_nodes:
        levels.append(finer)
    return least, [*(levels[: 1 - LEAST_LEVELS] * len(SHIFTS)), *levels]


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


def parameters_of(case: Problem) -> dict[str, Any]:
    """Return the parameters of a case, its solver and the machine."""
    deck, solver, wear = case.deck, case.solver, case.deck.wear
    found = {
        **_pair_parameters(case),
        "friction_coefficient": case.friction_coefficient,
        "friction_law": law_in_words(case) if math.isnan(case.friction_coefficient) else None,
        SHEAR_LIMIT: (deck.friction and deck.friction.shear_limit) or None,
        **(dict(zip(INTERFACE, case.interface, strict=True)) if deck.interface else {}),
        "algorithm": solver.algorithm,
        "coupling": solver.coupling,
        "entry": solver.entry,
        "iteration": solver.iteration if solver.iteration != "newton" else None,
        "tolerance": solver.tolerance,
        "measured_surfaces": _measured(case) if case.maps and not case.gap_given else None,
        "bulk_state": deck.bulk and deck.bulk.state,
        "step_tolerance": solver.step_tolerance if case.adaptive else None,
        "cycle_tolerance": wear and wear.cycle_tolerance(solver.tolerance),
        "wear_tolerance": wear and wear.tolerance,
        "accuracy_target": case.accuracy and case.accuracy.target,
        "warnings": "\n".join(plausibility.warnings(case)) or None,
        "notes": "\n".join(plausibility.notes(case).values()) or None,
        "machine": machine(),
    }
    return {name: value for name, value in found.items() if value is not None}


def _measured(case: Problem) -> str:
    """Return the files of measured surfaces, and how they are read."""
    measured = case.surfaces.measured
    return "; ".join(f"{one.shape} of body {number}: {one.points.about}" for number, one in measured)


def _pair_parameters(case: Problem) -> dict[str, Any]:
    """Return the constants of two half-spaces, or the coatings and the fit of their kernels."""
    pair = case.pair
    if not isinstance(pair, CoatedPair):
        names = "effective_modulus", "dundurs_beta", "tangential_compliance_ratio"
        return dict(zip(names, (pair.effective_modulus, pair.beta, pair.gamma), strict=True))
    layers = [
        f"body {number}: {_layer(layer)}"
        for number, body in enumerate((case.body_1, case.body_2), 1)
        for layer in body.coating
    ]
    fit = {"coating_images": pair.images, "coating_fit_error": pair.fit_error}
    return {"coating": "; ".join(layers), **fit}


@functools.cache
def machine() -> str:
    """Describe the machine: "node7, Linux x86_64, 16 processors"."""
    count = os.cpu_count() or 1
    return f"{platform.node()}, {platform.system()} {platform.machine()}, {counted(count, 'processor')}"


def case_rows(case: Problem, memory: Callable[[Problem, Lattice], int] | None = None) -> list[Row]:
    """Return the rows of an overview of a case."""
    lattice, pair, bulk, solver = case.lattice, case.pair, case.deck.bulk, case.solver
    # without the coordinates, for which the window may be too large; a period has a cell for each node
    ends = 0 if lattice.periodic else 1
    width, height = [lattice.n_col - ends, lattice.n_row - ends] @ abs(lattice.basis)
    constants = (
        f"E* = {quantity(pair.effective_modulus, 'Pa')}, beta = {pair.beta:.4g}, gamma = {pair.gamma:.4g}"
    )
    if isinstance(pair, CoatedPair):
        images = counted(pair.images, "image")
        constants = f"coated, coupling up to {pair.beta:.4g}; {images}, error {pair.fit_error:.1g}"
    size = f"{quantity(width, 'm')} x {quantity(height, 'm')}"
    last = [cases[-1] for cases in least_and_most(case)] if case.accuracy else [case]
    accuracy = case.accuracy and (
        f"target {percent(case.accuracy.target)}: spacing and window are of the first lattice, the last "
        f"has {' to '.join(quantity(one.lattice.spacing, 'm') for one in last)} "
        f"({' to '.join(f'{one.lattice.size:,}' for one in last)} nodes)"
    )
    interface = ""
    if case.deck.interface:
        coefficient, exponent, stiffness = case.interface
        interface = f"p = c ψ^m under penetration ψ, m = {exponent:g}, c = {coefficient:.6g} Pa/m^"
        interface += f"{exponent:g}" + (f", tangential springs of {stiffness:.6g} Pa/m" if stiffness else "")
    iteration = ", iteration of the dissertation" * (solver.iteration == "dissertation")
    rows = [
        ("body 1", _body(case.body_1)),
        ("body 2", _body(case.body_2)),
        ("gap", str(case.plane_gap.map or "")),
        *(
            (f"{one['shape']} of body {one['body']}" if not place else "", words)
            for one in surfaces_in_words(case)
            for place, words in enumerate(one["lines"])
        ),
        ("pair", constants),
        ("interface", interface),
        ("friction", _friction(case)),
        ("contact", plausibility.row(case)),
        ("plane contact", _plane_contact(case)),
        ("contact", "full, one unknown: p = P/A over all nodes" if case.full_contact else ""),
        ("spacing", lattice.cells),
        (
            "window",
            f"{lattice.n_row} x {lattice.n_col} nodes ({lattice.size:,}), {size}, "
            f"{'repeats' if case.period else 'fixed' if case.window_fixed else 'grows with the contact'}",
        ),
        ("accuracy", accuracy or ""),
        ("bulk stress", _bulk(bulk, case.load_steps) if bulk else ""),
        ("load steps", _history(case)),
        ("largest load", _largest(case)),
        ("method", f"{case.method_for(lattice)}{iteration}, tolerance {solver.tolerance:g}"),
        ("memory", " to ".join(quantity(memory(one, one.lattice), "B", 3) for one in last) if memory else ""),
        ("work", work(case)),
    ]
    return [row for row in rows if row[1]]


def _plane_contact(case: Problem) -> str:
    """Return half-width and pressure of plane contact beside a roller on a flat; empty for others."""
    roller, load = case.surfaces.only_curved, largest_loads(case)["normal_load"]
    other = case.deck.interface or isinstance(case.pair, CoatedPair)
    if not isinstance(roller, Roller) or not load or other:
        return ""
    half_width, pressure = roller.plane_contact(case.pair.effective_modulus, load)
    by_length, width = quantity(load / roller.length, "N/m"), quantity(half_width, "m")
    return f"{by_length}: half-width {width}, p_max {quantity(pressure, 'Pa')} between the ends"


def law_in_words(case: Problem) -> str:
    """Describe the law of friction of a case."""
    friction, layer = case.deck.friction, case.deck.interface
    if friction is None and layer and layer.friction_limit:
        exponent = layer.friction_exponent or layer.exponent
        return f"limit {layer.friction_coefficient:.6g} Pa/m^{exponent:g} ψ^{exponent:g} of the interface"
    return str(friction)


def _friction(case: Problem) -> str:
    if not case.frictional:
        return "none"
    solver = case.solver
    interpolated = solver.algorithm == "incremental" and solver.entry == "interpolated"
    goodman = ", shear does not move the pressure" * (solver.coupling == "goodman")
    return f"{law_in_words(case)}, {solver.algorithm}{', entry interpolated' * interpolated}{goodman}"


def _bulk(bulk: Bulk, steps: Sequence[LoadStep]) -> str:
    """Return the largest components of the bulk stress, and the body that carries it."""
    largest = [max(values, key=abs) for values in zip(*(step.bulk for step in steps), strict=True)]
    parts = [
        f"{quantity(value, 'Pa')} along {name[-2:]}"
        for name, value in zip(BULK_STRESS, largest, strict=True)
        if value
    ]
    return f"body {bulk.body}, {bulk.state}: {', '.join(parts) or 'none'}"


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
        where = counted(chosen, "segment")
        fixed = f", and {given} that {'are' if given > 1 else 'is'} given" * (given > 0)
        return f"adaptive in {where} (step_tolerance {case.solver.step_tolerance:g}){fixed}{gaps}"
    wears = ""
    if wear := case.deck.wear:
        auto = isinstance(wear.jump, str)
        solved = 'a number that the run finds (jump "auto")' if auto else f"{cycles(case):,}"
        wears = f", then {solved} of {counted(f'{wear.cycles:,}', 'cycle')}, with {1 + len(case.cycle)} each"
    return f"{len(case.load_steps)}" + (f" in {segments} segments" if segments > 1 else "") + wears + gaps


def _largest(case: Problem) -> str:
    """Describe the largest prescribed load along each direction."""
    normal, *tangential = largest_loads(case).values()
    words = quantity(normal, "N") if normal else "follows from the approach"
    along = zip(tangential, "xy", strict=True)
    found = [words, *(f"{quantity(load, 'N')} along {axis}" for load, axis in along if load)]
    if case.period and normal:
        found[0] += f" (mean pressure {quantity(normal / case.period.area, 'Pa')})"
    return ", ".join(found)


def largest_loads(case: Problem) -> dict[str, float]:
    """Return the largest prescribed normal and tangential loads (N), 0 without one."""
    targets = {direction: [getattr(step, direction) for step in case.load_steps] for direction in "zxy"}
    return {
        LOADS[direction][0]: max((abs(t.value) for t in along if t.control == "force"), default=0.0)
        for direction, along in targets.items()
    }


def _body(body: Body) -> str:
    stiffness = "rigid" if body.rigid else _elastic(body)
    coatings = "".join(f"; coating {_layer(layer)}" for layer in body.coating)
    return f"{stiffness}{coatings}; {_surface(body.surface)}"


def _elastic(of: Body | Coating) -> str:
    return f"E = {quantity(of.young_modulus or math.nan, 'Pa')}, nu = {of.poisson_ratio:g}"


def _layer(layer: Coating) -> str:
    return f"{quantity(layer.thickness, 'm')}, {_elastic(layer)}"


def surfaces_in_words(case: Problem) -> list[dict[str, Any]]:
    """Return how measured and rough surfaces are read: body, shape and lines of words."""
    return [
        {"body": int(key[1]), "shape": one.shape, "lines": lines}
        for key, one in case.surfaces.keyed
        if (lines := [*one.rows(case.lattice.apart)])
    ]


def _surface(surface: Surface | None) -> str:
    if surface is None:
        return "flat"
    if isinstance(surface, SurfaceSum):
        return " + ".join(map(_surface, surface.parts))
    measured = surface.measured == (surface,)
    given = [str(surface) if measured else surface.shape]
    for name, field in type(surface).model_fields.items():
        value = getattr(surface, name)
        if name == "shape" or value == field.default or (measured and name not in ("offset", "tilt")):
            continue
        kinds = (*field.metadata, *(kind for one in get_args(field.annotation) for kind in get_args(one)))
        unit = next((kind.dimension.unit for kind in kinds if isinstance(kind, Quantity)), "")
        if name == "offset":
            given.append(f"{name} ({', '.join(quantity(part, 'm') for part in value)})")
        elif name == "tilt":
            given.append(f"{name} ({', '.join(f'{math.degrees(part):.6g} deg' for part in value)})")
        elif unit == "rad":
            given.append(f"{name} {math.degrees(value):.6g} deg")
        else:
            given.append(f"{name} {quantity(value, unit) if isinstance(value, float) else value}")
    return ", ".join(given)


# --- the work of a run --------------------------------------------------------------------------------------


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
    solutions, worn_steps = _solutions(case)
    return each * (1.0 + (_INTERPOLATED - 1.0) * share) * solutions + worn * worn_steps


def cycles(case: Problem) -> int:
    """Return the number of cycles that are solved to wear the surfaces; a guess where jumps are chosen."""
    wear = case.deck.wear
    if wear is None:
        return 0
    if isinstance(wear.jump, str):
        return min(math.ceil(_JUMPS * wear.tolerance**-0.5), wear.cycles) + 1
    return math.ceil(wear.cycles / wear.jump) + 1


def _solutions(case: Problem) -> tuple[int, int]:
    """Return the number of solutions, a guess where steps are chosen, and that of load steps in cycles.

    Each cycle begins with a step onto the worn gap.
    """
    adaptive = sum(step.ramp is not None for step in case.load_steps) if case.adaptive else 0
    each = _ADAPTIVE if case.coupled else _ADAPTIVE_SIMILAR
    return len(case.load_steps) + (each - 1) * adaptive, cycles(case) * (1 + len(case.cycle))


def seconds(case: Problem) -> float | None:
    """Estimate the time of a run on one core (s); None for the direct method."""
    applications = operator_applications(case)
    if applications is None:
        return None
    each = (_SECONDS if case.frictional else _SECONDS_FRICTIONLESS) * case.lattice.size
    return applications * each + _SECONDS_LEAST * sum(_solutions(case))


def work(case: Problem) -> str:
    """Return the estimate in words: "about 1,800 operator applications, about 4 s on one core"."""
    runs = [[*cases] for cases in (least_and_most(case) if case.accuracy else ([case],))]
    found: Any = [[(operator_applications(one), seconds(one)) for one in cases] for cases in runs]
    below = (*case.deck.stress, *case.deck.fatigue)
    estimates = any(table.estimate_error or case.accuracy for table in below)
    for known, finest in zip(found, (cases[-1] for cases in runs), strict=True):
        for one in coarser(finest) if estimates else []:  # counted on the finest lattice
            number, share = operator_applications(one), one.lattice.size / finest.lattice.size
            known.append((None if number is None else number * share, seconds(one)))
    if any(None in estimate for run in found for estimate in run):
        return "LAPACK on the nodes in contact, not estimated"
    applications, times = zip(*(map(math.fsum, zip(*run, strict=True)) for run in found), strict=True)
    count = " to ".join(f"{_rounded(number):,}" for number in applications if number)
    durations = " to ".join(dict.fromkeys(_duration(time) for time in times if time))
    words = f"about {count} operator applications, about {durations} on one core"
    words += "; stress below the surface not counted" * bool(below)
    if case.adaptive:
        words += "; adaptive load steps: uncertain by a factor of 3"
    if wear := case.deck.wear:
        chosen = isinstance(wear.jump, str)
        words += (
            f"; {counted(cycles(case), 'cycle is', 'cycles are')} guessed, since jumps are adaptive" * chosen
        )
        repeated = "; unlike bodies repeat the unworn cycle until it closes, 3 to some 40 times"
        words += repeated * case.coupled
    return words


def _rounded(number: float) -> int:
    """Round to two digits."""
    return round(float(f"{number:.2g}"))


def _duration(time: float) -> str:
    for size, name in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if time >= 2 * size:
            return f"{_rounded(time / size)} {name}"
    return f"{_rounded(time)} s" if time >= 1 else "a second or less"
