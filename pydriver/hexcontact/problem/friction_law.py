"""The law of friction of a problem: its coefficients, its bound, and the limit of the interface."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from .. import netcdf_library
from ..arrays import has_entries
from ..core import memory
from ..core.friction import FrictionLaw
from ..core.lattice import Lattice
from ..deck.interface import Friction, Interface, NodalCoefficient, TwoCoefficients
from ..errors import DeckError
from ..files import reading
from .height_map import HeightMap
from .plane_field import COEFFICIENT, PlaneField, given_field

_NAME = COEFFICIENT.key
_MOST_POINTS = 1_000_000  # of a map, which is text in the deck of a result


def given_coefficient(coefficient: Any, lattice: Lattice | None) -> Any:
    """Return a coefficient from Python as in a deck: a number, a text, or a `NodalCoefficient`."""
    if isinstance(coefficient, str | dict) or not (callable(coefficient) or has_entries(coefficient)):
        return coefficient
    return NodalCoefficient(_of_few_points(given_field(coefficient, COEFFICIENT, lattice)))


class FrictionField:
    """Friction over the plane, by the tables [friction] and [interface] of a deck.

    Attributes
    ----------
    varies : bool
        Whether it differs from node to node.
    in_deck : object
        Value in a deck that needs no file: a map has its points and values.
    """

    def __init__(self, friction: Friction | None, interface: Interface | None = None) -> None:
        mu: Any = friction.coefficient if friction else 0.0
        numbers = friction.numbers if friction else {}
        if friction is None and interface and (limit := interface.friction_limit):
            mu, numbers["power"] = limit
        if isinstance(mu, TwoCoefficients):
            mean = math.sqrt(mu.along * mu.across)
            numbers |= {"ratio": mu.along / mu.across, "angle": mu.angle}
            # the longer half-axis ends at the limit, and the ellipse shrinks as a whole
            numbers["shear_limit"] = numbers.get("shear_limit", math.inf) * mean / max(mu.along, mu.across)
            mu = mean
        self._numbers = numbers
        self._coefficient = mu
        self.varies = isinstance(mu, NodalCoefficient)
        self.in_deck = mu
        if isinstance(mu, NodalCoefficient):
            source: Any = mu.source
            if isinstance(source, Path):
                source = _read_map(source)
            elif isinstance(source, tuple):
                x, y, values = source
                source = HeightMap(x, y, values, _NAME, COEFFICIENT.degree)
            self._coefficient = PlaneField(source, COEFFICIENT)
            self.in_deck = mu.in_deck
            if grid := self._coefficient.map:
                self.in_deck = {"x": grid.x.tolist(), "y": grid.y.tolist(), "values": grid.gap.tolist()}

    def over(self, lattice: Lattice) -> FrictionLaw:
        """Return the law at the nodes of a window."""
        mu = self._coefficient
        return FrictionLaw(mu.over(lattice) if isinstance(mu, PlaneField) else mu, **self._numbers)


def _read_map(path: Path) -> Any:
    """Read a map: the only variable of a netCDF file that has the coordinates x and y."""
    try:
        with reading(path, "a map in netCDF"), netcdf_library.opened_by_xarray(path) as dataset:
            maps = [v for v in dataset.data_vars.values() if {"x", "y"} <= set(v.coords)]
            if len(maps) != 1:
                raise DeckError(
                    f"expected one variable with the coordinates x and y in {path}, not {len(maps)}"
                )
            # the values, their spline, and copies of both
            memory.require(8 * 8 * maps[0].size, f"the map {path}", "choose a coarser one")
            return _of_few_points(HeightMap.of(maps[0].load(), _NAME, COEFFICIENT.dimension, 1))
    except FileNotFoundError:
        raise DeckError(f"{_NAME}: there is no file {path}") from None
    except DeckError as error:
        raise DeckError(f"{_NAME}: {str(error).removeprefix(f'{_NAME}: ')}") from None


def _of_few_points(source: Any) -> Any:
    """Return a field; refuse a map of more points than the deck of a result can hold."""
    if isinstance(source, HeightMap) and source.gap.size > _MOST_POINTS:
        raise DeckError(
            f"{_NAME}: expected a map of at most {_MOST_POINTS:,} points, not {source.gap.size:,}"
        )
    return source
