"""One result file: writing it step by step, reading it back, refusing what is damaged or foreign."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core import memory
from ..errors import LACKING, DeckError, HexcontactError, ResourceError
from ..files import require_ordinary, require_utf8
from ..variables import SCHEMA_VERSION, VARIABLES
from . import mesh
from .check import fault_of_dimensions, fault_of_fields, fault_of_result
from .result import Layout, Metadata, Result, Step
from .seal import check_seal, is_sealed, seal

if TYPE_CHECKING:
    import netCDF4

_CHUNK = 512  # nodes of a chunk along row and col
_netcdf = threading.Lock()  # the netCDF library must not be entered by two threads


@contextlib.contextmanager
def _alone() -> Iterator[None]:
    """Keep other threads out of the netCDF library, those that read through xarray too."""
    backend = sys.modules.get("xarray.backends.netCDF4_")
    with _netcdf, getattr(backend, "NETCDF4_PYTHON_LOCK", contextlib.nullcontext()):
        yield


# --- writing --------------------------------------------------------------------------------------


def write(path: Path, layout: Layout, steps: Iterable[Step], complete: bool) -> None:
    """Write the file of a result and flush it to disk.

    Parameters
    ----------
    path : Path
        File to write; replaced if it is there.
    layout : Layout
        Layout of all the steps.
    steps : iterable of Step
        The steps with their fields; gone through once, none is kept.
    complete : bool
        Whether these are all steps of the run.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with _new_file(path) as file:
        with _alone():
            file.setncatts(layout.attributes(complete))
            for name, size in layout.sizes.items():
                file.createDimension(name, size)
            for name, values in (layout.coordinates() | layout.histories() | layout.trials).items():
                if VARIABLES[name].dtype == "str":
                    _write_text(file, name, values)
                else:
                    _column(file, name, layout)[...] = values
            columns = {name: _column(file, name, layout) for name in layout.fields}
            mesh.write_mesh(file, layout.window)
        gap_column = columns.pop("initial_gap", None)
        gap: Any = None
        for position, step in enumerate(steps):
            with _alone():
                for name, column in columns.items():
                    column[position] = layout.field(name, position, step)
            if gap_column is not None:
                gap = layout.initial_gap(gap, step)
        if gap_column is not None:
            with _alone():
                gap_column[...] = gap


@contextlib.contextmanager
def _new_file(path: Path) -> Iterator[netCDF4.Dataset]:
    """Create a file; in the end close it, add its checksum and flush it to disk."""
    import netCDF4

    memory.give_back()
    memory.claim(memory.WRITING)  # it crashes without
    try:
        with _alone():
            file = netCDF4.Dataset(path, "w", format="NETCDF4_CLASSIC")
        try:
            yield file
        finally:
            with _alone():
                file.close()
    except RuntimeError as error:  # the HDF5 library hides the reason, a full disk mostly
        raise OSError(None, str(error), str(path)) from error
    seal(path)
    flush(path)


def _column(file: netCDF4.Dataset, name: str, layout: Layout) -> netCDF4.Variable:
    """Create the variable `name` with its attributes."""
    variable = VARIABLES[name]
    options: dict[str, Any] = {}
    if variable.dims[-2:] == ("row", "col"):
        sizes = [1 if dim == "step" else len(file.dimensions[dim]) for dim in variable.dims]
        options = {"compression": "zlib", "complevel": 1, "chunksizes": [min(_CHUNK, n) for n in sizes]}
        options["fletcher32"] = True  # damage shows as an error, not as wrong numbers
        if variable.dtype == "f8":
            options["fill_value"] = variable.missing
    column = file.createVariable(name, variable.dtype, variable.dims, **options)
    if options:
        column.set_var_chunk_cache(size=0)  # chunks are written once; HDF5 kept 64 MB of each variable
    column.setncatts(layout.attributes_of(name))
    if variable.dims[-2:] == ("row", "col") and name not in ("x", "y"):
        column.coordinates = "x y"
    return column


