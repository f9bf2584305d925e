"""Size and shape of zones: on made-up zones whose answer is known."""

import numpy as np
import pytest

from hexcontact import analytic
from hexcontact.core import flat

HEIGHT = np.sqrt(0.75)


def lattice(half: int, spacing: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    row, col = np.mgrid[-half : half + 1, -2 * half : 2 * half + 1]
    return spacing * (col + 0.5 * row), spacing * HEIGHT * row


def test_boundary_of_a_hexagon() -> None:
    row, col = np.mgrid[-6:7, -6:7]
    distance = np.maximum(np.maximum(abs(row), abs(col)), abs(row + col))  # steps on the lattice
    zone = distance <= 3
    assert (flat.boundary(zone) == (distance == 3)).all()
    assert zone.sum() == 37
    assert flat.boundary(zone).sum() == 18


def test_boundary_at_the_rim_of_the_window() -> None:
    zone = np.ones((4, 5), dtype=bool)
    inside = np.zeros_like(zone)
    inside[1:-1, 1:-1] = True
    assert (flat.boundary(zone) == ~inside).all()
    assert not flat.boundary(np.zeros((4, 5), dtype=bool)).any()


def test_boundary_circle_of_a_ring_of_six() -> None:
    x, y = lattice(4, 0.5)
    zone = np.hypot(x, y) < 0.6  # a node and its six neighbors
    fit = flat.boundary_circle(x, y, zone, 0.5)
    assert (fit.count, fit.radius) == (6, pytest.approx(0.75))
    assert fit.mean_deviation == pytest.approx(0.0, abs=1e-15)
    # from a point off the center the radii spread: 0.5 +- 0.1 along x, in between else
    off = flat.boundary_circle(x, y, zone, 0.5, center=(0.1, 0.0))
    radii = 0.25 + np.hypot(
        0.5 * np.cos(np.pi / 3 * np.arange(6)) - 0.1, 0.5 * np.sin(np.pi / 3 * np.arange(6))
    )
    assert off.radius == pytest.approx(radii.mean())
    assert off.mean_deviation == pytest.approx(np.abs(radii / radii.mean() - 1).mean())
    assert off.standard_deviation == pytest.approx(radii.std() / radii.mean())


def test_area_radius() -> None:
    x, y = lattice(60)
    zone = np.hypot(x, y) < 40
    assert flat.area_radius(zone, HEIGHT) == pytest.approx(40.0, rel=2e-3)
    assert flat.area_radius(~zone & zone, HEIGHT) == 0.0


@pytest.mark.parametrize("center", [(0.0, 0.0), (0.3, -0.4)])
def test_edge_radius_of_the_exact_pressure(center: tuple[float, float]) -> None:
    x, y = lattice(20)
    hertz = analytic.hertz_sphere(1.0, 1.0, contact_radius=11.37)
    pressure = hertz.pressure(np.hypot(x - center[0], y - center[1]))
    # p^2 of Hertz is exactly linear in r^2
    radius = flat.edge_radius(x, y, pressure, 1.0, np.sqrt(0.75), center)
    assert radius == pytest.approx(11.37, rel=1e-12)


def test_edge_radius_of_too_few_nodes() -> None:
    x, y = lattice(5)
    few = np.where(np.hypot(x, y) < 0.5, 1.0, 0.0)
    assert np.isnan(flat.edge_radius(x, y, few, 1.0, np.sqrt(0.75)))
    assert np.isnan(flat.edge_radius(x, y, np.zeros_like(x), 1.0, np.sqrt(0.75)))


@pytest.mark.parametrize("angle", [-80, -20, 0, 35, 90])
def test_ellipses(angle: int) -> None:
    x, y = lattice(45)
    turn = np.radians(angle)
    x0, y0 = 0.2, -0.3
    along, across = (
        (x - x0) * np.cos(turn) + (y - y0) * np.sin(turn),
        (y - y0) * np.cos(turn) - (x - x0) * np.sin(turn),
    )
    inside = 1 - (along / 31.4) ** 2 - (across / 12.3) ** 2
    pressure = 5.0 * np.sqrt(np.maximum(inside, 0.0))
    edge = flat.edge_ellipse(x, y, pressure, 1.0)
    assert edge.semi_major == pytest.approx(31.4, rel=1e-9)
    assert edge.semi_minor == pytest.approx(12.3, rel=1e-9)
    assert (edge.x, edge.y) == pytest.approx((x0, y0), abs=1e-8)
    moments = flat.moment_ellipse(x, y, inside > 0)
    assert moments.semi_major == pytest.approx(31.4, rel=0.01)
    assert moments.semi_minor == pytest.approx(12.3, rel=0.01)
    for found in (edge, moments):
        apart = (found.angle - turn + np.pi / 2) % np.pi - np.pi / 2
        assert apart == pytest.approx(0.0, abs=1e-8 if found is edge else 5e-3)
        assert -np.pi / 2 < found.angle <= np.pi / 2


def test_no_ellipse() -> None:
    x, y = lattice(20)
    with pytest.raises(ValueError, match="too few nodes"):
        flat.edge_ellipse(x, y, np.where(np.hypot(x, y) < 1.5, 1.0, 0.0), 1.0)
    saddle = np.where(np.hypot(x, y) < 12, np.sqrt(np.maximum(1 + (x / 12) ** 2 - (y / 13) ** 2, 0)), 0.0)
    with pytest.raises(ValueError, match="does not vanish on an ellipse"):
        flat.edge_ellipse(x, y, saddle, 1.0)


def test_pressure_center() -> None:
    x, y = lattice(12, 0.5)
    around_node = np.maximum(4 - ((x - 0.75) ** 2 + (y - 0.5 * HEIGHT) ** 2), 0.0)  # symmetric about a node
    assert flat.pressure_center(x, y, around_node) == pytest.approx((0.75, 0.5 * HEIGHT), abs=1e-14)
    two = np.where(np.hypot(x, y) < 0.1, 1.0, np.where(np.hypot(x - 4.0, y) < 0.1, 3.0, 0.0))
    assert flat.pressure_center(x, y, two) == pytest.approx((3.0, 0.0), abs=1e-14)
    assert np.isnan(flat.pressure_center(x, y, np.zeros_like(x))).all()
