"""The machinery of ``hexcontact verify``, and its checks at a size that is quick."""

import csv
import math
from importlib import resources
from pathlib import Path

import pytest

from hexcontact import verify, verify_cases, verify_normal
from hexcontact.errors import DeckError
from hexcontact.verify import Check, Comparison, reference

TABLE = Path(__file__).parents[1] / "reference" / "benchmarks.csv"


def failures(comparison: Comparison) -> list[str]:
    return [
        f"{row.case}, {row.quantity}: {row.difference:.2e}" for row in comparison.rows if row.passed is False
    ]


# ----------------------------------------------------------------------------------- reference table


def test_the_shipped_table_is_the_one_of_the_tests() -> None:
    shipped = resources.files("hexcontact").joinpath("data/reference.csv").read_bytes()
    assert shipped == TABLE.read_bytes()


def test_every_row_of_the_table_can_be_read() -> None:
    with TABLE.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) > 700
    assert all(None not in row and None not in row.values() for row in rows)  # as many fields as headers
    for row in rows:
        if row["unit"] in verify.UNITS:
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
def test_exit_code(monkeypatch, capsys, computed: float, code: int) -> None:
    monkeypatch.setattr(verify_cases, "CHECKS", made_up(computed))
    assert verify.main([]) == code
    printed = capsys.readouterr()
    assert ("FAIL" in printed.out) == bool(code)
    assert ("verify failed: made-up" in printed.err) == bool(code)
    assert f"made-up: {1 if code else 2} of 2 comparisons passed" in printed.out


def test_markdown(monkeypatch, capsys) -> None:
    monkeypatch.setattr(verify_cases, "CHECKS", made_up(2.1))
    assert verify.main(["made-up"], table=True) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "# Validation"
    assert "## Made up" in lines
    assert "| one | length (µm) |  |  | **2** | 2.1 | +1.0e-01 µm | 1e-02 µm | FAIL |" in lines
    assert "| one | time (s) |  |  |  | 0.5 |  |  |  |" in lines
    assert "| one | max \\|p - q\\| |  |  | **0** | 1.000000e-09 | +1.0e-09 | 1e-08 | ok |" in lines
    widths = {line.replace("\\|", "").count("|") for line in lines if line.startswith("|")}
    assert len(widths) == 1


def test_list_and_unknown_names(capsys) -> None:
    assert verify.main([], listing=True) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == list(verify_cases.CHECKS)
    with pytest.raises(DeckError, match=r"no check 'table-9\.1'; expected one of kernels, "):
        verify.main(["table-9.1"])


# ----------------------------------------------------------------------------------- the checks


def test_kernels_and_materials() -> None:
    for check in (verify_cases.kernels, verify_cases.materials):
        comparison = check()
        assert failures(comparison) == []
        assert all(row.passed for row in comparison.rows)


def test_a_wrong_reference_value_is_a_failure(monkeypatch) -> None:
    table = dict(verify._table())
    key = ("kernel at index difference (1,1)", "Kx/le")
    table[key] = {**table[key], "reference": "0.432823068373"}  # 0.4328230683709 in truth
    monkeypatch.setattr(verify, "_table", lambda: table)
    [failure] = failures(verify_cases.kernels())
    assert failure.startswith("(1,1), Kx/l_e: -2.1")


def test_table_9_2() -> None:
    comparison = verify_normal.table_9_2(("11x11 le=0.2 mm", "21x21 le=0.1 mm", "31x31 le=0.075 mm"))
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 3 + 3 * 8
    # published values stand beside p_max and a
    assert sum(not math.isnan(row.published) for row in comparison.rows) == 2 + 3 * 3


def test_convergence() -> None:
    comparison = verify_normal.convergence((5, 7, 10, 14, 20, 28, 40))
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 7 * 5 + 3


def test_crossed_cylinders() -> None:
    comparison = verify_normal.crossed_cylinders((90, 30))
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 2 * 7


def test_profiles() -> None:
    comparison = verify_normal.profiles()
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 3 * 3 + 2 + 2


def test_control() -> None:
    comparison = verify_normal.control()
    assert failures(comparison) == []
    assert sum(row.passed is True for row in comparison.rows) == 2 * 4 * 3
