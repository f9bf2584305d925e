"""Results beside closed solutions: which are told to hold, what they say, and where none does."""

import math
from typing import Any

import numpy as np
import pytest

from hexcontact import Case, DeckError, Result, analytic
from hexcontact.analytic.hertz_gap import against_hertz
from hexcontact.deck.surfaces import (
    Cone,
    Cylinder,
    FormulaSurface,
    Paraboloid,
    Power,
    Punch,
    RoundedPunch,
    Sphere,
)

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
SOFT = {"young_modulus": 70e9, "poisson_ratio": 0.33}
BALL = {**STEEL, "surface": Sphere(radius=10e-3)}
SHEAR = [{"normal_load": 100.0}, {"tangential_load_x": 18.0, "tangential_load_y": 6.0, "steps": 4}]


def run(surface: Any = None, **arguments: Any) -> Result:
    """Solve a case: a body on a flat of steel, 100 N, 12 spacings in the contact radius."""
    given = {"body_1": BALL, "body_2": STEEL, "nodes_in_radius": 12}
    if surface is not None:
        given["body_1"] = {"rigid": True, "surface": surface}
    if "loads" not in arguments:
        given["normal_load"] = 100.0
    return Case(**{**given, **arguments}).run()


def sheared(**arguments: Any) -> Result:
    return run(**{"friction_coefficient": 0.3, "loads": SHEAR, **arguments})


def found(result: Result, step: int = -1) -> dict[str, str]:
    """Return whose solutions are listed for which quantity."""
    return {entry.quantity: entry.solution for entry in result.compare(step=step)}


NORMAL = {"approach", "elastic_energy"}
HERTZ = {*NORMAL, "max_pressure", "contact_radius_fit", "pressure"}

SURFACES = {
    "sphere": (None, "Hertz", HERTZ),
    "ellipse": (Paraboloid(radius_x=10e-3, radius_y=20e-3, angle="30 deg"), "Hertz", HERTZ),
    "off center": (Sphere(radius=10e-3, offset=(1e-4, -2e-4)), "Hertz", HERTZ),
    "cone": (Cone(slope=0.01, offset=(1e-4, -2e-4)), "Sneddon", {*NORMAL, "contact_radius_fit"}),
    "power": (Power(exponent=4, coefficient=1e8, offset=(1e-4, 0.0)), "Sneddon", HERTZ),
    "punch": (Punch(radius=0.2e-3), "Sneddon", NORMAL),
    "rounded punch": (
        RoundedPunch(flat_radius=0.1e-3, edge_radius=10e-3),
        "Sneddon, Galin",
        HERTZ - {"elastic_energy"},
    ),
}


@pytest.mark.parametrize("name", SURFACES)
def test_each_shape_has_its_solution_and_is_near_it(name: str) -> None:
    surface, whose, quantities = SURFACES[name]
    comparison = run(surface).compare()
    assert {entry.solution for entry in comparison} == {whose}
    assert {entry.quantity for entry in comparison} == quantities
    # 12 spacings in the radius: nodal pressures next to the edge are off by some tenths of a spacing, and so
    # is the radius of a punch, whose nodes do not lie on its rim
    for entry in comparison:
        bound = 0.04 if entry.quantity == "pressure" else 0.02 if name == "punch" else 8e-3
        assert abs(entry.error) < bound, entry
    assert comparison.largest_error == max(abs(entry.error) for entry in comparison)


def test_the_values_are_those_of_hertz() -> None:
    result = run()
    comparison = result.compare()
    hertz = analytic.hertz_sphere(
        Case.from_text(result.deck).pair.effective_modulus, 10e-3, normal_load=100.0
    )
    assert comparison["approach"].exact == pytest.approx(hertz.approach)
    assert comparison["max_pressure"].exact == pytest.approx(hertz.max_pressure)
    assert comparison["contact_radius_fit"].exact == pytest.approx(hertz.contact_radius)
    # integral of P d(approach), P ~ approach^(3/2)
    assert comparison["elastic_energy"].exact == pytest.approx(0.4 * 100.0 * hertz.approach)
    entry = comparison["approach"]
    assert entry.computed == float(result.approach[0])
    assert entry.error == pytest.approx(entry.computed / entry.exact - 1.0)
    inside = result.pressure.values[0] > 0
    apart = (result.traction_field().at_nodes()[0] - hertz.pressure(np.hypot(result.x, result.y)))[inside]
    rms = math.sqrt(float((apart**2).mean())) / hertz.max_pressure
    assert comparison["pressure"].error == pytest.approx(rms)
    assert math.isnan(comparison["pressure"].exact)
    assert " spacings in the contact radius" in comparison.note


def test_similar_bodies_sheared_have_cattaneo_and_mindlin() -> None:
    result = sheared()
    whose = found(result)
    assert {whose[name] for name in ("stick_radius_fit", "shift_x", "shift_y", "traction_x")} == {
        "Cattaneo–Mindlin"
    }
    assert whose["approach"] == "Hertz"
    assert "elastic_energy" not in whose  # shear stores energy, too
    for entry in result.compare():
        assert abs(entry.error) < 0.0154, entry
    # Q / (mu P) = 19/30, c/a = (1 - Q/(mu P))^(1/3)
    comparison = result.compare()
    ratio = comparison["stick_radius_fit"].exact / comparison["contact_radius_fit"].exact
    assert ratio == pytest.approx((1 - math.hypot(18, 6) / 30) ** (1 / 3))
    # before there is shear only the pressure has a solution
    assert set(found(result, step=1).values()) == {"Hertz"}


