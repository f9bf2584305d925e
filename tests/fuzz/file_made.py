"""Results and journals of steps with numbers of their own, for tests of what is on the disk."""

from pathlib import Path

import numpy as np

from hexcontact.core.lattice import Lattice
from hexcontact.result import journal
from hexcontact.result.layout import Metadata
from hexcontact.result.step import Step
from hexcontact.result.store import Store

WINDOW = Lattice(spacing=1e-4, row_first=-4, col_first=-5, n_row=9, n_col=10)


def made_step(index: int, lattice: Lattice = WINDOW) -> Step:
    """Return a step with numbers of its own."""
    rng = np.random.default_rng(index)
    load, pressure = 10.0 * (index + 1), rng.random(lattice.shape)
    fields = {
        "initial_gap": 1e-6 * (lattice.rows[:, None] ** 2 + lattice.cols[None, :] ** 2),
        "pressure": pressure * (load / (pressure.sum() * lattice.cell_area)),
        "gap": rng.random(lattice.shape),
        "zone": rng.integers(0, 3, lattice.shape).astype("i1"),
    }
    history = {"normal_load": load, "seconds": 0.5, "label": f"pressé {index}", "segment": 1}
    return Step(index, lattice, fields, history)


def written(path: Path, count: int = 3, planned: int = 3, **metadata: object) -> Metadata:
    """Write `count` steps; finish if all are there."""
    about = Metadata(title="a case", deck="deck = 1", planned_steps=planned, **metadata)  # type: ignore[arg-type]
    with Store(path, about) as store:
        for index in range(count):
            store.append(made_step(index))
            store.publish()
        if count == planned:
            store.finish()
    return about


def read_record(path: Path) -> tuple[Metadata, Step]:
    """Read a record of a journal, and the metadata of its run."""
    return journal.Journal(path.parent).metadata, journal.read_record(path)[1]
