"""What is said of a load step that did not converge: which condition, where, by how much, what to try.

Attempts that failed are states with fields changed by hand, so that place and size of the error are known.
"""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexcontact import Case, ConvergenceError, influence
from hexcontact.solve import nonconvergence
from hexcontact.solve.steps import steps, window_type
from hexcontact.solve.window import state_of

SPHERE = {"young_modulus": 210e9, "poisson_ratio": 0.3, "surface": {"shape": "sphere", "radius": 10e-3}}
PLANE = {"young_modulus": 70e9, "poisson_ratio": 0.33}
PRESS_AND_SHEAR = [{"normal_load": 100.0}, {"tangential_load_x": 8.0}]


def sphere(**keys: Any) -> Case:
    given = {"loads": PRESS_AND_SHEAR, "nodes_in_radius": 6, "friction_coefficient": 0.2} | keys
    return Case(body_1=SPHERE, body_2=PLANE, **given)


def failed(case: Case, **changed: Any) -> tuple[ConvergenceError, Any, Any]:
    """Change the state at the end of a case, and return what is said of it, the state and the window."""
    *_, last = steps(case)
    window = window_type(case)(case, last.lattice)
    state, target = None, case.load_steps[0]
    for target in case.load_steps:
        state = window.advance(state, target, target.values(dict.fromkeys(_names(), 0.0)))
    values = target.values(dict.fromkeys(_names(), 0.0))
    bad = replace(state, converged=False, **{name: change(state) for name, change in changed.items()})
    return nonconvergence.error(case, last.lattice, bad, target, values), bad, last.lattice


def _names() -> list[str]:
    from hexcontact.variables import LOADS

    return [name for pair in LOADS.values() for name in pair]


def compliance(case: Case, lattice: Any) -> float:
    """d_n of docs/theory/residuals.md, (R1)."""
    return case.pair.lambda_1 * float(influence.pyramid_kernels(0.0, 0.0).K1) * lattice.spacing


def test_moment_of_a_load_about_a_far_origin_is_named() -> None:
    far = SPHERE | {"surface": SPHERE["surface"] | {"offset": [5e-3, -3e-3]}}
    loads = [{"normal_load": 20.0}, {"tangential_load_y": 3.0, "torque": 0.0, "steps": 4}]
    case = Case(body_1=far, body_2=SPHERE | {"surface": {"shape": "flat"}}, friction_coefficient=0.3,
                nodes_in_radius=8, loads=loads)  # fmt: skip
    sentence = (
        r"gross sliding: friction cannot carry the moment of -3\.750 mN m about the contact at x = 5\.000 mm"
        r", y = -3\.000 mm \(at most 38\d\.\d µN m\), since the tangential load acts at x = y = 0; .*"
        r"expected twist = 0 in place of the torque, a torque of 3\.750 mN m"
    )
    with pytest.raises(ConvergenceError, match=sentence):
        case.run()


def test_torque_beyond_friction_is_gross_sliding_whatever_the_solver_found() -> None:
    # 3 pi/16 mu P a is 2.7 mN m
    case = sphere(loads=[{"normal_load": 100.0}, {"torque": 5e-4}])
    lattice = window_type(case)(case, case.lattice).lattice
    *_, last = steps(case)
    bad = replace(state_of(last), converged=False, sliding=False)
    target = case.load_steps[-1]
    for torque, words in (
        (5e-3, "gross sliding: friction cannot carry the torque of 5.000 mN m"),
        (5e-4, "did not"),
    ):
        values = (100.0, 0.0, 0.0, torque)
        assert words in str(nonconvergence.error(case, lattice, bad, target, values))


def changed_at(field: np.ndarray, row: int, col: int, value: float) -> np.ndarray:
    new = field.copy()
    new[row, col] = value
    return new


def sentence(error: ConvergenceError) -> str:
    """The line that names the worst residual."""
    [line] = [line for line in str(error).splitlines() if line.startswith("worst is ")]
    return line


