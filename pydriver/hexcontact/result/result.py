"""The result of a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, DataArray, DataFrame, Dataset, has_entries
from ..core.calls import integer, number
from ..core.lattice import Lattice
from ..deck.below import Criteria, Fatigue, Stress, cycle_of
from ..deck.faults import NOWHERE
from ..errors import DeckError, NotInResult, PathWarning, warn
from ..interior.fatigue import SLIPS, histories, parameters_below, tabulated
from ..interior.fields import region
from ..interior.files import FATIGUE, STRESS, files_of, readable_table, tables_of
from ..interior.stress import Loaded, below, bodies_of, nodal_tractions, with_places
from ..text import Table, counted, did_you_mean
from ..variables import CREEPAGES, FIELDS, SHEAR_LIMIT, VARIABLES
from .history_words import WEARING, cycles, segments, stages, worn_by_cycle
from .layout import Quantities, history_of, lattice_of, step_of
from .step import Point, PressureField, Step, TractionField, loaded, nodal, under, with_shown

if TYPE_CHECKING:
    from ..analytic.compare import Comparison


_FEW_STEPS = 4  # load steps of a cycle; fewer have none between its ends
_LISTED = "result.quantities lists what there is"
_ELSEWHERE = {
    "plot": "hexcontact.plotting draws results: hexcontact.plotting.overview(result)",
    **dict.fromkeys(
        ("save", "write", "to_netcdf"),
        'a run writes its result: case.run("name.nc"); result.dataset.to_netcdf writes the data set alone',
    ),
}
"""Advice for names that are no quantities."""


class Result:
    """A result by the names of its quantities.

    ``result.pressure``, ``result.approach`` and so on are `xarray.DataArray`; ``result.dataset`` is the
    `xarray.Dataset` of all. It is made from that, or from a function that makes it at first use, and the path
    of its file, empty if there is none.
    """

    def __init__(self, dataset: Dataset | Callable[[], Dataset], path: str = "") -> None:
        self._made, self.path = dataset, path

    @property
    def dataset(self) -> Dataset:
        """All quantities, and attributes of the run."""
        if callable(self._made):
            self._made = self._made()
        return self._made

    def __getattr__(self, name: str) -> DataArray:
        """Return a quantity."""
        if name.startswith("_") or name in ("dataset", "path"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    @overload
    def __getitem__(self, name: str) -> DataArray: ...

    @overload
    def __getitem__(self, name: slice) -> Dataset: ...

    def __getitem__(self, name: str | slice) -> DataArray | Dataset:
        """Return a quantity, also ``step``, which is a method as an attribute; a slice: those load steps.

        Slices count as those of ``list(result)``: ``result[1:3]`` has the load steps 2 and 3.
        """
        if isinstance(name, slice):
            return self.dataset.isel(step=name)
        if name in self.dataset.variables:
            return self.dataset[name]
        if not isinstance(name, str):
            raise KeyError(f"{name!r} is no name of a quantity; result.step({name!r}) returns a load step")
        what = "not in this result" if name in VARIABLES else "no quantity of a result"
        hint = did_you_mean(name, map(str, self.dataset.variables)) or f"; {_ELSEWHERE.get(name, _LISTED)}"
        raise KeyError(f"{name} is {what}{hint}")

    def __dir__(self) -> list[str]:
        """List the quantities, too."""
        return [*super().__dir__(), *map(str, self.dataset.variables)]

    def __len__(self) -> int:
        """Return the number of load steps."""
        return int(self.dataset.sizes["step"])

    def __contains__(self, name: object) -> bool:
        """Test whether there is a quantity of this name."""
        return name in self.dataset.variables

    def __iter__(self) -> Iterator[Dataset]:
        """Iterate over the load steps."""
        return (self.dataset.isel(step=place) for place in range(len(self)))

    @property
    def case_title(self) -> str:
        """Title of the case."""
        return str(self.dataset.attrs.get("title", ""))

    @property
    def deck(self) -> str:
        """The deck as text; empty for a case that was built in Python."""
        return str(self.dataset.attrs.get("deck", ""))

    @property
    def complete(self) -> bool:
        """Whether it has all planned load steps."""
        return bool(self.dataset.attrs.get("complete", True))

    @property
    def stopped(self) -> str:
        """Reason why the run ended early; empty if it did not, or was killed."""
        return str(self.dataset.attrs.get("stopped", ""))

    @property
    def shortfall(self) -> str:
        """Reason why the target accuracy was not reached; empty if it was, or the deck has none."""
        return str(self.dataset.attrs.get("accuracy_shortfall", ""))

    @property
    def lattice(self) -> Lattice:
        """The lattice window of the result."""
        return lattice_of(self.dataset)

    def step(self, number: int) -> Dataset:
        """Return a load step by its number, from 1; -1 is the last one; IndexError if there is none."""
        return step_of(self.dataset, number)

    def traction_field(self, number: int = -1, source: str | None = None) -> TractionField:
        """Return pressure and shear traction of a load step at any point: p, q_x, q_y of x and y (m).

        They go to zero like square roots at the edge of the contact, and keep to friction up to the edge of
        the stick area, both between the nodes. ``field.at_nodes()`` has the values at the nodes. DeckError if
        pressure or gap were not kept, IndexError if there is no such step.

        Parameters
        ----------
        number : int
            Number of the step, the first is 1; -1 is the last one.
        source : str, optional
            ``"edges"``, or ``"nodes"``: the solution at the nodes, joined linearly. By default the edges,
            if the gap was kept and they are sharp; ``field.source`` is the one taken. Of unknown laws of
            friction the shear traction is that of the nodes (``field.sheared``).
        """
        return self._nodal(number).traction_field(source)

    def pressure_field(self, number: int = -1) -> PressureField:
        """Return the pressure of a load step at any point; see `traction_field`."""
        return PressureField.of(self.traction_field(number, "edges"))

    @property
    def history(self) -> DataFrame:
        """Table of all quantities with one value by step."""
        return self.dataset[history_of(self.dataset)].to_dataframe()

    @property
    def segments(self) -> DataFrame:
        """Segments of the load history: label, first and last step, energy that friction dissipated (J)."""
        return self._parts(segments)

    @property
    def cycles(self) -> DataFrame:
        """Closed cycles of a load history with friction, a line each; empty if there are none.

        Columns: kind of loading ("shear", "torsion", "normal"), first and last step, energy that friction
        dissipated (J), area (J) of the loop of the load over its motion, and other loads that do work
        ("bulk stress", "normal load"): the area is not the energy then. A cycle begins where the motion turns
        back, at the end of the step before its first. Cycles of wear, which represent many, are left out.
        """
        return self._parts(cycles)

    def _parts(self, of: Callable[[list[dict[str, Any]]], list[dict[str, Any]]]) -> DataFrame:
        import pandas

        rows = of(cast(Any, self.history.to_dict("records")))
        return pandas.DataFrame(rows).set_index(next(iter(rows[0]))) if rows else pandas.DataFrame()

    # --- between the nodes ----------------------------------------------------------------------------------

    def at(self, name: str, x: ArrayLike, y: ArrayLike, step: int = -1, source: str | None = None) -> Array:
        """Return a field (SI), such as "pressure", at points of the plane x, y (m, broadcast) in a load step.

        Tractions go to the edges, others are linear on the triangles; the zone is that of the nearest node.
        Outside a window that ends tractions and slip are 0, other fields NaN. Step and source are as of
        `traction_field`. DeckError or IndexError if there is no such field in the output, or no such step.
        """
        return self._nodal(step).at(name, x, y, source)

    def profile(
        self,
        *names: str,
        start: Point,
        end: Point,
        step: int = -1,
        points: int | None = None,
        source: str | None = None,
    ) -> Dataset:
        """Return fields along a line between two points.

        Along a line a field is a polygon. By default the points are its corners, so that straight lines
        between them are exact, and eight a spacing for tractions to the edges, which are curved.

        Parameters
        ----------
        *names : str
            Names of fields, such as "pressure"; default: all of the output.
        start, end : tuple of float
            Ends of the line, m.
        step, source : int, str, optional
            As of `traction_field`; the attribute ``tractions`` is the source taken.
        points : int, optional
            Number of evenly spaced points instead.

        Returns
        -------
        xarray.Dataset
            Dimension ``distance`` (m) from the start; ``x`` and ``y`` (m) are coordinates. DeckError or
            IndexError if there is no such field or step, or the line has no length.
        """
        return self._nodal(step).profile(*names, start=start, end=end, points=points, source=source)

    def section(
        self,
        *names: str,
        angle: float = 0.0,
        through: Point | None = None,
        step: int = -1,
        points: int | None = None,
        source: str | None = None,
    ) -> Dataset:
        """Return fields along a line across the whole contact; other arguments and result as of `profile`.

        Parameters
        ----------
        angle : float
            Direction of the line from x, rad.
        through : tuple of float, optional
            A point on it (m), from which ``distance`` counts; default: the node next to the center of
            pressure, in a window that repeats that of the largest pressure; DeckError if nothing is in
            contact.
        """
        along: dict[str, Any] = {"angle": angle, "through": through, "points": points, "source": source}
        return self._nodal(step).section(*names, **along)

    def wear(
        self,
        coefficient: float,
        segment: str | Sequence[str] | None = None,
        steps: Sequence[int] | None = None,
    ) -> Dataset:
        """Return the wear of one cycle of the loads, of a run with friction and without [wear].

        `coefficient` is k of both bodies together (m2/N), the depth k p times slip whatever the law;
        `segment` or `steps` choose the cycle, as in `fatigue`. ``worn_depth``,
        ``cycle_dissipation_density`` and ``cycle_slip_amplitude`` (a quarter of the slip path) are over the
        nodes, ``wear_volume`` of all. Raises DeckError without friction, such a cycle, or its fields.

        Of rolling bodies `steps` is one load step, ``[-1]`` the last. ``worn_depth`` is that of the
        material at the node, on its way through the contact; behind it that of one pass.
        ``wear_by_distance`` (m3/m) is the volume by rolled distance, ``wear_by_distance_error`` (of similar
        bodies) its discretization error.
        """
        number(coefficient, "coefficient", "a number of at least 0", lambda found: found >= 0)
        if "dissipation_density" not in self:
            raise DeckError("nothing wears without friction: the result has no dissipation_density")
        if CREEPAGES[0] in self and steps is not None and len(steps) == 1:
            return self._worn_by_pass(coefficient, self._nodal(integer(steps[0], "steps")))
        cycle = map(self._nodal, self.cycle_steps(segment, steps))
        given = (one.chosen(*WEARING) for one in cycle)
        return worn_by_cycle(coefficient, given, self.dataset[["x", "y"]], self.lattice.cell_area)

    def _worn_by_pass(self, coefficient: float, step: Step) -> Dataset:
        """Return the wear of a pass, by the energy of Coulomb friction."""
        if not 0.0 < step.friction < math.inf or SHEAR_LIMIT in self.dataset.attrs:
            raise DeckError("wear of rolling bodies: expected one finite friction.coefficient above 0")
        if not math.isfinite(step.history["rolled_distance"]):
            raise DeckError(f"steps = [{step.number}]: expected a load step in which the bodies roll")
        by_energy = coefficient / step.friction
        spent = step.chosen("dissipation_density")["dissipation_density"]
        depth = ("row", "col"), by_energy * spent, {"units": "m"}
        found = self.dataset[["x", "y"]].assign(worn_depth=depth)
        rates = {"wear_by_distance": "slip_power", "wear_by_distance_error": "creep_power_error"}
        for name, of in rates.items():
            if of in step.history:
                found[name] = (), by_energy * step.history[of], {"units": "m2"}
        return found

    def _nodal(self, step: int) -> Step:
        """Return a load step by its nodal values; xarray reads those that are used from the file."""
        return nodal(self.step(step), self.lattice)

    # --- below the surface ----------------------------------------------------------------------------------

    def stress(
        self,
        *components: str,
        step: int | Sequence[int] = -1,
        body: int = 1,
        source: str | None = None,
        **where: Any,
    ) -> Dataset:
        """Return stresses and displacements (SI) below the surface, see docs/stress.md.

        `components` are names of `hexcontact.variables.STRESSES`; several numbers of a step give the dataset
        the dimension ``step``; `where` is one of ``points``, ``line``, ``plane`` and ``depths``, see
        `hexcontact.interior.fields`; `source` says of which tractions: ``"edges"``, corrected at the edges
        of contact and stick, or ``"nodes"``, as they are. Raises DeckError, IndexError or ResourceError.
        """
        one = not has_entries(step)
        given: Any = [step] if one else step
        numbers = [int(self.step(integer(n, "step"))["step"]) for n in given]
        if not numbers:
            raise DeckError("step: expected the number of a step, or some of them")
        several = None if one else numbers
        of = self._body(body, numbers, edges=source != "nodes")
        return with_places(below(of, where, components, several, source))

    def _body(
        self, body: int, numbers: Sequence[int], more: Sequence[str] = (), edges: bool = True
    ) -> Loaded:
        """Return a body under the tractions of some steps."""
        return under([self._nodal(number) for number in numbers], bodies_of(self.deck), body, more, edges)

    def fatigue(
        self,
        *parameters: str,
        segment: str | Sequence[str] | None = None,
        steps: Sequence[int] | None = None,
        body: int = 1,
        **given: Any,
    ) -> Dataset:
        """Return fatigue parameters (SI) over a closed cycle, see docs/fatigue.md.

        DeckError if a name, a constant or the body is wrong, the segments are no closed cycle, or fields of
        its steps were not kept; ResourceError if there is not enough memory.

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
        """
        constants = {key: given.pop(key) for key in [*given] if key in Criteria.model_fields}
        criteria = Criteria.parse({"parameters": parameters, **constants}, NOWHERE)
        numbers = self.cycle_steps(segment, steps)
        if steps is None and len(numbers) < _FEW_STEPS:
            warn(
                f"fatigue: the cycle {segment!r} has only {counted(len(numbers), 'load step')}, between "
                "which extremes and phases are lost: give its segments more steps, at least "
                f"{_FEW_STEPS} in all, or with adaptive steps a smaller solver.step_tolerance",
                PathWarning,
            )
        of = self._body(body, numbers, SLIPS if "ruiz" in parameters else ())
        found = parameters_below(of, given or Fatigue.default_region, criteria)
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
    ) -> Iterator[DataFrame]:
        """Yield the stresses of a cycle by point and load step, in MPa, as pyLife takes them, block by block.

        Arguments as of `fatigue`. The index is ``node_id, load_step``; the columns are ``x``, ``y`` and
        ``depth`` (m), and ``S11``, ``S22``, ``S33``, ``S12``, ``S23``, ``S13``.
        """
        numbers = self.cycle_steps(segment, steps)
        found = region(self.lattice, **(where or Fatigue.default_region))
        points = found.nodes.reshape(-1, 3)
        for part, history in histories(self._body(body, numbers), found):
            yield tabulated(points[part], part.start + 1, history, numbers)

    def cycle_steps(
        self, segment: str | Sequence[str] | None = None, steps: Sequence[int] | None = None
    ) -> list[int]:
        """Return the numbers of the load steps of a closed cycle, arguments as of `fatigue`.

        Raises DeckError if there are no such segments or they make no closed cycle.
        """
        if (segment is None) == (steps is None):
            raise DeckError("expected either segment or steps, which define the cycle")
        if CREEPAGES[0] in self:
            raise DeckError("the load steps of rolling bodies are no cycle: their surfaces move on")
        if segment is None:
            numbers = [int(self.step(integer(n, "steps"))["step"]) for n in steps or ()]
            if not numbers:
                raise DeckError("steps: expected the numbers of the load steps of a cycle")
            return numbers
        labels = [segment] if isinstance(segment, str) else [str(label) for label in segment]
        if not labels:
            raise DeckError("segment: expected the label of a segment, or some of them")
        try:
            first, last = cycle_of(stages(cast(Any, self.history.to_dict("records"))), labels)
        except ValueError as error:
            raise DeckError(f"segment: {error}") from None
        return list(range(first + 1, last + 2))

    def _change_over(self, numbers: Sequence[int]) -> float | None:
        """Return the largest change of a traction over a cycle in the largest pressure; None if not kept."""
        try:
            start = self._tractions(numbers[0] - 1) if numbers[0] > 1 else np.zeros(())
        except NotInResult:
            return None
        end = self._tractions(numbers[-1])
        return float(abs(end - start).max() / max(end[0].max(), np.finfo(float).tiny))

    def _tractions(self, number: int) -> Array:
        """Return pressure and shear tractions of a step at the nodes."""
        [found] = nodal_tractions([loaded(self._nodal(number), edges=False)])
        return np.asarray(found)

    # --- tables ---------------------------------------------------------------------------------------------

    @property
    def quantities(self) -> Quantities:
        """Names, units and meanings of all quantities; printed, a table."""
        return Quantities({name: v for name, v in VARIABLES.items() if name in self.dataset.variables})

    def to_dataframe(self, *names: str, step: int | None = None) -> DataFrame:
        """Return quantities (SI) as a table; ``attrs["units"]`` of it has their units.

        By default these are all with one value by step: a line is a load step, with fields a node of a load
        step, and the index is ``step``, or ``step, row, col`` with columns ``x`` and ``y``. `step` is the
        number of one, -1 the last; default: all. KeyError or IndexError if there is no such quantity, or no
        such step.
        """
        data = self.dataset if step is None else self.dataset.sel(step=[int(self.step(step)["step"])])
        chosen = [self[name].name for name in names] or list(self.history.columns)
        fields = any("row" in data[name].dims for name in chosen)
        index = ["step", "row", "col"] if fields else ["step"]
        table = data[chosen].to_dataframe(dim_order=index)
        if fields:
            table = table[["x", "y", *(name for name in chosen if name not in ("x", "y"))]]
        table.attrs["units"] = {str(n): VARIABLES[str(n)].units for n in table.columns}
        return table

    def compare(
        self, exact: Mapping[str, float] | object | None = None, step: int = -1, name: str = "given"
    ) -> Comparison:
        """Compare a load step with the closed solutions that hold for it, or with a given solution.

        Parameters
        ----------
        exact : optional
            Values (SI) by the names of quantities, or a solution of `hexcontact.analytic`. By default the
            closed solutions are found from the deck and the load history: Hertz, Sneddon and others for the
            pressure, Cattaneo, Mindlin and Deresiewicz for shear, Lubkin for torsion, Spence for dissimilar
            bodies. The table has those that hold.
        step, name : int, str
            Number of the load step, the first is 1, -1 the last one; and name of a given solution.

        Returns
        -------
        Comparison
            A table: quantity, solution, exact, computed, error. Empty, with a reason, if none is known.
            KeyError or IndexError if there is no such quantity, or no such step.
        """
        from ..analytic.compare import compare

        for quantity in exact if isinstance(exact, Mapping) else ():
            self[str(quantity)]  # else KeyError
        return compare(self.dataset, with_shown(self.step(step), self.lattice), exact, name)

    # --- display --------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the file, which some systems need before it is moved or deleted."""
        self.dataset.close()

    def __repr__(self) -> str:
        """Return a few lines about the run and its last step."""
        from . import html  # with pictures

        fields = [name for name in FIELDS if name in self.dataset]
        table = str(Table(("", ""), html.result_rows(self.dataset)))
        header = html.result_header(self.dataset, self.path)
        lines = [header, *table.splitlines(), f"fields: {', '.join(fields)}"]
        return "\n  ".join([*lines, *html.doubts(self.dataset), *([self.stopped] if self.stopped else [])])

    def _repr_html_(self) -> str:
        from . import html

        return html.result_html(self.dataset, self.path, self.quantities._repr_html_())


