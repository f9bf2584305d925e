"""Decks out of several sources: includes, keys that are set, series of loads; and decks written again."""

import math
import os
import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
from commands import ENVIRONMENT
from typer.testing import CliRunner

from hexcontact import Case
from hexcontact.cli.app import app
from hexcontact.deck.faults import Source
from hexcontact.deck.keys import Deck
from hexcontact.deck.series import read_series
from hexcontact.deck.toml import written
from hexcontact.errors import DeckError
from hexcontact.problem.preview import case_rows, operator_applications, seconds

ROOT = Path(__file__).parents[2]

DECK = """\
title = "Ball"
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "210 GPa"
poisson_ratio = 0.3
[friction]
coefficient = 0.5
[grid]
nodes_in_radius = 8
"""
PRESS = '[[load]]\nnormal_load = "10 N"\n'
SERIES = DECK + '[[load]]\nseries = { file = "history.csv" }\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to write decks to, which is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def put(name: str, text: str) -> Path:
    path = Path(name)
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(text, encoding="utf-8")
    return path


def complaint(path: Path | str, **overrides: Any) -> list[str]:
    with pytest.raises(DeckError) as error:
        Case.from_toml(path, {key.replace("__", "."): value for key, value in overrides.items()})
    return str(error.value).splitlines()


# --- includes -------------------------------------------------------------------------------------


def test_the_deck_lies_over_what_it_includes(folder: Path) -> None:
    put(
        "lib/steel.toml",
        '[body.1]\nyoung_modulus = "200 GPa"\npoisson_ratio = 0.3\n[solver]\ntolerance = 1e-6\n',
    )
    put("lib/all.toml", 'include = ["steel.toml"]\n[solver]\nmethod = "fft"\n' + PRESS + PRESS)
    put("later.toml", '[body.1]\nyoung_modulus = "190 GPa"\nsurface = { shape = "cone", slope = 0.1 }\n')
    text = DECK.replace('young_modulus = "210 GPa"\n', "", 1) + PRESS
    case = Case.from_toml(put("deck.toml", 'include = ["lib/all.toml", "later.toml"]\n' + text))
    assert case.body_1.young_modulus == 190e9  # the later file counts more
    assert case.body_1.surface is not None
    assert case.body_1.surface.shape == "sphere"  # the deck most, and nothing is left of the cone
    assert (case.solver.method, case.solver.tolerance) == ("fft", 1e-6)
    assert len(case.load_steps) == 1  # arrays are replaced
    for path in ("lib/all.toml", "later.toml", "lib/steel.toml"):
        os.remove(path)
    assert Case.from_text(case.deck_text) == case
    assert case.deck_text.startswith(
        "# Put together from deck.toml, later.toml, lib/all.toml and lib/steel.toml."
    )


def test_mistakes_in_included_files_are_found_there(folder: Path) -> None:
    put("lib/wrong.toml", '\n[body.1]\n  young_modulus = "x"\n[friction]\ncoefficient = -1\n')
    deck = put(
        "deck.toml", 'include = ["lib/wrong.toml"]\n' + DECK.replace('"210 GPa"', '"1 GPa"', 1) + PRESS
    )
    assert complaint(deck, grid__nodes_in_radius=0) != []
    deck.write_text(
        'include = ["lib/wrong.toml"]\n' + DECK.replace('young_modulus = "210 GPa"\n', "", 1) + PRESS
    )
    (line,) = complaint(deck)
    assert line.startswith('lib/wrong.toml:3:3: body.1.young_modulus = "x": expected a pressure')


def test_files_that_cannot_be_included(folder: Path) -> None:
    deck = put("lib/a.toml", '\ninclude = ["b.toml"]\n')
    assert complaint(deck) == [
        "lib/a.toml:2:1: include: lib/b.toml: no such file; expected a deck (a TOML file)"
    ]
    put("lib/b.toml", 'include = ["../lib/a.toml"]\n')
    assert complaint(deck) == [
        "lib/b.toml:1:1: include: lib/../lib/a.toml includes itself (a.toml -> b.toml -> a.toml)"
    ]
    put("lib/b.toml", 'include = ["b.toml"]\n')
    assert "includes itself (b.toml -> b.toml)" in complaint(deck)[0]
    put("lib/b.toml", "x = \n")
    assert complaint(deck) == ["lib/a.toml:2:1: include: lib/b.toml:1:5: is not TOML: Invalid value"]
    deck.write_text('include = ["a\\u0000b"]')
    assert "cannot be read (embedded null byte)" in complaint(deck)[0]
    deck.write_text("include = 3")
    assert complaint(deck) == [
        'lib/a.toml:1:1: include: expected an array of file names such as ["materials.toml"]'
    ]
    deck.write_text(DECK + PRESS)
    assert complaint(deck, include=["b.toml"]) == ["include: cannot be replaced; expected in the deck"]


