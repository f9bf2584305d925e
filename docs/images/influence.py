"""Draw the influence functions for `make.py`: pyramid (5.6), elements (5.2, 5.5), load shapes (7.3, 7.4)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hexcontact.arrays import Array
from hexcontact.core import flat
from hexcontact.influence import linear_load_displacement, pyramid_functions
from hexcontact.plotting.registry import styled
from hexcontact.plotting.style import COMPUTED, EXACT, GUIDE, THIRD, new_figure

Shape = Callable[[Array, Array], Array]

HEIGHT = np.sqrt(0.75)  # of the equilateral triangle with side 1; also the cell area and the pyramid's volume
_HEXAGON = np.pi / 3 * np.arange(7)

# load (row) and displacement (column) of the nine functions of Table 8.1
_TABLE_8_1 = (
    (("$C$: $u_z = a\\,C\\,p$", "$D$: $u_x = -b\\,D\\,p$", "$E$: $u_y = -b\\,E\\,p$"), "normal load $p$"),
    (("$F$: $u_z = b\\,F\\,q_x$", "$G$: $u_x = a\\,G\\,q_x$", "$H$: $u_y = c\\,H\\,q_x$"), "shear $q_x$"),
    (("$I$: $u_z = b\\,I\\,q_y$", "$J$: $u_x = c\\,J\\,q_y$", "$K$: $u_y = a\\,K\\,q_y$"), "shear $q_y$"),
)


@styled
def pyramid_displacements(poisson_ratio: float = 0.3) -> Figure:
    """Draw the nine functions C ... K of Table 8.1, the displacements of unit pyramid loads (Figure 5.6)."""
    fine = np.linspace(-2.2, 2.2, 221)
    x, y = np.meshgrid(fine, fine)
    functions = iter(pyramid_functions(x, y, poisson_ratio))
    canvas = new_figure(7.2, 6.9)
    panels = canvas.subplots(3, 3, sharex=True, sharey=True)
    for row, (names, load) in enumerate(_TABLE_8_1):
        for column, name in enumerate(names):
            axes = panels[row, column]
            _map(canvas, axes, x, y, next(functions))
            axes.set_title(name)
            if row == 2:
                axes.set_xlabel("$x/l_e$")
        panels[row, 0].set_ylabel(f"{load}\n$y/l_e$")
    canvas.suptitle(
        f"Surface displacements of the unit pyramid, Table 8.1 (spacing 1, $\\nu$ = {poisson_ratio:g})"
    )
    return canvas


def _map(canvas: Figure, axes: Axes, x: Array, y: Array, value: Array) -> None:
    """Draw filled contours, for a function of both signs with a diverging map that is white at 0."""
    top = float(np.abs(value).max())
    signed = float(value.min()) < -0.05 * top
    levels = np.linspace(-top, top, 22) if signed else np.linspace(0.0, top, 22)
    colors = "PuOr_r" if signed else "viridis"
    drawn = axes.contourf(x, y, value, levels=levels, cmap=colors)
    axes.contour(x, y, value, levels=levels[1:-1:2], colors="black", linewidths=0.25, linestyles="solid")
    axes.plot(np.cos(_HEXAGON), np.sin(_HEXAGON), color="black" if signed else "white", lw=0.8)
    axes.set_aspect("equal")
    bar = canvas.colorbar(drawn, cax=axes.inset_axes((1.04, 0.0, 0.05, 1.0)))  # as high as the map
    bar.locator = matplotlib.ticker.MaxNLocator(5)
    bar.update_ticks()
    bar.ax.tick_params(labelsize=7)


# --- elements -------------------------------------------------------------------------------------


_LABEL = {"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}
_HALF = (1, 2, 6)  # elements of Figure 5.5; their mirror images complete the pyramid


def _element(number: int) -> Array:
    """Return the corners of a tetrahedral element, the loaded one first; element 1 is about +y."""
    start = np.pi / 3 * number
    angles = np.array([start, start + np.pi / 3])
    return np.vstack([np.zeros(2), np.stack([np.cos(angles), np.sin(angles)], axis=1)])


@styled
def load_elements(poisson_ratio: float = 0.3) -> Figure:
    """Draw a tetrahedral element, pyramids of six (Figures 4.5, 5.2, 5.4, 5.5), displacements by elements."""
    canvas = new_figure(9.6, 4.5)
    solid = (True, False, True, True, False, False, False, False)
    panels = [canvas.add_subplot(2, 4, k + 1, projection="3d" if solid[k] else None) for k in range(8)]
    everything = (1, 2, 3, 4, 5, 6)
    _draw_solid(panels[0], (1,), "")
    panels[1].plot([0.0, HEIGHT], [1.0, 0.0], color=COMPUTED)
    panels[1].set(xlabel="$\\eta/l_e$", ylabel="load", xlim=(-0.1, 1.0), ylim=(0.0, 1.1), box_aspect=0.8)
    _draw_solid(panels[2], everything, "")
    _draw_solid(panels[3], everything, "x")
    titles = (
        "tetrahedron 1 (4.5a, 5.2a)",
        "its profile (5.2b)",
        "pyramid of $p$ (4.5b, 5.4)",
        "pyramid of $q_x$ (5.5)",
    )
    for letter, axes, title in zip("abcd", panels, titles, strict=False):
        axes.set_title(f"({letter}) {title}")
    fine = np.linspace(-1.6, 1.6, 161)
    x, y = np.meshgrid(fine, fine)
    loads = ((1, 2, "$u_z$ of $p$ on 1"), *((number, 0, f"$u_x$ of $q_x$ on {number}") for number in _HALF))
    for letter, axes, (number, component, title) in zip("efgh", panels[4:], loads, strict=True):
        corners, traction = _element(number), np.zeros((3, 3))
        traction[0, component] = 1.0
        moved = linear_load_displacement(
            corners, x, y, traction, shear_modulus=1.0, poisson_ratio=poisson_ratio
        )
        _map(canvas, axes, x, y, 2 * np.pi / (1 - poisson_ratio) * moved[component])
        axes.plot(*np.vstack([corners, corners[:1]]).T, color="white", lw=1.0)
        axes.set(title=f"({letter}) {title}", xlabel="$x/l_e$")
    panels[4].set_ylabel("$y/l_e$")
    canvas.suptitle(
        f"Elements of side $l_e$ and height 1; $2\\pi G u/((1-\\nu)\\,l_e)$ for $\\nu$ = {poisson_ratio:g}"
    )
    return canvas


def _draw_solid(axes: Any, numbers: tuple[int, ...], along: str) -> None:
    """Draw tetrahedra over their bases, with their numbers, and arrows along x if they are shear."""
    for number in numbers:
        corners = _element(number)
        foot = np.column_stack([corners, np.zeros(3)])
        top = foot + np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        axes.plot_trisurf(*top.T, triangles=[[0, 1, 2]], color=COMPUTED, alpha=0.35, lw=0.8, edgecolor="0.2")
        axes.plot(*np.vstack([foot, foot[:1]]).T, color="0.4", lw=0.6, ls="--")
        middle = corners.mean(axis=0)
        axes.text(*(1.5 * middle), 0.0, str(number), ha="center", va="center", fontsize=7, bbox=_LABEL)
        if along:
            axes.quiver(*middle, 1 / 3, 0.35, 0.0, 0.0, color=EXACT, lw=1.2, arrow_length_ratio=0.4)
        else:
            axes.quiver(*middle, 0.75, 0.0, 0.0, -0.4, color=EXACT, lw=1.2, arrow_length_ratio=0.35)
    axes.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0), zlim=(0.0, 1.0), xticks=[], yticks=[], zticks=[])
    axes.set_box_aspect((2.0, 2.0, 1.0), zoom=1.5)
    axes.view_init(elev=32.0, azim=-70.0)
    axes.set_xlabel("x", labelpad=-14)
    axes.set_ylabel("y", labelpad=-14)


# --- load shapes ----------------------------------------------------------------------------------


@styled
def load_models(nodes: int = 9) -> Figure:
    """Draw a surface load in two dimensions (Figure 7.3) and overlapping triangles (Figure 7.4)."""
    canvas = new_figure(7.6, 4.6)
    panels = canvas.subplots(2, 2, sharex=True, sharey=True).ravel()
    fine = np.linspace(-1.0, 1.0, 801)
    place = np.linspace(-1.0, 1.0, nodes + 2)
    height, step = np.sqrt(np.maximum(1.0 - place**2, 0.0)), place[1] - place[0]
    for axes in panels:
        axes.plot(fine, np.sqrt(1 - fine**2), color=GUIDE, lw=1.0)
    for x, p in zip(place[1:-1], height[1:-1], strict=True):
        panels[0].annotate("", (x, 0.0), (x, p), arrowprops={"arrowstyle": "->", "color": EXACT})
        panels[3].plot([x - step, x, x + step], [0.0, p, 0.0], color=THIRD, lw=0.8)
    panels[1].stairs(height[1:-1], place[1:] - 0.5 * step, color=THIRD, fill=True, alpha=0.5)
    panels[2].fill_between(place, height, color=COMPUTED, alpha=0.4, lw=0.0)
    panels[2].plot(place, height, color=COMPUTED)
    panels[3].plot(place, height, color=COMPUTED)
    sums = step * height.sum() / (np.pi / 2) - 1.0
    titles = (
        "(a) forces $a\\,p_i$ (7.3a)",
        "(b) constant between nodes (7.3b)",
        "(c) continuous, and smooth in gray (7.3c, d)",
        f"(d) overlapping triangles and their sum (7.4)\narea by (7.2): {-100 * sums:.1f} % too small",
    )
    for axes, title in zip(panels, titles, strict=True):
        axes.set(title=title, xlim=(-1.15, 1.15), ylim=(0.0, 1.1))
    for axes in panels[2:]:
        axes.set_xlabel("x / half-width")
    for axes in panels[::2]:
        axes.set_ylabel("$p/p_0$")
    return canvas


LOOKS: dict[str, dict[str, Any]] = {
    "point force": {"color": EXACT, "ls": ":"},
    "constant on the cell": {"color": THIRD, "ls": "--"},
    "pyramid": {"color": COMPUTED, "ls": "-"},
}
"""Line styles of the shapes of a nodal load, in the order of the core."""


@styled
def load_shapes(nodes_in_radius: int = 10) -> Figure:
    """Compare a point force, a constant load on the hexagonal cell and the pyramid (Figure 7.3).

    The Hertz contact in the panels (b) and (c) has `nodes_in_radius` spacings in its radius.
    """
    a = nodes_in_radius
    canvas = new_figure(7.2, 5.6)
    (one, pressure), (error, convergence) = canvas.subplots(2, 2)
    _draw_one_load(one)
    _draw_pressures(pressure, a)
    _draw_errors(error, a)
    _draw_convergence(convergence)
    for letter, axes in zip("abcd", (one, pressure, error, convergence), strict=True):
        axes.set_title(f"({letter}) {axes.get_title()}")
    handles = [matplotlib.lines.Line2D([], [], label=name, **look) for name, look in LOOKS.items()]
    canvas.legend(handles=handles, loc="outside lower center", ncols=3)
    return canvas


def _draw_one_load(axes: Axes) -> None:
    x = np.linspace(-2.5, 2.5, 501)
    for number, look in enumerate(LOOKS.values(), start=1):
        axes.plot(x, flat.load_potential(number, x, 0.0), **look)
    axes.set(title="displacement of one load", xlabel="$x/l_e$", ylabel="$\\pi E^* u_z / (p\\, l_e)$")
    axes.set(xlim=(-2.5, 2.5), ylim=(0.0, 4.5))


def _draw_pressures(axes: Axes, a: int) -> None:
    nodes = np.arange(-a, a + 1) / a
    fine = np.linspace(-1.0, 1.0, 801)
    axes.plot(fine, np.sqrt(1 - fine**2), color=GUIDE, lw=2.5, zorder=0)
    axes.annotate("Hertz", (0.97, 0.45), color="0.35")
    p = np.sqrt(np.maximum(1 - nodes**2, 0.0))
    axes.vlines(nodes, 0.0, p, color=EXACT, ls=":", lw=1.0)
    edges = np.concatenate([nodes - 0.5 / a, [nodes[-1] + 0.5 / a]])
    axes.stairs(p, edges, color=THIRD, ls="--", baseline=None)
    axes.plot(nodes, p, color=COMPUTED, lw=1.1)
    axes.set(title=f"nodal pressures, $a/l_e$ = {a}", xlabel="$x/a$", ylabel="$p/p_0$", xlim=(0.0, 1.2))
    axes.set_ylim(0.0, 1.08)


def _draw_errors(axes: Axes, a: int) -> None:
    x = np.linspace(0.0, 0.9, 721)
    for number, (name, look) in enumerate(LOOKS.items(), start=1):
        error = 100 * flat.displacement_errors(number, a, x * a, 0.0)
        infinite = name == "point force"  # at each node: behind the others, and thin
        lw = 0.7 if infinite else matplotlib.rcParams["lines.linewidth"]
        axes.plot(x, error, **look, zorder=2 - infinite, lw=lw)
    axes.axhline(0.0, color=GUIDE, lw=0.6, zorder=0)
    axes.set(title="error of $u_z$ inside the contact", xlabel="$x/a$", ylabel="error (% of the approach)")
    axes.set(xlim=(0.0, 0.9), ylim=(-0.25, 0.25))


def _draw_convergence(axes: Axes) -> None:
    meshes = np.array([5, 10, 20, 40])
    errors = 100 * np.array([flat.pressure_errors(float(mesh)) for mesh in meshes])
    for column, name in enumerate(("constant on the cell", "pyramid")):
        axes.loglog(meshes, errors[:, column], marker="o", ms=3, **LOOKS[name])
        order = -np.polyfit(np.log(meshes), np.log(errors[:, column]), 1)[0]
        axes.annotate(
            f"order {order:.1f}", (meshes[1], errors[1, column]), (4, 4), textcoords="offset points"
        )
    axes.set(title="error of $p$ for $r < 0.8a$", xlabel="$a/l_e$", ylabel="error (% of $p_0$)")
    axes.set_xticks(meshes, [str(mesh) for mesh in meshes])
    axes.minorticks_off()
    axes.grid(color="0.9", lw=0.5)


FIGURES: dict[str, Callable[[], Figure]] = {
    "pyramid": pyramid_displacements,
    "elements": load_elements,
    "load_models": load_models,
    "load_shapes": load_shapes,
}
"""The figures by the names of their pictures."""
