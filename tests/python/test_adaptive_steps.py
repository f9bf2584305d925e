"""Adaptive load steps: their error is measured, bounded, and as small as was asked for."""

import contextlib
import io
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from validation.hard_problems import errors_over_bounds

from hexcontact import Case, ConvergenceError, DeckError
from hexcontact.cli import printed
from hexcontact.core import friction
from hexcontact.core.friction import LEAST
from hexcontact.deck.json_schema import deck_schema
from hexcontact.problem import preview
from hexcontact.result import history_words as history
from hexcontact.result.history_words import describe
from hexcontact.result.journal import Journal, journal_of
from hexcontact.result.result import Result
from hexcontact.result.step import Step
from hexcontact.result.store import open_result
from hexcontact.solve.events import Lines
from hexcontact.solve.restart import resume
from hexcontact.solve.window import FrictionWindow
from hexcontact.text import Table

SPHERE = {"young_modulus": 432e9, "poisson_ratio": 0.32, "surface": {"shape": "sphere", "radius": 1e-3}}
ALUMINIUM = {"young_modulus": 72e9, "poisson_ratio": 0.32}
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
BALL = {**STEEL, "surface": {"shape": "sphere", "radius": 1e-2}}
DISSIMILAR = {"body_1": SPHERE, "body_2": ALUMINIUM, "friction_coefficient": 0.1}
SIMILAR = {"body_1": BALL, "body_2": STEEL, "friction_coefficient": 0.3}
FINER = 8  # times as many steps in the reference

PRESS = [{"normal_load": 31.5}]
PRESS_AND_SHEAR = [{"normal_load": 31.5}, {"tangential_load_x": 2.5}]
OBLIQUE = [{"normal_load": 100.0, "tangential_load_x": 15.0}]
LOOP = [{"normal_load": 100.0}, {"tangential_load_x": 20.0}, {"tangential_load_x": -20.0}]
HISTORIES: dict[str, dict[str, Any]] = {
    "pressed": {**DISSIMILAR, "loads": PRESS},
    "pressed, radius growing evenly": {**DISSIMILAR, "loads": [{"normal_load": 31.5, "ramp": "cubic"}]},
    "pressed, much friction": {**DISSIMILAR, "friction_coefficient": 0.4, "loads": PRESS},
    "sheared, back, let go": {
        **DISSIMILAR,
        "loads": [*PRESS_AND_SHEAR, {"tangential_load_x": -2.0}, {"normal_load": 25.0}],
    },
    "loop of similar spheres": {**SIMILAR, "loads": LOOP},
    "oblique, then turned": {**SIMILAR, "loads": [*OBLIQUE, {"tangential_load_y": 20.0}]},
    "shifted": {**DISSIMILAR, "loads": [{"approach": 4e-6}, {"shift_x": 3e-7}, {"shift_x": -2e-7}]},
    "interpolated": {**SIMILAR, "entry": "interpolated", "loads": OBLIQUE},
}


def made(case: dict[str, Any], **keys: Any) -> Case:
    """Return a case in adaptive steps, 9 spacings in the contact radius."""
    loads = [{"steps": "auto", **load} for load in case["loads"]]
    return Case(**{"nodes_in_radius": 9, **case, "loads": loads, **keys})


def finer(case: dict[str, Any], result: Result, **keys: Any) -> Result:
    """Solve a history in many more steps, which end where those of a result do."""
    loads = []
    for number, load in enumerate(case["loads"], start=1):
        load = dict(load)
        ends = [0.0, *result.segment_fraction.values[result.segment.values == number].tolist()]
        parts = FINER
        inner = [a + (b - a) * part / parts for a, b in itertools.pairwise(ends) for part in range(1, parts)]
        if load.pop("ramp", "") == "cubic":  # what `values` cannot say
            ends, inner = [end**3 for end in ends], [part**3 for part in inner]
        loads.append({**load, "values": sorted([*ends[1:], *inner])})
    return Case(**{"nodes_in_radius": 9, **case, "loads": loads, **keys}).run()


