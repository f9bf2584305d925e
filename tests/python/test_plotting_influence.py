"""Pictures of the influence functions, and the load shapes that they compare."""

import runpy
from pathlib import Path

import drawn
import numpy as np
import pytest
from numpy.testing import assert_allclose

from hexcontact.core import flat
from hexcontact.influence import pyramid_functions

HEIGHT = np.sqrt(0.75)
INFLUENCE = runpy.run_path(str(Path(__file__).parents[2] / "docs/images/influence.py"))
LOOKS = INFLUENCE["LOOKS"]
NUMBERS = {shape: number for number, shape in enumerate(LOOKS, start=1)}  # of the core


def test_load_shapes_hold_the_same_volume() -> None:
    x, y = np.array([300.0, 0.0, -40.0]), np.array([0.0, 200.0, 70.0])
    for shape in LOOKS:
        # the far field is volume/distance, with a relative error of the order of 1/distance^2
        potential = flat.load_potential(NUMBERS[shape], x, y)
        np.testing.assert_allclose(potential * np.hypot(x, y), HEIGHT, rtol=1e-4)
    # of the hexagon with the inner radius 1/2 about its middle: 6 * 1/2 * 2 ln(sqrt 3)
    origin = np.zeros(1)
    constant, pyramid = (
        flat.load_potential(NUMBERS[shape], origin, origin)[0]
        for shape in ("constant on the cell", "pyramid")
    )
    assert constant == pytest.approx(3 * np.log(3), rel=1e-12)
    assert pyramid == pytest.approx(1.5 * np.sqrt(3) * np.log(3), rel=1e-12)


def test_order_of_the_load_shapes() -> None:
    coarse, fine = np.array(flat.pressure_errors(10.0)), np.array(flat.pressure_errors(40.0))
    order = np.log(coarse / fine) / np.log(4.0)
    assert order == pytest.approx([1.0, 2.0], abs=0.15)


def test_displacement_error_of_the_load_shapes() -> None:
    x = np.linspace(0.0, 8.0, 33)
    error = {
        name: np.abs(flat.displacement_errors(number, 10.0, x + 0.1, 0 * x)).max()
        for name, number in NUMBERS.items()
    }
    assert error["pyramid"] < 2e-3
    assert error["constant on the cell"] < 2e-3
    assert error["point force"] > 2e-2


def test_figure_of_the_pyramid_shows_the_nine_functions() -> None:
    figure = INFLUENCE["pyramid_displacements"](0.2)
    drawn.assert_painted(figure)
    panels = drawn.visible(figure)
    fine = np.linspace(-2.2, 2.2, 221)
    functions = pyramid_functions(*np.meshgrid(fine, fine), 0.2)
    names = [axes.get_title()[1] for axes in panels]
    assert names == list("CDEFGHIJK")
    for axes, name, values in zip(panels, names, functions, strict=True):
        filled, lines = axes.collections
        edges = np.asarray(filled.levels)
        assert edges[-1] == pytest.approx(np.abs(values).max())
        assert edges[0] == (0.0 if name in "CGK" else -edges[-1])
        assert len(filled.get_paths()) == len(edges) - 1
        assert_allclose(lines.levels, edges[1:-1:2])
        # each line of equal values lies where the function has them
        checked = 0
        for level, path in zip(lines.levels, lines.get_paths(), strict=True):
            if len(path.vertices):
                found = getattr(pyramid_functions(*path.vertices.T, 0.2), name)
                assert_allclose(found, level, rtol=0, atol=5e-3 * edges[-1])
                checked += len(path.vertices)
        assert checked > 500


def test_figure_of_the_load_shapes_shows_loads_pressures_and_errors() -> None:
    figure = INFLUENCE["load_shapes"](8)
    drawn.assert_painted(figure)
    one, pressure, error, convergence = drawn.visible(figure)
    assert [axes.get_title()[:3] for axes in figure.axes] == ["(a)", "(b)", "(c)", "(d)"]
    shapes = LOOKS
    for line, (shape, look) in zip(one.lines, shapes.items(), strict=True):
        x, value = line.get_data()
        assert (len(x), line.get_color()) == (501, look["color"])
        assert_allclose(value, flat.load_potential(NUMBERS[shape], x, 0.0))
    exact, pyramids = pressure.lines
    x, p = exact.get_data()
    assert_allclose(p, np.sqrt(1.0 - x**2))
    nodes = np.arange(-8, 9) / 8
    assert_allclose(pyramids.get_data(), (nodes, np.sqrt(1.0 - nodes**2)))
    for line, (shape, look) in zip(error.lines, shapes.items(), strict=False):
        x, value = line.get_data()
        assert (len(x), line.get_color()) == (721, look["color"])
        assert_allclose(
            value[::90], 100.0 * flat.displacement_errors(NUMBERS[shape], 8, 8.0 * x[::90], 0.0 * x[::90])
        )
    assert len(error.lines) == len(shapes) + 1  # and the axis
    for column, line in enumerate(convergence.lines):
        meshes, values = line.get_data()
        assert meshes.tolist() == [5, 10, 20, 40]
        assert_allclose(
            values,
            [100.0 * flat.pressure_errors(mesh)[column] for mesh in (5.0, 10.0, 20.0, 40.0)],
        )
    assert len(convergence.lines) == 2


def test_figure_of_the_elements_shows_solids_and_displacements() -> None:
    figure = INFLUENCE["load_elements"](0.2)
    drawn.assert_painted(figure)
    panels = [axes for axes in figure.axes if axes.get_title().startswith("(")]
    assert [axes.get_title()[1] for axes in panels] == list("abcdefgh")
    faces = [len(panels[k].collections) for k in (0, 2, 3)]
    assert faces == [2, 12, 12]  # a face and an arrow of each element
    tops = [np.asarray(axes.collections[0].levels)[-1] for axes in panels[4:]]
    # mirror images: the largest displacement of element 2 is that of element 6
    assert tops[2] == pytest.approx(tops[3])
    # the largest displacement by an element is above that at its corner, a sixth of the pyramid's
    normal, shear = pyramid_functions(0.0, 0.0, 0.2).C / 6, pyramid_functions(0.0, 0.0, 0.2).G / 6
    assert normal < tops[0] < 3 * normal
    assert shear < tops[1] < 3 * shear


def test_figure_of_load_models_adds_triangles() -> None:
    panels = INFLUENCE["load_models"](5).axes
    *triangles, total = panels[3].lines[1:]
    assert len(triangles) == 5
    place, height = total.get_data()
    added = sum(np.interp(place, *line.get_data(), 0.0, 0.0) for line in triangles)
    assert_allclose(added, height, atol=1e-12)
    assert_allclose(panels[1].patches[0].get_data().values, height[1:-1])
