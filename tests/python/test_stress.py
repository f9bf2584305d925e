"""Stress and displacement below the surface: influence functions, closed solutions of Hertz, decks, files."""

import base64
import csv
import os
import subprocess
import zlib
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import commands
import drawn
import numpy as np
import pytest
import xarray

from hexcontact import (
    Case,
    DeckError,
    ResourceError,
    analytic,
    influence,
    kernel_cache,
    open_result,
    plotting,
    resume,
)
from hexcontact.core.friction import FrictionLaw
from hexcontact.core.lattice import Lattice
from hexcontact.interior import fields
from hexcontact.interior.stress import Loaded, _edges, nodal_tractions
from hexcontact.surfaces import Sphere

REFERENCE = Path(__file__).parents[1] / "reference"
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
RADIUS = 1e-3


def table(name: str) -> list[list[str]]:
    lines = (REFERENCE / name).read_text().splitlines()
    return list(csv.reader(line for line in lines if not line.startswith("#")))[1:]


def hertz(nodes: int) -> tuple[analytic.EllipticContact, Case]:
    exact = analytic.hertz_sphere(210e9 / (2 * (1 - 0.3**2)), 0.02, contact_radius=RADIUS)
    body = {**STEEL, "surface": Sphere(radius=0.02)}
    case = Case(
        body_1=body, body_2=STEEL, spacing=RADIUS / nodes, normal_load=exact.normal_load, tolerance=1e-11
    )
    return exact, case


@pytest.fixture(scope="module")
def pressed():
    """Hertz contact with 40 spacings in the radius."""
    exact, case = hertz(40)
    steps = []
    result = case.run(on_step=steps.append)
    return exact, result, steps


# --- influence functions ------------------------------------------------------------------------------------


def test_example_of_the_theory() -> None:
    stress = influence.pyramid_stress(0.3, 0.2, 0.5, 0.3)
    moved = influence.pyramid_displacement(0.3, 0.2, 0.5, 0.3)
    assert stress.shape == (3, 6)
    assert moved.shape == (3, 3)
    assert stress[0] == pytest.approx(
        [
            *(-0.07401684465047943, -0.06491185718128738, -0.4041031217003341),
            *(-0.01123289393450813, -0.05984304618452408, -0.08996969169936065),
        ],
        abs=1e-14,
    )
    assert moved[1] == pytest.approx(
        [0.1364590079405506, 0.003470490095686301, 0.02405071075477032], abs=1e-14
    )


def test_points_broadcast() -> None:
    x, z = np.linspace(-3, 3, 7), np.array([[0.0], [1.0], [9.0]])
    whole = influence.pyramid_stress(x, 0.5, z, 0.25)
    assert whole.shape == (3, 7, 3, 6)
    assert np.array_equal(whole[1, 2], influence.pyramid_stress(x[2], 0.5, 1.0, 0.25))
    assert influence.pyramid_displacement(np.empty(0), 0.0, 0.0, 0.3).shape == (0, 3, 3)


def test_triangles_add_up_to_the_pyramid() -> None:
    corner = np.array([[np.cos(k), np.sin(k)] for k in np.arange(6) * np.pi / 3])
    vertices = np.array([[(0, 0), corner[k], corner[k - 5]] for k in range(6)])
    loads = np.zeros((6, 3, 3))
    loads[:, 0] = 0.7, -0.2, 0.4
    x, y, z = np.random.default_rng(3).uniform(-2, 2, (3, 50))
    z = np.where(np.arange(50) % 5, abs(z), 0.0)
    for of_mesh, of_pyramid in (
        (influence.mesh_stress, influence.pyramid_stress),
        (influence.mesh_displacement, influence.pyramid_displacement),
    ):
        expected = np.einsum("nlc,l->nc", of_pyramid(x, y, z, 0.3), (0.7, -0.2, 0.4))
        assert of_mesh(vertices, loads, x, y, z, 0.3) == pytest.approx(expected, abs=1e-13)


