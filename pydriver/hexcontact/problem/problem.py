"""A contact problem in SI units, checked: what is solved, whatever asked for it."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..core import contact, friction, memory
from ..core.contact import ElasticPair, Method
from ..core.lattice import Lattice
from ..deck import toml
from ..deck.faults import MISSING, Mistake, Source, deck_error
from ..deck.kinds import SMALLEST
from ..deck.read import Assembled, assemble
from ..deck.tables import Accuracy, Grid
from ..deck.write import as_toml, plain
from ..errors import DeckError
from ..text import listed
from . import window
from .arguments import Body
from .checks import checked
from .gap import Gap, GivenGap
from .window import Estimate, NoContactFound

Array = NDArray[np.float64]

# Windows of up to this number of nodes go to LAPACK when the method is "auto"; beyond, transforms are faster.
MOST_DIRECT_NODES = 200
_SMALLEST_BETA = 1e-6  # below, pressure and shear do not couple


class Problem:
    """A checked contact problem.

    Attributes
    ----------
    title : str
        A line about the case.
    body_1, body_2 : Body
        The bodies.
    pair : ElasticPair
        Their compliances.
    friction_coefficient : float
        Coefficient of friction.
    solver : Solver
        How it is solved: the table of the deck, with the algorithm that follows from it.
    accuracy : Accuracy or None
        How accurate the result is to be; None: the lattice is not refined.
    load_steps : tuple of LoadStep
        The history; a segment in adaptive steps is one of them.
    output : Output
        What is written, and where.
    deck : Deck
        The deck, checked and in SI.
    deck_file : Path or None
        The file it was read from.
    lattice : Lattice
        The window to start with.
    window_fixed : bool
        Whether the size of the window was given: contact at its rim is an error then, otherwise the window
        grows.
    """

    deck_file: Path | None = None

    @classmethod
    def from_toml(cls, path: str | Path, overrides: Mapping[str, Any] | None = None) -> Self:
        """Read a deck.

        Parameters
        ----------
        path : str or Path
            The deck.
        overrides : mapping, optional
            Values for single keys in place of the deck's: ``{"grid.spacing": "0.1 mm", "load.1.steps": 5}``.
            Entries of arrays count from 1; None removes a key.

        Raises
        ------
        DeckError
            If it cannot be read, or with a sentence for each thing that is wrong with it.
        """
        data, text = toml.read_toml(path)
        source = Source(str(path), text)
        case = cls._made(assemble(data, text, source, Path(path).parent, overrides))
        case.deck_file = Path(path).absolute()
        return case

    @classmethod
    def from_text(cls, text: str, name: str = "deck", overrides: Mapping[str, Any] | None = None) -> Self:
        """Read a deck from its text (as a result file keeps it); `name` is what messages call it."""
        data = toml.parse_toml(text, name)
        return cls._made(assemble(data, text, Source(name, text), Path(), overrides))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Make a case from the tables of a deck: ``{"body": {"1": {...}, ...}, "grid": {...}, ...}``."""
        if not isinstance(data, Mapping):
            raise DeckError("a deck: expected tables of keys")
        toml.refuse_deep(data, "")
        return cls._made(assemble(plain(data)))

    @classmethod
    def _made(cls, given: Assembled, gap: GivenGap | None = None, lattice: Lattice | None = None) -> Self:
        case = cls.__new__(cls)
        case._set_up(given, gap, lattice)
        return case

    def _set_up(self, given: Assembled, gap: GivenGap | None, lattice: Lattice | None) -> None:
        self._given = given
        self.deck, self.solver, self.load_steps = checked(given, gap is not None)
        deck = self.deck
        self.title, self.accuracy, self.output = deck.title, deck.accuracy, deck.output
        one, two = (Body.model_construct(**dict(body)) for body in (deck.body.body_1, deck.body.body_2))
        self.body_1, self.body_2 = one, two
        self.friction_coefficient = deck.friction.coefficient if deck.friction else 0.0
        self._gap = Gap(deck.body.separation if gap is None else gap)
        self.pair = ElasticPair.from_materials(
            one.young_modulus, one.poisson_ratio, two.young_modulus, two.poisson_ratio
        )
        self.window_fixed = window.is_fixed(deck.grid)
        self._contact: Estimate | None = None  # where the window follows from it alone
        self._contact_radius = math.inf  # estimated; of an array of gaps nothing is known
        self.lattice = self._size(deck.grid, given.source, lattice)
        if self.accuracy and (problems := self._refinement_problems(self.accuracy)):
            raise deck_error(problems, given.source)

    @cached_property
    def deck_text(self) -> str:
        """The case as a deck, whole: with what it includes, what was set, and series of loads from files."""
        given = self._given
        if given.text:
            return given.text
        data = plain(given.data)
        if self._gap.given:
            # Refused when read again, instead of solving something else.
            data["body"]["1"]["surface"] = {"shape": "python"}
        return given.remark + as_toml(data)

    @property
    def adaptive(self) -> bool:
        """Whether load steps are chosen on the way: some are "auto", and the answer depends on them."""
        incremental = self.solver.algorithm == "incremental"
        return incremental and any(step.ramp is not None for step in self.load_steps)

    @property
    def planned_steps(self) -> int:
        """Number of load steps; 0 if it shows on the way."""
        return 0 if self.adaptive else len(self.load_steps)

    @property
    def frictional(self) -> bool:
        """Whether shear tractions are solved for."""
        return self.solver.algorithm != "frictionless"

    @property
    def coupled(self) -> bool:
        """Whether pressure and shear move each other."""
        return self.solver.coupling == "full" and abs(self.pair.beta) > _SMALLEST_BETA

    # --- what solving needs ---------------------------------------------------------------------------------

    def initial_gap(self, lattice: Lattice) -> tuple[Array, NDArray[np.bool_]]:
        """Return the gap before loading, over the nodes of a window.

        Parameters
        ----------
        lattice : Lattice
            The window.

        Returns
        -------
        gap : ndarray, (n_row, n_col)
            Initial gap (m) from first touch; inf where nothing can touch.
        candidate : ndarray of bool, (n_row, n_col)
            False where the two bodies can never touch, as outside a punch.

        Raises
        ------
        DeckError
            If a gap given in Python does not fit the window or is not a number somewhere.
        """
        gap = self._gap.over(lattice)
        return gap, np.isfinite(gap)

    def check_contact(self, number: int, lattice: Lattice, contact: NDArray[np.bool_]) -> None:
        """Refuse a load step whose contact reaches the end of a height map, where it stops with the data.

        Parameters
        ----------
        number : int
            Number of the load step.
        lattice : Lattice
            Its window.
        contact : ndarray of bool, (n_row, n_col)
            The nodes in contact.

        Raises
        ------
        DeckError
            If it does.
        """
        if self._gap.ends_within(lattice.spacing, lattice.x[contact], lattice.y[contact]):
            raise DeckError(
                f"gap: the contact of load step {number} reaches the end of the height map; expected heights "
                "of a larger part, or a function that says what lies beyond"
            )

    def grown(self, lattice: Lattice, contact: NDArray[np.bool_] | None = None) -> Lattice:
        """Return a larger window with the same nodes, for a contact that reached the rim.

        Parameters
        ----------
        lattice : Lattice
            The window that became too small.
        contact : ndarray of bool, (n_row, n_col), optional
            The nodes in contact: only the sides that they reach grow, by a quarter each. All sides without
            it.
        """
        return window.grown(lattice) if contact is None else window.grown(lattice, window.rim_sides(contact))

    def on_lattice(self, spacing: float, origin: tuple[float, float]) -> Self:
        """Return the same problem on another lattice, solved on that one alone.

        Parameters
        ----------
        spacing : float
            Spacing, m.
        origin : (float, float)
            Position of a node, m.
        """
        other = copy.copy(self)
        other.accuracy = None
        moved = np.array(window.lattice_coordinates(*self.lattice.origin, origin))
        if self._contact is not None:
            bounds = self._contact.bounds + moved[:, None]
            other.lattice = window.enclosing(bounds[:, 0], bounds[:, 1], spacing, window.MARGIN, origin)
        else:
            other.lattice = window.covering(self.lattice, spacing, origin)
        return other

    def method_for(self, lattice: Lattice) -> Method:
        """Return the method to use on a window, "direct" or "fft"; decides what "auto" means."""
        if self.solver.method == "auto":
            # with friction transforms are faster on any window, without it they need a few nodes for that
            return "direct" if lattice.size <= MOST_DIRECT_NODES and not self.frictional else "fft"
        return "direct" if self.solver.method == "direct" else "fft"

    def contact_nodes(self, lattice: Lattice) -> int:
        """Return the nodes in contact at the largest load, as estimated; all where there is no estimate."""
        return math.ceil(min(math.pi * self._contact_radius**2 / lattice.cell_area, lattice.size))

    def memory_needed(self, lattice: Lattice) -> int:
        """Return the memory (bytes) that solving on a window takes, with a contact as large as estimated."""
        method, shape = self.method_for(lattice), lattice.shape
        nodes = self.contact_nodes(lattice)
        if not self.frictional:
            return contact.memory_needed(method, *shape, contact=nodes, threads=memory.threads())
        return friction.memory_needed(
            method,
            *shape,
            contact=nodes,
            loads=max(sum(t.control == "force" for t in step.targets) for step in self.load_steps),
            coupled=self.coupled,
            threads=memory.threads(),
        )

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the same case with other values for some keys of its deck.

        Parameters
        ----------
        changes : mapping
            New values by dotted key, with units or in SI: ``{"friction.coefficient": 0.2,
            "load.2.steps": 20}``. Entries of arrays count from 1; None removes a key. The window is found
            anew, also where a `Lattice` was given; that of a gap over its nodes cannot change.

        Raises
        ------
        DeckError
            With a sentence for each thing that is wrong then.
        """
        folder = self.deck_file.parent if self.deck_file else Path()
        lattice = self.lattice if self._gap.at_nodes else None
        given = assemble(plain(self._given.data), folder=folder, overrides=changes)
        case = self._made(given, self._gap.source if self._gap.given else None, lattice)
        if lattice is not None and case.deck.grid != self.deck.grid:
            changed = listed([key for key in changes if key.partition(".")[0] == "grid"], "and")
            raise DeckError(
                f"{changed}: the gap of this case is an array over the nodes of its lattice, which stays as "
                "it is; make a new Case with gap=... and lattice=..."
            )
        case.deck_file = self.deck_file
        return case

    def __eq__(self, other: object) -> bool:
        """Whether two cases are the same problem, with the same solver and output."""
        if not isinstance(other, Problem):
            return NotImplemented
        mine, others = ((one._gap, one.deck, one.load_steps, one.lattice) for one in (self, other))
        return mine == others

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Name the case, its window and its steps."""
        rows, cols = self.lattice.shape
        title = f"{self.title!r}, " if self.title else ""
        what = "adaptive segment" if self.adaptive else "load step"
        return (
            f"{type(self).__name__}({title}{self.solver.algorithm}, {rows} x {cols} nodes, "
            f"{(n := len(self.load_steps))} {what}{'s' * (n > 1)})"
        )

    # --- the window -----------------------------------------------------------------------------------------

    def _refinement_problems(self, wanted: Accuracy) -> list[Mistake]:
        """Return what prevents a refinement that is fine enough to estimate errors."""
        if self._gap.at_nodes:
            sentence = "needs a gap that is known everywhere: surfaces or a function, not an array over nodes"
            return [Mistake(("accuracy", "target"), wanted.target, sentence)]
        if self.adaptive:
            sentence = 'expected steps as numbers with it, not "auto": all lattices need the same load steps'
            return [Mistake(("accuracy", "target"), wanted.target, sentence)]
        third = self.on_lattice(self.lattice.spacing / 2, self.lattice.origin).lattice.size
        if third <= wanted.max_nodes:
            return []
        sentence = (
            f"expected at least {third}, the nodes of the third lattice, or a coarser grid to begin with"
        )
        return [Mistake(("accuracy", "max_nodes"), wanted.max_nodes, sentence)]

    def _size(self, grid: Grid, source: Source, lattice: Lattice | None) -> Lattice:
        """Return the window, checked against an estimate of the contact wherever there is one."""
        if self._gap.at_nodes and lattice is not None:
            self.initial_gap(lattice)
            return lattice
        touch = self._gap.first_touch or (0.0, 0.0)
        center = grid.center or touch
        try:
            estimate = self._estimate(center if self._gap.given else touch, grid.origin)
        except NoContactFound as error:
            raise deck_error(
                [Mistake(("grid",), MISSING, f"no window can be found: {error}")], source
            ) from None
        self._contact_radius = estimate.radius
        if lattice is None and not (self.window_fixed or grid.nodes_across):
            self._contact = estimate
        lattice = lattice or window.window(grid, center, estimate)
        if problems := window.check(grid, lattice, estimate):
            raise deck_error(problems, source)
        return lattice

    def _estimate(self, center: tuple[float, float], origin: tuple[float, float]) -> Estimate:
        """Estimate the contact at the largest load of the history, by force and by approach."""
        largest = {
            name: max((s.z.value for s in self.load_steps if s.z.control == control), default=0.0)
            for name, control in (("normal_load", "force"), ("approach", "displacement"))
        }
        found = [
            window.estimate_contact(self.pair, self._gap.at, center, origin, **{name: value})
            for name, value in largest.items()
            if value >= SMALLEST
        ]
        return found[0] if len(found) == 1 else found[0].joined(found[1])
