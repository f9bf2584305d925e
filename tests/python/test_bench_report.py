"""Tables of the benchmarks and their places in the pages."""

import re
from argparse import Namespace
from pathlib import Path

from bench import report, run

MARKS = re.compile(r"<!-- begin (\w+) -->")
OPTIONS = Namespace(
    build=Path(), peers=Path(), contact=None, quick=True, long=False, sizes=None, meshes=None, codes=None
)


def test_every_section_has_one_place_and_every_place_a_section() -> None:
    marked = [name for page in report.DOCS.rglob("*.md") for name in MARKS.findall(page.read_text())]
    # tests/mutants/run.py writes one of its own
    assert sorted(marked) == sorted(["machine", "mutants", *run.sections(OPTIONS)])
    for name in marked:
        report.place(name)


def test_a_section_that_is_measured_replaces_its_tables_alone(tmp_path: Path) -> None:
    kept = "<!-- begin a -->\n\n| 1 |\n\n*Measured then.*\n\n<!-- end a -->\n"
    page = tmp_path / "page.md"
    page.write_text(f"# Page\n\n{kept}\n<!-- begin b -->\n<!-- end b -->\n\nText.\n")
    for value in ("1.5", "2.5"):
        table = report.Table("Times", ["window", "s", "goal"], [["64²", value, "≤ 2"]])
        assert report.write("b", [table], "today, with this", tmp_path) == page
        rows = f"| window | s | goal |\n| --- | ---: | ---: |\n| 64² | {value} | ≤ 2 |"
        filled = f"<!-- begin b -->\n\n**Times**\n\n{rows}\n\n*Measured today, with this.*\n\n<!-- end b -->"
        assert page.read_text() == f"# Page\n\n{kept}\n{filled}\n\nText.\n"
