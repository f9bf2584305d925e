"""Signals that end a run: work is done in a second thread while the first one waits, for it and for them."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)  # the last comes from Slurm, before a time limit


class Interrupted(BaseException):
    """A signal has come that ends the run."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.name = signal.Signals(number).name
        self.exit_code = 128 + number


@contextlib.contextmanager
def news() -> Iterator[tuple[int, int]]:
    """Open a pipe into which the signals that end a run put their numbers, in the order they come.

    They raise nothing, wherever they come, so that leaving is not interrupted by those that follow.
    """
    old = {number: signal.getsignal(number) for number in _SIGNALS}
    heeded = {number: handler for number, handler in old.items() if handler not in (signal.SIG_IGN, None)}
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    former = signal.set_wakeup_fd(writer)
    try:
        for number in heeded:
            signal.signal(number, lambda *_: None)
        yield reader, writer
    finally:
        for number, handler in heeded.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(former)
        os.close(reader)
        os.close(writer)


def in_background(work: Callable[[], None], heard: tuple[int, int]) -> None:
    """Do `work` in a second thread while this one waits for it, and for signals.

    The compiled core cannot be interrupted; a thread that waits can.
    """
    reader, writer = heard
    raised: list[BaseException] = []

    def worker() -> None:
        try:
            work()
        except BaseException as error:
            raised.append(error)
        os.write(writer, bytes([0]))  # is the number of no signal

    threading.Thread(target=worker, daemon=True).start()
    if number := os.read(reader, 1)[0]:
        raise Interrupted(number)
    if raised:
        raise raised[0]
