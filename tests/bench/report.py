"""Tables: printed on the terminal, kept as JSON between runs, written into docs/performance.md."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

HERE = Path(__file__).parent
PAGE = HERE.parents[1] / "docs" / "performance.md"
TEMPLATE = HERE / "performance.md.in"


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


def keep(store: Path, section: str, tables: Sequence[Table], date: str) -> None:
    """Add the tables of a section to the file of results."""
    results = json.loads(store.read_text()) if store.exists() else {}
    results[section] = {"date": date, "tables": [asdict(table) for table in tables]}
    store.parent.mkdir(parents=True, exist_ok=True)
    store.write_text(json.dumps(results, indent=1, ensure_ascii=False))


def write_page(store: Path, page: Path = PAGE) -> list[str]:
    """Fill the template with all kept results; return the sections that have none."""
    results = json.loads(store.read_text()) if store.exists() else {}
    text = TEMPLATE.read_text()
    newest = max((kept["date"] for kept in results.values()), default="")
    missing = []
    for section in sections():
        if section in results:
            kept = results[section]
            filled = "\n\n".join(Table(**table).markdown() for table in kept["tables"])
            if kept["date"] != newest:
                filled += f"\n\nMeasured on {kept['date']}."
        else:
            filled = "Not measured yet."
            missing.append(section)
        text = text.replace(f"@@{section}@@", filled)
    page.write_text(text)
    return missing


def sections() -> list[str]:
    """Return the sections of the page, in order."""
    return [word.split("@@")[0] for word in TEMPLATE.read_text().split("\n@@")[1:]]


def seconds(value: float) -> str:
    """Return a time with three digits."""
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def signed(value: float) -> str:
    """Return a relative error."""
    return f"{value:+.1e}"
