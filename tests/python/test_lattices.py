"""Lattices with square, flat and oblique cells, to the accuracy of the equilateral one."""

import math
from pathlib import Path

import numpy as np
import pytest

from hexcontact import Case, DeckError, analytic, open_result
from hexcontact.analytic.friction import MindlinContact
from hexcontact.core.contact import ElasticPair, FlexibilityOperator
from hexcontact.core.friction import FrictionLaw
from hexcontact.core.lattice import Lattice, crossings
from hexcontact.interior import fields
from hexcontact.interior.stress import Loaded, _edges, nodal_tractions
from hexcontact.problem.preview import case_rows

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
RADIUS = 1e-3
HERTZ = analytic.hertz_sphere(210e9 / (2 * (1 - 0.3**2)), 0.02, contact_radius=RADIUS)
MU = 0.3
CELLS = {"equilateral": (1.0, 60), "square": (1.0, 90), "flat": (0.5, 90), "oblique": (1.0, 50)}


def sphere(cells: str, spacings: float, **arguments) -> Case:
    """Hertz's contact on cells as large as equilateral ones with some spacings in the radius."""
    ratio, angle = CELLS[cells]
    spacing = RADIUS / spacings * math.sqrt(math.sqrt(0.75) / (ratio * math.sin(math.radians(angle))))
    grid = {"spacing": spacing, "cell_ratio": ratio, "cell_angle": f"{angle} deg"}
    body = {**STEEL, "surface": {"shape": "sphere", "radius": 0.02}}
    return Case(body_1=body, body_2=STEEL, **grid, **({"normal_load": HERTZ.normal_load} | arguments))


@pytest.mark.parametrize("cells", CELLS)
def test_hertz_and_cattaneo(cells: str) -> None:
    load = 0.8 * MU * HERTZ.normal_load
    loads = [{"normal_load": HERTZ.normal_load}, {"tangential_load_x": load}]
    case = sphere(cells, 32, friction_coefficient=MU, normal_load=None, loads=loads)
    step = case.run().dataset.isel(step=-1)
    exact = MindlinContact(MU, HERTZ.normal_load, RADIUS, 2 * (2 - 0.3) * 2.6 / 210e9)
    assert float(step["max_pressure"]) == pytest.approx(HERTZ.max_pressure, rel=1e-4)
    assert float(step["approach"]) == pytest.approx(HERTZ.approach, rel=1e-4)
    assert float(step["shift_x"]) == pytest.approx(float(exact.shift(load)), rel=1e-3)
    for name in ("contact_radius_fit", "contact_semi_major", "contact_semi_minor"):
        assert float(step[name]) == pytest.approx(RADIUS, rel=1e-3)
    assert float(step["stick_radius_fit"]) == pytest.approx(float(exact.stick_radius(load)), rel=2e-3)
    assert float(step["contact_area"]) == pytest.approx((step["zone"] > 0).sum() * case.lattice.cell_area)
    assert float(step["operator_applications"]) < 30


@pytest.mark.parametrize("cells", CELLS)
def test_compliant_interface(cells: str) -> None:
    """The contact of c = 10, m = 2 in E* = R = a = 1 has the approach 1.16139 and the pressure 0.87771 p0."""
    stiffness = 10.0 * HERTZ.effective_modulus * (RADIUS / 0.02) / (RADIUS**2 / 0.02) ** 2
    step = sphere(cells, 40, interface={"coefficient": stiffness, "exponent": 2}).run().dataset.isel(step=-1)
    assert float(step["approach"]) == pytest.approx(1.16139 * HERTZ.approach, rel=5e-4)
    assert float(step["max_pressure"]) == pytest.approx(0.87771 * HERTZ.max_pressure, rel=5e-4)


