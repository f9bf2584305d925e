"""Influence functions: integrals and displacements of triangle loads, kernels of the pyramid.

Points may be arrays of any shapes that broadcast; results have the common shape. z points into the body, and
displacements are those of its surface. Equation and table numbers are those of the dissertation. Arguments
that are not finite, out of range or of the wrong shape raise `DeckError`: vertices are the corners (xi, eta)
of a triangle, shape (3, 2); x, y, z are the points, z >= 0 below the surface; nu is in (-1, 0.5].

Examples
--------
The potential of a unit load at the apex of a pyramid, (3 sqrt(3)/2) ln 3:

>>> from hexcontact.influence import pyramid_kernels
>>> round(float(pyramid_kernels(0.0, 0.0).K1), 6)
2.854278
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, reals
from .core import flat
from .core.calls import integer, number, points, word
from .errors import DeckError

__all__ = [
    "Displacement",
    "PyramidFunctions",
    "PyramidKernels",
    "linear_load_displacement",
    "mesh_displacement",
    "mesh_stress",
    "pyramid_displacement",
    "pyramid_functions",
    "pyramid_kernels",
    "pyramid_stress",
    "triangle_displacement",
    "triangle_displacement_below",
    "triangle_integral",
    "triangle_stress",
]

Load = Literal["constant", "linear_x", "linear_y", "bilinear"]
Direction = Literal["normal", "x", "y"]

_DEGREES = {"constant": (0, 0), "linear_x": (1, 0), "linear_y": (0, 1), "bilinear": (1, 1)}
_DIRECTIONS = {"x": 1, "y": 2, "normal": 3}


class PyramidKernels(NamedTuple):
    """The five kernels of the unit pyramid h, in spacings; rho is the distance of the field point (x, y)."""

    K1: Array
    """Integral of h/rho."""
    Kxx: Array
    """Integral of h (x - xi)^2/rho^3."""
    Kxy: Array
    """Integral of h (x - xi)(y - eta)/rho^3."""
    Kx: Array
    """Integral of h (x - xi)/rho^2."""
    Ky: Array
    """Integral of h (y - eta)/rho^2."""

    @property
    def Kyy(self) -> Array:
        """Integral of h (y - eta)^2/rho^3, which is K1 - Kxx."""
        return np.asarray(self.K1 - self.Kxx)


class PyramidFunctions(NamedTuple):
    """The nine functions of Table 8.1, in spacings.

    With a = (1-nu)/(2 pi G), b = (1-2 nu)/(4 pi G), c = nu/(2 pi G), the surface moves along x, y, z by
    (-b D, -b E, a C) p under a pressure p, by (a G, c H, b F) q_x under a traction q_x, and by
    (c J, a K, b I) q_y under a traction q_y.
    """

    C: Array
    D: Array
    E: Array
    F: Array
    G: Array
    H: Array
    I: Array  # noqa: E741 - the names of the table
    J: Array
    K: Array


class Displacement(NamedTuple):
    """Displacement of the surface [m]."""

    x: Array
    """Along x."""
    y: Array
    """Along y."""
    z: Array
    """Into the body."""


def triangle_integral(vertices: ArrayLike, x: ArrayLike, y: ArrayLike, j: int, k: int, m: int) -> Array:
    """Integrate (x - xi)^k (y - eta)^m / rho^j over a triangle, (4.5) and (4.7).

    The field point may be inside, outside, on an edge or its prolongation, or at a vertex. The error is
    below 1e-13 of the bound I_100 d^(k+m+1-j), d the distance of the farthest vertex, from 0 to 1e5
    triangle sizes away and for slivers, too. The order of the vertices does not matter; a triangle without
    area gives 0. The exponents are j = 1, 2, 3 and k, m >= 0 with 1 <= k + m + 2 - j <= 3.

    Examples
    --------
    The potential of a unit square at its center is 4 asinh(1):

    >>> square = [(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]
    >>> round(float(sum(triangle_integral(t, 0.5, 0.5, 1, 0, 0) for t in square)), 6)
    3.525494
    """
    exponents = {name: integer(value, name) for name, value in (("j", j), ("k", k), ("m", m))}
    return np.asarray(flat.triangle_integral(_vertices(vertices), *points(x=x, y=y), **exponents))


def triangle_displacement(
    vertices: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    *,
    load: Load = "constant",
    direction: Direction = "normal",
    shear_modulus: float,
    poisson_ratio: float,
) -> Displacement:
    """Return the displacement [m] by one of the loads of Tables 4.1 and 4.2 on a triangle, lengths in m.

    Parameters
    ----------
    load : {"constant", "linear_x", "linear_y", "bilinear"}
        Load 1, x - xi, y - eta or (x - xi)(y - eta), in Pa with lengths in m.
    direction : {"normal", "x", "y"}
        Direction of the load; "normal" presses into the body.
    shear_modulus, poisson_ratio : float
        G [Pa] and nu of the body.
    """
    k, m = _DEGREES[word(load, "load", _DEGREES)]
    given = _vertices(vertices), *points(x=x, y=y), _DIRECTIONS[word(direction, "direction", _DIRECTIONS)]
    moduli = number(shear_modulus, "shear_modulus"), number(poisson_ratio, "poisson_ratio")
    return Displacement(*_components(flat.triangle_displacement(*given, k, m, *moduli)))


def linear_load_displacement(
    vertices: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    traction: ArrayLike,
    *,
    shear_modulus: float,
    poisson_ratio: float,
) -> Displacement:
    """Return the displacement [m] by tractions that vary linearly over a triangle.

    The tractions, shape (3, 3), are those along x, along y and into the body [Pa] at each corner; others as
    of `triangle_displacement`.
    """
    loads = reals(traction, "traction", (3, 3), ": x, y, z at each corner")
    moduli = number(shear_modulus, "shear_modulus"), number(poisson_ratio, "poisson_ratio")
    given = _vertices(vertices), *points(x=x, y=y), loads
    return Displacement(*_components(flat.linear_triangle_displacement(*given, *moduli)))


def pyramid_kernels(x: ArrayLike, y: ArrayLike) -> PyramidKernels:
    """Return the five kernels of the unit pyramid of the equilateral lattice, all in spacings.

    The pyramid is 1 at the origin and falls linearly to 0 at the hexagon with corners at distance 1 in the
    directions 0, 60, ..., 300 degrees. For a spacing l_e the kernels are l_e K(x/l_e, y/l_e). The error stays
    below 1e-13 of K1, which bounds all five, from 0 to 1e5 spacings.
    """
    return PyramidKernels(*_components(flat.pyramid_kernels(*points(x=x, y=y))))


def pyramid_functions(x: ArrayLike, y: ArrayLike, poisson_ratio: float) -> PyramidFunctions:
    """Return the nine functions C, D, ..., K of Table 8.1, in spacings; G and K depend on nu."""
    nu = number(poisson_ratio, "poisson_ratio")
    if not -1.0 < nu <= 0.5:
        raise DeckError(f"poisson_ratio = {nu:g}: a number above -1 and at most 0.5 expected")
    nu_0 = nu / (1.0 - nu)
    kernels = pyramid_kernels(x, y)
    k1, kxx, kxy, kx, ky = kernels
    return PyramidFunctions(k1, kx, ky, kx, k1 + nu_0 * kxx, kxy, ky, kxy, k1 + nu_0 * kernels.Kyy)


# --- below the surface: stress is positive in tension, z points into the body ------------------------------


def pyramid_stress(x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float) -> Array:
    """Return the stress below the surface by the unit pyramid of the equilateral lattice, in spacings.

    The error is below 1e-12 of the envelope 1/(2 pi max(1, R)^2), R the distance from the node, up to 1e5
    spacings. The result has the shape (..., 3, 6): by a pressure and by tractions along x and y on the body,
    each 1 at the node, the components xx, yy, zz, xy, yz, xz, positive in tension.
    """
    return np.asarray(flat.pyramid_fields(*points(x=x, y=y, z=z), number(poisson_ratio, "poisson_ratio"))[1])


def pyramid_displacement(x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float) -> Array:
    """Return the displacement below the surface by the unit pyramid times the shear modulus.

    Arguments as of `pyramid_stress`; the result has the shape (..., 3, 3): by each load along x, y, z.
    """
    return np.asarray(flat.pyramid_fields(*points(x=x, y=y, z=z), number(poisson_ratio, "poisson_ratio"))[0])


def triangle_stress(
    vertices: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    poisson_ratio: float,
    load: ArrayLike = (1.0, 1.0, 1.0),
) -> Array:
    """Return the stress below the surface by a linear load on a triangle, ``load`` at its corners.

    The load ends at the edges; on them, at z = 0, some stresses are infinite, and the result is meaningful
    only in a sum over triangles with continuous loads. The result has the shape (..., 3, 6): by the load as a
    pressure, and as a traction along x and y on the body, components as of `pyramid_stress`.
    """
    return _triangle_below(vertices, load, poisson_ratio, x=x, y=y, z=z)[1]


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
    return _triangle_below(vertices, load, poisson_ratio, x=x, y=y, z=z)[0]


def mesh_stress(
    vertices: ArrayLike, tractions: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float
) -> Array:
    """Return the stress below the surface by tractions on any set of triangles, vertices of shape (n, 3, 2).

    The tractions, shape (n, 3, 3), are at each corner the pressure, and the tractions along x and y on the
    body, linear on each triangle. The result has the shape (..., 6), components as of `pyramid_stress`.
    """
    return _mesh_below(vertices, tractions, poisson_ratio, x=x, y=y, z=z)[1]


def mesh_displacement(
    vertices: ArrayLike, tractions: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike, poisson_ratio: float
) -> Array:
    """Return the displacement by tractions on any set of triangles times the shear modulus.

    Arguments as of `mesh_stress`; the result has the shape (..., 3): along x, y, z.
    """
    return _mesh_below(vertices, tractions, poisson_ratio, x=x, y=y, z=z)[0]


def _components(found: Array) -> Array:
    """Return components first, then the axes of the points."""
    return np.ascontiguousarray(np.moveaxis(found, -1, 0))


def _vertices(vertices: ArrayLike) -> Array:
    """Return the corners of a triangle."""
    return reals(vertices, "vertices", (3, 2), ": three points")


def _triangle_below(
    vertices: ArrayLike, load: ArrayLike, poisson_ratio: float, **at: ArrayLike
) -> tuple[Array, Array]:
    """Return displacement and stress by a linear load on a triangle."""
    given = _shaped(vertices, "vertices", (3, 2)), _shaped(load, "load", (3,)), *points(**at)
    found: tuple[Array, Array] = flat.triangle_interior(*given, number(poisson_ratio, "poisson_ratio"))
    return found


def _mesh_below(
    vertices: ArrayLike, tractions: ArrayLike, poisson_ratio: float, **at: ArrayLike
) -> tuple[Array, Array]:
    """Return displacement and stress by tractions on triangles."""
    corners = reals(vertices, "vertices")
    if corners.ndim != 3 or not corners.size:
        raise DeckError(f"vertices: an array of shape {corners.shape}, expected (n, 3, 2): three points each")
    n = len(corners)
    given = _shaped(corners, "vertices", (n, 3, 2)), _shaped(tractions, "tractions", (n, 3, 3)), *points(**at)
    found: tuple[Array, Array] = flat.mesh_interior(*given, number(poisson_ratio, "poisson_ratio"))
    return found


def _shaped(values: ArrayLike, name: str, shape: tuple[int, ...]) -> Array:
    """Return finite numbers of a shape."""
    array = reals(values, name)
    if array.shape != shape or not np.isfinite(array).all():
        raise DeckError(f"{name}: an array of shape {array.shape}, expected finite numbers of shape {shape}")
    return array
