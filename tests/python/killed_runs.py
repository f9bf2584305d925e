"""Kill runs at random moments and resume them; started by test_resume.py with one thread.

Each run is a fork of this process, which has loaded everything but solved nothing; that takes milliseconds
where a new process takes a second. ``python killed_runs.py FOLDER COUNT SEED`` prints for each run
when it was killed, and how many finished steps there were. With ``signals`` behind, it is the command that
runs, and gets signals instead; with ``wear``, the surfaces wear.
"""

import builtins
import os
import random
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4  # noqa: F401
import numpy as np
import psutil  # noqa: F401
import rich.table  # noqa: F401
import xarray  # noqa: F401

import hexcontact
from hexcontact.case import Case
from hexcontact.cli import app as cli
from hexcontact.cli import run, solving  # noqa: F401
from hexcontact.result import journal, store
from hexcontact.result.journal import Journal, journal_of
from hexcontact.result.step import Step

warnings.simplefilter("ignore", hexcontact.PlausibilityWarning)  # of the coarse lattice
CALLS = (  # what a run does to the disk
    *((os, name) for name in ("fsync", "replace", "unlink", "rmdir", "ftruncate", "pwrite", "mkdir", "open")),
    (journal, "write_record"),
    (store, "write"),
    (builtins, "open"),
)
MOST_KILLS = 3  # of one run
LONGEST = 60  # seconds of a process: hundred times what it takes, whatever else the machine does
PRESS_AND_SHEAR = [{"normal_load": 20.0, "steps": 3}, {"tangential_load_x": 1.0, "steps": 3}]


def made() -> Case:
    """Return a case of six steps, some milliseconds each; with cycles of wear after them if asked for."""
    changes: dict[str, Any] = {"loads": PRESS_AND_SHEAR}
    if "wear" in sys.argv[4:]:
        to_and_fro = {"label": "cycle", "path": [{"tangential_load_x": 2.0}, {"tangential_load_x": 0.0}]}
        wear = {"coefficient_1": 1e-14, "cycle": "cycle", "cycles": 80, "jump": 20}
        changes = {"loads": [{"normal_load": 20.0, "tangential_load_x": 0.0}, to_and_fro], "wear": wear}
    sphere = {"young_modulus": 432e9, "poisson_ratio": 0.32, "surface": {"shape": "sphere", "radius": 1e-3}}
    return Case(
        body_1=sphere,
        body_2={"young_modulus": 72e9, "poisson_ratio": 0.32},
        nodes_in_radius=3,
        friction_coefficient=0.2,
        **changes,
    )


def in_fork(work: Callable[[], object], delay: float | None = None) -> int:
    """Do `work` in a process of its own, killed after `delay` seconds; return its status, 0 if it is done."""
    child = os.fork()
    if child == 0:
        signal.alarm(LONGEST)
        code = 1
        try:
            work()
            code = 0
        except BaseException:
            traceback.print_exc()
        os._exit(code)
    if delay is not None:
        time.sleep(delay)
        os.kill(child, signal.SIGKILL)
    return os.waitpid(child, 0)[1]


