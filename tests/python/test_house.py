"""Rules of the house that can be read off the sources: kinds, silence, layers, links, versions."""

import ast
import dataclasses
import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
import typer.main

import hexcontact
from hexcontact.cli.app import app
from hexcontact.core.lattice import Lattice
from hexcontact.result import journal
from hexcontact.result.layout import Metadata
from hexcontact.study.dataset import STUDY_VERSION
from hexcontact.variables import SCHEMA_VERSION

ROOT = Path(__file__).parents[2]
LIBRARY = sorted((ROOT / "fortran").rglob("*.f90"))
FORTRAN = [
    path
    for folder in ("fortran", "tests", "docs")
    for ending in ("*.f90", "*.inc")
    for path in sorted((ROOT / folder).rglob(ending))
]
FOLDERS = (".", "docs", "docs/theory", "cases")
PAGES = [page for folder in FOLDERS for page in sorted((ROOT / folder).glob("*.md"))]

NUMBER = re.compile(r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=[ed][+-]?\d))(?:[ed][+-]?\d+)?(\w*)", re.IGNORECASE)


def code(text: str) -> str:
    """Fortran text in lower case without its strings and comments."""
    return re.sub(r"'[^'\n]*'|\"[^\"\n]*\"|![^\n]*", "", text).lower()


def by_name(path: Path) -> str:
    return path.name


def literals_without_kind(text: str) -> list[str]:
    return [m.group(0) for m in NUMBER.finditer(code(text)) if not re.fullmatch(r"_[a-z]\w*", m.group(1))]


def test_literals_without_kind_are_found() -> None:
    bad = "x = 1.0 + 2.5e-3*y - .5_wp + 3d0 + 1e6 + 4.*z"
    good = "x = 1.0_wp + 2.5e-3_wp*y(1:3) - a%b1 + 1.e0_rk ! 0.5\n print '(f8.3)', 1_int64"
    assert literals_without_kind(bad) == ["1.0", "2.5e-3", "3d0", "1e6", "4."]
    assert literals_without_kind(good) == []


def test_there_are_sources_to_judge() -> None:
    assert len(LIBRARY) > 50
    assert {path.parent.name for path in FORTRAN} >= {"fortran", "docs"}


@pytest.mark.parametrize("path", FORTRAN, ids=by_name)
def test_every_real_literal_has_its_kind(path: Path) -> None:
    assert literals_without_kind(path.read_text()) == []


@pytest.mark.parametrize("path", LIBRARY, ids=by_name)
def test_module_is_named_after_its_file_and_hides_what_is_not_public(path: Path) -> None:
    text = code(path.read_text())
    modules = re.findall(r"^(?:module|submodule \(hc_\w+\)) (\w+)", text, re.MULTILINE)
    assert modules == [path.stem if path.stem == "hexcontact" else f"hc_{path.stem}"]
    assert re.search(r"^  implicit none$", text, re.MULTILINE)
    open_to_all = path.stem == "hexcontact" or text.lstrip().startswith("submodule")
    assert re.search(r"^  private$", text, re.MULTILINE) or open_to_all


@pytest.mark.parametrize("path", LIBRARY, ids=by_name)
def test_library_never_prints_and_never_stops(path: Path) -> None:
    assert re.findall(r"\bprint\b *[*'\"(]|\bstop\b|\bwrite *\( *\*|\bopen *\(", code(path.read_text())) == []


def test_every_fortran_file_is_built() -> None:
    builds = (ROOT / "fortran").rglob("meson.build")
    listed = [path.parent / name for path in builds for name in re.findall(r"'(\w+\.f90)'", path.read_text())]
    assert [path for path in LIBRARY if path not in listed] == []


def test_every_file_of_the_package_is_installed() -> None:
    listed = re.findall(r"'(hexcontact/[\w/]+\.\w+)'", (ROOT / "pydriver/meson.build").read_text())
    files = [path for path in (ROOT / "pydriver/hexcontact").rglob("*.*") if path.is_file()]
    sources = [path for path in files if path.suffix not in {".pyc", ".so"} and path.name != "flat.py"]
    assert {path.relative_to(ROOT / "pydriver").as_posix() for path in sources} == set(listed)


def test_every_public_name_is_in_the_typed_calls() -> None:
    calls = (ROOT / "tests/typing/calls.py").read_text()
    errors = {name for name in hexcontact.__all__ if hasattr(hexcontact.errors, name)}
    assert {name for name in hexcontact.__all__ if not re.search(rf"\b{name}\b", calls)} - errors == set()


def test_every_quick_test_is_there() -> None:
    listed = (ROOT / "tests/check.txt").read_text().split()
    assert listed
    for entry in listed:
        entry = entry.removeprefix("--deselect=")
        file, _, name = entry.partition("::")
        assert not name or f"def {name.partition('[')[0]}(" in (ROOT / file).read_text(), entry


def test_links_between_pages_lead_somewhere() -> None:
    dead = []
    for page in PAGES:
        text = page.read_text()
        text += "".join((page.parent / file).read_text() for file in re.findall(r"^:file: (\S+)", text, re.M))
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"https?:|mailto:", target):
                continue
            path, _, anchor = target.partition("#")
            there = (page.parent / path) if path else page
            if not there.exists() or (anchor and anchor not in anchors(there)):
                dead.append(f"{page.relative_to(ROOT)}: {target}")
    assert PAGES
    assert dead == []


