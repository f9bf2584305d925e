"""Runs a case: load step by load step, the window growing with the contact."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import memory
from .errors import ConvergenceError, DeckError
from .estimators import area_radius, edge_radius
from .grid import rim_sides
from .messages import listed
from .progress import Reporter, reporter
from .result import Metadata, Result, Step, assemble
from .variables import FIELDS

if TYPE_CHECKING:
    from .case import Body, Case, LoadStep
    from .lattice import Lattice
    from .native import FlexibilityOperator, NormalContact, NormalSolution
    from .store import Store

Array = NDArray[np.float64]

_STATE = ("pressure", "gap", "zone")  # what every frictionless step leaves
_DISPLACEMENTS = tuple(name for name in FIELDS if name.startswith("displacement_"))
_ITEM = 8  # bytes of a float
_ARRAYS = 12  # fields over the window that Python holds while a step is solved and written
_CIRCULAR = 0.99  # least ratio of the axes of a contact that counts as circular


def metadata_of(case: Case) -> Metadata:
    """Return what the result of `case` says about where it comes from."""
    return Metadata(
        title=case.title,
        deck=case.deck_text,
        fields=tuple(case.output.fields),
        every=case.output.every,
        planned_steps=len(case.load_steps),
        parameters={
            "effective_modulus": case.pair.effective_modulus,
            "dundurs_beta": case.pair.beta,
            "tangential_compliance_ratio": case.pair.gamma,
            "friction_coefficient": case.friction_coefficient,
            "algorithm": case.solver.algorithm,
            "tolerance": case.solver.tolerance,
        },
    )


def run(
    case: Case,
    output: str | Path | None = None,
    overwrite: bool = False,
    on_step: Callable[[Step], object] | None = None,
    progress: Reporter | bool | None = None,
) -> Result:
    """Solve a case.

    Parameters
    ----------
    case : Case
        The checked problem.
    output : path, optional
        netCDF file to write; each step is on the disk before the next begins. Without it the
        result is in memory only, whatever the deck says.
    overwrite : bool
        Replace an output that is there already.
    on_step : callable, optional
        Called with each finished `Step`.
    progress : Reporter or bool, optional
        Who is told about each step; True: a bar on a terminal, lines otherwise.

    Returns
    -------
    Result

    Raises
    ------
    DeckError
        If the output cannot be written, or the contact outgrows a fixed window.
    ConvergenceError
        If a load step misses its tolerance; with an output, the steps before it are kept.
    ResourceError
        If there is not enough memory or disk.
    """
    shown = progress if isinstance(progress, Reporter) else reporter(quiet=not progress)
    if output is None:
        finished: list[Step] = []
        with shown.watching(case.title, len(case.load_steps)):
            for step in steps(case, kept_in_memory=True):
                finished.append(step)
                shown.finished(step)
                if on_step is not None:
                    on_step(step)
        return Result(assemble(metadata_of(case), finished))

    from .store import Store, open_result

    with (
        Store(output, metadata_of(case), overwrite) as store,
        shown.watching(case.title, len(case.load_steps)),
    ):
        record(case, store, shown, on_step)
    return open_result(store.path)


def record(
    case: Case, store: Store, shown: Reporter, on_step: Callable[[Step], object] | None = None
) -> None:
    """Solve a case into a store, up to the finished output.

    Parameters
    ----------
    case : Case
        The checked problem.
    store : Store
        Where the steps go.
    shown : Reporter
        Who is told about each step.
    on_step : callable, optional
        Called with each finished `Step`, when it is safe.

    Raises
    ------
    DeckError, ConvergenceError, ResourceError
        As `run`.
    """
    for step in steps(case):
        store.append(step)
        shown.finished(step)
        if on_step is not None:
            on_step(step)
    store.finish()


def memory_needed(case: Case, lattice: Lattice) -> int:
    """Return the memory (bytes) that solving and writing a load step on a window takes."""
    from . import native

    bodies = {name[:-2] for name in case.output.fields if name in _DISPLACEMENTS}
    operator = native.memory_needed("fft", lattice.n_row, lattice.n_col, operator_only=True)
    return case.memory_needed(lattice) + len(bodies) * operator + _ARRAYS * _ITEM * lattice.size


def require_memory(case: Case, lattice: Lattice, held: int = 0) -> None:
    """Refuse a window that does not fit into memory.

    Parameters
    ----------
    case : Case
        The problem.
    lattice : Lattice
        The window.
    held : int
        Bytes a node that the result will keep in memory.

    Raises
    ------
    ResourceError
        If less memory is available.
    """
    advice = ["a smaller window" if case.window_fixed else "a larger grid.spacing"]
    if (method := case.method_for(lattice)) == "direct":
        advice.append('solver.method = "fft"')
    if held:
        advice.append("an output file")
    memory.require(
        memory_needed(case, lattice) + held * lattice.size,
        f"a window of {lattice.n_row} x {lattice.n_col} nodes (method {method})",
        f"choose {listed(advice, 'or')}",
    )


def steps(case: Case, kept_in_memory: bool = False) -> Iterator[Step]:
    """Solve a case step by step.

    Parameters
    ----------
    case : Case
        The checked problem.
    kept_in_memory : bool
        The caller keeps all steps, so there has to be memory for them.

    Yields
    ------
    Step
        Each load step when it is finished.

    Raises
    ------
    DeckError
        If the contact outgrows a fixed window.
    ConvergenceError
        If a load step misses its tolerance.
    ResourceError
        If there is not enough memory.
    """
    fields = [*_STATE, *(name for name in _DISPLACEMENTS if name in case.output.fields)]
    held = len(case.load_steps) * len(fields) * _ITEM if kept_in_memory else 0
    window = _Window(case, case.lattice, fields, held)
    now = {"force": 0.0, "displacement": 0.0}  # normal load and approach
    segment, at_start = -1, now
    for target in case.load_steps:
        started = time.perf_counter()
        if target.segment != segment:
            segment, at_start = target.segment, now
        value = target.z.at(at_start[target.z.control])
        while True:
            solution = window.solve(target.z.control, value)
            if not any(rim_sides(solution.zone > 0)):
                break
            window = window.grown(solution, target)
        if not solution.converged:
            raise ConvergenceError(_not_converged(case, target, solution))
        now = {"force": solution.normal_load, "displacement": solution.approach}
        yield window.step(target, solution, started)


class _Window:
    """A case on one window of its lattice: gap, solver, operators."""

    def __init__(self, case: Case, lattice: Lattice, fields: list[str], held: int) -> None:
        from .native import NormalContact

        require_memory(case, lattice, held)
        self.case, self.lattice, self.fields, self.held = case, lattice, fields, held
        gap, self.candidate = case.initial_gap(lattice)
        self.gap: Array = np.where(self.candidate, gap, np.nan)
        self.contact: NormalContact = NormalContact(
            lattice,
            case.pair,
            gap,
            candidate=self.candidate,
            method=case.method_for(lattice),
        )
        self.bodies: dict[int, FlexibilityOperator] = {}

    def solve(self, control: str, value: float) -> NormalSolution:
        """Press with a force or to an approach."""
        tolerance = self.case.solver.tolerance
        if control == "force":
            return self.contact.solve(normal_load=value, tolerance=tolerance)
        return self.contact.solve(approach=value, tolerance=tolerance)

    def grown(self, solution: NormalSolution, target: LoadStep) -> _Window:
        """Return a larger window."""
        if self.case.window_fixed:
            raise DeckError(
                f"grid: in step {target.index + 1} the contact reaches the rim of the window of "
                f"{self.lattice.n_row} x {self.lattice.n_col} nodes; "
                'expected a larger grid.extent or grid.window, or grid.extent = "auto"'
            )
        del self.contact  # its memory goes before that of the next comes
        self.bodies.clear()
        return _Window(self.case, self.case.grown(self.lattice, solution.zone > 0), self.fields, self.held)

    def step(self, target: LoadStep, solution: NormalSolution, started: float) -> Step:
        fields: dict[str, NDArray[Any]] = {
            "initial_gap": self.gap,
            "pressure": solution.pressure,
            "gap": np.where(self.candidate, solution.gap, np.nan),
            "zone": solution.zone,
        }
        for body in (1, 2):
            wanted = [name for name in self.fields if name.startswith(f"displacement_{body}")]
            if wanted:
                moved = self.displacement(body, solution.pressure)
                fields |= {name: moved[name[-1]] for name in wanted}
        history = _history(self.lattice, fields, solution)
        history |= {
            "segment": target.segment + 1,
            "label": target.label,
            "seconds": time.perf_counter() - started,
        }
        return Step(target.index, self.lattice, fields, history)

    def displacement(self, number: int, pressure: Array) -> dict[str, Array]:
        """Surface displacement of one body, z into the body itself."""
        from .native import ElasticPair, FlexibilityOperator

        body: Body = self.case.body_1 if number == 1 else self.case.body_2
        if body.rigid:
            return dict.fromkeys("xyz", np.zeros(self.lattice.shape))
        if number not in self.bodies:
            # against a rigid partner the relative displacement u1 - u2 is that of the body alone
            material, rigid = (body.young_modulus, body.poisson_ratio), (None, None)
            pair = ElasticPair.from_materials(*(material + rigid if number == 1 else rigid + material))
            self.bodies[number] = FlexibilityOperator(self.lattice, pair)
        z, x, y = self.bodies[number].apply(pressure)
        sign = 1.0 if number == 1 else -1.0
        return {"x": sign * x, "y": sign * y, "z": z}


def _not_converged(case: Case, target: LoadStep, solution: NormalSolution) -> str:
    return (
        f"step {target.index + 1} of {len(case.load_steps)} did not converge: after {solution.sweeps} "
        f"iterations the residuals are R_n = {solution.residual_normal:.2e} and "
        f"R_P = {solution.residual_force:.2e}; solver.tolerance = {case.solver.tolerance:g} was expected"
    )


def _history(
    lattice: Lattice, fields: dict[str, NDArray[Any]], solution: NormalSolution
) -> dict[str, float | int | str]:
    """Return what has one value by step and follows from the solution of the step."""
    pressure, inside = fields["pressure"], fields["zone"] > 0
    # in contact the elastic closing is w = gap - initial gap + approach
    closing = (fields["gap"] - fields["initial_gap"] + solution.approach)[inside]
    return {
        "normal_load": solution.normal_load,
        "approach": solution.approach,
        "contact_area": lattice.cell_area * int(inside.sum()),
        "contact_radius": area_radius(inside, lattice.cell_area),
        "contact_radius_fit": _edge_radius(lattice, pressure),
        "max_pressure": float(pressure.max()),
        "elastic_energy": 0.5 * lattice.cell_area * float(pressure[inside] @ closing),
        "sweeps": solution.sweeps,
        "operator_applications": solution.operator_applications,
        "residual_normal": solution.residual_normal,
        "residual_force": solution.residual_force,
    }


def _edge_radius(lattice: Lattice, pressure: Array) -> float:
    """Return the radius at which the pressure of a circular contact vanishes, NaN if it is not circular."""
    loaded = pressure > 0
    if not loaded.any():
        return math.nan
    weight, points = pressure[loaded], np.stack([lattice.x[loaded], lattice.y[loaded]])
    center = points @ weight / weight.sum()
    small, large = np.linalg.eigvalsh(np.cov(points, aweights=weight, bias=True))
    if small < _CIRCULAR**2 * large:
        return math.nan
    return edge_radius(lattice.x, lattice.y, pressure, lattice.spacing, (float(center[0]), float(center[1])))
