"""Contact that all ranks share: each has its rows of the gap and of the states.

A window that is too small for that, and a problem whose nodes depend on all others, is on each rank as a
whole; then the ranks share the transforms of the products alone. All ranks call the methods of its objects
together, in the order of the first one.
"""

from __future__ import annotations

import contextlib
import functools
import math
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Banded
from ..variables import VARIABLES, WORN
from . import flat, ranks
from .contact import Contact, Displacement, ElasticPair, FlexibilityOperator, NormalContact, NormalSolution
from .flat import WearSettings
from .friction import AHEAD, ContactState, CyclesOfWear, FrictionalContact, FrictionLaw
from .lattice import Lattice

Rows = Callable[[int, tuple[int, int]], Array]
"""The rows of a quantity on a rank, of a shape."""
_STATES = NormalSolution, Displacement


class Layout(NamedTuple):
    """How ranks share the arrays of a window: each has its rows, or all have all of them."""

    lattice: Lattice
    by_rows: bool
    shared: bool = True  # False: the window is on the first rank alone

    def nodes(self, rank: int | None = None) -> Lattice:
        """Return the nodes of the arrays of a rank, by default this one."""
        return ranks.rows(self.lattice, rank) if self.by_rows else self.lattice

    def parts(self) -> Iterator[tuple[int, tuple[int, int]]]:
        """Yield the ranks that together have all rows, each with the shape of its fields."""
        for rank in range(ranks.count if self.by_rows else 1):
            yield rank, self.nodes(rank).shape

    def given(self, fields: Mapping[str, NDArray[Any]]) -> _Held:
        """Give each rank its rows of fields; return them as the argument of an order."""
        number = ranks.new_number()
        for name, values in fields.items():
            for rank in range(ranks.count):
                nodes = self.nodes(rank)
                first = nodes.row_first - self.lattice.row_first
                rows = np.asarray(values)[..., first : first + nodes.n_row, :]
                ranks.give(rank, _take, number, name, rows.copy())
        return _Held(number, given=True)


class SharedFields(Banded):
    """Fields over a window, whose bands are the rows of each rank."""

    def __init__(self, layout: Layout, fields: Mapping[str, Rows]) -> None:
        super().__init__(fields)
        self.layout, self.taken = layout, fields

    def bands(self, name: str) -> Iterator[NDArray[Any]]:
        """Take the rows of one rank after the other."""
        for rank, shape in self.layout.parts():
            band = self.taken[name](rank, shape)
            yield band.astype(np.int8) if name == "zone" else band


def joined(fields: Any, more: Any, names: Sequence[str]) -> Mapping[str, NDArray[Any]]:
    """Return fields, and some of others."""
    if isinstance(fields, SharedFields) and isinstance(more, SharedFields):
        return SharedFields(fields.layout, {**fields.taken, **{name: more.taken[name] for name in names}})
    return {**fields, **{name: more[name] for name in names}}


def rigid(rank: int, shape: tuple[int, int]) -> Array:
    """Return rows of the displacement of a rigid body."""
    return np.zeros(shape)


def gap_in_rows(field: Any, layout: Layout) -> Rows:
    """Return the rows of a gap over a window, which each rank evaluates."""
    return lambda rank, shape: ranks.ask(rank, _over, field, layout.nodes(rank), shape=shape)


def _over(field: Any, lattice: Lattice) -> Array:
    """Return a gap in some rows, NaN where nothing can touch."""
    values: Array = field.over(lattice)
    touching = np.isfinite(values)
    return values if touching.all() else np.where(touching, values, np.nan)


# --- the part of this rank ----------------------------------------------------------------------------------


