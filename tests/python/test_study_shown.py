"""What `info`, `plot` and `export` make of the result of a study."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure
from typer.testing import CliRunner

from hexcontact import DeckError
from hexcontact.cli.app import app
from hexcontact.plotting.history import study as draw
from hexcontact.study.dataset import read_study, study_of
from hexcontact.study.study import Study

DECK = """
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
rigid = true
[grid]
nodes_in_radius = 4
[[load]]
normal_load = "100 N"
steps = 2
"""
GRID = """
title = "Loads and radii"
deck = "deck.toml"
{}
[[parameter]]
key = "load.1.normal_load"
name = "P"
values = ["50 N", "0.1 kN"]
[[parameter]]
key = "body.1.surface.radius"
name = "radius"
values = ["5 mm", "10 mm", "20 mm"]
"""


def command(*words: str) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, [*words])
    return done.exit_code, done.stdout, done.stderr


def solved(folder: Path, text: str, cases: int) -> None:
    """Solve the first cases of a study in this process, and combine them."""
    (folder / "deck.toml").write_text(DECK)
    (folder / "study.toml").write_text(text)
    study = Study.from_toml(folder / "study.toml", folder / "study.nc")
    for number in range(1, cases + 1):
        assert study.run_case(number).exit_code == 0
    study.collect()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    solved(folder, GRID.format(""), 6)
    return folder


def test_info_prints_the_table(folder: Path) -> None:
    code, out, err = command("info", str(folder / "study.nc"))
    lines = out.splitlines()
    assert (code, err) == (0, "")
    assert lines[:2] == ["Loads and radii", "study of 6 cases (2 P x 3 radius): 6 done"]
    assert lines[2].split()[:5] == ["case", "P", "radius", "approach", "max_pressure"]
    assert lines[4].split()[:5] == ["2", "50.00", "N", "10.00", "mm"]
    with xarray.open_dataset(folder / "study.nc") as study:
        approach = float(study.approach.sel(P=50.0, radius=0.01))
    assert f"{approach * 1e6:.3f} µm" in lines[4]
    assert len(lines) == 10
    assert command("info", str(folder / "study"))[1] == out  # the folder of the cases
    code, out, _ = command("info", str(folder / "study.nc"), "--json")
    content = json.loads(out)
    assert content["parameters"]["radius"] == {"deck_key": "body.1.surface.radius", "units": "m"}
    assert [case["case_number"] for case in content["cases"]] == [1, 2, 3, 4, 5, 6]
    assert content["cases"][1]["approach"] == approach


def test_export_writes_the_table(folder: Path, tmp_path: Path) -> None:
    code, out, _ = command("export", str(folder / "study.nc"), "--csv", "-o", str(tmp_path / "to"))
    target = tmp_path / "to/study_cases.csv"
    assert (code, out) == (0, f"written: {target}\n")
    with target.open() as file:
        rows = list(csv.DictReader(file))
    with xarray.open_dataset(folder / "study.nc") as study:
        assert [float(row["max_pressure [Pa]"]) for row in rows] == study.max_pressure.values.ravel().tolist()
    assert {row["status"] for row in rows} == {"done"}
    assert [row["radius [m]"] for row in rows] == 2 * ["0.005", "0.01", "0.02"]
    code, _, err = command("export", str(folder / "study.nc"), "--vtk", "--csv")
    assert code == 2 and "is the result of a study, which has no fields; expected --csv alone" in err


def test_all_steps_are_rows_and_the_last_one_is_shown(tmp_path: Path) -> None:
    text = GRID.format('steps = "all"\ncombine = "zip"').replace('"20 mm"', "").replace('mm", ]', 'mm"]')
    steps = '[[parameter]]\nkey = "load.1.steps"\nname = "count"\nvalues = [1, 3]\n'
    solved(tmp_path, text + steps, 2)
    assert command("export", str(tmp_path / "study.nc"), "--csv")[0] == 0
    with (tmp_path / "study_export/study_cases.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["case_number"], row["step"]) for row in rows] == [("1", "1"), *(("2", n) for n in "123")]
    lines = command("info", str(tmp_path / "study.nc"))[1].splitlines()
    assert lines[1] == "study of 2 cases: 2 done; the last load step of each"
    last = float(rows[-1]["approach [m]"])
    assert lines[4].split()[0] == "2" and f"{last * 1e6:.3f} µm" in lines[4]
    figure = draw(read_study(tmp_path / "study.nc"), ["approach"], "P")
    [line] = figure.axes[0].get_lines()
    assert line.get_linestyle() == "None"
    np.testing.assert_allclose(line.get_ydata()[-1], last * 1e6, rtol=1e-12)


def test_unfinished_cases_are_named(tmp_path: Path) -> None:
    solved(tmp_path, GRID.format(""), 2)
    lines = command("info", str(tmp_path / "study.nc"))[1].splitlines()
    assert lines[1] == "study of 6 cases (2 P x 3 radius): 2 done, 4 missing"
    assert lines[2].split()[-1] == "status"
    assert lines[5].split()[-2:] == ["-", "missing"]
    figure = draw(read_study(tmp_path / "study.nc"))  # gaps where cases are missing
    assert len(figure.axes) > 1
    (tmp_path / "study.nc").unlink()
    code, _, err = command("info", str(tmp_path / "study"))
    assert code == 2 and "holds the cases of a study; hexcontact study STUDY.toml combines them" in err


def test_plot_draws_curves_over_a_parameter(folder: Path, tmp_path: Path) -> None:
    assert study_of(folder / "study.nc") == folder / "study.nc"
    data = read_study(folder / "study.nc")
    figure = draw(data)
    assert isinstance(figure, Figure)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "radius (mm)" and axes.get_ylabel() == "approach (µm)"
    low, high = axes.get_lines()
    np.testing.assert_allclose(low.get_xdata(), [5.0, 10.0, 20.0])
    np.testing.assert_allclose(high.get_ydata(), data.approach.sel(P=100.0) * 1e6)
    assert [line.get_label() for line in (low, high)] == ["P 50.00 N", "P 100.0 N"]
    for words in (["--over", "P"], ["--what", "study", "--format", "pdf"]):
        code, out, err = command("plot", str(folder / "study.nc"), *words)
        assert (code, err) == (0, "")
        assert Path(out.removeprefix("written: ").strip()).stat().st_size > 1000
    with pytest.raises(ValueError, match="over = 'load': expected P or radius"):
        draw(data, over="load")


def test_axes_are_logarithmic_by_decades_and_errors_are_bars(folder: Path) -> None:
    data = read_study(folder / "study.nc")
    data = data.assign_coords(radius=("radius", [2.0, 10.0, 40.0], data.radius.attrs))
    power = (data.radius**1.5 * 1e-6 * xarray.ones_like(data.approach)).assign_attrs(units="m2")
    made = data.assign(contact_area=power, contact_area_error=0.2 * power)
    area, approach = draw(made, ["contact_area", "approach"], over="radius").axes
    assert (area.get_xscale(), area.get_yscale()) == ("log", "log")
    assert (approach.get_xscale(), approach.get_yscale()) == ("log", "linear")
    bars = [np.array(bar.get_segments())[:, :, 1] for bar in area.collections]
    assert len(bars) == 2 and not approach.collections
    middle = area.lines[0].get_ydata()
    np.testing.assert_allclose(bars[0], np.outer(middle, [0.8, 1.2]))
    evenly = made.assign_coords(radius=("radius", [2.0, 21.0, 40.0], data.radius.attrs))
    even = draw(evenly, ["contact_area"], "radius")
    assert (even.axes[0].get_xscale(), even.axes[0].get_yscale()) == ("linear", "linear")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--what", "pressure"], "is the result of a study; expected --what study"),
        (["--over", "load"], "over = 'load': expected P or radius"),
        (["--step", "2"], "--step: not an option of --what study"),
    ],
)
def test_other_pictures_of_a_study_are_refused(folder: Path, words: list[str], sentence: str) -> None:
    code, _, err = command("plot", str(folder / "study.nc"), *words)
    assert code == 2 and sentence in err


def test_a_folder_that_holds_no_study_is_none(tmp_path: Path) -> None:
    assert study_of(tmp_path) is None
    assert study_of(tmp_path / "missing.nc") is None
    with pytest.raises(DeckError, match="no_study"):
        (tmp_path / "no_study.nc").write_text("text")
        read_study(tmp_path / "no_study.nc")
