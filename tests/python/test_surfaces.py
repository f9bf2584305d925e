"""Surface shapes against values worked out by hand, sums of two, and where two bodies first touch."""

import itertools
import math
import pickle
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest

from hexcontact import plotting
from hexcontact.analytic.hertz_gap import against_hertz
from hexcontact.case import Case
from hexcontact.deck.json_schema import deck_schema
from hexcontact.deck.keys import Body
from hexcontact.deck.kinds import Quantity
from hexcontact.deck.measured import Map, Profile
from hexcontact.deck.rough import Rough
from hexcontact.deck.separation import Separation, principal_curvatures
from hexcontact.deck.surfaces import (
    SHAPES,
    Cone,
    Cylinder,
    Dent,
    Ellipsoid,
    Flat,
    FormulaSurface,
    Paraboloid,
    Power,
    Punch,
    RectangularPunch,
    Roller,
    RoundedPunch,
    Sphere,
    Surface,
    SurfaceSum,
    Torus,
    Waviness,
    shape,
)
from hexcontact.deck.table_base import meaning
from hexcontact.deck.units import NUMBER
from hexcontact.errors import DeckError
from hexcontact.problem.preview import case_rows
from hexcontact.text import quantity

ROOT = Path(__file__).parents[2]
SOME = [
    Flat(),
    Sphere(radius=2.0),
    Sphere(radius=2.0, exact=True),
    Paraboloid(radius_x=4.0, radius_y=1.0, angle="30 deg"),
    Cylinder(radius=0.5, angle="-20 deg"),
    Cone(slope=0.1),
    Power(exponent=3, coefficient=2.0),
    Punch(radius=1.5),
    RoundedPunch(flat_radius=0.6, edge_radius=10.0),
    Ellipsoid(radius_x=-4.0, radius_y=1.0, angle="30 deg"),
    RectangularPunch(width=1.0, length=2.0, edge_radius=10.0),
    Torus(ring_radius=1.0, radius=3.0),
    Waviness(amplitude=0.1, wavelength=0.7, angle="20 deg"),
    Dent(depth=0.1, radius=1.0, rim=0.02),
    Roller(radius=2.0, length=5.0, profile="crown", crown_radius=90.0),
    FormulaSurface(expression="min(x**2, (x + 1)**2 + 0.1)/4 + y**2"),
]


