"""Formulas of the dissertation as printed, with the corrections of docs/theory/corrections.md, and its page.

Each is evaluated as it stands there and compared with the library, which computes it in another way.
"""

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from validation.checks import CHECKS

from hexcontact.analytic.friction import MindlinContact
from hexcontact.analytic.frictionless import hertz_sphere
from hexcontact.core.contact import ElasticPair
from hexcontact.influence import pyramid_displacement, pyramid_functions, triangle_integral
from hexcontact.plotting.registry import entries

ROOT = Path(__file__).parents[2]
NU, G = 0.3, 1.0
RANDOM = np.random.default_rng(41)


# ------------------------------------------------------------------------------- chapter 3


def test_point_loads_below_the_surface() -> None:
    """(3.10)-(3.12) and (3.16)-(3.18): what a pyramid of one spacing does from 100 spacings away."""
    x, y, z = 60.0, -30.0, 80.0
    rho = math.sqrt(x * x + y * y + z * z)  # (3.9) with z, which is missing in print
    b = 1 - 2 * NU
    normal = (
        x * z / rho**3 - b * x / (rho * (rho + z)),
        y * z / rho**3 - b * y / (rho * (rho + z)),
        z * z / rho**3 + 2 * (1 - NU) / rho,
    )
    shear = (
        1 / rho + x * x / rho**3 + b * (1 / (rho + z) - x * x / (rho * (rho + z) ** 2)),
        x * y / rho**3 - b * x * y / (rho * (rho + z) ** 2),
        x * z / rho**3 + b * x / (rho * (rho + z)),
    )
    force = math.sqrt(0.75)  # volume of the unit pyramid
    found = pyramid_displacement(x, y, z, NU) / G
    for load, expected in enumerate((normal, shear)):
        moved = force / (4 * math.pi * G) * np.array(expected)
        assert found[load] == pytest.approx(moved, rel=2e-4)


# ------------------------------------------------------------------------------- chapter 4

Primitive = Callable[[float, float, float], float]
sin, cos = math.sin, math.cos


def ln(value: float) -> float:
    return math.log(abs(value))


def half(f: float) -> float:
    return ln(math.tan(f / 2))


def cot(f: float) -> float:
    return cos(f) / sin(f)


