"""Kernels of the pyramid and the functions of Table 8.1 through Python."""

import csv
import itertools
from pathlib import Path

import numpy as np
import pytest

import hexcontact
from hexcontact import DeckError
from hexcontact.influence import (
    PyramidFunctions,
    linear_load_displacement,
    pyramid_functions,
    pyramid_kernels,
)

TABLE = Path(__file__).parents[1] / "reference" / "pyramid_kernels.csv"
SERIES = TABLE.with_name("pyramid_multipole.csv")
ROWS = list(csv.DictReader(line for line in TABLE.read_text().splitlines() if not line.startswith("#")))
TOP = 1.5 * np.sqrt(3) * np.log(3)


def column(name):
    return np.array([float(row[name]) for row in ROWS])


def points(number, seed):
    """Points at all distances from 1e-9 to 1e5 spacings, and the apex."""
    rng = np.random.default_rng(seed)
    z = 10 ** rng.uniform(-9, 5, number) * np.exp(1j * rng.uniform(0, 2 * np.pi, number))
    z[: number // 2] = rng.uniform(0, 4, number // 2) * np.exp(1j * np.angle(z[: number // 2]))
    z[0] = 0
    return z


def test_table():
    """Every row within 1e-13 of K1, ten times less than promised."""
    assert len(ROWS) == 183
    kernels = pyramid_kernels(column("X"), column("Y"))
    for name, value in kernels._asdict().items():
        error = np.abs(value - column(name)) / column("K1")
        assert error.max() <= 1e-13, (name, ROWS[int(error.argmax())]["id"])


def test_special_values():
    """K1(0) = (3 sqrt(3)/2) ln 3, a third of it at all six neighbours; K_xx(0) = K1(0)/2."""
    apex = pyramid_kernels(0.0, 0.0)
    np.testing.assert_allclose(apex, [TOP, TOP / 2, 0, 0, 0], rtol=0, atol=1e-15 * TOP)
    assert all(value.shape == () for value in apex)
    neighbours = np.exp(1j * np.pi / 3 * np.arange(6))
    np.testing.assert_allclose(pyramid_kernels(neighbours.real, neighbours.imag).K1, TOP / 3, rtol=1e-14)
    assert pyramid_kernels(1.0, 0.0).Kx == pytest.approx(0.87969560237940835762, rel=1e-14)


def test_six_fold_symmetry():
    """A turn by 60 degrees leaves K1, turns the vector once and the deviator of the tensor twice."""
    z = points(4000, seed=1)
    turn = np.exp(1j * np.pi / 3)
    here, there = (pyramid_kernels(w.real, w.imag) for w in (z, turn * z))
    bound = 1e-13 * here.K1
    assert np.all(np.abs(there.K1 - here.K1) <= bound)
    assert np.all(np.abs(there.Kx + 1j * there.Ky - turn * (here.Kx + 1j * here.Ky)) <= bound)
    deviator, turned = (k.Kxx - k.Kyy + 2j * k.Kxy for k in (here, there))
    assert np.all(np.abs(turned - turn**2 * deviator) <= 2 * bound)


def test_parity():
    z = points(4000, seed=2)
    here = pyramid_kernels(z.real, z.imag)
    for (x, y), signs in (((z.real, -z.imag), (1, 1, -1, 1, -1)), ((-z.real, -z.imag), (1, 1, 1, -1, -1))):
        for value, sign, other in zip(here, signs, pyramid_kernels(x, y), strict=True):
            assert np.all(np.abs(value - sign * other) <= 1e-14 * here.K1)


def test_far_field_is_that_of_a_point_force():
    """K1 -> V/R (1 + 1/(16 R^2)), V = sqrt(3)/2, the next term being 9/(640 R^4)."""
    r = 10.0 ** np.arange(1, 6)
    k1 = pyramid_kernels(r * np.cos(0.3), r * np.sin(0.3)).K1
    expected = np.sqrt(0.75) / r * (1 + 1 / (16 * r**2))
    assert np.all(np.abs(k1 / expected - 1) <= 0.02 / r**4 + 1e-15)


def test_far_field_is_the_moment_series():
    """Exact coefficients to order 24: from R = 4 on the rest is below 1e-16 of K1."""
    lines = [line for line in SERIES.read_text().splitlines() if not line.startswith("#")]
    table: dict[str, list] = {"A": [], "B": [], "C": []}
    for row in csv.DictReader(lines):
        value = int(row["numerator"]) / int(row["denominator"])
        table[row["series"]].append((int(row["N"]), int(row["s"]), value))
    assert [len(table[name]) for name in "ABC"] == [35, 57, 5]
    rng = np.random.default_rng(4)
    r = 10 ** rng.uniform(np.log10(4), 5, 2000)
    angle = rng.uniform(0, 2 * np.pi, r.size)
    kernels = pyramid_kernels(r * np.cos(angle), r * np.sin(angle))
    volume = np.sqrt(0.75)
    k1 = sum(value * r**-n * np.cos(6 * s * angle) for n, s, value in table["A"])
    tensor = sum(value * r**-n * np.exp((2 - 6 * s) * 1j * angle) for n, s, value in table["B"])
    vector = sum(value * r**-n * np.exp(-(n + 1) * 1j * angle) for n, _, value in table["C"])
    expected = {
        "K1": k1,
        "Kxx": (k1 + tensor.real) / 2,
        "Kxy": tensor.imag / 2,
        "Kx": vector.real,
        "Ky": -vector.imag,
    }
    for name, value in expected.items():
        assert np.all(np.abs(getattr(kernels, name) - volume / r * value) <= 1e-14 * kernels.K1), name


def test_shapes_broadcast():
    kernels = pyramid_kernels(np.zeros((4, 1)), np.arange(3))
    assert [value.shape for value in kernels] == [(4, 3)] * 5
    assert kernels.Kxy.flags.c_contiguous
    assert pyramid_kernels([], []).K1.shape == (0,)


@pytest.mark.parametrize("poisson_ratio", [-0.5, 0.0, 0.3, 0.5])
def test_functions_are_displacements_of_six_triangles(poisson_ratio):
    """Table 8.1, by a route of its own: linear loads that are 1 at the apex of each triangle."""
    shear_modulus = 1.7
    z = points(300, seed=3)
    x, y = z.real, z.imag
    a = (1 - poisson_ratio) / (2 * np.pi * shear_modulus)
    b = (1 - 2 * poisson_ratio) / (4 * np.pi * shear_modulus)
    c = poisson_ratio / (2 * np.pi * shear_modulus)
    f = pyramid_functions(x, y, poisson_ratio)
    expected = {
        0: (a * f.G, c * f.H, b * f.F),
        1: (c * f.J, a * f.K, b * f.I),
        2: (-b * f.D, -b * f.E, a * f.C),
    }
    rim = np.exp(1j * np.pi / 3 * np.arange(7))
    for axis, components in expected.items():
        total = np.zeros((3, z.size))
        for first, second in itertools.pairwise(rim):
            triangle = [(0, 0), (first.real, first.imag), (second.real, second.imag)]
            traction = np.zeros((3, 3))
            traction[0, axis] = 1.0
            total += linear_load_displacement(
                triangle, x, y, traction, shear_modulus=shear_modulus, poisson_ratio=poisson_ratio
            )
        assert np.all(np.abs(total - components) <= 1e-13 * a * f.C)


def test_peak_of_the_tangential_function():
    """Corrected Table 8.2: G(0; nu)/G(0; 0) = 1 + nu_0/2 with nu_0 = nu/(1-nu)."""
    for nu, ratio in ((0.0, 1.0), (0.27, 1.184932), (0.32, 1.235294)):
        peak = pyramid_functions(0.0, 0.0, nu).G / pyramid_functions(0.0, 0.0, 0.0).G
        assert peak == pytest.approx(ratio, abs=5e-7)


def test_table_8_1_shares_functions():
    f = pyramid_functions(0.3, 0.2, 0.3)
    assert isinstance(f, PyramidFunctions)
    assert (f.F, f.I, f.J) == (f.D, f.E, f.H)


def test_lazy_module():
    assert hexcontact.influence.pyramid_kernels is pyramid_kernels


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        (np.nan, 0.0, "field points.*finite"),
        ([0.0, -np.inf], 0.0, "field points.*finite"),
        ([1.0, 2.0], [1.0, 2.0, 3.0], "x and y.*broadcast"),
        ("a", 0.0, "x: an array of real numbers"),
    ],
)
def test_wrong_points(x, y, words):
    with pytest.raises(DeckError, match=words):
        pyramid_kernels(x, y)
    with pytest.raises(DeckError, match=words):
        pyramid_functions(x, y, 0.3)


@pytest.mark.parametrize("poisson_ratio", [-1.0, 0.51, np.nan, "steel"])
def test_wrong_poisson_ratio(poisson_ratio):
    with pytest.raises(DeckError, match="poisson_ratio"):
        pyramid_functions(0.0, 0.0, poisson_ratio)
