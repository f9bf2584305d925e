"""The result file, in netCDF.

HDF5 files may have further bytes at their end. Those of a result are its seal of 48 bytes: a mark, and a
SHA-256 of the SHA-256 of each block before it. So damage shows before HDF5 reads it, also in indices of
chunks. A program that rewrites the file with HDF5 removes the seal.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import BAND, Dataset
from ..core import memory
from ..core.lattice import Lattice
from ..deck.keys import BULK_STATES
from ..deck.kinds import SMALLEST
from ..errors import DeckError
from ..files import reading
from ..netcdf_library import LOCK, attributes, opened, opened_by_xarray, shared
from ..variables import (
    INTERFACE,
    LARGEST,
    NOT_KEPT,
    RESIDUALS,
    SCHEMA_VERSION,
    SHEAR_LIMIT,
    VARIABLES,
    names_where,
)
from .layout import COORDINATES, MISSING, Layout, history_of, lattice_of
from .step import Step, nodal

if TYPE_CHECKING:
    import netCDF4

    from .result import Result


_CLOSE = 1e-6  # spacings by which a node may be off its place; relative difference of sums
_ROUNDED = 1 + 1e-5  # for tolerances in the story of a run
_CHANGED = r"(?<!step_)tolerance = (\S+) instead of ([^\s,]+)"

_ALWAYS = names_where(lambda v: v.required == "always")
_WITH_FRICTION = names_where(lambda v: bool(v.required))
_NOISE = 1e-3  # of energies beside the normal load times the contact radius


_POSITIVE, _NOT_NEGATIVE, _BELOW_PI = (SMALLEST, LARGEST), (0.0, LARGEST), math.nextafter(math.pi, 0.0)
# Rules of attributes: text, one or more of a few words, a count of finite numbers, or a number in a range.
_HALF_SPACES: dict[str, Any] = {  # that bodies with coatings do not have
    **{"effective_modulus": _POSITIVE, "dundurs_beta": (-LARGEST, LARGEST)},
    "tangential_compliance_ratio": (-LARGEST, LARGEST),
}
_PARAMETERS = {  # of the case: all of them or, in tests, none
    **_HALF_SPACES,
    "friction_coefficient": (0.0, math.inf),
    "algorithm": ("frictionless", "static", "incremental"),
    "coupling": ("full", "goodman"),
    "tolerance": _POSITIVE,
}
_ATTRIBUTES: dict[str, Any] = {
    **dict.fromkeys(("title", "deck", "source", "history", "created", "run"), str),
    **dict.fromkeys(("output_fields", "hexcontact_version"), str),
    **{"output_every": _POSITIVE, "planned_steps": _NOT_NEGATIVE, "complete": (-LARGEST, LARGEST)},
    **{"lattice_spacing": _POSITIVE, "lattice_basis": 4, "lattice_origin": 2},
}
_LATER: dict[str, Any] = {  # that some files have
    "lattice_cell_ratio": _POSITIVE,
    "lattice_direction": (-math.pi, math.pi),
    "lattice_periodic": (0, 1),
    "lattice_cell_angle": (SMALLEST, _BELOW_PI),
    **dict(zip(INTERFACE, (_POSITIVE, (1.0, LARGEST), _NOT_NEGATIVE), strict=True)),
    **dict.fromkeys((SHEAR_LIMIT, "cycle_tolerance", "wear_tolerance", "coating_images"), _POSITIVE),
    **{"entry": ("implicit", "interpolated"), "bulk_state": BULK_STATES},
    "coating_fit_error": (0.0, math.nextafter(1.0, 0.0)),
    **dict.fromkeys(("coating", "friction_law", "machine", "measured_surfaces", "stopped"), str),
}


def _fits(name: str, value: Any, rule: Any) -> bool:
    """Test whether an attribute meets a rule of the tables."""
    if rule is str:
        return isinstance(value, str)
    if isinstance(rule, int):
        return np.shape(value) == (rule,) and bool(np.isfinite(value).all())
    if isinstance(rule[0], str):
        return isinstance(value, str) and value in rule
    if np.ndim(value) or np.asarray(value).dtype.kind not in "iuf":
        return False
    another_law = name == "friction_coefficient" and math.isnan(value)
    return another_law or bool(rule[0] <= value <= rule[1])


def fault_of_result(dataset: Dataset) -> str:
    """Return a fault of the dataset of a result file, whose fields may be unread; empty if there is none."""
    return next(_faults(dataset), "")


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


def _faults(dataset: Dataset) -> Iterator[str]:
    """Yield faults of attributes, kinds, coordinates, numbers by step, the deck, and fields by step."""
    attributes = {str(name): value for name, value in dataset.attrs.items()}
    needed = _ATTRIBUTES | (_PARAMETERS if _PARAMETERS.keys() & attributes.keys() else {})
    if "coating" in attributes:
        needed = {name: rule for name, rule in needed.items() if name not in _HALF_SPACES}
    for name, rule in (needed | {name: rule for name, rule in _LATER.items() if name in attributes}).items():
        if name not in attributes:
            yield f"it has no attribute {name}"
        elif not _fits(name, attributes[name], rule):
            yield f"its attribute {name} is wrong"
    for name in (name for name in VARIABLES if name in dataset.variables):
        found, wanted = dataset.variables[name].dtype, VARIABLES[name].dtype
        if found.kind not in "OSU" if wanted == "str" else found != np.dtype(wanted):
            yield f"{name} holds values of another kind ({found})"
    if "algorithm" in attributes:
        required = _ALWAYS if attributes["algorithm"] == "frictionless" else _WITH_FRICTION
        yield from (f"it has no {name}" for name in required if name not in dataset.variables)
    numbers = dataset["step"].values
    if numbers[0] != 1:
        yield "its steps do not begin with 1"
    for name in ("step", "row", "col"):
        if (np.diff(dataset[name].values.astype(float)) != 1).any():
            yield f"its coordinate {name} does not count one by one"
    lattice = lattice_of(dataset)
    for name, place in (("x", lattice.x), ("y", lattice.y)):
        if not (abs(dataset[name].values - place) < _CLOSE * lattice.spacing).all():
            yield f"its coordinate {name} is not that of the lattice"
    known = [name for name in history_of(dataset) if name in VARIABLES and VARIABLES[name].dtype != "str"]
    yield from _faults_of_numbers({name: dataset[name].values for name in known}, attributes, lattice)
    try:
        tomllib.loads(attributes["deck"])
    except tomllib.TOMLDecodeError as error:
        yield f"its deck is no TOML: {error}"
    for index, number in enumerate(numbers):
        kept = number % int(attributes["output_every"]) == 0 or number == numbers[-1]
        for fault in _faults_of_fields(nodal(dataset.isel(step=index), lattice), kept):
            yield f"{fault} in step {number}"


def _faults_of_numbers(
    history: Mapping[str, Any], attributes: Mapping[str, Any], lattice: Lattice
) -> Iterator[str]:
    """Yield quantities with values by step beyond their bounds; a resumed run may have several tolerances."""
    given = [attributes.get("tolerance", 1.0), attributes.get("cycle_tolerance", 0.0)]
    tolerances = [*given, *map(float, chain(*re.findall(_CHANGED, str(attributes.get("history", "")))))]
    cut = np.greater(history.get("cuts", 0), 0) | np.isfinite(history.get("segment_fraction", math.nan))
    largest = {**history, "window": lattice.size * lattice.cell_area}
    for name, values in history.items():
        known = VARIABLES[name]
        low: Any = known.least
        high: Any = largest.get(known.most, LARGEST) if isinstance(known.most, str) else known.most
        beside, power = known.scale
        if known.dtype != "f8":
            low, high = max(NOT_KEPT, low), max(known.flags, default=LARGEST)
        elif low > -LARGEST and beside:
            scale = np.abs(history.get(beside, 0.0)) * history.get("contact_radius", 0.0) ** power
            low = np.where(np.greater(scale, 0.0), low - _NOISE * scale, -LARGEST)
        if name in RESIDUALS.values():
            high = max(tolerances) * _ROUNDED
            if name == RESIDUALS["R_t"]:  # parts of a step are solved from one to the next
                values = np.where(cut, np.minimum(values, high), values)
        wrong = np.less(values, low) | np.greater(values, np.multiply(high, 1 + _CLOSE))
        # without stick there is no center of it
        always = known.required and not name.startswith("stick_center")
        if np.any(wrong | np.isnan(values) if always else wrong):
            yield f"{name} holds numbers that no load step has"


def _faults_of_fields(step: Step, kept: bool) -> Iterator[str]:
    """Yield faults of the nodal values of a step, which have bounds and fit the history."""
    lattice, fields = step.lattice, {name: np.asarray(values) for name, values in step.fields.items()}
    zone, p = fields.get("zone"), fields.get("pressure")
    contact = zone > 0 if zone is not None else p > 0 if p is not None else None
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
            yield f"{name} holds numbers that no node has"
    if not kept:
        return
    q_x, q_y = fields.get("traction_x"), fields.get("traction_y")
    # quantity of the history, its value by the fields, the scale of rounding errors, and its fault
    own: list[tuple[str, float, float, str]] = []
    if p is not None:
        own.append(("max_pressure", p.max(), p.max(), "pressure does not fit to max_pressure"))
    if zone is not None:
        cells = lattice.cell_area * np.count_nonzero(zone > 0)
        own.append(("contact_area", cells, cells + lattice.cell_area, "zone does not fit to contact_area"))
    loads = {} if p is None else {"normal_load": p}
    if q_x is not None and q_y is not None:
        torque = np.array([lattice.x * q_y, -lattice.y * q_x])
        loads |= {"tangential_load_x": q_x, "tangential_load_y": q_y, "torque": torque}
    for name, values in loads.items():
        load, size = (lattice.cell_area * float(each.sum()) for each in (values, abs(values)))
        own.append((name, load, size, f"{name} is not the resultant of the tractions"))
    for name, value, size, fault in own:
        # the largest pressure is infinite at a sharp end
        if name in step.history and math.inf > abs(value - step.history[name]) > _CLOSE * size:
            yield fault


NODE, FACE, CORNER = "mesh_node", "mesh_face", "mesh_corner"  # dimensions
TOPOLOGY, FACE_NODES = "mesh", "mesh_face_nodes"
MESH: dict[str, dict[str, Any]] = {  # attributes of its variables
    TOPOLOGY: {
        "cf_role": "mesh_topology",
        "long_name": "triangles of the lattice; node = (row - row[0])*n_col + (col - col[0])",
        "topology_dimension": np.int32(2),
        "node_coordinates": "mesh_node_x mesh_node_y",
        "face_node_connectivity": FACE_NODES,
        "face_dimension": FACE,
    },
    **{
        f"mesh_node_{axis}": {
            "standard_name": f"projection_{axis}_coordinate",
            "long_name": f"{axis} coordinate of the node",
            "units": "m",
        }
        for axis in "xy"
    },
    FACE_NODES: {
        "cf_role": "face_node_connectivity",
        "long_name": "nodes at the corners of each triangle, counterclockwise",
        "start_index": np.int32(0),
    },
}
_PACKED: dict[str, Any] = {"compression": "zlib", "complevel": 1, "fletcher32": True}  # damage is an error
_TRIANGLES = 1 << 14  # triangles, or nodes, in a chunk


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
    add_column(file, TOPOLOGY, "i4", (), MESH[TOPOLOGY], np.int32(0))
    for name in [*MESH][1:]:
        of_faces = name == FACE_NODES
        dtype, dims = ("i4", (FACE, CORNER)) if of_faces else ("f8", (NODE,))
        chunks = [min(_TRIANGLES, count), 3] if of_faces else [min(_TRIANGLES, lattice.size)]
        column = add_column(file, name, dtype, dims, MESH[name], chunksizes=chunks, **_PACKED)
        column.set_var_chunk_cache(size=2 * _TRIANGLES * 12)  # the chunk that a band ends in, and the next
    x, y, corners = file["mesh_node_x"], file["mesh_node_y"], file[FACE_NODES]
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
_CHUNK = BAND  # nodes of a chunk along row and col
_MARK = b"hexcontact sha-2"
_SIZE = len(_MARK) + 32
_BLOCK = 1 << 22  # bytes
_HDF5 = b"\x89HDF\r\n\x1a\n\x02\x08\x08"  # version of the head, then sizes of addresses and lengths
_END = slice(28, 36)  # in the head: the address where the file ends


# --- writing --------------------------------------------------------------------------------------


def write(path: Path, layout: Layout, steps: Iterable[Step], complete: bool) -> None:
    """Write the file of a result from its steps, which are read once, and seal it; OSError if that fails."""
    memory.give_back()
    memory.claim(memory.WRITING)  # netCDF crashes without
    try:
        with shared(path, "w", format="NETCDF4_CLASSIC") as file:
            with LOCK:
                _begin(file, layout, complete)
            layout.fill({name: file[name] for name in layout.fields}, steps, LOCK)
    except RuntimeError as error:  # HDF5 hides the reason, mostly a full disk
        raise OSError(None, str(error), str(path)) from error
    seal(path)


def _begin(file: netCDF4.Dataset, layout: Layout, complete: bool) -> None:
    """Write all of a result but the fields of its steps."""
    for name, size in layout.sizes.items():
        file.createDimension(name, size)
    given = layout.columns()
    for name in (name for name in given if VARIABLES[name].dtype == "str"):
        # characters, not netCDF strings, on which HDF5 crashes if a file is open more than once
        texts = np.array([text.encode() for text in given[name]])
        given[name] = texts.view("S1").reshape(len(texts), -1)
        file.createDimension(f"{name}_length", given[name].shape[1])
    for name in (*COORDINATES, *layout.variables):
        _column(file, name, layout)
    file.setncatts(layout.attributes(complete))
    # chunks are written once; the default is 64 MB a variable
    for column in file.variables.values():
        if column.dimensions[-2:] == ("row", "col"):
            column.set_var_chunk_cache(size=0)
    for name, values in given.items():
        file[name][...] = values
    for first, band in _bands(layout.window, _CHUNK):
        for name in "xy":
            file[name][first : first + band.n_row] = getattr(band, name)
    write_mesh(file, layout.window)


def _column(file: netCDF4.Dataset, name: str, layout: Layout) -> netCDF4.Variable:
    """Create the variable `name` with its attributes."""
    variable = VARIABLES[name]
    attributes, options = layout.attributes_of(name), dict[str, Any]()
    if variable.dtype == "str":
        attributes["_Encoding"] = "utf-8"
        column = add_column(file, name, "S1", (*variable.dims, f"{name}_length"), attributes)
        column.set_auto_chartostring(False)
        return column
    if variable.dims[-2:] == ("row", "col"):
        block = {"step": layout.block, "row": _CHUNK, "col": _CHUNK}
        sizes = [min(block[dim], layout.sizes[dim]) for dim in variable.dims]
        options = {**_PACKED, "chunksizes": sizes}
        if variable.dtype == "f8":
            options["fill_value"] = MISSING[name]
    if options and name not in ("x", "y"):
        attributes["coordinates"] = "x y"
    return add_column(file, name, variable.dtype, variable.dims, attributes, **options)


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
    with path.open("rb") as file:
        file.seek(-min(_SIZE, path.stat().st_size), os.SEEK_END)
        sealed = file.read(len(_MARK)) == _MARK
    return sealed or {"schema_version", "hexcontact_version"} <= attributes(path).keys()


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