def errors(result: Result, reference: Result) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the stick area and their bounds, as shares of the largest contact area."""
    there = reference.dataset.isel(step=slice(FINER - 1, None, FINER))
    assert there.sizes["step"] == len(result)
    np.testing.assert_allclose(there.normal_load, result.normal_load, rtol=3e-5)
    area = float(there.contact_area_fit.max())
    error = np.abs(result.stick_area_fit.values - there.stick_area_fit.values) / area
    return error, result.stick_area_step_error.values / area


def traction_errors(result: Result, reference: Result, friction: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the shear tractions and their bounds, as shares of what friction can carry."""
    there = reference.dataset.isel(step=slice(FINER - 1, None, FINER))
    apart = np.hypot(
        result.traction_x.values - there.traction_x.values, result.traction_y.values - there.traction_y.values
    )
    share = np.minimum(1.0, there.contact_area_fit.values / float(there.contact_area_fit.max()))
    carried = friction * there.pressure.values.sum((1, 2))
    return share * apart.sum((1, 2)) / carried, result.traction_step_error.values


def work(result: Result) -> float:
    """Return the operator applications of a run."""
    return float(result.operator_applications.sum())


# --- the bound ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", HISTORIES)
def test_the_true_error_is_within_the_bound(name: str) -> None:
    # against steps eight times smaller on the same lattice
    result = made(HISTORIES[name], step_tolerance=0.03).run()
    reference = finer(HISTORIES[name], result)
    error, bound = errors(result, reference)
    assert (
        error <= np.maximum(0.8 * bound, 1e-3)
    ).all()  # worst of all cases, against 16 times smaller: 0.51
    assert not (result.step_limited.values == -1).any()
    error, bound = traction_errors(result, reference, HISTORIES[name]["friction_coefficient"])
    assert (error <= bound).all()
    assert bound.max() < 0.3


@pytest.mark.parametrize("history", ["turning", "unloaded"])
def test_bounds_hold_over_whole_histories(history: str) -> None:
    """A load that turns, in one step a quarter, and unloading with strong friction."""
    stick, tractions = errors_over_bounds(history, 0.05)
    assert stick.max() <= 1.0
    assert 0.1 < tractions.max() <= 1.0


def test_the_bound_is_no_larger_than_need_be() -> None:
    # where no node enters the contact, the lattice has no part in it
    result = made(HISTORIES["sheared, back, let go"], step_tolerance=0.02, nodes_in_radius=12).run()
    area = float(result.contact_area_fit.max())
    sheared = result.segment.values == 2
    assert (result.stick_area_step_error.values[sheared] < 0.075 * area).all()
    loop = made(HISTORIES["loop of similar spheres"]).run()
    assert (loop.stick_area_step_error < 0.005 * loop.contact_area_fit).all()


def test_a_smaller_tolerance_makes_a_smaller_error() -> None:
    coarse, fine = (made(HISTORIES["oblique, then turned"], step_tolerance=t).run() for t in (0.1, 0.01))
    exact = finer(HISTORIES["oblique, then turned"], fine)
    end = float(exact.shift_x[-1])
    assert abs(float(fine.shift_x[-1]) - end) < 0.5 * abs(float(coarse.shift_x[-1]) - end)
    area = float(exact.contact_area_fit.max())
    off = [abs(float(r.stick_area_fit[-1] - exact.stick_area_fit[-1])) / area for r in (coarse, fine)]
    assert off[1] < 0.00183
    assert off[1] <= off[0]
    assert float(fine.stick_area_step_error[-1]) < float(coarse.stick_area_step_error[-1])
    assert float(fine.traction_step_change[-1]) < 0.5 * float(coarse.traction_step_change[-1])
    assert work(fine) > work(coarse)


def test_what_halving_changes_is_what_halving_changes() -> None:
    # one load step of a segment: the path in whole steps is that of steps = 1, the recorded one of steps = 2
    case = {**DISSIMILAR, "loads": [{"normal_load": 31.5}]}
    result = made(case, step_tolerance=0.5).run()
    assert len(result) == 1
    one, two = (
        Case(**{**case, "nodes_in_radius": 9, "loads": [{"normal_load": 31.5, "steps": steps}]}).run()
        for steps in (1, 2)
    )
    last, whole, half, halves = result.step(-1), one.step(-1), two.step(1), two.step(2)
    for name in ("pressure", "traction_x", "zone", "relative_displacement_x", "accumulated_slip", "shift_x"):
        np.testing.assert_array_equal(last[name], halves[name], err_msg=name)
    slipped = np.where(halves.zone > 0, half.slip_increment_x + halves.slip_increment_x, 0.0)
    np.testing.assert_array_equal(last.slip_increment_x, slipped)
    changed = float(last.stick_area_step_change)
    np.testing.assert_allclose(changed, float(halves.stick_area_fit - whole.stick_area_fit))
    dx, dy = whole.traction_x - halves.traction_x, whole.traction_y - halves.traction_y
    share = float(np.hypot(dx, dy).sum() / (0.1 * halves.pressure.sum()))
    np.testing.assert_allclose(float(last.traction_step_change), share, rtol=0.039)  # of the largest contact
    assert 2 * abs(changed) < float(last.stick_area_step_error) <= float(last.contact_area_fit)
    assert float(last.dissipated_energy_step) == float(halves.dissipated_energy)
    assert float(last.operator_applications) == pytest.approx(work(one) + work(two), rel=1e-14)


