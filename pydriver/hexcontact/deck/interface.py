"""The tables [interface] and [friction] of a deck: laws of contact and of friction, and their values."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from pydantic_core import PydanticCustomError

from ..errors import DeckError
from ..text import listed, quantity
from .kinds import Kind, PowerCoefficient, Quantity, Schema, Word, formula_over_plane, refuse
from .measured import CoefficientMap
from .table_base import Conflicts, Table, meaning
from .units import ANGLE, NUMBER, PRESSURE, Dimension, UnitError, angle_text, to_si

FROM_PYTHON = "python"  # in the deck of a case with a coefficient from Python
_GRID = ("x", "y", "values")
_OF_MAP = ("variable", "units", "extent", "spacing", "center", "first_row")


@dataclass(frozen=True)
class NodalCoefficient:
    """A coefficient of friction that differs from node to node."""

    # a function of x and y (m), values over the nodes of a window, or points of a map and values
    source: Any = field(compare=False)
    in_deck: Any = FROM_PYTHON  # value in a deck

    def __str__(self) -> str:
        """Return the text of a deck; of a map only its size."""
        if not isinstance(self.in_deck, dict):
            return str(self.in_deck)
        if "map" in self.in_deck:
            return f'{{ map = "{self.in_deck["map"]}" }}'
        return f"by a map of {len(self.in_deck['x'])} x {len(self.in_deck['y'])} points"


@dataclass(frozen=True)
class TwoCoefficients:
    """Coefficients of friction along a direction and across it, and its angle (rad) from x."""

    along: float
    across: float
    angle: float = 0.0

    def __str__(self) -> str:
        """Return both coefficients in words."""
        return f"{self.along:g} along {math.degrees(self.angle):.6g} deg from x, {self.across:g} across it"


class FrictionKind(Kind):
    """A number, two of them with a direction, a formula of x and y in meters, or a map."""

    kind = Quantity(NUMBER, at_least=0, infinite=True)

    expected = (
        f'{kind.expected}, {{ map = "mu.nc" }}, {{ along = 0.3, across = 0.2, angle = "30 deg" }}, '
        'or a formula of x and y in m such as "0.3 + 0.1*tanh(x/50e-6)"'
    )

    def written(self, value: float | NodalCoefficient | TwoCoefficients) -> Any:
        """Return the number, text or table of a deck."""
        if isinstance(value, TwoCoefficients):
            return {"along": value.along, "across": value.across, "angle": angle_text(value.angle)}
        return value.in_deck if isinstance(value, NodalCoefficient) else value

    def _parse(self, value: object) -> float | NodalCoefficient | TwoCoefficients:
        if isinstance(value, NodalCoefficient | TwoCoefficients):
            return value
        if isinstance(value, Mapping):
            return self._of_table(value)
        if not isinstance(value, str):
            return self.kind.parse(value)
        with contextlib.suppress(UnitError):  # a text that is a number, such as a share in percent
            return self.kind.parse(to_si(value, NUMBER))
        if value == FROM_PYTHON:
            refuse("the coefficient was given in Python and is not in the deck; run the script it came from")
        return NodalCoefficient(formula_over_plane(value, self.expected), value)

    def _of_table(self, value: Mapping[str, Any]) -> Any:
        """Return two coefficients, the name of a map, or a map from a table."""
        keys, name = set(value), value.get("map")
        if "map" in keys and isinstance(name, str) and name:
            if others := sorted(map(str, keys - {"map", *_OF_MAP})):
                refuse(f"expected beside map only {listed(_OF_MAP, 'and')}, not {listed(others, 'and')}")
            given = {"file": name} | {str(key): value[key] for key in keys - {"map"}}
            try:
                read = CoefficientMap(**given)
            except DeckError as error:
                raise (error.__cause__ or error) from None
            return NodalCoefficient(read.points[:3], dict(value))
        if keys == set(_GRID):
            with contextlib.suppress(TypeError, ValueError):
                x, y, values = (np.asarray(value[key], float) for key in _GRID)
                if x.ndim == y.ndim == 1 and values.shape == (x.size, y.size):
                    return NodalCoefficient((x, y, values), dict(value))
            refuse("expected numbers x and y (m), and values, an array over y for each x")
        if {"along", "across"} <= keys <= {"along", "across", "angle"}:
            number = Quantity(NUMBER, above=0)
            try:
                along, across = (number.parse(value[key]) for key in ("along", "across"))
                angle = Quantity(ANGLE).parse(value["angle"]) if "angle" in value else 0.0
            except PydanticCustomError as error:
                refuse(f"expected {self.expected}; {error.message()}")
            return along if along == across else TwoCoefficients(along, across, angle)
        refuse(f"expected {self.expected}")

    @property
    def schema(self) -> Schema:  # type: ignore[override]
        """A number, a formula, or one of the tables."""
        file = {"type": "string", "description": "file of numbers over x and y"}
        keys_of_map = CoefficientMap.json_keys()
        above = {"type": "number", "exclusiveMinimum": 0}
        numbers = {"type": "array", "items": {"type": "number"}}
        two = {
            "along": above | {"description": "coefficient along a direction"},
            "across": above | {"description": "coefficient across it"},
            "angle": {"type": "string", "description": "angle of the direction from x, with its unit"},
        }
        grid = {
            "x": numbers | {"description": "places along x, m"},
            "y": numbers | {"description": "places along y, m"},
            "values": {"type": "array", "items": numbers, "description": "coefficients, over y for each x"},
        }
        of_file = {"map": file} | {key: keys_of_map[key] for key in _OF_MAP}
        tables = [(of_file, ["map"]), (two, ["along", "across"]), (grid, list(_GRID))]
        objects = [
            {"type": "object", "properties": keys, "required": needed, "additionalProperties": False}
            for keys, needed in tables
        ]
        description = self.expected[0].upper() + self.expected[1:]
        kinds = [{"type": "number", "minimum": 0}, {"type": "string"}, *objects]
        return {"anyOf": kinds, "description": description}


def stiffness(exponent: float) -> Dimension:
    """Return the dimension of a pressure over a power of the penetration."""
    unit = "Pa/m" + f"^{exponent:g}" * (exponent != 1)
    return Dimension(f"a coefficient in {unit}", unit, f'"1e15 {unit}"')


_Stiffness = Annotated[float, PowerCoefficient("Pa/m^m", stiffness, "exponent")]
_FrictionStiffness = Annotated[float, PowerCoefficient("Pa/m^m", stiffness, "friction_exponent", "exponent")]


class Interface(Table):
    """A compliant layer between the bodies, such as roughness: they penetrate each other."""

    law: Annotated[str, Word(("power",))] = meaning(
        "power", "power: p = c ψ^m under the penetration ψ (Oden and Martins)"
    )
    exponent: Annotated[float, Quantity(NUMBER, at_least=1, at_most=20)] = meaning(
        1.0, "exponent m of the normal compliance", "2"
    )
    coefficient: _Stiffness = meaning(..., "coefficient c of the normal compliance", '"1e15 Pa/m^2"')
    friction_exponent: Annotated[float, Quantity(NUMBER, above=0, at_most=20)] | None = meaning(
        None, "exponent m_t of its own friction limit; `exponent` if absent", "2.5"
    )
    friction_coefficient: _FrictionStiffness | None = meaning(
        None,
        "coefficient c_t of its own friction limit, ❘q❘ ≤ c_t ψ^m_t, instead of [friction]; none if absent",
        '"3e14 Pa/m^2"',
    )
    tangential_stiffness: Annotated[float, Quantity(stiffness(1.0), above=0, any_size=True)] | None = meaning(
        None, "stiffness k_T of tangential springs in series with the slip; none if absent", '"1e14 Pa/m"'
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Refuse the exponent of an absent friction limit."""
        if "friction_exponent" in data and "friction_coefficient" not in data:
            yield "friction_exponent", "expected nothing, or a friction_coefficient, too"

    @property
    def normal_law(self) -> tuple[float, float, float]:
        """Coefficient and exponent of the normal compliance, tangential stiffness (0 if absent)."""
        return self.coefficient, self.exponent, self.tangential_stiffness or 0.0

    @property
    def friction_limit(self) -> tuple[float, float] | None:
        """Factor and power k of the pressure in its own friction limit, c_t c^-k p^k with k = m_t/m."""
        if self.friction_coefficient is None:
            return None
        power = (self.friction_exponent or self.exponent) / self.exponent
        return self.friction_coefficient * self.coefficient**-power, power


