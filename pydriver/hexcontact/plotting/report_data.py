"""What a page draws of a result: curves of its history, and fields, from which the page makes its maps.

Each load step is small gray pictures, with 255 shades from 0 to the largest value of its step; shade 0 is
outside of the contact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

from ..result.history import LOADS_AND_MOTIONS, RESIDUALS, step_rows, worth_showing
from ..result.raster import Plane, png_of
from ..result.view import StepView, scaled
from ..variables import VARIABLES

if TYPE_CHECKING:
    from ..result.result import Result

Array = NDArray[np.float64]

MOST_STEPS = 120  # whose maps a page shows; of longer histories evenly chosen ones
_BYTES = 2.5e6  # of all smooth maps together, about: pages that a browser opens at once
_ZONES = 480  # pixels of the longer side of a zone map
_ARROWS = 15  # along the longer side
_CUT = 201  # points of a section
_NOISE = 1e-7  # share of the approach up to which slip is no more than the tolerance leaves
_CURVES = (  # title, and what is drawn over the step number
    ("Normal load", ("normal_load",)),
    ("Approach", ("approach",)),
    ("Tangential load", ("tangential_load_x", "tangential_load_y")),
    ("Shift", ("shift_x", "shift_y")),
    ("Torque", ("torque",)),
    ("Twist", ("twist",)),
    ("Contact and stick area", ("contact_area_fit", "stick_area_fit")),
    ("Largest pressure", ("max_pressure",)),
    ("Largest shear traction", ("max_traction",)),
    ("Elastic energy", ("elastic_energy",)),
    ("Dissipated energy", ("dissipated_energy",)),
)
_LOOPS = (  # title, what is drawn over what
    ("Tangential load over shift, x", "shift_x", "tangential_load_x"),
    ("Tangential load over shift, y", "shift_y", "tangential_load_y"),
    ("Torque over twist", "twist", "torque"),
)
_SYMBOLS = {
    "tangential_load_x": "Q_x",
    "tangential_load_y": "Q_y",
    "shift_x": "x",
    "shift_y": "y",
    "contact_area_fit": "contact",
    "stick_area_fit": "stick",
}
_MAPS = (  # name, title, components, whether the page gives all steps one color scale at first
    ("pressure", "Pressure", ("pressure",), True),
    ("traction", "Shear traction", ("traction_x", "traction_y"), True),
    ("slip", "Slip in the step", ("slip_increment_x", "slip_increment_y"), False),
    ("accumulated_slip", "Slip path so far", ("accumulated_slip",), True),
)


def rounded(values: Any, digits: int = 4) -> list[float | None]:
    """Return numbers as JSON may hold them; None for those that are not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.ravel(values).tolist()]


def kept_steps(result: Result) -> list[int]:
    """Return the numbers of the steps that can be shown as maps, the last among them."""
    if "pressure" not in result.dataset:
        return []
    numbers = result.dataset["step"].values.tolist()
    every = int(result.dataset.attrs.get("output_every", 1))
    kept = [n for n in numbers if n % every == 0 or n == numbers[-1]]
    stride = math.ceil(len(kept) / MOST_STEPS)
    return kept[::-1][::stride][::-1]


