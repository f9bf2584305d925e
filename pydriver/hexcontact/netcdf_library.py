"""The netCDF library, which one thread may enter at a time: its lock, and files that are closed under it."""

from __future__ import annotations

import contextlib
import functools
import inspect
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from .arrays import Dataset
from .errors import HexcontactError

if TYPE_CHECKING:
    import netCDF4


class _Lock:
    """Lock of the netCDF library for this package, and of xarray for the time that it is held.

    A thread may take it again. Whoever reads by xarray takes it, too: garbage collection
    closes a file of xarray if it gets the lock at once, and leaves it open for later otherwise.
    """

    def __init__(self) -> None:
        self.own, self._depth = threading.RLock(), 0
        self._foreign: Any = None
        self.waiting = 0  # threads that only wait for another one

    def acquire(self, blocking: bool = True) -> bool:
        """Take the lock; False without waiting if another thread has it."""
        if not self.own.acquire(blocking):
            return False
        taken = self._depth > 0
        try:
            if not taken:
                self._foreign = lock_of_xarray()
                taken = self._foreign is None or self._foreign.acquire(blocking)
            self._depth += taken
        finally:
            if not taken:
                self.own.release()
        return taken

    def release(self) -> None:
        """Release the lock."""
        self._depth -= 1
        if self._depth == 0 and self._foreign is not None:
            self._foreign.release()
        self.own.release()

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def __reduce__(self) -> str:
        """Return the name of the only lock, which stands for it in a pickle."""
        return "LOCK"


LOCK = _Lock()


def lock_of_xarray() -> Any:
    """Return the lock of xarray for the netCDF library; None while no other thread can read by xarray."""
    if "xarray" not in sys.modules and threading.active_count() - LOCK.waiting == 1:
        return None
    import xarray
    import xarray.backends.netCDF4_ as backend

    try:
        lock = backend.NETCDF4_PYTHON_LOCK
    except AttributeError:
        raise HexcontactError(
            f"xarray {xarray.__version__} has no lock of the netCDF library (NETCDF4_PYTHON_LOCK); "
            "install a version that has it, such as 2026.2"
        ) from None
    _keep_out(backend.NetCDF4DataStore)
    return lock


@functools.cache
def _keep_out(store: type) -> None:
    """Make the stores of xarray wait for this package.

    xarray holds its lock to open, close and read files, and calls the library without it for
    attributes, sizes and filters (https://github.com/pydata/xarray/issues/7079). The methods that take
    the lock of xarray first stay as they are: their order would be the opposite one.
    """
    for name, method in [*vars(store).items()]:
        if inspect.isfunction(method) and name not in ("_acquire", "close"):
            setattr(store, name, _waiting(method))


def _waiting(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of a store that waits for this package."""

    @functools.wraps(method)
    def waiting(*args: Any, **options: Any) -> Any:
        with LOCK.own:
            return method(*args, **options)

    return waiting


@contextlib.contextmanager
def opened(path: Path, mode: Literal["r", "w"] = "r", **options: Any) -> Iterator[netCDF4.Dataset]:
    """Open a file of netCDF, and close it, with no other thread in the library meanwhile."""
    with LOCK, shared(path, mode, **options) as file:
        yield file


@contextlib.contextmanager
def shared(path: Path, mode: Literal["r", "w"], **options: Any) -> Iterator[netCDF4.Dataset]:
    """Open a file of netCDF, and close it; who uses it takes the lock."""
    import netCDF4

    with LOCK:
        file = netCDF4.Dataset(path, mode, **options)
    try:
        yield file
    finally:
        with LOCK:
            try:
                file.close()
            except BaseException:
                file._close(False)  # else its destructor does, when another file may have its number
                raise


def attributes(path: Path) -> dict[str, Any]:
    """Return the attributes of a file; none if it is missing, damaged or another file."""
    if not path.is_file():  # a pipe would block
        return {}
    with contextlib.suppress(OSError, RuntimeError, AttributeError), opened(path) as file:
        return {name: file.getncattr(name) for name in file.ncattrs()}
    return {}


def write(dataset: Dataset, path: Path, mode: Literal["w", "a"] = "w", **options: Any) -> None:
    """Write a dataset of xarray to a file, or to a group of it."""
    from xarray.backends import NetCDF4DataStore

    encoding = options.pop("encoding", None)
    with LOCK, contextlib.closing(NetCDF4DataStore.open(path, mode, lock=LOCK, **options)) as store:
        dataset.dump_to_store(store, encoding=encoding)


def opened_by_xarray(path: Path, **options: Any) -> Dataset:
    """Open a file with xarray, whose fields are then read under the lock.

    ValueError if a variable has a dimension twice, of which xarray only warns.
    """
    import xarray
    from xarray.backends import NetCDF4DataStore

    with LOCK:
        store = NetCDF4DataStore.open(path, lock=LOCK, group=options.pop("group", None))
        try:
            for name, values in store.ds.variables.items():
                if len(set(values.dimensions)) < values.ndim:
                    raise ValueError(f"{name} has a dimension twice")
            return xarray.open_dataset(store, **options)
        except BaseException:
            store.close()
            raise
