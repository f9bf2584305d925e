"""The result of a run: what each load step leaves, and how it is laid out in a file.

The quantities are those of `hexcontact.variables`. `Layout` turns a run into dimensions, coordinates
and attributes (CF-1.11); `assemble` fills an `xarray.Dataset` with it, `hexcontact.netcdf` a file.
"""

from __future__ import annotations

import dataclasses
import datetime
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..text import did_you_mean
from ..variables import CONVENTIONS, FIELDS, SCHEMA_VERSION, VARIABLES
from .step import Step
from .tools import ResultTools

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]
    import xarray

    from ..core.lattice import Lattice
    from .pressure_field import PressureField

_COORDINATES = ("step", "row", "col", "x", "y")
_ATTRIBUTES = (  # all but those that describe the case
    *("Conventions", "source", "history", "hexcontact_version", "schema_version", "complete"),
    *("lattice_spacing", "lattice_basis", "lattice_origin"),
    *("title", "output_fields", "output_every", "planned_steps", "run", "created", "deck"),
)


def now() -> str:
    """Return date and time, UTC."""
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _version() -> str:
    from .._version import __version__

    return __version__


@dataclass(frozen=True)
class Metadata:
    """What a result says about the run it comes from.

    Attributes
    ----------
    title : str
        Title of the case.
    deck : str
        The whole deck as text; empty for a case that was built in Python.
    fields : tuple of str
        Fields the output keeps; empty: all that there are.
    every : int
        The output keeps the fields of every so manieth step, and of the last one.
    planned_steps : int
        Load steps the whole run has; 0 while adaptive steps leave it open.
    parameters : mapping of str to number or text
        What else describes the case: materials, tolerance, ...
    run : str
        A name of this run that no other run has.
    created : str
        Start of the run, UTC.
    version : str
        Version of the program that started it.
    resumed : tuple of str
        A line for each time that the run was resumed.
    deck_file : str
        The file that the deck was read from, which its relative file names belong to; not in the output.
    """

    title: str = ""
    deck: str = ""
    fields: tuple[str, ...] = ()
    every: int = 1
    planned_steps: int = 0
    parameters: Mapping[str, Any] = field(default_factory=dict)
    run: str = field(default_factory=lambda: uuid.uuid4().hex)
    created: str = field(default_factory=now)
    version: str = field(default_factory=_version)
    resumed: tuple[str, ...] = ()
    deck_file: str = ""

    @property
    def story(self) -> str:
        """When the run was started and resumed, a line for each."""
        return "\n".join([f"{self.created} started by hexcontact {self.version}", *self.resumed])

    def attributes(self) -> dict[str, Any]:
        """Global attributes of a file."""
        own = {
            "title": self.title,
            "output_fields": " ".join(self.fields),
            "output_every": np.int32(self.every),
            "planned_steps": np.int32(self.planned_steps),
            "run": self.run,
            "created": self.created,
            "deck": self.deck,
        }
        return {**self.parameters, **own}

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> Metadata:
        """Return what `dataclasses.asdict` had, from JSON."""
        tuples = {name: tuple(values[name]) for name in ("fields", "resumed")}
        return cls(**{**values, **tuples})

    @classmethod
    def from_attributes(cls, attributes: Mapping[str, Any]) -> Metadata:
        """Read them back.

        Raises
        ------
        KeyError, ValueError
            If one is missing or not what it should be.
        """
        return cls(
            title=str(attributes["title"]),
            deck=str(attributes["deck"]),
            fields=tuple(str(attributes["output_fields"]).split()),
            every=int(attributes["output_every"]),
            planned_steps=int(attributes["planned_steps"]),
            parameters={name: value for name, value in attributes.items() if name not in _ATTRIBUTES},
            run=str(attributes["run"]),
            created=str(attributes["created"]),
            version=str(attributes["hexcontact_version"]),
            resumed=tuple(str(attributes["history"]).splitlines()[1:]),
        )


