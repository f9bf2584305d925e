"""Influence functions: integrals and displacements of triangle loads, kernels of the pyramid.

Points may be arrays of any shapes that broadcast; results have the common shape. z points into the body, and
displacements are those of its surface. Equation and table numbers are those of the dissertation.

Examples
--------
The potential of a unit load at the apex of a pyramid, (3 sqrt(3)/2) ln 3:

>>> from hexcontact.influence import pyramid_kernels
>>> round(float(pyramid_kernels(0.0, 0.0).K1), 6)
2.854278
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, broadcast, integer, number, reals, word
from ..errors import DeckError
from . import _core
from .calls import called
from .influence_below import (
    mesh_displacement,
    mesh_stress,
    pyramid_displacement,
    pyramid_stress,
    triangle_displacement_below,
    triangle_stress,
)

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

_flat = _core.hc_f2py_influence

_DEGREES = {"constant": (0, 0), "linear_x": (1, 0), "linear_y": (0, 1), "bilinear": (1, 1)}
_DIRECTIONS = {"x": 1, "y": 2, "normal": 3}
LOAD_SHAPES = {"point force": 1, "constant on the cell": 2, "pyramid": 3}
"""Distributions of the load on a node."""


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
    area gives 0.

    Parameters
    ----------
    vertices : array_like, shape (3, 2)
        Corners (xi, eta) of the triangle.
    x, y : array_like
        Field points.
    j, k, m : int
        Exponents: j = 1, 2, 3 and k, m >= 0 with 1 <= k + m + 2 - j <= 3.

    Returns
    -------
    ndarray
        Integrals, in the unit of length to the power k + m + 2 - j.

    Raises
    ------
    DeckError
        If an argument is not a finite number, has the wrong shape or is out of range.

    Examples
    --------
    The potential of a unit square at its center is 4 asinh(1):

    >>> square = [(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]
    >>> round(float(sum(triangle_integral(t, 0.5, 0.5, 1, 0, 0) for t in square)), 6)
    3.525494
    """
    exponents = {name: _exponent(value, name) for name, value in (("j", j), ("k", k), ("m", m))}
    return _evaluate(_flat.triangle_integral, x, y, vertices=_vertices(vertices), **exponents)


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
    """Return the displacement by one of the loads of Tables 4.1 and 4.2 on a triangle.

    Parameters
    ----------
    vertices : array_like, shape (3, 2)
        Corners (xi, eta) of the triangle [m].
    x, y : array_like
        Field points [m].
    load : {"constant", "linear_x", "linear_y", "bilinear"}
        Load 1, x - xi, y - eta or (x - xi)(y - eta), in Pa with lengths in m.
    direction : {"normal", "x", "y"}
        Direction of the load; "normal" presses into the body.
    shear_modulus : float
        G of the body [Pa].
    poisson_ratio : float
        nu of the body, in (-1, 0.5].

    Returns
    -------
    Displacement
        Along x, y and z [m].

    Raises
    ------
    DeckError
        If an argument is not a finite number, has the wrong shape or is out of range.
    """
    k, m = _DEGREES[word(load, "load", _DEGREES)]
    components = _evaluate(
        _flat.triangle_displacement,
        x,
        y,
        vertices=_vertices(vertices),
        direction=_DIRECTIONS[word(direction, "direction", _DIRECTIONS)],
        k=k,
        m=m,
        shear_modulus=number(shear_modulus, "shear_modulus"),
        poisson_ratio=number(poisson_ratio, "poisson_ratio"),
    )
    return Displacement(*components)


def linear_load_displacement(
    vertices: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    traction: ArrayLike,
    *,
    shear_modulus: float,
    poisson_ratio: float,
) -> Displacement:
    """Return the displacement by tractions that vary linearly over a triangle.

    Parameters
    ----------
    vertices : array_like, shape (3, 2)
        Corners (xi, eta) of the triangle [m].
    x, y : array_like
        Field points [m].
    traction : array_like, shape (3, 3)
        For each corner the traction along x, along y and into the body [Pa].
    shear_modulus : float
        G of the body [Pa].
    poisson_ratio : float
        nu of the body, in (-1, 0.5].

    Returns
    -------
    Displacement
        Along x, y and z [m].

    Raises
    ------
    DeckError
        If an argument is not a finite number, has the wrong shape or is out of range.
    """
    loads = reals(traction, "traction", (3, 3), ": x, y, z at each corner")
    components = _evaluate(
        _flat.linear_triangle_displacement,
        x,
        y,
        vertices=_vertices(vertices),
        traction=loads.T,
        shear_modulus=number(shear_modulus, "shear_modulus"),
        poisson_ratio=number(poisson_ratio, "poisson_ratio"),
    )
    return Displacement(*components)