# n, delta, phi; asinh(cot phi) of (4.29), (4.41) is -ln|tan(phi/2)|
PRINTED: dict[tuple[int, int, int], Primitive] = {
    (1, 0, 0): lambda n, d, f: n * half(f),
    (1, 0, 1): lambda n, d, f: n**2 / 2 * (sin(d) / sin(f) + cos(d) * half(f)),
    (1, 1, 0): lambda n, d, f: -(n**2) / 2 * (-cos(d) / sin(f) + sin(d) * half(f)),
    (1, 1, 1): lambda n, d, f: (
        n**3
        / 6
        * (
            -sin(2 * d) / 2 * (cos(f) / sin(f) ** 2 - half(f))
            - 2 * sin(2 * d) * half(f)
            + 2 * cos(2 * d) / sin(f)
        )
    ),
    (2, 0, 1): lambda n, d, f: -n * (sin(d) * ln(sin(f)) - f * cos(d)),
    (2, 0, 2): lambda n, d, f: (
        n**2 / 4 * (-(1 - cos(2 * d)) * cot(f) + 2 * f * cos(2 * d) - 2 * sin(2 * d) * ln(sin(f)))
    ),
    (2, 1, 0): lambda n, d, f: -n * (cos(d) * ln(sin(f)) + f * sin(d)),
    (2, 1, 1): lambda n, d, f: (
        -(n**2) / 4 * (sin(2 * d) * cot(f) + 2 * f * sin(2 * d) + 2 * cos(2 * d) * ln(sin(f)))
    ),
    (2, 1, 2): lambda n, d, f: (
        -(n**3)
        / 12
        * (
            (cos(d) - cos(3 * d)) / (-2 * sin(f) ** 2)
            - (-3 * sin(3 * d) + sin(d)) * cot(f)
            + 4 * cos(3 * d) * ln(sin(f))
            + 4 * f * sin(3 * d)
        )
    ),
    (2, 2, 1): lambda n, d, f: (
        -(n**3)
        / 12
        * (
            (sin(3 * d) + sin(d)) / (-2 * sin(f) ** 2)
            + (3 * cos(3 * d) + cos(d)) * cot(f)
            - 4 * sin(3 * d) * ln(sin(f))
            + 4 * f * cos(3 * d)
        )
    ),
    (3, 1, 1): lambda n, d, f: (
        n / 2 * (sin(2 * d) * half(f) + 2 * sin(2 * d) * cos(f) - 2 * cos(2 * d) * sin(f))
    ),
    (3, 1, 2): lambda n, d, f: (
        -(n**2)
        / 8
        * (
            (cos(3 * d) - cos(d)) / sin(f)
            + (sin(d) - 3 * sin(3 * d)) * half(f)
            + 4 * cos(3 * d) * sin(f)
            - 4 * sin(3 * d) * cos(f)
        )
    ),
    (3, 2, 0): lambda n, d, f: (
        n / 2 * ((cos(2 * d) + 1) * half(f) + 2 * cos(2 * d) * cos(f) + 2 * sin(2 * d) * sin(f))
    ),
    (3, 2, 1): lambda n, d, f: (
        n**2
        / 8
        * (
            (sin(3 * d) + sin(d)) / sin(f)
            + (3 * cos(3 * d) + cos(d)) * half(f)
            + 4 * sin(3 * d) * sin(f)
            + 4 * cos(3 * d) * cos(f)
        )
    ),
    (3, 3, 0): lambda n, d, f: (
        -(n**2)
        / 8
        * (
            -(3 * cos(d) + cos(3 * d)) / sin(f)
            + (3 * sin(d) + 3 * sin(3 * d)) * half(f)
            - 4 * cos(3 * d) * sin(f)
            + 4 * sin(3 * d) * cos(f)
        )
    ),
    (3, 3, 1): lambda n, d, f: (
        n**3
        / 12
        * (
            -0.5 * (sin(2 * d) + 0.5 * sin(4 * d)) * (cos(f) / sin(f) ** 2 - half(f))
            - (2 * sin(2 * d) + 4 * sin(4 * d)) * half(f)
            + (2 * cos(2 * d) + 2 * cos(4 * d)) / sin(f)
            - 4 * sin(4 * d) * cos(f)
            + 4 * cos(4 * d) * sin(f)
        )
    ),
    (3, 2, 2): lambda n, d, f: n**3 / 3 * (half(f) + cos(f)),
}


def printed(exponents: tuple[int, int, int], corners: np.ndarray, point: np.ndarray) -> float:
    """Sum a primitive over the three sub-triangles (4.7), with angles in (0, pi) seen from inside."""
    total = 0.0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge = (end - start) / np.hypot(*(end - start))
        n = float((start - point) @ (edge[1], -edge[0]))
        delta = math.atan2(edge[1], edge[0])
        first, last = (math.atan2(n, float((corner - point) @ edge)) for corner in (start, end))
        total += PRINTED[exponents](n, delta, first) - PRINTED[exponents](n, delta, last)
    return total


@pytest.mark.parametrize("exponents", [key for key in PRINTED if key != (3, 2, 2)])
def test_closed_forms_of_chapter_4_inside_a_triangle(exponents: tuple[int, int, int]) -> None:
    """(4.26)-(4.41) at random points inside random triangles."""
    for _ in range(10):
        corners = RANDOM.uniform(-1.0, 1.0, (3, 2))
        corners = corners if np.linalg.det(corners[1:] - corners[0]) > 0 else corners[::-1]
        point = RANDOM.dirichlet((2.0, 2.0, 2.0)) @ corners
        exact = float(triangle_integral(corners, *point, *exponents))
        assert printed(exponents, corners, point) == pytest.approx(exact, abs=1e-11)


