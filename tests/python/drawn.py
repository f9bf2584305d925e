"""What pictures show: the data of their artists in SI units, and the pixels that are painted."""

from __future__ import annotations

import io
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import colors
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline
from PIL import Image

from hexcontact.result.html import SLIP, STICK
from hexcontact.result.view import StepView

PREFIXES = {"p": 1e-12, "n": 1e-9, "µ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}


# --- data -----------------------------------------------------------------------------------------


def units(axis_label: str) -> float:
    """Return the factor from what an axis shows back to SI, by the unit in its label."""
    unit = axis_label.rsplit("(", 1)[1].rstrip(")")
    if unit in ("m", "Pa", "N", "J", "rad", "N m", "m²"):
        return 1.0
    return PREFIXES[unit[0]] ** (2 if unit.endswith("m²") else 1)


def si(axes: Axes, line: Any, x_label: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the data of a line in SI; the label of x is that of the axes, if it is not given."""
    x, y = (np.asarray(values, dtype=float) for values in line.get_data())
    return x * units(x_label or axes.get_xlabel()), y * units(axes.get_ylabel())


def by_label(axes: Axes) -> dict[str, Any]:
    """Return the lines of some axes that have a label, by it."""
    return {str(line.get_label()): line for line in axes.lines if not str(line.get_label()).startswith("_")}


def cells(axes: Axes, label: str) -> np.ndarray:
    """Return the corners of the cells of nodes that are drawn with a label: cell, corner, x and y."""
    [drawn] = [one for one in axes.collections if one.get_label() == label]
    return np.array([path.vertices[:4] for path in drawn.get_paths()])


def visible(figure: Figure) -> list[Axes]:
    """Return the axes that are shown, color bars beside several maps left out."""
    return [axes for axes in figure.axes if axes.get_visible() and axes.get_label() != "<colorbar>"]


def is_field(axes: Axes, view: StepView, values: np.ndarray, label: str, bar: Axes | None = None) -> None:
    """Check that a map shows a field: values at the nodes in contact, edge, scale and units."""
    bar = bar or [*axes.child_axes, *axes.figure.axes[1:]][0]  # of an elongated contact below the map
    scale = bar.get_ylabel() or bar.get_xlabel()
    assert scale.startswith(f"{label} (")
    mesh, factor, to_length = axes.collections[0], units(scale), units(axes.get_xlabel())
    assert axes.get_xlabel().startswith("x (") and axes.get_ylabel().startswith("y (")
    triangulation = mesh._triangulation  # type: ignore[attr-defined]
    x, y = triangulation.x * to_length, triangulation.y * to_length
    shown = np.asarray(mesh.get_array()) * factor
    largest = np.abs(values).max()
    assert shown.size >= view.contact.sum() > 0
    corners = triangulation.triangles
    a, b = (
        np.stack([x[corners[:, k]] - x[corners[:, 0]], y[corners[:, k]] - y[corners[:, 0]]]) for k in (1, 2)
    )
    assert 0.5 * (a[0] * b[1] - a[1] * b[0]).sum() == pytest.approx(view.edges().edge().area)
    nodes = places(view.x[view.contact], view.y[view.contact], view)
    at_node = np.array([at in nodes for at in pairs(x, y, view)])
    assert at_node.sum() == view.contact.sum()
    expected = view.at(x, y, values)
    np.testing.assert_allclose(shown[at_node], expected[at_node], rtol=0, atol=1e-7 * largest)
    if "Pa" in scale:  # tractions vanish at the edge
        assert not shown[~at_node].any()
    low, high = mesh.get_clim()
    assert abs(high * factor / largest - 1.0) < 1e-9
    assert low == (-high if values.min() < -0.01 * largest else 0.0)


def pairs(x: np.ndarray, y: np.ndarray, view: StepView) -> list[tuple[float, float]]:
    """Return points as pairs that can be compared."""
    return list(zip(*(np.round(at / view.spacing, 6).tolist() for at in (x, y)), strict=True))


def places(x: np.ndarray, y: np.ndarray, view: StepView) -> set[tuple[float, float]]:
    """Return points as a set of pairs."""
    return set(pairs(x, y, view))


def are_zones(axes: Axes, view: StepView, to_length: float | None = None) -> None:
    """Check that a map fills the areas of contact and stick to their edges, each in its color."""
    factor = to_length or units(axes.get_xlabel() or axes.get_ylabel())
    stick = view.contact & view.stick
    areas = {SLIP: view.edges().edge().area, STICK: view.edges().edge(stick, view.reserve).area}
    patches = {colors.to_hex(patch.get_facecolor()): patch for patch in axes.patches}
    zones = {SLIP: view.contact, STICK: stick}
    assert {name.lower() for name, nodes in zones.items() if nodes.any()} <= patches.keys()
    for color, nodes in zones.items():
        if not nodes.any():
            continue
        path = patches[color.lower()].get_path()
        polygons = [polygon * factor for polygon in path.to_polygons(closed_only=False)]
        assert area(polygons) == pytest.approx(areas[color], rel=1e-9)
        inside = np.zeros(nodes.shape, dtype=bool)
        points = np.stack([view.x.ravel(), view.y.ravel()], axis=1)
        for polygon in polygons:
            inside ^= Outline(polygon).contains_points(points).reshape(nodes.shape)
        edges = view.edges()
        away = edges.distances() if color == SLIP else edges.distances(stick, view.reserve)
        beside = np.abs(away) > 1e-6  # not on the edge itself
        np.testing.assert_array_equal(inside[beside], nodes[beside])


def area(polygons: Sequence[np.ndarray]) -> float:
    """Return the area that closed polygons enclose, holes left out."""
    return sum(0.5 * float(np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1])) for p in polygons)


# --- pixels ---------------------------------------------------------------------------------------


def pixels(picture: Figure | Path | bytes, dpi: int = 200) -> np.ndarray:
    """Return the pixels of a figure as it is written, or of a picture, in red, green and blue."""
    if isinstance(picture, Figure):
        stream = io.BytesIO()
        picture.savefig(stream, format="png", dpi=dpi)
        picture = stream.getvalue()
    with Image.open(io.BytesIO(picture) if isinstance(picture, bytes) else picture) as image:
        return np.asarray(image.convert("RGB"))


def data_artists(axes: Axes) -> list[Artist]:
    """Return what the data have drawn into some axes."""
    return [*axes.lines, *axes.collections, *axes.patches, *axes.images]


def assert_painted(figure: Figure) -> None:
    """Check that the data paint pixels into each of the axes of a figure that are shown."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    # no label beyond the picture, whose unit is an inch here
    labels = figure.get_tightbbox(canvas.get_renderer())
    assert min(*labels.min, *(figure.get_size_inches() - labels.max)) > -0.01, labels
    whole = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    figure.set_layout_engine("none")  # what is hidden below does not move the rest
    shown = visible(figure)
    assert shown
    artists = [artist for axes in shown for artist in data_artists(axes) if artist.get_visible()]
    for artist in artists:
        artist.set_visible(False)
    canvas.draw()
    changed = np.abs(np.asarray(canvas.buffer_rgba())[..., :3].astype(int) - whole).max(axis=2) > 24
    for artist in artists:
        artist.set_visible(True)
    for axes in shown:
        box = axes.get_window_extent()
        rows = slice(int(whole.shape[0] - box.y1), int(whole.shape[0] - box.y0))
        inside = changed[rows, int(box.x0) : int(box.x1)]
        assert inside.mean() > 0.002, (axes.get_title(), axes.get_ylabel(), inside.mean())


def strokes(data: bytes, kind: str) -> int:
    """Return how many points lines and areas of a PDF or SVG have."""
    if kind == "svg":
        paths = re.findall(rb'\bd="([^"]*)"', data)
        return sum(len(re.findall(rb"[MLQCz]", path)) for path in paths)
    found = 0
    for packed in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL):
        try:
            content = zlib.decompress(packed)
        except zlib.error:
            continue
        found += len(re.findall(rb"^.* [lc]$", content, re.MULTILINE))
    return found


def vertices(figure: Figure) -> int:
    """Return how many points the lines of a figure have, markers left out."""
    lines = [line for axes in visible(figure) for line in axes.lines if line.get_linestyle() != "None"]
    return sum(len(line.get_xdata()) for line in lines)


def added_strokes(figure: Figure, kind: str) -> int:
    """Return how many points the data add to a figure that is written as PDF or SVG."""
    found = []
    artists = [artist for axes in visible(figure) for artist in data_artists(axes) if artist.get_visible()]
    for shown in (True, False):
        for artist in artists:
            artist.set_visible(shown)
        stream = io.BytesIO()
        figure.savefig(stream, format=kind)
        found.append(strokes(stream.getvalue(), kind))
    for artist in artists:
        artist.set_visible(True)
    return found[0] - found[1]


def has_pixels(figure: Figure, kind: str) -> bool:
    """Tell whether anything in a figure that is written as PDF or SVG is a picture of pixels."""
    stream = io.BytesIO()
    figure.savefig(stream, format=kind)
    return {"pdf": b"/Subtype /Image", "svg": b"<image"}[kind] in stream.getvalue()


def apart(picture: np.ndarray, reference: np.ndarray) -> float:
    """Return the share of two pictures of one size in which they differ, square by square of 8 by 8 pixels.

    A square differs if the mean of a color is 10 of 255 off: less is what fewer colors and other fonts make.
    """
    assert picture.shape == reference.shape

    def blurred(image: np.ndarray) -> np.ndarray:
        rows, cols = (length // 8 * 8 for length in image.shape[:2])
        return image[:rows, :cols].reshape(rows // 8, 8, cols // 8, 8, 3).mean(axis=(1, 3))

    off = np.abs(blurred(picture.astype(float)) - blurred(reference.astype(float))).max(axis=2)
    return float((off > 10.0).mean())
