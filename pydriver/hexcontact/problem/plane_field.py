"""A quantity over the plane, such as the gap: a function, a map, or values over the nodes of a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, Mask, reals
from ..core.contact import shaped
from ..core.lattice import Lattice
from ..deck.surfaces import Separation
from ..deck.units import LENGTH, NUMBER, Dimension
from ..errors import DeckError
from ..text import listed
from ..variables import LARGEST
from .height_map import HeightMap, in_si

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


@dataclass(frozen=True)
class PlaneField:
    """A quantity over the plane, and the rule of its values."""

    source: FieldSource
    rule: Rule

    @property
    def at_nodes(self) -> bool:
        """Whether it is an array over the nodes of one window."""
        return isinstance(self.source, np.ndarray)

    @property
    def given(self) -> bool:
        """Whether it was given in Python, not as two surfaces."""
        return not isinstance(self.source, Separation)

    @property
    def map(self) -> HeightMap | None:
        """The map, if it is one."""
        return self.source if isinstance(self.source, HeightMap) else None

    @property
    def heights(self) -> tuple[Callable[[Array, Array], Array], ...]:
        """Heights (m) of the surfaces of body 1 and body 2; empty if only their sum is known."""
        known = self.source
        return (known.surface_1.height, known.surface_2.height) if isinstance(known, Separation) else ()

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
        self._refuse(values, np.isnan(values), x, y)
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
        ours = isinstance(source, np.ndarray | HeightMap | Separation)
        return values if ours else values.copy()  # a function may keep, and change, its result

    def _refuse(self, values: Array, bad: Mask, x: Array, y: Array) -> None:
        """Refuse values at the first of some points."""
        if not bad.any():
            return
        value, where = values[bad][0], f"x = {x[bad][0]:.4g} m, y = {y[bad][0]:.4g} m"
        if self.map and np.isinf(value):
            raise DeckError(f"{self.rule.key}: the map does not cover the window: it has no value at {where}")
        shown = "NaN" if np.isnan(value) else f"{value:g}"
        raise DeckError(f"{self.rule.key}: expected {self.rule.expected}; it is {shown} at {where}")

    def fault_near(self, lattice: Lattice, chosen: Mask) -> str:
        """Return why a contact at nodes of a window is doubtful: near the end of a map, or a hole."""
        return self.map.fault_near(lattice.spacing, lattice.x[chosen], lattice.y[chosen]) if self.map else ""

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
