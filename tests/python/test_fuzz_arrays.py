"""Odd arrays and values in the Python interface: a result, or a sentence that is a `DeckError`."""

import dataclasses
import functools
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from fuzz.harness import time_limit
from numpy.typing import NDArray

from hexcontact import (
    Case,
    ContactState,
    DeckError,
    ElasticPair,
    FlexibilityOperator,
    FrictionalContact,
    HexcontactError,
    Lattice,
    NormalContact,
    RimWarning,
    Study,
    analytic,
    fatigue,
    influence,
)
from hexcontact.core import contact

LATTICE = Lattice(spacing=1e-4, row_first=-4, col_first=-4, n_row=9, n_col=9)
GAP = (LATTICE.x**2 + LATTICE.y**2) / 20e-3
HISTORY = 1e8 * np.outer([0.0, 1.0, -1.0], np.ones(6))
MIDDLE = np.arange(81).reshape(9, 9) == 40
PAIR = ElasticPair.from_materials(210e9, 0.3, 70e9, 0.33)
ELASTIC: dict[str, Any] = {"young_modulus": 210e9, "poisson_ratio": 0.3}
SPHERE: dict[str, Any] = {**ELASTIC, "surface": {"shape": "sphere", "radius": 10e-3}}
FORCES = ["force", "force", "force", "displacement"]

GOOD = {  # the same numbers in another form
    "good": GAP,
    "Fortran order": np.asfortranarray(GAP),
    "strided": np.repeat(np.repeat(GAP, 2, 0), 2, 1)[::2, ::2],
    "backwards": GAP[::-1, ::-1],  # the gap is symmetric
    "other byte order": GAP.astype(">f8"),
    "long double": GAP.astype(np.longdouble),
    "list": GAP.tolist(),
    "objects that are numbers": GAP.astype(object),
    "nothing masked": np.ma.array(GAP, mask=False),
}
ODD = {
    **{
        name: np.where(MIDDLE, value, GAP)
        for name, value in (("a NaN", np.nan), ("-inf", -np.inf), ("inf", np.inf))
    },
    **{
        f"all {value}": np.full((9, 9), value)
        for value in (np.nan, np.inf, -np.inf, 0.0, 1.0, 5e-324, 1e308, -1.0)
    },
    "negative": -GAP,
    "huge": GAP * 1e305,
    "float16": GAP.astype("f2"),
    "integers": np.ones((9, 9), int),
    "booleans": MIDDLE,
    "complex": GAP + 1j,
    "complex without an imaginary part": GAP + 0j,
    "masked": np.ma.masked_greater(GAP, 1e-5),
    "None": None,
    "Nones": np.full((9, 9), None),
    "text": GAP.astype(str),
    "words": np.full((9, 9), "x"),
    "bytes": GAP.astype("S"),
    "dates": np.zeros((9, 9), "M8[s]"),
    "records": np.zeros((9, 9), [("a", "f8")]),
    "ragged": [[1, 2], [3]],
    "flat": GAP.ravel(),
    "three dimensions": GAP[None],
    "a row less": GAP[:-1],
    "empty": np.zeros((0, 0)),
    "a number": 1.0,
    "a numpy number": np.float64(1.0),
    "an array of no dimension": np.array(1.0),
    "a huge integer": 10**400,
    "a word": "abc",
    "a dict": {},
    "a set": {1.0},
    "a function": lambda x, y: x,
    "a generator": None,  # is made when it is used
}


def case(**keys: Any) -> Case:
    given = {"body_1": SPHERE, "body_2": ELASTIC, "nodes_in_radius": 4, "loads": [{"normal_load": 1.0}]}
    return Case(**(given | keys))


def flat(gap: Any) -> Case:
    return case(body_1=ELASTIC, gap=gap, nodes_in_radius=None, lattice=LATTICE)


