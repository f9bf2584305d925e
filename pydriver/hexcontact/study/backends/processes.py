"""Backend that runs the cases of a study in processes of this machine.

Each thread has one process, so that a process that dies (mostly out of memory) loses one known case.
Processes block signals; the parent ends them.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from ...core.cores import cores
from ...errors import DeckError, ResourceError
from ..backend import Backend, Job, Outcome, backend

_BLOCKED = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)


def prepare_worker(threads: int) -> None:
    """Set up a worker process before it loads the compiled core."""
    os.environ["OMP_NUM_THREADS"] = str(threads)
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    parent = multiprocessing.parent_process()

    def follow() -> None:
        assert parent is not None
        parent.join()  # returns only if the parent was killed
        os._exit(1)

    if parent is not None:
        threading.Thread(target=follow, daemon=True).start()


@backend("processes")
class LocalPool(Backend):
    """Worker processes on this machine; settings: their number, None for one for each core."""

    def __init__(self, settings: int | None, cases: int) -> None:
        from multiprocessing import resource_tracker

        if settings is not None and settings < 1:
            raise DeckError(f"jobs = {settings}: expected at least 1")
        self.workers = min(settings or cores(), cases)
        threads = os.environ.get("OMP_NUM_THREADS", "")
        self.threads = int(threads) if threads.isdecimal() else max(1, cores() // self.workers)
        # Started from a thread, the tracker would unblock the signals of that thread.
        resource_tracker.ensure_running()
        # The processes inherit the signals that their threads block.
        blocked = (signal.SIG_BLOCK, _BLOCKED)
        self._attendants = ThreadPoolExecutor(
            self.workers, initializer=signal.pthread_sigmask, initargs=blocked
        )
        self._own = threading.local()
        self._processes: list[ProcessPoolExecutor] = []
        self._busy: set[int] = set()
        self._mutex, self._stopped = threading.Lock(), False

    def submit(self, work: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        """Run a job as soon as a process is free."""
        return self._attendants.submit(self._solved, work, *args, **options)

    def _solved(self, work: Callable[..., Outcome], job: Job, *more: Any) -> Outcome:
        """Run a job in the process of this thread."""
        started, process = time.perf_counter(), 0
        try:
            if not hasattr(self._own, "pool"):
                context = multiprocessing.get_context("spawn")
                self._own.pool = ProcessPoolExecutor(
                    1, context, initializer=prepare_worker, initargs=(self.threads,)
                )
                self._processes.append(self._own.pool)
            process = self._own.pool.submit(os.getpid).result()
            with self._mutex:
                if self._stopped:
                    raise CancelledError
                self._busy.add(process)
            outcome: Outcome = self._own.pool.submit(work, job, *more).result()
            return outcome
        except BrokenProcessPool:
            del self._own.pool
            words = "its process died; was it killed, or out of memory?"
            return Outcome(job.hash, ResourceError.exit_code, words, time.perf_counter() - started, False)
        finally:
            self._busy.discard(process)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Kill the processes that run a case; finished load steps are on the disk."""
        with self._mutex:
            self._stopped = True
        for child in multiprocessing.active_children():
            if child.pid in self._busy:
                child.kill()
        self._attendants.shutdown(wait=True, cancel_futures=True)
        for pool in self._processes:
            pool.shutdown(wait=True, cancel_futures=True)
