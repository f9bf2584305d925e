"""Words, numbers with prefixes of units, and tables as text, as HTML and for terminals."""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rich.table import Table as RichTable

Row = tuple[str, ...]

_TABLE = "border-collapse:collapse;margin:0.3em 0"
_CELL = "padding:0.15em 1.2em 0.15em 0;border:0;background:none"
_HEAD = f"{_CELL};border-bottom:1px solid currentColor;font-weight:600"
_TITLE = "font-weight:600;text-align:left;padding:0.2em 0;color:inherit;caption-side:top"

# Control characters but tab and ends of lines, separators of lines, marks that change the direction of
# reading, halves of surrogate pairs, and non-characters: terminals obey them, XML forbids most.
_UNSEEN = re.compile(
    "[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
    "|\r(?!\n)"
)


def visible(text: str) -> str:
    r"""Replace control characters, which XML forbids: an escape character becomes ``\u001b``."""
    return _UNSEEN.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def escaped(text: str) -> str:
    """Write text of a user for HTML and XML."""
    import html

    return html.escape(visible(text))


def cut(text: str, width: int) -> str:
    """Shorten a line to a width by whole parts, which two blanks divide, or by whole words."""
    for blank in ("  ", " "):
        while len(text) > width and blank in text:
            text = text.rpartition(blank)[0].rstrip()
    return text[:width]


def dotted(key: Sequence[str | int]) -> str:
    """Write the path of a key as in a deck: "load.2.steps" belongs to the second entry of [[load]]."""
    return ".".join(str(part + 1) if isinstance(part, int) else part for part in key)


def shown(value: object, width: int = 60, depth: int = 5) -> str:
    """Write a value as in a deck, shortened if it is long or deep."""
    if isinstance(value, str | bool):
        text = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, Mapping | list | tuple) and depth == 0:
        text = "..."
    elif isinstance(value, Mapping):
        text = (
            "{" + ", ".join(f"{key} = {shown(entry, width, depth - 1)}" for key, entry in value.items()) + "}"
        )
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(shown(entry, width, depth - 1) for entry in value[:width]) + "]"
    elif isinstance(value, int):
        text = hex(value) if value.bit_length() > 200 else str(value)
    elif hasattr(value, "__float__") and not getattr(value, "shape", ()) and not hasattr(value, "units"):
        text = repr(float(value))
    else:
        text = str(value)
    return text if len(text) <= width else text[: width - 3] + "..."


def listed(entries: Sequence[str], conjunction: str) -> str:
    """Join entries with commas and a conjunction: "a, b or c"; nothing if there are none."""
    return f" {conjunction} ".join([*filter(None, [", ".join(entries[:-1])]), *entries[-1:]])


def folded(word: str) -> str:
    """Return a word without case, blanks, underscores and hyphens."""
    return "".join(word.split()).replace("_", "").replace("-", "").casefold()


def nearest(word: object, known: Iterable[str], cutoff: float = 0.6) -> str:
    """Return the nearest known word, first without case, blanks and underscores; empty if none is near."""
    of_folded = {folded(name): name for name in known}
    near = difflib.get_close_matches(folded(str(word)[:100]), list(of_folded), n=1, cutoff=cutoff)
    return of_folded[near[0]] if near else ""


def counted(count: int | str, one: str, more: str = "") -> str:
    """Write a number of things: "1 hole", "2 holes"; `more` is an irregular plural."""
    return f"{count} {one if str(count) == '1' else more or f'{one}s'}"


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" with the nearest known word, or nothing."""
    near = nearest(word, known)
    return f"; did you mean {near}?" if near else ""


PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}

_POWERS = {"m2": ("m²", 2), "m3": ("m³", 3)}  # units whose prefix is raised to a power


