"""Comparison of a load step with the closed solutions that hold for it.

Similar bodies (beta = 0) pressed by a constant normal load and then sheared along one line: Cattaneo-Mindlin,
and after each reversal Mindlin-Deresiewicz. Spheres twisted about their common normal: Lubkin. For other
histories there is no closed solution, and the functions return None.

Each is recognized from the deck, the attributes and the history, and holds if its assumptions are those of
the case. The pressure is that of a contact without friction if there is none, if the bodies are similar (beta
= 0), and in Goodman's coupling, where shear does not move it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ..arrays import Array
from ..core import flat
from ..core.measures import line_of
from ..deck.read import recorded
from ..deck.surfaces import Punch, Surface
from ..errors import DeckError
from ..text import TextTable, html_table, quantity, text_table
from ..variables import VARIABLES, spelled
from . import friction
from .friction import LubkinTorsion, MindlinContact
from .frictionless import AxisymmetricContact, EllipticContact, cone, flat_punch, power_law, rounded_punch
from .hertz_gap import (
    SIMILAR,
    QuadraticGap,
    attribute_of,
    friction_of,
    is_compliant,
    is_strained,
    is_worn,
    pressure_is_frictionless,
)

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]
    import xarray
    from rich.table import Table


CIRCULAR = 0.999  # least ratio of the axes of a circular contact
_SMALL = 1e-6  # share of the sliding load that is no load, and no change of a load
_ASIDE = 1e-3  # largest distance from the line of the load, as a share of the sliding load, or shift
_BEFORE_SLIDING = (
    0.999  # share of the sliding load beyond which the rigid motion does not follow from the load
)
_FINE = 24  # points of a curve between two load steps


def turning_points(loads: Iterable[float]) -> list[float]:
    """Return the turning points of a load history that determine a contact of constant size.

    The last is the present load. A contact in partial slip follows Masing's rules: a new slip zone that is as
    large as an older one removes its turning points.
    """
    history = [*loads]
    if not history:
        return []
    turns, count = flat.masing_turns(history)
    return [float(load) for load in turns[:count]]


def superposed(first: Callable[[float], Array | float], turns: Sequence[float]) -> Array:
    """Return a traction or motion after reversals: f(Q1) + 2 f((Q2 - Q1)/2) + 2 f((Q3 - Q2)/2) + ..."""
    total = np.asarray(first(turns[0]))
    for before, after in itertools.pairwise(turns):
        total = total + 2.0 * first(0.5 * (after - before))
    return total


@dataclass(frozen=True)
class PartialSlip:
    """Similar bodies sheared along one line under a constant normal load, over a Hertz circle or ellipse.

    Over an ellipse the tractions have the same form as over a circle: stick and contact area are similar.
    """

    contact: MindlinContact  # spheres with a contact of the same area
    ellipse: EllipticContact  # Hertz contact
    center: tuple[float, float]  # its center, m
    direction: tuple[float, float]  # unit vector of the tangential load
    # turning points of the tangential load along `direction`, N; the last is the present load
    turns: tuple[float, ...]
    loads: tuple[float, ...]  # all loads along `direction`, N

    @property
    def name(self) -> str:
        """Name of the solution."""
        return "Cattaneo–Mindlin" if len(self.turns) == 1 else "Mindlin–Deresiewicz"

    @property
    def stick_ratio(self) -> float:
        """Size of the stick area relative to the contact area, c/a."""
        swing = self.turns[0] if len(self.turns) == 1 else 0.5 * (self.turns[-1] - self.turns[-2])
        return float(self.contact.stick_radius(swing)) / self.contact.contact_radius

    def traction(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the shear traction on body 1 along x and y (Pa) at points (m)."""
        way = np.hypot(*self.ellipse.local(x - self.center[0], y - self.center[1]))
        radius = way * self.contact.contact_radius
        size = superposed(lambda load: self.contact.traction(radius, load), self.turns)
        return size * self.direction[0], size * self.direction[1]


