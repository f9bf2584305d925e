"""The report of a result: one HTML page that needs neither a network nor this program.

Layout and scripts are in the template data/report.html; this module makes its tables and the data of its
charts and maps. The fields of a load step are small gray pictures: shade 0 is outside of the contact, shades
1 to 255 are values from 0 to the largest of the step.
"""

from __future__ import annotations

import base64
import contextlib
import datetime
import hashlib
import io
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from itertools import groupby
from pathlib import Path
from typing import Any

import jinja2
import matplotlib
import numpy as np

from .._version import __version__
from ..arrays import Array, Mask
from ..deck.below import Fatigue, Stress
from ..deck.read import recorded
from ..errors import DeckError, HexcontactError, NotInResult
from ..files import MADE_BY, replacing, require_replaceable
from ..interior.files import readable_table, tables_of
from ..interior.stress import place_of
from ..plotting.history import panels_of, peak
from ..plotting.maps import Limits, Part
from ..plotting.sections import line_of
from ..problem.preview import case_rows
from ..problem.problem import Problem
from ..result.history_words import rolled_steps, rolls, segments, step_rows, value_of, worth_showing
from ..result.html import Plane, png_of
from ..result.result import Result
from ..result.view import StepView, mapped_steps
from ..text import Table, counted, quantity, scaled, visible, worded
from ..variables import LOADS, MAPS, RESIDUALS, ROLLED, TRACTIONS, VARIABLES, label_of, spelled
from . import printed

_BYTES = 2.5e6  # of all smooth maps together, about, so that pages open fast
_ZONES = 480  # pixels of the longer side of a zone map
_ARROWS = 15  # along the longer side
_CUT = 201  # points of a section
_NOISE = 1e-7  # share of the approach below which slip is within the tolerance
_MOST_PARTS = 200  # segments, and cycles, in the table of energies
_LINES = 12  # of a long array of numbers in a deck
_DATA = resources.files("hexcontact").joinpath("data")


def write_report(result: Result, target: Path) -> Path:
    """Write the page of a result, finished or not, in place of an earlier page."""
    if target.suffix.lower() not in (".html", ".htm"):
        raise DeckError(f"--output {target}: expected a page, such as {target.with_suffix('.html')}")
    require_replaceable(target)
    with replacing(target) as temporary:
        temporary.write_text(report(result), encoding="utf-8")
    return target


def report(result: Result) -> str:
    """Return the page of a result, finished or not, as HTML."""
    summary = printed.Summary.of_result(result)
    histories, tables = summary.steps(), summary.tables(_MOST_PARTS)
    numbers = mapped_steps(result)
    data = drawn_data(result, histories, numbers)
    title = result.case_title or Path(result.path).stem or "hexcontact result"
    environment = jinja2.Environment(
        # PackageLoader does not find the folder of an editable installation.
        loader=jinja2.FunctionLoader(lambda name: _DATA.joinpath(name).read_text(encoding="utf-8")),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=lambda value: visible(value) if type(value) is str else value,  # not of macros
        trim_blocks=True,
    )
    return environment.get_template("report.html").render(
        title=title,
        made_by=MADE_BY,
        notes=[_unfinished(result), *summary.remarks],
        kept=_kept(len(numbers), len(histories)),
        inputs=_inputs(result, _problem_of(result.deck)),
        loads=_loads(histories),
        energies=tables["Dissipated energy"],
        below=_below(result),
        pictures=list(_pictures(result)) if numbers else [],
        deck=_shortened(result.deck),
        hertz=tables["Against Hertz"],
        accuracy=tables["Accuracy"],
        residuals=_residuals(histories),
        provenance=_provenance(result, histories),
        data=json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    )


# --- words ----------------------------------------------------------------------------------------


def _unfinished(result: Result) -> str:
    if result.shortfall or result.complete:
        return result.shortfall
    planned = int(result.dataset.attrs.get("planned_steps", 0))
    reason = str(result.dataset.attrs.get("stopped", ""))
    of = f" of {planned}" if planned else ""
    return f"Unfinished run: {counted(f'{len(result)}{of}', 'load step')}. {reason}".strip()


def _shortened(deck: str) -> str:
    """Return a deck with the first lines of long arrays of numbers only."""
    kept: list[str] = []
    for of_numbers, lines in groupby(deck.splitlines(), lambda line: not re.search('["=]', line)):
        run = list(lines)
        if of_numbers and (left_out := len(run) - _LINES) > _LINES:
            run[_LINES:] = [f"    ... ({left_out:,} lines more, in the result)"]
        kept += run
    return "\n".join(kept)


def _kept(shown: int, steps: int) -> str:
    if shown == steps:
        return ""
    if shown == 0:
        return "The fields of this run were not kept (output.fields), so that there are no maps."
    return f"Maps of {shown} of {steps} load steps: those in the result, evenly chosen if there are many."


def _problem_of(deck: str) -> Problem | None:
    """Return the problem of a result; None with parts from Python, or if its deck is not understood."""
    with contextlib.suppress(HexcontactError):
        if deck and not recorded(deck).given:
            return Problem.from_text(deck, "deck of the result")
    return None


