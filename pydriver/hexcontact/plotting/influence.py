"""Pictures of the influence functions: the pyramid (Figure 5.6) beside other load shapes (Figure 7.3)."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..analytic import hertz_sphere
from .registry import figure
from .style import COMPUTED, EXACT, GUIDE, THIRD, new_figure

Array = NDArray[np.float64]
Shape = Callable[[Array, Array], Array]

HEIGHT = np.sqrt(0.75)  # of the equilateral triangle with side 1; also the cell area and the pyramid's volume
_HEXAGON = np.pi / 3 * np.arange(7)

# load (row) and displacement (column) of the nine functions of Table 8.1
_TABLE_8_1 = (
    (("$C$: $u_z = a\\,C\\,p$", "$D$: $u_x = -b\\,D\\,p$", "$E$: $u_y = -b\\,E\\,p$"), "normal load $p$"),
    (("$F$: $u_z = b\\,F\\,q_x$", "$G$: $u_x = a\\,G\\,q_x$", "$H$: $u_y = c\\,H\\,q_x$"), "shear $q_x$"),
    (("$I$: $u_z = b\\,I\\,q_y$", "$J$: $u_x = c\\,J\\,q_y$", "$K$: $u_y = a\\,K\\,q_y$"), "shear $q_y$"),
)


@figure("pyramid", "displacements by one pyramid (Figure 5.6)")
def pyramid_displacements(poisson_ratio: float = 0.3) -> Figure:
    """Draw the nine functions C ... K of Table 8.1, the displacements of unit pyramid loads (Figure 5.6).

    Parameters
    ----------
    poisson_ratio : float
        nu of the body; G and K depend on it through nu_0 = nu/(1-nu).

    Returns
    -------
    matplotlib.figure.Figure
    """
    from ..core.influence import pyramid_functions

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
    """Draw filled contours; a function of both signs gets a diverging map that is white at 0."""
    top = float(np.abs(value).max())
    signed = float(value.min()) < -0.05 * top
    levels = np.linspace(-top, top, 22) if signed else np.linspace(0.0, top, 22)
    colors = "PuOr_r" if signed else "viridis"
    drawn = axes.contourf(x, y, value, levels=levels, cmap=colors)
    axes.contour(x, y, value, levels=levels[1:-1:2], colors="black", linewidths=0.25, linestyles="solid")
    axes.plot(np.cos(_HEXAGON), np.sin(_HEXAGON), color="black" if signed else "white", lw=0.8)
    axes.set_aspect("equal")
    bar = canvas.colorbar(drawn, ax=axes, shrink=0.8, pad=0.02)
    bar.locator = matplotlib.ticker.MaxNLocator(5)
    bar.update_ticks()
    bar.ax.tick_params(labelsize=7)


# ----------------------------------------------------------------------------------- load shapes


def point_force(x: Array, y: Array) -> Array:
    """Integral of 1/rho over a point force of the pyramid's volume; infinite at the force."""
    with np.errstate(divide="ignore"):
        return np.asarray(HEIGHT / np.hypot(x, y))


def constant_cell(x: Array, y: Array) -> Array:
    """Integral of 1/rho over the hexagonal cell of a node, under the load 1."""
    from ..core.influence import triangle_integral

    corner = np.exp(1j * (_HEXAGON + np.pi / 6)) / np.sqrt(3.0)
    total = np.zeros(np.broadcast(x, y).shape)
    for first, second in itertools.pairwise(corner):
        triangle = np.array([[0.0, 0.0], [first.real, first.imag], [second.real, second.imag]])
        total += triangle_integral(triangle, x, y, 1, 0, 0)
    return total


def pyramid(x: Array, y: Array) -> Array:
    """Integral of 1/rho over the unit pyramid."""
    from ..core.influence import pyramid_kernels

    return np.asarray(pyramid_kernels(x, y)[0])


SHAPES: dict[str, tuple[Shape, dict[str, Any]]] = {
    "point force": (point_force, {"color": EXACT, "ls": ":"}),
    "constant on the cell": (constant_cell, {"color": THIRD, "ls": "--"}),
    "pyramid": (pyramid, {"color": COMPUTED, "ls": "-"}),
}
"""Ways to spread a nodal pressure, each of volume sqrt(3)/2 (spacing 1), and how each is drawn."""


