"""Wear by cycles: pressure and worn depth along a line, while the surfaces wear."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ..errors import NotInResult
from ..result.view import StepView, dataset_of, title_of
from ..text import scaled
from .registry import figure
from .sections import Cut, Point
from .style import color_scale, new_figure, set_title, shades

if TYPE_CHECKING:
    import xarray

    from ..result.result import Result

_CURVES = 7


@figure("wear", "pressure and worn depth along a line, by cycles of wear", needs="wear")
def wear(result: Result | xarray.Dataset, angle: float = 0.0, through: Point | None = None) -> Figure:
    """Draw pressure and worn depth in a section of the contact, for several cycles of wear."""
    dataset = dataset_of(result)
    if "wear_cycles" not in dataset or "worn_depth" not in dataset:
        raise NotInResult("the surfaces do not wear; a deck with [wear] is needed")
    kept = np.isfinite(dataset["worn_depth"].values).any(axis=(1, 2))
    steps = np.flatnonzero((dataset["wear_cycles"].values >= 0.0) & kept)
    if not steps.size:
        raise NotInResult("no fields of cycles that wear the surfaces were kept")
    deepest = dataset["max_worn_depth"].values[steps]
    wanted = np.linspace(0.0, deepest[-1], min(_CURVES, steps.size))
    places = np.unique(np.abs(deepest[:, None] - wanted).argmin(axis=0))
    views = [StepView.of(result, int(dataset["step"].values[step])) for step in steps[places]]
    cut = Cut.of(views, angle, through)

    canvas = new_figure(5.6, 5.0)
    above, below = canvas.subplots(2, 1, sharex=True)
    colors = shades(len(views))
    depths = [cut.values(view, view.data["worn_depth"].values) for view in views]
    pressures = [cut.values(view) for view in views]
    to_stress, stress = scaled(float(max(values.max() for values in pressures)), "Pa")
    to_depth, depth = scaled(float(max(values.max() for values in depths)), "m")
    for color, pressure, worn in zip(colors, pressures, depths, strict=True):
        above.plot(cut.along(cut.place), pressure * to_stress, color=color)
        below.plot(cut.along(cut.place), worn * to_depth, color=color)
    above.set(ylabel=f"pressure ({stress})", ylim=(0.0, None))
    below.set(ylabel=f"worn depth ({depth})")
    cut.show(below)
    below.invert_yaxis()
    labels = [f"{float(view.data['wear_cycles']):,.0f}".replace(",", "\u2009") for view in views]
    color_scale(canvas, [above, below], labels, colors)
    canvas.axes[-1].set_title("cycles", fontsize=9)
    set_title(canvas, title_of(dataset))
    return canvas
