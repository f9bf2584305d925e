"""A case on one window of its lattice."""

from __future__ import annotations

import math
import time
import weakref
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..core import ranks
from ..core.contact import ElasticPair, FlexibilityOperator, NormalContact, NormalSolution, pair_of
from ..core.flat import WearSettings
from ..core.friction import ContactState, CyclesOfWear, FrictionalContact, Rolling
from ..core.lattice import Lattice
from ..core.measures import measures, unbounded
from ..core.shared import (
    FrictionPart,
    Layout,
    NormalPart,
    SharedCycles,
    SharedFields,
    SharedObject,
    gap_in_rows,
    operator_part,
    rigid,
)
from ..errors import ConvergenceError, DeckError
from ..problem.loads import MOTIONS, LoadStep
from ..problem.problem import Problem
from ..result.step import Step
from ..variables import (
    BULK_STRAIN,
    BULK_STRESS,
    CORE,
    DISPLACEMENTS,
    MOVED_GAP,
    NODAL_FRICTION,
    STATE,
    names_where,
)
from .events import Listener
from .memory_needed import fields_of, is_shared, require_memory

_DISPLACED = frozenset(DISPLACEMENTS)
_STEPPED = names_where(lambda v: v.dims == ("step",))
# numbers of a state that have the names of the history
_NUMBERS = (*CORE["numbers"], *CORE["residuals"], "operator_applications")
_PATH_ERROR = "dissipated_energy_path_error"  # static steps have no path
_ROUGHLY = 1e-4  # residual of a solution that serves for the size of the contact


