"""Interfaces with a normal compliance: decks, runs, restarts, and what is said about their results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hexcontact as hc
from hexcontact.core.contact import ElasticPair, NormalContact
from hexcontact.core.friction import FrictionalContact
from hexcontact.core.lattice import Lattice
from hexcontact.errors import DeckError
from hexcontact.result.view import StepView

# E* = 1 Pa and R = 1 m: P = 4/3 N makes Hertz's radius and approach 1 m. c, m, approach, p_max/p0 of the
# limit of fine lattices, +-4e-5 (tests/reference/interface.csv).
REFERENCE = np.loadtxt(
    Path(__file__).parents[1] / "reference" / "interface.csv", delimiter=",", skiprows=2, usecols=range(4)
)


def deck(c: float, m: float, **more: Any) -> dict[str, Any]:
    """Return the sphere of the reference table with an interface; `more` are tables."""
    return {
        "body": {
            "1": {"young_modulus": 1.0, "poisson_ratio": 0.0, "surface": {"shape": "sphere", "radius": 1.0}},
            "2": {"rigid": True},
        },
        "interface": {"law": "power", "exponent": m, "coefficient": c},
        "grid": {"spacing": 0.05},
        "solver": {"tolerance": 1e-9},
        "load": [{"normal_load": 4 / 3}],
    } | more


@pytest.mark.parametrize(("c", "m", "approach", "peak"), REFERENCE)
def test_reference_sphere(c: float, m: float, approach: float, peak: float) -> None:
    result = hc.Case.from_dict(deck(c, m)).run()
    # at 20 spacings in Hertz's radius the lattice adds at most 3e-4
    assert float(result["approach"][-1]) == pytest.approx(approach, abs=3e-4)
    assert float(result["max_pressure"][-1]) == pytest.approx(peak * 2 / np.pi, rel=5e-4)
    pressure, gap = (result[name][-1].values for name in ("pressure", "gap"))
    assert pressure == pytest.approx(c * np.maximum(-gap, 0) ** m, abs=1e-6)
    assert ((gap < 0) == (pressure > 0)).mean() > 0.99


@pytest.mark.parametrize(
    ("exponent", "share", "most"),
    [
        (1.0, 0.01, 1.15),
        (2.0, 0.01, 1.25),
        (2.0, 0.1, 1.05),
        (2.0, 1.0, 0.8),
        (3.0, 0.1, 1.1),
        (3.0, 1.0, 0.85),
    ],
)
def test_step_costs_little_more_than_without_layer(exponent: float, share: float, most: float) -> None:
    """Counts as of tests/bench/layers.py and a quarter; `share`: compression under Hertz's pressure."""
    works = []
    for c in (2 / np.pi / share**exponent, None):
        given = deck(
            c or 1.0, exponent, grid={"spacing": 1 / 40}, solver={"tolerance": 1e-8, "method": "fft"}
        )
        if c is None:
            del given["interface"]
        works.append(float(hc.Case.from_dict(given).run()["operator_applications"][-1]))
    assert works[0] < 1.25 * most * works[1]


def test_what_is_known_without_it_does_not_hold() -> None:
    result = hc.Case.from_dict(deck(10.0, 2.0)).run()
    assert result.dataset.attrs["interface_coefficient"] == 10.0
    assert result.dataset.attrs["interface_exponent"] == 2.0
    assert StepView(result, -1).hertz is None
    rigid = hc.Case.from_dict({k: v for k, v in deck(10.0, 2.0).items() if k != "interface"}).run()
    assert "interface_coefficient" not in rigid.dataset.attrs
    assert StepView(rigid, -1).hertz is not None
    # the window is that of the larger contact
    assert result.dataset.sizes["row"] > rigid.dataset.sizes["row"]


FRICTION = {
    "friction": {"coefficient": 0.3},
    "grid": {"spacing": 0.125},
    "load": [
        {"normal_load": 4 / 3, "steps": 2},
        {"tangential_load_x": 0.2, "steps": 2},
        {"approach": 0.7, "tangential_load_x": 0.05},
    ],
}


