"""The object on standard output with ``--json``, also after failures; see docs/running.md."""

from __future__ import annotations

import contextlib
import json
import math
import os
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
_SIGNAL = 128  # plus the number of a signal


def write(command: str, content: Mapping[str, Any]) -> None:
    """Print the object of a command: its name, its exit code and its content, see `jsonable`."""
    whole = {"hexcontact": __version__, "command": command, "exit_code": 0, **content}
    print(visible(json.dumps(jsonable(whole), ensure_ascii=False, allow_nan=False)), flush=True)


def jsonable(value: Any) -> Any:
    """Return a value for JSON: null for NaN; text for infinity, paths and objects of other types."""
    if isinstance(value, Mapping):
        return {str(key): jsonable(entry) for key, entry in value.items()}
    if isinstance(value, str | bool | int | None):
        return value
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # of numpy
        return jsonable(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None if math.isnan(value) else str(value)
    if isinstance(value, Sequence):
        return [jsonable(entry) for entry in value]
    return str(value)


def seen_from_here(message: str) -> str:
    """Return a message with the files of the current folder named without it."""
    with contextlib.suppress(OSError):  # the folder was deleted
        return message.replace(os.path.join(os.getcwd(), ""), "")
    return message


def error(
    message: str, exit_code: int, faults: Sequence[Fault] = (), details: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the object of a failure, with the faults of a deck and further entries."""
    kind = "interrupted" if exit_code > _SIGNAL else _KINDS.get(exit_code, "other")
    found = {
        "kind": kind,
        "message": seen_from_here(message),
        "exit_code": exit_code,
        "faults": [{name: part or None for name, part in fault._asdict().items()} for fault in faults],
        **(details or {}),
    }
    return {"exit_code": exit_code, "error": found}
