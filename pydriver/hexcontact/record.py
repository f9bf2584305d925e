"""Records of a journal: a finished load step with all its fields, on the disk.

A record is a zip archive of the fields as numpy writes them, uncompressed, and a text (JSON) with all the
rest. It is written and read several times faster than a netCDF file with that many variables, checksums cover
all of it, and damage never leads further than to an error.
"""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import numpy as np

from .errors import DeckError
from .lattice import Lattice
from .netcdf import reading
from .result import Layout, Metadata, Step
from .result_check import fault_of_record

SUFFIX = ".npz"
VERSION = 1
_ABOUT = "about"  # the text, among the arrays
_COMPANION = "companion_"  # before the names of the fields of a second solution


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
    from ._version import __version__

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
        with np.load(path) as file:
            about = json.loads(file[_ABOUT].tobytes())
            if about["journal_version"] != VERSION:
                raise DeckError(
                    f"{path} was kept by hexcontact {about['hexcontact_version']}, whose journal has the "
                    f"layout {about['journal_version']}; this version reads layout {VERSION}"
                )
            fields = {name: file[name] for name in about["fields"]}
            companion = {name: file[_COMPANION + name] for name in about.get("companion", ())}
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