@pytest.mark.parametrize("cells", CELLS)
def test_stress_beside_the_edge(cells: str) -> None:
    """Against the pressure of Hertz and full sliding on a lattice eight times as fine."""
    steps: list = []
    sphere(cells, 20, tolerance=1e-11).run(on_step=steps.append)
    step, p0, h = steps[-1], HERTZ.max_pressure, RADIUS / 20
    fine = Lattice.covering(h / 8, (0.0, 0.0), 2.1 * RADIUS, 2.1 * RADIUS)
    hertzian = p0 * np.sqrt(np.maximum(1.0 - (fine.x**2 + fine.y**2) / RADIUS**2, 0.0))
    hats = Loaded(step.lattice, [step.fields], step.bodies, 1).tractions("edges")[0][0, 0]
    [nodal] = nodal_tractions([step.fields])
    edges = _edges(step.lattice, nodal, step.fields)
    none, law = np.zeros(hats.shape, dtype=bool), FrictionLaw(MU)
    for away, depth in ((-1.0, 0.0), (-0.3, 0.0), (0.3, 0.0), (1.0, 0.0), (0.0, 0.3), (0.2, 0.7)):
        r = RADIUS - away * h
        points = np.array([(r * np.cos(t), r * np.sin(t), depth * h) for t in np.linspace(0.0, np.pi, 7)])
        loads = np.array([[hertzian, MU * hertzian, 0 * hertzian]])
        _, [known] = fields.at_points(fine, loads, 1, 0.3, points)
        loads = np.array([[hats, MU * hats, 0 * hats]])
        _, [found] = fields.at_points(step.lattice, loads, 1, 0.3, points)
        shear = np.array([MU * nodal[0], 0 * nodal[0]])
        more, refused = edges.stress(shear, none, law, loads[0], 1, 0.3, points)
        plane = [0, 1, 3] if depth == 0.0 else slice(None)
        assert refused == 0.0
        assert abs(found + more - known)[:, plane].max() < 6e-3 * p0


def test_planes_below_are_sums_at_their_nodes() -> None:
    result = sphere("flat", 8).run()
    box = [[-3e-4, 3e-4], [-2e-4, 2e-4]]
    plane = result.stress("von_mises_stress", depths=[2e-4], box=box)["von_mises_stress"]
    points = np.stack([plane["x"].values, plane["y"].values, 2e-4 + 0 * plane["x"].values], axis=-1)
    values = result.stress("von_mises_stress", points=points.reshape(-1, 3))["von_mises_stress"]
    assert plane.values.ravel() == pytest.approx(values.values.ravel(), rel=1e-9)


def test_the_file_and_the_deck_in_it_have_the_lattice(tmp_path: Path) -> None:
    case = sphere("oblique", 6)
    case.run(tmp_path / "oblique.nc")
    result = open_result(tmp_path / "oblique.nc")
    assert result.lattice == case.lattice
    assert Case.from_text(result.dataset.attrs["deck"]).lattice == case.lattice
    assert ", at 50 deg" in dict(case_rows(case))["spacing"]
    turned = case.changed(cell_angle="90 deg", direction="0.1 rad")
    assert case.changed(cell_angle=math.pi / 2, direction=0.1).lattice == turned.lattice
    usual = case.changed(cell_angle="60 deg", cell_ratio=1.0)
    assert "cells" not in dict(case_rows(usual))["spacing"]
    assert usual.lattice.pattern == Lattice(1.0, 0, 0, 1, 1).pattern
    lattice = Lattice(1e-4, -9, -9, 19, 19, (1e-5, 0.0), 0.7, 1.3)
    given = Case(
        body_1=STEEL, body_2=STEEL, gap=lambda x, y: 25 * (x**2 + y**2), lattice=lattice, approach=5e-6
    )
    assert given.lattice == lattice
    assert given.deck.grid.cell_angle == 1.3


def test_the_basis_is_that_of_the_equilateral_lattice_to_the_bit() -> None:
    lattice = Lattice(3e-5, 0, 0, 1, 1, cell_angle=math.radians(60.0) * (1 + 1e-16))
    assert (lattice.basis == 3e-5 * np.array([[1.0, 0.0], [0.5, 0.5 * math.sqrt(3.0)]])).all()
    square = Lattice(3e-5, 0, 0, 1, 1, cell_ratio=0.5, cell_angle=math.pi / 2)
    assert square.basis == pytest.approx(3e-5 * np.array([[1.0, 0.0], [0.0, 0.5]]), abs=1e-20)


