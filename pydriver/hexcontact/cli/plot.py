"""The command that draws: ``hexcontact plot``; the figures stand in `hexcontact.plotting`."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from ..deck.units import ANGLE, LENGTH, UnitError, to_si
from ..errors import DeckError
from ..text import did_you_mean, listed
from .guard import command, say
from .options import beside, steps_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..plotting.registry import Entry
    from ..result.result import Result

_DRAWS = "Draw a result, or what the influence functions and load shapes look like."
_ALL = "all"


class Kind(enum.StrEnum):
    """Kinds of pictures."""

    png = "png"
    pdf = "pdf"
    svg = "svg"


class Arrows(enum.StrEnum):
    """Arrows that a zone map may have."""

    none = "none"
    traction = "traction"
    slip = "slip"


class _Plot(TyperCommand):
    """The command; its help names the figures, for which the packages that draw are imported."""

    @property
    def help(self) -> str:
        """What it does, and a line for each figure."""
        return _help()

    @help.setter
    def help(self, text: str) -> None:
        pass


def _help() -> str:
    from ..plotting.registry import entries

    choices = [(entry.of_a_result, name, entry.help) for name, entry in entries().items()]
    choices.append((True, _ALL, "each that there is, in a file of its own"))
    width = 2 + max(len(name) for _, name, _ in choices)
    of_a_result, of_none = (
        "\n".join(f"{name:<{width}}{words}" for of_one, name, words in choices if of_one == kind)
        for kind in (True, False)
    )
    return (
        f"{_DRAWS}\n\n"
        "Closed solutions (Hertz, Cattaneo-Mindlin, Mindlin-Deresiewicz, Lubkin) are drawn beside where they "
        f"apply.\n\n\b\nChoices of --what:\n{of_a_result}\n\n\b\nWithout FILE:\n{of_none}"
    )


@command(
    "hexcontact plot fretting.nc --what tractions --step 15,20,25,30 --output cuts.pdf",
    cls=_Plot,
    short_help=_DRAWS,
)
def plot(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE",
            help="The result, a netCDF file; several for zones, outlines and compliance.",
            show_default=False,
        ),
    ] = None,
    what: Annotated[str, typer.Option("--what", "-w", help="Which picture; see above.")] = "overview",
    step: Annotated[
        str | None,
        typer.Option(
            "--step",
            "-s",
            metavar="N,...",
            help="Load step, the first is 1; -1, the default: the last. Some "
            "pictures show several: 10,20,30.",
        ),
    ] = None,
    angle: Annotated[
        str | None,
        typer.Option(metavar="ANGLE", help="Direction of the line of section and tractions from x, degrees."),
    ] = None,
    through: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="A point of that line, as 10um,0um; default: the center."),
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="What the history is drawn over, as tangential_load_x."),
    ] = None,
    arrows: Annotated[
        Arrows | None, typer.Option(help="Arrows on zone maps: shear traction, or slip in the step.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Picture to write (.png, .pdf, .svg); default: FILE_WHAT.png beside FILE."
        ),
    ] = None,
    kind: Annotated[
        Kind | None, typer.Option("--format", "-f", help="Kind of picture where --output names none.")
    ] = None,
) -> None:
    """Draw a result, or what belongs to none; the help is made of the figures that there are."""
    from ..plotting.registry import entries
    from ..result.store import open_result

    files = files or []
    figures = entries()
    if what not in (known := [*figures, _ALL]):
        raise DeckError(f"--what {what}: expected {listed(known, 'or')}{did_you_mean(what, known)}")
    if bool(files) != (what == _ALL or figures[what].of_a_result):
        expected = "expected no FILE" if files else "expected the FILE of a result"
        raise DeckError(f"--what {what}: {expected}")
    given = {
        "step": None if step is None else steps_of(step),
        "angle": None if angle is None else angle_of(angle),
        "through": None if through is None else point_of(through),
        "over": over,
        "arrows": None if arrows is None else arrows.value,
    }
    chosen = {name: value for name, value in given.items() if value is not None}
    if output and kind:
        raise DeckError(f"--format {kind}: the name of --output {output} says what kind of picture it is")
    suffix = f".{kind or 'png'}"
    if what == _ALL:
        if len(files) > 1:
            raise DeckError(f"--what all shows one result; expected one FILE, not {len(files)}")
        first = output or beside(files[0], suffix)
        say("\n".join(all_pictures(open_result(files[0]), first, chosen)))
        return
    default = beside(files[0], f"_{what}{suffix}") if files else Path(f"{what}{suffix}")
    say(f"written: {picture_of([open_result(file) for file in files], what, output or default, chosen)}")


# --- options ----------------------------------------------------------------------------------------


def angle_of(text: str) -> float:
    """Read an angle to rad: a bare number is in degrees."""
    try:
        number = _number_or_text(text)
        return to_si(number, ANGLE) if isinstance(number, str) else math.radians(number)
    except UnitError as error:
        raise DeckError(f"--angle {text}: expected an angle such as 30 or 0.5rad{_because(error)}") from None


def point_of(text: str) -> tuple[float, float]:
    """Read a point to m: "10um,0um"."""
    try:
        x, y = (to_si(_number_or_text(part), LENGTH) for part in text.split(","))
    except (UnitError, ValueError) as error:
        raise DeckError(f"--through {text}: expected two lengths such as 10um,0um{_because(error)}") from None
    return x, y


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _because(error: ValueError) -> str:
    return f"; {error}" if isinstance(error, UnitError) and str(error) else ""


def _arguments(entry: Entry, files: int, chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Turn the options that were given into the arguments of a figure."""
    if files > 1 and not entry.of_several:
        raise DeckError(f"--what {entry.name} shows one result; expected one FILE, not {files}")
    arguments: dict[str, Any] = {}
    for option, value in chosen.items():
        if option == "step" and "steps" in entry.options:
            arguments["steps"] = value
        elif option not in entry.options:
            raise DeckError(f"--{option}: not an option of --what {entry.name}")
        elif option == "step":
            if len(value) > 1:
                count = f"expected one number, not {len(value)}"
                raise DeckError(f"--step: {entry.name} shows one load step; {count}")
            arguments["step"] = value[0]
        else:
            arguments[option] = value
    return arguments