def dying(work: Callable[[], object], calls: int, before: bool) -> Callable[[], object]:
    """Have `work` end itself at the given one of its calls to the system, before or after it."""
    left = calls

    def replaced(original: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            nonlocal left
            left -= 1
            if left == 0 and before:
                os.kill(os.getpid(), signal.SIGKILL)
            try:
                return original(*arguments, **options)
            finally:
                if left == 0:
                    os.kill(os.getpid(), signal.SIGKILL)

        return call

    def work_with_calls_counted() -> None:
        store.PUBLISH_INTERVAL = 0.0  # interim outputs, too
        for module, name in CALLS:
            setattr(module, name, replaced(getattr(module, name)))
        work()

    return work_with_calls_counted


def steps_of(out: Path) -> int:
    """Return how many steps can be opened, as a process of its own finds."""
    reader, writer = os.pipe()

    def look() -> None:
        try:
            result = hexcontact.open_result(out)
        except hexcontact.DeckError as error:
            assert "there is no file" in str(error), error
            number = 0
        else:
            number = len(result)
            assert np.isfinite(result.dataset["pressure"].values).all()
        os.write(writer, bytes([number]))

    assert in_fork(look) == 0
    number = os.read(reader, 1)[0]
    os.close(reader)
    os.close(writer)
    return number


def main(folder: Path, count: int, seed: int) -> None:
    """Kill and resume `count` runs."""
    rng = random.Random(seed)
    assert in_fork(lambda: made().run(folder / "whole.nc")) == 0
    began = time.monotonic()
    assert in_fork(lambda: made().run(folder / "timed.nc")) == 0
    duration = time.monotonic() - began
    kills = 0
    for number in range(count):
        out = folder / f"{number}.nc"
        committed = folder / f"{number}.txt"
        story: list[str] = []
        kept = 0
        for attempt in range(MOST_KILLS + 1):

            def note(step: Step, path: Path = committed) -> None:
                path.write_bytes(bytes([step.number]))

            def work(out: Path = out, note: Callable[[Step], None] = note) -> None:
                if not out.exists() and not Journal(journal_of(out)):
                    made().run(out, on_step=note)
                else:
                    hexcontact.resume(out, on_step=note)

            if attempt == MOST_KILLS:
                status = in_fork(work)
            elif rng.random() < 0.5:
                calls, before = rng.randint(1, 100), rng.random() < 0.5
                status = in_fork(dying(work, calls, before))
                story.append(f"call {calls} {'before' if before else 'after'}")
            else:
                delay = rng.uniform(0.0, duration)
                status = in_fork(work, delay)
                story.append(f"{delay:.4f} s")
            if status == 0:
                break
            assert os.waitstatus_to_exitcode(status) == -signal.SIGKILL, (
                f"{out}: {story}: failed with {status}"
            )
            kills += 1
            told = committed.read_bytes() if committed.exists() else b""
            known, kept = max(kept, *told, 0), steps_of(out)
            assert kept >= known, f"{out}: {story}: {known} steps were finished, {kept} are there"
            story.append(f"{kept} steps")
        print(number, *story, "finished", sep=", ", flush=True)
    print("kills", kills)


def commanded(words: list[str], sent: signal.Signals, delay: float | None = None) -> int:
    """Run the command in a process of its own, signaled after `delay` seconds; return its exit code."""

    def work() -> None:
        devnull = os.open(os.devnull, os.O_WRONLY)
        os.dup2(devnull, 1)
        os.dup2(devnull, 2)
        sys.argv = ["hexcontact", *words]
        try:
            cli.main()
        except KeyboardInterrupt:
            os._exit(130)
        except SystemExit as ending:
            time.sleep(0.01)  # for a signal that comes as the process ends
            os._exit(ending.code if isinstance(ending.code, int) else 1)

    child = os.fork()
    if child == 0:
        signal.alarm(LONGEST)
        work()
        os._exit(0)
    if delay is not None:
        time.sleep(delay)
        os.kill(child, sent)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def signaled(folder: Path, count: int, seed: int) -> None:
    """Signal `count` runs of the command until they are complete; compare codes with what is there."""
    rng = random.Random(seed)
    deck = folder / "deck.toml"
    deck.write_text(made().deck_text)
    began = time.monotonic()
    assert commanded(["run", str(deck), "-o", str(folder / "timed.nc")], signal.SIGTERM) == 0
    duration = time.monotonic() - began
    signals = 0
    for number in range(count):
        out = folder / f"{number}.nc"
        story: list[str] = []
        for attempt in range(MOST_KILLS + 1):
            there = out.exists() or bool(Journal(journal_of(out)))
            words = ["resume", str(out)] if there else ["run", str(deck), "-o", str(out)]
            sent = rng.choice([signal.SIGINT, signal.SIGTERM, signal.SIGUSR1])
            delay = rng.uniform(0.0, duration) if attempt < MOST_KILLS else None
            code = commanded(words, sent, delay)
            story += [words[0], sent.name, f"{delay or 0.0:.4f} s", str(code)]
            signals += delay is not None
            whole = out.exists() and in_fork(lambda out=out: _assert_complete(out)) == 0  # type: ignore[misc]
            # before the command has taken the signals over they have their usual effect
            assert code in ((0,) if whole else (128 + sent, -sent)), f"{out}: {story}"
            if whole:
                break
        print(number, *story, sep=", ", flush=True)
    print("signals", signals)


def _assert_complete(out: Path) -> None:
    if not store.read_output(out).complete:
        os._exit(3)


if __name__ == "__main__":
    work = signaled if "signals" in sys.argv[4:] else main
    work(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
