"""Calls of the core: exceptions for its status, arrays as it takes and returns them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ConvergenceError, DeckError, HexcontactError, ResourceError

_ERRORS: dict[int, type[HexcontactError]] = {
    1: DeckError,
    2: ConvergenceError,
    3: ResourceError,
    4: HexcontactError,
}


def called(procedure: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Call a procedure that ends with status and message, and return its other results."""
    *found, code, message = procedure(*arguments, **named)
    if code:
        raise _ERRORS.get(code, HexcontactError)(message.decode().strip())
    return found[0] if len(found) == 1 else found


def flattened(*given: tuple[ArrayLike, int]) -> list[Any]:
    """Return the shape of points, and their arrays, each with a number of further axes, over one axis."""
    arrays = [(np.asarray(values), further) for values, further in given]
    points = np.broadcast_shapes(*(array.shape[: array.ndim - further] for array, further in arrays))
    found: list[Any] = [points]
    for array, further in arrays:
        rest = array.shape[array.ndim - further :]
        # f2py takes no empty arrays
        whole = np.broadcast_to(array, points + rest) if math.prod(points) else np.zeros((1, *rest))
        found.append(whole.reshape(-1, *rest).T)
    return found


def shaped(values: NDArray[Any], points: tuple[int, ...]) -> NDArray[Any]:
    """Return values of the core, whose last axis is that of the points, in the shape of these."""
    found = np.asarray(values).T
    return found[: math.prod(points)].reshape(points + found.shape[1:])


def record(kind: Callable[..., Any], numbers: NDArray[Any]) -> Any:
    """Return numbers of the core as a record."""
    types = kind.__annotations__.values()
    return kind(*(as_type(number) for as_type, number in zip(types, numbers.tolist(), strict=True)))
