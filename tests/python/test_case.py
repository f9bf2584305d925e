"""Cases: from decks and from Python, the window they choose, and what they refuse."""

import dataclasses
import math
import pickle
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from hexcontact.analytic import hertz_ellipse
from hexcontact.case import Body, Case
from hexcontact.core.contact import ElasticPair, NormalContact, NormalSolution
from hexcontact.core.lattice import Lattice, Pattern
from hexcontact.deck import keys as tables
from hexcontact.deck.faults import Source
from hexcontact.deck.separation import Separation
from hexcontact.deck.surfaces import SHAPES, Cylinder, Paraboloid, Punch, Sphere
from hexcontact.deck.toml import STARTERS, starter, written
from hexcontact.errors import DeckError
from hexcontact.problem.preview import case_rows
from hexcontact.problem.window import estimate_contact

CASES = Path(__file__).parents[2] / "cases"
STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}
BALL = {**STEEL, "surface": Sphere(radius=0.01)}

DECK = """\
[body.1]
young_modulus = "210 GPa"
poisson_ratio = 0.3
surface = { shape = "sphere", radius = "10 mm", offset = ["0 mm", "0 mm"] }

[body.2]
young_modulus = "210 GPa"
poisson_ratio = 0.3

[grid]
nodes_across = 21

[[load]]
normal_load = "100 N"
steps = 2
"""


HALF_MM = np.linspace(-0.5e-3, 0.5e-3, 41)
NINE = Lattice(1e-5, row_first=-1, col_first=-1, n_row=3, n_col=3)


def measured(x: ArrayLike = HALF_MM, y: ArrayLike = HALF_MM) -> xr.DataArray:
    """Return the gap of `BALL` on a flat at the points of a rectangular grid (m)."""
    map_of = xr.DataArray(x, dims="x", coords={"x": x}) ** 2 + xr.DataArray(y, dims="y", coords={"y": y}) ** 2
    return map_of / 0.02


def sphere_on_flat(**keys: Any) -> Case:
    return Case(**{"body_1": BALL, "body_2": STEEL, "normal_load": 100.0, **keys})


def hertz_radius(case: Case, radius: float, load: float) -> float:
    return (3 * load * radius / (4 * case.pair.effective_modulus)) ** (1 / 3)


def complaint(**keys: Any) -> str:
    with pytest.raises(DeckError) as error:
        sphere_on_flat(**keys)
    return str(error.value)


def solved(case: Case) -> NormalSolution:
    """Solve the last load step of a case, which is the one with the largest load here."""
    gap, candidate = case.initial_gap(case.lattice)
    contact = NormalContact(case.lattice, case.pair, gap, candidate, case.method_for(case.lattice))
    target = case.load_steps[-1].z
    if target.control == "force":
        return contact.solve(normal_load=target.value)
    return contact.solve(approach=target.value)


def on_rim(field: NDArray[Any]) -> bool:
    contact = field > 0
    return bool(contact[[0, -1]].any() or contact[:, [0, -1]].any())


# --- decks -------------------------------------------------------------------------------------------------


DECKS = [path for path in sorted(CASES.glob("*.toml")) if not path.stem.startswith("study_")]


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_the_decks_of_the_cases_are_right(path: Path) -> None:
    case = Case.from_toml(path)
    text = path.read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    surface = tables["body"]["1"].get("surface", {})
    included = "include" in tables or (isinstance(surface, dict) and "file" in surface)
    assert (case.deck_text == text) != included
    assert case.deck_text.startswith("# Put together from ") == included
    assert Case.from_text(case.deck_text) == case
    assert case.title
    assert case.load_steps


@pytest.mark.parametrize("name", STARTERS)
def test_the_starter_decks_are_right_and_solve(name: str) -> None:
    case = Case.from_text(starter(name), name)
    solution = solved(case)
    assert solution.converged
    assert not on_rim(solution.zone)


def test_the_readme_of_the_cases_names_them_all() -> None:
    text = (CASES / "README.md").read_text(encoding="utf-8")
    assert len(DECKS) > 5
    assert [path.name for path in CASES.glob("*.toml") if f"`{path.name}`" not in text] == []


def test_published_data_follow_from_the_decks() -> None:
    # Table 9.1 to all digits: E* = 107.7053 GPa, p0 = 854.3278 MPa, a = 0.7475813 mm, delta = 9.31463 um
    case = Case.from_toml(CASES / "hertz_spheres.toml")
    radius, load = 0.06, case.load_steps[0].z.value
    a = hertz_radius(case, radius, load)
    assert f"{case.pair.effective_modulus / 1e9:.4f}" == "107.7053"
    assert f"{3 * load / (2 * math.pi * a**2) / 1e6:.4f}" == "854.3278"
    assert f"{a * 1e3:.7f}" == "0.7475813"
    assert f"{a**2 / radius * 1e6:.5f}" == "9.31463"
    gap, _ = case.initial_gap(Lattice(a, 0, 1, 1, 1))
    assert float(gap[0, 0]) == pytest.approx(a**2 / (2 * radius), rel=1e-14)


