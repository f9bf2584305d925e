"""Pictures into files: what ``hexcontact plot`` does with its options."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..deck.units import ANGLE, LENGTH, UnitError, to_si
from ..errors import DeckError
from ..text import did_you_mean, listed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..result.result import Result

_SEVERAL_RUNS = ("compliance",)  # pictures that say little about one run


def steps_of(text: str) -> list[int]:
    """Read numbers of load steps: "20" or "10,20,30"."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise DeckError(f"--step {text}: expected a number of a load step, or several as 10,20,30") from None


def angle_of(text: str) -> float:
    """Read an angle to rad: a bare number is in degrees."""
    try:
        return math.radians(float(text))
    except ValueError:
        pass
    try:
        return to_si(text, ANGLE)
    except UnitError as error:
        raise DeckError(f"--angle {text}: expected an angle such as 30 or 0.5rad{_because(error)}") from None


def point_of(text: str) -> tuple[float, float]:
    """Read a point to m: "10um,0um"."""
    try:
        x, y = (to_si(_number_or_text(part), LENGTH) for part in text.split(","))
    except (UnitError, ValueError) as error:
        reason = _because(error) if isinstance(error, UnitError) else ""
        raise DeckError(f"--through {text}: expected two lengths such as 10um,0um{reason}") from None
    return x, y


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _because(error: UnitError) -> str:
    return f"; {error}" if str(error) else ""


def refuse_unknown(what: str, has_file: bool) -> None:
    """Complain about a picture that there is not, or not of a result, or not without one.

    Raises
    ------
    DeckError
    """
    from .plot_choices import OF_A_RESULT, OF_NO_RESULT

    if what not in (known := [*OF_A_RESULT, "all", *OF_NO_RESULT]):
        raise DeckError(f"--what {what}: expected {listed(known, 'or')}{did_you_mean(what, known)}")
    if has_file == (what in OF_NO_RESULT):
        expected = "expected no FILE" if has_file else "expected the FILE of a result"
        raise DeckError(f"--what {what}: {expected}")


def general_picture(what: str, picture: Path) -> Path:
    """Draw one of the pictures that belong to no result."""
    from ..plotting.influence import FIGURES

    return _save(FIGURES[what], what, picture)


def picture_of(results: Sequence[Result], what: str, picture: Path, chosen: Mapping[str, Any]) -> Path:
    """Draw one picture of a result, or of several.

    Parameters
    ----------
    results : sequence of Result
        The results.
    what : str
        Name of the picture.
    picture : Path
        File to write.
    chosen : mapping
        Values of the options that were given, by their names: step (a list), angle, through, over, arrows.

    Raises
    ------
    DeckError
        If the picture has no such option, the result has nothing to show in it, or it cannot be written.
    """
    from ..plotting import FIGURES

    arguments = _arguments(what, FIGURES[what], len(results), chosen)
    shown = results if "results" in inspect.signature(FIGURES[what]).parameters else results[0]
    named = listed([result.path for result in results], "and")
    return _save(lambda: FIGURES[what](shown, **arguments), f"{what} of {named}", picture)


def _arguments(
    what: str, draw: Callable[..., Figure], files: int, chosen: Mapping[str, Any]
) -> dict[str, Any]:
    """Turn the options that were given into the arguments of a picture."""
    known = inspect.signature(draw).parameters
    if files > 1 and "results" not in known:
        raise DeckError(f"--what {what} shows one result; expected one FILE, not {files}")
    arguments: dict[str, Any] = {}
    for option, value in chosen.items():
        if option == "step" and "steps" in known:
            arguments["steps"] = value
        elif option == "step" and "step" in known:
            if len(value) > 1:
                raise DeckError(f"--step: {what} shows one load step; expected one number, not {len(value)}")
            arguments["step"] = value[0]
        elif option in known:
            arguments[option] = value
        else:
            raise DeckError(f"--{option}: not an option of --what {what}")
    return arguments


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
    from ..plotting import FIGURES

    lines, written = [], False
    for what, draw in FIGURES.items():
        if what in _SEVERAL_RUNS:
            continue
        known = inspect.signature(draw).parameters
        own = {name: value for name, value in chosen.items() if {name, f"{name}s"} & known.keys()}
        arguments = _arguments(what, draw, 1, own)
        try:
            figure = draw(result, **arguments)
        except IndexError as error:
            raise DeckError(f"cannot draw {what} of {result.path}: {error}") from error
        except ValueError as error:
            lines.append(f"left out: {what} ({error})")
            continue
        target = _save(lambda figure=figure: figure, what, first.with_stem(f"{first.stem}_{what}"))  # type: ignore[misc]
        lines.append(f"written: {target}")
        written = True
    if not written:
        raise DeckError(f"nothing of {result.path} can be drawn; {lines[0]}")
    return lines


def _save(draw: Callable[[], Figure], what: str, picture: Path) -> Path:
    """Write a picture."""
    try:
        draw().savefig(picture, dpi=200)
    except (IndexError, ValueError) as error:  # no such step, nothing in contact, no such kind of file
        raise DeckError(f"cannot draw {what}: {error}") from error
    return picture
