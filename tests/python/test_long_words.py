"""Long words and lines in decks, series and commands take time in proportion to their length."""

from __future__ import annotations

import ast
import contextlib
import functools
import importlib
import itertools
import re
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic_core import PydanticCustomError

import hexcontact
from hexcontact import Case, DeckError
from hexcontact.cli.frame import setting, steps_of
from hexcontact.deck.keys import Deck
from hexcontact.deck.kinds import Kind
from hexcontact.deck.series import read_series
from hexcontact.deck.surfaces import SHAPES
from hexcontact.deck.table_base import Table, kind_of, parts_of
from hexcontact.deck.toml import starter
from hexcontact.study.plan import StudyFile

PACKAGE = Path(hexcontact.__file__).parent
METHODS = ("match", "fullmatch", "search", "sub", "split", "findall", "finditer")
WORDS = (
    *"9 a.,=+-_([{\"'\\°\n#/*^µ\t\0",
    *(
        "9 ",
        "9.",
        "9e",
        " a",
        "a ",
        "a.",
        "a*",
        "a/",
        "a^",
        "a^9",
        "1,",
        "= ",
        "mu",
        "mu P",
        "[9]",
        '"a',
        "9-",
    ),
)
BEFORE = ("", "1 ", "1 m", "=", "[", '"', "a", "1,1")
AFTER = ("", "!", "\n", "9", "x", "(")


@functools.cache
def patterns() -> dict[tuple[str, str], str]:
    """Return the method and the place of each pattern of the package."""
    found: dict[tuple[str, str], str] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "import re\n" not in text or path.name == "__main__.py":
            continue
        name = ".".join(["hexcontact", *path.relative_to(PACKAGE).with_suffix("").parts])
        names = vars(importlib.import_module(name.removesuffix(".__init__")))
        for call in ast.walk(ast.parse(text)):
            if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Attribute):
                continue
            by_module = ast.unparse(call.func.value) == "re"
            method, of = call.func.attr, call.args[0] if by_module and call.args else call.func.value
            if method not in METHODS and not (by_module and method == "compile"):
                continue
            try:
                pattern = eval(compile(ast.Expression(of), f"<{name}>", "eval"), dict(names))
            except NameError:  # of a file name, or one of the constants below
                continue
            if isinstance(pattern, re.Pattern) or (by_module and isinstance(pattern, str)):
                source = pattern if isinstance(pattern, str) else pattern.pattern
                if isinstance(source, str):
                    found[source, "fullmatch" if method == "compile" else method] = f"{name}:{call.lineno}"
        for constant, value in names.items():
            for entry in value if isinstance(value, tuple) else (value,):
                if constant.startswith("_") and isinstance(entry, str) and re.search(r"[\\\[]", entry):
                    try:
                        with warnings.catch_warnings():
                            warnings.simplefilter("ignore")
                            re.compile(entry)
                    except re.error:  # a text
                        continue
                    found.setdefault((entry, "match"), f"{name}.{constant}")
    return found


