"""Arrows between the rooms of the sources, for the test that judges them and the picture that shows them."""

import ast
import re
import tomllib
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

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
    generated = tomllib.loads((FORTRAN / "python/procedures.toml").read_text())["use"]
    rooms["flat"] = "python"
    return rooms, arrows | {("flat", module.removeprefix("hc_")) for module in generated}


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
        for path in sorted([*PYTHON.rglob("*.py"), *PYTHON.rglob("core/*.pyi")])
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
