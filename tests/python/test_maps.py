"""Measured surfaces of decks: files, units, levelling, holes, windows that repeat, what check prints."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from commands import inside

from hexcontact import Case, DeckError, open_result
from hexcontact.cli import printed
from hexcontact.cli.report import report
from hexcontact.deck import map_file
from hexcontact.deck.map_file import read_map
from hexcontact.plotting import surface
from hexcontact.problem import plausibility
from hexcontact.problem.preview import case_rows, surfaces_in_words
from hexcontact.surfaces import Map, Profile

ROOT = Path(__file__).parents[2]
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
X, Y = np.linspace(-400.0, 400.0, 81), np.linspace(-300.0, 300.0, 61)  # um
BALL = 5.0 - (X**2 + Y[:, None] ** 2) / 20e3  # heights of a ball of 10 mm, a row for each y
HERTZ = 801.7e6  # its largest pressure under 20 N (Pa)
MATRIX = {"units": "um", "height_units": "um", "extent": ["800 um", "600 um"]}
WAVE = 64  # points of a wave of 640 um
CELL = {"boundary": "periodic", "extent": ["640 um", "640 um"], "nodes_across": 64}


def rows_of(heights: Any) -> str:
    """Return a matrix as text, as it lies on a page: the first row has the largest y."""
    return "\n".join(",".join(f"{value:.9g}" for value in row) for row in np.asarray(heights)[::-1])


def columns_of(heights: Any, order: Any = None, headers: str = "x [um], y [um], z [um]") -> str:
    x, y = np.meshgrid(X, Y)
    points = np.stack([x, y, heights], axis=-1).reshape(-1, 3)
    chosen = points if order is None else points[order]
    return "\n".join([headers, *(f"{a:.9g}, {b:.9g}, {c:.9g}" for a, b, c in chosen)])


def netcdf_of(heights: Any, **units: str) -> xr.DataArray:
    """Return heights with units of x, y and themselves."""
    found = xr.DataArray(heights, dims=("y", "x"), coords={"x": X, "y": Y}, name="height")
    for name, unit in units.items():
        (found if name == "height" else found[name]).attrs["units"] = unit
    return found


@pytest.fixture
def file(tmp_path: Path) -> Any:
    def write(name: str, content: Any) -> str:
        path = tmp_path / name
        if isinstance(content, str):
            path.write_text(content)
        elif name.endswith(".npy"):
            np.save(path, content)
        else:
            content.to_netcdf(path)
        return str(path)

    return write


def case(surface: Any, load: Any = None, other: Any = None, **grid: Any) -> Case:
    two = STEEL if other is None else {**STEEL, "surface": other}
    deck = {"body": {"1": {**STEEL, "surface": surface}, "2": two}, "grid": grid or {"spacing": 8e-6}}
    return Case.from_dict({**deck, "load": [load or {"normal_load": 20.0}]})


def of_file(name: str, **keys: Any) -> dict[str, Any]:
    return {"shape": "map", "file": name, "upwards": True, **keys}


def complaint(surface: Any, **keys: Any) -> str:
    with pytest.raises(DeckError) as error:
        case(surface, **keys).run()
    return str(error.value)


def largest(surface: Any, **keys: Any) -> float:
    return float(case(surface, **keys).run().max_pressure[-1])


# --- files --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "keys"),
    [
        ("ball.csv", rows_of(BALL), MATRIX),
        ("ball.txt", "# made by a profiler\n" + rows_of(BALL).replace(",", "\t") + "\n", MATRIX),
        ("tail.csv", rows_of(BALL).replace("\n", ",\n") + ",", MATRIX),
        ("spaced.csv", rows_of(BALL), {**MATRIX, "extent": None, "spacing": ["10 um", "0.01 mm"]}),
        ("down.csv", rows_of(BALL[::-1]), {**MATRIX, "first_row": "bottom"}),
        ("ball.npy", BALL[::-1], MATRIX),
        ("xyz.csv", columns_of(BALL), {}),
        ("mixed.xyz", columns_of(BALL, np.random.default_rng(1).permutation(BALL.size)), {}),
        (
            "named.csv",
            columns_of(BALL, headers="# x,y,u"),
            {"variable": "u", "units": "um", "height_units": "um"},
        ),
        ("ball.nc", netcdf_of(BALL, x="um", y="um", height="um"), {}),
        (
            "turned.nc",
            netcdf_of(BALL, x="um", y="um", height="um").transpose("x", "y")[::-1],
            {"units": "um"},
        ),
        ("gap.csv", rows_of(5.0 - BALL), {**MATRIX, "upwards": False}),
    ],
)
def test_every_kind_of_file_gives_the_same_surface(file: Any, name: str, content: Any, keys: Any) -> None:
    given = {key: value for key, value in keys.items() if value is not None}
    surface = case(of_file(file(name, content), **given)).body_1.surface
    assert isinstance(surface, Map)
    x, y = np.random.default_rng(2).uniform(-250e-6, 250e-6, (2, 50))
    np.testing.assert_allclose(surface.height(x, y), (x**2 + y**2) / 20e-3, atol=2e-14)


def test_a_ball_from_a_file_has_the_pressure_of_hertz_and_its_own_orientation(file: Any) -> None:
    x, y = X - 120.0, Y[:, None] - 80.0
    surface = of_file(file("ball.csv", rows_of(-(x**2 + y**2) / 20e3)), **MATRIX)
    result = case(surface).run()
    assert float(result.max_pressure[-1]) == pytest.approx(HERTZ, rel=1e-3)
    touch = case(surface).deck.body.separation.first_touch
    assert touch == pytest.approx((120e-6, 80e-6, 0.0))
    moved = case({**surface, "center": ["1 mm", "0 mm"], "offset": ["0 mm", "2 mm"]})
    assert moved.deck.body.separation.first_touch == pytest.approx((1.12e-3, 2.08e-3, 0.0))


@pytest.mark.parametrize(
    ("name", "content", "keys", "words"),
    [
        (
            "a.csv",
            "1,2,3,4\n1,2,3\n1,2,3,4,5\n",
            MATRIX,
            "line 2: expected 4 cells, not 3; line 3: expected 4",
        ),
        ("a.csv", "1,2,3,4\n1,b,3,4\n", MATRIX, 'line 2, cell 2: expected a number, not "b"'),
        ("a.csv", "1;2;3;4\n1;2,5;3;4\n", MATRIX, 'not "2,5"; a number has a decimal point'),
        ("a.csv", "1;2,5;3;4\n1;2;3;4\n", MATRIX, 'line 1, cell 2: expected a number, not "2,5"; a number'),
        (
            "a.csv",
            "1,2,3\n4,5,6\n",
            MATRIX,
            "three columns without headers are a matrix, or columns of coord",
        ),
        (
            "a.csv",
            "x,y\n4,5\n",
            MATRIX,
            'expected one column "z", "h", "height" or "heights" among its headers "x"',
        ),
        ("a.csv", "1,2,3,4\n", MATRIX, "expected at least two points along each axis"),
        (
            "a.csv",  # with x above and y beside the heights
            rows_of(np.vstack([np.column_stack([Y, BALL]), [np.nan, *X]])),
            MATRIX,
            "the first row and the first column rise evenly, as coordinates and numbers of columns do",
        ),
        ("a.csv", rows_of(np.vstack([BALL, np.arange(81.0)])), MATRIX, "the first row rises evenly"),
        ("a.csv", "# nothing\n", MATRIX, "is empty; expected heights as text"),
        (
            "a.csv",
            rows_of(np.where(BALL > 4.9, np.inf, BALL)),
            MATRIX,
            "expected finite heights, and NaN or nothing",
        ),
        (
            "a.csv",
            rows_of(BALL),
            {**MATRIX, "variable": "z"},
            "has no variables; expected nothing as variable",
        ),
        (
            "a.csv",
            columns_of(BALL) + "\n0,0,1",
            {},
            "expected each point once; that of line 2472 occurs again",
        ),
        ("a.csv", columns_of(BALL) + "\nnan,0,1", {}, "line 4943: expected finite coordinates x and y"),
        (
            "a.csv",
            "x,y,z\n" + "\n".join(f"{n},{n * n % 37},0" for n in range(40)),
            MATRIX,
            "of a rectangular grid: 40",
        ),
        ("a.csv", columns_of(BALL, headers="x [um],y [mm],z"), {}, 'x and y in one unit, not "um" and "mm"'),
        ("a.npy", BALL + 0j, MATRIX, "expected an array of real numbers"),
        ("a.npy", np.zeros((3, 3, 3)), MATRIX, "expected a map over x and y, not values of 3 dimensions"),
        ("a.nc", netcdf_of(BALL, x="um", y="m", height="um"), {}, 'x and y in one unit, not "um" and "m"'),
        (
            "a.nc",
            netcdf_of(BALL, x="um", y="um", height="K"),
            {},
            'expected lengths in the file, not values in "K"',
        ),
        ("a.nc", netcdf_of(BALL)[:, [0, 0, 1]], {}, "expected each x once; some occur twice"),
        ("a.nc", netcdf_of(BALL).rename(x="u"), {}, "expected one variable with the coordinates x and y in"),
        (
            "a.nc",
            netcdf_of(BALL).to_dataset().assign(b=netcdf_of(BALL)),
            {},
            "not 2; choose one with variable",
        ),
    ],
)
def test_a_file_that_is_no_map_is_refused(file: Any, name: str, content: Any, keys: Any, words: str) -> None:
    found = complaint(of_file(file(name, content), **keys))
    assert found.startswith('body.1.surface.file = "')
    assert words in found
    assert len(found.splitlines()) == 1


def test_a_round_map_of_growing_distances_is_read(file: Any) -> None:
    at = np.concatenate([-(2.0 ** np.arange(10, 3, -1)), np.arange(-8, 9), 2.0 ** np.arange(4, 11)])
    x, y = (c.ravel() for c in np.meshgrid(at, at))
    inside = np.hypot(x, y) <= 1024.0
    rows = [f"{u:g},{v:g},{-(u**2 + v**2) / 20e3:.9g}" for u, v in zip(x[inside], y[inside], strict=True)]
    named = of_file(file("round.csv", "\n".join(["x (um),y (um),z (um)", *rows])), holes="open")
    assert Map(**named).field.gap.shape == (len(at), len(at))


def test_two_lines_of_points_are_a_map(file: Any) -> None:
    rows = [f"{x},{y},0" for x in range(41) for y in (0.0, 5.0)]
    named = of_file(file("lines.csv", "\n".join(["x (um),y (um),z (um)", *rows])))
    assert Map(**named).field.gap.shape == (41, 2)


def test_a_coordinate_that_few_points_have_is_refused(file: Any) -> None:
    lines = columns_of(BALL).splitlines()
    x, rest = lines[1300].split(",", 1)
    lines[1300] = f"{float(x) + 1.3},{rest}"
    found = complaint(of_file(file("a.csv", "\n".join(lines)), holes="fill"))
    assert "line 1301: expected points of a rectangular grid: few have x = -368.7, beside -370" in found
    for more in (5.0, 2500.0):  # half a step, and beyond the others
        lines[1300] = f"{float(x) + more},{rest}"
        found = complaint(of_file(file("a.csv", "\n".join(lines)), holes="fill"))
        assert f"line 1301: expected points of a rectangular grid: few have x = {float(x) + more:g}" in found
    jitter = np.random.default_rng(1).uniform(0.0, 1e-3, BALL.shape)
    x, y = np.meshgrid(X, Y)
    points = np.stack([x + jitter, y, BALL], axis=-1).reshape(-1, 3)
    jittered = "\n".join(["x [um], y [um], z [um]", *(f"{a:.4f}, {b}, {c}" for a, b, c in points)])
    assert "some nearly the same; round them" in complaint(of_file(file("d.csv", jittered), holes="fill"))
    disc = (X**2 + Y[:, None] ** 2 <= 300.0**2).ravel()  # has few points in its first rows
    assert case(of_file(file("b.csv", columns_of(BALL, disc)), holes="fill"))
    stretched = columns_of(BALL).replace("\n-400, ", "\n-405, ")
    rows = case_rows(case(of_file(file("c.csv", stretched))))
    assert any("apart; 10.0 µm to 15.0 µm in x, " in row[1] for row in rows)


def test_an_extent_that_may_be_swapped_is_noted(file: Any) -> None:
    name = file("a.csv", rows_of(BALL[10:51]))  # points 10 um apart, 800 um by 400 um
    swapped = case(of_file(name, **{**MATRIX, "extent": ["390 um", "810 um"]}), load={"normal_load": 1.0})
    found = plausibility.unjudged(swapped)
    assert found.startswith("the extent of the map of body 1 may be swapped: expected the length in x first")
    assert "points 4.88 um apart in x and 20.2 um in y, and with the two swapped 10.1 um and 9.75 um" in found


def test_a_large_map_is_refused_before_it_is_read(file: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_file, "MOST_POINTS", BALL.size - 1)
    for name, content in (("a.csv", rows_of(BALL)), ("b.csv", columns_of(BALL)), ("c.npy", BALL)):
        found = complaint(of_file(file(name, content), **MATRIX))
        assert "expected a map of at most 4,940 points, not 4,941; choose a part of it" in found


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({}, 'height_units: missing; expected the unit, such as "um": PATH does not say it'),
        (
            {"units": "px"},
            'units = "px": expected a unit of length such as "um"; "px" is a size of print and screens',
        ),
        ({"units": "kg"}, 'units = "kg": expected a unit of length such as "um"; "kg" is a mass'),
        (
            {"height_units": "um"},
            "extent: missing; expected extent or spacing: PATH has no coordinates",
        ),
        (
            {**MATRIX, "extent": ["600 um", "800 um"]},
            "extent: expected the length in x first: the 61 rows and 81 columns of ball.csv have points "
            "7.5 um apart in x and 13.3 um in y, and with the two swapped 10 um and 10 um; or give spacing",
        ),
        (
            {**MATRIX, "spacing": [1e-5, 1e-5]},
            "spacing = [1e-05, 1e-05]: expected extent or spacing, not both",
        ),
        ({**MATRIX, "heights": [[0.0]]}, "heights = [[0.0]]: expected a file or points, not both"),
        ({**MATRIX, "level": True}, 'level = true: expected false, "mean" or "plane"'),
        (
            {**MATRIX, "upwards": False},
            ": the heights point the other way: the lowest point of the map lies at its end, the highest "
            "inside; expected upwards = true",
        ),
        (
            {**MATRIX, "taper": "50 um"},
            ': expected no taper but in a window that repeats, grid.boundary = "periodic"',
        ),
    ],
)
def test_keys_that_are_missing_or_contradict_are_named(file: Any, keys: Any, sentence: str) -> None:
    found = complaint(of_file(path := file("ball.csv", rows_of(BALL)), **keys))
    expected = sentence.replace("PATH", path)
    assert found == f"body.1.surface{'' if expected[0] == ':' else '.'}{expected}"


def test_keys_that_the_file_answers_are_refused_if_they_differ(file: Any) -> None:
    path = file("ball.nc", netcdf_of(BALL, x="um", y="um", height="um"))
    assert complaint(of_file(path, units="mm")).endswith(
        'units = "mm": expected nothing, or "um" as in the file'
    )
    assert complaint(of_file(path, spacing=[1e-5, 1e-5])).endswith(
        f"spacing: expected nothing, since {path} has coordinates x and y"
    )
    bare = file("bare.nc", netcdf_of(BALL, x="um", y="um"))
    assert "height_units: missing; expected the unit" in complaint(of_file(bare))
    assert largest(of_file(bare, height_units="um")) == pytest.approx(HERTZ, rel=1e-3)
    assert complaint({"shape": "map", "file": path}).endswith("upwards: missing; expected true or false")
    assert "file: missing; expected the name of a file" in complaint({"shape": "map", "upwards": True})
    two = {"x": [0.0, 1.0], "y": [0.0, 1.0], "heights": [[0.0, 1.0], [1.0, 2.0]]}
    assert 'units = "um": expected nothing beside points' in complaint(of_file("", units="um", **two))
    holed = {**two, "heights": [[0.0, 1.0], [np.nan, 2.0]]}
    assert "holes: 1 point has no height, at x = 1.000 m, y = 0 m" in complaint(of_file("", **holed))
    for key in two:
        wrong = {**two, key: [[np.inf, 0.0], [1.0, 0.0]] if key == "heights" else [np.nan, 0.0]}
        assert "heights: expected finite numbers, and NaN in holes" in complaint(of_file("", **wrong))
    assert "surface.heights: expected numbers at all points" in complaint(
        of_file("", **{**two, "x": [1.0, 1.0]})
    )
    assert "heights: expected 2 arrays of 2 numbers, over y for each x" in complaint(
        of_file("", **{**two, "heights": [[0.0, 1.0]]})
    )


def test_formats_of_microscopes_are_read_by_surface_topography(
    file: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library is missing, then a stand-in with the parts that are called."""
    path = file("scan.opd", "abc")
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    missing = (
        "this format is read by the package SurfaceTopography: pip install SurfaceTopography; without it"
    )
    assert missing in complaint(of_file(path))
    channels = [
        SimpleNamespace(
            name=name,
            nb_grid_pts=BALL.T.shape,
            physical_sizes=sizes,
            topography=lambda physical_sizes=(810.0, 610.0): SimpleNamespace(
                heights=lambda: np.ma.masked_greater(BALL.T, 4.9999),
                unit="µm",
                is_uniform=True,
                physical_sizes=physical_sizes,
            ),
        )
        for name, sizes in (("Height", (810.0, 610.0)), ("Phase", None))
    ]

    class Reader(SimpleNamespace):
        def __enter__(self) -> Any:
            return self

        def __exit__(self, *_: object) -> None: ...

    def opened(_: str) -> Any:
        return Reader(channels=channels)

    monkeypatch.setitem(sys.modules, "SurfaceTopography", SimpleNamespace(open_topography=opened))
    assert 'expected a variable, one of "Height" and "Phase"' in complaint(of_file(path))
    assert 'one of its channels "Height" and "Phase" as variable, not "z"' in complaint(
        of_file(path, variable="z")
    )
    map_file._read.cache_clear()
    found = read_map(Path(path), "Height")
    assert (found.units, found.value_units) == ("µm", "µm")
    assert found.x is not None
    np.testing.assert_allclose(found.x, X + 400.0, atol=1e-12)
    assert np.isnan(found.values).sum() == 1
    assert "holes: 1 point has no height" in complaint(of_file(path, variable="Height"))
    unsized = of_file(path, variable="Phase", holes="fill")
    assert "extent: missing; expected extent or spacing" in complaint(unsized)
    surface: Any = case({**unsized, "extent": ["800 um", "600 um"], "first_row": "bottom"}).body_1.surface
    np.testing.assert_allclose(surface.points.z, 1e-6 * np.ma.masked_greater(BALL.T, 4.9999).filled(np.nan))


