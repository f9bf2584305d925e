"""Shapes of surfaces, arguments of bodies, and measured ones.

A shape has a height over the plane z = 0, measured away from the other body: zero where the shape would first
touch a flat, and infinite where it has no surface that could touch.
"""

from .deck.measured import Map, Profile
from .deck.rough import Rough
from .deck.separation import Separation, principal_curvatures
from .deck.surfaces import (
    SHAPES,
    Cone,
    Cylinder,
    Dent,
    Ellipsoid,
    Flat,
    FormulaSurface,
    Paraboloid,
    Power,
    Punch,
    RectangularPunch,
    Roller,
    RoundedPunch,
    Sphere,
    Surface,
    SurfaceSum,
    Torus,
    Waviness,
    shape,
)

__all__ = [
    "SHAPES",
    "Cone",
    "Cylinder",
    "Dent",
    "Ellipsoid",
    "Flat",
    "FormulaSurface",
    "Map",
    "Paraboloid",
    "Power",
    "Profile",
    "Punch",
    "RectangularPunch",
    "Roller",
    "Rough",
    "RoundedPunch",
    "Separation",
    "Sphere",
    "Surface",
    "SurfaceSum",
    "Torus",
    "Waviness",
    "principal_curvatures",
    "shape",
]