def test_displacement_of_the_surface_is_that_of_the_surface_functions() -> None:
    vertices = [(0.0, 0.0), (1.0, 0.1), (0.2, 0.8)]
    traction = [[0.3, -0.1, 1.0], [0.2, 0.4, 0.5], [0.0, 0.1, 0.2]]
    x, y = np.random.default_rng(5).uniform(-2, 2, (2, 20))
    known = influence.linear_load_displacement(vertices, x, y, traction, shear_modulus=1.0, poisson_ratio=0.3)
    order = np.array(traction)[:, [2, 0, 1]]  # p, q_x, q_y
    found = influence.mesh_displacement([vertices], [order], x, y, 0.0, 0.3)
    assert found == pytest.approx(np.stack(known, axis=-1), abs=1e-14)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((0, 0, -1e-9, 0.3), "depths z of at least 0 expected"),
        ((0, np.nan, 1, 0.3), "finite coordinates expected"),
        ((0, 0, 1, 0.51), "above -1 and at most 0.5"),
        ((0, 0, 1, -1), "above -1 and at most 0.5"),
        ((0, 0, 1, np.nan), "poisson_ratio = nan"),
        (([1, 2], [1, 2, 3], 1, 0.3), "do not broadcast"),
        (("a", 0, 0, 0.3), "x: an array of real numbers expected"),
    ],
)
def test_bad_points_are_one_sentence(arguments: tuple, sentence: str) -> None:
    with pytest.raises(DeckError, match=sentence):
        influence.pyramid_stress(*arguments)


# --- closed solutions ---------------------------------------------------------------------------------------


