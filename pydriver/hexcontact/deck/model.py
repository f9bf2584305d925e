"""What every table of a deck shares: strict keys, and a sentence for each thing wrong.

A `Table` is a pydantic model that forbids unknown keys and turns whatever pydantic finds into `Mistake`
sentences; all of them reach the user at once, as one `DeckError`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NoReturn, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from ..text import did_you_mean, listed
from .faults import MISSING, NOWHERE, Mistake, Source, deck_error
from .kinds import Kind, Schema


def meaning(default: Any, words: str, example: str = "") -> Any:
    """Say what a key of a table means; it is required if its default is ``...``.

    The example is as in a deck, for keys that need another one than their kind has.
    """
    return Field(default, description=words, examples=[example] if example else None)


class Table(BaseModel):
    """A table of a deck: known keys only, immutable, and every problem in it reported together."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=False)

    schema_of_all: ClassVar[Schema] = {}
    """What the schema says about the keys together."""

    schema_if_whole: ClassVar[Schema] = {}
    """What it says besides if nothing of the table stands in an included deck."""

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

    def written(self, defaults: bool = True) -> dict[str, Any]:
        """Return the keys that have a value, as a deck says them; without `defaults` only others."""
        keys = {}
        for name, info in type(self).model_fields.items():
            value = getattr(self, name)
            default = info.get_default(call_default_factory=True)
            if value not in (None, ()) and (defaults or value != default):
                kind = kind_of(info)
                keys[info.alias or name] = kind.written(value) if kind else _written(value, defaults)
        return keys

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: Any) -> Schema:
        """Describe the keys; which of them are required depends on what a deck includes."""
        schema: Schema = handler.resolve_ref_schema(handler(core))
        schema.pop("required", None)
        schema.pop("title")
        schema["description"] = (cls.__doc__ or "").splitlines()[0]
        for name, info in cls.known_keys().items():
            entry, kind = schema["properties"][name], kind_of(info)
            if info.description:
                entry["description"] = info.description[0].upper() + info.description[1:]
            if info.examples:
                entry["examples"] = [tomllib.loads(f"x = {info.examples[0]}")["x"]]
            if entry.get("default") in (None, "", []):
                entry.pop("default", None)
            elif kind:
                entry["default"] = kind.written(info.default)
        return schema | cls.schema_of_all

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


def extended(table: type[Table], keys: dict[str, Any]) -> Any:
    """Return a table with more keys, each with its annotation and `meaning`."""
    return create_model(table.__name__, __base__=table, **keys)


class Argument(Table):
    """A table that is made in Python, too, where mistakes are a DeckError at once."""

    def __init__(self, /, **keys: Any) -> None:
        try:
            super().__init__(**keys)
        except ValidationError as error:
            raise deck_error(problems_of(error), NOWHERE) from error


def _written(value: Any, defaults: bool) -> Any:
    """Return tables as a deck says them."""
    if isinstance(value, Table):
        return value.written(defaults)
    return [_written(entry, defaults) for entry in value] if isinstance(value, list) else value


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


def refuse_key(key: str, value: object, sentence: str) -> NoReturn:
    """Reject one key of a table that is being validated as a single value."""
    raise ValidationError.from_exception_data("", [_details(Mistake((key,), value, sentence))])


def _details(problem: Mistake) -> InitErrorDetails:
    context = {"sentence": problem.sentence, "missing": problem.value is MISSING}
    value = None if problem.value is MISSING else problem.value
    return InitErrorDetails(
        type=PydanticCustomError("deck", "{sentence}", context), loc=problem.key, input=value
    )


def problems_of(error: ValidationError) -> list[Mistake]:
    """Return the problems that a `Table` found while it was validated."""
    return [Table._problem(details) for details in error.errors(include_url=False)]
