"""Stress, fatigue parameters and stress histories below the surface of a result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import has_entries, integer
from ..core.edges import TractionField
from ..core.lattice import Lattice
from ..deck.below import Criteria, Fatigue, Stage, cycle_of
from ..deck.faults import NOWHERE
from ..errors import DeckError, NotInResult, PathWarning, warn
from ..variables import EDGES, INTERFACE, TRACTIONS
from .extremes import with_places
from .fatigue import SLIPS, histories, parameters_below, tabulated
from .region import region
from .stress import LOADED, Loaded, below, bodies_of, nodal_tractions

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]
    import xarray

_FEW_STEPS = 4  # load steps of a cycle below which a way there or back has nothing between its ends


class BelowSurface(ABC):
    """A result, as far as the inside of its bodies follows from it."""

    path: str

    @property
    @abstractmethod
    def dataset(self) -> xarray.Dataset:
        """All quantities."""

    @property
    @abstractmethod
    def deck(self) -> str:
        """The deck as text."""

    @property
    @abstractmethod
    def lattice(self) -> Lattice:
        """The lattice window."""

    @abstractmethod
    def step(self, number: int) -> xarray.Dataset:
        """Return a load step."""

    @abstractmethod
    def traction_field(self, number: int, source: str | None) -> TractionField:
        """Return pressure and shear traction of a load step at any point."""

    @abstractmethod
    def _fields(self, names: Sequence[str], step: int) -> dict[str, Any]:
        """Return the values at the nodes of some fields of a step."""

    @abstractmethod
    def _stages(self) -> list[Stage]:
        """Return segment, label and loads of each load step."""

    def stress(
        self,
        *components: str,
        step: int | Sequence[int] = -1,
        body: int = 1,
        source: str | None = None,
        **where: Any,
    ) -> xarray.Dataset:
        """Return stresses and displacements (SI) below the surface, see docs/stress.md.

        `components` are names of `hexcontact.variables.STRESSES`; several numbers of a step give the dataset
        the dimension ``step``; `where` is one of ``points``, ``line``, ``plane`` and ``depths``, see
        `hexcontact.interior.region`; `source` names the tractions: ``"edges"``, corrected at the edges
        of contact and stick, or ``"nodes"``, as they are. Raises DeckError, IndexError or ResourceError.
        """
        one = not has_entries(step)
        given: Any = [step] if one else step
        numbers = [int(self.step(integer(n, "step"))["step"]) for n in given]
        if not numbers:
            raise DeckError("step: expected the number of a step, or some of them")
        several = None if one else numbers
        loaded = self._body(body, numbers, edges=source != "nodes")
        return with_places(below(loaded, where, components, several, source))

    def _body(
        self, body: int, numbers: Sequence[int], more: Sequence[str] = (), edges: bool = True
    ) -> Loaded:
        """Return a body under the tractions of some steps."""
        steps = self._loaded(numbers, more, edges)
        given = self.lattice, steps, bodies_of(self.deck), body, self._friction
        return Loaded(*given, surface=lambda place: self.traction_field(numbers[place], "edges"))

    @property
    def _friction(self) -> float:
        """The coefficient of friction, 0 without."""
        attributes = self.dataset.attrs
        frictional = attributes.get("algorithm", "frictionless") != "frictionless"
        return float(attributes.get("friction_coefficient", 0.0)) if frictional else 0.0

    def fatigue(
        self,
        *parameters: str,
        segment: str | Sequence[str] | None = None,
        steps: Sequence[int] | None = None,
        body: int = 1,
        **given: Any,
    ) -> xarray.Dataset:
        """Return fatigue parameters (SI) over a closed cycle, see docs/fatigue.md.

        Parameters
        ----------
        *parameters : str
            Some of ``smith_watson_topper``, ``life``, ``findley``, ``fatemi_socie``, ``crossland``,
            ``dang_van``, ``ruiz``.
        segment : str or sequence of str
            Labels of the segments that make the cycle; the last one counts.
        steps : sequence of int
            Numbers of the load steps of the cycle instead; they are taken as they are.
        body : int
            The body, 1 or 2.
        **given
            Constants of the parameters, as in the table [[fatigue]] of a deck: ``findley_slope`` and others,
            in SI or text with a unit; and the region as of `stress`, by default the nodes of the surface.

        Raises
        ------
        DeckError
            If a name, a constant or the body is wrong, the segments are no closed cycle, or fields of its
            steps were not kept.
        ResourceError
            If there is not enough memory.
        """
        constants = {key: given.pop(key) for key in [*given] if key in Criteria.model_fields}
        criteria = Criteria.parse({"parameters": parameters, **constants}, NOWHERE)
        numbers = self.cycle_steps(segment, steps)
        if steps is None and len(numbers) < _FEW_STEPS:
            warn(
                f"fatigue: the cycle {segment!r} has only {len(numbers)} load steps, between which extremes "
                f"and phases are lost: give its segments more steps, at least {_FEW_STEPS} in all, or with "
                "adaptive steps a smaller solver.step_tolerance",
                PathWarning,
            )
        loaded = self._body(body, numbers, SLIPS if "ruiz" in parameters else ())
        found = parameters_below(loaded, given or Fatigue.default_region, criteria)
        about: dict[str, Any] = {"steps": np.array(numbers, dtype="i4")}
        if (change := self._change_over(numbers)) is not None:
            about["change_over_cycle"] = change
        return with_places(found.assign_attrs(about))

    def stress_histories(
        self,
        segment: str | Sequence[str] | None = None,
        steps: Sequence[int] | None = None,
        body: int = 1,
        **where: Any,
    ) -> Iterator[pandas.DataFrame]:
        """Yield the stresses of a cycle by point and load step, in MPa, as pyLife takes them, block by block.

        Arguments as of `fatigue`. The index is ``node_id, load_step``; the columns are ``x``, ``y`` and
        ``depth`` (m), and ``S11``, ``S22``, ``S33``, ``S12``, ``S23``, ``S13``.
        """
        numbers = self.cycle_steps(segment, steps)
        found = region(self.lattice, **(where or Fatigue.default_region))
        for part, history in histories(self._body(body, numbers), found):
            yield tabulated(found, part, history, numbers)

    def cycle_steps(
        self, segment: str | Sequence[str] | None = None, steps: Sequence[int] | None = None
    ) -> list[int]:
        """Return the numbers of the load steps of a closed cycle, arguments as of `fatigue`.

        Raises DeckError if there are no such segments or they make no closed cycle.
        """
        if (segment is None) == (steps is None):
            raise DeckError("expected either segment or steps, which define the cycle")
        if segment is None:
            numbers = [int(self.step(integer(n, "steps"))["step"]) for n in steps or ()]
            if not numbers:
                raise DeckError("steps: expected the numbers of the load steps of a cycle")
            return numbers
        labels = [segment] if isinstance(segment, str) else [str(label) for label in segment]
        if not labels:
            raise DeckError("segment: expected the label of a segment, or some of them")
        try:
            first, last = cycle_of(self._stages(), labels)
        except ValueError as error:
            raise DeckError(f"segment: {error}") from None
        return list(range(first + 1, last + 2))

    def _loaded(
        self, numbers: Sequence[int], more: Sequence[str] = (), edges: bool = False
    ) -> list[dict[str, Any]]:
        """Return tractions, bulk stress and other fields of steps; with `edges` those of `EDGES`."""
        bulk = [name for name in LOADED if name not in TRACTIONS and name in self.dataset]
        names = [name for name in (*TRACTIONS, *more) if name in self.dataset]
        return [
            self._fields(names, number)
            | {name: self.step(number)[name].item() for name in bulk}
            | (self._edges_of(number) if edges else {})
            for number in numbers
        ]

    def _edges_of(self, number: int) -> dict[str, Any]:
        """Return the fields that locate the edges; none if not kept, or without sharp edges."""
        if INTERFACE[0] in self.dataset.attrs:
            return {}
        try:
            return self._fields(EDGES, number)
        except NotInResult:
            return {}

    def _change_over(self, numbers: Sequence[int]) -> float | None:
        """Return the largest change of a traction over a cycle in the largest pressure; None if not kept."""
        try:
            start = nodal_tractions(self._loaded([numbers[0] - 1]))[0] if numbers[0] > 1 else np.zeros(())
        except NotInResult:
            return None
        [end] = nodal_tractions(self._loaded([numbers[-1]]))
        return float(abs(end - start).max() / max(end[0].max(), np.finfo(float).tiny))
