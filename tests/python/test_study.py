"""Studies: cases planned and checked, run in processes, on Dask, as a job array; failures, interruptions."""

import contextlib
import importlib
import json
import os
import pkgutil
import pty
import re
import shutil
import signal
import subprocess
import sys
import types
from concurrent.futures import Future
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import psutil
import pytest
import xarray
from commands import ENVIRONMENT, PATIENCE, wait_for
from numpy.testing import assert_allclose, assert_array_equal
from typer.testing import CliRunner

import hexcontact
from hexcontact import Case, DeckError
from hexcontact.cli.app import app
from hexcontact.deck.kinds import Whole
from hexcontact.deck.table_base import extended, meaning
from hexcontact.deck.toml import starter, with_overrides
from hexcontact.plotting.history import study as draw_study
from hexcontact.problem.problem import Problem
from hexcontact.result.store import Store
from hexcontact.solve.events import Callback, Listener
from hexcontact.solve.run import metadata_of, solve_into
from hexcontact.study import backend as backend_registry
from hexcontact.study import backends
from hexcontact.study import study as study_module
from hexcontact.study.backend import BACKENDS, KEYS, Backend, Job, solve_case
from hexcontact.study.backends.processes import LocalPool
from hexcontact.study.plan import StudyFile
from hexcontact.study.study import Study, run_study

CASES = Path(__file__).parents[2] / "cases"

DECK = """
title = "A sphere"
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "70 GPa"
poisson_ratio = 0.33
[grid]
nodes_in_radius = 8
[[load]]
normal_load = "100 N"
steps = 2
[output]
file = "elsewhere.nc"
"""
SHEARED = DECK.replace("[grid]", "[friction]\ncoefficient = 0.3\n[grid]") + (
    '[[load]]\ntangential_load_x = "10 N"\nsteps = 2\n'
)
# A long case: a step takes some milliseconds, so that there is time to end it in the middle.
LONG = DECK.replace("nodes_in_radius = 8", "nodes_in_radius = 40").replace("steps = 2", "steps = 400")

