"""Job arrays of Slurm: a script for sbatch, each task of which runs one case."""

from __future__ import annotations

import datetime
import itertools
import os
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from ...deck.table_base import meaning, refuse_key
from ...errors import DeckError
from ...text import counted, listed
from ..backend import OptionTable, backend

_BATCH_OPTION = re.compile(r"[a-z][a-z0-9_-]*")
_CASES = "cases_per_task"
_EXPORTS = ("ALL", "NIL", "NONE")
_MOST_TASKS = 1000  # Slurm refuses indices from MaxArraySize on, which is 1001 by default


def _text(value: str) -> str | None:
    """Return a value of an option of sbatch, quoted where needed; None if it cannot be written."""
    if not value or not value.isprintable() or '"' in value or "\\" in value:
        return None
    return f'"{value}"' if re.search(r"[\s'#]", value) else value


class BatchOptions(OptionTable):
    """Options of sbatch, each a line of the script."""

    def _parse(self, value: object) -> dict[str, Any]:
        options = super()._parse(value)
        for key, entry in options.items():
            if key == _CASES:
                if type(entry) is not int or entry < 1:
                    refuse_key(key, entry, "expected a whole number of at least 1")
                continue
            if not _BATCH_OPTION.fullmatch(str(key)) or key == "array":
                refuse_key(str(key), entry, "expected an option of sbatch other than array, such as time")
            if isinstance(entry, str) and _text(entry) is None:
                refuse_key(key, entry, 'expected text on one line, without " and \\')
            if key == "export" and entry not in _EXPORTS:  # values of variables, such as LD_PRELOAD
                refuse_key(key, entry, f"expected {listed(_EXPORTS, 'or')}")
            if not isinstance(entry, str | int | float | datetime.time):
                refuse_key(key, entry, "expected text, a number, or true or false")
        return options


@backend(
    "slurm",
    Annotated[dict[str, Any], BatchOptions('{ time = "1:00:00" }')],
    meaning({}, "options of sbatch for --slurm, such as time and cpus-per-task; cases_per_task"),
)
class JobArray:
    """A job array that users submit; settings: options of sbatch, and the number of cases of a task."""

    def __init__(self, settings: dict[str, Any], cases: int) -> None:
        self.options, self.cases = dict(settings), cases
        self.in_a_task = self.options.pop(_CASES, None)

    def script(self, numbers: Sequence[int], path: Path, output: Path, retry: bool) -> str:
        """Return the script that runs some cases; `retry` includes those that would fail again."""
        if not numbers:
            return "#!/bin/sh\n# no case is missing"
        files = [str(path.resolve()), os.path.abspath(output)]
        for name in files:
            if _text(name) is None:
                raise DeckError(f'{name}: a script needs a name on one line, without " and \\')
        options: dict[str, Any] = {
            "job-name": output.stem,
            "output": str(output.with_suffix("")).replace("%", "%%") + "/slurm-%A_%a.log",
            "signal": "B:USR1@60",  # a minute before the time limit, to the command that replaces the shell
        }
        options |= {key.replace("_", "-"): value for key, value in self.options.items()}
        in_a_task = self.in_a_task or -(-len(numbers) // _MOST_TASKS)
        tasks = [_ranges(numbers[start : start + in_a_task]) for start in range(0, len(numbers), in_a_task)]
        if len(tasks) > _MOST_TASKS:
            least = -(-len(numbers) // _MOST_TASKS)
            most = f"an array of Slurm has at most {_MOST_TASKS} tasks"
            raise DeckError(f"slurm.{_CASES} = {in_a_task}: expected at least {least}, since {most}")
        array, case = _ranges(numbers), "$SLURM_ARRAY_TASK_ID"
        chosen: list[str] = []
        if in_a_task > 1 or numbers[-1] > _MOST_TASKS:
            array, case = f"1-{len(tasks)}", "$1"
            chosen = [f"set -- {' '.join(tasks)}", "shift $((SLURM_ARRAY_TASK_ID - 1))"]
        several = f", {in_a_task} a task" if in_a_task > 1 else ""
        words = ["hexcontact", "study", files[0], "--output", files[1], *(["--retry"] if retry else [])]
        lines = [
            "#!/bin/sh",
            f"# {len(numbers)} of {counted(self.cases, 'case')}{several}. "
            f"Afterwards: {shlex.join(words)} --collect",
            f"#SBATCH --array={array}",
            *(
                f"#SBATCH --{key}" + ("" if value is True else f"={_text(str(value))}")
                for key, value in options.items()
                if value is not False
            ),
            "export OMP_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}",
            *chosen,
            f"exec {shlex.join(words)} --case {case}",
        ]
        return "\n".join(lines)


def _ranges(numbers: Sequence[int]) -> str:
    """Return numbers in the notation of Slurm: 1-4,7."""
    steps = itertools.groupby(enumerate(numbers), lambda pair: pair[1] - pair[0])  # one for each run
    runs = [[number for _, number in run] for _, run in steps]
    return ",".join(f"{run[0]}-{run[-1]}" if run[1:] else str(run[0]) for run in runs)
