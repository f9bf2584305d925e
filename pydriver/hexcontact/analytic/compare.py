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

from ..arrays import Array, DataFrame, Dataset
from ..core import flat
from ..core.measures import line_of
from ..deck.read import recorded
from ..deck.surfaces import Punch, Surface
from ..errors import DeckError
from ..text import Table, counted, quantity
from ..variables import VARIABLES, spelled
from . import friction, hertz_gap
from .friction import LubkinTorsion, MindlinContact, SuperposedContact
from .frictionless import EllipticContact, cone, flat_punch, power_law, rounded_punch
from .hertz_gap import Pressed

if TYPE_CHECKING:
    from rich.table import Table as RichTable


CIRCULAR = 0.999  # least ratio of the axes of a circular contact
_SMALL = 1e-6  # share of the sliding load, or of a motion, that is none, and no change of it
_ASIDE = 1e-3  # largest distance from the line of the load, as a share of the sliding load, or shift
_BEFORE_SLIDING = 0.999  # share of the sliding load beyond which it does not determine the rigid motion
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


_SHAPES: dict[str, Callable[[Any, float], Pressed]] = {  # by surface and effective modulus (Pa)
    "cone": lambda s, e: Pressed("Sneddon", s.offset, lambda p: cone(e, s.slope, normal_load=p), 1.0 / 3.0),
    "power": lambda s, e: Pressed(
        "Sneddon",
        s.offset,
        lambda p: power_law(e, s.coefficient, s.exponent, normal_load=p),
        s.exponent / (2.0 * s.exponent + 1.0),  # P ~ approach^(1 + 1/n)
    ),
    "punch": lambda s, e: Pressed(
        "Sneddon", s.offset, lambda p: flat_punch(e, s.radius, normal_load=p), 0.5, rim=True
    ),
    "rounded_punch": lambda s, e: Pressed(
        "Sneddon, Galin",
        s.offset,
        lambda p: rounded_punch(e, s.flat_radius, s.edge_radius, normal_load=p),
        0.0,
    ),
}