def friction(**changed: Any) -> ContactState:
    contact = FrictionalContact(LATTICE, PAIR, GAP, friction_coefficient=0.3)
    state = contact.advance(contact.virgin(), FORCES, [100.0, 5.0, 0.0, 0.0])
    return contact.advance(dataclasses.replace(state, **changed), FORCES, [100.0, 6.0, 0.0, 0.0])


def advanced(control: Any, value: Any) -> ContactState:
    contact = FrictionalContact(LATTICE, PAIR, GAP, friction_coefficient=0.3)
    return contact.advance(contact.virgin(), control, value)


def solved(**arguments: Any) -> object:
    return NormalContact(LATTICE, PAIR, GAP).solve(normal_load=10.0, **arguments)


def stepped(**arguments: Any) -> ContactState:
    contact = FrictionalContact(LATTICE, PAIR, GAP, friction_coefficient=0.3)
    return contact.advance(contact.virgin(), FORCES, [10.0, 1.0, 0.0, 0.0], **arguments)


def study(values: Any) -> Study:
    deck = {
        "body": {"1": SPHERE, "2": ELASTIC},
        "grid": {"nodes_in_radius": 4},
        "load": [{"normal_load": 1.0}],
    }
    return Study(deck, {"load.1.normal_load": values}, output="no_such_study.nc")


