"""Layout of the load steps of a run in a data set or a file.

The quantities are those of `hexcontact.variables`. `Layout` has dimensions, coordinates and attributes
(CF-1.11) of a run; `assemble` fills an `xarray.Dataset`, `hexcontact.result.netcdf` a file.
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import itertools
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..arrays import Dataset
from ..core.calls import integer
from ..core.lattice import Lattice, Pattern
from ..errors import NoSuchStep
from ..files import made
from ..text import Table, did_you_mean
from ..variables import CONVENTIONS, FIELDS, FIXED, SCHEMA_VERSION, VARIABLES, Variable
from .step import Step, bands_of, in_bands

COORDINATES = ("step", "row", "col", "x", "y")
MISSING = {name: variable.missing for name, variable in VARIABLES.items()}
_ATTRIBUTES_OF = {name: variable.attributes for name, variable in VARIABLES.items()}
_STEPS = 64**2  # nodes of a chunk with several steps


def now() -> str:
    """Return date and time, UTC."""
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


@dataclass(frozen=True)
class Metadata:
    """Data about a run in its result."""

    title: str = ""
    deck: str = ""  # the whole text
    fields: tuple[str, ...] = ()  # of the output; empty: all
    every: int = 1  # the output has the fields of steps of these numbers, and of the last one
    planned_steps: int = 0  # 0: open
    parameters: Mapping[str, Any] = field(default_factory=dict)  # materials, tolerance and others
    run: str = field(default_factory=lambda: uuid.uuid4().hex)
    created: str = field(default_factory=now)  # start of the run, UTC
    version: str = __version__  # of the program at the start
    resumed: tuple[str, ...] = ()  # a line for each time
    deck_file: str = ""  # file names in the deck are relative to it; not in the output

    @property
    def story(self) -> str:
        """Times at which the run was started and resumed, a line for each."""
        return "\n".join([f"{self.created} started by hexcontact {self.version}", *self.resumed])

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> Metadata:
        """Return the metadata from the table of `dataclasses.asdict`, after JSON."""
        return made(cls, {**values, **{name: tuple(values[name]) for name in ("fields", "resumed")}})


class Layout:
    """Dimensions, coordinates, variables and attributes of a result.

    `steps` are all steps in order, heads are enough; `trials` are values on other lattices by
    `hexcontact.variables`.
    """

    def __init__(
        self, metadata: Metadata, steps: Sequence[Step], trials: Mapping[str, Sequence[Any]] | None = None
    ) -> None:
        if not steps:
            raise ValueError("a result needs at least one finished step")
        self.metadata = metadata
        self.steps = steps
        first, *others = [step.lattice for step in steps]
        if any((one.spacing, one.pattern) != (first.spacing, first.pattern) for one in others):
            raise ValueError(
                "the steps of a result share one lattice: spacing, origin and cells must not change"
            )
        self.window = first.joined(*others)
        present = {name for step in steps for name in (*step.fields, *step.history)}
        if unknown := present - VARIABLES.keys():
            raise ValueError(f"the result has no quantity named {', '.join(sorted(unknown))}")
        if metadata.fields:
            present -= set(FIELDS) - set(metadata.fields)
        self.variables = {name: VARIABLES[name] for name in VARIABLES if name in present}
        self.fields = [name for name, v in self.variables.items() if v.dims[-2:] == ("row", "col")]
        self.sizes = {"step": len(steps), "row": self.window.n_row, "col": self.window.n_col}
        self.block = max(1, _STEPS // self.window.size)  # load steps in a chunk
        self.trials = {name: np.array(v, VARIABLES[name].dtype) for name, v in (trials or {}).items()}
        if self.trials:
            self.variables |= {name: VARIABLES[name] for name in self.trials}
            self.sizes["trial"] = len(next(iter(self.trials.values())))

    def attributes_of(self, name: str) -> dict[str, Any]:
        """Return the CF attributes of a variable, with the name of its estimated error."""
        attributes = dict(_ATTRIBUTES_OF[name])
        if (error := f"{name}_error") in self.variables:
            attributes["ancillary_variables"] = error
        return attributes

    def attributes(self, complete: bool) -> dict[str, Any]:
        """Return the global attributes; `complete`: the result has all planned steps."""
        window, metadata = self.window, self.metadata
        return {
            "Conventions": CONVENTIONS,
            "source": f"hexcontact {__version__}",
            "history": metadata.story,
            "hexcontact_version": __version__,
            "schema_version": np.int32(SCHEMA_VERSION),
            "complete": np.int32(complete),
            "lattice_spacing": float(window.spacing),
            "lattice_basis": np.asarray(window.basis, dtype=float).ravel(),
            "lattice_origin": np.asarray(window.origin, dtype=float),
            "lattice_cell_ratio": float(window.cell_ratio),
            "lattice_cell_angle": float(window.cell_angle),
            **({"lattice_direction": float(window.direction)} if window.direction else {}),
            **({"lattice_periodic": np.int32(1)} if window.periodic else {}),
            **metadata.parameters,
            "title": metadata.title,
            "output_fields": " ".join(metadata.fields),
            "output_every": np.int32(metadata.every),
            "planned_steps": np.int32(metadata.planned_steps),
            "run": metadata.run,
            "created": metadata.created,
            "deck": metadata.deck,
        }

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return coordinates along the dimensions, quantities with one value by step, and those of trials."""
        axes = {
            "step": np.array([step.number for step in self.steps], dtype="i4"),
            "row": np.asarray(self.window.rows, dtype="i4"),
            "col": np.asarray(self.window.cols, dtype="i4"),
        }
        histories = {
            name: np.array(
                [step.history.get(name, "" if v.dtype == "str" else MISSING[name]) for step in self.steps],
                dtype=object if v.dtype == "str" else v.dtype,
            )
            for name, v in self.variables.items()
            if v.dims == ("step",)
        }
        return axes | histories | self.trials

    def _rows(self, name: str, step: Step) -> Iterator[NDArray[Any]]:
        """Yield a field of a step on the window of the whole result, in bands as they come."""
        variable, window, lattice = VARIABLES[name], self.window, step.lattice
        kept = name in FIXED or step.number % self.metadata.every == 0 or step.number == self.steps[-1].number
        if not (kept and name in step.fields):
            yield np.broadcast_to(np.asarray(MISSING[name], variable.dtype), window.shape)
            return
        below, left = lattice.row_first - window.row_first, lattice.col_first - window.col_first
        sides, done = (left, window.n_col - left - lattice.n_col), 0
        yield np.full((below, window.n_col), variable.padding, dtype=variable.dtype)
        for band in bands_of(step.fields, name):
            done += len(band)
            if band.shape[1:] != lattice.shape[1:] or done > lattice.n_row:
                raise ValueError(f"{name} of step {step.number} has shape {band.shape}, not {lattice.shape}")
            values = np.asarray(band, dtype=variable.dtype)
            yield np.pad(values, ((0, 0), sides), constant_values=variable.padding) if any(sides) else values
        if done != lattice.n_row:
            raise ValueError(f"{name} of step {step.number} has {done} rows, not {lattice.n_row}")
        yield np.full((window.n_row - below - done, window.n_col), variable.padding, dtype=variable.dtype)

    def fill(self, columns: Mapping[str, Any], steps: Iterable[Step], lock: Any = None) -> None:
        """Fill columns of `fields` from the steps, which are read once; the lock is held to write."""
        lock, steps, done = lock or contextlib.nullcontext(), iter(steps), 0
        fixed: dict[Lattice, Step] = {}  # the first step on each window, for fields of all steps
        while block := list(itertools.islice(steps, self.block)):
            place = slice(done, done := done + len(block))
            with lock:
                for name in columns:
                    if name not in FIXED:
                        self._write(columns[name], place, [self._rows(name, step) for step in block])
            for step in block:
                if step.fields.keys() & FIXED:
                    fixed.setdefault(step.lattice, step)
        with lock:
            for name in FIXED:
                if name in columns:
                    rows = [self._rows(name, step) for step in fixed.values() if name in step.fields]
                    self._write(columns[name], None, rows)

    @staticmethod
    def _write(column: Any, steps: slice | None, given: Sequence[Iterator[NDArray[Any]]]) -> None:
        """Write a field in some steps band by band; None: of all steps, whose windows complete each other."""
        row = 0
        for bands in zip(*map(in_bands, given), strict=True):
            values, *others = bands
            rows = slice(row, row := row + len(values))
            if steps is not None:
                values = np.stack(bands) if others else values[np.newaxis]
            else:
                for other in others:
                    values = np.where(np.isnan(values), other, values)
            column[rows if steps is None else (steps, rows)] = values


