"""Decks with mistakes: mutations of text and of keys and values, the same ones for the same seed."""

import random
import re
from collections.abc import Callable
from pathlib import Path

_ODD = [
    [line for line in block.splitlines() if not line.startswith("# ")]
    for block in Path(__file__).with_name("odd_words.txt").read_text(encoding="utf-8").split("\n\n")
]
VALUES, KEYS, TABLES = _ODD  # instead of what a deck says
VALUES += ['"""\ntext\n"""', '"' + "x" * 5000 + '"', "[" * 60 + "]" * 60, "{a=" * 40 + "1" + "}" * 40]
LINES = (
    *("nodes_across = 99999", "steps = 100000", "repeat = 100000", "spacing = 1e-30", 'spacing = "1 pm"'),
    *("window = [5, 99999]", "window = [100000, 100000]", 'extent = ["1 km", "1 km"]', "normal_load = 1e30"),
    *("nodes_in_radius = 100000", "[[load]]\nnormal_load = 1\nsteps = 99999", 'approach = "1 km"'),
    *("tolerance = 1e-14", "coefficient = inf", "coefficient = 1e300", "rigid = true", "\x00", "\ufeff"),
    *("= 1", "a = ", "# é", "\r\r\n", 'include = ["deck.toml"]', "values = [0.1, 0.1, 1]"),
    "[[load]]\npath = [{ normal_load = 1 }]\nrepeat = 50000",
    *('include = ["/dev/zero"]', '"\\u001b[2J" = 1', 'title = "\\u001b[2J\\u009b2J"'),
)
_VALUE = re.compile(r"(?<==)\s*(\"[^\"\n]*\"|[-+\w.]+)")
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_KEY = re.compile(r"\b[a-z]\w*(?=\s*=)")
_UNIT = re.compile(r"(?<=\d )[A-Za-zµ]+(?=\")")
_UNITS = (
    *("m", "mm", "um", "km", "pm", "parsec", "N", "kN", "GN", "lbf", "Pa", "GPa", "psi"),
    *("deg", "rad", "K", "s"),
)


def mutated(text: str, rng: random.Random, gently: bool = False) -> bytes:
    """Return a deck with one to three mutations; gently: with one of a number or a line, if any."""
    if gently:
        return rng.choice(_GENTLE)(text, rng).encode()
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3))):
        text = rng.choice(_STRUCTURED if rng.random() < 0.8 else _OF_TEXT)(text, rng)
    data = text.encode("utf-8", "surrogatepass")
    return garbled(data, rng) if rng.random() < 0.04 else data


def _at(pattern: re.Pattern[str], text: str, rng: random.Random, new: Callable[[str], str]) -> str:
    """Replace one of the places that match."""
    places = list(pattern.finditer(text))
    if not places:
        return text
    place = rng.choice(places)
    return text[: place.start()] + new(place[0]) + text[place.end() :]


def _value(text: str, rng: random.Random) -> str:
    return _at(_VALUE, text, rng, lambda _: " " + rng.choice(VALUES))


def _number(text: str, rng: random.Random) -> str:
    def scaled(word: str) -> str:
        factor = rng.choice((-1.0, 0.0, 10.0 ** rng.randint(-40, 40), 10.0 ** rng.randint(-4, 4), 3.7))
        return f"{float(word) * factor:.6g}"

    return _at(_NUMBER, text, rng, scaled)


def _a_little(text: str, rng: random.Random) -> str:
    return _at(_NUMBER, text, rng, lambda word: f"{float(word) * rng.uniform(0.3, 3):.6g}")


def _unit(text: str, rng: random.Random) -> str:
    return _at(_UNIT, text, rng, lambda _: rng.choice(_UNITS))


def _key(text: str, rng: random.Random) -> str:
    return _at(_KEY, text, rng, lambda _: rng.choice(KEYS))


def _typo(text: str, rng: random.Random) -> str:
    def misspelled(word: str) -> str:
        place = rng.randrange(len(word))
        return word[:place] + rng.choice(("", "x", word[place] * 2, "_")) + word[place + 1 :]

    return _at(_KEY, text, rng, misspelled)


def _without_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True) or [""]
    del lines[rng.randrange(len(lines))]
    return "".join(lines)


def _line_twice(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True) or ["\n"]
    line = rng.choice(lines)
    lines.insert(rng.randrange(len(lines) + 1), line if line.endswith("\n") else line + "\n")
    return "".join(lines)


def _lines_swapped(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True) or [""]
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return "".join(lines)


def _line_more(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    lines.insert(rng.randrange(len(lines) + 1), rng.choice((*LINES, *TABLES)) + "\n")
    return "".join(lines)


def _table(text: str, rng: random.Random) -> str:
    return _at(re.compile(r"^\[.*\]$", re.MULTILINE), text, rng, lambda _: rng.choice(TABLES))


def _many(text: str, rng: random.Random) -> str:
    more = rng.choice(("[[load]]\nnormal_load = 1\n", "[x.y]\n", "# c\n", "a.b.c = 1\n", "[[load]]\n"))
    return text + "\n" + more * rng.choice((2, 50, 2000))


def _cut(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text) + 1)]


def _character(text: str, rng: random.Random) -> str:
    place = rng.randrange(len(text) + 1)
    new = rng.choice(("", '"', "e9", "\n", "\t", "\u202e", "\x07", *"[]{}='\\#.,é😀"))
    return text[:place] + new + text[place + rng.randint(0, 3) :]


def _deep(text: str, rng: random.Random) -> str:
    depth = rng.choice((10, 200, 5000))
    kind = rng.choice(("[", "{a=", "."))
    if kind == ".":
        return text + "\n" + ".".join(["a"] * depth) + " = 1\n"
    return f"{text}\nx = {kind * depth}{'1'}{('}' if kind != '[' else ']') * depth}\n"


_STRUCTURED = (
    *(_value, _value, _value, _value, _number, _number, _unit, _key, _typo),
    *(_without_line, _line_twice, _line_more, _table),
)
_GENTLE = (_a_little, _a_little, _a_little, _number, _without_line, _line_more, _value)
_OF_TEXT = (_cut, _character, _character, _lines_swapped, _deep, _many)


def garbled(data: bytes, rng: random.Random) -> bytes:
    """Return bytes with some of them changed, inserted or cut off."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 5, 50))):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    if rng.random() < 0.2:
        return rng.randbytes(rng.choice((0, 1, 300)))
    return bytes(changed)
