"""``--json``: standard output is one object, whatever happens, that says what files and messages say."""

import copy
import json
import math
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.main
from commands import ENVIRONMENT, PATIENCE, wait_for
from typer.testing import CliRunner

import hexcontact
from hexcontact import Case, ConvergenceError
from hexcontact.cli import frame, verify
from hexcontact.cli.app import app
from hexcontact.cli.deck import check
from hexcontact.errors import Fault
from hexcontact.result.store import open_result
from hexcontact.solve import run as solve

DECK = """title = "A sphere"
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "70 GPa"
poisson_ratio = 0.33
[grid]
nodes_in_radius = 6
[[load]]
normal_load = "100 N"
steps = 2
label = "press"
"""
FRICTION = '[friction]\ncoefficient = inf\n[[load]]\ntangential_load_x = "2 N"\n'
STUDY = 'deck = "deck.toml"\n[[parameter]]\nkey = "load.1.normal_load"\nvalues = ["100 N", "50 N"]\n'


def constant(word: str) -> Any:
    raise ValueError(f"{word} is not JSON")


def command(*arguments: Any) -> tuple[int, dict[str, Any], str]:
    """Run a command with ``--json``; return exit code, object, standard error."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.stdout.count("\n") == 1  # one object on one line
    told = json.loads(result.stdout, parse_constant=constant)
    assert told["exit_code"] == result.exit_code
    assert told["hexcontact"] == hexcontact.__version__
    assert told["command"] == arguments[0]
    return result.exit_code, told, result.stderr


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "deck.toml").write_text(DECK)
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def with_option() -> set[str]:
    group: Any = typer.main.get_command(app)
    return {
        name for name, one in group.commands.items() if any("--json" in option.opts for option in one.params)
    }


def test_these_commands_have_it() -> None:
    assert with_option() == {"run", "resume", "check", "study", "info", "verify"}


# --- what they say ----------------------------------------------------------------------------------------


def test_run_says_what_the_file_holds(folder: Path) -> None:
    code, told, error = command("run", "deck.toml", "--plot")
    assert (code, told["output"], told["picture"]) == (0, "deck.nc", "deck.png")
    assert "step 2/2" in error
    result = open_result("deck.nc")
    assert [step["step"] for step in told["steps"]] == [1, 2]
    for step in told["steps"]:
        row = result.step(step["step"])
        for name, value in step.items():
            if name != "step":
                assert value == (str(row[name].values) if name == "label" else float(row[name])), name
    last = told["steps"][-1]
    assert (told["complete"], told["load_steps"], told["warnings"]) == (True, 2, [])
    assert told["seconds"] == pytest.approx(sum(step["seconds"] for step in told["steps"]))
    assert told["largest_residual"] == max(s[k] for s in told["steps"] for k in s if k.startswith("residual"))
    assert set(told["hertz"]) == {"max_pressure", "approach", "contact_radius", "contact_radius_fit"}
    assert told["hertz"]["approach"]["computed"] == last["approach"]
    pair = Case.from_toml("deck.toml").pair
    exact = (9 * 100.0**2 / (16 * pair.effective_modulus**2 * 10e-3)) ** (1 / 3)
    assert told["hertz"]["approach"]["exact"] == pytest.approx(exact, rel=1e-10)
    again = command("resume", "deck.nc")[1]
    assert again["steps"] == told["steps"]
    assert again["hertz"] == told["hertz"]
    assert set(told) == set(again)


def test_quiet_leaves_the_object(folder: Path) -> None:
    code, told, error = command("run", "deck.toml", "-q")
    assert (code, error) == (0, "")
    assert len(told["steps"]) == 2


def test_resume_says_what_the_whole_run_came_to(folder: Path) -> None:
    class Stopped(Exception):
        pass

    def stop(step: Any) -> None:
        raise Stopped

    with pytest.raises(Stopped):
        Case.from_toml("deck.toml").run("out.nc", on_step=stop)
    _, told, _ = command("resume", "out.nc")
    assert [step["step"] for step in told["steps"]] == [1, 2]
    assert told["output"] == "out.nc"


def test_check_says_what_would_be_run(folder: Path) -> None:
    code, told, error = command("check", "deck.toml", "--set", "load.1.steps=7")
    case = Case.from_toml("deck.toml", overrides={"load.1.steps": 7})
    assert (code, error) == (0, "")
    assert (told["rows"], told["columns"], told["nodes"]) == (*case.lattice.shape, case.lattice.size)
    assert (told["load_steps"], told["segments"], told["method"]) == (7, 1, case.method_for(case.lattice))
    assert told["spacing"] == case.lattice.spacing
    assert told["effective_modulus"] == case.pair.effective_modulus
    assert told["output"] == "deck.nc"
    assert told["memory"] > 8 * case.lattice.size
    assert list(folder.glob("*.nc")) == []


def test_infinity_and_what_is_not_there_are_json_too(folder: Path) -> None:
    Path("deck.toml").write_text(DECK.replace("[grid]", FRICTION.partition("[[")[0] + "[grid]"))
    assert command("check", "deck.toml")[1]["friction_coefficient"] == "inf"
    odd = {
        "a": math.nan,
        "b": [-math.inf, np.float64(1.5)],
        "c": np.arange(2),
        "d": Path("x"),
        5: (True, None),
    }
    assert frame.jsonable(odd) == {
        "a": None,
        "b": ["-inf", 1.5],
        "c": [0, 1],
        "d": "x",
        "5": [True, None],
    }


def test_info_says_what_the_attributes_say(folder: Path) -> None:
    Case.from_toml("deck.toml").run("out.nc")
    code, told, error = command("info", "out.nc")
    assert (code, error) == (0, "")
    result = open_result("out.nc")
    assert told["lattice_spacing"] == result.dataset.attrs["lattice_spacing"]
    assert told["deck"] == DECK
    assert (told["complete"], told["rows"], told["file"]) == (True, result.dataset.sizes["row"], "out.nc")
    assert "pressure" in told["fields"]
    assert told["steps"][1]["max_pressure"] == float(result.max_pressure[1])


def test_study_says_how_many_are_done_and_what_failed(folder: Path) -> None:
    Path("study.toml").write_text(STUDY.replace("50 N", "900 kN") + "\n")
    Path("deck.toml").write_text(DECK.replace("nodes_in_radius = 6", 'spacing = "60 um"\nwindow = [41, 41]'))
    planned = CliRunner().invoke(app, ["study", "study.toml", "--json"])
    assert planned.exit_code == 2  # the window of the second is too small, which is known before
    Path("study.toml").write_text(STUDY)
    code, told, _ = command("study", "study.toml", "--jobs", "1", "-q")
    assert code == 0
    assert (told["cases"], told["done"], told["missing"], told["failed"]) == (2, 2, 0, [])
    assert told["output"] == "study.nc"
    assert command("study", "study.toml", "--case", "2")[1]["output"] == "study/0002.nc"
    Path("study/0002.nc").unlink()
    note = {
        "hash": json.loads(Path("study/index.json").read_text()),
        "exit_code": 3,
        "message": "did not converge",
    }
    note["hash"] = list(note["hash"]["cases"])[1]
    Path("study/0002.json").write_text(json.dumps(note))
    code, told, _ = command("study", "study.toml", "--collect")
    assert (code, told["done"]) == (3, 1)
    [failed] = told["failed"]
    assert failed == {
        "case": 2,
        "parameters": {"load.1.normal_load": "50 N"},
        "exit_code": 3,
        "message": "did not converge",
    }
    code, told, _ = command("study", "study.toml", "--slurm")
    assert (code, "prints a script" in told["error"]["message"]) == (2, True)


def test_verify_says_each_comparison(monkeypatch: pytest.MonkeyPatch) -> None:
    check = copy.deepcopy(verify.self_test()["spheres"])
    monkeypatch.setattr(verify, "self_test", lambda: {"it": {**check, "name": "it", "title": "A check"}})
    code, told, _ = command("verify")
    [pressure, approach] = told["checks"][0]["rows"]
    assert (code, told["passed"], pressure["passed"], approach["passed"]) == (0, True, True, True)
    assert (approach["reference"], approach["analytic"], approach["judge"]) == (
        9.302996e-6,
        None,
        "reference",
    )
    assert approach["difference"] == pytest.approx(approach["computed"] / 9.302996e-6 - 1.0)
    check["values"][1]["value"] = 9.4e-6
    monkeypatch.setattr(verify, "self_test", lambda: {"it": check})
    code, told, _ = command("verify", "it")
    assert (code, told["passed"]) == (1, False)
    assert [row["passed"] for row in told["checks"][0]["rows"]] == [True, False]
    assert command("verify", "--list")[1]["checks"] == [{"name": "spheres", "title": check["title"]}]
    done = CliRunner().invoke(app, ["verify", "it"])
    assert (done.exit_code, done.stderr) == (1, "hexcontact: verify failed: spheres\n")
    assert "spheres: 1 of 2 comparisons passed" in done.stdout
    [line] = [line for line in done.stdout.splitlines() if "approach" in line]
    assert line.split()[2:5] == ["approach", "reference", "9.400000"]
    assert line.split()[-3:] == ["-1.0e-02", "1.2e-07", "FAIL"]


# --- errors -----------------------------------------------------------------------------------------------


def test_each_fault_of_a_deck_comes_with_key_and_place(folder: Path) -> None:
    text = DECK.replace("poisson_ratio = 0.33", "poisson_ratio = 0.9").replace("steps = 2", "stebs = 2")
    Path("deck.toml").write_text(text)
    for name in ("run", "check"):
        code, told, error = command(name, "deck.toml", "--set", "solver.tolerance=3")
        assert code == 2
        assert told["error"]["kind"] == "input"
        assert told["error"]["exit_code"] == 2
        assert [f"hexcontact: {line}" for line in told["error"]["message"].splitlines()] == error.splitlines()
        faults = {fault["key"]: fault for fault in told["error"]["faults"]}
        # overrides first, then by line
        assert list(faults) == ["solver.tolerance", "body.2.poisson_ratio", "load.1.stebs"]
        poisson = faults["body.2.poisson_ratio"]
        assert (poisson["file"], poisson["line"], poisson["column"]) == ("deck.toml", 8, 1)
        assert (poisson["value"], faults["load.1.stebs"]["line"]) == ("0.9", 13)
        assert (faults["solver.tolerance"]["file"], faults["solver.tolerance"]["line"]) == (None, None)
        assert poisson["message"].startswith("deck.toml:8:1: body.2.poisson_ratio = 0.9: expected a number")


def test_what_is_not_toml_comes_with_its_place(folder: Path) -> None:
    Path("deck.toml").write_text(DECK + "a = \n")
    [fault] = command("run", "deck.toml")[1]["error"]["faults"]
    assert (fault["file"], fault["line"], fault["column"], fault["key"]) == ("deck.toml", 15, 5, None)


@pytest.mark.parametrize("name", sorted(with_option()))
def test_wrong_files_and_options_are_told(name: str, folder: Path) -> None:
    code, told, error = command(name, "nothing")
    assert (code, told["error"]["kind"]) == (2, "input")
    assert told["error"]["message"] in error.replace("hexcontact: ", "")
    code, told, error = command(name, "nothing", "--no-such-option")
    assert code == 2
    # typer words it with a colon or with quotes
    assert re.search("No such option:? '?--no-such-option", told["error"]["message"])


def test_an_output_that_is_there_is_told(folder: Path) -> None:
    Path("deck.nc").write_text("x")
    code, told, _ = command("run", "deck.toml")
    assert (code, "exists already" in told["error"]["message"]) == (2, True)


def test_too_little_memory_is_told(folder: Path) -> None:
    keys = "--set", "grid={ nodes_across = 99999 }"
    for name in ("check", "run"):
        code, told, _ = command(name, "deck.toml", *keys)
        assert (code, told["error"]["kind"]) == (4, "resources")


def test_no_convergence_is_told_with_the_residuals(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*arguments: Any, **options: Any) -> Any:
        yield from ()
        raise ConvergenceError(
            "step 1: no", {"step": 1, "residuals": {"R_n": math.inf}, "worst": {"row": None}}
        )

    monkeypatch.setattr(solve, "steps", failing)
    code, told, error = command("run", "deck.toml", "-q")
    assert (code, error) == (3, "hexcontact: step 1: no\n")
    expected = {"kind": "convergence", "residuals": {"R_n": "inf"}, "worst": {"row": None}}
    assert expected.items() <= told["error"].items()


def test_a_mistake_of_the_program_is_told_and_shown(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: Any) -> Any:
        raise ZeroDivisionError("a mistake")

    monkeypatch.setattr("hexcontact.cli.deck.case_content", broken)
    with pytest.raises(ZeroDivisionError):
        check(deck=Path("deck.toml"), as_json=True)
    result = CliRunner().invoke(app, ["check", "deck.toml", "--json"])
    assert result.exit_code == 1
    assert json.loads(result.stdout)["error"]["message"] == "ZeroDivisionError: a mistake"


def test_an_interruption_is_told(folder: Path) -> None:
    Path("deck.toml").write_text(DECK.replace("steps = 2", "steps = 5000"))
    words = [sys.executable, "-m", "hexcontact", "run", "deck.toml", "--json"]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(words, env=ENVIRONMENT, **pipes)
    wait_for(lambda: len(list(folder.glob("deck.nc.d/*.npz"))) >= 3)
    process.send_signal(signal.SIGTERM)
    out, error = process.communicate(timeout=PATIENCE)
    told = json.loads(out)
    assert (process.returncode, told["exit_code"], told["error"]["kind"]) == (143, 143, "interrupted")
    assert "to resume: hexcontact resume" in told["error"]["message"]
    assert f"hexcontact: {told['error']['message']}" in error


def test_every_name_is_in_the_documentation(folder: Path) -> None:
    page = (Path(__file__).parents[2] / "docs/running.md").read_text()
    objects = [command("check", "deck.toml")[1], command("run", "deck.toml", "-q")[1]]
    objects += [command("run", "no.toml")[1], command("study", "study.toml", "--jobs", "1", "-q")[1]]
    objects.append(objects[2]["error"])
    objects.append({name: None for name in Fault._fields if name != "sentence"})
    assert {name for one in objects for name in one if f"`{name}`" not in page} == set()
