"""Tables [[stress]] and [[fatigue]] of the deck of a result."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ..deck.below import Criteria, Fatigue, Stress
from ..errors import DeckError
from ..interior.files import FATIGUE, STRESS, files_of, readable_table, tables_of
from .result import Result

if TYPE_CHECKING:
    import xarray


def computed(
    result: Result, kept: list[int], names: list[str] | None = None
) -> Iterator[tuple[str, xarray.Dataset]]:
    """Yield name and dataset of each table, or of those named, of the deck of a result."""
    for name, table in tables_of(result.deck).items():
        if names is None or name in names:
            yield name, of_table(result, name, table, kept)


def at_hand(
    result: Result, kept: list[int], names: list[str] | None = None
) -> Iterator[tuple[str, xarray.Dataset]]:
    """Yield the tables as `computed`; those that the run has written are read from their files."""
    run, path = result.dataset.attrs.get("run"), Path(result.path)
    files = files_of(result.deck, path) if path.name else {}
    for name, table in tables_of(result.deck).items():
        if names is not None and name not in names:
            continue
        found = readable_table(files[name]) if files else None
        if found is None or found.attrs.get("stress_of") != run:
            found = of_table(result, name, table, kept)
        yield name, found


def of_table(
    result: Result, name: str, table: Stress | Fatigue, kept: list[int] | None = None
) -> xarray.Dataset:
    """Return the dataset of a table of the deck; arguments and errors as of `computed`."""
    if isinstance(table, Fatigue):
        try:
            found = of_cycle(result, table)
        except DeckError as error:
            raise DeckError(f"fatigue {name}: {error}") from error
    else:
        kept = kept or []
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


def of_cycle(result: Result, table: Fatigue) -> xarray.Dataset:
    """Return the fatigue parameters that a table wants."""
    constants = {key: getattr(table, key) for key in Criteria.model_fields if key != "parameters"}
    given = {key: value for key, value in constants.items() if value is not None}
    cycle = {"segment": table.segment, "steps": table.steps}
    return result.fatigue(*table.parameters, **cycle, body=table.body, **given, **table.where)  # type: ignore[arg-type]
