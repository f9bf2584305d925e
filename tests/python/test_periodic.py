"""Periodic windows: waves, asperities far apart, loads by their means, refused decks."""

import math
from pathlib import Path

import drawn
import numpy as np
import pytest
import xarray

from hexcontact import (
    Case,
    ConvergenceError,
    DeckError,
    FrictionalContact,
    Lattice,
    NormalContact,
    open_result,
    plotting,
)
from hexcontact.analytic.hertz_gap import against_hertz
from hexcontact.cli.printed import _columns, hertz_rows
from hexcontact.cli.report import charts_of
from hexcontact.plotting.below import table
from hexcontact.plotting.maps import mesh_of
from hexcontact.plotting.sections import line_of
from hexcontact.problem.preview import case_rows
from hexcontact.result.history_words import step_rows
from hexcontact.result.view import StepView

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
E_STAR = 210e9 / (2 * (1 - 0.3**2))
WAVE, HEIGHT = 1e-3, 1e-6
FULL = math.sqrt(2) * math.pi * E_STAR * HEIGHT / WAVE  # mean pressure of complete contact
WAVES = f"{HEIGHT}*(1 - cos(2*pi*x/{WAVE})*cos(2*pi*y/{WAVE}))"


def waves(nodes: int = 64, expression: str = WAVES, **arguments) -> Case:
    """Two cosines on a square."""
    body = {**STEEL, "surface": {"shape": "formula", "expression": expression}}
    grid = {"extent": ["1 mm", "1 mm"], "nodes_across": nodes, "boundary": "periodic"}
    return Case(**({"body_1": body, "body_2": STEEL} | grid | arguments))


@pytest.mark.parametrize(("share", "mean_gap"), [(0.03, 0.66068), (0.3, 0.124881), (0.7, 0.011131)])
def test_waves_between_their_limits(share: float, mean_gap: float) -> None:
    """Mean gaps of a spectral program on 512 x 512 nodes."""
    pressed = waves(loads={"mean_pressure": share * FULL}).run().dataset.isel(step=-1)
    assert float(pressed["mean_gap"]) / HEIGHT == pytest.approx(mean_gap, abs=1e-3)
    assert float(pressed["mean_pressure"]) == pytest.approx(share * FULL, rel=1e-12)
    assert float(pressed["approach"]) == pytest.approx(HEIGHT - float(pressed["mean_gap"]), rel=1e-9)
    assert float(pressed["operator_applications"]) < 7
    by_gap = waves(loads={"mean_gap": float(pressed["mean_gap"])}).run().dataset.isel(step=-1)
    assert float(by_gap["mean_pressure"]) == pytest.approx(share * FULL, rel=1e-6)


@pytest.mark.parametrize("angle", ["0 deg", "90 deg"])
def test_error_bar_of_the_area_contains_straight_edges(angle: str) -> None:
    """Both edges of a strip lie on columns, or rows, and err alike: the area of Westergaard is in the bar."""
    ridges = {"shape": "waviness", "amplitude": 0.2e-6, "wavelength": WAVE, "angle": angle}
    for share in (0.14, 0.28, 0.41, 0.55, 0.83):
        body, load = {**STEEL, "surface": ridges}, share * math.pi * E_STAR * 0.2e-6 / WAVE
        pressed = waves(body_1=body, mean_pressure=load).run().dataset.isel(step=-1)
        area, bar = (float(pressed[name]) / WAVE**2 for name in ("contact_area", "contact_area_error"))
        assert bar == pytest.approx(1 / 64)
        assert area == pytest.approx(2 / math.pi * math.asin(math.sqrt(share)), abs=bar)


def test_a_section_of_waves_goes_through_their_crests() -> None:
    """Contacts that repeat have no center: that of the pressure lies between two rows of nodes."""
    line = line_of([StepView(waves(nodes=16, mean_pressure=0.3 * FULL).run(), -1)], 0.0)
    assert (line.start[1], line.start[0] + line.zero) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_a_section_of_complete_contact_is_a_period_long() -> None:
    pressed = waves(nodes=16, mean_pressure=1.5 * FULL).run()
    views = [StepView(pressed, -1)]
    rounding = pressed.step(-1).assign(mean_gap=-4.9e-23)
    assert dict(step_rows(rounding))["mean gap"] == "0 m"
    assert line_of(views, 0.0).length == pytest.approx(WAVE, rel=1e-12)
    assert line_of(views, 0.25 * math.pi).length == pytest.approx(math.sqrt(2.0) * WAVE, rel=1e-12)


def test_edges_of_a_strip_are_straight_up_to_the_ends_of_its_window() -> None:
    ridges = {**STEEL, "surface": {"shape": "waviness", "amplitude": 0.5 * HEIGHT, "wavelength": WAVE}}
    grid = {"extent": [WAVE, 0.25 * WAVE], "nodes_across": 32, "boundary": "periodic"}
    case = Case(body_1=ridges, body_2=STEEL, mean_pressure=0.1 * FULL, **grid)
    view = StepView(case.run(), -1)
    assert line_of([view], 0.0).length < 0.9 * WAVE
    rows = view.lattice.y[:, 0]
    for low, high in ((view.lattice.y.min(), 0.0), (0.0, view.lattice.y.max())):
        x, y = np.meshgrid(np.linspace(-0.5, 0.5, 401) * WAVE, [low, high, rows[3]])
        inside = view.touches(x, y).sum(axis=1)
        assert 0 < inside[0] == inside[1] == inside[2] < 401
    outlines = np.concatenate(mesh_of(view, view.pressure, True).outlines())
    within = outlines[(rows[0] <= outlines[:, 1]) & (outlines[:, 1] <= rows[-1])]
    assert len(within) > 8 and np.ptp(abs(within[:, 0])) < 1e-3 * WAVE