def test_the_operator_is_that_of_turned_cells() -> None:
    """On a square lattice the response along y to a load along y is that along x to one along x."""
    lattice = Lattice(1.0, -4, -4, 9, 9, cell_angle=math.pi / 2)
    operator = FlexibilityOperator(lattice, ElasticPair(1.0, 0.3, 0.5))
    load, none = np.zeros((9, 9)), np.zeros((9, 9))
    load[4, 4] = 1.0
    along_x = operator.apply(none, load, none)[1]
    along_y = operator.apply(none, none, load)[2]
    # the diagonals of the triangles run one way only, so that the turned cells are their mirror images
    assert along_y == pytest.approx(along_x.T, rel=1e-12)


def test_a_line_over_flat_cells_crosses_all_edges() -> None:
    lattice = Lattice(1.0, -40, -10, 81, 21, cell_ratio=0.25, cell_angle=math.pi / 2)
    at = crossings(lattice, (0.1, -9.0), (0.1, 9.0))
    assert len(at) == 2 * 72 + 1
    assert (np.diff(at) > 0).all()


def test_cells_that_are_too_flat_are_one_sentence() -> None:
    for key, value in (("cell_ratio", 900), ("cell_angle", "170 deg"), ("cell_angle", 1.2)):
        with pytest.raises(DeckError, match=rf"grid\.{key} = .*: expected an? .* at least 0\.\S* .*at most"):
            sphere("square", 6).changed({f"grid.{key}": value})
    with pytest.raises(DeckError, match="cell_angle = 4: expected an angle in radians between 0 and pi"):
        Lattice(1.0, 0, 0, 1, 1, cell_angle=4)


# --- cells that follow the contact --------------------------------------------------------------------------


def slender(radius: float, angle: str, **arguments) -> tuple[Case, analytic.EllipticContact]:
    """A contact of two principal radii, 10 mm and another one, and the solution of Hertz."""
    load = 50.0
    exact = analytic.hertz_ellipse(210e9 / (2 * 0.91), [[100.0, 0.0], [0.0, 1.0 / radius]], normal_load=load)
    shape = {"shape": "paraboloid", "radius_x": 0.01, "radius_y": radius, "angle": angle}
    load_of = {} if "loads" in arguments else {"normal_load": load}
    return Case(body_1={**STEEL, "surface": shape}, body_2=STEEL, **load_of, **arguments), exact


@pytest.mark.parametrize(
    ("radius", "angle", "direction"),
    [
        (0.01, "0 deg", 0.0),
        (0.1, "0 deg", 0.0),
        (0.1, "90 deg", 0.0),
        (0.1, "-60 deg", 30.0),
        (5.0, "20 deg", 20.0),
    ],
)
def test_cells_are_as_slender_as_the_contact(radius: float, angle: str, direction: float) -> None:
    """Up to 46:1 with some 110 x 110 nodes: as many spacings in both half-axes."""
    case, exact = slender(radius, angle, lattice="rectangular", nodes_in_radius=50)
    assert math.degrees(case.lattice.direction) == pytest.approx(direction, abs=1e-9)
    assert max(case.lattice.shape) <= 113
    last = case.run().dataset.isel(step=-1)
    assert float(last["max_pressure"]) == pytest.approx(exact.max_pressure, rel=1e-4)
    assert float(last["approach"]) == pytest.approx(exact.approach, rel=1e-4)
    assert float(last["contact_semi_major"]) == pytest.approx(exact.semi_major, rel=2e-3)
    assert float(last["contact_semi_minor"]) == pytest.approx(exact.semi_minor, rel=2e-3)
    assert float(last["operator_applications"]) < 7


def test_crossed_cylinders_at_five_degrees() -> None:
    bodies = ({"shape": "cylinder", "radius": 0.01, "angle": angle} for angle in ("0 deg", "5 deg"))
    one, two = ({**STEEL, "surface": surface} for surface in bodies)
    case = Case(body_1=one, body_2=two, lattice="rectangular", nodes_in_radius=40, normal_load=20.0)
    compared = {entry.quantity: entry.error for entry in case.run().compare()}
    assert abs(compared["max_pressure"]) < 2e-4
    assert abs(compared["approach"]) < 2e-4


