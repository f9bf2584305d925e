"""The compiled core as Python objects, with checks of arrays and exceptions for failures."""

from __future__ import annotations

import ctypes
import math
import weakref
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import chain
from typing import Any, Literal, NamedTuple, Self, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, Mask, reals
from ..errors import DeckError, RimWarning, warn
from ..text import counted
from ..variables import CORE
from . import flat, kernel_cache
from .calls import checked
from .lattice import Lattice

Method = Literal["direct", "fft"]
Iteration = Literal["newton", "dissertation"]
Part = Literal["problem", "operator", "set-up of the operator", "problem with friction"]
Interface = tuple[float, float, float]
"""Coefficient c (Pa/m^m) and exponent m of an interface, p = c (-gap)^m, and the stiffness (Pa/m) of its
tangential springs, 0 without."""
UNILATERAL: Interface = (0.0, 0.0, 0.0)  # bodies that do not penetrate
MOST_IN_CONTACT = 10**8  # largest number of nodes for estimates of memory, whose square does not overflow
_SHAPE = " (rows, columns)"
_METHODS = {("direct", "newton"): 0, ("fft", "newton"): 1, ("direct", "dissertation"): 2}
STOPPED = (  # in the order of fortran/contact_state.f90
    "nothing was solved",
    "",  # converged
    "all iterations that are allowed were made",
    "no iteration brings the residuals further down",
    "no node sticks, and a load cannot be carried",
    "the contact reaches the rim of the window before the end of the step",
    "numbers are not finite",
)


def checked_field(values: ArrayLike, lattice: Lattice, name: str) -> Array:
    """Return finite values over the window, contiguous."""
    return _finite(shaped(values, lattice, name), name)


def _finite(values: Array, name: str) -> Array:
    array = np.ascontiguousarray(values)
    if not np.isfinite(array).all():
        count = int(np.count_nonzero(~np.isfinite(array)))
        raise DeckError(
            f"{name}: {counted(count, 'value is not a finite number', 'values are not finite numbers')}"
        )
    return array


def shaped(values: ArrayLike, lattice: Lattice, name: str) -> Array:
    """Return values over the window; x and y of an xarray.DataArray must be those of the nodes."""
    array = reals(values, name, lattice.shape, _SHAPE)
    labeled: Any = values if hasattr(values, "coords") else None
    for key in ("x", "y"):
        if labeled is not None and key in labeled.coords:
            points, nodes, near = labeled.coords[key], getattr(lattice, key), 1e-6 * lattice.spacing
            if points.dims != labeled.dims or not np.allclose(points, nodes, rtol=0.0, atol=near):
                raise DeckError(f"{name}: its coordinate {key} is not that of the nodes of the lattice")
    return array


def method_code(method: str, iteration: Iteration = "newton") -> int:
    """Return the number of a method with its iteration in the core."""
    given = checked(method=method, iteration=iteration)
    if given not in _METHODS:
        raise DeckError(f'iteration = "{iteration}" needs method = "direct", not "{method}"')
    return _METHODS[given]


