"""Commands that show results: info, report, export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import DeckError
from .guard import Content, command, say
from .options import AsJson, ResultFile, beside, steps_of


@command("hexcontact info hertz_spheres.nc")
def info(file: ResultFile, as_json: AsJson = False) -> Content:
    """Say what a result holds: origin, history, residuals, the last load step against Hertz."""
    from ..result.store import open_result
    from . import tables

    result = open_result(file)
    if as_json:
        return tables.file_content(result)
    tables.Summary.of_result(result).print(whole_file=True)
    return None


@command("hexcontact report fretting.nc")
def report(
    file: ResultFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Page to write (.html); default: FILE.html.")
    ] = None,
) -> None:
    """Write one HTML page that shows a result: inputs, history, maps of every load step, residuals."""
    from ..result.store import open_result
    from .report import write_report

    say(f"written: {write_report(open_result(file), output or beside(file, '.html'))}")


@command("hexcontact export fretting.nc --vtk")
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
    from ..result.store import open_result

    result, folder = open_result(file), output or beside(file, "_export")
    steps, stem = None if step is None else steps_of(step), beside(file, "").name
    written = [write.to_vtk(result, folder, stem, steps)] if vtk else []
    written += [write.to_ugrid(result, folder / f"{stem}_ugrid.nc", steps)] if ugrid else []
    written += write.to_csv(result, folder, stem, steps) if csv else []
    say("\n".join(f"written: {path}" for path in written))
