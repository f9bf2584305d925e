"""docs/developer.md: procedures on the way of a load exist, and additions work in a copy of the sources."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/developer.md").read_text(encoding="utf-8")
SOURCES = ("fortran", "pydriver", "tests", "docs", "cases", "packaging", "subprojects")
COUNTS = {"One file": 1, "Two files": 2, "Three files": 3, "Five files": 5}
MOST = {"a friction law": 5, "a nodal output field": 3}

COMMON = """
import hexcontact
from hexcontact import Case
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
BALL = {**STEEL, "surface": {"shape": "sphere", "radius": "10 mm"}}
"""


def sections() -> dict[str, str]:
    """Return the additions of the page that name files, by their headings."""
    parts = re.findall(r"^## Add ([^\n]+)\n(.*?)(?=^## )", PAGE, re.MULTILINE | re.DOTALL)
    return {heading: text for heading, text in parts if changes_of(text)}


def changes_of(text: str) -> list[tuple[str, str, str]]:
    """Return what a section changes: file, old lines (none: the end of the file) and new ones."""
    found = []
    for language, block in re.findall(r"^```(\w+)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        if language == "diff":
            for file, hunks in re.findall(
                r"^--- ([^\n]+)\n(.*?)(?=^--- |\Z)", block, re.MULTILINE | re.DOTALL
            ):
                for hunk in re.split(r"^@@\n", hunks, flags=re.MULTILINE):
                    lines = hunk.splitlines(keepends=True)
                    old, new = (
                        "".join(line[1:] for line in lines if line[0] in side) for side in (" -", " +")
                    )
                    found.append((file, old, new))
        elif named := re.match(r"[#!] (\S+/\S+\.\w+)\n", block):
            found.append((named[1], "", block[named.end() :]))
    return found


def change(root: Path, file: str, old: str, new: str) -> None:
    """Make a change; the old lines stand once in the file."""
    path = root / file
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    if old:
        assert f"\n{text}".count(f"\n{old}") == 1, f"{file}:\n{old}"
        text = f"\n{text}".replace(f"\n{old}", f"\n{new}")[1:]
    else:
        text = f"{text}\n\n{new}" if text else new
    path.write_text(text, encoding="utf-8")


def run(*words: str | Path, root: Path) -> str:
    """Run a program on the package of the copy."""
    environment = os.environ | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "PYTHONPATH": str(root / "pydriver"),
        "OMP_NUM_THREADS": "1",
    }
    done = subprocess.run(words, capture_output=True, text=True, cwd=root, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources with all additions, built without optimization, which is quick."""
    root = tmp_path_factory.mktemp("guide")
    unwanted = shutil.ignore_patterns("__pycache__", "*.so", "flat.py")
    for name in SOURCES:
        shutil.copytree(ROOT / name, root / name, ignore=unwanted)
    for path in [path for path in ROOT.iterdir() if path.is_file()]:
        shutil.copy2(path, root)
    for text in sections().values():
        for file, old, new in changes_of(text):
            change(root, file, old, new)
    build = root / "build/guide"
    run("meson", "setup", build, "-Dpython=true", "-Dtests=false", "-Doptimization=0", root=root)
    [extension] = re.findall(r"^build (pydriver/_core\S+\.so):", (build / "build.ninja").read_text(), re.M)
    run("ninja", "-C", build, extension, root=root)
    for made in (build / extension, build / "pydriver/flat.py"):
        shutil.copy2(made, root / "pydriver/hexcontact/core")
    run(sys.executable, "docs/deck_tables.py", root=root)
    return root


def used(copy: Path, program: str) -> str:
    """Run a program in the copy, and return what it prints."""
    return run(sys.executable, "-c", COMMON + program, root=copy)


def test_procedures_that_a_load_passes_are_there() -> None:
    way = re.findall(r"^\| `(\w+/[\w/.]+)` \| `(\w+)` \|", PAGE, re.MULTILINE)
    assert len(way) > 10
    for file, name in way:
        text = (ROOT / file).read_text()
        assert re.search(rf"\b(?:def |class |subroutine |procedures\.){name}\b", text), (file, name)


