"""Kinds of values: the expected value in words and as JSON schema, reading, and writing to a deck."""

from __future__ import annotations

import ast
import functools
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, NoReturn, TypeVar

import numpy as np
from pydantic import ValidationInfo, WrapValidator
from pydantic_core import PydanticCustomError, core_schema

from ..arrays import Array
from ..text import did_you_mean, listed, shown
from ..variables import LARGEST
from .units import ANGLE, DIGITS, LENGTH, LONGEST, NUMBER, Dimension, UnitError, angle_text, spelled, to_si

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
_HIGHEST = 20  # degree of a polynomial
_CONSTANTS = {"pi": math.pi}
_MOST = {"min": math.inf, "max": math.inf, "log": 2}  # arguments; the others take one
_OVER_ARRAYS: dict[Callable[..., float], Callable[..., Any]] = {
    **{FUNCTIONS[name]: getattr(np, name) for name in FUNCTIONS if name not in _MOST},
    math.log: lambda value, *base: np.log(value) / (np.log(*base) if base else 1.0),
    min: lambda *values: functools.reduce(np.minimum, values),
    max: lambda *values: functools.reduce(np.maximum, values),
    math.pow: np.power,
    float: np.float64,  # 1/0 of arrays is infinite
}
_NAME = r"(?<![\w.])[^\W\d]\w*+(?:\.\w++)*+(?!\s*\()"
_LONGEST = 300  # characters; the parser and the evaluation need stack for each level of parentheses
_Term = Callable[[Mapping[str, Any], Mapping[Callable[..., float], Any]], Any]
"""A part of a formula: its value by the values of names, and the functions that stand for those of `math`."""