class ClosedForms:
    """The closed solutions for a result.

    Parameters
    ----------
    dataset : xarray.Dataset
        The whole result.
    """

    def __init__(self, dataset: xarray.Dataset) -> None:
        self.dataset = dataset
        self.friction = friction_of(dataset.attrs)
        self.modulus = attribute_of(dataset.attrs, "effective_modulus")
        self.gamma = attribute_of(dataset.attrs, "tangential_compliance_ratio")
        self.beta = attribute_of(dataset.attrs, "dundurs_beta")
        self.static = dataset.attrs.get("algorithm") == "static"
        self.deck = recorded(str(dataset.attrs.get("deck", "")))
        similar = abs(self.beta) <= SIMILAR
        self.apply = similar and 0.0 < self.friction < math.inf and not is_strained(dataset)

    @cached_property
    def gap(self) -> QuadraticGap | None:
        """The gap, if it is a quadratic form."""
        return QuadraticGap.of(self.dataset)

    @property
    def surface(self) -> Surface | None:
        """The only surface that is not flat; None without one, or for a shape of a later version."""
        try:
            return self.deck.only_surface
        except DeckError:
            return None

    def partial_slip(self, number: int) -> PartialSlip | None:
        """Return the closed solution of a step with shear, None if there is none."""
        sheared = self.sheared(number)
        if sheared is None or self.gap is None:
            return None
        history, direction, loads = sheared
        hertz = self.gap.contact(history.normal_load)
        contact = MindlinContact(
            self.friction, history.normal_load, hertz.radius, 4.0 / self.modulus * (1.0 + 0.5 * self.gamma)
        )
        if np.abs(history["twist"]).max() * contact.contact_radius > _ASIDE * contact.sliding_shift:
            return None
        return PartialSlip(
            contact, hertz, self.gap.center, direction, tuple(turning_points(loads)), tuple(loads.tolist())
        )

    def sheared(self, number: int) -> tuple[History, tuple[float, float], Array] | None:
        """Return history, line and loads of a step if similar bodies are sheared along it at a constant P."""
        history = History(self.dataset, number, self.static)
        scale = self.friction * history.normal_load
        load = np.stack([history[f"tangential_load_{axis}"] for axis in "xy"])
        direction = line_of(load, _SMALL * scale, _ASIDE * scale) if self.apply else None
        if direction is None or history.is_worn:
            return None
        loads = history.at_constant_pressure(np.array(direction) @ load, scale)
        return None if loads is None else (history, direction, loads)

    def shear_loop(self) -> tuple[Array, Array] | None:
        """Return the curve of the shift (m) over the tangential load (N) along its direction, for spheres."""
        for number in self.dataset["step"].values[::-1]:
            found = self.partial_slip(int(number))
            if found is not None:
                loads = _until_sliding(found.loads, found.contact.sliding_load)
                return _curve(loads, found.contact.shift) if is_circular(found.ellipse) else None
        return None

    def torsion_loop(self) -> tuple[Array, Array] | None:
        """Return the curve of the twist (rad) over the torque (N m), for spheres."""
        numbers = self.dataset["step"].values[::-1]
        return next((loop for number in numbers if (loop := self.torsion(int(number))) is not None), None)

    def torsion(self, number: int) -> tuple[Array, Array] | None:
        """Return the same curve up to a load step; None if that step has no closed solution."""
        if not self.apply or self.gap is None:
            return None
        history = History(self.dataset, number, self.static)
        shear = np.hypot(*(history[f"tangential_load_{axis}"] for axis in "xy")).max()
        aside = shear > _ASIDE * self.friction * history.normal_load
        if not history.normal_load > 0.0 or aside or history.is_worn:
            return None
        hertz = self.gap.contact(history.normal_load)
        contact = LubkinTorsion(
            self.friction, history.normal_load, hertz.semi_major, 2.0 / self.modulus * (1.0 + self.gamma)
        )
        loads = history.at_constant_pressure(history["torque"], contact.sliding_torque)
        if loads is None or not is_circular(hertz):
            return None
        turned = _until_sliding(loads.tolist(), _BEFORE_SLIDING * contact.sliding_torque)
        return _curve(turned, _lubkin(contact, max(map(abs, turned))))