def test_additions_have_as_many_files_as_the_page_says() -> None:
    counted = {heading: len({file for file, *_ in changes_of(text)}) for heading, text in sections().items()}
    said = {heading: text.strip().partition(".")[0].partition(":")[0] for heading, text in sections().items()}
    assert counted == {heading: COUNTS[words] for heading, words in said.items()}
    assert len(counted) == 8
    assert {heading: counted[heading] for heading in MOST} == MOST


def test_a_medium_of_the_tests_has_three_files() -> None:
    files = [path for folder in ("fortran", "tests/fortran") for path in (ROOT / folder).rglob("*.*")]
    words = re.compile(r"scaled_medium|collect_medium|'medium'")
    naming = {path.name for path in files if words.search(path.read_text())}
    assert naming == {"test_medium.f90", "main.f90", "meson.build"}


def test_rules_of_the_house_hold_with_all_additions(copy: Path) -> None:
    files = [f"tests/python/test_{name}.py" for name in ("rooms", "house", "flat_procedures")]
    keys = ("deck.py::test_the_deck_reference_is_up_to_date", "schema.py::test_schema_is_one")
    files += [f"tests/python/test_{key}" for key in keys]
    run(sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *files, root=copy)


def test_a_surface_has_its_closed_solution(copy: Path) -> None:
    printed = used(
        copy,
        """
surface = {"shape": "steepening", "radius": "10 mm", "factor": 3000.0}
case = Case(body_1={**STEEL, "surface": surface}, body_2=STEEL, nodes_in_radius=12, normal_load=100.0)
comparison = case.run().compare()
print(abs(comparison["approach"].error), abs(comparison["max_pressure"].error))
""",
    )
    assert all(float(error) < 2e-3 for error in printed.split())  # of second order, as for spheres


def test_a_nodal_field_is_in_the_result(copy: Path) -> None:
    printed = used(
        copy,
        """
import numpy as np
loads = [{"normal_load": 50.0}, {"tangential_load_x": 5.0}]
result = Case(body_1=BALL, body_2=STEEL, nodes_in_radius=8, friction_coefficient=0.3, loads=loads).run()
step = result.dataset.isel(step=-1)
length = np.hypot(step["traction_x"], step["traction_y"])
reserve = step["friction_reserve"]
print(float(abs(reserve - (0.3 * step["pressure"] - length)).max() / step["pressure"].max()))
print(float(reserve.where(step["zone"] == 1).min() > 0.0), float(abs(reserve.where(step["zone"] == 2)).max()))
print(reserve.attrs["units"])
""",
    )
    error, sticks, slips, unit = printed.split()
    assert float(error) < 1e-12
    assert float(sticks) == 1.0
    assert float(slips) < 10.0  # Pa, of a bound of 1e8
    assert unit == "Pa"


def test_a_friction_law_bounds_the_traction(copy: Path) -> None:
    printed = used(
        copy,
        """
import numpy as np
limit, mu = 120e6, 0.3
tables = {"body": {1: BALL, 2: STEEL}, "grid": {"nodes_in_radius": 8},
          "friction": {"coefficient": mu, "shear_limit": limit, "transition": "smooth"},
          "load": [{"normal_load": 50.0}, {"tangential_load_x": 4.0}]}
result = Case.from_dict(tables).run()
step = result.dataset.isel(step=-1)
length = np.hypot(step["traction_x"], step["traction_y"])
bound = limit * np.tanh(mu * step["pressure"] / limit)
excess = (length - bound) / limit
print(float(excess.max()), float(abs(excess).where(step["zone"] == 2).max()))
print(int((step["zone"] == 1).sum()), int((step["zone"] == 2).sum()))
print(result.dataset.attrs["friction_law"])
del tables["friction"]["shear_limit"]
try:
    Case.from_dict(tables)
except hexcontact.DeckError as error:
    print(error)
""",
    )
    excess, zones, law, message = printed.splitlines()
    assert all(float(share) < 1e-7 for share in excess.split())  # above the bound, and off it in slip
    assert all(int(nodes) > 10 for nodes in zones.split())
    assert law == "coefficient 0.3, shear traction of at most 120.0 MPa, smooth"
    assert message == 'friction.shear_limit: missing; expected the limit of transition = "smooth"'


