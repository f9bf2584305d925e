"""Runs that a script has a say in: callbacks, ends before the end, loads chosen between the steps."""

import gc
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import hexcontact
from hexcontact import Case, ConvergenceError, DeckError, Result, Step, StopRun, open_result
from hexcontact.deck.keys import Load
from hexcontact.deck.surfaces import Sphere
from hexcontact.result.journal import journal_of
from hexcontact.solve import run

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
SOFT = {"young_modulus": 70e9, "poisson_ratio": 0.33}
LOADS = [
    {"normal_load": 100.0, "steps": 2, "label": "press"},
    {"tangential_load_x": 12.0, "steps": 3, "label": "shear"},
]


def fretting(**arguments: Any) -> Case:
    """Press and shear a sphere on a softer flat, 6 spacings in the contact radius."""
    given = {"body_1": {**STEEL, "surface": Sphere(radius=10e-3)}, "body_2": SOFT}
    given |= {"nodes_in_radius": 6, "friction_coefficient": 0.2, "loads": LOADS}
    return Case(**{**given, **arguments})


def frictionless(**arguments: Any) -> Case:
    """Press a sphere on a flat in four steps."""
    loads = {"normal_load": 100.0, "steps": 4}
    return fretting(**{"friction_coefficient": None, "loads": loads, **arguments})


def assert_same(one: Result, other: Result) -> None:
    """See to it that two results are the same to the bit, but for the times they took."""
    assert set(one.dataset.data_vars) == set(other.dataset.data_vars)
    for name in set(one.dataset.data_vars) - {"seconds"}:
        assert_array_equal(one[str(name)].values, other[str(name)].values, err_msg=str(name))


@pytest.fixture(scope="module")
def whole() -> Result:
    """The result of all five steps."""
    return fretting().run()


# --- callbacks ----------------------------------------------------------------------------------------------


def test_a_callback_sees_the_finished_step() -> None:
    seen: list[Step] = []
    result = fretting().run(on_step=seen.append)
    assert [step.number for step in seen] == [1, 2, 3, 4, 5]
    assert [step.load_fraction for step in seen] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    last = seen[-1]
    assert last.label == "shear"
    assert last.shift_x == last["shift_x"] == float(result.shift_x[-1])
    assert last.prescribed == {
        "normal_load": 100.0,
        "tangential_load_x": 12.0,
        "tangential_load_y": 0.0,
        "twist": 0.0,
    }
    assert set(last.residuals) == {"R_n", "R_t", "R_P", "R_Q", "R_M"}
    assert 0.0 <= max(last.residuals.values()) <= 1e-8
    assert_array_equal(last.in_contact, last.pressure > 0)
    area = last.lattice.cell_area * int(last.sticking.sum())
    assert last.stick_area == pytest.approx(area)
    assert area > 0.0
    assert "traction_x" in dir(last)
    assert "stick_area" in dir(last)
    assert repr(last).startswith("Step 5: shear  P 100.0 N  Qx 12.00 N")


def test_what_a_callback_sees_cannot_be_written_to() -> None:
    def spoil(step: Step) -> None:
        with pytest.raises(ValueError, match="read-only"):
            step.traction_x[:] = 0.0
        with pytest.raises(TypeError):
            step.fields["pressure"] = step.gap  # type: ignore[index]

    fretting(loads=LOADS[:1]).run(on_step=spoil)


def test_an_unknown_quantity_of_a_step_is_named_with_the_nearest() -> None:
    [step] = frictionless(loads={"normal_load": 10.0}).start()
    with pytest.raises(AttributeError, match=r"has no presure; did you mean pressure\?"):
        _ = step.presure


def test_a_step_survives_pickling() -> None:
    [step] = frictionless(loads={"normal_load": 10.0}).start()
    again = pickle.loads(pickle.dumps(step))
    assert again.approach == step.approach
    assert again.load_fraction == 1.0
    assert_array_equal(again.pressure, step.pressure)


def raising(step: Step) -> None:
    if step.number == 3:
        raise StopRun("far enough")


