"""Backends, which run the cases of a study: executors of `concurrent.futures` with a key in study files.

Each module in `backends` registers one; no other module names them.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any, TypeVar

from ..deck.kinds import Kind, refuse
from .job import Job, Outcome, solve_case

T = TypeVar("T", bound=type)

BACKENDS: dict[str, Any] = {}
"""The backends by their words."""

KEYS: dict[str, Any] = {}
"""Keys of study files that belong to backends, each with annotation and `meaning`."""

_POLL = 0.2  # s between checks for cancellation


@dataclass(frozen=True)
class OptionTable(Kind):
    """A table whose keys belong to another program."""

    example: str

    def _expected(self) -> str:
        return f"a table such as {self.example}"

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
