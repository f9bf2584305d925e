"""The command ``hexcontact`` and the list of the modules that hold its sub-commands.

Every sub-command imports what it needs when it runs, and a process imports only the module of the sub-command
that it is called with.
"""

from __future__ import annotations

import gc
import importlib
import os
import sys
from typing import Annotated, Any

import typer

from .._version import __version__
from ..solve import interruption
from .guard import app as _app
from .guard import standard_streams, warn_plainly

MODULES = {
    "run": ("run", "resume"),
    "deck": ("check", "schema", "new"),
    "study": ("study",),
    "show": ("info", "report", "export"),
    "plot": ("plot",),
    "verify": ("verify",),
}
"""Modules of sub-commands, with their names, in the order of the help."""


def main() -> None:
    """Entry point of the command."""
    # By default waiting threads spin, which on a busy machine takes cores from working threads.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    # Plugins of pydantic watch the models of other programs; looking for them reads every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    # Most objects of a short process are functions and classes of modules, which stay: with Python's own
    # threshold of 700 a sixth of the time of `check` goes into looking for garbage among them.
    gc.set_threshold(20_000)
    interruption.ends_process = True
    warn_plainly()
    with standard_streams():
        _with_commands(next((word for word in sys.argv[1:] if not word.startswith("-")), ""))()


def _with_commands(name: str = "") -> typer.Typer:
    """Return the command with the sub-commands of one module, or with all if none is of that name."""
    found = [module for module, names in MODULES.items() if name in names]
    for module in found or MODULES:
        importlib.import_module(f".{module}", __package__)
    return _app


def __getattr__(name: str) -> Any:
    """Return the whole command as `app`."""
    if name == "app":
        return _with_commands()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hexcontact {__version__}")
        raise typer.Exit()


@_app.callback(epilog="Example: hexcontact new sphere, then hexcontact run sphere.toml --plot")
def _hexcontact(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Elastic contact in 3-D from a deck in TOML: pressure, shear traction, stick and slip, approach, shift.

    Exit codes: 0 done, 2 wrong input, 3 no convergence or accuracy, 4 memory or disk; 130, 138, 143 stopped.
    """
