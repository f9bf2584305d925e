"""A thousand decks with mistakes: each is checked, or run, with a clean result or a sentence by mistake."""

import random
import shutil
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fuzz import harness
from fuzz.deck_mutations import garbled, mutated

from hexcontact.cli import frame as cli_frame
from hexcontact.cli import run as cli_solve
from hexcontact.cli.deck import check
from hexcontact.result.store import open_result
from hexcontact.study.study import Study

CASES = Path(__file__).parents[2] / "cases"
CHECKED, RUN, OTHERS = 600, 60, 60  # decks; of each kind of other files a third
PARTS = 4
MOST_WORK = 30_000  # nodes times load steps of what is run

BODIES = """
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "70 GPa"
poisson_ratio = 0.33
"""
PARABOLOID = BODIES.replace('"sphere", radius', '"paraboloid", radius_x = "4 mm", radius_y')
PUNCH = BODIES.replace('"sphere", radius = "10 mm"', '"punch", radius = "0.5 mm"')
SMALL = (
    BODIES
    + """[grid]
nodes_in_radius = 5
[[load]]
normal_load = "100 N"
steps = 2
""",
    BODIES
    + """[friction]
coefficient = 0.2
[grid]
spacing = "60 um"
[solver]
tolerance = 1e-8
[[load]]
normal_load = "100 N"
steps = 2
ramp = "cubic"
[[load]]
tangential_load_x = "12 N"
tangential_load_y = "-3 N"
steps = 2
label = "shear"
[[load]]
twist = "0.001 deg"
[output]
fields = ["pressure", "zone", "traction_x"]
every = 2
""",
    PARABOLOID
    + """[friction]
coefficient = 2
[grid]
nodes_across = 15
[[load]]
path = [{ approach = "1 um", steps = 2 }, { shift_x = "0.2 um" }, { shift_x = "-0.1 um" }]
repeat = 2
""",
    PUNCH
    + """[friction]
coefficient = 0.4
[grid]
window = [13, 13]
spacing = "0.1 mm"
[solver]
method = "direct"
algorithm = "static"
[[load]]
normal_load = "100 N"
[[load]]
torque = "3 N mm"
""",
    BODIES
    + """[friction]
coefficient = "0.3 + 0.1*tanh(x/50e-6)"
shear_limit = "300 MPa"
[interface]
coefficient = "1e21 Pa/m^2"
exponent = 2
tangential_stiffness = "1e15 Pa/m"
[bulk]
body = 2
[grid]
nodes_in_radius = 5
[[load]]
normal_load = "100 N"
[[load]]
bulk_stress_xx = "30 MPa"
bulk_stress_xy = "-5 MPa"
[[stress]]
name = "axis"
body = 2
line = [["0 mm", "0 mm", "0 mm"], ["0 mm", "0 mm", "1 mm"]]
count = [5]
steps = "all"
[[stress]]
depths = ["10 um", "0.1 mm"]
box = [["-0.1 mm", "0.1 mm"], ["-0.1 mm", "0.1 mm"]]
components = ["von_mises_stress"]
""",
)


