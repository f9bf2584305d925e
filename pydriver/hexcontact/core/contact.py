"""The compiled core as Python objects: arrays are checked here, failures become exceptions.

Nothing is computed in this module, and nothing below it knows Python.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import integer, number, reals, word
from ..errors import ConvergenceError, DeckError, HexcontactError, ResourceError
from . import _core, kernel_cache
from .lattice import Lattice

_api = _core.hc_f2py_normal

Method = Literal["direct", "fft"]
MOST_IN_CONTACT = 10**8  # nodes of which memory is asked; the square of more would overflow, and fits nowhere
_METHODS = {"direct": 0, "fft": 1}
_STOPPED = (  # in the order of fortran/contact_state.f90
    "nothing was solved",
    "",  # within the tolerance
    "all iterations that are allowed were made",
    "no iteration brings the residuals further down",
    "no node sticks, and a load cannot be carried",
    "the contact reaches the rim of the window before the end of the step",
    "numbers are not finite",
)
_ERRORS: dict[int, type[HexcontactError]] = {
    1: DeckError,
    2: ConvergenceError,
    3: ResourceError,
    4: HexcontactError,
}


def raise_for(code: int, message: bytes) -> None:
    """Raise the exception that belongs to a status of the core; 0 means success."""
    if code:
        raise _ERRORS.get(code, HexcontactError)(message.decode().strip())


def checked_field(values: ArrayLike, lattice: Lattice, name: str) -> NDArray[np.float64]:
    """Return finite values over the window as one contiguous vector."""
    array = np.ascontiguousarray(shaped(values, lattice, name))
    if not np.isfinite(array).all():
        raise DeckError(f"{name}: {np.count_nonzero(~np.isfinite(array))} values are not finite numbers")
    return array.ravel()


def checked_mask(candidate: ArrayLike | None, lattice: Lattice) -> NDArray[np.bool_]:
    """Return the nodes that may touch; None means all."""
    mask = np.ones(lattice.shape, dtype=bool) if candidate is None else reals(candidate, "candidate") != 0
    if mask.shape != lattice.shape:
        raise DeckError(
            f"candidate: an array of shape {mask.shape}, expected {lattice.shape} (rows, columns)"
        )
    return mask


def shaped(values: ArrayLike, lattice: Lattice, name: str) -> NDArray[np.float64]:
    """Return values over the window, whatever they are; of an xarray.DataArray x and y must be its nodes."""
    array = reals(values, name)
    if array.shape != lattice.shape:
        raise DeckError(f"{name}: an array of shape {array.shape}, expected {lattice.shape} (rows, columns)")
    labeled: Any = values if hasattr(values, "coords") else None
    for key in ("x", "y"):
        if labeled is not None and key in labeled.coords:
            points, nodes, near = labeled.coords[key], getattr(lattice, key), 1e-6 * lattice.spacing
            if points.dims != labeled.dims or not np.allclose(points, nodes, rtol=0.0, atol=near):
                raise DeckError(f"{name}: its coordinate {key} is not that of the nodes of the lattice")
    return array


def checked_tolerance(tolerance: float) -> None:
    """Refuse what can be no bound of residuals."""
    kind = "a number between 0 and 1"
    if not 0 < number(tolerance, "tolerance", kind) < 1:
        raise DeckError(f"tolerance = {tolerance!r}: expected {kind}")


def method_code(name: str) -> int:
    """Return the number of a method in the core."""
    return _METHODS[word(name, "method", _METHODS)]


def thread_count(threads: int) -> int:
    """Return a number of threads as the core takes it; the core knows how many there may be."""
    return integer(threads, "threads", "an integer of at least 0")


def why_stopped(code: int) -> str:
    """Say in words why a solver stopped short of the tolerance; empty if it met it."""
    return _STOPPED[code]


@dataclass(frozen=True)
class ElasticPair:
    """Compliance constants of two bodies in contact.

    Attributes
    ----------
    lambda_1
        Normal compliance ``1/(pi E*)`` [1/Pa].
    lambda_2
        Coupling of normal and tangential displacements, ``beta*lambda_1`` [1/Pa].
    lambda_5
        Additional tangential compliance, ``gamma*lambda_1`` [1/Pa].
    """

    lambda_1: float
    lambda_2: float
    lambda_5: float

    def __post_init__(self) -> None:
        one, two, five = (number(getattr(self, f"lambda_{k}"), f"lambda_{k}") for k in (1, 2, 5))
        if not (0 < one < np.inf and abs(two) < one and -one < five < np.inf):
            raise DeckError(
                f"lambda_1, lambda_2, lambda_5 = {one:g}, {two:g}, {five:g}: expected finite numbers with "
                "lambda_1 > 0, |lambda_2| < lambda_1 and lambda_5 > -lambda_1"
            )

    @classmethod
    def from_materials(
        cls,
        young_modulus_1: float | None,
        poisson_ratio_1: float | None,
        young_modulus_2: float | None,
        poisson_ratio_2: float | None,
    ) -> ElasticPair:
        """Return the constants of two materials; ``None`` for both numbers of a body means rigid.

        Parameters
        ----------
        young_modulus_1, young_modulus_2
            Young's moduli [Pa].
        poisson_ratio_1, poisson_ratio_2
            Poisson's ratios, above -1 and at most 0.5.

        Raises
        ------
        DeckError
            A number out of its range, or two rigid bodies.
        """
        bodies = [(young_modulus_1, poisson_ratio_1), (young_modulus_2, poisson_ratio_2)]
        rigid = [young is None for young, _ in bodies]
        constants, code, message = _api.elastic_constants(
            [0.0 if young is None else number(young, "young_modulus") for young, _ in bodies],
            [0.0 if poisson is None else number(poisson, "poisson_ratio") for _, poisson in bodies],
            rigid,
        )
        raise_for(code, message)
        return cls(*constants.tolist())

    @property
    def effective_modulus(self) -> float:
        """Effective modulus E* [Pa]."""
        return float(1.0 / (np.pi * self.lambda_1))

    @property
    def beta(self) -> float:
        """Dundurs' second constant: coupling of normal and tangential contact."""
        return self.lambda_2 / self.lambda_1

    @property
    def gamma(self) -> float:
        """Ratio of the additional tangential to the normal compliance."""
        return self.lambda_5 / self.lambda_1

    def as_array(self) -> NDArray[np.float64]:
        """Return the three constants as an array [1/Pa]."""
        return np.array([self.lambda_1, self.lambda_2, self.lambda_5])


