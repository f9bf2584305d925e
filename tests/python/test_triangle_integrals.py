"""Triangle integrals and displacements through Python: the table, every kind of point, wrong arguments."""

import csv
import itertools
from pathlib import Path

import numpy as np
import pytest

from hexcontact import DeckError
from hexcontact.influence import linear_load_displacement, triangle_displacement, triangle_integral

TABLE = Path(__file__).parents[1] / "reference" / "triangle_integrals.csv"
TRIPLES = [
    (j, k, m) for j, k, m in itertools.product((1, 2, 3), range(5), range(5)) if 1 <= k + m + 2 - j <= 3
]
TRIANGLE = np.array([[0.1, -0.2], [1.1, 0.3], [0.4, 0.9]])
MATERIAL = {"shear_modulus": 1.7, "poisson_ratio": 0.3}
ROWS = list(csv.DictReader(line for line in TABLE.read_text().splitlines() if not line.startswith("#")))


def area(triangle):
    (x1, y1), (x2, y2), (x3, y3) = triangle
    return 0.5 * abs((x2 - x1) * (y3 - y1) - (x3 - x1) * (y2 - y1))


def envelope(triangle, x, y, j, k, m):
    """Lower bound of I_100 d^(k+m+1-j), which bounds the integral; d: distance of the farthest vertex."""
    d = np.max([np.hypot(x - a, y - b) for a, b in triangle], axis=0)
    return area(triangle) * d ** (k + m - j)


def test_table_is_complete():
    assert len(ROWS) == 210
    assert {(int(row["j"]), int(row["k"]), int(row["m"])) for row in ROWS} == set(TRIPLES)


@pytest.mark.parametrize("shape", sorted({row["shape"] for row in ROWS}))
def test_table(shape):
    """Tolerance: 1e-13 of a lower bound of the scale, ten times less than promised."""
    for row in ROWS:
        if row["shape"] != shape:
            continue
        triangle = [(float(row[f"x{i}"]), float(row[f"y{i}"])) for i in (1, 2, 3)]
        arguments = (float(row["x"]), float(row["y"]), int(row["j"]), int(row["k"]), int(row["m"]))
        error = triangle_integral(triangle, *arguments) - float(row["I"])
        assert abs(error) <= 1e-13 * envelope(triangle, *arguments), row["id"]


def random_triangles(number, seed):
    """Triangles of any shape and orientation, one in three a sliver of up to 1:1e6."""
    rng = np.random.default_rng(seed)
    for i in range(number):
        triangle = rng.uniform(-1, 1, (3, 2)) * 10.0 ** rng.integers(-6, 7)
        if i % 3 == 0:
            along = rng.uniform(-0.5, 1.5)
            foot = along * triangle[0] + (1 - along) * triangle[1]
            triangle[2] = foot + (triangle[2] - foot) * 10.0 ** -rng.uniform(1, 6)
        yield triangle, rng


def points_about(triangle, rng):
    """Vertices, points on edges, on their prolongations, inside, around and far away."""
    share = np.concatenate(
        [
            np.eye(3),
            *(
                np.roll(np.stack([w, 1 - w, 0 * w], axis=1), i, axis=1)
                for i in range(3)
                for w in [np.linspace(-2, 3, 41)]
            ),
            rng.dirichlet([1, 1, 1], 20),
            rng.normal(0, 3, (20, 3)),
        ]
    )
    share[:, 2] = 1 - share[:, 0] - share[:, 1]
    points = share @ triangle
    size = np.ptp(triangle, axis=0).max()
    around = triangle.mean(axis=0) + size * 10.0 ** rng.uniform(-2, 6, (40, 1)) * rng.normal(size=(40, 2))
    close = points[:30] + size * 10.0 ** rng.uniform(-17, -3, (30, 1)) * rng.normal(size=(30, 2))
    return np.concatenate([points, around, close]).T


def test_finite_and_bounded_everywhere():
    """|I_jkm| <= I_100 d^(k+m+1-j), for random triangles and all kinds of points."""
    for triangle, rng in random_triangles(36, seed=5):
        x, y = points_about(triangle, rng)
        farthest = np.max([np.hypot(x - a, y - b) for a, b in triangle], axis=0)
        potential = triangle_integral(triangle, x, y, 1, 0, 0)
        assert np.all(potential > 0)
        for j, k, m in TRIPLES:
            value = triangle_integral(triangle, x, y, j, k, m)
            assert np.all(np.isfinite(value))
            assert np.all(np.abs(value) <= (1 + 1e-12) * potential * farthest ** (k + m + 1 - j))


