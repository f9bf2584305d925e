"""What `hexcontact study` shows and prints: progress, the list of failures, a Slurm job array."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..solve.interruption import Interrupted, in_background
from ..study.backend import BACKENDS
from ..study.study import Outcome, Study
from .guard import complain, say

if TYPE_CHECKING:
    from .run_command import Listeners

FAILED = 3  # exit code of a study of which some cases failed
_MOST_TOLD = 20  # failures listed at the end


def report(study: Study, quiet: bool) -> int:
    """Say what is there, what failed and why; return the exit code."""
    done = sum(study.folder.done(case) for case in study.cases)
    failures = study.failures()
    if not quiet:
        say(f"written: {study.output}, {done} of {len(study)} cases (their files in {study.folder.folder}/)")
    if done == len(study):
        return 0
    for case, outcome in failures[:_MOST_TOLD]:
        words = outcome.message.splitlines()[0]
        complain(f"case {study.folder.number(case)} ({case}) failed: {words}")
    if len(failures) > _MOST_TOLD:
        complain(f"... and {len(failures) - _MOST_TOLD} more; all are in {study.output}")
    missing = len(study) - done - len(failures)
    if missing:
        complain(f"{missing} of {len(study)} cases have not been run")
    if any(outcome.lasting for _, outcome in failures):
        complain("--retry runs cases again that failed by themselves")
    return FAILED


def interrupted(study: Study) -> str:
    """Say what is kept of a study that was interrupted."""
    done = sum(study.folder.done(case) for case in study.cases)
    return (
        f"{done} of {len(study)} cases are finished and kept in {study.folder.folder}/; "
        "the same command runs the rest"
    )


def run_case(study: Study, number: int, retry: bool, listeners: Listeners, pipe: tuple[int, int]) -> Outcome:
    """Run one case for a job array; signals end the process unless it is done, and what is finished stays."""
    from ..solve.progress import reporter

    outcomes: list[Outcome] = []
    shown = reporter(listeners.silent)
    try:
        in_background(
            lambda: outcomes.append(study.run_case(number, retry, shown)),
            pipe,
            lambda _: not (outcomes or study.has(number)),
        )
    except Interrupted as signaled:
        listeners.leave(
            signaled,
            f"the finished load steps of case {number} are kept; the same command goes on after them",
        )
    return outcomes[0]


def run_in_background(
    study: Study, cancel: threading.Event, options: dict[str, Any]
) -> tuple[Callable[[], None], Callable[[Interrupted], bool]]:
    """Return what to do in a second thread, and what cancels it, unless the study is complete by then."""
    over, complete = threading.Event(), threading.Event()
    kind, settings = study.backend(options.get("jobs"), options.get("dask"))
    kind.load(settings)

    def work() -> None:
        try:
            if study.run(cancel=cancel, **options) is not None:
                complete.set()
        finally:
            over.set()

    def ends(_: Interrupted) -> bool:
        cancel.set()
        over.wait()
        return not complete.is_set()

    return work, ends


def slurm_script(study: Study, path: Path, retry: bool) -> str:
    """Return a job array that runs the missing cases; empty if there are none."""
    numbers = sorted(study.folder.number(case) for case in study.missing(retry))
    array = BACKENDS["slurm"](study.file.slurm, len(study))
    return array.script(numbers, path, study.output, retry) if numbers else ""
