"""What one does with a result: fields between the nodes and along lines, tables, comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..variables import VARIABLES
from .interpolate import Line, Point, chosen_fields, interpolate, profile, section_line

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]
    import xarray

    from ..analytic.compare import Comparison
    from .quantities import Quantities
    from .result import Result


class ResultTools:
    """Methods of a `Result` that only need its data set."""

    dataset: xarray.Dataset

    @property
    def _result(self) -> Result:
        return cast("Result", self)

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
        return interpolate(self._result.lattice, name, values, x, y)

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
        line = section_line(self._result.lattice, pressure, angle, through)
        return self._along(line, names, step, points)

    def _along(self, line: Line, names: Sequence[str], step: int, points: int | None) -> xarray.Dataset:
        number = int(self._result.step(step)["step"])
        return profile(self._result.lattice, self._fields(names, step), line, points, step=number)

    def _fields(self, names: Sequence[str], step: int) -> dict[str, NDArray[Any]]:
        """Return the values at the nodes of some fields of a step, or of all."""
        data = self._result.step(step)
        known = [str(n) for n, values in data.data_vars.items() if values.dims == ("row", "col")]
        # xarray reads from the file what is asked for only
        return chosen_fields(names, {name: cast(Any, data[name]) for name in known}, int(data["step"]))

    # --- tables ---------------------------------------------------------------------------------------------

    @property
    def quantities(self) -> Quantities:
        """What there is: names, units, meanings. Printed, a table."""
        from .quantities import Quantities

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
        data = self.dataset if step is None else self.dataset.sel(step=[int(self._result.step(step)["step"])])
        chosen = [self._result[name].name for name in names] or list(self._result.history.columns)
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
            self._result[str(quantity)]  # else KeyError
        return compare(self._result.dataset, self._result.step(step), exact, name)
