"""A case on one window of its lattice: gap, solver, operators, and the fields and history of a load step.

`Window` is what all algorithms share, `NormalWindow` contact without friction; for contact with friction see
`hexcontact.solve.frictional`.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..core import contact, kernel_cache, memory
from ..core.contact import ElasticPair, FlexibilityOperator, NormalSolution
from ..core.edges import ContactEdges
from ..core.estimators import area_radius, pressure_center
from ..core.measures import elastic_energy
from ..errors import DeckError
from ..problem.loads import MOTIONS
from ..result.step import Step
from ..text import listed
from ..variables import DISPLACEMENTS, LOADS, STATE
from .events import Listener

if TYPE_CHECKING:
    from ..core.friction import ContactState
    from ..core.lattice import Lattice
    from ..problem.loads import LoadStep
    from ..problem.problem import Problem

Array = NDArray[np.float64]

# Fields that Python holds while a step is solved and written. Without friction: initial gap, pressure, gap,
# zones, on their way through the core. With friction: the state before, itself and on its way through the
# core both ways, gaps, coordinates.
ARRAYS = {False: 8, True: 34}
S = TypeVar("S", NormalSolution, "ContactState")  # how a load step ends

_ITEM = 8  # bytes of a float
# Measured by tests/bench/memory.py.
_WRITING = 18 * 2**20  # bytes that netCDF and HDF5 take, which are loaded when the output is written
_LOADED = 3 * 2**20  # bytes of modules that a run imports on its way
_LEFT = 0.5  # share of what solving takes that operators and states have when the output is written
_PART = {
    False: 60,
    True: 500,
}  # bytes of a node in contact for parts of the window; with friction
_COMPANION_ARRAYS = 40  # fields of the path that load steps of half the size are compared with, and edges
_ENTRY_ARRAYS = 45  # fields that the core needs to find where nodes stood when their gap closed


# --- memory ---------------------------------------------------------------------------------------


def peak_memory(case: Problem, lattice: Lattice) -> int:
    """Return the memory (bytes) that a run on a window takes at most, with interpreter and libraries."""
    return memory.resident() + memory_needed(case, lattice, _parts(case, lattice))


def memory_needed(case: Problem, lattice: Lattice, kept: int = 0) -> int:
    """Return the memory (bytes) that solving and writing load steps on a window takes.

    The contact is taken as large as estimated at the largest load; as the window where there is no estimate.
    `kept` are further bytes, which could be done without.
    """
    from ..core import contact as native

    bodies = {name[:-2] for name in case.output.fields if name in DISPLACEMENTS}
    operator, set_up = (
        native.memory_needed("fft", *lattice.shape, part=part, threads=memory.threads())
        for part in ("operator", "set-up of the operator")
    )
    arrays = ARRAYS[case.frictional]
    if case.solver.algorithm == "incremental" and case.solver.entry == "interpolated":
        arrays += _ENTRY_ARRAYS
    if case.adaptive:
        arrays += _COMPANION_ARRAYS
    needed = case.memory_needed(lattice) + arrays * _ITEM * lattice.size + kept
    if bodies:
        # beside a solver with friction, whose vectors are gone by then, the set-up needs nothing more
        needed += len(bodies) * operator + (0 if case.frictional else set_up)
    return _LOADED + max(needed, int(_LEFT * needed) + _WRITING)


def _parts(case: Problem, lattice: Lattice) -> int:
    """Return the bytes of operators on parts of the window around a growing contact, and of kept spectra.

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
    """Refuse a window that does not fit into memory.

    Parameters
    ----------
    case : Problem
        The problem.
    lattice : Lattice
        The window.
    steps_held : int
        Load steps whose fields the result will keep in memory.

    Raises
    ------
    ResourceError
        If less memory is available.
    """
    advice = ["a smaller window" if case.window_fixed else "a larger grid.spacing"]
    if (method := case.method_for(lattice)) == "direct":
        advice.append('solver.method = "fft"')
    if steps_held:
        advice.append("an output file")
    memory.require(
        memory_needed(case, lattice) + steps_held * len(fields_of(case)) * _ITEM * lattice.size,
        f"a window of {lattice.n_row} x {lattice.n_col} nodes (method {method})",
        f"choose {listed(advice, 'or')}",
    )


def fields_of(case: Problem) -> tuple[str, ...]:
    """Return the fields that each step of a case has: its whole state, and displacements if asked for."""
    return (*STATE[case.frictional], *(name for name in DISPLACEMENTS if name in case.output.fields))


# --- windows --------------------------------------------------------------------------------------


