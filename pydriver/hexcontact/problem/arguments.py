"""Arguments of a case built in Python, as tables of a deck."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

from ..core.lattice import Lattice
from ..deck import keys as deck_keys
from ..deck.interface import Interface
from ..deck.series import COLUMNS
from ..deck.surfaces import Surface
from ..deck.table_base import SYMBOLS, Argument, Table, not_included
from ..deck.toml import plain
from ..text import listed, nearest

_P = ParamSpec("_P")
_T = TypeVar("_T")
_TABLES: dict[str, type[Table]] = {  # of arguments that take one
    "body_1": deck_keys.Body,
    "bulk": deck_keys.Bulk,
    "interface": Interface,
    "accuracy": deck_keys.Accuracy,
    "wear": deck_keys.Wear,
    "loads": deck_keys.Load,
}


_ANGLES = ("twist", "rolling_direction", "grid.cell_angle", "grid.direction")


def known_keywords(call: Callable[_P, _T]) -> Callable[_P, _T]:
    """Let a method name the keyword nearest to an unknown one in its TypeError.

    An unknown keyword may be a symbol (``mu``), a key of a table that an argument takes (``max_nodes``), the
    beginning of a keyword (``friction``), or misspelled.
    """
    _, *known = inspect.signature(call).parameters
    title = call.__qualname__.removesuffix(".__init__")

    @functools.wraps(call)
    def checked(*arguments: _P.args, **keywords: _P.kwargs) -> _T:
        refuse_unknown(keywords, known, title)
        return call(*arguments, **keywords)

    return checked


def refuse_unknown(keywords: Iterable[str], known: Collection[str], title: str) -> None:
    """Raise a TypeError for an unknown keyword that names the nearest."""
    if (name := next((name for name in keywords if name not in known), None)) is None:
        return
    path = SYMBOLS.get(name, name)
    same = [word for word in (path, path.replace(".", "_")) if word in known]
    below = [f"{of}.{path}" for of in known if of in _TABLES and path in _TABLES[of].known_keys()]
    longer = [word for word in known if word.startswith(f"{name}_")]
    near = [*same, *below, *longer, *filter(None, [nearest(name, known, cutoff=0.7)])]
    hint = f"did you mean {near[0]}?" if near else f"known here: {listed(list(known), 'and')}"
    raise TypeError(f"{name}: unknown argument of {title}; {not_included(name) or hint}")


class Body(Argument, deck_keys.Body):
    """One of the two bodies, an argument of `hexcontact.Case`.

    Young's modulus (Pa) and Poisson's ratio are None for a rigid body; the surface is None for a flat one, or
    if the case has a gap. A coating is a
    sequence of mappings, outermost first, each with ``thickness`` (m), ``young_modulus`` (Pa) and
    ``poisson_ratio``.
    """

    @known_keywords
    def __init__(
        self,
        young_modulus: float | str | None = None,
        poisson_ratio: float | None = None,
        rigid: bool = False,
        surface: Surface | None = None,
        *,
        coating: Sequence[Mapping[str, Any] | deck_keys.Coating] = (),
    ) -> None:
        keys = {name: value for name, value in locals().items() if name in deck_keys.Body.model_fields}
        keys["coating"] = list(coating)
        super().__init__(**plain(keys))


def with_radians(value: Any, key: str = "") -> Any:
    """Add the unit to bare angles of grid and loads: in Python, unlike in a deck, all numbers are SI.

    NaN is an empty entry of a series.
    """
    if isinstance(value, dict):
        return {name: with_radians(entry, name) for name, entry in value.items()}
    if isinstance(value, list):
        return [with_radians("" if key in COLUMNS and entry != entry else entry, key) for entry in value]
    bare = key in _ANGLES and isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value!r} rad" if bare else value


def middle_of(lattice: Lattice) -> list[float]:
    """Return the point (m) that leads a deck to the same window."""
    middle = [lattice.cols[lattice.n_col // 2], lattice.rows[lattice.n_row // 2]]
    center: list[float] = (lattice.origin + middle @ lattice.basis).tolist()
    return center