def drawn_data(
    result: Result, histories: Sequence[Mapping[str, Any]], numbers: Sequence[int]
) -> dict[str, Any]:
    """Return all that a page draws, as its JSON holds it.

    Parameters
    ----------
    result : Result
        The result.
    histories : sequence of mapping
        History of each step, with its number.
    numbers : sequence of int
        The steps with maps, see `kept_steps`.
    """
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
    """Return the maps of some load steps, and sections through them along x.

    Parameters
    ----------
    result : Result
        The result.
    numbers : sequence of int
        The steps; their pressure was kept.

    Returns
    -------
    dict
        What the page reads as JSON: limits, maps (pictures in base64), arrows, zones, sections.
    """
    first = StepView.of(result, numbers[-1])
    limits = _limits(result, numbers, first)
    known = [entry for entry in _MAPS if set(entry[2]) <= set(first.data)]
    if first.friction == 0.0:
        known = [entry for entry in known if entry[0] == "pressure"]
    pixels = int(np.clip(math.sqrt(_BYTES / (0.45 * len(known) * len(numbers))), 70, 260))
    plane, fine = Plane(limits, pixels), Plane(limits, _ZONES)
    to_length, length = scaled(max(map(abs, limits)), "m")
    shown: dict[str, dict[str, Any]] = {
        name: {
            "name": name,
            "title": title,
            "common": common,
            "unit": VARIABLES[parts[0]].units,
            "images": [],
            "max": [],
            "arrows": [],
        }
        for name, title, parts, common in known
    }
    nearest = fine.nearest(first) if first.friction and "zone" in first.data else None
    zones, sections = [], []
    noise = _NOISE * float(np.abs(result.dataset["approach"].values).max())
    cut = np.linspace(limits[0], limits[1], _CUT), np.full(_CUT, 0.5 * (limits[2] + limits[3]))
    for number in numbers:
        view = StepView.of(result, number)
        contact = view.at(*plane.points) > 0.0
        weight = np.where(contact, view.at(*plane.points, view.contact.astype(float)), 1.0)
        for name, _, parts, _ in known:
            values = [np.nan_to_num(view.data[part].values) for part in parts]
            size = np.sqrt(sum(view.at(*plane.points, part) ** 2 for part in values))
            if "slip" in name:  # does not go to zero at the edge: nodes beyond it have no say
                size = size / weight
            largest = float(np.sqrt(sum(part**2 for part in values))[view.contact].max(initial=0.0))
            if "slip" in name and largest < noise:
                largest = 0.0
            shown[name]["images"].append(_gray(size, largest, contact))
            shown[name]["max"].append(rounded(largest)[0])
            if len(parts) == 2:
                shown[name]["arrows"].append(_arrows(view, limits, values, largest) if largest else [])
        if nearest is not None:
            row, col, inside = nearest
            zone = np.where(inside, view.data["zone"].values[row, col], 0).astype("u1")
            zones.append(png_of(zone))
        sections.append(_section(view, *cut))
    shown = {name: entry for name, entry in shown.items() if "slip" not in name or any(entry["max"])}
    for entry in shown.values():
        factor, unit = scaled(max((m or 0.0 for m in entry["max"]), default=0.0), entry["unit"])
        entry |= {"unit": unit, "max": rounded([factor * (m or 0.0) for m in entry["max"]])}
    return {
        "steps": list(numbers),
        "limits": rounded([to_length * value for value in limits], 6),
        "length": length,
        "maps": list(shown.values()),
        "zones": zones,
        "sections": _scaled_sections(sections, cut[0] * to_length, first),
        "section_y": f"{cut[1][0] * to_length:.4g} {length}",
    }


def _limits(result: Result, numbers: Sequence[int], view: StepView) -> tuple[float, float, float, float]:
    """Limits of all maps: around what is in contact in any of the steps."""
    ever = np.zeros(view.contact.shape, dtype=bool)
    for number in numbers:
        ever |= result.step(number)["pressure"].values > 0.0
    if not ever.any():
        ever[:] = True
    x, y, margin = view.x[ever], view.y[ever], 1.08
    middle_x, middle_y = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min())
    half_x, half_y = (0.5 * margin * np.ptp(v) + 1.5 * view.spacing for v in (x, y))
    least = 0.2 * max(half_x, half_y)  # long contacts are not drawn as lines
    half_x, half_y = max(half_x, least), max(half_y, least)
    return (
        float(middle_x - half_x),
        float(middle_x + half_x),
        float(middle_y - half_y),
        float(middle_y + half_y),
    )


def _gray(values: Array, largest: float, contact: NDArray[np.bool_]) -> str:
    shades = np.zeros(values.shape) if largest == 0.0 else np.clip(values / largest, 0.0, 1.0)
    return png_of(np.where(contact, 1 + np.round(254 * shades), 0).astype("u1"))


def _arrows(
    view: StepView, limits: tuple[float, float, float, float], components: Sequence[Array], largest: float
) -> list[int]:
    """Return arrows on a triangular pattern: four whole numbers for each.

    x and y in thousandths of the map, from its upper left corner, and components in percent of the largest.
    """
    x0, x1, y0, y1 = limits
    pitch = max(x1 - x0, y1 - y0) / _ARROWS
    rows, cols = math.ceil((y1 - y0) / pitch / 0.866), math.ceil((x1 - x0) / pitch)
    j, i = np.meshgrid(np.arange(-rows, rows + 1), np.arange(-cols, cols + 1), indexing="ij")
    x = 0.5 * (x0 + x1) + pitch * (i + 0.5 * (j % 2))
    y = np.asarray(0.5 * (y0 + y1) + 0.866 * pitch * j, dtype=np.float64)
    inside = (x > x0) & (x < x1) & (y > y0) & (y < y1)
    x, y = x[inside], y[inside]
    u, v = (view.at(x, y, part) for part in components)
    size = np.hypot(u, v)
    seen = (view.at(x, y) > 0.0) & (size > 0.03 * largest)
    if not seen.any():
        return []
    columns = (1000 * (x - x0) / (x1 - x0), 1000 * (y1 - y) / (y1 - y0), 100 * u / largest, 100 * v / largest)
    table = np.stack([np.round(column[seen]) for column in columns], axis=1)
    return [int(number) for number in table.ravel()]