def test_a_turned_lattice_is_read_again_and_solves_friction(tmp_path: Path) -> None:
    """The tractions of Cattaneo and Mindlin along the long axis, wherever the lattice lies."""
    loads = [{"normal_load": 50.0}, {"tangential_load_x": 9.0}]
    given = {"friction_coefficient": 0.3, "nodes_in_radius": 16, "loads": loads}
    along, _ = slender(0.1, "0 deg", **given, lattice="rectangular")
    case, _ = slender(0.1, "0 deg", **given, lattice="rectangular", direction="15 deg")
    result = case.run(tmp_path / "turned.nc")
    read = open_result(tmp_path / "turned.nc")
    assert read.lattice == case.lattice
    assert math.degrees(read.lattice.direction) == pytest.approx(15.0)
    last, other = result.dataset.isel(step=-1), along.run().dataset.isel(step=-1)
    for name, error in (
        ("shift_x", 1e-3),
        ("stick_area_fit", 1e-2),
        ("max_pressure", 3e-3),
        ("approach", 1e-3),
    ):
        assert float(last[name]) == pytest.approx(float(other[name]), rel=error)
    depth = 1e-4
    stress = result.stress(points=[(0.0, 0.0, depth)])["von_mises_stress"]
    expected = along.run().stress(points=[(0.0, 0.0, depth)])["von_mises_stress"]
    assert float(stress.values.ravel()[-1]) == pytest.approx(float(expected.values.ravel()[-1]), rel=2e-3)
    assert Case.from_text(read.deck) == case


@pytest.mark.parametrize("spacings", [("20 um", "5 um"), ("5 um", "20 um")])
def test_slopes_are_those_along_both_sides_of_a_cell(spacings: tuple[str, str]) -> None:
    """The gap of a paraboloid rises by b/R at the end of the minor semi-axis b, whichever way that lies."""
    angle = "0 deg" if spacings[0] == "5 um" else "90 deg"
    case, exact = slender(0.1, angle, lattice="rectangular", spacing=spacings)
    assert case.estimate.slope == pytest.approx(exact.semi_minor / 0.01, rel=0.2)


def test_the_most_slender_cells() -> None:
    """A contact of 240:1 on cells of 100:1, with the spacings asked for in the shorter semi-axis at least."""
    case, exact = slender(100.0, "0 deg", lattice="rectangular", nodes_in_radius=12)
    assert case.lattice.cell_ratio == pytest.approx(100.0)
    assert exact.semi_minor / case.lattice.spacing > 11
    assert exact.semi_major / (case.lattice.spacing * case.lattice.cell_ratio) > 11
    assert float(case.run().dataset["max_pressure"][-1]) == pytest.approx(exact.max_pressure, rel=1e-3)
    with case.start() as session:
        session.advance(normal_load=10.0)
        assert Case.from_text(session.result().deck).lattice.basis == pytest.approx(case.lattice.basis)


# K1, Kxx, Kxy, Kx, Ky of the hat over cells of 1 by 1/ratio at a node: line integrals in 40 digits.
FLAT_KERNELS = {
    (10, 0, 0): (0.70792457007327, 0.51592941992511, -0.01662315037744, 0.0, 0.0),
    (10, 1, 1): (0.12577645261123, 0.11439512067869, 0.02376524732184, 0.11909877060070, 0.02786531948773),
    (10, 2, 3): (0.05151891664788, 0.04995919294167, 0.00840904863513, 0.05073054243176, 0.00856563741992),
    (10, 12, 5): (0.00833562165530, 0.00832087480952, 0.00034845709386, 0.00832824483165, 0.00034877221935),
    (50, 0, 0): (0.20459095155752, 0.16496314155566, -0.00125717475872, 0.0, 0.0),
    (50, 0, 1): (0.14954061639339, 0.11031557985867, -0.00071862132918, 0.00056058855022, 0.05904543400834),
    (50, 2, 3): (0.01045830623617, 0.01044501125312, 0.00035482161097, 0.01045165569793, 0.00035509467721),
    (50, 12, 5): (0.00166854190982, 0.00166842362122, 0.00001397461697, 0.00166848276443, 0.00001397512277),
}