def test_the_same_file_twice_is_no_cycle(folder: Path) -> None:
    put("m.toml", "[body.1]\npoisson_ratio = 0.2\n")
    put("n.toml", 'include = ["m.toml"]\n')
    text = 'include = ["m.toml", "n.toml"]\n' + DECK.replace("poisson_ratio = 0.3\n", "", 1) + PRESS
    assert Case.from_toml(put("deck.toml", text)).body_1.poisson_ratio == 0.2


def test_what_is_set_is_part_of_the_deck_kept(folder: Path) -> None:
    put("m.toml", "[friction]\ncoefficient = 0.1\n")
    text = 'include = ["m.toml"]\n' + DECK.replace("[friction]\ncoefficient = 0.5\n", "") + PRESS
    case = Case.from_toml(put("deck.toml", text), {"friction.coefficient": 0.3, "load.1.steps": 20})
    assert (case.friction_coefficient, len(case.load_steps)) == (0.3, 20)
    assert "m.toml, with friction.coefficient and load.1.steps set.\n" in case.deck_text
    assert Case.from_text(case.deck_text) == case


# --- everything at once ---------------------------------------------------------------------------


def test_mistakes_of_tables_and_between_tables_come_together_in_the_order_of_the_deck(folder: Path) -> None:
    text = DECK.replace("nodes_in_radius = 8", "nodes_in_radus = 8").replace(
        '"sphere", radius', '"cylinder", radius'
    )
    text += '[[load]]\ntangential_load_x = 3\n[output]\nfields = ["gap", "x"]\n'
    keys = [re.split(r"(?<=[a-z_])(?: =|: )", line)[0] for line in complaint(put("deck.toml", text))]
    assert keys == [
        "deck.toml:5:1: body.1.surface",
        "deck.toml:12:1: grid.nodes_in_radus",
        "deck.toml:13:1: load",  # without a normal load, from which sliding would follow
        "deck.toml:16:1: output.fields",
    ]


# --- series ---------------------------------------------------------------------------------------


def targets(case: Case) -> list[tuple[float, ...]]:
    return [tuple(target.value for target in step.targets) for step in case.load_steps]


def test_each_row_is_a_load_step(folder: Path) -> None:
    put(
        "history.csv",
        "# from the rig\ntime [s],normal_load [N],tangential_load_x [mN],label\n\n"
        "0,10,0,press\n1,20,500,go\n2,30.5,-500,go\n",
    )
    case = Case.from_toml(put("deck.toml", SERIES))
    assert targets(case) == [(10, 0, 0, 0), (20, 0.5, 0, 0), (30.5, -0.5, 0, 0)]
    assert [(step.segment, step.label) for step in case.load_steps] == [(0, "press"), (1, "go"), (1, "go")]
    os.remove("history.csv")
    assert Case.from_text(case.deck_text) == case  # the result can be run again without the file


def test_a_series_is_the_same_as_its_steps_one_by_one(folder: Path) -> None:
    rows: list[dict[str, Any]] = [
        {"normal_load": 10.0},
        {"tangential_load_x": 1.0, "twist": "0.001 deg"},
        {"normal_load": 12.0, "shift_y": 1e-7},
        {"approach": 1e-6},
        {"normal_load": 9.0, "torque": 1e-5, "tangential_load_y": 0.1},
    ]
    keys = sorted({key for row in rows for key in row})
    lines = [
        ";".join([*keys, "label"]),
        *(";".join([*(str(row.get(key, "")) for key in keys), "a"]) for row in rows),
    ]
    put("history.csv", "\n".join(lines))
    case = Case.from_toml(put("deck.toml", SERIES))
    single = Case.from_dict({**tomllib.loads(DECK), "load": [{**row, "label": "a"} for row in rows]})
    assert [step.targets for step in case.load_steps] == [step.targets for step in single.load_steps]
    assert {step.segment for step in case.load_steps} == {0}