class History:
    """The history of a load step: all steps up to it, or itself alone if it is static."""

    def __init__(self, dataset: xarray.Dataset, number: int, static: bool) -> None:
        last = int(np.flatnonzero(dataset["step"].values == number)[0])
        self.steps = slice(last if static else 0, last + 1)
        self.dataset = dataset
        self.normal_load = float(dataset["normal_load"].values[last])
        self.is_worn = is_worn(dataset.isel(step=self.steps))

    def __getitem__(self, name: str) -> Array:
        if name not in self.dataset:
            return np.zeros_like(self["normal_load"])
        return np.asarray(self.dataset[name].values[self.steps], dtype=float)

    def at_constant_pressure(self, loads: Array, sliding: float) -> Array | None:
        """Return the loads from the first one on, if the normal load is constant from the step before it."""
        if not np.isfinite(loads).all() or np.abs(loads).max() > (1.0 + _ASIDE) * sliding:
            return None
        begun = np.flatnonzero(np.abs(loads) > _SMALL * sliding)
        if not begun.size:
            return None
        pressed = self["normal_load"][max(begun[0] - 1, 0) :]
        if np.ptp(pressed) > _SMALL * pressed[-1]:
            return None
        loads = np.clip(loads[begun[0] :], -sliding, sliding)
        moved = np.abs(np.diff(loads, prepend=0.0)) > _SMALL * sliding  # a constant load has no turning point
        return np.asarray(loads[moved])


def _until_sliding(loads: Sequence[float], sliding: float) -> list[float]:
    """Return the loads up to the sliding load, beyond which the motion does not follow from them."""
    reached = next((k for k, load in enumerate(loads) if abs(load) >= _BEFORE_SLIDING * sliding), None)
    return [*loads] if reached is None else [*loads[:reached], math.copysign(sliding, loads[reached])]


def is_circular(hertz: EllipticContact) -> bool:
    """Test whether an ellipse is a circle."""
    return hertz.semi_minor >= CIRCULAR * hertz.semi_major


def _lubkin(contact: LubkinTorsion, largest: float) -> Callable[[float], Array]:
    """Return the twist under a first torque up to the largest one, by a table that is exact at its points."""
    stick = np.linspace(contact.contact_radius, contact.stick_radius(largest), 8 * _FINE)[1:]
    torque = np.array([0.0, *(contact.torque(c) for c in stick)])
    twist = np.array([0.0, *(contact.twist(c) for c in stick)])
    return lambda load: np.asarray(np.sign(load) * np.interp(abs(load), torque, twist))


def _curve(loads: Sequence[float], first: Callable[[float], Array]) -> tuple[Array, Array]:
    """Return motions and loads along a history that begins at 0, with points between the steps."""
    branches = [np.linspace(a, b, _FINE + 1)[1:] for a, b in itertools.pairwise((0.0, *loads))]
    fine = np.concatenate([[0.0], *branches])
    motion, turns = [0.0], [0.0]
    for load in fine[1:]:
        turns = turning_points([*turns, float(load)])  # they stand for the whole history
        motion.append(float(superposed(first, turns)))
    return np.array(motion), fine


_STEADY = 1e-6  # share of the sliding load, or of a motion, that is none


@dataclass(frozen=True)
class Exact:
    """Values and fields of a closed solution for a load step."""

    solution: str  # name of the solution
    values: Mapping[str, float]  # its values (SI), by the names of the quantities of a result
    # fields as functions of x and y (m), by their names
    fields: Mapping[str, Callable[[Array, Array], Array]] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)  # scales of the errors of the fields


