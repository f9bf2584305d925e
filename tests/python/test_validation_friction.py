"""The checks of tests/validation with friction, at sizes that are quick, and that they can fail."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate
from validation import (
    checks,
    crossed_cylinders,
    dissimilar,
    entry,
    fretting,
    methods,
    no_slip,
    plane,
    runs,
    second_solutions,
    superposition,
    tangential,
    unloading,
)
from validation.reference import Comparison, reference

from hexcontact import Case
from hexcontact.analytic.friction import PlaneCattaneo, goodman_stick_ratio_plane
from hexcontact.deck.surfaces import Sphere

CASES = Path(__file__).parents[2] / "cases"


def failures(comparison: Comparison) -> list[str]:
    return [
        f"{row.case}, {row.quantity}: {row.difference:.2e}" for row in comparison.rows if row.passed is False
    ]


def judged(comparison: Comparison) -> int:
    return sum(row.passed is not None for row in comparison.rows)


# ------------------------------------------------------------------------------- closed solutions


@pytest.mark.parametrize("load", [0.1, -0.4, 0.95])
def test_plane_cattaneo(load: float) -> None:
    """The resultant is Q', the strip that sticks is not strained, elsewhere q = mu p."""
    exact = PlaneCattaneo(friction_coefficient=0.5, normal_load=2.0, half_width=3.0)
    n = 200_000
    x = (np.arange(n) + 0.5) / n * 6.0 - 3.0
    q = exact.traction(x, load)
    assert q.sum() * 6.0 / n == pytest.approx(load, rel=1e-6)
    c = exact.stick_half_width(load)
    assert c == pytest.approx(3.0 * math.sqrt(1.0 - abs(load)))
    # du/dx ~ principal value of integral q(t)/(t - x) dt; midway between nodes the poles cancel
    middle = x[np.abs(x) < 0.9 * c][::5000] + 3.0 / n
    strain = np.array([(q / (x - at)).sum() * 6.0 / n for at in middle])
    assert np.abs(strain).max() < 1e-4 * np.abs(q).max()
    p = 2.0 * exact.normal_load / (math.pi * 9.0) * np.sqrt(9.0 - x**2)
    slip = np.abs(x) > c
    assert q[slip] == pytest.approx(np.sign(load) * 0.5 * p[slip])
    with pytest.raises(ValueError, match="larger than mu P"):
        exact.stick_half_width(1.01)


@pytest.mark.parametrize(("beta", "mu"), [(0.189, 0.1), (-0.3, 0.2), (0.2, 0.5)])
def test_plane_stick_ratio(beta: float, mu: float) -> None:
    """The traction of a flat punch is bounded at the edge of the stick strip; b = 1, P' = pi."""
    c = goodman_stick_ratio_plane(beta, mu)

    def mismatch(angle: float) -> float:  # x = c sin(angle) takes in the weight 1/sqrt(c^2 - x^2)
        root = math.sqrt(1.0 - (c * math.sin(angle)) ** 2)
        slip = math.sqrt(1.0 - c**2)
        # integral of p(t) [1/(t - x) + 1/(t + x)] from c to 1, with w = sqrt(1 - t^2)
        ahead = math.log((root + slip) / (root - slip)) / root
        return abs(beta) / root - mu / math.pi * ahead

    assert integrate.quad(mismatch, -math.pi / 2, math.pi / 2)[0] == pytest.approx(0.0, abs=1e-9)


def test_plane_stick_ratio_at_its_limits() -> None:
    assert goodman_stick_ratio_plane(0.2, 0.2) == pytest.approx(math.sqrt(0.5))  # K = K'
    assert goodman_stick_ratio_plane(0.2, 2.0) == pytest.approx(1.0, abs=1e-6)
    assert 0.0 < goodman_stick_ratio_plane(0.2, 0.01) < 1e-6
    for beta, mu in ((0.0, 0.1), (0.1, 0.0), (0.1, math.nan)):
        with pytest.raises(ValueError, match="beta must not be 0"):
            goodman_stick_ratio_plane(beta, mu)


# ------------------------------------------------------------------------------- the checks


def test_bodies_with_given_constants() -> None:
    for beta, gamma in ((0.19, 0.3), (-0.25, 0.4), (0.0, 0.4925), (0.49, 0.0)):
        loads = [{"normal_load": 1e-3}]
        pair = runs.run(
            *runs.bodies(beta, gamma, Sphere(radius=1.0)),
            nodes_in_radius=2,
            friction_coefficient=0.1,
            loads=loads,
        ).pair
        assert (pair.effective_modulus, pair.beta, pair.gamma) == pytest.approx((1.0, beta, gamma), abs=1e-12)