def as_result(result: Result | Dataset) -> Result:
    """Return a result by its dataset, or itself."""
    return result if isinstance(result, Result) else Result(result)


def at_hand(
    result: Result, kept: list[int], names: list[str] | None = None, anew: bool = False
) -> Iterator[tuple[str, Dataset]]:
    """Yield name and dataset of each table, or of those named, of the deck of a result.

    Tables of the run are read from their files; with `anew` all are computed.
    """
    run, path = result.dataset.attrs.get("run"), Path(result.path)
    files = files_of(result.deck, path) if path.name and not anew else {}
    for name, table in tables_of(result.deck).items():
        if names is None or name in names:
            found = readable_table(files[name]) if files else None
            if found is None or found.attrs.get("stress_of") != run:
                found = _of_table(result, name, table, kept)
            yield name, found


def _of_table(result: Result, name: str, table: Stress | Fatigue, kept: list[int]) -> Dataset:
    """Return the dataset of a table of the deck."""
    if isinstance(table, Fatigue):
        constants = {key: getattr(table, key) for key in Criteria.model_fields if key != "parameters"}
        given: dict[str, Any] = {key: value for key, value in constants.items() if value is not None}
        cycle = {"segment": table.segment, "steps": table.steps, "body": table.body, **table.where}
        try:
            found = result.fatigue(*table.parameters, **given, **cycle)
        except DeckError as error:
            raise DeckError(f"fatigue {name}: {error}") from error
    else:
        steps = kept[-1:] if table.steps is None else kept
        if isinstance(table.steps, tuple):
            steps = list(table.steps)
        if missing := [number for number in steps if number not in kept]:
            raise DeckError(f"stress {name}: there are no fields of step {missing[0]} (output.every)")
        chosen = {"step": steps, "body": table.body, "source": table.source}
        found = result.stress(*table.components, **chosen, **table.where)  # type: ignore[arg-type]
    attributes = result.dataset.attrs
    return found.assign_attrs(
        {key: attributes[key] for key in ("source", "hexcontact_version")},
        title=f"{attributes.get('title') or 'hexcontact'}: {name}",
        stress_of=attributes["run"],
        content=FATIGUE if isinstance(table, Fatigue) else STRESS,
    )
