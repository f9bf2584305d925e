"""Checks before a run whether half-space theory, the lattice and the load steps suit a case.

Expected values follow from the estimate of the contact; a table has their limits, with warning and reason.
The rules for errors are those of the core (fortran/path/expected_error.f90).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..core.flat import LatticeErrors, expected_lattice_errors, slip_ring, turning_errors
from ..core.measures import NO_VALUE, expected_entry_error
from ..deck.interface import TwoCoefficients
from ..deck.rough import Rough
from ..deck.surfaces import Cone
from ..text import counted, listed, percent, quantity
from ..variables import LOADS, spelled
from .loads import LoadStep
from .problem import Problem


class Limit(NamedTuple):
    """A limit of an expected value."""

    quantity: str  # one of `expected`
    words: str  # the warning, with quantities in braces
    reason: str  # reason for the limit, with its source
    least: float = -math.inf  # range without a warning
    most: float = math.inf


_EDGE_SPACINGS = 18  # in the radius, from which nodes lie near enough to the peak of a fatigue parameter
_LATTICE_ERROR = 0.05  # of any quantity, that the lattice may leave
_STEP_ERROR = 0.1  # of the shear tractions, that load steps may leave
LIMITS = (
    Limit(
        "slope",
        "{steepest} by {slope:.2g}{gap_words} at the edge of the contact (a/R of a sphere), expected at most "
        "0.1: half-space theory takes them as flat",
        "Points at the edge move inwards, by 2 (1 - 2 nu) / (3 pi (1 - nu)) a/R of their distance under a "
        "sphere, which the theory leaves out: 1.2 % at a/R = 0.1 and nu = 0.3 (for cones: Hay, Bolshakov, "
        "Pharr, Journal of Materials Research 14, 1999, 2296)",
        most=0.1,
    ),
    Limit(
        "rms_slope",
        "the rough surfaces slope by {rms_slope:.2g} (rms), expected at most 0.1: the pressure in their "
        "spots is about half of that times E*, where strains are not small and most solids yield",
        "Real area over window is 2 p/(E* h') under a mean pressure p, h' the rms slope, so that spots bear "
        "E* h'/2 (Hyun and Robbins, Tribology International 40, 2007, 1413): 0.05 E* at the limit",
        most=0.1,
    ),
    Limit(
        "pressure_ratio",
        "the largest pressure is {pressure_ratio:.2g} E*, expected at most 0.05: beyond, strains are not "
        "small and solids other than rubber yield",
        "Strains are about p_max/E*, and linear elasticity leaves out their squares; von Mises's stress is "
        "0.62 p_max below a sphere, so that a body yields at 1.6 (1 - nu^2) Y/E: 0.014 for a steel with "
        "Y = 2 GPa",
        most=0.05,
    ),
    Limit(
        "pressure_ratio",
        "the largest pressure is only {pressure_ratio:.2g} E*, expected at least 1e-4: below, roughness or "
        "adhesion carry the contact, or a unit is wrong",
        "Smooth theory is within 7 % up to a roughness of 0.05 a^2/R (Greenwood, Johnson, Matsubara, Wear "
        "100, 1984, 47); p_max/E* = 0.64 a/R, so that this is 8 nm for a = 1 mm at the limit",
        least=1e-4,
    ),
    Limit(
        "young_modulus",
        "a Young's modulus of {young_modulus:g} Pa is below that of rubber, expected at least 1e6: bare "
        "numbers are in m, N and Pa, not in mm and MPa",
        "Rubber has 1 MPa and more; a modulus in MPa, taken as Pa, is below 1.2e6 for every solid",
        least=1e6,
    ),
    Limit(
        "friction_coefficient",
        "friction.coefficient = {friction_coefficient:g}, expected at most 3 (was it in percent?), or inf "
        "for no slip",
        "Tables of dry pairs end at 1.6, copper on copper (Physics Fundamentals, eCampusOntario, table A.1); "
        "3 leaves room for rubber",
        most=3.0,
    ),
    Limit(
        "lattice_error",
        "{spacing_words} in the {radius_words} may leave errors of {lattice_words}; "
        "{needed_spacings:g} leave at most 5 %",
        "Errors fall with the square of the spacings, or faster: (X1), (X2)",
        most=_LATTICE_ERROR,
    ),
    Limit(
        "edge_spacings",
        "{edge_tables}: {edge_spacings_words} in the {radius_words} are too few for the largest value "
        "at the surface: it lies at the edge of the contact, between nodes, where stresses fall by a tenth "
        f"within a tenth of a spacing; expected at least {_EDGE_SPACINGS}, or points deeper than a spacing",
        "The stress falls from the edge like the root of the distance: at 20 spacings by 7 % of p_max in a "
        "twentieth of a spacing, by 18 % in 0.3 spacings",
        least=_EDGE_SPACINGS,
    ),
    Limit(
        "step_error",
        "the contact grows in {growing_words}, which leaves an error of about {step_percent} "
        "in the shear tractions (rings of nodes that enter together); {needed_steps:.2g} steps leave 10 %, "
        'solver.entry = "interpolated" less at two to six times the work of a step',
        "Nodes that enter are charged with the slip of the whole step: (X3) to (X5)",
        most=_STEP_ERROR,
    ),
    Limit(
        "spacings_between_points",
        "the points of the height map are {spacings_between_points:.2g} spacings apart, expected at most 10: "
        "the nodes between them add no information; choose a larger spacing",
        "A spline of points that are further apart than the wavelengths of a surface has none of its waves",
        most=10.0,
    ),
    Limit(
        "points_between_nodes",
        "the nodes are {points_between_nodes:.2g} points of the height map apart, expected at most 5: those "
        "between them do not count; choose a smaller spacing, or average the heights",
        "Waves shorter than two spacings appear as longer ones (Shannon, Proc. IRE 37, 1949, 10)",
        most=5.0,
    ),
    Limit(
        "layer_spacings",
        "the thinnest coating has {layer_spacings_words}, expected at least 2: the lattice does not "
        "resolve tractions that vary over its thickness",
        "Kernels hold for any thickness; tractions that are linear between nodes have no waves shorter than "
        "two spacings",
        least=2.0,
    ),
    Limit(
        "wave_spacings",
        "the shortest wave of the surfaces has {wave_spacings_words}, expected at least 4: the "
        "lattice does not resolve it",
        "Tractions that are linear between nodes have no waves shorter than two spacings",
        least=4.0,
    ),
    Limit(
        "end_cells",
        "cells of {end_cell} along the axis of the logarithmic roller do not resolve its ends, expected at "
        "most {end_needed}: the largest pressure may be up to a quarter too large",
        "Contact ends within (1 - P/P_design) b of the end, b the half-width of plane contact under the "
        "design load; with longer cells p_max rose by up to 24 % on rollers of 12 to 100 b, with shorter "
        "ones by 5 %",
        most=1.0,
    ),
    Limit(
        "holes_near_contact",
        "{holes_words} near the estimated contact: a contact that comes "
        "within two points of one ends the run; fill them, as by gap.interpolate_na",
        "Contact beside a hole would end there only because the data do",
        most=0.0,
    ),
    Limit(
        "turning_error",
        "the tangential load turns in its steps, so that nodes slip in directions that turn: this leaves an "
        "error of about {turning_percent} in the dissipated energy; {turning_steps:g} steps in place of each "
        "leave 10 %",
        "A node slips against its traction at the end of the step, which has turned: (X6)",
        most=_STEP_ERROR,
    ),
    Limit(
        "ring_spacings",
        "the slip annulus of the tangential loop is {ring_spacings_words} wide, expected at least 1: "
        "its dissipated energy may be off by {ring_percent}",
        "A ring of nodes sticks or slips as a whole: (X2)",
        least=1.0,
    ),
)
"""All limits, in the order of the warnings."""

_OPEN = (-math.inf, math.inf)
_IN_SPACINGS = ("edge_spacings", "layer_spacings", "wave_spacings", "ring_spacings")
_CORNERS = ("points", "line", "plane")  # keys of a region that has depths
_ASSUMED = 0.5  # Q/mu P of shear that is prescribed by a motion: a ring of a fifth of the radius
_NOTICED = 0.2  # Q/mu P below which slip dissipates next to no energy
_ALIKE = 0.02  # beta up to which the shear of pressing is less than 1.5 % of the pressure
_ROUND = 0.95  # smaller half-axis over radius from which an estimated contact counts as a circle
_STEADY = 0.05  # exponent of the radius on the load up to which a contact does not grow: punches
_ROUNDED = 1e-6  # spacings by which a rolled distance may differ from a whole number of them


def expected(case: Problem, estimated: bool = True) -> dict[str, Any]:
    """Return the known expected values at the largest load, SI."""
    known, lattice = case.estimate if estimated else None, case.lattice
    coarse = lattice.spacing * max(1.0, lattice.cell_ratio)
    found: dict[str, Any] = {}
    layers = [layer for body in (case.body_1, case.body_2) for layer in body.coating]
    solids: list[Any] = [case.body_1, case.body_2, *layers]
    if moduli := [solid.young_modulus for solid in solids if solid.young_modulus]:
        found["young_modulus"] = min(moduli)
    if layers:
        found["layer_spacings"] = min(layer.thickness for layer in layers) / coarse
    if waves := [getattr(part, part.wave) for part in case.shapes if part.wave]:
        found["wave_spacings"] = min(waves) / max(lattice.apart(0.0), lattice.apart(math.pi / 2))
    if slopes := [one.rms[1] for one in case.shapes if isinstance(one, Rough)]:
        found["rms_slope"] = math.hypot(*slopes)
    mu: Any = case.deck.friction.coefficient if case.deck.friction else 0.0
    if isinstance(mu, TwoCoefficients):
        mu = max(mu.along, mu.across)
    if isinstance(mu, float):
        found["friction_coefficient"] = 0.0 if math.isinf(mu) else mu
    slipping, turning, ring = _sheared(case)
    if turning is not None:
        found |= {"turning_error": turning, "turning_steps": math.ceil(turning / _STEP_ERROR)}
    if known is None:
        return found
    found |= {
        "contact_radius": known.radius,
        "extent": tuple(known.size.tolist()),
        "half_width": known.half_width,
        "max_pressure": known.max_pressure,
        "slope": max(known.slope, *known.body_slopes, 0.0),
        "gap_slope": known.slope,
        "is_full": math.isinf(known.breadth),
        "spacings": min(known.spacings(lattice), known.breadth / coarse),
    }
    if math.isfinite(known.max_pressure):
        found["pressure_ratio"] = known.max_pressure / case.pair.effective_modulus
    if case.maps:
        apart = [
            one.map.distances[axis] / lattice.apart(one.angle + axis * math.pi / 2)
            for one in case.maps
            for axis in one.axes
        ]
        found |= {
            "spacings_between_points": float(max(apart)),
            "points_between_nodes": float(1.0 / min(apart)),
            "holes_near_contact": case.holes_near(known),
        }
    if case.accuracy is None:
        errors, needed = expected_lattice_errors(found["spacings"], slipping, _LATTICE_ERROR)
        found |= {
            "lattice_error": max(errors),
            "needed_spacings": math.ceil(needed),
            **{f"{name}_error": error for name, error in errors._asdict().items()},
        }
        if case.rollers and not case.deck.interface:
            found |= _ends_of_rollers(case)
        if ring is not None:
            errors, _ = expected_lattice_errors(found["spacings"], ring, _LATTICE_ERROR)
            found["ring_spacings"] = slip_ring(ring) * found["spacings"]
            found["ring_error"] = errors.dissipated_energy
    if named := [*_fatigue_at_surface(case)]:
        found |= {"edge_spacings": found["spacings"], "edge_tables": listed(named, "and")}
    if entering := list(_entering(case)):
        error, steps, needed = max(entering)
        found |= {"step_error": error, "growing_steps": steps, "needed_steps": math.ceil(needed)}
    return found


def _ends_of_rollers(case: Problem) -> dict[str, float]:
    """Return cells along the axis of a logarithmic roller over those that resolve its ends; else nothing."""
    load = max((drive.get("normal_load", 0.0) for drive in case.largest_drives), default=0.0)
    found = []
    for roller in case.rollers:
        if roller.design_load and 0.0 < load < roller.design_load:
            width, _ = roller.plane_contact(case.pair.effective_modulus, roller.design_load)
            cell, needed = case.lattice.apart(roller.angle), (1.0 - load / roller.design_load) * width
            found.append((cell / needed, cell, needed))
    return dict(zip(("end_cells", "end_cell", "end_needed"), max(found), strict=True)) if found else {}


def _fatigue_at_surface(case: Problem) -> Iterator[str]:
    """Yield the keys of the tables of fatigue parameters that reach less than a spacing deep."""
    for number, table in enumerate(case.deck.fatigue, 1):
        points = np.concatenate([np.reshape(table.where.get(key, ()), (-1, 3)) for key in _CORNERS])
        depths = [*table.where.get("depths", ()), *points[:, 2]]
        if min(depths) < case.lattice.spacing:
            yield f"fatigue.{number}"


def _at_most(error: float) -> str:
    """Return an expected error in percent; of the largest, nothing above is known."""
    return f"{percent(error)}{' or more' * (error >= NO_VALUE)}"


def warnings(case: Problem, estimated: bool = True) -> list[str]:
    """Return a sentence for each limit that a case exceeds, found once; arguments as `expected`."""
    if estimated not in case.judged:
        found = expected(case, estimated)
        passed = [
            limit
            for limit in LIMITS
            if not limit.least <= found.get(limit.quantity, limit.least) <= limit.most * (1.0 + _ROUNDED)
        ]
        known = found | _words(case, found) if passed else {}
        case.judged[estimated] = [limit.words.format(**known) for limit in passed]
    return case.judged[estimated]


def _words(case: Problem, found: dict[str, Any]) -> dict[str, str]:
    """Return the words in the sentences of limits that are no numbers."""
    errors = sorted(((found.get(f"{name}_error", 0.0), name) for name in LatticeErrors._fields), reverse=True)
    steps = f"{found.get('growing_steps', 0.0):.2g}"
    worth = [f"{_at_most(error)} in the {spelled(name)}" for error, name in errors if error > 0.01]
    return {
        **_steepest(case, found),
        "lattice_words": listed(worth, "and") if worth else "",
        **{f"{name}_words": _in_spacings(found[name]) for name in _IN_SPACINGS if name in found},
        "holes_words": counted(count, "hole of the height map lies", "holes of the height map lie")
        if (count := found.get("holes_near_contact"))
        else "",
        **{name: quantity(found[name], "m", 2) for name in ("end_cell", "end_needed") if name in found},
        "spacing_words": _in_spacings(found.get("spacings", 0.0)),
        "radius_words": "half-width of the parts of the contact"
        if not found.get("is_full", True)
        else "smaller half-axis of the contact"
        if _half_axes(found)
        else "contact radius",
        "growing_words": "one step" if steps == "1" else f"{steps} even steps",
        "step_percent": percent(found.get("step_error", 0.0)),
        "turning_percent": percent(found.get("turning_error", 0.0)),
        "ring_percent": _at_most(found.get("ring_error", 0.0)),
    }


def _in_spacings(number: float) -> str:
    return counted(f"{number:.2g}" if number < 99.5 else f"{number:.0f}", "spacing")


def row(case: Problem) -> str:
    """Return the expected values as a line of a table; empty if they are unknown."""
    if case.estimate is None:
        return ""
    found = expected(case)
    pressures, axes = "unbounded at an end of a surface", _half_axes(found)
    if "pressure_ratio" in found:
        pressures = f"about {quantity(found['max_pressure'], 'Pa', 3)}, {found['pressure_ratio']:.2g} E*"
    spacings = _in_spacings(found["spacings"])
    along, across = (quantity(length, "m", 3) for length in found["extent"])
    extent = f"; extent about {along} in x, {across} in y"
    size = f"radius about {quantity(found['contact_radius'], 'm', 3)}"
    if axes:
        size = "half-axes about " + " by ".join(quantity(axis, "m", 3) for axis in axes)
        spacings += " in the smaller one" + extent
    elif not found["is_full"]:
        size += " of the circle of the same area"
        spacings = f"about {spacings} in the half-width of its parts{extent}"
    size = f"{size}, {spacings}"
    return (
        f"{size}; p_max {pressures}; slope at the edge {found['slope']:.2g}"
        f"{_steepest(case, found)['gap_words']}"
    )


_AT_TIPS = "the pressure is unbounded at a sharp tip: there its largest value grows as the spacing shrinks"


def notes(case: Problem) -> dict[str, str]:
    """Return notes by their subjects: limits that are not judged, rounded distances, tips, equal seeds."""
    found = {"unjudged": unjudged(case), "rounded": rounded_distances(case)}
    if case.surfaces.curvature is None:
        sharp = [one for one in case.shapes if isinstance(one, Cone) or getattr(one, "exponent", 2.0) <= 1.0]
        if sharp and not case.deck.interface:
            found["tips"] = _AT_TIPS
        waves = [(one.seed, one.sides, one.offset) for one in case.shapes if isinstance(one, Rough)]
        if twice := [one for one in waves if waves.count(one) > 1]:
            seed, *_ = twice[0]
            found["seeds"] = f"two rough surfaces have {seed = }: their waves coincide, and peaks meet peaks"
    return {about: note for about, note in found.items() if note}


def unjudged(case: Problem) -> str:
    """Return a note on limits that the warnings do not check, and on measured surfaces; empty without one."""
    if case.gap_given:
        return (
            "the slopes of the bodies are not judged, since only their gap is known: expected at most 0.1 "
            "of each body at the edge of the contact, also where surfaces conform"
        )
    return "; ".join(
        note
        for number, shape in (case.surfaces.measured if case.maps else ())
        for note in shape.notes(f"the {shape.shape} of body {number}")
    )


def rounded_distances(case: Problem) -> str:
    """Return a note on rolled distances that are no whole number of spacings; empty without one."""
    words = []
    steps = [step for step in case.load_steps if step.roll and not step.roll.steady]
    for segment in dict.fromkeys(step.segment for step in steps):
        rolled = [step.roll for step in steps if step.segment == segment and step.roll]
        given, spacing = rolled[0].distance, case.row_along(rolled[0].direction)[1]
        if abs(len(rolled) * spacing - given) > _ROUNDED * spacing:
            words.append(
                f"segment {segment + 1} rolls {quantity(len(rolled) * spacing, 'm')}, "
                f"{counted(len(rolled), 'spacing')} of the lattice, and not {quantity(given, 'm')}"
            )
    return "; ".join(words)


def _steepest(case: Problem, found: dict[str, Any]) -> dict[str, str]:
    """Name the steepest surface, and the slope of the gap if the surfaces conform."""
    if (
        case.estimate is None
        or "slope" not in found
        or (gap := f"{found['gap_slope']:.2g}") == f"{found['slope']:.2g}"
    ):
        return {"steepest": "the surfaces slope", "gap_words": ""}
    body = 1 + case.estimate.body_slopes.index(found["slope"])
    return {"steepest": f"body {body} slopes", "gap_words": f" (the gap by {gap})"}


def _half_axes(found: dict[str, Any]) -> tuple[float, float] | None:
    """Return the expected half-axes of an elongated contact, as those of an ellipse; None of a round one."""
    if "half_width" not in found or found["half_width"] > _ROUND * found["contact_radius"]:
        return None
    return found["contact_radius"] ** 2 / found["half_width"], found["half_width"]


def limits() -> list[dict[str, Any]]:
    """Return the table of limits for programs, without infinite ones."""
    return [
        {name: value for name, value in limit._asdict().items() if name != "words" and value not in _OPEN}
        for limit in LIMITS
    ]


def _load_ratio(case: Problem, step: LoadStep) -> float:
    """Return Q/mu P of a load step; assumed for a prescribed motion or another law."""
    if any(t.control == "displacement" and t.value for t in (step.x, step.y, step.twist)):
        return _ASSUMED
    bound = case.friction_coefficient * step.z.value
    force = math.hypot(step.x.value, step.y.value)
    if step.z.control != "force" or not bound > 0.0:
        return _ASSUMED if force else 0.0
    return min(force / bound, 1.0)


def _sheared(case: Problem) -> tuple[float, float | None, float | None]:
    """Return the largest Q/mu P, and two numbers from loads or motions along x, y and about z.

    These are the error of the dissipated energy by loads that turn, None without slip or such steps, and the
    largest Q/mu P of tangential loads that return, None if none is known to. Q/mu P is that of a wide ring if
    shear is due to pressing alone, and 0 without shear and of rolling bodies, whose slip is no ring.
    """
    if not case.frictional or math.isinf(case.friction_coefficient) or case.rolls:
        return 0.0, None, None
    largest = max((_load_ratio(case, step) for step in case.load_steps), default=0.0)
    slipping = max(largest, _NOTICED) if largest else 0.8 * (abs(case.pair.beta) > _ALIKE)
    targets = [target for step in case.load_steps for target in (step.x, step.y, step.twist)]
    controls = np.array([target.control for target in targets]).reshape(-1, 3)
    if (controls != controls[0]).any():
        return slipping, None, None
    values = np.array([target.value for target in targets]).reshape(-1, 3)
    scale = np.abs(values).max(axis=0)
    scale[:2] = scale[:2].max()
    shear = values / np.where(scale > 0.0, scale, 1.0)
    turns = case.solver.algorithm == "incremental" and not case.adaptive and slipping >= _NOTICED
    changes = np.diff(shear[:, :2], axis=0)
    returns = 0.0 < largest < _NOTICED and (np.sum(changes[1:] * changes[:-1], axis=1) < 0.0).any()
    return slipping, turning_errors(shear) if turns else None, largest if returns else None


def _entering(case: Problem) -> Iterator[tuple[float, float, float]]:
    """Yield the error by steps with nodes that enter the contact, these steps, and the needed number."""
    mu, beta = case.friction_coefficient, abs(case.pair.beta)
    implicit = (case.solver.algorithm, case.solver.entry) == ("incremental", "implicit")
    if not (implicit and mu) or case.adaptive or case.rolls:
        return
    coupled = beta > _ALIKE and not math.isnan(mu)
    growing = list(_growing(case))
    if not coupled and not any(ratio for _, _, ratio in growing):
        return  # without the estimates that the growth of the contact takes
    if (growth := case.growth) < _STEADY:
        return
    assert case.estimate is not None
    radius = case.estimate.radius
    growing = [(radius * one**growth, radius * other**growth, ratio) for one, other, ratio in growing]
    if growing and coupled:
        before, after, _ = np.array(growing).T
        yield expected_entry_error(before, after, mu / beta, None, _STEP_ERROR)
    if oblique := [entry for entry in growing if entry[2]]:
        before, after, ratios = np.array(oblique).T
        yield expected_entry_error(before, after, 0.0, float(ratios[-1]), _STEP_ERROR)


def _growing(case: Problem) -> Iterator[tuple[float, float, float]]:
    """Yield the shares of the largest load before and after each step that raises it, and changed Q/mu P."""
    ((name, largest),) = case.largest_drives[0].items()
    control = LOADS["z"].index(name)
    before, sheared = 0.0, (0.0, 0.0, 0.0)
    for step in case.load_steps:
        after = before
        if step.z.control == ("force", "displacement")[control]:
            after = max(step.z.value / largest, 0.0)
        shear = (step.x.value, step.y.value, step.twist.value)
        if after > before:
            yield before, after, _load_ratio(case, step) if shear != sheared else 0.0
        before, sheared = after, shear
