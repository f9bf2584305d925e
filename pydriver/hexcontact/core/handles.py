"""Objects of the core, which are freed with their Python objects, and states of contacts."""

from __future__ import annotations

import ctypes
import math
import weakref
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..variables import CORE
from . import flat, kernel_cache


class Handle:
    """An object of the core, which is freed with its Python object."""

    _handle: int

    def _create(self, procedure: Callable[..., int], *arguments: Any) -> None:
        kernel_cache.take_settings()
        self._handle = procedure(*arguments)
        weakref.finalize(self, flat.free_object, self._handle)
        kernel_cache.warn_of_faults()


class _Slip:
    """The slip of the last step in a state, which is freed with the last array that is a view of it."""

    def __init__(self, state: HeldState) -> None:
        self.state = state
        weakref.finalize(self, flat.free_slip, state.handle).atexit = False


class HeldState:
    """A state in the memory of the core, which is freed with the last array that is a view of it."""

    def __init__(self, handle: int, shape: tuple[int, ...]) -> None:
        self.handle, self.shape = handle, shape
        self._slip: Callable[[], _Slip | None] = lambda: None
        # at the end of the process arrays may still be in use
        weakref.finalize(self, flat.free_object, handle).atexit = False

    @property
    def held(self) -> HeldState:
        """The state itself, where a solution may stand."""
        return self

    def view(self, name: str) -> NDArray[Any]:
        """Return a field, which is no copy."""
        owner: Any = self
        if name.startswith("slip_increment"):
            owner = self._slip() or _Slip(self)
            self._slip = weakref.ref(owner)
        return self._array(name, owner)

    def _array(self, name: str, owner: Any) -> NDArray[Any]:
        number, kind = (ctypes.c_int8, "i1") if name == "zone" else (ctypes.c_double, "f8")
        memory: Any = (number * math.prod(self.shape)).from_address(flat.place_of_field(self, name))
        memory.held = owner
        return np.frombuffer(memory, dtype=kind).reshape(self.shape)

    @classmethod
    def copied(cls, fields: Mapping[str, NDArray[Any]], numbers: Mapping[str, float]) -> HeldState:
        """Return a copy of a state."""
        shape = fields["pressure"].shape
        history = flat.History(**{name: numbers.get(name, 0.0) for name in CORE["numbers"]})
        held = cls(flat.new_state(shape[1], shape[0], history), shape)
        for name, field in fields.items():
            held._array(name, held)[:] = field
        return held


class Solved:
    """A solution, and its state in the core, unless it was made or changed in Python."""

    __slots__ = ("_held",)

    def behind(self, held: HeldState | None) -> Self:
        """Return the solution with the state that it is the record of."""
        object.__setattr__(self, "_held", held)
        return self

    @property
    def held(self) -> HeldState:
        """Its state in the core, or a copy there."""
        return self.copied() if self.known is None else self.known

    def copied(self) -> HeldState:
        """Return a copy of its state in the core."""
        names = [name for name in (*CORE["fields"], *CORE["zone"]) if name in vars(self)]
        return HeldState.copied({name: vars(self)[name] for name in names}, vars(self))

    @property
    def known(self) -> HeldState | None:
        """Its state in the core."""
        return getattr(self, "_held", None)

    def __getstate__(self) -> dict[str, Any]:
        return vars(self)
