"""Kinds of values: the expected value in words and as JSON schema, reading, and writing to a deck."""

from __future__ import annotations

import ast
import contextlib
import functools
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, NoReturn, TypeGuard, TypeVar

import numpy as np
from pydantic_core import PydanticCustomError, core_schema

from ..arrays import Array
from ..text import did_you_mean, listed, shown
from ..variables import LARGEST
from .units import ANGLE, DIGITS, LONGEST, NUMBER, Dimension, UnitError, angle_text, spelled, to_si

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
    """A formula over names or dotted keys of a deck: numbers, ``+ - * / **``, parentheses and `FUNCTIONS`.

    ValueError for another text. `names` are those in it, each once.
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


Schema = dict[str, Any]
"""A JSON schema."""


def refuse(sentence: str) -> NoReturn:
    """Reject a value during validation; `sentence` follows the key and the value in the message."""
    raise PydanticCustomError("deck", "{sentence}", {"sentence": sentence})


_Value = TypeVar("_Value")
_Given = TypeVar("_Given")
SMALLEST = 1.0 / LARGEST
_SHARE = rf"([+-]?{DIGITS})\s*(?:\*\s*)?(?:mu|[\u00b5\u03bc])\s*(?:\*\s*)?P"  # both letters mu


class Kind:
    """A kind of value, for annotations ``Annotated[float, kind]``."""

    @property
    def expected(self) -> str:
        """Description of a value of this kind, to follow the word "expected"."""
        return self._expected()

    def parse(self, value: object) -> Any:
        """Return the value of an entry of a deck, or `refuse` it."""
        return self._parse(value)

    def written(self, value: Any) -> Any:
        """Return a parsed value as a deck holds it."""
        return value

    def schema(self) -> Schema:
        """Return the JSON schema of the kind."""
        return self._schema()

    def _expected(self) -> str:
        raise NotImplementedError

    def _parse(self, value: object) -> Any:
        raise NotImplementedError

    def _schema(self) -> Schema:
        return {}

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Validate with `parse`."""
        return core_schema.no_info_plain_validator_function(self.parse)

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> Schema:
        """Describe with `schema`."""
        return self.schema()


class Read(Generic[_Value, _Given]):
    """For type checkers: a field that is a value in SI, made of an argument that may carry a unit."""

    def __get__(self, table: object, kind: type) -> _Value:
        raise NotImplementedError

    def __set__(self, table: object, value: _Given) -> None: ...


@dataclass(frozen=True, eq=False, repr=False)
class Quantity(Kind):
    """A finite number with a dimension and bounds, in SI once read.

    `infinite` admits +inf; `any_size` also admits values beyond those of lengths, forces and moduli.
    """

    dimension: Dimension
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    infinite: bool = False
    any_size: bool = False

    def _expected(self) -> str:
        limits = [
            f"{word} {bound:g} {self.dimension.unit if bound else ''}".strip()
            for word, bound in (("above", self.above), ("at least", self.at_least), ("at most", self.at_most))
            if bound is not None
        ]
        if limits and not limits[0].startswith("above"):
            limits[0] = f"of {limits[0]}"
        example = "" if self.dimension is NUMBER else f" such as {self.dimension.example}"
        infinite = " (or inf)" if self.infinite else ""
        return " ".join([self.dimension.name, " and ".join(limits)]).strip() + infinite + example

    def _parse(self, value: object) -> float:
        try:
            number = to_si(value, self.dimension)
        except UnitError as error:
            refuse(f"expected {self.expected}" + (f"; {error}" if str(error) else ""))
        if not (math.isfinite(number) or (self.infinite and number == math.inf)):
            refuse(f"expected {self.expected}, a finite number")
        inside = (
            (self.above is None or number > self.above)
            and (self.at_least is None or number >= self.at_least)
            and (self.at_most is None or number <= self.at_most)
        )
        if not inside:
            refuse(f"expected {self.expected}")
        if not self.any_size and LARGEST < abs(number) < math.inf:
            refuse(f"expected {self.expected}, not above {LARGEST:g} in SI")
        if not self.any_size and self.above == 0 and number < SMALLEST:
            refuse(f"expected {self.expected}, not below {SMALLEST:g} in SI")
        return number

    def written(self, value: float) -> float | str:
        """Return a number in SI, with its unit if the dimension requires one."""
        return angle_text(value) if self.dimension is ANGLE else value

    def _schema(self) -> Schema:
        bounds = {"exclusiveMinimum": self.above, "minimum": self.at_least, "maximum": self.at_most}
        number = {"type": "number"} | {key: bound for key, bound in bounds.items() if bound is not None}
        least = self.above if self.above is not None else self.at_least
        sign = r"\+?" if least is not None and least >= 0 else "[+\u2212-]?"
        text = {"type": "string", "pattern": rf"^\s*{sign}{DIGITS}\s*[^\s\d.+-].*$"}
        known: Schema = {"description": self.expected[0].upper() + self.expected[1:]}
        if self.dimension is NUMBER:
            return {"anyOf": [text, number], **known}
        known["examples"] = [self.dimension.example.strip('"')]
        if not self.dimension.bare:
            return text | known
        known["description"] += f"; a bare number is in {self.dimension.unit}"
        return {"anyOf": [text, number], **known}


