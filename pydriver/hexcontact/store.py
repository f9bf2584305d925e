"""Result files: a journal of finished steps, and one netCDF file made from it.

While a run goes on, each finished step is a small netCDF file of its own in the journal beside
the output (``out.nc.d/000012.nc``), written under a temporary name, flushed to disk and renamed.
A record of the journal is a result with one step, all its fields kept. ``out.nc`` is assembled
from the records, one step in memory at a time, and only ever replaced as a whole. So a run that
is killed at any moment loses at most the step it was working on, and what stood in ``out.nc``
before stays readable.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import re
import shutil
import socket
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from .errors import DeckError, HexcontactError, ResourceError
from .result import FIELDS, SCHEMA_VERSION, VARIABLES, Layout, Metadata, Result, Step, assemble, window_of

if TYPE_CHECKING:
    import netCDF4

PUBLISH_INTERVAL = 30.0  # s, at least, between two interim versions of the output
_CHUNK = 512  # nodes of a chunk along row and col
_RECORD = re.compile(r"\d{6}\.nc")
_LACKING = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOMEM, None}
_netcdf = threading.Lock()  # the netCDF library must not be entered by two threads


def journal_of(path: Path) -> Path:
    """Folder of the journal that belongs to the output `path`."""
    return path.with_name(path.name + ".d")


@contextlib.contextmanager
def _alone() -> Iterator[None]:
    """Keep other threads out of the netCDF library, those that read through xarray too."""
    backend = sys.modules.get("xarray.backends.netCDF4_")
    with _netcdf, getattr(backend, "NETCDF4_PYTHON_LOCK", contextlib.nullcontext()):
        yield


# --- writing --------------------------------------------------------------------------------------


def write(path: Path, layout: Layout, steps: Iterable[Step], complete: bool, compress: bool = True) -> None:
    """Write a netCDF file and flush it to disk.

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
    compress : bool
        Compress what has a value at every node.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    import netCDF4

    try:
        with _alone():
            file = netCDF4.Dataset(path, "w", format="NETCDF4_CLASSIC")
        try:
            with _alone():
                file.setncatts(layout.attributes(complete))
                for name, size in layout.sizes.items():
                    file.createDimension(name, size)
                for name, values in layout.coordinates().items():
                    _column(file, layout, name, compress)[...] = values
                columns = {name: _column(file, layout, name, compress) for name in layout.variables}
            gap_column = columns.pop("initial_gap", None)
            gap: Any = None
            for position, step in enumerate(steps):
                with _alone():
                    for name, column in columns.items():
                        column[position] = _characters(column, layout.value(name, position, step))
                if gap_column is not None:
                    gap = layout.initial_gap(gap, step)
            with _alone():
                if gap_column is not None:
                    gap_column[...] = gap
        finally:
            with _alone():
                file.close()
    except RuntimeError as error:  # the HDF5 library hides the reason, a full disk mostly
        raise OSError(None, str(error), str(path)) from error
    _flush(path)


def _column(file: netCDF4.Dataset, layout: Layout, name: str, compress: bool) -> netCDF4.Variable:
    """Create the variable `name` with its attributes."""
    variable = VARIABLES[name]
    if variable.dtype == "str":
        # Characters, not netCDF strings: HDF5 crashes on those when a file is opened more than once.
        longest = max(len(str(step.history.get(name, "")).encode()) for step in layout.steps)
        file.createDimension(f"{name}_length", max(1, longest))
        column = file.createVariable(name, "S1", (*variable.dims, f"{name}_length"))
        column.setncatts({**variable.attributes, "_Encoding": "utf-8"})
        column.set_auto_chartostring(False)
        return column
    options: dict[str, Any] = {}
    if variable.dims[-2:] == ("row", "col"):
        options["compression"] = "zlib" if compress else None
        options["complevel"] = 1
        options["fletcher32"] = True  # damage shows as an error, not as wrong numbers
        options["chunksizes"] = [min(_CHUNK, len(file.dimensions[dim])) for dim in variable.dims]
        if "step" in variable.dims:
            options["chunksizes"][0] = 1
        if variable.dtype == "f8":
            options["fill_value"] = variable.missing
    column = file.createVariable(name, variable.dtype, variable.dims, **options)
    column.setncatts(variable.attributes)
    if variable.dims[-2:] == ("row", "col") and name not in ("x", "y"):
        column.coordinates = "x y"
    return column