@pytest.mark.parametrize(
    ("algorithm", "stiffness"), [("incremental", None), ("static", None), ("incremental", 5.0)]
)
def test_both_methods_with_friction(algorithm: str, stiffness: float | None) -> None:
    results = []
    for method in ("fft", "direct"):
        given = deck(10.0, 1.5, **FRICTION)
        given["solver"] = {"tolerance": 1e-9, "method": method, "algorithm": algorithm}
        given["interface"] |= {"tangential_stiffness": stiffness} if stiffness else {}
        results.append(hc.Case.from_dict(given).run())
    one, other = results
    for name in ("pressure", "traction_x", "traction_y", "gap"):
        assert one[name].values == pytest.approx(other[name].values, abs=1e-6), name
    bound = 0.3 * one["pressure"].values
    assert (np.hypot(one["traction_x"], one["traction_y"]) <= bound * (1 + 1e-9) + 1e-12).all()


@pytest.mark.parametrize("method", ["fft", "direct"])
def test_rigid_flats_on_springs(method: str) -> None:
    """All of the layer acts alike: P = A c delta^m, Q = A k_T shift until mu P, and slip beyond it."""
    c, m, k = 2.0, 2.0, 3.0
    lattice = Lattice(0.1, -4, -4, 9, 9)
    flats = FrictionalContact(
        lattice,
        ElasticPair(1e-13, 0.0, 3e-14),  # as good as rigid
        np.zeros(lattice.shape),
        friction_coefficient=0.5,
        method=method,  # type: ignore[arg-type]
        interface=(c, m, k),
        rim_warning=False,
    )
    area, pressure = lattice.cell_area * lattice.size, c * 0.1**m
    control = ["displacement"] * 4
    sticking = flats.advance(flats.virgin(), control, [0.1, 0.001, 0.0, 0.0], tolerance=1e-11)
    assert sticking.converged
    assert sticking.normal_load == pytest.approx(area * pressure, rel=1e-9)
    assert -sticking.tangential_load_x == pytest.approx(-area * k * 0.001, rel=1e-9) or (
        sticking.tangential_load_x == pytest.approx(area * k * 0.001, rel=1e-9)
    )
    assert (sticking.zone == 1).all()
    sliding = flats.advance(sticking, control, [0.1, 0.01, 0.0, 0.0], tolerance=1e-11)
    assert sliding.converged
    assert abs(sliding.tangential_load_x) == pytest.approx(0.5 * area * pressure, rel=1e-9)
    # slip is what the springs do not take
    assert abs(sliding.slip_increment_x) == pytest.approx(0.01 - 0.5 * pressure / k, rel=1e-6)
    assert sliding.dissipated_energy == pytest.approx(
        0.5 * pressure * area * (0.01 - 0.5 * pressure / k), rel=1e-6
    )


def test_tangential_springs_make_the_contact_softer() -> None:
    shifts = []
    for stiffness in (None, 1e6, 10.0, 1.0):
        given = deck(10.0, 1.5, **FRICTION)
        if stiffness:
            given["interface"]["tangential_stiffness"] = stiffness
        result = hc.Case.from_dict(given).run()
        shifts.append(float(result["shift_x"][3]))
    assert shifts[1] == pytest.approx(shifts[0], rel=1e-5)
    assert shifts[0] < shifts[2] < shifts[3]


def test_resumed_run_is_the_same(tmp_path: Path) -> None:
    case = hc.Case.from_dict(deck(10.0, 1.5, **FRICTION))
    whole = case.run()

    def leave(step: Any) -> None:
        if step.number == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        case.run(tmp_path / "part.nc", on_step=leave)
    resumed = hc.resume(tmp_path / "part.nc")
    for name in ("pressure", "traction_x", "gap", "approach", "shift_x"):
        assert np.array_equal(resumed[name].values, whole[name].values, equal_nan=True), name


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"exponent": 0.5}, "interface.exponent = 0.5: expected a number of at least 1"),
        ({"exponent": float("nan")}, "interface.exponent = nan: expected a number"),
        ({"coefficient": -1.0}, "interface.coefficient = -1.0: expected a coefficient in Pa/m^2 above 0"),
        ({"coefficient": float("nan")}, "interface.coefficient = nan: expected a coefficient"),
        ({"coefficient": "1 GPa"}, "is a pressure"),
        ({"coefficient": None}, "interface.coefficient: missing"),
        ({"law": "linear"}, 'interface.law = "linear": expected "power"'),
        ({"stiffness": 1.0}, "interface.stiffness"),
        ({"tangential_stiffness": -1.0}, "interface.tangential_stiffness = -1.0: expected"),
        ({"tangential_stiffness": float("nan")}, "interface.tangential_stiffness = nan: expected"),
    ],
)
def test_wrong_interface(change: dict[str, Any], sentence: str) -> None:
    given = deck(10.0, 2.0)
    given["interface"] = {k: v for k, v in (given["interface"] | change).items() if v is not None}
    with pytest.raises(DeckError) as caught:
        hc.Case.from_dict(given)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    "interface", [(-1.0, 1.0, 0.0), (1.0, 0.5, 0.0), (float("nan"), 1.0, 0.0), (1.0, 1.0), (0.0, 2.0, 0.0)]
)
def test_wrong_numbers(interface: Any) -> None:
    lattice = Lattice(0.1, -5, -5, 11, 11)
    pair = ElasticPair.from_materials(1.0, 0.0, None, None)
    gap = lattice.x**2 + lattice.y**2
    with pytest.raises(DeckError, match="interface"):
        NormalContact(lattice, pair, gap, interface=interface)
    with pytest.raises(DeckError, match="interface"):
        FrictionalContact(lattice, pair, gap, friction_coefficient=0.1, interface=interface)


