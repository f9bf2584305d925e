"""Results for other programs: ParaView (VTK), mesh tools (UGRID), tables (CSV)."""

from __future__ import annotations

import base64
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import netcdf_library
from .._version import __version__
from ..arrays import DataArray, DataFrame, Dataset
from ..deck.below import Fatigue
from ..errors import DeckError, NoSuchStep
from ..files import MADE_BY, replacing, require_replaceable
from ..interior.files import as_volume, tables_of
from ..interior.stress import TENSOR
from ..text import escaped, visible
from ..variables import CONVENTIONS, FIELDS, FIXED, VARIABLES, VECTORS
from . import netcdf
from .result import Result, at_hand
from .step import is_kept, with_shown

_VTK_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "i1": "Int8", "u1": "UInt8"}
_TRIANGLE = 5  # number of this kind of cell in VTK


def kept_steps(result: Result, numbers: Sequence[int] | None = None) -> list[int]:
    """Return the numbers of the steps (default: all) whose fields are in a result.

    A requested step without fields is a DeckError, and so is a result without any.
    """
    try:
        every = result.dataset["step"].values if numbers is None else numbers
        wanted = [int(result.step(number)["step"]) for number in every]
    except NoSuchStep as error:
        raise DeckError(f"--step: {error}") from error
    kept = [n for n in wanted if any(is_kept(field.values) for field in _fields(result, n).values())]
    if not kept or (numbers is not None and len(kept) < len(wanted)):
        lost = sorted(set(wanted) - set(kept))
        where = f"step {lost[0]}" if numbers is not None else "any step"
        raise DeckError(f"the fields of {where} were not kept (output.fields, output.every)")
    return kept


def _meshed_steps(result: Result, numbers: Sequence[int] | None) -> list[int]:
    """Return the `kept_steps` of a result; refuse a window without triangles."""
    steps = kept_steps(result, numbers)
    if min(result.lattice.shape) < 2:
        raise DeckError("a window of one row or one column has no triangles to export")
    return steps


def _fields(result: Result, number: int, source: str | None = "nodes") -> Dataset:
    """Return the fields of a step, with the tractions of a source."""
    one = result.step(number)
    if source != "nodes":
        one = with_shown(one, result.lattice, source)
    return one[[name for name in FIELDS if name in one]]


# --- VTK ------------------------------------------------------------------------------------------


def to_vtk(
    result: Result,
    folder: Path,
    stem: str,
    numbers: Sequence[int] | None = None,
    source: str | None = None,
) -> Path:
    """Write a VTK file for each load step, and return the ``.pvd`` file that lists them."""
    steps = _meshed_steps(result, numbers)
    _make(folder)
    return _series(folder, stem, "vtu", {number: _vtu(result, number, source) for number in steps})


def volumes_to_vtk(result: Result, folder: Path, stem: str) -> list[Path]:
    """Write the tables [[stress]] and [[fatigue]] as structured grids with a ``.pvd`` file each."""
    written = []
    for name, found in at_hand(result, kept_steps(result)):
        _make(folder)
        if "step" not in found.coords:  # of a cycle, at its end
            found = found.expand_dims(step=[int(found.attrs["steps"][-1])])
        pages = {number: _vts(result, found.sel(step=number)) for number in found["step"].values.tolist()}
        written.append(_series(folder, f"{stem}_{name}", "vts", pages))
    return written


def histories_to_csv(result: Result, folder: Path, stem: str) -> list[Path]:
    """Write the stress histories of the tables ``[[fatigue]]`` of the deck, in the format of pyLife.

    A line has point, load step, place (m) and the six stresses (MPa); points are written block by block.
    """
    tables = {name: table for name, table in tables_of(result.deck).items() if isinstance(table, Fatigue)}
    if not tables:
        raise DeckError("--histories: expected a table [[fatigue]] in the deck, which says of which points")
    _make(folder)
    written = [folder / f"{stem}_{name}_histories.csv" for name in tables]
    for target in written:
        require_replaceable(target, "node_id,load_step,")
    for target, table in zip(written, tables.values(), strict=True):
        blocks = result.stress_histories(table.segment, table.steps, table.body, **table.where)
        with replacing(target) as path:
            for number, block in enumerate(blocks):
                block.to_csv(path, mode="a", header=not number, float_format="%.8g")
    return written


def _series(folder: Path, stem: str, kind: str, pages: Mapping[int, str]) -> Path:
    """Write a file for each load step, and their list."""
    width = max(4, len(str([*pages][-1])))
    names = {number: f"{stem}_{number:0{width}d}.{kind}" for number in pages}
    sets = (f'    <DataSet timestep="{n}" part="0" file="{escaped(name)}"/>\n' for n, name in names.items())
    series = (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n'
        f"<!-- {MADE_BY} -->\n"
        f"  <Collection>\n{''.join(sets)}  </Collection>\n</VTKFile>\n"
    )
    texts = {**{names[number]: page for number, page in pages.items()}, f"{stem}.pvd": series}
    for name in texts:
        require_replaceable(folder / name)
    for name, text in texts.items():
        with replacing(folder / name) as path:
            path.write_text(text, encoding="utf-8")
    return folder / f"{stem}.pvd"