def test_a_file_of_surface_topography_itself(tmp_path: Path) -> None:
    library = pytest.importorskip("SurfaceTopography")
    library.Topography(BALL.T, (810.0, 610.0), unit="um").to_matrix(str(tmp_path / "ball.asc"))
    found = read_map(tmp_path / "ball.asc")
    np.testing.assert_allclose(found.values, BALL.T, rtol=1e-12)
    np.savetxt(tmp_path / "bare.asc", BALL)
    np.testing.assert_allclose(read_map(tmp_path / "bare.asc").values, BALL, rtol=1e-12)


# --- levelling, holes, steps, interpolation -----------------------------------------------------------------


def test_a_tilted_map_is_levelled_as_asked(file: Any) -> None:
    random = np.random.default_rng(4)
    rough = 0.02 * np.cos(2 * np.pi * np.add.outer(Y, X) / 100.0 + random.uniform(0, 6))
    path = file("rough.csv", rows_of(rough + 3.0 + 1e-3 * X + 2e-3 * Y[:, None]))
    flat, mean, raw = (Map(**of_file(path, level=level, **MATRIX)) for level in ("plane", "mean", False))
    assert flat.plane == pytest.approx((3e-6, 1e-3, 2e-3), rel=2e-3)
    assert mean.plane == pytest.approx((3e-6, 0.0, 0.0), rel=1e-2)
    assert raw.plane == (0.0, 0.0, 0.0)
    assert np.ptp(flat.field.gap) == pytest.approx(4e-8, rel=2e-2)
    np.testing.assert_allclose(mean.field.gap, raw.field.gap, atol=1e-19)
    assert "levelled: mean of 3.00 µm and slopes of 0.001 along x, 0.002 along y subtracted" in "".join(
        flat.rows(lambda _: 1e-6)
    )