def test_a_fatigue_criterion_is_that_of_the_deck(copy: Path) -> None:
    printed = used(
        copy,
        """
import numpy as np
from hexcontact import fatigue
history = np.zeros((3, 6))
history[:, 0] = [0.0, 300e6, 100e6]
print(float(fatigue.sines(history, slope=0.2)))
loads = [{"normal_load": 50.0}, *({"tangential_load_x": load} for load in (5.0, -5.0, 5.0))]
result = Case(body_1=BALL, body_2=STEEL, nodes_in_radius=6, friction_coefficient=0.3, loads=loads).run()
found = result.fatigue("sines", "crossland", steps=[2, 3, 4], sines_slope=0.0, crossland_slope=0.0)
print(float(abs(found["sines"] - found["crossland"]).max()), found["sines"].attrs["sines_slope"])
""",
    )
    value, apart, slope = map(float, printed.split())
    assert value == pytest.approx(150e6 / 3**0.5 + 0.2 * 50e6, rel=1e-12)  # half the range, and its middle
    assert apart == slope == 0.0


def test_a_deck_key_reaches_the_solver(copy: Path) -> None:
    printed = used(
        copy,
        """
loads = [{"normal_load": 50.0}, {"tangential_load_x": 10.0}]
case = Case(body_1=BALL, body_2={"rigid": True}, nodes_in_radius=8, friction_coefficient=0.3, loads=loads)
print(int(case.run().dataset["cuts"].sum()))
for most in (1, 0):
    try:
        case.changed(max_sweeps=most).run()
    except hexcontact.HexcontactError as error:
        print(str(error).splitlines()[0])
""",
    )
    cuts, halved, message = printed.splitlines()
    assert cuts == "0"
    assert "did not converge" in halved  # no step ends in one active set
    assert "halving the step 6 times" in halved
    assert "solver.max_sweeps = 0: expected a whole number of at least 1" in message


def test_a_figure_is_an_option_of_the_command(copy: Path, tmp_path: Path) -> None:
    printed = used(
        copy,
        f"""
from hexcontact.plotting import FIGURES
loads = [{{"normal_load": 50.0, "steps": 2}}]
case = Case(body_1=BALL, body_2={{"rigid": True}}, nodes_in_radius=6, friction_coefficient=0.3, loads=loads)
result = case.run({str(tmp_path / "out.nc")!r})
drawn = FIGURES["work"](result).axes[0].lines[0].get_ydata().tolist()
print(drawn == result.dissipated_energy.values.tolist() != [0.0, 0.0])
""",
    )
    assert printed == "True\n"
    command = [sys.executable, "-m", "hexcontact"]
    run(*command, "plot", tmp_path / "out.nc", "--what", "work", "--output", tmp_path / "work.png", root=copy)
    assert (tmp_path / "work.png").stat().st_size > 1000
    lines = run(*command, "energy", tmp_path / "out.nc", root=copy).splitlines()
    assert [line.split()[0] for line in lines] == ["1", "2"]


def test_a_backend_runs_the_cases_of_a_study(copy: Path, tmp_path: Path) -> None:
    deck = """
    body.1 = { young_modulus = 210e9, poisson_ratio = 0.3, surface = { shape = "sphere", radius = "10 mm" } }
    body.2.rigid = true
    grid.nodes_in_radius = 4
    load = [{ normal_load = 50.0 }]
    """
    study = f"""
    deck = "ball.toml"
    output = "{tmp_path / "cases.nc"}"
    threads = 2
    parameter = [{{ key = "load.1.normal_load", values = [10.0, 20.0] }}]
    """
    (tmp_path / "ball.toml").write_text(deck)
    (tmp_path / "study.toml").write_text(study)
    run(sys.executable, "-m", "hexcontact", "study", tmp_path / "study.toml", root=copy)
    assert (tmp_path / "cases.nc").exists()
    assert len([path for path in tmp_path.rglob("*.nc") if path.name != "cases.nc"]) == 2
