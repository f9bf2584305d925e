"""Checks of slender contacts, rollers, hollow and measured surfaces against Hertz and plane contact."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hexcontact import analytic
from hexcontact.case import Case
from hexcontact.deck.surfaces import Cylinder, Ellipsoid, Paraboloid, Roller, Sphere

from .reference import Comparison

STEEL: dict[str, Any] = {"young_modulus": 210e9, "poisson_ratio": 0.3}
E_STAR = 210e9 / (2 * (1 - 0.3**2))
TOLERANCE = 1e-10  # of the solver

FIFTY = 581.02  # ratio of the radii of curvature of an ellipse of 50:1
SPACINGS = 55  # in both half-axes


def _against(
    found: Comparison, where: str, case: Case, hertz: analytic.EllipticContact, allowed: float
) -> None:
    """Add pressure, approach and half-axes of the last step beside those of Hertz."""
    last = case.run().dataset.isel(step=-1)
    for name, unit, exact, error in (
        ("max_pressure", "MPa", hertz.max_pressure, allowed),
        ("approach", "um", hertz.approach, allowed),
        ("contact_semi_major", "um", hertz.semi_major, 2e-3),
        ("contact_semi_minor", "um", hertz.semi_minor, 2e-3),
    ):
        found.add(where, name, unit, float(last[name]), analytic=exact, relative=error)


def slender() -> Comparison:
    """Ellipses on rectangular cells as slender as they are."""
    found = Comparison()
    load = 50.0
    for ratio, angle in ((FIFTY, 0), (FIFTY, 20)):
        surface = Paraboloid(radius_x=0.01, radius_y=0.01 * ratio, angle=f"{angle} deg")
        hertz = analytic.hertz_ellipse(E_STAR, [[100.0, 0.0], [0.0, 100.0 / ratio]], normal_load=load)
        case = Case(
            body_1={**STEEL, "surface": surface},
            body_2=STEEL,
            lattice="rectangular",
            nodes_in_radius=SPACINGS,
            normal_load=load,
            tolerance=TOLERANCE,
        )
        where = f"{hertz.semi_major / hertz.semi_minor:.1f}:1, long axis at {90 + angle}°"
        found.add(where, "longer side", "nodes", max(case.lattice.shape), analytic=0, absolute=128)
        _against(found, where, case, hertz, 1e-4)
    for degrees in (5, 10):
        cylinders = (Cylinder(radius=0.01, angle=f"{angle} deg") for angle in (0, degrees))
        one, two = ({**STEEL, "surface": cylinder} for cylinder in cylinders)
        hertz = analytic.crossed_cylinders(E_STAR, 0.01, 0.01, math.radians(degrees), normal_load=20.0)
        case = Case(
            body_1=one,
            body_2=two,
            lattice="rectangular",
            nodes_in_radius=SPACINGS,
            normal_load=20.0,
            tolerance=TOLERANCE,
        )
        where = f"cylinders crossed at {degrees}°, {hertz.semi_major / hertz.semi_minor:.1f}:1"
        _against(found, where, case, hertz, 1e-4)
    found.notes.append(f"{SPACINGS} spacings in both half-axes. Half-axes: to the edge between the nodes.")
    return found


def rollers(half_widths: Sequence[float] = (15e-6, 20e-6)) -> Comparison:
    """Logarithmic rollers at their design loads beside the plane contact of the same load by length."""
    found = Comparison()
    for half_width in half_widths:
        _roller(found, half_width)
    found.notes.append(
        "Steel rollers of 5 mm radius at their design loads, cells of b/20 by b/20; P' load by length, p_0 "
        "of plane contact under P/l. Near its ends the contact is narrower than there, so that p rises more "
        "than P'. On cells of 4 to 0.5 µm along the axis at half-width 20 µm: P' 0.91 %, p 1.35 % at 0.95 "
        "l/2; p is within 1 % up to 0.938 l/2, and up to 0.95 l/2 for half-widths of at most l/120. With a "
        "third of the end constant 0.97 %, but 2.3 p_0 at the ends."
    )
    return found


def _roller(found: Comparison, half_width: float) -> None:
    """Add a roller of 2 mm under the load of a half-width."""
    length, radius, spacing = 2e-3, 5e-3, half_width / 20
    by_length = math.pi * E_STAR * half_width**2 / (4 * radius)
    peak = 2 * by_length / (math.pi * half_width)
    load = length * by_length
    surface = Roller(radius=radius, length=length, angle="90 deg", profile="logarithmic", design_load=load)
    case = Case(
        body_1={**STEEL, "surface": surface},
        body_2=STEEL,
        lattice="rectangular",
        spacing=(spacing, spacing),
        normal_load=load,
        tolerance=TOLERANCE,
    )
    last = case.run().dataset.isel(step=-1)
    x, y, p = (last[name].values for name in ("x", "y", "pressure"))
    at = y[:, 0] / (0.5 * length)
    carried = p.sum(axis=1) * spacing / by_length
    on_axis = p[:, np.abs(x[0]).argmin()] / peak
    where = f"2 mm long, half-width {half_width * 1e6:.0f} µm"
    for name, values, part, allowed in (
        ("P' l/P", carried, 0.95, 0.01),
        ("p(0, y)/p_0", on_axis, 0.9, 0.01),
        ("p(0, y)/p_0", on_axis, 0.95, 0.01 if half_width <= length / 120 else 0.02),
    ):
        uneven = float(np.abs(values - 1.0)[np.abs(at) < part].max())
        about = f"{name}, largest deviation from 1 for |y| < {part:g} l/2"
        found.add(where, about, "-", uneven, analytic=0.0, absolute=allowed)
    found.add(where, "p(0, 0)", "MPa", float(on_axis[len(at) // 2] * peak), analytic=peak, relative=2e-3)
    row = p[len(at) // 2]
    near = (row > 0) & (np.abs(x[0]) > 0.5 * half_width)
    slope, start = np.polyfit(x[0][near] ** 2, row[near] ** 2, 1)
    found.add(
        where, "half-width at y = 0", "um", math.sqrt(-start / slope), analytic=half_width, relative=3e-3
    )
    found.add(where, "max p/p_0, near the ends", "-", float(p.max() / peak))


def hollow() -> Comparison:
    """Balls in grooves and seats."""
    found = Comparison()
    for name, along, across in (
        ("groove, radius 1.04 of the ball's", -5.2e-3, 1e6),
        ("groove, radius 1.6 of the ball's", -8e-3, 1e6),
        ("ball in the race of a bearing", -5.2e-3, 20e-3),
        ("seat of 1.2 ball radii", -6e-3, -6e-3),
    ):
        ball = Sphere(radius=5e-3)
        hertz = analytic.hertz_ellipse(
            E_STAR, [[200.0 + 1 / along, 0.0], [0.0, 200.0 + 1 / across]], normal_load=50.0
        )
        case = Case(
            body_1={**STEEL, "surface": ball},
            body_2={**STEEL, "surface": Ellipsoid(radius_x=along, radius_y=across)},
            lattice="rectangular",
            nodes_in_radius=SPACINGS,
            normal_load=50.0,
            tolerance=TOLERANCE,
        )
        _against(found, name, case, hertz, 1e-4)
    found.notes.append(f"Steel ball of 5 mm under 50 N, {SPACINGS} spacings in both half-axes.")
    return found


def measured(points: Sequence[int] = (41, 161)) -> Comparison:
    """A ball whose heights are read from files."""
    found = Comparison()
    radius, load, half = 10e-3, 20.0, 0.4e-3
    hertz = analytic.hertz_sphere(E_STAR, radius, normal_load=load)
    case = Case(
        body_1={**STEEL, "surface": Sphere(radius=radius)},
        body_2=STEEL,
        nodes_in_radius=40,
        normal_load=load,
        tolerance=TOLERANCE,
    )
    formula = case.run().dataset.isel(step=-1)
    with tempfile.TemporaryDirectory() as folder:
        for count in points:
            at = np.linspace(-half, half, count)
            heights = -(at**2 + at[:, None] ** 2) / (2 * radius)  # upwards, m
            columns = np.stack([*np.meshgrid(at, at), heights], axis=-1).reshape(-1, 3)
            matrix, table, binary = (Path(folder, f"{count}.{end}") for end in ("csv", "xyz", "npy"))
            np.savetxt(matrix, heights * 1e9, delimiter=",", fmt="%.6f")
            np.savetxt(table, columns * 1e6, header="x [um], y [um], z [um]", delimiter=",", comments="")
            np.save(binary, heights)
            for file, keys in (
                (matrix, {"extent": ["0.8 mm", "0.8 mm"], "units": "mm", "height_units": "nm"}),
                (table, {}),
                (binary, {"spacing": [2 * half / (count - 1)] * 2, "units": "m", "height_units": "m"}),
            ):
                surface = {"shape": "map", "file": str(file), "upwards": True, **keys}
                same = case.changed({"body.1.surface": surface})
                last = same.run().dataset.isel(step=-1)
                where = f"{count} x {count} points, .{file.suffix[1:]}"
                for name, unit, exact in (
                    ("max_pressure", "MPa", hertz.max_pressure),
                    ("approach", "um", hertz.approach),
                    ("contact_radius_fit", "um", hertz.contact_radius),
                ):
                    found.add(where, name, unit, float(last[name]), analytic=exact, relative=1e-3)
                apart = float(abs(last["pressure"].values.max() / formula["pressure"].values.max() - 1.0))
                found.add(
                    where,
                    "max_pressure over that of the formula - 1",
                    "-",
                    apart,
                    analytic=0.0,
                    absolute=1e-4,
                )
    found.notes.append(
        "A ball of 10 mm as heights over 0.8 mm by 0.8 mm: a matrix in CSV, a table x, y, z with units, and "
        "npy; 40 spacings in the contact radius. A cubic spline joins the points, exact for a paraboloid."
    )
    return found
