"""Run pages as they stand: their decks, commands and programs, those of a page in one folder.

``python docs/site/played.py`` says where pages differ from what happens; ``--write`` puts outputs and
pictures into them. Times may differ, and residuals within the tolerance. Rounding differs between processors:
the last digit of a number may differ by one, and counts of iterations and products by a factor of two.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import runpy
import shlex
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from typer.testing import CliRunner

from hexcontact.cli.app import app

DOCS = Path(__file__).parents[1]
PAGES = ("tutorial", "lattice", "surfaces", "maps", "reading", "fatigue", "../README")
WIDTH = "88"
# Files begin with a comment that names them; other blocks of these languages are there to be read.
NAME = re.compile(r"# (\w+\.(?:toml|py))\n")
BLOCK = re.compile(r"^```(console|toml|python)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PICTURE = re.compile(r"!\[[^\]]*\]\((images/\w+/(\w+\.png))\)")
# What differs between runs: times, memory of the process with its libraries, the widths of their columns.
VOLATILE = re.compile(r"\b[\d.]+ (?:ms|µs|s|MB|GB)\b|(?<= started )\S+|─+|\s+")
# Residuals within the tolerance are rounding errors of one machine or another.
RESIDUAL = re.compile(r"\b\d\.\de[+-]\d\d\b")
TOLERANCE = 1e-8
COUNT = re.compile(r"\b[\d.]+(?= (?:iterations|(?:operator )?applications)\b)")
COUNT_FACTOR = 2.0
NUMBER = re.compile(r"(?<![\w.])-?\d+\.(\d+)(?:e([+-]\d+))?(?![\w.])")


@dataclass
class Difference:
    """A block of the page, and what it should be."""

    shown: str
    found: str


def steady(text: str) -> str:
    """What two runs have in common."""
    small = RESIDUAL.sub(lambda found: "small" if float(found[0]) <= TOLERANCE else found[0], text)
    return VOLATILE.sub(" ", small).strip()


def same(shown: str, found: str) -> bool:
    """Whether two runs print the same but for what may differ."""
    counts = [COUNT.findall(text) for text in (shown, found)]
    one, other = (COUNT.sub("count", steady(text)) for text in (shown, found))
    if NUMBER.sub("number", one) != NUMBER.sub("number", other):
        return False
    numbers = zip(NUMBER.finditer(one), NUMBER.finditer(other), strict=True)
    return all(near(a, b) for a, b in numbers) and all(alike(a, b) for a, b in zip(*counts, strict=True))


def near(one: re.Match[str], other: re.Match[str]) -> bool:
    """Whether two numbers differ by one in the last digit at most."""
    digit = max(10.0 ** (int(found[2] or 0) - len(found[1])) for found in (one, other))
    return abs(float(one[0]) - float(other[0])) < 1.01 * digit


def alike(one: str, other: str) -> bool:
    """Whether two counts of work differ by no more than rounding explains."""
    low, high = sorted(map(float, (one, other)))
    return high <= COUNT_FACTOR * low


def output_of(line: str) -> str:
    """Run a command of the page and return what it prints."""
    words = shlex.split(line)
    if words[0] == "python":
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            runpy.run_path(words[1], run_name="__main__")
        return printed.getvalue()
    assert words[0] == "hexcontact", line
    done = CliRunner().invoke(app, words[1:], env={"COLUMNS": WIDTH})
    assert done.exit_code == 0, f"{line}\n{done.output}"
    return done.stdout.replace(f"{Path.cwd()}/", "")


def played(block: str) -> str:
    """Return the block with what its commands print."""
    text = ""
    for line in block.splitlines():
        if line.startswith("$ "):
            printed = [row.rstrip() for row in output_of(line[2:]).splitlines()]
            text += "\n".join([line, *printed]).rstrip() + "\n"
    return text


def differences(page: str, folder: Path) -> Iterator[Difference]:
    """Play the page in a folder."""
    with contextlib.chdir(folder):
        for language, block in BLOCK.findall(page):
            if name := NAME.match(block):
                Path(name[1]).write_text(block, encoding="utf-8")
            elif language == "console" and not same(block, found := played(block)):
                yield Difference(block, found)


def main() -> int:
    os.environ.setdefault("MPLBACKEND", "agg")
    write = sys.argv[1:] == ["--write"]
    differ = False
    for name in PAGES:
        page = DOCS / f"{name}.md"
        text = page.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            for difference in differences(text, Path(folder)):
                differ = True
                print(f"--- {page.name}\n{difference.shown}--- now\n{difference.found}")
                text = text.replace(f"```console\n{difference.shown}", f"```console\n{difference.found}")
            if write:
                page.write_text(text, encoding="utf-8")
                for target, picture in PICTURE.findall(text):
                    keep_picture(Path(folder) / picture, DOCS / target)
    return 0 if write else differ


def keep_picture(source: Path, target: Path) -> None:
    """Keep a picture with as many colors as it needs."""
    from PIL import Image

    target.parent.mkdir(parents=True, exist_ok=True)
    Image.open(source).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"written: {target}")


if __name__ == "__main__":
    sys.exit(main())
