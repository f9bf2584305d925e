"""The command that draws figures of `hexcontact.plotting`: ``hexcontact plot``."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer.core import TyperCommand

from ..deck.units import ANGLE, LENGTH, Dimension, UnitError, to_si
from ..errors import DeckError, NoSuchStep
from ..files import MADE_BY, replacing, require_replaceable
from ..text import did_you_mean, listed
from . import frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..plotting.registry import Entry
    from ..result.result import Result

_DRAWS = "Draw a result, or the cases of a study."
_ALL = "all"


Format = enum.StrEnum("Format", ["png", "pdf", "svg"])
"""Formats of pictures."""

Arrows = enum.StrEnum("Arrows", ["none", "traction", "slip"])
"""Arrows on zone maps."""


def _help() -> str:
    """Return the help, with a line for each figure: this imports the packages that draw."""
    from ..plotting.registry import entries

    choices = [(entry.shows, name, entry.help) for name, entry in entries().items()]
    choices.append(("result", _ALL, "every figure of the result, each in its own file"))
    width = 2 + max(len(name) for _, name, _ in choices)
    of_a_result, of_a_study, of_a_table, of_a_deck = (
        "\n".join(f"{name:<{width}}{words}" for kind, name, words in choices if kind == wanted)
        for wanted in ("result", "study", "table", "deck")
    )
    return (
        f"{_DRAWS}\n\n"
        "Closed-form solutions (Hertz, Cattaneo-Mindlin, Mindlin-Deresiewicz, Lubkin) are drawn where they "
        f"apply.\n\n\b\nChoices of --what:\n{of_a_result}\n\n"
        f"\b\nOf a study:\n{of_a_study}\n\n\b\nOf a table:\n{of_a_table}\n\n\b\nOf a deck:\n{of_a_deck}"
    )


class _WithFigures(TyperCommand):
    """The command whose help is written when it is read."""

    help = property(lambda _: _help(), lambda _, __: None)


@frame.command(
    "hexcontact plot fretting.nc --what tractions --step 15,20,25,30 --output cuts.pdf",
    short_help=_DRAWS,
    cls=_WithFigures,
    files=frame.argument(
        "FILE",
        "The result or a table of it, a netCDF file; several for zones, outlines, compliance; or a deck.",
    ),
    what=frame.option("--what -w", "Which picture; see above."),
    step=frame.option(
        "--step -s",
        "Load step, the first is 1; -1, the default: the last. Some pictures show several: "
        "10,20,30 or 10-30 or all. The label of a segment is its last step.",
        "N,...",
    ),
    angle=frame.option("--angle", "Direction of the line of section and tractions from x, degrees.", "ANGLE"),
    through=frame.option("--through", "A point of that line, as 10um,0um; default: the center.", "X,Y"),
    cycle=frame.option("--cycle", "Cycles of loop and torsion: 2, or 1,2, or all; -1: the last.", "N,..."),
    over=frame.option("--over", "Variable of the horizontal axis, as tangential_load_x.", "NAME"),
    arrows=frame.option("--arrows", "Arrows on zone maps: shear traction, or slip in the step."),
    output=frame.option(
        "--output -o", "Picture to write (.png, .pdf, .svg); default: FILE_WHAT.png beside FILE."
    ),
    format=frame.option("--format -f", "Format where --output names none."),
)
def plot(
    files: list[Path] | None = None,
    what: str = "overview",
    step: str | None = None,
    angle: str | None = None,
    through: str | None = None,
    cycle: str | None = None,
    over: str | None = None,
    arrows: Arrows | None = None,
    source: frame.Source | None = None,
    output: Path | None = None,
    format: Format | None = None,
) -> None:
    """Draw a result, a study or a table; `_help` makes the help from the figures."""
    from ..plotting.registry import entries
    from ..result.store import open_result

    figures = entries()
    if what not in (known := [*figures, _ALL]):
        raise DeckError(f"--what {what}: expected {listed(known, 'or')}{did_you_mean(what, known)}")
    if not files:
        raise DeckError(f"--what {what}: expected the FILE of a result")
    if output and format:
        raise DeckError(f"--format {format}: the name of --output {output} has a format already")
    options = {"step": step, "cycle": cycle, "angle": angle, "through": through, "over": over}
    options |= {"arrows": arrows, "source": source}
    given = {name: text for name, text in options.items() if text is not None}
    suffix = f".{format or 'png'}"
    if what in figures and figures[what].shows == "deck":
        if len(files) > 1 or given:
            raise DeckError(f"--what {what}: expected one deck, and no other options but --output, --format")
        picture = output or frame.beside(files[0], f"_{what}{suffix}")
        figure = figures[what].draw(frame.case_of(files[0], None))
        frame.print_output(f"written: {_save(figure, f'{what} of {files[0]}', picture)}")
        return
    holds, path, data = frame.opened(files[0]) if len(files) == 1 else ("result", files[0], None)
    if holds != "result" and what == "overview":
        what = holds
    shows = "result" if what == _ALL else figures[what].shows
    if holds != shows:
        words = {"study": "the result of a study", "table": "a table [[stress]] or [[fatigue]]"}
        kind = f"{words[holds]}; expected --what {holds}" if holds in words else f"not {words[shows]}"
        raise DeckError(f"--what {what}: {files[0]} is {kind}")
    results: list[Any] = [open_result(file) for file in files] if holds == "result" else []
    parsers = {
        "step": lambda text: frame.steps_of(text, frame.labels_of(results[0]) if results else [""]),
        "cycle": lambda text: frame.steps_of(text, [""] * len(results and results[0].cycles), "cycle"),
        "angle": angle_of,
        "through": point_of,
    }
    chosen = {name: parsers.get(name, str)(text) for name, text in given.items()}
    if what == _ALL:
        if len(files) > 1:
            raise DeckError(f"--what all shows one result; expected one FILE, not {len(files)}")
        first = output or frame.beside(files[0], suffix)
        frame.print_output("\n".join(all_pictures(results[0], first, chosen)))
        return
    picture = output or frame.beside(path, f"_{what}{suffix}")
    frame.print_output(f"written: {picture_of(results or [data], what, picture, chosen)}")


# --- options ----------------------------------------------------------------------------------------


def angle_of(text: str) -> float:
    """Return an angle (rad) from text; a bare number is in degrees."""
    try:
        return _quantity_of(text, ANGLE, math.radians(1.0))
    except UnitError as error:
        raise DeckError(f"--angle {text}: expected an angle such as 30 or 0.5rad{_because(error)}") from None


def point_of(text: str) -> tuple[float, float]:
    """Return a point (m) from text such as "10um,0um"."""
    try:
        x, y = (_quantity_of(part, LENGTH, 1.0) for part in text.split(","))
    except ValueError as error:
        raise DeckError(f"--through {text}: expected two lengths such as 10um,0um{_because(error)}") from None
    return x, y


def _quantity_of(text: str, dimension: Dimension, bare: float) -> float:
    """Return a quantity in SI from text; `bare` is the unit of a number without one."""
    try:
        return bare * float(text)
    except ValueError:
        return to_si(text, dimension)


def _because(error: ValueError) -> str:
    return f"; {error}" if isinstance(error, UnitError) and str(error) else ""


def _arguments(entry: Entry, files: int, chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a figure from the given options."""
    if files > 1 and not entry.of_several:
        raise DeckError(f"--what {entry.name} shows one result; expected one FILE, not {files}")
    arguments: dict[str, Any] = {}
    for name, value in chosen.items():
        if f"{name}s" in entry.options:
            arguments[f"{name}s"] = value
        elif name not in entry.options:
            raise DeckError(f"--{name}: not an option of --what {entry.name}")
        elif name == "step":
            if len(value) > 1:
                count = f"expected one number, not {len(value)}"
                raise DeckError(f"--step: {entry.name} shows one load step; {count}")
            arguments["step"] = value[0]
        else:
            arguments[name] = value
    return arguments


