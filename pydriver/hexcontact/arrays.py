"""Names of arrays, data sets and tables; arrays of real numbers from arguments of users."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DeckError

if TYPE_CHECKING:
    from pandas import DataFrame as DataFrame
    from xarray import DataArray as DataArray
    from xarray import Dataset as Dataset
else:  # xarray and pandas are imported at their first use
    DataArray = DataFrame = Dataset = Any

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
BAND = 256  # rows that are read and written at once, those of a chunk


def reals(values: ArrayLike, name: str, shape: tuple[int, ...] | None = None, meaning: str = "") -> Array:
    """Return an argument as an array of real numbers, without a copy if it is one."""
    # numpy.ma, which takes a while, is loaded at its first use
    derived = isinstance(values, np.ndarray) and type(values) is not np.ndarray
    if derived and isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise DeckError(f"{name}: an array without masked values expected")
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            array = array.astype(float)
        if array.dtype.kind not in "biuf" or values is None:
            raise TypeError(f"values of the type {array.dtype}")
        array = array.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeckError(f"{name}: an array of real numbers expected") from error
    if shape is not None and array.shape != shape:
        raise DeckError(f"{name}: an array of shape {array.shape}, expected {shape}{meaning}")
    return array


def has_entries(values: Any) -> bool:
    """Test whether a value is an array, also one of rows of different lengths."""
    try:
        return np.ndim(values) > 0
    except ValueError:
        return True


class Banded(Mapping[str, NDArray[Any]]):
    """Fields that are not in memory, or not all of their rows."""

    def __init__(self, names: Iterable[str]) -> None:
        self._names = [*names]

    @abstractmethod
    def bands(self, name: str) -> Iterator[NDArray[Any]]:
        """Yield the rows of a field in bands, one after the other."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a whole field; KeyError if there is none."""
        if name not in self._names:
            raise KeyError(name)
        return np.concatenate([*self.bands(name)])

    def __contains__(self, name: object) -> bool:
        """Test whether there is such a field."""
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of fields."""
        return len(self._names)


def in_bands(parts: Iterable[NDArray[Any]], rows: int = BAND) -> Iterator[NDArray[Any]]:
    """Join and cut bands so that each but the last has so many rows."""
    left: list[NDArray[Any]] = []
    for part in parts:
        start = 0
        while start < len(part):
            missing = rows - sum(map(len, left))
            left.append(part[start : start + missing])
            start += missing
            if sum(map(len, left)) == rows:
                yield left[0] if len(left) == 1 else np.concatenate(left)
                left = []
    if left:
        yield left[0] if len(left) == 1 else np.concatenate(left)
