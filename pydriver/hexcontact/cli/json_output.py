"""What commands print with ``--json``: one object on standard output, whatever happens; docs/running.md."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._version import __version__
from ..errors import ConvergenceError, DeckError, Fault, ResourceError
from ..result.history import RESIDUALS, remarks
from ..text import visible

if TYPE_CHECKING:
    from ..problem.problem import Problem
    from ..result.result import Result
    from ..study.study import Study
    from .verify import Check, Comparison

_KINDS = {
    DeckError.exit_code: "input",
    ConvergenceError.exit_code: "convergence",
    ResourceError.exit_code: "resources",
}
_SIGNAL = 128  # exit codes above are those of signals


def write(command: str, content: Mapping[str, Any]) -> None:
    """Print the object of a command.

    Parameters
    ----------
    command : str
        Its name.
    content : mapping
        What it has to say; `plain` makes JSON of it.
    """
    whole = {"hexcontact": __version__, "command": command, "exit_code": 0, **content}
    print(visible(json.dumps(plain(whole), ensure_ascii=False, allow_nan=False)), flush=True)


def plain(value: Any) -> Any:
    """Return a value as JSON has it: null for NaN, text for infinity, paths and whatever else there is."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, str | bool | int | None):
        return value
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # of numpy
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None if math.isnan(value) else str(value)
    if isinstance(value, Sequence):
        return [plain(entry) for entry in value]
    return str(value)


def error(
    message: str, exit_code: int, faults: Sequence[Fault] = (), details: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return what is said of a failure.

    Parameters
    ----------
    message : str
        What standard error says.
    exit_code : int
        With which the command ends.
    faults : sequence of Fault
        The parts of a deck that are wrong.
    details : mapping, optional
        What else is known.
    """
    kind = "interrupted" if exit_code > _SIGNAL else _KINDS.get(exit_code, "other")
    told = {
        "kind": kind,
        "message": message,
        "exit_code": exit_code,
        "faults": [{name: part or None for name, part in fault._asdict().items()} for fault in faults],
        **(details or {}),
    }
    return {"exit_code": exit_code, "error": told}


# --- what commands have to say ----------------------------------------------------------------------------


def of_case(case: Problem, output: Path) -> dict[str, Any]:
    """Return what would be run."""
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


def of_steps(histories: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the histories of load steps, each with its number."""
    return [{"step": number, **history} for number, history in enumerate(histories, start=1)]


def of_run(case: Problem | None, title: str, histories: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what came out of a run that is complete; without a case nothing about Hertz."""
    from .tables import against_hertz

    return {
        "title": title,
        "complete": True,
        "load_steps": len(histories),
        "seconds": math.fsum(history["seconds"] for history in histories),
        "operator_applications": math.fsum(history["operator_applications"] for history in histories),
        "largest_residual": _largest_residual(histories),
        "hertz": {
            name: {"exact": exact, "computed": value}
            for name, exact, value, _ in (against_hertz(case, histories[-1]) if case else ())
        },
        "steps": of_steps(histories),
    }


def _largest_residual(histories: Sequence[Mapping[str, Any]]) -> float:
    found = (history.get(name, math.nan) for history in histories for name in RESIDUALS.values())
    return max((value for value in found if not math.isnan(value)), default=math.nan)


def of_result(result: Result) -> dict[str, Any]:
    """Return what a result holds: its attributes, but for the deck and the lattice basis, and its history."""
    attributes = dict(result.dataset.attrs)
    attributes["complete"] = result.complete
    sizes = result.dataset.sizes
    fields = [str(name) for name, v in result.dataset.data_vars.items() if v.dims == ("step", "row", "col")]
    histories = histories_of(result)
    return {
        "file": result.path,
        **attributes,
        "rows": sizes["row"],
        "columns": sizes["col"],
        "fields": fields,
        "warnings": remarks(histories, attributes),
        "steps": of_steps(histories),
    }


def histories_of(result: Result) -> list[dict[str, Any]]:
    """Return the histories of the load steps of a result."""
    return [{str(name): value for name, value in row.items()} for row in result.history.to_dict("records")]


def of_study(study: Study) -> dict[str, Any]:
    """Return how far a study is, and what failed."""
    done = sum(study.folder.done(case) for case in study.cases)
    failures = study.failures()
    return {
        "title": study.title,
        "output": study.output,
        "folder": study.folder.folder,
        "cases": len(study),
        "done": done,
        "missing": len(study) - done - len(failures),
        "failed": [
            {
                "case": study.folder.number(case),
                "parameters": case.settings,
                "exit_code": outcome.exit_code,
                "message": outcome.message,
            }
            for case, outcome in failures
        ],
    }


def of_comparison(check: Check, comparison: Comparison) -> dict[str, Any]:
    """Return a comparison of ``hexcontact verify``: values in SI, relative differences unless absolute."""
    return {
        "name": check.name,
        "title": check.title,
        "passed": comparison.passed,
        "rows": [
            {
                "case": row.case,
                "quantity": row.quantity,
                "computed": row.computed,
                "published": row.published,
                "reference": row.reference,
                "analytic": row.analytic,
                "judge": row.judge,
                "difference": row.difference,
                "tolerance": row.tolerance,
                "absolute": row.absolute,
                "passed": row.passed,
            }
            for row in comparison.rows
        ],
        "notes": comparison.notes,
    }
