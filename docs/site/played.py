"""Run pages as they stand: their decks, commands and programs, those of a page in one folder.

``python docs/site/played.py`` says where pages differ from what happens; ``--write`` puts outputs and
pictures into them. Times may differ, residuals as far as they are within the tolerance, and the work by what
rounding makes of the last iterations on another processor.
"""

from __future__ import annotations

import contextlib
import io
import math
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
PAGES = ("tutorial", "lattice", "surfaces", "reading", "fatigue", "../README")
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
# Operator applications: where an iteration ends may depend on rounding.
WORK = re.compile(r"\b[\d.]+(?= (?:operator )?applications\b)")
WORK_TOLERANCE = 0.08  # where transforms begin in memory decides about the last bits


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
    work = [[float(number) for number in WORK.findall(text)] for text in (shown, found)]
    if WORK.sub("", steady(shown)) != WORK.sub("", steady(found)):
        return False
    return all(math.isclose(a, b, rel_tol=WORK_TOLERANCE) for a, b in zip(*work, strict=True))


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
