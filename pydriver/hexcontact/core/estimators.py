"""Size and shape of a contact or stick zone from its nodes, and errors of lattices, as the core finds them.

Lattice arrays have shape (n_row, n_col); the neighbors of node (j, i) are (j, i+-1), (j+-1, i), (j+-1, i-+1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import _core
from .contact import raise_for

_api = _core.hc_f2py_measures

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class CircleFit:
    """Circle through the boundary nodes, equations (9.1)-(9.4).

    Parameters
    ----------
    radius : float
        a, mean of the radii r_i = |X_i - X_0| + l_e/2 of the boundary nodes: (9.1), (9.2).
    mean_deviation : float
        E_a = mean |r_i - a| / a (9.3).
    standard_deviation : float
        sigma = sqrt(mean (r_i - a)^2) / a (9.4).
    count : int
        Number of boundary nodes.
    """

    radius: float
    mean_deviation: float
    standard_deviation: float
    count: int


@dataclass(frozen=True)
class Ellipse:
    """An ellipse: semi-axes (m), direction of the major axis from x (rad, in (-pi/2, pi/2]), center (m)."""

    semi_major: float
    semi_minor: float
    angle: float
    center: tuple[float, float]


def boundary(zone: Mask) -> Mask:
    """Nodes of ``zone`` that have a neighbor outside it (or outside the window)."""
    return np.asarray(_api.zone_boundary(zone.T) != 0).T


def boundary_circle(
    x: Array, y: Array, zone: Mask, spacing: float, center: tuple[float, float] = (0.0, 0.0)
) -> CircleFit:
    """Fit a circle to the boundary nodes of a zone as in (9.1)-(9.4).

    Parameters
    ----------
    x, y : ndarray, shape (n_row, n_col)
        Coordinates of the nodes, m.
    zone : ndarray of bool, shape (n_row, n_col)
        Nodes of the zone; not empty.
    spacing : float
        l_e, m.
    center : tuple of float
        X_0, m.

    Returns
    -------
    CircleFit
    """
    numbers, count = _api.circle_of_zone(x.T, y.T, zone.T, spacing, center)
    radius, mean, standard = numbers.tolist()
    return CircleFit(radius, mean, standard, count)


def area_radius(zone: Mask, cell_area: float) -> float:
    """Radius (m) of the circle with as much area as the cells of the nodes in ``zone``; cell area in m^2."""
    return float(_api.radius_of_area(np.count_nonzero(zone), cell_area))


def edge_radius(
    x: Array, y: Array, pressure: Array, spacing: float, center: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Radius at which the pressure vanishes, to a fraction of the spacing.

    Near the edge p^2 is linear in r^2 (p grows like the square root of the distance). A straight line through
    the nodes with a_A - 6 l_e <= r <= a_A - l_e gives the zero; the outermost nodes, which carry most of the
    discretization error, are left out. a_A is the area-equivalent radius.

    Parameters
    ----------
    x, y : ndarray, shape (n_row, n_col)
        Coordinates of the nodes, m.
    pressure : ndarray, shape (n_row, n_col)
        Contact pressure, Pa.
    spacing : float
        l_e, m.
    center : tuple of float
        Center of the contact, m.

    Returns
    -------
    float
        Radius, m; nan if fewer than three nodes are in the band.
    """
    return float(_api.radius_of_pressure(x.T, y.T, pressure.T, spacing, center))


def pressure_center(x: Array, y: Array, pressure: Array) -> tuple[float, float]:
    """Return the centroid of a pressure (m); nan if there is none."""
    along, across = _api.center_of_pressure(x.T, y.T, pressure.T).tolist()
    return along, across


def moment_ellipse(x: Array, y: Array, zone: Mask) -> Ellipse:
    """Ellipse with the second moments of the nodes of a zone (a uniform ellipse has variance a^2/4 along a).

    Parameters
    ----------
    x, y : ndarray, shape (n_row, n_col)
        Coordinates of the nodes, m.
    zone : ndarray of bool, shape (n_row, n_col)
        Nodes of the zone; not empty.

    Returns
    -------
    Ellipse
    """
    return _ellipse(_api.ellipse_of_zone(x.T, y.T, zone.T))


def edge_ellipse(x: Array, y: Array, pressure: Array, spacing: float) -> Ellipse:
    """Ellipse on which the pressure vanishes, to a fraction of the spacing.

    The square of the pressure is a quadratic polynomial near the edge; it is fitted to the nodes between
    1 - 6 l_e/b and 1 - l_e/b of the way from the center to the moment ellipse with the minor semi-axis b.

    Parameters
    ----------
    x, y : ndarray, shape (n_row, n_col)
        Coordinates of the nodes, m.
    pressure : ndarray, shape (n_row, n_col)
        Contact pressure, Pa.
    spacing : float
        l_e, m.

    Returns
    -------
    Ellipse

    Raises
    ------
    ValueError
        If there are fewer than six nodes to fit, or the fit is no ellipse.
    """
    numbers, code, message = _api.ellipse_of_pressure(x.T, y.T, pressure.T, spacing)
    raise_for(code, message)
    return _ellipse(numbers)


def limits_of_error(spacings: Array, values: Array) -> Array:
    """Estimate how far values on the first, finest lattice are from their limit for a vanishing spacing.

    A trend c h^p with p from 1 to 2 and a scatter in proportion to h are fitted: docs/theory/error_bars.md,
    (A1), (A2).

    Parameters
    ----------
    spacings : ndarray, (n,)
        Spacings in units of the first.
    values : ndarray, (n, m)
        m quantities, on each of the lattices.

    Returns
    -------
    ndarray, (m,)
        What hardly any error exceeds; NaN where a value is.
    """
    errors, code, message = _api.errors_of_limits(spacings, values)
    raise_for(code, message)
    return np.asarray(errors)


def _ellipse(numbers: Array) -> Ellipse:
    major, minor, angle, x, y = numbers.tolist()
    return Ellipse(major, minor, angle, (x, y))
