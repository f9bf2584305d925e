"""Creep tables: computed, compared with single cases, and read by C, Fortran and Python programs."""

import json
import math
import shutil
import subprocess
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

import hexcontact
from hexcontact import Case, DeckError, run_study
from hexcontact.cli.app import app
from hexcontact.creep_table import CreepTable
from hexcontact.deck.toml import as_toml

Loads = tuple[float, float, float]
LIMIT = 30.0  # mu P, N
READERS = files(hexcontact) / "data"


def ball(last: dict[str, Any], **tables: Any) -> dict[str, Any]:
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.25}
    return {
        "body": {"1": {**steel, "surface": {"shape": "sphere", "radius": 10e-3}}, "2": steel},
        "friction": {"coefficient": 0.3},
        "grid": {"nodes_in_radius": 8},
        "load": [{"normal_load": 100.0}, last],
    } | tables


STEADY = {"rolling": "steady"}


def solved(creepage_x: float, creepage_y: float, spin: float) -> Loads:
    creepages = {"creepage_x": creepage_x, "creepage_y": creepage_y, "spin": spin}
    history = Case.from_dict(ball(STEADY | creepages)).run().history.iloc[-1]
    return tuple(float(history[name]) for name in ("tangential_load_x", "tangential_load_y", "torque"))


def written(folder: Path, deck: dict[str, Any], keys: str = "") -> Path:
    (folder / "ball.toml").write_text(as_toml(deck))
    (folder / "creep.toml").write_text(f'title = "A ball"\ndeck = "ball.toml"\n[creep_table]\n{keys}')
    return folder / "creep.toml"


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The text of a table, with the netCDF file beside it."""
    folder = tmp_path_factory.mktemp("table")
    study = written(folder, ball(STEADY), "counts = [7, 13, 6]\nheld_out = 30")
    done = CliRunner().invoke(app, ["study", str(study), "-o", str(folder / "creep.nc")])
    assert done.exit_code == 0, done.output
    assert "creep.txt" in done.output and "larger counts make them smaller" in done.output
    return folder / "creep.txt"


def cases(table: CreepTable) -> list[Loads]:
    """Creepages within the table and beyond it, of all signs, and a node of it."""
    x, y, spin = (axis[-1] for axis in table.axes)
    parts = product((-0.41, 0.13, 1.7), (-0.37, 0.22, 1.4), (-0.33, 0.0, 0.71))
    return [(a * x, b * y, c * spin) for a, b, c in parts] + [(table.axes[0][2], table.axes[1][3], 0.0)]


def test_nodes_are_the_solutions_of_single_cases(table: Path) -> None:
    creep = CreepTable.read(table)
    assert creep.limit == pytest.approx(LIMIT)
    with xarray.open_dataset(table.with_suffix(".nc")) as data:
        assert data.sizes == {"xi": 7, "eta": 13, "phi": 6}
        assert float(data.operator_applications.max()) <= 60.0
        for place in ((2, 3, 0), (4, 5, 3)):
            node = data.isel(dict(zip(("xi", "eta", "phi"), place, strict=True)))
            at = [float(node[name]) for name in ("creepage_x", "creepage_y", "spin")]
            found = [float(node[name]) for name in ("tangential_load_x", "tangential_load_y", "torque")]
            assert found == pytest.approx(solved(*at), rel=1e-6, abs=1e-6)
            assert creep(*at) == pytest.approx(found, rel=1e-7, abs=1e-9)
            assert float(node.creep_power) == pytest.approx(-np.dot(at, found))


def test_the_stated_error_bounds_that_of_further_cases(table: Path) -> None:
    creep = CreepTable.read(table)
    with xarray.open_dataset(table.with_suffix(".nc")) as data:
        stated = data.attrs["interpolation_error"]
    [line] = [line for line in table.read_text().splitlines() if "errors" in line]
    assert line.endswith("over mu P: " + ", ".join(f"{100 * error:.2f} %" for error in stated))
    assert 2e-3 < max(stated) < 2e-2  # of so few values
    for at in ((-0.0012, 0.0013, -9.0), (0.003, -0.002, 22.0)):
        found, exact = creep(*at), solved(*at)
        for error, one, other in zip(stated, found[:2], exact[:2], strict=False):
            assert abs(one - other) <= error * LIMIT


def test_beyond_the_table_all_points_slip(table: Path) -> None:
    creep = CreepTable.read(table)
    x, y, _ = (axis[-1] for axis in creep.axes)
    assert math.hypot(*creep(-5 * x, 4 * y, 0.0)[:2]) == pytest.approx(LIMIT, rel=5e-3)
    assert creep(-5 * x, 4 * y, 0.0) == pytest.approx(creep(-50 * x, 40 * y, 0.0))


def test_slopes_are_continuous(table: Path) -> None:
    creep = CreepTable.read(table)
    node, step = creep.axes[1][5], 1e-7
    below, at, above = (np.array(creep(0.001, node + k * step, 0.0)) for k in (-1, 0, 1))
    np.testing.assert_allclose(above - at, at - below, rtol=1e-3, atol=1e-9)


C_PROGRAM = """
#include "creep_table.h"
int main(int count, char **words) {
  creep_table table;
  double at[3], loads[3];
  if (count < 2 || creep_table_read(&table, words[1]) != 0) return 1;
  while (scanf("%lf%lf%lf", &at[0], &at[1], &at[2]) == 3) {
    creep_table_loads(&table, at[0], at[1], at[2], loads);
    printf("%.15e %.15e %.15e\\n", loads[0], loads[1], loads[2]);
  }
  creep_table_free(&table);
  return 0;
}
"""
FORTRAN_PROGRAM = """
program loads
  use creep_table, only: creep_table_t, read_creep_table
  type(creep_table_t) :: table
  character(len=999) :: path
  double precision :: at(3)
  integer :: stat
  call get_command_argument(1, path)
  call read_creep_table(trim(path), table, stat)
  if (stat /= 0) error stop 1
  do
    read (*, *, iostat=stat) at
    if (stat /= 0) exit
    write (*, '(3es24.15)') table%loads_of(at(1), at(2), at(3))
  end do
