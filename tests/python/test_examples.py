"""The programs of the documentation and of cases/ run, and print what the pages say."""

import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

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
