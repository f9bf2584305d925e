"""Decks: what they say, what is wrong with the wrong ones, and the load history they stand for."""

import math
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest

from hexcontact.deck import keys as tables
from hexcontact.deck.faults import Source, places
from hexcontact.deck.keys import Deck, Load, Segment
from hexcontact.deck.surfaces import SHAPES, Sphere, Surface
from hexcontact.deck.table_base import Table, kind_of
from hexcontact.deck.toml import parse_toml, read_toml, with_overrides
from hexcontact.errors import DeckError
from hexcontact.problem.loads import History, LoadStep, Target, load_steps
from hexcontact.text import shown

ROOT = Path(__file__).parents[2]

GOOD = """\
title = "Sphere on flat"

[body.1]
young_modulus = "432 GPa"
poisson_ratio = 0.32
surface = { shape = "sphere", radius = "1 mm" }

[body.2]
young_modulus = 72e9
poisson_ratio = 0.32

[friction]
coefficient = inf

[grid]
spacing = "3.5 um"
extent = ["0.2 mm", "0.2 mm"]

[solver]
algorithm = "incremental"
method = "fft"

[[load]]
normal_load = "31.5 N"
steps = 10
ramp = "cubic"
label = "press"

[[load]]
tangential_load_x = "3 N"
twist = "0.1 deg"
steps = 30

[output]
file = "fretting.nc"
fields = ["pressure", "traction_x"]
every = 5
"""


def parse(text: str) -> Deck:
    return Deck.parse(tomllib.loads(text), Source("deck.toml", text))


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new, 1)


def complaint(text: str) -> str:
    with pytest.raises(DeckError) as error:
        parse(text)
    assert error.value.exit_code == 2
    return str(error.value)


def test_a_deck_in_si() -> None:
    deck = parse(GOOD)
    assert deck.title == "Sphere on flat"
    assert deck.body.body_1.young_modulus == 432e9
    assert deck.body.body_1.surface == Sphere(radius=1e-3)
    assert deck.body.body_2.young_modulus == 72e9
    assert deck.body.body_2.surface is None
    assert deck.friction is not None
    assert deck.friction.coefficient == math.inf
    assert (deck.grid.spacing, deck.grid.extent) == (3.5e-6, (2e-4, 2e-4))
    assert (deck.grid.origin, deck.grid.center) == ((0.0, 0.0), None)
    assert (deck.solver.algorithm, deck.solver.method) == ("incremental", "fft")
    assert (deck.solver.tolerance, deck.solver.coupling) == (1e-8, "full")
    assert (deck.load[0].normal_load, deck.load[0].steps, deck.load[0].label) == (31.5, 10, "press")
    assert deck.load[1].twist == pytest.approx(math.radians(0.1), rel=1e-15)
    assert (deck.output.file, deck.output.fields, deck.output.every) == (
        Path("fretting.nc"),
        ("pressure", "traction_x"),
        5,
    )


