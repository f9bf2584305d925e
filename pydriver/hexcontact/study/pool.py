"""Runs the cases of a study in processes of this machine.

Each worker has an executor of its own: a process that dies (out of memory, most often) takes only its own
case with it, and that case is known. Workers heed no signals: the one who started them ends them.
"""

from __future__ import annotations

import contextlib
import os
import queue
import shutil
import signal
import threading
import time
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import HexcontactError, ResourceError
from .folder import Outcome

if TYPE_CHECKING:
    from ..case import Case
    from ..result.step import Step
    from ..solve.events import Listener
    from ..solve.restart import Restart

_POLL = 0.2  # s between looks at whether to stop
_BLOCKED = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)


@dataclass(frozen=True)
class Job:
    """A case to be run: its hash, its deck, where its file goes."""

    hash: str
    deck: str
    path: str


def solve_case(job: Job, apart: bool = False, listener: Listener | None = None) -> Outcome:
    """Run one case into its file.

    Parameters
    ----------
    job : Job
        The case.
    apart : bool
        Write under a name of this attempt's own first, for when another attempt may still be under way.
    listener : Listener, optional
        Follows the run, besides the log.

    Returns
    -------
    Outcome
        Failures are told, not raised.
    """
    from ..case import Case
    from ..result.store import Store
    from ..solve.run import listeners, metadata_of, run_into

    started = time.perf_counter()
    target = Path(job.path)
    own = target.with_name(f"{target.stem}.{uuid.uuid4().hex[:8]}.nc") if apart else target

    def ended(error: BaseException, exit_code: int, message: str, lasting: bool = True) -> Outcome:
        notes = [note for note in getattr(error, "__notes__", ()) if not apart]
        return Outcome(
            job.hash, exit_code, "\n".join([message, *notes]), time.perf_counter() - started, lasting
        )

    began = False
    try:
        case = Case.from_text(job.deck, target.name)
        with contextlib.ExitStack() as stack:
            restart = _interrupted(job, case, stack)
            if restart is None:
                if own.is_file():  # damaged, or of another case, under a name that the index gave to this one
                    own.unlink()
                store = stack.enter_context(Store(own, metadata_of(case), overwrite=True))
                began = True
                before: Sequence[Step] = ()
            else:
                own, began, store, before = restart.store.path, True, restart.store, restart.before
            follower = listeners(case, listener)
            with follower.following(case.title or target.stem, case.planned_steps):
                run_into(case, store, follower, before)
        apart = own != target
        if apart:
            os.replace(own, target)
    except HexcontactError as error:
        _keep(own, target)
        return ended(error, error.exit_code, str(error), began)
    except MemoryError as error:
        return ended(error, ResourceError.exit_code, "the machine has not enough memory for this", False)
    except OSError as error:
        return ended(error, ResourceError.exit_code, str(error), False)
    except Exception as error:  # one case must not end the others
        return ended(error, HexcontactError.exit_code, f"{type(error).__name__}: {error}", False)
    return Outcome(job.hash, seconds=time.perf_counter() - started)


def _interrupted(job: Job, case: Case, stack: contextlib.ExitStack) -> Restart | None:
    """Open what an interrupted attempt has left, to go on with it; None if there is no such thing."""
    from ..result.store import journal_of
    from ..solve.restart import reopened

    target = Path(job.path)
    attempts = target.parent.glob(f"{target.stem}.*.nc.d") if target.parent.is_dir() else ()
    for journal in (journal_of(target), *sorted(attempts)):
        if not journal.is_dir():
            continue
        with contextlib.ExitStack() as attempt:
            try:
                restart = attempt.enter_context(reopened(journal, case))
            except (HexcontactError, OSError):
                continue  # damaged, of another deck, or another attempt is at it right now
            if restart is None or restart.warning:  # finished, or of another version: then all of it anew
                continue
            stack.push(attempt.pop_all())
            return restart
    return None


def _keep(own: Path, target: Path) -> None:
    """Give the finished steps of a failed attempt the name of the case."""
    from ..result.store import journal_of

    if own != target and journal_of(own).is_dir():
        with contextlib.suppress(OSError):
            shutil.rmtree(journal_of(target), ignore_errors=True)
            os.replace(journal_of(own), journal_of(target))


# --- processes ----------------------------------------------------------------------------------------------


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


class LocalPool:
    """Worker processes on this machine.

    Parameters
    ----------
    workers : int
        Cases at a time.
    threads : int
        Threads of each.
    """

    def __init__(self, workers: int, threads: int) -> None:
        self.workers, self.threads = workers, threads
        self._stopped = threading.Event()
        self._outcomes: queue.Queue[Outcome | BaseException] = queue.Queue()
        self._executors: dict[int, ProcessPoolExecutor] = {}
        self._mutex = threading.Lock()
        self._attendants: list[threading.Thread] = []

    def outcomes(self, jobs: Sequence[Job], cancel: threading.Event) -> Iterator[Outcome]:
        """Run the jobs; yield each outcome as it comes, until `cancel` is set."""
        from multiprocessing import resource_tracker

        # Started from a thread it would undo the blocking of signals there.
        resource_tracker.ensure_running()
        waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
        for job in jobs:
            waiting.put(job)
        for number in range(min(self.workers, len(jobs))):
            thread = threading.Thread(target=self._attend, args=(number, waiting), daemon=True)
            self._attendants.append(thread)
            thread.start()
        for _ in jobs:
            outcome = next_of(self._outcomes, cancel)
            if outcome is None:
                return
            yield outcome

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


def next_of(outcomes: queue.Queue[Outcome | BaseException], cancel: threading.Event) -> Outcome | None:
    """Wait for an outcome; None if `cancel` is set before one comes."""
    while not cancel.is_set():
        with contextlib.suppress(queue.Empty):
            outcome = outcomes.get(timeout=_POLL)
            if isinstance(outcome, BaseException):
                raise outcome
            return outcome
    return None
