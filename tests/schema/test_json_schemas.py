"""The published schemas are schemas, self-contained, and strict."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from supermap_schema.json_schemas import load_schema, schema_names

NAMES = (
    *("answer", "show", "object", "history", "diff", "navigate", "localize", "export"),
    *("inspect", "build", "plugins", "config"),
    *("truth", "simulate", "simulate_list", "eval", "ablation", "benchmark", "domain_suite", "bench"),
    *("bench_memory", "perception", "questions"),
    *("models_list", "models_verify"),
    *("db_info", "db_check", "db_upgrade", "db_sql", "db_merge", "db_vacuum"),
)


def parts(schema: object) -> Iterator[dict[str, Any]]:
    if isinstance(schema, dict):
        yield schema
        for value in schema.values():
            yield from parts(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from parts(value)


def test_there_is_one_for_every_document() -> None:
    assert set(NAMES) == set(schema_names())


@pytest.mark.parametrize("name", NAMES)
def test_a_schema_is_valid_and_closed(name: str) -> None:
    schema = load_schema(name)
    Draft202012Validator.check_schema(schema)
    for part in parts(schema):
        if "$ref" in part:
            assert part["$ref"].removeprefix("#/$defs/") in schema["$defs"]
        if "properties" in part and part.get("type") == "object":
            assert part["additionalProperties"] is False


def test_an_unknown_name_lists_those_there_are() -> None:
    with pytest.raises(KeyError, match="answer"):
        load_schema("song")
