"""The layout of a result: what xarray shows of hand-made steps."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray
from numpy.testing import assert_array_equal

from hexcontact import DeckError
from hexcontact.core.lattice import Lattice
from hexcontact.result.layout import Layout, Metadata, assemble, lattice_of
from hexcontact.result.result import Result
from hexcontact.result.step import Step
from hexcontact.variables import ESTIMATED, VARIABLES

SMALL = Lattice(spacing=1e-4, row_first=-2, col_first=-3, n_row=5, n_col=6, origin=(1e-5, 0.0))
LARGE = Lattice(spacing=1e-4, row_first=-3, col_first=-5, n_row=8, n_col=9, origin=(1e-5, 0.0))


def made_step(index: int, lattice: Lattice = SMALL, **history: float | str) -> Step:
    """Return a step whose numbers say where they belong: 100 step + row + col / 100."""
    values = 100.0 * (index + 1) + lattice.rows[:, None] + lattice.cols[None, :] / 100.0
    fields = {
        "initial_gap": 1e-6 * (lattice.rows[:, None] ** 2 + lattice.cols[None, :] ** 2),
        "pressure": values,
        "gap": -values,
        "zone": np.full(lattice.shape, 2, dtype="i1"),
    }
    told = {"normal_load": 10.0 * (index + 1), "approach": 1e-6, "label": "press", "segment": 1, "sweeps": 7}
    return Step(index, lattice, fields, {**told, **history})


def test_layout_is_the_documented_one() -> None:
    data = assemble(Metadata(title="a case", planned_steps=2), [made_step(0), made_step(1)])
    assert data.sizes == {"step": 2, "row": 5, "col": 6}
    assert_array_equal(data["step"], [1, 2])
    assert_array_equal(data["row"], [-2, -1, 0, 1, 2])
    assert_array_equal(data["col"], [-3, -2, -1, 0, 1, 2])
    assert data["pressure"].dims == ("step", "row", "col")
    assert data["initial_gap"].dims == ("row", "col")
    assert data["normal_load"].dims == ("step",)
    assert data["pressure"].sel(step=2, row=1, col=-3) == 200.97
    # node (row 1, col -3) lies at origin - 3 a1 + a2
    assert float(data["x"].sel(row=1, col=-3)) == pytest.approx(1e-5 - 2.5e-4, rel=1e-15)
    assert float(data["y"].sel(row=1, col=-3)) == pytest.approx(np.sqrt(0.75) * 1e-4, rel=1e-15)
    assert data.attrs["Conventions"] == "CF-1.11 UGRID-1.0"
    assert data.attrs["schema_version"] == 1


def test_every_variable_says_what_it_is() -> None:
    for name, variable in VARIABLES.items():
        attributes = variable.attributes
        assert len(attributes["long_name"]) > 3, name
        assert attributes.get("units") or variable.dtype == "str", name
    data = assemble(Metadata(), [made_step(0)])
    assert_array_equal(data["zone"].attrs["flag_values"], np.array([-1, 0, 1, 2], dtype="i1"))
    assert data["zone"].attrs["flag_meanings"] == "not_kept separated stick slip"
    assert data["zone"].dtype == np.int8


def test_a_window_that_grew_pads_the_steps_before() -> None:
    data = assemble(Metadata(), [made_step(0), made_step(1, LARGE)])
    assert lattice_of(data) == LARGE
    first, inside = data.sel(step=1), {"row": slice(-2, 2), "col": slice(-3, 2)}
    assert_array_equal(first["pressure"].sel(inside), made_step(0).fields["pressure"])
    rim = np.ones(LARGE.shape, dtype=bool)
    rim[1:6, 2:8] = False
    assert_array_equal(first["pressure"].values[rim], 0.0)
    assert_array_equal(first["zone"].values[rim], 0)
    assert np.isnan(first["gap"].values[rim]).all()
    assert not np.isnan(first["gap"].values[~rim]).any()
    assert_array_equal(data["pressure"].sel(step=2), made_step(1, LARGE).fields["pressure"])
    assert_array_equal(data["initial_gap"], made_step(1, LARGE).fields["initial_gap"])


def test_slices_are_load_steps_and_no_other_key_is_one() -> None:
    result = Result(assemble(Metadata(), [made_step(k) for k in range(4)]))
    assert result[1:3]["step"].values.tolist() == [int(step["step"]) for step in list(result)[1:3]] == [2, 3]
    assert_array_equal(result[::-1]["normal_load"], [40.0, 30.0, 20.0, 10.0])
    for wrong in ("1", 1.5, None, slice(0, 1), [1]):
        with pytest.raises(DeckError, match="^step = .*: expected the number of a load step, from 1"):
            result.step(wrong)  # type: ignore[arg-type]
    with pytest.raises(KeyError, match=r"1 is no name of a quantity; result.step\(1\) returns a load step"):
        result[1]  # type: ignore[call-overload]


def test_windows_side_by_side_are_joined() -> None:
    beside = replace(SMALL, col_first=3)
    data = assemble(Metadata(), [made_step(0), made_step(1, beside)])
    assert data.sizes["col"] == 12
    assert_array_equal(data["initial_gap"].sel(col=slice(3, 8)), made_step(1, beside).fields["initial_gap"])
    assert_array_equal(data["initial_gap"].sel(col=slice(-3, 2)), made_step(0).fields["initial_gap"])


def test_only_the_chosen_fields_are_kept() -> None:
    data = assemble(Metadata(fields=("zone",)), [made_step(0)])
    assert "zone" in data
    assert "pressure" not in data
    assert "initial_gap" in data


def test_every_keeps_some_steps_and_the_last() -> None:
    data = assemble(Metadata(every=2), [made_step(k) for k in range(5)])
    kept = [bool((data["zone"].sel(step=k) != -1).all()) for k in range(1, 6)]
    assert kept == [False, True, False, True, True]
    assert np.isnan(data["pressure"].sel(step=3)).all()
    assert_array_equal(data["normal_load"], [10.0, 20.0, 30.0, 40.0, 50.0])


def test_history_that_a_step_lacks_is_missing() -> None:
    data = assemble(Metadata(), [made_step(0), made_step(1, stick_area=3.0, label="shear")])
    assert np.isnan(data["stick_area"].values[0])
    assert data["stick_area"].values[1] == 3.0
    assert list(data["label"].values) == ["press", "shear"]


def test_metadata_are_attributes() -> None:
    parameters = {"effective_modulus": 1.5e11, "algorithm": "x"}
    metadata = Metadata("ä title", "deck = 1\n", ("pressure", "gap"), 3, 7, parameters)
    known = {**parameters, "title": "ä title", "deck": "deck = 1\n", "run": metadata.run}
    known |= {"output_fields": "pressure gap", "output_every": 3, "planned_steps": 7}
    attributes = assemble(metadata, [made_step(0)]).attrs
    assert {name: attributes[name] for name in known} == known
    assert attributes["history"] == f"{metadata.created} started by hexcontact {metadata.version}"


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        assemble(Metadata(), [])
    with pytest.raises(ValueError, match="no quantity named colour"):
        assemble(Metadata(), [made_step(0, colour=1.0)])
    with pytest.raises(ValueError, match="share one lattice"):
        assemble(Metadata(), [made_step(0), made_step(1, replace(SMALL, spacing=2e-4))])
    odd = replace(made_step(0), fields={"pressure": np.zeros((2, 2))})
    with pytest.raises(ValueError, match=r"pressure of step 1 has shape \(2, 2\)"):
        assemble(Metadata(), [odd])


class TestResult:
    result = Result(assemble(Metadata("a case", planned_steps=2), [made_step(0), made_step(1)]))

    def test_quantities_by_name(self) -> None:
        assert isinstance(self.result.pressure, xarray.DataArray)
        assert self.result["approach"].values.tolist() == [1e-6, 1e-6]
        assert self.result["step"].values.tolist() == [1, 2]  # as an attribute it is a method
        assert "pressure" in dir(self.result)
        with pytest.raises(AttributeError, match="stick_area is not in this result"):
            _ = self.result.stick_area
        with pytest.raises(AttributeError, match="pressur is no quantity"):
            _ = self.result.pressur
        with pytest.raises(KeyError, match="pressur"):
            _ = self.result["pressur"]
        with pytest.raises(KeyError, match=r"result.step\(-1\) returns a load step"):
            _ = self.result[-1]

    def test_steps_count_from_one(self) -> None:
        assert len(self.result) == 2
        assert self.result.step(1)["normal_load"] == 10.0
        assert self.result.step(-1)["normal_load"] == 20.0
        for wrong in (0, 3, -3):
            with pytest.raises(IndexError, match=f"no step {wrong}; the result has steps 1 to 2"):
                self.result.step(wrong)

    def test_history_is_a_table(self) -> None:
        table = self.result.history
        assert list(table.index) == [1, 2]
        assert list(table["normal_load"]) == [10.0, 20.0]
        assert "pressure" not in table

    def test_lattice(self) -> None:
        assert self.result.lattice == SMALL

    def test_says_what_it_is(self) -> None:
        text = repr(self.result)
        assert "'a case'" in text
        assert "2 load steps, 5 x 6 nodes" in text
        assert "unfinished" not in text
        half = Result(assemble(Metadata("a case", planned_steps=9), [made_step(0)], complete=False))
        assert "1 load step of 9 (unfinished run)" in repr(half)

    def test_can_be_pickled(self) -> None:
        again = pickle.loads(pickle.dumps(self.result))
        assert again.dataset.identical(self.result.dataset)


def test_the_reference_page_names_every_quantity() -> None:
    docs = Path(__file__).parents[2] / "docs"
    page = "".join((docs / name).read_text() for name in ("netcdf.md", "variables.md"))
    of_each = {f"{name}_error" for name in ESTIMATED} | {f"trial_{name}" for name in ESTIMATED}
    assert {"`NAME_error`", "`trial_NAME`"} <= set(page.split())
    for name, variable in VARIABLES.items():
        if name in of_each:
            continue
        assert f"| `{name}` | {variable.units or '–'} | {variable.long_name} |" in page
    for attribute in Layout(Metadata(), [made_step(0)]).attributes(complete=True):
        assert f"`{attribute}`" in page
