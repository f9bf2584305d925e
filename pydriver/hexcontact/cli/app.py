"""The command ``hexcontact`` and the list of the modules that hold its sub-commands.

Every sub-command imports what it needs when it runs, so that ``hexcontact --help`` is fast.
"""

from __future__ import annotations

import importlib
import os
from typing import Annotated

import typer

from .._version import __version__
from ..solve import interruption
from .guard import app, standard_streams, warn_plainly

for _name in ("run", "deck", "study", "show", "plot", "verify"):  # in the order of the help
    importlib.import_module(f".{_name}", __package__)


def main() -> None:
    """Entry point of the command."""
    # By default waiting threads spin, which on a busy machine takes cores from working threads.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    interruption.ends_process = True
    warn_plainly()
    with standard_streams():
        app()


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hexcontact {__version__}")
        raise typer.Exit()


@app.callback(epilog="Example: hexcontact new sphere, then hexcontact run sphere.toml --plot")
def _hexcontact(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Elastic contact in 3-D from a deck in TOML: pressure, shear traction, stick and slip, approach, shift.

    Exit codes: 0 done, 2 wrong input, 3 no convergence or accuracy, 4 memory or disk; 130, 138, 143 stopped.
    """