def test_units() -> None:
    given = deck(1.0, 2.0)
    given["interface"]["coefficient"] = "2 GPa/um^2"
    assert hc.Case.from_dict(given).interface == (pytest.approx(2e21), 2.0, 0.0)
    given["interface"] = {"coefficient": "3 MPa/mm"}
    assert hc.Case.from_dict(given | {"grid": {"spacing": 0.02}}).interface == (pytest.approx(3e9), 1.0, 0.0)


def flats(**more: Any) -> dict[str, Any]:
    """Return flat on flat, Model One of section 12.1: 11 x 11 nodes of 0.1 m."""
    steel = {"young_modulus": 1e3, "poisson_ratio": 0.3}
    return {
        "body": {"1": steel, "2": {"rigid": True}},
        "interface": {"exponent": 2.0, "coefficient": 5.0, "tangential_stiffness": 4.0},
        "friction": {"coefficient": 0.5},
        "grid": {"spacing": 0.1, "window": [11, 11]},
        "load": [{"normal_load": 2.0, "steps": 2}, {"tangential_load_x": 0.6}, {"shift_x": 1.0}],
    } | more


@pytest.mark.parametrize("method", ["fft", "direct"])
def test_full_contact_of_flats_has_one_unknown(method: str) -> None:
    """p = P/A, P = A c psi^2, shift = Q/(A k_T) until Q = mu P, whatever the half-spaces are made of."""
    result = hc.Case.from_dict(flats(solver={"method": method})).run()
    area = 121 * np.sqrt(0.75) * 0.01
    assert result.approach.values[1:] == pytest.approx((2.0 / area / 5.0) ** 0.5, rel=1e-7)
    assert result.shift_x.values == pytest.approx([0.0, 0.0, 0.6 / area / 4.0, 1.0], abs=1e-7)
    assert result.tangential_load_x.values == pytest.approx([0.0, 0.0, 0.6, 1.0], abs=1e-7)
    assert np.ptp(result.pressure.values[-1]) < 1e-6 * 2.0 / area
    assert result.dissipated_energy.values[-1] == pytest.approx(1.0 - 1.0 / area / 4.0, rel=1e-6)
    other = flats(solver={"method": method})
    other["body"] = {"1": {"young_modulus": 1e4, "poisson_ratio": 0.1}, "2": other["body"]["1"]}
    assert hc.Case.from_dict(other).run().approach.values == pytest.approx(result.approach.values, rel=1e-7)


def test_full_contact_is_said(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", logger="hexcontact"):
        hc.Case.from_dict({**flats(), "load": [{"approach": 0.1}]}).run()
    assert "full contact" in caplog.text


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"interface": None},
            "touch everywhere.*or a window that repeats, grid.boundary",
        ),
        ({"grid": {"spacing": 0.1}}, "grid: flat on flat has one unknown: expected spacing and window"),
        ({"load": [{"normal_load": 1.0, "twist": "1 deg"}]}, "load: .*: expected no torque and no twist"),
        ({"friction": {"coefficient": "0.3 + x"}}, "friction.coefficient.*: expected a number"),
        ({"accuracy": {"target": 0.1}}, "accuracy: .*expected no table"),
    ],
)
def test_full_contact_refuses_what_differs_from_node_to_node(change: dict[str, Any], sentence: str) -> None:
    given = {name: table for name, table in {**flats(), **change}.items() if table is not None}
    with pytest.raises(DeckError, match=sentence):
        hc.Case.from_dict(given)


