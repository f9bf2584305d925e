"""Arguments and options that several commands share, and their values."""

from __future__ import annotations

import enum
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import DeckError
from ..text import listed

if TYPE_CHECKING:
    from ..problem.problem import Problem
    from ..result.result import Result

_OTHER_FILES = (".png", ".pdf", ".svg", ".csv", ".html", ".json", ".vtk", ".vtu")


def argument(metavar: str, help: str) -> Any:
    """Declare an argument of a command; the command itself tests whether it can read a file."""
    return typer.Argument(metavar=metavar, help=_escaped(help), show_default=False, readable=False)


def option(*names: str, help: str, metavar: str | None = None) -> Any:
    """Declare an option, with a value unless its argument is a bool."""
    return typer.Option(*names, metavar=metavar, help=_escaped(help), readable=False)


def output_to(help: str) -> Any:
    """Declare the option for the file or folder to write."""
    return option("--output", "-o", help=help)


def steps_option(help: str) -> Any:
    """Declare the option that selects load steps."""
    return option("--step", "-s", metavar="N,...", help=help)


def settings_option(help: str) -> Any:
    """Declare the option that replaces keys."""
    return option("--set", metavar="KEY=VALUE", help=f"{help}. Repeatable.")


def flag(name: str, help: str) -> Any:
    """Declare an option without a value."""
    return option(f"--{name}", help=help)


def _escaped(help: str) -> str:
    return help.replace("[", r"\[")  # typer reads markup in it


DeckFile = Annotated[Path, argument("DECK", "The deck, a TOML file.")]
ResultFile = Annotated[Path, argument("FILE", "The result, a netCDF file.")]
Settings = Annotated[
    list[str] | None, settings_option("Replace a key of the deck, as grid.spacing='0.05 mm'")
]
Plot = Annotated[bool, flag("plot", "Draw the result beside the output (.png).")]
Quiet = Annotated[bool, option("--quiet", "-q", help="Print nothing but errors.")]
AsJson = Annotated[bool, flag("json", "Print one JSON object for programs, errors too; docs/running.md.")]


Source = enum.StrEnum("Source", ["edges", "nodes"])
"""Where pressure and shear traction come from."""

Shown = Annotated[
    Source | None,
    option(
        "--source", help="Tractions to the edges between the nodes (default if known), or as solved at nodes."
    ),
]


LogLevel = enum.StrEnum("LogLevel", ["debug", "info", "warning", "error"])
"""Levels of a log."""


LogFile = Annotated[
    Path | None,
    option("--log-file", metavar="LOG", help="Append a line for each load step, with time and work."),
]
Level = Annotated[
    LogLevel | None,
    option("--log-level", help="Least level of the log; without LOG it goes to standard error."),
]


def setting(text: str) -> tuple[str, Any]:
    """Return key and value of KEY=VALUE; a value that is not TOML is text, so that units need no quotes."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise DeckError(f"--set {text}: expected KEY=VALUE, such as load.1.normal_load='20 N'")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except ValueError:  # TOMLDecodeError, or an integer of too many digits
        return key.strip(), value.strip()


def steps_of(text: str, labels: Sequence[str], option: str = "step") -> list[int]:
    """Return numbers of load steps from "20", "10,20,30", "109-135", "all", or a label.

    A label selects the last step of its segments; cycles have empty labels.
    """
    words = [text.strip()] if text.strip() in labels else [word.strip() for word in text.split(",")]
    numbers: list[int] = []
    for word in words:
        if word and word in labels:
            ends = zip(labels, [*labels[1:], ""], strict=True)
            numbers += [k for k, (own, after) in enumerate(ends, start=1) if own == word != after]
        elif found := re.fullmatch(r"(\d{1,9}) *- *(\d{1,9})", word):
            numbers += range(int(found[1]), min(int(found[2]), max(int(found[1]), len(labels) + 1)) + 1)
        elif word == "all":
            numbers += range(1, len(labels) + 1)
        elif re.fullmatch(r"-?\d{1,9}", word):
            numbers.append(int(word))
    if len(numbers) < len(words):
        known = [f'"{label}"' for label in dict.fromkeys(labels) if label]
        one = "load step" if option == "step" else option
        expected = [f"a number of a {one}", "several as 10,20,30 or 10-30", "all"]
        expected += [f"a label ({listed(known, 'or')})"] if known else []
        raise DeckError(f"--{option} {text}: expected {listed(expected, 'or')}")
    return numbers


def labels_of(result: Result) -> list[str]:
    """Return the label of each load step."""
    return [str(label) for label in result["label"].values] if "label" in result else [""] * len(result)


def beside(file: Path, ending: str) -> Path:
    """Return the name of a file beside a result, which may be the current folder (a journal)."""
    there = file if file.name not in ("", "..") else file.resolve()
    return there.parent / f"{there.stem}{ending}"


def case_of(deck: Path, settings: list[str] | None) -> Problem:
    """Return the case of a deck with the keys that ``--set`` replaces."""
    from ..problem.problem import Problem

    return Problem.from_toml(deck, overrides=dict(map(setting, settings or ())))


def target_of(case: Problem, deck: Path, output: Path | None = None) -> Path:
    """Return the file that a run writes: that of the option or the deck, else one named after the deck."""
    target = output or case.output.file or Path(f"{deck.stem}.nc")
    if target.suffix in _OTHER_FILES:
        raise DeckError(f"output {target}: expected a netCDF file, such as {target.with_suffix('.nc')}")
    if not target.parent.is_dir():
        there = target.parent.exists()
        fault = f"{target.parent} is not a folder" if there else f"the folder {target.parent} does not exist"
        raise DeckError(f"cannot write {target}: {fault}")
    return target