def lattice_of(dataset: Dataset) -> Lattice:
    """Return the lattice window of a result."""
    known, rows, cols = dataset.attrs, dataset["row"].values, dataset["col"].values
    keys = {name: f"lattice_{name}" for name in Pattern._fields}  # of which older files have some
    cells = {name: np.asarray(known[key], dtype=float).tolist() for name, key in keys.items() if key in known}
    cells["origin"] = tuple(cells.get("origin", (0.0, 0.0)))
    spacing, first = float(known["lattice_spacing"]), (int(rows[0]), int(cols[0]))
    found = Pattern(**cells).window(spacing, *first, len(rows), len(cols))
    return dataclasses.replace(found, periodic=bool(known.get("lattice_periodic", 0)))


def step_of(dataset: Dataset, number: int) -> Dataset:
    """Return a load step of a result by its number, see `hexcontact.Result.step`."""
    number = integer(number, "step", "the number of a load step, from 1; -1 is the last one")
    numbers = dataset["step"].values
    if -len(numbers) <= number < 0:
        return dataset.isel(step=number)
    if number in numbers:
        return dataset.sel(step=number)
    raise NoSuchStep(f"there is no step {number}; the result has steps {numbers[0]} to {numbers[-1]}")


def history_of(dataset: Dataset) -> list[str]:
    """Return the names of the quantities of a result with one value by step."""
    return [str(name) for name, values in dataset.data_vars.items() if values.dims == ("step",)]