def test_loads_by_means_are_arguments_of_a_case() -> None:
    pressure = 0.3 * FULL
    alone, listed = (
        waves(nodes=16, mean_pressure=pressure),
        waves(nodes=16, loads={"mean_pressure": pressure}),
    )
    assert alone.deck == listed.deck
    assert waves(nodes=16, mean_gap="0.2 um").deck.load[0].mean_gap == pytest.approx(2e-7)


def test_means_in_a_series_are_those_of_segments(tmp_path: Path) -> None:
    """Also from a file, and as shares of mu P."""
    pressure = 0.3 * FULL
    one = waves(
        nodes=16,
        friction_coefficient=0.3,
        loads=[
            {"mean_pressure": pressure},
            {"mean_pressure": pressure, "mean_traction_x": "0.5 mu P"},
            {"mean_gap": 1e-7, "mean_traction_x": 0.15 * pressure},
        ],
    )
    arrays = {
        "mean_pressure": [pressure, pressure, ""],
        "mean_gap": ["", "", 1e-7],
        "mean_traction_x": [0.0, 0.15 * pressure, 0.15 * pressure],
    }
    series = waves(nodes=16, friction_coefficient=0.3, loads=[{"series": arrays}])
    rows = zip(*arrays.values(), strict=True)
    text = "mean_pressure [Pa],mean_gap [m],mean_traction_x [Pa]\n" + "\n".join(
        ",".join(map(str, r)) for r in rows
    )
    (tmp_path / "means.csv").write_text(text)
    read = waves(
        nodes=16, friction_coefficient=0.3, loads=[{"series": {"file": str(tmp_path / "means.csv")}}]
    )
    assert read.deck == series.deck
    expected = one.run()
    assert float(expected.dataset.tangential_load_x[1]) == pytest.approx(0.15 * pressure * WAVE**2, rel=1e-9)
    for name in ("approach", "normal_load", "tangential_load_x", "dissipated_energy"):
        np.testing.assert_allclose(series.run().dataset[name], expected.dataset[name], rtol=1e-9)


def test_no_radius_stands_for_a_contact_that_is_no_disc() -> None:
    """In a window that repeats the share of its area, in a long contact the stick area."""
    strips = (
        waves(nodes=16, expression=f"{HEIGHT}*(1 - cos(2*pi*x/{WAVE}))", mean_pressure=2e7)
        .run()
        .history.iloc[-1]
        .to_dict()
    )
    columns = _columns([strips], with_errors=False)
    assert "contact area" in columns
    assert "radius" not in columns
    assert columns["contact area"](strips).endswith("% of the window")
    long = {"shape": "paraboloid", "radius_x": "100 mm", "radius_y": "1 mm"}
    loads = [{"normal_load": 10.0}, {"tangential_load_x": 1.0}]
    bodies = {"body_1": {**STEEL, "surface": long}, "body_2": STEEL}
    sheared = (
        Case(**bodies, spacing="auto", friction_coefficient=0.3, loads=loads).run().history.iloc[-1].to_dict()
    )
    rows = dict(step_rows(sheared))
    assert "contact half-axes" in rows
    assert "stick area" in rows
    assert "stick radius" not in rows


def test_two_spacings_need_no_lattice() -> None:
    """Cells of a window that repeats are rectangles."""
    lattice = waves(nodes=None, spacing=["25 um", "50 um"], mean_pressure=1e8).lattice
    assert lattice.shape == (20, 40)


def test_no_approach_closes_more_than_the_mean_gap() -> None:
    """There all of the window touches, and no pressure belongs to more."""
    assert waves(nodes=16, approach=0.9 * HEIGHT).run().normal_load[-1] > 0.0
    for approach in (HEIGHT, 2 * HEIGHT):
        with pytest.raises(
            DeckError, match="approach = .*expected mean_pressure, or less than 1.000 µm, at which"
        ):
            waves(approach=approach)


@pytest.mark.parametrize("share", [1.0, 1.002, 2.0])
def test_solvers_refuse_an_approach_beyond_the_mean_gap(share: float) -> None:
    """They reported convergence under a pressure without bound, over which the residual is taken."""
    case = waves(nodes=16, mean_pressure=1e8)
    gap, approach = case.initial_gap(case.lattice)[0], share * HEIGHT
    expected = "the approach: less than the mean gap expected in a window that repeats"
    pressed = NormalContact(case.lattice, case.pair, gap)
    assert pressed.solve(approach=0.9 * HEIGHT).converged
    with pytest.raises(DeckError, match=expected):
        pressed.solve(approach=approach)
    sheared = FrictionalContact(case.lattice, case.pair, gap, friction_coefficient=0.3)
    controls = ["displacement", "force", "force", "displacement"]
    with pytest.raises(DeckError, match=expected):
        sheared.advance(sheared.virgin(), controls, [approach, 0.0, 0.0, 0.0])
    layer = NormalContact(case.lattice, case.pair, gap, interface=(1e14, 1.0, 0.0))
    assert layer.solve(approach=approach).converged


@pytest.mark.parametrize("rows", [1, 4, 8])
def test_few_rows_are_as_good_as_many(rows: int) -> None:
    """Westergaard's wave: the largest pressure at half of the load of complete contact."""
    full = math.pi * E_STAR * HEIGHT / WAVE
    pressed = waves(
        expression=f"{HEIGHT}*(1 - cos(2*pi*x/{WAVE}))",
        nodes=None,
        extent=[WAVE, WAVE / 32 * rows],
        spacing=WAVE / 32,
        loads={"mean_pressure": 0.5 * full},
    ).run()
    assert float(pressed.max_pressure[-1]) == pytest.approx(math.sqrt(2) * full, rel=3e-3)