end program loads
"""


@pytest.mark.parametrize("language", ["c", "f90"])
def test_programs_read_what_python_reads(language: str, table: Path, tmp_path: Path) -> None:
    compiler, flags, program = {
        "c": ("cc", ["-std=c99"], C_PROGRAM),
        "f90": ("gfortran", ["-std=f2018", str(READERS / "creep_table.f90")], FORTRAN_PROGRAM),
    }[language]
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    (tmp_path / f"loads.{language}").write_text(program)
    warnings = ["-O1", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{READERS}"]
    subprocess.run(
        [compiler, *warnings, *flags, f"loads.{language}", "-o", "loads", "-lm"], cwd=tmp_path, check=True
    )
    creep = CreepTable.read(table)
    given = "\n".join(" ".join(map(repr, case)) for case in cases(creep))
    done = subprocess.run(
        [tmp_path / "loads", table], input=given, capture_output=True, text=True, check=True
    )
    found = np.array([line.split() for line in done.stdout.splitlines()], float)
    np.testing.assert_allclose(found, [creep(*case) for case in cases(creep)], rtol=1e-10, atol=1e-12)
    missing = subprocess.run([tmp_path / "loads", "missing.txt"], input="", capture_output=True, text=True)
    assert missing.returncode == 1


def test_unlike_bodies_have_a_table_of_both_signs(tmp_path: Path) -> None:
    deck = ball(STEADY)
    deck["body"]["2"] = {"young_modulus": 70e9, "poisson_ratio": 0.33}
    with pytest.raises(DeckError, match="creep_table.creepage_x: expected numbers below and above 0"):
        run_study(written(tmp_path, deck))
    ranges = "creepage_x = [-0.02, 0.02]\ncreepage_y = [-0.02, 0.02]\nspin = [-100, 100]\n"
    study = written(tmp_path, deck, ranges + "counts = [5, 4, 5]\nheld_out = 1")
    run_study(study, tmp_path / "creep.nc")
    free = CreepTable.read(tmp_path / "creep.txt")(0.0, 0.0, 0.0)
    assert free[0] > 1.0  # the creep curve does not pass through the origin


@pytest.mark.parametrize(
    ("last", "tables", "keys", "words"),
    [
        ({"tangential_load_x": 1.0}, {}, "", 'load.2.rolling: expected "steady" in the last entry'),
        ({"rolling": 1e-4, "creepage_x": 0.001}, {}, "", 'load.2.rolling: expected "steady"'),
        (STEADY, {"friction": {"coefficient": math.inf}}, "", "friction.coefficient: expected one number"),
        (STEADY, {}, "counts = [3, 27, 10]", "counts = .*entry 1, 3: expected"),
        (STEADY, {}, "creepage_x = [0.001, 0.002]", "creepage_x = .*expected 0, or a number below it"),
        (STEADY, {}, "creepage_y = [0, 0.002]", "creepage_y = .*expected a number below 0 and one above it"),
        (STEADY, {}, "held_out = 0", "held_out = 0: expected"),
        (
            STEADY,
            {},
            '[[parameter]]\nkey = "load.1.normal_load"\nvalues = [1]',
            "parameter = .*expected only title",
        ),
    ],
)
def test_wrong_tables_are_refused(
    last: dict[str, Any], tables: dict[str, Any], keys: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(DeckError, match=words):
        run_study(written(tmp_path, ball(last, **tables), keys))


def test_other_files_are_not_overwritten(tmp_path: Path) -> None:
    study = written(tmp_path, ball(STEADY), "counts = [4, 4, 4]")
    (tmp_path / "creep.txt").write_text("notes")
    with pytest.raises(DeckError, match=r"creep.txt exists and is no creep table"):
        run_study(study, tmp_path / "creep.nc")
    assert (tmp_path / "creep.txt").read_text() == "notes"
    (tmp_path / "creep.txt").unlink()
    done = CliRunner().invoke(app, ["study", str(study), "-o", str(tmp_path / "creep.nc"), "--json"])
    content = json.loads(done.stdout)
    assert (content["cases"], len(content["interpolation_error"]), content["exit_code"]) == (64, 3, 0)
    refused = CliRunner().invoke(app, ["study", str(study), "--jobs", "2"])
    assert refused.exit_code == 2
    assert "--jobs: expected no such option with a creep table" in refused.output
