"""Size and shape of a contact or stick zone from its nodes.

Lattice arrays have shape (n_row, n_col); the neighbors of node (j, i) are (j, i+-1), (j+-1, i), (j+-1, i-+1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NEIGHBORS = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, -1), (-1, 1))


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
    padded = np.pad(zone, 1)
    n_row, n_col = zone.shape
    surrounded = np.ones(zone.shape, dtype=bool)
    for row, col in _NEIGHBORS:
        surrounded &= padded[1 + row : 1 + row + n_row, 1 + col : 1 + col + n_col]
    return zone & ~surrounded


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
    rim = boundary(zone)
    radii = np.hypot(x[rim] - center[0], y[rim] - center[1]) + 0.5 * spacing
    radius = float(radii.mean())
    off = (radii - radius) / radius
    return CircleFit(radius, float(np.abs(off).mean()), float(np.sqrt(np.mean(off**2))), int(radii.size))


def area_radius(zone: Mask, cell_area: float) -> float:
    """Radius (m) of the circle with as much area as the cells of the nodes in ``zone``; cell area in m^2."""
    return float(np.sqrt(np.count_nonzero(zone) * cell_area / np.pi))


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
    r2 = (x - center[0]) ** 2 + (y - center[1]) ** 2
    around = area_radius(pressure > 0.0, np.sqrt(0.75) * spacing**2)
    inner, outer = max(around - 6.0 * spacing, 0.0), around - spacing
    band = (pressure > 0.0) & (r2 >= inner**2) & (r2 <= outer**2)
    if outer <= 0.0 or np.count_nonzero(band) < 3:
        return float("nan")
    scale, peak = around**2, pressure.max()
    slope, start = np.polyfit(r2[band] / scale, (pressure[band] / peak) ** 2, 1)
    return float(np.sqrt(-start / slope * scale)) if slope < 0.0 < start else float("nan")


def pressure_center(x: Array, y: Array, pressure: Array) -> tuple[float, float]:
    """Return the centroid of a pressure (m); nan if there is none."""
    total = float(pressure.sum())
    if not total > 0.0:
        return float("nan"), float("nan")
    return float((pressure * x).sum()) / total, float((pressure * y).sum()) / total


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
    points = np.stack([x[zone], y[zone]])
    center = points.mean(axis=1)
    variance, axes = np.linalg.eigh(np.cov(points, bias=True))
    minor, major = 2.0 * np.sqrt(np.maximum(variance, 0.0))
    return Ellipse(float(major), float(minor), _angle(axes[:, 1]), (float(center[0]), float(center[1])))


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
    around = moment_ellipse(x, y, pressure > 0.0)
    x0, y0 = around.center
    cosine, sine = np.cos(around.angle), np.sin(around.angle)
    u = ((x - x0) * cosine + (y - y0) * sine) / around.semi_major
    v = ((y - y0) * cosine - (x - x0) * sine) / around.semi_minor
    way, ring = np.hypot(u, v), spacing / around.semi_minor
    band = (pressure > 0.0) & (way >= 1.0 - 6.0 * ring) & (way <= 1.0 - ring)
    u, v, p2 = u[band], v[band], (pressure[band] / pressure.max()) ** 2
    if u.size < 6:
        raise ValueError("too few nodes in contact to fit an ellipse to the pressure")
    forms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    c = np.linalg.lstsq(forms, p2, rcond=None)[0]
    # back to metres: p2 = start + slope . r + r . form . r
    turn = np.array([[cosine, sine], [-sine, cosine]]) / np.array([[around.semi_major], [around.semi_minor]])
    form = turn.T @ np.array([[c[3], 0.5 * c[4]], [0.5 * c[4], c[5]]]) @ turn
    slope = turn.T @ c[1:3]
    middle = -0.5 * np.linalg.solve(form, slope)
    top = c[0] + 0.5 * slope @ middle
    curvature, axes = np.linalg.eigh(-form / top)
    if not (top > 0.0 and curvature[0] > 0.0):
        raise ValueError("the pressure does not vanish on an ellipse")
    major, minor = 1.0 / np.sqrt(curvature)
    center = float(x0 + middle[0]), float(y0 + middle[1])
    return Ellipse(float(major), float(minor), _angle(axes[:, 0]), center)


def _angle(axis: Array) -> float:
    """Direction of an axis (rad) from x; it has no sense, so it is in (-pi/2, pi/2]."""
    return float(np.pi / 2 - (np.pi / 2 - np.arctan2(axis[1], axis[0])) % np.pi)
