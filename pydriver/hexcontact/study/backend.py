"""Where the cases of a study are run: what all such places have in common, and their words in study files.

A module in `backends` registers its own; nothing else names it.
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
"""All of them, by their words."""

KEYS: dict[str, Any] = {}
"""The keys that they have in study files: each with its annotation and its `meaning`."""

_POLL = 0.2  # s between looks at whether to stop


@dataclass(frozen=True)
class Settings(Kind):
    """A table whose keys belong to another program."""

    example: str

    def _expected(self) -> str:
        return f"a table such as {self.example}"

    def _parse(self, value: object) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            refuse(f"expected {self.expected}")
        return dict(value)


def backend(word: str, annotation: Any = None, default: Any = None) -> Callable[[T], T]:
    """Register a backend; with an annotation a study file may have its word as a key."""

    def known(kind: T) -> T:
        BACKENDS[word] = kind
        if annotation is not None:
            KEYS[word] = (annotation, default)
        return kind

    return known


class Backend:
    """Runs cases, several at a time.

    Parameters
    ----------
    settings : object
        What a study file has under the word of the backend.
    cases : int
        How many cases there are to run, one at least.
    """

    def __init__(self, settings: Any, cases: int) -> None:
        raise NotImplementedError

    @staticmethod
    def load(settings: Any) -> None:
        """Import what it needs; called in the main thread."""

    def outcomes(self, jobs: Sequence[Job], cancel: threading.Event) -> Iterator[Outcome]:
        """Run the jobs; yield each outcome as it comes, until `cancel` is set."""
        raise NotImplementedError

    def stop(self) -> None:
        """Take back what has not begun, and end what was started here."""
        raise NotImplementedError


def arrived(
    outcomes: queue.Queue[Outcome | BaseException], count: int, cancel: threading.Event
) -> Iterator[Outcome]:
    """Yield `count` outcomes as they come, fewer if `cancel` is set."""
    while count and not cancel.is_set():
        with contextlib.suppress(queue.Empty):
            outcome = outcomes.get(timeout=_POLL)
            if isinstance(outcome, BaseException):
                raise outcome
            count -= 1
            yield outcome
