"""A case on one window of its lattice: gap, solver, operators, and the fields and history of a load step.

`Window` is what all algorithms share, `NormalWindow` contact without friction; for contact with friction see
`hexcontact.solve.frictional`.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..core import contact, kernel_cache, memory
from ..core.contact import ElasticPair, FlexibilityOperator, NormalSolution
from ..core.friction import ContactState
from ..core.lattice import Lattice
from ..core.measures import measures
from ..deck.below import cycle_of
from ..deck.units import readable
from ..errors import DeckError
from ..problem.checks import stage_of
from ..problem.loads import MOTIONS, LoadStep
from ..problem.problem import Problem
from ..problem.window import grown, rim_sides
from ..result.step import Step
from ..text import listed
from ..variables import BULK_STRESS, DISPLACEMENTS, LOADS, NODAL_FRICTION, STATE, WORN, names_where
from .events import Listener

# Fields that Python holds while a step is solved and measured. Without friction: initial gap, pressure, gap
# and zones, beside them those that the measures take in place of the iteration's. With friction: the state
# before, which the core holds, gaps, and holes in the heap of the C library.
ARRAYS = {False: 3, True: 14}
S = TypeVar("S", NormalSolution, "ContactState")  # the end of a load step

_ITEM = 8  # bytes of a float
_STEPPED = names_where(lambda v: v.dims == ("step",))
# Measured by tests/bench/memory.py.
_WRITING = 24 * 2**20  # bytes of netCDF and HDF5, which an interim output loads beside the solver
_LOADED = 5 * 2**20  # bytes of modules that a run imports
_LOADED_AFTER = 105 * 2**20  # bytes of xarray, pandas and others, which read a result
_HOLES = 32 * 2**20  # bytes at most of freed arrays in the heap, by FFTs without friction: larger go back
_PART = {False: 140, True: 500}  # bytes of a node in contact, for parts of the window, by friction
_COMPANION_ARRAYS = 40  # fields of the path in whole steps, for adaptive steps, and edges
_LAW_ARRAYS = 6  # coefficients by node, here, in the core, on its lattices and parts
_INTERFACE_ARRAYS = {False: 4, True: 6}  # springs of a compliant interface, and the symbol of bodies on them
_WEAR_ARRAYS = 42  # fields of the cycles before and after a jump, of their record, of the pressure ahead
_END_ARRAYS = 3  # fields that remember the end of a load step of the cycle
_ENTRY_ARRAYS = 45  # fields of the core for the places of nodes when their gap closed


# --- memory ---------------------------------------------------------------------------------------


def peak_memory(case: Problem, lattice: Lattice) -> int:
    """Return the largest memory (bytes) of a run on a window, with interpreter and libraries."""
    solved = memory_needed(case, lattice, _parts(case, lattice))
    return memory.resident() + max(solved, _stress_memory(case, lattice, kept=True))


def _stress_memory(case: Problem, lattice: Lattice, kept: bool = False) -> int:
    """Return the memory (bytes) of the tables [[stress]] and [[fatigue]] after the run."""
    return max(_stress_needs(case, lattice, kept).values(), default=0)


def _stress_needs(case: Problem, lattice: Lattice, kept: bool = False) -> dict[str, int]:
    """Return the memory (bytes) of each table [[stress]] and [[fatigue]] after the run, by its key."""
    if not (case.deck.stress or case.deck.fatigue):
        return {}
    from ..interior import fatigue, stress
    from ..interior.region import region

    needs = {}
    for number, table in enumerate(case.deck.stress, 1):
        all_steps = math.ceil(len(case.load_steps) / case.output.every)
        steps = all_steps if table.steps == "all" else len(table.steps or (1,))
        below = stress.memory_needed(lattice, region(lattice, **table.where), steps, kept)
        needs[f"stress.{number}"] = max(below, _tractions_memory(case, lattice, steps, table.source))
    for number, cycle in enumerate(case.deck.fatigue, 1):
        steps = len(cycle.steps or _cycle_of(case, cycle.segment or ()))
        points = region(lattice, **cycle.where)
        below = fatigue.memory_needed(lattice, points, steps) + _ITEM * 5 * steps * lattice.size
        needs[f"fatigue.{number}"] = max(below, _tractions_memory(case, lattice, steps, None))
    return {key: needed + _LOADED_AFTER for key, needed in needs.items()}


def _cycle_of(case: Problem, labels: Sequence[str]) -> range:
    """Return the places of the load steps of a closed cycle, adaptive segments as one step each."""
    first, last = cycle_of([stage_of(step) for step in case.load_steps], labels)
    return range(first, last + 1)


def _tractions_memory(case: Problem, lattice: Lattice, steps: int, source: str | None) -> int:
    """Return the memory (bytes) of the tractions of some steps, corrected at sharp edges."""
    from ..interior import stress

    mu = case.friction_coefficient  # nan where it varies
    sheared = math.isnan(mu) or 0.0 < mu < math.inf
    nodes, unlike = case.contact_nodes(lattice), case.pair.beta != 0.0
    used = "nodes" if case.deck.interface else source
    needed = stress.tractions_needed(lattice, steps, nodes, case.frictional and sheared, unlike, used)
    # beside the spectra of the solver, which are kept
    return needed + case.frictional * contact.memory_needed("fft", *lattice.shape, part="operator")


def memory_needed(case: Problem, lattice: Lattice, kept: int = 0) -> int:
    """Return the memory (bytes) to solve and write load steps on a window.

    The size of the contact is the estimate at the largest load, else that of the window. `kept` are further,
    dispensable bytes.
    """
    bodies = {name[:-2] for name in case.output.fields if name in DISPLACEMENTS}
    operator, set_up = (
        contact.memory_needed("fft", *lattice.shape, part=part, threads=memory.threads())
        for part in ("operator", "set-up of the operator")
    )
    arrays = ARRAYS[case.frictional]
    if case.solver.algorithm == "incremental" and case.solver.entry == "interpolated":
        arrays += _ENTRY_ARRAYS
    if case.adaptive:
        arrays += _COMPANION_ARRAYS
    if math.isnan(case.friction_coefficient):
        arrays += _LAW_ARRAYS
    if case.deck.wear:
        arrays += _WEAR_ARRAYS + _END_ARRAYS * (1 + len(case.cycle))
    if case.deck.interface:
        arrays += _INTERFACE_ARRAYS[case.frictional]
    needed = case.memory_needed(lattice) + arrays * _ITEM * lattice.size + kept
    if case.deck.wear:
        needed += contact.memory_needed("fft", *lattice.shape, threads=memory.threads())
    if bodies:
        # the set-up fits into the vectors of a solver with friction, which are free by then
        needed += len(bodies) * operator + (0 if case.frictional else set_up)
    if not case.frictional and case.method_for(lattice) == "fft":
        needed += min(needed // 2, _HOLES)
    return _LOADED + _WRITING + needed


def _parts(case: Problem, lattice: Lattice) -> int:
    """Return the bytes of operators on parts of the window around a growing contact, and of cached spectra.

    Of n steps in which it grows, about log2(n) need a part that is larger by much.
    """
    if case.method_for(lattice) == "direct":
        return 0
    most, growing = 0.0, 0
    for step in case.load_steps:
        if step.z.value > most:
            most, growing = step.z.value, growing + 1
    doublings = min(math.log2(max(growing, 1)), 5.0) - case.frictional
    kept = int(_PART[case.frictional] * max(doublings, 0.0) * case.contact_nodes(lattice))
    return min(kept, kernel_cache.bound())


def require_memory(case: Problem, lattice: Lattice, steps_held: int = 0) -> None:
    """Refuse a window, with the fields of some steps, or a table that does not fit into memory."""
    kept = steps_held * len(fields_of(case)) * _ITEM * lattice.size
    needed, there = memory_needed(case, lattice) + kept, memory.available()
    fitting = lattice.spacing * math.sqrt(1.1 * needed / max(there, 1))
    fits = f', such as "{readable(fitting)}"' if lattice.spacing < fitting < math.inf else ""
    advice = ["a smaller window" if case.window_fixed else f"a larger grid.spacing{fits}"]
    if (method := case.method_for(lattice)) == "direct":
        advice.append('solver.method = "fft"')
    if steps_held:
        advice.append("an output file")
    memory.require(
        needed,
        f"a window of {lattice.n_row} x {lattice.n_col} nodes (method {method})",
        f"choose {listed(advice, 'or')}",
        there,
    )
    for key, below in _stress_needs(case, lattice).items():
        if below + kept > needed:
            fewer = "a smaller region, fewer points or steps, or a larger grid.spacing"
            memory.require(below + kept, key, f"choose {fewer}", there)


def fields_of(case: Problem) -> tuple[str, ...]:
    """Return the fields of each step of a case: its whole state, and displacements that the deck names."""
    worn = WORN if case.deck.wear else ()
    return (*STATE[case.frictional], *worn, *(name for name in DISPLACEMENTS if name in case.output.fields))


# --- windows --------------------------------------------------------------------------------------


class Window(ABC, Generic[S]):
    """A case on one window, whose results hold the fields of `steps_held` load steps in memory."""

    state: ClassVar[tuple[str, ...]]  # fields of every step
    worn: Array | None = None  # depth by which the surfaces are worn, m

    def __init__(
        self, case: Problem, lattice: Lattice, steps_held: int = 0, listener: Listener | None = None
    ) -> None:
        require_memory(case, lattice, steps_held)
        self.case, self.lattice, self.steps_held = case, lattice, steps_held
        self.listener = listener or Listener()
        gap, self.candidate = case.initial_gap(lattice)
        self.initial_gap: Array = self._where_touching(gap)
        self.friction = case.friction_law(lattice)
        self._bodies: dict[int, FlexibilityOperator] = {}
        self._contact: Any = self._solver(gap)

    @abstractmethod
    def _solver(self, gap: Array) -> Any:
        """Return the solver for an initial gap (inf where nothing can touch)."""

    def _without_friction(self, gap: Array) -> contact.NormalContact:
        """Return the solver of the contact without friction."""
        method = self.case.method_for(self.lattice)
        given = self.lattice, self.case.solved_pair, gap, self.candidate
        return contact.NormalContact(*given, method, interface=self.case.interface, rim_warning=False)

    @abstractmethod
    def advance(self, state: S | None, target: LoadStep, values: tuple[float, ...]) -> S:
        """Solve a load step from the state at its beginning, None before the first load.

        `values` are the prescribed loads or motions of z, x, y and the twist.
        """

    def carried(self, state: S | None, lattice: Lattice) -> S | None:
        """Return a state of a smaller window on this one."""
        return state

    def restored(self, step: Step) -> S | None:
        """Return the state at the end of a step on this window, if the next one needs it."""
        return None

    def outgrown(self, solution: S) -> bool:
        """Test whether the contact reached the rim of the window, also in a part of the step only."""
        return solution.touches_rim and not self.case.full_contact

    def grown(self, solution: S, target: LoadStep) -> Self:
        """Return a larger window for a contact that reached the rim, unless the deck fixes the window."""
        if self.case.window_fixed:
            raise DeckError(
                f"grid: in step {target.index + 1} the contact reaches the rim of the window of "
                f"{self.lattice.n_row} x {self.lattice.n_col} nodes; "
                'expected a larger grid.extent or grid.window, or grid.extent = "auto"'
            )
        del self._contact  # its memory goes before that of the next comes
        self._bodies.clear()
        larger = grown(self.lattice, rim_sides(solution.zone > 0))
        self.listener.said("window", step=target.index + 1, before=self.lattice.shape, after=larger.shape)
        return type(self)(self.case, larger, self.steps_held, self.listener)

    def step(self, target: LoadStep, solution: S, before: S | None, started: float) -> Step:
        """Return a finished step from the states at its end and beginning; its time counts from `started`."""
        fields = {"initial_gap": self.initial_gap}
        fields |= {name: getattr(solution, name) for name in self.state}
        fields["gap"] = self._where_touching(solution.gap)
        if self.worn is not None:
            fields["worn_depth"] = self.worn
        if self.case.frictional and math.isnan(self.case.friction_coefficient) and self.friction.limits:
            fields[NODAL_FRICTION] = np.broadcast_to(self.friction.limits[0], self.lattice.shape)
        for body in (1, 2):
            wanted = [name for name in fields_of(self.case) if name.startswith(f"displacement_{body}")]
            if wanted:
                moved = self._displacement(body, fields)
                fields |= {name: moved[name[-1]] for name in wanted}
        bulk: dict[str, float] = {}
        if self.case.deck.bulk:
            bulk = dict(zip(BULK_STRESS, self.case.bulk(target.bulk)[0].tolist(), strict=True))
            bulk["bulk_body"] = self.case.deck.bulk.body
        history: dict[str, float | int | str] = {
            **self._history(solution, before),
            **bulk,
            "segment": target.segment + 1,
            "label": target.label,
            "seconds": time.perf_counter() - started,
        }
        return Step(
            target.index,
            self.lattice,
            fields,
            history,
            prescribed=self._prescribed(target, history),
            load_fraction=(target.index + 1) / len(self.case.load_steps),
            ramp_done=target.fraction,
            bodies=(self.case.body_1, self.case.body_2),
            friction=self.case.friction_coefficient,
            sharp=self.case.deck.interface is None,
            shear_limit=self.friction.shear_limit,
        )

    def _where_touching(self, values: Array) -> Array:
        """Return values that are NaN where the bodies cannot touch, without a copy if they can everywhere."""
        return values if self.candidate.all() else np.where(self.candidate, values, np.nan)

    def _prescribed(self, target: LoadStep, history: Mapping[str, Any]) -> dict[str, float]:
        """Return the prescribed loads and motions of a load step, by the keys of the deck."""
        driven = {}
        for motion, drive in zip(MOTIONS, target.targets, strict=True):
            if motion == "z" or self.case.frictional:
                name = LOADS[motion][drive.control == "displacement"]
                # a ramp after the other control begins at the value that control led to
                driven[name] = float(history[name] if drive.from_start else drive.value)
        known = self.case.deck.bulk.components if self.case.deck.bulk else ()
        stresses = zip(BULK_STRESS, target.bulk, strict=True)
        return driven | {name: value for name, value in stresses if name in known}

    def _history(self, solution: S, before: S | None) -> dict[str, float]:
        """Return the numbers of a state: those of the solver, and its measures."""
        known = solution.__dict__
        given = {name: known[name] for name in _STEPPED if name in known}
        gap = self.initial_gap if self.worn is None else self.initial_gap + self.worn
        return given | measures(self.lattice, self.friction, gap, self.candidate, solution)

    def _displacement(self, number: int, fields: Mapping[str, NDArray[Any]]) -> dict[str, Array]:
        """Return the surface displacement of one body, z into the body itself.

        Against a rigid partner u1 - u2 is the displacement of the body alone, and so is u1z + u2z.
        """
        body = self.case.body_1 if number == 1 else self.case.body_2
        if body.rigid:
            return dict.fromkeys("xyz", np.zeros(self.lattice.shape))
        if number not in self._bodies:
            material, rigid = (body.young_modulus, body.poisson_ratio), (None, None)
            pair = ElasticPair.from_materials(*(material + rigid if number == 1 else rigid + material))
            self._bodies[number] = FlexibilityOperator(self.lattice, pair)
        operator, pressure = self._bodies[number], fields["pressure"]
        z, x, y = operator.apply(pressure, fields.get("traction_x"), fields.get("traction_y"))
        if self.case.solver.coupling == "goodman" and "traction_x" in fields:
            z = operator.apply(pressure)[0]  # in this approximation shear does not move the surfaces along z
        sign = 1.0 if number == 1 else -1.0
        return {"x": sign * x, "y": sign * y, "z": z}


class NormalWindow(Window[NormalSolution]):
    """Contact without friction, whose steps have no history."""

    state = STATE[False]

    _solver = Window._without_friction

    def advance(
        self, state: NormalSolution | None, target: LoadStep, values: tuple[float, ...]
    ) -> NormalSolution:
        """Press with a force or to an approach."""
        driven = {"normal_load" if target.z.control == "force" else "approach": values[0]}
        solution: NormalSolution = self._contact.solve(**driven, tolerance=self.case.solver.tolerance)
        return solution
