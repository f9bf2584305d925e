"""The tables [[stress]] and [[fatigue]] of a deck, computed from its result, for other programs."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import netcdf_library
from ..arrays import Dataset
from ..deck.below import Fatigue, Stress
from ..deck.read import recorded
from ..errors import DeckError
from ..files import reading, remove_stale, replacing
from ..text import counted, quantity
from .stress import place_of

STRESS, FATIGUE = "stress below the surface", "fatigue parameters"


def tables_of(deck: str) -> dict[str, Stress | Fatigue]:
    """Return the tables [[stress]] and [[fatigue]] of a deck by their names, stress_1, ... without one."""
    tables = recorded(deck).tables("stress", "fatigue")
    found: dict[str, Stress | Fatigue] = {}
    for kind in ("stress", "fatigue"):
        for number, table in enumerate(tables.get(kind, []), 1):
            found[table.name or f"{kind}_{number}"] = table
    return found


def files_of(deck: str, output: Path) -> dict[str, Path]:
    """Return the files beside an output for the tables of its deck, by their names."""
    return {name: output.with_name(f"{output.stem}_{name}.nc") for name in tables_of(deck)}


def read_table(path: Path) -> Dataset | None:
    """Return the dataset of a file of stresses or fatigue parameters; None if it is not one."""
    if str(netcdf_library.attributes(path).get("content")) not in (STRESS, FATIGUE):
        return None
    with reading(path), netcdf_library.opened_by_xarray(path) as found:
        return found.load()


def readable_table(path: Path) -> Dataset | None:
    """Return the dataset of a file as `read_table`; None of a damaged one, too."""
    with contextlib.suppress(DeckError):
        return read_table(path)
    return None


def content_of(found: Dataset, path: Path) -> dict[str, Any]:
    """Return the stresses or fatigue parameters of a file as the object that ``info --json`` prints."""
    quantities = {
        str(name): {
            "units": field.attrs.get("units", ""),
            "range": [float(np.nanmin(field)), float(np.nanmax(field))],
            **{key: value for key, value in field.attrs.items() if key.startswith(("least", "largest"))},
        }
        for name, field in found.data_vars.items()
        if field.attrs.get("units") != "rad"
    }
    return {"file": path, **found.attrs, "quantities": quantities}


def lines_of(found: Dataset) -> str:
    """Return lines about a dataset of stresses or fatigue parameters for a terminal."""
    about = found.attrs
    steps = np.atleast_1d(about["steps"] if "steps" in about else found["step"].values).tolist()
    sizes = " x ".join(str(n) for name, n in found.sizes.items() if name != "step") or "1"
    over = f"step {steps[0]}" if len(steps) == 1 else f"steps {steps[0]} to {steps[-1]}"
    lines = [
        str(about["title"]),
        f"{about['content']} of body {about['body']}, {over}, {counted(sizes, 'point')}",
    ]
    for name, values in found.data_vars.items():
        unit = str(values.attrs.get("units", "")).removesuffix("1")
        if unit == "rad":  # of critical planes
            continue
        prefixed = unit if " " not in unit else ""  # Pa2 m takes none
        low, high = (quantity(float(end), prefixed) for end in (np.nanmin(values), np.nanmax(values)))
        extent = f"{low} and more" if name == "life" else f"{low} to {high} {unit[len(prefixed) :]}"
        lines.append(f"  {name:<22} {extent}".rstrip())
        if place := place_of(values):
            lines.append(f"  {'':<22} {place}")
    return "\n".join([*lines, str(about["source"])])


def write_netcdf(found: Dataset, target: Path) -> Path:
    """Write a dataset of stresses or fatigue parameters to a file, complete or not at all."""
    packed = {name: {"zlib": True, "complevel": 1} for name in found.data_vars}
    remove_stale(target)
    with replacing(target) as path:
        netcdf_library.write(found, path, format="NETCDF4_CLASSIC", encoding=packed)
    return target


def as_volume(found: Dataset) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    """Return the points (n, 3) of one step, and their numbers along three directions, the last one fastest.

    z points into body 1, so that depths in body 2 are negative there.
    """
    x, y, depth = (found[name].values for name in ("x", "y", "depth"))
    if "row" in found.sizes:
        x, y, depth = x[None], y[None], depth[:, None, None]
    places = np.broadcast_arrays(x, y, depth if found.attrs["body"] == 1 else -depth)
    shape = places[0].shape
    return np.stack([place.ravel() for place in places], axis=1), (1,) * (3 - len(shape)) + shape
