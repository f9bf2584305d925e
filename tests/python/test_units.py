"""Quantities in decks: every spelling to SI, and what is said about the wrong ones."""

import contextlib
import math
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexcontact.deck import units
from hexcontact.deck.keys import WEAR_COEFFICIENT as COEFFICIENT
from hexcontact.deck.units import ANGLE, FORCE, LENGTH, NUMBER, PRESSURE, TORQUE, UnitError, angle_text, to_si


@pytest.mark.parametrize(
    ("text", "dimension", "expected"),
    [
        ("1 mm", LENGTH, 1e-3),
        ("3.5um", LENGTH, 3.5e-6),
        ("3.5 µm", LENGTH, 3.5e-6),  # the micro sign
        ("3.5 μm", LENGTH, 3.5e-6),  # the Greek letter
        (" -2e1 nm ", LENGTH, -2e-8),
        ("0.5 inch", LENGTH, 0.0127),
        ("432 GPa", PRESSURE, 432e9),
        ("1 N/mm^2", PRESSURE, 1e6),
        ("1 N/mm**2", PRESSURE, 1e6),
        ("30 ksi", PRESSURE, 30e3 * 4.4482216152605 / 0.0254**2),
        ("31.5 N", FORCE, 31.5),
        ("2 kN", FORCE, 2e3),
        ("10 lbf", FORCE, 44.482216152605),
        ("2 N mm", TORQUE, 2e-3),
        ("2 N*mm", TORQUE, 2e-3),
        ("2 N·mm", TORQUE, 2e-3),
        ("180 deg", ANGLE, math.pi),
        ("0.25 turn", ANGLE, math.pi / 2),
        ("2 mrad", ANGLE, 2e-3),
        ("5 %", NUMBER, 0.05),
        ("2 Nm", TORQUE, 2.0),
        ("2 Nmm", TORQUE, 2e-3),
        ("2 kNm", TORQUE, 2e3),
        ("2 nNm", TORQUE, 2e-9),
        ("1e-5 mm^3/(N m)", COEFFICIENT, 1e-14),
        ("1e-5 mm^3 / (N*m)", COEFFICIENT, 1e-14),
        ("1e-5 mm³/Nm", COEFFICIENT, 1e-14),
        ("1e-5 mm³/(N·m)", COEFFICIENT, 1e-14),
        ("1e-5 mm³N⁻¹m⁻¹".replace("³", "³ ").replace("¹m", "¹ m"), COEFFICIENT, 1e-14),
        ("30 Msi", PRESSURE, 30e6 * 4.4482216152605 / 0.0254**2),
        ("30 psi", PRESSURE, 30 * 4.4482216152605 / 0.0254**2),
        ("10 lbs", FORCE, 44.482216152605),
        ("10 lb", FORCE, 44.482216152605),
        ("1 lb ft", TORQUE, 4.4482216152605 * 0.3048),
        ("2 mil", LENGTH, 50.8e-6),
        ("\u221210 N", FORCE, -10.0),
        ("10\u00a0N", FORCE, 10.0),
        ("1 N/mm²", PRESSURE, 1e6),
        (0.3, NUMBER, 0.3),
        (7, LENGTH, 7.0),
    ],
)
def test_values_become_si(text: object, dimension: units.Dimension, expected: float) -> None:
    assert to_si(text, dimension) == pytest.approx(expected, rel=1e-15, abs=0)


