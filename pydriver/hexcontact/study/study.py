"""Studies: many cases that differ in a few keys of one deck, and one data set of what came of them.

Examples
--------
>>> from hexcontact.study import Study, run_study
>>> dataset = run_study("study_friction.toml")  # doctest: +SKIP
>>> dataset.stick_area_fit.sel(friction_coefficient=0.3)  # doctest: +SKIP
"""

from __future__ import annotations

import json
import logging
import os
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from .._version import __version__
from ..deck.faults import Source, deck_error
from ..deck.read import assemble
from ..deck.toml import read_toml
from ..errors import DeckError
from ..solve.events import Listener, Listeners
from ..solve.log import Log
from ..text import quantity
from .backend import BACKENDS, Backend
from .backends.dask import Dask, DaskPool
from .backends.processes import LocalPool
from .collect import STUDY_VERSION, collect, refuse_foreign, write
from .folder import StudyFolder
from .job import Job, Outcome, solve_case
from .plan import Plan, PlannedCase, plan
from .tables import StudyFile

if TYPE_CHECKING:
    import xarray

__all__ = ["Outcome", "PlannedCase", "Study", "run_study"]


class Study:
    """Many cases of one deck; all of them are checked here.

    Parameters
    ----------
    deck : path or mapping
        The base deck, or its tables.
    parameters : mapping or sequence of mappings
        Values by dotted key of the deck: ``{"friction.coefficient": [0.1, 0.2]}``, or
        ``{"load.1.normal_load": {"range": ["1 N", "9 N"], "count": 5, "scale": "log"}}``; or the entries of
        [[parameter]].
    output : path, optional
        netCDF file of the result; the files of the cases go to a folder beside it with its name.
    name : str
        What messages call the study.
    **keys
        Other keys of a study file: title, combine, samples, seed, steps, dask.

    Attributes
    ----------
    plan : Plan
        Its cases and parameters.
    output : Path
        File of the result.

    Raises
    ------
    DeckError
        With a sentence for each thing that is wrong with the study or one of its cases.
    """

    def __init__(
        self,
        deck: str | Path | Mapping[str, Any],
        parameters: Mapping[str, Any] | Sequence[Mapping[str, Any]],
        *,
        output: str | Path | None = None,
        name: str = "study",
        **keys: Any,
    ) -> None:
        from ..deck.write import plain

        if isinstance(parameters, Mapping):
            parameters = [
                {"key": key, **(values if isinstance(values, Mapping) else {"values": plain(values)})}
                for key, values in parameters.items()
            ]
        given = isinstance(deck, Mapping)
        data = {**keys, "parameter": list(parameters), "deck": "deck" if given else str(deck)}
        file = StudyFile.parse(data, Source())
        base, text = (dict(deck), "") if isinstance(deck, Mapping) else read_toml(deck)
        self._set_up(
            file, base, Source("" if given else str(deck), text), name, output or file.output or "study.nc"
        )

    @classmethod
    def from_toml(cls, path: str | Path, output: str | Path | None = None, check: bool = True) -> Self:
        """Read a study file.

        Parameters
        ----------
        path : path
            The study file.
        output : path, optional
            File of the result; default: what the study file says, else its name with .nc in this folder.
        check : bool
            Build every case, to see whether all are right.

        Raises
        ------
        DeckError
            With a sentence for each thing that is wrong with it, its deck or one of its cases.
        """
        data, text = read_toml(path)
        file = StudyFile.parse(data, Source(str(path), text))
        deck = Path(path).parent / file.deck
        base, deck_text = read_toml(deck)
        study = cls.__new__(cls)
        target = output or file.output or f"{Path(path).stem}.nc"
        study._set_up(file, base, Source(str(deck), deck_text), str(path), target, check)
        return study

    def _set_up(
        self,
        file: StudyFile,
        base: Mapping[str, Any],
        source: Source,
        name: str,
        output: str | Path,
        check: bool = True,
    ) -> None:
        self.file, self.name = file, name
        # what the deck includes, and the rows of its series, are part of every case
        whole = assemble(base, source.text, source, Path(source.name).parent)
        if whole.problems:
            raise deck_error(whole.problems, whole.source)
        self.plan: Plan = plan(file, whole.data, whole.source, name, check)
        self.output = Path(output)
        self.folder = StudyFolder(self.output)

    @property
    def title(self) -> str:
        """A line about the study."""
        return self.file.title or Path(self.name).stem

    @property
    def cases(self) -> tuple[PlannedCase, ...]:
        """All cases."""
        return self.plan.cases

    def __len__(self) -> int:
        return len(self.plan.cases)

    def missing(self, retry: bool = False) -> list[PlannedCase]:
        """Return the cases that a run would run; those that failed by themselves only to `retry`."""
        self.folder.enter(self.plan)
        return self.folder.missing(self.cases, retry)

    def failures(self) -> list[tuple[PlannedCase, Outcome]]:
        """Return the cases that have failed, each with its outcome."""
        pairs = [(case, self.folder.failure(case)) for case in self.cases if not self.folder.done(case)]
        return [(case, outcome) for case, outcome in pairs if outcome is not None]

    def run(
        self,
        jobs: int | None = None,
        dask: str | None = None,
        retry: bool = False,
        listener: Listener | None = None,
        cancel: threading.Event | None = None,
    ) -> xarray.Dataset | None:
        """Run the cases that are missing and put all together.

        In a script this belongs under ``if __name__ == "__main__":``, as all that starts processes.

        Parameters
        ----------
        jobs : int, optional
            Cases at a time in processes of this machine; default: one for each core.
        dask : str, optional
            Address of a Dask scheduler to run them on instead.
        retry : bool
            Run cases again that did not converge, or outgrew their window.
        listener : Listener, optional
            Follows the study, besides the log.
        cancel : threading.Event, optional
            Set by another thread, it ends the run; finished cases are kept.

        Returns
        -------
        xarray.Dataset or None
            The result, also written to `output`; None if it was canceled.

        Raises
        ------
        DeckError
            If another run is at this study, the output is in the way, or there is no Dask.
        ResourceError
            If the result cannot be written.
        """
        listener, cancel = Listeners(Log(), listener or Listener()), cancel or threading.Event()
        refuse_foreign(self.output)
        lock = self.folder.lock()
        try:
            missing = self.missing(retry)
            kind, settings = self.backend(jobs, dask)
            pool = kind(settings, len(missing)) if missing else None
            with listener.following(self.title, len(missing)):
                cases = f"{len(self)} case{'s' * (len(self) != 1)}"
                to_run = "" if len(missing) == len(self) else f", {len(missing)} to run"
                about: dict[str, Any] = {
                    "title": self.title,
                    "cases": len(self),
                    "missing": len(missing),
                    "output": self.output,
                }
                listener.said("study", f"{self.title}: {cases}{to_run}", **about)
                if pool is not None:
                    self._work(pool, missing, listener, cancel)
            return None if cancel.is_set() else self.collect()
        finally:
            lock.release()

    def _work(
        self, pool: Backend, missing: Sequence[PlannedCase], listener: Listener, cancel: threading.Event
    ) -> None:
        by_hash = {case.hash: case for case in missing}
        try:
            for outcome in pool.outcomes([self._job(case) for case in missing], cancel):
                case = by_hash[outcome.hash]
                self.folder.note(case, outcome)
                self._say(case, outcome, listener)
        finally:
            pool.stop()

    def _job(self, case: PlannedCase) -> Job:
        return Job(case.hash, case.deck, os.path.realpath(self.folder.path(case)))

    def _say(self, case: PlannedCase, outcome: Outcome, listener: Listener) -> None:
        """Say how a case ended."""
        number, level = self.folder.number(case), logging.INFO
        values: dict[str, Any] = {"parameters": str(case), "seconds": outcome.seconds}
        ending = f"done in {quantity(outcome.seconds, 's', 3)}"
        if outcome.exit_code:
            level, ending = logging.ERROR, f"failed: {outcome.message.splitlines()[0]}"
            values |= {"exit_code": outcome.exit_code, "reason": outcome.message}
        listener.said(f"case={number}/{len(self)}", f"case {number} ({case}): {ending}", level, **values)

    def backend(self, jobs: int | None = None, dask: str | None = None) -> tuple[type[Backend], Any]:
        """Return what `run` would run cases with, and its settings."""
        if dask:
            return DaskPool, Dask(address=dask)
        for word, kind in BACKENDS.items():
            settings = getattr(self.file, word, None)
            if jobs is None and settings is not None and issubclass(kind, Backend):
                return kind, settings
        return LocalPool, jobs

    def run_case(self, number: int, retry: bool = False, listener: Listener | None = None) -> Outcome:
        """Run one case here, unless it is done; for job arrays.

        Parameters
        ----------
        number : int
            Number of the case, as in the names of the files.
        retry : bool
            Also if it failed by itself before.
        listener : Listener, optional
            Follows the run, besides the log.

        Returns
        -------
        Outcome
            Of this run, or of the one before.
        """
        missing = {self.folder.number(case): case for case in self.missing(retry)}
        known = {self.folder.number(case): case for case in self.cases}
        if number not in known:
            raise DeckError(f"case {number}: expected a number of a case from 1 to {max(known)}")
        case = known[number]
        if number not in missing:
            return self.folder.failure(case) or Outcome(case.hash)
        outcome = solve_case(self._job(case), listener=listener)
        self.folder.note(case, outcome)
        return outcome

    def has(self, number: int) -> bool:
        """Tell whether the result of a case is in place."""
        return any(self.folder.number(case) == number and self.folder.done(case) for case in self.cases)

    def collect(self) -> xarray.Dataset:
        """Put together what is there, write it to `output`, and return it.

        Raises
        ------
        DeckError, ResourceError
            If it cannot be written.
        """
        self.folder.enter(self.plan)
        attributes = {
            "title": self.title,
            "source": f"hexcontact {__version__}",
            "hexcontact_version": __version__,
            "study_version": STUDY_VERSION,
            "combine": self.file.combine,
            "study": json.dumps(self.file.model_dump(mode="json", exclude_defaults=True), default=str),
        }
        dataset = collect(self.plan, self.folder, self.file.combine, self.file.steps, attributes)
        write(dataset, self.output)
        return dataset

    def __repr__(self) -> str:
        """Name the study, its parameters and the number of its cases."""
        axes = ", ".join(axis.key for axis in self.plan.axes)
        return f"Study({self.title!r}, {self.file.combine} over {axes}: {len(self)} cases, {self.output})"


def run_study(path: str | Path, output: str | Path | None = None, **options: Any) -> xarray.Dataset | None:
    """Read a study file and run what is missing of it; options as of `Study.run`."""
    return Study.from_toml(path, output).run(**options)