ENDS: dict[str, tuple[Callable[[Step], object], str]] = {
    "true": (lambda step: step.number == 3, ""),
    "words": (lambda step: "far enough" if step.number == 3 else "", ": far enough"),
    "raised": (raising, ": far enough"),
    "numpy": (lambda step: step.shift_x > 0 and np.bool_(step.number >= 3), ""),
}


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("kept", ["memory", "file"])
def test_a_callback_may_end_the_run(tmp_path: Path, whole: Result, end: str, kept: str) -> None:
    callback, words = ENDS[end]
    path = tmp_path / "out.nc"
    result = fretting().run(path if kept == "file" else None, on_step=callback)
    assert len(result) == 3
    assert not result.complete
    assert result.stopped == f"stopped by on_step after step 3{words}"
    assert result.stopped in repr(result)
    assert_array_equal(result.shift_x.values, whole.shift_x.values[:3])
    if kept == "file":
        assert not path.exists()
        again = open_result(path)
        assert again.stopped == result.stopped
        assert_same(hexcontact.resume(path), whole)


def test_a_resumed_run_may_be_ended_too(tmp_path: Path, whole: Result) -> None:
    path = tmp_path / "out.nc"
    fretting().run(path, on_step=lambda step: True)
    second = hexcontact.resume(path, on_step=lambda step: step.number == 4)
    assert len(second) == 4
    assert second.stopped == "stopped by on_step after step 4"
    third = hexcontact.resume(path)
    assert third.stopped == ""
    assert_same(third, whole)


@pytest.mark.parametrize("kept", ["memory", "file"])
def test_there_is_nothing_to_end_after_the_last_step(tmp_path: Path, kept: str) -> None:
    output = tmp_path / "out.nc" if kept == "file" else None
    result = frictionless().run(output, on_step=lambda step: step.number == 4)
    assert result.complete
    assert result.stopped == ""


@pytest.mark.parametrize("error", [ZeroDivisionError("oh"), DeckError("oh"), KeyboardInterrupt()])
def test_an_exception_in_a_callback_is_passed_on_and_nothing_is_lost(
    tmp_path: Path, whole: Result, error: BaseException
) -> None:
    def fail(step: Step) -> None:
        if step.number == 2:
            raise error

    path = tmp_path / "out.nc"
    with pytest.raises(type(error)) as raised:
        fretting().run(path, on_step=fail)
    assert raised.value is error
    notes = " ".join(getattr(error, "__notes__", [])) if isinstance(error, Exception) else "resume"
    assert notes.count("to resume: hexcontact resume") == 1 or notes == "resume"
    kept = open_result(path)
    assert len(kept) == 2
    expected = "interrupted" if isinstance(error, KeyboardInterrupt) else "on_step raised"
    assert kept.stopped.startswith(expected)
    assert_same(hexcontact.resume(path), whole)


# --- sessions -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kept", ["memory", "file"])
def test_iterating_is_running(tmp_path: Path, whole: Result, kept: str) -> None:
    path = tmp_path / "out.nc"
    with fretting().start(path if kept == "file" else None) as session:
        numbers = [step.number for step in session]
        result = session.result() if kept == "memory" else None
    assert numbers == [1, 2, 3, 4, 5]
    result = result or open_result(path)
    assert result.complete
    assert_same(result, whole)
    assert Case.from_text(result.deck) == fretting()


def test_a_session_waits_between_its_steps(tmp_path: Path) -> None:
    path = tmp_path / "out.nc"
    session = fretting().start(path)
    with pytest.raises(DeckError, match="no load step of the session is finished yet"):
        session.result()
    assert "nothing solved yet" in repr(session)
    first = next(session)
    assert len(open_result(path)) == 1
    assert session.step is first
    second = next(session)
    assert len(open_result(path)) == 2
    assert [step.pressure.size > 0 for step in session.steps] == [False, True]  # the others are on the disk
    assert second.normal_load == pytest.approx(100.0)
    assert not session.result().complete
    assert list(session.history.index) == [1, 2]
    assert session.history.approach[2] == second.approach
    assert "after Step 2: press" in repr(session)
    session.close()


