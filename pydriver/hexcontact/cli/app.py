"""The command ``hexcontact`` and the list of the modules that hold its sub-commands.

Every sub-command imports what it needs when it runs, and a process imports only the module of the sub-command
that it is called with.
"""

from __future__ import annotations

import gc
import importlib
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..solve import interruption
from .guard import COMMANDS, Content, guarded, standard_streams, warn_plainly
from .options import plain

if TYPE_CHECKING:
    from typer import Typer

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
    warn_plainly()
    try:
        with standard_streams():
            guarded(_called)(sys.argv[1:])
            raise SystemExit(0)
    finally:
        # The process ends, and its memory with it: the interpreter need not look for garbage once more.
        gc.disable()
        gc.freeze()


def _called(words: Sequence[str]) -> Content:
    """Call the sub-command that the words of a command line name."""
    _import_commands(next((word for word in words if not word.startswith("-")), ""))
    command = COMMANDS.get(words[0]) if words else None
    given = plain(command.function, words[1:]) if command else None
    if command and given is not None:
        command.function(**given)
    else:
        _whole()()
    return None


def _import_commands(name: str = "") -> None:
    """Import the sub-commands of one module, or all if none is of that name."""
    found = [module for module, names in MODULES.items() if name in names]
    for module in found or MODULES:
        importlib.import_module(f".{module}", __package__)


def _whole() -> Typer:
    """Return the parser that knows everything about the sub-commands that are imported."""
    from .parser import parser

    return parser()


def __getattr__(name: str) -> Any:
    """Return the whole command as `app`."""
    if name == "app":
        _import_commands()
        return _whole()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
