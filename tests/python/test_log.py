"""The log of runs, in Python and on the command line: what a line says, where it goes."""

import calendar
import dataclasses
import logging
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from commands import ENVIRONMENT, PATIENCE, wait_for
from typer.testing import CliRunner

from hexcontact import Case, ConvergenceError, FrictionalContact, NormalContact
from hexcontact.cli.app import app
from hexcontact.errors import DeckError
from hexcontact.result.store import open_result
from hexcontact.solve import events as log

DECK = """
title = "A \\"sphere\\"\\nof steel"
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "70 GPa"
poisson_ratio = 0.33
[friction]
coefficient = 0.2
[solver]
entry = "interpolated"
[grid]
nodes_in_radius = 12
[[load]]
normal_load = "100 N"
label = "press"
[[load]]
tangential_load_x = "8 N"
steps = 4
label = "shear it"
"""
LINE = re.compile(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z) ([A-Z]+) +(.*)")


def words(line: str) -> dict[str, str]:
    """Return the words name=value of a line."""
    return dict(word.partition("=")[::2] for word in shlex.split(line) if "=" in word)


def steps_of(lines: list[str]) -> list[dict[str, str]]:
    return [words(line) for line in lines if line.startswith("step=")]


def read(path: Path) -> list[tuple[str, str]]:
    """Level and message of each line of a log."""
    found = [LINE.fullmatch(line) for line in path.read_text(encoding="utf-8").splitlines()]
    assert all(found), path.read_text()
    return [(match[2], match[3]) for match in found if match]


def command(*arguments: Any) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, list(map(str, arguments)))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    path = tmp_path / "deck.toml"
    path.write_text(DECK)
    return path


# --- what it says -----------------------------------------------------------------------------------------


def test_a_script_hears_a_line_for_each_step_with_what_the_history_says(caplog: Any) -> None:
    case = Case.from_text(DECK)
    with caplog.at_level(logging.INFO, logger="hexcontact"):
        result = case.run()
    lines = [record.getMessage() for record in caplog.records]
    assert {record.name for record in caplog.records} == {"hexcontact"}
    assert [line.split(" ")[0] for line in lines] == [
        "begun",
        *(f"step={k}/5" for k in range(1, 6)),
        "finished",
    ]
    begun = words(lines[0])
    assert (begun["steps"], begun["friction_coefficient"], begun["method"]) == ("5", "0.2", "fft")
    rows, cols = case.lattice.shape
    assert begun["window"] == f"{rows}x{cols}"
    for step, row in enumerate(steps_of(lines)):
        last = result.dataset.isel(step=step)
        zone = last.zone.values
        assert int(row["contact"]) == (zone > 0).sum() == int(row["stick"]) + int(row["slip"])
        assert int(row["stick"]) == (zone == 1).sum()
        assert float(row["P"]) == pytest.approx(100.0, rel=1e-5)
        assert float(row["p_max"]) == pytest.approx(float(last.max_pressure), rel=1e-5)
        assert float(row["R_n"]) == pytest.approx(float(last.residual_normal), rel=1e-2, abs=1e-30)
        assert float(row["R_t"]) == pytest.approx(float(last.residual_tangential), rel=1e-2, abs=1e-30)
        assert float(row["seconds"]) == pytest.approx(float(last.seconds), rel=1e-2)
        assert float(row["applications"]) == pytest.approx(float(last.operator_applications), rel=1e-2)
        assert (int(row["iterations"]), int(row["halvings"])) == (int(last.sweeps), int(last.cuts))
    shear = steps_of(lines)[2]
    assert (shear["segment"], shear["label"], float(shear["fraction"])) == ("2", "shear it", 0.5)
    assert float(shear["Qx"]) == pytest.approx(4.0, rel=1e-5)
    assert float(steps_of(lines)[0]["fraction"]) == 1.0


def test_fractions_are_those_of_ramps_with_values(caplog: Any) -> None:
    text = DECK.replace("steps = 4", "values = [0.1, 0.7, 1]")
    with caplog.at_level(logging.INFO, logger="hexcontact"):
        Case.from_text(text).run()
    lines = [record.getMessage() for record in caplog.records]
    assert [float(row["fraction"]) for row in steps_of(lines)] == [1.0, 0.1, 0.7, 1.0]


