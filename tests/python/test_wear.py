"""Wear by cycles: volume and dissipated work, the limiting shape, jumps, restart, what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import TriMesh

import hexcontact
from hexcontact import Case, DeckError, ElasticPair, NormalContact, PathWarning, plotting
from hexcontact.cli.printed import Summary
from hexcontact.deck.toml import starter
from hexcontact.result.history_words import energy_table, step_rows
from hexcontact.result.journal import Journal, journal_of
from hexcontact.solve import steps as solving
from hexcontact.text import cycle_count

MODULUS, RADIUS, CONTACT, MU, WEAR = 1e11, 1e-2, 1e-4, 0.5, 1e-14
EFFECTIVE = MODULUS / 2  # E* of two bodies with nu = 0, and the same number for shear, 2 G / 2
APPROACH = CONTACT**2 / RADIUS
STICK = 0.6 * CONTACT
SHIFT = MU * (APPROACH - STICK**2 / RADIUS)  # of which this disc sticks (Cattaneo, Mindlin)
CYCLE = [{"shift_x": SHIFT, "steps": 3}, {"shift_x": -SHIFT, "steps": 6}, {"shift_x": 0.0, "steps": 3}]


def fretting(**changes: Any) -> Case:
    """A sphere of nu = 0 at a fixed approach, shifted to and fro in partial slip."""
    body = {"young_modulus": MODULUS, "poisson_ratio": 0.0}
    wear = {"coefficient_1": WEAR, "cycle": "fretting", "cycles": 400_000} | changes.pop("wear", {})
    given: dict[str, Any] = {
        "body_1": body | {"surface": {"shape": "sphere", "radius": RADIUS}},
        "body_2": body,
        "nodes_in_radius": 6,
        "friction_coefficient": MU,
        "loads": [{"approach": APPROACH, "shift_x": 0.0}, {"label": "fretting", "path": CYCLE}],
    }
    return Case(**(given | changes), wear=wear)


def worn(result: hexcontact.Result) -> Any:
    """Return the cycles of a result that wore the surfaces."""
    return result.dataset.isel(step=result.dataset["wear_cycles"].values >= 0)


@pytest.mark.parametrize("mu", [MU, "0.4 + 0.2*tanh(x/1e-4)"])
def test_worn_volume_is_that_of_the_dissipated_work(mu: float | str) -> None:
    found = worn(fretting(friction_coefficient=mu, wear={"cycles": 20_000}).run())
    spent = found["dissipation_density"].values - found["dissipation_density"].values[0]
    at = mu if isinstance(mu, float) else 0.4 + 0.2 * np.tanh(found["x"].values / 1e-4)
    assert np.abs(WEAR / at * spent - found["worn_depth"].values).max() < 1e-13 * found["worn_depth"].max()
    if isinstance(mu, float):  # a sum of the same numbers in another order
        energy = found["dissipated_energy"].values - found["dissipated_energy"].values[0]
        assert WEAR / mu * energy == pytest.approx(found["wear_volume"].values, rel=1e-13)
    assert (np.diff(found["wear_volume"]) > 0).all()
    assert found["wear_cycles"].values[-1] == 20_000
    for name in ("residual_normal", "residual_tangential"):
        assert (found[name] <= found.attrs["cycle_tolerance"]).all()


def test_worn_contact_carries_its_load_on_the_stick_zone() -> None:
    # V. L. Popov, Sci. Rep. 4 (2014) 3749: P = 2 E* (d c - c^3/(3 R)) on the disc that sticks
    result = fretting(nodes_in_radius=10, wear={"cycles": 10**7, "tolerance": 0.3}).run()
    found = worn(result)
    last = found.isel(step=-1)
    limit = 2 * EFFECTIVE * (APPROACH * STICK - STICK**3 / (3 * RADIUS))
    # the edge of the disc is known to 0.3 spacings, 5 % of its radius; validation/wear.py has finer lattices
    assert float(last["normal_load"]) == pytest.approx(limit, rel=0.04)
    r = np.hypot(last["x"], last["y"]).values
    spacing = float(found.attrs["lattice_spacing"])
    # there it just touches, to the residuals of a cycle
    assert last["pressure"].values[r > STICK + spacing].max() < 3e-3 * last["pressure"].max()
    assert not last["worn_depth"].values[r < STICK - spacing].any()
    assert float(found["normal_load"][0]) > 1.2 * limit
    # nothing of Hertz, Cattaneo and Mindlin holds for worn surfaces
    assert result.compare(step=2).entries
    assert not result.compare().entries
    rows = dict(step_rows(result.history.iloc[-1].to_dict()))
    assert {"cycles of wear", "wear volume", "max worn depth"} <= rows.keys()
    # what is worn is shown where nothing touches any more, too
    axes = plotting.FIGURES["worn_depth"](result).axes[0]
    [shades] = [drawn for drawn in axes.collections if isinstance(drawn, TriMesh)]
    unworn = last["worn_depth"].values[last["pressure"].values > 0.0].max()
    assert shades.get_array().max() == pytest.approx(1e9 * float(last["max_worn_depth"]))
    assert float(last["max_worn_depth"]) > 2 * unworn
    # beyond the nodes that stuck it just touches: to 0.13 %, 3 % after jumps by the pressure before them
    stuck = last["worn_depth"].values == 0.0
    disc = NormalContact(
        result.lattice,
        ElasticPair.from_materials(MODULUS, 0.0, MODULUS, 0.0),
        last["initial_gap"].values,
        stuck & (r < STICK + spacing),
        rim_warning=False,
    )
    depth = np.where(stuck, 0.0, np.maximum(-disc.solve(approach=APPROACH).gap, 0.0))
    assert np.abs(last["worn_depth"] - depth).max() < 0.01 * depth.max()


def unlike(before: int = 0, **wear: Any) -> Case:
    """A stiff sphere on a soft plane, which shakes down under a tangential load to and fro."""
    path = [
        {"tangential_load_x": f"{share} mu P", "steps": steps}
        for share, steps in ((0.7, 1), (-0.7, 2), (0.0, 1))
    ]
    turns = [{"label": "before", "path": path, "repeat": before}] if before else []
    return fretting(
        body_1={
            "young_modulus": 4e11,
            "poisson_ratio": 0.3,
            "surface": {"shape": "sphere", "radius": RADIUS},
        },
        body_2={"young_modulus": 6e10, "poisson_ratio": 0.3},
        friction_coefficient=0.3,
        loads=[{"normal_load": 100.0, "steps": 2}, *turns, {"label": "fretting", "path": path}],
        wear={"coefficient_1": 1e-14, "cycles": 30, **wear},
    )


@pytest.fixture(scope="module")
def settled() -> Any:
    """Depth after 30 cycles that were all solved, and had closed before."""
    return worn(unlike(before=40, jump=1).run())["worn_depth"].values[-1]


@pytest.mark.parametrize(("before", "tolerance"), [(0, 0.1), (0, 0.01), (8, 0.1), (8, 0.01)])
def test_bound_of_the_depth_holds_while_bodies_shake_down(
    settled: Any, before: int, tolerance: float
) -> None:
    found = worn(unlike(before, tolerance=tolerance).run()).isel(step=-1)
    off = np.abs(found["worn_depth"] - settled).max()
    assert 0.0 < off <= found["worn_depth_step_error"] < 1.2 * tolerance * found["max_worn_depth"]
    assert found["unworn_cycle_change"] <= tolerance
    assert 1 <= int(found["unworn_cycles"]) < 20


def test_unworn_cycle_of_bodies_that_are_alike_closes_at_once() -> None:
    found = worn(fretting(wear={"cycles": 20_000}).run())
    assert found["unworn_cycles"].values.tolist() == [1] * found.sizes["step"]
    assert (found["unworn_cycle_change"] < 1e-4).all()


def test_unworn_cycle_that_does_not_close_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    work = []  # of the first record, which sums that of the unworn cycles
    for cycles in (1, 2):
        monkeypatch.setattr(solving, "MOST_UNWORN", cycles)
        words = f"not closed after {cycles} cycles? on unworn surfaces: its wear may still"
        with pytest.warns(PathWarning, match=words):
            result = unlike(tolerance=0.01).run()
        work.append(float(worn(result)["operator_applications"][0]))
    assert work[1] > 1.5 * work[0] > 0.0
    [remark] = [each for each in Summary.of_result(result).remarks if "not closed" in each]
    assert "expected at most wear.tolerance = 0.01" in remark


def test_halved_jumps_change_the_depth_as_stated() -> None:
    fine = worn(fretting(wear={"cycles": 100_000, "jump": 2000}).run()).isel(step=-1)
    coarse = worn(fretting(wear={"cycles": 100_000}).run()).isel(step=-1)
    off = np.abs(coarse["worn_depth"] - fine["worn_depth"]).max()
    assert 0.0 < off <= coarse["worn_depth_step_error"]
    assert coarse["worn_depth_step_error"] < 0.3 * coarse["max_worn_depth"]
    left = coarse["unworn_cycle_change"] * coarse["max_worn_depth"]
    assert coarse["worn_depth_step_error"] == 2.0 * np.abs(coarse["worn_depth_step_change"]).max() + left


@pytest.mark.parametrize("last", [5, 14, 15, 16, 17])
def test_resumed_run_has_the_same_bits(tmp_path: Path, last: int) -> None:
    # a window of 13 rows, which grows on the way; the first cycle of wear is step 14
    case = fretting(wear={"cycles": 300_000})
    whole = case.run()
    case.run(tmp_path / "out.nc", on_step=lambda step: step.number == last)
    assert len(hexcontact.open_result(tmp_path / "out.nc")) == last
    again = hexcontact.resume(tmp_path / "out.nc")
    for name in sorted(set(whole.dataset.variables) - {"seconds"}):
        np.testing.assert_array_equal(whole.dataset[name], again.dataset[name], name)


def test_run_with_a_damaged_last_record_has_the_same_bits(tmp_path: Path) -> None:
    case = fretting(wear={"cycles": 40_000, "jump": 10_000})
    whole = case.run()
    for last in (15, 16):  # the first and the second of a pair of jumps
        out = tmp_path / f"{last}.nc"
        case.run(out, on_step=lambda step, last=last: step.number == last + 1)
        records = Journal(journal_of(out)).records
        records[-1].unlink()
        again = hexcontact.resume(out)
        for name in sorted(set(whole.dataset.variables) - {"seconds"}):
            np.testing.assert_array_equal(whole.dataset[name], again.dataset[name], name)
    case.run(out, overwrite=True, on_step=lambda step: step.number == 17)
    for lost in Journal(journal_of(out)).records[-2:]:
        lost.unlink()
    with pytest.warns(UserWarning, match="the restart data of step 15 are missing"):
        again = hexcontact.resume(out)
    for name in ("wear_cycles", "max_worn_depth"):
        assert again[name].values == pytest.approx(whole[name].values, rel=0.05, nan_ok=True)


def test_session_may_go_back() -> None:
    session = fretting(wear={"cycles": 20_000, "jump": 10_000}).start()
    depths = [step.history.get("max_worn_depth") for step in session]
    session.back(2)
    assert [step.history["max_worn_depth"] for step in session] == pytest.approx(depths[-2:], rel=1e-2)


def test_broken_cycles_are_stated() -> None:
    table = fretting(wear={"cycles": 3, "jump": 2}).run().history
    stated = [dict(step_rows(row.to_dict())).get("cycles of wear") for _, row in table.iterrows()]
    assert stated[-3:] == ["0", "1.5", "3"]
    assert [cycle_count(cycles) for cycles in (12_000.0, 12_000.25, 0.03125)] == [
        "12,000",
        "12,000.2",
        "0.031",
    ]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"friction_coefficient": None}, "wear: nothing wears without friction"),
        ({"friction_coefficient": 0.0}, "wear: nothing wears without friction"),
        ({"friction_coefficient": np.inf}, "wear: nothing wears without slip"),
        (
            {"wear": {"coefficient_1": -1.0}},
            "wear.coefficient_1 = -1.0: expected a coefficient of wear of at",
        ),
        ({"wear": {"coefficient_1": 0.0}}, "expected a coefficient above 0 of one body at least"),
        ({"wear": {"coefficient_1": "1 mm"}}, '"mm" is a length'),
        (
            {"wear": {"cycle": "freting"}},
            'wear.cycle = "freting": expected the label .*did you mean fretting',
        ),
        ({"wear": {"cycles": 0}}, "wear.cycles = 0: expected a whole number"),
        ({"wear": {"jump": 0}}, "wear.jump = 0: expected"),
        ({"wear": {"jump": 5, "tolerance": 0.1}}, "wear.tolerance = 0.1: expected nothing"),
        ({"shear_limit": 1e8}, "friction.shear_limit = .*expected nothing beside"),
        (
            {"friction_coefficient": {"along": 0.3, "across": 0.2}},
            "friction.coefficient: expected one coefficient",
        ),
        ({"algorithm": "static"}, 'solver.algorithm = "static": expected incremental with'),
        ({"accuracy": 0.1}, "accuracy: expected nothing beside"),
        ({"loads": [{"label": "fretting", "path": [{"approach": APPROACH}]}]}, "expected an entry of"),
        ({"loads": [{"approach": APPROACH}, {"label": "fretting", "path": CYCLE, "repeat": 2}]}, "no repeat"),
        (
            {"loads": [{"approach": APPROACH, "steps": "auto"}, {"label": "fretting", "path": CYCLE}]},
            "number",
        ),
    ],
)
def test_what_cannot_wear_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(DeckError, match=sentence):
        fretting(**changes)


def test_cycles_of_wear_are_no_cycles_of_the_history() -> None:
    legs = [{"shift_x": SHIFT, "steps": 3}, {"shift_x": -SHIFT, "steps": 6}, {"shift_x": SHIFT, "steps": 6}]
    turn = [{"label": "turn", "path": legs}, {"label": "fretting", "path": legs[1:]}]
    result = fretting(wear={"cycles": 20_000}, loads=[{"approach": APPROACH, "shift_x": 0.0}, *turn]).run()
    before = int((~(result.dataset["wear_cycles"] >= 0)).sum())
    assert result.cycles["last_step"].to_list() == [16, before]
    rows = energy_table(Summary.of_result(result).histories, 24).rows
    assert ("segment 7", "wear, 20,000 cycles") in {row[:2] for row in rows}


def test_cycle_without_slip_is_refused_when_it_is_known() -> None:
    press = {"approach": APPROACH, "shift_x": 0.0}
    with pytest.raises(DeckError, match=r"no node slips in this cycle, so that nothing wears"):
        fretting(loads=[press, {"label": "fretting", "approach": APPROACH}]).run()


def test_cycle_that_is_computed_afterwards_is_the_one_that_wears() -> None:
    press, cycle = {"approach": APPROACH, "shift_x": 0.0}, {"label": "fretting", "path": CYCLE}
    twice = fretting(wear={"cycles": 1, "jump": 1}).deck_text
    twice = twice[: twice.index("[wear]")] + "[output]" + twice.partition("[output]")[2]
    found = Case.from_text(twice, overrides={"load": [press, cycle, cycle]}).run().wear(WEAR, "fretting")
    last = worn(fretting(wear={"cycles": 1, "jump": 1}).run()).isel(step=-1)
    # that cycle is solved to 3e-4 only: what this leaves in the depth
    for name in ("worn_depth", "wear_volume"):
        assert np.abs(found[name] - last[name]).max() < 2e-4 * np.abs(last[name]).max()
    # |q| = mu p, opposed to the slip
    assert np.abs(WEAR / MU * found["cycle_dissipation_density"] - found["worn_depth"]).max() < 1e-6 * float(
        found["worn_depth"].max()
    )
    with pytest.raises(DeckError, match="coefficient"):
        worn_twice = hexcontact.Result(last.expand_dims("step"))
        worn_twice.wear(-1.0, steps=[1])


def test_cycles_start_where_the_cycle_before_ended() -> None:
    work = worn(fretting(wear={"cycles": 100_000, "jump": 10_000}).run())["operator_applications"].values
    assert (work[3:] < 0.6 * work[0]).all()


def test_pressure_of_a_cycle_is_found_once() -> None:
    """At a fixed approach it is that of the load step before; the cycle before tells it less well."""
    work = worn(fretting(nodes_in_radius=16, wear={"cycles": 60_000, "jump": 10_000}).run())
    # 13 load steps
    assert float(work["operator_applications"][3:].mean()) < 6.0 * 13


def test_session_goes_through_the_cycles_as_a_run_does() -> None:
    case = fretting(wear={"cycles": 60_000, "jump": 20_000})
    session = case.start()
    stepped = [step.history.get("wear_volume") for step in session]
    np.testing.assert_array_equal(session.result()["worn_depth"], case.run()["worn_depth"])
    assert stepped[-1] == session.result()["wear_volume"].values[-1]


def test_fields_of_wear_need_a_table_of_wear() -> None:
    with pytest.raises(DeckError, match=r"a run without \[wear\] has no worn_depth"):
        Case.from_text(starter("fretting"), overrides={"output.fields": ["worn_depth"]})