def _section(view: StepView, x: Array, y: Array) -> dict[str, Array]:
    """Return pressure and tractions along a line, and what bounds them or is known of them."""
    curves = {"p": view.at(x, y)}
    mu = view.friction
    if mu > 0.0 and {"traction_x", "traction_y"} <= set(view.data):
        for axis in "xy":
            curves[f"q_{axis}"] = view.at(x, y, np.nan_to_num(view.data[f"traction_{axis}"].values))
        if math.isfinite(mu):
            curves["μp"] = mu * curves["p"]
    if view.hertz is not None and view.hertz_holds:
        curves["p (Hertz)"] = view.hertz.pressure(x - view.center[0], y - view.center[1])
    return curves


def _scaled_sections(sections: Sequence[dict[str, Array]], x: Array, view: StepView) -> dict[str, Any]:
    """Bring the curves of all steps to one unit; leave out components that are nothing but noise."""
    names = list(dict.fromkeys(name for section in sections for name in section))
    peak = {name: max(float(np.abs(s[name]).max()) for s in sections if name in s) for name in names}
    shear = max((peak[name] for name in peak if name.startswith("q")), default=0.0)
    names = [name for name in names if not name.startswith("q") or peak[name] > 1e-3 * shear > 0.0]
    panels = []
    for title, chosen in (("Pressure", ["p", "p (Hertz)"]), ("Shear traction", ["q_x", "q_y", "μp"])):
        curves = [name for name in chosen if name in names]
        if not curves or (title != "Pressure" and curves == ["μp"]):
            continue
        factor, unit = scaled(max(peak[name] for name in curves), "Pa")
        values = {n: [rounded(factor * s[n]) if n in s else [] for s in sections] for n in curves}
        panels.append({"title": title, "unit": unit, "curves": values})
    return {"x": rounded(x, 5), "panels": panels}


# --- curves ---------------------------------------------------------------------------------------


def charts_of(histories: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the curves of a history as the page draws them; none of a single load step.

    Parameters
    ----------
    histories : sequence of mapping
        History of each step.
    """
    if len(histories) < 2:
        return []
    telling = {name for name in VARIABLES if name in histories[0] and name not in LOADS_AND_MOTIONS}
    telling |= set(worth_showing(histories))
    steps = [history["step"] for history in histories]
    charts: list[dict[str, Any]] = []
    for title, names in _CURVES:
        shown = [name for name in names if name in telling and _peak(name, histories) > 0.0]
        if not shown:
            continue
        factor, unit = scaled(max(_peak(name, histories) for name in shown), VARIABLES[shown[0]].units)
        curves = {_SYMBOLS.get(name, ""): _values(name, histories, factor) for name in shown}
        charts.append({"title": title, "x": steps, "xlabel": "step", "unit": unit, "curves": curves})
    for title, over, name in _LOOPS:
        if {over, name} <= telling and min(_peak(over, histories), _peak(name, histories)) > 0.0:
            to_x, x_unit = scaled(_peak(over, histories), VARIABLES[over].units)
            factor, unit = scaled(_peak(name, histories), VARIABLES[name].units)
            charts.append(
                {
                    "title": title,
                    "x": _values(over, histories, to_x),
                    "xlabel": f"{over.replace('_', ' ')} [{x_unit}]",
                    "unit": unit,
                    "curves": {"": _values(name, histories, factor)},
                    "points": True,
                }
            )
    signs = {sign: name for sign, name in RESIDUALS.items() if name in histories[0]}
    curves = {sign: _values(name, histories, 1.0) for sign, name in signs.items() if _peak(name, histories)}
    charts.append(
        {"title": "Residuals", "x": steps, "xlabel": "step", "unit": "", "curves": curves, "log": True}
    )
    return charts


def _peak(name: str, histories: Sequence[Mapping[str, Any]]) -> float:
    values = np.abs([float(history[name]) for history in histories])
    return float(values[np.isfinite(values)].max(initial=0.0))


def _values(name: str, histories: Sequence[Mapping[str, Any]], factor: float) -> list[float | None]:
    return rounded([factor * float(history[name]) for history in histories], 5)
