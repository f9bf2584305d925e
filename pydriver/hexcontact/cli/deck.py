"""Commands about decks: check, schema, new."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import DeckError
from ..text import did_you_mean, listed, visible
from .guard import Content, command, say
from .options import AsJson, DeckFile, Settings, case_of, target_of

if TYPE_CHECKING:
    from ..problem.problem import Problem


@command("hexcontact check fretting.toml --set grid.spacing='2 um'")
def check(deck: DeckFile, settings: Settings = None, as_json: AsJson = False) -> Content:
    """Read a deck, report everything that is wrong with it, and say what would be run."""
    from ..problem.overview import case_rows
    from ..problem.refinement import least_and_most
    from ..solve.frictionless import peak_memory, require_memory
    from . import tables

    case = case_of(deck, settings)
    if not as_json:
        tables.console().print(tables.pairs(case.title or deck.stem, case_rows(case, peak_memory)))
    first = least_and_most(case)[0][-1] if case.accuracy else case  # the first that may be the result
    require_memory(first, first.lattice)
    target = target_of(case, deck)
    if as_json:
        return case_content(case, target)
    tables.console().print(visible(f"{deck} is ready to run"), soft_wrap=True)
    return None


def case_content(case: Problem, output: Path) -> dict[str, Any]:
    """Return for programs what would be run."""
    from ..problem import estimates
    from ..problem.overview import parameters_of
    from ..solve.frictionless import peak_memory

    lattice = case.lattice
    return {
        "title": case.title,
        "output": output,
        **parameters_of(case),
        "method": case.method_for(lattice),
        "spacing": lattice.spacing,
        "rows": lattice.n_row,
        "columns": lattice.n_col,
        "nodes": lattice.size,
        "window_fixed": case.window_fixed,
        "load_steps": case.planned_steps or None,
        "segments": case.load_steps[-1].segment + 1,
        "memory": peak_memory(case, lattice),
        "operator_applications": estimates.operator_applications(case),
        "seconds": estimates.seconds(case),
    }


@command("hexcontact schema -o deck.schema.json")
def schema(
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File to write; default: print it.")
    ] = None,
) -> None:
    """Write the JSON schema of decks, with which editors complete keys and mark mistakes."""
    from ..deck.schema import deck_schema

    text = json.dumps(deck_schema(), indent=2, ensure_ascii=False) + "\n"
    if output is None or str(output) == "-":
        print(text, end="")
        return
    if output.is_file() and not output.read_bytes().lstrip().startswith(b"{"):
        raise DeckError(f"{output} is there and no JSON, so it is not overwritten; choose another output")
    output.write_text(text, encoding="utf-8")
    say(f'written: {output}; first line of a deck that uses it: "#:schema {output}"')


@command("hexcontact new sphere")
def new(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Which starter deck.", show_default=False)
    ] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the starter decks.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write; default: NAME.toml; - prints it."),
    ] = None,
) -> None:
    """Write a commented deck to start from."""
    from ..deck import starters

    names = starters.names()
    if listing or name is None:
        print("\n".join(names))
        if not listing:
            raise DeckError("NAME is missing; expected one of the names above")
        return
    if name not in names:
        raise DeckError(f"NAME = {name}: expected {listed(names, 'or')}{did_you_mean(name, names)}")
    if str(output) == "-":
        print(starters.text(name), end="")
        return
    target = output or Path(f"{name}.toml")
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(starters.text(name))
    except FileExistsError:
        raise DeckError(f"{target} exists already; choose another name with --output") from None
    say(f"written: {target}; now: hexcontact run {target}")
