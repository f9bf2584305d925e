"""Pictures: what they show is what the result says. The results here are made from closed solutions."""

import inspect
import re
import subprocess
import sys
from typing import Any

import drawn
import matplotlib
import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from hexcontact import Case, Result, analytic, plotting
from hexcontact.analytic import EllipticContact
from hexcontact.core import flat
from hexcontact.plotting import maps as plotting_maps
from hexcontact.plotting.registry import entries
from hexcontact.plotting.style import new_figure, set_title
from hexcontact.result.view import StepView
from hexcontact.text import scaled, worded

HEIGHT = np.sqrt(0.75)


def made(gap, pressures, loads, spacing=0.1, half=16, modulus=2.0, **attributes) -> xarray.Dataset:
    """Lay a result out as `layout.assemble` does; gap and pressures are functions of (x, y)."""
    index = np.arange(-half, half + 1)
    row, col = np.meshgrid(index, index, indexing="ij")
    x, y = spacing * (col + 0.5 * row), spacing * HEIGHT * row
    pressure = np.stack([p(x, y) for p in pressures])
    history = {
        "normal_load": ("step", np.array(loads), {"units": "N"}),
        "approach": ("step", np.sqrt(loads), {"units": "m"}),
        "contact_radius": ("step", np.cbrt(loads), {"units": "m"}),
        "max_pressure": ("step", pressure.max(axis=(1, 2)), {"units": "Pa"}),
        "label": ("step", np.array(["a"] * len(loads), dtype=object)),
    }
    return xarray.Dataset(
        {
            "pressure": (("step", "row", "col"), pressure),
            "initial_gap": (("row", "col"), gap(x, y)),
            **history,
        },
        coords={
            "step": np.arange(1, len(loads) + 1),
            "row": index,
            "col": index,
            "x": (("row", "col"), x),
            "y": (("row", "col"), y),
        },
        attrs={
            "title": "Made up",
            "lattice_spacing": spacing,
            "lattice_basis": spacing * np.array([1.0, 0.0, 0.5, HEIGHT]),
            "effective_modulus": modulus,
            **attributes,
        },
    )


def sphere(center=(0.0, 0.0), loads=(0.2, 0.8), **more) -> xarray.Dataset:
    solutions = [analytic.hertz_sphere(2.0, 1.5, normal_load=load) for load in loads]
    return made(
        lambda x, y: ((x - center[0]) ** 2 + (y - center[1]) ** 2) / 3.0,
        [lambda x, y, s=s: s.pressure(np.hypot(x - center[0], y - center[1])) for s in solutions],
        loads,
        **more,
    )


def cylinders(**more) -> xarray.Dataset:
    solution = analytic.crossed_cylinders(2.0, 1.0, 2.5, np.radians(50), normal_load=0.9)
    n = np.array([-np.sin(np.radians(50)), np.cos(np.radians(50))])
    return made(lambda x, y: y**2 / 2 + (n[0] * x + n[1] * y) ** 2 / 5, [solution.pressure], [0.9], **more)


def cone(**more) -> xarray.Dataset:
    solution = analytic.cone(2.0, 0.5, normal_load=0.9)
    capped = lambda x, y: solution.pressure(np.maximum(np.hypot(x, y), 0.05))  # noqa: E731
    return made(lambda x, y: 0.5 * np.hypot(x, y), [capped], [0.9], **more)


# ----------------------------------------------------------------------------------- the view of a step


