"""Refined lattices: estimated errors hold and are not too wide, targets are reached, nothing is lost."""

import json
import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner
from validation.error_bars import PROBLEMS, estimates_over_errors
from validation.hard_problems import bars_over_errors

import hexcontact
from hexcontact import AccuracyWarning, Case, ConvergenceError, DeckError
from hexcontact.cli.app import app
from hexcontact.cli.report import report
from hexcontact.deck.surfaces import Sphere
from hexcontact.problem import preview
from hexcontact.problem.preview import SHIFTS
from hexcontact.problem.problem import RATIO
from hexcontact.result.journal import TrialFolder
from hexcontact.solve import lattices as accuracy
from hexcontact.variables import ESTIMATED, VARIABLES

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
SHEARED = {
    "friction_coefficient": 0.3,
    "loads": [{"normal_load": 100.0}, {"tangential_load_x": 15.0, "steps": 2}],
}


def made(**keys: Any) -> Case:
    """Return a sphere on a plane, five spacings in the contact radius of the first lattice."""
    loads = {} if "loads" in keys else {"normal_load": 100.0}
    given = {"nodes_in_radius": 5, "accuracy": 0.2, **loads, **keys}
    return Case(body_1={**STEEL, "surface": Sphere(radius=0.02)}, body_2=STEEL, **given)


# --- the estimate -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("problem", PROBLEMS)
def test_true_errors_lie_within_the_estimate(problem: str) -> None:
    """Closed solutions on lattices of random spacing and origin, for every scalar that has one.

    In the median the estimates are 3 to 23 times the true error; what is twice as wide is of little use.
    """
    count = 60 if problem == "Cattaneo-Mindlin" else 100
    found = estimates_over_errors(problem, count, seed=1)
    assert len(found) >= 4
    for name, ratios in found.items():
        assert len(ratios) >= count
        assert np.mean(ratios >= 1.0) >= 0.95, name
        assert 2.0 < np.median(ratios) < 25.5, name


def test_true_errors_lie_within_the_estimate_on_the_way_to_a_target() -> None:
    """To stop where the estimate happens to be small does not spoil it."""
    found = estimates_over_errors("Hertz", 60, seed=2, target=0.01)
    assert len(found) >= 4
    for name, ratios in found.items():
        assert len(ratios) >= 60
        assert np.mean(ratios >= 1.0) >= 0.95, name
        assert np.median(ratios) < 30.0, name


def test_errors_with_strong_friction_lie_within_the_estimate() -> None:
    """Against a fine lattice: the largest shear traction, at the edge of the stick zone, converges slowly."""
    found = bars_over_errors("strong friction", 2, seed=3)
    assert np.mean(found["max_traction"] >= 1.0) >= 0.95  # 0.85 with the orders of smooth quantities
    assert np.mean(np.concatenate(list(found.values())) >= 1.0) >= 0.98


def test_a_rough_quantity_may_converge_with_the_root_of_the_spacing() -> None:
    values = (3.0 + 0.1 * SPACINGS**0.5)[:, None].repeat(2, axis=1)
    errors = accuracy.limits_of_error(SPACINGS, values, np.array([True, False]))
    assert_allclose(errors[0], 0.125, rtol=1e-6)
    assert errors[1] < 0.059


SPACINGS = np.array([1.0, RATIO, 2.0, 2.0, 2.0, 2.0, 2.0])


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
def test_trend_without_scatter(order: float) -> None:
    """q + c h^p: the extrapolation is exact, so that only the safety factor is left."""
    for scale in (1e-9, 1e9):
        values = scale * (3.0 + 0.1 * SPACINGS**order)[:, None]
        assert_allclose(accuracy.limits_of_error(SPACINGS, values), 1.25 * 0.1 * scale, rtol=1e-6)


