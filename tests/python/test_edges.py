"""Edges between the nodes: of made-up contacts, and of solved ones at random places on the lattice."""

import numpy as np
import pytest
from scipy.special import ellipe

from hexcontact import Case, analytic
from hexcontact.core.contact import ElasticPair, NormalContact, NormalSolution
from hexcontact.core.edges import ContactEdges
from hexcontact.core.friction import ContactState, FrictionalContact
from hexcontact.core.lattice import Lattice
from hexcontact.deck.surfaces import Punch
from hexcontact.pressure_field import PressureField, linear

RIGID_PARTNER = ElasticPair.from_materials(1.0, 0.0, None, None)  # E* = 1
RADIUS = 50.0  # of spheres


def edges_of(lattice: Lattice, solution: NormalSolution | ContactState) -> ContactEdges:
    start = (float(lattice.x[0, 0]), float(lattice.y[0, 0]))
    everywhere = np.ones(lattice.shape, dtype=bool)
    return ContactEdges(solution.pressure, solution.gap, solution.zone > 0, everywhere, lattice.basis, start)


def window(spacing: float, half_x: float, half_y: float, rng: np.random.Generator) -> Lattice:
    """A window about x = y = 0, with nodes anywhere."""
    x, y = rng.uniform(0.0, spacing, 2).tolist()
    return Lattice.covering(spacing, (0.0, 0.0), 2.0 * half_x, 2.0 * half_y, origin=(x, y))


# --- made up --------------------------------------------------------------------------------------


def test_zones_without_an_edge() -> None:
    one = np.ones((5, 6))
    nowhere, everywhere = one < 0.0, one > 0.0
    basis = Lattice(0.5, 0, 0, 5, 6).basis
    cell = 0.25 * np.sqrt(0.75)
    empty = ContactEdges(0.0 * one, one, nowhere, everywhere, basis)
    for edge in (empty.edge(), empty.edge(nowhere, 0.0 * one)):
        assert (edge.area, edge.radius, edge.length, edge.segments.shape) == (0.0, 0.0, 0.0, (0, 2, 2))
    # a contact that ends where nothing can touch has the cells of its nodes
    full = ContactEdges(one, 0.0 * one, everywhere, everywhere, basis)
    assert full.edge().area == pytest.approx(30 * cell)
    assert full.edge().segments.shape == (0, 2, 2)
    assert full.edge(everywhere, one).area == pytest.approx(30 * cell)
    assert full.edge(nowhere, one).area == 0.0
    # so has one whose rim lies within the window
    single = nowhere.copy()
    single[2, 3] = True
    punch = ContactEdges(one * single, one * ~single, single, single, basis)
    assert punch.edge().area == pytest.approx(cell)
    assert punch.edge().segments.shape == (0, 2, 2)
    # a single node has no slopes: its edge is about half way to its neighbors
    edge = ContactEdges(one * single, one * ~single, single, everywhere, basis).edge()
    assert 0.6 * cell < edge.area < cell
    assert edge.segments.shape == (6, 2, 2)
    middle = Lattice(0.5, 0, 0, 5, 6)
    assert edge.segments.mean(axis=(0, 1)) == pytest.approx([middle.x[2, 3], middle.y[2, 3]])


def test_a_ring() -> None:
    """Outer and inner edges, from the exact squares: only the layer of the lattice, 0.04, is in the way."""
    lattice = Lattice(1.0, -40, -60, 81, 121)
    r = np.hypot(lattice.x, lattice.y)
    inside = np.minimum(r - 10.2, 30.7 - r)  # distance from the edge
    p, gap = np.sqrt(np.maximum(inside, 0.0)), 3.0 * np.maximum(-inside, 0.0) ** 1.5
    edges = ContactEdges(p, gap, p > 0.0, p >= 0.0, lattice.basis, (lattice.x[0, 0], lattice.y[0, 0]))
    area = np.pi * ((30.7 + 0.04) ** 2 - (10.2 - 0.04) ** 2)
    assert edges.edge().area == pytest.approx(area, abs=1e-4 * 2.0 * np.pi * 41)
    assert edges.edge().length == pytest.approx(2.0 * np.pi * 40.9, rel=1.3e-4)
    away = np.hypot(*np.moveaxis(edges.edge().segments, 2, 0))
    assert np.minimum(abs(away - 30.7), abs(away - 10.2)).max() < 0.052