STUDY = """
deck = "deck.toml"
[[parameter]]
key = "load.1.normal_load"
values = ["50 N", "0.1 kN"]
[[parameter]]
key = "body.1.surface.radius"
name = "radius"
range = ["5 mm", "0.02"]
count = 3
scale = "log"
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with a deck and a study in it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setenv("PYTHONPATH", ENVIRONMENT["PYTHONPATH"])
    (tmp_path / "deck.toml").write_text(DECK)
    (tmp_path / "study.toml").write_text(STUDY.replace('"0.02"', "0.02"))
    return tmp_path


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command in this process; what it runs is in processes of its own."""
    result = CliRunner().invoke(app, ["study", *arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return subprocess.CompletedProcess(arguments, result.exit_code, result.stdout, result.stderr)


def at_once(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Solve cases in this process, which is quicker; return the list of those that were solved."""
    solved: list[str] = []

    def outcomes(pool: Any, jobs: Any, cancel: Any) -> Any:
        for job in jobs:
            solved.append(job.hash)
            yield solve_case(job)

    monkeypatch.setattr(study_module, "outcomes", outcomes)
    return solved


# --- plans --------------------------------------------------------------------------------------------------


def test_one_key_of_a_deck_is_replaced_in_a_copy() -> None:
    deck = {"load": [{"steps": 1}, {"steps": 2}], "grid": {"spacing": 1.0}}
    changed = with_overrides(deck, {"load.2.steps": 5})
    assert changed == {"load": [{"steps": 1}, {"steps": 5}], "grid": {"spacing": 1.0}}
    assert deck["load"][1] == {"steps": 2}  # type: ignore[index]
    assert with_overrides(deck, {"friction.coefficient": 0.1})["friction"] == {"coefficient": 0.1}
    for path in ("load.3.steps", "load.0.steps", "grid.spacing.x"):
        with pytest.raises(DeckError, match=re.escape(path)):
            with_overrides(deck, {path: 1})


def test_grid_has_every_value_with_every_other_in_si(folder: Path) -> None:
    study = Study.from_toml("study.toml")
    force, radius = study.plan.axes
    assert (force.name, force.units, radius.name, radius.units) == ("load_1_normal_load", "N", "radius", "m")
    assert [force.coordinate(value) for value in force.values] == [50.0, 100.0]
    assert_allclose([radius.coordinate(value) for value in radius.values], [5e-3, 10e-3, 20e-3], rtol=1e-15)
    assert len(study) == 6
    last = Case.from_text(study.cases[4].deck)
    assert_allclose(last.body_1.surface.radius, 10e-3, rtol=1e-15)  # type: ignore[union-attr]
    assert "elsewhere" not in study.cases[0].deck
    assert len({case.hash for case in study.cases}) == 6


def test_zip_takes_values_side_by_side(folder: Path) -> None:
    values = {"load.1.normal_load": [10.0, 20.0], "solver.method": ["fft", "direct"]}
    study = Study("deck.toml", values, combine="zip")
    assert [dict(case.settings) for case in study.cases] == [
        {"load.1.normal_load": 10.0, "solver.method": "fft"},
        {"load.1.normal_load": 20.0, "solver.method": "direct"},
    ]


def test_latin_hypercube_is_one_and_the_same_for_a_seed(folder: Path) -> None:
    parameters = {
        "load.1.normal_load": {"range": ["1 N", "100 N"], "scale": "log"},
        "load.1.steps": {"range": [1, 9]},
        "body.2.poisson_ratio": {"values": [0.2, 0.3]},
    }
    first, again, other = (
        Study("deck.toml", parameters, combine="lhs", samples=20, seed=seed).cases for seed in (7, 7, 8)
    )
    assert [case.hash for case in first] == [case.hash for case in again]
    assert [case.hash for case in first] != [case.hash for case in other]
    loads = np.array([case.settings["load.1.normal_load"] for case in first])
    strata = np.floor(np.log10(loads) / 2 * 20).astype(int)  # one in each twentieth of the range
    assert_array_equal(np.sort(strata), np.arange(20))
    assert {type(case.settings["load.1.steps"]) for case in first} == {int}
    assert sorted(case.settings["body.2.poisson_ratio"] for case in first) == [0.2] * 10 + [0.3] * 10


WRONG = [
    (
        "values",
        {"load.1.normal_load": ["50 N", "-1 N"]},
        r'study: parameter load\.1\.normal_load = "-1 N": expected',
    ),
    ("unit", {"load.1.normal_load": ["50 mm"]}, r'parameter load\.1\.normal_load = "50 mm": .*a length'),
    (
        "key",
        {"load.1.normal_lod": [1.0]},
        r"parameter load\.1\.normal_lod: unknown key; did you mean normal_load",
    ),
    ("entry", {"load.3.steps": [1]}, r"parameter load\.3\.steps: expected an entry from 1 to 1"),
    ("file", {"output.file": ["a.nc"]}, r"parameter output\.file: a study names the files"),
    (
        "range",
        {"load.1.normal_load": {"range": ["1 N", "x"], "count": 2}},
        r'load\.1\.normal_load = "x": expected',
    ),
    ("count", {"load.1.normal_load": {"range": [1, 2]}}, r"parameter\.1\.count: missing"),
    (
        "log",
        {"body.1.poisson_ratio": {"range": [0.1, -0.2], "count": 2, "scale": "log"}},
        r"ratio = \[0.1, -0.2\]: a logarithmic scale needs bounds above 0",
    ),
    ("word", {"solver.method": {"range": ["fft", "direct"], "count": 2}}, "needs a key that is a number"),
    (
        "shares",
        {"load.1.tangential_load_x": {"range": ["0.2 mu P", "0.8 mu P"], "count": 2}},
        "expected values instead",
    ),
    ("twice", {"load.1.normal_load": ["1 N", 1.0]}, "has the value 1.0 twice"),
    ("empty", {"": [1]}, "expected a dotted key of the deck"),
    (
        "needs friction",
        {"load.1.shift_x": [1e-6]},
        r"parameter load\.1\.shift_x = 1e-06: expected 0, or a \[friction\] table",
    ),
]


@pytest.mark.parametrize(("parameters", "pattern"), [row[1:] for row in WRONG], ids=[row[0] for row in WRONG])
def test_wrong_parameters_are_named_before_anything_runs(folder: Path, parameters: Any, pattern: str) -> None:
    with pytest.raises(DeckError, match=pattern):
        Study("deck.toml", parameters)
    assert sorted(path.name for path in folder.iterdir()) == ["deck.toml", "study.toml"]


def test_one_invalid_case_stops_the_study_with_one_sentence(folder: Path) -> None:
    (folder / "deck.toml").write_text(SHEARED)
    (folder / "study.toml").write_text(
        'deck = "deck.toml"\n'
        '[[parameter]]\nkey = "friction.coefficient"\nvalues = [0.3, 0.05]\n'  # 0.05 does not hold 10 N
        '[[parameter]]\nkey = "body.1.poisson_ratio"\nvalues = [0.2, 0.3, 0.7]\n'
    )
    done = command("study.toml")
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert len(lines) == 2
    assert "study.toml: parameter body.1.poisson_ratio = 0.7: expected a number" in lines[0]
    assert "load.2.tangential_load_x" in lines[1]
    assert "(in case 4: friction.coefficient = 0.05, body.1.poisson_ratio = 0.2)" in lines[1]
    assert not (folder / "study").exists()


def test_a_fault_of_several_segments_is_one_sentence(folder: Path) -> None:
    Path("deck.toml").write_text(starter("fretting"))  # a path of three segments with a tangential load
    values = {"friction.coefficient": [0.3, 0.0], "body.1.poisson_ratio": [0.2, 0.3]}
    with pytest.raises(DeckError) as refused:
        Study("deck.toml", values)
    [line] = str(refused.value).splitlines()
    assert 'path.1.tangential_load_x = "24 N": expected 0, or a [friction] table' in line
    assert "(likewise in 2 more segments) (in case 3: friction.coefficient = 0.0" in line
    invalid = Study("deck.toml", values, skip_invalid=True).invalid
    assert [case.fault for case in invalid] == [line.partition(" (in case")[0]] * 2


@pytest.mark.parametrize(
    ("old", "new", "pattern"),
    [
        ("[[parameter]]", "[[paramter]]", "unknown key; did you mean parameter"),
        ("deck.toml", "dock.toml", "dock.toml: no such file"),
        ("count = 3", "count = 1", r"parameter\.2\.count = 1: expected a whole number of at least 2"),
        ("deck =", 'combine = "zip"\ndeck =', "zip needs as many values of each; they have 2, 3"),
        ("deck =", 'combine = "lhs"\ndeck =', "samples: missing"),
        ('name = "radius"', 'name = "approach"', "the name approach is taken"),
    ],
)
def test_wrong_study_files_are_told_so(folder: Path, old: str, new: str, pattern: str) -> None:
    (folder / "study.toml").write_text((folder / "study.toml").read_text().replace(old, new))
    done = command("study.toml")
    assert done.returncode == 2
    assert re.search(pattern, done.stderr), done.stderr


def test_a_file_or_folder_of_something_else_is_left_alone(folder: Path) -> None:
    (folder / "study").mkdir()
    (folder / "study/notes.txt").write_text("mine")
    assert "holds other things" in command("study.toml").stderr
    (folder / "other.nc").write_text("mine")
    assert "not the result of a study" in command("study.toml", "--output", "other.nc").stderr
    assert (folder / "other.nc").read_text() == "mine"


# --- runs ---------------------------------------------------------------------------------------------------


def test_study_in_processes_gives_what_single_runs_give(folder: Path) -> None:
    done = command("study.toml", "--jobs", "2")
    assert done.returncode == 0, done.stderr
    assert "6/6" in done.stderr
    with xarray.open_dataset("study.nc") as dataset:
        assert dict(dataset.sizes) == {"load_1_normal_load": 2, "radius": 3}
        assert dataset.load_1_normal_load.attrs["units"] == "N"
        assert dataset.load_1_normal_load.attrs["deck_key"] == "load.1.normal_load"
        assert (dataset.status == 0).all()
        assert dataset.status.attrs["flag_meanings"] == "done failed missing invalid"
        alone = Case.from_toml("deck.toml", {"load.1.normal_load": 50.0, "body.1.surface.radius": 0.02}).run()
        there = dataset.sel(load_1_normal_load=50.0, radius=0.02)
        for name in ("approach", "max_pressure", "elastic_energy"):
            assert_allclose(there[name], alone[name][-1], rtol=1e-14)
        # Hertz: approach = (9 P^2/16 E*^2 R)^(1/3); the mesh moves with the contact radius
        hertz = (dataset.load_1_normal_load**2 / dataset.radius) ** (1 / 3)
        ratio = dataset.approach / hertz
        assert_allclose(ratio, float(ratio[0, 0]), rtol=1e-3)


def test_rerun_does_only_what_is_missing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = at_once(monkeypatch)
    first = run_study("study.toml")
    assert first is not None
    assert len(solved) == 6
    solved.clear()
    again = run_study("study.toml")
    assert again is not None
    assert solved == []
    xarray.testing.assert_identical(first, again)
    # one file lost, one damaged, one of another case
    lost, damaged, other = Study.from_toml("study.toml").cases[1:4]
    (folder / "study/0002.nc").unlink()
    (folder / "study/0003.nc").write_bytes(b"\x89HDF but no more")
    shutil.copy("study/0001.nc", "study/0004.nc")
    mended = run_study("study.toml")
    assert solved == [lost.hash, damaged.hash, other.hash]
    assert mended is not None
    assert_array_equal(mended.approach, first.approach)
    # a value more: the others keep their files
    solved.clear()
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text.replace('["50 N"', '["20 N", "50 N"'))
    more = run_study("study.toml")
    assert more is not None
    assert len(solved) == 3
    assert_array_equal(more.case_number, [[7, 8, 9], [1, 2, 3], [4, 5, 6]])
    assert_array_equal(more.approach[1:], first.approach)
    # another deck: all of them again
    solved.clear()
    (folder / "deck.toml").write_text(DECK.replace("70 GPa", "71 GPa"))
    changed = run_study("study.toml")
    assert changed is not None
    assert len(solved) == 9
    assert (changed.approach < more.approach).all()
    # a comment in the deck changes nothing
    solved.clear()
    (folder / "deck.toml").write_text("# stiffer\n" + DECK.replace("70 GPa", "71 GPa"))
    run_study("study.toml")
    assert solved == []


def test_a_case_without_its_tables_gets_them(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As after a kill between the result and the tables: the case itself is not solved again."""
    solved = at_once(monkeypatch)
    (folder / "deck.toml").write_text(DECK + '[[stress]]\nname = "axis"\npoints = [[0, 0, 1e-4]]\n')
    run_study("study.toml")
    assert len(solved) == 6
    written = (folder / "study/0002.nc").stat().st_mtime_ns
    (folder / "study/0002_axis.nc").unlink()
    solved.clear()
    assert run_study("study.toml") is not None
    assert len(solved) == 1
    assert (folder / "study/0002_axis.nc").exists()
    assert (folder / "study/0002.nc").stat().st_mtime_ns == written


FAILING = """
deck = "deck.toml"
combine = "zip"
steps = "all"
[[parameter]]
key = "load.1.approach"
values = ["5 um", "1 um", "6 um"]
[[parameter]]
key = "load.2.steps"
values = [1, 2, 3]
"""


def test_a_case_that_fails_is_kept_and_does_not_stop_the_rest(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # pressed by 1 um the spheres do not hold 10 N, which shows only when it is run
    (folder / "deck.toml").write_text(SHEARED.replace('normal_load = "100 N"', 'approach = "5 um"'))
    (folder / "study.toml").write_text(FAILING)
    done = command("study.toml", "--jobs", "1")
    assert done.returncode == 3
    named = 'case 2 (load.1.approach = "1 um", load.2.steps = 2) failed: '
    assert named in done.stderr
    with xarray.open_dataset("study.nc") as dataset:
        assert_array_equal(dataset.status, [0, 1, 0])
        assert_array_equal(dataset.exit_code, [0, 3, 0])
        assert "slid" in dataset.message[1].item()
        assert dict(dataset.sizes) == {"case": 3, "step": 5}
        loads = dataset.tangential_load_x
        assert_allclose(loads[0], [0, 0, 10, np.nan, np.nan], atol=1e-6)
        assert_allclose(loads[2], [0, 0, 10 / 3, 20 / 3, 10], atol=1e-5)
        assert np.isnan(loads[1]).all()
        assert_allclose(dataset.load_1_approach, [5e-6, 1e-6, 6e-6], rtol=1e-15)
    # it fails for good: it is not tried again unless told to
    solved = at_once(monkeypatch)
    assert command("study.toml").returncode == 3
    assert solved == []
    assert command("study.toml", "--retry").returncode == 3
    assert len(solved) == 1


def test_job_array_runs_case_by_case(folder: Path) -> None:
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text + '[slurm]\ntime = "1:00:00"\ncpus_per_task = 4\n')
    assert command("study.toml", "--case", "2").returncode == 0
    script = command("study.toml", "--slurm").stdout
    assert "#SBATCH --array=1,3-6\n" in script
    assert "#SBATCH --cpus-per-task=4\n" in script
    assert subprocess.run(["sh", "-n"], input=script, text=True).returncode == 0
    last = script.splitlines()[-1]
    assert last.startswith("exec hexcontact study ")
    # the line that a task runs, from another folder
    (folder / "elsewhere").mkdir()
    words = last.replace("exec hexcontact", f"exec {sys.executable} -m hexcontact")
    environment = ENVIRONMENT | {"SLURM_ARRAY_TASK_ID": "3"}
    assert subprocess.run(["sh", "-c", words], env=environment, cwd=folder / "elsewhere").returncode == 0
    assert sorted(path.name for path in (folder / "study").glob("*.nc")) == ["0002.nc", "0003.nc"]
    assert command("study.toml", "--case", "7").returncode == 2
    collected = command("study.toml", "--collect")
    assert collected.returncode == 3
    assert "4 of 6 cases have not been run" in collected.stderr
    with xarray.open_dataset("study.nc") as dataset:
        assert_array_equal(dataset.status, [[2, 0, 0], [2, 2, 2]])


def test_a_task_runs_several_cases(folder: Path) -> None:
    assert command("study.toml", "--case", "2").returncode == 0
    study = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(f"{study}[slurm]\ncases_per_task = 2\n")
    script = command("study.toml", "--slurm").stdout
    assert "# 5 of 6 cases, 2 a task." in script
    assert "#SBATCH --array=1-3\n" in script
    assert "cases_per_task" not in script and "cases-per-task" not in script
    words = script.replace("exec hexcontact", f"exec {sys.executable} -m hexcontact")
    environment = ENVIRONMENT | {"SLURM_ARRAY_TASK_ID": "1"}
    assert subprocess.run(["sh"], input=words, text=True, env=environment, cwd=folder).returncode == 0
    assert sorted(path.name for path in (folder / "study").glob("*.nc")) == ["0001.nc", "0002.nc", "0003.nc"]
    environment["SLURM_ARRAY_TASK_ID"] = "3"
    assert subprocess.run(["sh"], input=words, text=True, env=environment, cwd=folder).returncode == 0
    assert (folder / "study/0006.nc").exists()
    done = command("study.toml", "--case", "3-5", "--json")
    assert [case["case"] for case in json.loads(done.stdout)["cases"]] == [3, 4, 5]


def test_arrays_have_at_most_a_thousand_tasks() -> None:
    array = BACKENDS["slurm"]
    study, out = Path("study.toml"), Path("study.nc")
    for count, tasks, first in ((1000, 1000, "1"), (1001, 501, "1-2"), (25_000, 1000, "1-25")):
        script = array({}, count).script(range(1, count + 1), study, out, False)
        assert f"#SBATCH --array=1-{tasks}\n" in script
        if tasks < count:
            assert f"\nset -- {first} " in script
            assert script.endswith("--case $1")
    late = array({}, 2).script([5, 1001], study, out, False)  # numbers of an edited study
    assert "#SBATCH --array=1-2\n" in late and "\nset -- 5 1001\n" in late
    with pytest.raises(DeckError, match=r"cases_per_task = 2: expected at least 3, since .* 1000 tasks"):
        array({"cases_per_task": 2}, 2500).script(range(1, 2501), study, out, False)


def test_no_text_of_a_study_becomes_a_line_of_its_script(folder: Path) -> None:
    text = (folder / "study.toml").read_text()
    told = 'title = "a\\ntouch PWN\\n# "\n' + text
    options = """[slurm]
comment = "it's mine # and long"
time = 01:30:00
nice = 10
exclusive = true
requeue = false
nodelist = "n[1-3],n7"
mail-type = "END,FAIL"
export = "NONE"
"""
    (folder / "study.toml").write_text(told + options)
    (folder / "study.toml").rename("my study; touch PWN.toml")
    script = command("my study; touch PWN.toml", "--slurm", "--output", "50% $(touch PWN).nc").stdout
    lines = script.splitlines()
    assert [line for line in lines if not line.startswith("#")] == [lines[-2], lines[-1]]
    assert lines[-2].startswith("export OMP_NUM_THREADS=")
    assert "PWN" in lines[-1]
    found = {line.removeprefix("#SBATCH --") for line in lines if line.startswith("#SBATCH --")}
    assert found == {
        "array=1-6",
        'job-name="50% $(touch PWN)"',
        'output="50%% $(touch PWN)/slurm-%A_%a.log"',
        "signal=B:USR1@60",
        'comment="it\'s mine # and long"',
        "time=01:30:00",
        "nice=10",
        "exclusive",
        "nodelist=n[1-3],n7",
        "mail-type=END,FAIL",
        "export=NONE",
    }
    words = lines[-1].replace("exec hexcontact", f"exec {sys.executable} -m hexcontact")
    environment = ENVIRONMENT | {"SLURM_ARRAY_TASK_ID": "3"}
    run = "\n".join([*lines[:-1], words])
    assert subprocess.run(["sh"], input=run, text=True, env=environment).returncode == 0
    assert not Path("PWN").exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (r'time = "1:00:00\ntouch PWN"', "slurm.time = "),
        (r'time = "1:00\rtouch PWN"', "slurm.time = "),
        (r'comment = "a\u2028b"', "slurm.comment = "),
        (r'comment = "a\" --wrap=x"', 'slurm.comment = "a\\" --wrap=x": expected text on one line'),
        (r'"time=1\ntouch PWN" = 1', "expected an option of sbatch"),
        ('"time = 1" = 1', "expected an option of sbatch"),
        ('array = "1-9"', "slurm.array = "),
        ("time = [1, 2]", "slurm.time = [1, 2]: expected text, a number, or true or false"),
        ('comment = ""', "slurm.comment = "),
        ('export = "ALL,LD_PRELOAD=/tmp/x.so"', "expected ALL, NIL or NONE"),
        ('export = "LD_PRELOAD=/tmp/x.so"', "expected ALL, NIL or NONE"),
        ("cases_per_task = 0", "slurm.cases_per_task = 0: expected a whole number of at least 1"),
    ],
)
def test_options_of_a_script_are_checked(folder: Path, options: str, sentence: str) -> None:
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(f"{text}[slurm]\n{options}\n")
    done = command("study.toml", "--slurm")
    assert done.returncode == 2
    assert done.stdout == ""
    assert sentence in done.stderr, done.stderr


def test_a_script_needs_a_name_on_one_line(folder: Path) -> None:
    done = command("study.toml", "--slurm", "--output", "a\ntouch PWN.nc")
    assert done.returncode == 2
    assert "a script needs a name on one line" in done.stderr


def test_a_task_of_a_job_array_heeds_what_slurm_sends(folder: Path) -> None:
    (folder / "deck.toml").write_text(LONG)
    (folder / "study.toml").write_text(
        'deck = "deck.toml"\n[[parameter]]\nkey = "load.1.normal_load"\nvalues = [1, 2]\n'
    )
    assert "#SBATCH --signal=B:USR1@60\n" in command("study.toml", "--slurm").stdout
    words = [sys.executable, "-m", "hexcontact", "study", "study.toml", "--case", "1"]
    process = subprocess.Popen(words, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: len(list(Path().glob("study/0001.nc.d/*.npz"))) > 2)
    process.send_signal(signal.SIGUSR1)
    _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + signal.SIGUSR1
    assert re.search(r"^\S* *1/400 ", told, re.MULTILINE), told
    assert "hexcontact: interrupted; the finished load steps of case 1 are recorded" in told
    assert Case.from_text(LONG, "deck.toml").title == hexcontact.open_result("study/0001.nc").case_title


def worker_of(process: int) -> psutil.Process:
    """Wait for a worker that solves something: a process below that uses the core."""

    def look() -> psutil.Process | None:
        with contextlib.suppress(psutil.Error):
            for child in psutil.Process(process).children(recursive=True):
                if "spawn_main" in " ".join(child.cmdline()) and any(Path().glob("study/*.nc.d/*.npz")):
                    return child
        return None

    worker = wait_for(look)
    assert worker
    return worker


def start() -> subprocess.Popen[str]:
    (Path() / "deck.toml").write_text(LONG)
    (Path() / "study.toml").write_text(
        'deck = "deck.toml"\n[[parameter]]\nkey = "load.1.steps"\nvalues = [2, 400]\n'
    )
    words = [sys.executable, "-m", "hexcontact", "study", "study.toml", "--jobs", "1"]
    return subprocess.Popen(words, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True, start_new_session=True)


def wait_for_the_second(process: int) -> psutil.Process:
    wait_for(lambda: Path("study/0001.nc").exists() and any(Path().glob("study/0002.nc.d/*.npz")))
    return worker_of(process)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_study_that_is_stopped_goes_on_where_it_was(
    folder: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    process = start()
    worker = wait_for_the_second(process.pid)
    for other in (signal.SIGINT, signal.SIGTERM):  # as a terminal or batch system sends to all processes
        worker.send_signal(other)
    with pytest.raises(psutil.TimeoutExpired):
        worker.wait(0.2)
    if number == signal.SIGINT:
        os.killpg(process.pid, number)  # as a terminal does, to the workers too
    else:
        process.send_signal(number)
    _, told = process.communicate(timeout=PATIENCE)
    assert "Traceback" not in told
    if number != signal.SIGKILL:
        assert "leaked" not in told
        assert process.returncode == 128 + number
        assert "interrupted; 1 of 2 cases are finished and recorded in study/" in told
    psutil.wait_procs([worker], timeout=PATIENCE)
    assert not worker.is_running() or worker.status() == psutil.STATUS_ZOMBIE
    assert not Path("study/0002.json").exists()
    assert not Path("study.nc").exists()
    assert not list(Path().glob("*.tmp"))
    # the rest, made short; the first case stays
    first = Path("study/0001.nc").stat().st_mtime_ns
    text = Path("study.toml").read_text()
    Path("study.toml").write_text(text.replace("400", "4"))
    solved = at_once(monkeypatch)
    dataset = run_study("study.toml")
    assert dataset is not None
    assert len(solved) == 1
    assert (dataset.status == 0).all()
    assert Path("study/0001.nc").stat().st_mtime_ns == first


@pytest.mark.parametrize("name", ["0001.nc", "0001.0123abcd.nc"])
def test_a_case_that_was_interrupted_goes_on_after_its_last_step(folder: Path, name: str) -> None:
    whole = solve_case(Job("h", SHEARED, str(folder / "whole.nc")))
    assert whole.exit_code == 0
    case = Case.from_text(SHEARED, "0001.nc")
    with pytest.raises(KeyboardInterrupt), Store(folder / name, metadata_of(case), overwrite=True) as store:
        solve_into(case, store, Callback(stop_after_third))
    again = solve_case(Job("h", SHEARED, str(folder / "0001.nc")), apart=name != "0001.nc")
    assert again.exit_code == 0, again.message
    assert sorted(path.name for path in folder.glob("0001*")) == ["0001.nc"]
    with xarray.open_dataset("whole.nc") as expected, xarray.open_dataset("0001.nc") as found:
        assert "resumed after step 3" in found.attrs["history"]
        for variable in ("pressure", "traction_x", "slip_increment_x", "approach"):
            assert_array_equal(found[variable], expected[variable])


def test_an_attempt_that_is_still_under_way_or_damaged_is_left_alone(folder: Path) -> None:
    case = Case.from_text(SHEARED, "0001.nc")
    with Store(folder / "0001.0123abcd.nc", metadata_of(case), overwrite=True) as store:
        with pytest.raises(KeyboardInterrupt):
            solve_into(case, store, Callback(stop_after_third))
        (folder / "0001.ffffffff.nc.d").mkdir()
        assert solve_case(Job("h", SHEARED, str(folder / "0001.nc")), apart=True).exit_code == 0
        assert len(store.heads) == 3
    with xarray.open_dataset("0001.nc") as found:
        assert "resumed" not in found.attrs["history"]


def stop_after_third(step: Any) -> None:
    if step.number == 3:
        raise KeyboardInterrupt


def test_a_worker_that_is_killed_takes_only_its_own_case_with_it(folder: Path) -> None:
    process = start()
    text = 'deck = "deck.toml"\n[[parameter]]\nkey = "load.1.steps"\nvalues = [2, 400]\n'
    assert Path("study.toml").read_text() == text
    wait_for_the_second(process.pid).kill()
    _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 3
    assert "case 2 (load.1.steps = 400) failed: its process died" in told
    assert json.loads(Path("study/0002.json").read_text())["exit_code"] == 4
    assert [case.position for case in Study.from_toml("study.toml").missing()] == [1]  # worth another try


def test_a_terminal_gets_a_bar(folder: Path) -> None:
    try:
        leader, follower = pty.openpty()
    except OSError as error:
        pytest.skip(f"no terminal to be had here: {error}")
    words = [sys.executable, "-m", "hexcontact", "study", "study.toml", "--jobs", "1"]
    environment = ENVIRONMENT | {"TERM": "xterm", "COLUMNS": "120"}
    process = subprocess.Popen(words, env=environment, stderr=follower, stdout=subprocess.PIPE, text=True)
    os.close(follower)
    seen = b""
    with contextlib.suppress(OSError):  # how a terminal says that nobody writes any more
        while piece := os.read(leader, 10000):
            seen += piece
    os.close(leader)
    out, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert b"6/6" in seen
    assert b"case 6 (load.1.normal_load" in seen
    assert out == "written: study.nc, 6 of 6 cases (their files in study/)\n"


def test_two_runs_of_one_study_do_not_meet(folder: Path) -> None:
    lock = Study.from_toml("study.toml").folder.lock()
    try:
        done = command("study.toml")
    finally:
        lock.release()
    assert done.returncode == 2
    assert "is being written by another run" in done.stderr


def test_a_case_that_another_run_is_at_is_no_failure_of_the_case(folder: Path) -> None:
    from hexcontact.result.store import Store
    from hexcontact.solve.run import metadata_of

    study = Study.from_toml("study.toml")
    case = study.missing()[0]
    with Store(study.folder.path(case), metadata_of(Case.from_text(case.deck))):
        outcome = study.run_case(1)
        assert outcome.exit_code == 2
        assert not outcome.lasting
        assert study.missing()[0] == case
        # on a cluster the other attempt may be of a worker that is gone: one more goes its own way
        path = study.folder.path(case)
        assert solve_case(Job(case.hash, case.deck, str(path)), apart=True).exit_code == 0
        assert study.folder.done(case)


# --- backends -----------------------------------------------------------------------------------------------


def test_each_module_of_the_backends_registers_one() -> None:
    modules = {module.name for module in pkgutil.iter_modules(backends.__path__)}
    assert set(BACKENDS) == modules == {kind.__module__.rpartition(".")[2] for kind in BACKENDS.values()}
    assert set(KEYS) == {"dask", "slurm"} <= set(StudyFile.known_keys())


def test_a_new_backend_has_its_key_and_runs_the_cases(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for registry in (BACKENDS, KEYS):
        monkeypatch.setattr(backend_registry, "BACKENDS" if registry is BACKENDS else "KEYS", dict(registry))

    @backend_registry.backend("here", Annotated[int, Whole(1)], meaning(None, "cases at a time"))
    class Here(Backend):
        def __init__(self, settings: int, cases: int) -> None:
            self.said = settings, cases

        def submit(self, work: Any, /, *args: Any, **options: Any) -> Future[Any]:
            assert self.said == (3, 2)
            future: Future[Any] = Future()
            future.set_result(work(*args, **options))
            return future

    file = extended(StudyFile, {"here": backend_registry.KEYS["here"]})
    monkeypatch.setattr(study_module, "StudyFile", file)
    monkeypatch.setattr(study_module, "BACKENDS", backend_registry.BACKENDS)
    study = Study("deck.toml", {"load.1.normal_load": [10.0, 20.0]}, here=3)
    assert study.backend() == (Here, 3)
    assert study.backend(jobs=2) == (LocalPool, 2)
    dataset = study.run()
    assert dataset is not None
    assert dataset.status.values.tolist() == [0, 0]
    with pytest.raises(DeckError, match="here = 0: expected a whole number of at least 1"):
        Study("deck.toml", {"load.1.normal_load": [10.0]}, here=0)


# --- Dask ---------------------------------------------------------------------------------------------------


def test_on_dask_a_killed_worker_loses_nothing(folder: Path) -> None:
    import distributed

    (folder / "deck.toml").write_text(LONG)
    study = Study("deck.toml", {"load.1.steps": [2, 3, 120, 4]}, output="study.nc")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        pids = {worker.pid for worker in cluster.workers.values()}
        killed: list[int] = []

        def worker_at_the_long_case() -> int:
            """Return the holder of the lock on its journal, 0 before the first step."""
            for lock in Path().glob("study/0003.*.nc.d/lock"):
                with contextlib.suppress(OSError, ValueError):
                    holder = int(json.loads(lock.read_text())["process"])
                    if list(lock.parent.glob("*.npz")):
                        return holder
            return 0

        class Killer(Listener):
            def said(self, event: str, /, *arguments: Any, **values: Any) -> None:
                if killed or not event.startswith("case="):
                    return
                holder = wait_for(worker_at_the_long_case)
                os.kill(holder, signal.SIGKILL)
                killed.append(holder)

        dataset = study.run(dask=cluster.scheduler_address, listener=Killer())
    assert pids
    assert len(killed) == 1
    assert dataset is not None
    assert (dataset.status == 0).all(), dataset.message.values
    assert sorted(path.name for path in Path("study").iterdir()) == [
        *("0001.nc", "0002.nc", "0003.nc", "0004.nc", "index.json")
    ]
    alone = Case.from_toml("deck.toml", {"load.1.steps": 2}).run()
    assert_allclose(dataset.approach[0], alone.approach[-1], rtol=1e-14)


def test_a_study_file_may_start_a_cluster(folder: Path) -> None:
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text + '[dask]\ncluster = "local"\noptions = { processes = false }\n')
    done = command("study.toml", "--quiet")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    with xarray.open_dataset("study.nc") as dataset:
        assert (dataset.status == 0).all()


@pytest.mark.parametrize(
    ("dask", "pattern"),
    [
        ('cluster = "slurm"', "pip install dask-jobqueue"),
        ('cluster = "local"\noptions = { nonsense = 1, processes = false }', "cannot be started .*nonsense"),
        ('cluster = "local"\naddress = "tcp://host:1"', "expected either address or cluster"),
        ('cluster = "cray"', 'dask.cluster = "cray": expected'),
    ],
)
def test_wrong_clusters_are_told_so(
    folder: Path, monkeypatch: pytest.MonkeyPatch, dask: str, pattern: str
) -> None:
    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    (folder / "study.toml").write_text((folder / "study.toml").read_text() + f"[dask]\n{dask}\n")
    done = command("study.toml")
    assert done.returncode == 2
    assert re.search(pattern, done.stderr), done.stderr


def test_cluster_of_a_batch_system_gets_its_options(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The classes of dask-jobqueue take options and are scaled; here one of that shape stands for them."""
    distributed = importlib.import_module("distributed")
    seen: dict[str, Any] = {}

    class SLURMCluster(distributed.LocalCluster):  # type: ignore[misc,name-defined]
        def __init__(self, **options: Any) -> None:
            seen.update(options)
            super().__init__(n_workers=0, processes=False, dashboard_address=None)

    jobqueue = types.ModuleType("dask_jobqueue")
    jobqueue.SLURMCluster = SLURMCluster  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "dask_jobqueue", jobqueue)
    dask = {"cluster": "slurm", "workers": 2, "options": {"cores": 4, "memory": "8GB", "walltime": "1:00:00"}}
    dataset = Study("deck.toml", {"load.1.normal_load": [1.0, 2.0]}, dask=dask).run()
    assert seen == dask["options"]
    assert dataset is not None
    assert (dataset.status == 0).all()


def test_what_dask_jobqueue_does_when_imported_does_no_harm(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It sets a handler of Ctrl-C, which only the main thread can; the command works in another one."""
    (folder / "dask_jobqueue.py").write_text(
        "import signal\nfrom distributed import LocalCluster\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "def SLURMCluster():\n    return LocalCluster(n_workers=0, processes=False, dashboard_address=None)\n"
    )
    monkeypatch.syspath_prepend(folder)
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text + '[dask]\ncluster = "slurm"\n')
    handler = signal.getsignal(signal.SIGINT)
    done = command("study.toml", "--quiet")
    sys.modules.pop("dask_jobqueue", None)
    assert done.returncode == 0, done.stderr
    assert signal.getsignal(signal.SIGINT) is handler


def test_where_no_scheduler_answers_there_is_one_sentence(folder: Path) -> None:
    done = command("study.toml", "--dask", "nonsense://")
    assert done.returncode == 2
    assert "no Dask scheduler answers at nonsense://" in done.stderr
    with pytest.raises(ValueError, match="No client"):
        importlib.import_module("distributed").default_client()


def test_without_dask_there_is_one_sentence(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = command("study.toml", "--dask", "tcp://127.0.0.1:1")
    assert done.returncode == 2
    assert "pip install distributed" in done.stderr


# --- the examples -------------------------------------------------------------------------------------------


def test_area_of_rough_surfaces_over_the_load(folder: Path) -> None:
    study = Study.from_toml(CASES / "study_rough.toml")
    assert len(study) == 27
    assert {axis.name for axis in study.plan.axes} == {"p", "seed", "spacing", "steps"}


def test_a_study_of_a_window_that_repeats_is_drawn(folder: Path) -> None:
    """Areas in place of radii, and a logarithmic axis for values that are spread so."""
    (folder / "waves.toml").write_text(WAVES)
    keys = 'key = "load.1.mean_pressure"\nname = "p"\nrange = ["10 MPa", "1 GPa"]\ncount = 3\nscale = "log"\n'
    (folder / "waves_study.toml").write_text(f'deck = "waves.toml"\n[[parameter]]\n{keys}')
    found = Study.from_toml(folder / "waves_study.toml").run()
    panels = draw_study(found).axes
    names = [axes.get_ylabel() for axes in panels]
    assert [axes.get_xscale() for axes in panels] == ["log"] * len(panels)
    assert any(name.startswith("contact area") for name in names)
    assert any(name.startswith("mean gap") for name in names)
    assert not any("radius" in name for name in names)


WAVES = """
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "waviness", amplitude = "0.2 um", wavelength = "100 um" }
[body.2]
young_modulus = "210 GPa"
poisson_ratio = 0.3
[grid]
boundary = "periodic"
extent = ["100 um", "100 um"]
nodes_across = 16
[[load]]
mean_pressure = "10 MPa"
"""


def test_example_is_a_good_study(folder: Path) -> None:
    study = Study.from_toml(CASES / "study_friction.toml")
    assert len(study) == 15
    assert {axis.name for axis in study.plan.axes} == {"friction_coefficient", "young_modulus_2"}


def test_page_about_studies_runs_as_it_stands(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (CASES.parent / "docs/studies.md").read_text()
    first, together, *_ = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (folder / "study.toml").write_text(first)
    (folder / "together.toml").write_text(together)
    (folder / "more_friction.toml").write_text(first.replace("[0.3, 0.45, 0.6]", "[0.7]"))
    coarse = starter("fretting").replace("nodes_in_radius = 20", "nodes_in_radius = 6")
    coarse = re.sub(r"steps = \d+", "steps = 2", coarse)
    (folder / "fretting.toml").write_text(coarse)
    solved = at_once(monkeypatch)
    assert command("study.toml").returncode == 0
    assert len(solved) == 12
    done = command("together.toml", "--plan")
    assert done.returncode == 0
    assert "together: 4 cases, 4 missing" in done.stdout
    assert command("more_friction.toml").returncode == 0
    solved.clear()
    reading, combined, joined, script, tied = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(reading, names)
    names["study"].close()
    exec(combined, names)
    assert names["whole"].friction_coefficient.values.tolist() == [0.3, 0.45, 0.6, 0.7]
    names["whole"].close()
    exec(joined, names)
    both, files = names["both"], names["files"]
    assert both.sizes["case"] == 2
    assert files[0].attrs["lattice_spacing"] != files[1].attrs["lattice_spacing"]
    kept = {name: [file.attrs.get(name) for file in files] for name in both.attrs}
    assert {"Conventions", "effective_modulus"} <= kept.keys()
    assert [name for name, (one, other) in kept.items() if np.any(one != other)] == []
    for file in files:
        file.close()
    exec(script.replace('"study.nc"', '"again.nc"'), names)
    assert len(solved) == 6
    assert (names["data"].status == 0).all()
    exec(tied, names)
    assert names["study"].states() == ["missing", "invalid", "missing"] * 2


def test_outcome_of_whatever_goes_wrong_is_told_not_raised(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(Problem, "from_text", broken)
    outcome = solve_case(Job("x", DECK, str(folder / "a.nc")))
    assert (outcome.exit_code, outcome.message) == (1, "ZeroDivisionError: by zero")


def test_what_a_deck_includes_is_part_of_its_cases(tmp_path: Path) -> None:
    """Another material in an included file makes other cases of the same study."""
    (tmp_path / "material.toml").write_text("[body.1]\nyoung_modulus = '200 GPa'\npoisson_ratio = 0.3\n")
    (tmp_path / "loads.csv").write_text("normal_load [N]\n1\n2\n")
    (tmp_path / "deck.toml").write_text(
        'include = ["material.toml"]\n'
        "[body.1]\nsurface = { shape = 'sphere', radius = '1 mm' }\n"
        "[body.2]\nrigid = true\nsurface = { shape = 'flat' }\n"
        "[grid]\nnodes_in_radius = 5\n"
        "[[load]]\nseries = { file = 'loads.csv' }\n"
    )
    file = tmp_path / "study.toml"
    file.write_text('deck = "deck.toml"\n[[parameter]]\nkey = "body.1.poisson_ratio"\nvalues = [0.2, 0.3]\n')
    before = [case.hash for case in hexcontact.Study.from_toml(file).plan.cases]
    (tmp_path / "material.toml").write_text("[body.1]\nyoung_modulus = '100 GPa'\npoisson_ratio = 0.3\n")
    after = [case.hash for case in hexcontact.Study.from_toml(file).plan.cases]
    assert len(set(before + after)) == 4
    (tmp_path / "loads.csv").write_text("normal_load [N]\n1\n3\n")
    assert not set(after) & {case.hash for case in hexcontact.Study.from_toml(file).plan.cases}
