"""Tables and small pictures that notebooks and terminals show for cases, steps and results."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..text import Row, html_table, quantity, visible

if TYPE_CHECKING:
    from .result import Result

# Colors of a map of pressure, from none to the largest (viridis), and of zones: separated, stick, slip.
_SHADES = ("#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725")
_ZONES = ("#ffffff", "#0072b2", "#f0c05a")
_PIXELS = 240  # of the longer side of a picture


# --- results ------------------------------------------------------------------------------------------------


def result_header(result: Result) -> str:
    """Return what a result is of: title, file, how much of it there is."""
    sizes, attributes = result.dataset.sizes, result.dataset.attrs
    steps = f"{len(result)} load step{'s' * (len(result) != 1)}"
    if not result.complete:
        planned = attributes.get("planned_steps")
        steps += f"{f' of {planned}' if planned else ''} (unfinished run)"
    named = [f"Result of {result.case_title!r}" if result.case_title else "Result", result.path]
    about = f"{steps}, {sizes['row']} x {sizes['col']} nodes"
    spacing = quantity(float(attributes.get("lattice_spacing", np.nan)), "m")
    return visible(", ".join(filter(None, named))) + f"\n  {about}, spacing {spacing}"


def result_rows(result: Result) -> list[Row]:
    """Return what the last step of a result came to."""
    from .history import step_rows

    last = result.dataset.isel(step=-1)
    names = [name for name, values in result.dataset.data_vars.items() if values.dims == ("step",)]
    history = {str(name): last[name].item() for name in names}
    try:
        return list(step_rows(history))
    except KeyError:  # a result that was put together by hand, of some quantities
        return [(name.replace("_", " "), f"{value}") for name, value in history.items()]


def result_html(result: Result) -> str:
    """Return the last step of a result as a table beside maps of it, and all there is to unfold."""
    title, _, about = result_header(result).partition("\n")
    last = f"Load step {int(result.dataset['step'][-1])}"
    note = about.strip() + (f"; {result.stopped}" if result.stopped else "")
    table = html_table(f"{title}: {last}", ("", ""), result_rows(result), note)
    pictures = "".join(_pictures(result))
    below = f"<details><summary>all quantities</summary>{result.quantities._repr_html_()}</details>"
    row = "display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start"
    return f'<div><div style="{row}"><div>{table}</div>{pictures}</div>{below}</div>'


def _pictures(result: Result) -> Iterable[str]:
    """Yield maps of the last step: pressure, and where there is friction the zones."""
    from .raster import Plane
    from .view import StepView

    try:
        view = StepView.of(result, -1)
    except ValueError:  # not kept
        return
    if not view.contact.any():
        return
    plane = Plane(view.window(1.15), _PIXELS)
    values = view.at(*plane.points)
    largest = float(view.pressure.max())
    shades = np.array([_rgb(color) for color in _SHADES])
    share = np.clip(values / largest, 0.0, 1.0) * (len(shades) - 1)
    places = np.arange(len(shades))
    colors = np.stack([np.interp(share, places, shades[:, k]) for k in range(3)], axis=-1)
    colors[values <= 0.0] = 255.0
    width = quantity(view.window(1.15)[1] - view.window(1.15)[0], "m", 3)
    yield _figure(colors, f"pressure, up to {quantity(largest, 'Pa')}; {width} wide")
    if view.friction and "zone" in view.data:
        row, col, inside = plane.nearest(view)
        zone = np.where(inside, np.maximum(view.data["zone"].values[row, col], 0), 0)
        zones = np.array([_rgb(color) for color in _ZONES])[zone]
        words = zip(("stick", "slip"), _ZONES[1:], strict=True)
        yield _figure(zones, ", ".join(f'<span style="color:{c}">&#9632;</span> {word}' for word, c in words))


def _rgb(color: str) -> list[int]:
    return [int(color[k : k + 2], 16) for k in (1, 3, 5)]


def _figure(colors: NDArray[np.float64], caption: str) -> str:
    """Return a picture with its caption (HTML)."""
    from .raster import png_of

    picture = png_of(np.round(colors).astype("u1"))
    rows, cols = colors.shape[:2]
    frame = "border:1px solid #999;display:block"
    return (
        f'<figure style="margin:0.5em 0"><img width="{cols}" height="{rows}" style="{frame}" '
        f'alt="" src="data:image/png;base64,{picture}"><figcaption>{caption}</figcaption></figure>'
    )