class Window(ABC, Generic[S]):
    """A case on one window.

    Parameters
    ----------
    case : Problem
        The problem.
    lattice : Lattice
        The window.
    steps_held : int
        Load steps whose fields the result will keep in memory.
    listener : Listener, optional
        Follows the run.

    Attributes
    ----------
    initial_gap : ndarray, (n_row, n_col)
        Gap before loading (m), NaN where the bodies can never touch.
    candidate : ndarray of bool, (n_row, n_col)
        Nodes that can touch.

    Raises
    ------
    ResourceError
        If it does not fit into memory.
    """

    state: ClassVar[tuple[str, ...]]  # fields of every step

    def __init__(
        self, case: Problem, lattice: Lattice, steps_held: int = 0, listener: Listener | None = None
    ) -> None:
        require_memory(case, lattice, steps_held)
        self.case, self.lattice, self.steps_held = case, lattice, steps_held
        self.listener = listener or Listener()
        gap, self.candidate = case.initial_gap(lattice)
        self.initial_gap: Array = np.where(self.candidate, gap, np.nan)
        self._bodies: dict[int, FlexibilityOperator] = {}
        self._contact: Any = self._solver(gap)

    @abstractmethod
    def _solver(self, gap: Array) -> Any:
        """Make the solver, given the initial gap (inf where nothing can touch)."""

    @abstractmethod
    def advance(self, state: S | None, target: LoadStep, values: tuple[float, ...]) -> S:
        """Solve a load step.

        Parameters
        ----------
        state : solution or None
            End of the step before, None before the first load.
        target : LoadStep
            How z, x, y and the twist are driven.
        values : tuple of float
            The load or motion prescribed for each of them.
        """

    def carried(self, state: S | None, lattice: Lattice) -> S | None:
        """Return a state that was solved on a smaller window on this one."""
        return state

    def restored(self, step: Step) -> S | None:
        """Return the state at the end of a step that was solved on this window, if the next one needs it."""
        return None

    @abstractmethod
    def _more_history(self, solution: S, before: S | None, edges: ContactEdges) -> dict[str, float]:
        """Return what has one value by step beyond load, approach and contact area."""

    def outgrown(self, solution: S) -> bool:
        """Tell whether the contact reached the rim of the window, be it in a part of the step only."""
        return solution.touches_rim

    def grown(self, solution: S, target: LoadStep) -> Self:
        """Return a larger window for a contact that reached the rim; this one is of no use any more.

        Raises
        ------
        DeckError
            If the deck fixed the window.
        """
        if self.case.window_fixed:
            raise DeckError(
                f"grid: in step {target.index + 1} the contact reaches the rim of the window of "
                f"{self.lattice.n_row} x {self.lattice.n_col} nodes; "
                'expected a larger grid.extent or grid.window, or grid.extent = "auto"'
            )
        del self._contact  # its memory goes before that of the next comes
        self._bodies.clear()
        larger = self.case.grown(self.lattice, solution.zone > 0)
        self.listener.said("window", step=target.index + 1, before=self.lattice.shape, after=larger.shape)
        return type(self)(self.case, larger, self.steps_held, self.listener)

    def step(self, target: LoadStep, solution: S, before: S | None, started: float) -> Step:
        """Return what a load step leaves.

        Parameters
        ----------
        target : LoadStep
            The load step.
        solution, before : solution
            Its end, and that of the step before (None: none).
        started : float
            When work on it began (s, `time.perf_counter`).
        """
        fields = {"initial_gap": self.initial_gap}
        fields |= {name: getattr(solution, name) for name in self.state}
        fields["gap"] = np.where(self.candidate, solution.gap, np.nan)
        for body in (1, 2):
            wanted = [name for name in fields_of(self.case) if name.startswith(f"displacement_{body}")]
            if wanted:
                moved = self._displacement(body, fields)
                fields |= {name: moved[name[-1]] for name in wanted}
        edges = self.edges_of(solution)
        history: dict[str, float | int | str] = {
            **self._contact_measures(solution, edges),
            **self._more_history(solution, before, edges),
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
        )

    def _prescribed(self, target: LoadStep, history: Mapping[str, Any]) -> dict[str, float]:
        """Return what drives a load step, by the keys of the deck."""
        driven = {}
        for motion, drive in zip(MOTIONS, target.targets, strict=True):
            if motion == "z" or self.case.frictional:
                name = LOADS[motion][drive.control == "displacement"]
                # a ramp that takes over from the other control begins where that one ended
                driven[name] = float(history[name] if drive.from_start else drive.value)
        return driven

    def edges_of(self, solution: S) -> ContactEdges:
        """Return the edges of the contact, and of what is inside."""
        return ContactEdges(
            solution.pressure, solution.gap, solution.zone > 0, self.candidate, self.lattice.basis
        )

    def _contact_measures(self, solution: S, edges: ContactEdges) -> dict[str, float]:
        """Return load, approach and the size of the contact."""
        inside, edge = solution.zone > 0, edges.contact()
        center = pressure_center(self.lattice.x, self.lattice.y, solution.pressure)
        return {
            "normal_load": solution.normal_load,
            "approach": solution.approach,
            "contact_area": self.lattice.cell_area * int(inside.sum()),
            "contact_radius": area_radius(inside, self.lattice.cell_area),
            "contact_area_fit": edge.area,
            "contact_radius_fit": edge.radius,
            "pressure_center_x": center[0],
            "pressure_center_y": center[1],
            "max_pressure": float(solution.pressure.max()),
        }

    def _displacement(self, number: int, fields: Mapping[str, NDArray[Any]]) -> dict[str, Array]:
        """Surface displacement of one body, z into the body itself.

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
    """Contact without friction; every step stands for itself."""

    state = STATE[False]

    def _solver(self, gap: Array) -> contact.NormalContact:
        method = self.case.method_for(self.lattice)
        return contact.NormalContact(self.lattice, self.case.pair, gap, self.candidate, method)

    def advance(
        self, state: NormalSolution | None, target: LoadStep, values: tuple[float, ...]
    ) -> NormalSolution:
        """Press with a force or to an approach."""
        driven = {"normal_load" if target.z.control == "force" else "approach": values[0]}
        solution: NormalSolution = self._contact.solve(**driven, tolerance=self.case.solver.tolerance)
        return solution

    def _more_history(
        self, solution: NormalSolution, before: NormalSolution | None, edges: ContactEdges
    ) -> dict[str, float]:
        return {
            "elastic_energy": elastic_energy(self.lattice, self.initial_gap, solution),
            "sweeps": solution.sweeps,
            "operator_applications": solution.operator_applications,
            "residual_normal": solution.residual_normal,
            "residual_force": solution.residual_force,
        }
