"""Arguments of the Python interface: numbers and arrays as the core takes them, or one sentence."""

from __future__ import annotations

import operator
from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DeckError

_LARGEST_INTEGER = 2**31 - 1  # that the core can take


def reals(values: ArrayLike, name: str) -> NDArray[np.float64]:
    """Return an argument as an array of real numbers; of the same memory if it is one already.

    Raises
    ------
    DeckError
        If it is none: complex numbers, text, objects, nothing, rows of different lengths, masked values.
    """
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise DeckError(f"{name}: an array without masked values expected")
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            array = array.astype(float)
        if array.dtype.kind not in "biuf" or values is None:
            raise TypeError(f"values of the type {array.dtype}")
        return array.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeckError(f"{name}: an array of real numbers expected") from error


def number(value: Any, name: str, expected: str = "a number") -> float:
    """Return an argument as a real number, which may be infinite.

    Raises
    ------
    DeckError
        If it is none, or NaN.
    """
    try:
        if isinstance(value, str | bytes) or np.iscomplexobj(value):
            raise TypeError(f"a value of the type {type(value).__name__}")
        found = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}") from error
    if found != found:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}")
    return found


def integer(value: Any, name: str, expected: str = "an integer") -> int:
    """Return an argument as an integer that the core can take.

    Raises
    ------
    DeckError
        If it is none.
    """
    try:
        found = operator.index(value)
    except TypeError as error:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}") from error
    if abs(found) > _LARGEST_INTEGER:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected} of at most {_LARGEST_INTEGER}")
    return found


def word(value: Any, name: str, allowed: Collection[str]) -> str:
    """Return an argument that has to be one of a few words.

    Raises
    ------
    DeckError
        If it is none of them.
    """
    if not isinstance(value, str) or value not in allowed:
        raise DeckError(f"{name} = {_shown(value)}: expected {' or '.join(map(repr, allowed))}")
    return value


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."
