"""What a user has to know about the load steps of a run, in sentences: halved steps, missed tolerances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..text import listed
from .history import halved

History = Mapping[str, Any]

_MOST_NAMED = 8  # load steps named in a sentence


def remarks(histories: Sequence[History], parameters: Mapping[str, Any]) -> list[str]:
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
    said = [
        unasked_path(in_parts, in_parts=True),
        unasked_path([k for k in cold if k not in in_parts], in_parts=False),
        halved_steps(histories, tolerance),
        limited_steps(histories, float(parameters.get("step_tolerance", 0.0))),
    ]
    return [sentence for sentence in said if sentence]


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
