"""The compiled frictional contact as Python objects; arrays are checked here, failures become exceptions.

Nothing is computed in this module.
"""

from __future__ import annotations

import dataclasses
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import integer, number, reals, word
from ..errors import DeckError
from ..variables import CORE
from . import _core, kernel_cache
from .contact import (
    MOST_IN_CONTACT,
    ElasticPair,
    Method,
    checked_field,
    checked_mask,
    checked_tolerance,
    method_code,
    raise_for,
    shaped,
    thread_count,
    why_stopped,
)
from .lattice import Lattice

_api = _core.hc_f2py_friction

Array = NDArray[np.float64]
Coupling = Literal["full", "goodman"]
Entry = Literal["implicit", "interpolated"]

_CONTROLS = {"force": 1, "displacement": 2}
_FIELDS, _NUMBERS, _RESIDUALS = (CORE[name] for name in ("fields", "numbers", "residuals"))


@dataclass(frozen=True)
class ContactState:
    """The end of a load step, and all that the next one needs.

    Arrays have the shape ``(n_row, n_col)``; the names are those of `hexcontact.variables`, where
    each is explained.

    Attributes
    ----------
    pressure, traction_x, traction_y : ndarray
        Tractions on body 1 [Pa].
    gap : ndarray
        Gap [m].
    relative_displacement_x, relative_displacement_y : ndarray
        Displacement of body 1 relative to body 2, less the rigid motion [m].
    slip_increment_x, slip_increment_y, accumulated_slip : ndarray
        Slip of the step, and length of the slip path so far [m].
    zone : ndarray of int8
        0 separated, 1 stick, 2 slip.
    normal_load, tangential_load_x, tangential_load_y, torque : float
        Resultants of the tractions [N], [N m].
    approach, shift_x, shift_y, twist : float
        Rigid motions of the remote parts [m], [rad].
    dissipated_energy : float
        Energy that friction took so far [J].
    residual_normal, residual_tangential, residual_force, residual_shear_force, residual_torque : float
        Residuals of the contact conditions and of the prescribed loads. That of the friction conditions is
        of the slip of the whole step: if the step was halved, it may be above the tolerance.
    converged : bool
        All residuals are within the tolerance, in each part of a step that was halved.
    sliding : bool
        The tangential loads are more than full sliding carries.
    touches_rim : bool
        There is contact at the rim of the window, at the end of the step or of a part of it.
    stopped : str
        Why the solver stopped, in words; empty if it converged.
    sweeps, cuts : int
        Active sets that were tried; times that the step was halved.
    operator_applications : float
        All work of the step, in applications of the full operator.
    """

    pressure: Array
    traction_x: Array
    traction_y: Array
    gap: Array
    relative_displacement_x: Array
    relative_displacement_y: Array
    slip_increment_x: Array
    slip_increment_y: Array
    accumulated_slip: Array
    zone: NDArray[np.int8]
    normal_load: float = 0.0
    tangential_load_x: float = 0.0
    tangential_load_y: float = 0.0
    torque: float = 0.0
    approach: float = 0.0
    shift_x: float = 0.0
    shift_y: float = 0.0
    twist: float = 0.0
    dissipated_energy: float = 0.0
    residual_normal: float = 0.0
    residual_tangential: float = 0.0
    residual_force: float = 0.0
    residual_shear_force: float = 0.0
    residual_torque: float = 0.0
    converged: bool = True
    sliding: bool = False
    touches_rim: bool = False
    sweeps: int = 0
    cuts: int = 0
    operator_applications: float = 0.0
    stopped: str = ""


