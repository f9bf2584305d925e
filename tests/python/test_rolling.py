"""Rolling from deck to result: loads, creepages and powers, plane references, refused decks, resumed runs."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from validation import rolling

from hexcontact import Case, ConvergenceError, DeckError, Study, open_result, plotting, resume
from hexcontact.cli.printed import Summary
from hexcontact.core.friction import Rolling
from hexcontact.plotting.history import study as draw_study
from hexcontact.problem import plausibility
from hexcontact.result.history_words import remarks, step_rows

F, D = "force", "displacement"
STEADY = Rolling(0.0, steady=True)


def ball(*loads: dict[str, Any], **tables: Any) -> dict[str, Any]:
    """Return a deck of a ball that is pressed by 100 N, with rolling loads."""
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.25}
    return {
        "body": {"1": {**steel, "surface": {"shape": "sphere", "radius": 0.01}}, "2": steel},
        "friction": {"coefficient": 0.3},
        "grid": {"nodes_in_radius": 8},
        "load": [{"normal_load": 100.0}, *loads],
        **tables,
    }


def last(deck: dict[str, Any]) -> dict[str, Any]:
    return Case.from_dict(deck).run().history.iloc[-1].to_dict()


# --- from the deck ------------------------------------------------------------------------------------------


def extrapolated(quantity: str, creepages: dict[str, float]) -> float:
    """Return a load over mu P (torque: over mu P a) in the limit of a fine lattice, by 8 and 16 spacings."""
    found = []
    for nodes in (12, 24):
        deck = ball({"rolling": "steady", **creepages}, grid={"nodes_in_radius": nodes})
        case = Case.from_dict(deck)
        history = case.run().history.iloc[-1]
        radius = (0.75 * 100.0 * 0.01 / case.pair.effective_modulus) ** (1 / 3)
        found.append(history[quantity] / (30.0 * (radius if quantity == "torque" else 1.0)))
    return 2.0 * found[1] - found[0]


def scaled(xi: float, eta: float, phi: float) -> dict[str, float]:
    """Return creepages given in mu p0/G, and spin in mu p0/(G a)."""
    pair = Case.from_dict(ball()).pair
    radius = (0.75 * 100.0 * 0.01 / pair.effective_modulus) ** (1 / 3)
    unit = 0.3 * 150.0 / (math.pi * radius**2) / (210e9 / 2.5)
    return {"creepage_x": xi * unit, "creepage_y": eta * unit, "spin": phi * unit / radius}


@pytest.mark.parametrize(
    "creepage", [(-0.1, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.0, -0.2, 0.0), (0.0, 0.0, 1.0)], ids=str
)
def test_loads_of_creepages_tend_to_the_reference(creepage: tuple[float, float, float]) -> None:
    names = {"Fx": "tangential_load_x", "Fy": "tangential_load_y", "Mz": "torque"}
    rows = [
        r for r in rolling.rows("nonlinear") if tuple(float(r[k]) for k in ("xi", "eta", "phi")) == creepage
    ]
    assert len(rows) == 3
    for row in rows:
        found = extrapolated(names[row["quantity"]], scaled(*creepage))
        # twice the uncertainty: two lattices, of which the nodes at the edge are not averaged
        assert found == pytest.approx(float(row["own"]), abs=2 * float(row["uncertainty"])), row["quantity"]


def test_creepages_follow_from_loads_and_lead_back_to_them() -> None:
    by_load = last(ball({"rolling": "steady", "tangential_load_x": "0.5 mu P", "tangential_load_y": 3.0}))
    assert by_load["tangential_load_x"] == pytest.approx(15.0, rel=1e-7)
    assert by_load["creepage_x"] < 0.0 < -by_load["creepage_y"]
    given = {name: by_load[name] for name in ("creepage_x", "creepage_y")}
    back = last(ball({"rolling": "steady", **given}))
    assert back["tangential_load_x"] == pytest.approx(15.0, rel=1e-6)
    assert back["tangential_load_y"] == pytest.approx(3.0, rel=1e-6)
    with_torque = ball(
        {"rolling": "steady", "tangential_load_x": 9.0, "tangential_load_y": 0.0, "torque": 2e-4}
    )
    spun = last(with_torque)
    assert spun["torque"] == pytest.approx(2e-4, rel=1e-6)
    assert spun["spin"] < 0.0


def test_a_segment_with_steps_is_a_creep_curve() -> None:
    result = Case.from_dict(ball({"rolling": "steady", "creepage_x": -0.008, "steps": 8})).run()
    history = result.history
    np.testing.assert_allclose(history["creepage_x"], np.linspace(0.0, -0.008, 9), atol=1e-15)
    loads = history["tangential_load_x"].to_numpy()
    assert (np.diff(loads) > -1e-9).all()
    assert loads[-1] == pytest.approx(30.0, rel=1e-3)
    assert loads[-1] <= 30.0 * (1 + 1e-9)
    assert (history["dissipated_energy"] <= 0.0).all()
    rolled = history[1:]
    np.testing.assert_allclose(rolled["creep_power"], -rolled["tangential_load_x"] * rolled["creepage_x"])
    # the scheme dissipates the rest
    assert (rolled["slip_power"] < rolled["creep_power"]).all()
    # points after the first start from the one before
    assert rolled["operator_applications"].max() < 60
    drawn = plotting.creep(result)
    assert drawn.axes[0].get_xlabel() == "creepage x"
    with pytest.raises(DeckError, match="expected creep"):
        plotting.loop(result)


def test_a_creep_curve_of_unlike_bodies_takes_little_more_work() -> None:
    bodies = ball()["body"] | {"2": {"young_modulus": 70e9, "poisson_ratio": 0.33}}
    loads = {"rolling": "steady", "tangential_load_x": "0.9 mu P", "steps": 9}
    history = Case.from_dict(ball(loads, body=bodies, friction={"coefficient": 0.1})).run().history
    assert history["operator_applications"][2:].max() < 45
    assert history["creepage_x"].iloc[-1] < 0.0 < history["creepage_x"].iloc[1]


def test_rolling_is_not_compared_with_solutions_of_bodies_that_do_not_roll() -> None:
    result = Case.from_dict(
        ball({"tangential_load_x": 9.0}, {"rolling": "steady", "tangential_load_x": 15.0})
    ).run()
    assert "Cattaneo" in str(result.compare(step=2))
    assert "Hertz" in str(result.compare())
    assert "Cattaneo" not in str(result.compare())
    with pytest.raises(DeckError, match="of rolling bodies are no cycle"):
        result.wear(1e-14, steps=[2, 3])


def test_a_distance_leads_to_the_steady_state() -> None:
    drive = {"tangential_load_x": 15.0, "creepage_y": 0.0005}
    case = Case.from_dict(ball({"rolling": 2e-3, **drive}, {"rolling": "steady"}))
    spacing = case.lattice.spacing
    history = case.run().history
    assert len(history) == round(2e-3 / spacing) + 2
    before, steady = history.iloc[-2], history.iloc[-1]
    assert before["rolled_distance"] == pytest.approx(spacing * (len(history) - 2))
    for name in ("creepage_x", "tangential_load_y", "slip_power"):
        assert before[name] == pytest.approx(steady[name], rel=1e-4), name
    energy = history["dissipated_energy"].to_numpy()
    assert energy[-2] - energy[-3] == pytest.approx(steady["slip_power"] * spacing, rel=1e-4)


@pytest.mark.parametrize("direction", ["60 deg", "-120 deg", "35 deg"])
def test_the_lattice_has_a_row_along_the_direction(direction: str) -> None:
    angle = math.radians(float(direction.split()[0]))
    along = last(ball({"rolling": "steady", "creepage_x": -0.002, "creepage_y": 0.001}))
    c, s = math.cos(angle), math.sin(angle)
    turned = {"creepage_x": -0.002 * c - 0.001 * s, "creepage_y": -0.002 * s + 0.001 * c}
    found = last(ball({"rolling": "steady", "rolling_direction": direction, **turned}))
    x, y = found["tangential_load_x"], found["tangential_load_y"]
    assert c * x + s * y == pytest.approx(along["tangential_load_x"], rel=1e-6)
    assert c * y - s * x == pytest.approx(along["tangential_load_y"], rel=1e-6)


def test_a_run_in_the_middle_of_a_distance_resumes_to_the_same_bits(tmp_path: Path) -> None:
    deck = ball({"rolling": 1e-4, "creepage_x": -0.002}, {"rolling": "steady", "spin": 3.0})
    whole = Case.from_dict(deck).run(output=tmp_path / "whole.nc")
    case = Case.from_dict(deck)

    class StopError(Exception):
        pass

    def stop(step: Any) -> None:
        if step.number == 5:
            raise StopError

    with pytest.raises(StopError):
        case.run(output=tmp_path / "part.nc", on_step=stop)
    resumed = resume(tmp_path / "part.nc")
    for name in ("traction_x", "traction_y", "accumulated_slip", "creepage_x", "rolled_distance"):
        np.testing.assert_array_equal(resumed.dataset[name], whole.dataset[name], name)
    again = open_result(tmp_path / "whole.nc").dataset
    assert again["spin"].attrs["units"] == "rad/m"


def test_no_slip_is_the_linear_theory() -> None:
    creepages = scaled(-0.1, 0.0, 0.0)
    small, large = (
        last(
            ball(
                {"rolling": "steady", "creepage_x": k * creepages["creepage_x"]},
                friction={"coefficient": math.inf},
            )
        )
        for k in (1.0, 10.0)
    )
    assert large["tangential_load_x"] == pytest.approx(10 * small["tangential_load_x"], rel=1e-6)
    pair = Case.from_dict(ball()).pair
    radius = (0.75 * 100.0 * 0.01 / pair.effective_modulus) ** (1 / 3)
    c_11 = small["tangential_load_x"] / (-(radius**2) * 210e9 / 2.5 * creepages["creepage_x"])
    assert c_11 == pytest.approx(4.24, abs=0.06)  # at 8 spacings in the radius; 4.115 in the limit


@pytest.mark.parametrize(
    ("ratio", "poisson_ratio"), [(0.5, 0.25), (1.0, 0.0), (1.0, 0.25), (1.0, 0.5), (2.0, 0.25)]
)
def test_coefficients_of_the_linear_theory(ratio: float, poisson_ratio: float) -> None:
    found = rolling.coefficients(ratio, poisson_ratio, (8, 16))
    wanted = [
        row
        for row in rolling.rows("linear")
        if (float(row["nu"]), float(row["a/b"])) == (poisson_ratio, ratio)
    ]
    assert len(wanted) == 4
    for row in wanted:
        within = 2 * float(row["uncertainty"])
        assert found[row["quantity"]] == pytest.approx(float(row["own"]), abs=within), row["quantity"]


@pytest.mark.parametrize(
    "row", [row for row in rolling.printed() if row["nu"] == "0.25"], ids=lambda row: row["a/b"]
)
def test_coefficients_of_slender_ellipses_are_those_of_print(row: dict[str, str]) -> None:
    for name, found in rolling.coefficients(float(row["a/b"]), 0.25, (12, 24)).items():
        assert found == pytest.approx(float(row[name]), rel=0.03), name


# --- plane references ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("creepage", [-0.2, -0.6, -1.0])
def test_middle_of_a_roller_is_as_carter_has_it(creepage: float) -> None:
    contact, lattice, load = rolling.strip(50, 40.0, 1.0)
    state = contact.advance(contact.virgin(), [F, D, D, D], [load, creepage, 0, 0], rolling=STEADY)
    assert state.converged
    assert rolling.in_the_middle(lattice, state) == pytest.approx(
        1.0 - (1.0 - abs(creepage) / 2) ** 2, rel=3e-3
    )


@pytest.mark.parametrize(("behind", "expected"), [(1.0, -0.0015), (0.5, 0.0073)])
def test_error_by_the_place_of_the_front_between_nodes(behind: float, expected: float) -> None:
    contact, lattice, load = rolling.strip(25, 40.0, 1.0, behind=behind)
    state = contact.advance(contact.virgin(), [F, D, D, D], [load, -0.6, 0, 0], rolling=STEADY)
    assert rolling.in_the_middle(lattice, state) / 0.51 - 1.0 == pytest.approx(expected, abs=3e-4)


@pytest.mark.parametrize(("friction", "reference", "within"), [(0.002, 1.8202, 5e-3), (0.2, 1.2860, 1e-2)])
def test_middle_of_an_unlike_roller_creeps_freely(friction: float, reference: float, within: float) -> None:
    beta, length = 0.1438337, 60.0
    contact, lattice, load = rolling.strip(50, length, friction, beta)
    state, found = contact.virgin(), []
    # the load beyond the ends of the roller is missing: 4 lambda_2 P'/L
    expected = -beta * (reference - 2.0 / length)
    for creepage in (0.98 * expected, 1.02 * expected):
        state = contact.advance(state, [F, D, D, D], [load, creepage, 0, 0], rolling=STEADY)
        assert state.converged
        found.append((creepage, rolling.in_the_middle(lattice, state)))
    (low, before), (high, after) = found
    free = low - before * (high - low) / (after - before)
    assert -free / beta + 2.0 / length == pytest.approx(reference, rel=within)


# --- refused decks ------------------------------------------------------------------------------------------

CREEP = {"rolling": "steady", "creepage_x": -0.001}


@pytest.mark.parametrize(
    ("loads", "tables", "words"),
    [
        ([{"rolling": "steady", "tangential_load_x": 30.0}], {}, "tangential_load_x = .*expected less than"),
        ([{"rolling": 1e-4, "tangential_load_y": "1 mu P"}], {}, "tangential_load_y = .*expected less than"),
        ([{**CREEP, "tangential_load_x": 3.0}], {}, "expected tangential_load_x or creepage_x, not both"),
        ([{**CREEP, "spin": 1.0, "torque": 1e-4}], {}, "expected torque or spin, not both"),
        ([{"creepage_x": 0.001}], {}, "needs rolling beside it"),
        ([{**CREEP, "shift_y": 1e-6}], {}, "load.2.shift_y = .*expected nothing beside rolling"),
        ([{**CREEP, "torque": 1e-4}], {}, "load.2.torque = .*expected tangential_load_y beside it"),
        ([CREEP, {"tangential_load_x": 1.0}], {}, "load.3.rolling: missing; expected rolling"),
        ([{"rolling": "slowly"}], {}, 'expected "steady" or a length above 0'),
        ([{"rolling": 1e-4, "steps": 3}], {}, "load.2.steps = 3: expected nothing beside a rolled distance"),
        ([{"rolling": 1000.0}], {}, "load.2.rolling = 1000.0: expected at most 100000 spacings"),
        ([{**CREEP, "steps": "auto"}], {}, "load.2.steps = .*expected a number beside rolling"),
        ([CREEP], {"solver": {"method": "direct"}}, 'solver.method = "direct": expected "fft"'),
        ([CREEP], {"solver": {"algorithm": "static"}}, 'solver.algorithm = "static": expected "incremental"'),
        ([CREEP], {"solver": {"entry": "interpolated"}}, "solver.entry = .*expected"),
        ([CREEP], {"bulk": {"body": 2}}, "bulk: is not available beside rolling"),
        ([CREEP], {"accuracy": {"target": 0.05}}, "accuracy: is not available beside rolling yet"),
        (
            [CREEP],
            {"grid": {"extent": [1e-3, 1e-3], "nodes_across": 48, "boundary": "periodic"}},
            'grid.boundary = "periodic": expected "free" beside rolling',
        ),
        (
            [CREEP],
            {"grid": {"nodes_in_radius": 8, "direction": "10 deg"}},
            "rolling_direction = .*expected the direction of a row of the lattice",
        ),
    ],
)
def test_decks_that_make_no_sense_are_refused(loads: list[Any], tables: dict[str, Any], words: str) -> None:
    with pytest.raises(DeckError, match=words):
        Case.from_dict(ball(*loads, **tables))


def test_a_torque_that_friction_cannot_carry_is_no_solution() -> None:
    deck = ball({"rolling": "steady", "torque": 1.0, "tangential_load_y": 0.0})
    with pytest.raises(ConvergenceError, match=r"gross sliding: .*\(creepage_x, creepage_y, spin\)"):
        Case.from_dict(deck).run()


def test_loads_by_hand_are_refused() -> None:
    session = Case.from_dict(ball(CREEP)).start()
    next(session)
    with pytest.raises(DeckError, match="expected all loads of rolling bodies in"):
        session.advance(tangential_load_x=3.0)
    assert next(session).history["creepage_x"] == -0.001


def test_a_rounded_distance_is_noted(caplog: pytest.LogCaptureFixture) -> None:
    case = Case.from_dict(ball({"rolling": 1e-4, "creepage_x": -0.001}))
    with caplog.at_level("INFO", logger="hexcontact"):
        result = case.run()
    words = f"{round(1e-4 / case.lattice.spacing)} spacings of the lattice, and not 100.0 µm"
    assert 'note="segment 2 rolls' in caplog.text
    for place in (caplog.text, repr(case), result.dataset.attrs["notes"]):
        assert words in place


# --- surfaces that move with their bodies -------------------------------------------------------------------

DENT = {"shape": "dent", "depth": 4e-7, "radius": 8e-5, "rim": 5e-8, "moves": True}
DRIVEN = {"tangential_load_x": 9.0, "creepage_y": 0.0005}


def dented(at: tuple[float, float], *loads: dict[str, Any], **tables: Any) -> dict[str, Any]:
    """Return a deck of the ball with a dent that is bound to it."""
    deck = ball(*loads, **tables)
    deck["body"]["1"]["surface"] = [deck["body"]["1"]["surface"], DENT | {"offset": at}]
    return deck


def test_a_dent_far_away_changes_nothing() -> None:
    load = {"rolling": 6e-5, **DRIVEN}
    plain = Case.from_dict(ball(load)).run().dataset
    far = Case.from_dict(dented((3e-3, 0.0), load)).run().dataset
    for name in ("pressure", "traction_x", "slip_increment_y", "creepage_x", "approach"):
        np.testing.assert_array_equal(far[name], plain[name], name)
    np.testing.assert_array_equal(far["moved_gap"][-1], far["initial_gap"])


def test_a_dent_passes_and_leaves_the_steady_state() -> None:
    case = Case.from_dict(dented((3.5e-4, 0.0), {"rolling": 1.6e-3, **DRIVEN}))
    result = case.run()
    history = result.history
    steady = last(ball({"rolling": "steady", **DRIVEN}))
    for name in ("creepage_x", "tangential_load_y", "slip_power", "max_pressure", "approach"):
        assert history[name].iloc[-1] == pytest.approx(steady[name], rel=1e-3), name
        assert np.ptp(history[name].iloc[1:]) > 0.004 * abs(steady[name]), name
    # bodies are alike, so the pressure is that of a dent at rest at the place it has come to
    chosen = [8, 12, 20]
    for step in chosen:
        place = 3.5e-4 - step * case.lattice.spacing
        at_rest = ball(grid={"spacing": case.lattice.spacing, "window": list(case.lattice.shape)})
        still = DENT | {"offset": (place, 0.0), "moves": False}
        at_rest["body"]["1"]["surface"] = [at_rest["body"]["1"]["surface"], still]
        pressure = Case.from_dict(at_rest).run().dataset["pressure"][-1]
        np.testing.assert_allclose(
            result.dataset["pressure"][step], pressure, atol=1e-6 * float(pressure.max()), err_msg=str(step)
        )


def test_the_mirrored_dent_has_the_mirrored_history() -> None:
    there, mirrored = (
        Case.from_dict(
            dented((2e-4, side * 6e-5), {"rolling": 4e-4, "creepage_x": -1e-3, "creepage_y": side * 5e-4})
        )
        .run()
        .history
        for side in (1.0, -1.0)
    )
    for name, sign in (
        ("tangential_load_x", 1),
        ("tangential_load_y", -1),
        ("torque", -1),
        ("slip_power", 1),
    ):
        size = abs(there[name]).max()
        np.testing.assert_allclose(mirrored[name], sign * there[name], atol=1e-6 * size, err_msg=name)


def test_a_dent_comes_from_the_direction_of_rolling_and_back() -> None:
    loads = {"rolling": 3e-4, "creepage_x": -1e-3}, {"rolling": 1e-4, "rolling_direction": "180 deg"}
    along = Case.from_dict(dented((2e-4, 0.0), *loads)).run().history
    c, s = math.cos(math.pi / 3), math.sin(math.pi / 3)
    turned = (
        {"rolling": 3e-4, "rolling_direction": "60 deg", "creepage_x": -1e-3 * c, "creepage_y": -1e-3 * s},
        {"rolling": 1e-4, "rolling_direction": "-120 deg"},
    )
    found = Case.from_dict(dented((2e-4 * c, 2e-4 * s), *turned)).run().history
    for name in ("max_pressure", "approach", "slip_power", "rolled_distance"):
        np.testing.assert_allclose(found[name], along[name], rtol=1e-6, err_msg=name)
    back = np.searchsorted(along["segment"], 3)
    assert along["approach"].iloc[back] == pytest.approx(along["approach"].iloc[back - 2], rel=1e-7)
    assert (np.diff(along["rolled_distance"].dropna()) > 0.0).all()


def test_a_run_with_a_dent_resumes_to_the_same_bits(tmp_path: Path) -> None:
    deck = dented((1.5e-4, 2e-5), {"rolling": 1.5e-4, **DRIVEN})
    whole = Case.from_dict(deck).run(output=tmp_path / "whole.nc").dataset

    class StopError(Exception):
        pass

    def stop(step: Any) -> None:
        if step.number == 7:
            raise StopError

    with pytest.raises(StopError):
        Case.from_dict(deck).run(output=tmp_path / "part.nc", on_step=stop)
    resumed = resume(tmp_path / "part.nc").dataset
    for name in ("pressure", "traction_x", "accumulated_slip", "moved_gap", "approach", "creepage_x"):
        np.testing.assert_array_equal(resumed[name], whole[name], name)


def test_a_map_that_moves_is_the_dent_it_holds() -> None:
    along, across = np.linspace(-4e-4, 9e-4, 261), np.linspace(-4e-4, 4e-4, 161)
    load = {"rolling": 2e-4, **DRIVEN}
    deck = dented((2e-4, 0.0), load)
    dent = Case.from_dict(deck).run().history
    far = np.hypot(along[:, None] - 2e-4, across) / DENT["radius"]
    heights = DENT["depth"] * np.maximum(1.0 - far**2, 0.0) ** 2
    heights -= np.where(abs(far - 1.25) < 0.25, DENT["rim"] * np.sin(2 * math.pi * (far - 1.0)) ** 2, 0.0)
    shape = {"shape": "map", "x": along, "y": across, "heights": heights, "upwards": False, "moves": True}
    deck["body"]["1"]["surface"][1] = shape
    mapped = Case.from_dict(deck).run().history
    np.testing.assert_allclose(mapped["max_pressure"], dent["max_pressure"], rtol=2e-3)
    np.testing.assert_allclose(mapped["creepage_x"], dent["creepage_x"], rtol=2e-2, atol=1e-6)
    deck["load"][1]["rolling"] = 8e-4
    with pytest.raises(DeckError, match=r"body.1.surface.2: the contact of load step \d+ .*end"):
        Case.from_dict(deck).run()


@pytest.mark.parametrize(
    ("loads", "shape", "words"),
    [
        (
            [{"rolling": "steady", **DRIVEN}],
            DENT,
            'load.2.rolling = "steady": expected a distance: .*moves = true',
        ),
        ([{"rolling": 1e-4}, {"rolling": "steady"}], DENT, "load.3.rolling = .*expected a distance"),
        ([{"tangential_load_x": 3.0}], DENT, "body.1.surface: expected no moves = true without rolling"),
        (
            [{"rolling": 1e-4}],
            {"shape": "punch", "radius": 1e-3, "moves": True},
            "body.1.surface: expected no moves = true of a punch, which ends",
        ),
    ],
)
def test_surfaces_that_cannot_move_are_refused(loads: list[Any], shape: dict[str, Any], words: str) -> None:
    deck = ball(*loads)
    deck["body"]["1"]["surface"] = [deck["body"]["1"]["surface"], shape]
    with pytest.raises(DeckError, match=words):
        Case.from_dict(deck)


# --- power and wear -----------------------------------------------------------------------------------------


def test_power_of_creep_forces_has_the_dissipation_of_the_lattice_as_error_bar(capsys: Any) -> None:
    loads = {"tangential_load_x": 15.0}, {"rolling": 3e-4, "tangential_load_x": 15.0}, {"rolling": "steady"}
    result = Case.from_dict(ball(*loads)).run()
    rolled = result.history[2:]
    power, slip, error = (rolled[name] for name in ("creep_power", "slip_power", "creep_power_error"))
    # on the way to the steady state elastic energy is stored, too: the bar is less than the difference
    assert (error > 0.0).all()
    assert error.iloc[1] < 0.5 * (power - slip).iloc[1]
    assert error.iloc[-1] == pytest.approx(power.iloc[-1] - slip.iloc[-1], rel=1e-6)
    fine = Case.from_dict(ball(loads[2] | loads[0], grid={"nodes_in_radius": 24})).run().history.iloc[-1]
    assert abs(power.iloc[-1] - fine["creep_power"]) < error.iloc[-1]
    assert fine["creep_power_error"] < 0.5 * error.iloc[-1]
    spun = last(ball({"rolling": "steady", "creepage_y": 1e-3, "spin": 10.0}))
    assert abs(spun["creep_power"] - spun["slip_power"]) <= spun["creep_power_error"] * (1 + 1e-6)
    Summary.of_result(result).print()
    shown = capsys.readouterr().out
    assert "frictional power" in shown
    assert "steady" in shown
    assert re.search(r"creep power +\S+ mJ/m ± \d+", shown)
    assert "uncertain" not in shown


def test_steady_rolling_has_no_note_on_the_dissipated_energy() -> None:
    deck = ball({"rolling": "steady", "creepage_x": -0.001})
    deck["body"]["2"] = {"young_modulus": 70e9, "poisson_ratio": 0.33}
    result = Case.from_dict(deck).run()
    assert "creep_power_error" not in result
    rows = dict(step_rows(result.history.iloc[-1].to_dict()))
    assert "size of load steps" not in rows
    said = remarks(result.history.to_dict("records"), result.dataset.attrs)
    assert "dissipated energy" not in " ".join(said)
    assert not any("dissipated" in sentence for sentence in plausibility.warnings(Case.from_dict(deck)))


def test_wear_of_a_pass_holds_the_volume_by_distance() -> None:
    loads = {"rolling": 1.2e-3, "tangential_load_x": 15.0, "creepage_y": 2e-4}, {"rolling": "steady"}
    result = Case.from_dict(ball(*loads)).run()
    across = result.lattice.cell_area / result.lattice.spacing
    for steps in ([-2], [-1]):
        worn = result.wear(1e-13, steps=steps)
        # behind the contact a row has the depth of one pass
        track = float(worn["worn_depth"][:, 1].sum()) * across
        assert track == pytest.approx(float(worn["wear_by_distance"]), rel=1e-3), steps
        assert 0.0 < float(worn["wear_by_distance_error"]) < 0.5 * track
        assert float(worn["worn_depth"].max()) == pytest.approx(
            float(worn["worn_depth"][:, 1].max()), rel=1e-3
        )
    # depth is k p |ds|, gathered along a row
    step = result.step(-1)
    slipped = np.where(step["zone"] == 2, np.hypot(step["slip_increment_x"], step["slip_increment_y"]), 0.0)
    depth = 1e-13 * (step["pressure"].values * slipped)
    np.testing.assert_allclose(
        worn["worn_depth"][:, 1], depth.sum(axis=1), atol=1e-6 * depth.sum(axis=1).max()
    )
    with pytest.raises(DeckError, match="expected a load step in which the bodies roll"):
        result.wear(1e-13, steps=[1])


def test_study_of_creepages_draws_loads_and_power(tmp_path: Path) -> None:
    deck = ball({"rolling": "steady", "creepage_y": 1e-4}, grid={"nodes_in_radius": 4})
    axes = {"load.2.creepage_x": [-1e-3, 0.0, 1e-3], "load.2.spin": [0.0, 5.0]}
    drawn = draw_study(Study(deck, axes, output=tmp_path / "creep.nc").run())
    labels = [panel.get_ylabel() for panel in drawn.axes if panel.get_ylabel()]
    assert [label.split(" (")[0] for label in labels] == [
        "tangential load x",
        "tangential load y",
        "torque",
        "creep power",
    ]
