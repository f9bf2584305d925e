"""The lattices of an unfinished refinement, in the journal of its output.

``out.nc.d/lattices/trials.json`` has the histories of the finished lattices. The load steps of the present
lattice, and of the finest finished one, are in journals beside it: ``2_0.nc.d`` is level 2, not shifted.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import DeckError
from ..files import beginning, made, reading, replacing, require_kinds
from ..lock import names_a_run
from .journal import Journal, journal_of
from .layout import Metadata

if TYPE_CHECKING:
    from .result import Result

VERSION = 2  # 1 had no checksum
_JOURNAL = r"\d+_\d+\.nc\.d"
FOLDER = "lattices"  # in the journal


class Solution(NamedTuple):
    """The histories of all load steps on one lattice."""

    level: int  # number of refinements
    copy: int  # 0: the lattice itself, else the number of its shifted copy
    spacing: float  # m
    origin: tuple[float, float]  # position of a node, m
    nodes: int  # of its largest window
    histories: Sequence[Mapping[str, Any]]  # by load step


class TrialFolder:
    """The lattices of an unfinished refinement, in the journal of an output."""

    def __init__(self, journal: Path) -> None:
        self.folder = journal / FOLDER
        self.ledger = self.folder / "trials.json"

    def __bool__(self) -> bool:
        """Test whether there are any."""
        return self.ledger.exists()

    def path(self, level: int, copy: int = 0) -> Path:
        """Return the path of the output of a lattice, to which its journal belongs."""
        return self.folder / f"{level}_{copy}.nc"

    def read(self) -> tuple[Metadata, list[Solution]]:
        """Return the metadata of the run, and the finished lattices; DeckError for a damaged file."""
        path = self.ledger
        with reading(path, "a list of finished lattices"):
            about = json.loads(path.read_bytes())
            require_kinds(about, solutions=list)
            for solution in about["solutions"]:
                require_kinds(solution, origin=list)
            if about["trials_version"] not in (1, VERSION):
                raise DeckError(
                    f"{path} has the layout {about['trials_version']}; this version reads {VERSION}"
                )
            digest = about.pop("sha256", "")
            if about["trials_version"] == VERSION and digest != _digest(about):
                raise DeckError(f"{path} is damaged: its content is not what was written (SHA-256)")
            found = [
                made(Solution, {**solution, "origin": tuple(solution["origin"])})
                for solution in about["solutions"]
            ]
            return Metadata.from_plain(about["metadata"]), found

    def write(self, metadata: Metadata, solutions: Sequence[Solution]) -> None:
        """Write the finished lattices to the disk as a whole."""
        self.folder.mkdir(exist_ok=True)
        about = {
            "trials_version": VERSION,
            "metadata": dataclasses.asdict(metadata),
            "solutions": [solution._asdict() for solution in solutions],
        }
        about = json.loads(json.dumps(about, default=np.generic.item))  # as after reading
        with replacing(self.ledger, self._temporary) as path:
            path.write_text(json.dumps({"sha256": _digest(about), **about}), encoding="utf-8")

    def drop(self, level: int, copy: int = 0) -> None:
        """Delete the load steps of a lattice."""
        _clear(Journal(journal_of(self.path(level, copy))))

    def _latest(self) -> tuple[int, Journal]:
        """Return the level of the finest finished lattice, else 0, and its load steps."""
        metadata, solutions = self.read()
        level = max((solution.level for solution in solutions if not solution.copy), default=0)
        journal = Journal(journal_of(self.path(level)))
        if journal:
            self.check(metadata, journal.metadata)
        return level, journal

    def check(self, metadata: Metadata, of_lattice: Metadata) -> None:
        """Refuse load steps of a lattice of another run than that of the folder."""
        if metadata.run != of_lattice.run:
            raise DeckError(f"{self.folder} holds load steps of another run than {self.ledger}")

    @property
    def kept(self) -> str:
        """Describe the finished lattices; empty without any."""
        if not self:
            return ""
        if count := len(self.read()[1]):
            return f"{count} lattice{'s are' if count > 1 else ' is'} finished"
        return "load steps on the first lattice are finished" if self._latest()[1] else ""

    def result(self, path: Path) -> Result:
        """Return the steps on the finest finished lattice, else on the first; `path` names the result."""
        level, journal = self._latest()
        if not journal:
            raise DeckError(f"no load step of {path} was finished")
        result = journal.result(path)
        result.dataset.attrs["complete"] = np.int32(0)
        result.dataset.attrs["stopped"] = (
            f"refinement is not finished; these are the steps on lattice {level + 1}"
        )
        return result

    @property
    def is_ours(self) -> bool:
        """Whether a run has written the list of finished lattices."""
        return b'"trials_version": ' in beginning(self.ledger, 200)

    def foreign(self) -> Iterator[Path]:
        """Yield files named like those of a run, in a folder without a list of finished lattices."""
        yield from (path for path in (self.ledger, self._temporary) if path.exists())
        yield from (journal.files[0] for journal in self._journals() if journal.files and not journal.is_ours)

    @property
    def _temporary(self) -> Path:
        return self.ledger.with_name(self.ledger.name + ".tmp")

    def _journals(self) -> list[Journal]:
        """Return the load steps of all lattices."""
        names = sorted(os.listdir(self.folder)) if self.folder.is_dir() else []
        return [Journal(self.folder / name) for name in names if re.fullmatch(_JOURNAL, name)]

    def remove(self) -> None:
        """Delete the files of runs, and no others."""
        for journal in self._journals():
            _clear(journal)
        for path in (self.ledger, self._temporary):
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # it is missing, or has other files
            self.folder.rmdir()


def _clear(journal: Journal) -> None:
    """Delete a journal that no run is writing."""
    journal.remove()
    if names_a_run(lock := journal.folder / "lock"):
        lock.unlink()
    with contextlib.suppress(OSError):
        journal.folder.rmdir()


def remove_all(folder: Path) -> None:
    """Delete load steps and lattices in the folder of a journal, but not the lock."""
    Journal(folder).remove()
    TrialFolder(folder).remove()


def foreign_file(folder: Path) -> Path | None:
    """Return a file named like one of a journal in a folder that no run has written to, or None.

    A record or a list of finished lattices is the sign of a run.
    """
    journal, trials = Journal(folder), TrialFolder(folder)
    if journal.is_ours or trials.is_ours:
        return None
    return next(iter([*journal.files, *trials.foreign()]), None)


def linked_folder(folder: Path) -> Path | None:
    """Return a folder of lattices that is a link, or None."""
    trials = TrialFolder(folder)
    folders = [trials.folder, *(journal.folder for journal in trials._journals())]
    return next((path for path in folders if path.is_symlink()), None)


def _digest(about: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(about).encode()).hexdigest()