@pytest.mark.parametrize(
    ("largest", "unit", "factor", "scaled_unit"),
    [
        (8.54e8, "Pa", 1e-6, "MPa"),
        (1.0e9, "Pa", 1e-9, "GPa"),
        (0.9999e9, "Pa", 1e-6, "MPa"),
        (7.5e-4, "m", 1e6, "µm"),
        (1.5e-3, "m", 1e3, "mm"),
        (1000.0, "N", 1e-3, "kN"),
        (2e-6, "m2", 1e6, "mm²"),
        (2e-7, "m2", 1e6, "mm²"),  # areas from 0.1 of a unit on
        (2e-14, "m3", 1e18, "µm³"),
        (0.3, "1", 1.0, ""),
        (0.0, "Pa", 1.0, "Pa"),
        (1e-30, "m", 1e12, "pm"),
        (1e13, "Pa", 1e-9, "GPa"),
    ],
)
def test_scaled(largest: float, unit: str, factor: float, scaled_unit: str) -> None:
    found, name = scaled(largest, unit)
    assert found == pytest.approx(factor, rel=1e-12)
    assert name == scaled_unit


def test_worded() -> None:
    assert worded(7.4758e-4, "m") == "747.6 µm"
    assert worded(1000.0, "N") == "1 kN"


def test_pressure_between_nodes_is_linear_on_the_triangles() -> None:
    plane = made(lambda x, y: x * x, [lambda x, y: 7.0 + 2.0 * x - 3.0 * y], [1.0])
    view = StepView(plane, -1)
    rng = np.random.default_rng(5)
    # points of the window, away from its rim
    col, row = rng.uniform(-15, 15, (2, 400))
    x, y = 0.1 * (col + 0.5 * row), 0.1 * HEIGHT * row
    np.testing.assert_allclose(view.at(x, y), 7.0 + 2.0 * x - 3.0 * y, rtol=1e-9)
    assert view.at(np.array([50.0]), np.array([0.0])) == 0.0
    hat = made(lambda x, y: x * x, [lambda x, y: 1.0 * (np.hypot(x, y) < 1e-9)], [1.0])
    view = StepView(hat, -1)
    half = 0.05
    # 1 at the node, 1/2 in the middle of each of its six edges, 1/3 in the middle of each triangle
    turn = np.pi / 3 * np.arange(6)
    np.testing.assert_allclose(view.at(half * np.cos(turn), half * np.sin(turn)), 0.5, atol=1e-8)
    third = 0.1 / np.sqrt(3.0)
    np.testing.assert_allclose(
        view.at(third * np.cos(turn + np.pi / 6), third * np.sin(turn + np.pi / 6)), 1 / 3, atol=1e-8
    )


@pytest.mark.parametrize("center", [(0.0, 0.0), (0.13, -0.21)])
def test_hertz_is_recognized_from_the_gap_of_a_sphere(center: tuple[float, float]) -> None:
    view = StepView(sphere(center), 2)
    expected = analytic.hertz_sphere(2.0, 1.5, normal_load=0.8)
    assert view.hertz is not None
    assert view.hertz.semi_major == pytest.approx(expected.contact_radius, rel=1e-6)
    assert view.hertz.semi_minor == pytest.approx(expected.contact_radius, rel=1e-6)
    assert view.hertz.max_pressure == pytest.approx(expected.max_pressure, rel=1e-6)
    assert view.center == pytest.approx(center, abs=1e-9)


def test_hertz_is_recognized_from_the_gap_of_cylinders() -> None:
    view = StepView(cylinders(), -1)
    expected = analytic.crossed_cylinders(2.0, 1.0, 2.5, np.radians(50), normal_load=0.9)
    assert view.hertz is not None
    assert view.hertz.semi_major == pytest.approx(expected.semi_major, rel=1e-7)
    assert view.hertz.semi_minor == pytest.approx(expected.semi_minor, rel=1e-7)
    assert view.hertz.angle == pytest.approx(expected.angle, rel=1e-7)


def test_no_hertz_where_there_is_none() -> None:
    assert StepView(cone(), -1).hertz is None
    without = sphere()
    del without.attrs["effective_modulus"]
    assert StepView(without, -1).hertz is None
    punch = sphere()
    punch["initial_gap"] = punch["initial_gap"].where(punch["initial_gap"] < 0.5)
    assert StepView(punch, -1).hertz is None
    line = made(lambda x, y: y**2, [lambda x, y: np.maximum(0.3 - abs(y), 0)], [1.0])
    assert StepView(line, -1).hertz is None


