"""Contact with friction on one window of the lattice, and the state of a run as its records keep it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core import contact
from ..core.edges import ContactEdges, Edge
from ..core.estimators import area_radius
from ..core.friction import ContactState, FrictionalContact
from ..core.measures import elastic_energy, zone_extent
from ..errors import DeckError
from ..problem.loads import LoadStep
from ..result.step import Step
from ..variables import CORE, STATE
from .frictionless import Array, Window

if TYPE_CHECKING:
    from ..core.lattice import Lattice

# numbers of a state that have the names of the history
_NUMBERS = (*CORE["numbers"], *CORE["residuals"], "operator_applications")
_ROUGHLY = 1e-4  # residual of a solution that only tells how large the contact becomes


class FrictionWindow(Window[ContactState]):
    """Contact with friction; a step starts from the state at the end of the step before."""

    state = STATE[True]

    def _solver(self, gap: Array) -> FrictionalContact:
        return FrictionalContact(
            self.lattice,
            self.case.pair,
            gap,
            self.candidate,
            friction_coefficient=self.case.friction_coefficient,
            coupling="goodman" if self.case.solver.coupling == "goodman" else "full",
            method=self.case.method_for(self.lattice),
        )

    def advance(
        self, state: ContactState | None, target: LoadStep, values: tuple[float, ...]
    ) -> ContactState:
        """Go on from a state to new loads and motions."""
        solution: ContactState = self._contact.advance(
            self._contact.virgin() if state is None else state,
            [motion.control for motion in target.targets],
            values,
            static=self.case.solver.algorithm == "static",
            entry="interpolated" if self.case.solver.entry == "interpolated" else "implicit",
            tolerance=self.case.solver.tolerance,
        )
        return solution

    def carried(self, state: ContactState | None, lattice: Lattice) -> ContactState | None:
        """Return a state on this window; what the new nodes have been through follows from it."""
        return None if state is None else self._contact.extended(state, lattice)

    def restored(self, step: Step) -> ContactState | None:
        """Return the whole state."""
        return state_of(step)

    # --- what a step leaves -------------------------------------------------------------------------------

    def _more_history(
        self, solution: ContactState, before: ContactState | None, edges: ContactEdges
    ) -> dict[str, float]:
        static = self.case.solver.algorithm == "static"  # nothing has gone before
        spent_before = 0.0 if before is None or static else before.dissipated_energy
        return {
            **{name: getattr(solution, name) for name in _NUMBERS},
            **self._stick_measures(solution, edges),
            "max_traction": float(np.hypot(solution.traction_x, solution.traction_y).max()),
            "dissipated_energy_step": solution.dissipated_energy - spent_before,
            "elastic_energy": elastic_energy(self.lattice, self.initial_gap, solution),
            "sweeps": solution.sweeps,
            "cuts": solution.cuts,
        }

    def stick_edge(self, solution: ContactState, edges: ContactEdges) -> Edge:
        """Return the edge of the stick zone."""
        stick, mu = solution.zone == 1, self.case.friction_coefficient
        reserve = np.zeros(stick.shape)  # not looked at where nothing slips
        if math.isfinite(mu):
            reserve = mu * solution.pressure - np.hypot(solution.traction_x, solution.traction_y)
        return edges.stick(stick, reserve)

    def largest_contact_area(self) -> float:
        """Return the contact area at the largest load of the history, without friction (m2)."""
        method = self.case.method_for(self.lattice)
        solver = contact.NormalContact(self.lattice, self.case.pair, self.initial_gap, self.candidate, method)
        areas = []
        for control, name in (("force", "normal_load"), ("displacement", "approach")):
            values = [step.z.value for step in self.case.load_steps if step.z.control == control]
            if (value := max(values, default=0.0)) > 0:
                driven: dict[str, Any] = {name: value}
                solution = solver.solve(**driven, tolerance=_ROUGHLY)
                areas.append(self.lattice.cell_area * int((solution.zone > 0).sum()))
        return max([self.lattice.cell_area, *areas])

    def _stick_measures(self, solution: ContactState, edges: ContactEdges) -> dict[str, float]:
        """Return size and place of the stick zone; NaN for its place where there is none."""
        stick = solution.zone == 1
        edge = self.stick_edge(solution, edges)
        center, lower, upper = zone_extent(self.lattice, stick)
        return {
            "stick_area": self.lattice.cell_area * int(stick.sum()),
            "stick_radius": area_radius(stick, self.lattice.cell_area),
            "stick_area_fit": edge.area,
            "stick_radius_fit": edge.radius,
            "stick_center_x": float(center[0]),
            "stick_center_y": float(center[1]),
            "stick_min_x": float(lower[0]),
            "stick_max_x": float(upper[0]),
            "stick_min_y": float(lower[1]),
            "stick_max_y": float(upper[1]),
        }


def state_of(step: Step) -> ContactState:
    """Return the state of a contact with friction at the end of a step, as the run had it.

    Parameters
    ----------
    step : Step
        A step of a frictional run, or its record in the journal; all its fields are needed.

    Raises
    ------
    DeckError
        If a field or a value is missing, as in a frictionless run.
    """
    needed = {*FrictionWindow.state, *_NUMBERS, "sweeps", "cuts"}
    if missing := needed - step.fields.keys() - step.history.keys():
        raise DeckError(
            f"step {step.number} holds no state of a contact with friction: it lacks "
            f"{', '.join(sorted(missing))}"
        )
    state: dict[str, Any] = {name: np.array(step.fields[name]) for name in FrictionWindow.state}
    state |= {name: float(step.history[name]) for name in _NUMBERS}
    state |= {name: int(step.history[name]) for name in ("sweeps", "cuts")}
    return ContactState(**state)  # a finished step has converged, and away from the rim
