"""Signals that end a run: work is done in a second thread while the first one waits, for it and for them."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)  # the last comes from Slurm, before a time limit

ends_process = False  # whether it ends with the command: then no signal changes its exit code any more


class Interrupted(BaseException):
    """A signal has come that ends the run."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.name = signal.Signals(number).name
        self.exit_code = 128 + number


@contextlib.contextmanager
def signal_pipe() -> Iterator[tuple[int, int]]:
    """Open a pipe into which the signals that end a run put their numbers, in the order they come.

    They raise nothing, wherever they come, so that leaving is not interrupted by those that follow.
    """
    old = {number: signal.getsignal(number) for number in _SIGNALS}
    handled = {number: handler for number, handler in old.items() if handler not in (signal.SIG_IGN, None)}
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    former = signal.set_wakeup_fd(writer)
    try:
        for number in handled:
            signal.signal(number, lambda *_: None)
        yield reader, writer
    finally:
        for number, handler in handled.items():
            signal.signal(number, signal.SIG_IGN if ends_process else handler)
        signal.set_wakeup_fd(former)
        os.close(reader)
        os.close(writer)


def in_background(
    work: Callable[[], object], pipe: tuple[int, int], ends: Callable[[Interrupted], bool] = lambda _: True
) -> None:
    """Do `work` in a second thread while this one waits for it, and for signals.

    The compiled core cannot be interrupted; a thread that waits can.

    Parameters
    ----------
    work : callable
        What to do.
    pipe : tuple of int
        The pipe of `signal_pipe`.
    ends : callable
        Tells whether a signal ends the work; if not, it goes on.

    Raises
    ------
    Interrupted
        If a signal ends the work; the thread may still be at it.
    """
    reader, writer = pipe
    raised: list[BaseException] = []
    own = os.dup(writer)  # the pipe may be closed by the time, and its number be that of another file

    def worker() -> None:
        try:
            work()
        except BaseException as error:
            raised.append(error)
        with contextlib.suppress(OSError):  # nobody waits any more
            os.write(own, bytes([0]))  # is the number of no signal
        os.close(own)

    thread = threading.Thread(target=worker, daemon=True)
    thread.start()
    while number := os.read(reader, 1)[0]:
        if ends(signaled := Interrupted(number)):
            raise signaled
    thread.join()
    if raised:
        raise raised[0]