class Window:
    """A case without friction on one window; results hold the fields of `steps_held` load steps in memory.

    The steps have no history: each is solved from its load alone.
    """

    state = STATE[False]  # fields of every step
    contact: Any
    worn: Array | None = None  # depth by which the surfaces are worn, m
    _own_gap: Array | None = None
    _lent: weakref.ref[Array] | None = None

    def __init__(
        self, case: Problem, lattice: Lattice, steps_held: int = 0, listener: Listener | None = None
    ) -> None:
        require_memory(case, lattice, steps_held)
        self.case, self.lattice, self.steps_held = case, lattice, steps_held
        self.listener = listener or Listener()
        self._bodies: dict[int, Any] = {}
        self._place(None)

    def _place(self, target: LoadStep | None) -> None:
        """Set the surfaces up at their place in a load step, None: before the first."""
        gap, self.candidate = self.case.initial_gap(self.lattice, target)
        if target is None:
            self.friction = self.case.friction_law(self.lattice)
        self.gap: Any = gap if self.case.moves else None
        self.contact = self._solver(gap, self.case.frictional)
        # of surfaces that move, and of nodes that cannot touch, the core has another one
        if target is None and (self.case.moves or not self.candidate.all()):
            self._own_gap = self._where_touching(gap)

    @property
    def initial_gap(self) -> Array:
        """Gap of the surfaces that have not moved, NaN where nothing can touch: a copy while it is in use."""
        gap = self._own_gap
        if gap is None and self._lent is not None:
            gap = self._lent()
        if gap is None:
            gap = self.contact.initial_gap
            self._lent = weakref.ref(gap)
        return gap

    def _solver(self, gap: Any, frictional: bool) -> Any:
        """Return a solver for an initial gap (inf where nothing can touch)."""
        case, solver = self.case, self.case.solver
        given = self.lattice, case.solved_pair, gap, self.candidate
        how: dict[str, Any] = {"method": case.method_for(self.lattice), "interface": case.interface}
        if not frictional:
            return NormalContact(*given, rim_warning=False, **how)
        how |= {"coupling": solver.coupling, "iteration": solver.iteration}
        return FrictionalContact(*given, friction_coefficient=self.friction, rim_warning=False, **how)

    def advance(self, state: Any, target: LoadStep, values: tuple[float, ...]) -> Any:
        """Solve a load step from the state at its beginning, None before the first load.

        `values` are the prescribed loads or motions of z, x, y and the twist.
        """
        driven = {"normal_load" if target.z.control == "force" else "approach": values[0]}
        return self.contact.solve(**driven, tolerance=self.case.solver.tolerance)

    def carried(self, state: Any, lattice: Lattice) -> Any:
        """Return a state of a smaller window on this one."""
        return state

    def restored(self, step: Step) -> Any:
        """Return the state at the end of a step on this window, if the next one needs it."""
        return None

    def grown(self, solution: NormalSolution, target: LoadStep) -> Any:
        """Return a larger window for a contact that reached the rim, unless the deck fixes the window."""
        if self.case.window_fixed:
            raise DeckError(
                f"grid: in step {target.index + 1} the contact reaches the rim of the window of "
                f"{self.lattice.n_row} x {self.lattice.n_col} nodes; "
                'expected a larger grid.extent or grid.window, or grid.extent = "auto"'
            )
        larger = self._larger(solution)
        del self.contact  # its memory goes before that of the next comes
        self._bodies.clear()
        self.listener.said("window", step=target.index + 1, before=self.lattice.shape, after=larger.shape)
        return window_over(self.case, larger, self.steps_held, self.listener)

    def _larger(self, solution: Any) -> Lattice:
        """Return the lattice of a larger window for a contact that reached the rim."""
        return self.lattice.grown(solution.zone > 0)

    def failure(
        self, solution: NormalSolution, target: LoadStep, values: tuple[float, ...]
    ) -> ConvergenceError:
        """Return the error of a step that did not converge."""
        from . import nonconvergence

        return nonconvergence.error(self.case, self.lattice, solution, target, values)

    def step(self, target: LoadStep, solution: NormalSolution, spent: float, started: float) -> Step:
        """Return a finished step from its end and the energy spent before; its time counts from `started`."""
        bulk: dict[str, float] = {}
        if self.case.deck.bulk:
            bulk = dict(zip(BULK_STRESS, self.case.bulk(target.bulk)[0].tolist(), strict=True))
            bulk["bulk_body"] = self.case.deck.bulk.body
        if target.roll:
            bulk["rolled_distance"] = target.roll.done
        history: dict[str, float | int | str] = {
            **self._history(solution, spent),
            **bulk,
            "segment": target.segment + 1,
            "label": target.label,
            "seconds": time.perf_counter() - started,
        }
        return Step(
            target.index,
            self.lattice,
            self._fields(solution),
            history,
            prescribed=self._prescribed(target, history),
            load_fraction=(target.index + 1) / len(self.case.load_steps),
            ramp_done=target.fraction,
            bodies=(self.case.body_1, self.case.body_2),
            friction=self.case.friction_coefficient,
            sharp=self.case.deck.interface is None and self.case.period is None,
            shear_limit=self.friction.shear_limit,
        )

    def _fields(self, solution: Any) -> Mapping[str, NDArray[Any]]:
        """Return the fields of a finished step."""
        fields = {"initial_gap": self.initial_gap}
        fields |= {name: getattr(solution, name) for name in self.state}
        fields["gap"] = self._where_touching(solution.gap)
        if self.case.moves:
            fields[MOVED_GAP] = self._where_touching(self.gap)
        if self.worn is not None:
            fields["worn_depth"] = self.worn
        if self.case.frictional and math.isnan(self.case.friction_coefficient) and self.friction.limits:
            fields[NODAL_FRICTION] = np.broadcast_to(self.friction.limits[0], self.lattice.shape)
        if not _DISPLACED.isdisjoint(fields_of(self.case)):
            fields |= self._displaced(solution)
        return fields

    def _displaced(self, solution: Any) -> dict[str, Any]:
        """Return the displacements of the surfaces that the deck names."""
        found: dict[str, Any] = {}
        for body in (1, 2):
            names = [name for name in fields_of(self.case) if name.startswith(f"displacement_{body}")]
            if names and (pair := _pair_of_body(self.case, body)):
                if body not in self._bodies:
                    self._bodies[body] = self._operator(pair)
                goodman = self.case.solver.coupling == "goodman"
                moved = self._bodies[body].displacement(solution, body, goodman)
                found |= {name: self._field(moved, name[-1]) for name in names}
            elif names:
                found |= dict.fromkeys(names, self._rigid)
        return found

    @property
    def _rigid(self) -> Any:
        """Displacement of a rigid body."""
        return np.zeros(self.lattice.shape)

    def _operator(self, pair: ElasticPair) -> Any:
        """Return the operator of a body."""
        return FlexibilityOperator(self.lattice, pair)

    def _field(self, solution: Any, name: str) -> Any:
        """Return a field of a solution."""
        return getattr(solution, name)

    def _where_touching(self, values: Array) -> Array:
        """Return values that are NaN where the bodies cannot touch, without a copy if they can everywhere."""
        return values if self.candidate.all() else np.where(self.candidate, values, np.nan)

    def _prescribed(self, target: LoadStep, history: Mapping[str, Any]) -> dict[str, float]:
        """Return the prescribed loads and motions of a load step, by the keys of the deck."""
        driven = {}
        for motion, drive in zip(MOTIONS, target.targets, strict=True):
            if motion == "z" or self.case.frictional:
                name = target.drives[motion][drive.control == "displacement"]
                # a ramp after the other control begins at the value that control led to
                driven[name] = float(history[name] if drive.from_start else drive.value)
        known = self.case.deck.bulk.components if self.case.deck.bulk else ()
        stresses = zip(BULK_STRESS, target.bulk, strict=True)
        return driven | {name: value for name, value in stresses if name in known}

    def _history(self, solution: Any, spent: float) -> dict[str, float]:
        """Return the numbers of a state: those of the solver, and its measures."""
        known = solution.__dict__
        given = {name: known[name] for name in _STEPPED if name in known}
        measured, ends = self._measures(solution)
        found = given | measured
        if not self.case.deck.interface:
            found |= dict.fromkeys(ends, math.inf)
        if self.case.period:
            found["mean_pressure"] = solution.normal_load / self.case.period.area
        else:
            del found["contact_area_error"], found["mean_gap"]  # refinement has its own error
        return found

    def _measures(self, solution: Any) -> tuple[dict[str, float], list[str]]:
        """Return the measures of a state, and the names of those that rise to an end of the surface."""
        found = measures(self.contact, solution)
        if self.candidate.all() and not self.case.rollers:
            return found, []
        share = self.case.plane_gap.share(self.candidate, self.lattice)
        return found, unbounded(share, solution)


