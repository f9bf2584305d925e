"""What is to be expected of a case before it is solved, and what is worth a warning."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from hexcontact import AccuracyWarning, Case, ElasticPair, PlausibilityWarning, open_result
from hexcontact.analytic import hertz_ellipse, hertz_sphere
from hexcontact.analytic.friction import MindlinContact
from hexcontact.cli.app import app
from hexcontact.core.flat import expected_lattice_errors
from hexcontact.core.measures import NO_VALUE, expected_entry_error
from hexcontact.deck.toml import STARTERS, starter
from hexcontact.problem import plausibility

ROOT = Path(__file__).parents[2]
DECK = starter("fretting")


def case(**changes: Any) -> Case:
    return Case.from_text(DECK, overrides={key.replace("__", "."): value for key, value in changes.items()})


def warned(**changes: Any) -> list[str]:
    return plausibility.warnings(case(**changes))


def test_the_estimate_is_that_of_hertz() -> None:
    found, pressed = plausibility.expected(case()), case()
    hertz = hertz_sphere(pressed.pair.effective_modulus, 10e-3, normal_load=100.0)
    assert found["contact_radius"] == pytest.approx(hertz.contact_radius, rel=0.02)
    assert found["half_width"] == pytest.approx(hertz.contact_radius, rel=0.02)
    assert found["max_pressure"] == pytest.approx(hertz.max_pressure, rel=0.02)
    assert found["pressure_ratio"] == found["max_pressure"] / pressed.pair.effective_modulus
    assert found["slope"] == pytest.approx(hertz.contact_radius / 10e-3, rel=0.15)
    assert found["spacings"] == pytest.approx(20.0, rel=0.02)


@pytest.mark.parametrize("name", STARTERS)
def test_starter_decks_need_no_warning(name: str) -> None:
    assert plausibility.warnings(Case.from_text(starter(name))) == []


@pytest.mark.parametrize("path", sorted((ROOT / "cases").glob("*.toml")), ids=lambda path: path.stem)
def test_cases_need_no_warning(path: Path) -> None:
    if "study" not in path.stem:
        assert plausibility.warnings(Case.from_toml(path)) == []


@pytest.mark.parametrize(
    ("changes", "sentences"),
    [
        (
            {"body__1__young_modulus": "113.8 Pa"},
            [
                "the surfaces slope by 17 ",
                "the largest pressure is 12 E*",
                "a Young's modulus of 113.8 Pa is",
            ],
        ),
        (
            {
                "body__1__young_modulus": 210000,
                "body__1__surface__radius": 10,
                "body__2__rigid": True,
                "body__2__young_modulus": None,
                "body__2__poisson_ratio": None,
                "load__1__normal_load": 1e4,
            },
            [
                "a Young's modulus of 210000 Pa is below that of rubber, expected at least 1e6: bare",
                "the slip annulus of the tangential",
            ],
        ),
        ({"body__1__surface__radius": "25 m"}, ["the largest pressure is only 8.1e-05 E*"]),
        (
            {"load__1__normal_load": "40 kN"},
            [
                "the surfaces slope by 0.16 ",
                "the largest pressure is 0.11 E*",
                "the slip annulus of the tangential",
            ],
        ),
        (
            {"friction__coefficient": 55},
            ["friction.coefficient = 55, expected at most 3", "the slip annulus of the tangential"],
        ),
        ({"friction__coefficient": float("inf")}, []),
        ({"friction__coefficient": "0.3 + 0*x", "solver__entry": "interpolated"}, []),
        (
            {"friction__coefficient": 55, "friction__shear_limit": "90 MPa", "solver__entry": "interpolated"},
            ["friction.coefficient = 55, expected at most 3"],
        ),
        (
            {"grid__nodes_in_radius": 2},
            ["2 spacings in the contact radius may leave errors of 65 % or more in the stick"],
        ),
        (
            {"solver__entry": "implicit"},
            ["the contact grows in 4.9 even steps, which leaves an error of about 41 %"],
        ),
        (
            {"solver__entry": "implicit", "load__1__steps": 1},
            ["the contact grows in one step, which leaves an error of about "],
        ),
        ({"solver__entry": "implicit", "load__1__steps": 40}, []),
        ({"solver__entry": "implicit", "load__1__steps": "auto"}, []),
    ],
)
def test_a_warning_for_each_limit_that_is_passed(changes: dict[str, Any], sentences: list[str]) -> None:
    found = warned(**changes)
    assert len(found) == len(sentences)
    for sentence, begin in zip(found, sentences, strict=True):
        assert sentence.startswith(begin)
        assert "\n" not in sentence


def test_loads_that_grow_together_are_warned_of_with_alike_bodies() -> None:
    alike = {"body__2__young_modulus": "210 GPa", "body__2__poisson_ratio": 0.3, "solver__entry": "implicit"}
    load = {"normal_load": "100 N", "tangential_load_x": "6 N", "steps": 5}
    [sentence] = warned(**alike, load=[load])
    assert "about 32 % in the shear tractions" in sentence
    assert warned(**alike, load=[load | {"steps": 60}]) == []
    assert warned(**alike) == []  # pressed, then sheared


def test_the_size_of_an_elongated_contact_is_two_half_axes() -> None:
    surface = {"shape": "paraboloid", "radius_x": "5 mm", "radius_y": "50 mm"}
    long = case(body__1__surface=surface, grid__nodes_in_radius=5)
    pressed = hertz_ellipse(long.pair.effective_modulus, np.diag([1 / 5e-3, 1 / 50e-3]), normal_load=100.0)
    words = plausibility.row(long)
    major, minor = (float(part) for part in re.findall(r"([\d.]+) µm", words)[:2])
    assert words.startswith("half-axes about ") and "spacings in the smaller one" in words
    assert (major, minor) == pytest.approx((1e6 * pressed.semi_major, 1e6 * pressed.semi_minor), rel=0.05)
    assert "spacings in the smaller half-axis of the contact may" in plausibility.warnings(long)[0]
    assert plausibility.row(case()).startswith("radius about 234 µm, 20 spacings;")


def test_a_ring_is_no_disc_in_check_warning_and_summary() -> None:
    ring = {"shape": "torus", "ring_radius": "0.5 mm", "radius": "2 mm"}
    tables = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    made = Case(body_1={**tables, "surface": ring}, body_2=tables, spacing=20e-6, normal_load=20.0)
    words = plausibility.row(made)
    size = (
        r"radius about 1[5-9]\d µm of the circle of the same area, about (\d\.\d) spacings in the half-width "
    )
    found = re.match(size + r"of its parts; extent about 1\.0\d mm in x", words)
    assert found and float(found[1]) < 2.5  # 0.6, were the estimate fine enough; 35 in the ellipse
    assert any(
        "spacings in the half-width of the parts of the contact may" in s for s in plausibility.warnings(made)
    )
    with pytest.warns(PlausibilityWarning):
        shown = made.run()._repr_html_()
    assert "µm of the circle of the same area; the contact extends over 1.0" in shown


def test_a_sharp_tip_is_told() -> None:
    for surface, sharp in (
        ({"shape": "cone", "slope": 0.01}, True),
        ({"shape": "power", "exponent": 1, "coefficient": 0.01}, True),
        ({"shape": "power", "exponent": 1.5, "coefficient": "1 m^-0.5"}, False),
    ):
        found = plausibility.notes(case(body__1__surface=surface))
        assert ("the pressure is unbounded at a sharp tip" in found.get("tips", "")) == sharp
    stiff = {"coefficient": "1e14 Pa/m"}
    assert "tips" not in plausibility.notes(
        case(body__1__surface={"shape": "cone", "slope": 0.01}, interface=stiff)
    )


SOCKET = {"shape": "formula", "expression": "-(x**2 + y**2)/(2*10.05e-3)"}
GROOVE = {"shape": "formula", "expression": "-x**2/(2*4.89e-3) + y**2/(2*18.2375e-3)"}


@pytest.mark.parametrize(
    ("radius", "other", "load", "slopes"),
    [
        (10e-3, SOCKET, 200e3, (1.379, 1.372)),  # contact radius 13.79 mm
        (4.7625e-3, GROOVE, 555.5556, (0.2816, 0.2742)),  # half-axis 1.3409 mm
    ],
)
def test_surfaces_that_conform_are_judged_by_the_slope_of_each(
    radius: float, other: dict[str, str], load: float, slopes: tuple[float, float]
) -> None:
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    bodies: Any = [{**steel, "surface": {"shape": "sphere", "radius": radius}}, {**steel, "surface": other}]
    for turned in (False, True):
        one, two = bodies[::-1] if turned else bodies
        conforming = Case(body_1=one, body_2=two, nodes_in_radius=20, normal_load=load)
        assert conforming.estimate is not None
        found = conforming.estimate.body_slopes[::-1] if turned else conforming.estimate.body_slopes
        assert found == pytest.approx(slopes, rel=0.07)  # to the node next to the edge
        assert plausibility.expected(conforming)["gap_slope"] < 0.03
        sentence = next(line for line in conforming.warnings if "half-space theory" in line)
        assert sentence.startswith(f"body {1 + turned} slopes by {max(found):.2g} (the gap by 0.0")
        assert f"slope at the edge {max(found):.2g} (the gap by" in plausibility.row(conforming)


def test_a_gap_from_python_gets_a_note_that_the_bodies_are_not_judged() -> None:
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    known: Any = {"body_1": steel, "body_2": steel, "nodes_in_radius": 20, "normal_load": 100.0}
    given = Case(**known, gap=lambda x, y: (x**2 + y**2) / 20e-3)
    note = "note: the slopes of the bodies are not judged, since only their gap is known"
    for shown in (repr(given), given._repr_html_(), repr(result := given.run()), result._repr_html_()):
        assert note in shown
    surface = {"shape": "sphere", "radius": 10e-3}
    assert "note: " not in repr(Case(**known | {"body_1": {**steel, "surface": surface}}))


def test_python_warns_once_at_the_line_of_the_program() -> None:
    doubtful: Any = {"friction__coefficient": 55, "grid__nodes_in_radius": 3}
    line = "friction.coefficient = 55, expected at most 3"
    with pytest.warns(PlausibilityWarning) as built:
        one = case(**doubtful)
    assert [str(warning.message)[: len(line)] for warning in built] == [line]
    with pytest.warns(PlausibilityWarning) as ran:
        result = one.run(on_step=lambda step: True)
    assert [str(warning.message) for warning in ran] == one.warnings[1:]
    assert len(one.warnings) == 3
    assert {warning.filename for warning in (*built, *ran)} == {__file__}
    for shown in (repr(one), one._repr_html_(), repr(result), result._repr_html_()):
        assert all(f"warning: {sentence}" in shown.replace("&#x27;", "'") for sentence in one.warnings)
    with pytest.warns(PlausibilityWarning) as changed:
        started = one.changed({"friction.coefficient": 0.3}).start()
    assert [str(warning.message) for warning in changed] == [
        sentence for sentence in started.case.warnings if "spacings" in sentence
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(one.warnings) == 3
        one.run(on_step=lambda step: True)
        repr(case(grid__nodes_in_radius=3))


def test_adaptive_steps_that_miss_their_tolerance_are_warned_of() -> None:
    load = [{"normal_load": 100.0, "tangential_load_x": 24.0, "steps": "auto"}]
    solver = {"solver__entry": "implicit", "solver__step_tolerance": 1e-3}
    for nodes in (5, 4, 6, 7):  # last bits decide on which lattices a step is limited
        one = case(**solver, load=load, grid__nodes_in_radius=nodes)
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            missed = one.run(on_step=lambda step: step.history["step_limited"] == 1).step_limited.values == 1
        accuracy = [warning for warning in found if warning.category is AccuracyWarning]
        assert len(accuracy) == missed.any()
        if missed.any():
            break
    assert "than solver.step_tolerance = 0.001" in str(accuracy[0].message)
    assert accuracy[0].filename == __file__


def test_the_errors_stated_of_coarse_lattices_bound_those_of_solutions() -> None:
    """Against Hertz, Mindlin and Deresiewicz, with a node in the center of the contact and elsewhere."""
    steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    ball: Any = {**steel, "surface": {"shape": "sphere", "radius": 10e-3}}
    pair = ElasticPair.from_materials(210e9, 0.3, 210e9, 0.3)
    hertz = hertz_sphere(pair.effective_modulus, 10e-3, normal_load=100.0)
    a, compliance = hertz.contact_radius, 4.0 * (2.0 - 0.3) * (1.0 + 0.3) / 210e9
    judged = 0
    for nodes in (1, 1.25, 1.5, 1.75, 2, 2.5, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12):
        for share, place in ((0.5, (0.0, 0.0)), (0.8, (0.31, 0.77))):
            mindlin = MindlinContact(0.3, 100.0, a, compliance)
            peak = share * mindlin.sliding_load
            path = [{"tangential_load_x": load * peak, "steps": 8} for load in (1.0, -1.0, 1.0)]
            result = Case(
                body_1=ball,
                body_2=steel,
                nodes_in_radius=nodes,
                origin=[shift * a / nodes * (nodes > 1) for shift in place],  # else the contact is too small
                friction_coefficient=0.3,
                loads=[{"normal_load": 100.0}, *path],
                fields=["zone"],
            ).run()
            found = {
                "max_pressure": (result.max_pressure[-1], hertz.max_pressure),
                "contact_area": (result.contact_area_fit[-1], np.pi * a**2),
                "stick_area": (result.stick_area_fit[8], np.pi * mindlin.stick_radius(peak) ** 2),
                "dissipated_energy": (
                    result.dissipated_energy[-1] - result.dissipated_energy[8],
                    mindlin.energy_per_cycle(peak),
                ),
            }
            stated, _ = expected_lattice_errors(nodes, share, 0.05)
            for bound, (name, (value, exact)) in zip(stated, found.items(), strict=True):
                assert bound == NO_VALUE or abs(float(value) / exact - 1.0) < bound, (nodes, share, name)
                judged += bound < NO_VALUE
    assert judged > 80


def test_a_refined_lattice_is_judged_by_its_error_bars() -> None:
    assert warned(grid__nodes_in_radius=3, accuracy__target=0.05, solver__entry="interpolated") == []


def test_steps_leave_the_error_that_is_expected() -> None:
    """Measured against twenty steps with interpolated entry, as in docs/theory/expected_errors.md."""

    def tractions(steps: int, entry: str) -> np.ndarray:
        pressed = {"normal_load": 100.0, "steps": steps, "ramp": "cubic"}
        last = case(grid__nodes_in_radius=10, solver__entry=entry, load=[pressed]).run().step(-1)
        return np.stack([last.traction_x.values, last.traction_y.values])

    exact = tractions(10, "interpolated")
    for steps in (1, 5):
        error = np.hypot(*(tractions(steps, "implicit") - exact)).sum() / np.hypot(*exact).sum()
        radii = np.arange(steps + 1.0) / steps
        expected, counted, _ = expected_entry_error(radii[:-1], radii[1:], 0.3 / 0.1167, None, 0.1)
        assert counted == pytest.approx(steps)
        assert expected == pytest.approx(error, rel=0.35)
    better = np.hypot(*(tractions(5, "interpolated") - exact)).sum() / np.hypot(*exact).sum()
    assert better < 0.06


def test_rules_and_their_inverses_agree() -> None:
    errors, needed = expected_lattice_errors(9.0, 0.5, 0.05)
    assert max(errors) < 0.05
    assert max(expected_lattice_errors(needed, 0.5, 0.05)[0]) == pytest.approx(0.05, rel=1e-12)
    assert not any(expected_lattice_errors(2.0, 0.0, 0.05)[0][2:])  # nothing slips
    linear = np.cbrt(np.arange(6.0) / 5.0)
    for stick, ratio in ((2.0, None), (0.0, 0.3)):
        _, counted, needed = expected_entry_error(linear[:-1], linear[1:], stick, ratio, 0.1)
        assert counted == pytest.approx(5.0)
        radii = np.linspace(0.0, 1.0, 1 + round(needed))
        assert expected_entry_error(radii[:-1], radii[1:], stick, ratio, 0.1)[0] == pytest.approx(
            0.1, rel=0.1
        )


def test_a_warning_is_said_by_all_that_speak_of_a_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("deck.toml").write_text(DECK, encoding="utf-8")
    coarse = ["--set", "grid.nodes_in_radius=3"]

    def ran(*words: str) -> Any:
        done = CliRunner().invoke(app, list(words))
        assert done.exit_code == 0, done.output
        return done

    sentence = "3 spacings in the contact radius may leave errors of "
    checked = ran("check", "deck.toml", *coarse)
    assert f"hexcontact: warning: {sentence}" in checked.stderr
    assert "deck.toml is ready to run" in checked.stdout
    told = json.loads(ran("check", "deck.toml", *coarse, "--json").stdout)
    [warning] = told["warnings"]
    assert warning.startswith(sentence)
    assert told["expected"]["lattice_error"] > 0.05
    assert {limit["quantity"] for limit in told["limits"]} == {
        limit.quantity for limit in plausibility.LIMITS
    }
    done = ran("run", "deck.toml", *coarse, "--log-file", "log")
    assert done.stderr.splitlines()[1] == f"warning: {warning}"
    assert sentence not in done.stdout
    assert f'doubtful warning="{warning}"' in Path("log").read_text(encoding="utf-8")
    assert open_result("deck.nc").dataset.attrs["warnings"] == warning
    assert f"note: {warning}" in ran("info", "deck.nc").stdout
    assert json.loads(ran("info", "deck.nc", "--json").stdout)["warnings"] == [warning]
    ran("report", "deck.nc")
    assert warning in Path("deck.html").read_text(encoding="utf-8")
    quiet = ran("run", "deck.toml", *coarse, "--quiet", "--overwrite")
    assert quiet.output == ""
    fine = ran("check", "deck.toml")
    assert fine.stderr == ""
    assert "contact " in fine.stdout