def _characters(column: netCDF4.Variable, value: Any) -> Any:
    """Turn text into the characters of `column`; everything else stays as it is."""
    if not isinstance(value, str):
        return value
    return np.frombuffer(value.encode().ljust(column.shape[-1], b"\0"), "S1")


def _flush(path: Path) -> None:
    """See to it that a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


# --- reading --------------------------------------------------------------------------------------


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn what goes wrong on reading a damaged or foreign file into one sentence."""
    try:
        yield
    except (HexcontactError, FileNotFoundError):
        raise
    except PermissionError as error:
        raise DeckError(f"{path} cannot be read: {error.strerror}") from error
    except Exception as error:  # damage takes any form: every library below has its own exceptions
        raise DeckError(
            f"{path} is damaged or not a netCDF file ({str(error).strip() or type(error).__name__})"
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


def _attributes(file: netCDF4.Dataset) -> dict[str, Any]:
    return {name: file.getncattr(name) for name in file.ncattrs()}


def read_record(path: Path) -> tuple[Metadata, Step]:
    """Read one record of a journal.

    Raises
    ------
    DeckError
        If the file is damaged or of another kind.
    FileNotFoundError
        If it is not there.
    """
    import netCDF4

    with _reading(path), _alone(), netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        attributes = _attributes(file)
        _check_ours(attributes, path)
        fields, history = {}, {}
        for name in VARIABLES.keys() & file.variables.keys():
            if name in FIELDS:
                fields[name] = file[name][0]
            elif VARIABLES[name].dims == ("step",):
                value = file[name][0]
                history[name] = str(value) if VARIABLES[name].dtype == "str" else value
        if "initial_gap" in file.variables:
            fields["initial_gap"] = file["initial_gap"][...]
        window = window_of(attributes, file["row"][...], file["col"][...])
        index = int(history.pop("step")) - 1
    return Metadata.from_attributes(attributes), Step(index, window, fields, history)


class Journal:
    """The finished steps of a run, read from the disk one at a time.

    Parameters
    ----------
    folder : Path
        The folder; one that is not there is an empty journal.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        names = sorted(os.listdir(folder)) if folder.is_dir() else []
        self.records = [folder / name for name in names if _RECORD.fullmatch(name)]

    def __len__(self) -> int:
        """Return the number of finished steps."""
        return len(self.records)

    def __iter__(self) -> Iterator[Step]:
        """Read the steps; DeckError if one is missing between others or damaged."""
        for number, record in enumerate(self.records, start=1):
            if int(record.stem) != number:
                raise DeckError(f"{self.folder} lacks the record of step {number}, {number:06d}.nc")
            yield read_record(record)[1]

    @property
    def metadata(self) -> Metadata:
        """Where the steps come from."""
        return read_record(self.records[0])[0]

    @property
    def complete(self) -> bool:
        """Whether all planned steps are there."""
        return len(self) == self.metadata.planned_steps

    def result(self, path: Path) -> Result:
        """All finished steps as a result in memory; `path` is what the user calls it."""
        return Result(assemble(self.metadata, self, self.complete), str(path))

    def remove(self) -> None:
        """Delete the records and what an interrupted write left; the lock stays."""
        for path in (*self.records, *self.folder.glob("*.tmp")):
            path.unlink(missing_ok=True)


def open_result(path: str | os.PathLike[str]) -> Result:
    """Open the result of a run, finished or not.

    Parameters
    ----------
    path : path
        The output file. The journal of an unfinished run beside it is read too; the output may
        even be missing. The folder of a journal can also be given itself.

    Returns
    -------
    Result
        Fields of a finished run are read from the file when they are asked for.

    Raises
    ------
    DeckError
        If there is no such file, or it is damaged, of another kind or of another version.
    """
    target = Path(path)
    for _ in range(2):  # again if a run that just finished took its journal away while we read it
        with contextlib.suppress(FileNotFoundError):
            if target.is_dir():
                if journal := Journal(target):
                    return journal.result(target)
                raise DeckError(f"{target} is a folder without finished steps in it")
            output = _open_output(target) if target.exists() else None
            if output is not None and output.complete:
                return output
            journal = Journal(journal_of(target))
            if journal and (output is None or _continues(journal, output)):
                if output is not None:
                    output.close()
                return journal.result(target)
            if output is not None:
                return output
    raise DeckError(f"there is no file {target}")


def _continues(journal: Journal, output: Result) -> bool:
    """Whether the steps of `output` are the first ones of `journal`."""
    return len(journal) >= len(output) and journal.metadata.run == output.dataset.attrs.get("run")


def _open_output(path: Path) -> Result:
    import netCDF4

    with _reading(path), _alone(), netCDF4.Dataset(path) as file:
        attributes = _attributes(file)
        _check_ours(attributes, path)
        for name in ("step", "row", "col", "x", "y"):
            if file[name].dimensions != VARIABLES[name].dims or 0 in file[name].shape:
                raise DeckError(f"{path} is damaged: it has no usable {name} coordinate")
    with _reading(path):
        import xarray

        result = Result(xarray.open_dataset(path, engine="netcdf4"), str(path))
        for variable in result.dataset.variables.values():
            if variable.ndim < 2:
                variable.load()
        _ = result.lattice, result.complete, Metadata.from_attributes(result.dataset.attrs)
        return result


# --- the run --------------------------------------------------------------------------------------


class Lock:
    """Keeps two runs from writing one output.

    The lock is held through the operating system, which lets go of it when the process dies.
    File systems differ in whether another machine notices, so the file names process and host:
    a lock left by another host counts as held.

    Parameters
    ----------
    path : Path
        Lock file.
    output : Path
        What is being protected, for the message.

    Raises
    ------
    DeckError
        If another run holds it.
    """

    def __init__(self, path: Path, output: Path) -> None:
        self.path = path
        while True:
            self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                held = False
            except BlockingIOError:
                held = True
            except OSError:  # a file system without locks: only the process number is left to go by
                held = _is_running(self._holder())
            if held or _same_file(path, self._descriptor):
                break
            os.close(self._descriptor)  # the one who held it deleted the file in between
        holder = self._holder()
        if held or holder.get("host", socket.gethostname()) != socket.gethostname():
            os.close(self._descriptor)
            since = f" since {holder['since']}" if "since" in holder else ""
            raise DeckError(
                f"{output} is being written by another run, process {holder.get('process', '?')} "
                f"on {holder.get('host', '?')}{since}; if that run is over, delete {path}"
            )
        text = {"process": os.getpid(), "host": socket.gethostname(), "since": time.strftime("%F %T")}
        os.ftruncate(self._descriptor, 0)
        os.pwrite(self._descriptor, json.dumps(text).encode(), 0)

    def _holder(self) -> dict[str, Any]:
        with contextlib.suppress(ValueError):
            holder = json.loads(os.pread(self._descriptor, 1000, 0))
            if isinstance(holder, dict):
                return holder
        return {}

    def release(self) -> None:
        """Let go of the lock."""
        self.path.unlink(missing_ok=True)
        os.close(self._descriptor)


def _is_running(holder: dict[str, Any]) -> bool:
    import psutil

    return holder.get("host") == socket.gethostname() and psutil.pid_exists(int(holder.get("process", -1)))


def _same_file(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.stat(path), os.fstat(descriptor))
    except FileNotFoundError:
        return False


class Store:
    """Writes a run: each step to the journal as it is finished, all of them to the output.

    Use it as a context manager, or call `close`. A run that does not come to `finish` leaves its
    journal behind.

    Parameters
    ----------
    path : path
        Output file.
    metadata : Metadata
        Where the steps come from, and what the output keeps of them.
    overwrite : bool
        Replace an output, or an unfinished run, that is there already. It stays until `finish`.

    Raises
    ------
    DeckError
        If the output is there already, is being written by another run or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], metadata: Metadata, overwrite: bool = False) -> None:
        self.path = Path(os.path.realpath(path))
        self.metadata = metadata
        self.folder = journal_of(self.path)
        self.heads: list[Step] = []
        self._mutex = threading.RLock()  # close() may come from another thread than append()
        self._closed = False
        self._published = (0, time.monotonic())
        if self.path.is_dir():
            raise DeckError(f"{self.path} is a folder; a file name is expected")
        if not self.path.parent.is_dir():
            raise DeckError(f"cannot write {self.path}: the folder {self.path.parent} does not exist")
        if self.path.exists() and not overwrite:
            raise DeckError(f"{self.path} exists already; --overwrite (overwrite=True in Python) replaces it")
        with self._writing("the journal"):
            self.folder.mkdir(exist_ok=True)
            if not os.access(self.path.parent, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            self._lock = Lock(self.folder / "lock", self.path)
        try:
            self._take_over(overwrite)
        except BaseException:
            self.close()
            raise
        self._in_the_way = self.path.exists()

    def _take_over(self, overwrite: bool) -> None:
        """Deal with what an unfinished run left."""
        left = Journal(self.folder)
        if left and not overwrite:
            raise DeckError(
                f"{self.folder} holds {_steps(len(left))} of an unfinished run; "
                f"hexcontact info {self.path} shows them, --overwrite (overwrite=True in Python) starts anew"
            )
        with self._writing("the journal"):
            if left:  # they become the old output, which is only replaced by a complete new one
                with contextlib.suppress(DeckError):
                    old = _open_output(self.path) if self.path.exists() else None
                    if old is None or (not old.complete and _continues(left, old)):
                        layout = Layout(left.metadata, [step.head for step in left])
                        self._replace(self.path, layout, left, complete=left.complete)
            left.remove()

    def __enter__(self) -> Self:
        """Return the store."""
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Close it; an error on its way out is told what is kept."""
        self.close()
        if isinstance(error, HexcontactError) and self.heads:
            error.add_note(self.kept)

    @property
    def kept(self) -> str:
        """Sentence about the finished steps: how many, where, how to look at them."""
        where = self.folder if self.folder.exists() else self.path
        steps = f"{len(self.heads)} of {self.metadata.planned_steps} load steps are finished"
        return f"{steps} and kept in {where}; hexcontact info {self.path} shows them"

    @contextlib.contextmanager
    def _writing(self, what: str) -> Iterator[None]:
        """Turn a failure to write into one sentence that names the file and the step."""
        try:
            yield
        except OSError as error:
            reason = error.strerror or str(error)
            if error.errno is None:
                free = shutil.disk_usage(self.path.parent).free
                reason = f"{reason}; is the disk full? {free / 1e6:.0f} MB are free"
            kind = ResourceError if error.errno in _LACKING else DeckError
            raise kind(f"cannot write {what} of {self.path}: {reason}") from error

    def _replace(
        self, target: Path, layout: Layout, steps: Iterable[Step], complete: bool, compress: bool = True
    ) -> None:
        """Write `target` under a temporary name, then put it in its place."""
        temporary = self.folder / (target.name + ".tmp")
        try:
            write(temporary, layout, steps, complete, compress)
            os.replace(temporary, target)
            _flush(target.parent)
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise

    def append(self, step: Step) -> None:
        """Commit a finished step: when this returns it is on the disk.

        Raises
        ------
        DeckError, ResourceError
            If it cannot be written; the steps before it are kept.
        """
        with self._mutex:
            if self._closed:
                raise ValueError("the store is closed")
            if step.number != len(self.heads) + 1:
                raise ValueError(f"step {len(self.heads) + 1} is next, not step {step.number}")
            with self._writing(f"step {step.number}"):
                layout = Layout(self.metadata, [step.head], everything=True)
                record = self.folder / f"{step.number:06d}.nc"
                self._replace(record, layout, [step], complete=False, compress=False)
            self.heads.append(step.head)
            steps, moment = self._published
            due = len(self.heads) >= 2 * steps and time.monotonic() >= moment + PUBLISH_INTERVAL
            if due and not self._in_the_way:  # doubling keeps the cost of all interim versions linear
                self._publish(complete=False)

    def _publish(self, complete: bool) -> None:
        with self._writing("the output"):
            layout = Layout(self.metadata, self.heads)
            self._replace(self.path, layout, Journal(self.folder), complete)
        self._published = (len(self.heads), time.monotonic())

    def finish(self) -> None:
        """Put the output in its place and clear the journal away.

        Raises
        ------
        DeckError, ResourceError
            If it cannot be written; the journal is kept.
        """
        with self._mutex:
            self._publish(complete=True)
            Journal(self.folder).remove()
            self.close()

    def close(self) -> None:
        """Let go of the files; the journal of an unfinished run stays."""
        with self._mutex:
            if self._closed:
                return
            self._closed = True
            self._lock.release()
            with contextlib.suppress(OSError):  # unless there are records in it
                self.folder.rmdir()


def _steps(count: int) -> str:
    return f"{count} finished step{'s' * (count != 1)}"
