"""The journal of a run: its finished load steps, each in a file of its own beside the output.

A record is an uncompressed zip archive of the fields, an array for each type of numbers in the format of
numpy, and a text (JSON) with all other data. It is written and read several times faster than a netCDF file
of as many variables; checksums cover all of it, so that damage is an error. The metadata of the run with the
whole deck are in the first record, and in those at which they changed; the others refer to it, and add the
loads of a session. So records do not grow with the number of steps.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..core.lattice import Lattice
from ..errors import DeckError
from ..files import beginning, made, reading, require_kinds
from ..variables import VARIABLES
from .check import fault_of_record, fault_of_sequence
from .layout import Metadata, assemble
from .step import Step, Stored

if TYPE_CHECKING:
    from .result import Result

SUFFIX = ".npz"
STOPPED = "stopped.txt"  # the reason of an early end
_LONGEST_REASON = 10_000  # bytes of it
_RECORD = re.compile(r"\d{6}" + re.escape(SUFFIX))
_TEMPORARY = ".tmp"
VERSION = 3
_ABOUT = "about"  # name of the text among the arrays
_LACKS = "{0} lacks the record of step {1}, {1:06d}" + SUFFIX
_KIND = "a record of a journal"
_LARGE = 2**22  # bytes of a record; of a smaller one, opening the file for each field takes longer
_NO_FOLLOWER = "{} does not belong to the records before it: {}"
_FIELDS, _COMPANION = "fields", "companion"  # parts with fields: of the step, of a second solution
_PARTS = {
    "index": int,
    **dict.fromkeys(("lattice", "history", "control"), dict),
    _FIELDS: list,
    _COMPANION: list,
}


def journal_of(path: Path) -> Path:
    """Folder of the journal that belongs to the output `path`."""
    return path.with_name(path.name + ".d")


class Journal:
    """The finished steps of a run, read from the disk one at a time.

    If this process has validated the records before (`ours`), only checksums are compared, and fields of
    large records are loaded lazily. Restart data are read on request (`companions`).
    """

    def __init__(self, folder: Path, companions: bool = False, ours: bool = False) -> None:
        self.folder, self._companions, self._ours = folder, companions, ours
        names = sorted(os.listdir(folder)) if folder.is_dir() else []
        self.records = [folder / name for name in names if _RECORD.fullmatch(name)]
        unfinished = [name for name in names if _is_temporary(name, folder)]
        self._besides = [folder / name for name in names if name == STOPPED or name in unfinished]
        self._last: Description | None = None  # in the last record, once it was read

    def __len__(self) -> int:
        """Return the number of finished steps."""
        return len(self.records)

    def __iter__(self) -> Iterator[Step]:
        """Read the steps; DeckError if one is missing, damaged or of another run."""
        known: Description | None = None
        for number, record in enumerate(self.records, start=1):
            if int(record.stem) != number:
                raise DeckError(_LACKS.format(self.folder, number))
            about, step = read_step(record, self._companions, known.whole if known else None, not self._ours)
            if step.number != number:
                raise DeckError(f"{record} is damaged: it holds step {step.number}")
            with reading(record, _KIND):
                fault = ""
                if isinstance(about, Growth):
                    fault = "their deck is another" if known is None else known.follow(about)
                else:
                    fault = fault_of_sequence(known.metadata, about) if known else ""
                    known = Description(about, number)
                if fault:
                    raise DeckError(_NO_FOLLOWER.format(record, fault))
            yield step
        self._last = known

    @property
    def metadata(self) -> Metadata:
        """Metadata of the run in the last record."""
        if self._last is None:
            self._last = described(self.records[-1])
        return self._last.metadata

    @property
    def run(self) -> str:
        """Unique name of the run, in the last record."""
        return read_about(self.records[-1]).run

    @property
    def stopped(self) -> str:
        """Reason of an early end; empty if the run goes on, was killed or has finished."""
        return beginning(self.folder / STOPPED, _LONGEST_REASON).decode(errors="replace")

    @property
    def complete(self) -> bool:
        """Whether it has all planned steps."""
        about, last = read_step(self.records[-1], companion=False)
        return len(self) == about.planned_steps or last.done == 1.0

    def result(self, path: Path) -> Result:
        """Return all finished steps as a result in memory; `path` is its name."""
        from .result import Result

        with reading(self.folder, "a journal"):
            dataset = assemble(self.metadata, self, self.complete, stopped=self.stopped)
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
        for path in reversed(self.records):  # what is left if it is killed is the beginning of a run
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


class Growth(NamedTuple):
    """Reference of a record to the metadata in record `of`, and the text that it adds to the deck."""

    run: str
    of: int
    planned_steps: int
    kept: int  # characters of the deck of the last record that remain
    added: str  # text that follows them
    checksum: int  # CRC-32 of the whole deck


class Description:
    """Metadata of a run whose deck grows; record `number` holds them, 0: the next record will."""

    def __init__(self, metadata: Metadata, number: int = 0) -> None:
        self._begin(metadata, number)

    def _begin(self, metadata: Metadata, number: int) -> None:
        self.whole, self.number, self.planned_steps = metadata, number, metadata.planned_steps
        self._pieces: list[str] = []  # of the deck
        self._ends = [(0, 0)]  # lengths and checksums before each, and of all
        self._add(metadata.deck)

    @property
    def metadata(self) -> Metadata:
        """The metadata at present."""
        deck = "".join(self._pieces)
        return dataclasses.replace(self.whole, deck=deck, planned_steps=self.planned_steps)

    def next(
        self, number: int, added: str = "", kept: int | None = None, planned_steps: int | None = None
    ) -> Metadata | Growth:
        """Append text to the first `kept` characters of the deck; return the metadata for record `number`."""
        kept = self._ends[-1][0] if kept is None else kept
        self._replace(kept, added)
        self.planned_steps = self.planned_steps if planned_steps is None else planned_steps
        if not self.number:
            self._begin(self.metadata, number)
            return self.whole
        checksum = self._ends[-1][1]
        return Growth(self.whole.run, self.number, self.planned_steps, kept, added, checksum)

    def follow(self, growth: Growth) -> str:
        """Follow the reference of the next record; return why it cannot be that, else empty text."""
        if growth.run != self.whole.run:
            return "its run is another"
        if growth.of != self.number or growth.kept > self._ends[-1][0]:
            return "its metadata are others"
        self._replace(growth.kept, growth.added)
        self.planned_steps = growth.planned_steps
        return "" if self._ends[-1][1] == growth.checksum else "its deck is another"

    def _replace(self, kept: int, added: str) -> None:
        """Replace all but the first `kept` characters of the deck."""
        last = ""
        while self._ends[-1][0] > kept:
            self._ends.pop()
            last = self._pieces.pop()
        self._add(last[: kept - self._ends[-1][0]])
        self._add(added)

    def _add(self, piece: str) -> None:
        if piece:
            length, checksum = self._ends[-1]
            self._pieces.append(piece)
            self._ends.append((length + len(piece), zlib.crc32(piece.encode(), checksum)))


def write_record(path: Path, about: Metadata | Growth, step: Step) -> None:
    """Write a record: a step, with the metadata of the run or a reference to those of earlier records."""
    fields = {name: np.asarray(values, VARIABLES[name].dtype) for name, values in step.fields.items()}
    for name, values in fields.items():
        if values.shape != step.lattice.shape:
            raise ValueError(
                f"{name} of step {step.number} has shape {values.shape}, not {step.lattice.shape}"
            )
    parts = {_FIELDS: _alike(fields), _COMPANION: _alike(step.companion)}
    known = {
        "journal_version": VERSION,
        "hexcontact_version": __version__,
        **({"growth": about._asdict()} if isinstance(about, Growth) else {"metadata": vars(about)}),
        "index": step.index,
        "lattice": dataclasses.asdict(step.lattice),
        "history": dict(step.history),
        **{part: [list(group) for group in groups] for part, groups in parts.items()},
        "control": dict(step.control),
    }
    text = json.dumps(known, default=np.generic.item).encode()
    with zipfile.ZipFile(path, "w") as file:
        _write_array(file, _ABOUT, [np.frombuffer(text, "u1")])
        for part, groups in parts.items():
            for number, group in enumerate(groups):
                _write_array(file, f"{part}_{number}", [values[np.newaxis] for values in group.values()])


def _alike(fields: Mapping[str, NDArray[Any]]) -> list[dict[str, NDArray[Any]]]:
    """Return fields in groups of one type and shape."""
    groups: dict[Any, dict[str, NDArray[Any]]] = {}
    for name, values in fields.items():
        groups.setdefault((values.dtype, values.shape), {})[name] = values
    return list(groups.values())


def _write_array(archive: zipfile.ZipFile, name: str, parts: Sequence[NDArray[Any]]) -> None:
    """Write an array that consists of parts along its first axis."""
    first = parts[0]
    header = {
        "descr": np.lib.format.dtype_to_descr(first.dtype),
        "fortran_order": False,
        "shape": (sum(map(len, parts)), *first.shape[1:]),
    }
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array_header_1_0(member, header)
        for part in parts:
            member.write(np.ascontiguousarray(part).data)


def read_step(
    path: Path, companion: bool = True, whole: Metadata | None = None, check: bool = True
) -> tuple[Metadata | Growth, Step]:
    """Read a record, without following its reference to metadata in another record.

    To `check` the step, the metadata are those of `whole`, else they are read. `companion`: read restart
    data, too.
    """
    with reading(path, _KIND), zipfile.ZipFile(path) as file:
        known = _known(file, path)
        about = _about(known)
        if check or path.stat().st_size < _LARGE:
            fields: Mapping[str, NDArray[Any]] = _fields(file, _FIELDS, known)
        else:
            members = {f"{_FIELDS}_{number}.npy": names for number, names in enumerate(known[_FIELDS])}
            fields = Stored(path, file, members)
        lattice = made(Lattice, known["lattice"] | {"origin": tuple(known["lattice"]["origin"])})
        step = Step(
            *(known["index"], lattice, fields, known["history"]),
            companion=_fields(file, _COMPANION, known) if companion else {},
            control=known["control"],
        )
        if not check:
            return about, step
        if isinstance(about, Metadata):
            metadata = about
        else:
            whole = whole or described(_record(path.parent, about.of)).whole
            metadata = dataclasses.replace(whole, planned_steps=about.planned_steps)
        fault = fault_of_record(metadata, step)
        adaptive = step.control and "until" not in step.control
        if (
            not fault
            and adaptive
            and bool(known[_COMPANION]) != isinstance(step.control.get("companion"), dict)
        ):
            fault = "its second solution is not whole"
        if fault:
            raise DeckError(f"{path} is damaged: {fault}")
        return about, step


def described(record: Path) -> Description:
    """Return the metadata of a record, and read for it those before it to which it refers."""
    number, growths = int(record.stem), []
    while isinstance(about := read_about(record), Growth):
        growths.append((record, about))
        number -= 1
        record = _record(record.parent, number)
        if not record.exists() and growths[0][0].exists():
            raise DeckError(_LACKS.format(record.parent, number))
    known = Description(about, number)
    for path, growth in reversed(growths):
        with reading(path, _KIND):
            if fault := known.follow(growth):
                raise DeckError(_NO_FOLLOWER.format(path, fault))
    return known


def read_about(path: Path) -> Metadata | Growth:
    """Read what a record holds of the metadata."""
    with reading(path, _KIND), zipfile.ZipFile(path) as file:
        return _about(_known(file, path))


def _record(folder: Path, number: int) -> Path:
    return folder / f"{number:06d}{SUFFIX}"


def _known(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the text of a record."""
    known: dict[str, Any] = json.loads(_array(archive, _ABOUT).tobytes())
    require_kinds(known)
    if known["journal_version"] != VERSION:
        raise DeckError(
            f"{path} was kept by hexcontact {known['hexcontact_version']}, whose journal has the "
            f"layout {known['journal_version']}; this version reads layout {VERSION}"
        )
    require_kinds(known, **_PARTS)
    require_kinds(known["lattice"], origin=list)
    return known


def _about(known: Mapping[str, Any]) -> Metadata | Growth:
    if "growth" not in known:
        return Metadata.from_plain(known["metadata"])
    require_kinds(known["growth"], **get_type_hints(Growth))
    return made(Growth, known["growth"])


def _fields(archive: zipfile.ZipFile, part: str, known: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Return the fields of a part of a record."""
    fields: dict[str, NDArray[Any]] = {}
    for number, names in enumerate(known[part]):
        fields |= zip(names, _array(archive, f"{part}_{number}"), strict=True)
    return fields


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
