"""Runs that were stopped, killed or ran out of disk go on, to the bit as if nothing had happened."""

import dataclasses
import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import commands
import pytest
import xarray
from commands import ENVIRONMENT

import hexcontact
from hexcontact import Case, ConvergenceError, DeckError, ResourceError, resume
from hexcontact.core import contact
from hexcontact.result import store as store_module
from hexcontact.result.journal import (
    Header,
    Journal,
    journal_of,
    read_record,
    write_header,
    write_record,
)
from hexcontact.result.layout import Metadata
from hexcontact.result.step import Step
from hexcontact.result.store import Store, open_result

RECORD_KB = 100
SPHERE = {"young_modulus": 432e9, "poisson_ratio": 0.32, "surface": {"shape": "sphere", "radius": 1e-3}}
ALUMINIUM = {"young_modulus": 72e9, "poisson_ratio": 0.32}
PRESS_AND_SHEAR = [
    {"normal_load": 20.0, "steps": 2, "label": "press"},
    {"tangential_load_x": 1.0, "steps": 2, "label": "shear"},
]
MIXED = [  # ramps that begin at a value which an earlier step found
    {"normal_load": 31.5, "steps": 2},
    {"shift_x": 2e-7, "steps": 2},
    {"tangential_load_x": 0.5, "steps": 2},
    {"approach": 4e-6, "twist": 1e-3, "steps": 3},
    {"normal_load": 40.0, "torque": 0.0, "steps": 2},
]
SMALL_WINDOW = {"nodes_in_radius": None, "spacing": 6e-6, "extent": "auto"}
KINDS: dict[str, dict[str, Any]] = {
    "frictionless": {"friction_coefficient": None, "loads": [{"normal_load": 20.0, "steps": 3}]},
    "frictionless by approach": {
        "friction_coefficient": None,
        "loads": [{"normal_load": 20.0, "steps": 2}, {"approach": 5e-6, "steps": 3}],
    },
    "static": {"algorithm": "static"},
    "incremental": {},
    "interpolated": {"entry": "interpolated"},
    "direct": {"method": "direct", "nodes_in_radius": 4},
    "goodman": {"coupling": "goodman"},
    "no slip": {"friction_coefficient": float("inf")},
    "mixed control": {"loads": MIXED},
    "adaptive steps": {
        "step_tolerance": 0.2,
        "loads": [
            {"normal_load": 20.0, "steps": "auto"},
            {"tangential_load_x": 1.5, "steps": 1},
            {"shift_x": -2e-7, "steps": "auto"},
            {"tangential_load_x": 0.5, "steps": "auto"},
        ],
    },
    "chosen fields": {"fields": ["pressure", "displacement_1_z"], "every": 3},
}


def made(**keys: Any) -> Case:
    """Return a stiff sphere on aluminium, about 5 spacings in the contact radius."""
    given = {"nodes_in_radius": 5, "friction_coefficient": 0.2, "loads": PRESS_AND_SHEAR, "title": "A sphere"}
    return Case(body_1=SPHERE, body_2=ALUMINIUM, **{**given, **keys})


class Stop(Exception):
    """What ends a run on purpose."""


def stopped(case: Case, out: Path, after: int, **options: Any) -> None:
    """Run a case up to the end of step `after`."""

    def on_step(step: Step) -> None:
        if step.number == after:
            raise Stop

    with pytest.raises(Stop):
        case.run(out, on_step=on_step, **options)
    assert len(Journal(journal_of(out))) == after


def same(one: Path, other: Path, but: tuple[str, ...] = ("run", "created", "history")) -> None:
    """Two files agree in every bit of every variable, and in all attributes but `but`."""
    with (
        xarray.open_dataset(one, mask_and_scale=False) as a,
        xarray.open_dataset(other, mask_and_scale=False) as b,
    ):
        assert list(a.variables) == list(b.variables)
        for name in set(a.variables) - {"seconds"}:
            assert a[name].shape == b[name].shape, name
            if a[name].dtype.kind in "OUS":
                assert a[name].values.tolist() == b[name].values.tolist(), name
            else:
                assert a[name].values.tobytes() == b[name].values.tobytes(), name
            assert str(a[name].attrs) == str(b[name].attrs)
        for name in (a.attrs.keys() | b.attrs.keys()) - set(but):
            assert str(a.attrs[name]) == str(b.attrs[name]), name


