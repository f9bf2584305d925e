"""Text and files that are made to do harm: shown as text, or refused in one sentence, never obeyed."""

import csv
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import pytest
from click.testing import Result as Done
from typer.testing import CliRunner

from hexcontact import Case, DeckError, Study, open_result
from hexcontact.cli.app import app
from hexcontact.cli.frame import beside
from hexcontact.core.lattice import Lattice
from hexcontact.deck.read import MOST_INCLUDED, MOST_SERIES
from hexcontact.deck.series import MOST_STEPS, read_series
from hexcontact.files import LARGEST_TEXT, text_of
from hexcontact.result.journal import Journal
from hexcontact.solve.events import Bar
from hexcontact.text import Table, visible

OBEYED = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ufffe\uffff]"
)  # by terminals, or not XML
HOSTILE = '\x1b]0;x\x07 \x9b31m \u202e \x00 --- -- ]]> <b>&" $\\foo_{ $ [/red] \ufffe \x7f\r!'
FORMULA = "=cmd|'/c calc'!A0 \x1b[2J"
STEEL: dict[str, Any] = {"young_modulus": 210e9, "poisson_ratio": 0.3}
BODIES: dict[str, Any] = {
    "body": {"1": STEEL | {"surface": {"shape": "sphere", "radius": 0.01}}, "2": STEEL},
    "friction": {"coefficient": 0.3},
    "grid": {"nodes_in_radius": 4},
}
PRESS = "[[load]]\nnormal_load = 10\n"