def _inputs(result: Result, case: Problem | None) -> list[tuple[str, ...]]:
    attributes, sizes = result.dataset.attrs, result.dataset.sizes
    left_out = {"window", "memory", "load steps"}
    spacing = "spacing", quantity(float(attributes["lattice_spacing"]), "m")
    rows: list[tuple[str, ...]] = []
    if case is not None:
        refined = (
            {"spacing", "accuracy", "work"} if case.accuracy else set()
        )  # of the first lattice, estimates
        rows = [row for row in case_rows(case) if row[0] not in left_out | refined]
        rows += [spacing] if refined else []
    elif "effective_modulus" in attributes:
        modulus = quantity(float(attributes["effective_modulus"]), "Pa")
        beta, gamma = (float(attributes[n]) for n in ("dundurs_beta", "tangential_compliance_ratio"))
        pair = f"E* = {modulus}, beta = {beta:.4g}, gamma = {gamma:.4g}"
        rows = [("pair", pair), ("algorithm", printed.algorithm(attributes)), spacing]
    planned = int(attributes["planned_steps"])
    steps = f"{len(result)}" + (f" of {planned}" if planned else "")
    return [*rows, ("window", f"{sizes['row']} x {sizes['col']} nodes at the end"), ("load steps", steps)]


def _provenance(result: Result, histories: Sequence[printed.History]) -> list[tuple[str, ...]]:
    attributes, deck = result.dataset.attrs, result.deck
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    return [
        ("file", result.path or "not written"),
        ("computed by", str(attributes["source"])),
        ("machine", str(attributes.get("machine", "not recorded"))),
        ("run started", str(attributes["created"])),
        ("time in the solver", quantity(sum(float(h["seconds"]) for h in histories), "s", 3)),
        ("run", str(attributes["run"])),
        ("measured surfaces", str(attributes.get("measured_surfaces", "none"))),
        ("deck, SHA-256", hashlib.sha256(deck.encode()).hexdigest() if deck else "made in Python, no deck"),
        ("layout of the file", str(attributes["schema_version"])),
        ("page written by", f"hexcontact {__version__}, {now}"),
    ]


def _loads(histories: Sequence[printed.History]) -> Table:
    """Return the loads at the end of each segment as a table."""
    names, rows = worth_showing(histories), []
    for part in segments(histories):
        first, last = part["first_step"], part["last_step"]
        steps = f"{first} to {last}" if first < last else f"{last}"
        loads = (value_of(name, histories[last - 1]) for name in names)
        rows.append((f"{part['segment']}", part["label"], steps, *loads))
    return Table(("segment", "label", "steps", *map(label_of, names)), rows)


def _below(result: Result) -> Table:
    """Return the tables [[stress]] and [[fatigue]] of the deck, with their files, as a table."""
    rows = []
    for name, table in tables_of(result.deck).items():
        chosen = table.parameters if isinstance(table, Fatigue) else table.components
        labels = table.segment if isinstance(table, Fatigue) else None
        steps = labels or ("last",) if table.steps is None else np.atleast_1d(table.steps)
        output = Path(result.path or "output")
        file = output.with_name(f"{output.stem}_{name}.nc")
        found = readable_table(file)
        fields = {} if found is None else found.data_vars
        places = [f"{key}: {place}" for key, field in fields.items() if (place := place_of(field))]
        shown = ", ".join(chosen) or "stress", str(table.body), ", ".join(map(str, steps))
        rows.append((file.name, *shown, "; ".join(places)))
    return Table(("file", "quantities", "body", "load steps", "largest values"), rows)


def _pictures(result: Result) -> Iterator[tuple[str, str]]:
    """Yield title and data (PNG, base64) of a picture of each kind of table of `_below`."""
    from ..plotting.below import fatigue, stress

    kinds = {type(table) for table in tables_of(result.deck).values()}
    for kind, draw, title in (
        (Stress, stress, "Stress of von Mises below the contact"),
        (Fatigue, fatigue, "Fatigue parameter"),
    ):
        if kind in kinds:
            try:
                canvas, data = draw(result), io.BytesIO()
            except NotInResult:  # fields that were not kept, tables of points alone
                continue
            canvas.savefig(data, format="png", dpi=160)
            yield title, base64.b64encode(data.getvalue()).decode()


def _residuals(histories: Sequence[printed.History]) -> Table:
    """Return residuals and work of each load step as a table."""
    signs = {sign: name for sign, name in RESIDUALS.items() if name in histories[0]}
    rows = [
        (
            *(str(h["step"]), str(h.get("label", ""))),
            *(f"{float(h[name]):.1e}" for name in signs.values()),
            *(str(h["sweeps"]), str(h.get("cuts", 0)), f"{float(h['operator_applications']):.3g}"),
            quantity(float(h["seconds"]), "s", 3),
        )
        for h in histories
    ]
    return Table(("step", "label", *signs, "iterations", "halved", "operator applications", "time"), rows)


# --- data of charts and maps -------------------------------------------------------------------------


def rounded(values: Any, digits: int = 4) -> list[float | None]:
    """Return rounded numbers for JSON, None in place of NaN and infinity."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.ravel(values).tolist()]


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