def test_tractions_count_for_more_where_stick_breaks_down() -> None:
    given = [{"normal_load": 31.5, "steps": 3}, {"tangential_load_x": 2.0}, {"tangential_load_x": -0.6}]
    last = {"tangential_load_x": -1.0}

    def run(steps: int | str) -> Any:
        loads = [*given, {**last, "steps": steps}]
        return Case(**{**DISSIMILAR, "nodes_in_radius": 9, "loads": loads, "step_tolerance": 0.5}).run()

    result, halves = run("auto"), run(2)
    assert len(result) == 6
    half, end = halves.step(6), halves.step(7)
    loaded = float(np.hypot(end.traction_x - half.traction_x, end.traction_y - half.traction_y).sum())
    shed = abs(float(end.stick_area_fit - half.stick_area_fit)) / float(end.contact_area_fit)
    gain = shed / (loaded / (0.1 * float(end.pressure.sum())))
    assert gain > 1.2
    here = result.step(-1)
    least = 2 * abs(float(here.stick_area_step_change))
    least += 1.5 * gain * float(here.traction_step_change) * float(here.contact_area_fit)
    assert float(here.stick_area_step_error) > 0.98 * least


# --- no wasted work -------------------------------------------------------------------------------


def test_one_step_where_steps_do_not_matter() -> None:
    result = made(HISTORIES["loop of similar spheres"]).run()
    assert result.segment_fraction.values.tolist() == [1.0, 1.0, 1.0]
    assert result.rejected_steps.values.tolist() == [0, 0, 0]
    equal = Case(**{**SIMILAR, "nodes_in_radius": 9, "loads": LOOP}).run()
    assert work(result) < 3.5 * work(equal)
    # pressed, without any shear: not even halves are solved
    assert float(result.operator_applications[0]) == float(equal.operator_applications[0])
    assert float(result.stick_area_step_error[0]) == 0.0


def test_less_work_than_equal_steps_of_the_same_accuracy() -> None:
    case, keys = HISTORIES["pressed"], {"nodes_in_radius": 12, "origin": (2.1e-6, 0.9e-6)}
    chosen = made(case, step_tolerance=0.02, **keys).run()
    off, _ = errors(chosen, finer(case, chosen, **keys))
    equal, exact = (
        Case(**{**case, **keys, "loads": [{**PRESS[0], "steps": steps}]}).run() for steps in (32, 32 * FINER)
    )
    off_equal = np.abs(equal.stick_area_fit.values - exact.stick_area_fit.values[FINER - 1 :: FINER])
    off_equal /= float(exact.contact_area_fit.max())
    assert off.max() < off_equal.max()
    # errors fall in proportion to the number of steps, so what counts is the product
    assert off.max() * work(chosen) < 0.9 * off_equal.max() * work(equal)


def test_steps_are_no_larger_than_the_deck_allows() -> None:
    case = {**SIMILAR, "loads": [LOOP[0], {**LOOP[1], "largest_step": 0.2}]}
    result = made(case, nodes_in_radius=5).run()
    np.testing.assert_allclose(result.segment_fraction.values, [1, 0.2, 0.4, 0.6, 0.8, 1])


@pytest.mark.parametrize("keys", [{"friction_coefficient": None}, {"algorithm": "static"}])
def test_one_step_a_segment_where_every_step_stands_for_itself(keys: dict[str, Any]) -> None:
    loads = [{"normal_load": 20.0}, {"normal_load": 10.0}]
    case = made({**DISSIMILAR, "loads": loads, **keys}, nodes_in_radius=5)
    assert not case.adaptive
    result = case.run()
    assert len(result) == result.dataset.attrs["planned_steps"] == 2
    assert "stick_area_step_error" not in result.dataset