class Layout:
    """Dimensions, coordinates, variables and attributes of a result.

    Parameters
    ----------
    metadata : Metadata
        Where the result comes from, and which fields it keeps.
    steps : sequence of Step
        All its steps (heads are enough), in order.
    trials : mapping of str to sequence, optional
        What was solved on other lattices, by the names of `hexcontact.variables`: values by trial.
    """

    def __init__(
        self, metadata: Metadata, steps: Sequence[Step], trials: Mapping[str, Sequence[Any]] | None = None
    ) -> None:
        if not steps:
            raise ValueError("a result needs at least one finished step")
        self.metadata = metadata
        self.steps = steps
        self.window = _union([step.lattice for step in steps])
        present = {name for step in steps for name in (*step.fields, *step.history)}
        if unknown := present - VARIABLES.keys():
            raise ValueError(f"the result has no quantity named {', '.join(sorted(unknown))}")
        if metadata.fields:
            present -= set(FIELDS) - set(metadata.fields)
        self.variables = {name: VARIABLES[name] for name in VARIABLES if name in present}
        self.sizes = {"step": len(steps), "row": self.window.n_row, "col": self.window.n_col}
        self.trials = {name: np.array(v, VARIABLES[name].dtype) for name, v in (trials or {}).items()}
        if self.trials:
            self.variables |= {name: VARIABLES[name] for name in self.trials}
            self.sizes["trial"] = len(next(iter(self.trials.values())))

    def attributes_of(self, name: str) -> dict[str, Any]:
        """CF attributes of a variable; those with an estimated error name it."""
        attributes = VARIABLES[name].attributes
        if (error := f"{name}_error") in self.variables:
            attributes["ancillary_variables"] = error
        return attributes

    def coordinates(self) -> dict[str, NDArray[Any]]:
        """Values of the coordinates."""
        return {
            "step": np.array([step.number for step in self.steps], dtype="i4"),
            "row": np.asarray(self.window.rows, dtype="i4"),
            "col": np.asarray(self.window.cols, dtype="i4"),
            "x": np.asarray(self.window.x),
            "y": np.asarray(self.window.y),
        }

    def attributes(self, complete: bool) -> dict[str, Any]:
        """Global attributes; `complete` says whether all planned steps are there."""
        from .._version import __version__

        window = self.window
        return {
            "Conventions": CONVENTIONS,
            "source": f"hexcontact {__version__}",
            "history": self.metadata.story,
            "hexcontact_version": __version__,
            "schema_version": np.int32(SCHEMA_VERSION),
            "complete": np.int32(complete),
            "lattice_spacing": float(window.spacing),
            "lattice_basis": np.asarray(window.basis, dtype=float).ravel(),
            "lattice_origin": np.asarray(window.origin, dtype=float),
            **self.metadata.attributes(),
        }

    def keeps(self, position: int) -> bool:
        """Whether the fields of the step at `position` are kept."""
        last = position == len(self.steps) - 1
        return last or self.steps[position].number % self.metadata.every == 0

    @property
    def fields(self) -> list[str]:
        """Names of what has a value at every node."""
        return [name for name, variable in self.variables.items() if variable.dims[-2:] == ("row", "col")]

    def histories(self) -> dict[str, NDArray[Any]]:
        """Values of what has one value by step; texts as objects."""
        return {
            name: np.array(
                [step.history.get(name, "" if v.dtype == "str" else v.missing) for step in self.steps],
                dtype=object if v.dtype == "str" else v.dtype,
            )
            for name, v in self.variables.items()
            if v.dims == ("step",)
        }

    def field(self, name: str, position: int, step: Step) -> NDArray[Any]:
        """Values of a field in one step, padded to the whole window."""
        if self.keeps(position) and name in step.fields:
            return self.padded(name, step)
        variable = self.variables[name]
        return np.full(self.window.shape, variable.missing, dtype=variable.dtype)

    def padded(self, name: str, step: Step) -> NDArray[Any]:
        """Return a field of `step` on the window of the whole result."""
        variable = VARIABLES[name]
        values = np.asarray(step.fields[name], dtype=variable.dtype)
        if values.shape != step.lattice.shape:
            raise ValueError(
                f"{name} of step {step.number} has shape {values.shape}, not {step.lattice.shape}"
            )
        if step.lattice == self.window:
            return values
        return np.asarray(step.lattice.embed(values, self.window, variable.padding), dtype=variable.dtype)

    def initial_gap(self, known: NDArray[Any] | None, step: Step) -> NDArray[Any]:
        """Return the initial gap on the whole window: what is `known` so far, completed by `step`."""
        values = self.padded("initial_gap", step)
        return values if known is None else np.where(np.isnan(known), values, known)