def test_the_tables_of_the_command_follow_the_rule_of_the_comparison(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hertz holds for similar bodies with friction; of a deck of two surfaces no gap is fitted."""
    monkeypatch.setattr(np.linalg, "lstsq", None)
    for result in (sheared(), run(friction_coefficient=0.3, body_2=SOFT)):
        last = result.history.to_dict("records")[-1]
        rows = against_hertz(result.deck, result.dataset.attrs, last)
        comparison = {entry.quantity: entry for entry in result.compare() if entry.solution == "Hertz"}
        assert {name for name, *_ in rows} - {"contact_radius"} == comparison.keys() - {"pressure"}
        for name, exact, computed, _ in rows:
            entry = comparison.get(name)
            assert entry is None or (exact, computed) == (entry.exact, entry.computed)


def test_heights_that_are_not_shifted_count_in_the_approach() -> None:
    """A formula with a center of its own: the lowest gap is closed before the contact."""
    formula = FormulaSurface(expression="x**2/2e-2 + y**2/2e-2", offset=(2e-5, 0.0))
    ball = {**STEEL, "surface": Sphere(radius=10e-3)}
    comparison = run(body_1={**STEEL, "surface": formula}, body_2=ball, nodes_in_radius=24).compare()
    lowest = 2 * (1e-5) ** 2 / 2e-2
    assert abs(comparison["approach"].error) < 0.1 * lowest / comparison["approach"].exact


@pytest.mark.parametrize("name", ["cone", "power", "rounded punch", "punch"])
@pytest.mark.parametrize("back", [False, True])
def test_other_similar_surfaces_sheared_are_superposed(name: str, back: bool) -> None:
    plain, surface = {"young_modulus": 210e9, "poisson_ratio": 0.0}, SURFACES[name][0]
    loads = [*SHEAR, {"tangential_load_x": -3.0, "tangential_load_y": -1.0}] if back else SHEAR
    result = sheared(body_1={**plain, "surface": surface}, body_2=plain, loads=loads)
    comparison = result.compare()
    whose = {entry.quantity for entry in comparison if entry.solution == "Jaeger, Ciavarella"}
    singular, rim = name in ("cone", "punch"), name == "punch"
    tractions = set() if singular else {"traction_x", "traction_y"}
    assert whose == {"shift_x", "shift_y"} | tractions | (set() if rim else {"stick_radius_fit"})
    for entry in comparison:  # 12 spacings in the radius, as above; a kink of the traction at the stick zone
        assert abs(entry.error) < (0.05 if entry.quantity in tractions | {"pressure"} else 0.02), entry
    # shares of the shift are those of the load
    assert comparison["shift_y"].exact == pytest.approx(comparison["shift_x"].exact / 3)
    if name == "cone" and not back:  # delta = pi/2 m a, a ~ P^(1/2)
        slid = 1.0 - math.sqrt(1.0 - math.hypot(18, 6) / 30)
        shift = math.hypot(comparison["shift_x"].exact, comparison["shift_y"].exact)
        assert shift == pytest.approx(0.3 * comparison["approach"].exact * slid)


def test_after_a_reversal_it_is_mindlin_and_deresiewicz() -> None:
    result = sheared(loads=[{"normal_load": 100.0}, *({"tangential_load_x": q} for q in (20.0, -5.0))])
    comparison = result.compare()
    assert comparison["shift_x"].solution == "Mindlin–Deresiewicz"
    assert abs(comparison["shift_x"].error) < 9.5e-4
    assert abs(comparison["traction_x"].error) < 0.028


def test_torsion_has_lubkin() -> None:
    result = sheared(loads=[{"normal_load": 100.0}, {"torque": 2e-3, "steps": 2}])
    assert result.compare()["twist"].solution == "Lubkin"
    for step in (2, 3):
        assert abs(result.compare(step=step)["twist"].error) < 1.05e-3
    assert "twist" not in found(result, step=1)
    both = sheared(loads=[{"normal_load": 100.0}, {"torque": 2e-3}, {"tangential_load_x": 9.0}])
    assert "twist" in found(both, step=2)
    assert "twist" not in found(both)
    slides = sheared(loads=[{"normal_load": 100.0}, {"twist": 1.0}])
    assert int((slides.zone[-1] == 1).sum()) <= 1  # the node in the center, which does not move
    assert "twist" not in found(slides)


def test_dissimilar_bodies_have_what_goodman_and_spence_know() -> None:
    loads = [{"normal_load": 100.0, "ramp": "cubic", "steps": 12}]
    given: dict[str, Any] = {"body_2": SOFT, "nodes_in_radius": 16, "friction_coefficient": 0.05}
    goodman = run(**given, coupling="goodman", loads=loads)
    assert goodman.compare()["stick_radius_fit"].solution == "Goodman, Spence"
    assert abs(goodman.compare()["stick_radius_fit"].error) < 0.0103
    assert goodman.compare()["max_pressure"].solution == "Hertz"
    full = run(**given, loads=loads).compare()
    assert len(full) == 0
    assert "no closed-form solution is known for dissimilar bodies with friction" in full.note
    assert math.isnan(full.largest_error)
    assert full.note in repr(full)
    let_go = run(**given, coupling="goodman", loads=[*loads, {"normal_load": 50.0}])
    assert "stick_radius_fit" not in found(let_go)
    assert "stick_radius_fit" in found(let_go, step=12)


def test_bodies_that_cannot_slip_have_mossakovskii_and_spence() -> None:
    loads = [{"normal_load": 100.0, "ramp": "cubic", "steps": 16}]
    given: dict[str, Any] = {"body_2": {**SOFT, "poisson_ratio": 0.2}, "friction_coefficient": math.inf}
    comparison = run(**given, loads=loads).compare()
    assert {entry.quantity for entry in comparison} == {"approach", "contact_radius"}
    assert {entry.solution for entry in comparison} == {"Mossakovskii, Spence"}
    for entry in comparison:
        assert abs(entry.error) < 0.004, entry
    punch = run(Punch(radius=0.2e-3), **given).compare()
    assert [entry.solution for entry in punch] == ["Mossakovskii"]
    assert abs(punch["approach"].error) < 0.0156
    # a sphere in one step is another problem
    assert len(run(**given, algorithm="static").compare()) == 0


@pytest.mark.parametrize(
    "arguments",
    [
        {"surface": Sphere(radius=10e-3, exact=True)},
        {
            "body_1": {**STEEL, "surface": Cone(slope=0.01)},
            "body_2": {**STEEL, "surface": Sphere(radius=1.0)},
        },
        {"body_1": STEEL, "gap": lambda x, y: 0.005 * np.hypot(x, y)},
    ],
    ids=["true sphere", "two shapes", "gap of Python"],
)
def test_where_nothing_is_known_it_says_so(arguments: dict[str, Any]) -> None:
    comparison = run(**arguments).compare()
    assert len(comparison) == 0
    assert comparison.note == "no closed-form solution is known for these surfaces"


def test_a_quadratic_gap_of_python_has_hertz() -> None:
    by_function = run(body_1=STEEL, gap=lambda x, y: x**2 / 0.02 + y**2 / 0.03)
    assert set(found(by_function).values()) == {"Hertz"}
    note = "the gap was given in Python; the solutions are those of its values at the nodes"
    assert by_function.compare().note.endswith(f" spacings in the contact radius; {note}")
    crossed = run(
        body_1={**STEEL, "surface": Cylinder(radius=10e-3)},
        body_2={**STEEL, "surface": Cylinder(radius=10e-3, angle="90 deg")},
    )
    assert set(found(crossed).values()) == {"Hertz"}


def test_without_load_there_is_nothing_to_compare() -> None:
    result = run(loads=[{"normal_load": 100.0}, {"normal_load": 0.0}])
    assert result.compare().note == "nothing is pressed in this load step"
    assert len(result.compare(step=1)) == 5


def test_a_solution_of_ones_own() -> None:
    result = run()
    mine = result.compare({"approach": 2e-6, "max_pressure": 1e9}, name="mine")
    assert [(entry.quantity, entry.solution, entry.exact) for entry in mine] == [
        ("approach", "mine", 2e-6),
        ("max_pressure", "mine", 1e9),
    ]
    assert mine["approach"].error == pytest.approx(float(result.approach[0]) / 2e-6 - 1)
    modulus = float(result.dataset.attrs["effective_modulus"])
    hertz = result.compare(analytic.hertz_sphere(modulus, 10e-3, normal_load=100.0))
    assert {entry.quantity for entry in hertz} == {
        "normal_load",
        "approach",
        "max_pressure",
        "contact_radius",
    }
    assert abs(hertz["approach"].error) < 6e-4
    with pytest.raises(KeyError, match="did you mean approach"):
        result.compare({"aproach": 1.0})
    with pytest.raises(DeckError, match="pressure: expected a quantity with one value by step"):
        result.compare({"pressure": 1.0})
    with pytest.raises(DeckError, match="exact: expected values by the names of quantities"):
        result.compare(3.0)
    with pytest.raises(KeyError, match="no closed-form solution has shift_x"):
        _ = result.compare()["shift_x"]


def test_a_comparison_is_a_table() -> None:
    comparison = run().compare()
    table = comparison.to_dataframe()
    assert list(table.index) == [entry.quantity for entry in comparison]
    assert table.unit["approach"] == "m"
    assert table.error["approach"] == comparison["approach"].error
    lines = repr(comparison).splitlines()
    assert lines[0] == "Load step 1 against closed-form solutions"
    assert len({line.index("Hertz") for line in lines if "Hertz" in line}) == 1
    assert "<table" in comparison._repr_html_()
    assert comparison[0] is next(iter(comparison))