class Formula:
    """A formula over names or dotted keys of a deck: numbers, ``+ - * / **``, parentheses and `FUNCTIONS`.

    ValueError for another text. `names` are those in it, each once.
    """

    def __init__(self, text: str) -> None:
        symbols: dict[str, str] = {}  # by name: identifiers of Python
        try:
            if len(text) > _LONGEST:
                raise ValueError
            spelt = re.sub(_NAME, lambda name: symbols.setdefault(name[0], f"_{len(symbols)}"), text.strip())
            self._names = {symbol: name for name, symbol in symbols.items()}
            self._term = self._read(ast.parse(spelt, mode="eval").body)
        except (SyntaxError, ValueError, OverflowError, RecursionError, MemoryError):
            known = ", ".join(FUNCTIONS)
            raise ValueError(f"a formula of numbers, names, + - * / ** ( ) and {known}") from None
        self.names = tuple(name for name in symbols if name not in _CONSTANTS)
        self._text = text

    def __reduce__(self) -> tuple[type, tuple[str]]:
        return Formula, (self._text,)

    def _read(self, node: ast.AST) -> _Term:
        """Return the term of a node of the tree; ValueError for anything but arithmetic."""
        function: Callable[..., float]
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                number = float(value)  # OverflowError beyond its range
                return lambda values, over: over.get(float, float)(number)
            case ast.Name(id=symbol) if symbol in self._names:
                name = self._names[symbol]
                return lambda values, over: _CONSTANTS[name] if name in _CONSTANTS else values[name]
            case ast.UnaryOp(op=of, operand=operand) if type(of) in _OPERATORS:
                function, parts = _OPERATORS[type(of)], [operand]
            case ast.BinOp(op=of, left=left, right=right) if type(of) in _OPERATORS:
                function, parts = _OPERATORS[type(of)], [left, right]
            case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]) if name in FUNCTIONS:
                function = FUNCTIONS[name]
                # numpy takes a further argument as the array for the values of a function.
                if not 1 + (_MOST.get(name) == math.inf) <= len(parts) <= _MOST.get(name, 1):
                    raise ValueError
            case _:
                raise ValueError
        terms = [self._read(part) for part in parts]
        return lambda values, over: over.get(function, function)(*[term(values, over) for term in terms])

    def value(self, numbers: Mapping[str, float]) -> float:
        """Return the value for the numbers of its names."""
        try:
            found = float(self._term(numbers, {}))
        except (ArithmeticError, TypeError, ValueError) as error:
            raise ValueError(f"has no value here: {error}") from None
        if not math.isfinite(found):
            raise ValueError("has no finite value here")
        return found

    def of(self, **polynomials: Any) -> Any:
        """Return the value for polynomials; an error of Python where it is none."""

        def power(base: Any, exponent: Any) -> Any:
            if isinstance(base, float):
                return math.pow(base, exponent)
            if not exponent * base.degree() <= _HIGHEST:
                raise ValueError
            return base**exponent

        return self._term(polynomials, {math.pow: power})

    def __call__(self, x: Array, y: Array) -> Array:
        """Return the values over arrays of x and y; NaN or infinite where there are none."""
        with np.errstate(all="ignore"):
            return np.asarray(self._term({"x": x, "y": y}, _OVER_ARRAYS), float)


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

    expected: str
    """Description of a value, to follow the word "expected"."""

    schema: Schema
    """JSON schema of the kind; without it any value."""

    def parse(self, value: object) -> Any:
        """Return the value of an entry of a deck, or `refuse` it."""
        return self._parse(value)

    def written(self, value: Any) -> Any:
        """Return a parsed value as a deck holds it."""
        return value

    def _parse(self, value: object) -> Any:
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Validate with `parse`."""
        return core_schema.no_info_plain_validator_function(self.parse)

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> Schema:
        """Describe with a copy of `schema`, to which the table adds the words of its key."""
        return dict(getattr(self, "schema", {}))


class Read(Generic[_Value, _Given]):
    """For type checkers: a field that is a value in SI, made of an argument that may carry a unit."""

    def __get__(self, table: object, kind: type) -> _Value:
        raise NotImplementedError

    def __set__(self, table: object, value: _Given) -> None: ...


OR_NONE = WrapValidator(lambda value, read: None if value is None else read(value))
"""After a kind: a field of `Read` may be None, too."""


class Quantity(Kind):
    """A finite number with a dimension and bounds, in SI once read.

    `infinite` admits +inf; `any_size` also admits values beyond those of lengths, forces and moduli;
    `nonzero` refuses 0; `remedy` follows the message about a number below 0.
    """

    def __init__(
        self,
        dimension: Dimension,
        above: float = -math.inf,
        at_least: float = -math.inf,
        at_most: float = math.inf,
        infinite: bool = False,
        any_size: bool = False,
        nonzero: bool = False,
        remedy: str = "",
    ) -> None:
        self.dimension, self.infinite, self.any_size = dimension, infinite, any_size
        self.nonzero, self.remedy = nonzero, remedy
        self.above, self.at_least, self.at_most = above, at_least, at_most
        limits = [
            f"{word} {bound:g} {dimension.unit if bound else ''}".strip()
            for word, bound in (("above", above), ("at least", at_least), ("at most", at_most))
            if math.isfinite(bound)
        ]
        of = "of " if limits and math.isinf(above) else ""
        known = f"{dimension.name} {of}{' and '.join(limits)}".strip() + " (or inf)" * infinite
        self.expected = known if dimension is NUMBER else f"{known} such as {dimension.example}"

    @property
    def schema(self) -> Schema:  # type: ignore[override]
        """A number in SI, or a text with a unit."""
        bounds = {"exclusiveMinimum": self.above, "minimum": self.at_least, "maximum": self.at_most}
        number = {"type": "number"} | {key: bound for key, bound in bounds.items() if math.isfinite(bound)}
        sign = r"\+?" if max(self.above, self.at_least) >= 0 else "[+\u2212-]?"
        text = {"type": "string", "pattern": rf"^\s*{sign}{DIGITS}\s*[^\s\d.+-].*$"}
        known: Schema = {"description": self.expected[0].upper() + self.expected[1:]}
        if self.dimension is NUMBER:
            return {"anyOf": [text, number], **known}
        known["examples"] = [self.dimension.example.strip('"')]
        if not self.dimension.bare:
            return text | known
        known["description"] += f"; a bare number is in {self.dimension.unit}"
        return {"anyOf": [text, number], **known}

    def written(self, value: float) -> float | str:
        """Return a number in SI, with its unit if the dimension requires one."""
        return angle_text(value) if self.dimension is ANGLE else value

    def _parse(self, value: object) -> float:
        try:
            number = to_si(value, self.dimension)
        except UnitError as error:
            refuse(f"expected {self.expected}" + (f"; {error}" if str(error) else ""))
        if not (math.isfinite(number) or (self.infinite and number == math.inf)):
            fault = ", a finite number"
        elif not (self.above < number and self.at_least <= number <= self.at_most):
            fault = ""
        elif not self.any_size and LARGEST < abs(number) < math.inf:
            fault = f", not above {LARGEST:g} in SI"
        elif not self.any_size and self.above == 0 and number < SMALLEST:
            fault = f", not below {SMALLEST:g} in SI"
        elif self.nonzero and number == 0.0:
            fault = ", not 0"
        else:
            return number
        refuse(f"expected {self.expected}{fault}" + self.remedy * (number < 0.0))


class PowerCoefficient(Kind):
    """A coefficient above 0 of a power law, in a unit that follows from the exponent.

    That is the first of some keys of its table that has a value.
    """

    def __init__(self, unit: str, dimension: Callable[[float], Dimension], *exponents: str) -> None:
        self.unit, self._dimension, self._exponents = unit, dimension, exponents
        self.expected = f"a coefficient above 0 in {unit} such as {dimension(2.0).example}"
        self.schema = {"type": ["number", "string"], "description": self.expected}

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Validate when the exponents are known."""
        return core_schema.with_info_plain_validator_function(self._of_table)

    def _of_table(self, value: object, info: ValidationInfo) -> float:
        known = [info.data.get(key, math.nan) for key in self._exponents]  # NaN: wrong, and reported itself
        exponent = next(number for number in known if number is not None)
        dimension = self._dimension(exponent)
        return 0.0 if math.isnan(exponent) else Quantity(dimension, above=0, any_size=True).parse(value)


