"""The journal of a run: its finished load steps, each in a file of its own beside the output.

A record is a zip archive of the fields as numpy writes them, uncompressed, and a text (JSON) with all the
rest. It is written and read several times faster than a netCDF file with that many variables, checksums cover
all of it, and damage never leads further than to an error.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..core.lattice import Lattice
from ..errors import DeckError
from ..files import beginning, reading
from .check import MATERIALS, fault_of_record
from .layout import Layout, Metadata, assemble
from .result import Result
from .step import Step

SUFFIX = ".npz"
STOPPED = "stopped.txt"  # why the run ended before its time
_LONGEST_REASON = 10_000  # bytes of it that are read
_RECORD = re.compile(r"\d{6}" + re.escape(SUFFIX))
_TEMPORARY = ".tmp"
VERSION = 1
_ABOUT = "about"  # the text, among the arrays
_COMPANION = "companion_"  # before the names of the fields of a second solution
_CLOSE = 1e-9  # relative difference of moduli that are the same
PHYSICS = ("algorithm", "coupling", "entry")  # keys of [solver] that decide what is solved
_NOT_PHYSICS = ("title", "solver", "output")  # tables of a deck that do not
_OF_NODES = {"spacing", "origin"}  # keys of [grid], which a session writes when a load is added
_OF_SESSIONS = ("grid", "load", "accuracy")  # tables of a deck that change then


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
        return beginning(self.folder / STOPPED, _LONGEST_REASON).decode(errors="replace")

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

    @property
    def is_ours(self) -> bool:
        """Whether a run has written one of the records."""
        return any(map(begins_like_record, self.records))

    @property
    def files(self) -> list[Path]:
        """The records, why they are not all, and what an interrupted write left."""
        return [*self.records, *self._besides]

    def remove(self) -> None:
        """Delete all `files`; the lock stays."""
        for path in self.records:
            path.unlink(missing_ok=True)
        self.tidy()

    def tidy(self) -> None:
        """Delete why the steps are not all, and what an interrupted write left."""
        for path in Journal(self.folder)._besides:
            path.unlink(missing_ok=True)


def _is_temporary(name: str, folder: Path) -> bool:
    """Tell whether a run writes a record, or its output, under this name before it is whole."""
    stem = name.removesuffix(_TEMPORARY)
    return stem != name and bool(_RECORD.fullmatch(stem) or stem == folder.name.removesuffix(".d"))


# --- records ------------------------------------------------------------------------------------------------


def write_record(path: Path, metadata: Metadata, step: Step) -> None:
    """Write a record.

    Parameters
    ----------
    path : Path
        File to write; replaced if it is there.
    metadata : Metadata
        Where the step comes from.
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


def read_record(path: Path) -> tuple[Metadata, Step]:
    """Read a record.

    Raises
    ------
    DeckError
        If the file is damaged or of another version.
    FileNotFoundError
        If it is not there.
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
            companion = {name: _array(file, _COMPANION + name) for name in about.get("companion", ())}
        origin = tuple(about["lattice"].pop("origin"))
        lattice = Lattice(**about["lattice"], origin=origin)
        metadata = Metadata.from_plain(about["metadata"])
        step = Step(
            *(about["index"], lattice, fields, about["history"]),
            companion=companion,
            control=about.get("control", {}),
        )
        if fault := fault_of_record(metadata, step):
            raise DeckError(f"{path} is damaged: {fault}")
        return metadata, step


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return an array of a record; zipfile compares the checksum at its end."""
    with archive.open(f"{name}.npy") as member:
        values: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
        if member.read(1):
            raise ValueError(f"{name} is longer than its shape")
        return values


def begins_like_record(path: Path) -> bool:
    """Tell whether a file begins like a record, be it damaged."""
    head = beginning(path, 30 + len(_ABOUT))
    return head[:4] == b"PK\x03\x04" and head[30:] == _ABOUT.encode()


def fault_of_sequence(before: Metadata, after: Metadata) -> str:
    """Return why a record cannot follow another of the same journal; empty if it can.

    Tolerances may change when a run goes on, and a session adds to the loads.
    """
    for name in ("run", "created", "title", "version", "fields", "every"):
        if getattr(before, name) != getattr(after, name):
            return f"its {name} is another"
    if after.resumed[: len(before.resumed)] != before.resumed:
        return "it was written before them"
    for name in MATERIALS:
        if not _same(before.parameters.get(name), after.parameters.get(name)):
            return f"its {name} is another"
    if before.deck != after.deck:
        was, now = physics(before.deck), physics(after.deck)
        if now.get("grid", {}).keys() >= _OF_NODES:
            was, now = ({k: v for k, v in deck.items() if k not in _OF_SESSIONS} for deck in (was, now))
        if was != now:
            return "its deck is of another problem"
    return ""


def physics(deck: str) -> dict[str, Any]:
    """Return what a deck says about the problem, not about how it is solved and what is kept."""
    tables = tomllib.loads(deck)
    solver = {key: value for key, value in tables.get("solver", {}).items() if key in PHYSICS}
    return {**{key: value for key, value in tables.items() if key not in _NOT_PHYSICS}, "solver": solver}


def _same(one: Any, other: Any) -> bool:
    """Compare what describes a case; another version may round otherwise."""
    numbers = isinstance(one, float) and isinstance(other, float)
    return bool(one == other or (numbers and math.isclose(one, other, rel_tol=_CLOSE)))
