"""The step loop: what a step holds, windows that grow, what stops a run, and who is told."""

import io
import itertools
import logging
import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from hexcontact.analytic import hertz_sphere
from hexcontact.case import Case
from hexcontact.core import contact, cores, memory
from hexcontact.core.lattice import Lattice
from hexcontact.deck.surfaces import Punch, Sphere
from hexcontact.errors import ConvergenceError, DeckError, ResourceError, StopRun
from hexcontact.result.journal import journal_of
from hexcontact.result.step import Step
from hexcontact.result.store import open_result
from hexcontact.solve.events import Callback, Lines, Listener, Stopped, reporter
from hexcontact.solve.steps import steps
from hexcontact.text import quantity

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
ALUMINIUM = {"young_modulus": 70e9, "poisson_ratio": 0.33}


def sphere(**arguments: Any) -> Case:
    """Return a sphere of 10 mm on a flat, 100 N, about 12 spacings in the contact radius."""
    given: dict[str, Any] = {"nodes_in_radius": 12, "normal_load": 100.0, "title": "sphere"}
    if "loads" in arguments:
        del given["normal_load"]
    return Case(body_1={**STEEL, "surface": Sphere(radius=10e-3)}, body_2=ALUMINIUM, **{**given, **arguments})


def windowed(case: Case, n: int, fixed: bool = False) -> Case:
    """Make a case start from a window of n x n nodes about the origin."""
    case.lattice = replace(case.lattice, row_first=-(n // 2), col_first=-(n // 2), n_row=n, n_col=n)
    case.window_fixed = fixed
    return case


def test_a_step_holds_what_the_solution_says() -> None:
    case = sphere()
    [step] = steps(case)
    history, fields, lattice = step.history, step.fields, step.lattice
    hertz = hertz_sphere(case.pair.effective_modulus, 10e-3, normal_load=100.0)
    # bounds: discretization at 12 spacings (theory: p_max and approach second order, a_A within 0.2 spacings)
    assert history["max_pressure"] == pytest.approx(hertz.max_pressure, rel=6.3e-4)
    assert history["approach"] == pytest.approx(hertz.approach, rel=3.5e-4)
    assert history["contact_radius"] == pytest.approx(hertz.contact_radius, abs=0.072 * lattice.spacing)
    assert history["contact_radius_fit"] == pytest.approx(hertz.contact_radius, abs=0.014 * lattice.spacing)
    # U = integral of P d(approach) = (2/5) P approach for a sphere
    assert history["elastic_energy"] == pytest.approx(0.4 * 100.0 * float(history["approach"]), rel=6.3e-4)
    # ... and exactly half the work of the pressure on the elastic closing, gap - initial gap + approach
    closing = fields["gap"] - fields["initial_gap"] + history["approach"]
    work = 0.5 * lattice.cell_area * float((fields["pressure"] * closing).sum())
    assert history["elastic_energy"] == pytest.approx(work, rel=1e-12)
    assert history["normal_load"] == pytest.approx(lattice.cell_area * fields["pressure"].sum(), rel=1e-12)
    assert history["contact_area"] == pytest.approx(
        lattice.cell_area * (fields["pressure"] > 0).sum(), rel=1e-12
    )
    assert history["residual_normal"] <= 1e-8
    assert history["residual_force"] <= 1e-8
    assert_array_equal(fields["zone"] == 2, fields["pressure"] > 0)
    assert history["segment"] == 1
    assert step.number == 1


def test_file_and_memory_hold_the_same(tmp_path: Path) -> None:
    case = sphere(loads=[{"normal_load": 100.0, "steps": 3, "label": "press"}])
    in_memory = case.run()
    in_file = case.run(tmp_path / "out.nc")
    assert in_memory.complete
    assert in_file.complete
    assert list(in_file.label.values) == ["press"] * 3
    for name in ("pressure", "gap", "zone", "approach", "initial_gap"):
        assert_array_equal(in_memory[name].values, in_file[name].values)
    assert in_file.dataset.attrs["effective_modulus"] == case.pair.effective_modulus
    assert Case.from_text(in_file.deck).title == "sphere"


def test_a_contact_that_reaches_the_rim_gets_a_larger_window() -> None:
    small = windowed(sphere(), 11).run()
    large = windowed(sphere(), 61).run()
    assert small.lattice.n_row > 24
    assert small.lattice.spacing == large.lattice.spacing
    for name in ("max_pressure", "approach", "contact_area"):
        assert float(small[name][0]) == pytest.approx(float(large[name][0]), rel=1e-8)
    both = {"row": small.row, "col": small.col}
    p_max = float(large.max_pressure[0])
    inside = small.pressure.isel(step=0), large.pressure.isel(step=0).reindex(both, fill_value=0.0)
    assert_allclose(inside[0], inside[1], rtol=0, atol=1e-7 * p_max)


@pytest.mark.parametrize(("row", "col"), [(-9, 0), (9, 0), (0, -9), (0, 9)])
def test_a_window_beside_the_contact_grows_towards_it(row: int, col: int) -> None:
    case = sphere(normal_load=10.0)
    expected = float(case.run().max_pressure[0])
    case.lattice = replace(case.lattice, row_first=row - 12, col_first=col - 12, n_row=25, n_col=25)
    case.window_fixed = False
    assert float(case.run().max_pressure[0]) == pytest.approx(expected, rel=1e-8)


def test_steps_before_the_growth_are_padded() -> None:
    case = windowed(sphere(loads=[{"normal_load": 0.5}, {"normal_load": 100.0}]), 13)
    result = case.run()
    assert result.pressure.shape[1] > 13
    assert float(result.pressure.isel(step=0).sum()) * result.lattice.cell_area == pytest.approx(
        0.5, rel=1e-9
    )
    assert np.isnan(result.gap.isel(step=0, row=0)).all()
    assert not np.isnan(result.gap.isel(step=1)).any()


def test_a_fixed_window_does_not_grow() -> None:
    case = windowed(sphere(), 11, fixed=True)
    with pytest.raises(
        DeckError, match=r"grid: in step 1 the contact reaches the rim of the window of 11 x 11 nodes"
    ):
        case.run()


def test_outside_a_punch_there_is_no_gap() -> None:
    case = Case(
        body_1={"rigid": True, "surface": Punch(radius=1e-3)},
        body_2=ALUMINIUM,
        nodes_in_radius=12,
        approach=1e-6,
    )
    result = case.run()
    radius = np.hypot(result.x, result.y).values
    assert np.isnan(result.initial_gap.values[radius > 1.001e-3]).all()
    assert np.isnan(result.gap.values[0][radius > 1.001e-3]).all()
    assert_array_equal(result.initial_gap.values[radius < 0.999e-3], 0.0)
    assert float(result.approach[0]) == 1e-6


def test_the_load_may_return_to_zero_and_come_back() -> None:
    loads = [{"normal_load": 100.0}, {"normal_load": 0.0, "steps": 2}, {"normal_load": 100.0}]
    result = sphere(loads=loads).run()
    assert_array_equal(result.normal_load.values[2], 0.0)
    assert_array_equal(result.pressure.values[2], 0.0)
    assert_array_equal(result.zone.values[2], 0)
    assert float(result.elastic_energy[2]) == 0.0
    assert float(result.contact_area[2]) == 0.0
    assert float(result.contact_radius_fit[2]) == 0.0
    p_max = float(result.max_pressure[0])
    assert_allclose(result.pressure.values[3], result.pressure.values[0], rtol=0, atol=1e-7 * p_max)


def test_a_change_of_control_starts_from_where_things_stand() -> None:
    loads = [{"normal_load": 50.0}, {"approach": 3e-6, "steps": 2}, {"normal_load": 100.0, "steps": 2}]
    result = sphere(loads=loads).run()
    approach, load = result.approach.values, result.normal_load.values
    assert approach[1] == pytest.approx((approach[0] + 3e-6) / 2, rel=1e-12)
    assert approach[2] == pytest.approx(3e-6, rel=1e-12)
    assert load[3] == pytest.approx((load[2] + 100.0) / 2, rel=1e-8)
    assert load[4] == pytest.approx(100.0, rel=1e-8)
    assert list(result.segment.values) == [1, 2, 2, 3, 3]


NAMES = [f"displacement_{body}_{axis}" for body in (1, 2) for axis in "xyz"]


def test_displacements_of_the_bodies_on_request() -> None:
    result = sphere(fields=["pressure", "gap", *NAMES]).run()
    u = {name: result[name].values[0] for name in NAMES}
    closing = result.gap.values[0] - result.initial_gap.values + float(result.approach[0])
    assert_allclose(u["displacement_1_z"] + u["displacement_2_z"], closing, rtol=1e-7)
    # one body's share of the closing is its share of sum (1 - nu^2)/E
    share_1 = (1 - 0.3**2) / 210e9
    share_2 = (1 - 0.33**2) / 70e9
    assert_allclose(u["displacement_1_z"] * share_2, u["displacement_2_z"] * share_1, rtol=1e-7)
    # pressure draws both surfaces towards the axis, in proportion to (1 - 2 nu)(1 + nu)/E
    x = result.x.values
    outside = np.abs(x) > 2 * result.lattice.spacing
    assert (u["displacement_1_x"][outside] * x[outside] < 0).all()
    drawn_1 = (1 - 0.6) * 1.3 / 210e9
    drawn_2 = (1 - 0.66) * 1.33 / 70e9
    scale = np.abs(u["displacement_2_x"]).max()
    assert_allclose(
        u["displacement_1_x"] * drawn_2 / drawn_1, u["displacement_2_x"], rtol=0, atol=1e-7 * scale
    )
    assert "zone" not in result.dataset


def test_a_rigid_body_is_not_displaced() -> None:
    case = Case(
        body_1={"rigid": True, "surface": Sphere(radius=10e-3)}, body_2=ALUMINIUM, nodes_in_radius=8,
        normal_load=10.0, fields=["pressure", *NAMES],
    )  # fmt: skip
    result = case.run()
    for axis in "xyz":
        assert_array_equal(result[f"displacement_1_{axis}"].values, 0.0)
    assert result["displacement_2_z"].values.min() > 0


# --- what stops a run -----------------------------------------------------------------------------


def test_memory_is_refused_before_it_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    case = sphere()
    monkeypatch.setattr(memory, "available", lambda: 1000)
    monkeypatch.setattr(contact, "NormalContact", None)  # must not be reached
    rows, cols = case.lattice.shape
    message = rf"a window of {rows} x {cols} nodes \(method \w+\) needs .* GB of memory and 1e-06 GB are av"
    with pytest.raises(ResourceError, match=message):
        case.run()


@pytest.fixture
def stubborn(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Make the third solution of a case miss its tolerance."""
    original = contact.NormalContact.solve
    count = 0

    def solved(self: contact.NormalContact, **arguments: Any) -> contact.NormalSolution:
        nonlocal count
        count += 1
        solution = original(self, **arguments)
        return replace(solution, converged=False, residual_normal=3e-5) if count == 3 else solution

    case = sphere(loads=[{"normal_load": 100.0, "steps": 5}])  # before: sizing the window solves too
    monkeypatch.setattr(contact.NormalContact, "solve", solved)
    yield case  # type: ignore[misc]


def test_no_convergence_is_told_with_residuals_and_keeps_the_steps_before(
    tmp_path: Path, stubborn: Case
) -> None:
    with pytest.raises(
        ConvergenceError, match=r"step 3 of 5 did not converge: .*R_n = 3\.00e-05 .*1e-08 was expected"
    ):
        stubborn.run(tmp_path / "out.nc")
    result = open_result(tmp_path / "out.nc")
    assert len(result) == 2
    assert not result.complete
    assert sorted(p.name for p in journal_of(tmp_path / "out.nc").iterdir()) == [
        "000001.npz",
        "000002.npz",
        "header.json",
        "stopped.txt",
    ]


def test_an_output_in_the_way_is_refused_before_solving(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = sphere()
    (tmp_path / "out.nc").write_text("precious")
    monkeypatch.setattr(contact, "NormalContact", None)
    with pytest.raises(DeckError, match="exists already"):
        case.run(tmp_path / "out.nc")
    assert (tmp_path / "out.nc").read_text() == "precious"


# --- who is told ----------------------------------------------------------------------------------


def test_each_step_is_told_when_it_is_safe(tmp_path: Path) -> None:
    seen: list[int] = []

    def look(step: Step) -> None:
        seen.append(step.number)
        assert len(open_result(tmp_path / "out.nc")) == step.number

    sphere(loads=[{"normal_load": 10.0, "steps": 3}]).run(tmp_path / "out.nc", on_step=look)
    assert seen == [1, 2, 3]


def test_progress_in_a_log_is_a_line_by_step() -> None:
    stream = io.StringIO()
    sphere(loads=[{"normal_load": 100.0, "steps": 2, "label": "press"}]).run(progress=Lines(stream))
    title, first, second = stream.getvalue().splitlines()
    assert title == "sphere: 2 load steps"
    assert first.startswith("step 1/2  press  P 50.00 N  approach ")
    assert second.startswith("step 2/2  press  P 100.0 N  approach ")
    for word in ("p_max", "radius", "R_n", "R_P"):
        assert word in second


def test_progress_ends_with_the_run() -> None:
    lines = Lines(io.StringIO())
    with pytest.raises(KeyboardInterrupt), lines.following("sphere", 2):
        raise KeyboardInterrupt
    lines.said("step", "of a thread that still solves")
    assert lines.stream.getvalue() == "sphere: 2 load steps\n"  # type: ignore[attr-defined]


def test_the_bar_moves_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    shown = reporter()
    assert type(shown).__name__ == "Bar"
    sphere(loads=[{"normal_load": 10.0, "steps": 2}]).run(progress=shown)
    assert "2/2" in capsys.readouterr().err


class Recorder(Listener):
    """Lists the names of all events."""

    def __init__(self) -> None:
        self.events: list[str] = []

    def begun(self, title: str, steps: int) -> None:
        self.events.append(f"begun {title} {steps}")

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        self.events.append(name)

    def step(self, step: Step) -> None:
        self.events.append(f"step {step.number}")

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        self.events.append(event)

    def ended(self, error: BaseException | None) -> None:
        self.events.append(f"ended {type(error).__name__}")


def test_a_listener_follows_a_run_from_beginning_to_end(tmp_path: Path) -> None:
    recorder = Recorder()
    case = sphere(loads=[{"normal_load": 10.0, "steps": 2}])
    case.run(tmp_path / "out.nc", progress=recorder)
    expected = ["begun sphere 2", "begun", "step 1", "step 2", "finished", "written", "ended NoneType"]
    assert recorder.events == expected
    recorder.events.clear()
    windowed(sphere(), 11).run(progress=recorder)
    different = [event for event, _ in itertools.groupby(recorder.events)]
    assert different == ["begun sphere 1", "begun", "window", "step 1", "finished", "ended NoneType"]
    recorder.events.clear()
    with pytest.raises(DeckError):
        windowed(sphere(), 11, fixed=True).run(progress=recorder)
    assert recorder.events == ["begun sphere 1", "begun", "ended DeckError"]


def test_a_listener_follows_every_lattice_and_the_estimate_of_errors() -> None:
    recorder = Recorder()
    sphere(nodes_in_radius=6, accuracy=0.05).run(progress=recorder)
    each = ["begun", "step 1", "finished"]
    names = [f"lattice {level}" for level in (1, 2, 3)]
    names += [f"lattice 1, shifted ({copy} of 4)" for copy in (1, 2, 3, 4)]
    inside = [event for name in names for event in (name, *each)]
    assert recorder.events == ["begun sphere 1", *inside, "errors", "ended NoneType"]


def test_a_callback_ends_a_run_after_each_step_but_the_last() -> None:
    [*_, last] = steps(sphere(loads=[{"normal_load": 10.0, "steps": 2}]))
    first = replace(last, index=0, load_fraction=0.5)
    for answer, reason in (("enough", ": enough"), (True, ""), (StopRun("why"), ": why"), (StopRun(), "")):

        def on_step(step: Step, answer: object = answer) -> object:
            if isinstance(answer, StopRun):
                raise answer
            return answer

        with pytest.raises(Stopped, match=rf"^stopped by on_step after step 1{reason}$"):
            Callback(on_step).step(first)
        Callback(on_step).step(last)
        with pytest.raises(Stopped, match="after step 2"):  # of a lattice, after which others come
            Callback(on_step, refines=True).step(last)
    Callback(lambda step: None).step(first)


def test_silence() -> None:
    assert type(reporter(quiet=True)) is Listener


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (8.54328e8, "Pa", "854.3 MPa"),
        (9.31463e-6, "m", "9.315 µm"),
        (999.96, "N", "1.000 kN"),
        (1000.0, "N", "1.000 kN"),
        (0.0, "N", "0 N"),
        (-2.5e-3, "m", "-2.500 mm"),
        (0.19, "", "0.19"),
        (1e-20, "m", "1e-20 m"),
        (math.nan, "m", "-"),
        (1.234e-7, "m2", "0.1234 mm²"),
        (3.3, "m2", "3.300 m²"),
        (2.4e-14, "m3", "24000 µm³"),
        (5e-20, "m3", "0.05000 µm³"),
    ],
)
def test_quantities_are_written_with_prefixes(value: float, unit: str, text: str) -> None:
    assert quantity(value, unit) == text


# --- memory ---------------------------------------------------------------------------------------


def group(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name.replace("_in_bytes", "§").replace("_", ".").replace("§", "_in_bytes")).write_text(text)


def test_limits_of_control_groups_count(tmp_path: Path) -> None:
    process = tmp_path / "cgroup"
    process.write_text("0::/batch/job7\n")
    plenty = memory.available(tmp_path / "sys", process)
    assert plenty > 10**8
    group(
        tmp_path / "sys/batch/job7",
        memory_max="max\n",
        memory_current="10\n",
        memory_stat="inactive_file 5\n",
    )
    group(
        tmp_path / "sys/batch",
        memory_max="30000000\n",
        memory_current="20000000\n",
        memory_stat="anon 7\ninactive_file 4000000\n",
    )
    assert memory.available(tmp_path / "sys", process) == 14_000_000


def test_limits_of_old_control_groups_count(tmp_path: Path) -> None:
    process = tmp_path / "cgroup"
    process.write_text("5:cpu,cpuacct:/x\n4:memory:/job\n")
    group(
        tmp_path / "sys/memory/job",
        memory_limit_in_bytes="9000000",
        memory_usage_in_bytes="1000000",
        memory_stat="total_inactive_file 500000\n",
    )
    assert memory.available(tmp_path / "sys", process) == 8_500_000


@pytest.mark.parametrize(
    ("groups", "files", "number"),
    [
        ("0::/batch/job\n", {"batch/job/cpu.max": "max 100000\n"}, 8),
        ("0::/batch/job\n", {"batch/job/cpu.max": "max 100000\n", "batch/cpu.max": "250000 100000\n"}, 2),
        ("5:cpu,cpuacct:/job\n", {"cpu/job/cpu.cfs_quota_us": "-1", "cpu/job/cpu.cfs_period_us": "9"}, 8),
        ("5:cpu,cpuacct:/job\n", {"cpu/job/cpu.cfs_quota_us": "5", "cpu/job/cpu.cfs_period_us": "9"}, 1),
        ("0::/batch/job\n", {}, 8),
    ],
)
def test_cores_are_those_of_a_quota_of_processor_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, groups: str, files: dict[str, str], number: int
) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: range(8))
    (tmp_path / "cgroup").write_text(groups)
    for name, text in files.items():
        (tmp_path / "sys" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "sys" / name).write_text(text)
    assert cores.cores(tmp_path / "sys", tmp_path / "cgroup") == number


def test_openmp_heeds_a_quota_of_processor_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: range(8))
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    monkeypatch.setattr(cores, "_quota", lambda *_: 3)
    monkeypatch.setenv("OMP_NUM_THREADS", "6")
    cores.limit_threads()
    assert memory.threads() == 6
    monkeypatch.delenv("OMP_NUM_THREADS")
    cores.limit_threads()
    assert os.environ["OMP_NUM_THREADS"] == "3"
    monkeypatch.delenv("OMP_NUM_THREADS")
    monkeypatch.setattr(cores, "_quota", lambda *_: 9)
    cores.limit_threads()
    assert "OMP_NUM_THREADS" not in os.environ


def test_memory_that_is_there_is_not_refused() -> None:
    memory.require(1000, "a window", "nothing")
    check: Callable[[], None] = lambda: memory.require(10**18, "a window of 9 x 9 nodes", "choose less")  # noqa: E731
    with pytest.raises(
        ResourceError, match=r"a window of 9 x 9 nodes needs 1e\+09 GB of memory and .* GB are available"
    ):
        check()


def test_two_cases_run_in_two_threads() -> None:
    alone = sphere().run()
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda _: sphere().run(), range(4)))
    for result in together:
        for name in set(alone.dataset.data_vars) - {"seconds"}:
            assert_array_equal(result[str(name)].values, alone[str(name)].values, err_msg=str(name))
