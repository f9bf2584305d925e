"""The result of a run by the names of its quantities, and what one does with it.

Fields between the nodes and along lines, tables, comparison with closed solutions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..text import did_you_mean, html_table, text_table
from ..variables import FIELDS, VARIABLES, Variable
from .interpolate import (
    Line,
    Point,
    PressureField,
    chosen_fields,
    first_node,
    interpolate,
    profile,
    section_line,
)
from .layout import Layout as Layout
from .layout import Metadata as Metadata
from .layout import assemble as assemble
from .layout import history_of, lattice_of, step_of
from .layout import now as now
from .layout import window_of as window_of
from .step import Step as Step

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]
    import xarray

    from ..analytic.compare import Comparison
    from ..core.lattice import Lattice

_HEADERS = ("quantity", "unit", "given", "meaning")
_GIVEN = {
    ("step", "row", "col"): "at each node, by step",
    ("row", "col"): "at each node",
    ("step",): "by step",
}


class Quantities(Mapping[str, Variable]):
    """The quantities that a result holds, by name; printed, a table of them.

    Parameters
    ----------
    names : iterable of str
        Names, see `hexcontact.variables`.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = [name for name in VARIABLES if name in names]

    def __getitem__(self, name: str) -> Variable:
        """Return what a quantity is: units, long_name, dims."""
        if name not in self._names:
            raise KeyError(f"the result has no {name}{did_you_mean(name, self._names)}")
        return VARIABLES[name]

    def __iter__(self) -> Iterator[str]:
        """Go through the names."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._names)

    def _rows(self) -> list[tuple[str, str, str, str]]:
        return [
            (name, v.unit.replace("m2", "m²"), _GIVEN[v.dims], v.long_name)
            for name, v in self.items()
            if v.dims in _GIVEN
        ]

    def __repr__(self) -> str:
        """Return the table as text."""
        return text_table(_HEADERS, self._rows())

    def _repr_html_(self) -> str:
        return html_table("", _HEADERS, self._rows())


class Result:
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
        """Why the accuracy that the deck demands is not reached; empty if it is, or none is demanded."""
        return str(self.dataset.attrs.get("accuracy_shortfall", ""))

    @property
    def lattice(self) -> Lattice:
        """The lattice window that the result covers."""
        return lattice_of(self.dataset)

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
        return step_of(self.dataset, number)

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
        data = self.step(number)
        for name in ("pressure", "gap"):
            if name not in data or not np.isfinite(data[name].values).any():
                raise ValueError(
                    f"the {name} of step {int(data['step'])} was not kept (output.fields, output.every)"
                )
        lattice = self.lattice
        pressure, gap = data["pressure"].values, data["gap"].values
        return PressureField(pressure, gap, lattice.basis, first_node(lattice))

    @property
    def history(self) -> pandas.DataFrame:
        """Table of everything that has one value by step."""
        return self.dataset[history_of(self.dataset)].to_dataframe()

    # --- between the nodes ----------------------------------------------------------------------------------

    def at(self, name: str, x: ArrayLike, y: ArrayLike, step: int = -1) -> NDArray[np.float64]:
        """Return a field at any points of the plane, as the solution means it: linear on the triangles.

        Parameters
        ----------
        name : str
            Name of the field, such as "pressure". Of the zone, that of the nearest node is returned.
        x, y : array_like
            Points (m), broadcast.
        step : int
            Number of the load step, the first is 1; -1 is the last one.

        Returns
        -------
        ndarray
            Values (SI). Outside the window tractions and slip are 0, other fields NaN.

        Raises
        ------
        DeckError
            If there is no such field, or it was not kept.
        IndexError
            If there is no such step.
        """
        [values] = self._fields([name], step).values()
        return interpolate(self.lattice, name, values, x, y)

    def profile(
        self, *names: str, start: Point, end: Point, step: int = -1, points: int | None = None
    ) -> xarray.Dataset:
        """Return fields along a line between two points.

        Along a line a field is a polygon. By default the points are its corners, so that the profile
        joined by straight lines is exactly what the solution means.

        Parameters
        ----------
        *names : str
            Names of fields, such as "pressure"; all that were kept if none is given.
        start, end : tuple of float
            Ends of the line, m.
        step : int
            Number of the load step, the first is 1; -1 is the last one.
        points : int, optional
            Number of evenly spaced points instead.

        Returns
        -------
        xarray.Dataset
            Dimension ``distance`` (m) from the start; ``x`` and ``y`` (m) are coordinates.

        Raises
        ------
        DeckError
            If there is no such field, it was not kept, or the line has no length.
        IndexError
            If there is no such step.
        """
        return self._along(Line(start, end), names, step, points)

    def section(
        self,
        *names: str,
        angle: float = 0.0,
        through: Point | None = None,
        step: int = -1,
        points: int | None = None,
    ) -> xarray.Dataset:
        """Return fields along a line across the whole contact.

        Parameters
        ----------
        *names : str
            Names of fields, such as "pressure"; all that were kept if none is given.
        angle : float
            Direction of the line from x, rad.
        through : tuple of float, optional
            A point on it (m), from which ``distance`` counts; by default the node next to the center of
            pressure.
        step, points : int, optional
            As for `profile`.

        Returns
        -------
        xarray.Dataset
            As for `profile`.

        Raises
        ------
        DeckError
            If there is no such field, it was not kept, or nothing is in contact.
        IndexError
            If there is no such step.
        """
        pressure = self._fields(["pressure"], step)["pressure"]
        line = section_line(self.lattice, pressure, angle, through)
        return self._along(line, names, step, points)

    def _along(self, line: Line, names: Sequence[str], step: int, points: int | None) -> xarray.Dataset:
        number = int(self.step(step)["step"])
        return profile(self.lattice, self._fields(names, step), line, points, step=number)

    def _fields(self, names: Sequence[str], step: int) -> dict[str, NDArray[Any]]:
        """Return the values at the nodes of some fields of a step, or of all."""
        data = self.step(step)
        known = [str(n) for n, values in data.data_vars.items() if values.dims == ("row", "col")]
        # xarray reads from the file only what is used
        return chosen_fields(names, {name: cast(Any, data[name]) for name in known}, int(data["step"]))

    # --- tables ---------------------------------------------------------------------------------------------

    @property
    def quantities(self) -> Quantities:
        """What there is: names, units, meanings. Printed, a table."""
        return Quantities([str(name) for name in self.dataset.variables])

    def to_dataframe(self, *names: str, step: int | None = None) -> pandas.DataFrame:
        """Return quantities as a table; ``attrs["units"]`` of it has their units.

        Parameters
        ----------
        *names : str
            Names of quantities. Without any, or with such as have one value by step only, a line is a load
            step; with fields it is a node of a load step.
        step : int, optional
            Number of the only step that is wanted; -1 is the last one.

        Returns
        -------
        pandas.DataFrame
            SI units. The index is ``step``, or ``step, row, col`` with columns ``x`` and ``y``.

        Raises
        ------
        KeyError
            If there is no such quantity.
        IndexError
            If there is no such step.
        """
        data = self.dataset if step is None else self.dataset.sel(step=[int(self.step(step)["step"])])
        chosen = [self[name].name for name in names] or list(self.history.columns)
        fields = any("row" in data[name].dims for name in chosen)
        for name in () if fields else ("x", "y"):
            data = data.drop_vars(name)
        index = ["step", "row", "col"] if fields else ["step"]
        table = data[chosen].to_dataframe(dim_order=index)
        if fields:
            table = table[["x", "y", *(name for name in chosen if name not in ("x", "y"))]]
        table.attrs["units"] = {str(n): VARIABLES[str(n)].units for n in table.columns}
        return table

    def compare(
        self, exact: Mapping[str, float] | object | None = None, step: int = -1, name: str = "given"
    ) -> Comparison:
        """Compare a load step with the closed solutions that hold for it, or with a solution of your own.

        Parameters
        ----------
        exact : optional
            Values (SI) by the names of quantities, or a solution of `hexcontact.analytic`. By default the
            closed solutions are found from the deck and the load history: Hertz, Sneddon and others for the
            pressure, Cattaneo, Mindlin and Deresiewicz for shear, Lubkin for torsion, Spence for dissimilar
            bodies. Each is listed only where it holds.
        step : int
            Number of the load step, the first is 1; -1 is the last one.
        name : str
            What to call a solution of your own.

        Returns
        -------
        Comparison
            A table: quantity, solution, exact, computed, error. Empty, with a reason, where none is known.

        Raises
        ------
        KeyError
            If there is no quantity of a name.
        IndexError
            If there is no such step.
        """
        from ..analytic.compare import compare

        for quantity in exact if isinstance(exact, Mapping) else ():
            self[str(quantity)]  # else KeyError
        return compare(self.dataset, self.step(step), exact, name)

    # --- what is shown --------------------------------------------------------------------------------------

    def close(self) -> None:
        """Let go of the file; only needed before the file is moved or deleted on some systems."""
        self.dataset.close()

    def __repr__(self) -> str:
        """Say in a few lines what is there."""
        from . import html  # with pictures

        fields = [name for name in FIELDS if name in self.dataset]
        table = text_table(("", ""), html.result_rows(self.dataset))
        header = html.result_header(self.dataset, self.path)
        lines = [header, *table.splitlines(), f"fields: {', '.join(fields)}"]
        return "\n  ".join([*lines, *([self.stopped] if self.stopped else [])])

    def _repr_html_(self) -> str:
        from . import html

        return html.result_html(self.dataset, self.path, self.quantities._repr_html_())
