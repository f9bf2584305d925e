"""Pictures: what they show is what the result says. The results here are made from closed solutions."""

import io
import subprocess
import sys

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

from hexcontact import analytic, estimators, plotting
from hexcontact.plotting import maps as plotting_maps
from hexcontact.step_view import StepView, scaled, worded

HEIGHT = np.sqrt(0.75)


def made(gap, pressures, loads, spacing=0.1, half=16, modulus=2.0, **attributes) -> xarray.Dataset:
    """Lay a result out as `hexcontact.result.assemble` does; gap and pressures are functions of (x, y)."""
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
        (0.3, "1", 1.0, ""),
        (0.0, "Pa", 1.0, "Pa"),
        (1e-30, "m", 1e12, "pm"),
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
    view = StepView.of(plane, -1)
    rng = np.random.default_rng(5)
    # points of the window, away from its rim
    col, row = rng.uniform(-15, 15, (2, 400))
    x, y = 0.1 * (col + 0.5 * row), 0.1 * HEIGHT * row
    np.testing.assert_allclose(view.at(x, y), 7.0 + 2.0 * x - 3.0 * y, rtol=1e-9)
    assert view.at(np.array([50.0]), np.array([0.0])) == 0.0
    hat = made(lambda x, y: x * x, [lambda x, y: 1.0 * (np.hypot(x, y) < 1e-9)], [1.0])
    view = StepView.of(hat, -1)
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
    view = StepView.of(sphere(center), 2)
    expected = analytic.hertz_sphere(2.0, 1.5, normal_load=0.8)
    assert view.hertz is not None
    assert view.hertz.semi_major == pytest.approx(expected.contact_radius, rel=1e-6)
    assert view.hertz.semi_minor == pytest.approx(expected.contact_radius, rel=1e-6)
    assert view.hertz.max_pressure == pytest.approx(expected.max_pressure, rel=1e-6)
    assert view.center == pytest.approx(center, abs=1e-9)


def test_hertz_is_recognized_from_the_gap_of_cylinders() -> None:
    view = StepView.of(cylinders(), -1)
    expected = analytic.crossed_cylinders(2.0, 1.0, 2.5, np.radians(50), normal_load=0.9)
    assert view.hertz is not None
    assert view.hertz.semi_major == pytest.approx(expected.semi_major, rel=1e-7)
    assert view.hertz.semi_minor == pytest.approx(expected.semi_minor, rel=1e-7)
    assert view.hertz.angle == pytest.approx(expected.angle, rel=1e-7)


def test_no_hertz_where_there_is_none() -> None:
    assert StepView.of(cone(), -1).hertz is None
    without = sphere()
    del without.attrs["effective_modulus"]
    assert StepView.of(without, -1).hertz is None
    punch = sphere()
    punch["initial_gap"] = punch["initial_gap"].where(punch["initial_gap"] < 0.5)
    assert StepView.of(punch, -1).hertz is None
    line = made(lambda x, y: y**2, [lambda x, y: np.maximum(0.3 - abs(y), 0)], [1.0])
    assert StepView.of(line, -1).hertz is None


# ----------------------------------------------------------------------------------- figures


FRICTIONLESS = ("overview", "pressure", "section", "boundary", "history")  # the others need friction
DRAWN = [
    *((make, name, "png") for make in ("sphere", "cylinders", "cone", "fine") for name in FRICTIONLESS),
    *(("cylinders", name, kind) for kind in ("pdf", "svg") for name in FRICTIONLESS),
]


@pytest.mark.parametrize(("make", "name", "kind"), DRAWN)
def test_every_figure_is_drawn(make: str, name: str, kind: str) -> None:
    results = {
        "sphere": sphere,
        "cylinders": cylinders,
        "cone": cone,
        "fine": lambda: sphere(half=90, spacing=0.012),
    }
    result = results[make]()
    figure = plotting.FIGURES[name](result)
    assert isinstance(figure, Figure)
    assert "Made up" in figure.get_suptitle()
    stream = io.BytesIO()
    figure.savefig(stream, format=kind)
    assert len(stream.getvalue()) > 5000
    labels = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel()) if text]
    assert any("(m)" in text or "mm" in text or "load step" in text for text in labels)