def test_a_contact_without_friction_has_no_stick(caplog: Any) -> None:
    text = DECK.partition("[friction]")[0] + '[grid]\nnodes_in_radius = 12\n[[load]]\nnormal_load = "9 N"\n'
    with caplog.at_level(logging.INFO, logger="hexcontact"):
        Case.from_text(text).run()
    [row] = steps_of([record.getMessage() for record in caplog.records])
    assert "stick" not in row
    assert int(row["contact"]) > 80
    assert "R_t" not in row


def test_a_window_that_grows_is_told(caplog: Any) -> None:
    case = Case.from_text(DECK)
    case.lattice = dataclasses.replace(case.lattice, row_first=-19, n_row=20)  # beside the contact
    with caplog.at_level(logging.INFO, logger="hexcontact"):
        result = case.run()
    grown = [words(r.getMessage()) for r in caplog.records if r.getMessage().startswith("window ")]
    assert grown
    assert grown[0]["before"] == "x".join(map(str, case.lattice.shape))
    assert grown[-1]["after"] == "x".join(map(str, result.lattice.shape))


def test_a_step_that_does_not_converge_is_an_error(caplog: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case.from_text(DECK.replace("[friction]\ncoefficient = 0.2\n", "").partition("[[load]]\ntang")[0])
    original = NormalContact.solve

    def hasty(self: NormalContact, **options: Any) -> Any:
        return original(self, **options | {"max_sweeps": 1})

    monkeypatch.setattr(NormalContact, "solve", hasty)
    with caplog.at_level(logging.ERROR, logger="hexcontact"), pytest.raises(ConvergenceError):
        case.run()
    [record] = caplog.records
    assert record.levelname == "ERROR"
    assert re.match(r'stopped reason="step 1 of 1 .*did not converge', record.getMessage())


def test_nobody_hears_it_who_does_not_listen(tmp_path: Path) -> None:
    program = (
        "import hexcontact\n"
        f"case = hexcontact.Case.from_text({DECK!r})\n"
        "case.run()\n"
        "from hexcontact.solve import events as log\n"
        "log.logger.error('an error')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=ENVIRONMENT)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_values_are_written_so_that_they_can_be_read_again() -> None:
    line = log.words("event", number=1.0, small=1.23456789e-7, text='a "b"\nc=d', none=math.nan, count=3)
    assert line == 'event number=1 small=1.23457e-07 text="a \\"b\\"\\nc=d" none=nan count=3'


# --- the file ---------------------------------------------------------------------------------------------


def test_log_file_keeps_every_run_one_event_by_line(deck: Path) -> None:
    place = deck.parent / "run.log"
    before = time.time()
    code, out, error = command("run", deck, "-o", deck.parent / "a.nc", "--log-file", place)
    assert code == 0
    assert "step 1/5" in error  # the progress is shown as ever
    assert "History" in out
    first = read(place)
    assert [level for level, _ in first] == ["INFO"] * 8
    assert words(first[0][1])["title"] == 'A "sphere"\\nof steel'.replace('\\"', '"')
    assert first[-1][1] == f'written file="{deck.parent / "a.nc"}"'
    stamp = LINE.fullmatch(place.read_text().splitlines()[0])
    assert stamp
    told = calendar.timegm(time.strptime(stamp[1][:19], "%Y-%m-%dT%H:%M:%S"))
    assert before - 2 < told < time.time() + 2  # UTC
    assert command("run", deck, "-o", deck.parent / "b.nc", "--log-file", place, "--quiet") == (0, "", "")
    assert len(read(place)) == 16
    assert place.read_text().splitlines()[0] == stamp[0]


def test_log_level_shows_the_log_instead_of_the_progress(deck: Path) -> None:
    code, _, error = command("run", deck, "-o", deck.parent / "a.nc", "--log-level", "info")
    assert code == 0
    assert all(LINE.fullmatch(line) for line in error.splitlines())
    assert len(steps_of([LINE.fullmatch(line)[3] for line in error.splitlines()])) == 5  # type: ignore[index]
    assert logging.getLogger("hexcontact").handlers == log.logger.handlers[:1]  # none is left behind
    assert logging.getLogger("hexcontact").level == logging.NOTSET
    code, _, error = command("run", deck, "-o", deck.parent / "b.nc", "--log-level", "warning")
    assert (code, error) == (0, "")


def test_a_run_that_stops_leaves_the_reason(deck: Path) -> None:
    deck.write_text(
        DECK.replace("[grid]\nnodes_in_radius = 12", '[grid]\nspacing = "60 um"\nwindow = [9, 9]')
    )
    code, _, error = command("run", deck, "-o", deck.parent / "a.nc", "--log-file", deck.parent / "run.log")
    assert code == 2
    level, message = read(deck.parent / "run.log")[-1]
    assert level == "ERROR"
    assert "grid.window = [9, 9]: the window is smaller than the contact" in message
    assert words(message)["reason"] in error


def test_a_step_that_does_not_converge_is_one_line(deck: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    original = FrictionalContact.advance

    def hasty(self: FrictionalContact, *arguments: Any, **options: Any) -> Any:
        return original(self, *arguments, **options, max_sweeps=1, max_cuts=0)

    monkeypatch.setattr(FrictionalContact, "advance", hasty)
    place = deck.parent / "run.log"
    code, _, error = command("run", deck, "-o", deck.parent / "a.nc", "--log-file", place)
    assert code == 3
    [stopped] = [message for level, message in read(place) if level == "ERROR"]
    assert "did not converge" in stopped
    assert "did not converge" in error


def test_a_message_of_several_lines_is_one_in_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    before = time.time()
    try:
        with log.log_to(tmp_path / "log", None):
            log.logger.warning("one\ntwo")
    finally:
        monkeypatch.undo()
        time.tzset()
    assert read(tmp_path / "log") == [("WARNING", "one; two")]
    told = time.strptime((tmp_path / "log").read_text()[:19], "%Y-%m-%dT%H:%M:%S")
    assert abs(calendar.timegm(told) - before) < 60  # UTC, wherever we are


def test_a_wrong_deck_is_in_the_log_too(deck: Path) -> None:
    deck.write_text(DECK.replace("[grid]", "[grit]"))
    code, _, error = command("run", deck, "-o", deck.parent / "a.nc", "--log-file", deck.parent / "run.log")
    assert code == 2
    [(level, message)] = read(deck.parent / "run.log")
    assert level == "ERROR"
    assert "grit: unknown key" in words(message)["reason"]
    assert "grit: unknown key" in error


def test_a_log_in_the_output_that_the_deck_names_is_refused(deck: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(deck.parent)
    deck.write_text(DECK + '[output]\nfile = "a.nc"\n')
    assert command("run", deck, "-q")[0] == 0
    whole = Path("a.nc").read_bytes()
    code, _, error = command("run", deck, "--overwrite", "--log-file", "a.nc")
    assert (code, "a.nc: exists and is no log" in error) == (2, True)
    assert Path("a.nc").read_bytes() == whole
    Path("a.nc").unlink()
    code, _, error = command("run", deck, "--log-file", "a.nc")
    assert (code, "expected a file of its own" in error) == (2, True)


def test_resume_goes_on_in_the_same_log(deck: Path) -> None:
    output, place = deck.parent / "out.nc", deck.parent / "run.log"

    class Stopped(Exception):
        pass

    def stop(step: Any) -> None:
        if step.number == 2:
            raise Stopped

    with pytest.raises(Stopped):
        Case.from_toml(deck).run(output, on_step=stop)
    assert command("resume", output, "--log-file", place)[0] == 0
    messages = [message for _, message in read(place)]
    assert words(messages[0])["done"] == "2"
    assert [words(line)["step"] for line in messages if line.startswith("step=")] == ["3/5", "4/5", "5/5"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("--log-file", "no/such/folder.log"),
            "--log-file no/such/folder.log: cannot be written: No such file",
        ),
        (("--log-file", "."), r"--log-file \.: cannot be written: Is a directory"),
        (("--log-file", "deck.toml"), "--log-file deck.toml: expected a file of its own, not .*deck.toml"),
        (("--log-file", "link.toml"), "--log-file link.toml: expected a file of its own, not .*deck.toml"),
        (("--log-file", "other.txt"), "--log-file other.txt: exists and is no log; expected a new file, or"),
        (("--log-file", "out.nc"), "--log-file out.nc: expected a file of its own, not .*out.nc"),
        (("--quiet", "--log-level", "info"), "--log-level: expected --log-file with it"),
        (("--log-level", "loud"), "loud"),
    ],
)
def test_a_log_that_cannot_be_is_refused_before_anything_runs(
    arguments: tuple[str, ...], sentence: str, deck: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(deck.parent)
    (deck.parent / "link.toml").symlink_to(deck)
    (deck.parent / "other.txt").write_text("what somebody wrote\n")
    code, out, error = command("run", "deck.toml", "-o", "out.nc", *arguments)
    assert (code, out) == (2, "")
    assert re.search(sentence, error)
    assert sorted(path.name for path in deck.parent.iterdir()) == ["deck.toml", "link.toml", "other.txt"]
    assert (deck.parent / "other.txt").read_text() == "what somebody wrote\n"
    assert deck.read_text() == DECK


def test_a_log_that_cannot_be_read_is_refused_by_that_reason(
    deck: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As one of mode 0200, which the owner may write only."""
    place, opened = deck.parent / "run.log", Path.open

    def refused(path: Path, mode: str = "r", *more: Any) -> Any:
        if path == place and mode == "rb":
            raise PermissionError(13, "Permission denied")
        return opened(path, mode, *more)

    place.touch()
    monkeypatch.setattr(Path, "open", refused)
    code, _, error = command("run", deck, "-o", deck.parent / "a.nc", "--log-file", place)
    assert code == 2
    assert "cannot be read, so that it may be no log to append to: Permission denied" in " ".join(
        error.split()
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_under_the_log_does_not_stop_the_run(deck: Path) -> None:
    code, _, error = command("run", deck, "-o", deck.parent / "a.nc", "-q", "--log-file", "/dev/full")
    assert code == 0
    assert error.splitlines() == ["hexcontact: warning: cannot write /dev/full: No space left on device"]
    assert open_result(deck.parent / "a.nc").complete


def test_an_interrupted_run_says_so_in_its_log(deck: Path) -> None:
    place = deck.parent / "run.log"
    words_ = [sys.executable, "-m", "hexcontact", "run", deck.name, "-q", "--log-file", place.name]
    deck.write_text(DECK.replace("steps = 4", "steps = 4000"))
    process = subprocess.Popen(words_, cwd=deck.parent, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True)
    wait_for(lambda: place.exists() and place.read_text().count("step=") > 3)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 143
    level, message = read(place)[-1]
    assert (level, words(message)["reason"]) == ("ERROR", "interrupted (SIGTERM)")
    assert int(words(message)["done"]) >= 3


def test_a_study_logs_its_cases(tmp_path: Path) -> None:
    (tmp_path / "deck.toml").write_text(DECK.replace("nodes_in_radius = 12", "nodes_in_radius = 4"))
    (tmp_path / "study.toml").write_text(
        'deck = "deck.toml"\n[[parameter]]\nkey = "friction.coefficient"\nvalues = [0.2, 0.01]\n'
    )
    place = tmp_path / "study.log"
    bad = tmp_path / "study.toml"
    bad.write_text(bad.read_text().replace("0.01", "0.3"))
    output = tmp_path / "study.nc"
    assert command("study", bad, "-o", output, "--jobs", 1, "-q", "--log-file", place)[0] == 0
    messages = [message for _, message in read(place)]
    assert words(messages[0]) | {"output": ""} == {
        "title": "study",
        "cases": "2",
        "missing": "2",
        "output": "",
    }
    assert [line.split(" ")[0] for line in messages[1:]] == ["case=1/2", "case=2/2"]
    assert words(messages[1])["parameters"] == "friction.coefficient = 0.2"


def test_level_names_are_those_of_the_option() -> None:
    from hexcontact.cli.frame import LogLevel

    assert all(hasattr(logging, level.value.upper()) for level in LogLevel)
    with pytest.raises(DeckError, match="cannot be written"), log.log_to(Path("/no/folder/x"), None):
        pass


def test_the_parser_leaves_it_to_the_command_whether_a_log_can_be_read(
    deck: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Plain words, which it does not see, have the same answer; the superuser can read all files."""
    place = deck.parent / "run.log"
    place.touch()
    monkeypatch.setattr(os, "access", lambda path, mode, **_: mode != os.R_OK)
    assert command("run", deck, "-o", deck.parent / "a.nc", "-q", "--log-file", place) == (0, "", "")
