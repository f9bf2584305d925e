"""One object on standard output with ``--json``, whatever happens; docs/running.md."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .._version import __version__
from ..errors import ConvergenceError, DeckError, Fault, ResourceError
from ..text import visible

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
        The rest of the object; `plain` makes JSON of it.
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
    """Return the object of a failure.

    Parameters
    ----------
    message : str
        What standard error says.
    exit_code : int
        Exit code of the command.
    faults : sequence of Fault
        The parts of a deck that are wrong.
    details : mapping, optional
        Further entries.
    """
    kind = "interrupted" if exit_code > _SIGNAL else _KINDS.get(exit_code, "other")
    found = {
        "kind": kind,
        "message": message,
        "exit_code": exit_code,
        "faults": [{name: part or None for name, part in fault._asdict().items()} for fault in faults],
        **(details or {}),
    }
    return {"exit_code": exit_code, "error": found}
