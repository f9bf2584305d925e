"""Bodies with coatings: a sphere on a layer, limits, friction, waves, results, refused decks."""

import math
from pathlib import Path

import numpy as np
import pytest
from commands import inside
from validation import coatings

from hexcontact import Case, DeckError, analytic, open_result

A, RADIUS, E, NU = 0.01, 1.0, 1e9, 0.3
MODULUS = E / (1.0 - NU**2)
LOAD = 4.0 / 3.0 * MODULUS * A**3 / RADIUS
TABLE = Path(__file__).parents[1] / "reference" / "coated_sphere.csv"
SPHERES = np.loadtxt(TABLE, delimiter=",", skiprows=4)[::3]
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
HARD = {"thickness": 50e-6, "young_modulus": 420e9, "poisson_ratio": 0.2}


def layer(thickness: float, young_modulus: float = E, poisson_ratio: float = NU) -> dict:
    """A coating."""
    return {"thickness": thickness, "young_modulus": young_modulus, "poisson_ratio": poisson_ratio}


def pressed(base: dict, coating: list, load: float, spacing: float = A / 40, **tables) -> Case:
    """A rigid sphere on a body with coatings."""
    bodies = {
        "1": {**base, "coating": coating},
        "2": {"rigid": True, "surface": {"shape": "sphere", "radius": RADIUS}},
    }
    return Case.from_dict(
        {"body": bodies, "grid": {"spacing": spacing}, "load": [{"normal_load": load}]} | tables
    )


