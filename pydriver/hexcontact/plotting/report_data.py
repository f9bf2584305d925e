"""Data of the charts and maps of a report.

The fields of a load step are small gray pictures: shade 0 is outside of the contact, shades 1 to 255 are
values from 0 to the largest of the step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np

from ..arrays import Array, Mask
from ..result.history_words import rolled_steps, rolls, step_rows
from ..result.html import Plane, png_of
from ..result.result import Result
from ..result.view import StepView, dataset_of
from ..text import scaled, worded
from ..variables import LOADS, MAPS, RESIDUALS, ROLLED, TRACTIONS, VARIABLES, spelled
from .history import panels_of, peak
from .maps import Limits, Part
from .sections import line_of

MOST_STEPS = 120  # steps with maps; evenly chosen from longer histories
_BYTES = 2.5e6  # of all smooth maps together, about, so that pages open fast
_ZONES = 480  # pixels of the longer side of a zone map
_ARROWS = 15  # along the longer side
_CUT = 201  # points of a section
_NOISE = 1e-7  # share of the approach below which slip is within the tolerance


def rounded(values: Any, digits: int = 4) -> list[float | None]:
    """Return rounded numbers for JSON, None in place of NaN and infinity."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.ravel(values).tolist()]


def mapped_steps(result: Result) -> list[int]:
    """Return the numbers of the steps with maps, the last among them."""
    data = dataset_of(result)
    if "pressure" not in data:
        return []
    numbers = data["step"].values.tolist()
    every = int(data.attrs.get("output_every", 1))
    kept = [n for n in numbers if n % every == 0 or n == numbers[-1]]
    stride = math.ceil(len(kept) / MOST_STEPS)
    return kept[::-1][::stride][::-1]


def drawn_data(
    result: Result, histories: Sequence[Mapping[str, Any]], numbers: Sequence[int]
) -> dict[str, Any]:
    """Return the data of charts for JSON, and of maps of the steps with some numbers."""
    palette = matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, 255))[:, :3]
    return {
        "palette": np.round(255 * palette).astype(int).ravel().tolist(),
        "numbers": [history["step"] for history in histories],
        "labels": [str(history.get("label", "")) for history in histories],
        "states": [step_rows(history) for history in histories],
        "charts": charts_of(histories),
        "fields": maps_of(result, numbers) if numbers else None,
    }


# --- maps -----------------------------------------------------------------------------------------


