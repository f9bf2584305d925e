"""A contact problem with its solution in one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import ArrayLike

from .arrays import Array
from .core.lattice import Lattice
from .deck.keys import FINENESS, Grid, Solver
from .deck.read import Assembled, assemble
from .deck.series import MEANS
from .deck.toml import plain, refuse_deep, with_overrides
from .deck.units import angle_text
from .errors import DeckError, PlausibilityWarning, warn
from .problem import plausibility
from .problem.arguments import Body, known_keywords, middle_of, refuse_unknown, with_radians
from .problem.loads import LoadStep, Target
from .problem.plane_field import GAP, FieldSource, given_coefficient, given_field
from .problem.problem import Problem

if TYPE_CHECKING:
    from .result.result import Result
    from .result.step import Step
    from .solve.events import Listener
    from .solve.session import Session

__all__ = ["Body", "Case", "LoadStep", "Target"]

_LOADS = ("normal_load", "approach", *MEANS, "steps")
_ARGUMENTS = {  # of a case, with their keys in a deck
    "title": "title",
    "body_1": "body.1",
    "body_2": "body.2",
    "interface": "interface",
    "friction_coefficient": "friction.coefficient",
    "shear_limit": "friction.shear_limit",
    "bulk": "bulk",
    **{key: f"grid.{key}" for key in Grid.model_fields},
    **{key: f"solver.{key}" for key in Solver.model_fields},
    "accuracy": "accuracy",
    "wear": "wear",
    **dict.fromkeys(("loads", *_LOADS), "load"),
    "fields": "output.fields",
    "every": "output.every",
}
_LEFT_OUT = ("friction", "interface", "solver", "wear", "output")  # tables, if they are empty


class Case(Problem):
    """A checked contact problem.

    Made from a deck by `from_toml` or `from_dict`, or here from arguments in SI units; checks and messages
    are those of the keys of a deck.

    Parameters
    ----------
    body_1, body_2 : Body or mapping
        The bodies; a mapping has the keys of [body.1] (an angle carries its unit here, too: "30 deg").
    gap : callable or array_like, optional
        Initial gap (m) instead of the surfaces of the bodies: a function of two arrays x, y (m); an array
        (n_row, n_col) over the nodes of `lattice`; or heights on a rectangular grid, an xarray.DataArray
        with the coordinates x and y (in m, or in their attribute ``units``), which a cubic spline joins, near
        steps without overshoot. Infinite where the bodies cannot touch; NaN in holes of the data, near which
        a contact is an error. The approach counts from gap = 0.
    lattice : Lattice or str, optional
        The window, instead of the keyword arguments of the grid; or the key of [grid].
    spacing, nodes_across, nodes_in_radius, extent, window, center, origin : optional
        Keys of [grid].
    cell_ratio, cell_angle, direction, boundary : optional
        Keys of [grid]; an angle in rad, or with its unit: "90 deg".
    normal_load, approach : float, optional
        The only load (N) or motion (m), in one step or in `steps`.
    mean_pressure, mean_gap, mean_traction_x, mean_traction_y : optional
        The same in a window that repeats (Pa, m).
    steps : int or "auto", optional
        Number of equal increments of it; "auto": chosen by `step_tolerance`.
    loads : sequence of mappings, or mapping, optional
        Entries of [[load]] instead; twist in rad.
    interface : mapping, optional
        Keys of [interface]: a compliant layer between the bodies.
    friction_coefficient : float, optional
        Coefficient of friction; frictionless if absent. Two with a direction: ``{"along": 0.3, "across": 0.2,
        "angle": "30 deg"}``. One that varies: a formula of x and y (m) as text, a function of two arrays x, y
        (m), an array (n_row, n_col) over the nodes of `lattice`, or values on a rectangular grid, an
        xarray.DataArray with the coordinates x and y, between which it is bilinear.
    shear_limit : float, optional
        Bound of the shear traction (Pa).
    bulk : mapping, optional
        Keys of [bulk]: which body carries the bulk stress of the loads.
    algorithm, method, iteration, tolerance, coupling, entry, step_tolerance : optional
        Keys of [solver].
    accuracy : float or mapping, optional
        Target of [accuracy], or all its keys: the lattice is refined until it is reached.
    wear : mapping, optional
        Keys of [wear]: cycles that wear the surfaces.
    fields, every : optional
        Keys of [output].
    title : str, optional
        A line about the case.

    The attributes are those of `Problem`.

    Raises
    ------
    DeckError
        With a sentence for each fault.
    TypeError
        If there is no such argument; it names the nearest.

    Examples
    --------
    >>> from hexcontact import Case
    >>> from hexcontact.surfaces import Sphere
    >>> steel = {"young_modulus": 210e9, "poisson_ratio": 0.3}
    >>> case = Case(
    ...     body_1={**steel, "surface": Sphere(radius=10e-3)},
    ...     body_2=steel,
    ...     nodes_in_radius=20,
    ...     normal_load=100.0,
    ... )
    >>> round(case.pair.effective_modulus / 1e9, 2)
    115.38
    """

    @known_keywords
    def __init__(
        self,
        *,
        body_1: Body | Mapping[str, Any],
        body_2: Body | Mapping[str, Any],
        gap: Callable[[Array, Array], ArrayLike] | ArrayLike | None = None,
        lattice: Lattice | str | None = None,
        spacing: float | str | Sequence[float | str] | None = None,
        nodes_across: int | None = None,
        nodes_in_radius: float | None = None,
        extent: str | Sequence[float | str] | None = None,
        window: Sequence[int] | None = None,
        center: Sequence[float | str] | None = None,
        origin: Sequence[float | str] | None = None,
        cell_ratio: float | None = None,
        cell_angle: float | str | None = None,
        boundary: str | None = None,
        direction: float | str | None = None,
        normal_load: float | str | None = None,
        approach: float | str | None = None,
        mean_pressure: float | str | None = None,
        mean_gap: float | str | None = None,
        mean_traction_x: float | str | None = None,
        mean_traction_y: float | str | None = None,
        steps: int | str | None = None,
        interface: Mapping[str, Any] | None = None,
        loads: Sequence[Mapping[str, Any]] | Mapping[str, Any] | None = None,
        friction_coefficient: (
            float | str | Mapping[str, Any] | ArrayLike | Callable[[Array, Array], ArrayLike] | None
        ) = None,
        shear_limit: float | str | None = None,
        bulk: Mapping[str, Any] | None = None,
        algorithm: str | None = None,
        method: str | None = None,
        iteration: str | None = None,
        tolerance: float | None = None,
        coupling: str | None = None,
        entry: str | None = None,
        step_tolerance: float | None = None,
        accuracy: float | Mapping[str, Any] | None = None,
        wear: Mapping[str, Any] | None = None,
        fields: Sequence[str] | None = None,
        every: int | None = None,
        title: str = "",
    ) -> None:
        words = lattice if isinstance(lattice, str) else None
        lattice = None if isinstance(lattice, str) else lattice
        own_gap = None if gap is None else given_field(gap, GAP, lattice)
        if lattice is not None:
            given = {"spacing": spacing, "window": window, "origin": origin, "cell_ratio": cell_ratio}
            given |= {"cell_angle": cell_angle, "boundary": boundary, "direction": direction}
            for key, value in given.items():
                if value is not None:
                    raise DeckError(f"{key}: expected a lattice, or keys of the grid, not both")
            spacing, window, origin = lattice.spacing, lattice.shape, lattice.origin
            cell_ratio, cell_angle = lattice.cell_ratio, angle_text(lattice.cell_angle)
            boundary = "periodic" if lattice.periodic else None
            direction = angle_text(lattice.direction) if lattice.direction else None
            if not callable(own_gap):  # the deck of the case leads to the same window
                center = middle_of(lattice)
        arguments = locals() | {"lattice": words}
        data = with_overrides({}, _deck_keys({name: arguments[name] for name in _ARGUMENTS}, lattice))
        data = {key: value for key, value in data.items() if value or key not in _LEFT_OUT}
        self._set_up(assemble(data), own_gap, lattice)

    def changed(self, changes: Mapping[str, Any] | None = None, **arguments: Any) -> Self:
        """Return the same case with other values for some keys of its deck, or some arguments of `Case`.

        DeckError with a sentence for each fault; TypeError if there is no such argument, with the nearest.

        Parameters
        ----------
        changes : mapping, optional
            New values by dotted key, with units or in SI: ``{"friction.coefficient": 0.2,
            "load.2.steps": 20}``. Entries of arrays count from 1; None removes a key. The window is computed
            again, also if a `Lattice` was given; that of a gap over its nodes cannot change.
        **arguments
            New values of arguments of `Case`, such as ``spacing="5 um"``, which replaces ``nodes_in_radius``,
            or ``normal_load=20.0``, which replaces all loads.
        """
        refuse_unknown(arguments, _ARGUMENTS, "Case.changed")
        if arguments.keys() & FINENESS:
            arguments = dict.fromkeys(FINENESS) | arguments
        return super().changed({**(changes or {}), **_deck_keys(arguments, None)})

    def _set_up(self, given: Assembled, gap: FieldSource | None, lattice: Lattice | None) -> None:
        super()._set_up(given, gap, lattice)
        self._warned: set[str] = set()
        self._warn(plausibility.warnings(self, estimated=False))

    def _warn(self, sentences: Sequence[str]) -> None:
        """Raise those of some warnings that were not raised before."""
        for sentence in sentences:
            if sentence not in self._warned:
                self._warned.add(sentence)
                warn(sentence, PlausibilityWarning)

    @property
    def warnings(self) -> list[str]:
        """Sentences on limits of theory, lattice and load steps that the case exceeds, those of `check`.

        Each is raised once as a `PlausibilityWarning`: when the case is built if it takes no estimate of the
        contact, else here or by `run` or `start`.
        """
        found = plausibility.warnings(self)
        self._warn(found)
        return found

    def run(
        self,
        output: str | Path | None = None,
        overwrite: bool = False,
        on_step: Callable[[Step], object] | None = None,
        progress: Listener | bool | None = None,
    ) -> Result:
        """Solve the case.

        Parameters
        ----------
        output : path, optional
            netCDF file to write; each step is on the disk before the next begins. Without it the result is in
            memory only, also if the deck names one.
        overwrite : bool
            Replace an output that exists.
        on_step : callable, optional
            Called with each finished `Step`, after it was written; with a target accuracy, of every lattice.
            If it returns a true value, or raises `hexcontact.StopRun`, the run ends there; any other
            exception ends it, too, and is raised.
        progress : Listener or bool, optional
            True: a bar on a terminal, lines otherwise.

        Returns
        -------
        Result
            All load steps, or those up to where `on_step` ended the run. With an output, the run can be
            resumed from there (`hexcontact.resume`).

        Warns
        -----
        PlausibilityWarning
            For each of `warnings` that was not raised before.
        AccuracyWarning, PathWarning
            If an accuracy that the case asks for was not reached; or a static load step, or one that begins
            without contact, was solved in parts.

        Raises
        ------
        DeckError, ConvergenceError, ResourceError
            If the output cannot be written, or the contact outgrows a fixed window; a load step misses its
            tolerance (with an output, the steps before it are recorded); memory or disk do not suffice.
        """
        from .solve.run import run

        self._warn(plausibility.warnings(self))
        return run(self, output=output, overwrite=overwrite, on_step=on_step, progress=progress)

    def start(self, output: str | Path | None = None, overwrite: bool = False) -> Session:
        """Begin a run that waits between its load steps, for loads that depend on results.

        Output as of `run`. Iterate over the session for the loads of the case, or apply others with
        `Session.advance`.
        """
        from .solve.session import Session

        self._warn(plausibility.warnings(self))
        return Session(self, output, overwrite)

    def __repr__(self) -> str:
        """Name the case, its window and its steps, and show its warnings."""
        return "\n  ".join([super().__repr__(), *self._notes])

    @property
    def _notes(self) -> list[str]:
        """Marked warnings and notes."""
        marked = [f"warning: {sentence}" for sentence in plausibility.warnings(self)]
        return [*marked, *(f"note: {note}" for note in plausibility.notes(self).values())]

    def _repr_html_(self) -> str:
        from .problem.preview import case_rows
        from .solve.memory_needed import peak_memory
        from .text import Table

        rows, note = case_rows(self, peak_memory), "; ".join(self._notes)
        return Table(("", ""), rows, self.title or "Case", note)._repr_html_()


def _deck_keys(arguments: Mapping[str, Any], lattice: Lattice | None) -> dict[str, Any]:
    """Return arguments of a case by the dotted keys of its deck."""
    single = {name: arguments[name] for name in _LOADS if arguments.get(name) is not None}
    loads, accuracy = arguments.get("loads"), arguments.get("accuracy")
    if single and loads is not None:
        raise DeckError("loads: expected either loads, or one load or motion with steps, not both")
    found = {_ARGUMENTS[name]: value for name, value in arguments.items()}
    if "load" in found:
        loads = single if loads is None else loads
        found["load"] = [loads] if isinstance(loads, Mapping) else loads
    refuse_deep(found, "")
    if found.get("title") == "":
        found["title"] = None
    if "friction_coefficient" in arguments:
        found["friction.coefficient"] = given_coefficient(arguments["friction_coefficient"], lattice)
    if isinstance(accuracy, int | float):
        found["accuracy"] = {"target": accuracy}
    found = {key: plain(value) for key, value in found.items()}
    return dict(with_radians(found))
