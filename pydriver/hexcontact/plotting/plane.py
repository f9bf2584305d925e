"""Maps of the plane: their limits, panels side by side, outlines and arrows."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..analytic.shear import ClosedForms, PartialSlip
from ..arrays import Array
from ..errors import DeckError
from ..result.result import Result
from ..result.view import Results, StepView, as_list, dataset_of, title_of
from ..text import scaled
from .style import EXACT, drawing

Limits = tuple[float, float, float, float]

ARROWS, FEWER_ARROWS = 13, 9  # across the contact, about, in a large and in a small picture
_WIDTH = 7.2  # inches of a picture with several panels, or of an elongated contact
_HIGH = 4.5  # inches of a map of an upright contact among others
_THIN, _LEAST_ASPECT = 1.0 / 15.0, 1.0 / 7.0  # of maps that are stretched across, and what they become
_ROWS = 5  # maps of a wide contact in one column


@dataclass(frozen=True)
class Part:
    """Select a rectangle of the plane that maps show, with its unit of length."""

    limits: Limits  # x_min, x_max, y_min, y_max, m
    factor: float  # from m to the unit
    unit: str

    @classmethod
    def around(cls, views: Iterable[StepView], margin: float = 1.25, least_aspect: float = 0.0) -> Part:
        """Return the part around the contact of some steps, or around their windows if none has contact.

        Height over width and width over height are at least `least_aspect`.
        """
        known = [(view.contact.any(), view.window(margin), view.spacing) for view in views]
        touching = [entry for entry in known if entry[0]]
        _, windows, spacings = zip(*(touching or known), strict=True)
        limits = np.array(windows)
        x_min, _, y_min, _ = limits.min(axis=0)
        _, x_max, _, y_max = limits.max(axis=0)
        more_x = max(0.5 * (least_aspect * (y_max - y_min) - (x_max - x_min)), 0.0)
        more_y = max(0.5 * (least_aspect * (x_max - x_min) - (y_max - y_min)), 0.0)
        shown = [float(v) for v in (x_min - more_x, x_max + more_x, y_min - more_y, y_max + more_y)]
        factor, unit = scaled(max(abs(shown[0]), abs(shown[1]), spacings[0]), "m")
        return cls((shown[0], shown[1], shown[2], shown[3]), factor, unit)

    @property
    def width(self) -> float:
        """Width, m."""
        return self.limits[1] - self.limits[0]

    @property
    def stretch(self) -> int:
        """How often a length across a very elongated contact is as long in the picture as one along it."""
        aspect = (self.limits[3] - self.limits[2]) / self.width
        aspect = min(aspect, 1.0 / aspect)
        return max(round(_LEAST_ASPECT / aspect), 1) if aspect < _THIN else 1

    @property
    def aspect(self) -> float:
        """Height over width in the picture."""
        aspect = (self.limits[3] - self.limits[2]) / self.width
        return aspect * self.stretch if aspect < 1.0 else aspect / self.stretch

    @property
    def is_wide(self) -> bool:
        """Whether it is more than twice as wide as high."""
        return self.aspect < 0.5

    @property
    def is_tall(self) -> bool:
        """Whether it is more than twice as high as wide."""
        return self.aspect > 2.0

    def size(self) -> tuple[float, float]:
        """Return width and height (inches) of a figure with one map; a wide one has its color bar below."""
        if self.is_wide:
            return _WIDTH, 6.4 * self.aspect + 1.9
        if self.is_tall:
            return 6.0 / self.aspect + 1.9, 7.2
        return 4.6, 3.4 * self.aspect + 0.9

    def show(self, axes: Axes) -> None:
        """Set limits and labels of axes to this part."""
        x_min, x_max, y_min, y_max = (self.factor * limit for limit in self.limits)
        times = self.stretch if self.is_wide else 1.0 / self.stretch
        axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect=times)
        note = f"\nscale × {self.stretch}" * (self.stretch > 1)
        axes.set(
            xlabel=f"x ({self.unit}){note * self.is_tall}", ylabel=f"y ({self.unit}){note * self.is_wide}"
        )
        if self.stretch > 1:
            axes.locator_params(axis="y" if self.is_wide else "x", nbins=4)
        if self.is_tall:
            axes.locator_params(axis="x", nbins=2)

    def outline(
        self, axes: Axes, ellipse: Any, center: tuple[float, float], ratio: float = 1.0, **style: Any
    ) -> None:
        """Draw an ellipse (semi_major, semi_minor, angle), scaled by a ratio."""
        turn = np.linspace(0.0, 2.0 * np.pi, 361)
        along, across = ratio * ellipse.semi_major * np.cos(turn), ratio * ellipse.semi_minor * np.sin(turn)
        cosine, sine = np.cos(ellipse.angle), np.sin(ellipse.angle)
        x, y = center[0] + along * cosine - across * sine, center[1] + along * sine + across * cosine
        look = {"color": EXACT, "linestyle": "--", "zorder": 4, **style}
        axes.plot(x * self.factor, y * self.factor, **look)

    def arrows(
        self, axes: Axes, view: StepView, vector: tuple[Array, Array], color: str, many: int = ARROWS
    ) -> None:
        """Draw a vector field at some nodes in contact; the longest arrow reaches the next one."""
        size = np.hypot(*vector)
        if not size.max() > 0.0:
            return
        width = max(np.ptp(view.x[view.contact]), np.ptp(view.y[view.contact]))
        stride = max(1, round(float(width) / view.spacing / many))
        at = np.zeros_like(view.contact)
        row, col = np.indices(at.shape)
        away = np.hypot(view.x - view.center[0], view.y - view.center[1])
        middle = np.unravel_index(np.argmin(away), at.shape)
        at[((row - middle[0]) % stride == 0) & ((col - middle[1]) % stride == 0)] = True
        at &= view.contact & (size > 0.02 * size.max())
        longest = float(size[at].max()) if at.any() else 1.0
        axes.quiver(
            view.x[at] * self.factor,
            view.y[at] * self.factor,
            vector[0][at],
            vector[1][at],
            angles="xy",
            scale_units="xy",
            scale=longest / (0.95 * stride * view.spacing * self.factor),
            pivot="mid",
            width=0.0045,
            color=color,
            edgecolor="white" if color == "black" else "black",
            linewidth=0.3,
            zorder=5,
        )


# --- steps of results side by side ----------------------------------------------------------------


def step_label(view: StepView) -> str:
    """Return the label of a step: its number and tangential load over mu P."""
    bound = view.friction * float(view.data["normal_load"])
    load = view.tangential_load
    if not 0.0 < bound < np.inf or abs(load) < 1e-6 * bound:
        return f"step {view.number}"
    return f"step {view.number}, $Q/\\mu P$ = {load / bound:.2f}".replace("-", "−")


def views_of(
    results: Results, steps: int | Sequence[int], source: str | None = None
) -> tuple[list[StepView], list[str], str]:
    """Return views of steps of one or several results, a label for each, and the title of the figure."""
    several = as_list(results)
    chosen = [steps] if isinstance(steps, int) else list(steps)
    views = [StepView.of(result, step, source) for result in several for step in chosen]
    titles = [title_of(dataset_of(result)) for result in several]
    if len(set(titles)) < len(titles) and all(getattr(result, "path", "") for result in several):
        titles = [Path(cast("Result", result).path).stem for result in several]
    if len(several) == 1:
        return views, [step_label(view) for view in views], views[0].title if len(views) == 1 else titles[0]
    labels = [
        "\n".join([*textwrap.wrap(title, 38), *([step_label(view)] if len(chosen) > 1 else [])])
        for view, title in zip(views, np.repeat(titles, len(chosen)).tolist(), strict=True)
    ]
    return views, labels, ""


def closed_solutions(results: Results, views: Sequence[StepView]) -> list[PartialSlip | None]:
    """Return the closed solution of each view; the views of a result are in sequence."""
    closed = [ClosedForms(dataset_of(one)) for one in as_list(results)]
    each = len(views) // len(closed)
    return [closed[k // each].partial_slip(view.number) for k, view in enumerate(views)]


def map_panels(part: Part, labels: Sequence[str], ax: Axes | None = None) -> tuple[Figure, list[Axes]]:
    """Return a figure with a map for each label, several with the label as title; `ax` takes one map."""
    if part.is_tall:
        labels = [label.replace(", ", "\n") for label in labels]
    count, lines = len(labels), 1 + max(label.count("\n") for label in labels)
    if ax is not None and count > 1:
        raise DeckError(f"ax holds the map of one load step, not of {count}")
    if count == 1:
        figure, axes = drawing(ax, *part.size())
        part.show(axes)
        return figure, [axes]
    columns = min(count, 4 if count > 6 or count == 4 else 3)
    if part.is_wide:
        columns = 1 if count <= _ROWS else 2
    elif part.is_tall:
        columns = min(count, int(_WIDTH / max(_HIGH / part.aspect + 0.4, 1.7)))
    rows = -(-count // columns)
    cell = _WIDTH / (columns if part.is_wide else max(columns, 2))
    most = _HIGH if part.is_tall else 3.5
    height = rows * (float(np.clip((cell - 0.2) * part.aspect, 0.6, most)) + 0.17 * lines + 0.24) + 0.95
    figure = Figure(figsize=(cell * columns + 0.6, height), layout="compressed")
    cast(Any, figure.get_layout_engine()).set(h_pad=0.1)  # between a title and the panel above
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[count:]:
        axes.set_visible(False)
    for number, (axes, label) in enumerate(zip(panels.flat, labels, strict=False)):
        part.show(axes)
        axes.set_title(label)
        if number + columns < count:  # axis labels only at the lower and left panels
            axes.set_xlabel("")
        else:
            axes.tick_params(labelbottom=True)
        if number % columns:
            axes.set_ylabel("")
    return figure, list(panels.flat[:count])
