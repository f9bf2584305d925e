"""The command, run as users run it: exit codes, messages, files; never a traceback."""

import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import commands
import drawn
import numpy as np
import pytest
from commands import inside

import hexcontact
from hexcontact import plotting
from hexcontact.cli.app import MODULES, app
from hexcontact.core import contact
from hexcontact.result.journal import journal_of
from hexcontact.result.store import open_result

ENVIRONMENT = commands.ENVIRONMENT | {"NO_COLOR": "1"}

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
nodes_in_radius = 12
[[load]]
normal_load = "100 N"
steps = 2
label = "press"
"""


def start(folder: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hexcontact", *arguments],
        cwd=folder,
        env=ENVIRONMENT | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def hexcontact_(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    process = start(folder, *arguments, **environment)
    out, error = process.communicate(timeout=commands.PATIENCE)
    return subprocess.CompletedProcess(arguments, process.returncode, out, error)


def refused(done: subprocess.CompletedProcess[str], code: int, pattern: str) -> None:
    """Check that a command failed with one sentence by line, each marked as ours."""
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    lines = done.stderr.splitlines()
    assert any(re.search(pattern, line) for line in lines), done.stderr
    assert all(
        line.startswith("hexcontact: ") for line in lines if not re.match(r"step +\d|.*load steps?$", line)
    )


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    path = tmp_path / "sphere.toml"
    path.write_text(DECK)
    return path


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a deck, its result and its picture."""
    folder = tmp_path_factory.mktemp("solved")
    (folder / "sphere.toml").write_text(DECK)
    done = hexcontact_(folder, "run", "sphere.toml", "--plot")
    assert done.returncode == 0, done.stderr
    (folder / "stdout").write_text(done.stdout)
    (folder / "stderr").write_text(done.stderr)
    return folder


# --- the run --------------------------------------------------------------------------------------


def test_run_writes_result_and_picture_and_compares_with_hertz(solved: Path) -> None:
    result = open_result(solved / "sphere.nc")
    assert result.complete
    assert len(result) == 2
    np.testing.assert_array_equal(
        drawn.pixels(solved / "sphere.png"), drawn.pixels(plotting.overview(result))
    )
    out = (solved / "stdout").read_text()
    assert "Against Hertz" in out
    row = re.search(r"max pressure +([\d.]+) MPa +([\d.]+) MPa +([+-][\d.]+) %", out)
    assert row
    exact, computed, difference = map(float, row.groups())
    assert difference == pytest.approx(100 * (computed / exact - 1), abs=1e-3)
    assert 0 < abs(difference) < 0.5
    assert re.search(r"R_n = \d\.\de-\d\d, R_P = \d\.\de[+-]\d\d", out)
    assert "written: sphere.nc, " in out
    assert "\x1b" not in out
    lines = (solved / "stderr").read_text().splitlines()
    assert [line[:8] for line in lines] == ["A sphere", "step 1/2", "step 2/2"]