@dataclass(frozen=True, eq=False, repr=False)
class PowerCoefficient(Kind):
    """A coefficient above 0 of a power law, which its table parses in a unit that depends on the exponent."""

    unit: str
    example: str

    def _expected(self) -> str:
        return f"a coefficient above 0 in {self.unit} such as {self.example}"

    def _parse(self, value: object) -> Any:
        return value

    def _schema(self) -> Schema:
        return {"type": ["number", "string"], "description": self.expected}


@dataclass(frozen=True)
class Share:
    """A tangential load as a share of the limit of friction, mu P at the end of its segment."""

    share: float

    def __str__(self) -> str:
        return f"{self.share!r} mu P"


@dataclass(frozen=True, eq=False, repr=False)
class OrShare(Kind):
    """A force, or a share of the limit of friction."""

    kind: Quantity

    def _expected(self) -> str:
        measured = self.kind.dimension
        return f'{measured.name}, or a share of mu P, such as {measured.example} or "0.6 mu P"'

    def _parse(self, value: object) -> float | Share:
        if isinstance(value, Share):
            return value
        text = spelled(value.strip()) if isinstance(value, str) and len(value) <= LONGEST else ""
        match = re.fullmatch(_SHARE, text)
        if match and abs(share := float(match[1])) <= LARGEST:
            return Share(share)
        try:
            return self.kind.parse(value)
        except PydanticCustomError as error:
            refuse(error.message().replace(self.kind.expected, self.expected, 1))

    def written(self, value: float | Share) -> float | str:
        """Return newtons, or the share as text."""
        return str(value) if isinstance(value, Share) else self.kind.written(value)

    def _schema(self) -> Schema:
        return self.kind.schema() | {"examples": ["10 N", "0.6 mu P"]}


@dataclass(frozen=True, eq=False, repr=False)
class Whole(Kind):
    """A whole number between two bounds."""

    at_least: int
    at_most: int = 10**9

    def _expected(self) -> str:
        return f"a whole number of at least {self.at_least}"

    def _parse(self, value: object) -> int:
        try:
            number = operator.index(value)  # type: ignore[arg-type]
        except TypeError:
            number = self.at_least - 1
        if isinstance(value, bool) or number < self.at_least:
            refuse(f"expected {self.expected}")
        if number > self.at_most:
            refuse(f"expected a whole number of at most {self.at_most}")
        return number

    def _schema(self) -> Schema:
        return {"type": "integer", "minimum": self.at_least, "maximum": self.at_most}


@dataclass(frozen=True, eq=False, repr=False)
class Word(Kind):
    """One of several words."""

    words: tuple[str, ...]

    def _expected(self) -> str:
        return listed([f'"{word}"' for word in self.words], "or")

    def _parse(self, value: object) -> str:
        if not isinstance(value, str) or value not in self.words:
            refuse(f"expected {self.expected}{did_you_mean(value, self.words)}")
        return value

    def _schema(self) -> Schema:
        return {"enum": list(self.words)}


class Text(Kind):
    """Any text."""

    def _expected(self) -> str:
        return "text in quotes"

    def _parse(self, value: object) -> str:
        if not isinstance(value, str) or re.search("[\ud800-\udfff]", value):  # unpaired surrogates
            refuse(f"expected {self.expected}")
        return value

    def _schema(self) -> Schema:
        return {"type": "string"}


