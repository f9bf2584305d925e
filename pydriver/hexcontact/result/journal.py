"""The journal of a run: its finished load steps, each in a file of its own beside the output."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

from ..errors import DeckError
from .layout import Metadata, assemble
from .netcdf import reading
from .record import SUFFIX, begins_like_record, fault_of_sequence, read_record
from .result import Result
from .step import Step
from .trials import TrialFolder

STOPPED = "stopped.txt"  # why the run ended before its time
_RECORD = re.compile(r"\d{6}" + re.escape(SUFFIX))
_TEMPORARY = ".tmp"


def journal_of(path: Path) -> Path:
    """Folder of the journal that belongs to the output `path`."""
    return path.with_name(path.name + ".d")


class Journal:
    """The finished steps of a run, read from the disk one at a time.

    Parameters
    ----------
    folder : Path
        The folder; one that is not there is an empty journal.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        names = sorted(os.listdir(folder)) if folder.is_dir() else []
        self.records = [folder / name for name in names if _RECORD.fullmatch(name)]
        unfinished = [name for name in names if _is_temporary(name, folder)]
        self._besides = [folder / name for name in names if name == STOPPED or name in unfinished]

    def __len__(self) -> int:
        """Return the number of finished steps."""
        return len(self.records)

    def __iter__(self) -> Iterator[Step]:
        """Read the steps; DeckError if one is missing between others, damaged or of another run."""
        before = None
        for number, record in enumerate(self.records, start=1):
            if int(record.stem) != number:
                raise DeckError(f"{self.folder} lacks the record of step {number}, {number:06d}{SUFFIX}")
            metadata, step = read_record(record)
            if step.number != number:
                raise DeckError(f"{record} is damaged: it holds step {step.number}")
            with reading(record, "a record of a journal"):
                if fault := fault_of_sequence(before or metadata, metadata):
                    raise DeckError(f"{record} does not belong to the records before it: {fault}")
            before = metadata
            yield step

    @property
    def metadata(self) -> Metadata:
        """Where the steps come from, as the last of them tells."""
        return read_record(self.records[-1])[0]

    @property
    def stopped(self) -> str:
        """Why the run ended before its time; empty if it goes on, was killed or has finished."""
        with contextlib.suppress(FileNotFoundError):
            return (self.folder / STOPPED).read_text(encoding="utf-8", errors="replace")
        return ""

    @property
    def complete(self) -> bool:
        """Whether all planned steps are there."""
        metadata, last = read_record(self.records[-1])
        return len(self) == metadata.planned_steps or last.done == 1.0

    def result(self, path: Path) -> Result:
        """All finished steps as a result in memory; `path` is what the user calls it."""
        with reading(self.folder, "a journal"):
            dataset = assemble(self.metadata, self, self.complete)
        if self.stopped:
            dataset.attrs["stopped"] = self.stopped
        return Result(dataset, str(path))

    def foreign(self) -> Path | None:
        """Return a file that has the name of one of a journal, in a folder that no run has written to.

        A run is known by one of its records or its list of finished lattices.
        """
        trials = TrialFolder(self.folder)
        if trials.is_ours or any(map(begins_like_record, self.records)):
            return None
        return next(iter([*self.records, *self._besides, *trials.foreign()]), None)

    def remove(self) -> None:
        """Delete the records, why they are not all, and what an interrupted write left; the lock stays."""
        for path in self.records:
            path.unlink(missing_ok=True)
        TrialFolder(self.folder).remove()
        self.tidy()

    def tidy(self) -> None:
        """Delete why the steps are not all, and what an interrupted write left."""
        for path in Journal(self.folder)._besides:
            path.unlink(missing_ok=True)


def _is_temporary(name: str, folder: Path) -> bool:
    """Tell whether a run writes a record, or its output, under this name before it is whole."""
    stem = name.removesuffix(_TEMPORARY)
    return stem != name and bool(_RECORD.fullmatch(stem) or stem == folder.name.removesuffix(".d"))