@dataclass(frozen=True)
class PartialSlip:
    """Similar bodies sheared along one line under a constant normal load, over a circle or an ellipse.

    Over a Hertz ellipse the tractions have the same form as over the circle of the same area: stick and
    contact area are similar.
    """

    contact: Any  # of the first loading: `MindlinContact`, of that circle, or `SuperposedContact`
    ellipse: Any  # its contact without friction by Hertz; None for another one
    center: tuple[float, float]  # m
    direction: tuple[float, float]  # unit vector of the tangential load
    # turning points of the tangential load along `direction`, N; the last is the present load
    turns: tuple[float, ...]
    loads: tuple[float, ...]  # all loads along `direction`, N

    @property
    def name(self) -> str:
        """Name of the solution."""
        if self.ellipse is None:
            return "Jaeger, Ciavarella"
        return "Cattaneo–Mindlin" if len(self.turns) == 1 else "Mindlin–Deresiewicz"

    @property
    def swing(self) -> float:
        """Load of a first loading with the same stick area, N."""
        return self.turns[0] if len(self.turns) == 1 else 0.5 * (self.turns[-1] - self.turns[-2])

    @property
    def stick_ratio(self) -> float:
        """Size of the stick area relative to the contact area of Hertz, c/a."""
        return float(self.contact.stick_radius(self.swing)) / self.ellipse.radius

    def traction(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the shear traction on body 1 along x and y (Pa) at points (m)."""
        x, y = x - self.center[0], y - self.center[1]
        hertz = self.ellipse
        radius = np.hypot(*hertz.local(x, y)) * hertz.radius if hertz else np.hypot(x, y)
        size = superposed(lambda load: self.contact.traction(radius, load), self.turns)
        return size * self.direction[0], size * self.direction[1]


class ClosedForms:
    """The closed solutions for a whole result."""

    def __init__(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self.friction = hertz_gap.friction_of(dataset.attrs)
        self.modulus = hertz_gap.attribute_of(dataset.attrs, "effective_modulus")
        self.gamma = hertz_gap.attribute_of(dataset.attrs, "tangential_compliance_ratio")
        self.beta = hertz_gap.attribute_of(dataset.attrs, "dundurs_beta")
        self.static = dataset.attrs.get("algorithm") == "static"
        self.deck = recorded(str(dataset.attrs.get("deck", "")))
        similar = abs(self.beta) <= hertz_gap.SIMILAR
        self.apply = similar and 0.0 < self.friction < math.inf and not hertz_gap.is_strained(dataset)

    @property
    def surface(self) -> Surface | None:
        """The only surface that is not flat; None without one, or for a shape of a later version."""
        try:
            return self.deck.only_surface
        except DeckError:
            return None

    @cached_property
    def pressed(self) -> Pressed | None:
        """The contact without friction: Hertz for a quadratic gap, else by the shape of the surface."""
        if hertz := hertz_gap.quadratic(self.dataset):
            return hertz
        surface = self.surface
        known = _SHAPES.get(surface.shape) if surface is not None else None
        return known(surface, self.modulus) if known and not math.isnan(self.modulus) else None

    def sheared(self, number: int) -> PartialSlip | None:
        """Return the closed solution of a step with shear, None if there is none."""
        history, pressed = History(self.dataset, number, self.static), self.pressed
        scale = self.friction * history.normal_load
        load = np.stack([history[f"tangential_load_{axis}"] for axis in "xy"])
        direction = line_of(load, _SMALL * scale, _ASIDE * scale) if self.apply else None
        if pressed is None or direction is None or history.is_worn or history.rolls:
            return None
        loads = history.at_constant_pressure(np.array(direction) @ load, scale)
        if loads is None:
            return None
        line = pressed.center, direction, tuple(turning_points(loads)), tuple(loads.tolist())
        law, twist = (self.friction, history.normal_load), history["twist"]
        hertz = pressed.contact(history.normal_load)
        if isinstance(hertz, EllipticContact):
            alike = MindlinContact(*law, hertz.radius, 4.0 / self.modulus * (1.0 + 0.5 * self.gamma))
            twisted = np.abs(twist).max() * hertz.radius > _ASIDE * alike.sliding_shift
            return None if twisted else PartialSlip(alike, hertz, *line)
        contact = SuperposedContact(*law, self.gamma, pressed.contact)
        slides = abs(line[2][-1]) > (1.0 - _SMALL) * contact.sliding_load
        return None if slides or twist.any() else PartialSlip(contact, None, *line)

    def partial_slip(self, number: int) -> PartialSlip | None:
        """Return the closed solution of a step with shear over a Hertz contact, None if there is none."""
        found = self.sheared(number)
        return found if found and found.ellipse else None

    def _latest(self, solution: Callable[[int], Any]) -> Any:
        """Return the closed solution of the last step that has one; None without one."""
        return next(
            filter(None, (solution(int(number)) for number in self.dataset["step"].values[::-1])), None
        )

    def shear_loop(self) -> tuple[Array, Array] | None:
        """Return the curve of the shift (m) over the tangential load (N) along its direction, for spheres."""
        found = self._latest(self.partial_slip)
        if found is None or not is_circular(found.ellipse):
            return None
        return _curve(_until_sliding(found.loads, found.contact.sliding_load), found.contact.shift)

    def torsion_loop(self) -> tuple[Array, Array] | None:
        """Return the curve of the twist (rad) over the torque (N m), for spheres."""
        loop: tuple[Array, Array] | None = self._latest(self.torsion)
        return loop

    def torsion(self, number: int) -> tuple[Array, Array] | None:
        """Return the same curve up to a load step; None if that step has no closed solution."""
        history, pressed = History(self.dataset, number, self.static), self.pressed
        shear = np.hypot(*(history[f"tangential_load_{axis}"] for axis in "xy")).max()
        aside = shear > _ASIDE * self.friction * history.normal_load
        if pressed is None or not (self.apply and history.normal_load > 0.0):
            return None
        if aside or history.is_worn or history.rolls:
            return None
        hertz = pressed.contact(history.normal_load)
        if not is_circular(hertz):
            return None
        compliance = 2.0 / self.modulus * (1.0 + self.gamma)
        contact = LubkinTorsion(self.friction, history.normal_load, hertz.semi_major, compliance)
        loads = history.at_constant_pressure(history["torque"], contact.sliding_torque)
        if loads is None:
            return None
        turned = _until_sliding(loads.tolist(), _BEFORE_SLIDING * contact.sliding_torque)
        return _curve(turned, _lubkin(contact, max(map(abs, turned))))


class History:
    """The history of a load step: all steps up to it, or itself alone if it is static."""

    def __init__(self, dataset: Dataset, number: int, static: bool) -> None:
        last = int(np.flatnonzero(dataset["step"].values == number)[0])
        self.steps = slice(last if static else 0, last + 1)
        self.dataset = dataset
        self.normal_load = float(dataset["normal_load"].values[last])
        self.is_worn = hertz_gap.is_worn(dataset.isel(step=self.steps))
        rolled = "rolled_distance" in dataset  # not a number in steps without rolling
        self.rolls = rolled and bool(np.isfinite(self["rolled_distance"]).any())

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


def is_circular(contact: Any) -> bool:
    """Test whether a contact is that of Hertz, over a circle."""
    return isinstance(contact, EllipticContact) and contact.semi_minor >= CIRCULAR * contact.semi_major


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


@dataclass(frozen=True)
class Exact:
    """Values and fields of a closed solution for a load step."""

    solution: str  # name of the solution
    values: Mapping[str, float]  # its values (SI), by the names of the quantities of a result
    # fields as functions of x and y (m), and scales of their errors, by their names
    fields: Mapping[str, tuple[Callable[[Array, Array], Array], float]] = field(default_factory=dict)


def closed_solutions(dataset: Dataset, number: int) -> tuple[list[Exact], str]:
    """Return the closed solutions that hold for a load step, and a remark on them."""
    place = int(np.flatnonzero(dataset["step"].values == number)[0])
    so_far = dataset.isel(step=slice(0, place + 1))
    load = float(so_far["normal_load"][-1])
    for excluded, note in (
        (not load > 0.0, "nothing is pressed in this load step"),
        (hertz_gap.is_compliant(so_far.attrs), "no closed-form solution is known for a compliant interface"),
        ("coating" in so_far.attrs, "no closed-form solution is known for bodies with coatings"),
        (hertz_gap.is_worn(so_far), "no closed-form solution is known for worn surfaces"),
    ):
        if excluded:
            return [], note
    closed = ClosedForms(so_far)
    known = [*_normal(closed, load), *_shear(closed, number), *_torsion(closed, number)]
    known += [] if hertz_gap.is_strained(so_far) else _dissimilar(closed, load)
    if known:
        note = "the gap was given in Python; the solutions are those of its values at the nodes"
        return known, note if "surface" in closed.deck.given else ""
    if hertz_gap.pressure_is_frictionless(so_far.attrs):
        return [], "no closed-form solution is known for these surfaces"
    return [], (
        "no closed-form solution is known for dissimilar bodies with friction under these loads; there are "
        "some for similar bodies, for pressing without slip, and for pressing with solver.coupling = goodman"
    )


# --- pressure -----------------------------------------------------------------------------------------------


def _normal(closed: ClosedForms, load: float) -> list[Exact]:
    """Return the contact without friction."""
    pressed, attributes = closed.pressed, closed.dataset.attrs
    if not hertz_gap.pressure_is_frictionless(attributes):
        return []
    if pressed is None:
        roller = hertz_gap.roller_on_flat(str(attributes.get("deck", "")), attributes, load)
        found = roller and roller.contact(load)
        known = [name for name in ("max_pressure", "approach") if hasattr(found, name)]
        return [Exact(roller.name, {name: getattr(found, name) for name in known})] if roller else []
    contact = pressed.contact(load)
    values = {"max_pressure": contact.max_pressure}
    if "mean_gap" not in closed.dataset:  # in a window that repeats the approach is that of mean planes
        values["approach"] = contact.approach + pressed.lowest
    if not pressed.rim:
        ellipse = isinstance(contact, EllipticContact)
        values["contact_radius_fit"] = contact.radius if ellipse else contact.contact_radius
    if closed.friction == 0.0 and pressed.energy:  # else shear stores energy, too
        values["elastic_energy"] = pressed.energy * load * contact.approach
    if not math.isfinite(contact.max_pressure):
        del values["max_pressure"]
        return [Exact(pressed.name, values)]
    field_of_pressure = partial(pressed.pressure, load), contact.max_pressure
    return [Exact(pressed.name, values, {"pressure": field_of_pressure})]


# --- similar bodies, sheared or twisted ---------------------------------------------------------------------


def _shear(closed: ClosedForms, number: int) -> list[Exact]:
    """Return Cattaneo-Mindlin, Mindlin-Deresiewicz after reversals, or superposed contacts."""
    slip, pressed = closed.sheared(number), closed.pressed
    if slip is None or pressed is None:
        return []
    contact, values = slip.contact, {}
    if abs(slip.turns[-1]) < (1.0 - _SMALL) * contact.sliding_load:
        if not pressed.rim:
            values["stick_radius_fit"] = float(contact.stick_radius(slip.swing))
        if slip.ellipse is None or is_circular(slip.ellipse):
            shift = float(superposed(contact.shift, slip.turns))
            along = {f"shift_{axis}": shift * part for axis, part in zip("xy", slip.direction, strict=True)}
            values |= {name: value for name, value in along.items() if abs(value) > 1e-9 * abs(shift)}

    def component(axis: int) -> Callable[[Array, Array], Array]:
        return lambda x, y: slip.traction(x, y)[axis]

    scale = closed.friction * pressed.contact(contact.normal_load).max_pressure
    known = [axis for axis in (0, 1) if abs(slip.direction[axis]) > 1e-9 and math.isfinite(scale)]
    fields = {f"traction_{'xy'[axis]}": (component(axis), scale) for axis in known}
    return [Exact(slip.name, values, fields)]


def _torsion(closed: ClosedForms, number: int) -> list[Exact]:
    """Return Lubkin's twist, if it holds up to this step and the contact does not slide."""
    torque = float(closed.dataset["torque"][-1]) if "torque" in closed.dataset else 0.0
    loop = closed.torsion(number) if torque else None
    if loop is None or abs(loop[1][-1] - torque) > _SMALL * abs(torque):
        return []
    return [Exact("Lubkin", {"twist": float(loop[0][-1])})]


# --- dissimilar bodies, pressed -----------------------------------------------------------------------------


def _dissimilar(closed: ClosedForms, load: float) -> list[Exact]:
    """Return closed solutions for dissimilar bodies under a growing normal load alone."""
    beta, mu, attributes = closed.beta, closed.friction, closed.dataset.attrs
    goodman = attributes.get("coupling") == "goodman"
    if mu == 0.0 or abs(beta) <= hertz_gap.SIMILAR or not _pressed_only(closed.dataset, mu * load):
        return []
    contact: Any = closed.pressed.contact(load) if closed.pressed else None
    sphere = contact if attributes.get("algorithm") == "incremental" and is_circular(contact) else None
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


def _pressed_only(dataset: Dataset, sliding: float) -> bool:
    """Test whether a growing normal load is the only load."""
    history = History(dataset, int(dataset["step"][-1]), static=False)
    loads, twist = history["normal_load"], history["twist"]
    scale = sliding if math.isfinite(sliding) else float(loads[-1])
    shear = max(np.abs(history[f"tangential_load_{axis}"]).max() for axis in "xy")
    falls = (np.diff(loads) < -_SMALL * loads[-1]).any()
    return not (falls or shear > _SMALL * scale or twist.any())


_HEADERS = ("", "solution", "exact", "computed", "error")


@dataclass(frozen=True)
class Entry:
    """A line of a comparison: names of quantity and closed solution, both values (SI), and the error.

    The error is the relative difference. For a field the values are NaN, and the error is the root mean
    square of the difference over the nodes in contact, relative to the largest value; for a vector relative
    to the largest of all components.
    """

    quantity: str
    solution: str
    exact: float
    computed: float
    error: float


class Comparison(Sequence[Entry]):
    """Comparison of a load step with closed solutions; printed, a table.

    ``entries`` are the lines, ``step`` is the number of the load step, and ``note`` a remark on them, or the
    reason why there are none.
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

    def to_dataframe(self) -> DataFrame:
        """Return the table: quantity, solution, unit, exact, computed, error."""
        import pandas

        table = pandas.DataFrame(self.entries, columns=[entry.name for entry in fields(Entry)])
        table.insert(2, "unit", [VARIABLES[name].units for name in table["quantity"]])
        return table.set_index("quantity")

    @property
    def _table(self) -> Table:
        rows = [
            (
                spelled(entry.quantity),
                entry.solution,
                *(quantity(v, VARIABLES[entry.quantity].unit, 6) for v in (entry.exact, entry.computed)),
                f"{100 * entry.error:.3f} % rms"
                if math.isnan(entry.exact)
                else f"{100 * entry.error:+.3f} %"
                if math.isfinite(entry.error)
                else "-",
            )
            for entry in self
        ]
        title = f"Load step {self.step} against closed-form solutions"
        return Table(_HEADERS if self.entries else (), rows, title, self.note)

    def __repr__(self) -> str:
        """Return the table as text."""
        return str(self._table)

    def __rich__(self) -> RichTable:
        """Return the table for a terminal."""
        return self._table._replace(headers=_HEADERS).__rich__()

    def _repr_html_(self) -> str:
        return self._table._repr_html_()


# --- comparing ----------------------------------------------------------------------------------------------


def compare(
    dataset: Dataset, data: Dataset, exact: Mapping[str, float] | object | None, name: str
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
        number_of = f"{radius / float(dataset.attrs['lattice_spacing']):.3g}"
        spacings = f"{counted(number_of, 'spacing')} in the contact radius"
        note = f"{spacings}; {note}" if note else spacings
    return Comparison(entries, number, note)


def _own(exact: Mapping[str, float] | object, name: str, dataset: Dataset) -> Exact:
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
        if name in data and not math.isnan(computed := float(data[name])):
            error = (computed - value) / abs(value) if value else (0.0 if computed == 0.0 else math.inf)
            yield Entry(name, exact.solution, value, computed, error)
    if "pressure" not in data:
        return
    inside = data["pressure"].values > 0.0
    x, y = data["x"].values[inside], data["y"].values[inside]
    for name, (function, scale) in exact.fields.items():
        if name in data and inside.any():
            difference = data[name].values[inside] - function(x, y)
            if np.isfinite(difference).all():
                rms = float(np.sqrt(np.mean(difference**2)))
                yield Entry(name, exact.solution, math.nan, math.nan, rms / scale)
