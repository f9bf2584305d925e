"""The history of a run in words."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Dataset
from ..core.measures import cycles as cycles_of
from ..core.measures import half_axes, line_of, turning_points
from ..deck.below import Stage
from ..text import Row, Table, counted, cycle_count, listed, percent, quantity
from ..variables import (
    BULK_STRESS,
    CREEPAGES,
    LOADS,
    RESIDUALS,
    SUMMARY,
    VARIABLES,
    WORN,
    label_of,
    names_where,
    spelled,
)

History = Mapping[str, Any]
Extent = tuple[float, float]

LOADS_AND_MOTIONS = (*names_where(lambda v: v.motion), *CREEPAGES)
"""Loads and motions, creepages and spin."""

WEARING = ("pressure", "traction_x", "traction_y", "slip_increment_x", "slip_increment_y", "zone")
"""Fields of the steps of a cycle from which its wear follows."""

_SLIP = 2  # among the zones
_UNROLLED = ("shift_x", "shift_y", "twist")  # in whose place rolling bodies have creepages and spin
_NOTICED = 1e-6  # share of the normal load or approach from which tangential ones are shown
_LEFT_OPEN = 1e-6  # share of the largest value below which changes of a quantity are rounding errors
_NOISE = 1e-9  # ... below which they are written as zero
_ELLIPTIC = 0.005  # share by which the area of a contact may differ from that of the ellipse with its moments
_BEYOND_CIRCLE = 1.1  # extent of a contact over the diameter of a circle from which it is another figure
_WORTH_STATING = 1e-3  # share of the dissipated energy from which the bound on its error is shown
_ACROSS = "load across"  # the largest tangential load
_UNCERTAIN = 0.1  # ... and from which a remark is made
_MOST_NAMED = 8  # load steps named in a sentence


def _scale(name: str, history: History) -> float:
    """Return the quantity to which the noise of a load or motion of a step is relative."""
    beside, power = VARIABLES[name].scale
    if not beside:
        return 0.0
    length = float(history["contact_radius"])
    return abs(history[beside]) * length**power if length or power >= 0 else math.inf


def rolls(history: History) -> bool:
    """Test whether the bodies of a case roll."""
    return CREEPAGES[0] in history


def rolled_steps(histories: Iterable[History]) -> list[History]:
    """Return the steps in which the bodies roll."""
    return [h for h in histories if not math.isnan(float(h.get("rolled_distance", math.nan)))]


def worth_showing(histories: Iterable[History]) -> list[str]:
    """Return the normal ones of `LOADS_AND_MOTIONS`, and others above the noise; no shifts while rolling."""
    histories = list(histories)
    hidden = _UNROLLED if rolls(histories[-1]) else ()
    return [
        name
        for name in LOADS_AND_MOTIONS
        if name not in hidden
        and (
            VARIABLES[name].motion == "z"
            or any(abs(h.get(name, 0.0)) > _NOTICED * _scale(name, h) for h in histories)
        )
    ]


def fitted(name: str, history: History) -> float:
    """Return a quantity of a step, an area or radius to the edge between the nodes if there is a fit."""
    value = float(history.get(f"{name}_fit", math.nan))
    return float(history[name]) if math.isnan(value) else value


def value_of(name: str, history: History) -> str:
    """Write `fitted`; noise is written as zero."""
    value = fitted(name, history)
    noise = abs(value) < _NOISE * _scale(name, history)
    return quantity(0.0 if noise else value, VARIABLES[name].unit)


def with_error(name: str, history: History) -> str:
    """Write `fitted` with its estimated error, if there is one."""
    return value_of(name, history) + error_of(name, history)


def contact_size(history: History) -> tuple[str, str]:
    """Return name and value of the radius of the contact, or its half-axes, with the estimated error.

    Of a window that repeats it is the share of its area that is in contact.
    """
    if repeats(history):
        window = float(history["normal_load"] / history["mean_pressure"])
        share, bar = (100 * float(history[name]) / window for name in ("contact_area", "contact_area_error"))
        return "contact area", f"{share:.1f} ± {bar:.1g} % of the window"
    if (axes := half_axes(history)) is None:
        return "contact radius", with_error("contact_radius", history)
    words = " by ".join(quantity(axis, "m") for axis in axes)
    return "contact half-axes", words + error_of("contact_semi_major", history)


def repeats(history: History) -> bool:
    """Test whether a step is that of a window that repeats, under load."""
    return "mean_gap" in history and float(history["mean_pressure"]) > 0.0


def extent_of(step: Any) -> Extent | None:
    """Return the lengths (m) of the contact of a step along x and y, between its outermost nodes.

    None without contact, or if its zones were not kept.
    """
    if hasattr(step, "bands"):
        zones = step.bands("zone") if "zone" in step.fields else ()
    else:
        zones = [] if (zone := getattr(step, "zone", None)) is None else [(step, np.asarray(zone))]
    corners = []  # of the nodes in contact of each band
    for nodes, zone in zones:
        if (inside := zone > 0).any():
            x, y = np.asarray(nodes.x)[inside], np.asarray(nodes.y)[inside]
            corners.append([[x.min(), y.min()], [x.max(), y.max()]])
    if not corners:
        return None
    low, high = np.min(corners, axis=0)[0], np.max(corners, axis=0)[1]
    return float(high[0] - low[0]), float(high[1] - low[1])


def _moments(history: History, extent: Extent | None) -> str:
    """Name the ellipse or circle if the contact is another figure, and the extent of the contact."""
    axes, area = half_axes(history), fitted("contact_area", history)
    if repeats(history):
        return ""
    if axes is None:
        diameter = 2.0 * fitted("contact_radius", history)
        if extent is None or max(extent) < _BEYOND_CIRCLE * diameter:
            return ""
        words = " of the circle of the same area"
    elif abs(area / (math.pi * axes[0] * axes[1]) - 1.0) < _ELLIPTIC:
        return ""
    else:
        words = " of the ellipse with the same moments"
    if extent is None:
        return words
    along, across = (quantity(length, "m", 3) for length in extent)
    return f"{words}; the contact extends over {along} in x and {across} in y"


def error_of(name: str, history: History) -> str:
    """Write the estimated error of `fitted`, as " ± 0.05 %"; empty if there is none."""
    own = name if math.isnan(float(history.get(f"{name}_fit", math.nan))) else f"{name}_fit"
    value, error = abs(float(history[own])), float(history.get(f"{own}_error", 0.0))
    least = _NOISE * _scale(name, history)
    return f" ± {percent(error / value)}" if value > least and error > 0.0 else ""


def stick_share(history: History, with_error: bool = False) -> str:
    """Write the sticking share of the contact area, with the estimated error of the stick area."""
    area, error = fitted("contact_area", history), error_of("stick_area", history) if with_error else ""
    return (f"{100 * fitted('stick_area', history) / area:.1f} %" if area else "-") + error


def step_error_share(history: History) -> float | None:
    """Return the bound on the error of the stick area due to load steps, over the contact area."""
    error, area = float(history.get("stick_area_step_error", math.nan)), fitted("contact_area", history)
    return None if math.isnan(error) or not area else error / area


def path_error_share(history: History) -> float:
    """Return the bound on the error of the dissipated energy due to load steps, over that energy.

    It is 0 of rolling bodies, whose steps are spacings: the error is that of the lattice.
    """
    spent = 0.0 if rolls(history) else float(history.get("dissipated_energy", 0.0))
    noise = _NOTICED * _scale("dissipated_energy", history) if spent else 0.0
    return float(history.get("dissipated_energy_path_error", 0.0)) / spent if spent > noise else 0.0


def halved(history: History) -> str:
    """Return "halved 2 times" for a step that was halved until the solver converged; else nothing."""
    cuts = int(history.get("cuts", 0))
    return f"halved {counted(cuts, 'time')}" if cuts else ""


def in_halves(history: History) -> bool:
    """Test whether a step was solved in two halves, like adaptive ones with shear."""
    return float(history.get("traction_step_change", math.nan)) > 0.0


def parts_of(history: History) -> str:
    """Describe the parts in which a step was solved; empty if it was solved as a whole."""
    return ", ".join(filter(None, ("in two halves" * in_halves(history), halved(history))))


def residuals(history: History) -> dict[str, float]:
    """Return the known residuals, by the symbol of the theory."""
    found = {sign: float(history.get(name, math.nan)) for sign, name in RESIDUALS.items()}
    return {sign: value for sign, value in found.items() if not math.isnan(value)}


def is_frictional(history: History) -> bool:
    """Test whether a step was solved with friction."""
    return "stick_area" in history


def describe(history: History, short: bool = False) -> str:
    """Return a line of text about a step from its history."""
    parts = [str(history.get("label", ""))]
    for name in worth_showing([history]):
        parts.append(f"{label_of(name)} {value_of(name, history)}")
    if is_frictional(history):
        error = step_error_share(history)
        around = "" if error is None or short else f" ± {100 * error:.1f} %"
        parts += [f"stick {stick_share(history)}{around}", f"R {max(residuals(history).values()):.1e}"]
    else:
        parts.append(f"p_max {value_of('max_pressure', history)}")
        if not short:
            parts.append(" ".join(contact_size(history)).removeprefix("contact "))
            parts += [f"{sign} {value:.1e}" for sign, value in residuals(history).items()]
    if _of_wear(history):
        worn = value_of("max_worn_depth", history)
        parts.append(f"cycles {cycle_count(history['wear_cycles'])}  worn {worn}")
    parts.append(parts_of(history))
    if not short:
        parts.append(quantity(history["seconds"], "s", 3))
    return "  ".join(part for part in parts if part)


def step_rows(history: History, extent: Extent | None = None) -> list[Row]:
    """Return rows of a table of a load step, with errors, residuals and the extent of the contact."""
    name_of_size, size = contact_size(history)
    summary = SUMMARY
    if half_axes(history):  # the stick area of a long contact is no disc
        summary = tuple("stick_area" if name == "stick_radius" else name for name in SUMMARY)
    shown = [
        name
        for name in summary
        if name in history
        and not (name == "dissipated_energy" and rolls(history) and not history[name])
        and not (name == "stick_radius" and repeats(history))
    ]
    rows = [
        (name_of_size, size + _moments(history, extent))
        if name == "contact_radius"
        else (spelled(name), with_error(name, history))
        for name in (*worth_showing([history]), *shown)
    ]
    if is_frictional(history):
        rows.append(("stick", _stick(history)))
    if _of_wear(history):
        rows.append(("cycles of wear", cycle_count(history["wear_cycles"])))
        rows += [(spelled(name), value_of(name, history)) for name in ("wear_volume", "max_worn_depth")]
    if (error := step_error_share(history)) is not None:
        change = 100 * history["stick_area_step_change"] / fitted("contact_area", history)
        words = f"stick area within {100 * error:.1f} % of the contact area, {change + 0.0:+.2f} % by halving"
        rows.append(("load steps", words))
    if (share := path_error_share(history)) >= _WORTH_STATING:
        rows.append(("size of load steps", f"dissipated energy within {percent(share)}"))
    found = ", ".join(f"{sign} = {value:.1e}" for sign, value in residuals(history).items())
    return [*rows, ("residuals", found), ("work", _work(history))]


def _stick(history: History) -> str:
    """Return size and place of the stick zone in words."""
    if not history["stick_area"]:
        return "nowhere"
    center = [float(history[f"stick_center_{axis}"]) for axis in "xy"]
    near = 1e-6 * history["contact_radius"]  # rounding errors
    place = ", ".join(quantity(0.0 if abs(value) < near else value, "m") for value in center)
    where = "" if math.isnan(center[0]) else f", about ({place})"  # of a window that repeats
    return f"{stick_share(history)} of the contact area{where}"


def _work(history: History) -> str:
    parts = f"{parts_of(history)}, " if parts_of(history) else ""
    return (
        f"{counted(history['sweeps'], 'iteration')}, {parts}{history['operator_applications']:.3g} operator "
        f"applications, {quantity(history['seconds'], 's', 3)}"
    )


# --- segments and cycles ------------------------------------------------------------------------------------


def ends_of_segments(histories: Sequence[History]) -> list[int]:
    """Return the indices of the last steps of the segments."""
    segments = [int(history.get("segment", 1)) for history in histories]
    changes = [k for k, (one, other) in enumerate(itertools.pairwise(segments)) if one != other]
    return [*changes, len(segments) - 1]


def some_steps(histories: Sequence[History], most: int) -> list[int]:
    """Select some steps of a long history: ends of segments, then peaks, then others.

    If a kind has more steps than places are left, its steps are evenly selected.
    """
    names = [*worth_showing(histories), "max_pressure"]
    turns = {place for name in names for place in turning_points(_rounded(_column(histories, name)))}
    last = len(histories) - 1
    kept = {last}
    for places in (ends_of_segments(histories), sorted(turns), range(last)):
        others = [place for place in places if place not in kept]
        room = min(most - len(kept), len(others))
        kept |= {others[k * len(others) // room] for k in range(room)}
    return sorted(kept)


def loops(histories: Sequence[History]) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return the histories of motion and load of each kind of loading above the noise, shear first.

    Shear is along the direction of the largest tangential load; the load across it, no loop, is last.
    """
    if rolls(histories[-1]):
        return {}  # creepages are velocities
    found = {"normal": (_column(histories, "approach"), _column(histories, "normal_load"))}
    if "torque" in worth_showing(histories):
        found = {"torsion": (_column(histories, "twist"), _column(histories, "torque")), **found}
    if "tangential_load_x" not in histories[0]:
        return found
    load, shift = (
        np.stack([_column(histories, f"{name}_{axis}") for axis in "xy"])
        for name in ("tangential_load", "shift")
    )
    direction = line_of(load, _NOTICED * float(found["normal"][1].max()), np.inf)
    if direction is None:
        return found
    along, across = np.array(direction), np.array([-direction[1], direction[0]])
    shear = along @ shift, along @ load
    return {"shear": shear, **found, _ACROSS: (across @ shift, across @ load)}


