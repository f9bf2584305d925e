"""Runs the cases of a study on a Dask cluster.

Workers must see the folder of the study under the same name, and have this package. A worker that dies is no
failure: the scheduler gives its case to another one, up to `distributed.scheduler.allowed-failures` times.
"""

from __future__ import annotations

import importlib
import queue
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from ...deck.kinds import Text, Whole, Word
from ...deck.model import Table, meaning
from ...errors import DeckError, ResourceError
from ..backend import Backend, Settings, arrived, backend
from ..job import MOST_CASES, Job, Outcome, solve_case

_CLASSES = {
    "slurm": "SLURMCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "lsf": "LSFCluster",
    "htcondor": "HTCondorCluster",
    "oar": "OARCluster",
    "moab": "MoabCluster",
}


class Dask(Table):
    """Where a Dask cluster is, or how to start one."""

    address: Annotated[str, Text()] | None = meaning(None, "scheduler, such as tcp://host:8786")
    cluster: Annotated[str, Word(("local", *_CLASSES))] | None = meaning(
        None, "start a cluster: local, or one of those of dask-jobqueue"
    )
    workers: Annotated[int, Whole(1, MOST_CASES)] = meaning(1, "workers that `cluster` starts")
    options: Annotated[dict[str, Any], Settings("{ cores = 4 }")] = meaning(
        {}, "arguments of the cluster, such as cores, memory, walltime"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Join a cluster or start one."""
        if ("address" in data) == ("cluster" in data):
            yield "address", "expected either address or cluster"


def _package(name: str, install: str) -> Any:
    # dask-jobqueue takes Ctrl-C for itself when it is imported
    handler = signal.getsignal(signal.SIGINT)
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise DeckError(
            f"a Dask cluster needs the package {install} ({error}); pip install {install}"
        ) from None
    except ValueError as error:
        raise DeckError(
            f"import {name} in the main thread before a study is run in another one ({error})"
        ) from None
    finally:
        if signal.getsignal(signal.SIGINT) is not handler:
            signal.signal(signal.SIGINT, handler)


@backend("dask", Dask | None)
class DaskPool(Backend):
    """Workers of a Dask cluster, to join or to start.

    Raises
    ------
    DeckError
        If Dask is not installed, no scheduler answers, or the cluster refuses its options.
    """

    def __init__(self, settings: Dask, cases: int) -> None:
        where = settings
        distributed = _package("distributed", "distributed")
        self._cluster: Any = None
        if where.cluster is not None:
            self._cluster = _started(where)
        try:
            # not the default client, from which xarray would take its locks, even after it failed
            self._client = distributed.Client(
                self._cluster or where.address, timeout="10s", set_as_default=False
            )
        except (OSError, ValueError, TimeoutError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise DeckError(f"no Dask scheduler answers at {where.address}: {reason}") from None
        self._futures: list[Any] = []

    @staticmethod
    def load(settings: Dask) -> None:
        """Import what a cluster needs; dask-jobqueue cannot be imported in a second thread."""
        _package("distributed", "distributed")
        if settings.cluster not in (None, "local"):
            _package("dask_jobqueue", "dask-jobqueue")

    def outcomes(self, jobs: Sequence[Job], cancel: threading.Event) -> Iterator[Outcome]:
        """Run the jobs; yield each outcome as it comes, until `cancel` is set."""
        came: queue.Queue[Outcome | BaseException] = queue.Queue()
        for job in jobs:
            future = self._client.submit(solve_case, job, apart=True, pure=False)
            self._futures.append(future)
            future.add_done_callback(lambda done, job=job: came.put(_outcome(done, job)))
        yield from arrived(came, len(jobs), cancel)

    def stop(self) -> None:
        """Take back what has not begun, and leave the cluster; end it if it was started here."""
        self._client.cancel(self._futures)
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()


def _started(where: Dask) -> Any:
    options = where.options
    if where.cluster == "local":
        kind = _package("distributed", "distributed").LocalCluster
        options = {"n_workers": where.workers, "threads_per_worker": 1, "dashboard_address": None, **options}
    else:
        kind = getattr(_package("dask_jobqueue", "dask-jobqueue"), _CLASSES[where.cluster or ""])
    try:
        cluster = kind(**options)
        if where.cluster != "local":
            cluster.scale(where.workers)
    except Exception as error:  # each kind of cluster has its own ways to refuse what it does not know
        cause = error.__cause__ or error
        words = f"{type(cause).__name__}: {cause}".splitlines()[0]
        raise DeckError(
            f"dask.cluster = {where.cluster}: cannot be started with these options ({words})"
        ) from None
    return cluster


def _outcome(future: Any, job: Job) -> Outcome:
    """Return what became of a task."""
    if future.status == "finished":
        outcome: Outcome = future.result()
        if not outcome.exit_code and not Path(job.path).exists():
            words = f"a worker has finished it, but {job.path} is not here; do the workers share this folder?"
            return Outcome(job.hash, ResourceError.exit_code, words, outcome.seconds, False)
        return outcome
    error = None if future.status == "cancelled" else future.exception()
    words = f"Dask gave it up: {type(error).__name__}: {error}" if error else "Dask canceled it"
    return Outcome(job.hash, ResourceError.exit_code, words.splitlines()[0], 0.0, False)