def test_quiet_prints_nothing(deck: Path) -> None:
    done = hexcontact_(deck.parent, "run", "sphere.toml", "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_output_goes_where_the_deck_or_the_option_says(deck: Path) -> None:
    deck.write_text(DECK + '[output]\nfile = "named.nc"\n')
    (deck.parent / "elsewhere").mkdir()
    assert inside(deck.parent / "elsewhere", "run", "../sphere.toml", "-q").returncode == 0
    assert [p.name for p in (deck.parent / "elsewhere").iterdir()] == ["named.nc"]
    assert inside(deck.parent, "run", "sphere.toml", "-q", "-o", "elsewhere/other.nc").returncode == 0
    assert (deck.parent / "elsewhere/other.nc").exists()


def test_an_existing_output_needs_overwrite(deck: Path) -> None:
    out = deck.with_suffix(".nc")
    out.write_text("CDF\x01precious")
    refused(inside(deck.parent, "run", "sphere.toml"), 2, r"sphere\.nc exists already; --overwrite")
    foreign = r"sphere\.nc is not a result of hexcontact"
    refused(inside(deck.parent, "run", "sphere.toml", "--overwrite"), 2, foreign)
    assert out.read_text() == "CDF\x01precious"
    out.write_text("")
    assert inside(deck.parent, "run", "sphere.toml", "--overwrite", "-q").returncode == 0
    assert len(open_result(out)) == 2


def test_settings_replace_keys_and_are_part_of_the_result(deck: Path) -> None:
    done = inside(
        *(deck.parent, "run", "sphere.toml", "-q", "--set", "load.1.normal_load=20 N"),
        *("--set", "load.1.steps=1", "--set", 'title="other"'),
    )
    assert done.returncode == 0, done.stderr
    result = open_result(deck.with_suffix(".nc"))
    assert result.normal_load.values.tolist() == pytest.approx([20.0], rel=1e-8)
    assert "20 N" in result.deck
    assert result.case_title == "other"
    for wrong in ("load.1.steps", "=3"):
        refused(inside(deck.parent, "run", "sphere.toml", "--set", wrong), 2, r"expected KEY=VALUE, such as")


# --- what is wrong --------------------------------------------------------------------------------


def test_wrong_input_gets_a_sentence_and_exit_code_2(deck: Path) -> None:
    folder = deck.parent
    refused(inside(folder, "run", "missing.toml"), 2, r"missing\.toml: no such file")
    refused(inside(folder, "run", "."), 2, "is a folder; expected a deck")
    refused(inside(folder, "run", "sphere.toml", "-o", "none/out.nc"), 2, "the folder .*none does not exist")
    refused(inside(folder, "run", "sphere.toml", "-o", "."), 2, "is a folder; a file name is expected")
    refused(inside(folder, "info", "sphere.toml"), 2, "sphere.toml is a TOML file; expected a netCDF file")
    refused(inside(folder, "info", "missing.nc"), 2, r"there is no file missing\.nc")
    refused(inside(folder, "plot", "missing.nc"), 2, r"there is no file missing\.nc")
    refused(inside(folder, "verify", "nothing"), 2, "nothing")
    done = inside(folder, "rune")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_check_reports_all_errors_at_once(deck: Path) -> None:
    wrong = DECK.replace('"10 mm"', '"3 kg"').replace("poisson_ratio = 0.3\n", "poisson_ratio = 0.7\n")
    deck.write_text(wrong.replace("nodes_in_radius", "nodes_in_radios"))
    done = inside(deck.parent, "check", "sphere.toml")
    refused(done, 2, r'surface.radius = "3 kg": expected a length')
    refused(done, 2, r"body\.1\.poisson_ratio = 0\.7")
    refused(done, 2, r"did you mean nodes_in_radius\?")


def test_debug_shows_the_traceback(deck: Path) -> None:
    done = hexcontact_(deck.parent, "run", "missing.toml", HEXCONTACT_DEBUG="1")
    assert done.returncode == 1
    assert "Traceback" in done.stderr


def test_memory_that_is_not_there_is_exit_code_4(deck: Path) -> None:
    done = inside(deck.parent, "run", "sphere.toml", "--set", "grid.nodes_in_radius=20000")
    refused(
        done, 4, r"a window of \d+ x \d+ nodes \(method fft\) needs \S+ GB of memory and \S+ GB are available"
    )
    assert sorted(p.name for p in deck.parent.iterdir()) == ["sphere.toml"]


def test_no_convergence_is_exit_code_3(deck: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    original = contact.NormalContact.solve

    def solve(self: contact.NormalContact, **arguments: Any) -> contact.NormalSolution:
        missed = arguments.get("normal_load") == 100.0 and arguments["tolerance"] == 1e-8
        return replace(original(self, **arguments), converged=not missed)

    monkeypatch.setattr(contact.NormalContact, "solve", solve)
    done = inside(deck.parent, "run", "sphere.toml")
    refused(
        done,
        3,
        r"step 2 of 2 \(press\) did not converge: .*R_n = \S+ and R_P = \S+; solver\.tolerance = 1e-08",
    )
    refused(
        done, 3, r"1 of 2 load steps are finished and recorded in .*sphere\.nc\.d; to resume: hexcontact res"
    )
    assert len(open_result(deck.with_suffix(".nc"))) == 1
    told = " ".join(inside(deck.parent, "info", "sphere.nc").stdout.split())
    assert "stopped step 2 of 2 (press) did not converge: after" in told


# --- interrupted ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_run_keeps_its_steps(deck: Path, sent: signal.Signals, code: int) -> None:
    deck.write_text(DECK.replace("steps = 2", "steps = 5000"))
    process = start(deck.parent, "run", "sphere.toml")
    assert process.stderr
    said = [process.stderr.readline() for _ in range(4)]
    process.send_signal(sent)
    _, error = process.communicate(timeout=commands.PATIENCE)
    assert process.returncode == code
    assert "Traceback" not in error
    message = re.search(
        r"interrupted; (\d+) of 5000 load steps are finished and recorded in .*sphere\.nc\.d; ", error
    )
    assert message, [*said, error]
    out = deck.with_suffix(".nc")
    result = open_result(out)
    assert len(result) >= int(message[1]) >= 3
    assert not (journal_of(out) / "lock").exists()
    info = hexcontact_(deck.parent, "info", "sphere.nc")
    assert info.returncode == 0
    assert f"{len(result)} (unfinished, 5000 were planned)" in info.stdout
    refused(
        hexcontact_(deck.parent, "run", "sphere.toml"),
        2,
        r"holds \d+ finished steps of an unfinished run; .*--overwrite",
    )


@pytest.mark.parametrize("sent", [(15, 15), (15, 2), (2, 15, 15)])
def test_signals_that_follow_do_not_disturb_the_leaving(deck: Path, sent: tuple[int, ...]) -> None:
    deck.write_text(DECK.replace("steps = 2", "steps = 5000"))
    process = start(deck.parent, "run", "sphere.toml")
    assert process.stderr
    for _ in range(3):
        process.stderr.readline()
    process.send_signal(sent[0])
    # Signals that wait together may be delivered in another order, and on a busy machine they wait long.
    status = Path(f"/proc/{process.pid}/status")
    while status.exists() and not re.search(r"^ShdPnd:\s*0+$", status.read_text(), re.MULTILINE):
        time.sleep(0.001)
    time.sleep(0.005)
    for number in sent[1:]:
        process.send_signal(number)
    _, error = process.communicate(timeout=commands.PATIENCE)
    assert process.returncode == 128 + sent[0]
    assert "Traceback" not in error
    assert error.count("interrupted; ") == 1
    assert not (journal_of(deck.with_suffix(".nc")) / "lock").exists()
    told = " ".join(hexcontact_(deck.parent, "info", "sphere.nc").stdout.split())
    assert f"stopped interrupted ({signal.Signals(sent[0]).name})" in told


def test_a_long_step_can_be_interrupted(deck: Path) -> None:
    process = start(
        deck.parent, "run", "sphere.toml", "--set", "grid.nodes_in_radius=1000", "--set", "load.1.steps=1"
    )
    assert process.stderr
    process.stderr.readline()  # the title: solving begins
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=commands.PATIENCE)
    assert process.returncode == 130
    assert error == "hexcontact: interrupted; no load step was finished\n"
    assert [p.name for p in deck.parent.iterdir()] == ["sphere.toml"]


# --- looking at results ---------------------------------------------------------------------------


def test_info_tells_the_story(solved: Path) -> None:
    done = hexcontact_(solved, "info", "sphere.nc")
    assert done.returncode == 0
    for words in (
        "A sphere",
        "2 (complete)",
        f"hexcontact {hexcontact.__version__}",
        "press",
        "100.0 N",
        "Against Hertz",
        "R_n =",
    ):
        assert words in done.stdout


@pytest.mark.usefixtures("laid_out_once")
def test_plot_draws_what_is_asked(solved: Path) -> None:
    done = inside(solved, "plot", "sphere.nc", "--what", "all", "--step", "1")
    assert done.returncode == 0, done.stderr
    pictures = re.findall(r"written: (.*\.png)", done.stdout)
    names = ["overview", "pressure", "section", "boundary", "history", "stress", "trailing_edge"]
    assert [Path(picture).stem for picture in pictures] == [f"sphere_{name}" for name in names]
    result = open_result(solved / "sphere.nc")
    for name, chosen in (("section", [1]), ("history", [])):  # one with a step and one without
        expected = drawn.pixels(plotting.FIGURES[name](result, *chosen))
        np.testing.assert_array_equal(drawn.pixels(solved / pictures[names.index(name)]), expected)
    assert inside(solved, "plot", "sphere.nc", "-w", "section", "-o", "cut.pdf").returncode == 0
    assert drawn.strokes((solved / "cut.pdf").read_bytes(), "pdf") > 100
    refused(
        inside(solved, "plot", "sphere.nc", "-w", "sektion"),
        2,
        "--what sektion: expected .*did you mean section",
    )
    refused(
        inside(solved, "plot", "sphere.nc", "-s", "7"),
        2,
        "there is no step 7; the result has steps 1 to 2",
    )
    refused(
        inside(solved, "plot", "sphere.nc", "-o", "cut.xyz"),
        2,
        "cannot draw overview of sphere.nc: .*xyz",
    )
    refused(
        inside(solved, "plot", "sphere.nc", "-o", "no/cut.png"),
        2,
        "cannot write no/cut.png: the folder no does not exist",
    )


def test_a_damaged_result_is_no_traceback(solved: Path) -> None:
    whole = (solved / "sphere.nc").read_bytes()
    codes = []
    for seed in range(3):
        damaged = bytearray(whole)
        for position in np.random.default_rng(seed).integers(0, len(whole), 60):
            damaged[position] ^= 0xFF
        (solved / "damaged.nc").write_bytes(damaged)
        done = hexcontact_(solved, "plot", "damaged.nc", "-o", "damaged.png")
        assert "Traceback" not in done.stderr
        assert done.returncode in (0, 2), done.stderr
        codes.append(done.returncode)
    assert 2 in codes


# --- starting -------------------------------------------------------------------------------------


def test_every_starter_deck_is_ready_to_run(tmp_path: Path) -> None:
    names = inside(tmp_path, "new", "--list").stdout.split()
    assert "sphere" in names
    for name in names:
        done = inside(tmp_path, "new", name)
        assert done.stdout == f"written: {name}.toml; now: hexcontact run {name}.toml\n"
        check = inside(tmp_path, "check", f"{name}.toml")
        assert check.returncode == 0, check.stderr
        assert f"{name}.toml is ready to run" in check.stdout


def test_new_writes_nothing_over(tmp_path: Path) -> None:
    (tmp_path / "sphere.toml").write_text("mine")
    refused(
        inside(tmp_path, "new", "sphere"),
        2,
        r"sphere\.toml exists already; choose another name with --output",
    )
    assert (tmp_path / "sphere.toml").read_text() == "mine"
    refused(inside(tmp_path, "new", "sphera"), 2, r"NAME = sphera: expected .* did you mean sphere\?")
    refused(inside(tmp_path, "new"), 2, "NAME is missing")
    printed = inside(tmp_path, "new", "sphere", "-o", "-")
    assert "[body.1]" in printed.stdout


def test_check_says_what_would_be_run(deck: Path) -> None:
    done = inside(deck.parent, "check", "sphere.toml")
    assert done.returncode == 0
    for words in (
        "A sphere",
        "E = 210.0 GPa, nu = 0.3; sphere, radius 10.00 mm",
        "E* = ",
        "beta = ",
        "grows",
        "100.0 N",
    ):
        assert words in done.stdout
    assert re.search(r"^ memory +\d\S* [kM]B *$", done.stdout, re.MULTILINE)
    assert sorted(p.name for p in deck.parent.iterdir()) == ["sphere.toml"]


def test_help_and_version(tmp_path: Path) -> None:
    assert hexcontact_(tmp_path, "--version").stdout == f"hexcontact {hexcontact.__version__}\n"
    told = hexcontact_(tmp_path, "--version", "--verbose").stdout
    assert re.search(
        r"FFT: (fftw3|pocketfft) \d.*BLAS: \w+ \d.*OpenMP: (yes|no)\n  MPI: (yes|no)\n  threads: \d+\n",
        told,
        re.DOTALL,
    )
    assert f"numpy {np.__version__}\n" in told
    overall = hexcontact_(tmp_path, "--help").stdout
    for command in ("run", "check", "new", "info", "plot", "verify"):
        assert command in overall
        # whose process imports its module alone
        shown = (hexcontact_ if command in ("check", "plot") else inside)(tmp_path, command, "--help")
        assert shown.returncode == 0
        assert f"Example: hexcontact {command}" in shown.stdout


def test_a_plain_ascii_terminal_is_enough(solved: Path) -> None:
    done = hexcontact_(solved, "info", "sphere.nc", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert done.returncode == 0, done.stderr
    assert "Against Hertz" in done.stdout


def test_help_is_quick() -> None:
    """What takes long is to import packages: help does without those that compute, read files and draw."""
    heavy = {
        "matplotlib",
        "xarray",
        "pandas",
        "scipy",
        "netCDF4",
        "pint",
        "pydantic",
        "hexcontact.core._core",
    }
    program = (
        "import sys\nfrom hexcontact.cli.app import main\nsys.argv = ['hexcontact', '--help']\n"
        f"try:\n    main()\nexcept SystemExit:\n    pass\nprint(sorted({heavy} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], env=ENVIRONMENT, capture_output=True, text=True)
    assert "Usage" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


def test_table_of_modules_names_every_command() -> None:
    named = {(f"hexcontact.cli.{module}", name) for module, names in MODULES.items() for name in names}
    registered = {(info.callback.__module__, info.callback.__name__) for info in app.registered_commands}
    assert named == registered


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_command_imports_only_what_it_needs(deck: Path, command: str) -> None:
    """A run without tables below the surface, wear and refinement reads none of their modules."""
    own = {"check": "deck", "run": "run"}[command]
    spared = {f"hexcontact.cli.{module}" for module in MODULES if module != own}
    spared |= {f"hexcontact.{room}" for room in ("study", "plotting", "interior")}
    spared |= {f"hexcontact.solve.{name}" for name in ("lattices", "accuracy", "wear")}
    spared |= {"hexcontact.result.result", "hexcontact.result.export"}
    spared |= {"jinja2", "yaml", "xarray", "pandas", "scipy", "pint", "matplotlib", "psutil"}
    spared |= {"hexcontact.solve.nonconvergence"}
    if command == "check":
        spared |= {"hexcontact.solve.run", "hexcontact.analytic", "netCDF4", "numpy.ma"}
    program = (
        "import sys\nbefore = set(sys.modules)\nfrom hexcontact.cli.app import main\n"
        f"sys.argv = ['', {command!r}, {str(deck)!r}]\n"
        f"try:\n    main()\nexcept SystemExit as ending:\n    print(ending.code)\n"
        f"print(sorted({spared} & (set(sys.modules) - before)))"
    )
    folder = deck.parent
    done = subprocess.run(
        [sys.executable, "-c", program], env=ENVIRONMENT, capture_output=True, text=True, cwd=folder
    )
    assert done.stdout.splitlines()[-2:] == ["0", "[]"], done.stderr


def test_names_of_the_package_are_there() -> None:
    for name in hexcontact.__all__:
        assert getattr(hexcontact, name) is not None
        assert name in dir(hexcontact)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = hexcontact.nothing


def test_overwrite_replaces_results_only(deck: Path) -> None:
    before = deck.read_text()
    done = hexcontact_(deck.parent, "run", "sphere.toml", "--output", "sphere.toml", "--overwrite")
    assert (done.returncode, deck.read_text()) == (2, before)
    assert "sphere.toml is not a result of hexcontact" in done.stderr
    for name in ("a.png", "a.csv"):
        done = hexcontact_(deck.parent, "run", "sphere.toml", "--output", name, "--plot")
        assert done.returncode == 2
        assert f"output {name}: expected a netCDF file, such as a.nc" in done.stderr


def test_check_refuses_what_memory_cannot_hold(deck: Path) -> None:
    done = hexcontact_(deck.parent, "check", "sphere.toml", "--set", "grid.window=[60000, 60000]")
    assert done.returncode == 4, done.stderr
    assert "a window of 60000 x 60000 nodes" in done.stderr
    assert "are available" in done.stderr


def test_check_looks_at_the_output_folder(deck: Path) -> None:
    for folder, fault in (("nowhere", "the folder nowhere does not exist"), (deck.name, "is not a folder")):
        done = hexcontact_(deck.parent, "check", deck.name, "--set", f'output.file="{folder}/a.nc"')
        assert done.returncode == 2
        assert fault in done.stderr