def _union(windows: Sequence[Lattice]) -> Lattice:
    """Return the smallest window that holds all `windows` of one lattice."""
    first = windows[0]
    if any((w.spacing, w.origin) != (first.spacing, first.origin) for w in windows):
        raise ValueError("the steps of a result share one lattice: spacing and origin must not change")
    row_first = min(w.row_first for w in windows)
    col_first = min(w.col_first for w in windows)
    return dataclasses.replace(
        first,
        row_first=row_first,
        col_first=col_first,
        n_row=max(w.row_first + w.n_row for w in windows) - row_first,
        n_col=max(w.col_first + w.n_col for w in windows) - col_first,
    )


def window_of(attributes: Mapping[str, Any], rows: NDArray[Any], cols: NDArray[Any]) -> Lattice:
    """Return the lattice window that the attributes and index coordinates of a file describe."""
    from ..core.lattice import Lattice

    x0, y0 = np.asarray(attributes["lattice_origin"], dtype=float)
    return Lattice(
        spacing=float(attributes["lattice_spacing"]),
        row_first=int(rows[0]),
        col_first=int(cols[0]),
        n_row=len(rows),
        n_col=len(cols),
        origin=(float(x0), float(y0)),
    )


def assemble(
    metadata: Metadata,
    steps: Iterable[Step],
    complete: bool = True,
    trials: Mapping[str, Sequence[Any]] | None = None,
) -> xarray.Dataset:
    """Put the steps of a run together.

    Parameters
    ----------
    metadata : Metadata
        Where the steps come from.
    steps : iterable of Step
        The finished steps in order; gone through twice, so not a generator.
    complete : bool
        Whether these are all steps of the run.
    trials : mapping of str to sequence, optional
        As for `Layout`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``step``, ``row``, ``col``; the layout is described in docs/netcdf.md.
    """
    import xarray

    layout = Layout(metadata, [step.head for step in steps], trials)
    values = {
        name: np.empty([layout.sizes[dim] for dim in VARIABLES[name].dims], VARIABLES[name].dtype)
        for name in layout.fields
        if name != "initial_gap"
    }
    gap = None
    for position, step in enumerate(steps):
        for name, array in values.items():
            array[position] = layout.field(name, position, step)
        if "initial_gap" in step.fields:
            gap = layout.initial_gap(gap, step)
    if gap is not None:
        values["initial_gap"] = gap
    values |= layout.histories() | layout.coordinates() | layout.trials
    variables = {
        name: xarray.Variable(v.dims, values[name], layout.attributes_of(name))
        for name, v in VARIABLES.items()
        if name in values
    }
    coordinates = {name: variables.pop(name) for name in _COORDINATES}
    return xarray.Dataset(variables, coords=coordinates, attrs=layout.attributes(complete))