def test_a_session_that_leaves_loads_of_the_case_can_be_resumed(tmp_path: Path, whole: Result) -> None:
    path = tmp_path / "out.nc"
    with fretting().start(path) as session:
        next(session)
        next(session)
    assert open_result(path).stopped == "the session was closed after step 2"
    assert_same(hexcontact.resume(path), whole)


def test_loads_by_hand_are_those_of_a_deck(whole: Result) -> None:
    session = fretting().start()
    for load in LOADS:
        session.advance(**load)
    assert_same(session.result(), whole)
    assert session.result().complete


def test_the_next_load_may_depend_on_the_last_answer(tmp_path: Path) -> None:
    path = tmp_path / "out.nc"
    case = fretting()
    with case.start(path) as session:
        pressed = [next(session), next(session)][-1]
        load = 0.0
        while session.step.stick_area > 0.4 * pressed.stick_area or load == 0.0:
            load += 3.0
            session.advance(tangential_load_x=load, label="until little sticks")
        session.advance(tangential_load_x=0.0, steps=2)
        session.advance(normal_load=150.0, shift_x=session.step.shift_x)
        with pytest.raises(StopIteration):  # the loads of the case were left
            next(session)
    result = open_result(path)
    assert result.complete
    assert not journal_of(path).exists()
    steps = int(load / 3.0)
    assert steps >= 2
    assert len(result) == 2 + steps + 3
    assert result.tangential_load_x.values[2 : 2 + steps] == pytest.approx(3.0 * np.arange(1, steps + 1))
    assert list(result.segment.values) == [1, 1, *range(2, 2 + steps), 2 + steps, 2 + steps, 3 + steps]
    # the deck of the result has the loads that were applied, on the same nodes
    again = Case.from_text(result.deck).run()
    both = {"row": again.row, "col": again.col}
    for name in ("tangential_load_x", "shift_x", "approach", "normal_load"):
        expected = result[name].values
        # a load that is next to none is as exact as the larger ones
        scale = np.abs(expected).max()
        assert again[name].values == pytest.approx(expected, rel=1e-6, abs=1e-8 * scale), name
    there = result.traction_x.reindex(both, fill_value=0.0).values
    assert np.abs(again.traction_x.values - there).max() < 1e-6 * float(result.max_traction.max())


def test_a_step_that_fails_leaves_the_session_where_it_was() -> None:
    session = fretting().start()
    session.advance(normal_load=100.0)
    before = session.step
    with pytest.raises(DeckError, match=r"^tangential_load_x = 30.0: gross sliding"):
        session.advance(tangential_load_x=30.0)
    with pytest.raises(DeckError, match=r"^normal_load = -1.0: expected a force of at least 0"):
        session.advance(normal_load=-1.0)
    with pytest.raises(DeckError, match="normal_load or approach, not both"):
        session.advance(normal_load=1.0, approach=1e-6)
    with pytest.raises(DeckError, match="expected at least one of"):
        session.advance(label="nothing")
    assert session.step is before
    # by approach the sliding load is not known beforehand: the third of four increments slides
    session.advance(approach=before.approach)
    with pytest.raises(ConvergenceError, match=r"step 5 of 6: gross sliding"):
        session.advance(tangential_load_x=28.0, steps=4)
    assert len(Case.from_text(session.result().deck).load_steps) == 4
    assert session.step.tangential_load_x == pytest.approx(14.0)
    assert session.step.number == 4
    last = session.advance(tangential_load_x=15.0)
    assert last.number == 5
    assert len(Case.from_text(session.result().deck).load_steps) == 5
    # ... as if the step that failed had not been tried
    other = fretting().start()
    other.advance(normal_load=100.0)
    other.advance(approach=before.approach)
    other.advance(tangential_load_x=7.0)
    other.advance(tangential_load_x=14.0)
    other.advance(tangential_load_x=15.0)
    assert_array_equal(other.step.traction_x, last.traction_x)