def grows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin on windows that the contact soon outgrows."""
    original = Case._size

    def small(self: Case, *arguments: Any) -> Any:
        lattice = original(self, *arguments)
        return dataclasses.replace(lattice, row_first=-4, col_first=-4, n_row=9, n_col=9)

    monkeypatch.setattr(Case, "_size", small)


# --- to the bit -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_that_went_on_is_to_the_bit_one_in_one_go(tmp_path: Path, kind: str) -> None:
    case = made(**KINDS[kind])
    count = len(case.run(tmp_path / "whole.nc"))
    for after in range(1, count + 1):
        out = tmp_path / f"cut{after}.nc"
        stopped(case, out, after)
        seen: list[int] = []
        result = hexcontact.resume(out, on_step=lambda step: seen.append(step.number))  # noqa: B023
        assert seen == list(range(after + 1, count + 1))
        assert result.complete
        same(out, tmp_path / "whole.nc")
        assert not journal_of(out).exists()
        started, resumed = str(result.dataset.attrs["history"]).splitlines()
        assert "started by hexcontact" in started
        assert f"resumed after step {after} by hexcontact {hexcontact.__version__}" in resumed


@pytest.mark.parametrize(("friction", "steps"), [(None, 5), (0.2, 5), (0.2, "auto")])
def test_windows_that_grew_are_as_large_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, friction: float | None, steps: int | str
) -> None:
    grows(monkeypatch)
    loads: list[dict[str, Any]] = [{"normal_load": 60.0, "steps": steps}]
    if friction:
        loads.append({"tangential_load_x": 4.0, "steps": 2})
    if steps == "auto":  # the first attempt of a segment goes to its end
        loads.insert(0, {"normal_load": 5.0, "steps": "auto"})
    case = made(friction_coefficient=friction, loads=loads, step_tolerance=0.2)
    result = case.run(tmp_path / "whole.nc")
    assert result.lattice.size > 200  # has grown from 9 x 9
    for after in (1, 2, 4):
        stopped(case, tmp_path / f"{after}.nc", after)
        sizes = {step.lattice.size for step in Journal(journal_of(tmp_path / f"{after}.nc"))}
        hexcontact.resume(tmp_path / f"{after}.nc")
        same(tmp_path / f"{after}.nc", tmp_path / "whole.nc")
    assert len(sizes) > 1


def test_a_run_may_be_stopped_many_times(tmp_path: Path) -> None:
    case, out = made(loads=MIXED), tmp_path / "out.nc"
    case.run(tmp_path / "whole.nc")
    stopped(case, out, 1)

    def leave(step: Step) -> None:
        raise Stop

    for _ in range(9):
        with pytest.raises(Stop):
            hexcontact.resume(out, on_step=leave)
    result = hexcontact.resume(out)
    same(out, tmp_path / "whole.nc")
    assert len(str(result.dataset.attrs["history"]).splitlines()) == 11


def test_the_deck_with_what_the_command_line_changed_is_gone_on_with(tmp_path: Path) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    case = Case.from_toml(tmp_path / "sphere.toml", {"friction.coefficient": 0.3, "load.1.steps": 3})
    case.run(tmp_path / "whole.nc")
    stopped(case, tmp_path / "cut.nc", 2)
    (tmp_path / "sphere.toml").unlink()
    hexcontact.resume(tmp_path / "cut.nc")
    same(tmp_path / "cut.nc", tmp_path / "whole.nc")


def test_a_gap_given_in_python_is_given_again(tmp_path: Path) -> None:
    def case(curvature: float = 1.0) -> Case:
        return Case(
            body_1={key: value for key, value in SPHERE.items() if key != "surface"},
            body_2=ALUMINIUM,
            gap=lambda x, y: curvature * (x**2 + y**2) / 2e-3,
            nodes_in_radius=5,
            friction_coefficient=0.2,
            loads=PRESS_AND_SHEAR,
        )

    out = tmp_path / "cut.nc"
    case().run(tmp_path / "whole.nc")
    stopped(case(), out, 2)
    with pytest.raises(DeckError, match=r"in Python; resume there: hexcontact\.resume\(.*, case=case\)"):
        hexcontact.resume(out)
    with pytest.raises(DeckError, match="decks differ"):
        hexcontact.resume(out, case=made())
    with pytest.raises(DeckError, match=r"another lattice|surfaces are no longer those"):
        hexcontact.resume(out, case=case(1.001))
    hexcontact.resume(out, case=case())
    same(out, tmp_path / "whole.nc")


def test_further_steps_may_be_solved_otherwise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out.nc"
    original = contact.NormalContact.solve

    def solve(self: contact.NormalContact, **arguments: Any) -> contact.NormalSolution:
        missed = arguments.get("normal_load") == 20.0 and arguments["tolerance"] < 1e-7
        return dataclasses.replace(original(self, **arguments), converged=not missed)

    monkeypatch.setattr(contact.NormalContact, "solve", solve)
    with pytest.raises(ConvergenceError) as caught:
        made(**KINDS["frictionless"]).run(out)
    assert re.search(
        r"2 of 3 load steps .* to resume: hexcontact resume \S*out\.nc$", caught.value.__notes__[0]
    )
    with pytest.raises(ConvergenceError, match="step 3 of 3 did not converge"):
        hexcontact.resume(out)
    for key in ("friction.coefficient", "solver.coupling", "solver", "load.1.steps"):
        with pytest.raises(DeckError, match=rf"{key}: a resumed run may only change how it is solved"):
            hexcontact.resume(out, overrides={key: 1})
    assert "did not converge" in open_result(out).dataset.attrs["stopped"]

    def goes_on(step: Step) -> None:
        assert "stopped" not in open_result(out).dataset.attrs

    result = hexcontact.resume(out, overrides={"solver.tolerance": 1e-6}, on_step=goes_on)
    assert "resumed after step 2" in result.dataset.attrs["history"]
    assert "tolerance = 1e-06 instead of 1e-08" in result.dataset.attrs["history"]
    assert result.dataset.attrs["tolerance"] == 1e-6
    assert Case.from_text(result.deck).solver.tolerance == 1e-6


# --- what cannot go on ------------------------------------------------------------------------------


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_finished_run_is_returned(tmp_path: Path) -> None:
    made().run(tmp_path / "out.nc")
    before = content(tmp_path)
    assert hexcontact.resume(tmp_path / "out.nc").complete
    assert content(tmp_path) == before


def test_a_journal_that_was_half_cleared_away_is_cleared(tmp_path: Path) -> None:
    out = tmp_path / "out.nc"
    stopped(made(), out, 4)
    kept = content(tmp_path)
    hexcontact.resume(out)
    journal_of(out).mkdir()
    for name in ("000001.npz", "000002.npz", "header.json"):
        (journal_of(out) / name).write_bytes(kept[f"out.nc.d/{name}"])
    assert len(hexcontact.resume(out)) == 4
    assert [p.name for p in tmp_path.iterdir()] == ["out.nc"]


def test_what_cannot_go_on_says_why(tmp_path: Path) -> None:
    out, journal = tmp_path / "out.nc", journal_of(tmp_path / "out.nc")
    with pytest.raises(DeckError, match=r"neither a file .*out\.nc nor a journal .*out\.nc\.d"):
        hexcontact.resume(out)
    journal.mkdir()
    with pytest.raises(
        DeckError, match=r"no load step of .*out\.nc was finished, so it has to be run from the"
    ):
        hexcontact.resume(out)
    with pytest.raises(DeckError, match="is a folder"):
        hexcontact.resume(tmp_path)
    out.write_text("a thesis")
    with pytest.raises(DeckError, match="is damaged or not a netCDF file"):
        hexcontact.resume(out)
    out.unlink()
    stopped(made(), out, 3)
    (journal / "000002.npz").rename(tmp_path / "kept")
    with pytest.raises(DeckError, match=r"lacks the record of step 2"):
        hexcontact.resume(out)
    (journal / "000002.npz").write_bytes((tmp_path / "kept").read_bytes()[:-50])
    with pytest.raises(DeckError, match=r"000002\.npz is damaged") as caught:
        hexcontact.resume(out)
    assert "without it and those after it" in caught.value.__notes__[0]
    for name in ("000002.npz", "000003.npz"):
        (journal / name).unlink()
    assert hexcontact.resume(journal).complete


def test_an_interim_output_alone_is_not_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "PUBLISH_INTERVAL", 0.0)
    out = tmp_path / "out.nc"
    made().run(tmp_path / "whole.nc")
    stopped(made(), out, 3)
    assert len(xarray.open_dataset(out)["step"]) == 2
    moved = journal_of(out).rename(tmp_path / "away")
    with pytest.raises(
        DeckError, match=r"out\.nc has 2 of 4 load steps, but its journal .*out\.nc\.d is not"
    ):
        hexcontact.resume(out)
    moved.rename(journal_of(out))
    hexcontact.resume(out)
    same(out, tmp_path / "whole.nc")


def test_the_old_output_stays_until_the_resumed_run_is_finished(tmp_path: Path) -> None:
    out = tmp_path / "out.nc"
    made(title="old").run(out)
    before = out.read_bytes()
    stopped(made(title="new"), out, 2, overwrite=True)

    def unchanged(step: Step) -> None:
        assert out.read_bytes() == before

    assert hexcontact.resume(out, on_step=unchanged).case_title == "new"


def test_a_file_that_came_later_is_not_replaced(tmp_path: Path) -> None:
    out = tmp_path / "out.nc"
    stopped(made(), out, 2)
    out.write_text("a thesis")
    with pytest.raises(DeckError, match=r"out\.nc is not of the run that left its steps .*; move it away"):
        hexcontact.resume(out)
    assert out.read_text() == "a thesis"
    out.unlink()
    assert hexcontact.resume(out).complete


def test_another_version_is_warned_of(tmp_path: Path) -> None:
    out = tmp_path / "out.nc"
    stopped(made(), out, 2)
    metadata = dataclasses.replace(Journal(journal_of(out)).metadata, version="0.1.9")
    write_header(journal_of(out), Header(metadata))
    with pytest.warns(UserWarning, match=r"started by hexcontact 0\.1\.9 and is resumed by"):
        result = hexcontact.resume(out)
    assert "started by hexcontact 0.1.9" in result.dataset.attrs["history"]


def test_surfaces_that_changed_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "out.nc"
    stopped(made(), out, 2)
    before = content(tmp_path)

    for record in Journal(journal_of(out)).records:
        about, step = read_record(record)
        fields = {**step.fields, "initial_gap": step.initial_gap * (1 + 1e-6)}
        write_record(record, about["run"], dataclasses.replace(step, fields=fields))
    with pytest.raises(DeckError, match="the surfaces are no longer those of the 2 finished steps"):
        hexcontact.resume(out)
    assert content(tmp_path).keys() == before.keys()


def test_a_run_that_goes_on_elsewhere_is_left_alone(tmp_path: Path) -> None:
    out = tmp_path / "out.nc"
    stopped(made(), out, 2)

    def meddle(step: Step) -> None:
        with pytest.raises(DeckError, match=rf"is being written by another run, process {os.getpid()} on"):
            hexcontact.resume(out)
        with pytest.raises(DeckError, match="is being written by another run"):
            made().run(out, overwrite=True)

    assert hexcontact.resume(out, on_step=meddle).complete


def test_a_requeued_job_resumes_on_another_node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lock of a node that has failed is that of an attempt that is over."""
    out = tmp_path / "out.nc"
    stopped(made(), out, 2)
    holder = {"process": 1, "host": "node7", "job": ["alpha", "12", None]}
    (journal_of(out) / "lock").write_text(json.dumps(holder))
    monkeypatch.setenv("SLURM_JOB_ID", "12")
    monkeypatch.setenv("SLURM_CLUSTER_NAME", "alpha")
    with pytest.raises(DeckError, match="is being written by another run, process 1 on node7"):
        resume(out)  # another task of the same attempt
    monkeypatch.setenv("SLURM_RESTART_COUNT", "1")
    monkeypatch.setenv("SLURM_CLUSTER_NAME", "beta")
    with pytest.raises(DeckError, match="is being written by another run"):
        resume(out)  # a job of the same number
    monkeypatch.setenv("SLURM_CLUSTER_NAME", "alpha")
    assert len(resume(out)) == 4