@pytest.mark.parametrize(("ratio", "t", "load", "approach", "pressure"), SPHERES)
def test_sphere_on_a_layer(ratio: float, t: float, load: float, approach: float, pressure: float) -> None:
    base = {"young_modulus": E / ratio, "poisson_ratio": NU} if ratio else {"rigid": True}
    case = pressed(base, [layer(t * A)], load * LOAD)
    last = case.run().dataset.isel(step=-1)
    middle = (last["pressure"].values)[last.sizes["row"] // 2, last.sizes["col"] // 2]
    assert case.pair.fit_error < 2e-7
    assert float(last["contact_radius_fit"]) == pytest.approx(A, rel=1e-3)
    assert float(last["approach"]) == pytest.approx(approach * A**2 / RADIUS, rel=2e-4)
    assert middle == pytest.approx(pressure * 2 * MODULUS * A / (math.pi * RADIUS), rel=2e-4)


def test_many_layers_are_one() -> None:
    """Three layers of one material, on a body of another."""
    base = {"young_modulus": E / 2, "poisson_ratio": 0.2}
    parts = [layer(0.2 * A), layer(0.3 * A), layer(0.5 * A)]
    one, three = (
        pressed(base, coating, LOAD, A / 10).run().dataset.isel(step=-1) for coating in ([layer(A)], parts)
    )
    for name in ("approach", "max_pressure"):
        assert float(three[name]) == pytest.approx(float(one[name]), rel=1e-6)


def test_thin_and_thick_layers() -> None:
    """A thin layer hardly changes the body below, on a thick one there is nothing else."""
    below = {"young_modulus": E / 2, "poisson_ratio": NU}
    thin = pressed(below, [layer(A / 1000)], LOAD).run().dataset.isel(step=-1)
    thick = pressed(below, [layer(1000 * A)], LOAD).run().dataset.isel(step=-1)
    for found, modulus in ((thin, MODULUS / 2), (thick, MODULUS)):
        hertz = analytic.hertz_sphere(modulus, RADIUS, normal_load=LOAD)
        assert float(found["approach"]) == pytest.approx(hertz.approach, rel=3e-3)
        assert float(found["max_pressure"]) == pytest.approx(hertz.max_pressure, rel=6e-3)


@pytest.mark.parametrize(("t", "excess"), [(0.1, 1.050), (0.03, 1.0147)])
def test_thin_layer_on_a_rigid_base(t: float, excess: float) -> None:
    """Springs of compression without expansion; the excess is that of the Fredholm equation."""
    shear = E / (2 * (1 + NU))
    springs = 2 * shear * (1 - NU) / (1 - 2 * NU) / (t * A)
    case = pressed({"rigid": True}, [layer(t * A)], excess * math.pi * springs * A**4 / (4 * RADIUS))
    last = case.run().dataset.isel(step=-1)
    assert float(last["contact_radius_fit"]) == pytest.approx(A, rel=5e-3)
    assert float(last["approach"]) == pytest.approx(A**2 / (2 * RADIUS), rel=0.3 * t)


def fretting(coating: list, steps: int = 4, **tables) -> Case:
    """A sphere that is pressed and sheared in a closed loop."""
    sphere = {"shape": "sphere", "radius": 10e-3}
    path = [{"tangential_load_x": load, "steps": n * steps} for load, n in ((30.0, 1), (-30.0, 2), (30.0, 2))]
    deck = {
        "body": {"1": {**STEEL, "coating": coating}, "2": {**STEEL, "surface": sphere}},
        "friction": {"coefficient": 0.5},
        "grid": {"nodes_in_radius": 12},
        "load": [{"normal_load": 100.0, "steps": 4}, {"path": path}],
    }
    return Case.from_dict(deck | tables)


def test_layer_of_the_same_material_is_none() -> None:
    plain = fretting([]).run().dataset.isel(step=-1)
    same = fretting([layer(100e-6, 210e9)]).run().dataset.isel(step=-1)
    for name in ("pressure", "traction_x", "traction_y"):
        assert np.abs(same[name].values - plain[name].values).max() < 1e-6 * float(plain["max_pressure"])
    for name in ("shift_x", "approach", "dissipated_energy", "elastic_energy"):
        assert float(same[name]) == pytest.approx(float(plain[name]), rel=1e-7)


@pytest.mark.parametrize("young_modulus", [70e9, 420e9])
def test_energy_of_a_fretting_loop(young_modulus: float) -> None:
    """The work of the tangential load over a closed loop is dissipated; a soft layer shears more."""
    case = fretting([layer(50e-6, young_modulus, 0.25)], steps=12)
    data = case.run().dataset
    assert case.coupled
    loop = slice(4 + 12, None)
    load, shift = data["tangential_load_x"].values[loop], data["shift_x"].values[loop]
    work = float(np.sum((load[1:] + load[:-1]) * np.diff(shift)) / 2)
    # the normal load, which does not change, moves down a little as nodes slip
    work += 100.0 * float(np.diff(data["approach"].values[[16, -1]])[0])
    stored = float(np.diff(data["elastic_energy"].values[[16, -1]])[0])
    spent = float(np.diff(data["dissipated_energy"].values[[16, -1]])[0])
    assert work == pytest.approx(spent + stored, rel=0.01)
    plain = fretting([], steps=12).run().dataset
    assert (spent > float(np.diff(plain["dissipated_energy"].values[[16, -1]])[0])) == (young_modulus < 210e9)


def test_a_coating_costs_no_more_iterations() -> None:
    """The counted work is that of uncoated bodies, unlike or alike."""

    def work(case: Case) -> float:
        return float(case.run().dataset["operator_applications"].sum())

    plain, coated = fretting([]), fretting([HARD])
    assert work(coated) < 1.3 * work(plain.changed({"body.1.young_modulus": 420e9}))
    both = coated.changed({"body.2.coating": [HARD]})
    assert not both.coupled
    assert work(both) < 1.3 * work(plain)


def test_both_methods_and_displacements() -> None:
    """Matrices and transforms agree, and the bodies' displacements close the gap."""
    output = {"fields": ["pressure", "gap", "zone", "displacement_1_z", "displacement_2_z"]}
    fft, direct = (
        fretting(
            [HARD],
            solver={"method": method, "tolerance": 1e-10},
            grid={"nodes_in_radius": 6},
            load=[{"normal_load": 100.0}],
            output=output,
        )
        .run()
        .dataset
        for method in ("fft", "direct")
    )
    one, two = fft.isel(step=-1), direct.isel(step=-1)
    assert np.abs(one["pressure"].values - two["pressure"].values).max() < 1e-8 * float(two["max_pressure"])
    moved = one["displacement_1_z"] + one["displacement_2_z"]
    gap = one["initial_gap"] + moved - one["approach"]
    assert np.abs((gap - one["gap"]).values).max() < 1e-9 * float(one["approach"])


def wave(base: dict, thickness: float, **load: float) -> Case:
    """A wave on a layer, on a flat rigid body."""
    length, height = 1e-3, 1e-7
    surface = {"shape": "formula", "expression": f"{height}*(1 - cos(2*pi*x/{length}))"}
    grid = {"extent": [length, length], "nodes_across": 64, "boundary": "periodic"}
    bodies = {"1": {**base, "surface": surface, "coating": [layer(thickness)]}, "2": {"rigid": True}}
    return Case.from_dict({"body": bodies, "grid": grid, "load": [load]})


@pytest.mark.parametrize("ratio", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("thickness", [50e-6, 400e-6])
def test_wave_pressed_flat(ratio: float, thickness: float) -> None:
    """Complete contact has the pressure of the response C_zz, which O'Sullivan and King give for a layer."""
    x, m, shear = 2 * math.pi * thickness / 1e-3, 3 - 4 * NU, E / (2 * (1 + NU))
    lam, kappa = -m, -1 / m
    if ratio:
        lam, kappa = 1 - 4 * (1 - NU) / (1 + ratio * m), (ratio - 1) / (ratio + m)
    theta = math.exp(-2 * x)
    softer = 1 + 4 * kappa * x * theta - lam * kappa * theta**2
    softer /= 1 - (lam + kappa + 4 * kappa * x**2) * theta + lam * kappa * theta**2
    peak = 1e-7 / ((1 - NU) / shear * 1e-3 / (2 * math.pi) * softer)
    base = {"young_modulus": E / ratio, "poisson_ratio": NU} if ratio else {"rigid": True}
    last = wave(base, thickness, mean_pressure=1.5 * peak).run().dataset.isel(step=-1)
    assert float(np.ptp(last["pressure"].values)) / 2 == pytest.approx(peak, rel=1e-3)
    mean = 1e-7
    if not ratio:  # the mean pressure compresses the layer
        mean += 1.5 * peak * thickness * (1 - 2 * NU) / (2 * shear * (1 - NU))
    assert float(last["approach"]) == pytest.approx(mean, rel=1e-9)


def test_sheared_waves() -> None:
    """Friction in a window that repeats, on a rigid body with a coating: its springs carry the shear."""
    case = wave({"rigid": True}, 100e-6, mean_pressure=1e7)
    loads = [{"mean_pressure": 1e7}, {"mean_traction_x": 1e6}]
    last = case.changed({"friction.coefficient": 0.5, "load": loads}).run().dataset.isel(step=-1)
    shear = E / (2 * (1 + NU))
    assert float(last["stick_area"]) == pytest.approx(1e-6)
    assert abs(float(last["shift_x"])) == pytest.approx(1e6 * 100e-6 / shear, rel=1e-9)


def test_result_has_the_coating(tmp_path: Path) -> None:
    """Deck, attributes and comparison; neither moduli of half-spaces nor Hertz stand beside."""
    case = pressed({**STEEL}, [layer(A, 420e9)], 1e4, A / 10)
    case.run(tmp_path / "coated.nc")
    result = open_result(tmp_path / "coated.nc")
    attributes = result.dataset.attrs
    assert attributes["coating"] == "body 1: 10.00 mm, E = 420.0 GPa, nu = 0.3"
    assert attributes["coating_images"] > 20
    assert attributes["coating_fit_error"] < 1e-6
    assert not {"effective_modulus", "dundurs_beta"} & attributes.keys()
    assert Case.from_text(result.deck) == case
    assert "Hertz" not in inside(tmp_path, "info", "coated.nc").stdout
    assert inside(tmp_path, "report", "coated.nc").returncode == 0
    assert "420.0 GPa" in (tmp_path / "coated.html").read_text(encoding="utf-8")
    assert "no closed-form solution is known for bodies with coatings" in str(result.compare())
    peak = float(result.max_pressure[-1])
    below = result.stress(line=[(0, 0, 0), (0, 0, 3 * A)], count=4)
    assert below["stress_zz"].values[0] == pytest.approx(-peak, rel=5e-2)
    with pytest.raises(DeckError, match="body 1 has a coating: moduli and constants of fatigue"):
        result.fatigue("crossland", crossland_slope=0.3, steps=[1])


@pytest.mark.parametrize("ratio", [0.3, 5.0])
def test_stress_on_the_axis(ratio: float) -> None:
    """Hertz's pressure on a layer, beside transforms of Hooke's law and equilibrium."""
    top, base = (ratio, 0.25), (1.0, 0.35)
    depths = [0.2, 0.49999, 0.50001, 1.5]
    found, known = coatings.axis(depths, 0.5, top, base)
    assert found == pytest.approx(known, abs=5e-4)
    # traction is continuous, stress in the plane is not
    assert found[1, 0] == pytest.approx(found[2, 0], abs=1e-4)
    assert abs(found[1, 1] - found[2, 1]) > 0.05


def test_stress_in_layers_of_a_run() -> None:
    """Sums at points are planes; a thin and a thick layer; on a rigid base the layer alone has stress."""
    case = pressed({**STEEL}, [layer(A / 2, 420e9), layer(A / 4, 100e9)], 1e4, A / 10)
    result = case.run()
    plane = result.stress("stress_xx", "displacement_z", depths=[A / 4], source="nodes")
    row, col = plane.sizes["row"] // 2, plane.sizes["col"] // 2
    place = [float(plane["x"][row, col]), float(plane["y"][row, col]), A / 4]
    alone = result.stress("stress_xx", "displacement_z", points=[place], source="nodes")
    for name in alone.data_vars:
        assert float(plane[name][0, row, col]) == pytest.approx(float(alone[name][0]), rel=1e-6)
    plain = pressed({**STEEL}, [], 1e4, A / 10).run()
    deep = [[0.0, 0.0, 0.5 * A]]
    thin, thick = (
        pressed({**STEEL}, [layer(t, e)], 1e4, A / 10).run().stress(points=deep, source="nodes")
        for t, e in ((A / 1000, 420e9), (30 * A, 210e9))
    )
    known = plain.stress(points=deep, source="nodes")
    peak = float(plain.max_pressure[-1])
    for found in (thin, thick):
        assert abs(found["von_mises_stress"] - known["von_mises_stress"]).max() < 5e-3 * peak
    rigid = pressed({"rigid": True}, [layer(A)], 1e4, A / 10).run()
    assert float(rigid.stress(points=[[0, 0, A]])["stress_zz"][0]) < 0.0
    with pytest.raises(DeckError, match="the body below them is rigid and has no stress"):
        rigid.stress(points=[[0, 0, 1.1 * A]])


def test_stress_below_waves_on_a_layer() -> None:
    """The wave of pressure is that of the transforms of Hooke's law and equilibrium."""
    t = 60e-6
    case = wave({"young_modulus": E / 3, "poisson_ratio": 0.2}, t, mean_pressure=2e5)
    result = case.run()
    last = result.dataset.isel(step=-1)
    peak = float(np.ptp(last["pressure"].values)) / 2
    k, (top, base) = 2 * math.pi / 1e-3, ((1.0, NU), (2.6 / 3 / 2.4, 0.2))
    for z in (1e-6, 40e-6, 59.9e-6, 60.1e-6, 200e-6):
        found = result.stress("stress_zz", "stress_xx", "stress_yy", points=[[0, 0, z]])
        vertical, plane = coatings.wave_below(1.0, k * z, k * t, top, base)
        assert float(found["stress_zz"][0]) + 2e5 == pytest.approx(peak * vertical, abs=2e-3 * peak)
        assert float(found["stress_xx"][0] + found["stress_yy"][0]) == pytest.approx(
            peak * plane, abs=4e-3 * peak
        )


def test_stress_in_the_other_body() -> None:
    """A body without a coating has the stress of its half-space."""
    case = fretting([HARD], friction={"coefficient": 0.0}, load=[{"normal_load": 100.0}])
    at_axis = case.run().stress(points=[[0.0, 0.0, 0.05e-3]], body=2)
    assert float(at_axis["stress_zz"].values.ravel()[0]) < 0.0


def test_check_prints_the_coating(tmp_path: Path) -> None:
    deck = tmp_path / "deck.toml"
    deck.write_text(
        '[body.1]\nyoung_modulus = "210 GPa"\npoisson_ratio = 0.3\n\n[[body.1.coating]]\nthickness = "3 um"\n'
        'young_modulus = "400 GPa"\npoisson_ratio = 0.2\n\n[body.2]\nrigid = true\n'
        'surface = { shape = "sphere", radius = "10 mm" }\n\n[grid]\nspacing = "4 um"\n'
        '\n[[load]]\nnormal_load = "20 N"\n'
    )
    printed = inside(tmp_path, "check", "deck.toml")
    assert "coating 3.000 µm, E = 400.0 GPa, nu = 0.2" in printed.stdout
    assert "images, error" in printed.stdout
    assert "the thinnest coating has 0.75 spacings, expected at least 2" in printed.stdout + printed.stderr


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"body.1.coating": [layer(-1e-6)]},
            r"body.1.coating.1.thickness = -1e-06: expected a length above 0",
        ),
        ({"body.1.coating": [{"thickness": 1e-6}]}, r"body.1.coating.1.young_modulus: missing"),
        (
            {"body.1.coating": [layer(1e-6), layer(1e-6, E, 0.5)]},
            r"body.1.coating.2.poisson_ratio: expected a num",
        ),
        ({"body.1.coating": [layer(1e-6, 1e17)]}, r"body.1.coating: .* lie too far apart: .* at most 1E-06"),
        (
            {"wear": {"coefficient_1": "1e-15 m^2/N", "cycle": "c", "cycles": 10}},
            r"wear: expected nothing beside a coat",
        ),
        (
            {"stress": [{"depths": [1e-5]}], "bulk": {"body": 1}},
            r"stress.1.body = 1: body 1 has a coating and a bulk stress",
        ),
        (
            {
                "fatigue": [
                    {"depths": [0.0], "parameters": ["crossland"], "crossland_slope": 0.3, "steps": [1]}
                ]
            },
            r"fatigue.1.body = 1: body 1 has a coating",
        ),
    ],
)
def test_refused_decks(changes: dict, sentence: str) -> None:
    case = pressed({**STEEL}, [layer(A, 420e9)], 1e4, A / 10)
    with pytest.raises(DeckError, match=sentence):
        case.changed(changes)


def test_refused_windows_that_repeat() -> None:
    with pytest.raises(DeckError, match=r"body.1.coating: expected layers of at least 0.1 spacings"):
        wave(STEEL, 1e-9, mean_pressure=1e6)
    with pytest.raises(DeckError, match=r"load.1.mean_gap = .*: expected mean_pressure or approach"):
        wave({"rigid": True}, 1e-4, mean_gap=1e-8)


def test_two_rigid_bodies_need_a_coating() -> None:
    with pytest.raises(DeckError, match="both are rigid, without a coating"):
        pressed({"rigid": True}, [], LOAD)