def closed_solutions(dataset: xarray.Dataset, number: int) -> tuple[list[Exact], str]:
    """Return the closed solutions that hold for a load step, and a remark on them."""
    place = int(np.flatnonzero(dataset["step"].values == number)[0])
    so_far = dataset.isel(step=slice(0, place + 1))
    load = float(so_far["normal_load"][-1])
    if not load > 0.0:
        return [], "nothing is pressed in this load step"
    if is_compliant(so_far.attrs):
        return [], "no closed-form solution is known for a compliant interface"
    if is_worn(so_far):
        return [], "no closed-form solution is known for worn surfaces"
    closed = ClosedForms(so_far)
    known = [*_normal(closed, load), *_shear(closed, number), *_torsion(closed, number)]
    known += [] if is_strained(so_far) else _dissimilar(closed, load)
    if known:
        note = "the gap was given in Python; the solutions are those of its values at the nodes"
        return known, note if "surface" in closed.deck.given else ""
    if pressure_is_frictionless(so_far.attrs):
        return [], "no closed-form solution is known for these surfaces"
    return [], (
        "no closed-form solution is known for dissimilar bodies with friction under these loads; there are "
        "some for similar bodies, for pressing without slip, and for pressing with solver.coupling = goodman"
    )


# --- pressure -----------------------------------------------------------------------------------------------


def _normal(closed: ClosedForms, load: float) -> list[Exact]:
    """Return the contact without friction: Hertz for a quadratic gap, else by the shape of the surface."""
    if not pressure_is_frictionless(closed.dataset.attrs):
        return []
    without_friction = closed.friction == 0.0  # else shear stores energy, too
    if (gap := closed.gap) is not None:
        hertz = gap.contact(load)
        values = {"max_pressure": hertz.max_pressure, "approach": gap.approach(load)}
        values["contact_radius_fit"] = hertz.radius
        if without_friction:
            values["elastic_energy"] = 0.4 * load * hertz.approach
        x0, y0 = gap.center
        fields = {"pressure": lambda x, y: hertz.pressure(x - x0, y - y0)}
        return [Exact("Hertz", values, fields, {"pressure": hertz.max_pressure})]
    surface, shape = _shape_of(closed)
    if shape is None:
        return []
    contact = shape.contact(surface, closed.modulus, load)
    values = {"max_pressure": contact.max_pressure, "approach": contact.approach}
    if not shape.rim:
        values["contact_radius_fit"] = contact.contact_radius
    if without_friction and (energy := shape.energy(surface)):
        values["elastic_energy"] = energy * load * contact.approach
    if not math.isfinite(values["max_pressure"]):
        del values["max_pressure"]
        return [Exact(shape.name, values)]
    x0, y0 = surface.offset
    fields = {"pressure": lambda x, y: contact.pressure(np.hypot(x - x0, y - y0))}
    return [Exact(shape.name, values, fields, {"pressure": contact.max_pressure})]


@dataclass(frozen=True)
class _Shape:
    """A surface of revolution with a closed solution."""

    name: str  # name of the solution
    # the contact of a surface of this shape with an effective modulus (Pa) under a load (N)
    contact: Callable[[Any, float, float], AxisymmetricContact]
    energy: Callable[[Any], float]  # its elastic energy over load times approach; 0: unknown
    rim: bool = False  # whether the contact ends at a sharp rim


_SHAPES = {
    "cone": _Shape("Sneddon", lambda s, e, p: cone(e, s.slope, normal_load=p), lambda s: 1.0 / 3.0),
    "power": _Shape(
        "Sneddon",
        lambda s, e, p: power_law(e, s.coefficient, s.exponent, normal_load=p),
        lambda s: s.exponent / (2.0 * s.exponent + 1.0),  # P ~ approach^(1 + 1/n)
    ),
    "punch": _Shape(
        "Sneddon", lambda s, e, p: flat_punch(e, s.radius, normal_load=p), lambda s: 0.5, rim=True
    ),
    "rounded_punch": _Shape(
        "Sneddon, Galin",
        lambda s, e, p: rounded_punch(e, s.flat_radius, s.edge_radius, normal_load=p),
        lambda s: 0.0,
    ),
}