def _vtu(result: Result, number: int, source: str | None) -> str:
    """Return a load step as an unstructured grid in XML, with components of vectors joined."""
    lattice, one, fields = result.lattice, result.step(number), _fields(result, number, source)
    points = np.stack([lattice.x.ravel(), lattice.y.ravel(), np.zeros(lattice.size)], axis=1)
    faces = netcdf.triangles(lattice.n_row, lattice.n_col)
    numbers = [name for name, v in VARIABLES.items() if v.dims == ("step",) and v.dtype != "str"]
    history = {name: one[name] for name in numbers if name in one.variables}
    data = _arrays({name: one[name] for name in FIXED if name in one})
    for name, parts in VECTORS.items():
        if all(part in fields for part in parts):
            columns = [fields[part].values.ravel() for part in parts]
            columns += [np.zeros_like(columns[0])] * (3 - len(parts))
            data += _array(name, np.stack(columns, axis=1), VARIABLES[parts[0]].unit)
            fields = fields.drop_vars(parts)
    cells = [
        _array("connectivity", faces.ravel().astype("i4")),
        _array("offsets", np.arange(3, 3 * len(faces) + 1, 3, dtype="i4")),
        _array("types", np.full(len(faces), _TRIANGLE, dtype="u1")),
    ]
    return _vtk(
        *("UnstructuredGrid", result, number),
        f"<UnstructuredGrid>\n<FieldData>\n{_arrays(history)}</FieldData>\n"
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(faces)}">\n'
        f"<PointData>\n{data}{_arrays(fields.data_vars)}</PointData>\n<CellData/>\n"
        f"<Points>\n{_array('Points', points, 'm')}</Points>\n<Cells>\n{''.join(cells)}</Cells>\n"
        "</Piece>\n</UnstructuredGrid>\n",
    )


def _vts(result: Result, found: Dataset) -> str:
    """Return quantities below the surface as a structured grid in XML; z points into body 1."""
    points, shape = as_volume(found)
    extent = " ".join(f"0 {n - 1}" for n in reversed(shape))
    data = _arrays(found.data_vars)
    if all(name in found for name in TENSOR):  # in the order of a symmetric tensor, as filters take it
        data += _array("stress", np.stack([found[name].values.ravel() for name in TENSOR], axis=1), "Pa")
    return _vtk(
        *("StructuredGrid", result, int(found["step"].item())),
        f'<StructuredGrid WholeExtent="{extent}">\n<Piece Extent="{extent}">\n'
        f"<PointData>\n{data}</PointData>\n<CellData/>\n"
        f"<Points>\n{_array('Points', points, 'm')}</Points>\n</Piece>\n</StructuredGrid>\n",
    )


def _vtk(kind: str, result: Result, number: int, grid: str) -> str:
    """Return a file of VTK in XML about a load step."""
    title, source = result.case_title or "hexcontact", result.dataset.attrs["source"]
    about = re.sub("-(?=-)", "- ", escaped(f"{title}, load step {number}; {source}; {MADE_BY}; SI units"))
    return (
        f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" '
        f'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<!-- {about} -->\n{grid}</VTKFile>\n'
    )


def _arrays(found: Mapping[Any, DataArray]) -> str:
    """Return numbers by node or point in XML, with their units."""
    units = {name: str(values.attrs.get("units", "")).removesuffix("1") for name, values in found.items()}
    return "".join(_array(str(name), values.values.ravel(), units[name]) for name, values in found.items())


def _array(name: str, values: NDArray[Any], unit: str = "") -> str:
    """Return a compressed array in XML, with its unit for ParaView."""
    data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    raw = data.tobytes()
    packed = zlib.compress(raw, 6)
    header = np.array([1, len(raw), 0, len(packed)], dtype="<u8").tobytes()  # one whole block
    text = (base64.b64encode(header) + base64.b64encode(packed)).decode()
    shape = f' NumberOfComponents="{data.shape[1]}"' if data.ndim > 1 else ""
    alone = ' NumberOfTuples="1"' if data.size == 1 else ""
    key = '<InformationKey name="UNITS_LABEL" location="vtkDataArray">' + unit + "</InformationKey>\n"
    kind = _VTK_TYPES[data.dtype.str[1:]]
    return (
        f'<DataArray type="{kind}" Name="{escaped(name)}"{shape}{alone} format="binary">\n{text}\n'
        f"{key if unit else ''}</DataArray>\n"
    )


# --- UGRID ----------------------------------------------------------------------------------------