@pytest.mark.parametrize(
    ("surface", "x", "y", "height"),
    [
        (Flat(), 3.0, 4.0, 0.0),
        (Sphere(radius=2.0), 3.0, 4.0, 25 / 4),
        (
            Sphere(radius=2.0, tilt=["0.1 rad", "-0.05 rad"]),
            3.0,
            4.0,
            25 / 4 + 4 * math.tan(0.1) - 3 * math.tan(0.05),
        ),
        (Ellipsoid(radius_x=-2.0, radius_y=1.0), 3.0, 4.0, 8 - 9 / 4),
        (RectangularPunch(width=2.0, length=4.0), 1.0, 2.0, 0.0),
        (RectangularPunch(width=2.0, length=4.0), 1.1, 0.0, math.inf),
        (RectangularPunch(width=2.0, length=4.0, edge_radius=5.0), 4.0, 6.0, (9 + 16) / 10),
        (Torus(ring_radius=4.0, radius=0.5), 3.0, 4.0, 1.0),
        (Waviness(amplitude=0.5, wavelength=2.0, angle="90 deg"), 9.0, 1.0, 1.0),
        (Dent(depth=0.2, radius=2.0, rim=0.1), 0.0, 0.0, 0.2),
        (Dent(depth=0.2, radius=2.0, rim=0.1), 1.0, 0.0, 0.2 * 0.75**2),
        (Dent(depth=0.2, radius=2.0, rim=0.1), 2.5, 0.0, -0.1),
        (Dent(depth=0.2, radius=2.0, rim=0.1), 0.0, 3.1, 0.0),
        (Roller(radius=2.0, length=6.0), 3.0, 4.0, 4.0),
        (Roller(radius=2.0, length=6.0), 3.1, 4.0, math.inf),
        (Roller(radius=2.0, length=8.0, angle="90 deg", profile="crown", crown_radius=80.0), 3.0, 4.0, 2.35),
        (Roller(radius=2.0, length=8.0, profile="chamfer", chamfer=0.5), 3.75, 0.0, 0.25),
        (Sphere(radius="2 mm"), 1e-3, 0.0, 2.5e-4),
        (Sphere(radius=5.0, exact=True), 3.0, 0.0, 1.0),
        (Sphere(radius=5.0, exact=True), 0.0, 5.0, 5.0),
        (Sphere(radius=5.0, exact=True), 5.1, 0.0, math.inf),
        # a tiny height on a large sphere keeps its digits
        (Sphere(radius=1e6, exact=True), 1e-3, 0.0, 5e-13),
        (Paraboloid(radius_x=4.0, radius_y=1.0), 2.0, 3.0, 4 / 8 + 9 / 2),
        # axis 1 along y: x is now across it
        (Paraboloid(radius_x=4.0, radius_y=1.0, angle="90 deg"), 2.0, 3.0, 9 / 8 + 4 / 2),
        (Cylinder(radius=0.5), 7.0, 3.0, 9.0),
        (FormulaSurface(expression="min((x - 1)**2, (x + 1)**2 + 0.1)/4 + y**2"), -1.0, 3.0, 9.025),
        (FormulaSurface(expression="0.5", offset=(1.0, 2.0)), -1.0, 3.0, 0.5),
        (Cylinder(radius=0.5, angle="90 deg"), 7.0, 3.0, 49.0),
        # distance of (1, 0) from a line at 30 degrees is 1/2
        (Cylinder(radius=0.5, angle="30 deg"), 1.0, 0.0, 0.25),
        (Cylinder(radius=0.5, angle="30 deg"), math.cos(math.pi / 6), 0.5, 0.0),
        (Cone(slope=0.1), 3.0, 4.0, 0.5),
        (Power(exponent=3, coefficient=2.0), 3.0, 4.0, 250.0),
        (Power(exponent=4, coefficient="0.01 mm^-3"), 1e-3, 0.0, 1e-5),
        (Power(exponent=1, coefficient=0.1), 3.0, 4.0, 0.5),
        (Power(exponent=1.5, coefficient="1 mm^-0.5"), 1e-3, 0.0, 1e-3),
        (Punch(radius=5.0), 3.0, 4.0, 0.0),
        (Punch(radius=5.0), 3.1, 4.0, math.inf),
        (RoundedPunch(flat_radius=3.0, edge_radius=10.0), 0.0, 2.9, 0.0),
        (RoundedPunch(flat_radius=3.0, edge_radius=10.0), 3.0, 4.0, 0.2),
        (Sphere(radius=2.0, offset=[1.0, -1.0]), 4.0, 3.0, 25 / 4),
        (Sphere(radius=2.0, offset=["1 mm", 0]), 1e-3, 2e-3, 1e-6),
    ],
)
def test_heights(surface: Surface, x: float, y: float, height: float) -> None:
    # 1e-14: a few roundings; absolute only where the height is zero
    assert float(surface.height(x, y)) == pytest.approx(height, rel=1e-14, abs=1e-16 if height == 0 else 0)
    assert bool(surface.candidate(x, y)) == math.isfinite(height)


@pytest.mark.parametrize("surface", SOME, ids=lambda s: type(s).__name__)
def test_every_shape_is_vectorised_nonnegative_and_touches_at_its_center(surface: Surface) -> None:
    x, y = np.meshgrid(np.linspace(-3, 3, 7), np.linspace(-2, 2, 5))
    height = surface.height(x, y)
    assert height.shape == x.shape
    if not isinstance(surface, Ellipsoid | Torus | Dent):  # hollow in the middle, or nearer to the other body
        assert (height >= 0).all()
        assert height[2, 3] == 0
    one_by_one = [
        [float(surface.height(a, b)) for a, b in zip(p, q, strict=True)] for p, q in zip(x, y, strict=True)
    ]
    # numpy's powers of arrays and numbers differ in their last bit on some processors
    np.testing.assert_allclose(height, one_by_one, rtol=1e-15)
    np.testing.assert_array_equal(surface.candidate(x, y), np.isfinite(height))


@pytest.mark.parametrize("surface", SOME, ids=lambda s: type(s).__name__)
def test_curvature_is_the_second_derivative(surface: Surface) -> None:
    tensor = surface.curvature
    quadratic = isinstance(surface, Flat | Sphere | Paraboloid | Cylinder) and not getattr(
        surface, "exact", False
    )
    assert (tensor is not None) == quadratic
    if tensor is None:
        return
    for point in np.random.default_rng(1).normal(size=(5, 2)):
        assert 0.5 * point @ tensor @ point == pytest.approx(
            float(surface.height(*point)), rel=1e-13, abs=1e-16
        )