def _other_work(histories: Sequence[History], kind: str, first: int, last: int) -> list[str]:
    """Return the other loads, and the bulk stress, that do work between two steps of a loop."""
    words = {"shear": "tangential load", "torsion": "torque", "normal": "normal load", _ACROSS: _ACROSS}
    pairs = loops(histories)
    scales = {name: [float(np.abs(values).max()) for values in pair] for name, pair in pairs.items()}
    scales[_ACROSS] = scales.get("shear", [])
    span = slice(first, last + 1)
    found = [
        words[name]
        for name, pair in pairs.items()
        if name != kind
        and (name != _ACROSS or kind == "shear")
        and all(np.ptp(v[span]) > _NOTICED * scale for v, scale in zip(pair, scales[name], strict=True))
    ]
    bulk = [_column(histories, name) for name in BULK_STRESS if name in histories[0]]
    return found + ["bulk stress"] * any(np.ptp(v[span]) > _NOTICED * np.abs(v).max() for v in bulk)


def segments(histories: Sequence[History]) -> list[dict[str, Any]]:
    """Return number, label, first and last step and, with friction, dissipated energy (J) of each segment."""
    ends, rows = ends_of_segments(histories), []
    for number, (before, end) in enumerate(itertools.pairwise([-1, *ends]), start=1):
        about = {"segment": number, "label": str(histories[end].get("label", ""))}
        rows.append({**about, **_span(histories, before, end)})
    return rows


