"""Jobs of a study, one for each case, and the backends that run them: executors of `concurrent.futures`.

Each module in `backends` registers one; no other module names them.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import queue
import shutil
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from .._version import __version__
from ..deck.kinds import Kind, refuse
from ..errors import HexcontactError, ResourceError
from ..netcdf_library import attributes

if TYPE_CHECKING:
    from ..problem.problem import Problem
    from ..result.step import Step
    from ..solve.events import Listener
    from ..solve.restart import Restart


MOST_CASES = 100_000  # of a study


@dataclass(frozen=True)
class Job:
    """A case to run: its hash, its deck, the path of its file."""

    hash: str
    deck: str
    path: str


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case."""

    hash: str  # name of the case
    exit_code: int = 0  # 0 if it is done, else that of ``hexcontact run``
    message: str = ""  # why it failed
    seconds: float = 0.0  # wall time of this attempt
    lasting: bool = True  # whether the case itself caused the failure, not memory, disk or signals
    hexcontact_version: str = __version__  # of the program that ran it


def solve_case(job: Job, apart: bool = False, listener: Listener | None = None) -> Outcome:
    """Run one case, write its file, and return the outcome, also of a failure.

    An attempt `apart` writes to a file of its own first, since another attempt may still run.
    """
    from ..problem.problem import Problem
    from ..result.journal import journal_of
    from ..result.store import Store
    from ..solve.run import listeners, metadata_of, solve_into, write_stresses

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
        case = Problem.from_text(job.deck, target.name)
        if holds(target, job.hash):  # only its tables are missing
            list(write_stresses(target, case))
            return Outcome(job.hash, seconds=time.perf_counter() - started)
        with contextlib.ExitStack() as stack:
            restart = _interrupted(job, case, stack)
            if restart is None:
                if own.is_file():  # damaged, or of another case that had this number
                    own.unlink()
                store = stack.enter_context(Store(own, metadata_of(case), overwrite=True))
                began = True
                before: Sequence[Step] = ()
            else:
                own, began, store, before = restart.store.path, True, restart.store, restart.before
            follower = listeners(case, listener)
            with follower.following(case.title or target.stem, case.planned_steps):
                solve_into(case, store, follower, before)
        apart = own != target
        if apart:
            os.replace(own, target)
        list(write_stresses(target, case))
    except HexcontactError as error:
        if (
            own != target and journal_of(own).is_dir()
        ):  # the journal of a failed attempt gets the name of the case
            with contextlib.suppress(OSError):
                shutil.rmtree(journal_of(target), ignore_errors=True)
                os.replace(journal_of(own), journal_of(target))
        return ended(error, error.exit_code, str(error), began)
    except MemoryError as error:
        return ended(error, ResourceError.exit_code, "the machine has not enough memory for this", False)
    except OSError as error:
        return ended(error, ResourceError.exit_code, str(error), False)
    except Exception as error:  # one case must not end the others
        return ended(error, HexcontactError.exit_code, f"{type(error).__name__}: {error}", False)
    return Outcome(job.hash, seconds=time.perf_counter() - started)


def hash_of(deck: str) -> str:
    """Return the name of a case: a hash of the text of its deck."""
    return hashlib.sha256(deck.encode()).hexdigest()[:20]


def holds(path: Path, name: str) -> bool:
    """Return whether a file is the complete result of the case with this hash."""
    about = attributes(path)
    return bool(about.get("complete")) and hash_of(str(about.get("deck"))) == name


def _interrupted(job: Job, case: Problem, stack: contextlib.ExitStack) -> Restart | None:
    """Reopen the journal of an interrupted attempt to continue it; None if there is none."""
    from ..result.journal import journal_of
    from ..solve.restart import reopened

    target = Path(job.path)
    attempts = target.parent.glob(f"{target.stem}.*.nc.d") if target.parent.is_dir() else ()
    for journal in filter(Path.is_dir, (journal_of(target), *sorted(attempts))):
        # it may be damaged, of another deck, or locked by another attempt
        with contextlib.suppress(HexcontactError, OSError), contextlib.ExitStack() as attempt:
            restart = attempt.enter_context(reopened(journal, case))
            if restart and not restart.warning:  # else finished, or of another version: run from the start
                stack.push(attempt.pop_all())
                return restart
    return None


T = TypeVar("T", bound=type)

BACKENDS: dict[str, Any] = {}
"""The backends by their words."""

KEYS: dict[str, Any] = {}
"""Keys of study files that belong to backends, each with annotation and `meaning`."""

_POLL = 0.2  # s between checks for cancellation


class OptionTable(Kind):
    """A table whose keys belong to another program."""

    def __init__(self, example: str) -> None:
        self.expected = f"a table such as {example}"

    def _parse(self, value: object) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            refuse(f"expected {self.expected}")
        return dict(value)


def backend(word: str, annotation: Any = None, default: Any = None) -> Callable[[T], T]:
    """Register a backend under a word, which is a key of study files if there is an annotation."""

    def register(kind: T) -> T:
        BACKENDS[word] = kind
        if annotation is not None:
            KEYS[word] = (annotation, default)
        return kind

    return register


class Backend(Executor):
    """Run cases, several at a time, with the settings of the backend in a study file.

    Leaving its context cancels jobs that have not begun, and ends processes started here.
    """

    apart = False  # whether an earlier attempt at a case may still run when another begins

    def __init__(self, settings: Any, cases: int) -> None:
        raise NotImplementedError

    @staticmethod
    def load(settings: Any) -> None:
        """Import the packages that it needs; called in the main thread."""

    def outcome(self, future: Future[Outcome], job: Job) -> Outcome:
        """Return the outcome of a job that has ended; errors that are not those of a worker are raised."""
        return future.result()


def outcomes(pool: Backend, jobs: Sequence[Job], cancel: threading.Event) -> Iterator[Outcome]:
    """Run jobs and yield the outcome of each when it ends, until `cancel` is set."""
    ended: queue.SimpleQueue[Future[Outcome]] = queue.SimpleQueue()
    running: dict[Future[Outcome], Job] = {}
    for job in jobs:
        future = pool.submit(solve_case, job, pool.apart)
        running[future] = job
        future.add_done_callback(ended.put)
    while running and not cancel.is_set():
        try:
            future = ended.get(timeout=_POLL)
        except queue.Empty:
            continue
        yield pool.outcome(future, running.pop(future))
