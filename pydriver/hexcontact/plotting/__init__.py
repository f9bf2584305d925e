"""Figures of results.

Every function takes a `Result` (or its dataset) and returns a `matplotlib.figure.Figure`, which needs no
window system; ``figure.savefig("name.pdf")`` writes it. `FIGURES` holds the functions by name.
"""

# ruff: noqa: I001 - the figures are listed in this order

from __future__ import annotations

from collections.abc import Callable

from matplotlib.figure import Figure

from .maps import field_map, pressure_field
from .sections import section, tractions
from .zones import outlines, zones
from .stress import stress, trailing_edge
from .fatigue import fatigue
from .lines import lines
from .wear import wear
from .boundary import contact_boundary
from .history import history, loop, torsion
from .compliance import compliance
from .overview import overview
from . import study as study
from .registry import entries

__all__ = [
    "FIGURES",
    "compliance",
    "contact_boundary",
    "fatigue",
    "field_map",
    "history",
    "lines",
    "loop",
    "outlines",
    "overview",
    "pressure_field",
    "section",
    "stress",
    "torsion",
    "tractions",
    "trailing_edge",
    "wear",
    "zones",
]

FIGURES: dict[str, Callable[..., Figure]] = {
    name: entry.draw for name, entry in entries().items() if entry.of_a_result
}
"""Figures of a result by name; their parameters are the options."""