# ----------------------------------------------------------------------------------- figures


RESULTS = {
    "sphere": sphere,
    "cylinders": cylinders,
    "cone": cone,
    "fine": lambda: sphere(half=90, spacing=0.012),
}
FRICTIONLESS = [name for name, entry in entries().items() if entry.shows == "result" and not entry.needs]
results = pytest.mark.parametrize("make", RESULTS)


BODIES = """
[body.1]
young_modulus = 4
poisson_ratio = 0.3
[body.2]
rigid = true
[grid]
spacing = 0.1
[[load]]
normal_load = 1
"""
"""What the stress below the surface needs of a deck."""


@pytest.mark.parametrize("name", FRICTIONLESS)
def test_every_figure_is_painted_and_titled(name: str) -> None:
    figure = plotting.FIGURES[name](sphere().assign_attrs(deck=BODIES))
    assert isinstance(figure, Figure)
    assert "Made up" in figure.get_suptitle()
    drawn.assert_painted(figure)


@pytest.mark.usefixtures("laid_out_once")
@pytest.mark.parametrize("kind", ["pdf", "svg"])
@pytest.mark.parametrize("name", FRICTIONLESS)
def test_lines_and_areas_are_in_every_kind_of_file(name: str, kind: str) -> None:
    with matplotlib.rc_context({"path.simplify": False}):
        figure = plotting.FIGURES[name](sphere().assign_attrs(deck=BODIES))
        assert drawn.added_strokes(figure, kind) > 0.9 * drawn.vertices(figure) > 5


@pytest.mark.parametrize(
    ("beta", "coupling", "holds"), [(0.0, "full", True), (0.2, "goodman", True), (0.2, "full", False)]
)
def test_hertz_holds_where_shear_does_not_move_the_pressure(beta: float, coupling: str, holds: bool) -> None:
    rough = {"algorithm": "incremental", "friction_coefficient": 0.3, "coupling": coupling}
    assert StepView(sphere(dundurs_beta=beta, **rough), -1).hertz_holds is holds
    assert StepView(sphere(dundurs_beta=beta, coupling=coupling), -1).hertz_holds


def is_section(upper: Any, lower: Any, view: StepView, hertz: EllipticContact | None) -> None:
    """Check a section along x: the nodes of a row, Hertz, and below the difference of both."""
    bottom = upper if hertz is None else lower
    lines, label = drawn.by_label(upper), bottom.get_xlabel()
    assert label.startswith("x (")
    x, p = drawn.si(upper, lines["computed"], label)
    row = np.flatnonzero(
        np.isclose(view.y[:, 0], view.y[:, 0][np.argmin(abs(view.y[:, 0] - view.center[1]))])
    )[0]
    inside = np.isin(np.round(view.x[row] / view.spacing, 6), np.round(x / view.spacing, 6))
    assert inside.sum() >= np.count_nonzero(view.contact[row]) > 3
    largest = view.pressure.max()
    assert_allclose(p, np.interp(x, view.x[row], view.pressure[row], 0.0, 0.0), rtol=0, atol=1e-7 * largest)
    assert set(lines) == {"computed"} | ({"Hertz"} if hertz else set())
    low, high = upper.get_ylim()
    assert low == 0.0 and 1.0 < high * drawn.units(upper.get_ylabel()) / p.max() < 1.2
    if hertz is None:
        return
    fine, exact = drawn.si(upper, lines["Hertz"], label)
    assert len(fine) > len(x) / 2
    y = float(view.y[row, 0]) - view.center[1]
    assert_allclose(exact, hertz.pressure(fine - view.center[0], y), rtol=0, atol=1e-5 * largest)
    assert bottom.get_ylabel() == "error\n(% of $p_0$)"
    apart = drawn.by_label(bottom)["as solved"].get_ydata()
    expected = 100.0 * (p - hertz.pressure(x - view.center[0], y)) / hertz.max_pressure
    assert_allclose(apart, expected, rtol=0, atol=1e-3)


