"""Quantities of the cases of a study over one of its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import Dataset
from ..errors import DeckError
from ..result.view import last_steps, parameters_of
from ..text import quantity, scaled
from ..variables import SUMMARY, VARIABLES, spelled
from .registry import figure
from .style import COMPUTED, color_scale, legend_under, new_panels, set_title, shades, titled

_LEGEND = 8  # curves, more of which get a scale of colors


def _spelled(name: str) -> str:
    return spelled(name.removesuffix("_fit")) if name in VARIABLES else name


def _scale(study: Dataset, name: str) -> tuple[float, str]:
    """Return factor and unit for an axis with a quantity."""
    values = np.abs(study[name].values.astype(float))
    largest = float(np.max(values[np.isfinite(values)], initial=0.0))
    return scaled(largest, str(study[name].attrs.get("units", "1")).removesuffix("1"))


def _varying(study: Dataset) -> list[str]:
    """Return the quantities of a summary that differ between the cases."""
    found = []
    for name in ("approach", *SUMMARY):
        values = study[name].values if name in study else np.array([])
        finite = values[np.isfinite(values)]
        if finite.size and np.ptp(finite) > 1e-6 * np.abs(finite).max():
            found.append(name)
    return found


@figure("study", "quantities of the cases over a parameter", needs="a study")
def study(study: Dataset, quantities: Sequence[str] | None = None, over: str = "") -> Figure:
    """Draw quantities of the last load step over a parameter of a study.

    Parameters
    ----------
    study : xarray.Dataset
        The result of a study.
    quantities : sequence of str, optional
        Names of quantities, one for each panel; by default those of a summary that vary.
    over : str
        Parameter on the horizontal axis; by default the one with the most values.

    Raises
    ------
    DeckError
        If there is no such name, or no case is done.
    """
    study = last_steps(study)
    numbers = [n for n in parameters_of(study) if study[n].dtype.kind in "fi" and study[n].ndim == 1]
    if not numbers or (over and over not in numbers):
        expected = f"expected {' or '.join(numbers)}" if numbers else "none of its parameters is a number"
        raise DeckError(f"over = {over!r}: {expected}")
    over = over or max(numbers, key=lambda name: study[name].size)
    names = _varying(study) if quantities is None else list(quantities)
    if unknown := [name for name in names if name not in study.data_vars]:
        raise DeckError(f"{unknown[0]} is no quantity of this study")
    if not names:
        raise DeckError("no quantity differs between its cases; are any done?")
    [along] = study[over].dims
    others = [dim for dim in study["status"].dims if dim != along]
    curves = study.stack(curve=others) if others else study.expand_dims("curve")
    labels = [_label(study, others, place) for place in curves["curve"].values] if others else [""]
    canvas, panels = new_panels(len(names), min(len(names), 2), 3.4, 2.1, 0.5)
    colors = shades(len(labels)) if others else [COMPUTED]
    for axes, name in zip(panels, names, strict=True):
        _draw(axes, curves, name, over, labels, colors, joined=along != "case")
    if 1 < len(labels) <= _LEGEND:
        legend_under(canvas, panels[0].get_lines())
    elif others:
        color_scale(canvas, panels, labels, colors)
    set_title(canvas, str(study.attrs.get("title", "")))
    return canvas


def _draw(
    axes: Axes,
    curves: Dataset,
    name: str,
    over: str,
    labels: Sequence[str],
    colors: Sequence[object],
    joined: bool,
) -> None:
    """Draw a quantity; cases that are not on a grid are points."""
    (along, length), (factor, unit) = _scale(curves, over), _scale(curves, name)
    place = curves[over].values * along
    order = np.argsort(place)
    for k, label in enumerate(labels):
        values = curves[name].isel(curve=k).values * factor
        style: dict[str, Any] = {"ls": "-" if joined else "", "marker": "o", "ms": 3, "color": colors[k]}
        axes.plot(place[order], values[order], label=label, **style)
    axes.set(xlabel=titled(_spelled(over), length), ylabel=titled(_spelled(name), unit))
    axes.grid(color="0.9", lw=0.5)


def _label(study: Dataset, dims: Sequence[object], place: object) -> str:
    """Return the values of the other parameters of a curve."""
    values = place if isinstance(place, tuple) else (place,)
    words = []
    for dim, value in zip(dims, values, strict=True):
        unit = str(study[dim].attrs.get("units", "1")).removesuffix("1")
        text = value if isinstance(value, str) else quantity(float(value), unit) if unit else f"{value:g}"
        words.append(f"{dim} {text}")
    return ", ".join(words)