def maps_of(result: Result, numbers: Sequence[int]) -> dict[str, Any]:
    """Return limits, maps (pictures in base64), arrows, zones and sections along x of some load steps."""
    last = StepView(result, numbers[-1])
    part = Part.around((StepView(result, number) for number in numbers), 1.2, 0.2)
    known = {title: names for title, names in MAPS.items() if set(names) <= set(last.data)}
    if last.friction == 0.0:
        known = {title: names for title, names in known.items() if not VARIABLES[names[0]].frictional}
    elongated = math.sqrt(max(part.aspect, 1.0 / part.aspect))  # for the same number of pixels
    pixels = int(elongated * np.clip(math.sqrt(_BYTES / (0.45 * len(known) * len(numbers))), 70, 260))
    plane, fine = Plane(part.limits, pixels), Plane(part.limits, _ZONES)
    shown: dict[str, dict[str, Any]] = {
        title: {
            "name": names[0].removesuffix("_x"),
            "title": title,
            "common": "increment" not in names[0],  # one color scale for all steps at first
            "unit": VARIABLES[names[0]].units,
            "images": [],
            "max": [],
            "arrows": [],
        }
        for title, names in known.items()
    }
    zones: list[str] = []
    sections = []
    noise = _NOISE * float(np.abs(result.dataset["approach"].values).max())
    line = line_of((StepView(result, number) for number in numbers), 0.0)
    place = np.linspace(0.0, line.length, _CUT)
    for number in numbers:
        view = StepView(result, number)
        contact = view.touches(*plane.points)
        weight = np.where(contact, view.at(*plane.points, view.contact.astype(float)), 1.0)
        for title, names in known.items():
            entry, slip = shown[title], VARIABLES[names[0]].units == "m"
            values = [np.nan_to_num(view.data[name].values) for name in names]
            parts = [_at(view, *plane.points, name) for name in names]
            size = np.sqrt(sum(component**2 for component in parts))
            if slip:  # not zero at the edge: nodes beyond it do not count
                size = size / weight
            largest = float(np.sqrt(sum(component**2 for component in values))[view.contact].max(initial=0.0))
            if slip and largest < noise:
                largest = 0.0
            entry["images"].append(_gray(size, largest, contact))
            entry["max"].append(largest)
            if len(names) == 2:
                entry["arrows"].append(_arrows(view, part.limits, names, largest) if largest else [])
        if view.friction and "zone" in view.data:
            zone = np.where(view.sticks(*fine.points), 1, 2) * view.touches(*fine.points)
            zones.append(png_of(zone.astype("u1")))
        sections.append(_section(view, *line.points(place)))
    for title, entry in list(shown.items()):
        if entry["name"] != "pressure" and not any(entry["max"]):
            del shown[title]
            continue
        factor, entry["unit"] = scaled(max(entry["max"]), entry["unit"])
        entry["max"] = rounded([factor * largest for largest in entry["max"]])
    return {
        "steps": list(numbers),
        "limits": rounded([part.factor * value for value in part.limits], 6),
        "length": part.unit,
        "maps": list(shown.values()),
        "zones": zones,
        "sections": _scaled_sections(sections, (line.start[0] + place) * part.factor),
        "section_y": worded(line.start[1], "m"),
    }


def _at(view: StepView, x: Array, y: Array, name: str) -> Array:
    """Return a field at points, 0 where it was not kept."""
    return view.at(x, y, name if name in TRACTIONS else np.nan_to_num(view.data[name].values))


def _gray(values: Array, largest: float, contact: Mask) -> str:
    shades = np.zeros(values.shape) if largest == 0.0 else np.clip(values / largest, 0.0, 1.0)
    return png_of(np.where(contact, 1 + np.round(254 * shades), 0).astype("u1"))


def _arrows(view: StepView, limits: Limits, names: Sequence[str], largest: float) -> list[int]:
    """Return arrows on a triangular pattern, four whole numbers for each.

    These are x and y in thousandths of the map from its upper left corner, and the components in percent of
    the largest.
    """
    x0, x1, y0, y1 = limits
    pitch = max(x1 - x0, y1 - y0) / _ARROWS
    rows, cols = math.ceil((y1 - y0) / pitch / 0.866), math.ceil((x1 - x0) / pitch)
    j, i = np.meshgrid(np.arange(-rows, rows + 1), np.arange(-cols, cols + 1), indexing="ij")
    x = 0.5 * (x0 + x1) + pitch * (i + 0.5 * (j % 2))
    y = np.asarray(0.5 * (y0 + y1) + 0.866 * pitch * j, dtype=np.float64)
    inside = (x > x0) & (x < x1) & (y > y0) & (y < y1)
    x, y = x[inside], y[inside]
    u, v = (_at(view, x, y, name) for name in names)
    size = np.hypot(u, v)
    seen = (view.at(x, y) > 0.0) & (size > 0.03 * largest)
    if not seen.any():
        return []
    columns = (1000 * (x - x0) / (x1 - x0), 1000 * (y1 - y) / (y1 - y0), 100 * u / largest, 100 * v / largest)
    table = np.stack([np.round(column[seen]) for column in columns], axis=1)
    return [int(number) for number in table.ravel()]