HERTZ = {
    "sphere": lambda: analytic.hertz_ellipse(2.0, np.eye(2) / 1.5, normal_load=0.8),
    "cylinders": lambda: analytic.crossed_cylinders(2.0, 1.0, 2.5, np.radians(50), normal_load=0.9),
    "fine": lambda: analytic.hertz_ellipse(2.0, np.eye(2) / 1.5, normal_load=0.8),
    "cone": lambda: None,
}


@results
def test_pressure_is_drawn_over_the_plane(make: str) -> None:
    result = RESULTS[make]()
    view = StepView(result, -1)
    figure = plotting.pressure_field(result)
    [axes] = drawn.visible(figure)
    drawn.is_field(axes, view, view.pressure, "pressure $p$")
    outlines = drawn.by_label(axes)
    if (hertz := HERTZ[make]()) is None:
        assert not outlines
        return
    x, y = drawn.si(axes, outlines["Hertz contact area"])
    assert_allclose(np.hypot(x, y).max(), hertz.semi_major, rtol=1e-4)
    assert_allclose(np.hypot(x, y).min(), hertz.semi_minor, rtol=1e-4)
    assert_allclose(hertz.pressure(0.999 * x, 0.999 * y) > 0.0, True)
    assert_allclose(hertz.pressure(1.001 * x, 1.001 * y), 0.0)


@results
def test_section_shows_nodes_hertz_and_their_difference(make: str) -> None:
    result = RESULTS[make]()
    axes = drawn.visible(plotting.section(result))
    is_section(axes[0], axes[-1], StepView(result, -1), HERTZ[make]())


def test_difference_from_hertz_is_in_percent_of_his_pressure() -> None:
    result = sphere()
    result["pressure"] *= 1.03
    is_section(*plotting.section(result).axes, StepView(result, -1), HERTZ["sphere"]())


@results
def test_overview_is_the_map_beside_the_section(make: str) -> None:
    result = RESULTS[make]()
    view = StepView(result, -1)
    first, *others = drawn.visible(plotting.overview(result))
    drawn.is_field(first, view, view.pressure, "pressure $p$")
    sections = [axes for axes in others if axes not in first.child_axes]
    is_section(sections[0], sections[-1], view, HERTZ[make]())


@results
def test_boundary_shows_the_nodes_in_contact(make: str) -> None:
    result = RESULTS[make]()
    view = StepView(result, -1)
    axes = plotting.contact_boundary(result).axes[0]
    rim = flat.boundary(view.contact)
    lines = drawn.by_label(axes)
    scale = drawn.units(axes.get_xlabel())
    for label, nodes in (("in contact", view.contact & ~rim), ("boundary node", rim)):
        if label in lines:
            x, y = drawn.si(axes, lines[label])
        else:  # too many to be dots
            x, y = drawn.cells(axes, label).mean(axis=1).T * scale
        assert len(x) == nodes.sum() > 5
        assert_allclose(x, view.x[nodes], rtol=0, atol=1e-9)
        assert_allclose(y, view.y[nodes], rtol=0, atol=1e-9)
    if hertz := HERTZ[make]():
        [name] = [label for label in lines if label.startswith("Hertz, ")]
        x, y = drawn.si(axes, lines[name])
        assert_allclose(np.hypot(x, y).max(), hertz.semi_major, rtol=1e-4)
        [name] = [label for label in lines if label.startswith("fitted ")]
        x, y = drawn.si(axes, lines[name])
        assert_allclose(np.hypot(x, y).max(), hertz.semi_major, atol=0.6 * view.spacing)
        assert_allclose(np.hypot(x, y).min(), hertz.semi_minor, atol=0.6 * view.spacing)


