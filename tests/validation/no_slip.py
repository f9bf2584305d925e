"""Checks: contacts that cannot slip, and the stick radius of self-similar ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from hexcontact.analytic import friction as closed
from hexcontact.deck.surfaces import Punch, Sphere

from .reference import Comparison, reference
from .runs import DIGITS, bodies, hertz_of, press, run

NO_SLIP = math.inf


def flat_punch(meshes: Sequence[float] = (80.25,), betas: Sequence[float] = (0.0, 0.19, 0.3)) -> Comparison:
    """Press a rigid flat punch that cannot slip."""
    found = Comparison()
    for mesh in meshes:
        without = _punch(0.0, 0.0, mesh)
        for beta in betas:
            kappa = closed.no_slip_constants(beta)[0]
            stiffness = _punch(beta, NO_SLIP, mesh) / without
            row = reference(f"flat punch beta={beta:g} no slip", "P/(2 E* a delta)")
            where = f"β = {beta:g}, a/l_e = {mesh:g}"
            found.add(where, "P/(2 E* a δ)", "-", stiffness, row=row, analytic=kappa, relative=DIGITS)
    found.notes.append(
        "coefficient = inf, given approach; ratio to the frictionless punch on the same lattice. "
        "Analytic: κ = artanh(β)/β."
    )
    return found


def _punch(beta: float, mu: float, mesh: float) -> float:
    """Return the load of a punch of radius 1 under the approach 0.01, E* = 1."""
    pair = bodies(beta, 0.3, Punch(radius=1.0))
    loads = [{"approach": 0.01}]
    return run(*pair, spacing=1.0 / mesh, friction_coefficient=mu, loads=loads)[-1]["normal_load"]


def sphere(betas: Sequence[float] = (0.19, 0.3), mesh: int = 40, steps: int = 80) -> Comparison:
    """Press a sphere that cannot slip, in many steps."""
    found = Comparison()
    load = 4.0 / 3.0  # a_Hertz = 1
    for beta in betas:
        kappa, chi = closed.no_slip_constants(beta)
        values = []
        for count in (steps // 2, steps):
            made = run(
                *bodies(beta, 0.3, Sphere(radius=1.0)),
                spacing=1.0 / mesh,
                friction_coefficient=NO_SLIP,
                loads=[press(load, count)],
                every=count,
            )
            hertz, last = hertz_of(made.pair, load, 1.0), made[-1]
            values.append((last["approach"] / hertz.approach, last.area_radius / hertz.contact_radius))
        (half, _), (fine, radius) = values
        where = f"β = {beta:g}, a/l_e = {mesh}"
        found.add(where, f"δ/δ_Hertz, {steps} steps", "-", fine)
        exact = chi * (kappa * chi) ** (-2.0 / 3.0)
        found.add(where, "δ/δ_Hertz, N -> ∞", "-", 2.0 * fine - half, analytic=exact, absolute=1e-4)
        exact = (kappa * chi) ** (-1.0 / 3.0)
        found.add(where, "a_A/a_Hertz", "-", radius, analytic=exact, absolute=0.15 / mesh)
    found.notes += [
        "Mossakovskii, Spence: δ = χ a²/R, P = 4/3 κ χ E* a³/R. P_k = P (k/N)³; the approach tends to its "
        "limit like 1/N, so that N/2 and N steps are extrapolated.",
        "The pressure does not vanish like a square root at the edge here: a from the area, to 0.15 l_e.",
    ]
    return found


# Meshes (a/l_e) and materials of the reference table.
STICK_RADII: Mapping[float, tuple[tuple[str, ...], tuple[str, ...]]] = {
    80.25: (("0.1", "0.1891", "0.3", "0.4"), ("0.05", "0.1", "0.2")),
    40.25: (("0.1", "0.1891", "0.3", "0.4"), ("0.3", "0.5")),
}


def stick_radii(
    table: Mapping[float, tuple[tuple[str, ...], tuple[str, ...]]] = STICK_RADII,
) -> Comparison:
    """Stick radius of a flat punch in one step: that of every power-law profile pressed monotonically."""
    found = Comparison()
    for mesh, (betas, coefficients) in table.items():
        for beta in betas:
            for mu in coefficients:
                _stick_radius(found, mesh, beta, mu)
    _goodman_punch(found, max(table))
    found.notes += [
        "A flat punch in one step: the contact area does not change, so one step is exact. Superposed "
        "punches make every profile C rⁿ, hence c/a is theirs, too.",
        "Analytic: (a/2c) ln[(a+c)/(a-c)] = (μ/β) K'(c/a), which leaves out that shear moves the pressure; "
        "it tends to the full solution as β -> 0 with β/μ kept.",
    ]
    return found


def _stick_radius(found: Comparison, mesh: float, beta: str, mu: str) -> None:
    case = f"flat punch / self-similar indentation beta={beta} mu={mu}"
    # the reference table has gamma = 0.45, materials at most 1 - 2 beta: this moves a few nodes
    gamma = min(0.45, 0.99 * (1.0 - 2.0 * float(beta)))
    made = run(
        *bodies(float(beta), gamma, Punch(radius=1.0)),
        spacing=1.0 / mesh,
        friction_coefficient=float(mu),
        loads=[{"normal_load": 1.0}],
    )[-1]
    row = reference(case, "c/a fully coupled")
    exact = closed.goodman_stick_ratio(float(beta), float(mu))
    found.add(
        f"β = {beta}, μ = {mu}, a/l_e = {mesh:g}",
        "c/a",
        "-",
        made.stick_radius / made.area_radius,
        row=row,
        analytic=exact,
        judge="reference",
        absolute=0.25 * row.uncertainty,
    )


def _goodman_punch(found: Comparison, mesh: float) -> None:
    """Without the effect of shear on the pressure the closed formula is exact."""
    made = run(
        *bodies(0.1890756, 0.45, Punch(radius=1.0)),
        spacing=1.0 / mesh,
        friction_coefficient=0.1,
        coupling="goodman",
        loads=[{"normal_load": 1.0}],
    )[-1]
    row = reference("9.2 mu=0.1 incremental limit, p uncoupled from q (Goodman)", "c/a")
    found.add(
        f"β = 0.1891, μ = 0.1, a/l_e = {mesh:g}, goodman",
        "c/a",
        "-",
        made.stick_radius / made.area_radius,
        row=row,
        judge="reference",
        absolute=row.uncertainty,
    )
