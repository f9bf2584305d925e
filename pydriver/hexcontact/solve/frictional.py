"""Contact with friction on one window of the lattice, and its state from the records of a run."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from ..arrays import Array
from ..core.friction import ContactState, FrictionalContact
from ..core.lattice import Lattice
from ..errors import DeckError
from ..problem.loads import LoadStep
from ..result.step import Step
from ..variables import BULK_STRAIN, CORE, STATE
from .window import Window

# numbers of a state that have the names of the history
_NUMBERS = (*CORE["numbers"], *CORE["residuals"], "operator_applications")
_PATH_ERROR = "dissipated_energy_path_error"  # static steps have no path
_ROUGHLY = 1e-4  # residual of a solution that serves for the size of the contact


class FrictionWindow(Window[ContactState]):
    """Contact with friction; a step starts from the state at the end of the step before."""

    state = STATE[True]
    _contact: FrictionalContact

    def _solver(self, gap: Array) -> FrictionalContact:
        return FrictionalContact(
            self.lattice,
            self.case.solved_pair,
            gap,
            self.candidate,
            friction_coefficient=self.friction,
            coupling="goodman" if self.case.solver.coupling == "goodman" else "full",
            method=self.case.method_for(self.lattice),
            iteration="dissertation" if self.case.solver.iteration == "dissertation" else "newton",
            interface=self.case.interface,
            rim_warning=False,
        )

    def advance(
        self,
        state: ContactState | None,
        target: LoadStep,
        values: tuple[float, ...],
        **how: Any,
    ) -> ContactState:
        """Advance a state to new loads and motions; `how` goes to the solver."""
        return self._contact.advance(
            self._contact.virgin() if state is None else state,
            [motion.control for motion in target.targets],
            values,
            bulk_strain=self.case.bulk(target.bulk)[1],
            static=self.case.solver.algorithm == "static",
            entry="interpolated" if self.case.solver.entry == "interpolated" else "implicit",
            **{"tolerance": self.case.solver.tolerance} | how,
        )

    def wear(self, depth: Array) -> None:
        """Set the worn depth (m), which adds to the gap before loading."""
        self.worn = depth
        del self._contact  # frees the memory of the solver before that of the next
        self._contact = self._solver(np.where(self.candidate, self.initial_gap + depth, np.inf))

    def grown(self, solution: ContactState, target: LoadStep) -> Self:
        """Return the problem on a larger window, with its worn depth."""
        larger = super().grown(solution, target)
        if self.worn is not None:
            larger.wear(np.asarray(self.lattice.embed(self.worn, larger.lattice, 0.0), dtype=float))
        return larger

    def joined(self, first: ContactState, last: ContactState) -> ContactState:
        """Record two steps as one, with the slip of both and its residual."""
        return self._contact.joined(first, last)

    def carried(self, state: ContactState | None, lattice: Lattice) -> ContactState | None:
        """Return a state on this window; the history of the new nodes follows from it."""
        return None if state is None else self._contact.extended(state, lattice)

    def restored(self, step: Step) -> ContactState | None:
        """Return the whole state, and set the worn depth of the step."""
        if (worn := step.fields.get("worn_depth")) is not None:
            self.wear(np.array(worn))
        return state_of(step)

    # --- history ------------------------------------------------------------------------------------------

    def _history(self, solution: ContactState, before: ContactState | None) -> dict[str, float]:
        static = self.case.solver.algorithm == "static"  # nothing has gone before
        spent_before = 0.0 if before is None or static else before.dissipated_energy
        spent = solution.dissipated_energy - spent_before
        history = {**super()._history(solution, before), "dissipated_energy_step": spent}
        left_out = () if self.case.deck.bulk else BULK_STRAIN
        left_out = (*left_out, _PATH_ERROR) if static else left_out
        return {name: value for name, value in history.items() if name not in left_out}

    def largest_contact_area(self) -> float:
        """Return the contact area at the largest load of the history, without friction (m2)."""
        solver, nodes = self._without_friction(self.initial_gap), 1
        for drive in self.case.largest_drives:
            known: dict[str, Any] = {**drive}
            nodes = max(nodes, int((solver.solve(**known, tolerance=_ROUGHLY).zone > 0).sum()))
        return self.lattice.cell_area * nodes


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