def test_orders_beyond_the_bounds_are_not_believed() -> None:
    """Differences of 0.4 and 0.04: order 6.6 would promise an error of 0.005, order 2 does not."""
    values = np.array([1.0, 1.04, 1.44, 1.44, 1.44, 1.44, 1.44])[:, None]
    assert accuracy.limits_of_error(SPACINGS, values)[0] > 0.44 / 3.0
    values = (3.0 + 0.1 * SPACINGS**0.5)[:, None]  # order 1/2 would promise 0.1
    assert accuracy.limits_of_error(SPACINGS, values)[0] < 0.059


def test_scatter_alone_gives_a_floor() -> None:
    """Where the lattices agree by chance, the shifted copies tell that it was chance."""
    values = np.array([1.0, 1.0, 1.0, 1.02, 0.98, 1.01, 0.99])[:, None]
    assert 0.005 < accuracy.limits_of_error(SPACINGS, values)[0] < 0.0332
    assert accuracy.limits_of_error(SPACINGS, np.ones((7, 1)))[0] == pytest.approx(0.0, abs=1e-12)


def test_quantities_without_a_value_have_no_error() -> None:
    values = np.array([[1.0, math.nan, 0.0]] * 7)
    values[3, 0] = math.nan
    errors = accuracy.limits_of_error(SPACINGS, values)
    assert np.isnan(errors[:2]).all()
    assert errors[2] == 0.0
    with pytest.raises(ValueError, match="four"):
        accuracy.limits_of_error(SPACINGS[:3], values[:3])


def test_shifted_copies_are_no_copies_of_each_other() -> None:
    """No two origins are the same up to a lattice vector, nor up to the symmetries of a centered sphere."""
    points = np.array([(0.0, 0.0), *SHIFTS])
    for sign in (1.0, -1.0):
        apart = points[:, None] - sign * points[None]
        apart = np.abs(apart - np.round(apart)).max(axis=2)
        assert apart[~np.eye(len(points), dtype=bool)].min() > 0.1


# --- refinement ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sheared() -> hexcontact.Result:
    return made(**SHEARED, accuracy=0.05).run()


def test_result_is_that_of_the_finest_lattice(sheared: hexcontact.Result) -> None:
    level = int(sheared.trial_level.max())
    first = made(**SHEARED).lattice
    assert sheared.lattice.spacing == pytest.approx(first.spacing / RATIO**level, rel=1e-12)
    assert level >= 3
    assert sheared.lattice.origin == first.origin
    finest = int(np.argmin(sheared.trial_spacing.values))
    for name in ("max_pressure", "stick_area_fit", "shift_x"):
        np.testing.assert_array_equal(sheared[f"trial_{name}"][finest], sheared[name])
    alone = made(**SHEARED, accuracy=None).on_lattice(sheared.lattice.spacing, first.origin).run()
    np.testing.assert_array_equal(alone.shift_x, sheared.shift_x)


def test_every_scalar_has_an_error(sheared: hexcontact.Result) -> None:
    for name in ESTIMATED:
        assert sheared[name].attrs["ancillary_variables"] == f"{name}_error"
        error = sheared[f"{name}_error"]
        assert error.attrs["units"] == VARIABLES[name].units
        assert (error.values >= 0.0).all(), name
    assert not {"seconds_error", "residual_normal_error", "segment_error"} & set(sheared.dataset)
    for name in ("normal_load", "tangential_load_x", "twist"):  # are prescribed
        assert (sheared[f"{name}_error"] == 0.0).all()
    assert (sheared.approach_error > 0.0).all()
    assert (sheared.torque_error[1:] > 0.0).all()  # follows from twist = 0
    assert re.search(r"approach +\S+ µm ± \S+ %\n", repr(sheared))
    assert re.search(r"normal load +100.0 N\n", repr(sheared))


