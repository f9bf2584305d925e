"""The base of the tables of a deck: strict keys, and a sentence for each mistake.

A `Table` is a pydantic model that forbids unknown keys and turns the errors of pydantic into `Mistake`
sentences, which one `DeckError` reports together.
"""

from __future__ import annotations

import contextlib
import functools
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, NoReturn, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from ..text import folded, listed, nearest
from .faults import MISSING, NOWHERE, Mistake, Source, deck_error
from .kinds import Kind, Schema
from .units import LENGTH, UnitError, readable, to_si


def meaning(default: Any, words: str, example: str = "") -> Any:
    """Return the field of a key with its description; it is required if its default is ``...``.

    An example, as in a deck, is for keys that need another one than that of their kind.
    """
    return Field(default, description=words, examples=[example] if example else None)


SYMBOLS = {
    **dict.fromkeys(("E", "modulus"), "young_modulus"),
    **dict.fromkeys(("nu", "ν", "v", "poisson"), "poisson_ratio"),
    **dict.fromkeys(("mu", "μ", "µ", "cof", "f", "coefficient"), "friction.coefficient"),
    **dict.fromkeys(("P", "F", "N", "Fn", "Fz", "load", "force"), "normal_load"),
    **dict.fromkeys(("Q", "Qx", "Ft", "Fx", "force_x", "shear_load"), "tangential_load_x"),
    **dict.fromkeys(("Qy", "Fy", "force_y"), "tangential_load_y"),
    **dict.fromkeys(("M", "Mz"), "torque"),
    **dict.fromkeys(("delta", "δ", "depth", "d"), "approach"),
    **dict.fromkeys(("ux", "sx", "displacement_x"), "shift_x"),
    **dict.fromkeys(("uy", "sy", "displacement_y"), "shift_y"),
    **dict.fromkeys(("R", "r", "diameter"), "radius"),
    **{f"diameter_{axis}": f"radius_{axis}" for axis in "xy"},
    **dict.fromkeys(("h", "dx", "l_e", "mesh"), "spacing"),
    **{"height": "length", "periodic": "boundary", "creepage": "creepage_x"},
    **dict.fromkeys(("coatings", "layer", "layers", "film"), "coating"),
}
"""Keys of decks by the symbols and words of engineers, with the table if several have such a key."""

_NOT_INCLUDED = {
    "plasticity": ("plastic", "yield", "hardening", "hardness"),
    "heat": ("temperature", "thermal", "heat", "conductivity"),
    "lubrication": ("lubricat", "viscosity", "fluid"),
    "adhesion": ("adhesi", "surfaceenergy", "workofadhesion"),
    "viscoelastic bodies": ("viscoelastic", "prony"),
    "anisotropic bodies": ("anisotrop", "orthotropicstiffness"),
    "inertia": ("density", "mass", "inertia", "velocity", "frequency"),
}
"""Features that the program does not have (docs/limits.md), with the beginnings of their words, folded."""


def not_included(word: str) -> str:
    """Return the sentence about a feature that is not included; empty for other words."""
    of_word = folded(word[:100])
    found = [name for name, words in _NOT_INCLUDED.items() if of_word.startswith(words)]
    return f"{found[0]}: not included (docs/limits.md says what is, and what to do instead)" if found else ""


Conflicts = Iterator[tuple[str, str]]
"""Key and sentence of each fault of a table as a whole; an empty key is the whole table."""


def refused(data: Mapping[str, Any], keys: Iterable[str], sentence: str) -> Conflicts:
    """Yield the given ones of some keys with a sentence."""
    for key in keys:
        if key in data:
            yield key, sentence


def not_both(data: Mapping[str, Any], *keys: str) -> Conflicts:
    """Yield the second of the given ones of some keys that exclude each other."""
    first, second, *_ = *filter(data.__contains__, keys), "", ""
    if second:
        yield second, f"expected {first} or {second}, not both"


