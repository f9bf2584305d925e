"""Friction that varies from node to node, and a bound of the shear traction: decks, Python, messages."""

import math
import pickle

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

from hexcontact import Case, DeckError, open_result, resume
from hexcontact.cli.app import app
from hexcontact.core.friction import FrictionLaw
from hexcontact.deck.kinds import Formula
from hexcontact.surfaces import Sphere

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
FORMULA = "0.3 + 0.1*tanh(x/50e-6)"
DECK = """
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm" }
[body.2]
young_modulus = "210 GPa"
poisson_ratio = 0.3
[friction]
FRICTION
[grid]
nodes_in_radius = 6
[[load]]
normal_load = "100 N"
[[load]]
LOAD
"""


def deck(friction, load='tangential_load_x = "15 N"'):
    return DECK.replace("FRICTION", friction).replace("LOAD", load)


def case(coefficient, **keys):
    loads = [{"normal_load": 100.0}, {"shift_x": 1e-5}]
    sphere = {**STEEL, "surface": Sphere(radius=0.01)}
    given = {"loads": loads, "nodes_in_radius": 6, **keys}
    return Case(body_1=sphere, body_2=STEEL, friction_coefficient=coefficient, **given)


def mu_of(x):
    return 0.3 + 0.1 * np.tanh(x / 50e-6)


def fields(result):
    last = result.dataset.isel(step=-1)
    q = np.hypot(last.traction_x.values, last.traction_y.values)
    return last, q, last.pressure.values


def test_formula_over_arrays():
    x = np.linspace(-1.0, 1.0, 5)
    formula = Formula("max(min(x, 0.5), 0) ** 2 - -tanh(x) * pi / exp(abs(x))")
    expected = [formula.value({"x": float(at)}) for at in x]
    np.testing.assert_allclose(formula(x, x), expected, rtol=1e-14)
    np.testing.assert_equal(pickle.loads(pickle.dumps(formula))(x, x), formula(x, x))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1/0 + x", math.inf),
        ("log(100, 10) + 0*x", 2.0),
        ("(0*x - 1)**0.5", math.nan),
        ("2**2**2**2**2", math.inf),
    ],
)
def test_formula_without_a_value_over_arrays(text, expected):
    """What raises for one number is infinite or NaN over arrays, which the law refuses."""
    np.testing.assert_equal(Formula(text)(np.ones(2), np.ones(2)) + 0 * np.ones(2), np.full(2, expected))


def test_full_slip_of_a_formula(tmp_path):
    """With full slip the traction is mu(x) p at each node; the file says the law."""
    (tmp_path / "a.toml").write_text(deck(f'coefficient = "{FORMULA}"', 'shift_x = "10 um"'))
    result = Case.from_toml(tmp_path / "a.toml").run(tmp_path / "a.nc")
    last, q, p = fields(result)
    np.testing.assert_allclose(q, mu_of(last.x.values) * p, atol=1e-6 * p.max())
    assert math.isnan(result.dataset.attrs["friction_coefficient"])
    assert FORMULA in result.dataset.attrs["friction_law"]


def test_ways_agree(tmp_path):
    """A formula, a function, a map and an array are the same law."""
    sides = np.linspace(-1e-3, 1e-3, 401)
    grid = xarray.DataArray(
        mu_of(sides)[:, None] + 0 * sides, coords={"x": sides, "y": sides}, dims=("x", "y"), name="mu"
    )
    grid.to_dataset().to_netcdf(tmp_path / "mu.nc")
    (tmp_path / "a.toml").write_text(deck('coefficient = { map = "mu.nc" }', 'shift_x = "10 um"'))
    formula = case(FORMULA)
    lattice = formula.lattice
    given = {"lattice": lattice, "nodes_in_radius": None}
    others = [
        case(lambda x, y: mu_of(x)),
        case(mu_of(lattice.x), **given),
        case(grid),
        Case.from_toml(tmp_path / "a.toml"),
    ]
    _, expected, p = fields(formula.run())
    for other, near in zip(others, (1e-9, 1e-9, 1e-3, 1e-3), strict=True):
        np.testing.assert_allclose(fields(other.run())[1], expected, atol=near * p.max())