@dataclass(frozen=True)
class Share:
    """A tangential load as a share of the limit of friction, mu P at the end of its segment."""

    share: float

    def __str__(self) -> str:
        return f"{self.share!r} mu P"


class OrShare(Kind):
    """A force or pressure, or a share of the limit of friction."""

    def __init__(self, kind: Quantity) -> None:
        measured, self.kind = kind.dimension, kind
        self.expected = f'{measured.name}, or a share of mu P, such as {measured.example} or "0.6 mu P"'
        self.schema = kind.schema | {"examples": [measured.example.strip('"'), "0.6 mu P"]}

    def written(self, value: float | Share) -> float | str:
        """Return newtons, or the share as text."""
        return str(value) if isinstance(value, Share) else self.kind.written(value)

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


class Whole(Kind):
    """A whole number between two bounds."""

    def __init__(self, at_least: int, at_most: int = 10**9) -> None:
        self.at_least, self.at_most = at_least, at_most
        self.expected = f"a whole number of at least {at_least}"
        self.schema = {"type": "integer", "minimum": at_least, "maximum": at_most}

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


class Word(Kind):
    """One of several words, or false if it is among them."""

    def __init__(self, words: tuple[Any, ...]) -> None:
        self.words, self.schema = words, {"enum": list(words)}
        self.expected = listed([shown(word) for word in words], "or")

    def _parse(self, value: object) -> Any:
        if not isinstance(value, str | bool) or value not in self.words:
            refuse(f"expected {self.expected}{did_you_mean(value, filter(None, self.words))}")
        return value


class Text(Kind):
    """Any text."""

    expected = "text in quotes"
    schema: ClassVar[Schema] = {"type": "string"}  # type: ignore[misc]

    def _parse(self, value: object) -> str:
        if not isinstance(value, str) or re.search("[\ud800-\udfff]", value):  # unpaired surrogates
            refuse(f"expected {self.expected}")
        return value