# --- contacts without friction --------------------------------------------------------------------


@pytest.mark.parametrize(("nodes", "within"), [((4, 8), 0.045), ((8, 16), 0.03), ((16, 40), 0.025)])
def test_spheres_anywhere_on_the_lattice(nodes: tuple[int, int], within: float) -> None:
    """Radius of Hertz to some hundredths of a spacing; the count of nodes is some times farther off."""
    rng = np.random.default_rng(1)
    hertz = analytic.hertz_sphere(1.0, RADIUS, contact_radius=1.0)
    counted, found = [], []
    for _ in range(12):
        spacing = 1.0 / rng.uniform(*nodes)
        lattice = window(spacing, 1.4, 1.4, rng)
        gap = (lattice.x**2 + lattice.y**2) / (2.0 * RADIUS)
        solution = NormalContact(lattice, RIGID_PARTNER, gap).solve(normal_load=hertz.normal_load)
        edge = edges_of(lattice, solution).edge()
        counted.append((np.sqrt((solution.zone > 0).sum() * lattice.cell_area / np.pi) - 1.0) / spacing)
        found.append((edge.radius - 1.0) / spacing)
        # not only in the mean: each piece of the edge, and their length
        away = np.hypot(*np.moveaxis(edge.segments, 2, 0)) - 1.0
        assert np.abs(away).max() < 0.16 * spacing
        assert edge.length == pytest.approx(2.0 * np.pi, rel=0.06 * spacing)
    assert np.abs(found).max() < within
    assert np.abs(found).mean() < 0.3 * np.abs(counted).mean()


@pytest.mark.parametrize("angle", [0, 30, 71])
@pytest.mark.parametrize("ratio", [3.0, 20.0])
def test_ellipses(ratio: float, angle: int) -> None:
    """Areas of ellipses up to 7:1, also along the lattice: within 0.04 spacings all around."""
    rng = np.random.default_rng(angle)
    turn = np.radians(angle)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    hessian = axes @ np.diag([1.0 / (ratio * RADIUS), 1.0 / RADIUS]) @ axes.T
    hertz = analytic.hertz_ellipse(1.0, hessian, normal_load=0.01)
    a, b = hertz.semi_major, hertz.semi_minor
    around = 4.0 * a * float(ellipe(1.0 - (b / a) ** 2))
    for _ in range(3):
        spacing = b / rng.uniform(6.0, 14.0)
        half = np.hypot(axes[:, 0] * a, axes[:, 1] * b) + 3.0 * spacing
        lattice = window(spacing, *half.tolist(), rng)
        points = np.stack([lattice.x, lattice.y], axis=-1)
        gap = 0.5 * np.einsum("jia,ab,jib->ji", points, hessian, points)
        solution = NormalContact(lattice, RIGID_PARTNER, gap).solve(normal_load=0.01)
        edge = edges_of(lattice, solution).edge()
        assert edge.area == pytest.approx(np.pi * a * b, abs=0.04 * around * spacing)


def test_the_patches_of_a_rough_surface() -> None:
    """Patches of 5 to 20 nodes across: within 1 % of a mesh three times finer, where counting has 2 %."""
    counted, found = [], []
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        k, direction, phase = rng.uniform(2.0, 6.0, 40), *rng.uniform(0.0, 2.0 * np.pi, (2, 40))
        waves = np.stack([k * np.cos(direction), k * np.sin(direction), phase, k**-1.8 * rng.normal(size=40)])
        area = []
        for nodes in (384, 128):
            lattice = window(1.0 / nodes, 0.45, 0.45, rng)
            x, y = lattice.x, lattice.y
            z = 0.2 * (x**2 + y**2)
            for kx, ky, shift, height in waves.T:
                z = z + 0.05 * height * np.cos(2.0 * np.pi * (kx * x + ky * y) + shift)
            gap = z - z[np.hypot(x, y) < 0.4].min()
            can = np.hypot(x, y) < 0.4
            s = NormalContact(lattice, RIGID_PARTNER, np.where(can, gap, 1.0), can).solve(normal_load=0.004)
            edge = ContactEdges(s.pressure, s.gap, s.zone > 0, can, lattice.basis).edge()
            area += [(edge.area, (s.zone > 0).sum() * lattice.cell_area)]
        found.append(area[1][0] / area[0][0] - 1.0)
        counted.append(area[1][1] / area[0][0] - 1.0)
    assert np.abs(found).max() < 0.0063
    assert np.linalg.norm(found) < 0.5 * np.linalg.norm(counted)