class _Part(Contact):
    """The part of this rank of a contact, its rows or all, from gap and friction as fields over the plane."""

    def __init__(self, layout: Layout, gap: Any, **given: Any) -> None:
        self._rollers, self._share = gap.rollers, gap.share
        self._lent: weakref.ref[Array] | None = None
        own = layout.nodes()
        with ranks.agreed() if layout.shared else contextlib.nullcontext():
            values = _over(gap, own)
            if law := given.get("friction_coefficient"):
                law = law if isinstance(law, FrictionLaw) else law.over(own)
                self.law = given["friction_coefficient"] = law
            given |= {"candidate": np.isfinite(values), "rim_warning": False}
            super().__init__(layout.lattice, initial_gap=values, own=own if layout.shared else None, **given)
        # all ranks have come this far
        super()._create(*vars(self).pop("_arguments"))

    def _create(self, *arguments: Any) -> None:
        self._arguments = arguments

    def measured(self, state: NormalSolution) -> tuple[dict[str, float], list[str]]:
        """Return the measures of a state, by the names of `hexcontact.variables`, and the unbounded ones.

        These rise to an end of the surface.
        """
        frictional, periodic = isinstance(state, ContactState), self.lattice.periodic
        measured = (flat.measure_friction if frictional else flat.measure_pressure)(self, state)
        found = {
            name: value
            for name, value in measured._asdict().items()
            if (frictional or not VARIABLES[name].frictional)
            # a window that repeats has no edges, and no place of a zone
            and not (periodic and math.isnan(value) and not VARIABLES[name].required)
        }
        if self.own is self.lattice and self._mask.all() and not self._rollers:  # no end, on any rank
            return found, []
        share, fields = self._share(self._mask, self.own), {"max_pressure": state.pressure}
        if isinstance(state, ContactState):
            fields["max_traction"] = np.hypot(state.traction_x, state.traction_y)
        rows = self.lattice.n_row
        return found, [name for name, field in fields.items() if flat.is_unbounded(share, field, rows)]

    def grown(self, state: NormalSolution) -> Lattice:
        """Return a window that grows with the contact of a state."""
        return self.lattice.grown(state.zone > 0)

    def gap_rows(self) -> Array:
        """Return own rows of the gap before loading, NaN where nothing can touch: one copy while in use."""
        gap = self._lent() if self._lent else None
        if gap is None:
            gap = self.initial_gap if self._mask.all() else np.where(self._mask, self.initial_gap, np.nan)
            self._lent = weakref.ref(gap)
        return gap

    def friction_rows(self) -> Array:
        """Return own rows of the coefficient of friction."""
        assert self.law.limits is not None
        return np.broadcast_to(self.law.limits[0], self.own.shape)


class NormalPart(_Part, NormalContact):
    """The part of this rank of a contact without friction."""


class FrictionPart(_Part, FrictionalContact):
    """The part of this rank of a contact with friction."""


def operator_part(layout: Layout, pair: ElasticPair) -> FlexibilityOperator:
    """Return the part of this rank of an operator."""
    return FlexibilityOperator(layout.lattice, pair, own=layout.nodes())


class _Held(NamedTuple):
    """An object of this rank among the arguments of an order; or fields, or one, that it was given."""

    number: int
    given: bool = False

    def here(self) -> Any:
        """Return the object."""
        if not self.given:
            return ranks.held[self.number]
        found = ranks.held.pop(self.number)
        return found.get("", found)


def _take(number: int, name: str, values: NDArray[Any]) -> None:
    """Take own rows of a field."""
    ranks.held.setdefault(number, {})[name] = values


def _create(number: int, kind: Callable[..., Any], arguments: Sequence[Any], named: dict[str, Any]) -> None:
    """Set up the part of this rank of an object."""
    with ranks.agreed():
        ranks.held[number] = kind(*_here(arguments), **named)


def _call(
    number: int, name: str, ends: Sequence[int], arguments: Sequence[Any], named: dict[str, Any]
) -> Any:
    """Call a method of an object; hold the states and displacements that it returns."""
    with ranks.agreed():
        found = getattr(ranks.held[number], name)(*_here(arguments), **named)
    ranks.held.update(zip(ends, (each for each in _each(found) if isinstance(each, _STATES)), strict=False))
    return found


def _here(arguments: Sequence[Any]) -> list[Any]:
    """Return arguments with the objects of this rank."""
    return [each.here() if isinstance(each, _Held) else each for each in arguments]


def _each(found: Any) -> tuple[Any, ...]:
    """Return the results of a procedure."""
    return found if type(found) is tuple else (found,)


def _rows(number: int, name: str, arguments: Sequence[Any]) -> Array:
    """Return own rows of a field of an object, or of the result of a method."""
    found = getattr(ranks.held[number], name)
    return np.asarray(found(*_here(arguments)) if callable(found) else found).astype(float, copy=False)


# --- on the first rank --------------------------------------------------------------------------------------