def stages(histories: Sequence[History]) -> list[Stage]:
    """Return segment, label and loads, as far as they are more than noise, of each load step."""
    forces = {force for force, _ in LOADS.values()}
    names = [*(name for name in worth_showing(histories) if name in forces), *BULK_STRESS]
    return [
        (int(h.get("segment", 1)), str(h.get("label", "")), {n: float(h[n]) for n in names if n in h})
        for h in histories
    ]


def cycles(histories: Sequence[History]) -> list[dict[str, Any]]:
    """Return the closed cycles of a load history with friction, of the first of `loops` that has any.

    A cycle goes from one turning point of the motion to the next but one. `loop_area` (J) is the area of the
    load over its motion; `other_work` names other loads that do work in the cycle. Wear cycles are left out,
    since only their ends are recorded.
    """
    histories = [history for history in histories if not _of_wear(history)]
    for kind, (motion, load) in loops(histories).items() if is_frictional(histories[-1]) else ():
        if kind != _ACROSS and (found := cycles_of(motion, load)):
            return [
                {
                    **{"cycle": number, "loading": kind, **_span(histories, first, last), "loop_area": area},
                    "other_work": listed(other, "and")
                    if (other := _other_work(histories, kind, first, last))
                    else "",
                }
                for number, (first, last, area) in enumerate(found, start=1)
            ]
    return []