def test_a_punch_keeps_the_cells_of_its_nodes() -> None:
    """The pressure does not vanish at the rim of a flat punch, and nothing can touch beyond it."""
    case = Case(
        body_1={"young_modulus": 1e9, "poisson_ratio": 0.3, "surface": Punch(radius=1e-3)},
        body_2={"rigid": True},
        spacing=1e-4,
        normal_load=10.0,
    )
    last = case.run().step(-1)
    assert float(last.contact_area_fit) == pytest.approx(float(last.contact_area), rel=1e-12)


# --- pressure between the nodes -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nodes", "nodal", "between"), [(10, 0.008, 0.013), (20, 0.004, 0.006), (40, 0.002, 0.0025)]
)
def test_pressure_between_the_nodes(nodes: int, nodal: float, between: float) -> None:
    """L2 error against Hertz: at the nodes below half, anywhere below a third of that of the solution."""
    rng = np.random.default_rng(nodes)
    hertz = analytic.hertz_sphere(1.0, RADIUS, contact_radius=1.0)
    x, y = np.meshgrid(*2 * [np.linspace(-1.1, 1.1, 401)])
    for _ in range(3 if nodes < 40 else 1):
        lattice = window(1.0 / nodes, 1.4, 1.4, rng)
        gap = (lattice.x**2 + lattice.y**2) / (2.0 * RADIUS)
        solution = NormalContact(lattice, RIGID_PARTNER, gap).solve(normal_load=hertz.normal_load)
        start = (float(lattice.x[0, 0]), float(lattice.y[0, 0]))
        field = PressureField(solution.pressure, solution.gap, lattice.basis, start)
        joined = linear(lattice, solution.pressure, x, y)

        def error(found: np.ndarray, x: np.ndarray, y: np.ndarray) -> float:
            exact = hertz.pressure(np.hypot(x, y))
            return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))

        at_nodes = error(field(lattice.x, lattice.y), lattice.x, lattice.y)
        assert at_nodes < min(nodal, 0.5 * error(solution.pressure, lattice.x, lattice.y))
        assert error(field(x, y), x, y) < min(between, error(joined, x, y) / 3.0)
        # and where it is in the middle of the contact, it is linear between the nodes
        middle = np.hypot(x, y) < 1.0 - 7.0 / nodes
        assert field(x, y)[middle] == pytest.approx(joined[middle], rel=1e-12)


def test_pressure_field_of_a_result() -> None:
    punch = {"young_modulus": 1e9, "poisson_ratio": 0.3, "surface": Punch(radius=1e-3)}
    case = Case(body_1=punch, body_2={"rigid": True}, spacing=1e-4, loads=[{"normal_load": 10.0, "steps": 2}])
    result = case.run()
    last = result.step(2)
    # where the pressure is singular it stays as it is
    at_nodes = result.pressure_field()(last.x.values, last.y.values)
    assert at_nodes == pytest.approx(last.pressure.values, rel=1e-9)
    assert result.pressure_field(1)(0.0, 0.0) == pytest.approx(0.5 * result.pressure_field(2)(0.0, 0.0))
    assert result.pressure_field()([5e-2], [0.0]) == 0.0  # beyond the window
    with pytest.raises(IndexError, match="there is no step 3"):
        result.pressure_field(3)
    without = type(result)(result.dataset.drop_vars("gap"))
    with pytest.raises(ValueError, match="the gap of step 2 was not kept"):
        without.pressure_field()


# --- stick ----------------------------------------------------------------------------------------


