"""Cases in threads and processes of their own: the same answers to the bit, and nobody waits."""

import operator
import pickle
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import DECK, ENVIRONMENT, wait_for
from numpy.testing import assert_array_equal

import hexcontact
from hexcontact import (
    Case,
    DeckError,
    FlexibilityOperator,
    FrictionalContact,
    HexcontactError,
    Lattice,
    NormalContact,
    Result,
    Step,
    open_result,
)
from hexcontact.core import flat
from hexcontact.core.contact import ElasticPair, Method
from hexcontact.deck.surfaces import Sphere
from hexcontact.netcdf_library import LOCK

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
SOFT = {"young_modulus": 70e9, "poisson_ratio": 0.33}


def fretting(**arguments: Any) -> Case:
    given: dict[str, Any] = {
        "body_1": {**STEEL, "surface": Sphere(radius=10e-3)},
        "body_2": SOFT,
        "nodes_in_radius": 8,
        "friction_coefficient": 0.2,
        "loads": [{"normal_load": 100.0, "steps": 2}, {"tangential_load_x": 15.0, "steps": 2}],
    }
    return Case(**{**given, **arguments})


CASES: dict[str, Callable[[], Case]] = {
    "dissimilar": fretting,
    "alike": lambda: fretting(body_2=STEEL, nodes_in_radius=10),
    "direct": lambda: fretting(nodes_in_radius=5, method="direct"),
    "frictionless": lambda: fretting(friction_coefficient=None, loads={"normal_load": 200.0, "steps": 3}),
}


def assert_same(one: Result, other: Result) -> None:
    """See to it that two results are the same to the bit, but for the times they took."""
    assert set(one.dataset.data_vars) == set(other.dataset.data_vars)
    for name in set(one.dataset.data_vars) - {"seconds"}:
        assert_array_equal(one[str(name)].values, other[str(name)].values, err_msg=str(name))


# --- threads ------------------------------------------------------------------------------------------------


def test_locks_hold_in_a_build_without_openmp() -> None:
    sources = sorted((Path(__file__).parents[2] / "fortran").rglob("*.f90"))
    assert len(sources) > 50
    for path in sources:
        assert not re.search(r"(?i)!\$omp\s+(critical|atomic)", path.read_text(encoding="utf-8")), path


def test_cases_in_threads_have_the_answers_of_cases_in_turn(tmp_path: Path) -> None:
    cases = {name: make() for name, make in CASES.items()}
    serial = {name: case.run() for name, case in cases.items()}
    barrier = threading.Barrier(2)

    def together(place: int) -> list[tuple[str, Result]]:
        names = list(cases)[:: 1 if place else -1]
        barrier.wait()
        # the same case is run in both threads, in memory and into a file
        return [(n, cases[n].run(tmp_path / f"{n}.nc" if place else None)) for n in names]

    with ThreadPoolExecutor(2) as pool:
        for found in pool.map(together, range(2)):
            for name, result in found:
                assert_same(result, serial[name])
            assert [name for name, _ in found] in ([*cases], [*cases][::-1])


