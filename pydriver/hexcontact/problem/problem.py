"""A checked contact problem in SI units, which the solvers read."""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from ..arrays import Array, Mask
from ..core import contact, flat, friction, memory
from ..core.contact import ElasticPair, Method, pair_of
from ..core.friction import FrictionLaw
from ..core.lattice import Lattice, Pattern
from ..deck import toml
from ..deck.faults import MISSING, Mistake, Source, deck_error
from ..deck.interface import FROM_PYTHON, coulomb
from ..deck.keys import BULK_STATES, Accuracy, Grid
from ..deck.kinds import SMALLEST
from ..deck.read import Assembled, assemble
from ..deck.toml import as_toml, plain
from ..errors import DeckError
from ..text import counted, listed
from ..variables import LOADS
from . import checks, window
from .arguments import Body
from .checks import checked, mistakes
from .loads import LoadStep, cycle_entries, load_steps, rolled_out
from .plane_field import GAP, FieldSource, FrictionField, PlaneField
from .window import Estimate, Found, NoContactFound, Surroundings, missed_contact, surroundings

# Largest window that LAPACK solves with "auto"; beyond, and with friction, transforms are faster.
MOST_DIRECT_NODES = 200
RATIO = math.sqrt(2.0)  # of the spacings of a lattice and the next finer one of a refinement
LEAST_LEVELS = 3  # lattices of a refinement
_MOST_CHECKED_NODES = 10_000_000  # nodes of a window for which friction is computed before a run
_SMALLEST_BETA = 1e-6  # below, pressure and shear do not couple
_BESIDE_COATING = 5.0  # thicknesses from a load, within which a soft coating counts
_NO_ELASTICITY = 1e-9  # share of the compliance of the interface that bodies have in a full contact


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
        Coefficient of friction; NaN if it varies, or the shear traction has a bound.
    solver : Solver
        Table [solver], with the algorithm.
    accuracy : Accuracy or None
        Target accuracy; None: the lattice is not refined.
    load_steps : sequence of LoadStep
        The history; a segment in adaptive steps is one of them.
    output : Output
        Table [output].
    deck : Deck
        The deck, checked and in SI.
    deck_file : Path or None
        Its file.
    lattice : Lattice
        The first window.
    window_fixed : bool
        Whether the size of the window is given: contact at its rim is an error; otherwise the window grows.
    """

    deck_file: Path | None = None
    _stiffest = 0.0  # decimal logarithm of the stiffness of the interface over that of the bodies
    _around: tuple[Lattice, Surroundings] | None = None  # of the last window
    trial = False  # whether it is one of several lattices of a refinement
    judged: dict[bool, list[str]]  # its warnings, without and with an estimate of the contact, once found

    @classmethod
    def from_toml(cls, path: str | Path, overrides: Mapping[str, Any] | None = None) -> Self:
        """Read a deck; DeckError if it cannot be read, or with a sentence for each fault.

        `overrides` are values for single keys in place of the deck's: ``{"grid.spacing": "0.1 mm",
        "load.1.steps": 5}``. Entries of arrays count from 1; None removes a key.
        """
        data, text = toml.read_toml(path)
        if not data.keys().isdisjoint(("deck", "parameter")) and "body" not in data:
            raise DeckError(f"{path} is a study and no deck; hexcontact study {path} runs its cases")
        source = Source(str(path), text)
        case = cls._made(assemble(data, text, source, Path(path).parent, overrides))
        case.deck_file = Path(path).absolute()
        return case

    @classmethod
    def from_text(cls, text: str, name: str = "deck", overrides: Mapping[str, Any] | None = None) -> Self:
        """Read a deck from its text, as in a result; `name` stands for it in messages."""
        data = toml.parse_toml(text, name)
        return cls._made(assemble(data, text, Source(name, text), Path(), overrides))

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Create a case from the tables of a deck: ``{"body": {"1": {...}, ...}, "grid": {...}, ...}``."""
        if not isinstance(data, Mapping):
            raise DeckError("a deck: expected tables of keys")
        toml.refuse_deep(data, "")
        return cls._made(assemble(plain(data)))

    @classmethod
    def _made(cls, given: Assembled, gap: FieldSource | None = None, lattice: Lattice | None = None) -> Self:
        case = cls.__new__(cls)
        case._set_up(given, gap, lattice)
        return case

    def _set_up(self, given: Assembled, gap: FieldSource | None, lattice: Lattice | None) -> None:
        self._given, self.judged = given, {}
        self.deck, self.solver, self.load_steps, repeating = checked(given, gap, lattice)
        self.period = repeating and repeating.period  # None: the window does not repeat
        deck = self.deck
        self.title, self.accuracy, self.output = deck.title, deck.accuracy, deck.output
        bodies = deck.body.body_1, deck.body.body_2
        self.body_1, self.body_2 = (Body.model_construct(**dict(body)) for body in bodies)
        self.friction_coefficient = coulomb(deck.friction, deck.interface) or 0.0
        # the law of friction, and the gap before loading, at any point
        self.plane_friction = FrictionField(deck.friction, deck.interface)
        self.interface = deck.interface.normal_law if deck.interface else contact.UNILATERAL
        self.surfaces = repeating.surfaces if repeating else deck.body.separation
        self.plane_gap = PlaneField(self.surfaces if gap is None else gap, GAP)
        # gaps that were measured; whether the gap was given in Python
        self.maps, self.gap_given = self.plane_gap.maps, self.plane_gap.given
        self.shapes, self.rollers = self.plane_gap.shapes, self.plane_gap.rollers
        self.moves = self.surfaces.moves  # whether surfaces move with the rolling bodies
        self.frictional = self.solver.algorithm != "frictionless"  # shear tractions are unknowns
        try:
            self.pair = pair_of(self.body_1, self.body_2)
        except DeckError as error:  # coatings that images do not describe
            number = "1" if self.body_1.coating else "2"
            wrong = Mistake(("body", number, "coating"), MISSING, str(error))
            raise deck_error([wrong], given.source) from error
        # whether pressure and shear are coupled
        self.coupled = self.solver.coupling == "full" and abs(self.pair.beta) > _SMALLEST_BETA
        between_flats = bool(deck.interface) and not self.gap_given and self.surfaces.flat
        self.full_contact = between_flats and not deck.grid.periodic
        self.window_fixed = window.is_fixed(deck.grid)
        self._contact: Estimate | None = None  # if the window follows from it alone
        self.estimate: Estimate | None = None  # None for an array of gaps
        self.lattice = repeating.lattice if repeating else self._size(deck.grid, lattice)
        if self.rolls:
            if fault := checks.rolling_fault(deck.load, lambda direction: self.row_along(direction)[1]):
                raise deck_error([fault], given.source)
            self.load_steps = rolled_out(self.load_steps, self.row_along)
        if self.plane_friction.varies and self.lattice.size <= _MOST_CHECKED_NODES:
            self.friction_law(self.lattice)
        if self.accuracy:
            self._refuse(self._refinement_problems(self.accuracy))

    def _refuse(self, found: Found) -> None:
        """Raise an error with a sentence for each mistake that a check found."""
        if problems := [*mistakes(dict(self.deck), found)]:
            raise deck_error(problems, self._given.source)

    @property
    def rolls(self) -> bool:
        """Whether the bodies roll: from the first step that does on, all do."""
        return bool(self.load_steps) and self.load_steps[-1].roll is not None

    def row_along(self, direction: float) -> tuple[tuple[int, int], float]:
        """Return columns and rows to the node ahead along a row of the lattice, and its distance (m)."""
        col, row = friction.row_ahead(self.lattice, direction)
        return (col, row), float(np.linalg.norm([col, row] @ self.lattice.basis))

    @cached_property
    def deck_tables(self) -> dict[str, Any]:
        """The tables of `deck_text`."""
        if self._given.text:
            return self._given.data
        data = plain(self._given.data)
        if self.plane_gap.given:
            # this shape is refused in a deck
            data["body"]["1"]["surface"] = {"shape": FROM_PYTHON}
        if self.plane_friction.varies:
            data["friction"]["coefficient"] = self.plane_friction.in_deck
        for number, body in (("1", self.body_1), ("2", self.body_2)):
            if body.surface and body.surface.measured:
                data["body"][number]["surface"] = body.surface.written(defaults=False)
        return dict(data)

    @cached_property
    def deck_text(self) -> str:
        """The whole deck of the case, with included files, overrides, and series of loads from files."""
        return self._given.text or self._given.remark + as_toml(self.deck_tables)

    def bulk(self, stress: tuple[float, float, float]) -> tuple[Array, Array]:
        """Return the whole bulk stress xx, yy, xy (Pa), and its strain, of body 1 less that of body 2."""
        if (bulk := self.deck.bulk) is None:
            return np.zeros(3), np.zeros(3)
        body = self.body_1 if bulk.body == 1 else self.body_2
        assert body.young_modulus is not None
        assert body.poisson_ratio is not None  # checked: the body is elastic
        state = BULK_STATES.index(bulk.state)
        whole, strain = flat.bulk_strain(body.young_modulus, body.poisson_ratio, stress, state)
        return whole, strain if bulk.body == 1 else -strain

    @property
    def adaptive(self) -> bool:
        """Whether load steps are chosen during the solution: some are "auto", and have a history."""
        return self.solver.algorithm == "incremental" and any(s.ramp is not None for s in self.load_steps)

    @property
    def planned_steps(self) -> int:
        """Number of load steps; 0 if it is open."""
        return 0 if self.adaptive or self.deck.wear else len(self.load_steps)

    @cached_property
    def cycle(self) -> tuple[LoadStep, ...]:
        """The load steps of the cycle that wears the surfaces, after the load history."""
        if (wear := self.deck.wear) is None:
            return ()
        loads, given = self.deck.load, (self.friction_coefficient, self.deck.bulk, self.period)
        steps, _ = load_steps([*loads, *cycle_entries(loads, wear.cycle)], *given)
        return steps[len(load_steps(loads, *given)[0]) :]

    @property
    def solved_pair(self) -> ElasticPair:
        """Compliances of the bodies; in a full contact a billionth of that of the interface at the most.

        Half-spaces that carry the same tractions everywhere move as a whole; the rest keeps the operators
        regular.
        """
        pair = self.pair
        if not self.full_contact:
            return pair
        share = _NO_ELASTICITY / max(1.0, 10.0**self._stiffest)
        return ElasticPair(share * pair.lambda_1, 0.0, share * pair.lambda_5)

    # --- data of the solvers --------------------------------------------------------------------------------

    def initial_gap(self, lattice: Lattice, step: LoadStep | None = None) -> tuple[Array, Mask]:
        """Return the gap before loading over the nodes of a window, and where the bodies can touch.

        The gap (m) counts from first touch, and is inf where nothing can touch, as outside a punch; it is
        that of a load step if surfaces move. DeckError if a gap given in Python does not fit the window or is
        NaN somewhere.
        """
        gap = self.gap_in(step).over(lattice)
        touching = np.isfinite(gap)
        return gap, np.broadcast_to(True, gap.shape) if touching.all() else touching

    def gap_in(self, step: LoadStep | None) -> PlaneField:
        """Return the gap of a load step: docs/theory/rolling.md, (K8)."""
        if step is None or step.roll is None or not self.moves:
            return self.plane_gap
        return PlaneField(self.surfaces.moved(-np.array(step.roll.way) @ self.lattice.basis), GAP)

    def friction_law(self, lattice: Lattice) -> FrictionLaw:
        """Return the law of friction at the nodes of a window.

        DeckError if a coefficient is negative or NaN somewhere, or a map ends within the window.
        """
        return self.plane_friction.over(lattice)

    def check_contact(self, step: Any) -> None:
        """Refuse a load step whose contact reaches the end of a height map, or a hole in it."""
        gap = self.gap_in(self.load_steps[step.index] if self.moves else None)
        for rows, zone in step.bands("zone") if gap.maps and self.period is None else ():
            x, y = rows.x[zone > 0], rows.y[zone > 0]
            for one in gap.maps:
                if fault := one.fault_near(rows.spacing, x, y):
                    raise DeckError(f"{one.name}: the contact of load step {step.number} {fault}")

    def check_beyond(self, step: Any) -> None:
        """Refuse a load step whose bodies also touch outside of a window that follows from the contact."""
        simple = not self.gap_given and self.surfaces.convex
        if simple or self._contact is None or self.moves:
            return
        if self._around is None or self._around[0] != step.lattice:
            self._around = step.lattice, surroundings(self.plane_gap, step.lattice)
        if fault := missed_contact(self._around[1], step, *self._moduli):
            raise DeckError(f"grid.extent: load step {step.number}: {fault}")

    @property
    def _moduli(self) -> tuple[tuple[float, float], float]:
        """Moduli E* (Pa) near to a load and far from it, and the distance (m) from which the latter holds."""
        bodies = self.body_1, self.body_2
        compliance = sum(body.compliance for body in bodies)
        near, far = self.pair.effective_modulus, 1.0 / compliance if compliance else math.inf
        thickness = sum(layer.thickness for body in bodies for layer in body.coating)
        return (min(near, far), far), _BESIDE_COATING * thickness

    def holes_near(self, contact: Estimate) -> int:
        """Return the number of holes of height maps within the bounds of an estimated contact."""
        holes = [one.in_plane(*one.map.holes) for one in self.maps]
        if not holes:
            return 0
        at = window.pattern_of(self.deck.grid).coordinates(*np.concatenate(holes, axis=1))
        inside = [(low <= c) & (c <= high) for c, (low, high) in zip(at, contact.bounds, strict=True)]
        return int(np.count_nonzero(inside[0] & inside[1]))

    def refined(self, level: int, moved: tuple[float, float] = (0.0, 0.0)) -> Problem:
        """Return the problem on a lattice refined `level` times, its origin moved by parts of a spacing."""
        finer = RATIO**level
        x, y = np.array(self.lattice.origin) + np.array(moved) @ self.lattice.basis / finer
        return self.on_lattice(self.lattice.spacing / finer, (float(x), float(y)))

    def on_lattice(self, spacing: float, origin: tuple[float, float]) -> Self:
        """Return the same problem on a lattice of another spacing (m) and origin (m), without refinement."""
        other = copy.copy(self)
        other.accuracy, other.trial, other.judged = None, True, {}
        pattern = self.lattice.pattern._replace(origin=origin)
        moved = np.array(pattern.coordinates(*self.lattice.origin))
        if self._contact is not None:
            lower, upper = (self._contact.bounds + moved[:, None]).T
            other.lattice = pattern.enclosing(lower, upper, spacing, window.MARGIN)
        else:
            other.lattice = window.covering(self.lattice, spacing, pattern)
        return other

    def method_for(self, lattice: Lattice) -> Method:
        """Return the method for a window, "direct" or "fft", also for "auto"."""
        small = lattice.size <= MOST_DIRECT_NODES and not (self.frictional or lattice.periodic)
        return "direct" if self.solver.method in ("direct", "auto" if small else "direct") else "fft"

    def contact_nodes(self, lattice: Lattice) -> int:
        """Return the estimated number of nodes in contact at the largest load; all without an estimate."""
        if self.plane_gap.at_nodes and self.method_for(lattice) == "direct":
            gap, law = self.plane_gap.over(lattice), contact.UNILATERAL
            pressures = [
                contact.rough_pressure(lattice, self.pair, gap, law, **d) for d in self.largest_drives
            ]
            return max([1, *(int((pressure > 0).sum()) for pressure in pressures)])
        radius = math.inf if self.estimate is None else self.estimate.radius
        return math.ceil(min(math.pi * radius**2 / lattice.cell_area, lattice.size))

    def memory_needed(self, lattice: Lattice) -> int:
        """Return the memory (bytes) of the solver on a window, for the estimated contact."""
        return contact.memory_needed(
            self.method_for(lattice),
            *lattice.shape,
            contact=self.contact_nodes(lattice),
            part="problem with friction" if self.frictional else "problem",
            loads=max(sum(t.control == "force" for t in step.targets) for step in self.load_steps),
            coupled=self.coupled,
            spectra=self.pair.spectra,
            threads=memory.threads(),
            periodic=lattice.periodic,
        )

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """Return the same case with other values for some dotted keys of its deck; None removes one."""
        folder = self.deck_file.parent if self.deck_file else Path()
        lattice = self.lattice if self.plane_gap.at_nodes else None
        given = assemble(plain(self._given.data), folder=folder, overrides=changes)
        case = self._made(given, self.plane_gap.source if self.plane_gap.given else None, lattice)
        if lattice is not None and case.deck.grid != self.deck.grid:
            changed = listed([key for key in changes if key.partition(".")[0] == "grid"], "and")
            raise DeckError(
                f"{changed}: the gap of this case is an array over the nodes of its lattice, which stays as "
                "it is; make a new Case with gap=... and lattice=..."
            )
        case.deck_file = self.deck_file
        return case

    def __eq__(self, other: object) -> bool:
        """Test whether two cases are the same problem, with the same solver and output."""
        if not isinstance(other, Problem):
            return NotImplemented
        mine, others = ((one.plane_gap, one.deck, one.load_steps, one.lattice) for one in (self, other))
        return mine == others

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Name the case, its window and its steps."""
        rows, cols = self.lattice.shape
        title = f"{self.title!r}, " if self.title else ""
        what = "adaptive segment" if self.adaptive else "load step"
        return (
            f"{type(self).__name__}({title}{self.solver.algorithm}, {rows} x {cols} nodes, "
            f"{counted(len(self.load_steps), what)})"
        )

    # --- the window -----------------------------------------------------------------------------------------

    def _refinement_problems(self, wanted: Accuracy) -> Found:
        """Yield the obstacles to a refinement of three lattices, which error estimates need."""
        if self.plane_gap.at_nodes:
            sentence = "needs a gap that is known everywhere: surfaces or a function, not an array over nodes"
            yield ("accuracy", "target"), sentence
        elif self.adaptive:
            sentence = 'expected steps as numbers with it, not "auto": all lattices need the same load steps'
            yield ("accuracy", "target"), sentence
        elif (third := self.refined(LEAST_LEVELS - 1).lattice.size) > wanted.max_nodes:
            least = f"expected at least {third}, the nodes of the third lattice"
            yield ("accuracy", "max_nodes"), f"{least}, or a coarser grid to begin with"

    def _size(self, grid: Grid, lattice: Lattice | None) -> Lattice:
        """Return the window, checked against an estimate of the contact if there is one."""
        if self.plane_gap.at_nodes and lattice is not None:
            self.initial_gap(lattice)
            self._check_interface(lattice)
            return lattice
        if lattice is None and not grid.center and (self.gap_given or self.surfaces.one_map):
            for one in self.maps:
                if one.touch_fault:
                    raise DeckError(f"{one.name}: {one.touch_fault}")
        touch = self.plane_gap.first_touch or (0.0, 0.0)
        center = grid.center or touch
        self._center = center if self.plane_gap.given else touch
        if self.full_contact:
            assert grid.length is not None  # checked, as the window is
            assert grid.window is not None
            lattice = window.pattern_of(grid).centered(grid.length, center, grid.window)
            self._check_interface(lattice)
            return lattice
        try:
            self._check_interface()
            self._estimates = {one: self.estimated(**d) for d in self.largest_drives for one in d.items()}
        except NoContactFound as error:
            soft = ", or the interface is too soft" if self.deck.interface else ""
            sentence = f"no window can be found: {error}{soft}"
            key: tuple[str, ...] = ("grid",)
            if not (self.plane_gap.given or grid.center):
                shapes = [one.shape for one in self.surfaces.surfaces]
                at = int(shapes[0] == "flat")
                key = ("body", "12"[at], "surface", *("expression",) * (shapes[at] == "formula"))
                sentence = f"{error}{soft}; expected a shape of finite heights that bounds the contact"
                if any(part.wave for part in self.shapes):
                    sentence += ', or a window that repeats, grid.boundary = "periodic"'
            raise deck_error([Mistake(key, MISSING, sentence)], self._given.source) from None
        # by force, and by approach
        estimate = functools.reduce(Estimate.joined, self._estimates.values())
        if grid.fits and lattice is None:
            # once more, on cells as slender as the contact: the bounds of the window are in their coordinates
            pattern = estimate.fitted(window.pattern_of(grid), grid.direction)
            again = (self.estimated(pattern, **d) for d in self.largest_drives)
            bounds = functools.reduce(Estimate.joined, again)
            estimate = estimate._replace(lower=bounds.lower, upper=bounds.upper, cell=bounds.cell)
        self.estimate = estimate
        if lattice is None and not (self.window_fixed or grid.nodes_across):
            self._contact = estimate
        lattice = lattice or window.window(grid, center, estimate)
        self._refuse(window.check(grid, lattice, estimate, () if self.gap_given else self.maps))
        return lattice

    def _check_interface(self, lattice: Lattice | None = None) -> None:
        """Refuse an interface far softer than the bodies; the contact is as large as the window, if given."""
        for drive in self.largest_drives if self.deck.interface else ():
            if lattice is None:
                size = window.starting_half_size(self.pair, self.plane_gap.at, self._center, **drive)
            else:
                size = math.sqrt(lattice.size * lattice.cell_area)
            ratios, problems = window.check_interface(
                self.interface, self.pair, size, self.full_contact, **drive
            )
            self._refuse(iter(problems))
            self._stiffest = max(self._stiffest, *ratios)

    def estimated(self, pattern: Pattern | None = None, /, **drive: Any) -> Estimate:
        """Estimate the contact under a normal load (N) or at an approach (m)."""
        gap, place = self.plane_gap, (self._center, pattern or window.pattern_of(self.deck.grid))
        share = gap.share if self.rollers else None
        return window.estimate_contact(self.pair, gap.at, *place, self.interface, gap.heights, share, **drive)

    @cached_property
    def growth(self) -> float:
        """Exponent of the contact radius over load or approach, near the largest one; 0 if it is unknown."""
        ((name, value), *_) = self.largest_drives[0].items()
        try:
            large = self._estimates.get((name, value)) or self.estimated(**{name: value})
            small = self.estimated(**{name: value / 8})
        except NoContactFound:
            return 0.0
        return math.log(large.radius / small.radius) / math.log(8.0)

    @property
    def largest_drives(self) -> list[dict[str, float]]:
        """The largest prescribed normal load (N) and approach (m) of the history."""
        largest = {
            name: max((s.z.value for s in self.load_steps if s.z.control == control), default=0.0)
            for name, control in zip(LOADS["z"], ("force", "displacement"), strict=True)
        }
        return [{name: value} for name, value in largest.items() if value >= SMALLEST]