@pytest.mark.parametrize("surface", SOME, ids=lambda s: type(s).__name__)
def test_surfaces_survive_pickling_and_cannot_be_changed(surface: Surface) -> None:
    assert pickle.loads(pickle.dumps(surface)) == surface
    with pytest.raises(ValueError, match="frozen"):
        surface.offset = (1.0, 0.0)  # type: ignore[misc]


def test_a_rim_node_belongs_to_the_punch_whatever_its_rounding() -> None:
    angle = np.arange(6) * math.pi / 3
    assert Punch(radius=1.0).candidate(np.cos(angle), np.sin(angle)).all()


def test_all_shapes_of_the_deck_are_there() -> None:
    assert set(SHAPES) == {
        "flat",
        "sphere",
        "paraboloid",
        "cylinder",
        "cone",
        "power",
        "punch",
        "rounded_punch",
        *("ellipsoid", "rectangular_punch", "torus", "waviness", "dent", "roller"),
        "formula",
        *("map", "profile", "rough"),
    }
    assert set(SHAPES.values()) == {type(surface) for surface in SOME} | {Map, Profile, Rough}


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: Sphere(radius=-1.0),
            'radius = -1.0: expected a length above 0 such as "1 mm"; a hollow is an ellipsoid: '
            '{ shape = "ellipsoid", radius_x = "-5 mm", radius_y = "20 mm" }',
        ),
        (
            lambda: Ellipsoid(radius_x=0.0, radius_y=1.0),
            'radius_x = 0.0: expected a length such as "1 mm", not 0',
        ),
        (
            lambda: Roller(radius=1.0, length=2.0, profile="chamfer", chamfer=1.2),
            "chamfer: expected less than 1 m, half the length",
        ),
        (
            lambda: Roller(radius=1.0, length=2.0, profile="crown"),
            'crown_radius: missing; expected it for profile = "crown"',
        ),
        (
            lambda: Roller(radius=1.0, length=2.0, chamfer=0.1),
            'chamfer = 0.1: expected it for profile = "chamfer" only',
        ),
        (
            lambda: Sphere(radius=1.0, tilt=["20 deg", "0 deg"]),
            'tilt = ["20 deg", "0 deg"]: expected two angles such as ["0.01 deg", "0 deg"]; entry 1, '
            '"20 deg": expected an angle with its unit of at least -0.1 rad and at most 0.1 rad such as '
            '"30 deg"',
        ),
        (lambda: Sphere(), 'radius: missing; expected a length above 0 such as "1 mm"'),
        (lambda: Sphere(radius=1.0, exakt=True), "exakt: unknown key; did you mean exact?"),
        (
            lambda: Cylinder(radius=1.0, angle=30),
            'angle = 30: expected an angle with its unit such as "30 deg"',
        ),
        (
            lambda: Cylinder(radius=1.0, length=2.0, profile="crown"),
            'length: unknown key; did you mean shape = "roller", which has a length?',
        ),
        (
            lambda: Punch(sides=[1.0, 2.0]),
            'sides: unknown key; did you mean shape = "rectangular_punch", which has width and length?',
        ),
        (
            lambda: Power(exponent=2, coefficient="3 mm"),
            'coefficient = "3 mm": expected a coefficient in m^-1 above 0 such as "0.1 mm^-1"; '
            '"mm" is a length',
        ),
    ],
)
def test_a_wrong_surface_is_a_deck_error(make: object, sentence: str) -> None:
    with pytest.raises(DeckError) as error:
        make()  # type: ignore[operator]
    assert str(error.value) == sentence


STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
E_STAR = 210e9 / (2 * (1 - 0.3**2))


def test_several_shapes_of_a_body_add_up(tmp_path: Path) -> None:
    parts = [
        {"shape": "sphere", "radius": 1e-2},
        {"shape": "dent", "depth": 3e-7, "radius": 6e-5, "offset": [2e-5, 0]},
    ]
    case = Case(body_1={**STEEL, "surface": parts}, body_2=STEEL, spacing=1e-5, normal_load=20.0)
    x, y = case.lattice.x, case.lattice.y
    one, two = Sphere(radius=1e-2), Dent(depth=3e-7, radius=6e-5, offset=(2e-5, 0.0))
    assert isinstance(case.body_1.surface, SurfaceSum)
    assert np.array_equal(case.initial_gap(case.lattice)[0], one.height(x, y) + two.height(x, y))
    assert Case.from_text(case.deck_text) == case
    assert (
        Case(
            body_1={**STEEL, "surface": parts[:1]}, body_2=STEEL, spacing=1e-5, normal_load=20.0
        ).body_1.surface
        == one
    )
    with pytest.raises(DeckError, match="body.1.surface.2.depth"):
        case.changed({"body.1.surface": [parts[0], {"shape": "dent", "radius": 1.0}]})
    wrong = [{"shape": "dent", "radius": 1.0}, {"shape": "sphere", "radius": -1.0}]
    with pytest.raises(DeckError, match=r"surface\.1\.depth: missing(.|\n)*surface\.2\.radius = -1"):
        case.changed({"body.1.surface": wrong})


