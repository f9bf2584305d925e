"""Decks of a sphere, the environment in which tests run commands on them, and how long tests wait."""

import contextlib
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from typer.testing import CliRunner

import hexcontact
from hexcontact.cli.app import app

DECK = """
title = "A sphere"
[body.1]
young_modulus = "432 GPa"
poisson_ratio = 0.32
surface = { shape = "sphere", radius = "1 mm" }
[body.2]
young_modulus = "72 GPa"
poisson_ratio = 0.32
[friction]
coefficient = 0.2
[grid]
nodes_in_radius = 4
[[load]]
normal_load = "20 N"
steps = 2
"""
_OURS = "HEXCONTACT_DEBUG", "COLUMNS"
_PATHS = str(Path(hexcontact.__file__).parents[1]), os.environ.get("PYTHONPATH", "")
ENVIRONMENT = {
    **{key: value for key, value in os.environ.items() if key not in _OURS},
    "PYTHONPATH": os.pathsep.join(filter(None, _PATHS)),
    "OMP_NUM_THREADS": "1",
}

PATIENCE = 300.0  # seconds of a process that hangs, however busy the machine is
T = TypeVar("T")


def inside(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder, in this process: a new one takes a second to begin."""
    with contextlib.chdir(folder):
        result = CliRunner().invoke(app, words)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return subprocess.CompletedProcess(words, result.exit_code, result.stdout, result.stderr)


def wait_for(look: Callable[[], T]) -> T:
    """Return what another process makes, once it is there."""
    limit = time.monotonic() + PATIENCE
    while not (found := look()):
        assert time.monotonic() < limit, "what was waited for did not come"
        time.sleep(0.02)
    return found
