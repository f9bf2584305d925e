"""What is wrong with a case as a whole, where no table of its deck can tell alone."""

from __future__ import annotations

from typing import Any

from ..deck.faults import MISSING, Mistake, deck_error
from ..deck.read import Assembled
from ..deck.surfaces import Separation, principal_curvatures
from ..deck.tables import Deck, Friction, Output, Solver
from ..errors import DeckError
from ..variables import FIELDS, FRICTIONLESS_FIELDS
from .loads import LoadStep, load_steps


def checked(given: Assembled, gap_given: bool) -> tuple[Deck, Solver, tuple[LoadStep, ...]]:
    """Check a deck, table by table and as a whole.

    Parameters
    ----------
    given : Assembled
        The deck as dictionaries, and what is known to be wrong with it.
    gap_given : bool
        Whether the gap is given instead of the surfaces.

    Returns
    -------
    deck : Deck
        The deck.
    solver : Solver
        Its solver, with the algorithm that follows from it.
    load_steps : tuple of LoadStep
        Its history.

    Raises
    ------
    DeckError
        With everything that is wrong. Checks that need several tables are made wherever these are right.
    """
    found = list(given.problems)
    tables, of_tables = Deck.checked(given.data)
    blamed = {problem.key for problem in found}
    found += [problem for problem in of_tables if problem.key not in blamed]
    for problem in given.problems:
        tables.pop(str(problem.key[0]), None)
    solver: Any = tables.get("solver")
    steps: tuple[LoadStep, ...] = ()
    if {"friction", "solver"} <= tables.keys():
        friction = tables["friction"]
        algorithm, against = _algorithm(friction, solver)
        solver = solver.model_copy(update={"algorithm": algorithm})
        found += against
        if "load" in tables:
            mu = None if algorithm == "frictionless" else friction.coefficient if friction else 0.0
            steps, against = load_steps(tables["load"], mu)
            found += against
        if "output" in tables:
            found += _field_problems(tables["output"], algorithm)
    if "body" in tables:
        bodies = tables["body"]
        if not gap_given:
            found += _touching_problems(bodies.separation)
        elif bodies.body_1.surface or bodies.body_2.surface:
            sentence = "expected either a gap or surfaces of the bodies, not both"
            found.append(Mistake(("gap",), MISSING, sentence))
    if found:
        raise deck_error(found, given.source)
    return Deck.model_construct(**tables), solver, steps


def _algorithm(friction: Friction | None, solver: Solver) -> tuple[str, list[Mistake]]:
    """Return the algorithm of a deck, and its conflicts with the friction."""
    mu = friction.coefficient if friction else None
    algorithm = solver.algorithm or ("incremental" if mu else "frictionless")
    problems = []
    if algorithm == "frictionless" and mu:
        sentence = 'expected 0, since solver.algorithm = "frictionless"'
        problems.append(Mistake(("friction", "coefficient"), mu, sentence))
    if algorithm != "frictionless" and mu is None:
        sentence = (
            f'missing; expected a number of at least 0 (or inf), since solver.algorithm = "{algorithm}"'
        )
        problems.append(Mistake(("friction", "coefficient"), MISSING, sentence))
    return algorithm, problems


def _field_problems(output: Output, algorithm: str) -> list[Mistake]:
    """Complain about fields that a frictionless run does not yield."""
    known = FRICTIONLESS_FIELDS if algorithm == "frictionless" else FIELDS
    missing = [name for name in output.fields or () if name not in known]
    if not missing:
        return []
    sentence = f"a frictionless run has no {', '.join(missing)}; it has {', '.join(known)}"
    return [Mistake(("output", "fields"), output.fields, sentence)]


def _touching_problems(gap: Separation) -> list[Mistake]:
    """Complain about surfaces that never touch, or that touch along a line or all over, without end."""
    try:
        gap.first_touch  # noqa: B018 (computed here, cached)
    except DeckError as error:
        return [Mistake(("body", "2", "surface"), MISSING, str(error))]
    one, two = gap.surface_1.curvature, gap.surface_2.curvature
    if one is None or two is None:
        return []
    smaller, larger, _ = principal_curvatures(one + two)
    if smaller > 1e-12 * larger:
        return []
    where = "everywhere" if larger == 0 else "along a line"
    sentence = f"the two surfaces touch {where}, so the contact has no end; expected a shape that bounds it"
    return [Mistake(("body", "2" if gap.surface_1.shape == "flat" else "1", "surface"), MISSING, sentence)]
