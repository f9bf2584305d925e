"""The quantities of a result, each defined once, with all that tables, pictures, files and the core need.

`VARIABLES` has a row for each quantity. What the rooms need in another order stands below it, derived from
its columns: fields, loads and motions, residuals, panels and maps, arrays of the compiled core.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

SCHEMA_VERSION = 1
CONVENTIONS = "CF-1.11 UGRID-1.0"

# Products of a few numbers between it and its inverse neither overflow nor vanish, and no contact is outside.
LARGEST = 1e30

NAN = float("nan")
NOT_KEPT = -1  # zone of a step whose fields the deck chose not to keep (output.every)


@dataclass(frozen=True)
class Variable:
    """One quantity of the result.

    Attributes
    ----------
    dims : tuple of str
        Some of ``step``, ``row``, ``col``, ``trial``.
    units : str
        SI unit, ``"1"`` for a pure number, empty for text.
    long_name : str
        What it is, in words.
    padding : float or int
        Value at nodes outside the window that a step was solved on.
    dtype : str
        numpy type in the file; ``"str"`` for text.
    flags : mapping of int to str
        Meaning of each value, for a quantity that is a code.
    symbol : str
        Symbol of the theory; empty if tables and messages name it in words.
    title : str
        Title of the panel (history) or map (field) that shows it; quantities of one title are shown together.
    motion : str
        Rigid motion (``z``, ``x``, ``y``, ``twist``) that it drives as a load, or is.
    scale : tuple of str and int
        Quantity, and power of the contact radius, whose product it is noise beside; ``("", 0)``: it is none.
    least : float
        Smallest value that a solution can have.
    summary : int
        Place in the summary of a load step, after loads and motions; 0: it is not there.
    required : str
        When a file must have it: ``"always"``, ``"friction"``, or never if empty.
    frictional : bool
        Whether it is a field that a contact without friction does not have.
    estimated : bool
        Whether its discretization error is estimated: a value by step of the solution, not of the work.
    core : str
        Array of fortran/python/f2py_friction.f90 that holds it: ``"fields"``, ``"zone"``, ``"numbers"``,
        ``"residuals"``. The order there is that of the rows here.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    padding: float | int = NAN
    dtype: str = "f8"
    flags: Mapping[int, str] = field(default_factory=dict)
    symbol: str = ""
    title: str = ""
    motion: str = ""
    scale: tuple[str, int] = ("", 0)
    least: float = -LARGEST
    summary: int = 0
    required: str = ""
    frictional: bool = False
    estimated: bool = False
    core: str = ""

    @property
    def is_field(self) -> bool:
        """Whether there is a value at every node in every step."""
        return self.dims == ("step", "row", "col")

    @property
    def missing(self) -> float | int:
        """Value that says "not kept"."""
        return NAN if self.dtype == "f8" else NOT_KEPT

    @property
    def unit(self) -> str:
        """Unit as tables write it; empty for a pure number."""
        return "" if self.units == "1" else self.units

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes."""
        attributes: dict[str, Any] = {"long_name": self.long_name}
        if self.units:
            attributes["units"] = self.units
        if self.flags:
            attributes["flag_values"] = np.array(list(self.flags), dtype=self.dtype)
            attributes["flag_meanings"] = " ".join(self.flags.values())
        return attributes


def _node(units: str, long_name: str, **more: Any) -> Variable:
    """Return a value at each node, by step."""
    return Variable(("step", "row", "col"), units, long_name, **more)


def _shear(units: str, long_name: str, **more: Any) -> Variable:
    """Return a field of the state of a contact with friction."""
    return _node(units, long_name, frictional=True, core="fields", **more)


def _scalar(units: str, long_name: str, **more: Any) -> Variable:
    """Return a value of the solution by step, whose discretization error can be estimated."""
    return Variable(("step",), units, long_name, estimated=True, **more)


def _work(units: str, long_name: str, **more: Any) -> Variable:
    """Return a value by step that tells about its solving."""
    return Variable(("step",), units, long_name, **more)


def _residual(symbol: str, long_name: str, required: str = "friction") -> Variable:
    about = {"symbol": symbol, "least": 0.0, "required": required, "core": "residuals"}
    return _work("1", f"residual of the {long_name}, {symbol}", **about)


_ALWAYS = {"required": "always"}
_FRICTION = {"required": "friction"}
_ZONES = {NOT_KEPT: "not_kept", 0: "separated", 1: "stick", 2: "slip"}
_LIMITS = {NOT_KEPT: "not_adaptive", 0: "within_tolerance", 1: "no_smaller_step_helps"}
_PLANE = ("row", "col")
_LOAD, _APPROACH = ("normal_load", 0), ("approach", 0)  # what shear is noise beside
_AREAS, _SLIP = "Contact and stick area", "Slip in the step"

# fmt: off
VARIABLES: dict[str, Variable] = {
    # coordinates
    "step": Variable(("step",), "1", "number of the load step, the first is 1", dtype="i4"),
    "row": Variable(("row",), "1", "lattice index along the second basis vector", dtype="i4"),
    "col": Variable(("col",), "1", "lattice index along the first basis vector", dtype="i4"),
    "x": Variable(_PLANE, "m", "x coordinate of the node"),
    "y": Variable(_PLANE, "m", "y coordinate of the node"),
    # nodes
    "initial_gap": Variable(_PLANE, "m", "gap of the undeformed surfaces at first touch"),
    "pressure": _node(
        "Pa", "contact pressure", padding=0.0, symbol="p", title="Pressure", least=0.0, core="fields"
    ),
    "traction_x": _shear(
        "Pa", "shear traction on body 1 along x", padding=0.0, symbol="q_x", title="Shear traction"
    ),
    "traction_y": _shear(
        "Pa", "shear traction on body 1 along y", padding=0.0, symbol="q_y", title="Shear traction"
    ),
    "gap": _node("m", "gap between the deformed surfaces", core="fields"),
    "zone": _node("1", "contact zone of the node", padding=0, dtype="i1", flags=_ZONES, core="zone"),
    "relative_displacement_x": _shear(
        "m", "displacement of body 1 relative to body 2 along x, less the shift"
    ),
    "relative_displacement_y": _shear(
        "m", "displacement of body 1 relative to body 2 along y, less the shift"
    ),
    "slip_increment_x": _shear("m", "slip during the step along x", padding=0.0, title=_SLIP),
    "slip_increment_y": _shear("m", "slip during the step along y", padding=0.0, title=_SLIP),
    "accumulated_slip": _shear(
        "m", "length of the slip path so far", padding=0.0, title="Accumulated slip", least=0.0
    ),
    "displacement_1_x": _node("m", "surface displacement of body 1 along x"),
    "displacement_1_y": _node("m", "surface displacement of body 1 along y"),
    "displacement_1_z": _node("m", "surface displacement of body 1 into body 1"),
    "displacement_2_x": _node("m", "surface displacement of body 2 along x"),
    "displacement_2_y": _node("m", "surface displacement of body 2 along y"),
    "displacement_2_z": _node("m", "surface displacement of body 2 into body 2"),
    # history
    "normal_load": _scalar(
        "N", "normal load pressing the bodies together",
        symbol="P", title="Normal load", motion="z", least=0.0, core="numbers", **_ALWAYS,
    ),
    "tangential_load_x": _scalar(
        "N", "tangential load on body 1 along x",
        symbol="Q_x", title="Tangential load", motion="x", scale=_LOAD, core="numbers", **_FRICTION,
    ),
    "tangential_load_y": _scalar(
        "N", "tangential load on body 1 along y",
        symbol="Q_y", title="Tangential load", motion="y", scale=_LOAD, core="numbers", **_FRICTION,
    ),
    "torque": _scalar(
        "N m", "torque on body 1 about z",
        symbol="M_z", title="Torque", motion="twist", scale=("normal_load", 1), core="numbers", **_FRICTION,
    ),
    "approach": _scalar(
        "m", "normal approach of the remote parts of the bodies",
        title="Approach", motion="z", core="numbers", **_ALWAYS,
    ),
    "shift_x": _scalar(
        "m", "shift of body 2 relative to body 1 far away along x",
        title="Shift", motion="x", scale=_APPROACH, core="numbers", **_FRICTION,
    ),
    "shift_y": _scalar(
        "m", "shift of body 2 relative to body 1 far away along y",
        title="Shift", motion="y", scale=_APPROACH, core="numbers", **_FRICTION,
    ),
    "twist": _scalar(
        "rad", "rotation of body 2 relative to body 1 far away about z",
        title="Twist", motion="twist", scale=("approach", -1), core="numbers", **_FRICTION,
    ),
    "contact_area": _scalar(
        "m2", "contact area: cells of the nodes in contact", title=_AREAS, least=0.0, **_ALWAYS
    ),
    "stick_area": _scalar(
        "m2", "stick area: cells of the sticking nodes", title=_AREAS, least=0.0, **_FRICTION
    ),
    "contact_radius": _scalar(
        "m", "radius of the disc as large as the contact area", least=0.0, summary=3, **_ALWAYS
    ),
    "contact_area_fit": _scalar("m2", "contact area: to the edge, between the nodes"),
    "contact_radius_fit": _scalar("m", "radius of the disc as large as the fitted contact area"),
    "pressure_center_x": _scalar("m", "x coordinate of the centroid of the pressure"),
    "pressure_center_y": _scalar("m", "y coordinate of the centroid of the pressure"),
    "stick_radius": _scalar(
        "m", "radius of the disc as large as the stick area", least=0.0, summary=4, **_FRICTION
    ),
    "stick_area_fit": _scalar("m2", "stick area: to its edge, between the nodes"),
    "stick_radius_fit": _scalar("m", "radius of the disc as large as the fitted stick area"),
    "stick_center_x": _scalar("m", "x coordinate of the centroid of the stick area", **_FRICTION),
    "stick_center_y": _scalar("m", "y coordinate of the centroid of the stick area", **_FRICTION),
    "stick_min_x": _scalar("m", "smallest x coordinate of a sticking node"),
    "stick_max_x": _scalar("m", "largest x coordinate of a sticking node"),
    "stick_min_y": _scalar("m", "smallest y coordinate of a sticking node"),
    "stick_max_y": _scalar("m", "largest y coordinate of a sticking node"),
    "max_pressure": _scalar(
        "Pa", "largest contact pressure of a node", title="Largest pressure", least=0.0, summary=1, **_ALWAYS
    ),
    "max_traction": _scalar(
        "Pa", "largest shear traction of a node",
        title="Largest shear traction", least=0.0, summary=2, **_FRICTION,
    ),
    "dissipated_energy": _scalar(
        "J", "energy dissipated by friction so far",
        title="Dissipated energy", summary=6, core="numbers", **_FRICTION,
    ),
    "dissipated_energy_step": _scalar("J", "energy dissipated by friction during the step"),
    "elastic_energy": _scalar(
        "J", "elastic energy stored in both bodies", title="Elastic energy", summary=5, **_FRICTION
    ),
    "sweeps": _work("1", "iterations of the solver", dtype="i4", **_ALWAYS),
    "cuts": _work(
        "1", "how often the step was halved until the solver converged", dtype="i4", **_FRICTION
    ),
    "operator_applications": _work(
        "1", "applications of the full flexibility operator", least=0.0, **_ALWAYS
    ),
    "seconds": _work("s", "wall time of the step", least=0.0, **_ALWAYS),
    "residual_normal": _residual("R_n", "normal contact conditions", **_ALWAYS),
    "residual_tangential": _residual("R_t", "friction conditions"),
    "residual_force": _residual("R_P", "normal load", **_ALWAYS),
    "residual_shear_force": _residual("R_Q", "tangential load"),
    "residual_torque": _residual("R_M", "torque"),
    "stick_area_step_error": _work("m2", "bound on the error of the stick area by the size of load steps"),
    "stick_area_step_change": _work("m2", "change of the stick area by load steps of half the size"),
    "traction_step_change": _work(
        "1", "change of the shear tractions by load steps of half the size, share of what friction can carry"
    ),
    "rejected_steps": _work("1", "larger load steps that were tried and rejected", dtype="i4"),
    "step_limited": _work(
        "1", "whether the tolerance of load steps was missed, since smaller ones did not help",
        dtype="i1", flags=_LIMITS,
    ),
    "segment_fraction": _work("1", "fraction of the segment that is done"),
    "segment": _work("1", "segment of the load history, the first is 1", dtype="i4", **_ALWAYS),
    "label": _work("", "label of the segment", dtype="str", **_ALWAYS),
}
# fmt: on

ESTIMATED = tuple(name for name, variable in VARIABLES.items() if variable.estimated)
"""Quantities of the history whose discretization error is estimated."""

VARIABLES |= {
    f"{name}_error": _work(
        VARIABLES[name].units, f"estimated discretization error: {VARIABLES[name].long_name}"
    )
    for name in ESTIMATED
}
VARIABLES |= {
    "trial_level": Variable(("trial",), "1", "how often the lattice of the trial was refined", dtype="i4"),
    "trial_copy": Variable(("trial",), "1", "number of the shifted copy, 0: the lattice itself", dtype="i4"),
    "trial_spacing": Variable(("trial",), "m", "spacing of the lattice of the trial"),
    "trial_origin_x": Variable(("trial",), "m", "x coordinate of a node of the trial"),
    "trial_origin_y": Variable(("trial",), "m", "y coordinate of a node of the trial"),
    "trial_nodes": Variable(("trial",), "1", "nodes of the window of the trial", dtype="i4"),
}
VARIABLES |= {
    f"trial_{name}": Variable(
        ("trial", "step"), VARIABLES[name].units, f"on each trial: {VARIABLES[name].long_name}"
    )
    for name in ESTIMATED
}

# --- derived ------------------------------------------------------------------------------------------------


def names_where(matches: Callable[[Variable], object]) -> tuple[str, ...]:
    """Return the names of the quantities whose columns fulfil a condition, in the order of the table."""
    return tuple(name for name, variable in VARIABLES.items() if matches(variable))


def grouped(column: Callable[[str, Variable], str]) -> dict[str, tuple[str, ...]]:
    """Return names of quantities by the value of a column; those without a value are left out."""
    groups: dict[str, tuple[str, ...]] = {}
    for name, variable in VARIABLES.items():
        if value := column(name, variable):
            groups[value] = (*groups.get(value, ()), name)
    return groups


FIELDS = names_where(lambda v: v.is_field)
FRICTIONLESS_FIELDS = names_where(lambda v: v.is_field and not v.frictional)
STATE = {
    False: names_where(lambda v: v.is_field and v.core and not v.frictional),
    True: names_where(lambda v: v.is_field and v.core),
}
"""Fields of every step, without and with friction: the state from which the next step starts."""
DISPLACEMENTS = names_where(lambda v: v.is_field and not v.core)
"""Fields that are computed if a deck names them."""

LOADS = grouped(lambda name, v: v.motion)
"""What drives each rigid motion: a load or a displacement. Decks have keys of the same names."""

SUMMARY = tuple(sorted(names_where(lambda v: v.summary), key=lambda name: VARIABLES[name].summary))
RESIDUALS = {VARIABLES[name].symbol: name for name in names_where(lambda v: v.core == "residuals")}
"""Residuals by the symbol of the theory."""

CORE = grouped(lambda name, v: v.core)
"""Names of what each array of the interface with friction holds, in its order."""

VECTORS = grouped(lambda name, v: name[:-2] if v.is_field and name[-2:] in ("_x", "_y", "_z") else "")
"""Components of each vector field by its name, which is theirs without the axis."""

PANELS = dict(
    sorted(
        grouped(lambda name, v: "" if v.is_field else v.title).items(),
        key=lambda panel: VARIABLES[panel[1][0]].summary,
    )
)
"""Quantities of the history that share a panel, by its title: loads and motions first, as in a summary."""

MAPS = grouped(lambda name, v: v.title if v.is_field else "")
"""Fields that have a map by its title: one, or the components of a vector whose length the map shows."""


def spelled(name: str) -> str:
    """Return the name of a quantity as words."""
    return name.replace("_", " ")


def label_of(name: str) -> str:
    """Return what narrow tables call a load or motion: "Qx", "shift x"."""
    return VARIABLES[name].symbol.replace("_", "") or spelled(name)
