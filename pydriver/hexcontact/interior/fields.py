"""Regions of points below the surface, with displacement and stress there as the core finds them.

Fields of tractions have shape (step, 3, n_row, n_col): pressure, and traction on body 1 along x and y, Pa.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, has_entries, reals
from ..core import flat, memory
from ..core.calls import integer
from ..core.lattice import Lattice
from ..errors import DeckError
from ..variables import LARGEST

_MOST_COUNT = 100_000
_MOST_NODES = 100_000_000  # between the origin and the box
_MEANING = {
    "x": "x coordinate",
    "y": "y coordinate",
    "depth": "depth below the surface of the body",
    "distance": "distance along the line",
}


@dataclass(frozen=True)
class Region:
    """Evaluation points."""

    points: Array  # x, y and depth of points (m); those of all nodes and planes for a box, (..., 3)
    dims: tuple[str, ...]  # dimensions of the points
    lattice: Lattice | None = None  # the nodes of a box, of which `depths` are the planes
    depths: Array = dataclasses.field(default_factory=lambda: np.empty(0))

    @property
    def count(self) -> int:
        """Number of points."""
        return self.depths.size * self.lattice.size if self.lattice else self.points.size // 3

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of points along the dimensions."""
        return (self.depths.size, *self.lattice.shape) if self.lattice else self.points.shape[:-1]

    @property
    def nodes(self) -> Array:
        """x, y and depth (m) of all points, those of a box of shape (depth, n_row, n_col, 3)."""
        if self.lattice is None:
            return self.points
        places = np.broadcast_arrays(self.lattice.x[None], self.lattice.y[None], self.depths[:, None, None])
        return np.stack(places, axis=-1)

    @property
    def coordinates(self) -> dict[str, Any]:
        """Coordinates of a dataset."""
        values: dict[str, Any] = {}
        places: dict[str, tuple[Any, Array]]
        if self.lattice is not None:
            plane = ("row", "col")
            values = {"row": ("row", self.lattice.rows), "col": ("col", self.lattice.cols)}
            places = {
                "x": (plane, self.lattice.x),
                "y": (plane, self.lattice.y),
                "depth": ("depth", self.depths),
            }
        else:
            places = {name: (self.dims, self.points[..., k]) for k, name in enumerate(("x", "y", "depth"))}
            if self.dims == ("distance",):
                places["distance"] = "distance", np.linalg.norm(self.points - self.points[0], axis=-1)
        return values | {
            name: (dims, place, {"long_name": _MEANING[name], "units": "m"})
            for name, (dims, place) in places.items()
        }


def region(
    lattice: Lattice,
    points: ArrayLike | None = None,
    line: ArrayLike | None = None,
    plane: ArrayLike | None = None,
    depths: ArrayLike | None = None,
    box: ArrayLike | None = None,
    count: int | Sequence[int] | None = None,
) -> Region:
    """Build the evaluation points from exactly one of `points`, `line`, `plane` and `depths`."""
    given: dict[str, Any] = {"points": points, "line": line, "plane": plane, "depths": depths}
    kinds = [name for name, value in given.items() if value is not None]
    if len(kinds) != 1:
        raise DeckError(f"expected one of {', '.join(given)}, not {' and '.join(kinds) or 'nothing'}")
    [kind] = kinds
    for name, value, fitting in (("box", box, ("depths",)), ("count", count, ("line", "plane"))):
        if value is not None and kind not in fitting:
            raise DeckError(f"{name}: expected only with {' or '.join(fitting)}, not with {kind}")
    values = reals(given[kind], kind)
    if not np.isfinite(values).all():
        raise DeckError(f"{kind}: finite numbers expected")
    if kind == "depths":
        chosen = lattice if box is None else _covering(lattice, reals(box, "box"))
        planes = np.atleast_1d(values)
        if planes.ndim != 1 or not planes.size:
            raise DeckError(f"depths: an array of shape {planes.shape}, expected a list of depths")
        _refuse_above(planes)
        return Region(np.empty(0), ("depth", "row", "col"), chosen, planes)
    dims: tuple[str, ...]
    shape = {"points": (*values.shape[:-1], 3), "line": (2, 3), "plane": (3, 3)}[kind]
    if values.ndim < 1 or values.shape != shape:
        raise DeckError(
            f"{kind}: an array of shape {values.shape}, expected {shape}: x, y and depth of each point"
        )
    if kind == "line":
        [along] = _shares(count, (101,))
        values, dims = values[0] + along[:, None] * (values[1] - values[0]), ("distance",)
    elif kind == "plane":
        along, across = _shares(count, (81, 81))
        corner, sides = values[0], values[1:] - values[0]
        memory.require(24 * along.size * across.size, "the plane", "choose fewer points")
        values = corner + across[:, None, None] * sides[1] + along[None, :, None] * sides[0]
        dims = ("across", "along")
    else:
        dims = tuple(f"point_{k}" for k in range(values.ndim - 1)) if values.ndim > 2 else ("point",)
        values = np.atleast_2d(values)
    _refuse_above(values[..., 2])
    return Region(values, dims)


