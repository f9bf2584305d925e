"""Which closed solutions hold for a load step of a result, and what they say about it.

Each is recognized from the deck, the attributes and the history, and told only where its assumptions are
those of the case. The pressure is that of a contact without friction where there is none, where the bodies
are similar (beta = 0), and where shear is not let move it (Goodman's coupling).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..deck.tables import Deck
from . import friction, frictionless
from .hertz_gap import SIMILAR, QuadraticGap
from .shear import CIRCULAR, ClosedForms, superposed

if TYPE_CHECKING:
    import xarray

    from ..deck.surfaces import Surface
    from .frictionless import AxisymmetricContact

Array = NDArray[np.float64]

_STEADY = 1e-6  # share of the sliding load, or of a motion, that counts as none
_NAMES = {"cone": "Sneddon", "power": "Sneddon", "punch": "Sneddon", "rounded_punch": "Sneddon, Galin"}


@dataclass(frozen=True)
class Exact:
    """What a closed solution says about a load step.

    Attributes
    ----------
    solution : str
        Whose solution it is.
    values : mapping of str to float
        Its values (SI), by the names of the quantities of a result.
    fields : mapping of str to callable
        Fields as functions of x and y (m), by their names.
    scales : mapping of str to float
        What the errors of the fields are measured against.
    """

    solution: str
    values: Mapping[str, float]
    fields: Mapping[str, Callable[[Array, Array], Array]] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)


def closed_solutions(dataset: xarray.Dataset, number: int) -> tuple[list[Exact], str]:
    """Return the closed solutions that hold for a load step, and what there is to know about them.

    Parameters
    ----------
    dataset : xarray.Dataset
        That of a result.
    number : int
        Number of the step, from 1.
    """
    place = int(np.flatnonzero(dataset["step"].values == number)[0])
    so_far = dataset.isel(step=slice(0, place + 1))
    load = float(so_far["normal_load"][-1])
    if not load > 0.0:
        return [], "nothing is pressed in this load step"
    known = [
        *_normal(so_far, load),
        *_shear(so_far, number),
        *_torsion(so_far, number),
        *_dissimilar(so_far, load),
    ]
    if known:
        from_python = 'shape = "python"' in str(dataset.attrs.get("deck", ""))
        note = "the gap was given in Python; the solutions are those of its values at the nodes"
        return known, note if from_python else ""
    if _pressure_is_frictionless(so_far):
        return [], "no closed solution is known for these surfaces"
    return [], (
        "no closed solution is known for dissimilar bodies with friction under these loads; there are some "
        "for similar bodies, for pressing without slip, and for pressing with solver.coupling = goodman"
    )


def _attribute(dataset: xarray.Dataset, name: str, default: float = math.nan) -> float:
    return float(dataset.attrs.get(name, default))


def _frictional(dataset: xarray.Dataset) -> bool:
    return dataset.attrs.get("algorithm", "frictionless") != "frictionless"


def _friction(dataset: xarray.Dataset) -> float:
    return _attribute(dataset, "friction_coefficient", 0.0) if _frictional(dataset) else 0.0


def _pressure_is_frictionless(dataset: xarray.Dataset) -> bool:
    return (
        _friction(dataset) == 0.0
        or abs(_attribute(dataset, "dundurs_beta")) <= SIMILAR
        or dataset.attrs.get("coupling") == "goodman"
    )


# --- pressure -----------------------------------------------------------------------------------------------


def _normal(dataset: xarray.Dataset, load: float) -> list[Exact]:
    """Return the contact without friction: Hertz where the gap is a quadratic form, else by its shape."""
    if not _pressure_is_frictionless(dataset):
        return []
    without_friction = _friction(dataset) == 0.0  # else shear stores energy, too
    gap = QuadraticGap.of(dataset)
    if gap is not None:
        hertz = gap.contact(load)
        radius = math.sqrt(hertz.semi_major * hertz.semi_minor)
        values = {
            "max_pressure": hertz.max_pressure,
            "approach": hertz.approach,
            "contact_radius_fit": radius,
        }
        if without_friction:
            values["elastic_energy"] = 0.4 * load * hertz.approach
        x0, y0 = gap.center
        fields = {"pressure": lambda x, y: hertz.pressure(x - x0, y - y0)}
        return [Exact("Hertz", values, fields, {"pressure": hertz.max_pressure})]
    surface = _only_surface(dataset)
    if surface is None or surface.shape not in _NAMES:
        return []
    contact, energy = _axisymmetric(surface, _attribute(dataset, "effective_modulus"), load)
    values = {"approach": contact.approach}
    if surface.shape != "punch":
        values["contact_radius_fit"] = contact.contact_radius
    if without_friction and energy:
        values["elastic_energy"] = energy * load * contact.approach
    fields = {}
    if math.isfinite(contact.max_pressure):
        values = {"max_pressure": contact.max_pressure, **values}
        x0, y0 = surface.offset
        fields["pressure"] = lambda x, y: contact.pressure(np.hypot(x - x0, y - y0))
    return [Exact(_NAMES[surface.shape], values, fields, {"pressure": contact.max_pressure})]


def _only_surface(dataset: xarray.Dataset) -> Surface | None:
    """Return the surface of the case if one of the bodies is flat, as far as the deck tells."""
    try:
        deck = tomllib.loads(str(dataset.attrs.get("deck", "")))
        bodies = Deck.checked(deck)[0]["body"]
    except (ValueError, KeyError):  # no deck, or parts that were made in Python
        return None
    curved = [s for s in (bodies.body_1.surface, bodies.body_2.surface) if s.shape != "flat"]
    return curved[0] if len(curved) == 1 else None


def _axisymmetric(surface: Any, modulus: float, load: float) -> tuple[AxisymmetricContact, float]:
    """Return the contact under a load, and its elastic energy over load times approach (0: unknown)."""
    if surface.shape == "cone":
        return frictionless.cone(modulus, surface.slope, normal_load=load), 1.0 / 3.0
    if surface.shape == "power":
        n = surface.exponent
        found = frictionless.power_law(modulus, surface.coefficient, n, normal_load=load)
        return found, n / (2.0 * n + 1.0)  # P ~ approach^(1 + 1/n)
    if surface.shape == "punch":
        return frictionless.flat_punch(modulus, surface.radius, normal_load=load), 0.5
    found = frictionless.rounded_punch(modulus, surface.flat_radius, surface.edge_radius, normal_load=load)
    return found, 0.0


# --- similar bodies, sheared or twisted ---------------------------------------------------------------------


def _shear(dataset: xarray.Dataset, number: int) -> list[Exact]:
    """Return Cattaneo-Mindlin, or Mindlin-Deresiewicz after reversals."""
    slip = ClosedForms(dataset).partial_slip(number)
    if slip is None:
        return []
    radius = slip.contact.contact_radius
    values = {}
    sliding = slip.contact.sliding_load
    if abs(slip.turns[-1]) < (1.0 - _STEADY) * sliding:
        values["stick_radius_fit"] = slip.stick_ratio * radius
        if slip.ellipse.semi_minor >= CIRCULAR * slip.ellipse.semi_major:
            shift = float(superposed(slip.contact.shift, slip.turns))
            along = {"shift_x": shift * slip.direction[0], "shift_y": shift * slip.direction[1]}
            values |= {name: value for name, value in along.items() if abs(value) > 1e-9 * abs(shift)}
    fields: dict[str, Callable[[Array, Array], Array]] = {}
    if abs(slip.direction[0]) > 1e-9:
        fields["traction_x"] = lambda x, y: slip.traction(x, y)[0]
    if abs(slip.direction[1]) > 1e-9:
        fields["traction_y"] = lambda x, y: slip.traction(x, y)[1]
    scale = slip.contact.friction_coefficient * slip.ellipse.max_pressure
    return [Exact(slip.name, values, fields, dict.fromkeys(fields, scale))]


def _torsion(dataset: xarray.Dataset, number: int) -> list[Exact]:
    """Return Lubkin's twist, if the torque up to this step has it and the contact does not slide."""
    loop = ClosedForms(dataset).torsion(number) if "torque" in dataset else None
    torque = float(dataset["torque"][-1]) if "torque" in dataset else 0.0
    if loop is None or not torque or abs(loop[1][-1] - torque) > _STEADY * abs(torque):
        return []
    return [Exact("Lubkin", {"twist": float(loop[0][-1])})]


