"""Pictures of the documentation are those that the program draws; `make docs` runs these tests."""

import runpy
import sys
from pathlib import Path

import drawn
import pytest

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS / "site"))

import played  # noqa: E402

SAME = 2e-3  # of a picture: a node whose zone, or a digit of a legend that rounding decides
MAKE = runpy.run_path(str(DOCS / "images/make.py"))
IMAGES = MAKE["FIGURES"]


@pytest.mark.parametrize("name", IMAGES)
def test_pictures_of_the_pages_are_those_that_the_program_draws(name: str) -> None:
    found = drawn.pixels(IMAGES[name](), dpi=150)
    assert drawn.apart(found, drawn.pixels(DOCS / f"images/{name}.png")) < SAME


@pytest.mark.parametrize("name", MAKE["decks"]())
def test_pictures_of_the_gallery_are_those_that_the_commands_draw(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    MAKE["draw_deck"](name, picture := tmp_path / "drawn.png")
    assert drawn.apart(drawn.pixels(picture), drawn.pixels(DOCS / f"images/cases/{name}.png")) < SAME


def test_every_picture_of_the_pages_is_drawn_by_a_test() -> None:
    played_ones = {
        target for page in DOCS.glob("*.md") for target, _ in played.PICTURE.findall(page.read_text())
    }
    there = {path.relative_to(DOCS).as_posix() for path in (DOCS / "images").rglob("*.png")}
    assert there == played_ones | {f"images/{name}.png" for name in IMAGES}
