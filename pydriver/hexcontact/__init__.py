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
import re
from typing import Any

from . import errors as errors
from ._version import __version__ as __version__

# Threads that wait for each other keep their cores busy, by default for so long that two runs on the same
# cores take most of each other's time. OpenMP reads this when the compiled core is loaded.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", "1000")

with open(f"{__file__}i", encoding="utf-8") as _stub:  # which names the module of each
    _HOME = {
        name: module
        for module, name in re.findall(r"^from \.([a-z.]*) import (\w+) as", _stub.read(), re.MULTILINE)
        if name != "errors"
    }

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f".{_HOME[name] or name}", __name__)
    return getattr(module, name) if _HOME[name] else module


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
