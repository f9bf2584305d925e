"""Bound on the error of the dissipated energy by the size of load steps, and warnings of loads that turn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hexcontact import Case
from hexcontact.cli.printed import Summary
from hexcontact.problem import plausibility

P, MU, RADIUS = 20.0, 0.3, 10e-3
CIRCLE_24 = 592e-9  # second turn of 24 steps in the limit of small ones, J; 16 spacings in the radius


def sphere(loads: list[dict[str, Any]], soft: float = 210e9, poisson: float = 0.0, **more: Any) -> Case:
    body = {"young_modulus": 210e9, "poisson_ratio": poisson}
    return Case(
        body_1=body | {"surface": {"shape": "sphere", "radius": RADIUS}},
        body_2=body | {"young_modulus": soft},
        loads=loads,
        **{"nodes_in_radius": 8, "friction_coefficient": MU} | more,
    )


def circle(
    steps: int | str, rows: int, turns: int = 1, share: float = 0.6, control: str = "tangential_load"
) -> Any:
    """Return loads that turn once or more at a constant normal load."""
    size = share * MU * P if control == "tangential_load" else 3e-7
    path = [
        {f"{control}_x": size * np.cos(angle), f"{control}_y": size * np.sin(angle), "steps": steps}
        for angle in 2.0 * np.pi * np.arange(rows * turns + 1) / rows
    ]
    return [{"normal_load": P}, path[0] | {"steps": 1}, *path[1:]]


def energies(loads: list[dict[str, Any]], **more: Any) -> tuple[float, float]:
    """Return the dissipated energy and its bound."""
    last = sphere(loads, **more).run().step(-1)
    return float(last["dissipated_energy"]), float(last["dissipated_energy_path_error"])


def test_turning_load_is_within_its_bound() -> None:
    rows = 24
    for steps in (1, 2):
        case = sphere(circle(steps, rows, turns=2), nodes_in_radius=16)
        result = case.run()
        first = 1 + rows * steps  # end of the first turn
        spent, bound = (
            float(result[name][-1] - result[name][first])
            for name in ("dissipated_energy", "dissipated_energy_path_error")
        )
        assert abs(spent - CIRCLE_24) < bound < 1.5 * abs(spent - CIRCLE_24), steps
        [warning] = plausibility.warnings(case) if steps == 1 else ["turns in its steps"]
        assert "turns in its steps" in warning


PATHS: dict[str, tuple[Any, dict[str, Any]]] = {
    "circle of a shift": (lambda n: circle(n, 12, control="shift"), {}),
    "unlike": (lambda n: circle(n, 12), {"soft": 30e9, "poisson": 0.3}),
    "square": (
        lambda n: [
            {"normal_load": P},
            *({"tangential_load_x": 3.0 * x, "tangential_load_y": 3.0 * y, "steps": 2 * n}
              for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1))),
        ],
        {},
    ),
    "normal load out of phase": (
        lambda n: [
            {"normal_load": P},
            *({"normal_load": P * (1 + 0.3 * np.cos(a)), "tangential_load_x": 3.6 * np.sin(a), "steps": n}
              for a in np.arange(1, 13) * np.pi / 6),
        ],
        {},
    ),
    "unlike, pressed and unloaded": (
        lambda n: [{"normal_load": P, "steps": 4 * n}, {"normal_load": 1.0, "steps": 4 * n}],
        {"soft": 30e9, "poisson": 0.3, "friction_coefficient": 0.1},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PATHS)
def test_bound_holds_on_other_paths(name: str) -> None:
    path, more = PATHS[name]
    known = {parts: energies(path(parts), **more) for parts in (1, 2, 4, 8)}
    limit = 2.0 * known[8][0] - known[4][0]  # errors are of the first order
    for parts, (spent, bound) in known.items():
        assert abs(spent - limit) <= bound, parts


@pytest.mark.parametrize("control", ["tangential_load_x", "twist"])
def test_bound_of_a_loop_along_a_line_is_zero(control: str) -> None:
    size = 3.6 if control == "tangential_load_x" else 3e-4
    loop = [{"normal_load": P}, *({control: s * size, "steps": 2} for s in (1, -1, 1))]
    spent, bound = energies(loop)
    assert spent > 0.0
    # nodes turn about the center, but for the sides of the lattice
    assert bound <= (1e-9 if control == "tangential_load_x" else 0.01) * spent


def test_adaptive_steps_hold_the_tolerance_where_the_load_turns() -> None:
    exact = 2.0 * energies(circle(32, 12))[0] - energies(circle(16, 12))[0]
    spent, bound = energies(circle("auto", 12), step_tolerance=0.05)
    assert abs(spent - exact) <= bound <= 0.05 * spent


def test_uncertain_energy_is_stated() -> None:
    result = sphere(circle(1, 12)).run()
    summary = Summary.of_result(result)
    [remark] = [each for each in summary.remarks if "uncertain" in each]
    assert "leaves the dissipated energy uncertain by up to" in remark
    assert not [
        each for each in Summary.of_result(sphere(circle(8, 12)).run()).remarks if "uncertain" in each
    ]


def test_energy_that_adaptive_steps_leave_uncertain_is_stated() -> None:
    result = sphere(
        [{"normal_load": P, "steps": "auto"}], soft=30e9, poisson=0.3, friction_coefficient=0.1
    ).run()
    [remark] = [each for each in Summary.of_result(result).remarks if "uncertain" in each]
    assert remark.endswith("give numbers of steps, of which twice as many leave half of it")


def test_static_steps_have_no_bound() -> None:
    assert "dissipated_energy_path_error" not in sphere(circle(1, 4), algorithm="static").run().dataset


def test_loop_with_a_slip_annulus_thinner_than_a_spacing_is_named() -> None:
    def warned(share: float) -> list[str]:
        loop = [{"normal_load": P}, *({"tangential_load_x": s * share * MU * P} for s in (1, -1, 1))]
        return plausibility.warnings(sphere(loop, nodes_in_radius=40))

    [sentence] = warned(0.02)
    assert "the slip annulus of the tangential loop is 0.27 spacings wide, expected at least 1" in sentence
    assert warned(0.1) == []