def test_nothing_is_fitted_to_several_spots() -> None:
    one = analytic.hertz_sphere(2.0, 0.5, normal_load=0.1).pressure
    two = made(lambda x, y: x**4, [lambda x, y: one(np.hypot(abs(x) - 1.0, y))], [0.2])
    axes = plotting.contact_boundary(two).axes[0]
    assert not [label for label in drawn.by_label(axes) if "fitted" in label]
    assert "boundary node" in drawn.by_label(axes)


def test_history_shows_each_quantity_over_the_steps() -> None:
    result = sphere(loads=(0.2, 0.5, 0.8))
    panels = drawn.visible(plotting.history(result))
    names = ("normal_load", "approach", "contact_radius", "max_pressure")
    for axes, name in zip(panels, names, strict=True):
        assert axes.get_ylabel().startswith(name.replace("_", " ") + " (")
        x, y = drawn.by_label(axes)[name].get_data()
        np.testing.assert_array_equal(x, [0, 1, 2, 3])  # from the unloaded state on
        assert_allclose(np.asarray(y) * drawn.units(axes.get_ylabel()), [0.0, *result[name]], rtol=1e-12)


def test_field_is_drawn_to_the_edge_of_the_contact() -> None:
    view = StepView(sphere(), -1)
    mesh = plotting_maps.mesh_of(view, view.pressure, vanishes=True)
    radius = np.hypot(mesh.x, mesh.y)
    inside = mesh.values > 0.0
    assert inside.sum() == view.contact.sum()
    np.testing.assert_allclose(mesh.values[inside], view.at(mesh.x, mesh.y)[inside], atol=1e-12)
    assert view.hertz is not None
    np.testing.assert_allclose(radius[~inside], view.hertz.semi_major, atol=0.5 * view.spacing)
    # each node in contact has six triangles or parts of them around it
    assert (np.bincount(mesh.triangles.ravel())[inside] >= 6).all()


def test_a_field_that_does_not_vanish_goes_on_to_the_edge() -> None:
    view = StepView(sphere(), -1)
    mesh = plotting_maps.mesh_of(view, 3.0 + 2.0 * view.x - view.y, vanishes=False)
    off = np.abs(mesh.values - (3.0 + 2.0 * mesh.x - mesh.y))
    assert (
        np.median(off) < 1e-12 and off.max() < 2.3 * view.spacing
    )  # a node alone on its line is taken as it is


def test_a_huge_field_is_thinned_out() -> None:
    view = StepView(sphere(half=330, spacing=0.0035), -1)
    mesh = plotting_maps.mesh_of(view, view.pressure, vanishes=True)
    assert (
        view.contact.sum() > plotting_maps.DRAWN_NODES > mesh.x.size / 1.1 > 0.4 * plotting_maps.DRAWN_NODES
    )
    inside = mesh.values > 0.0
    np.testing.assert_allclose(mesh.values[inside], view.at(mesh.x, mesh.y)[inside], atol=1e-9)


@pytest.mark.parametrize("center", [(0.0, 0.0), (0.3, 0.0)])
def test_section_of_a_step_before_the_last(center: tuple[float, float]) -> None:
    result = sphere(center, loads=(0.2, 0.8, 1.1))
    hertz = analytic.hertz_ellipse(2.0, np.eye(2) / 1.5, normal_load=0.8)
    is_section(*plotting.section(result, 2).axes, StepView(result, 2), hertz)


@pytest.mark.parametrize(("degrees", "through"), [(0.0, None), (17.0, None), (90.0, (0.13, -0.2))])
def test_a_figure_draws_the_section_of_the_result(
    degrees: float, through: tuple[float, float] | None
) -> None:
    result, angle = Result(cylinders()), np.radians(degrees)
    line = result.section("pressure", angle=angle, through=through)
    axes = plotting.section(result, angle=angle, through=through).axes[-1]
    zero = {0.0: float(line.x[0] - line.distance[0]), 90.0: float(line.y[0] - line.distance[0])}
    ends = np.array([line.distance[0], line.distance[-1]]) + zero.get(degrees, 0.0)
    low, high = np.asarray(axes.get_xlim()) * drawn.units(axes.get_xlabel())
    assert_allclose((low + 0.02 * np.ptp(ends), high - 0.02 * np.ptp(ends)), ends, rtol=0, atol=1e-9)
    s, p = drawn.si(axes.figure.axes[0], axes.figure.axes[0].lines[0], axes.get_xlabel())
    assert_allclose(p, np.interp(s - zero.get(degrees, 0.0), line.distance, line.pressure), atol=1e-9)