# --- histories of all kinds -----------------------------------------------------------------------


def test_given_and_chosen_steps_may_follow_each_other() -> None:
    case = Case(
        **DISSIMILAR,
        nodes_in_radius=5,
        step_tolerance=0.05,
        loads=[
            {"normal_load": 20.0, "steps": 2, "label": "press"},
            {"shift_x": 2e-7, "steps": "auto", "label": "shift"},
            {"tangential_load_x": 0.0, "steps": "auto", "label": "let go"},
            {"normal_load": 0.0, "steps": 1},
        ],
    )
    result = case.run()
    given = np.isin(result.segment.values, [1, 4])
    assert np.isnan(result.stick_area_step_error.values).tolist() == given.tolist()
    assert (result.step_limited.values == -1).tolist() == given.tolist()
    assert result["step"].values.tolist() == list(range(1, len(result) + 1))
    let_go = result.dataset.isel(step=result.segment.values == 3)
    assert abs(float(let_go.tangential_load_x[-1])) < 1e-9
    assert float(let_go.tangential_load_x[0]) > 0.0


def test_rows_of_a_series_are_segments() -> None:
    series = {"normal_load": [20.0, 20.0, 30.0], "tangential_load_x": [0.0, 1.0, -0.5]}
    case = Case(
        **DISSIMILAR, nodes_in_radius=5, step_tolerance=0.1, loads=[{"series": series, "steps": "auto"}]
    )
    result = case.run()
    ends = result.dataset.isel(step=result.segment_fraction.values == 1.0)
    np.testing.assert_allclose(ends.tangential_load_x, series["tangential_load_x"], atol=1e-9)
    assert ends.segment.values.tolist() == [1, 2, 3]


def test_no_slip_and_goodman() -> None:
    for keys in ({"friction_coefficient": float("inf")}, {"coupling": "goodman"}):
        result = made({**DISSIMILAR, "loads": PRESS, **keys}, nodes_in_radius=5, step_tolerance=0.2).run()
        assert np.isfinite(result.stick_area_step_error.values).all()
        assert float(result.segment_fraction[-1]) == 1.0


# --- where no step is small enough ----------------------------------------------------------------


def test_a_tolerance_that_is_missed_is_told() -> None:
    class Enough(Exception):
        pass

    def on_step(step: Step) -> None:
        histories.append(step.history)
        if step.history["step_limited"]:
            raise Enough

    for nodes in (4, 5, 6, 7):  # last bits decide on which lattices a step is limited
        histories: list[Any] = []
        case = made(HISTORIES["oblique, then turned"], step_tolerance=1e-4, nodes_in_radius=nodes)
        with contextlib.suppress(Enough):
            case.run(on_step=on_step)
        if histories[-1]["step_limited"]:
            break
    last, number = histories[-1], len(histories)
    assert last["stick_area_step_error"] > 1e-4 * last["contact_area_fit"]
    assert history.limited_steps(histories, 1e-4) == (
        f"1 of {number} load steps change more by halving than solver.step_tolerance = 0.0001, and smaller "
        f"ones did not help: step {number}; their stick_area_step_error holds"
    )
    assert history.limited_steps(histories[:-1], 1e-4) == ""


def test_the_smallest_step_that_does_not_converge_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(friction, "MAX_SWEEPS", 2)
    monkeypatch.setattr(friction, "MAX_CUTS", 0)
    monkeypatch.setattr(FrictionWindow, "how", {"entry": "implicit", "tolerance": 1e-18})  # out of reach
    case = made({**DISSIMILAR, "loads": [{"normal_load": 10.0}]}, nodes_in_radius=5, step_tolerance=0.5)
    sentence = r"(?s)^step \d+ did not converge.*\nit is 0.1% of its segment"
    with pytest.raises(ConvergenceError, match=sentence):
        case.run()


# --- what is said, and refused --------------------------------------------------------------------