def anchors(page: Path) -> set[str]:
    """What the headings of a page are called in links."""
    headings = re.findall(r"^#+ +(.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_version_is_the_same_everywhere() -> None:
    """The build reads that of the package; the changelog has it, or collects what comes into it."""
    headings = re.findall(r"^## \[(.+)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert hexcontact.__version__ == headings[0] or headings[0] == "Unreleased"
    assert hexcontact.__version__ not in headings[1:]
    if "site-packages" in hexcontact.__file__:
        assert metadata.version("hexcontact") == hexcontact.__version__


FORMATS: dict[str, dict[str, object]] = {  # by the version that first wrote them; a change is a new line
    "0.4.0": {
        **{"result": 1, "journal": 3, "lattices": 2, "study": 1},
        "record": "index lattice history control fields companion",
        "metadata": "title deck fields every planned_steps parameters run created version resumed deck_file",
        "growth": "run of planned_steps kept added checksum",
        "window": "spacing row_first col_first n_row n_col origin",
        "solution": "level copy spacing origin nodes histories",
    },
    "0.5.0": {
        **{"result": 1, "journal": 5, "study": 1},
        "record": "run index lattice history control",
        "metadata": "title deck fields every planned_steps parameters run created version resumed deck_file",
        "header": "metadata steps",
        "window": "spacing row_first col_first n_row n_col origin cell_ratio cell_angle direction periodic",
        "solution": "level copy spacing origin nodes histories",
    },
}


def test_a_changed_format_has_a_version_of_its_own() -> None:
    present = {
        **{"result": SCHEMA_VERSION, "journal": journal.VERSION, "study": STUDY_VERSION},
        "record": " ".join(journal._PARTS),
        "metadata": " ".join(field.name for field in dataclasses.fields(Metadata)),
        "header": " ".join(field.name for field in dataclasses.fields(journal.Header)),
        "window": " ".join(field.name for field in dataclasses.fields(Lattice)),
        "solution": " ".join(journal.Solution._fields),
    }
    newest = [*FORMATS][-1]
    assert present == FORMATS[newest], "raise the version, and add a line to FORMATS"
    order = [tuple(map(int, version.split("."))) for version in (*FORMATS, hexcontact.__version__)]
    assert order == sorted(order)
    assert len(set(order[:-1])) == len(FORMATS)


def test_every_dependency_has_its_reason() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = project["project"]["dependencies"] + project["build-system"]["requires"]
    wanted += [word for group in project["project"]["optional-dependencies"].values() for word in group]
    page = (ROOT / "docs/dependencies.md").read_text().lower()
    names = {canonical(word) for word in wanted}
    assert {name for name in names if f"| {name} |" not in page} == set()


@pytest.mark.parametrize("recipe", ["conda/recipe.yaml", "spack/package.py"])
def test_recipes_have_the_bounds_of_the_project(recipe: str) -> None:
    text = (ROOT / "packaging" / recipe).read_text().replace("matplotlib-base", "matplotlib")
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    found = re.findall(r"^ +- ([\w-]+) >=([\d.]+)$|\"py-([\w-]+)@([\d.]+):\"\)$", text, re.MULTILINE)
    assert {canonical(word): word.partition(">=")[2] for word in wanted} == {
        canonical(conda or spack): bound or bound_of_spack
        for conda, bound, spack, bound_of_spack in found
        if (conda, bound) not in {("meson-python", "0.17"), ("numpy", "2.0")}
    }
    assert hexcontact.__version__ in text


def test_every_package_that_is_imported_is_a_dependency() -> None:
    trees = [ast.parse(path.read_text()) for path in (ROOT / "pydriver").rglob("*.py")]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom) and not node.level}
    modules = {name.partition(".")[0] for name in names} - set(sys.stdlib_module_names) - {"hexcontact"}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = {canonical(word) for word in project["dependencies"]}
    origin = metadata.packages_distributions()
    undeclared = {name for name in modules if not declared & {canonical(word) for word in origin[name]}}
    assert undeclared - {"pydantic_core"} == set()  # which pydantic pins to itself


def canonical(requirement: str) -> str:
    """Name of a distribution as PyPI compares it."""
    return re.sub(r"[-_.]+", "-", re.split(r"[<>=!~ ]", requirement)[0]).lower()


def test_command_starts_without_the_heavy_packages() -> None:
    heavy = {"matplotlib", "xarray", "pandas", "scipy", "netCDF4", "pint", "pydantic", "hypothesis"}
    program = f"import sys\nfrom hexcontact.cli.app import app\nprint(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_command_is_in_the_readme() -> None:
    group = typer.main.get_command(app)
    readme = (ROOT / "README.md").read_text()
    assert [name for name in group.commands if f"hexcontact {name}" not in readme] == []


def block_of(page: str, language: str) -> str:
    """The first block of code in a language."""
    found = re.search(rf"^```{language}\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert found
    return found.group(1)


def test_readme_python_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    program = block_of((ROOT / "README.md").read_text(), "python")
    exec(compile(program, "README.md", "exec"), {})
    assert program.endswith(f"# {capsys.readouterr().out}")


@pytest.mark.parametrize(
    ("given", "seen"),
    [({}, "1000"), ({"GOMP_SPINCOUNT": "7"}, "7"), ({"OMP_WAIT_POLICY": "active"}, "None")],
)
def test_threads_do_not_spin_unless_they_are_told_to(given: dict[str, str], seen: str) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")}
    program = "import os, hexcontact; print(os.environ.get('GOMP_SPINCOUNT'))"
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment | given, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == seen
