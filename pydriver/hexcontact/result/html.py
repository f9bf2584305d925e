"""Display of results in notebooks."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Dataset
from ..errors import NotInResult
from ..text import Row, Table, counted, quantity, visible
from ..variables import spelled
from .history_words import extent_of, step_rows
from .layout import history_of
from .view import StepView

# Colors of zones in all pictures, which differ in black and white, too.
STICK, SLIP = "#0072b2", "#f0c05a"


@dataclass(frozen=True)
class Plane:
    """Pixels over a rectangle of the plane, x_min, x_max, y_min, y_max (m), `longer` on its longer side."""

    limits: tuple[float, float, float, float]
    longer: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        x0, x1, y0, y1 = self.limits
        pixel = max(x1 - x0, y1 - y0) / self.longer
        return max(1, round((y1 - y0) / pixel)), max(1, round((x1 - x0) / pixel))

    @cached_property
    def points(self) -> tuple[Array, Array]:
        """Centers of the pixels, from the upper left one on, m."""
        x0, x1, y0, y1 = self.limits
        rows, cols = self.shape
        x = x0 + (np.arange(cols) + 0.5) * (x1 - x0) / cols
        y = y1 - (np.arange(rows) + 0.5) * (y1 - y0) / rows
        x, y = np.meshgrid(x, y)
        return x, y


def png_of(gray: NDArray[np.uint8]) -> str:
    """Return a picture, gray or in colors, as PNG in base64."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(gray).save(file, format="PNG", compress_level=9)
    return base64.b64encode(file.getvalue()).decode()


# Colors of a map of pressure, from none to the largest (viridis), and of zones: separated, stick, slip.
_SHADES = ("#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725")
_ZONES = ("#ffffff", STICK, SLIP)
_PIXELS = 240  # of the longer side of a picture


def result_header(dataset: Dataset, path: str) -> str:
    """Return the header of a result: title, file, steps, nodes, spacing."""
    sizes, attributes = dataset.sizes, dataset.attrs
    steps = counted(sizes["step"], "load step")
    if not attributes.get("complete", True):
        planned = attributes.get("planned_steps")
        steps += f"{f' of {planned}' if planned else ''} (unfinished run)"
    title = str(attributes.get("title", ""))
    named = [f"Result of {title!r}" if title else "Result", path]
    about = f"{steps}, {sizes['row']} x {sizes['col']} nodes"
    spacing = quantity(float(attributes.get("lattice_spacing", np.nan)), "m")
    return visible(", ".join(filter(None, named))) + f"\n  {about}, spacing {spacing}"


def result_rows(dataset: Dataset) -> list[Row]:
    """Return rows of a table of the last step of a result."""
    last = dataset.isel(step=-1)
    history = {name: last[name].item() for name in history_of(dataset)}
    try:
        return list(step_rows(history, extent_of(last)))
    except KeyError:  # a data set with some quantities only
        return [(spelled(name), f"{value}") for name, value in history.items()]


def doubts(dataset: Dataset) -> list[str]:
    """Return the warnings and notes that a result has of its case, marked."""
    return [
        f"{kind}: {line}"
        for kind in ("warning", "note")
        for line in str(dataset.attrs.get(f"{kind}s", "")).splitlines()
    ]


def result_html(dataset: Dataset, path: str, quantities: str) -> str:
    """Return the last step of a result as a table beside maps of it; `quantities` (HTML) unfold below."""
    title, _, about = result_header(dataset, path).partition("\n")
    last, stopped = f"Load step {int(dataset['step'][-1])}", dataset.attrs.get("stopped")
    note = "; ".join([about.strip(), *([stopped] if stopped else []), *doubts(dataset)])
    table = Table(("", ""), result_rows(dataset), f"{title}: {last}", note)._repr_html_()
    below = f"<details><summary>all quantities</summary>{quantities}</details>"
    row = "display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start"
    return f'<div><div style="{row}"><div>{table}</div>{"".join(_pictures(dataset))}</div>{below}</div>'


def _pictures(dataset: Dataset) -> Iterable[str]:
    """Yield maps of the last step: pressure, and zones of a contact with friction."""
    try:
        view = StepView(dataset, -1)
    except NotInResult:  # the pressure was not kept
        return
    if not view.contact.any():
        return
    limits = view.window(1.15)
    plane = Plane(limits, _PIXELS)
    values, largest = view.at(*plane.points), float(view.pressure.max())
    shades = np.array([_rgb(color) for color in _SHADES])
    share, places = values / largest, np.linspace(0.0, 1.0, len(shades))
    colors = np.stack([np.interp(share, places, shades[:, k]) for k in range(3)], axis=-1)
    contact = view.touches(*plane.points)
    colors[~contact] = 255.0
    width = quantity(limits[1] - limits[0], "m", 3)
    yield _figure(colors, f"pressure, up to {quantity(largest, 'Pa')}; {width} wide")
    if view.friction and view.has("zone"):
        zone = np.where(contact, np.where(view.sticks(*plane.points), 1, 2), 0)
        zones = np.array([_rgb(color) for color in _ZONES])[zone]
        words = zip(("stick", "slip"), _ZONES[1:], strict=True)
        yield _figure(zones, ", ".join(f'<span style="color:{c}">&#9632;</span> {word}' for word, c in words))


def _rgb(color: str) -> list[int]:
    return [int(color[k : k + 2], 16) for k in (1, 3, 5)]


def _figure(colors: Array, caption: str) -> str:
    """Return a picture with its caption (HTML)."""
    picture = png_of(np.round(colors).astype("u1"))
    rows, cols = colors.shape[:2]
    frame = "border:1px solid #999;display:block"
    return (
        f'<figure style="margin:0.5em 0"><img width="{cols}" height="{rows}" style="{frame}" '
        f'alt="" src="data:image/png;base64,{picture}"><figcaption>{caption}</figcaption></figure>'
    )