def test_holes_are_refused_opened_or_filled(file: Any) -> None:
    holed = BALL.copy()
    holed[5, 8] = holed[30:33, 39:42] = np.nan  # one at the edge of the map, nine at the top of the ball
    surface = of_file(file("holes.csv", rows_of(holed).replace("nan", "")), **MATRIX)
    sentence = (
        "body.1.surface.holes: 10 points have no height, one of them at x = 10.00 µm, y = 20.00 µm; exp"
    )
    assert complaint(surface).startswith(sentence)
    filled = case({**surface, "holes": "fill"})
    assert float(filled.run().max_pressure[-1]) == pytest.approx(HERTZ, rel=0.1)  # flat at the top
    assert filled.run().dataset.attrs["notes"] == "10 holes of the map of body 1 are filled, not measured"
    rows = " ".join(row[1] for row in case_rows(filled))
    assert "10 holes filled with the means of their neighbors" in rows
    holed[30:33, 39:42] = BALL[30:33, 39:42]
    one = case({**of_file(file("hole.csv", rows_of(holed).replace("nan", "")), **MATRIX), "holes": "fill"})
    assert "; 1 hole filled with" in " ".join(row[1] for row in case_rows(one))
    assert "1 hole of the map of body 1 is filled" in plausibility.unjudged(one)
    opened = case({**surface, "holes": "open"})
    gap = opened.initial_gap(opened.lattice)[0]
    assert np.isinf(gap[np.hypot(opened.lattice.x, opened.lattice.y) < 10e-6]).all()
    assert float(opened.run().max_pressure[-1]) > 1.2 * HERTZ  # a punch with a hole
    assert "10 holes open: nothing touches there" in " ".join(row[1] for row in case_rows(opened))
    linear = case({**surface, "holes": "open", "interpolation": "linear"})
    assert np.isinf(linear.initial_gap(linear.lattice)[0]).any()