GRID = np.linspace(-1e-3, 1e-3, 41)
MAP = xarray.DataArray(mu_of(GRID)[:, None] + 0 * GRID, coords={"x": GRID, "y": GRID}, dims=("x", "y"))


@pytest.mark.parametrize(
    ("coefficient", "limit"),
    [(FORMULA, None), (lambda x, y: 0.2 + 0.1 * (x > 0), None), (MAP, None), (FORMULA, 2e8), (0.3, 2e8)],
    ids=["formula", "function", "map", "limited_formula", "limited"],
)
def test_a_step_and_its_result_show_the_same_tractions(coefficient, limit, tmp_path):
    """The law is evaluated once, at the nodes; between them run, file and result agree to the bit."""
    file, steps = tmp_path / "sheared.nc", []
    loads = [{"normal_load": 100.0}, {"tangential_load_x": 15.0, "steps": 2}]
    problem = case(coefficient, shear_limit=limit, loads=loads)
    run = problem.run(str(file), on_step=lambda step: steps.append(step))
    x = np.linspace(-3e-4, 3e-4, 101)
    for result in (run, open_result(file)):
        for step in steps:
            assert result.traction_field(step.number).sheared
            for name in ("pressure", "traction_x", "traction_y"):
                assert (step.at(name, x, 0.1 * x) == result.at(name, x, 0.1 * x, step=step.number)).all()
        law = problem.friction_law(result.lattice).coefficient
        assert (result["nodal_friction_coefficient"] == law).all()
        assert result.dataset.attrs.get("shear_limit") == limit


def test_full_slip_between_the_nodes_is_friction_times_pressure():
    result = case(lambda x, y: 0.2 + 0.1 * (x > 0)).run()
    x = np.linspace(2.5, 3.5, 9) * result.lattice.spacing  # where the coefficient is 0.3
    p, q = (result.at(name, x, 0.0) for name in ("pressure", "traction_x"))
    np.testing.assert_allclose(q, 0.3 * p, rtol=1e-12)


def test_shear_limit():
    _, q, p = fields(case(0.3, shear_limit=2e8).run())
    assert (0.3 * p > 2e8).sum() > 20
    np.testing.assert_allclose(q, np.minimum(0.3 * p, 2e8), atol=1e-6 * p.max())
    _, tresca, p = fields(case(math.inf, shear_limit=2e8).run())
    np.testing.assert_allclose(tresca, np.where(p > 0, 2e8, 0.0), atol=1e-6 * p.max())


@pytest.mark.parametrize(("method", "degrees"), [("fft", 20.0), ("fft", 65.0), ("direct", 65.0)])
def test_shear_limit_with_a_direction(method: str, degrees: float):
    """The ellipse stops growing where its longer half-axis is the limit: slip along -n everywhere."""
    law, limit = {"along": 0.4, "across": 0.2, "angle": "20 deg"}, 2e8
    far = 1e-2 * np.exp(1j * math.radians(degrees))
    loads = [{"normal_load": 100.0}, {"shift_x": far.real, "shift_y": far.imag}]
    last = case(law, loads=loads, shear_limit=limit, method=method).run().step(-1)
    p = last.pressure.values
    n = np.exp(1j * math.radians(degrees - 20))
    point = complex(0.4**2 * n.real, 0.2**2 * n.imag) / math.hypot(0.4 * n.real, 0.2 * n.imag)
    expected = np.minimum(p, limit / 0.4) * point * np.exp(1j * math.radians(20))
    q = last.traction_x.values + 1j * last.traction_y.values
    assert (0.4 * p > limit).sum() > 20
    # slip differs from the shift by the displacements, at most 1e-3 of it
    np.testing.assert_allclose(q, expected, atol=1e-3 * p.max())
    assert np.abs(q).max() <= limit * (1 + 1e-9)


