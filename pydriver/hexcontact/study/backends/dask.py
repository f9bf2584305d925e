"""Backend that runs the cases of a study on a Dask cluster.

Workers need this package, and the folder of the study under the same name. If a worker dies, the scheduler
assigns its case to another worker, up to `distributed.scheduler.allowed-failures` times.
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
from ..backend import Backend, OptionTable, arrived, backend
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
    """A Dask cluster to join, or to start."""

    address: Annotated[str, Text()] | None = meaning(None, "address of a scheduler", '"tcp://host:8786"')
    cluster: Annotated[str, Word(("local", *_CLASSES))] | None = meaning(
        None, "start a cluster: local, or one of those of dask-jobqueue"
    )
    workers: Annotated[int, Whole(1, MOST_CASES)] = meaning(1, "workers that `cluster` starts")
    options: Annotated[dict[str, Any], OptionTable("{ cores = 4 }")] = meaning(
        {}, "arguments of the cluster, such as cores, memory, walltime"
    )

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Require either an address or a cluster to start."""
        if ("address" in data) == ("cluster" in data):
            yield "address", "expected either address or cluster"


def _package(name: str, install: str) -> Any:
    # The import of dask-jobqueue installs a handler of SIGINT.
    handler = signal.getsignal(signal.SIGINT)
    try:
        return importlib.import_module(name)
    except ImportError as error:
        problem = f"a Dask cluster needs the package {install} ({error}); pip install {install}"
    except ValueError as error:
        problem = f"import {name} in the main thread before a study is run in another one ({error})"
    finally:
        if signal.getsignal(signal.SIGINT) is not handler:
            signal.signal(signal.SIGINT, handler)
    raise DeckError(problem)


@backend("dask", Dask | None)
class DaskPool(Backend):
    """Run cases on the workers of a Dask cluster that is joined or started."""

    def __init__(self, settings: Dask, cases: int) -> None:
        distributed = _package("distributed", "distributed")
        self._cluster = None if settings.cluster is None else _started(settings)
        try:
            # Not the default client, from which xarray would take its locks, even after it failed.
            address = self._cluster or settings.address
            self._client = distributed.Client(address, timeout="10s", set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise DeckError(f"no Dask scheduler answers at {settings.address}: {reason}") from None
        self._futures: list[Any] = []

    @staticmethod
    def load(settings: Dask) -> None:
        """Import the packages that a cluster needs; dask-jobqueue cannot be imported in a second thread."""
        _package("distributed", "distributed")
        if settings.cluster not in (None, "local"):
            _package("dask_jobqueue", "dask-jobqueue")

    def outcomes(self, jobs: Sequence[Job], cancel: threading.Event) -> Iterator[Outcome]:
        """Run the jobs and yield the outcome of each when it ends, until `cancel` is set."""
        outcomes: queue.Queue[Outcome | BaseException] = queue.Queue()
        for job in jobs:
            future = self._client.submit(solve_case, job, apart=True, pure=False)
            self._futures.append(future)
            future.add_done_callback(lambda done, job=job: outcomes.put(_outcome(done, job)))
        yield from arrived(outcomes, len(jobs), cancel)

    def stop(self) -> None:
        """Cancel jobs that have not begun, and leave the cluster; end it if it was started here."""
        self._client.cancel(self._futures)
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()


def _started(settings: Dask) -> Any:
    options = settings.options
    if settings.cluster == "local":
        kind = _package("distributed", "distributed").LocalCluster
        default = {"n_workers": settings.workers, "threads_per_worker": 1, "dashboard_address": None}
        options = default | options
    else:
        kind = getattr(_package("dask_jobqueue", "dask-jobqueue"), _CLASSES[settings.cluster or ""])
    try:
        cluster = kind(**options)
        if settings.cluster != "local":
            cluster.scale(settings.workers)
    except Exception as error:  # of a type that depends on the kind of cluster
        cause = error.__cause__ or error
        words = f"{type(cause).__name__}: {cause}".splitlines()[0]
        raise DeckError(
            f"dask.cluster = {settings.cluster}: cannot be started with these options ({words})"
        ) from None
    return cluster


def _outcome(future: Any, job: Job) -> Outcome:
    """Return the outcome of a task."""
    if future.status == "finished":
        outcome: Outcome = future.result()
        if not outcome.exit_code and not Path(job.path).exists():
            words = f"a worker has finished it, but {job.path} is not here; do the workers share this folder?"
            return Outcome(job.hash, ResourceError.exit_code, words, outcome.seconds, False)
        return outcome
    error = None if future.status == "cancelled" else future.exception()
    words = f"Dask gave it up: {type(error).__name__}: {error}" if error else "Dask canceled it"
    return Outcome(job.hash, ResourceError.exit_code, words.splitlines()[0], 0.0, False)
