"""The checks of tests/validation with friction, at sizes that are quick, and that they can fail."""

import math

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
    tangential,
    unloading,
)
from validation.reference import Comparison, reference

from hexcontact.analytic.friction import PlaneCattaneo, goodman_stick_ratio_plane
from hexcontact.deck.surfaces import Sphere


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


def test_long_contact() -> None:
    comparison = plane.cattaneo((0.33,), (0.5,))
    assert failures(comparison) == []
    assert judged(comparison) == 2


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
