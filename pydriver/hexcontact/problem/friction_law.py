"""Friction at the nodes: one coefficient, two, or one that varies; a bound; a limit of the interface."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import netcdf_library
from ..arrays import has_entries
from ..core import memory
from ..core.contact import shaped
from ..core.friction import FrictionLaw
from ..core.lattice import Lattice
from ..deck.interface import Friction, Interface, NodalCoefficient, TwoCoefficients
from ..deck.units import NUMBER
from ..errors import DeckError
from ..files import reading
from .height_map import HeightMap

_NAME = "friction.coefficient"
_MOST_POINTS = 1_000_000  # of a map, which is text in the deck of a result


def given_coefficient(coefficient: Any, lattice: Lattice | None) -> Any:
    """Return a coefficient from Python as in a deck: a number, a text, or a `NodalCoefficient`."""
    if callable(coefficient):
        return NodalCoefficient(coefficient)
    coordinates = getattr(coefficient, "coords", {})
    if {"x", "y"} <= set(coordinates) and coordinates["x"].ndim == coordinates["y"].ndim == 1:
        return NodalCoefficient(_map_of(coefficient))
    if isinstance(coefficient, str | dict) or not has_entries(coefficient):
        return coefficient
    if lattice is None:
        raise DeckError(
            "friction_coefficient: an array needs lattice=..., at whose nodes it is given, or coordinates x "
            "and y (m), as an xarray.DataArray"
        )
    return NodalCoefficient(shaped(coefficient, lattice, "friction_coefficient").copy())


class FrictionField:
    """Friction over the plane.

    Parameters
    ----------
    friction : Friction or None
        The table of the deck; None: no friction, or that of the interface.
    interface : Interface or None
        The table of the interface, which may have its own limit.

    Attributes
    ----------
    varies : bool
        Whether it differs from node to node.
    in_deck : object
        Value in a deck that needs no file: a map has its points and values.
    """

    def __init__(self, friction: Friction | None, interface: Interface | None = None) -> None:
        mu: Any = friction.coefficient if friction else 0.0
        numbers: dict[str, float] = {}
        if friction is None and interface and (limit := interface.friction_limit):
            mu, numbers["power"] = limit
        if friction and friction.shear_limit is not None:
            numbers["shear_limit"] = friction.shear_limit
        if isinstance(mu, TwoCoefficients):
            mean = math.sqrt(mu.along * mu.across)
            numbers |= {"ratio": mu.along / mu.across, "angle": mu.angle}
            # the longer half-axis ends at the limit, and the ellipse shrinks as a whole
            numbers["shear_limit"] = numbers.get("shear_limit", math.inf) * mean / max(mu.along, mu.across)
            mu = mean
        self._numbers = numbers
        self.varies = isinstance(mu, NodalCoefficient)
        self._source: Any = mu.source if isinstance(mu, NodalCoefficient) else mu
        if isinstance(self._source, Path):
            self._source = _read_map(self._source)
        elif isinstance(self._source, tuple):
            x, y, values = self._source
            self._source = HeightMap(x, y, values, _NAME, degree=1)
        self.in_deck = mu.in_deck if isinstance(mu, NodalCoefficient) else mu
        if isinstance(self._source, HeightMap):
            grid = self._source
            self.in_deck = {"x": grid.x.tolist(), "y": grid.y.tolist(), "values": grid.gap.tolist()}

    def over(self, lattice: Lattice) -> FrictionLaw:
        """Return the law at the nodes of a window."""
        if not self.varies:
            return FrictionLaw(self._source, **self._numbers)
        source: Callable[..., Any] | Any = self._source
        found = source(lattice.x, lattice.y) if callable(source) else source
        try:
            mu = np.asarray(found, float) + np.zeros(lattice.shape)
        except (TypeError, ValueError):
            mu = np.empty(0)
        if mu.shape != lattice.shape:
            raise DeckError(
                f"{_NAME}: expected one number for each node of the window of {lattice.shape} (n_row, n_col)"
            )
        if (bad := ~(np.isfinite(mu) & (mu >= 0.0))).any():
            where = f"x = {lattice.x[bad][0]:.4g} m, y = {lattice.y[bad][0]:.4g} m"
            if isinstance(source, HeightMap) and np.isinf(mu[bad][0]):
                raise DeckError(f"{_NAME}: the map does not cover the window: it has no value at {where}")
            raise DeckError(
                f"{_NAME}: expected finite numbers of at least 0; it is {mu[bad][0]:g} at {where}"
            )
        return FrictionLaw(mu, **self._numbers)


def _read_map(path: Path) -> HeightMap:
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
            return _map_of(maps[0].load())
    except FileNotFoundError:
        raise DeckError(f"{_NAME}: there is no file {path}") from None
    except DeckError as error:
        raise DeckError(f"{_NAME}: {str(error).removeprefix(f'{_NAME}: ')}") from None


def _map_of(values: Any) -> HeightMap:
    if values.size > _MOST_POINTS:
        raise DeckError(f"{_NAME}: expected a map of at most {_MOST_POINTS:,} points, not {values.size:,}")
    return HeightMap.of(values, _NAME, NUMBER, degree=1)  # without overshoot between its points
