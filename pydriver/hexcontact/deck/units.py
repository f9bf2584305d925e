"""Quantities of decks as floats in SI: ``"3.5 um"``, ``"432 GPa"``, ``"30 deg"``, bare numbers.

Common metric units are scaled here, exactly, by moving the decimal point. Other units, and messages about
units, are left to pint, whose import takes longer than that of all other packages.
"""

from __future__ import annotations

import functools
import math
import re
from decimal import Decimal
from typing import TYPE_CHECKING, Any, NamedTuple

from ..text import listed, shown

if TYPE_CHECKING:
    import pint


class Dimension(NamedTuple):
    """The dimension of a number."""

    name: str  # noun with its article, for messages: "a length"
    unit: str  # the SI unit, spelt for pint; "" for a pure number
    example: str  # example of a value, with quotes
    bare: bool = True  # whether a number without a unit is taken as SI


LENGTH = Dimension("a length", "m", '"1 mm"')
PRESSURE = Dimension("a pressure", "Pa", '"210 GPa"')
FORCE = Dimension("a force", "N", '"10 N"')
TORQUE = Dimension("a torque", "N m", '"2 N mm"')
ANGLE = Dimension("an angle with its unit", "rad", '"30 deg"', bare=False)
NUMBER = Dimension("a number", "", "0.3")
SPIN = Dimension("a spin", "rad/m", '"2 rad/m"')

# Decimal exponents of common units, by the SI unit of their dimension.
_METRIC = {
    "m": {"nm": -9, "um": -6, "µm": -6, "mm": -3, "cm": -2, "m": 0},
    "Pa": {"Pa": 0, "kPa": 3, "MPa": 6, "GPa": 9, "N/mm^2": 6, "N/m^2": 0},
    "N": {"uN": -6, "µN": -6, "mN": -3, "N": 0, "kN": 3, "MN": 6},
    "N m": {
        **{"N um": -6, "N µm": -6, "mN m": -3, "N mm": -3, "N m": 0, "kN mm": 0, "kN m": 3},
        **{"mNm": -3, "Nmm": -3, "Nm": 0, "kNmm": 0, "kNm": 3},
    },
}

_ANGLES = {"deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0, "mrad": 1e-3}

DIGITS = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
"""Pattern of a number without its sign; each digit fits one part of it only, so that it cannot backtrack."""

_QUANTITY = re.compile(rf"(?P<number>[+-]?{DIGITS})\s*(?P<unit>.*)", re.ASCII)
LONGEST = 1000  # characters of a quantity

# Signs and powers as programs for texts write them, and units that pint reads otherwise or not at all.
_SIGNS = str.maketrans("\u2212\u2013\u22c5\u00d7\u00a0\u2009\u202f", "--**   ")
_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_POUNDS = {"lb": "lbf", "lbs": "lbf"}
_SPELLED = {  # by SI unit
    "m": {"mil": "thou", "mils": "thou"},
    "Pa": {"Msi": "Mpsi"},
    "N": _POUNDS,
    "N m": _POUNDS,
}
_PRINTED = {"px", "css_pixel", "point", "points", "pica", "picas", "scaled_point", "didot", "cicero"}
_MOMENT = re.compile(r"([nuµmkMG]?N)(um|µm|mm|cm|m)")
_BRACKETS = re.compile(r"(/ ?)?\(([^()/]*)\)(?! ?[*^])")
_TIMES = re.compile(r" ?(?<!\*)[*·](?!\*) ?|(?<=\w) (?=[^\W\d])")

# Products, quotients and small powers of named units; pint would evaluate other expressions.
_NAME = r"[^\W\d_]+|[%°]|[^\W\d_]*°"
_FACTOR = rf"(?:{_NAME})(?:\s*(?:\*\*|\^)\s*-?\d{{1,2}}(?:\.\d{{1,4}})?)?"
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_FACTOR}(?:\s*[*/·]\s*{_FACTOR}|\s+{_FACTOR})*")
_LONGEST_UNIT = 60


class UnitError(ValueError):
    """An unreadable quantity; the message follows "expected ..."."""


def to_si(value: object, dimension: Dimension) -> float:
    """Return a deck value as a float in SI units."""
    if isinstance(value, str):
        return _from_text(value, dimension)
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        raise UnitError("in Python a quantity with a unit is given as text")
    if isinstance(value, bool) or not hasattr(value, "__float__") or not dimension.bare:
        raise UnitError("")
    try:
        return float(value)
    except (OverflowError, TypeError, ValueError):
        raise UnitError("") from None


def spelled(text: str) -> str:
    """Return a text with the signs and powers of ASCII: -1 for −1, mm^3 for mm³."""
    return re.sub("[⁻⁰¹²³⁴-⁹]+", lambda power: "^" + power[0].translate(_POWERS), text.translate(_SIGNS))


