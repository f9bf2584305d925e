"""The solver against Hertz and other closed solutions, on problems that are in no table."""

import numpy as np
import pytest

from hexcontact import Case, analytic
from hexcontact.core import flat
from hexcontact.deck.surfaces import Cone, Cylinder, Paraboloid, Power, Punch, Sphere

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
RUBBER = {"young_modulus": 10e6, "poisson_ratio": 0.5}
CORK = {"young_modulus": 30e6, "poisson_ratio": 0.0}
AUXETIC = {"young_modulus": 1e9, "poisson_ratio": -0.4}
RIGID = {"rigid": True}


def modulus(*bodies: dict) -> float:
    return 1.0 / sum((1 - b["poisson_ratio"] ** 2) / b["young_modulus"] for b in bodies if "rigid" not in b)


def last(case: Case):
    """Coordinates, pressure and history of the last step."""
    step = case.run().dataset.isel(step=-1)
    return step["x"].values, step["y"].values, step["pressure"].values, step


@pytest.mark.parametrize("method", ["direct", "fft"])
@pytest.mark.parametrize(
    ("first", "second"),
    [(STEEL, STEEL), (STEEL, RUBBER), (RIGID, CORK), (AUXETIC, RIGID), (RUBBER, CORK)],
)
def test_sphere_of_any_materials(first: dict, second: dict, method: str) -> None:
    e_star = modulus(first, second)
    hertz = analytic.hertz_sphere(e_star, 0.02, contact_radius=1e-3)
    case = Case(
        body_1={**first, "surface": Sphere(radius=0.02)},
        body_2=second,
        spacing=1e-3 / 14,
        normal_load=hertz.normal_load,
        method=method,
    )
    x, y, p, step = last(case)
    # the errors of the discrete problem at a/l_e = 14 (reference table): 3.9e-4, -2.6e-4, 0.0137, 0.0037
    assert p.max() / hertz.max_pressure - 1 == pytest.approx(3.916e-4, abs=1e-6)
    assert float(step["approach"]) / hertz.approach - 1 == pytest.approx(-2.557e-4, abs=6e-8)
    exact = hertz.pressure(np.hypot(x, y))
    assert np.linalg.norm(p - exact) / np.linalg.norm(exact) == pytest.approx(0.01373, abs=1e-6)
    edge = flat.edge_radius(x, y, p, 1e-3 / 14, case.lattice.cell_area)
    assert edge == pytest.approx(1.0037e-3, rel=1.4e-6)
    # the load is the sum of the nodal pressures over their cells
    assert p.sum() * np.sqrt(0.75) * (1e-3 / 14) ** 2 == pytest.approx(hertz.normal_load, rel=1e-8)


@pytest.mark.parametrize("loads", [0.01, 1.0, 1e4])
def test_load_scales_as_the_power_two_thirds(loads: float) -> None:
    e_star = modulus(STEEL, STEEL)
    hertz = analytic.hertz_sphere(e_star, 0.02, normal_load=loads)
    case = Case(
        body_1=STEEL,
        body_2={**STEEL, "surface": Sphere(radius=0.02)},
        nodes_in_radius=14,
        normal_load=loads,
    )
    _, _, p, step = last(case)
    assert p.max() == pytest.approx(hertz.max_pressure, rel=4.1e-4)
    assert float(step["approach"]) == pytest.approx(hertz.approach, rel=3.4e-4)


def test_sphere_anywhere_on_the_lattice() -> None:
    """A center between the nodes changes the discrete solution, but only by the size of its error."""
    hertz = analytic.hertz_sphere(modulus(STEEL, STEEL), 0.02, contact_radius=1e-3)
    rng = np.random.default_rng(11)
    for _ in range(6):
        center = tuple(rng.uniform(-5e-3, 5e-3, 2))
        case = Case(
            body_1={**STEEL, "surface": Sphere(radius=0.02, offset=center)},
            body_2=STEEL,
            spacing=1e-3 / 20,
            normal_load=hertz.normal_load,
        )
        x, y, p, step = last(case)
        exact = hertz.pressure(np.hypot(x - center[0], y - center[1]))
        assert np.linalg.norm(p - exact) / np.linalg.norm(exact) < 0.0105
        assert float(step["approach"]) == pytest.approx(hertz.approach, rel=1.8e-4)
        edge = flat.edge_radius(x, y, p, 1e-3 / 20, case.lattice.cell_area, center)
        assert edge == pytest.approx(1e-3, rel=2.1e-3)
        # the pressure is centered where the sphere is
        assert (p * x).sum() / p.sum() == pytest.approx(center[0], abs=3.5e-8)
        assert (p * y).sum() / p.sum() == pytest.approx(center[1], abs=3.5e-8)


@pytest.mark.parametrize("angle", [0, 17, 45, 90, 120])
@pytest.mark.parametrize("radii", [(0.02, 0.02), (0.02, 0.05), (0.1, 0.01)])
def test_paraboloid_at_any_angle(radii: tuple[float, float], angle: int) -> None:
    e_star = modulus(STEEL, AUXETIC)
    turn = np.radians(angle)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    ellipse = analytic.hertz_ellipse(
        e_star, axes @ np.diag([1 / radii[0], 1 / radii[1]]) @ axes.T, normal_load=50.0
    )
    case = Case(
        body_1=STEEL,
        body_2={**AUXETIC, "surface": Paraboloid(radius_x=radii[0], radius_y=radii[1], angle=f"{angle} deg")},
        spacing=ellipse.semi_minor / 16,
        normal_load=50.0,
    )
    x, y, p, step = last(case)
    exact = ellipse.pressure(x, y)
    assert p.max() == pytest.approx(ellipse.max_pressure, rel=2.5e-4)
    assert float(step["approach"]) == pytest.approx(ellipse.approach, rel=3e-4)
    assert np.linalg.norm(p - exact) / np.linalg.norm(exact) < 0.0131
    fit = flat.edge_ellipse(x, y, p, ellipse.semi_minor / 16)
    assert fit.semi_major == pytest.approx(ellipse.semi_major, rel=2.6e-3)
    assert fit.semi_minor == pytest.approx(ellipse.semi_minor, rel=2.6e-3)
    if radii[0] != radii[1]:
        apart = (fit.angle - ellipse.angle + np.pi / 2) % np.pi - np.pi / 2
        assert np.degrees(apart) == pytest.approx(0.0, abs=0.0037)