def hertz_error(shape: Shape, nodes_in_radius: float, x: Array, y: Array) -> Array:
    """Error of the displacement when Hertz's pressure, taken at the nodes, is spread with ``shape``.

    The exact pressure stands at the nodes of a lattice of spacing 1 with a node at the center; inside the
    contact the exact displacement is the paraboloid delta - r^2/(2R).

    Parameters
    ----------
    shape : callable
        One of `SHAPES`.
    nodes_in_radius : float
        a/l_e.
    x, y : ndarray
        Points inside the contact, in spacings.

    Returns
    -------
    ndarray
        (computed - exact)/delta at the points.
    """
    hertz = hertz_sphere(1.0, 1.0, contact_radius=nodes_in_radius)
    reach = int(1.2 * nodes_in_radius) + 2
    row, col = np.mgrid[-reach : reach + 1, -2 * reach : 2 * reach + 1]
    node_x, node_y = col + 0.5 * row, HEIGHT * row
    p = hertz.pressure(np.hypot(node_x, node_y))
    node_x, node_y, p = node_x[p > 0], node_y[p > 0], p[p > 0]
    kernel = shape(x[..., None] - node_x, y[..., None] - node_y)
    computed = kernel @ p / (np.pi * hertz.effective_modulus)
    return np.asarray((computed - (hertz.approach - 0.5 * (x**2 + y**2))) / hertz.approach)


@figure("load-shapes", "pyramid, point force and constant load compared (Figure 7.3)")
def load_shapes(nodes_in_radius: int = 10) -> Figure:
    """Compare a point force, a constant load on the hexagonal cell and the pyramid (Figure 7.3).

    Parameters
    ----------
    nodes_in_radius : int
        a/l_e of the Hertz contact in the panels (b) and (c).

    Returns
    -------
    matplotlib.figure.Figure
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
    handles = [matplotlib.lines.Line2D([], [], label=name, **look) for name, (_, look) in SHAPES.items()]
    canvas.legend(handles=handles, loc="outside lower center", ncols=3)
    return canvas


def _draw_one_load(axes: Axes) -> None:
    x = np.linspace(-2.5, 2.5, 501)
    for shape, look in SHAPES.values():
        axes.plot(x, shape(x, np.zeros_like(x)), **look)
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
    for name, (shape, look) in SHAPES.items():
        error = 100 * hertz_error(shape, a, x * a, np.zeros_like(x))
        axes.plot(x, error, **look, zorder=1 if name == "point force" else 2)
    axes.axhline(0.0, color=GUIDE, lw=0.6, zorder=0)
    axes.set(title="error of $u_z$ inside the contact", xlabel="$x/a$", ylabel="error (% of the approach)")
    axes.set(xlim=(0.0, 0.9), ylim=(-0.25, 0.25))


def interpolation_error(nodes_in_radius: float) -> tuple[float, float]:
    """Largest error of Hertz's pressure for r < 0.8 a when constant cells or pyramids spread it.

    Parameters
    ----------
    nodes_in_radius : float
        a/l_e.

    Returns
    -------
    tuple of float
        Error of the constant cells and of the pyramids, in units of p_0.
    """
    hertz = hertz_sphere(1.0, 1.0, contact_radius=nodes_in_radius)
    step = np.linspace(0.0, 1.0, 17)
    share = np.array([(1 - u - v, u, v) for u in step for v in step if u + v <= 1])  # barycentric
    reach = int(1.2 * nodes_in_radius) + 1
    row, col = np.mgrid[-reach:reach, -2 * reach : 2 * reach]
    corners = [(row, col), (row, col + 1), (row + 1, col)]  # the other triangles are their mirror images
    x = np.stack([c + 0.5 * r for r, c in corners], axis=-1).reshape(-1, 3)
    y = np.stack([HEIGHT * r for r, _ in corners], axis=-1).reshape(-1, 3)
    radius = np.hypot(x @ share.T, y @ share.T)
    inner = radius < 0.8 * nodes_in_radius
    exact = hertz.pressure(radius)
    at_nodes = hertz.pressure(np.hypot(x, y))
    constant = at_nodes[:, share.argmax(axis=1)]  # the nearest corner
    worst = [float(np.abs(p - exact)[inner].max()) for p in (constant, at_nodes @ share.T)]
    return worst[0] / hertz.max_pressure, worst[1] / hertz.max_pressure


def _draw_convergence(axes: Axes) -> None:
    meshes = np.array([5, 10, 20, 40])
    errors = 100 * np.array([interpolation_error(float(mesh)) for mesh in meshes])
    for column, name in enumerate(("constant on the cell", "pyramid")):
        axes.loglog(meshes, errors[:, column], marker="o", ms=3, **SHAPES[name][1])
        order = -np.polyfit(np.log(meshes), np.log(errors[:, column]), 1)[0]
        axes.annotate(
            f"order {order:.1f}", (meshes[1], errors[1, column]), (4, 4), textcoords="offset points"
        )
    axes.set(title="error of $p$ for $r < 0.8a$", xlabel="$a/l_e$", ylabel="error (% of $p_0$)")
    axes.set_xticks(meshes, [str(mesh) for mesh in meshes])
    axes.minorticks_off()
    axes.grid(color="0.9", lw=0.5)