def test_solved_alike(folder: Path) -> None:
    put("history.csv", "approach [um],normal_load [N],tangential_load_x [N]\n0.5,,0\n0.7,,1\n,15,1\n,18,2\n")
    fields = ["normal_load", "approach", "tangential_load_x", "shift_x", "max_pressure"]
    one = Case.from_toml(put("deck.toml", SERIES)).run().history[fields]
    loads = [{"approach": 5e-7, "tangential_load_x": 0.0}, {"approach": 7e-7, "tangential_load_x": 1.0},
             {"normal_load": 15.0}, {"normal_load": 18.0, "tangential_load_x": 2.0}]  # fmt: skip
    other = Case.from_dict({**tomllib.loads(DECK), "load": loads}).run().history[fields]
    assert (one.to_numpy() == other.to_numpy()).all()


def test_steps_between_rows_repeats_and_columns(folder: Path) -> None:
    put("lib/history.csv", "P;Q (kN);x\n10;0;1\n20;0.002;2\n")
    deck = (
        DECK
        + """[[load]]
series = { file = "lib/history.csv", columns = { normal_load = "P [N]", tangential_load_x = "Q" } }
steps = 2
repeat = 2
label = "turn"
"""
    )
    case = Case.from_toml(put("deck.toml", deck))
    assert targets(case) == [
        (5, 0, 0, 0), (10, 0, 0, 0), (15, 1, 0, 0), (20, 2, 0, 0),
        (15, 1, 0, 0), (10, 0, 0, 0), (15, 1, 0, 0), (20, 2, 0, 0),
    ]  # fmt: skip
    assert [step.segment for step in case.load_steps] == [0, 0, 1, 1, 2, 2, 3, 3]
    assert {step.label for step in case.load_steps} == {"turn"}
    put(
        "further/part.toml", deck[len(DECK) :].replace("lib/", "../lib/")
    )  # relative to the file that names it
    put("further/deeper/part.toml", 'include = ["../part.toml"]\n')
    again = Case.from_toml(put("cases/deck.toml", 'include = ["../further/deeper/part.toml"]\n' + DECK))
    assert again == case


def test_netcdf_and_the_history_of_a_result(folder: Path) -> None:
    with netCDF4.Dataset("history.nc", "w") as file:
        file.createDimension("time", 3)
        for name, unit, values in [
            ("time", "s", [0, 1, 2]),
            ("normal_load", "kN", [0.01, 0.02, np.nan]),
            ("twist", "deg", [0, 1e-3, 2e-3]),
        ]:
            file.createVariable(name, "f8", ("time",))[:] = values
            file[name].units = unit
    case = Case.from_toml(put("deck.toml", SERIES.replace(".csv", ".nc")))
    assert [step.z.value for step in case.load_steps] == [10, 20, 20]
    assert [step.twist.value for step in case.load_steps] == pytest.approx(
        [0, math.radians(1e-3), math.radians(2e-3)], rel=1e-14
    )

    case.run("result.nc")
    columns = '"result.nc", columns = { normal_load = "normal_load", twist = "twist", label = "label" }'
    again = Case.from_toml(put("deck.toml", SERIES.replace('"history.csv"', columns)))
    np.testing.assert_allclose(targets(again), targets(case), rtol=1e-12)
    (first, *_) = complaint(put("deck.toml", SERIES.replace("history.csv", "result.nc")))
    assert 'result.nc: unknown column "contact_area"; known are normal_load, ' in first


def test_arrays(folder: Path) -> None:
    case = Case(
        body_1={"young_modulus": 210e9, "poisson_ratio": 0.3, "surface": {"shape": "sphere", "radius": 0.01}},
        body_2={"young_modulus": 210e9, "poisson_ratio": 0.3},
        friction_coefficient=0.5,
        nodes_in_radius=8,
        loads=[
            {
                "series": {"normal_load": np.array([10.0, 20.0, np.nan]), "twist": np.array([0, 1e-5, 2e-5])},
                "label": "a",
            }
        ],
    )
    assert targets(case) == [(10, 0, 0, 0), (20, 0, 0, 1e-5), (20, 0, 0, 2e-5)]
    assert Case.from_text(case.deck_text) == case


