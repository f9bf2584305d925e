"""Runs a problem in a process of its own, on a given number of threads."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
OURS = HERE / "peer_hexcontact.py"


def environment(threads: int) -> dict[str, str]:
    """Return the environment of a process that uses so many threads."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    return os.environ | dict.fromkeys(names, str(threads))


def run(
    task: dict[str, Any],
    *,
    script: Path = OURS,
    python: str = sys.executable,
    threads: int = 1,
    timeout: float = 600,
) -> dict[str, Any]:
    """Return the answer of a script to a task; `failed` in it says why there is none."""
    command = [python, "-W", "ignore", str(script), json.dumps(task)]
    env = environment(threads)
    if python != sys.executable:
        env.pop("PYTHONPATH", None)
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=timeout, env=env, cwd=HERE
        )
    except subprocess.TimeoutExpired:
        return {"failed": f"not finished after {timeout:.0f} s"}
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        reason = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        return {"failed": reason}
    answer: dict[str, Any] = json.loads(lines[-1])
    return answer


def best(answers: list[dict[str, Any]], *times: str) -> dict[str, Any]:
    """Return the last answer with the shortest of each time; a failure if all failed."""
    good = [answer for answer in answers if "failed" not in answer]
    if not good:
        return answers[-1]
    return good[-1] | {name: min(answer[name] for answer in good) for name in times}
