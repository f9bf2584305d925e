"""Results whose deck another version has written, or a script: nothing is left out without a word."""

import ast
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from commands import inside

from hexcontact import Case, open_result
from hexcontact.errors import DeckError

ROOT = Path(__file__).parents[2] / "pydriver/hexcontact"
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
DECK = """
grid.nodes_in_radius = 6
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "210 GPa"
poisson_ratio = 0.3
[solver]
tolerance = 1e-8
[[load]]
normal_load = "100 N"
[[stress]]
name = "axis"
line = [["0 mm", "0 mm", "0 mm"], ["0 mm", "0 mm", "0.2 mm"]]
count = [5]
[output]
file = "out.nc"
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("results") / "out.nc"
    Case.from_text(DECK).run(str(file))
    return file


def later(finished: Path, folder: Path, table: str) -> Path:
    """Return a copy of a result in whose deck a table has a key of a later version."""
    copy = folder / "later.nc"
    copy.write_bytes(finished.read_bytes())
    with netCDF4.Dataset(copy, "a") as file:
        file.deck = file.deck.replace(f"{table}\n", f"{table}\nfineness = 3\n")
    return copy


def test_tables_with_an_unknown_key_are_refused_before_anything_is_written(
    finished: Path, tmp_path: Path
) -> None:
    file = later(finished, tmp_path, "[[stress]]")
    for given in (("export", file, "--vtk", "-o", tmp_path / "vtk"), ("report", file)):
        done = inside(tmp_path, *map(str, given))
        assert done.returncode == 2
        assert "deck of the result:" in done.stderr
        assert "stress.1.fineness: unknown key" in done.stderr
        assert "open the result with the version that wrote it" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["later.nc"]


def test_an_unknown_key_elsewhere_does_not_matter(finished: Path, tmp_path: Path) -> None:
    file = later(finished, tmp_path, "[solver]")
    assert inside(tmp_path, "export", str(file), "--vtk").returncode == 0
    assert (tmp_path / "later_export/later_axis.pvd").is_file()


def test_unknown_keys_of_bodies(finished: Path, tmp_path: Path) -> None:
    """Stress is refused with the key; `info` says why nothing is compared with Hertz."""
    file = later(finished, tmp_path, "[body.1]")
    with pytest.raises(DeckError, match="body.1.fineness: unknown key"):
        open_result(file).stress(points=[[0.0, 0.0, 1e-5]])
    shown = inside(tmp_path, "info", str(file))
    assert shown.returncode == 0
    assert "note: not compared with Hertz: deck of the result:" in shown.stdout
    assert "Against Hertz" in inside(tmp_path, "info", str(finished)).stdout


def test_stress_of_a_result_whose_gap_is_from_python() -> None:
    """The deck of the result says what the bodies are made of."""
    steps = []
    given = {"body_1": STEEL, "body_2": STEEL, "spacing": 2e-5, "loads": [{"normal_load": 100.0}]}
    case = Case(gap=lambda x, y: (x**2 + y**2) / 20e-3, **given)
    result = case.run(on_step=lambda step: steps.append(step))
    points = [[0.0, 0.0, 5e-5], [1e-4, 0.0, 5e-5]]
    one, other = steps[-1].stress_at(points), result.stress(points=points)
    np.testing.assert_array_equal(one.von_mises_stress, other.von_mises_stress)


def test_no_handler_takes_a_fault_of_a_deck_for_something_else() -> None:
    """`DeckError` is a ValueError: whoever goes on after one has a line or two that cannot raise it."""
    wide = []
    for path in sorted(ROOT.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            for handler in getattr(node, "handlers", ()):
                caught = {
                    getattr(name, "id", "") for name in ast.walk(handler.type or ast.Name("BaseException"))
                }
                goes_on = not any(isinstance(statement, ast.Raise) for statement in handler.body)
                inside = [s for part in node.body for s in ast.walk(part) if isinstance(s, ast.stmt)]
                if caught & {"ValueError", "LookupError", "IndexError"} and goes_on and len(inside) > 2:
                    wide.append(f"{path.relative_to(ROOT)}:{handler.lineno}")
    assert not wide