def test_a_process_number_that_was_given_again_holds_no_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without locks in the file system, after a reboot the number may be that of another process."""

    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    out = tmp_path / "out.nc"
    stopped(made(), out, 2)
    monkeypatch.setattr("hexcontact.files.fcntl.flock", unsupported)
    holder = {"process": os.getpid(), "host": os.uname().nodename, "since": "2026-01-01 00:00:00"}
    (journal_of(out) / "lock").write_text(json.dumps({**holder, "time": 2e9}))
    with pytest.raises(DeckError, match="is being written by another run"):
        hexcontact.resume(out)
    (journal_of(out) / "lock").write_text(json.dumps({**holder, "time": 1e9}))
    assert hexcontact.resume(out).complete


@pytest.mark.parametrize("kind", ["device", "pipe"])
def test_what_is_no_file_is_not_replaced(tmp_path: Path, kind: str) -> None:
    target = Path(os.devnull)
    if kind == "pipe":
        target = tmp_path / "pipe"
        os.mkfifo(target)
        os.write(os.open(target, os.O_RDWR), b"CDF\x01" * 9)  # so that nobody waits who reads from it
    mode = target.stat().st_mode
    with pytest.raises(DeckError, match=f"{target} is not a regular file; choose another output"):
        Store(target, Metadata(), overwrite=True)
    with pytest.raises(DeckError, match="is not a regular file"):
        hexcontact.resume(target)
    assert target.stat().st_mode == mode
    assert not journal_of(target).exists()


# --- a full disk ------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_after_a_full_disk_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def fill(step: Step) -> None:
        if step.number == 2:
            monkeypatch.setattr(f"hexcontact.result.store.os.{call}", full)

    case, out = made(), tmp_path / "out.nc"
    case.run(tmp_path / "whole.nc")
    with pytest.raises(ResourceError, match=r"cannot write step 3 of .*out\.nc: No space left on device"):
        case.run(out, on_step=fill)
    with pytest.raises(ResourceError, match=r"cannot write step 3 of .*out\.nc: No space left on device"):
        hexcontact.resume(out)
    monkeypatch.undo()
    assert len(open_result(out)) == 2
    hexcontact.resume(out)
    same(out, tmp_path / "whole.nc")


# --- killed -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "words"), [(7, []), (3, ["wear"])])
def test_runs_killed_at_random_moments_go_on(tmp_path: Path, seed: int, words: list[str]) -> None:
    """4 runs, each killed up to three times, at random times or at random writes to the disk.

    Each of some 16 processes has a minute, however busy the machine is; all together have half an hour.
    """
    command = [
        sys.executable,
        str(Path(__file__).with_name("killed_runs.py")),
        str(tmp_path),
        "4",
        str(seed),
        *words,
    ]
    environ = ENVIRONMENT | {"OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environ, timeout=1800)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    *runs, kills = done.stdout.splitlines()
    assert len(runs) == 4
    assert int(kills.removeprefix("kills ")) > 1  # about 6, fewer on a busy machine
    for number in range(4):
        same(tmp_path / f"{number}.nc", tmp_path / "whole.nc")
        assert not journal_of(tmp_path / f"{number}.nc").exists()


# --- the command ------------------------------------------------------------------------------------

DECK = (
    commands.DECK.replace("radius = 4", "radius = 5")
    + """
