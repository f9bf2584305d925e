"""Studies: cases that differ in some keys of one deck, and their results in one dataset.

Examples
--------
>>> from hexcontact import run_study
>>> dataset = run_study("study_friction.toml")  # doctest: +SKIP
>>> dataset.stick_area_fit.sel(friction_coefficient=0.3)  # doctest: +SKIP
"""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from ..arrays import Dataset
from ..deck.faults import Source
from ..deck.toml import plain, read_toml
from ..errors import DeckError
from ..solve.events import Bar, Lines, Listener, Listeners, Log
from ..text import counted, quantity
from .backend import BACKENDS, Backend, Job, Outcome, outcomes, solve_case
from .backends.dask import Dask, DaskPool
from .backends.processes import LocalPool
from .creep import CreepStudy
from .dataset import STATES, StudyFolder, collect, refuse_foreign, state_of, write
from .plan import CheckLevel, Plan, PlannedCase, StudyFile, base_of, plan


class StudyLines(Lines):
    """One line for each case, for logs and pipes."""

    _count = 0

    def begun(self, title: str, steps: int) -> None:
        """Record the number of cases to run."""
        self.steps = steps

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Print a line on the study, then one for each case with its number in the sequence."""
        if event != "study":
            self._count += 1
            text = f"{self._count:>{len(str(self.steps))}}/{self.steps}  {text}"
        super().said(event, text)


class StudyBar(Bar):
    """A progress bar over the cases, with the latest case below it."""

    def begun(self, title: str, steps: int) -> None:
        """Show the bar, also if no case is missing."""
        super().begun(title, max(steps, 1))

    def _columns(self) -> list[Any]:
        return super()._columns()[1:]

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: Any) -> None:
        """Start the bar at the finished cases, then advance it case by case."""
        if event == "study":
            cases = values["cases"]
            self._bar.reset(self._task, total=cases, completed=cases - values["missing"])
        else:
            super().said(event, text)
            self._bar.update(self._task, advance=1)


def study_reporter(quiet: bool = False) -> Listener:
    """Return the listener for standard error: a bar, lines, or none if `quiet`."""
    if quiet:
        return Listener()
    return StudyBar() if sys.stderr.isatty() else StudyLines(sys.stderr)


__all__ = ["Outcome", "PlannedCase", "Study", "run_study"]


class Study:
    """Cases of one deck with different values of some keys; the constructor checks all of them.

    ``plan`` has cases and parameters, ``output`` is the file of the result. DeckError with a sentence for
    each fault of the study or of a case.

    Parameters
    ----------
    deck : path or mapping
        The base deck, or its tables.
    parameters : mapping or sequence of mappings
        Values by dotted key of the deck: ``{"friction.coefficient": [0.1, 0.2]}``, or
        ``{"load.1.normal_load": {"range": ["1 N", "9 N"], "count": 5, "scale": "log"}}``, with a tuple of
        keys that share one value; or the entries of [[parameter]].
    output : path, optional
        netCDF file of the result; the files of the cases go to a folder beside it with its name.
    name : str
        Name of the study in messages.
    skip_invalid : bool
        Leave out wrong cases, with the status ``invalid`` in the result.
    **keys
        Other keys of a study file: title, combine, samples, seed, steps, dask.
    """

    def __init__(
        self,
        deck: str | Path | Mapping[str, Any],
        parameters: Mapping[Any, Any] | Sequence[Mapping[str, Any]],
        *,
        output: str | Path | None = None,
        name: str = "study",
        skip_invalid: bool = False,
        **keys: Any,
    ) -> None:
        if isinstance(parameters, Mapping):
            parameters = [
                {"key": key, **(values if isinstance(values, Mapping) else {"values": plain(values)})}
                for key, values in parameters.items()
            ]
        named = "deck" if isinstance(deck, Mapping) else str(deck)
        data = {**keys, "parameter": list(parameters), "deck": named}
        self.file, self.name = StudyFile.parse(data, Source()), name
        self.output = Path(output or self.file.output or "study.nc")
        self._build(deck, "windows", skip_invalid)

    @classmethod
    def from_toml(
        cls,
        path: str | Path,
        output: str | Path | None = None,
        check: bool | CheckLevel = True,
        skip_invalid: bool = False,
    ) -> Self:
        """Read a study file; DeckError with a sentence for each fault of the study, its deck or a case.

        Parameters
        ----------
        path, output : path
            The study file, and the file of the result; default: that of the study file, else its name with
            .nc in this folder.
        check : bool or str
            Check every case, its window by a coarse solution; ``"decks"``: without the windows.
        skip_invalid : bool
            Leave out wrong cases, with the status ``invalid`` in the result.
        """
        study = cls.__new__(cls)
        study.file, study.name = StudyFile.read(path), str(path)
        if study.file.creep_table is not None:
            raise DeckError(f"{path} is a creep table; hexcontact study {path} or run_study computes it")
        study.output = Path(output or study.file.output or f"{Path(path).stem}.nc")
        level: CheckLevel = check if isinstance(check, str) else "windows" if check else "nothing"
        study._build(Path(path).parent / study.file.deck, level, skip_invalid)
        return study

    def _build(self, deck: str | Path | Mapping[str, Any], check: CheckLevel, skip_invalid: bool) -> None:
        """Build and check the cases, and open the folder of the study."""
        self.plan: Plan = plan(self.file, base_of(deck), self.name, check, skip_invalid)
        self.folder = StudyFolder(self.output)
        self.folder.assign(self.plan)

    @property
    def title(self) -> str:
        """Title of the study."""
        return self.file.title or Path(self.name).stem

    @property
    def cases(self) -> tuple[PlannedCase, ...]:
        """All cases."""
        return self.plan.cases

    def __len__(self) -> int:
        return len(self.plan.cases)

    def states(self) -> list[str]:
        """Return the state of each case, done, failed, missing or invalid; nothing is written."""
        return [STATES[state_of(self.folder, case)[0]] for case in self.cases]

    def missing(self, retry: bool = False) -> list[PlannedCase]:
        """Return the cases that `run` would solve; with `retry` also those that would fail again."""
        self.folder.enter(self.plan)
        return self.folder.missing(self.cases, retry)

    @property
    def invalid(self) -> list[PlannedCase]:
        """The wrong cases, which are left out; their `fault` is the reason."""
        return [case for case in self.cases if case.fault]

    def failures(self) -> list[tuple[PlannedCase, Outcome]]:
        """Return the failed cases, each with its outcome."""
        unfinished = [case for case in self.cases if not (case.fault or self.folder.done(case))]
        return [(case, found) for case in unfinished if (found := self.folder.failure(case)) is not None]

    def run(
        self,
        jobs: int | None = None,
        dask: str | None = None,
        retry: bool = False,
        listener: Listener | None = None,
        cancel: threading.Event | None = None,
    ) -> Dataset:
        """Run the missing cases, write the result to `output` and return it.

        In a script this belongs under ``if __name__ == "__main__":``, since it starts processes. DeckError if
        another run holds the study, the output is another file, or Dask is not installed; ResourceError if
        the result cannot be written.

        Parameters
        ----------
        jobs : int, optional
            Number of processes on this machine; default: one for each core.
        dask : str, optional
            Address of a Dask scheduler to run the cases on instead.
        retry : bool
            Also run cases again that did not converge or outgrew their window.
        listener : Listener, optional
            Receives the progress, besides the log.
        cancel : threading.Event, optional
            Set by another thread, it ends the run; finished cases stay, and their result is not written.
        """
        listener, cancel = Listeners(Log(), listener or Listener()), cancel or threading.Event()
        refuse_foreign(self.output)
        lock = self.folder.lock()
        try:
            missing = self.missing(retry)
            kind, settings = self.backend(jobs, dask)
            pool = kind(settings, len(missing)) if missing else None
            with listener.following(self.title, len(missing)):
                cases = counted(len(self), "case")
                to_run = "" if len(missing) == len(self) else f", {len(missing)} to run"
                values: dict[str, Any] = {"title": self.title, "cases": len(self), "missing": len(missing)}
                listener.said("study", f"{self.title}: {cases}{to_run}", **values, output=self.output)
                if pool is not None:
                    self._work(pool, missing, listener, cancel)
            return self._combined() if cancel.is_set() else self.collect()
        finally:
            lock.release()

    def _work(
        self, pool: Backend, missing: Sequence[PlannedCase], listener: Listener, cancel: threading.Event
    ) -> None:
        by_hash = {case.hash: case for case in missing}
        with pool:
            for outcome in outcomes(pool, [self._job(case) for case in missing], cancel):
                case, level = by_hash[outcome.hash], logging.INFO
                self.folder.note(case, outcome)
                number = self.folder.number(case)
                values: dict[str, Any] = {"parameters": str(case), "seconds": outcome.seconds}
                ending = f"done in {quantity(outcome.seconds, 's', 3)}"
                if outcome.exit_code:
                    level, ending = logging.ERROR, f"failed: {outcome.message.splitlines()[0]}"
                    values |= {"exit_code": outcome.exit_code, "reason": outcome.message}
                text = f"case {number} ({case}): {ending}"
                listener.said(f"case={number}/{len(self)}", text, level, **values)

    def _job(self, case: PlannedCase) -> Job:
        return Job(case.hash, case.deck, os.path.realpath(self.folder.path(case)))

    def backend(self, jobs: int | None = None, dask: str | None = None) -> tuple[type[Backend], Any]:
        """Return the backend that `run` would use, and its settings."""
        if dask:
            return DaskPool, Dask(address=dask)
        for word, kind in BACKENDS.items():
            settings = getattr(self.file, word, None)
            if jobs is None and settings is not None and issubclass(kind, Backend):
                return kind, settings
        return LocalPool, jobs

    def run_case(self, number: int, retry: bool = False, listener: Listener | None = None) -> Outcome:
        """Run a case by its number in this process unless it is done, for job arrays; return its outcome.

        With `retry` it runs also if it would fail again; the listener receives the progress, besides the log.
        """
        known = {self.folder.number(case): case for case in self.cases}
        if number not in known:
            raise DeckError(f"case {number}: expected a number of a case from 1 to {max(known)}")
        case = known[number]
        self.folder.enter(self.plan)
        if not self.folder.missing([case], retry):
            return self.folder.failure(case) or Outcome(case.hash)
        outcome = solve_case(self._job(case), listener=listener)
        self.folder.note(case, outcome)
        return outcome

    def has(self, number: int) -> bool:
        """Return whether the result of a case exists."""
        return any(self.folder.number(case) == number and self.folder.done(case) for case in self.cases)

    def collect(self) -> Dataset:
        """Combine the finished cases, write the result to `output`, and return it.

        DeckError or ResourceError if it cannot be written.
        """
        dataset = self._combined()
        write(dataset, self.output, self.title, self.file)
        return dataset

    def _combined(self) -> Dataset:
        """Return the data set of the finished cases."""
        self.folder.enter(self.plan)
        return collect(self.plan, self.folder, self.file)

    def __repr__(self) -> str:
        """Name the study, its parameters and the number of its cases."""
        axes = ", ".join(key for axis in self.plan.axes for key in axis.keys)
        cases = counted(len(self), "case")
        return f"Study({self.title!r}, {self.file.combine} over {axes}: {cases}, {self.output})"


def run_study(path: str | Path, output: str | Path | None = None, **options: Any) -> Dataset:
    """Read a study file and run its missing cases, options as of `Study.run`; or compute its creep table."""
    if "creep_table" in read_toml(path, "a study")[0]:
        return CreepStudy.from_toml(path, output).run(**options)
    return Study.from_toml(path, output).run(**options)