def of_table(case: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points over a, friction and stresses over p0 of hertz_stress.csv."""
    rows = [row for row in table("hertz_stress.csv") if row[0] == case]
    values = np.array([[float(v) for v in row[1:12]] for row in rows])
    return values[:, :3], values[:, 4], values[:, 5:]


@pytest.mark.parametrize("case", ["axis", "off axis", "sliding", "max von Mises inside"])
def test_hertz_and_the_sliding_sphere(pressed, case: str) -> None:
    exact, result, _ = pressed
    points, mu, expected = of_table(case)
    pressure = result.step(-1)["pressure"].values / exact.max_pressure
    loads = np.array([[pressure, 0 * pressure, 0 * pressure], [0 * pressure, pressure, 0 * pressure]])
    _, (normal, shear) = fields.at_points(result.lattice, loads, 1, 0.3, points * RADIUS)
    error = abs(normal + mu[:, None] * shear - expected).max(axis=1)
    distance = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1, points[:, 2])  # from the edge
    assert error[distance > 0.15].max() < 1e-4
    # the edge of the contact runs between the nodes, the slope of the tractions is infinite: 4.1 % at -0.99 a
    assert error[(distance > 0.03) & (distance <= 0.15)].max(initial=0.0) < 8e-4
    assert error.max() < 0.045


def test_trailing_edge(pressed) -> None:
    exact, result, _ = pressed
    points, mu, expected = of_table("trailing edge")
    pressure = result.step(-1)["pressure"].values / exact.max_pressure
    loads = np.array([[pressure, 0 * pressure, 0 * pressure], [0 * pressure, pressure, 0 * pressure]])
    _, (normal, shear) = fields.at_points(result.lattice, loads, 1, 0.3, points * RADIUS)
    error = normal[:, 0] + mu * shear[:, 0] - expected[:, 0]
    # the mesh is too coarse for the corner of the traction: 0.02 p0 + 0.124 mu p0 at 40 spacings
    assert abs(error + 0.0200 + 0.124 * mu).max() < 3e-3


def test_the_peak_at_the_trailing_edge_follows_from_the_root() -> None:
    """Hats alone are 9 to 16 % low at 20 to 40 spacings: p0 ((1 - 2 nu)/3 + pi mu (4 + nu)/8)."""
    nu, mu, nodes = 0.3, 0.5, 20
    exact, case = hertz(nodes)
    steps: list = []
    case.run(on_step=steps.append)
    step, p0, h = steps[-1], exact.max_pressure, RADIUS / nodes
    hats = Loaded(step.lattice, [step.fields], step.bodies, 1).tractions("edges")[0][0, 0]
    peak = (1.0 - 2.0 * nu) / 3.0 + np.pi * mu * (4.0 + nu) / 8.0
    edge = np.array([[-RADIUS, 0.0, 0.0]])
    for turn in np.linspace(0.0, np.pi / 3, 5):  # other places between the nodes
        turned = edge @ [[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
        along = -turned[0, :2] / RADIUS
        loads = np.array([hats, mu * along[0] * hats, mu * along[1] * hats])
        _, [[stress]] = fields.at_points(step.lattice, loads[None], 1, nu, turned)
        [nodal] = nodal_tractions([step.fields])
        shear = np.array([mu * along[0] * nodal[0], mu * along[1] * nodal[0]])
        none, law = np.zeros(hats.shape, dtype=bool), FrictionLaw(mu)
        edges = _edges(step.lattice, nodal, step.fields)
        [more], refused = edges.stress(shear, none, law, loads, 1, nu, turned)
        radial = [*(along**2), 0, 2 * along[0] * along[1], 0, 0] @ np.stack([stress, stress + more], axis=1)
        assert refused == 0.0
        assert radial[0] < 0.93 * peak * p0
        assert radial[1] == pytest.approx(peak * p0, rel=0.02)
    # beside the edge, against the pressure of Hertz on a lattice eight times as fine
    fine = Lattice.covering(h / 8, (0.0, 0.0), 2.1 * RADIUS, 2.1 * RADIUS, (0.0, 0.0))
    hertzian = p0 * np.sqrt(np.maximum(1.0 - (fine.x**2 + fine.y**2) / RADIUS**2, 0.0))
    angles = np.linspace(0.0, np.pi, 7)
    for away, depth in ((-1.0, 0.0), (-0.3, 0.0), (0.3, 0.0), (1.0, 0.0), (0.0, 0.3), (0.2, 0.7)):
        r = RADIUS - away * h
        points = np.array([(r * np.cos(t), r * np.sin(t), depth * h) for t in angles])
        for body in (1, 2):
            _, [known] = fields.at_points(
                fine, np.array([[hertzian, mu * hertzian, 0 * hertzian]]), body, nu, points
            )
            _, [found] = fields.at_points(
                step.lattice, np.array([[hats, mu * hats, 0 * hats]]), body, nu, points
            )
            shear = np.array([mu * nodal[0], 0 * nodal[0]])
            more, _ = edges.stress(shear, none, law, np.array([hats, mu * hats, 0 * hats]), body, nu, points)
            plane = [0, 1, 3] if depth == 0.0 else [0, 1, 2, 3, 4, 5]
            assert abs(found - known)[:, plane].max() > 5e-3 * p0
            assert abs(found + more - known)[:, plane].max() < 4e-3 * p0


def test_the_stress_beside_both_edges_is_that_of_a_finer_lattice() -> None:
    last: list = []
    for nodes in (12, 36):
        Case(
            body_1=STEEL | {"surface": {"shape": "sphere", "radius": 0.02}},
            body_2=STEEL,
            nodes_in_radius=nodes,
            friction_coefficient=0.3,
            loads=[{"normal_load": 1000.0}, {"tangential_load_x": 180.0}],
        ).run(on_step=last.append)
    coarse, fine = last[1], last[3]
    h, radius = coarse.lattice.spacing, np.sqrt(fine.contact_area / np.pi)
    angles = np.linspace(-3.0, 3.0, 16)
    for edge in (radius, radius * (1.0 - 0.6) ** (1.0 / 3.0)):  # of the contact, and of stick
        for away, depth in ((-0.5, 0.0), (-0.3, 0.2), (0.3, 0.2), (0.0, 0.6)):
            points = [
                ((edge - away * h) * np.cos(t), (edge - away * h) * np.sin(t), depth * h) for t in angles
            ]
            exact, roots, nodes = (
                step.stress_at(points, *(f"stress_{ab}" for ab in fields.COMPONENTS), **source)
                .to_array()
                .values
                for step, source in ((fine, {}), (coarse, {}), (coarse, {"source": "nodes"}))
            )
            plane = slice(None) if depth else [0, 1, 3]
            largest = fine.max_pressure
            assert abs(roots - exact)[plane].max() < 1e-2 * largest
            if edge == radius:
                assert abs(roots - exact)[plane].max() < 0.3 * abs(nodes - exact)[plane].max()


def test_second_order(pressed) -> None:
    points, _, expected = of_table("axis")
    errors = []
    for nodes in (10, 20):
        exact, case = hertz(nodes)
        found = case.run().stress(points=points * RADIUS)
        stress = np.stack([found[f"stress_{ab}"] for ab in fields.COMPONENTS], axis=-1) / exact.max_pressure
        errors.append(abs(stress - expected)[points[:, 2] > 0.2].max())
    assert errors[0] / errors[1] > 3


# --- results ------------------------------------------------------------------------------------------------


def test_boxes_are_sums_at_their_nodes(pressed) -> None:
    _, result, _ = pressed
    box = result.stress(depths=[0.0, 3e-4], box=[[-5e-4, 5e-4], [-2e-4, 2e-4]], body=2)
    assert box["stress_xx"].dims == ("depth", "row", "col")
    x, y = box["x"].values.ravel()[::7], box["y"].values.ravel()[::7]
    points = result.stress(points=np.stack([x, y, 0 * x + 3e-4], axis=1), body=2)
    for name in points:
        found = box[name].values[1].ravel()[::7]
        assert found == pytest.approx(points[name].values, abs=1e-12 * 3.7e9)


def test_a_step_is_asked_like_a_result(pressed) -> None:
    _, result, steps = pressed
    points = [[0.0, 0.0, 4e-4], [9e-4, 0.0, 1e-4]]
    names = ("tresca_stress", "principal_stress_1", "displacement_z")
    assert steps[-1].stress_at(points, *names).equals(result.stress(*names, points=points))
    line = result.stress(*names, line=[[0, 0, 0], [0, 0, 1e-3]], count=11, step=[1, -1])
    assert line.sizes == {"step": 2, "distance": 11}
    plane = result.stress(*names, plane=[[0, 0, 0], [1e-3, 0, 0], [0, 0, 1e-3]], count=(5, 11))
    assert plane["tresca_stress"].values[:, 0] == pytest.approx(line["tresca_stress"].values[0], rel=1e-12)


def test_displacement_at_the_surface_is_that_of_the_contact(pressed) -> None:
    exact, result, _ = pressed
    points = [[0.0, 0.0, 0.0], [5e-4, 0.0, 0.0]]
    one, two = (
        result.stress("displacement_z", points=points, body=b)["displacement_z"].values for b in (1, 2)
    )
    assert one - two == pytest.approx(exact.approach - np.array([0.0, 5e-4**2 / 0.04]), rel=2e-4)


@pytest.mark.parametrize(
    ("where", "sentence"),
    [
        ({"points": [[0, 0, -1e-6]]}, "depths of at least 0"),
        ({"points": [[0, 0]]}, "x, y and depth of each point"),
        ({"points": [[0, 0, np.nan]]}, "points: finite numbers expected"),
        ({}, "expected one of points, line, plane, depths, not nothing"),
        ({"points": [[0, 0, 0]], "depths": [0]}, "not points and depths"),
        ({"line": [[0, 0, 0], [1, 1, 1]], "count": 1}, "a number of points, 2 to 100000"),
        ({"plane": [[0, 0, 0], [1, 1, 1], [0, 0, 1]], "count": 5}, "expected two numbers"),
        ({"depths": [-1.0]}, "depths of at least 0"),
        ({"depths": [0], "box": [[1, 0], [0, 1]]}, "smallest and largest x"),
        ({"points": [[0, 0, 1]], "body": 3}, "body = 3: expected 1 or 2"),
        ({"points": [[0, 0, 1e200]]}, "coordinates of at most 1e100"),
        ({"points": [[0, 0, 1]], "count": 4}, "count: expected only with line or plane, not with points"),
        ({"line": [[0, 0, 0], [1, 1, 1]], "box": [[0, 1], [0, 1]]}, "box: expected only with depths"),
        ({"depths": [0], "box": [[-1e300, 1e300], [0, 1]]}, "smallest and largest x"),
        ({"depths": [0], "box": [[1e9, 2e9], [0, 1]]}, "within 100,000,000 spacings"),
        ({"points": [[0, 0, 1]], "step": "all"}, "step = 'all': expected an integer"),
        ({"points": [[0, 0, 1]], "step": []}, "expected the number of a step, or some"),
    ],
)
def test_bad_regions_are_one_sentence(pressed, where: dict, sentence: str) -> None:
    with pytest.raises(DeckError, match=sentence):
        pressed[1].stress(**where)


def test_bad_components_are_one_sentence(pressed) -> None:
    with pytest.raises(
        DeckError, match="'stres_xx' is no quantity below the surface; did you mean stress_xx"
    ):
        pressed[1].stress("stres_xx", points=[[0, 0, 0]])
    with pytest.raises(DeckError, match=r"\['stress_xx'\] is no quantity below the surface"):
        pressed[1].stress(["stress_xx"], points=[[0, 0, 0]])
    with pytest.raises(DeckError, match="source = 'node': expected edges or nodes"):
        pressed[1].stress(points=[[0, 0, 0]], source="node")


def test_displacements_in_a_box_are_those_at_its_nodes(pressed) -> None:
    box = pressed[1].stress("displacement_x", "stress_zz", depths=[1e-4], box=[[0, 2e-4], [0, 2e-4]])
    points = np.stack([box["x"].values, box["y"].values, np.full(box["x"].shape, 1e-4)], axis=-1)
    found = pressed[1].stress("displacement_x", "stress_zz", points=points)
    for name in ("displacement_x", "stress_zz"):
        assert box[name].values[0] == pytest.approx(found[name].values, rel=1e-12)


def test_displacements_of_whole_planes_are_sums_at_their_nodes(pressed) -> None:
    """By FFT, in the body whose frame is mirrored and in the other one."""
    names = [f"displacement_{axis}" for axis in "xyz"]
    for body in (1, 2):
        box = pressed[1].stress(*names, depths=[0.0, 3e-4], body=body)
        x, y = box["x"].values.ravel()[::311], box["y"].values.ravel()[::311]
        found = pressed[1].stress(*names, points=np.stack([x, y, 0 * x + 3e-4], axis=1), body=body)
        for name in names:
            scale = abs(found[name].values).max()
            assert box[name].values[1].ravel()[::311] == pytest.approx(found[name].values, abs=1e-11 * scale)


def test_a_small_box_far_away_is_a_sum(pressed) -> None:
    """A plane that covers it and the window would take 20 GB."""
    box = pressed[1].stress("stress_zz", depths=[1e-3], box=[[0.5, 0.5001], [0.0, 1e-4]])
    points = np.stack([box["x"].values, box["y"].values, np.full(box["x"].shape, 1e-3)], axis=-1)
    found = pressed[1].stress("stress_zz", points=points)
    assert box["stress_zz"].values[0] == pytest.approx(found["stress_zz"].values, rel=1e-12)


def test_tractions_corrected_at_the_edge_give_the_smaller_error(pressed) -> None:
    """Hertz on and off the axis, one spacing deep and more: 7.8e-5 p0, and 7.5e-4 of the nodal tractions."""
    exact, result, _ = pressed
    points, _, expected = (
        np.concatenate(both) for both in zip(of_table("axis"), of_table("off axis"), strict=True)
    )
    deep = points[:, 2] >= 1 / 40
    errors = {}
    for source in ("edges", "nodes"):
        found = result.stress(points=points * RADIUS, source=source)
        assert found.attrs["tractions"] == source
        stress = np.stack([found[f"stress_{ab}"] for ab in fields.COMPONENTS], axis=-1) / exact.max_pressure
        errors[source] = abs(stress - expected).max(axis=1)
    assert errors["edges"][deep].max() < 1e-4
    assert errors["nodes"][deep].max() > 7e-4
    assert result.stress(points=points).attrs["tractions"] == "edges"


def test_corrected_tractions_have_the_loads_of_the_nodal_ones() -> None:
    """Partial slip in two directions: edges of contact and stick."""
    body = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    loads = [{"normal_load": 100.0}, {"tangential_load_x": 25.0, "tangential_load_y": -10.0}]
    given = {"friction_coefficient": 0.5, "nodes_in_radius": 12, "loads": loads}
    steps: list = []
    Case(body_1={**body, "surface": Sphere(radius=0.02)}, body_2=body, **given).run(on_step=steps.append)
    nodal, corrected = (
        Loaded(steps[-1].lattice, [steps[-1].fields], steps[-1].bodies, 1, 0.5).tractions(s)[0][0]
        for s in ("nodes", "edges")
    )
    for k in range(3):
        assert corrected[k].sum() == pytest.approx(nodal[k].sum(), rel=1e-5)
        assert abs(corrected[k] - nodal[k]).max() > 1e-3 * abs(nodal[k]).max()


def test_large_boxes_are_refused_before_memory_is_taken(pressed) -> None:
    with pytest.raises(
        ResourceError, match="choose a smaller box, or one nearer to the window, fewer depths"
    ):
        pressed[1].stress(depths=np.linspace(0, 1, 1_000_000))
    with pytest.raises(ResourceError, match="the plane needs 240 GB"):
        pressed[1].stress(plane=[[0, 0, 0], [1e-3, 0, 0], [0, 0, 1e-3]], count=(100_000, 100_000))
    box = {"depths": [1e-6], "box": [[-10.0, 10.0], [-10.0, 10.0]]}
    with pytest.raises(ResourceError, match=r"stress\.2 needs .* GB .*choose a smaller region, fewer points"):
        hertz(5)[1].changed({"stress": [{"points": [[0, 0, 0]]}, box]}).run()


def test_histories_of_many_steps() -> None:
    """The sums over them (13 MB) were on the stack of each thread, which ended the process."""
    lattice = Lattice(1.0, -1, -1, 3, 3)
    loads = np.arange(1.0, 20_001.0)[:, None, None, None] * np.ones((3, 3, 3))
    _, stress = fields.at_points(lattice, loads, 1, 0.3, [[0.1, 0.2, 0.5], [0.3, 0.0, 1.0]], threads=2)
    assert stress[-1] == pytest.approx(20_000 * stress[0], rel=1e-12)


def test_lattices_far_away() -> None:
    """A node seen from 1e5 spacings is a point load."""
    lattice = Lattice(1.0, 0, 0, 1, 1)
    loads = np.array([[[[1.0]], [[0.0]], [[0.0]]]])
    _, stress = fields.at_points(lattice, loads, 1, 0.3, [[0.0, 0.0, 1e5]])
    assert stress[0, 0, 2] == pytest.approx(-3 * np.sqrt(0.75) / (2 * np.pi * 1e10), rel=1e-9)


# --- decks --------------------------------------------------------------------------------------------------

DECK = """
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "20 mm" }
[body.2]
rigid = true
[grid]
nodes_in_radius = 8
[[load]]
normal_load = "1 kN"
steps = 2
"""


def checked(tmp_path: Path, *lines: Sequence[str]) -> subprocess.CompletedProcess[str]:
    (tmp_path / "deck.toml").write_text(DECK + "[[stress]]\n" + "\n".join(lines))
    return commands.inside(tmp_path, "check", "deck.toml")


def test_tables_of_a_deck(tmp_path: Path) -> None:
    tables = """
