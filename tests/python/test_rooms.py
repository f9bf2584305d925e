"""Rooms of the sources and the arrows between them: rooms.toml says which way they may point."""

import ast
import re
import tomllib
from collections import Counter, defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FORTRAN, PYTHON = ROOT / "fortran", ROOT / "pydriver/hexcontact"
RULES = tomllib.loads((Path(__file__).parent / "rooms.toml").read_text())
ROOM_OF = {file: room for room, files in RULES["python_files"].items() for file in files}

Arrows = set[tuple[str, str]]  # (user, used): module names, for Python dotted below hexcontact


def fortran_arrows() -> tuple[dict[str, str], Arrows]:
    """Room of each module, and who uses whom; copies in another precision count as their original."""
    files = sorted(FORTRAN.rglob("*.f90*"))  # some with settings of the build to be filled in
    names = {path: path.name.partition(".")[0] for path in files}
    rooms = {name: name if path.parent == FORTRAN else path.parent.name for path, name in names.items()}
    arrows = set()
    for path in files:
        for used in re.findall(r"^ *use +hc_(\w+)", path.read_text(), re.MULTILINE | re.IGNORECASE):
            used = re.sub(r"_(extended|single)$", "", used.lower())
            if used != names[path]:
                arrows.add((names[path], used))
    return rooms, arrows


def imports_of(path: Path, package: str) -> set[str]:
    """Modules of hexcontact that a file imports anywhere, as dotted names with hexcontact itself as ''."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            base = ".".join(parts[: len(parts) - node.level + 1]) if node.level else ""
            base = ".".join(filter(None, (base, node.module)))
            names = [f"{base}.{alias.name}" for alias in node.names]
        else:
            continue
        found |= {name for name in names if name.partition(".")[0] == "hexcontact"}
    return found


def python_arrows() -> tuple[dict[str, str], Arrows]:
    """Room of each module, and who imports whom."""
    files = {
        ".".join(path.relative_to(PYTHON.parent).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted([*PYTHON.rglob("*.py"), PYTHON / "core/_core.pyi"])
    }
    rooms = {}
    for name, path in files.items():
        folders = path.relative_to(PYTHON).parts[:-1]
        rooms[name] = folders[0] if folders else ROOM_OF.get(path.stem, path.stem)
    arrows = set()
    for name, path in files.items():
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        for word in imports_of(path, package):
            while word not in files:
                word = word.rpartition(".")[0]
            if word != name:
                arrows.add((name, word))
    return rooms, arrows


def below(room: str, rules: dict[str, list[str]]) -> set[str]:
    """The rooms that a room may use."""
    return {room}.union(*(below(other, rules) for other in rules[room]))


def forbidden(rooms: dict[str, str], arrows: Arrows, rules: dict[str, list[str]]) -> list[str]:
    """Arrows that no rule allows."""
    return sorted(f"{a} -> {b}" for a, b in arrows if rooms[b] not in below(rooms[a], rules))


def circle(arrows: Arrows) -> list[str]:
    """Modules of one circle, if there is any."""
    uses = defaultdict(set)
    for user, used in arrows:
        uses[user].add(used)
    try:
        TopologicalSorter(uses).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


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


@pytest.mark.parametrize("top", [FORTRAN, PYTHON], ids=["fortran", "python"])
def test_folders_and_files_stay_small(top: Path) -> None:
    exceptions = RULES["exceptions"]
    files = [path for path in top.rglob("*.*") if path.suffix in (".f90", ".py") and path.stem != "__init__"]
    counts = Counter(path.parent.relative_to(ROOT).as_posix() for path in files)
    assert sorted(name for name, count in counts.items() if count > 15) == exceptions["folders"][top.name]
    long = {path.name for path in files if len(path.read_text().splitlines()) > 450}
    assert sorted(long) == exceptions["files"][top.name]
