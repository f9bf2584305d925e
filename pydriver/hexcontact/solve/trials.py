"""Refinement of a lattice with everything on the disk: finished lattices and load steps survive the run."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from ..errors import DeckError, StopRun
from ..result.result import Step
from ..result.trials import TrialFolder
from . import log
from .lattices import Outcome, Solver, Trial, refine, solution_of
from .progress import Reporter

if TYPE_CHECKING:
    from ..problem.problem import Problem
    from ..result.journal import Journal
    from ..result.store import Store
    from ..result.trials import Solution

_SAME = 1e-12  # relative difference of spacings that are the same


class OnDisk(Solver):
    """Keeps every finished load step in the journal of an output, and finds them again.

    Parameters
    ----------
    store : Store
        The output.
    shown : Reporter
        Who is told about each step.
    on_step : callable, optional
        Called with each finished `Step`, when it is safe.
    """

    def __init__(self, store: Store, shown: Reporter, on_step: Callable[[Step], object] | None) -> None:
        self._store, self._shown, self._on_step = store, shown, on_step
        self._trials = TrialFolder(store.folder)
        self._solutions = self._trials.read()[1] if self._trials else []
        with store.writing("the journal"):
            self._trials.write(store.metadata, self._solutions)

    def solve(self, trial: Trial, case: Problem) -> Solution:
        """Solve the load history on a lattice, or what is missing of it."""
        for solution in self._solutions:
            if (solution.level, solution.copy) == (trial.level, trial.copy):
                if abs(solution.spacing - case.lattice.spacing) > _SAME * solution.spacing:
                    raise DeckError(
                        f"the deck now leads to other lattices than those finished for {self._store.path}"
                    )
                return solution
        solution = self._solved(trial, case)
        self._solutions.append(solution)
        with self._store.writing(f"{trial.name}"):
            self._trials.write(self._store.metadata, self._solutions)
            if trial.copy:
                self._trials.drop(trial.level, trial.copy)
            elif trial.level:
                self._trials.drop(trial.level - 1)
        return solution

    def _solved(self, trial: Trial, case: Problem) -> Solution:
        from .run import steps, stops

        with self._opened(trial) as (store, last):
            if last is not None:
                from .restart import check_step

                check_step(
                    case, last, f"{len(store.heads)} finished steps on {trial.name} of {self._store.path}"
                )
            for step in steps(case, before=[*store.heads[:-1], last] if last is not None else ()):
                store.append(step)
                log.finished(step, len(case.load_steps))
                self._shown.finished(step)
                if stopped := stops(self._on_step, step, more=True):
                    raise StopRun(stopped)
            return solution_of(trial, case, store.heads)

    @contextlib.contextmanager
    def _opened(self, trial: Trial) -> Iterator[tuple[Store, Step | None]]:
        """Open the journal of a lattice; yield its last finished step, too."""
        from ..result.journal import Journal, journal_of
        from ..result.store import Store

        path, last = self._trials.path(trial.level, trial.copy), None
        if Journal(journal_of(path)):
            store, last = Store.reopened(path)
            self._trials.check(self._store.metadata, store.metadata)
        else:
            store = Store(path, self._store.metadata, overwrite=True)
        store.interim = False
        try:
            yield store, last
        finally:
            store.close()

    def finish(self, outcome: Outcome) -> None:
        """Put the output in its place and clear the journal away."""
        from ..result.journal import Journal, journal_of
        from .accuracy import finest

        best = finest(outcome.solutions)
        journal = Journal(journal_of(self._trials.path(best.level)))
        self._store.finish_with(
            outcome.metadata(self._store.metadata), _WithErrors(journal, outcome), outcome.trials
        )


class _WithErrors:
    """The load steps of a journal with their errors."""

    def __init__(self, journal: Journal, outcome: Outcome) -> None:
        self._journal, self._outcome = journal, outcome

    def __iter__(self) -> Iterator[Step]:
        return map(self._outcome.with_errors, self._journal)


def record(
    case: Problem, store: Store, shown: Reporter, on_step: Callable[[Step], object] | None = None
) -> None:
    """Solve a case into a store until its accuracy is reached, or a limit; errors as `hexcontact.solve.run`.

    Parameters
    ----------
    case : Problem
        The case, with an accuracy to reach.
    store : Store
        Where the result goes; what it has already of the case is not solved again.
    shown : Reporter
        Who is told about it.
    on_step : callable, optional
        Called with each finished `Step`, when it is safe.
    """
    solver = OnDisk(store, shown, on_step)
    try:
        solver.finish(refine(case, solver, shown))
    except StopRun as wanted:
        log.logger.warning(log.words("stopped", reason=str(wanted)))
        store.close(str(wanted))
        return
    log.logger.info(log.words("written", file=store.path))
