"""The registry of figures: decorated functions, from which the command, its help and its tests follow."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ParamSpec

import matplotlib
from matplotlib.figure import Figure

from .style import STYLE, settle

P = ParamSpec("P")
Draw = Callable[P, Figure]

SEVERAL_RUNS = "several runs"


@dataclass(frozen=True)
class Entry:
    """A figure that can be drawn.

    Attributes
    ----------
    name : str
        Name of the figure on the command line.
    help : str
        One line about it.
    needs : str
        What it needs: "friction", "torque", ..., `SEVERAL_RUNS`; may be empty.
    draw : callable
        The function; its parameters besides the result are the options.
    first : bool
        Whether it is the first in lists.
    """

    name: str
    help: str
    needs: str
    draw: Callable[..., Figure]
    first: bool = False

    @property
    def options(self) -> Mapping[str, inspect.Parameter]:
        """Parameters of the function by name."""
        return inspect.signature(self.draw).parameters

    @property
    def of_a_result(self) -> bool:
        """Whether it shows a result."""
        return self.of_several or "result" in self.options

    @property
    def of_a_study(self) -> bool:
        """Whether it shows a study."""
        return "study" in self.options

    @property
    def of_a_table(self) -> bool:
        """Whether it shows a table [[stress]] or [[fatigue]]."""
        return "table" in self.options

    @property
    def of_several(self) -> bool:
        """Whether it may show several results."""
        return "results" in self.options


_ENTRIES: dict[str, Entry] = {}


def entries() -> dict[str, Entry]:
    """Return the figures by name, in the order of lists."""
    return dict(sorted(_ENTRIES.items(), key=lambda item: not item[1].first))


def styled(draw: Draw[P]) -> Draw[P]:
    """Return a function that draws in the common style, and lays out figures that are not the caller's."""
    signature = inspect.signature(draw)

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with matplotlib.rc_context(STYLE):
            figure = draw(*args, **kwargs)
            if signature.bind(*args, **kwargs).arguments.get("ax") is None:
                settle(figure)
            return figure

    return drawn


def figure(name: str, help: str, needs: str = "", first: bool = False) -> Callable[[Draw[P]], Draw[P]]:
    """Register a function that draws a figure.

    Parameters
    ----------
    name, help, needs, first : str, str, str, bool
        See `Entry`.
    """

    def register(draw: Draw[P]) -> Draw[P]:
        drawn = styled(draw)
        _ENTRIES[name] = Entry(name, help, needs, drawn, first)
        return drawn

    return register
