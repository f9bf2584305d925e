"""Events of a run and the listeners that follow it: a bar or lines on a terminal, the log, callbacks."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from ..errors import StopRun

if TYPE_CHECKING:
    from ..core.lattice import Lattice
    from ..result.step import Step


class Listener:
    """Follows a run; this one does nothing."""

    def begun(self, title: str, steps: int) -> None:
        """Take note that a run begins.

        Parameters
        ----------
        title : str
            Title of the case.
        steps : int
            Number of load steps; 0 if it shows on the way.
        """

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Take note that the load history begins again on another lattice.

        Parameters
        ----------
        name : str
            Which one: "lattice 3".
        lattice : Lattice
            Its first window.
        shifted : bool
            Whether it is a shifted copy, which only serves to estimate errors.
        """

    def step(self, step: Step) -> None:
        """Take note of a finished load step, which is safe by then."""

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Take note of anything else.

        Parameters
        ----------
        event : str
            What happened, in a word.
        text : str
            A sentence for people; empty if it is for the log alone.
        level : int
            How serious it is, as in `logging`.
        **values
            What is known about it, in SI.
        """

    def ended(self, error: BaseException | None) -> None:
        """Take note that the run is over, be it by an error."""

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


class Listeners(Listener):
    """Hands every event on to several listeners, in their order."""

    def __init__(self, *listeners: Listener) -> None:
        self._all = listeners

    def begun(self, title: str, steps: int) -> None:
        """Say that a run begins."""
        for listener in self._all:
            listener.begun(title, steps)

    def lattice(self, name: str, lattice: Lattice, shifted: bool) -> None:
        """Say that the load history begins again."""
        for listener in self._all:
            listener.lattice(name, lattice, shifted)

    def step(self, step: Step) -> None:
        """Say that a load step is finished."""
        for listener in self._all:
            listener.step(step)

    def said(self, event: str, /, text: str = "", level: int = logging.INFO, **values: object) -> None:
        """Say anything else."""
        for listener in self._all:
            listener.said(event, text, level, **values)

    def ended(self, error: BaseException | None) -> None:
        """Say that the run is over."""
        for listener in self._all:
            listener.ended(error)


class Stopped(Exception):
    """A callback ends the run after a load step; the message says which, and why."""


class Callback(Listener):
    """Calls a function of a script with each finished load step, which may end the run.

    Parameters
    ----------
    on_step : callable
        The function. If it returns something true, or raises `StopRun`, the run ends.
    refines : bool
        Whether more lattices may follow the last load step, which otherwise ends the run by itself.
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
