"""Tables: printed on the terminal, and put in the place of older ones into the pages of docs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


@dataclass
class Table:
    """A table with a caption and remarks; the first column is text, the others are numbers."""

    caption: str
    header: list[str]
    rows: list[list[str]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def add(self, *cells: str) -> None:
        self.rows.append(list(cells))

    def markdown(self) -> str:
        """Return the table as Markdown."""
        width = max([len(self.header), *(len(row) for row in self.rows)])
        rows = [self.header, ["---", *["---:"] * (width - 1)], *self.rows]
        lines = [f"**{self.caption}**", ""] if self.caption else []
        lines += ["| " + " | ".join([*row, *[""] * (width - len(row))]) + " |" for row in rows]
        lines += [line for remark in self.remarks for line in ("", remark)]
        return "\n".join(lines)

    def text(self) -> str:
        """Return the table with aligned columns."""
        cells = [row for row in (self.header, *self.rows) if any(row)]
        widths = [
            max(len(row[k]) for row in cells if len(row) == len(self.header)) for k in range(len(self.header))
        ]
        lines = [self.caption, ""] if self.caption else []
        for row in cells:
            padded = [
                cell.ljust(width) if k == 0 or not self.caption else cell.rjust(width)
                for k, (cell, width) in enumerate(zip(row, widths, strict=False))
            ]
            lines.append("  ".join(padded).rstrip())
        return "\n".join([*lines, *self.remarks])


def place(section: str, docs: Path = DOCS) -> tuple[Path, re.Match[str]]:
    """Return the page with the place of a section, which its comments mark, and the place."""
    place = re.compile(f"(?<=<!-- begin {section} -->).*?(?=<!-- end {section} -->)", re.DOTALL)
    found = [(page, place.search(page.read_text())) for page in sorted(docs.rglob("*.md"))]
    places = [(page, match) for page, match in found if match]
    if len(places) != 1:
        raise LookupError(f"{len(places)} places for {section} in {docs}")
    return places[0]


def write(section: str, tables: Sequence[Table], stamp: str, docs: Path = DOCS) -> Path:
    """Put tables, and when and with what they were measured, into their page; all else stays."""
    page, match = place(section, docs)
    lines = [table.markdown() for table in tables] + ([f"*Measured {stamp}.*"] if stamp else [])
    text = match.string
    page.write_text("\n\n".join([text[: match.start()].rstrip("\n"), *lines, text[match.end() :]]))
    return page


def seconds(value: float) -> str:
    """Return a time with three digits."""
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def signed(value: float) -> str:
    """Return a relative error."""
    return f"{value:+.1e}"
