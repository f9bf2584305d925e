"""Fields between the nodes and along lines; the judge is a sum over hat functions, written out."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from hexcontact import Case, DeckError, Lattice, Result, open_result
from hexcontact.deck.surfaces import Sphere
from hexcontact.result.step import Line, interpolate, profile

Array = NDArray[np.float64]
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
LATTICE = Lattice(0.5, -3, 2, 7, 6, origin=(0.2, -0.1))


def hats(lattice: Lattice, values: Array, x: float, y: float) -> float:
    """Sum of hat functions: 1 at a node, 0 on and beyond the hexagon of its neighbors."""
    total = 0.0
    for row in range(lattice.n_row):
        for col in range(lattice.n_col):
            dx, dy = x - lattice.x[row, col], y - lattice.y[row, col]
            # the hexagon as the cut of three strips, whose normals point across its sides
            away = [
                abs(dx * math.cos(angle) + dy * math.sin(angle))
                for angle in (math.pi / 6, math.pi / 2, 5 * math.pi / 6)
            ]
            total += values[row, col] * max(0.0, 1.0 - max(away) / (math.sqrt(0.75) * lattice.spacing))
    return total


def field(seed: int = 3) -> Array:
    return np.random.default_rng(seed).uniform(0.5, 2.0, LATTICE.shape)


@pytest.fixture(scope="module")
def result() -> Result:
    """A sphere pressed and sheared, the fields of every second step kept."""
    return Case(
        body_1={**STEEL, "surface": Sphere(radius=10e-3)},
        body_2={"young_modulus": 70e9, "poisson_ratio": 0.33},
        nodes_in_radius=6,
        friction_coefficient=0.2,
        loads=[{"normal_load": 100.0, "steps": 2}, {"tangential_load_x": 8.0, "steps": 2}],
        fields=["pressure", "traction_x", "gap", "zone"],
        every=2,
    ).run()


@settings(deadline=None, max_examples=60)
@given(st.floats(-3, 6), st.floats(-3, 3))
def test_tractions_are_sums_of_hat_functions_everywhere(x: float, y: float) -> None:
    values = field()
    assert interpolate(LATTICE, "pressure", values, x, y) == pytest.approx(
        hats(LATTICE, values, x, y), abs=1e-8
    )


def test_other_fields_end_at_the_window() -> None:
    values = field()
    middle = LATTICE.x[3, 2] + 0.2, LATTICE.y[3, 2] + 0.1
    assert interpolate(LATTICE, "gap", values, *middle) == pytest.approx(hats(LATTICE, values, *middle))
    outside = LATTICE.x[0, 0] - 0.1, LATTICE.y[0, 0] - 0.1
    assert np.isnan(interpolate(LATTICE, "gap", values, *outside))
    assert interpolate(LATTICE, "pressure", values, *outside) > 0.0
    assert interpolate(LATTICE, "gap", values, LATTICE.x[0, 0], LATTICE.y[0, 0]) == values[0, 0]


def test_the_zone_is_that_of_the_nearest_node() -> None:
    zones = np.random.default_rng(5).integers(0, 3, LATTICE.shape)
    rng = np.random.default_rng(6)
    x, y = rng.uniform(1, 3, 200), rng.uniform(-1, 1, 200)
    away = np.hypot(x[:, None] - LATTICE.x.ravel(), y[:, None] - LATTICE.y.ravel())
    near = away.min(axis=1) < 0.57 * LATTICE.spacing  # else the nearest node is not of the window
    found = interpolate(LATTICE, "zone", zones, x, y)
    assert near.sum() > 100
    assert_array_equal(found[near], zones.ravel()[away.argmin(axis=1)][near])


@settings(deadline=None, max_examples=60)
@given(*[st.floats(-3, 5) for _ in range(4)])
def test_a_profile_has_all_its_corners(x0: float, y0: float, x1: float, y1: float) -> None:
    if math.hypot(x1 - x0, y1 - y0) < 1e-3:
        return
    line = Line((x0, y0), (x1, y1))
    values = field()
    found = profile(LATTICE, {"pressure": values}, line)
    distance = found.distance.values
    assert (np.diff(distance) > 0.0).all()
    assert distance[0] == 0.0
    assert distance[-1] == pytest.approx(line.length)
    between = np.linspace(0.0, line.length, 333)
    joined = np.interp(between, distance, found.pressure.values)
    assert_allclose(joined, interpolate(LATTICE, "pressure", values, *line.points(between)), atol=2e-8)


def test_along_a_row_the_corners_are_the_nodes() -> None:
    y = float(LATTICE.y[2, 0])
    line = Line((float(LATTICE.x[2, 0]), y), (float(LATTICE.x[2, -1]), y))
    values = field()
    found = profile(LATTICE, {"gap": values}, line)
    assert_allclose(found.x.values, LATTICE.x[2], rtol=1e-12)
    assert_allclose(found.gap.values, values[2], rtol=1e-9)


def test_a_profile_of_a_result(result: Result, tmp_path: Path) -> None:
    a = float(result.contact_radius[-1])
    ends = {"start": (-2 * a, 0.1 * a), "end": (a, 0.2 * a)}
    found = result.profile("pressure", "traction_x", **ends, source="nodes")
    assert set(found.data_vars) == {"pressure", "traction_x"}
    assert found.pressure.attrs["units"] == "Pa"
    assert found.attrs["step"] == 4
    assert float(found.distance[-1]) == pytest.approx(math.hypot(3 * a, 0.1 * a))
    data = result.step(4).pressure.values
    expected = [hats(result.lattice, data, float(x), float(y)) for x, y in zip(found.x, found.y, strict=True)]
    assert_allclose(found.pressure.values, expected, atol=1e-8 * data.max())
    assert_allclose(
        found.pressure.values, result.at("pressure", found.x, found.y, source="nodes"), rtol=1e-12
    )
    even = result.profile("pressure", start=(-a, 0.0), end=(a, 0.0), points=7)
    assert_allclose(np.diff(even.distance.values), a / 3)


def test_a_section_crosses_the_contact(result: Result) -> None:
    a, spacing = float(result.contact_radius[-1]), result.lattice.spacing
    for angle in (0.0, 0.4, math.pi / 2):
        section = result.section(angle=angle)
        assert set(section.data_vars) >= {"pressure", "traction_x", "gap", "zone"}
        inside = section.distance.values[section.pressure.values > 0]
        assert -a - 1.5 * spacing < inside.min() < -a + 1.5 * spacing
        assert a - 1.5 * spacing < inside.max() < a + 1.5 * spacing
        assert section.pressure.values[[0, -1]].tolist() == [0.0, 0.0]
        way = np.arctan2(np.ptp(section.y.values), np.ptp(section.x.values))
        assert way == pytest.approx(angle, abs=1e-9)
    middle = section.isel(distance=int(np.abs(section.distance.values).argmin()))
    assert float(middle.pressure) == pytest.approx(float(result.max_pressure[-1]), rel=0.02)
    aside = result.section("pressure", through=(0.0, 0.5 * a))
    assert_allclose(aside.y.values, 0.5 * a)
    assert float(aside.pressure.max()) == pytest.approx(
        math.sqrt(0.75) * float(result.max_pressure[-1]), rel=0.03
    )


def test_a_step_has_the_same_profiles_as_the_result() -> None:
    case = Case(
        body_1={**STEEL, "surface": Sphere(radius=10e-3)}, body_2=STEEL, nodes_in_radius=6, normal_load=50.0
    )
    session = case.start()
    step = next(session)
    ends = {"start": (-1e-4, 2e-5), "end": (1e-4, 3e-5)}
    for mine, other in (
        (step.profile(**ends), session.result().profile(**ends)),
        (step.section("gap", angle=0.3), session.result().section("gap", angle=0.3)),
    ):
        assert mine.sizes == other.sizes
        for name in mine.data_vars:
            assert_allclose(mine[name].values, other[name].values, rtol=1e-12)
    assert step.at("pressure", 1e-5, 0.0) == session.result().at("pressure", 1e-5, 0.0)


def test_what_cannot_be_shown_between_nodes_says_why(result: Result, tmp_path: Path) -> None:
    ends = {"start": (0.0, 0.0), "end": (1e-5, 0.0)}
    with pytest.raises(DeckError, match=r"^presure is no field; did you mean pressure\?$"):
        result.profile("presure", **ends)
    with pytest.raises(DeckError, match=r"^traction_y was not kept \(output.fields\)"):
        result.profile("traction_y", **ends)
    with pytest.raises(DeckError, match=r"^pressure of step 1 was not kept \(output.every\)$"):
        result.section("gap", step=1)
    with pytest.raises(DeckError, match=r"^zone of step 3 was not kept \(output.every\)$"):
        result.at("zone", 0.0, 0.0, step=3)
    with pytest.raises(DeckError, match=r"^no field of step 3 was kept \(output.fields, output.every\)$"):
        result.profile(**ends, step=3)
    with pytest.raises(DeckError, match="expected another point than the start"):
        result.profile("pressure", start=(1.0, 1.0), end=(1.0, 1.0))
    with pytest.raises(DeckError, match=r"end = \(1.0, nan\): expected a point \(x, y\) in meters"):
        result.profile("pressure", start=(1.0, 1.0), end=(1.0, math.nan))
    for points in (1, 2.5, True):
        with pytest.raises(DeckError, match="points = .*: expected a whole number of at least 2"):
            result.profile("pressure", **ends, points=points)
    with pytest.raises(IndexError, match="there is no step 9"):
        result.section(step=9)


def test_a_table_of_nodes(result: Result, tmp_path: Path) -> None:
    table = result.to_dataframe("pressure", "zone", step=-1)
    assert list(table.columns) == ["x", "y", "pressure", "zone"]
    assert table.index.names == ["step", "row", "col"]
    assert len(table) == result.lattice.size
    assert table.attrs["units"]["pressure"] == "Pa"
    assert table.pressure.sum() * result.lattice.cell_area == pytest.approx(100.0)
    assert table.pressure.loc[(4, 0, 0)] == float(result.pressure.sel(step=4, row=0, col=0))


def test_a_table_of_the_history(result: Result, tmp_path: Path) -> None:
    table = result.to_dataframe()
    assert list(table.index) == [1, 2, 3, 4]
    assert list(table.columns) == list(result.history.columns)
    two = result.to_dataframe("approach", "shift_x", step=2)
    assert two.shape == (1, 2)
    assert two.approach[2] == float(result.approach[1])
    with pytest.raises(KeyError, match="did you mean approach"):
        result.to_dataframe("aproach")


def test_a_file_gives_the_same(result: Result, tmp_path: Path) -> None:
    case = Case.from_text(result.deck)
    case.run(tmp_path / "out.nc")
    again = open_result(tmp_path / "out.nc")
    assert_array_equal(again.section().pressure.values, result.section().pressure.values)