@pytest.mark.parametrize(
    ("value", "dimension", "reason"),
    [
        ("3 kg", LENGTH, '"kg" is a mass'),
        ("3 mm", FORCE, '"mm" is a length'),
        ("3 N", TORQUE, '"N" is a force'),
        ("3 mm^2", LENGTH, '"mm^2" is an area'),
        ("3 deg", NUMBER, '"deg" is an angle'),
        ("3 %", ANGLE, '"%" is a pure number'),
        ("3 m/N", LENGTH, "a quantity in"),
        ("3 furlongz", LENGTH, '"furlongz" is not a known unit'),
        ("3 Mpa", PRESSURE, '"Mpa" is not a known unit; did you mean MPa?'),
        ("3 gpa", PRESSURE, '"gpa" is not a known unit; did you mean GPa?'),
        ("3 N/mm2", PRESSURE, '"N/mm2" is not a known unit; did you mean N/mm^2?'),
        ("3 Mn", FORCE, '"Mn" is not a known unit; did you mean mN or MN?'),
        ("3,5 mm", LENGTH, "a number has a decimal point: 3.5"),
        ("3 mm**9**9**9", LENGTH, "is not a known unit"),  # would keep pint busy for ever
        ("3 mm^999999999", LENGTH, "is not a known unit"),
        ("3 __import__('os')", LENGTH, "is not a known unit"),
        ("3 m; m", LENGTH, "is not a known unit"),
        ("3 (N m)^2", TORQUE, "is not a known unit"),
        ("3 (N m)**2", TORQUE, "is not a known unit"),
        ("3 mm^3/(N/m)", COEFFICIENT, "is not a known unit"),
        ("3 lbs", LENGTH, '"lbs" is a mass'),
        ("3 Nm", FORCE, '"Nm" is a torque or an energy'),
        ("3" + " mm" * 100, LENGTH, "is not a known unit"),
        ("3", LENGTH, "a quoted value needs its unit"),
        ("0.3", NUMBER, "write the number without quotes"),
        ("mm", LENGTH, ""),
        ("three mm", LENGTH, ""),
        ("1e999 mm", LENGTH, ""),
        ("nan mm", LENGTH, ""),
        (30, ANGLE, ""),
        (True, NUMBER, ""),
        (None, LENGTH, ""),
        ([1], LENGTH, ""),
        (10**400, LENGTH, ""),
    ],
)
def test_wrong_values_are_named(value: object, dimension: units.Dimension, reason: str) -> None:
    with pytest.raises(UnitError) as error:
        to_si(value, dimension)
    assert reason in str(error.value)
    assert bool(str(error.value)) == bool(reason)


DIRECT = [
    (dimension, unit)
    for dimension in (LENGTH, PRESSURE, FORCE, TORQUE)
    for unit in units._METRIC[dimension.unit]
]


@pytest.mark.parametrize(("dimension", "unit"), [*DIRECT, *((ANGLE, unit) for unit in units._ANGLES)])
@settings(deadline=None)
@given(number=st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_units_without_pint_agree_with_it(dimension: units.Dimension, unit: str, number: float) -> None:
    by_pint = units._by_pint(number, unit, dimension)
    assert to_si(f"{number!r} {unit}", dimension) == pytest.approx(by_pint, rel=5e-16, abs=1e-320)


@settings(deadline=None)
@given(st.text(max_size=30))
def test_any_text_is_a_quantity_or_a_unit_error(text: str) -> None:
    for dimension in (LENGTH, ANGLE, NUMBER):
        with contextlib.suppress(UnitError):
            assert isinstance(to_si(text, dimension), float)


@pytest.mark.parametrize(
    ("length", "text"),
    [(1.5, "1.5 m"), (1.824e-4, "0.182 mm"), (3.98e-5, "39.8 um"), (2e-10, "0.2 nm"), (0.0, "0 nm")],
)
def test_lengths_in_messages_are_readable(length: float, text: str) -> None:
    assert units.readable(length) == text


def test_pint_is_imported_only_for_unusual_units() -> None:
    script = (
        "import sys; import hexcontact.deck.keys as d; from hexcontact.deck.units import *;"
        "to_si('3 mm', LENGTH), to_si('2 GPa', PRESSURE), to_si('1 kN', FORCE), to_si('3 deg', ANGLE);"
        "to_si('2 N mm', TORQUE);"
        "assert not {'pint', 'scipy', 'xarray', 'matplotlib', 'netCDF4'} & set(sys.modules), 'early import';"
        "to_si('3 inch', LENGTH); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_written_angles_are_read_to_the_same_bits() -> None:
    """In degrees where these are exact: the angle of the equilateral lattice is 60 deg."""
    assert angle_text(math.pi / 3) == "60 deg"
    assert angle_text(-0.3).endswith("rad")
    for degrees in range(-360, 361):
        for angle in (math.radians(degrees), degrees * 0.01234567890123):
            assert to_si(angle_text(angle), ANGLE) == angle