def test_target_is_that_of_the_largest_values(sheared: hexcontact.Result) -> None:
    largest = {
        name: float(sheared[f"{name}_error"].max() / np.abs(sheared[name]).max()) for name in accuracy.JUDGED
    }
    assert max(largest.values()) == pytest.approx(sheared.dataset.attrs["accuracy_estimate"], rel=1e-12)
    assert max(largest.values()) <= 0.05
    assert sheared.dataset.attrs["accuracy_reached"] == 1
    assert sheared.shortfall == ""


def test_loads_that_follow_from_motions_have_errors() -> None:
    result = made(loads=[{"approach": 1e-6}]).run()
    assert result.approach_error == 0.0
    assert result.normal_load_error > 0.0


def test_limit_of_nodes_keeps_the_finest_result(tmp_path: Path) -> None:
    case = made(accuracy={"target": 1e-5, "max_nodes": 3000})
    with pytest.warns(AccuracyWarning, match=r"max_nodes = 3,000"):
        result = case.run(tmp_path / "out.nc")
    assert result.complete
    assert result.dataset.attrs["accuracy_reached"] == 0
    assert "accuracy.target = 1e-05 is not reached" in result.shortfall
    assert 1500 < int(result.trial_nodes.max()) <= 3000
    assert not (tmp_path / "out.nc.d").exists()


def test_limit_of_memory_keeps_the_finest_result(monkeypatch: pytest.MonkeyPatch) -> None:
    case = made(accuracy=1e-5)
    limit = case.on_lattice(case.lattice.spacing / 2.1, (0.0, 0.0)).lattice.size

    def require(case: Case, lattice: Any, steps_held: int = 0) -> None:
        if lattice.size > limit:
            raise hexcontact.ResourceError("not enough memory")

    monkeypatch.setattr("hexcontact.solve.lattices.require_memory", require)
    with pytest.warns(AccuracyWarning, match="not enough memory"):
        assert case.run().trial_level.max() == 2


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            {"accuracy": {"target": 0.01, "max_nodes": 500}},
            r"accuracy.max_nodes = 500: expected at least \d+",
        ),
        ({"accuracy": 2.0}, r"accuracy.target"),
        ({"accuracy": {"max_nodes": 5000}}, r"accuracy.target: missing"),
        ({"accuracy": {"target": 0.1, "nodes": 5000}}, r"accuracy.nodes"),
    ],
)
def test_what_is_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(DeckError, match=message):
        made(**keys)


@pytest.mark.parametrize("nodes", [4, 5, 6, 8])
def test_the_fewest_nodes_that_are_not_refused_are_enough(nodes: int) -> None:
    """`max_nodes` is refused before the run, or the run has its three lattices."""

    def limited(most: int) -> Case:
        return made(nodes_in_radius=nodes, accuracy={"target": 1e-5, "max_nodes": most})

    with pytest.raises(DeckError, match=r"accuracy\.max_nodes = 100: expected at least \d+,") as refused:
        limited(100)
    needed = int(re.findall(r"at least (\d+),", str(refused.value))[0])
    with pytest.raises(DeckError, match=f"expected at least {needed},"):
        limited(needed - 1)
    with pytest.warns(AccuracyWarning, match="max_nodes"):
        result = limited(needed).run()
    assert result.lattice.size == needed


def test_gap_of_an_array_cannot_be_refined() -> None:
    lattice = made().lattice
    gap = made().initial_gap(lattice)[0]
    with pytest.raises(DeckError, match="not an array over nodes"):
        Case(body_1=STEEL, body_2=STEEL, gap=gap, lattice=lattice, normal_load=1.0, accuracy=0.1)


