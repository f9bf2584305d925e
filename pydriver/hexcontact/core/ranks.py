"""Processes (ranks) that a launcher of MPI starts together.

The first rank runs the command: it reads the deck and writes the files. The others wait for its orders and
hold their rows of the problems that it sets up. An order is a procedure of `_ORDERS` and its arguments.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import pickle
import signal
import sys
import weakref
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeckError, HexcontactError
from . import flat

# Number of processes, by launcher: Open MPI, MPICH and its relatives, `srun`. Slurm sets SLURM_NTASKS in
# scripts of a single process, too, SLURM_STEP_NUM_TASKS for processes of `srun` alone.
_COUNTS = {
    "OMPI_COMM_WORLD_SIZE": "mpirun",
    "PMI_SIZE": "mpirun",
    "SLURM_STEP_NUM_TASKS": "srun",
}
_WORD = np.dtype(np.int32).itemsize
_END = "end"

count, on_node = 1, 1  # ranks, and those on this machine
_numbers = itertools.count()  # of shared problems
_forgotten: list[int] = []  # problems that the first rank has freed
_parts: dict[int, Part] = {}  # problems of another rank


class Part:
    """The part of a problem on a rank other than the first."""

    def __init__(self, handle: int, lattice: Any) -> None:
        self._handle, self.lattice = handle, lattice
        weakref.finalize(self, flat.free_object, handle)


def _launched() -> tuple[int, str]:
    """Return how many processes a launcher started, and its name."""
    for name, launcher in _COUNTS.items():
        found = os.environ.get(name, "")
        if found.isdecimal() and int(found) > 1:
            return int(found), launcher
    return 1, ""


def refuse_copies(command: str) -> None:
    """Refuse to run a command as one of several copies: each of them would write the same file."""
    launched, launcher = _launched()
    if launched > 1:
        raise DeckError(
            f"{launcher} started {launched} processes; expected one, since {command} does not use MPI. Start "
            f"it without {launcher}, and set OMP_NUM_THREADS to use more cores"
        )


@contextlib.contextmanager
def together() -> Iterator[bool]:
    """Join the processes of a launcher: True on the first, the others serve it until its block ends."""
    global count, on_node
    launched, launcher = _launched()
    if launched == 1:
        yield True
        return
    rank, count, on_node = flat.begin_ranks()
    if count != launched:
        raise DeckError(
            f"{launcher} started {launched} processes; expected one, since this build of hexcontact has no "
            f"MPI, or another than {launcher}. Start it without {launcher}, or install it with -Dmpi=enabled"
        )
    try:
        if rank:
            _serve_to_the_end(rank)
        yield not rank
    finally:
        if not rank:
            _tell(_END)
        count, on_node = 1, 1
        flat.finish_ranks()


def numbered(problem: object) -> int:
    """Return the number of a new problem of all ranks, which forget it with its object on the first one."""
    number = next(_numbers)
    weakref.finalize(problem, _forgotten.append, number)
    return number


def order(name: str, *arguments: Any) -> None:
    """Let the other ranks call a procedure of `_ORDERS`, while the first one calls its own."""
    if count > 1:
        freed, _forgotten[:] = _forgotten[:], []
        _tell(name, freed, *arguments)


def wake(name: str, *arguments: Any) -> NDArray[np.int32]:
    """Return the words of an order, none on one rank, for a solver that sends it by itself."""
    return _words(name, [], *arguments) if count > 1 else np.empty(0, np.int32)


def _words(*order: Any) -> NDArray[np.int32]:
    """Return an order as words."""
    text = pickle.dumps(order)
    return np.frombuffer(text + bytes(-len(text) % _WORD), np.int32).copy()


def _tell(*order: Any) -> None:
    """Send an order to the other ranks."""
    flat.share_words(_words(*order))


def _serve_to_the_end(rank: int) -> None:
    """Follow the orders of the first rank; end the process, and with it all, if that fails."""
    try:
        _serve()
    except BaseException as error:
        print(f"rank {rank}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
        os._exit(HexcontactError.exit_code)


def _serve() -> None:
    """Follow the orders of the first rank; it reports failures, which are those of all ranks."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1):
        signal.signal(number, signal.SIG_IGN)  # the first rank keeps its last step, and ends all
    while True:
        words = np.empty(flat.next_words(), np.int32)
        flat.share_words(words)
        name, *arguments = pickle.loads(words.tobytes())
        if name == _END:
            _parts.clear()
            return
        for freed in arguments.pop(0):
            _parts.pop(freed, None)
        with contextlib.suppress(HexcontactError):
            _ORDERS[name](*arguments)


def _create(number: int, lattice: Any, pair: Any, interface: Any, threads: int) -> None:
    """Set up the part of this rank of a problem."""
    _parts[number] = Part(flat.create_pressed_part(lattice, pair, interface, threads), lattice)


def _press(number: int, control: int, value: float, tolerance: float, max_sweeps: int) -> None:
    """Take part in a solution, of which the first rank keeps the fields."""
    flat.free_object(flat.press(_parts[number], control, value, tolerance, max_sweeps))


def _create_sheared(number: int, lattice: Any, *given: Any) -> None:
    """Set up the part of this rank of a problem with friction."""
    _parts[number] = Part(flat.create_sheared_part(lattice, *given), lattice)


def _follow(number: int) -> None:
    """Take part in a call of the solver of the first rank."""
    flat.follow(_parts[number])


_ORDERS = {"create": _create, "press": _press, "create sheared": _create_sheared, "follow": _follow}