def test_printed_322_holds_for_no_equilateral_triangle() -> None:
    corners = np.array([[0.0, 0.0], [0.5, math.sqrt(0.75)], [-0.5, math.sqrt(0.75)]])
    point = np.array([0.0, 0.55])
    assert float(triangle_integral(corners, *point, 3, 2, 2)) == pytest.approx(0.015443, abs=1e-6)
    assert printed((3, 2, 2), corners, point) == pytest.approx(0.021681, abs=1e-6)


# ------------------------------------------------------------------------------- chapter 5

HEIGHT = math.sqrt(0.75)  # b of Figure 5.2 for the side 1


def test_rotated_coordinates_are_integers() -> None:
    """(5.8), whose entry (1, 2) is +2S/sqrt(3), and Table 5.1."""
    table = ([1, 0, 0, 1], [1, 1, -1, 0], [0, 1, -1, -1], [-1, 0, 0, -1], [-1, -1, 1, 0], [0, -1, 1, 1])
    basis = np.array([[1.0, 0.5], [0.0, HEIGHT]])
    for n, entries_of_table in enumerate(table):
        c, s = cos(n * math.pi / 3), sin(n * math.pi / 3)
        turned = np.linalg.inv(basis) @ [[c, s], [-s, c]] @ basis
        root = math.sqrt(3)
        by_formula = [[c + s / root, 2 * s / root], [-2 * s / root, c - s / root]]
        assert turned == pytest.approx(np.array(by_formula), abs=1e-14)
        assert turned == pytest.approx(np.reshape(entries_of_table, (2, 2)), abs=1e-14)


def element(number: int, x: float, y: float) -> Callable[..., float]:
    """Return I_S of tetrahedral element 1, 2 or 6 of Figure 5.5 as a function of the exponents."""
    turn = {1: 0.0, 2: math.pi / 3, 6: -math.pi / 3}[number]
    start = math.pi / 3 + turn
    corners = [(0.0, 0.0), *((cos(a), sin(a)) for a in (start, start + math.pi / 3))]
    return lambda j, k, m: float(triangle_integral(corners, x, y, j, k, m))


POINTS = [(0.3, 0.2), (0.1, 0.05), (1.3, 0.4), (-0.7, -1.9), (0.0, 0.0), (2.0, 0.0)]


@pytest.mark.parametrize(("x", "y"), POINTS)
def test_normal_pyramid_from_one_element(x: float, y: float) -> None:
    """(5.11)-(5.13) of one element, turned and added by (5.22), (5.23), are C, D, E of Table 8.1."""
    a, b = (1 - NU) / (2 * math.pi * G), (1 - 2 * NU) / (4 * math.pi * G)
    total = np.zeros(3)
    for n in range(6):
        c, s = cos(n * math.pi / 3), sin(n * math.pi / 3)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        u, v = turn[:2, :2] @ (x, y)
        i = element(1, u, v)
        one = [
            -b * ((1 - v / HEIGHT) * i(2, 1, 0) + i(2, 1, 1) / HEIGHT),
            -b * ((1 - v / HEIGHT) * i(2, 0, 1) + i(2, 0, 2) / HEIGHT),
            a * ((1 - v / HEIGHT) * i(1, 0, 0) + i(1, 0, 1) / HEIGHT),
        ]
        total += turn.T @ one
    known = pyramid_functions(x, y, NU)
    assert total == pytest.approx([-b * float(known.D), -b * float(known.E), a * float(known.C)], abs=1e-12)


def _tangential_half(x: float, y: float) -> np.ndarray:
    """Add elements 1, 2, 6 by (5.25)-(5.34); (5.26) and (5.29) with nu in place of 1 - nu."""
    a, b, c = (1 - NU) / (2 * math.pi * G), (1 - 2 * NU) / (4 * math.pi * G), NU / (2 * math.pi * G)
    ratio, total = NU / (1 - NU), np.zeros(3)
    for number, constant, along_x, along_y in (
        (1, 1 - y / HEIGHT, 0.0, 1 / HEIGHT),
        (2, 1 + x - y / (2 * HEIGHT), -1.0, 1 / (2 * HEIGHT)),
        (6, 1 - x - y / (2 * HEIGHT), 1.0, 1 / (2 * HEIGHT)),
    ):
        i = element(number, x, y)
        area = math.sqrt(3) / 4
        total += [
            a
            * (
                constant * (i(1, 0, 0) + ratio * i(3, 2, 0))
                + along_x * (i(1, 1, 0) + ratio * i(3, 3, 0))
                + along_y * (i(1, 0, 1) + ratio * i(3, 2, 1))
            ),
            c * (constant * i(3, 1, 1) + along_x * i(3, 2, 1) + along_y * i(3, 1, 2)),
            b * (constant * i(2, 1, 0) + along_x * (area - i(2, 0, 2)) + along_y * i(2, 1, 1)),
        ]
    return total


