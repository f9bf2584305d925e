"""A case driven by a script, one load step at a time: the next load may depend on the last result."""

from __future__ import annotations

import copy
import dataclasses
import functools
import threading
import tomllib
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Self, TypeVar

from ..arrays import DataFrame
from ..deck.faults import NOWHERE, Source, deck_error
from ..deck.keys import Load
from ..deck.toml import as_toml, load_as_toml, plain
from ..deck.units import angle_text
from ..errors import DeckError
from ..problem.arguments import known_keywords, middle_of, with_radians
from ..problem.loads import History, LoadStep
from ..problem.problem import Problem
from ..result.journal import Header
from ..result.layout import assemble
from ..result.step import Step
from ..result.store import Store, open_result
from . import steps as solving
from .events import Log
from .run import metadata_of
from .steps import without_ends

if TYPE_CHECKING:
    from ..result.result import Result


_P = ParamSpec("_P")
_T = TypeVar("_T")

_AT_REST = frozenset(("tangential_load_x", "tangential_load_y", "twist"))  # zero unless they are given
_FINENESS = ("spacing", "nodes_across", "nodes_in_radius", "origin")


def _one_at_a_time(call: Callable[Concatenate[Session, _P], _T]) -> Callable[Concatenate[Session, _P], _T]:
    """Let a method of a session refuse to run while another thread is in one."""

    @functools.wraps(call)
    def alone(session: Session, *arguments: _P.args, **keywords: _P.kwargs) -> _T:
        if not session._free.acquire(blocking=False):
            raise DeckError("the session is at work in another thread; call it from one thread at a time")
        try:
            return call(session, *arguments, **keywords)
        finally:
            session._free.release()

    return alone


