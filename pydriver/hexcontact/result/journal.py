"""The journal of a run, in a folder beside its output.

The header (JSON) has the metadata of the run with the whole deck. A record is an uncompressed zip archive of
the fields of a step as numpy saves them, and a text (JSON) with all other data. It is written and read
several times faster than a netCDF file of as many variables. Records of a session have the loads of their
segments, so that no record grows with the number of steps. Every file has a seal, a digest of its content, so
that damage is an error.

``out.nc.d/lattices`` has the header of the run, and the histories of each finished lattice: ``2_0.json`` is
level 2, not shifted. The load steps of the present lattice, and of the finest finished one, are journals
beside them: ``2_0.nc.d``.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import math
import os
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .._version import __version__
from ..arrays import BAND, Banded
from ..core.lattice import Lattice
from ..errors import DeckError
from ..files import beginning, made, names_a_run, reading, replacing, require_table
from ..variables import VARIABLES
from .layout import Metadata, assemble
from .step import Step, bands_of

if TYPE_CHECKING:
    from .result import Result


VERSION = 5
HEADER = "header.json"
SUFFIX = ".npz"
STOPPED = "stopped.txt"  # the reason of an early end
_LONGEST_REASON = 10_000  # bytes of it
_RECORD = re.compile(r"\d{6}" + re.escape(SUFFIX))
_TEMPORARY = ".tmp"
FOLDER = "lattices"  # in the journal
_EARLIER = "trials.json"  # there, of the layouts 1 to 3
_LATTICE = rf"\d+_\d+\.json|{re.escape(_EARLIER)}"
_ABOUT = "about"  # name of the text among the arrays
_KIND = "a record of a journal"
LARGE = 2**22  # bytes of a record; of a smaller one, opening the file for each field takes longer
_COMPANION = "companion."  # before the names of restart data
_PARTS = ("run", "index", "lattice", "history", "control")
_HEAD = rb"PK\x03\x04.{26}" + _ABOUT.encode() + rb"|\{\"journal_version\": "  # of a record, of a text
_CHANGED = "{} is damaged: its checksum differs"


def journal_of(path: Path) -> Path:
    """Folder of the journal that belongs to the output `path`."""
    return path.with_name(path.name + ".d")


# --- the header ---------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Header:
    """Metadata of a run; in a session the loads of further steps follow behind the deck."""

    metadata: Metadata
    steps: int | None = None  # whose loads the deck has; None: it has all

    def whole(self, controls: Iterable[Mapping[str, Any]]) -> Metadata:
        """Return the metadata of a run by the control data of its finished steps.

        A further segment has one entry of [[load]], which each of its steps has up to its own end.
        """
        if self.steps is None:
            return self.metadata
        known = list(controls)
        further = {control["segment"]: control["load"] for control in known[self.steps :]}
        deck = "".join([self.metadata.deck, *further.values()])
        return dataclasses.replace(self.metadata, deck=deck, planned_steps=max(len(known), self.steps))


def write_header(folder: Path, header: Header) -> None:
    """Write the header of the journal, or of the lattices, in a folder."""
    write_sealed(folder / HEADER, dataclasses.asdict(header))


def read_header(folder: Path) -> Header:
    """Read the header in a folder."""
    path = folder / HEADER
    about = read_sealed(path)
    with reading(path, "the header of a journal"):
        return Header(Metadata.from_plain(about["metadata"]), about["steps"])


def write_sealed(path: Path, about: Mapping[str, Any]) -> None:
    """Write a text (JSON) with its seal."""
    text = json.dumps({"hexcontact_version": __version__, **about}, default=np.generic.item)
    seal = {"journal_version": VERSION, "sha256": _digest(json.loads(text))}
    with replacing(path, path.with_name(path.name + _TEMPORARY)) as temporary:
        temporary.write_text(f"{json.dumps(seal)[:-1]}, {text[1:]}", encoding="utf-8")


def read_sealed(path: Path) -> dict[str, Any]:
    """Read a text (JSON), and compare its seal."""
    with reading(path, "a text of a journal"):
        about: dict[str, Any] = json.loads(path.read_bytes())
        _require_layout(about, path)
        del about["journal_version"]
        if about.pop("sha256", "") != _digest(about):
            raise DeckError(f"{_CHANGED.format(path)} (SHA-256)")
        del about["hexcontact_version"]
        return about


def _require_layout(about: Any, path: Path) -> None:
    """Refuse a text of another layout of the journal."""
    require_table(about)
    if (layout := about["journal_version"]) != VERSION:
        raise DeckError(
            f"{path} was kept by hexcontact {about['hexcontact_version']}, whose journal has the layout "
            f"{layout}; this version reads layout {VERSION}"
        )


def _digest(about: Any) -> str:
    return hashlib.sha256(json.dumps(about).encode()).hexdigest()


# --- the journal --------------------------------------------------------------------------------------------


class Journal:
    """The finished steps of a run, read from the disk one at a time.

    Each field of a large record is loaded at its use. With `restart` the steps have their restart data.
    """

    def __init__(self, folder: Path, restart: bool = False) -> None:
        self.folder, self._restart = folder, restart
        names = sorted(os.listdir(folder)) if folder.is_dir() else []
        self.records = [folder / name for name in names if _RECORD.fullmatch(name)]
        others = [folder / name for name in reversed(names) if _is_ours(name, folder)]
        self.files = [*reversed(self.records), *others]  # in the order in which they are deleted

    def __len__(self) -> int:
        """Return the number of finished steps."""
        return len(self.records)

    def __iter__(self) -> Iterator[Step]:
        """Read the steps; DeckError if one is missing, damaged or of another run."""
        for number, record in enumerate(self.records, start=1):
            if int(record.stem) != number:
                raise DeckError(f"{self.folder} lacks the record of step {number}, {number:06d}{SUFFIX}")
            about, step = read_record(record, self._restart)
            if step.number != number:
                raise DeckError(f"{record} is damaged: it holds step {step.number}")
            if about["run"] != self.run:
                raise DeckError(f"{record} does not belong to the records before it: its run is another")
            yield step

    @cached_property
    def header(self) -> Header:
        """The header."""
        if not (self.folder / HEADER).exists():
            read_about(self.records[0])  # DeckError for another version
            raise DeckError(f"{self.folder} lacks its header, {HEADER}")
        return read_header(self.folder)

    @cached_property
    def metadata(self) -> Metadata:
        """Metadata of the run."""
        return self.header.whole(read_about(record)["control"] for record in self.records)

    @property
    def run(self) -> str:
        """Unique name of the run."""
        return self.header.metadata.run

    @property
    def stopped(self) -> str:
        """Reason of an early end; empty if the run continues, was killed or has finished."""
        return beginning(self.folder / STOPPED, _LONGEST_REASON).decode(errors="replace")

    @property
    def complete(self) -> bool:
        """Whether it has all planned steps."""
        done = read_about(self.records[-1])["control"].get("done")
        return len(self) == self.metadata.planned_steps or done == 1.0

    def result(self, path: Path) -> Result:
        """Return all finished steps as a result in memory; `path` is its name."""
        from .result import Result

        with reading(self.folder, "a journal"):
            dataset = assemble(self.metadata, self, self.complete, stopped=self.stopped)
        return Result(dataset, str(path))

    @property
    def is_ours(self) -> bool:
        """Whether one of the files begins as a run writes it; the rest may be damaged."""
        heads = (beginning(path, 30 + len(_ABOUT)) for path in self.files)
        return any(re.match(_HEAD, head, re.DOTALL) for head in heads)

    def remove(self) -> None:
        """Delete all `files`, but not the lock."""
        for path in self.files:
            path.unlink(missing_ok=True)

    def clear(self) -> None:
        """Delete a journal that no run is writing, but no other files in its folder."""
        self.remove()
        if names_a_run(lock := self.folder / "lock"):
            lock.unlink()
        with contextlib.suppress(OSError):
            self.folder.rmdir()


def _is_ours(name: str, folder: Path) -> bool:
    """Test whether a run writes a file of this name beside the records, or an interrupted write leaves it."""
    stem = name.removesuffix(_TEMPORARY)
    if name in (HEADER, STOPPED) or (folder.name == FOLDER and re.fullmatch(_LATTICE, stem)):
        return True
    return stem != name and bool(_RECORD.fullmatch(stem) or stem in (HEADER, folder.name.removesuffix(".d")))


def journals(folder: Path) -> list[Journal]:
    """Return all journals in the folder of a journal: itself, that of the lattices, those of each lattice."""
    below = folder / FOLDER
    if not below.is_dir():
        return [Journal(folder)]
    names = sorted(os.listdir(below))
    of_each = [below / name for name in names if re.fullmatch(r"\d+_\d+\.nc\.d", name)]
    return [Journal(at) for at in (folder, below, *of_each)]


def remove_all(folder: Path) -> None:
    """Delete load steps and lattices in the folder of a journal, but not the lock."""
    own, *others = journals(folder)
    own.remove()
    for journal in reversed(others):
        journal.clear()


def foreign(folder: Path, known: bool) -> Path | None:
    """Return a folder of lattices that is a link, or a file named like one of a journal, but of no run.

    If the folder is `known` as that of a run, its files may be damaged.
    """
    found = journals(folder)
    if links := [journal.folder for journal in found[1:] if journal.folder.is_symlink()]:
        return links[0]
    if known or any(journal.is_ours for journal in found[:2]):
        return None
    return next((journal.files[0] for journal in found if journal.files and not journal.is_ours), None)


# --- records ------------------------------------------------------------------------------------------------


def write_record(path: Path, run: str, step: Step) -> None:
    """Write the record of a step of a run."""
    about = {
        "journal_version": VERSION,
        "hexcontact_version": __version__,
        "run": run,
        "index": step.index,
        "lattice": dataclasses.asdict(step.lattice),
        "history": dict(step.history),
        "control": dict(step.control),
    }
    text = json.dumps(about, default=np.generic.item).encode()
    with zipfile.ZipFile(path, "w") as file:
        _write(file, _ABOUT, [np.frombuffer(text, "u1")], (len(text),), "u1")
        for name in step.fields:
            _write(file, name, bands_of(step.fields, name), step.lattice.shape, VARIABLES[name].dtype)
        for name, values in step.companion.items():
            _write(file, f"{_COMPANION}{name}", [values], values.shape, values.dtype)
        file.comment = _seal_of(file)


def _write(
    archive: zipfile.ZipFile,
    name: str,
    bands: Iterable[NDArray[Any]],
    shape: tuple[int, ...],
    dtype: DTypeLike,
) -> None:
    """Write an array to a record, band by band."""
    descr = np.lib.format.dtype_to_descr(np.dtype(dtype))
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        about = {"descr": descr, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(member, about)
        for band in bands:
            member.write(np.ascontiguousarray(band, dtype).data.cast("B"))


def _seal_of(archive: zipfile.ZipFile) -> bytes:
    """Return the digest of the checksums of all members, which zipfile compares as it reads them."""
    members = [(member.filename, member.file_size, member.CRC) for member in archive.infolist()]
    return f"hexcontact {_digest(members)}".encode()


def read_record(path: Path, restart: bool = False) -> tuple[dict[str, Any], Step]:
    """Read the text and the step of a record; on request with its restart data.

    Fields of a large one are read at their use; before a restart they are compared with their checksums.
    """
    with reading(path, _KIND), zipfile.ZipFile(path) as file:
        about = _about(file, path)
        names = [name.removesuffix(".npy") for name in file.namelist() if name != f"{_ABOUT}.npy"]
        others = [name for name in names if name.startswith(_COMPANION)]
        fields: Mapping[str, NDArray[Any]] = Stored(path, [name for name in names if name not in others])
        if path.stat().st_size < LARGE:
            fields = {name: _array(file, name) for name in fields}
        elif restart and (name := file.testzip()):
            raise ValueError(f"Bad CRC-32 for file {name!r}")
        lattice = made(Lattice, {**about["lattice"], "origin": tuple(about["lattice"]["origin"])})
        beside = {name.removeprefix(_COMPANION): _array(file, name) for name in others if restart}
        return about, Step(about["index"], lattice, fields, about["history"], beside, about["control"])


def read_about(path: Path) -> dict[str, Any]:
    """Read the text of a record."""
    with reading(path, _KIND), zipfile.ZipFile(path) as file:
        return _about(file, path)


def _about(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the text of a record, and compare its seal."""
    about: dict[str, Any] = json.loads(_array(archive, _ABOUT).tobytes())
    _require_layout(about, path)
    if archive.comment != _seal_of(archive):
        raise DeckError(_CHANGED.format(path))
    return about


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return an array of a record; zipfile compares its checksum at the end."""
    with archive.open(f"{name}.npy") as member:
        values: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
        member.read()  # to the end, also if a damaged header asks for less
        return values


def _bands(archive: zipfile.ZipFile, name: str) -> Iterator[NDArray[Any]]:
    """Read an array of a record in bands of rows; zipfile compares its checksum at the end."""
    with archive.open(f"{name}.npy") as member:
        np.lib.format.read_magic(member)
        (n_row, n_col), _, dtype = np.lib.format.read_array_header_1_0(member)
        for first in range(0, n_row, BAND):
            shape = min(BAND, n_row - first), n_col
            yield np.frombuffer(member.read(math.prod(shape) * dtype.itemsize), dtype).reshape(shape)
        member.read()  # to the end, also if a damaged header asks for less


class Stored(Banded):
    """Fields of a record, each read at every access: an output takes one after the other."""

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        super().__init__(names)
        self._path = path

    def bands(self, name: str) -> Iterator[NDArray[Any]]:
        """Read a field in bands; DeckError if the file has been damaged since."""
        with reading(self._path, _KIND), zipfile.ZipFile(self._path) as file:
            yield from _bands(file, name)


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
        return (self.folder / HEADER).exists() or (self.folder / _EARLIER).exists()

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
        for path in sorted(self.folder.glob("[0-9]*_[0-9]*.json")):
            about = read_sealed(path)
            self.check(run, about.pop("run"))
            with reading(path, "a finished lattice"):
                found.append(made(Solution, {**about, "origin": tuple(about["origin"])}))
        return found

    def add(self, solution: Solution) -> None:
        """Write a finished lattice, and delete the load steps that are no longer needed."""
        path = self.path(solution.level, solution.copy).with_suffix(".json")
        write_sealed(path, {"run": self.metadata.run, **solution._asdict()})
        # those of the shifted copy, or of the lattice that this one refines
        done = path.with_suffix(".nc") if solution.copy else self.path(solution.level - 1)
        Journal(journal_of(done)).clear()

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
