"""``hexcontact verify``, and the frictionless checks of tests/validation at a size that is quick."""

import csv
import math
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from validation import checks, fatigue, frame, normal, page, repeating, runs, surfaces
from validation import reference as table_of_references
from validation.frame import Check
from validation.reference import TABLE, Comparison, reference

from hexcontact.analytic.friction import MindlinContact
from hexcontact.cli import verify
from hexcontact.core.contact import ElasticPair
from hexcontact.errors import DeckError


def failures(comparison: Comparison) -> list[str]:
    return [
        f"{row.case}, {row.quantity}: {row.difference:.2e}" for row in comparison.rows if row.passed is False
    ]


# ----------------------------------------------------------------------------------- reference table


def test_every_row_of_the_table_can_be_read() -> None:
    with TABLE.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) > 700
    assert all(None not in row and None not in row.values() for row in rows)  # as many fields as headers
    for row in rows:
        if row["unit"] in frame.UNITS:
            assert not math.isnan(reference(row["case"], row["quantity"]).reference)


def test_reference_in_si() -> None:
    hertz = reference("9.3 phi=90 mu=0", "a")
    assert hertz.published == pytest.approx(2.287e-3)
    assert hertz.analytic == pytest.approx(2.286002e-3)
    assert reference("9.3 phi=90 mu=0", "p0").reference == pytest.approx(1196.999e6)
    angle = reference("9.3 phi=90 mu=0", "theta (major axis from the axis of cylinder 1)")
    assert angle.analytic == pytest.approx(math.pi / 2)
    # a case name with a comma in it
    assert reference("kernel at index difference (3,-1)", "Kxy/le").reference == -0.09848544482482
    # two published values are no number
    assert math.isnan(reference("9.2 mu=0.1 incremental limit", "c/a").published)
    with pytest.raises(KeyError):
        reference("9.1 Hertz", "colour")


# ----------------------------------------------------------------------------------- judging


@pytest.mark.parametrize(
    ("computed", "arguments", "passed"),
    [
        (1.01, {"analytic": 1.0, "relative": 0.02}, True),
        (1.03, {"analytic": 1.0, "relative": 0.02}, False),
        (0.97, {"analytic": 1.0, "relative": 0.02}, False),
        (-2.02, {"analytic": -2.0, "relative": 0.02}, True),
        (5.03, {"analytic": 5.0, "absolute": 0.02}, False),
        (5.01, {"analytic": 5.0, "absolute": 0.02}, True),
        (1e-9, {"analytic": 0.0, "absolute": 1e-8}, True),
        (1e-9, {"analytic": 0.0, "relative": 1e-8}, False),  # nothing is small beside 0
        (math.nan, {"analytic": 1.0, "relative": 0.02}, False),
        (1.0, {"relative": 0.02}, False),  # no judge
        (1.0, {"analytic": 2.0}, None),
        (1.0, {}, None),
    ],
)
def test_rows_are_judged(computed: float, arguments: dict[str, float], passed: bool | None) -> None:
    found = Comparison()
    found.add("case", "quantity", "-", computed, **arguments)
    assert found.rows[0].passed is passed
    assert found.passed is (passed is not False)


def test_the_reference_judges_unless_the_analytic_value_is_named() -> None:
    row = reference("9.1 Table 9.2 mesh 11x11 le=0.2 mm", "p_max")
    found = Comparison()
    found.add("mesh", "p_max", "MPa", row.reference, row=row, relative=1e-9)
    found.add("mesh", "p_max", "MPa", row.reference, row=row, judge="analytic", relative=1e-9)
    assert [each.passed for each in found.rows] == [True, False]
    assert found.rows[0].published == pytest.approx(8.573573e8)


# ----------------------------------------------------------------------------------- the command


def made_up(computed: float) -> dict[str, Check]:
    def run() -> Comparison:
        found = Comparison(notes=["A note."])
        found.add("one", "length", "um", computed * 1e-6, analytic=2e-6, absolute=1e-8)
        found.add("one", "time", "s", 0.5)
        found.add("one", "max |p - q|", "-", 1e-9, analytic=0.0, absolute=1e-8)
        return found

    return {"made-up": Check("made-up", "Made up", "Nothing real.", run)}


@pytest.mark.parametrize(("computed", "code"), [(2.001, 0), (2.1, 1)])
def test_exit_code(capsys, computed: float, code: int) -> None:
    assert frame.main([], checks=made_up(computed)) == code
    printed = capsys.readouterr()
    assert ("FAIL" in printed.out) == bool(code)
    assert ("verify failed: made-up" in printed.err) == bool(code)
    assert f"made-up: {1 if code else 2} of 2 comparisons passed" in printed.out


def test_page_has_the_worst_row_of_each_check_and_the_file_all_rows(tmp_path: Path) -> None:
    target = tmp_path / "validation.md"
    known = made_up(2.1) | {"other": Check("other", "Other (Table 1)", "", lambda: Comparison())}
    other = Comparison()
    other.add(
        "two", "angle", "-", 1.0126, analytic=1.0, relative=0.0134
    )  # two digits more, or it looks wrong
    page.write(known["other"], other, known, target)
    assert "compares 1 numbers" in target.read_text()
    page.write(known["made-up"], known["made-up"].run(), known, target)
    text = target.read_text()
    assert "compares 3 numbers with independent values; 2 are within" in text
    assert text.splitlines()[-2:] == [
        "|`made-up`|Made up|one, length (µm)|analytic|+1.0e-01 µm|1e-02 µm|",
        "|`other`|Other|two, angle|analytic|+1.26e-02|1.3e-02|",
    ]
    rows = page.read(target.with_suffix(".csv"))
    assert [row["quantity"] for row in rows["made-up"]] == ["length (µm)", "max |p - q|"]  # no times
    assert [(row["computed"], row["result"]) for row in rows["other"]] == [("1.0126", "ok")]
    page.write(known["made-up"], made_up(2.001)["made-up"].run(), known, target)
    assert [len(found) for found in page.read(target.with_suffix(".csv")).values()] == [2, 1]
    assert "3 are within" in target.read_text()