TAKERS: dict[str, Callable[[Any], object]] = {
    "gap": lambda a: flat(a).run(),
    "gap of a function": lambda a: flat(lambda x, y: a).run(),
    "series": lambda a: case(loads=[{"series": {"normal_load": a}}]),
    "values of a ramp": lambda a: case(loads=[{"normal_load": 3.0, "values": a}]),
    "loads": lambda a: case(loads=a),
    "modulus": lambda a: case(body_1=SPHERE | {"young_modulus": a}),
    "body": lambda a: case(body_1=a),
    "surface": lambda a: case(body_1=ELASTIC | {"surface": a}),
    "window": lambda a: case(nodes_in_radius=None, spacing=1e-5, window=a),
    "spacing": lambda a: case(nodes_in_radius=None, spacing=a),
    "center": lambda a: case(center=a),
    "deck": lambda a: Case.from_dict(a),
    "friction coefficient": lambda a: case(friction_coefficient=a),
    "gap of a contact": lambda a: NormalContact(LATTICE, PAIR, a).solve(normal_load=10.0),
    "candidates": lambda a: NormalContact(LATTICE, PAIR, GAP, a).solve(normal_load=10.0),
    "load of a contact": lambda a: NormalContact(LATTICE, PAIR, GAP).solve(normal_load=a),
    "approach of a contact": lambda a: NormalContact(LATTICE, PAIR, GAP).solve(approach=a),
    "tolerance of a contact": lambda a: NormalContact(LATTICE, PAIR, GAP).solve(normal_load=1.0, tolerance=a),
    "gap with friction": lambda a: FrictionalContact(LATTICE, PAIR, a, friction_coefficient=0.3),
    "mu with friction": lambda a: FrictionalContact(LATTICE, PAIR, GAP, friction_coefficient=a),
    "pressure of a state": lambda a: friction(pressure=a),
    "displacement of a state": lambda a: friction(relative_displacement_x=a),
    "gap of a state": lambda a: friction(gap=a),
    "values of an advance": lambda a: advanced(FORCES, a),
    "control of an advance": lambda a: advanced(a, [1.0, 0.0, 0.0, 0.0]),
    "tractions of an operator": lambda a: FlexibilityOperator(LATTICE, PAIR).apply(GAP, a, GAP),
    "points of kernels": lambda a: influence.pyramid_kernels(a, a),
    "Poisson's ratio of functions": lambda a: influence.pyramid_functions(0.0, 0.0, a),
    "triangle": lambda a: influence.triangle_integral(a, 0.0, 0.0, 0, 0, 0),
    "Hertz, load": lambda a: analytic.hertz_sphere(1e11, 1e-2, normal_load=a),
    "Hertz, places": lambda a: analytic.hertz_sphere(1e11, 1e-2, normal_load=3.0).pressure(a),
    "Hertz, tensor": lambda a: analytic.hertz_ellipse(1e11, a, normal_load=3.0),
    "lattice, spacing": lambda a: Lattice(spacing=a, row_first=0, col_first=0, n_row=3, n_col=3),
    "lattice, first row": lambda a: Lattice(spacing=1.0, row_first=a, col_first=0, n_row=3, n_col=3).x,
    "lattice, rows": lambda a: (
        Lattice(spacing=1.0, row_first=0, col_first=0, n_row=a, n_col=3).x if a is not True else 0
    ),
    "lattice, origin": lambda a: Lattice(spacing=1.0, row_first=0, col_first=0, n_row=3, n_col=3, origin=a).x,
    "pair": lambda a: ElasticPair.from_materials(a, 0.3, 1e9, 0.3),
    "lambda_1": lambda a: contact_of(ElasticPair(a, 0.0, 0.0)),
    "lambda_2": lambda a: contact_of(ElasticPair(1e-11, a, 0.0)),
    "lambda_5": lambda a: contact_of(ElasticPair(1e-11, 0.0, a)),
    "sweeps of a contact": lambda a: solved(max_sweeps=a),
    "sweeps of a step": lambda a: stepped(max_sweeps=a),
    "cuts of a step": lambda a: stepped(max_cuts=a),
    "tolerance of a step": lambda a: stepped(tolerance=a),
    "entry of a step": lambda a: stepped(entry=a),
    "number of a state": lambda a: friction(shift_x=a),
    "method": lambda a: NormalContact(LATTICE, PAIR, GAP, method=a),
    "coupling": lambda a: FrictionalContact(LATTICE, PAIR, GAP, friction_coefficient=0.3, coupling=a),
    "threads": lambda a: NormalContact(LATTICE, PAIR, GAP, threads=a),
    "threads with friction": lambda a: FrictionalContact(
        LATTICE, PAIR, GAP, friction_coefficient=0.3, threads=a
    ),
    "threads of an operator": lambda a: FlexibilityOperator(LATTICE, PAIR, threads=a),
    "rows of a memory": lambda a: contact.memory_needed("fft", a, 9),
    "study": study,
    "stress at points": lambda a: pressed().stress(points=a),
    "stress on a line": lambda a: pressed().stress(line=a),
    "stress at depths": lambda a: pressed().stress(depths=a),
    "box of stress": lambda a: pressed().stress(depths=[1e-5], box=a),
    "count of stress": lambda a: pressed().stress(line=[[0, 0, 0], [0, 0, 1e-4]], count=a),
    "step of stress": lambda a: pressed().stress(points=[0, 0, 1e-5], step=a),
    "body of stress": lambda a: pressed().stress(points=[0, 0, 1e-5], body=a),
    "component of stress": lambda a: pressed().stress(a, points=[0, 0, 1e-5]),
    "points of pyramid stress": lambda a: finite(influence.pyramid_stress(a, 0.0, 1.0, 0.3)),
    "depths of pyramid stress": lambda a: finite(influence.pyramid_displacement(0.0, 0.0, a, 0.3)),
    "vertices of a triangle": lambda a: finite(influence.triangle_stress(a, 0.2, 0.2, 0.5, 0.3)),
    "vertices of a mesh": lambda a: finite(influence.mesh_stress(a, np.ones((1, 3, 3)), 0.0, 0.0, 1.0, 0.3)),
    "history": lambda a: fatigue.smith_watson_topper(a, 2e11, 0.3),
    "slope": lambda a: fatigue.findley(HISTORY, a),
    "traction of Ruiz": lambda a: fatigue.ruiz(a, np.ones((3, 2)), HISTORY),
    "parameter of a life": lambda a: fatigue.life(a, 2e11, 1e9, -0.1, 0.5, -0.6),
}
DOCUMENTED = {"Hertz, tensor": ValueError, "Hertz, load": ValueError, "step of stress": IndexError}


@functools.cache
def pressed() -> Any:
    return case(friction_coefficient=0.3).run()