def test_stress_below_a_full_contact_is_refused() -> None:
    with pytest.raises(DeckError, match="full contact"):
        hc.Case.from_dict(flats()).run().stress("von_mises", points=[[0.0, 0.0, 0.1]])


# --- friction of the interface ------------------------------------------------------------------------------


def own_limit(c_t: float, m_t: float | None = None, **more: Any) -> dict[str, Any]:
    """Return a sheared sphere whose interface has a friction limit of its own."""
    given = deck(10.0, 1.5, **FRICTION | more)
    del given["friction"]
    given["interface"] |= {"friction_coefficient": c_t} | ({"friction_exponent": m_t} if m_t else {})
    return given


def test_own_limit_with_the_same_exponent_is_coulomb() -> None:
    one = hc.Case.from_dict(deck(10.0, 1.5, **FRICTION)).run()
    other = hc.Case.from_dict(own_limit(3.0)).run()
    assert np.isnan(other.dataset.attrs["friction_coefficient"])
    for name in ("pressure", "traction_x", "traction_y"):
        assert other[name].values == pytest.approx(one[name].values, abs=1e-7), name


@pytest.mark.parametrize(("m_t", "c_t"), [(1.0, 2.0), (2.5, 30.0)])
@pytest.mark.parametrize("nu", [0.5, 0.3])
def test_own_limit(m_t: float, c_t: float, nu: float) -> None:
    """No traction is above c_t psi^m_t, slip is on it; both methods agree, with coupling, too."""
    given = own_limit(c_t, m_t, grid={"spacing": 0.16})
    given["body"]["1"]["poisson_ratio"] = nu
    results = []
    for method in ("fft", "direct"):
        given["solver"] = {"tolerance": 1e-9, "method": method}
        results.append(hc.Case.from_dict(given).run())
    one, other = results
    for name in ("pressure", "traction_x", "traction_y"):
        assert one[name].values == pytest.approx(other[name].values, abs=1e-6), name
    limit = c_t * np.maximum(-one["gap"].values, 0.0) ** m_t
    shear = np.hypot(one["traction_x"], one["traction_y"]).values
    zone = one["zone"].values
    assert (shear <= limit * (1 + 1e-6) + 1e-7).all()
    assert shear[zone == 2] == pytest.approx(limit[zone == 2], abs=1e-6)
    assert 20 < (zone == 2).sum() < (zone > 0).sum()


def test_rigid_flats_slide_at_their_own_limit() -> None:
    """Q = A c_t delta^m_t."""
    flats = hc.Case(
        body_1={"young_modulus": 1e13, "poisson_ratio": 0.0},
        body_2={"rigid": True},
        gap=lambda x, y: np.where(np.hypot(x, y) < 0.45, 0.0, np.inf),
        lattice=hc.Lattice(0.1, -6, -6, 13, 13),
        interface={
            "coefficient": 2.0,
            "exponent": 2.0,
            "friction_coefficient": 0.7,
            "friction_exponent": 3.0,
        },
        loads=[{"approach": 0.1}, {"shift_x": 0.01}],
        tolerance=1e-10,
    )
    last = flats.run().dataset.isel(step=-1)
    area = float(last["contact_area"])
    assert float(last["normal_load"]) == pytest.approx(area * 2.0 * 0.1**2, rel=1e-6)
    assert float(last["tangential_load_x"]) == pytest.approx(area * 0.7 * 0.1**3, rel=1e-6)


def test_interface_with_friction_by_node() -> None:
    """In full slip the traction is mu(x) c psi^m at each node, with springs, too."""
    case = hc.Case(
        body_1={"young_modulus": 1.0, "poisson_ratio": 0.0, "surface": hc.surfaces.Sphere(radius=1.0)},
        body_2={"rigid": True},
        friction_coefficient="0.3 + 0.1*x",
        interface={"coefficient": 10.0, "exponent": 1.5, "tangential_stiffness": 5.0},
        spacing=0.125,
        loads=[{"normal_load": 4 / 3}, {"shift_x": 3.0}],
        tolerance=1e-9,
    )
    last = case.run().dataset.isel(step=-1)
    mu, psi = 0.3 + 0.1 * last["x"].values, np.maximum(-last["gap"].values, 0.0)
    shear = np.hypot(last["traction_x"], last["traction_y"]).values
    assert shear == pytest.approx(mu * 10.0 * psi**1.5, abs=1e-7)


