"""Commands that show results: info, plot, report, export."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import DeckError
from .guard import Content, guarded, say
from .options import AsJson, ResultFile

if TYPE_CHECKING:
    from ..result.result import Result


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


@guarded
def info(file: ResultFile, as_json: AsJson = False) -> Content:
    """Say what a result holds: origin, history, residuals, the last load step against Hertz."""
    from ..result import remarks
    from ..result.history import step_rows
    from ..text import rich_table
    from . import json_output
    from . import tables as summary

    result = _open(file)
    if as_json:
        return json_output.of_result(result)
    case, console = summary.case_of(result), summary.console()
    histories = result.history.to_dict("records")
    console.print(summary.pairs(result.case_title, summary.file_rows(result)))
    console.print(summary.history_table(histories, console))
    console.print(summary.pairs("Last load step", step_rows(histories[-1])))
    if case is not None and (rows := summary.hertz_rows(case, histories[-1])):
        console.print(rich_table("Against Hertz", summary.HERTZ_HEADERS, rows))
    if rows := summary.trial_rows(result):
        console.print(rich_table("Accuracy", summary.TRIAL_HEADERS, rows))
    for remark in remarks.remarks(histories, result.dataset.attrs):
        console.print(f"note: {remark}", soft_wrap=True)
    return None


def _open(path: Path) -> Result:
    from ..result.store import open_result

    return open_result(path)


@guarded
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
    """Draw a result, or what belongs to none; its help is made of the choices there are."""
    from . import plot as command

    command.refuse_unknown(what, bool(files))
    given = {
        "step": None if step is None else command.steps_of(step),
        "angle": None if angle is None else command.angle_of(angle),
        "through": None if through is None else command.point_of(through),
        "over": over,
        "arrows": None if arrows is None else arrows.value,
    }
    chosen = {name: value for name, value in given.items() if value is not None}
    if output and kind:
        raise DeckError(f"--format {kind}: the name of --output {output} says what kind of picture it is")
    suffix = f".{kind or 'png'}"
    if not files:
        if chosen:
            raise DeckError(f"--{next(iter(chosen))}: not an option of --what {what}")
        say(f"written: {command.general_picture(what, output or Path(f'{what}{suffix}'))}")
        return
    results, first = [_open(file) for file in files], output or files[0].with_suffix(suffix)
    if what == "all":
        if len(files) > 1:
            raise DeckError(f"--what all shows one result; expected one FILE, not {len(files)}")
        say("\n".join(command.all_pictures(results[0], first, chosen)))
        return
    picture = first if output else first.with_stem(f"{first.stem}_{what}")
    say(f"written: {command.picture_of(results, what, picture, chosen)}")


@guarded
def report(
    file: ResultFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Page to write (.html); default: FILE.html.")
    ] = None,
) -> None:
    """Write one HTML page that shows a result: inputs, history, maps of every load step, residuals."""
    from .report import write_report

    say(f"written: {write_report(_open(file), output or file.with_suffix('.html'))}")


@guarded
def export(
    file: ResultFile,
    vtk: Annotated[
        bool, typer.Option("--vtk", help="A .vtu file by load step, a .pvd for ParaView.")
    ] = False,
    ugrid: Annotated[bool, typer.Option("--ugrid", help="A netCDF file with the fields on a mesh.")] = False,
    csv: Annotated[
        bool, typer.Option("--csv", help="The history as a table; with --step fields by node, too.")
    ] = False,
    step: Annotated[
        str | None, typer.Option("--step", "-s", metavar="N,...", help="Only these load steps; -1: the last.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder to write into; default: FILE_export beside FILE."),
    ] = None,
) -> None:
    """Write a result for other programs."""
    if not (vtk or ugrid or csv):
        raise DeckError("expected --vtk, --ugrid or --csv")
    from ..result import export as write
    from .plot import steps_of

    result, folder = _open(file), output or file.with_name(f"{file.stem}_export")
    steps, stem = None if step is None else steps_of(step), file.stem
    written = [write.to_vtk(result, folder, stem, steps)] if vtk else []
    written += [write.to_ugrid(result, folder / f"{stem}_ugrid.nc", steps)] if ugrid else []
    written += write.to_csv(result, folder, stem, steps) if csv else []
    say("\n".join(f"written: {path}" for path in written))
