"""How much of a solution depends on the size of the load steps, measured on two that differ in it.

One path goes through a load history in load steps, another beside it in steps of half the size; they never
meet. Both are wrong by something of the first order in the size, so that what the halves change is what is
still wrong with them (theory, section 11).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ..core.friction import ContactState
    from .frictional import FrictionWindow

Traction = tuple[Any, Any]

STICK_SAFETY = 2.0  # of the change of the stick area
TRACTION_SAFETY = 1.5  # of that of the tractions, times what it is worth in terms of stick area
LATTICE = 0.7  # spacings by which single rings of nodes that enter move the edge of the stick area
_SLIP = 2  # zone of a node that slips
_SMALL = 3.0  # spacings in the radius of a contact below which the lattice alone says where it sticks
_MOST_GAIN = 10.0
_ENTERING = 5.0  # times the share of the edge at which nodes entered or left
_STICK_KEPT, _TRACTION_KEPT = 0.5, 0.8  # of a change, from one load step to the next
_NO_SHEAR = 1e-12  # of the largest pressure
_LEAST_RATIO = 1e-3  # of tractions to pressure, where there is no coefficient of friction


@dataclass(frozen=True)
class Change:
    """What the halves of a load step change.

    Attributes
    ----------
    stick : float
        Change of the stick area, as a share of the largest contact area.
    traction : float
        Change of the shear tractions, as a share of what friction can carry.
    added : float
        The part of `traction` that this load step added.
    lattice : float
        How far entering rings of nodes may move the stick area, whatever the steps; a share, too.
    gain : float
        How much the stick area changes with the tractions, both as shares, during the second half.
    """

    stick: float = 0.0
    traction: float = 0.0
    added: float = 0.0
    lattice: float = 0.0
    gain: float = 1.0


@dataclass(frozen=True)
class Memory:
    """Changes of the load steps so far, fading: errors do not vanish at once because a change is zero."""

    stick: float = 0.0
    traction: float = 0.0

    def after(self, change: Change) -> Memory:
        """Return it with another load step."""
        return Memory(
            max(abs(change.stick), _STICK_KEPT * self.stick),
            max(change.traction, _TRACTION_KEPT * self.traction),
        )

    def bound(self, change: Change) -> float:
        """Return the bound on the error of the stick area, as a share of the largest contact area."""
        return STICK_SAFETY * self.stick + TRACTION_SAFETY * change.gain * self.traction + change.lattice


def shear_free(*states: ContactState | None) -> bool:
    """Tell whether no state has shear tractions: a path of such states has no history."""
    return all(
        state is None or shear(state).max() <= _NO_SHEAR * max(state.pressure.max(), np.finfo(float).tiny)
        for state in states
    )


def shear(state: ContactState) -> np.ndarray:
    """Return the magnitude of the shear tractions."""
    return np.asarray(np.hypot(state.traction_x, state.traction_y))


def change(
    window: FrictionWindow,
    whole: ContactState,
    half: ContactState,
    halves: ContactState,
    before: tuple[ContactState, ContactState] | None,
    area: float,
) -> Change:
    """Compare the two solutions at the end of a load step.

    Parameters
    ----------
    window : FrictionWindow
        The window of both.
    whole, half, halves : ContactState
        The end of the path in whole steps, the middle and the end of that in halves.
    before : pair of ContactState or None
        Both at the beginning of the step; None before the first load.
    area : float
        Largest contact area of the history (m2).
    """
    lattice, mu = window.lattice, window.case.friction_coefficient
    edges = window.edges_of(halves)
    contact, stick = edges.contact(), window.stick_edge(halves, edges)
    other = window.stick_edge(whole, window.edges_of(whole)).area
    entered = int(((halves.zone > 0) != (before[1].zone > 0 if before else False)).sum())
    edge = max(contact.length, lattice.spacing)
    share = min(1.0, _ENTERING * entered * lattice.spacing / edge)
    if math.isfinite(mu):
        carried = mu * halves.pressure.sum()
    else:
        carried = max(shear(halves).sum(), _LEAST_RATIO * halves.pressure.sum())
    scale = min(1.0, contact.area / area) / carried if carried > 0 else 0.0
    moved = LATTICE * lattice.spacing * stick.length * share
    if contact.radius < _SMALL * lattice.spacing:
        moved = contact.area
    elif not any((state.zone == _SLIP).any() for state in (whole, half, halves)):
        moved = 0.0

    def apart(one: Traction, other: Traction) -> float:
        return float(np.hypot(one[0] - other[0], one[1] - other[1]).sum()) * scale

    differ = difference(whole, halves)
    traction = added = apart(differ, (0.0, 0.0))
    if before:
        added = apart(differ, difference(*before))
    grown = abs(stick.area - window.stick_edge(half, window.edges_of(half)).area) / area
    loaded = apart(*((state.traction_x, state.traction_y) for state in (half, halves)))
    gain = min(max(1.0, grown / loaded), _MOST_GAIN) if loaded > 0 else 1.0
    return Change((stick.area - other) / area, traction, added, moved / area, gain)


def difference(one: ContactState, other: ContactState) -> Traction:
    """Return the difference of the shear tractions of two states."""
    return one.traction_x - other.traction_x, one.traction_y - other.traction_y
