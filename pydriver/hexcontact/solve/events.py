"""Events of a run, with the base class of their listeners."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator
from typing import Any

from ..core.lattice import Lattice
from ..errors import StopRun
from ..result.step import Step


class Listener:
    """Follows a run; a listener overrides the events that it needs."""

    def begun(self, title: str, steps: int) -> None:
        """Note that a run of `steps` load steps begins; 0 if their number is open."""

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Note the start on another lattice; a `shifted` copy only serves to estimate errors."""

    def step(self, step: Step) -> None:
        """Note a finished load step, after it was recorded."""

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Note any other event: a sentence for the terminal (empty: for the log alone), values in SI."""

    def ended(self, error: BaseException | None) -> None:
        """Note the end of the run, by an error or without."""

    @contextlib.contextmanager
    def following(self, title: str, steps: int) -> Iterator[None]:
        """Follow a run from its beginning to its end; arguments as `begun`."""
        self.begun(title, steps)
        try:
            yield
        except BaseException as error:
            self.ended(error)
            raise
        self.ended(None)


def _passed(name: str) -> Callable[..., None]:
    def to_all(self: Listeners, *values: Any, **named: Any) -> None:
        for listener in self._all:
            getattr(listener, name)(*values, **named)

    return to_all


class Listeners(Listener):
    """Passes every event to several listeners, in their order."""

    def __init__(self, *listeners: Listener) -> None:
        self._all = listeners

    begun, lattice, step, said, ended = map(_passed, ("begun", "lattice", "step", "said", "ended"))


class Stopped(Exception):
    """Ends a run after a load step for a callback; the message is the reason."""


class Callback(Listener):
    """Calls a function of a script with each finished load step.

    If the function returns a true value, or raises `StopRun`, the run ends. `refines`: other lattices may
    follow the last load step.
    """

    def __init__(self, on_step: Callable[[Step], object], refines: bool = False) -> None:
        self._on_step, self._refines = on_step, refines

    def step(self, step: Step) -> None:
        """Raise `Stopped` if the function ends the run."""
        try:
            answer = self._on_step(step)
        except StopRun as wanted:
            answer = str(wanted) or True
        if answer and (self._refines or not step.load_fraction >= 1.0):
            reason = f": {answer}" if isinstance(answer, str) else ""
            raise Stopped(f"stopped by on_step after step {step.number}{reason}")