def test_what_a_person_sees(tmp_path: Path) -> None:
    case = made({**DISSIMILAR, "loads": PRESS_AND_SHEAR}, nodes_in_radius=5, step_tolerance=0.1, title="Demo")
    assert "2 adaptive segments)\n  warning: 5 spacings" in repr(case)
    stream = io.StringIO()
    out = tmp_path / "out.nc"
    result = case.run(out, progress=Lines(stream))
    first, doubt, *lines = stream.getvalue().splitlines()
    assert first == "Demo: load steps chosen during the run"
    assert doubt.startswith("warning: 5 spacings in the contact radius")
    assert lines[0].startswith("step   1 (") and "(100%)" in lines[-1]
    assert " ± " in lines[-1]
    assert " ± " not in describe(result.history.iloc[-1].to_dict(), short=True)
    rows = dict(history.step_rows(result.history.iloc[-1].to_dict()))
    assert rows["load steps"].startswith("stick area within ")
    console = Console(file=io.StringIO(), width=150)
    console.print(Table(("", ""), preview.case_rows(case)))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "adaptive in 2 segments (step_tolerance 0.1)" in text
    assert "uncertain by a factor of 3" in preview.work(case)
    assert result.dataset.attrs["planned_steps"] == len(result)
    assert result.dataset.attrs["step_tolerance"] == 0.1
    assert result.step_limited.attrs["flag_meanings"] == "not_adaptive within_tolerance no_smaller_step_helps"


def test_an_unfinished_run_does_not_name_a_number(tmp_path: Path) -> None:
    case = made({**DISSIMILAR, "loads": PRESS_AND_SHEAR}, nodes_in_radius=5, step_tolerance=0.1)
    out = tmp_path / "out.nc"

    def stop(step: Step) -> None:
        raise DeckError("enough")

    with pytest.raises(DeckError) as error:
        case.run(out, on_step=stop)
    assert "1 load step is finished and recorded in" in error.value.__notes__[0]
    part = open_result(out)
    assert not part.complete
    assert repr(part).splitlines()[1].startswith("  1 load step (unfinished run), ")
    assert ("load steps", "1 (unfinished, their number was open)") in printed.file_rows(part)
    journal = Journal(journal_of(out), restart=True)
    assert not journal.complete
    (step,) = journal
    assert step.companion and 0 < step.done < 1
    other = made({**DISSIMILAR, "loads": PRESS}, nodes_in_radius=5, step_tolerance=0.1)
    with pytest.raises(DeckError, match="their decks differ"):
        resume(out, case=other)
    assert resume(out).complete


@pytest.mark.parametrize(
    ("load", "sentence"),
    [
        ({"steps": "often"}, 'load.1.steps = "often": expected "auto" or a whole number of at least 1'),
        ({"steps": 0}, "load.1.steps = 0: expected a whole number of at least 1"),
        (
            {"steps": "auto", "values": [0.5, 1]},
            'load.1.steps = "auto": expected 2, as many as there are values',
        ),
        ({"steps": 5, "largest_step": 0.1}, 'load.1.largest_step = 0.1: needs steps = "auto" beside it'),
        (
            {"steps": "auto", "largest_step": 2},
            "load.1.largest_step = 2: expected a number above 0 and at most 1",
        ),
        ({"steps": "auto", "tangential_load_x": 9.0}, "load.1.tangential_load_x = 9.0: gross sliding"),
    ],
)
def test_what_is_refused(load: dict[str, Any], sentence: str) -> None:
    with pytest.raises(DeckError) as error:
        Case(**DISSIMILAR, nodes_in_radius=5, loads=[{"normal_load": 10.0, **load}])
    assert str(error.value).startswith(sentence)


def test_tolerances_that_are_refused() -> None:
    for tolerance in (0.0, 1.0):
        with pytest.raises(
            DeckError, match=f"solver.step_tolerance = {tolerance}: expected a number of at least"
        ):
            made(HISTORIES["pressed"], step_tolerance=tolerance)


def test_loads_on_the_way_are_looked_at() -> None:
    # the tangential load grows evenly, the cube root of the normal load too: friction fails at the beginning
    loads = [{"normal_load": 1.0}, {"normal_load": 50.0, "tangential_load_x": 4.9, "ramp": "cubic"}]
    with pytest.raises(DeckError, match="gross sliding"):
        made({**DISSIMILAR, "loads": loads})


def test_editors_know_the_word() -> None:
    steps = deck_schema()["$defs"]["Load"]["properties"]["steps"]
    assert {"const": "auto"} in steps["anyOf"]


def test_the_smallest_step_is_that_of_the_documentation() -> None:
    page = (Path(__file__).parents[2] / "docs" / "deck.md").read_text(encoding="utf-8")
    assert f"{LEAST:.1%} of the segment".replace("%", " %") in page
