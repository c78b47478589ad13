"""A typed question, written as English, is parsed to the same typed question."""

from __future__ import annotations

from hypothesis import HealthCheck, assume, given, settings

from supermap_cli.language.english import question_in_english
from supermap_cli.language.language_data import language_data
from supermap_cli.language.parsing import parse
from supermap_cli.language.questions import Holds, Question
from supermap_cli.language.words import MOST_CHARACTERS, MOST_WORDS, read_words
from support.random_questions import QUESTIONS
from support.typed_questions import KNOWN, short_question


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(QUESTIONS)
def test_a_sentence_of_a_question_asks_the_same(question: Question) -> None:
    sentence = question_in_english(question)
    assume(not _is_counted(question))
    assume(len(read_words(sentence, language_data("en"))) <= MOST_WORDS and len(sentence) <= MOST_CHARACTERS)
    assert short_question(parse(sentence, KNOWN, "en")) == short_question(question), sentence


def _is_counted(question: Question) -> bool:
    """Whether it is asked of so many things if they are so, which reads as whether there are so many."""
    body = question.body
    return isinstance(body, Holds) and body.things.number is not None
