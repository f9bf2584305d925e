"""Check: estimated discretization errors against true ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexcontact import analytic
from hexcontact.analytic.friction import MindlinContact
from hexcontact.case import Case
from hexcontact.core.contact import ElasticPair
from hexcontact.deck.surfaces import Cylinder, Sphere
from hexcontact.solve.events import Listener
from hexcontact.solve.lattices import InMemory, refine

from .reference import Comparison
from .runs import shear_compliance

Array = NDArray[np.float64]
Exact = Mapping[str, float]
Problem = tuple[dict[str, Any], Exact, float]
"""Arguments of a case, exact values of its last load step, size of the contact (m)."""

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
COMPRESSIBLE = {"young_modulus": 210e9, "poisson_ratio": 0.0}  # for which Cattaneo and Mindlin are exact
FRICTION = 0.3
LOAD = 100.0
RADIUS = 0.02
MESHES = (4.0, 10.0)  # spacings in the contact radius, of the first of three lattices; 8 to 20 of the last
ENOUGH = 0.5  # a target that the third lattice reaches


def _pressed(contact: Any, semi_major: float, semi_minor: float) -> dict[str, float]:
    """Return what the history says about a contact without friction."""
    area, radius = math.pi * semi_major * semi_minor, math.sqrt(semi_major * semi_minor)
    return {
        "max_pressure": contact.max_pressure,
        "approach": contact.approach,
        "contact_area": area,
        "contact_area_fit": area,
        "contact_radius": radius,
        "contact_radius_fit": radius,
        "pressure_center_x": 0.0,
        "pressure_center_y": 0.0,
        "elastic_energy": 0.4 * contact.normal_load * contact.approach,
    }


def _modulus(material: Mapping[str, float]) -> float:
    return material["young_modulus"] / (1.0 - material["poisson_ratio"] ** 2) / 2.0


def spheres(rng: np.random.Generator) -> Problem:
    """Hertz: a sphere on a plane of the same material."""
    hertz = analytic.hertz_sphere(_modulus(STEEL), RADIUS, normal_load=LOAD)
    a = hertz.contact_radius
    given = {"body_1": {**STEEL, "surface": Sphere(radius=RADIUS)}, "body_2": STEEL, "normal_load": LOAD}
    return given, _pressed(hertz, a, a), a


def cylinders(rng: np.random.Generator) -> Problem:
    """Hertz: cylinders crossed at a random angle."""
    angle, radii = rng.uniform(30.0, 90.0), (0.03, 0.02)
    hertz = analytic.crossed_cylinders(_modulus(STEEL), *radii, math.radians(angle), normal_load=LOAD)
    axes = ("0 deg", f"{angle} deg")
    first, second = (Cylinder(radius=r, angle=axis) for r, axis in zip(radii, axes, strict=True))
    given = {
        "body_1": {**STEEL, "surface": first},
        "body_2": {**STEEL, "surface": second},
        "normal_load": LOAD,
    }
    exact = _pressed(hertz, hertz.semi_major, hertz.semi_minor)
    return given, exact, math.sqrt(hertz.semi_major * hertz.semi_minor)


def sheared_spheres(rng: np.random.Generator) -> Problem:
    """Cattaneo and Mindlin: the sphere is sheared by a random share of the load that makes it slide."""
    hertz = analytic.hertz_sphere(_modulus(COMPRESSIBLE), RADIUS, normal_load=LOAD)
    a, share = hertz.contact_radius, rng.uniform(0.1, 0.9)
    given = {
        "body_1": {**COMPRESSIBLE, "surface": Sphere(radius=RADIUS)},
        "body_2": COMPRESSIBLE,
        "friction_coefficient": FRICTION,
        "loads": [{"normal_load": LOAD}, {"tangential_load_x": share * FRICTION * LOAD}],
    }
    material = COMPRESSIBLE["young_modulus"], COMPRESSIBLE["poisson_ratio"]
    compliance = shear_compliance(ElasticPair.from_materials(*material, *material))
    contact = MindlinContact(FRICTION, LOAD, a, compliance)
    load = share * contact.sliding_load
    c, shift = float(contact.stick_radius(load)), float(contact.shift(load))
    # work of the load, integral of Q d(shift); slip goes on against a constant traction, so that the energy
    # of the shear is half of Q shift less what is dissipated
    left = 1.0 - share
    work = load * shift - contact.sliding_shift * contact.sliding_load * (
        share - 0.6 * (1.0 - left ** (5.0 / 3.0))
    )
    dissipated = 2.0 * work - load * shift
    exact = _pressed(hertz, a, a)
    exact["elastic_energy"] += work - dissipated
    exact |= {
        "shift_x": shift,
        "stick_area": math.pi * c**2,
        "stick_area_fit": math.pi * c**2,
        "stick_radius": c,
        "stick_radius_fit": c,
        "stick_center_x": 0.0,
        "stick_center_y": 0.0,
        "stick_min_x": -c,
        "stick_max_x": c,
        "stick_min_y": -c,
        "stick_max_y": c,
        "max_traction": FRICTION * hertz.max_pressure * math.sqrt(1.0 - (c / a) ** 2),
        "dissipated_energy": dissipated,
        "dissipated_energy_step": dissipated,
    }
    return given, exact, a


PROBLEMS: dict[str, Callable[[np.random.Generator], Problem]] = {
    "Hertz": spheres,
    "crossed cylinders": cylinders,
    "Cattaneo-Mindlin": sheared_spheres,
}


def estimates_over_errors(problem: str, count: int, seed: int, target: float = ENOUGH) -> dict[str, Array]:
    """Solve a problem on lattices of random spacing and origin and compare the errors.

    Parameters
    ----------
    problem : str
        One of `PROBLEMS`.
    count : int
        How many lattices.
    seed : int
        Seed of the random numbers.
    target : float
        Accuracy that the lattice is refined to.

    Returns
    -------
    dict of str to ndarray, (count,)
        Estimated error over true one by the name of the quantity; at least 1 where the estimate holds.
    """
    rng = np.random.default_rng(seed)
    found: dict[str, list[float]] = {}
    for _ in range(count):
        given, exact, radius = PROBLEMS[problem](rng)
        spacing = radius / math.exp(rng.uniform(*np.log(MESHES)))
        origin = tuple((spacing * rng.uniform(0.0, 1.0, 2)).tolist())
        case = Case(**given, spacing=spacing, origin=origin, accuracy=target)
        solver = InMemory([], Listener())
        outcome = refine(case, solver)
        history, errors = solver.steps[-1].history, outcome.errors[-1]
        for name, value in exact.items():
            error = abs(float(history[name]) - value)
            found.setdefault(name, []).append(errors[name] / error if error else math.inf)
    return {name: np.array(ratios) for name, ratios in found.items()}


def error_bars(problems: Sequence[str] = tuple(PROBLEMS), count: int = 100, seed: int = 1) -> Comparison:
    """Share of true errors that lie within the estimated ones, and how wide these are."""
    found = Comparison()
    for problem in problems:
        for name, ratios in estimates_over_errors(problem, count, seed).items():
            share = float(np.mean(ratios >= 1.0))
            found.add(problem, f"{name}: share within", "-", share, analytic=1.0, absolute=0.05)
            found.add(problem, f"{name}: estimate/error", "-", float(np.median(ratios)))
    found.notes.append(
        f"{count} random spacings and origins each, 8 to 20 spacings in the radius of the finest of three "
        "lattices; estimate/error is the median. Angle of the cylinders and tangential load are random, too."
    )
    return found