WRONG = [
    (
        "poisson_ratio = 0.32\ns",
        "poison_ratio = 0.32\ns",
        "body.1.poison_ratio: unknown key; did you mean poisson_ratio?",
    ),
    ('title = "Sphere on flat"', "titel = 1", "titel: unknown key; did you mean title?"),
    ("every = 5", "evry = 5", "output.evry: unknown key; did you mean every?"),
    ("every = 5", "qqqq = 5", "output.qqqq: unknown key; known here: every, fields and file"),
    (
        "[friction]\ncoefficient = inf",
        "[friktion]\ncoefficient = inf",
        "friktion: unknown key; did you mean friction?",
    ),
    ("coefficient = inf", "", "friction.coefficient: missing; expected a number of at least 0 (or inf)"),
    (
        'shape = "sphere", radius = "1 mm"',
        'shape = "sphere"',
        'body.1.surface.radius: missing; expected a length above 0 such as "1 mm"',
    ),
    (
        'shape = "sphere", radius = "1 mm"',
        'shape = "sphere", radius = 1, exat = true',
        "body.1.surface.exat: unknown key; did you mean exact?",
    ),
    (
        '"sphere", radius = "1 mm" }',
        '"punch", width = "1 mm", height = "2 mm" }',
        'body.1.surface.width: unknown key; did you mean shape = "rectangular_punch", which has width and',
    ),
    (
        '"sphere", radius = "1 mm" }',
        '"punch", radius = "1 mm", edge_radius = "2 mm" }',
        'body.1.surface.edge_radius: unknown key; did you mean shape = "rounded_punch" or ',
    ),
    (
        '"sphere", radius = "1 mm" }',
        '"rectangular_punch", width = "1 mm", height = "2 mm" }',
        "body.1.surface.height: unknown key; did you mean length?",
    ),
    (
        'young_modulus = "432 GPa"\n',
        "",
        'body.1.young_modulus: missing; expected a pressure such as "210 GPa", or rigid = true',
    ),
    (
        "poisson_ratio = 0.32\ns",
        "poisson_ratio = 0.6\ns",
        "body.1.poisson_ratio = 0.6: expected a number above -1 and at most 0.5",
    ),
    (
        "poisson_ratio = 0.32\ns",
        "poisson_ratio = -1.0\ns",
        "body.1.poisson_ratio = -1.0: expected a number above -1 and at most 0.5",
    ),
    ("72e9", "0", 'body.2.young_modulus = 0: expected a pressure above 0 such as "210 GPa"'),
    ("72e9", '"-72 GPa"', 'body.2.young_modulus = "-72 GPa": expected a pressure above 0 such as "210 GPa"'),
    ("72e9", "nan", 'body.2.young_modulus = nan: expected a pressure above 0 such as "210 GPa"'),
    ("72e9", "inf", 'body.2.young_modulus = inf: expected a pressure above 0 such as "210 GPa"'),
    ("72e9", "true", 'body.2.young_modulus = true: expected a pressure above 0 such as "210 GPa"'),
    (
        'radius = "1 mm"',
        'radius = "-1 mm"',
        'body.1.surface.radius = "-1 mm": expected a length above 0 such as "1 mm"',
    ),
    (
        'normal_load = "31.5 N"',
        "normal_load = -1",
        'load.1.normal_load = -1: expected a force of at least 0 such as "10 N"',
    ),
    (
        "coefficient = inf",
        "coefficient = -0.1",
        "friction.coefficient = -0.1: expected a number of at least 0 (or inf)",
    ),
    (
        "coefficient = inf",
        "coefficient = nan",
        "friction.coefficient = nan: expected a number of at least 0 (or inf)",
    ),
    ("steps = 10", "steps = 0", "load.1.steps = 0: expected a whole number of at least 1"),
    ("steps = 10", "steps = 2.0", "load.1.steps = 2.0: expected a whole number of at least 1"),
    ("steps = 10", "steps = true", "load.1.steps = true: expected a whole number of at least 1"),
    ("steps = 10", "steps = 1000000", "load.1.steps = 1000000: expected a whole number of at most 100000"),
    (
        'method = "fft"',
        "tolerance = 0",
        "solver.tolerance = 0: expected a number of at least 1e-14 and at most 0.1",
    ),
    (
        'radius = "1 mm"',
        'radius = "3 kg"',
        'body.1.surface.radius = "3 kg": expected a length above 0 such as "1 mm"; "kg" is a mass',
    ),
    (
        'spacing = "3.5 um"',
        'spacing = "3.5"',
        'grid.spacing = "3.5": expected a length above 0 such as "1 mm"; a quoted value needs its unit',
    ),
    (
        'twist = "0.1 deg"',
        "twist = 0.1",
        'load.2.twist = 0.1: expected an angle with its unit such as "30 deg"',
    ),
    (
        '"incremental"',
        '"incremntal"',
        'solver.algorithm = "incremntal": expected "frictionless", "static" or "incremental"; did you '
        "mean incremental?",
    ),
    (
        '"sphere"',
        '"spere"',
        'body.1.surface.shape = "spere": expected "flat", "sphere", "paraboloid", "ellipsoid", "cylinder", '
        '"cone", "power", "punch", "rounded_punch", "rectangular_punch", '
        '"torus", "waviness", "dent", "roller", "formula", "map", "profile" or "rough"; did you mean sphere?',
    ),
    (
        '{ shape = "sphere", radius = "1 mm" }',
        "{ radius = 1 }",
        'body.1.surface.shape: missing; expected "flat", "sphere", "paraboloid", "ellipsoid", "cylinder", '
        '"cone", "power", "punch", "rounded_punch", "rectangular_punch", '
        '"torus", "waviness", "dent", "roller", "formula", "map", "profile" or "rough"',
    ),
    (
        '{ shape = "sphere", radius = "1 mm" }',
        '"sphere"',
        'body.1.surface = "sphere": expected a table such as { shape = "sphere", radius = "1 mm" }',
    ),
    (
        '"sphere"',
        '"heights"',
        'body.1.surface.shape = "heights": expected shape = "map" for heights over x and y, or "profile"',
    ),
    (
        'fields = ["pressure", "traction_x"]',
        'fields = ["pressure", "tractionx"]',
        'output.fields = ["pressure", "tractionx"]: expected an array of field names such as '
        '["pressure", "gap", "zone"]; entry 2, "tractionx": expected ',
    ),
    ('title = "Sphere on flat"', "title = 3", "title = 3: expected text in quotes"),
    ("every = 5", "every = []", "output.every = []: expected a whole number of at least 1"),
    (
        "poisson_ratio = 0.32\nsurface",
        "poisson_ratio = 0.32\nrigid = 1\nsurface",
        "body.1.rigid = 1: expected true or false",
    ),
    (
        "poisson_ratio = 0.32\nsurface",
        "poisson_ratio = 0.32\nrigid = true\nsurface",
        "body.1.poisson_ratio = 0.32: expected nothing, since the body is rigid",
    ),
    (
        'spacing = "3.5 um"',
        "",
        "grid.spacing: missing; expected one of spacing, nodes_across and nodes_in_radius",
    ),
    (
        'spacing = "3.5 um"',
        'spacing = "3.5 um"\nnodes_across = 41',
        "grid.nodes_across = 41: expected only one of spacing, nodes_across and nodes_in_radius; "
        "spacing is given too",
    ),
    (
        'spacing = "3.5 um"',
        'spacing = "3.5 um"\nwindow = [3, 3]',
        "grid.window = [3, 3]: expected window or extent, not both",
    ),
    (
        'extent = ["0.2 mm", "0.2 mm"]',
        "window = [3]",
        "grid.window = [3]: expected two whole numbers such as [41, 41]",
    ),
    (
        'extent = ["0.2 mm", "0.2 mm"]',
        'extent = "all"',
        'grid.extent = "all": expected "auto" or two lengths such as ["2 mm", "2 mm"]',
    ),
    (
        'normal_load = "31.5 N"',
        'normal_load = "31.5 N"\napproach = 1',
        "load.1.approach = 1: expected normal_load or approach, not both",
    ),
    (
        'tangential_load_x = "3 N"\ntwist = "0.1 deg"',
        "",
        "load.2: expected at least one of normal_load, tangential_load_x, ... or approach, shift_x, ...",
    ),
    (
        'tangential_load_x = "3 N"',
        'ramp = "cubic"',
        'load.2.ramp = "cubic": a cubic ramp needs normal_load in the same segment',
    ),
    ("steps = 10\n", "values = [0.5, 1]\n", 'load.1.ramp = "cubic": expected ramp or values, not both'),
    (
        'ramp = "cubic"',
        "values = [0.5, 1]",
        "load.1.steps = 10: expected 2, as many as there are values (or no steps at all)",
    ),
    (
        'steps = 10\nramp = "cubic"',
        "values = [0.5, 0.4, 1]",
        "load.1.values = [0.5, 0.4, 1]: expected fractions of the segment, rising to 1, such as [0.1, "
        "0.4, 1]",
    ),
    (
        'steps = 10\nramp = "cubic"',
        "values = [0.5, 0.9]",
        "load.1.values = [0.5, 0.9]: expected fractions of the segment, rising to 1, such as [0.1, 0.4, 1]",
    ),
    ("steps = 10", "repeat = 10", "load.1.repeat = 10: needs a path of segments or a series to repeat"),
    (
        "steps = 10",
        "path = [{normal_load = 1}]",
        'load.1.normal_load = "31.5 N": expected in the path, not beside it',
    ),
    ("steps = 10", "path = []", "load.1.path: expected at least one entry"),
]


