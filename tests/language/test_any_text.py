"""Whatever the text: a typed question that holds all of its words, or a refusal; soon, and the same every time."""

from __future__ import annotations

import os
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from supermap_cli.language.parsing import grammar
from support.typed_questions import KNOWN, LABELS, read

EXAMPLES = int(os.environ.get("SUPERMAP_FUZZ_EXAMPLES", "100"))
WORDS = sorted({word for phrase in grammar("en").phrases for word in phrase.split()})
PHRASES = sorted({*grammar("en").phrases, *KNOWN.relations["en"]})
MADE_UP = ("quix", "frobnitz", "zorgs", "blorp", "snarkle")
DISTINCT = tuple(label for label in LABELS if label.isalpha() and label not in WORDS and label not in ("mouse", "cup"))
"""Labels of one word that are no word of the grammar, so that each stands for a thing wherever it is."""

SENTENCES = st.lists(st.sampled_from((*PHRASES, *LABELS, *LABELS)), max_size=9).map(" ".join)
OPENERS = ("where is", "how many", "is there", "what is on", "which", "find", "is", "when did", "what changed near")


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.text(max_size=500))
def test_any_text_is_a_question_or_refused(text: str) -> None:
    read(text)


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(OPENERS), SENTENCES)
def test_a_question_holds_every_thing_that_it_names(opener: str, rest: str) -> None:
    text = f"{opener} {rest}"
    understood = read(text)
    if understood.startswith("refused: "):
        return
    for label in DISTINCT:
        assert understood.count(f"'{label}'") >= text.split().count(label), text


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(OPENERS), SENTENCES, st.sampled_from(MADE_UP), st.integers(0, 9))
def test_a_word_that_nobody_knows_is_never_passed_over(opener: str, rest: str, unknown: str, at: int) -> None:
    words = rest.split()
    text = " ".join([opener, *words[:at], unknown, *words[at:]])
    assert read(text).startswith("refused: "), text


@pytest.mark.parametrize(
    "text",
    [
        "cup near " * 29 + "cup",
        "(" * 50,
        "cup (" * 25,
        "red " * 50 + "cup",
        "cup on desk or not near tv and left of chair " * 5,
        "table with a cup on it " * 9,
        "cup that moved since monday that moved since tuesday that moved " * 4,
        "monday " * 50,
        "not " * 50 + "near",
        "a" * 400,
        "where is the cup" + " " * 10_000,
        "\u0000\ud7ff\u200f" * 30,
    ],
    ids=lambda text: text[:24],
)
def test_no_text_takes_long(text: str) -> None:
    begun = time.process_time()
    read(text)
    assert time.process_time() - begun < 5.0  # seconds; the longest takes 0.7 s


def test_reading_a_question_takes_milliseconds() -> None:
    texts = ("where is the cup", "how many chairs are near the table on monday", "what changed since monday")
    for text in texts:
        read(text)
    begun = time.process_time()
    for text in texts * 10:
        read(text)
    assert (time.process_time() - begun) / 30 < 0.02  # seconds; 1.5 ms are usual
