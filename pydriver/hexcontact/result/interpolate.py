"""Fields between the nodes: at any point, and along lines.

A field of the solution is a sum of hat functions, linear on each triangle of the lattice. Along a line it is
a polygon with corners at the edges of triangles. Only the pressure of `PressureField` ends at the edge of the
contact, like a square root.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array
from ..core.edges import ContactEdges
from ..core.interpolation import crossings, linear, nearest, pressure_between, section_ends
from ..core.lattice import Lattice
from ..errors import DeckError
from ..text import did_you_mean
from ..variables import NOT_KEPT, VARIABLES

if TYPE_CHECKING:
    import xarray

Point = tuple[float, float]
Fields = Mapping[str, NDArray[Any]]


def interpolate(lattice: Lattice, name: str, values: NDArray[Any], x: ArrayLike, y: ArrayLike) -> Array:
    """Return a field at points of the plane, linear on the triangles of the lattice like the solution.

    Parameters
    ----------
    lattice : Lattice
        The window.
    name : str
        Name of the field, see `hexcontact.variables`. The zone at a point is that of the nearest node.
    values : ndarray, (n_row, n_col)
        Its values at the nodes.
    x, y : array_like
        Points (m), broadcast.

    Returns
    -------
    ndarray
        Values at the points. Outside the window tractions and slip are 0, other fields NaN.
    """
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    variable = VARIABLES[name]
    between = nearest if variable.flags else linear
    return between(values, lattice.basis, lattice.start, x, y, variable.padding)


class PressureField:
    """The pressure of a solution at any point.

    Near the edge of the contact its square is interpolated, which is linear in the distance; elsewhere, and
    where the contact ends at nodes that can never touch, the pressure itself is.

    Parameters
    ----------
    pressure, gap : ndarray, shape (n_row, n_col)
        Contact pressure (Pa) and gap (m) at the nodes; the gap is NaN where the bodies cannot touch.
    basis : ndarray, shape (2, 2)
        Basis vectors of the lattice as rows, m.
    start : tuple of float
        Position of node [0, 0], m.
    """

    def __init__(self, pressure: Array, gap: Array, basis: Array, start: tuple[float, float]) -> None:
        self._pressure, self._basis, self._start = pressure, basis, start
        self._squares = ContactEdges(pressure, gap, pressure > 0.0, np.isfinite(gap), basis, start).squares()

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the pressure (Pa) at points (m), in their shape; 0 outside the window."""
        return pressure_between(self._pressure, self._squares, self._basis, self._start, x, y)


# --- lines --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """A straight line between two points of the plane.

    Attributes
    ----------
    start : tuple of float
        First point, m.
    end : tuple of float
        Last point, m.
    zero : float
        Distance (m) from the start at which distances along the line are 0.
    """

    start: Point
    end: Point
    zero: float = 0.0

    def __post_init__(self) -> None:
        for name, point in (("start", self.start), ("end", self.end)):
            if np.shape(point) != (2,) or not np.isfinite(np.asarray(point, dtype=float)).all():
                raise DeckError(f"{name} = {point!r}: expected a point (x, y) in meters")
        if not self.length > 0.0:
            raise DeckError(f"end = {self.end!r}: expected another point than the start of the line")

    @property
    def length(self) -> float:
        """Length, m."""
        return math.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    def corners(self, lattice: Lattice) -> Array:
        """Return the distances (m) from the start at which the line crosses edges of triangles, and its ends.

        Parameters
        ----------
        lattice : Lattice
            The lattice, also outside of its window.
        """
        return crossings(lattice, self.start, self.end)

    def points(self, distance: Array) -> tuple[Array, Array]:
        """Return the coordinates (m) of points at some distances (m) from the start."""
        x, y = (a + (b - a) * (distance / self.length) for a, b in zip(self.start, self.end, strict=True))
        return np.asarray(x), np.asarray(y)


def section_line(lattice: Lattice, pressure: Array, angle: float, through: Point | None) -> Line:
    """Return the line across a contact at an angle (rad) from x, with a margin on both sides.

    Parameters
    ----------
    lattice : Lattice
        The window.
    pressure : ndarray, (n_row, n_col)
        Contact pressure, Pa.
    angle : float
        Direction from x, rad.
    through : tuple of float or None
        A point (m) on the line, from which distances count; None: the node next to the center of pressure.

    Raises
    ------
    DeckError
        If nothing is in contact.
    """
    start, end, zero = section_ends(lattice, pressure, angle, through)
    return Line(start, end, zero)


def chosen_fields(names: Sequence[str], fields: Fields, step: int) -> dict[str, NDArray[Any]]:
    """Return the named fields of a load step; without names, all of the output.

    Parameters
    ----------
    names : sequence of str
        Names of fields.
    fields : mapping of str to array_like
        The fields of the step.
    step : int
        Number of the step, for messages.

    Raises
    ------
    DeckError
        If there is no such field in the output.
    """
    for name in names:
        if name not in fields:
            known = name in VARIABLES and VARIABLES[name].is_field
            what = "was not kept (output.fields)" if known else "is no field"
            hint = did_you_mean(name, fields) or f"; there are {', '.join(fields)}"
            raise DeckError(f"{name} {what}{hint}")
    found = {name: np.asarray(fields[name]) for name in names or fields}
    kept = {name: values for name, values in found.items() if is_kept(values)}
    for name in names:
        if name not in kept:
            raise DeckError(f"{name} of step {step} was not kept (output.every)")
    if not names and not any(VARIABLES[name].is_field for name in kept):
        raise DeckError(f"no field of step {step} was kept (output.fields, output.every)")
    return kept


def is_kept(values: NDArray[Any]) -> bool:
    """Test by its values whether the output has a field of a step."""
    return bool((values != NOT_KEPT).any() if values.dtype.kind == "i" else np.isfinite(values).any())


def profile(
    lattice: Lattice, fields: Fields, line: Line, points: int | None = None, **attributes: Any
) -> xarray.Dataset:
    """Return fields along a line.

    Parameters
    ----------
    lattice : Lattice
        The window.
    fields : mapping of str to ndarray
        Values at the nodes, by the names of `hexcontact.variables`.
    line : Line
        The line.
    points : int, optional
        Number of points, evenly spaced. By default the points are the corners of the polygon of a field along
        the line, so that straight lines between them are exact.
    **attributes
        Attributes of the data set.

    Returns
    -------
    xarray.Dataset
        Dimension ``distance`` (m), with the coordinates ``x`` and ``y`` (m).

    Raises
    ------
    DeckError
        If the number of points is below 2.
    """
    import xarray

    if points is not None and (isinstance(points, bool) or not isinstance(points, int) or points < 2):
        raise DeckError(f"points = {points!r}: expected a whole number of at least 2")
    distance = line.corners(lattice) if points is None else np.linspace(0.0, line.length, points)
    x, y = line.points(distance)
    places = {
        "distance": (distance - line.zero, "distance along the line"),
        "x": (x, "x coordinate"),
        "y": (y, "y coordinate"),
    }
    return xarray.Dataset(
        {
            name: ("distance", interpolate(lattice, name, values, x, y), VARIABLES[name].attributes)
            for name, values in fields.items()
        },
        coords={
            name: ("distance", values, {"long_name": long_name, "units": "m"})
            for name, (values, long_name) in places.items()
        },
        attrs=attributes,
    )
