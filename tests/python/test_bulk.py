"""Bulk stress: the shifted stick zone against closed solutions, stress below, restart, wrong decks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import integrate
from validation import bulk
from validation.reference import Comparison
from validation.runs import Run, bodies, run

import hexcontact
from hexcontact import Case, DeckError
from hexcontact.analytic.friction import MindlinContact

E, MU = 70e9, 0.5
RADIUS, LOAD = 10e-3, 100.0


def deck(**more: Any) -> dict[str, Any]:
    body = {"young_modulus": E, "poisson_ratio": 0.0}
    return {
        "body": {"1": body, "2": body | {"surface": {"shape": "sphere", "radius": RADIUS}}},
        "grid": {"nodes_in_radius": 12},
        "friction": {"coefficient": MU},
        "bulk": {"body": 1},
        "load": [{"normal_load": LOAD}],
        **more,
    }


def shifted(strain: float) -> tuple[float, float]:
    """Shift of the stick disc over a and of the bodies over mu p0 a/E*, for Q = mu P/2 and nu = 0."""
    c = 0.5 ** (1 / 3)
    e = 2.0 * strain / np.pi
    return e, np.pi / 4.0 * (2.0 * (1.0 - c**2) + e**2)


@pytest.mark.parametrize("body", [1, 2])
def test_the_stick_disc_moves_as_the_exact_solution(body: int) -> None:
    pair = Case.from_dict(deck()).pair
    a = (0.75 * LOAD * RADIUS / pair.effective_modulus) ** (1 / 3)
    p0 = 1.5 * LOAD / (np.pi * a**2)
    strain = 0.2 * MU * p0 / pair.effective_modulus
    stress = E * strain * (1 if body == 1 else -1)
    loads = [{"normal_load": LOAD}, {"tangential_load_x": "0.5 mu P", "bulk_stress_xx": stress}]
    result = Case.from_dict(deck(bulk={"body": body}, load=loads)).run()
    last = result.step(-1)
    e, shift = shifted(0.2)
    assert last.stick_center_x.item() / a == pytest.approx(e, abs=0.006)
    assert last.shift_x.item() / (MU * p0 * a / pair.effective_modulus) == pytest.approx(shift, rel=8e-4)
    assert last.bulk_strain_xx.item() == pytest.approx(strain, rel=1e-14)
    assert last.bulk_body.item() == body


def missed(comparison: Comparison) -> list[str]:
    return [f"{row.case}, {row.quantity}" for row in comparison.rows if row.passed is False]


def test_the_strip_of_a_long_contact_moves_as_nowell_and_hills_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shift within 1 %, ends of two-sided slip within 0.015 b; the formulas against bulk.csv."""
    for row in (row for row in bulk.rows() if row["case"] == "2d reverse"):
        ends = bulk.two_signs(float(row["Qx"]), float(row["sigma_or_exx"]))
        assert ends[row["quantity"] == "b2"] == pytest.approx(float(row["value"]), abs=1e-11)
    found = bulk.plane((0.3,), 20, ((0.75, 0.8),), ((0.0, 2.0),))
    assert len(found.rows) == 4
    assert missed(found) == []
    long = bulk._long
    monkeypatch.setattr(bulk, "_long", lambda nu, n, loads: long(nu, n, [bulk_scaled(loads[0], 1.02)]))
    assert len(missed(bulk.plane((0.3,), 20, ((0.75, 0.8),), ()))) == 1  # 2 % more stress is seen


def bulk_scaled(load: dict[str, Any], by: float) -> dict[str, Any]:
    return {name: value * by if "bulk" in name else value for name, value in load.items()}


def test_spheres_under_bulk_strain_are_those_of_the_table() -> None:
    assert missed(bulk.disc(40)) == []
    found = bulk.single_steps(60, slice(1, 2))
    assert len(found.rows) == 4
    assert missed(found) == []


