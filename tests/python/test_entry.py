"""Nodes that enter the contact: their slip counts from the moment their gap closed (solver.entry)."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from validation.runs import shear_compliance

import hexcontact
from hexcontact import Case
from hexcontact.core.contact import ElasticPair, FlexibilityOperator
from hexcontact.core.friction import ContactState, Entry, FrictionalContact
from hexcontact.core.lattice import Lattice
from hexcontact.deck.surfaces import Sphere

FORCES = ("force", "force", "force", "displacement")
RADIUS = 1.0  # of the contact at the end
LOAD = 4.0 / 3.0
ALIKE = ElasticPair.from_materials(1.8, 0.3, 1.8, 0.3)
UNLIKE = ElasticPair.from_materials(1.82, 0.25, 5.0, 0.25)


def sphere(pair: ElasticPair, mu: float, mesh: int = 12, method: Any = "fft") -> FrictionalContact:
    lattice = Lattice.covering(RADIUS / mesh, (0.0, 0.0), 2.7, 2.7)
    gap = 0.5 * (lattice.x**2 + lattice.y**2)
    return FrictionalContact(
        lattice, pair, gap, friction_coefficient=mu, method=method, threads=1
    )  # R = 1: P = 4/3 E* a^3


def loaded(
    contact: FrictionalContact, pair: ElasticPair, ratio: float, steps: int, entry: Entry
) -> ContactState:
    """Load under Q/P = ratio, the contact radius growing evenly."""
    state = contact.virgin()
    for k in range(1, steps + 1):
        load = LOAD * pair.effective_modulus * (k / steps) ** 3
        state = contact.advance(state, FORCES, (load, ratio * load, 0.0, 0.0), entry=entry)
        assert state.converged
        assert state.cuts == 0
    return state


def oblique_errors(entry: Entry, step_counts: tuple[int, ...]) -> list[float]:
    """Error of the shift under an oblique load that never makes anything slip: shift = 3 S Q/16 a."""
    pair = ElasticPair.from_materials(1.0, 0.0, 1.0, 0.0)
    contact = sphere(pair, 0.3)
    exact = 3.0 * shear_compliance(pair) * 0.15 * LOAD * pair.effective_modulus / 16.0
    values = [abs(loaded(contact, pair, 0.15, steps, entry).shift_x) / exact for steps in step_counts]
    return [1.0 - value for value in values]


def test_oblique_load_needs_few_steps() -> None:
    """Exact: no slip, and a shift of 3SQ/16a.

    The implicit scheme is of the first order: half the error in twice the steps, 9 % in five. With the entry
    state five steps are within the mesh error, 2e-3 at twelve spacings in the radius.
    """
    implicit = oblique_errors("implicit", (5, 10))
    assert 0.06 < implicit[0] < 0.12
    assert 1.6 < implicit[0] / implicit[1] < 2.4
    interpolated = oblique_errors("interpolated", (3, 5, 10))
    assert max(abs(error) for error in interpolated) < 3.5e-4


def test_oblique_load_makes_nothing_slip() -> None:
    pair = ElasticPair.from_materials(1.0, 0.0, 1.0, 0.0)
    contact = sphere(pair, 0.3)
    state = loaded(contact, pair, 0.15, 5, "interpolated")
    assert np.count_nonzero(state.zone == 2) == 0
    # q = Q/P p but for the nodes at the edge
    inside = state.pressure > 0.3 * state.pressure.max()
    assert np.allclose(state.traction_x[inside], 0.15 * state.pressure[inside], rtol=0.01)
    assert state.dissipated_energy < 1e-12 * LOAD
    implicit = loaded(contact, pair, 0.15, 5, "implicit")
    assert np.count_nonzero(implicit.zone == 2) > 20


def test_dissimilar_spheres_stick_after_few_steps() -> None:
    """Much friction: the shear traction of five steps is that of many, to a few per cent instead of 25."""
    contact = sphere(UNLIKE, 1.0)

    def shear(steps: int, entry: Entry) -> float:
        state = loaded(contact, UNLIKE, 0.0, steps, entry)
        return float(np.hypot(state.traction_x, state.traction_y).sum() / state.pressure.sum())

    limit = shear(40, "interpolated")
    assert abs(shear(5, "interpolated") / limit - 1.0) < 1.7e-3
    few, many = shear(5, "implicit") / limit - 1.0, shear(20, "implicit") / limit - 1.0
    assert few > 0.15
    assert 0.02 < many < 0.5 * few  # from the same side, and slowly


@pytest.mark.parametrize(("mu", "ratio"), [(0.1, 0.0), (0.5, 0.1), (math.inf, 0.2)])
def test_residuals_hold_with_the_recorded_entry_state(mu: float, ratio: float) -> None:
    """R_t from scratch, with a product of its own, and slip from s^n but where a node entered."""
    pair = UNLIKE if math.isfinite(mu) else ALIKE
    contact = sphere(pair, mu)
    lattice = contact.lattice
    operator = FlexibilityOperator(lattice, pair, threads=1)
    state = loaded(contact, pair, ratio, 3, "interpolated")
    load = 1.4 * LOAD * pair.effective_modulus
    after = contact.advance(state, FORCES, (load, ratio * load, 0.0, 0.0), entry="interpolated")
    assert after.converged
    touching, old = after.pressure > 0, state.pressure > 0
    entered = touching & ~old
    assert np.count_nonzero(entered) > 50
    _, u_x, u_y = operator.apply(after.pressure, after.traction_x, after.traction_y)
    for axis, u in (("x", u_x), ("y", u_y)):
        s, shift, slip = (
            getattr(after, f"{name}_{axis}") for name in ("relative_displacement", "shift", "slip_increment")
        )
        scale = np.abs(s).max()
        assert np.allclose(u - shift, s, atol=1e-12 * scale)
        since = s - getattr(state, f"relative_displacement_{axis}")
        assert np.allclose(slip[touching & old], since[touching & old], atol=1e-12 * scale)
        assert np.all(slip[~touching] == 0.0)
        # they moved before they entered, by less than they did in all where nothing holds them
        assert np.abs(since - slip)[entered].max() > 1e-3 * np.abs(since[~touching]).max()
        assert np.abs(since - slip)[entered].max() < np.abs(since[~touching]).max()
    d_t = (pair.lambda_1 + 0.5 * pair.lambda_5) * 2.854278452689038 * lattice.spacing
    trial = np.stack([after.traction_x, after.traction_y]) - (
        np.stack([after.slip_increment_x, after.slip_increment_y]) / d_t
    )
    length = np.maximum(np.hypot(*trial), 1e-300)
    bound = mu * after.pressure if math.isfinite(mu) else np.full(lattice.shape, math.inf)
    projected = np.where(length > bound, bound / length, 1.0) * trial
    q = np.hypot(after.traction_x, after.traction_y)
    tau = mu * after.pressure.max() if math.isfinite(mu) else q.max()
    missed = np.hypot(after.traction_x - projected[0], after.traction_y - projected[1])[touching]
    assert missed.max() / tau < 1.01e-8
    assert missed.max() / tau == pytest.approx(after.residual_tangential, abs=1e-9)


def test_both_methods_find_the_same_entry_states() -> None:
    states = [
        loaded(sphere(UNLIKE, 0.2, 6, method), UNLIKE, 0.1, 3, "interpolated") for method in ("fft", "direct")
    ]
    for name in ("pressure", "traction_x", "traction_y", "relative_displacement_x", "slip_increment_x"):
        fft, direct = (getattr(state, name) for state in states)
        assert np.abs(fft - direct).max() < 1e-6 * np.abs(direct).max(), name


def test_nothing_changes_where_nothing_enters() -> None:
    """A punch, and a shear at constant load of alike spheres: the contact stays as it is."""
    contact = sphere(ALIKE, 0.3)
    pressed = contact.advance(contact.virgin(), FORCES, (LOAD * ALIKE.effective_modulus, 0.0, 0.0, 0.0))
    values = (LOAD * ALIKE.effective_modulus, 0.2 * LOAD * ALIKE.effective_modulus, 0.0, 0.0)
    implicit, interpolated = (
        contact.advance(pressed, FORCES, values, entry=entry) for entry in ("implicit", "interpolated")
    )
    scale = implicit.pressure.max()
    assert np.abs(implicit.traction_x - interpolated.traction_x).max() < 1e-6 * scale


def test_static_loads_know_no_entry() -> None:
    contact = sphere(UNLIKE, 0.3)
    implicit, interpolated = (
        contact.advance(contact.virgin(), FORCES, (LOAD, 0.1, 0.0, 0.0), static=True, entry=entry)
        for entry in ("implicit", "interpolated")
    )
    assert np.array_equal(implicit.traction_x, interpolated.traction_x)


def test_a_halved_step_adds_up_its_slip() -> None:
    """Too few sweeps for the whole step: its slip is the sum of the halves', and the energy goes with it."""
    contact = sphere(UNLIKE, 0.1, 8)
    load = LOAD * UNLIKE.effective_modulus
    state = contact.advance(contact.virgin(), FORCES, (0.25 * load, 0.0, 0.0, 0.0), entry="interpolated")

    def further(state: ContactState, normal: float, tangential: float, max_sweeps: int) -> ContactState:
        values = (normal * load, tangential * load, 0.0, 0.0)
        return contact.advance(state, FORCES, values, entry="interpolated", max_sweeps=max_sweeps)

    # as many sweeps as are not enough
    for max_sweeps in range(12, 2, -1):
        whole = further(state, 2.0, 0.1, max_sweeps)
        if whole.cuts > 0:
            break
    assert (whole.converged, whole.cuts) == (True, 1)
    middle = further(state, 1.125, 0.05, max_sweeps)
    last = further(middle, 2.0, 0.1, max_sweeps)
    assert (middle.cuts, last.cuts) == (0, 0)
    both = middle.slip_increment_x + last.slip_increment_x
    assert np.abs(whole.slip_increment_x - both).max() < 1e-12 * np.abs(both).max()
    assert whole.dissipated_energy == pytest.approx(last.dissipated_energy, rel=1e-12)


