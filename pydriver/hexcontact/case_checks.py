"""What is wrong with a case as a whole, where no table of its deck can tell alone."""

from __future__ import annotations

from .deck import Deck
from .errors import DeckError
from .messages import MISSING, Problem
from .surfaces import Separation, principal_curvatures
from .variables import FIELDS

FRICTIONLESS_FIELDS = (
    "pressure",
    "gap",
    "zone",
    *(name for name in FIELDS if name.startswith("displacement_")),
)


def algorithm_of(deck: Deck) -> tuple[str, list[Problem]]:
    """Return the algorithm that a deck asks for, and what stands against it."""
    mu = deck.friction.coefficient if deck.friction else None
    algorithm = deck.solver.algorithm or ("incremental" if mu else "frictionless")
    problems = []
    if algorithm == "frictionless" and mu:
        sentence = 'expected 0, since solver.algorithm = "frictionless"'
        problems.append(Problem(("friction", "coefficient"), mu, sentence))
    if algorithm != "frictionless" and mu is None:
        sentence = (
            f'missing; expected a number of at least 0 (or inf), since solver.algorithm = "{algorithm}"'
        )
        problems.append(Problem(("friction", "coefficient"), MISSING, sentence))
    return algorithm, problems


def field_problems(deck: Deck, algorithm: str) -> list[Problem]:
    """Complain about fields that a frictionless run does not yield."""
    known = FRICTIONLESS_FIELDS if algorithm == "frictionless" else FIELDS
    missing = [name for name in deck.output.fields or () if name not in known]
    if not missing:
        return []
    sentence = f"a frictionless run has no {', '.join(missing)}; it has {', '.join(known)}"
    return [Problem(("output", "fields"), deck.output.fields, sentence)]


def touching_problems(gap: Separation) -> list[Problem]:
    """Complain about surfaces that never touch, or that touch along a line or all over, without end."""
    try:
        gap.first_touch  # noqa: B018 (worked out here, kept for later)
    except DeckError as error:
        return [Problem(("body", "2", "surface"), MISSING, str(error))]
    one, two = gap.surface_1.curvature, gap.surface_2.curvature
    if one is None or two is None:
        return []
    smaller, larger, _ = principal_curvatures(one + two)
    if smaller > 1e-12 * larger:
        return []
    where = "everywhere" if larger == 0 else "along a line"
    sentence = f"the two surfaces touch {where}, so the contact has no end; expected a shape that bounds it"
    return [Problem(("body", "2" if gap.surface_1.shape == "flat" else "1", "surface"), MISSING, sentence)]
