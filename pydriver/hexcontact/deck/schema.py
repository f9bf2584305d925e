"""JSON schema of the deck, for editors that complete and check TOML, made from the models that check decks.

A schema says less than ``hexcontact check``: which keys and words there are, what is a quantity, what is
required.
"""

from __future__ import annotations

from typing import Any, get_args

from pydantic.json_schema import GenerateJsonSchema

from .kinds import Schema
from .model import Table, kind_of
from .tables import Deck


class _Generator(GenerateJsonSchema):
    """Decks have no nulls, and need no titles of keys."""

    def nullable_schema(self, schema: Any) -> Schema:
        return self.generate_inner(schema["schema"])

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def deck_schema() -> Schema:
    """Return the schema of a whole deck (draft 2020-12)."""
    schema = Deck.model_json_schema(schema_generator=_Generator)
    return {
        "$schema": _Generator.schema_dialect,
        "title": "hexcontact deck",
        **schema,
        "description": "A contact problem of two elastic half-spaces",
        "properties": {"$schema": {"type": "string"}, **schema["properties"]},
        # what a deck leaves out may stand in those that it includes
        "if": {"required": ["include"]},
        "else": _whole(Deck),
    }


def _whole(table: type[Table]) -> Schema:
    """Return what a deck without includes must say."""
    keys = table.known_keys().items()
    inner = {
        key: _whole(part)
        for key, info in keys
        for part in (info.annotation, *get_args(info.annotation))
        if kind_of(info) is None and isinstance(part, type) and issubclass(part, Table)
    }
    schema: Schema = {"required": [key for key, info in keys if info.is_required()]} | table.schema_if_whole
    return schema | ({"properties": inner} if inner else {})
