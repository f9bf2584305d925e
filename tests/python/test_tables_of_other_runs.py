"""Tables [[stress]] and [[fatigue]] of runs with adaptive steps, bulk stress and wear, also when stopped."""

import io
from pathlib import Path

import numpy as np
import pytest
import xarray

from hexcontact import Case, DeckError, open_result, resume
from hexcontact.problem import preview
from hexcontact.solve.events import Lines

BODIES = """
[body.1]
young_modulus = "74.1 GPa"
poisson_ratio = 0.33
[body.2]
young_modulus = "74.1 GPa"
poisson_ratio = 0.33
surface = { shape = "sphere", radius = "50 mm" }
[friction]
coefficient = 0.65
[grid]
nodes_in_radius = 6
"""
PRESS = '[[load]]\nlabel = "press"\nnormal_load = "200 N"\n'
AUTO = """
[[load]]
repeat = 2
path = [
  { tangential_load_x = "0.5 mu P", PULL steps = "auto", largest_step = 0.5, label = "pull" },
  { tangential_load_x = "-0.5 mu P", PUSH steps = "auto", largest_step = 0.5, label = "push" },
]
"""
BULK = '[bulk]\nbody = 1\nstate = "plane stress"\n' + PRESS + AUTO.replace(
    "PULL", 'bulk_stress_xx = "80 MPa",'
).replace("PUSH", 'bulk_stress_xx = "-80 MPa",')  # fmt: skip
WEAR = """
[[load]]
label = "press"
approach = "10 um"
[[load]]
label = "pull"
path = [{ shift_x = "3 um", steps = 2 }]
[[load]]
label = "push"
path = [{ shift_x = "-3 um", steps = 3 }, { shift_x = "3 um", steps = 3 }]
[wear]
coefficient_1 = "1e-14 m^2/N"
cycle = "push"
cycles = 20_000
"""
STRESS = '[[stress]]\nname = "table"\nsteps = "all"\nline = [[-5e-4, 0, 0], [-5e-4, 0, 5e-4]]\ncount = [5]\n'
FREE = AUTO.replace("PULL", "").replace("PUSH", "")
FATIGUE = '[[fatigue]]\nname = "table"\nsegment = [SEGMENTS]\nparameters = ["smith_watson_topper", "ruiz"]\n'
DECKS = {
    "adaptive fatigue": PRESS + FREE + FATIGUE.replace("SEGMENTS", '"pull", "push"'),
    "adaptive stress with bulk": BULK + STRESS,
    "fatigue and wear": WEAR + FATIGUE.replace("SEGMENTS", '"push"'),
    "stress and wear": WEAR + STRESS,
}  # fmt: skip


@pytest.mark.parametrize("name", DECKS)
def test_tables_are_the_same_however_the_run_went(name: str, tmp_path: Path) -> None:
    deck, output, table = (tmp_path / file for file in ("run.toml", "run.nc", "run_table.nc"))
    deck.write_text(f'title = "{name}"\n{BODIES}{DECKS[name]}')
    case = Case.from_toml(deck)
    case.run(output)
    whole, steps = _loaded(table), len(open_result(output))
    with pytest.raises(DeckError, match="exists already"):
        case.run(output)
    case.run(output, overwrite=True)
    again = _loaded(table)
    for values in whole.variables:
        np.testing.assert_array_equal(whole[values], again[values], str(values))
    stopped, table = tmp_path / "stopped.nc", tmp_path / "stopped_table.nc"
    case.run(stopped, on_step=lambda step: step.number == steps - 2)
    assert len(open_result(stopped)) == steps - 2
    resume(stopped)
    again = _loaded(table)
    for values in whole.variables:
        np.testing.assert_array_equal(whole[values], again[values], str(values))
    assert again.attrs["stress_of"] == open_result(stopped).dataset.attrs["run"]
    if "stress" in name:
        np.testing.assert_array_equal(whole["step"], 1 + np.arange(steps))
    else:  # the last closed cycle of the load history; one that wears is none of its load steps
        last = steps if "adaptive" in name else 9
        assert whole.attrs["steps"][-1] == last
        assert len(whole.attrs["steps"]) >= 4


def test_work_of_errors_of_tables() -> None:
    """Five lattices of a quarter of the nodes count in operator applications of the lattice of the run."""
    deck = BODIES.replace("= 6", "= 20") + PRESS + '[[load]]\ntangential_load_x = "9 N"\nsteps = 40\n'
    table = "[[stress]]\ndepths = [0]\nestimate_error = true\n"
    words = [preview.work(Case.from_text(text)) for text in (deck, deck + table)]
    without, with_errors = (float(text.split()[1].replace(",", "")) for text in words)
    assert 2.0 < with_errors / without < 2.6, words


def test_what_is_said_of_a_run_with_wear() -> None:
    """Before it the work of the cycles, on the way cycles and depth."""
    given = BODIES + WEAR.replace("cycles = 20_000", "cycles = 20_000\njump = 2_000")
    case = Case.from_text(given)
    without = Case.from_text(given[: given.index("[wear]")])
    # 11 cycles of 7 load steps
    added = preview.operator_applications(case) - preview.operator_applications(without)  # type: ignore[operator]
    spent = case.run().dataset
    cycles = spent["wear_cycles"].values >= 0
    assert cycles.sum() == preview.cycles(case) == 11
    assert added == pytest.approx(float(spent["operator_applications"][cycles].sum()), rel=0.5)
    assert "cycles" in preview.work(Case.from_text(BODIES + WEAR))
    lines = io.StringIO()
    shown = Lines(lines)
    shown.begun("wear", case.planned_steps)
    for step in case.start():
        shown.step(step)
    assert "cycles 20,000  worn " in lines.getvalue().splitlines()[-1]
    assert "adaptive" not in lines.getvalue()


def _loaded(path: Path) -> xarray.Dataset:
    with xarray.open_dataset(path) as found:
        return found.load()
