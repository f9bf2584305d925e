"""Decks with mistakes: mutations of text and of keys and values, the same ones for the same seed."""

import random
import re
from collections.abc import Callable

VALUES = (  # instead of what a deck says
    *("0", "-1", "1", "2", "0.5", "-0.0", "1e308", "-1e308", "1e-308", "5e-324", "1e400", "1e30", "-1e-30"),
    *("nan", "inf", "-inf", "true", "false", "999999999999999999999", "0x7fffffff", "100000", "99999", "1_000"),
    *('""', '" "', '"1"', '"nan"', '"inf m"', '"-1 N"', '"1 mm"', '"1 m"', '"1 GPa"', '"1 banana"', '"1e999 m"'),
    *('"1 N m"', '"3 deg"', '"1 rad"', '"1 mm mm mm"', '"1/0 m"', '"m"', '"1e3"', '"10**10**10 m"', '"(1 m"'),
    *('"1 degC"', '"1 m + 1"', '"µm"', '"١ mm"', '"1 µm"', '"\\u0000"', '"😀"', '"auto"', '"cubic"', '"/etc/passwd"'),
    *("[]", "[[]]", "[1]", "[1, 2]", "[1, 2, 3]", "[nan, 1]", '["1 mm", "1 mm"]', '["a", 1]', "[1e300, 1e300]"),
    *("{}", "{ a = 1 }", '{ shape = "sphere" }', "[{}]", "1979-05-27", "07:32:00", "1979-05-27T07:32:00Z"),
    *('"""\ntext\n"""', "'''x'''", '"' + "x" * 5000 + '"', "[" * 60 + "]" * 60, "{a=" * 40 + "1" + "}" * 40),
    *('"no_such_file.csv"', '"."', '".."', '"\\\\"', '"a\\tb"', '"[red]x[/red]"', '"%s%n{}"', "1.7976931348623157e308"),
)
WORDS = (  # keys and headers that belong somewhere else, or nowhere
    *("spacing", "nodes_across", "nodes_in_radius", "window", "extent", "normal_load", "approach", "steps", "path"),
    *("repeat", "series", "values", "ramp", "torque", "twist", "shift_x", "tangential_load_x", "include", "file"),
    *("surface", "rigid", "poisson_ratio", "young_modulus", "coefficient", "tolerance", "method", "algorithm"),
    *("every", "fields", "title", "unknown", "größe", '""', '"a.b"', "a.b.c", "Spacing", "label", "origin", "center"),
)
TABLES = (
    *("[grid]", "[[grid]]", "[body]", "[body.1]", "[body.3]", "[[body.1]]", "[load]", "[[load]]", "[friction]"),
    *("[solver]", "[output]", "[[load.path]]", "[nothing]", "[a.b.c.d]", "[", "[[load", "[body.1.surface]"),
)
LINES = (
    *("nodes_across = 99999", "steps = 100000", "repeat = 100000", "spacing = 1e-30", 'window = [100000, 100000]'),
    *("window = [5, 99999]", 'extent = ["1 km", "1 km"]', "nodes_in_radius = 100000", 'spacing = "1 pm"'),
    *("[[load]]\nnormal_load = 1\nsteps = 99999", "normal_load = 1e30", 'approach = "1 km"', "tolerance = 1e-14"),
    *("coefficient = inf", "coefficient = 1e300", "rigid = true", "\x00", "\ufeff", "= 1", "a = ", "# é", "\r\r\n"),
    *("[[load]]\npath = [{ normal_load = 1 }]\nrepeat = 50000", 'include = ["deck.toml"]', "values = [0.1, 0.1, 1]"),
)
_VALUE = re.compile(r"(?<==)\s*(\"[^\"\n]*\"|[-+\w.]+)")
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_KEY = re.compile(r"\b[a-z]\w*(?=\s*=)")
_UNIT = re.compile(r"(?<=\d )[A-Za-zµ]+(?=\")")
_UNITS = ("m", "mm", "um", "km", "pm", "lightyear", "N", "kN", "GN", "lbf", "Pa", "GPa", "psi", "deg", "rad", "K", "s")


def mutated(text: str, rng: random.Random) -> bytes:
    """Return a deck with one to three mutations."""
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


def _unit(text: str, rng: random.Random) -> str:
    return _at(_UNIT, text, rng, lambda _: rng.choice(_UNITS))


def _key(text: str, rng: random.Random) -> str:
    return _at(_KEY, text, rng, lambda _: rng.choice(WORDS))


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
    new = rng.choice(("", '"', "[", "]", "{", "=", "\n", "'", "\\", "#", ".", ",", "\t", "é", "\u202e", "\x07", "😀", "e9"))
    return text[:place] + new + text[place + rng.randint(0, 3) :]


def _deep(text: str, rng: random.Random) -> str:
    depth = rng.choice((10, 200, 5000))
    kind = rng.choice(("[", "{a=", "."))
    if kind == ".":
        return text + "\n" + ".".join(["a"] * depth) + " = 1\n"
    return f"{text}\nx = {kind * depth}{'1'}{('}' if kind != '[' else ']') * depth}\n"


_STRUCTURED = (_value, _value, _value, _value, _number, _number, _unit, _key, _typo, _without_line, _line_twice, _line_more, _table)
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
