"""Fields over the plane: pressure, shear traction and slip of one load step, or of several side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import TriMesh
from matplotlib.figure import Figure, FigureBase
from matplotlib.tri import LinearTriInterpolator, Triangulation, UniformTriRefiner

from ..arrays import Array, Mask
from ..core.edges import ZoneMesh
from ..core.interpolation import linear
from ..result.mesh import triangles
from ..result.result import Result
from ..result.view import StepView
from ..text import scaled
from ..variables import MAPS, VARIABLES
from .plane import ARROWS, FEWER_ARROWS, Part, map_panels, views_of
from .registry import figure, styled
from .style import legend_above, set_title

if TYPE_CHECKING:
    import xarray


DRAWN_NODES = 60_000  # above this number, fields are drawn from every second, third, ... node
_VANISH = "dissipation_density", "worn_depth"  # with the pressure at the edge, as tractions do
_DIVIDED = 30_000, 8_000  # triangles up to which each is cut into four, into sixteen
_SO_FAR = "accumulated_slip", "dissipation_density", "worn_depth"  # also where the contact was before
_WITH_ARROWS = 9  # maps in a picture up to which arrows are visible


def mesh_of(view: StepView, values: Array, vanishes: bool) -> ZoneMesh:
    """Return triangles that fill the contact area up to its edge, with a field at their corners.

    Above `DRAWN_NODES` nodes in contact the field is read at every second, third, ... node. Fields like
    tractions vanish at the edge.
    """
    stride = _stride(view.contact)
    return view.edges(stride).contact_mesh(values[::stride, ::stride], vanishes)


def _whole_mesh(view: StepView, values: Array) -> ZoneMesh:
    """Return triangles that fill the contact and all else where a field is not zero."""
    shown = view.contact | (values != 0.0)
    stride = _stride(shown)
    x, y, values, shown = (field[::stride, ::stride] for field in (view.x, view.y, values, shown))
    corners = triangles(*shown.shape).astype(int)
    inside = shown.ravel()[corners].any(axis=1)
    return ZoneMesh(x.ravel(), y.ravel(), values.ravel(), corners[inside])


def _stride(shown: Mask) -> int:
    return int(np.ceil(np.sqrt((1 + int(shown.sum())) / DRAWN_NODES)))


def finer(mesh: ZoneMesh, view: StepView, field: Callable[[Array, Array], Array]) -> ZoneMesh:
    """Return a mesh with smaller triangles, and a traction there, which is curved near edges.

    Where the contact ends at nodes that can never touch, and in contacts of many nodes, it stays as it is.
    """
    depth = next((depth for depth, most in enumerate(_DIVIDED, 1) if mesh.triangles.shape[0] > most), 3) - 1
    if not (depth and mesh.triangles.size and view.tractions.source == "edges"):
        return mesh
    coarse = Triangulation(mesh.x, mesh.y, mesh.triangles)
    fine = UniformTriRefiner(coarse).refine_triangulation(subdiv=depth)
    values = field(fine.x, fine.y)
    cannot = 1.0 - np.isfinite(view.field("gap"))
    beside = linear(cannot, view.basis, view.start, fine.x, fine.y, 1.0) > 0.0
    if beside.any():
        joined = LinearTriInterpolator(coarse, mesh.values)(fine.x[beside], fine.y[beside])
        values[beside] = np.ma.filled(joined, 0.0)
    return ZoneMesh(fine.x, fine.y, values, fine.triangles)


# --- the fields -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Field:
    """A field with a map: label, unit, help, and the components if it is the length of a vector."""

    label: str
    unit: str
    help: str
    vector: tuple[str, str] | None = None

    def values(self, view: StepView, name: str) -> Array:
        """Return the field at the nodes."""
        return self._joined([view.shown(part) for part in self.vector or (name,)])

    def at(self, view: StepView, name: str, x: Array, y: Array) -> Array:
        """Return the field at points (m)."""
        return self._joined([view.at(x, y, part) for part in self.vector or (name,)])

    def _joined(self, parts: Sequence[Array]) -> Array:
        return parts[0] if self.vector is None else np.asarray(np.hypot(*parts))


_FIELDS = {
    "pressure": _Field("pressure $p$", "Pa", "map of the contact pressure"),
    "traction": _Field(
        "shear traction $|q|$",
        "Pa",
        "map of the size of the shear traction, with arrows",
        ("traction_x", "traction_y"),
    ),
    "traction_x": _Field("shear traction $q_x$", "Pa", "map of its component along x"),
    "traction_y": _Field("shear traction $q_y$", "Pa", "map of its component along y"),
    "slip_increment": _Field(
        "slip in the step",
        "m",
        "map of the slip of body 1 in the step, with arrows",
        ("slip_increment_x", "slip_increment_y"),
    ),
}
for _title, (_name, *_others) in MAPS.items():
    if not _others and _name not in _FIELDS:
        _row = VARIABLES[_name]
        _FIELDS[_name] = _Field(_title[0].lower() + _title[1:], _row.units, f"map of the {_row.long_name}")


def draw_field(
    canvas: FigureBase,
    panels: Sequence[Axes],
    views: Sequence[StepView],
    name: str,
    part: Part,
    arrows: bool = True,
    below: bool = False,
) -> None:
    """Draw a field of several steps, each into its panel, with one color scale.

    The fields "traction" and "slip_increment" are the lengths of vectors, which may have arrows. The color
    bar of a single panel is at its side, or below it.
    """
    field = _FIELDS[name]
    values = [field.values(view, name) for view in views]
    largest = max(float(np.abs(v).max()) for v in values)
    signed = min(float(v.min()) for v in values) < -0.01 * largest
    factor, unit = scaled(largest, field.unit)
    shades: TriMesh | None = None
    vanishes = field.unit == "Pa" or name in _VANISH
    for axes, view, field_values in zip(panels, views, values, strict=True):
        left = name in _SO_FAR and bool(np.any(field_values[~view.contact]))
        mesh = _whole_mesh(view, field_values) if left else mesh_of(view, field_values, vanishes)
        if field.unit == "Pa":
            mesh = finer(mesh, view, partial(field.at, view, name))
        if not mesh.triangles.size:
            axes.text(0.5, 0.5, "no contact", transform=axes.transAxes, ha="center", va="center")
        else:
            shades = axes.tripcolor(
                Triangulation(mesh.x * part.factor, mesh.y * part.factor, mesh.triangles),
                (mesh.values if signed else np.maximum(mesh.values, 0.0)) * factor,
                shading="gouraud",
                rasterized=True,
                cmap="PuOr_r" if signed else "viridis",
            )
            shades.set_clim(-largest * factor if signed else 0.0, (largest or 1.0) * factor)
        if arrows and field.vector is not None:
            vector = view.shown(field.vector[0]), view.shown(field.vector[1])
            part.arrows(axes, view, vector, "white", ARROWS if len(panels) == 1 else FEWER_ARROWS)
        if view.hertz is not None:
            part.outline(axes, view.hertz, view.center, label="Hertz contact area", lw=1.0)
    if shades is not None:
        if len(panels) == 1 and not below:  # as high as the axes
            thick = min(0.045 * part.aspect, 0.2)
            bar = canvas.colorbar(shades, cax=panels[0].inset_axes((1.0 + 0.6 * thick, 0.0, thick, 1.0)))
        elif len(panels) == 1:
            bar = canvas.colorbar(shades, ax=panels[0], orientation="horizontal", aspect=50, shrink=0.8)
        else:
            bar = canvas.colorbar(shades, ax=list(panels), aspect=30, pad=0.02)
        bar.set_label(f"{field.label} ({unit})")
        cast(Any, bar.outline).set_linewidth(0.5)


@styled
def field_map(
    name: str,
    result: Result | xarray.Dataset,
    steps: int | Sequence[int] = -1,
    with_arrows: bool | None = None,
    ax: Axes | None = None,
    source: str | None = None,
) -> Figure:
    """Draw a field over the contact area: tractions to the edges, others linear between the nodes.

    Fields that add up over the load steps are also drawn where the contact was before.

    Parameters
    ----------
    name : str
        "pressure", "traction", "traction_x", "traction_y", "slip_increment" or "accumulated_slip".
    with_arrows : bool, optional
        Whether vectors are also drawn as arrows; by default if there are few maps.
    """
    views, labels, title = views_of(result, steps, source)
    single = len(views) == 1
    part = Part.around(views)
    canvas, panels = map_panels(part, labels, ax)
    arrows = len(views) <= _WITH_ARROWS if with_arrows is None else with_arrows
    draw_field(canvas, panels, views, name, part, arrows, below=part.is_wide)
    if single and views[0].hertz is not None:
        legend_above(panels[0])
    set_title(canvas, title, ax)
    return canvas


@figure("pressure", _FIELDS["pressure"].help)
def pressure_field(
    result: Result | xarray.Dataset,
    steps: int | Sequence[int] = -1,
    ax: Axes | None = None,
    source: str | None = None,
) -> Figure:
    """Draw the contact pressure."""
    return field_map("pressure", result, steps, ax=ax, source=source)


for _name, _field in _FIELDS.items():
    if _name != "pressure":
        figure(_name, _field.help, needs="friction")(partial(field_map, _name))