def test_a_mean_gap_with_friction_is_that_without() -> None:
    """Contact reaches where the undeformed bodies would not overlap."""
    smooth, rough = (
        waves(nodes=32, friction_coefficient=mu, loads={"mean_gap": 0.1 * HEIGHT}).run().mean_pressure[-1]
        for mu in (None, 0.3)
    )
    assert float(rough) == pytest.approx(float(smooth), rel=1e-7)


def test_an_asperity_far_from_the_next_is_alone() -> None:
    """In cells of 8 and 16 contact radii: the influence of the others falls like the third power."""
    radius, a, spacings = 10e-3, 0.1e-3, 12
    load = 4 * E_STAR * a**3 / (3 * radius)

    def center(cells: int, periodic: bool) -> tuple[np.ndarray, float]:
        n = cells * spacings
        lattice = Lattice(a / spacings, -n // 2, -n // 2, n, n, cell_angle=math.pi / 2, periodic=periodic)
        case = Case(
            body_1=STEEL,
            body_2=STEEL,
            gap=lambda x, y: (x * x + y * y) / (2 * radius),
            lattice=lattice,
            normal_load=load,
            tolerance=1e-10,
        )
        pressure = case.run().dataset["pressure"].values[-1]
        middle = slice(n // 2 - 16, n // 2 + 16)
        return pressure[middle, middle], float(pressure.max())

    alone, largest = center(8, periodic=False)
    apart = {cells: center(cells, periodic=True) for cells in (8, 16)}
    change = {cells: abs(field - alone).max() / largest for cells, (field, _) in apart.items()}
    assert change[16] < 2e-3
    assert change[8] / change[16] == pytest.approx(8, rel=0.1)
    assert apart[16][1] == pytest.approx(largest, rel=4e-4)


def test_unlike_bodies_with_friction(tmp_path: Path) -> None:
    """Loads by their means, a result file, stress below, refused edges."""
    case = waves(
        body_2={"rigid": True},
        friction_coefficient=0.3,
        loads=[{"mean_pressure": 0.2 * FULL, "steps": 2}, {"mean_traction_x": 0.03 * FULL, "steps": 2}],
    )
    assert not case.lattice.x.min() + case.lattice.x.max() > 0.0  # about the origin
    result = case.run(tmp_path / "waves.nc")
    last = result.dataset.isel(step=-1)
    assert float(last["tangential_load_x"]) == pytest.approx(0.03 * FULL * WAVE**2, rel=1e-12)
    assert 0.0 < float(last["stick_area"]) < float(last["contact_area"])
    assert float(last["dissipated_energy"]) > 0.0
    assert float(last["torque"]) == 0.0
    # the same in every direction of the square, since the waves are
    other = case.changed({"load.2.mean_traction_x": None, "load.2.mean_traction_y": 0.03 * FULL}).run()
    assert float(other.dataset["shift_y"][-1]) == pytest.approx(float(last["shift_x"]), rel=1e-6)
    assert "contact_radius_fit" not in result.dataset
    read = open_result(tmp_path / "waves.nc")
    assert read.lattice == case.lattice
    assert read.lattice.periodic
    assert read.traction_field().source == "nodes"
    below = read.stress(depths=[0.0, 0.1e-3])
    assert below.attrs["tractions"] == "nodes"
    loads = {"stress_zz": "pressure", "stress_xz": "traction_x", "stress_yz": "traction_y"}
    for name, load in loads.items():
        surface, deep = below[name].values
        peak = float(last["max_pressure"])
        assert abs(surface + last[load].values).max() < 1e-6 * peak
        assert deep.mean() == pytest.approx(-float(last[load].mean()), abs=1e-6 * peak)
    with pytest.raises(DeckError, match='source = "edges": expected "nodes" in a window that repeats'):
        read.stress(depths=[0.0], source="edges")
    plotting.stress(read)
    charts = {chart["title"]: chart for chart in charts_of(read.history.reset_index().to_dict("records"))}
    [gaps] = charts["Mean gap"]["curves"].values()
    assert gaps[0] is None  # before the first load step the mean gap is that of the waves, and no load
    assert charts["Mean gap"]["unit"] == "nm"
    assert gaps[1] * 1e-9 == pytest.approx(float(read.mean_gap[0]), rel=1e-4)
    assert Case.from_text(read.deck).lattice == case.lattice


def test_a_component_that_is_rounding_is_drawn_as_zero() -> None:
    """Below waves along x the stresses xy and yz are 0, but for the residual of the tractions."""
    along, depth = np.meshgrid(np.linspace(-0.5e-3, 0.5e-3, 9), np.linspace(0.0, 0.5e-3, 5))
    place = {"x": (("across", "along"), along), "y": (("across", "along"), 0 * along)}
    place |= {"depth": (("across", "along"), depth), "step": [1]}
    sizes = {"stress_zz": 1e8, "stress_xy": 0.5, "stress_xz": 2e3}
    said = "component of the stress, positive in tension"
    fields = {
        name: (
            ("step", "across", "along"),
            size * np.cos(9e3 * along)[None],
            {"units": "Pa", "long_name": said},
        )
        for name, size in sizes.items()
    }
    found = xarray.Dataset(fields, coords=place, attrs={"title": "waves: below", "body": 1})
    figure = table(found)
    assert [bool(one.lines) for one in figure.axes if one.get_title()] == [True, False, True]
    bars = [one for one in figure.axes if not one.get_title()]
    assert bars[1].get_xlabel().endswith("(Pa)")
    figure.draw_without_rendering()
    for bar in bars:
        label = bar.xaxis.label.get_window_extent()
        assert label.x0 >= 0.0 and label.x1 <= figure.bbox.x1


def test_stress_below_a_wave() -> None:
    """A wave pressed flat and sheared: Westergaard's stress (Johnson, 13.2), and the mean tractions."""
    height, length = HEIGHT, WAVE
    peak = math.pi * E_STAR * height / length
    case = waves(
        expression=f"{height}*(1 - cos(2*pi*x/{length}))",
        friction_coefficient=0.5,
        loads=[{"mean_pressure": 1.5 * peak}, {"mean_traction_x": 0.1 * peak}],
    )
    result = case.run()
    x, depth = np.meshgrid([0.0, 0.11e-3, 0.4e-3], [0.0, 2e-6, 20e-6, 50e-6, 200e-6, 2e-3], indexing="ij")
    points = np.stack([x, 0.3e-3 + 0 * x, depth], axis=-1)
    found = result.stress(points=points)
    k = 2 * math.pi / length
    wave = peak * np.exp(-k * depth)
    known = {
        "stress_zz": -1.5 * peak - (1 + k * depth) * wave * np.cos(k * x),
        "stress_xx": -(1 - k * depth) * wave * np.cos(k * x),
        "stress_yy": -0.6 * wave * np.cos(k * x),
        "stress_xz": -0.1 * peak - k * depth * wave * np.sin(k * x),
        "stress_xy": 0.0,
    }
    for name, values in known.items():
        assert abs(found[name].values - values).max() < 1e-3 * peak
    other = result.stress(points=points, body=2)
    assert abs(other["stress_zz"] - found["stress_zz"]).max() < 1e-9 * peak
    mirrored = points * [-1.0, 1.0, 1.0]  # body 2 bears the opposite shear, and z points out of it
    seen = result.stress(points=mirrored, body=2)["stress_xz"]
    assert abs(seen - found["stress_xz"]).max() < 1e-6 * peak


def test_stress_below_an_asperity_far_from_the_next() -> None:
    """Beside the free window: the difference falls like the third power of the distance.

    The mean pressure has no stress in the plane; on a wide disc it has -(1 + 2 nu)/2 of it.
    """
    radius, a, spacings = 10e-3, 0.1e-3, 8
    load = 4 * E_STAR * a**3 / (3 * radius)
    points = a * np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 0.1], [0.0, 0.0, 0.5], [1.0, 0.2, 1.0]])

    def below(cells: int, periodic: bool) -> xarray.Dataset:
        n = cells * spacings
        lattice = Lattice(a / spacings, -n // 2, -n // 2, n, n, cell_angle=math.pi / 2, periodic=periodic)
        gap = lambda x, y: (x * x + y * y) / (2 * radius)  # noqa: E731
        bodies = {"body_1": STEEL, "body_2": STEEL}
        return (
            Case(gap=gap, lattice=lattice, normal_load=load, **bodies)
            .run()
            .stress(points=points, source="nodes")
        )

    alone = below(8, periodic=False)
    peak = -float(alone["stress_zz"].min())
    change = {}
    for cells in (8, 16):
        apart = below(cells, periodic=True)
        mean = load / (cells * a) ** 2
        more = {"stress_xx": -0.8 * mean, "stress_yy": -0.8 * mean, "von_mises_stress": np.nan}
        change[cells] = max(
            float(abs(apart[name] + more.get(name, 0.0) - alone[name]).max()) / peak
            for name in alone.data_vars
            if not np.isnan(more.get(name, 0.0))
        )
    assert change[16] < 1e-3
    assert change[8] / change[16] > 6


def test_boxes_and_cycles_below() -> None:
    """Nodes beyond the window are those of the next; fatigue parameters of a cycle."""
    segments = [(name, sign * 0.02 * FULL) for name, sign in (("pull", 1), ("push", -1), ("back", 1))]
    path = [{"label": name, "mean_traction_x": load, "steps": 4} for name, load in segments]
    case = waves(
        32,
        friction_coefficient=0.3,
        loads=[{"mean_pressure": 0.2 * FULL}, {"path": path}],
    )
    result = case.run()
    inside, outside = (
        result.stress("stress_xx", depths=[20e-6], box=[[x, x + 0.5e-3], [-0.2e-3, 0.2e-3]])
        for x in (-0.5e-3, 1.5e-3)
    )
    assert np.array_equal(inside["stress_xx"].values, outside["stress_xx"].values)
    assert float(outside["x"].min()) > 1e-3
    given = {"crossland_slope": 0.3, "segment": ["push", "back"]}
    plane = result.fatigue("crossland", depths=[20e-6], **given)
    places = np.stack([plane["x"].values, plane["y"].values, 20e-6 + 0 * plane["x"].values], axis=-1)
    alone = result.fatigue("crossland", points=places[::9, ::7], **given)
    assert plane["crossland"].values[0, ::9, ::7] == pytest.approx(alone["crossland"].values, rel=1e-6)


def test_wear_of_an_asperity_far_from_the_next() -> None:
    """Beside the free window, as for the pressure; all that wears is on the gap."""
    radius, a, spacings = 10e-3, 0.1e-3, 6
    load = 4 * E_STAR * a**3 / (3 * radius)
    shear = 0.3 * load
    cycle = [{"tangential_load_x": -shear, "steps": 4}, {"tangential_load_x": shear, "steps": 4}]
    loads = [
        {"normal_load": load},
        {"tangential_load_x": shear, "steps": 2},
        {"label": "back", "path": cycle},
    ]

    def worn(cells: int, periodic: bool) -> tuple[np.ndarray, xarray.Dataset]:
        n = cells * spacings
        lattice = Lattice(a / spacings, -n // 2, -n // 2, n, n, cell_angle=math.pi / 2, periodic=periodic)
        case = Case(
            body_1=STEEL,
            body_2=STEEL,
            gap=lambda x, y: (x * x + y * y) / (2 * radius),
            lattice=lattice,
            friction_coefficient=0.5,
            loads=loads,
            wear={"coefficient_1": 1e-13, "cycle": "back", "cycles": 10, "jump": 1},
        )
        last = case.run().dataset.isel(step=-1)
        middle = slice(n // 2 - 12, n // 2 + 12)
        return last["worn_depth"].values[middle, middle], last

    (alone, _), (near, _), (far, last) = worn(8, False), worn(8, True), worn(16, True)
    assert alone.max() > 1e-11
    change = [abs(field - alone).max() / alone.max() for field in (near, far)]
    assert change[1] < 6e-3
    assert change[0] / change[1] > 6
    mean = last["initial_gap"].mean() + last["worn_depth"].mean()
    assert float(last["mean_gap"]) == pytest.approx(float(mean - last["approach"]), rel=1e-5)
    with pytest.raises(DeckError, match="expected mean_pressure or approach beside \\[wear\\]"):
        waves(
            friction_coefficient=0.5,
            loads=[{"mean_gap": 1e-7}, {"label": "back", "path": cycle}],
            wear={"coefficient_1": 1e-13, "cycle": "back", "cycles": 10},
        )


def test_means_in_a_cycle_that_wears() -> None:
    """The same as the loads that they are."""
    area, pressure, shear = WAVE**2, 50e6, 10e6
    found = []
    for normal, along, share in (
        ("mean_pressure", "mean_traction_x", 1.0),
        ("normal_load", "tangential_load_x", area),
    ):
        path = [{along: -shear * share, "steps": 2}, {along: shear * share, "steps": 2}]
        case = waves(
            nodes=32,
            friction_coefficient=0.3,
            loads=[{normal: pressure * share}, {along: shear * share}, {"label": "back", "path": path}],
            wear={"coefficient_1": 1e-13, "cycle": "back", "cycles": 2, "jump": 1},
        )
        found.append(case.run().dataset.isel(step=-1)["worn_depth"].values)
    assert found[0].max() > 1e-12
    assert found[0] == pytest.approx(found[1], rel=1e-9, abs=1e-15)


def test_check_prints_the_period() -> None:
    printed = dict(case_rows(waves(loads={"mean_pressure": 1e6})))
    assert printed["window"] == "64 x 64 nodes (4,096), 1.000 mm x 1.000 mm, repeats"
    assert printed["largest load"] == "1.000 N (mean pressure 1.000 MPa)"


def test_steps_one_by_one() -> None:
    case = waves(friction_coefficient=0.3, loads=[{"mean_pressure": 0.1 * FULL}, {"mean_traction_x": 1e6}])
    with case.start() as session:
        session.advance(mean_pressure=0.1 * FULL)
        step = session.advance(mean_traction_x=1e6)
    assert step.history["shift_x"] == case.run().dataset["shift_x"][-1]


def test_flat_on_flat_has_one_unknown() -> None:
    flat = waves(expression="0*x", friction_coefficient=0.5, loads={"mean_pressure": 1e6})
    assert np.allclose(flat.run().dataset["pressure"], 1e6, rtol=1e-12)
    planes = flat.changed(
        {"body.1.surface": None, "load": [{"mean_pressure": 1e6}, {"mean_traction_x": 4e5}]}
    )
    last = planes.run().dataset.isel(step=-1)
    assert np.allclose(last["traction_x"], 4e5, rtol=1e-9)
    assert float(last["shift_x"]) == 0.0


def test_the_period_is_exact_and_has_whole_cells() -> None:
    case = waves(nodes_across=None, spacing="10 um", extent=["1 mm", "0.7 mm"], loads={"mean_pressure": 1e6})
    assert case.lattice.shape == (70, 100)
    assert case.lattice.basis.tolist() == [[1e-5, 0.0], [pytest.approx(0.0, abs=1e-20), pytest.approx(1e-5)]]
    rhombus = waves(
        cell_angle="60 deg", extent=["1 mm", "1 mm"], loads={"mean_pressure": 1e6}, expression="0*x"
    )
    assert rhombus.lattice.cell_angle == pytest.approx(math.pi / 3)


def test_a_map_of_one_period() -> None:
    """Heights at the nodes of a period, with contact across its sides."""
    at = np.arange(64) * WAVE / 64 - WAVE / 2
    heights = HEIGHT * (1.0 - np.cos(2 * np.pi * at / WAVE) * np.cos(2 * np.pi * at[:, None] / WAVE))
    gap = xarray.DataArray(heights, dims=("y", "x"), coords={"x": at, "y": at})
    load = {"mean_pressure": 0.1 * FULL}
    case = waves(body_1=STEEL, gap=gap, loads=load)
    last, other = (made.run().dataset.isel(step=-1) for made in (case, waves(loads=load)))
    assert float(last["mean_gap"]) == pytest.approx(float(other["mean_gap"]), rel=1e-6)
    assert (last["pressure"].values[0] > 0.0).any()


@pytest.mark.parametrize(("load", "work"), [(0.02, 4.5), (0.2, 5.3)])
def test_work_on_rough_surfaces(load: float, work: float) -> None:
    """Self-affine, H = 0.8, wavelengths of 8 to 64 spacings: the length of steps is searched for."""
    n = 128
    number = np.hypot(*np.meshgrid(np.fft.fftfreq(n, 1 / n), np.fft.fftfreq(n, 1 / n)))
    share = np.where((number >= n / 64) & (number <= n / 8), np.maximum(number, 1.0) ** -1.8, 0.0)
    noise = np.random.default_rng(1).standard_normal((n, n))
    heights = np.fft.ifft2(np.fft.fft2(noise) * share).real
    slope = math.sqrt(2.0) * np.std(np.roll(heights, 1, 0) - heights) / 1e-6
    lattice = Lattice(1e-6, 0, 0, n, n, cell_angle=math.pi / 2, periodic=True)
    pressed = Case(
        body_1=STEEL,
        body_2=STEEL,
        gap=(heights - heights.min()) * 0.1 / slope,
        lattice=lattice,
        loads={"mean_pressure": load * 0.1 * E_STAR},
        tolerance=1e-6,
    ).run()
    last = pressed.dataset.isel(step=-1)
    assert float(last["operator_applications"]) < work
    assert float((last["pressure"].values > 0.0).mean()) == pytest.approx(2.2 * load, rel=0.3)


BAD = {
    "nodes_across": ({"nodes_across": 62}, "expected a multiple of four columns .* such as 64, not 62"),
    "nodes_in_radius": (
        {"nodes_across": None, "nodes_in_radius": 20},
        "nodes_in_radius = 20: expected spacing or nodes_across, since the window repeats",
    ),
    "extent": ({"extent": None}, "grid.extent: expected the lengths of the period"),
    "boundary": (
        {"boundary": None, "loads": {"mean_pressure": "1 MPa", "mean_traction_x": "400 kPa"}},
        r'(?s)\A(?!.*sliding).*load\.1\.mean_traction_x = "400 kPa": expected a window that repeats',
    ),
    "shear": (
        {"friction_coefficient": None, "loads": [{"mean_pressure": 1e6}, {"mean_traction_y": 1e5}]},
        r"load\.2\.mean_traction_y = 100000\.0: expected 0, or a \[friction\] table",
    ),
    "gap": (
        {"loads": {"mean_gap": "3 um"}},
        r"load\.1\.mean_gap = .*: expected .* or a mean gap below 1\.000 µm, that before loading",
    ),
    "none": (
        {"loads": {"mean_pressure": 0}},
        r"load\.1\.mean_pressure = 0.*: expected a mean pressure above",
    ),
    "series": (
        {"loads": [{"series": {"mean_pressure": [1e6, 2e6], "approach": ["", 1e-7]}}]},
        "series.mean_pressure = .*: expected approach or mean_pressure in each row, not both .entry 2.",
    ),
    "share": (
        {"friction_coefficient": 0.3, "loads": [{"mean_gap": "0.2 um", "mean_traction_x": "0.2 mu P"}]},
        "mean_traction_x = .0.2 mu P.: expected pascals, since the approach is given",
    ),
    "series without a period": (
        {"boundary": None, "loads": [{"series": {"mean_pressure": [1e6, 2e6]}}]},
        "expected a window that repeats",
    ),
    "seam": ({"expression": "1e-6*(1 - cos(6*x/1e-3 + 1))"}, "grid.boundary .*: the gap does not repeat"),
    "punch": (
        {"body_1": {**STEEL, "surface": {"shape": "punch", "radius": 1e-4}}},
        "nodes that cannot touch",
    ),
    "torque": (
        {"loads": [{"mean_pressure": 1e6}, {"torque": 1.0}]},
        r"load\.2\.torque = 1\.0: expected no torque .*: a rotation does not repeat",
    ),
    "tilt": (
        {
            "body_1": {
                **STEEL,
                "surface": {
                    "shape": "rounded_punch",
                    "flat_radius": 1e-4,
                    "edge_radius": 1e-3,
                    "tilt": ["0 deg", "1e-6 deg"],
                },
            }
        },
        r'body\.1\.surface\.tilt = \["0 deg", "1e-6 deg"\]: expected none in a window that repeats',
    ),
    "tilted flat": (
        {"body_2": {**STEEL, "surface": {"shape": "flat", "tilt": ["1 mrad", "0 deg"]}}},
        r'body\.2\.surface\.tilt = \["1 mrad", "0 deg"\]: expected none in a window that repeats',
    ),
    "waviness": (
        {"body_1": {**STEEL, "surface": {"shape": "waviness", "amplitude": 1e-6, "wavelength": 7e-4}}},
        r"grid\.boundary .*: the waviness does not repeat .*: its side in x has 1\.42857 waves",
    ),
    "both": ({"loads": {"mean_pressure": 1e6, "mean_gap": 1e-7}}, "mean_pressure or mean_gap, not both"),
    "mean_gap": ({"loads": {"mean_gap": 0.0}}, "mean_gap = 0.0: expected a length above 0"),
    "sliding": (
        {"loads": {"mean_pressure": 1e6, "mean_traction_x": 4e5}},
        r"gross sliding: the mean traction of 400\.0 kPa .* x mean_pressure = 300\.0 kPa",
    ),
    "direct": ({"method": "direct"}, 'solver.method = "direct": expected "fft"'),
    "accuracy": ({"accuracy": 0.02}, "accuracy: expected none beside a window that repeats"),
}


def test_a_traction_above_friction_asks_for_no_rotation() -> None:
    case = waves(16, friction_coefficient=0.3, loads={"mean_gap": 0.1 * HEIGHT, "mean_traction_x": FULL})
    with pytest.raises(ConvergenceError, match=r"expected a smaller load, .* \(shift_x, shift_y\)"):
        case.run()


@pytest.mark.parametrize("name", BAD)
def test_wrong_decks_are_told(name: str) -> None:
    arguments, sentence = BAD[name]
    with pytest.raises(DeckError, match=sentence):
        waves(**({"friction_coefficient": 0.3, "loads": {"mean_pressure": 1e6}} | arguments))


def test_a_wave_may_be_steepest_at_the_seam() -> None:
    """Between few nodes its step there is larger than all others."""
    wave = "1e-6*(2 + sin(2*pi*x/1e-3 + pi/16) - 0.3*sin(4*pi*x/1e-3 + pi/8))"
    assert waves(16, wave, loads={"mean_pressure": 1e6}).run().complete
    with pytest.raises(DeckError, match="the gap does not repeat"):
        waves(16, f"{wave} + 1e-5*x", loads={"mean_pressure": 1e6})


def test_stress_has_the_tractions_of_nodes() -> None:
    below = {"stress": [{"depths": [1e-5], "source": "edges"}]}
    with pytest.raises(DeckError, match=r'stress.1.source = "edges": expected "nodes" beside a window that'):
        waves(loads={"mean_pressure": 1e6}).changed(below)


def test_lattices_of_python_repeat_too() -> None:
    with pytest.raises(DeckError, match="a multiple of four columns expected"):
        gap = lambda x, y: 0 * x  # noqa: E731
        lattice = Lattice(1e-5, 0, 0, 10, 10, cell_angle=math.pi / 2, periodic=True)
        Case(body_1=STEEL, body_2=STEEL, gap=gap, lattice=lattice, loads={"mean_pressure": 1e6}).run()


@pytest.mark.parametrize("other", [STEEL, {"young_modulus": 70e9, "poisson_ratio": 0.2}])
def test_no_traction_takes_up_the_shift_of_a_complete_contact(other: dict) -> None:
    """Flat on flat: the mean displacement of a window that repeats is zero, so that any shift slides."""
    grid = {"extent": ["100 um", "50 um"], "nodes_across": 16, "boundary": "periodic"}
    loads = [{"mean_pressure": 3e8}, {"shift_x": 1e-9, "steps": 2}]
    result = Case(body_1=STEEL, body_2=other, friction_coefficient=0.3, loads=loads, **grid).run()
    np.testing.assert_allclose(result.dataset.traction_x[-1], 9e7, rtol=1e-9)
    assert float(result.dissipated_energy[-1]) == pytest.approx(0.3 * 3e8 * 100e-6 * 50e-6 * 1e-9, rel=1e-9)


def strip(loads: list[dict], **arguments) -> xarray.Dataset:
    """A wave along x of 0.5 um on 128 nodes, alike bodies with mu = 0.3 where nothing else is given."""
    wave = {"shape": "formula", "expression": f"{AMPLITUDE}*(1 - cos(2*pi*x/{LENGTH}))"}
    grid = {"extent": [LENGTH, LENGTH / 32], "spacing": LENGTH / 128, "boundary": "periodic"}
    given = {"body_1": {**STEEL, "surface": wave}, "body_2": STEEL, "friction_coefficient": 0.3}
    return Case(**(given | grid | {"loads": loads} | arguments)).run().dataset


AMPLITUDE, LENGTH = 0.5e-6, 100e-6
FLAT_WAVE = math.pi * E_STAR * AMPLITUDE / LENGTH  # mean pressure of complete contact, 1.81 GPa


def gap_of(pressure: float) -> float:
    """Mean gap of Westergaard's wave: the integral over the load of the approach of a row of flat punches."""
    share = min(pressure / FLAT_WAVE, 1.0)
    return AMPLITUDE * (1.0 - share + share * math.log(share))


@pytest.mark.parametrize("share", [0.5, 1.4])
@pytest.mark.parametrize("slip", [0.2, 0.6])
def test_sheared_waves(share: float, slip: float) -> None:
    """Of Jaeger and Ciavarella, q = mu (p(P) - p(P*)) and shift = mu (gap(P*) - gap(P)), in both directions.

    In complete contact all nodes stick until P* leaves it.
    """
    pressure, mu = share * FLAT_WAVE, 0.3
    traction = mu * slip * pressure
    shift = mu * (gap_of((1.0 - slip) * pressure) - gap_of(pressure))
    pulled = strip([{"mean_pressure": pressure}, {"mean_traction_x": traction}]).isel(step=-1)
    assert float(pulled["shift_x"]) == pytest.approx(shift, rel=2e-3, abs=1e-15)
    less = strip([{"mean_pressure": (1.0 - slip) * pressure}], friction_coefficient=None)["pressure"][-1]
    superposed = mu * (pulled["pressure"] - less).values
    assert abs(pulled["traction_x"].values - superposed).max() < 2e-8 * mu * pressure
    assert (float(pulled["stick_area"] / pulled["contact_area"]) > 0.999) == (shift == 0.0)
    if not shift > 0.0:
        return
    pushed = strip([{"mean_pressure": pressure}, {"shift_x": shift}]).isel(step=-1)
    assert float(pushed["traction_x"].mean()) == pytest.approx(traction, rel=2e-3)
    assert float(pushed["operator_applications"]) < 40


def test_the_least_shift_of_a_complete_contact_slips() -> None:
    """The mean traction is mu (P - P*) at once, with P* that of complete contact, and back as much."""
    shifts = [{"shift_x": 1e-12}, {"shift_x": 0.0}]
    found = strip([{"mean_pressure": 2.5e9}, *shifts])["traction_x"].mean(("row", "col"))
    assert found.values[1:] == pytest.approx(
        [0.3 * (2.5e9 - FLAT_WAVE), -0.3 * (2.5e9 - FLAT_WAVE)], rel=0.05
    )


def test_layers_take_up_the_shift_of_a_complete_contact() -> None:
    """Springs, and a layer between rigid bodies: all sticks, the mean traction is stiffness x shift."""
    loads = [{"mean_pressure": 2.5e9}, {"shift_x": 4e-9, "steps": 2}]
    springs = {"coefficient": "1e18 Pa/m", "tangential_stiffness": "1e16 Pa/m"}
    layer = {"thickness": "5 um", "young_modulus": "300 GPa", "poisson_ratio": 0.2}
    wave = {"shape": "formula", "expression": f"1e-8*(1 - cos(2*pi*x/{LENGTH}))"}
    rigid = {"body_1": {"rigid": True, "surface": wave, "coating": [layer]}, "body_2": {"rigid": True}}
    for bodies, stiffness in (({"interface": springs}, 1e16), (rigid, 125e9 / 5e-6)):
        last = strip(loads, **bodies).isel(step=-1)
        assert float(last["stick_area"]) == pytest.approx(LENGTH**2 / 32)
        assert float(last["traction_x"].mean()) == pytest.approx(4e-9 * stiffness, rel=1e-7)


def test_no_slip_holds_a_complete_contact() -> None:
    loads = [{"mean_pressure": 2.5e9}, {"mean_traction_x": 1e8}]
    held = strip(loads, friction_coefficient=math.inf).isel(step=-1)
    assert (float(held["shift_x"]), float(held["traction_x"].min())) == pytest.approx((0.0, 1e8), abs=1e-6)
    with pytest.raises(ConvergenceError, match="without slip takes up a shift .*: expected mean_traction_x"):
        strip([loads[0], {"shift_x": 1e-9}], friction_coefficient=math.inf)


def test_no_approach_of_hertz_stands_beside_mean_planes() -> None:
    """A sphere in a cell of ten contact diameters: its pressure is that of Hertz, its approach is another."""
    body = {**STEEL, "surface": {"shape": "sphere", "radius": "10 mm"}}
    grid = {"extent": ["2 mm", "2 mm"], "nodes_across": 128, "boundary": "periodic"}
    result = Case(body_1=body, body_2=STEEL, normal_load=10.0, **grid).run()
    last = result.history.to_dict("records")[-1]
    compared = against_hertz(result.deck, result.dataset.attrs, last)
    assert [name for name, *_ in compared] == ["max_pressure", "contact_radius"]
    assert "plane" not in hertz_rows(compared, last)[0][0]


def test_fields_go_on_beyond_the_sides_of_a_window_that_repeats() -> None:
    """A point, and those a period away, have one value; so has its image beyond the middle of the wave."""
    case = waves(mean_pressure=0.7 * FULL)
    result, (dy, dx), lattice = case.run(), case.lattice.shape * case.lattice.basis.diagonal(), case.lattice
    x, y = lattice.x.max() + 0.4 * dx / lattice.n_col, lattice.start[1] + np.array([0.0, 0.3, 0.996]) * dy
    for name in ("pressure", "gap", "zone"):
        here = result.at(name, x, y)
        assert np.isfinite(here).all()
        for a, b in ((1, 0), (-1, 0), (0, 1), (3, -2)):
            beyond = result.at(name, x + a * dx, y + b * dy)
            np.testing.assert_allclose(beyond, here, rtol=1e-6, atol=1e-6 * HEIGHT)
    assert result.at("pressure", x, y)[1] > 0.0
    np.testing.assert_allclose(result.at("pressure", -x, -y), result.at("pressure", x, y), rtol=1e-6)


def test_pictures_of_a_window_that_repeats() -> None:
    """Its sides are outlined, its contacts go on there, and no radius or ellipse stands for them."""
    case = waves(nodes=32, loads=[{"mean_pressure": 0.2 * FULL, "steps": 2}])
    result, lattice = case.run(), case.lattice
    axes = plotting.contact_boundary(result).axes[0]
    lines = drawn.by_label(axes)
    assert lines.keys() == {"in contact", "boundary node"}
    x, y = drawn.si(axes, lines["boundary node"])
    at_sides = (abs(x - lattice.x.min()) < 1e-9) | (abs(y - lattice.y.min()) < 1e-9)
    assert 0 < at_sides.sum() < 8  # where the edges of the four quarters at the corners cross the sides
    outline = axes.patches[0].get_path().vertices[-5:]  # a hole in the white beyond the window
    corners = outline.T * drawn.units(axes.get_xlabel())
    np.testing.assert_allclose(np.ptp(corners, axis=1), WAVE, rtol=1e-6)
    middle = corners.min(axis=1) + 0.5 * WAVE
    nodes = [0.5 * (at.min() + at.max()) for at in (lattice.x, lattice.y)]
    np.testing.assert_allclose(middle, nodes, atol=1e-9)
    (low, high), *_ = axes.get_xlim(), axes.get_ylim()
    assert low < corners[0].min() / drawn.units(axes.get_xlabel())
    assert high > corners[0].max() / drawn.units(axes.get_xlabel())
    assert plotting.section(result).axes[0].get_xlabel() == "x (µm) at y = 0 m"
    assert "distance from (0, 0)" in plotting.section(result, angle=0.3).axes[0].get_xlabel()
    panels = [axes for axes in plotting.history(result).axes if axes.get_visible()]
    names = ["mean pressure (MPa)", "mean gap (nm)", "contact area (% of the window)", "max pressure (MPa)"]
    assert [axes.get_ylabel() for axes in panels] == names
    area = panels[2].lines[0].get_ydata()
    share = result.dataset["contact_area"].values / WAVE**2
    np.testing.assert_allclose(area, [0.0, *(100.0 * share)], rtol=1e-9)
    band = panels[2].collections[0].get_paths()[0].vertices
    error = result.dataset["contact_area_error"].values[-1] / WAVE**2
    assert band[:, 1].max() == pytest.approx(100.0 * (share[-1] + error))
