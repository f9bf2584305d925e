"""A finished load step: the state of a run between one step and the next."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..text import did_you_mean
from .interpolate import Line, Point, chosen_fields, interpolate, profile, section_line

if TYPE_CHECKING:
    import xarray

    from ..core.lattice import Lattice

Value = float | int | str


@dataclass(frozen=True, repr=False)
class Step:
    """A finished load step.

    Its quantities are attributes, too: ``step.pressure`` is an array over the nodes, ``step.approach`` a
    number. They are the state of the run itself, not a copy, and cannot be written to.

    Attributes
    ----------
    index : int
        Position in the whole history, from 0.
    lattice : Lattice
        Window it was solved on.
    fields : mapping of str to ndarray
        Arrays of shape (n_row, n_col), SI; names of `hexcontact.variables`. ``initial_gap`` among them.
    history : mapping of str to number or text
        Values by step; names of `hexcontact.variables`.
    companion : mapping of str to ndarray
        What else the next step starts from; for the journal only. The fields of the second solution that
        adaptive load steps are compared with.
    control : mapping of str to number
        Where the step stands in the load history, and what chooses the next one; for the journal only.
        Empty where all load steps are given.
    prescribed : mapping of str to float
        The loads (N, N m) and motions (m, rad) that drove the step; empty for a step read from a file.
    load_fraction : float
        How much of the load history is done after the step, from 0 to 1; NaN for a step read from a file.
    ramp_done : float
        How much of the ramp of its segment is applied, usually from 0 to 1; NaN for a step read from a file.
    """

    index: int
    lattice: Lattice
    fields: Mapping[str, NDArray[Any]]
    history: Mapping[str, Value]
    companion: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    control: Mapping[str, Any] = field(default_factory=dict)
    prescribed: Mapping[str, float] = field(default_factory=dict)
    load_fraction: float = math.nan
    ramp_done: float = math.nan

    def __post_init__(self) -> None:
        safe = {name: _read_only(values) for name, values in self.fields.items()}
        object.__setattr__(self, "fields", MappingProxyType(safe))

    def __reduce__(self) -> tuple[Any, ...]:
        given = (getattr(self, entry.name) for entry in dataclasses.fields(self))
        return type(self), tuple(dict(v) if isinstance(v, Mapping) else v for v in given)

    def __getattr__(self, name: str) -> Any:
        """Return a quantity."""
        if name.startswith("_") or name in ("fields", "history"):  # while it is being made
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __getitem__(self, name: str) -> Any:
        """Return a quantity: an array over the nodes, or a number."""
        for values in (self.fields, self.history):
            if name in values:
                return values[name]
        hint = did_you_mean(name, [*self.fields, *self.history])
        raise KeyError(f"a load step of this run has no {name}{hint}")

    def __dir__(self) -> list[str]:
        """Name the quantities too."""
        return [*super().__dir__(), *self.fields, *self.history]

    @property
    def number(self) -> int:
        """Number of the step as users count, from 1."""
        return self.index + 1

    @property
    def x(self) -> NDArray[np.float64]:
        """Coordinate of each node along x, m."""
        return self.lattice.x

    @property
    def y(self) -> NDArray[np.float64]:
        """Coordinate of each node along y, m."""
        return self.lattice.y

    @property
    def in_contact(self) -> NDArray[np.bool_]:
        """Nodes in contact."""
        return np.asarray(self.fields["zone"] > 0)

    @property
    def sticking(self) -> NDArray[np.bool_]:
        """Nodes that stick."""
        return np.asarray(self.fields["zone"] == 1)

    @property
    def residuals(self) -> dict[str, float]:
        """Residuals of the contact conditions and loads by their symbols: R_n, R_t, R_P, R_Q, R_M."""
        from .history import residuals

        return residuals(self.history)

    @property
    def head(self) -> Step:
        """The same step without the values of its fields: small enough to keep."""
        return dataclasses.replace(self, fields=dict.fromkeys(self.fields, np.empty(0)), companion={})

    @property
    def done(self) -> float:
        """Share of the load history that is done, if adaptive load steps make it unknown by number."""
        return float(self.control.get("done", 0.0))

    # --- between the nodes ----------------------------------------------------------------------------------

    def at(self, name: str, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Return a field at points of the plane; see `hexcontact.Result.at`."""
        [values] = chosen_fields([name], self.fields, self.number).values()
        return interpolate(self.lattice, name, values, x, y)

    def profile(self, *names: str, start: Point, end: Point, points: int | None = None) -> xarray.Dataset:
        """Return fields along a line between two points; see `hexcontact.Result.profile`."""
        fields = chosen_fields(names, self.fields, self.number)
        return profile(self.lattice, fields, Line(start, end), points, step=self.number)

    def section(
        self, *names: str, angle: float = 0.0, through: Point | None = None, points: int | None = None
    ) -> xarray.Dataset:
        """Return fields along a line across the contact; see `hexcontact.Result.section`."""
        fields = chosen_fields(names, self.fields, self.number)
        line = section_line(self.lattice, self.fields["pressure"], angle, through)
        return profile(self.lattice, fields, line, points, step=self.number)

    # --- what is shown --------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        """Say in a line where the step stands."""
        from .history import describe

        try:
            about = describe(self.history)
        except KeyError:
            about = ", ".join(self.history)
        return f"Step {self.number}: {about}"

    def _repr_html_(self) -> str:
        from ..text import html_table
        from .history import step_rows

        return html_table(f"Load step {self.number}", ("", ""), step_rows(self.history))


def _read_only(values: NDArray[Any]) -> NDArray[Any]:
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view