@pytest.mark.parametrize(
    ("old", "new", "sentence"), WRONG, ids=[new.replace("\n", " ") for _, new, _ in WRONG]
)
def test_each_mistake_gets_its_sentence(old: str, new: str, sentence: str) -> None:
    assert f": {sentence}" in complaint(changed(old, new))


def test_everything_wrong_is_reported_at_once() -> None:
    text = GOOD.replace("0.32\nsurface", "0.7\nsurface").replace('"1 mm"', '"3 kg"').replace("every", "evry")
    text = text.replace("72e9", "-1").replace("steps = 10", "steps = -1").replace('"3.5 um"', '"1 s"')
    keys = [line.split(": ")[1].split(" = ")[0] for line in complaint(text).splitlines()]
    assert keys == [
        "body.1.poisson_ratio",
        "body.1.surface.radius",
        "body.2.young_modulus",
        "grid.spacing",
        "load.1.steps",
        "output.evry",
    ]


@pytest.mark.parametrize(
    ("old", "new", "start"),
    [
        ("Sphere on flat", "x\ny", "deck.toml:1:11: is not TOML"),
        ("0.32\nsurface", "7\nsurface", "deck.toml:5:1: body.1.poisson_ratio = 7: "),
        ('radius = "1 mm"', "radius = 0", "deck.toml:6:31: body.1.surface.radius = 0: "),
        (', radius = "1 mm"', "", "deck.toml:6:1: body.1.surface.radius: missing"),
        ("coefficient = inf", "", "deck.toml:12:1: friction.coefficient: missing"),
        ("steps = 30", "steps = 0", "deck.toml:32:1: load.2.steps = 0: "),
    ],
)
def test_messages_point_at_the_line(old: str, new: str, start: str) -> None:
    with pytest.raises(DeckError) as error:
        Deck.parse(parse_toml(changed(old, new), "deck.toml"), Source("deck.toml", changed(old, new)))
    assert str(error.value).startswith(start)