@pytest.mark.parametrize("degrees", [17.0, 30.0])
def test_section_at_an_angle_is_linear_between_the_nodes(degrees: float) -> None:
    angle, through = np.radians(degrees), (0.1, -0.2)
    flat = made(lambda x, y: x * x, [lambda x, y: 7.0 + 2.0 * x - 3.0 * y], [1.0])
    [axes] = plotting.section(flat, angle=angle, through=through).axes
    s, p = drawn.si(axes, axes.lines[0])
    x, y = through[0] + s * np.cos(angle), through[1] + s * np.sin(angle)
    row, col = y / (0.1 * HEIGHT), x / 0.1 - 0.5 * y / (0.1 * HEIGHT)
    inside = np.maximum(abs(row), abs(col)) < 16.0
    assert inside.sum() > 15
    assert_allclose(p[inside], (7.0 + 2.0 * x - 3.0 * y)[inside], rtol=1e-7)


def test_section_at_an_angle_follows_the_ellipse() -> None:
    result = cylinders(half=50, spacing=0.05)
    solution = analytic.crossed_cylinders(2.0, 1.0, 2.5, np.radians(50), normal_load=0.9)
    upper, lower = plotting.section(result, angle=solution.angle).axes
    s, p = drawn.si(upper, drawn.by_label(upper)["computed"], lower.get_xlabel())
    x, y = s * np.cos(solution.angle), s * np.sin(solution.angle)
    assert_allclose(p, StepView(result, -1).at(x, y), rtol=0, atol=1e-9 * p.max())
    assert np.ptp(s[p > 0.0]) == pytest.approx(2 * solution.semi_major, abs=2 * 0.05)


def test_boundary_names_the_fitted_circle() -> None:
    result = sphere()
    one = result.sel(step=2)
    fit = flat.boundary_circle(one["x"].values, one["y"].values, one["pressure"].values > 0, 0.1)
    [legend] = plotting.contact_boundary(result, 2).legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert f"fitted circle, a = {worded(fit.radius, 'm')}" in texts
    exact = analytic.hertz_sphere(2.0, 1.5, normal_load=0.8)
    assert f"Hertz, a = {worded(exact.contact_radius, 'm')}" in texts


def test_history_chooses_what_is_there() -> None:
    figure = plotting.history(sphere())
    assert [axes.get_ylabel().split(" (")[0] for axes in figure.axes if axes.get_visible()] == [
        "normal load",
        "approach",
        "contact radius",
        "max pressure",
    ]
    assert len(plotting.history(sphere(), ["approach"]).axes) == 1


def test_axes_hold_any_number_of_quantities() -> None:
    names, result, axes = (
        ["contact_radius", "contact_radius_fit", "approach"],
        sphere(),
        Figure().add_subplot(),
    )
    result["contact_radius_fit"] = result["contact_radius"].copy()
    plotting.history(result, names, ax=axes)
    assert [line.get_label() for line in axes.lines] == names
    assert len({line.get_color() for line in axes.lines}) == 3


