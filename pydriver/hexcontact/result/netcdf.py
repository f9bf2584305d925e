"""The result file, in netCDF.

HDF5 files may have further bytes at their end. Those of a result are its seal of 48 bytes: a mark, and a
SHA-256 of the SHA-256 of each block before it. So damage shows before HDF5 reads it, also in indices of
chunks. A program that rewrites the file with HDF5 removes the seal.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import math
import os
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Dataset
from ..core import memory
from ..core.lattice import Lattice
from ..deck.keys import BULK_STATES
from ..errors import DeckError
from ..files import reading
from ..netcdf_library import LOCK, attributes, close, created, opened, opened_by_xarray
from ..variables import (
    INTERFACE,
    LARGEST,
    NOT_KEPT,
    RESIDUALS,
    SCHEMA_VERSION,
    SHEAR_LIMIT,
    TRACTIONS,
    VARIABLES,
    names_where,
)
from .layout import COORDINATES, MISSING, Layout, Metadata, history_of, lattice_of
from .step import Step

if TYPE_CHECKING:
    import netCDF4

    from .result import Result


_CLOSE = 1e-6  # spacings by which a node may be off its place; relative difference of sums
_ROUNDED = 1 + 1e-5  # for tolerances in the story of a run
_CHANGED = r"(?<!step_)tolerance = (\S+) instead of ([^\s,]+)"

_ALWAYS = names_where(lambda v: v.required == "always")
_WITH_FRICTION = names_where(lambda v: bool(v.required))
_NOISE = 1e-3  # of energies beside the normal load times the contact radius
_NO_STEP = "{} holds numbers that no load step has"


Fits = Callable[[Any], bool]  # test of a value


def _is_number(value: Any) -> bool:
    return np.ndim(value) == 0 and np.asarray(value).dtype.kind in "iuf" and not math.isnan(float(value))


def _is_positive(value: Any) -> bool:
    return _is_number(value) and 0 < value < math.inf


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _one_of(*words: str) -> Fits:
    return lambda value: isinstance(value, str) and value in words


def _numbers(count: int) -> Fits:
    return lambda value: np.shape(value) == (count,) and bool(np.isfinite(value).all())


_HALF_SPACES: dict[str, Fits] = {  # that bodies with coatings do not have
    "effective_modulus": _is_positive,
    "dundurs_beta": _is_number,
    "tangential_compliance_ratio": _is_number,
}
_PARAMETERS: dict[str, Fits] = {  # of the case: all of them or, in tests, none
    **_HALF_SPACES,
    "friction_coefficient": lambda value: np.ndim(value) == 0 and not float(value) < 0,  # NaN: another law
    "algorithm": _one_of("frictionless", "static", "incremental"),
    "coupling": _one_of("full", "goodman"),
    "tolerance": _is_positive,
}
_ATTRIBUTES: dict[str, Fits] = {
    **dict.fromkeys(("title", "deck", "source", "history", "created", "run"), _is_text),
    **dict.fromkeys(("output_fields", "hexcontact_version"), _is_text),
    "output_every": _is_positive,
    "planned_steps": lambda value: _is_number(value) and 0 <= value < math.inf,  # 0: not known yet
    "complete": _is_number,
    "lattice_spacing": _is_positive,
    "lattice_basis": _numbers(4),
    "lattice_origin": _numbers(2),
}
_LATER = {
    "lattice_cell_ratio": _is_positive,
    "lattice_direction": lambda value: _is_number(value) and abs(value) <= math.pi,
    "lattice_periodic": lambda value: value in (0, 1),
    "lattice_cell_angle": lambda value: _is_number(value) and 0 < value < math.pi,
    INTERFACE[0]: _is_positive,
    INTERFACE[2]: lambda value: _is_number(value) and 0 <= value < math.inf,  # 0: no springs
    INTERFACE[1]: lambda value: _is_number(value) and 1 <= value < math.inf,
    **dict.fromkeys((SHEAR_LIMIT, "cycle_tolerance", "wear_tolerance"), _is_positive),
    "entry": _one_of("implicit", "interpolated"),
    "bulk_state": _one_of(*BULK_STATES),
    "coating": _is_text,
    "coating_images": _is_positive,
    "coating_fit_error": lambda value: _is_number(value) and 0 <= value < 1,
    **dict.fromkeys(("friction_law", "machine", "stopped"), _is_text),
}


def fault_of_result(dataset: Dataset) -> str:
    """Return a fault of the dataset of a result file, whose fields may be unread; empty if there is none."""
    attributes = {str(name): value for name, value in dataset.attrs.items()}
    if fault := _fault_of_attributes(attributes):
        return fault
    for name, known in VARIABLES.items():
        if name not in dataset.variables:
            continue
        found = dataset.variables[name]
        text = known.dtype == "str"
        if found.dtype.kind not in "OSU" if text else found.dtype != np.dtype(known.dtype):
            return f"{name} holds values of another kind ({found.dtype})"
    if "algorithm" in attributes:
        frictional = attributes["algorithm"] != "frictionless"
        missing = set(_WITH_FRICTION if frictional else _ALWAYS) - dataset.variables.keys()
        if missing:
            return f"it has no {min(missing, key=_WITH_FRICTION.index)}"
    return _fault_of_coordinates(dataset) or _fault_of_histories(dataset) or _fault_of_fields(dataset)


def fault_of_dimensions(columns: Mapping[str, netCDF4.Variable]) -> str:
    """Return a fault of the dimensions of the variables of a file; empty if there is none."""
    for name in COORDINATES:
        if name not in columns or 0 in columns[name].shape:
            return f"it has no usable {name} coordinate"
    for name, column in columns.items():
        known, dimensions = VARIABLES.get(name), column.dimensions
        if known is None:
            fits = len(set(dimensions)) == len(dimensions)
        else:
            characters = known.dtype == "str" and len(dimensions) == len(known.dims) + 1
            fits = dimensions[: len(dimensions) - characters] == known.dims
        if not fits:
            return f"{name} is over {', '.join(dimensions) or 'nothing'}"
    return ""


def _fault_of_attributes(attributes: Mapping[str, Any]) -> str:
    needed = _ATTRIBUTES | (_PARAMETERS if _PARAMETERS.keys() & attributes.keys() else {})
    if "coating" in attributes:
        needed = {name: fits for name, fits in needed.items() if name not in _HALF_SPACES}
    for name, fits in (needed | {name: fits for name, fits in _LATER.items() if name in attributes}).items():
        if name not in attributes:
            return f"it has no attribute {name}"
        if not fits(attributes[name]):
            return f"its attribute {name} is wrong"
    return ""


def _fault_of_coordinates(dataset: Dataset) -> str:
    """Return a fault of steps, rows and columns, which count one by one."""
    if dataset["step"].values[0] != 1:
        return "its steps do not begin with 1"
    for name in ("step", "row", "col"):
        if (np.diff(dataset[name].values.astype(float)) != 1).any():
            return f"its coordinate {name} does not count one by one"
    lattice = lattice_of(dataset)
    for name, place in (("x", lattice.x), ("y", lattice.y)):
        if not (abs(dataset[name].values - place) < _CLOSE * lattice.spacing).all():
            return f"its coordinate {name} is not that of the lattice"
    return ""


def _fault_of_histories(dataset: Dataset) -> str:
    """Return a fault of the numbers by step; empty if there is none."""
    known = [name for name in history_of(dataset) if name in VARIABLES and VARIABLES[name].dtype != "str"]
    history = {name: dataset[name].values for name in known}
    for name in known:
        # without stick there is no center of it
        always = VARIABLES[name].required and not name.startswith("stick_center")
        if always and np.isnan(history[name]).any():
            return _NO_STEP.format(name)
    lattice = lattice_of(dataset)
    window = lattice.size * lattice.cell_area
    return _fault_of_numbers(history, dataset.attrs, str(dataset.attrs["history"]), window)


def _fault_of_numbers(
    history: Mapping[str, Any], parameters: Mapping[Any, Any], story: str, window: float
) -> str:
    """Return a fault of values by step; a resumed run may have several tolerances."""
    given = [parameters.get("tolerance", 1.0), parameters.get("cycle_tolerance", 0.0)]
    tolerances = [*given, *map(float, chain(*re.findall(_CHANGED, story)))]
    cut = np.greater(history.get("cuts", 0), 0) | np.isfinite(history.get("segment_fraction", math.nan))
    for name, values in history.items():
        low, high = _bounds(name, history, window)
        if name in RESIDUALS.values():
            high = max(tolerances) * _ROUNDED
            if name == RESIDUALS["R_t"]:  # parts of a step are solved from one to the next
                values = np.where(cut, np.minimum(values, high), values)
        if (np.less(values, low) | np.greater(values, high)).any():
            return _NO_STEP.format(name)
    return ""


def _bounds(name: str, history: Mapping[str, Any], window: float) -> tuple[Any, Any]:
    """Return the smallest and the largest possible value by step."""
    known = VARIABLES[name]
    if known.dtype != "f8":
        return max(NOT_KEPT, known.least), max(known.flags, default=LARGEST)
    low: Any = known.least
    high: Any = known.most
    beside, power = known.scale
    if low > -LARGEST and beside:
        scale = np.abs(history.get(beside, 0.0)) * history.get("contact_radius", 0.0) ** power
        low = np.where(np.greater(scale, 0.0), low - _NOISE * scale, -LARGEST)
    if isinstance(high, str):
        high = np.multiply({**history, "window": window}.get(high, LARGEST), 1 + _CLOSE)
    return low, high


def _fault_of_fields(dataset: Dataset) -> str:
    """Return a fault of the deck, or of the fields, which are read step by step; empty if there is none."""
    try:
        tomllib.loads(str(dataset.attrs["deck"]))
    except tomllib.TOMLDecodeError as error:
        return f"its deck is no TOML: {error}"
    lattice = lattice_of(dataset)
    numbers, every = dataset["step"].values, int(dataset.attrs["output_every"])
    for place, number in enumerate(numbers):
        step = dataset.isel(step=place)
        fields = {str(name): v.values for name, v in step.data_vars.items() if v.dims == ("row", "col")}
        history = {str(name): v.item() for name, v in step.data_vars.items() if not v.dims}
        kept = number % every == 0 or number == numbers[-1]
        fault = _fault_of_values(fields, history, lattice.cell_area, kept)
        if fault := fault or (_fault_of_loads(fields, history, lattice) if kept else ""):
            return f"{fault} in step {number}"
    return ""


def _fault_of_loads(fields: Mapping[str, NDArray[Any]], history: Mapping[str, Any], lattice: Lattice) -> str:
    """Return a load that is not the resultant of the tractions at the nodes; empty if there is none."""
    p, q_x, q_y = (fields.get(name) for name in TRACTIONS)
    parts = {} if p is None else {"normal_load": p}
    if q_x is not None and q_y is not None:
        parts |= {"tangential_load_x": q_x, "tangential_load_y": q_y}
        parts["torque"] = np.array([lattice.x * q_y, -lattice.y * q_x])
    for name, values in parts.items():
        size = abs(values).sum() * lattice.cell_area
        if name in history and abs(values.sum() * lattice.cell_area - history[name]) > _CLOSE * size:
            return f"{name} is not the resultant of the tractions"
    return ""


def _fault_of_values(
    fields: Mapping[str, NDArray[Any]], history: Mapping[str, Any], cell_area: float, kept: bool = True
) -> str:
    """Return a fault of nodal values, which have bounds and fit the history."""
    zone, pressure = fields.get("zone"), fields.get("pressure")
    contact = zone > 0 if zone is not None else pressure > 0 if pressure is not None else None
    for name, values in fields.items():
        known = VARIABLES[name]
        if not kept and known.is_field:
            wrong = ~np.isnan(values) if known.dtype == "f8" else values != NOT_KEPT
        elif name == "zone":
            wrong = (values < 0) | (values > max(known.flags))
        else:
            wrong = ~(abs(values) < LARGEST)
            if known.padding != 0:  # which may have no value out of contact
                wrong &= contact is not None and contact
            wrong |= values < known.least
        if wrong.any():
            return f"{name} holds numbers that no node has"
    if pressure is not None and kept and "max_pressure" in history:
        peak = pressure.max()
        if not math.isclose(peak, history["max_pressure"], rel_tol=_CLOSE):
            return "pressure does not fit to max_pressure"
    if zone is not None and kept and "contact_area" in history:
        cells = history["contact_area"] / cell_area
        if abs(np.count_nonzero(zone > 0) - cells) > _CLOSE * (1 + cells):
            return "zone does not fit to contact_area"
    return ""


NODE, FACE, CORNER = "mesh_node", "mesh_face", "mesh_corner"  # dimensions
TOPOLOGY, FACE_NODES = "mesh", "mesh_face_nodes"
MESH = (TOPOLOGY, "mesh_node_x", "mesh_node_y", FACE_NODES)
_TRIANGLES = 1 << 16  # triangles


def triangles(n_row: int, n_col: int) -> NDArray[np.int32]:
    """Return the nodes at the corners of each triangle of a window, counterclockwise, shape (n, 3).

    The diagonal from the second to the fourth corner halves each cell into triangles, on which tractions are
    linear. Node (row j, col i) has the number ``j*n_col + i``.
    """
    first = np.arange(n_row * n_col, dtype=np.int32).reshape(n_row, n_col)[:-1, :-1].ravel()
    right, up, across = first + 1, first + n_col, first + n_col + 1
    return np.stack([first, right, up, right, across, up], axis=1, dtype=np.int32).reshape(-1, 3)


def write_mesh(file: netCDF4.Dataset, lattice: Lattice) -> None:
    """Write the mesh of a window to an open file, unless it has one row or column only."""
    if min(lattice.shape) < 2:
        return
    count = 2 * (lattice.n_row - 1) * (lattice.n_col - 1)
    for name, size in ((NODE, lattice.size), (FACE, count), (CORNER, 3)):
        file.createDimension(name, size)
    about: dict[str, Any] = {
        "cf_role": "mesh_topology",
        "long_name": "triangles of the lattice; node = (row - row[0])*n_col + (col - col[0])",
        "topology_dimension": np.int32(2),
        "node_coordinates": "mesh_node_x mesh_node_y",
        "face_node_connectivity": FACE_NODES,
        "face_dimension": FACE,
    }
    add_column(file, TOPOLOGY, "i4", (), about, np.int32(0))
    packed: dict[str, Any] = {"compression": "zlib", "complevel": 1, "shuffle": True, "fletcher32": True}
    columns = []
    for axis in "xy":
        standard = {"standard_name": f"projection_{axis}_coordinate"}
        about = {**standard, "long_name": f"{axis} coordinate of the node", "units": "m"}
        chunks = [min(_TRIANGLES, lattice.size)]
        columns.append(
            add_column(file, f"mesh_node_{axis}", "f8", (NODE,), about, chunksizes=chunks, **packed)
        )
    about = {
        "cf_role": "face_node_connectivity",
        "long_name": "nodes at the corners of each triangle, counterclockwise",
        "start_index": np.int32(0),
    }
    chunks = [min(_TRIANGLES, count), 3]
    columns.append(add_column(file, FACE_NODES, "i4", (FACE, CORNER), about, chunksizes=chunks, **packed))
    for column in columns:  # the chunk that a band ends in, and the next
        column.set_var_chunk_cache(size=2 * _TRIANGLES * 12)
    x, y, corners = columns
    for first, band in _bands(lattice, max(1, _TRIANGLES // lattice.n_col)):
        node, face = first * lattice.n_col, 2 * first * (lattice.n_col - 1)
        x[node : node + band.size], y[node : node + band.size] = band.x.ravel(), band.y.ravel()
        faces = triangles(min(band.n_row + 1, lattice.n_row - first), lattice.n_col)
        if len(faces):
            corners[face : face + len(faces)] = node + faces


def _bands(lattice: Lattice, rows: int) -> Iterator[tuple[int, Lattice]]:
    """Yield the first row and the lattice of bands of so many rows, whose arrays are small."""
    for first in range(0, lattice.n_row, rows):
        n_row = min(rows, lattice.n_row - first)
        yield first, dataclasses.replace(lattice, row_first=lattice.row_first + first, n_row=n_row)


def add_column(
    file: netCDF4.Dataset,
    name: str,
    dtype: str,
    dims: tuple[str, ...],
    attributes: Mapping[str, Any],
    values: Any = None,
    **options: Any,
) -> netCDF4.Variable:
    """Add a variable with its attributes and values to a file; `options` go to ``createVariable``."""
    column = file.createVariable(name, dtype, dims, **options)
    column.setncatts(attributes)
    column.set_auto_maskandscale(False)  # which looks for more attributes
    if values is not None:
        column[...] = values
    return column


# Words of a deck with tables [[stress]] or [[fatigue]], whose keys may be written with escapes.
_BELOW = ("stress", "fatigue", "\\")
_CHUNK = 512  # nodes of a chunk along row and col
_MARK = b"hexcontact sha-2"
_SIZE = len(_MARK) + 32
_BLOCK = 1 << 22  # bytes
_HDF5 = b"\x89HDF\r\n\x1a\n\x02\x08\x08"  # version of the head, then sizes of addresses and lengths
_END = slice(28, 36)  # in the head: the address where the file ends


# --- writing --------------------------------------------------------------------------------------


def write(path: Path, layout: Layout, steps: Iterable[Step], complete: bool) -> None:
    """Write the file of a result from its steps, which are read once; OSError if that fails."""
    with _new_file(path) as file:
        with LOCK:
            for name, size in layout.sizes.items():
                file.createDimension(name, size)
            empty = dict.fromkeys("xy", np.empty(0))  # written in bands
            given = [
                _text(file, name, values, layout)
                if VARIABLES[name].dtype == "str"
                else (_column(file, name, layout), values)
                for name, values in (layout.axes() | empty | layout.histories() | layout.trials).items()
            ]
            columns = {name: _column(file, name, layout) for name in layout.fields}
            file.setncatts(layout.attributes(complete))
            # chunks are written once; the default is 64 MB a variable
            for column in file.variables.values():
                if column.dimensions[-2:] == ("row", "col"):
                    column.set_var_chunk_cache(size=0)
            for column, values in given:
                if column.name not in empty:
                    column[...] = values
            for first, band in _bands(layout.window, _CHUNK):
                for name in "xy":
                    file[name][first : first + band.n_row] = getattr(band, name)
            write_mesh(file, layout.window)
        layout.fill(columns, steps, LOCK)


@contextlib.contextmanager
def _new_file(path: Path) -> Iterator[netCDF4.Dataset]:
    """Create a file; at the end close it and add its checksum."""
    memory.give_back()
    memory.claim(memory.WRITING)  # netCDF crashes without
    try:
        file = created(path, format="NETCDF4_CLASSIC")
        try:
            yield file
        finally:
            close(file)
    except RuntimeError as error:  # HDF5 hides the reason, mostly a full disk
        raise OSError(None, str(error), str(path)) from error
    seal(path)


def _column(file: netCDF4.Dataset, name: str, layout: Layout) -> netCDF4.Variable:
    """Create the variable `name` with its attributes."""
    variable = VARIABLES[name]
    options: dict[str, Any] = {}
    if variable.dims[-2:] == ("row", "col"):
        block = {"step": layout.block, "row": _CHUNK, "col": _CHUNK}
        sizes = [min(block[dim], layout.sizes[dim]) for dim in variable.dims]
        options = {"compression": "zlib", "complevel": 1, "chunksizes": sizes}
        options["fletcher32"] = True  # damage is an error
        if variable.dtype == "f8":
            options["fill_value"] = MISSING[name]
    attributes = layout.attributes_of(name)
    if options and name not in ("x", "y"):
        attributes["coordinates"] = "x y"
    return add_column(file, name, variable.dtype, variable.dims, attributes, **options)


def _text(
    file: netCDF4.Dataset, name: str, texts: NDArray[Any], layout: Layout
) -> tuple[netCDF4.Variable, NDArray[Any]]:
    """Create the text variable `name`, and return it with its characters.

    Characters, not netCDF strings, on which HDF5 crashes if a file is open more than once.
    """
    variable = VARIABLES[name]
    characters = np.array([text.encode() for text in texts]).view("S1").reshape(len(texts), -1)
    file.createDimension(f"{name}_length", characters.shape[1])
    attributes = {**layout.attributes_of(name), "_Encoding": "utf-8"}
    column = add_column(file, name, "S1", (*variable.dims, f"{name}_length"), attributes)
    column.set_auto_chartostring(False)
    return column, characters


# --- reading --------------------------------------------------------------------------------------


def _check_ours(attributes: dict[str, Any], path: Path) -> None:
    if content := attributes.get("content"):
        raise DeckError(f"{path} holds {content}, not load steps; expected the result of the run beside it")
    version = attributes.get("schema_version")
    if version is None or "hexcontact_version" not in attributes:
        raise DeckError(f"{path} was not written by hexcontact: its attributes name no schema_version")
    if int(version) != SCHEMA_VERSION:
        raise DeckError(
            f"{path} has the file layout {int(version)} of hexcontact {attributes['hexcontact_version']}; "
            f"this version reads layout {SCHEMA_VERSION}"
        )


def is_ours(path: Path) -> bool:
    """Test whether a file is a result of any version, which may be damaged."""
    return is_sealed(path) or {"schema_version", "hexcontact_version"} <= attributes(path).keys()


def require_free(stresses: Iterable[Path], overwrite: bool) -> None:
    """Refuse to overwrite files of stresses, and with `overwrite` any other file."""
    for path in stresses:
        if not overwrite and os.path.lexists(path):
            raise DeckError(f"{path} exists already; --overwrite (overwrite=True in Python) replaces it")
        ours = {"stress_of", "hexcontact_version"}
        if os.path.lexists(path) and not (path.is_file() and ours <= attributes(path).keys()):
            raise DeckError(
                f"{path} does not hold stresses that hexcontact has written, so it is not overwritten; "
                "delete it, or choose another output or name of [[stress]] or [[fatigue]]"
            )


def is_mesh(path: Path) -> bool:
    """Test whether a file has the fields of a result on a mesh, as `hexcontact.result.export` writes it."""
    return {"content", "hexcontact_version"} <= attributes(path).keys()


def stress_files(deck: str, output: Path) -> dict[str, Path]:
    """Return the files beside an output that hold the tables [[stress]] and [[fatigue]], by their names."""
    if not any(name in deck for name in _BELOW):
        return {}
    from ..interior.files import files_of

    return files_of(deck, output)


def missing_stresses(output: Path) -> dict[str, Path]:
    """Return those of the `stress_files` of a finished run that are not there, or are of another run."""
    about = attributes(output)
    files = stress_files(about.get("deck", ""), output)
    return {name: path for name, path in files.items() if attributes(path).get("stress_of") != about["run"]}


def read_output(path: Path) -> Result:
    """Open an output file; its fields are read at their first use.

    All bytes are checked first. In a file without a seal, of an earlier version or rewritten by another
    program, the fields are read and checked instead. Raises DeckError for a damaged or foreign file,
    FileNotFoundError for a missing one.
    """
    with reading(path):
        from .result import Result

        if not (sealed := check_seal(path)):
            with opened(path) as file:
                _check_ours({name: file.getncattr(name) for name in file.ncattrs()}, path)
                if fault := fault_of_dimensions(file.variables):
                    raise DeckError(f"{path} is damaged: {fault}")
        # the mesh, for other programs, repeats rows and columns
        dataset = opened_by_xarray(path, drop_variables=MESH)
        _check_ours(dataset.attrs, path)
        result = Result(dataset, str(path))
        for variable in result.dataset.variables.values():
            if variable.ndim < 3:
                variable.load()
        if not sealed and (fault := fault_of_result(result.dataset)):
            result.close()
            raise DeckError(f"{path} is damaged: {fault}")
        _ = result.lattice, result.complete, Metadata.from_attributes(result.dataset.attrs)
        return result


# --- the seal -----------------------------------------------------------------------------------------------


def _digest(descriptor: int, size: int) -> bytes:
    """Return the digest of the first `size` bytes of a file."""

    def of_block(start: int) -> bytes:
        return hashlib.sha256(os.pread(descriptor, min(_BLOCK, size - start), start)).digest()

    starts = range(0, size, _BLOCK)
    if len(starts) <= 1:
        return hashlib.sha256(b"".join(map(of_block, starts))).digest()
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(min(8, os.cpu_count() or 1)) as pool:  # hashing releases the interpreter
        return hashlib.sha256(b"".join(pool.map(of_block, starts))).digest()


def seal(path: Path) -> None:
    """Add the seal to a file."""
    with path.open("r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.write(_MARK + _digest(file.fileno(), size))


def is_sealed(path: Path) -> bool:
    """Test whether a file ends with a seal, which may be broken."""
    with path.open("rb") as file:
        file.seek(-min(_SIZE, path.stat().st_size), os.SEEK_END)
        return file.read(len(_MARK)) == _MARK


def check_seal(path: Path) -> bool:
    """Test whether a file has a valid seal; False without a seal, DeckError for a broken one."""
    with path.open("rb") as file:
        head, size = file.read(_END.stop), file.seek(0, os.SEEK_END)
        file.seek(max(0, size - _SIZE))
        end = file.read(_SIZE)
        if end.startswith(_MARK):
            if _digest(file.fileno(), size - _SIZE) == end[len(_MARK) :]:
                return True
            raise DeckError(f"{path} is damaged: its bytes are not those that were written (SHA-256)")
    if head.startswith(_HDF5) and size > int.from_bytes(head[_END], "little"):
        raise DeckError(f"{path} is damaged: the checksum at its end cannot be read")
    return False