def _plain(unit: str, dimension: Dimension) -> str:
    """Return a unit as a product of names of pint, without brackets: mm^3/N/m for mm^3/(N m)."""
    known = _SPELLED.get(dimension.unit, {})

    def name(word: re.Match[str]) -> str:
        moment = _MOMENT.fullmatch(word[0])
        return f"({moment[1]}*{moment[2]})" if moment else known.get(word[0], word[0])

    def product(group: re.Match[str]) -> str:
        sign = "/" if group[1] else ""
        return sign + _TIMES.sub(sign or "*", group[2].strip())

    unit = re.sub(r"[^\W\d_]+", name, " ".join(unit.split()))
    return _BRACKETS.sub(product, _BRACKETS.sub(product, unit))


def angle_text(value: float) -> str:
    """Write an angle (rad) in degrees if they are read as the same angle, else in radians."""
    degrees = f"{math.degrees(value):.12g}"
    return f"{degrees} deg" if float(degrees) * _ANGLES["deg"] == value else f"{value!r} rad"


def _from_text(text: str, dimension: Dimension) -> float:
    match = _QUANTITY.fullmatch(spelled(text.strip())) if len(text) <= LONGEST else None
    if match is None:
        raise UnitError("")
    number, unit = match["number"], match["unit"]
    if not unit:
        reason = "" if not dimension.bare else "a quoted value needs its unit"
        raise UnitError("write the number without quotes" if dimension is NUMBER else reason)
    if abs(float(number)) == float("inf"):
        raise UnitError("")
    if dimension is ANGLE and unit in _ANGLES:
        return float(number) * _ANGLES[unit]
    exponent = _METRIC.get(dimension.unit, {}).get(unit)
    if exponent is not None:
        return float(Decimal(number).scaleb(exponent))
    return _by_pint(float(number), unit, dimension)


def _by_pint(number: float, unit: str, dimension: Dimension) -> float:
    unknown = UnitError(_unknown(number, unit, dimension))
    if len(unit) > _LONGEST_UNIT or _UNIT.fullmatch(plain := _plain(unit, dimension)) is None:
        raise unknown
    if _PRINTED & set(re.findall(r"\w+", plain)):
        raise UnitError(f'"{unit}" is a size of print and screens')
    registry = _registry()
    try:
        quantity = registry.Quantity(number, plain).to_base_units()
    except Exception:  # pint raises a dozen unrelated types
        raise unknown from None
    # Comparing base units, not dimensionalities, keeps radians apart from pure numbers.
    target = registry.Quantity(1.0, dimension.unit).to_base_units()
    if not _same(quantity.units, target.units):
        raise UnitError(f'"{unit}" is {_describe(quantity)}')
    return float(quantity.magnitude / target.magnitude)


def _unknown(number: float, unit: str, dimension: Dimension) -> str:
    """Return the sentence about an unknown unit, with the one that is meant if it differs little."""
    if decimals := re.match(r",\d+", unit):
        return f"a number has a decimal point: {number:g}.{decimals[0][1:]}"
    alike = [known for known in _METRIC.get(dimension.unit, {}) if known.lower() == unit.lower()]
    power = re.sub(r"(?<=[^\W\d_])(?=\d$)", "^", unit)
    hint = listed(alike, "or") if alike else power if power != unit else ""
    return f"{shown(unit)} is not a known unit" + (f"; did you mean {hint}?" if hint else "")


def _same(units: Any, other: Any) -> bool:
    """Return whether two base units agree, up to rounding in powers such as m^-1.5."""
    left, right = dict(units._units), dict(other._units)
    return left.keys() == right.keys() and all(abs(left[k] - right[k]) < 1e-9 for k in left)


def _describe(quantity: Any) -> str:
    """Return the dimension of a quantity in base units: "a mass", "an area", or its units."""
    for name, unit in _NAMED_UNITS.items():
        if _same(quantity.units, _registry().Quantity(1.0, unit).to_base_units().units):
            return name
    return f"a quantity in {quantity.units:~P}"


_NAMED_UNITS = {
    "a length": "m",
    "an area": "m^2",
    "a volume": "m^3",
    "a mass": "kg",
    "a time": "s",
    "a frequency": "Hz",
    "a velocity": "m/s",
    "an acceleration": "m/s^2",
    "a density": "kg/m^3",
    "a force": "N",
    "a pressure": "Pa",
    "a torque or an energy": "N m",
    "a power": "W",
    "a line load or a stiffness": "N/m",
    "an angle": "rad",
    "a temperature": "K",
    "an electric current": "A",
    "a pure number": "",
}


def readable(length: float) -> str:
    """Return a length (m) with three digits in a suitable unit, for messages: "0.182 mm"."""
    for exponent, unit in ((0, "m"), (-3, "mm"), (-6, "um")):
        if abs(length) >= 0.1 * 10.0**exponent:
            return f"{length * 10.0**-exponent:.3g} {unit}"
    return f"{length * 1e9:.3g} nm"


@functools.cache
def _registry() -> pint.UnitRegistry[float]:
    import pint

    return pint.UnitRegistry()
