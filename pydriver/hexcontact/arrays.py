"""Checks of numbers and arrays that users pass, before the core takes them."""

from __future__ import annotations

import operator
from collections.abc import Callable, Collection
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DeckError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LARGEST_INTEGER = 2**31 - 1  # of the core


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


def broadcast(**coordinates: ArrayLike) -> dict[str, NDArray[np.float64]]:
    """Return arguments as arrays of real numbers of one shape, by their names."""
    arrays = {name: reals(values, name) for name, values in coordinates.items()}
    try:
        return dict(zip(arrays, np.broadcast_arrays(*arrays.values()), strict=True))
    except ValueError as error:
        shapes = " and ".join(str(array.shape) for array in arrays.values())
        raise DeckError(f"{' and '.join(arrays)}: arrays of shapes {shapes} do not broadcast") from error


def number(
    value: Any, name: str, expected: str = "a number", fits: Callable[[float], bool] | None = None
) -> float:
    """Return an argument as a real number, which may be infinite."""
    try:
        if isinstance(value, str | bytes) or np.iscomplexobj(value):
            raise TypeError(f"a value of the type {type(value).__name__}")
        found = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}") from error
    if found != found or (fits and not fits(found)):
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}")
    return found


def integer(value: Any, name: str, expected: str = "an integer") -> int:
    """Return an argument as an integer of 32 bits."""
    try:
        found = operator.index(value)
    except TypeError as error:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}") from error
    if abs(found) > _LARGEST_INTEGER:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected} of at most {_LARGEST_INTEGER}")
    return found


def word(value: Any, name: str, allowed: Collection[str]) -> str:
    """Return an argument that is one of a few words."""
    if not isinstance(value, str) or value not in allowed:
        raise DeckError(f"{name} = {_shown(value)}: expected {' or '.join(map(repr, allowed))}")
    return value


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."