class Table(BaseModel):
    """A table of a deck: immutable, with known keys only, and with all mistakes reported together."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=False, defer_build=True)

    schema_of_all: ClassVar[Schema] = {}
    """Conditions of the schema on several keys."""

    schema_if_whole: ClassVar[Schema] = {}
    """Further conditions if no key of the table is in an included deck."""

    @classmethod
    def conflicts(cls, data: Mapping[str, Any]) -> Conflicts:
        """Yield keys that exclude or need each other, from the table as written."""
        yield from ()

    @classmethod
    @functools.cache
    def known_keys(cls) -> Mapping[str, Any]:
        """Return the fields of the table by the keys of decks."""
        return {info.alias or name: info for name, info in cls.model_fields.items()}

    @classmethod
    def meant(cls, key: str) -> str:
        """Return the known key that an unknown one may mean, also in an inner table; empty if none."""
        known = cls.known_keys()
        same = {folded(name): name for name in known}.get(folded(key[:100]), key)
        path = SYMBOLS.get(key) or (SYMBOLS.get(key.lower(), same) if len(key) > 2 else same)
        table, _, word = path.rpartition(".")
        elsewhere = table and table != cls.__name__.lower() and word != key
        if word in known and not elsewhere:
            return word
        below = [
            f"{name}.{word}"
            for name, info in known.items()
            for part in parts_of(info.annotation)
            if issubclass(part, Table) and word in part.known_keys()
        ]
        if below:
            return path if path in below else below[0]
        if elsewhere:
            return path
        return nearest(key, known)

    @classmethod
    def parse(cls, data: Mapping[str, Any], source: Source) -> Self:
        """Return the checked table of a file."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise deck_error(problems_of(error), source) from None

    def written(self, defaults: bool = True) -> dict[str, Any]:
        """Return the keys with values as a deck holds them; without `defaults` only values that differ."""
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
        """Describe the keys; which are required depends on the included decks."""
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
        table, found = None, []
        try:
            table = handler(data)
        except ValidationError as error:
            found = [cls._problem(details) for details in error.errors(include_url=False)]
        conflicts = list(cls.conflicts(data)) if isinstance(data, Mapping) else []
        if not (found or conflicts):
            return table
        if isinstance(data, Mapping):
            # A key that an unknown one means is not reported as missing.
            known = cls.known_keys()
            meant = {key: cls.meant(str(key)) for key in data if key not in known}
            given = {tuple(key.split(".")) for key in meant.values() if key}
            found = [problem for problem in found if problem.value is not MISSING or problem.key not in given]
            if other := next((key for key, of in meant.items() if of.startswith("shape = ")), None):
                raise _error(cls.__name__, [problem for problem in found if problem.key == (other,)])
            corrected = {meant.get(key) or key: value for key, value in data.items()}
            remaining = list(cls.conflicts(corrected))
            blamed = {problem.key for problem in found}
            for key, sentence in conflicts:
                if (key, sentence) in remaining and (key,) not in blamed:
                    found.append(Mistake((key,) if key else (), data.get(key, MISSING), sentence))
        if found:
            raise _error(cls.__name__, found)
        return table

    @classmethod
    def _problem(cls, details: Any) -> Mistake:
        key, value, kind = details["loc"], details["input"], details["type"]
        if kind == "deck":
            context = details["ctx"]  # an inner table has marked missing values
            return Mistake(key, MISSING if context.get("missing") else value, context["sentence"])
        known = cls.known_keys()
        if kind == "missing":
            return Mistake(key, MISSING, f"missing; expected {expectation(known[key[0]])}")
        if kind == "extra_forbidden":
            word = str(key[0])
            if feature := not_included(word):
                return Mistake(key, MISSING, f"unknown key; {feature}")
            if folded(word).startswith("diameter") and (radius := cls.meant(word)):
                sentence = f"unknown key; use {radius}, half the diameter"
                with contextlib.suppress(UnitError):
                    sentence += f": {readable(to_si(value, LENGTH) / 2.0, 12)}"
                return Mistake(key, value, sentence)
            near = cls.meant(word)
            hint = f"did you mean {near}?" if near else f"known here: {listed(sorted(known), 'and')}"
            return Mistake(key, MISSING, f"unknown key; {hint}")
        if kind == "list_type":
            return Mistake(key, MISSING, "expected an array of tables: write [[]]")
        if kind == "too_short":
            return Mistake(key, MISSING, "expected at least one entry")
        if kind in ("model_type", "model_attributes_type", "dict_type"):
            return Mistake(key, value, "expected a table of keys")
        if kind == "value_error":  # of a whole table
            return Mistake(key, MISSING, str(details["ctx"]["error"]))
        return Mistake(key, value, details["msg"])


def extended(table: type[Table], keys: dict[str, Any]) -> Any:
    """Return a table with further keys, each with annotation and `meaning`."""
    return create_model(table.__name__, __base__=table, **keys)


class Argument(Table):
    """A table that is also made in Python, where mistakes raise a DeckError."""

    def __init__(self, /, **keys: Any) -> None:
        try:
            super().__init__(**keys)
        except ValidationError as error:
            raise deck_error(problems_of(error), NOWHERE) from error


def _written(value: Any, defaults: bool) -> Any:
    """Return tables as a deck holds them."""
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
    """Return the expected value of a field in words, for messages and for the deck reference."""
    if kind := kind_of(info):
        return kind.expected
    return "an array of tables of keys" if "list[" in str(info.annotation) else "a table of keys"


def refuse_key(key: str, value: object, sentence: str) -> NoReturn:
    """Reject one key of a table that is validated as a single value."""
    raise _error("", [Mistake((key,), value, sentence)])


def parts_of(annotation: Any) -> list[type]:
    """Return the classes in an annotation such as ``Table | None``."""
    return [part for part in (annotation, *get_args(annotation)) if isinstance(part, type)]


def _error(title: str, problems: Sequence[Mistake]) -> ValidationError:
    """Return the error of pydantic for some mistakes."""
    details: list[InitErrorDetails] = []
    for key, value, sentence in problems:
        missing = value is MISSING
        error = PydanticCustomError("deck", "{sentence}", {"sentence": sentence, "missing": missing})
        details.append({"type": error, "loc": key, "input": None if missing else value})
    return ValidationError.from_exception_data(title, details)


def problems_of(error: ValidationError) -> list[Mistake]:
    """Return the mistakes of a `Table` from a failed validation."""
    return [Table._problem(details) for details in error.errors(include_url=False)]
