"""Arguments and options that several commands have, and what they stand for."""

from __future__ import annotations

import enum
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import DeckError

if TYPE_CHECKING:
    from ..case import Case
    from ..problem.problem import Problem

_PICTURES = (".png", ".pdf", ".svg")

DeckFile = Annotated[Path, typer.Argument(metavar="DECK", help="The deck, a TOML file.", show_default=False)]
ResultFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="The result, a netCDF file.", show_default=False)
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Replace a key of the deck, as grid.spacing='0.05 mm'. Repeatable."
    ),
]
Plot = Annotated[bool, typer.Option("--plot", help="Draw the result beside the output (.png).")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON object for programs, errors too; docs/running.md.")
]


class LogLevel(enum.StrEnum):
    """What a log holds."""

    debug = "debug"
    info = "info"
    warning = "warning"
    error = "error"


LogFile = Annotated[
    Path | None,
    typer.Option("--log-file", metavar="LOG", help="Append a line for each load step, with time and work."),
]
Level = Annotated[
    LogLevel | None,
    typer.Option("--log-level", help="What the log holds; without LOG it goes to standard error."),
]


def setting(text: str) -> tuple[str, Any]:
    """Split KEY=VALUE; a value that is not TOML is text, so that units need no quotes."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise DeckError(f"--set {text}: expected KEY=VALUE, such as load.1.normal_load='20 N'")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def steps_of(text: str) -> list[int]:
    """Read numbers of load steps: "20" or "10,20,30"."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise DeckError(f"--step {text}: expected a number of a load step, or several as 10,20,30") from None


def beside(file: Path, ending: str) -> Path:
    """Return the name of a file beside a result; a result may be the current folder, a journal."""
    there = file if file.name not in ("", "..") else file.resolve()
    return there.parent / f"{there.stem}{ending}"


def case_of(deck: Path, settings: list[str] | None) -> Case:
    """Read a deck with the keys that ``--set`` replaces."""
    from ..case import Case

    return Case.from_toml(deck, overrides=dict(map(setting, settings or ())))


def target_of(case: Problem, deck: Path, output: Path | None = None) -> Path:
    """Return the file that a run writes: from the option, else from the deck, else from the deck's name."""
    target = output or case.output.file or Path(f"{deck.stem}.nc")
    if target.suffix in _PICTURES:
        raise DeckError(f"output {target}: expected a netCDF file, such as {target.with_suffix('.nc')}")
    if not target.parent.is_dir():
        there = target.parent.exists()
        fault = f"{target.parent} is not a folder" if there else f"the folder {target.parent} does not exist"
        raise DeckError(f"cannot write {target}: {fault}")
    return target
