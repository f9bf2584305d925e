"""Records of a journal: a finished load step with all its fields, on the disk.

A record is a zip archive of the fields as numpy writes them, uncompressed, and a text (JSON) with all the
rest. It is written and read several times faster than a netCDF file with that many variables, checksums cover
all of it, and damage never leads further than to an error.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import os
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.lattice import Lattice
from ..errors import DeckError
from .check import MATERIALS, fault_of_record
from .layout import Layout, Metadata
from .netcdf import reading
from .step import Step

SUFFIX = ".npz"
VERSION = 1
_ABOUT = "about"  # the text, among the arrays
_COMPANION = "companion_"  # before the names of the fields of a second solution
_CLOSE = 1e-9  # relative difference of moduli that are the same
PHYSICS = ("algorithm", "coupling", "entry")  # keys of [solver] that decide what is solved
_NOT_PHYSICS = ("title", "solver", "output")  # tables of a deck that do not
_OF_NODES = {"spacing", "origin"}  # keys of [grid], which a session writes when a load is added
_OF_SESSIONS = ("grid", "load", "accuracy")  # tables of a deck that change then


def write_record(path: Path, metadata: Metadata, step: Step) -> None:
    """Write a record and flush it to disk.

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
    from .._version import __version__

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
        file.flush()
        os.fsync(file.fileno())


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
    with contextlib.suppress(OSError), path.open("rb") as file:
        return file.read(30)[:4] == b"PK\x03\x04" and file.read(len(_ABOUT)) == _ABOUT.encode()
    return False


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
