"""Checks: error bars and bounds of load steps without a closed-form solution, against finer solutions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexcontact.case import Case
from hexcontact.deck.surfaces import Cylinder, Sphere
from hexcontact.result.result import Result
from hexcontact.solve.events import Listener
from hexcontact.solve.lattices import InMemory, driven, refine

from .reference import Comparison

Array = NDArray[np.float64]
Problem = dict[str, Any]
"""Arguments of a case; its loads without their steps."""

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
STIFF = {"young_modulus": 432e9, "poisson_ratio": 0.32}
ALUMINIUM = {"young_modulus": 72e9, "poisson_ratio": 0.32}
LOAD = 100.0
MESHES = (4.0, 10.0)  # spacings in the contact radius, of the first of three lattices
FINE = 100.0  # the same of the reference
ENOUGH = 0.5  # a target that the third lattice reaches
FINER = 12  # load steps of the reference in each adaptive one
NODES = 10.0  # spacings in the contact radius where load steps are compared
SMALL = 1e-9  # of the largest value of a quantity: rounding errors
NAMED = ("max_pressure", "max_traction", "contact_area_fit", "stick_area_fit", "dissipated_energy")


def _balls(
    one: Mapping[str, Any], two: Mapping[str, Any], friction: float, *loads: dict[str, Any]
) -> Problem:
    sphere = {**one, "surface": Sphere(radius=0.01)}
    return {"body_1": sphere, "body_2": two, "friction_coefficient": friction, "loads": list(loads)}


def _crossed(one: Mapping[str, Any], two: Mapping[str, Any], *loads: dict[str, Any]) -> Problem:
    first = {**one, "surface": Cylinder(radius=0.03, angle="0 deg")}
    second = {**two, "surface": Cylinder(radius=0.02, angle="25 deg")}
    return {"body_1": first, "body_2": second, "friction_coefficient": 0.3, "loads": list(loads)}


PRESS = {"normal_load": LOAD}
IN_STEPS = {**PRESS, "steps": 5, "ramp": "cubic"}
TORQUE = 0.3 * LOAD * 1.2e-4  # carried by friction of 0.3, about

PROBLEMS: dict[str, Problem] = {
    "strong friction": _balls(
        STIFF,
        ALUMINIUM,
        0.6,
        IN_STEPS,
        {"tangential_load_x": 30.0, "steps": 3},
        {"normal_load": 70.0, "steps": 2},
    ),
    "reversal": _balls(
        STEEL,
        STEEL,
        0.3,
        PRESS,
        {"tangential_load_x": 24.0, "steps": 3},
        {"tangential_load_x": -15.0, "steps": 4},
    ),
    "dissimilar": _balls(STIFF, ALUMINIUM, 0.1, IN_STEPS, {"tangential_load_x": 7.0, "steps": 3}),
    "elongated": _crossed(STEEL, STEEL, PRESS, {"tangential_load_y": 21.0, "steps": 4}),
    "twist": _balls(STEEL, STEEL, 0.3, PRESS, {"torque": 0.6 * TORQUE, "steps": 4}),
    "friction of 1": _balls(STIFF, ALUMINIUM, 1.0, {**IN_STEPS, "steps": 8}),
}
"""Error bars: histories in a few given steps."""

HISTORIES: dict[str, Problem] = {
    "strong friction": _balls(STIFF, ALUMINIUM, 0.6, PRESS, {"tangential_load_x": 30.0}),
    "unloaded": _balls(STIFF, ALUMINIUM, 0.6, PRESS, {"normal_load": 20.0}),
    "reversal": _balls(
        STIFF, ALUMINIUM, 0.3, PRESS, *({"tangential_load_x": load} for load in (24.0, -24.0, 15.0))
    ),
    "dissimilar": _balls(STIFF, ALUMINIUM, 0.1, PRESS, {"tangential_load_x": 7.0}, {"normal_load": 80.0}),
    "elongated": _crossed(STIFF, ALUMINIUM, PRESS, {"tangential_load_y": 21.0}, {"tangential_load_x": 12.0}),
    "twist": _balls(STIFF, ALUMINIUM, 0.3, PRESS, {"torque": 0.6 * TORQUE}, {"torque": -0.3 * TORQUE}),
    "oblique": _balls(STEEL, STEEL, 0.3, {**PRESS, "tangential_load_x": 15.0}, {"tangential_load_x": -15.0}),
    "turning": _balls(
        STEEL,
        STEEL,
        0.3,
        PRESS,
        *(
            {"tangential_load_x": 18.0 * math.cos(turn), "tangential_load_y": 18.0 * math.sin(turn)}
            for turn in np.arange(6) * math.pi / 2.0
        ),
    ),
    "shifted": _balls(
        STIFF, ALUMINIUM, 0.3, {"approach": 3e-6}, {"shift_x": 4e-7}, {"shift_x": -4e-7}, {"approach": 4e-6}
    ),
}
"""Bounds of adaptive load steps."""


def _history(result: Result, step: int, name: str) -> float:
    return float(result.dataset[name].values[step])


def bars_over_errors(problem: str, count: int, seed: int) -> dict[str, Array]:
    """Solve a problem on random lattices; return estimated error over difference from a fine lattice.

    Parameters
    ----------
    problem : str
        One of `PROBLEMS`.
    count : int
        How many lattices.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    dict of str to ndarray
        Of every load step, by the name of the quantity; at least 1 where the estimate holds.
    """
    given, rng = PROBLEMS[problem], np.random.default_rng(seed)
    radius = MESHES[1] * Case(**given, nodes_in_radius=MESHES[1]).lattice.spacing
    spacing = radius / FINE
    reference = Case(**given, spacing=spacing, origin=(0.3 * spacing, 0.2 * spacing)).run()
    found: dict[str, list[float]] = {}
    for _ in range(count):
        spacing = radius / math.exp(rng.uniform(*np.log(MESHES)))
        origin = tuple((spacing * rng.uniform(0.0, 1.0, 2)).tolist())
        solver = InMemory([], Listener())
        case = Case(**given, spacing=spacing, origin=origin, accuracy=ENOUGH)
        outcome = refine(case, solver)
        for number, target in enumerate(case.load_steps):
            history, errors = solver.steps[number].history, outcome.errors[number]
            for name in errors.keys() - driven(target):
                bar = errors[name]
                exact = _history(reference, number, name)
                scale = float(np.nanmax(np.abs(reference.dataset[name].values)))
                error = abs(float(history[name]) - exact)
                if math.isfinite(bar) and math.isfinite(error) and (bar > 0.0 or error > SMALL * scale):
                    found.setdefault(name, []).append(bar / error if error > SMALL * scale else math.inf)
    return {name: np.array(ratios) for name, ratios in found.items()}


def _known(absolute: float) -> dict[str, float]:
    return {"analytic": 1.0, "absolute": absolute}


def hard_error_bars(count: int = 20, seed: int = 1) -> Comparison:
    """Share of the errors of every step within the estimates, on problems without a closed-form solution."""
    found = Comparison()
    for problem in PROBLEMS:
        ratios = bars_over_errors(problem, count, seed)
        together = np.concatenate(list(ratios.values()))
        found.add(
            problem, "all quantities: share within", "-", float(np.mean(together >= 1.0)), **_known(0.02)
        )
        for name in NAMED:
            if name in ratios:
                share = float(np.mean(ratios[name] >= 1.0))
                found.add(problem, f"{name}: share within", "-", share, **_known(0.05))
                found.add(problem, f"{name}: estimate/error", "-", float(np.median(ratios[name])))
    found.notes.append(
        f"{count} random spacings and origins each, 8 to 20 spacings in the radius of the finest of three "
        f"lattices, every load step; errors against one lattice of {FINE:g} spacings in the radius."
    )
    return found


def errors_over_bounds(history: str, tolerance: float) -> tuple[Array, Array]:
    """Return errors over their bounds of each adaptive step: of the stick area, and of the tractions.

    The reference takes `FINER` steps of equal size in each of them, on the same lattice.
    """
    given = HISTORIES[history]
    loads = [{**load, "steps": "auto"} for load in given["loads"]]
    result = Case(**{**given, "loads": loads}, nodes_in_radius=NODES, step_tolerance=tolerance).run()
    loads = []
    for number, load in enumerate(given["loads"], start=1):
        ends = [0.0, *result.segment_fraction.values[result.segment.values == number].tolist()]
        values = [
            begin + (end - begin) * part / FINER
            for begin, end in itertools.pairwise(ends)
            for part in range(1, FINER + 1)
        ]
        loads.append({**load, "values": values})
    finer = Case(**{**given, "loads": loads}, nodes_in_radius=NODES).run().dataset
    exact = finer.isel(step=slice(FINER - 1, None, FINER))
    area = float(exact.contact_area_fit.max())
    stick = np.abs(result.stick_area_fit.values - exact.stick_area_fit.values)
    apart = np.hypot(result.traction_x.values - exact.traction_x, result.traction_y.values - exact.traction_y)
    carried = given["friction_coefficient"] * exact.pressure.values.sum((1, 2))
    share = np.minimum(1.0, exact.contact_area_fit.values / area) * apart.values.sum((1, 2)) / carried
    rounding = 1e-6
    return (
        stick / np.maximum(result.stick_area_step_error.values, rounding * area),
        share / np.maximum(result.traction_step_error.values, rounding),
    )


def step_bounds(tolerances: tuple[float, ...] = (0.05, 0.02)) -> Comparison:
    """Share of adaptive load steps whose errors are within the recorded bounds."""
    found = Comparison()
    for history, tolerance in itertools.product(HISTORIES, tolerances):
        ratios = errors_over_bounds(history, tolerance)
        name = f"{history}, {tolerance:g}, {len(ratios[0])} steps"
        for what, ratio in zip(("stick area", "tractions"), ratios, strict=True):
            share = float(np.mean(ratio <= 1.0))
            found.add(name, f"{what}: share within", "-", share, analytic=1.0, absolute=0.05)
            found.add(name, f"{what}: largest error/bound", "-", float(ratio.max()))
    found.notes.append(
        f"Step tolerances 0.05 and 0.02, {NODES:g} spacings in the radius; errors of every step against "
        f"{FINER} steps in each, on the same lattice."
    )
    return found
