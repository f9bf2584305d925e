"""A program: eight threads open, run, load and drop results; another one uses xarray."""

import faulthandler
import gc
import itertools
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import xarray

import hexcontact

STEEL = {"young_modulus": 2e11, "poisson_ratio": 0.3}
THREADS = 8


def case() -> hexcontact.Case:
    sphere = {**STEEL, "surface": {"shape": "sphere", "radius": 0.01}}
    loads = [{"normal_load": 10.0, "steps": 2}, {"tangential_load_x": 1.0, "steps": 2}]
    return hexcontact.Case(
        body_1=sphere, body_2=STEEL, nodes_in_radius=5, friction_coefficient=0.3, loads=loads
    )


def opened(folder: Path, place: int, turn: int) -> None:
    assert float(hexcontact.open_result(folder / f"f{place}.nc").pressure.max()) > 0.0


def run(folder: Path, place: int, turn: int) -> None:
    result = case().run(folder / f"g{place}_{turn}.nc")
    assert abs(float(result.normal_load[-1]) - 10.0) < 1e-9


def dropped(folder: Path, place: int, turn: int) -> None:
    result = hexcontact.open_result(folder / f"f{(place + 1) % THREADS}.nc")
    result.dataset.load()
    del result
    gc.collect()


def with_xarray(folder: Path, done: threading.Event) -> None:
    """Write, read and drop files that hexcontact has nothing to do with."""
    values = {f"a{k}": (("x", "y"), np.ones((20, 20)), {"units": "m"}) for k in range(20)}
    for path in (folder / f"own{number}.nc" for number in itertools.count()):
        xarray.Dataset(values).to_netcdf(path, engine="netcdf4")
        found = xarray.open_dataset(path, engine="netcdf4")
        assert found.a3.attrs["units"] == "m" and float(found.a3[2, 2]) == 1.0
        del found
        if done.is_set():
            break


def main(folder: Path, kinds: str, turns: int) -> None:
    faulthandler.enable()
    warnings.simplefilter("ignore")
    for place in range(THREADS):
        case().run(folder / f"f{place}.nc")
    works = {"o": opened, "r": run, "d": dropped}
    done, faults = threading.Event(), []
    threading.excepthook = faults.append
    other = threading.Thread(target=with_xarray, args=(folder, done))
    other.start()
    for turn in range(turns):
        threads = [
            threading.Thread(target=works[kinds[(place + turn) % len(kinds)]], args=(folder, place, turn))
            for place in range(THREADS)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    done.set()
    other.join()
    print(faults)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