def texts(size: int) -> Iterator[str]:
    for before, word, after in itertools.product(BEFORE, WORDS, AFTER):
        yield before + word * (size // len(word)) + after
    for one, other in itertools.permutations(("9", " ", "a", ".", "_", "\t", "1 "), 2):
        yield one * (size // 2) + other * (size // 2) + "!"


def seconds(pattern: re.Pattern[str], method: str, text: str) -> float:
    start = time.process_time()
    found = pattern.sub("", text) if method == "sub" else getattr(pattern, method)(text)
    for _ in found if method == "finditer" else ():
        pass
    return time.process_time() - start


def test_patterns_are_found() -> None:
    places = "\n".join(patterns().values())
    for room in (
        "deck.units",
        "deck.kinds",
        "deck.series",
        "deck.toml",
        "deck.faults",
        "cli.frame",
    ):
        assert f"hexcontact.{room}" in places
    assert len(patterns()) > 30


def test_no_pattern_backtracks() -> None:
    """At 2 kB a pattern of quadratic cost takes 10 ms, one of linear cost some 0.02 ms."""
    slow = {}
    for (source, method), place in patterns().items():
        pattern = re.compile(source, re.DOTALL if "faults" in place else 0)
        for text in texts(2_000):
            if (
                seconds(pattern, method, text) > 2e-3
                and (worst := least(seconds, pattern, method, text)) > 2e-3
            ):
                slow[place, source, method] = (worst, text[:20], text[-3:])
                break
    assert not slow


def least(measure: Callable[..., float], *arguments: Any) -> float:
    return min(measure(*arguments) for _ in range(5))


def kinds(table: type[Table]) -> Iterator[tuple[str, Kind]]:
    """Yield the keys of a table and of those in it."""
    for key, info in table.known_keys().items():
        if kind := kind_of(info):
            yield f"{table.__name__}.{key}", kind
        for part in itertools.chain.from_iterable(
            map(parts_of, (info.annotation, *get_args(info.annotation)))
        ):
            if issubclass(part, Table):
                yield from kinds(part)


@pytest.mark.parametrize("unit", ["9", " ", "a(", "9.", "m "])
def test_each_key_reads_a_long_word_in_proportion_to_its_length(unit: str) -> None:
    """A megabyte takes some 0.02 s of the processor; at quadratic cost a tenth of it takes seconds."""
    known = dict(itertools.chain.from_iterable(kinds(table) for table in (Deck, StudyFile, *SHAPES.values())))
    assert len(known) > 100
    for before, (key, kind) in itertools.product(("", "1 ", "1 m"), known.items()):
        for size, longest in ((100_000, 0.2), (1_000_000, 2.0)):
            text = before + unit * (size // len(unit))
            start = time.process_time()
            with contextlib.suppress(PydanticCustomError):
                kind.parse(text)
            assert time.process_time() - start < longest, (key, size)


LINES = {
    "nines": "spacing = " + "9" * 20_000,
    "digits": 'spacing = "' + "9" * 500_000 + ' um"',
    "blanks": 'spacing = "1' + " " * 500_000 + '"',
    "unit": 'spacing = "1 ' + "m " * 250_000 + '"',
    "bare": "spacing = " + "9 " * 250_000,
    "key": "a" * 500_000 + " = 1",
    "twice": "title = 1\n" + "title" + " " * 500_000 + "= 1",
    "comma": "spacing = 1,5" + " " * 500_000 + "x",
    "formula": '[friction]\ncoefficient = "' + "a" * 500_000 + '("',
    "quotes": 'title = "' + "a" * 500_000,
    "brackets": "spacing = " + "[" * 500_000,
    "comment": "spacing = 1 # " + "9" * 500_000,
}


@pytest.mark.parametrize("line", LINES.values(), ids=LINES)
def test_a_deck_with_one_long_line_gets_its_sentence_at_once(line: str) -> None:
    """Twenty thousand nines took more than a minute."""
    start = time.process_time()
    with pytest.raises(DeckError):
        Case.from_text(f"{line}\n[body.1]\n")
    with pytest.raises(DeckError):
        Case.from_text(starter("sphere"), overrides=dict([setting(f"grid.{line.partition('[')[0]}=x")]))
    assert time.process_time() - start < 10.0


def test_long_lines_of_a_series_get_their_sentence_at_once(tmp_path: Path) -> None:
    start = time.process_time()
    for header, row in (
        ("normal_load [N]" + " " * 300_000 + "x", "1"),
        ("normal_load " + "[" * 300_000, "1"),
        ("normal_load [N]", "9" * 300_000 + "x"),
        ("normal_load [N]", "1" + " " * 300_000 + "N"),
        ("normal_load [N]", "9" * 300_000 + ",9x"),
    ):
        path = tmp_path / "long.csv"
        path.write_text(f"{header}\n{row}\n", encoding="utf-8")
        with pytest.raises(DeckError):
            read_series(path)
    assert time.process_time() - start < 10.0


@pytest.mark.parametrize("number", ["9" * 5_000, "1-" + "9" * 5_000, "1-999999999"])
def test_long_numbers_of_steps_and_entries_get_their_sentence(number: str) -> None:
    """Python refuses integers of more than 4300 digits, and a range of 10^9 steps fills the memory."""
    for key in (f"load.{number}", f"load.{number}.steps"):
        with pytest.raises(DeckError, match="expected an entry from 1 to 1, not "):
            Case.from_text(starter("sphere"), overrides={key: 1})
    if number == "1-999999999":
        assert steps_of(number, ["", ""]) == [1, 2, 3]  # the third one is not there
    else:
        with pytest.raises(DeckError, match="expected a number of a load step"):
            steps_of(number, ["", ""])