[[stress]]
name = "axis"
line = [["0 mm", "0 mm", "0 mm"], ["0 mm", "0 mm", "1 mm"]]
count = [21]
steps = "all"
components = ["von_mises_stress", "displacement_z"]
[[stress]]
depths = ["0 um", "0.1 mm"]
"""
    (tmp_path / "deck.toml").write_text(DECK + tables)
    done = commands.inside(tmp_path, "run", "deck.toml")
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("written: deck.nc, deck_axis.nc, deck_stress_2.nc\n")
    with xarray.open_dataset(tmp_path / "deck_axis.nc") as axis:
        assert axis["von_mises_stress"].sizes == {"step": 2, "distance": 21}
        assert axis["von_mises_stress"].attrs["units"] == "Pa"
        assert set(axis.coords) == {"x", "y", "depth", "distance", "step"}
        assert (axis["displacement_z"].values > 0).all()
    with xarray.open_dataset(tmp_path / "deck_stress_2.nc") as box:
        assert box["stress_zz"].dims == ("step", "depth", "row", "col")
        assert box["depth"].values.tolist() == [0.0, 1e-4]
    assert commands.inside(tmp_path, "export", "deck.nc", "--vtk").returncode == 0
    assert (tmp_path / "deck_export" / "deck_axis.pvd").is_file()
    check_volume(tmp_path)
    done = commands.inside(tmp_path, "export", "deck.nc", "--csv")
    assert done.stdout.split()[1::2] == [f"deck_export/deck_{n}.csv" for n in ("history", "axis", "stress_2")]
    rows = (tmp_path / "deck_export/deck_axis.csv").read_text().splitlines()
    assert rows[0].startswith(
        "step,x [m],y [m],depth [m],distance [m],von_mises_stress [Pa],displacement_z [m]"
    )
    assert [row.split(",")[0] for row in rows[1:]] == ["1"] * 21 + ["2"] * 21
    (tmp_path / "deck_axis.nc").unlink()  # then it is computed anew
    (tmp_path / "deck_export/deck_axis.csv").unlink()
    assert commands.inside(tmp_path, "export", "deck.nc", "--csv").returncode == 0
    assert (tmp_path / "deck_export/deck_axis.csv").read_text().splitlines() == rows
    assert commands.inside(tmp_path, "report", "deck.nc").returncode == 0
    page = (tmp_path / "deck.html").read_text()
    assert page.count('<figure class="picture">') == 1
    picture = base64.b64decode(page.split("data:image/png;base64,")[1].split('"')[0])
    assert picture.startswith(b"\x89PNG")


def check_volume(folder: Path) -> None:
    """Read a volume as VTK defines it: x runs fastest, the depth last; tensors are xx yy zz xy yz xz."""
    root = ElementTree.parse(folder / "deck_export" / "deck_stress_2_0002.vts").getroot()
    piece = root.find("StructuredGrid/Piece")
    assert root.attrib["compressor"] == "vtkZLibDataCompressor"
    low_high = [int(word) for word in piece.attrib["Extent"].split()]
    shape = [high - low + 1 for low, high in zip(low_high[::2], low_high[1::2], strict=True)]
    arrays = {}
    for array in piece.iter("DataArray"):
        text = array.text.strip()
        blocks, size, _, packed = np.frombuffer(base64.b64decode(text[:44]), "<u8").tolist()
        data = zlib.decompress(base64.b64decode(text[44:]))
        assert (blocks, size, packed) == (1, len(data), len(base64.b64decode(text[44:])))
        width = int(array.get("NumberOfComponents", 1))
        arrays[array.get("Name")] = np.frombuffer(data, "<f8").reshape(np.prod(shape), width)
    points = arrays["Points"].reshape(*shape[::-1], 3)
    assert (np.diff(points[..., 0], axis=2) > 0).all()
    assert (np.diff(points[..., 1], axis=1) > 0).all()
    assert points[:, 0, 0, 2].tolist() == [0.0, 1e-4]
    result = open_result(folder / "deck.nc")
    places = arrays["Points"][:: len(arrays["Points"]) // 50]
    found = result.stress(points=places, step=2)
    largest = result.step(2)["pressure"].values.max()
    tensor = arrays["stress"][:: len(arrays["Points"]) // 50]
    for k, ab in enumerate(("xx", "yy", "zz", "xy", "yz", "xz")):
        assert tensor[:, k] == pytest.approx(found[f"stress_{ab}"].values, abs=1e-10 * largest)
        assert np.array_equal(arrays["stress"][:, k], arrays[f"stress_{ab}"][:, 0])


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        (['points = [["0 mm", "0 mm", "-1 um"]]'], "expected a point of the body: a depth of at least 0"),
        (["points = [[0, 0, 0]]", "body = 2"], "body 2 is rigid"),
        (["points = [[0, 0, 0]]", 'components = ["von_mises"]'], "did you mean von_mises_stress"),
        (["points = [[0, 0, 0]]", "depths = [0]"], "expected one of points, line, plane, depths"),
        (['name = "x"'], "expected one of points, line, plane, depths"),
        (["line = [[0, 0, 0], [0, 0, 1]]", "count = [3, 4]"], "expected one number with line"),
        (["line = [[0, 0, 1], [0, 0, 1]]"], "expected two different points"),
        (["plane = [[0, 0, 0], [0, 0, 1], [0, 0, 3]]"], "expected three points that are not on one line"),
        (["points = [[0, 0, 0]]", "box = [[0, 1], [0, 1]]"], "needs depths beside it"),
        (["depths = [0]", 'source = "node"'], "did you mean nodes"),
        (["depths = [0]", 'name = "a/b"'], "a name of a few letters"),
        (["depths = [0]", f'name = "{"a" * 100}"'], "a name of a few letters"),
        (
            ["depths = [0]", 'name = "stress_2"', "[[stress]]", "depths = [1]"],
            'stress.2.name = "": expected a name of a few letters, digits, - and _ that no other',
        ),
        (["depths = [0]", "box = [[1, 0], [0, 1]]"], "the smaller coordinate first"),
        (["depths = [0]", "steps = [1, 3]"], "there are no fields of step 3: 2 load steps"),
    ],
)
def test_bad_tables_are_one_sentence(tmp_path: Path, lines: list[str], sentence: str) -> None:
    done = checked(tmp_path, *lines)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_tables_on_lines_and_at_points_are_drawn(tmp_path: Path) -> None:
    tables = """
