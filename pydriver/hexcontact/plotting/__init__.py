"""Figures of results.

Every function takes a `Result` (or its dataset) and returns a `matplotlib.figure.Figure`, which needs no
window system; ``figure.savefig("name.pdf")`` writes it. `FIGURES` holds the functions by name.
"""

# ruff: noqa: I001 - the figures are listed in this order

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable

from matplotlib.figure import Figure

from .maps import field_map, pressure_field, surface
from .sections import section, tractions, wear
from .zones import contact_boundary, outlines, zones
from .history import compliance, creep, history, loop, torsion
from .below import fatigue, lines, stress, trailing_edge
from .overview import overview
from .registry import entries

__all__ = [
    "FIGURES",
    "compliance",
    "contact_boundary",
    "creep",
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
    "surface",
    "torsion",
    "tractions",
    "trailing_edge",
    "wear",
    "zones",
]

for _module in pkgutil.iter_modules(__path__):  # any other figures
    importlib.import_module(f"{__name__}.{_module.name}")

FIGURES: dict[str, Callable[..., Figure]] = {
    name: entry.draw for name, entry in entries().items() if entry.shows == "result"
}
"""Figures of a result by name; their parameters are the options."""
