"""Draw the signs of rolling for `make.py`."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Rectangle

from hexcontact.plotting.registry import styled
from hexcontact.plotting.style import COMPUTED, EXACT, GUIDE, THIRD, new_figure


@styled
def rolling_signs() -> Figure:
    """Draw velocities and the creep force from the side, and creepages in the plane of the contact."""
    canvas = new_figure(7.0, 2.9)
    side, plane = canvas.subplots(1, 2)
    for axes in (side, plane):
        axes.set(aspect="equal", xlim=(-2.1, 2.1), ylim=(-1.6, 1.6))
        axes.axis("off")
    _side(side)
    _plane(plane)
    return canvas


def _arrow(
    axes: Axes, start: tuple[float, float], by: tuple[float, float], text: str, color: str, **look: float
) -> None:
    """Draw an arrow with a text at its end."""
    end = start[0] + by[0], start[1] + by[1]
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.4})
    place = end[0] + look.get("dx", 0.0), end[1] + look.get("dy", 0.0)
    axes.text(*place, text, color=color, ha="center", va="center")


def _side(axes: Axes) -> None:
    axes.add_patch(Circle((0.0, 1.15), 1.15, fc="0.93", ec=GUIDE))
    axes.add_patch(Rectangle((-2.0, -0.8), 4.0, 0.8, fc="0.93", ec=GUIDE))
    axes.text(0.0, 1.3, "body 2", ha="center")
    axes.text(-1.4, -0.65, "body 1", ha="center")
    _arrow(axes, (-1.95, 0.75), (0.55, 0.0), r"contact, $V$", GUIDE, dx=-0.2, dy=0.25)
    _arrow(axes, (0.9, 0.16), (-0.7, 0.0), r"$v_2$", EXACT, dx=0.95, dy=0.12)
    _arrow(axes, (0.9, -0.16), (-0.9, 0.0), r"$v_1$", COMPUTED, dx=1.15)
    _arrow(axes, (-0.45, -0.5), (0.7, 0.0), r"$Q_x$ on body 1", THIRD, dx=0.75)
    _arrow(axes, (1.55, 0.9), (0.4, 0.0), "x", "0.2", dx=0.12)
    _arrow(axes, (1.55, 0.9), (0.0, -0.4), "z", "0.2", dy=-0.14)
    axes.text(0.0, -1.25, r"$\xi=(v_1-v_2)/V<0$:  $Q_x>0$", ha="center")


def _plane(axes: Axes) -> None:
    axes.add_patch(Circle((0.0, 0.0), 0.95, fc="0.93", ec=GUIDE))
    axes.text(-0.85, 1.15, "rear", ha="center")
    axes.text(0.95, 1.15, "front", ha="center")
    _arrow(axes, (1.1, 0.0), (0.7, 0.0), "V", GUIDE, dx=0.15)
    _arrow(axes, (0.0, 0.0), (0.6, 0.0), r"$\xi$", COMPUTED, dx=0.0, dy=-0.2)
    _arrow(axes, (0.0, 0.0), (0.0, 0.6), r"$\eta$", COMPUTED, dx=0.2)
    axes.add_patch(Arc((0.0, 0.0), 0.8, 0.8, theta1=120, theta2=250, color=COMPUTED, lw=1.4))
    _arrow(axes, (-0.2, -0.35), (0.12, -0.05), r"$\phi$", COMPUTED, dx=-0.35, dy=-0.2)
    _arrow(axes, (-1.9, -1.2), (0.5, 0.0), "x", "0.2", dx=0.12)
    _arrow(axes, (-1.9, -1.2), (0.0, 0.5), "y", "0.2", dx=0.15)
    axes.text(0.35, -1.25, "body 1 less body 2", ha="center")


FIGURES = {"rolling_signs": rolling_signs}
