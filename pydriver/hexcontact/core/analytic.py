"""Closed solutions of the Fortran library at points of any shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..arrays import Array
from . import _core

flat = _core.hc_f2py_analytic
axisymmetric = _core.hc_f2py_axisymmetric


def at_points(
    procedure: Callable[..., Any], contact: tuple[float, ...], points: Sequence[Array], *others: float
) -> Array:
    """Evaluate a contact at points; the result has the shape of one value, then that of the points."""
    points = np.broadcast_arrays(*points)
    shape, size = points[0].shape, points[0].size
    # f2py takes no empty arrays
    flattened = [values.ravel() if size else np.zeros(1) for values in points]
    values = np.asarray(procedure(contact, *flattened, *others))
    return values[..., :size].reshape(values.shape[:-1] + shape)
