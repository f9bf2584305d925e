"""One load step of a result for pictures."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Protocol, TypeAlias, TypeVar, cast

import numpy as np

from ..analytic.hertz_gap import friction_of, is_moving, is_worn, pressure_is_frictionless, quadratic
from ..arrays import Array, Dataset, Mask
from ..core.edges import ContactEdges, TractionField, ZoneMesh
from ..core.lattice import Lattice, linear
from ..errors import NotInResult
from ..text import visible, worded
from ..variables import BULK_STRESS, LARGEST, MOVED_GAP, TRACTIONS, VARIABLES, WORN, spelled
from .layout import lattice_of, step_of
from .step import is_kept, nodal

_Field = TypeVar("_Field", Array, Mask)

STICK = 1  # value of zone at a sticking node
MOST_STEPS = 120  # steps with maps; evenly chosen from longer histories
_AROUND = 2  # nodes beyond the ends of a window that repeats, on which edges in it depend


class HasDataset(Protocol):
    """An object with a data set, such as a result."""

    @property
    def dataset(self) -> Dataset:
        """Its data set."""
        ...


AnyResult: TypeAlias = "HasDataset | Dataset"
Results: TypeAlias = "AnyResult | Sequence[AnyResult]"


def title_of(dataset: Dataset) -> str:
    """Return the title of a result for pictures, with escaped dollars."""
    return visible(str(dataset.attrs.get("title", ""))).replace("$", r"\$")


class StepView:
    """A load step of a result, from 1 (-1: the last), for pictures: SI units, arrays over the nodes."""

    def __init__(self, result: AnyResult, step: int, source: str | None = None) -> None:
        dataset = dataset_of(result)
        self.source = source  # of the tractions; None: the edges where they are known
        self.data = step_of(dataset, step)
        self.number = int(self.data["step"])
        self.pressure = self.field("pressure")
        self.contact = self.pressure > 0.0  # nodes with pressure
        self.x, self.y = dataset["x"].values, dataset["y"].values
        self.lattice = lattice_of(dataset)
        self.spacing, self.basis = self.lattice.spacing, self.lattice.basis  # basis vectors as rows
        self.start = self.lattice.start  # position of the first node of the window, m
        gap, load = quadratic(dataset), float(self.data["normal_load"])
        if gap is None:
            weight = max(float(self.pressure.sum()), np.finfo(float).tiny)
            x, y = (float((self.pressure * place).sum() / weight) for place in (self.x, self.y))
        self.center = (x, y) if gap is None else gap.center
        self.hertz = gap.contact(load) if gap and load > 0.0 and not is_worn(self.data) else None
        several = f"step {self.number}" if dataset.sizes["step"] > 1 else ""
        named = ", ".join(filter(None, (title_of(dataset), several)))
        self.title = f"{named} ({_loads(self.data)})" if named else _loads(self.data)

    @property
    def friction(self) -> float:
        """Coefficient of friction; 0 without friction, NaN for a law that is more than one coefficient."""
        return friction_of(self.data.attrs)

    @property
    def hertz_holds(self) -> bool:
        """Whether the pressure is that of Hertz."""
        return self.hertz is not None and pressure_is_frictionless(self.data.attrs)

    @property
    def tangential_load(self) -> float:
        """Tangential load, N: its size, negative if its larger component is."""
        x, y = (float(self.data.get(f"tangential_load_{axis}", 0.0)) for axis in "xy")
        return math.copysign(math.hypot(x, y), x if abs(x) > abs(y) else y)

    @property
    def is_unbounded(self) -> bool:
        """Whether the pressure rises to an end of a surface, where nodal values depend on the spacing."""
        return bool(np.isinf(self.data["max_pressure"]))

    def field(self, name: str) -> Array:
        """Return the values of a field at the nodes; NotInResult if the output lacks it in this step."""
        words = spelled(name)
        if name not in self.data:
            if self.friction == 0.0 and name in VARIABLES and VARIABLES[name].frictional:
                raise NotInResult(f"a contact without friction has no {words}")
            if name in WORN and "wear_cycles" not in self.data:
                raise NotInResult("the surfaces do not wear; a deck with [wear] is needed")
            if name == MOVED_GAP and not is_moving(str(self.data.attrs.get("deck", ""))):
                raise NotInResult("no surface moves with a rolling body; moves = true is needed")
            raise NotInResult(f"the {words} was not kept (output.fields)")
        values = self.data[name].values
        if not is_kept(values):
            raise NotInResult(f"the {words} of step {self.number} was not kept (output.every)")
        if (abs(values) > LARGEST).any():  # of a changed file, whose sums would overflow
            raise NotInResult(f"the {words} holds numbers that no contact has")
        return np.asarray(values, dtype=float)

    @property
    def stick(self) -> Mask:
        """Nodes that stick; NotInResult without friction, or without the zones in the output."""
        if self.friction == 0.0:
            raise NotInResult("a contact without friction has no stick and slip zones")
        return np.asarray(self.field("zone") == STICK)

    def edges(self, stride: int = 1) -> ContactEdges:
        """Return the edges of contact and stick area, of every node or of every second, third, ... one.

        Without the gap in the output they are about half-way between the nodes. Those of a window that
        repeats go on beyond its ends; `every` makes fields for them.
        """
        gap = self.every(self.field("gap") if self.has("gap") else np.zeros_like(self.pressure), stride)
        pressure, contact = self.every(self.pressure, stride), self.every(self.contact, stride)
        start = self.around(stride).start
        return ContactEdges(pressure, gap, contact, np.isfinite(gap), self.basis * stride, start)

    def around(self, stride: int = 1) -> Lattice:
        """Return the window of `every`."""
        lattice, more = self.lattice, _AROUND * stride * self.lattice.periodic
        row, col = lattice.row_first - more, lattice.col_first - more
        n_row, n_col = (n + 2 * more for n in lattice.shape)
        return dataclasses.replace(lattice, row_first=row, col_first=col, n_row=n_row, n_col=n_col)

    def every(self, field: _Field, stride: int = 1) -> _Field:
        """Return a field at every second, third, ... node, also around a window that repeats."""
        around = _AROUND * stride * self.lattice.periodic
        return np.pad(field, around, mode="wrap")[::stride, ::stride]

    def has(self, *names: str) -> bool:
        """Test whether the output has fields of this step."""
        return all(name in self.data and is_kept(self.data[name].values) for name in names)

    @property
    def reserve(self) -> Array:
        """Reserve of friction mu p - |q| (Pa); 0 where nothing can slip."""
        if not (math.isfinite(self.friction) and self.has("traction_x", "traction_y")):
            return np.zeros_like(self.pressure)
        size = np.hypot(self.field("traction_x"), self.field("traction_y"))
        return np.asarray(self.friction * self.pressure - size)

    def stick_mesh(self) -> ZoneMesh:
        """Return the mesh of the stick area up to its edge."""
        return self.edges().mesh(self._sticking[1], False, *self._sticking)

    @property
    def _sticking(self) -> tuple[Mask, Array]:
        """The nodes that stick, and the reserve of friction there, as `edges` takes them."""
        return self.every(self.stick & self.contact), self.every(self.reserve)

    @functools.cached_property
    def tractions(self) -> TractionField:
        """Pressure and shear traction at any point, from the source."""
        return nodal(self.data, self.lattice).traction_field(self.source)

    @functools.cached_property
    def _at_nodes(self) -> dict[str, Array]:
        return dict(zip(TRACTIONS, self.tractions.at_nodes(), strict=True))

    def shown(self, name: str) -> Array:
        """Return a field at the nodes; tractions from the source."""
        values = self.field(name)
        return self._at_nodes[name] if name in TRACTIONS else values

    def at(self, x: Array, y: Array, field: str | Array = "pressure") -> Array:
        """Return a field at points of the plane (m), 0 outside a window that ends.

        Tractions come from the source; other fields, and those given by nodal values, are linear on the
        triangles of the lattice.
        """
        if isinstance(field, str) and field in TRACTIONS:
            return np.asarray(self.tractions(x, y)[TRACTIONS.index(field)])
        values = self.field(field) if isinstance(field, str) else field
        return linear(self.lattice, values, x, y)

    def touches(self, x: Array, y: Array) -> Mask:
        """Test which points of the plane (m) are in contact, to the edge between the nodes."""
        return self._inside(x, y, self.edges().distances())

    def sticks(self, x: Array, y: Array) -> Mask:
        """Test which points of the plane (m) stick, to the edge between the nodes."""
        return self._inside(x, y, self.edges().distances(*self._sticking))

    def _inside(self, x: Array, y: Array, distances: Array) -> Mask:
        """Test which points of the plane have a distance from an edge above zero, given at the nodes."""
        own = slice(_AROUND, -_AROUND) if self.lattice.periodic else slice(None)
        return np.asarray(self.at(x, y, np.ascontiguousarray(distances[own, own])) > 0.0)

    def window(self, margin: float = 1.25) -> tuple[float, float, float, float]:
        """Return the limits of a picture: x_min, x_max, y_min, y_max.

        It shows the contact and the worn area, or all of a window that repeats.
        """
        zone = self.contact | (self.field("worn_depth") > 0.0) if self.has("worn_depth") else self.contact
        zone = zone if zone.any() else np.ones_like(zone)
        x, y = self.x[zone], self.y[zone]
        if self.lattice.periodic:
            (x, y), margin = self.lattice.outline.T, min(margin, 1.1)
        middle_x, middle_y = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min())
        half_x = max(0.5 * margin * (x.max() - x.min()), 2 * self.spacing)
        half_y = max(0.5 * margin * (y.max() - y.min()), 2 * self.spacing)
        return middle_x - half_x, middle_x + half_x, middle_y - half_y, middle_y + half_y


def _loads(one: Dataset) -> str:
    """Name the loads of a step: the normal load, tangential ones that are more than noise, bulk stress."""
    normal = float(one["normal_load"])
    mu = float(one.attrs.get("friction_coefficient", 1.0))
    carried = (mu if mu < 1.0 else 1.0) * normal
    named = [f"$P$ = {worded(normal, 'N')}"]
    least = {
        "tangential_load_x": 1e-3 * carried,
        "tangential_load_y": 1e-3 * carried,
        "torque": 5e-3 * carried * float(one.get("contact_radius", 1.0)),
    }
    for name, share in least.items():
        value = float(one.get(name, 0.0))
        if abs(value) > share:
            named.append(f"${VARIABLES[name].symbol}$ = {worded(value, VARIABLES[name].units)}")
    for name in BULK_STRESS:
        if value := float(one.get(name, 0.0)):
            named.append(rf"bulk $\sigma_{{{name[-2:]}}}$ = {worded(value, 'Pa')}")
    return ", ".join(named).replace("-", "\u2212")


def as_list(results: Results) -> list[AnyResult]:
    """Return one or several results as a list."""
    return list(results) if isinstance(results, Sequence) else [results]


def dataset_of(result: AnyResult) -> Dataset:
    """Return the dataset of a result, or the dataset itself."""
    return cast(Dataset, getattr(result, "dataset", result))


def mapped_steps(result: AnyResult) -> list[int]:
    """Return the numbers of the steps with maps, the last among them."""
    data = dataset_of(result)
    if "pressure" not in data:
        return []
    numbers = data["step"].values.tolist()
    every = int(data.attrs.get("output_every", 1))
    kept = [n for n in numbers if n % every == 0 or n == numbers[-1]]
    stride = math.ceil(len(kept) / MOST_STEPS)
    return kept[::-1][::stride][::-1]


def parameters_of(study: Dataset) -> list[str]:
    """Return the names of the parameters of a study."""
    return [str(name) for name, values in study.coords.items() if "deck_key" in values.attrs]


def last_steps(study: Dataset) -> Dataset:
    """Return the result of a study with the last load step of each case only."""
    if "step" not in study.dims:
        return study
    last = {}
    for name, values in study.items():
        if "step" in values.dims:  # NaN after the last step of a case
            array = values.transpose(..., "step").values
            place = np.maximum(np.isfinite(array).sum(axis=-1, keepdims=True) - 1, 0)
            dims = [dim for dim in values.dims if dim != "step"]
            last[name] = (dims, np.take_along_axis(array, place, axis=-1)[..., 0], values.attrs)
    return study.drop_dims("step").assign(last)
