"""Contact with friction in the compiled core as Python objects: laws, states, load steps, cycles of wear."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, has_entries, reals
from ..errors import DeckError
from ..variables import BULK_STRAIN, CORE, WORN
from . import flat
from .calls import checked, numbers
from .contact import (
    UNILATERAL,
    Contact,
    ElasticPair,
    Handle,
    HeldState,
    Interface,
    Iteration,
    Method,
    NormalSolution,
    checked_field,
    method_code,
    shaped,
)
from .flat import AdaptiveSteps, WearProgress, WearSettings
from .lattice import Lattice

Coupling = Literal["full", "goodman"]
Entry = Literal["implicit", "interpolated"]

MAX_SWEEPS, MAX_CUTS = 40, 6
_UNBOUNDED = 1e100  # coefficient of nodes that cannot slip, where others can
CONTROLS = {"force": 1, "displacement": 2}
_FIELDS = CORE["fields"]
MOTION = ("approach", "shift_x", "shift_y", "twist", *BULK_STRAIN)
"""Motions of the remote parts, in the order of the core."""


REJECTED, ACCEPTED, LIMITED, FAILED, OUTGROWN, PENDING = range(6)
"""Verdicts on an attempt: a smaller one follows; it is within the tolerance; it is not, but smaller ones do
not help; the smallest one did not converge; the contact reached the rim of its window; it is not solved to
its end."""

AHEAD = "ahead"
"""Energy of a cycle by which the second of two jumps wears (J/m2), among the fields of a cycle."""

LEAST = 1e-3
"""Smallest adaptive load step, as a part of its segment."""


@dataclass(frozen=True, eq=False)
class FrictionLaw:
    """Friction at the nodes of a window: no traction is above min(mu p^k, limit).

    The coefficient mu is ``inf`` for no slip. With a ratio of the coefficient along a direction (angle from
    x, rad) to that across, coefficient and limit are geometric means: the tractions allowed are an ellipse.
    """

    coefficient: float | Array
    shear_limit: float = math.inf
    power: float = 1.0
    ratio: float = 1.0
    angle: float = 0.0

    def as_arguments(self) -> tuple[Array, list[float]]:
        """Return coefficients and other numbers as the core takes them, with a largest number for inf."""
        most = np.finfo(float).max
        numbers = [min(getattr(self, field.name), most) for field in dataclasses.fields(self)[1:]]
        return np.minimum(np.ravel(self.coefficient), most), numbers

    def on(self, part: tuple[slice, slice]) -> FrictionLaw:
        """Return the law at a part of the nodes."""
        mu = self.coefficient
        return dataclasses.replace(self, coefficient=mu[part]) if isinstance(mu, np.ndarray) else self

    @property
    def limits(self) -> tuple[float | Array, float] | None:
        """Finite coefficient and bound, if the limit is min(mu p, bound) in each direction; else None."""
        law = dataclasses.replace(self, angle=0.0) if self.ratio == 1.0 else self  # a circle has no direction
        plain = all(getattr(law, field.name) == field.default for field in dataclasses.fields(law)[2:])
        finite = bool(np.isfinite(self.coefficient).all())
        return (self.coefficient, self.shear_limit) if plain and finite else None

    def bounds(self, pressure: Array, traction_x: Array, traction_y: Array) -> Array:
        """Return the largest tractions of the nodes in the directions of given ones (Pa)."""
        bounds = np.asarray(flat.bounds_of_friction(pressure, np.stack([traction_x, traction_y]), self))
        return np.where(bounds < np.finfo(float).max, bounds, math.inf)


def row_ahead(lattice: Lattice, direction: float) -> list[int]:
    """Return columns and rows from a node to the next one along a direction (rad), zero if there is none."""
    return [int(count) for count in flat.row_ahead(lattice, direction)]


@dataclass(frozen=True)
class Rolling:
    """The contact travels over both bodies along a row of the lattice."""

    direction: float = 0.0  # angle of rolling from x [rad]
    steady: bool = (
        True  # whether the steady state is solved at once; else the contact moves on by one spacing
    )

    def ahead(self, lattice: Lattice) -> list[int]:
        """Return columns and rows from a node to the one ahead."""
        found = row_ahead(lattice, self.direction)
        if not any(found):
            raise DeckError(
                f"rolling_direction = {math.degrees(self.direction):g} deg: expected the direction of a row "
                "of the lattice"
            )
        return found


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactState(NormalSolution):
    """The end of a load step, from which the next one starts.

    Arrays over the nodes, numbers and their units are those of `hexcontact.variables` by their names; a zone
    is 0 separated, 1 stick, 2 slip. ``residual_tangential`` is for the slip of the whole step, and may be
    above the tolerance after halving.

    Attributes
    ----------
    converged : bool
        All residuals are within the tolerance, in each part of a step that was halved.
    sliding : bool
        The tangential loads are larger than at full sliding.
    touches_rim : bool
        There is contact at the rim of the window, at the end of the step or of a part of it.
    stopped : str
        Reason why the solver stopped; empty if it converged.
    sweeps, cuts : int
        Number of active sets, and of halvings of the step.
    """

    traction_x: Array
    traction_y: Array
    relative_displacement_x: Array
    relative_displacement_y: Array
    slip_increment_x: Array
    slip_increment_y: Array
    accumulated_slip: Array
    dissipation_density: Array
    tangential_load_x: float = 0.0
    tangential_load_y: float = 0.0
    torque: float = 0.0
    shift_x: float = 0.0
    shift_y: float = 0.0
    twist: float = 0.0
    bulk_strain_xx: float = 0.0
    bulk_strain_yy: float = 0.0
    bulk_strain_xy: float = 0.0
    dissipated_energy: float = 0.0
    dissipated_energy_path_error: float = 0.0
    residual_tangential: float = 0.0
    residual_shear_force: float = 0.0
    residual_torque: float = 0.0
    sliding: bool = False
    cuts: int = 0
    creepage_x: float = 0.0
    creepage_y: float = 0.0
    spin: float = 0.0
    creep_power: float = 0.0
    creep_power_error: float = 0.0
    slip_power: float = 0.0
    # a field of the table of variables needs no line above
    __annotations__ = dict.fromkeys(_FIELDS, "Array") | __annotations__

    def as_start(self) -> ContactState:
        """Return the start of the next load step: the state without the slip of the last one."""
        none = np.broadcast_to(0.0, self.pressure.shape)
        return dataclasses.replace(self, slip_increment_x=none, slip_increment_y=none).behind(self.known)


class FrictionalContact(Contact):
    """A contact problem with friction; `advance` solves the step from one load to the next.

    Parameters
    ----------
    lattice, pair, initial_gap, candidate, method, threads, interface, rim_warning, own
        As of `NormalContact`.
    friction_coefficient
        Coefficient of friction mu, at least 0; ``inf``: no slip; or one for each node, ``(n_row, n_col)``;
        or a `FrictionLaw`.
    shear_limit
        Bound of the shear traction, which is at most ``min(mu * pressure, shear_limit)`` [Pa].
    coupling
        ``"full"``, or ``"goodman"``: shear tractions do not move the pressure.
    iteration
        Of the direct method: ``"newton"``, or ``"dissertation"``, as it is written there, for comparison.
    """

    def __init__(
        self,
        lattice: Lattice,
        pair: ElasticPair,
        initial_gap: ArrayLike,
        candidate: ArrayLike | None = None,
        *,
        friction_coefficient: ArrayLike | FrictionLaw,
        shear_limit: float = math.inf,
        coupling: Coupling = "full",
        method: Method = "fft",
        iteration: Iteration = "newton",
        threads: int = 0,
        interface: Interface = UNILATERAL,
        rim_warning: bool = True,
        own: Lattice | None = None,
    ) -> None:
        super().__init__(lattice, pair, initial_gap, candidate, rim_warning, own)
        law = _checked_law(friction_coefficient, shear_limit, self.own)
        _, springs, count = checked(coupling=coupling, interface=interface, threads=threads)
        given = *vars(self).pop("_surfaces"), law, springs, own is not None, count, coupling == "goodman"
        self._create(flat.create_sheared, method_code(method, iteration), *given)

    def virgin(self) -> ContactState:
        """Return the state before the first load: nothing touches, nothing is displaced."""
        gap, zero = self.initial_gap, np.broadcast_to(0.0, self.own.shape)
        held = HeldState.copied(dict.fromkeys(_FIELDS, zero) | {"gap": gap, "zone": zero}, {})
        return self._masked(ContactState(**held.views((*_FIELDS, "zone"))).behind(held))

    def advance(
        self,
        state: ContactState,
        control: Sequence[str],
        value: Sequence[float],
        *,
        bulk_strain: ArrayLike | None = None,
        guess: tuple[ArrayLike, Sequence[float]] | None = None,
        rolling: Rolling | None = None,
        static: bool = False,
        entry: Entry = "implicit",
        tolerance: float = 1e-8,
        max_sweeps: int = MAX_SWEEPS,
        max_cuts: int = MAX_CUTS,
    ) -> ContactState:
        """Advance a state to new loads or motions.

        Parameters
        ----------
        state
            First state, which does not change.
        control
            ``"force"`` or ``"displacement"`` for each of z, x, y and the twist about z.
        value
            Normal load, tangential loads [N] and torque [N m], or approach, shifts [m] and twist [rad].
        bulk_strain
            Bulk strain xx, yy, xy of body 1 less that of body 2 at the end; default: that of `state`.
        guess
            Tractions on body 1, ``(3, n_row, n_col)`` [Pa], and motions (as `MOTION`) that the step is
            likely to end with: it is tried from there first.
        rolling
            The bodies roll: displacements along x and y and about z are creepages and the spin [1/m].
        static
            The load is applied to the undeformed bodies at once; `state` is the first guess.
        entry
            Origin of the slip of a node that enters the contact: ``"implicit"``: its place at the beginning
            of the step; ``"interpolated"``: when its gap closed. Without effect on a static load.
        tolerance
            Bound of all residuals.
        max_sweeps
            Active sets before a step is halved.
        max_cuts
            Halvings of a step at most.

        Returns
        -------
        ContactState
            Check ``converged`` (if not, the residuals are those of the failed attempt, and ``stopped`` is the
            reason) and ``touches_rim`` (contact at the rim of the window, also in a part of the step, where
            the advance ends without convergence: repeat it from the first state on a larger window).
        """
        given = control if isinstance(control, list | tuple) else ()
        kinds = [CONTROLS.get(kind) if isinstance(kind, str) else None for kind in given]
        if len(kinds) != 4 or None in kinds:
            raise DeckError(f"control = {control!r}: expected four of 'force' and 'displacement'")
        targets, _, *limits = checked(
            value=value, entry=entry, tolerance=tolerance, max_sweeps=max_sweeps, max_cuts=max_cuts
        )
        if control[0] == "force" and targets[0] < 0:
            raise DeckError(f"normal_load = {targets[0]:g}: expected a number not below zero")
        kept = [getattr(state, name) for name in BULK_STRAIN]
        strain = reals(kept if bulk_strain is None else bulk_strain, "bulk_strain", (3,))
        ahead = [0, 0] if rolling is None else rolling.ahead(self.lattice)
        if guess is not None:
            flat.set_guess(self, np.reshape(guess[0], (3, *self.own.shape)), [*guess[1]])
        steady = rolling is not None and rolling.steady
        how = static, entry == "interpolated", *limits, ahead, steady
        found = self.solution(self.called(flat.advance, kinds, [*targets, *strain], *how, self._held(state)))
        self._warn_of_rim(found)
        return found

    def creep_loads(
        self,
        state: ContactState,
        control: str,
        value: float,
        creepages: ArrayLike,
        rolling: Rolling,
        tolerance: float = 1e-8,
    ) -> tuple[Array, Array, ContactState]:
        """Return loads and work of many creepages in the steady state, up to the first failure.

        Each row of creepages (x, y, spin) starts from the row before it, the first from `state`. The loads
        are along x and y, and the torque; the last state is that of the last row.
        """
        motions = reals(creepages, "creepages", (len(np.atleast_1d(creepages)), 3))
        kinds = [CONTROLS[control], *[CONTROLS["displacement"]] * 3]
        how = *checked(tolerance=tolerance), MAX_SWEEPS, MAX_CUTS, rolling.ahead(self.lattice)
        given = flat.creep_loads, kinds, [value, *[0.0] * 6], motions, *how, self._held(state)
        loads, work, solved, handle = self.called(*given)
        return loads[:solved], work[:solved], self.solution(handle)

    def assembled(self, fields: Mapping[str, NDArray[Any]], numbers: Mapping[str, Any]) -> ContactState:
        """Return the state with given fields and numbers."""
        return ContactState(**{**fields, **numbers})

    def wear(self, depth: Array) -> None:
        """Set the worn depth (m), which adds to the gap before loading."""
        flat.set_worn_depth(self, depth)

    def solution(self, handle: int) -> ContactState:
        """Return the state of a handle, whose gap is NaN where the bodies cannot touch."""
        return self._masked(self._found(ContactState, handle))

    def _masked(self, found: ContactState) -> ContactState:
        if self._mask.all():
            return found
        gap = np.where(self._mask, found.gap, np.nan)
        gap.flags.writeable = False  # the core has another
        return dataclasses.replace(found, gap=gap).behind(found.known)

    def attempt(
        self,
        steps: AdaptiveSteps,
        control: Sequence[str],
        targets: Sequence[Sequence[float]],
        before: ContactState,
        whole: ContactState | None,
        entry: Entry = "implicit",
        tolerance: float = 1e-8,
    ) -> tuple[AdaptiveSteps, ContactState | None, ContactState | None]:
        """Attempt a load step as a whole and in halves: fortran/path/adaptive_path.f90.

        The targets are those in the middle and at the end, with bulk strains. Both paths go on from `before`
        and `whole` (None: they are one). Return the judged attempt and the ends of both paths, the first that
        of the last solution.
        """
        start = self._held(before)
        ends = start, start if whole is None else self._held(whole)
        limits = tolerance, MAX_SWEEPS, MAX_CUTS
        kinds = [CONTROLS[word] for word in control]
        given = steps, kinds, *targets, entry == "interpolated", *limits, *ends
        steps, *handles = self.called(flat.attempt_step, *given)
        after, apart = (self.solution(each) if each else None for each in handles)
        return steps, after, apart

    def _held(self, state: ContactState) -> HeldState:
        """Return a state in the memory of the core, which is no copy if it was found there."""
        if state.known is not None and state.pressure.shape == self.own.shape:
            return state.known
        known = numbers({name: getattr(state, name) for name in CORE["numbers"]})
        gap = np.where(self._mask, shaped(state.gap, self.own, "gap"), 0.0)
        given = {name: getattr(state, name) for name in _FIELDS} | {"gap": gap}
        fields = {name: checked_field(values, self.own, name) for name, values in given.items()}
        return HeldState.copied({**fields, "zone": np.asarray(state.zone)}, known)

    def extended(self, state: ContactState, lattice: Lattice) -> ContactState:
        """Return a state of a smaller window, `lattice`, on the window of this problem.

        At new nodes the relative displacement follows from the tractions and the rigid motions.
        """
        start = state.held
        handle = flat.extend_state(self, lattice.first, lattice.extent, start.handle)
        found = self.solution(handle)
        fields = {name: getattr(found, name) for name in (*_FIELDS, "zone")}
        return dataclasses.replace(state, **fields, touches_rim=False).behind(found.known)


def _checked_law(coefficient: Any, limit: float, lattice: Lattice) -> FrictionLaw:
    """Return a law of friction, with a coefficient for each node unless its limit is mu p."""
    law = coefficient if isinstance(coefficient, FrictionLaw) else FrictionLaw(coefficient, limit)
    checked(shear_limit=law.shear_limit)
    mu: Any = law.coefficient
    if has_entries(mu):
        mu = checked_field(mu, lattice, "friction_coefficient")
        if (mu < 0.0).any():
            raise DeckError(f"friction_coefficient: expected numbers of at least 0, not {mu.min():g}")
    else:
        [mu] = checked(friction_coefficient=mu)
        if (law.shear_limit, law.power, law.ratio) != (math.inf, 1.0, 1.0):
            mu = np.full(lattice.shape, min(mu, _UNBOUNDED))
    return dataclasses.replace(law, coefficient=mu)


# --- paths: fortran/path ------------------------------------------------------------------------------------

_CHOOSER = ("size", "first", "stick", "traction")
_MEMORY = {"stick": "past_stick", "traction": "past_traction", "spent": "spent", "turned": "turned"}


def record_of(steps: Any) -> dict[str, Any]:
    """Return the control of load steps, or of jumps, in the record of a step."""
    memory = {name: getattr(steps, number) for name, number in _MEMORY.items()}
    return {**{name: getattr(steps, name) for name in _CHOOSER}, "memory": memory}


def restored(steps: Any, record: Mapping[str, Any]) -> Any:
    """Return the control of load steps, or of jumps, from the record of a step."""
    memory = {number: record["memory"][name] for name, number in _MEMORY.items()}
    return steps._replace(**{name: record[name] for name in _CHOOSER}, **memory)


class CyclesOfWear(Handle):
    """Cycles that wear the surfaces, from the end of a load history: fortran/path/wear_path.f90.

    A load step has the numbers of controls, values with bulk strains, shares of the values at the beginning
    of its segment that add to them, and the number of the segment. The first one is that onto the worn gap.
    """

    def __init__(
        self,
        settings: WearSettings,
        pair: ElasticPair,
        steps: Sequence[tuple[Sequence[int], Sequence[float], Sequence[float], int]],
        state: ContactState,
    ) -> None:
        self._create(flat.create_wear, settings, pair, *map(list, zip(*steps, strict=True)), state)

    def advance(self, contact: FrictionalContact) -> WearProgress:
        """Solve the next load step of a cycle."""
        progress: WearProgress = contact.called(flat.advance_wear, self)
        return progress

    def carry(self, contact: FrictionalContact, smaller: Lattice) -> None:
        """Go on with a contact on a larger window."""
        flat.carry_wear(contact, self, smaller.first, smaller.extent)

    def reached(self, contact: FrictionalContact) -> ContactState:
        """Return the end of the last cycle, or the solution that failed or reached the rim of the window."""
        return contact.solution(flat.state_of_wear(self))

    def fields(self, contact: FrictionalContact) -> dict[str, Array]:
        """Return the fields of the last cycle, with the energy of a second jump, `AHEAD`, 0 without one."""
        depth, change, energy, path, ahead = flat.fields_of_wear(self, *contact.own.extent)
        return dict(zip((*WORN, AHEAD), (depth, change, energy, 0.25 * path, ahead), strict=True))

    def restore(
        self, state: ContactState, fields: Mapping[str, Array], cycles: float, until: float, spent: float
    ) -> None:
        """Go on from a solved cycle: its fields as of `fields`, numbers as of `WearProgress`."""
        depth, change, energy, amplitude = (np.asarray(fields[name]) for name in WORN)
        ahead = fields.get(AHEAD)
        values = [depth, change, energy, 4.0 * amplitude, 0.0 * depth if ahead is None else ahead]
        flat.restore_wear(self, state, values, cycles, until, spent, ahead is not None)

    def restore_end(
        self, place: int, contact: FrictionalContact, cycles: float, motions: Array, tractions: Array
    ) -> None:
        """Set the last solution of a load step, from 1 on; see `end`."""
        flat.restore_wear_end(self, place, cycles, motions, tractions.reshape(2, 3, -1))

    def end(self, place: int, contact: FrictionalContact) -> tuple[float, Array, Array]:
        """Return the last solution of a load step: cycle (negative: none), motions, tractions."""
        cycles, motions, tractions = flat.wear_end(self, place, contact.own.size)
        return cycles, motions, np.asarray(tractions).reshape(2, 3, *contact.own.shape)

    def field(self, contact: FrictionalContact, name: str) -> Array:
        """Return one of the `fields`."""
        return self.fields(contact)[name]

    def traction(self, place: int, contact: FrictionalContact, component: int) -> Array:
        """Return a component of the tractions, or of their rates, of `end`."""
        values: Array = self.end(place, contact)[2].reshape(6, *contact.own.shape)[component]
        return values
