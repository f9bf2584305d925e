"""Closed solutions for a result with friction, recognized from its attributes and its history.

Similar bodies (beta = 0) pressed by a constant normal load and then sheared along one line: Cattaneo-Mindlin,
and after each reversal Mindlin-Deresiewicz. Spheres twisted about their common normal: Lubkin. For other
histories there is no closed solution, and the functions return None.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..core import flat
from ..core.measures import line_of
from ..deck.recorded import recorded
from ..deck.surfaces import Surface
from ..errors import DeckError
from .elliptic import EllipticContact
from .friction import LubkinTorsion, MindlinContact
from .hertz_gap import SIMILAR, QuadraticGap, attribute_of, friction_of, is_strained, is_worn

if TYPE_CHECKING:
    import xarray


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
        if not history.normal_load > 0.0 or shear > _ASIDE * self.friction * history.normal_load:
            return None
        if history.is_worn:
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