def test_far_limit_is_coulomb():
    loads = [{"normal_load": 100.0}, {"tangential_load_x": 15.0}]
    _, q, p = fields(case(0.3, loads=loads).run())
    _, limited, _ = fields(case(0.3, loads=loads, shear_limit=1e15).run())
    np.testing.assert_allclose(limited, q, atol=1e-12 * p.max())


def test_deck_again():
    """The deck of a case says the law; one from Python is refused when read again."""
    again = Case.from_text(case(FORMULA, shear_limit=3e8).deck_text)
    assert again == case(FORMULA, shear_limit=3e8)
    with pytest.raises(DeckError, match="given in Python"):
        Case.from_text(case(lambda x, y: 0.3 + 0 * x).deck_text)


@pytest.mark.parametrize(
    ("friction", "sentence"),
    [
        ("coefficient = -0.1", "at least 0"),
        ("coefficient = nan", "at least 0"),
        ('coefficient = "0.3 + z"', "unknown: z"),
        ('coefficient = "open(x)"', "it is not a formula"),
        ("coefficient = { map = 3 }", "expected"),
        ('coefficient = { map = "a.nc", along = 0.3 }', "expected"),
        ('coefficient = { map = "missing.nc" }', "there is no file"),
        ('coefficient = 0.3\nshear_limit = "-1 MPa"', "a pressure above 0"),
        ('coefficient = 0.3\nshear_limit = "1 mm"', "a pressure above 0"),
    ],
)
def test_bad_decks(friction, sentence):
    with pytest.raises(DeckError, match=sentence) as caught:
        Case.from_text(deck(friction))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("coefficient", "sentence"),
    [
        ("x/1e-3", "expected finite numbers of at least 0; it is -"),
        ("sqrt(x)", "it is NaN"),
        (lambda x, y: [1.0, 2.0], "one number for each node"),
        (lambda x, y: 0.3 if x > 0.0 else 0.2, r"takes numbers only: .*numpy\.vectorize\(coefficient\)"),
        (
            xarray.DataArray(
                np.full((2, 2), 0.3), coords={"x": [-1e-5, 1e-5], "y": [-1e-5, 1e-5]}, dims=("x", "y")
            ),
            "does not cover the window",
        ),
    ],
)
def test_bad_values(coefficient, sentence):
    with pytest.raises(DeckError, match=sentence):
        case(coefficient).run()


def test_array_needs_a_lattice():
    with pytest.raises(DeckError, match="needs lattice"):
        case(np.full((3, 3), 0.3))


def test_share_is_refused():
    with pytest.raises(DeckError, match="friction varies or has a bound"):
        Case.from_text(deck(f'coefficient = "{FORMULA}"', 'tangential_load_x = "0.6 mu P"'))


# --- two coefficients with a direction ----------------------------------------------------------------------

ALUMINIUM = {"young_modulus": 69e9, "poisson_ratio": 0.33}


def sheared(coefficient, loads, body_2=STEEL, **keys):
    sphere = {**STEEL, "surface": Sphere(radius=0.01)}
    given = {"loads": loads, "nodes_in_radius": 6, "tolerance": 1e-10, **keys}
    return Case(body_1=sphere, body_2=body_2, friction_coefficient=coefficient, **given).run()


