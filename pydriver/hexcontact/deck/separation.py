"""The initial gap between the surfaces of two bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array
from ..errors import DeckError
from ..text import dotted
from .height_map import Placed
from .surfaces import Surface

_APART = "the two surfaces nowhere face each other: their offsets put them side by side"


@dataclass(frozen=True)
class Separation:
    """The initial gap between the surfaces of body 1 and of body 2, which is mirrored.

    Their heights are added, less the height at first touch.
    """

    surface_1: Surface
    surface_2: Surface
    at_rest: Separation | None = None  # before surfaces moved with their bodies; its heights count on

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the gap (m) at points of the plane: >= 0 up to rounding, inf where nothing can touch."""
        return self._sum(x, y) - (self.at_rest or self).first_touch[2]

    @property
    def surfaces(self) -> tuple[Surface, Surface]:
        """The surfaces of both bodies."""
        return self.surface_1, self.surface_2

    @cached_property
    def keyed(self) -> list[tuple[tuple[str | int, ...], Surface]]:
        """The shapes of both surfaces with their keys in a deck, those of sums with places from 0."""
        return [
            (("body", number, "surface", *(place,) * (len(surface.shapes) > 1)), part)
            for number, surface in zip("12", self.surfaces, strict=True)
            for place, part in enumerate(surface.shapes)
        ]

    @property
    def measured(self) -> list[tuple[str, Any]]:
        """The measured shapes of both surfaces with the numbers of their bodies."""
        return [(str(key[1]), one) for key, part in self.keyed for one in part.measured]

    def without_height(self, x: Array, y: Array) -> tuple[str | int, ...]:
        """Return the key of a shape that has no height at points where the sum has none."""
        for key, part in self.keyed:
            if not (part.height(x, y) > -math.inf).all():
                return (*key, "expression") if part.shape == "formula" else key
        return ("body",)

    def moved(self, by: ArrayLike) -> Separation:
        """Return the gap after the shapes that are bound to rolling bodies have moved by a vector (m)."""
        return Separation(self.surface_1.moved(by), self.surface_2.moved(by), self.at_rest or self)

    @property
    def shapes(self) -> tuple[Surface, ...]:
        """The shapes of both surfaces."""
        return self.surface_1.shapes + self.surface_2.shapes

    @property
    def moves(self) -> bool:
        """Whether shapes are bound to rolling bodies."""
        return any(map(attrgetter("moves"), self.shapes))

    @property
    def convex(self) -> bool:
        """Whether the bodies touch in one place, however far they are pressed."""
        return self.curvature is not None or all(part.convex for part in self.shapes)

    @property
    def only_curved(self) -> Surface | None:
        """The surface that faces a plane without a tilt; None if there is none, or both are curved."""
        curved = [one for one in self.surfaces if not one.flat]
        return curved[0] if len(curved) == 1 else None

    @property
    def flat(self) -> bool:
        """Whether both surfaces are planes without a tilt."""
        return self.surface_1.flat and self.surface_2.flat

    @cached_property
    def first_touch(self) -> tuple[float, float, float]:
        """Point x, y (m) at which the bodies touch first, and the sum of their heights there (m).

        It does not depend on window or lattice. Where the bodies touch along a line or over an area, it is
        one of the points.

        Raises
        ------
        DeckError
            If the two surfaces nowhere face each other (two punches side by side).
        """
        one, two = self.surface_1, self.surface_2
        if one.measured or two.measured:
            return self._first_of_points()
        if one.as_given or any(one.tilt) or one.offset == two.offset:
            return (*two.offset, 0.0)
        if two.as_given or any(two.tilt):
            return (*one.offset, 0.0)
        x, y = self.quadratic[1] if self.quadratic else self._search()
        return x, y, float(self._sum(x, y))

    @cached_property
    def curvature(self) -> Array | None:
        """Second derivatives (1/m) of a gap that is a quadratic form; None of others."""
        one, two = self.surface_1.curvature, self.surface_2.curvature
        tilted = any(self.surface_1.tilt + self.surface_2.tilt)
        return None if one is None or two is None or tilted else one + two

    @cached_property
    def quadratic(self) -> tuple[Array, tuple[float, float]] | None:
        """Second derivatives (1/m) and lowest point (m) of a gap that is a quadratic form; None of others."""
        second = self.surface_2.curvature
        if self.curvature is None or second is None:
            return None
        if self.surface_1.offset == self.surface_2.offset:
            return self.curvature, self.surface_1.offset
        # (C1 + C2) r = C1 o1 + C2 o2, singular for two parallel cylinders; solved about o1, so that large
        # offsets cost no digits
        apart = np.subtract(self.surface_2.offset, self.surface_1.offset)
        point = np.linalg.pinv(self.curvature, hermitian=True) @ second @ apart + self.surface_1.offset
        return self.curvature, (float(point[0]), float(point[1]))

    def _sum(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self.surface_1.height(x, y) + self.surface_2.height(x, y)

    def _first_of_points(self) -> tuple[float, float, float]:
        """Return the point of measured surfaces at which the bodies touch first, and the sum of heights."""
        pairs = zip(self.surfaces, self.surfaces[::-1], strict=True)
        near = [one.points_near(other.offset) for surface, other in pairs for one in surface.measured]
        x, y = np.concatenate(near, axis=1)
        heights = self._sum(x, y)
        lowest = int(np.argmin(heights))
        if not math.isfinite(heights[lowest]):
            raise DeckError(_APART)
        return float(x[lowest]), float(y[lowest]), float(heights[lowest])

    def repeating(self, sides: tuple[float, float] | None) -> Separation:
        """Return the gap over a window that repeats with two sides (m) along x and y; None: others."""
        return Separation(self.surface_1.repeating(sides), self.surface_2.repeating(sides))

    @property
    def one_map(self) -> bool:
        """Whether one measured surface faces a plane, and neither is tilted."""
        single = [one for one in self.surfaces if one.measured == (one,) and not any(one.tilt)]
        return len(single) == 1 and any(one.flat for one in self.surfaces)

    @cached_property
    def placed(self) -> tuple[Placed, ...]:
        """The measured maps of both bodies."""
        return tuple(one.placed(dotted(key)) for key, part in self.keyed for one in part.measured)

    def _search(self) -> tuple[float, float]:
        """Return the point of the smallest sum of heights, searched from the best one between the centers."""
        from scipy.optimize import minimize

        first, second = (np.array(one.offset) for one in self.surfaces)
        scale = float(np.hypot(*(second - first)))

        def inside(point: Array) -> Array:
            # The nearest point that can touch: the minimum may lie on the rim of a punch, where a search over
            # the bare height (infinite beyond) would not move.
            for surface, center in zip(self.surfaces, (first, second), strict=True):
                arm = point - center
                point = center + arm * min(1.0, surface.reach / max(float(np.hypot(*arm)), 1e-300))
            return point

        def height(scaled: Array) -> float:
            return float(self._sum(*inside(first + scale * scaled)))

        along = (second - first) / scale
        starts = [along * t for t in np.linspace(0.0, 1.0, 101)]
        best = min(starts, key=height)
        if not math.isfinite(height(best)):
            raise DeckError(_APART)
        # A convex sum (all shapes but powers below 1) has no other minima.
        size = max(height(best), 1e-30)
        options: Any = {"xatol": 1e-9, "fatol": 1e-15 * size, "maxiter": 2000}
        found = minimize(height, best, method="Nelder-Mead", options=options)
        point = inside(first + scale * (found.x if found.fun < height(best) else best))
        return float(point[0]), float(point[1])


def principal_curvatures(curvature: ArrayLike) -> tuple[float, float, float]:
    """Return the principal values of a curvature tensor and the direction of the smaller one.

    For two bodies pass the sum of their tensors; with h = A s² + B t² about the first touch, A and B are half
    the values returned, and the major axis of the contact ellipse lies along the direction (crossed
    cylinders: the sum of two rank-one tensors, section 9.3 of the dissertation).

    Parameters
    ----------
    curvature : array_like, (2, 2)
        Symmetric tensor C of h = r . C r / 2, in 1/m.

    Returns
    -------
    smaller, larger : float
        Principal curvatures (1/m).
    angle : float
        Direction of the smaller one (rad) from x towards y, in (-pi/2, pi/2].
    """
    values, vectors = np.linalg.eigh(np.asarray(curvature, float))
    angle = math.atan2(vectors[1, 0], vectors[0, 0])
    if angle > math.pi / 2:
        angle -= math.pi
    elif angle <= -math.pi / 2:
        angle += math.pi
    return float(values[0]), float(values[1]), angle
