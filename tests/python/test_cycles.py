"""Segments, cycles and half-axes: what tables, JSON, results and pictures say of them."""

from pathlib import Path

import drawn
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Console
from typer.testing import CliRunner

from hexcontact import Case, Result, open_result, plotting
from hexcontact.cli import printed
from hexcontact.cli.app import app
from hexcontact.result.history_words import contact_size, energy_table, some_steps
from hexcontact.variables import VARIABLES

DECK = """\
title = "To and fro"
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "paraboloid", radius_x = "30 mm", radius_y = "10 mm" }
[body.2]
young_modulus = "210 GPa"
poisson_ratio = 0.3
[friction]
coefficient = 0.5
[grid]
nodes_in_radius = 9
[[load]]
normal_load = "100 N"
label = "press"
"""
SHEAR = '[[load]]\ntangential_load_x = "{} N"\nsteps = {}\nlabel = "{}"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cycles")
    legs = [(30, 6, "to"), (-30, 12, "fro"), (30, 12, "back"), (-30, 7, "fro"), (30, 8, "back")]
    deck = DECK + "".join(SHEAR.format(*leg) for leg in legs)
    Case.from_text(deck).run(folder / "loop.nc")
    return folder


@pytest.fixture(scope="module")
def result(folder: Path) -> Result:
    return open_result(folder / "loop.nc")


def test_segments_and_cycles_of_a_result(result: Result) -> None:
    segments, cycles = result.segments, result.cycles
    assert segments["label"].to_list() == ["press", "to", "fro", "back", "fro", "back"]
    assert segments[["first_step", "last_step"]].to_numpy().tolist() == [
        [1, 1], [2, 7], [8, 19], [20, 31], [32, 38], [39, 46]
    ]  # fmt: skip
    energy = result.dissipated_energy.values
    assert segments["dissipated_energy"].sum() == pytest.approx(energy[-1])
    assert cycles["loading"].to_list() == ["shear", "shear"]
    assert cycles[["first_step", "last_step"]].to_numpy().tolist() == [[8, 31], [32, 46]]
    assert cycles["dissipated_energy"].to_list() == pytest.approx(
        [energy[30] - energy[6], energy[45] - energy[30]]
    )
    # the work of the load is what friction dissipates, but for the chords between the steps
    np.testing.assert_allclose(cycles["loop_area"], cycles["dissipated_energy"], rtol=0.03)
    assert (cycles["loop_area"] < cycles["dissipated_energy"]).all()


def test_area_of_a_loop_is_no_energy_where_other_loads_do_work() -> None:
    legs = [(s, {"tangential_load_x": f"{s * 0.5} mu P", "steps": 4}) for s in (1, -1, 1)]
    pressed, changes = {"normal_load": 100.0}, {"bulk stress": "bulk_stress_xx", "normal load": "normal_load"}
    deck = Case.from_text(DECK).deck_text
    for words, key in changes.items():
        value = {"bulk_stress_xx": 5e7, "normal_load": 20.0}[key]
        path = [load | {key: (100.0 if key == "normal_load" else 0.0) + s * value} for s, load in legs]
        bulk = {"bulk": {"body": 1}} if key == "bulk_stress_xx" else {}
        result = Case.from_text(deck, overrides={"load": [pressed, *path], **bulk}).run()
        [other] = result.cycles["other_work"]
        assert other == words
        [row] = [row for row in energy_table(printed.histories_of(result), 24)[1] if row[0] == "cycle 1"]
        assert row[-1].endswith(f", without {words}")
    [other] = (
        Case.from_text(deck, overrides={"load": [pressed, *(load for _, load in legs)]})
        .run()
        .cycles["other_work"]
    )
    assert other == ""


def test_nothing_is_worn_without_wear(result: Result) -> None:
    with pytest.raises(ValueError, match="the surfaces do not wear"):
        plotting.field_map("worn_depth", result)


def test_tables_and_json_have_the_energies(folder: Path, result: Result) -> None:
    shown = CliRunner().invoke(app, ["info", str(folder / "loop.nc")]).stdout
    assert "Dissipated energy" in shown and "segment 6" in shown and "cycle 2" in shown
    content = printed.file_content(result)
    assert [cycle["dissipated_energy"] for cycle in content["cycles"]] == result.cycles[
        "dissipated_energy"
    ].to_list()
    assert [part["last_step"] for part in content["segments"]] == [1, 7, 19, 31, 38, 46]
    frictionless = Case.from_text(DECK.replace("[friction]\ncoefficient = 0.5\n", "")).run()
    assert len(frictionless.cycles) == 0 and "dissipated_energy" not in frictionless.segments