def finite(values: Any) -> None:
    assert np.isfinite(values).all()


# No solver may believe what is no number of a sensible size, and none may iterate for ever.
REFUSED: dict[str, tuple[Any, ...]] = {
    "lambda_1": (np.nan, np.inf, -np.inf, 0.0, -1e-11),
    "lambda_2": (np.nan, np.inf, 1e-11, -2e-11),
    "lambda_5": (np.nan, -np.inf, np.inf, -1e-11),
    "pair": (np.nan, np.inf, 0.0, -210e9),
    "gap of a contact": (ODD["a NaN"], ODD["inf"], ODD["-inf"]),
    "gap with friction": (ODD["a NaN"], ODD["inf"], ODD["-inf"]),
    "load of a contact": (np.nan, np.inf, -1.0),
    "approach of a contact": (np.nan, np.inf, -np.inf),
    "tolerance of a contact": (np.nan, 0.0, -1e-8, 1.0, np.inf),
    "tolerance of a step": (np.nan, 0.0, -1e-8, 1.0, np.inf),
    "mu with friction": (np.nan, -0.1),
    "sweeps of a contact": (0, -1, 2**31, 1.5, np.nan),
    "sweeps of a step": (0, -1, 2**31),
    "cuts of a step": (-1, 2**31),
    "number of a state": (np.nan, np.inf),
    "points of pyramid stress": (np.nan, np.inf, 1e200),
    "depths of pyramid stress": (np.nan, np.inf, 1e200, -1.0),
    "vertices of a triangle": ([[0, 0], [1e200, 0], [0, 1e200]],),
    "history": (np.full((3, 6), np.nan), np.full((3, 6), 1e200)),
    "slope": (np.nan, np.inf),
    "values of an advance": ([np.nan, 0, 0, 0], [1, np.inf, 0, 0], [-1, 0, 0, 0]),
    "threads": (-1, 1025, 10**6, 10**12, 1.5),
    "threads with friction": (-1, 1025, 10**6, 10**12, 1.5),
    "threads of an operator": (-1, 10**6),
    "lattice, origin": ((np.nan, 0.0), (0.0, np.inf), (0.0,), (0.0, 0.0, 0.0)),
    "lattice, spacing": (np.nan, np.inf, 0.0, -1.0),
    "control of an advance": ([["force"]] * 4, ["force"] * 3, ["force", "force", "force", "torque"]),
    "method": ("lapack", ["fft"], 1),
}


def contact_of(pair: ElasticPair) -> object:
    return NormalContact(LATTICE, pair, GAP).solve(normal_load=10.0)


@pytest.mark.parametrize("taker", REFUSED)
def test_what_means_nothing_is_refused(taker: str) -> None:
    for value in REFUSED[taker]:
        with time_limit(), pytest.raises(DeckError, match="expected|finite number"):
            TAKERS[taker](value)


def test_products_out_of_range_are_no_solution() -> None:
    for gap, load in ((GAP * 1e150, 1e300), (GAP + 1e300, 1e-300), (GAP * 1e-300, 1e300)):
        for method in ("fft", "direct"):
            contact = NormalContact(LATTICE, ElasticPair(1e150, 0.0, 0.0), gap, method=method)
            try:
                with time_limit():
                    solution = contact.solve(normal_load=load)
            except HexcontactError as error:
                assert "not finite" in str(error) or "positive definite" in str(error)
            else:
                finite = np.isfinite(solution.pressure).all() and np.isfinite(solution.gap).all()
                assert finite or not solution.converged


def test_a_tolerance_below_rounding_errors_ends() -> None:
    """Without a bound the pressure of a few pillars was fitted to the load again and again."""
    pillars = np.zeros((13, 13), dtype=bool)
    for k in range(5):
        pillars[7 * k * k % 13, 5 * k % 13] = True
    lattice = Lattice(spacing=1 / 6, row_first=-6, col_first=-6, n_row=13, n_col=13)
    contact = NormalContact(lattice, ElasticPair(1.0, 0.1, 0.4), np.zeros((13, 13)), pillars)
    for k in range(1, 61):
        with time_limit():
            solution = contact.solve(normal_load=0.05 * 1.37**k, tolerance=5e-16)
        assert solution.residual_force < 1e-14
        # the last iteration may be any of those that swing with rounding errors, by compiler and FFT
        assert solution.residual_normal < 1e-7


