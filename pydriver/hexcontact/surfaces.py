"""Shapes of surfaces, arguments of bodies, and measured ones.

A shape has a height over the plane z = 0, measured away from the other body: zero where the shape would first
touch a flat, and infinite where it has no surface that could touch.
"""

from .deck.measured import Map as Map
from .deck.measured import Profile as Profile
from .deck.rough import Rough as Rough
from .deck.separation import Separation as Separation
from .deck.separation import principal_curvatures as principal_curvatures
from .deck.surfaces import SHAPES as SHAPES
from .deck.surfaces import Cone as Cone
from .deck.surfaces import Cylinder as Cylinder
from .deck.surfaces import Dent as Dent
from .deck.surfaces import Ellipsoid as Ellipsoid
from .deck.surfaces import Flat as Flat
from .deck.surfaces import FormulaSurface as FormulaSurface
from .deck.surfaces import Paraboloid as Paraboloid
from .deck.surfaces import Power as Power
from .deck.surfaces import Punch as Punch
from .deck.surfaces import RectangularPunch as RectangularPunch
from .deck.surfaces import Roller as Roller
from .deck.surfaces import RoundedPunch as RoundedPunch
from .deck.surfaces import Sphere as Sphere
from .deck.surfaces import Surface as Surface
from .deck.surfaces import SurfaceSum as SurfaceSum
from .deck.surfaces import Torus as Torus
from .deck.surfaces import Waviness as Waviness
from .deck.surfaces import shape as shape

__all__ = [name for name in dir() if not name.startswith("_")]
