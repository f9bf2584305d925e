"""A finished load step: its values at the nodes, between them, and along lines.

A field of the solution is a sum of hat functions, linear on each triangle of the lattice. Along a line it is
a polygon with corners at the edges of triangles. Pressure and shear traction go to the edges of contact and
stick between the nodes, unless the source is "nodes".
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..analytic.hertz_gap import friction_of, is_compliant
from ..arrays import BAND, Array, Banded, Dataset, Mask
from ..core.edges import ContactEdges, TractionField
from ..core.friction import FrictionLaw
from ..core.lattice import Lattice, crossings, linear, nearest, section_ends
from ..deck.below import SOURCES
from ..errors import DeckError, NotInResult
from ..text import did_you_mean
from ..variables import EDGES, NODAL_FRICTION, NOT_KEPT, SHEAR_LIMIT, TRACTIONS, VARIABLES

if TYPE_CHECKING:
    from ..interior.stress import Loaded

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

    A zone is that of the nearest node. Without `tractions` pressure and shear are linear, too. Outside a
    window that ends tractions and slip are 0, other fields NaN.
    """
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    if tractions is not None and name in TRACTIONS:
        return np.asarray(tractions(x, y)[TRACTIONS.index(name)])
    variable = VARIABLES[name]
    between = nearest if variable.flags else linear
    return between(lattice, values, x, y, variable.padding)


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """A finished load step.

    Its quantities are attributes, too: ``step.pressure`` is an array over the nodes, ``step.approach`` a
    number. The arrays are those of the run, not copies, and read-only.

    Attributes
    ----------
    index : int
        Position in the whole history, from 0.
    lattice : Lattice
        Its window.
    fields : mapping of str to ndarray
        Arrays of shape (n_row, n_col), SI; names of `hexcontact.variables`. ``initial_gap`` among them.
    history : mapping of str to number or text
        Values by step; names of `hexcontact.variables`.
    companion : mapping of str to ndarray
        Fields of the second solution of adaptive load steps, for the journal.
    control : mapping of str to number
        Place of an adaptive load step in the history, and data for the choice of the next one, for the
        journal; empty for given load steps.
    prescribed : mapping of str to float
        Prescribed loads (N, N m) and motions (m, rad); empty for a step read from a file.
    load_fraction : float
        Finished share of the load history, from 0 to 1; NaN for a step read from a file.
    ramp_done : float
        Applied share of the ramp of its segment, usually from 0 to 1; NaN for a step read from a file.
    bodies : sequence of Body
        The two bodies; none for a step read from a file.
    friction : float
        Coefficient of friction; 0 without friction, NaN for a law that is more than one coefficient.
    sharp : bool
        Whether the edge of the contact is known: no compliant layer, and a window that ends.
    shear_limit : float
        Bound of the shear traction, Pa; inf: none.
    """

    index: int
    lattice: Lattice
    fields: Fields
    history: Mapping[str, Any]
    companion: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    control: Mapping[str, Any] = field(default_factory=dict)
    prescribed: Mapping[str, float] = field(default_factory=dict)
    load_fraction: float = math.nan
    ramp_done: float = math.nan
    bodies: Sequence[Any] = ()
    friction: float = 0.0
    sharp: bool = True
    shear_limit: float = math.inf

    def __post_init__(self) -> None:
        if not isinstance(self.fields, dict | MappingProxyType):  # each is loaded at its use
            return
        safe = {name: _read_only(values) for name, values in self.fields.items()}
        object.__setattr__(self, "fields", MappingProxyType(safe))

    def __reduce__(self) -> tuple[Any, ...]:
        given = {entry.name: getattr(self, entry.name) for entry in dataclasses.fields(self)}
        plain: dict[str, Any] = {name: dict(v) if isinstance(v, Mapping) else v for name, v in given.items()}
        return partial(type(self), **plain), ()

    def __getattr__(self, name: str) -> Any:
        """Return a quantity."""
        if name.startswith("_") or name in ("fields", "history"):  # before they are set
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __getitem__(self, name: str) -> Any:
        """Return a quantity: an array over the nodes, or a number."""
        for values in (self.fields, self.history):
            if name in values:
                return values[name]
        hint = did_you_mean(name, [*self.fields, *self.history])
        raise KeyError(f"a load step of this run has no {name}{hint}")

    def __dir__(self) -> list[str]:
        """List the quantities, too."""
        return [*super().__dir__(), *self.fields, *self.history]

    @property
    def number(self) -> int:
        """Number of the step, from 1."""
        return self.index + 1

    @property
    def x(self) -> Array:
        """Coordinate of each node along x, m."""
        return self.lattice.x

    @property
    def y(self) -> Array:
        """Coordinate of each node along y, m."""
        return self.lattice.y

    @property
    def in_contact(self) -> Mask:
        """Nodes in contact."""
        return np.asarray(self.fields["zone"] > 0)

    @property
    def sticking(self) -> Mask:
        """Nodes that stick."""
        return np.asarray(self.fields["zone"] == 1)

    @property
    def residuals(self) -> dict[str, float]:
        """Residuals of the contact conditions and loads by their symbols: R_n, R_t, R_P, R_Q, R_M."""
        from .history_words import residuals

        return residuals(self.history)

    @property
    def head(self) -> Step:
        """The same step without the values of its fields."""
        return dataclasses.replace(self, fields=dict.fromkeys(self.fields, _NO_VALUES), companion={})

    @property
    def done(self) -> float:
        """Finished share of the load history with adaptive load steps; 0 without."""
        return float(self.control.get("done", 0.0))

    def bands(self, name: str) -> Iterator[tuple[Lattice, NDArray[Any]]]:
        """Yield a field in bands of rows, each with its window."""
        fields, row = self.fields, self.lattice.row_first
        for band in in_bands(bands_of(fields, name)):
            yield dataclasses.replace(self.lattice, row_first=row, n_row=len(band)), band
            row += len(band)

    def chosen(self, *names: str) -> dict[str, NDArray[Any]]:
        """Return the named fields, by default all that were kept."""
        fields = self.fields
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
                raise NotInResult(f"{name} of step {self.number} was not kept (output.every)")
        if not names and not any(VARIABLES[name].is_field for name in kept):
            raise NotInResult(f"no field of step {self.number} was kept (output.fields, output.every)")
        return kept

    @property
    def law(self) -> FrictionLaw | None:
        """Law of friction with a coefficient and a bound of the traction; None with another, or none."""
        if not math.isnan(self.friction):
            known = 0.0 < self.friction < math.inf
            return FrictionLaw(self.friction, self.shear_limit) if known else None
        if NODAL_FRICTION not in self.fields:  # of another law
            return None
        # a coefficient that varies, or has a bound; NaN where no step had a node
        return FrictionLaw(np.nan_to_num(np.asarray(self.fields[NODAL_FRICTION])), self.shear_limit)

    def traction_field(self, source: str | None = None) -> TractionField:
        """Return pressure and shear traction at any point; see `hexcontact.Result.traction_field`."""
        if source not in (None, *SOURCES):
            raise DeckError(f"source = {source!r}: expected {' or '.join(SOURCES)}")
        there = {name: np.asarray(self.fields[name]) for name in (*TRACTIONS, *EDGES) if name in self.fields}
        kept = {name: values for name, values in there.items() if is_kept(values)}
        for name in ("pressure", "gap") if source == "edges" else ("pressure",):
            if name not in kept:
                raise NotInResult(
                    f"the {name} of step {self.number} was not kept (output.fields, output.every)"
                )
        if source == "edges" and not self.sharp:
            raise NotInResult(
                "source = 'edges': expected nodes; the edges need the gap, and there are none with a "
                "compliant interface or in a window that repeats"
            )
        zero = np.zeros(self.lattice.shape)
        tractions = np.array([kept.get(name, zero) for name in TRACTIONS], dtype=float)
        if source == "nodes" or not (self.sharp and "gap" in kept):
            return TractionField.of_nodes(tractions, self.lattice)
        zone, gap = kept.get("zone"), kept["gap"]
        contact = tractions[0] > 0.0 if zone is None else zone > 0
        at = self.lattice.basis, self.lattice.start
        edges = ContactEdges(tractions[0], gap, contact, np.isfinite(gap), *at)
        if zone is None or not kept.keys() >= {*TRACTIONS} or not (law := self.law):
            return edges.field(tractions[1:])
        return edges.field(tractions[1:], np.asarray(zone == _STICK), law)

    def at(self, name: str, x: ArrayLike, y: ArrayLike, source: str | None = None) -> Array:
        """Return a field at points of the plane; see `hexcontact.Result.at`."""
        values = self.chosen(name)[name]
        return interpolate(self.lattice, name, values, x, y, self._tractions([name], source))

    def profile(
        self, *names: str, start: Point, end: Point, points: int | None = None, source: str | None = None
    ) -> Dataset:
        """Return fields along a line between two points; see `hexcontact.Result.profile`."""
        return self._along(Line(start, end), names, points, source)

    def section(
        self,
        *names: str,
        angle: float = 0.0,
        through: Point | None = None,
        points: int | None = None,
        source: str | None = None,
    ) -> Dataset:
        """Return fields along a line across the contact; see `hexcontact.Result.section`."""
        pressure = self.chosen("pressure")["pressure"]
        return self._along(Line(*section_ends(self.lattice, pressure, angle, through)), names, points, source)

    def _along(self, line: Line, names: Sequence[str], points: int | None, source: str | None) -> Dataset:
        fields = self.chosen(*names)
        return profile(self.lattice, fields, line, points, self._tractions(fields, source), step=self.number)

    def _tractions(self, names: Iterable[str], source: str | None) -> TractionField | None:
        """Return the tractions between the nodes, if there is one among some fields."""
        return self.traction_field(source) if any(name in TRACTIONS for name in names) else None

    def stress_at(
        self, points: ArrayLike, *components: str, body: int = 1, source: str | None = None
    ) -> Dataset:
        """Return stresses below the surface at points, x, y and depth (m); see `hexcontact.Result.stress`."""
        from ..interior.stress import below

        return below(under([self], self.bodies, body), {"points": points}, components, source=source)

    # --- display --------------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        """Describe the step in a line."""
        from .history_words import describe

        try:
            about = describe(self.history)
        except KeyError:
            about = ", ".join(self.history)
        return f"Step {self.number}: {about}"

    def _repr_html_(self) -> str:
        from ..text import Table
        from .history_words import extent_of, step_rows

        rows = step_rows(self.history, extent_of(self))
        return Table(("", ""), rows, f"Load step {self.number}")._repr_html_()


