"""Maps of the plane: which part they show, panels side by side, outlines and arrows."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..result.view import StepView, as_list, dataset_of, scaled, title_of
from .style import EXACT, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..result.result import Result
    from ..result.view import Results

Array = NDArray[np.float64]
Limits = tuple[float, float, float, float]

ARROWS, FEWER_ARROWS = 13, 9  # about, across the contact, in a large and a small picture
_WIDTH = 7.2  # inches of a picture with several panels


@dataclass(frozen=True)
class Part:
    """A rectangle of the plane that maps show, in a unit of length that suits it.

    Attributes
    ----------
    limits : tuple of float
        x_min, x_max, y_min, y_max, m.
    factor : float
        What turns meters into the unit.
    unit : str
        The unit.
    """

    limits: Limits
    factor: float
    unit: str

    @classmethod
    def around(cls, views: Iterable[StepView], margin: float = 1.25, least_aspect: float = 0.0) -> Part:
        """Return the part with the contact of some steps, at least so wide for its height, and so high.

        Steps without contact have no say, unless there are no others: then it is the whole window.
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
    def aspect(self) -> float:
        """Height over width."""
        return (self.limits[3] - self.limits[2]) / self.width

    def show(self, axes: Axes) -> None:
        """Let axes show this part, and nothing else."""
        x_min, x_max, y_min, y_max = (self.factor * limit for limit in self.limits)
        axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal")
        axes.set(xlabel=f"x ({self.unit})", ylabel=f"y ({self.unit})")

    def outline(
        self, axes: Axes, ellipse: Any, center: tuple[float, float], ratio: float = 1.0, **style: Any
    ) -> None:
        """Draw the ellipse with the attributes semi_major, semi_minor and angle, reduced by a ratio."""
        turn = np.linspace(0.0, 2.0 * np.pi, 361)
        along, across = ratio * ellipse.semi_major * np.cos(turn), ratio * ellipse.semi_minor * np.sin(turn)
        cosine, sine = np.cos(ellipse.angle), np.sin(ellipse.angle)
        x, y = center[0] + along * cosine - across * sine, center[1] + along * sine + across * cosine
        look = {"color": EXACT, "linestyle": "--", "zorder": 4, **style}
        axes.plot(x * self.factor, y * self.factor, **look)

    def arrows(
        self, axes: Axes, view: StepView, vector: tuple[Array, Array], color: str, many: int = ARROWS
    ) -> None:
        """Draw a vector field at some nodes in contact; the longest arrow just reaches the next one."""
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
    """Name a step among others of the same result: its number and how far the shear has come."""
    bound = view.friction * float(view.data["normal_load"])
    load = view.tangential_load
    if not 0.0 < bound < np.inf or abs(load) < 1e-6 * bound:
        return f"step {view.number}"
    return f"step {view.number}, $Q/\\mu P$ = {load / bound:.2f}".replace("-", "−")


def views_of(results: Results, steps: int | Sequence[int]) -> tuple[list[StepView], list[str], str]:
    """Look at steps of one or several results: the views, a label for each, and the title of the picture."""
    several = as_list(results)
    chosen = [steps] if isinstance(steps, int) else list(steps)
    views = [StepView.of(result, step) for result in several for step in chosen]
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


def map_panels(part: Part, labels: Sequence[str]) -> tuple[Figure, list[Axes]]:
    """Return a figure with a map for each label, which stands above it if there are several."""
    count, lines = len(labels), 1 + max(label.count("\n") for label in labels)
    if count == 1:
        figure = new_figure(4.6, float(np.clip(3.4 * part.aspect, 1.6, 5.5)) + 0.9)
        axes = figure.add_subplot()
        part.show(axes)
        return figure, [axes]
    columns = min(count, 4 if count > 6 or count == 4 else 3 if part.aspect < 2.0 else 4)
    rows = -(-count // columns)
    cell = _WIDTH / max(columns, 2)
    height = rows * (float(np.clip((cell - 0.2) * part.aspect, 0.6, 3.5)) + 0.17 * lines + 0.24) + 0.95
    figure = Figure(figsize=(cell * columns + 0.6, height), layout="compressed")
    cast(Any, figure.get_layout_engine()).set(h_pad=0.1)  # between a title and the panel above
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[count:]:
        axes.set_visible(False)
    for number, (axes, label) in enumerate(zip(panels.flat, labels, strict=False)):
        part.show(axes)
        axes.set_title(label)
        if number + columns < count:  # labels of the axes only where no panel follows below, or stands left
            axes.set_xlabel("")
        else:
            axes.tick_params(labelbottom=True)
        if number % columns:
            axes.set_ylabel("")
    return figure, list(panels.flat[:count])
