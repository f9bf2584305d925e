"""The quantities of a result as a list to look through: name, unit, meaning."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ..text import did_you_mean, html_table, text_table
from ..variables import VARIABLES, Variable

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
            (name, v.units.replace("m2", "m²") if v.units != "1" else "", _GIVEN[v.dims], v.long_name)
            for name, v in self.items()
            if v.dims in _GIVEN
        ]

    def __repr__(self) -> str:
        """Return the table as text."""
        return text_table(_HEADERS, self._rows())

    def _repr_html_(self) -> str:
        return html_table("", _HEADERS, self._rows())