@pytest.mark.parametrize("frictional", [True, False])
def test_penetration_is_named_with_its_node_and_depth(frictional: bool) -> None:
    case = sphere() if frictional else sphere(friction_coefficient=None, loads=[{"normal_load": 100.0}])
    depth = 3e-9
    at = tuple(np.array(case.lattice.shape) // 2)
    d_n = compliance(case, case.lattice)
    error, state, lattice = failed(
        case,
        gap=lambda s: changed_at(s.gap, *at, -depth),
        residual_normal=lambda s: depth / d_n / s.pressure.max(),
    )
    row, col = int(lattice.rows[at[0]]), int(lattice.cols[at[1]])
    worst = error.details["worst"]
    assert (worst["residual"], worst["row"], worst["column"]) == ("R_n", row, col)
    assert (worst["x"], worst["y"]) == (lattice.x[at], lattice.y[at])
    assert f"the node in row {row}, column {col}" in sentence(error)
    assert sentence(error).endswith("the surfaces penetrate by 3.000 nm")
    times = depth / d_n / state.pressure.max() / 1e-8
    assert f"worst is R_n, {times:.2e} times its bound" in sentence(error)


def test_tension_and_pressure_across_a_gap_are_told_apart() -> None:
    case, middle = sphere(), tuple(np.array(sphere().lattice.shape) // 2)
    d_n = compliance(case, case.lattice)
    tension, _, _ = failed(
        case,
        pressure=lambda s: changed_at(s.pressure, 0, 0, -1e6),
        gap=lambda s: changed_at(s.gap, 0, 0, 0.0),
        residual_normal=lambda s: 1e6 / s.pressure.max(),
    )
    assert sentence(tension).endswith("there is a tension of 1.000 MPa")
    gap, _, _ = failed(
        case,
        gap=lambda s: changed_at(s.gap, *middle, 1e-12),
        residual_normal=lambda s: 1e-12 / d_n / s.pressure.max(),
    )
    assert re.search(r"there is a pressure of \S+ MPa across a gap of 1\.000 pm$", sentence(gap))


def test_a_traction_beyond_friction_is_named_with_its_bound() -> None:
    def pulled(state: Any) -> np.ndarray:
        stick = state.zone == 1
        bound = 0.2 * state.pressure[stick][0]
        row, col = np.argwhere(stick)[0]
        return changed_at(changed_at(state.traction_x, row, col, 1.5 * bound), row, col, 1.5 * bound)

    def residual(state: Any) -> float:
        stick = state.zone == 1
        p, q_y = state.pressure[stick][0], state.traction_y[stick][0]
        size = math.hypot(1.5 * 0.2 * p, q_y)
        return float((size - 0.2 * p) / (0.2 * state.pressure.max()))

    error, state, lattice = failed(sphere(), traction_x=pulled, residual_tangential=residual)
    row, col = np.argwhere(state.zone == 1)[0]
    assert error.details["worst"]["row"] == lattice.rows[row]
    assert error.details["worst"]["column"] == lattice.cols[col]
    assert re.search(
        r"a shear traction of \S+ MPa where friction holds \S+ MPa, with a slip of", sentence(error)
    )


def test_slip_without_slip_is_named_and_a_finite_coefficient_advised() -> None:
    case = sphere(friction_coefficient=math.inf)
    d_t = compliance(case, case.lattice) * (1 + 0.5 * case.pair.gamma)

    def slipped(state: Any) -> np.ndarray:
        row, col = np.argwhere(state.zone == 1)[0]
        return changed_at(state.slip_increment_x, row, col, 2e-9)

    def residual(state: Any) -> float:
        return 2e-9 / d_t / float(np.hypot(state.traction_x, state.traction_y)[state.zone > 0].max())

    error, _, _ = failed(case, slip_increment_x=slipped, residual_tangential=residual)
    assert sentence(error).endswith("slip by 2.000 nm, which friction.coefficient = inf forbids")
    assert "to try: a finite friction.coefficient of 2 to 5" in str(error)


@pytest.mark.parametrize(
    ("residual", "name", "value", "words"),
    [
        ("residual_force", "normal_load", 99.0, "normal load .* is 99.00 N instead of 100.0 N, off by 1"),
        (
            "residual_shear_force",
            "tangential_load_x",
            7.0,
            "along x .* is 7.000 N instead of 8.000 N, off by 1",
        ),
    ],
)
def test_a_load_that_is_not_met_is_named_with_what_was_met(
    residual: str, name: str, value: float, words: str
) -> None:
    error, _, _ = failed(sphere(), **{residual: lambda s: 0.1, name: lambda s: value})
    assert re.search(words, sentence(error))
    assert error.details["residuals"]["R_P" if name == "normal_load" else "R_Q"] == 0.1
    assert error.details["worst"]["row"] is None


def test_a_place_that_is_not_that_of_the_residual_is_not_named() -> None:
    error, _, _ = failed(sphere(), residual_normal=lambda s: 0.5)
    assert "worst is" not in str(error)
    assert error.details["worst"]["row"] is None


def test_lost_contact_and_tolerances_near_rounding_are_named() -> None:
    case = sphere(tolerance=1e-13, loads=[{"normal_load": 100.0}], friction_coefficient=None, method="direct")
    error, _, _ = failed(
        case,
        pressure=lambda s: 0 * s.pressure,
        residual_force=lambda s: 1.0,
        residual_normal=lambda s: 1.8e308,
    )
    assert "R_n = inf and R_P = 1.00e+00" in str(error)
    assert "\nthe last attempt lost all contact\n" in str(error)
    assert "to try: solver.tolerance = 1e-10: below 1e-11 rounding errors count" in str(error)
    assert "larger solver.tolerance" not in str(error)


def test_a_contact_without_slip_that_has_no_solution_is_told_as_such() -> None:
    body = {"young_modulus": 1e9, "poisson_ratio": 0.0, "surface": {"shape": "sphere", "radius": 1e-3}}
    case = Case(
        body_1=body,
        body_2={"rigid": True},
        friction_coefficient=math.inf,
        nodes_in_radius=10,
        loads=[{"normal_load": 1.0, "steps": 2}, {"tangential_load_x": 2.0, "steps": 4}],
    )
    with pytest.raises(
        ConvergenceError, match=r"step 3 of 6 did not converge: after \d+ iterations"
    ) as caught:
        case.run()
    worst = caught.value.details["worst"]
    assert worst["residual"] == "R_n"
    assert re.search(
        r"at the node in row -?\d+, column -?\d+, x = \S+ µm, y = \S+ µm (there|the sur)", str(caught.value)
    )
    assert "a finite friction.coefficient of 2 to 5" in str(caught.value)
    radius = math.hypot(worst["x"], worst["y"])
    assert radius == pytest.approx(
        71e-6, rel=0.15
    )  # at the edge: a = (3 P R/(4 E*))^(1/3) = 91 um, less in step 3
