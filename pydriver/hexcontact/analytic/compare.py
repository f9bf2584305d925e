"""Comparison of a load step with the closed solutions that hold for it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ..errors import DeckError
from ..text import TextTable, html_table, quantity, text_table
from ..variables import VARIABLES, spelled
from .recognise import Exact, closed_solutions

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]
    import xarray
    from rich.table import Table


_HEADERS = ("", "solution", "exact", "computed", "error")


@dataclass(frozen=True)
class Entry:
    """A line of a comparison.

    Attributes
    ----------
    quantity : str
        Name of the quantity.
    solution : str
        Name of the closed solution.
    exact, computed : float
        The two values, SI; NaN for a field.
    error : float
        Their relative difference. For a field, the root mean square of the difference over the nodes in
        contact, relative to the largest value; for a vector relative to the largest of all components.
    """

    quantity: str
    solution: str
    exact: float
    computed: float
    error: float


class Comparison(Sequence[Entry]):
    """Comparison of a load step with closed solutions; printed, a table.

    Parameters
    ----------
    entries : sequence of Entry
        The lines.
    step : int
        Number of the load step.
    note : str
        A remark on them, or the reason why there are none.
    """

    def __init__(self, entries: Sequence[Entry], step: int, note: str = "") -> None:
        self.entries, self.step, self.note = list(entries), step, note

    @overload
    def __getitem__(self, place: int | str) -> Entry: ...

    @overload
    def __getitem__(self, place: slice) -> list[Entry]: ...

    def __getitem__(self, place: int | str | slice) -> Entry | list[Entry]:
        """Return a line by its position, or the first one about a quantity."""
        if isinstance(place, str):
            for entry in self.entries:
                if entry.quantity == place:
                    return entry
            raise KeyError(f"no closed-form solution has {place}")
        return self.entries[place]

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.entries)

    @property
    def largest_error(self) -> float:
        """Largest of the errors; NaN without closed solutions."""
        return max((abs(entry.error) for entry in self.entries), default=math.nan)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the table: quantity, solution, unit, exact, computed, error."""
        import pandas

        table = pandas.DataFrame(self.entries, columns=[entry.name for entry in fields(Entry)])
        table.insert(2, "unit", [VARIABLES[name].units for name in table["quantity"]])
        return table.set_index("quantity")

    def _rows(self) -> list[tuple[str, ...]]:
        return [
            (
                spelled(entry.quantity),
                entry.solution,
                *(quantity(v, VARIABLES[entry.quantity].unit, 6) for v in (entry.exact, entry.computed)),
                f"{100 * entry.error:.3f} % rms"
                if math.isnan(entry.exact)
                else f"{100 * entry.error:+.3f} %",
            )
            for entry in self
        ]

    @property
    def _title(self) -> str:
        return f"Load step {self.step} against closed-form solutions"

    def __repr__(self) -> str:
        """Return the table as text."""
        table = text_table(_HEADERS, self._rows()) if self.entries else ""
        return "\n".join(filter(None, (self._title, table, self.note)))

    def __rich__(self) -> Table:
        """Return the table for a terminal."""
        shown = TextTable(self._title, _HEADERS, self._rows()).__rich__()
        shown.caption = self.note or None
        return shown

    def _repr_html_(self) -> str:
        return html_table(self._title, _HEADERS if self.entries else (), self._rows(), self.note)


# --- comparing ----------------------------------------------------------------------------------------------


def compare(
    dataset: xarray.Dataset, data: xarray.Dataset, exact: Mapping[str, float] | object | None, name: str
) -> Comparison:
    """Compare a load step of a dataset, `data`; see `hexcontact.Result.compare`."""
    number = int(data["step"])
    note = ""
    if exact is None:
        known, note = closed_solutions(dataset, number)
    else:
        known = [_own(exact, name, dataset)]
    entries = [entry for one in known for entry in _entries(data, one)]
    radius = float(data["contact_radius"]) if "contact_radius" in data else 0.0
    if entries and radius:
        spacings = f"{radius / float(dataset.attrs['lattice_spacing']):.3g} spacings in the contact radius"
        note = f"{spacings}; {note}" if note else spacings
    return Comparison(entries, number, note)


def _own(exact: Mapping[str, float] | object, name: str, dataset: xarray.Dataset) -> Exact:
    """Return a given solution."""
    if isinstance(exact, Mapping):
        for quantity_name in exact:
            if dataset[str(quantity_name)].dims != ("step",):
                raise DeckError(f"{quantity_name}: expected a quantity with one value by step")
        return Exact(name, {str(key): float(value) for key, value in exact.items()})
    names = ("normal_load", "approach", "max_pressure", "contact_radius")
    values = {key: float(value) for key in names if (value := getattr(exact, key, None)) is not None}
    if not values:
        raise DeckError(
            "exact: expected values by the names of quantities, or a solution of hexcontact.analytic"
        )
    return Exact(name, {key: value for key, value in values.items() if math.isfinite(value)})


def _entries(data: Any, exact: Exact) -> Iterator[Entry]:
    """Yield the lines of one solution."""
    for name, value in exact.values.items():
        if name in data and math.isfinite(computed := float(data[name])):
            error = (computed - value) / abs(value) if value else (0.0 if computed == 0.0 else math.inf)
            yield Entry(name, exact.solution, value, computed, error)
    if "pressure" not in data:
        return
    inside = data["pressure"].values > 0.0
    x, y = data["x"].values[inside], data["y"].values[inside]
    for name, function in exact.fields.items():
        if name in data and inside.any():
            difference = data[name].values[inside] - function(x, y)
            if np.isfinite(difference).all():
                rms = float(np.sqrt(np.mean(difference**2)))
                yield Entry(name, exact.solution, math.nan, math.nan, rms / exact.scales[name])