def test_solvers_say_why_they_stopped() -> None:
    contact = NormalContact(LATTICE, PAIR, GAP)
    assert contact.solve(normal_load=10.0).stopped == ""
    few = contact.solve(normal_load=10.0, tolerance=1e-12, max_sweeps=1)
    assert (few.converged, few.stopped) == (False, "all iterations that are allowed were made")
    few_steps = stepped(max_sweeps=1, max_cuts=0)
    assert (few_steps.converged, few_steps.stopped) == (False, "all iterations that are allowed were made")
    slipping = advanced(FORCES, [10.0, 4.0, 0.0, 0.0])
    assert slipping.sliding and slipping.stopped == "no node sticks, and a load cannot be carried"


def test_contact_at_the_rim_is_flagged() -> None:
    contact = NormalContact(LATTICE, PAIR, GAP)
    small = contact.solve(normal_load=10.0)
    with pytest.warns(RimWarning, match="contact at the rim of the window") as warned:
        large = contact.solve(normal_load=1e5)
        step = advanced(FORCES, [1e5, 0.0, 0.0, 0.0])
    assert len(warned) == 2 and all(warning.filename == __file__ for warning in warned)
    assert (small.converged, small.touches_rim) == (True, False)
    assert (large.converged, large.touches_rim) == (True, True)
    assert (step.converged, step.touches_rim) == (True, True)
    NormalContact(LATTICE, PAIR, GAP, rim_warning=False).solve(normal_load=1e5)


def test_a_punch_that_fills_its_window_gives_no_warning_of_the_rim() -> None:
    flat, punch = np.zeros(LATTICE.shape), np.hypot(LATTICE.x, LATTICE.y) < 1.01 * LATTICE.x.max()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert NormalContact(LATTICE, PAIR, flat, punch).solve(normal_load=10.0).touches_rim
        contact = FrictionalContact(LATTICE, PAIR, flat, punch, friction_coefficient=0.3)
        assert contact.advance(contact.virgin(), FORCES, [10.0, 0.0, 0.0, 0.0]).touches_rim
    for gap in (flat, GAP):
        with pytest.warns(RimWarning):  # nothing says that the bodies end there
            NormalContact(LATTICE, PAIR, gap, np.ones_like(punch)).solve(normal_load=2e3)


def made(name: str, value: Any) -> Any:
    return (i for i in range(3)) if name == "a generator" else value


def unchanged(value: Any, kept: Any) -> bool:
    return not isinstance(value, np.ndarray) or value.tobytes() == kept


@pytest.mark.parametrize("taker", TAKERS)
def test_odd_values_give_a_result_or_a_sentence(taker: str) -> None:
    for name, value in (GOOD | ODD).items():
        kept = value.tobytes() if isinstance(value, np.ndarray) else None
        try:
            with time_limit():
                TAKERS[taker](made(name, value))
        except (HexcontactError, DOCUMENTED.get(taker, HexcontactError)) as error:
            assert len(str(error)) > 10, (name, error)
        except Exception as error:
            raise AssertionError(f"{taker}, {name}: {error!r}") from error
        assert unchanged(value, kept), name


@pytest.mark.parametrize("taker", ["gap", "gap of a contact"])
@pytest.mark.parametrize("form", GOOD)
def test_the_same_numbers_in_another_form_give_the_same_pressure(taker: str, form: str) -> None:
    value = GOOD[form]
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    expected, found = (pressure(TAKERS[taker](gap)) for gap in (GAP, value))
    assert found.max() > 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * expected.max())


