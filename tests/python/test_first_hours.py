"""Typical mistakes get the sentence that ends them; what a command prints looks well where it is read."""

from __future__ import annotations

import fcntl
import math
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
from commands import ENVIRONMENT
from typer.testing import CliRunner, Result

import hexcontact
from hexcontact import Case, DeckError
from hexcontact.case import Body
from hexcontact.cli.app import app
from hexcontact.deck import table_base
from hexcontact.deck.surfaces import SHAPES
from hexcontact.deck.toml import starter
from hexcontact.surfaces import Sphere
from hexcontact.text import cut

DECK = starter("fretting")
STUDY = 'deck = "deck.toml"\n[[parameter]]\nkey = "friction.coefficient"\nname = "mu"\nvalues = [0.3, 0.4]\n'
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
COARSE = DECK.replace("nodes_in_radius = 20", "nodes_in_radius = 6")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck.toml").write_text(COARSE, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path


def command(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def refused(*words: str) -> list[str]:
    done = command(*words)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    return done.stderr.splitlines()


QUOTES = "a value with a unit stands in quotes: "
PRESSING = 'normal_load = "100 N"\nramp = "cubic"'  # what the first load of the deck has
WRONG = [  # what stands in the deck, what is written instead, the only lines of the answer
    ('normal_load = "100 N"', "normal_load = 40 N", [rf"\d+:18: is not TOML: .*; {QUOTES}\"40 N\""]),
    ('radius = "10 mm"', "radius = 10 mm", [f"9:.*; {QUOTES}\"10 mm\""]),
    ("coefficient = 0.3", "coefficient = 30 %", [f".*; {QUOTES}\"30 %\""]),
    ("poisson_ratio = 0.3\n", "poisson_ratio = 0,3\n", [r"8:18: .*; a number has a decimal point: 0\.3"]),
    ("nodes_in_radius = 20", "nodes_in_radius = 20\nmu = 1", [r".*grid\.mu: .* friction\.coefficient\?"]),
    ('young_modulus = "210 GPa"', 'E = "210 GPa"', [r"7:1: body\.1\.E: .* did you mean young_modulus\?"]),
    ("poisson_ratio = 0.3\n", "nu = 0.3\n", [r"8:1: body\.1\.nu: unknown key; did you mean poisson_ratio\?"]),
    ("coefficient = 0.3", "mu = 0.3", [r".*friction\.mu: unknown key; did you mean coefficient\?"]),
    ('normal_load = "100 N"', 'P = "100 N"', [r".*load\.1\.P: unknown key; did you mean normal_load\?"]),
    (PRESSING, 'force_x = "9 N"', [r".*load\.1\.force_x: .*; did you mean tangential_load_x\?"]),
    (PRESSING, 'weight = "9 N"', [r".*load\.1\.weight: unknown key; known here: .*"]),
    (PRESSING, 'tangential_load_x = "9 N"', [r".* above zero somewhere in the history"]),
    ('"10 mm"', '"10,5 mm"', [r".*; a number has a decimal point: 10\.5"]),
    ("[grid]", "[friction]", [r"\d+:10: is not TOML: Cannot declare \('friction',\) twice"]),
    ("[[load]]", "[load]\nsteps = 1\n[load]", [r"\d+:6: .*; of several tables .*: \[\[load\]\]"]),
    ("normal_load = ", "Normal_Load = ", [r".*load\.1\.Normal_Load: .*; did you mean normal_load\?"]),
    (PRESSING, 'Tangential_Load_X = "9 N"', [r".*load\.1\.T.*_X: .*; did you mean tangential_load_x\?"]),
    (PRESSING, 'tangentialLoadY = "9 N"', [r".*load\.1\.t.*Y: .*; did you mean tangential_load_y\?"]),
    ("young_modulus", '"Young modulus"', [r".*body\.1\.Young modulus: .*; did you mean young_modulus\?"]),
    ("radius = ", "R = ", [r".*body\.1\.surface\.R: unknown key; did you mean radius\?"]),
    ("nodes_in_radius = 20", 'h = "1 um"', [r".*grid\.h: unknown key; did you mean spacing\?"]),
    ("[friction]", "[frction]", [r".*frction: unknown key; did you mean friction\?"]),
    ("[grid]", "[grd]", [r".*grd: unknown key; did you mean grid\?"]),
    ("nodes_in_radius = 20", 'spacing = "1 mm"', [r'.* half-width of about 0\.234 mm, such as "11\.7 um"']),
    ("nodes_in_radius = 20", 'spacing = "1 nm"', [r".* not \d+: a spacing of 5\.\d+ nm or more"]),
]  # fmt: skip


@pytest.mark.parametrize(("before", "after", "expected"), WRONG, ids=[after for _, after, _ in WRONG])
def test_a_mistake_gets_the_sentence_that_ends_it(
    folder: Path, before: str, after: str, expected: list[str]
) -> None:
    assert before in DECK
    (folder / "wrong.toml").write_text(DECK.replace(before, after, 1), encoding="utf-8")
    lines = refused("run", "wrong.toml")
    assert len(lines) == len(expected), lines
    for line, pattern in zip(lines, expected, strict=True):
        assert re.fullmatch(rf"hexcontact: wrong\.toml:{pattern}", line), line


@pytest.mark.parametrize(
    ("setting", "meant"),
    [
        ("nodes_in_radius=5", "grid.nodes_in_radius"),
        ("mu=0.5", "friction.coefficient"),
        ("coefficient=0.5", "friction.coefficient"),
        ("grid.h=1e-6", "spacing"),
    ],
)
def test_a_key_without_its_table_is_found(folder: Path, setting: str, meant: str) -> None:
    assert refused("run", "deck.toml", "--set", setting)[0].endswith(f"did you mean {meant}?")


def test_the_friction_of_an_interface_is_that_of_the_friction_table(folder: Path) -> None:
    (folder / "wrong.toml").write_text(
        f'{DECK}\n[interface]\ncoefficient = "1e14 Pa/m"\nmu = 0.3\n', encoding="utf-8"
    )
    [line] = refused("run", "wrong.toml")
    assert line.endswith("interface.mu: unknown key; did you mean friction.coefficient?")


@pytest.mark.parametrize(
    ("setting", "answer"),
    [
        ("load.normal_load=5", "not normal_load (entries of arrays count from 1: load.1.normal_load)"),
        (
            "load[0].normal_load=5",
            "expected the number of an entry between points, from 1: load.1.normal_load",
        ),
        ("load.9.normal_load=5", "expected an entry from 1 to 2, not 9"),
    ],
)
def test_entries_of_arrays_are_numbers(folder: Path, setting: str, answer: str) -> None:
    [line] = refused("run", "deck.toml", "--set", setting)
    assert line.endswith(answer)


def test_a_load_above_friction_is_one_mistake_until_friction_carries_it_again(folder: Path) -> None:
    shear = "".join(f"\n[[load]]\ntangential_load_x = {load}\nsteps = 4\n" for load in (60, 10, 70))
    (folder / "wrong.toml").write_text(DECK + shear, encoding="utf-8")
    first, second = refused("check", "wrong.toml")
    assert "load.3.tangential_load_x = 60.0: gross sliding" in first
    assert "load.5.tangential_load_x = 70.0: gross sliding" in second


def test_a_required_key_that_stands_elsewhere_is_one_mistake(folder: Path) -> None:
    empty = {"grid.spacing": DECK.replace("nodes_in_radius", "#"), "accuracy.target": f"{DECK}\n[accuracy]\n"}
    for path, deck in empty.items():
        key = path.partition(".")[2]
        (folder / "wrong.toml").write_text(f"{key} = 0.02\n{deck}", encoding="utf-8")
        [line] = refused("run", "wrong.toml")
        assert line.endswith(f"wrong.toml:1:1: {key}: unknown key; did you mean {path}?")
    (folder / "wrong.toml").write_text(f'{STUDY}\n"" = 1\n', encoding="utf-8")
    [line] = refused("study", "wrong.toml")
    assert "parameter.1.: unknown key; known here: count" in line


def test_the_other_kind_of_file_is_named(folder: Path) -> None:
    for verb in ("run", "check"):
        [line] = refused(verb, "study.toml")
        assert (
            line
            == "hexcontact: study.toml is a study and no deck; hexcontact study study.toml runs its cases"
        )
    [line] = refused("study", "deck.toml")
    assert line == "hexcontact: deck.toml is a deck and no study; hexcontact run deck.toml solves it"
    [line] = refused("info", "deck.toml")
    assert "deck.toml is a TOML file; expected a netCDF file, which hexcontact run or study writes" in line
    (folder / "other.nc").write_bytes(b"\x89HDF\r\n\x1a\n")
    [line] = refused("run", "other.nc")
    assert "other.nc: is a netCDF file, such as a result; hexcontact info shows it; expected a deck" in line


def test_quantities_of_pint_are_refused_in_a_sentence() -> None:
    unit = pint.UnitRegistry()
    words = "in Python a quantity with a unit is given as text"
    with pytest.raises(hexcontact.DeckError, match=f"radius = 10 millimeter: expected a length.*; {words}$"):
        Sphere(radius=10 * unit.mm)  # type: ignore[arg-type]
    ball = {**STEEL, "surface": Sphere(radius=1e-2)}
    with pytest.raises(hexcontact.DeckError, match=f"normal_load = 100 newton: .*; {words}$"):
        Case(body_1=ball, body_2=STEEL, nodes_in_radius=8, normal_load=100 * unit.N)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("mu", "did you mean friction_coefficient?"),
        ("E", "did you mean body_1.young_modulus?"),
        ("Q", "did you mean loads.tangential_load_x?"),
        ("max_nodes", "did you mean accuracy.max_nodes?"),
        ("friction", "did you mean friction_coefficient?"),
        ("normal_laod", "did you mean normal_load?"),
        ("radius", "known here: body_1, body_2, gap, "),
    ],
)
def test_an_unknown_argument_is_named_with_the_nearest(name: str, hint: str) -> None:
    with pytest.raises(TypeError) as caught:
        Case(body_1=STEEL, body_2=STEEL, gap=lambda x, y: x**2 + y**2, nodes_in_radius=8, **{name: 1.0})
    assert str(caught.value).startswith(f"{name}: unknown argument of Case; {hint}")


