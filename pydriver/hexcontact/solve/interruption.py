"""Signals that end a run: a second thread works while the first waits for it and for signals."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import threading
from collections.abc import Callable, Iterator

from ..netcdf_library import LOCK

_ARENA_MAX = -8  # option of mallopt
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)  # the last comes from Slurm, before a time limit

ends_process = False  # whether the process ends with the command, and ignores signals from then on


class Interrupted(BaseException):
    """Raised by a signal that ends the run."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.name = signal.Signals(number).name
        self.exit_code = 128 + number


@contextlib.contextmanager
def signal_pipe() -> Iterator[tuple[int, int]]:
    """Open a pipe that takes the numbers of signals that end a run, in their order.

    The signals raise nothing, so that a later one does not interrupt the end of the run.
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
    """Call `work` in a second thread while this one waits for it and for signals.

    A signal cannot interrupt the compiled core, but it can interrupt a waiting thread. A signal that `ends`
    the work raises Interrupted; the thread may continue for a while.
    """
    reader, writer = pipe
    raised: list[BaseException] = []
    own = os.dup(writer)  # once the pipe is closed, its number may be that of another file

    def worker() -> None:
        try:
            work()
        except BaseException as error:
            raised.append(error)
        with contextlib.suppress(OSError):  # the waiting thread has ended
            os.write(own, bytes([0]))  # 0 is not the number of a signal
        os.close(own)

    # one heap for all threads: free memory of a second one does not go back to the system
    with contextlib.suppress(AttributeError, OSError):  # glibc alone has this
        ctypes.CDLL(None).mallopt(_ARENA_MAX, 1)
    thread = threading.Thread(target=worker, daemon=True)
    LOCK.waiting += 1
    try:
        thread.start()
        while number := os.read(reader, 1)[0]:
            if ends(signaled := Interrupted(number)):
                raise signaled
        thread.join()
    finally:
        LOCK.waiting -= 1
    if raised:
        raise raised[0]
