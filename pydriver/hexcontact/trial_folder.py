"""The lattices of an unfinished run that refines, in the journal of its output.

``out.nc.d/lattices/trials.json`` holds the histories of the lattices that are finished. The load steps of the
lattice at work, and of the finest finished one, are in journals of their own beside it: ``2_0.nc.d`` is level
2, not shifted.
"""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .accuracy import Solution
from .errors import DeckError
from .netcdf import flush, reading
from .result import Metadata, Result

if TYPE_CHECKING:
    from .store import Journal

VERSION = 1
FOLDER = "lattices"  # in the journal


class TrialFolder:
    """The lattices of an unfinished run.

    Parameters
    ----------
    journal : Path
        The journal of the output.
    """

    def __init__(self, journal: Path) -> None:
        self.folder = journal / FOLDER
        self.ledger = self.folder / "trials.json"

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return self.ledger.exists()

    def path(self, level: int, copy: int = 0) -> Path:
        """Return what the output of a lattice would be called; its journal is beside it."""
        return self.folder / f"{level}_{copy}.nc"

    def read(self) -> tuple[Metadata, list[Solution]]:
        """Return where the run comes from, and the finished lattices.

        Raises
        ------
        DeckError
            If the file is damaged or of another version.
        """
        path = self.ledger
        with reading(path, "a list of finished lattices"):
            about = json.loads(path.read_bytes())
            if about["trials_version"] != VERSION:
                raise DeckError(
                    f"{path} has the layout {about['trials_version']}; this version reads {VERSION}"
                )
            found = [
                Solution(**{**solution, "origin": tuple(solution["origin"])})
                for solution in about["solutions"]
            ]
            return Metadata.from_plain(about["metadata"]), found

    def write(self, metadata: Metadata, solutions: Sequence[Solution]) -> None:
        """Put the finished lattices on the disk, in one go."""
        self.folder.mkdir(exist_ok=True)
        about = {
            "trials_version": VERSION,
            "metadata": dataclasses.asdict(metadata),
            "solutions": [dataclasses.asdict(solution) for solution in solutions],
        }
        temporary = self.folder / "trials.json.tmp"
        with temporary.open("w", encoding="utf-8") as file:
            json.dump(about, file, default=np.generic.item)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, self.ledger)
        flush(self.folder)

    def drop(self, level: int, copy: int = 0) -> None:
        """Delete the load steps of a lattice."""
        from .store import journal_of

        shutil.rmtree(journal_of(self.path(level, copy)), ignore_errors=True)

    def _latest(self) -> tuple[int, Journal]:
        """Return the level of the finest finished lattice, else 0, and its load steps."""
        from .store import Journal, journal_of

        level = max((solution.level for solution in self.read()[1] if not solution.copy), default=0)
        return level, Journal(journal_of(self.path(level)))

    @property
    def kept(self) -> str:
        """Say what is finished; empty if nothing is."""
        if not self:
            return ""
        if count := len(self.read()[1]):
            return f"{count} lattice{'s are' if count > 1 else ' is'} finished"
        return "load steps on the first lattice are finished" if self._latest()[1] else ""

    def result(self, path: Path) -> Result:
        """Return what there is of the finest finished lattice, else of the first; `path` names it.

        Raises
        ------
        DeckError
            If there is nothing.
        """
        level, journal = self._latest()
        if not journal:
            raise DeckError(f"no load step of {path} was finished")
        result = journal.result(path)
        result.dataset.attrs["complete"] = np.int32(0)
        result.dataset.attrs["stopped"] = (
            f"refinement is not finished; these are the steps on lattice {level + 1}"
        )
        return result

    def remove(self) -> None:
        """Delete everything."""
        shutil.rmtree(self.folder, ignore_errors=True)
