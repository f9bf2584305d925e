"""Contact with friction that all ranks share: each has its rows of the gap and of the states.

A window that is too small for that, and a problem whose nodes depend on all others, is on each rank as a
whole; then the ranks share the transforms of the products alone. All ranks call the methods of its objects
together, in the order of the first one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..variables import CORE, WORN
from . import ranks
from .contact import ElasticPair
from .flat import WearProgress, WearSettings
from .friction import ContactState, FrictionalContact, FrictionLaw
from .lattice import Lattice
from .measures import is_unbounded, measures
from .shared import Field, Rows, SharedFields
from .steps import AHEAD, CyclesOfWear

_FIELDS = (*CORE["fields"], *CORE["zone"])


class Friction(Protocol):
    """Friction over the plane."""

    def over(self, lattice: Lattice) -> FrictionLaw:
        """Return the law at the nodes of a window."""
        ...


class Part(FrictionalContact):
    """The part of this rank of a contact: its rows, or all."""

    def __init__(
        self,
        gap: Field,
        friction: Friction,
        lattice: Lattice,
        own: Lattice,
        **given: Any,
    ) -> None:
        with ranks.agreed():
            values, law = gap.over(own), friction.over(own)
        self.share, self.law = gap.share, law
        given |= {"friction_coefficient": law, "rim_warning": False, "own": own}
        super().__init__(lattice, given.pop("pair"), values, np.isfinite(values), **given)

    def measured(self, state: ContactState) -> tuple[dict[str, float], bool]:
        """Return the measures of a state, and whether its pressure rises to an end of the surface."""
        share = self.share(self._mask, self.own)
        return measures(self, state), bool(is_unbounded(share, state.pressure, self.lattice.n_row))

    def grown(self, state: ContactState) -> Lattice:
        """Return a window that grows with the contact of a state."""
        return self.lattice.grown(state.zone > 0)

    def gap_rows(self) -> Array:
        """Return own rows of the gap before loading, NaN where the bodies cannot touch."""
        return np.where(self._mask, self.initial_gap, np.nan)

    def friction_rows(self) -> Array:
        """Return own rows of the coefficient of friction."""
        assert self.law.limits is not None
        return np.broadcast_to(self.law.limits[0], self.own.shape)


class _Shared(NamedTuple):
    """An object of this rank among the arguments of an order; or fields that it was given, or one of them."""

    number: int
    given: bool = False
    name: str = ""

    def here(self) -> Any:
        """Return the object."""
        found = ranks.held.pop(self.number) if self.given else ranks.held[self.number]
        return found[self.name] if self.name else found


class _Kept(NamedTuple):
    """Numbers of a state among the results of an order."""

    numbers: dict[str, Any]


def _create(number: int, kind: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> None:
    """Set up the part of this rank of an object."""
    ranks.held[number] = kind(*_here(arguments), **named)


def _call(number: int, name: str, ends: list[int], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """Call a method of an object; hold the states that it returns, and return their numbers."""
    with ranks.agreed():
        found = getattr(ranks.held[number], name)(*_here(arguments), **named)
    several = type(found) is tuple
    told = [_kept(each, ends) for each in (found if several else [found])]
    return told if several else told[0]


def _here(arguments: tuple[Any, ...]) -> list[Any]:
    """Return arguments with the objects of this rank."""
    return [each.here() if isinstance(each, _Shared) else each for each in arguments]


def _kept(found: Any, ends: list[int]) -> Any:
    """Hold a state, and return its numbers; return others as they are."""
    if not isinstance(found, ContactState):
        return found
    ranks.held[ends.pop(0)] = found
    return _Kept(found.parts()[1])


def _take(number: int, name: str, values: NDArray[Any]) -> None:
    """Take own rows of a field."""
    ranks.held.setdefault(number, {})[name] = values


def _rows(number: int, name: str) -> Array:
    """Return own rows of a field of a state, or the result of a method."""
    found = getattr(ranks.held[number], name)
    return np.asarray(found() if callable(found) else found).astype(float, copy=False)


def _over(field: Field, lattice: Lattice) -> Array:
    """Return a gap in some rows, NaN where nothing can touch."""
    values = field.over(lattice)
    return np.where(np.isfinite(values), values, np.nan)


def gap_in_rows(field: Field, lattice: Lattice) -> Rows:
    """Return the rows of a gap over a window, which each rank evaluates."""
    return lambda rank, shape: ranks.ask(
        rank, _over, field, ranks.rows(lattice, rank) if shape != lattice.shape else lattice, shape=shape
    )


def _asked(procedure: Callable[..., Array], *arguments: Any) -> Rows:
    """Return the rows that a procedure returns on each rank."""
    return lambda rank, shape: ranks.ask(rank, procedure, *arguments, shape=shape)


class Layout:
    """How ranks share the arrays of a window: each has its rows, or all have all of them."""

    def __init__(self, lattice: Lattice, by_rows: bool) -> None:
        self.lattice, self.by_rows = lattice, by_rows

    def own(self) -> Lattice:
        """Return the nodes of the arrays of this rank."""
        return ranks.rows(self.lattice) if self.by_rows else self.lattice

    def parts(self) -> list[tuple[int, tuple[int, int]]]:
        """Return the ranks that together have all rows, each with the shape of its fields."""
        if not self.by_rows:
            return [(0, self.lattice.shape)]
        return [(rank, ranks.rows(self.lattice, rank).shape) for rank in range(ranks.count)]

    def given(self, fields: Mapping[str, NDArray[Any]], name: str = "") -> _Shared:
        """Give each rank its rows of fields; return them, or one, as the argument of an order."""
        number = ranks.new_number()
        for field, values in fields.items():
            for rank in range(ranks.count):
                first, after = ranks.span(self.lattice, rank) if self.by_rows else (0, self.lattice.n_row)
                ranks.give(rank, _take, number, field, np.asarray(values)[..., first:after, :].copy())
        return _Shared(number, given=True, name=name)


class SharedObject:
    """An object of which each rank has a part; `layout` is that of its arrays."""

    def __init__(
        self, layout: Layout, kind: Callable[..., Any] | None = None, *arguments: Any, **named: Any
    ) -> None:
        self.layout, self.number = layout, ranks.numbered(self)
        if kind is not None:
            ranks.order(_create, self.number, kind, _sent(arguments), named)

    def call(self, layout: Layout, name: str, *arguments: Any, **named: Any) -> Any:
        """Call a method on all ranks; return its result, with states on a window as shared ones."""
        ends = [SharedState(layout), SharedState(layout)]
        numbers = [end.number for end in ends]
        found = ranks.order(_call, self.number, name, numbers, _sent(arguments), named)
        for place, each in enumerate(several := found if isinstance(found, list) else [found]):
            if isinstance(each, _Kept):
                several[place] = ends.pop(0).known(each.numbers)
        return several if isinstance(found, list) else several[0]

    def rows(self, name: str) -> Rows:
        """Return the rows of a field, or of the result of a method; they keep the object."""
        return lambda rank, shape: ranks.ask(rank, _rows, self.number, name, shape=shape)


def _sent(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return arguments as they are sent to other ranks."""
    sent = (_Shared(each.number) if isinstance(each, SharedObject) else each for each in arguments)
    # without arrays that a lattice keeps
    return tuple(replace(each) if isinstance(each, Lattice) else each for each in sent)