class Result(ResultTools):
    """A result by the names of its quantities.

    ``result.pressure``, ``result.approach`` and so on are `xarray.DataArray`; everything else
    that xarray can do is there through ``result.dataset``.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `assemble` makes it or `hexcontact.open_result` reads it.
    path : str
        File it was read from; empty if there is none.
    """

    def __init__(self, dataset: xarray.Dataset, path: str = "") -> None:
        self.dataset = dataset
        self.path = path

    def __getattr__(self, name: str) -> xarray.DataArray:
        """Return a quantity."""
        if name.startswith("_") or name in ("dataset", "path"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __getitem__(self, name: str) -> xarray.DataArray:
        """Return a quantity, ``step`` too, which is a method as an attribute."""
        if name in self.dataset.variables:
            return self.dataset[name]
        what = "not in this result" if name in VARIABLES else "no quantity of a result"
        hint = did_you_mean(name, map(str, self.dataset.variables))
        raise KeyError(f"{name} is {what}{hint or '; result.quantities lists what there is'}")

    def __dir__(self) -> list[str]:
        """Name the quantities too."""
        return [*super().__dir__(), *map(str, self.dataset.variables)]

    def __len__(self) -> int:
        """Return the number of load steps."""
        return int(self.dataset.sizes["step"])

    def __contains__(self, name: object) -> bool:
        """Tell whether there is a quantity of this name."""
        return name in self.dataset.variables

    def __iter__(self) -> Iterator[xarray.Dataset]:
        """Go through the load steps."""
        return (self.dataset.isel(step=place) for place in range(len(self)))

    @property
    def case_title(self) -> str:
        """Title of the case."""
        return str(self.dataset.attrs.get("title", ""))

    @property
    def deck(self) -> str:
        """The deck as text; empty for a case that was built in Python."""
        return str(self.dataset.attrs.get("deck", ""))

    @property
    def complete(self) -> bool:
        """Whether all planned load steps are there."""
        return bool(self.dataset.attrs.get("complete", True))

    @property
    def stopped(self) -> str:
        """Why the run ended before its time; empty if it did not, or could not say so."""
        return str(self.dataset.attrs.get("stopped", ""))

    @property
    def shortfall(self) -> str:
        """Why the accuracy that was asked for is not reached; empty if it is, or none was asked for."""
        return str(self.dataset.attrs.get("accuracy_shortfall", ""))

    @property
    def lattice(self) -> Lattice:
        """The lattice window that the result covers."""
        return window_of(self.dataset.attrs, self.dataset["row"].values, self.dataset["col"].values)

    def step(self, number: int) -> xarray.Dataset:
        """Return one load step.

        Parameters
        ----------
        number : int
            Number of the step, the first is 1; -1 is the last one.

        Raises
        ------
        IndexError
            If there is no such step.
        """
        numbers = self.dataset["step"].values
        if -len(self) <= number < 0:
            return self.dataset.isel(step=number)
        if number in numbers:
            return self.dataset.sel(step=number)
        raise IndexError(f"there is no step {number}; the result has steps {numbers[0]} to {numbers[-1]}")

    def pressure_field(self, number: int = -1) -> PressureField:
        """Return the pressure of a load step at any point, a function of x and y (m).

        It goes to zero like a square root at the edge of the contact, which runs between the nodes; the mean
        error against Hertz is a fourth or a fifth of that of the nodal pressures joined linearly.

        Parameters
        ----------
        number : int
            Number of the step, the first is 1; -1 is the last one.

        Raises
        ------
        IndexError
            If there is no such step.
        ValueError
            If pressure or gap of the step were not kept.
        """
        from .pressure_field import PressureField

        data = self.step(number)
        for name in ("pressure", "gap"):
            if name not in data or not np.isfinite(data[name].values).any():
                raise ValueError(
                    f"the {name} of step {int(data['step'])} was not kept (output.fields, output.every)"
                )
        lattice = self.lattice
        start = float(lattice.x[0, 0]), float(lattice.y[0, 0])
        return PressureField(data["pressure"].values, data["gap"].values, lattice.basis, start)

    @property
    def history(self) -> pandas.DataFrame:
        """Table of everything that has one value by step."""
        names = [str(name) for name in self.dataset.data_vars if self.dataset[name].dims == ("step",)]
        return self.dataset[names].to_dataframe()

    def close(self) -> None:
        """Let go of the file; only needed before the file is moved or deleted on some systems."""
        self.dataset.close()

    def __repr__(self) -> str:
        """Say in a few lines what is there."""
        from ..text import text_table
        from .html import result_header, result_rows

        fields = [name for name in FIELDS if name in self.dataset]
        table = text_table(("", ""), result_rows(self))
        lines = [result_header(self), *table.splitlines(), f"fields: {', '.join(fields)}"]
        return "\n  ".join([*lines, *([self.stopped] if self.stopped else [])])

    def _repr_html_(self) -> str:
        from .html import result_html

        return result_html(self)
