"""Parameters of studies: several keys, expressions, groups; invalid cases left out; results that combine."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from hexcontact import Case, DeckError
from hexcontact.cli.app import app
from hexcontact.deck.kinds import Formula
from hexcontact.problem import window
from hexcontact.study import study as study_module
from hexcontact.study.backend import solve_case
from hexcontact.study.study import Study

DECK = {
    "body": {
        "1": {
            "young_modulus": "210 GPa",
            "poisson_ratio": 0.3,
            "surface": {"shape": "sphere", "radius": "10 mm"},
        },
        "2": {"young_modulus": "70 GPa", "poisson_ratio": 0.33},
    },
    "friction": {"coefficient": 0.3},
    "grid": {"nodes_in_radius": 6},
    "load": [{"normal_load": "100 N"}, {"tangential_load_x": "10 N"}],
}
SHEAR = {"expression": "0.8 * mu * load.1.normal_load"}
NU = ("body.1.poisson_ratio", "body.2.poisson_ratio")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder of its own, and solve cases in this process."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study_module, "outcomes", lambda pool, jobs, cancel: map(solve_case, jobs))
    return tmp_path


def sheared(friction: list[Any], **keys: Any) -> Study:
    """Return a study in which Q follows from the friction."""
    parameters = [
        {"key": "friction.coefficient", "name": "mu", "values": friction},
        {"key": "load.2.tangential_load_x", "name": "Q", **SHEAR},
    ]
    return Study(DECK, parameters, **keys)


def test_a_friction_that_varies_is_a_value_among_numbers() -> None:
    ranged = Study(DECK, {"friction.coefficient": {"range": [0.1, 0.5], "count": 3}})
    [axis] = ranged.plan.axes
    assert (axis.units, axis.values) == ("1", pytest.approx((0.1, 0.3, 0.5)))
    [axis] = Study(DECK, {"friction.coefficient": [0.3, "0.3 + x"]}).plan.axes
    assert [axis.coordinate(value) for value in axis.values] == [0.3, "0.3 + x"]
    with pytest.raises(DeckError, match="an expression needs|neither a parameter nor a number"):
        Study(
            DECK | {"friction": {"coefficient": "0.3 + x"}},
            {"body.1.poisson_ratio": {"expression": "friction.coefficient"}, "load.1.normal_load": ["1 N"]},
        )


# --- formulas -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.8 * friction.coefficient * load.1.normal_load", 24.0),
        ("-mu**2 + (1e-2 - .5)/2", -0.335),
        ("max(mu, 1, sqrt(16)) - abs(-1.5)", 2.5),
        ("sin(pi/6)*2e0", 1.0),
    ],
)
def test_value_of_a_formula(text: str, value: float) -> None:
    numbers = {"friction.coefficient": 0.3, "load.1.normal_load": 100.0, "mu": 0.3}
    assert Formula(text).value(numbers) == pytest.approx(value, rel=1e-15)
    assert set(Formula(text).names) <= set(numbers)


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            "1 +",
            "__import__('os')",
            "mu.__class__()",
            "[1]",
            "'a'",
            "mu if mu else 1",
            "lambda: 1",
            "mu < 1",
        ),
        *(
            "mu < 1",
            "1j",
            "eval(mu)",
            "max()",
            "max(*mu)",
            "max(mu)",
            "sqrt(mu, mu)",
            "log(mu, mu, mu)",
            "0x" + "f" * 290,
            "sqrt(x=1)",
            "(mu := 1)",
            "2 % 1",
            "a b",
            "(" * 400,
        ),
    ],
)
def test_what_is_no_formula_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"a formula of numbers, names"):
        Formula(text)


@pytest.mark.parametrize(
    "text", ["1/x", "sqrt(-1 - x)", "9**9**9**9", "1e308*10", "abs((0-8)**(1/3))", "log(x)"]
)
def test_formula_without_a_value(text: str) -> None:
    with pytest.raises(ValueError, match="value here"):
        Formula(text).value({"x": 0.0})


# --- plans --------------------------------------------------------------------------------------------------


def test_several_keys_have_one_value_on_one_axis() -> None:
    study = Study(DECK, {NU: [0.2, 0.3], "friction.coefficient": [0.1, 0.3]})
    assert len(study) == 4
    case = Case.from_text(study.cases[1].deck)
    assert (case.body_1.poisson_ratio, case.body_2.poisson_ratio, case.friction_coefficient) == (
        0.2,
        0.2,
        0.3,
    )
    data = study.collect()
    assert data.body_1_poisson_ratio.attrs["deck_key"] == ", ".join(NU)
    with pytest.raises(DeckError, match=r"load\.1\.normal_load: expected a key with the unit of"):
        Study(DECK, {("friction.coefficient", "load.1.normal_load"): [0.1]})
    with pytest.raises(DeckError, match=r"body\.1\.poisson_ratio: expected each key only once"):
        Study(DECK, {NU: [0.2], NU[0]: [0.3]})


def test_an_expression_follows_parameters_and_keys_of_the_deck() -> None:
    parameters = [
        {"key": "friction.coefficient", "name": "mu", "values": [0.1, 0.3]},
        {"key": "load.1.normal_load", "name": "P", "values": ["50 N", "0.1 kN", "200 N"]},
        {"key": "load.2.tangential_load_x", "name": "Q", **SHEAR},
        {"key": "body.2.young_modulus", "name": "E2", "expression": "body.1.young_modulus / 3"},
        {"key": "body.1.poisson_ratio", "name": "nu", "expression": "0.1 + mu"},
    ]
    study = Study(DECK, parameters)
    case = Case.from_text(study.cases[-1].deck)
    assert case.load_steps[-1].x.value == pytest.approx(48.0)
    assert case.body_2.young_modulus == pytest.approx(70e9)
    data = study.collect()
    assert data.status.dims == ("mu", "P")
    assert (data.Q.dims, data.nu.dims, data.E2.dims) == (("mu", "P"), ("mu",), ())
    assert_allclose(data.Q, 0.8 * data.mu * data.P, rtol=1e-15)
    for combine, keys in (("zip", {}), ("lhs", {"samples": 5})):
        data = Study(
            DECK, [parameters[0], parameters[2]], combine=combine, output=f"{combine}.nc", **keys
        ).collect()
        assert data.Q.dims == ("case",)
        assert_allclose(data.Q, 80.0 * data.mu, rtol=1e-15)


WRONG = [
    ({"expression": "mu * nothing"}, "expression: nothing is neither a parameter nor a number"),
    ({"expression": "title * mu"}, "expression: title is neither a parameter nor a number"),
    ({"expression": "Q"}, "expression: Q has an expression itself"),
    ({"expression": "mu; 1"}, r"parameter\.2\.expression = .*: expected a formula"),
    ({"expression": "mu", "values": [1]}, r"parameter\.2\.expression = .*not both"),
    ({"expression": "1/(mu - mu)"}, "expression: has no value here"),
    ({"expression": "1000 * mu"}, r"load\.2\.tangential_load_x = 300.0: gross sliding"),
]


@pytest.mark.parametrize(("entry", "sentence"), WRONG, ids=[next(iter(row[0].values())) for row in WRONG])
def test_wrong_expressions_are_named(entry: dict[str, Any], sentence: str) -> None:
    mu = {"key": "friction.coefficient", "name": "mu", "values": [0.3]}
    with pytest.raises(DeckError, match=sentence):
        Study(DECK, [mu, {"key": "load.2.tangential_load_x", "name": "Q", **entry}])


def test_groups_are_side_by_side_within_a_grid() -> None:
    parameters = [
        {"key": "friction.coefficient", "name": "mu", "values": [0.2, 0.3]},
        {
            "key": "body.1.young_modulus",
            "name": "E",
            "group": "material",
            "values": ["210 GPa", "70 GPa", "3 GPa"],
        },
        {"key": "body.1.poisson_ratio", "name": "nu", "group": "material", "values": [0.3, 0.33, 0.4]},
    ]
    study = Study(DECK, parameters)
    assert [list(case.settings.values()) for case in study.cases[:3]] == [
        [0.2, "210 GPa", 0.3],
        [0.2, "70 GPa", 0.33],
        [0.2, "3 GPa", 0.4],
    ]
    data = study.collect()
    assert dict(data.sizes) == {"mu": 2, "material": 3}
    assert data.E.dims == data.nu.dims == ("material",)
    assert_allclose(data.E, [210e9, 70e9, 3e9])
    with pytest.raises(DeckError, match="material needs as many values of each; they have 3, 2"):
        Study(DECK, [*parameters[:2], {**parameters[2], "values": [0.3, 0.4]}])
    with pytest.raises(DeckError, match=r'group: belongs to combine = "grid"'):
        Study(DECK, parameters, combine="zip")
    with pytest.raises(DeckError, match="the name approach is taken"):
        Study(DECK, [{**entry, "group": "approach"} for entry in parameters[1:]])


# --- invalid cases ------------------------------------------------------------------------------------------


def test_invalid_cases_are_left_out_and_named() -> None:
    with pytest.raises(DeckError, match="-0.1"):
        sheared([-0.1, 0.3, 2.0])
    study = sheared([-0.1, 0.3, 0.2], skip_invalid=True)
    assert [bool(case.fault) for case in study.cases] == [True, False, False]
    data = study.run(jobs=1)
    assert data is not None
    assert data.status.values.tolist() == [3, 0, 0]
    assert data.status.attrs["flag_meanings"].split()[3] == "invalid"
    assert "expected a number of at least 0" in str(data.message.values[0])
    assert np.isnan(data.approach.values).tolist() == [True, False, False]
    assert math.isnan(data.Q.values[0])
    assert study.failures() == []
    assert study.missing() == []
    with pytest.raises(DeckError, match="at least 0"):
        sheared([-0.1, -0.2], skip_invalid=True)


STUDY = """
deck = "deck.toml"
[[parameter]]
key = "friction.coefficient"
values = [0.05, 0.3]
[[parameter]]
key = "load.1.normal_load"
name = "P"
values = ["60 N", "100 N", "300 N"]
"""


def written(here: Path) -> None:
    """Write a study of which two cases slide."""
    from hexcontact.deck.toml import as_toml

    (here / "deck.toml").write_text(as_toml(DECK))
    (here / "study.toml").write_text(STUDY)


def test_a_plan_solves_nothing_and_writes_nothing(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(here)
    monkeypatch.setattr(window, "estimate_contact", None)  # a coarse solution for each case
    for option in ("--plan", "--dry-run"):
        done = CliRunner().invoke(app, ["study", "study.toml", option, "--skip-invalid"])
        assert done.exit_code == 0
        lines = done.stdout.splitlines()
        assert lines[0].split() == ["case", "friction_coefficient", "P", "state"]
        assert [line.split()[-1] for line in lines[1:7]] == ["invalid"] * 2 + ["missing"] * 4
        assert "6 cases, 2 invalid, 4 missing" in done.stdout
        for number in (1, 2):
            assert f"case {number} (friction.coefficient = 0.05" in done.stderr
    answer = json.loads(
        CliRunner().invoke(app, ["study", "study.toml", "--plan", "--skip-invalid", "--json"]).stdout
    )
    assert [case["state"] for case in answer["cases"]].count("missing") == 4
    assert CliRunner().invoke(app, ["study", "study.toml", "--plan"]).exit_code == 2
    assert sorted(path.name for path in here.iterdir()) == ["deck.toml", "study.toml"]


def test_a_study_without_its_invalid_cases_is_complete(here: Path) -> None:
    written(here)
    done = CliRunner().invoke(app, ["study", "study.toml", "--skip-invalid", "-q"])
    assert done.exit_code == 0
    assert done.stderr.count("is invalid and left out") == 2
    assert CliRunner().invoke(app, ["study", "study.toml", "--collect", "--skip-invalid"]).exit_code == 0
    answer = CliRunner().invoke(app, ["study", "study.toml", "--collect", "--skip-invalid", "--json"])
    assert [len(json.loads(answer.stdout)[key]) for key in ("invalid", "failed")] == [2, 0]
    done = CliRunner().invoke(app, ["study", "study.toml", "--plan", "--skip-invalid"])
    assert "6 cases, 2 invalid, 4 done" in done.stdout


# --- the result ---------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_results_of_studies_combine_without_conflicts() -> None:
    parts = []
    for name, friction in (("one", [0.1, 0.2]), ("two", [0.3, 0.4])):
        study = sheared(friction, title=name, output=f"{name}.nc")
        assert study.run(jobs=1) is not None
        with xarray.open_dataset(f"{name}.nc") as data:
            parts.append(data.load())
        with xarray.open_dataset(f"{name}.nc", group="study") as about:
            assert about.attrs["title"] == name
            assert json.loads(about.attrs["study"])["parameter"][0]["key"] == ["friction.coefficient"]
    for whole in (
        xarray.combine_by_coords(parts),
        xarray.combine_nested(parts, concat_dim="mu", combine_attrs="no_conflicts"),
        xarray.concat(parts, "mu", combine_attrs="identical"),
        xarray.merge(parts, combine_attrs="identical"),
        xarray.open_mfdataset(["one.nc", "two.nc"], combine_attrs="identical"),
    ):
        assert isinstance(whole, xarray.Dataset)
        assert whole.mu.values.tolist() == [0.1, 0.2, 0.3, 0.4]
        assert (whole.status == 0).all()
        assert whole.attrs["combine"] == "grid"
    cases = [xarray.open_dataset(path) for path in sorted(Path("one").glob("*.nc"))]
    assert xarray.combine_nested(cases, concat_dim="case").sizes["case"] == 2
    for case in cases:
        case.close()