@pytest.mark.parametrize(("x", "y"), POINTS)
def test_tangential_pyramid_from_three_elements(x: float, y: float) -> None:
    """(5.35)-(5.37): the half of elements 1, 2, 6 and its mirror image are F, G, H of Table 8.1."""
    total = _tangential_half(x, y) + np.array([1.0, -1.0, 1.0]) * _tangential_half(x, -y)
    a, b, c = (1 - NU) / (2 * math.pi * G), (1 - 2 * NU) / (4 * math.pi * G), NU / (2 * math.pi * G)
    known = pyramid_functions(x, y, NU)
    assert total == pytest.approx([a * float(known.G), c * float(known.H), b * float(known.F)], abs=1e-12)


# ------------------------------------------------------------------------------- chapters 7 to 13


def test_sums_of_overlapping_elements_are_integrals() -> None:
    """(7.2) and (7.4), for the section of a Hertz contact and the contact: pi/2 and 2 pi/3."""
    errors = []
    for n in (20, 80):
        x = np.arange(-n, n + 1) / n
        line = float(np.sqrt(1 - x**2).sum()) / n
        i, j = np.meshgrid(np.arange(-2 * n, 2 * n + 1), np.arange(-2 * n, 2 * n + 1))
        square = np.maximum(1 - ((i + j / 2) ** 2 + 0.75 * j**2) / n**2, 0.0)
        volume = float(np.sqrt(square).sum()) * math.sqrt(0.75) / n**2
        errors.append((abs(line - math.pi / 2), abs(volume - 2 * math.pi / 3)))
    assert errors[1] < (1e-3, 1e-3)
    assert all(fine < 0.2 * coarse for coarse, fine in zip(*errors, strict=True))  # n^(-3/2) at least


def test_compliances() -> None:
    """(8.20), (8.21), (8.25)-(8.27), (12.3), (12.4), and (13.1) with its factor 1/2, for section 9.2."""
    g1, g2, nu = 432e9 / 2.64, 72e9 / 2.64, 0.32
    pair = ElasticPair.from_materials(432e9, nu, 72e9, nu)
    lambda_1 = (1 - nu) / (2 * math.pi) * (1 / g1 + 1 / g2)
    lambda_2 = (1 - 2 * nu) / (4 * math.pi) * (1 / g1 - 1 / g2)
    lambda_5 = nu / (2 * math.pi) * (1 / g1 + 1 / g2)
    assert (pair.lambda_1, pair.lambda_2, pair.lambda_5) == pytest.approx((lambda_1, lambda_2, lambda_5))
    by_13_1 = 0.5 * ((1 - 2 * nu) / g1 - (1 - 2 * nu) / g2) / ((1 - nu) / g1 + (1 - nu) / g2)
    assert pair.beta == pytest.approx(by_13_1)
    assert abs(pair.beta) * 0.1 == pytest.approx(0.0189, abs=5e-5)  # printed: 0.017


@pytest.mark.parametrize(
    ("nu", "right", "wrong"), [(0.0, 1.0, 1.0), (0.27, 1.1849, 1.3775), (0.32, 1.2353, 1.3896)]
)
def test_table_8_2(nu: float, right: float, wrong: float) -> None:
    peak = float(pyramid_functions(0.0, 0.0, nu).G / pyramid_functions(0.0, 0.0, nu).C)
    assert peak == pytest.approx(right, abs=5e-5)
    assert (peak == pytest.approx(wrong, abs=5e-5)) == (nu == 0.0)