class FrictionalContact:
    """A contact problem with friction; `advance` leads from one load to the next.

    Parameters
    ----------
    lattice
        Lattice and window of the nodes that may come into contact.
    pair
        Elastic constants.
    initial_gap
        Gap before loading, shape ``(n_row, n_col)`` [m].
    candidate
        False where a node can never touch, shape ``(n_row, n_col)``; default: all may.
    friction_coefficient
        Coefficient of friction, at least 0; ``inf``: no slip.
    coupling
        ``"full"``, or ``"goodman"``: shear tractions do not move the pressure.
    method
        ``"fft"``: conjugate gradients on convolutions; ``"direct"``: active sets on LAPACK solves.
    threads
        Threads to use; 0: as many as OpenMP would take.
    """

    def __init__(
        self,
        lattice: Lattice,
        pair: ElasticPair,
        initial_gap: ArrayLike,
        candidate: ArrayLike | None = None,
        *,
        friction_coefficient: float,
        coupling: Coupling = "full",
        method: Method = "fft",
        threads: int = 0,
    ) -> None:
        self.lattice = lattice
        mask = checked_mask(candidate, lattice)
        kind = "a number of at least 0, or inf"
        if not number(friction_coefficient, "friction_coefficient", kind) >= 0:
            raise DeckError(f"friction_coefficient = {friction_coefficient!r}: expected {kind}")
        word(coupling, "coupling", ("full", "goodman"))
        # nodes that can never touch may have any gap, also none at all
        self._mask = mask
        self._gap = shaped(initial_gap, lattice, "initial_gap")
        kernel_cache.take_settings()
        self._handle, code, message = _api.create_frictional_contact(
            method_code(method),
            lattice.basis.T,
            [lattice.col_first, lattice.row_first],
            [lattice.n_col, lattice.n_row],
            lattice.origin,
            pair.as_array(),
            checked_field(np.where(mask, self._gap, 0.0), lattice, "initial_gap"),
            mask.ravel().astype(np.int32),
            min(friction_coefficient, np.finfo(float).max),
            int(coupling == "goodman"),
            thread_count(threads),
        )
        raise_for(code, message)
        weakref.finalize(self, _api_free, self._handle)
        kernel_cache.warn_of_faults()

    def virgin(self) -> ContactState:
        """Return the state before the first load: nothing touches, nothing is displaced."""
        zero = np.zeros(self.lattice.shape)
        fields: dict[str, Any] = {name: zero.copy() for name in _FIELDS}
        fields["gap"] = np.where(self._mask, self._gap, np.nan)
        return ContactState(**fields, zone=np.zeros(self.lattice.shape, dtype=np.int8))

    def advance(
        self,
        state: ContactState,
        control: Sequence[str],
        value: Sequence[float],
        *,
        static: bool = False,
        entry: Entry = "implicit",
        tolerance: float = 1e-8,
        max_sweeps: int = 40,
        max_cuts: int = 6,
    ) -> ContactState:
        """Advance a state to new loads or motions.

        Parameters
        ----------
        state
            State to go on from; it is left as it is.
        control
            ``"force"`` or ``"displacement"`` for each of z, x, y and the twist about z.
        value
            Normal load, tangential loads [N] and torque [N m], or approach, shifts [m] and twist [rad].
        static
            The load is applied to the undeformed bodies at once; `state` only serves as a start.
        entry
            What the slip of a node that comes into contact counts from: ``"implicit"``: the beginning of
            the step; ``"interpolated"``: where it stood when its gap closed. A static load knows neither.
        tolerance
            Bound of all residuals.
        max_sweeps
            Active sets that may be tried before a step is halved.
        max_cuts
            Times that a step may be halved.

        Returns
        -------
        ContactState
            Look at ``converged`` (if not, the residuals are those of the attempt that failed, and ``stopped``
            says why) and at ``touches_rim`` (contact at the rim of the window, where the advance ends, be it
            in a part of the step, and is not converged: go on from the old state on a larger one).
        """
        known = isinstance(control, list | tuple) and len(control) == 4
        if not known or not all(isinstance(kind, str) and kind in _CONTROLS for kind in control):
            raise DeckError(f"control = {control!r}: expected four of 'force' and 'displacement'")
        targets = reals(value, "value")
        if targets.shape != (4,) or not np.isfinite(targets).all():
            raise DeckError(f"value = {value!r}: expected four finite numbers")
        if control[0] == "force" and targets[0] < 0:
            raise DeckError(f"normal_load = {targets[0]:g}: expected a number not below zero")
        word(entry, "entry", ("implicit", "interpolated"))
        checked_tolerance(tolerance)
        fields = np.empty((self.lattice.size, len(_FIELDS)), order="F")
        for column, name in enumerate(_FIELDS):
            values = getattr(state, name)
            fields[:, column] = checked_field(
                np.where(self._mask, shaped(values, self.lattice, name), 0.0) if name == "gap" else values,
                self.lattice,
                name,
            )
        numbers = [number(getattr(state, name), name) for name in _NUMBERS]
        out: Any = _api.advance_friction(
            self._handle,
            [_CONTROLS[word] for word in control],
            targets,
            int(static),
            int(entry == "interpolated"),
            tolerance,
            integer(max_sweeps, "max_sweeps"),
            integer(max_cuts, "max_cuts"),
            fields,
            numbers,
        )
        new_fields, zone, new_numbers, residuals, sweeps, cuts, work, flags, code, message = out
        kernel_cache.warn_of_faults()
        raise_for(code, message)
        shape = self.lattice.shape
        arrays: dict[str, Any] = {
            name: np.ascontiguousarray(new_fields[:, column]).reshape(shape)
            for column, name in enumerate(_FIELDS)
        }
        arrays["gap"] = np.where(self._mask, arrays["gap"], np.nan)
        return ContactState(
            **arrays,
            zone=zone.reshape(shape).astype(np.int8),
            **dict(zip(_NUMBERS, new_numbers.tolist(), strict=True)),
            **dict(zip(_RESIDUALS, residuals.tolist(), strict=True)),
            converged=bool(flags[0]),
            sliding=bool(flags[1]),
            touches_rim=bool(flags[2]),
            stopped=why_stopped(flags[3]),
            sweeps=sweeps,
            cuts=cuts,
            operator_applications=work,
        )

    def extended(self, state: ContactState, lattice: Lattice) -> ContactState:
        """Return a state that lives on a smaller window on the window of this problem.

        At nodes that are new, the relative displacement follows from the tractions and the rigid
        motions, so that no history is lost.

        Parameters
        ----------
        state
            State on the smaller window.
        lattice
            The smaller window.
        """
        arrays: dict[str, Any] = {
            name: lattice.embed(getattr(state, name), self.lattice, 0.0) for name in _FIELDS
        }
        loaded = bool(np.any(state.pressure > 0))
        known = lattice.embed(np.ones(lattice.shape), self.lattice, 0.0).astype(bool)
        moved = any((state.approach, state.shift_x, state.shift_y, state.twist))
        if loaded or moved:
            traction = np.stack([arrays[name].ravel() for name in _FIELDS[:3]], axis=1)
            motion = [state.approach, state.shift_x, state.shift_y, state.twist]
            displacement, code, message = _api.relative_displacement(
                self._handle, np.asfortranarray(traction), motion
            )
            raise_for(code, message)
            closing, s_x, s_y = (column.reshape(self.lattice.shape) for column in displacement.T)
            arrays["gap"] = np.where(known, arrays["gap"], self._gap + closing)
            arrays["relative_displacement_x"] = np.where(known, arrays["relative_displacement_x"], s_x)
            arrays["relative_displacement_y"] = np.where(known, arrays["relative_displacement_y"], s_y)
        else:
            arrays["gap"] = self._gap.copy()
        arrays["gap"] = np.where(self._mask, arrays["gap"], np.nan)
        zone = lattice.embed(state.zone, self.lattice, 0)
        return dataclasses.replace(state, **arrays, zone=zone.astype(np.int8), touches_rim=False)


def _api_free(handle: int) -> None:
    _core.hc_f2py_normal.free_handle(handle)


def memory_needed(
    method: Method,
    n_row: int,
    n_col: int,
    *,
    contact: int | None = None,
    loads: int = 4,
    coupled: bool = True,
    threads: int = 1,
) -> int:
    """Return the bytes that a problem with friction takes on a window of the given size.

    Parameters
    ----------
    method
        ``"direct"`` or ``"fft"``.
    n_row, n_col
        Rows and columns of the window.
    contact
        Nodes in contact; default: all.
    loads
        How many loads are prescribed, 1 to 4; the other motions are.
    coupled
        Whether pressure and shear move each other.
    threads
        Threads that will be used.
    """
    extent = [integer(n_col, "n_col"), integer(n_row, "n_row")]
    nodes = min(extent[0] * extent[1] if contact is None else contact, MOST_IN_CONTACT)
    count = thread_count(threads)
    return int(_api.friction_memory_needed(method_code(method), extent, nodes, loads, coupled, count))