def test_what_cannot_be_drawn_is_said() -> None:
    result = sphere()
    with pytest.raises(IndexError, match="there is no step 3; the result has steps 1 to 2"):
        plotting.overview(result, 3)
    with pytest.raises(ValueError, match="no history of label"):
        plotting.history(result, ["label"])
    with pytest.raises(ValueError, match="expected one result and one load step at least"):
        plotting.pressure_field(result, [])
    with pytest.raises(ValueError, match="expected one result at least"):
        plotting.compliance([])
    with pytest.raises(ValueError, match="expected some besides over = 'approach'"):
        plotting.history(result, ["approach"], "approach")
    result["pressure"][0] = np.nan
    with pytest.raises(ValueError, match="step 1 was not kept"):
        plotting.section(result, 1)
    result["pressure"][1] = 0.0
    with pytest.raises(ValueError, match="no node is in contact"):
        plotting.contact_boundary(result, 2)
    with pytest.raises(ValueError, match="no node is in contact"):
        plotting.trailing_edge(result.isel(step=[1]))
    assert isinstance(plotting.overview(result, 2), Figure)  # an empty field is still a picture
    with pytest.raises(ValueError, match="the pressure was not kept"):
        plotting.overview(result.drop_vars("pressure"))


def test_no_window_system_is_touched() -> None:
    code = "import sys, hexcontact.plotting; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_long_titles_break_between_words_and_loads() -> None:
    loads = r"$P$ = 500 N, $Q_x$ = −137.5 N, bulk $\sigma_{xx}$ = −200 MPa, bulk $\sigma_{yy}$ = −68.4 MPa"
    title = f"Dovetail rig, Ti-6Al-4V, cylinder-like pad, step 36 ({loads})"
    for width in (2.4, 3.6, 4.8, 8.6):
        figure = new_figure(width, 3.0)
        set_title(figure, title)
        lines = figure.get_suptitle().split("\n")
        assert " ".join(lines) == title
        assert all(line.count("$") % 2 == 0 for line in lines)
        assert not any(line.endswith("step") or line.endswith("=") for line in lines)


@pytest.mark.parametrize("across", ["x", "y"])
def test_very_long_contacts_are_stretched_across(across: str) -> None:
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    radii = {f"radius_{axis}": 5e-3 if axis == across else 1.2 for axis in "xy"}
    body: Any = {**steel, "surface": {"shape": "paraboloid", **radii}}
    result = Case(body_1=body, body_2=steel, spacing=15e-6, normal_load=100.0).run()
    assert 25 < float(result.contact_semi_major[-1] / result.contact_semi_minor[-1]) < 40
    figure = plotting.pressure_field(result)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    shown = axes.get_window_extent()
    thick, long = sorted((shown.width, shown.height))
    assert thick > long / 9.0
    assert re.search("scale × [3-6]$", getattr(axes, f"get_{across}label")())
    assert "scale" not in getattr(axes, f"get_{'xy'['yx'.index(across)]}label")()


def test_energy_that_friction_dissipates_vanishes_at_the_edge_of_the_contact() -> None:
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    body: Any = {**steel, "surface": {"shape": "sphere", "radius": 10e-3}}
    loads = [{"normal_load": 100.0}, {"tangential_load_x": 20.0, "steps": 3}]
    result = Case(body_1=body, body_2=steel, nodes_in_radius=8, friction_coefficient=0.3, loads=loads).run()
    drawing: Any = plotting.FIGURES["dissipation_density"](result).axes[0]
    [corners] = [found for found in drawing.collections if found.get_array() is not None]
    triangles = corners._triangulation
    outer = triangles.neighbors == -1
    rim = np.unique([triangles.triangles[outer], np.roll(triangles.triangles, -1, axis=1)[outer]])
    assert rim.size > 20
    assert np.all(np.asarray(corners.get_array())[rim] == 0.0)


@pytest.mark.parametrize("name", [name for name in plotting.__all__ if name != "FIGURES"])
def test_every_figure_documents_its_parameters_and_errors(name: str) -> None:
    draw = getattr(plotting, name)
    text = draw.__doc__
    documented = re.findall(r"^(\w+) : ", text.split("\nReturns\n")[0], re.MULTILINE)
    assert documented == [*inspect.signature(draw).parameters]
    assert "\nReturns\n-------\nmatplotlib.figure.Figure\n" in text
    assert re.search(r"\nRaises\n------\n\w+Error\n    If ", text)