def test_an_unknown_argument_of_a_body_or_a_load_is_named_with_the_nearest() -> None:
    with pytest.raises(TypeError, match=r"^nu: unknown argument of Body; did you mean poisson_ratio\?$"):
        Body(young_modulus=1e9, nu=0.3)  # type: ignore[call-arg]
    ball = {**STEEL, "surface": Sphere(radius=1e-2)}
    session = Case(body_1=ball, body_2=STEEL, nodes_in_radius=8, normal_load=1.0).start()
    with pytest.raises(
        TypeError, match=r"^P: unknown argument of Session.advance; did you mean normal_load\?$"
    ):
        session.advance(P=1.0)  # type: ignore[call-arg]


def test_a_gap_function_of_numbers_is_refused_in_a_sentence() -> None:
    def case(gap: Any) -> Case:
        return Case(body_1=STEEL, body_2=STEEL, gap=gap, nodes_in_radius=8, normal_load=10.0)

    for gap in (lambda x, y: math.hypot(x, y) ** 2, lambda x, y: max(x, 0.0) ** 2 + y * y + min(x, 0.0) ** 2):
        with pytest.raises(
            hexcontact.DeckError, match=r"^gap: expected a function of two arrays, .*numpy\.vectorize"
        ):
            case(gap)
        assert case(np.vectorize(gap)).lattice.size > 100
    with pytest.raises(TypeError, match="positional argument"):  # a mistake of another kind stays
        case(lambda r: r)