@pytest.mark.parametrize(("nodes", "spacing"), [(11, 0.2), (21, 0.1), (31, 0.075), (41, 0.05), (51, 0.04)])
def test_meshes_of_table_9_2(nodes: int, spacing: float) -> None:
    case = Case.from_toml(
        CASES / "hertz_table_9_2.toml",
        overrides={"grid.window": [nodes, nodes], "grid.spacing": f"{spacing} mm"},
    )
    half = nodes // 2
    assert case.lattice == Lattice(spacing * 1e-3, -half, -half, nodes, nodes)
    assert case.window_fixed


def test_overrides_are_part_of_the_deck_that_the_case_keeps(tmp_path: Path) -> None:
    path = tmp_path / "deck.toml"
    path.write_text(DECK, encoding="utf-8")
    case = Case.from_toml(path, {"grid.nodes_across": None, "grid.spacing": "0.02 mm", "load.1.steps": 7})
    assert len(case.load_steps) == 7
    again = Case.from_text(case.deck_text)
    assert (again.lattice, again.load_steps) == (case.lattice, case.load_steps)
    with pytest.raises(DeckError, match=r"^override: grid.spacing = -1: expected a length"):
        Case.from_toml(path, {"grid.nodes_across": None, "grid.spacing": -1})


def test_friction_chooses_the_algorithm() -> None:
    def case(coefficient: str, solver: str = "") -> Case:
        return Case.from_text(f"{DECK}\n[friction]\ncoefficient = {coefficient}\n[solver]\n{solver}")

    for coefficient in ("0.3", "inf"):
        chosen = case(coefficient)
        assert (chosen.solver.algorithm, chosen.frictional) == ("incremental", True)
        assert chosen.friction_coefficient == float(coefficient)
    assert not case("0").frictional
    for algorithm in ("static", "incremental"):
        for coefficient in ("0", "0.3", "inf"):
            assert case(coefficient, f'algorithm = "{algorithm}"').solver.algorithm == algorithm
    assert case("0.3", 'coupling = "goodman"').solver.coupling == "goodman"
    assert "incremental" in repr(case("0.3"))


def test_friction_and_algorithm_have_to_agree() -> None:
    friction = "\n[friction]\ncoefficient = 0.3\n"
    with pytest.raises(DeckError) as error:
        Case.from_text(DECK + friction + '[solver]\nalgorithm = "frictionless"\n')
    assert str(error.value) == (
        'deck:18:1: friction.coefficient = 0.3: expected 0, since solver.algorithm = "frictionless"'
    )
    with pytest.raises(
        DeckError, match=r'friction.coefficient: missing; .* since solver.algorithm = "static"'
    ):
        Case.from_text(DECK + '\n[solver]\nalgorithm = "static"\n')


def test_without_friction_surfaces_may_be_moved_over_each_other_where_that_is_followed() -> None:
    frictionless = {"nodes_across": 21, "friction_coefficient": 0.0, "normal_load": None}
    followed = {**frictionless, "algorithm": "incremental"}
    moved, pulled = [{"normal_load": 100.0, key: 1e-6} for key in ("shift_x", "tangential_load_x")]
    assert sphere_on_flat(**followed, loads=[moved]).load_steps[0].x.value == 1e-6
    sentence = "expected 0, since friction.coefficient = 0"
    assert f"load.1.tangential_load_x = 1e-06: {sentence}" in complaint(**followed, loads=[pulled])
    without = {**frictionless, "friction_coefficient": None}
    sentence = "expected 0, or a [friction] table with a coefficient above 0"
    assert f"load.1.shift_x = 1e-06: {sentence}" in complaint(**without, loads=[moved])


def test_fields_that_a_frictionless_run_does_not_have_are_refused() -> None:
    assert "output.fields" in complaint(nodes_across=21, fields=["pressure", "traction_x"])
    assert "has no traction_x; it has pressure, gap, zone" in complaint(
        nodes_across=21, fields=["traction_x"]
    )
    assert sphere_on_flat(nodes_across=21, fields=["gap", "displacement_1_z"]).output.fields == (
        "gap",
        "displacement_1_z",
    )


# --- Python ------------------------------------------------------------------------------------------------


def test_arguments_and_deck_make_the_same_case() -> None:
    from_deck = Case.from_text(DECK)
    case = sphere_on_flat(nodes_across=21, steps=2)
    assert (case.pair, case.load_steps, case.lattice) == (
        from_deck.pair,
        from_deck.load_steps,
        from_deck.lattice,
    )
    np.testing.assert_array_equal(case.initial_gap(case.lattice)[0], from_deck.initial_gap(case.lattice)[0])
    bodies = {"body_1": Body(210e9, 0.3, surface=Sphere(radius=0.01)), "body_2": Body(210e9, 0.3)}
    assert sphere_on_flat(nodes_across=np.int64(21), **bodies).lattice == case.lattice
    assert sphere_on_flat(nodes_across=21, body_2=Body(rigid=True)).body_2.rigid
    assert repr(case) == "Case(frictionless, 21 x 21 nodes, 2 load steps)"


