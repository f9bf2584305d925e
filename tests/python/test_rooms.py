"""Rooms of the sources and the arrows between them: rooms.toml says which way they may point."""

import runpy
from pathlib import Path

from arrows import ROOT, RULES, circle, forbidden, fortran_arrows, imports_of, python_arrows


def test_arrows_that_point_up_and_circles_are_found() -> None:
    rooms = {"solver": "solve", "deck_keys": "deck", "words": "ground"}
    rules = {"ground": [], "deck": ["ground"], "solve": ["deck"]}
    arrows = {("solver", "words"), ("deck_keys", "solver")}
    assert forbidden(rooms, arrows, rules) == ["deck_keys -> solver"]
    assert not circle(arrows)
    assert set(circle(arrows | {("solver", "deck_keys")})) == {"solver", "deck_keys"}


def test_imports_inside_functions_and_for_types_only_are_counted(tmp_path: Path) -> None:
    source = tmp_path / "case.py"
    source.write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from hexcontact.deck import Deck\n"
        "def run():\n    from . import solve\n    import hexcontact.core.lattice\n"
        "    from ..text import words\n"
    )
    assert imports_of(source, "hexcontact.study") == {
        "hexcontact.deck.Deck", "hexcontact.study.solve", "hexcontact.core.lattice", "hexcontact.text.words",
    }  # fmt: skip


def test_fortran_folders_use_only_those_below_them() -> None:
    rooms, arrows = fortran_arrows()
    assert len(arrows) > 100
    assert set(rooms.values()) == set(RULES["fortran"])
    assert forbidden(rooms, arrows, RULES["fortran"]) == []
    assert circle(arrows) == []


def test_python_rooms_use_only_those_below_them() -> None:
    rooms, arrows = python_arrows()
    assert len(arrows) > 100
    assert set(rooms.values()) <= set(RULES["python"])
    # a list that can only get shorter
    assert forbidden(rooms, arrows, RULES["python"]) == RULES["exceptions"]["arrows"]
    known = RULES["exceptions"]["arrows"] + RULES["exceptions"]["circles"]
    assert circle({(a, b) for a, b in arrows if f"{a} -> {b}" not in known}) == []


def test_picture_of_the_rooms_shows_the_arrows_of_the_sources() -> None:
    picture = runpy.run_path(str(ROOT / "docs/images/rooms.py"))
    arrows = picture["drawn_arrows"]()
    rooms, found = picture["shown"](picture["PICTURE"].read_text(encoding="utf-8"))
    again = "\n(if that is right: python docs/images/rooms.py)"
    assert found == arrows, again
    assert rooms == {room for arrow in arrows for room in arrow}, again
    assert rooms <= set(picture["HOLDS"])
