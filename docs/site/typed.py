"""Check the types of the programs of the pages, and of tests/typing/calls.py, as ``mypy --strict`` does.

Types of the package are those that an installed package has: without the plugin of pydantic, errors inside it
are not reported.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
NAME = re.compile(r"# (\w+)\.py\n")
INTERNAL = ("developer",)  # pages with parts of the package
# What parts of programs take as known.
KNOWN = """
import hexcontact
import matplotlib.pyplot as plt
from hexcontact import plotting
case = hexcontact.Case.from_toml("deck.toml")
result = case.run()
"""
# Functions of programs need no annotations.
SETTINGS = """
strict = True
allow_untyped_defs = True
allow_untyped_calls = True
allow_redefinition = True
[mypy-hexcontact.*]
follow_imports = silent
[mypy-pandas.*,py_fatigue.*,pylife.*]
ignore_missing_imports = True
"""


def programs(page: Path) -> Iterator[tuple[str, str]]:
    """Yield name and text of the programs of a page; blocks without a name are one program."""
    parts = []
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        if name := NAME.match(block):
            yield f"{page.stem}_{name[1]}", block
        else:
            parts.append(block)
    if parts:
        yield page.stem, KNOWN + "\n".join(parts)


def main() -> int:
    pages = [page for page in sorted((ROOT / "docs").glob("*.md")) if page.stem not in INTERNAL]
    with tempfile.TemporaryDirectory() as folder:
        settings, *files = Path(folder, "mypy.ini"), ROOT / "tests/typing/calls.py"
        settings.write_text(f"[mypy]\nmypy_path = {ROOT / 'pydriver'}\n{SETTINGS}")
        for page in (*pages, ROOT / "README.md"):
            for name, program in programs(page):
                files.append(Path(folder, f"page_{name}.py"))
                files[-1].write_text(program, encoding="utf-8")
        return subprocess.call([sys.executable, "-m", "mypy", "--config-file", settings, *files])


if __name__ == "__main__":
    sys.exit(main())
