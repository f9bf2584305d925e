"""Draw the signs of rolling, coefficients of the linear theory and creep curves for `make.py`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
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


sys.path.append(str(Path(__file__).parents[2] / "tests"))
LIMIT = 2.0 * np.pi / 3.0  # load of a circle under p0 = a = 1


@styled
def kalker() -> Figure:
    """Draw coefficients of the linear theory over the ratio of half-axes, beside the printed table."""
    from validation.rolling import NAMES, coefficients, printed

    canvas = new_figure(7.6, 5.6)
    panels = canvas.subplots(2, 2, sharex=True).ravel()
    colors, rows = dict(zip(("0", "0.25", "0.5"), (COMPUTED, EXACT, THIRD), strict=True)), printed()
    for ratio, color in colors.items():
        table = [row for row in rows if row["nu"] == ratio]
        across = [float(row["a/b"]) for row in table]
        found = [coefficients(value, float(ratio)) for value in across]
        for name, axes in zip(NAMES, panels, strict=True):
            axes.plot(across, [each[name] for each in found], color=color, label=rf"$\nu={ratio}$")
            axes.plot(across, [float(row[name]) for row in table], "o", ms=3.5, mfc="none", color=color)
            axes.set(xscale="log", yscale="log", ylabel=f"$C_{{{name[1:]}}}$")
    for axes in panels[2:]:
        axes.set_xlabel("a/b")
    panels[0].legend(frameon=False)
    return canvas


@styled
def creep_curves() -> Figure:
    """Draw creep curves of a circle: along the rolling direction beside two laws, and across with spin."""
    from validation.rolling import Ellipse, coefficients

    canvas = new_figure(7.6, 3.2)
    along, across = canvas.subplots(1, 2, sharey=True)
    circle = Ellipse(1.0, 24, 0.25, 1.0)
    creepage = np.linspace(0.0, 2.0, 41)
    loads = circle.loads([(-value, 0.0, 0.0) for value in creepage]) / LIMIT
    tau = coefficients(1.0, 0.25)["C11"] * creepage / LIMIT
    along.plot(creepage, loads[:, 0], color=COMPUTED, label="computed")
    along.plot(
        creepage, 1.0 - (1.0 - np.minimum(tau / 3.0, 1.0)) ** 3, "--", color=EXACT, label="Johnson, Vermeulen"
    )
    along.plot(creepage, tau, ":", color=GUIDE, label="linear theory")
    along.set(xlabel=r"$-\xi\,G/\mu p_0$", ylabel=r"$Q/\mu P$", xlim=(0.0, 2.0), ylim=(-1.05, 1.05))
    along.legend(frameon=False, loc="lower right")
    lateral = np.linspace(-2.5, 2.5, 51)
    for spin, color in zip((0.0, 1.0, 2.0, 4.0), (COMPUTED, EXACT, THIRD, GUIDE), strict=True):
        loads = circle.loads([(0.0, -value, -spin) for value in lateral]) / LIMIT
        across.plot(lateral, loads[:, 1], color=color, label=f"{spin:g}")
    across.set(xlabel=r"$-\eta\,G/\mu p_0$", xlim=(-2.5, 2.5))
    across.legend(title=r"$-\phi\,aG/\mu p_0$", frameon=False, loc="lower right")
    return canvas


FIGURES = {"rolling_signs": rolling_signs, "kalker": kalker, "creep_curves": creep_curves}
