"""Signals that end a run, and the pipe they come through."""

import os
import signal
import threading
from pathlib import Path

import pytest

from hexcontact.solve.interruption import Interrupted, in_background, signal_pipe

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGUSR1]


def descriptors() -> set[str]:
    return set(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("sent", SIGNALS)
def test_work_that_outlives_its_pipe_writes_into_no_other_file(tmp_path: Path, sent: signal.Signals) -> None:
    go, threads = threading.Event(), set(threading.enumerate())
    with pytest.raises(Interrupted) as caught, signal_pipe() as pipe:
        os.kill(os.getpid(), sent)
        in_background(go.wait, pipe)
    assert caught.value.exit_code == 128 + sent
    # files that take the numbers of the pipe
    paths = [tmp_path / str(number) for number in range(4)]
    files = [path.open("wb") for path in paths]
    assert set(pipe) <= {file.fileno() for file in files}
    go.set()
    for thread in set(threading.enumerate()) - threads:
        thread.join(10.0)
        assert not thread.is_alive()
    for file in files:
        file.close()
    assert [path.stat().st_size for path in paths] == [0, 0, 0, 0]


def test_no_descriptor_and_no_handler_is_left() -> None:
    handlers, before = [signal.getsignal(number) for number in SIGNALS], descriptors()
    done: list[int] = []
    for number in range(3):
        with signal_pipe() as pipe:
            in_background(lambda n=number: done.append(n), pipe)  # type: ignore[misc]
    assert done == [0, 1, 2]
    assert descriptors() == before
    assert [signal.getsignal(number) for number in SIGNALS] == handlers


def test_errors_of_the_work_are_raised() -> None:
    def fail() -> None:
        raise KeyError("work")

    with pytest.raises(KeyError, match="work"), signal_pipe() as pipe:
        in_background(fail, pipe)


def test_signals_that_are_not_heeded_leave_the_work_alone() -> None:
    """Each is asked about; the work goes on to its end."""
    come, asked = threading.Event(), []

    def refuse(signaled: Interrupted) -> bool:
        asked.append(signaled.name)
        if len(asked) == 2:
            come.set()
        return False

    with signal_pipe() as pipe:
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGUSR1)
        in_background(lambda: None if come.wait(10.0) else pytest.fail("no signal came"), pipe, refuse)
    assert sorted(asked) == ["SIGTERM", "SIGUSR1"]
