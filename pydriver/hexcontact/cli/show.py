"""Commands that show results: info, report, export."""

from __future__ import annotations

from pathlib import Path

from ..errors import DeckError
from . import frame


@frame.command("hexcontact info hertz_spheres.nc")
def info(file: Path, as_json: bool = False) -> frame.Content:
    """Print a result: origin, history, energies, residuals, the last load step against Hertz; or a study."""
    from ..interior import files
    from ..result.store import open_result
    from ..study import dataset
    from . import printed

    kind, path, data = frame.opened(file)
    if kind == "result":
        result = open_result(file)
        if as_json:
            return printed.file_content(result)
        printed.Summary.of_result(result).print(whole_file=True)
        return None
    content, lines = (
        (dataset.content_of, dataset.lines_of) if kind == "study" else (files.content_of, files.lines_of)
    )
    if as_json:
        return content(data, path)
    frame.print_output(lines(data))
    return None


@frame.command(
    "hexcontact report fretting.nc",
    output=frame.option("--output -o", "Page to write (.html); default: FILE.html."),
)
def report(file: Path, output: Path | None = None) -> None:
    """Write one HTML page that shows a result: inputs, history, maps of every load step, residuals."""
    from ..result.store import open_result
    from .report import write_report

    frame.print_output(f"written: {write_report(open_result(file), output or frame.beside(file, '.html'))}")


@frame.command(
    "hexcontact export fretting.nc --vtk",
    vtk=frame.option(
        "--vtk", "A .vtu file for each load step, a .pvd for ParaView; [[stress]] and [[fatigue]], too."
    ),
    ugrid=frame.option("--ugrid", "A netCDF file with the fields on a mesh."),
    csv=frame.option("--csv", "The history, [[stress]] and [[fatigue]] as tables; with --step the fields."),
    histories=frame.option(
        "--histories", "Stress histories of [[fatigue]] as tables for pyLife, py-fatigue."
    ),
    step=frame.option(
        "--step -s", "Only these load steps, as 10,20 or 10-30 or a label; -1: the last.", "N,..."
    ),
    output=frame.option("--output -o", "Folder to write into; default: FILE_export beside FILE."),
)
def export(
    file: Path,
    vtk: bool = False,
    ugrid: bool = False,
    csv: bool = False,
    histories: bool = False,
    step: str | None = None,
    source: frame.Source | None = None,
    output: Path | None = None,
) -> None:
    """Write a result for other programs; of a study the table of its cases, of a table its values."""
    if not (vtk or ugrid or csv or histories):
        raise DeckError("expected --vtk, --ugrid, --csv or --histories")
    from ..result import export as write
    from ..result.store import open_result
    from ..study.dataset import table_of, with_units

    kind, path, data = frame.opened(file)
    folder, stem = output or frame.beside(path, "_export"), frame.beside(path, "").name
    if kind != "result":
        if vtk or ugrid or histories or step is not None or source is not None:
            held = (
                "is the result of a study, which has no fields"
                if kind == "study"
                else f"holds {data.attrs['content']}, a table"
            )
            raise DeckError(f"{path} {held}; expected --csv alone")
        if kind == "study":
            table, name = table_of(data).rename(columns=with_units(data)), f"{stem}_cases.csv"
        else:
            table, name = write.flat(data), f"{stem}.csv"
        frame.print_output(f"written: {write.write_table(table, folder / name)}")
        return
    result = open_result(file)
    steps = None if step is None else frame.steps_of(step, frame.labels_of(result))
    # first the tables that may be refused
    written = write.histories_to_csv(result, folder, stem) if histories else []
    written += write.volumes_to_vtk(result, folder, stem) if vtk else []
    written += [write.to_vtk(result, folder, stem, steps, source)] if vtk else []
    written += [write.to_ugrid(result, folder / f"{stem}_ugrid.nc", steps, source)] if ugrid else []
    written += write.to_csv(result, folder, stem, steps, source) if csv else []
    frame.print_output("\n".join(f"written: {path}" for path in written))
