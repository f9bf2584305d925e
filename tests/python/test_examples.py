"""The programs of the documentation and of cases/ run, and print what the pages say."""

import contextlib
import doctest
import io
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import drawn
import matplotlib
import pytest
from matplotlib.figure import Figure

from hexcontact import case, influence
from hexcontact.solve import session

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:```\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)


def programs(page: Path) -> Iterator[tuple[str, str, int]]:
    """Programs of a page, what each prints, and their lines."""
    text = page.read_text()
    for found in BLOCK.finditer(text):
        yield found.group(1), found.group(2) or "", text.count("\n", 0, found.start()) + 2


def printed(program: str, name: str, names: dict[str, object]) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(program, name, "exec"), names)
    return out.getvalue()


@pytest.mark.parametrize("page", ["docs/python.md"])
def test_programs_of_a_page_print_what_it_says(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    found = list(programs(ROOT / page))
    assert sum(bool(output) for _, output, _ in found) >= 8
    for program, output, line in found:
        assert printed("\n" * (line - 1) + program, page, names) == output, f"{page}, line {line}"


@pytest.mark.parametrize("module", [case, session, influence])
def test_examples_in_the_sources_are_right(module: ModuleType) -> None:
    found = doctest.testmod(module)
    assert found.attempted > 0
    assert found.failed == 0


COARSE = {  # what is changed so that they take a second, and the pictures that they write
    "hertz_to_fretting": (
        {"nodes_in_radius": 8},
        ["hertz_section", "fretting_zones", "fretting_tractions", "mindlin_loop"],
    ),
    "two_pads": ({"nodes_in_radius": 6}, ["two_pads"]),
    "stick_map": ({"nodes_in_radius": 6, "steps": 3}, ["stick_map", "stick_section"]),
}


def test_the_list_of_scripts_is_complete() -> None:
    assert {path.stem for path in (ROOT / "cases").glob("*.py")} == set(COARSE)


@pytest.mark.parametrize("name", COARSE)
def test_scripts_of_the_cases_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changes, pictures = COARSE[name]
    program = (ROOT / f"cases/{name}.py").read_text()
    assert program.startswith("# %% [markdown]\n")
    for key, value in changes.items():
        program, count = re.subn(rf"^{key} = \d+", f"{key} = {value}", program, flags=re.MULTILINE)
        assert count == 1, key
    saved: list[Figure] = []
    original = Figure.savefig
    monkeypatch.setattr(
        Figure, "savefig", lambda self, *a, **k: (saved.append(self), original(self, *a, **k))[1]
    )
    monkeypatch.chdir(tmp_path)
    with matplotlib.rc_context():
        output = printed(program, name, {})
    assert len(output.splitlines()) > 5
    assert "nan" not in output.lower()
    assert {path.stem for path in tmp_path.glob("*.png")} == set(pictures)
    assert len(saved) == len(pictures)
    for figure in saved:
        drawn.assert_painted(figure)


def test_the_readme_of_the_cases_names_the_scripts() -> None:
    page = (ROOT / "cases/README.md").read_text()
    assert [path.name for path in (ROOT / "cases").glob("*.py") if f"`{path.name}`" not in page] == []