def test_rigid_bodies() -> None:
    elastic = "young_modulus = 72e9\npoisson_ratio = 0.32\n\n[friction]"
    assert parse(changed(elastic, "rigid = true\n\n[friction]")).body.body_2.rigid
    both = GOOD.replace(elastic, "rigid = true\n\n[friction]").replace(
        'young_modulus = "432 GPa"\npoisson_ratio = 0.32', "rigid = true"
    )
    assert "body.2 = {rigid = true}: expected one elastic body at least; both are rigid" in complaint(both)


def test_whole_tables_of_the_wrong_kind() -> None:
    one_load = "\n".join(GOOD.split("[[load]]")[0].splitlines()) + "\n[load]\nnormal_load = 1\n"
    assert "load: expected an array of tables: write [[load]]" in complaint(one_load)
    coated = GOOD + '\n[body.1.coating]\nthickness = "1 um"\n'
    assert "body.1.coating: expected an array of tables: write [[body.1.coating]]" in complaint(coated)
    assert "body.1 = 3: expected a table of keys" in complaint("body = { 1 = 3 }")
    empty = complaint("")
    for key in ("body", "grid", "load"):
        assert f"deck.toml: {key}: missing; expected" in empty


# --- files -------------------------------------------------------------------------------------------------


def test_read_toml(tmp_path: Path) -> None:
    path = tmp_path / "deck.toml"
    path.write_text(GOOD, encoding="utf-8")
    data, text = read_toml(path)
    assert text == GOOD
    assert data == tomllib.loads(GOOD)
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())  # as Windows editors save it
    assert read_toml(path)[0] == data


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"a = 1\nb = \n", ":2:5: is not TOML: Invalid value"),
        (b"a = 1\na = 2\n", ":2:6: is not TOML: Cannot overwrite a value; a stands there a second time"),
        (b'a = "x', "is not TOML: "),
        (b"\xff\xfe", ": is UTF-16 text; save it as UTF-8; expected a deck (a TOML file)"),
        (b"CDF\x01\x00", ":1:4: is not TOML: "),
        (b"a = " + b"[" * 20000, ": is not TOML: nested too deeply"),
        (b"a = " + b"9" * 5000, ": is not TOML: "),
    ],
)
def test_unreadable_text(tmp_path: Path, content: bytes, sentence: str) -> None:
    path = tmp_path / "deck.toml"
    path.write_bytes(content)
    with pytest.raises(DeckError) as error:
        read_toml(path)
    assert str(error.value).startswith(f"{path}:")
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


def test_unreadable_files(tmp_path: Path) -> None:
    for path, sentence in [
        (tmp_path / "none.toml", "no such file"),
        (tmp_path, "is a folder"),
        (tmp_path / ("x" * 300), "cannot be read"),
        (tmp_path / "a\0b", "cannot be read"),
    ]:
        with pytest.raises(DeckError, match=sentence):
            read_toml(path)


def test_overrides() -> None:
    data = tomllib.loads(GOOD)
    new = with_overrides(
        data,
        {"grid.spacing": None, "grid.nodes_across": 41, "load.2.steps": 3, "body.2.surface.shape": "flat"},
    )
    assert new["grid"] == {"nodes_across": 41, "extent": ["0.2 mm", "0.2 mm"]}
    assert new["load"][1]["steps"] == 3
    assert new["body"]["2"]["surface"] == {"shape": "flat"}
    assert data == tomllib.loads(GOOD)
    for key in ("load.3.steps", "load.0.steps", "load.x.steps", "load.3"):
        with pytest.raises(DeckError, match=r"expected an entry from 1 to 2"):
            with_overrides(data, {key: 1})
    with pytest.raises(DeckError, match=r"title.x.y: expected a key of a table"):
        with_overrides(data, {"title.x.y": 1})


TEXT = """\
body.1.rigid = true  # body.2.rigid
[a]
  b = 1
"c d" = 2 # [x]

[[l]]
b = '''
b = 3 # [no]'''
[[l]]
b = { c = 1, d = { e = "}," } }
c = [ # entries
  { d = 1 },
  [ 2, 3 ],
]
[l.t]
u = 1
[[l.p]]
v = 1979-05-27T07:32:00Z
[[l.p]]
  v = "\\" ["
[grid]
window = [ 3,
 4 ]
"""


