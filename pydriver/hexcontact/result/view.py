"""One load step of a result, ready to be drawn, cut or compared."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from ..analytic.hertz_gap import SIMILAR, QuadraticGap
from ..core.interpolation import linear
from ..text import visible
from ..variables import LARGEST, NOT_KEPT
from .pressure_field import PressureField
from .result import Result

if TYPE_CHECKING:
    import xarray

    from ..analytic import EllipticContact

    Results = Result | xarray.Dataset | Sequence[Result | xarray.Dataset]

Array = NDArray[np.float64]

STICK = 1  # value of zone at a sticking node
_PREFIX = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit that bring a quantity into 1 ... 1000: ``scaled(8.5e8, "Pa")`` is ``(1e-6, "MPa")``.

    Parameters
    ----------
    largest : float
        Largest magnitude, SI.
    unit : str
        SI unit; "1" or empty for a pure number, which is left alone. An area takes the square of a prefix.
    """
    if unit in ("", "1") or not np.isfinite(largest) or largest == 0.0:
        return 1.0, unit.replace("1", "")
    power = 2 if unit == "m2" else 1
    exponent = int(3 * np.floor(np.log10(abs(largest) * 1.0000001) / (3 * power)))
    exponent = min(max(exponent, -12), 9)
    return 10.0 ** (-exponent * power), _PREFIX[exponent] + unit.replace("m2", "m²")


def worded(value: float, unit: str) -> str:
    """Write a quantity with four digits and a prefix: "747.6 µm", "1 kN"."""
    factor, scaled_unit = scaled(value, unit)
    return f"{value * factor:.4g} {scaled_unit}"


def title_of(dataset: xarray.Dataset) -> str:
    """Return the title of a result for pictures, in which no dollar begins a formula."""
    return visible(str(dataset.attrs.get("title", ""))).replace("$", r"\$")


