"""Typed questions as JSON: every sentence of the tests there and back, and what is no question."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from supermap_cli.errors import QueryError
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.parsing import parse
from supermap_cli.language.typed_json import question_from_json, question_to_json, typed_question_schema

SENTENCES = [
    json.loads(line)["text"] for line in (Path(__file__).parent / "english.jsonl").read_text().splitlines() if line
][::12]
KNOWN = KnownNames(traversals=["monday", "tuesday"])
SCHEMA = Draft202012Validator(typed_question_schema())
CHAIRS = {"kind": "Things", "noun": {"kind": "Named", "name": "chair"}}


def test_every_question_is_the_same_after_json() -> None:
    read = 0
    for text in SENTENCES:
        try:
            question = parse(text, KNOWN)
        except QueryError:
            continue
        document = json.loads(json.dumps(question_to_json(question)))
        SCHEMA.validate(document)
        again = question_from_json(document)
        assert (again.body, again.time) == (question.body, question.time), text
        read += 1
    assert read > 5


def test_the_schema_is_one() -> None:
    Draft202012Validator.check_schema(typed_question_schema())


@pytest.mark.parametrize(
    ("document", "said"),
    [
        (None, "an object is needed"),
        ([], "an object is needed"),
        ({}, "must be one of"),
        ({"kind": "Sing"}, "must be one of"),
        ({"kind": "Count"}, "needs 'things'"),
        ({"kind": "Count", "things": CHAIRS, "more": 1}, "no field 'more'"),
        ({"body": {"kind": "Count", "things": CHAIRS}, "when": 1}, "no field 'when'"),
        ({"kind": "Count", "things": {**CHAIRS, "number": "two"}}, "int is needed"),
        ({"kind": "Count", "things": {**CHAIRS, "number": True}}, "int is needed"),
        ({"kind": "Count", "things": {**CHAIRS, "attributes": [{"kind": "Colour", "name": "beige"}]}}, "none of"),
        ({"body": {"kind": "Count", "things": CHAIRS}, "time": {"kind": "Ago", "seconds": float("nan")}}, "finite"),
    ],
)
def test_what_is_no_question_is_refused_with_its_place(document: Any, said: str) -> None:
    with pytest.raises(QueryError, match=said):
        question_from_json(document)


def test_nested_too_deeply_is_refused() -> None:
    things: dict[str, Any] = CHAIRS
    for _ in range(200):
        things = {**CHAIRS, "condition": {"kind": "Related", "relation": "near", "reference": things}}
    with pytest.raises(QueryError, match="too deeply"):
        question_from_json({"kind": "Count", "things": things})


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["kind", "body", "things", "noun", "condition", "name"]), inner, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=25)
@given(JSON_VALUES)
def test_any_json_is_a_question_or_refused(document: Any) -> None:
    with suppress(QueryError):
        question_from_json(document)
