"""What every table of a deck shares: kinds of values, strict keys, a sentence for each thing wrong.

A kind of value knows what it expects, in words, and how to read it. A `Table` is a pydantic model that
forbids unknown keys and turns whatever pydantic finds into `Mistake` sentences; all of them reach the user at
once, as one `DeckError`.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn, Self, TypeGuard

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from ..text import did_you_mean, listed, shown
from ..variables import LARGEST
from .faults import MISSING, Mistake, Source, deck_error
from .units import NUMBER, Dimension, UnitError, to_si


def refuse(sentence: str) -> NoReturn:
    """Reject a value while it is being validated; `sentence` follows the key and the value."""
    raise PydanticCustomError("deck", "{sentence}", {"sentence": sentence})


def refuse_key(key: str, value: object, sentence: str) -> NoReturn:
    """Reject one key of a table that is being validated as a single value."""
    raise ValidationError.from_exception_data("", [_details(Mistake((key,), value, sentence))])


SMALLEST = 1.0 / LARGEST

# --- kinds of values ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """A kind of value: what it expects in words (`expected`), and how to read it (`parse`)."""

    @property
    def expected(self) -> str:
        """What a value of this kind looks like, to follow the word "expected"."""
        return self._expected()

    def parse(self, value: object) -> Any:
        """Read a value, or `refuse` it."""
        return self._parse(value)

    def _expected(self) -> str:
        raise NotImplementedError

    def _parse(self, value: object) -> Any:
        raise NotImplementedError

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """Let the kind stand in ``Annotated[float, kind]``."""
        return core_schema.no_info_plain_validator_function(self.parse)


@dataclass(frozen=True)
class Quantity(Kind):
    """A finite number with a dimension and bounds, in SI once read.

    `infinite` admits +inf as well; `any_size` admits what no length, force or modulus could be.
    """

    dimension: Dimension
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    infinite: bool = False
    any_size: bool = False

    def _expected(self) -> str:
        limits = [
            f"{word} {bound:g}"
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
        inside = (
            (math.isfinite(number) or (self.infinite and number == math.inf))
            and (self.above is None or number > self.above)
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


@dataclass(frozen=True)
class Whole(Kind):
    """A whole number between two bounds."""

    at_least: int
    at_most: int = 10**9

    def _expected(self) -> str:
        return f"a whole number of at least {self.at_least}"

    def _parse(self, value: object) -> int:
        try:
            number = -1 if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]
        except TypeError:
            number = self.at_least - 1
        if number > self.at_most:
            refuse(f"expected a whole number of at most {self.at_most}")
        if number < self.at_least or isinstance(value, bool):
            refuse(f"expected {self.expected}")
        return number


@dataclass(frozen=True)
class Word(Kind):
    """One word out of a few."""

    words: tuple[str, ...]

    def _expected(self) -> str:
        return listed([f'"{word}"' for word in self.words], "or")

    def _parse(self, value: object) -> str:
        if not isinstance(value, str) or value not in self.words:
            refuse(f"expected {self.expected}{did_you_mean(value, self.words)}")
        return value


@dataclass(frozen=True)
class Text(Kind):
    """Any text."""

    def _expected(self) -> str:
        return "text in quotes"

    def _parse(self, value: object) -> str:
        if not isinstance(value, str) or re.search("[\ud800-\udfff]", value):  # halves of pairs
            refuse(f"expected {self.expected}")
        return value


@dataclass(frozen=True)
class Flag(Kind):
    """True or false."""

    def _expected(self) -> str:
        return "true or false"

    def _parse(self, value: object) -> bool:
        if not isinstance(value, bool):
            refuse(f"expected {self.expected}")
        return value


@dataclass(frozen=True)
class Several(Kind):
    """An array of values of one kind: `count` of them, or any number but none.

    `plural` names them and `example` shows an array as it stands in a deck.
    """

    kind: Kind
    plural: str
    example: str
    count: int | None = None

    def _expected(self) -> str:
        number = {None: "an array of", 2: "two"}[self.count]
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
        return tuple(parsed)


def _is_array(value: object) -> TypeGuard[Iterable[Any]]:
    """Tell whether something has entries in an order: a list, a tuple, an array of numpy."""
    return hasattr(value, "__getitem__") and hasattr(value, "__len__") and getattr(value, "shape", (1,)) != ()


@dataclass(frozen=True)
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


# --- tables -------------------------------------------------------------------------------------------------


class Table(BaseModel):
    """A table of a deck: known keys only, immutable, and every problem in it reported together."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=False)

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield (key, sentence) for keys that do not go together; sees the table as it was written.

        An empty key blames the whole table.
        """
        yield from ()

    @classmethod
    def known_keys(cls) -> dict[str, Any]:
        """Return the fields of the table by the keys that decks use."""
        return {info.alias or name: info for name, info in cls.model_fields.items()}

    @classmethod
    def parse(cls, data: Mapping[str, Any], source: Source) -> Self:
        """Check a file that was read into dictionaries.

        Raises
        ------
        DeckError
            With a sentence for each thing that is wrong.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise deck_error(problems_of(error), source) from None

    @model_validator(mode="wrap")
    @classmethod
    def _collect(cls, data: Any, handler: Any) -> Any:
        found: list[Mistake] = []
        table = None
        try:
            table = handler(data)
        except ValidationError as error:
            found += [cls._problem(details) for details in error.errors(include_url=False)]
        if isinstance(data, Mapping):
            for key, sentence in cls.conflicts(data):
                found.append(Mistake((key,) if key else (), data.get(key, MISSING), sentence))
        if found:
            raise ValidationError.from_exception_data(cls.__name__, [_details(problem) for problem in found])
        return table

    @classmethod
    def _problem(cls, details: Any) -> Mistake:
        key, value, kind = details["loc"], details["input"], details["type"]
        if kind == "deck":
            # The problem may come from a table below, which has marked a missing value already.
            return Mistake(
                key, MISSING if details["ctx"].get("missing") else value, details["ctx"]["sentence"]
            )
        known = cls.known_keys()
        if kind == "missing":
            return Mistake(key, MISSING, f"missing; expected {expectation(known[key[0]])}")
        if kind == "extra_forbidden":
            hint = did_you_mean(key[0], known) or f"; known here: {listed(sorted(known), 'and')}"
            return Mistake(key, MISSING, f"unknown key{hint}")
        if kind == "list_type":
            return Mistake(key, MISSING, f"expected an array of tables: write [[{key[-1]}]]")
        if kind == "too_short":
            return Mistake(key, MISSING, "expected at least one entry")
        if kind in ("model_type", "model_attributes_type", "dict_type"):
            return Mistake(key, value, "expected a table of keys")
        return Mistake(key, value, details["msg"])


def kind_of(info: Any) -> Kind | None:
    """Return the kind of the values of a field; None if it holds tables."""
    kinds = [entry for entry in info.metadata if isinstance(entry, Kind)]
    if not kinds:  # "Annotated[...] | None" keeps its metadata one level down
        parts = getattr(info.annotation, "__args__", ())
        kinds = [e for part in parts for e in getattr(part, "__metadata__", ()) if isinstance(e, Kind)]
    return kinds[0] if kinds else None


def expectation(info: Any) -> str:
    """Say what a field expects, for messages and for the deck reference."""
    if kind := kind_of(info):
        return kind.expected
    return "an array of tables of keys" if "list[" in str(info.annotation) else "a table of keys"


def _details(problem: Mistake) -> InitErrorDetails:
    context = {"sentence": problem.sentence, "missing": problem.value is MISSING}
    value = None if problem.value is MISSING else problem.value
    return InitErrorDetails(
        type=PydanticCustomError("deck", "{sentence}", context), loc=problem.key, input=value
    )


def problems_of(error: ValidationError) -> list[Mistake]:
    """Return the problems that a `Table` found while it was validated."""
    return [Table._problem(details) for details in error.errors(include_url=False)]