@pytest.mark.parametrize(("ratio", "col", "row"), FLAT_KERNELS)
def test_influence_of_flat_cells(ratio: int, col: int, row: int) -> None:
    """Near and far: digits are lost like the square of the ratio, 1e-11 of K1 at most."""
    beta, gamma = 0.3, 0.5
    k_1, k_xx, k_xy, k_x, k_y = FLAT_KERNELS[ratio, col, row]
    lattice = Lattice(1.0, 0, 0, row + 2, col + 2, cell_ratio=1 / ratio, cell_angle=math.pi / 2)
    operator = FlexibilityOperator(lattice, ElasticPair(1.0, beta, gamma))
    load, none = np.zeros(lattice.shape), np.zeros(lattice.shape)
    load[0, 0] = 1.0
    loads = ((load, none, none), (none, load, none), (none, none, load))
    moved = [[part[row, col] for part in operator.apply(*each)] for each in loads]
    pressure, along_x, along_y = np.array(moved)
    error = 1e-11 * k_1
    assert pressure == pytest.approx([k_1, -beta * k_x, -beta * k_y], abs=error)
    assert along_x[1:] == pytest.approx([k_1 + gamma * k_xx, gamma * k_xy], abs=error)
    assert along_y[1:] == pytest.approx([gamma * k_xy, k_1 + gamma * (k_1 - k_xx)], abs=error)


def test_counted_work_of_slender_contacts() -> None:
    """Beside a round contact of as many nodes: a tenth more up to 4.4:1, 1.3 times up to 45:1."""
    cases = [
        slender(radius, "0 deg", lattice="rectangular", nodes_in_radius=47)[0]
        for radius in (0.01, 0.042, 0.05, 0.1, 0.5, 5.0)
    ]
    work = [float(case.run().dataset["operator_applications"][-1]) for case in cases]
    assert work[1] < 1.2 * work[0]
    assert work[2] < 1.2 * work[0]
    assert work[3] < 1.2 * work[0]
    assert work[4] < 1.35 * work[0]
    assert work[5] < 1.4 * work[0]


def test_counted_work_of_slender_contacts_with_friction() -> None:
    """Beside a round contact of as many nodes: 1.3 times at 12:1, 1.7 times at 45:1."""
    load, mu = 50.0, 0.3
    loads = [{"normal_load": load}, {"tangential_load_y": 0.8 * mu * load, "steps": 4}]
    given = {"lattice": "rectangular", "nodes_in_radius": 30, "friction_coefficient": mu, "loads": loads}
    work = [
        float(slender(radius, "0 deg", **given)[0].run().dataset["operator_applications"].sum())
        for radius in (0.01, 0.5, 5.0)
    ]
    assert work[1] < 1.4 * work[0]
    assert work[2] < 1.8 * work[0]


BAD_GRIDS = {
    "three": (
        {"spacing": ["1 um", "2 um", "3 um"]},
        r'\Agrid.spacing = .*: expected a length above 0, two of them such as .*, or "auto"\Z',
    ),
    "two": ({"spacing": [1e-5, 2e-5]}, "spacing = .*expected one length on an equilateral lattice"),
    "angle": (
        {"lattice": "rectangular", "spacing": 1e-5, "cell_angle": "80 deg"},
        "lattice or cells, not both",
    ),
    "ratio": (
        {"cell_angle": "90 deg", "spacing": [1e-5, 2e-5], "cell_ratio": 2.0},
        "two spacings or cell_ratio",
    ),
    "flat": (
        {"lattice": "rectangular", "spacing": [1e-5, 1e-8]},
        r"grid\.spacing = .*: expected lengths of a ratio of at most 100",
    ),
    "word": ({"spacing": "fine"}, 'spacing = "fine": expected a length above 0'),
    "periodic": (
        {"spacing": "auto", "boundary": "periodic", "extent": [1e-3, 1e-3]},
        "since the window repeats",
    ),
    "lattice": ({"lattice": "square", "spacing": 1e-5}, 'expected "equilateral" or "rectangular"'),
}


@pytest.mark.parametrize("name", BAD_GRIDS)
def test_wrong_grids_are_told(name: str) -> None:
    grid, sentence = BAD_GRIDS[name]
    with pytest.raises(DeckError, match=sentence):
        slender(0.1, "0 deg", **grid)


def test_spacings_of_both_directions() -> None:
    case, _ = slender(0.1, "0 deg", lattice="rectangular", spacing=["4 um", "16 um"])
    assert case.lattice.basis.tolist() == [
        [pytest.approx(4e-6), 0.0],
        [pytest.approx(0.0), pytest.approx(16e-6)],
    ]
    auto, _ = slender(0.1, "0 deg", spacing="auto")
    radius = auto.estimate.radius
    assert auto.lattice.spacing == pytest.approx(radius / 20)
