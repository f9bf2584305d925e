"""Gap and friction over the plane: a function, a map, or values over the nodes of a window."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, Mask, has_entries, reals
from ..core.contact import shaped
from ..core.friction import FrictionLaw
from ..core.lattice import Lattice
from ..deck.height_map import HeightMap, Placed, in_si, place
from ..deck.interface import Friction, Interface, NodalCoefficient, TwoCoefficients
from ..deck.map_file import MOST_POINTS
from ..deck.separation import Separation
from ..deck.surfaces import Roller, Surface
from ..deck.units import LENGTH, NUMBER, Dimension
from ..errors import DeckError
from ..text import dotted, listed
from ..variables import LARGEST

FieldSource = Callable[[Array, Array], ArrayLike] | Array
"""A function of x and y, such as `Separation` or `HeightMap`, or values over the nodes of a window."""


class Rule(NamedTuple):
    """The admitted values of a quantity at nodes, and their interpolation."""

    key: str  # in messages
    values: str  # in words
    expected: str
    dimension: Dimension
    degree: int  # of the spline between the points of a map: 3, or 1 without overshoot
    least: float
    most: float
    constant: bool  # a function may return one number


_OR_OPEN = "or inf where nothing can touch"
_LEAST = -np.finfo(float).max
_ALIKE = 1e-6  # difference of heights one period apart, beside their range
GAP = Rule("gap", "heights", f"numbers, {_OR_OPEN}", LENGTH, 3, _LEAST, np.inf, constant=False)
_AT_LEAST_0 = "finite numbers of at least 0"
COEFFICIENT = Rule(
    "friction.coefficient", "coefficients", _AT_LEAST_0, NUMBER, 1, 0.0, -_LEAST, constant=True
)


def given_field(values: Any, rule: Rule, lattice: Lattice | None) -> FieldSource:
    """Return a quantity given in Python as a function, a map, or an array over the nodes of the lattice."""
    if callable(values):
        return values
    name = rule.key.replace(".", "_")
    if hasattr(values, "iloc") or hasattr(values, "data_vars"):
        raise DeckError(f"{name}: expected an xarray.DataArray or an array, not a {type(values).__name__}")
    if coordinates := getattr(values, "coords", {}):
        if "x" not in coordinates or "y" not in coordinates:
            named = listed([str(coordinate) for coordinate in coordinates], "and")
            raise DeckError(f"{name}: expected coordinates x and y (m), not {named}")
        if coordinates["x"].ndim == coordinates["y"].ndim == 1:
            return HeightMap.of(values, rule.key, rule.dimension, rule.degree)
        values = values.copy(data=in_si(values, name, rule.dimension))
    reals(values, name)  # other values need another sentence
    if lattice is None:
        raise DeckError(
            f"{name}: an array needs lattice=..., at whose nodes it is given; {rule.values} on a rectangular "
            "grid are given as an xarray.DataArray with the coordinates x and y (m)"
        )
    return shaped(values, lattice, name).copy()


class PlaneField:
    """A quantity over the plane, and the rule of its values.

    `at_nodes`: it is an array over the nodes of one window; `given`: in Python, not as two surfaces; `map`:
    the map, if it is one; `maps`: those of measured surfaces, or itself; `heights`: those (m) of both
    surfaces, none if only their sum is known, as are their `shapes` and the `rollers` among these.
    """

    def __init__(self, source: FieldSource, rule: Rule) -> None:
        self.source, self.rule = source, rule
        self.at_nodes, self.given = isinstance(source, np.ndarray), not isinstance(source, Separation)
        self.map = source if isinstance(source, HeightMap) else None
        self.maps: tuple[Placed, ...] = (Placed(rule.key, self.map),) if self.map else ()
        self.heights: tuple[Callable[[Array, Array], Array], ...] = ()
        self.shapes: tuple[Surface, ...] = ()
        if isinstance(source, Separation):
            self.maps, self.shapes = source.placed, source.shapes
            self.heights = tuple(one.height for one in source.surfaces)
        self.rollers = [one for one in self.shapes if isinstance(one, Roller)]

    @property
    def first_touch(self) -> tuple[float, float] | None:
        """Point (m) where the bodies touch first; None if it is unknown."""
        known = isinstance(self.source, Separation | HeightMap)
        return self.source.first_touch[:2] if known else None  # type: ignore[union-attr]

    def at(self, x: Array, y: Array) -> Array:
        """Return the values at points of the plane."""
        assert callable(self.source)
        key = self.rule.key
        try:
            found = self.source(x, y)
        except DeckError:
            raise
        except (TypeError, ValueError) as error:
            if not _takes_numbers(self.source, x, y):
                raise
            raise DeckError(
                f"{key}: expected a function of two arrays, x and y (m); this one takes numbers only: use "
                f"functions of numpy, or numpy.vectorize({key.rpartition('.')[2]})"
            ) from error
        values = reals(found, key)
        if self.rule.constant and not values.shape:
            values = np.full(np.shape(x), float(values))
        if values.shape != np.shape(x):
            raise DeckError(
                f"{key}: expected an array of the shape of x, {np.shape(x)}, one number for each node, "
                f"not one of {values.shape}"
            )
        self._refuse(values, ~(values >= self.rule.least), x, y)
        return values

    def over(self, lattice: Lattice) -> Array:
        """Return the values at the nodes of a window."""
        source, key = self.source, self.rule.key
        values = source if isinstance(source, np.ndarray) else self.at(lattice.x, lattice.y)
        if values.shape != lattice.shape:
            raise DeckError(
                f"{key}: expected an array of shape {lattice.shape} (n_row, n_col), not {values.shape}"
            )
        bad = ~((values >= self.rule.least) & (values <= self.rule.most))
        self._refuse(values, bad, lattice.x, lattice.y)
        if self.rule is GAP and (abs(values[np.isfinite(values)]) > LARGEST).any():
            raise DeckError(f"{key}: expected lengths of at most {LARGEST:g} m, {_OR_OPEN}")
        ours = self.at_nodes or self.map or not self.given
        return values if ours else values.copy()  # a function may keep, and change, its result

    def share(self, touching: Mask, lattice: Lattice) -> Array:
        """Return the part of a cell that each node bears at ends of surfaces; 0 where nothing can touch."""
        share = touching.astype(float)
        for roller in self.rollers:
            share *= roller.share(lattice.x, lattice.y, lattice.basis)
        return share

    def repeats(self, lattice: Lattice, values: Array) -> bool:
        """Test whether a function has the same values one window further, along both directions."""
        if self.at_nodes or self.maps or not np.isfinite(values).all():
            return False
        across, up = lattice.basis * [[lattice.n_col], [lattice.n_row]]
        try:
            ahead = [
                self.at(lattice.x[edge] + side[0], lattice.y[edge] + side[1]) - values[edge]
                for edge, side in ((np.s_[:, :1], across), (np.s_[:1], up))
            ]
        except (DeckError, ValueError):  # it is known in the window only
            return False
        return all(abs(change).max() <= _ALIKE * np.ptp(values) for change in ahead)

    def _refuse(self, values: Array, bad: Mask, x: Array, y: Array) -> None:
        """Refuse values at the first of some points."""
        if not bad.any():
            return
        value, where = values[bad][0], place(x[bad][0], y[bad][0])
        if self.map and np.isinf(value):
            raise DeckError(f"{self.rule.key}: the map does not cover the window: it has no value at {where}")
        shown, key = "NaN" if np.isnan(value) else f"{value:g}", self.rule.key
        if isinstance(self.source, Separation):
            key = dotted(self.source.without_height(x[bad][:1], y[bad][:1]))
        raise DeckError(f"{key}: expected {self.rule.expected}; it is {shown} at {where}")

    def __eq__(self, other: object) -> bool:
        """Test whether two fields are the same; functions are if they are one object."""
        if not isinstance(other, PlaneField):
            return NotImplemented
        if self.at_nodes and other.at_nodes:
            return np.array_equal(self.source, other.source)  # type: ignore[arg-type]
        return self.source is other.source or not (self.given or other.given)


def _takes_numbers(source: Callable[[Any, Any], ArrayLike], x: Array, y: Array) -> bool:
    """Test whether a function that fails on arrays takes two numbers."""
    try:
        float(source(float(np.ravel(x)[0]), float(np.ravel(y)[0])))  # type: ignore[arg-type]
    except Exception:  # of a function of a user
        return False
    return True


_NAME = COEFFICIENT.key


def given_coefficient(coefficient: Any, lattice: Lattice | None) -> Any:
    """Return a coefficient from Python as in a deck: a number, a text, or a `NodalCoefficient`."""
    if isinstance(coefficient, str | dict) or not (callable(coefficient) or has_entries(coefficient)):
        return coefficient
    source = given_field(coefficient, COEFFICIENT, lattice)
    if (
        isinstance(source, HeightMap) and source.gap.size > MOST_POINTS
    ):  # more than the deck of a result holds
        raise DeckError(f"{_NAME}: expected a map of at most {MOST_POINTS:,} points, not {source.gap.size:,}")
    return NodalCoefficient(source)


class FrictionField:
    """Friction over the plane, by the tables [friction] and [interface] of a deck.

    `in_deck` is its value in a deck that needs no file: a map has its points and values.
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
        self._numbers, self._coefficient, self.in_deck = numbers, mu, mu
        self.varies = isinstance(mu, NodalCoefficient)
        if isinstance(mu, NodalCoefficient):
            source: Any = mu.source
            if isinstance(source, tuple):
                x, y, values = source
                source = HeightMap(x, y, values, _NAME, COEFFICIENT.degree, whole=True)
            self._coefficient = PlaneField(source, COEFFICIENT)
            self.in_deck = mu.in_deck
            if grid := self._coefficient.map:
                self.in_deck = {"x": grid.x.tolist(), "y": grid.y.tolist(), "values": grid.gap.tolist()}

    def over(self, lattice: Lattice) -> FrictionLaw:
        """Return the law at the nodes of a window."""
        mu = self._coefficient
        return FrictionLaw(mu.over(lattice) if isinstance(mu, PlaneField) else mu, **self._numbers)
