"""JSON schema of the deck, for editors that complete and check TOML, made from the models that check decks.

A schema says less than ``hexcontact check``: which keys and words there are, what is a quantity, what is
required.
"""

from __future__ import annotations

import functools
import types
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic_core import PydanticUndefined

from . import surfaces
from .kinds import Flag, Kind, Quantity, Several, Table, Text, Whole, Word, WordOr
from .series import LOADS, OrEmpty
from .tables import Bodies, Body, Deck, Fractions, Grid, Segment
from .units import ANGLE, NUMBER

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_DIGITS = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"


def deck_schema() -> Schema:
    """Return the schema of a whole deck (draft 2020-12)."""
    properties = _properties(Deck)
    return {
        "$schema": DIALECT,
        "title": "hexcontact deck",
        "description": "A contact problem of two elastic half-spaces",
        "type": "object",
        "additionalProperties": False,
        "properties": {"$schema": {"type": "string"}, **properties},
        # what a deck leaves out may stand in those that it includes
        "if": {"required": ["include"]},
        "else": _complete(Deck),
    }


def _properties(table: type[Table]) -> Schema:
    return {key: _of_field(info) for key, info in table.known_keys().items()}


def _of_field(info: Any) -> Schema:
    schema = _of(info.annotation, info.metadata)
    if info.description:
        schema["description"] = info.description[0].upper() + info.description[1:]
    if info.default not in (None, PydanticUndefined, ""):
        default = info.default
        schema["default"] = list(default) if isinstance(default, tuple) else default
        if any(isinstance(kind, Quantity) and kind.dimension is ANGLE for kind in info.metadata):
            schema["default"] = f"{default:g} deg"
    return schema


def _of(annotation: Any, metadata: Any = ()) -> Schema:
    """Return the schema of a field: what its kind says, else that of its tables."""
    for entry in metadata:
        if isinstance(entry, Kind):
            return _of_kind(entry)
    if get_origin(annotation) is Annotated:
        inner, *entries = get_args(annotation)
        return _of(inner, entries)
    if get_origin(annotation) in (Union, types.UnionType):
        return next(_of(part) for part in get_args(annotation) if part is not type(None))
    if get_origin(annotation) is list:
        return {"type": "array", "minItems": 1, "items": _of(get_args(annotation)[0])}
    return _of_table(annotation)


def _of_table(table: type[Table]) -> Schema:
    schema: Schema = {"type": "object", "additionalProperties": False, "properties": _properties(table)}
    if table.__doc__ and table is not Bodies:
        schema["description"] = table.__doc__.splitlines()[0]
    if issubclass(table, Segment):
        schema["allOf"] = [{"not": {"required": list(pair)}} for pair in LOADS.values()]
    return schema


@functools.singledispatch
def _of_kind(kind: Kind) -> Schema:
    return {}


@_of_kind.register
def _(kind: Quantity) -> Schema:
    bounds = {"exclusiveMinimum": kind.above, "minimum": kind.at_least, "maximum": kind.at_most}
    number = {"type": "number"} | {key: bound for key, bound in bounds.items() if bound is not None}
    least = kind.above if kind.above is not None else kind.at_least
    sign = r"\+?" if least is not None and least >= 0 else "[+-]?"
    text = {"type": "string", "pattern": rf"^\s*{sign}{_DIGITS}\s*[^\s\d.+-].*$"}
    expected = kind.expected[0].upper() + kind.expected[1:]
    if not kind.dimension.bare:
        return text | {"description": expected, "examples": [kind.dimension.example.strip('"')]}
    unit = "" if kind.dimension is NUMBER else f"; a bare number is in {kind.dimension.unit}"
    examples = [] if kind.dimension is NUMBER else [kind.dimension.example.strip('"')]
    return {"anyOf": [text, number], "description": expected + unit} | (
        {"examples": examples} if examples else {}
    )


@_of_kind.register
def _(kind: surfaces.CoefficientKind) -> Schema:
    return {"type": ["number", "string"], "description": kind.expected}


@_of_kind.register
def _(kind: Whole) -> Schema:
    return {"type": "integer", "minimum": kind.at_least, "maximum": kind.at_most}


@_of_kind.register
def _(kind: Word) -> Schema:
    return {"enum": list(kind.words)}


@_of_kind.register
def _(kind: Text) -> Schema:
    return {"type": "string"}


@_of_kind.register
def _(kind: Flag) -> Schema:
    return {"type": "boolean"}


@_of_kind.register
def _(kind: Several) -> Schema:
    schema: Schema = {"type": "array", "items": _of_kind(kind.kind), "minItems": kind.count or 1}
    if kind.count:
        schema["maxItems"] = kind.count
    return schema


@_of_kind.register
def _(kind: Fractions) -> Schema:
    return {"type": "array", "items": _of_kind(kind.kind), "minItems": 1, "uniqueItems": True}


@_of_kind.register
def _(kind: OrEmpty) -> Schema:
    return {"anyOf": [{"const": ""}, _of_kind(kind.kind)]}


@_of_kind.register
def _(kind: WordOr) -> Schema:
    return {"anyOf": [{"const": kind.word}, _of_kind(kind.kind)]}


@_of_kind.register
def _(kind: surfaces.SurfaceKind) -> Schema:
    return {
        "oneOf": [
            {
                "title": name,
                "description": shape.formula,
                "type": "object",
                "additionalProperties": False,
                "required": ["shape", *_required(shape)],
                "properties": {**_properties_of_shape(shape), "shape": {"const": name}},
            }
            for name, shape in surfaces.SHAPES.items()
        ]
    }


def _properties_of_shape(shape: type[surfaces.Surface]) -> Schema:
    return {key: _of_field(info) for key, info in shape.known_keys().items() if key != "shape"}


def _required(table: type[Table]) -> list[str]:
    return [key for key, info in table.known_keys().items() if info.is_required()]


def _complete(table: type[Table]) -> Schema:
    """Return what a deck without includes must say."""
    elastic = {"required": ["young_modulus", "poisson_ratio"]}
    moduli = {"not": {"anyOf": [{"required": [key]} for key in elastic["required"]]}}
    rigid = {"properties": {"rigid": {"const": True}}, "required": ["rigid"]}
    fineness = ("spacing", "nodes_across", "nodes_in_radius")
    if table is Body:
        return {"if": rigid, "then": moduli, "else": elastic}
    schema: Schema = {"required": _required(table)}
    inner: Schema = {}
    for key, info in table.known_keys().items():
        parts = [info.annotation, *get_args(info.annotation)]
        for part in parts:
            if isinstance(part, type) and issubclass(part, Table) and not issubclass(part, surfaces.Surface):
                inner[key] = _complete(part)
    if table is Grid:
        schema["oneOf"] = [{"required": [key]} for key in fineness]
    if inner:
        schema["properties"] = inner
    return schema