def _shape_of(closed: ClosedForms) -> tuple[Any, _Shape | None]:
    """Return the only surface that is not flat, and its shape if that has a closed solution."""
    surface = closed.surface
    return surface, _SHAPES.get(surface.shape) if surface is not None else None


# --- similar bodies, sheared or twisted ---------------------------------------------------------------------


def _shear(closed: ClosedForms, number: int) -> list[Exact]:
    """Return Cattaneo-Mindlin, or Mindlin-Deresiewicz after reversals."""
    slip = closed.partial_slip(number)
    if slip is None:
        return _shear_of_shape(closed, number)
    radius, sliding = slip.contact.contact_radius, slip.contact.sliding_load
    values = {}
    if abs(slip.turns[-1]) < (1.0 - _STEADY) * sliding:
        values["stick_radius_fit"] = slip.stick_ratio * radius
        if is_circular(slip.ellipse):
            shift = float(superposed(slip.contact.shift, slip.turns))
            along = {"shift_x": shift * slip.direction[0], "shift_y": shift * slip.direction[1]}
            values |= {name: value for name, value in along.items() if abs(value) > 1e-9 * abs(shift)}

    def component(axis: int) -> Callable[[Array, Array], Array]:
        return lambda x, y: slip.traction(x, y)[axis]

    fields = {f"traction_{'xy'[k]}": component(k) for k in (0, 1) if abs(slip.direction[k]) > 1e-9}
    scale = slip.contact.friction_coefficient * slip.ellipse.max_pressure
    return [Exact(slip.name, values, fields, dict.fromkeys(fields, scale))]


def _shear_of_shape(closed: ClosedForms, number: int) -> list[Exact]:
    """Return the superposition of contacts without friction, if the shape of the surface has them."""
    surface, shape = _shape_of(closed)
    sheared = closed.sheared(number) if shape is not None else None
    if sheared is None or shape is None:
        return []
    history, direction, loads = sheared
    contact = friction.SuperposedContact(
        closed.friction, history.normal_load, closed.gamma, partial(shape.contact, surface, closed.modulus)
    )
    turns = turning_points(loads)
    if history["twist"].any() or abs(turns[-1]) > (1.0 - _STEADY) * contact.sliding_load:
        return []
    swing = turns[0] if len(turns) == 1 else 0.5 * (turns[-1] - turns[-2])
    shift = float(superposed(contact.shift, turns))
    values = {
        f"shift_{axis}": shift * part for axis, part in zip("xy", direction, strict=True) if abs(part) > 1e-9
    }
    if not shape.rim:
        values["stick_radius_fit"] = contact.stick_radius(swing)
    x0, y0 = surface.offset

    def component(axis: int) -> Callable[[Array, Array], Array]:
        return lambda x, y: (
            direction[axis] * superposed(partial(contact.traction, np.hypot(x - x0, y - y0)), turns)
        )

    peak = contact.pressed(history.normal_load).max_pressure
    along = [axis for axis in (0, 1) if abs(direction[axis]) > 1e-9 and math.isfinite(peak)]
    fields = {f"traction_{'xy'[axis]}": component(axis) for axis in along}
    return [Exact("Jaeger, Ciavarella", values, fields, dict.fromkeys(fields, closed.friction * peak))]


def _torsion(closed: ClosedForms, number: int) -> list[Exact]:
    """Return Lubkin's twist, if it holds up to this step and the contact does not slide."""
    torque = float(closed.dataset["torque"][-1]) if "torque" in closed.dataset else 0.0
    loop = closed.torsion(number) if torque else None
    if loop is None or abs(loop[1][-1] - torque) > _STEADY * abs(torque):
        return []
    return [Exact("Lubkin", {"twist": float(loop[0][-1])})]