@dataclass(frozen=True)
class ElasticPair:
    """Compliance constants of two bodies in contact.

    ``lambda_1`` is the normal compliance ``1/(pi E*)``, ``lambda_2`` is the coupling of normal and tangential
    displacements, ``beta*lambda_1``, and ``lambda_5`` is the additional tangential compliance,
    ``gamma*lambda_1``, all in 1/Pa.
    """

    lambda_1: float
    lambda_2: float
    lambda_5: float

    def __post_init__(self) -> None:
        one, two, five = checked(lambda_1=self.lambda_1, lambda_2=self.lambda_2, lambda_5=self.lambda_5)
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

        Young's moduli are in Pa, Poisson's ratios above -1 and at most 0.5. DeckError for a number out of its
        range, or two rigid bodies.
        """
        bodies = [(young_modulus_1, poisson_ratio_1), (young_modulus_2, poisson_ratio_2)]
        constants = flat.elastic_constants(
            [0.0 if young is None else checked(young_modulus=young)[0] for young, _ in bodies],
            [0.0 if poisson is None else checked(poisson_ratio=poisson)[0] for _, poisson in bodies],
            [young is None for young, _ in bodies],
        )
        return cls(*constants)

    @cached_property
    def effective_modulus(self) -> float:
        """Effective modulus E* [Pa]."""
        return float(1.0 / (np.pi * self.lambda_1))

    @cached_property
    def beta(self) -> float:
        """Dundurs' second constant: coupling of normal and tangential contact."""
        return self.lambda_2 / self.lambda_1

    @cached_property
    def gamma(self) -> float:
        """Ratio of the additional tangential to the normal compliance."""
        return self.lambda_5 / self.lambda_1

    @property
    def spectra(self) -> int:
        """Number of spectra of the operator of pressure and shear tractions."""
        return 3 + 2 * (self.beta != 0.0)

    def as_array(self) -> Array:
        """Return the three constants as an array [1/Pa]."""
        return np.array([self.lambda_1, self.lambda_2, self.lambda_5])


@dataclass(frozen=True)
class CoatedPair(ElasticPair):
    """Compliance constants of two bodies with coatings; the three are those of the outermost materials."""

    # Young's modulus [Pa], Poisson's ratio, and 1 if it is rigid, of both bodies; the numbers of their
    # coatings; thickness [m], Young's modulus [Pa] and Poisson's ratio of each of these, outermost first
    constants: tuple[float, ...]
    coupling: float  # largest tangential displacement by a pressure over the normal one
    fit_error: float  # largest error of the kernels, which are sums of images, over their largest value
    images: int  # number of them

    @classmethod
    def of_layers(
        cls,
        bodies: Sequence[tuple[float | None, float | None]],
        coatings: Sequence[Sequence[tuple[float, float, float]]],
    ) -> CoatedPair:
        """Return the constants of two bodies (None: rigid), and of their coatings, outermost first."""
        below = [(young or 0.0, poisson or 0.0, float(young is None)) for young, poisson in bodies]
        layers = [layer for coating in coatings for layer in coating]
        constants = tuple(map(float, [*chain(*below), *map(len, coatings), *chain(*layers)]))
        one, two, five, *found = flat.coated_constants(constants)
        return cls(one, two, five, constants, *found)

    @cached_property
    def beta(self) -> float:
        """Largest coupling of normal and tangential contact."""
        return self.coupling

    @property
    def spectra(self) -> int:
        """Number of spectra: that of yy does not follow from the others."""
        return super().spectra + 1

    def as_array(self) -> Array:
        """Return the constants of the bodies."""
        return np.array(self.constants)


def pair_of(one: Any, two: Any) -> ElasticPair:
    """Return the constants of body 1 and body 2, with their materials and coatings; None: rigid."""
    bodies = one, two
    below = [(body.young_modulus, body.poisson_ratio) if body else (None, None) for body in bodies]
    coatings = [
        [(layer.thickness, layer.young_modulus, layer.poisson_ratio) for layer in body.coating]
        if body
        else []
        for body in bodies
    ]
    if any(coatings):
        return CoatedPair.of_layers(below, coatings)
    return ElasticPair.from_materials(*below[0], *below[1])


class Handle:
    """An object of the core, which is freed with its Python object."""

    _handle: int

    def _create(self, procedure: Callable[..., int], *arguments: Any) -> None:
        kernel_cache.take_settings()
        self._handle = procedure(*arguments)
        weakref.finalize(self, flat.free_object, self._handle)
        kernel_cache.warn_of_faults()


class _Slip:
    """The slip of the last step in a state, which is freed with the last array that is a view of it."""

    def __init__(self, state: HeldState) -> None:
        self.state = state
        weakref.finalize(self, flat.free_slip, state.handle).atexit = False