class FlexibilityOperator:
    """Tractions on the lattice to relative surface displacements.

    Parameters
    ----------
    lattice
        Lattice and window.
    pair
        Elastic constants.
    method
        ``"fft"`` for convolutions, ``"direct"`` for an explicit matrix.
    threads
        Threads to use; 0: as many as OpenMP would take.
    """

    def __init__(self, lattice: Lattice, pair: ElasticPair, method: Method = "fft", threads: int = 0) -> None:
        self.lattice = lattice
        extent = [lattice.n_col, lattice.n_row]
        kernel_cache.take_settings()
        self._handle, code, message = _api.create_operator(
            method_code(method), lattice.basis.T, extent, pair.as_array(), thread_count(threads)
        )
        raise_for(code, message)
        weakref.finalize(self, _api.free_handle, self._handle)
        kernel_cache.warn_of_faults()

    def apply(
        self, pressure: ArrayLike, traction_x: ArrayLike | None = None, traction_y: ArrayLike | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the closing of the gap and the displacement of body 1 over body 2 along x and y.

        Parameters
        ----------
        pressure, traction_x, traction_y
            Tractions on body 1, shape ``(n_row, n_col)`` [Pa]; an absent one is zero.

        Returns
        -------
        tuple of ndarray
            ``(w, s_x, s_y)``, shape ``(n_row, n_col)`` each [m].
        """
        zero = np.zeros(self.lattice.shape)
        named = {"pressure": pressure, "traction_x": traction_x, "traction_y": traction_y}
        columns = [
            checked_field(zero if value is None else value, self.lattice, name)
            for name, value in named.items()
        ]
        traction = np.array(columns).T
        displacement, code, message = _api.apply_operator(self._handle, traction)
        raise_for(code, message)
        w, s_x, s_y = (column.reshape(self.lattice.shape) for column in displacement.T)
        return w, s_x, s_y


@dataclass(frozen=True)
class NormalSolution:
    """Solution of a frictionless contact problem, with its residuals.

    Attributes
    ----------
    pressure, gap
        Shape ``(n_row, n_col)`` [Pa], [m].
    zone
        0 separated, 2 slip (contact without friction), shape ``(n_row, n_col)``.
    normal_load, approach
        Carried load [N] and approach of the remote parts [m].
    residual_normal, residual_force
        Residuals of the contact conditions and of the prescribed load.
    converged
        Both residuals are within the tolerance.
    touches_rim
        There is contact at the rim of the window; a larger window may have another solution.
    stopped
        Why the solver stopped, in words; empty if it converged.
    sweeps
        Active sets that were tried on the finest lattice.
    operator_applications
        All work, coarse lattices and preconditioner included, in applications of the full 3x3 operator.
    """

    pressure: NDArray[np.float64]
    gap: NDArray[np.float64]
    zone: NDArray[np.int8]
    normal_load: float
    approach: float
    residual_normal: float
    residual_force: float
    converged: bool
    sweeps: int
    operator_applications: float
    touches_rim: bool = False
    stopped: str = ""


class NormalContact:
    """A frictionless contact problem; `solve` may be called for many loads.

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
        method: Method = "fft",
        threads: int = 0,
    ) -> None:
        self.lattice = lattice
        mask = checked_mask(candidate, lattice)
        # nodes that can never touch may have any gap, also none at all
        given = shaped(initial_gap, lattice, "initial_gap")
        gap = np.where(mask, given, 0.0)
        self._mask = mask
        self._outside = given[~mask]
        kernel_cache.take_settings()
        self._handle, code, message = _api.create_normal_contact(
            method_code(method),
            lattice.basis.T,
            [lattice.col_first, lattice.row_first],
            [lattice.n_col, lattice.n_row],
            pair.as_array(),
            checked_field(gap, lattice, "initial_gap"),
            mask.ravel().astype(np.int32),
            thread_count(threads),
        )
        raise_for(code, message)
        weakref.finalize(self, _api.free_handle, self._handle)
        kernel_cache.warn_of_faults()

    def solve(
        self,
        *,
        normal_load: float | None = None,
        approach: float | None = None,
        tolerance: float = 1e-8,
        max_sweeps: int = 200,
    ) -> NormalSolution:
        """Solve for a normal load or for an approach.

        Parameters
        ----------
        normal_load
            Load that presses the bodies together, not negative [N].
        approach
            Approach of the remote parts instead [m].
        tolerance
            Bound of the residuals.
        max_sweeps
            Iterations that may be made on each lattice (direct: active sets).

        Returns
        -------
        NormalSolution
            Look at ``converged``: a solution that is not is returned, too.
        """
        if (normal_load is None) == (approach is None):
            raise DeckError("expected either a normal load or an approach")
        if normal_load is not None:
            kind = "a number not below zero"
            target = number(normal_load, "normal_load", kind)
            if not 0 <= target < np.inf:
                raise DeckError(f"normal_load = {normal_load!r}: expected {kind}")
        else:
            target = number(approach, "approach")
            if not np.isfinite(target):
                raise DeckError(f"approach = {approach!r}: expected a number")
        checked_tolerance(tolerance)
        out: Any = _api.solve_normal_contact(
            self._handle,
            1 if approach is None else 2,
            target,
            tolerance,
            integer(max_sweeps, "max_sweeps"),
            self.lattice.size,
        )
        pressure, gap, zone, load, delta, residuals, sweeps, work, flags, code, message = out
        kernel_cache.warn_of_faults()
        raise_for(code, message)
        shape = self.lattice.shape
        gap = gap.reshape(shape)
        gap[~self._mask] += self._outside
        return NormalSolution(
            pressure=pressure.reshape(shape),
            gap=gap,
            zone=zone.reshape(shape).astype(np.int8),
            normal_load=load,
            approach=delta,
            residual_normal=float(residuals[0]),
            residual_force=float(residuals[1]),
            converged=bool(flags[0]),
            sweeps=sweeps,
            operator_applications=work,
            touches_rim=bool(flags[1]),
            stopped=why_stopped(flags[2]),
        )


def memory_needed(
    method: Method,
    n_row: int,
    n_col: int,
    *,
    contact: int | None = None,
    part: Literal["problem", "operator", "set-up of the operator"] = "problem",
    threads: int = 1,
) -> int:
    """Return the bytes that a frictionless problem takes on a window of the given size.

    Parameters
    ----------
    method
        ``"direct"`` or ``"fft"``.
    n_row, n_col
        Rows and columns of the window.
    contact
        Nodes in contact; default: all.
    part
        The whole problem; the full 3x3 flexibility operator alone; or what that takes besides at its set-up.
    threads
        Threads that will be used.
    """
    code = ("problem", "operator", "set-up of the operator").index(part)
    extent = [integer(n_col, "n_col"), integer(n_row, "n_row")]
    nodes = min(extent[0] * extent[1] if contact is None else contact, MOST_IN_CONTACT)
    return int(_api.memory_needed(method_code(method), extent, nodes, code, thread_count(threads)))