def pyramid_kernels(x: ArrayLike, y: ArrayLike) -> PyramidKernels:
    """Return the five kernels of the unit pyramid of the equilateral lattice.

    The pyramid is 1 at the origin and falls linearly to 0 at the hexagon with corners at distance 1 in the
    directions 0, 60, ..., 300 degrees. For a spacing l_e the kernels are l_e K(x/l_e, y/l_e). The error stays
    below 1e-13 of K1, which bounds all five, from 0 to 1e5 spacings.

    Parameters
    ----------
    x, y : array_like
        Field points relative to the node, in spacings.

    Returns
    -------
    PyramidKernels
        K1, Kxx, Kxy, Kx, Ky, in spacings.

    Raises
    ------
    DeckError
        If a coordinate is not a finite number, or the shapes do not broadcast.
    """
    return PyramidKernels(*_evaluate(_flat.pyramid_kernels, x, y))


def pyramid_functions(x: ArrayLike, y: ArrayLike, poisson_ratio: float) -> PyramidFunctions:
    """Return the nine functions C, D, ..., K of Table 8.1.

    Parameters
    ----------
    x, y : array_like
        Field points relative to the node, in spacings.
    poisson_ratio : float
        nu of the body, in (-1, 0.5]; G and K depend on it.

    Returns
    -------
    PyramidFunctions
        C, D, E, F, G, H, I, J, K, in spacings.

    Raises
    ------
    DeckError
        If an argument is not a finite number or out of range, or the shapes do not broadcast.
    """
    nu = number(poisson_ratio, "poisson_ratio")
    if not -1.0 < nu <= 0.5:
        raise DeckError(f"poisson_ratio = {nu:g}: a number above -1 and at most 0.5 expected")
    nu_0 = nu / (1.0 - nu)
    kernels = pyramid_kernels(x, y)
    k1, kxx, kxy, kx, ky = kernels
    return PyramidFunctions(k1, kx, ky, kx, k1 + nu_0 * kxx, kxy, ky, kxy, k1 + nu_0 * kernels.Kyy)


def load_potential(shape: str, x: ArrayLike, y: ArrayLike) -> Array:
    """Return the integral of a load on a node over the distance of points, in spacings."""
    number = LOAD_SHAPES[word(shape, "shape", LOAD_SHAPES)]
    return _evaluate(_flat.potential_of_load, x, y, shape_number=number)


def displacement_errors(shape: str, nodes_in_radius: float, x: ArrayLike, y: ArrayLike) -> Array:
    """Return the error of the displacement when Hertz's pressure at the nodes is spread over the surface."""
    number = LOAD_SHAPES[word(shape, "shape", LOAD_SHAPES)]
    return _evaluate(_flat.errors_of_displacement, x, y, shape_number=number, radius=nodes_in_radius)


def pressure_errors(nodes_in_radius: float) -> tuple[float, float]:
    """Return the largest errors of Hertz's pressure, r < 0.8 a: constant on cells, linear between nodes."""
    constant, linear = _flat.errors_of_pressure(nodes_in_radius).tolist()
    return constant, linear


def _evaluate(procedure: Callable[..., Any], x: ArrayLike, y: ArrayLike, **arguments: Any) -> Array:
    """Evaluate at all points; the result has the shape of one value, then that of the points."""
    px, py = broadcast(x=x, y=y).values()
    # f2py takes no empty arrays; one point serves to check the other arguments
    point = {"x": px.ravel(), "y": py.ravel()} if px.size else {"x": np.zeros(1), "y": np.zeros(1)}
    values = called(procedure, **point, **arguments)
    return np.ascontiguousarray(values[..., : px.size]).reshape(values.shape[:-1] + px.shape)


def _vertices(vertices: ArrayLike) -> Array:
    """Return the corners of a triangle as columns."""
    return reals(vertices, "vertices", (3, 2), ": three points").T


def _exponent(value: int, name: str) -> int:
    """Return an exponent; the core checks its bounds from 0 to 4."""
    if abs(found := integer(value, name)) > 99:
        raise DeckError(f"{name} = {found}: an integer from 0 to 4 expected")
    return found
