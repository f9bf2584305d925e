"""Processes that a launcher of MPI starts together."""

from __future__ import annotations

import os

from ..errors import DeckError

# Number of processes, by launcher: Open MPI, MPICH and its relatives, `srun`. Slurm sets SLURM_NTASKS in
# scripts of a single process, too, SLURM_STEP_NUM_TASKS for processes of `srun` alone.
_COUNTS = {
    "OMPI_COMM_WORLD_SIZE": "mpirun",
    "PMI_SIZE": "mpirun",
    "SLURM_STEP_NUM_TASKS": "srun",
}


def refuse_copies() -> None:
    """Refuse to run as one of several copies: each of them would write the same file."""
    for name, launcher in _COUNTS.items():
        count = os.environ.get(name, "")
        if count.isdecimal() and int(count) > 1:
            raise DeckError(
                f"{launcher} started {count} processes; expected one, since this build of hexcontact has no "
                f"MPI. Start it without {launcher}, and set OMP_NUM_THREADS to use more cores"
            )
