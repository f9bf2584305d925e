"""A finished load step, the state of a run."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Array, Mask
from ..text import did_you_mean
from .interpolate import NodalStep, loaded

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False, repr=False)
class Step(NodalStep):
    """A finished load step.

    Its quantities are attributes, too: ``step.pressure`` is an array over the nodes, ``step.approach`` a
    number. The arrays are those of the run, not copies, and read-only.

    Attributes
    ----------
    index : int
        Position in the whole history, from 0.
    lattice : Lattice
        Its window.
    fields : mapping of str to ndarray
        Arrays of shape (n_row, n_col), SI; names of `hexcontact.variables`. ``initial_gap`` among them.
    history : mapping of str to number or text
        Values by step; names of `hexcontact.variables`.
    companion : mapping of str to ndarray
        Fields of the second solution of adaptive load steps, for the journal.
    control : mapping of str to number
        Place of an adaptive load step in the history, and data for the choice of the next one, for the
        journal; empty for given load steps.
    prescribed : mapping of str to float
        Prescribed loads (N, N m) and motions (m, rad); empty for a step read from a file.
    load_fraction : float
        Finished share of the load history, from 0 to 1; NaN for a step read from a file.
    ramp_done : float
        Applied share of the ramp of its segment, usually from 0 to 1; NaN for a step read from a file.
    bodies : sequence of Body
        The two bodies; none for a step read from a file.
    friction : float
        Coefficient of friction; 0 without friction, NaN for a law that is more than one coefficient.
    sharp : bool
        Whether the bodies touch without a compliant layer, so that the contact has a sharp edge.
    shear_limit : float
        Bound of the shear traction, Pa; inf: none.
    """

    history: Mapping[str, Any]
    companion: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    control: Mapping[str, Any] = field(default_factory=dict)
    prescribed: Mapping[str, float] = field(default_factory=dict)
    load_fraction: float = math.nan
    ramp_done: float = math.nan
    bodies: Sequence[Any] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.fields, dict | MappingProxyType):  # each is loaded at its use
            return
        safe = {name: _read_only(values) for name, values in self.fields.items()}
        object.__setattr__(self, "fields", MappingProxyType(safe))

    def __reduce__(self) -> tuple[Any, ...]:
        given = {entry.name: getattr(self, entry.name) for entry in dataclasses.fields(self)}
        plain: dict[str, Any] = {name: dict(v) if isinstance(v, Mapping) else v for name, v in given.items()}
        return partial(type(self), **plain), ()

    def __getattr__(self, name: str) -> Any:
        """Return a quantity."""
        if name.startswith("_") or name in ("fields", "history"):  # before they are set
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
        """List the quantities, too."""
        return [*super().__dir__(), *self.fields, *self.history]

    @property
    def x(self) -> Array:
        """Coordinate of each node along x, m."""
        return self.lattice.x

    @property
    def y(self) -> Array:
        """Coordinate of each node along y, m."""
        return self.lattice.y

    @property
    def in_contact(self) -> Mask:
        """Nodes in contact."""
        return np.asarray(self.fields["zone"] > 0)

    @property
    def sticking(self) -> Mask:
        """Nodes that stick."""
        return np.asarray(self.fields["zone"] == 1)

    @property
    def residuals(self) -> dict[str, float]:
        """Residuals of the contact conditions and loads by their symbols: R_n, R_t, R_P, R_Q, R_M."""
        from .history_words import residuals

        return residuals(self.history)

    @property
    def head(self) -> Step:
        """The same step without the values of its fields."""
        return dataclasses.replace(self, fields=dict.fromkeys(self.fields, _NO_VALUES), companion={})

    @property
    def done(self) -> float:
        """Finished share of the load history with adaptive load steps; 0 without."""
        return float(self.control.get("done", 0.0))

    def stress_at(
        self, points: ArrayLike, *components: str, body: int = 1, source: str | None = None
    ) -> xarray.Dataset:
        """Return stresses below the surface at points, x, y and depth (m); see `hexcontact.Result.stress`."""
        from ..interior.stress import Loaded, below

        fields: dict[str, Any] = {**self.history, **loaded(self)}
        given = self.lattice, [fields], self.bodies, body, self.friction
        of = Loaded(*given, surface=lambda _: self.traction_field("edges"))
        return below(of, {"points": points}, components, source=source)

    # --- display --------------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        """Describe the step in a line."""
        from .history_words import describe

        try:
            about = describe(self.history)
        except KeyError:
            about = ", ".join(self.history)
        return f"Step {self.number}: {about}"

    def _repr_html_(self) -> str:
        from ..text import html_table
        from .history_words import extent_of, step_rows

        return html_table(f"Load step {self.number}", ("", ""), step_rows(self.history, extent_of(self)))


def _read_only(values: NDArray[Any]) -> NDArray[Any]:
    if isinstance(values, np.ndarray) and not values.flags.writeable:
        return values
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


_NO_VALUES = _read_only(np.empty(0))  # of the fields of a head
