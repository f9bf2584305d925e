"""Frictionless contact whose rows all ranks share: each has those of the gap and of the solution."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Banded, Mask
from . import flat, kernel_cache, ranks
from .calls import checked
from .contact import STOPPED, ElasticPair, Interface, NormalSolution
from .handles import Handle, HeldState
from .lattice import Lattice

Rows = Callable[[int, tuple[int, int]], Array]
"""The rows of a quantity on a rank, of a shape."""


class Field(Protocol):
    """A quantity over the plane."""

    def over(self, lattice: Lattice) -> Array:
        """Return the values at the nodes of a window."""
        ...

    def share(self, touching: Mask, lattice: Lattice) -> Array:
        """Return the part of a cell that each node bears at ends of surfaces."""
        ...


class Part(Handle):
    """The rows of this rank of a contact."""

    def __init__(
        self, gap: Field, lattice: Lattice, pair: ElasticPair, interface: Interface, threads: int
    ) -> None:
        self.lattice, self.own = lattice, ranks.rows(lattice)
        with ranks.agreed():
            values = gap.over(self.own)
            self.touching: Mask = np.isfinite(values)
            self.gap, self.share = np.where(self.touching, values, 0.0), gap.share
        self._create(flat.create_pressed_part, lattice, pair, self.gap, self.touching, interface, threads)

    def rows(self, values: NDArray[Any]) -> Array:
        """Return values of own rows, NaN where the bodies cannot touch."""
        return np.where(self.touching, values, np.nan)


class OperatorPart(Handle):
    """The rows of this rank of a flexibility operator."""

    def __init__(self, lattice: Lattice, pair: ElasticPair, threads: int) -> None:
        self.lattice = lattice
        self._create(flat.create_operator_part, lattice, pair, threads)


def _create(number: int, *arguments: Any) -> None:
    """Set up the part of this rank of a contact."""
    ranks.held[number] = Part(*arguments)


def _press(number: int, solution: int, *arguments: Any) -> Any:
    """Solve a load step; hold own rows, and return the numbers of the solution."""
    part = ranks.held[number]
    try:
        found = HeldState(flat.press_part(part, *arguments), part.own.shape)
    finally:
        kernel_cache.warn_of_faults()
    ranks.held[solution] = found
    return flat.numbers_of_state(found)


def _measure(number: int, solution: int) -> tuple[Any, bool]:
    """Return the measures of a solution, and whether its pressure rises to an end of the surface."""
    part = ranks.held[number]
    share = part.share(part.touching, part.own)
    found: tuple[Any, bool] = flat.measure_part(
        part.lattice, part.gap, part.touching, share, ranks.held[solution]
    )
    return found


def _grown(number: int, solution: int) -> Lattice:
    """Return a window that grows with the contact of a solution."""
    larger: Lattice = ranks.held[number].lattice.grown(ranks.held[solution].view("zone") > 0)
    return larger


def _prepare(number: int, *arguments: Any) -> None:
    """Set up the part of this rank of an operator."""
    ranks.held[number] = OperatorPart(*arguments)


def _displace(number: int, solution: int, displaced: int, goodman: bool) -> None:
    """Hold own rows of the displacements by the tractions of a solution."""
    operator, found = ranks.held[number], ranks.held[solution]
    state, shear = found.held, [np.zeros(found.held.shape)] * 2
    alone = [state.view("pressure"), *shear]
    sheared = hasattr(found, "traction_x")
    if sheared:
        shear = [found.traction_x, found.traction_y]
    z, x, y = flat.apply_operator_part(operator, [alone[0], *shear])
    if goodman and sheared:
        z = flat.apply_operator_part(operator, alone)[0]
    ranks.held[displaced] = z, x, y


def _rows(number: int, solution: int, name: str) -> Array:
    """Return own rows of a field as real numbers."""
    part, found = ranks.held[number], ranks.held[solution]
    if name == "initial_gap":
        return part.rows(part.gap)
    values = found.view(name)
    return part.rows(values) if name == "gap" else values.astype(float, copy=False)


def _displaced_rows(displaced: int, place: int) -> Array:
    """Return own rows of a displacement: along z, x or y."""
    return np.asarray(ranks.held[displaced][place])


class Shared(Protocol):
    """A window that all ranks share."""

    def parts(self) -> list[tuple[int, tuple[int, int]]]:
        """Return the ranks that together have all rows, each with the shape of its fields."""
        ...


class SharedFields(Banded):
    """Fields over a window, whose bands are the rows of each rank."""

    def __init__(self, layout: Shared, fields: Mapping[str, Rows]) -> None:
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


class Displacement:
    """Displacements by the tractions of a solution, whose fields lie on all ranks.

    In Goodman's approximation shear tractions do not move the surfaces along z.
    """

    def __init__(self, solution: Any, operator: SharedOperator, goodman: bool = False) -> None:
        self.number, self.sign = ranks.numbered(self), operator.sign
        ranks.order(_displace, operator.number, solution.number, self.number, goodman)

    def rows(self, axis: str) -> Rows:
        """Return the rows of a component."""

        def taken(rank: int, shape: tuple[int, int]) -> Array:
            place = "zxy".index(axis)
            found = ranks.ask(rank, _displaced_rows, self.number, place, shape=shape)
            return self.sign * found if place else found

        return taken


class SharedOperator:
    """Flexibility operator of one body, whose rows all ranks share; `sign` is that of its displacements."""

    def __init__(self, lattice: Lattice, pair: ElasticPair, sign: float) -> None:
        self.number, self.sign = ranks.numbered(self), sign
        ranks.order(_prepare, self.number, replace(lattice), pair, 0)


class SharedSolution:
    """A solution whose fields lie on all ranks; numbers as of `NormalSolution`."""

    touches_rim: bool
    converged: bool
    sweeps: int
    normal_load: float

    def __init__(self, contact: SharedContact) -> None:
        self.contact, self.number = contact, ranks.numbered(self)

    def rows(self, name: str) -> Rows:
        """Return the rows of a field."""
        return lambda rank, shape: ranks.ask(rank, _rows, self.contact.number, self.number, name, shape=shape)

    def measures(self) -> tuple[Any, bool]:
        """Return its measures, and whether the pressure rises to an end of the surface."""
        found: tuple[Any, bool] = ranks.order(_measure, self.contact.number, self.number)
        return found

    def grown(self) -> Lattice:
        """Return a larger window for a contact that reaches the rim."""
        larger: Lattice = ranks.order(_grown, self.contact.number, self.number)
        return larger

    def as_start(self) -> None:
        """Return what the next load step starts from."""


class SharedContact:
    """A frictionless contact whose rows all ranks share; they evaluate the gap at their own nodes."""

    def __init__(
        self, lattice: Lattice, pair: ElasticPair, gap: Field, interface: Interface, threads: int = 0
    ) -> None:
        # without arrays that the lattice keeps
        self.lattice, self.number = replace(lattice), ranks.numbered(self)
        given = checked(interface=interface, threads=threads)
        ranks.order(_create, self.number, gap, self.lattice, pair, *given)

    def parts(self) -> list[tuple[int, tuple[int, int]]]:
        """Return the ranks, each with the shape of its fields."""
        return [(rank, ranks.rows(self.lattice, rank).shape) for rank in range(ranks.count)]

    def solve(self, control: int, value: float, *, tolerance: float, max_sweeps: int = 200) -> SharedSolution:
        """Solve for a normal load (control 1, N) or an approach (2, m), as `NormalContact.solve`."""
        solution = SharedSolution(self)
        given = control, value, *checked(tolerance=tolerance, max_sweeps=max_sweeps)
        numbers = ranks.order(_press, self.number, solution.number, *given)
        found = numbers._asdict() | {"stopped": STOPPED[numbers.stopped]}
        known = {field.name for field in fields(NormalSolution)}
        vars(solution).update({name: value for name, value in found.items() if name in known})
        return solution