def test_long_rows_have_the_same_answer_in_any_number_of_threads(tmp_path: Path) -> None:
    deck = DECK.replace("nodes_in_radius = 4", 'spacing = "1 um"\nwindow = [7, 9400]')
    deck = deck.replace('"20 N"\nsteps = 2', '"1e-4 N"').replace("= 0.2", "= 0.1").replace("432", "72") + (
        '[[load]]\ntangential_load_x = "6e-6 N"\n[solver]\ntolerance = 1e-12\n'
    )
    (tmp_path / "sphere.toml").write_text(deck)
    for threads in ("1", "2"):
        subprocess.run(
            [
                sys.executable,
                "-m",
                "hexcontact",
                "run",
                "sphere.toml",
                "--quiet",
                "--output",
                f"{threads}.nc",
            ],
            cwd=tmp_path,
            env=ENVIRONMENT | {"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
            check=True,
        )
    assert_same(open_result(tmp_path / "1.nc"), open_result(tmp_path / "2.nc"))


def test_files_in_threads_and_xarray_in_another(tmp_path: Path) -> None:
    program = [sys.executable, Path(__file__).with_name("files_in_threads.py"), tmp_path, "ord", "8"]
    done = subprocess.run(program, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr


def test_only_one_module_opens_files_of_netcdf() -> None:
    package = Path(hexcontact.__file__).parent
    opens = re.compile(r"netCDF4\.Dataset\(|\b(open|load)_dataset\(|\.to_netcdf\(")
    found = {p.name: len(opens.findall(p.read_text(encoding="utf-8"))) for p in package.rglob("*.py")}
    assert {name for name, count in found.items() if count} == {"netcdf_library.py"}


def test_a_lock_of_xarray_that_is_missing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    import xarray
    import xarray.backends.netCDF4_ as backend

    monkeypatch.delattr(backend, "NETCDF4_PYTHON_LOCK")
    with pytest.raises(HexcontactError, match=re.escape(f"xarray {xarray.__version__} has no lock")):
        LOCK.acquire()
    monkeypatch.undo()
    with LOCK, LOCK:
        assert backend.NETCDF4_PYTHON_LOCK.locked()
        taken = ThreadPoolExecutor(1).submit(LOCK.acquire, False)
        assert not taken.result()
    assert not backend.NETCDF4_PYTHON_LOCK.locked()
    assert pickle.loads(pickle.dumps(LOCK)) is LOCK


def test_two_sessions_in_two_threads_do_not_feel_each_other() -> None:
    def driven(load: float) -> list[float]:
        session = fretting().start()
        session.advance(normal_load=100.0)
        return [float(session.advance(tangential_load_x=q).shift_x) for q in np.linspace(0.1, 1.0, 6) * load]

    alone = [driven(load) for load in (10.0, 18.0)]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(driven, (10.0, 18.0))) == alone


def test_a_session_refuses_a_second_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also while the first one waits in a step; later the session goes on."""
    session, begun, go_on = fretting().start(), threading.Event(), threading.Event()
    solve = session._next_step

    def waiting(*arguments: object) -> object:
        begun.set()
        assert go_on.wait(60.0)
        return solve(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(session, "_next_step", waiting)
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(session.advance, normal_load=100.0)
        assert begun.wait(60.0)
        for call in (lambda: next(session), lambda: session.advance(normal_load=1.0), session.back):
            with pytest.raises(DeckError, match="the session is at work in another thread; call it from one"):
                call()
        go_on.set()
        assert first.result().normal_load == pytest.approx(100.0)
    assert session.advance(normal_load=50.0).normal_load == pytest.approx(50.0)


@pytest.fixture
def ticks() -> Iterator[list[float]]:
    """Times at which another thread of Python could run, about every millisecond."""
    times: list[float] = []
    done = threading.Event()

    def count() -> None:
        while not done.wait(0.001):
            times.append(time.perf_counter())

    thread = threading.Thread(target=count)
    thread.start()
    yield times
    done.set()
    thread.join()


LATTICE = Lattice(8e-6, -70, -70, 141, 141)
GAP = (LATTICE.x**2 + LATTICE.y**2) / 20e-3
PAIR = ElasticPair.from_materials(210e9, 0.3, 70e9, 0.33)


def press(method: Method) -> Callable[[], object]:
    lattice = LATTICE if method == "fft" else Lattice(1.6e-5, -20, -20, 41, 41)
    gap = (lattice.x**2 + lattice.y**2) / 20e-3
    contact = NormalContact(lattice, PAIR, gap, method=method, threads=1)
    return lambda: contact.solve(normal_load=100.0, tolerance=1e-12)


def shear() -> Callable[[], object]:
    contact = FrictionalContact(LATTICE, PAIR, GAP, friction_coefficient=0.2, threads=1)
    state = contact.virgin()
    controls = ["force", "force", "force", "displacement"]
    return lambda: contact.advance(state, controls, [100.0, 5.0, 0.0, 0.0])


def apply() -> Callable[[], object]:
    lattice = Lattice(1e-5, 0, 0, 50, 50)
    operator_ = FlexibilityOperator(lattice, PAIR, "direct", threads=1)
    return lambda: operator_.apply(lattice.x, lattice.y, lattice.x)


class Timed:
    """Procedures of the compiled core, and when they were at work."""

    def __init__(self, module: Any) -> None:
        self.module = module
        self.calls: list[tuple[float, float]] = []

    def __getattr__(self, name: str) -> Callable[..., Any]:
        procedure = getattr(self.module, name)

        def timed(*arguments: Any, **named: Any) -> Any:
            begun = time.perf_counter()
            found = procedure(*arguments, **named)
            self.calls.append((begun, time.perf_counter()))
            return found

        return timed


@pytest.mark.parametrize("work", [lambda: press("fft"), lambda: press("direct"), shear, apply])
def test_python_goes_on_while_the_core_works(
    ticks: list[float], work: Callable[[], Callable[[], object]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a switch between its own instructions another thread runs only where the core lets go."""
    call = work()
    core = Timed(flat._flat)
    monkeypatch.setattr(flat, "_flat", core)

    def ticked_meanwhile() -> bool:
        core.calls.clear()
        call()
        return any(begun < t < ended for begun, ended in core.calls for t in ticks)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e6)
    try:
        wait_for(ticked_meanwhile)
    finally:
        sys.setswitchinterval(interval)


# --- processes ----------------------------------------------------------------------------------------------


def test_cases_and_results_go_to_other_processes_and_come_back(tmp_path: Path) -> None:
    case = fretting()
    here = case.run(tmp_path / "out.nc")
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        there = pool.submit(Case.run, case).result()
        assert_same(there, here)
        # a result that is read from its file when it is asked for, too
        tractions = pool.submit(operator.attrgetter("traction_x"), open_result(tmp_path / "out.nc")).result()
        assert_array_equal(tractions.values, here.traction_x.values)
        comparison = pool.submit(Result.compare, here).result()
        assert comparison.note == here.compare().note


def test_pickled_objects_are_the_same() -> None:
    case = fretting()
    assert pickle.loads(pickle.dumps(case)) == case
    result = case.run()
    again = pickle.loads(pickle.dumps(result))
    assert_same(again, result)
    assert again.compare().step == 4
    seen: list[Step] = []
    case.run(
        on_step=lambda step: pickle.loads(pickle.dumps(step)).approach != step.approach or seen.append(step)
    )
    assert len(seen) == 4


def test_a_dask_cluster_takes_cases() -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.Client(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as client:
        cases = [fretting(friction_coefficient=mu, gap=None) for mu in (0.2, 0.4)]
        found = client.gather(client.map(Case.run, cases))
    for case, result in zip(cases, found, strict=True):
        assert_same(result, case.run())