WRONG = [
    (
        "normal_load\n1\nx\n",
        ['history.csv, line 3, column "normal_load" = "x": expected a force of at least 0'],
    ),
    (
        "normal_load [N]\n1 N\n",
        ['"1 N": expected a number without a unit, since the header has the unit [N]'],
    ),
    (
        "normal_load [mm]\n1\n",
        ['column "normal_load": expected a force of at least 0 such as "10 N"; "mm" is a length'],
    ),
    ('normal_load;label\n"1,5";a\n', ['= "1,5": expected a decimal point, not a comma']),
    (
        "normal_load\n\n-1\nnan\ninf\n",
        [
            'line 3, column "normal_load" = "-1"',
            'line 5, column "normal_load" = "inf"',
        ],
    ),
    ("normal_lod\n1\n", ['history.csv: unknown column "normal_lod"; did you mean normal_load?']),
    (
        "normal_load,F7\n1,2\n",
        ['unknown column "F7"; known are normal_load, ', "name the others with columns"],
    ),
    ("normal_load,approach\n1,\n1,2\n", ["history.csv, line 3: expected normal_load or approach, not both"]),
    ("normal_load,twist\n1,2\n", ['column "twist" = "2": expected an angle with its unit']),
    ("normal_load,normal_load\n1,2\n", ['expected each column once; "normal_load" is there more than once']),
    (
        "normal_load,shift_x\n1,2\n1,2,3\n",
        ["history.csv, line 3: expected 2 cells, as many as headers in line 1, not 3"],
    ),
    ("label\nx\n", ["history.csv: expected a column of loads or motions, such as normal_load [N]"]),
    ("normal_load\n", ["history.csv: expected at least one row below the headers"]),
    ("# nothing\n\n", ["history.csv: is empty; expected a line of headers"]),
    (
        "normal_load,tangential_load_x\n10,0\n10,3\n10,6\n",
        ['series.tangential_load_x = "6 N": gross sliding: the tangential load of 6 N in load step 3'],
    ),
]


@pytest.mark.parametrize(("text", "sentences"), WRONG, ids=[sentences[0][:50] for _, sentences in WRONG])
def test_mistakes_in_files_of_series(folder: Path, text: str, sentences: list[str]) -> None:
    put("history.csv", text)
    lines = complaint(put("deck.toml", SERIES))
    for sentence in sentences:
        assert any(sentence in line for line in lines), lines
    assert all(line.startswith("deck.toml:14:") and "load.1.series" in line for line in lines)


PLAIN = "time [s],normal_load [N],tangential_load_x [N]\n0,5,0\n1,20,0\n2,20,3\n3,20,-3\n4,20,3\n"
BLANKS = PLAIN.replace(",", "  ")


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        f"#{PLAIN}",  # as numpy.savetxt writes them
        f"# of the rig\n\n# {PLAIN}# the end\n",
        PLAIN.replace("5,", "5.0D+00,").replace("20,", "2.0d1,"),  # Fortran
        PLAIN.replace(" [s]", "").replace(" [N]", "").replace("x\n", "x\ns,N,N\n"),
        PLAIN.replace(" [s]", "").replace(" [N]", "").replace("x\n", "x\n-,[N],(N)\n"),
        "sep=;\n" + PLAIN.replace(",", ";"),
        PLAIN.replace("\n", ",\n").replace("],\n", "]\n", 1),
        PLAIN.replace("\n", ",,\n"),
        BLANKS,
        f"# {BLANKS}",
        BLANKS.replace(" [s]", "").replace(" [N]", "").replace("x\n", "x\ns  N  N\n"),
        PLAIN.title().replace("_", " "),
        PLAIN.replace("\n", "\r"),
    ],
)  # fmt: skip
def test_series_as_programs_write_them(folder: Path, text: str) -> None:
    Path("history.csv").write_text(text, encoding="utf-8", newline="")
    assert read_series(Path("history.csv")) == {
        "normal_load": [5.0, 20.0, 20.0, 20.0, 20.0], "tangential_load_x": [0.0, 0.0, 3.0, -3.0, 3.0],
    }  # fmt: skip


