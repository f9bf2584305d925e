"""The messages of a command that solves: progress, log, and tables or an object at its end."""

from __future__ import annotations

import contextlib
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from ..core import ranks
from ..errors import AccuracyWarning, DeckError
from ..files import require_replaceable, temporary_of
from ..problem.preview import parameters_of
from ..problem.problem import Problem
from ..result.history_words import Extent, extent_of
from ..result.netcdf import missing_stresses, stress_files
from ..result.step import Step
from ..result.store import Store, open_result
from ..solve import events
from ..solve import run as solving
from ..solve.events import Listener, reporter
from ..solve.interruption import Interrupted, in_background
from ..text import listed, visible
from . import printed
from .frame import LogLevel, Report, print_error, print_output, write_json


@dataclass(frozen=True)
class Messages:
    """Print the messages of a command that solves, as its options say."""

    command: str  # its name
    quiet: bool = False  # print errors only
    as_json: bool = False  # print an object instead of tables at the end
    log_file: Path | None = None
    log_level: LogLevel | None = None

    def __post_init__(self) -> None:
        if self.quiet and self.log_level and self.log_file is None:
            raise DeckError("--log-level: expected --log-file with it, since --quiet prints nothing")

    def logging(self, *spare: Path) -> contextlib.AbstractContextManager[None]:
        """Write the log, but not into the files `spare` that the command reads or writes."""
        return events.log_to(self.log_file, self.log_level, spare)

    @contextlib.contextmanager
    def of_all_ranks(self, *spare: Path) -> Iterator[None]:
        """Write the log as `logging`, on the first process of a launcher; the others serve it."""
        with ranks.together() as first:
            if not first:
                raise SystemExit  # the first one prints
            with self.logging(*spare):
                yield

    @property
    def silent(self) -> bool:
        """Whether no progress is shown: if quiet, or if the log is shown instead."""
        return self.quiet or (self.log_level is not None and self.log_file is None)

    def interrupted(self, signaled: Interrupted, saved: str, **about: Any) -> NoReturn:
        """Report the saved steps after a signal and end the process, also while the core computes."""
        message = f"interrupted; {saved}"
        with contextlib.suppress(OSError):  # standard error may be closed
            events.logger.error(events.words("stopped", reason=f"interrupted ({signaled.name})", **about))
            events.logger.disabled = True  # for threads that still run
            print_error(message)
            if self.as_json:
                write_json(self.command, Report(message, signaled.exit_code).content())
            sys.stdout.flush()
            sys.stderr.flush()
        ranks.leave(signaled.exit_code)

    def conclude(
        self,
        case: Problem,
        store: Store,
        extent: Extent | None,
        target: Path,
        picture: Path | None,
        warning: str = "",
    ) -> dict[str, Any] | None:
        """Print or return the result of a run, with a message on an accuracy that was not reached.

        The finest lattice of a refined one, with errors, is read from the result.
        """
        histories, shortfall = [step.history for step in store.heads], ""
        summary = printed.Summary(case.title, histories, parameters_of(case), case.deck_text, None, extent)
        if case.accuracy:
            refined = open_result(target)
            summary, shortfall = printed.Summary.of_result(refined), refined.shortfall
        if shortfall:
            print_error(shortfall)
        if self.as_json:
            code = AccuracyWarning.exit_code if shortfall else 0
            notes = list(filter(None, (warning, *summary.remarks, shortfall)))
            written = {"output": target, "picture": picture, "warnings": notes, "exit_code": code}
            return written | summary.as_run()
        if not self.quiet:
            summary.print()
            files = [target, *stress_files(case.deck_text, target).values(), *([picture] if picture else [])]
            printed.console().print(visible(f"written: {', '.join(map(str, files))}"), soft_wrap=True)
        if shortfall:
            raise SystemExit(AccuracyWarning.exit_code)
        return None

    def was_finished(self, file: Path, picture: Path | None) -> dict[str, Any] | None:
        """Print or return that all load steps were finished before."""
        if self.as_json:
            summary = printed.Summary.of_result(open_result(file))
            written = {"output": file, "picture": picture, "warnings": summary.remarks}
            return written | summary.as_run()
        if not self.quiet:
            drawn = f"; written: {picture}" if picture else ""
            print_output(f"{file} is finished and has all its load steps{drawn}")
        return None


def solved(
    case: Problem,
    store: Store,
    pipe: tuple[int, int],
    name: str,
    messages: Messages,
    before: Sequence[Step] = (),
) -> Extent | None:
    """Solve a case into a store; return the extent of the last contact.

    Signals end the process. If the last step is finished, the output is completed first.
    """
    late: list[Interrupted] = []

    def ends(signaled: Interrupted) -> bool:
        if not store.has_all_steps:
            store.close(f"interrupted ({signaled.name})")
            if not store.finished:
                return True
        late.append(signaled)
        return False

    extent: Extent | None = None

    def note(step: Step) -> None:
        nonlocal extent
        extent = extent_of(step)

    listener = solving.listeners(case, reporter(messages.silent), note)
    title = (case.title or name) + (f", after step {len(before)}" if before else "")
    try:
        with listener.following(title, case.planned_steps):
            in_background(lambda: solving.solve_into(case, store, listener, before), pipe, ends)
            if store.finished:
                with_tables(store.path, pipe, messages, listener, late, case)
    except Interrupted as signaled:
        messages.interrupted(signaled, store.kept or "no load step was finished", done=len(store.heads))
    return extent


def with_tables(
    output: Path,
    pipe: tuple[int, int],
    messages: Messages,
    listener: Listener | None = None,
    late: Sequence[Interrupted] = (),
    case: Problem | None = None,
) -> None:
    """Write the missing tables [[stress]] and [[fatigue]] of a result; signals end the process."""
    if not (missing := missing_stresses(output)):
        return
    try:
        for signaled in late:  # while the output was completed
            raise signaled
        in_background(lambda: solving.write_stresses(output, case, listener), pipe)
    except Interrupted as signaled:
        if missing := missing_stresses(output):
            for path in missing.values():
                temporary_of(path).unlink(missing_ok=True)
            wanted = f"the table{'s' * (len(missing) > 1)} {listed([*missing], 'and')}"
            resume = f"hexcontact resume {shlex.quote(str(output))}"
            messages.interrupted(signaled, f"all load steps are in {output}; to compute {wanted}: {resume}")


def overview(path: Path) -> Path:
    """Draw a result beside its file."""
    from .plot import picture_of

    return picture_of([open_result(path)], "overview", picture_beside(path), {})


def picture_beside(path: Path) -> Path:
    """Return the picture beside a result; DeckError if another file has its name."""
    picture = path.with_suffix(".png")
    require_replaceable(picture)
    return picture