# --- dissimilar bodies, pressed -----------------------------------------------------------------------------


def _dissimilar(closed: ClosedForms, load: float) -> list[Exact]:
    """Return closed solutions for dissimilar bodies under a growing normal load alone."""
    beta, mu, attributes = closed.beta, closed.friction, closed.dataset.attrs
    goodman = attributes.get("coupling") == "goodman"
    if mu == 0.0 or abs(beta) <= SIMILAR or not _pressed_only(closed.dataset, mu * load):
        return []
    hertz = closed.gap.contact(load) if closed.gap is not None else None
    incremental = attributes.get("algorithm") == "incremental"
    sphere = hertz if hertz is not None and is_circular(hertz) and incremental else None
    if math.isinf(mu) and not goodman and abs(beta) <= 0.5:
        kappa, chi = friction.no_slip_constants(beta)
        if sphere is not None:
            values = {
                "approach": chi * (kappa * chi) ** (-2.0 / 3.0) * sphere.approach,
                "contact_radius": (kappa * chi) ** (-1.0 / 3.0) * sphere.semi_major,
            }
            return [Exact("Mossakovskii, Spence", values)]
        if isinstance(closed.surface, Punch):
            stiffness = 2.0 * closed.modulus * closed.surface.radius
            return [Exact("Mossakovskii", {"approach": load / (kappa * stiffness)})]
    if math.isfinite(mu) and goodman and sphere is not None:
        ratio = friction.goodman_stick_ratio(beta, mu)
        return [Exact("Goodman, Spence", {"stick_radius_fit": ratio * sphere.semi_major})]
    return []


def _pressed_only(dataset: xarray.Dataset, sliding: float) -> bool:
    """Test whether a growing normal load is the only load."""
    loads = dataset["normal_load"].values
    if (np.diff(loads) < -_STEADY * loads[-1]).any():
        return False
    scale = sliding if math.isfinite(sliding) else float(loads[-1])
    for axis in "xy":
        name = f"tangential_load_{axis}"
        if name in dataset and np.abs(dataset[name].values).max() > _STEADY * scale:
            return False
    turned = np.abs(dataset["twist"].values).max() if "twist" in dataset else 0.0
    return bool(turned == 0.0)


_HEADERS = ("", "solution", "exact", "computed", "error")


@dataclass(frozen=True)
class Entry:
    """A line of a comparison.

    Attributes
    ----------
    quantity : str
        Name of the quantity.
    solution : str
        Name of the closed solution.
    exact, computed : float
        The two values, SI; NaN for a field.
    error : float
        Their relative difference. For a field, the root mean square of the difference over the nodes in
        contact, relative to the largest value; for a vector relative to the largest of all components.
    """

    quantity: str
    solution: str
    exact: float
    computed: float
    error: float