def test_unknown_words_are_refused() -> None:
    contact = sphere(UNLIKE, 0.1, 6)
    word: Any = "explicit"
    with pytest.raises(hexcontact.DeckError, match="entry = 'explicit': expected 'implicit'"):
        contact.advance(contact.virgin(), FORCES, (1.0, 0.0, 0.0, 0.0), entry=word)
    with pytest.raises(hexcontact.DeckError, match="solver.entry"):
        case(entry="explicit")


def case(**arguments: Any) -> Case:
    settings: dict[str, Any] = {
        "body_1": {"young_modulus": 432e9, "poisson_ratio": 0.32, "surface": Sphere(radius=1e-3)},
        "body_2": {"young_modulus": 72e9, "poisson_ratio": 0.32},
        "friction_coefficient": 0.6,
        "spacing": 6e-6,
        "loads": [{"normal_load": 31.5, "steps": 3}],
    }
    return Case(**{**settings, **arguments})


def test_a_case_takes_it_from_its_deck() -> None:
    plain, interpolated = case(), case(entry="interpolated")
    assert (plain.solver.entry, interpolated.solver.entry) == ("implicit", "interpolated")
    assert interpolated.memory_needed(interpolated.lattice) >= plain.memory_needed(plain.lattice)
    runs = [some.run() for some in (plain, interpolated)]
    assert [run.dataset.attrs["entry"] for run in runs] == ["implicit", "interpolated"]
    slip: list[NDArray[np.float64]] = [run.dataset["slip_increment_x"].values for run in runs]
    assert not np.allclose(slip[0], slip[1])
    # far less energy is lost: what sticks has not slipped
    lost = [float(run.dataset["dissipated_energy"].values[-1]) for run in runs]
    assert lost[1] < 0.1 * lost[0]


def test_a_growing_window_keeps_the_entry_states() -> None:
    """The window starts small; the result is that of a window that is large from the beginning."""
    grown = case(entry="interpolated").run()
    whole = case(entry="interpolated", extent=(2.4e-4, 2.4e-4)).run()
    for name in ("shift_x", "dissipated_energy", "max_traction", "max_pressure"):
        assert float(grown.dataset[name].values[-1]) == pytest.approx(
            float(whole.dataset[name].values[-1]), rel=1e-5, abs=1e-13
        ), name


def test_states_are_left_as_they_are() -> None:
    contact = sphere(UNLIKE, 0.3, 6)
    state = loaded(contact, UNLIKE, 0.0, 1, "interpolated")
    copy = dataclasses.replace(state, pressure=state.pressure.copy(), gap=state.gap.copy())
    contact.advance(state, FORCES, (2.0, 0.1, 0.0, 0.0), entry="interpolated")
    assert np.array_equal(copy.pressure, state.pressure)
    assert np.array_equal(copy.gap, state.gap, equal_nan=True)