@dataclass(frozen=True)
class StepView:
    """One load step of a result, as pictures need it; lengths in m, pressure in Pa.

    Parameters
    ----------
    title : str
        Title of the case with the step (of several) and its loads.
    number : int
        Number of the step.
    data : xarray.Dataset
        All quantities of the step; the attributes are those of the result.
    x, y, pressure : ndarray, shape (n_row, n_col)
        Coordinates of the nodes and contact pressure.
    contact : ndarray of bool, shape (n_row, n_col)
        Nodes with pressure.
    spacing : float
        l_e.
    basis : ndarray, shape (2, 2)
        Basis vectors of the lattice as rows.
    center : tuple of float
        Center of the Hertz contact, else of the pressure.
    hertz : EllipticContact or None
        Hertz solution, if the initial gap is a quadratic form.
    """

    title: str
    number: int
    data: xarray.Dataset
    x: Array
    y: Array
    pressure: Array
    contact: NDArray[np.bool_]
    spacing: float
    basis: Array
    center: tuple[float, float]
    hertz: EllipticContact | None

    @classmethod
    def of(cls, result: Result | xarray.Dataset, step: int) -> StepView:
        """Look at step number ``step`` (from 1; -1 is the last one) of a result.

        Raises
        ------
        IndexError
            If there is no such step.
        ValueError
            If the pressure of that step was not kept.
        """
        dataset = dataset_of(result)
        one = Result(dataset).step(step)
        if "pressure" not in one:
            raise ValueError("the pressure was not kept (output.fields)")
        pressure = one["pressure"].values
        if not np.isfinite(pressure).any():
            raise ValueError(f"the pressure of step {int(one['step'])} was not kept (output.every)")
        _refuse_nonsense("pressure", pressure)
        x, y = dataset["x"].values, dataset["y"].values
        gap, load = QuadraticGap.of(dataset), float(one["normal_load"])
        if gap is None:
            weight = max(float(pressure.sum()), np.finfo(float).tiny)
            center = (float((pressure * x).sum() / weight), float((pressure * y).sum() / weight))
        else:
            center = gap.center
        named = [title_of(dataset)]
        if dataset.sizes["step"] > 1:
            named.append(f"step {int(one['step'])}")
        title = ", ".join(filter(None, named)) + f" ({_loads(one)})"
        return cls(
            title=title.lstrip(),
            number=int(one["step"]),
            data=one,
            x=x,
            y=y,
            pressure=pressure,
            contact=pressure > 0.0,
            spacing=float(dataset.attrs["lattice_spacing"]),
            basis=np.asarray(dataset.attrs["lattice_basis"], dtype=float).reshape(2, 2),
            center=center,
            hertz=gap.contact(load) if gap and load > 0.0 else None,
        )

    @property
    def friction(self) -> float:
        """Coefficient of friction; 0 for a contact that was solved without friction."""
        if self.data.attrs.get("algorithm", "frictionless") == "frictionless":
            return 0.0
        return float(self.data.attrs.get("friction_coefficient", 0.0))

    @property
    def hertz_holds(self) -> bool:
        """Whether the pressure is that of Hertz: no friction, or similar bodies."""
        similar = abs(float(self.data.attrs.get("dundurs_beta", 1.0))) <= SIMILAR
        return self.hertz is not None and (self.friction == 0.0 or similar)

    @property
    def tangential_load(self) -> float:
        """Tangential load, N: its size, negative if its larger component is."""
        x, y = (float(self.data.get(f"tangential_load_{axis}", 0.0)) for axis in "xy")
        return math.copysign(math.hypot(x, y), x if abs(x) > abs(y) else y)

    def field(self, name: str) -> Array:
        """Values of a field at the nodes.

        Raises
        ------
        ValueError
            If the result, or this step of it, does not hold the field.
        """
        words = name.replace("_", " ")
        if name not in self.data:
            if self.friction == 0.0 and name.startswith(("traction", "slip", "accumulated")):
                raise ValueError(f"a contact without friction has no {words}")
            raise ValueError(f"the {words} was not kept (output.fields)")
        values = self.data[name].values
        if (values == NOT_KEPT).all() if name == "zone" else not np.isfinite(values).any():
            raise ValueError(f"the {words} of step {self.number} was not kept (output.every)")
        _refuse_nonsense(words, values)
        return np.asarray(values, dtype=float)

    @property
    def stick(self) -> NDArray[np.bool_]:
        """Nodes that stick.

        Raises
        ------
        ValueError
            If the contact has no friction, or its zones were not kept.
        """
        if self.friction == 0.0:
            raise ValueError("a contact without friction has no stick and slip zones")
        return np.asarray(self.field("zone") == STICK)

    def at(self, x: Array, y: Array, values: Array | None = None) -> Array:
        """Pressure, or the field with these values at the nodes, at points of the plane (m).

        It is linear on the triangles of the lattice as in the solution, and 0 outside the window.
        """
        return linear(self.pressure if values is None else values, self.basis, self.start, x, y)

    @property
    def start(self) -> tuple[float, float]:
        """Position of the first node of the window, m."""
        return float(self.x[0, 0]), float(self.y[0, 0])

    @functools.cached_property
    def pressure_field(self) -> PressureField | None:
        """Pressure at any point, to the edge between the nodes; None if the gap was not kept."""
        try:
            return PressureField(self.pressure, self.field("gap"), self.basis, self.start)
        except ValueError:
            return None

    def window(self, margin: float = 1.25) -> tuple[float, float, float, float]:
        """Limits of a picture of the contact: x_min, x_max, y_min, y_max."""
        zone = self.contact if self.contact.any() else np.ones_like(self.contact)
        x, y = self.x[zone], self.y[zone]
        middle_x, middle_y = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min())
        half_x = max(0.5 * margin * (x.max() - x.min()), 2 * self.spacing)
        half_y = max(0.5 * margin * (y.max() - y.min()), 2 * self.spacing)
        return middle_x - half_x, middle_x + half_x, middle_y - half_y, middle_y + half_y


def _refuse_nonsense(words: str, values: Array) -> None:
    """Refuse a field of a file that somebody has changed: what is computed with it would overflow."""
    if (abs(values) > LARGEST).any():
        raise ValueError(f"the {words} holds numbers that no contact has")


def _loads(one: xarray.Dataset) -> str:
    """Name the loads of a step: the normal load, and those that friction has to work for."""
    normal = float(one["normal_load"])
    carried = min(float(one.attrs.get("friction_coefficient", 1.0)), 1.0) * normal
    named = [f"$P$ = {worded(normal, 'N')}"]
    for sign, name, unit, least in (
        ("Q_x", "tangential_load_x", "N", 1e-3 * carried),
        ("Q_y", "tangential_load_y", "N", 1e-3 * carried),
        ("M_z", "torque", "N m", 5e-3 * carried * float(one.get("contact_radius", 1.0))),
    ):
        value = float(one.get(name, 0.0))
        if abs(value) > least:
            named.append(f"${sign}$ = {worded(value, unit)}")
    return ", ".join(named)


def as_list(results: Results) -> list[Result | xarray.Dataset]:
    """Return the results as a list, also if it is only one."""
    return list(results) if isinstance(results, Sequence) else [results]


def dataset_of(result: Result | xarray.Dataset) -> xarray.Dataset:
    """Return the dataset of a result, or the dataset itself."""
    return cast("xarray.Dataset", getattr(result, "dataset", result))