def test_a_load_is_checked_and_unrolled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    session = fretting().start()
    checked: list[Any] = []
    validate = Load.model_validate
    monkeypatch.setattr(Load, "model_validate", lambda data: checked.append(data) or validate(data))
    for count, load in enumerate((10.0, 11.0, 12.0, 13.0), start=1):
        session.advance(normal_load=load)
        assert len(checked) == count
    with pytest.raises(DeckError, match="tangential_load_x: gross sliding|tangential_load_x = 1000.0: gross"):
        session.advance(tangential_load_x=1000.0)
    assert session.advance(normal_load=14.0).segment == 5
    assert [step.normal_load for step in session.steps] == pytest.approx([10.0, 11.0, 12.0, 13.0, 14.0])


def test_steps_may_be_taken_back() -> None:
    session = fretting().start()
    session.advance(normal_load=100.0)
    session.advance(tangential_load_x=6.0)
    wanted = session.step.traction_x
    session.advance(tangential_load_x=-9.0, steps=2)
    session.back(3)
    assert session.step.number == 1
    assert len(session.result()) == 1
    session.advance(tangential_load_x=6.0)
    assert_array_equal(session.step.traction_x, wanted)
    assert len(Case.from_text(session.result().deck).load_steps) == 2
    for count in (0, 3):
        with pytest.raises(DeckError, match=rf"steps = {count}: expected 1 to 2"):
            session.back(count)


def test_a_result_is_that_of_the_moment_it_was_asked_for() -> None:
    """Its data set is made when it is first used, which may be later or elsewhere."""
    session = fretting().start()
    session.advance(normal_load=100.0)
    result, sent = session.result(), pickle.dumps(session.result())
    session.advance(tangential_load_x=6.0)
    assert len(result) == len(pickle.loads(sent)) == 1
    assert pickle.loads(sent).dataset.identical(result.dataset)
    assert result.dataset is result.dataset