@pytest.mark.parametrize(
    "grid", [{}, {"nodes_in_radius": None, "nodes_across": 25}, {"extent": [6e-4, 6e-4]}]
)
def test_windows_of_finer_and_shifted_lattices_hold_the_contact(grid: dict[str, Any]) -> None:
    case = made(**grid)
    for trial in (preview.Trial(0), preview.Trial(2), preview.Trial(3, 1), preview.Trial(2, 4)):
        other = trial.case(case)
        first, lattice = case.lattice, other.lattice
        assert lattice.spacing == pytest.approx(first.spacing / RATIO**trial.level)
        shift = SHIFTS[trial.copy - 1] @ lattice.basis if trial.copy else np.zeros(2)
        assert_allclose(lattice.origin, first.origin + shift, atol=1e-12 * first.spacing)
        if trial == preview.Trial(0):
            assert lattice == first
        ratio = lattice.size * lattice.cell_area / (first.size * first.cell_area)
        assert 0.4 < ratio < 1.1
        step = next(iter(other.run().dataset.pressure.values))
        assert step.max() > 0.0
        assert not any(step[edge].any() for edge in ((0,), (-1,), (slice(None), 0), (slice(None), -1)))


# --- on the disk --------------------------------------------------------------------------------------------


class Stop(Exception):
    """Ends a run."""


def stopping(after: int) -> Callable[[Any], None]:
    """Return a callback that ends a run after so many load steps, of all lattices."""
    left = [after]

    def on_step(_: Any) -> None:
        left[0] -= 1
        if not left[0]:
            raise Stop

    return on_step


def same(one: hexcontact.Result, other: hexcontact.Result) -> bool:
    names = set(one.dataset.variables)
    return names == set(other.dataset.variables) and all(
        np.array_equal(one[n], other[n], equal_nan=one[n].dtype.kind == "f") for n in names - {"seconds"}
    )


@pytest.mark.parametrize("after", [1, 5, 9, 20])
def test_interrupted_refinement_goes_on_to_the_same_bits(
    after: int, tmp_path: Path, sheared: hexcontact.Result
) -> None:
    case, path = made(**SHEARED, accuracy=0.05), tmp_path / "out.nc"
    with pytest.raises(Stop):
        case.run(path, on_step=stopping(after))
    lattices = len(TrialFolder(tmp_path / "out.nc.d").solutions)
    assert lattices == (after - 1) // 3  # of three steps each
    begun = hexcontact.open_result(path)
    assert not begun.complete
    with pytest.raises(DeckError, match=f"{lattices} finished lattice.*hexcontact resume"):
        case.run(path)
    solved: list[Any] = []
    again = hexcontact.resume(path, on_step=solved.append)
    assert len(solved) == 3 * len(sheared.trial_level) - after
    assert same(again, sheared)
    assert f"resumed after {lattices} lattice{'s' * (lattices > 1)}" in again.dataset.attrs["history"]
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out.nc"]