def _read_only(values: NDArray[Any]) -> NDArray[Any]:
    if isinstance(values, np.ndarray) and not values.flags.writeable:
        return values
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


_NO_VALUES = _read_only(np.empty(0))  # of the fields of a head


def bands_of(fields: Fields, name: str) -> Iterable[NDArray[Any]]:
    """Return a field in bands of rows, as they come."""
    return fields.bands(name) if isinstance(fields, Banded) else [np.asarray(fields[name])]


def in_bands(parts: Iterable[NDArray[Any]], rows: int = BAND) -> Iterator[NDArray[Any]]:
    """Join and cut bands into bands of a number of rows; the last may have fewer."""
    left: NDArray[Any] = np.empty(0)
    for part in parts:
        for first in range(0, len(part), rows):
            some = part[first : first + rows]
            left = np.concatenate([left, some]) if len(left) else some
            if len(left) >= rows:
                yield left[:rows]
                left = left[rows:]
    if len(left):
        yield left


# --- load steps of a result ---------------------------------------------------------------------------------


def nodal(step: Dataset, lattice: Lattice) -> Step:
    """Return a load step of a result, whose fields are read at their first use."""
    known, values = step.attrs, step.variables
    fields = [name for name in step.data_vars if values[name].dims == ("row", "col")]
    return Step(
        int(step["step"]) - 1,
        lattice,
        cast(Fields, step[fields].data_vars),
        {str(name): values[name].values.item() for name in step.data_vars if not values[name].dims},
        friction=friction_of(known),
        sharp=not (is_compliant(known) or lattice.periodic),
        shear_limit=float(known.get(SHEAR_LIMIT, math.inf)),
    )


