"""Backend that runs the cases of a study on a Dask cluster.

Workers need this package, and the folder of the study under the same name. If a worker dies, the scheduler
assigns its case to another worker, up to `distributed.scheduler.allowed-failures` times.
"""

from __future__ import annotations

import importlib
import signal
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import Annotated, Any

from ...deck.kinds import Text, Whole, Word
from ...deck.table_base import Table, meaning
from ...errors import DeckError, ResourceError
from ..backend import MOST_CASES, Backend, Job, OptionTable, Outcome, backend

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

    apart = True

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
        # A task of which a worker has died is repeated: the result of a pure one would be remembered.
        self._executor = self._client.get_executor(pure=False)

    @staticmethod
    def load(settings: Dask) -> None:
        """Import the packages that a cluster needs; dask-jobqueue cannot be imported in a second thread."""
        _package("distributed", "distributed")
        if settings.cluster not in (None, "local"):
            _package("dask_jobqueue", "dask-jobqueue")

    def submit(self, work: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        """Run a job on a worker that is free."""
        future: Future[Any] = self._executor.submit(work, *args, **options)
        return future

    def outcome(self, future: Future[Outcome], job: Job) -> Outcome:
        """Return the outcome of a task, also of one that Dask has given up."""
        try:
            outcome = future.result()
        except CancelledError:
            words, seconds = "Dask canceled it", 0.0
        except Exception as error:  # of a type that depends on what has happened to the worker
            words, seconds = f"Dask gave it up: {type(error).__name__}: {error}".splitlines()[0], 0.0
        else:
            if outcome.exit_code or Path(job.path).exists():
                return outcome
            words = f"a worker has finished it, but {job.path} is not here; do the workers share this folder?"
            seconds = outcome.seconds
        return Outcome(job.hash, ResourceError.exit_code, words, seconds, False)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Cancel jobs that have not begun, and leave the cluster; end it if it was started here."""
        self._executor.shutdown(wait=False)
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