def sheared(
    spacing: float, ratio: float, angle: float, steps: int, rng: np.random.Generator, poisson: float = 0.3
) -> tuple[Lattice, ContactState, float]:
    """A sphere with contact radius 1, pressed and sheared until the radius of the stick area is ``ratio``."""
    mu, pair = 0.3, ElasticPair.from_materials(1.0, poisson, 1.0, poisson)
    hertz = analytic.hertz_sphere(pair.effective_modulus, RADIUS, contact_radius=1.0)
    lattice = window(spacing, 1.2, 1.2, rng)
    gap = (lattice.x**2 + lattice.y**2) / (2.0 * RADIUS)
    contact = FrictionalContact(lattice, pair, gap, friction_coefficient=mu)
    control = ["force", "force", "force", "displacement"]
    state, largest = contact.virgin(), mu * hertz.normal_load * (1.0 - ratio**3)
    for load in largest * np.arange(1, steps + 1) / steps:
        loads = (hertz.normal_load, load * np.cos(angle), load * np.sin(angle), 0.0)
        state = contact.advance(state, control, loads, static=steps == 1)
        assert state.converged
    return lattice, state, mu


@pytest.mark.parametrize("steps", [1, 8])
def test_stick_of_cattaneo_and_mindlin(steps: int) -> None:
    """The stick radius to 0.05 spacings, in one step or in several, whatever the direction of the load."""
    rng = np.random.default_rng(steps)
    found, counted = [], []
    for _ in range(12 if steps == 1 else 4):
        spacing, ratio = 1.0 / rng.uniform(14.0, 36.0), rng.uniform(0.35, 0.9)
        lattice, state, mu = sheared(spacing, ratio, rng.uniform(0.0, np.pi), steps, rng)
        stick = state.zone == 1
        reserve = mu * state.pressure - np.hypot(state.traction_x, state.traction_y)
        edge = edges_of(lattice, state).edge(stick, reserve)
        found.append((edge.radius - ratio) / spacing)
        counted.append((np.sqrt(stick.sum() * lattice.cell_area / np.pi) - ratio) / spacing)
        assert edge.length == pytest.approx(2.0 * np.pi * ratio, abs=0.29 * spacing)
        # the edge of the contact is where it was
        assert edges_of(lattice, state).edge().radius == pytest.approx(1.0, abs=0.011 * spacing)
    assert np.abs(found).max() < 0.05
    assert np.abs(found).mean() < 0.5 * np.abs(counted).mean()


def test_small_stick_areas() -> None:
    """The reserve of a strongly curved edge, c of 3 to 8 spacings: here the pressure of a sphere."""
    rng = np.random.default_rng(3)
    hertz = analytic.hertz_sphere(1.0, RADIUS, contact_radius=1.0)
    for _ in range(12):
        spacing = 1.0 / rng.uniform(3.0, 8.0)
        lattice = window(spacing, 1.4, 1.4, rng)
        gap = (lattice.x**2 + lattice.y**2) / (2.0 * RADIUS)
        solution = NormalContact(lattice, RIGID_PARTNER, gap).solve(normal_load=hertz.normal_load)
        everywhere = np.ones(lattice.shape, dtype=bool)
        edges = ContactEdges(0.0 * gap + 1.0, 0.0 * gap, everywhere, everywhere, lattice.basis)
        edge = edges.edge(solution.zone > 0, solution.pressure)
        assert edge.radius == pytest.approx(1.0, abs=0.027 * spacing)


def test_reserve_with_another_power() -> None:
    """The edge of a growing stick area is smooth: what vanishes as its power 3/2 gives no distance."""
    lattice = Lattice(1.0, -20, -30, 41, 61)
    everywhere = np.ones(lattice.shape, dtype=bool)
    edges = ContactEdges(1.0 * everywhere, 0.0 * everywhere, everywhere, everywhere, lattice.basis)
    for c in (6.3, 9.1, 11.4):
        r = np.hypot(lattice.x, lattice.y)
        stick, reserve = r < c, np.maximum(c - r, 0.0) ** 1.5
        by_nodes = np.sqrt(stick.sum() * lattice.cell_area / np.pi)
        assert edges.edge(stick, reserve).radius == pytest.approx(by_nodes, abs=0.006)


def test_stick_up_to_the_edge_of_the_contact() -> None:
    case = Case(
        body_1={"young_modulus": 1e9, "poisson_ratio": 0.3},
        body_2={"rigid": True},
        gap=lambda x, y: (x**2 + y**2) / 20e-3,
        spacing=5e-5,
        friction_coefficient=np.inf,
        loads=[{"normal_load": 10.0}],
    )
    last = case.run().step(-1)
    assert float(last.stick_area_fit) == pytest.approx(float(last.contact_area_fit), rel=1e-12)
    assert float(last.contact_area_fit) != float(last.contact_area)