def test_page_and_file_have_the_same_rows_of_every_check(tmp_path: Path) -> None:
    rows = page.read(page.PAGE.with_suffix(".csv"))
    assert list(rows) == list(checks.CHECKS)
    lines = [page.line(checks.CHECKS[name], found) for name, found in rows.items()]
    assert page.PAGE.read_text(encoding="utf-8").endswith("".join(lines))


def test_list_and_unknown_names(capsys) -> None:
    assert frame.main([], checks=checks.CHECKS, listing=True) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == list(checks.CHECKS)
    with pytest.raises(DeckError, match=r"no check 'table-9\.1'; expected one of kernels, "):
        frame.main(["table-9.1"], checks=checks.CHECKS)


def test_an_installation_is_tested_by_known_solutions() -> None:
    for check in verify.self_test().values():
        assert [row for row in verify.compared(check) if not row["passed"]] == []
    assert list(verify.self_test()) == ["spheres", "spheres-direct", "shear", "fretting", "interface"]


def test_values_of_the_self_test_are_those_of_the_references() -> None:
    text = (resources.files("hexcontact") / "data/self_test.toml").read_text()
    values = [value for entry in tomllib.loads(text)["check"] for value in entry["values"]]
    with TABLE.open(newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.DictReader(stream) if row["unit"] in frame.UNITS]
    known = [reference(row["case"], row["quantity"]).reference for row in rows] + [1000.0]  # N, given
    layers = np.loadtxt(TABLE.with_name("interface.csv"), delimiter=",", skiprows=2, usecols=(2, 3))
    known += [number for approach, peak in layers for number in (approach, peak * 2 / math.pi)]
    found = [value["value"] for value in values if value["source"] == "reference"]
    assert len(found) == 12
    assert all(any(math.isclose(value, row, rel_tol=1e-12) for row in known) for value in found)
    pair = ElasticPair.from_materials(71.1e9, 0.0, 71.1e9, 0.0)
    hertz = runs.hertz_of(pair, 4000.0, 12.5e-3)
    exact = MindlinContact(0.3, 4000.0, hertz.contact_radius, runs.shear_compliance(pair))
    closed = [value["value"] for value in values if value["source"] == "analytic"]
    solution = [hertz.max_pressure, float(exact.shift(600.0)), math.cbrt(0.5)]
    assert closed == pytest.approx(solution, rel=1e-8)


# ----------------------------------------------------------------------------------- the checks


def test_kernels_materials_and_fatigue() -> None:
    for check in (checks.kernels, checks.materials, fatigue.parameters):
        comparison = check()
        assert failures(comparison) == []
        assert all(row.passed for row in comparison.rows)


def test_a_wrong_reference_value_is_a_failure(monkeypatch) -> None:
    table = dict(table_of_references._table())
    key = ("kernel at index difference (1,1)", "Kx/le")
    table[key] = {**table[key], "reference": "0.432823068373"}  # 0.4328230683709 in truth
    monkeypatch.setattr(table_of_references, "_table", lambda: table)
    [failure] = failures(checks.kernels())
    assert failure.startswith("(1,1), Kx/l_e: -2.1")


def test_table_9_2() -> None:
    comparison = normal.table_9_2(("11x11 le=0.2 mm", "21x21 le=0.1 mm", "31x31 le=0.075 mm"))
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 3 + 3 * 8
    # published values stand beside p_max and a
    assert sum(not math.isnan(row.published) for row in comparison.rows) == 2 + 3 * 3


def test_convergence() -> None:
    comparison = normal.convergence((5, 7, 10, 14, 20, 28, 40))
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 7 * 5 + 3


def test_crossed_cylinders() -> None:
    comparison = normal.crossed_cylinders((90, 30))
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 2 * 7


def test_profiles() -> None:
    comparison = normal.profiles()
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 3 * 3 + 2 + 2


def test_control() -> None:
    comparison = normal.control()
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 2 * 4 * 3


SURFACES = {
    "rollers": (surfaces.rollers, {}),
    "hollow": (surfaces.hollow, {}),
    "measured": (surfaces.measured, {"points": (41,)}),
    "westergaard": (repeating.westergaard, {"nodes": 128, "shares": (0.3,)}),
    "asperity": (repeating.asperity, {"cells": (8, 16)}),
    "rough": (repeating.rough, {"nodes": (64, 128), "pressures": (0.03,), "seeds": (1,)}),
    "superposed": (repeating.superposed, {"nodes": 64, "parts": (0.6,)}),
    "sheared": (repeating.sheared, {"nodes": (64, 128)}),
}


@pytest.mark.parametrize("name", SURFACES)
def test_surfaces_and_windows_that_repeat(name: str) -> None:
    check, sizes = SURFACES[name]
    comparison = check(**sizes)
    assert failures(comparison) == []
    assert sum(row.passed is not None for row in comparison.rows) >= 3