def test_cycles_in_phase_superpose_and_all_cycles_balance() -> None:
    """In phase and in counter-phase (C10), (C11); in any phase the work of the loads is what slip takes."""
    found = bulk.cycles(12, 16)
    assert missed(found) == []
    energy = {row.case: row.computed for row in found.rows if row.quantity.startswith("energy")}
    assert energy["phase 180°"] == pytest.approx(energy["phase 0°"], rel=1e-9)
    assert energy["phase 90°"] < 0.9 * energy["phase 0°"]
    # without strain the loop of Mindlin and Deresiewicz: S = 4/E*
    exact = MindlinContact(1.0, 2 * np.pi / 3, 1.0, 4.0)
    peak = np.pi / 3
    area = 2 * integrate.quad(lambda load: float(exact.shift_unloading(load, peak)), -peak, peak)[0]
    assert bulk.cycle_energy(0.5, 0.0) == pytest.approx(area, rel=1e-9)


def history(share: float, stress: float, phase: float, nu: tuple[float, float] = (0.3, 0.3)) -> Run:
    """Return a cycle of a sphere whose bodies are as stiff as nu makes them, with bulk stress in body 1."""
    first, second = bodies(0.0 if nu[0] == nu[1] else 0.25, 0.4, bulk.BALL)
    return run(
        first,
        second,
        spacing=0.1,
        friction_coefficient=0.3,
        bulk={"body": 1},
        loads=[{"normal_load": 4 / 3}, *bulk.cyclic(share, stress, phase, 8, 1)],
        tolerance=1e-11,
    )


def fields(made: Run, number: int, mirrored: bool = False) -> np.ndarray:
    """Return p, q_x, q_y of the nodes in contact, in the order of x and y; or of their mirror images in x."""
    state = made[number]
    x = -state.x if mirrored else state.x
    inside = np.flatnonzero(state.contact)
    order = inside[np.lexsort((np.round(state.y.flat[inside], 6), np.round(x.flat[inside], 6)))]
    sign = -1.0 if mirrored else 1.0
    found = (state.pressure, sign * state.traction_x, state.traction_y)
    return np.stack([values.flat[order] for values in found])


@pytest.mark.parametrize("phase", [0.0, 90.0, 180.0])
def test_signs_and_mirror_images_of_cycles(phase: float) -> None:
    """Loads of the other sign turn the tractions around; the image in x turns Q around, not the strain."""
    made = history(0.5, 0.3, phase)
    turned = history(-0.5, -0.3, phase)
    image = history(-0.5, 0.3, phase)
    for number in (4, len(made)):
        here = fields(made, number)
        assert np.abs(here[1]).max() > 0.03
        assert fields(turned, number) == pytest.approx(here * [[1.0], [-1.0], [-1.0]], abs=1e-9)
        assert fields(image, number, mirrored=True) == pytest.approx(here, abs=1e-9)


def test_mirror_images_of_a_cycle_of_dissimilar_bodies() -> None:
    made = history(0.5, 0.3, 90.0, (0.3, 0.2))
    image = history(-0.5, 0.3, 90.0, (0.3, 0.2))
    for number in (5, len(made)):
        assert fields(image, number, mirrored=True) == pytest.approx(fields(made, number), abs=1e-8)


def test_plane_strain_takes_a_stress_across() -> None:
    bodies = {k: b | {"poisson_ratio": 0.3} for k, b in deck()["body"].items()}
    loads = [{"normal_load": LOAD, "bulk_stress_xx": "50 MPa", "bulk_stress_xy": "10 MPa"}]
    strained = Case.from_dict(
        deck(body=bodies, bulk={"body": 1, "state": "plane strain y"}, load=loads)
    ).run()
    last = strained.step(-1)
    assert last.bulk_stress_yy.item() == pytest.approx(0.3 * 50e6, rel=1e-14)
    assert last.bulk_strain_xx.item() == pytest.approx((1 - 0.3**2) * 50e6 / E, rel=1e-14)
    assert last.bulk_strain_yy.item() == 0.0
    assert last.bulk_strain_xy.item() == pytest.approx(1.3 * 10e6 / E, rel=1e-14)


