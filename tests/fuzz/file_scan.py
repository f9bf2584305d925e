"""Results and journals with one flipped bit, or two blocks that changed places; the same for the same seed.

What is opened has the data that was written, or opening says which file is damaged.
"""

import random
import re
from pathlib import Path
from typing import NamedTuple

import xarray

from hexcontact.errors import DeckError
from hexcontact.result.store import open_result

BLOCKS = (512, 4096)  # bytes


class Scan(NamedTuple):
    """What became of damaged files."""

    same: int
    refused: int
    wrong: list[str]


def aims(data: bytes, dataset: xarray.Dataset) -> list[int]:
    """Return the places in a result of what has no checksum in HDF5: indices of chunks, histories."""
    trees = [match.start() for match in re.finditer(b"TREE", data)]
    columns = [v.values.tobytes() for v in dataset.data_vars.values() if v.dims == ("step",)]
    values = [(data.find(column), len(column)) for column in columns]
    spans = [*((tree, 400) for tree in trees), *((at, size) for at, size in values if at > 0)]
    return [place for at, size in spans for place in range(at, min(at + size, len(data)))]


def damaged(data: bytes, rng: random.Random, aimed: list[int]) -> tuple[bytes, str]:
    """Return data with damage, one in ten times by blocks, and in words where it is."""
    changed = bytearray(data)
    if rng.random() < 0.1:
        size = rng.choice(BLOCKS)
        one, other = (size * rng.randrange(max(1, len(data) // size)) for _ in range(2))
        size = min(size, abs(one - other), len(data) - max(one, other))
        changed[one : one + size], changed[other : other + size] = (
            data[other : other + size],
            data[one : one + size],
        )
        return bytes(changed), f"blocks {one} and {other} of {size} bytes"
    places = aimed if aimed and rng.random() < 0.4 else range(len(data))
    at, bit = rng.choice(places), rng.randrange(8)
    changed[at] ^= 1 << bit
    return bytes(changed), f"bit {bit} of byte {at}"


def opened(path: Path) -> xarray.Dataset:
    """Return all that there is in a result."""
    result = open_result(path)
    try:
        return result.dataset.load()
    finally:
        result.close()


def scan(output: Path, file: Path, seed: int, count: int) -> Scan:
    """Damage a file of a result `count` times, and open the result each time."""
    rng, data, expected = random.Random(seed), file.read_bytes(), opened(output)
    aimed = aims(data, expected) if file == output else []
    same, refused, wrong = 0, 0, []
    try:
        for _ in range(count):
            changed, where = damaged(data, rng, aimed)
            file.write_bytes(changed)
            try:
                found = opened(output)
            except DeckError as error:
                refused += 1
                if str(file) not in str(error):
                    wrong.append(f"{where}: {error}")
            except Exception as error:
                wrong.append(f"{where}: {error!r}")
            else:
                same += 1
                if not found.identical(expected):
                    wrong.append(f"{where}: other data")
    finally:
        file.write_bytes(data)
    return Scan(same, refused, wrong)