@cli_frame.guarded
def planned(file: Path, as_json: bool) -> cli_frame.Content:
    """Check a study as ``hexcontact study`` does before it runs anything."""
    return {"cases": len(Study.from_toml(file))}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the cases, with the files that decks name."""
    shutil.copytree(CASES, tmp_path / "cases")
    return tmp_path / "cases"


def judged(command: Callable[..., Any], seed: object, place: Path, **options: Any) -> harness.Ending:
    """Run a command that may only write what is called out, and see that it ends as it should."""
    before = untouchable(place)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", module="hexcontact")
        try:
            end = harness.ending(command, as_json=True, **options)
        except BaseException as error:
            raise AssertionError(f"{seed}: {error!r}") from error
    assert harness.complaints(end) == [], (seed, end.error)
    assert untouchable(place) == before, seed
    return end


def untouchable(place: Path) -> dict[str, str]:
    return {name: hash_ for name, hash_ in harness.contents(place).items() if not name.startswith("out")}


def decks() -> list[str]:
    return [path.read_text() for path in sorted(CASES.glob("*.toml")) if not path.stem.startswith("study")]


@pytest.mark.parametrize("part", range(PARTS))
def test_mutated_decks_are_checked_with_a_sentence_for_each_mistake(part: int, folder: Path) -> None:
    known, codes = decks(), Counter[int]()
    for seed in range(part, CHECKED, PARTS):
        rng = random.Random(seed)
        (folder / "deck.toml").write_bytes(mutated(rng.choice(known), rng))
        codes[judged(check, seed, folder, deck=folder / "deck.toml").exit_code] += 1
    assert codes[0] > 0.1 * CHECKED / PARTS  # mutations that leave nothing whole would test little
    assert codes[2] > 0.5 * CHECKED / PARTS


def test_decks_that_are_too_large_are_refused_by_estimate(folder: Path) -> None:
    large = {
        "grid.nodes_across=99999": 4,
        "grid.nodes_in_radius=30000": 4,
        "grid.nodes_in_radius=100000": 2,
        "load.1.steps=100000": 0,
        "load.1.steps=100001": 2,
        "load.1.steps=1000000000000": 2,
    }
    for setting, code in large.items():
        keys = [setting]
        deck = folder / "deck.toml"
        deck.write_text(SMALL[0].replace("nodes_in_radius = 5", "") if "grid" in setting else SMALL[0])
        end = judged(check, setting, folder, deck=deck, settings=keys)
        assert end.exit_code == code, end.error
        if code == 4:
            run = judged(cli_solve.run, setting, folder, deck=deck, settings=keys, output=folder / "out.nc")
            assert run.exit_code == 4
            assert not list(folder.glob("out.nc*"))


def test_gently_mutated_decks_are_run_to_a_result_or_a_sentence(tmp_path: Path) -> None:
    codes = Counter[int]()
    for seed in range(RUN):
        rng = random.Random(seed)
        deck, output = tmp_path / "deck.toml", tmp_path / "out.nc"
        deck.write_bytes(mutated(rng.choice(SMALL), rng, gently=True))
        end = judged(check, seed, tmp_path, deck=deck)
        if end.exit_code == 0 and harness.told(end)["nodes"] * harness.told(end)["load_steps"] < MOST_WORK:
            end = judged(cli_solve.run, seed, tmp_path, deck=deck, output=output, overwrite=True, quiet=True)
            if end.exit_code == 0:
                with open_result(output).dataset as dataset:
                    assert dataset.attrs["complete"] == 1, seed
                    assert float(dataset["max_pressure"].max()) > 0, seed
        codes[end.exit_code] += 1
    assert codes[0] > 0.3 * RUN
    assert codes[2] > 0.1 * RUN


@pytest.mark.parametrize("kind", ["study", "series", "included"])
def test_other_files_with_mistakes_get_a_sentence(kind: str, folder: Path) -> None:
    names = {
        "study": "study_friction.toml",
        "series": "measured_history.csv",
        "included": "materials/steel.toml",
    }
    file, deck = folder / names[kind], folder / "measured_history.toml"  # which names the other two
    whole = file.read_text()
    codes = Counter[int]()
    for seed in range(OTHERS // 3):
        rng = random.Random(seed)
        file.write_bytes(mutated(whole, rng) if rng.random() < 0.8 else garbled(whole.encode(), rng))
        if kind == "study":
            end = judged(planned, (kind, seed), folder, file=file)
        else:
            end = judged(check, (kind, seed), folder, deck=deck)
        codes[end.exit_code] += 1
    assert codes[0] > 0
    assert codes[2] > 0


@pytest.mark.parametrize("depth", [60, 300, 600, 3000])
@pytest.mark.parametrize("kind", ["[", "{a=", "a.", "[a."])
def test_tables_in_tables_in_tables_are_refused(kind: str, depth: int, folder: Path) -> None:
    deep = {
        "[": f"x = {'[' * depth}1{']' * depth}",
        "{a=": f"x = {'{a=' * depth}1{'}' * depth}",
        "a.": f"{'a.' * depth}a = 1",
        "[a.": f"[{'a.' * depth}a]",
    }
    for deck in ("measured_history.toml", "hertz_spheres.toml"):  # one that is put together of several files
        (folder / deck).write_text(f"{(CASES / deck).read_text()}\n{deep[kind]}\n")
        end = judged(check, depth, folder, deck=folder / deck)
        assert end.exit_code == 2
        assert "nested too deeply" in end.error


def endless(as_json: bool) -> None:
    while True:
        pass


@cli_frame.guarded
def unforeseen(as_json: bool) -> cli_frame.Content:
    raise ZeroDivisionError("a mistake of the program")


@cli_frame.guarded
def not_a_number(as_json: bool) -> cli_frame.Content:
    print("a word")
    return {"value": float("nan")}


@cli_frame.guarded
def scribble(as_json: bool, file: Path) -> cli_frame.Content:
    file.write_text("x")
    return {}


def silent_failure(as_json: bool) -> None:
    raise SystemExit(3)


def test_the_judge_sees_what_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(harness, "LONGEST", 0.1)
    with pytest.raises(AssertionError, match="Hang"):
        judged(endless, 0, tmp_path)
    with pytest.raises(AssertionError, match="ZeroDivisionError"):
        judged(unforeseen, 0, tmp_path)
    with pytest.raises(AssertionError, match="is not JSON"):
        judged(not_a_number, 0, tmp_path)
    with pytest.raises(AssertionError, match="an error without a sentence"):
        judged(silent_failure, 0, tmp_path)
    with pytest.raises(AssertionError, match="damage"):
        judged(scribble, 0, tmp_path, file=tmp_path / "damage")
