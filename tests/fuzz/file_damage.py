"""Results and journals with damage: bytes, attributes, variables, records; the same for the same seed."""

import io
import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from fuzz.deck_mutations import garbled

ODD = (
    *("", "nan", "x" * 3000, "\x00", "é", 0, -1, 7, 2**31 - 1, np.nan, np.inf, -1e308, 1e-308),
    *(np.zeros(3), np.zeros(0)),
)
REWRITTEN = ("attribute", "no attribute", "no variable", "values", "type", "size", "of variable", "swap")
RECORDS = (
    *("bytes", "truncated", "gone", "text", "array", "text value", "folder", "more", "lock", "stopped"),
    *("header", "no header"),
)
_CLASSIC = ("i1", "i2", "i4", "f4", "f8", "S1")  # types of variables


def damaged(source: Path, target: Path, rng: random.Random) -> str:
    """Write a damaged copy of a result; return in a few words what was done."""
    kinds: dict[Callable[[Path, Path, random.Random], str], int] = {
        **{_bytes: 5, _truncated: 2, _other: 1, _rewritten: 8},
    }
    return rng.choices(list(kinds), list(kinds.values()))[0](source, target, rng)


def _bytes(source: Path, target: Path, rng: random.Random) -> str:
    data = bytearray(source.read_bytes())
    first = rng.choice((len(data), 4096, 600))  # the beginning holds the structure
    count = rng.choice((1, 8, 64))
    for _ in range(count):
        data[rng.randrange(min(first, len(data)))] = rng.randrange(256)
    target.write_bytes(data)
    return f"{count} bytes of the first {first}"


def _truncated(source: Path, target: Path, rng: random.Random) -> str:
    data = source.read_bytes()
    size = rng.choice((0, 1, 8, 48, 512, rng.randrange(len(data)), rng.randrange(len(data)), len(data) - 1))
    target.write_bytes(data[:size])
    return f"truncated to {size}"


def _other(source: Path, target: Path, rng: random.Random) -> str:
    """Put something there that is no result at all."""
    kind = rng.choice(("folder", "text", "noise", "signature", "netcdf3", "foreign"))
    if kind == "folder":
        target.mkdir()
        (target / "000001.npz").write_bytes(b"x")
    elif kind in ("netcdf3", "foreign"):
        form = "NETCDF3_CLASSIC" if kind == "netcdf3" else "NETCDF4"
        with netCDF4.Dataset(target, "w", format=form) as file:
            file.createDimension("step", 2)
            file.createVariable("pressure", "f8", ("step",))[:] = 1.0
    else:
        texts = {"text": b"title = 1\n", "noise": rng.randbytes(2000)}
        target.write_bytes(texts.get(kind, b"\x89HDF\r\n\x1a\n" + rng.randbytes(2000)))
    return kind


def _rewritten(source: Path, target: Path, rng: random.Random) -> str:
    """Write the file again with an attribute or variable gone, of another kind or full of nonsense."""
    with netCDF4.Dataset(source) as old, netCDF4.Dataset(target, "w", format="NETCDF4") as new:
        attributes = {name: old.getncattr(name) for name in old.ncattrs()}
        names, sizes = list(old.variables), {name: len(dim) for name, dim in old.dimensions.items()}
        what = rng.choice(REWRITTEN)
        victim = rng.choice(list(attributes)) if "attribute" in what else rng.choice(names)
        if what == "attribute":
            attributes[victim] = rng.choice((*ODD, str(attributes[victim])[:-3]))
        elif what == "no attribute":
            del attributes[victim]
        elif what == "size":
            victim = rng.choice(list(sizes))
            sizes[victim] = rng.choice((0, 1, sizes[victim] + 1, max(1, sizes[victim] - 1)))
        new.setncatts(attributes)
        for name, size in sizes.items():
            new.createDimension(name, size)
        for name in names:
            if not (what == "no variable" and name == victim):
                _copy(old.variables[name], new, sizes, what if name == victim else "", rng)
    return f"{what}: {victim}"