def test_filled_heights_are_means_of_their_neighbors() -> None:
    random = np.random.default_rng(0)
    heights = random.random((9, 11))
    holed = np.where(random.random(heights.shape) < 0.4, np.nan, heights)
    points = {"x": np.arange(9.0), "y": np.arange(11.0), "heights": holed}
    found = Map(upwards=False, holes="fill", **points).field.gap
    padded = np.pad(found, 1, constant_values=np.nan)
    beside = np.stack([padded[2:, 1:-1], padded[:-2, 1:-1], padded[1:-1, 2:], padded[1:-1, :-2]])
    np.testing.assert_allclose(
        found[np.isnan(holed)], np.nanmean(beside, axis=0)[np.isnan(holed)], rtol=1e-12
    )
    assert np.isnan(holed).sum() > 30


def test_linear_interpolation_is_bilinear() -> None:
    grid = Map(
        upwards=False, interpolation="linear", x=[0.0, 1.0], y=[0.0, 2.0], heights=[[0.0, 1.0], [2.0, 5.0]]
    )
    assert float(grid.height(0.5, 1.0)) == pytest.approx(2.0)
    assert "bilinear" in " ".join(grid.rows(lambda _: 1.0))


def test_a_step_in_a_file_has_no_ridges(file: Any) -> None:
    radius = np.hypot(X, Y[:, None])
    terrace = of_file(file("t.csv", rows_of(np.where(radius < 100.0, 0.0, 1.0) + radius**2 / 1e5)), **MATRIX)
    result = case({**terrace, "upwards": False}, {"normal_load": 5.0}, spacing=4e-6).run()
    assert result.initial_gap.min() >= 0.0
    assert 284e-9 < float(result.approach[-1]) < 290e-9  # 244 through ridges of 101 nm


# --- windows ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("grid", "words"),
    [
        (
            {"extent": ["900 um", "600 um"]},
            "x from -0.45 mm to 0.45 mm, the map x from -0.4 mm to 0.4 mm only",
        ),
        ({"extent": ["600 um", "800 um"]}, "heights of a larger part; are x and y swapped?"),
        ({"window": [90, 90]}, "x from -0.54 mm to 0.528 mm and y from -0.312 mm to 0.305 mm, the map"),
    ],
)
def test_a_window_larger_than_the_map_is_refused(file: Any, grid: Any, words: str) -> None:
    found = complaint(of_file(file("ball.csv", rows_of(BALL)), **MATRIX), spacing=8e-6, **grid)
    assert found.startswith(f"grid.{next(iter(grid))} = ")
    assert "the window is larger than the map of body.1.surface: " in found
    assert words in found


def test_a_contact_at_the_end_of_the_map_is_refused(file: Any) -> None:
    half = of_file(file("half.csv", rows_of(BALL[:, 36:])), **{**MATRIX, "extent": ["440 um", "600 um"]})
    reached = "reaches the end of the height map; expected heights of"
    assert complaint(half).startswith(f"body.1.surface: the estimated contact {reached}")
    moved = {**half, "offset": ["30 um", "0 um"]}
    assert complaint([moved, {"shape": "flat"}]).startswith(
        f"body.1.surface.1: the estimated contact {reached}"
    )
    layer = {"law": "power", "coefficient": 1e16, "exponent": 1}  # beside which no estimate is unbounded
    bodies = {"1": {**STEEL, "surface": half}, "2": STEEL}
    rest = {"grid": {"spacing": 8e-6}, "load": [{"normal_load": 20.0}], "interface": layer}
    with pytest.raises(DeckError, match=f"^body.1.surface: the contact of load step 1 {reached}"):
        Case.from_dict({"body": bodies, **rest}).run()
    quarter = of_file(
        file("quarter.csv", rows_of(BALL[:, 40:])), **{**MATRIX, "extent": ["400 um", "600 um"]}
    )
    lowest = "body.1.surface: the lowest point of the map lies at its end, at x ="
    assert f"{lowest} -200.0 µm" in complaint(quarter)
    assert f"{lowest} -170.0 µm" in complaint({**quarter, "offset": ["30 um", "0 um"]})