def test_a_ball_in_a_groove_is_the_ellipse_of_hertz() -> None:
    groove = {"shape": "ellipsoid", "radius_x": -8e-3, "radius_y": 1e6}
    case = Case(
        body_1={**STEEL, "surface": Sphere(radius=5e-3)},
        body_2={**STEEL, "surface": groove},
        nodes_in_radius=20,
        normal_load=50.0,
    )
    compared = {entry.quantity: entry.error for entry in case.run().compare()}
    assert abs(compared["max_pressure"]) < 2e-3
    assert abs(compared["approach"]) < 2e-3


SHARP = {
    "roller": (Roller(radius=5e-3, length=2e-3), True),
    "chamfer": (Roller(radius=5e-3, length=2e-3, profile="chamfer", chamfer="0.1 mm"), True),
    "crown": (Roller(radius=5e-3, length=2e-3, profile="crown", crown_radius=1.0), False),
    "punch": (Punch(radius=2e-4), True),
    "rectangle": (RectangularPunch(width=4e-4, length=2e-4), True),
    "rounded": (RectangularPunch(width=4e-4, length=2e-4, edge_radius=1e-3), False),
    "sphere": (Sphere(radius=5e-3), False),
    "arc to its rim": (Sphere(radius=5e-3, exact=True), False),
}


@pytest.mark.parametrize("name", SHARP)
def test_the_pressure_at_a_sharp_end_is_no_number(name: str) -> None:
    """In `check`, result, summary and comparison, also where the load ends in the middle of the surface."""
    surface, unbounded = SHARP[name]
    case = Case(body_1={**STEEL, "surface": surface}, body_2=STEEL, spacing=1e-5, normal_load=10.0)
    assert ("unbounded at an end of a surface" in dict(case_rows(case))["contact"]) == unbounded
    result = case.run()
    assert math.isinf(float(result.max_pressure[-1])) == unbounded
    assert ("unbounded" in repr(result.compare())) == (name in ("roller", "chamfer"))
    layer = case.changed({"interface": {"coefficient": 1e13}}) if unbounded else case
    assert math.isfinite(float(layer.run().max_pressure[-1]))
    shear = [{"normal_load": 10.0}, {"tangential_load_x": 1.0}]
    sheared = case.changed({"load": shear, "friction": {"coefficient": 0.3}}).run()
    assert [math.isinf(float(value)) for value in sheared.max_traction] == [False, unbounded]


def test_pictures_of_a_sharp_ended_roller_name_no_end_pressure() -> None:
    roller = Roller(radius=5e-3, length=2e-3, angle="90 deg")
    grid = {"spacing": 4e-6, "cell_ratio": 4, "cell_angle": "90 deg"}
    case = Case(body_1={**STEEL, "surface": roller}, body_2=STEEL, normal_load=14.5, **grid)
    result = case.run()
    ended, across, along = plotting.overview(result).axes
    [bar] = ended.child_axes
    words = "pressure $p$ (MPa)\nunbounded at an end"
    assert [axes.get_ylabel() for axes in (across, along)] == [words, words]
    assert bar._colorbar.extend == "max"  # type: ignore[attr-defined]
    assert [axes.get_xlabel()[:1] for axes in (across, along)] == ["x", "y"]
    x, y = along.lines[0].get_data()
    assert np.interp(0.0, x, y) == pytest.approx(across.lines[0].get_ydata().max(), rel=0.01)
    assert np.ptp(x[y > 0.0]) == pytest.approx(2.0, abs=0.05)  # mm
    pressed = plotting.pressure_field(result.dataset.assign(max_pressure=("step", [1e9])))
    [bar] = pressed.axes[0].child_axes
    assert (bar.get_ylabel(), bar._colorbar.extend) == ("pressure $p$ (MPa)", "neither")  # type: ignore[attr-defined]
    shown = plotting.surface(case)
    shown.draw_without_rendering()
    low, high = shown.axes[0].get_xlim()
    labels = [t for t in shown.axes[0].get_xticklabels() if low <= t.get_position()[0] <= high]
    boxes = [label.get_window_extent() for label in labels]
    assert len(boxes) > 1
    assert all(a.x1 < b.x0 for a, b in itertools.pairwise(boxes))