def test_two_cylinders_are_one_paraboloid() -> None:
    """Crossed cylinders, one on each body, and the paraboloid with the same gap: the same solution."""
    first = Case(
        body_1={**STEEL, "surface": Cylinder(radius=0.02, angle="0 deg")},
        body_2={**RUBBER, "surface": Cylinder(radius=0.05, angle="90 deg")},
        spacing=1e-4,
        extent=(8e-3, 8e-3),
        normal_load=0.5,
    )
    second = Case(
        body_1={**STEEL, "surface": Paraboloid(radius_x=0.05, radius_y=0.02)},
        body_2=RUBBER,
        spacing=1e-4,
        extent=(8e-3, 8e-3),
        normal_load=0.5,
    )
    _, _, p, step = last(first)
    _, _, q, other = last(second)
    np.testing.assert_allclose(p, q, atol=1e-7 * q.max())
    assert float(step["approach"]) == pytest.approx(float(other["approach"]), rel=1e-8)


def test_prescribed_approach() -> None:
    hertz = analytic.hertz_sphere(modulus(STEEL, STEEL), 0.02, approach=3e-5)
    case = Case(
        body_1={**STEEL, "surface": Sphere(radius=0.02)},
        body_2=STEEL,
        spacing=hertz.contact_radius / 20,
        approach=3e-5,
        steps=3,
    )
    dataset = case.run().dataset
    fractions = np.array([1, 2, 3]) / 3
    np.testing.assert_allclose(dataset["approach"], 3e-5 * fractions, rtol=1e-12)
    np.testing.assert_allclose(dataset["normal_load"], hertz.normal_load * fractions**1.5, rtol=8.1e-4)


@pytest.mark.parametrize(
    ("surface", "exact"),
    [
        (Cone(slope=0.02), lambda e: analytic.cone(e, 0.02, normal_load=20.0)),
        (Power(coefficient=5e3, exponent=3.0), lambda e: analytic.power_law(e, 5e3, 3.0, normal_load=20.0)),
        (Power(coefficient=3e7, exponent=4.0), lambda e: analytic.power_law(e, 3e7, 4.0, normal_load=20.0)),
    ],
)
def test_other_profiles(surface, exact) -> None:
    solution = exact(modulus(RUBBER, STEEL))
    case = Case(
        body_1={**STEEL, "surface": surface},
        body_2=RUBBER,
        spacing=solution.contact_radius / 25,
        normal_load=20.0,
    )
    x, y, p, step = last(case)
    assert float(step["approach"]) == pytest.approx(solution.approach, rel=1.7e-4)
    r = np.hypot(x, y)
    part = (r > 0.2 * solution.contact_radius) & (r < 0.8 * solution.contact_radius)
    np.testing.assert_allclose(p[part], solution.pressure(r[part]), rtol=1e-3)
    assert (p[r > 1.1 * solution.contact_radius] == 0).all()


def test_flat_punch() -> None:
    case = Case(
        body_1={**RIGID, "surface": Punch(radius=1e-3)}, body_2=CORK, spacing=1e-3 / 30.25, normal_load=5.0
    )
    x, y, p, step = last(case)
    radius = flat.area_radius(p > 0, np.sqrt(0.75) * (1e-3 / 30.25) ** 2)
    punch = analytic.flat_punch(modulus(CORK), radius, normal_load=5.0)
    assert float(step["approach"]) == pytest.approx(punch.approach, rel=2.1e-3)
    r = np.hypot(x, y)
    part = r < 0.8 * radius
    np.testing.assert_allclose(p[part], punch.pressure(r[part]), rtol=0.01)
    assert ((p > 0) == (r <= 1e-3 * (1 + 1e-12))).all()


@pytest.mark.parametrize("ratio", [1.0, 4.0])
def test_the_error_of_the_approach_is_known(ratio: float) -> None:
    """It is -l_e^2 (1/R_x + 1/R_y)/32 in the mean over places on the lattice (docs/theory/edges.md, (B8))."""
    e_star = modulus(STEEL, RIGID)
    hertz = analytic.hertz_ellipse(e_star, np.diag([1 / (0.02 * ratio), 1 / 0.02]), normal_load=50.0)
    rng = np.random.default_rng(5)
    found = []
    for _ in range(10):
        spacing = hertz.semi_minor / rng.uniform(10, 20)
        surface = Paraboloid(radius_x=0.02 * ratio, radius_y=0.02, offset=tuple(rng.uniform(0, spacing, 2)))
        case = Case(body_1={**STEEL, "surface": surface}, body_2=RIGID, spacing=spacing, normal_load=50.0)
        error = float(case.run().step(-1).approach) - hertz.approach
        found.append(32 * error / (spacing**2 * (1 / ratio + 1) / 0.02))
    assert np.mean(found) == pytest.approx(-0.96, abs=0.046)
    assert np.std(found) < 0.087