def test_a_run_whose_data_set_is_not_used_makes_none(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    make = run.assemble
    monkeypatch.setattr(run, "assemble", lambda *given: made.append(given) or make(*given))
    result = frictionless().run()
    assert not made
    assert len(result) == 4
    assert result.complete
    assert len(made) == 1


def test_steps_of_the_case_may_be_taken_back(whole: Result) -> None:
    session = fretting().start()
    for step in session:
        if step.number == 3 and len(session.steps) == 3:
            break
    session.back(2)
    assert [step.number for step in session] == [2, 3, 4, 5]
    assert_same(session.result(), whole)


def test_a_deck_has_the_loads_of_the_case_as_far_as_they_were_solved() -> None:
    session = fretting().start()
    for step in session:
        if step.number == 3:
            break
    session.advance(tangential_load_x=-2.0, steps=2, label="back")
    steps = Case.from_text(session.result().deck).load_steps
    assert [step.label for step in steps] == ["press", "press", "shear", "back", "back"]
    assert [step.z.value for step in steps] == [50.0, 100.0, 100.0, 100.0, 100.0]
    assert [step.x.value for step in steps] == pytest.approx([0.0, 0.0, 4.0, 1.0, -2.0])


def test_a_file_cannot_go_back_and_a_closed_session_does_nothing(tmp_path: Path) -> None:
    with frictionless().start(tmp_path / "out.nc") as session:
        next(session)
        with pytest.raises(DeckError, match="writes a file cannot go back"):
            session.back()
        session.advance(normal_load=50.0)
    with pytest.raises(DeckError, match="the session is closed"):
        session.advance(normal_load=60.0)
    assert session.result().complete
    assert len(session.result()) == 2


def test_an_exception_in_a_session_keeps_what_is_finished(tmp_path: Path) -> None:
    path = tmp_path / "out.nc"
    with pytest.raises(ZeroDivisionError), fretting().start(path) as session:
        session.advance(normal_load=80.0)
        session.advance(tangential_load_x=4.0, steps=2)
        _ = 1 / 0
    assert len(open_result(path)) == 3
    result = hexcontact.resume(path)  # there is nothing left to be solved
    assert result.complete
    assert result.tangential_load_x.values == pytest.approx([0.0, 2.0, 4.0], abs=1e-9)


def test_a_session_holds_its_file_as_long_as_somebody_has_it(tmp_path: Path) -> None:
    path = tmp_path / "out.nc"
    session = fretting().start(path)
    next(session)
    with pytest.raises(DeckError, match="is being written by another run, .* may close the session"):
        fretting().start(path, overwrite=True)
    del session
    gc.collect()
    assert open_result(path).stopped == "the session was dropped"
    with fretting().start(path, overwrite=True) as again:
        assert next(again).number == 1


def test_a_window_that_grew_by_hand_goes_on(tmp_path: Path) -> None:
    session = frictionless(loads={"normal_load": 1.0}).start()
    next(session)
    small = session.step.lattice.size
    session.advance(normal_load=1000.0)
    assert session.step.lattice.size > 4 * small
    radius = float(session.result().contact_radius_fit[-1])
    hertz = (0.75 * 1000.0 * 10e-3 / session.case.pair.effective_modulus) ** (1 / 3)
    assert radius == pytest.approx(hertz, rel=1e-3)


def test_the_nodes_of_a_resumed_session_are_the_same(tmp_path: Path) -> None:
    """The spacing of the deck would follow from its largest load, which is another one by then."""
    path = tmp_path / "out.nc"
    with pytest.raises(KeyboardInterrupt), frictionless().start(path) as session:
        session.advance(normal_load=20.0)
        session.advance(normal_load=300.0)
        raise KeyboardInterrupt
    result = hexcontact.resume(path)
    assert result.lattice.spacing == frictionless().lattice.spacing
    assert result.normal_load.values == pytest.approx([20.0, 300.0])


def test_a_fixed_window_stays_fixed(tmp_path: Path) -> None:
    session = frictionless(nodes_in_radius=None, spacing=20e-6, window=[31, 31]).start()
    session.advance(normal_load=10.0)
    deck = Case.from_text(session.result().deck)
    assert deck.window_fixed
    assert deck.lattice == session.step.lattice
    with pytest.raises(DeckError, match="reaches the rim"):
        session.advance(normal_load=1e5)


def test_twist_is_in_radians() -> None:
    session = fretting(loads=LOADS[:1]).start()
    session.advance(normal_load=100.0)
    step = session.advance(twist=1e-3)
    assert step.twist == pytest.approx(1e-3)
    assert step.torque > 0.0
    assert math.isclose(float(Case.from_text(session.result().deck).load_steps[-1].twist.value), 1e-3)


# --- cases that are changed ---------------------------------------------------------------------------------


def test_a_case_may_be_changed() -> None:
    case = fretting(loads=LOADS[:1])
    other = case.changed({"friction.coefficient": 0.4, "load.1.steps": 5, "grid.nodes_in_radius": 9})
    assert case.friction_coefficient == 0.2
    assert other.friction_coefficient == 0.4
    assert len(other.load_steps) == 5
    assert other.lattice.spacing == pytest.approx(case.lattice.spacing * 6 / 9)
    assert other.changed({"friction.coefficient": 0.2, "load.1.steps": 2, "grid.nodes_in_radius": 6}) == case
    with pytest.raises(DeckError, match=r"friction\.coeficient: unknown key; did you mean coefficient"):
        case.changed({"friction.coeficient": 0.4})


def test_the_gap_of_a_case_stays_when_it_is_changed() -> None:
    case = fretting(body_1=STEEL, gap=lambda x, y: (x**2 + y**2) / 20e-3, loads={"normal_load": 10.0})
    other = case.changed({"load.1.normal_load": "80 N"})
    assert float(other.run().contact_radius_fit[0]) == pytest.approx(
        2.0 * float(case.run().contact_radius_fit[0]), rel=0.02
    )
