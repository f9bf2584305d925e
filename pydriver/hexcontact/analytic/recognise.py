"""Closed solutions that hold for a load step of a result.

Each is recognized from the deck, the attributes and the history, and holds if its assumptions are those of
the case. The pressure is that of a contact without friction if there is none, if the bodies are similar (beta
= 0), and in Goodman's coupling, where shear does not move it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..deck.surfaces import Punch
from . import friction
from .frictionless import AxisymmetricContact, cone, flat_punch, power_law, rounded_punch
from .hertz_gap import SIMILAR, is_compliant, is_strained, is_worn, pressure_is_frictionless
from .shear import ClosedForms, is_circular, superposed, turning_points

if TYPE_CHECKING:
    import xarray


_STEADY = 1e-6  # share of the sliding load, or of a motion, that is none


@dataclass(frozen=True)
class Exact:
    """Values and fields of a closed solution for a load step."""

    solution: str  # name of the solution
    values: Mapping[str, float]  # its values (SI), by the names of the quantities of a result
    # fields as functions of x and y (m), by their names
    fields: Mapping[str, Callable[[Array, Array], Array]] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)  # scales of the errors of the fields


def closed_solutions(dataset: xarray.Dataset, number: int) -> tuple[list[Exact], str]:
    """Return the closed solutions that hold for a load step, and a remark on them."""
    place = int(np.flatnonzero(dataset["step"].values == number)[0])
    so_far = dataset.isel(step=slice(0, place + 1))
    load = float(so_far["normal_load"][-1])
    if not load > 0.0:
        return [], "nothing is pressed in this load step"
    if is_compliant(so_far.attrs):
        return [], "no closed-form solution is known for a compliant interface"
    if is_worn(so_far):
        return [], "no closed-form solution is known for worn surfaces"
    closed = ClosedForms(so_far)
    known = [*_normal(closed, load), *_shear(closed, number), *_torsion(closed, number)]
    known += [] if is_strained(so_far) else _dissimilar(closed, load)
    if known:
        note = "the gap was given in Python; the solutions are those of its values at the nodes"
        return known, note if "surface" in closed.deck.given else ""
    if pressure_is_frictionless(so_far.attrs):
        return [], "no closed-form solution is known for these surfaces"
    return [], (
        "no closed-form solution is known for dissimilar bodies with friction under these loads; there are "
        "some for similar bodies, for pressing without slip, and for pressing with solver.coupling = goodman"
    )


# --- pressure -----------------------------------------------------------------------------------------------


def _normal(closed: ClosedForms, load: float) -> list[Exact]:
    """Return the contact without friction: Hertz for a quadratic gap, else by the shape of the surface."""
    if not pressure_is_frictionless(closed.dataset.attrs):
        return []
    without_friction = closed.friction == 0.0  # else shear stores energy, too
    if (gap := closed.gap) is not None:
        hertz = gap.contact(load)
        values = {"max_pressure": hertz.max_pressure, "approach": gap.approach(load)}
        values["contact_radius_fit"] = hertz.radius
        if without_friction:
            values["elastic_energy"] = 0.4 * load * hertz.approach
        x0, y0 = gap.center
        fields = {"pressure": lambda x, y: hertz.pressure(x - x0, y - y0)}
        return [Exact("Hertz", values, fields, {"pressure": hertz.max_pressure})]
    surface, shape = _shape_of(closed)
    if shape is None:
        return []
    contact = shape.contact(surface, closed.modulus, load)
    values = {"max_pressure": contact.max_pressure, "approach": contact.approach}
    if not shape.rim:
        values["contact_radius_fit"] = contact.contact_radius
    if without_friction and (energy := shape.energy(surface)):
        values["elastic_energy"] = energy * load * contact.approach
    if not math.isfinite(values["max_pressure"]):
        del values["max_pressure"]
        return [Exact(shape.name, values)]
    x0, y0 = surface.offset
    fields = {"pressure": lambda x, y: contact.pressure(np.hypot(x - x0, y - y0))}
    return [Exact(shape.name, values, fields, {"pressure": contact.max_pressure})]


@dataclass(frozen=True)
class _Shape:
    """A surface of revolution with a closed solution."""

    name: str  # name of the solution
    # the contact of a surface of this shape with an effective modulus (Pa) under a load (N)
    contact: Callable[[Any, float, float], AxisymmetricContact]
    energy: Callable[[Any], float]  # its elastic energy over load times approach; 0: unknown
    rim: bool = False  # whether the contact ends at a sharp rim


_SHAPES = {
    "cone": _Shape("Sneddon", lambda s, e, p: cone(e, s.slope, normal_load=p), lambda s: 1.0 / 3.0),
    "power": _Shape(
        "Sneddon",
        lambda s, e, p: power_law(e, s.coefficient, s.exponent, normal_load=p),
        lambda s: s.exponent / (2.0 * s.exponent + 1.0),  # P ~ approach^(1 + 1/n)
    ),
    "punch": _Shape(
        "Sneddon", lambda s, e, p: flat_punch(e, s.radius, normal_load=p), lambda s: 0.5, rim=True
    ),
    "rounded_punch": _Shape(
        "Sneddon, Galin",
        lambda s, e, p: rounded_punch(e, s.flat_radius, s.edge_radius, normal_load=p),
        lambda s: 0.0,
    ),
}


def _shape_of(closed: ClosedForms) -> tuple[Any, _Shape | None]:
    """Return the only surface that is not flat, and its shape if that has a closed solution."""
    surface = closed.surface
    return surface, _SHAPES.get(surface.shape) if surface is not None else None


# --- similar bodies, sheared or twisted ---------------------------------------------------------------------


def _shear(closed: ClosedForms, number: int) -> list[Exact]:
    """Return Cattaneo-Mindlin, or Mindlin-Deresiewicz after reversals."""
    slip = closed.partial_slip(number)
    if slip is None:
        return _shear_of_shape(closed, number)
    radius, sliding = slip.contact.contact_radius, slip.contact.sliding_load
    values = {}
    if abs(slip.turns[-1]) < (1.0 - _STEADY) * sliding:
        values["stick_radius_fit"] = slip.stick_ratio * radius
        if is_circular(slip.ellipse):
            shift = float(superposed(slip.contact.shift, slip.turns))
            along = {"shift_x": shift * slip.direction[0], "shift_y": shift * slip.direction[1]}
            values |= {name: value for name, value in along.items() if abs(value) > 1e-9 * abs(shift)}

    def component(axis: int) -> Callable[[Array, Array], Array]:
        return lambda x, y: slip.traction(x, y)[axis]

    fields = {f"traction_{'xy'[k]}": component(k) for k in (0, 1) if abs(slip.direction[k]) > 1e-9}
    scale = slip.contact.friction_coefficient * slip.ellipse.max_pressure
    return [Exact(slip.name, values, fields, dict.fromkeys(fields, scale))]


def _shear_of_shape(closed: ClosedForms, number: int) -> list[Exact]:
    """Return the superposition of contacts without friction, if the shape of the surface has them."""
    surface, shape = _shape_of(closed)
    sheared = closed.sheared(number) if shape is not None else None
    if sheared is None or shape is None:
        return []
    history, direction, loads = sheared
    contact = friction.SuperposedContact(
        closed.friction, history.normal_load, closed.gamma, partial(shape.contact, surface, closed.modulus)
    )
    turns = turning_points(loads)
    if history["twist"].any() or abs(turns[-1]) > (1.0 - _STEADY) * contact.sliding_load:
        return []
    swing = turns[0] if len(turns) == 1 else 0.5 * (turns[-1] - turns[-2])
    shift = float(superposed(contact.shift, turns))
    values = {
        f"shift_{axis}": shift * part for axis, part in zip("xy", direction, strict=True) if abs(part) > 1e-9
    }
    if not shape.rim:
        values["stick_radius_fit"] = contact.stick_radius(swing)
    x0, y0 = surface.offset

    def component(axis: int) -> Callable[[Array, Array], Array]:
        return lambda x, y: (
            direction[axis] * superposed(partial(contact.traction, np.hypot(x - x0, y - y0)), turns)
        )

    peak = contact.pressed(history.normal_load).max_pressure
    along = [axis for axis in (0, 1) if abs(direction[axis]) > 1e-9 and math.isfinite(peak)]
    fields = {f"traction_{'xy'[axis]}": component(axis) for axis in along}
    return [Exact("Jaeger, Ciavarella", values, fields, dict.fromkeys(fields, closed.friction * peak))]


def _torsion(closed: ClosedForms, number: int) -> list[Exact]:
    """Return Lubkin's twist, if it holds up to this step and the contact does not slide."""
    torque = float(closed.dataset["torque"][-1]) if "torque" in closed.dataset else 0.0
    loop = closed.torsion(number) if torque else None
    if loop is None or abs(loop[1][-1] - torque) > _STEADY * abs(torque):
        return []
    return [Exact("Lubkin", {"twist": float(loop[0][-1])})]


