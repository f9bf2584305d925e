"""Influence functions below the surface: displacement and stress by pyramids and triangles.

Points may be arrays of any shapes that broadcast. Stress is positive in tension; z points into the body.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, broadcast, number, reals
from ..errors import DeckError
from . import _core
from .calls import called

_flat = _core.hc_f2py_influence


def pyramid_stress(x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float) -> Array:
    """Return the stress below the surface by the unit pyramid of the equilateral lattice.

    The error is below 1e-12 of the envelope 1/(2 pi max(1, R)^2), R the distance from the node, up to 1e5
    spacings.

    Parameters
    ----------
    x, y, z : array_like
        Points relative to the node, in spacings; z >= 0 points into the body.
    poisson_ratio : float
        nu of the body, in (-1, 0.5].

    Returns
    -------
    ndarray, shape (..., 3, 6)
        By a pressure and by tractions along x and y on the body, each 1 at the node: components xx, yy, zz,
        xy, yz, xz, positive in tension.

    Raises
    ------
    DeckError
        If an argument is not a finite number or out of range, or the shapes do not broadcast.
    """
    return _below(_flat.pyramid_fields, x, y, z, poisson_ratio)[1]


def pyramid_displacement(x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float) -> Array:
    """Return the displacement below the surface by the unit pyramid times the shear modulus.

    Arguments as of `pyramid_stress`; the result has the shape (..., 3, 3): by each load along x, y, z.
    """
    return _below(_flat.pyramid_fields, x, y, z, poisson_ratio)[0]


def triangle_stress(
    vertices: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    poisson_ratio: float,
    load: ArrayLike = (1.0, 1.0, 1.0),
) -> Array:
    """Return the stress below the surface by a linear load on a triangle.

    The load ends at the edges; on them, at z = 0, some stresses are infinite, and the result is meaningful
    only in a sum over triangles with continuous loads.

    Parameters
    ----------
    vertices : array_like, shape (3, 2)
        Corners of the triangle.
    x, y, z : array_like
        Points; z >= 0 points into the body.
    poisson_ratio : float
        nu of the body, in (-1, 0.5].
    load : array_like, shape (3,)
        The load at the corners.

    Returns
    -------
    ndarray, shape (..., 3, 6)
        By the load as a pressure, and as a traction along x and y on the body: components as of
        `pyramid_stress`.

    Raises
    ------
    DeckError
        If an argument is not a finite number or out of range, or the shapes do not broadcast.
    """
    given = {"vertices": _shaped(vertices, "vertices", (3, 2)).T, "values": _shaped(load, "load", (3,))}
    return _below(_flat.triangle_interior, x, y, z, poisson_ratio, **given)[1]


def triangle_displacement_below(
    vertices: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    poisson_ratio: float,
    load: ArrayLike = (1.0, 1.0, 1.0),
) -> Array:
    """Return the displacement below the surface by a linear load on a triangle times the shear modulus.

    Arguments as of `triangle_stress`; the result has the shape (..., 3, 3): by each load along x, y, z.
    """
    given = {"vertices": _shaped(vertices, "vertices", (3, 2)).T, "values": _shaped(load, "load", (3,))}
    return _below(_flat.triangle_interior, x, y, z, poisson_ratio, **given)[0]


def mesh_stress(
    vertices: ArrayLike, tractions: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float
) -> Array:
    """Return the stress below the surface by tractions on any set of triangles.

    Parameters
    ----------
    vertices : array_like, shape (n, 3, 2)
        Corners of the triangles.
    tractions : array_like, shape (n, 3, 3)
        At each corner the pressure, and the tractions along x and y on the body; linear on each triangle.
    x, y, z : array_like
        Points; z >= 0 points into the body.
    poisson_ratio : float
        nu of the body, in (-1, 0.5].

    Returns
    -------
    ndarray, shape (..., 6)
        Components as of `pyramid_stress`.

    Raises
    ------
    DeckError
        If an argument is not a finite number or out of range, or the shapes do not fit.
    """
    return _below(_flat.mesh_interior, x, y, z, poisson_ratio, **_mesh(vertices, tractions))[1]


def mesh_displacement(
    vertices: ArrayLike, tractions: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float
) -> Array:
    """Return the displacement by tractions on any set of triangles times the shear modulus.

    Arguments as of `mesh_stress`; the result has the shape (..., 3): along x, y, z.
    """
    return _below(_flat.mesh_interior, x, y, z, poisson_ratio, **_mesh(vertices, tractions))[0]


def _below(
    procedure: Callable[..., Any], x: ArrayLike, y: ArrayLike, z: ArrayLike, nu: float, **given: Any
) -> Any:
    """Return displacement and stress, the axes of the points first."""
    point = broadcast(x=x, y=y, z=z)
    shape = point["x"].shape
    if not point["x"].size:
        point = {name: np.zeros(1) for name in point}
    flat = {name: values.ravel() for name, values in point.items()}
    values = called(procedure, **flat, poisson_ratio=number(nu, "poisson_ratio"), **given)
    return [found.T[: math.prod(shape)].reshape(shape + found.T.shape[1:]) for found in values]


def _mesh(vertices: ArrayLike, tractions: ArrayLike) -> dict[str, Array]:
    """Return triangles and their tractions as the core takes them."""
    corners = reals(vertices, "vertices")
    if corners.ndim != 3 or not corners.size:
        raise DeckError(f"vertices: an array of shape {corners.shape}, expected (n, 3, 2): three points each")
    count = len(corners)
    return {
        "vertices": _shaped(corners, "vertices", (count, 3, 2)).T,
        "tractions": _shaped(tractions, "tractions", (count, 3, 3)).T,
    }


def _shaped(values: ArrayLike, name: str, shape: tuple[int, ...]) -> Array:
    """Return finite numbers of a shape."""
    array = reals(values, name)
    if array.shape != shape or not np.isfinite(array).all():
        raise DeckError(f"{name}: an array of shape {array.shape}, expected finite numbers of shape {shape}")
    return array