def _write_text(file: netCDF4.Dataset, name: str, texts: NDArray[Any]) -> None:
    """Write the text variable `name`.

    Characters, not netCDF strings: HDF5 crashes on those when a file is opened more than once.
    """
    variable = VARIABLES[name]
    characters = np.array([text.encode() for text in texts]).view("S1").reshape(len(texts), -1)
    file.createDimension(f"{name}_length", characters.shape[1])
    column = file.createVariable(name, "S1", (*variable.dims, f"{name}_length"))
    column.setncatts({**variable.attributes, "_Encoding": "utf-8"})
    column.set_auto_chartostring(False)
    column[...] = characters


def flush(path: Path) -> None:
    """See to it that a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if not (path.is_dir() and error.errno in (errno.EINVAL, errno.ENOTSUP)):  # not every system can
            raise
    finally:
        os.close(descriptor)


# --- reading --------------------------------------------------------------------------------------


@contextlib.contextmanager
def reading(path: Path, kind: str = "a netCDF file") -> Iterator[None]:
    """Turn what goes wrong on reading a damaged or foreign file into one sentence."""
    require_utf8(path, kind)
    try:
        yield
    except (HexcontactError, FileNotFoundError, MemoryError):
        raise
    except PermissionError as error:
        raise DeckError(f"{path} cannot be read: {error.strerror}") from error
    except Exception as error:  # damage takes any form: every library below has its own exceptions
        if isinstance(error, OSError) and error.errno in LACKING:
            raise ResourceError(f"{path} cannot be read: {error.strerror}") from error
        raise DeckError(
            f"{path} is damaged or not {kind} ({str(error).strip() or type(error).__name__})"
        ) from error


def _check_ours(attributes: dict[str, Any], path: Path) -> None:
    version = attributes.get("schema_version")
    if version is None or "hexcontact_version" not in attributes:
        raise DeckError(f"{path} was not written by hexcontact: its attributes name no schema_version")
    if int(version) != SCHEMA_VERSION:
        raise DeckError(
            f"{path} has the file layout {int(version)} of hexcontact {attributes['hexcontact_version']}; "
            f"this version reads layout {SCHEMA_VERSION}"
        )


def is_ours(path: Path) -> bool:
    """Tell whether a file is a result, of whatever version, or was one before it was damaged."""
    import netCDF4

    if is_sealed(path):
        return True
    with contextlib.suppress(OSError, RuntimeError), _alone(), netCDF4.Dataset(path) as file:
        return {"schema_version", "hexcontact_version"} <= set(file.ncattrs())
    return False


def _attributes(file: netCDF4.Dataset) -> dict[str, Any]:
    return {name: file.getncattr(name) for name in file.ncattrs()}


def read_output(path: Path) -> Result:
    """Open an output file; its fields are read when they are asked for.

    All bytes are checked first. In a file without a checksum, of an earlier version or rewritten by another
    program, the fields are read once to see that they can be values of a solution.

    Raises
    ------
    DeckError
        If the file is damaged, of another kind or of another version.
    FileNotFoundError
        If it is not there.
    """
    import netCDF4

    require_ordinary(path, "a netCDF file")
    with reading(path):
        sealed = check_seal(path)
    with reading(path), _alone(), netCDF4.Dataset(path) as file:
        attributes = _attributes(file)
        _check_ours(attributes, path)
        for name in ("step", "row", "col", "x", "y"):
            if 0 in file[name].shape:
                raise DeckError(f"{path} is damaged: it has no usable {name} coordinate")
        for name, column in file.variables.items():
            if fault := fault_of_dimensions(name, column.dimensions):
                raise DeckError(f"{path} is damaged: {fault}")
    with reading(path):
        import xarray

        # rows and columns say the same as the mesh, which is for other programs
        dataset = xarray.open_dataset(path, engine="netcdf4", drop_variables=mesh.VARIABLES)
        result = Result(dataset, str(path))
        for variable in result.dataset.variables.values():
            if variable.ndim < 3:
                variable.load()
        if fault := fault_of_result(result.dataset) or ("" if sealed else fault_of_fields(result.dataset)):
            result.close()
            raise DeckError(f"{path} is damaged: {fault}")
        _ = result.lattice, result.complete, Metadata.from_attributes(result.dataset.attrs)
        return result