def test_dissimilar_spheres() -> None:
    comparison = dissimilar.table_9_3({(40, 0.1): (1,), (40, 0.6): (10,)})
    assert failures(comparison) == []
    assert judged(comparison) == 4 + 2 * 4 + 4


def test_sphere_on_a_rigid_plane() -> None:
    comparison = dissimilar.rigid_plane((10,))
    assert failures(comparison) == []
    assert judged(comparison) == 1


def test_stick_radii() -> None:
    comparison = no_slip.stick_radii({40.25: (("0.3",), ("0.3", "0.5"))})
    assert failures(comparison) == []
    assert judged(comparison) == 3


def test_punch_without_slip() -> None:
    comparison = no_slip.flat_punch(betas=(0.0, 0.3))
    assert failures(comparison) == []
    assert judged(comparison) == 2


def test_unloading() -> None:
    comparison = unloading.unloading(unloading.PATHS[1:])
    assert failures(comparison) == []
    assert judged(comparison) == 3 + 3 * 5


def test_crossed_cylinders_with_friction() -> None:
    comparison = crossed_cylinders.crossed_cylinders(((14, 1, (60,)),), (0.25,), printed=(90,))
    assert failures(comparison) == []
    assert judged(comparison) == 8 + 4


def test_prescribed_shift_and_torsion() -> None:
    comparison = tangential.prescribed_shift((0.4925,))
    assert failures(comparison) == []
    assert judged(comparison) == 4
    comparison = tangential.torsion((0.4925,))
    assert failures(comparison) == []
    assert judged(comparison) == 4 * 3


def test_superposed_contacts() -> None:
    comparison = superposition.superposition(mesh=12)
    assert failures(comparison) == []
    assert judged(comparison) == 3 * 7 + 5 + 4 + 2


def test_superposition_needs_equal_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a Poisson's ratio of 0.3 a transverse traction appears, and the superposition is off."""
    monkeypatch.setattr(superposition, "bodies", lambda beta, _, surface: runs.bodies(beta, 0.43, surface))
    failed = failures(superposition.superposition(mesh=12))
    assert sum("μ(p - p*)" in each for each in failed) == 4


def test_search_for_second_solutions() -> None:
    """Random starts, which the solver leaves by different ways, end in one solution."""
    found = second_solutions.search(0.5, 1.0, 0.5, starts=4)
    assert found.converged == found.starts == 8
    assert len(found.solutions) == 1
    assert len(found.sweeps) > 1
    # other loads are other solutions
    other = second_solutions.search(0.5, 1.0, 0.4, starts=1)
    assert second_solutions.difference(found.solutions[0], other.solutions[0]) > 1e-3


@pytest.mark.parametrize(
    ("load", "share", "same"), [(66.0, 0.65, True), (54.0, 0.5, True), (84.0, 0.5, False)]
)
def test_static_answers_hold_above_the_line_of_friction(load: float, share: float, same: bool) -> None:
    """From (60 N, 9 N), mu = 0.3: with dQ >= mu dP slip only goes on, below it the stick zone grows."""
    changes = {
        "load.3.normal_load": load,
        "load.3.tangential_load_x": f"{share} mu P",
        "grid.nodes_in_radius": 8,
    }
    case = Case.from_toml(CASES / "path_dependence.toml", overrides=changes)
    incremental, static = (
        case.changed({"solver.algorithm": algorithm}).run().step(-1)
        for algorithm in ("incremental", "static")
    )
    scale = 0.3 * float(incremental.max_pressure)
    apart = float(abs(incremental.traction_x - static.traction_x).max()) / scale
    assert apart < 1e-6 if same else apart > 0.1


def test_long_contact() -> None:
    comparison = plane.cattaneo((0.33,), (0.5,))
    assert failures(comparison) == []
    assert judged(comparison) == 4


def test_plane_problem_of_the_long_contact() -> None:
    """Without mismatch it is Cattaneo's; pressed, the traction keeps to friction, to Spence's stick strip."""
    _, state = plane.sheared_strips(0.0, 0.3, [0.5], 400)
    exact = PlaneCattaneo(0.3, 0.5 * math.pi, 1.0).traction(state.y, 0.15 * 0.5 * math.pi)
    assert state.y[state.sticks][[0, -1]] == pytest.approx([-math.sqrt(0.5), math.sqrt(0.5)], abs=0.01)
    assert state.traction == pytest.approx(exact / 0.3, abs=0.05)  # in single strips at the kinks
    assert np.abs(state.traction - exact / 0.3).mean() < 2e-3
    for beta in (-0.189, -0.3):
        [state] = plane.sheared_strips(beta, 0.2, [], 400)
        low, high = state.stick_ends(*plane.GROWN)
        assert high == pytest.approx(-low)
        assert high == pytest.approx(goodman_stick_ratio_plane(beta, 0.2), abs=0.003)
        share = np.abs(state.traction) / state.pressure
        assert share.max() < 1.0 + 1e-12
        # continuous at its ends, where an infinite traction or a jump would stand out
        assert share[state.sticks][-1] > 0.99