def test_a_second_summit_outside_of_the_window_is_told(file: Any) -> None:
    """Two caps 400 um apart: the window about the higher one has one of two contacts."""
    two = np.maximum(-((X + 200.0) ** 2), -((X - 200.0) ** 2) - 2e3)
    heights = rows_of((two - Y[:, None] ** 2) / 20e3)
    named = of_file(file("two.csv", heights), **MATRIX)
    load = {"normal_load": 8.0}
    missed = r"grid\.extent: load step 1: the bodies also touch outside of the window, near x = "
    with pytest.raises(DeckError, match=missed):
        case(named, load=load).run()
    with pytest.raises(DeckError, match=missed):
        case(named, load=load).changed({"accuracy": {"target": 0.02}}).run()
    both = case(named, load=load, spacing=8e-6, extent=["640 um", "280 um"], center=[0.0, 0.0]).run()
    pressure = both.dataset.pressure[-1].values
    assert 0.6 < pressure[:, : pressure.shape[1] // 2].sum() / pressure.sum() < 0.9
    assert case(named, load={"normal_load": 0.05}).run().complete  # the other one is too low
    waves_of_one_direction = {"shape": "formula", "expression": "x**2*50 + sin(y*1e4)*1e-6 + 1e-6"}
    with pytest.raises(DeckError, match=missed):
        case(waves_of_one_direction, load=load, nodes_in_radius=10).run()
    assert "no end" in complaint(
        {"shape": "formula", "expression": "sin(x*1e4)*1e-6 + 1e-6"}, nodes_in_radius=10
    )


BOWL = "x**2*2 + y**2*2"  # of 0.25 m radius
MISSED = {  # gaps that also touch outside of a window about 0, 0 under 8 N
    # beyond an acute corner of the parallelogram of a window, within its smallest rectangle
    "corner": f"min({BOWL}, ((x + 0.5e-3)**2 + (y - 0.25e-3)**2)*20 + 0.1e-6)",
    "narrow": f"min({BOWL}, ((x - 0.9e-3)**2 + (y - 0.1e-3)**2)*2e3 + 0.1e-6)",
    "constant": f"min({BOWL}, ((x - 0.9e-3)**2 + y**2)*20 + 0.1e-6) + 50e-6",
    "far": f"min({BOWL}, ((x - 20e-3)**2 + y**2)*2 + 0.2e-6)",
}


@pytest.mark.parametrize("expression", MISSED.values(), ids=MISSED)
def test_bodies_that_also_touch_elsewhere_are_told(expression: str) -> None:
    formula = {"shape": "formula", "expression": expression}
    with pytest.raises(DeckError, match="the bodies also touch outside of the window, near x = "):
        case(formula, load={"normal_load": 8.0}, nodes_in_radius=10).run()


def test_a_constant_of_a_formula_raises_no_false_alarm() -> None:
    formula = {"shape": "formula", "expression": f"{BOWL} + x**4 - 1e-3"}
    assert case(formula, load={"normal_load": 8.0}, nodes_in_radius=10).run().complete


def test_a_narrow_summit_of_a_large_map_is_seen() -> None:
    """A bowl of 801 x 801 points with one point outside of the window that touches."""
    from hexcontact.problem.window import surroundings

    at = np.linspace(-2e-3, 2e-3, 801)
    heights = 2.0 * (at[:, None] ** 2 + at**2)
    heights[613, 207] = 0.02e-6
    keys = {"upwards": False, "interpolation": "linear"}
    surface = {"shape": "map", "x": at.tolist(), "y": at.tolist(), "heights": heights.tolist(), **keys}
    problem = case(surface, load={"normal_load": 2.0}, spacing=8e-6)
    points = surroundings(problem.plane_gap, problem.lattice).points
    x, y, gap = points[:, points[2].argmin()]
    assert (x, y, gap) == pytest.approx((at[613], at[207], 0.02e-6), rel=1e-6)


def waves(points: int) -> Any:
    at = 2 * np.pi * np.arange(points) / WAVE
    return 0.5 * np.cos(at) + 0.5 * np.cos(at)[:, None]


def test_a_map_of_one_period_repeats_with_or_without_its_last_point(file: Any) -> None:
    keys = {"units": "um", "height_units": "um", "spacing": ["10 um", "10 um"]}
    load = {"mean_pressure": "100 MPa"}
    expression = "1e-6 - 0.5e-6*cos(2*pi*x/640e-6) - 0.5e-6*cos(2*pi*y/640e-6)"
    formula = largest({"shape": "formula", "expression": expression}, load=load, **CELL)
    for points in (WAVE, WAVE + 1):
        first = {"center": [5e-6 * (points - 1), 5e-6 * (points - 1)]}  # so that the first point is a node
        surface = of_file(file(f"{points}.csv", rows_of(waves(points))), **keys, **first)
        assert largest(surface, load=load, **CELL) == pytest.approx(formula, rel=1e-4)
        x, y = np.random.default_rng(7).uniform(-1e-3, 2e-3, (2, 500))
        exact = 1e-6 - 0.5e-6 * (np.cos(2 * np.pi * x / 640e-6) + np.cos(2 * np.pi * y / 640e-6))
        heights = Map(**surface).repeating((640e-6, 640e-6)).height(x, y)
        np.testing.assert_allclose(heights, exact, atol=1e-11)
        moved = {**surface, "offset": ["0.13 mm", "0.07 mm"]}
        assert largest(moved, load=load, **CELL) == pytest.approx(formula, rel=1e-2)


def test_a_tapered_map_is_told_and_drawn_as_it_is_solved(file: Any) -> None:
    keys = {"units": "um", "height_units": "um", "spacing": ["10 um", "10 um"], "taper": "100 um"}
    path = file("tilted.csv", rows_of(waves(WAVE + 1) + np.arange(WAVE + 1) / WAVE))
    tapered = case(of_file(path, **keys), {"mean_pressure": "100 MPa"}, **CELL)
    [told] = surfaces_in_words(tapered)
    assert any("tapered over 100.0 µm at its ends" in line for line in told["lines"])
    [axes] = surface(tapered).axes
    [bar] = axes.child_axes
    drawn = np.asarray(axes.collections[0].get_array()).reshape(-1)
    x, y, gap = tapered.lattice.x, tapered.lattice.y, tapered.plane_gap.over(tapered.lattice)
    units = {"(mm)": 1e-3, "(µm)": 1e-6, "(nm)": 1e-9}
    scale, rise = (units[words.split()[-1]] for words in (axes.get_xlabel(), bar.get_ylabel()))
    assert np.ptp(drawn) * rise == pytest.approx(np.ptp(gap), rel=0.02)
    lowest = np.unravel_index(gap.argmin(), gap.shape)
    cross = axes.lines[-1].get_xydata()[0] * scale
    np.testing.assert_allclose(cross, [x[lowest], y[lowest]], atol=tapered.lattice.spacing)


def test_a_picture_shows_surfaces_that_repeat_over_the_window(file: Any) -> None:
    """Points of the files lie on one side of the middle of the window, and half of them outside."""
    at = 10.0 * np.arange(WAVE)
    x, y = np.meshgrid(at, at)
    points = "\n".join(f"{u},{v},{h:.9g}" for u, v, h in zip(x.flat, y.flat, waves(WAVE).flat, strict=True))
    grid = of_file(file("grid.csv", "x [um], y [um], z [um]\n" + points), offset=["0.9 mm", "0 mm"])
    lines = "\n".join(f"{v},{np.cos(2 * np.pi * v / 640):.9g}" for v in at)
    profile = {"shape": "profile", "upwards": True, "file": file("p.csv", "y [um], z [um]\n" + lines)}
    made = case(grid, {"mean_pressure": "100 MPa"}, other=profile, **CELL)
    map_axes, line_axes = surface(made).axes[:2]
    assert np.ma.count_masked(map_axes.collections[0].get_array()) == 0
    ends = np.ptp(made.lattice.outline, axis=0) * 1e6
    assert map_axes.collections[0].get_coordinates()[-1, -1, 0] == pytest.approx(ends[0] / 2, rel=0.03)
    touch = map_axes.lines[-1].get_xydata()[0]
    assert np.all(np.abs(touch) < ends / 2)
    across, height = line_axes.lines[0].get_data()
    dashed = [line.get_xdata()[0] for line in line_axes.lines[1:]]
    assert (across[0], across[-1]) == pytest.approx(sorted(dashed))
    np.testing.assert_allclose(height, np.cos(2 * np.pi * across / 640) - 1, atol=1e-3)


def test_a_map_that_does_not_repeat_is_refused_levelled_or_tapered(file: Any) -> None:
    keys = {"units": "um", "height_units": "um", "spacing": ["10 um", "10 um"]}
    load = {"mean_pressure": "100 MPa"}
    path = file("tilted.csv", rows_of(waves(WAVE + 1) + np.arange(WAVE + 1) / WAVE))
    start = 'grid.boundary = "periodic": '
    step = f"{start}the map does not repeat: between its opposite ends in x it steps by 1 um, between "
    surface = of_file(path, **keys)
    assert complaint(surface, load=load, **CELL).startswith(step)
    level = largest({**surface, "level": "plane"}, load=load, **CELL)
    plain = of_file(file("waves.csv", rows_of(waves(WAVE + 1))), **keys)
    assert level == pytest.approx(largest(plain, load=load, **CELL), rel=1e-6)
    tapered = case({**surface, "taper": "100 um"}, load, **CELL)
    gap = tapered.initial_gap(tapered.lattice)[0]
    assert abs(gap[:, 0] - gap[:, -1]).max() < 1.5 * abs(np.diff(gap, axis=1)).max()
    assert "taper: expected at most half of the map in x" in complaint(
        {**surface, "taper": "400 um"}, load=load, **CELL
    )
    wide = {**surface, "spacing": ["11 um", "10 um"]}
    assert (
        "the window repeats every 0.64 mm in x; expected 0.715 mm, as the 65 points of the map, or 0.704 mm"
        in (complaint(wide, load=load, **CELL))
    )
    grooves = waves(WAVE + 1)[:1] + 0.1 * np.arange(WAVE + 1) / WAVE + np.zeros((WAVE + 1, 1))
    surface = of_file(file("grooves.csv", rows_of(grooves)), **keys)  # alike along y, but for rounding
    assert largest({**surface, "level": "plane"}, load=load, **CELL) > 0.0
    rhombus = {**CELL, "cell_angle": "60 deg"}
    assert "repeats along x and y only" in complaint(surface, load=load, **rhombus)


# --- profiles, sums, tilts ----------------------------------------------------------------------------------


def test_a_profile_is_the_same_all_along(file: Any) -> None:
    at = 10.0 * np.arange(WAVE)
    lines = "\n".join(f"{y:.9g},{0.5 * np.cos(2 * np.pi * y / 640):.9g}" for y in at)
    profile = {"shape": "profile", "upwards": True, "file": file("p.csv", "y [um], z [um]\n" + lines)}
    load = {"mean_pressure": "100 MPa"}
    waviness = {"shape": "waviness", "amplitude": 0.5e-6, "wavelength": 640e-6}
    for angle, across in (("0 deg", "90 deg"), ("90 deg", "0 deg")):
        found = largest({**profile, "angle": angle}, load=load, **CELL)
        assert found == pytest.approx(largest({**waviness, "angle": across}, load=load, **CELL), rel=1e-4)
    turned = Profile(file=profile["file"], upwards=True, angle="30 deg", center=0.0)
    s, t = np.array([1e-3, -2e-3]), np.array([50e-6, -100e-6])
    x, y = np.cos(np.pi / 6) * s - t / 2, s / 2 + np.cos(np.pi / 6) * t
    expected = 0.5e-6 * (1 - np.cos(2 * np.pi * (t + 315e-6) / 640e-6))
    np.testing.assert_allclose(turned.height(x, y), expected, atol=1e-11)
    assert "angle of 0 or 90 deg" in complaint({**profile, "angle": "30 deg"}, load=load, **CELL)
    assert "a profile and a flat touch along a line, so the contact has no end" in complaint(profile)
    assert "extruded along 0 deg from x" in " ".join(row[1] for row in case_rows(case(profile, load, **CELL)))
    gone = Profile(upwards=True, y=np.delete(at, slice(20, 26)) * 1e-6, heights=np.zeros(WAVE - 6))
    lines_about = [line for one in (turned, gone) for line in one.rows(lambda _: 5e-6) if "points, y" in line]
    assert lines_about[-1].endswith("10.0 µm apart; 10.0 µm to 70.0 µm in y, 2 spacings of the lattice")
    assert "expected two columns, y and z, not 3; or headers" in complaint(
        {**profile, "file": file("q.csv", "1,2,3\n4,5,6"), "units": "um", "height_units": "um"}
    )


def test_a_ball_on_a_flat_profile_touches_below_its_center() -> None:
    profile = Profile(upwards=True, angle="30 deg", y=np.linspace(-3e-3, 3e-3, 61), heights=np.zeros(61))
    ball = {"shape": "sphere", "radius": "10 mm", "offset": ["1 mm", "0.5 mm"]}
    found = case(profile, other=ball)
    distance = np.subtract(found.deck.body.separation.first_touch[:2], (1e-3, 0.5e-3))
    assert np.hypot(*distance) < 51e-6  # half of the distance of its points
    assert float(found.run().max_pressure[-1]) == pytest.approx(HERTZ, rel=2e-3)


def test_a_tilted_flat_is_a_tilted_ball() -> None:
    tilt = {"tilt": ["0 deg", "1 deg"]}
    ball, grid = {"shape": "sphere", "radius": "10 mm"}, {"nodes_in_radius": 10}
    flat = {"shape": "flat", **tilt}
    one = case({**ball, **tilt}, **grid)
    for other in (case(ball, other=flat, **grid), case([ball, flat], **grid)):
        assert float(other.run().approach[-1]) == pytest.approx(float(one.run().approach[-1]), rel=1e-9)
        assert not other.surfaces.flat
    assert "contact has no end" in complaint(flat)


def test_roughness_from_a_file_lies_on_a_ball(file: Any) -> None:
    rough = of_file(file("r.csv", rows_of(0.0 * BALL)), **MATRIX)
    ball = {"shape": "sphere", "radius": "10 mm"}
    assert largest([ball, rough]) == pytest.approx(largest(ball), rel=1e-9)
    assert largest(rough, other=ball) == pytest.approx(largest(ball), rel=1e-9)
    tilted = case({**of_file(file("b.csv", rows_of(BALL)), **MATRIX), "tilt": ["0 deg", "0.1 deg"]})
    assert float(tilted.run().max_pressure[-1]) == pytest.approx(HERTZ, rel=2e-3)
    assert tilted.deck.body.separation.first_touch[0] == pytest.approx(-np.radians(0.1) * 10e-3, abs=6e-6)


# --- decks, results, the command ----------------------------------------------------------------------------

DECK = """\
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
[body.1.surface]
shape = "map"
file = "heights/ball.csv"
units = "um"
height_units = "um"
extent = ["800 um", "600 um"]
upwards = true
level = "mean"

[body.2]
rigid = true

[grid]
spacing = "8 um"

[[load]]
normal_load = "20 N"
"""


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    (tmp_path / "heights").mkdir()
    (tmp_path / "heights/ball.csv").write_text(rows_of(BALL))
    (tmp_path / "ball.toml").write_text(DECK)
    (tmp_path / "outer.toml").write_text('include = ["ball.toml"]\ntitle = "outer"\n')
    return tmp_path / "ball.toml"


def test_the_deck_of_a_result_needs_no_file(deck: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(deck.parent.parent)
    first = Case.from_toml(deck).run(deck.with_suffix(".nc"))
    outer = Case.from_toml(deck.with_name("outer.toml"), {"body.1.surface.level": "plane"}).run()
    assert float(outer.max_pressure[-1]) == pytest.approx(float(first.max_pressure[-1]), rel=1e-6)
    (deck.parent / "heights/ball.csv").unlink()
    read = open_result(deck.with_suffix(".nc"))
    named = "ball.csv, x and y in um, heights in um; columns along x, first row at the top"
    assert ("surfaces", f"map of body 1: {named}") in printed.file_rows(read)
    page = report(read)
    assert named in page
    assert " lines more, in the result)" in page
    assert page.count("\n        -") < 100 < read.deck.count("\n        -")
    again = Case.from_text(read.dataset.attrs["deck"])
    np.testing.assert_array_equal(again.run().dataset.pressure, first.dataset.pressure)
    surface = again.deck_tables["body"]["1"]["surface"]
    assert set(surface) == {"shape", "upwards", "level", "x", "y", "heights"}
    with pytest.raises(DeckError, match=r"ball\.toml:6:1: body\.1\.surface\.file = .*there is no file"):
        Case.from_toml(deck)


def test_a_map_from_python_is_that_of_the_deck(deck: Path) -> None:
    name = deck.parent / "heights/ball.csv"
    measured = Map(file=name, units="um", height_units="um", extent=(8e-4, 6e-4), upwards=True, level="mean")
    made = Case(body_1={**STEEL, "surface": measured}, body_2={"rigid": True}, spacing=8e-6, normal_load=20.0)
    assert made.run().approach[-1] == Case.from_toml(deck).run().approach[-1]


def test_check_prints_how_the_map_is_read(deck: Path) -> None:
    told = " ".join(inside(deck.parent, "check", deck.name).stdout.split())
    for words in (
        "ball.csv, x and y in um, heights in um; columns along x, first row at the top",
        "81 x 61 points; x from -400.0 µm to 400.0 µm (800.0 µm, with the cells of its ends 810.0 µm); y",
        "points 10.0 µm apart, 1.25 spacings of the lattice; x to the right, y to the top",
        "heights, range 12.50 µm; levelled: mean of",
        "subtracted; no holes; nearest to the other body at x = 0 m, y = 0 m",
        "cubic spline; largest overshoot 0 m",
    ):
        assert words in told
    done = inside(deck.parent, "check", deck.name, "--set", "body.1.surface.units=kg")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


def test_points_are_counted_beside_the_nodes_of_both_axes(file: Any) -> None:
    """Points 10 um apart; cells 5 um along x and 60 um along y, or turned by 90 degrees."""
    keys = of_file(file("ball.csv", rows_of(BALL)), **MATRIX)
    grid = {"lattice": "rectangular", "extent": ["0.6 mm", "0.4 mm"], "center": [0.0, 0.0]}
    for spacing, turned, ratios in (
        (["5 um", "60 um"], "0 deg", "2 by 0.167"),
        (["60 um", "5 um"], "90 deg", "2 by 0.167"),
        (["5 um", "60 um"], "90 deg", "0.167 by 2"),
    ):
        case = Case(
            body_1={**STEEL, "surface": keys},
            body_2=STEEL,
            normal_load=20.0,
            spacing=spacing,
            direction=turned,
            **grid,
        )
        assert any(f"points 10.0 µm apart, {ratios} spacings of" in words for _, words in case_rows(case))
        assert any(
            "the nodes are 6 points of the height map apart" in each for each in plausibility.warnings(case)
        )


def test_a_friction_map_and_a_height_map_are_read_by_one_reader(file: Any) -> None:
    coefficient = xr.DataArray(
        np.full((2, 2), 0.3), dims=("x", "y"), coords={"x": [-1.0, 1.0], "y": [-1.0, 1.0]}
    )
    path = file("mu.nc", coefficient)
    tables = {
        "body": {"1": {**STEEL, "surface": of_file(file("b.csv", rows_of(BALL)), **MATRIX)}, "2": STEEL},
        "friction": {"coefficient": {"map": path}},
        "grid": {"spacing": 12e-6},
        "load": [{"normal_load": 20.0}, {"tangential_load_x": 2.0}],
    }
    found = Case.from_dict(tables)
    assert set(found.deck_tables["friction"]["coefficient"]) == {"x", "y", "values"}
    assert float(found.run().stick_area[-1]) > 0.0


@pytest.mark.parametrize(
    ("name", "content", "keys"),
    [
        ("mu.nc", lambda mu: netcdf_of(mu, x="um", y="um"), {}),
        ("mu.csv", rows_of, {"units": "um", "extent": ["800 um", "600 um"]}),
        ("mu.npy", lambda mu: mu[::-1], {"units": "um", "spacing": ["10 um", "10 um"]}),
        ("mu.npy", lambda mu: mu, {"units": "um", "spacing": ["10 um", "10 um"], "first_row": "bottom"}),
        ("mu.xyz", lambda mu: columns_of(mu, headers="x [um], y [um], z"), {}),
        ("mu.csv", lambda mu: columns_of(mu, headers="x, y, mu"), {"units": "um", "variable": "mu"}),
    ],
)
def test_coefficients_are_read_from_every_kind_of_file(file: Any, name: str, content: Any, keys: Any) -> None:
    mu = 0.3 + X / 4000.0 + Y[:, None] / 8000.0
    tables = {
        "body": {"1": {**STEEL, "surface": {"shape": "sphere", "radius": 10e-3}}, "2": STEEL},
        "friction": {"coefficient": {"map": file(name, content(mu)), **keys}},
        "grid": {"spacing": 12e-6},
        "load": [{"normal_load": 20.0}],
    }
    made = Case.from_dict(tables)
    limits = made.friction_law(made.lattice).limits[0]
    x, y = made.lattice.x, made.lattice.y
    assert limits == pytest.approx(0.3 + x / 4000e-6 + y / 8000e-6, rel=1e-9)
    again = Case.from_text(made.deck_text)
    assert np.array_equal(again.friction_law(made.lattice).limits[0], limits)


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({}, 'friction.coefficient.units: missing; expected the unit, such as "um"'),
        ({"units": "um"}, "friction.coefficient.extent: missing; expected extent or spacing"),
        (
            {"units": "kg", "extent": [1.0, 1.0]},
            'friction.coefficient.units = "kg": expected a unit of length',
        ),
        ({"unit": "um"}, "expected beside map only variable, units, extent, .* not unit"),
        ({"units": "um", "extent": ["10 um", "10 um"]}, "the map does not cover the window"),
        ({"units": "um", "extent": ["800 um", "600 um"], "variable": "mu"}, "expected nothing as variable"),
    ],
)
def test_a_wrong_map_of_coefficients_is_one_sentence(file: Any, keys: Any, sentence: str) -> None:
    tables = {
        "body": {"1": {**STEEL, "surface": {"shape": "sphere", "radius": 10e-3}}, "2": STEEL},
        "friction": {"coefficient": {"map": file("mu.csv", rows_of(0.3 + 0 * BALL)), **keys}},
        "grid": {"spacing": 12e-6},
        "load": [{"normal_load": 20.0}],
    }
    with pytest.raises(DeckError, match=sentence):
        Case.from_dict(tables)