def test_the_plane_contact_stands_beside_a_roller(tmp_path: Path) -> None:
    load, half_length, radius = 14.5, 1e-3, 5e-3
    half_width = math.sqrt(4 * load / (2 * half_length) * radius / (math.pi * E_STAR))
    peak = load / (math.pi * half_length * half_width)
    roller = Roller(radius=radius, length=2 * half_length, profile="crown", crown_radius=5.0)
    case = Case(
        body_1={**STEEL, "surface": roller},
        body_2=STEEL,
        lattice="rectangular",
        spacing=(2e-5, 2e-6),
        normal_load=load,
    )
    assert f"half-width {quantity(half_width, 'm')}" in dict(case_rows(case))["plane contact"]
    [entry] = case.run(tmp_path / "roller.nc").compare()
    assert (entry.quantity, entry.solution) == ("max_pressure", "Hertz, plane contact")
    assert entry.exact == pytest.approx(peak, rel=1e-12)
    assert math.isinf(entry.computed)  # contact reaches the ends


def test_a_design_load_belongs_to_a_long_contact() -> None:
    """At the most of the message the contact is as wide as long, and beyond there is no profile."""

    def loaded(design_load: float) -> Case:
        roller = Roller(radius=1e-2, length=1e-3, profile="logarithmic", design_load=design_load)
        return Case(body_1={**STEEL, "surface": roller}, body_2=STEEL, spacing=1e-5, normal_load=10.0)

    with pytest.raises(DeckError, match=r"^body\.1\.surface\.design_load: expected at most 2\.266 kN, under"):
        loaded(2267.0)
    half_width, _ = Roller(radius=1e-2, length=1e-3).plane_contact(E_STAR, 2265.0)
    assert half_width == pytest.approx(0.5e-3, rel=1e-3)
    assert loaded(2265.0).run().complete


@pytest.mark.parametrize("number", ["1", "2"])
@pytest.mark.parametrize(
    "parts", [[Dent(depth=5e-6, radius=5e-5)], [Sphere(radius=9e-3), Ellipsoid(radius_x=-8e-3, radius_y=1e6)]]
)
def test_a_contact_without_end_blames_the_surface(parts: list[Surface], number: str) -> None:
    """A dent leaves the plane about it, and a ball no groove that is sharper."""
    bodies = {"body_1": STEEL, "body_2": STEEL} | {f"body_{number}": {**STEEL, "surface": parts}}
    with pytest.raises(
        DeckError, match=rf"^body\.{number}\.surface: the contact has no end; expected a shape"
    ):
        Case(**bodies, spacing=1e-5, normal_load=10.0)


def test_waves_without_end_name_the_window_that_repeats() -> None:
    body = {**STEEL, "surface": {"shape": "waviness", "amplitude": 1e-7, "wavelength": 1e-4}}
    with pytest.raises(DeckError, match=r'or a window that repeats, grid.boundary = "periodic"'):
        Case(body_1=body, body_2=STEEL, spacing=3e-6, normal_load=10.0)


def test_a_profile_by_moduli_needs_them() -> None:
    with pytest.raises(DeckError, match="design_load: its profile follows from the moduli of the bodies"):
        Roller(radius=1.0, length=2.0, profile="logarithmic", design_load=1.0).height(0.0, 0.0)


@pytest.mark.parametrize("surface", [Torus(ring_radius=1e-3, radius=1e-2), Dent(depth=1e-6, radius=1e-4)])
def test_a_spacing_of_its_own_needs_one_spot(surface: Surface) -> None:
    with pytest.raises(DeckError, match="^grid.spacing = .*touch in one ellipse"):
        Case(body_1={**STEEL, "surface": surface}, body_2=STEEL, normal_load=20.0, spacing="auto")


def test_waves_that_the_lattice_does_not_resolve_warn() -> None:
    surfaces = [Sphere(radius=1e-2), Waviness(amplitude=1e-8, wavelength=1e-5)]
    body = {**STEEL, "surface": [one.written() for one in surfaces]}
    found = [
        Case(body_1=body, body_2=STEEL, normal_load=20.0, spacing=spacing).warnings
        for spacing in (4e-6, 2e-6)
    ]
    assert ["shortest wave" in " ".join(warnings) for warnings in found] == [True, False]


