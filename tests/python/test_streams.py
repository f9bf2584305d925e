"""The command with standard streams that are closed, full or not read, few descriptors, odd names."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from commands import DECK, ENVIRONMENT

from hexcontact.result.store import open_result

COMMAND = f"{shlex.quote(sys.executable)} -m hexcontact"
FULL = "No space left on device"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("streams")
    (place / "sphere.toml").write_text(DECK)
    shell(place, f"{COMMAND} run sphere.toml -q -o done.nc", code=0)
    return place


def shell(place: Path, words: str, code: int) -> subprocess.CompletedProcess[str]:
    """Run a line of bash; the last thing it prints on standard error is the code of the command."""
    done = subprocess.run(
        ["bash", "-c", words], cwd=place, env=ENVIRONMENT, capture_output=True, text=True, timeout=120
    )
    told = done.stdout + done.stderr
    assert "Traceback" not in told, told
    assert "Exception ignored" not in told, told
    assert "NoneType" not in told, told
    assert done.returncode == code, told
    return done


@pytest.mark.parametrize("streams", [">&-", "2>&-", "<&- >&- 2>&-", "2>/dev/full", "2>&1 | true"])
def test_a_run_that_nobody_hears_is_done(folder: Path, streams: str) -> None:
    out = folder / "out.nc"
    shell(folder, f"set -o pipefail; {COMMAND} run sphere.toml --overwrite -o {out.name} {streams}", code=0)
    assert open_result(out).complete
    assert not (folder / "out.nc.d").exists()
    out.unlink()


@pytest.mark.parametrize("words", ["info done.nc", "schema", "info done.nc --json"])
@pytest.mark.parametrize(("streams", "code"), [("| true", 0), (">&-", 0), (">/dev/full", 4)])
def test_what_is_printed_may_be_lost(folder: Path, words: str, streams: str, code: int) -> None:
    done = shell(folder, f"set -o pipefail; {COMMAND} {words} {streams}", code)
    assert done.stdout == ""
    told = f"hexcontact: cannot write to standard output: {FULL}\n"
    assert done.stderr == (told if code else "")


def test_a_first_line_is_enough(folder: Path) -> None:
    done = shell(folder, f"set -o pipefail; {COMMAND} info done.nc | head -1", code=0)
    assert (done.stdout.strip(), done.stderr) == ("A sphere", "")


def test_a_run_whose_table_is_lost_has_its_result(folder: Path) -> None:
    done = shell(folder, f"{COMMAND} run sphere.toml -o full.nc > /dev/full", code=4)
    assert done.stderr.splitlines()[-1] == f"hexcontact: cannot write to standard output: {FULL}"
    assert open_result(folder / "full.nc").complete


@pytest.mark.parametrize("streams", ["2>&-", "2>/dev/full", "2> >(true)", ">/dev/full"])
def test_a_failure_keeps_its_code(folder: Path, streams: str) -> None:
    """What cannot be said is not said on standard output instead."""
    done = shell(folder, f"{COMMAND} run nothing.toml {streams}", code=2)
    assert done.stdout == ""


def test_json_alone_comes_out_where_errors_are_closed(folder: Path) -> None:
    done = shell(folder, f"{COMMAND} run nothing.toml --json 2>&-", code=2)
    assert json.loads(done.stdout)["exit_code"] == 2


# --- few descriptors --------------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [6, 7, 8, 9])
def test_few_descriptors_are_told_and_leave_a_run_that_can_go_on(folder: Path, limit: int) -> None:
    out = folder / f"few{limit}.nc"
    words = f"ulimit -n {limit}; {COMMAND} run sphere.toml -q -o {out.name}"
    done = subprocess.run(
        ["bash", "-c", words], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=120
    )
    assert "Traceback" not in done.stderr, done.stderr
    assert done.returncode in (0, 4), done.stderr
    if done.returncode == 4:
        assert "Too many open files" in done.stderr
    if not out.exists():
        verb = "resume" if (folder / f"{out.name}.d" / "000001.npz").exists() else "run"
        target = out.name if verb == "resume" else f"sphere.toml -o {out.name}"
        shell(folder, f"{COMMAND} {verb} {target} -q", code=0)
    assert open_result(out).complete


# --- names ------------------------------------------------------------------------------------------------


def test_names_that_are_no_text_get_a_sentence(tmp_path: Path) -> None:
    """Files are bytes to the system, and é in Latin-1 is no UTF-8: decks may be called so, netCDF not."""
    name = os.fsdecode(b"sph\xe9re")
    (tmp_path / f"{name}.toml").write_text(DECK)
    deck = shlex.quote(f"{name}.toml")
    refusal = "sph\\udce9re.nc: is no name in UTF-8; expected a netCDF file\n"
    (tmp_path / f"{name}.nc").write_bytes(b"")
    for words in (f"run {deck}", f"info {shlex.quote(name)}.nc", f"resume {shlex.quote(name)}.nc"):
        done = shell(tmp_path, f"{COMMAND} {words}", code=2)
        assert done.stderr.startswith("hexcontact: ")
        assert done.stderr.endswith(refusal)
    (tmp_path / f"{name}.nc").unlink()
    done = shell(tmp_path, f"{COMMAND} run {deck} -o a.nc --log-file {shlex.quote(name)}.log", code=0)
    assert "written: a.nc" in done.stdout
    assert sorted(os.listdir(os.fsencode(tmp_path))) == [b"a.nc", b"sph\xe9re.log", b"sph\xe9re.toml"]
    done = shell(tmp_path, f"{COMMAND} run {deck} -o b.nc --set title={shlex.quote(name)}", code=2)
    last = 'hexcontact: override: title = "sph\\udce9re": expected text in quotes'
    assert done.stderr.splitlines()[-1] == last