def test_field_is_drawn_on_equilateral_triangles_where_there_is_pressure() -> None:
    view = StepView.of(sphere(), -1)
    drawn = plotting_maps.triangles(view, view.pressure)
    assert drawn is not None
    mesh, values = drawn
    corners = np.stack([mesh.x, mesh.y], axis=1)[mesh.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    np.testing.assert_allclose(sides, 0.1, rtol=1e-12)
    # each node in contact has six triangles, and no triangle is without pressure
    assert (values[mesh.triangles] > 0).any(axis=1).all()
    assert np.bincount(mesh.triangles.ravel(), minlength=values.size)[values > 0] == pytest.approx(6)
    np.testing.assert_allclose(values, view.at(mesh.x, mesh.y), atol=1e-12)


def test_a_huge_field_is_thinned_out() -> None:
    view = StepView.of(sphere(half=330, spacing=0.0035), -1)
    drawn = plotting_maps.triangles(view, view.pressure)
    assert drawn is not None
    assert view.contact.sum() > plotting_maps.DRAWN_NODES > drawn[1].size / 1.3


@pytest.mark.parametrize("center", [0.0, 0.3])
def test_section_shows_the_nodes_of_a_row_and_hertz(center: float) -> None:
    result = sphere((center, 0.0))
    figure = plotting.section(result, 2)
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    x, p = lines["computed"].get_data()
    row = result.sel(step=2, row=0)
    expected = dict(zip(np.round(row["x"].values, 9), row["pressure"].values, strict=True))
    # the contact radius is 0.77 m: lengths and pressures are drawn in mm and mPa or the like
    to_length = 1.0 / scaled(float(np.abs(StepView.of(result, 2).window()[:2]).max()), "m")[0]
    to_stress = 1.0 / scaled(float(row["pressure"].max()), "Pa")[0]
    for at, value in zip(np.asarray(x) * to_length, np.asarray(p) * to_stress, strict=True):
        assert value == pytest.approx(expected[np.round(at, 9)], abs=1e-9)
    x, p = (np.asarray(values) for values in lines["Hertz"].get_data())
    solution = analytic.hertz_sphere(2.0, 1.5, normal_load=0.8)
    np.testing.assert_allclose(p * to_stress, solution.pressure(x * to_length - center), atol=1e-5)


def test_section_at_an_angle_follows_the_ellipse() -> None:
    result = cylinders(half=40, spacing=0.03)
    solution = analytic.crossed_cylinders(2.0, 1.0, 2.5, np.radians(50), normal_load=0.9)
    figure = plotting.section(result, angle=solution.angle)
    x, _ = figure.axes[0].lines[0].get_data()
    assert np.ptp(x) == pytest.approx(2 * solution.semi_major * 1e3, rel=0.2) or np.ptp(x) == pytest.approx(
        2 * solution.semi_major, rel=0.2
    )


def test_boundary_names_the_fitted_circle() -> None:
    result = sphere()
    one = result.sel(step=2)
    fit = estimators.boundary_circle(one["x"].values, one["y"].values, one["pressure"].values > 0, 0.1)
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


def test_what_cannot_be_drawn_is_said() -> None:
    result = sphere()
    with pytest.raises(IndexError, match="there is no step 3; the result has steps 1 to 2"):
        plotting.overview(result, 3)
    with pytest.raises(ValueError, match="no history of label"):
        plotting.history(result, ["label"])
    result["pressure"][0] = np.nan
    with pytest.raises(ValueError, match="step 1 was not kept"):
        plotting.section(result, 1)
    result["pressure"][1] = 0.0
    with pytest.raises(ValueError, match="no node is in contact"):
        plotting.contact_boundary(result, 2)
    assert isinstance(plotting.overview(result, 2), Figure)  # an empty field is still a picture
    with pytest.raises(ValueError, match="the pressure was not kept"):
        plotting.overview(result.drop_vars("pressure"))


def test_no_window_system_is_touched() -> None:
    code = "import sys, hexcontact.plotting; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# ----------------------------------------------------------------------------------- influence functions


def test_load_shapes_hold_the_same_volume() -> None:
    from hexcontact.plotting import influence as plotting_influence

    x, y = np.array([300.0, 0.0, -40.0]), np.array([0.0, 200.0, 70.0])
    for shape, _ in plotting_influence.SHAPES.values():
        # the far field is volume/distance, with a relative error of the order of 1/distance^2
        np.testing.assert_allclose(shape(x, y) * np.hypot(x, y), HEIGHT, rtol=1e-4)
    # of the hexagon with the inner radius 1/2 about its middle: 6 * 1/2 * 2 ln(sqrt 3)
    origin = np.zeros(1)
    assert plotting_influence.constant_cell(origin, origin)[0] == pytest.approx(3 * np.log(3), rel=1e-12)
    assert plotting_influence.pyramid(origin, origin)[0] == pytest.approx(
        1.5 * np.sqrt(3) * np.log(3), rel=1e-12
    )


def test_order_of_the_load_shapes() -> None:
    from hexcontact.plotting.influence import interpolation_error

    coarse, fine = np.array(interpolation_error(10.0)), np.array(interpolation_error(40.0))
    order = np.log(coarse / fine) / np.log(4.0)
    assert order == pytest.approx([1.0, 2.0], abs=0.15)


def test_displacement_error_of_the_load_shapes() -> None:
    from hexcontact.plotting.influence import SHAPES, hertz_error

    x = np.linspace(0.0, 8.0, 33)
    error = {
        name: np.abs(hertz_error(shape, 10.0, x + 0.1, 0 * x)).max() for name, (shape, _) in SHAPES.items()
    }
    assert error["pyramid"] < 2e-3
    assert error["constant on the cell"] < 2e-3
    assert error["point force"] > 2e-2


def test_figures_of_the_influence_functions() -> None:
    from hexcontact.plotting import influence as plotting_influence

    for make in plotting_influence.FIGURES.values():
        stream = io.BytesIO()
        make().savefig(stream, format="png")
        assert len(stream.getvalue()) > 20_000
