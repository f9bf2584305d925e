"""Checks: crossed cylinders pressed with friction (section 9.3, Figure 9.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hexcontact import analytic
from hexcontact.core import flat
from hexcontact.deck.surfaces import Cylinder

from .normal import ellipse_error
from .reference import Comparison, reference
from .runs import DIGITS, Run, State, press, run

STEEL = {"young_modulus": 200e9, "poisson_ratio": 0.30}
ALUMINUM = {"young_modulus": 69e9, "poisson_ratio": 0.33}
LOAD = 1e4
E_STAR = 1.0 / ((1 - 0.30**2) / 200e9 + (1 - 0.33**2) / 69e9)


def _hertz(phi: int) -> analytic.EllipticContact:
    return analytic.crossed_cylinders(E_STAR, 0.075, 0.05, math.radians(phi), normal_load=LOAD)


def _pressed(phi: int, mu: float, spacing: float, steps: int) -> Run:
    """Press the cylinders; one step: the static solution."""
    return run(
        {**STEEL, "surface": Cylinder(radius=0.075, angle="0 deg")},
        {**ALUMINUM, "surface": Cylinder(radius=0.05, angle=f"{phi} deg")},
        spacing=spacing,
        friction_coefficient=mu,
        algorithm="static" if steps == 1 else "incremental",
        loads=[press(LOAD, steps)],
        every=steps,
    )


# Nodes in the minor semi-axis, load steps, and the angles for which the reference table has them.
MESHES = ((14, 1, (90, 60, 45, 30)), (14, 10, (90, 60, 45, 30)), (24, 12, (90, 30)))


def crossed_cylinders(
    meshes: Sequence[tuple[int, int, Sequence[int]]] = MESHES,
    coefficients: Sequence[float] = (0.25, 0.5),
    printed: Sequence[int] = (90, 60, 45, 30),
) -> Comparison:
    """Contact and stick ellipses of crossed cylinders."""
    found = Comparison()
    for mesh, steps, angles in meshes:
        for phi in angles:
            for mu in coefficients:
                last = _pressed(phi, mu, _hertz(phi).semi_minor / mesh, steps)[-1]
                _against_converged(found, last, phi, mu, mesh, steps)
    for phi in printed:
        for mu in coefficients:
            _on_printed_mesh(found, _pressed(phi, mu, 0.225e-3, 10)[-1], phi, mu)
    found.notes += [
        "R_1 = 75 mm, axis along x; R_2 = 50 mm, axis at φ; P = 10 kN.",
        "Assumed, as the text gives no moduli: steel (200 GPa, 0.30) on aluminium (69 GPa, 0.33).",
        "One step: static. Several: P_k = P (k/N)³. Contact: ellipse on which p vanishes; stick: that "
        "of the second moments of the sticking nodes. Directions, from the axis of cylinder 1, are judged "
        "by the eigenvectors of the tensor of curvature.",
        "E_e: mean distance of the boundary nodes, moved out by l_e/2, from the ellipse of moments, over b.",
    ]
    return found


def _against_converged(found: Comparison, last: State, phi: int, mu: float, mesh: int, steps: int) -> None:
    hertz = _hertz(phi)
    where = f"{phi}°, μ = {mu:g}, b/l_e = {mesh}, " + ("static" if steps == 1 else f"{steps} steps")
    how = "single step" if steps == 1 else f"incremental {steps} steps"
    case = f"9.3 phi={phi} mu={mu:g} {how} b/le={mesh}"
    edge = flat.edge_ellipse(last.x, last.y, last.pressure, last.spacing)
    stick = flat.moment_ellipse(last.x, last.y, last.stick)
    # p_max to all printed digits; the ellipse of p = 0 is fitted otherwise than for the table; four nodes
    # of some thousand may be between stick and slip
    nodes = 2.0 * last.two_nodes * last.stick_radius / last.area_radius
    for quantity, name, unit, value, allowed in (
        ("p_max", "p_max", "MPa", last.peak, DIGITS),
        ("a, contact", "a_fit", "mm", edge.semi_major, 3e-3),
        ("b, contact", "b_fit", "mm", edge.semi_minor, 3e-3),
        ("a_s, stick", "stick semi-axis a_s", "mm", stick.semi_major, 5e-3),
        ("b_s, stick", "stick semi-axis b_s", "mm", stick.semi_minor, 5e-3),
        ("stick area/contact area", "stick area fraction", "-", last.stick_fraction, nodes),
    ):
        found.add(where, quantity, unit, value, row=reference(case, name), relative=allowed)
    for name, ellipse, allowed in (("contact", edge, 0.05), ("stick", stick, 0.5)):
        value = _turned(ellipse.angle, hertz.angle)
        found.add(
            where, f"direction, {name}", "deg", value, analytic=hertz.angle, absolute=math.radians(allowed)
        )


def _on_printed_mesh(found: Comparison, last: State, phi: int, mu: float) -> None:
    """Show the ellipses of Figure 9.4, with the spacing of the text."""
    hertz, where = _hertz(phi), f"{phi}°, μ = {mu:g}, l_e = 0.225 mm, 10 steps"
    contact = flat.moment_ellipse(last.x, last.y, last.contact)
    stick = flat.moment_ellipse(last.x, last.y, last.stick)
    for name, ellipse, zone in (("contact", contact, last.contact), ("stick", stick, last.stick)):
        found.add(where, f"a, {name}, moments", "mm", ellipse.semi_major)
        found.add(where, f"b, {name}, moments", "mm", ellipse.semi_minor)
        value = _turned(ellipse.angle, hertz.angle)
        found.add(where, f"direction, {name}", "deg", value, analytic=hertz.angle, absolute=math.radians(1.0))
        error = ellipse_error(last.x, last.y, zone, last.spacing, ellipse)
        found.add(where, f"E_e of (9.5), {name}", "-", error, analytic=0.0, absolute=0.1)


def _turned(angle: float, towards: float) -> float:
    """Return the direction of an axis, which has no sense, near another one."""
    return towards + (angle - towards + math.pi / 2) % math.pi - math.pi / 2