class HeldState:
    """A state in the memory of the core, which is freed with the last array that is a view of it."""

    def __init__(self, handle: int, shape: tuple[int, ...]) -> None:
        self.handle, self.shape = handle, shape
        self._slip: weakref.ref[_Slip] | None = None
        # at the end of the process arrays may still be in use
        weakref.finalize(self, flat.free_object, handle).atexit = False

    @property
    def held(self) -> HeldState:
        """The state itself, where a solution may stand."""
        return self

    def view(self, name: str) -> NDArray[Any]:
        """Return a field, which is no copy."""
        owner: Any = self
        if name.startswith("slip_increment"):
            owner = (self._slip and self._slip()) or _Slip(self)
            self._slip = weakref.ref(owner)
        return self._array(name, owner)

    def views(self, names: Iterable[str]) -> dict[str, Any]:
        """Return fields by their names, which are no copies."""
        return {name: self.view(name) for name in names}

    def _array(self, name: str, owner: Any) -> NDArray[Any]:
        number, kind = (ctypes.c_int8, "i1") if name == "zone" else (ctypes.c_double, "f8")
        memory: Any = (number * math.prod(self.shape)).from_address(flat.place_of_field(self, name))
        memory.held = owner
        return np.frombuffer(memory, dtype=kind).reshape(self.shape)

    @classmethod
    def copied(cls, fields: Mapping[str, NDArray[Any]], numbers: Mapping[str, float]) -> HeldState:
        """Return a copy of a state."""
        shape = fields["pressure"].shape
        history = flat.History(**{name: numbers.get(name, 0.0) for name in CORE["numbers"]})
        held = cls(flat.new_state(shape[1], shape[0], history), shape)
        for name, field in fields.items():
            held._array(name, held)[:] = field
        return held


class Solved:
    """A solution, and its state in the core, unless it was made or changed in Python."""

    __slots__ = ("_held",)

    def behind(self, held: HeldState | None) -> Self:
        """Return the solution with the state that it is the record of."""
        object.__setattr__(self, "_held", held)
        return self

    @property
    def held(self) -> HeldState:
        """Its state in the core, or a copy there."""
        return self.copied() if self.known is None else self.known

    def copied(self) -> HeldState:
        """Return a copy of its state in the core."""
        names = [name for name in (*CORE["fields"], *CORE["zone"]) if name in vars(self)]
        return HeldState.copied({name: vars(self)[name] for name in names}, vars(self))

    @property
    def known(self) -> HeldState | None:
        """Its state in the core."""
        return getattr(self, "_held", None)

    def __getstate__(self) -> dict[str, Any]:
        return vars(self)


class FlexibilityOperator(Handle):
    """Operator from tractions on the lattice to relative surface displacements.

    The method is ``"fft"`` for convolutions, or ``"direct"`` for an explicit matrix; with 0 threads it takes
    the default of OpenMP; ``own`` as of `NormalContact`.
    """

    def __init__(
        self,
        lattice: Lattice,
        pair: ElasticPair,
        method: Method = "fft",
        threads: int = 0,
        own: Lattice | None = None,
    ) -> None:
        self.lattice, self.own = lattice, lattice if own is None else own
        given = method_code(method), lattice, pair, self.own.n_row
        self._create(flat.create_operator, *given, *checked(threads=threads))

    def apply(
        self, pressure: ArrayLike, traction_x: ArrayLike | None = None, traction_y: ArrayLike | None = None
    ) -> tuple[Array, Array, Array]:
        """Return the closing of the gap and the displacement of body 1 over body 2 along x and y (m).

        Tractions on body 1 (Pa) have the shape ``(n_row, n_col)``, and so have the results; an absent one is
        zero.
        """
        zero = np.zeros(self.own.shape)
        named = {"pressure": pressure, "traction_x": traction_x, "traction_y": traction_y}
        tractions = [
            checked_field(zero if value is None else value, self.own, name) for name, value in named.items()
        ]
        w, s_x, s_y = flat.apply_operator(self, tractions)
        return w, s_x, s_y

    def displacement(self, state: NormalSolution, body: int, goodman: bool) -> Displacement:
        """Return the displacement of a body by the tractions of a state, if this is its operator.

        Against a rigid partner u1 - u2 is the displacement of the body alone, and so is u1z + u2z. In
        Goodman's approximation shear does not move the surfaces along z.
        """
        shear = [getattr(state, f"traction_{axis}", None) for axis in "xy"]
        z, x, y = self.apply(state.pressure, *shear)
        if goodman and shear[0] is not None:
            z = self.apply(state.pressure)[0]
        sign = 1.0 if body == 1 else -1.0
        return Displacement(sign * x, sign * y, z)


