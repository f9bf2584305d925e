"""Fields over the plane: pressure, shear traction and slip of one load step, or of several side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from ..result.mesh import triangles
from ..result.view import StepView, scaled
from ..variables import MAPS, VARIABLES
from .plane import ARROWS, FEWER_ARROWS, Part, map_panels, views_of
from .registry import figure, styled
from .style import legend_above, set_title

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.collections import TriMesh
    from matplotlib.figure import FigureBase

    from ..result.result import Result

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DRAWN_NODES = 60_000  # nodes beyond which a field is drawn from every second, third, ... node
LEAST_ASPECT = 0.6  # of a single map, so that there is room for a color bar beside it
_WITH_ARROWS = 9  # maps in a picture up to which their arrows can be seen


def mesh_of(view: StepView, values: Array, where: Mask) -> tuple[Triangulation, Array] | None:
    """Return the triangles of the lattice with a corner at some of the nodes, and the values at all corners.

    Parameters
    ----------
    view : StepView
        The step.
    values : ndarray, shape (n_row, n_col)
        A field.
    where : ndarray of bool, shape (n_row, n_col)
        The nodes; of more than `DRAWN_NODES` in contact only some are taken.
    """
    stride = int(np.ceil(np.sqrt((1 + int(view.contact.sum())) / DRAWN_NODES)))
    x, y, shown = (f[::stride, ::stride] for f in (view.x, view.y, values))
    corners = triangles(*x.shape)
    corners = corners[where[::stride, ::stride].ravel()[corners].any(axis=1)]
    if not corners.size:
        return None
    used, renumbered = np.unique(corners, return_inverse=True)
    triangulation = Triangulation(x.ravel()[used], y.ravel()[used], renumbered.reshape(corners.shape))
    return triangulation, shown.ravel()[used]


# --- which fields there are -----------------------------------------------------------------------


@dataclass(frozen=True)
class _Field:
    """A field that has a map: its label, unit, help, and the components of the vector whose length it is."""

    label: str
    unit: str
    help: str
    vector: tuple[str, str] | None = None

    def values(self, view: StepView, name: str) -> Array:
        if self.vector is None:
            return view.pressure if name == "pressure" else view.field(name)
        return np.asarray(np.hypot(*(view.field(part) for part in self.vector)))


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
) -> None:
    """Draw a field of several steps into panels with one color scale.

    Parameters
    ----------
    canvas : Figure
        Where the panels are.
    panels : sequence of Axes
        One for each step.
    views : sequence of StepView
        The steps.
    name : str
        Name of the field; "traction" and "slip_increment" are the lengths of the vectors.
    part : Part
        The part of the plane that is shown.
    arrows : bool
        Whether a vector is drawn as arrows, too.
    """
    field = _FIELDS[name]
    values = [field.values(view, name) for view in views]
    largest = max(float(np.abs(v).max()) for v in values)
    signed = min(float(v.min()) for v in values) < -0.01 * largest
    factor, unit = scaled(largest, field.unit)
    shades: TriMesh | None = None
    for axes, view, field_values in zip(panels, views, values, strict=True):
        drawn = mesh_of(view, field_values, view.contact)
        if drawn is None:
            axes.text(0.5, 0.5, "no contact", transform=axes.transAxes, ha="center", va="center")
        else:
            mesh, at_corners = drawn
            mesh = Triangulation(mesh.x * part.factor, mesh.y * part.factor, mesh.triangles)
            shades = axes.tripcolor(
                mesh,
                at_corners * factor,
                shading="gouraud",
                rasterized=True,
                cmap="PuOr_r" if signed else "viridis",
            )
            shades.set_clim(-largest * factor if signed else 0.0, (largest or 1.0) * factor)
        if arrows and field.vector is not None:
            vector = view.field(field.vector[0]), view.field(field.vector[1])
            part.arrows(axes, view, vector, "white", ARROWS if len(panels) == 1 else FEWER_ARROWS)
        if view.hertz is not None:
            part.outline(axes, view.hertz, view.center, label="Hertz contact area", lw=1.0)
    if shades is not None:
        if len(panels) == 1:  # as high as the axes
            bar = canvas.colorbar(shades, cax=panels[0].inset_axes((1.03, 0.0, 0.045, 1.0)))
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
) -> Figure:
    """Draw a field over the plane, linear on the triangles of the lattice as in the solution.

    Parameters
    ----------
    name : str
        "pressure", "traction", "traction_x", "traction_y", "slip_increment" or "accumulated_slip".
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    steps : int or sequence of int
        Numbers of the load steps, from 1; -1 is the last one.
    with_arrows : bool, optional
        Whether a vector is drawn as arrows, too; by default unless there are too many maps to see them.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the field of that step was not kept, or there is none without friction.
    """
    views, labels, title = views_of(result, steps)
    single = len(views) == 1
    part = Part.around(views, least_aspect=LEAST_ASPECT if single else 0.0)
    canvas, panels = map_panels(part, labels)
    arrows = len(views) <= _WITH_ARROWS if with_arrows is None else with_arrows
    draw_field(canvas, panels, views, name, part, arrows)
    if single and views[0].hertz is not None:
        legend_above(panels[0])
    set_title(canvas, title)
    return canvas


@figure("pressure", _FIELDS["pressure"].help)
def pressure_field(result: Result | xarray.Dataset, steps: int | Sequence[int] = -1) -> Figure:
    """Draw the contact pressure over the plane, linear on the triangles of the lattice as in the solution.

    Parameters
    ----------
    result : Result or xarray.Dataset
        What a run returned, or `open_result` read.
    steps : int or sequence of int
        Numbers of the load steps, from 1; -1 is the last one.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    IndexError
        If there is no such step.
    ValueError
        If the pressure of that step was not kept.
    """
    return field_map("pressure", result, steps)


for _name, _field in _FIELDS.items():
    if _name != "pressure":
        figure(_name, _field.help, needs="friction")(partial(field_map, _name))