# --- drawing ----------------------------------------------------------------------------------------


def picture_of(results: Sequence[Result], what: str, picture: Path, chosen: Mapping[str, Any]) -> Path:
    """Draw a picture of one result, or of several, with the given options; return its file."""
    from ..plotting.registry import entries

    entry = entries()[what]
    arguments = _arguments(entry, len(results), chosen)
    shown = [results] if entry.of_several else results
    paths = [getattr(result, "path", "") for result in results]  # a study has none
    named = listed(paths, "and") if any(paths) else ""
    about = f"{what} of {named}" if named else what
    try:
        figure = entry.draw(*shown, **arguments)
    except DeckError as error:  # such as no such step, nothing in contact
        raise DeckError(f"cannot draw {about}: {error}") from error
    return _save(figure, about, picture)


def all_pictures(result: Result, first: Path, chosen: Mapping[str, Any]) -> list[str]:
    """Draw every figure for which the result has data, each with the options that it has.

    Return a line about each; the name of a figure is appended to that of the file `first`.
    """
    from ..plotting.registry import SEVERAL_RUNS, entries

    lines, written = [], False
    for what, entry in entries().items():
        if entry.needs == SEVERAL_RUNS or entry.shows != "result":
            continue
        own = {name: value for name, value in chosen.items() if {name, f"{name}s"} & entry.options.keys()}
        arguments = _arguments(entry, 1, own)
        try:
            figure = entry.draw(result, **arguments)
        except NoSuchStep as error:
            raise DeckError(f"cannot draw {what} of {result.path}: {error}") from error
        except DeckError as error:
            lines.append(f"left out: {what} ({error})")
            continue
        lines.append(f"written: {_save(figure, what, first.with_stem(f'{first.stem}_{what}'))}")
        written = True
    if not written:
        raise DeckError(f"nothing of {result.path} can be drawn; {lines[0]}")
    return lines


def _save(figure: Figure, about: str, picture: Path) -> Path:
    """Write a picture, which may replace an earlier one; by default a PNG."""
    picture = picture if picture.suffix else picture.with_name(f"{picture.name}.png")
    if picture.suffix.lower() not in (known := [f".{name}" for name in Format]):
        raise DeckError(f"cannot draw {about}: {picture}: expected {listed(known, 'or')}")
    require_replaceable(picture)
    with replacing(picture) as temporary:
        figure.savefig(temporary, format=picture.suffix[1:].lower(), dpi=200, metadata={"Creator": MADE_BY})
    return picture
