"""A contact problem in SI units, checked: what is solved, whatever asked for it."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import reals
from ..core import contact as native
from ..core import friction as native_friction
from ..core import memory
from ..core.contact import ElasticPair, Method
from ..core.lattice import Lattice
from ..deck import tables as decks
from ..deck.faults import MISSING, Mistake, Source, deck_error
from ..deck.kinds import SMALLEST
from ..deck.read import Assembled, assemble
from ..deck.surfaces import Separation
from ..deck.tables import Deck
from ..errors import DeckError
from ..text import listed
from ..variables import LARGEST
from . import window as grids
from .arguments import HeightMap, as_toml
from .checks import algorithm_of, checked_deck
from .loads import LoadStep, load_steps
from .settings import AccuracySettings, Body, OutputSettings, SolverSettings
from .window import Estimate, NoContactFound

Array = NDArray[np.float64]

# Windows of up to so many nodes go to LAPACK when the method is "auto"; beyond, transforms are faster.
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
    solver : SolverSettings
        How it is solved.
    accuracy : AccuracySettings or None
        How accurate the result is to be; None: the lattice is not refined.
    load_steps : tuple of LoadStep
        The history; a segment in adaptive steps is one of them.
    output : OutputSettings
        What is kept.
    deck : Deck
        The deck, checked and in SI.
    deck_text : str
        The case as a deck, whole: with what it includes, what was set, and the series of loads from files.
    deck_file : Path or None
        The file it was read from.
    lattice : Lattice
        The window to start with.
    window_fixed : bool
        Whether the size of the window was given: contact at its rim is an error then, otherwise the window
        grows.
    """

    title: str
    body_1: Body
    body_2: Body
    pair: ElasticPair
    friction_coefficient: float
    solver: SolverSettings
    accuracy: AccuracySettings | None
    load_steps: tuple[LoadStep, ...]
    output: OutputSettings
    deck: Deck
    deck_text: str
    deck_file: Path | None = None
    lattice: Lattice
    window_fixed: bool

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
        data, text = decks.read_toml(path)
        case = cls._made(data, text, Source(str(path), text), Path(path).parent, overrides)
        case.deck_file = Path(path).absolute()
        return case

    @classmethod
    def from_text(cls, text: str, name: str = "deck", overrides: Mapping[str, Any] | None = None) -> Self:
        """Read a deck from its text (as a result file keeps it); `name` is what messages call it."""
        return cls._made(decks.parse_toml(text, name), text, Source(name, text), overrides=overrides)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Make a case from the tables of a deck: ``{"body": {"1": {...}, ...}, "grid": {...}, ...}``."""
        return cls._made(data, None, Source())

    @classmethod
    def _made(
        cls,
        data: Mapping[str, Any],
        text: str | None,
        source: Source,
        folder: Path = Path(),
        overrides: Mapping[str, Any] | None = None,
    ) -> Self:
        if not isinstance(data, Mapping):
            raise DeckError("a deck: expected tables of keys")
        case = cls.__new__(cls)
        case._set_up(assemble(data, text, source, folder, overrides), None, None)
        return case

    def _set_up(
        self,
        given: Assembled,
        gap: Callable[[Array, Array], ArrayLike] | Array | None,
        lattice: Lattice | None,
    ) -> None:
        source = given.source
        deck, problems = checked_deck(given.data, given.problems, gap is not None)
        if deck is None or problems:
            raise deck_error(problems, source)
        self.deck = deck
        self.deck_text = given.text or given.remark + as_toml(given.data, gap is not None)
        self.title = deck.title
        self.body_1, self.body_2 = _body(deck.body.body_1), _body(deck.body.body_2)
        self.friction_coefficient = deck.friction.coefficient if deck.friction else 0.0
        algorithm, _ = algorithm_of(deck.friction, deck.solver)
        given_solver = deck.solver
        self.solver = SolverSettings(
            algorithm,
            given_solver.method,
            given_solver.tolerance,
            given_solver.coupling,
            given_solver.entry,
            given_solver.step_tolerance,
        )
        wanted = deck.accuracy
        self.accuracy = AccuracySettings(wanted.target, wanted.max_nodes) if wanted else None
        self.output = OutputSettings(
            Path(deck.output.file) if deck.output.file else None, deck.output.fields or (), deck.output.every
        )
        mu = self.friction_coefficient if self.frictional else None
        self.load_steps, _ = load_steps(deck.load, mu)
        self._surface_gap = (
            Separation(deck.body.body_1.surface, deck.body.body_2.surface) if gap is None else None
        )
        self._given_gap = gap

        self.pair = ElasticPair.from_materials(
            self.body_1.young_modulus,
            self.body_1.poisson_ratio,
            self.body_2.young_modulus,
            self.body_2.poisson_ratio,
        )
        self.window_fixed = grids.is_fixed(deck.grid)
        self._contact: Estimate | None = None  # where the window follows from it alone
        self._contact_radius = math.inf  # estimated; of an array of gaps nothing is known
        self.lattice = self._size(deck.grid, source, lattice)
        if self.accuracy and (problems := self._refinement_problems(self.accuracy)):
            raise deck_error(problems, source)

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
        if isinstance(self._given_gap, np.ndarray):
            gap = self._given_gap
        else:
            gap = self._gap_at(lattice.x, lattice.y)
        if gap.shape != lattice.shape:
            raise DeckError(
                f"gap: expected an array of shape {lattice.shape} (n_row, n_col), not {gap.shape}"
            )
        if np.isnan(gap).any() or np.isneginf(gap).any():
            raise DeckError("gap: expected numbers, or inf where nothing can touch, at every node")
        if (abs(gap[np.isfinite(gap)]) > LARGEST).any():
            raise DeckError(f"gap: expected lengths of at most {LARGEST:g} m, or inf where nothing can touch")
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
        gap = self._given_gap
        if isinstance(gap, HeightMap) and gap.ends_within(
            lattice.spacing, lattice.x[contact], lattice.y[contact]
        ):
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
        return grids.grown(lattice) if contact is None else grids.grown(lattice, grids.rim_sides(contact))

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
        moved = np.array(grids.lattice_coordinates(*self.lattice.origin, origin))
        if self._contact is not None:
            bounds = self._contact.bounds + moved[:, None]
            other.lattice = grids.enclosing(bounds[:, 0], bounds[:, 1], spacing, grids.MARGIN, origin)
        else:
            other.lattice = grids.covering(self.lattice, spacing, origin)
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
        contact = self.contact_nodes(lattice)
        if not self.frictional:
            return native.memory_needed(method, *shape, contact=contact, threads=memory.threads())
        return native_friction.memory_needed(
            method,
            *shape,
            contact=contact,
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
        data = decks.parse_toml(self.deck_text, "deck")
        if self._given_gap is not None:
            del data["body"]["1"]["surface"]  # stands for the gap
        folder = self.deck_file.parent if self.deck_file else Path()
        case = type(self).__new__(type(self))
        lattice = self.lattice if isinstance(self._given_gap, np.ndarray) else None
        case._set_up(assemble(data, None, Source(), folder, changes), self._given_gap, lattice)
        if lattice is not None and case.deck.grid != self.deck.grid:
            changed = listed([key for key in changes if key.partition(".")[0] == "grid"], "and")
            raise DeckError(
                f"{changed}: the gap of this case is an array over the nodes of its lattice, which stays as "
                "it is; make a new Case with gap=... and lattice=..."
            )
        case.deck_file = self.deck_file
        return case

    def __eq__(self, other: object) -> bool:
        """Whether two cases are the same problem, solved and kept in the same way."""
        if not isinstance(other, Problem):
            return NotImplemented
        mine, other_gap = self._given_gap, other._given_gap
        same_gap = mine is other_gap or (
            isinstance(mine, np.ndarray)
            and isinstance(other_gap, np.ndarray)
            and np.array_equal(mine, other_gap)
        )
        return same_gap and (self.deck, self.load_steps, self.lattice) == (
            other.deck,
            other.load_steps,
            other.lattice,
        )

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

    def _refinement_problems(self, wanted: AccuracySettings) -> list[Mistake]:
        """Complain about what cannot be refined, or not far enough for errors to be told."""
        if isinstance(self._given_gap, np.ndarray):
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

    def _gap_at(self, x: Array, y: Array) -> Array:
        if self._surface_gap is not None:
            return self._surface_gap(x, y)
        assert callable(self._given_gap)
        gap = reals(self._given_gap(x, y), "gap")
        if gap.shape != np.shape(x):
            raise DeckError(f"gap: expected an array of the shape of x, {np.shape(x)}, not {gap.shape}")
        if (bad := np.isnan(gap)).any():
            where = f"x = {x[bad][0]:.4g} m, y = {y[bad][0]:.4g} m"
            raise DeckError(f"gap: expected numbers, or inf where nothing can touch; it is NaN at {where}")
        return gap

    def _size(self, grid: decks.Grid, source: Source, lattice: Lattice | None) -> Lattice:
        """Return the window, checked against an estimate of the contact wherever there is one."""
        if isinstance(self._given_gap, np.ndarray) and lattice is not None:
            self.initial_gap(lattice)
            return lattice
        gap = self._surface_gap or self._given_gap
        touch = gap.first_touch[:2] if isinstance(gap, Separation | HeightMap) else (0.0, 0.0)
        center = grid.center or touch
        try:
            estimate = self._estimate(center if self._surface_gap is None else touch, grid.origin)
        except NoContactFound as error:
            raise deck_error(
                [Mistake(("grid",), MISSING, f"no window can be found: {error}")], source
            ) from None
        self._contact_radius = estimate.radius
        if lattice is None and not (self.window_fixed or grid.nodes_across):
            self._contact = estimate
        lattice = lattice or grids.window(grid, center, estimate)
        if problems := grids.check(grid, lattice, estimate):
            raise deck_error(problems, source)
        return lattice

    def _estimate(self, center: tuple[float, float], origin: tuple[float, float]) -> Estimate:
        """Estimate the contact at the largest load of the history, by force and by approach."""
        largest = {
            name: max((s.z.value for s in self.load_steps if s.z.control == control), default=0.0)
            for name, control in (("normal_load", "force"), ("approach", "displacement"))
        }
        found = [
            grids.estimate_contact(self.pair, self._gap_at, center, origin, **{name: value})
            for name, value in largest.items()
            if value >= SMALLEST
        ]
        return found[0] if len(found) == 1 else found[0].joined(found[1])


def _body(body: decks.Body) -> Body:
    surface = None if body.surface.shape == "flat" else body.surface
    return Body(body.young_modulus, body.poisson_ratio, body.rigid, surface)