# --- on a terminal, in a pipe -------------------------------------------------------------------------------


def on_a_terminal(folder: Path, columns: int, *words: str) -> str:
    """Run the command on a terminal of some columns and return what it writes, without colors."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    environment = {key: value for key, value in ENVIRONMENT.items() if key not in ("LINES", "NO_COLOR")}
    environment |= {"TERM": "xterm"}
    process = subprocess.Popen(
        [sys.executable, "-m", "hexcontact", *words], cwd=folder, env=environment, stdin=slave, stdout=slave,
        stderr=slave,
    )  # fmt: skip
    os.close(slave)
    written = b""
    while True:
        try:
            part = os.read(master, 65536)
        except OSError:  # Linux says so at the end
            break
        if not part:
            break
        written += part
    os.close(master)
    assert process.wait() == 0, written.decode()
    plain = re.sub(r"\x1b\[[0-9;]*m", "", written.decode())  # colors; what moves the cursor begins a line
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\n", plain).replace("\r", "\n")


def test_progress_fits_on_eighty_columns(folder: Path) -> None:
    title = "Stiff sphere on aluminum flat, pressed and sheared to and fro in the laboratory of Twente"
    (folder / "long.toml").write_text(re.sub('title = ".*"', f'title = "{title}"', COARSE), encoding="utf-8")
    shown = on_a_terminal(folder, 80, "run", "long.toml")
    lines = [line.rstrip() for line in shown.split("\n")]
    assert max(map(len, lines)) <= 80
    assert "…" not in shown
    assert any(re.search(r"\d+/37 \d:\d\d:\d\d left: (\d:\d\d:\d\d|-:--:--)", line) for line in lines), shown
    # Between two drawings of the bar many steps may pass: which are shown is chance, but for the last.
    steps = {line.strip() for line in lines if re.match("  (press|to|fro|back)  P ", line)}
    assert any(line.startswith("back  P 100.0 N  Qx 24.00 N") for line in steps), shown
    whole = re.compile(
        r"\w+  P [\d.]+ m?N(  Qx -?[\d.]+ m?N)?(  approach [\d.]+ .m)?(  shift x -?[\d.]+ .?m)?"
        r"(  stick [\d.]+ %)?(  R [\d.e-]+)?"
    )
    for line in steps:
        assert whole.fullmatch(line), line


def test_a_line_is_cut_between_its_parts() -> None:
    line = "to  P 100.0 N  Qx 24.00 N  approach 5.467 µm"
    assert cut(line, 100) == line
    assert cut(line, len(line) - 1) == "to  P 100.0 N  Qx 24.00 N"
    assert cut("case 3 (mu = 0.3): done", 20) == "case 3 (mu = 0.3):"
    assert cut("unbreakable", 4) == "unbr"


def test_piped_tables_end_without_blanks(folder: Path) -> None:
    for words in (["check", "deck.toml"], ["run", "deck.toml"], ["info", "deck.nc"]):
        program = [sys.executable, "-m", "hexcontact", *words]
        lines = subprocess.run(program, cwd=folder, capture_output=True, text=True).stdout.splitlines()
        assert len(lines) > 10
        assert [line for line in lines if line != line.rstrip()] == []


def test_piped_help_ends_without_blanks() -> None:
    done = subprocess.run([sys.executable, "-m", "hexcontact", "run", "-h"], capture_output=True, check=True)
    lines = done.stdout.decode().splitlines()
    assert len(lines) > 20
    assert [line for line in lines if line != line.rstrip()] == []


@pytest.mark.usefixtures("laid_out_once")
def test_written_files_have_the_names_that_were_given(folder: Path) -> None:
    (folder / "sub").mkdir()
    for given in ("sub/out.nc", str(folder / "sub/out.nc")):
        shown = command("run", "deck.toml", "-o", given, "--overwrite", "--plot").stdout.splitlines()[-1]
        assert shown == f"written: {given}, {given.replace('.nc', '.png')}"
    assert command("plot", "sub/out.nc").stdout == "written: sub/out_overview.png\n"
    assert command("report", "sub/out.nc").stdout == "written: sub/out.html\n"


def test_a_wrong_case_is_named_by_the_names_that_were_given(folder: Path) -> None:
    (folder / "wrong.toml").write_text(STUDY.replace("0.4]", "0.1]"), encoding="utf-8")
    assert {line.partition(" (in case ")[2] for line in refused("study", "wrong.toml")} == {"2: mu = 0.1)"}
    (folder / "first.toml").write_text(STUDY.replace("[0.3", "[0.1"), encoding="utf-8")
    assert {line.partition(" (in case ")[2] for line in refused("study", "first.toml")} == {"1: mu = 0.1)"}


def test_a_plan_shows_no_rounding_errors(folder: Path) -> None:
    shear = 'key = "load.2.path.1.tangential_load_x"\nname = "Q"\nexpression = "0.8 * 0.2 * 100"\n'
    (folder / "short.toml").write_text(f"{STUDY}[[parameter]]\n{shear}", encoding="utf-8")
    rows = [line.split() for line in command("study", "short.toml", "--plan").stdout.splitlines()]
    assert rows[:2] == [["case", "mu", "Q", "state"], ["1", "0.3", "16.0", "missing"]]


def test_a_study_names_its_parameters_and_has_no_empty_job(folder: Path) -> None:
    done = command("study", "study.toml", "--jobs", "1")
    assert done.exit_code == 0, done.output
    assert "case 1 (mu = 0.3): done in" in done.stderr
    script = command("study", "study.toml", "--slurm").stdout
    assert script == "#!/bin/sh\n# no case is missing\n"
    assert subprocess.run(["sh", "-c", script], check=False).returncode == 0


def test_a_result_shows_its_warnings_and_where_pictures_are() -> None:
    body = {"young_modulus": 210.0, "poisson_ratio": 0.3}  # GPa were meant
    sphere = {**body, "surface": {"shape": "sphere", "radius": 0.01}}
    result = Case(body_1=sphere, body_2=body, nodes_in_radius=4, normal_load=50.0).run()
    assert "warning: the surfaces slope by" in repr(result)
    assert "warning: the largest pressure is" in result._repr_html_()
    with pytest.raises(AttributeError, match=r"hexcontact\.plotting\.overview\(result\)"):
        _ = result.plot
    with pytest.raises(AttributeError, match=r'case\.run\("name\.nc"\)'):
        _ = result.save


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ('diameter = "20 mm"', r'diameter = "20 mm": unknown key; use radius, half the diameter: 10 mm'),
        ("Diameter = 0.02", r"Diameter = 0\.02: unknown key; use radius, half the diameter: 10 mm"),
        ('diameter = "wide"', r'diameter = "wide": unknown key; use radius, half the diameter'),
    ],
)
def test_a_diameter_names_the_radius(folder: Path, size: str, words: str) -> None:
    (folder / "wrong.toml").write_text(DECK.replace('radius = "10 mm"', size), encoding="utf-8")
    [line] = refused("check", "wrong.toml")
    assert re.fullmatch(rf".*body\.1\.surface\.{words}", line)


@pytest.mark.parametrize(
    "key",
    [
        "Yield Stress",
        "temperature",
        "thermal_conductivity",
        "viscosity",
        "density",
    ],
)
def test_features_that_are_not_included_point_to_the_limits(folder: Path, key: str) -> None:
    page = (Path(__file__).parents[2] / "docs/limits.md").read_text(encoding="utf-8")
    for name in table_base._NOT_INCLUDED:
        assert any(word[:10] in page for word in name.split() if word not in ("and", "bodies"))
    with pytest.raises(DeckError, match=r"unknown key; [a-z ]+: not included \(docs/limits\.md says"):
        Case.from_toml("deck.toml", {f"body.1.{key}": 1})
    with pytest.raises(TypeError, match=r"unknown argument of Case; [a-z ]+: not included \(docs/limits\.md"):
        Case(**{"body_1": {}, "body_2": {}, key: 1})


@pytest.mark.parametrize(
    ("key", "meant"),
    [("grid.periodic", "boundary"), ("load.1.creepage", "creepage_x"), ("load.1.rolling_to", "rolling")],
)
def test_rolling_and_windows_that_repeat_are_included(folder: Path, key: str, meant: str) -> None:
    with pytest.raises(DeckError, match=f"unknown key; did you mean {meant}\\?"):
        Case.from_toml("deck.toml", {key: 1})


# --- contacts that are hollow, long, or no ellipse ----------------------------------------------------------

BODIES = """
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = {}
[body.2]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = {}
[grid]
{}
[[load]]
normal_load = "{} N"
"""
BALL = '{ shape = "sphere", radius = "4.7625 mm" }'
FLAT = '{ shape = "flat" }'


def of_formula(expression: str) -> str:
    return f'{{ shape = "formula", expression = "{expression}" }}'


def test_a_groove_of_a_formula_is_compared_with_hertz(folder: Path) -> None:
    groove = of_formula("-x**2/(2*4.89e-3) + y**2/(2*18.2375e-3)")
    Path("groove.toml").write_text(BODIES.format(BALL, groove, "nodes_in_radius = 20", 555.5556))
    shown = command("run", "groove.toml").stdout
    exact = re.findall(
        r"^ *(max pressure|approach|\w+ half-axis).*? +([\d.]+ \wm|[\d.]+ GPa) .*%", shown, re.M
    )
    assert [(name, value) for name, value in exact] == [
        ("max pressure", "1.74585 GPa"),
        ("approach", "6.62184 µm"),
        ("larger half-axis", "1.34091 mm"),
        ("smaller half-axis", "113.308 µm"),
    ]
    assert "Against Hertz" in command("info", "groove.nc").stdout
    moved = groove.replace(" }", ', offset = ["0.1 mm", "0 mm"] }')
    Path("moved.toml").write_text(BODIES.format(BALL, moved, "nodes_in_radius = 20", 555.5556))
    # first touch is not at height 0, from which the approach counts
    assert re.search(
        r"^ *approach +-32\.59\d* µm +-32\.59\d* µm +[+-]0\.0\d\d %",
        command("run", "moved.toml").stdout,
        re.M,
    )


def test_half_axes_of_a_roller_are_those_of_the_ellipse_with_the_same_moments(folder: Path) -> None:
    roller = of_formula("y**2/16e-3 + 0.00035*16e-3*log(1/max(1-(2*x/16e-3)**2, 1e-12))")
    grid = 'spacing = "40 um"\nextent = ["16 mm", "0.8 mm"]'
    Path("roller.toml").write_text(BODIES.format(roller, FLAT, grid, 10e3))
    for words in (("run", "roller.toml"), ("info", "roller.nc")):
        shown = re.sub(r"\s+", " ", command(*words).stdout)
        assert re.search(
            r"contact half-axes 8\.\d+ mm by 2\d\d\.\d µm of the ellipse with the same moments; the contact "
            r"extends over 15\.3 mm in x and [45]\d\d µm in y",
            shown,
        ), shown
    checked = re.sub(r"\s+", " ", command("check", "roller.toml").stdout)
    assert re.search(r"half-axes about 8\.\d+ mm by .*; extent about 15\.\d mm in x, 5\d\d µm in y", checked)
    ellipse = '{ shape = "paraboloid", radius_x = "50 mm", radius_y = "5 mm" }'
    Path("ellipse.toml").write_text(BODIES.format(ellipse, FLAT, "nodes_in_radius = 8", 100))
    assert "same moments" not in command("run", "ellipse.toml").stdout


@pytest.mark.parametrize(
    ("one", "two", "sentence"),
    [
        (
            BALL,
            '{ shape = "paraboloid", radius_x = "-4.89 mm", radius_y = "18.2375 mm" }',
            'radius_x = "-4.89 mm": expected a length above 0 such as "1 mm"; a hollow is an ellipsoid: '
            '{ shape = "ellipsoid", radius_x = "-5 mm", radius_y = "20 mm" }',
        ),
        (
            '{ shape = "cylinder", radius = "10 mm" }',
            FLAT,
            "touch along a line, so the contact has no end; expected a shape that bounds it: shape = "
            '"roller", which has a length, or a paraboloid with a large radius along the line',
        ),
        (of_formula("y**2/16e-3"), FLAT, "touch along a line, so the contact has no end"),
        (BALL, of_formula("-(x**2 + y**2)/9e-3"), "the gap falls away from the point of contact"),
    ],
)
def test_surfaces_without_a_contact_get_a_remedy(one: str, two: str, sentence: str, folder: Path) -> None:
    Path("deck.toml").write_text(BODIES.format(one, two, "nodes_in_radius = 10", 20))
    [line] = refused("check", "deck.toml")
    assert sentence in line


@pytest.mark.parametrize(
    ("expression", "form"),
    [
        ("(x**2 + y**2)/2e-2", [[100.0, 0.0], [0.0, 100.0]]),
        ("x*y/1e-2 - y**2", [[0.0, 100.0], [100.0, -2.0]]),
        ("0", [[0.0, 0.0], [0.0, 0.0]]),
        ("x**2 + 1e-12", None),
        ("(x - 1e-9)**2", None),
        ("min(x**2, 1)", None),
        ("max(x**2, y**2)", None),
        ("x**2 + x**4", None),
        ("abs(x)", None),
        ("x**2/2e-2 + 1e-9*sin(1e6*x)", None),
        ("1e-2 - sqrt(1e-4 - x**2 - y**2)", None),
    ],
)
def test_quadratic_forms_are_recognized_in_formulas(expression: str, form: list[list[float]] | None) -> None:
    found = SHAPES["formula"](expression=expression).curvature
    assert (found is None) == (form is None)
    if form is not None:
        assert found == pytest.approx(np.array(form), abs=1e-11)