# --- dissimilar bodies, pressed -----------------------------------------------------------------------------


def _dissimilar(closed: ClosedForms, load: float) -> list[Exact]:
    """Return closed solutions for dissimilar bodies under a growing normal load alone."""
    beta, mu, attributes = closed.beta, closed.friction, closed.dataset.attrs
    goodman = attributes.get("coupling") == "goodman"
    if mu == 0.0 or abs(beta) <= SIMILAR or not _pressed_only(closed.dataset, mu * load):
        return []
    hertz = closed.gap.contact(load) if closed.gap is not None else None
    incremental = attributes.get("algorithm") == "incremental"
    sphere = hertz if hertz is not None and is_circular(hertz) and incremental else None
    if math.isinf(mu) and not goodman and abs(beta) <= 0.5:
        kappa, chi = friction.no_slip_constants(beta)
        if sphere is not None:
            values = {
                "approach": chi * (kappa * chi) ** (-2.0 / 3.0) * sphere.approach,
                "contact_radius": (kappa * chi) ** (-1.0 / 3.0) * sphere.semi_major,
            }
            return [Exact("Mossakovskii, Spence", values)]
        if isinstance(closed.surface, Punch):
            stiffness = 2.0 * closed.modulus * closed.surface.radius
            return [Exact("Mossakovskii", {"approach": load / (kappa * stiffness)})]
    if math.isfinite(mu) and goodman and sphere is not None:
        ratio = friction.goodman_stick_ratio(beta, mu)
        return [Exact("Goodman, Spence", {"stick_radius_fit": ratio * sphere.semi_major})]
    return []


def _pressed_only(dataset: xarray.Dataset, sliding: float) -> bool:
    """Test whether a growing normal load is the only load."""
    loads = dataset["normal_load"].values
    if (np.diff(loads) < -_STEADY * loads[-1]).any():
        return False
    scale = sliding if math.isfinite(sliding) else float(loads[-1])
    for axis in "xy":
        name = f"tangential_load_{axis}"
        if name in dataset and np.abs(dataset[name].values).max() > _STEADY * scale:
            return False
    turned = np.abs(dataset["twist"].values).max() if "twist" in dataset else 0.0
    return bool(turned == 0.0)
