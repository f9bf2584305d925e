"""The registry of figures: decorated functions, from which the command, its help and its tests follow."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ParamSpec

import matplotlib
from matplotlib.figure import Figure

from .style import STYLE, settle

P = ParamSpec("P")
Draw = Callable[P, Figure]

SEVERAL_RUNS = "several runs"

_SHARED = """\
result : Result or xarray.Dataset
    Output of `Case.run` or `open_result`.
results : Result or xarray.Dataset, or a sequence of them
    Outputs of `Case.run` or `open_result`.
step : int
    Number of the load step, from 1; -1 is the last one.
steps : int or sequence of int
    Numbers of the load steps, from 1; -1 is the last one.
cycles : int or sequence of int, optional
    Numbers of the cycles, from 1; -1 is the last one. By default the whole history, with the area of the
    last cycle.
angle : float
    Direction of the section from x, rad; at multiples of 30 degrees its points are nodes.
through : tuple of float, optional
    A point of the section, m; by default the node nearest to the center.
ax : matplotlib.axes.Axes, optional
    Axes to draw into; by default those of a new figure.
source : {"edges", "nodes"}, optional
    Where tractions come from, see `hexcontact.Result.traction_field`.
"""
"""Parameters that several figures have, as in their docstrings."""
_PARAMETER = re.compile(r"^(\w+) : .*(?:\n    .*)+", re.MULTILINE)


@dataclass(frozen=True)
class Entry:
    """Describe a figure that can be drawn."""

    name: str  # on the command line
    help: str  # one line about it
    needs: str  # "friction", "torque", ..., `SEVERAL_RUNS`; may be empty
    draw: Callable[..., Figure]  # its parameters besides the result are the options
    first: bool = False  # in lists

    @property
    def options(self) -> Mapping[str, inspect.Parameter]:
        """Parameters of the function by name."""
        return inspect.signature(self.draw).parameters

    @property
    def shows(self) -> str:
        """Kind of its argument: a "result", a "study", a "table" [[stress]] or [[fatigue]], or a "deck"."""
        kinds = {"study": "study", "table": "table", "case": "deck"}
        return next((kind for option, kind in kinds.items() if option in self.options), "result")

    @property
    def of_several(self) -> bool:
        """Whether it may show several results."""
        return "results" in self.options


_ENTRIES: dict[str, Entry] = {}


def entries() -> dict[str, Entry]:
    """Return the figures by name, in the order of lists: those of decks at the end."""
    return dict(sorted(_ENTRIES.items(), key=lambda item: (not item[1].first, item[1].shows == "deck")))


def _documented(draw: Draw[P], needs: str) -> str:
    """Complete the docstring of a figure: shared parameters, returned value, and errors."""
    text, *parts = re.split(r"\n\n(Parameters|Raises)\n-+\n", inspect.getdoc(draw) or "")
    own = dict(zip(parts[::2], parts[1::2], strict=True))
    known = {one[1]: one[0] for one in _PARAMETER.finditer(f"{_SHARED}\n{own.get('Parameters', '')}")}
    names = inspect.signature(draw).parameters.keys()
    errors = "IndexError\n    If there is no such step.\n" * bool({"step", "steps"} & names)
    lacks = f"there is no {needs} in the result, or " * bool(needs)
    errors += own.get("Raises", f"ValueError\n    If {lacks}the result does not contain what is drawn.")
    sections = {
        "Parameters": "\n".join(known[name] for name in names if name in known),
        "Returns": "matplotlib.figure.Figure",
        "Raises": errors,
    }
    return "\n\n".join([text, *(f"{name}\n{'-' * len(name)}\n{part}" for name, part in sections.items())])


def styled(draw: Draw[P], needs: str = "") -> Draw[P]:
    """Return a function that draws in the common style, and lays out figures that are not the caller's."""
    signature = inspect.signature(draw)

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with matplotlib.rc_context(STYLE):
            figure = draw(*args, **kwargs)
            if signature.bind(*args, **kwargs).arguments.get("ax") is None:
                settle(figure)
            return figure

    drawn.__doc__ = _documented(draw, needs)
    return drawn


def figure(name: str, help: str, needs: str = "", first: bool = False) -> Callable[[Draw[P]], Draw[P]]:
    """Register a function that draws a figure, see `Entry`."""

    def register(draw: Draw[P]) -> Draw[P]:
        drawn = styled(draw, needs)
        _ENTRIES[name] = Entry(name, help, needs, drawn, first)
        return drawn

    return register
