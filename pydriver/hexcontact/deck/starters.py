"""Starter decks: what ``hexcontact new NAME`` writes."""

from __future__ import annotations

from typing import NamedTuple

_BODIES = """
[body.1]                          # fills z > 0
young_modulus = "210 GPa"
poisson_ratio = 0.3
{surface}

[body.2]                          # fills z < 0; flat, since it has no surface of its own
young_modulus = "70 GPa"
poisson_ratio = 0.33
"""

_RIGID = """
[body.1]                          # the punch
rigid = true
{surface}

[body.2]                          # flat, since it has no surface of its own
young_modulus = "70 GPa"
poisson_ratio = 0.33
"""

_CROSSED = """
[body.1]                          # fills z > 0
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "cylinder", radius = "75 mm" }                    # axis along x

[body.2]                          # fills z < 0
young_modulus = "70 GPa"
poisson_ratio = 0.33
surface = { shape = "cylinder", radius = "50 mm", angle = "60 deg" }  # axis 60 degrees from x
"""

_DECK = """# {about}
# Numbers carry their unit; bare numbers are SI. All keys: docs/deck.md.
# Check it with "hexcontact check {name}.toml", run it with "hexcontact run {name}.toml".
title = "{title}"
{bodies}{friction}
[grid]
{fineness:<33} {comment}
# extent = ["2 mm", "2 mm"]       # the window fits itself to the contact; this fixes it

# [solver]                        # these are the defaults
# method = "auto"                 # or direct, fft
# tolerance = 1e-8

# [accuracy]                      # refines the lattice; every number then has an error bar
# target = 0.01

[[load]]                          # add more [[load]] tables for a history
{load}
{steps}
# [output]
# file = "{name}.nc"
# fields = ["pressure", "gap", "zone"]
"""

_FRICTION = """
[friction]
coefficient = 0.3                 # inf: no slip; without this table the contact is frictionless
"""

_SMOOTH = "nodes_in_radius = 20"
_SMOOTH_COMMENT = "# spacings in the contact radius; or spacing, or nodes_across"
_SHARP = "nodes_in_radius = 40"
_SHARP_COMMENT = "# the pressure is singular: the finer, the higher its peak"


class _Starter(NamedTuple):
    """What a starter deck fills into the common frame."""

    about: str
    title: str
    bodies: str
    surface: str
    load: str
    steps: int = 1
    sharp: bool = False
    friction: str = ""


_STARTERS = {
    "sphere": _Starter(
        "A sphere pressed on a flat: Hertz's contact.",
        "Sphere on flat",
        _BODIES,
        'surface = { shape = "sphere", radius = "10 mm" }',
        'normal_load = "100 N"             # or approach = "5 um"\n'
        'ramp = "cubic"                    # the contact radius grows evenly; without it, the load does',
        steps=5,
    ),
    "fretting": _Starter(
        "A sphere pressed on a flat, then sheared to and fro: stick, slip and a loop of force over shift.",
        "Sphere on flat, pressed and sheared",
        _BODIES,
        'surface = { shape = "sphere", radius = "10 mm" }',
        'normal_load = "100 N"\n'
        "steps = 5\n"
        'label = "press"\n'
        "\n"
        "[[load]]\n"
        "repeat = 1                        # turns\n"
        "path = [                          # friction carries up to 0.3 x 100 N\n"
        '  { tangential_load_x = "24 N", steps = 8, label = "to" },      # or shift_x = "1 um"\n'
        '  { tangential_load_x = "-24 N", steps = 12, label = "fro" },\n'
        '  { tangential_load_x = "24 N", steps = 12, label = "back" },\n'
        "]",
        steps=0,
        friction=_FRICTION,
    ),
    "paraboloid": _Starter(
        "A surface with two radii of curvature on a flat: Hertz's elliptic contact.",
        "Paraboloid on flat",
        _BODIES,
        'surface = { shape = "paraboloid", radius_x = "40 mm", radius_y = "10 mm", angle = "20 deg" }',
        'normal_load = "100 N"             # or approach = "5 um"',
    ),
    "crossed_cylinders": _Starter(
        "Two cylinders whose axes cross at an angle: an elliptic contact.",
        "Crossed cylinders",
        _CROSSED,
        "",
        'normal_load = "1 kN"              # or approach = "10 um"',
    ),
    "punch": _Starter(
        "A rigid flat punch on an elastic body.",
        "Flat punch",
        _RIGID,
        'surface = { shape = "punch", radius = "1 mm" }',
        'approach = "1 um"                 # or normal_load = "150 N"',
        sharp=True,
    ),
    "rounded_punch": _Starter(
        "A rigid flat punch with rounded edges on an elastic body.",
        "Rounded punch",
        _RIGID,
        'surface = { shape = "rounded_punch", flat_radius = "1 mm", edge_radius = "5 mm" }',
        'normal_load = "500 N"             # or approach = "3 um"',
    ),
    "cone": _Starter(
        "A rigid blunt cone on an elastic body.",
        "Cone on flat",
        _RIGID,
        'surface = { shape = "cone", slope = 0.01 }',
        'normal_load = "10 N"              # or approach = "1 um"',
        sharp=True,
    ),
    "power": _Starter(
        "A body of revolution with the profile C r^n on a flat.",
        "Power-law profile on flat",
        _BODIES,
        'surface = { shape = "power", exponent = 4, coefficient = "0.01 mm^-3" }',
        'normal_load = "500 N"             # or approach = "5 um"',
    ),
}


def names() -> tuple[str, ...]:
    """Return the names of the starter decks."""
    return tuple(_STARTERS)


def text(name: str) -> str:
    """Return a starter deck.

    Parameters
    ----------
    name : str
        One of `names`.

    Raises
    ------
    KeyError
        If there is no such starter.
    """
    starter = _STARTERS[name]
    return _DECK.format(
        name=name,
        about=starter.about,
        title=starter.title,
        bodies=starter.bodies.replace("{surface}", starter.surface),
        fineness=_SHARP if starter.sharp else _SMOOTH,
        comment=_SHARP_COMMENT if starter.sharp else _SMOOTH_COMMENT,
        load=starter.load,
        steps=f"steps = {starter.steps}\n" if starter.steps else "",
        friction=starter.friction,
    )
