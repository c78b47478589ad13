"""Any typed question is answered by the published schema, or refused."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, given, settings
from jsonschema import Draft202012Validator

from supermap_cli.errors import QueryError
from supermap_cli.language.questions import Question
from supermap_cli.memory import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answers import answer_question
from supermap_cli.query.views import to_document
from supermap_schema.json_schemas import load_schema
from support import kitchen
from support.databases import examples
from support.random_questions import QUESTIONS

SCHEMA = Draft202012Validator(load_schema("answer"))


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MapReader]:
    path = kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        yield reader


@settings(max_examples=examples(100), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(question=QUESTIONS)
def test_any_question_has_an_answer_or_a_refusal(reader: MapReader, question: Question) -> None:
    with suppress(QueryError):
        SCHEMA.validate(to_document(answer_question(question, reader, explain=True)))