@pytest.mark.parametrize(
    ("interface", "friction", "sentence"),
    [
        (
            {"friction_coefficient": -1.0},
            None,
            "interface.friction_coefficient = -1.0: expected a coefficient in",
        ),
        ({"friction_coefficient": "1 GPa"}, None, "is a pressure"),
        ({"friction_exponent": 2.0}, None, "interface.friction_exponent = 2.0: expected nothing"),
        (
            {"friction_coefficient": 1.0, "friction_exponent": -1.0},
            None,
            "interface.friction_exponent = -1.0",
        ),
        (
            {"friction_coefficient": 1.0},
            {"coefficient": 0.3},
            "interface.friction_coefficient = 1.0: expected nothing",
        ),
    ],
)
def test_wrong_limits(interface: dict[str, Any], friction: Any, sentence: str) -> None:
    given = deck(10.0, 2.0) | ({"friction": friction} if friction else {})
    given["interface"] |= interface
    with pytest.raises(DeckError) as caught:
        hc.Case.from_dict(given)
    assert sentence in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("drive", [{"normal_load": 4 / 3}, {"approach": 1.0}])
@pytest.mark.parametrize("gap", ["sphere", "array", "flat"])
@pytest.mark.parametrize(("c", "m"), [(1e-300, 1.0), (1e-300, 20.0), (1e-40, 1.0)])
def test_an_interface_far_softer_than_the_bodies_is_refused(
    c: float, m: float, gap: str, drive: dict[str, float]
) -> None:
    """E* = 1 Pa and sizes of about 1 m, so that the ratio of stiffnesses is that of the numbers."""
    given = flats(load=[drive]) if gap == "flat" else deck(c, m, load=[drive])
    given["interface"] = {"coefficient": c, "exponent": m}
    with pytest.raises(
        DeckError, match=r"^interface.coefficient = .*: expected at least 1e-?\d+: .* 1e-\d+ times"
    ):
        if gap == "array":
            lattice = Lattice(0.1, -10, -10, 21, 21)
            body = {"young_modulus": 1.0, "poisson_ratio": 0.0}
            layer = {"coefficient": c, "exponent": m}
            hc.Case(
                body_1=body,
                body_2={"rigid": True},
                gap=0.5 * (lattice.x**2 + lattice.y**2),
                lattice=lattice,
                interface=layer,
                **drive,  # type: ignore[arg-type]
            )
        else:
            hc.Case.from_dict(given)


@pytest.mark.parametrize("stiffness", [1e-40, 1e40])
def test_springs_of_a_full_contact_are_of_a_size_with_the_bodies(stiffness: float) -> None:
    given = flats()
    given["interface"] = given["interface"] | {"tangential_stiffness": stiffness}
    with pytest.raises(
        DeckError, match=r"^interface.tangential_stiffness = 1e[+-]40: expected at (least|most) 1e"
    ):
        hc.Case.from_dict(given)


def test_full_contact_on_a_stiff_interface_is_even() -> None:
    """p = P/A at every node and shift = Q/(A k_T), 1e6 times as stiff as the bodies."""
    given = flats()
    given["interface"] = {"exponent": 1.0, "coefficient": 1e9, "tangential_stiffness": 1e9}
    result = hc.Case.from_dict(given | {"load": [{"normal_load": 2.0}, {"tangential_load_x": 0.6}]}).run()
    area = 121 * np.sqrt(0.75) * 0.01
    assert result.pressure.values[-1] == pytest.approx(2.0 / area, rel=1e-6)
    assert result.traction_x.values[-1] == pytest.approx(0.6 / area, rel=1e-6)
    assert float(result.shift_x[-1]) == pytest.approx(0.6 / area / 1e9, rel=1e-6)


def test_a_full_contact_without_springs_has_no_share_of_a_tangential_load() -> None:
    given = flats()
    del given["interface"]["tangential_stiffness"]
    with pytest.raises(
        DeckError, match=r"^interface.tangential_stiffness: missing; flat on flat has one unknown"
    ):
        hc.Case.from_dict(given)
    hc.Case.from_dict(given | {"load": [{"normal_load": 2.0}, {"shift_x": 1.0}]})  # slides as a whole
