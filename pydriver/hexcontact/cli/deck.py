"""Commands about decks: check, schema, new."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import DeckError
from ..files import beginning, replacing
from ..text import Table, did_you_mean, listed, visible
from . import frame

if TYPE_CHECKING:
    from ..problem.problem import Problem


@frame.command("hexcontact check fretting.toml --set grid.spacing='2 um'")
def check(deck: Path, settings: list[str] | None = None, as_json: bool = False) -> frame.Content:
    """Check a deck, report all its faults, and print a summary of the case."""
    from ..problem import plausibility
    from ..problem.preview import case_rows, least_and_most
    from ..solve.memory_needed import peak_memory, require_memory
    from . import printed

    case = frame.case_of(deck, settings)
    if not as_json:
        printed.console().print(Table(("", ""), case_rows(case, peak_memory), case.title or deck.stem))
    first = least_and_most(case)[0][-1] if case.accuracy else case  # the first possible result
    require_memory(first, first.lattice)
    target = frame.target_of(case, deck)
    if as_json:
        return case_content(case, target)
    for sentence in plausibility.warnings(case):
        frame.print_error(f"warning: {sentence}")
    for note in plausibility.notes(case).values():
        frame.print_error(f"note: {note}")
    printed.console().print(visible(f"{deck} is ready to run"), soft_wrap=True)
    return None


def case_content(case: Problem, output: Path) -> dict[str, Any]:
    """Return a case as the object that ``check --json`` prints."""
    from ..problem import plausibility, preview
    from ..solve.memory_needed import peak_memory

    lattice = case.lattice
    return {
        "title": case.title,
        "output": output,
        **preview.parameters_of(case),
        "method": case.method_for(lattice),
        "spacing": lattice.spacing,
        "rows": lattice.n_row,
        "columns": lattice.n_col,
        "nodes": lattice.size,
        "window_fixed": case.window_fixed,
        "load_steps": case.planned_steps or None,
        "segments": case.load_steps[-1].segment + 1,
        "surfaces": preview.surfaces_in_words(case),
        "largest_loads": preview.largest_loads(case),
        "memory": peak_memory(case, lattice),
        "operator_applications": preview.operator_applications(case),
        "seconds": preview.seconds(case),
        "expected": plausibility.expected(case),
        "limits": plausibility.limits(),
        "warnings": plausibility.warnings(case),
    }


@frame.command(
    "hexcontact schema -o deck.schema.json",
    output=frame.option("--output -o", "File to write; default: print it."),
    study=frame.option("--study", "Write the schema of study files instead."),
)
def schema(output: Path | None = None, study: bool = False) -> None:
    """Write the JSON schema of decks, with which editors complete keys and mark mistakes."""
    from ..deck.json_schema import deck_schema
    from ..study.plan import study_schema

    text = json.dumps(study_schema() if study else deck_schema(), indent=2, ensure_ascii=False) + "\n"
    if output is None or str(output) == "-":
        print(text, end="")
        return
    if (start := beginning(output, 1000)) and b'"title": "hexcontact ' not in start:
        raise DeckError(f"{output} exists and is not a hexcontact schema; choose another output")
    with replacing(output) as path:
        path.write_text(text, encoding="utf-8")
    frame.print_output(
        f'written: {output}; first line of a {"study" if study else "deck"} that uses it: "#:schema {output}"'
    )


@frame.command(
    "hexcontact new sphere",
    name=frame.argument("NAME", "Which starter deck."),
    listing=frame.option("--list", "List the starter decks."),
    output=frame.option("--output -o", "File to write; default: NAME.toml; - prints it."),
)
def new(name: str | None = None, listing: bool = False, output: Path | None = None) -> None:
    """Write a commented deck to start from."""
    from ..deck.toml import STARTERS, starter

    if listing or name is None:
        print("\n".join(STARTERS))
        if not listing:
            raise DeckError("NAME is missing; expected one of the names above")
        return
    if name not in STARTERS:
        raise DeckError(f"NAME = {name}: expected {listed(STARTERS, 'or')}{did_you_mean(name, STARTERS)}")
    if str(output) == "-":
        print(starter(name), end="")
        return
    target = output or Path(f"{name}.toml")
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(starter(name))
    except FileExistsError:
        raise DeckError(f"{target} exists already; choose another name with --output") from None
    frame.print_output(f"written: {target}; now: hexcontact run {target}")
