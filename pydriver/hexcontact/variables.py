"""The quantities of a result, each defined once, for tables, pictures, files and the core.

`VARIABLES` has a row for each quantity. The lists below it are derived from its columns: fields, loads and
motions, residuals, panels and maps, arrays of the compiled core.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

SCHEMA_VERSION = 1
CONVENTIONS = "CF-1.11 UGRID-1.0"

# Products of a few numbers between it and its inverse neither overflow nor vanish, and no contact is outside.
LARGEST = 1e30

NAN = float("nan")
NOT_KEPT = -1  # zone of a step whose fields are not in the output (output.every)


class Variable(NamedTuple):
    """One quantity of the result."""

    dims: tuple[str, ...]  # some of ``step``, ``row``, ``col``, ``trial``
    units: str  # SI unit, ``"1"`` for a pure number, empty for text
    long_name: str  # its meaning in words
    padding: float | int = NAN  # value at nodes outside the window that a step was solved on
    dtype: str = "f8"  # numpy type in the file; ``"str"`` for text
    flags: Mapping[int, str] = MappingProxyType({})  # meaning of each value, for a quantity that is a code
    symbol: str = ""  # symbol of the theory; empty if tables and messages use words
    title: str = ""  # title of its panel (history) or map (field); quantities of one title share it
    motion: str = ""  # rigid motion (``z``, ``x``, ``y``, ``twist``), also of the load that drives it
    # quantity, and power of the contact radius: noise is small beside their product; ``("", 0)``: none
    scale: tuple[str, int] = ("", 0)
    least: float = -LARGEST  # smallest value of a solution, but for noise beside `scale`
    # largest value: a number, the quantity of the history that it is part of, or ``"window"``, the area of
    # all nodes
    most: float | str = LARGEST
    before: float = 0.0  # value before the first load step; NaN: unknown
    summary: int = 0  # place in the summary of a load step, after loads and motions; 0: none
    required: str = ""  # whether files must have it: ``"always"``, ``"friction"``; empty: never
    # whether it is a field, or a measure of one, that a contact without friction does not have
    frictional: bool = False
    # whether its discretization error is estimated: a value by step of the solution, not of the work
    estimated: bool = False
    # whether it depends on a few nodes at the edge of a zone, so that its error decreases like the root of
    # the spacing
    rough: bool = False
    # whether it depends on the width of the slip zone, so that its error decreases slowly while that is
    # narrower than the lattice resolves
    slip_zone: bool = False
    # part of a state in the core that holds it: ``"fields"`` and ``"zone"``, ``"numbers"`` from which
    # the next step starts, ``"residuals"``, ``"measures"``. ``"wear"``: a field of cycles that wear
    core: str = ""

    @property
    def is_field(self) -> bool:
        """Whether there is a value at every node in every step."""
        return self.dims == ("step", "row", "col")

    @property
    def missing(self) -> float | int:
        """Value of a quantity that was not kept."""
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


_Row = Callable[..., Variable]
_node: _Row = partial(Variable, ("step", "row", "col"))  # a value at each node, by step
_shear: _Row = partial(_node, frictional=True, core="fields")  # a field of the state with friction
_work: _Row = partial(Variable, ("step",))  # a value by step, of the solution or of prescribed quantities
_scalar: _Row = partial(_work, estimated=True)  # a value of the solution, whose lattice error is estimated
_measure: _Row = partial(_scalar, core="measures")
_stick: _Row = partial(_measure, frictional=True)


def _residual(symbol: str, long_name: str, required: str = "friction") -> Variable:
    about = {"symbol": symbol, "least": 0.0, "required": required, "core": "residuals"}
    return _work("1", f"residual of the {long_name}, {symbol}", **about)


def _along(name: str, make: _Row, units: str, long_name: str, **more: Any) -> dict[str, Variable]:
    """Return the components of a vector; x and y take the place of {} in its texts."""
    words = {key for key, value in more.items() if isinstance(value, str)}
    return {
        name.format(axis): make(
            units, long_name.format(axis), **more | {key: more[key].format(axis) for key in words}
        )
        for axis in "xy"
    }


_ALWAYS, _FRICTION = {"required": "always"}, {"required": "friction"}
_ZONES = {NOT_KEPT: "not_kept", 0: "separated", 1: "stick", 2: "slip"}
_LIMITS = {NOT_KEPT: "not_adaptive", 0: "within_tolerance", 1: "no_smaller_step_helps"}
_PLANE = ("row", "col")
_LOAD, _APPROACH = ("normal_load", 0), ("approach", 0)  # scales of noise in shear
_WORK = ("normal_load", 1)
_AREA = {"least": 0.0, "most": "window"}
_FROM_0: dict[str, Any] = {"least": 0.0}
_WORN: dict[str, Any] = {"padding": 0.0, "frictional": True, "core": "wear"}
MOVED_GAP = "moved_gap"  # field of a case with surfaces that move with rolling bodies
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
    "nodal_friction_coefficient": Variable(_PLANE, "1", "coefficient of friction at the node", least=0.0),
    "pressure": _node(
        "Pa", "contact pressure", padding=0.0, symbol="p", title="Pressure", least=0.0, core="fields"
    ),
    **_along(
        "traction_{}", _shear, "Pa", "shear traction on body 1 along {}",
        padding=0.0, symbol="q_{}", title="Shear traction",
    ),
    "gap": _node("m", "gap between the deformed surfaces", core="fields"),
    "zone": _node("1", "contact zone of the node", padding=0, dtype="i1", flags=_ZONES, core="zone"),
    **_along(
        "relative_displacement_{}", _shear, "m",
        "displacement of body 1 relative to body 2 along {}, less the shift",
    ),
    **_along("slip_increment_{}", _shear, "m", "slip during the step along {}", padding=0.0, title=_SLIP),
    "accumulated_slip": _shear(
        "m", "length of the slip path so far", padding=0.0, title="Accumulated slip", least=0.0
    ),
    "dissipation_density": _shear("J/m2", "energy by area dissipated so far", padding=0.0, title="Energy"),
    MOVED_GAP: _node(
        "m", "gap of the undeformed surfaces where those that move have come to",
        frictional=True, core="moves",
    ),
    "worn_depth": _node("m", "depth that is worn off both bodies", title="Worn depth", **_WORN),
    "worn_depth_step_change": _node("m", "change of the worn depth by jumps of half the size", **_WORN),
    "cycle_dissipation_density": _node("J/m2", "energy by area that friction takes in a cycle", **_WORN),
    "cycle_slip_amplitude": _node("m", "slip amplitude of a cycle, a quarter of its slip path", **_WORN),
    **_along("displacement_1_{}", _node, "m", "surface displacement of body 1 along {}"),
    "displacement_1_z": _node("m", "surface displacement of body 1 into body 1"),
    **_along("displacement_2_{}", _node, "m", "surface displacement of body 2 along {}"),
    "displacement_2_z": _node("m", "surface displacement of body 2 into body 2"),
    "normal_load": _scalar(
        "N", "normal load pressing the bodies together",
        symbol="P", title="Normal load", motion="z", least=0.0, core="numbers", **_ALWAYS,
    ),
    **_along(
        "tangential_load_{}", _scalar, "N", "tangential load on body 1 along {}",
        symbol="Q_{}", title="Tangential load", motion="{}", scale=_LOAD, core="numbers", **_FRICTION,
    ),
    "torque": _scalar(
        "N m", "torque on body 1 about z",
        symbol="M_z", title="Torque", motion="twist", scale=_WORK, core="numbers", **_FRICTION,
    ),
    "approach": _scalar(
        "m", "normal approach of the remote parts of the bodies",
        title="Approach", motion="z", core="numbers", **_ALWAYS,
    ),
    **_along(
        "shift_{}", _scalar, "m", "shift of body 2 relative to body 1 far away along {}",
        title="Shift", motion="{}", scale=_APPROACH, core="numbers", **_FRICTION,
    ),
    "twist": _scalar(
        "rad", "rotation of body 2 relative to body 1 far away about z",
        title="Twist", motion="twist", scale=("approach", -1), core="numbers", **_FRICTION,
    ),
    **_along(
        "creepage_{}", _work, "1", "velocity of body 1 less that of body 2 along {}, over that of rolling",
        title="Creepage", scale=("approach", -1), core="rolling",
    ),
    "spin": _work(
        "rad/m", "angular velocity of body 1 less that of body 2 about z over the rolling velocity",
        title="Spin", scale=("approach", -2), core="rolling",
    ),
    "creep_power": _work(
        "J/m", "creep forces times creepages, and torque times spin, with the sign of a loss, by distance",
        title="Frictional power", scale=("normal_load", 0), summary=9, core="rolling",
    ),
    "creep_power_error": _work(
        "J/m", "power that the lattice adds to creep_power, of similar bodies", core="rolling", **_FROM_0
    ),
    "slip_power": _work(
        "J/m", "energy that friction takes by rolled distance",
        title="Frictional power", summary=10, core="rolling",
    ),
    "rolled_distance": _work("m", "distance that the bodies have rolled, step by step", **_FROM_0),
    **{
        f"bulk_strain_{axes}": _work(
            "1", f"bulk strain {axes} of body 1 less that of body 2", core="numbers", frictional=True
        )
        for axes in ("xx", "yy", "xy")
    },
    "mean_pressure": _work(
        "Pa", "normal load over the area of the window, which repeats",
        title="Mean pressure", summary=7, **_FROM_0,
    ),
    "mean_gap": _work(
        "m", "mean of the gap over the window, which repeats",
        title="Mean gap", summary=8, before=NAN, scale=_APPROACH, **_FROM_0,
    ),
    "bulk_body": _work(
        "1", "body that carries the bulk stress", dtype="i4", flags={1: "body_1", 2: "body_2"}
    ),
    **{
        f"bulk_stress_{axes}": _work(
            "Pa", f"bulk stress {axes} of the named body, tension positive", title="Bulk stress"
        )
        for axes in ("xx", "yy", "xy")
    },
    "contact_area": _measure(
        "m2", "contact area: cells of the nodes in contact", title=_AREAS, **_AREA, **_ALWAYS
    ),
    "stick_area": _stick(
        "m2", "stick area: cells of the sticking nodes",
        title=_AREAS, least=0.0, most="contact_area", **_FRICTION,
    ),
    "contact_radius": _measure(
        "m", "radius of the disc as large as the contact area", least=0.0, summary=3, **_ALWAYS
    ),
    "contact_area_fit": _measure("m2", "contact area: to the edge, between the nodes", **_AREA),
    "contact_radius_fit": _measure("m", "radius of the disc as large as the fitted contact area", **_FROM_0),
    "contact_semi_major": _measure(
        "m", "larger half-axis of the ellipse with the moments of that area", **_FROM_0
    ),
    "contact_semi_minor": _measure("m", "smaller half-axis of that ellipse", **_FROM_0),
    "pressure_center_x": _measure("m", "x coordinate of the centroid of the pressure"),
    "pressure_center_y": _measure("m", "y coordinate of the centroid of the pressure"),
    "stick_radius": _stick(
        "m", "radius of the disc as large as the stick area",
        least=0.0, most="contact_radius", summary=4, **_FRICTION,
    ),
    "stick_area_fit": _stick("m2", "stick area: to its edge, between the nodes", slip_zone=True, **_AREA),
    "stick_radius_fit": _stick(
        "m", "radius of the disc as large as the fitted stick area", slip_zone=True, **_FROM_0
    ),
    "stick_center_x": _stick("m", "x coordinate of the centroid of the stick area", **_FRICTION),
    "stick_center_y": _stick("m", "y coordinate of the centroid of the stick area", **_FRICTION),
    "stick_min_x": _stick("m", "smallest x coordinate of a sticking node"),
    "stick_max_x": _stick("m", "largest x coordinate of a sticking node"),
    "stick_min_y": _stick("m", "smallest y coordinate of a sticking node"),
    "stick_max_y": _stick("m", "largest y coordinate of a sticking node"),
    "max_pressure": _measure(
        "Pa", "largest contact pressure of a node; infinite if it rises to an end of a surface",
        title="Max pressure", least=0.0, most=math.inf, summary=1, **_ALWAYS,
    ),
    "max_traction": _stick(
        "Pa", "largest shear traction of a node; infinite like the pressure",
        title="Max traction", least=0.0, most=math.inf, summary=2, rough=True, slip_zone=True, **_FRICTION,
    ),
    "dissipated_energy": _scalar(
        "J", "energy dissipated by friction so far",
        title="Dissipated energy", least=0.0, scale=_WORK, summary=6, slip_zone=True, core="numbers",
        **_FRICTION,
    ),
    "dissipated_energy_path_error": _work(
        "J", "bound on the error of the dissipated energy by the size of load steps",
        least=0.0, frictional=True, core="numbers",
    ),
    "dissipated_energy_step": _scalar(
        "J", "energy dissipated by friction during the step", least=0.0, scale=_WORK, slip_zone=True
    ),
    "wear_cycles": _work("1", "cycles that have worn the surfaces", **_FROM_0),
    "wear_volume": _work("m3", "volume that is worn off both bodies", title="Wear volume", least=0.0),
    "max_worn_depth": _work("m", "largest worn depth of a node", title="Largest worn depth", least=0.0),
    "worn_depth_step_error": _work(
        "m", "bound on the error of the worn depth by jumps, and unworn cycles that are not closed", **_FROM_0
    ),
    "unworn_cycles": _work("1", "cycles that were solved on unworn surfaces", dtype="i4"),
    "unworn_cycle_change": _work(
        "1", "bound on the change of a cycle's wear by further unworn ones, share of the largest", **_FROM_0
    ),
    "cycle_dissipated_energy": _work("J", "energy dissipated by friction in a cycle", **_FROM_0),
    "elastic_energy": _measure(
        "J", "elastic energy stored in both bodies",
        title="Elastic energy", least=0.0, scale=_WORK, summary=5, **_FRICTION,
    ),
    "sweeps": _work("1", "iterations of the solver", dtype="i4", least=0.0, **_ALWAYS),
    "cuts": _work(
        "1", "how often the step was halved until the solver converged", dtype="i4", least=0.0, **_FRICTION
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
    "stick_area_step_error": _work(
        "m2", "bound on the error of the stick area by the size of load steps", **_AREA
    ),
    "stick_area_step_change": _work("m2", "change of the stick area by load steps of half the size"),
    "traction_step_error": _work(
        "1", "bound on the error of the shear tractions by load steps, share of what friction can carry"
    ),
    "traction_step_change": _work(
        "1", "change of the shear tractions by load steps of half the size, share of what friction can carry",
        least=0.0,
    ),
    "rejected_steps": _work("1", "larger load steps that were tried and rejected", dtype="i4"),
    "step_limited": _work(
        "1", "whether the tolerance of load steps was missed, since smaller ones did not help",
        dtype="i1", flags=_LIMITS,
    ),
    "segment_fraction": _work("1", "fraction of the segment that is done", least=0.0, most=1.0),
    "segment": _work("1", "segment of the load history, the first is 1", dtype="i4", least=1.0, **_ALWAYS),
    "label": _work("", "label of the segment", dtype="str", **_ALWAYS),
}

ESTIMATED = tuple(name for name, variable in VARIABLES.items() if variable.estimated)
"""Quantities of the history whose discretization error is estimated."""

VARIABLES |= {
    f"{name}_error": _work(v.units, f"estimated discretization error: {v.long_name}", **_FROM_0)
    for name, v in VARIABLES.items() if v.estimated
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
    f"trial_{name}": Variable(("trial", "step"), v.units, f"on each trial: {v.long_name}")
    for name, v in VARIABLES.items() if v.estimated
}
# fmt: on

# Quantities below the surface, in the order of the core; they follow from a result at any points.
STRESSES: dict[str, Variable] = {
    f"stress_{ab}": Variable((), "Pa", f"component {ab} of the stress, positive in tension")
    for ab in ("xx", "yy", "zz", "xy", "yz", "xz")
}
STRESSES |= {
    **{
        f"principal_stress_{k}": Variable((), "Pa", f"{which} principal stress")
        for k, which in ((1, "largest (most tensile)"), (2, "middle"), (3, "smallest (most compressive)"))
    },
    "von_mises_stress": Variable((), "Pa", "equivalent stress of von Mises", least=0.0),
    "tresca_stress": Variable(
        (), "Pa", "equivalent stress of Tresca, twice the largest shear stress", least=0.0
    ),
    **{f"displacement_{axis}": Variable((), "m", f"displacement of the body along {axis}") for axis in "xyz"},
}

# --- derived ------------------------------------------------------------------------------------------------


def names_where(matches: Callable[[Variable], object]) -> tuple[str, ...]:
    """Return the names of the quantities that fulfil a condition, in the order of the table."""
    return tuple(name for name, variable in VARIABLES.items() if matches(variable))


def grouped(column: Callable[[str, Variable], str]) -> dict[str, tuple[str, ...]]:
    """Return names of quantities by the value of a column; those without a value are left out."""
    groups: dict[str, tuple[str, ...]] = {}
    for name, variable in VARIABLES.items():
        if value := column(name, variable):
            groups[value] = (*groups.get(value, ()), name)
    return groups


# Parameters of a case with a compliant interface.
INTERFACE = ("interface_coefficient", "interface_exponent", "interface_tangential_stiffness")
SHEAR_LIMIT = "shear_limit"  # parameter of a case with a bound of the shear traction
TRACTIONS = ("pressure", "traction_x", "traction_y")
EDGES = ("gap", "zone")  # fields that, with the tractions, locate the edges of contact and stick
FIELDS = names_where(lambda v: v.is_field)
FIXED = tuple(name for name in names_where(lambda v: v.dims == _PLANE) if name not in ("x", "y"))
"""Fields with one value at every node for all steps."""
NODAL_FRICTION = "nodal_friction_coefficient"
FRICTIONLESS_FIELDS = names_where(lambda v: v.is_field and not v.frictional)
_HELD = names_where(lambda v: v.core in ("fields", "zone"))
STATE = {False: tuple(name for name in _HELD if not VARIABLES[name].frictional), True: _HELD}
"""Fields of every step, without and with friction: the state from which the next step starts."""
DISPLACEMENTS = names_where(lambda v: v.is_field and not v.core)
"""Fields that need to be named in a deck."""

WORN = names_where(lambda v: v.core == "wear")  # fields of a cycle that wears the surfaces

BULK_STRAIN = names_where(lambda v: v.long_name.startswith("bulk strain "))
BULK_STRESS = names_where(lambda v: v.long_name.startswith("bulk stress "))
"""Components of the bulk strain and of the bulk stress, xx, yy, xy."""

LOADS = grouped(lambda name, v: v.motion)
"""The load and the displacement that drive each rigid motion. Decks have keys of the same names."""

ROLLED = {
    "z": LOADS["z"],
    "x": ("tangential_load_x", "creepage_x"),
    "y": ("tangential_load_y", "creepage_y"),
    "twist": ("torque", "spin"),
}
"""The load and the motion of rolling bodies, for each rigid motion."""

CREEPAGES = tuple(ROLLED[motion][1] for motion in ("x", "y", "twist"))
"""Creepages and spin, which take the place of shifts and twist where bodies roll."""

SUMMARY = tuple(sorted(names_where(lambda v: v.summary), key=lambda name: VARIABLES[name].summary))
RESIDUALS = {VARIABLES[name].symbol: name for name in names_where(lambda v: v.core == "residuals")}
"""Residuals by the symbol of the theory."""

CORE = grouped(lambda name, v: v.core)
"""Names of the quantities of each part of a state in the core."""

VECTORS = grouped(lambda name, v: name[:-2] if v.is_field and name[-2:] in ("_x", "_y", "_z") else "")
"""Components of each vector field, by their name without the axis."""

PANELS = dict(
    sorted(
        grouped(lambda name, v: "" if v.is_field else v.title).items(),
        key=lambda panel: VARIABLES[panel[1][0]].summary,
    )
)
"""Quantities of the history that share a panel, by its title: loads and motions first, as in a summary."""

MAPS = grouped(lambda name, v: v.title if v.is_field else "")
"""Fields of each map by its title: one, or the components of a vector whose length it shows."""


def spelled(name: str) -> str:
    """Return the name of a quantity as words."""
    return name.replace("_", " ")


def label_of(name: str) -> str:
    """Return the short name of a load or motion: "Qx", "shift x"."""
    return VARIABLES[name].symbol.replace("_", "") or spelled(name)
