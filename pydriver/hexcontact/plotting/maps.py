"""Maps of the plane: fields of load steps, side by side, and before a run the surfaces of a deck."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import TriMesh
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import PathPatch
from matplotlib.path import Path as MplPath
from matplotlib.tri import Triangulation, UniformTriRefiner

from ..analytic.compare import ClosedForms, PartialSlip
from ..arrays import Array, Dataset, Mask
from ..core.edges import ZoneMesh
from ..core.lattice import linear
from ..deck.measured import Measured
from ..errors import DeckError
from ..result.netcdf import triangles
from ..result.result import Result
from ..result.view import Results, StepView, as_list, dataset_of, title_of
from ..text import counted, scaled
from ..variables import MAPS, VARIABLES
from .registry import figure, styled
from .style import EDGED, EXACT, GUIDE, drawing, legend_above, legend_below, new_figure, panels_of, set_title

Limits = tuple[float, float, float, float]

ARROWS, FEWER_ARROWS = 13, 9  # across the contact, about, in a large and in a small picture
_WIDTH = 7.2  # inches of a picture with several panels, or of an elongated contact
_HIGH = 4.5  # inches of a map of an upright contact among others
_THIN, _LEAST_ASPECT = 1.0 / 15.0, 1.0 / 7.0  # of maps that are stretched across, and their new one
_OVER = 2.4  # level over fields and lines, under frames, ellipses and arrows
_ROWS = 5  # maps of a wide contact in one column


@dataclass(frozen=True)
class Part:
    """Select a rectangle of the plane that maps show, with its unit of length."""

    limits: Limits  # x_min, x_max, y_min, y_max, m
    factor: float  # from m to the unit
    unit: str
    cell: Array | None = None  # outline of a window that repeats, m

    @classmethod
    def around(cls, views: Iterable[StepView], margin: float = 1.25, least_aspect: float = 0.0) -> Part:
        """Return the part around the contact of some steps, or around their windows if none has contact.

        Height over width and width over height are at least `least_aspect`.
        """
        known = [(view.contact.any(), view.window(margin), view.lattice) for view in views]
        touching = [entry for entry in known if entry[0]]
        _, windows, lattices = zip(*(touching or known), strict=True)
        low, high = np.min(windows, axis=0)[[0, 2]], np.max(windows, axis=0)[[1, 3]]
        more = np.maximum(0.5 * (least_aspect * (high - low)[::-1] - (high - low)), 0.0)
        (x_min, y_min), (x_max, y_max) = (low - more).tolist(), (high + more).tolist()
        factor, unit = scaled(max(abs(x_min), abs(x_max), lattices[0].spacing), "m")
        cell = lattices[0].outline if lattices[0].periodic else None
        return cls((x_min, x_max, y_min, y_max), factor, unit, cell)

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
        """Set limits and labels of axes to this part; outline a window that repeats."""
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
        if self.cell is not None:
            far = 3.0 * (x_max - x_min + y_max - y_min)
            around = np.array([(-far, -far), (far, -far), (far, far), (-far, far), (-far, -far)])
            around += 0.5 * x_min + 0.5 * x_max, 0.5 * y_min + 0.5 * y_max
            inside = (self.cell * self.factor)[::-1]
            beyond = MplPath.make_compound_path(MplPath(around, closed=True), MplPath(inside, closed=True))
            axes.add_patch(PathPatch(beyond, facecolor="white", edgecolor=GUIDE, lw=0.7, zorder=_OVER))

    def bar(
        self, canvas: FigureBase, shades: Any, axes: Axes, label: str, below: bool = False, **options: Any
    ) -> Any:
        """Draw the color bar of one map at its side, as high as the axes, or below it."""
        if below:
            options |= {"ax": axes, "orientation": "horizontal", "aspect": 50, "shrink": 0.8}
        else:
            thick = min(0.045 * self.aspect, 0.2)
            options["cax"] = axes.inset_axes((1.0 + 0.6 * thick, 0.0, thick, 1.0))
        return canvas.colorbar(shades, label=label, **options)

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

    def arrows(self, axes: Axes, view: StepView, vector: Sequence[Array], color: str, many: int) -> None:
        """Draw a vector field at some nodes in contact; the longest arrow reaches the next one."""
        size = np.hypot(*vector)
        if not size.max() > 0.0:
            return
        sides = [float(np.ptp(at[view.contact])) for at in (view.x, view.y)]
        along, across = (
            max(1, round(max(sides) / step / many))
            for step in (view.spacing, view.spacing * view.lattice.cell_ratio)
        )
        at = np.zeros_like(view.contact)
        row, col = np.indices(at.shape)
        away = np.hypot(view.x - view.center[0], view.y - view.center[1])
        middle = np.unravel_index(np.argmin(away), at.shape)
        at[((row - middle[0]) % across == 0) & ((col - middle[1]) % along == 0)] = True
        at &= view.contact & (size > 0.02 * size.max())
        longest = float(size[at].max()) if at.any() else 1.0
        reach = min(along * view.spacing, min(sides) or max(sides))
        for axis, place in enumerate((view.x, view.y)):  # the ends of all arrows are inside the part
            low, high = self.limits[2 * axis : 2 * axis + 2]
            room = np.minimum(place[at] - low, high - place[at]) * longest
            half = 0.5 * np.abs(vector[axis][at])
            reach = float(np.min(room[half > 0.0] / half[half > 0.0], initial=reach))
        axes.quiver(
            view.x[at] * self.factor,
            view.y[at] * self.factor,
            vector[0][at],
            vector[1][at],
            angles="xy",
            scale_units="xy",
            scale=longest / (0.95 * reach * self.factor),
            pivot="mid",
            width=0.0045 if self.aspect < 2.0 else 0.0025 * self.aspect,  # of the width of the axes
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
    views = [StepView(result, step, source) for result in several for step in chosen]
    if not views:
        raise DeckError("expected one result and one load step at least")
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
    panels = panels_of(figure, count, columns, sharex=True, sharey=True)
    for number, (axes, label) in enumerate(zip(panels, labels, strict=True)):
        part.show(axes)
        axes.set_title(label)
        if number + columns < count:  # axis labels only at the lower and left panels
            axes.set_xlabel("")
        else:
            axes.tick_params(labelbottom=True)
        if number % columns:
            axes.set_ylabel("")
    return figure, panels


DRAWN_NODES = 60_000  # above this number, fields are drawn from every second, third, ... node
_VANISH = "dissipation_density", "worn_depth"  # with the pressure at the edge, as tractions do
_DIVIDED = 30_000, 8_000  # triangles up to which each is cut into four, into sixteen
_SO_FAR = "accumulated_slip", "dissipation_density", "worn_depth"  # also where the contact was before
_NOISE = 1e-6  # of the largest pressure, of tractions that count as none
_WITH_ARROWS = 9  # maps in a picture up to which arrows are visible


def mesh_of(view: StepView, values: Array, vanishes: bool) -> ZoneMesh:
    """Return triangles that fill the contact area up to its edge, with a field at their corners.

    Above `DRAWN_NODES` nodes in contact the field is read at every second, third, ... node. Fields like
    tractions vanish at the edge.
    """
    stride = _stride(view.contact)
    return view.edges(stride).mesh(view.every(values, stride), vanishes)


def _whole_mesh(view: StepView, values: Array) -> ZoneMesh:
    """Return triangles that fill the contact and all else where a field is not zero."""
    shown = view.contact | (values != 0.0)
    stride = _stride(shown)
    lattice = view.around(stride)
    x, y = lattice.x[::stride, ::stride], lattice.y[::stride, ::stride]
    values, shown = view.every(values, stride), view.every(shown, stride)
    corners = triangles(*shown.shape).astype(int)
    inside = shown.ravel()[corners].any(axis=1)
    return ZoneMesh(x.ravel(), y.ravel(), values.ravel(), corners[inside])


def _stride(shown: Mask) -> int:
    return int(np.ceil(np.sqrt((1 + int(shown.sum())) / DRAWN_NODES)))


def _finer(mesh: ZoneMesh, view: StepView, field: _Field) -> ZoneMesh:
    """Return a mesh with smaller triangles, and a traction there, which is curved near edges.

    Where the contact ends at nodes that can never touch, and in contacts of many nodes, it stays as it is.
    """
    depth = next((depth for depth, most in enumerate(_DIVIDED, 1) if mesh.triangles.shape[0] > most), 3) - 1
    if not (depth and mesh.triangles.size and view.tractions.source == "edges"):
        return mesh
    coarse = Triangulation(mesh.x, mesh.y, mesh.triangles)
    fine, owner = UniformTriRefiner(coarse).refine_triangulation(return_tri_index=True, subdiv=depth)
    values = field.of(partial(view.at, fine.x, fine.y))
    cannot = 1.0 - np.isfinite(view.field("gap"))
    beside = linear(view.lattice, cannot, fine.x, fine.y, 1.0) > 0.0
    if beside.any():
        values[beside] = _on_triangles(mesh, owner[beside], fine.x[beside], fine.y[beside])
    return ZoneMesh(fine.x, fine.y, values, fine.triangles)


def _on_triangles(mesh: ZoneMesh, owner: Array, x: Array, y: Array) -> Array:
    """Interpolate a field of a mesh at points, each in a triangle of its own; 0 in triangles without area."""
    corners = mesh.triangles[owner]
    u, v = mesh.x[corners] - x[:, None], mesh.y[corners] - y[:, None]
    areas = np.roll(u, -1, 1) * np.roll(v, -2, 1) - np.roll(u, -2, 1) * np.roll(v, -1, 1)
    whole, sums = areas.sum(axis=1), (areas * mesh.values[corners]).sum(axis=1)
    return np.divide(sums, whole, out=np.zeros_like(sums), where=whole != 0.0)


# --- the fields -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Field:
    """A field with a map: label, unit, help, and its components, two if it is the length of a vector."""

    label: str
    unit: str
    help: str
    parts: Sequence[str]

    def of(self, read: Callable[[str], Array]) -> Array:
        """Return the field by its components."""
        parts = [read(part) for part in self.parts]
        return parts[0] if len(parts) == 1 else np.asarray(np.hypot(*parts))


def _fields() -> Iterator[tuple[str, _Field]]:
    """Yield the fields with a map by their names: lengths of vectors, and each with a symbol or alone."""
    for title, names in MAPS.items():
        words, row = title[0].lower() + title[1:], VARIABLES[names[0]]
        if len(names) == 2:
            label = f"{words} $|{row.symbol[0]}|$" if row.symbol else words
            about = f"map of the size of the {words}, with arrows"
            yield names[0].removesuffix("_x"), _Field(label, row.units, about, names)
        for name in names if row.symbol or len(names) == 1 else ():
            row = VARIABLES[name]
            label = f"{words} ${row.symbol}$" if row.symbol else words
            yield name, _Field(label, row.units, f"map of the {row.long_name}", (name,))


_FIELDS = dict(_fields())


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
    values = [field.of(view.shown) for view in views]
    largest = max(float(np.abs(v).max()) for v in values)
    if field.unit == "Pa":  # without the colors of rounding
        largest = max(largest, *(_NOISE * float(view.pressure.max()) for view in views))
    signed = min(float(v.min()) for v in values) < -0.01 * largest
    factor, unit = scaled(largest, field.unit)
    shades: TriMesh | None = None
    vanishes = field.unit == "Pa" or name in _VANISH
    for axes, view, field_values in zip(panels, views, values, strict=True):
        left = name in _SO_FAR and bool(np.any(field_values[~view.contact]))
        mesh = _whole_mesh(view, field_values) if left else mesh_of(view, field_values, vanishes)
        if field.unit == "Pa":
            mesh = _finer(mesh, view, field)
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
        if arrows and len(field.parts) == 2:
            many = ARROWS if len(panels) == 1 else FEWER_ARROWS
            part.arrows(axes, view, [view.shown(one) for one in field.parts], "white", many)
        if view.hertz is not None:
            part.outline(axes, view.hertz, view.center, label="Hertz contact area", lw=1.0)
    if shades is not None:
        is_open = field.unit == "Pa" and any(view.is_unbounded for view in views)
        extend = ("both" if signed else "max") if is_open else "neither"
        label = f"{field.label} ({unit})"
        if len(panels) == 1:
            bar = part.bar(canvas, shades, panels[0], label, below, extend=extend)
        else:
            bar = canvas.colorbar(shades, ax=list(panels), aspect=30, pad=0.02, label=label, extend=extend)
        cast(Any, bar.outline).set_linewidth(0.5)


@styled
def field_map(
    name: str,
    result: Result | Dataset,
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
    return set_title(canvas, title, ax)


@figure("pressure", _FIELDS["pressure"].help)
def pressure_field(
    result: Result | Dataset,
    steps: int | Sequence[int] = -1,
    ax: Axes | None = None,
    source: str | None = None,
) -> Figure:
    """Draw the contact pressure."""
    return field_map("pressure", result, steps, ax=ax, source=source)


for _name, _field in _FIELDS.items():
    if _name != "pressure":
        figure(_name, _field.help, needs="friction")(partial(field_map, _name))


# --- surfaces of a deck --------------------------------------------------------------------------

_SURFACE = 4.8, 4.2  # inches of the panel of a surface
_POINTS = 201  # along a side of the gap, if no surface was measured


@figure("surface", "measured surfaces, or the gap, and the window, of a deck", needs="a deck")
def surface(case: Any) -> Figure:
    """Draw the measured surfaces of a case, each as it lies in the plane, or the gap if there are none.

    Parameters
    ----------
    case : hexcontact.Case
        A case.
    """
    maps = case.surfaces.measured
    canvas = new_figure(_SURFACE[0] * max(len(maps), 1), _SURFACE[1])
    canvas.set_layout_engine("compressed")
    panels = canvas.subplots(1, max(len(maps), 1), squeeze=False)[0]
    for axes, (number, one) in zip(panels, maps, strict=False):
        axes.set_title(f"body {number}: {one}")
        (_profile if one.extruded else _height_map)(axes, one, case)
    if not maps:
        x, y = _sides(case)
        # of rough surfaces, that over the period of the window
        gap = case.plane_gap.at(*np.meshgrid(x, y, indexing="ij"))
        col, row = np.unravel_index(np.nanargmin(gap), gap.shape)
        _colored(panels[0], x, y, gap, "gap", case, (x[col], y[row]))
    return set_title(canvas, case.title)


def _height_map(axes: Axes, one: Measured, case: Any) -> None:
    """Draw the heights of a map where it is measured or repeats; points without one are gray, or marked."""
    found, touch = one.placed("").map, case.surfaces.first_touch[:2]
    (x, y), gap = (found.x + one.offset[0], found.y + one.offset[1]), found.gap  # type: ignore[operator]
    u, v, z, _ = one.points
    row, col = np.nonzero(np.isnan(z) & (one.holes == "fill"))
    filled = u[row] + one.offset[0], v[col] + one.offset[1]  # type: ignore[operator]
    if case.period:
        x, y = _sides(case)
        gap = one.height(*np.meshgrid(x, y, indexing="ij"))
        filled, touch = (
            tuple(at[0] + np.mod(p - at[0], np.ptp(at)) for p, at in zip(point, (x, y), strict=True))
            for point in (filled, touch)
        )
    shown = -gap if one.upwards else gap
    _colored(axes, x, y, shown, "height" if one.upwards else "gap", case, touch, filled)


def _sides(case: Any) -> tuple[Array, ...]:
    """Return points (m) along x and along y over the rectangle about the window."""
    return tuple(np.linspace(at.min(), at.max(), _POINTS) for at in case.lattice.outline.T)


def _colored(
    axes: Axes,
    x: Array,
    y: Array,
    values: Array,
    words: str,
    case: Any,
    touch: Sequence[float],
    filled: tuple[Array, ...] = (),
) -> None:
    """Draw values over the plane, with the window, the point of first touch and filled holes."""
    shown = np.ma.masked_invalid(values)
    times, unit = scaled(float(shown.max() - shown.min()), "m")
    u, v = case.lattice.outline.T
    across, up = np.append(x, u), np.append(y, v)
    limits = float(across.min()), float(across.max()), float(up.min()), float(up.max())
    part = Part(limits, *scaled(limits[1] - limits[0], "m"))
    scale = part.factor
    part.show(axes)
    if part.is_tall:
        cast(Figure, axes.figure).set_figheight(part.size()[1])
    axes.set_facecolor("0.7")
    drawn = axes.pcolormesh(x * scale, y * scale, times * shown.T, shading="nearest", rasterized=True)
    part.bar(axes.figure, drawn, axes, f"{words} ({unit})", below=part.is_wide)
    axes.plot(u * scale, v * scale, color="w", path_effects=EDGED, label="window")
    axes.plot(touch[0] * scale, touch[1] * scale, "+", color=EXACT, ms=9, label="first touch")
    if filled and filled[0].size:
        holes: dict[str, Any] = {"mfc": "k", "mec": "w", "mew": 0.4, "ms": 3.5}
        holes["label"] = f"{counted(filled[0].size, 'hole')} filled"
        axes.plot(filled[0] * scale, filled[1] * scale, "o", **holes)
    legend_below(axes, ncols=3, fontsize=8)


def _profile(axes: Axes, one: Measured, case: Any) -> None:
    """Draw a profile across its direction, with the width of the window."""
    placed = one.placed("")
    _, across = placed.own(*case.lattice.outline.T)
    y, gap = placed.map.y, placed.map.gap[0]
    if case.period:
        y = np.linspace(across.min(), across.max(), _POINTS)
        gap = one.height(*placed.in_plane(0.0 * y, y))
    height = -gap if one.upwards else gap
    scale, length = scaled(float(np.ptp(y)), "m")
    times, unit = scaled(float(np.ptp(height[np.isfinite(height)])), "m")
    axes.plot(scale * y, times * height)
    for end in (across.min(), across.max()):
        axes.axvline(scale * end, color=EXACT, lw=0.8, ls="--")
    words = "height" if one.upwards else "gap"
    angle = math.degrees(one.direction)
    axes.set(ylabel=f"{words} ({unit})", xlabel=f"across {angle:.3g}° from x ({length}); dashed: window")