def to_ugrid(
    result: Result, target: Path, numbers: Sequence[int] | None = None, source: str | None = None
) -> Path:
    """Write a netCDF file whose fields lie on the nodes of a mesh, for xugrid and others.

    The result has the same mesh, but its fields by row and column.
    """
    steps = _meshed_steps(result, numbers)
    _make(target.parent)
    ours = {"content", "hexcontact_version"} <= netcdf_library.attributes(target).keys()
    if target.is_file() and target.stat().st_size and not ours:
        raise DeckError(f"{target} exists and was not made by hexcontact; delete it or choose another name")
    with replacing(target) as path, netcdf_library.opened(path, "w", format="NETCDF4_CLASSIC") as file:
        known = result.dataset.attrs
        named = {name: known[name] for name in ("title", "source", "history") if name in known}
        about = {"content": "fields on a mesh", "hexcontact_version": __version__}
        file.setncatts({"Conventions": CONVENTIONS, **about, **named})
        file.createDimension("step", len(steps))
        netcdf.add_column(file, "step", "i4", ("step",), VARIABLES["step"].attributes, steps)
        netcdf.write_mesh(file, result.lattice)
        on_nodes = {"mesh": netcdf.TOPOLOGY, "location": "node", "coordinates": "mesh_node_x mesh_node_y"}
        for name in (name for name in (*FIXED, *FIELDS) if name in result.dataset):
            variable = VARIABLES[name]
            fill = variable.missing if variable.dtype == "f8" else None
            dims, attributes = (*variable.dims[:-2], netcdf.NODE), variable.attributes | on_nodes
            column = netcdf.add_column(
                *(file, name, variable.dtype, dims, attributes), zlib=True, complevel=1, fill_value=fill
            )
            if name in FIXED:
                column[...] = result.dataset[name].values.ravel()
        for position, number in enumerate(steps):
            for shown, field in _fields(result, number, source).items():
                file[str(shown)][position] = field.values.ravel()
    return target


# --- CSV ------------------------------------------------------------------------------------------


def to_csv(
    result: Result,
    folder: Path,
    stem: str,
    numbers: Sequence[int] | None = None,
    source: str | None = None,
) -> list[Path]:
    """Write tables of the history, of the nodes in some steps, and those of the deck."""
    steps = [] if numbers is None else kept_steps(result, numbers)
    written = [folder / f"{stem}_history.csv", *(folder / f"{stem}_{number:04d}.csv" for number in steps)]
    names = tables_of(result.deck) if result.complete else ()
    wanted = {name: folder / f"{stem}_{name}.csv" for name in names}
    for name, target in wanted.items():
        if target in written:
            raise DeckError(f"the table {name} would be written to {target}, as others are; rename it")
    found = at_hand(result, kept_steps(result)) if wanted else ()
    history = result.history.reset_index().rename(columns=_with_unit)
    tables = {written[0]: history} | {wanted[name]: flat(values) for name, values in found}
    for target in written[1:]:
        require_replaceable(target, "row,col,x [m],")
    for target, table in tables.items():
        require_replaceable(target, _beginning(table))
    for number, target in zip(steps, written[1:], strict=True):
        fields = _fields(result, number, source)
        table = fields.to_dataframe(dim_order=["row", "col"]).reset_index()
        write_table(table[["row", "col", "x", "y", *fields.data_vars]].rename(columns=_with_unit), target)
    for target, table in tables.items():
        write_table(table, target)
    return [*written, *wanted.values()]


def flat(found: Dataset) -> DataFrame:
    """Return quantities at or below the surface as a table, a line for each point and step."""
    dims = [str(dim) for dim in next(iter(found.data_vars.values())).dims]
    columns = [name for name in ("step", "x", "y", "depth", "distance") if name in found.coords]
    table = found.to_dataframe(dim_order=dims).reset_index()[[*columns, *map(str, found.data_vars)]]
    units = {name: str(found[name].attrs.get("units", "")).removesuffix("1") for name in table.columns}
    return table.rename(columns={name: f"{name} [{unit}]" for name, unit in units.items() if unit})


def write_table(table: DataFrame, target: Path) -> Path:
    """Write a table as CSV."""
    require_replaceable(target, _beginning(table))
    _make(target.parent)
    texts = {name: table[name].map(_cell) for name in table.select_dtypes(exclude="number")}
    with replacing(target) as path:
        table.assign(**texts).to_csv(path, index=False)
    return target


def _beginning(table: DataFrame) -> str:
    """Return the start of the file of a table, by which it is known again."""
    return ",".join(table.columns[: 3 if "segment" in table else 4])


def _cell(value: Any) -> Any:
    """Return the cell of a table; text that a spreadsheet would run as a formula gets a leading '."""
    if not isinstance(value, str):
        return value
    text = visible(value)
    return f"'{text}" if text.lstrip().startswith(("=", "+", "-", "@")) else text


def _with_unit(name: str) -> str:
    unit = VARIABLES[name].unit
    return f"{name} [{unit}]" if unit else name


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise DeckError(f"{folder} is a file; expected a folder to write into") from None