def test_trace_identities():
    """I_3,k+2,m + I_3,k,m+2 = I_1,k,m, and I_220 + I_202 is the area."""
    for triangle, rng in random_triangles(18, seed=6):
        x, y = points_about(triangle, rng)
        for k, m in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
            left = triangle_integral(triangle, x, y, 3, k + 2, m) + triangle_integral(
                triangle, x, y, 3, k, m + 2
            )
            right = triangle_integral(triangle, x, y, 1, k, m)
            potential = triangle_integral(triangle, x, y, 1, 0, 0)
            farthest = np.max([np.hypot(x - a, y - b) for a, b in triangle], axis=0)
            assert np.all(np.abs(left - right) <= 2e-13 * potential * farthest ** (k + m))
        total = triangle_integral(triangle, x, y, 2, 2, 0) + triangle_integral(triangle, x, y, 2, 0, 2)
        np.testing.assert_allclose(total, total[0], rtol=4e-13)


def test_shapes_broadcast():
    x, y = np.linspace(-1, 2, 7)[:, None], np.linspace(0, 1, 5)
    value = triangle_integral(TRIANGLE, x, y, 2, 1, 1)
    assert value.shape == (7, 5)
    assert value[3, 2] == triangle_integral(TRIANGLE, x[3, 0], y[2], 2, 1, 1)
    assert triangle_integral(TRIANGLE, 0.0, 0.0, 1, 0, 0).shape == ()
    assert triangle_integral(TRIANGLE, [], [], 1, 0, 0).shape == (0,)
    assert triangle_displacement(TRIANGLE, x, y, **MATERIAL).z.shape == (7, 5)
    assert linear_load_displacement(TRIANGLE, x, y, np.eye(3), **MATERIAL).x.shape == (7, 5)
    integers = triangle_integral([[0, 0], [1, 0], [0, 1]], np.arange(3), 0, 1, 0, 0)
    assert integers[0] == triangle_integral([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0.0, 0.0, 1, 0, 0)


def test_number_of_threads_does_not_matter():
    """More points than one thread takes: each is what it is alone."""
    x, y = np.random.default_rng(7).uniform(-3, 3, (2, 5000))
    value = triangle_integral(TRIANGLE, x, y, 3, 2, 1)
    alone = np.concatenate(
        [triangle_integral(TRIANGLE, x[i : i + 50], y[i : i + 50], 3, 2, 1) for i in range(0, 5000, 50)]
    )
    np.testing.assert_array_equal(value, alone)


@pytest.mark.parametrize("load", ["constant", "linear_x", "linear_y", "bilinear"])
def test_displacements_are_those_of_the_tables(load):
    """Tables 4.1 and 4.2 with a = (1-nu)/(2 pi G), b = (1-2nu)/(4 pi G), c = nu/(2 pi G)."""
    x, y = points_about(TRIANGLE, np.random.default_rng(8))
    g, nu = MATERIAL["shear_modulus"], MATERIAL["poisson_ratio"]
    a, b, c = (1 - nu) / (2 * np.pi * g), (1 - 2 * nu) / (4 * np.pi * g), nu / (2 * np.pi * g)
    k, m = {"constant": (0, 0), "linear_x": (1, 0), "linear_y": (0, 1), "bilinear": (1, 1)}[load]

    def integral(j, p, q):
        return triangle_integral(TRIANGLE, x, y, j, k + p, m + q)

    i100, i210, i201 = integral(1, 0, 0), integral(2, 1, 0), integral(2, 0, 1)
    i320, i311, i302 = integral(3, 2, 0), integral(3, 1, 1), integral(3, 0, 2)
    expected = {
        "normal": (-b * i210, -b * i201, a * i100),
        "x": (a * i100 + c * i320, c * i311, b * i210),
        "y": (c * i311, a * i100 + c * i302, b * i201),
    }
    scale = a * envelope(TRIANGLE, x, y, 1, k, m)
    for direction, components in expected.items():
        u = triangle_displacement(TRIANGLE, x, y, load=load, direction=direction, **MATERIAL)
        for value, component in zip(u, components, strict=True):
            assert np.all(np.abs(value - component) <= 1e-14 * scale)


def test_linear_load_is_a_sum_of_table_loads():
    """f(xi, eta) = f(x, y) - g_x (x - xi) - g_y (y - eta), for points up to a few sizes away."""
    rng = np.random.default_rng(9)
    x, y = rng.uniform(-2, 3, (2, 400))
    value, slope = rng.normal(size=3), rng.normal(size=(3, 2))
    u = linear_load_displacement(TRIANGLE, x, y, value + TRIANGLE @ slope.T, **MATERIAL)
    expected = np.zeros((3, x.size))
    for axis, direction in enumerate(("x", "y", "normal")):
        loads = {
            "constant": value[axis] + slope[axis, 0] * x + slope[axis, 1] * y,
            "linear_x": -slope[axis, 0],
            "linear_y": -slope[axis, 1],
        }
        for load, factor in loads.items():
            expected += factor * np.array(
                triangle_displacement(TRIANGLE, x, y, load=load, direction=direction, **MATERIAL)
            )
    np.testing.assert_allclose(np.array(u), expected, rtol=0, atol=1e-14)


def test_triangle_without_area_gives_zero():
    line = [[0.0, 0.0], [1.0, 2.0], [3.0, 6.0]]
    assert np.all(triangle_integral(line, [0.0, 1.0, 7.0], [0.0, 2.0, 3.0], 3, 1, 1) == 0)
    assert triangle_integral([[1, 1]] * 3, 1.0, 1.0, 1, 0, 0) == 0


@pytest.mark.parametrize(
    "triple", [(2, 0, 0), (3, 1, 0), (0, 0, 0), (4, 2, 2), (1, -1, 1), (1, 3, 0), (10**12, 0, 0)]
)
def test_exponents_that_are_not_supported(triple):
    with pytest.raises(DeckError, match="expected") as caught:
        triangle_integral(TRIANGLE, 0.0, 0.0, *triple)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("vertices", "x", "y", "words"),
    [
        (TRIANGLE, np.nan, 0.0, "field points.*finite"),
        (TRIANGLE, [0.0, np.inf], [0.0, 0.0], "field points.*finite"),
        (TRIANGLE * np.nan, 0.0, 0.0, "vertices.*finite"),
        (TRIANGLE[:2], 0.0, 0.0, r"vertices.*\(3, 2\)"),
        (np.zeros((3, 3)), 0.0, 0.0, r"vertices.*\(3, 2\)"),
        (TRIANGLE, [0.0, 1.0], [0.0, 1.0, 2.0], "x and y.*broadcast"),
        (TRIANGLE, "here", 0.0, "x: an array of real numbers"),
        (TRIANGLE, 0.0, 1j, "y: an array of real numbers"),
        (TRIANGLE, 0.0, None, "y: an array of real numbers"),
        ([[0, 0], [1, 0], [1]], 0.0, 0.0, "vertices: an array of real numbers"),
    ],
)
def test_wrong_points_and_vertices(vertices, x, y, words):
    with pytest.raises(DeckError, match=words) as caught:
        triangle_integral(vertices, x, y, 1, 0, 0)
    assert isinstance(caught.value, ValueError)
    assert "\n" not in str(caught.value)
    with pytest.raises(DeckError, match=words):
        triangle_displacement(vertices, x, y, **MATERIAL)
    with pytest.raises(DeckError, match=words):
        linear_load_displacement(vertices, x, y, np.eye(3), **MATERIAL)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"load": "cubic"}, "load = 'cubic'.*'bilinear'"),
        ({"load": ["constant"]}, "load = .*expected 'constant' or"),
        ({"direction": "z"}, "direction = 'z'.*'normal'"),
        ({"shear_modulus": 0.0}, "shear modulus.*positive"),
        ({"shear_modulus": np.nan}, "shear_modulus = nan: expected a number"),
        ({"shear_modulus": "steel"}, "shear_modulus = 'steel'.*number"),
        ({"poisson_ratio": 0.6}, "Poisson's ratio.*0.5"),
        ({"poisson_ratio": -1.0}, "Poisson's ratio.*-1"),
    ],
)
def test_wrong_loads_and_materials(change, words):
    with pytest.raises(DeckError, match=words):
        triangle_displacement(TRIANGLE, 0.0, 0.0, **(MATERIAL | change))


def test_wrong_tractions():
    with pytest.raises(DeckError, match=r"traction.*\(3, 3\)"):
        linear_load_displacement(TRIANGLE, 0.0, 0.0, np.ones(3), **MATERIAL)
    with pytest.raises(DeckError, match=r"tractions.*finite"):
        linear_load_displacement(TRIANGLE, 0.0, 0.0, np.full((3, 3), np.nan), **MATERIAL)
    with pytest.raises(DeckError, match="Poisson's ratio"):
        linear_load_displacement(TRIANGLE, 0.0, 0.0, np.eye(3), shear_modulus=1.0, poisson_ratio=0.7)


def test_exponents_must_be_integers():
    with pytest.raises(DeckError, match=r"k = 0\.5: expected an integer"):
        triangle_integral(TRIANGLE, 0.0, 0.0, 1, 0.5, 0)
