"""Processes (ranks) that a launcher of MPI starts together.

The first rank runs the command: it reads the deck and writes the files. The others wait for its orders. An
order is a procedure with its arguments: all ranks call it together, or one rank alone, whose answer the first
one takes.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import pickle
import signal
import sys
import threading
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .. import launcher
from ..arrays import Array
from ..errors import HexcontactError, ResourceError
from . import flat
from .calls import status_of
from .lattice import Lattice

_PATIENCE = 5.0  # seconds in which a launcher ends all processes
_WORD = np.dtype(np.int32).itemsize

rank, count, on_node = 0, 1, 1  # this rank; ranks, and those on this machine
signaled = 0  # a signal that this rank has received, not the first one
held: dict[int, Any] = {}  # the part of this rank of each object that all ranks share
_numbers = itertools.count()
_forgotten: list[int] = []  # objects that the first rank has freed


def leave(code: int) -> NoReturn:
    """End this process at once with an exit code, and all ranks with it."""
    if count > 1:
        threading.Timer(_PATIENCE, os._exit, [code]).start()
        flat.kill_ranks(code)
    os._exit(code)


@contextlib.contextmanager
def together() -> Iterator[bool]:
    """Join the processes of a launcher: True on the first, the others serve it until its block ends."""
    global rank, count, on_node
    launched, name, _ = launcher.copies()
    if launched == 1:
        yield True
        return
    rank, count, on_node = flat.begin_ranks()
    if count != launched:
        launcher.refuse_copies(
            f"this build of hexcontact has no MPI, or another than {name}", "or install it with -Dmpi=enabled"
        )
    launcher.joined = True
    try:
        if rank:
            _serve_to_the_end()
        yield not rank
    finally:
        if not rank:
            others(_end)
        launcher.joined, rank, count, on_node = False, 0, 1, 1
        flat.finish_ranks()


def _end() -> None:
    """End the service of the other ranks."""


def new_number() -> int:
    """Return the number of a new object of all ranks."""
    return next(_numbers)


def numbered(owner: object) -> int:
    """Return the number of a new object of all ranks, which forget it with its owner on the first one."""
    number = new_number()
    weakref.finalize(owner, _forget, number).atexit = False
    return number


def _forget(number: int) -> None:
    """Free the own part of an object, and those of the other ranks with the next order."""
    held.pop(number, None)
    _forgotten.append(number)


def others(procedure: Callable[..., Any], *arguments: Any) -> None:
    """Let the other ranks call a procedure, of which they report no failures."""
    if count > 1:
        freed = [_forgotten.pop() for _ in range(len(_forgotten))]
        words = _words(procedure, arguments, freed, False)
        for other in range(1, count):
            flat.send_words(words, other)


def order(procedure: Callable[..., Any], *arguments: Any) -> Any:
    """Let all ranks call a procedure, which raises an error on all of them or on none; return its result."""
    others(procedure, *arguments)
    return procedure(*arguments)


def _words(*order: Any) -> NDArray[np.int32]:
    """Return an order as words."""
    text = pickle.dumps(order)
    return np.frombuffer(text + bytes(-len(text) % _WORD), np.int32).copy()


def give(other: int, procedure: Callable[..., Any], *arguments: Any) -> None:
    """Let one rank call a procedure, of which it reports no failures."""
    if other == rank:
        procedure(*arguments)
    else:
        flat.send_words(_words(procedure, arguments, (), False), other)


def ask(other: int, procedure: Callable[..., Array], *arguments: Any, shape: tuple[int, int]) -> Array:
    """Return the array that a procedure returns on a rank."""
    if other == rank:
        return procedure(*arguments)
    flat.send_words(_words(procedure, arguments, (), True), other)
    words = flat.receive_words(other, 2 * shape[0] * shape[1])
    return np.asarray(words).view(np.float64).reshape(shape)


@contextlib.contextmanager
def agreed() -> Iterator[None]:
    """Raise the error of the first rank that has one on all ranks, which enter this block together."""
    status, words = 0, ""
    try:
        yield
    except HexcontactError as error:
        status, words = status_of(error), str(error)
    except MemoryError as error:
        status, words = status_of(ResourceError()), str(error) or "not enough memory"
    flat.agree(status, words)


def least(value: float) -> float:
    """Return the smallest of a value of all ranks."""
    return float(flat.least_of_ranks(value))


def obey_signals() -> None:
    """Raise a signal that another rank has received on the first one, which ends all."""
    if number := -int(order(_noted)):
        signal.raise_signal(number)


def _noted() -> float:
    """Return a signal that a rank has noted, with the sign changed."""
    return least(-signaled)


def _note(number: int, _: Any) -> None:
    """Keep a signal until the first rank asks for it, after its load step."""
    global signaled
    signaled = number


def rows(lattice: Lattice, of: int | None = None) -> Lattice:
    """Return the window of the rows of a rank, by default this one."""
    first, after = map(int, flat.rows_of_rank(rank if of is None else of, lattice.n_row))
    return replace(lattice, row_first=lattice.row_first + first, n_row=after - first)


def share(lattice: Lattice) -> bool:
    """Test whether all ranks share the rows of a window: one that is not too small."""
    return count > 1 and bool(flat.shares_window(lattice.extent))


def _serve_to_the_end() -> None:
    """Follow the orders of the first rank; end the process, and with it all, if that fails."""
    try:
        _serve()
    except BaseException as error:
        print(f"rank {rank}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
        leave(HexcontactError.exit_code)


def _serve() -> None:
    """Follow the orders of the first rank; it reports failures, which are those of all ranks."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1):
        signal.signal(number, _note)
    while True:
        procedure, arguments, freed, answers = pickle.loads(
            flat.receive_words(0, flat.wait_for_words()).tobytes()
        )
        if procedure is _end:
            break
        for number in freed:
            held.pop(number, None)
        if answers:
            flat.send_words(np.ascontiguousarray(procedure(*arguments)).view(np.int32).ravel(), 0)
            continue
        with contextlib.suppress(HexcontactError):
            procedure(*arguments)
        del procedure, arguments
    held.clear()