class _Shared:
    """An object of which each rank has a part; `layout` is that of its arrays."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.number = layout, ranks.numbered(self)

    def call(self, name: str, *arguments: Any, **named: Any) -> Any:
        """Call a method on all ranks; return its result, with states on a window as shared ones."""
        window = next((each.layout for each in arguments if isinstance(each, SharedObject)), self.layout)
        ends = [SharedState(window), SharedState(window)]
        given = [end.number for end in ends], [*map(self._sent, arguments)]
        found = ranks.order(_call, self.number, name, *given, named)
        several = tuple(
            ends.pop(0).known(each) if isinstance(each, _STATES) else each for each in _each(found)
        )
        return several if type(found) is tuple else several[0]

    def _sent(self, value: Any) -> Any:
        """Return an argument as it is sent to other ranks: fields over the window by rows."""
        if isinstance(value, _Shared):
            return _Held(value.number)
        if isinstance(value, np.ndarray) and value.shape[-2:] == self.layout.lattice.shape:
            return self.layout.given({"": value})
        if isinstance(value, Mapping) and any(np.ndim(field) for field in value.values()):
            return self.layout.given(value)
        return value

    def rows(self, name: str, *arguments: Any) -> Rows:
        """Return the rows of a field, or of the result of a method, on each rank; they keep the object."""
        sent = [*map(self._sent, arguments)]
        return lambda rank, shape: ranks.ask(rank, _rows, self.number, name, sent, shape=shape)


class SharedObject(_Shared):
    """An object that all ranks share; its methods are those of its parts."""

    def __init__(self, layout: Layout, kind: Callable[..., Any], *arguments: Any, **named: Any) -> None:
        super().__init__(layout)
        ranks.order(_create, self.number, kind, [*map(self._sent, arguments)], named)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return a method that all ranks call."""
        if name.startswith("_"):
            raise AttributeError(name)
        return functools.partial(self.call, name)


class SharedState(_Shared):
    """A state whose fields lie on all ranks; numbers as of `NormalSolution` or `ContactState`."""

    converged: bool
    touches_rim: bool
    sweeps: int
    normal_load: float

    def known(self, state: Any) -> SharedState:
        """Return the state with its numbers, from its rows on this rank."""
        fields, self._numbers = state.parts()
        self.kind, self._fields = type(state), [*fields]
        vars(self).update(self._numbers)
        return self

    def parts(self) -> tuple[Mapping[str, NDArray[Any]], dict[str, Any]]:
        """Return fields, each of which is taken from the ranks at its use, and numbers."""
        return SharedFields(self.layout, {name: self.rows(name) for name in self._fields}), self._numbers

    def as_start(self) -> SharedState | None:
        """Return the start of the next load step, as of the state of one rank."""
        start: SharedState | None = self.call("as_start")
        return start


def on_ranks(layout: Layout, kind: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Return an object that all ranks share, or one of this rank, by its layout."""
    if layout.shared:
        return SharedObject(layout, kind, layout, *arguments, **named)
    return kind(layout, *arguments, **named)


def rows_of(owner: Any, name: str) -> Any:
    """Return a field, or the result of a method, of an object: an array, or its rows on all ranks."""
    if isinstance(owner, _Shared):
        return owner.rows(name)
    found = getattr(owner, name)
    return found() if callable(found) else found


def gathered(state: Any) -> Any:
    """Return a state with its fields on this rank."""
    if not isinstance(state, SharedState):
        return state
    fields, numbers = state.parts()
    return state.kind(**{**fields, **numbers})


class Later:
    """An array that is taken from the ranks when it is used."""

    def __init__(self, shape: tuple[int, ...], dtype: str, made: Callable[[], NDArray[Any]]) -> None:
        self.shape, self.dtype, self.made = shape, np.dtype(dtype), made

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self.made(), dtype)


class SharedCycles(SharedObject):
    """Cycles of wear of a contact that all ranks share; other methods as of `CyclesOfWear`."""

    def fields(self, contact: SharedObject) -> SharedFields:
        """Return the fields of the last cycle, with the energy of a second jump, `AHEAD`, 0 without one."""
        taken = {name: self.rows("field", contact, name) for name in (*WORN, AHEAD)}
        return SharedFields(contact.layout, taken)

    def end(self, place: int, contact: SharedObject) -> tuple[float, Array, Any]:
        """Return the last solution of a load step: cycle (negative: none), motions, tractions."""
        cycles, motions, _ = ranks.held[self.number].end(place, ranks.held[contact.number])
        shape = 2, 3, *contact.layout.lattice.shape

        def tractions() -> Array:
            found = np.empty((6, *shape[2:]), np.float32)
            for component, values in enumerate(found):
                taken = self.rows("traction", place, contact, component)
                values[:] = SharedFields(contact.layout, {"end": taken})["end"]
            return np.asarray(found.reshape(shape))

        return cycles, motions, Later(shape, "f4", tractions)


def cycles_of(settings: WearSettings, pair: ElasticPair, steps: Any, state: Any) -> Any:
    """Return cycles that wear the surfaces from a state."""
    if isinstance(state, SharedState):
        return SharedCycles(state.layout, CyclesOfWear, settings, pair, steps, state)
    return CyclesOfWear(settings, pair, steps, state)
