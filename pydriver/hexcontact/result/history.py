"""What the history of a load step says, in words and numbers for people."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from ..text import percent, quantity

History = Mapping[str, Any]
Row = tuple[str, ...]

_FURTHER = {  # shown of a load step besides loads and motions
    "max_pressure": "Pa",
    "max_traction": "Pa",
    "contact_radius": "m",
    "stick_radius": "m",
    "elastic_energy": "J",
    "dissipated_energy": "J",
}

LOADS_AND_MOTIONS = {  # with friction: what it is called, unit
    "normal_load": ("P", "N"),
    "tangential_load_x": ("Qx", "N"),
    "tangential_load_y": ("Qy", "N"),
    "torque": ("Mz", "N m"),
    "approach": ("approach", "m"),
    "shift_x": ("shift x", "m"),
    "shift_y": ("shift y", "m"),
    "twist": ("twist", "rad"),
}
RESIDUALS = {  # by the symbol of the theory
    "R_n": "residual_normal",
    "R_t": "residual_tangential",
    "R_P": "residual_force",
    "R_Q": "residual_shear_force",
    "R_M": "residual_torque",
}
_NOTICED = 1e-6  # share of the normal load or approach from which something tangential is worth showing
_NOISE = 1e-9  # ... below which it is written as zero


def _scale(name: str, history: Mapping[str, Any]) -> float:
    """Return what a load or motion of a step is to be compared with to tell whether it is noise."""
    load, approach = abs(history["normal_load"]), abs(history["approach"])
    length = history["contact_radius"]
    if name in ("normal_load", "approach"):
        return 0.0
    if name == "torque":
        return float(load * length)
    if name == "twist":
        return float(approach / length) if length else math.inf
    return float(load if name.startswith("tangential") else approach)


def worth_showing(histories: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return those of `LOADS_AND_MOTIONS` to show: the normal ones, and others that are more than noise."""
    shown = {"normal_load", "approach"}
    for history in histories:
        shown |= {
            name
            for name in LOADS_AND_MOTIONS.keys() - shown
            if abs(history.get(name, 0.0)) > _NOTICED * _scale(name, history)
        }
    return [name for name in LOADS_AND_MOTIONS if name in shown]


def load_or_motion(name: str, history: Mapping[str, Any]) -> str:
    """Write one of `LOADS_AND_MOTIONS`, noise as zero."""
    value = float(history[name])
    return quantity(0.0 if abs(value) < _NOISE * _scale(name, history) else value, LOADS_AND_MOTIONS[name][1])


def fitted(name: str, history: Mapping[str, Any]) -> float:
    """Return an area or radius to the edge between the nodes; as its nodes have it where no fit was kept."""
    value = float(history.get(f"{name}_fit", math.nan))
    return float(history[name]) if math.isnan(value) else value


def error_of(name: str, history: Mapping[str, Any]) -> str:
    """Write the estimated error of what `fitted` or `load_or_motion` give, as " ± 0.05 %"; empty if none."""
    own = name if math.isnan(float(history.get(f"{name}_fit", math.nan))) else f"{name}_fit"
    value, error = abs(float(history[own])), float(history.get(f"{own}_error", 0.0))
    least = _NOISE * _scale(name, history) if name in LOADS_AND_MOTIONS else 0.0
    return f" ± {percent(error / value)}" if value > least and error > 0.0 else ""


def stick_share(history: Mapping[str, Any]) -> str:
    """Write how much of the contact area sticks."""
    area = fitted("contact_area", history)
    return f"{100 * fitted('stick_area', history) / area:.1f} %" if area else "-"


def step_error_share(history: Mapping[str, Any]) -> float | None:
    """Return the bound on the error of the stick area by load steps, as a share of the contact area."""
    error, area = float(history.get("stick_area_step_error", math.nan)), fitted("contact_area", history)
    return None if math.isnan(error) or not area else error / area


def halved(history: Mapping[str, Any]) -> str:
    """Say how often a step was halved until the solver converged; empty if it was not."""
    cuts = int(history.get("cuts", 0))
    return f"halved {cuts} time{'s' * (cuts > 1)}" if cuts else ""


def residuals(history: Mapping[str, Any]) -> dict[str, float]:
    """Return the residuals that there are, by the symbol of the theory."""
    found = {sign: float(history.get(name, math.nan)) for sign, name in RESIDUALS.items()}
    return {sign: value for sign, value in found.items() if not math.isnan(value)}


def is_frictional(history: Mapping[str, Any]) -> bool:
    """Tell whether a step was solved with friction."""
    return "stick_area" in history


def describe(history: Mapping[str, Any], short: bool = False) -> str:
    """Return a line of text about a step from its history."""
    parts = [str(history.get("label", ""))]
    for name in worth_showing([history]):
        parts.append(f"{LOADS_AND_MOTIONS[name][0]} {load_or_motion(name, history)}")
    if is_frictional(history):
        error = step_error_share(history)
        around = "" if error is None or short else f" ± {100 * error:.1f} %"
        parts += [f"stick {stick_share(history)}{around}", f"R {max(residuals(history).values()):.1e}"]
    else:
        parts.append(f"p_max {quantity(history['max_pressure'], 'Pa')}")
        if not short:
            parts.append(f"radius {quantity(fitted('contact_radius', history), 'm')}")
            parts += [f"{sign} {value:.1e}" for sign, value in residuals(history).items()]
    parts.append(halved(history))
    if not short:
        parts.append(quantity(history["seconds"], "s", 3))
    return "  ".join(part for part in parts if part)


def step_rows(history: History) -> list[Row]:
    """Return what a load step came to, with its estimated errors and residuals."""
    rows = [
        (spelled(name), load_or_motion(name, history) + error_of(name, history))
        for name in worth_showing([history])
    ]
    rows += [
        (spelled(name), quantity(fitted(name, history), unit) + error_of(name, history))
        for name, unit in _FURTHER.items()
        if name in history
    ]
    if is_frictional(history):
        rows.append(("stick", _stick(history)))
    if (error := step_error_share(history)) is not None:
        change = 100 * history["stick_area_step_change"] / fitted("contact_area", history)
        words = f"stick area within {100 * error:.1f} % of the contact area, {change + 0.0:+.2f} % by halving"
        rows.append(("load steps", words))
    found = ", ".join(f"{sign} = {value:.1e}" for sign, value in residuals(history).items())
    return [*rows, ("residuals", found), ("work", _work(history))]


def spelled(name: str) -> str:
    """Return the name of a quantity as words."""
    return name.replace("_", " ")


def _stick(history: History) -> str:
    """Return size and place of the stick zone in words."""
    if not history["stick_area"]:
        return "nowhere"
    center = [float(history[f"stick_center_{axis}"]) for axis in "xy"]
    near = 1e-6 * history["contact_radius"]  # as good as zero
    place = ", ".join(quantity(0.0 if abs(value) < near else value, "m") for value in center)
    return f"{stick_share(history)} of the contact area, about ({place})"


def _work(history: History) -> str:
    parts = f"{halved(history)}, " if halved(history) else ""
    return (
        f"{history['sweeps']} iterations, {parts}{history['operator_applications']:.3g} operator "
        f"applications, {quantity(history['seconds'], 's', 3)}"
    )
