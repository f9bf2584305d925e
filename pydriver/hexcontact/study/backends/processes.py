"""Runs the cases of a study in processes of this machine.

Each worker has an executor of its own: a process that dies (out of memory, most often) takes only its own
case with it, and that case is known. Workers heed no signals: the one who started them ends them.
"""

from __future__ import annotations

import os
import queue
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from ...errors import DeckError, ResourceError
from ..backend import Backend, arrived, backend
from ..job import Job, Outcome, solve_case

_BLOCKED = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)


def prepare_worker(threads: int) -> None:
    """Set a worker process up, before it loads the compiled core."""
    import multiprocessing

    os.environ["OMP_NUM_THREADS"] = str(threads)
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    parent = multiprocessing.parent_process()

    def follow() -> None:
        assert parent is not None
        parent.join()  # returns only when the study was killed
        os._exit(1)

    if parent is not None:
        threading.Thread(target=follow, daemon=True).start()


def cores() -> int:
    """Return the number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@backend("processes")
class LocalPool(Backend):
    """Worker processes on this machine; settings: how many cases at a time, None for one for each core."""

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
        """Run the jobs; yield each outcome as it comes."""
        from multiprocessing import resource_tracker

        # Started from a thread it would undo the blocking of signals there.
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
        """Give one worker after the other job."""
        signal.pthread_sigmask(signal.SIG_BLOCK, _BLOCKED)  # which the worker inherits
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
        """Have a job done; None if it was stopped."""
        started = time.perf_counter()
        try:
            with self._mutex:
                if self._stopped.is_set():
                    return None
                if number not in self._executors:
                    self._executors[number] = self._executor()
                future = self._executors[number].submit(solve_case, job)
            return future.result()
        except BrokenProcessPool:
            self._end(number)
            if self._stopped.is_set():
                return None
            words = "its process died; was it killed, or out of memory?"
            return Outcome(job.hash, ResourceError.exit_code, words, time.perf_counter() - started, False)

    def _executor(self) -> ProcessPoolExecutor:
        import multiprocessing

        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(1, context, initializer=prepare_worker, initargs=(self.threads,))

    def _end(self, number: int) -> None:
        with self._mutex:
            executor = self._executors.pop(number, None)
        if executor is not None:
            executor.shutdown(wait=True, cancel_futures=True)

    def stop(self) -> None:
        """End the workers, whatever they are doing; what they have finished is on the disk."""
        self._stopped.set()
        with self._mutex:
            for executor in self._executors.values():
                for process in list((executor._processes or {}).values()):
                    process.kill()
        for thread in self._attendants:
            thread.join()
