"""Fields between the nodes: at any point, and along lines.

A field of the solution is a sum of hat functions, linear on each triangle of the lattice. Along a line it is
a polygon with corners at the edges of triangles. Pressure and shear traction go to the edges of contact and
stick between the nodes, unless the source is "nodes".
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array
from ..core.edges import ContactEdges, Limits, TractionField
from ..core.interpolation import crossings, linear, nearest, section_ends
from ..core.lattice import Lattice
from ..deck.below import SOURCES
from ..errors import DeckError, NotInResult
from ..text import did_you_mean
from ..variables import EDGES, NODAL_FRICTION, NOT_KEPT, SHEAR_LIMIT, TRACTIONS, VARIABLES

if TYPE_CHECKING:
    import xarray

Point = tuple[float, float]
Fields = Mapping[str, NDArray[Any]]

_FINER = 8  # points along a spacing where tractions are curved
_STICK = 1  # value of zone at a sticking node


def interpolate(
    lattice: Lattice,
    name: str,
    values: NDArray[Any],
    x: ArrayLike,
    y: ArrayLike,
    tractions: TractionField | None = None,
) -> Array:
    """Return a field at points of the plane (m): tractions to the edges, others linear on the triangles.

    A zone is that of the nearest node. Without `tractions` pressure and shear are linear, too. Outside the
    window tractions and slip are 0, other fields NaN.
    """
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    if tractions is not None and name in TRACTIONS:
        return np.asarray(tractions(x, y)[TRACTIONS.index(name)])
    variable = VARIABLES[name]
    between = nearest if variable.flags else linear
    return between(values, lattice.basis, lattice.start, x, y, variable.padding)


def traction_field(
    lattice: Lattice, fields: Fields, limits: Limits | None, source: str | None = None, sharp: bool = True
) -> TractionField:
    """Return pressure and shear traction of a load step at any point.

    `limits` are the coefficient of friction and the bound of the shear traction (Pa), None if unknown;
    `sharp` is False for a compliant interface, whose contact has no sharp edge; `source` as of
    `hexcontact.Result.traction_field`.
    """
    if source not in (None, *SOURCES):
        raise DeckError(f"source = {source!r}: expected {' or '.join(SOURCES)}")
    zero = np.zeros(lattice.shape)
    kept = {name: np.asarray(values) for name, values in fields.items() if is_kept(np.asarray(values))}
    if "pressure" not in kept:
        raise NotInResult("the pressure was not kept (output.fields, output.every)")
    tractions = np.array([kept.get(name, zero) for name in TRACTIONS], dtype=float)
    if source == "nodes" or (source is None and not (sharp and "gap" in kept)):
        return TractionField.of_nodes(tractions, lattice.basis, lattice.start)
    if not sharp or "gap" not in kept:
        why = "there are none with a compliant interface" if not sharp else "the gap was not kept"
        raise NotInResult(f"source = 'edges': expected nodes; the edges need the gap, and {why}")
    zone = kept.get("zone")
    contact = tractions[0] > 0.0 if zone is None else zone > 0
    sheared = zone is not None and all(name in kept for name in TRACTIONS)
    edges = ContactEdges(
        *(tractions[0], kept["gap"], contact, np.isfinite(kept["gap"])), lattice.basis, lattice.start
    )
    if not (sheared and limits):
        return edges.field(tractions[1:])
    return edges.field(tractions[1:], np.asarray(zone == _STICK), limits)


def tractions_of(step: xarray.Dataset, lattice: Lattice, source: str | None = None) -> TractionField:
    """Return pressure and shear traction of a load step of a result, see `traction_field`."""
    fields = {name: step[name].values for name in (*TRACTIONS, *EDGES) if name in step}
    for name in ("pressure", "gap") if source == "edges" else ("pressure",):
        if name not in fields or not is_kept(fields[name]):
            at = int(step["step"])
            raise NotInResult(f"the {name} of step {at} was not kept (output.fields, output.every)")
    from ..analytic.hertz_gap import friction_of, is_compliant

    known = step.attrs
    limits = limits_of(friction_of(known), step, float(known.get(SHEAR_LIMIT, math.inf)))
    return traction_field(lattice, fields, limits, source, not is_compliant(known))


def with_shown(step: xarray.Dataset, lattice: Lattice, source: str | None = None) -> xarray.Dataset:
    """Return a load step whose tractions are those of `tractions_of` at the nodes."""
    names = [name for name in TRACTIONS if name in step and is_kept(step[name].values)]
    if "pressure" not in names:
        return step
    found = dict(zip(TRACTIONS, tractions_of(step, lattice, source).at_nodes(), strict=True))
    return step.assign({name: step[name].copy(data=found[name]) for name in names})


def limits_of(friction: float, fields: Mapping[Any, ArrayLike], bound: float) -> Limits | None:
    """Return coefficient of friction at the nodes and bound (Pa) of the shear traction; None if unknown.

    The coefficient is one number, or NaN if it is among the fields of a step: it varies, or has a bound.
    """
    if not math.isnan(friction):
        return (friction, bound) if 0.0 < friction < math.inf else None
    if NODAL_FRICTION not in fields:  # of another law
        return None
    return np.nan_to_num(np.asarray(fields[NODAL_FRICTION])), bound  # NaN where no step had a node


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
        edges = ContactEdges(pressure, gap, pressure > 0.0, np.isfinite(gap), basis, start)
        self._tractions = edges.field()

    @classmethod
    def of(cls, tractions: TractionField) -> Self:
        """Return the pressure of a traction field."""
        field = cls.__new__(cls)
        field._tractions = tractions
        return field

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the pressure (Pa) at points (m), in their shape; 0 outside the window."""
        return np.asarray(self._tractions(x, y)[0])