class SharedState(SharedObject):
    """A state with friction whose fields lie on all ranks; numbers as of `ContactState`."""

    converged: bool
    touches_rim: bool
    sweeps: int
    normal_load: float
    _numbers: frozenset[str] = frozenset()

    def known(self, numbers: Mapping[str, Any]) -> SharedState:
        """Return the state with its numbers."""
        self._numbers = frozenset(numbers)
        vars(self).update(numbers)
        return self

    def parts(self) -> tuple[Mapping[str, NDArray[Any]], dict[str, Any]]:
        """Return fields, each of which is taken from the ranks at its use, and numbers."""
        fields = SharedFields(self.layout, {name: self.rows(name) for name in _FIELDS})
        return fields, {name: value for name, value in vars(self).items() if name in self._numbers}

    def as_start(self) -> SharedState:
        """Return the start of the next load step: the state without the slip of the last one."""
        start: SharedState = self.call(self.layout, "as_start")
        return start

    def gathered(self) -> ContactState:
        """Return the state with its fields on this rank."""
        fields, numbers = self.parts()
        return ContactState(**{**fields, **numbers})


class SharedFriction(SharedObject):
    """A contact with friction that all ranks share; methods as of `Part`."""

    def __init__(self, gap: Field, friction: Friction, layout: Layout, **given: Any) -> None:
        super().__init__(layout, _part, gap, friction, layout.lattice, layout.by_rows, **given)

    def method(self, name: str, *arguments: Any, **named: Any) -> Any:
        """Call a method of the parts."""
        return self.call(self.layout, name, *arguments, **named)

    def virgin(self) -> SharedState:
        """Return the state before the first load."""
        found: SharedState = self.method("virgin")
        return found

    def advance(self, *arguments: Any, **named: Any) -> SharedState:
        """Advance a state to new loads or motions."""
        found: SharedState = self.method("advance", *arguments, **named)
        return found

    def attempt(self, *arguments: Any, **named: Any) -> Any:
        """Attempt a load step as a whole and in halves."""
        return self.method("attempt", *arguments, **named)

    def extended(self, state: SharedState, lattice: Lattice) -> SharedState:
        """Return a state of a smaller window, `lattice`, on the window of this problem."""
        found: SharedState = self.method("extended", state, lattice)
        return found

    def wear(self, depth: Array) -> None:
        """Set the worn depth (m), which adds to the gap before loading."""
        self.method("wear", self.layout.given({"depth": depth}, "depth"))

    def assembled(self, fields: Mapping[str, NDArray[Any]], numbers: Mapping[str, Any]) -> SharedState:
        """Return the state with given fields and numbers."""
        found: SharedState = self.method("assembled", self.layout.given(fields), numbers)
        return found


