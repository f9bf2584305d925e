"""Calls of the core: checks of arguments, exceptions for its status, arrays as it takes and returns them."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, reals
from ..errors import ConvergenceError, DeckError, HexcontactError, ResourceError

_LARGEST_INTEGER = 2**31 - 1
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


def status_of(error: HexcontactError) -> int:
    """Return the status of the core for an error."""
    return next((status for status, kind in _ERRORS.items() if isinstance(error, kind)), 4)


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
    return kind(*map(operator.call, kind.__annotations__.values(), numbers.tolist()))


# --- arguments ----------------------------------------------------------------------------------------------


def points(**coordinates: ArrayLike) -> list[NDArray[np.float64]]:
    """Return arguments as arrays of real numbers of one shape."""
    arrays = {name: reals(values, name) for name, values in coordinates.items()}
    try:
        return [*np.broadcast_arrays(*arrays.values())]
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


def numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """Return arguments as real numbers by their names."""
    return {name: number(value, name) for name, value in values.items()}


def integer(value: Any, name: str, expected: str = "an integer") -> int:
    """Return an argument as an integer of 32 bits."""
    try:
        found = operator.index(value)
    except TypeError as error:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}") from error
    if abs(found) > _LARGEST_INTEGER:
        raise DeckError(f"{name} = {_shown(value)}: expected {expected} of at most {_LARGEST_INTEGER}")
    return found


positive = partial(number, expected="a positive number", fits=lambda value: 0.0 < value < math.inf)


def word(value: Any, name: str, allowed: Collection[str]) -> str:
    """Return an argument that is one of a few words."""
    if not isinstance(value, str) or value not in allowed:
        raise DeckError(f"{name} = {_shown(value)}: expected {' or '.join(map(repr, allowed))}")
    return value


def vector(value: Any, name: str, expected: str, count: int) -> Array:
    """Return an argument of a few finite numbers."""
    try:
        array = np.asanyarray(value)  # which keeps masks
        entries = [number(entry, name, expected) for entry in array] if array.ndim == 1 else []
    except ValueError:  # rows of different lengths, or an entry that is no number
        entries = []
    if len(entries) != count or not all(map(math.isfinite, entries)):
        raise DeckError(f"{name} = {_shown(value)}: expected {expected}")
    return np.array(entries)


_ARGUMENTS: dict[str, Callable[[Any, str], Any]] = {
    **dict.fromkeys(("row_first", "col_first", "n_row", "n_col", "max_sweeps", "max_cuts"), integer),
    "threads": partial(integer, expected="an integer of at least 0"),  # the core checks the bound
    "method": partial(word, allowed=("direct", "fft")),
    "iteration": partial(word, allowed=("newton", "dissertation")),
    "coupling": partial(word, allowed=("full", "goodman")),
    "entry": partial(word, allowed=("implicit", "interpolated")),
    **dict.fromkeys(("lambda_1", "lambda_2", "lambda_5", "young_modulus", "poisson_ratio"), number),
    "spacing": partial(number, expected="a positive length in meters", fits=lambda v: 0 < v < math.inf),
    **dict.fromkeys(("cell_ratio", "shear_modulus", "yield_stress"), positive),
    "cell_angle": partial(
        number, expected="an angle in radians between 0 and pi", fits=lambda v: 0 < v < math.pi
    ),
    "direction": partial(number, expected="an angle in radians", fits=lambda v: abs(v) <= math.pi),
    "normal_load": partial(number, expected="a number not below zero", fits=lambda v: 0 <= v < math.inf),
    "approach": partial(number, fits=math.isfinite),
    "tolerance": partial(number, expected="a number between 0 and 1", fits=lambda v: 0 < v < 1),
    "friction_coefficient": partial(number, expected="a number of at least 0, or inf", fits=lambda v: v >= 0),
    "shear_limit": partial(number, expected="a number above 0, or inf", fits=lambda v: v > 0),
    "slope": partial(number, expected="a finite number", fits=math.isfinite),
    "origin": partial(vector, expected="two finite lengths in meters", count=2),
    "interface": partial(vector, expected="a coefficient, an exponent and a stiffness", count=3),
    "value": partial(vector, expected="four finite numbers", count=4),
}
"""Checks of the arguments of the core by their names."""


def checked(**arguments: Any) -> tuple[Any, ...]:
    """Return arguments of the core after the check that belongs to the name of each."""
    return tuple(_ARGUMENTS[name](value, name) for name, value in arguments.items())


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."