def pressure(result: Any) -> np.ndarray:
    return np.asarray(result.pressure).reshape(9, 9)


def bad() -> Iterator[tuple[str, str, str]]:
    yield "gap", "complex", "gap: an array of real numbers expected"
    yield "gap", "masked", "gap: an array without masked values expected"
    yield "gap", "a row less", r"gap: an array of shape \(8, 9\), expected \(9, 9\)"
    yield "gap", "huge", r"gap: expected lengths of at most 1e\+30 m"
    yield "gap of a function", "words", "gap: an array of real numbers expected"
    yield (
        "gap of a contact",
        "three dimensions",
        r"initial_gap: an array of shape \(1, 9, 9\), expected \(9, 9\)",
    )
    yield "load of a contact", "flat", r"normal_load = array\(\[.*: expected a number not below zero"
    yield "pressure of a state", "a NaN", "pressure: 1 value is not a finite number"
    yield (
        "mu with friction",
        "a word",
        "friction_coefficient = 'abc': expected a number of at least 0, or inf",
    )
    yield "lattice, rows", "a number", "n_row = 1.0: expected an integer"
    yield "loads", "a number", "load: expected an array of tables"
    yield "values of an advance", "a set", r"value = \{.*: expected four finite numbers"


@pytest.mark.parametrize(("taker", "name", "sentence"), list(bad()))
def test_the_sentence_names_the_argument(taker: str, name: str, sentence: str) -> None:
    with pytest.raises(DeckError, match=sentence):
        TAKERS[taker](ODD[name])


def test_a_deck_that_holds_itself_is_refused() -> None:
    deck: dict[str, Any] = {"load": []}
    deck["body"] = deck
    deck["load"].append(deck["load"])
    with pytest.raises(DeckError, match="nested too deeply"):
        Case.from_dict(deck)


def odd_gap(seed: int) -> tuple[Lattice, NDArray[Any], NDArray[Any], dict[str, float]]:
    """Return noise, spikes, a cap or many decades, nodes that can touch, and a load or an approach."""
    rng = np.random.default_rng(seed)
    half = int(rng.integers(2, 10))
    lattice = Lattice(1.0, -half, -half, 2 * half + 1, 2 * half + 1)
    squared = lattice.x**2 + lattice.y**2
    noise, height = rng.random(lattice.shape), 10 ** rng.uniform(-4, 2)
    gap = (
        squared / 20 + height * noise,
        np.where(rng.random(lattice.shape) < 0.1, 0.0, height) * noise,
        squared.max() - squared,
        10 ** rng.uniform(-8, 4, lattice.shape),
    )[seed % 4]
    candidate = rng.random(lattice.shape) < rng.choice([0.8, 1.0])
    candidate[half, half] = True
    if rng.random() < 0.5:
        return lattice, gap, candidate, {"normal_load": 10 ** rng.uniform(-4, 4)}
    return lattice, gap, candidate, {"approach": gap[candidate].min() + 10 ** rng.uniform(-4, 3)}


@pytest.mark.parametrize("block", range(4))
def test_both_methods_find_the_same_contact_of_odd_gaps(block: int) -> None:
    pair = ElasticPair(1 / np.pi, 0.0, 0.0)
    for seed in range(40 * block, 40 * block + 40):
        lattice, gap, candidate, driven = odd_gap(seed)
        methods: tuple[contact.Method, ...] = ("fft", "direct")
        solvers = [NormalContact(lattice, pair, gap, candidate, method, threads=1) for method in methods]
        found, expected = (solver.solve(**driven, tolerance=1e-10) for solver in solvers)
        assert found.converged and expected.converged, seed
        assert np.abs(found.pressure - expected.pressure).max() < 1e-9 * expected.pressure.max(), seed
        hopeless = solvers[0].solve(**driven, tolerance=1e-17)  # ends, and says why
        worst = max(hopeless.residual_normal, hopeless.residual_force)
        assert hopeless.converged == (worst <= 1e-17)
        assert hopeless.converged or hopeless.stopped
