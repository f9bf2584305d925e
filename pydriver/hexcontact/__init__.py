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
    from . import analytic, influence, kernel_cache, plotting, surfaces
    from .case import Case
    from .lattice import Lattice
    from .native import ElasticPair, FlexibilityOperator, NormalContact
    from .native_friction import ContactState, FrictionalContact
    from .restart import resume
    from .result import Result
    from .session import Session
    from .step import Step
    from .store import open_result
    from .study import Study, run_study

_HOME = {
    "Case": "case",
    "ContactState": "native_friction",
    "ElasticPair": "native",
    "FlexibilityOperator": "native",
    "FrictionalContact": "native_friction",
    "Lattice": "lattice",
    "NormalContact": "native",
    "Result": "result",
    "Session": "session",
    "Step": "step",
    "Study": "study",
    "open_result": "store",
    "resume": "restart",
    "run_study": "study",
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
