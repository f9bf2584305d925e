"""A case on one window of its lattice."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import ranks
from ..core.contact import NormalSolution, pair_of
from ..core.friction import ContactState, Rolling
from ..core.lattice import Lattice
from ..core.shared import (
    FrictionPart,
    Layout,
    NormalPart,
    SharedFields,
    gap_in_rows,
    gathered,
    on_ranks,
    operator_part,
    rigid,
    rows_of,
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

    The steps have no history: each is solved from its load alone. All ranks share a window that is not too
    small. Nodes that enter where their gap closed, or roll across rows into a steady state, depend on those
    of all rows, which each rank has then.
    """

    state = STATE[False]  # fields of every step
    contact: Any

    def __init__(
        self, case: Problem, lattice: Lattice, steps_held: int = 0, listener: Listener | None = None
    ) -> None:
        require_memory(case, lattice, steps_held)
        self.case, self.lattice, self.steps_held = case, lattice, steps_held
        self.listener = listener or Listener()
        several = ranks.count > 1 and case.method_for(lattice) == "fft"
        by_rows = several and is_shared(case, lattice)
        self.layout = Layout(lattice, by_rows, by_rows or (several and case.frictional))
        self.friction = case.friction_law(self.layout.nodes())
        self._bodies: dict[int, Any] = {}
        self.contact = self._solver(None, case.frictional)
        if case.moves:  # gap before they move
            shared = self.layout.shared
            self._at_first = gap_in_rows(case.plane_gap, self.layout) if shared else self.contact.gap_rows()

    def _solver(self, target: LoadStep | None, frictional: bool) -> Any:
        """Return a solver for the surfaces at their place in a load step, None: before the first."""
        case, layout, gap = self.case, self.layout, self.case.gap_in(target)
        how = {"pair": case.solved_pair, "interface": case.interface, "method": case.method_for(self.lattice)}
        if not frictional:
            layout = layout._replace(by_rows=layout.shared and ranks.share(self.lattice))
            return on_ranks(layout, NormalPart, gap, **how)
        how |= {"coupling": case.solver.coupling, "iteration": case.solver.iteration}
        law = case.plane_friction if layout.shared else self.friction
        return on_ranks(layout, FrictionPart, gap, friction_coefficient=law, **how)

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
        larger: Lattice = self.contact.grown(solution)
        del self.contact  # its memory goes before that of the next comes
        self._bodies.clear()
        self.listener.said("window", step=target.index + 1, before=self.lattice.shape, after=larger.shape)
        return window_over(self.case, larger, self.steps_held, self.listener)

    def failure(
        self, solution: NormalSolution, target: LoadStep, values: tuple[float, ...]
    ) -> ConvergenceError:
        """Return the error of a step that did not converge."""
        from . import nonconvergence

        return nonconvergence.error(self.case, self.lattice, gathered(solution), target, values)

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
        case, fields = self.case, {"initial_gap": rows_of(self.contact, "gap_rows")}
        if case.moves:
            fields = {MOVED_GAP: fields["initial_gap"], "initial_gap": self._at_first}
        fields |= {name: rows_of(solution, name) for name in self.state}
        if case.frictional and math.isnan(case.friction_coefficient) and self.friction.limits:
            fields[NODAL_FRICTION] = rows_of(self.contact, "friction_rows")
        if not _DISPLACED.isdisjoint(fields_of(case)):
            fields |= self._displaced(solution)
        if not self.layout.shared:
            return fields
        shared = SharedFields(self.layout, fields)
        return dict(shared) if self.steps_held else shared

    def _displaced(self, solution: Any) -> dict[str, Any]:
        """Return the displacements of the surfaces that the deck names."""
        found: dict[str, Any] = {}
        for number, body in enumerate((self.case.body_1, self.case.body_2), start=1):
            names = [name for name in fields_of(self.case) if name.startswith(f"displacement_{number}")]
            if body.rigid and not body.coating:
                found |= dict.fromkeys(names, rigid if self.layout.shared else np.zeros(self.lattice.shape))
            elif names:
                if number not in self._bodies:
                    pair = pair_of(*((body, None) if number == 1 else (None, body)))  # against a rigid one
                    self._bodies[number] = on_ranks(self.layout, operator_part, pair)
                goodman = self.case.solver.coupling == "goodman"
                moved = self._bodies[number].displacement(solution, number, goodman)
                found |= {name: rows_of(moved, name[-1]) for name in names}
        return found

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
        measured, ends = self.contact.measured(solution)
        found = given | measured
        if not self.case.deck.interface:
            found |= dict.fromkeys(ends, math.inf)
        if self.case.period:
            found["mean_pressure"] = solution.normal_load / self.case.period.area
        else:
            del found["contact_area_error"], found["mean_gap"]  # refinement has its own error
        return found


def window_over(
    case: Problem, lattice: Lattice, steps_held: int = 0, listener: Listener | None = None
) -> Window:
    """Return a case on a window, for the algorithm that it needs; arguments as of `Window`."""
    return (FrictionWindow if case.frictional else Window)(case, lattice, steps_held, listener)


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
            self.contact = self._solver(target, frictional=True)
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

    def carried(self, state: ContactState | None, lattice: Lattice) -> ContactState | None:
        """Return a state on this window; the history of the new nodes follows from it."""
        return None if state is None else self.contact.extended(state, lattice)

    def restored(self, step: Step) -> ContactState | None:
        """Return the whole state, and set the worn depth of the step."""
        if (worn := step.fields.get("worn_depth")) is not None:
            self.contact.wear(np.array(worn))
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
        solver, cell = self._solver(None, frictional=False), self.lattice.cell_area
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