@pytest.mark.parametrize("nothing", ["", "NaN", "nan", "N/A", "-", "null"])
def test_a_missing_value_keeps_the_quantity_and_is_counted(folder: Path, nothing: str) -> None:
    put("history.csv", f"normal_load [N],tangential_load_x [N],label\n10,0,-\n{nothing},2,-\n20,3,-\n")
    case = Case.from_toml(put("deck.toml", SERIES))
    assert targets(case) == [(10, 0, 0, 0), (10, 2, 0, 0), (20, 3, 0, 0)]
    assert (
        dict(case_rows(case))["load steps"]
        == "3; 1 of 3 rows of a series keep the normal load of the row before"
    )
    put("history.csv", f"normal_load [N],approach [um]\n10,{nothing}\n{nothing},2\n")
    assert dict(case_rows(Case.from_toml(put("deck.toml", SERIES))))["load steps"] == "2"


def test_what_is_unusual_in_a_series_is_named(folder: Path) -> None:
    for text, sentence in (
        (f"Operator: n.n.\n{PLAIN}", "line 2: expected 1 cell, as many as headers in line 1, not 3"),
        (f"{PLAIN}5,-1e-6,0\n", "; this is noise, 5e-08 of the largest one: write 0"),
        ("normal_load [mN]\n20 000\n", "expected a number without separators of thousands"),
        ('normal_load [N]\n"1,000"\n', "expected a decimal point, not a comma"),
        ("normal_load,twist\nN,N\n1,2\n", 'column "twist": expected an angle'),
        ("Normal_Lod\n1\n", "did you mean normal_load?"),
        ("Normal load,normal_load\n1,2\n", 'once; "Normal load" and "normal_load" are normal_load'),
        ("normal_load\n-5\n", 'line 2, column "normal_load" = "-5"'),
    ):
        put("history.csv", text)
        assert sentence in "\n".join(complaint(put("deck.toml", SERIES)))
    Path("history.csv").write_text(PLAIN, encoding="utf-16")
    assert "is UTF-16 text; save it as UTF-8" in "\n".join(complaint(put("deck.toml", SERIES)))


def test_mistakes_about_series(folder: Path) -> None:
    def wrong(load: str) -> str:
        return "\n".join(complaint(put("deck.toml", f"{DECK}[[load]]\n{load}\n")))

    assert wrong('series = { file = "no.csv" }').endswith(
        "no.csv: no such file; expected a CSV or netCDF file of loads"
    )
    assert "no.nc: no such file" in wrong('series = { file = "no.nc" }')
    assert "is a folder" in wrong('series = { file = "." }')
    put("bad.nc", "not netCDF")
    assert "bad.nc: cannot be read as netCDF" in wrong('series = { file = "bad.nc" }')
    Path("latin.csv").write_bytes(b"normal_load\n\xe4\n")
    assert "latin.csv: is not UTF-8 text (byte 12)" in wrong('series = { file = "latin.csv" }')
    put("h.csv", "P,Q\n1,0\n")
    known = 'file = "h.csv", columns = { normal_load = "%s" }'
    assert 'h.csv: has no column "R" for normal_load; there are "P" and "Q"' in wrong(
        f"series = {{ {known % 'R'} }}"
    )
    assert "load.1.series.columns.normal_lod: unknown key; did you mean normal_load?" in wrong(
        'series = { file = "h.csv", columns = { normal_lod = "P" } }'
    )
    assert "load.1.series.fil: unknown key; did you mean file?" in wrong('series = { fil = "h.csv" }')
    assert "load.1.series: expected a file, or arrays" in wrong("series = { }")
    assert "load.1.series.columns: " not in wrong("series = 3")
    assert "expected 2 entries, as many as normal_load has, not 1" in wrong(
        "series = { normal_load = [1, 2], shift_x = [1] }"
    )
    assert "not both (entry 2)" in wrong('series = { normal_load = [1, 2], approach = ["", 1] }')
    assert "load.1.series.normal_load" in wrong("series = { normal_load = [1, true] }")
    assert "expected in the file, not beside it" in wrong('series = { file = "h.csv", normal_load = [1] }')
    assert "load.1.ramp = " in wrong('ramp = "cubic"\nseries = { normal_load = [1] }')
    assert "expected path or series, not both" in wrong(
        "path = [{ normal_load = 1 }]\nseries = { normal_load = [1] }"
    )
    assert "expected at most 100000 load steps" in wrong("repeat = 100000\nseries = { normal_load = [1, 2] }")


