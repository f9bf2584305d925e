"""Pictures of a result.

Every function takes a `Result` (or its dataset) and returns a `matplotlib.figure.Figure` that needs no window
system; ``figure.savefig("name.pdf")`` writes it. `FIGURES` lists them by name.
"""

# ruff: noqa: I001 - the figures are listed in this order

from __future__ import annotations

from collections.abc import Callable

from matplotlib.figure import Figure

from .maps import field_map, pressure_field
from .sections import section, tractions
from .zones import outlines, zones
from .boundary import contact_boundary
from .history import history, loop, torsion
from .compliance import compliance
from .overview import overview
from . import influence as influence
from .registry import entries

__all__ = [
    "FIGURES",
    "compliance",
    "contact_boundary",
    "field_map",
    "history",
    "loop",
    "outlines",
    "overview",
    "pressure_field",
    "section",
    "torsion",
    "tractions",
    "zones",
]

FIGURES: dict[str, Callable[..., Figure]] = {
    name: entry.draw for name, entry in entries().items() if entry.of_a_result
}
"""Pictures of a result by name; their parameters say what can be chosen."""