def test_places_of_keys() -> None:
    tomllib.loads(TEXT)
    found = {".".join(path): tuple(place) for path, place in places(TEXT).items()}
    expected = {
        "body.1.rigid": (1, 8), "a": (2, 1), "a.b": (3, 3), "a.c d": (4, 1), "l.1": (6, 1), "l.1.b": (7, 1),
        "l.2": (9, 1), "l.2.b": (10, 1), "l.2.b.c": (10, 7), "l.2.b.d.e": (10, 20), "l.2.c": (11, 1),
        "l.2.c.1.d": (12, 5), "l.2.c.2": (13, 3), "l.2.c.2.2": (13, 8), "l.2.t.u": (16, 1),
        "l.2.p.1.v": (18, 1), "l.2.p.2.v": (20, 3), "grid.window.2": (23, 2),
    }  # fmt: skip
    assert {key: found.get(key) for key in expected} == expected
    assert not {"b", "no", "l.1.b.b", "x"} & set(found)


@pytest.mark.parametrize("path", sorted((ROOT / "cases").glob("*.toml")), ids=lambda path: path.name)
def test_every_key_of_a_deck_has_its_place(path: Path) -> None:
    def keys(value: object, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
        yield path
        entries = value.items() if isinstance(value, dict) else ()
        if isinstance(value, list):
            entries = enumerate(value, start=1)
        for key, entry in entries:
            yield from keys(entry, (*path, str(key)))

    text = path.read_text(encoding="utf-8")
    found = places(text)
    wanted = set(keys(tomllib.loads(text))) - {()}
    assert wanted <= set(found)
    lines = text.splitlines()
    assert len(wanted) > 5
    for name in wanted:
        line, column = found[name]
        there = lines[line - 1][column - 1 :]
        if there.startswith("["):  # the head of a table, or an entry of an array
            table = [part for part in name if not part.isdigit() or part in there]
            assert name[-1].isdigit() or re.match(rf"\[+{re.escape('.'.join(table))}[].]", there), (
                name,
                there,
            )
        elif not name[-1].isdigit():
            assert there.lstrip('"').startswith(name[-1]), (name, there)


def test_places_in_what_is_no_toml_end() -> None:
    for text in (
        "a = [1, [",
        "[[",
        "= 3",
        "a = {b",
        'a = "x',
        "\0",
        "[a\nb = 1",
        "a.b.= 2",
        "]",
        "a = [}, }",
    ):
        places(text)


def test_values_are_shown_as_decks_write_them() -> None:
    assert shown('a"b') == '"a\\"b"'
    assert shown([1, "x", {"a": 2.5, "b": False}]) == '[1, "x", {a = 2.5, b = false}]'
    assert len(shown("x" * 1000)) == 60
    assert len(shown(10**5000)) == 60
    deep: list[object] = []
    for _ in range(10000):
        deep = [deep]
    assert shown(deep) == "[[[[[...]]]]]"


# --- shares of friction ------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["0.6 mu P", "0.6*mu*P", " .6e0 \u00b5 P", "+0.6\u03bcP"])
def test_a_tangential_load_may_be_a_share_of_what_friction_carries(text: str) -> None:
    press = {"normal_load": 20.0, "tangential_load_x": text}
    more = {"normal_load": "40 N", "tangential_load_y": "-0.5 mu P", "steps": 2}
    steps = history(press, {"path": [more], "repeat": 1}, mu=0.3)
    assert steps[0].x.value == pytest.approx(0.6 * 0.3 * 20.0, rel=1e-15)
    assert steps[-1].y.value == pytest.approx(-0.5 * 0.3 * 40.0, rel=1e-15)
    assert steps[1].y.value == pytest.approx(0.5 * steps[2].y.value, rel=1e-15)
    assert steps[-1].x == steps[0].x  # newtons: a later segment does not change it
    load = Load(**press)
    assert load.written()["tangential_load_x"] == "0.6 mu P"
    assert Load(**load.written()) == load


@pytest.mark.parametrize(
    ("mu", "load", "sentence"),
    [
        (None, {"normal_load": 1.0}, "expected nothing, or a [friction] table with a coefficient above 0"),
        (math.inf, {"normal_load": 1.0}, "expected newtons, since friction.coefficient is inf"),
        (0.3, {"approach": 1e-6}, "expected newtons, since the approach is given and not the normal load"),
    ],
)
def test_a_share_of_what_is_not_known_is_refused(
    mu: float | None, load: dict[str, object], sentence: str
) -> None:
    assert complaints(load | {"tangential_load_x": "0.6 mu P"}, mu=mu) == {
        "load.0.tangential_load_x": sentence
    }


def test_a_share_of_no_normal_load_is_refused() -> None:
    """Without it 0.5 mu P would be 0 N in silence."""
    found = complaints({"tangential_load_x": "0.5 mu P"}, {"normal_load": 1.0}, mu=0.5)
    assert found == {
        "load.0.tangential_load_x": "expected 0, since the normal load at the end of this segment is 0"
    }
    assert history({"tangential_load_x": "0 mu P"}, {"normal_load": 1.0}, mu=0.5)[-1].x.value == 0.0


def test_a_share_above_one_is_gross_sliding_and_other_text_is_no_share() -> None:
    found = complaints({"normal_load": 1.0, "tangential_load_x": "1.2 mu P"}, mu=0.5)
    assert found["load.0.tangential_load_x"].startswith("gross sliding: the tangential load of 0.6 N")
    for text in (
        "0.6 mu",
        "mu P",
        "0.6 nu P",
        "0.6 mu P N",
        "60 % mu P",
        "0,6 mu P",
        "1e400 mu P",
        "3/5 mu P",
    ):
        with pytest.raises(ValueError, match='a force, or a share of mu P, such as "10 N" or "0.6 mu P"'):
            Load(normal_load=1.0, tangential_load_x=text)


# --- the load history --------------------------------------------------------------------------------------


def history(*loads: dict[str, object], mu: float = math.inf) -> tuple[LoadStep, ...]:
    steps, problems = load_steps([Load(**load) for load in loads], mu)
    assert problems == []
    return steps


def complaints(*loads: dict[str, object], mu: float | None) -> dict[str, str]:
    _, problems = load_steps([Load(**load) for load in loads], mu)
    return {".".join(map(str, problem.key)): problem.sentence for problem in problems}


def test_defaults_hold_everything_but_what_is_named() -> None:
    (step,) = history({"normal_load": 5.0})
    assert step == LoadStep(
        index=0,
        segment=0,
        label="",
        z=Target("force", 5.0),
        x=Target("force", 0.0),
        y=Target("force", 0.0),
        twist=Target("displacement", 0.0),
    )


def test_linear_ramps_go_from_where_the_last_one_ended() -> None:
    steps = history(
        {"normal_load": 10.0, "steps": 4, "label": "press"},
        {"tangential_load_x": 3.0, "tangential_load_y": -1.0, "steps": 2},
        {"normal_load": 4.0, "torque": 2.0, "steps": 2},
        {"twist": "1 rad"},
    )
    assert [step.index for step in steps] == list(range(9))
    assert [step.segment for step in steps] == [0] * 4 + [1] * 2 + [2] * 2 + [3]
    assert [step.label for step in steps] == ["press"] * 4 + [""] * 5
    assert [step.z.value for step in steps] == [2.5, 5, 7.5, 10, 10, 10, 7, 4, 4]
    assert [step.x.value for step in steps] == [0, 0, 0, 0, 1.5, 3, 3, 3, 3]
    assert [step.y.value for step in steps] == [0, 0, 0, 0, -0.5, -1, -1, -1, -1]
    assert [step.twist.control for step in steps] == ["displacement"] * 6 + ["force"] * 2 + ["displacement"]
    assert [step.twist.value for step in steps] == [0] * 6 + [1.0, 2.0, 1.0]
    # the torque takes over from a twist held at 0, which it had to be given before: only its share is known
    assert [step.twist.from_start for step in steps] == [0] * 6 + [0.5, 0, 0]


def test_cubic_ramps() -> None:
    # P_k = (P0^(1/3) + (k/n) (P1^(1/3) - P0^(1/3)))^3; other loads stay linear
    steps = history(
        {"normal_load": 8.0, "tangential_load_x": 2.0, "steps": 4, "ramp": "cubic"},
        {"normal_load": 27.0, "steps": 2, "ramp": "cubic"},
        {"normal_load": 0.0, "tangential_load_x": 0.0, "steps": 3, "ramp": "cubic"},
    )
    expected = [0.5**3, 1.0, 1.5**3, 8.0, 2.5**3, 27.0, 8.0, 1.0, 0.0]
    assert [step.z.value for step in steps] == pytest.approx(expected, rel=1e-14)
    assert [step.x.value for step in steps[:6]] == [0.5, 1.0, 1.5] + [2.0] * 3
    assert [step.x.value for step in steps[6:]] == pytest.approx([4 / 3, 2 / 3, 0.0], rel=1e-14)
    assert steps[3].z.value == 8.0
    assert steps[-1].z.value == 0.0


def test_given_fractions() -> None:
    steps = history({"normal_load": 10.0}, {"normal_load": 20.0, "shift_x": 1.0, "values": [0.1, "40 %", 1]})
    assert [step.z.value for step in steps] == [10, 11, 14, 20]
    assert [step.x for step in steps[1:]] == [
        Target("displacement", 0.1, 0.9),
        Target("displacement", 0.4, 0.6),
        Target("displacement", 1.0),
    ]


def test_a_change_of_control_starts_from_the_value_reached() -> None:
    steps = history(
        {"approach": 2.0, "steps": 2}, {"normal_load": 10.0, "steps": 4}, {"approach": 1.0, "steps": 2}
    )
    assert [step.z.control for step in steps] == ["displacement"] * 2 + ["force"] * 4 + ["displacement"] * 2
    # the first segment starts from zero, which needs no solution to know
    assert [step.z.from_start for step in steps[:2]] == [0, 0]
    assert [step.z.at(5.0) for step in steps[:2]] == [1, 2]
    assert [step.z.at(6.0) for step in steps[2:6]] == [7, 8, 9, 10]
    assert [step.z.at(3.0) for step in steps[6:]] == [2, 1]


def test_cycles() -> None:
    steps = history(
        {"normal_load": 10.0},
        {
            "repeat": 2,
            "label": "cycle",
            "path": [{"normal_load": 4.0, "steps": 2, "label": "down"}, {"normal_load": 10.0}],
        },
        {"path": [{"normal_load": 1.0}]},
    )
    assert [step.z.value for step in steps] == [10, 7, 4, 10, 7, 4, 10, 1]
    assert [step.segment for step in steps] == [0, 1, 1, 2, 3, 3, 4, 5]
    assert [step.label for step in steps] == ["", "down", "down", "cycle", "down", "down", "cycle", ""]


def test_a_history_that_is_appended_to_is_the_whole_one() -> None:
    loads = [
        {"normal_load": 10.0, "steps": 3, "label": "press"},
        {"repeat": 2, "path": [{"shift_x": 1e-6, "steps": "auto"}, {"tangential_load_x": 0.0, "steps": 2}]},
        {"series": {"normal_load": [8.0, 4.0], "label": ["down", "down"]}},
        {"approach": 1e-6},
    ]
    grown = History(0.3)
    for count, load in enumerate(loads, start=1):
        grown.append(Load(**load))
        assert (tuple(grown.steps), grown.problems) == load_steps(
            [Load(**load) for load in loads[:count]], 0.3
        )
    assert len(grown.steps) == 12
    grown.append(Load(normal_load=1.0, ramp="cubic"))
    assert [problem.key for problem in grown.problems] == [("load", 4, "ramp")]


def test_a_history_of_too_many_steps_is_refused_before_it_is_unrolled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = [{"normal_load": 1.0, "steps": 100_000}]
    assert complaints({"repeat": 100_000, "path": path}, mu=0.0) == {
        "load": "expected at most 100000 load steps in all, not 10000000000"
    }
    monkeypatch.setattr("hexcontact.problem.loads.MOST_STEPS", 6)
    assert len(history({"repeat": 3, "path": [{"normal_load": 1.0, "steps": 2}]})) == 6
    one_more = complaints({"normal_load": 1.0}, {"normal_load": 2.0, "steps": 6}, mu=0.0)
    assert one_more == {"load": "expected at most 6 load steps in all, not 7"}


@pytest.mark.parametrize(
    "loads",
    [
        [{"normal_load": 0.0}],
        [{"normal_load": 0.0, "steps": 3}, {"normal_load": 0.0}],
        [{"approach": -1.0}],
        [{"normal_load": 1e-300}],
        [{"shift_x": 1.0}],
    ],
)
def test_a_history_that_never_presses_is_refused(loads: list[dict[str, object]]) -> None:
    (sentence,) = complaints(*loads, mu=math.inf).values()
    assert sentence == "expected a normal load or an approach above zero somewhere in the history"


def test_the_normal_load_may_return_to_zero() -> None:
    assert history({"normal_load": 1.0}, {"normal_load": 0.0}, mu=0.0)[-1].z.value == 0.0


@pytest.mark.parametrize("key", ["tangential_load_x", "tangential_load_y", "torque", "shift_x", "shift_y"])
def test_frictionless_contact_carries_nothing_tangential(key: str) -> None:
    loads = {"normal_load": 1.0}, {key: -0.1, "steps": 3}
    assert complaints(*loads, mu=None) == {
        f"load.1.{key}": "expected 0, or a [friction] table with a coefficient above 0"
    }
    assert complaints(*loads, mu=0.3) == {}
    assert complaints({"normal_load": 1.0, key: 0.0}, mu=None) == {}
    # solved with a coefficient of 0, the surfaces may be moved, but no force moves them
    assert (complaints(*loads, mu=0.0) == {}) == key.startswith("shift")


def test_gross_sliding_known_from_the_deck_is_refused() -> None:
    def sliding(*loads: dict[str, object]) -> list[str]:
        found = complaints(*loads, mu=0.5)
        assert all("gross sliding" in sentence for sentence in found.values())
        return list(found)

    press = {"normal_load": 10.0}
    assert sliding(press, {"tangential_load_x": 5.0}) == []
    assert sliding(press, {"tangential_load_x": -5.01}) == ["load.1.tangential_load_x"]
    assert sliding(press, {"tangential_load_x": 4.0, "tangential_load_y": 3.0}) == []
    assert sliding(press, {"tangential_load_x": 4.0, "tangential_load_y": 3.1}) == [
        "load.1.tangential_load_x"
    ]
    # proportional loading, then letting go of the normal load alone
    assert sliding({**press, "tangential_load_y": 5.0, "steps": 7}) == []
    assert sliding(press, {"tangential_load_y": 3.0}, {"normal_load": 0.0, "steps": 5}) == [
        "load.2.normal_load"
    ]
    # the second turn presses with the tangential load still there, which only follows from that load
    turns = {"repeat": 3, "path": [press, {"tangential_load_x": 6.0}]}
    assert sliding(turns) == ["load.0.path.1.tangential_load_x"]
    # what only the solution tells is left to the run
    assert sliding({"approach": 1.0}, {"tangential_load_x": 100.0}) == []
    assert sliding(press, {"shift_x": 100.0}) == []
    assert list(complaints(press, {"normal_load": 0.0, "torque": 1.0}, mu=math.inf)) == ["load.1.torque"]


def test_a_cubic_ramp_from_an_unknown_load_is_refused() -> None:
    loads = {"approach": 1.0}, {"normal_load": 3.0, "steps": 2, "ramp": "cubic"}
    assert complaints(*loads, mu=0.0) == {
        "load.1.ramp": "expected linear, since the segment before was driven by approach"
    }


# --- the page that documents it ----------------------------------------------------------------------------


def reference() -> dict[str, Any]:
    """What docs/deck_tables.py defines."""
    names: dict[str, Any] = {"__file__": str(ROOT / "docs/deck_tables.py"), "__name__": "deck_tables"}
    exec(compile((ROOT / "docs/deck_tables.py").read_text(), "docs/deck_tables.py", "exec"), names)
    return names


@pytest.mark.parametrize("name", ["keys.md", "variables.md", "theory/limits.csv"])
def test_the_deck_reference_is_up_to_date(name: str) -> None:
    page = (ROOT / "docs" / name).read_text(encoding="utf-8")
    assert reference()["PAGES"][name]() == page, "run: python docs/deck_tables.py"


def test_the_deck_reference_has_every_key_of_every_table() -> None:
    def within(table: type[Table]) -> Iterator[type[Table]]:
        yield table
        for info in table.known_keys().values():
            for part in (info.annotation, *get_args(info.annotation)):
                if isinstance(part, type) and issubclass(part, Table):
                    yield from within(part)

    names = reference()
    page = names["keys_page"]()
    shown_tables = {*names["TABLES"].values(), tables.Bodies, Surface}
    assert {table for table in within(Deck) if not issubclass(table, Segment)} <= shown_tables
    assert tables.Load in shown_tables  # which has all keys of a segment
    assert all(f"\n## {heading}\n" in page for heading in (*names["TABLES"], "Surfaces"))
    for table in (*names["TABLES"].values(), *SHAPES.values()):
        for key, info in names["documented"](table).items():
            assert f"| `{key}` | " in page
            kind = kind_of(info)
            example = names["example_of"](info)
            if table is SHAPES["power"] and key == "coefficient":
                continue  # its unit is known with the exponent only
            if kind is not None:
                kind.parse(tomllib.loads(f"x = {example}")["x"])  # raises if it is none
            else:
                tomllib.loads(f"x = {example}")


def test_the_blocks_of_the_deck_reference_are_decks() -> None:
    page = (ROOT / "docs/deck.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```toml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 5
    for block in blocks:
        for key, problems in (
            (key, Deck.checked({key: value})[1]) for key, value in tomllib.loads(block).items()
        ):
            if key not in ("body", "include"):  # parts of them
                assert [problem for problem in problems if problem.key[0] == key] == []


def test_every_key_says_what_it_means() -> None:
    for table in (tables.Body, tables.Friction, tables.Grid, tables.Solver, tables.Load, tables.Output):
        for key, info in table.known_keys().items():
            assert info.description, f"{table.__name__}.{key}"