def test_many_mistakes_are_cut_short(folder: Path) -> None:
    put("h.csv", "normal_load\n" + "x\n" * 50)
    with pytest.raises(DeckError) as error:
        read_series(Path("h.csv"))
    assert len(str(error.value).splitlines()) == 11
    assert str(error.value).endswith("h.csv: and 40 more")


# --- decks written again --------------------------------------------------------------------------

EVERY_KEY = """
title = "All keys"
body.1.young_modulus = 210e9
body.1.poisson_ratio = 0.3
body.1.rigid = false
body.1.surface = { shape = "paraboloid", radius_x = 1, radius_y = 2, angle = "30 deg", offset = [0, 1e-5] }
body.2 = { rigid = true, surface = { shape = "power", exponent = 2, coefficient = "0.1 mm^-1" } }
friction.coefficient = inf
grid = { spacing = "2 um", extent = "auto", center = [0, 1e-5], origin = ["1 um", 0] }
solver.algorithm = "static"
solver.method = "fft"
solver.tolerance = 1e-6
solver.coupling = "goodman"
solver.entry = "interpolated"
output = { file = "x.nc", fields = ["pressure", "zone"], every = 3 }
load = [
  { normal_load = "1 N", ramp = "cubic", steps = 3, label = "a" },
  { tangential_load_x = 0.1, tangential_load_y = 0.1, torque = "1 N um" },
  { approach = "1 um", shift_x = 0, shift_y = 0, twist = "0.001 deg", values = [0.5, 1] },
  { repeat = 2, label = "p", path = [{ twist = "0 deg" }, { normal_load = 1, ramp = "linear" }] },
  { repeat = 2, steps = 2, series = { normal_load = [1, 2], twist = ["0.001 deg", ""], label = ["u", ""] } },
]
"""


@pytest.mark.parametrize("text", [DECK + PRESS, EVERY_KEY], ids=["defaults", "every key"])
def test_a_deck_with_every_key_written_out_is_the_same_case(text: str) -> None:
    case = Case.from_text(text)
    again = Case.from_text(written(case.deck))
    assert again == case
    assert again.deck == case.deck
    assert written(again.deck) == written(case.deck)


def test_every_default_is_written(folder: Path) -> None:
    tables = tomllib.loads(written(Case.from_text(DECK + PRESS).deck))
    solver = {"method": "auto", "tolerance": 1e-8, "coupling": "full", "entry": "implicit"}
    assert tables["solver"] == {**solver, "iteration": "newton", "step_tolerance": 0.01}
    assert tables["output"] == {"every": 1}
    cells = {"cell_ratio": 1.0, "boundary": "free"}
    assert tables["grid"] == {"nodes_in_radius": 8.0, "extent": "auto", "origin": [0.0, 0.0], **cells}
    assert tables["load"] == [{"normal_load": 10.0, "ramp": "linear", "label": ""}]
    assert tables["title"] == "Ball"


@pytest.mark.parametrize(
    "path",
    [path for path in sorted((ROOT / "cases").glob("*.toml")) if not path.stem.startswith("study_")],
    ids=lambda path: path.name,
)
def test_cases_written_out_are_the_same(path: Path) -> None:
    case = Case.from_toml(path)
    assert Case.from_text(written(case.deck)) == case


def test_other_cases_are_not_equal() -> None:
    case = Case.from_text(DECK + PRESS)
    for old, new in (
        ("0.5", "0.4"),
        ("10 mm", "11 mm"),
        ("radius = 8", "radius = 9"),
        ('"10 N"', '"10.1 N"'),
        ("Ball", "B"),
    ):
        assert case != Case.from_text((DECK + PRESS).replace(old, new)), new
    assert case == Case.from_text((DECK + PRESS).replace('"10 mm"', "0.01"))
    assert case != 3
    assert Deck.parse(tomllib.loads(DECK + PRESS), Source()) == case.deck


# --- the work -------------------------------------------------------------------------------------


COARSER = {"mindlin_loop": {"grid.nodes_in_radius": 20}}  # the number of iterations changes little