def test_a_crown_that_ends_the_contact_stands_beside_its_ellipse() -> None:
    """Contact within the length of a crowned roller is that of an ellipsoid (Hertz)."""
    roller = Roller(radius=5e-3, length=2e-3, profile="crown", crown_radius=0.2, angle="20 deg")
    result = Case(
        body_1={**STEEL, "surface": roller}, body_2=STEEL, normal_load=20.0, nodes_in_radius=20
    ).run()
    rows = against_hertz(result.deck, result.dataset.attrs, result.history.to_dict("records")[-1])
    assert {name for name, *_ in rows} >= {"max_pressure", "approach", "contact_semi_major"}
    assert all(computed == pytest.approx(exact, rel=5e-3) for _, exact, computed, _ in rows)
    assert {entry.quantity: entry.exact for entry in result.compare()}["max_pressure"] == pytest.approx(
        rows[0][1]
    )


def test_a_logarithmic_roller_is_loaded_evenly_at_its_design_load() -> None:
    """Load by length within 1 % up to 0.95 of the half-length (Johns and Gohar: b/l = 0.02)."""
    half_width, half_length, radius = 20e-6, 1e-3, 5e-3
    by_length = math.pi * E_STAR * half_width**2 / (4 * radius)
    load = 2 * half_length * by_length
    roller = Roller(
        radius=radius, length=2 * half_length, angle="90 deg", profile="logarithmic", design_load=load
    )
    case = Case(
        body_1={**STEEL, "surface": roller},
        body_2=STEEL,
        spacing=2e-6,
        cell_ratio=4.0,
        cell_angle="90 deg",
        normal_load=load,
    )
    last = case.run().dataset.isel(step=-1)
    carried = last["pressure"].values.sum(axis=1) * 2e-6 / by_length
    y = last["y"].values[:, 0]
    assert abs(carried[abs(y) < 0.95 * half_length] - 1.0).max() < 0.01
    middle = last["pressure"].values[len(y) // 2].max()
    assert middle == pytest.approx(2 * by_length / (math.pi * half_width), rel=3e-3)


@pytest.mark.parametrize(
    ("load", "ratio", "warns"),
    [(13.0, 4, True), (13.0, 2, True), (13.0, 1, False), (8.0, 4, False), (14.5, 4, False)],
)
def test_cells_that_do_not_resolve_the_end_of_a_logarithmic_roller_warn(
    load: float, ratio: int, warns: bool
) -> None:
    """At 13 N p_max is 228 MPa on 1 um along the axis, 255 on 4 and 260 on 8; at 8 N contact ends before."""
    deck = ROOT / "cases/logarithmic_roller.toml"
    case = Case.from_toml(deck, {"load.1.normal_load": load, "grid.cell_ratio": ratio})
    assert any("do not resolve its ends" in sentence for sentence in case.warnings) == warns


# A node lies on the end at 8 um along the axis, and at 4 and 2 um; none does on the others.
@pytest.mark.parametrize(
    ("spacing", "ratio"),
    [(2e-6, 4.0), (2.005e-6, 4.0), (2.01e-6, 4.0), (2e-6, 2.0), (2e-6, 1.0), (2.003e-6, 1.0)],
)
@pytest.mark.parametrize("share", [0.6, 0.75, 1.1, 1.25])
def test_the_end_of_a_logarithmic_roller_is_unbounded_from_its_design_load_on(
    share: float, spacing: float, ratio: float
) -> None:
    """Below it contact ends before the roller, on 1 um as well; p_max there is that of 1 um."""
    roller = Roller(radius=5e-3, length=2e-3, angle="90 deg", profile="logarithmic", design_load=20.0)
    lattice = {"spacing": spacing, "cell_ratio": ratio, "cell_angle": "90 deg"}
    case = Case(body_1={**STEEL, "surface": roller}, body_2=STEEL, **lattice, normal_load=20.0 * share)
    found = float(case.run().max_pressure[-1])
    if share > 1.0:
        assert math.isinf(found)
    else:
        assert found == pytest.approx({0.6: 215.76e6, 0.75: 238.14e6}[share], rel=2e-3)


# --- two surfaces ------------------------------------------------------------------------------------------


def test_heights_of_both_bodies_add_up() -> None:
    gap = Separation(Sphere(radius=1.0), Sphere(radius=3.0))
    np.testing.assert_allclose(
        gap(np.array([0.0, 0.6]), np.array([0.0, 0.8])), [0.0, 1 / 2 + 1 / 6], rtol=1e-15
    )
    assert gap.first_touch == (0.0, 0.0, 0.0)


def test_two_spheres_side_by_side_touch_between_their_centers() -> None:
    # min of r^2/(2 R1) + (d - r)^2/(2 R2): r = d R1/(R1 + R2), height d^2/(2 (R1 + R2))
    gap = Separation(Sphere(radius=1.0, offset=[1.0, 2.0]), Sphere(radius=3.0, offset=[5.0, 2.0]))
    x, y, height = gap.first_touch
    assert (x, y, height) == pytest.approx((2.0, 2.0, 2.0), rel=1e-14)
    # in between, the sum is a sphere of R = 3/4 about that point
    assert float(gap(2.5, 2.0)) == pytest.approx(0.25 / 1.5, rel=1e-13)


def test_crossed_cylinders_with_offsets_touch_where_their_axes_cross() -> None:
    gap = Separation(
        Cylinder(radius=1.0, offset=[3.0, 0.5]), Cylinder(radius=2.0, angle="90 deg", offset=[-1.0, 9.0])
    )
    assert gap.first_touch == pytest.approx((-1.0, 0.5, 0.0), abs=1e-14)


def test_parallel_cylinders_side_by_side_touch_along_a_line() -> None:
    gap = Separation(Cylinder(radius=1.0), Cylinder(radius=3.0, offset=[0.0, 4.0]))
    _, y, height = gap.first_touch
    assert (y, height) == pytest.approx((1.0, 2.0), rel=1e-14)


@pytest.mark.parametrize(
    ("one", "two"),
    [
        (Sphere(radius=2.0, exact=True), Sphere(radius=1.0, exact=True, offset=[0.3, 0.4])),
        (Cone(slope=0.2), Sphere(radius=1.0, offset=[0.5, 0.0])),
        (Cone(slope=0.2), Cone(slope=0.1, offset=[0.5, 0.2])),
        (
            Power(exponent=3, coefficient=2.0),
            Paraboloid(radius_x=3, radius_y=1, angle="20 deg", offset=[0.5, 0.2]),
        ),
        (
            RoundedPunch(flat_radius=0.2, edge_radius=1.0),
            Cylinder(radius=1.0, angle="30 deg", offset=[1.0, 0.0]),
        ),
        (Punch(radius=0.3), Paraboloid(radius_x=3, radius_y=1, angle="20 deg", offset=[0.7, 0.6])),
        (Power(exponent=0.5, coefficient=1.0), Power(exponent=0.5, coefficient=3.0, offset=[1.0, 0.0])),
    ],
)
def test_first_touch_is_the_lowest_point_of_the_plane(one: Surface, two: Surface) -> None:
    gap = Separation(one, two)
    x, y, _ = gap.first_touch
    assert float(gap(x, y)) == 0.0
    # nowhere on a fine grid, nor close by, is the sum lower by more than the rounding of the search
    near = np.add.outer(
        np.array([x, y]), 10.0 ** np.linspace(-6, -1, 40)[:, None] * np.cos(np.linspace(0, 6.28, 40))
    )
    grid = np.meshgrid(np.linspace(-1, 2, 601), np.linspace(-1, 2, 601))
    assert min(gap(*grid).min(), gap(near[0], near[1].T).min()) > -1e-12
    # the order of the bodies does not matter
    assert Separation(two, one).first_touch[2] == pytest.approx(gap.first_touch[2], rel=1e-12, abs=1e-15)


def test_first_touch_of_a_cone_and_a_sphere() -> None:
    # m r + (d - r)^2/(2 R): r = d - m R = 0.3, height 0.2 * 0.3 + 0.2^2/2 = 0.08
    gap = Separation(Cone(slope=0.2), Sphere(radius=1.0, offset=[0.5, 0.0]))
    assert gap.first_touch == pytest.approx((0.3, 0.0, 0.08), abs=1e-8)
    assert gap.first_touch[2] == pytest.approx(0.08, rel=1e-14)


def test_surfaces_that_never_face_each_other_are_refused() -> None:
    gap = Separation(Punch(radius=1.0), Punch(radius=1.0, offset=[3.0, 0.0]))
    with pytest.raises(DeckError, match="side by side"):
        _ = gap.first_touch


def test_principal_curvatures_of_crossed_cylinders() -> None:
    # angle 60 degrees, R = 75 and 50 mm: the major axis of the published ellipse lies at 39.5533 degrees
    # (tests/reference/benchmarks.csv, section 9.3)
    one, two = Cylinder(radius=0.075).curvature, Cylinder(radius=0.05, angle="60 deg").curvature
    assert one is not None
    assert two is not None
    smaller, larger, angle = principal_curvatures(one + two)
    assert math.degrees(angle) == pytest.approx(39.5533, abs=1e-4)
    k1, k2 = 1 / 0.075, 1 / 0.05
    spread = math.sqrt(k1**2 + k2**2 + 2 * k1 * k2 * math.cos(math.radians(120)))
    assert smaller == pytest.approx((k1 + k2 - spread) / 2, rel=1e-13)
    assert larger == pytest.approx((k1 + k2 + spread) / 2, rel=1e-13)


@pytest.mark.parametrize("degrees", [-80, -30, 0, 20, 60, 90])
def test_principal_direction_is_the_first_axis_of_a_paraboloid(degrees: float) -> None:
    tensor = Paraboloid(radius_x=5.0, radius_y=1.0, angle=f"{degrees} deg").curvature
    assert tensor is not None
    smaller, larger, angle = principal_curvatures(tensor)
    assert (smaller, larger) == pytest.approx((0.2, 1.0), rel=1e-14)
    assert math.sin(angle - math.radians(degrees)) == pytest.approx(0.0, abs=1e-14)
    assert -math.pi / 2 < angle <= math.pi / 2


def test_a_new_shape_needs_its_class_and_a_word() -> None:
    @shape("wedge")
    class Wedge(Surface):
        """A wedge."""

        slope: Annotated[float, Quantity(NUMBER, above=0)] = meaning(..., "slope m")
        formula: ClassVar[str] = "h = m |x|"

        def _height(self, x: Any, y: Any) -> Any:
            return self.slope * abs(x) + 0 * y

    try:
        body = Body.model_validate({"rigid": True, "surface": {"shape": "wedge", "slope": 0.1}})
        assert body.surface == Wedge(slope=0.1)
        assert body.surface.height(-2.0, 1.0) == 0.2
        assert body.written(defaults=False)["surface"] == {
            "shape": "wedge",
            "offset": [0.0, 0.0],
            "tilt": ["0 deg", "0 deg"],
            "moves": False,
            "slope": 0.1,
        }
        found = [
            one["title"]
            for one in deck_schema()["$defs"]["Body"]["properties"]["surface"]["anyOf"][0]["oneOf"]
        ]
        assert found == list(SHAPES)
        assert SHAPES["wedge"] is Wedge
    finally:
        del SHAPES["wedge"]
    with pytest.raises(ValueError, match=r"slope"):
        Wedge(slope=-1.0)


def test_pads_of_a_deck_are_those_of_a_function() -> None:
    """The deck of two pads, on a coarse lattice, against the same gap from Python."""
    deck = Case.from_toml(ROOT / "cases/two_pads.toml", {"grid.spacing": 15e-6})
    from_deck = deck.run().dataset

    def gap(x: Any, y: Any) -> Any:
        return np.minimum((x + 0.25e-3) ** 2, (x - 0.25e-3) ** 2 + 3e-9) / 2e-2 + y**2 / 2e-2

    steel = {"young_modulus": 210e9, "poisson_ratio": 0}
    loads = [{"normal_load": 40.0}, {"tangential_load_x": "0.9 mu P", "steps": 3}]
    extent = (1e-3, 0.5e-3)
    same = Case(
        body_1=steel,
        body_2=steel,
        gap=gap,
        friction_coefficient=0.4,
        spacing=15e-6,
        extent=extent,
        loads=loads,
    )
    other = same.run().dataset
    for name in ("pressure", "traction_x", "gap"):
        np.testing.assert_allclose(from_deck[name].values, other[name].values, rtol=1e-9, atol=1e-12)
    pressure = from_deck["pressure"][-1]
    left, right = (float(pressure.where(side).sum()) for side in (from_deck.x < 0, from_deck.x > 0))
    assert left > 1.1 * right > 0


@pytest.mark.parametrize("bad", ["x + z", "import os", "min(x)", "", 3.0, "x.y"])
def test_bad_formula(bad: Any) -> None:
    with pytest.raises(DeckError, match=r"expression.*expected a formula of x and y in m") as caught:
        FormulaSurface(expression=bad)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        ("sqrt(x)", "expected numbers, .*; it is NaN"),
        ("9**9**9**9*x", "expected numbers, .*; it is -inf"),
        ("9**9**9**9*(x**2 + y**2)", "nothing can touch at the center, where no height is finite"),
    ],
)
def test_formula_without_a_value(expression: str, words: str) -> None:
    with pytest.raises(DeckError, match=rf"body\.1\.surface\.expression: {words}"):
        Case.from_toml(ROOT / "cases/two_pads.toml", {"body.1.surface.expression": expression})