def _part(gap: Field, friction: Friction, lattice: Lattice, by_rows: bool, **given: Any) -> Part:
    """Return the part of this rank of a contact."""
    return Part(gap, friction, lattice, Layout(lattice, by_rows).own(), **given)


class Later:
    """An array that is taken from the ranks when it is used."""

    def __init__(self, shape: tuple[int, ...], dtype: str, made: Callable[[], NDArray[Any]]) -> None:
        self.shape, self.dtype, self.made = shape, np.dtype(dtype), made

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self.made(), dtype)


class SharedCycles(SharedObject):
    """Cycles of wear of a contact that all ranks share; methods as of `CyclesOfWear`."""

    def __init__(self, settings: WearSettings, pair: ElasticPair, steps: Any, state: SharedState) -> None:
        super().__init__(state.layout, CyclesOfWear, settings, pair, steps, state)

    def advance(self, contact: SharedFriction) -> WearProgress:
        """Solve the next load step of a cycle."""
        progress: WearProgress = self.call(contact.layout, "advance", contact)
        return progress

    def carry(self, contact: SharedFriction, smaller: Lattice) -> None:
        """Go on with a contact on a larger window."""
        self.call(contact.layout, "carry", contact, smaller)

    def reached(self, contact: SharedFriction) -> SharedState:
        """Return the end of the last cycle, or the solution that failed or reached the rim of the window."""
        found: SharedState = self.call(contact.layout, "reached", contact)
        return found

    def fields(self, contact: SharedFriction) -> SharedFields:
        """Return the fields of the last cycle, with the energy of a second jump, `AHEAD`, 0 without one."""
        numbers = self.number, contact.number
        taken = {name: _asked(_worn_rows, *numbers, name) for name in (*WORN, AHEAD)}
        return SharedFields(contact.layout, taken)

    def restore(self, state: SharedState, fields: Mapping[str, Array], *numbers: float) -> None:
        """Go on from a solved cycle."""
        self.call(state.layout, "restore", state, state.layout.given(fields), *numbers)

    def restore_end(self, place: int, contact: SharedFriction, *end: Any) -> None:
        """Set the last solution of a load step: cycle, motions, tractions."""
        *numbers, tractions = end
        end_of = contact.layout.given({"end": tractions}, "end")
        self.call(contact.layout, "restore_end", place, contact, *numbers, end_of)

    def end(self, place: int, contact: SharedFriction) -> tuple[float, Array, Any]:
        """Return the last solution of a load step: cycle (negative: none), motions, tractions."""
        cycles, motions, _ = ranks.held[self.number].end(place, ranks.held[contact.number])

        shape = 2, 3, *contact.layout.lattice.shape

        def tractions() -> Array:
            found = np.empty((6, *shape[2:]), np.float32)
            for component, values in enumerate(found):
                taken = _asked(_end_rows, self.number, contact.number, place, component)
                rows = SharedFields(contact.layout, {"end": taken})
                values[:] = rows["end"]
            return np.asarray(found.reshape(shape))

        return cycles, motions, Later(shape, "f4", tractions)


def _worn_rows(number: int, contact: int, name: str) -> Array:
    """Return own rows of a field of the last cycle that wore."""
    found: Array = ranks.held[number].fields(ranks.held[contact])[name]
    return found


def _end_rows(number: int, contact: int, place: int, component: int) -> Array:
    """Return own rows of a traction, or of its rate, at the end of a load step."""
    _, _, tractions = ranks.held[number].end(place, ranks.held[contact])
    return np.asarray(tractions).reshape(6, *tractions.shape[2:])[component].astype(float)
