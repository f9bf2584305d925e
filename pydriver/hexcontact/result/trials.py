"""The lattices of an unfinished refinement, in the journal of its output.

``out.nc.d/lattices`` has the header of the run, and the histories of each finished lattice: ``2_0.json`` is
level 2, not shifted. The load steps of the present lattice, and of the finest finished one, are journals
beside them: ``2_0.nc.d``.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import DeckError
from ..files import made, reading
from ..lock import names_a_run
from .journal import (
    HEADER,
    Header,
    Journal,
    begins_like_sealed,
    journal_of,
    read_header,
    read_sealed,
    write_header,
    write_sealed,
)
from .layout import Metadata

if TYPE_CHECKING:
    from .result import Result

_JOURNAL = r"\d+_\d+\.nc\.d"
_EARLIER = "trials.json"  # of the layouts 1 to 3
_TEXT = rf"(\d+_\d+\.json|{re.escape(HEADER)}|{re.escape(_EARLIER)})(\.tmp)?"
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

    def __bool__(self) -> bool:
        """Test whether there are any."""
        return any((self.folder / name).exists() for name in (HEADER, _EARLIER))

    def path(self, level: int, copy: int = 0) -> Path:
        """Return the path of the output of a lattice, to which its journal belongs."""
        return self.folder / f"{level}_{copy}.nc"

    def begin(self, metadata: Metadata) -> None:
        """Write the metadata of the run, also if it is resumed."""
        self.folder.mkdir(exist_ok=True)
        write_header(self.folder, Header(metadata))

    @property
    def metadata(self) -> Metadata:
        """Metadata of the run."""
        if (earlier := self.folder / _EARLIER).exists():
            raise DeckError(f"{earlier} was kept by an earlier version of hexcontact; run the deck again")
        return read_header(self.folder).metadata

    @property
    def solutions(self) -> list[Solution]:
        """The finished lattices; DeckError if a file is damaged or of another run."""
        run, found = self.metadata.run, []
        for path in (path for path in self._texts() if re.fullmatch(r"\d+_\d+", path.stem)):
            about = read_sealed(path)
            self.check(run, about.pop("run"))
            with reading(path, "a finished lattice"):
                found.append(made(Solution, {**about, "origin": tuple(about["origin"])}))
        return found

    def add(self, solution: Solution) -> None:
        """Write a finished lattice, and delete the load steps that are no longer needed."""
        path = self.path(solution.level, solution.copy).with_suffix(".json")
        write_sealed(path, {"run": self.metadata.run, **solution._asdict()})
        if solution.copy:
            _clear(Journal(journal_of(self.path(solution.level, solution.copy))))
        elif solution.level:
            _clear(Journal(journal_of(self.path(solution.level - 1))))

    def _latest(self) -> tuple[int, Journal]:
        """Return the level of the finest finished lattice, else 0, and its load steps."""
        level = max((solution.level for solution in self.solutions if not solution.copy), default=0)
        journal = Journal(journal_of(self.path(level)))
        if journal:
            self.check(self.metadata.run, journal.run)
        return level, journal

    def check(self, run: str, of_lattice: str) -> None:
        """Refuse load steps of a lattice of another run than that of the folder."""
        if run != of_lattice:
            raise DeckError(f"{self.folder} holds load steps of another run than {self.folder / HEADER}")

    @property
    def kept(self) -> str:
        """Describe the finished lattices; empty without any."""
        if not self:
            return ""
        if count := len(self.solutions):
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
        """Test whether a run has written the header."""
        return begins_like_sealed(self.folder / HEADER)

    def foreign(self) -> Iterator[Path]:
        """Yield files named like those of a run, in a folder without a header."""
        yield from self._texts()
        yield from (journal.files[0] for journal in self._journals() if journal.files and not journal.is_ours)

    def _named(self, pattern: str) -> list[Path]:
        """Return the entries of the folder whose names match a pattern."""
        names = sorted(os.listdir(self.folder)) if self.folder.is_dir() else []
        return [self.folder / name for name in names if re.fullmatch(pattern, name)]

    def _texts(self) -> list[Path]:
        """Return the header, the finished lattices, and remains of an interrupted write."""
        return self._named(_TEXT)

    def _journals(self) -> list[Journal]:
        """Return the load steps of all lattices."""
        return [Journal(folder) for folder in self._named(_JOURNAL)]

    def remove(self) -> None:
        """Delete the files of runs, and no others."""
        for journal in self._journals():
            _clear(journal)
        for path in self._texts():
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
    """Return a file named like one of a journal in a folder that no run has written to, or None."""
    journal, trials = Journal(folder), TrialFolder(folder)
    if journal.is_ours or trials.is_ours:
        return None
    return next(iter([*journal.files, *trials.foreign()]), None)


def linked_folder(folder: Path) -> Path | None:
    """Return a folder of lattices that is a link, or None."""
    trials = TrialFolder(folder)
    folders = [trials.folder, *(journal.folder for journal in trials._journals())]
    return next((path for path in folders if path.is_symlink()), None)
