"""Calls of the core, with exceptions for its status and warnings for faults of the kernel cache."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

from ..errors import ConvergenceError, DeckError, HexcontactError, ResourceError
from . import _core, kernel_cache

_ERRORS: dict[int, type[HexcontactError]] = {
    1: DeckError,
    2: ConvergenceError,
    3: ResourceError,
    4: HexcontactError,
}


def called(procedure: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Call a procedure that ends with status and message, and return its other results."""
    *found, code, message = procedure(*arguments, **named)
    if code:
        raise _ERRORS.get(code, HexcontactError)(message.decode().strip())
    return found[0] if len(found) == 1 else found


class Handle:
    """An object of the core, which is freed with its Python object."""

    _handle: int

    def _create(self, procedure: Callable[..., int], *arguments: Any) -> None:
        kernel_cache.take_settings()
        self._handle = called(procedure, *arguments)
        weakref.finalize(self, _core.hc_f2py_normal.free_handle, self._handle)
        kernel_cache.warn_of_faults()

    def _solve(self, procedure: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return called(procedure, self._handle, *arguments)
        finally:
            kernel_cache.warn_of_faults()