def test_check_as_json_has_the_lines_about_maps(deck: Path) -> None:
    found = json.loads(inside(deck.parent, "check", deck.name, "--json").stdout)
    [about] = found["surfaces"]
    assert (about["body"], about["shape"], len(about["lines"])) == (1, "map", 5)
    assert about["lines"][0].startswith("ball.csv, x and y in um")


def test_a_picture_shows_maps_profiles_or_the_gap_of_a_deck(deck: Path) -> None:
    done = inside(deck.parent, "plot", deck.name, "--what", "surface")
    assert done.stdout == "written: ball_surface.png\n"
    assert (deck.parent / "ball_surface.png").stat().st_size > 1000
    heights = np.zeros((9, 11))
    heights[0, 0], heights[3, 4] = np.nan, 2e-9
    at = {"x": np.linspace(-4e-4, 4e-4, 9).tolist(), "y": np.linspace(-5e-4, 5e-4, 11).tolist()}
    rough = {"shape": "map", "upwards": False, "holes": "open", "heights": heights.tolist(), **at}
    profile = {
        "shape": "profile",
        "upwards": True,
        "angle": "90 deg",
        "y": [-1e-3, 1e-3],
        "heights": [0.0, 0.0],
    }
    ball = {"shape": "sphere", "radius": "10 mm"}
    made = case([ball, rough], other=profile)
    figure = surface(made)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles == ["body 1: map", "body 2: profile"]
    drawn = figure.axes[0].collections[0].get_array()
    assert np.ma.count_masked(drawn) == 1
    assert float(drawn.max()) == pytest.approx(2.0)  # nm
    assert "1 hole filled" not in figure.axes[0].get_legend_handles_labels()[1]
    axes = surface(case([ball, {**rough, "holes": "fill", "offset": ["0.1 mm", "0 mm"]}])).axes[0]
    [hole] = [line for line in axes.lines if line.get_label() == "1 hole filled"]
    assert (hole.get_xdata()[0], hole.get_ydata()[0]) == pytest.approx((-300.0, -500.0))  # um
    plain = surface(case(ball, other=None))
    assert plain.axes[0].child_axes[0].get_ylabel().startswith("gap (")
    done = inside(deck.parent, "plot", deck.name, "--what", "surface", "--step", "2")
    assert done.returncode == 2
    assert "expected one deck, and no other options" in done.stderr


def test_the_map_of_the_cases_is_that_of_its_formula() -> None:
    lines = (ROOT / "cases/turned_surface.csv").read_text().splitlines()
    found = np.array([[float(cell or "nan") for cell in line.split(",")] for line in lines])
    x, y = np.arange(-200, 201, 4.0), np.arange(160, -161, -4.0)[:, None]
    waves = 150 * np.cos(2 * np.pi * x / 60) + 40 * np.cos(2 * np.pi * (y / 97 + x / 230))
    off = abs(found - (-(x**2 + y**2) / 20 + waves + 2 * x - y))
    assert np.isnan(off).sum() == 3
    assert np.nanmax(off) < 0.5 + 1e-9
