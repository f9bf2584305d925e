"""What a run exits with when signals come, and what a job that puts itself in line again makes of it."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import commands
import pytest
from commands import ENVIRONMENT

import hexcontact
from hexcontact import Case
from hexcontact.result import store as store_module
from hexcontact.result.journal import Journal, journal_of
from hexcontact.result.netcdf import read_output
from hexcontact.result.step import Step
from hexcontact.result.store import open_result

DECK = commands.DECK.replace("steps = 2", "steps = 4")

# --- signals after the last step --------------------------------------------------------------------------

LATE = """
import atexit, os, sys, time
from hexcontact.cli import app as cli, frame, solving
from hexcontact.result import journal, store

number, sent = int(sys.argv.pop(1)), []
def signaled(module, name):
    original = getattr(module, name)
    def call(*arguments, **options):
        if sent or name == "write":
            os.kill(os.getpid(), number)
            time.sleep(0.02)  # for the thread that waits for it
            sent.append(name)
        return original(*arguments, **options)
    setattr(module, name, call)

signaled(store, "write")  # the output is assembled
signaled(journal.Journal, "remove")
signaled(store.Store, "close")
signaled(solving, "overview")
signaled(solving.Messages, "conclude")
signaled(frame, "write_json")
atexit.register(lambda: (os.kill(os.getpid(), number), sys.stderr.write(" ".join(sent))))
cli.main()
"""

LATE_CASE = """
import os, sys, time
from hexcontact.cli import app
from hexcontact.study.dataset import StudyFolder

note = StudyFolder.note
def late(*arguments):
    os.kill(os.getpid(), {sent})
    time.sleep(0.3)  # for the thread that waits for it
    sys.stderr.write("sent")
    return note(*arguments)
StudyFolder.note = late
app.main()
"""


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGUSR1])
@pytest.mark.parametrize("command", ["run", "resume"])
def test_a_complete_run_exits_with_0_whatever_comes(
    tmp_path: Path, sent: signal.Signals, command: str
) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    out = tmp_path / "sphere.nc"
    if command == "resume":
        stopped(out, 4 if sent == signal.SIGINT else 3)
    name = "sphere.toml" if command == "run" else "sphere.nc"
    words = [sys.executable, "-c", LATE, str(int(sent)), command, name, "-q", "--json"]
    drawn = ["--plot"] if sent == signal.SIGTERM else []  # takes longer than the rest
    done = subprocess.run(
        words + drawn, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    overview = ["overview"] if drawn else []
    assert done.stderr.split() == ["write", "remove", "close", "close", *overview, "conclude", "write_json"]
    assert open_result(out).complete
    picture = ["sphere.png"] if drawn else []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sphere.nc", *picture, "sphere.toml"]


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGUSR1])
def test_a_case_of_a_study_whose_file_is_in_place_exits_with_0(tmp_path: Path, sent: signal.Signals) -> None:
    (tmp_path / "sphere.toml").write_text(DECK)
    (tmp_path / "study.toml").write_text(
        'deck = "sphere.toml"\n[[parameter]]\nkey = "solver.tolerance"\nvalues = [1e-6]\n'
    )
    program = LATE_CASE.format(sent=int(sent))
    words = [sys.executable, "-c", program, "study", "study.toml", "--case", "1", "-q"]
    done = subprocess.run(words, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "sent")
    assert open_result(next(tmp_path.glob("study/0001.nc"))).complete


def stopped(out: Path, after: int) -> None:
    """Leave a run that was interrupted after a step; after all of them: before its output."""
    case = Case.from_text(DECK)

    def stop(step: Step) -> None:
        if step.number == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        case.run(out, on_step=stop)
    assert len(Journal(journal_of(out))) == after


# --- a job that puts itself in line again -----------------------------------------------------------------


def nothing(out: Path) -> None:
    pass


def before_the_first_step(out: Path) -> None:
    """As SIGKILL leaves it."""
    journal_of(out).mkdir()
    (journal_of(out) / "lock").write_text("")


def after_two_steps(out: Path) -> None:
    stopped(out, 2)


def with_an_interim_output(out: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store_module, "PUBLISH_INTERVAL", 0.0)
        stopped(out, 3)
    assert not read_output(out).complete


def without_its_output(out: Path) -> None:
    stopped(out, 4)


def complete(out: Path) -> None:
    Case.from_text(DECK).run(out)


@pytest.mark.parametrize(
    "state",
    [
        *(nothing, before_the_first_step, after_two_steps, with_an_interim_output, without_its_output),
        complete,
    ],
)
def test_one_command_starts_and_resumes_in_every_state(tmp_path: Path, state: Callable[[Path], None]) -> None:
    (tmp_path / "fretting.toml").write_text(DECK)
    state(tmp_path / "fretting.nc")
    done = subprocess.run(
        [sys.executable, "-m", "hexcontact", "run", "fretting.toml", "--resume"],
        cwd=tmp_path,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert open_result(tmp_path / "fretting.nc").complete
    assert not journal_of(tmp_path / "fretting.nc").exists()


def test_a_run_is_sent_to_resume_wherever_steps_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for state in (after_two_steps, with_an_interim_output, without_its_output):
        out = tmp_path / f"{state.__name__}.nc"
        state(out)
        with pytest.raises(
            hexcontact.DeckError,
            match=rf"holds \d finished steps of an unfinished run; hexcontact resume {out} continues it, ",
        ):
            Case.from_text(DECK).run(out)
    again = tmp_path / "again.nc"
    shutil.copy(tmp_path / "with_an_interim_output.nc", again)  # without its steps
    with pytest.raises(hexcontact.DeckError, match="exists already; --overwrite"):
        Case.from_text(DECK).run(again)


# --- signals at random moments ----------------------------------------------------------------------------


def test_signals_at_random_moments_leave_what_the_code_says(tmp_path: Path) -> None:
    """10 runs, signaled in the course of their time: 0 for a complete result, else one that can go on."""
    command = [
        sys.executable,
        str(Path(__file__).with_name("killed_runs.py")),
        str(tmp_path),
        "10",
        "3",
        "signals",
    ]
    done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, timeout=3600)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    *runs, signals = done.stdout.splitlines()
    assert len(runs) == 10
    assert int(signals.removeprefix("signals ")) > 5