class FileName(Text):
    """The name of a file."""

    def written(self, value: Path) -> str:
        """Return the name as text."""
        return str(value)

    def _parse(self, value: object) -> Any:
        text = super()._parse(value)
        return Path(text) if text else None


def formula_over_plane(text: str, expected: str) -> Formula:
    """Return a formula of x and y, or `refuse` another text."""
    try:
        formula = Formula(text)
    except ValueError as error:
        refuse(f"expected {expected}; it is not {error}")
    if unknown := set(formula.names) - {"x", "y"}:
        refuse(f"expected {expected}; unknown: {', '.join(sorted(unknown))}")
    return formula


class HeightFormula(Text):
    """A formula of x and y, as text."""

    def _expected(self) -> str:
        return 'a formula of x and y in m such as "min((x - 1e-4)**2, (x + 1e-4)**2)/2e-2 + y**2/2e-2"'

    def _parse(self, value: object) -> str:
        text = super()._parse(value)
        formula_over_plane(text, self.expected)
        return text


class Flag(Kind):
    """True or false."""

    def _expected(self) -> str:
        return "true or false"

    def _parse(self, value: object) -> bool:
        if not isinstance(value, bool):
            refuse(f"expected {self.expected}")
        return value

    def _schema(self) -> Schema:
        return {"type": "boolean"}


class RadiusOfCurvature(Quantity):
    """A radius of curvature above 0; that of a hollow is refused with a remedy."""

    def _parse(self, value: object) -> float:
        try:
            return super()._parse(value)
        except PydanticCustomError as error:
            with contextlib.suppress(UnitError):
                if to_si(value, self.dimension) < 0.0:
                    example = '{ shape = "formula", expression = "-x**2/(2*5e-3) + y**2/(2*20e-3)" }'
                    refuse(f"{error.message()}; a hollow is a formula with its radii in m: {example}")
            raise


@dataclass(frozen=True, eq=False, repr=False)
class Several(Kind):
    """An array of values of one kind: `count` of them, or at least one."""

    kind: Kind
    plural: str  # noun for them
    example: str  # an array as in a deck
    count: int | None = None
    fault_of: Callable[[Any], str] = lambda _: ""  # sentence about values that do not fit together

    def _expected(self) -> str:
        number = {None: "an array of", 2: "two", 3: "three"}[self.count]
        return f"{number} {self.plural} such as {self.example}"

    def _parse(self, value: object) -> tuple[Any, ...]:
        if isinstance(value, str | bytes | Mapping) or not _is_array(value):
            refuse(f"expected {self.expected}")
        entries = list(value)
        if not entries or self.count not in (None, len(entries)):
            refuse(f"expected {self.expected}")
        parsed = []
        for number, entry in enumerate(entries, start=1):
            try:
                parsed.append(self.kind.parse(entry))
            except PydanticCustomError as error:
                refuse(f"expected {self.expected}; entry {number}, {shown(entry)}: {error.message()}")
        if fault := self.fault_of(parsed):
            refuse(fault)
        return tuple(parsed)

    def written(self, value: Any) -> list[Any]:
        """Return the entries."""
        return [self.kind.written(entry) for entry in value]

    def _schema(self) -> Schema:
        most = {"maxItems": self.count} if self.count else {}
        return {"type": "array", "items": self.kind.schema(), "minItems": self.count or 1, **most}


def _is_array(value: object) -> TypeGuard[Iterable[Any]]:
    """Return whether a value is an array: a list, a tuple, or an array of numpy."""
    return hasattr(value, "__getitem__") and hasattr(value, "__len__") and getattr(value, "shape", (1,)) != ()


@dataclass(frozen=True, eq=False, repr=False)
class WordOr(Kind):
    """One fixed word, or a value of another kind."""

    word: str
    kind: Kind

    def _expected(self) -> str:
        return f'"{self.word}" or {self.kind.expected}'

    def _parse(self, value: object) -> Any:
        if isinstance(value, str):
            return value if value == self.word else refuse(f"expected {self.expected}")
        return self.kind.parse(value)

    def written(self, value: Any) -> Any:
        """Return the word, or the value."""
        return value if value == self.word else self.kind.written(value)

    def _schema(self) -> Schema:
        return {"anyOf": [{"const": self.word}, self.kind.schema()]}