# --- dissimilar bodies, pressed -----------------------------------------------------------------------------


def _dissimilar(dataset: xarray.Dataset, load: float) -> list[Exact]:
    """Return what is known of bodies of different moduli that are pressed, ever more, and not sheared."""
    beta, mu = _attribute(dataset, "dundurs_beta"), _friction(dataset)
    goodman = dataset.attrs.get("coupling") == "goodman"
    if mu == 0.0 or abs(beta) <= SIMILAR or not _pressed_only(dataset, mu * load):
        return []
    gap, surface = QuadraticGap.of(dataset), _only_surface(dataset)
    hertz = gap.contact(load) if gap is not None else None
    circular = hertz is not None and hertz.semi_minor >= CIRCULAR * hertz.semi_major
    incremental = dataset.attrs.get("algorithm") == "incremental"
    if math.isinf(mu) and not goodman and abs(beta) <= 0.5:
        kappa, chi = friction.no_slip_constants(beta)
        if circular and hertz is not None and incremental:
            values = {
                "approach": chi * (kappa * chi) ** (-2.0 / 3.0) * hertz.approach,
                "contact_radius": (kappa * chi) ** (-1.0 / 3.0) * hertz.semi_major,
            }
            return [Exact("Mossakovskii, Spence", values)]
        if surface is not None and surface.shape == "punch":
            stiffness = 2.0 * _attribute(dataset, "effective_modulus") * surface.radius  # type: ignore[attr-defined]
            return [Exact("Mossakovskii", {"approach": load / (kappa * stiffness)})]
    if math.isfinite(mu) and goodman and circular and hertz is not None and incremental:
        ratio = friction.goodman_stick_ratio(beta, mu)
        return [Exact("Goodman, Spence", {"stick_radius_fit": ratio * hertz.semi_major})]
    return []


def _pressed_only(dataset: xarray.Dataset, sliding: float) -> bool:
    """Tell whether the normal load only grew, and nothing else was applied."""
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