# --- lines --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """A straight line between two points (m); distances along it are 0 at `zero` (m) from its start."""

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
        """Return distances (m) from the start at which the line crosses edges of triangles, and its ends."""
        return crossings(lattice, self.start, self.end)

    def points(self, distance: Array) -> tuple[Array, Array]:
        """Return the coordinates (m) of points at some distances (m) from the start."""
        x, y = (a + (b - a) * (distance / self.length) for a, b in zip(self.start, self.end, strict=True))
        return np.asarray(x), np.asarray(y)


def section_line(lattice: Lattice, pressure: Array, angle: float, through: Point | None) -> Line:
    """Return the line across a contact at an angle (rad) from x, with a margin on both sides.

    Distances count from the point `through` (m), by default from the node next to the center of pressure.
    """
    start, end, zero = section_ends(lattice, pressure, angle, through)
    return Line(start, end, zero)


def chosen_fields(names: Sequence[str], fields: Fields, step: int) -> dict[str, NDArray[Any]]:
    """Return the named fields of a load step, by default all that were kept."""
    for name in names:
        if name not in fields:
            known = name in VARIABLES and VARIABLES[name].is_field
            hint = did_you_mean(name, fields) or f"; there are {', '.join(fields)}"
            if known:
                raise NotInResult(f"{name} was not kept (output.fields){hint}")
            raise DeckError(f"{name} is no field{hint}")
    found = {name: np.asarray(fields[name]) for name in names or fields}
    kept = {name: values for name, values in found.items() if is_kept(values)}
    for name in names:
        if name not in kept:
            raise NotInResult(f"{name} of step {step} was not kept (output.every)")
    if not names and not any(VARIABLES[name].is_field for name in kept):
        raise NotInResult(f"no field of step {step} was kept (output.fields, output.every)")
    return kept


def is_kept(values: NDArray[Any]) -> bool:
    """Test by its values whether the output has a field of a step."""
    return bool((values != NOT_KEPT).any() if values.dtype.kind == "i" else np.isfinite(values).any())


def profile(
    lattice: Lattice,
    fields: Fields,
    line: Line,
    points: int | None = None,
    tractions: TractionField | None = None,
    **attributes: Any,
) -> xarray.Dataset:
    """Return fields along a line, over ``distance`` (m), with `attributes` of the dataset.

    Without a number of `points` they are the corners of the polygon of a field, so that straight lines
    between them are exact; tractions to the edges are curved and have eight points a spacing.
    """
    import xarray

    if points is not None and (isinstance(points, bool) or not isinstance(points, int) or points < 2):
        raise DeckError(f"points = {points!r}: expected a whole number of at least 2")
    distance = line.corners(lattice) if points is None else np.linspace(0.0, line.length, points)
    if tractions is not None and any(name in TRACTIONS for name in fields):
        attributes["tractions"] = tractions.source
        if points is None and tractions.source == "edges":
            distance = np.union1d(distance, np.arange(0.0, line.length, lattice.spacing / _FINER))
    x, y = line.points(distance)
    places = {
        "distance": (distance - line.zero, "distance along the line"),
        "x": (x, "x coordinate"),
        "y": (y, "y coordinate"),
    }
    return xarray.Dataset(
        {
            name: (
                "distance",
                interpolate(lattice, name, values, x, y, tractions),
                VARIABLES[name].attributes,
            )
            for name, values in fields.items()
        },
        coords={
            name: ("distance", values, {"long_name": long_name, "units": "m"})
            for name, (values, long_name) in places.items()
        },
        attrs=attributes,
    )
