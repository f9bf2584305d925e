"""Frictionless contacts with a closed solution; those with friction are in `hexcontact.analytic.friction`."""

from .frictionless import (
    AxisymmetricContact,
    EllipticContact,
    axisymmetric,
    cone,
    crossed_cylinders,
    flat_punch,
    hertz_ellipse,
    hertz_sphere,
    power_law,
    rounded_punch,
)

__all__ = [
    "AxisymmetricContact",
    "EllipticContact",
    "axisymmetric",
    "cone",
    "crossed_cylinders",
    "flat_punch",
    "hertz_ellipse",
    "hertz_sphere",
    "power_law",
    "rounded_punch",
]