def toml(tables: dict[str, Any]) -> str:
    """Return tables as TOML; JSON text is TOML text."""

    def value(entry: Any) -> str:
        if isinstance(entry, dict):
            return "{" + ", ".join(f"{json.dumps(key)} = {value(e)}" for key, e in entry.items()) + "}"
        if isinstance(entry, list):
            return "[" + ", ".join(map(value, entry)) + "]"
        return json.dumps(entry).replace("\x7f", "\\u007f")

    return "".join(f"{json.dumps(key)} = {value(entry)}\n" for key, entry in tables.items())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The current folder; who waits for a pipe here is woken."""
    monkeypatch.chdir(tmp_path)

    def wake(number: int, frame: Any) -> None:
        raise AssertionError("somebody waits for ever")

    before = signal.signal(signal.SIGALRM, wake)
    signal.alarm(300)
    yield tmp_path
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def command(*words: str | Path) -> Done:
    return CliRunner().invoke(app, [*map(str, words)])


def sentence(*words: str | Path) -> str:
    """Return what a command that is refused says."""
    done = command(*words)
    assert done.exit_code == 2, done.output
    assert "Traceback" not in done.stderr
    return done.stderr


# --- text ---------------------------------------------------------------------------------------------------


def test_control_characters_are_shown() -> None:
    assert (
        visible("a\x1b[31m\x9b\x00\u2028\u202e\udcff\r") == r"a\u001b[31m\u009b\u0000\u2028\u202e\udcff\u000d"
    )
    plain = "Kugel, \u00b5m\u00a0\u2192 \u4e2d \U0001f600\tx\n\r\ny"
    assert visible(plain) == plain


@pytest.fixture
def result(folder: Path) -> Path:
    """A result whose title and labels are hostile."""
    loads = [{"normal_load": 10, "steps": 2, "label": HOSTILE}, {"tangential_load_x": 1, "label": FORMULA}]
    Path("deck.toml").write_text(toml({"title": HOSTILE, **BODIES, "load": loads}), encoding="utf-8")
    done = command("run", "deck.toml", "--log-file", "run.log")
    assert done.exit_code == 0, done.output
    assert not OBEYED.search(done.output)
    log = Path("run.log").read_text()
    assert r"\u001b" in log
    assert not OBEYED.search(log)
    return Path("deck.nc")


def test_no_text_of_a_deck_or_a_result_commands_a_terminal(result: Path) -> None:
    moved = Path("a\x1b[31m.nc")
    shutil.copy(result, moved)
    Path("key.toml").write_text(toml({"a\x1b[1mb": 1, "title": HOSTILE}))
    Path("text.toml").write_bytes(b'title = "\x1b"')
    Path("study.toml").write_text(
        toml(
            {
                "title": HOSTILE,
                "deck": "deck.toml",
                "parameter": [{"key": "load.1.label", "values": [HOSTILE, FORMULA]}],
            }
        )
    )
    calls = {
        ("check", "deck.toml"): 0,
        ("check", "key.toml"): 2,
        ("check", "text.toml"): 2,
        ("check", "deck.toml", "--set", "a\x1b=1"): 2,
        ("check", "deck.toml", "--json"): 0,
        ("run", "deck.toml", "-o", "a.nc", "--log-level", "info"): 0,
        ("run", "deck.toml", "-o", "b.nc", "--json"): 0,
        ("run", "deck.toml"): 2,
        ("info", result): 0,
        ("info", moved): 0,
        ("info", result, "--json"): 0,
        ("resume", result): 0,
        ("report", moved): 0,
        ("export", moved, "--csv"): 0,
        ("plot", moved): 0,
        ("study", "study.toml", "--jobs", "1"): 0,
        ("study", "study.toml", "--slurm", "--retry"): 0,
    }
    for words, code in calls.items():
        done = command(*words)
        assert done.exit_code == code, (words, done.output)
        assert not OBEYED.search(done.output), words
    assert json.loads(command("info", result, "--json").stdout)["title"] == HOSTILE.replace("\0", "")


def test_tables_of_notebooks_and_of_repr_show_text_as_text(result: Path) -> None:
    found = open_result(result)
    for text in (repr(found), found._repr_html_(), repr(Case.from_toml("deck.toml"))):
        assert not OBEYED.search(text)
    assert str(Table(("", ""), [(HOSTILE, "1")])).startswith(r"\u001b]0;x")
    assert r"\u001b]0;x\u0007" in Table(("", ""), [], HOSTILE)._repr_html_()


def test_a_bar_takes_titles_as_text(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    bar = Bar()
    with bar.following(HOSTILE, 3):
        bar.said("errors", FORMULA)
        bar.lattice("lattice 2", Lattice(1e-3, 0, 0, 2, 2), shifted=False)
    shown = capsys.readouterr().err
    assert not set(OBEYED.findall(shown)) - {"\x1b", "\r"}  # of the bar itself
    assert r"\u001b]0;x" in shown
    assert "\x1b]0" not in shown


def test_xml_and_pages_of_hostile_titles_are_well_formed(result: Path) -> None:
    assert command("export", result, "--vtk", "-o", "vtk").exit_code == 0
    assert command("report", result).exit_code == 0
    assert command("plot", result, "-f", "svg").exit_code == 0
    for path in (*Path("vtk").iterdir(), Path("deck_overview.svg")):
        ET.parse(path)
    text = next(Path("vtk").glob("*_0001.vtu")).read_text()
    assert r"\u001b]0;x" in text
    page = Path("deck.html").read_text()
    assert not OBEYED.search(page)
    assert "<b>&" not in page


def test_tables_for_spreadsheets_hold_no_formulas(result: Path) -> None:
    assert command("export", result, "--csv", "-o", "csv").exit_code == 0
    with open("csv/deck_history.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["label"] for row in rows] == [visible(HOSTILE)] * 2 + ["'" + visible(FORMULA)]
    numbers = {name: row[name] for row in rows[-1:] for name in row if name != "label"}
    assert min(map(float, numbers.values())) < 0.0
    assert not any(value.startswith("'") for value in numbers.values())


@pytest.mark.parametrize("label", ["=1+1", "+1", "-1+1", "@SUM(A1)", "\t=1", " =1"])
def test_every_beginning_of_a_formula_is_quoted(label: str, folder: Path) -> None:
    loads = [{"normal_load": 10.0, "label": label}]
    Case.from_dict({**BODIES, "load": loads}).run("a.nc")
    assert command("export", "a.nc", "--csv", "-o", "csv").exit_code == 0
    with open("csv/a_history.csv", newline="") as file:
        assert next(csv.DictReader(file))["label"] == "'" + visible(label)


@pytest.mark.parametrize("title", ["costs $5 and $10", r"$\frac{$", r"$x_{ $ and \\$", "$"])
def test_dollars_of_titles_begin_no_formula(title: str, folder: Path) -> None:
    Case.from_dict({**BODIES, "title": title, "load": [{"normal_load": 10.0}]}).run("a.nc")
    done = command("plot", "a.nc")
    assert done.exit_code == 0, done.output


def test_halves_of_characters_are_refused_where_they_enter(folder: Path) -> None:
    with pytest.raises(DeckError, match='title = ".*": expected text in quotes'):
        Case.from_dict({**BODIES, "title": "\udcff", "load": [{"normal_load": 10.0}]})


@pytest.mark.parametrize("name", ["a/b", "a\x1b", "", "a ", "\u2028", "+1"])
def test_names_of_parameters_can_stand_in_the_result(name: str, folder: Path) -> None:
    deck = {**BODIES, "load": [{"normal_load": 10.0}]}
    parameter = {"key": "load.1.normal_load", "name": name, "values": [1.0, 2.0]}
    with pytest.raises(DeckError, match=r"parameter.1.name = .*: expected a name of letters, digits and _"):
        Study(deck, [parameter])


# --- names --------------------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
def test_names_that_are_not_utf_8_end_in_a_sentence(folder: Path) -> None:
    Path("deck.toml").write_text(toml(BODIES) + PRESS)
    Path("study.toml").write_text(
        toml({"deck": "deck.toml", "parameter": [{"key": "load.1.normal_load", "values": [1, 2]}]})
    )
    odd = os.fsdecode(b"\xff")
    shutil.copy("deck.toml", f"{odd}.toml")
    assert command("run", "deck.toml").exit_code == 0
    shutil.copy("deck.nc", f"{odd}.nc")
    words = [
        ("run", f"{odd}.toml"),
        ("run", "deck.toml", "-o", f"{odd}.nc"),
        ("run", "deck.toml", "-o", "x.nc", "--set", f"title={odd}"),
        ("info", f"{odd}.nc"),
        ("plot", f"{odd}.nc"),
        ("resume", f"{odd}.nc"),
        ("export", "deck.nc", "--ugrid", "-o", odd),
        ("study", "study.toml", "-o", f"{odd}.nc"),
        ("study", "study.toml", "-o", f"{odd}.nc", "--slurm"),
    ]
    for call in words:
        assert "UTF-8" in sentence(*call) or "expected text in quotes" in sentence(*call), call
    assert not list(Path().glob("*.nc.d"))


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
def test_a_folder_whose_name_is_not_utf_8_does_no_harm(folder: Path) -> None:
    place = folder / os.fsdecode(b"\xff")
    place.mkdir()
    os.chdir(place)
    Path("part.toml").write_text("[friction]\ncoefficient = 0.1\n")
    Path("deck.toml").write_text('include = ["part.toml"]\n' + toml(BODIES) + PRESS)
    assert command("check", "deck.toml").exit_code == 0
    assert "deck.nc: is no name in UTF-8; expected a netCDF file" in sentence("run", "deck.toml")
    assert sorted(path.name for path in Path().iterdir()) == ["deck.toml", "part.toml"]
    target = folder / "deck.nc"
    assert command("run", "deck.toml", "-o", target).exit_code == 0
    assert open_result(target).complete


# --- files --------------------------------------------------------------------------------------------------


def test_devices_pipes_and_endless_files_are_refused(folder: Path) -> None:
    Path("deck.toml").write_text(toml(BODIES) + PRESS)
    os.mkfifo("pipe")
    os.mkfifo("pipe.nc")
    os.symlink("/dev/zero", "zero.nc")
    for name in ("pipe", "/dev/zero", "pipe.nc", "zero.nc"):
        odd = f"{name}: is not a regular file; expected "
        Path("includes.toml").write_text(toml({"include": [name]}) + toml(BODIES) + PRESS)
        Path("series.toml").write_text(toml(BODIES | {"load": [{"series": {"file": name}}]}))
        Path("study.toml").write_text(
            toml({"deck": name, "parameter": [{"key": "load.1.normal_load", "values": [1, 2]}]})
        )
        for words in (
            ("check", name),
            ("run", name),
            ("study", name),
            ("study", "study.toml"),
            ("check", "includes.toml"),
            ("check", "series.toml"),
            ("info", name),
            ("plot", name),
            ("report", name),
            ("export", name, "--csv"),
        ):
            assert odd in sentence(*words), words
        for words in (("resume", name), ("run", "deck.toml", "-o", name, "--overwrite")):
            assert "is not a regular file" in sentence(*words), words
    assert "No such device" in sentence("run", "deck.toml", "--log-file", "pipe")  # nobody reads it
    assert "is not a regular file" in sentence("schema", "-o", "pipe")


def test_exports_go_through_no_link_and_into_no_pipe(folder: Path) -> None:
    Path("deck.toml").write_text(toml(BODIES) + PRESS)
    assert command("run", "deck.toml", "--quiet").exit_code == 0
    victim = Path("victim")
    victim.write_text("precious")
    names = ("deck_0001.vtu", "deck.pvd", "deck_ugrid.nc", "deck_history.csv", "deck_0001.csv")
    words = ("export", "deck.nc", "--vtk", "--ugrid", "--csv", "--step", "1")
    os.mkdir("deck_export")
    for name in names:
        (Path("deck_export") / name).symlink_to(victim.absolute())
    assert "was not made by hexcontact" in sentence(*words)
    assert victim.read_text() == "precious"
    victim.write_text("")  # of an empty file the link is replaced, not what it leads to
    assert command(*words).exit_code == 0
    assert victim.read_text() == ""
    assert sorted(os.listdir("deck_export")) == sorted(names)
    assert all((Path("deck_export") / name).stat().st_size > 100 for name in names)
    for name in names:
        (Path("deck_export") / name).unlink()
        os.mkfifo(Path("deck_export") / name)
        assert f"{name} is not a regular file" in sentence(*words)
        (Path("deck_export") / name).unlink()


def test_a_schema_replaces_schemas_only(folder: Path) -> None:
    Path("package.json").write_text('{"name": "mine"}')
    assert "not a hexcontact schema" in sentence("schema", "-o", "package.json")
    assert Path("package.json").read_text() == '{"name": "mine"}'
    for _ in range(2):
        assert command("schema", "-o", "deck.json").exit_code == 0
        assert command("schema", "--study", "-o", "deck.json").exit_code == 0


def test_a_study_meets_pipes_in_its_folder(folder: Path) -> None:
    Path("deck.toml").write_text(toml(BODIES) + PRESS)
    Path("study.toml").write_text(
        toml({"deck": "deck.toml", "parameter": [{"key": "load.1.normal_load", "values": [1, 2]}]})
    )
    os.mkfifo("study.nc")
    assert "study.nc: is not a regular file" in sentence("study", "study.toml")
    os.unlink("study.nc")
    assert command("study", "study.toml", "--jobs", "1").exit_code == 0
    os.unlink("study/0001.nc")
    os.mkfifo("study/0001.nc")
    assert not Study.from_toml("study.toml").folder.done(Study.from_toml("study.toml").cases[0])
    os.unlink("study/index.json")
    os.mkfifo("study/index.json")
    assert "index.json: is not a regular file" in sentence("study", "study.toml")


def test_files_have_a_largest_size(folder: Path) -> None:
    with open("large.toml", "wb") as file:
        file.truncate(LARGEST_TEXT + 1)
    assert "large.toml: is larger than 32 MB; expected a deck" in sentence("check", "large.toml")
    with open("large.toml", "wb") as file:
        file.truncate(LARGEST_TEXT)
    assert len(text_of("large.toml", "zeros")) == LARGEST_TEXT


def test_includes_that_multiply_are_stopped(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from hexcontact.deck import read as deck_assembly

    read: list[str] = []

    def read_toml(path: Path) -> Any:
        read.append(str(path))
        return tomllib.loads(path.read_text()), path.read_text()

    monkeypatch.setattr(deck_assembly, "read_toml", read_toml)
    for level in range(30):
        Path(f"{level}.toml").write_text(toml({"include": [f"{level + 1}.toml"] * 2}))
    Path("30.toml").write_text("")
    assert f"include: expected at most {MOST_INCLUDED} files and 32 MB in all" in sentence("check", "0.toml")
    assert len(read) == MOST_INCLUDED


def test_a_file_that_several_files_include_is_no_bomb(folder: Path) -> None:
    Path("steel.toml").write_text("[friction]\ncoefficient = 0.1\n")
    parts = [f"part_{number}.toml" for number in range(MOST_INCLUDED // 2)]
    for part in parts:
        Path(part).write_text('include = ["steel.toml"]\n')
    Path("deck.toml").write_text(toml({"include": parts, **BODIES}) + PRESS)
    assert Case.from_toml("deck.toml").friction_coefficient == 0.3


def test_series_are_bounded(folder: Path) -> None:
    Path("rows.csv").write_text("normal_load\n" + "1\n" * (MOST_STEPS + 1))
    with pytest.raises(
        DeckError, match=f"rows.csv: expected at most {MOST_STEPS} rows, not {MOST_STEPS + 1}"
    ):
        read_series(Path("rows.csv"))
    with netCDF4.Dataset("rows.nc", "w") as file:  # of 80 GB, none of which is written
        file.createDimension("row", 10**10)
        file.createVariable("normal_load", "f8", ("row",), zlib=True)
    with pytest.raises(DeckError, match=f"rows.nc: expected at most {MOST_STEPS} rows, not 10000000000"):
        read_series(Path("rows.nc"))
    with netCDF4.Dataset("other.nc", "w") as file:
        file.createDimension("sample", 10**10)
        file.createVariable("raw", "f8", ("sample",), zlib=True)
        file.createDimension("row", 2)
        file.createVariable("normal_load", "f8", ("row",))[:] = [1.0, 2.0]
    assert read_series(Path("other.nc")) == {"normal_load": [1.0, 2.0]}
    Path("cell.csv").write_text("normal_load\n" + "1" * 200_000 + "\n")
    with pytest.raises(DeckError, match=r"cell.csv: cannot be read \(field larger"):
        read_series(Path("cell.csv"))
    Path("one.csv").write_text("normal_load\n1\n")
    many = {**BODIES, "load": [{"series": {"file": "one.csv"}}] * (MOST_SERIES + 1)}
    with pytest.raises(DeckError, match=f"load: expected at most {MOST_SERIES} files of series"):
        Case.from_dict(many)


@pytest.mark.parametrize("device", ["pipe", "/dev/zero"])
@pytest.mark.parametrize("name", ["000001.npz", "lattices/header.json"])
def test_a_journal_holds_no_devices(name: str, device: str, folder: Path) -> None:
    Path("deck.toml").write_text(toml(BODIES) + PRESS)
    os.mkfifo("pipe")
    record = Path("deck.nc.d", name)
    record.parent.mkdir(parents=True)
    record.symlink_to(Path(device).absolute())
    for words in (("info", "deck.nc"), ("resume", "deck.nc")):
        assert f"{record.name}: is not a regular file" in sentence(*words)
    for more in ((), ("--overwrite",)):
        assert f"{record.name} may not be of hexcontact" in sentence("run", "deck.toml", *more)


def test_why_a_run_stopped_is_read_from_a_file(folder: Path) -> None:
    os.mkfifo("stopped.txt")
    assert Journal(folder).stopped == ""
    Path("stopped.txt").unlink()
    Path("stopped.txt").symlink_to("/dev/zero")
    assert Journal(folder).stopped == ""


def test_a_file_of_the_kernel_that_has_nothing_to_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Nothing(io.BufferedReader):
        def read(self, size: int | None = -1) -> bytes:
            return None  # type: ignore[return-value]  # as BufferedReader after EAGAIN

    Path("kmsg").touch()
    monkeypatch.setattr("builtins.open", lambda name, *_, **__: Nothing(io.FileIO(name)))
    assert text_of("kmsg", "a deck") == ""


def test_results_are_named_beside_the_current_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for words in (
        ("plot", "."),
        ("plot", "/"),
        ("plot", "..", "--what", "all"),
        ("report", "."),
        ("info", "."),
    ):
        assert "is a folder without finished steps" in sentence(*words)
    (folder / "deck.nc.d").mkdir()
    monkeypatch.chdir(folder / "deck.nc.d")
    assert beside(Path(), "_zones.png") == folder / "deck.nc_zones.png"
    assert beside(Path("a/x.nc"), ".html") == Path("a/x.html")


# --- what a study keeps -------------------------------------------------------------------------------------


@pytest.fixture
def study(folder: Path) -> Path:
    """A study with a note of a case that failed."""
    Path("deck.toml").write_text(toml(BODIES) + PRESS)
    Path("study.toml").write_text(
        toml({"deck": "deck.toml", "parameter": [{"key": "load.1.normal_load", "values": [1, 2]}]})
    )
    Study.from_toml("study.toml").missing()
    return Path("study/index.json")


@pytest.mark.parametrize("number", ["1e400", "1.5", "0", "-1", "2", "null", '"1"', "1" * 400, "[1]", "NaN"])
def test_a_number_in_the_index_that_is_none_gets_a_sentence(number: str, study: Path) -> None:
    study.write_text(study.read_text().replace('"number": 1,', f'"number": {number},'))
    for more in ((), ("--case", "1"), ("--collect",), ("--slurm",)):
        assert "index.json is damaged" in sentence("study", "study.toml", *more)


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"cases": 1}', '{"cases": {"a": 1}}', "[" * 100_000, "\xff"]
)
def test_an_index_that_is_none_gets_a_sentence(text: str, study: Path) -> None:
    study.write_bytes(text.encode("latin-1"))
    assert "index.json" in sentence("study", "study.toml")


@pytest.mark.parametrize(
    "change",
    [
        {"exit_code": "3"},
        {"exit_code": None},
        {"exit_code": 1e400},
        {"message": 3},
        {"message": ""},
        {"lasting": "no"},
        {"more": 1},
        '"text"',
        "[]",
        "1e400",
        "[" * 100_000,
    ],
)
def test_a_note_of_a_failure_that_is_none_is_passed_over(change: Any, study: Path) -> None:
    planned = Study.from_toml("study.toml")
    case = planned.cases[0]
    note = {"hash": case.hash, "exit_code": 3, "message": "slides", "seconds": 1.0, "lasting": True}
    path = planned.folder.path(case).with_suffix(".json")
    path.write_text(json.dumps(note))
    assert [found for found, _ in planned.failures()] == [case]
    path.write_text(change if isinstance(change, str) else json.dumps(note | change))
    assert planned.failures() == []
    assert case in planned.missing()
    assert command("study", "study.toml", "--collect").exit_code == 3


def test_a_pipe_is_not_waited_for_by_the_installed_command(folder: Path) -> None:
    os.mkfifo("pipe")
    words = [sys.executable, "-m", "hexcontact", "check", "pipe"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert done.stderr == "hexcontact: pipe: is not a regular file; expected a deck (a TOML file)\n"
