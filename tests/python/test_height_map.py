"""Measured heights: interpolation at steps, holes, ends of the data, and the lattice over them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import RectBivariateSpline

from hexcontact import Case, DeckError, Lattice
from hexcontact.deck.height_map import HeightMap
from hexcontact.problem import plausibility
from hexcontact.problem.preview import case_rows
from hexcontact.text import quantity

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
X, Y = (
    np.linspace(-0.4e-3, 0.4e-3, 81),
    np.linspace(0.3e-3, -0.3e-3, 61),
)  # rows from top to bottom, as an image
RADIUS = np.hypot(*np.meshgrid(X, Y))
BALL = RADIUS**2 / 20e-3  # of 10 mm on a flat
EVERYWHERE = np.random.default_rng(3).random(RADIUS.shape) < 0.03


def on_grid(values: Any, x: Any = X, y: Any = Y) -> xr.DataArray:
    return xr.DataArray(np.array(values), dims=("y", "x"), coords={"y": y, "x": x})


def case(gap: Any, **keys: Any) -> Case:
    return Case(body_1=STEEL, body_2=STEEL, gap=gap, **{"spacing": 8e-6, "normal_load": 20.0, **keys})


def complaint(gap: Any, **keys: Any) -> str:
    with pytest.raises(DeckError) as error:
        case(gap, **keys).run()
    return str(error.value)


def between(grid: HeightMap) -> tuple[np.ndarray, np.ndarray]:
    """Return a thousand points of a map."""
    u, v = np.random.default_rng(5).random((2, 1000))
    return grid.x[0] + u * np.ptp(grid.x), grid.y[0] + v * np.ptp(grid.y)


def test_a_terrace_has_no_ridges() -> None:
    """The cubic spline through it leaves the heights by 101 nm, and the approach is 244 nm."""
    gap = on_grid(np.where(RADIUS < 0.1e-3, 0.0, 1e-6) + RADIUS**2 / 0.1)
    result = case(gap, spacing=4e-6, normal_load=5.0).run()
    assert result.initial_gap.min() >= 0.0
    assert 284e-9 < float(result.approach[-1]) < 288e-9
    assert float(result.max_pressure[-1]) == pytest.approx(767e6, rel=0.05)  # of bilinear heights


@pytest.mark.parametrize("shape", ["terrace", "flank", "wall", "spike", "slope"])
def test_no_height_leaves_the_range_of_its_neighbours(shape: str) -> None:
    x, y = np.cumsum([0.0, *np.random.default_rng(2).uniform(0.5, 1.5, 40)]), np.arange(31.0)
    along = np.cos(0.4) * x[:, None] + np.sin(0.4) * y - 20.0
    heights = {
        "terrace": np.where(along > 0.0, 1.0, 0.0),
        "flank": np.clip(along, 0.0, 3.0),
        "wall": np.where(abs(along) < 1.5, 1.0, 0.0),
        "spike": np.where((abs(x[:, None] - x[20]) < 0.1) & (y == 15), 1.0, 0.0),
        "slope": np.where(along > 0.0, 20.0, 0.0) + 0.3 * along,
    }[shape]
    grid = HeightMap(x, y, heights)
    points = between(grid)
    least, most = grid._range(*points)
    found = grid(*points)
    beyond = np.maximum(found - most, least - found).max()
    assert beyond <= 5e-4 * np.ptp(heights)
    assert grid.overshoot <= 5e-4 * np.ptp(heights)
    spline = RectBivariateSpline(x, y, heights)
    assert np.maximum(spline.ev(*points) - most, least - spline.ev(*points)).max() > 0.05
    at_points = grid(*np.meshgrid(x, y, indexing="ij"))
    np.testing.assert_allclose(at_points, heights, atol=1e-12 * np.ptp(heights))


@pytest.mark.parametrize(
    "heights",
    [
        RADIUS**2,
        np.cos(2 * np.pi * X / 60e-6) + 0.2 * np.cos(2 * np.pi * Y / 80e-6)[:, None],
        np.tanh(X / 15e-6) + 0.0 * RADIUS,
        np.zeros(RADIUS.shape),
    ],
)
def test_smooth_heights_have_their_cubic_spline_to_the_bit(heights: np.ndarray) -> None:
    grid = HeightMap.of(on_grid(1e-6 * heights))
    points = between(grid)
    assert not grid.near_steps.any()
    np.testing.assert_array_equal(grid(*points), RectBivariateSpline(grid.x, grid.y, grid.gap).ev(*points))


def test_a_step_leaves_the_spline_far_from_it_to_the_bit() -> None:
    grid = HeightMap.of(on_grid(BALL + np.where(X > 0.2e-3, 4e-6, 0.0)))
    points = between(grid)
    far = points[0] < 0.0
    spline = RectBivariateSpline(grid.x, grid.y, grid.gap).ev(*points)
    np.testing.assert_array_equal(grid(*points)[far], spline[far])
    assert (grid(*points) != spline).any()


@pytest.mark.parametrize(
    "gap",
    [
        on_grid(BALL).where(~EVERYWHERE | (RADIUS < 0.15e-3)),
        on_grid(np.where(RADIUS < 0.2e-3, BALL, np.inf)),
        on_grid(np.where(RADIUS < 0.2e-3, BALL, np.nan)),
    ],
    ids=["scattered", "infinite", "beyond a circle"],
)
def test_holes_outside_of_the_contact_do_not_matter(gap: xr.DataArray) -> None:
    whole, holed = (case(heights).run() for heights in (on_grid(BALL), gap))
    assert float(holed.max_pressure[-1]) == pytest.approx(801.7e6, rel=1e-3)
    assert float(holed.max_pressure[-1]) == pytest.approx(float(whole.max_pressure[-1]), rel=1e-5)
    wider = Lattice.covering(8e-6, (0.0, 0.0), 0.5e-3, 0.5e-3)
    assert np.isinf(case(gap).initial_gap(wider)[0]).any()


def test_a_contact_near_a_hole_is_an_error_with_its_place() -> None:
    sentence = "gap: the contact of load step 1 comes within 2 points of a hole of the height map, at x = "
    assert complaint(on_grid(BALL).where(~EVERYWHERE)).startswith(sentence)
    one = on_grid(BALL)
    one.loc[{"x": X[53]}] = one.sel(x=X[53]).where(one.y != Y[30])  # at 130 um; the contact ends at 109
    assert complaint(one).startswith(f"{sentence}{quantity(X[53], 'm')}, y = 0 m; fill it")
    doubts = plausibility.warnings(case(on_grid(BALL).where(~EVERYWHERE)))
    assert any("holes of the height map lie near the estimated contact" in doubt for doubt in doubts)
    one.loc[{"x": X[45]}] = one.sel(x=X[45]).where(one.y != Y[30])
    assert any("1 hole of the height map lies near" in doubt for doubt in plausibility.warnings(case(one)))
    one = on_grid(BALL)
    one.loc[{"x": X[55]}] = one.sel(x=X[55]).where(one.y != Y[30])
    assert float(case(one).run().max_pressure[-1]) == pytest.approx(801.7e6, rel=1e-3)


def test_heights_of_the_wrong_sign_and_halves_of_a_contact_get_their_sentence() -> None:
    assert complaint(on_grid(1e-6 - BALL)).startswith("gap: the heights point the other way: ")
    half = on_grid(BALL).isel(x=slice(40, None))
    assert complaint(half).startswith(
        "gap: the lowest point of the map lies at its end, at x = 0 m, y = 0 m,"
    )
    blank = half.pad(x=3, constant_values=np.nan).assign_coords(x=np.arange(-3, 44) * 1e-5)
    assert complaint(blank).startswith(
        "gap: the lowest point of the map lies at its end, at x = 0 m, y = 0 m,"
    )
    at_end = "gap: the contact of load step 1 reaches the end of the height map"
    for center in ((0.4e-3, 0.3e-3), (-0.4e-3, 0.0)):
        assert complaint(on_grid(1e-6 - BALL), center=center).startswith(at_end)
    assert case(on_grid(0.0 * BALL + np.where(RADIUS > 0.2e-3, 1e-6, 0.0))).run().max_pressure[-1] > 0.0


@pytest.mark.parametrize(
    ("gap", "keys", "words"),
    [
        (on_grid(BALL), {}, ""),
        (on_grid(BALL), {"spacing": 0.9e-6}, "the points of the height map are 11 spacings apart"),
        (
            on_grid(BALL, X / 10, Y / 10) / 100,
            {"spacing": 6e-6, "normal_load": 0.02},
            "nodes are 6 points of",
        ),
    ],
)
def test_a_map_far_coarser_or_finer_than_the_lattice_is_named(gap: Any, keys: Any, words: str) -> None:
    doubts = [doubt for doubt in plausibility.warnings(case(gap, **keys)) if "height map" in doubt]
    assert len(doubts) == bool(words)
    assert words in "".join(doubts)


def test_the_overview_names_interpolation_and_overshoot() -> None:
    stepped = on_grid(np.where(RADIUS < 0.1e-3, 0.0, 1e-6) + RADIUS**2 / 0.1)
    stepped[0, 5] = np.nan
    between_points = on_grid(np.hypot(*np.meshgrid(X - 5e-6, Y - 5e-6)) ** 2 / 20e-3)
    rows = [dict(case_rows(case(gap)))["gap"] for gap in (between_points, stepped)]
    assert rows[0] == "map of 81 x 61 points, 10.0 µm apart; cubic spline; largest overshoot 2.5 nm"
    assert rows[1].startswith(
        "map of 81 x 61 points, 10.0 µm apart, 1 without a height; cubic spline, kept in the"
    )
    assert rows[1].endswith("points at steps and holes; largest overshoot 0 m")


def test_a_map_without_any_height_is_refused() -> None:
    for values in (np.nan * BALL, np.inf + BALL, -np.inf + BALL):
        assert complaint(on_grid(values)).startswith("gap: expected heights, NaN in holes, and inf where")


@pytest.mark.parametrize("shape", [(2, 2), (2, 5), (3, 3), (5, 2)])
def test_a_map_of_few_points_has_its_heights(shape: tuple[int, int]) -> None:
    x, y = (np.arange(float(count)) for count in shape)
    heights = np.random.default_rng(0).random(shape)
    grid = HeightMap(x, y, heights)
    np.testing.assert_allclose(grid(*np.meshgrid(x, y, indexing="ij")), heights, atol=1e-15)
    heights[0, 0] = np.nan
    holed = HeightMap(x, y, heights)
    assert np.isinf(holed(np.array([0.5]), np.array([0.5]))).all()
    assert "1 without a height" in str(holed)
