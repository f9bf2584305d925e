"""Refinement of the lattice of a case until its result reaches the target accuracy.

Lattices that get finer by the square root of two are solved one after the other, each with the whole load
history, until the last two agree to the target. Then four shifted copies of the lattice two levels below,
which together have as many nodes as the finest, show the scatter, and errors are estimated. If they miss the
target, the next level follows. The solutions are independent, since the solvers start every load step on
coarser lattices of their own.

The difference of a solution and the limit of vanishing spacing has two parts: a trend with the spacing, and a
scatter, since the contact lies differently on every lattice, often the larger part, which shifted copies show
at the least cost. The core fits both parts to the last solutions, for every scalar of the history and every
load step (fortran/path/discretization_error.f90).
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.flat import unresolved_slip_zones
from ..core.measures import limits_of_error
from ..errors import DeckError, ResourceError
from ..problem.loads import LoadStep
from ..problem.preview import SHIFTS, Trial
from ..problem.problem import LEAST_LEVELS, RATIO, Problem
from ..result.journal import Journal, Solution, TrialFolder, journal_of
from ..result.layout import Metadata
from ..result.step import Step
from ..result.store import Store
from ..text import counted
from ..variables import ESTIMATED, LOADS, VARIABLES, spelled
from .events import Listener
from .memory_needed import require_memory
from .steps import check_step, steps

_SAME = 1e-12  # relative difference of equal spacings


@dataclass(frozen=True)
class Refinement:
    """Solutions of a case on all its lattices, with the estimated errors."""

    solutions: Sequence[Solution]
    errors: Sequence[Mapping[str, float]]  # of each scalar by load step
    relative: Mapping[str, float]  # largest errors of the judged quantities over their largest values
    target: float
    limit: str  # reason why the lattice was not refined further; empty if the target was reached

    @property
    def parameters(self) -> dict[str, Any]:
        """Attributes of the result."""
        reached = _meets(self.relative, self.target)
        found = {"accuracy_estimate": worst(self.relative)[1], "accuracy_reached": np.int32(reached)}
        return found if reached else {**found, "accuracy_shortfall": self.shortfall}

    @property
    def shortfall(self) -> str:
        """Sentence on the quantity that missed the target, and the reason."""
        name, error = worst(self.relative)
        return (
            f"accuracy.target = {self.target:g} is not reached: the estimated error of {name} is {error:.2g} "
            f"of its largest value; {self.limit}"
        )

    @property
    def trials(self) -> dict[str, list[Any]]:
        """The table of the lattices."""
        columns: dict[str, list[Any]] = {
            f"trial_{name}": [getattr(s, name) for s in self.solutions]
            for name in ("level", "copy", "spacing", "nodes")
        }
        columns |= {
            f"trial_origin_{axis}": [s.origin["xy".index(axis)] for s in self.solutions] for axis in "xy"
        }
        for name in ESTIMATED:
            if name in self.solutions[0].histories[0]:
                columns[f"trial_{name}"] = [[h[name] for h in s.histories] for s in self.solutions]
        return columns

    def metadata(self, metadata: Metadata) -> Metadata:
        """Return the metadata of a result with the reached accuracy."""
        return dataclasses.replace(metadata, parameters={**metadata.parameters, **self.parameters})

    def with_errors(self, step: Step) -> Step:
        """Return a load step of the finest lattice with its errors in the history."""
        errors = {f"{name}_error": error for name, error in self.errors[step.index].items()}
        return dataclasses.replace(step, history={**step.history, **errors})


def refine(case: Problem, solver: InMemory | OnDisk) -> Refinement:
    """Solve a case on finer and finer lattices up to its accuracy or a limit."""
    assert case.accuracy is not None
    target = case.accuracy.target
    levels: list[Solution] = []
    copies: list[Solution] = []

    def solved(trial: Trial) -> Solution:
        on_lattice = trial.case(case)
        solver.listener.lattice(trial.name, on_lattice.lattice, trial.copy > 0)
        return solver.solve(trial, on_lattice)

    while True:
        levels.append(solved(Trial(len(levels))))
        limit = limit_of(case, levels[-1], solver.in_memory)
        if len(levels) < LEAST_LEVELS:
            if limit:
                raise ResourceError(f"{limit}; estimates of errors need {LEAST_LEVELS} lattices")
            continue
        if not limit and not _meets(changes(levels[-2], levels[-1], case.load_steps), target):
            continue
        coarse = len(levels) - LEAST_LEVELS
        copies += [solved(Trial(coarse, copy)) for copy in range(1, len(SHIFTS) + 1)]
        solutions = [*levels, *copies]
        errors = estimated_errors(solutions, case.load_steps)
        relative = relative_errors(levels[-1].histories, errors)
        name, error = worst(relative)
        words = spelled(name.removesuffix("_fit"))
        text = f"estimated error {100 * error:.2g} % ({words}), target {100 * target:.3g} %"
        solver.listener.said("errors", text, worst=name, error=error, target=target)
        if limit or _meets(relative, target):
            return Refinement(solutions, errors, relative, target, limit)


def _meets(relative: Mapping[str, float], target: float) -> bool:
    return all(error <= target for error in relative.values())


def limit_of(case: Problem, last: Solution, in_memory: bool) -> str:
    """Return the reason why the lattice cannot be refined after a solution; empty if it can."""
    assert case.accuracy is not None
    try:
        finer = Trial(last.level + 1).case(case)
        nodes = finer.lattice.size
        if last.nodes > Trial(last.level).case(case).lattice.size:  # a window that grew grows again
            nodes = max(nodes, math.ceil(RATIO**2 * last.nodes))
        if nodes > case.accuracy.max_nodes:
            return (
                f"the next lattice has about {nodes:,} nodes, more than "
                f"accuracy.max_nodes = {case.accuracy.max_nodes:,}"
            )
        require_memory(finer, finer.lattice, len(case.load_steps) if in_memory else 0)
    except ResourceError as error:
        return str(error)
    return ""


# --- records of load steps ----------------------------------------------------------------------------------


def _solved(
    trial: Trial,
    case: Problem,
    listener: Listener,
    keep: Callable[[Step], object],
    before: Sequence[Step] = (),
    in_memory: bool = False,
) -> Solution:
    """Solve the load history on a lattice; `keep` records each load step."""
    heads = [step.head for step in before]
    for step in steps(case, in_memory, before, listener=listener):
        keep(step)
        heads.append(step.head)
        listener.step(step)
    lattice = case.lattice
    nodes = max(step.lattice.size for step in heads)
    histories = [step.history for step in heads]
    return Solution(trial.level, trial.copy, lattice.spacing, lattice.origin, nodes, histories)


class InMemory:
    """Keeps the load steps of the finest lattice in a list."""

    in_memory = True

    def __init__(self, steps: list[Step], listener: Listener) -> None:
        self.steps, self.listener = steps, listener

    def solve(self, trial: Trial, case: Problem) -> Solution:
        """Solve the load history on a lattice, without a record for a shifted copy."""
        if trial.copy:
            return _solved(trial, case, self.listener, keep=lambda step: None)
        self.steps.clear()
        return _solved(trial, case, self.listener, self.steps.append, in_memory=True)


class OnDisk:
    """Keeps finished lattices, and the load steps of the present one, in the journal of an output."""

    in_memory = False

    def __init__(self, store: Store, listener: Listener) -> None:
        self._store, self.listener = store, listener
        self._trials = TrialFolder(store.folder)
        self._solutions = self._trials.solutions if self._trials else []
        with store.writing("the journal"):
            self._trials.begin(store.metadata)

    def solve(self, trial: Trial, case: Problem) -> Solution:
        """Solve the load history on a lattice, or its missing steps."""
        for solution in self._solutions:
            if (solution.level, solution.copy) == (trial.level, trial.copy):
                if abs(solution.spacing - case.lattice.spacing) > _SAME * solution.spacing:
                    raise DeckError(
                        f"the deck now leads to other lattices than those finished for {self._store.path}"
                    )
                return solution
        path, last = self._trials.path(trial.level, trial.copy), None
        if Journal(journal_of(path)):
            store, last = Store.reopened(path)
            self._trials.check(self._store.metadata.run, store.metadata.run)
        else:
            store = Store(path, self._store.metadata, overwrite=True)
        store.interim = False
        with contextlib.closing(store):
            if last is not None:
                found = f"{counted(len(store.heads), 'finished step')} on {trial.name} of {self._store.path}"
                check_step(case, last, found)
            before = [*store.heads[:-1], last] if last is not None else []
            solution = _solved(trial, case, self.listener, store.append, before)
        with self._store.writing(f"{trial.name}"):
            self._trials.add(solution)
        return solution

    def finish(self, refinement: Refinement) -> None:
        """Write the output and delete the journal."""
        best = finest(refinement.solutions)
        journal = Journal(journal_of(self._trials.path(best.level)))
        self._store.finish(
            refinement.metadata(self._store.metadata),
            lambda: map(refinement.with_errors, journal),
            refinement.trials,
        )


# --- distance from the limit of vanishing spacing -----------------------------------------------------------

LEVELS_FITTED = 4  # the finest ones, with their shifted copies

JUDGED = ("max_pressure", "contact_area_fit", "stick_area_fit", "approach")
"""Quantities that have the target."""

_ZONES = ("contact_area_fit", "stick_area_fit", "max_traction", "max_pressure")
"""Quantities of a load step that show the width of its slip zone."""


def finest(solutions: Sequence[Solution]) -> Solution:
    """Return the solution on the finest lattice, which is the result."""
    return max(solutions, key=lambda solution: (solution.level, -solution.copy))


def driven(target: LoadStep) -> set[str]:
    """Return the prescribed loads and motions of a load step, which have no error."""
    motions = zip(LOADS.values(), target.targets, strict=True)
    return {pair[motion.control == "displacement"] for pair, motion in motions}


def estimated_errors(solutions: Sequence[Solution], targets: Sequence[LoadStep]) -> list[dict[str, float]]:
    """Estimate the discretization error of every scalar of the finest solution, by load step.

    The error has the unit of its quantity: 0 if that is prescribed, NaN without a value on one of the
    lattices. Three levels and shifted copies are needed, else ValueError.
    """
    best = finest(solutions)
    used = [s for s in solutions if s.level > best.level - LEVELS_FITTED]
    used.sort(key=lambda solution: (-solution.level, solution.copy))
    names = [name for name in ESTIMATED if name in best.histories[0]]
    values = np.array([[[h[name] for name in names] for h in s.histories] for s in used], dtype=float)
    spacings = np.array([s.spacing for s in used]) / best.spacing
    rough = np.tile([VARIABLES[name].rough for name in names], len(targets))
    narrow: NDArray[np.bool_] = np.zeros(values.shape[1:], dtype=bool)
    if set(_ZONES) <= set(names):
        columns = (values[0][:, names.index(name)] for name in _ZONES)
        zones = unresolved_slip_zones(best.spacing, *columns)
        narrow = np.outer(zones, [VARIABLES[name].slip_zone for name in names])
    flat = values.reshape(len(used), -1)
    errors = limits_of_error(spacings, flat, rough, narrow.ravel()).reshape(values.shape[1:])
    found = []
    for target, row in zip(targets, errors, strict=True):
        prescribed = driven(target)
        found.append({
            name: 0.0 if name in prescribed else float(error) for name, error in zip(names, row, strict=True)
        })  # fmt: skip
    return found


def relative_errors(
    histories: Sequence[Mapping[str, Any]], errors: Sequence[Mapping[str, float]]
) -> dict[str, float]:
    """Return the largest error of each bounded quantity of `JUDGED`, over its largest value."""
    found = {}
    for name in JUDGED:
        if name in errors[0]:
            largest = max(abs(float(history[name])) for history in histories)
            if math.isinf(largest):
                continue
            error = float(np.max([step[name] for step in errors]))  # NaN if one is
            found[name] = error / largest if largest else math.inf if error else 0.0
    return found


def changes(coarse: Solution, fine: Solution, targets: Sequence[LoadStep]) -> dict[str, float]:
    """Return the relative differences of two solutions, lower bounds of `relative_errors`."""
    names = [name for name in JUDGED if name in fine.histories[0]]
    differences = [
        {name: 0.0 if name in driven(target) else abs(float(one[name]) - float(two[name])) for name in names}
        for target, one, two in zip(targets, coarse.histories, fine.histories, strict=True)
    ]
    return relative_errors(fine.histories, differences)


def worst(relative: Mapping[str, float]) -> tuple[str, float]:
    """Return the quantity with the largest error, and the error."""
    name = max(relative, key=lambda name: relative[name] if relative[name] == relative[name] else math.inf)
    return name, relative[name]
