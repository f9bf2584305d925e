"""The journal of a run: its finished load steps, each in a file of its own beside the output.

A record is an uncompressed zip archive of the fields in the format of numpy, and a text (JSON) with all other
data. It is written and read several times faster than a netCDF file of as many variables; checksums cover all
of it, so that damage is an error.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..core.lattice import Lattice
from ..errors import DeckError
from ..files import beginning, reading
from .check import fault_of_record, fault_of_sequence
from .layout import Layout, Metadata, assemble
from .step import Step

if TYPE_CHECKING:
    from .result import Result

SUFFIX = ".npz"
STOPPED = "stopped.txt"  # the reason of an early end
_LONGEST_REASON = 10_000  # bytes of it
_RECORD = re.compile(r"\d{6}" + re.escape(SUFFIX))
_TEMPORARY = ".tmp"
VERSION = 1
_ABOUT = "about"  # name of the text among the arrays
_COMPANION = "companion_"  # prefix of the names of fields of a second solution


def journal_of(path: Path) -> Path:
    """Folder of the journal that belongs to the output `path`."""
    return path.with_name(path.name + ".d")


class Journal:
    """The finished steps of a run, read from the disk one at a time.

    Parameters
    ----------
    folder : Path
        The folder; a missing one is an empty journal.
    companions : bool
        Read the companions of steps, too.
    """

    def __init__(self, folder: Path, companions: bool = False) -> None:
        self.folder, self._companions = folder, companions
        names = sorted(os.listdir(folder)) if folder.is_dir() else []
        self.records = [folder / name for name in names if _RECORD.fullmatch(name)]
        unfinished = [name for name in names if _is_temporary(name, folder)]
        self._besides = [folder / name for name in names if name == STOPPED or name in unfinished]

    def __len__(self) -> int:
        """Return the number of finished steps."""
        return len(self.records)

    def __iter__(self) -> Iterator[Step]:
        """Read the steps; DeckError if one is missing, damaged or of another run."""
        before = None
        for number, record in enumerate(self.records, start=1):
            if int(record.stem) != number:
                raise DeckError(f"{self.folder} lacks the record of step {number}, {number:06d}{SUFFIX}")
            metadata, step = read_record(record, self._companions)
            if step.number != number:
                raise DeckError(f"{record} is damaged: it holds step {step.number}")
            with reading(record, "a record of a journal"):
                if fault := fault_of_sequence(before or metadata, metadata):
                    raise DeckError(f"{record} does not belong to the records before it: {fault}")
            before = metadata
            yield step

    @property
    def metadata(self) -> Metadata:
        """Metadata of the run in the last record."""
        return read_record(self.records[-1], companion=False)[0]

    @property
    def stopped(self) -> str:
        """Reason of an early end; empty if the run goes on, was killed or has finished."""
        return beginning(self.folder / STOPPED, _LONGEST_REASON).decode(errors="replace")

    @property
    def complete(self) -> bool:
        """Whether it has all planned steps."""
        metadata, last = read_record(self.records[-1], companion=False)
        return len(self) == metadata.planned_steps or last.done == 1.0

    def result(self, path: Path) -> Result:
        """Return all finished steps as a result in memory; `path` is its name."""
        from .result import Result

        with reading(self.folder, "a journal"):
            dataset = assemble(self.metadata, self, self.complete)
        if self.stopped:
            dataset.attrs["stopped"] = self.stopped
        return Result(dataset, str(path))

    @property
    def is_ours(self) -> bool:
        """Whether a run has written one of the records."""
        return any(map(begins_like_record, self.records))

    @property
    def files(self) -> list[Path]:
        """The records, the reason of an early end, and remains of an interrupted write."""
        return [*self.records, *self._besides]

    def remove(self) -> None:
        """Delete all `files`, but not the lock."""
        for path in self.records:
            path.unlink(missing_ok=True)
        self.tidy()

    def tidy(self) -> None:
        """Delete the reason of an early end, and remains of an interrupted write."""
        for path in Journal(self.folder)._besides:
            path.unlink(missing_ok=True)


def _is_temporary(name: str, folder: Path) -> bool:
    """Test whether a run writes a record, or its output, under this temporary name."""
    stem = name.removesuffix(_TEMPORARY)
    return stem != name and bool(_RECORD.fullmatch(stem) or stem == folder.name.removesuffix(".d"))


# --- records ------------------------------------------------------------------------------------------------


def write_record(path: Path, metadata: Metadata, step: Step) -> None:
    """Write a record.

    Parameters
    ----------
    path : Path
        File to write or replace.
    metadata : Metadata
        Metadata of the run.
    step : Step
        The step.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    layout = Layout(metadata, [step.head])
    about = {
        "journal_version": VERSION,
        "hexcontact_version": __version__,
        "metadata": dataclasses.asdict(metadata),
        "index": step.index,
        "lattice": dataclasses.asdict(step.lattice),
        "history": dict(step.history),
        "fields": list(step.fields),
        "companion": list(step.companion),
        "control": dict(step.control),
    }
    text = json.dumps(about, default=np.generic.item).encode()
    fields = {name: layout.padded(name, step) for name in step.fields}
    fields |= {_COMPANION + name: values for name, values in step.companion.items()}
    with path.open("wb") as file:
        np.savez(file, **{_ABOUT: np.frombuffer(text, "u1")}, **fields)  # type: ignore[arg-type]


def read_record(path: Path, companion: bool = True) -> tuple[Metadata, Step]:
    """Read a record, with its companion or without.

    Raises
    ------
    DeckError
        If the file is damaged or of another version.
    FileNotFoundError
        If it is missing.
    """
    with reading(path, "a record of a journal"):
        with zipfile.ZipFile(path) as file:
            about = json.loads(_array(file, _ABOUT).tobytes())
            if about["journal_version"] != VERSION:
                raise DeckError(
                    f"{path} was kept by hexcontact {about['hexcontact_version']}, whose journal has the "
                    f"layout {about['journal_version']}; this version reads layout {VERSION}"
                )
            fields = {name: _array(file, name) for name in about["fields"]}
            beside = about.get("companion", ())
            fields_beside = {name: _array(file, _COMPANION + name) for name in beside if companion}
        origin = tuple(about["lattice"].pop("origin"))
        lattice = Lattice(**about["lattice"], origin=origin)
        metadata = Metadata.from_plain(about["metadata"])
        step = Step(
            *(about["index"], lattice, fields, about["history"]),
            companion=fields_beside,
            control=about.get("control", {}),
        )
        fault = fault_of_record(metadata, step)
        adaptive = step.control and "until" not in step.control
        if not fault and adaptive and bool(beside) != isinstance(step.control.get("companion"), dict):
            fault = "its second solution is not whole"
        if fault:
            raise DeckError(f"{path} is damaged: {fault}")
        return metadata, step


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return an array of a record; zipfile compares its checksum at the end."""
    with archive.open(f"{name}.npy") as member:
        values: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
        if member.read(1):
            raise ValueError(f"{name} is longer than its shape")
        return values


def begins_like_record(path: Path) -> bool:
    """Test whether a file begins like a record, which may be damaged."""
    head = beginning(path, 30 + len(_ABOUT))
    return head[:4] == b"PK\x03\x04" and head[30:] == _ABOUT.encode()
