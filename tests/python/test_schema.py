"""The JSON schema of decks: it takes every deck of cases/ and refuses what is wrong."""

import json
import re
import runpy
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from hexcontact.cli.app import app
from hexcontact.deck.faults import Source
from hexcontact.deck.json_schema import deck_schema
from hexcontact.deck.keys import Deck
from hexcontact.deck.toml import STARTERS, starter

ROOT = Path(__file__).parents[2]
DECKS = runpy.run_path(str(Path(__file__).with_name("test_deck.py")))
GOOD, WRONG = DECKS["GOOD"], DECKS["WRONG"]
SCHEMA = Draft202012Validator(deck_schema())


def faults(text: str) -> list[str]:
    return [f"{error.json_path}: {error.message}" for error in SCHEMA.iter_errors(tomllib.loads(text))]


def test_schema_is_one() -> None:
    Draft202012Validator.check_schema(deck_schema())


@pytest.mark.parametrize(
    "path",
    [path for path in sorted((ROOT / "cases").glob("*.toml")) if not path.stem.startswith("study_")],
    ids=lambda path: path.name,
)
def test_every_case_is_valid(path: Path) -> None:
    assert faults(path.read_text(encoding="utf-8")) == []


def test_starters_and_the_deck_reference_are_valid() -> None:
    assert {name: faults(starter(name)) for name in STARTERS} == {name: [] for name in STARTERS}
    page = (ROOT / "docs/deck.md").read_text(encoding="utf-8")
    first = re.search(r"```toml\n(.*?)```", page, re.DOTALL)
    assert first
    assert faults(first[1]) == []
    assert faults(GOOD) == []


# what only the program tells: dimensions of units, and what stands against what across keys
BEYOND = (
    *("kg", "in the path", "fractions", "values", "cubic", "nothing, since", "window or", "repeat"),
    *("at least one of", "2.0"),  # JSON counts 2.0 among the whole numbers
)
ONLY_CHECK = re.compile("|".join(map(re.escape, BEYOND)))


@pytest.mark.parametrize(
    ("old", "new", "sentence"), WRONG, ids=[new.replace("\n", " ") for _, new, _ in WRONG]
)
def test_the_schema_refuses_what_the_program_refuses(old: str, new: str, sentence: str) -> None:
    text = GOOD.replace(old, new, 1)
    if ONLY_CHECK.search(sentence) or new in ("nan", "inf", "coefficient = nan"):  # JSON has neither of these
        with pytest.raises(ValueError, match=re.escape(sentence[:20])):
            Deck.parse(tomllib.loads(text), Source("deck", text))
    else:
        assert faults(text)


def test_mistakes_are_named_where_they_are() -> None:
    assert faults(GOOD.replace("every = 5", "evry = 5")) == [
        "$.output: Additional properties are not allowed ('evry' was unexpected)"
    ]
    assert faults(GOOD.replace('"fft"', '"ftt"')) == [
        "$.solver.method: 'ftt' is not one of ['auto', 'direct', 'fft']"
    ]
    (missing,) = faults(GOOD.replace("coefficient = inf", ""))
    assert missing == "$.friction: 'coefficient' is a required property"


def test_what_is_included_may_be_left_out() -> None:
    elastic = "young_modulus = 72e9\npoisson_ratio = 0.32\n"
    assert faults(GOOD.replace(elastic, ""))
    assert faults('include = ["materials.toml"]\n' + GOOD.replace(elastic, "")) == []


@pytest.mark.parametrize("value", ['"1 mm"', '" +1e-3m"', '"0.04 in"', "0.001", "1", '".5 µm"', '"3 mm^1"'])
def test_lengths(value: str) -> None:
    text = GOOD.replace('radius = "1 mm"', f"radius = {value}")
    assert faults(text) == []
    Deck.parse(tomllib.loads(text), Source("deck", text))


@pytest.mark.parametrize("value", ['"-1 mm"', '"mm"', '"1"', "-1", "0", "true", '""', '"1 2 mm"', "[1]"])
def test_no_lengths(value: str) -> None:
    text = GOOD.replace('radius = "1 mm"', f"radius = {value}")
    assert faults(text)
    with pytest.raises(ValueError, match="radius"):
        Deck.parse(tomllib.loads(text), Source("deck", text))


def test_command(tmp_path: Path) -> None:
    printed = CliRunner().invoke(app, ["schema"])
    assert json.loads(printed.stdout) == deck_schema()
    path = tmp_path / "deck.schema.json"
    done = CliRunner().invoke(app, ["schema", "-o", str(path)])
    assert (done.exit_code, json.loads(path.read_text(encoding="utf-8"))) == (0, deck_schema())
    assert f"#:schema {path}" in done.stdout
    refused = CliRunner().invoke(app, ["schema", "-o", str(tmp_path / "no/where.json")])
    assert (refused.exit_code, "no does not exist" in refused.stderr) == (2, True)


def test_every_key_has_a_description() -> None:
    def undescribed(schema: Any, path: str) -> Iterator[str]:
        if isinstance(schema, dict):
            keys = schema.get("properties", {}) if schema.get("type") == "object" else {}
            for key, entry in keys.items():
                if not {"description", "properties", "$ref"} & entry.keys() and key != "shape":
                    yield f"{path}.{key}"
        entries = schema.items() if isinstance(schema, dict) else enumerate(schema)
        for key, entry in entries:
            if isinstance(entry, dict | list):
                yield from undescribed(entry, f"{path}.{key}")

    assert list(undescribed(deck_schema(), "")) == [".$schema", ".load", ".stress", ".fatigue"]


def test_the_schema_replaces_an_older_one_but_nothing_else(tmp_path: Path) -> None:
    old, deck = tmp_path / "deck.schema.json", tmp_path / "deck.toml"
    old.write_text('{"title": "hexcontact deck"}')
    deck.write_text("# a deck\n")
    assert CliRunner().invoke(app, ["schema", "-o", str(old)]).exit_code == 0
    assert len(old.read_text()) > 1000
    refused = CliRunner().invoke(app, ["schema", "-o", str(deck)])
    assert (refused.exit_code, "exists and is not a hexcontact schema" in refused.stderr) == (2, True)
    assert deck.read_text() == "# a deck\n"