def energy_table(histories: Sequence[History], most: int) -> Table:
    """Return headers and rows of the dissipated energy of segments and cycles; no rows for one segment."""
    headers = ("", "label", "steps", "dissipated energy", "area of the loop")
    parts, loops = segments(histories), cycles(histories)
    if len(parts) < 2 or not is_frictional(histories[-1]):
        return Table(headers, [])
    if rolls(histories[-1]):
        return _power_table(histories, parts[-most:])
    for row in parts:
        if _of_wear(last := histories[row["last_step"] - 1]):
            row["label"] += f", {counted(cycle_count(last['wear_cycles']), 'cycle')}"
    named = [(f"segment {row['segment']}", row["label"], row) for row in parts[-most:]]
    named += [(f"cycle {row['cycle']}", row["loading"], row) for row in loops[-most:]]
    shown, rows = 5 if loops else 4, []
    for name, words, row in named:
        area = quantity(row["loop_area"], "J") if "loop_area" in row else ""
        area += f", without {row['other_work']}" if row.get("other_work") else ""
        steps = f"{row['first_step']} to {row['last_step']}"
        rows.append((name, words, steps, quantity(row["dissipated_energy"], "J"), area)[:shown])
    return Table(headers[:shown], rows)


def _power_table(histories: Sequence[History], parts: Sequence[Mapping[str, Any]]) -> Table:
    """Return headers and rows of segments of rolling bodies: energy, way, and power at their ends."""
    rows: list[Row] = []
    for row in parts:
        before, last = ({}, *histories)[row["first_step"] - 1], histories[row["last_step"] - 1]
        name = "creep_power" if "creep_power_error" in last else "slip_power"
        end, start = (float(one.get("rolled_distance", math.nan)) for one in (last, before))
        way = end - (0.0 if math.isnan(start) else start)
        rolled, energy = quantity(way, "m") if way else "steady", quantity(row["dissipated_energy"], "J")
        power = with_error(name, last)
        steps = f"{row['first_step']} to {row['last_step']}"
        shown = ("", energy, "") if math.isnan(way) else (rolled, energy if way else "", power)
        rows.append((f"segment {row['segment']}", str(row["label"]), steps, *shown))
    return Table(("", "label", "steps", "rolled", "dissipated energy", "frictional power"), rows)