class Displacement(NamedTuple):
    """Displacement of the surface of a body (m), z into the body."""

    x: Array
    y: Array
    z: Array

    def parts(self) -> tuple[dict[str, Array], dict[str, Any]]:
        """Return fields and numbers."""
        return self._asdict(), {}


@dataclass(frozen=True, eq=False, kw_only=True)
class NormalSolution(Solved):
    """Solution of a frictionless contact problem; attributes as of `ContactState`, zone 2: contact."""

    pressure: Array
    gap: Array
    zone: NDArray[np.int8]
    normal_load: float = 0.0
    approach: float = 0.0
    residual_normal: float = 0.0
    residual_force: float = 0.0
    converged: bool = True
    touches_rim: bool = False
    sweeps: int = 0
    operator_applications: float = 0.0
    stopped: str = ""

    def parts(self) -> tuple[Mapping[str, NDArray[Any]], dict[str, Any]]:
        """Return fields and numbers."""
        fields = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        return fields, {name: value for name, value in vars(self).items() if name not in fields}

    def as_start(self) -> NormalSolution | None:
        """Return the start of the next load step: none, since that depends on its load alone."""
        return None


S = TypeVar("S", bound=NormalSolution)


class Contact(Handle):
    """A contact problem of the core: its lattice, initial gap, and nodes that can touch."""

    def __init__(
        self,
        lattice: Lattice,
        pair: ElasticPair,
        initial_gap: ArrayLike,
        candidate: ArrayLike | None,
        rim_warning: bool,
        own: Lattice | None = None,
    ) -> None:
        self.lattice, self._rim_warning = lattice, rim_warning
        self.own = lattice if own is None else own  # the nodes of the arrays
        self._mask: Mask = np.broadcast_to(True, self.own.shape)  # takes no memory
        if candidate is not None:
            given = reals(candidate, "candidate", self.own.shape, _SHAPE) != 0
            self._mask = self._mask if given.all() else given
        gap = shaped(initial_gap, self.own, "initial_gap")
        self._beyond = gap[~self._mask]  # of nodes that cannot touch
        gap = _finite(gap if self._mask.all() else np.where(self._mask, gap, 0.0), "initial_gap")
        # for the core, which keeps the only copy of the gap
        self._surfaces: tuple[Any, ...] = lattice, pair, gap, self._mask

    initial_gap: Any = property(
        flat.gap_of_problem, doc="Gap before loading and without wear (m), 0 where the bodies cannot touch."
    )

    def called(self, procedure: Callable[..., Any], *arguments: Any) -> Any:
        """Return the results of a procedure of the core that uses spectra of kernels."""
        try:
            return procedure(self, *arguments)
        finally:
            kernel_cache.warn_of_faults()

    def _found(self, kind: type[S], handle: int) -> S:
        """Return the solution behind a handle, with views of its fields."""
        held = HeldState(handle, self.own.shape)
        found: dict[str, Any] = flat.numbers_of_state(held)._asdict()
        found["stopped"] = STOPPED[found["stopped"]]
        names = [field.name for field in fields(kind)]
        found |= held.views(name for name in names if name not in found)
        return kind(**{name: found[name] for name in names}).behind(held)

    def _warn_of_rim(self, found: NormalSolution) -> None:
        """Warn of contact at the rim of the window, unless the bodies end there: all nodes touch that can."""
        if not (self._rim_warning and found.converged and found.touches_rim):
            return
        if not self._mask.all() and (found.zone[self._mask] > 0).all():
            return
        words = "contact at the rim of the window (touches_rim): a larger window may have another solution"
        warn(words, RimWarning)


