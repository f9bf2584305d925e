"""What the history of a load step, or of a run, says in words and numbers for people."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..text import listed, percent, quantity
from ..variables import RESIDUALS as RESIDUALS
from ..variables import SUMMARY, VARIABLES, label_of, names_where, spelled

History = Mapping[str, Any]
Row = tuple[str, ...]

LOADS_AND_MOTIONS = {
    name: (label_of(name), VARIABLES[name].units) for name in names_where(lambda v: v.motion)
}
"""What each load and motion is called where there is little room, and its unit."""

_NOTICED = 1e-6  # share of the normal load or approach from which something tangential is worth showing
_NOISE = 1e-9  # ... below which it is written as zero
_MOST_NAMED = 8  # load steps named in a sentence


def _scale(name: str, history: History) -> float:
    """Return what a load or motion of a step is to be compared with to tell whether it is noise."""
    beside, power = VARIABLES[name].scale
    if not beside:
        return 0.0
    length = float(history["contact_radius"])
    return abs(history[beside]) * length**power if length or power >= 0 else math.inf


def worth_showing(histories: Iterable[History]) -> list[str]:
    """Return those of `LOADS_AND_MOTIONS` to show: the normal ones, and others that are more than noise."""
    histories = list(histories)

    def shown(name: str) -> bool:
        normal = VARIABLES[name].motion == "z"
        return normal or any(abs(h.get(name, 0.0)) > _NOTICED * _scale(name, h) for h in histories)

    return list(filter(shown, LOADS_AND_MOTIONS))


def load_or_motion(name: str, history: History) -> str:
    """Write one of `LOADS_AND_MOTIONS`, noise as zero."""
    value = float(history[name])
    return quantity(0.0 if abs(value) < _NOISE * _scale(name, history) else value, VARIABLES[name].units)


def fitted(name: str, history: History) -> float:
    """Return an area or radius to the edge between the nodes; as its nodes have it where no fit was kept."""
    value = float(history.get(f"{name}_fit", math.nan))
    return float(history[name]) if math.isnan(value) else value


def error_of(name: str, history: History) -> str:
    """Write the estimated error of what `fitted` or `load_or_motion` give, as " ± 0.05 %"; empty if none."""
    own = name if math.isnan(float(history.get(f"{name}_fit", math.nan))) else f"{name}_fit"
    value, error = abs(float(history[own])), float(history.get(f"{own}_error", 0.0))
    least = _NOISE * _scale(name, history)
    return f" ± {percent(error / value)}" if value > least and error > 0.0 else ""


def stick_share(history: History) -> str:
    """Write how much of the contact area sticks."""
    area = fitted("contact_area", history)
    return f"{100 * fitted('stick_area', history) / area:.1f} %" if area else "-"


def step_error_share(history: History) -> float | None:
    """Return the bound on the error of the stick area by load steps, as a share of the contact area."""
    error, area = float(history.get("stick_area_step_error", math.nan)), fitted("contact_area", history)
    return None if math.isnan(error) or not area else error / area


def halved(history: History) -> str:
    """Say how often a step was halved until the solver converged; empty if it was not."""
    cuts = int(history.get("cuts", 0))
    return f"halved {cuts} time{'s' * (cuts > 1)}" if cuts else ""


def residuals(history: History) -> dict[str, float]:
    """Return the residuals that there are, by the symbol of the theory."""
    found = {sign: float(history.get(name, math.nan)) for sign, name in RESIDUALS.items()}
    return {sign: value for sign, value in found.items() if not math.isnan(value)}


def is_frictional(history: History) -> bool:
    """Tell whether a step was solved with friction."""
    return "stick_area" in history


def describe(history: History, short: bool = False) -> str:
    """Return a line of text about a step from its history."""
    parts = [str(history.get("label", ""))]
    for name in worth_showing([history]):
        parts.append(f"{label_of(name)} {load_or_motion(name, history)}")
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
        (spelled(name), quantity(fitted(name, history), VARIABLES[name].units) + error_of(name, history))
        for name in SUMMARY
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


# --- remarks ------------------------------------------------------------------------------------------------


def remarks(histories: Sequence[History], parameters: History) -> list[str]:
    """Return sentences about the load steps of a run; none if there is nothing to say.

    Parameters
    ----------
    histories : sequence of mapping
        History of each load step, from the first on.
    parameters : mapping
        How they were solved: what `hexcontact.solve.parameters_of` returns, or the attributes of a result.
    """
    tolerance = float(parameters.get("tolerance", 0.0))
    static = parameters.get("algorithm") == "static"
    cold = [
        number
        for number, (before, history) in enumerate(zip([{}, *histories], histories, strict=False), start=1)
        if history.get("cuts") and (static or not before.get("contact_area"))
    ]
    in_parts = [k for k in cold if histories[k - 1]["residual_tangential"] > tolerance]
    sentences = [
        unasked_path(in_parts, in_parts=True),
        unasked_path([k for k in cold if k not in in_parts], in_parts=False),
        halved_steps(histories, tolerance),
        limited_steps(histories, float(parameters.get("step_tolerance", 0.0))),
    ]
    return [sentence for sentence in sentences if sentence]


def unasked_path(numbers: Sequence[int], in_parts: bool) -> str:
    """Say where halved steps come from that begin without contact, or are static; empty if there are none."""
    if not numbers:
        return ""
    several, steps = len(numbers) > 1, _steps(list(map(str, numbers)))
    if in_parts:
        return (
            f"{steps} begin{'s' * (not several)} without contact and did not converge as a whole: the load "
            "was applied in parts, a path that the load history does not have and that the result may depend "
            "on; expected more load steps from the first contact on"
        )
    return (
        f"{steps} did not converge at once and {'were' if several else 'was'} reached from solutions for "
        "smaller loads: if friction admits several states, another start may lead to another of them"
    )


def halved_steps(histories: Sequence[History], tolerance: float) -> str:
    """Say which load steps were halved, and what their record is; empty if none was."""
    cut = {number: history for number, history in enumerate(histories, start=1) if history.get("cuts")}
    if not cut:
        return ""
    named = _steps([f"{number} ({halved(history)})" for number, history in cut.items()])
    largest = max(float(history["residual_tangential"]) for history in cut.values())
    record = "as they are recorded they fulfil the conditions all the same"
    if largest > tolerance:
        record = (
            f"each part met solver.tolerance; R_t is of whole steps as they are recorded, up to {largest:.1e}"
        )
    return f"{len(cut)} of {len(histories)} load steps did not converge at once: {named}; {record}"


def limited_steps(histories: Sequence[History], tolerance: float) -> str:
    """Say which adaptive load steps missed their tolerance; empty if none did."""
    missed = [f"{k}" for k, history in enumerate(histories, start=1) if history.get("step_limited") == 1]
    if not missed:
        return ""
    return (
        f"{len(missed)} of {len(histories)} load steps change more by halving than solver.step_tolerance = "
        f"{tolerance:g}, and smaller ones did not help: {_steps(missed)}; their stick_area_step_error holds"
    )


def _steps(names: Sequence[str]) -> str:
    shown = listed([*names[:_MOST_NAMED], *["..."] * (len(names) > _MOST_NAMED)], "and")
    return f"step{'s' * (len(names) > 1)} {shown}"