def test_plane_contact_that_grows_stays_similar() -> None:
    """A load step from half-width 0.99 to 1, from the similar state, ends in the similar state."""
    beta, mu, count = -0.3, 0.2, 400
    [state] = plane.sheared_strips(beta, mu, [], count)
    y, kernel = state.y, plane.kernel_of(state.y)
    before = 0.99 * np.interp(y / 0.99, y, mu * state.traction, 0.0, 0.0)
    grown = np.sqrt(1.0 - y**2) - np.sqrt(np.maximum(0.99**2 - y**2, 0.0))
    spread = math.pi * beta * (2.0 / count) * np.sign(y[:, None] - y[None, :])
    after, _ = plane._slipped(kernel, kernel @ before + spread @ grown, mu * np.sqrt(1.0 - y**2), 0.0)
    assert np.sqrt(np.mean((after / mu - state.traction) ** 2)) < 1e-3


def test_long_contact_of_dissimilar_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a coarser lattice with fewer steps: tractions to 0.5 %, ends of stick to 1 %."""
    coarse = {"across": 100, "along": 48, "steps": 12}
    comparison = plane.dissimilar(((-0.3, 0.2),), **coarse)
    rms = [row.computed for row in comparison.rows if "rms" in row.quantity]
    assert len(rms) == 4
    assert max(rms) < 5e-3
    ends = [abs(row.computed - row.analytic) for row in comparison.rows if "/b" in row.quantity]
    assert len(ends) == 7
    assert max(ends) < 1e-2
    assert judged(comparison) == 2 + 3 * 3
    strips = plane.sheared_strips
    monkeypatch.setattr(plane, "sheared_strips", lambda beta, mu, shares: strips(0.5 * beta, mu, shares))
    wrong = plane.dissimilar(((-0.3, 0.2),), **coarse)
    assert min(row.computed for row in wrong.rows if "rms" in row.quantity) > 0.02


def test_fretting() -> None:
    comparison = fretting.fretting((20,))
    assert failures(comparison) == []
    assert judged(comparison) == 9 * 4 - 1
    assert comparison.rows[0].published == pytest.approx(3211.257e6)


def test_methods() -> None:
    comparison = methods.methods({"goodman": methods.HISTORIES["goodman"]})
    assert failures(comparison) == []
    assert judged(comparison) == 2 * 2


def test_compliance() -> None:
    comparison = fretting.compliance((0.0, 1.8908), mesh=20)
    assert failures(comparison) == []
    assert judged(comparison) == 2 + 2


# ------------------------------------------------------------------------------- that they can fail


def test_a_little_more_friction_is_a_failure(monkeypatch) -> None:
    """Two percent: shifts and stick areas change by more than a coarse mesh does."""
    monkeypatch.setattr(fretting, "FRICTION", 0.102)
    monkeypatch.setattr(fretting, "_name", lambda step: f"13.2 step {step} Q/muP={RATIO[step]}")
    failed = failures(fretting.fretting((20,)))
    assert len(failed) > 5
    assert any("Δ_x" in each for each in failed)


RATIO = {
    step: f"{0.1 * (step - 10) / 3.15:.4f}" for step in fretting.STEPS
}  # what the reference table calls the steps


def test_few_steps(monkeypatch) -> None:
    found = entry.entry(20, 40, (5,))
    assert judged(found) == 4
    assert failures(found) == []
    # as if solver.entry did nothing
    monkeypatch.setattr(entry, "run", lambda *a, entry="", **k: runs.run(*a, **k))
    assert len(failures(entry.entry(20, 40, (5,)))) == 3


def test_other_materials_are_a_failure(monkeypatch) -> None:
    monkeypatch.setattr(dissimilar, "STIFF", {"young_modulus": 430e9, "poisson_ratio": 0.32})
    assert len(failures(dissimilar.table_9_3({(40, 0.1): (1,)}))) > 3


def test_the_reference_names_the_cases_of_the_checks() -> None:
    """A name that is not in the reference table would end a check of minutes with a KeyError."""
    for step in fretting.STEPS:
        assert not math.isnan(reference(fretting._name(step), "p_max").reference)
    friction = {"table-9.3", "cattaneo-mindlin", "loop", "torsion", "fretting", "unloading", "goodman"}
    assert friction <= set(checks.CHECKS)