def test_cattaneo_and_mindlin_as_printed() -> None:
    """(13.2)-(13.7); (13.4) for two equal bodies, (13.6) for r <= c."""
    modulus, nu, mu, load, radius = 71.1e9, 0.0, 1.2, 1000.0, 0.05
    a = (2 * (1 - nu**2) / modulus * 0.75 * load * radius) ** (1 / 3)
    hertz = hertz_sphere(modulus / (2 * (1 - nu**2)), radius, normal_load=load)
    p0 = 3 * load / (2 * math.pi * a**2)
    assert (hertz.contact_radius, hertz.max_pressure) == pytest.approx((a, p0))
    q = 0.9 * mu * load
    assert q == pytest.approx(27 * 40.0)  # Tables 13.1 and 13.2 print 10800 N
    c = a * (1 - q / (mu * load)) ** (1 / 3)
    exact = MindlinContact(mu, load, a, 4.0)
    assert float(exact.stick_radius(q)) == pytest.approx(c)
    r = np.linspace(0.0, a, 50)
    inner = np.where(r <= c, c / a * np.sqrt(np.maximum(1 - (r / c) ** 2, 0.0)), 0.0)
    assert exact.traction(r, q) == pytest.approx(mu * p0 * (np.sqrt(1 - (r / a) ** 2) - inner))


# ------------------------------------------------------------------------------- the page

PAGE, ROWS = (ROOT / f"docs/dissertation.{ending}" for ending in ("md", "csv"))


def test_commands_of_the_page_are_there() -> None:
    """Decks, comparisons, pictures and tests that docs/dissertation.md and its rows name exist."""
    text = PAGE.read_text(encoding="utf-8") + ROWS.read_text(encoding="utf-8")
    decks = set(re.findall(r"cases/[\w/]+\.(?:toml|py)", text))
    assert len(decks) > 10
    assert [deck for deck in decks if not (ROOT / deck).is_file()] == []
    checks = set(re.findall(r"CHECKS=([a-z][\w.-]*)", text))
    assert len(checks) > 10
    assert checks <= set(CHECKS)
    assert set(re.findall(r"hexcontact plot (?:\S+\.nc )?--what ([\w-]+)", text)) <= set(entries())
    for file, name in re.findall(r"(tests/\w+/\w+\.(?:py|f90))(?:::(\w+))?", text):
        assert re.search(rf"\b(?:def|subroutine) {name}\b" if name else "", (ROOT / file).read_text()), name


def test_the_page_names_every_number() -> None:
    """Each table, figure and equation number of the dissertation stands in a row of the page."""
    text = ROWS.read_text(encoding="utf-8")
    named: set[str] = set()
    for first, last in re.findall(r"\((\d+\.\d+)(?:[ab])?\)(?:–\((\d+\.\d+)\))?", text):
        chapter, number = map(int, first.split("."))
        named |= {f"{chapter}.{k}" for k in range(number, int((last or first).split(".")[1]) + 1)}
    numbers = {2: 2, 3: 27, 4: 42, 5: 37, 7: 4, 8: 41, 9: 5, 11: 29, 12: 32, 13: 7}
    missing = [f"{c}.{k}" for c, n in numbers.items() for k in range(1, n + 1) if f"{c}.{k}" not in named]
    assert missing == []
    tables = ["4.1", "4.2", "5.1", "8.1", "8.2", "9.1", "9.2", "9.3", *(f"13.{k}" for k in range(1, 6))]
    figures = {3: 1, 4: 5, 5: 6, 7: 4, 8: 3, 9: 4, 11: 2, 12: 2, 13: 8}
    rows = text.splitlines()
    for word, wanted in (
        ("Table", tables),
        ("Figure", [f"{c}.{k}" for c, n in figures.items() for k in range(1, n + 1)]),
    ):
        for number in wanted:
            assert any(re.search(rf"{word} {re.escape(number)}\b", row) for row in rows), f"{word} {number}"
