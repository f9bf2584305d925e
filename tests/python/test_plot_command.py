"""The command ``hexcontact plot``: its options, its help, and what it says to what cannot be drawn."""

import inspect
import io
import re
from pathlib import Path
from typing import Any

import drawn
import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from hexcontact import Case, open_result, plotting
from hexcontact.cli import frame
from hexcontact.cli import plot as plot_command
from hexcontact.cli.app import app
from hexcontact.errors import DeckError
from hexcontact.files import MADE_BY
from hexcontact.plotting import registry
from hexcontact.plotting.registry import entries
from hexcontact.variables import MAPS

CASE = Path(__file__).parents[2] / "cases" / "hertz_spheres.toml"
pytestmark = pytest.mark.usefixtures("laid_out_once")
BODY = {"young_modulus": 210e9, "poisson_ratio": 0.3}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Spheres pressed and sheared to and fro on a coarse lattice, and pressed without friction."""
    folder = tmp_path_factory.mktemp("results")
    bodies = {
        "body_1": BODY | {"surface": {"shape": "sphere", "radius": 0.01}},
        "body_2": BODY,
        "nodes_in_radius": 6,
    }
    loads = [
        {"normal_load": 100.0},
        {"tangential_load_x": 30.0, "steps": 2},
        {"tangential_load_x": -10.0, "steps": 2},
    ]
    friction = {"friction_coefficient": 0.5, "algorithm": "incremental"}
    Case(**bodies, **friction, loads=loads, title="Sheared").run(folder / "sheared.nc")
    Case(**bodies, normal_load=100.0, title="Pressed").run(folder / "pressed.nc")
    return folder


def plot(*words: str | Path) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["plot", *map(str, words)])
    return done.exit_code, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("words", "arguments"),
    [
        (["--what", "zones", "--step", "1,2,3,5"], {"steps": [1, 2, 3, 5]}),
        (["-w", "zones", "--arrows", "traction"], {"arrows": "traction"}),
        (["-w", "tractions", "-s", "2,3,5"], {"steps": [2, 3, 5]}),
        (
            ["-w", "tractions", "--angle", "30", "--through", "10um,0um"],
            {"angle": np.pi / 6, "through": (1e-5, 0.0)},
        ),
        (["-w", "section", "--angle", "0.5rad", "--step", "-1"], {"angle": 0.5}),
        (["-w", "traction", "-s", "2,3"], {"steps": [2, 3]}),
        (["-w", "history", "--over", "tangential_load_x"], {"over": "tangential_load_x"}),
        (["-w", "outlines", "-s", "2,3"], {"steps": [2, 3]}),
        (["-w", "loop"], {}),
        ([], {}),
    ],
)
def test_the_picture_is_the_one_that_the_options_choose(
    folder: Path, tmp_path: Path, words: list[str], arguments: dict[str, Any]
) -> None:
    picture = tmp_path / "picture.png"
    code, out, err = plot(folder / "sheared.nc", *words, "-o", picture)
    assert (code, err) == (0, "")
    assert out == f"written: {picture}\n"
    draw = plotting.FIGURES[words[1] if words else "overview"]
    found, result = drawn.pixels(picture), open_result(folder / "sheared.nc")
    np.testing.assert_array_equal(found, drawn.pixels(draw(result, **arguments)))
    if arguments:
        plain = drawn.pixels(draw(result))
        assert plain.shape != found.shape or (plain != found).any()


@pytest.mark.parametrize("kind", ["pdf", "svg"])
def test_pictures_for_a_paper(
    folder: Path, tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")  # no time in the file
    picture, expected = tmp_path / f"loop.{kind}", io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "names"}):
        assert plot(folder / "sheared.nc", "-w", "loop", "-o", picture)[0] == 0
        figure = plotting.loop(open_result(folder / "sheared.nc"))
        figure.savefig(expected, format=kind, dpi=200, metadata={"Creator": MADE_BY})
    assert picture.read_bytes() == expected.getvalue()


def test_several_files(folder: Path, tmp_path: Path) -> None:
    picture = tmp_path / "zones.png"
    twice = folder / "sheared.nc", folder / "sheared.nc"
    assert plot(*twice, "-w", "zones", "-s", "2,3", "-o", picture)[0] == 0
    expected = plotting.zones([open_result(path) for path in twice], [2, 3])
    np.testing.assert_array_equal(drawn.pixels(picture), drawn.pixels(expected))
    code, _, err = plot(*twice, "-w", "loop")
    assert code == 2
    assert "--what loop shows one result; expected one FILE, not 2" in err
    code, _, err = plot(*twice, "-w", "all")
    assert code == 2
    assert "expected one FILE" in err


def test_the_default_name_is_beside_the_file(folder: Path) -> None:
    code, out, _ = plot(folder / "sheared.nc", "-w", "torsion")
    assert code == 2
    assert out == ""
    code, out, _ = plot(folder / "sheared.nc", "-w", "loop")
    assert code == 0
    assert (folder / "sheared_loop.png").exists()


REFUSED = [
    (
        "pressed",
        ["-w", "zones"],
        "cannot draw zones of .*pressed.nc: a contact without friction has no stick and slip",
    ),
    ("pressed", ["-w", "tractions"], "a contact without friction has no traction"),
    ("pressed", ["-w", "loop"], "a contact without friction has no tangential load"),
    ("sheared", ["-w", "torsion"], "there is no torque in this result"),
    ("sheared", ["-w", "zone"], "--what zone: expected overview, .*did you mean zones"),
    ("sheared", ["-w", "zones", "-s", "9"], "there is no step 9; the result has steps 1 to 5"),
    (
        "sheared",
        ["-w", "zones", "-s", "2,x"],
        "--step 2,x: expected a number of a load step, several as 10,20,30 or 10-30 or all",
    ),
    (
        "sheared",
        ["-w", "section", "-s", "1,2"],
        "--step: section shows one load step; expected one number, not 2",
    ),
    ("sheared", ["-w", "history", "-s", "1"], "--step: not an option of --what history"),
    ("sheared", ["-w", "zones", "--angle", "30"], "--angle: not an option of --what zones"),
    (
        "sheared",
        ["-w", "tractions", "--angle", "30 mm"],
        '--angle 30 mm: expected an angle .*"mm" is a length',
    ),
    (
        "sheared",
        ["-w", "tractions", "--through", "1um"],
        "--through 1um: expected two lengths such as 10um,0um",
    ),
    ("sheared", ["-w", "tractions", "--through", "1um,2N"], '--through 1um,2N: .*"N" is a force'),
    (
        "sheared",
        ["-w", "history", "--over", "load"],
        "no history of load in this result; there are normal_load",
    ),
    ("sheared", ["-w", "zones", "-o", "zones.xyz"], "cannot draw zones of .*xyz"),
]


@pytest.mark.parametrize(("name", "words", "sentence"), REFUSED)
def test_what_cannot_be_drawn_is_one_sentence(
    folder: Path, name: str, words: list[str], sentence: str
) -> None:
    code, out, err = plot(folder / f"{name}.nc", *words)
    assert code == 2
    assert out == ""
    [line] = err.splitlines()
    assert re.search(sentence, line), line


def test_all_draws_what_there_is(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, out, _ = plot(folder / "pressed.nc", "-w", "all", "-o", tmp_path / "p.pdf")
    assert code == 0
    written = {path.stem for path in tmp_path.iterdir()}
    assert written == {
        "p_overview",
        "p_pressure",
        "p_section",
        "p_boundary",
        "p_history",
        "p_stress",
        "p_trailing_edge",
    }
    assert all(drawn.strokes(path.read_bytes(), "pdf") > 100 for path in tmp_path.iterdir())
    assert "left out: zones (a contact without friction has no stick and slip zones)" in out
    # painted by test_plotting_friction.py; here the rest are names
    paint, painted = plot_command._save, ("pressure", "section", "zones")
    monkeypatch.setattr(
        plot_command,
        "_save",
        lambda figure, what, path: paint(figure, what, path) if what in painted else path.touch() or path,
    )
    code, out, _ = plot(folder / "sheared.nc", "-w", "all", "--step", "3", "-o", tmp_path / "s.png")
    assert code == 0
    left_out = re.findall(r"left out: (\w+)", out)
    assert sorted(left_out) == ["creep", "fatigue", "lines", "torsion", "wear", "worn_depth"]
    written = {path.stem[2:] for path in tmp_path.glob("s_*")}
    assert written == set(plotting.FIGURES) - {*left_out, "compliance"}
    result = open_result(folder / "sheared.nc")
    for name in ("pressure", "section", "zones"):
        found, expected = drawn.pixels(tmp_path / f"s_{name}.png"), plotting.FIGURES[name](result, 3)
        np.testing.assert_array_equal(found, drawn.pixels(expected))
    code, _, err = plot(folder / "sheared.nc", "-w", "all", "--step", "9")
    assert code == 2
    assert "there is no step 9" in err


def test_help_has_a_line_for_each_choice() -> None:
    done = CliRunner().invoke(app, ["plot", "--help"], env={"COLUMNS": "80", "TERM": "dumb"})
    lines = [line.strip() for line in done.stdout.splitlines()]
    assert len(entries()) > len(plotting.FIGURES) > 10
    assert "pyramid" not in entries()  # pictures of the theory are made by docs/images
    for name, entry in entries().items():
        assert any(re.fullmatch(rf"{name} +{re.escape(entry.help)}", line) for line in lines), name
    assert lines.index("Of a study:") < next(k for k, line in enumerate(lines) if line.startswith("study"))
    overall = CliRunner().invoke(app, ["--help"]).stdout
    assert "Draw a result, or the cases of a study." in overall and "Choices" not in overall


def test_a_figure_is_a_decorated_function(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "_ENTRIES", dict(entries()))

    @registry.figure("steps", "how many load steps there are")
    def steps(result: Any) -> Figure:
        assert matplotlib.rcParams["legend.frameon"] is False  # the style of all figures
        figure = Figure()
        figure.suptitle(f"{len(result)} load steps")
        return figure

    picture = tmp_path / "steps.png"
    assert plot(folder / "sheared.nc", "--what", "steps", "-o", picture)[0] == 0
    np.testing.assert_array_equal(drawn.pixels(picture), drawn.pixels(steps([1] * 5)))
    assert "how many load steps there are" in plot("--help")[1]
    assert "expected the FILE of a result" in plot("--what", "steps")[2]
    assert "--angle: not an option" in plot(folder / "sheared.nc", "-w", "steps", "--angle", "3")[2]


def test_every_option_belongs_to_some_picture() -> None:
    parameters = {name for draw in plotting.FIGURES.values() for name in inspect.signature(draw).parameters}
    assert {"step", "steps", "angle", "through", "over", "arrows", "result", "results"} <= parameters


def test_options_are_read() -> None:
    labels = ["press", "to, fro", "to, fro", "press", "press"]
    assert frame.steps_of("3, 4,-1", labels) == [3, 4, -1]
    assert frame.steps_of("2-4, -1", labels) == [2, 3, 4, -1]
    assert frame.steps_of("all", labels) == [1, 2, 3, 4, 5]
    assert frame.steps_of("press", labels) == [1, 5]  # the last step of each segment
    assert frame.steps_of("to, fro", labels) == [3]
    assert frame.steps_of("press,2", labels) == [1, 5, 2]
    with pytest.raises(DeckError, match=r'--step shear: .* all or a label \("press" or "to, fro"\)'):
        frame.steps_of("shear", labels)
    with pytest.raises(DeckError, match="--cycle first: expected a number of a cycle, several as .* or all"):
        frame.steps_of("first", [""], "cycle")
    assert plot_command.angle_of("30") == pytest.approx(np.pi / 6)
    assert plot_command.angle_of("0.5 rad") == 0.5
    assert plot_command.point_of("10 um, -1e-3") == pytest.approx((1e-5, -1e-3))
    with pytest.raises(DeckError, match=r"--angle thirty: expected an angle such as 30 or 0\.5rad"):
        plot_command.angle_of("thirty")


@pytest.mark.parametrize(("kind", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_kind_of_picture_by_option_and_by_name(folder: Path, tmp_path: Path, kind: str, start: bytes) -> None:
    code, out, err = plot(folder / "pressed.nc", "--what", "pressure", "--format", kind)
    target = folder / f"pressed_pressure.{kind}"
    assert (code, out, err) == (0, f"written: {target}\n", "")
    assert target.read_bytes().startswith(start)
    if kind == "png":
        expected = plotting.pressure_field(open_result(folder / "pressed.nc"))
        np.testing.assert_array_equal(drawn.pixels(target), drawn.pixels(expected))
    named = tmp_path / f"own.{kind}"
    assert plot(folder / "pressed.nc", "-w", "section", "-o", named)[0] == 0
    assert named.read_bytes().startswith(start)


def test_all_pictures_have_the_kind_asked_for(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    some = ("pressure", "section", "history")  # every figure is drawn above
    monkeypatch.setattr(registry, "_ENTRIES", {name: entries()[name] for name in some})
    code, out, _ = plot(folder / "pressed.nc", "--what", "all", "-f", "svg")
    names = re.findall(r"written: (.*)", out)
    assert code == 0 and len(names) == 3 and all(name.endswith(".svg") for name in names)
    assert all(drawn.strokes(Path(name).read_bytes(), "svg") > 100 for name in names)


def test_name_and_kind_of_a_picture_are_not_both_given(folder: Path, tmp_path: Path) -> None:
    code, _, err = plot(folder / "pressed.nc", "-o", tmp_path / "a.png", "-f", "pdf")
    assert code == 2 and "--format pdf: the name of --output" in err and not list(tmp_path.iterdir())


def test_every_field_of_the_table_with_a_title_has_a_map() -> None:
    alone = {names[0] for names in MAPS.values() if len(names) == 1}
    assert alone >= {"pressure", "accumulated_slip"}
    assert alone <= set(plotting.FIGURES)


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_only_own_pictures_are_replaced(folder: Path, tmp_path: Path, kind: str) -> None:
    picture = tmp_path / f"mine.{kind}"
    picture.touch()
    for _ in range(2):  # an empty file, then an earlier picture
        assert plot(folder / "pressed.nc", "-w", "section", "-o", picture)[0] == 0
    Figure().savefig(picture)
    foreign = picture.read_bytes()
    code, _, err = plot(folder / "pressed.nc", "-w", "section", "-o", picture)
    assert code == 2 and picture.read_bytes() == foreign
    assert f"{picture} exists and was not made by hexcontact" in err


def test_a_run_does_not_replace_a_foreign_picture_or_page(tmp_path: Path) -> None:
    deck, picture, page = (tmp_path / name for name in ("hertz.toml", "hertz.png", "hertz.html"))
    deck.write_text(CASE.read_text().replace("0.02 mm", "0.1 mm"))
    out = picture.with_suffix(".nc")
    picture.write_text("a photograph")
    words = ["run", str(deck), "-o", str(out), "--plot", "-q", "--overwrite"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2 and "hertz.png exists and was not made by hexcontact" in done.stderr
    assert not out.exists()  # it is said before the work, not after it
    picture.unlink()
    for _ in range(2):
        assert CliRunner().invoke(app, words).exit_code == 0
        assert CliRunner().invoke(app, ["report", str(out), "-o", str(page)]).exit_code == 0
    page.write_text("<p>made by hand</p>")
    done = CliRunner().invoke(app, ["report", str(out), "-o", str(page)])
    assert done.exit_code == 2 and "hertz.html exists and was not made by hexcontact" in done.stderr
    assert page.read_text() == "<p>made by hand</p>"