def ellipse(along, across, angle, n):
    """Point of the ellipse of tractions over p with the outward normal n, (2, nodes)."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    squares = turn @ np.diag([along**2, across**2]) @ turn.T
    return squares @ n / np.sqrt(np.einsum("ik,ij,jk->k", n, squares, n))


def test_full_slip_with_a_direction():
    """The tractions of full slip are where the slip is normal to the ellipse: associated flow."""
    far = 1e-3  # m, a thousand times the elastic displacements
    last, _, p = fields(
        sheared(
            {"along": 0.4, "across": 0.2, "angle": "20 deg"},
            [{"normal_load": 100.0}, {"shift_x": far, "shift_y": far}],
        )
    )
    contact = p > 0
    q = np.stack([last.traction_x.values[contact], last.traction_y.values[contact]])
    slip = np.stack([last.slip_increment_x.values[contact], last.slip_increment_y.values[contact]])
    expected = p[contact] * ellipse(0.4, 0.2, math.radians(20), -slip / np.hypot(*slip))
    np.testing.assert_allclose(q, expected, atol=1e-8 * p.max())
    # of a rigid shift: one direction everywhere
    n = np.full((2, 1), math.sqrt(0.5))
    load = 100.0 * ellipse(0.4, 0.2, math.radians(20), n)[:, 0]
    found = [float(last.tangential_load_x), float(last.tangential_load_y)]
    np.testing.assert_allclose(found, load, rtol=2e-3)  # elastic displacements over the shift
    assert abs(math.degrees(math.atan2(load[1], load[0])) - 45.0) > 10.0  # not against the slip


def test_equal_coefficients_are_one():
    loads = [{"normal_load": 100.0}, {"tangential_load_x": 15.0}]
    one = sheared(0.3, loads)
    same = sheared({"along": 0.3, "across": 0.3, "angle": "10 deg"}, loads)
    near = sheared({"along": 0.3, "across": 0.3 * (1 + 1e-11), "angle": "10 deg"}, loads)
    for name in ("pressure", "traction_x", "traction_y"):
        np.testing.assert_array_equal(same[name], one[name])
        np.testing.assert_allclose(near[name], one[name], atol=1e-8 * float(one["pressure"].max()))


@pytest.mark.parametrize("body_2", [STEEL, ALUMINIUM], ids=["alike", "dissimilar"])
def test_methods_agree_with_a_direction(body_2):
    loads = [{"normal_load": 100.0, "steps": 2}, {"tangential_load_x": 12.0, "tangential_load_y": 8.0}]
    mu = {"along": 0.4, "across": 0.2, "angle": "30 deg"}
    fft, direct = (sheared(mu, loads, body_2, method=method) for method in ("fft", "direct"))
    for name in ("pressure", "traction_x", "traction_y"):
        np.testing.assert_allclose(fft[name], direct[name], atol=1e-7 * float(fft["pressure"].max()))


def test_cost_of_a_direction():
    """With strong coupling 1.49 times the work of one coefficient."""
    loads = [{"normal_load": 1e-3, "steps": 3}, {"tangential_load_x": 1.5e-4, "steps": 4}]
    sphere = {"young_modulus": 1.0, "poisson_ratio": 0.3, "surface": Sphere(radius=1.0)}
    across = 0.3 / math.sqrt(2.0)
    work = [
        Case(body_1=sphere, body_2={"rigid": True}, friction_coefficient=mu, nodes_in_radius=20, loads=loads)
        .run()
        .dataset
        for mu in (0.3, {"along": 2 * across, "across": across, "angle": "20 deg"})
    ]
    one, two = (float(history.operator_applications.sum()) for history in work)
    assert two < 2 * one


def test_direction_turns_with_the_lattice():
    """What is turned by 60 degrees, an angle of the lattice, is the same turned by 60 degrees."""
    results = []
    for turned in (0.0, 60.0):
        angle = math.radians(20 + turned)
        loads = [
            {"normal_load": 100.0},
            {"tangential_load_x": 14 * math.cos(angle), "tangential_load_y": 14 * math.sin(angle)},
        ]
        results.append(sheared({"along": 0.4, "across": 0.2, "angle": f"{50 + turned} deg"}, loads))
    one, two = (result.dataset.isel(step=-1) for result in results)
    shift = complex(one.shift_x, one.shift_y) * np.exp(1j * math.pi / 3)
    assert complex(two.shift_x, two.shift_y) == pytest.approx(shift, rel=1e-7)
    assert float(two.dissipated_energy) == pytest.approx(float(one.dissipated_energy), rel=1e-6)
    assert float(two.stick_area) == pytest.approx(float(one.stick_area), rel=1e-12)
    turned = []
    for last, back in ((one, 1.0), (two, np.exp(-1j * math.pi / 3))):
        place = (last.x.values + 1j * last.y.values) * back
        q = (last.traction_x.values + 1j * last.traction_y.values) * back
        rows = np.array([place.real, place.imag, q.real, q.imag])[:, last.pressure.values > 0]
        spacing = float(np.diff(last.x.values[0])[0])
        turned.append(rows[:, np.lexsort(np.round(rows[:2] / spacing * 4))])
    np.testing.assert_allclose(turned[1][2:], turned[0][2:], atol=1e-7 * float(one.max_pressure))


@pytest.mark.parametrize(
    ("friction", "sentence"),
    [
        ("coefficient = { along = 0.3 }", "expected"),
        ("coefficient = { along = 0.3, across = 0 }", "a number above 0"),
        ("coefficient = { along = 0.3, across = 0.2, angle = 30 }", "an angle with its unit"),
        ("coefficient = { along = 0.3, across = nan }", "a number above 0"),
        ("coefficient = { x = [0, 1], y = [0, 1], values = [0.3, 0.3] }", "an array over y for each x"),
    ],
)
def test_bad_tables(friction, sentence):
    with pytest.raises(DeckError, match=sentence) as caught:
        Case.from_text(deck(friction))
    assert len(str(caught.value).splitlines()) == 1


def test_check_computes_the_friction(tmp_path):
    """A map that ends within the window, and a formula without a value, are found before anything runs."""
    for friction, sentence in (
        (
            "coefficient = { x = [-1e-5, 1e-5], y = [-1e-5, 1e-5], values = [[0.3, 0.3], [0.3, 0.3]] }",
            "cover",
        ),
        ('coefficient = "sqrt(x)"', "it is NaN"),
        ('coefficient = "0.1 - 1e4*x"', "at least 0; it is -"),
    ):
        (tmp_path / "a.toml").write_text(deck(friction))
        done = CliRunner().invoke(app, ["check", str(tmp_path / "a.toml")])
        assert done.exit_code == 2
        assert sentence in done.output + done.stderr


def test_result_holds_the_map(tmp_path):
    """The deck of a result needs no file: it is run again, and resumed, without the map."""
    sides = np.linspace(-1e-3, 1e-3, 9)
    grid = xarray.DataArray(
        0.3 + 100.0 * sides[:, None] + 0 * sides, coords={"x": sides, "y": sides}, dims=("x", "y")
    )
    grid.to_dataset(name="mu").to_netcdf(tmp_path / "mu.nc")
    (tmp_path / "a.toml").write_text(deck('coefficient = { map = "mu.nc" }'))
    whole = Case.from_toml(tmp_path / "a.toml").run()

    def leave(step):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Case.from_toml(tmp_path / "a.toml").run(tmp_path / "part.nc", on_step=leave)
    (tmp_path / "mu.nc").unlink()
    resumed = resume(tmp_path / "part.nc")
    again = Case.from_text(whole.dataset.attrs["deck"]).run()
    for name in ("pressure", "traction_x"):
        np.testing.assert_array_equal(resumed[name], whole[name])
        np.testing.assert_array_equal(again[name], whole[name])
    assert Case.from_text(case(grid).deck_text).run()["traction_x"].equals(case(grid).run()["traction_x"])


def test_equal_coefficients_along_any_direction_are_one() -> None:
    assert FrictionLaw(0.3, shear_limit=1e8, angle=0.5).limits == (0.3, 1e8)
    assert FrictionLaw(0.3, ratio=2.0, angle=0.5).limits is None