class Comparison(Sequence[Entry]):
    """Comparison of a load step with closed solutions; printed, a table.

    Parameters
    ----------
    entries : sequence of Entry
        The lines.
    step : int
        Number of the load step.
    note : str
        A remark on them, or the reason why there are none.
    """

    def __init__(self, entries: Sequence[Entry], step: int, note: str = "") -> None:
        self.entries, self.step, self.note = list(entries), step, note

    @overload
    def __getitem__(self, place: int | str) -> Entry: ...

    @overload
    def __getitem__(self, place: slice) -> list[Entry]: ...

    def __getitem__(self, place: int | str | slice) -> Entry | list[Entry]:
        """Return a line by its position, or the first one about a quantity."""
        if isinstance(place, str):
            for entry in self.entries:
                if entry.quantity == place:
                    return entry
            raise KeyError(f"no closed-form solution has {place}")
        return self.entries[place]

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.entries)

    @property
    def largest_error(self) -> float:
        """Largest of the errors; NaN without closed solutions."""
        return max((abs(entry.error) for entry in self.entries), default=math.nan)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the table: quantity, solution, unit, exact, computed, error."""
        import pandas

        table = pandas.DataFrame(self.entries, columns=[entry.name for entry in fields(Entry)])
        table.insert(2, "unit", [VARIABLES[name].units for name in table["quantity"]])
        return table.set_index("quantity")

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            (
                spelled(entry.quantity),
                entry.solution,
                *(quantity(v, VARIABLES[entry.quantity].unit, 6) for v in (entry.exact, entry.computed)),
                f"{100 * entry.error:.3f} % rms"
                if math.isnan(entry.exact)
                else f"{100 * entry.error:+.3f} %",
            )
            for entry in self
        ]

    @property
    def _title(self) -> str:
        return f"Load step {self.step} against closed-form solutions"

    def __repr__(self) -> str:
        """Return the table as text."""
        table = text_table(_HEADERS, self._rows()) if self.entries else ""
        return "\n".join(filter(None, (self._title, table, self.note)))

    def __rich__(self) -> Table:
        """Return the table for a terminal."""
        shown = TextTable(self._title, _HEADERS, self._rows()).__rich__()
        shown.caption = self.note or None
        return shown

    def _repr_html_(self) -> str:
        return html_table(self._title, _HEADERS if self.entries else (), self._rows(), self.note)


# --- comparing ----------------------------------------------------------------------------------------------


def compare(
    dataset: xarray.Dataset, data: xarray.Dataset, exact: Mapping[str, float] | object | None, name: str
) -> Comparison:
    """Compare a load step of a dataset, `data`; see `hexcontact.Result.compare`."""
    number = int(data["step"])
    note = ""
    if exact is None:
        known, note = closed_solutions(dataset, number)
    else:
        known = [_own(exact, name, dataset)]
    entries = [entry for one in known for entry in _entries(data, one)]
    radius = float(data["contact_radius"]) if "contact_radius" in data else 0.0
    if entries and radius:
        spacings = f"{radius / float(dataset.attrs['lattice_spacing']):.3g} spacings in the contact radius"
        note = f"{spacings}; {note}" if note else spacings
    return Comparison(entries, number, note)


def _own(exact: Mapping[str, float] | object, name: str, dataset: xarray.Dataset) -> Exact:
    """Return a given solution."""
    if isinstance(exact, Mapping):
        for quantity_name in exact:
            if dataset[str(quantity_name)].dims != ("step",):
                raise DeckError(f"{quantity_name}: expected a quantity with one value by step")
        return Exact(name, {str(key): float(value) for key, value in exact.items()})
    names = ("normal_load", "approach", "max_pressure", "contact_radius")
    values = {key: float(value) for key in names if (value := getattr(exact, key, None)) is not None}
    if not values:
        raise DeckError(
            "exact: expected values by the names of quantities, or a solution of hexcontact.analytic"
        )
    return Exact(name, {key: value for key, value in values.items() if math.isfinite(value)})


def _entries(data: Any, exact: Exact) -> Iterator[Entry]:
    """Yield the lines of one solution."""
    for name, value in exact.values.items():
        if name in data and math.isfinite(computed := float(data[name])):
            error = (computed - value) / abs(value) if value else (0.0 if computed == 0.0 else math.inf)
            yield Entry(name, exact.solution, value, computed, error)
    if "pressure" not in data:
        return
    inside = data["pressure"].values > 0.0
    x, y = data["x"].values[inside], data["y"].values[inside]
    for name, function in exact.fields.items():
        if name in data and inside.any():
            difference = data[name].values[inside] - function(x, y)
            if np.isfinite(difference).all():
                rms = float(np.sqrt(np.mean(difference**2)))
                yield Entry(name, exact.solution, math.nan, math.nan, rms / exact.scales[name])
