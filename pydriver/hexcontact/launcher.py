"""Launchers of MPI and Slurm, which start a command as several processes."""

from __future__ import annotations

import os
from typing import NamedTuple

from .errors import DeckError

# Variables with the number of processes and that of this one, by launcher: Open MPI, MPICH and its relatives,
# `srun`. Slurm sets SLURM_NTASKS in scripts of a single process, too, SLURM_STEP_NUM_TASKS for processes of
# `srun` alone.
_COUNTS = {
    "OMPI_COMM_WORLD_SIZE": ("OMPI_COMM_WORLD_RANK", "mpirun"),
    "PMI_SIZE": ("PMI_RANK", "mpirun"),
    "SLURM_STEP_NUM_TASKS": ("SLURM_PROCID", "srun"),
}

joined = False  # whether the processes work together


class Copies(NamedTuple):
    """Processes of a launcher that work alone: 1 without one, or where they work together."""

    total: int
    launcher: str = ""
    number: str = "0"  # of this one


def copies() -> Copies:
    """Return the processes of the launcher that started this one."""
    for name, (number, launcher) in _COUNTS.items():
        found = os.environ.get(name, "")
        if found.isdecimal() and int(found) > 1 and not joined:
            return Copies(int(found), launcher, os.environ.get(number, "0"))
    return Copies(1)


def leave_to_first(exit_code: int = 0) -> None:
    """End the other processes of a launcher, so that only the first one works and prints."""
    if copies().number != "0":
        raise SystemExit(exit_code)


def refuse_copies(reason: str, advice: str) -> None:
    """Refuse to be one of several processes."""
    number, launcher, _ = copies()
    if number > 1:
        leave_to_first(DeckError.exit_code)
        raise DeckError(
            f"{launcher} started {number} processes; expected one, since {reason}. "
            f"Start it without {launcher}, {advice}"
        )