def test_old_output_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "out.nc"
    made(accuracy=None, title="old").run(path)
    with pytest.raises(DeckError, match="exists already"):
        made().run(path)
    with pytest.raises(Stop):
        made(title="new").run(path, overwrite=True, on_step=stopping(4))
    assert hexcontact.open_result(path).case_title == "old"
    assert hexcontact.resume(path).case_title == "new"
    with pytest.raises(Stop):
        made().run(path, overwrite=True, on_step=stopping(4))
    made(accuracy=None, title="newest").run(path, overwrite=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.nc"]


def test_end_between_output_and_clearing_up(tmp_path: Path) -> None:
    """A run that is killed when its output is in place, but its lattices are still there, is finished."""
    path, copy = tmp_path / "out.nc", tmp_path / "copy"
    with pytest.raises(Stop):
        made().run(path, on_step=stopping(5))
    shutil.copytree(tmp_path / "out.nc.d", copy)
    hexcontact.resume(path).close()
    shutil.copytree(copy, tmp_path / "out.nc.d")
    assert hexcontact.resume(path).complete
    assert not (tmp_path / "out.nc.d").exists()


def test_other_deck_or_damage_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "out.nc"
    with pytest.raises(Stop):
        made().run(path, on_step=stopping(2))
    with pytest.raises(DeckError, match="decks differ"):
        hexcontact.resume(path, case=made(nodes_in_radius=6))
    ledger = tmp_path / "out.nc.d/lattices/header.json"
    about = json.loads(ledger.read_text())
    ledger.write_text(json.dumps({**about, "journal_version": 99}))
    with pytest.raises(DeckError, match="layout 99"):
        hexcontact.resume(path)
    ledger.write_text("{")
    with pytest.raises(DeckError, match="damaged"):
        hexcontact.resume(path)


def test_step_that_fails_keeps_the_finished_lattices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, case = tmp_path / "out.nc", made(**SHEARED)
    solve = preview.Trial.case

    def failing(trial: preview.Trial, case: Case) -> Case:
        if trial.level == 2:
            raise ConvergenceError("did not converge")
        return solve(trial, case)

    with monkeypatch.context() as patch, pytest.raises(ConvergenceError) as raised:
        patch.setattr(preview.Trial, "case", failing)
        case.run(path)
    assert "lattice" in raised.value.__notes__[0]
    assert "hexcontact resume" in raised.value.__notes__[0]
    assert hexcontact.resume(path).complete


# --- what users see -----------------------------------------------------------------------------------------

DECK = """
title = "Refined"
body.1 = { young_modulus = "210 GPa", poisson_ratio = 0.3, surface = { shape = "sphere", radius = "20 mm" } }
body.2 = { young_modulus = "210 GPa", poisson_ratio = 0.3 }
grid.nodes_in_radius = 5
accuracy.target = 0.1
load = [{ normal_load = "100 N", steps = 2 }]
"""


def ran(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_terminal_page_and_file_show_the_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.toml").write_text(DECK)
    checked = ran("check", "deck.toml")
    assert "target 10 %" in checked.output
    assert " to " in next(line for line in checked.output.splitlines() if line.strip().startswith("memory"))
    out = ran("run", "deck.toml")
    assert out.exit_code == 0, out.output
    assert "lattice 1, shifted (4 of 4): spacing" in out.stderr
    assert "estimated error" in out.stderr
    assert "largest error" in out.stdout
    assert "mm²" in out.stdout
    info = ran("info", "deck.nc").output
    for text in (out.stdout, info):
        assert any("approach" in line and " ± " in line for line in text.splitlines())
        assert "estimated)" in text  # against Hertz
    assert "target 10 % reached" in info
    page = report(hexcontact.open_result("deck.nc"))
    assert "<caption>Accuracy</caption>" in page
    assert re.search(
        r'"approach", ?"\d\.\d+ µm ± \d\S* %"', page.replace("\\u00b5", "µ").replace("\\u00b1", "±")
    )
    with netCDF4.Dataset("deck.nc") as file:
        assert file["max_pressure"].ancillary_variables == "max_pressure_error"
        assert file["trial_max_pressure"].dimensions == ("trial", "step")
        assert file["trial_spacing"][0] == pytest.approx(RATIO**2 * file.lattice_spacing)


def test_missed_target_has_an_exit_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.toml").write_text(DECK)
    settings = ["--set", "accuracy.target=1e-4", "--set", "accuracy.max_nodes=2000"]
    out = ran("run", "deck.toml", "--quiet", *settings)
    assert out.exit_code == 3
    assert out.stderr.startswith(
        "hexcontact: accuracy.target = 0.0001 is not reached: the estimated error of "
    )
    assert "is not reached" in ran("info", "deck.nc").output
    assert "is not reached" in report(hexcontact.open_result("deck.nc"))


def test_studies_keep_the_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    deck = tmp_path / "deck.toml"
    deck.write_text(DECK)
    (tmp_path / "study.toml").write_text(
        'deck = "deck.toml"\n[[parameter]]\nkey = "load.1.steps"\nvalues = [1, 2]\n'
    )
    study = hexcontact.Study.from_toml(tmp_path / "study.toml")
    for number in (1, 2):
        assert study.run_case(number).exit_code == 0
    data = study.collect()
    assert (data["max_pressure_error"] > 0.0).all()
