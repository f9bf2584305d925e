"""Backend that runs the cases of a study in processes of this machine.

Each worker has its own executor, so that a process that dies (mostly out of memory) loses one known case.
Workers block signals; the parent process ends them.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from ...core.memory import cores
from ...errors import DeckError, ResourceError
from ..backend import Backend, arrived, backend
from ..job import Job, Outcome, solve_case

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
        if settings is not None and settings < 1:
            raise DeckError(f"jobs = {settings}: expected at least 1")
        self.workers = min(settings or cores(), cases)
        threads = os.environ.get("OMP_NUM_THREADS", "")
        self.threads = int(threads) if threads.isdecimal() else max(1, cores() // self.workers)
        self._stopped = threading.Event()
        self._outcomes: queue.Queue[Outcome | BaseException] = queue.Queue()
        self._executors: dict[int, ProcessPoolExecutor] = {}
        self._mutex = threading.Lock()
        self._attendants: list[threading.Thread] = []

    def outcomes(self, jobs: Sequence[Job], cancel: threading.Event) -> Iterator[Outcome]:
        """Run the jobs and yield the outcome of each when it ends, until `cancel` is set."""
        from multiprocessing import resource_tracker

        # Started from a thread, the tracker would unblock the signals of that thread.
        resource_tracker.ensure_running()
        waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
        for job in jobs:
            waiting.put(job)
        for number in range(self.workers):
            thread = threading.Thread(target=self._attend, args=(number, waiting), daemon=True)
            self._attendants.append(thread)
            thread.start()
        yield from arrived(self._outcomes, len(jobs), cancel)

    def _attend(self, number: int, waiting: queue.SimpleQueue[Job]) -> None:
        """Run waiting jobs in one worker."""
        signal.pthread_sigmask(signal.SIG_BLOCK, _BLOCKED)  # inherited by the worker
        try:
            while not self._stopped.is_set():
                try:
                    job = waiting.get_nowait()
                except queue.Empty:
                    break
                if (outcome := self._solved(number, job)) is not None:
                    self._outcomes.put(outcome)
        except BaseException as error:
            self._outcomes.put(error)
        finally:
            self._end(number)

    def _solved(self, number: int, job: Job) -> Outcome | None:
        """Return the outcome of a job; None if the pool was stopped."""
        started = time.perf_counter()
        try:
            with self._mutex:
                if self._stopped.is_set():
                    return None
                if number not in self._executors:
                    context, threads = multiprocessing.get_context("spawn"), (self.threads,)
                    pool = ProcessPoolExecutor(1, context, initializer=prepare_worker, initargs=threads)
                    self._executors[number] = pool
                future = self._executors[number].submit(solve_case, job)
            return future.result()
        except BrokenProcessPool:
            self._end(number)
            if self._stopped.is_set():
                return None
            words = "its process died; was it killed, or out of memory?"
            return Outcome(job.hash, ResourceError.exit_code, words, time.perf_counter() - started, False)

    def _end(self, number: int) -> None:
        with self._mutex:
            executor = self._executors.pop(number, None)
        if executor is not None:
            executor.shutdown(wait=True, cancel_futures=True)

    def stop(self) -> None:
        """Kill the workers; finished load steps are on the disk."""
        self._stopped.set()
        with self._mutex:
            for executor in self._executors.values():
                for process in list((executor._processes or {}).values()):
                    process.kill()
        for thread in self._attendants:
            thread.join()
