"""What ``hexcontact run``, ``resume`` and ``check`` do: read a case, find its place, solve it, tell of it."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from ..errors import AccuracyWarning, DeckError
from ..result.history import step_rows
from ..result.remarks import remarks
from ..result.store import open_result
from ..solve import log
from ..solve import run as solve
from ..solve.interruption import Interrupted, in_background
from ..solve.progress import reporter
from ..text import rich_table, visible
from . import json_output
from . import tables as summary
from .guard import complain, say
from .options import LogLevel, setting

if TYPE_CHECKING:
    from ..case import Case
    from ..problem.problem import Problem
    from ..result.result import Result, Step
    from ..result.store import Store

_PICTURES = (".png", ".pdf", ".svg")


def case_of(deck: Path, settings: list[str] | None) -> Case:
    """Read a deck with the keys that ``--set`` replaces."""
    from ..case import Case

    return Case.from_toml(deck, overrides=dict(map(setting, settings or ())))


def target_of(case: Problem, deck: Path, output: Path | None = None) -> Path:
    """Return the file that a run writes: what the user, else the deck, else the deck's name says."""
    target = output or case.output.file or Path(f"{deck.stem}.nc")
    if target.suffix in _PICTURES:
        raise DeckError(f"output {target}: expected a netCDF file, such as {target.with_suffix('.nc')}")
    if not target.parent.is_dir():
        there = target.parent.exists()
        fault = f"{target.parent} is not a folder" if there else f"the folder {target.parent} does not exist"
        raise DeckError(f"cannot write {target}: {fault}")
    return target


@dataclasses.dataclass(frozen=True)
class Listeners:
    """Who is told about a run, and how.

    Attributes
    ----------
    command : str
        Name of the command.
    quiet, as_json : bool
        Print nothing but errors; print an object in the end instead of tables.
    log_file, log_level : Path, LogLevel or None
        Options of the log.
    """

    command: str
    quiet: bool = False
    as_json: bool = False
    log_file: Path | None = None
    log_level: LogLevel | None = None

    def __post_init__(self) -> None:
        if self.quiet and self.log_level and self.log_file is None:
            raise DeckError("--log-level: expected --log-file with it, since --quiet prints nothing")

    def logging(self, *spare: Path) -> contextlib.AbstractContextManager[None]:
        """Keep the log, never in one of the files that the command reads or writes."""
        return log.kept(self.log_file, self.log_level, spare)

    def spare(self, target: Path) -> None:
        """Refuse a log in the output, once it is known."""
        log.refuse_same(self.log_file, [target])

    @property
    def silent(self) -> bool:
        """Whether no progress is shown: if quiet, or where the log is shown instead."""
        return self.quiet or (self.log_level is not None and self.log_file is None)

    def leave(self, signaled: Interrupted, kept: str, **about: Any) -> NoReturn:
        """Say what is kept after an interruption and end the process, whatever the core is doing."""
        message = f"interrupted; {kept}"
        with contextlib.suppress(OSError):  # nobody listens any more
            log.logger.error(log.words("stopped", reason=f"interrupted ({signaled.name})", **about))
            log.logger.disabled = True  # for what is still at work
            complain(message)
            if self.as_json:
                json_output.write(self.command, json_output.error(message, signaled.exit_code))
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(signaled.exit_code)

    def tell(
        self,
        case: Problem,
        histories: list[Any],
        target: Path,
        picture: Path | None,
        warnings: Sequence[str] = (),
    ) -> dict[str, Any] | None:
        """Print, or return, what came out; an accuracy that was asked for and not reached too."""
        refined = open_result(target) if case.accuracy else None
        shortfall = refined.shortfall if refined is not None else ""
        if refined is not None:
            histories = refined.history.to_dict("records")  # of the finest lattice, with errors
        if shortfall:
            complain(shortfall)
        if self.as_json:
            told = [
                *warnings,
                *remarks(histories, solve.parameters_of(case)),
                *([shortfall] * bool(shortfall)),
            ]
            written: dict[str, Any] = {"output": target, "picture": picture, "warnings": told}
            written["exit_code"] = AccuracyWarning.exit_code if shortfall else 0
            return written | json_output.of_run(case, case.title, histories)
        if not self.quiet:
            summarize(case, histories, target, picture, refined)
        if shortfall:
            raise typer.Exit(AccuracyWarning.exit_code)
        return None


def solved(
    case: Problem,
    store: Store,
    heard: tuple[int, int],
    name: str,
    listeners: Listeners,
    before: Sequence[Step] = (),
) -> list[Any]:
    """Solve a case into a store and return the histories of all its steps.

    Signals end the process, unless the last step is finished: then the output is completed.
    """

    def ends(signaled: Interrupted) -> bool:
        if store.has_all_steps:
            return False
        store.close(f"interrupted ({signaled.name})")
        return not store.finished

    shown, histories = reporter(listeners.silent), [step.history for step in before]
    title = (case.title or name) + (f", after step {len(before)}" if before else "")
    try:
        with shown.watching(title, case.planned_steps):
            in_background(
                lambda: solve.record(case, store, shown, lambda step: histories.append(step.history), before),
                heard,
                ends,
            )
    except Interrupted as signaled:
        listeners.leave(signaled, store.kept or "no load step was finished", done=len(store.heads))
    return histories


def overview(path: Path) -> Path:
    """Draw a result beside its file."""
    from .plot import picture_of

    return picture_of([open_result(path)], "overview", path.with_suffix(".png"), {})


def summarize(
    case: Problem, histories: list[Any], target: Path, picture: Path | None, refined: Result | None = None
) -> None:
    """Print what came out: history, last step, how it compares with Hertz; lattices and errors."""
    console, last = summary.console(), histories[-1]
    if len(histories) > 1:
        console.print(summary.history_table(histories, console))
    console.print(summary.pairs(f"Last load step of {case.title!r}" if case.title else "Last load step",
                                step_rows(last)))  # fmt: skip
    if rows := summary.hertz_rows(case, last):
        console.print(rich_table("Against Hertz", summary.HERTZ_HEADERS, rows))
    if refined is not None:
        console.print(rich_table("Accuracy", summary.TRIAL_HEADERS, summary.trial_rows(refined)))
    for remark in remarks(histories, solve.parameters_of(case)):
        console.print(f"note: {remark}", soft_wrap=True)
    console.print(visible(f"written: {target}" + (f", {picture}" if picture else "")), soft_wrap=True)


def was_finished(file: Path, picture: Path | None, listeners: Listeners) -> dict[str, Any] | None:
    """Say that there was nothing to go on with."""
    if listeners.as_json:
        result = open_result(file)
        histories, case = json_output.histories_of(result), summary.case_of(result)
        told = remarks(histories, result.dataset.attrs)
        written: dict[str, Any] = {"output": file, "picture": picture, "warnings": told}
        return written | json_output.of_run(case, result.case_title, histories)
    if not listeners.quiet:
        drawn = f"; written: {picture}" if picture else ""
        say(f"{file} is finished, all its load steps are there{drawn}")
    return None
