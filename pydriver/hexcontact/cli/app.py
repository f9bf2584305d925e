"""The command ``hexcontact`` and the list of the modules that hold its sub-commands.

Every sub-command imports its modules when it runs, and a process imports only the module of the sub-command
that it is called with.
"""

from __future__ import annotations

import gc
import importlib
import os
import sys
from typing import Any

from ..solve import interruption
from . import frame

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
    # By default waiting threads spin, which on a busy machine takes cores from working threads; those of
    # OpenBLAS for 2^26 cycles after it was loaded, though a run with transforms gives them nothing to do.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "20")
    # Plugins of pydantic watch the models of other programs; looking for them reads every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    # Most objects of a short process are functions and classes of modules, which stay: with Python's own
    # threshold of 700 a sixth of the time of `check` goes into looking for garbage among them.
    gc.set_threshold(100_000)
    interruption.ends_process = True
    frame.warn_plainly()
    try:
        with frame.standard_streams():
            frame.guarded(_called)()
    finally:
        # The process ends, and its memory with it: the interpreter need not look for garbage once more.
        gc.disable()
        gc.freeze()


def _called() -> None:
    """Call the sub-command that the words of the command line name."""
    command = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
    if command != "study":
        # xarray would import Dask, if it is installed, which takes as long as the rest of `info`.
        sys.modules.setdefault("dask", None)  # type: ignore[arg-type]
    _import_commands(command)
    frame.app()


def _import_commands(name: str = "") -> None:
    """Import the sub-commands of one module, or all if none is of that name."""
    found = [module for module, names in MODULES.items() if name in names]
    for module in found or MODULES:
        importlib.import_module(f".{module}", __package__)


def __getattr__(name: str) -> Any:
    """Return the whole command as `app`."""
    if name == "app":
        _import_commands()
        return frame.app
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
