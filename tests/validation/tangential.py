"""Checks: alike spheres pressed, then sheared or twisted (sections 13.1 and 6)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hexcontact.analytic.friction import LubkinTorsion, MindlinContact
from hexcontact.core.contact import ElasticPair
from hexcontact.deck.surfaces import Sphere

from .reference import Comparison, reference
from .runs import DIGITS, Run, State, bodies, each, hertz_of, run, shear_compliance, twist_compliance

# ------------------------------------------------------------------------- Cattaneo-Mindlin, Figure 13.2

# The tables of section 13.1 are matched by mu P = 1200 N and these; of mu, P and R only mu P and P R matter.
MODULUS, RADIUS, LOAD, FRICTION = 71.1e9, 25e-3, 4000.0, 0.3
SHEAR_STEP = 40.0  # N, 27 times


def cattaneo_mindlin(
    poisson_ratios: Sequence[float] = (0.0, 0.33), tenths: Sequence[int] = tuple(range(1, 10))
) -> Comparison:
    """Spheres of one material sheared up to 0.9 mu P."""
    found = Comparison()
    for nu in poisson_ratios:
        made = _sheared(nu, 3 * max(tenths))
        hertz = hertz_of(made.pair, LOAD, RADIUS / 2.0)
        exact = MindlinContact(FRICTION, LOAD, hertz.contact_radius, shear_compliance(made.pair))
        for tenth in tenths:
            state, load = made[10 + 3 * tenth], 0.1 * tenth * FRICTION * LOAD
            case = f"13.1 nu={nu:g} Q/muP={0.1 * tenth:.1f} (step {10 + 3 * tenth})"
            where = f"ν = {nu:g}, Q/μP = {0.1 * tenth:.1f}"
            _against_mindlin(found, where, case, state, exact, load)
        found.add(f"ν = {nu:g}", f"time, {len(made)} steps", "s", made.seconds)
    found.notes += [
        "E = 71.1 GPa, two spheres of 25 mm, P = 4 kN in 10 steps, μ = 0.3, Q = 1080 N in 27 steps, "
        "a/l_e = 80: of these the reference rows fix μP and E, P R.",
        "c/a from areas: a is that of the contact nodes. c_x, c_y: zeros of (μp - |q|)² at the edge of the "
        "stick zone, over Hertz's a.",
        "ν = 0.33: Δ and c/a differ from Mindlin's solution, which neglects the transverse traction.",
    ]
    return found


def _sheared(nu: float, steps: int) -> Run:
    body = {"young_modulus": MODULUS, "poisson_ratio": nu, "surface": Sphere(radius=RADIUS)}
    e_star = MODULUS / (2.0 * (1.0 - nu**2))
    radius = math.cbrt(3.0 * LOAD * 0.5 * RADIUS / (4.0 * e_star))
    loads = [
        {"normal_load": LOAD, "steps": 10},
        {"tangential_load_x": SHEAR_STEP * steps, "steps": steps},
    ]
    return run(body, body, spacing=radius / 80, friction_coefficient=FRICTION, loads=loads)


def _against_mindlin(
    found: Comparison, where: str, case: str, state: State, exact: MindlinContact, load: float
) -> None:
    a = exact.contact_radius
    c_x, c_y = state.stick_axes(exact.friction_coefficient)
    r = np.hypot(state.x, state.y)
    difference = state.traction_x - exact.traction(r, load)
    error = float(np.linalg.norm(difference) / np.linalg.norm(exact.traction(r, load)))
    slip_peak = 1.5 * exact.sliding_load / (math.pi * a**2)  # mu p0
    transverse = float(np.abs(state.traction_y).max()) / slip_peak
    shift = state["shift_x"]
    stick = state.stick_radius / state.area_radius
    for quantity, name, unit, value, allowed in (
        ("c/a from areas", "c/a (A-equivalent)", "-", stick, state.two_nodes),
        ("c_x/a", "c_x/a (fit)", "-", c_x / a, 1e-3),
        ("c_y/a", "c_y/a (fit)", "-", c_y / a, 1e-3),
        ("Δ/Δ_Mindlin", "Delta/Delta_Mindlin", "-", shift / float(exact.shift(load)), DIGITS),
        ("Δ", "Delta", "um", shift, DIGITS * abs(shift)),
        ("max |q_y|/(μ p_0)", "max|qy|/(mu p0)", "-", transverse, DIGITS),
        ("L2 error of q_x", "rel L2 difference of qx from Cattaneo", "-", error, DIGITS),
    ):
        found.add(
            where, quantity, unit, value, row=reference(case, name), judge="reference", absolute=allowed
        )


# ------------------------------------------------------------------------------- E* = 1, R = 1, a = 1

BALL = Sphere(radius=1.0)
UNIT_LOAD = 4.0 / 3.0
GAMMAS = (0.0, 0.4925)  # of the reference table: Poisson's ratio 0 and 0.33
MESH = 80


def _pair(gamma: float) -> ElasticPair:
    """Return the compliances of alike bodies with E* = 1."""
    lambda_1 = 1.0 / math.pi
    return ElasticPair(lambda_1, 0.0, gamma * lambda_1)


def _tangential(gamma: float, mu: float, loads: Sequence[dict[str, float]], mesh: int) -> Run:
    """Press alike spheres of radius 1 in one step (no shear arises), then follow `loads`."""
    pressed = [{"normal_load": UNIT_LOAD}, *loads]
    return run(*bodies(0.0, gamma, BALL), spacing=1.0 / mesh, friction_coefficient=mu, loads=pressed)


def loop(gammas: Sequence[float] = GAMMAS, mesh: int = MESH, steps: int = 12) -> Comparison:
    """Shear spheres to and fro at constant normal load (Mindlin-Deresiewicz)."""
    found = Comparison()
    mu, peak = 0.5, 0.6 * 0.5 * UNIT_LOAD
    for gamma in gammas:
        ends = (peak, -peak, peak)
        counts = (steps // 2, steps, steps)
        loads = [{"tangential_load_x": q, "steps": n} for q, n in zip(ends, counts, strict=True)]
        made = _tangential(gamma, mu, loads, mesh)
        exact = MindlinContact(mu, UNIT_LOAD, 1.0, shear_compliance(made.pair))
        where = f"γ = {gamma:g}"
        case = f"loop Q*=0.6muP gamma={gamma:g} (E*=1,a=1,P=4/3,mu=0.5; {steps} steps per half cycle)"
        table = made.result.dataset
        load, shift = table["tangential_load_x"].values[1:], table["shift_x"].values[1:]
        first, last = steps // 2, steps // 2 + steps
        branches = np.concatenate(
            [
                exact.shift(load[:first]),
                exact.shift_unloading(load[first:last], peak),
                -exact.shift_unloading(-load[last:], peak),
            ]
        )
        lost = table["dissipated_energy"].values
        for quantity, name, value, allowed in (
            (
                "dissipated energy per cycle",
                "dissipated energy per cycle",
                float(lost[-1] - lost[first]),
                1e-5 * float(lost[-1] - lost[first]),
            ),
            (
                "max |Δ - Δ_analytic|/Δ_s",
                "max |Delta-Delta_analytic|/(3 mu P S/16 a)",
                float(np.abs(shift - branches).max()) / exact.sliding_shift,
                DIGITS,
            ),
            (
                "closure of the loop, over Δ_s",
                "loop closure error",
                abs(float(shift[-1] - shift[first - 1])) / exact.sliding_shift,
                DIGITS,
            ),
        ):
            row = reference(case, name)
            found.add(where, quantity, "-", value, row=row, judge="reference", absolute=allowed)
        _loop_traction(found, where, made[1 + steps], exact, peak)
    found.notes += [
        "E* = 1, R = 1, P = 4/3 (a = 1), μ = 0.5, a/l_e = 80; 0 -> Q* -> -Q* -> Q* = 0.6 μP, "
        f"{steps} steps from turn to turn. Δ_s = 3μPS/16a.",
        "γ = 0.4925 (ν = 0.33): the formula neglects the transverse traction; the difference is real.",
    ]
    return found


def _loop_traction(found: Comparison, where: str, state: State, exact: MindlinContact, peak: float) -> None:
    """Compare the traction half-way back, at Q = 0, where slip has turned around in a ring."""
    traction = exact.traction_unloading(np.hypot(state.x, state.y), 0.0, peak)
    slip_peak = 1.5 * exact.sliding_load / math.pi
    error = float(np.linalg.norm(state.traction_x - traction) / np.linalg.norm(traction))
    transverse = float(np.abs(state.traction_y).max()) / slip_peak
    found.add(where, "L2 error of q_x, back at Q = 0", "-", error, analytic=0.0, absolute=0.05)
    found.add(where, "max |q_y|/(μ p_0), back at Q = 0", "-", transverse)


SHIFTS = (0.2, 0.5, 0.8, 1.2)


def prescribed_shift(gammas: Sequence[float] = GAMMAS, mesh: int = MESH) -> Comparison:
    """Shift spheres by given amounts, the last beyond the onset of sliding."""
    found = Comparison()
    mu = 0.5
    for gamma in gammas:
        pair = _pair(gamma)
        exact = MindlinContact(mu, UNIT_LOAD, 1.0, shear_compliance(pair))
        targets = [f * exact.sliding_shift for f in SHIFTS]
        made = _tangential(gamma, mu, each("shift_x", targets), mesh)
        for number, f in enumerate(SHIFTS, start=2):
            row = reference(f"prescribed shift f={f:g} gamma={gamma:g} (mu=0.5)", "Q/(mu P)")
            value = made[number]["tangential_load_x"] / exact.sliding_load
            where = f"γ = {gamma:g}, Δ = {f:g} Δ_s"
            found.add(where, "Q/(μP)", "-", value, row=row, judge="reference", absolute=DIGITS)
    found.notes.append(
        "γ = 0.4925 at full slip: slip is not exactly parallel, the resultant stays 2e-4 below μP."
    )
    return found


RATIOS = (0.9, 0.7, 0.5, 0.3)


def torsion(gammas: Sequence[float] = GAMMAS, mesh: int = MESH) -> Comparison:
    """Twist spheres by the torques at which Lubkin's stick radius has given values."""
    found = Comparison()
    mu = 0.3
    for gamma in gammas:
        exact = LubkinTorsion(mu, UNIT_LOAD, 1.0, twist_compliance(_pair(gamma)))
        made = _tangential(gamma, mu, each("torque", [exact.torque(c) for c in RATIOS]), mesh)
        for number, c in enumerate(RATIOS, start=2):
            state, where = made[number], f"γ = {gamma:g}, c/a = {c:g}"
            case = f"torsion gamma={gamma:g} c/a={c:g} (mu=0.3)"
            moment = state["torque"] / (mu * UNIT_LOAD)
            row = reference(case, "Mz/(mu P a)")
            found.add(where, "M_z/(μPa)", "-", moment, row=row, judge="reference", absolute=row.uncertainty)
            row = reference(case, "twist angle (E*=1,a=1,P=4/3)")
            found.add(where, "twist", "rad", state["twist"], row=row, judge="reference", relative=DIGITS)
            row = reference(case, "c/a")
            allowed = row.uncertainty
            found.add(where, "c/a", "-", state.stick_radius, row=row, judge="analytic", absolute=allowed)
    found.notes.append("E* = 1, R = 1, P = 4/3 (a = 1), μ = 0.3, a/l_e = 80; the torque is prescribed.")
    return found
