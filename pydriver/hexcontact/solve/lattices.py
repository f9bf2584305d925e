"""Refines the lattice of a case until its result is as accurate as asked for.

Lattices that get finer by the square root of two are solved one after the other, each with the whole load
history, until the last two agree to the target. Then four shifted copies of the lattice two levels below,
which together have as many nodes as the finest, show the scatter, and errors are estimated. If they miss the
target the next level follows. The solvers start every load step from coarser lattices of their own, so that
nothing is handed from one lattice to the next.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..errors import ResourceError, StopRun
from ..result.result import Metadata, Result, Step, assemble
from ..result.trials import Solution
from ..text import quantity
from ..variables import ESTIMATED
from . import accuracy, log
from .accuracy import LEAST_LEVELS, RATIO, SHIFTS
from .progress import Reporter

if TYPE_CHECKING:
    from ..problem.problem import Problem

History = Mapping[str, Any]


@dataclass(frozen=True)
class Trial:
    """A lattice to solve the case on.

    Parameters
    ----------
    level : int
        How often it was refined.
    copy : int
        0: the lattice itself, else the number of its shifted copy.
    """

    level: int
    copy: int = 0

    def case(self, case: Problem) -> Problem:
        """Return the case on this lattice."""
        spacing = case.lattice.spacing / RATIO**self.level
        origin = np.array(case.lattice.origin)
        if self.copy:
            origin += SHIFTS[self.copy - 1] @ case.lattice.basis / RATIO**self.level
        return case.on_lattice(spacing, (float(origin[0]), float(origin[1])))

    @property
    def name(self) -> str:
        """Say which one it is: "lattice 3", "lattice 1, shifted (2 of 4)"."""
        shifted = f", shifted ({self.copy} of {len(SHIFTS)})" if self.copy else ""
        return f"lattice {self.level + 1}{shifted}"


class Solver(ABC):
    """Solves a case on one lattice after the other, and keeps what comes out.

    Attributes
    ----------
    in_memory : bool
        Whether the load steps of a lattice stay in memory.
    """

    in_memory: ClassVar[bool] = False

    @abstractmethod
    def solve(self, trial: Trial, case: Problem) -> Solution:
        """Solve the load history on a lattice.

        Parameters
        ----------
        trial : Trial
            The lattice.
        case : Problem
            The case on it.
        """


@dataclass(frozen=True)
class Outcome:
    """What a refinement came to.

    Parameters
    ----------
    solutions : sequence of Solution
        On all lattices, in the order they were solved.
    errors : sequence of mapping
        Estimated error of each scalar by load step.
    relative : mapping of str to float
        Largest error of those quantities that are to reach the target, in their largest value.
    target : float
        The target.
    limit : str
        What kept the lattice from being refined further; empty if the target was reached.
    """

    solutions: Sequence[Solution]
    errors: Sequence[Mapping[str, float]]
    relative: Mapping[str, float]
    target: float
    limit: str

    @property
    def parameters(self) -> dict[str, Any]:
        """Attributes of the result."""
        reached = _meets(self.relative, self.target)
        told = {"accuracy_estimate": accuracy.worst(self.relative)[1], "accuracy_reached": np.int32(reached)}
        return told if reached else {**told, "accuracy_shortfall": self.shortfall}

    @property
    def shortfall(self) -> str:
        """Say which quantity missed the target, and why it ended there."""
        name, error = accuracy.worst(self.relative)
        return (
            f"accuracy.target = {self.target:g} is not reached: the estimated error of {name} is {error:.2g} "
            f"of its largest value; {self.limit}"
        )

    @property
    def trials(self) -> dict[str, list[Any]]:
        """The table of the lattices."""
        columns: dict[str, list[Any]] = {
            "trial_level": [s.level for s in self.solutions],
            "trial_copy": [s.copy for s in self.solutions],
            "trial_spacing": [s.spacing for s in self.solutions],
            "trial_origin_x": [s.origin[0] for s in self.solutions],
            "trial_origin_y": [s.origin[1] for s in self.solutions],
            "trial_nodes": [s.nodes for s in self.solutions],
        }
        for name in ESTIMATED:
            if name in self.solutions[0].histories[0]:
                columns[f"trial_{name}"] = [[h[name] for h in s.histories] for s in self.solutions]
        return columns

    def metadata(self, metadata: Metadata) -> Metadata:
        """Return what the result says about where it comes from."""
        return dataclasses.replace(metadata, parameters={**metadata.parameters, **self.parameters})

    def with_errors(self, step: Step) -> Step:
        """Return a load step of the finest lattice with its errors."""
        errors = {f"{name}_error": error for name, error in self.errors[step.index].items()}
        return dataclasses.replace(step, history={**step.history, **errors})


def refine(case: Problem, solver: Solver, shown: Reporter) -> Outcome:
    """Solve a case on finer and finer lattices, until its accuracy is reached or a limit is.

    Parameters
    ----------
    case : Problem
        The case, with an accuracy to reach.
    solver : Solver
        Solves it.
    shown : Reporter
        Who is told about it.

    Raises
    ------
    DeckError, ConvergenceError, ResourceError
        If a load step cannot be solved on one of the lattices.
    """
    assert case.accuracy is not None
    target = case.accuracy.target
    levels: list[Solution] = []
    copies: list[Solution] = []
    while True:
        trial = Trial(len(levels))
        levels.append(_solved(trial, trial.case(case), solver, shown))
        limit = limit_of(case, levels[-1], solver.in_memory)
        if len(levels) < LEAST_LEVELS:
            if limit:
                raise ResourceError(f"{limit}; errors cannot be told from fewer than {LEAST_LEVELS} lattices")
            continue
        if not limit and not _meets(accuracy.changes(levels[-2], levels[-1], case.load_steps), target):
            continue
        coarse = len(levels) - LEAST_LEVELS
        for copy in range(1, len(SHIFTS) + 1):
            trial = Trial(coarse, copy)
            copies.append(_solved(trial, trial.case(case), solver, shown))
        solutions = [*levels, *copies]
        errors = accuracy.estimated_errors(solutions, case.load_steps)
        relative = accuracy.relative_errors(levels[-1].histories, errors)
        name, error = accuracy.worst(relative)
        log.logger.info(log.words("errors", worst=name, error=error, target=target))
        shown.says(f"estimated error {100 * error:.2g} % ({_words(name)}), target {100 * target:.3g} %")
        if limit or _meets(relative, target):
            return Outcome(solutions, errors, relative, target, limit)


def _solved(trial: Trial, case: Problem, solver: Solver, shown: Reporter) -> Solution:
    lattice = case.lattice
    log.logger.info(log.words("lattice", name=trial.name, spacing=lattice.spacing, nodes=lattice.size))
    shown.lattice(
        f"{trial.name}: spacing {quantity(lattice.spacing, 'm')}, {lattice.size:,} nodes", trial.copy > 0
    )
    return solver.solve(trial, case)


def _meets(relative: Mapping[str, float], target: float) -> bool:
    return all(error <= target for error in relative.values())


def _words(name: str) -> str:
    return name.removesuffix("_fit").replace("_", " ")


def limit_of(case: Problem, last: Solution, in_memory: bool) -> str:
    """Return what keeps the lattice from being refined after a solution; empty if nothing does."""
    from .frictionless import require_memory

    assert case.accuracy is not None
    try:
        finer = Trial(last.level + 1).case(case)
        nodes = max(
            finer.lattice.size, math.ceil(RATIO**2 * last.nodes)
        )  # a window that grew will grow again
        if nodes > case.accuracy.max_nodes:
            return (
                f"the next lattice has about {nodes:,} nodes, more than "
                f"accuracy.max_nodes = {case.accuracy.max_nodes:,}"
            )
        require_memory(finer, finer.lattice, len(case.load_steps) if in_memory else 0)
    except ResourceError as error:
        return str(error)
    return ""


def least_and_most(case: Problem) -> tuple[list[Problem], list[Problem]]:
    """Return a case on all lattices of the shortest refinement, and of the longest that max_nodes allows.

    The last one is the finest.
    """
    assert case.accuracy is not None
    coarse, levels = Trial(0).case(case), [Trial(level).case(case) for level in range(LEAST_LEVELS)]
    least = [coarse] * len(SHIFTS) + levels
    while (finer := Trial(len(levels)).case(case)).lattice.size <= case.accuracy.max_nodes:
        levels.append(finer)
    return least, [*(levels[: 1 - LEAST_LEVELS] * len(SHIFTS)), *levels]


# --- in memory ----------------------------------------------------------------------------------------------


class InMemory(Solver):
    """Keeps the load steps of the finest lattice.

    Parameters
    ----------
    shown : Reporter
        Who is told about each step.
    on_step : callable, optional
        Called with each finished `Step`.
    """

    in_memory = True

    def __init__(self, shown: Reporter, on_step: Callable[[Step], object] | None) -> None:
        self._shown, self._on_step = shown, on_step
        self.steps: list[Step] = []

    def solve(self, trial: Trial, case: Problem) -> Solution:
        """Solve the load history on a lattice."""
        from .run import steps, stops

        if not trial.copy:
            self.steps.clear()
        heads = []
        for step in steps(case, kept_in_memory=not trial.copy):
            heads.append(step.head)
            if not trial.copy:
                self.steps.append(step)
            log.finished(step, len(case.load_steps))
            self._shown.finished(step)
            if stopped := stops(self._on_step, step, more=True):
                raise StopRun(stopped)
        return solution_of(trial, case, heads)


def solution_of(trial: Trial, case: Problem, heads: Sequence[Step]) -> Solution:
    """Return what the load steps on a lattice came to."""
    lattice = case.lattice
    nodes = max(step.lattice.size for step in heads)
    histories = [step.history for step in heads]
    return Solution(trial.level, trial.copy, lattice.spacing, lattice.origin, nodes, histories)


def in_memory(case: Problem, shown: Reporter, on_step: Callable[[Step], object] | None) -> Result:
    """Solve a case until its accuracy is reached or a limit is, and return the result; errors as `refine`."""
    from .run import metadata_of

    solver = InMemory(shown, on_step)
    try:
        outcome = refine(case, solver, shown)
    except StopRun as wanted:  # of the lattice that was under way, without errors
        dataset = assemble(metadata_of(case), solver.steps, complete=False)
        return Result(dataset.assign_attrs(stopped=str(wanted)))
    steps = [outcome.with_errors(step) for step in solver.steps]
    return Result(assemble(outcome.metadata(metadata_of(case)), steps, trials=outcome.trials))