def assemble(
    metadata: Metadata,
    steps: Iterable[Step],
    complete: bool = True,
    trials: Mapping[str, Sequence[Any]] | None = None,
    stopped: str = "",
) -> Dataset:
    """Return the dataset of the steps of a run, which are read twice: no generator.

    `complete`: these are all steps of the run; `trials` as of `Layout`; `stopped`: reason of an early end.
    The layout is described in docs/netcdf.md.
    """
    import xarray

    layout = Layout(metadata, [step.head for step in steps], trials)
    values = {
        name: np.empty([layout.sizes[dim] for dim in VARIABLES[name].dims], VARIABLES[name].dtype)
        for name in layout.fields
    }
    layout.fill(values, steps)
    values |= layout.columns() | {"x": layout.window.x, "y": layout.window.y}
    variables = {
        name: xarray.Variable(v.dims, values[name], layout.attributes_of(name))
        for name, v in VARIABLES.items()
        if name in values
    }
    coordinates = {name: variables.pop(name) for name in COORDINATES}
    attributes = layout.attributes(complete) | ({"stopped": stopped} if stopped else {})
    return xarray.Dataset(variables, coords=coordinates, attrs=attributes)


# --- list of quantities ----------------------------------------------------------------------------------

_GIVEN = {
    ("step", "row", "col"): "at each node, by step",
    ("row", "col"): "at each node",
    ("step",): "by step",
}


class Quantities(dict[str, Variable]):
    """Units, long_name, dims and more of the quantities of a result by name; printed, a table."""

    def __missing__(self, name: str) -> Variable:
        raise KeyError(f"the result has no {name}{did_you_mean(name, self)}")

    @property
    def _table(self) -> Table:
        rows = [
            (name, v.unit.replace("m2", "m²"), _GIVEN[v.dims], v.long_name)
            for name, v in self.items()
            if v.dims in _GIVEN
        ]
        return Table(("quantity", "unit", "given", "meaning"), rows)

    def __repr__(self) -> str:
        """Return the table as text."""
        return str(self._table)

    def _repr_html_(self) -> str:
        return self._table._repr_html_()
