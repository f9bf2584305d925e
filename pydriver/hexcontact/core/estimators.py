"""Size and shape of a contact or stick zone from its nodes, and errors of lattices, by the core.

Lattice arrays have shape (n_row, n_col); the neighbors of node (j, i) are (j, i+-1), (j+-1, i), (j+-1, i-+1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Mask
from . import _core
from .calls import called

_api = _core.hc_f2py_measures


@dataclass(frozen=True)
class CircleFit:
    """Circle through the boundary nodes, equations (9.1)-(9.4)."""

    radius: float
    mean_deviation: float
    standard_deviation: float
    count: int


class Ellipse(NamedTuple):
    """An ellipse: semi-axes (m), direction of the major axis from x (rad, in (-pi/2, pi/2]), center (m)."""

    semi_major: float
    semi_minor: float
    angle: float
    center: tuple[float, float]


def boundary(zone: Mask) -> Mask:
    """Return the nodes of ``zone`` with a neighbor outside it (or outside the window)."""
    return np.asarray(_api.zone_boundary(zone.T) != 0).T


def boundary_circle(
    x: Array, y: Array, zone: Mask, spacing: float, center: tuple[float, float] = (0.0, 0.0)
) -> CircleFit:
    """Fit a circle to the boundary nodes of a zone as in (9.1)-(9.4)."""
    numbers, count = _api.circle_of_zone(x.T, y.T, zone.T, spacing, center)
    radius, mean, standard = numbers.tolist()
    return CircleFit(radius, mean, standard, count)


def area_radius(zone: Mask, cell_area: float) -> float:
    """Return the radius (m) of the circle with the area of the cells of a zone; cell area in m^2."""
    return float(_api.radius_of_area(np.count_nonzero(zone), cell_area))


def edge_radius(
    x: Array, y: Array, pressure: Array, spacing: float, center: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Return the radius at which the pressure vanishes, to a fraction of the spacing.

    Near the edge p^2 is linear in r^2 (p grows like the square root of the distance). A straight line through
    the nodes with a_A - 6 l_e <= r <= a_A - l_e gives the zero; the outermost nodes, which carry most of the
    discretization error, are left out. a_A is the area-equivalent radius.
    """
    return float(_api.radius_of_pressure(x.T, y.T, pressure.T, spacing, center))


def pressure_center(x: Array, y: Array, pressure: Array) -> tuple[float, float]:
    """Return the centroid of a pressure (m); nan if there is none."""
    along, across = _api.center_of_pressure(x.T, y.T, pressure.T).tolist()
    return along, across


def moment_ellipse(x: Array, y: Array, zone: Mask) -> Ellipse:
    """Return the ellipse with the second moments of the nodes of a zone (variance a^2/4 along a)."""
    return _ellipse(_api.ellipse_of_zone(x.T, y.T, zone.T))


def edge_ellipse(x: Array, y: Array, pressure: Array, spacing: float) -> Ellipse:
    """Return the ellipse on which the pressure vanishes, to a fraction of the spacing.

    The square of the pressure is a quadratic polynomial near the edge; it is fitted to the nodes between
    1 - 6 l_e/b and 1 - l_e/b of the way from the center to the moment ellipse with the minor semi-axis b.
    """
    return _ellipse(called(_api.ellipse_of_pressure, x.T, y.T, pressure.T, spacing))


def limits_of_error(
    spacings: Array, values: Array, rough: Mask | None = None, unresolved: Mask | None = None
) -> Array:
    """Estimate the error of values on the first, finest lattice against their limit for a vanishing spacing.

    A trend c h^p with p from 1 to 2 and a scatter in proportion to h are fitted: docs/theory/error_bars.md,
    (A1) to (A3).
    """
    rough, unresolved = (
        np.zeros(values.shape[1], dtype=bool) if mask is None else mask for mask in (rough, unresolved)
    )
    return np.asarray(called(_api.errors_of_limits, spacings, values, rough, unresolved))


def unresolved_slip_zones(
    spacing: float, contact_area: Array, stick_area: Array, max_traction: Array, max_pressure: Array
) -> Mask:
    """Test whether the slip zones of load steps are narrower than the lattice resolves."""
    areas, tractions = (contact_area, stick_area), (max_traction, max_pressure)
    return np.asarray(called(_api.unresolved_slip_zones, spacing, *areas, *tractions)) != 0


NO_VALUE = 0.65  # the largest expected error of a lattice: the quantity may be wrong altogether
LATTICE_ERRORS = ("max_pressure", "contact_area", "stick_area", "dissipated_energy")


def expected_lattice_errors(spacings: float, load_ratio: float, goal: float) -> tuple[Array, float]:
    """Estimate the largest relative errors of a lattice; docs/theory/expected_errors.md, (X1), (X2)."""
    errors, needed = _core.hc_f2py_steps.errors_of_lattice(spacings, load_ratio, goal)
    return np.asarray(errors), float(needed)


def expected_entry_error(
    before: Array, after: Array, stick: float, load_ratio: float | None, goal: float
) -> tuple[float, float, float]:
    """Estimate the error of the shear tractions by nodes that enter a growing contact, (X3)-(X5)."""
    ratio = -1.0 if load_ratio is None else load_ratio
    steps, error, needed = _core.hc_f2py_steps.errors_of_entry(
        before, after, min(stick, np.finfo(float).max), ratio, goal
    )
    return float(error), float(steps), float(needed)


def expected_turning_error(shear: Array) -> float:
    """Estimate the error of the dissipated energy by load steps in which the tangential load turns, (X6)."""
    return float(_core.hc_f2py_steps.error_of_turns(shear.T)) if len(shear) else 0.0


def slip_ring(load_ratio: float) -> float:
    """Return the width of the slip ring over the contact radius, 1 - (1 - Q/mu P)^(1/3)."""
    return float(_core.hc_f2py_steps.width_of_ring(load_ratio))


def _ellipse(numbers: Array) -> Ellipse:
    major, minor, angle, x, y = numbers.tolist()
    return Ellipse(major, minor, angle, (x, y))
