"""One load step of a result, ready to be drawn, cut or compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from .result import Result

if TYPE_CHECKING:
    import xarray

    from .analytic import EllipticContact

Array = NDArray[np.float64]

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


@dataclass(frozen=True)
class StepView:
    """One load step of a result, as pictures need it; lengths in m, pressure in Pa.

    Parameters
    ----------
    title : str
        Title of the case with the step (of several) and its normal load.
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
        x, y = dataset["x"].values, dataset["y"].values
        known = _hertz(dataset, float(one["normal_load"]))
        if known is None:
            weight = max(float(pressure.sum()), np.finfo(float).tiny)
            center = (float((pressure * x).sum() / weight), float((pressure * y).sum() / weight))
        else:
            center = known[1]
        named = [str(dataset.attrs.get("title", ""))]
        if dataset.sizes["step"] > 1:
            named.append(f"step {int(one['step'])}")
        title = ", ".join(filter(None, named)) + f" (P = {worded(float(one['normal_load']), 'N')})"
        return cls(
            title=title.lstrip(),
            x=x,
            y=y,
            pressure=pressure,
            contact=pressure > 0.0,
            spacing=float(dataset.attrs["lattice_spacing"]),
            basis=np.asarray(dataset.attrs["lattice_basis"], dtype=float).reshape(2, 2),
            center=center,
            hertz=known[0] if known else None,
        )

    def at(self, x: Array, y: Array) -> Array:
        """Pressure at points of the plane (m): linear on the lattice's triangles, 0 outside the window."""
        origin = np.array([self.x[0, 0], self.y[0, 0]])
        points = np.stack([np.ravel(x), np.ravel(y)], axis=1) - origin
        col, row = np.linalg.solve(self.basis.T, points.T)
        col, row = np.round(col, 9), np.round(row, 9)  # a node is a node
        i, j = np.floor(col).astype(int), np.floor(row).astype(int)
        u, v = col - i, row - j
        padded = np.pad(self.pressure, 1)

        def node(dj: int, di: int) -> Array:
            n_row, n_col = padded.shape
            return padded[np.clip(j + dj + 1, 0, n_row - 1), np.clip(i + di + 1, 0, n_col - 1)]

        lower = (1 - u - v) * node(0, 0) + u * node(0, 1) + v * node(1, 0)
        upper = (u + v - 1) * node(1, 1) + (1 - v) * node(0, 1) + (1 - u) * node(1, 0)
        return np.asarray(np.where(u + v <= 1, lower, upper).reshape(np.shape(x)))

    def window(self, margin: float = 1.25) -> tuple[float, float, float, float]:
        """Limits of a picture of the contact: x_min, x_max, y_min, y_max."""
        zone = self.contact if self.contact.any() else np.ones_like(self.contact)
        x, y = self.x[zone], self.y[zone]
        middle_x, middle_y = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min())
        half_x = max(0.5 * margin * (x.max() - x.min()), 2 * self.spacing)
        half_y = max(0.5 * margin * (y.max() - y.min()), 2 * self.spacing)
        return middle_x - half_x, middle_x + half_x, middle_y - half_y, middle_y + half_y


def dataset_of(result: Result | xarray.Dataset) -> xarray.Dataset:
    """Return the dataset of a result, or the dataset itself."""
    return cast("xarray.Dataset", getattr(result, "dataset", result))


def _hertz(dataset: xarray.Dataset, load: float) -> tuple[EllipticContact, tuple[float, float]] | None:
    """Hertz solution and its center, if the initial gap is quadratic (sphere, cylinder, paraboloid)."""
    modulus = dataset.attrs.get("effective_modulus")
    if modulus is None or "initial_gap" not in dataset or not load > 0.0:
        return None
    gap, x, y = (dataset[name].values.ravel() for name in ("initial_gap", "x", "y"))
    if gap.size < 12 or not np.isfinite(gap).all() or not np.ptp(gap) > 0.0:
        return None
    size = max(np.ptp(x), np.ptp(y))
    u, v = (x - x.mean()) / size, (y - y.mean()) / size
    forms = np.stack([np.ones_like(u), u, v, 0.5 * u**2, u * v, 0.5 * v**2], axis=1)
    coefficients = np.linalg.lstsq(forms, gap, rcond=None)[0]
    if np.abs(forms @ coefficients - gap).max() > 1e-9 * np.ptp(gap):
        return None
    hessian = np.array([[coefficients[3], coefficients[4]], [coefficients[4], coefficients[5]]]) / size**2
    from .analytic import hertz_ellipse

    try:
        contact = hertz_ellipse(float(modulus), hessian, normal_load=load)
    except ValueError:  # a line contact
        return None
    lowest = -np.linalg.solve(hessian, coefficients[1:3] / size)
    return contact, (float(x.mean() + lowest[0]), float(y.mean() + lowest[1]))