def test_a_body_is_checked_when_it_is_made() -> None:
    body = Body(210e9, 0.3, surface=Sphere(radius=0.01))
    assert (body.young_modulus, body.poisson_ratio, body.rigid) == (210e9, 0.3, False)
    case = sphere_on_flat(nodes_across=21, body_1=body)
    assert case.body_1 == body
    assert case.body_2 == Body(210e9, 0.3, False, None)
    assert Body(None, None, True) == Body(rigid=True)
    with pytest.raises(TypeError):
        Body(210e9, 0.3, False, None, "steel")  # type: ignore[call-arg]
    with pytest.raises(DeckError, match=r"^poisson_ratio = 0.6: expected a number above -1 and at most 0.5$"):
        Body(210e9, 0.6)
    with pytest.raises(DeckError, match=r"^poisson_ratio: missing; expected a number such as 0.3"):
        Body(young_modulus=210e9, poisson_ratio=None)


@pytest.mark.parametrize("said", ["", 'surface = { shape = "flat", offset = ["1 um", "0 um"] }'])
def test_a_flat_body_has_no_surface(said: str) -> None:
    text = DECK.replace("[body.2]", f"[body.2]\n{said}")
    case = Case.from_text(text)
    assert case.body_2.surface is None
    assert dict(case_rows(case))["body 2"].endswith("; flat")
    assert case.initial_gap(case.lattice)[0].min() == 0


def test_the_file_of_the_output_is_a_path() -> None:
    case = Case.from_text(DECK, overrides={"output.file": "out/a.nc"})
    assert case.output.file == Path("out/a.nc")
    assert tables.Deck.parse(tomllib.loads(written(case.deck)), Source()).output == case.output
    assert Case.from_text(DECK).output.file is None


def test_a_dictionary_may_change_after_the_case_was_made() -> None:
    data = {
        "body": {"1": dict(BALL), "2": dict(STEEL)},
        "grid": {"spacing": 1e-5},
        "load": [{"approach": 1e-6}],
    }
    case = Case.from_dict(data)
    data["grid"]["spacing"] = 2e-5  # type: ignore[index]
    assert Case.from_text(case.deck_text) == case.changed({}) == case


def test_a_case_from_python_is_a_deck_too() -> None:
    case = sphere_on_flat(
        title="ellipse",
        body_2={
            **STEEL,
            "surface": Paraboloid(radius_x=0.02, radius_y=0.03, angle="20 deg", offset=[1e-5, 0]),
        },
        nodes_in_radius=np.float64(8),
        normal_load=None,
        loads=[
            {"normal_load": 50.0, "twist": 0.0},
            {"repeat": 2, "path": [{"normal_load": np.float32(100)}]},
        ],
        tolerance=1e-6,
    )
    again = Case.from_text(case.deck_text)
    for name in (
        "title",
        "body_1",
        "body_2",
        "pair",
        "solver",
        "load_steps",
        "output",
        "lattice",
        "deck_text",
    ):
        assert getattr(again, name) == getattr(case, name), name
    assert Case.from_dict(
        {"body": {"1": BALL, "2": STEEL}, "grid": {"spacing": 1e-5}, "load": [{"approach": 1e-6}]}
    )


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"spacing": -1.0}, 'grid.spacing = -1.0: expected a length above 0 such as "1 mm"'),
        ({"spacing": math.nan}, 'grid.spacing = nan: expected a length above 0 such as "1 mm"'),
        ({"nodes_across": 41, "normal_load": -1}, "load.1.normal_load = -1: expected a force of at least 0"),
        (
            {"nodes_across": 41, "normal_load": 0},
            "load.1.normal_load = 0.0: expected a normal load or an approach",
        ),
        ({"nodes_across": 41, "normal_load": None}, "load.1: expected at least one of normal_load"),
        (
            {"nodes_across": 41, "loads": []},
            "loads: expected either loads, or one load or motion with steps",
        ),
        (
            {"nodes_across": 41, "normal_load": None, "loads": [{"normal_load": 1.0}, {"twist": "1 deg"}]},
            'load.2.twist = "1 deg": expected 0, or a [friction] table',
        ),
        ({"nodes_across": 41, "normal_load": None, "loads": [3]}, "load.1 = 3: expected a table of keys"),
        (
            {"nodes_across": 41, "body_1": {**BALL, "poisson_ratio": 0.6}},
            "body.1.poisson_ratio = 0.6: expected",
        ),
        ({"nodes_across": 41, "body_1": 3}, "body.1 = 3: expected a table of keys"),
        ({"nodes_across": 41, "body_1": STEEL}, "body.2.surface: the two surfaces touch everywhere"),
        (
            {"nodes_across": 41, "body_1": {**STEEL, "surface": {"shape": "cylinder", "radius": 1}}},
            "body.1.surface: the two surfaces touch along a line, so the contact has no end",
        ),
        (
            {
                "nodes_across": 41,
                "body_1": {**STEEL, "surface": Punch(radius=1e-3)},
                "body_2": {**STEEL, "surface": Punch(radius=1e-3, offset=[3e-3, 0])},
            },
            "body.2.surface: the two surfaces nowhere face each other",
        ),
        ({"spacing": 1e-5, "gap": abs}, "gap: expected either a gap or surfaces of the bodies, not both"),
        (
            {"spacing": 1e-5, "body_1": STEEL, "gap": np.ones((3, 3))},
            "gap: an array needs lattice=..., at whose nodes it is given; heights on a rectangular grid are",
        ),
        (
            {"spacing": 1e-5, "window": [3, 3], "body_1": STEEL, "gap": np.ones((3, 3))},
            "gap: an array needs lattice=..., ",
        ),
        (
            {"lattice": NINE, "body_1": STEEL, "gap": np.ones((4, 4))},
            "gap: an array of shape (4, 4), expected (3, 3)",
        ),
        (
            {"lattice": NINE, "body_1": STEEL, "gap": np.full((3, 3), np.nan)},
            "gap: expected numbers, or inf",
        ),
        ({"lattice": NINE, "spacing": 1e-5}, "spacing: expected a lattice, or keys of the grid, not both"),
        (
            {"spacing": 1e-5, "body_1": STEEL, "gap": lambda x, y: 0.0},
            "gap: expected an array of the shape of x",
        ),
        (
            {"lattice": NINE, "body_1": STEEL, "gap": np.full((3, 3), -np.inf)},
            "gap: expected numbers, or inf",
        ),
    ],
)
def test_arguments_get_the_sentences_of_decks(keys: dict[str, Any], sentence: str) -> None:
    assert complaint(**keys).startswith(sentence)


