"""The comparison with CONTACT: its executable is named by CONTACT_PROGRAM; here a script stands in for it."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from bench import contact, creep, problems, report, run
from test_bench_report import OPTIONS

# Reads the number of elements of the last case, and writes what CONTACT writes of it.
STAND_IN = r"""
import sys
from pathlib import Path
assert sys.argv[1:] == ["2", "deck"], sys.argv
lines = Path("deck.inp").read_text().splitlines()
side = int([line for line in lines if "MX MY XL YL DX DY" in line][-1].split()[0])
forces = [line.split() for line in lines if "FN FX CETA CPHI" in line]
assert lines[0].endswith("3  MODULE") and lines[-1] == " 0  MODULE" and float(forces[-1][1]) < 0
Path("deck.out").write_text(f'''
   |  Version: trunk(linux64), $Revision: 1 $                             |
   |  Copyright                                                           |
 CONTACT STATISTICS
 N: NUMBER OF ELEMENTS IN REGION,  I: NUMBER OF ITERATIONS,
    NPOT   NCON   NADH  NSLIP  INORM  ITANG
{side * side:8d}    177     45    132      1      1

 FORM OF THE CONTACT, ADHESION AND SLIP-AREA`S:
''')
print("The CONTACT program ended succesfully.")
"""


def program(folder: Path, text: str = STAND_IN) -> str:
    """Return an executable script."""
    path = folder / "contact"
    path.write_text(f"#!{sys.executable}\n{text}")
    path.chmod(0o755)
    return str(path)


def test_zones_version_and_share_of_stick_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CONTACT_PROGRAM", program(tmp_path))
    found = contact.Program.given()
    assert found and found.version == "trunk(linux64), $Revision: 1 $"
    seconds, zones = found.run(contact.deck_of("HC", 19, problems.TOLERANCE, 1))
    assert zones == [(361, 177, 45, 132)] and 0 < seconds < 60
    assert found.history("AT_ONCE", 19, problems.TOLERANCE, repeats=1) < 60
    assert found.stick_share == 45 / 177


def test_cases_of_a_creep_table_make_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = STAND_IN.replace("FN FX CETA CPHI", "FN CKSI CETA CPHI").replace("[1]) < 0", "[1]) >= 0")
    monkeypatch.setenv("CONTACT_PROGRAM", program(tmp_path, script))
    table = report.Table("Creep", ["what"] * 7)
    cases = list(creep.neighbors())
    assert len(set(cases)) == math.prod(creep.COUNTS)
    there = contact.Program(Path(program(tmp_path, script)))
    creep.add_contact(table, there, np.array(cases[:3]))
    assert [row[0] for row in table.rows] == ["CONTACT, a/b = 1"] * 2


def test_a_history_makes_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CONTACT_PROGRAM", program(tmp_path))
    monkeypatch.setattr(contact, "WINDOWS", {"HC": (16,)})
    there = contact.Program.given()
    assert there
    histories, others = contact.measure(there, quick=True, sizes=[16])
    [row] = histories.rows
    assert len(row) == len(histories.header) and row[-2] == "0.254" and not others.rows
    assert histories.remarks[-1] == "CONTACT: trunk(linux64), $Revision: 1 $."


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "Permission denied"),
        ("print('hello')", "hello;"),
        (STAND_IN.replace("NPOT", "N"), "The CONTACT program ended"),
        ("raise SystemExit(3)", "no output;"),
    ],
)
def test_another_file_gets_one_sentence(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    text: str | None,
    reason: str,
) -> None:
    path = program(tmp_path, text or "")
    if text is None:
        Path(path).chmod(0o644)
    monkeypatch.setenv("CONTACT_PROGRAM", path)
    monkeypatch.setattr(sys, "argv", ["run.py", "--only", "contact"])
    assert run.main() == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(f"CONTACT_PROGRAM: {path}: {reason}")
    assert printed.err.endswith("; expected the executable of CONTACT\n") and printed.err.count("\n") == 1


@pytest.mark.parametrize("only", [[], ["--long"], ["--only", "contact,counts"]])
def test_without_it_the_section_is_left_out_in_one_line_and_the_page_stays(
    only: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    written: list[str] = []
    monkeypatch.delenv("CONTACT_PROGRAM", raising=False)
    monkeypatch.setattr(sys, "argv", ["run.py", *only])
    nothing = {name: list[report.Table] for name in run.sections(OPTIONS)}
    monkeypatch.setattr(run, "sections", lambda _: nothing)
    monkeypatch.setattr(run.report, "write", lambda name, *_: written.append(name) or run.ROOT)
    assert run.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line.startswith("contact")] == [
        "contact: left out; set CONTACT_PROGRAM to the executable of CONTACT"
    ]
    assert "counts" in written and "contact" not in written
