"""Fill the tables of docs/deck.md from the models, so that they say what the program checks.

Run it after a change of the deck format: ``python docs/deck_tables.py``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pydantic_core import PydanticUndefined

from hexcontact import deck, surfaces
from hexcontact.messages import shown
from hexcontact.validation import Table, expectation

PAGE = Path(__file__).with_name("deck.md")
TABLES: dict[str, type[Table]] = {
    "deck": deck.Deck,
    "body": deck.Body,
    "friction": deck.Friction,
    "grid": deck.Grid,
    "solver": deck.Solver,
    "load": deck.Load,
    "output": deck.Output,
}
BLOCK = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def default_of(info: Any) -> str:
    if info.default_factory is not None or info.default in (None, ""):
        return ""
    if info.default is PydanticUndefined:
        return "required"
    return f"`{shown(info.default)}`" if info.default != 0.0 or info.default is False else "0"


def keys_of(table: type[Table]) -> str:
    lines = ["| key | expected | default | meaning |", "|---|---|---|---|"]
    for key, info in table.known_keys().items():
        if info.description:
            expected = expectation(info).replace("|", "\\|")
            lines.append(f"| `{key}` | {expected} | {default_of(info)} | {info.description} |")
    return "\n".join(lines) + "\n"


def shapes() -> str:
    lines = ["| shape | height | key | expected | default | meaning |", "|---|---|---|---|---|---|"]
    for name, shape in surfaces.SHAPES.items():
        first = [f"`{name}`", shape.formula.replace("|", "\\|")]
        for key, info in shape.known_keys().items():
            if key not in ("shape", "offset"):
                cells = [*first, f"`{key}`", expectation(info), default_of(info), info.description]
                lines.append(f"| {' | '.join(cells)} |")
                first = ["", ""]
        if first[0]:
            lines.append(f"| {' | '.join(first)} | | | | |")
    offset = surfaces.Flat.model_fields["offset"]
    lines.append(
        f"| all | | `offset` | {expectation(offset)} | {default_of(offset)} | {offset.description} |"
    )
    return "\n".join(lines) + "\n"


def filled(text: str) -> str:
    """Return the page with its tables as the models have them now."""

    def fill(block: re.Match[str]) -> str:
        table = shapes() if block[2] == "shapes" else keys_of(TABLES[block[2]])
        return block[1] + table + block[3]

    return BLOCK.sub(fill, text)


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
