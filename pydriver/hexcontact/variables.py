"""The quantities of a result, each defined once: dimensions, unit, meaning, what stands for no value."""

from __future__ import annotations

from collections.abc import Mapping
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
    """One quantity of the result: what a file says about it.

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
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    padding: float | int = NAN
    dtype: str = "f8"
    flags: Mapping[int, str] = field(default_factory=dict)

    @property
    def is_field(self) -> bool:
        """Whether there is a value at every node in every step."""
        return self.dims == ("step", "row", "col")

    @property
    def missing(self) -> float | int:
        """Value that says "not kept"."""
        return NAN if self.dtype == "f8" else NOT_KEPT

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
    return Variable(("step", "row", "col"), units, long_name, **more)


def _scalar(units: str, long_name: str, **more: Any) -> Variable:
    return Variable(("step",), units, long_name, **more)


_ZONES = {NOT_KEPT: "not_kept", 0: "separated", 1: "stick", 2: "slip"}
_LIMITS = {NOT_KEPT: "not_adaptive", 0: "within_tolerance", 1: "no_smaller_step_helps"}
_PLANE = ("row", "col")

VARIABLES: dict[str, Variable] = {
    # coordinates
    "step": Variable(("step",), "1", "number of the load step, the first is 1", dtype="i4"),
    "row": Variable(("row",), "1", "lattice index along the second basis vector", dtype="i4"),
    "col": Variable(("col",), "1", "lattice index along the first basis vector", dtype="i4"),
    "x": Variable(_PLANE, "m", "x coordinate of the node"),
    "y": Variable(_PLANE, "m", "y coordinate of the node"),
    # nodes
    "initial_gap": Variable(_PLANE, "m", "gap of the undeformed surfaces at first touch"),
    "pressure": _node("Pa", "contact pressure", padding=0.0),
    "traction_x": _node("Pa", "shear traction on body 1 along x", padding=0.0),
    "traction_y": _node("Pa", "shear traction on body 1 along y", padding=0.0),
    "gap": _node("m", "gap between the deformed surfaces"),
    "zone": _node("1", "contact zone of the node", padding=0, dtype="i1", flags=_ZONES),
    "relative_displacement_x": _node(
        "m", "displacement of body 1 relative to body 2 along x, less the shift"
    ),
    "relative_displacement_y": _node(
        "m", "displacement of body 1 relative to body 2 along y, less the shift"
    ),
    "slip_increment_x": _node("m", "slip during the step along x", padding=0.0),
    "slip_increment_y": _node("m", "slip during the step along y", padding=0.0),
    "accumulated_slip": _node("m", "length of the slip path so far", padding=0.0),
    "displacement_1_x": _node("m", "surface displacement of body 1 along x"),
    "displacement_1_y": _node("m", "surface displacement of body 1 along y"),
    "displacement_1_z": _node("m", "surface displacement of body 1 into body 1"),
    "displacement_2_x": _node("m", "surface displacement of body 2 along x"),
    "displacement_2_y": _node("m", "surface displacement of body 2 along y"),
    "displacement_2_z": _node("m", "surface displacement of body 2 into body 2"),
    # history
    "normal_load": _scalar("N", "normal load pressing the bodies together"),
    "tangential_load_x": _scalar("N", "tangential load on body 1 along x"),
    "tangential_load_y": _scalar("N", "tangential load on body 1 along y"),
    "torque": _scalar("N m", "torque on body 1 about z"),
    "approach": _scalar("m", "normal approach of the remote parts of the bodies"),
    "shift_x": _scalar("m", "shift of body 2 relative to body 1 far away along x"),
    "shift_y": _scalar("m", "shift of body 2 relative to body 1 far away along y"),
    "twist": _scalar("rad", "rotation of body 2 relative to body 1 far away about z"),
    "contact_area": _scalar("m2", "contact area: cells of the nodes in contact"),
    "stick_area": _scalar("m2", "stick area: cells of the sticking nodes"),
    "contact_radius": _scalar("m", "radius of the disc as large as the contact area"),
    "contact_area_fit": _scalar("m2", "contact area: to the edge, between the nodes"),
    "contact_radius_fit": _scalar("m", "radius of the disc as large as the fitted contact area"),
    "pressure_center_x": _scalar("m", "x coordinate of the centroid of the pressure"),
    "pressure_center_y": _scalar("m", "y coordinate of the centroid of the pressure"),
    "stick_radius": _scalar("m", "radius of the disc as large as the stick area"),
    "stick_area_fit": _scalar("m2", "stick area: to its edge, between the nodes"),
    "stick_radius_fit": _scalar("m", "radius of the disc as large as the fitted stick area"),
    "stick_center_x": _scalar("m", "x coordinate of the centroid of the stick area"),
    "stick_center_y": _scalar("m", "y coordinate of the centroid of the stick area"),
    "stick_min_x": _scalar("m", "smallest x coordinate of a sticking node"),
    "stick_max_x": _scalar("m", "largest x coordinate of a sticking node"),
    "stick_min_y": _scalar("m", "smallest y coordinate of a sticking node"),
    "stick_max_y": _scalar("m", "largest y coordinate of a sticking node"),
    "max_pressure": _scalar("Pa", "largest contact pressure of a node"),
    "max_traction": _scalar("Pa", "largest shear traction of a node"),
    "dissipated_energy": _scalar("J", "energy dissipated by friction so far"),
    "dissipated_energy_step": _scalar("J", "energy dissipated by friction during the step"),
    "elastic_energy": _scalar("J", "elastic energy stored in both bodies"),
    "sweeps": _scalar("1", "iterations of the solver", dtype="i4"),
    "cuts": _scalar("1", "how often the step was halved until the solver converged", dtype="i4"),
    "operator_applications": _scalar("1", "applications of the full flexibility operator"),
    "seconds": _scalar("s", "wall time of the step"),
    "residual_normal": _scalar("1", "residual of the normal contact conditions, R_n"),
    "residual_tangential": _scalar("1", "residual of the friction conditions, R_t"),
    "residual_force": _scalar("1", "residual of the normal load, R_P"),
    "residual_shear_force": _scalar("1", "residual of the tangential load, R_Q"),
    "residual_torque": _scalar("1", "residual of the torque, R_M"),
    "stick_area_step_error": _scalar("m2", "bound on the error of the stick area by the size of load steps"),
    "stick_area_step_change": _scalar("m2", "change of the stick area by load steps of half the size"),
    "traction_step_change": _scalar(
        "1", "change of the shear tractions by load steps of half the size, share of what friction can carry"
    ),
    "rejected_steps": _scalar("1", "larger load steps that were tried and rejected", dtype="i4"),
    "step_limited": _scalar(
        "1",
        "whether the tolerance of load steps was missed, since smaller ones did not help",
        dtype="i1",
        flags=_LIMITS,
    ),
    "segment_fraction": _scalar("1", "fraction of the segment that is done"),
    "segment": _scalar("1", "segment of the load history, the first is 1", dtype="i4"),
    "label": _scalar("", "label of the segment", dtype="str"),
}

FIELDS = tuple(name for name, variable in VARIABLES.items() if variable.is_field)

_OF_THE_WORK = ("sweeps", "cuts", "operator_applications", "seconds", "segment", "label")
_ADAPTIVE = (  # errors of load steps are not estimated once more, and do not go together with these
    *("stick_area_step_error", "stick_area_step_change", "traction_step_change"),
    *("rejected_steps", "step_limited", "segment_fraction"),
)
ESTIMATED = tuple(
    name
    for name, variable in VARIABLES.items()
    if variable.dims == ("step",)
    and name not in ("step", *_OF_THE_WORK, *_ADAPTIVE)
    and not name.startswith("residual_")
)
"""Quantities of the history whose discretization error is estimated."""

VARIABLES |= {
    f"{name}_error": _scalar(
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
