"""Checks that solve frictionless contacts."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexcontact import analytic
from hexcontact.case import Case
from hexcontact.core import flat
from hexcontact.deck.surfaces import Cone, Cylinder, Paraboloid, Power, Punch, RoundedPunch, Sphere, Surface

from .reference import Comparison, reference

Array = NDArray[np.float64]

TOLERANCE = 1e-11  # of the solver, so that it does not blur the comparison with exact discrete solutions
RIGID: dict[str, Any] = {"rigid": True}
UNIT: dict[str, Any] = {"young_modulus": 1.0, "poisson_ratio": 0.0}  # E* = 1 Pa against a rigid body


@dataclass(frozen=True)
class Solved:
    """What the checks need of a solved case; SI."""

    x: Array
    y: Array
    pressure: Array
    spacing: float
    approach: float
    normal_load: float
    seconds: float

    @property
    def contact(self) -> NDArray[np.bool_]:
        """Nodes in contact."""
        return self.pressure > 0.0

    @property
    def peak(self) -> float:
        """p_max."""
        return float(self.pressure.max())

    @property
    def area_radius(self) -> float:
        """a_A."""
        return flat.area_radius(self.contact, math.sqrt(0.75) * self.spacing**2)

    @property
    def edge_radius(self) -> float:
        """A from p^2 at the edge, about x = y = 0."""
        cell = np.sqrt(0.75) * self.spacing**2
        return flat.edge_radius(self.x, self.y, self.pressure, self.spacing, cell)


def solve(body_1: Mapping[str, Any], body_2: Mapping[str, Any], **arguments: Any) -> Solved:
    """Solve a frictionless case with one load step; arguments as of `hexcontact.Case`."""
    started = time.perf_counter()
    case = Case(body_1=body_1, body_2=body_2, **{"tolerance": TOLERANCE, **arguments})
    last = case.run().dataset.isel(step=-1)
    return Solved(
        x=last["x"].values,
        y=last["y"].values,
        pressure=last["pressure"].values,
        spacing=case.lattice.spacing,
        approach=float(last["approach"]),
        normal_load=float(last["normal_load"]),
        seconds=time.perf_counter() - started,
    )


# ----------------------------------------------------------------------------------- spheres

E_STAR_9_1 = 107.70534e9  # what p0, a and approach of Table 9.1 imply, with P = 1000 N and R = 60 mm
MESHES_9_2 = {  # name in the reference table: nodes across, spacing
    "11x11 le=0.2 mm": (11, 0.2e-3),
    "21x21 le=0.1 mm": (21, 0.1e-3),
    "31x31 le=0.075 mm": (31, 0.075e-3),
    "31x31 le=0.06667 mm": (31, 2e-3 / 30),
    "41x41 le=0.05 mm": (41, 0.05e-3),
    "51x51 le=0.04 mm": (51, 0.04e-3),
}


def table_9_2(meshes: Sequence[str] = tuple(MESHES_9_2)) -> Comparison:
    """Two alike spheres on the meshes of Table 9.2, by both methods."""
    found = Comparison()
    hertz = analytic.hertz_sphere(E_STAR_9_1, 0.06, normal_load=1000.0)
    a = hertz.contact_radius
    found.add("Table 9.1", "p_0", "MPa", hertz.max_pressure, row=reference("9.1 Hertz", "p0"), relative=1e-7)
    found.add("Table 9.1", "a", "um", a, row=reference("9.1 Hertz", "a"), relative=1e-7)
    found.add(
        "Table 9.1", "approach", "um", hertz.approach, row=reference("9.1 Hertz", "delta"), relative=1e-7
    )
    # without friction nothing but E* matters of the materials
    body = {
        "young_modulus": 2.0 * (1.0 - 0.3**2) * E_STAR_9_1,
        "poisson_ratio": 0.3,
        "surface": Sphere(radius=0.12),
    }
    solve(body, body, spacing=2e-4, normal_load=1000.0)  # so that no import is timed
    for name in meshes:
        across, spacing = MESHES_9_2[name]
        direct, fft = (
            solve(body, body, spacing=spacing, window=(across, across), normal_load=1000.0, method=method)
            for method in ("direct", "fft")
        )
        case = f"9.1 Table 9.2 mesh {name}"
        for method, s in (("direct", direct), ("fft", fft)):
            where = f"{name}, {method}"
            found.add(where, "p_max", "MPa", s.peak, row=reference(case, "p_max"), relative=1e-6)
            found.add(where, "approach", "um", s.approach, row=reference(case, "delta"), relative=1e-6)
        apart = float(np.abs(direct.pressure - fft.pressure).max()) / fft.peak
        found.add(name, "max |p_direct - p_fft|/p_max", "-", apart, analytic=0.0, absolute=1e-8)
        fit = flat.boundary_circle(fft.x, fft.y, fft.contact, spacing)
        row = reference(case, "a by (9.1)-(9.2)")
        found.add(name, "a of (9.1)-(9.2)", "um", fit.radius, row=row, relative=1e-6)
        row = reference(case, "a area-equivalent")
        found.add(name, "a from the area", "um", fft.area_radius, row=row, relative=1e-6)
        found.add(name, "a from p² at the edge", "um", fft.edge_radius, analytic=a, absolute=0.2 * spacing)
        found.add(name, "E_a of (9.3)", "-", abs(fit.radius / a - 1.0))
        found.add(name, "σ of (9.4), over a", "-", fit.standard_deviation)
        for method, s in (("direct", direct), ("fft", fft)):
            found.add(name, f"time, {method}", "s", s.seconds)
    found.notes += [
        "Boundary nodes are those in contact with a neighbor that is not; r_i = |X_i| + l_e/2.",
        "a of (9.1)-(9.2): mean of r_i. E_a: its difference from Hertz's. σ: root of the mean of (r_i - a)².",
        "a from p²: zero of a straight line through p² over r² for a_A - 6 l_e <= r <= a_A - l_e.",
        "The reference tables hold no published E_a, σ and seconds: nothing stands beside ours.",
        "31x31: the text prints l_e = 0.75. Its p_max belongs to 0.075 mm, the usual window to 0.06667 mm.",
    ]
    return found


MESHES_CONVERGENCE = (5, 7, 10, 14, 20, 28, 40, 57, 80, 113, 160)


def convergence(meshes: Sequence[int] = MESHES_CONVERGENCE) -> Comparison:
    """Error of the sphere on finer and finer lattices, and the observed orders."""
    found = Comparison()
    hertz = analytic.hertz_sphere(1.0, 1.0, contact_radius=1.0)
    errors: dict[str, list[float]] = {}
    for mesh in meshes:
        ball = {**UNIT, "surface": Sphere(radius=1.0)}
        s = solve(RIGID, ball, spacing=1.0 / mesh, normal_load=hertz.normal_load, method="fft")
        exact = hertz.pressure(np.hypot(s.x, s.y))
        values = {
            "p_max/p0-1": s.peak / hertz.max_pressure - 1.0,
            "delta/delta0-1": s.approach / hertz.approach - 1.0,
            "relative L2 error of p": float(np.linalg.norm(s.pressure - exact) / np.linalg.norm(exact)),
            "a_A/a-1": s.area_radius - 1.0,
            "a_fit/a-1": s.edge_radius - 1.0,
        }
        for name, value in values.items():
            row = reference(f"9.1 convergence a/le={mesh}", name)
            # the table has seven digits; they come on top of its own uncertainty
            allowed = row.uncertainty + 1e-6 * abs(row.reference)
            found.add(f"a/l_e = {mesh}", name, "-", value, row=row, absolute=allowed)
            errors.setdefault(name, []).append(abs(value))
    for name, expected in {"p_max/p0-1": 2.0, "delta/delta0-1": 2.0, "relative L2 error of p": 1.0}.items():
        order = -float(np.polyfit(np.log(meshes), np.log(errors[name]), 1)[0])
        found.add("observed order", name, "-", order, analytic=expected, absolute=0.3)
    order = -float(np.polyfit(np.log(meshes), np.log(errors["a_fit/a-1"]), 1)[0])
    found.add("observed order", "a_fit/a-1", "-", order)
    found.notes.append(
        "E* = 1, R = 1, a = 1. The order is the slope of a least-squares line through the logarithms."
    )
    return found


# ----------------------------------------------------------------------------------- cylinders


def crossed_cylinders(angles: Sequence[int] = (90, 60, 45, 30)) -> Comparison:
    """Crossed cylinders of section 9.3 without friction against elliptic Hertz."""
    found = Comparison()
    steel, aluminium = (
        {"young_modulus": 200e9, "poisson_ratio": 0.30},
        {"young_modulus": 69e9, "poisson_ratio": 0.33},
    )
    e_star = 1.0 / ((1 - 0.30**2) / 200e9 + (1 - 0.33**2) / 69e9)
    for phi in angles:
        hertz = analytic.crossed_cylinders(e_star, 0.075, 0.05, math.radians(phi), normal_load=1e4)
        first = {**steel, "surface": Cylinder(radius=0.075, angle="0 deg")}
        second = {**aluminium, "surface": Cylinder(radius=0.05, angle=f"{phi} deg")}

        s = solve(first, second, spacing=0.225e-3, normal_load=1e4)
        where, case = f"{phi}°, l_e = 0.225 mm", f"9.3 phi={phi} mu=0 mesh le=0.225 mm"
        nodes = flat.moment_ellipse(s.x, s.y, s.contact)
        for letter, value in (("a", nodes.semi_major), ("b", nodes.semi_minor)):
            row = reference(case, f"{letter} (moment ellipse of contact nodes)")
            found.add(where, f"{letter}, moments of the nodes", "mm", value, row=row, relative=1e-6)
        error = ellipse_error(s.x, s.y, s.contact, s.spacing, nodes)
        found.add(where, "E_e of (9.5)", "-", error)

        s = solve(first, second, spacing=hertz.semi_minor / 24, normal_load=1e4)
        where, case = f"{phi}°, b/l_e = 24", f"9.3 phi={phi} mu=0"
        fit = flat.edge_ellipse(s.x, s.y, s.pressure, s.spacing)
        for quantity, name, unit, value, exact, allowed in (
            ("p_max", "p0", "MPa", s.peak, hertz.max_pressure, 2e-4),
            ("approach", "delta", "um", s.approach, hertz.approach, 2e-4),
            ("a from p² at the edge", "a", "mm", fit.semi_major, hertz.semi_major, 2e-3),
            ("b from p² at the edge", "b", "mm", fit.semi_minor, hertz.semi_minor, 2e-3),
        ):
            row = reference(case, name)
            found.add(
                where, quantity, unit, value, row=row, analytic=exact, judge="analytic", relative=allowed
            )
        row = reference(case, "theta (major axis from the axis of cylinder 1)")
        turn = (fit.angle - hertz.angle + math.pi / 2) % math.pi - math.pi / 2  # an axis has no sense
        found.add(where, "direction of a", "deg", hertz.angle + turn, row=row, absolute=math.radians(0.005))
    found.notes += [
        "R_1 = 75 mm, R_2 = 50 mm, P = 10 kN; direction of the major axis from the axis of cylinder 1.",
        "Assumed, as the text gives no moduli: steel (200 GPa, 0.30) on aluminium (69 GPa, 0.33).",
        "E_e: mean distance of the boundary nodes, moved out by l_e/2, from the ellipse, divided by b.",
    ]
    return found


def ellipse_error(
    x: Array, y: Array, zone: NDArray[np.bool_], spacing: float, ellipse: flat.Ellipse
) -> float:
    """E_e: mean distance from the ellipse of the boundary nodes, moved out by l_e/2, divided by b."""
    rim = flat.boundary(zone)
    x, y = x[rim] - ellipse.x, y[rim] - ellipse.y
    cosine, sine = math.cos(ellipse.angle), math.sin(ellipse.angle)
    u, v = (x * cosine + y * sine) / ellipse.semi_major, (y * cosine - x * sine) / ellipse.semi_minor
    way = np.hypot(u, v)  # 1 on the ellipse
    steepness = np.hypot(u / ellipse.semi_major, v / ellipse.semi_minor) / way
    return float(np.mean(np.abs((way - 1.0) / steepness + 0.5 * spacing)) / ellipse.semi_minor)


# ----------------------------------------------------------------------------------- other profiles

PROFILES: dict[str, tuple[Surface, analytic.AxisymmetricContact]] = {
    "power_r4": (Power(coefficient=1.0, exponent=4.0), analytic.power_law(1.0, 1.0, 4, contact_radius=1.0)),
    "power_r6": (Power(coefficient=1.0, exponent=6.0), analytic.power_law(1.0, 1.0, 6, contact_radius=1.0)),
    "cone": (Cone(slope=1.0), analytic.cone(1.0, 1.0, contact_radius=1.0)),
    "rounded_flat": (
        RoundedPunch(flat_radius=0.6, edge_radius=1.0),
        analytic.rounded_punch(1.0, 0.6, 1.0, contact_radius=1.0),
    ),
}


def profiles() -> Comparison:
    """Cone, powers, rounded and flat punch with E* = 1, a = 1."""
    found = Comparison()
    for name, (surface, exact) in PROFILES.items():
        pressed = {**RIGID, "surface": surface}
        s = solve(pressed, UNIT, spacing=1.0 / 80, normal_load=exact.normal_load, method="fft")
        values = {"delta": (s.approach, exact.approach), "p_max": (s.peak, exact.max_pressure)}
        for quantity, (value, true) in values.items():
            if math.isfinite(true):
                row = reference(f"{name} (E*=1, a=1)", f"{quantity} at a/le=80")
                found.add(name, quantity, "-", value, row=row, analytic=true, relative=1e-6)
        _add_inside(found, name, s, exact)
    flat = {**RIGID, "surface": Punch(radius=1.0)}
    s = solve(flat, UNIT, spacing=1.0 / 80.25, approach=0.01, method="fft")
    found.add(
        "flat punch",
        "P/(2 E* a_A delta)",
        "-",
        s.normal_load / (0.02 * s.area_radius),
        analytic=1.0,
        relative=1e-3,
    )
    _add_inside(found, "flat punch", s, analytic.flat_punch(1.0, s.area_radius, approach=0.01))
    found.notes += [
        "E* = 1, a = 1, a/l_e = 80 (flat punch 80.25). h = r⁴, r⁶, r; rounded: flat 0.6, edge radius 1.",
        "The flat punch is as wide as its node set, a_A. Cone and flat punch have no finite p_max.",
    ]
    return found


def _add_inside(found: Comparison, name: str, solved: Solved, exact: analytic.AxisymmetricContact) -> None:
    """Compare the pressure away from center and edge, where some are singular; in units of the mean."""
    r = np.hypot(solved.x, solved.y)
    part = (r > 0.2 * exact.contact_radius) & (r < 0.8 * exact.contact_radius)
    mean = exact.normal_load / (math.pi * exact.contact_radius**2)
    error = float(np.abs(solved.pressure - exact.pressure(r))[part].max()) / mean
    found.add(name, "max error of p/p_mean, 0.2 < r/a < 0.8", "-", error, analytic=0.0, absolute=5e-3)


# ----------------------------------------------------------------------------------- controls


def control() -> Comparison:
    """Load control and approach control, direct and fft: one solution."""
    found = Comparison()
    hard, soft = (
        {"young_modulus": 432e9, "poisson_ratio": 0.32},
        {"young_modulus": 72e9, "poisson_ratio": 0.32},
    )
    surfaces: dict[str, tuple[Surface, float]] = {
        "sphere": (Sphere(radius=1e-3), 7e-6),
        "paraboloid": (Paraboloid(radius_x=1e-3, radius_y=2e-3, angle="20 deg"), 8e-6),
    }
    for name, (surface, spacing) in surfaces.items():
        body = {**hard, "surface": surface}
        judge = solve(body, soft, spacing=spacing, normal_load=31.5, method="direct")
        for method in ("direct", "fft"):
            for how, load in (
                ("by load", {"normal_load": 31.5}),
                ("by approach", {"approach": judge.approach}),
            ):
                s = solve(body, soft, spacing=spacing, method=method, **load)
                where = f"{name}, {method}, {how}"
                found.add(where, "P", "N", s.normal_load, analytic=31.5, relative=1e-9)
                found.add(where, "approach", "um", s.approach, analytic=judge.approach, relative=1e-9)
                apart = float(np.abs(s.pressure - judge.pressure).max()) / judge.peak
                found.add(where, "max difference of p/p_max", "-", apart, analytic=0.0, absolute=1e-8)
    found.notes.append(
        "The column analytic holds the direct solution under load control, which judges the others."
    )
    return found