def _copy(old: Any, new: Any, sizes: dict[str, int], what: str, rng: random.Random) -> None:
    old.set_auto_maskandscale(False)
    old.set_auto_chartostring(False)
    dims, kind, values = old.dimensions, old.dtype.str[1:], old[...]
    if what == "swap":
        dims = rng.choice((dims[::-1], dims[:-1], (), (*dims, *dims)[:4], ("step",)))
    if what == "type":
        kind = rng.choice([k for k in _CLASSIC if k != kind])
    column = new.createVariable(old.name, kind, dims)
    column.set_auto_maskandscale(False)
    attributes = {name: old.getncattr(name) for name in old.ncattrs() if name != "_FillValue"}
    if what == "of variable" and attributes:
        attributes[rng.choice(list(attributes))] = rng.choice(ODD[:-2])
    column.setncatts(attributes)
    shape = tuple(sizes[dim] for dim in dims)
    if kind == "S1":
        filled = np.full(shape, b"?", "S1")
    else:
        numbers = [1] if values.dtype.kind == "S" else values.astype(kind, casting="unsafe")
        filled = np.resize(numbers, shape or (1,))
    if what == "values" and kind != "S1":
        odd = rng.choice((0, -1, 77, 126) if kind[0] == "i" else (np.nan, np.inf, -1.0, 1e308, 0.0))
        places = np.random.default_rng(rng.randrange(1000)).random(filled.shape) < rng.choice((0.02, 1.0))
        filled = np.where(places, odd, filled)
    elif old.dtype.kind == "S" and kind == "S1" and shape == values.shape:
        filled = values
    column[...] = filled.reshape(shape) if shape else filled.ravel()[0] if filled.size else 0


# --- journals ---------------------------------------------------------------------------------------------


def damaged_journal(source: Path, target: Path, rng: random.Random) -> str:
    """Copy the folder of a journal with damage to one of its files; return what was done."""
    shutil.copytree(source, target)
    record = rng.choice(sorted(target.glob("*.npz")))
    kind = rng.choice(RECORDS)
    if kind == "bytes":
        record.write_bytes(garbled(record.read_bytes(), rng))
    elif kind == "truncated":
        data = record.read_bytes()
        record.write_bytes(data[: rng.choice((0, 4, rng.randrange(len(data))))])
    elif kind == "gone":
        record.unlink()
    elif kind in ("text", "array", "text value"):
        _rewrite_record(record, kind, rng)
    elif kind == "header":
        header = target / "header.json"
        header.write_bytes(garbled(header.read_bytes(), rng))
    elif kind == "no header":
        (target / "header.json").unlink()
    elif kind == "folder":
        record.unlink()
        record.mkdir()
    elif kind == "more":
        (target / rng.choice(("000000.npz", "000009.npz", "999999.npz", "1.npz.tmp"))).write_bytes(b"x")
    elif kind == "lock":
        holders = b"", b"\xff\xfe", b"[]", b'{"process": "x", "host": 3}', b"{}"
        (target / "lock").write_bytes(rng.choice(holders))
    else:
        (target / "stopped.txt").write_bytes(rng.randbytes(100))
    return f"{kind}: {record.name}"


def _rewrite_record(record: Path, kind: str, rng: random.Random) -> None:
    """Write a record again that is a good archive with wrong contents."""
    with np.load(record) as file:
        arrays = {name: file[name] for name in file.files}
    if kind == "array":
        name = rng.choice([name for name in arrays if name != "about"])
        values = arrays[name]
        shapes = values[:-1], values.ravel(), values[:0]
        kinds = values.astype("i1"), values.astype(complex), values * np.nan, values > 0
        arrays[name] = rng.choice((*shapes, *kinds))
    about = json.loads(arrays["about"].tobytes())
    if kind == "text":
        about = rng.choice(({}, [], 1, None, "x", {"journal_version": 1}, about | {"journal_version": 99}))
    elif kind == "text value":
        table = rng.choice((about, about["lattice"], about["history"]))
        name = rng.choice(list(table))
        table[name] = rng.choice((None, "", "x", -1, 0, 10**12, 1e308, [], {}, [1], {"a": 1}, True))
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), "u1")
    with io.BytesIO() as archive:
        np.savez(archive, **arrays)
        record.write_bytes(archive.getvalue())