def _section(view: StepView, x: Array, y: Array) -> dict[str, Array]:
    """Return pressure and tractions along a line, with the bounds mu p and the pressure of Hertz."""
    curves = {"p": view.at(x, y)}
    mu = view.friction
    if mu != 0.0 and {"traction_x", "traction_y"} <= set(view.data):
        for axis in "xy":
            curves[f"q_{axis}"] = view.at(x, y, f"traction_{axis}")
        if math.isfinite(mu):
            curves["μp"] = mu * curves["p"]
            curves["−μp"] = -curves["μp"]
    if view.hertz is not None and view.hertz_holds:
        curves["p (Hertz)"] = view.hertz.pressure(x - view.center[0], y - view.center[1])
    return curves


def _scaled_sections(sections: Sequence[dict[str, Array]], x: Array) -> dict[str, Any]:
    """Return the curves of all steps in one unit, without components below the noise."""
    names = list(dict.fromkeys(name for section in sections for name in section))
    peak = {name: max(float(np.abs(s[name]).max()) for s in sections if name in s) for name in names}
    shear = max((peak[name] for name in peak if name.startswith("q")), default=0.0)
    names = [name for name in names if not name.startswith("q") or peak[name] > 1e-3 * shear > 0.0]
    if "μp" in names:  # on the sides where the traction lies
        sides = {"μp": 1.0, "−μp": -1.0}
        tractions = [s[name] for s in sections for name in names if name in s and name[0] == "q"]
        reach = {k: max((np.max(sign * q) for q in tractions), default=0.0) for k, sign in sides.items()}
        used = [side for side in sides if reach[side] > 0.05 * peak["μp"]] or ["μp"]
        names = [name for name in names if name not in sides or name in used]
    panels = []
    for title, chosen in (("Pressure", ["p", "p (Hertz)"]), ("Shear traction", ["q_x", "q_y", "μp", "−μp"])):
        curves = [name for name in chosen if name in names]
        if not curves or (title != "Pressure" and not any(name.startswith("q") for name in curves)):
            continue
        factor, unit = scaled(max(peak[name] for name in curves), "Pa")
        values = {n: [rounded(factor * s[n]) if n in s else [] for s in sections] for n in curves}
        panels.append({"title": title, "unit": unit, "curves": values})
    return {"x": rounded(x, 5), "panels": panels}


# --- curves ---------------------------------------------------------------------------------------


def charts_of(histories: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the charts of a history; none for a single load step."""
    if len(histories) < 2:
        return []

    def curves_of(names: Mapping[str, str], rolled: bool = False) -> dict[str, Any]:
        """Return unit and values of quantities by the labels of their curves, or of rolling steps alone."""
        chosen = rolled_steps(histories) if rolled else histories
        largest = max(peak(name, histories) for name in names)
        factor, unit = scaled(largest, VARIABLES[next(iter(names))].units)
        values = {
            word: rounded(
                [VARIABLES[n].before * factor] * (not rolled) + [factor * float(h[n]) for h in chosen], 5
            )
            for n, word in names.items()
        }
        return {"unit": unit, "curves": values}

    steps = [0, *(history["step"] for history in histories)]
    panels = panels_of(histories)
    over: dict[str, Any] = {"x": steps, "xlabel": "load step"}
    charts = [{"title": title, **over, **curves_of(names)} for title, names in panels.items()]
    shown = {name for names in panels.values() for name in names}
    rolling = rolls(histories[-1])
    for motion, (load, way) in (ROLLED if rolling else LOADS).items():
        if motion != "z" and {load, way} <= shown:
            title = f"{VARIABLES[load].title} over {VARIABLES[way].title.lower()}"
            along = curves_of({way: ""}, rolling)
            title += f", {motion}" if motion in "xy" else ""
            axis = {"x": along["curves"][""], "xlabel": f"{spelled(way)} ({along['unit']})"}
            charts.append({"title": title, **axis, **curves_of({load: ""}, rolling), "points": True})
    known = {name: sign for sign, name in RESIDUALS.items() if name in histories[0]}
    residuals = {name: sign for name, sign in known.items() if peak(name, histories)}
    found = curves_of(residuals) if residuals else {"unit": "", "curves": {}}
    return [*charts, {"title": "Residuals", **over, **found, "log": True}]