def _of_wear(history: History) -> bool:
    """Test whether a step is the end of a wear cycle, which represents many cycles."""
    return float(history.get("wear_cycles", math.nan)) >= 0.0


def _span(histories: Sequence[History], before: int, end: int) -> dict[str, Any]:
    """Return first and last step of a part of the history, and the energy dissipated in it."""
    span: dict[str, Any] = {"first_step": before + 2, "last_step": end + 1}
    if is_frictional(histories[end]):
        start = float(histories[before]["dissipated_energy"]) if before >= 0 else 0.0
        span["dissipated_energy"] = float(histories[end]["dissipated_energy"]) - start
    return span


def _column(histories: Sequence[History], name: str) -> NDArray[np.float64]:
    return np.array([float(history[name]) for history in histories])


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round values to a millionth of the largest, the accuracy of the solver."""
    unit = _LEFT_OPEN * float(np.abs(values).max())
    return np.round(values / unit) if unit else values


# --- remarks ------------------------------------------------------------------------------------------------


def remarks(histories: Sequence[History], parameters: History) -> list[str]:
    """Return sentences on the load steps of a run; `parameters` are attributes of its result."""
    tolerance, before = float(parameters.get("tolerance", 0.0)), [{}, *histories]
    static = parameters.get("algorithm") == "static"
    cold = {
        number: history["residual_tangential"] > tolerance
        for number, history in enumerate(histories, start=1)
        if history.get("cuts") and (static or not before[number - 1].get("contact_area"))
    }
    sentences = [
        *(line for name in ("warnings", "notes") for line in str(parameters.get(name, "")).splitlines()),
        *(unasked_path([n for n, own in cold.items() if own is there], there) for there in (True, False)),
        *_solved_in_parts(histories, tolerance),
        limited_steps(histories, float(parameters.get("step_tolerance", 0.0))),
        uncertain_energy(histories),
        unclosed_cycle(histories[-1], float(parameters.get("wear_tolerance", math.inf))),
    ]
    return [sentence for sentence in sentences if sentence]


def unasked_path(numbers: Sequence[int], in_parts: bool) -> str:
    """Describe the path to halved steps that begin without contact, or are static."""
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


def _solved_in_parts(histories: Sequence[History], tolerance: float) -> Iterator[str]:
    """Describe halved load steps, and adaptive ones in two halves, with R_t of their records."""

    def record_of(steps: Iterable[History]) -> str:
        largest = max((float(history["residual_tangential"]) for history in steps), default=0.0)
        words = (
            f"each part met solver.tolerance; R_t is of whole steps as they are recorded, up to {largest:.1e}"
        )
        return words if largest > tolerance else ""

    if cut := {number: history for number, history in enumerate(histories, start=1) if history.get("cuts")}:
        named = _steps([f"{number} ({halved(history)})" for number, history in cut.items()])
        record = record_of(cut.values()) or "as they are recorded they fulfil the conditions all the same"
        steps = counted(len(histories), "load step")
        yield f"{len(cut)} of {steps} did not converge at once: {named}; {record}"
    in_two = [history for history in histories if in_halves(history)]
    if record := record_of(in_two):
        steps = counted(len(histories), "load step was", "load steps were")
        yield f"{len(in_two)} of {steps} solved in two halves; {record}"


def limited_steps(histories: Sequence[History], tolerance: float) -> str:
    """Describe adaptive load steps that missed their tolerance; empty without any."""
    missed = [f"{k}" for k, history in enumerate(histories, start=1) if history.get("step_limited") == 1]
    if not missed:
        return ""
    steps = counted(len(histories), "load step changes", "load steps change")
    return (
        f"{len(missed)} of {steps} more by halving than solver.step_tolerance = "
        f"{tolerance:g}, and smaller ones did not help: {_steps(missed)}; their stick_area_step_error holds"
    )


def uncertain_energy(histories: Sequence[History]) -> str:
    """Describe a dissipated energy that the size of the load steps leaves uncertain."""
    share = path_error_share(histories[-1])
    if share <= _UNCERTAIN:
        return ""
    chosen = step_error_share(histories[-1]) is not None
    more = (
        'steps = "auto" resolves stick area, tractions and loads that turn: give numbers of steps, of which '
        if chosen
        else ""
    )
    return (
        f"the size of the load steps leaves the dissipated energy uncertain by up to {percent(share)}, since "
        f"nodes slip in directions that turn or under a pressure that changes; {more}twice as many "
        f"{'' if chosen else 'steps '}leave half of it"
    )


def unclosed_cycle(history: History, tolerance: float) -> str:
    """Describe a wear cycle that does not close on unworn surfaces; empty if it closes."""
    left = float(history.get("unworn_cycle_change", 0.0))
    if not left > tolerance:
        return ""
    return (
        f"the cycle of wear is not closed after {counted(history['unworn_cycles'], 'cycle')} on unworn "
        f"surfaces: its wear may still change by {percent(left)}, expected at most wear.tolerance = "
        f"{tolerance:g}; worn_depth_step_error includes this"
    )


def _steps(names: Sequence[str]) -> str:
    shown = listed([*names[:_MOST_NAMED], *["..."] * (len(names) > _MOST_NAMED)], "and")
    return f"step{'s' * (len(names) > 1)} {shown}"


def worn_by_cycle(
    coefficient: float, steps: Iterable[Mapping[str, NDArray[Any]]], plane: Dataset, cell: float
) -> Dataset:
    """Return the wear of a cycle at the nodes, see `hexcontact.Result.wear`.

    `steps` have the fields `WEARING`; `plane` has the coordinates of the nodes; `cell` is the area of a node
    (m2).
    """
    import xarray

    worn, spent, path = (np.zeros(plane["x"].shape) for _ in range(3))
    for step in steps:
        x, y = (np.where(step["zone"] == _SLIP, step[f"slip_increment_{axis}"], 0.0) for axis in "xy")
        worn += coefficient * step["pressure"] * np.hypot(x, y)
        spent -= step["traction_x"] * x + step["traction_y"] * y
        path += np.hypot(x, y)
    found = xarray.Dataset(coords=plane.coords)
    for name, values in zip(("worn_depth", *WORN[-2:]), (worn, spent, 0.25 * path), strict=True):
        found[name] = ("row", "col"), values, {"units": VARIABLES[name].units}
    return found.assign(wear_volume=((), cell * float(worn.sum()), {"units": "m3"}))