def test_a_short_history_keeps_ends_and_peaks(result: Result) -> None:
    histories = printed.histories_of(result)
    places = some_steps(histories, 24)
    assert len(places) == 24 and {0, 6, 18, 30, 37, 45} <= set(places)
    assert len(some_steps(histories, 4)) == 4 and some_steps(histories, 4)[-1] == 45
    shown = Console(width=200, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    shown.print(printed.history_table(histories, shown))
    text = shown.export_text()
    assert text.count("-30.00 N") == 2 and text.count("30.00 N") == 5  # each end of a segment


def test_an_ellipse_has_half_axes(result: Result) -> None:
    last = printed.histories_of(result)[-1]
    name, words = contact_size(last)
    assert name == "contact half-axes" and " by " in words
    assert result.contact_semi_major[-1] * result.contact_semi_minor[-1] * np.pi == pytest.approx(
        float(result.contact_area_fit[-1]), rel=1e-3
    )
    assert VARIABLES["contact_semi_major"].units == "m"
    pressed = Case.from_text(DECK.replace("[friction]\ncoefficient = 0.5\n", "")).run()
    rows = printed.Summary.of_result(pressed).hertz
    assert [row[0] for row in rows] == [
        "max_pressure",
        "approach",
        "contact_semi_major",
        "contact_semi_minor",
    ]
    for _, exact, computed, _ in rows[2:]:
        assert computed == pytest.approx(exact, rel=5e-3)


def test_a_loop_of_chosen_cycles(result: Result) -> None:
    [axes] = plotting.loop(result).axes
    [filled] = axes.patches  # the last cycle
    assert filled.get_label().startswith("cycle 2:\n")
    [axes] = plotting.loop(result, [1, -1]).axes
    names = [patch.get_label().split(":")[0] for patch in axes.patches]
    assert names == ["cycle 1", "cycle 2"] and "computed" not in drawn.by_label(axes)
    factor = drawn.units(axes.get_xlabel()) * drawn.units(axes.get_ylabel())
    for patch, area in zip(axes.patches, result.cycles["loop_area"], strict=True):
        assert abs(drawn.area([patch.get_path().vertices])) * factor == pytest.approx(area)
    with pytest.raises(ValueError, match="there is no cycle 3; the history has 2"):
        plotting.loop(result, 3)


def test_cycles_on_the_command_line(folder: Path, tmp_path: Path, result: Result) -> None:
    picture = tmp_path / "loop.png"
    command = ["plot", str(folder / "loop.nc"), "-w", "loop", "--cycle", "all", "-o", str(picture)]
    assert CliRunner().invoke(app, command).exit_code == 0
    np.testing.assert_array_equal(drawn.pixels(picture), drawn.pixels(plotting.loop(result, [1, 2])))


PANELS = (
    "pressure",
    "traction_x",
    "section",
    "tractions",
    "zones",
    "outlines",
    "boundary",
    "loop",
    "history",
)


@pytest.mark.parametrize("name", PANELS)
def test_a_figure_draws_into_axes_of_the_caller(name: str, result: Result) -> None:
    figure = Figure(layout="constrained")
    left, right = figure.subplots(1, 2)
    options = {"quantities": ["contact_area", "stick_area"]} if name == "history" else {}
    assert plotting.FIGURES[name](result, ax=right, **options) is figure
    assert drawn.data_artists(right) and not drawn.data_artists(left)
    assert figure.get_suptitle() == "" and right.get_xlabel()


def test_axes_of_the_caller_hold_one_step(result: Result) -> None:
    axes = Figure().add_subplot()
    for name in ("zones", "pressure", "tractions"):
        with pytest.raises(ValueError, match="ax holds the .* of one load step, not of 2"):
            plotting.FIGURES[name](result, [1, 2], ax=axes)
    with pytest.raises(ValueError, match="ax holds quantities of one unit"):
        plotting.history(result, ax=axes)


def test_a_history_with_many_peaks_keeps_the_ends_of_its_segments() -> None:
    # twenty segments of three steps; the torque turns in every step
    histories = [
        {"segment": 1 + k // 3, "normal_load": 9.0, "torque": 1e-5 * (-1) ** k}
        | {"approach": 1e-6, "contact_radius": 1e-4, "max_pressure": 1e9}
        for k in range(60)
    ]
    places = some_steps(histories, 24)
    assert len(places) == 24 and set(range(2, 60, 3)) <= set(places)


def test_rounding_errors_of_a_constant_pressure_are_no_peaks() -> None:
    histories = [
        {"segment": 1 + k // 30, "normal_load": 9.0, "torque": 1e-5 * (k % 15)}
        | {"approach": 1e-6, "contact_radius": 1e-4, "max_pressure": 1e9}
        for k in range(60)
    ]
    noisy = [history | {"max_pressure": 1e9 * (1 + 3e-9 * (-1) ** k)} for k, history in enumerate(histories)]
    assert some_steps(noisy, 12) == some_steps(histories, 12)


@pytest.mark.parametrize(
    ("radius_x", "radius_y"), [("38 mm", "12 mm"), ("12 mm", "38 mm"), ("10 mm", "10 mm")]
)
def test_labels_of_pictures_are_inside_of_them(radius_x: str, radius_y: str) -> None:
    shape = 'radius_x = "{}", radius_y = "{}"'
    deck = DECK.replace(shape.format("30 mm", "10 mm"), shape.format(radius_x, radius_y))
    result = Case.from_text(deck + SHEAR.format(30, 2, "to")).run()
    for name in ("pressure", "traction_y", "slip_increment", "dissipation_density", "outlines", "boundary"):
        figure = plotting.FIGURES[name](result)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        box, (width, height) = figure.get_tightbbox(canvas.get_renderer()), figure.get_size_inches()
        assert box.x0 > -0.01 and box.x1 < width + 0.01, (name, box)
        assert box.y0 > -0.01 and box.y1 < height + 0.01, (name, box)


@pytest.mark.parametrize(("radius_x", "radius_y"), [("200 mm", "10 mm"), ("10 mm", "200 mm")])
def test_elongated_contacts_fill_the_page(radius_x: str, radius_y: str) -> None:
    shape = 'radius_x = "{}", radius_y = "{}"'
    deck = DECK.replace(shape.format("30 mm", "10 mm"), shape.format(radius_x, radius_y))
    result = Case.from_text(deck).run()
    for name in ("pressure", "zones", "overview", "boundary", "slip_increment"):
        figure = plotting.FIGURES[name](result)
        drawn.pixels(figure, 60)
        box = figure.axes[0].get_window_extent()
        share = max(box.width / figure.bbox.width, box.height / figure.bbox.height)
        assert share > (0.5 if name == "overview" else 0.7), name
        for legend in figure.legends:
            assert legend.get_window_extent().width <= figure.bbox.width, name