def loaded(step: Step, more: Sequence[str] = (), edges: bool = True) -> dict[str, Any]:
    """Return the history, tractions and `more` fields of a step; `edges`: those that show the edges, too."""
    names = [name for name in (*TRACTIONS, *more) if name in step.fields]
    if edges and step.sharp and all(n in step.fields and is_kept(np.asarray(step.fields[n])) for n in EDGES):
        names += EDGES
    return {**step.history, **step.chosen(*names)}


def under(
    steps: Sequence[Step], bodies: Sequence[Any], body: int, more: Sequence[str] = (), edges: bool = True
) -> Loaded:
    """Return a body under the tractions of some steps; `more` and `edges` as of `loaded`."""
    from ..interior.stress import Loaded

    given = steps[0].lattice, [loaded(step, more, edges) for step in steps], bodies, body, steps[0].friction
    return Loaded(*given, surface=lambda place: steps[place].traction_field("edges"))


def with_shown(step: Dataset, lattice: Lattice, source: str | None = None) -> Dataset:
    """Return a load step of a result with the tractions of a source at the nodes."""
    names = [name for name in TRACTIONS if name in step and is_kept(step[name].values)]
    if "pressure" not in names:
        return step
    shown = nodal(step, lattice).traction_field(source).at_nodes()
    found = dict(zip(TRACTIONS, shown, strict=True))
    return step.assign({name: step[name].copy(data=found[name]) for name in names})


class PressureField:
    """The pressure of a solution at any point, from pressure (Pa) and gap (m) at the nodes.

    Near the edge of the contact its square is interpolated, which is linear in the distance; elsewhere, and
    where the contact ends at nodes that can never touch (the gap is NaN), the pressure itself is. `basis` has
    the basis vectors of the lattice as rows (m), `start` is the position of node [0, 0] (m).
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


def profile(
    lattice: Lattice,
    fields: Fields,
    line: Line,
    points: int | None = None,
    tractions: TractionField | None = None,
    **attributes: Any,
) -> Dataset:
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


def is_kept(values: NDArray[Any]) -> bool:
    """Test by its values whether the output has a field of a step."""
    return bool((values != NOT_KEPT).any() if values.dtype.kind == "i" else np.isfinite(values).any())
