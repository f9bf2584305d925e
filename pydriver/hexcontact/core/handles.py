"""Objects of the core, which are freed with their Python objects, and states of contacts."""

from __future__ import annotations

import ctypes
import math
import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import DeckError, ResourceError
from ..variables import CORE
from . import _core, kernel_cache
from .calls import called

SLIP = ("slip_increment_x", "slip_increment_y")
"""Fields of a step with friction, from which the next one does not start."""


class Handle:
    """An object of the core, which is freed with its Python object."""

    _handle: int

    def _create(self, procedure: Callable[..., int], *arguments: Any) -> None:
        kernel_cache.take_settings()
        self._handle = called(procedure, *arguments)
        weakref.finalize(self, _core.hc_f2py_normal.free_handle, self._handle)
        kernel_cache.warn_of_faults()

    def _solve(self, procedure: Callable[..., Any], *arguments: Any, held: Any = None) -> Any:
        """Call a solver; `held` makes an object of its first result, a handle, before any warning."""
        try:
            first, *others = called(procedure, self._handle, *arguments)
            return [held(first) if held else first, *others]
        finally:
            kernel_cache.warn_of_faults()


class HeldState:
    """A state in the memory of the core, which is freed with the last array that is a view of it."""

    def __init__(self, handle: int, shape: tuple[int, int]) -> None:
        self.handle, self._shape = handle, shape
        self._places = dict(
            zip(CORE["fields"], _core.hc_f2py_states.state_places(handle).tolist(), strict=True)
        )
        if not self._places["pressure"]:
            raise DeckError("the handle is stale: its state has been freed")
        self._recorded: tuple[Any, ...] = ()
        # at the end of the process arrays may still be in use
        weakref.finalize(self, _core.hc_f2py_states.free_state, handle).atexit = False

    @classmethod
    def copied(cls, shape: tuple[int, int], fields: Sequence[Array], numbers: Sequence[float]) -> HeldState:
        """Return a copy of a state: its fields but for the slip of the step, and its numbers."""
        if handle := _core.hc_f2py_states.hold_state(shape[1], shape[0], *fields, numbers):
            return cls(handle, shape)
        raise ResourceError("not enough memory for the state of the contact: choose a smaller window")

    @staticmethod
    def of(state: Any, numbers: list[float]) -> HeldState | None:
        """Return what a state with these numbers is the record of, if a step starts from the same."""
        view = getattr(state.pressure, "base", None)
        held = getattr(getattr(view, "base", None), "held", None)
        return held if isinstance(held, HeldState) and held._is_record(state, numbers) else None

    def view(self, name: str) -> Array:
        """Return a field, which is no copy."""
        memory: Any = (ctypes.c_double * math.prod(self._shape)).from_address(self._places[name])
        memory.held = self
        return np.frombuffer(memory).reshape(self._shape)

    def take_zones(self) -> NDArray[np.int8]:
        """Return the zones, which the core then forgets."""
        zones: NDArray[Any] = _core.hc_f2py_states.take_zones(self.handle, math.prod(self._shape))
        return zones.astype(np.int8).reshape(self._shape)

    def record(self, gap: Array, numbers: list[float]) -> None:
        """Remember the recorded gap, which differs where nothing can touch, and numbers of the state."""
        self._recorded = weakref.ref(gap), numbers

    def _is_record(self, state: Any, numbers: list[float]) -> bool:
        if not self._recorded:
            return False
        gap, recorded = self._recorded
        if gap() is not state.gap or numbers != recorded:
            return False
        # a copy where nothing can touch
        if not (np.isnan(state.gap) | (state.gap == self.view("gap"))).all():
            return False
        names = (name for name in self._places if name != "gap" and name not in SLIP)
        return all(self._is_view(name, getattr(state, name)) for name in names)

    def _is_view(self, name: str, values: Any) -> bool:
        if not isinstance(values, np.ndarray) or values.shape != self._shape:
            return False
        return values.ctypes.data == self._places[name] and values.flags.c_contiguous