# --- drawing ----------------------------------------------------------------------------------------


def picture_of(results: Sequence[Result], what: str, picture: Path, chosen: Mapping[str, Any]) -> Path:
    """Draw one picture of a result, of several, or of none.

    Parameters
    ----------
    results : sequence of Result
        The results.
    what : str
        Name of the figure.
    picture : Path
        File to write.
    chosen : mapping
        Values of the options that were given, by their names: step (a list), angle, through, over, arrows.

    Raises
    ------
    DeckError
        If the figure has no such option, the result has nothing to show in it, or it cannot be written.
    """
    from ..plotting.registry import entries

    entry = entries()[what]
    arguments = _arguments(entry, len(results), chosen)
    shown = [results] if entry.of_several else results
    named = listed([result.path for result in results], "and") if results else ""
    about = f"{what} of {named}" if named else what
    try:
        figure = entry.draw(*shown, **arguments)
    except (IndexError, ValueError) as error:  # no such step, nothing in contact
        raise DeckError(f"cannot draw {about}: {error}") from error
    return _save(figure, about, picture)


def all_pictures(result: Result, first: Path, chosen: Mapping[str, Any]) -> list[str]:
    """Draw every picture that the result has something to show in; return a line about each.

    Parameters
    ----------
    result : Result
        The result.
    first : Path
        File whose name all files get, with the name of the picture behind it.
    chosen : mapping
        Values of the options that were given; each picture takes those that it knows.

    Raises
    ------
    DeckError
        If none can be drawn or one cannot be written.
    """
    from ..plotting.registry import SEVERAL_RUNS, entries

    lines, written = [], False
    for what, entry in entries().items():
        if entry.needs == SEVERAL_RUNS or not entry.of_a_result:
            continue
        own = {name: value for name, value in chosen.items() if {name, f"{name}s"} & entry.options.keys()}
        arguments = _arguments(entry, 1, own)
        try:
            figure = entry.draw(result, **arguments)
        except IndexError as error:
            raise DeckError(f"cannot draw {what} of {result.path}: {error}") from error
        except ValueError as error:
            lines.append(f"left out: {what} ({error})")
            continue
        lines.append(f"written: {_save(figure, what, first.with_stem(f'{first.stem}_{what}'))}")
        written = True
    if not written:
        raise DeckError(f"nothing of {result.path} can be drawn; {lines[0]}")
    return lines


def _save(figure: Figure, about: str, picture: Path) -> Path:
    """Write a picture."""
    try:
        figure.savefig(picture, dpi=200)
    except ValueError as error:  # no such kind of file
        raise DeckError(f"cannot draw {about}: {error}") from error
    return picture