class FileName(Text):
    """The name of a file."""

    def written(self, value: Path) -> str:
        """Return the name as text."""
        return str(value)

    def _parse(self, value: object) -> Any:
        text = super()._parse(str(value) if isinstance(value, Path) else value)
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

    expected = 'a formula of x and y in m such as "min((x - 1e-4)**2, (x + 1e-4)**2)/2e-2 + y**2/2e-2"'

    def _parse(self, value: object) -> str:
        text = super()._parse(value)
        formula_over_plane(text, self.expected)
        return text


class Flag(Kind):
    """True or false."""

    expected = "true or false"
    schema: ClassVar[Schema] = {"type": "boolean"}  # type: ignore[misc]

    def _parse(self, value: object) -> bool:
        return value if isinstance(value, bool) else refuse(f"expected {self.expected}")


class Several(Kind):
    """An array of values of one kind: `count` of them, or at least one.

    `plural` is the noun for them, `example` an array as in a deck; `fault_of` returns a sentence about values
    that do not fit together, `unique` ones differ; `words` are others for the array.
    """

    def __init__(
        self,
        kind: Kind,
        plural: str,
        example: str,
        count: int | None = None,
        fault_of: Callable[[Any], str] = lambda _: "",
        unique: bool = False,
        words: str = "",
    ) -> None:
        self.kind, self.example, self.count, self.fault_of = kind, example, count, fault_of
        number = {None: "an array of", 2: "two", 3: "three"}[count]
        self.expected = f"{words or f'{number} {plural}'} such as {example}"
        self._bounds = ({"maxItems": count} if count else {}) | ({"uniqueItems": True} if unique else {})

    @property
    def schema(self) -> Schema:  # type: ignore[override]
        """An array of the values."""
        items = getattr(self.kind, "schema", {})
        return {"type": "array", "items": items, "minItems": self.count or 1, **self._bounds}

    def written(self, value: Any) -> list[Any]:
        """Return the entries."""
        return [self.kind.written(entry) for entry in value]

    def _parse(self, value: object) -> tuple[Any, ...]:
        # an array: a list, a tuple, or an array of numpy
        sized = hasattr(value, "__getitem__") and hasattr(value, "__len__")
        if isinstance(value, str | bytes | Mapping) or not sized or getattr(value, "shape", (1,)) == ():
            refuse(f"expected {self.expected}")
        entries: list[Any] = list(value)  # type: ignore[call-overload]
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


MOST_SLENDER = 100.0  # ratio of the sides of a cell: the kernels lose digits like its square


class Spacing(Kind):
    """One length or two, or "auto"."""

    one = Quantity(LENGTH, above=0)
    expected = 'a length above 0, two of them such as ["5 um", "20 um"], or "auto"'

    def __init__(self) -> None:
        example, fault = '["5 um", "20 um"]', f"expected lengths of a ratio of at most {MOST_SLENDER:g}"
        self.two = Several(
            *(self.one, "lengths", example),
            count=2,
            fault_of=lambda both: fault if max(both) > MOST_SLENDER * min(both) else "",
        )
        self.schema = {"anyOf": [{"const": "auto"}, self.one.schema, self.two.schema]}

    def written(self, value: Any) -> Any:
        """Return the word, the length or both of them."""
        return list(value) if isinstance(value, tuple) else value

    def _parse(self, value: object) -> Any:
        if isinstance(value, list | tuple):
            return self.two.parse(value) if len(value) == 2 else refuse(f"expected {self.expected}")
        return value if value == "auto" else self.one.parse(value)


class WordOr(Kind):
    """One fixed word, or a value of another kind."""

    def __init__(self, word: str, kind: Kind) -> None:
        self.word, self.kind = word, kind
        self.expected = f'"{word}" or {kind.expected}'
        self.schema = {"anyOf": [{"const": word}, kind.schema]}

    def written(self, value: Any) -> Any:
        """Return the word, or the value."""
        return value if value == self.word else self.kind.written(value)

    def _parse(self, value: object) -> Any:
        if value == self.word:
            return value
        measured = isinstance(self.kind, Quantity) and isinstance(value, str) and any(map(str.isdigit, value))
        if isinstance(value, str) and not measured:
            refuse(f"expected {self.expected}")
        return self.kind.parse(value)
