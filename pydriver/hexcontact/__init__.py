"""Semi-analytical solver for the three-dimensional contact of elastic half-spaces.

The names below are imported when they are first used, so that ``import hexcontact`` costs nothing.

Examples
--------
>>> import hexcontact
>>> result = hexcontact.Case.from_toml("hertz_spheres.toml").run()  # doctest: +SKIP
>>> result.max_pressure.values  # doctest: +SKIP
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

from ._version import __version__ as __version__
from .errors import (
    AccuracyWarning,
    ConvergenceError,
    DeckError,
    HexcontactError,
    KernelFolderWarning,
    PathWarning,
    ResourceError,
    StopRun,
)

# Threads that wait for each other keep their cores busy, by default for so long that two runs on the same
# cores take most of each other's time. OpenMP reads this when the compiled core is loaded.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", "1000")

if TYPE_CHECKING:
    from . import analytic, plotting
    from .case import Case
    from .core import influence, kernel_cache
    from .core.contact import ElasticPair, FlexibilityOperator, NormalContact
    from .core.friction import ContactState, FrictionalContact
    from .core.lattice import Lattice
    from .deck import surfaces
    from .result.result import Result
    from .result.step import Step
    from .result.store import open_result
    from .solve.restart import resume
    from .solve.session import Session
    from .study.study import Study, run_study

_HOME = {
    "Case": "case",
    "ContactState": "core.friction",
    "ElasticPair": "core.contact",
    "FlexibilityOperator": "core.contact",
    "FrictionalContact": "core.friction",
    "Lattice": "core.lattice",
    "NormalContact": "core.contact",
    "Result": "result.result",
    "Session": "solve.session",
    "Step": "result.step",
    "Study": "study.study",
    "open_result": "result.store",
    "resume": "solve.restart",
    "run_study": "study.study",
}
_MODULES = ("analytic", "influence", "kernel_cache", "plotting", "surfaces")

__all__ = [
    "AccuracyWarning",
    "Case",
    "ContactState",
    "ConvergenceError",
    "DeckError",
    "ElasticPair",
    "FlexibilityOperator",
    "FrictionalContact",
    "HexcontactError",
    "KernelFolderWarning",
    "Lattice",
    "NormalContact",
    "PathWarning",
    "ResourceError",
    "Result",
    "Session",
    "Step",
    "StopRun",
    "Study",
    "analytic",
    "influence",
    "kernel_cache",
    "open_result",
    "plotting",
    "resume",
    "run_study",
    "surfaces",
]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return importlib.import_module(f".{name}", __name__)
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
