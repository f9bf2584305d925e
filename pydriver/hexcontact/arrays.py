"""Names of arrays, data sets and tables; arrays of real numbers from what users pass."""

from __future__ import annotations

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