label = "press"
[[load]]
tangential_load_x = "1 N"
steps = 2
"""
)


def hexcontact_(folder: Path, *arguments: str, limit: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the command, with files of `limit` kilobytes at most in a process of its own."""
    if not limit:
        return commands.inside(folder, *arguments)
    command = ["bash", "-c", f'ulimit -f {limit}; exec "$@"', "bash"]
    command += [sys.executable, "-m", "hexcontact", *arguments]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=commands.PATIENCE, env=ENVIRONMENT
    )


# The command, whose solver waits after some steps until a signal has closed the store.
WAITING = """
import threading
from hexcontact.cli import app
from hexcontact.result.store import Store

append, close, closed = Store.append, Store.close, threading.Event()
def waiting(store, *arguments, **options):
    if len(store.heads) >= 5:
        closed.wait()
    return append(store, *arguments, **options)
def closing(store, *arguments, **options):
    close(store, *arguments, **options)
    closed.set()
Store.append, Store.close = waiting, closing
app.main()
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output of 60 load steps in one go."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "a sphere.toml").write_text(DECK.replace("steps = 2", "steps = 30"))
    done = hexcontact_(folder, "run", "a sphere.toml", "-q", "-o", "whole.nc")
    assert (done.returncode, done.stderr) == (0, "")
    return folder / "whole.nc"


@pytest.mark.parametrize(
    ("sent", "code"), [(signal.SIGINT, 130), (signal.SIGUSR1, 138), (signal.SIGTERM, 143)]
)
def test_a_signal_ends_the_run_and_resume_goes_on(
    tmp_path: Path, whole: Path, sent: signal.Signals, code: int
) -> None:
    (tmp_path / "a sphere.toml").write_text(DECK.replace("steps = 2", "steps = 30"))
    command = [sys.executable, "-c", WAITING, "run", "a sphere.toml"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as process:
        assert process.stderr
        assert any(re.match("step +3/", line) for line in process.stderr)  # after title and doubts
        process.send_signal(sent)
        told = process.stderr.read()
    assert process.returncode == code
    assert "Traceback" not in told
    match = re.search(
        r"interrupted; (\d+) of 60 load steps are finished and recorded in .*a sphere\.nc\.d; "
        r"to resume: hexcontact resume '.*a sphere\.nc'\n$",
        told,
    )
    assert match, told
    assert int(match[1]) >= 3
    done = hexcontact_(tmp_path, "resume", "a sphere.nc")
    assert done.returncode == 0
    assert f"A sphere, after step {match[1]}: 60 load steps" in done.stderr
    assert f"step {int(match[1]) + 1:>2}/60" in done.stderr
    assert f"step {match[1]:>2}/60" not in done.stderr
    assert re.search(r"^written: a sphere\.nc$", done.stdout, re.MULTILINE)  # as the file was named
    assert done.stdout.count("press") >= 5  # the table has the steps from before, too
    same(tmp_path / "a sphere.nc", whole)
    again = hexcontact_(tmp_path, "resume", "a sphere.nc", "--plot")
    assert (again.returncode, again.stderr) == (0, "")
    assert "a sphere.nc is finished and has all its load steps; written: " in again.stdout
    assert (tmp_path / "a sphere.png").exists()


def test_a_run_resumes_where_there_is_something_to_resume(tmp_path: Path) -> None:
    """One command starts a run, continues it and leaves it finished; a job is requeued with it."""
    (tmp_path / "deck.toml").write_text(commands.DECK)
    words = ("run", "deck.toml", "--output", "out.nc", "--resume")

    stopped(Case.from_toml(tmp_path / "deck.toml"), tmp_path / "out.nc", 1)
    (tmp_path / "other.toml").write_text(commands.DECK.replace("20 N", "21 N"))
    other = commands.inside(tmp_path, "run", "other.toml", *words[2:])
    assert other.returncode == 2 and "their decks differ" in other.stderr
    assert commands.inside(tmp_path, *words).returncode == 0
    [line] = xarray.open_dataset(tmp_path / "out.nc").attrs["history"].splitlines()[1:]
    assert "resumed after step 1" in line
    whole_run = commands.inside(tmp_path, *words[:3], "whole.nc", "--resume")
    assert whole_run.returncode == 0
    same(tmp_path / "out.nc", tmp_path / "whole.nc")

    before = content(tmp_path)
    again = commands.inside(tmp_path, *words)
    assert again.returncode == 0 and "has all its load steps" in again.stdout
    other = commands.inside(tmp_path, "run", "other.toml", *words[2:])
    assert other.returncode == 2 and "their decks differ" in other.stderr
    assert content(tmp_path) == before
    both = commands.inside(tmp_path, *words, "--overwrite")
    assert both.returncode == 2 and "--resume: expected no --overwrite with it" in both.stderr


def test_resume_is_refused_in_a_sentence(tmp_path: Path) -> None:
    done = hexcontact_(tmp_path, "resume", "out.nc")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "hexcontact: there is neither a file out.nc nor a journal out.nc.d of a run\n"


def test_files_that_may_not_grow_stop_a_run_that_can_go_on(tmp_path: Path) -> None:
    """A limit on the size of files makes the real libraries fail as on a full disk."""
    (tmp_path / "sphere.toml").write_text(DECK)
    assert hexcontact_(tmp_path, "run", "sphere.toml", "-q", "-o", "whole.nc").returncode == 0
    failed = hexcontact_(tmp_path, "run", "sphere.toml", "-q", limit=RECORD_KB)
    assert failed.returncode == 4, failed.stderr
    assert re.search(r"cannot write the output of .*sphere\.nc: ", failed.stderr)
    assert re.search(
        r"4 of 4 load steps are finished and recorded in .*; to resume: hexcontact resume", failed.stderr
    )
    assert len(open_result(tmp_path / "sphere.nc")) == 4
    assert hexcontact_(tmp_path, "resume", "sphere.nc", "-q", limit=RECORD_KB).returncode == 4
    assert hexcontact_(tmp_path, "resume", "sphere.nc", "-q").returncode == 0
    same(tmp_path / "sphere.nc", tmp_path / "whole.nc")


# --- tables below the surface -------------------------------------------------------------------------------

TABLES = """
[[stress]]
name = "axis"
line = [["0 mm", "0 mm", "0 mm"], ["0 mm", "0 mm", "1 mm"]]
count = [3]
[[stress]]
name = "fine"
line = [["0 mm", "0 mm", "1 um"], ["0.1 mm", "0 mm", "1 mm"]]
count = [20000]
"""
FINE: dict[str, Any] = {"line": [[0.0, 0.0, 1e-6], [1e-4, 0.0, 1e-3]], "count": 20000, "step": [4]}


def in_tables(folder: Path, *words: str) -> subprocess.Popen[str]:
    """Start a run and return it while the second table is computed."""
    command = [sys.executable, "-m", "hexcontact", *words]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT)
    while not (folder / "out_axis.nc").exists() and process.poll() is None:
        time.sleep(0.01)
    time.sleep(0.2)
    assert process.poll() is None
    assert (folder / "out.nc").exists()
    return process


@pytest.mark.parametrize(
    ("sent", "code"),
    [(signal.SIGINT, 130), (signal.SIGUSR1, 138), (signal.SIGTERM, 143), (signal.SIGKILL, -9)],
)
def test_tables_of_a_run_that_was_ended_are_filled_in(
    tmp_path: Path, sent: signal.Signals, code: int
) -> None:
    (tmp_path / "deck.toml").write_text(DECK + TABLES)
    with in_tables(tmp_path, "run", "deck.toml", "-q", "-o", "out.nc") as process:
        process.send_signal(sent)
        assert process.stderr
        told = process.stderr.read()
    assert process.returncode == code
    if code > 0:
        kept = "all load steps are in out.nc; to compute the table fine: hexcontact resume out.nc"
        assert told == f"hexcontact: interrupted; {kept}\n"
        (tmp_path / "out_axis.nc").unlink()
        with in_tables(tmp_path, "resume", "out.nc", "-q") as process:  # ends there, too
            process.send_signal(sent)
        assert process.returncode == code
    assert {path.name for path in tmp_path.iterdir()} == {"deck.toml", "out.nc", "out_axis.nc"}
    if code < 0:
        written = (tmp_path / "out_axis.nc").stat().st_mtime_ns
        assert hexcontact_(tmp_path, "resume", "out.nc", "-q").returncode == 0
        assert (tmp_path / "out_axis.nc").stat().st_mtime_ns == written
        with xarray.open_dataset(tmp_path / "out_fine.nc") as found:
            assert found.identical(open_result(tmp_path / "out.nc").stress(**FINE).assign_attrs(found.attrs))


def test_tables_of_an_older_run_are_replaced_after_a_kill(tmp_path: Path) -> None:
    """Of the same name, and left beside an output that --overwrite has replaced."""
    table = TABLES.partition('[[stress]]\nname = "fine')[0]
    (tmp_path / "deck.toml").write_text(DECK + table)
    assert hexcontact_(tmp_path, "run", "deck.toml", "-q", "-o", "out.nc").returncode == 0
    older = (tmp_path / "out_axis.nc").read_bytes()
    assert hexcontact_(tmp_path, "run", "deck.toml", "-q", "-o", "out.nc", "--overwrite").returncode == 0
    (tmp_path / "out_axis.nc").write_bytes(older)
    resume(tmp_path / "out.nc")
    with xarray.open_dataset(tmp_path / "out_axis.nc") as found:
        assert found.attrs["stress_of"] == open_result(tmp_path / "out.nc").dataset.attrs["run"]


def test_missing_tables_are_those_of_the_finished_run(tmp_path: Path) -> None:
    """The case that resumes it need not ask for them."""
    table = TABLES.partition('[[stress]]\nname = "fine')[0]
    out = tmp_path / "out.nc"
    Case.from_text(DECK + table).run(out).close()
    (tmp_path / "out_axis.nc").unlink()
    resume(out, case=Case.from_text(DECK)).close()
    assert (tmp_path / "out_axis.nc").exists()