class NormalContact(Contact):
    """A frictionless contact problem, which `solve` solves for any number of loads.

    Parameters
    ----------
    lattice
        Lattice and window of the nodes that may come into contact.
    pair
        Elastic constants.
    initial_gap
        Gap before loading, shape ``(n_row, n_col)`` [m].
    candidate
        False where a node cannot touch, shape ``(n_row, n_col)``; default: all can.
    method
        ``"fft"``: conjugate gradients on convolutions; ``"direct"``: active sets on LAPACK solves.
    threads
        Threads to use; 0: the default of OpenMP.
    interface
        Coefficient c [Pa/m^m] and exponent m of a compliant interface, p = c (-gap)^m, and the stiffness of
        its tangential springs [Pa/m], 0 without them; default: bodies do not penetrate.
    rim_warning
        Warn (`hexcontact.RimWarning`) of a solution with contact at the rim of the window, unless all
        nodes touch that can and others cannot: the body ends there, like a punch.
    own
        Nodes of the arrays, of a problem that all ranks share and whose methods they call together: the rows
        of this rank, or the lattice itself.
    """

    def __init__(
        self,
        lattice: Lattice,
        pair: ElasticPair,
        initial_gap: ArrayLike,
        candidate: ArrayLike | None = None,
        method: Method = "fft",
        threads: int = 0,
        *,
        rim_warning: bool = True,
        interface: Interface = UNILATERAL,
        own: Lattice | None = None,
    ) -> None:
        super().__init__(lattice, pair, initial_gap, candidate, rim_warning, own)
        springs, count = checked(interface=interface, threads=threads)
        given = *vars(self).pop("_surfaces"), springs, own is not None, count
        self._create(flat.create_pressed, method_code(method), *given)

    def solve(
        self,
        *,
        normal_load: float | None = None,
        approach: float | None = None,
        tolerance: float = 1e-8,
        max_sweeps: int = 200,
    ) -> NormalSolution:
        """Solve for a normal load (N), not negative, or for an approach of the remote parts (m).

        Residuals are at most `tolerance`; iterations on each lattice (direct: active sets) are at most
        `max_sweeps`. Check ``converged``, since other solutions are returned, too, and ``touches_rim``.
        """
        if (normal_load is None) == (approach is None):
            raise DeckError("expected either a normal load or an approach")
        driven = {"approach": approach} if normal_load is None else {"normal_load": normal_load}
        target, *limits = checked(**driven, tolerance=tolerance, max_sweeps=max_sweeps)
        control = 2 if normal_load is None else 1
        solution = self._found(NormalSolution, self.called(flat.press, control, target, *limits))
        solution.gap[~self._mask] += self._beyond
        self._warn_of_rim(solution)
        return solution


def rough_pressure(
    lattice: Lattice, pair: ElasticPair, gap: Array, interface: Interface = UNILATERAL, **driven: float
) -> Array:
    """Return the pressure of a rough frictionless solution under a normal load (N) or at an approach (m).

    The gap (m) is infinite where nothing can touch.
    """
    [value], control = checked(**driven), 1 if "normal_load" in driven else 2
    kernel_cache.take_settings()
    pressure = flat.rough_pressure(lattice, pair, interface, gap, control, value)
    kernel_cache.warn_of_faults()
    return np.asarray(pressure)


def memory_needed(
    method: Method,
    n_row: int,
    n_col: int,
    *,
    contact: int | None = None,
    part: Part = "problem",
    loads: int = 4,
    coupled: bool = True,
    spectra: int = 5,
    threads: int = 1,
    periodic: bool = False,
) -> int:
    """Return the memory (bytes) of a problem on a window, which may repeat, or of its operator."""
    extent = [*checked(n_col=n_col, n_row=n_row)]
    nodes = min(extent[0] * extent[1] if contact is None else contact, MOST_IN_CONTACT)
    given = method_code(method), extent, nodes, get_args(Part).index(part), loads, coupled, spectra
    return int(flat.memory_of_problem(*given, *checked(threads=threads), periodic))
