"""Backends, which run the cases of a study: their interface, their registration, their keys in study files.

Each module in `backends` registers one; no other module names them.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from ..deck.kinds import Kind, refuse
from .job import Job, Outcome

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


class Backend:
    """Run cases, several at a time, with the settings of the backend in a study file."""

    def __init__(self, settings: Any, cases: int) -> None:
        raise NotImplementedError

    @staticmethod
    def load(settings: Any) -> None:
        """Import the packages that it needs; called in the main thread."""

    def outcomes(self, jobs: Sequence[Job], cancel: threading.Event) -> Iterator[Outcome]:
        """Run the jobs and yield the outcome of each when it ends, until `cancel` is set."""
        raise NotImplementedError

    def stop(self) -> None:
        """Cancel jobs that have not begun, and end processes started here."""
        raise NotImplementedError


def arrived(
    outcomes: queue.Queue[Outcome | BaseException], count: int, cancel: threading.Event
) -> Iterator[Outcome]:
    """Yield `count` outcomes from a queue, fewer if `cancel` is set; raise exceptions in it."""
    while count and not cancel.is_set():
        with contextlib.suppress(queue.Empty):
            outcome = outcomes.get(timeout=_POLL)
            if isinstance(outcome, BaseException):
                raise outcome
            count -= 1
            yield outcome