class Friction(Table):
    """Coulomb friction, everywhere the same or not, and a bound of the shear traction."""

    coefficient: Annotated[float | NodalCoefficient | TwoCoefficients, FrictionKind()] = meaning(
        ...,
        "coefficient of friction μ; inf: no slip; two with a direction; a formula of x and y in m; or a map",
        "0.3",
    )
    shear_limit: Annotated[float, Quantity(PRESSURE, above=0)] | None = meaning(
        None, "bound of the shear traction, ❘q❘ ≤ min(μp, limit); none if absent", '"300 MPa"'
    )

    @property
    def numbers(self) -> dict[str, float]:
        """Numbers of the law besides its coefficient, by their names in `core.friction.FrictionLaw`."""
        return {} if self.shear_limit is None else {"shear_limit": self.shear_limit}

    def __str__(self) -> str:
        """Return the law in words."""
        mu = self.coefficient
        if isinstance(mu, NodalCoefficient):
            law = f"coefficient {mu}" if mu.in_deck != FROM_PYTHON else "coefficient by node"
            law += ", bilinear" * isinstance(mu.in_deck, dict)
        elif isinstance(mu, TwoCoefficients):
            law = f"coefficients {mu}"
        else:
            law = f"coefficient {mu:g}" if self.numbers or mu != math.inf else "no slip (coefficient inf)"
        if self.shear_limit is not None:
            law += f", shear traction of at most {quantity(self.shear_limit, 'Pa')}"
        return law


def coulomb(friction: Friction | None, interface: Interface | None) -> float | None:
    """Return the coefficient of friction; NaN if it is not the whole law; None without friction."""
    if friction is None:
        return math.nan if interface and interface.friction_limit else None
    mu = friction.coefficient
    return mu if isinstance(mu, float) and not (mu and friction.numbers) else math.nan