[[stress]]
line = [["-1 mm", "0 mm", "0 mm"], ["1 mm", "0 mm", "0 mm"]]
count = [5]
[[stress]]
points = [["0 mm", "0 mm", "0.1 mm"], ["0.1 mm", "0 mm", "0.1 mm"]]
steps = "all"
components = ["stress_zz"]
[[stress]]
line = [["0 mm", "0 mm", "0 mm"], ["0 mm", "0.3 mm", "0.4 mm"]]
count = [5]
steps = [1, 2]
components = ["displacement_z", "von_mises_stress"]
"""
    (tmp_path / "deck.toml").write_text(DECK + tables)
    assert commands.inside(tmp_path, "run", "deck.toml", "--quiet").returncode == 0
    assert commands.inside(tmp_path, "plot", "deck.nc", "--what", "lines").returncode == 0
    result = open_result(tmp_path / "deck.nc")
    canvas = plotting.lines(result)
    drawn.assert_painted(canvas)
    line, points, moved, mises = drawn.visible(canvas)
    assert [axes.get_ylabel() for axes in (line, points, moved, mises)] == [
        *("stress (GPa)", r"$\sigma_{zz}$ (GPa)", "$u_{z}$ (µm)", "von Mises stress (GPa)")
    ]
    with xarray.open_dataset(tmp_path / "deck_stress_1.nc") as found:
        names = [text.get_text() for text in line.get_legend().get_texts()]
        assert names == [rf"$\sigma_{{{ab}}}$" for ab in ("xx", "yy", "zz", "xy", "yz", "xz")] + ["von Mises"]
        for curve, name in zip(line.lines, found.data_vars, strict=False):
            place, values = drawn.si(line, curve)
            np.testing.assert_allclose(place, found["x"], atol=1e-18)
            np.testing.assert_allclose(values, found[name][0], atol=1.0)
    with xarray.open_dataset(tmp_path / "deck_stress_2.nc") as found:
        assert points.get_xlabel() == "load step"
        for k, curve in enumerate(points.lines[:2]):
            assert curve.get_xdata().tolist() == [1, 2]
            np.testing.assert_allclose(drawn.si(points, curve, "x (m)")[1], found["stress_zz"][:, k])
    with xarray.open_dataset(tmp_path / "deck_stress_3.nc") as found:
        assert moved.get_xlabel() == "distance (µm)"
        for k, curve in enumerate(moved.lines[:2]):
            np.testing.assert_allclose(drawn.si(moved, curve)[1], found["displacement_z"][k])
        labels = [text.get_text() for text in mises.get_legend().get_texts()]
        assert labels == ["step 1", "step 2"]


def test_a_table_with_the_name_of_another_export_is_refused(tmp_path: Path) -> None:
    table = '[[stress]]\nname = "history"\npoints = [[0, 0, 0]]\n'
    (tmp_path / "deck.toml").write_text(DECK + table)
    assert commands.inside(tmp_path, "run", "deck.toml", "--quiet").returncode == 0
    done = commands.inside(tmp_path, "export", "deck.nc", "--csv")
    assert done.returncode == 2 and "the table history would be written to" in done.stderr
    assert not (tmp_path / "deck_export").exists()


def test_files_of_others_are_not_replaced_by_stresses(tmp_path: Path) -> None:
    """Only --overwrite replaces files, and only stresses: a result of that name was lost."""
    (tmp_path / "deck.toml").write_text(DECK)
    (tmp_path / "of.toml").write_text(DECK + '[[stress]]\nname = "axis"\npoints = [[0, 0, 0]]\n')
    output, target = tmp_path / "of.nc", tmp_path / "of_axis.nc"
    Case.from_toml(tmp_path / "deck.toml").run(target)
    of_stress = Case.from_toml(tmp_path / "of.toml")
    precious = target.read_bytes()
    with pytest.raises(DeckError, match="of_axis.nc exists already; --overwrite"):
        of_stress.run(output)
    with pytest.raises(DeckError, match="of_axis.nc does not hold stresses that hexcontact has written"):
        of_stress.run(output, overwrite=True)
    assert target.read_bytes() == precious
    assert not list(tmp_path.glob("of.nc*"))
    target.unlink()
    of_stress.run(output)
    with xarray.open_dataset(target) as first:
        run = first.attrs["stress_of"]
    with pytest.raises(DeckError, match=r"of.nc exists already"):
        of_stress.run(output)
    of_stress.run(output, overwrite=True)
    with xarray.open_dataset(target) as second:
        assert second.attrs["stress_of"] != run
    target.unlink()
    target.symlink_to(tmp_path / "nothing.nc")
    with pytest.raises(DeckError, match="does not hold stresses"):
        of_stress.run(output, overwrite=True)


def test_a_run_that_was_killed_before_its_stresses_gets_them(tmp_path: Path) -> None:
    (tmp_path / "deck.toml").write_text(DECK + "[[stress]]\npoints = [[0, 0, 1e-5]]\n")
    Case.from_toml(tmp_path / "deck.toml").run(tmp_path / "deck.nc")
    target = tmp_path / "deck_stress_1.nc"
    with xarray.open_dataset(target) as found:
        expected = found.load()
    target.unlink()
    left = tmp_path / f"deck_stress_1.nc.{(1 << 22) + 1}.tmp"  # no process has such a number
    left.write_text("")
    os.utime(left, (0.0, 0.0))
    assert commands.inside(tmp_path, "resume", "deck.nc").returncode == 0
    assert not left.exists()
    with xarray.open_dataset(target) as found:
        assert found.identical(expected)
    written = target.stat().st_mtime_ns
    resume(tmp_path / "deck.nc")
    assert target.stat().st_mtime_ns == written


def test_spectra_of_planes_are_kept_and_give_the_same_bits(pressed) -> None:
    _, result, _ = pressed
    first = result.stress("stress_xx", depths=[1e-4])
    assert first.equals(result.stress("stress_xx", depths=[1e-4]))


def test_planes_that_do_not_fit_together_leave_the_cache_alone(pressed) -> None:
    _, result, _ = pressed
    try:
        kernel_cache.clear()
        result.stress("stress_xx", depths=[1e-4])
        one = kernel_cache.statistics().memory
        kernel_cache.configure(memory=3 * one)
        together = result.stress("stress_xx", depths=[2e-4, 3e-4, 4e-4, 5e-4, 6e-4])
        assert kernel_cache.statistics().memory == one > 0
        result.stress("stress_xx", depths=[2e-4])
        assert kernel_cache.statistics().memory > one
        assert together.isel(depth=[0]).equals(result.stress("stress_xx", depths=[2e-4]))
    finally:
        kernel_cache.configure(memory="256 MB")
