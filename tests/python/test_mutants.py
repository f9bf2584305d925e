"""Mutants: what is changed, where, by which tests; tests/mutants/run.py runs them."""

from itertools import islice
from pathlib import Path

import pytest
from mutants import run
from mutants.sites import FOLDERS, by_line, drawn

FORTRAN = """\
module hc_example
  use hc_precision, only: wp
  integer, parameter :: most = 3
contains
  !> Return 1 for 0.
  pure real(wp) function halved(x, n)
    real(wp), intent(in) :: x
    if (n <= 1 .and. .not. x > 0.0_wp) return ! 2 < 3
    call raise('expected 4 * 5', &
               status)
    halved = 0.5_wp*x**2 - max(a(1), 1.0e-3_wp)
  end function halved
end module hc_example
"""
PYTHON = '''\
"""Text of 1 module."""
from a import b

LIMIT = 3


def halved(x: int | None = 1) -> str:
    """Return 1 + 1."""
    if x is not None and x < 2:
        call(f"{x + 1}", "1 + 1")
        return True
    return 0.5 * x
'''


def changes(text: str, language: str) -> dict[int, set[tuple[str, str]]]:
    lines = by_line(f"example.{language}", text, language)
    return {mutants[0].number: {(m.kind, m.changed.strip()) for m in mutants} for mutants in lines}


def test_code_is_changed_and_neither_comments_nor_texts_nor_declarations() -> None:
    found = changes(FORTRAN, "fortran")
    assert list(found) == [8, 11]
    line = "if (n <= 1 .and. .not. x > 0.0_wp) return ! 2 < 3"
    assert found[8] == {
        ("dropped", " ! 2 < 3".strip()),
        ("operator", line.replace("<=", "<")),
        ("operator", line.replace(".and.", ".or.")),
        ("operator", line.replace(".not. ", "")),
        ("operator", line.replace(">", ">=")),
        ("constant", line.replace("<= 1", "<= 2")),
        ("constant", line.replace("0.0_wp", "1.0_wp")),
    }
    line = "halved = 0.5_wp*x**2 - max(a(1), 1.0e-3_wp)"
    assert found[11] == {
        ("dropped", ""),
        ("operator", line.replace("wp*x", "wp/x")),
        ("operator", line.replace(" - ", " + ")),
        ("operator", line.replace("max", "min")),
        ("constant", line.replace("0.5", "1.5")),
        ("constant", line.replace("**2", "**3")),
        ("constant", line.replace("a(1)", "a(2)")),
        ("constant", line.replace("1.0e-3", "2.0e-3")),
    }
    found = changes(PYTHON, "python")
    assert list(found) == [9, 10, 11, 12]
    line = "if x is not None and x < 2:"
    assert found[9] == {
        ("operator", line.replace("is not", "is")),
        ("operator", line.replace("and", "or")),
        ("operator", line.replace("<", "<=")),
        ("constant", line.replace("2", "3")),
    }
    assert found[10] == {("dropped", "pass")}
    assert found[11] == {("dropped", "pass"), ("operator", "return False")}
    assert found[12] == {("dropped", "pass"), ("operator", "return 0.5 / x"), ("constant", "return 1.5 * x")}


@pytest.mark.parametrize("language", FOLDERS)
def test_an_edit_of_another_line_changes_no_mutant(language: str, tmp_path: Path) -> None:
    folder, pattern = FOLDERS[language]
    (tmp_path / folder).mkdir(parents=True)
    file = tmp_path / folder / pattern.replace("*", "example")
    text = {"fortran": FORTRAN, "python": PYTHON}[language]
    file.write_text(text)
    before = [mutant.key for mutant in drawn(tmp_path, language, 1)]
    assert len(set(before)) == len(before) > 3
    mark = {"fortran": "contains\n", "python": "LIMIT = 3\n"}[language]
    file.write_text(text.replace(mark, f"{mark}\n\n"))
    assert [mutant.key for mutant in drawn(tmp_path, language, 1)] == before
    assert [mutant.key for mutant in drawn(tmp_path, language, 2)] != before


def test_mutants_are_of_every_kind_and_in_their_lines() -> None:
    for language, number in run.NUMBERS.items():
        mutants = list(islice(drawn(run.ROOT, language, 1), number))
        assert {mutant.kind for mutant in mutants} == {"operator", "constant", "dropped"}
        for mutant in mutants:
            line = (run.ROOT / mutant.path).read_text().splitlines()[mutant.number - 1]
            assert line == mutant.line != mutant.changed


def test_each_folder_of_the_library_has_suites_and_modules_have_tests() -> None:
    folders = {path.parent for path in (run.ROOT / "fortran").rglob("*.f90")}
    for folder in folders - {run.ROOT / "fortran", run.ROOT / "fortran/python"}:
        file = next(folder.glob("*.f90")).relative_to(run.ROOT).as_posix()
        assert run.tests_of(file)[0], file
    assert run.tests_of("pydriver/hexcontact/deck/units.py") == (
        [],
        ["tests/python/test_surfaces.py", "tests/python/test_units.py"],
    )
    assert "tests/python/test_edges.py" in run.tests_of("fortran/python/f2py_handles.f90")[1]


def test_equivalent_mutants_are_there_and_have_a_reason() -> None:
    keys = {}
    for language in FOLDERS:
        for file in (run.ROOT / FOLDERS[language][0]).rglob(FOLDERS[language][1]):
            path = file.relative_to(run.ROOT).as_posix()
            if any(key.startswith(f"{path}: ") for key in run.equivalents()):
                for mutants in by_line(path, file.read_text(), language):
                    keys.update((mutant.key, mutant) for mutant in mutants)
    assert run.equivalents().keys() <= keys.keys()
    assert all(len(reason.split()) > 3 for reason in run.equivalents().values())


def test_the_table_counts_what_was_killed_by_what() -> None:
    mutants = list(islice(drawn(run.ROOT, "fortran", 1), 5))
    found = [
        {"invalid": "does not compile"},
        {"folder": "laws damping", "check": "laws damping"},
        {"folder": "", "check": "", "suite": "test_wear.py::test_a"},
        {"folder": "", "check": "", "suite": ""},
        {"folder": "", "check": ""},
    ]
    rows = {mutant.key: row | {"path": mutant.path} for mutant, row in zip(mutants, found, strict=True)}
    summary, each = run.tables(rows, 1, {"fortran": 4})
    assert summary.rows == [["`fortran/`", "4", "1", "0", "0", "1 of 4 (25 %)", "2 of 3 (67 %), 1 not tried"]]
    killers = ["`laws damping`", "`test_wear.py::test_a` (suite)", "**not killed**", "not by `make check`"]
    assert [row[2] for row in each.rows] == killers