@pytest.mark.parametrize("name", ["dissimilar_fretting", "mindlin_loop", "hertz_spheres"])
def test_the_work_is_estimated_to_a_factor_of_two(name: str) -> None:
    case = Case.from_toml(ROOT / f"cases/{name}.toml", COARSER.get(name))
    expected = operator_applications(case)
    assert expected is not None
    spent = case.run().history["operator_applications"].sum()
    assert 0.5 < expected / spent < 2
    (work,) = (text for key, text in case_rows(case) if key == "work")
    count, duration = re.fullmatch(
        r"about ([\d,]+) operator applications, about (.*) on one core", work
    ).groups()
    assert int(count.replace(",", "")) == pytest.approx(expected, rel=0.05, abs=0.5)  # two digits
    time = seconds(case)
    assert duration == ("a second or less" if time < 1 else f"{time:.0f} s")


def test_the_time_is_estimated_to_its_order_of_magnitude() -> None:
    """Processor time of one thread: the ratio of two cases, which no machine changes much; a wide bound."""
    program = f"""
        import time
        from hexcontact import Case
        from hexcontact.problem.preview import seconds
        Case.from_toml({str(ROOT / "cases/hertz_spheres.toml")!r}).run()  # imports
        for name, spacing in ("dissimilar_fretting", "3.5 um"), ("hertz_spheres", "0.004 mm"):
            case = Case.from_toml(f"{ROOT / "cases"}/{{name}}.toml", {{"grid.spacing": spacing}})
            began = time.process_time()
            case.run()
            print(seconds(case) / (time.process_time() - began))
    """
    words = [sys.executable, "-c", textwrap.dedent(program)]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    one, other = map(float, done.stdout.split())
    assert 0.2 < one / other < 5.0
    assert 0.02 < one < 50.0


def test_work_grows_with_nodes_steps_and_entry() -> None:
    def time(extra: str, nodes: int = 40, steps: int = 10) -> float:
        text = (
            DECK.replace("= 8", f"= {nodes}") + f"[solver]\nmethod = 'fft'\n{extra}\n{PRESS}steps = {steps}\n"
        )
        spent = seconds(Case.from_text(text))
        assert spent is not None
        return spent

    assert time("", 80) > 3 * time("") > 2.9 * time("", steps=10)
    assert time("", steps=20) == pytest.approx(2 * time(""))
    assert time('entry = "interpolated"', 160) == pytest.approx(4 * time("", 160), rel=0.2)
    direct = Case.from_text(DECK + PRESS + "[solver]\nmethod = 'direct'")
    assert operator_applications(direct) is None
    assert ("work", "LAPACK on the nodes in contact, not estimated") in case_rows(direct)


# --- the command ----------------------------------------------------------------------------------


def test_check_on_the_terminal(folder: Path) -> None:
    put("m.toml", "[solver]\ntolerance = 2\n")
    deck = put("deck.toml", 'include = ["m.toml"]\n' + DECK + PRESS)
    wrong = ["--set", "load.1.steps=0", "--set", "grid.spacng='1 mm'"]
    refused = CliRunner().invoke(app, ["check", "deck.toml", *wrong])
    assert refused.exit_code == 2
    assert [line.partition(": expected")[0] for line in refused.stderr.splitlines()] == [
        "hexcontact: override: grid.spacng: unknown key; did you mean spacing?",
        "hexcontact: override: load.1.steps = 0",
        "hexcontact: m.toml:2:1: solver.tolerance = 2",
    ]
    settings = ["--set", "solver.tolerance=1e-6", "--set", "load.1.steps=20", "--set"]
    settings += ["load.1.normal_load=12 N"]
    done = CliRunner().invoke(app, ["check", "deck.toml", *settings])
    assert done.exit_code == 0
    for row in (
        r"load steps +20",
        r"largest load +12\.00 N",
        r"tolerance 1e-06",
        r"work +about 240 operator",
    ):
        assert re.search(row, done.stdout), row
    deck.write_text("a = 1\nb = ]\n", encoding="utf-8")
    assert CliRunner().invoke(app, ["check", "deck.toml"]).stderr == (
        "hexcontact: deck.toml:2:5: is not TOML: Invalid value\n"
    )
