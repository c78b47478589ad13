"""Parsing of questions."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import QueryError
from supermap_cli.query.grammar import NounPhrase, Question, RelationPhrase, TimePhrase, parse
from supermap_cli.query.relations import RELATION_WORDS

TRAVERSALS = ("monday", "run 2", "kitchen.2")


def parsed(text: str) -> tuple[str, NounPhrase, TimePhrase]:
    question = parse(text, TRAVERSALS)
    return question.intent, question.phrase, question.time


NOW = TimePhrase("now")
CUP_ON_TABLE = NounPhrase("cup", RelationPhrase("on", NounPhrase("table")))
CHAIRS_BESIDE_TABLE = NounPhrase("chairs", RelationPhrase("beside", NounPhrase("table")))


@pytest.mark.parametrize(
    ("text", "intent", "phrase", "time"),
    [
        ("cup", "find", NounPhrase("cup"), NOW),
        ("cup on the table", "find", CUP_ON_TABLE, NOW),
        ("Where is the cup on the table?", "find", CUP_ON_TABLE, NOW),
        ("is there a cup sitting on top of the table", "exists", CUP_ON_TABLE, NOW),
        ("chair near tv", "find", NounPhrase("chair", RelationPhrase("near", NounPhrase("tv"))), NOW),
        ("which chairs are next to the table", "find", CHAIRS_BESIDE_TABLE, NOW),
        ("how many chairs", "count", NounPhrase("chairs"), NOW),
        ("how many chairs are there right now?", "count", NounPhrase("chairs"), NOW),
        ("count the chairs", "count", NounPhrase("chairs"), NOW),
        ("piano", "find", NounPhrase("piano"), NOW),
        ("where is the trash can", "find", NounPhrase("trash can"), NOW),
        ("how many trash can are there", "count", NounPhrase("trash can"), NOW),
        ("trash can near the tv", "find", NounPhrase("trash can", RelationPhrase("near", NounPhrase("tv"))), NOW),
        ("which chairs can you see", "find", NounPhrase("chairs"), NOW),
        ("can you see the chair", "find", NounPhrase("chair"), NOW),
        ("what is on the table", "find", NounPhrase(None, RelationPhrase("on", NounPhrase("table"))), NOW),
        ("list all objects", "find", NounPhrase(None), NOW),
        ("cup on the table earlier", "find", CUP_ON_TABLE, TimePhrase("earlier")),
        ("chairs before", "find", NounPhrase("chairs"), TimePhrase("earlier")),
        ("where was the cup first", "find", NounPhrase("cup"), TimePhrase("first")),
        ("where was the cup", "find", NounPhrase("cup"), TimePhrase("last")),
        ("where was the cup last seen", "find", NounPhrase("cup"), TimePhrase("last")),
        ("chairs in monday", "find", NounPhrase("chairs"), TimePhrase("traversal", "monday")),
        ("chairs during the Monday run", "find", NounPhrase("chairs"), TimePhrase("traversal", "monday")),
        ("chairs in run 2", "find", NounPhrase("chairs"), TimePhrase("traversal", "run 2")),
        ("chairs in kitchen.2", "find", NounPhrase("chairs"), TimePhrase("traversal", "kitchen.2")),
        ("chairs in the first traversal", "find", NounPhrase("chairs"), TimePhrase("traversal", "first")),
        ("chairs in first", "find", NounPhrase("chairs"), TimePhrase("traversal", "first")),
        ("chairs in the last", "find", NounPhrase("chairs"), TimePhrase("traversal", "last")),
        ("chairs in traversal 2", "find", NounPhrase("chairs"), TimePhrase("traversal", "2")),
        ("cup in the box", "find", NounPhrase("cup", RelationPhrase("inside", NounPhrase("box"))), NOW),
        ("cup on the table in monday", "find", CUP_ON_TABLE, TimePhrase("traversal", "monday")),
        ("cup at 10:21", "find", NounPhrase("cup"), TimePhrase("at", "10:21")),
        ("cup at 12.5 s", "find", NounPhrase("cup"), TimePhrase("at", "12.5")),
        ("cup at 10:21 in monday", "find", NounPhrase("cup"), TimePhrase("at", "monday@10:21")),
        ("cup at 12 s in the first traversal", "find", NounPhrase("cup"), TimePhrase("at", "first@12")),
        ("cup at Monday@10:21", "find", NounPhrase("cup"), TimePhrase("at", "monday@10:21")),
        ("cup at run 2+12.5s", "find", NounPhrase("cup"), TimePhrase("at", "run 2+12.5s")),
        (
            "cup on table near tv",
            "find",
            NounPhrase("cup", RelationPhrase("on", NounPhrase("table", RelationPhrase("near", NounPhrase("tv"))))),
            NOW,
        ),
    ],
)  # fmt: skip
def test_questions(text: str, intent: str, phrase: NounPhrase, time: TimePhrase) -> None:
    assert parsed(text) == (intent, phrase, time)


@pytest.mark.parametrize(
    "text",
    ["", "  ?", "how many", "the", "why is the cup red", "cup and plate", "cup near", "move the chair", "cup near the"],
)  # fmt: skip
def test_what_is_not_understood_says_what_is(text: str) -> None:
    with pytest.raises(QueryError, match="relations are near"):
        parse(text)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("closest chair to the tv", "'closest' is a superlative"),
        ("the biggest chair", "'biggest' is a superlative"),
        ("chair to the tv", "'chair to the tv' is not understood"),
    ],
)
def test_what_is_not_understood_is_named(text: str, named: str) -> None:
    with pytest.raises(QueryError, match=named):
        parse(text)


@pytest.mark.parametrize(("phrase", "name"), RELATION_WORDS)
def test_every_relation_phrase_is_understood(phrase: str, name: str) -> None:
    assert parse(f"the red cup {phrase} a table").phrase == NounPhrase(
        "red cup", RelationPhrase(name, NounPhrase("table"))
    )  # type: ignore[arg-type]


WORDS = ("how many", "is there", "the", "a", "cup", "table", "on", "in", "near", "monday", "first", "at", "10:21", "of")


@given(st.text(max_size=60) | st.lists(st.sampled_from(WORDS), max_size=8).map(" ".join))
def test_any_text_is_a_question_or_a_query_error(text: str) -> None:
    with contextlib.suppress(QueryError):
        assert isinstance(parse(text, TRAVERSALS), Question)
