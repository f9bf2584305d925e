"""Frictionless contacts with a closed solution; those with friction are in `hexcontact.analytic.friction`."""

from .frictionless import AxisymmetricContact as AxisymmetricContact
from .frictionless import EllipticContact as EllipticContact
from .frictionless import axisymmetric as axisymmetric
from .frictionless import cone as cone
from .frictionless import crossed_cylinders as crossed_cylinders
from .frictionless import flat_punch as flat_punch
from .frictionless import hertz_ellipse as hertz_ellipse
from .frictionless import hertz_sphere as hertz_sphere
from .frictionless import power_law as power_law
from .frictionless import rounded_punch as rounded_punch