def test_the_bulk_stress_is_there_far_below_its_body_only() -> None:
    loads = [{"normal_load": LOAD}, {"bulk_stress_xx": "80 MPa", "bulk_stress_xy": "-30 MPa", "steps": 2}]
    result = Case.from_dict(deck(load=loads)).run()
    far = {"points": [[0.0, 0.0, 1.0]]}
    own = result.stress("stress_xx", "stress_xy", "stress_zz", step=[1, 2, 3], body=1, **far)
    assert own.stress_xx.values[:, 0] == pytest.approx([0.0, 40e6, 80e6], abs=1e3)
    assert own.stress_xy.values[:, 0] == pytest.approx([0.0, -15e6, -30e6], abs=1e3)
    assert own.stress_zz.values[:, 0] == pytest.approx([0.0, 0.0, 0.0], abs=1e3)
    other = result.stress("stress_xx", body=2, **far)
    assert other.stress_xx.values == pytest.approx([0.0], abs=1e3)
    session = Case.from_dict(deck(load=loads[:1])).start()
    next(session)
    step = session.advance(bulk_stress_xx=80e6, bulk_stress_xy=-30e6, steps=2)
    found = step.stress_at([[0.0, 0.0, 1.0]], "stress_xx").stress_xx.values
    assert found == pytest.approx(own.stress_xx.values[-1], rel=1e-12)


def test_no_closed_solution_of_shear_is_claimed_under_bulk_stress() -> None:
    loads = [{"normal_load": LOAD}, {"tangential_load_x": "0.5 mu P", "bulk_stress_xx": "30 MPa"}]
    strained = Case.from_dict(deck(load=loads)).run()
    del loads[1]["bulk_stress_xx"]
    plain = Case.from_dict(deck(load=loads)).run()
    assert {entry.solution for entry in plain.compare().entries} == {"Hertz", "Cattaneo–Mindlin"}
    assert {entry.solution for entry in strained.compare().entries} == {"Hertz"}


def test_a_resumed_cycle_has_the_same_bits(tmp_path: Path) -> None:
    cycle = [
        {"bulk_stress_xx": "60 MPa", "tangential_load_x": "0.3 mu P", "steps": 2},
        {"bulk_stress_xx": "-60 MPa", "tangential_load_x": "-0.3 mu P", "steps": 2},
    ]
    case = Case.from_dict(
        deck(grid={"nodes_in_radius": 6}, load=[{"normal_load": LOAD}, {"path": cycle, "repeat": 2}])
    )
    whole = case.run()

    def stop(step: Any) -> None:
        if step.number == 4:
            raise hexcontact.StopRun("enough")

    part = tmp_path / "part.nc"
    case.run(part, on_step=stop)
    resumed = hexcontact.resume(part)
    for name in (
        "traction_x",
        "relative_displacement_x",
        "bulk_stress_xx",
        "bulk_strain_xx",
        "dissipated_energy",
    ):
        assert np.array_equal(whole.dataset[name], resumed.dataset[name], equal_nan=True), name


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"bulk": None}, r"load.1.bulk_stress_xx = .*expected a \[bulk\] table, which names the body"),
        ({"friction": None}, r"bulk_stress_xx = .*expected nothing, or a \[friction\] table"),
        (
            {"bulk": {"body": 1, "state": "plane strain x"}},
            "in plane strain x it follows from the other component",
        ),
        ({"bulk": {"body": 3}}, "bulk.body = 3"),
        (
            {"body": {"1": {"rigid": True}, "2": deck()["body"]["2"]}},
            "expected an elastic body; body 1 is rigid",
        ),
    ],
)
def test_bulk_stress_without_sense_is_one_sentence(change: dict[str, Any], sentence: str) -> None:
    given = deck(load=[{"normal_load": LOAD, "bulk_stress_xx": "50 MPa"}], **change)
    with pytest.raises(DeckError, match=sentence) as caught:
        Case.from_dict({name: table for name, table in given.items() if table is not None})
    assert len(str(caught.value).splitlines()) == 1
