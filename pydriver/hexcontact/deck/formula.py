"""Formulas over numbers: arithmetic and a few functions, no other code."""

from __future__ import annotations

import ast
import functools
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..arrays import Array

FUNCTIONS: dict[str, Callable[..., float]] = {
    name: getattr(math, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "tanh")
} | {"abs": abs, "min": min, "max": max}

_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,  # neither complex numbers nor integers of a million digits
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_CONSTANTS = {"pi": math.pi}
_MOST = {"min": math.inf, "max": math.inf, "log": 2}  # arguments; the others take one
_OVER_ARRAYS: dict[Callable[..., float], Callable[..., Any]] = {
    **{FUNCTIONS[name]: getattr(np, name) for name in FUNCTIONS if name not in _MOST},
    math.log: lambda value, *base: np.log(value) / (np.log(*base) if base else 1.0),
    min: lambda *values: functools.reduce(np.minimum, values),
    max: lambda *values: functools.reduce(np.maximum, values),
    math.pow: np.power,
}
_NAME = r"(?<![\w.])[^\W\d]\w*+(?:\.\w++)*+(?!\s*\()"
_LONGEST = 300  # characters; the parser and the evaluation need stack for each level of parentheses


class Formula:
    """A formula over names or dotted keys of a deck.

    Parameters
    ----------
    text : str
        Such as ``0.8 * friction.coefficient * load.1.normal_load``.

    Attributes
    ----------
    names : tuple of str
        The names in it, each once.

    Raises
    ------
    ValueError
        If it is no formula of numbers, names, ``+ - * / **``, parentheses and `FUNCTIONS`.
    """

    def __init__(self, text: str) -> None:
        found: dict[str, str] = {}

        def symbol(match: re.Match[str]) -> str:
            return found.setdefault(match[0], f"_{len(found)}")

        try:
            if len(text) > _LONGEST:
                raise ValueError
            self._tree = ast.parse(re.sub(_NAME, symbol, text.strip()), mode="eval").body
            self._names = {symbol: name for name, symbol in found.items()}
            self._checked(self._tree)
        except (SyntaxError, ValueError, OverflowError, RecursionError, MemoryError):
            known = ", ".join(FUNCTIONS)
            raise ValueError(f"a formula of numbers, names, + - * / ** ( ) and {known}") from None
        self.names = tuple(name for name in found if name not in _CONSTANTS)

    def _checked(self, node: ast.AST) -> None:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                float(number)  # OverflowError beyond its range
                return
            case ast.Name(id=name) if name in self._names:
                return
            case ast.UnaryOp() if type(node.op) in _OPERATORS:
                parts: list[ast.expr] = [node.operand]
            case ast.BinOp() if type(node.op) in _OPERATORS:
                parts = [node.left, node.right]
            case ast.Call(func=ast.Name(id=name), keywords=[]) if name in FUNCTIONS:
                parts = node.args
                # numpy takes a further argument as the array for the values of a function.
                if not 1 + (_MOST.get(name) == math.inf) <= len(parts) <= _MOST.get(name, 1):
                    raise ValueError
            case _:
                raise ValueError
        for part in parts:
            self._checked(part)

    def value(self, numbers: Mapping[str, float]) -> float:
        """Return the value for the numbers of its names."""
        try:
            found = float(self._evaluated(self._tree, numbers, {}))
        except (ArithmeticError, TypeError, ValueError) as error:
            raise ValueError(f"has no value here: {error}") from None
        if not math.isfinite(found):
            raise ValueError("has no finite value here")
        return found

    def over(self, **arrays: Array) -> Array:
        """Return the values over arrays of its names; NaN or infinite where there are none."""
        with np.errstate(all="ignore"):
            return np.asarray(self._evaluated(self._tree, arrays, _OVER_ARRAYS), float)

    def _evaluated(
        self, node: Any, values: Mapping[str, Any], replaced: Mapping[Callable[..., float], Any]
    ) -> Any:
        """Return the value of a node of the tree, with some functions replaced."""
        match node:
            case ast.Constant(value=int() | float() as number):
                return np.float64(number) if replaced else float(number)  # 1/0 of arrays is infinite
            case ast.Name():
                name = self._names[node.id]
                return _CONSTANTS[name] if name in _CONSTANTS else values[name]
            case ast.UnaryOp():
                function, parts = _OPERATORS[type(node.op)], [node.operand]
            case ast.BinOp():
                function, parts = _OPERATORS[type(node.op)], [node.left, node.right]
            case _:
                function, parts = FUNCTIONS[node.func.id], node.args
        arguments = [self._evaluated(part, values, replaced) for part in parts]
        return replaced.get(function, function)(*arguments)
