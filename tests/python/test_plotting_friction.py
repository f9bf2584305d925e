"""Pictures of results with friction: what they show is what the result says.

The results here are laid out by `layout.assemble` from closed solutions: spheres with E* = 2,
gamma = 0.4, mu = 0.3, pressed by P = 0.8 and sheared or twisted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import drawn
import matplotlib
import numpy as np
import pytest
import xarray
from drawn import area, by_label, si, units
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.quiver import Quiver

from hexcontact import Case, analytic, plotting
from hexcontact.analytic import compare as closed_forms
from hexcontact.analytic.compare import ClosedForms
from hexcontact.analytic.friction import LubkinTorsion, MindlinContact
from hexcontact.core.edges import ContactEdges
from hexcontact.core.lattice import Lattice
from hexcontact.plotting.history import initial_compliance, panels_of
from hexcontact.plotting.registry import entries
from hexcontact.result.html import SLIP, STICK
from hexcontact.result.layout import Metadata, assemble
from hexcontact.result.step import Step
from hexcontact.result.view import StepView

MODULUS, GAMMA, MU, LOAD, RADIUS = 2.0, 0.4, 0.3, 0.8, 1.5
HERTZ = analytic.hertz_sphere(MODULUS, RADIUS, normal_load=LOAD)
MINDLIN = MindlinContact(MU, LOAD, HERTZ.contact_radius, 4.0 / MODULUS * (1.0 + GAMMA / 2.0))
LUBKIN = LubkinTorsion(MU, LOAD, HERTZ.contact_radius, 2.0 / MODULUS * (1.0 + GAMMA))
SLIDING = MU * LOAD
Field = Callable[[np.ndarray, np.ndarray], np.ndarray]


def nothing(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.zeros_like(x)


@dataclass(frozen=True)
class Made:
    """What a load step came to; fields are functions of (x, y)."""

    q_x: Field = nothing
    q_y: Field = nothing
    stick: Field = nothing
    slip_x: Field = nothing
    slip_y: Field = nothing
    load: float = LOAD
    history: dict[str, float] = field(default_factory=dict)


def sphere_gap(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (x**2 + y**2) / (2 * RADIUS)


def made(
    steps: Sequence[Made],
    spacing: float = 0.07,
    half: int = 14,
    gap: Field = sphere_gap,
    pressure: Callable[[float], Field] | None = None,
    **attributes: Any,
) -> xarray.Dataset:
    lattice = Lattice(spacing, -half, -half, 2 * half + 1, 2 * half + 1)
    x, y = lattice.x, lattice.y

    def hertz(load: float) -> Field:
        return lambda x, y: analytic.hertz_sphere(MODULUS, RADIUS, normal_load=load).pressure(np.hypot(x, y))

    parameters = {
        "effective_modulus": MODULUS,
        "dundurs_beta": 0.0,
        "tangential_compliance_ratio": GAMMA,
        "friction_coefficient": MU,
        "algorithm": "incremental",
        "coupling": "full",
        "tolerance": 1e-8,
        **attributes,
    }
    done = []
    for index, step in enumerate(steps):
        p = (pressure or hertz)(step.load)(x, y)
        stick = (step.stick(x, y) > 0) & (p > 0)
        fields = {
            "initial_gap": gap(x, y),
            "pressure": p,
            "traction_x": step.q_x(x, y),
            "traction_y": step.q_y(x, y),
            "zone": np.where(p > 0, np.where(stick, 1, 2), 0),
            "slip_increment_x": step.slip_x(x, y),
            "slip_increment_y": step.slip_y(x, y),
            "accumulated_slip": np.hypot(step.slip_x(x, y), step.slip_y(x, y)),
            "dissipation_density": MU * p * np.hypot(step.slip_x(x, y), step.slip_y(x, y)),
        }
        area = lattice.cell_area
        history = {
            **dict.fromkeys(("tangential_load_x", "tangential_load_y", "torque"), 0.0),
            **dict.fromkeys(("shift_x", "shift_y", "twist", "dissipated_energy"), 0.0),
            "normal_load": step.load,
            "approach": 0.3 * step.load,
            "contact_area": area * float((p > 0).sum()),
            "stick_area": area * float(stick.sum()),
            "contact_radius": np.sqrt(area * float((p > 0).sum()) / np.pi),
            "max_pressure": float(p.max()),
            "max_traction": float(np.hypot(fields["traction_x"], fields["traction_y"]).max()),
            "segment": 1 if index == 0 else 2,
            "label": "press" if index == 0 else "shear",
            **step.history,
        }
        done.append(Step(index, lattice, fields, history))
    return assemble(Metadata(title="Made up", planned_steps=len(done), parameters=parameters), done)


def sheared(load: float, peak: float | None = None, angle: float = 0.0, **more: Any) -> Made:
    """Return a step of Cattaneo-Mindlin, or of Mindlin-Deresiewicz back from a peak."""
    e_x, e_y = np.cos(angle), np.sin(angle)
    if peak is None:
        traction = lambda r: MINDLIN.traction(r, load)  # noqa: E731
        shift, c = float(MINDLIN.shift(load)), float(MINDLIN.stick_radius(load))
    else:
        traction = lambda r: MINDLIN.traction_unloading(r, load, peak)  # noqa: E731
        shift = float(MINDLIN.shift_unloading(load, peak))
        c = float(MINDLIN.stick_radius(0.5 * (peak - load)))
    return Made(
        q_x=lambda x, y: e_x * traction(np.hypot(x, y)),
        q_y=lambda x, y: e_y * traction(np.hypot(x, y)),
        stick=lambda x, y: np.hypot(x, y) <= c,
        slip_x=lambda x, y: np.where((np.hypot(x, y) > c) & (np.hypot(x, y) < 0.7), -1e-3 * e_x, 0.0),
        slip_y=lambda x, y: np.where((np.hypot(x, y) > c) & (np.hypot(x, y) < 0.7), -1e-3 * e_y, 0.0),
        history={
            "tangential_load_x": e_x * load,
            "tangential_load_y": e_y * load,
            "shift_x": e_x * shift,
            "shift_y": e_y * shift,
        },
        **more,
    )


PRESSED = Made(stick=lambda x, y: np.ones_like(x))
SHARES = (0.2, 0.5, 0.8)


def cattaneo(**more: Any) -> xarray.Dataset:
    return made([PRESSED, *(sheared(share * SLIDING) for share in SHARES)], **more)


def loop(**more: Any) -> xarray.Dataset:
    """Up to 0.6 of the sliding load and back to -0.6 of it."""
    peak = 0.6 * SLIDING
    down = (0.3 * SLIDING, 0.0, -0.3 * SLIDING, -peak)
    return made([PRESSED, sheared(0.3 * SLIDING), sheared(peak), *(sheared(q, peak) for q in down)], **more)


def dissimilar() -> xarray.Dataset:
    """An off-center stick zone; the tractions are not those of any theory."""
    steps = [
        Made(
            q_x=lambda x, y, s=s: s * SLIDING * np.exp(-((x - 0.2) ** 2) - y**2),
            q_y=lambda x, y: 0.1 * x * y,
            stick=lambda x, y: np.hypot(x - 0.25, 1.3 * y) < 0.3,
            history={"tangential_load_x": s * SLIDING, "shift_x": 1.1 * float(MINDLIN.shift(s * SLIDING))},
        )
        for s in SHARES
    ]
    return made([PRESSED, *steps], dundurs_beta=-0.19)


def torsion() -> xarray.Dataset:
    radii = (0.8, 0.5, 0.3)
    steps = [
        Made(history={"torque": LUBKIN.torque(c), "twist": LUBKIN.twist(c)})
        for c in (r * HERTZ.contact_radius for r in radii)
    ]
    return made([PRESSED, *steps])


def rolling() -> xarray.Dataset:
    """Return a pressed contact that then creeps, along x and with a spin in the last step."""
    still = dict.fromkeys(("creepage_x", "creepage_y", "spin", "creep_power", "slip_power"), 0.0)
    steps = [
        Made(
            history={
                **still,
                "tangential_load_x": load * SLIDING,
                "creepage_x": -creepage,
                "rolled_distance": 0.0,
                "torque": torque,
                "spin": 0.01 * (torque != 0.0),
            }
        )
        for load, creepage, torque in ((0.3, 0.1, 0.0), (0.5, 0.2, 0.0), (0.45, 0.2, -0.02))
    ]
    pressed = Made(history={**still, "rolled_distance": np.nan})
    return made([pressed, *steps])


def test_creep_forces_are_drawn_over_the_creepage_up_to_a_spin() -> None:
    [force, torque] = [line for line in plotting.creep(rolling()).axes[0].lines if len(line.get_xdata()) > 2]
    np.testing.assert_allclose(force.get_xdata(), [-0.1, -0.2, np.nan, -0.2])
    np.testing.assert_allclose(force.get_ydata(), [0.3, 0.5, np.nan, 0.45])
    assert [line.get_label() for line in (force, torque)] == ["Qx", "Mz / radius"]
    with pytest.raises(ValueError, match="in place of shifts"):
        plotting.loop(rolling())


def frictionless() -> xarray.Dataset:
    result = made([PRESSED], algorithm="frictionless", friction_coefficient=0.0)
    return result.drop_vars(
        [name for name in result.data_vars if name.startswith(("traction", "slip", "shift"))]
    )


# ----------------------------------------------------------------------------------- closed solutions


@pytest.mark.parametrize(
    ("loads", "turns"),
    [
        ([1.0], [1.0]),
        ([1.0, 2.0], [2.0]),
        ([2.0, 1.0], [2.0, 1.0]),
        ([2.0, 1.0, -1.0], [2.0, -1.0]),
        ([2.0, -1.0, 1.0], [2.0, -1.0, 1.0]),
        ([2.0, -1.0, 1.0, 0.0, 1.5], [2.0, -1.0, 1.5]),  # the small loop is forgotten
        ([2.0, -1.0, 2.5], [2.5]),  # back on the first loading
        ([2.0, -2.0], [-2.0]),  # as if it had been loaded to the other side at once
        ([2.0, -3.0, 1.0], [-3.0, 1.0]),
        ([0.0, 1.0], [1.0]),
    ],
)
def test_turning_points_that_are_remembered(loads: list[float], turns: list[float]) -> None:
    assert closed_forms.turning_points(loads) == turns


def test_superposition_is_that_of_mindlin_and_deresiewicz() -> None:
    r = np.linspace(0.0, 1.1 * HERTZ.contact_radius, 57)
    peak = 0.7 * SLIDING
    for load in np.array([0.4, 0.0, -0.3, -0.69]) * SLIDING:
        turns = closed_forms.turning_points([0.2 * SLIDING, peak, load])
        found = closed_forms.superposed(lambda q: MINDLIN.traction(r, q), turns)
        np.testing.assert_allclose(found, MINDLIN.traction_unloading(r, load, peak), atol=1e-14)
        moved = closed_forms.superposed(MINDLIN.shift, turns)
        assert float(moved) == pytest.approx(float(MINDLIN.shift_unloading(load, peak)), abs=1e-15)
    # -Q* has the mirror image of Q*, and a closed cycle ends where it began
    there = closed_forms.superposed(MINDLIN.shift, closed_forms.turning_points([peak, -peak]))
    assert float(there) == pytest.approx(-float(MINDLIN.shift(peak)))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(-0.95, 0.95), min_size=1, max_size=8))
def test_superposition_carries_the_load_it_is_for(shares: list[float]) -> None:
    """The resultant of the traction over the circle is the load, whatever the history; |q| <= mu p."""
    turns = closed_forms.turning_points([share * SLIDING for share in shares])
    square = (np.arange(20_000) + 0.5) / 20_000 * HERTZ.contact_radius**2  # r^2, in equal steps
    r = np.sqrt(square)
    q = closed_forms.superposed(lambda load: MINDLIN.traction(r, load), turns)
    total = np.pi * HERTZ.contact_radius**2 * float(q.mean())
    assert total == pytest.approx(shares[-1] * SLIDING, abs=1e-5 * SLIDING)
    assert np.all(np.abs(q) <= MU * HERTZ.pressure(r) + 1e-12)


def test_partial_slip_is_recognized() -> None:
    closed = ClosedForms(cattaneo())
    assert closed.partial_slip(1) is None  # not sheared yet
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 31), np.linspace(-0.9, 0.9, 33))
    for number, share in enumerate(SHARES, start=2):
        found = closed.partial_slip(number)
        assert found is not None
        assert found.name == "Cattaneo–Mindlin"
        assert found.stick_ratio == pytest.approx((1.0 - share) ** (1 / 3), rel=1e-6)
        q_x, q_y = found.traction(x, y)
        np.testing.assert_allclose(q_x, MINDLIN.traction(np.hypot(x, y), share * SLIDING), atol=1e-6)
        assert np.abs(q_y).max() == 0.0
    back = ClosedForms(loop()).partial_slip(5)
    assert back is not None
    assert back.name == "Mindlin–Deresiewicz"
    expected = MINDLIN.traction_unloading(np.hypot(x, y), 0.0, 0.6 * SLIDING)
    np.testing.assert_allclose(back.traction(x, y)[0], expected, atol=1e-6)
    assert back.stick_ratio == pytest.approx(0.7 ** (1 / 3), rel=1e-6)


@pytest.mark.parametrize("angle", [0.7, 2.5])
def test_partial_slip_along_any_line(angle: float) -> None:
    found = ClosedForms(made([PRESSED, sheared(0.5 * SLIDING, angle=angle)])).partial_slip(2)
    assert found is not None
    q_x, q_y = found.traction(np.array([0.3]), np.array([0.2]))
    q = MINDLIN.traction(np.hypot(0.3, 0.2), 0.5 * SLIDING)
    assert (q_x[0], q_y[0]) == pytest.approx((q * np.cos(angle), q * np.sin(angle)), rel=1e-6)


def test_partial_slip_over_an_ellipse() -> None:
    hessian = np.array([[1.0, 0.3], [0.3, 0.5]])
    ellipse = analytic.hertz_ellipse(MODULUS, hessian, normal_load=LOAD)
    form = lambda x, y: 0.5 * (hessian[0, 0] * x**2 + 2 * hessian[0, 1] * x * y + hessian[1, 1] * y**2)  # noqa: E731
    result = made(
        [PRESSED, sheared(0.5 * SLIDING)], gap=form, pressure=lambda load: ellipse.pressure, half=20
    )
    found = ClosedForms(result).partial_slip(2)
    assert found is not None
    x, y = np.meshgrid(np.linspace(-2, 2, 401), np.linspace(-2, 2, 401))
    q = found.traction(x, y)[0]
    # the load is carried, slip obeys Coulomb's law, and the stick area is a smaller ellipse of the same form
    assert q.sum() * 0.01**2 == pytest.approx(0.5 * SLIDING, rel=1e-3)
    slips = np.abs(q - MU * ellipse.pressure(x, y)) < 1e-9
    c = found.stick_ratio
    np.testing.assert_array_equal(slips, ellipse.pressure(x / c, y / c) == 0.0)
    assert ClosedForms(result).shear_loop() is None  # the motion is known for a circle only


def replaced(step: Made, **history: float) -> Made:
    return Made(
        step.q_x, step.q_y, step.stick, step.slip_x, step.slip_y, step.load, {**step.history, **history}
    )


NOT_CLOSED = {
    "dissimilar bodies": lambda: cattaneo(dundurs_beta=0.1),
    "no slip": lambda: cattaneo(friction_coefficient=np.inf),
    "frictionless": lambda: cattaneo(algorithm="frictionless"),
    "pressed while sheared": lambda: made([Made(load=0.5), sheared(0.5 * SLIDING)]),
    "twisted": lambda: made([PRESSED, replaced(sheared(0.5 * SLIDING), twist=0.1)]),
    "more than friction carries": lambda: made(
        [PRESSED, replaced(sheared(0.5 * SLIDING), tangential_load_x=1.2 * SLIDING)]
    ),
    "no quadratic gap": lambda: cattaneo(gap=lambda x, y: np.hypot(x, y)),
}


@pytest.mark.parametrize("why", NOT_CLOSED)
def test_no_closed_solution_where_there_is_none(why: str) -> None:
    result = NOT_CLOSED[why]()
    closed = ClosedForms(result)
    assert closed.partial_slip(int(result["step"][-1])) is None
    assert closed.shear_loop() is None
    assert closed.torsion_loop() is None


def test_closed_solution_ends_where_the_load_leaves_its_line() -> None:
    closed = ClosedForms(made([PRESSED, sheared(0.3 * SLIDING, angle=1.0), sheared(0.5 * SLIDING)]))
    assert closed.partial_slip(2) is not None
    assert closed.partial_slip(3) is None
    curve = closed.shear_loop()
    assert curve is not None
    assert curve[1].max() == pytest.approx(0.3 * SLIDING)


def test_static_steps_stand_alone() -> None:
    """Without a history the way does not matter: pressed and sheared at once, and not turned back."""
    static = made([Made(load=0.5), sheared(0.5 * SLIDING), sheared(0.3 * SLIDING)], algorithm="static")
    for number, share in ((2, 0.5), (3, 0.3)):
        found = ClosedForms(static).partial_slip(number)
        assert found is not None
        assert found.turns == pytest.approx((share * SLIDING,))


def test_a_held_load_is_no_reversal() -> None:
    held = replaced(sheared(0.5 * SLIDING), tangential_load_x=0.5 * SLIDING * (1 - 1e-9))
    found = ClosedForms(made([PRESSED, sheared(0.5 * SLIDING), held])).partial_slip(3)
    assert found is not None
    assert found.turns == pytest.approx((0.5 * SLIDING,))


# ----------------------------------------------------------------------------------- sections


def test_tractions_of_a_step() -> None:
    result = cattaneo()
    upper, lower = plotting.tractions(result, 3).axes
    row = result.sel(step=3, row=0)
    nodes = {round(float(x), 9): k for k, x in enumerate(row["x"].values)}
    for axes, name, label, factor in (
        (upper, "pressure", "computed", 1.0),
        (lower, "traction_x", "$q_x$", 1.0),
        (lower, "traction_y", "$q_y$", 1.0),
        (lower, "pressure", r"$\mu p$", MU),
    ):
        x, values = si(lower, by_label(axes)[label])
        values = values / units(lower.get_ylabel()) * units(axes.get_ylabel())
        met = {k: v for place, v in zip(x, values, strict=True) if (k := nodes.get(round(float(place), 9)))}
        if label == r"$\mu p$":  # drawn between the nodes, too
            line = StepView(result, 3).at(x, 0.0 * x, factor * result.sel(step=3)[name].values)
            np.testing.assert_allclose(values, line, atol=1e-9)
            continue
        assert len(met) > 15
        np.testing.assert_allclose(list(met.values()), factor * row[name].values[list(met)], atol=1e-12)
    x, q = si(lower, by_label(lower)["Cattaneo–Mindlin"])
    np.testing.assert_allclose(q, MINDLIN.traction(np.abs(x), 0.5 * SLIDING), atol=1e-6)
    upper.set_xlabel(lower.get_xlabel())
    x, p = si(upper, by_label(upper)["Hertz"])
    np.testing.assert_allclose(p, HERTZ.pressure(np.abs(x)), atol=1e-6)


@pytest.mark.parametrize(
    ("share", "label", "sides"),
    [(0.5, r"$\mu p$", {1.0}), (-0.5, r"$-\mu p$", {-1.0}), (0.0, r"$\mu p$", {1.0})],
)
def test_what_friction_carries_is_shown_whole_on_the_sides_used(
    share: float, label: str, sides: set[float]
) -> None:
    lower = plotting.tractions(made([PRESSED, sheared(share * SLIDING)]), 2).axes[1]
    bounds = [line for line in lower.lines if "mu" in str(line.get_label())]
    low, high = lower.get_ylim()
    assert {float(np.sign(np.sum(line.get_ydata()))) for line in bounds} == sides
    assert all(low < y < high for line in bounds for y in np.asarray(line.get_ydata()))
    assert label in by_label(lower)
    assert (low < -0.5 * high) == (sides == {-1.0})


@pytest.mark.parametrize("degrees", [30.0, 90.0, 120.0, 180.0])
def test_tractions_along_and_across_a_line_of_nodes(degrees: float) -> None:
    result = dissimilar()
    angle = np.radians(degrees)
    lower = plotting.tractions(result, 3, angle=angle).axes[1]
    along, across = [line for line in lower.lines if line.get_marker() == "o"]
    s, q_along = si(lower, along)
    _, q_across = si(lower, across)
    one = result.sel(step=3)
    x, y = one["x"].values, one["y"].values
    for place, first, second in zip(s, q_along, q_across, strict=True):
        away = np.hypot(x - place * np.cos(angle), y - place * np.sin(angle))
        at = away.argmin()
        if away.flat[at] > 1e-9:  # beyond the window
            assert abs(place) > HERTZ.contact_radius
            continue
        q = one["traction_x"].values.flat[at], one["traction_y"].values.flat[at]
        assert first == pytest.approx(q[0] * np.cos(angle) + q[1] * np.sin(angle), abs=1e-12)
        assert second == pytest.approx(q[1] * np.cos(angle) - q[0] * np.sin(angle), abs=1e-12)
    # no closed solution, no Hertz
    assert not [label for label in by_label(lower) if "Mindlin" in label]


def test_tractions_along_an_oblique_line_through_a_point() -> None:
    result = made(
        [PRESSED, Made(q_x=lambda x, y: 0.1 + 0.05 * x, q_y=lambda x, y: -0.02 * y)], dundurs_beta=0.3
    )
    angle, through = np.radians(20.0), (0.1, -0.2)
    lower = plotting.tractions(result, 2, angle=angle, through=through).axes[1]
    s, q_along = si(lower, by_label(lower)["$q$ along the line"])
    x, y = through[0] + s * np.cos(angle), through[1] + s * np.sin(angle)
    expected = (0.1 + 0.05 * x) * np.cos(angle) - 0.02 * y * np.sin(angle)
    np.testing.assert_allclose(q_along, expected, atol=1e-9)  # the field is linear, and so is what is drawn
    assert lower.get_xlabel() == "distance from (100, -200) mm along 20° (m)"


@pytest.mark.usefixtures("laid_out_once")
def test_a_family_of_tractions() -> None:
    result = loop()
    steps = [3, 4, 5, 7]
    figure = plotting.tractions(result, steps, source="nodes")
    pressure, q_x, scale = figure.axes  # q_y is zero and has no panel
    assert q_x.get_ylabel().startswith("$q_x$")
    peak = 0.6 * SLIDING
    closed = [line for line in q_x.lines if len(line.get_xdata()) == 1001]
    bounds = [line for line in q_x.lines if line.get_linestyle() == ":"]
    drawn = [line for line in q_x.lines[1:] if line not in [*closed, *bounds]]
    assert len(bounds) == 2  # mu p on both sides, since the traction lies on both
    assert [np.sign(line.get_ydata()[np.abs(line.get_ydata()).argmax()]) for line in bounds] == [1.0, -1.0]
    loads = (peak, 0.3 * SLIDING, 0.0, -peak)
    assert len(drawn) == len(closed) == len(steps)
    for joined, curve, load in zip(drawn, closed, loads, strict=True):
        assert curve.get_color() == "black"
        for line, tolerance in ((joined, 1e-9), (curve, 1e-5)):
            x, q = si(q_x, line)
            at_nodes = np.isin(x.round(9), result.x.values.round(9)) | (line is curve)
            x, q = x[at_nodes], q[at_nodes]
            np.testing.assert_allclose(
                q, MINDLIN.traction_unloading(np.abs(x), load, peak), atol=tolerance * peak
            )
    assert len({line.get_color() for line in drawn}) == len(steps)
    texts = [text.get_text() for text in scale.get_yticklabels()]
    assert texts == [
        "step 3, $Q/\\mu P$ = 0.60",
        "step 4, $Q/\\mu P$ = 0.30",
        "step 5",
        "step 7, $Q/\\mu P$ = −0.60",
    ]
    [legend] = figure.legends
    assert "Mindlin–Deresiewicz" in legend.get_texts()[-1].get_text()
    assert len(pressure.lines) == 2 * len(steps)
    # Q along y: the component across the line is the one that is not zero
    across = made([PRESSED, *(sheared(s * SLIDING, angle=np.pi / 2) for s in SHARES)])
    assert [axes.get_ylabel()[:5] for axes in plotting.tractions(across, [2, 3]).axes[1:-1]] == ["$q_y$"]


def test_of_many_steps_some_are_named() -> None:
    result = made([PRESSED, *(sheared(share * SLIDING) for share in np.linspace(0.05, 0.8, 16))])
    _, q_x, scale = plotting.tractions(result, range(2, 18)).axes
    assert len(scale.get_yticklabels()) == 10
    assert not [
        line for line in q_x.lines if len(line.get_xdata()) == 1001
    ]  # closed solutions would hide them


def test_a_family_along_an_oblique_line_is_drawn_over() -> None:
    angle = np.radians(40.0)
    _, along, across, _ = plotting.tractions(cattaneo(), [2, 4], angle=angle).axes
    for axes, part in ((along, np.cos(angle)), (across, -np.sin(angle))):
        dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
        assert len(dashed) == 2 and {line.get_color() for line in dashed} == {"black"}
        for line, share in zip(dashed, (0.2, 0.8), strict=True):
            s, q = np.asarray(line.get_data()) * units(across.get_xlabel())
            q = q / units(across.get_xlabel()) * units(axes.get_ylabel())
            np.testing.assert_allclose(q, part * MINDLIN.traction(np.abs(s), share * SLIDING), atol=1e-6)


def test_a_family_without_closed_solution_has_none() -> None:
    figure = plotting.tractions(dissimilar(), [2, 3, 4])
    assert [
        len(line.get_xdata()) for axes in figure.axes for line in axes.lines if len(line.get_xdata()) == 1001
    ] == []
    [legend] = figure.legends
    assert not [text for text in legend.get_texts() if "Hertz" in text.get_text()]


def test_section_of_dissimilar_bodies_says_that_hertz_has_no_friction() -> None:
    upper, lower = plotting.section(dissimilar(), 3).axes
    assert "Hertz (no friction)" in by_label(upper)
    assert lower.get_ylabel().startswith("difference")
    assert "Hertz" in by_label(plotting.section(cattaneo(), 3).axes[0])


# ----------------------------------------------------------------------------------- zones


BASIS = np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])


@settings(max_examples=60, deadline=None)
@given(arrays.arrays(np.int8, st.tuples(*[st.integers(1, 9)] * 2), elements=st.integers(0, 2)), st.booleans())
def test_outline_encloses_the_nodes_of_the_zone(kinds: np.ndarray, has_rims: bool) -> None:
    """Kinds of nodes: 0 outside, 1 in contact, 2 where nothing can touch."""
    zone, candidate = kinds == 1, kinds < 2 if has_rims else kinds < 3
    edges = ContactEdges(1.0 * zone, 1.0 * ~zone, zone, candidate, BASIS, (3.0, -2.0))
    mesh = edges.mesh(np.ones(zone.shape), vanishes=False)
    polygons, at = mesh.outlines(), np.stack([mesh.x, mesh.y], axis=-1)
    a, b = (at[mesh.triangles[:, k]] - at[mesh.triangles[:, 0]] for k in (1, 2))
    areas = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert (areas > -1e-12).all() and (mesh.values == 1.0).all()
    assert area(polygons) == pytest.approx(areas.sum(), abs=1e-9)
    # In triangles at a rim a third counts for each node, and the mesh is straight between the middles of
    # links: it has a quarter of one with one node inside, and three quarters of one with two. It goes to 0.54
    # of a link, not to half of it, where these fields let the edge run between other nodes: up to 0.77.
    whole = edges.edge().area
    assert (0.75 - 1e-9) * whole <= area(polygons) <= 1.16 * whole
    row, col = np.indices(zone.shape)
    nodes = np.array([3.0, -2.0]) + np.stack([col, row], axis=-1) @ BASIS
    winding = np.zeros(zone.shape)
    for polygon in polygons:
        assert polygon[0] == pytest.approx(polygon[-1])
        from_node = polygon - nodes[..., None, :]
        angle = np.unwrap(np.arctan2(from_node[..., 1], from_node[..., 0]), axis=-1)
        winding += (angle[..., -1] - angle[..., 0]) / (2 * np.pi)
    np.testing.assert_allclose(winding, zone, atol=1e-9)  # each node of the zone is inside, no other


def patch_area(patch: PathPatch, factor: float) -> float:
    return area([polygon * factor for polygon in patch.get_path().to_polygons(closed_only=False)])


@pytest.mark.usefixtures("laid_out_once")
def test_zone_maps_fill_contact_and_stick_area() -> None:
    result = dissimilar()
    figure = plotting.zones(result, [2, 3, 4])
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title() for axes in panels] == [
        "step 2, $Q/\\mu P$ = 0.20", "step 3, $Q/\\mu P$ = 0.50", "step 4, $Q/\\mu P$ = 0.80"
    ]  # fmt: skip
    factor = units(panels[0].get_ylabel())
    for axes, step in zip(panels, (2, 3, 4), strict=True):
        contact, stick = axes.patches
        drawn.are_zones(axes, StepView(result, step))
        assert patch_area(contact, factor) == pytest.approx(float(result["contact_area"][step - 1]), rel=0.05)
        [hertz] = axes.lines
        assert np.ptp(hertz.get_xdata()) * factor == pytest.approx(2 * HERTZ.contact_radius, rel=1e-4)
        assert stick.get_path().vertices[:, 0].mean() * factor == pytest.approx(0.25, abs=0.05)  # off center
    [legend] = figure.legends
    handles = dict(zip([text.get_text() for text in legend.get_texts()], legend.legend_handles, strict=True))
    assert to_hex(handles["stick"].get_facecolor()) == STICK.lower()
    assert to_hex(handles["slip"].get_facecolor()) == SLIP.lower()


def test_places_without_a_map_stay_empty() -> None:
    figure = plotting.zones([cattaneo()] * 5, 4)  # in three columns
    assert [axes.get_visible() for axes in figure.axes] == [True] * 5 + [False]


@pytest.mark.usefixtures("laid_out_once")
def test_zone_maps_of_steps_differ_as_their_zones_do() -> None:
    panels = drawn.visible(plotting.zones(cattaneo(), [2, 4]))
    for axes, step in zip(panels, (2, 4), strict=True):
        drawn.are_zones(axes, StepView(cattaneo(), step))
    shrunk = [patch_area(axes.patches[1], units(panels[0].get_ylabel())) for axes in panels]
    assert shrunk[1] < 0.5 * shrunk[0]


def test_zone_map_shows_the_closed_stick_area() -> None:
    figure = plotting.zones(cattaneo(), 3, arrows="slip")
    [axes] = figure.axes
    factor = units(axes.get_xlabel())
    _, exact = axes.lines
    assert np.ptp(exact.get_xdata()) * factor == pytest.approx(
        2 * float(MINDLIN.stick_radius(0.5 * SLIDING)), rel=1e-4
    )
    [arrows] = [child for child in axes.get_children() if isinstance(child, Quiver)]
    assert arrows.N > 10
    assert np.all(arrows.U == -1e-3)  # against Q: the traction on body 1 opposes its slip
    assert np.all(arrows.V == 0.0)
    [arrows] = [
        c
        for c in plotting.zones(cattaneo(), 3, arrows="traction").axes[0].get_children()
        if isinstance(c, Quiver)
    ]
    radius = np.hypot(*(np.asarray(at) * factor for at in (arrows.X, arrows.Y)))
    np.testing.assert_allclose(arrows.U, MINDLIN.traction(radius, 0.5 * SLIDING), rtol=1e-9)


def test_arrows_across_a_slender_contact_end_inside_the_picture() -> None:
    """Also on the map whose scale across is larger."""
    deck = Path(__file__).parents[2] / "cases/slender_contact.toml"
    result = Case.from_toml(deck, {"load.2.steps": 1}).run()
    axes = plotting.zones(result, arrows="traction").axes[0]
    [arrows] = [child for child in axes.get_children() if isinstance(child, Quiver)]
    assert arrows.N > 5
    half = 0.5 * np.asarray(arrows.V) / arrows.scale
    low, high = axes.get_ylim()
    assert np.min(np.minimum(arrows.Y - abs(half) - low, high - arrows.Y - abs(half))) > 0.0
    assert np.max(abs(half)) > 0.1 * (high - low)


@pytest.mark.usefixtures("laid_out_once")
def test_zones_of_several_results() -> None:
    panels = drawn.visible(plotting.zones([cattaneo(), dissimilar()], [2, 4]))
    views = [StepView(result, step) for result in (cattaneo(), dissimilar()) for step in (2, 4)]
    for axes, view in zip(panels, views, strict=True):
        drawn.are_zones(axes, view, units(panels[0].get_ylabel()))
    with pytest.raises(ValueError, match="a contact without friction has no stick and slip zones"):
        plotting.zones([cattaneo(), frictionless()])


@pytest.mark.usefixtures("laid_out_once")
def test_outlines_of_stick_areas() -> None:
    result = dissimilar()
    axes = plotting.outlines(result, [2, 3]).axes[0]
    factor = units(axes.get_xlabel())
    sticks = [line for line in axes.lines if "step" in line.get_label()]
    assert len(sticks) == 2
    for line, step in zip(sticks, (2, 3), strict=True):
        enclosed = area([np.stack(line.get_data(), axis=1) * factor])
        view = StepView(result, step)
        assert enclosed == pytest.approx(view.edges().edge(view.stick, view.reserve).area)
    contacts = [line for line in axes.lines if str(line.get_label()).startswith("_")]
    assert len(contacts) == 2
    for line in contacts:
        enclosed = area([np.stack(line.get_data(), axis=1) * factor])
        assert enclosed == pytest.approx(view.edges().edge().area)
    slid = made([PRESSED, Made(history={"tangential_load_x": SLIDING})])
    assert "step 2, $Q/\\mu P$ = 1.00 (no stick)" in by_label(plotting.outlines(slid).axes[0])


def test_boundary_tells_sticking_nodes_apart() -> None:
    result = dissimilar()
    figure = plotting.contact_boundary(result, 3)
    lines = by_label(figure.axes[0])
    one = result.sel(step=3)
    for label, zone, color in (("stick", 1, STICK), ("slip", 2, SLIP)):
        x, y = si(figure.axes[0], lines[label])
        nodes = one["zone"].values == zone
        assert len(x) == nodes.sum() > 5
        np.testing.assert_allclose(
            np.stack([x, y]), [one["x"].values[nodes], one["y"].values[nodes]], atol=1e-12
        )
        assert lines[label].get_markerfacecolor() == color
    [name] = [label for label in lines if label.startswith("stick: ellipse")]
    x, y = si(figure.axes[0], lines[name])
    assert (x.mean(), y.mean()) == pytest.approx((0.25, 0.0), abs=0.01)
    assert (np.ptp(x), np.ptp(y)) == pytest.approx((0.6, 0.6 / 1.3), rel=0.057)


def test_cells_of_a_slender_contact_do_not_cover_the_stick_zone() -> None:
    body = {"young_modulus": 210e9, "poisson_ratio": 0.0}
    surfaces = [{"shape": "cylinder", "radius": "10 mm", "angle": angle} for angle in ("0 deg", "5 deg")]
    bodies = {f"body_{k}": {**body, "surface": surface} for k, surface in enumerate(surfaces, 1)}
    loads: Any = [{"normal_load": 20.0}, {"tangential_load_y": "0.8 mu P"}]
    lattice = {"lattice": "rectangular", "nodes_in_radius": 12}
    result = Case(**bodies, **lattice, friction_coefficient=0.3, loads=loads).run()
    view, axes = StepView(result, -1), plotting.contact_boundary(result).axes[0]
    scale, node = units(axes.get_xlabel()), view.spacing * view.lattice.cell_ratio
    for label, nodes in (("stick", view.stick), ("slip", view.contact & ~view.stick)):
        corners = drawn.cells(axes, label) * scale
        middle = np.stack([view.x[nodes], view.y[nodes]], axis=1)
        assert len(corners) == nodes.sum() > 20
        np.testing.assert_allclose(corners.mean(axis=1), middle, rtol=0, atol=1e-6 * node)
        turned = corners - corners[:, :1]
        first, last = turned[:, 1], turned[:, 3]
        areas = abs(first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0])
        np.testing.assert_allclose(areas, view.lattice.cell_area, rtol=1e-6)


# ----------------------------------------------------------------------------------- maps


@pytest.mark.usefixtures("laid_out_once")
def test_map_of_the_shear_traction() -> None:
    result = dissimilar()
    figure = plotting.FIGURES["traction"](result, 3)
    axes = figure.axes[0]
    [bar] = axes.child_axes
    assert "shear traction $|q|$" in bar.get_ylabel()
    mesh = axes.collections[0]
    factor = units(bar.get_ylabel())
    one = result.sel(step=3)
    size = np.hypot(one["traction_x"].values, one["traction_y"].values)
    inside = one["pressure"].values > 0
    drawn.is_field(axes, StepView(result, 3), size, "shear traction $|q|$")
    assert mesh.get_clim() == pytest.approx((0.0, size.max() / factor))
    [arrows] = [child for child in axes.get_children() if isinstance(child, Quiver)]
    assert 50 < arrows.N <= inside.sum()
    x, y = (np.asarray(a) * units(axes.get_xlabel()) for a in (arrows.X, arrows.Y))
    np.testing.assert_allclose(arrows.V, 0.1 * x * y, atol=1e-9)
    np.testing.assert_allclose(arrows.U, 0.5 * SLIDING * np.exp(-((x - 0.2) ** 2) - y**2), atol=1e-9)


@pytest.mark.usefixtures("laid_out_once")
@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("traction_x", "shear traction $q_x$"),
        ("traction_y", "shear traction $q_y$"),
        ("accumulated_slip", "accumulated slip"),
    ],
)
def test_map_of_each_field(name: str, label: str) -> None:
    result = cattaneo() if name == "accumulated_slip" else dissimilar()
    [axes] = drawn.visible(plotting.FIGURES[name](result, 3))
    drawn.is_field(axes, StepView(result, 3), result[name].values[2], label)


def test_signed_maps_are_white_at_zero() -> None:
    mesh = plotting.FIGURES["traction_y"](dissimilar(), 3).axes[0].collections[0]
    low, high = mesh.get_clim()
    assert low == -high
    mesh = plotting.FIGURES["traction_x"](dissimilar(), 3).axes[0].collections[0]
    assert mesh.get_clim()[0] == 0.0


@pytest.mark.usefixtures("laid_out_once")
def test_maps_of_several_steps_share_a_scale() -> None:
    figure = plotting.FIGURES["traction_x"](dissimilar(), [2, 3, 4])
    limits = [axes.collections[0].get_clim() for axes in figure.axes if axes.get_title()]
    assert len(limits) == 3
    assert len(set(limits)) == 1
    panels, [bar] = figure.axes[:3], [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    factor, to_length = units(bar.get_ylabel()), units(panels[0].get_ylabel())
    for axes, step in zip(panels, (2, 3, 4), strict=True):
        mesh, view = axes.collections[0], StepView(dissimilar(), step)
        at = mesh._triangulation.x * to_length, mesh._triangulation.y * to_length
        values = np.asarray(mesh.get_array()) * factor
        expected = view.at(*at, view.data["traction_x"].values)
        np.testing.assert_allclose(values[values > 0.0], expected[values > 0.0], atol=1e-9)
        assert (values > 0.0).sum() == (view.contact & (view.data["traction_x"].values > 0.0)).sum()


@pytest.mark.usefixtures("laid_out_once")
def test_map_of_the_slip() -> None:
    result = cattaneo()
    figure = plotting.FIGURES["slip_increment"](result, 4)
    factor = units(figure.axes[0].child_axes[0].get_ylabel())
    assert np.asarray(figure.axes[0].collections[0].get_array()).max() * factor == pytest.approx(1e-3)
    one = result.sel(step=4)
    size = np.hypot(one["slip_increment_x"].values, one["slip_increment_y"].values)
    drawn.is_field(figure.axes[0], StepView(result, 4), size, "slip in the step")


# ----------------------------------------------------------------------------------- history and loops


def panels(result: xarray.Dataset) -> list[tuple[str, ...]]:
    scalars = result[[name for name in result.data_vars if result[name].dims == ("step",)]]
    histories = scalars.to_dataframe().to_dict("records")
    return [tuple(curves) for curves in panels_of(histories).values()]


def test_history_leaves_out_what_stays_zero() -> None:
    assert panels(cattaneo()) == [
        ("normal_load",),
        ("tangential_load_x",),
        ("approach",),
        ("shift_x",),
        ("contact_area", "stick_area"),
        ("max_pressure",),
        ("max_traction",),
    ]
    assert ("torque",) in panels(torsion())
    assert ("tangential_load_x",) not in panels(torsion())


@pytest.mark.usefixtures("laid_out_once")
def test_every_panel_of_a_history_shows_its_quantities() -> None:
    result = cattaneo()
    shown = drawn.visible(plotting.history(result))
    for axes, names in zip(shown, panels(result), strict=True):
        lines = by_label(axes)
        assert set(lines) == set(names)
        for name in names:
            x, y = lines[name].get_data()
            np.testing.assert_array_equal(x, [0, 1, 2, 3, 4])
            found = np.asarray(y) * units(axes.get_ylabel())
            np.testing.assert_allclose(found, [0.0, *result[name].values], rtol=1e-12, err_msg=name)


@pytest.mark.usefixtures("laid_out_once")
@pytest.mark.parametrize("over", ["step", "tangential_load_x"])
def test_history_shows_areas_over_steps_or_load(over: str) -> None:
    result = cattaneo()
    figure = plotting.history(result, over=over)
    [axes] = [axes for axes in figure.axes if axes.get_ylabel().startswith("area")]
    lowest = next(axes for axes in figure.axes if axes.get_xlabel())
    assert lowest.get_xlabel().startswith("load step" if over == "step" else "tangential load x (")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["contact", "stick"]
    factor = 1.0 if over == "step" else units(lowest.get_xlabel())
    for name in ("contact_area", "stick_area"):
        x, y = by_label(axes)[name].get_data()
        np.testing.assert_allclose(np.asarray(x) * factor, [0.0, *result[over].values], rtol=1e-12)
        found = np.asarray(y) * units(axes.get_ylabel())
        np.testing.assert_allclose(found, [0.0, *result[name].values], rtol=1e-12)
    with pytest.raises(ValueError, match="no history of tangential_load in this result; there are"):
        plotting.history(result, over="tangential_load")


@pytest.mark.usefixtures("laid_out_once")
def test_areas_to_the_edge_are_named_like_those_of_the_nodes() -> None:
    result = cattaneo()
    fits = {f"{name}_fit": result[name] for name in ("contact_area", "stick_area")}
    shown = drawn.visible(plotting.history(result.assign(fits)))
    [axes] = [axes for axes in shown if set(by_label(axes)) == set(fits)]
    assert axes.get_ylabel().startswith("area (")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["contact", "stick"]


def test_loop_of_load_and_shift() -> None:
    result = loop()
    [axes] = plotting.loop(result).axes
    assert axes.get_ylabel().startswith("tangential load $Q_x$ (")
    lines = by_label(axes)
    shift, load = si(axes, lines["computed"])
    np.testing.assert_allclose(shift, result["shift_x"].values, atol=1e-15)
    np.testing.assert_allclose(load, result["tangential_load_x"].values, atol=1e-15)
    [name] = [label for label in lines if "Deresiewicz" in label]
    shift, load = si(axes, lines[name])
    peak = 0.6 * SLIDING
    top = int(np.argmax(load))
    np.testing.assert_allclose(shift[: top + 1], MINDLIN.shift(load[: top + 1]), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(shift[top:], MINDLIN.shift_unloading(load[top:], peak), rtol=1e-6, atol=1e-9)
    assert load[-1] == pytest.approx(-peak)


def test_loop_along_a_line() -> None:
    [axes] = plotting.loop(made([PRESSED, *(sheared(s * SLIDING, angle=0.5) for s in SHARES)])).axes
    shift, load = si(axes, by_label(axes)["computed"])
    np.testing.assert_allclose(load, [0.0, *(s * SLIDING for s in SHARES)], atol=1e-12)
    np.testing.assert_allclose(shift, MINDLIN.shift(load), atol=1e-12)
    assert "along 28.6°" in axes.get_xlabel()


def test_loop_into_sliding_is_closed_up_to_it() -> None:
    slid = replaced(sheared(0.9 * SLIDING), tangential_load_x=SLIDING, shift_x=1.5 * MINDLIN.sliding_shift)
    [axes] = plotting.loop(made([PRESSED, sheared(0.5 * SLIDING), slid, slid])).axes
    [name] = [label for label in by_label(axes) if "Deresiewicz" in label]
    shift, load = si(axes, by_label(axes)[name])
    assert (shift[-1], load[-1]) == pytest.approx((MINDLIN.sliding_shift, SLIDING), rel=1e-6)
    assert r"$\mu P$" in by_label(axes)


def test_loop_of_dissimilar_bodies_has_no_closed_curve() -> None:
    [axes] = plotting.loop(dissimilar()).axes
    assert set(by_label(axes)) <= {"computed", r"$\mu P$"}


@pytest.mark.parametrize("most", [0.6, 0.8, 1 / 1.05, 0.99])
def test_a_loop_names_only_lines_that_are_seen(most: float) -> None:
    [axes] = plotting.loop(made([PRESSED, *(sheared(s * most * SLIDING) for s in (0.5, 1.0))])).axes
    low, high = axes.get_ylim()
    lines = [line for line in axes.lines if line.get_label() == r"$\mu P$"]
    assert bool(lines) == (most > 0.75)
    assert all(low < float(y) < high for line in lines for y in np.asarray(line.get_ydata()))


@pytest.mark.usefixtures("laid_out_once")
def test_many_maps_have_no_arrows() -> None:
    result = made([PRESSED, sheared(0.5 * SLIDING)])
    for count, arrows in ((9, True), (10, False)):
        maps = plotting.field_map("traction", result, [2] * count).axes
        assert any(isinstance(child, Quiver) for axes in maps for child in axes.get_children()) == arrows


def test_torque_and_twist() -> None:
    result = torsion()
    [axes] = plotting.torsion(result).axes
    twist, torque = si(axes, by_label(axes)["computed"])
    np.testing.assert_allclose(twist, result["twist"].values, atol=1e-15)
    np.testing.assert_allclose(torque, result["torque"].values, atol=1e-15)
    twist, torque = si(axes, by_label(axes)["Lubkin"])
    for stick in (0.9, 0.6, 0.4, 0.32):
        c = stick * HERTZ.contact_radius
        assert np.interp(LUBKIN.torque(c), torque, twist) == pytest.approx(LUBKIN.twist(c), rel=1e-3)
    assert twist[-1] == pytest.approx(LUBKIN.twist(0.3 * HERTZ.contact_radius), rel=1e-6)


def test_initial_compliance() -> None:
    ratio, share = initial_compliance(cattaneo())
    assert (ratio, share) == pytest.approx((1.0, 0.2), rel=1e-6)
    assert initial_compliance(dissimilar())[0] == pytest.approx(1.1, rel=1e-6)
    [axes] = plotting.compliance([dissimilar(), cattaneo()]).axes
    beta, ratio_of = by_label(axes)[r"$\mu$ = 0.3"].get_data()
    assert list(beta) == [0.0, 0.19]
    assert list(ratio_of) == pytest.approx([1.0, 1.1], rel=1e-6)
    goodman = dissimilar()
    goodman.attrs["coupling"] = "goodman"
    assert r"$\mu$ = 0.3, Goodman" in by_label(plotting.compliance([dissimilar(), goodman]).axes[0])
    moved = dissimilar()
    moved["shift_x"] += 0.01  # what pressing moved does not count
    assert initial_compliance(moved)[0] == pytest.approx(1.1, rel=1e-6)
    with pytest.raises(ValueError, match="needs a load step of shear alone"):
        initial_compliance(made([sheared(0.5 * SLIDING)]))


# ----------------------------------------------------------------------------------- all of them


@pytest.mark.usefixtures("laid_out_once")
def test_overview_shows_maps_zones_section_and_history() -> None:
    result = cattaneo()
    view = StepView(result, 3)
    figure = plotting.overview(result, 3)
    drawn.assert_painted(figure)
    pressure, shear, zones, section, areas, largest = drawn.visible(figure)
    one = result.sel(step=3)
    drawn.is_field(pressure, view, view.pressure, "pressure $p$")
    size = np.hypot(one["traction_x"].values, one["traction_y"].values)
    drawn.is_field(shear, view, size, "shear traction $|q|$")
    drawn.are_zones(zones, view)
    lines = by_label(section)
    x, q = si(section, lines["$q_x$"])
    nodes = one["pressure"].sel(row=0).values > 0
    assert len(x) >= nodes.sum() > 10
    np.testing.assert_allclose(q, view.at(x, 0.0 * x, one["traction_x"].values), atol=1e-9)
    x, q = si(section, lines["Cattaneo–Mindlin"])
    np.testing.assert_allclose(q, MINDLIN.traction(np.abs(x), 0.5 * SLIDING), atol=1e-6)
    for axes, names in ((areas, ("contact_area", "stick_area")), (largest, ("max_pressure",))):
        for name in names:
            x, y = by_label(axes)[name].get_data()
            np.testing.assert_array_equal(x, [0, 1, 2, 3, 4])
            found = np.asarray(y) * units(axes.get_ylabel())
            np.testing.assert_allclose(found, [0.0, *result[name].values], rtol=1e-12)
        assert [line.get_xdata()[0] for line in axes.lines if line.get_linewidth() == 3.0] == [3]  # the step
    single = plotting.overview(made([sheared(0.5 * SLIDING)]), 1)
    assert not any(axes.get_xlabel() == "load step" for axes in single.axes)
    without = cattaneo().drop_vars(["traction_x", "traction_y"])  # not kept: what there is without them
    first, upper, _ = drawn.visible(plotting.overview(without, 3))
    drawn.is_field(first, view, view.pressure, "pressure $p$")
    assert {"computed", "Hertz"} == set(by_label(upper))


def worn() -> xarray.Dataset:
    """Return a result whose last step has worn."""
    data = dissimilar()
    count = np.arange(data.sizes["step"])
    depth = 1e-6 * data["accumulated_slip"] * xarray.DataArray(count, dims="step")
    return data.assign(
        worn_depth=depth, wear_cycles=("step", 100.0 * count), max_worn_depth=depth.max(("row", "col"))
    )


SUITABLE = {
    name: {"torque": torsion, "wear": worn, "rolling": rolling}.get(
        "wear" if name == "worn_depth" else entry.needs, dissimilar
    )
    for name, entry in entries().items()
    if entry.shows == "result"
}


BODIES = """
[body.1]
young_modulus = 4
poisson_ratio = 0.3
[body.2]
rigid = true
[grid]
spacing = 0.1
[[load]]
normal_load = 1
[[fatigue]]
steps = [1, 2]
parameters = ["findley"]
findley_slope = 0.3
[[fatigue]]
steps = [1, 2]
parameters = ["life"]
strength = 1
strength_exponent = -0.1
ductility = 1
ductility_exponent = -0.5
plane = [[-1, 0, 0], [1, 0, 0], [-1, 0, 1]]
[[stress]]
components = ["von_mises_stress"]
line = [[-1, 0, 0.1], [1, 0, 0.1]]
"""
"""What the figures of the inside of the bodies need of a deck."""


@pytest.mark.parametrize("name", plotting.FIGURES)
def test_every_figure_is_painted(name: str) -> None:
    figure = plotting.FIGURES[name](SUITABLE[name]().assign_attrs(deck=BODIES))
    assert isinstance(figure, Figure)
    drawn.assert_painted(figure)


@pytest.mark.usefixtures("laid_out_once")
@pytest.mark.parametrize("kind", ["pdf", "svg"])
@pytest.mark.parametrize("name", ["tractions", "zones", "outlines", "loop", "torsion"])
def test_lines_and_areas_are_in_every_kind_of_file(name: str, kind: str) -> None:
    with matplotlib.rc_context({"path.simplify": False}):
        figure = plotting.FIGURES[name](SUITABLE[name]())
        assert drawn.added_strokes(figure, kind) > 0.9 * drawn.vertices(figure) > 0
        assert not drawn.has_pixels(figure, kind)  # markers and areas, which are not counted above


NEEDS_FRICTION = {
    "tractions": "a contact without friction has no traction",
    "traction": "a contact without friction has no traction",
    "traction_x": "a contact without friction has no traction x",
    "traction_y": "a contact without friction has no traction y",
    "slip_increment": "a contact without friction has no slip increment",
    "accumulated_slip": "a contact without friction has no accumulated slip",
    "dissipation_density": "a contact without friction has no dissipation density",
    "worn_depth": "a contact without friction has no worn depth",
    "wear": "the surfaces do not wear",
    "zones": "a contact without friction has no stick and slip zones",
    "outlines": "a contact without friction has no stick and slip zones",
    "loop": "a contact without friction has no tangential load",
    "creep": "the bodies do not roll",
    "torsion": "there is no torque in this result",
    "fatigue": "the deck has no table",
    "lines": "the deck has no table",
    "compliance": "the tangential compliance is that of spheres with friction",
}


@pytest.mark.parametrize(
    "name", [name for name, entry in entries().items() if entry.needs and entry.shows == "result"]
)
def test_what_needs_friction_says_so(name: str) -> None:
    without = frictionless()
    if name in ("accumulated_slip", "dissipation_density"):
        without = without.drop_vars(name)
    with pytest.raises(ValueError, match=NEEDS_FRICTION[name]):
        plotting.FIGURES[name](without)


def test_what_was_not_kept_is_said() -> None:
    result = cattaneo()
    with pytest.raises(ValueError, match=r"the traction x was not kept \(output.fields\)"):
        plotting.tractions(result.drop_vars("traction_x"), 3)
    result["traction_y"][2] = np.nan
    result["zone"][2] = -1
    with pytest.raises(ValueError, match=r"the traction y of step 3 was not kept \(output.every\)"):
        plotting.tractions(result, 3)
    with pytest.raises(ValueError, match=r"the zone of step 3 was not kept \(output.every\)"):
        plotting.zones(result, 3)
    with pytest.raises(IndexError, match="there is no step 9"):
        plotting.zones(result, [2, 9])
    with pytest.raises(ValueError, match="there is no tangential load in this result"):
        plotting.loop(torsion())


def test_title_names_the_loads() -> None:
    assert StepView(cattaneo(), 3).title == "Made up, step 3 ($P$ = 800 mN, $Q_x$ = 120 mN)"
    assert "$M_z$ = " in StepView(torsion(), 3).title
    untitled = cattaneo().isel(step=[1]).assign_attrs(title="")
    assert StepView(untitled, -1).title.startswith("$P$ = 800 mN, $Q_x$ = ")


def test_overview_shows_the_approach_beside_an_unbounded_pressure() -> None:
    ended = cattaneo()
    ended["max_pressure"] = ended["max_pressure"] * np.inf
    *_, last = drawn.visible(plotting.overview(ended, 3))
    assert last.get_ylabel().startswith("approach")