def _refuse_above(depth: Array) -> None:
    if (depth < 0.0).any():
        raise DeckError(f"depth = {depth.min():g} m: expected points of the body, at depths of at least 0")


def _shares(count: int | Sequence[int] | None, default: tuple[int, ...]) -> list[Array]:
    """Return evenly spaced shares of the sides of a line or plane."""
    given: Any = default if count is None else count if has_entries(count) else (count,)
    numbers = [integer(n, "count") for n in given]
    if len(numbers) != len(default) or not all(2 <= n <= _MOST_COUNT for n in numbers):
        words = "a number" if len(default) == 1 else "two numbers"
        raise DeckError(f"count = {count!r}: expected {words} of points, 2 to {_MOST_COUNT}")
    return [np.linspace(0.0, 1.0, n) for n in numbers]


def _covering(lattice: Lattice, box: Array) -> Lattice:
    """Return the window that covers a rectangle."""
    if box.shape != (2, 2) or not (abs(box) <= LARGEST).all() or not (box[:, 0] < box[:, 1]).all():
        raise DeckError("box: expected the smallest and largest x, and y, in meters")
    if (abs(box - np.reshape(lattice.origin, (2, 1))) > _MOST_NODES * lattice.spacing).any():
        raise DeckError(f"box: expected places within {_MOST_NODES:,} spacings of the origin of the lattice")
    center, (length_x, length_y) = box.mean(axis=1), np.diff(box, axis=1)[:, 0]
    return Lattice.covering(lattice.spacing, tuple(center), length_x, length_y, *lattice.pattern)


COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
"""Components of the stress in the order of the core."""


def at_points(
    lattice: Lattice, tractions: Array, body: int, inside: ArrayLike, points: ArrayLike, threads: int = 0
) -> tuple[Array, Array]:
    """Return G u (step, n, 3) and the stress (step, n, 6; xx, yy, zz, xy, yz, xz) of a body in load steps.

    `inside` is Poisson's ratio of a half-space, or thickness (m), shear modulus (Pa) and Poisson's ratio of
    each layer, outermost first, and of the body below; G is the shear modulus of the surface. The influence
    of each node on each point is computed once for all steps.
    """
    x, y, depth = np.asarray(points, dtype=float).reshape(-1, 3).T
    if not x.size:
        return np.empty((len(tractions), 0, 3)), np.empty((len(tractions), 0, 6))
    found: tuple[Array, Array] = flat.interior_at_points(
        lattice, tractions, body, _layers(inside), x, y, depth, threads
    )
    return found


def _layers(inside: ArrayLike) -> Array:
    """Return the layers of a body, those of a half-space by its Poisson's ratio."""
    return np.array([[0.0, 1.0, inside]] if np.ndim(inside) == 0 else inside, dtype=float)


def on_planes(
    lattice: Lattice,
    tractions: Array,
    body: int,
    inside: ArrayLike,
    depths: ArrayLike,
    threads: int = 0,
    components: int = 6,
) -> Array:
    """Return a field at the nodes of planes parallel to the surface, (step, depth, component, n_row, n_col).

    Parameters as of `at_points`; `depths` are those of the planes below the surface of the body, m. Six
    `components` are those of the stress (Pa), three those of the displacement times the shear modulus (Pa m).
    """
    where = lattice, tractions, body, _layers(inside), np.ravel(depths)
    return np.asarray(flat.interior_on_planes(components, *where, threads))


def planes_memory(lattice: Lattice, steps: int, coated: bool, threads: int = 0) -> int:
    """Return the memory in bytes that `on_planes` takes besides its result."""
    window = lattice.n_col, lattice.n_row
    return int(flat.memory_of_planes(*window, steps, lattice.periodic, coated, threads))


def invariants(stress: ArrayLike) -> Array:
    """Return the three principal stresses (largest first), von Mises and Tresca of stresses (..., 6)."""
    values = np.asarray(stress, dtype=float)
    if values.shape[-1:] != (6,):
        raise DeckError(
            f"stress: an array of shape {values.shape}, expected (..., 6): {', '.join(COMPONENTS)}"
        )
    return np.asarray(flat.invariants_of_stress(values))