class Session:
    """A run that waits between its load steps; made by `hexcontact.Case.start`; ``case`` is its problem.

    Iterating over it solves the loads of the case one by one. `advance` applies other loads instead of the
    remaining ones of the case.

    A step that does not converge, or slides, raises an exception and leaves the session at the step before,
    from which other loads can be applied. The first window follows from the loads of the case, and grows with
    the contact.

    With an output each step is on the disk before the next begins; `close`, or the end of a ``with`` block,
    completes the file. Its deck has the applied loads. If loads of the case remain and none was applied by
    `advance`, the run is unfinished and `hexcontact.resume` continues it. Without an output all steps are in
    memory.

    Examples
    --------
    >>> from hexcontact import Case
    >>> from hexcontact.surfaces import Sphere
    >>> steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    >>> case = Case(
    ...     body_1={**steel, "surface": Sphere(radius=10e-3)},
    ...     body_2=steel,
    ...     nodes_in_radius=8,
    ...     friction_coefficient=0.3,
    ...     normal_load=100.0,
    ... )
    >>> session = case.start()
    >>> pressed = next(session)
    >>> while session.step.stick_area > 0.5 * pressed.stick_area:
    ...     step = session.advance(tangential_load_x=session.step.tangential_load_x + 2.0)
    >>> f"half of the stick area is gone at {session.step.tangential_load_x:.0f} N"
    'half of the stick area is gone at 20 N'
    """

    def __init__(self, case: Problem, output: str | Path | None = None, overwrite: bool = False) -> None:
        self.case = case
        self._free = threading.Lock()
        self._about = metadata_of(case)
        self._steps: list[Step] = []  # with an output only the last has its fields
        self._solving: Iterator[Step] | None = None  # yields the next load steps; None after a failure
        self._queue: deque[LoadStep] = deque()  # of `advance`
        self._by_hand: Header | None = None  # once `advance` has applied loads
        self._log = Log()
        self._log.begun(case.title, case.planned_steps)
        self._resting = _AT_REST  # those that were zero in all steps
        self._history: History | None = None  # of these loads; None: not unrolled
        self._driven = copy.copy(case)
        self._driven.judged = {}
        self._closed = False
        self._store: Store | None = None
        if output is not None:
            self._store = Store(output, self._about, overwrite)
            # a deleted session, as after another run of the cell of a notebook, releases its file
            weakref.finalize(self, self._store.close, "the session was dropped")

    # --- results --------------------------------------------------------------------------------------------

    @property
    def step(self) -> Step:
        """The last finished step."""
        if not self._steps:
            raise DeckError("no load step of the session is finished yet")
        return self._steps[-1]

    @property
    def steps(self) -> tuple[Step, ...]:
        """All finished steps; with an output, only the last has its fields."""
        return tuple(self._steps)

    @property
    def history(self) -> DataFrame:
        """Table of everything that has one value by step, by the number of the step."""
        import pandas

        numbers = pandas.Index([step.number for step in self._steps], name="step")
        return pandas.DataFrame([dict(step.history) for step in self._steps], index=numbers)

    def result(self) -> Result:
        """Return all finished steps as a result; DeckError if there is none."""
        from ..result.result import Result

        _ = self.step
        if self._store is None:
            header = self._by_hand or Header(self._about)
            about = header.whole(step.control for step in self._steps)
            return Result(functools.partial(assemble, about, self.steps, self._whole))
        return open_result(self._store.path)

    @property
    def _whole(self) -> bool:
        """Whether all load steps are solved."""
        return bool(self._steps) and (self._by_hand is not None or self._steps[-1].load_fraction >= 1.0)

    # --- steps ----------------------------------------------------------------------------------------------

    def __iter__(self) -> Self:
        """Return the session, an iterator that solves a step at a time."""
        return self

    @_one_at_a_time
    def __next__(self) -> Step:
        """Solve the next load step of the case; StopIteration after the last, or if `advance` applied others.

        Errors as of `hexcontact.Case.run`. If an interim output cannot be written, the step is finished all
        the same.
        """
        if self._whole:
            raise StopIteration
        self._check_open()
        if self._solving is None:
            in_memory = self._store is None
            self._solving = solving.steps(self.case, in_memory, self._steps, listener=self._log)
        return self._next_step()

    @known_keywords
    @_one_at_a_time
    def advance(
        self,
        *,
        normal_load: float | str | None = None,
        approach: float | str | None = None,
        tangential_load_x: float | str | None = None,
        shift_x: float | str | None = None,
        tangential_load_y: float | str | None = None,
        shift_y: float | str | None = None,
        torque: float | str | None = None,
        twist: float | str | None = None,
        bulk_stress_xx: float | str | None = None,
        bulk_stress_yy: float | str | None = None,
        bulk_stress_xy: float | str | None = None,
        mean_pressure: float | str | None = None,
        mean_gap: float | str | None = None,
        mean_traction_x: float | str | None = None,
        mean_traction_y: float | str | None = None,
        steps: int = 1,
        label: str = "",
    ) -> Step:
        """Advance to other loads or motions, at most one of each pair; the others do not change.

        Return the last step. DeckError if the loads are wrong, such as more than friction can carry, or the
        contact outgrows a fixed window; ConvergenceError if a step does not converge, or the bodies slide:
        the steps before it are done; ResourceError if there is not enough memory or disk: for an interim
        output (DeckError, too) the step is finished all the same; TypeError if there is no such load, with
        the nearest.

        Parameters
        ----------
        normal_load, approach : float, optional
            Normal load (N), or approach (m).
        tangential_load_x, shift_x, tangential_load_y, shift_y : float, optional
            Tangential loads (N), or shifts (m).
        torque, twist : float, optional
            Torque (N m), or twist (rad).
        bulk_stress_xx, bulk_stress_yy, bulk_stress_xy : float, optional
            Bulk stress (Pa) of the body that [bulk] names.
        mean_pressure, mean_gap, mean_traction_x, mean_traction_y : float, optional
            Loads over the area (Pa), or mean of the gap (m), of a window that repeats.
        steps, label : int, str
            Number of equal increments, and name of the segment in the result.
        """
        given = {name: value for name, value in locals().items() if name != "self"}
        self._check_open()
        if self.case.rolls:
            raise DeckError("rolling: expected all loads of rolling bodies in [[load]], and none by hand")
        entry = with_radians(plain(given | {"label": label or None}))
        # iteration applied the loads of the case, or one for each solved step
        as_given = self._whole and not self.case.adaptive
        header = self._by_hand or self._described(self.case.deck_tables["load"] if as_given else None)
        history = self._unrolled(header, entry)
        if self._by_hand is None:
            self._by_hand, self._solving = header, None
            if self._store is not None:
                self._store.describe(header)
            self._log.begun(self.case.title, 0)
        self._driven.load_steps = history.steps
        segment = int(self._steps[-1].history["segment"]) if self._steps else 0
        done = len(self._steps)
        for target in history.steps[-steps:]:
            self._queue.append(dataclasses.replace(target, index=len(self._steps), segment=segment))
            if self._solving is None:
                queued = iter(self._queue.popleft, None)
                self._solving = solving.steps(self._driven, False, self._steps, queued, self._log)
            try:
                self._next_step(entry, len(self._steps) + 1 - done, steps)
            except BaseException:
                self._queue.clear()
                raise
        self._history = history
        return self.step

    @_one_at_a_time
    def back(self, steps: int = 1) -> None:
        """Undo the last steps; DeckError if there are fewer, or the session writes a file."""
        self._check_open()
        if self._store is not None:
            raise DeckError("a session that writes a file cannot go back; start it without an output")
        if not 1 <= steps <= len(self._steps):
            raise DeckError(f"steps = {steps!r}: expected 1 to {len(self._steps)}, as many as are finished")
        del self._steps[-steps:]
        self._solving, self._resting = None, _AT_REST
        for step in self._steps:
            self._resting = self._resting_in(step)
        if self._by_hand is not None:
            self._history = None
            if len(self._steps) < (self._by_hand.steps or 0):
                self._by_hand = self._described()

    def _next_step(self, entry: dict[str, Any] | None = None, part: int = 1, parts: int = 1) -> Step:
        """Solve the next load step and record it; after a failure the last finished step is the start again.

        The step is a part of those of an `entry` of [[load]] of `advance`.
        """
        assert self._solving is not None
        try:
            step = next(self._solving)
            resting = self._resting_in(step)
            if entry is not None:
                load = entry if part == parts else self._applied(step, resting) | {"steps": part}
                control = {"segment": step.history["segment"], "load": load_as_toml(load)}
                step = dataclasses.replace(step, control={**step.control, **control})
            if self._store is not None:
                self._store.append(step)
                self._steps[-1:] = [before.head for before in self._steps[-1:]]
            self._resting = resting
        except BaseException:
            self._solving = None
            raise
        if self.case.deck.wear:  # a cycle starts from the last one alone, after `back` without restart data
            self._steps[-1:] = [without_ends(before) for before in self._steps[-1:]]
        self._steps.append(step)
        self._log.step(step)
        if self._store is not None:
            self._store.publish()
        return step

    # --- loads as entries of a deck -------------------------------------------------------------------------

    def _resting_in(self, step: Step) -> frozenset[str]:
        """Return the loads and motions that were zero in all steps, also in this one."""
        return frozenset(name for name in self._resting if step.prescribed.get(name) == 0.0)

    def _applied(self, step: Step, resting: frozenset[str]) -> dict[str, Any]:
        """Return the entry of [[load]] that leads to a step."""
        label = {"label": step.history["label"]} if step.history.get("label") else {}
        loads = {name: value for name, value in step.prescribed.items() if name not in resting}
        entry: dict[str, Any] = with_radians(loads | label)
        return entry

    def _unrolled(self, header: Header, entry: dict[str, Any]) -> History:
        """Return the history with a new entry; DeckError for a wrong one."""
        new = Load.parse(entry, NOWHERE)
        history, self._history = self._history, None  # until all steps of the entry are solved
        if history is None:
            mu = self.case.friction_coefficient if self.case.frictional else None
            history = History(mu, self.case.deck.bulk, self.case.period)
            deck = header.whole(step.control for step in self._steps).deck
            for load in tomllib.loads(deck).get("load", ()):
                history.append(Load.model_validate(load))
        history.append(new)
        if problems := history.problems:
            raise deck_error([p._replace(key=p.key[2:] or p.key) for p in problems], Source(data=entry))
        return history

    def _described(self, loads: Sequence[dict[str, Any]] | None = None) -> Header:
        """Return the metadata of the finished steps with a deck of some loads, by default one for each."""
        if loads is None:
            loads = [self._applied(step, self._resting) for step in self._steps]
        tables = self.case.deck_tables
        lattice = self._steps[-1].lattice if self._steps else self.case.lattice
        # the same nodes, whatever the largest load is
        grid = {key: value for key, value in tables["grid"].items() if key not in _FINENESS}
        grid |= {"spacing": lattice.spacing, "origin": list(lattice.origin)}
        if self.case.deck.grid.fits:
            grid = {key: value for key, value in grid.items() if key != "lattice"}
            grid |= {"cell_ratio": lattice.cell_ratio, "cell_angle": "90 deg"}
            grid |= {"direction": angle_text(lattice.direction)}
        if self.case.period:
            grid = dict(tables["grid"])
        elif self.case.window_fixed:
            grid = {key: value for key, value in grid.items() if key != "extent"}
            grid |= {"window": list(lattice.shape), "center": middle_of(lattice)}
        # on this lattice only
        others = {key: table for key, table in tables.items() if key not in ("accuracy", "load")}
        deck = "".join([as_toml({**others, "grid": grid}), *map(load_as_toml, loads)])
        return Header(dataclasses.replace(self._about, deck=deck), len(self._steps))

    # --- end ------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """End the session; with an output, complete the file, or leave a run that can be resumed."""
        if self._closed:
            return
        self._closed, self._solving = True, None
        if self._store is not None:
            if self._whole:
                self._store.finish()
            else:
                self._store.close(f"the session was closed after step {len(self._steps)}")

    def _check_open(self) -> None:
        if self._closed:
            raise DeckError("the session is closed")

    def __enter__(self) -> Self:
        """Return the session."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the session; after an exception the run is unfinished."""
        if error is not None and self._store is not None:
            self._closed, self._solving = True, None
            self._store.__exit__(kind, error, trace)
        self.close()

    def __repr__(self) -> str:
        """Name the case and its last step."""
        case = Problem.__repr__(self.case)  # without warnings on further lines
        if not self._steps:
            return f"Session of {case}, nothing solved yet"
        return f"Session of {case}, after {self.step!r}"