def bowl(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the gap of `BALL` on a flat, with a hole in the middle."""
    return np.where(np.hypot(x, y) < 5e-5, np.inf, (x**2 + y**2) / 0.02)


def test_the_deck_of_a_case_finds_a_given_window_again() -> None:
    lattice = Lattice(3e-5, row_first=-11, col_first=-14, n_row=25, n_col=24, origin=(1e-6, 3e-6))
    case = sphere_on_flat(lattice=lattice)
    assert case.lattice == lattice
    assert Case.from_text(case.deck_text).lattice == lattice


def test_a_function_may_change_the_array_that_it_returned() -> None:
    kept = []

    def gap(x: Any, y: Any) -> Any:
        kept.append((x**2 + y**2) / 0.02)
        return kept[-1]

    case = sphere_on_flat(body_1=STEEL, gap=gap, nodes_across=11)
    step, result = next(case.start()), case.run()
    for values in kept:
        values += 1.0
    assert step.initial_gap.max() < 1.0
    assert float(result.initial_gap.max()) < 1.0


def test_a_gap_may_be_a_function_or_an_array() -> None:
    by_function = sphere_on_flat(body_1=STEEL, gap=bowl, nodes_across=31)
    assert not by_function.window_fixed
    gap, candidate = by_function.initial_gap(by_function.lattice)
    assert not candidate[15, 15]
    assert candidate[0, 0]

    by_array = sphere_on_flat(body_1=STEEL, gap=gap, lattice=by_function.lattice)
    assert by_array.window_fixed
    assert by_array.lattice == by_function.lattice
    np.testing.assert_array_equal(by_array.initial_gap(by_array.lattice)[0], gap)
    first, second = solved(by_function), solved(by_array)
    np.testing.assert_array_equal(first.pressure, second.pressure)
    assert first.pressure[15, 15] == 0

    for case in (by_function, by_array):
        with pytest.raises(DeckError, match="the gap of this case was given in Python"):
            Case.from_text(case.deck_text)


def test_a_rectangular_height_map_is_where_its_coordinates_are() -> None:
    x, y = np.linspace(-0.4e-3, 0.5e-3, 46), np.linspace(-0.45e-3, 0.4e-3, 35)
    across = sphere_on_flat(body_1=STEEL, gap=measured(x, y), nodes_in_radius=15)
    expected = solved(sphere_on_flat(nodes_in_radius=15))
    found = solved(across)
    assert found.pressure.max() == pytest.approx(expected.pressure.max(), rel=1e-9)
    beyond = across.initial_gap(Lattice(1e-5, 0, 49, 1, 3))[0]
    np.testing.assert_allclose(beyond, [[0.49e-3**2 / 0.02, 0.5e-3**2 / 0.02, np.inf]], rtol=1e-12)

    in_um = measured(x, y).assign_coords(x=x * 1e6, y=y * 1e6) * 1e6
    in_um.x.attrs["units"] = in_um.y.attrs["units"] = in_um.attrs["units"] = "µm"
    for other in (measured(x, y).T, measured(x[::-1], y), in_um):
        case = sphere_on_flat(body_1=STEEL, gap=other, nodes_in_radius=15)
        np.testing.assert_allclose(
            case.initial_gap(across.lattice)[0], across.initial_gap(across.lattice)[0], rtol=1e-12, atol=1e-20
        )


@pytest.mark.parametrize("side", ["left", "right", "bottom", "top"])
@pytest.mark.parametrize("keys", [{"window": [81, 81]}, {}])
def test_contact_at_the_end_of_a_height_map_is_an_error(side: str, keys: dict[str, Any]) -> None:
    ends = {name: 0.26e-3 if name == side else 0.5e-3 for name in ("left", "right", "bottom", "top")}
    x = np.linspace(-ends["left"], ends["right"], 41)
    y = np.linspace(-ends["bottom"], ends["top"], 41)
    case = sphere_on_flat(body_1=STEEL, gap=measured(x, y), spacing=1e-5, steps=4, normal_load=300.0, **keys)
    assert 0.25e-3 < hertz_radius(case, 0.01, 300.0) < 0.27e-3
    done = []
    with pytest.raises(DeckError, match="gap: the contact of load step 4 reaches the end of the height map"):
        case.run(on_step=done.append)
    assert len(done) == 3


def test_nothing_can_touch_beyond_a_height_map() -> None:
    with pytest.raises(DeckError, match="no window can be found: nothing can touch at the center"):
        sphere_on_flat(body_1=STEEL, gap=measured(), spacing=1e-5, center=(1.0, 1.0))


def test_the_window_of_a_height_map_is_about_its_lowest_point() -> None:
    moved = measured().assign_coords(x=HALF_MM + 3e-3, y=HALF_MM - 2e-3)
    case = sphere_on_flat(body_1=STEEL, gap=moved, nodes_in_radius=8, origin=(3e-3, -2e-3))
    about_zero = sphere_on_flat(body_1=STEEL, gap=measured(), nodes_in_radius=8)
    assert case.lattice.shape == about_zero.lattice.shape
    assert solved(case).pressure.max() == pytest.approx(solved(about_zero).pressure.max(), rel=1e-9)


@pytest.mark.parametrize(
    ("gap", "sentence"),
    [
        (measured().rename(x="u", y="v"), "gap: expected coordinates x and y (m), not u and v"),
        (measured().expand_dims("step"), "gap: expected the dimensions of x and y, not step, x and y"),
        (measured().isel(x=[0, 0, 1]), "gap: expected numbers at all points of a rectangular grid"),
        (measured().assign_attrs(units="N"), "gap: values in N: expected lengths"),
        (measured().to_pandas(), "gap: expected an xarray.DataArray or an array, not a DataFrame"),
        (measured().to_dataset(name="h"), "gap: expected an xarray.DataArray or an array, not a Dataset"),
        (measured().drop_vars(["x", "y"]), "gap: an array needs lattice=..., "),
    ],
)
def test_a_height_map_that_does_not_say_where_it_is_gets_a_sentence(gap: Any, sentence: str) -> None:
    assert complaint(body_1=STEEL, gap=gap, spacing=1e-5).startswith(sentence)


def test_the_matrix_of_an_array_is_as_large_as_its_contact() -> None:
    """If the whole window counted, it would take gigabytes; the contact has a hundredth of its nodes."""
    lattice = Lattice(1e-5, -60, -60, 121, 121)
    radius = 5e-3
    gap = (lattice.x**2 + lattice.y**2) / (2 * radius)
    case = sphere_on_flat(
        body_1=STEEL, gap=gap, lattice=lattice, normal_load=5.0, friction_coefficient=0.3, method="direct"
    )
    area = math.pi * hertz_radius(case, radius, 5.0) ** 2
    assert case.contact_nodes(lattice) == pytest.approx(area / lattice.cell_area, rel=0.05)
    assert case.memory_needed(lattice) < 20e6


def test_coordinates_of_an_array_must_be_those_of_the_nodes() -> None:
    result = sphere_on_flat(nodes_across=15).run()
    lattice, gap = result.lattice, result.initial_gap
    by_map = sphere_on_flat(body_1=STEEL, gap=gap, lattice=lattice)
    np.testing.assert_array_equal(by_map.initial_gap(lattice)[0], gap)
    finer = dataclasses.replace(lattice, spacing=0.5 * lattice.spacing)
    sentence = "gap: its coordinate x is not that of the nodes of the lattice"
    assert complaint(body_1=STEEL, gap=gap, lattice=finer) == sentence
    assert complaint(body_1=STEEL, gap=gap.T, lattice=lattice) == sentence
    assert complaint(body_1=STEEL, gap=gap.transpose(transpose_coords=False), lattice=lattice) == sentence
    with pytest.raises(DeckError, match="initial_gap: its coordinate x is not that of the nodes"):
        NormalContact(finer, by_map.pair, gap)
    square = measured(HALF_MM[:15], HALF_MM[:15])
    with pytest.raises(DeckError, match="initial_gap: its coordinate x is not that of the nodes"):
        NormalContact(lattice, by_map.pair, square)


@pytest.mark.parametrize(
    "changes",
    [
        {"grid.spacing": 2e-5},
        {"grid.window": [4, 4]},
        {"grid.origin": [1e-6, 0.0]},
        {"grid.center": [1e-4, 0.0]},
        {"grid.window": None},
        {"grid.window": None, "grid.extent": [2e-5, 2e-5]},
        {"grid": {"spacing": 2e-5, "window": [3, 3]}},
    ],
)
def test_a_change_that_would_move_a_gap_over_nodes_is_refused(changes: dict[str, Any]) -> None:
    moved = dataclasses.replace(NINE, row_first=5, col_first=-7)
    case = sphere_on_flat(body_1=STEEL, gap=np.eye(3), lattice=moved, friction_coefficient=0.1)
    other = case.changed({"friction.coefficient": 0.2, "grid.spacing": "10 um"})
    assert (other.lattice, other.friction_coefficient) == (moved, 0.2)
    with pytest.raises(DeckError, match=r"grid.*: the gap of this case is an array over the nodes"):
        case.changed(changes)


def test_a_change_of_the_grid_leaves_a_height_map_in_place() -> None:
    case = sphere_on_flat(body_1=STEEL, gap=measured(), nodes_in_radius=8)
    finer = case.changed({"grid.nodes_in_radius": 16})
    assert solved(finer).approach == pytest.approx(solved(case).approach, rel=3e-3)


def test_arguments_may_change_as_keys_do() -> None:
    case = sphere_on_flat(nodes_in_radius=8, friction_coefficient=0.3)
    for arguments, keys in (
        ({"spacing": "10 um"}, {"grid.nodes_in_radius": None, "grid.spacing": 1e-5}),
        (
            {"friction_coefficient": 0.2, "tolerance": 1e-6},
            {"friction.coefficient": 0.2, "solver.tolerance": 1e-6},
        ),
        ({"normal_load": 2.0, "steps": 3}, {"load": [{"normal_load": 2.0, "steps": 3}]}),
        ({"accuracy": 0.05, "title": "again"}, {"accuracy.target": 0.05, "title": "again"}),
        ({"body_2": {"rigid": True}}, {"body.2": {"rigid": True}}),
    ):
        assert case.changed(**arguments) == case.changed(keys) != case  # type: ignore[arg-type]
    assert case.changed({"grid.nodes_in_radius": 9}, tolerance=1e-6).solver.tolerance == 1e-6
    with pytest.raises(TypeError, match="^spacin: unknown argument of Case.changed; did you mean spacing"):
        case.changed(spacin=1e-5)
    with pytest.raises(DeckError, match="^loads: expected either loads, or one load or motion"):
        case.changed(normal_load=1.0, loads=[{"approach": 1e-6}])


def test_cases_survive_pickling() -> None:
    for case in (
        sphere_on_flat(nodes_across=21),
        sphere_on_flat(body_1=STEEL, gap=bowl, nodes_across=21),
        sphere_on_flat(body_1=STEEL, gap=np.ones((3, 3)), lattice=NINE),
        sphere_on_flat(body_1=STEEL, gap=measured(), spacing=1e-5),
    ):
        copy = pickle.loads(pickle.dumps(case))
        assert (copy.lattice, copy.load_steps, copy.deck_text) == (
            case.lattice,
            case.load_steps,
            case.deck_text,
        )
        np.testing.assert_array_equal(copy.initial_gap(copy.lattice)[0], case.initial_gap(case.lattice)[0])


# --- the window --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("keys", [{"nodes_in_radius": 20}, {"nodes_across": 41}, {"spacing": 1e-5}])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (1.3e-3, -0.7e-3)])
def test_an_automatic_window_holds_the_contact_with_little_to_spare(
    keys: dict[str, Any], offset: tuple[float, float]
) -> None:
    case = sphere_on_flat(body_1={**STEEL, "surface": Sphere(radius=0.01, offset=offset)}, **keys)
    assert not case.window_fixed
    a = hertz_radius(case, 0.01, 100.0)
    if "nodes_in_radius" in keys:
        # the coarse estimate is good to a few per cent
        assert a / case.lattice.spacing == pytest.approx(20, rel=0.05)
    if "nodes_across" in keys:
        assert case.lattice.shape == (41, 41)
    solution = solved(case)
    assert not on_rim(solution.zone)
    assert (
        np.hypot(case.lattice.x - offset[0], case.lattice.y - offset[1])[solution.zone > 0].max() < 1.05 * a
    )
    # the smallest rhombus about a disc is 2 a/sin(60 degrees) wide
    needed = 2 * a / math.sin(math.pi / 3) / case.lattice.spacing + 1
    assert max(case.lattice.shape) <= 1.2 * needed + 6


@pytest.mark.parametrize("loads", [[{"approach": 2e-6}], [{"approach": 1e-6}, {"normal_load": 100.0}]])
def test_the_window_is_made_for_the_largest_load_of_any_kind(loads: list[dict[str, Any]]) -> None:
    case = sphere_on_flat(normal_load=None, loads=[*loads, {"normal_load": 1.0}], nodes_in_radius=10)
    radius = max(
        math.sqrt(0.01 * step.z.value)
        if step.z.control == "displacement"
        else hertz_radius(case, 0.01, step.z.value)
        for step in case.load_steps
    )
    assert radius / case.lattice.spacing == pytest.approx(10, rel=0.06)


def test_a_rectangular_extent_is_covered() -> None:
    case = sphere_on_flat(spacing=1e-5, extent=[1.2e-3, 0.6e-3], center=[1e-4, 0])
    assert case.window_fixed
    assert case.lattice == Lattice.covering(1e-5, (1e-4, 0.0), 1.2e-3, 0.6e-3)
    for keys in (
        {"nodes_across": 61},
        {"nodes_across": 60},
        {"nodes_across": 60, "center": [1.23e-4, 0.5e-5]},
    ):
        lattice = sphere_on_flat(extent=[1.2e-3, 0.6e-3], **keys).lattice
        assert lattice.shape == (keys["nodes_across"],) * 2
        center = keys.get("center", (0.0, 0.0))
        needed = Lattice.covering(lattice.spacing, center, 1.2e-3, 0.6e-3)
        assert lattice.row_first <= needed.row_first
        assert lattice.col_first <= needed.col_first
        assert lattice.row_first + lattice.n_row >= needed.row_first + needed.n_row
        assert lattice.col_first + lattice.n_col >= needed.col_first + needed.n_col
        finer = Lattice.covering(lattice.spacing * 0.96, center, 1.2e-3, 0.6e-3)
        assert max(finer.shape) > lattice.n_col - 1  # no finer spacing would have done


@pytest.mark.parametrize(("shape", "first"), [([61, 63], (-30, -31)), ([60, 62], (-30, -31))])
def test_a_given_window_is_centered(shape: list[int], first: tuple[int, int]) -> None:
    lattice = sphere_on_flat(spacing=1e-5, window=shape).lattice
    assert (lattice.row_first, lattice.col_first) == first
    assert lattice.shape == tuple(shape)
    moved = sphere_on_flat(spacing=1e-5, window=shape, center=[-3.2e-5, 0.2e-5], origin=[0.5e-5, 0]).lattice
    assert (moved.row_first, moved.col_first) == (first[0], first[1] - 4)
    assert moved.origin == (0.5e-5, 0.0)


def test_windows_that_do_not_fit_the_contact_are_refused() -> None:
    for keys, sentence in [
        ({"spacing": 1e-3}, "grid.spacing = 0.001: the spacing of 1 mm is larger than the contact"),
        ({"spacing": 1e-3, "window": [41, 41]}, "grid.spacing = 0.001: the spacing of 1 mm is larger"),
        (
            {"nodes_across": 5, "extent": [0.01, 0.01]},
            "grid.nodes_across = 5: the spacing of 3.94 mm is larger",
        ),
        ({"spacing": 1e-5, "window": [5, 5]}, "grid.window = [5, 5]: the window is smaller than the contact"),
        ({"spacing": 1e-5, "extent": [1e-4, 1e-4]}, "grid.extent = [0.0001, 0.0001]: the window is smaller"),
        (
            {"spacing": 1e-5, "window": [51, 51], "center": [1e-3, 0]},
            "grid.window = [51, 51]: the window is smaller",
        ),
        ({"spacing": 1e-10}, "grid.spacing = 1e-10: expected at most 100000 nodes along a side"),
    ]:
        assert complaint(**keys).startswith(sentence)
    assert "expected at least [4" in complaint(spacing=1e-5, window=[5, 5])
    # the limit is the half-width of the contact, 0.1866 mm
    assert "its half-width of about 0.19 mm" in complaint(spacing=0.2e-3)
    assert sphere_on_flat(spacing=0.17e-3).lattice.spacing == 0.17e-3


def test_a_contact_without_end_is_refused() -> None:
    def groove(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return x**2 + 0 * y

    def nothing(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0 * x

    for gap in (groove, nothing):
        assert complaint(body_1=STEEL, gap=gap, nodes_across=21).startswith(
            "grid: no window can be found: the"
        )


def test_growing_keeps_the_nodes() -> None:
    case = sphere_on_flat(nodes_across=21)
    lattice = case.lattice
    larger = lattice.grown(np.ones(lattice.shape, dtype=bool))
    assert (larger.spacing, larger.origin) == (lattice.spacing, lattice.origin)
    assert larger.shape == (33, 33)
    assert (larger.row_first, larger.col_first) == (lattice.row_first - 6, lattice.col_first - 6)
    contact = np.zeros(lattice.shape, dtype=bool)
    contact[0, 5] = contact[7, -1] = True
    larger = lattice.grown(contact)
    assert larger.shape == (27, 27)
    assert (larger.row_first, larger.col_first) == (lattice.row_first - 6, lattice.col_first)


def test_the_method_is_chosen_by_the_size() -> None:
    case = sphere_on_flat(nodes_across=41)
    assert case.method_for(Lattice(1e-5, 0, 0, 10, 10)) == "direct"
    assert case.method_for(case.lattice) == "fft"
    assert sphere_on_flat(nodes_across=41, method="direct").method_for(case.lattice) == "direct"
    assert case.memory_needed(case.lattice) < sphere_on_flat(nodes_across=41, method="direct").memory_needed(
        case.lattice
    )


@pytest.mark.parametrize("degrees", [8, 15, 40])
def test_the_estimate_resolves_the_narrow_side_of_an_ellipse(degrees: float) -> None:
    one = Cylinder(radius=0.05).curvature
    two = Cylinder(radius=0.05, angle=f"{degrees} deg").curvature
    assert one is not None
    assert two is not None
    pair = ElasticPair.from_materials(210e9, 0.3, None, None)
    ellipse = hertz_ellipse(pair.effective_modulus, one + two, normal_load=100.0)
    gap = Separation(Cylinder(radius=0.05), Cylinder(radius=0.05, angle=f"{degrees} deg"))
    estimate = estimate_contact(pair, gap, (0.0, 0.0), Pattern(), normal_load=100.0)
    # eight spacings or more in the half-width, whose edge is known to a fraction of one
    assert estimate.cell <= ellipse.semi_minor / 7
    assert estimate.half_width == pytest.approx(ellipse.semi_minor, rel=0.05)
    assert estimate.radius == pytest.approx(math.sqrt(ellipse.semi_major * ellipse.semi_minor), rel=0.05)


# Contacts of all sizes, as ratios so that they stay physical: radius of the sphere, a/R, E.
@settings(deadline=None, max_examples=25)
@given(
    st.floats(-7, 3),
    st.floats(-6, -1),
    st.floats(3, 12),
    st.floats(0.05, 1.0),
    st.floats(-90, 90),
    st.booleans(),
)
def test_the_estimate_is_right_for_any_hertzian_contact(
    log_radius: float, log_ratio: float, log_modulus: float, aspect: float, angle: float, by_load: bool
) -> None:
    radius, modulus = 10.0**log_radius, 10.0**log_modulus
    surface = Paraboloid(radius_x=radius, radius_y=aspect * radius, angle=f"{angle} deg")
    a = 10.0**log_ratio * math.sqrt(aspect) * radius
    # of a sphere with the same Gaussian curvature; an ellipse is not far from it
    load = 4 * modulus / (1 - 0.3**2) * a**3 / (3 * math.sqrt(aspect) * radius)
    body = {"young_modulus": modulus, "poisson_ratio": 0.3, "surface": surface}
    target = {"normal_load": load} if by_load else {"approach": a**2 / (math.sqrt(aspect) * radius)}
    case = Case(body_1=body, body_2={"rigid": True}, nodes_in_radius=10, **target)
    solution = solved(case)
    assert solution.converged
    assert not on_rim(solution.zone)
    area = case.lattice.cell_area * np.count_nonzero(solution.zone)
    # an estimate from some 200 nodes in contact
    assert math.sqrt(area / math.pi) / case.lattice.spacing == pytest.approx(10, rel=0.08)


# --- nothing but a DeckError -------------------------------------------------------------------------------

NASTY = [
    "nan", "inf", "-inf", "-1", "0", "1e308", "5e-324", "1e400", "1e-30", "1e30", "0x7fffffff",
    "99999999999999999999", "true", '""', '"3 kg"', '"1e999 mm"', '"1 mm"', '"5 deg"', '"\\u0000"',
    '"1 mm^99"', "'x'", '"frictionless"', "[]", "{}", "[[]]", "[nan, 1]", "[1, 2, 3]", "[41, 41]",
    '["1 mm", 2]', '{ shape = "cone" }', "2026-01-01",
]  # fmt: skip
TABLES = [tables.Body, tables.Grid, tables.Solver, tables.Load, tables.Output, *SHAPES.values()]
KEYS = sorted({key for table in TABLES for key in table.known_keys()})
TEXTS = [DECK, *(starter(name) for name in STARTERS)]


@st.composite
def mutated_decks(draw: st.DrawFn) -> str:
    lines = draw(st.sampled_from(TEXTS)).splitlines()
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(lines) - 1))
        kind = draw(st.sampled_from(["value", "key", "drop", "double", "insert", "cut", "swap"]))
        if kind == "value" and "=" in lines[place]:
            lines[place] = lines[place].split("=")[0] + "= " + draw(st.sampled_from(NASTY))
        elif kind == "key" and "=" in lines[place]:
            lines[place] = draw(st.sampled_from(KEYS)) + " =" + lines[place].split("=", 1)[1]
        elif kind == "drop" and len(lines) > 1:
            del lines[place]
        elif kind == "double":
            lines.insert(place, lines[place])
        elif kind == "insert":
            lines.insert(place, f"{draw(st.sampled_from(KEYS))} = {draw(st.sampled_from(NASTY))}")
        elif kind == "cut":
            lines[place] = lines[place][: draw(st.integers(0, len(lines[place])))]
        elif kind == "swap":
            other = draw(st.integers(0, len(lines) - 1))
            lines[place], lines[other] = lines[other], lines[place]
    return "\n".join(lines)


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(mutated_decks())
def test_a_mutated_deck_is_a_case_or_a_deck_error(text: str) -> None:
    try:
        case = Case.from_text(text)
    except DeckError as error:
        assert all(line.startswith("deck:") for line in str(error).splitlines())
        return
    assert case.lattice.size > 0
    assert case.load_steps


def test_nan_of_a_gap_function_is_named() -> None:
    with pytest.raises(DeckError, match=r"gap: expected numbers, or inf .*; it is NaN at x = -"):
        Case(
            body_1={"young_modulus": 210e9, "poisson_ratio": 0.3},
            body_2={"rigid": True},
            gap=lambda x, y: np.where(x < 0, np.nan, x**2 + y**2),
            spacing=1e-5,
            normal_load=1.0,
        )
