"""Checks: stress below the surface, of Hertz and of the sliding sphere."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hexcontact import Case, analytic, influence
from hexcontact.arrays import Array
from hexcontact.core.friction import FrictionLaw
from hexcontact.interior import fields
from hexcontact.interior.stress import SOURCES, Loaded, _edges, nodal_tractions
from hexcontact.surfaces import Sphere

from .reference import Comparison

_TABLES = Path(__file__).parents[1] / "reference"
_BODY = {"young_modulus": 210e9, "poisson_ratio": 0.3}
_RADIUS, _NODES = 1e-3, 40


def _rows(name: str) -> list[list[str]]:
    lines = (_TABLES / name).read_text(encoding="utf-8").splitlines()
    return list(csv.reader(line for line in lines if not line.startswith("#")))[1:]


def errors(sources: tuple[str, ...] = SOURCES) -> Iterator[tuple[str, Array, float, dict[str, float]]]:
    """Yield case, point over a, friction, and the largest error of the six stresses over p_0 by source."""
    exact = analytic.hertz_sphere(210e9 / (2 * (1 - 0.3**2)), 0.02, contact_radius=_RADIUS)
    case = Case(
        body_1={**_BODY, "surface": Sphere(radius=0.02)},
        body_2=_BODY,
        spacing=_RADIUS / _NODES,
        normal_load=exact.normal_load,
        tolerance=1e-11,
    )
    last: list = []
    case.run(on_step=last.append)
    step = last[-1]
    rows = [row for row in _rows("hertz_stress.csv") if not row[0].startswith("max shear")]
    values = np.array([[float(v) for v in row[1:12]] for row in rows])
    found = {}
    for source in sources:
        pressure = (
            Loaded(step.lattice, [step.fields], step.bodies, 1).tractions(source)[0][0, 0]
            / exact.max_pressure
        )
        loads = np.array([[pressure, 0 * pressure, 0 * pressure], [0 * pressure, pressure, 0 * pressure]])
        points = values[:, :3] * _RADIUS
        _, (normal, shear) = fields.at_points(step.lattice, loads, 1, 0.3, points)
        if source == "edges":
            pressed, sheared = roots(step, loads[0, 0], exact.max_pressure, points)
            normal, shear = normal + pressed, shear + sheared
        found[source] = abs(normal + values[:, 4:5] * shear - values[:, 5:]).max(axis=1)
    for k, row in enumerate(rows):
        yield row[0], values[k, :3], values[k, 4], {source: float(found[source][k]) for source in sources}


def roots(step: Any, hats: Array, scale: float, points: Array, body: int = 1) -> tuple[Array, Array]:
    """Return what hats of pressure/scale miss of its stress, and of that of a shear traction q_x = p."""
    [nodal] = nodal_tractions([step.fields]) / scale
    zero, none = np.zeros_like(hats), np.zeros(hats.shape, dtype=bool)
    edges = _edges(step.lattice, nodal, step.fields)
    both, pressed = (
        edges.stress(
            *(np.array([mu * nodal[0], zero]), none, FrictionLaw(mu)),
            *(np.array([hats, mu * hats, zero]), body, 0.3, points),
        )[0]
        for mu in (1.0, 0.0)
    )
    return pressed, both - pressed


def closed_forms() -> Comparison:
    """Hertz on and off the axis and the sliding sphere, and the influence functions."""
    table = Comparison()
    worst: dict[tuple[float, str, str], float] = {}
    for _, point, mu, by_source in errors():
        away = math.hypot(math.hypot(point[0], point[1]) - 1.0, point[2])
        where = "at most a spacing deep" if point[2] < 1 / _NODES else "a spacing deep and more"
        where += ", within 0.06 a of the edge" if away < 0.06 else ""
        for source, error in by_source.items():
            key = (mu, where, source)
            worst[key] = max(worst.get(key, 0.0), error)
    for (mu, where, source), error in sorted(worst.items()):
        load = f"μ = {mu:g}" if mu else "Hertz"
        judged = source == "edges" and where.startswith("a spacing deep and more")
        bound = {"absolute": 1e-4} if judged else {}
        table.add(f"{load}, {source}", f"largest error/p_0, {where}", "-", error, analytic=0.0, **bound)
    return table


def waves() -> Comparison:
    """A wave pressed flat and sheared, 64 nodes on it: Johnson, section 13.2."""
    table, length, height = Comparison(), 1e-3, 1e-6
    peak = math.pi * 210e9 / (2 * (1 - 0.3**2)) * height / length
    surface = {"shape": "formula", "expression": f"{height}*(1 - cos(2*pi*x/{length}))"}
    case = Case(
        body_1={**_BODY, "surface": surface},
        body_2=_BODY,
        boundary="periodic",
        extent=[length, length],
        nodes_across=64,
        friction_coefficient=0.5,
        loads=[{"mean_pressure": 1.5 * peak}, {"mean_traction_x": 0.1 * peak}],
    )
    result, k, x = case.run(), 2 * math.pi / length, length * np.array([0.0, 0.11, 0.4])
    for depth in (0.0, 0.002, 0.02, 0.1, 0.3, 2.0):
        z = depth * length
        found = result.stress(points=np.stack([x, 0 * x, 0 * x + z], axis=-1))
        even, odd = (peak * math.exp(-k * z) * wave(k * x) for wave in (np.cos, np.sin))
        known = {
            "stress_zz": -1.5 * peak - (1 + k * z) * even,
            "stress_xx": -(1 - k * z) * even,
            "stress_yy": -0.6 * even,
            "stress_xz": -0.1 * peak - k * z * odd,
        }
        error = max(float(abs(found[name].values - values).max()) for name, values in known.items())
        table.add(f"z/λ = {depth:g}", "largest error/p*", "-", error / peak, analytic=0.0, absolute=1e-3)
    return table


def influence_functions() -> Comparison:
    """Pyramids against values of 20 digits."""
    table = Comparison()
    worst = {"displacement": 0.0, "stress": 0.0}
    for row in _rows("pyramid_stress.csv"):
        kind, i, j = row[1], row[2], row[3]
        x, y = float(row[4]), float(row[5])
        if kind in ("lattice", "half"):
            x, y = float(i) + 0.5 * float(j), math.sqrt(0.75) * float(j)
        z, nu = float(row[6]), float(row[7])
        known = np.array([float(v) for v in row[8:]]).reshape(3, 9)
        far = max(1.0, math.sqrt(x * x + y * y + z * z))
        moved = abs(influence.pyramid_displacement(x, y, z, nu) - known[:, :3]).max() * 4 * math.pi * far
        stress = abs(influence.pyramid_stress(x, y, z, nu) - known[:, 3:]).max() * 2 * math.pi * far**2
        worst["displacement"] = max(worst["displacement"], float(moved))
        worst["stress"] = max(worst["stress"], float(stress))
    for name, error in worst.items():
        table.add(
            "188 pyramids", f"largest error of {name}/envelope", "-", error, analytic=0.0, absolute=1e-12
        )
    return table


_PROFILES: dict[str, dict] = {
    "sphere": {"shape": "sphere", "radius": 0.02},
    "ellipse, 1.6:1": {"shape": "paraboloid", "radius_x": 0.02, "radius_y": 0.04},
    "cone": {"shape": "cone", "slope": 0.03},
    "profile r⁴": {"shape": "power", "exponent": 4.0, "coefficient": 1.5e7},
    "rounded punch": {"shape": "rounded_punch", "flat_radius": 0.5e-3, "edge_radius": 0.01},
}
_ALUMINUM = {"young_modulus": 70e9, "poisson_ratio": 0.33}
_DEPTHS, _FINER, _ANGLES = (1, 2, 4), 3, 24


def _solved(surface: dict, body_2: dict, spacing: float | None, friction: dict) -> Any:
    case = Case(
        body_1={**_BODY, "surface": surface},
        body_2=body_2,
        tolerance=1e-10,
        **({"nodes_in_radius": 30} if spacing is None else {"spacing": spacing}),
        **friction,
    )
    last: list = []
    case.run(on_step=last.append)
    return last[-1]


def below_edges() -> Iterator[tuple[str, dict[str, Array]]]:
    """Yield profile and, by source, largest errors below the edge over the largest pressure, by depth.

    Points are 1, 2 and 4 spacings below 24 points of the edge at 30 spacings in the radius; what is right is
    the stress of a lattice three times as fine.
    """
    normal = {"loads": [{"normal_load": 1000.0}]}
    slid = {
        "friction_coefficient": 0.3,
        "loads": [*normal["loads"], {"tangential_load_x": 180.0}],
    }
    given = [(name, surface, _BODY, normal) for name, surface in _PROFILES.items()]
    given.append(("steel on aluminum, sheared", _PROFILES["sphere"], _ALUMINUM, slid))
    for name, surface, body_2, loads in given:
        coarse = _solved(surface, body_2, None, loads)
        h = coarse.lattice.spacing
        fine = _solved(surface, body_2, h / _FINER, loads)
        pieces = _edges(fine.lattice, nodal_tractions([fine.fields])[0], fine.fields).edge().segments
        turned = np.arctan2(pieces[:, 0, 1], pieces[:, 0, 0])
        places = pieces[[abs(turned - angle).argmin() for angle in np.linspace(-3, 3, _ANGLES)], 0]
        points = np.array([[(x, y, k * h) for x, y in places] for k in _DEPTHS])
        tensor = [f"stress_{ab}" for ab in fields.COMPONENTS]
        exact = fine.stress_at(points, *tensor).to_array()
        largest = float(fine.fields["pressure"].max())
        found = {source: coarse.stress_at(points, *tensor, source=source).to_array() for source in SOURCES}
        yield (
            name,
            {
                source: (abs(some - exact).max(["variable", "point_1"]) / largest).values
                for source, some in found.items()
            },
        )


def main() -> None:
    """Print the tables of docs/stress.md."""
    print("| where, over $a$ | $\\mu$ | edges | nodes |\n|---|---|---|---|")
    for _, point, mu, error in errors():
        if max(error.values()) > 1e-4 and mu in (0.0, 0.25, 0.5):
            place = ", ".join(f"{v:g}" for v in point)
            print(f"| $({place})$ | {mu:g} | {error['edges']:.1e} | {error['nodes']:.1e} |")
    print("\n| below the edge of | edges: 1, 2, 4 spacings | nodes: 1, 2, 4 spacings |\n|---|---|---|")
    for name, by_source in below_edges():
        words = (", ".join(f"{1e4 * v:.2g}" for v in by_source[source]) for source in ("edges", "nodes"))
        print(f"| {name} | {' | '.join(words)} |")


if __name__ == "__main__":
    main()