def quantity(value: float, unit: str = "", digits: int = 4) -> str:
    """Write a number with a prefix of its unit: ``quantity(8.543e8, "Pa")`` is ``"854.3 MPa"``."""
    if math.isnan(value):
        return "-"
    if value == math.inf:
        return "unbounded"
    if value == 0 or math.isinf(value):
        return f"{value + 0.0:g} {unit}".rstrip()  # no sign on zero
    rounded = float(f"{value:.{digits - 1}e}")
    shown, times = _POWERS.get(unit, (unit, 1))
    # areas from 0.1 of a unit on, volumes from 0.01
    power = 3 * math.floor((math.log10(abs(rounded)) + times - 1) / (3 * times))
    if not unit or power not in PREFIXES:
        return f"{rounded:.{digits}g} {unit}".rstrip()
    counted = rounded / 10.0 ** (times * power)
    number = f"{counted:#.{digits}g}".rstrip(".") if abs(counted) < 10**digits else f"{counted:.0f}"
    return f"{number} {PREFIXES[power]}{shown}"


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Return factor and unit that scale a quantity to 1 ... 1000: ``(1e-6, "MPa")`` for 8.5e8 Pa.

    An area is scaled to 0.1 ... 100,000, a volume to 0.01 ... 10,000,000, as by `quantity`.
    """
    shown, power = _POWERS.get(unit, ("" if unit == "1" else unit.replace("m2", "m²"), 1))
    if not shown or not math.isfinite(largest) or largest == 0.0:
        return 1.0, shown
    size = math.log10(abs(largest) * 1.0000001) + (power - 1)
    exponent = 3 * math.floor(size / (3 * power))
    exponent = min(max(exponent, -12), 9)
    return 10.0 ** (-exponent * power), PREFIXES[exponent] + shown


def worded(value: float, unit: str) -> str:
    """Write a quantity with four digits and a prefix: "747.6 µm", "1 kN"."""
    factor, scaled_unit = scaled(value, unit)
    return f"{value * factor:.4g} {scaled_unit}"


def percent(share: float) -> str:
    """Write a share with two digits, as "0.051 %"."""
    return f"{100.0 * share:.2g} %" if math.isfinite(share) else "-"


def cycle_count(cycles: float) -> str:
    """Write a number of cycles, which jumps may leave broken: "12,000", "12.5"."""
    return (f"{cycles:,.1f}" if cycles >= 1.0 else f"{cycles:.2g}").removesuffix(".0")


class Table(NamedTuple):
    """A table: printed as text, in notebooks as HTML, in terminals by `rich`."""

    headers: Row  # of its columns; none is shown if all are empty
    rows: Sequence[Row]  # its cells
    title: str = ""
    note: str = ""  # sentence below it
    tight: bool = False  # whether its columns stand closer in a terminal

    def _aligned(self) -> list[str]:
        """Return the sides of the columns: numbers, some of which may be missing, stand at the right."""
        cells = [[row[k] for row in self.rows if row[k] not in ("", "-")] for k in range(len(self.headers))]
        numbers = [
            [cell.lstrip("+-").replace("inf", "0")[:1].isdigit() for cell in column] for column in cells
        ]
        return ["right" if k > 0 and known and all(known) else "left" for k, known in enumerate(numbers)]

    def __str__(self) -> str:
        """Return title, table and note as plain text."""
        lines = [[visible(cell) for cell in row] for row in (self.headers, *self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        pads = [str.rjust if side == "right" else str.ljust for side in self._aligned()]
        shown = [
            "  ".join(pad(cell, width) for pad, cell, width in zip(pads, line, widths, strict=True)).rstrip()
            for line in (lines if any(self.headers) else lines[1:])
        ]
        return "\n".join([self.title] * bool(self.title) + shown + [self.note] * bool(self.note))

    def _repr_html_(self) -> str:
        """Return the table as HTML for light and dark notebooks."""
        sides = self._aligned()

        def line(row: Row, tag: str, style: str) -> str:
            cells = (
                f'<{tag} style="{style};text-align:{side}">{escaped(cell)}</{tag}>'
                for cell, side in zip(row, sides, strict=True)
            )
            return f'<tr style="background:none">{"".join(cells)}</tr>'

        head = f"<thead>{line(self.headers, 'th', _HEAD)}</thead>" if any(self.headers) else ""
        body = "".join(line(row, "td", _CELL) for row in self.rows)
        caption = f'<caption style="{_TITLE}">{escaped(self.title)}</caption>' if self.title else ""
        under = (
            f'<div style="opacity:0.75;margin-bottom:0.6em">{escaped(self.note)}</div>' if self.note else ""
        )
        return f'<table style="{_TABLE}">{caption}{head}<tbody>{body}</tbody></table>{under}'

    def __rich__(self) -> RichTable:
        """Return the table of `rich`; columns of names and labels may wrap, those of numbers do not."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        shown = RichTable(
            title=Text(visible(self.title), style="bold"), title_justify="left", box=box.SIMPLE_HEAD,
            show_header=any(self.headers), caption=self.note or None,
            pad_edge=False, collapse_padding=self.tight,
        )  # fmt: skip
        for header in self.headers:
            text = header in ("", "label")  # a column of names or labels
            shown.add_column(Text(header), justify="left" if text else "right", no_wrap=not text)
        for row in self.rows:
            shown.add_row(*(Text(visible(cell)) for cell in row))
        return shown
