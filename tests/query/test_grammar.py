"""How questions are understood."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.errors import QueryError
from supermap_cli.query.grammar import Question, RelatedTo, Things, TimePhrase, parse
from supermap_cli.query.relations import RELATION_WORDS

TRAVERSALS = ("monday", "run 2", "kitchen.2")


def understood(text: str) -> tuple[str, Things, TimePhrase]:
    question = parse(text, TRAVERSALS)
    return question.intent, question.things, question.time


NOW = TimePhrase("now")
CUP_ON_TABLE = Things("cup", RelatedTo("on", Things("table")))


@pytest.mark.parametrize(
    ("text", "intent", "things", "time"),
    [
        ("cup", "find", Things("cup"), NOW),
        ("cup on the table", "find", CUP_ON_TABLE, NOW),
        ("Where is the cup on the table?", "find", CUP_ON_TABLE, NOW),
        ("is there a cup sitting on top of the table", "exists", CUP_ON_TABLE, NOW),
        ("chair near tv", "find", Things("chair", RelatedTo("near", Things("tv"))), NOW),
        ("which chairs are next to the table", "find", Things("chairs", RelatedTo("beside", Things("table"))), NOW),
        ("how many chairs", "count", Things("chairs"), NOW),
        ("how many chairs are there right now?", "count", Things("chairs"), NOW),
        ("count the chairs", "count", Things("chairs"), NOW),
        ("piano", "find", Things("piano"), NOW),
        ("where is the trash can", "find", Things("trash can"), NOW),
        ("how many trash can are there", "count", Things("trash can"), NOW),
        ("trash can near the tv", "find", Things("trash can", RelatedTo("near", Things("tv"))), NOW),
        ("which chairs can you see", "find", Things("chairs"), NOW),
        ("can you see the chair", "find", Things("chair"), NOW),
        ("what is on the table", "find", Things(None, RelatedTo("on", Things("table"))), NOW),
        ("list all objects", "find", Things(None), NOW),
        ("cup on the table earlier", "find", CUP_ON_TABLE, TimePhrase("earlier")),
        ("chairs before", "find", Things("chairs"), TimePhrase("earlier")),
        ("where was the cup first", "find", Things("cup"), TimePhrase("first")),
        ("where was the cup", "find", Things("cup"), TimePhrase("last")),
        ("where was the cup last seen", "find", Things("cup"), TimePhrase("last")),
        ("chairs in monday", "find", Things("chairs"), TimePhrase("traversal", "monday")),
        ("chairs during the Monday run", "find", Things("chairs"), TimePhrase("traversal", "monday")),
        ("chairs in run 2", "find", Things("chairs"), TimePhrase("traversal", "run 2")),
        ("chairs in kitchen.2", "find", Things("chairs"), TimePhrase("traversal", "kitchen.2")),
        ("chairs in the first traversal", "find", Things("chairs"), TimePhrase("traversal", "first")),
        ("chairs in first", "find", Things("chairs"), TimePhrase("traversal", "first")),
        ("chairs in the last", "find", Things("chairs"), TimePhrase("traversal", "last")),
        ("chairs in traversal 2", "find", Things("chairs"), TimePhrase("traversal", "2")),
        ("cup in the box", "find", Things("cup", RelatedTo("inside", Things("box"))), NOW),
        ("cup on the table in monday", "find", CUP_ON_TABLE, TimePhrase("traversal", "monday")),
        ("cup at 10:21", "find", Things("cup"), TimePhrase("at", "10:21")),
        ("cup at 12.5 s", "find", Things("cup"), TimePhrase("at", "12.5")),
        ("cup at 10:21 in monday", "find", Things("cup"), TimePhrase("at", "monday@10:21")),
        ("cup at 12 s in the first traversal", "find", Things("cup"), TimePhrase("at", "first@12")),
        ("cup at Monday@10:21", "find", Things("cup"), TimePhrase("at", "monday@10:21")),
        ("cup at run 2+12.5s", "find", Things("cup"), TimePhrase("at", "run 2+12.5s")),
        (
            "cup on table near tv",
            "find",
            Things("cup", RelatedTo("on", Things("table", RelatedTo("near", Things("tv"))))),
            NOW,
        ),
    ],
)  # fmt: skip
def test_questions(text: str, intent: str, things: Things, time: TimePhrase) -> None:
    assert understood(text) == (intent, things, time)


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
    assert parse(f"the red cup {phrase} a table").things == Things("red cup", RelatedTo(name, Things("table")))  # type: ignore[arg-type]


WORDS = ("how many", "is there", "the", "a", "cup", "table", "on", "in", "near", "monday", "first", "at", "10:21", "of")


@given(st.text(max_size=60) | st.lists(st.sampled_from(WORDS), max_size=8).map(" ".join))
def test_any_text_is_a_question_or_a_query_error(text: str) -> None:
    with contextlib.suppress(QueryError):
        assert isinstance(parse(text, TRAVERSALS), Question)