class SharedWindow(Window):
    """A window whose rows all ranks share; each evaluates the gap at its nodes.

    Nodes that enter where their gap closed, or roll across rows into a steady state, depend on those of all
    rows, which each rank has then, as those of a small window.
    """

    _rigid = staticmethod(rigid)

    @property
    def initial_gap(self) -> Any:
        """Gap of the surfaces that have not moved, at any point."""
        return self.case.plane_gap

    def _place(self, target: LoadStep | None) -> None:
        if target is None:
            self.layout = Layout(self.lattice, is_shared(self.case, self.lattice))
            self.friction = self.case.friction_law(self.layout.nodes())
        self.contact = self._solver(self.case.gap_in(target), self.case.frictional)

    def _solver(self, gap: Any, frictional: bool) -> SharedObject:
        how = {"pair": self.case.solved_pair, "interface": self.case.interface}
        if not frictional:
            layout = Layout(self.lattice, ranks.share(self.lattice))
            return SharedObject(layout, NormalPart, layout, gap, **how)
        how |= {"friction_coefficient": self.case.plane_friction, "coupling": self.case.solver.coupling}
        return SharedObject(self.layout, FrictionPart, self.layout, gap, **how)

    def _larger(self, solution: Any) -> Lattice:
        larger: Lattice = self.contact.grown(solution)
        return larger

    def _measures(self, solution: Any) -> tuple[dict[str, float], list[str]]:
        found: tuple[dict[str, float], list[str]] = self.contact.measured(solution)
        return found

    def failure(self, solution: Any, target: LoadStep, values: tuple[float, ...]) -> ConvergenceError:
        """Return the error of a step that did not converge, from its fields, which are gathered here."""
        return super().failure(solution.gathered(), target, values)

    def _operator(self, pair: ElasticPair) -> SharedObject:
        return SharedObject(self.layout, operator_part, self.layout, pair)

    def _field(self, solution: Any, name: str) -> Any:
        return solution.rows(name)

    def _fields(self, solution: Any) -> Mapping[str, NDArray[Any]]:
        rows = {"initial_gap": self.contact.rows("gap_rows")}
        rows |= {name: solution.rows(name) for name in self.state}
        if self.case.moves:
            rows[MOVED_GAP] = rows["initial_gap"]
            rows["initial_gap"] = gap_in_rows(self.initial_gap, self.layout)
        if self.case.frictional and math.isnan(self.case.friction_coefficient) and self.friction.limits:
            rows[NODAL_FRICTION] = self.contact.rows("friction_rows")
        fields = SharedFields(self.layout, rows | self._displaced(solution))
        return dict(fields) if self.steps_held else fields


def window_over(
    case: Problem, lattice: Lattice, steps_held: int = 0, listener: Listener | None = None
) -> Window:
    """Return a case on a window, for the algorithm that it needs; arguments as of `Window`."""
    kind: type[Window] = FrictionWindow if case.frictional else Window
    if ranks.count > 1 and case.method_for(lattice) == "fft":
        if case.frictional:
            kind = SharedFrictionWindow
        elif is_shared(case, lattice):
            kind = SharedWindow
    return kind(case, lattice, steps_held, listener)


def _pair_of_body(case: Problem, number: int) -> ElasticPair | None:
    """Return the compliances of one body against a rigid one; None if it is rigid, too."""
    body = case.body_1 if number == 1 else case.body_2
    if body.rigid and not body.coating:
        return None
    return pair_of(*((body, None) if number == 1 else (None, body)))


