"""JSON schema of the deck, for editors that complete and check TOML, from the models that check decks.

A schema contains less than the rules of ``hexcontact check``: keys, words, quantities, required keys.
"""

from __future__ import annotations

from typing import Any, get_args

from pydantic.json_schema import GenerateJsonSchema

from .keys import Deck
from .kinds import Schema
from .table_base import Table, kind_of


class _Generator(GenerateJsonSchema):
    """A generator of schemas without nulls and titles of keys."""

    def nullable_schema(self, schema: Any) -> Schema:
        return self.generate_inner(schema["schema"])

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def deck_schema() -> Schema:
    """Return the schema of a whole deck (draft 2020-12)."""
    schema = schema_of(Deck, "hexcontact deck", "A contact problem of two elastic half-spaces")
    # Required keys may be in an included deck.
    return {**schema, "if": {"required": ["include"]}, "else": _whole(Deck)}


def schema_of(table: type[Table], title: str, description: str) -> Schema:
    """Return the schema of a file with the keys of a table, none of them required."""
    schema = table.model_json_schema(schema_generator=_Generator)
    return {
        "$schema": _Generator.schema_dialect,
        "title": title,
        **schema,
        "description": description,
        "properties": {"$schema": {"type": "string"}, **schema["properties"]},
    }


def _whole(table: type[Table]) -> Schema:
    """Return the schema of the required keys of a deck without includes."""
    keys = table.known_keys().items()
    inner = {
        key: _whole(part)
        for key, info in keys
        for part in (info.annotation, *get_args(info.annotation))
        if kind_of(info) is None and isinstance(part, type) and issubclass(part, Table)
    }
    schema: Schema = {"required": [key for key, info in keys if info.is_required()]} | table.schema_if_whole
    return schema | ({"properties": inner} if inner else {})
