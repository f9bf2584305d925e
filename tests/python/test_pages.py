"""The documentation: pages with programs do what they show, and none is left out of the contents."""

import re
import runpy
import sys
import tomllib
from pathlib import Path

import drawn
import pandas as pd
import pytest
from typer.testing import CliRunner

import hexcontact
from hexcontact.cli.app import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "site"))

import links  # noqa: E402
import played  # noqa: E402

SAME = 2e-3  # of a picture: a node whose zone, or a digit of a legend that rounding decides
CHANGED = "\n(if that is right: python docs/site/played.py --write)"


@pytest.mark.parametrize("name", played.PAGES)
def test_page_prints_and_draws_what_it_shows(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    page = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    for difference in played.differences(page, tmp_path):
        assert played.steady(difference.found) == played.steady(difference.shown), CHANGED
        pytest.fail(f"counts: {played.COUNT.findall(difference.found)}{CHANGED}")
    commands = [block for language, block in played.BLOCK.findall(page) if language == "console"]
    assert sum(block.count("\n$ ") + block.startswith("$ ") for block in commands) >= len(commands) > 0
    pictures = played.PICTURE.findall(page)
    assert len(pictures) == {"tutorial": 6, "maps": 1, "fatigue": 1}.get(name, 0)
    for target, picture in pictures:
        played.keep_picture(tmp_path / picture, tmp_path / f"kept_{picture}")
        found = drawn.pixels(tmp_path / f"kept_{picture}")
        assert drawn.apart(found, drawn.pixels(DOCS / target)) < SAME, target


MAKE = runpy.run_path(str(DOCS / "images/make.py"))


@pytest.mark.parametrize(
    ("load", "share", "algorithm"),
    [
        ("36 N", "0.25 mu P", "incremental"),
        ("54 N", "0.65 mu P", "static"),
        ("84 N", "0.8 mu P", "incremental"),
    ],
)
def test_numbers_of_the_path_picture_are_those_of_its_study(load: str, share: str, algorithm: str) -> None:
    kept = pd.read_csv(MAKE["PATHS"], index_col=[0, 1, 2]).loc[(float(load.split()[0]), share, algorithm)]
    changes = {"load.3.normal_load": load, "load.3.tangential_load_x": share, "solver.algorithm": algorithm}
    last = hexcontact.Case.from_toml(ROOT / "cases/path_dependence.toml", overrides=changes).run().dataset
    for name, value in kept.items():
        assert float(last[name][-1]) == pytest.approx(value, rel=1e-6), name


def test_gallery_shows_every_deck() -> None:
    decks = {path.stem for path in (ROOT / "cases").glob("*.toml") if not path.stem.startswith("study_")}
    assert MAKE["decks"]().keys() == decks, "cases/README.md"
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == MAKE["gallery"](), "docs/images/make.py"


def test_pages_may_differ_in_times_residuals_last_digits_and_counts_only() -> None:
    one = " step 3  -1.330 µm  28.3 %  1.9e-09  41.4 ms\n work   8 iterations, 2.21 applications, 36.0 ms"
    for old, new in (
        ("1.9e-09  41.4 ms", "7.2e-10  1.2 s"),
        ("36.0 ms", "8.1 ms"),
        ("-1.330", "-1.329"),
        ("28.3", "28.4"),
        ("8 iterations", "4 iterations"),
        ("2.21", "4.4"),
    ):
        assert played.same(one, one.replace(old, new)), new
    for old, new in (
        ("-1.330", "1.330"),
        ("-1.330", "-1.332"),
        ("28.3", "28.5"),
        ("step 3", "step 4"),
        ("8 iterations", "17 iterations"),
        ("2.21", "1.1"),
        ("1.9e-09", "1.9e-03"),
        ("41.4 ms", "41.4 mm"),
    ):
        assert not played.same(one, one.replace(old, new)), new
    assert not played.same("version 0.3.0", "version 0.4.0")


def test_pages_that_changed_are_found(tmp_path: Path) -> None:
    page = "```console\n$ hexcontact new sphere\nwritten: sphere.toml; now: hexcontact run cube.toml\n```\n"
    [difference] = played.differences(page, tmp_path)
    assert difference.found.endswith("hexcontact run sphere.toml\n")


def test_commands_of_pages_may_not_fail(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="nothing.toml"):
        list(played.differences("```console\n$ hexcontact run nothing.toml\n```\n", tmp_path))


def test_excerpt_of_the_tutorial_is_the_starter_deck(tmp_path: Path) -> None:
    page = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    excerpts = [text for language, text in played.BLOCK.findall(page) if language == "toml"]
    [excerpt] = [text for text in excerpts if not played.NAME.match(text)]
    list(played.differences(f"```console\n$ hexcontact new fretting -o {tmp_path}/new.toml\n```\n", tmp_path))
    deck = tomllib.loads((tmp_path / "new.toml").read_text(encoding="utf-8"))
    assert {key: deck[key] for key in ("friction", "solver", "load")} == tomllib.loads(excerpt)


def test_log_of_a_page_is_that_of_its_case(tmp_path: Path) -> None:
    def words(line: str) -> str:
        """Return the event as a page shows it, without what is of the day."""
        line = re.sub(r"\b(machine|file)=(\".*?\"|\S+)|seconds=\S+|^\S+", "", line).replace('"', "")
        line = re.sub(r"\b(R_\w+)=(\S+)", lambda found: f"{found[1]} {float(found[2]) <= 1e-8}", line)
        return re.sub(r"(iterations|applications)=(\S+)", r"\2 \1", line).replace("=", " ")

    [shown] = re.findall(
        r"^```\n(\d{4}-.*?)^```$", (DOCS / "running.md").read_text(), re.MULTILINE | re.DOTALL
    )
    deck = ROOT / "cases/dissimilar_fretting.toml"
    options = ["--set", "grid.spacing=4 um", "--quiet", "-o", str(tmp_path / "out.nc")]
    done = CliRunner().invoke(app, ["run", str(deck), *options, "--log-file", str(tmp_path / "log")])
    assert done.exit_code == 0, done.output
    found = (tmp_path / "log").read_text().splitlines()
    begun, first, dots, *end = shown.splitlines()
    assert dots == "..."
    assert len(end) == 2
    for line, other in zip([begun, first, *end], [*found[:2], *found[-2:]], strict=True):
        assert played.same(words(line), words(other)), (line, other)


def test_every_page_is_in_the_contents() -> None:
    contents = "".join((DOCS / name).read_text(encoding="utf-8") for name in ("index.md", "theory.md"))
    entries = re.findall(r"^(?:.*<)?([\w*/]+)>?$", contents, re.MULTILINE)
    names = (page.relative_to(DOCS).with_suffix("") for page in DOCS.rglob("*.md"))
    pages = {name.as_posix() for name in names} - {"index", "ford"}
    assert {page for page in pages if not any(Path(page).match(entry) for entry in entries)} == set()


def equations() -> dict[str, list[str]]:
    """Numbers of the equations of each page of the theory."""
    pages = sorted((DOCS / "theory").glob("*.md"))
    number = re.compile(r"\\tag\{(\w+)\}|^\| \((\w+)\) \|", re.MULTILINE)
    return {page.stem: ["".join(found) for found in number.findall(page.read_text())] for page in pages}


def test_equations_of_the_theory_have_the_letter_of_their_page_and_their_order() -> None:
    contents = (DOCS / "theory.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\w?) ?\| \[.*?\]\(theory/(\w+)\.md\)", contents, re.MULTILINE)
    letters = {page: letter for letter, page in rows}
    with_equations = [letter for letter in letters.values() if letter]
    assert len(set(with_equations)) == len(with_equations) > 10
    for page, numbers in equations().items():
        assert numbers == [f"{letters[page]}{n}" for n in range(1, len(numbers) + 1)], page


def test_equations_that_pages_and_sources_cite_are_there() -> None:
    numbers = equations()
    everywhere = {number for found in numbers.values() for number in found}
    pages = [page for page in DOCS.rglob("*.md") if page.name != "theory.md"]
    assert {
        f"{page.name}: {cited}"
        for page in pages
        for cited in re.findall(r"\(([A-Z]\d+)\)", page.read_text())
        if cited not in everywhere
    } == set()
    sources = [path for top in ("fortran", "pydriver", "tests") for path in sorted((ROOT / top).rglob("*.*"))]
    after = re.compile(r"docs/theory/(\w+)\.md((?:,? (?:and |to )?\(\w+\))*)")
    before = re.compile(r"\(([A-Z]\d+)\) of\s+(?:!> )?docs/theory/(\w+)\.md")
    heading = re.compile(r"docs/theory/(\w+)\.md((?:, \"[^\"]+\")+)")
    for path in (path for path in sources if path.suffix in (".f90", ".py")):
        text = path.read_text()
        for page, cited in after.findall(text):
            assert set(re.findall(r"\((\w+)\)", cited)) <= set(numbers[page]), path
        assert {
            (page, number) for number, page in before.findall(text) if number not in numbers[page]
        } == set()
        for page, titles in heading.findall(text):
            found = (DOCS / f"theory/{page}.md").read_text()
            assert [title for title in re.findall(r'"(.+?)"', titles) if f"# {title}\n" not in found] == [], (
                path
            )


def test_every_public_name_is_in_the_python_reference() -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^\.\. auto\w+:: hexcontact\.([\w.]+)$", page, re.MULTILINE))
    errors = {name for name in hexcontact.__all__ if hasattr(hexcontact.errors, name)}
    assert "errors" in documented
    assert set(hexcontact.__all__) - errors - documented == set()


def test_faults_of_finished_pages_are_found(tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    (tmp_path / "more/there.html").write_text('<h2 id="place">There</h2><a href="../index.html#top">up</a>')
    (tmp_path / "index.html").write_text(
        """
        <script src="https://cdn.example/a.js"></script> <img src="missing.png"> <a href="https://example">out</a>
        <a href="more/there.html#place">good</a> <a href="more/there.html#nowhere">bad</a>
        <a href="gone.html">bad</a>
        <a href="mailto:someone@example">good</a> <a href="#own" id="own">good</a> <img src="data:,">
        """
    )
    (tmp_path / "style.css").write_text("@import url(//fonts.example/x.css); a { background: url(near.png) }")
    assert links.faults(tmp_path) == [
        "index.html: <script> loads https://cdn.example/a.js",
        "index.html: missing.png is not there",
        "index.html: more/there.html#nowhere: no such place in the page",
        "index.html: gone.html is not there",
        "style.css: loads //fonts.example/x.css",
    ]