class FrictionWindow(Window):
    """Contact with friction; a step starts from the state at the end of the step before."""

    state = STATE[True]

    def advance(
        self,
        state: ContactState | None,
        target: LoadStep,
        values: tuple[float, ...],
    ) -> ContactState:
        """Advance a state to new loads and motions, with surfaces that move at their new place."""
        if self.case.moves:
            self._place(target)
        found: ContactState = self.contact.advance(
            self.contact.virgin().as_start() if state is None else state,
            [motion.control for motion in target.targets],
            values,
            bulk_strain=self.case.bulk(target.bulk)[1],
            static=self.case.solver.algorithm == "static",
            rolling=None if target.roll is None else Rolling(target.roll.direction, target.roll.steady),
            **self.how,
        )
        return found

    @property
    def how(self) -> dict[str, Any]:
        """Entry of nodes and tolerance of the solver."""
        solver = self.case.solver
        return {"entry": solver.entry, "tolerance": solver.tolerance}

    def cycles(self, settings: WearSettings, steps: Any, state: Any) -> Any:
        """Return cycles that wear the surfaces."""
        return CyclesOfWear(settings, self.case.pair, steps, state)

    def remember_wear(self, fields: Mapping[str, NDArray[Any]]) -> None:
        """Remember the worn depth of a cycle, which the core has set."""
        self.worn = fields["worn_depth"]

    def wear(self, depth: Array) -> None:
        """Set the worn depth (m), which adds to the gap before loading."""
        self.worn = depth
        self.contact.wear(depth)

    def grown(self, solution: NormalSolution, target: LoadStep) -> FrictionWindow:
        """Return the problem on a larger window, with its worn depth."""
        larger: FrictionWindow = super().grown(solution, target)
        if self.worn is not None:
            larger.wear(np.asarray(self.lattice.embed(self.worn, larger.lattice, 0.0)))
        return larger

    def carried(self, state: ContactState | None, lattice: Lattice) -> ContactState | None:
        """Return a state on this window; the history of the new nodes follows from it."""
        return None if state is None else self.contact.extended(state, lattice)

    def restored(self, step: Step) -> ContactState | None:
        """Return the whole state, and set the worn depth of the step."""
        if (worn := step.fields.get("worn_depth")) is not None:
            self.wear(np.array(worn))
        state: ContactState = self.contact.assembled(*state_of(step).parts())
        return state

    # --- history ------------------------------------------------------------------------------------------

    def _history(self, solution: ContactState, spent: float) -> dict[str, float]:
        static = self.case.solver.algorithm == "static"  # without history
        in_step = solution.dissipated_energy - (0.0 if static else spent)
        history = {**super()._history(solution, spent), "dissipated_energy_step": in_step}
        left_out = () if self.case.deck.bulk else BULK_STRAIN
        left_out = left_out if self.case.rolls else (*left_out, *CORE["rolling"])
        left_out = (*left_out, "creep_power_error") if self.case.pair.beta else left_out
        left_out = (*left_out, _PATH_ERROR) if static else left_out
        return {name: value for name, value in history.items() if name not in left_out}

    def largest_contact_area(self) -> float:
        """Return the contact area at the largest load of the history, without friction (m2)."""
        solver, cell = self._solver(self.initial_gap, frictional=False), self.lattice.cell_area
        solved = (solver.solve(**drive, tolerance=_ROUGHLY) for drive in self.case.largest_drives)
        return max([cell, *(cell * int((each.parts()[0]["zone"] > 0).sum()) for each in solved)])


def state_of(step: Step) -> ContactState:
    """Return the state with friction at the end of a step with all its fields."""
    needed = {*FrictionWindow.state, *_NUMBERS, "sweeps", "cuts"} - {*BULK_STRAIN, _PATH_ERROR}
    if missing := needed - step.fields.keys() - step.history.keys():
        raise DeckError(
            f"step {step.number} holds no state of a contact with friction: it lacks "
            f"{', '.join(sorted(missing))}"
        )
    state: dict[str, Any] = {name: np.array(step.fields[name]) for name in FrictionWindow.state}
    state |= {name: float(step.history.get(name, 0.0)) for name in _NUMBERS}
    state |= {name: int(step.history[name]) for name in ("sweeps", "cuts")}
    return ContactState(**state)  # a finished step has converged, and away from the rim


class SharedFrictionWindow(SharedWindow, FrictionWindow):
    """Contact with friction whose rows all ranks share."""

    def wear(self, depth: Array) -> None:
        """Set the worn depth (m), which adds to the gap before loading."""
        self.contact.wear(depth)

    def cycles(self, settings: WearSettings, steps: Any, state: Any) -> Any:
        """Return cycles that wear the surfaces."""
        return SharedCycles(state.layout, CyclesOfWear, settings, self.case.pair, steps, state)

    def remember_wear(self, fields: Mapping[str, NDArray[Any]]) -> None:
        """Remember nothing: the core has the worn depth."""
